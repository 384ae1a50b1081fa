"""Rows of elements in the coordinates that constraints leave: sparse, of one driveline or of many variants at once."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from ..driveline.collection import Driveline
from ..driveline.kinematics import Elimination, agreed, combined, eliminate
from ..elements import Law, Statement

# A number, or (variants,) numbers.
Value = Any


class SolvedRows:
    """What elements state, by name and without zeros, every motion a combination of the coordinates.

    Values are numbers, or arrays of those of many variants; then what is decided must be the same for all (`Mixed`).
    """

    def __init__(self, nodes: tuple[str, ...], stated: Iterable[Statement], locked: Sequence[Law]):
        self.nodes = nodes
        stated = list(stated)
        constraints: list[Any] = [row for each in stated for row in each.constraints]
        constraints += locked
        # What is held by a single node comes first, so that only the others can contradict each other.
        constraints.sort(key=lambda row: len(row.coefficients) > 1)
        kinematics = eliminate([row.coefficients for row in constraints], nodes)
        self.is_free = kinematics.standstill_row is None
        self.coordinates = tuple(kinematics.independent)
        self.motion = kinematics.expressions
        self.compliances = [row for each in stated for row in each.compliances]
        self.twists = [combined(row.coefficients, self.motion) for row in self.compliances]
        self.elastic = [c for c, row in enumerate(self.compliances) if agreed(row.stiffness > 0.0)]
        self.damped = [c for c, row in enumerate(self.compliances) if agreed(row.damping > 0.0)]
        self.inertias = [row for each in stated for row in each.inertias]
        self.place = {name: j for j, name in enumerate(self.coordinates)}
        self.mass = self._mass()

    @property
    def names(self) -> tuple[str, ...]:
        """Of the compliances."""
        return tuple(row.name for row in self.compliances)

    def _mass(self) -> dict[tuple[int, int], Value]:
        """Entries of the inertia matrix on and below its diagonal."""
        mass: dict[tuple[int, int], Value] = {}
        for row in self.inertias:
            for a, line in zip(row.nodes, row.matrix, strict=True):
                for b, value in zip(row.nodes, line, strict=True):
                    for one, share in self.motion[a].items():
                        for other, part in self.motion[b].items():
                            i, j = self.place[one], self.place[other]
                            if i >= j:
                                mass[i, j] = mass.get((i, j), 0.0) + share * value * part
        return mass

    @cached_property
    def is_diagonal(self) -> bool:
        """Whether no two coordinates share inertia."""
        return all(i == j for i, j in self.mass)

    @property
    def has_loss(self) -> bool:
        """Whether a loss factor says what only steady harmonic motion has a use for."""
        return any(np.any(row.loss_factor) for row in self.compliances)

    @property
    def is_heavy(self) -> bool:
        """Whether there are coordinates, and each of them has some inertia."""
        n = len(self.coordinates)
        return bool(n) and all((j, j) in self.mass and agreed(self.mass[j, j] > 0.0) for j in range(n))

    @cached_property
    def springless(self) -> Elimination:
        """Motions that twist no spring."""
        return eliminate([self.twists[c] for c in self.elastic], self.coordinates)

    @cached_property
    def free(self) -> Elimination:
        """Motions that neither spring nor damper resists."""
        alone = [c for c in self.damped if c not in self.elastic] if len(self.elastic) < len(self.compliances) else []
        return (
            eliminate([self.twists[c] for c in [*self.elastic, *alone]], self.coordinates) if alone else self.springless
        )

    @property
    def n_rigid(self) -> int:
        """Number of motions that twist no spring."""
        return len(self.springless.independent)

    @cached_property
    def rolling(self) -> dict[str, Value] | None:
        """Motion of each coordinate when everything turns as one body, springs and dampers to ground left out.

        None where it is in several parts or can turn in more than one way.
        """
        between = [twist for twist, row in zip(self.twists, self.compliances, strict=True) if len(row.coefficients) > 1]
        motions = eliminate(between, self.coordinates)
        if len(motions.independent) != 1:
            return None
        only = motions.independent[0]
        return {name: motion.get(only, 0.0) for name, motion in motions.expressions.items()}

    def combined(self, coefficients: Mapping[str, float], motion: Mapping[str, Value]) -> Value:
        """A combination of nodes in a motion of the coordinates."""
        total: Value = 0.0
        for node, coefficient in coefficients.items():
            for coordinate, value in self.motion[node].items():
                total = total + coefficient * value * motion[coordinate]
        return total

    def final_gain(self, engine: str, vehicle: str) -> Value:
        """Steady acceleration of the vehicle per engine torque, drag left out."""
        motion = self.rolling
        assert motion is not None
        inertia: Value = 0.0
        for (i, j), value in self.mass.items():
            share = motion[self.coordinates[i]] * motion[self.coordinates[j]]
            inertia = inertia + (1.0 if i == j else 2.0) * value * share
        return self.combined({vehicle: 1.0}, motion) * self.combined({engine: 1.0}, motion) / inertia


def solved(car: Driveline) -> SolvedRows | None:
    """Rows of a driveline; None where they do not say all of it: laws other than clutches, a coordinate without inertia.

    >>> from powertrain_ctrl import examples
    >>> rows = solved(examples.conventional())
    >>> rows.coordinates[-2:], {name: round(value, 3) for name, value in rows.twists[-1].items()}
    (('wheels', 'vehicle'), {'wheels': 1.0, 'vehicle': -2.857})
    """
    laws = [law for each in car.stated for law in each.laws]
    if not all(law.is_clutch for law in laws) or any(each.couplings for each in car.stated):
        return None
    rows = SolvedRows(car.nodes, car.stated, [law for law in laws if law.name not in car.released])
    if not (rows.is_free and rows.is_heavy):
        return None
    return rows if rows.is_diagonal or _is_definite(rows) else None


def _is_definite(rows: SolvedRows) -> bool:
    M = dense(len(rows.coordinates), rows.mass)
    root = np.sqrt(np.diag(M))
    return bool(np.linalg.eigvalsh(M / root / root[:, None])[0] > DEFINITE)


# Least eigenvalue of an inertia matrix scaled to 1 on its diagonal, below which a coordinate has no inertia of its own.
DEFINITE = 1e-13


def dense(n: int, entries: Mapping[tuple[int, int], float]) -> np.ndarray:
    """(n, n) symmetric ndarray of the entries on and below its diagonal."""
    M = np.zeros((n, n))
    for (i, j), value in entries.items():
        M[i, j] = M[j, i] = value
    return M
