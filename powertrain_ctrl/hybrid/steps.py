"""One sample at a time: an exact step by one matrix, and the outputs at an instant, while no law changes its mode.

While inputs are straight lines ``x'''`` solves ``x' = A x``, so that in energy coordinates ``|x''|`` grows by no more than
``exp(mu h)``, with mu the largest eigenvalue of ``(A + A^T) / 2``: 0 for a driveline whose friction does not fall with
slip. A guard stays positive within a step if it is above ``h^2 / 8 |row| |x''| exp(mu h)`` at both its ends.
"""

from math import sqrt

import numpy as np
import scipy.linalg

from .matrices import ROUNDING
from .model import output_map
from .plant import Modes, Pattern, Plant
from .run import KNOWN_SLIP
from .trace import SAFE

_ONE = np.ones(1)


class Instant:
    """Outputs and guards in modes at an instant, of the physical state, inputs and capacities."""

    def __init__(self, plant: Plant, modes: Modes):
        pattern, n = plant.pattern(modes), plant.size
        k = plant.B.shape[1]
        given = given_torques(pattern)
        on_x, on_u, on_tau = pattern.on_torque
        torque = np.hstack([on_x, np.zeros((len(modes), n - plant.N)), on_tau @ given])
        torque[:, n : n + k] += on_u
        outputs = output_map(plant)
        linear = outputs[:, plant.N : plant.N + len(modes)] @ torque
        linear[:, : plant.N] += outputs[:, : plant.N]
        linear[:, n : n + k] += outputs[:, plant.N + len(modes) :]
        guards = np.hstack([pattern.guards.on_x, guard_values(pattern)])
        self._ends = np.cumsum([len(linear), len(guards)]).tolist()
        self._map = np.vstack([linear, guards, held_slips(pattern, guards.shape[1])])
        self._map[:, :n] = self._map[:, :n] @ energy_coordinates(plant)
        self.outputs = self._map[: len(linear)]
        self._rounding = ROUNDING * np.linalg.norm(self._map[slice(*self._ends)], axis=1)

    def __call__(self, x: np.ndarray, values: np.ndarray) -> np.ndarray | None:
        """Outputs of the driveline, None if a law may be about to change its mode."""
        z = np.concatenate([x, values, _ONE])
        y = self._map.dot(z)
        count, held = self._ends
        if np.count_nonzero(y[count:held] <= self._rounding * sqrt(z.dot(z))):
            return None
        if held < len(y) and np.count_nonzero(abs(y[held:]) >= KNOWN_SLIP):
            return None
        return y[:count]


class Step:
    """Exact steps of h [s] of the physical state in modes, inputs and capacities straight lines; ``outputs`` at the end."""

    def __init__(self, plant: Plant, modes: Modes, h: float, outputs: np.ndarray):
        pattern = plant.pattern(modes)
        _, basis, inverse, _, flow = pattern.dynamics
        force = pattern.force_tau @ given_torques(pattern)
        force[:, : plant.B.shape[1]] += pattern.force_u
        n, m, q = plant.size, len(inverse), force.shape[1]
        # everything is a row on z = (x, values at the start, values at the end, 1)
        before, behind = np.zeros((2, q, n + 2 * q - 1))
        before[:, n : n + q - 1] = behind[:, n + q - 1 : -1] = np.eye(q, q - 1)
        before[-1, -1] = behind[-1, -1] = 1.0
        # coordinates w of the flow, w' = A w + force v, and twists of laws, q' = slip w
        slip = plant.G[:, plant.elastic].T @ basis
        coordinates = np.zeros((m + len(slip), before.shape[1]))
        coordinates[:m, : plant.N], coordinates[m:, plant.N : n] = inverse, np.eye(len(slip))
        rate = np.zeros((len(coordinates),) * 2)
        rate[:m, :m], rate[m:, :m] = flow.A, slip
        driven = np.vstack([force, np.zeros((len(slip), q))])
        on_start, on_v, on_slope = _exact_step(rate, driven, h)
        after = on_start @ coordinates + on_v @ before + on_slope @ (behind - before)
        arrived = np.vstack([basis @ after[:m], after[m:]])
        for y in plant.stretch.values():
            arrived[y, y] += not basis[y].any()
        first = flow.A @ coordinates[:m] + force @ before
        second = flow.A @ first + force @ (behind - before) / h

        on_x, on_values = pattern.guards.on_x, guard_values(pattern)
        start = on_values @ before
        start[:, :n] += on_x
        end = on_values @ behind + on_x @ arrived
        # a guard bends by its row on w'', and by w' where it depends on a twist
        on_twist = np.linalg.norm(on_x[:, plant.N :] @ slip, axis=1)
        growth = np.exp(h * max(float(np.linalg.eigvalsh(0.5 * (flow.A + flow.A.T)).max(initial=0.0)), 0.0))
        bend = SAFE * growth * h * h / 8.0
        self._on_second = bend * (np.linalg.norm(on_x[:, : plant.N] @ basis, axis=1) + h * on_twist)
        self._on_first = bend * on_twist
        self._ends = np.cumsum([n, len(start), len(end), len(pattern.held), m]).tolist()
        last = first if on_twist.any() else first[:0]
        whole = np.vstack([arrived, start, end, held_slips(pattern, before.shape[1]), second, last])
        enter, leave = energy_coordinates(plant), physical_states(plant)
        terms = abs(leave) @ abs(whole[:n, :n]) @ abs(enter)
        whole[:, :n] = whole[:, :n] @ enter
        whole[:n] = leave @ whole[:n]
        # as a change of the state, so that what does not move stays as it is to the last bit
        whole[:n, :n] -= np.eye(n)
        whole[:n, :n][abs(whole[:n, :n]) <= ROUNDING * terms] = 0.0
        shown = outputs[:, :n] @ whole[:n] + outputs[:, n:] @ behind
        shown[:, :n] += outputs[:, :n]
        self._map, self._count = np.vstack([shown, whole]), len(shown)
        sizes = np.linalg.norm(whole[n : n + 2 * len(start)], axis=1).reshape(2, -1)
        self._rounding = 4.0 * ROUNDING * sizes.max(axis=0)

    def __call__(self, x: np.ndarray, before: np.ndarray, behind: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """x and outputs one step later, None if a law may change its mode; values are inputs and capacities at the ends."""
        z = np.concatenate([x, before, behind, _ONE])
        y = self._map.dot(z)
        moved = y[self._count :]
        n, start, end, held, second = self._ends
        if held > end and np.count_nonzero(abs(moved[end:held]) >= KNOWN_SLIP):
            return None
        if start > n:
            bend, turn = moved[held:second], moved[second:]
            least = self._on_second * sqrt(bend.dot(bend)) + self._rounding * sqrt(z.dot(z))
            if turn.size:
                least = least + self._on_first * sqrt(turn.dot(turn))
            if np.count_nonzero(moved[n:end].reshape(2, -1) <= least):
                return None
        return x + moved[:n], y[: self._count]


def given_torques(pattern: Pattern) -> np.ndarray:
    """Torques of the laws that depend on nothing but mode and capacity, a matrix on inputs, capacities and 1."""
    k, clutches = pattern.plant.B.shape[1], len(pattern.plant.clutches)
    given = np.zeros((len(pattern.mode), k + clutches + 1))
    given[range(clutches), range(k, k + clutches)] = pattern.capacity[:clutches]
    given[:, -1] = pattern.torque
    return given


def guard_values(pattern: Pattern) -> np.ndarray:
    """What inputs, capacities and 1 do to the guards."""
    guards, k = pattern.guards, pattern.plant.B.shape[1]
    on_values = guards.on_tau @ given_torques(pattern)
    on_values[:, :k] += guards.on_u
    on_values[:, k:-1] += guards.on_c
    on_values[:, -1] += guards.level
    return on_values


def held_slips(pattern: Pattern, columns: int) -> np.ndarray:
    """Rows of the slips that the modes hold at zero, on x and whatever follows it."""
    rows = np.zeros((len(pattern.held), columns))
    rows[:, : pattern.plant.N] = pattern.plant.G[:, pattern.held].T
    return rows


def energy_coordinates(plant: Plant) -> np.ndarray:
    """Matrix of x on the physical states: twists, coordinate speeds, twists and stretches of laws."""
    ends = np.cumsum([plant.r, plant.n, len(plant.elastic)])
    return np.stack([plant.state(*np.split(unit, ends)) for unit in np.eye(plant.size)], axis=1)


def physical_states(plant: Plant) -> np.ndarray:
    """Matrix of the physical states on x."""
    x, m = np.eye(plant.size), len(plant.elastic)
    return np.vstack([plant.twist(x), plant.speed(x), x[plant.N :], x[plant.N - m : plant.N]])


def _exact_step(A: np.ndarray, B: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Matrices of ``w' = A w + B v`` over h on w, on v at the start and on its change."""
    n, q = B.shape
    augmented = np.zeros((n + 2 * q,) * 2)
    augmented[:n, :n], augmented[:n, n : n + q] = h * A, h * B
    augmented[n : n + q, n + q :] = np.eye(q)
    exact = scipy.linalg.expm(augmented)[:n]
    return exact[:, :n], exact[:, n : n + q], exact[:, n + q :]
