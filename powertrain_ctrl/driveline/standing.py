"""Which clutches of a new driveline are open: those that, locked with the others, would leave it nothing to turn with."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ..elements import Element
from .kinematics import eliminate


def standing(elements: Iterable[Element], nodes: Sequence[str]) -> frozenset[str]:
    """Names of the clutches and brakes that, locked with those before them, would hold all that they are connected with.

    Springs are taken as rigid where they can be. Clutches between two nodes come before brakes, otherwise in the
    order given; one that is alone is never among them, whatever it holds.
    """
    elements = list(elements)
    laws = [law for element in elements for law in element.laws]
    clutches = sorted((law for law in laws if law.is_clutch), key=lambda law: len(law.coefficients) < 2)
    if len(clutches) < 2:
        return frozenset()
    rows: list[Mapping[str, float]] = [row.coefficients for element in elements for row in element.constraints]
    springs = [row.coefficients for element in elements for row in element.compliances]
    springs += [law.coefficients for law in laws if law.has_twist and not law.is_clutch]
    moving, open_ones = _moving(rows, nodes), set()
    sprung = [*rows, *(row for row in springs if len(row) > 1)]  # a spring to ground holds nothing
    # where springs must twist for anything to turn they say nothing about clutches
    rows = sprung if _moving(sprung, nodes) == moving else rows
    for clutch in clutches:
        locked = [*rows, clutch.coefficients]
        still_moving, connected = _moving(locked, nodes), _connected(locked, clutch.coefficients)
        if connected & moving and not connected & still_moving:
            open_ones.add(clutch.name)
        else:
            rows, moving = locked, still_moving
    return frozenset(open_ones)


def stated(elements: Iterable[Element], nodes: Sequence[str], released: Iterable[str]) -> dict[str, bool]:
    """Of which clutches a file says whether they are released, and whether they are."""
    return dict.fromkeys(standing(elements, nodes), False) | dict.fromkeys(released, True)


def _moving(rows: Iterable[Mapping[str, float]], nodes: Sequence[str]) -> set[str]:
    expressions = eliminate(rows, nodes).expressions
    return {node for node in nodes if expressions[node]}


def _connected(rows: Iterable[Mapping[str, float]], nodes: Iterable[str]) -> set[str]:
    links, found = [set(row) for row in rows], set(nodes)
    while more := set().union(*(link for link in links if link & found)) - found:
        found |= more
    return found
