"""Drivelines as TOML files: one table per element, SI units."""

from __future__ import annotations

import dataclasses
import os
import re
import stat
import tomllib
import uuid
from pathlib import Path
from typing import Any

from .doors import checked
from .driveline import Driveline
from .elements import ELEMENT_TYPES
from .errors import FileError, PowertrainError, suggestion
from .rows import Element

# A driveline of twenty thousand elements takes a tenth of this [bytes].
LARGEST_FILE = 2**24
# Nothing here is deeper than [element.coefficients]; tomllib takes minutes for keys of many thousand parts.
_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){16}""")

HEADER = """\
# Driveline, one table per element. Torque is positive when side a is turned ahead of side b.
units = "SI"  # kg m^2, kg, N m/rad, N m s/rad, N/m, N s/m, m, N m
"""


@checked
def load(path: str | Path) -> Driveline:
    """Read a driveline from a TOML file.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    Driveline

    Raises
    ------
    FileError
        Not there, not TOML, an unknown type or key, a missing one, a value out of range; names file, table and key.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.load(pt.examples.path("conventional"))["vehicle"]
    Mass(name='vehicle', m=2000.0)
    """
    where, text = written(path), _text(path)
    if deep := _DEEP_KEY.search(text):
        line = text.count("\n", 0, deep.start()) + 1
        raise FileError(
            f"{where}: a key of many parts (at line {line}), permitted: [element] and [element.coefficients]"
        )
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # whole numbers of too many digits are a ValueError too
        raise FileError(f"{where}: not TOML: {error}") from error
    if tables.pop("units", "SI") != "SI":
        raise FileError(f'{where}: units: permitted: "SI"')
    released, elements = [], []
    for name, table in tables.items():
        inside = f"{where}: [{name}]"
        if not isinstance(table, dict):
            raise FileError(f'{where}: {name}: expected a table of one element, [{name}], or units = "SI"')
        is_released = table.pop("released", None)
        elements.append(_element(name, table, inside))
        if is_released is not None and not (isinstance(is_released, bool) and elements[-1].frictions):
            raise FileError(f"{inside}: released: permitted: true or false, for a Clutch")
        if is_released:
            released.append(name)
    try:
        car = Driveline(*elements)
    except PowertrainError as error:
        raise FileError(f"{where}: {error}") from error
    return car.release(*released) if released else car


@checked
def save(car: Driveline, path: str | Path) -> None:
    """Write a driveline to a TOML file that `load` reads back equal; the file appears whole or not at all."""
    if "units" in car:
        raise FileError('an element named "units" cannot be saved; give it another name')
    text = "\n".join([HEADER, *(_table(element, element.name in car.released) for element in car)])
    write_whole(path, text)


def write_whole(path: str | Path, text: str) -> None:
    """Write a text file by renaming a finished copy, so that a failure leaves the old file as it was.

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
            with open(copy, "x", encoding="utf-8") as file:
                file.write(text)
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


def _text(path: str | Path) -> str:
    """What a file holds; only an ordinary file of ordinary size is read."""
    try:
        _require_regular(os.stat(path))
        with open(path, "rb") as file:
            content = file.read(LARGEST_FILE + 1)
        if len(content) > LARGEST_FILE:
            raise OSError(0, f"permitted: at most {LARGEST_FILE} bytes")
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileError(f"{written(path)}: not TOML: {error}") from error
    except (OSError, ValueError) as error:
        raise FileError(f"{written(path)}: cannot be read: {_reason(error)}") from error


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


def _element(name: str, table: dict[str, Any], where: str) -> Element:
    kind = table.pop("type", None)
    types = _own_types(Element) | ELEMENT_TYPES
    if not isinstance(kind, str) or kind not in types:
        raise FileError(f"{where}: type = {kind!r}{suggestion(kind, ELEMENT_TYPES)}")
    cls = types[kind]
    items = {item.name: item for item in dataclasses.fields(cls) if item.name != "name"}
    for key in table:
        if key not in items:
            raise FileError(f'{where}: unknown key "{key}" for {kind}{suggestion(key, items)}')
    for key, item in items.items():
        if key not in table and item.default is dataclasses.MISSING:
            raise FileError(f'{where}: key "{key}" of {kind} is missing')
    try:
        return cls(name, **table)
    except PowertrainError as error:
        raise FileError(f"{where}: {error}") from error


def _own_types(base: type[Element]) -> dict[str, type[Element]]:
    """Every kind of element that there is, those that users have defined too."""
    found = {cls.__name__: cls for cls in base.__subclasses__() if not cls.__name__.startswith("_")}
    for cls in base.__subclasses__():
        found |= _own_types(cls)
    return found


def _table(element: Element, released: bool) -> str:
    lines = [f"[{_key(element.name)}]", f'type = "{type(element).__name__}"']
    for item in dataclasses.fields(element):
        value = getattr(element, item.name)
        if item.name == "name" or value is None:
            continue
        unit = item.metadata.get("unit")
        lines.append(f"{item.name} = {_toml(value)}" + (f"  # {unit}" if unit else ""))
    if released:
        lines.append("released = true")
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if name.isascii() else f'"{name}"'  # TOML takes only ASCII letters bare


def _toml(value: str | float | dict[str, float]) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(node)} = {c!r}" for node, c in value.items()) + " }"
    return repr(value)
