"""Tip-ins of many feedforwards on several plants at once, added up from one step of the loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import control
import numpy as np

from ..families.loops import loops_among, trial_of
from ..hybrid.metrics import first_fall, first_time
from ..hybrid.signals import ramp, step
from ..sampled.plant import SampledPlant
from ..studies.times import Times
from .scales import Scales
from .structure import two_dof

# Points of a response in a period of the first mode, and at most so many in a sample.
POINTS, FINEST = 40.0, 5


class Risen(NamedTuple):
    """Of m plants and n feedforwards.

    ``swing`` (m, n), peak to peak over the final acceleration; ``t90`` (m, n) [s] from the start of the ramp;
    ``jerk`` (m, n), the largest, over the final acceleration [1/s]; of the nominal plant ``torque`` (n,), the largest
    one, ``rise`` and ``fall`` (n,), the fastest changes in a second, all over the demand.
    """

    swing: np.ndarray
    t90: np.ndarray
    jerk: np.ndarray
    torque: np.ndarray
    rise: np.ndarray
    fall: np.ndarray


class Rises:
    """Steps of several plants with one feedback in two degrees of freedom, without limits."""

    def __init__(
        self, plants: Sequence[SampledPlant], scales: Scales, feedback: control.StateSpace | None, times: Times
    ):
        import scipy.fft

        nominal = plants[0]
        free = [
            replace(
                plant, lag=max(plant.lags), delay=max(plant.delays), torque_limits=(-np.inf, np.inf), torque_rate=np.inf
            )
            for plant in plants
        ]
        controller = None if feedback is None else two_dof(free[0], scales.model, feedback)
        self.dt, self.scales = nominal.dt, scales
        steps = int(np.clip(np.ceil(POINTS * scales.model.frequency_hz * self.dt), 1, FINEST))
        demand = ramp(0.0, times.ramp, 1.0)
        trial = trial_of(free[0], controller, step(0.0, 1.0), times.end - times.start, steps=steps)
        values, final = loops_among(free, trial, ["vehicle_acceleration"])
        self.steps, self.count = steps, trial.count
        rise = values[:, 0, : self.count * steps].reshape(len(free), self.count, steps) / final[:, None, None]
        self.length = scipy.fft.next_fast_len(2 * self.count, real=True)
        self.spectrum = np.fft.rfft(rise, self.length, axis=1)  # (plants, frequencies, steps)
        self.demand = np.asarray(demand(self.dt * np.arange(self.count)), dtype=float)

    def within(self, rate: float) -> np.ndarray:
        """(samples,) ndarray: the demand, which only rises, no faster than a rate [1/s]."""
        return np.minimum(self.demand, rate * self.dt * np.arange(self.count) if rate < np.inf else np.inf)

    def of(self, torque: np.ndarray) -> Risen:
        """Of torques (n, samples) in place of the demand."""
        change = np.diff(torque, axis=1, prepend=0.0)
        spectrum = np.fft.rfft(change, self.length, axis=1)[:, :, None]
        time = self.dt / self.steps * np.arange(self.count * self.steps)
        swing, t90, jerk = np.empty((3, len(self.spectrum), len(torque)))
        for i, own in enumerate(self.spectrum):
            a = np.fft.irfft(spectrum * own, self.length, axis=1)[:, : self.count].reshape(len(torque), -1)
            swing[i] = first_fall(a, a.max(axis=1, keepdims=True))
            t90[i] = first_time(time, a, 0.9)
            jerk[i] = np.abs(np.diff(a, axis=1)).max(axis=1) * (self.steps / self.dt)
        rise, fall = change.max(axis=1) / self.dt, -change.min(axis=1) / self.dt
        return Risen(swing, t90, jerk, np.abs(torque).max(axis=1), rise, fall)

    def shaped(self, y: np.ndarray) -> np.ndarray:
        """(n, samples) ndarray: the demand through n feedforwards, as `inverse_notch` has them sampled."""
        scales = self.scales
        shaped = np.broadcast_to(self.demand, (len(y), self.count))
        modes = [(scales.model.omega, scales.model.damping_ratio)]
        if scales.second_hz is not None:
            modes.append((2.0 * np.pi * scales.second_hz, scales.second_damping_ratio))
        for (omega, zeta), numbers in zip(modes, np.split(y, y.shape[1] // 4, axis=1), strict=False):
            shaped = self._exchanged(shaped, numbers * [1.0, omega, zeta, omega])
        return shaped

    def _exchanged(self, torque: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """(n, samples) ndarray: torques through one inverse notch each."""
        import scipy.signal

        zeta, w, zeta1, w1 = numbers.T
        c = w1 / np.tan(0.5 * w1 * self.dt)

        def sampled(zeta: np.ndarray, w: np.ndarray) -> np.ndarray:
            r = c / w
            return np.stack([r**2 + 2.0 * zeta * r + 1.0, 2.0 - 2.0 * r**2, r**2 - 2.0 * zeta * r + 1.0])

        b, a = sampled(zeta1, w1), sampled(zeta, w)
        return np.stack([scipy.signal.lfilter(*each) for each in zip(b.T, a.T, torque, strict=True)])
