"""Torque of an engine over time while its speed changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..base.checks import MOST
from ..base.errors import SignalError
from ..hybrid.signals import PiecewiseLinear

# Orders, complex amplitudes (orders, speeds) and mean torque (speeds,) at speeds [rad/s].
Orders = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]
# Points of each stretch of a changing speed at which the spacing of the samples is computed.
GRID = 200


@dataclass(frozen=True, eq=False)
class RunUp:
    """Torque while the speed changes as a signal says, made by ``Engine.signal``.

    At each instant it has the orders of the speed there, at the crank angle that the speed has led to. Over a time span it
    becomes straight lines, that miss it by no more than ``error`` of the sum of its largest orders.
    """

    orders: Orders
    speed: PiecewiseLinear
    angle: float
    error: float

    def __call__(self, t: float | np.ndarray) -> np.ndarray:
        """Torque [N m] at t [s]."""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        orders, amplitudes, mean = self.orders(self._running(times))
        torque = mean + (amplitudes * np.exp(1j * np.multiply.outer(orders, self._turned(times)))).real.sum(axis=0)
        return torque.reshape(np.shape(t))

    def _running(self, t: np.ndarray) -> np.ndarray:
        speeds = self.speed(t)
        if not (speeds > 0.0).all():
            i = int((speeds > 0.0).argmin())
            raise SignalError(f"the speed of the engine is {speeds[i]:g} rad/s at t = {t[i]:g} s, permitted: > 0")
        return speeds

    def _turned(self, t: np.ndarray) -> np.ndarray:
        """Crank angle [rad]: integral of the speed from t = 0 on."""
        knots = np.unique(np.concatenate([[0.0], self.speed.times, [t.min(), t.max()]]))
        middle = self.speed(0.5 * (knots[1:] + knots[:-1]))
        turned = np.concatenate([[0.0], np.cumsum(middle * np.diff(knots))])
        turned -= turned[int(np.searchsorted(knots, 0.0))]
        k = np.clip(np.searchsorted(knots, t, side="right") - 1, 0, max(len(knots) - 2, 0))
        # a line between its knots: the mean of its ends
        return self.angle + turned[k] + (t - knots[k]) * self.speed(0.5 * (knots[k] + t))

    def over(self, start: float, stop: float) -> PiecewiseLinear:
        """Straight lines from start to stop [s]."""
        knots = np.unique(np.concatenate([[start, stop], [t for t in self.speed.times if start < t < stop]]))
        grid = np.concatenate([np.linspace(a, b, GRID) for a, b in pairwise(knots)])
        speeds = self._running(grid)
        orders, amplitudes, _ = self.orders(speeds)
        sizes = np.abs(amplitudes)
        # a line between samples h apart misses a sine of omega by (omega h)^2 / 8
        bend = ((orders[:, None] * speeds) ** 2 * sizes).sum(axis=0)
        density = np.sqrt(bend / (8.0 * self.error * max(float(sizes.sum(axis=0).max()), np.finfo(float).tiny)))
        passed = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(grid))])
        count = int(np.ceil(passed[-1])) + 2
        if count > MOST:
            raise SignalError(f"the engine's torque needs {count} samples, permitted: {MOST}; give a larger error")
        times = np.union1d(np.interp(np.linspace(0.0, passed[-1], count), passed, grid), knots)
        return PiecewiseLinear(tuple(times.tolist()), tuple(self(times).tolist()))
