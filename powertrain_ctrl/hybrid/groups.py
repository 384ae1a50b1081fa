"""Laws whose torques depend on each other's slips."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..elements import Law


class Group(NamedTuple):
    """Laws of one element: their numbers, and edges and forms of each `Region`.

    (regions, edges, laws) and (regions, laws, laws, laws) ndarrays.
    """

    laws: list[int]
    edges: np.ndarray
    forms: np.ndarray


def groups_of(laws: Sequence[Law]) -> list[Group]:
    """By their elements.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> tables = {"speed_ratios": (0.0, 1.0), "capacities": (3e-3, 0.0), "torque_ratios": (2.0, 1.0)}
    >>> [group.laws for group in groups_of(pt.TorqueConverter("converter", "engine", "turbine", **tables).laws)]
    [[0, 1]]
    """
    together: dict[str, list[int]] = {}
    for i, law in enumerate(laws):
        if law.regions:
            together.setdefault(law.owner, []).append(i)
    groups = []
    for numbers in together.values():
        edges, forms = zip(*laws[numbers[0]].regions, strict=True)
        groups.append(Group(numbers, np.array(edges), np.array(forms)))
    return groups
