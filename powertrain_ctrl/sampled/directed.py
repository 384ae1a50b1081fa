"""A linear car behind a torque that rises and falls differently, stepped exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise
from math import inf

import numpy as np

from ..linear.assembly import kept
from .arrivals import Acting, lag_towards
from .plant import SAME_INSTANT, SampledPlant, hold_matrices


class _Stretches:
    """Matrices from the beginning of a stretch of a sample to its points and to its end."""

    def __init__(self, plant: SampledPlant, points: int):
        # with a lag of any length the torque is the last state
        self.system = replace(plant, lag=max(plant.lags) or plant.dt).continuous
        self.points = plant.dt / points * np.arange(points)
        self.near = SAME_INSTANT * plant.dt
        self.over = cache(self._over)

    def _over(self, lag: float, begin: float, end: float) -> tuple[slice, np.ndarray]:
        """Which points are in it, and (points + 1, n, n + 1) ndarray on state and command; the last is its end."""
        A, B = self.system.A.copy(), self.system.B[:, :1].copy()
        A[-1, -1], B[-1] = -1.0 / lag, 1.0 / lag
        inside = np.flatnonzero((self.points > begin - self.near) & (self.points < end - self.near))
        times = [*np.maximum(self.points[inside] - begin, 0.0), end - begin]
        found = np.array([np.hstack(hold_matrices(A, B, time)) for time in times])
        first = int(inside[0]) if inside.size else 0
        return slice(first, first + len(inside)), found


_stretches = kept(64)(_Stretches)


class DirectedCore:
    """A car whose clutches stay as they are; ``forced`` is what a disturbance adds to all outputs (outputs, points)."""

    def __init__(self, plant: SampledPlant, count: int, points: int, forced: np.ndarray):
        self.stretches, self.lags, self.dt = _stretches(plant, points), plant.lags, plant.dt
        self.points, self.forced = points, forced
        system = self.stretches.system
        self.C = system.C
        self.states = np.zeros((count * points + 1, system.nstates))
        self.x = np.zeros(system.nstates)
        self.sample = 0

    @property
    def measured(self) -> np.ndarray:
        """(2,) ndarray: speed of engine and wheels at this sample [rad/s]."""
        return self.C[:2] @ self.x + self.forced[:2, self.sample * self.points]

    def step(self, acting: Sequence[Acting]) -> None:
        """Go on by a sample."""
        first = self.sample * self.points
        for (begin, command), (end, _) in pairwise([*acting, Acting(self.dt, 0.0)]):
            inside, steps = self.stretches.over(self._towards(command), begin, end)
            states = steps @ np.append(self.x, command)
            self.states[first + inside.start : first + inside.stop], self.x = states[:-1], states[-1]
        self.sample += 1

    def _towards(self, command: float) -> float:
        """Lag of the torque; without one it is there at once and stays, as with an infinite one."""
        lag = lag_towards(command, float(self.x[-1]), self.lags)
        if lag:
            return lag
        self.x[-1] = command
        return inf

    @np.errstate(over="ignore", invalid="ignore")
    def outputs(self, acting: np.ndarray) -> np.ndarray:
        """(outputs, points) ndarray; nothing is behind the last sample but the command that acts there."""
        self._towards(float(acting[self.sample, 0]))
        self.states[-1] = self.x
        return self.C @ self.states.T + self.forced
