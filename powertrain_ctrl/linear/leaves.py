"""The order in which the coordinates of a network are eliminated, from its leaves, and what takes their place.

Rows are combinations of coordinates; springs or inertias act on each. With a coordinate i its rows ``f_c x_i + g_c`` go;
their rests ``g_c`` and, of each two, ``f_d g_c - f_c g_d`` stay. Their coefficients are known before any stiffness is, so
what cancels in them does so for all frequencies. Coefficients may be arrays with the values of many variants, and then
something has cancelled if it has in all of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from heapq import heapify, heappop, heappush
from typing import Any, NamedTuple

import numpy as np

from ..driveline.kinematics import CANCELLED

# A number or an array.
Value = Any
# A row in terms of others: its place (coordinates come first, then rows over several of them) and the factor.
Place = tuple[int, Value]

# With more rows than this at a coordinate their pairs are too many.
MOST_ROWS = 12


class Step(NamedTuple):
    """Elimination of a coordinate: places of the rows and its factors in them, of the rest of each and of their pairs.

    ``rest`` has the coefficients of each rest besides. A step is ``safe`` if it leaves one coordinate alone, as on a tree.
    """

    coordinate: int
    rows: list[Place]
    on: list[Place]
    pairs: list[tuple[int, int, Place]]
    rest: list[dict[int, Value]]
    safe: bool


class Plan(NamedTuple):
    """Where the given rows are (None for one that never moves), and how the coordinates are eliminated."""

    given: list[Place | None]
    steps: list[Step]


def reached(rows: Sequence[Mapping[int, Value]], loaded: Iterable[int]) -> list[int]:
    """Coordinates connected with these."""
    of: dict[int, list[int]] = {}
    for c, row in enumerate(rows):
        for j in row:
            of.setdefault(j, []).append(c)
    found: dict[int, None] = dict.fromkeys(loaded)
    for j in (queue := list(found)):
        for c in of.get(j, ()):
            new = [i for i in rows[c] if i not in found]
            found.update(dict.fromkeys(new))
            queue += new
    return list(found)


def balanced(rows: Sequence[Mapping[int, Value]], size: int) -> tuple[list[dict[int, Value]], list[Value]]:
    """The rows in coordinates of another scale, in which springs between two of them are multiples of a difference.

    Ratios of gears come out of the elimination this way; only what closes a loop can still have one.

    Returns
    -------
    rows : list of dict
    scale : list
        Each coordinate is so many times the new one.
    """
    scale: list[Value] = [None] * size
    between: dict[int, list[int]] = {}
    for c, row in enumerate(rows):
        for j in row if len(row) == 2 else ():
            between.setdefault(j, []).append(c)
    tree: dict[int, dict[int, Value]] = {}
    for root in range(size):
        if scale[root] is not None:
            continue
        scale[root] = 1.0
        for i in (queue := [root]):
            for c in between.get(i, ()):
                (j,) = rows[c].keys() - {i}
                if scale[j] is None:
                    factor = rows[c][i] * scale[i]
                    scale[j] = _plain(-factor / rows[c][j])
                    tree[c] = {i: factor, j: -factor}
                    queue.append(j)
    found = [tree.get(c) or {j: f * scale[j] for j, f in row.items()} for c, row in enumerate(rows)]
    return found, scale


def _plain(value: Value) -> Value:
    """A number where all variants have the same."""
    return float(value.flat[0]) if isinstance(value, np.ndarray) and np.all(value == value.flat[0]) else value


class _Rows:
    """Rows over several coordinates that are still there, found by their coordinates; of each the first factor is 1."""

    def __init__(self, size: int):
        self.size = size
        self.coefficients: dict[int, dict[int, Value]] = {}
        self.alike: dict[frozenset[int], list[int]] = {}
        self.at: dict[int, set[int]] = {j: set() for j in range(size)}
        self.count = size

    def place(self, row: dict[int, Value]) -> Place | None:
        """Where a row is: a multiple of a coordinate, of a row that there is, or a new one."""
        if not row:
            return None
        if len(row) == 1:
            return next(iter(row.items()))
        alike = self.alike.setdefault(frozenset(row), [])
        for c in alike:
            factor = _multiple(row, self.coefficients[c])
            if factor is not None:
                return c, factor
        new, self.count = self.count, self.count + 1
        factor = next(iter(row.values()))
        self.coefficients[new] = {j: _plain(f / factor) for j, f in row.items()}
        alike.append(new)
        for j in row:
            self.at[j].add(new)
        return new, factor

    def neighbours(self, coordinate: int) -> set[int]:
        return {j for c in self.at[coordinate] for j in self.coefficients[c]} - {coordinate}

    def taken(self, coordinate: int) -> list[tuple[int, dict[int, Value]]]:
        """Rows of a coordinate, which are no longer there."""
        rows = sorted(self.at[coordinate])
        for c in rows:
            self.alike[frozenset(self.coefficients[c])].remove(c)
            for j in self.coefficients[c]:
                self.at[j].discard(c)
        return [(c, self.coefficients.pop(c)) for c in rows]


def planned(given: Sequence[Mapping[int, Value]], size: int, loaded: tuple[int, ...]) -> Plan | None:
    rows = _Rows(size)
    left = set(reached(given, loaded))
    places = [rows.place({j: f for j, f in row.items() if j in left}) for row in given]
    roots: set[int] = set()
    for j in loaded:
        if not roots.intersection(reached(given, [j])):
            roots.add(j)
    waiting = [(len(rows.neighbours(j)), j) for j in left - roots]
    heapify(waiting)
    steps = []
    while left:
        # of the degrees noted for a coordinate all but the last are old
        degree, i = heappop(waiting) if waiting else (0, min(left))
        around = rows.neighbours(i)
        if i not in left or (i not in roots and degree != len(around)):
            continue
        left.discard(i)
        taken = rows.taken(i)
        if len(taken) > MOST_ROWS:
            return None
        rest = [{j: f for j, f in row.items() if j != i} for _, row in taken]
        factors = [row[i] for _, row in taken]
        on = [place for row in rest if (place := rows.place(row)) is not None]
        pairs = []
        for c in range(len(taken)):
            for d in range(c + 1, len(taken)):
                place = rows.place(_difference(factors[d], rest[c], factors[c], rest[d]))
                if place is not None:
                    pairs.append((c, d, place))
        steps.append(
            Step(i, [(c, f) for (c, _), f in zip(taken, factors, strict=True)], on, pairs, rest, len(around) < 2)
        )
        for j in around - roots:
            heappush(waiting, (len(rows.neighbours(j)), j))
    return Plan(places, steps)


def _multiple(row: Mapping[int, Value], of: Mapping[int, Value]) -> Value | None:
    """Factor by which a row is a multiple of another one over the same coordinates; None if it is none."""
    first = next(iter(of))
    factor = row[first] / of[first]
    same = [np.abs(row[j] - factor * of[j]) <= CANCELLED * np.abs(row[j]) for j in of]
    return factor if np.all([np.all(each) for each in same]) else None


def _difference(f: Value, row: Mapping[int, Value], g: Value, other: Mapping[int, Value]) -> dict[int, Value]:
    """``f row - g other`` without what cancels in every variant."""
    found = {}
    for j in {**row, **other}:
        plus, minus = f * row.get(j, 0.0), g * other.get(j, 0.0)
        if not np.all(np.abs(plus - minus) <= CANCELLED * (np.abs(plus) + np.abs(minus))):
            found[j] = plus - minus
    return found


def needed_places(plan: Plan, wanted: Iterable[int], twists: Iterable[int]) -> set[int]:
    """Places whose motion is needed for these coordinates and rows."""
    needed = set(wanted) | {place[0] for c in twists if (place := plan.given[c]) is not None}
    for step in plan.steps:
        if step.coordinate in needed:
            needed.update(c for c, _ in step.on)
        for k, (c, _) in enumerate(step.rows):
            if c in needed:
                needed.add(step.on[k][0])
                needed.update(place[0] for one, other, place in step.pairs if k in (one, other))
    return needed
