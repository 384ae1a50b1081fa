"""Elements as TOML: one table per element, SI units."""

from __future__ import annotations

import dataclasses
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..base.errors import FileError, PowertrainError, suggestion
from ..base.paths import read_text, write_whole, written
from ..elements import ELEMENT_TYPES, Element
from ..elements.element import TwoEnded

# A table of this name without a type is no element: it says what drives the car.
PLANT = "plant"
# Nothing here is deeper than [element.coefficients]; tomllib takes minutes for keys of many thousand parts.
_DEEP_KEY = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){16}""")

HEADER = """\
# Driveline, one table per element. Torque is positive when side a is turned ahead of side b.
units = "SI"  # kg m^2, kg, N m/rad, N m s/rad, N/m, N s/m, m, N m
"""


def read(path: str | Path) -> tuple[list[Element], dict[str, bool]]:
    """Elements of a file, and of the clutches whose state it states whether they are released.

    Raises
    ------
    FileError
        Not there, not TOML, an unknown type or key, a missing one, a value out of range; names file, table and key.
    """
    where, tables = _tables(path)
    if _is_plant(tables.get(PLANT)):
        del tables[PLANT]
    if tables.pop("units", "SI") != "SI":
        raise FileError(f'{where}: units: permitted: "SI"')
    released: dict[str, bool] = {}
    elements = []
    for name, table in tables.items():
        inside = f"{where}: [{name}]"
        if not isinstance(table, dict):
            raise FileError(f'{where}: {name}: expected a table of one element, [{name}], or units = "SI"')
        is_released = table.pop("released", None)
        elements.append(_element(name, table, inside))
        if is_released is not None and not (
            isinstance(is_released, bool) and any(law.is_clutch for law in elements[-1].laws)
        ):
            raise FileError(f"{inside}: released: permitted: true or false, for a Clutch")
        if is_released is not None:
            released[name] = is_released
    return elements, released


def plant_table(path: str | Path) -> dict[str, Any]:
    """What a file says of the actuator and its controller; nothing if it does not, or is not TOML."""
    if Path(path).suffix.lower() == ".json":
        return {}
    table = _tables(path)[1].get(PLANT)
    return table if isinstance(table, dict) and _is_plant(table) else {}


def _is_plant(table: Any) -> bool:
    return isinstance(table, dict) and "type" not in table


def _tables(path: str | Path) -> tuple[str, dict[str, Any]]:
    where, text = written(path), read_text(path)
    if deep := _DEEP_KEY.search(text):
        line = text.count("\n", 0, deep.start()) + 1
        raise FileError(
            f"{where}: a key of many parts (at line {line}), permitted: [element] and [element.coefficients]"
        )
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # whole numbers of too many digits are a ValueError too
        raise FileError(f"{where}: not TOML: {error}") from error
    return where, tables


def write(elements: Iterable[Element], released: Mapping[str, bool], path: str | Path) -> None:
    """Write elements, and of clutches whether they are released, to a file that appears whole or not at all.

    Raises
    ------
    FileError
        The folder cannot be written, or an element is named "units".
    """
    tables = [HEADER]
    for element in elements:
        if element.name == "units":
            raise FileError('an element named "units" cannot be saved; give it another name')
        tables.append(_table(element, released.get(element.name)))
    write_whole(path, "\n".join(tables))


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
    found = {
        cls.__name__: cls for cls in base.__subclasses__() if not (cls.__name__.startswith("_") or cls is TwoEnded)
    }
    for cls in base.__subclasses__():
        found |= _own_types(cls)
    return found


def _table(element: Element, released: bool | None) -> str:
    lines = [f"[{_key(element.name)}]", f'type = "{type(element).__name__}"']
    for item in dataclasses.fields(element):
        value = getattr(element, item.name)
        if item.name == "name" or value is None:
            continue
        unit = item.metadata.get("unit", item.metadata.get("array"))
        lines.append(f"{item.name} = {_toml(value)}" + (f"  # {unit}" if unit else ""))
    if released is not None:
        lines.append(f"released = {'true' if released else 'false'}")
    return "\n".join(lines) + "\n"


def _key(name: str) -> str:
    return name if name.isascii() else f'"{name}"'  # TOML takes only ASCII letters bare


def _toml(value: Any) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{_key(node)} = {c!r}" for node, c in value.items()) + " }"
    return repr(value)
