"""Drivelines as TOML files: one table per element, SI units."""

from __future__ import annotations

import dataclasses
import os
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from .doors import checked
from .driveline import Driveline
from .elements import ELEMENT_TYPES
from .errors import FileError, PowertrainError, suggestion
from .rows import Element

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
    path = Path(path)
    try:
        tables = tomllib.loads(path.read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise FileError(f"{path}: cannot be read: {error.strerror}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise FileError(f"{path}: not TOML: {error}") from error
    if tables.pop("units", "SI") != "SI":
        raise FileError(f'{path}: units: permitted: "SI"')
    released, elements = [], []
    for name, table in tables.items():
        where = f"{path}: [{name}]"
        if not isinstance(table, dict):
            raise FileError(f'{path}: {name}: expected a table of one element, [{name}], or units = "SI"')
        is_released = table.pop("released", None)
        elements.append(_element(name, table, where))
        if is_released is not None and not (isinstance(is_released, bool) and elements[-1].frictions):
            raise FileError(f"{where}: released: permitted: true or false, for a Clutch")
        if is_released:
            released.append(name)
    try:
        car = Driveline(*elements)
    except PowertrainError as error:
        raise FileError(f"{path}: {error}") from error
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
    path = Path(path)
    try:
        handle, copy = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8") as file:
                file.write(text)
            os.chmod(copy, 0o644)
            os.replace(copy, path)
        except BaseException:
            os.unlink(copy)
            raise
    except OSError as error:
        raise FileError(f"{path}: cannot be written: {error.strerror}") from error


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
