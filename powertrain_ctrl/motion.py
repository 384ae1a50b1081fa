"""Exact motion of a driveline with dry-friction clutches while no clutch changes its mode, and when one will.

In energy coordinates ``x = (sqrt(k) twist, sqrt(J) speed)`` the driveline reads ``x' = A x + B u - G tau`` with
``A + A^T <= 0`` and slip ``G^T x``. A clutch is sliding (torque ``sign * capacity``), stuck (torque such that the slip
stays zero) or free (no capacity). Stuck clutches confine x to the null space of their rows of ``G^T``, in which the
flow is computed exactly (`propagation`).

Events are zeros of *functionals* ``g = c x + p(t)``: the slip of a sliding clutch, the torque reserve of a stuck
one. From a point with ``g > 0`` the search steps as far as ``g + g' h - M h^2 / 2 > 0`` guarantees, where M bounds
``|g''|`` rigorously. It approaches the first zero from its safe side with quadratic convergence and cannot step over a
pair of crossings.
"""

from collections.abc import Sequence
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
import scipy.linalg

from .assembly import TorsionalModel
from .propagation import Flow, polynomial_derivatives, value_at
from .signals import shift

FORWARD, STUCK, BACKWARD, FREE = 1, 0, -1, 2
# Functionals smaller than this part of the terms they sum up are zero.
ROUNDING = 64.0 * np.finfo(float).eps
# Derivatives smaller than this part of their terms decide nothing.
INDIFFERENT = 1e-10
# Slips of clutches that depend on each other do so to this part.
REDUNDANT = 1e-10
# The event search looks at so many points at once.
LOOK_AHEAD = 16


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


class ModeSet(NamedTuple):
    """Flow in the null space of the stuck clutches and their torque, ``tau = on_x x + on_u u + on_tau tau_sliding``.

    ``sensitivity`` is the largest change of each torque with the forces on x.
    """

    basis: np.ndarray
    flow: Flow
    on_x: np.ndarray
    on_u: np.ndarray
    on_tau: np.ndarray
    sensitivity: np.ndarray


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
        held = self.G[:, list(stuck)]
        basis = np.eye(len(self.A))
        if stuck:
            null = scipy.linalg.null_space(held[self.r :].T, rcond=REDUNDANT)
            basis = scipy.linalg.block_diag(np.eye(self.r), null)
        # redundant clutches in parallel share their torque with least norm
        multiplier = np.linalg.pinv(held, rcond=REDUNDANT)
        return ModeSet(
            basis,
            Flow(basis.T @ self.A @ basis),
            multiplier @ self.A,
            multiplier @ self.B,
            -multiplier @ self.G,
            np.linalg.norm(multiplier, axis=1),
        )

    def held(self, x: np.ndarray, clutches: Sequence[int]) -> np.ndarray:
        """x after these clutches have taken up their slip; keeps the momentum on either side."""
        held = self.G[:, list(clutches)]
        return x - held @ (np.linalg.pinv(held, rcond=REDUNDANT) @ x)


class Functionals(NamedTuple):
    """Rows on the flow coordinates (and on x) and polynomials that add up to the functionals; whose they are.

    ``terms`` are polynomials like these from the magnitudes of what cancels in them: how far rounding goes.
    """

    rows: np.ndarray
    on_x: np.ndarray
    polynomials: np.ndarray
    terms: np.ndarray
    clutches: list[int]


class Motion:
    """Exact motion in one mode from a state, in local time."""

    def __init__(self, plant: Plant, modes: tuple[int, ...], x: np.ndarray, segment: Segment):
        self.plant, self.modes, self.segment = plant, modes, segment
        self.stuck = [i for i, mode in enumerate(modes) if mode == STUCK]
        sign = np.array([mode if mode in (FORWARD, BACKWARD) else 0 for mode in modes], dtype=float)
        self.sign = sign
        self.sliding_torque = sign[:, None] * segment.capacities
        self.set = plant.mode_set(tuple(self.stuck))
        b = self.set.basis.T @ (plant.B @ segment.inputs - plant.G @ self.sliding_torque)
        self.trajectory = self.set.flow.trajectory(self.set.basis.T @ x, b)
        self._torque_polynomial = self.set.on_u @ segment.inputs + self.set.on_tau @ self.sliding_torque
        forces = abs(plant.B) @ abs(segment.inputs) + abs(plant.G) @ abs(self.sliding_torque)
        self._torque_terms = self.set.sensitivity[:, None] * forces.sum(axis=0)

    def state(self, t: np.ndarray) -> np.ndarray:
        """(r + n, samples) ndarray."""
        x = self.trajectory.state(t)
        return self.set.basis @ x if self.stuck else x

    def clutch_torque(self, t: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(clutches, samples) ndarray from the states at these times."""
        torque = value_at(self.sliding_torque, t)
        torque[self.stuck] = self.set.on_x @ x + value_at(self._torque_polynomial, t)
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
    def driving_terms(self) -> np.ndarray:
        """Polynomials (functionals, degree + 1): magnitudes of what torques and inputs add to their derivatives."""
        plant, segment = self.plant, self.segment
        torques = abs(self.sliding_torque)
        torques[self.stuck] = self._torque_terms
        forces = abs(plant.B) @ abs(segment.inputs) + abs(plant.G) @ torques
        return abs(self.functionals.on_x) @ forces

    @cached_property
    def functionals(self) -> "Functionals":
        """What must stay positive in this mode."""
        rows, polynomials, terms, clutches = [], [], [], []
        zero = np.zeros(self.segment.capacities.shape[1])
        for i in np.flatnonzero(self.sign).tolist():
            if i not in self.held_too:
                rows.append(self.sign[i] * self.plant.G[:, i])
                polynomials.append(zero)
                terms.append(zero)
                clutches.append(i)
        for position, i in enumerate(self.stuck):
            limit = self.plant.static_ratio[i] * self.segment.capacities[i]
            for side in (1.0, -1.0):
                rows.append(-side * self.set.on_x[position])
                polynomials.append(limit - side * self._torque_polynomial[position])
                terms.append(abs(limit) + self._torque_terms[position])
                clutches.append(i)
        if not rows:
            none = np.zeros((0, zero.size))
            return Functionals(np.zeros((0, 0)), np.zeros((0, len(self.plant.A))), none, none, [])
        on_x = np.array(rows)
        return Functionals(
            self.trajectory.rows(on_x @ self.set.basis), on_x, np.array(polynomials), np.array(terms), clutches
        )

    def violated(self) -> bool:
        """Whether this mode contradicts its own motion at the start."""
        rows, _, polynomials, terms, _ = self.functionals
        if not len(rows):
            return False
        y = self.trajectory.derivatives(np.zeros(1), 0)[0]
        g = (rows @ y).real[:, 0] + polynomials[:, 0]
        size = (self.trajectory.weights(rows) @ self.trajectory.size(y))[:, 0] + terms[:, 0]
        return bool((g < -ROUNDING * size).any())

    def first_event(self, duration: float, resolved: bool) -> float | None:
        """Local time at which the first functional reaches zero, None if all stay positive.

        ``resolved`` says that the mode was chosen for this very instant, so zeros at the start are departures.
        """
        rows, _, polynomials, terms, _ = self.functionals
        if not len(rows):
            return None
        weights = self.trajectory.weights(rows)
        changes = polynomial_derivatives(polynomials, 2)
        bend = value_at(np.abs(changes[2]), np.array([duration]))
        times, creep = np.zeros(1), 1e-12
        while True:
            y, y1, y2 = self.trajectory.derivatives(times, 2)
            g = (rows @ y).real + value_at(polynomials, times)
            g1 = (rows @ y1).real + value_at(changes[1], times)
            size = weights @ self.trajectory.size(y) + value_at(terms, times)
            M = weights @ self.trajectory.largest_second(y2, times, duration) + bend
            h = _certified_step(np.maximum(g, 0.0), g1, M)
            touching = g <= ROUNDING * size
            # What has just left zero is below rounding: creep on, twice as far each time, until it shows.
            h[touching] = np.maximum(h[touching], creep)
            # Behind a jump of the inputs it may be far below zero and yet rising.
            fallen = ((touching & (g1 < 0.0)) | (g < -2.0 * INDIFFERENT * size)).any(axis=0)
            fallen[0] &= not (resolved and times[0] == 0.0)
            step = h.min(axis=0)
            # the last of these times that certified steps lead to
            broken = fallen.copy()
            broken[:-1] |= step[:-1] < np.diff(times)
            broken[-1] = True
            last = int(broken.argmax())
            now, onward = float(times[last]), float(step[last])
            if fallen[last]:
                return now
            if now + onward >= duration:
                return None
            if onward < 1e-15 * max(1.0, now):
                return now
            if touching[:, last].any():
                creep = 2.0 * onward
            times = now + onward * np.arange(1.0, LOOK_AHEAD + 1.0)
            times = times[times < duration]


def _certified_step(g: np.ndarray, g1: np.ndarray, M: np.ndarray) -> np.ndarray:
    """Largest h for which ``g + g1 h - M h^2 / 2 >= 0`` on all of [0, h]."""
    root = np.sqrt(g1 * g1 + 2.0 * M * g)
    # Each form where its terms do not cancel. Without a denominator the functional neither falls nor bends.
    below = np.where(g1 < 0.0, root - g1, M)
    h = np.where(g1 < 0.0, 2.0 * g, g1 + root) / np.maximum(below, 1e-250)
    h[below <= 1e-250] = np.inf
    return h
