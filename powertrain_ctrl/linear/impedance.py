"""Steady harmonic motion by impedances from the leaves: no matrix is assembled, so nothing cancels in it.

A network is made of *rows*, combinations ``f x`` of the motions x of its coordinates: twists of springs and dampers, motions
of inertias. Each has an *impedance* z, by which it adds ``z |f x|^2 / 2`` to what is stationary under the loads. When a
coordinate i is eliminated that has the impedance a by itself and the rows ``c = f_c x_i + g_c`` in common with others, then
by Lagrange's identity, with ``Delta = a + sum f_c^2 z_c``,

    a z_c / Delta  on each ``g_c``,   z_c z_d / Delta  on each pair ``f_d g_c - f_c g_d``

take their place: springs in series, wherever they form a tree, one at a time from its leaves. What an assembled stiffness
loses, the difference of large terms in it, is never formed, and a twist comes from the torques that cause it. This is the
elimination of Grassmann, Taksar and Heyman (Oper. Res. 33 (1985) 1107-1116) for springs of any ratio.

Values may be arrays that broadcast with the frequencies: of many variants, or of impedances that depend on a speed.
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

# With more rows than this at a coordinate their pairs are too many, and the matrix is solved.
MOST_ROWS = 12
# Where a loop is closed, a pivot below this part of its terms costs digits, and the matrix is solved there: about a
# resonance of a branch the stiffnesses in it do not cancel.
SMALL_PIVOT = 1e-3
# So many numbers of matrices are held at once.
CHUNK = 4_000_000


class Impedance(NamedTuple):
    """Dynamic stiffness ``stiffness + j omega damping - omega^2 inertia``; a loss factor makes the stiffness complex."""

    stiffness: Value = 0.0
    damping: Value = 0.0
    inertia: Value = 0.0

    def added(self, factor: Value, other: Impedance) -> Impedance:
        """With ``factor`` times another one."""
        return Impedance(*(mine + factor * its for mine, its in zip(self, other, strict=True)))

    def at(self, omega: np.ndarray) -> Value:
        """Its value at angular frequencies, real where there is no damping."""
        value = self.stiffness
        if np.any(self.inertia):
            value = value - self.inertia * omega**2
        return value + 1j * (self.damping * omega) if np.any(self.damping) else value


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


class Steady(NamedTuple):
    """Complex amplitudes: of the coordinates and of the given rows that were asked for."""

    motion: dict[int, Value]
    twist: dict[int, Value]


class Network:
    """Rows over ``size`` coordinates, each a mapping from coordinate to coefficient."""

    def __init__(self, rows: Sequence[Mapping[int, Value]], size: int):
        self.rows = [dict(row) for row in rows]
        self.size = size
        self._plans: dict[tuple[int, ...], Plan | None] = {}

    def plan(self, loaded: Iterable[int]) -> Plan | None:
        """Elimination of what these coordinates move, the first one of each part last; None if rows would grow too many."""
        loaded = tuple(loaded)
        if loaded not in self._plans:
            self._plans[loaded] = _planned(self.rows, self.size, loaded)
        return self._plans[loaded]

    def steady(
        self,
        impedances: Sequence[Impedance],
        loads: Mapping[int, Value],
        omega: np.ndarray,
        wanted: Iterable[int],
        twists: Iterable[int],
    ) -> Steady:
        """Motion of wanted coordinates and twist of wanted rows under harmonic loads on coordinates.

        Parameters
        ----------
        impedances : sequence of Impedance
            Of each row.
        loads : mapping
            Coordinate to complex amplitude.
        omega : ndarray
            Angular frequencies [rad/s], > 0; everything else broadcasts with it.
        wanted, twists : iterable of int
            Coordinates and rows.

        Returns
        -------
        Steady
            Without an entry for what no load moves.
        """
        wanted, twists = list(wanted), list(twists)
        plan = self.plan(loads)
        if plan is None:
            return self._solved(impedances, loads, omega, wanted, twists)
        found, is_poor = _swept(plan, impedances, loads, omega, wanted, twists)
        if np.any(is_poor):
            shape = np.broadcast_shapes(
                omega.shape, is_poor.shape, *(np.shape(value) for part in found for value in part.values())
            )
            where = np.broadcast_to(is_poor, shape)

            def there(value: Value) -> np.ndarray:
                return np.broadcast_to(value, shape)[where]

            rows = [{j: there(f) if np.ndim(f) else f for j, f in row.items()} for row in self.rows]
            better = Network(rows, self.size)._solved(
                [Impedance(*(there(value) if np.ndim(value) else value for value in each)) for each in impedances],
                {j: there(load) for j, load in loads.items()},
                there(omega),
                wanted,
                twists,
            )
            for part, right in zip(found, better, strict=True):
                for key, value in part.items():
                    part[key] = np.array(np.broadcast_to(value, shape), dtype=complex)
                    part[key][where] = right[key]
        return found

    def _solved(
        self,
        impedances: Sequence[Impedance],
        loads: Mapping[int, Value],
        omega: np.ndarray,
        wanted: list[int],
        twists: list[int],
    ) -> Steady:
        """The same by a solution of the assembled matrices, of those coordinates that the loads can move."""
        reached = _reached(self.rows, loads)
        place = {j: k for k, j in enumerate(reached)}
        values = [each.at(omega) for each in impedances]
        arrays = [*values, *loads.values(), *(f for row in self.rows for f in row.values())]
        shape = np.broadcast_shapes(omega.shape, *map(np.shape, arrays))
        b = np.zeros((*shape, len(place), 1), dtype=complex)
        for j, load in loads.items():
            b[..., place[j], 0] += load
        A = np.zeros((*shape, len(place), len(place)), dtype=complex)
        for row, value in zip(self.rows, values, strict=True):
            for i, f in row.items():
                for j, g in row.items():
                    if i in place:
                        A[..., place[i], place[j]] += f * g * value
        x = np.linalg.solve(A, b)[..., 0]
        motion = {j: x[..., place[j]] for j in reached}
        moved = {c: [f * motion[j] for j, f in self.rows[c].items() if j in place] for c in twists}
        return Steady(
            {j: motion[j] for j in wanted if j in place}, {c: sum(terms) for c, terms in moved.items() if terms}
        )


def _reached(rows: Sequence[Mapping[int, Value]], loaded: Iterable[int]) -> list[int]:
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


class _Rows:
    """Rows over several coordinates that are still there, found by their coordinates."""

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
        self.coefficients[new] = row
        alike.append(new)
        for j in row:
            self.at[j].add(new)
        return new, 1.0

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


def _planned(given: Sequence[Mapping[int, Value]], size: int, loaded: tuple[int, ...]) -> Plan | None:
    rows = _Rows(size)
    left = set(_reached(given, loaded))
    places = [rows.place({j: f for j, f in row.items() if j in left}) for row in given]
    roots: set[int] = set()
    for j in loaded:
        if not roots.intersection(_reached(given, [j])):
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
        on = [rows.place(row) for row in rest]
        pairs = []
        for c in range(len(taken)):
            for d in range(c + 1, len(taken)):
                place = rows.place(_difference(factors[d], rest[c], factors[c], rest[d]))
                if place is not None:
                    pairs.append((c, d, place))
        steps.append(Step(i, [(c, f) for (c, _), f in zip(taken, factors, strict=True)], on, pairs, rest, len(around) < 2))
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


def _needed(plan: Plan, wanted: Iterable[int], twists: Iterable[int]) -> set[int]:
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


def _swept(
    plan: Plan,
    impedances: Sequence[Impedance],
    loads: Mapping[int, Value],
    omega: np.ndarray,
    wanted: list[int],
    twists: list[int],
) -> tuple[Steady, np.ndarray]:
    """Up from the leaves with impedances and loads, and down with motions; and where a small pivot has cost digits."""
    z, b = _at_start(plan, impedances, omega), dict(loads)
    poor, kept = np.zeros(1, dtype=bool), []
    for step in plan.steps:
        i, a = step.coordinate, z.pop(step.coordinate, None)
        own = [z.pop(c, 0.0) for c, _ in step.rows]
        terms = ([] if a is None else [a]) + [_scaled(f * f, each) for (_, f), each in zip(step.rows, own, strict=True)]
        pivot = sum(terms[1:], terms[0])
        if not step.safe:
            poor = poor | (np.abs(pivot) < SMALL_PIVOT * sum(np.abs(term) for term in terms))
        if not np.all(pivot):
            # by no more than rounding another one
            size = np.finfo(float).eps * sum(np.abs(term) for term in terms)
            pivot = np.where(pivot == 0.0, size, pivot)
        share = [each / pivot for each in own]
        for k, (place, f) in enumerate(step.on):
            if a is not None:
                _add(z, place, _scaled(f * f, a * share[k]))
        for c, d, (place, f) in step.pairs:
            _add(z, place, _scaled(f * f, own[c] * share[d]))
        load = b.get(i)
        if load is not None:
            for (_, f), rest, q in zip(step.rows, step.rest, share, strict=True):
                for j, g in rest.items():
                    _add(b, j, -f * g * (q * load))
        kept.append((a, pivot, share))
    needed, moved = _needed(plan, wanted, twists), {}
    for step, (a, pivot, share) in zip(reversed(plan.steps), reversed(kept), strict=True):
        # what no load has come to is at rest
        by_load = b[step.coordinate] / pivot if step.coordinate in b else None
        if step.coordinate in needed:
            terms = [] if by_load is None else [by_load]
            for (_, f), q, (place, g) in zip(step.rows, share, step.on, strict=True):
                if place in moved:
                    terms.append(_scaled(-f * g, q * moved[place]))
            if terms:
                moved[step.coordinate] = sum(terms[1:], terms[0])
        for k, (c, f) in enumerate(step.rows):
            if c in needed:
                _twisted(moved, step, k, a, pivot, share, by_load)
    found = {c: place for c in twists if (place := plan.given[c]) is not None and place[0] in moved}
    return (
        Steady(
            {j: moved[j] for j in wanted if j in moved},
            {c: _scaled(f, moved[place]) for c, (place, f) in found.items()},
        ),
        poor,
    )


def _twisted(
    moved: dict[int, Value], step: Step, k: int, a: Value, pivot: Value, share: list[Value], by_load: Value
) -> None:
    """Twist of a row over several coordinates, from those that have taken its place."""
    (c, f), (rest, g) = step.rows[k], step.on[k]
    terms = [] if by_load is None else [_scaled(f, by_load)]
    if a is not None and rest in moved:
        terms.append(_scaled(g, a / pivot * moved[rest]))
    for one, other, (place, h) in step.pairs:
        if place in moved and k in (one, other):
            sign, d = (h, other) if k == one else (-h, one)
            terms.append(_scaled(sign * step.rows[d][1], share[d] * moved[place]))
    if terms:
        moved[c] = sum(terms[1:], terms[0])


def _at_start(plan: Plan, impedances: Sequence[Impedance], omega: np.ndarray) -> dict[int, Value]:
    """Impedances at their places; what comes together at one place is added up before it meets the frequencies."""
    total: dict[int, Impedance] = {}
    for place, impedance in zip(plan.given, impedances, strict=True):
        if place is not None:
            at, factor = place
            total[at] = total.get(at, Impedance()).added(factor * factor, impedance)
    return {at: impedance.at(omega) for at, impedance in total.items()}


def _scaled(factor: Value, value: Value) -> Value:
    """``factor * value``, at no cost where the factor is 1."""
    return value if isinstance(factor, float) and factor == 1.0 else factor * value


def _add(to: dict[int, Value], key: int, value: Value) -> None:
    to[key] = to[key] + value if key in to else value
