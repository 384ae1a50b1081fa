"""Torques that depend on several speeds: a torque converter for small motion, which no springs and dampers make."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..base.errors import PowertrainError, TopologyError
from ..driveline.collection import Driveline
from ..elements import CouplingRow
from .condensing import Following


def couplings_of(car: Driveline) -> tuple[CouplingRow, ...]:
    """All that couple speeds in a driveline."""
    return tuple(row for each in car.stated for row in each.couplings)


def uncoupled(car: Driveline) -> Driveline:
    """The driveline without them."""
    rest = Driveline(*(e for e, each in zip(car, car.stated, strict=True) if not each.couplings))
    return rest.release(*car.released) if car.released else rest


def coupling_matrix(rows: Sequence[CouplingRow], nodes: Sequence[str]) -> np.ndarray:
    """(nodes, nodes) ndarray D of their torques ``-D speeds``.

    Examples
    --------
    >>> coupling_matrix([CouplingRow("converter", ("pump", "turbine"), ((2.0, -1.0), (-3.0, 1.5)))], ("turbine", "pump"))
    array([[ 1.5, -3. ],
           [-1. ,  2. ]])
    """
    D = np.zeros((len(nodes),) * 2)
    for row in rows:
        index = [nodes.index(node) for node in row.nodes]
        D[np.ix_(index, index)] += row.damping
    return D


def require_bodies(rows: Sequence[CouplingRow], nodes: Sequence[str], following: Following) -> None:
    """Refuse couplings at nodes without inertia: their speeds would jump with every torque."""
    for row in rows:
        for node in row.nodes:
            i = nodes.index(node)
            if following.U[i].any() or following.V[i].any():
                raise TopologyError(f'node "{node}" has no inertia and {row.name} acts there; give it an Inertia')


def require_none(car: Driveline) -> None:
    """Refuse a driveline whose speeds are coupled, where nothing but springs, dampers and inertias is known."""
    for row in couplings_of(car):
        raise PowertrainError(
            f"{row.name}: couples speeds by a matrix that no springs and dampers make, permitted in modes, poles and "
            "state_space; simulate the torque converter itself, or lock its lock-up clutch and leave it out"
        )
