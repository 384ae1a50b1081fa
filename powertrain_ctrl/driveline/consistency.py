"""What elements have to be to make a driveline: names that differ, nodes with inertia, roads and shafts kept apart."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from ..base.errors import PowertrainError, TopologyError, suggestion
from ..elements import Element
from ..elements.laws import check as check_law


def ordered_nodes(elements: Iterable[Element]) -> tuple[str, ...]:
    elements = list(elements)
    with_inertia = (node for e in elements for row in e.inertias for node in row.nodes)
    return tuple(dict.fromkeys([*with_inertia, *(node for e in elements for node in e.nodes)]))


def check_names(elements: tuple[Element, ...]) -> None:
    seen: set[str] = set()
    for element in elements:
        if element.name in seen:
            raise PowertrainError(f'the name "{element.name}" is given twice, permitted: one element a name')
        seen.add(element.name)
        laws = element.laws
        names = [law.name for law in laws]
        if any(law.owner != element.name for law in laws) or len(set(names)) < len(names):
            raise PowertrainError(
                f'{element.name}: laws {", ".join(names)}, permitted: of the name "{element.name}", or each of its own '
                f'name with element="{element.name}"'
            )
        for law in laws:
            check_law(law, element.nodes)
    bodies = {e.name for e in elements if e.nodes == (e.name,)}
    for element in elements:
        for node in element.nodes:
            if node in seen and node not in bodies:
                raise PowertrainError(f'"{node}" is a node of "{element.name}" and the name of another element')


def check_nodes(elements: tuple[Element, ...]) -> None:
    if not any(e.inertias for e in elements):
        raise TopologyError("a driveline needs at least one Inertia or Mass")
    heavy = {node for e in elements for row in e.inertias for node in row.nodes}
    tied = {node for e in elements for row in e.constraints for node in row.coefficients}
    tied |= {node for e in elements for law in e.laws if law.held is not None for node in law.coefficients}
    touching = Counter(node for e in elements for node in e.nodes)
    for element in elements:
        for node in element.nodes:
            # a node of one spring alone is a slip of the pen
            if node not in heavy and node not in tied and touching[node] < 2:
                raise TopologyError(
                    f'node "{node}" of {element.name} has no inertia; give it an Inertia '
                    f"or merge the springs on either side{suggestion(node, sorted(heavy))}"
                )
    road = on_the_road(elements)
    turning = {node for e in elements for row in e.inertias for node in row.nodes} - {
        e.name for e in elements if e.translating == (e.name,)
    }
    for element in elements:
        for node in element.translating:
            if node in turning:
                raise TopologyError(f'{element.name}: its body "{node}" turns, permitted: a Mass')
        if equates_motions(element) and len({node in road for node in element.nodes}) > 1:
            ends = " and ".join(element.nodes)
            raise TopologyError(f"{element.name}: connects turning and moving nodes {ends}; use a Tyre between them")


def on_the_road(elements: Iterable[Element]) -> frozenset[str]:
    """Nodes that move along the road; so do those that have nothing but springs to such nodes."""
    elements = list(elements)
    road = {node for e in elements for node in e.translating}
    decided = road | {node for e in elements for row in e.inertias for node in row.nodes}
    decided |= {node for e in elements for row in e.constraints for node in row.coefficients}
    decided |= {node for e in elements for law in e.laws for node in law.coefficients}
    springs = [set(e.nodes) for e in elements if equates_motions(e)]
    while reached := {node for ends in springs if ends & road for node in ends} - decided:
        road |= reached
        decided |= reached
    return frozenset(road)


def equates_motions(element: Element) -> bool:
    """Whether a spring, damper or clutch takes the motions of its nodes as they are, one minus the other."""
    rows = [row.coefficients for row in element.compliances] + [law.coefficients for law in element.laws]
    if any(law.regions for law in element.laws) or element.couplings:
        return True
    return not element.translating and any(sorted(row.values()) == [-1.0, 1.0] for row in rows)
