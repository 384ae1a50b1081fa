"""Exact motion of a driveline with dry-friction clutches while no clutch changes its mode, and when one will.

In energy coordinates ``x = (sqrt(k) twist, sqrt(J) speed)`` the driveline reads ``x' = A x + B u - G tau`` with
``A + A^T <= 0`` and slip ``G^T x``. A clutch is sliding (torque ``sign * capacity``), stuck (torque such that the slip
stays zero) or free (no capacity). Stuck clutches confine x to the null space of their rows of ``G^T``, in which the
flow is computed exactly (`flow`).

Events are zeros of *functionals* ``g = c x + p(t)``: the slip of a sliding clutch, the torque reserve of a stuck
one. From a point with ``g > 0`` the search steps as far as ``g + g' h - M h^2 / 2 > 0`` guarantees, where M bounds
``|g''|`` rigorously. It approaches the first zero from its safe side with quadratic convergence and cannot step over a
pair of crossings.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg

from ..linear.assembly import TorsionalModel
from .flow import Flow, polynomial_derivatives, value_at
from .signals import shift

FORWARD, STUCK, BACKWARD, FREE = 1, 0, -1, 2
# Functionals smaller than this part of the terms they sum up are zero: where the approach to an event ends.
ROUNDING = 64.0 * np.finfo(float).eps
# Margins smaller than this part of the torques they sum up are zero: what decides nothing. Far above the rounding
# of an event's time and state, far below what a bearing feels.
INDIFFERENT = 1e-10
# Margins that contradict their mode by less than so many tolerances may be all that rounding has left.
LENIENT = 8.0
# Times closer than this part of a piece [s], or of a second, are one.
TICK = 1e-13
# Rounding of what grazes zero leaves no event in doubt longer than this [s].
LONGEST_DOUBT = 1e-11
# Slips of clutches that depend on each other do so to this part.
REDUNDANT = 1e-10
# The event search looks at so many points at once; leaving zero it begins with this step [s].
LOOK_AHEAD = 16
FIRST_STEP = 1e-12
# A certified step below this part of the time, or of a second, has arrived.
SAME_TIME = 1e-15


class Segment(NamedTuple):
    """Inputs and capacities as polynomials (signals, degree + 1) in local time."""

    inputs: np.ndarray
    capacities: np.ndarray

    @property
    def free(self) -> np.ndarray:
        """Which clutches have no capacity at all."""
        return np.logical_not(self.capacities.any(axis=1))

    def values(self, t: np.ndarray) -> np.ndarray:
        """(inputs and capacities, samples) ndarray at local times."""
        return value_at(np.vstack([self.inputs, self.capacities]), t)

    def later(self, by: float) -> "Segment":
        return Segment(shift(self.inputs, by), shift(self.capacities, by)) if by else self


class Holding(NamedTuple):
    """What clutches carry that hold their slips at zero together, ``tau = on_x x + on_u u + on_tau tau_sliding``.

    ``weight`` is the slip acceleration that a unit of torque too little gives each of them while the others hold.
    """

    on_x: np.ndarray
    on_u: np.ndarray
    on_tau: np.ndarray
    weight: np.ndarray


class ModeSet(NamedTuple):
    """Flow in the null space of the stuck clutches, and what they carry."""

    basis: np.ndarray
    flow: Flow
    holding: Holding


class Plant:
    """A driveline in energy coordinates; those of its clutches that are not locked act by friction.

    With ``lag`` [s] the input with index ``lagging`` is a command whose torque follows as the last coordinate of x.
    """

    def __init__(self, model: TorsionalModel, lagging: int | None = None, lag: float = 0.0):
        self.model = model
        self.active = np.flatnonzero(~model.locked)
        self.clutches = [model.clutches[i] for i in self.active]
        self.static_ratio = np.array([row.static_ratio for row in self.clutches])
        rows, n = model.elastic_rows, len(model.coordinates)
        self.r, self.n = len(rows), n
        spread = np.sqrt(model.stiffness)[:, None] * model.twist_factor
        self.spring_factor = np.linalg.qr(spread, mode="r") if self.r else np.zeros((0, 0))
        L = model.mass_factor
        self.H = self.spring_factor @ scipy.linalg.solve_triangular(L, model.F[rows].T, lower=True).T
        damper = np.sqrt(model.damping)[:, None] * scipy.linalg.solve_triangular(L, model.F.T, lower=True).T
        self.A = np.block([[np.zeros((self.r, self.r)), self.H], [-self.H.T, -damper.T @ damper]])
        force = scipy.linalg.solve_triangular(L, model.T.T @ model.B, lower=True)
        slip = scipy.linalg.solve_triangular(L, (model.S[self.active] @ model.T).T, lower=True)
        self.B = np.vstack([np.zeros((self.r, force.shape[1])), force])
        self.G = np.vstack([np.zeros((self.r, slip.shape[1])), slip])
        if lagging is not None and lag:
            self._add_lag(lagging, lag)
        self.mode_set = lru_cache(maxsize=None)(self._mode_set)
        self.holding = lru_cache(maxsize=None)(self._holding)

    def _add_lag(self, index: int, lag: float) -> None:
        n, driven = len(self.A), self.B[:, [index]]
        self.A = np.block([[self.A, driven], [np.zeros((1, n)), np.array([[-1.0 / lag]])]])
        self.B = np.vstack([self.B, np.zeros(self.B.shape[1])])
        self.B[:, index] = 0.0
        self.B[-1, index] = 1.0 / lag
        self.G = np.vstack([self.G, np.zeros(self.G.shape[1])])

    def state(self, twist: np.ndarray, speed: np.ndarray, torque: float = 0.0) -> np.ndarray:
        """Coordinates from independent twists [rad], coordinate speeds and, with a lag, its torque."""
        mechanical = np.concatenate([self.spring_factor @ twist, self.model.mass_factor.T @ speed])
        return mechanical if len(mechanical) == len(self.A) else np.append(mechanical, torque)

    def twist(self, x: np.ndarray) -> np.ndarray:
        return scipy.linalg.solve_triangular(self.spring_factor, x[: self.r]) if self.r else x[:0]

    def speed(self, x: np.ndarray) -> np.ndarray:
        speeds = x[self.r : self.r + self.n]
        return scipy.linalg.solve_triangular(self.model.mass_factor, speeds, lower=True, trans="T")

    def slip(self, x: np.ndarray) -> np.ndarray:
        return self.G.T @ x

    def _mode_set(self, stuck: tuple[int, ...]) -> ModeSet:
        """Matrices while the clutches with these numbers are stuck."""
        basis = _null_basis(self.G[:, list(stuck)])
        A = basis.T @ self.A @ basis
        # rounding must not turn a spring that stuck clutches keep from twisting
        A[abs(A) <= ROUNDING * (abs(basis.T) @ abs(self.A) @ abs(basis))] = 0.0
        return ModeSet(basis, Flow(A), self.holding(stuck))

    def _holding(self, clutches: tuple[int, ...]) -> Holding:
        """What these clutches carry while all of them are stuck."""
        # redundant clutches in parallel share their torque with least norm
        multiplier = np.linalg.pinv(self.G[:, list(clutches)], rcond=REDUNDANT)
        weight = 1.0 / np.sum(multiplier**2, axis=1)
        return Holding(multiplier @ self.A, multiplier @ self.B, -multiplier @ self.G, weight)

    def held(self, x: np.ndarray, clutches: Sequence[int]) -> np.ndarray:
        """x after these clutches have taken up their slip; keeps the momentum on either side."""
        held = self.G[:, list(clutches)]
        return x - held @ (np.linalg.pinv(held, rcond=REDUNDANT) @ x)


class Functionals(NamedTuple):
    """Rows on the flow coordinates and polynomials that add up to what must stay positive, whose they are, and which
    mode follows where they do not.

    ``terms`` are polynomials like these from the magnitudes of what cancels in them: how far rounding goes.
    """

    rows: np.ndarray
    polynomials: np.ndarray
    terms: np.ndarray
    clutches: list[int]
    then: list[int]


class Margin(NamedTuple):
    """Torque that a clutch at zero slip has left before its mode must end, and two time derivatives [N m, N m/s, ...].

    Of a stuck clutch what its torque lacks to its limit on one side, of a sliding one what its capacity lacks to
    holding it: one rule for both, with the same ``tolerance`` of each derivative. ``then`` is the mode that follows.
    """

    clutch: int
    then: int
    value: np.ndarray
    tolerance: np.ndarray

    @property
    def excess(self) -> float | None:
        """How many tolerances the first of the values that is not zero lies below zero; None if all are zero."""
        leading = np.flatnonzero(np.abs(self.value) > self.tolerance)
        return None if not leading.size else -float(self.value[leading[0]] / self.tolerance[leading[0]])


class Hit(NamedTuple):
    """A clutch that can no longer do what it does: its number, the mode that follows if it must, and the local time.

    Rounding leaves the time in ``doubt`` by so much.
    """

    clutch: int
    then: int
    time: float
    doubt: float


class Motion:
    """Exact motion in one mode from a state, in local time."""

    def __init__(self, plant: Plant, modes: tuple[int, ...], x: np.ndarray, segment: Segment):
        self.plant, self.modes, self.segment, self.start = plant, modes, segment, x
        self.stuck = [i for i, mode in enumerate(modes) if mode == STUCK]
        self.sign = np.array([mode if mode in (FORWARD, BACKWARD) else 0 for mode in modes], dtype=float)
        self.sliding_torque = self.sign[:, None] * segment.capacities
        self.set = plant.mode_set(tuple(self.stuck))
        b = self.set.basis.T @ (plant.B @ segment.inputs - plant.G @ self.sliding_torque)
        self.trajectory = self.set.flow.trajectory(self.set.basis.T @ x, b)
        self._torque_polynomial = self.set.holding.on_u @ segment.inputs + self.set.holding.on_tau @ self.sliding_torque

    def state(self, t: np.ndarray) -> np.ndarray:
        """(r + n, samples) ndarray."""
        x = self.trajectory.state(t)
        return self.set.basis @ x if self.stuck else x

    def clutch_torque(self, t: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(clutches, samples) ndarray from the states at these times."""
        torque = value_at(self.sliding_torque, t)
        torque[self.stuck] = self.set.holding.on_x @ x + value_at(self._torque_polynomial, t)
        return torque

    def heat(self, duration: float) -> np.ndarray:
        """(clutches,) ndarray: exact integral of torque times slip [J], by parts."""
        work = np.zeros(len(self.modes))
        sliding = np.flatnonzero(self.sign)
        if not sliding.size:
            return work
        end = np.array([duration])
        rows = self.plant.G.T[sliding] @ self.set.basis
        degree = self.sliding_torque.shape[1] - 1
        for k, derivative in enumerate(polynomial_derivatives(self.sliding_torque[sliding], degree)):
            torque = value_at(derivative, end)
            if torque.any():
                slip = rows @ self.trajectory.state(end, integrals=k + 1)
                work[sliding] += (-1.0) ** k * (torque * slip)[:, 0]
        return work

    @cached_property
    def held_too(self) -> list[int]:
        """Sliding clutches whose slip the stuck ones keep at zero: they share a load with those at their capacity."""
        sliding = np.flatnonzero(self.sign).tolist()
        rows = self.plant.G.T
        return [i for i in sliding if np.linalg.norm(rows[i] @ self.set.basis) <= REDUNDANT * np.linalg.norm(rows[i])]

    @cached_property
    def functionals(self) -> Functionals:
        """What must stay positive in this mode: slips of sliding clutches, reserves of stuck ones."""
        on_x, on_u, on_tau, _ = self.set.holding
        rows, polynomials, terms, clutches, then = [], [], [], [], []
        zero = np.zeros(self.segment.capacities.shape[1])
        for i in np.flatnonzero(self.sign).tolist():
            if i not in self.held_too:
                rows.append(self.sign[i] * self.plant.G[:, i])
                polynomials.append(zero)
                terms.append(zero)
                clutches.append(i)
                then.append(STUCK)
        forces = abs(on_u) @ abs(self.segment.inputs) + abs(on_tau) @ abs(self.sliding_torque)
        for position, i in enumerate(self.stuck):
            limit = self.plant.static_ratio[i] * self.segment.capacities[i]
            for side in (FORWARD, BACKWARD):
                rows.append(-side * on_x[position])
                polynomials.append(limit - side * self._torque_polynomial[position])
                terms.append(abs(limit) + forces[position])
                clutches.append(i)
                then.append(side)
        on_flow = np.array(rows).reshape(len(rows), len(self.start)) @ self.set.basis
        shape = (len(rows), zero.size)
        return Functionals(
            self.trajectory.rows(on_flow),
            np.array(polynomials).reshape(shape),
            np.array(terms).reshape(shape),
            clutches,
            then,
        )

    def margins(self, clutches: Iterable[int], hit: Hit | None = None) -> list[Margin]:
        """Margins at the start of those of these clutches that are at zero slip and stuck or sliding.

        A reserve that has just been ``hit`` is not above zero, whatever rounding says.
        """
        breaking = hit[:2] if hit is not None and hit.then != STUCK else None
        inputs, sliding, capacities = (_derivatives_at_start(p) for p in self._forcing)
        x, size = self._state_derivatives(inputs, sliding)
        margins = []
        for i in clutches:
            if self.modes[i] == FREE or i in self.held_too:
                continue
            together = tuple(sorted({*self.stuck, i}))
            on_x, on_u, on_tau, _ = (row[together.index(i)] for row in self.plant.holding(together))
            others = sliding.copy()
            others[i] = 0.0
            torque = on_x @ x + on_u @ inputs + on_tau @ others
            terms = abs(on_x) @ size + abs(on_u) @ abs(inputs) + abs(on_tau) @ abs(others) + abs(capacities[i])
            tolerance = INDIFFERENT * terms[:-1] + TICK * terms[1:]  # what a tick takes to zero is zero
            if self.modes[i] == STUCK:
                limit = self.plant.static_ratio[i] * capacities[i]
                values = {side: limit - side * torque for side in (FORWARD, BACKWARD)}
            else:
                values = {STUCK: self.modes[i] * torque - capacities[i]}
            for then, value in values.items():
                if breaking == (i, then):
                    value[0] = min(value[0], 0.0)
                elif breaking == (i, self.modes[i]):
                    value[0] = max(value[0], 0.0)
                margins.append(Margin(i, then, value[:-1], tolerance))
        return margins

    @property
    def _forcing(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.segment.inputs, self.sliding_torque, self.segment.capacities

    def _state_derivatives(self, inputs: np.ndarray, sliding: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """x and its derivatives at the start, one a column, and of each the magnitude that `INDIFFERENT` is a part of.

        That is its own, and what rounding leaves of the forces that cancel in it.
        """
        plant, basis = self.plant, self.set.basis
        forces = plant.B @ inputs - plant.G @ sliding
        terms = abs(plant.B) @ abs(inputs) + abs(plant.G) @ abs(sliding)
        x = np.empty((len(self.start), inputs.shape[1]))
        size = np.empty_like(x)
        x[:, 0], size[:, 0] = self.start, abs(self.start)
        for k in range(x.shape[1] - 1):
            x[:, k + 1] = basis @ (basis.T @ (plant.A @ x[:, k] + forces[:, k]))
            size[:, k + 1] = abs(x[:, k + 1]) + ROUNDING / INDIFFERENT * (abs(plant.A) @ size[:, k] + terms[:, k])
        return x, size

    def violated(self) -> bool:
        """Whether this mode contradicts its own motion at the start."""
        g, _, _, size = self._look(np.zeros(1), 0.0)
        return bool((g < -ROUNDING * size).any())

    def _look(self, t: np.ndarray, until: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """(functionals, samples) ndarrays: values, slopes, a bound on how they bend until then, sizes of their terms."""
        rows, polynomials, terms, _, _ = self.functionals
        slopes, bends = polynomial_derivatives(polynomials, 2)[1:]
        y, y1, y2 = self.trajectory.derivatives(t, 2)
        weights = self.trajectory.weights(rows)
        return (
            (rows @ y).real + value_at(polynomials, t),
            (rows @ y1).real + value_at(slopes, t),
            weights @ self.trajectory.largest_second(y2, t, until) + value_at(abs(bends), np.array([until])),
            weights @ self.trajectory.size(y) + value_at(terms, t),
        )

    def first_event(self, duration: float, resolved: Sequence[int] = (), hit: Hit | None = None) -> Hit | None:
        """The first functional that reaches zero, None if all stay positive.

        ``resolved`` are clutches at zero slip whose modes were chosen for this very instant, because one was ``hit`` or
        for another reason: what is zero of theirs at the start departs from there.
        """
        if not self.functionals.clutches:
            return None
        departing, blur = self._departures(resolved, hit)
        times, creep = np.zeros(1), FIRST_STEP
        while True:
            g, slope, bend, size = self._look(times, duration)
            fog = value_at(blur, times)
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

    def _hit(self, functional: int, time: float, rounding: float, slope: float) -> Hit:
        doubt = min(2.0 * rounding / max(abs(slope), np.finfo(float).tiny), LONGEST_DOUBT)
        return Hit(self.functionals.clutches[functional], self.functionals.then[functional], time, doubt)

    def _departures(self, resolved: Sequence[int], hit: Hit | None) -> tuple[np.ndarray, np.ndarray]:
        """Which functionals start at zero, and polynomials within which they are not told from zero later on."""
        watch, now = self.functionals, np.zeros(1)
        departing = np.zeros(len(watch.clutches), dtype=bool)
        blur = np.zeros((len(watch.clutches), 4))
        if not resolved:
            return departing, blur
        g, _, _, size = self._look(now, 0.0)
        known = {(margin.clutch, margin.then): margin for margin in self.margins(resolved, hit)}
        for j, key in enumerate(zip(watch.clutches, watch.then, strict=True)):
            if key not in known:
                continue
            margin, drift = known[key], 2.0 * LENIENT * known[key].tolerance
            if margin.then == STUCK:
                departing[j] = True
                together = tuple(sorted({*self.stuck, margin.clutch}))
                weight = self.plant.holding(together).weight[together.index(margin.clutch)]
                blur[j] = [2.0 * abs(g[j, 0]) + ROUNDING * size[j, 0], *(weight * drift / [1.0, 2.0, 6.0])]
            else:
                departing[j] = margin.value[0] <= margin.tolerance[0]
                blur[j, :3] = drift / [1.0, 1.0, 2.0]
                blur[j, 0] += 2.0 * abs(g[j, 0])
        return departing, blur


def _null_basis(held: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the states on which these columns do nothing.

    Householder reflections leave alone what no column touches, so that it does not mix with the rest.
    """
    if not held.shape[1]:
        return np.eye(len(held))
    Q, R, _ = scipy.linalg.qr(held, pivoting=True)
    rank = np.count_nonzero(abs(np.diag(R)) > REDUNDANT * abs(R[0, 0]))
    return Q[:, rank:]


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
