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
from typing import NamedTuple

import numpy as np

from .leaves import Plan, Step, Value, balanced, needed_places, planned, reached

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
        pairs = zip(self, other, strict=True)
        return Impedance(*(mine + factor * its if _is_there(its) else mine for mine, its in pairs))

    def at(self, s: np.ndarray, square: np.ndarray) -> Value:
        """Its value at ``s = j omega``, whose square is a real array; real where there is no damping. Arrays are new."""
        parts = [+self.stiffness] if _is_there(self.stiffness) else []
        parts += [_outer(self.inertia, square)] if _is_there(self.inertia) else []
        real = sum(parts[1:], parts[0]) if parts else 0.0
        if not _is_there(self.damping):
            return real
        if np.iscomplexobj(real):
            return real + self.damping * s
        if _is_column(real, s) and _is_column(self.damping, s):
            return _outer(real, np.ones_like(s).view(float), self.damping, s.view(float)).view(complex)
        # half as much to compute with as in complex numbers
        value = np.empty(np.broadcast_shapes(np.shape(real), np.shape(self.damping), np.shape(s)), dtype=complex)
        value.real = real
        np.multiply(self.damping, s.imag, out=value.imag)
        return value


def _is_column(value: Value, frequencies: np.ndarray) -> bool:
    """Whether it has a value for each variant, or one for all, and these are combined with each of some frequencies."""
    return frequencies.ndim == 1 and (np.ndim(value) == 0 or value.shape[1:] == (1,))


def _outer(column: Value, row: np.ndarray, other: Value = 0.0, along: np.ndarray | None = None) -> np.ndarray:
    """``column * row + other * along``, of which nothing but zeros is added up: no variant depends on its neighbours.

    As a product of matrices it takes a third of the time.
    """
    if np.ndim(column) + np.ndim(other) == 0 or not _is_column(column, row):
        return column * row if along is None else column * row + other * along
    columns, rows = np.empty((max(np.size(column), np.size(other)), 2)), np.zeros((2, len(row)))
    columns[:, :1], columns[:, 1:], rows[0] = column, other, row
    if along is not None:
        rows[1] = along
    return columns @ rows


def _is_there(value: Value) -> bool:
    return bool(value.any() if isinstance(value, np.ndarray) else value)


class Steady(NamedTuple):
    """Complex amplitudes: of the coordinates and of the given rows that were asked for."""

    motion: dict[int, Value]
    twist: dict[int, Value]


class Network:
    """Rows over ``size`` coordinates, each a mapping from coordinate to coefficient."""

    def __init__(self, rows: Sequence[Mapping[int, Value]], size: int):
        self.rows, self.scale = balanced(rows, size)
        self.size = size
        self._plans: dict[tuple[int, ...], Plan | None] = {}

    def plan(self, loaded: Iterable[int]) -> Plan | None:
        """Elimination of what these coordinates move, the first one of each part last; None if rows would grow too many."""
        loaded = tuple(loaded)
        if loaded not in self._plans:
            self._plans[loaded] = planned(self.rows, self.size, loaded)
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
        loads = {j: _scaled(self.scale[j], load) for j, load in loads.items()}
        plan = self.plan(loads)
        if plan is None:
            found, is_poor = Steady({}, {}), np.ones(1, dtype=bool)
        else:
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                found, is_poor = _swept(plan, impedances, loads, omega, wanted, twists)
                # a sum of squares of what is not finite is not finite, and takes less time than to ask each
                is_finite = all(np.isfinite(np.vdot(value, value)) for part in found for value in part.values())
            if not is_finite:
                found, is_poor = _swept(plan, impedances, loads, omega, wanted, twists, guarded=True)
        if np.any(is_poor):
            found = self._solved(found, is_poor, impedances, loads, omega, wanted, twists)
        return found._replace(motion={j: _scaled(self.scale[j], moved) for j, moved in found.motion.items()})

    def _solved(
        self,
        found: Steady,
        where: np.ndarray,
        impedances: Sequence[Impedance],
        loads: Mapping[int, Value],
        omega: np.ndarray,
        wanted: list[int],
        twists: list[int],
    ) -> Steady:
        """What has been found, but in some places by a solution of the assembled matrices."""
        moving = {j: k for k, j in enumerate(reached(self.rows, loads))}
        rows = [c for c, row in enumerate(self.rows) if row and moving.keys() >= row.keys()]
        values = [*(value for c in rows for value in impedances[c]), *(f for c in rows for f in self.rows[c].values())]
        shape = np.broadcast_shapes(*map(np.shape, (omega, where, *loads.values(), *values)))
        full = Steady(
            {j: _filled(found.motion.get(j, 0.0), shape) for j in wanted if j in moving},
            {c: _filled(found.twist.get(c, 0.0), shape) for c in twists if c in rows},
        )
        places = np.flatnonzero(np.broadcast_to(where, shape))
        at_once = max(1, CHUNK // len(moving) ** 2)
        for start in range(0, len(places), at_once):
            block = places[start : start + at_once]

            def there(value: Value, block: np.ndarray = block) -> Value:
                return np.broadcast_to(value, shape).reshape(-1)[block] if np.ndim(value) else value

            here = there(omega)
            s, square = 1j * here, -(here**2)
            A = np.zeros((len(block), len(moving), len(moving)), dtype=complex)
            b = np.zeros((len(block), len(moving), 1), dtype=complex)
            for j, load in loads.items():
                b[:, moving[j], 0] = there(load)
            for c in rows:
                z = Impedance(*map(there, impedances[c])).at(s, square)
                for i, f in self.rows[c].items():
                    for j, g in self.rows[c].items():
                        A[:, moving[i], moving[j]] += there(f) * there(g) * z
            x = np.linalg.solve(A, b)[..., 0]
            for j, motion in full.motion.items():
                motion.reshape(-1)[block] = x[:, moving[j]]
            for c, twist in full.twist.items():
                twist.reshape(-1)[block] = sum(there(f) * x[:, moving[j]] for j, f in self.rows[c].items())
        return full


def _size(value: Value) -> Value:
    """Magnitude of a complex number, within the root of two of it."""
    return np.abs(value.real) + np.abs(value.imag) if np.iscomplexobj(value) else np.abs(value)


def _filled(value: Value, shape: tuple[int, ...]) -> np.ndarray:
    return np.array(np.broadcast_to(value, shape), dtype=complex)


def _swept(
    plan: Plan,
    impedances: Sequence[Impedance],
    loads: Mapping[int, Value],
    omega: np.ndarray,
    wanted: list[int],
    twists: list[int],
    guarded: bool = False,
) -> tuple[Steady, np.ndarray]:
    """Up from the leaves with impedances and loads, and down with motions; and where a small pivot has cost digits.

    Only if ``guarded`` a pivot may be exactly zero.
    """
    z, b = _Impedances(plan, impedances, omega), dict(loads)
    needed = needed_places(plan, wanted, twists)
    poor, kept = np.zeros(1, dtype=bool), []
    for step in plan.steps:
        i, a = step.coordinate, z.taken(step.coordinate)
        own = [0.0 if (each := z.taken(c)) is None else each for c, _ in step.rows]
        squares = [f * f for _, f in step.rows]
        terms = ([] if a is None else [a]) + [_scaled(f, each) for f, each in zip(squares, own, strict=True)]
        pivot = sum(terms[1:], terms[0])
        if guarded:
            # by no more than rounding another one
            size = np.finfo(float).eps * sum(map(_size, terms))
            pivot = np.where(pivot == 0.0, size, pivot)
        del terms
        inverse = 1.0 / pivot
        share = [each * inverse for each in own] if step.pairs else [_times(each, inverse) for each in own]
        if not step.safe:
            poor = poor | _is_small(squares, share)
        alone = a * inverse if a is not None and any(c in needed for c, _ in step.rows) else None
        for k, (place, f) in enumerate(step.on):
            if a is not None:
                _add(z.come, place, _times(_times(a, share[k]) if k + 1 == len(step.on) else a * share[k], f * f))
        for c, d, (place, f) in step.pairs:
            _add(z.come, place, _times(own[c] * share[d], f * f))
        load = b.get(i)
        if load is not None:
            for (_, f), rest, q in zip(step.rows, step.rest, share, strict=True):
                for j, g in rest.items():
                    _add(b, j, _times(q * load, -f * g))
        # what no load has come to is at rest
        kept.append((alone, share, None if load is None else _times(inverse, load)))
    moved: dict[int, Value] = {}
    for step, (alone, share, by_load) in zip(reversed(plan.steps), reversed(kept), strict=True):
        for k, (c, _) in enumerate(step.rows):
            if c in needed:
                _twisted(moved, step, k, alone, share, by_load)
        if step.coordinate in needed:
            terms = [] if by_load is None else [by_load]
            for (_, f), q, (place, g) in zip(step.rows, share, step.on, strict=True):
                if place in moved:
                    terms.append(_times(_times(q, moved[place]), -f * g))
            if terms:
                moved[step.coordinate] = sum(terms[1:], terms[0])
    places = {c: given for c in twists if (given := plan.given[c]) is not None and given[0] in moved}
    found = {c: _scaled(f, moved[place]) for c, (place, f) in places.items()}
    return Steady({j: moved[j] for j in wanted if j in moved}, found), poor


def _is_small(squares: list[Value], share: list[Value]) -> Value:
    """Where a pivot is small against its terms: those of rows are ``f^2 share`` of it, and the other one is the rest."""
    most = (1.0 / SMALL_PIVOT - 1.0) / 2.0
    if sum(np.max(f) * _largest(q) for f, q in zip(squares, share, strict=True)) <= most:
        return False
    return sum(f * _size(q) for f, q in zip(squares, share, strict=True)) > most


def _largest(value: Value) -> float:
    """No `_size` in it is larger."""
    flat = np.ravel(value, order="K")
    flat = flat.view(float) if np.iscomplexobj(flat) else flat
    return 2.0 * max(flat.max(), -flat.min())


def _twisted(moved: dict[int, Value], step: Step, k: int, alone: Value, share: list[Value], by_load: Value) -> None:
    """Twist of a row over several coordinates, from those that have taken its place."""
    (c, f), (rest, g) = step.rows[k], step.on[k]
    terms = [] if by_load is None else [_scaled(f, by_load)]
    if alone is not None and rest in moved:
        terms.append(_times(alone * moved[rest], g))
    for one, other, (place, h) in step.pairs:
        if place in moved and k in (one, other):
            sign, d = (h, other) if k == one else (-h, one)
            terms.append(_times(share[d] * moved[place], sign * step.rows[d][1]))
    if terms:
        moved[c] = sum(terms[1:], terms[0])


class _Impedances:
    """Impedances at their places: given ones, added up before they meet the frequencies, and what has come to them.

    The former are computed when they are needed, for what has just been written is at hand.
    """

    def __init__(self, plan: Plan, impedances: Sequence[Impedance], omega: np.ndarray):
        self.given: dict[int, Impedance] = {}
        for place, impedance in zip(plan.given, impedances, strict=True):
            if place is not None:
                at, factor = place
                self.given[at] = self.given.get(at, Impedance()).added(factor * factor, impedance)
        self.come: dict[int, Value] = {}
        self.s, self.square = 1j * omega, -(omega**2)

    def taken(self, place: int) -> Value | None:
        """All there is at a place, which is no longer there."""
        if place in self.given:
            _add(self.come, place, self.given.pop(place).at(self.s, self.square))
        return self.come.pop(place, None)


def _scaled(factor: Value, value: Value) -> Value:
    """``factor * value``, at no cost where the factor is 1."""
    return value if isinstance(factor, float) and factor == 1.0 else factor * value


def _times(value: Value, factor: Value) -> Value:
    """``value * factor``, in the memory of the value, which nothing else has a use for, where there is room for it."""
    if isinstance(factor, float) and factor == 1.0:
        return value
    if _has_room(value, factor):
        value *= factor
        return value
    return value * factor


def _has_room(value: Value, other: Value) -> bool:
    """Whether a sum or a product of both fits into the memory of the first one."""
    # numpy takes a product of single numbers in place for a reduction, whose last digit may be another one
    if not isinstance(value, np.ndarray) or value.size < 2 or value.dtype.kind != "c":
        return False
    shape = np.shape(other)
    return shape in ((), value.shape) or np.broadcast_shapes(value.shape, shape) == value.shape


def _add(to: dict[int, Value], key: int, value: Value) -> None:
    """Add a value; neither it nor the sum has another use, and one that is as large as the new sum becomes it."""
    there = to.get(key)
    if there is None:
        to[key] = value
        return
    if not _has_room(value, there):
        value, there = there, value
    if _has_room(value, there):
        part = value if np.iscomplexobj(there) else value.real
        part += there
    else:
        value = value + there
    to[key] = value
