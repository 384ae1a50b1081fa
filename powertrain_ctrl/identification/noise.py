"""Noise of sensors and of measured inputs, and the filter that makes what both leave in the outputs white.

A measured torque is wrong by a little at every sample. The car integrates that, so the outputs are off by a slow random walk
that no weighting of samples knows of. Here the error of every input sample is a state of a Kalman filter, and the
innovations of the residuals are white (prediction error method, Ljung: System Identification, 2nd ed. (1999), section 7.2).
On its samples a delay is left out: it shifts the errors and leaves their spectrum as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy.optimize

from .channels import Channels
from .motion import LinearCar

# Of its size: noise below this is rounding, and the largest that is looked for.
ROUNDING = 1e-10
LARGEST = 1.0
# The covariance has settled when it changes by less than this part in a step.
SETTLED = 1e-6
# What the filter has wrong grows by no more than this part in a step; what nothing drives neither grows nor dies out.
GROWS = 1e-6
# A column that others make up to this part is a combination of them.
COMBINATION = 1e-7
# The likelihood is flat to this part of a unit where the levels have been found.
FLAT = 1e-6


class Levels(NamedTuple):
    """Standard deviations of the noise of inputs and outputs, in the order of a run."""

    inputs: np.ndarray
    outputs: np.ndarray


class Weights:
    """Residuals divided by the noise of their sensors: white where the inputs are exact."""

    def __init__(self, run: Channels, outputs: np.ndarray):
        self.there, self.outputs = run.there, outputs

    def __call__(self, columns: np.ndarray) -> np.ndarray:
        """(samples, k) ndarray from (outputs, N, k)."""
        return (columns / self.outputs[:, None, None])[self.there]


class Whitening:
    """Innovations of residuals under noise of inputs and outputs, divided by their standard deviations."""

    def __init__(self, run: Channels, car: LinearCar, levels: Levels):
        h, m = run.step, len(levels.inputs)
        phi, B0, B1 = car.step(h, m)
        n, inputs = len(phi), np.square(levels.inputs)
        # the error of the inputs at a sample is a state: linear to that at the next one
        self.F = np.block([[phi, B0], [np.zeros((m, n + m))]])
        self.H = np.hstack([car.C, car.D[:, :m]])
        entering = np.vstack([B1, np.eye(m)])
        self.Q, self.R = (entering * inputs) @ entering.T, np.square(levels.outputs)
        self.P0 = np.zeros_like(self.F)
        self.P0[n:, n:] = np.diag(inputs)
        self.there = run.there
        # where samples are missing altogether the noise goes on
        self.skipped = np.maximum(np.round(np.diff(run.time) / h).astype(int) - 1, 0)
        self._run()

    def _run(self) -> None:
        """Gains of every sample; from where they have settled on, that of the last one."""
        P, F = self.P0, self.F
        whole = np.atleast_1d(self.there.all(axis=0))
        # a gain that has settled stays so from here on
        settles = np.append(np.logical_and.accumulate((whole[1:] & (self.skipped == 0))[::-1])[::-1], True)
        self.gains: list[np.ndarray] = []
        self.scales: list[np.ndarray] = []
        self.log_determinant = 0.0
        count = len(whole)
        for k in range(count):
            rows = slice(None) if whole[k] else np.flatnonzero(self.there[:, k])
            H, R = self.H[rows], self.R[rows]
            L = np.linalg.cholesky(H @ P @ H.T + np.diag(R))
            scale = np.linalg.inv(L)
            gain = P @ H.T @ scale.T @ scale
            self.gains.append(gain)
            self.scales.append(scale)
            size = 2.0 * float(np.log(np.diag(L)).sum())
            self.log_determinant += size
            left = np.eye(len(P)) - gain @ H
            after = F @ (left @ P @ left.T + (gain * R) @ gain.T) @ F.T + self.Q
            if k + 1 < count:
                for _ in range(self.skipped[k]):
                    after = F @ after @ F.T + self.Q
                still = settles[k] and np.abs(after - P).max() <= SETTLED * np.abs(P).max()
                # where an output is all but exact the covariance rests at first at one whose filter is not stable
                if still and np.abs(np.linalg.eigvals(F @ left)).max() <= 1.0 + GROWS:
                    self.log_determinant += (count - 1 - k) * size
                    break
            P = after

    def __call__(self, columns: np.ndarray) -> np.ndarray:
        """(samples, k) ndarray from (outputs, N, k)."""
        state, H, F = np.zeros((len(self.F), columns.shape[2])), self.H, self.F
        samples = np.ascontiguousarray(columns.transpose(1, 0, 2))
        found = []
        for k, (gain, scale) in enumerate(zip(self.gains, self.scales, strict=True)):
            rows = slice(None) if len(scale) == len(H) else np.flatnonzero(self.there[:, k])
            innovation = samples[k, rows] - H[rows] @ state
            found.append(scale @ innovation)
            state = F @ (state + gain @ innovation)
            if k < len(self.skipped):
                for _ in range(self.skipped[k]):
                    state = F @ state
        rest = samples[len(self.gains) :]
        return np.concatenate([*found, self._settled(rest, state).reshape(-1, columns.shape[2])])

    def settled(self, columns: np.ndarray) -> np.ndarray:
        """(samples, outputs, k) ndarray from (outputs, samples, k) by the last gain alone."""
        return self._settled(columns.transpose(1, 0, 2), np.zeros((len(self.F), columns.shape[2])))

    def _settled(self, samples: np.ndarray, state: np.ndarray) -> np.ndarray:
        """(samples, outputs, k) ndarray from as much."""
        gain = self.F @ self.gains[-1]
        A = self.F - gain @ self.H
        states = np.empty((len(samples), *state.shape))
        for now, entering in zip(states, gain @ samples, strict=True):
            now[:] = state
            state = A @ state + entering
        return self.scales[-1] @ (samples - self.H @ states)


class Remainder(NamedTuple):
    """What a fit has left of a run, and what it could change in it: (outputs, N), (outputs, N, columns or unknowns).

    ``known`` is that of the run's own columns (see `prediction`).
    """

    left: np.ndarray
    columns: np.ndarray
    known: np.ndarray
    derivatives: np.ndarray


def noise_levels(
    runs: Sequence[Channels], cars: Sequence[LinearCar], remainders: Sequence[Remainder], start: Sequence[Levels]
) -> list[Levels]:
    """Most likely noise of each input and output, the same in all runs, from what a fit has left.

    By restricted likelihood (Patterson, Thompson, Biometrika 58 (1971) 545-554): what the fit has taken up of the noise is
    not counted as none, which matters in short runs.

    Parameters
    ----------
    runs, cars, remainders : sequences of Channels, LinearCar, Remainder
    start : sequence of Levels
        To start from; a level of 0 stays.
    """
    named: dict[str, float] = {}
    for run, levels in zip(runs, start, strict=True):
        for name, level in zip((*run.inputs, *run.outputs), np.concatenate(levels), strict=True):
            named[name] = max(named.get(name, 0.0), float(level))
    looked_for = [name for name, level in named.items() if level > 0.0]
    sizes = {name: 0.0 for name in looked_for}
    for run in runs:
        for name, size in zip(run.outputs, run.size, strict=True):
            sizes[name] = max(sizes.get(name, 0.0), float(size))
        for name, (_, values) in run.inputs.items():
            sizes[name] = max(sizes.get(name, 0.0), float(np.ptp(values)))

    def levels_of(logarithms: np.ndarray) -> list[Levels]:
        found = named | dict(zip(looked_for, np.exp(logarithms).tolist(), strict=True))
        return [
            Levels(np.array([found[n] for n in run.inputs]), np.array([found[n] for n in run.outputs])) for run in runs
        ]

    count = sum(int(run.there.sum()) for run in runs)

    def unlikely(logarithms: np.ndarray) -> float:
        total, shared = 0.0, []
        for run, car, remainder, levels in zip(runs, cars, remainders, levels_of(logarithms), strict=True):
            filter = Whitening(run, car, levels)
            own = remainder.columns.shape[2]
            parts = [remainder.left[:, :, None], remainder.columns, remainder.derivatives]
            white = filter(np.concatenate(parts, axis=2))
            prior = np.zeros((np.count_nonzero(remainder.known), white.shape[1]))
            prior[:, 1 : 1 + own] = np.diag(remainder.known)[remainder.known > 0.0]
            white = np.concatenate([white, prior])
            volume, rest = _taken_out(white[:, 1 : 1 + own], np.delete(white, slice(1, 1 + own), axis=1))
            total += filter.log_determinant + volume
            shared.append(rest)
        rest = np.concatenate(shared)
        volume, left = _taken_out(rest[:, 1:], rest[:, :1])
        return 0.5 * (total + volume + float(np.sum(left**2))) / count

    bounds = [(np.log(ROUNDING * sizes[name]), np.log(LARGEST * sizes[name])) for name in looked_for]
    first = np.clip(np.log([named[name] for name in looked_for]), *np.transpose(bounds))
    found = scipy.optimize.minimize(
        unlikely, first, method="L-BFGS-B", bounds=bounds, options={"ftol": FLAT, "gtol": 1e-3 * FLAT**0.5}
    )
    return levels_of(found.x)


def _taken_out(columns: np.ndarray, others: np.ndarray) -> tuple[float, np.ndarray]:
    """Logarithm of the squared volume of the columns, and what they leave of others; combinations of others do not count."""
    size = np.linalg.norm(columns, axis=0)
    Q, R = np.linalg.qr(columns / np.where(size > 0.0, size, 1.0))
    independent = np.abs(np.diag(R)) > COMBINATION
    Q = Q[:, independent]
    volume = 2.0 * float(np.sum(np.log((np.abs(np.diag(R)) * size)[independent])))
    return volume, others - Q @ (Q.T @ others)
