"""Files: read only if ordinary, written whole or not at all."""

import io
import os
import stat
import uuid
from pathlib import Path
from typing import Any

from .errors import FileError

# A driveline of twenty thousand elements takes a tenth of this [bytes].
LARGEST_FILE = 2**24


def read_text(path: str | Path, language: str = "TOML") -> str:
    """What a text file in UTF-8 holds; only an ordinary file of ordinary size is read."""
    try:
        return read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(f"{written(path)}: not {language}: {error}") from error


def read_bytes(path: str | Path, largest: int = LARGEST_FILE) -> bytes:
    """What a file holds; only an ordinary file of at most so many bytes is read."""
    try:
        _require_regular(os.stat(path))
        with open(path, "rb") as file:
            content = file.read(largest + 1)
        if len(content) > largest:
            raise OSError(0, f"permitted: at most {largest} bytes")
        return content
    except (OSError, ValueError) as error:
        raise FileError(f"{written(path)}: cannot be read: {_reason(error)}") from error


def mat_variables(path: str | Path, largest: int, squeezed: bool = False) -> dict[str, Any]:
    """Variables of a MAT file of version 5 to 7, as scipy reads them, with or without dimensions of length 1."""
    import scipy.io

    content = read_bytes(path, largest)
    try:
        return scipy.io.loadmat(io.BytesIO(content), squeeze_me=squeezed)
    except NotImplementedError as error:
        raise FileError(
            f'{written(path)}: MAT of version 7.3, permitted: up to 7; in MATLAB save(..., "-v7")'
        ) from error
    except Exception as error:  # scipy raises what it happens to meet
        raise FileError(f"{written(path)}: not a MAT file: {error}") from error


def write_whole(path: str | Path, content: str | bytes) -> None:
    """Write a file by renaming a finished copy, so that a failure leaves the old file as it was; text in UTF-8.

    Raises
    ------
    FileError
        The folder cannot be written.
    """
    try:
        target = Path(os.path.realpath(path))  # what a symbolic link stands for
        mode = _mode(target)
        copy = target.with_name(f".{uuid.uuid4().hex}")
        try:
            with open(copy, "xb") as file:
                file.write(content.encode("utf-8") if isinstance(content, str) else content)
            if mode is not None:
                os.chmod(copy, mode)
            os.replace(copy, target)
        except BaseException:
            copy.unlink(missing_ok=True)
            raise
    except (OSError, ValueError) as error:
        raise FileError(f"{written(path)}: cannot be written: {_reason(error)}") from error


def written(path: str | Path) -> str:
    """A path as it is shown: in one line, whatever it holds."""
    name = os.fspath(path)
    return name if name.isprintable() else repr(name)


def _require_regular(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        raise OSError(0, "Is a directory" if stat.S_ISDIR(status.st_mode) else "not an ordinary file")


def _mode(path: Path) -> int | None:
    """Permissions of a file that is replaced; None for a new one, which gets those that are usual here."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        return None
    _require_regular(status)
    return stat.S_IMODE(status.st_mode)


def _reason(error: OSError | ValueError) -> str:
    """Why a path cannot be used; a ValueError is that of one with a zero byte or with what no file system takes."""
    return str(getattr(error, "strerror", None) or error)
