"""Exact motion of a driveline while none of its laws changes its mode, and when one will.

A guard is a *functional* ``g = c x + p(t)`` that must stay positive: the slip of a sliding clutch, the torque reserve of a
stuck one, what a twist lacks to the flank of a gap. From a point with ``g > 0`` the search steps as far as
``g + g' h - M h^2 / 2 > 0`` guarantees, where M bounds ``|g''|`` rigorously. It approaches the first zero from its safe
side with quadratic convergence and cannot step over a pair of crossings.
"""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from .flow import DenseTrajectory, ModalTrajectory, Squares, polynomial_derivatives, value_at
from .lookout import Look, Lookout
from .matrices import ROUNDING
from .plant import Modes, Plant
from .segment import Segment

# Margins smaller than this part of the torques they sum up are zero: what decides nothing. Far above the rounding
# of an event's time and state, far below what a bearing feels.
INDIFFERENT = 1e-10
# Margins that contradict their mode by less than so many tolerances may be all that rounding has left.
LENIENT = 8.0
# Times closer than this part of a piece [s], or of a second, are one.
TICK = 1e-13
# Rounding of what grazes zero leaves no event in doubt longer than this [s].
LONGEST_DOUBT = 1e-11
# The event search looks at points so many steps ahead at once; leaving zero it begins with this step [s].
STEPS = np.arange(1.0, 17.0)
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
        for value, tolerance in zip(self.value.tolist(), self.tolerance.tolist(), strict=True):
            if abs(value) > tolerance:
                return -value / tolerance if tolerance else -float(np.copysign(np.inf, value))
        return None


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
        self._margins: dict[tuple, list[Margin]] = {}
        b = pattern.force_u @ segment.inputs + pattern.force_tau @ self.given
        self.trajectory: ModalTrajectory | DenseTrajectory = pattern.dynamics.flow.trajectory(
            pattern.dynamics.inverse @ x[: plant.N], b
        )

    def state(self, t: np.ndarray) -> np.ndarray:
        """(size, samples) ndarray."""
        w = self.trajectory.state(t)
        if not self.plant.elastic:
            return w if self.pattern.is_whole else self.pattern.dynamics.basis @ w
        x, sums = np.empty((self.plant.size, len(t))), None
        np.matmul(self.pattern.dynamics.basis, w, out=x[: self.plant.N])
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
        """(laws,) ndarray: exact integral of given torques times slip [J], by parts."""
        work = np.zeros(len(self.modes))
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

    def squares(self, duration: float) -> Squares | None:
        """What dampers, fading stretches and gears lose besides [J], to be integrated."""
        laws, factors, rows, on_u, on_tau = self.pattern.losses
        if not laws:
            return None
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
        return Squares(A, start, np.hstack([rows, powers]), duration, laws, factors)

    @cached_property
    def _look(self) -> Lookout:
        """Guards along this motion."""
        guards, start = self.pattern.guards, self.pattern.watch.start
        forcing = self._forcing
        polynomials, terms = guards.on_forcing @ forcing, self.pattern.guard_sizes[1] @ abs(forcing)
        polynomials[:, 0] += guards.level + start @ self.start
        terms[:, 0] += abs(guards.level) + abs(start) @ abs(self.start)
        return Lookout(self.pattern.watch, self.trajectory, polynomials, terms)

    def margins(self, laws: Sequence[int], hit: Hit | None = None) -> list[Margin]:
        """Margins at the start of these laws: of those that hold, those that slide at zero slip, and others.

        A reserve that has just been ``hit`` is not above zero, whatever rounding says.
        """
        key = (tuple(laws), hit)
        if key not in self._margins:
            self._margins[key] = self._found_margins(laws, hit)
        return self._margins[key]

    def _found_margins(self, laws: Sequence[int], hit: Hit | None) -> list[Margin]:
        plant, pattern = self.plant, self.pattern
        forcing = _derivatives_at_start(self._forcing)
        inputs, given, capacities = np.split(forcing, self._ends)
        x, size = self._state_derivatives(inputs, given)
        free = [i for i in laws if plant.holds[i] is None]
        margins = self._free_margins(free, forcing, x, size) if free else []
        for i in laws:
            law, mode, holds = plant.laws[i], pattern.mode[i], plant.holds[i]
            turns = False
            if law.load is not None and not mode.held:
                margins += self._load_margins(i, x, size, inputs, given, hit)
                turns = abs(plant.G[:, i] @ x[:, 0]) > ROUNDING * (abs(plant.G[:, i]) @ size[:, 0])
            if holds is None or not mode.guards or i in pattern.held_too or turns:
                continue
            together = tuple(sorted({*pattern.held, i}))
            on_x, on_u, on_tau, _ = (row[together.index(i)] for row in plant.required(together, pattern.key))
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

    def _free_margins(self, laws: Sequence[int], forcing: np.ndarray, x: np.ndarray, size: np.ndarray) -> list[Margin]:
        """Guards of laws that never hold their slip, in the order of the laws."""
        plant, pattern, guards = self.plant, self.pattern, self.pattern.guards
        if plant.elastic:
            rows, twists = plant.G[:, plant.elastic].T, self.start[plant.N :, None]
            x = np.concatenate([x, np.hstack([twists, rows @ x[:, :-1]])])
            size = np.concatenate([size, np.hstack([abs(twists), abs(rows) @ size[:, :-1]])])
        value = guards.on_x @ x + guards.on_forcing @ forcing
        terms = pattern.guard_sizes[0] @ size + pattern.guard_sizes[1] @ abs(forcing)
        value[:, 0] += guards.level
        terms[:, 0] += abs(guards.level)
        tolerance = INDIFFERENT * terms[:, :-1] + TICK * terms[:, 1:]
        found = zip(guards.laws, guards.then, value[:, :-1], tolerance, strict=True)
        return [Margin(*each) for each in found if each[0] in laws]

    @cached_property
    def _forcing(self) -> np.ndarray:
        """Inputs, given torques and capacities below each other."""
        return np.concatenate([self.segment.inputs, self.given, self.segment.capacities])

    @property
    def _ends(self) -> tuple[int, int]:
        return len(self.segment.inputs), len(self.segment.inputs) + len(self.given)

    def _state_derivatives(self, inputs: np.ndarray, given: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x and its derivatives at the start, one a column, and of each the magnitude that `INDIFFERENT` is a part of.

        That is its own, and what rounding leaves of the motion of all others and of the forces that cancel in it.
        """
        plant, (A, basis, _, push, _) = self.plant, self.pattern.dynamics
        B, W = self.pattern.B, self.pattern.W
        forces = B @ inputs - W @ given
        magnitude, terms = abs(A), abs(B) @ abs(inputs) + abs(W) @ abs(given)
        x = np.empty((plant.N, inputs.shape[1]))
        size = np.empty_like(x)
        x[:, 0] = self.start[: plant.N]
        size[:, 0] = abs(x[:, 0]) + ROUNDING / INDIFFERENT * np.linalg.norm(x[:, 0])
        for k in range(x.shape[1] - 1):
            x[:, k + 1] = basis @ (push @ (A @ x[:, k] + forces[:, k]))
            size[:, k + 1] = abs(x[:, k + 1]) + ROUNDING / INDIFFERENT * (magnitude @ size[:, k] + terms[:, k])
        return x, size

    def violated(self) -> bool:
        """Whether this mode contradicts its own motion at the start."""
        look = self._look(np.zeros(1), 0.0)
        return bool((look.value < -ROUNDING * look.size).any())

    def first_event(self, duration: float, resolved: Sequence[int] = (), hit: Hit | None = None) -> Hit | None:
        """The first guard that reaches zero, None if all stay positive.

        ``resolved`` are laws whose modes were chosen for this very instant, because one was ``hit`` or for another reason:
        what is zero of theirs at the start departs from there.
        """
        if not self.pattern.guards.laws:
            return None
        times, creep, growth = np.zeros(1), FIRST_STEP, self.pattern.dynamics.flow.growth
        departing: np.ndarray | None = None
        blur, hidden = np.zeros((0, 4)), np.zeros((0, 0), dtype=bool)
        while True:
            # bounds of what grows are taken over one time constant at a time
            until = min(duration, float(times[-1]) + 1.0 / growth) if growth else duration
            look = g, slope, bend, size = self._look(times, until)
            if self.plant.loaded:  # a load that is next to nothing may be so on either side
                g = g + INDIFFERENT * self.pattern.guards.on_load[:, None] * size
            if resolved and not times[-1]:
                departing, blur = self._departures(look, resolved, hit)
            rounding = ROUNDING * size
            waiting = g <= rounding
            # Behind a jump of the inputs it may be far below zero and yet rising.
            fallen = g < -2.0 * INDIFFERENT * size
            fallen |= waiting & (slope < 0.0)
            step = _certified_step(np.maximum(g, 0.0), slope, bend)
            if departing is not None:
                fog = value_at(blur, times) + rounding
                # hidden until it has once been seen
                hidden = departing[:, None] & ~np.logical_or.accumulate(g > fog, axis=1)
                fallen = np.where(hidden, g < -fog, fallen)
                step[hidden] *= 0.5  # not at once to where it may be back at zero: half way it shows
                waiting |= hidden
            # What has just left zero is below rounding: creep on, twice as far each time, until it shows.
            if waits := np.count_nonzero(waiting):
                step[waiting] = np.maximum(step[waiting], np.maximum(creep, 10.0 * SAME_TIME * times[-1]))
            if until < duration:
                step = np.minimum(step, until - times)
            least = np.minimum.reduce(step)
            last = _last_safe(times, least, fallen)
            now, onward, ends = float(times[last]), float(least[last]), np.count_nonzero(fallen[:, last])
            if ends or (onward < SAME_TIME * max(1.0, now) and now + onward < duration):
                j = int(fallen[:, last].argmax() if ends else step[:, last].argmin())
                return self._hit(j, now, rounding[j, last], slope[j, last])
            if now + onward >= duration:
                return None
            if departing is not None:
                departing = hidden[:, last] if np.count_nonzero(hidden[:, last]) else None
            if waits and waiting[:, last].any():
                creep = 2.0 * onward
            times = now + onward * STEPS
            if times[-1] >= duration:
                times = times[times < duration]

    def _hit(self, guard: int, time: float, rounding: float, slope: float) -> Hit:
        guards = self.pattern.guards
        fast = abs(slope) * LONGEST_DOUBT > 2.0 * rounding
        doubt = 2.0 * rounding / abs(slope) if fast else LONGEST_DOUBT
        return Hit(guards.laws[guard], guards.then[guard], time, doubt)

    def _departures(self, look: Look, resolved: Sequence[int], hit: Hit | None) -> tuple[np.ndarray, np.ndarray]:
        """Which guards are zero at the start, and polynomials within which they are not told from zero later on."""
        guards = self.pattern.guards
        departing = np.zeros(len(guards.laws), dtype=bool)
        blur = np.zeros((len(guards.laws), 4))
        g, size = look.value, look.size
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
                departing[j] = margin.value[0] <= max(margin.tolerance[0], ROUNDING * size[j, 0])
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
    """Index of the last of these times that certified steps lead to, no guard having ``fallen``."""
    if len(times) == 1:
        return 0
    ends = np.empty(len(times), dtype=bool)
    np.less(step[:-1], times[1:] - times[:-1], out=ends[:-1])
    ends[-1] = True
    if np.count_nonzero(fallen):
        ends |= np.logical_or.reduce(fallen)
    return int(ends.argmax())


def _certified_step(g: np.ndarray, g1: np.ndarray, M: np.ndarray) -> np.ndarray:
    """Largest h for which ``g + g1 h - M h^2 / 2 >= 0`` on all of [0, h]."""
    # Each form where its terms do not cancel. Without a denominator the functional neither falls nor bends.
    falls, terms = g1 < 0.0, np.sqrt(g1 * g1 + 2.0 * M * g) + np.abs(g1)
    below = np.where(falls, terms, M)
    h = np.where(falls, 2.0 * g, terms) / np.maximum(below, 1e-250)
    h[below <= 1e-250] = np.inf
    return h
