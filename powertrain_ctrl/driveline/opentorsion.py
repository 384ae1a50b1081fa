"""openTorsion's JSON ("TORS"): components of elements in series, and how they are connected.

Discs, lumped and continuous shafts, and gears with ``teeth`` or ``diameter`` whose ``parent`` they mesh with; an external
mesh turns the other way. A continuous shaft is a steel bar or tube whose inertia is spread evenly (`Shaft`), sizes in mm.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..base.errors import FileError, PowertrainError, suggestion
from ..base.paths import read_text, written
from ..elements import Drag, Element, Gear, Inertia, Shaft, SpringDamper

# What openTorsion takes for steel [N/m^2], [kg/m^3].
SHEAR_MODULUS, DENSITY = 80e9, 8000.0
KINDS = ("Disk", "ShaftDiscrete", "ShaftContinuous", "GearElement")


def read(path: str | Path) -> list[Element]:
    """Elements of a file of openTorsion.

    Raises
    ------
    FileError
        Not JSON, not of openTorsion, an element that is not known, a value that is missing or not permitted.
    """
    where = written(path)
    try:
        data = json.loads(read_text(path, "JSON"))
    except (ValueError, RecursionError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{where}: not JSON: {error}") from error
    if (
        not isinstance(data, dict)
        or not isinstance(data.get("components"), list)
        or not isinstance(data.get("structure"), list)
    ):
        raise FileError(f'{where}: permitted: a driveline of openTorsion, with "components" and "structure"')
    try:
        return _Walk(where, data["components"], data["structure"]).elements()
    except FileError:
        raise
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        if isinstance(error, PowertrainError):
            raise FileError(f"{where}: {error}") from error
        raise FileError(f"{where}: not as openTorsion writes it: {type(error).__name__}: {error}") from error


class _Walk:
    """Along the components from the one that nothing leads to; nodes are numbered as they are met."""

    def __init__(self, where: str, components: list[Mapping[str, Any]], structure: list[tuple[str, str]]):
        self.where = where
        self.components = {str(each["name"]): each["elements"] for each in components}
        self.after: dict[tuple[str, str], list[str]] = {}
        reached = set()
        for start, end in structure:
            component, element = start.split(".")
            self.after.setdefault((component, element), []).append(end.split(".")[0])
            reached.add(end.split(".")[0])
        for name in [*reached, *(component for component, _ in self.after)]:
            if name not in self.components:
                raise FileError(
                    f'{where}: structure: component "{name}" is not there{suggestion(name, self.components)}'
                )
        first = [name for name in self.components if name not in reached]
        if len(first) != 1:
            raise FileError(
                f"{where}: {len(first)} components to which nothing leads, permitted: one, where the driveline begins"
            )
        self.first = first[0]
        self.inertia: dict[int, float] = {}
        self.drag: dict[int, float] = {}
        self.parts: list[Element] = []
        self.gears: dict[str, tuple[int, float]] = {}
        self.count = 0

    def elements(self) -> list[Element]:
        # a chain of thousands of components is no reason to recurse
        waiting = [(self.first, 0)]
        walked = set()
        while waiting:
            component, node = waiting.pop()
            if component in walked:
                raise FileError(f'{self.where}: structure: component "{component}" is reached twice, permitted: once')
            walked.add(component)
            for element in self.components[component]:
                node = self._add(component, element, node)
                waiting += [(after, node) for after in self.after.get((component, str(element["name"])), [])]
        if lost := set(self.components) - walked:
            raise FileError(f"{self.where}: structure: nothing leads to {', '.join(sorted(lost))}")
        bodies = [Inertia(_node(node), J=J) for node, J in sorted(self.inertia.items())]
        drags = [Drag(f"drag_{node}", _node(node), damping=damping) for node, damping in sorted(self.drag.items())]
        return [*bodies, *self.parts, *drags]

    def _add(self, component: str, element: Mapping[str, Any], node: int) -> int:
        """Take up one element; the node behind it."""
        kind, name = element["type"], _identifier(f"{component}_{element['name']}")
        if kind not in KINDS:
            raise FileError(f'{self.where}: {name}: type "{kind}" is not known, permitted: {", ".join(KINDS)}')
        if kind == "Disk":
            self._at(self.inertia, node, element.get("inertia"))
            self._at(self.drag, node, element.get("damping"))
            return node
        if kind == "GearElement":
            return self._geared(component, name, element, node)
        self.count += 1
        ends = name, _node(node), _node(self.count)
        if kind == "ShaftDiscrete":
            damping = float(element.get("damping") or 0.0)
            self.parts.append(SpringDamper(*ends, stiffness=float(element["stiffness"]), damping=damping))
        else:
            stiffness, inertia = _bar(element)
            self.parts.append(Shaft(*ends, stiffness=stiffness, inertia=inertia))
        return self.count

    def _geared(self, component: str, name: str, element: Mapping[str, Any], node: int) -> int:
        size = float(element["teeth"] if element.get("teeth") is not None else element["diameter"])
        parent = element.get("parent")
        if parent is not None:
            if f"{component}.{parent}" not in self.gears:
                raise FileError(
                    f'{self.where}: {name}: parent "{parent}" is no gear of this component that comes before it'
                )
            driving, driving_size = self.gears[f"{component}.{parent}"]
            self.count += 1
            node = self.count
            # the speeds of meshing gears are as the sizes of the others, the other way round
            self.parts.append(Gear(name, _node(driving), _node(node), ratio=-size / driving_size))
        self.gears[f"{component}.{element['name']}"] = node, size
        self._at(self.inertia, node, element.get("inertia"))
        return node

    @staticmethod
    def _at(total: dict[int, float], node: int, value: Any) -> None:
        if value:
            total[node] = total.get(node, 0.0) + float(value)


def _bar(element: Mapping[str, Any]) -> tuple[float, float]:
    """Stiffness G I / l [N m/rad] and inertia rho I l [kg m^2] of a round bar or tube, its sizes in mm."""
    outer, inner = 1e-3 * float(element["outerDiameter"]), 1e-3 * float(element.get("innerDiameter") or 0.0)
    length, area = 1e-3 * float(element["length"]), math.pi / 32.0 * (outer**4 - inner**4)
    return SHEAR_MODULUS * area / length, float(element.get("density") or DENSITY) * area * length


def _node(number: int) -> str:
    return f"n{number}"


def _identifier(name: str) -> str:
    cleaned = re.sub(r"\W", "_", name)
    return cleaned if cleaned.isidentifier() else f"_{cleaned}"
