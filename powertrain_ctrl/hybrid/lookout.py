"""Guards along a trajectory: their values and slopes, and rigorous bounds on how they bend from there on."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from .flow import EARLY, DenseTrajectory, ModalTrajectory, polynomial_derivatives, value_at
from .matrices import Watch


class Look(NamedTuple):
    """(guards, samples) ndarrays: values, slopes, a bound on how they bend until some time, sizes of their terms."""

    value: np.ndarray
    slope: np.ndarray
    bend: np.ndarray
    size: np.ndarray


class Lookout:
    """Guards along one trajectory, to whose rows polynomials (guards, degree + 1) are added.

    ``terms`` are such of the magnitudes of what cancels in these, which say how far rounding goes.
    """

    def __init__(
        self, watch: Watch, trajectory: ModalTrajectory | DenseTrajectory, polynomials: np.ndarray, terms: np.ndarray
    ):
        self.watch, self.trajectory, self.terms = watch, trajectory, terms
        slopes, bends = polynomial_derivatives(polynomials, 2)[1:]
        self._polynomials, self._bends = np.zeros((3, *polynomials.shape)), abs(bends)
        self._polynomials[0], self._polynomials[1, :, :-1], self._polynomials[2] = polynomials, slopes, terms
        self._early = EARLY / trajectory.flow.fastest if trajectory.is_closed and trajectory.flow.fastest else np.inf

    def __call__(self, t: np.ndarray, until: float) -> Look:
        """At these times, ascending; the guards bend by no more from each of them until then."""
        return self._by_waves(t, until) if t[-1] >= self._early else self._by_coordinates(t, until)

    def _by_coordinates(self, t: np.ndarray, until: float) -> Look:
        watch, trajectory = self.watch, self.trajectory
        y, y1, y2 = trajectory.derivatives(t, 2)
        value, slope, size = value_at(self._polynomials, t)
        largest = trajectory.largest_second(y2, t, until)
        value += (watch.rows @ y).real
        slope += (watch.rows @ y1).real
        size += watch.weights @ trajectory.size(y)
        bend = watch.weights @ largest
        if watch.sums is not None:
            sums = trajectory.integral(t, y)
            value += (watch.sums @ sums).real
            slope += (watch.sums @ y).real
            size += watch.sum_weights @ trajectory.size(sums)
            bend += watch.sum_weights @ (trajectory.size(y1) + (until - t) * largest)
        if self._bends.size:
            bend += value_at(self._bends, np.array([until]))
        return Look(value, slope, bend, size)

    def _by_waves(self, t: np.ndarray, until: float) -> Look:
        """The same by sums of exponentials and of powers of time up to the third."""
        flow, (on_terms, on_bend, bends, on_size) = self.trajectory.flow, self._waves
        n, count = len(flow.eigenvalues), len(on_bend)
        waves = np.exp(flow.eigenvalues[:, None] * t)
        largest = sizes = abs(waves)
        if flow.growth:
            largest = sizes * np.exp(flow.grows[:, None] * (until - t))
        terms = np.empty((2 * n + 4, len(t)))
        terms[:n], terms[n : 2 * n], powers = waves.real, waves.imag, terms[2 * n :]
        powers[0], powers[1] = 1.0, t
        np.multiply(t, t, out=powers[2])
        np.multiply(powers[2], t, out=powers[3])
        both = on_terms @ terms
        bend = on_bend @ largest + (bends[:, :1] + until * bends[:, 1:])
        return Look(both[:count], both[count:], bend, on_size[:, :n] @ sizes + on_size[:, n:] @ powers)

    @cached_property
    def _waves(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Matrices of values and slopes on real and imaginary parts of exponentials and on powers; of bends on magnitudes
        of exponentials, and on powers; of sizes on both."""
        assert isinstance(self.trajectory, ModalTrajectory)
        watch, flow, free, drift = self.watch, self.trajectory.flow, self.trajectory.free, self.trajectory.drift
        waves, weights = watch.rows * free, watch.weights * abs(free)
        count, degree = self.terms.shape
        line, size = np.zeros((count, 4)), np.zeros((count, 4))
        line[:, :degree], size[:, :degree] = self._polynomials[0], self.terms
        line[:, :3] += (watch.rows @ drift).real
        size[:, :3] += watch.weights @ abs(drift)
        slopes = waves * flow.eigenvalues
        if watch.sums is not None:
            slopes += watch.sums * free
            turned = watch.sums * (free / flow.rate)
            waves = waves + turned
            line[:, 0] -= turned.real.sum(axis=1)
            line[:, 1:] += (watch.sums @ drift).real / [1.0, 2.0, 3.0]
            weights = weights + abs(turned)
            size[:, 0] += abs(turned).sum(axis=1)
            size[:, 1:] += watch.sum_weights @ abs(drift) / [1.0, 2.0, 3.0]
        on_terms = np.zeros((2 * count, 2 * len(free) + 4))
        on_terms[:, : len(free)] = np.concatenate([waves.real, slopes.real])
        on_terms[:, len(free) : -4] = -np.concatenate([waves.imag, slopes.imag])
        on_terms[:count, -4:] = line
        on_terms[count:, -4:-1] = line[:, 1:] * [1.0, 2.0, 3.0]
        bends = abs(line[:, 2:]) * [2.0, 6.0]
        return on_terms, abs(slopes * flow.eigenvalues), bends, np.concatenate([weights, size], axis=1)
