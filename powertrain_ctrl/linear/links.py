"""Which nodes with inertia a picture joins by a line: those that a spring, a damper or a rigid connection joins."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from .assembly import TorsionalModel


def links_of(model: TorsionalModel, heavy: np.ndarray) -> tuple[tuple[str, str], ...]:
    """Pairs of the nodes that are ``heavy`` (bool), by their place among all; of rigid connections never a loop."""
    bodies = _bodies(model.T)
    beside = _rigid(model, bodies)
    pairs: set[tuple[int, int]] = set()
    for together in set(bodies.values()):
        pairs.update(_tree([i for i in together if heavy[i]], beside, heavy))
    for row in model.E:
        ends = np.flatnonzero(row).tolist()
        if len(ends) != 2 or any(end not in bodies for end in ends) or bodies[ends[0]] is bodies[ends[1]]:
            continue
        a, b = (_heavy_at(end, bodies[end], beside, heavy) for end in ends)
        if a is not None and b is not None:
            pairs.add((a, b))
    ordered = sorted((min(pair), max(pair)) for pair in pairs)
    return tuple((model.nodes[a], model.nodes[b]) for a, b in dict.fromkeys(ordered))


def _bodies(T: np.ndarray) -> dict[int, tuple[int, ...]]:
    """Of each node that moves those that always turn with it in one ratio: their rows of T are the same but for a factor."""
    moving = T.any(axis=1)
    alike = np.zeros_like(T)
    largest = np.take_along_axis(T, np.abs(T).argmax(axis=1, keepdims=True), axis=1)
    alike[moving] = np.round(T[moving] / largest[moving], 9)
    found: dict[bytes, list[int]] = {}
    for i in np.flatnonzero(moving).tolist():
        found.setdefault((alike[i] + 0.0).tobytes(), []).append(i)
    bodies = [tuple(body) for body in found.values()]
    return {i: body for body in bodies for i in body}


def _rigid(model: TorsionalModel, bodies: dict[int, tuple[int, ...]]) -> dict[int, list[int]]:
    """Of each node those that one gear or one locked clutch makes turn with it, what is at rest left out."""
    place = {node: i for i, node in enumerate(model.nodes)}
    rows: list[list[int]] = [[place[node] for node in row] for row in model.constraints]
    rows += [np.flatnonzero(row).tolist() for row in model.S[model.locked]]
    beside: dict[int, list[int]] = {i: [] for i in bodies}
    for row in rows:
        ends = [i for i in row if i in bodies]
        if len(ends) == 2 and bodies[ends[0]] is bodies[ends[1]]:
            beside[ends[0]].append(ends[1])
            beside[ends[1]].append(ends[0])
    return beside


def _tree(nodes: list[int], beside: dict[int, list[int]], heavy: np.ndarray) -> Iterator[tuple[int, int]]:
    """Nodes of one body, each with the one before it on the way from the first, over those without inertia."""
    before: dict[int, int] = {}
    for last, root in zip([None, *nodes], nodes, strict=False):
        if root in before:
            continue
        if last is not None:  # what joins them is no pair, as in a planetary gear
            yield last, root
        before[root] = root
        order = [root]
        for node in order:
            own = node if heavy[node] else before[node]
            for other in beside[node]:
                if other not in before:
                    before[other] = own
                    order.append(other)
                    if heavy[other]:
                        yield own, other


def _heavy_at(end: int, body: Iterable[int], beside: dict[int, list[int]], heavy: np.ndarray) -> int | None:
    """Node with inertia at the end of a spring, or the nearest that turns with it."""
    order = [end]
    for node in order:
        if heavy[node]:
            return node
        order += [other for other in beside[node] if other not in order]
    return min((i for i in body if heavy[i]), key=lambda i: abs(i - end), default=None)
