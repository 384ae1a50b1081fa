"""What elements have to be to make a driveline: names that differ, nodes with inertia, roads and shafts kept apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from ..base.errors import PowertrainError, TopologyError, suggestion
from ..elements import Element, Statement
from ..elements.laws import check as check_law


def ordered_nodes(elements: Sequence[Element], stated: Sequence[Statement]) -> tuple[str, ...]:
    with_inertia = (node for rows in stated for row in rows.inertias for node in row.nodes)
    return tuple(dict.fromkeys([*with_inertia, *(node for e in elements for node in e.nodes)]))


def check_names(elements: Sequence[Element], stated: Sequence[Statement]) -> None:
    seen: set[str] = set()
    for element, rows in zip(elements, stated, strict=True):
        if element.name in seen:
            raise PowertrainError(f'the name "{element.name}" is given twice, permitted: one element a name')
        seen.add(element.name)
        if not rows.laws:
            continue
        names = [law.name for law in rows.laws]
        if any(law.owner != element.name for law in rows.laws) or len(set(names)) < len(names):
            raise PowertrainError(
                f'{element.name}: laws {", ".join(names)}, permitted: of the name "{element.name}", or each of its own '
                f'name with element="{element.name}"'
            )
        for law in rows.laws:
            check_law(law, element.nodes)
    bodies = {e.name for e in elements if e.nodes == (e.name,)}
    for element in elements:
        for node in element.nodes:
            if node in seen and node not in bodies:
                raise PowertrainError(f'"{node}" is a node of "{element.name}" and the name of another element')


def check_nodes(elements: Sequence[Element], stated: Sequence[Statement]) -> None:
    if not any(rows.inertias for rows in stated):
        raise TopologyError("a driveline needs at least one Inertia or Mass")
    heavy = _heavy(stated)
    tied = {node for rows in stated for row in rows.constraints for node in row.coefficients}
    tied |= {node for rows in stated for law in rows.laws if law.held is not None for node in law.coefficients}
    touching = Counter(node for e in elements for node in e.nodes)
    for element in elements:
        for node in element.nodes:
            # a node of one spring alone is a slip of the pen
            if node not in heavy and node not in tied and touching[node] < 2:
                raise TopologyError(
                    f'node "{node}" of {element.name} has no inertia; give it an Inertia '
                    f"or merge the springs on either side{suggestion(node, sorted(heavy))}"
                )
    road = on_the_road(elements, stated)
    if not road:
        return
    turning = heavy - {e.name for e in elements if e.translating == (e.name,)}
    for element, rows in zip(elements, stated, strict=True):
        for node in element.translating:
            if node in turning:
                raise TopologyError(f'{element.name}: its body "{node}" turns, permitted: a Mass')
        if len({node in road for node in element.nodes}) > 1 and equates_motions(element, rows):
            ends = " and ".join(element.nodes)
            raise TopologyError(f"{element.name}: connects turning and moving nodes {ends}; use a Tyre between them")


def on_the_road(elements: Sequence[Element], stated: Sequence[Statement]) -> frozenset[str]:
    """Nodes that move along the road; so do those that have nothing but springs to such nodes."""
    road = {node for e in elements for node in e.translating}
    if not road:
        return frozenset()
    decided = road | _heavy(stated)
    decided |= {node for rows in stated for row in rows.constraints for node in row.coefficients}
    decided |= {node for rows in stated for law in rows.laws for node in law.coefficients}
    springs = [set(e.nodes) for e, rows in zip(elements, stated, strict=True) if equates_motions(e, rows)]
    while reached := {node for ends in springs if ends & road for node in ends} - decided:
        road |= reached
        decided |= reached
    return frozenset(road)


def equates_motions(element: Element, stated: Statement) -> bool:
    """Whether a spring, damper or clutch takes the motions of its nodes as they are, one minus the other."""
    if any(law.regions for law in stated.laws) or stated.couplings:
        return True
    rows = [row.coefficients for row in stated.compliances] + [law.coefficients for law in stated.laws]
    return not element.translating and any(sorted(row.values()) == [-1.0, 1.0] for row in rows)


def _heavy(stated: Sequence[Statement]) -> set[str]:
    return {node for rows in stated for row in rows.inertias for node in row.nodes}
