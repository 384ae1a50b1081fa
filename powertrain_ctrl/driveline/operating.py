"""Operating points: which mode each law is in under a steady load, and the linear elements in its place."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import scipy.linalg

from ..base.checks import FINITE, checked_mapping, checked_number
from ..base.errors import PowertrainError, UnknownNameError
from ..elements import Compliance, ComplianceRow, Constraint, Element, Law, OperatingPoint
from ..elements.laws import coupled_torques
from .kinematics import eliminate
from .static import AGREE, carried


def linear_elements(
    elements: Sequence[Element],
    nodes: Sequence[str],
    released: frozenset[str],
    torques: Mapping[str, Any] | None,
    twists: Mapping[str, Any] | None,
    speed: Mapping[str, Any] | None,
) -> list[Element]:
    """Elements of the linear driveline at an operating point."""
    point = operating_point(elements, nodes, released, torques, twists, speed)
    return [part for e in elements for part in in_place(e, point)]


def operating_point(
    elements: Sequence[Element],
    nodes: Sequence[str],
    released: frozenset[str],
    torques: Mapping[str, Any] | None,
    twists: Mapping[str, Any] | None,
    speed: Mapping[str, Any] | None,
) -> OperatingPoint:
    """Mode of each law under a steady load, and the speed of every node, from those of some."""
    laws = [law for e in elements for law in e.laws if not law.is_clutch]
    car = _Statics(elements, nodes, released, laws)
    speeds = car.speeds(checked_mapping("speed", speed, "from node to speed"))
    modes = {law.name: law.held if law.held is not None else next(iter(law.modes), 0) for law in laws}
    twisted = [law for law in laws if law.carries and not _creeps(law)]
    given = checked_mapping("twists", twists, "from play or stages to twist")
    for name in given:
        if name not in [law.name for law in twisted]:
            raise UnknownNameError("play or stages", name, [law.name for law in twisted], "in this driveline")
    if any(law.name not in given for law in twisted) or any(law.held is not None for law in laws):
        modes |= car.modes(checked_mapping("torques", torques, "from input to torque"), twisted, speeds)
    for law in twisted:
        if law.name in given:
            twist = checked_number("twists", law.name, given[law.name], "rad", FINITE)
            modes[law.name] = law.starting(twist)[0]
    return OperatingPoint({name: number for name, number in modes.items() if number is not None}, speeds)


def in_place(element: Element, point: OperatingPoint) -> Iterable[Element]:
    """Linear elements in the place of one, for small motion about a point."""
    laws = [law for law in element.laws if not law.is_clutch]
    if not laws:
        return (element,)
    parts = element.linearised(point)
    if parts is not None:
        return parts
    found: list[Element] = []
    for row in element.compliances:
        found.append(Compliance(row.name, row.coefficients, stiffness=row.stiffness, damping=row.damping))
    for law in laws:
        mode = law.modes[point.modes[law.name]]
        if mode.held:
            found.append(Constraint(law.name, law.coefficients))
        elif mode.stiffness or mode.damping:
            found.append(Compliance(law.name, law.coefficients, stiffness=mode.stiffness, damping=mode.damping))
    return found


def _creeps(law: Law) -> bool:
    return any(mode.stiffness and mode.origin is None for mode in law.modes.values())


def _at_speeds(elements: Sequence[Element], speeds: Mapping[str, float]) -> list[tuple[Law, float]]:
    """Laws whose torques depend on the slips of several, and these torques, where the speeds are known."""
    found: list[tuple[Law, float]] = []
    for e in elements:
        laws = [law for law in e.laws if law.regions]
        if laws and all(node in speeds for law in laws for node in law.coefficients):
            slips = [sum(value * speeds[node] for node, value in law.coefficients.items()) for law in laws]
            found += zip(laws, coupled_torques(laws, slips), strict=True)
    return found


class _Statics:
    """Motions of a driveline whose clutches are as they are set and whose one-way clutches hold."""

    def __init__(
        self, elements: Sequence[Element], nodes: Sequence[str], released: frozenset[str], laws: Sequence[Law]
    ):
        self.elements, self.nodes = elements, list(nodes)
        self.translating = {node for e in elements for node in e.translating}
        locked = [law for e in elements for law in e.laws if law.is_clutch and law.name not in released]
        # friction slides in steady motion; what holds between two nodes is a one-way clutch
        self.one_way = [
            law for law in laws if law.held is not None and len(law.modes) == 2 and len(law.coefficients) > 1
        ]
        rows = [row.coefficients for e in elements for row in e.constraints] + [law.coefficients for law in locked]
        self.fixed = rows
        compliances: list[ComplianceRow] = [row for e in elements for row in e.compliances if row.stiffness]
        self.E, self.stiffness = self._matrix(compliances), np.array([row.stiffness for row in compliances])
        self.J = np.zeros((len(self.nodes),) * 2)
        for e in elements:
            for row in e.inertias:
                index = [self.nodes.index(node) for node in row.nodes]
                self.J[np.ix_(index, index)] += row.matrix

    def _matrix(self, rows: Sequence[ComplianceRow | Law]) -> np.ndarray:
        matrix = np.zeros((len(rows), len(self.nodes)))
        for i, row in enumerate(rows):
            for node, value in row.coefficients.items():
                matrix[i, self.nodes.index(node)] = value
        return matrix

    def speeds(self, given: Mapping[str, Any]) -> dict[str, float]:
        """Speed of every node when all turns as one body, from those of some."""
        for node, value in given.items():
            if node not in self.nodes:
                raise UnknownNameError("node", node, self.nodes, "in this driveline")
            checked_number("speed", node, value, "", FINITE)
        if not given:
            return {}
        springs = [row for e in self.elements for row in e.compliances if row.stiffness and len(row.coefficients) > 1]
        laws = [law for e in self.elements for law in e.laws if law.has_twist] + self.one_way
        rows = [*self.fixed, *(row.coefficients for row in springs), *(law.coefficients for law in laws)]
        T = eliminate(rows, self.nodes).basis(self.nodes)
        wanted, chosen = np.array(list(given.values()), dtype=float), [self.nodes.index(node) for node in given]
        motion = np.linalg.lstsq(T[chosen], wanted, rcond=None)[0]
        missed = np.abs(T[chosen] @ motion - wanted)
        if (missed > AGREE * np.abs(wanted).max()).any():
            name = list(given)[int(missed.argmax())]
            raise PowertrainError(f'speed of "{name}" = {given[name]:g} contradicts the others, or it is held at rest')
        found = dict(zip(self.nodes, (T @ motion).tolist(), strict=True))
        # a side of a torque converter of which nothing is said does not stand still for that
        known = np.linalg.pinv(T[chosen]) @ T[chosen]
        either = {node for e in self.elements for law in e.laws if law.regions for node in law.coefficients}
        for node in either:
            row = T[self.nodes.index(node)]
            if np.abs(row - row @ known).max(initial=0.0) > AGREE * np.abs(row).max(initial=0.0):
                del found[node]
        return found

    def modes(self, torques: Mapping[str, Any], twisted: Sequence[Law], speeds: Mapping[str, float]) -> dict[str, int]:
        """Modes of the laws with a twist, and of one-way clutches, under a steady load at these speeds."""
        load = np.zeros(len(self.nodes))
        inputs = [f"{node}_force" if node in self.translating else f"{node}_torque" for node in self.nodes]
        for name, value in torques.items():
            if name not in inputs:
                raise UnknownNameError("input", name, inputs, "of this driveline")
            load[inputs.index(name)] = checked_number("torques", name, value, "N m", FINITE)
        for law, torque in _at_speeds(self.elements, speeds):
            for node, value in law.coefficients.items():
                load[self.nodes.index(node)] -= value * torque
        driving = list(self.one_way)
        while True:
            T = eliminate([*self.fixed, *(law.coefficients for law in driving)], self.nodes).basis(self.nodes)
            springs, rows = self.E @ T, self._matrix(twisted) @ T
            force, mass = T.T @ load, T.T @ self.J @ T
            rigid = scipy.linalg.null_space(np.vstack([springs, rows, np.zeros((1, T.shape[1]))]))
            rate = rigid @ np.linalg.lstsq(rigid.T @ mass @ rigid, rigid.T @ force, rcond=1e-14)[0]
            size = np.abs(load).max(initial=0.0)
            moved, chosen = carried(springs, self.stiffness, rows, twisted, force - mass @ rate, size)
            modes = {law.name: number for law, number in zip(twisted, chosen, strict=True)}
            if not driving:
                break
            # what the one-way clutches carry balances the rest at their nodes
            held = [row.coefficients for row in (*driving,)]
            carries = self.E.T @ (self.stiffness * (self.E @ (T @ moved)))
            for law, number in zip(twisted, chosen, strict=True):
                mode, row = law.modes[number], self._matrix([law])[0]
                carries += row * (mode.stiffness * (row @ (T @ moved) - (mode.origin or 0.0)) + mode.torque)
            left = load - self.J @ (T @ rate) - carries
            holding = self._matrix(driving)
            others = np.array([[row.get(node, 0.0) for node in self.nodes] for row in self.fixed]).reshape(
                -1, len(left)
            )
            torque = np.linalg.lstsq(np.vstack([holding, others]).T, left, rcond=None)[0][: len(held)]
            pulls = [law for law, value in zip(driving, torque, strict=True) if value < -AGREE * size]
            if not pulls:
                break
            driving = [law for law in driving if law not in pulls]
        for law in self.one_way:
            free = next(number for number in law.modes if number != law.held)
            modes[law.name] = law.held if law in driving and law.held is not None else free
        return modes
