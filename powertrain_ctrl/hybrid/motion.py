"""Exact motion of a driveline while none of its laws changes its mode, and when one will.

A guard is a *functional* ``g = c x + p(t)`` that must stay positive: the slip of a sliding clutch, the torque reserve of a
stuck one, what a twist lacks to the flank of a gap. From a point with ``g > 0`` the search steps as far as
``g + g' h - M h^2 / 2 > 0`` guarantees, where M bounds ``|g''|`` rigorously. It approaches the first zero from its safe
side with quadratic convergence and cannot step over a pair of crossings.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .flow import (
    DenseTrajectory,
    ModalTrajectory,
    WithIntegrals,
    integrated_square,
    polynomial_derivatives,
    value_at,
)
from .matrices import ROUNDING
from .plant import Modes, Plant, Segment

# Margins smaller than this part of the torques they sum up are zero: what decides nothing. Far above the rounding
# of an event's time and state, far below what a bearing feels.
INDIFFERENT = 1e-10
# Margins that contradict their mode by less than so many tolerances may be all that rounding has left.
LENIENT = 8.0
# Times closer than this part of a piece [s], or of a second, are one.
TICK = 1e-13
# Rounding of what grazes zero leaves no event in doubt longer than this [s].
LONGEST_DOUBT = 1e-11
# The event search looks at so many points at once; leaving zero it begins with this step [s].
LOOK_AHEAD = 16
FIRST_STEP = 1e-12
# A certified step below this part of the time, or of a second, has arrived.
SAME_TIME = 1e-15


class Margin(NamedTuple):
    """What a law has left before its mode must end, and two time derivatives [N m, N m/s, ...].

    Of one that holds its slip at zero what its torque lacks to its limit; of one that slides at zero slip what its torque
    lacks to holding it: one rule for both, with the same ``tolerance`` of each derivative. Of others their guards.
    ``then`` is the mode that follows.
    """

    law: int
    then: int
    value: np.ndarray
    tolerance: np.ndarray

    @property
    def excess(self) -> float | None:
        """How many tolerances the first of the values that is not zero lies below zero; None if all are zero."""
        leading = np.flatnonzero(np.abs(self.value) > self.tolerance)
        return None if not leading.size else -float(self.value[leading[0]] / self.tolerance[leading[0]])


class Hit(NamedTuple):
    """A law that can no longer do what it does: its number, the mode that follows if it must, and the local time.

    Rounding leaves the time in ``doubt`` by so much.
    """

    law: int
    then: int
    time: float
    doubt: float


class Motion:
    """Exact motion in one mode of each law from a state, in local time."""

    def __init__(self, plant: Plant, modes: Modes, x: np.ndarray, segment: Segment):
        self.plant, self.modes, self.segment, self.start = plant, modes, segment, x
        self.pattern = pattern = plant.pattern(modes, segment.levels)
        self.given = pattern.given(segment)
        b = pattern.force_u @ segment.inputs + pattern.force_tau @ self.given
        self.trajectory: ModalTrajectory | DenseTrajectory = pattern.dynamics.flow.trajectory(
            pattern.dynamics.inverse @ x[: plant.N], b
        )

    def state(self, t: np.ndarray) -> np.ndarray:
        """(size, samples) ndarray."""
        x = self.trajectory.state(t)
        if not self.pattern.is_whole:
            x = self.pattern.dynamics.basis @ x
        if not self.plant.elastic:
            return x
        x = np.vstack([x, np.zeros((len(self.plant.elastic), len(t)))])
        sums = None
        for i in self.plant.elastic:
            y, q = self.plant.stretch[i], self.plant.twisted[i]
            if not self.pattern.dynamics.basis[y].any():
                x[y] = self.start[y]
            if self.pattern.integrated(i):
                if sums is None:
                    sums = self.pattern.dynamics.basis @ self.trajectory.state(t, integrals=1)
                x[q] = self.start[q] + self.plant.G[:, i] @ sums
            else:
                x[q] = self.start[q] - self.start[y] + x[y]
        return x

    def torque(self, t: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(laws, samples) ndarray from the states at these times."""
        on_x, on_u, on_tau = self.pattern.on_torque
        return on_x @ x[: self.plant.N] + value_at(on_u @ self.segment.inputs + on_tau @ self.given, t)

    def heat(self, duration: float) -> np.ndarray:
        """(laws,) ndarray: exact integral of what the laws dissipate [J].

        Of given torques times slip by parts, of dampers and fading stretches by squares.
        """
        work = self._lost(duration)
        sliding = np.flatnonzero(self.pattern.slides)
        if not sliding.size:
            return work
        end = np.array([duration])
        rows = self.plant.G.T[sliding] @ self.pattern.dynamics.basis
        degree = self.given.shape[1] - 1
        torques = [
            value_at(derivative, end)[:, 0] for derivative in polynomial_derivatives(self.given[sliding], degree)
        ]
        while torques and not torques[-1].any():
            torques.pop()
        for k, (torque, x) in enumerate(zip(torques, self.trajectory.integrals(duration, len(torques)), strict=True)):
            work[sliding] += (-1.0) ** k * torque * (rows @ x)
        return work

    def _lost(self, duration: float) -> np.ndarray:
        """(laws,) ndarray: what dampers, fading stretches and gears lose [J]."""
        work, (laws, factors, rows, on_u, on_tau) = np.zeros(len(self.modes)), self.pattern.losses
        if laws:
            pattern, flow = self.pattern, self.trajectory.flow
            b = pattern.force_u @ self.segment.inputs + pattern.force_tau @ self.given
            n, q = b.shape
            # the powers of time are coordinates besides
            A = np.zeros((n + q, n + q))
            A[:n, :n], A[:n, n:] = flow.A, b
            A[n:, n:] = np.diag(np.arange(1.0, q), -1)
            start = np.zeros((n + q, 1))
            start[:n, 0], start[n] = pattern.dynamics.inverse @ self.start[: self.plant.N], 1.0
            powers = on_u @ self.segment.inputs + on_tau @ self.given
            squares = integrated_square(A, start, np.hstack([rows, powers]), duration)
            np.add.at(work, laws, factors * squares)
        return work

    @cached_property
    def _guards(self) -> tuple[np.ndarray, np.ndarray]:
        """Polynomials that the rows of the watch are added to, and such of the magnitudes of what cancels in them.

        The latter say how far rounding goes.
        """
        guards, start = self.pattern.guards, self.pattern.watch.start
        inputs, given, capacities = self._forcing
        polynomials = guards.on_u @ inputs + guards.on_tau @ given + guards.on_c @ capacities
        terms = abs(guards.on_u) @ abs(inputs) + abs(guards.on_tau) @ abs(given) + abs(guards.on_c) @ abs(capacities)
        polynomials[:, 0] += guards.level + start @ self.start
        terms[:, 0] += abs(guards.level) + abs(start) @ abs(self.start)
        return polynomials, terms

    def margins(self, laws: Iterable[int], hit: Hit | None = None) -> list[Margin]:
        """Margins at the start of these laws: of those that hold, those that slide at zero slip, and others.

        A reserve that has just been ``hit`` is not above zero, whatever rounding says.
        """
        plant, pattern = self.plant, self.pattern
        inputs, given, capacities = (_derivatives_at_start(p) for p in self._forcing)
        x, size = self._state_derivatives(inputs, given)
        margins = []
        for i in laws:
            law, mode = plant.laws[i], pattern.mode[i]
            turns = False
            if law.load is not None and not mode.held:
                margins += self._load_margins(i, x, size, inputs, given, hit)
                turns = abs(plant.G[:, i] @ x[:, 0]) > ROUNDING * (abs(plant.G[:, i]) @ size[:, 0])
            if not mode.guards or i in pattern.held_too or turns:
                continue
            if law.held is None:
                margins += self._free_margins(i, x, size, inputs, given, capacities)
                continue
            together = tuple(sorted({*pattern.held, i}))
            on_x, on_u, on_tau, _ = (row[together.index(i)] for row in plant.holding(together, pattern.key))
            others = given.copy()
            others[i] = 0.0
            torque = on_x @ x + on_u @ inputs + on_tau @ others
            terms = abs(on_x) @ size + abs(on_u) @ abs(inputs) + abs(on_tau) @ abs(others)
            values: dict[int, np.ndarray] = {}
            if mode.held:
                limits = np.zeros_like(terms)
                for g in mode.guards:
                    limit = g.capacity * capacities[i] if g.capacity else np.zeros_like(terms)
                    limit[0] += g.level
                    if g.load:
                        load_x, load_u, load_tau = pattern.on_load[i]
                        limit += g.load * (load_x @ x + load_u @ inputs + load_tau @ given)
                    values[g.then] = limit + g.torque * torque
                    limits = np.maximum(limits, abs(limit))
                terms = terms + (abs(capacities[i]) if law.is_clutch else limits)
            else:
                guard = next((g for g in mode.guards if law.modes[g.then].held), None)
                if guard is None:
                    continue
                values[guard.then] = np.sign(guard.slip) * (torque - given[i])
                terms = terms + abs(given[i])
            tolerance = INDIFFERENT * terms[:-1] + TICK * terms[1:]  # what a tick takes to zero is zero
            for then, value in values.items():
                if hit is not None and hit.law == i and not law.modes[hit.then].held:
                    if hit.then == then:
                        value[0] = min(value[0], 0.0)
                    elif hit.then == self.modes[i]:
                        value[0] = max(value[0], 0.0)
                margins.append(Margin(i, then, value[:-1], tolerance))
        return margins

    def _load_margins(
        self, i: int, x: np.ndarray, size: np.ndarray, inputs: np.ndarray, given: np.ndarray, hit: Hit | None
    ) -> list[Margin]:
        """Guards on the load of a law that slides."""
        margins = []
        for g in self.pattern.mode[i].guards:
            if g.load:
                on_x, on_u, on_tau = self.pattern.on_load[i]
                value = g.load * (on_x @ x + on_u @ inputs + on_tau @ given)
                terms = abs(g.load) * (abs(on_x) @ size + abs(on_u) @ abs(inputs) + abs(on_tau) @ abs(given))
                if hit is not None and (hit.law, hit.then) == (i, g.then):
                    value[0] = min(value[0], 0.0)
                margins.append(Margin(i, g.then, value[:-1], INDIFFERENT * terms[:-1] + TICK * terms[1:]))
        return margins

    def _free_margins(
        self,
        i: int,
        x: np.ndarray,
        size: np.ndarray,
        inputs: np.ndarray,
        given: np.ndarray,
        capacities: np.ndarray,
    ) -> list[Margin]:
        """Guards of a law that never holds its slip."""
        plant, pattern = self.plant, self.pattern
        (on_x, on_u, on_tau), margins = pattern.on_torque, []
        slip, slip_size = plant.G[:, i] @ x, abs(plant.G[:, i]) @ size
        torque = on_x[i] @ x + on_u[i] @ inputs + on_tau[i] @ given
        torque_size = abs(on_x[i]) @ size + abs(on_u[i]) @ abs(inputs) + abs(on_tau[i]) @ abs(given)
        twist, stretch, stretch_size = np.zeros_like(slip), np.zeros_like(slip), np.zeros_like(slip)
        twist_size = np.zeros_like(slip)
        if i in plant.stretch:
            y, q = plant.stretch[i], plant.twisted[i]
            twist[0], twist[1:] = self.start[q], slip[:-1]
            stretch, stretch_size = x[y], size[y]
            twist_size[0], twist_size[1:] = abs(self.start[q]), slip_size[:-1]
        for g in pattern.mode[i].guards:
            value = g.twist * twist + g.stretch * stretch + g.slip * slip + g.torque * torque
            terms = abs(g.twist) * twist_size + abs(g.stretch) * stretch_size
            terms = terms + abs(g.slip) * slip_size + abs(g.torque) * torque_size
            value[0] += g.level
            terms[0] += abs(g.level)
            if g.capacity:
                value, terms = value + g.capacity * capacities[i], terms + abs(g.capacity * capacities[i])
            margins.append(Margin(i, g.then, value[:-1], INDIFFERENT * terms[:-1] + TICK * terms[1:]))
        return margins

    @property
    def _forcing(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.segment.inputs, self.given, self.segment.capacities

    def _state_derivatives(self, inputs: np.ndarray, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x and its derivatives at the start, one a column, and of each the magnitude that `INDIFFERENT` is a part of.

        That is its own, and what rounding leaves of the motion of all others and of the forces that cancel in it.
        """
        plant, (A, basis, _, push, _) = self.plant, self.pattern.dynamics
        B, W = self.pattern.B, self.pattern.W
        forces = B @ inputs - W @ given
        terms = abs(B) @ abs(inputs) + abs(W) @ abs(given)
        x = np.empty((plant.N, inputs.shape[1]))
        size = np.empty_like(x)
        x[:, 0] = self.start[: plant.N]
        size[:, 0] = abs(x[:, 0]) + ROUNDING / INDIFFERENT * np.linalg.norm(x[:, 0])
        for k in range(x.shape[1] - 1):
            x[:, k + 1] = basis @ (push @ (A @ x[:, k] + forces[:, k]))
            size[:, k + 1] = abs(x[:, k + 1]) + ROUNDING / INDIFFERENT * (abs(A) @ size[:, k] + terms[:, k])
        return x, size

    def violated(self) -> bool:
        """Whether this mode contradicts its own motion at the start."""
        g, _, _, size = self._look(np.zeros(1), 0.0)
        return bool((g < -ROUNDING * size).any())

    def _look(self, t: np.ndarray, until: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(guards, samples) ndarrays: values, slopes, a bound on how they bend until then, sizes of their terms."""
        rows, (polynomials, terms) = self.pattern.watch.rows, self._guards
        trajectory = WithIntegrals(self.trajectory) if self.pattern.watch.integrals else self.trajectory
        slopes, bends = polynomial_derivatives(polynomials, 2)[1:]
        y, y1, y2 = trajectory.derivatives(t, 2)
        weights = trajectory.weights(rows)
        return (
            (rows @ y).real + value_at(polynomials, t),
            (rows @ y1).real + value_at(slopes, t),
            weights @ trajectory.largest_second(y2, t, until) + value_at(abs(bends), np.array([until])),
            weights @ trajectory.size(y) + value_at(terms, t),
        )

    def first_event(self, duration: float, resolved: Sequence[int] = (), hit: Hit | None = None) -> Hit | None:
        """The first guard that reaches zero, None if all stay positive.

        ``resolved`` are laws whose modes were chosen for this very instant, because one was ``hit`` or for another reason:
        what is zero of theirs at the start departs from there.
        """
        if not self.pattern.guards.laws:
            return None
        departing, blur = self._departures(resolved, hit)
        times, creep = np.zeros(1), FIRST_STEP
        growth = self.pattern.dynamics.flow.growth
        while True:
            # bounds of what grows are taken over one time constant at a time
            until = min(duration, float(times[-1]) + 1.0 / growth) if growth else duration
            g, slope, bend, size = self._look(times, until)
            if self.plant.loaded:  # a load that is next to nothing may be so on either side
                g = g + INDIFFERENT * self.pattern.guards.on_load[:, None] * size
            fog = value_at(blur, times) + ROUNDING * size
            # hidden until it has once been seen
            hidden = departing[:, None] & ~np.logical_or.accumulate(g > fog, axis=1)
            touching = g <= ROUNDING * size
            # Behind a jump of the inputs it may be far below zero and yet rising.
            below = (touching & (slope < 0.0)) | (g < -2.0 * INDIFFERENT * size)
            fallen = (hidden & (g < -fog)) | (~hidden & below)
            step = _certified_step(np.maximum(g, 0.0), slope, bend)
            step[hidden] *= 0.5  # not at once to where it may be back at zero: half way it shows
            # What has just left zero is below rounding: creep on, twice as far each time, until it shows.
            waiting = hidden | touching
            step[waiting] = np.maximum(step[waiting], np.maximum(creep, 10.0 * SAME_TIME * times[-1]))
            if until < duration:
                step = np.minimum(step, until - times)
            last = _last_safe(times, step.min(axis=0), fallen)
            now, onward = float(times[last]), float(step[:, last].min())
            if fallen[:, last].any():
                j = int(fallen[:, last].argmax())
                return self._hit(j, now, ROUNDING * size[j, last], slope[j, last])
            if now + onward >= duration:
                return None
            if onward < SAME_TIME * max(1.0, now):
                j = int(step[:, last].argmin())
                return self._hit(j, now, ROUNDING * size[j, last], slope[j, last])
            departing = hidden[:, last]
            if waiting[:, last].any():
                creep = 2.0 * onward
            times = now + onward * np.arange(1.0, LOOK_AHEAD + 1.0)
            times = times[times < duration]

    def _hit(self, guard: int, time: float, rounding: float, slope: float) -> Hit:
        guards = self.pattern.guards
        fast = abs(slope) * LONGEST_DOUBT > 2.0 * rounding
        doubt = 2.0 * rounding / abs(slope) if fast else LONGEST_DOUBT
        return Hit(guards.laws[guard], guards.then[guard], time, doubt)

    def _departures(self, resolved: Sequence[int], hit: Hit | None) -> tuple[np.ndarray, np.ndarray]:
        """Which guards start at zero, and polynomials within which they are not told from zero later on."""
        guards, now = self.pattern.guards, np.zeros(1)
        departing = np.zeros(len(guards.laws), dtype=bool)
        blur = np.zeros((len(guards.laws), 4))
        if not resolved:
            return departing, blur
        g, _, _, size = self._look(now, 0.0)
        known = {(margin.law, margin.then): margin for margin in self.margins(resolved, hit)}
        for j, key in enumerate(zip(guards.laws, guards.then, strict=True)):
            if key not in known:
                continue
            margin, drift = known[key], 2.0 * LENIENT * known[key].tolerance
            if self.plant.laws[margin.law].modes[margin.then].held:
                departing[j] = True
                together = tuple(sorted({*self.pattern.held, margin.law}))
                holding = self.plant.holding(together, self.pattern.key)
                weight = holding.weight[together.index(margin.law)]
                blur[j] = [2.0 * abs(g[j, 0]) + ROUNDING * size[j, 0], *(weight * drift / [1.0, 2.0, 6.0])]
            else:
                departing[j] = margin.value[0] <= margin.tolerance[0]
                blur[j, :3] = drift / [1.0, 1.0, 2.0]
                blur[j, 0] += 2.0 * abs(g[j, 0])
        return departing, blur


def _derivatives_at_start(polynomials: np.ndarray) -> np.ndarray:
    """(signals, 4) ndarray: value and three derivatives at local time 0."""
    factorials = np.array([1.0, 1.0, 2.0, 6.0])
    known = min(4, polynomials.shape[1])
    result = np.zeros((len(polynomials), 4))
    result[:, :known] = polynomials[:, :known] * factorials[:known]
    return result


def _last_safe(times: np.ndarray, step: np.ndarray, fallen: np.ndarray) -> int:
    """Index of the last of these times that certified steps lead to."""
    ends = np.array(fallen.any(axis=0))
    ends[:-1] |= step[:-1] < np.diff(times)
    ends[-1] = True
    return int(ends.argmax())


def _certified_step(g: np.ndarray, g1: np.ndarray, M: np.ndarray) -> np.ndarray:
    """Largest h for which ``g + g1 h - M h^2 / 2 >= 0`` on all of [0, h]."""
    root = np.sqrt(g1 * g1 + 2.0 * M * g)
    # Each form where its terms do not cancel. Without a denominator the functional neither falls nor bends.
    below = np.where(g1 < 0.0, root - g1, M)
    h = np.where(g1 < 0.0, 2.0 * g, g1 + root) / np.maximum(below, 1e-250)
    h[below <= 1e-250] = np.inf
    return h
