"""Exact motion over many short pieces of the inputs at once, as a measured trace has them, while no law changes its mode.

The coordinates of the flow go from sample to sample by one factor and one sum. On a piece h between values g of a guard
that bends by no more than M, ``g > M h^2 / 8`` at both ends proves that it stays positive in between.
"""

from functools import cached_property

import numpy as np

from .flow import integrated_square, phi_functions
from .matrices import ROUNDING
from .plant import Modes, Plant
from .signals import Pieces

# A guard is safe if it is above its bound by this part, which rounding does not reach.
SAFE = 1.0 + 1e-6


class TraceInputs:
    """Inputs and capacities along pieces that are straight lines, in local time."""

    def __init__(self, edges: np.ndarray, coefficients: np.ndarray, n_inputs: int):
        self.edges, self.coefficients = edges, coefficients
        self.inputs, self.capacities = coefficients[:, :n_inputs], coefficients[:, n_inputs:]

    def piece(self, t: np.ndarray) -> np.ndarray:
        """Index of the piece of each time; a time between two belongs to the later one."""
        return np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.coefficients) - 1)

    def values(self, t: np.ndarray) -> np.ndarray:
        """(inputs and capacities, samples) ndarray at local times."""
        k = self.piece(t)
        return along(self.coefficients[k].transpose(1, 0, 2), t - self.edges[k])


class Trace:
    """Exact motion in one mode of each law along straight pieces, from a state, in local time."""

    def __init__(self, plant: Plant, modes: Modes, x: np.ndarray, pieces: Pieces):
        self.plant, self.modes, self.start = plant, modes, x
        self.pattern = pattern = plant.pattern(modes)
        self.segment = TraceInputs(pieces.edges - pieces.edges[0], pieces.coefficients, plant.B.shape[1])
        inputs, capacities = self.segment.inputs, self.segment.capacities
        given = np.zeros((len(inputs), len(modes), 2))
        clutches = capacities.shape[1]
        given[:, :clutches] = pattern.capacity[:clutches, None] * capacities
        given[:, :, 0] += pattern.torque
        self.given = given
        flow = pattern.dynamics.flow
        self.rates, self.V = flow.eigenvalues, flow.V
        self._force = pattern.force_u @ inputs + pattern.force_tau @ given
        self.beta = flow.V_inverse @ self._force
        self.widths = np.diff(self.segment.edges)
        # widths that differ by the rounding of the times are one
        grain = 4.0 * np.spacing(abs(pieces.edges).max())
        _, self._kind = np.unique(np.round(self.widths / grain), return_inverse=True)
        self._width = (np.bincount(self._kind, self.widths) / np.bincount(self._kind))[:, None]
        phi = phi_functions(self.rates * self._width, 2)
        factors, change = phi[0][self._kind], self._driven(phi, 0)
        self.y = np.empty((len(inputs) + 1, len(self.rates)), dtype=complex)
        self.y[0] = flow.V_inverse @ (pattern.dynamics.inverse @ x[: plant.N])
        for now, factor, step, then in zip(self.y[:-1], factors, change, self.y[1:], strict=True):
            np.multiply(now, factor, out=then)
            then += step

    def _driven(self, phi: list[np.ndarray], times: int) -> np.ndarray:
        """What the forces add to the coordinates over each piece, integrated so many times."""
        h = self.widths[:, None]
        first, second = (phi[k + times][self._kind] for k in (1, 2))
        return h ** (1 + times) * (first * self.beta[:, :, 0] + h * second * self.beta[:, :, 1])

    def _integrated(self, times: int) -> np.ndarray:
        """(pieces, coordinates) ndarray: coordinates integrated over each piece, so many times."""
        phi = phi_functions(self.rates * self._width, 2 + times)
        return self.widths[:, None] ** times * phi[times][self._kind] * self.y[:-1] + self._driven(phi, times)

    @cached_property
    def sums(self) -> np.ndarray:
        """(pieces + 1, coordinates) ndarray: coordinates integrated from the start."""
        return np.vstack([np.zeros((1, len(self.rates))), np.cumsum(self._integrated(1), axis=0)])

    @cached_property
    def safe(self) -> int:
        """How many pieces, from the first on, no guard can end."""
        count = len(self.widths)
        if not self.pattern.guards.laws or not count:
            return count
        guards, watch = self.pattern.guards, self.pattern.watch
        inputs, capacities, h = self.segment.inputs, self.segment.capacities, self.widths[:, None]
        forcing = np.concatenate([inputs, self.given, capacities], axis=1)
        lines, terms = guards.on_forcing @ forcing, self.pattern.guard_sizes[1] @ abs(forcing[:, :, 0]).T
        terms = terms.T
        offset = guards.level + watch.start @ self.start
        rows, weights, values, sizes = watch.rows, watch.weights, self.y, abs(self.y)
        first = self.rates * self.y[:-1] + self.beta[:, :, 0]
        second = self.rates * first + self.beta[:, :, 1]
        bends = abs(second) * np.exp(self.pattern.dynamics.flow.grows * h)
        if watch.sums is not None:
            rows, weights = np.hstack([rows, watch.sums]), np.hstack([weights, watch.sum_weights])
            values, sizes = np.hstack([values, self.sums]), np.hstack([sizes, abs(self.sums)])
            bends = np.hstack([bends, abs(first) + h * bends])
        on_state = (values.real @ rows.real.T - values.imag @ rows.imag.T) + offset
        before = on_state[:-1] + lines[:, :, 0]
        after = on_state[1:] + lines[:, :, 0] + h * lines[:, :, 1]
        terms = terms + abs(guards.level) + abs(watch.start) @ abs(self.start) + sizes[:-1] @ weights.T
        least = SAFE * h * h / 8.0 * (bends @ weights.T) + 4.0 * ROUNDING * terms
        endangered = (np.minimum(before, after) <= least).any(axis=1)
        return int(endangered.argmax()) if endangered.any() else count

    def state(self, t: np.ndarray) -> np.ndarray:
        """(size, samples) ndarray."""
        k, plant = self.segment.piece(t), self.plant
        since = t - self.segment.edges[k]
        at_end = t >= self.segment.edges[-1]
        k, since = np.where(at_end, k + 1, k), np.where(at_end, 0.0, since)
        y, between = self.y[k], np.flatnonzero(since)
        sums = self.sums[k] if plant.elastic else None
        if between.size:
            pieces, h = k[between], since[between][:, None]
            phi = phi_functions(self.rates * h, 3 if plant.elastic else 2)
            beta = self.beta[pieces].transpose(2, 0, 1)
            if sums is not None:
                sums[between] += h * phi[1] * y[between] + h**2 * phi[2] * beta[0] + h**3 * phi[3] * beta[1]
            y[between] = phi[0] * y[between] + h * phi[1] * beta[0] + h**2 * phi[2] * beta[1]
        x = self._physical(y)
        if sums is None:
            return x
        x = np.vstack([x, np.zeros((len(plant.elastic), len(t)))])
        turned = self._physical(sums)
        for i in plant.elastic:
            y_i, q = plant.stretch[i], plant.twisted[i]
            if not self.pattern.dynamics.basis[y_i].any():
                x[y_i] = self.start[y_i]
            if self.pattern.integrated(i):
                x[q] = self.start[q] + plant.G[:, i] @ turned
            else:
                x[q] = self.start[q] - self.start[y_i] + x[y_i]
        return x

    def _physical(self, y: np.ndarray) -> np.ndarray:
        return self.pattern.dynamics.basis @ (self.V.real @ y.real.T - self.V.imag @ y.imag.T)

    def torque(self, t: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(laws, samples) ndarray from the states at these times."""
        on_x, on_u, on_tau = self.pattern.on_torque
        k = self.segment.piece(t)
        lines = (on_u @ self.segment.inputs + on_tau @ self.given)[k].transpose(1, 0, 2)
        return on_x @ x[: self.plant.N] + along(lines, t - self.segment.edges[k])

    def heat(self, duration: float) -> np.ndarray:
        """(laws,) ndarray: exact integral of what the laws dissipate [J] up to the end of a piece."""
        count = int(abs(self.segment.edges - duration).argmin())
        work = self._lost(count)
        sliding = np.flatnonzero(self.pattern.slides)
        if sliding.size and self.given[:, sliding].any():
            rows = self.plant.G.T[sliding] @ self.pattern.dynamics.basis @ self.V
            once, twice = ((self._integrated(k)[:count] @ rows.T).real for k in (1, 2))
            start, slope = self.given[:count, sliding].transpose(2, 0, 1)
            work[sliding] += ((start + self.widths[:count, None] * slope) * once - slope * twice).sum(axis=0)
        return work

    def squares(self, duration: float) -> None:
        """Nothing is left to be integrated."""

    def _lost(self, count: int) -> np.ndarray:
        """(laws,) ndarray: what dampers and fading stretches lose [J] on so many pieces."""
        work, (laws, factors, rows, *_) = np.zeros(len(self.modes)), self.pattern.losses
        if laws:
            n = len(self.pattern.dynamics.inverse)
            # the forces and their slopes are coordinates besides
            A = np.zeros((3 * n, 3 * n))
            A[:n, :n] = self.pattern.dynamics.flow.A
            A[:n, n : 2 * n] = A[n : 2 * n, 2 * n :] = np.eye(n)
            y = self.y[:count]
            w = self.V.real @ y.real.T - self.V.imag @ y.imag.T
            start = np.vstack([w, *self._force[:count].transpose(2, 1, 0)])
            rows = np.hstack([rows, np.zeros((len(rows), 2 * n))])
            for kind in np.unique(self._kind[:count]):
                those = np.flatnonzero(self._kind[:count] == kind)
                squares = integrated_square(A, start[:, those], rows, float(self._width[kind, 0]))
                np.add.at(work, laws, factors * squares)
        return work


def along(lines: np.ndarray, t: np.ndarray) -> np.ndarray:
    """(signals, samples) ndarray: values of lines (signals, samples, 2) at times of their own."""
    return lines[:, :, 0] + t * lines[:, :, 1]
