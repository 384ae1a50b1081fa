"""The folder of a report: all its files are written, or none."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..base.errors import FileError
from ..base.paths import written


def require_writable(folder: Path) -> None:
    """Raise a `FileError` where no report can be written, before the work is done; nothing is left there."""
    made = _missing(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder, prefix=".report-"):
            pass
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        raise _unwritable(folder, error) from error
    finally:
        _remove(made)


def write_all(folder: Path, files: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write all files or none: they are finished in a hidden folder beside their places and then moved."""
    made = _missing(folder)
    try:
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        blocked = next((folder / name for name in files if (folder / name).is_dir()), None)
        if blocked is not None:
            raise IsADirectoryError(0, f"{blocked.name} is a folder")
        with tempfile.TemporaryDirectory(dir=folder, prefix=".report-") as staging:
            for name, content in files.items():
                copy = Path(staging, name)
                copy.parent.mkdir(exist_ok=True)
                copy.write_bytes(content)
            for name in files:
                Path(staging, name).replace(folder / name)
    except (OSError, ValueError) as error:
        _remove(made)
        raise _unwritable(folder, error) from error
    return tuple(folder / name for name in files)


def _missing(folder: Path) -> list[Path]:
    """What has to be made, innermost first."""
    try:
        return [path for path in (folder / "figures", folder, *folder.parents) if not path.exists()]
    except (OSError, ValueError):
        return []


def _remove(made: Iterable[Path]) -> None:
    for path in made:
        try:
            path.rmdir()
        except FileNotFoundError:
            continue
        except (OSError, ValueError):
            break


def _unwritable(folder: Path, error: OSError | ValueError) -> FileError:
    reason = getattr(error, "strerror", None) or error
    return FileError(f"{written(folder)}: the report cannot be written there: {reason}")
