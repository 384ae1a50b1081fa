"""Exact solution of ``x' = A x + b(t)`` for polynomial ``b``, and rigorous bounds on how fast it bends.

With ``A = V diag(lambda) V^-1`` every modal coordinate is ``exp(lambda t) y0 + sum_j j! beta_j t^(j+1)
phi_(j+1)(lambda t)``, with the phi-functions of exponential integrators (Hochbruck, Ostermann: Exponential
integrators, Acta Numerica 19 (2010), equation (2.9)). Where A has no well-conditioned eigenvectors (critical
damping) the matrix exponential of the augmented system is used instead.
"""

from functools import cached_property
from math import ceil, factorial, log2

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

# Eigenvectors worse conditioned than this are not used.
ILL_CONDITIONED = 1e5
# Modes slower than this [rad/s] are nearly integrators; their response to a ramp is not split into free and driven.
SLOW = 1.0
# So early that no mode has moved by more than this, what has begun with zero must not be drowned in differences of what has
# not: phi-functions again.
EARLY = 1e-3
# Terms of an exponential series of at most 1/2.
TERMS = 18


def phi_functions(z: np.ndarray, order: int) -> list[np.ndarray]:
    """``phi_0 ... phi_order`` of complex z: ``phi_0 = exp(z)``, ``phi_(k+1) = (phi_k - 1/k!) / z``.

    Examples
    --------
    >>> [phi.real.round(6).tolist() for phi in phi_functions(np.array([0.0, 1.0]), 2)]
    [[1.0, 2.718282], [1.0, 1.718282], [0.5, 0.718282]]
    """
    z = np.asarray(z, dtype=complex)
    radius = 1.0 if order <= 3 else 5.0
    near = np.abs(z) < radius
    phi = [np.exp(z)]
    safe = np.where(near, 1.0, z)
    for k in range(order):
        phi.append((phi[k] - 1.0 / factorial(k)) / safe)
    if near.any():
        small = z[near]
        terms = 22 if radius == 1.0 else 48
        value = np.full(small.shape, 1.0 / factorial(order + terms), dtype=complex)
        for i in range(terms - 1, -1, -1):
            value = value * small + 1.0 / factorial(order + i)
        for k in range(order, 0, -1):
            phi[k][near] = value
            value = value * small + 1.0 / factorial(k - 1)
    return phi


def exponentials(rates: np.ndarray, t: np.ndarray) -> np.ndarray:
    """``exp(rates t)`` (rates, samples); on an even grid by multiplying coarse and fine steps."""
    count = len(t)
    block = int(np.sqrt(count))
    if count < 64 or not np.allclose(np.diff(t), t[1] - t[0], rtol=0.0, atol=1e-13 * max(1.0, abs(t[-1]))):
        return np.exp(rates[:, None] * t)
    step = (t[-1] - t[0]) / (count - 1)
    coarse = np.exp(rates[:, None] * (t[0] + step * block * np.arange(-(-count // block))))
    fine = np.exp(rates[:, None] * (step * np.arange(block)))
    products = coarse[:, :, None] * fine[:, None, :]
    return products.reshape(len(rates), coarse.shape[1] * block)[:, :count]


class Flow:
    """All solutions of one ``x' = A x + b(t)``.

    ``growth`` bounds the rate [1/s] at which coordinates of a trajectory can grow by themselves; 0 for a driveline, unless
    friction falls with slip.
    """

    def __init__(self, A: np.ndarray):
        self.A = A
        # what is not connected does not mix: parts at rest stay so to the last bit
        count, part = connected_components(A != 0.0, directed=False)
        # fast rows first: then the QR algorithm is accurate for slow modes too (G. W. Stewart, on graded matrices)
        order = np.argsort(-np.abs(A).max(axis=1, initial=0.0), kind="stable")
        parts = [order[part[order] == i] for i in range(count)]
        modes = [np.linalg.eig(A[np.ix_(rows, rows)]) for rows in parts]
        self.is_modal = all(np.linalg.cond(V) < ILL_CONDITIONED for _, V in modes)
        if self.is_modal:
            # Of each conjugate pair one is enough: x = Re(V y) with the pair's column doubled.
            kept = [values.imag >= 0.0 for values, _ in modes]
            ends = np.cumsum([0, *(np.count_nonzero(chosen) for chosen in kept)])
            self.eigenvalues, self.grows = np.zeros(ends[-1], dtype=complex), np.zeros(ends[-1])
            self.V = np.zeros((len(A), ends[-1]), dtype=complex)
            self.V_inverse = np.zeros((ends[-1], len(A)), dtype=complex)
            for rows, (values, V), chosen, first, last in zip(parts, modes, kept, ends[:-1], ends[1:], strict=True):
                self.V[rows, first:last] = (V * np.where(values.imag > 0.0, 2.0, 1.0))[:, chosen]
                self.V_inverse[first:last, rows] = np.linalg.inv(V)[chosen]
                values, size = values[chosen].astype(complex), np.abs(values[chosen])
                # rigid motions, that rounding has moved off zero
                rounding = 4.0 * len(rows) * np.finfo(float).eps * size.max(initial=0.0)
                values[size <= rounding] = 0.0
                self.eigenvalues[first:last] = values
                # what is undamped does not grow by rounding
                self.grows[first:last] = np.where(values.real > rounding, values.real, 0.0)
            size = np.abs(self.eigenvalues)
            self.fastest = float(size.max(initial=0.0))
            self.growth = float(self.grows.max(initial=0.0))
            self.still = np.flatnonzero(self.eigenvalues == 0.0)
            self.slow = np.flatnonzero((self.eigenvalues != 0.0) & (size < SLOW))
        else:
            # of the norm: 0 where A + A^T <= 0; a lag in front of a driveline may add something
            self.growth = max(float(np.linalg.eigvalsh(0.5 * (A + A.T)).max(initial=0.0)), 0.0)

    def rows(self, functionals: np.ndarray) -> np.ndarray:
        """Functionals on x as functionals on the coordinates of `derivatives` of a trajectory."""
        return functionals @ self.V if self.is_modal else functionals

    def trajectory(self, x0: np.ndarray, b: np.ndarray) -> "ModalTrajectory | DenseTrajectory":
        """Solution from x0 with ``b(t) = sum_j b[:, j] t^j``."""
        return ModalTrajectory(self, x0, b) if self.is_modal else DenseTrajectory(self, x0, b)


class ModalTrajectory:
    """One solution in modal coordinates."""

    def __init__(self, flow: Flow, x0: np.ndarray, b: np.ndarray):
        self.flow = flow
        self.y0 = flow.V_inverse @ x0
        self.beta = flow.V_inverse @ b
        self._forcings = polynomial_derivatives(self.beta, 2)
        self._bends = np.abs(self._forcings[2])
        if b.shape[1] == 2:
            # y = free exp(lambda t) + drift_0 + drift_1 t; slow modes would cancel, they go by phi-functions
            rate = np.where(np.abs(flow.eigenvalues) < SLOW, 1.0, flow.eigenvalues)
            self._drift_1 = -self.beta[:, 1] / rate
            self._drift_0 = (self._drift_1 - self.beta[:, 0]) / rate
            self._free = self.y0 - self._drift_0

    def _coordinates(self, t: np.ndarray) -> np.ndarray:
        """Modal coordinates (n, samples) at the times."""
        if self.beta.shape[1] != 2 or t[-1] * self.flow.fastest < EARLY:
            return self._by_phi(t, slice(None), 0)
        flow, beta = self.flow, self.beta
        y = np.exp(flow.eigenvalues[:, None] * t)
        y *= self._free[:, None]
        y += self._drift_0[:, None] + self._drift_1[:, None] * t
        if flow.still.size:
            rate, change = beta[flow.still, 0, None], beta[flow.still, 1, None]
            y[flow.still] = self.y0[flow.still, None] + t * (rate + 0.5 * t * change)
        if flow.slow.size:
            y[flow.slow] = self._by_phi(t, flow.slow, 0)
        return y

    def _by_phi(self, t: np.ndarray, chosen: slice | np.ndarray, integrals: int) -> np.ndarray:
        y0, beta = self.y0[chosen, None], self.beta[chosen]
        phi = phi_functions(self.flow.eigenvalues[chosen, None] * t, beta.shape[1] + integrals)
        y = y0 * phi[integrals] * t**integrals
        for j in range(beta.shape[1]):
            k = j + 1 + integrals
            y = y + factorial(j) * beta[:, j, None] * phi[k] * t**k
        return y

    def state(self, t: np.ndarray, integrals: int = 0) -> np.ndarray:
        """(n, samples) ndarray: x at these times, integrated ``integrals`` times from 0."""
        flow = self.flow
        if integrals or self.beta.shape[1] != 2 or flow.slow.size:
            y = self._by_phi(t, slice(None), integrals) if integrals else self._coordinates(t)
            return flow.V.real @ y.real - flow.V.imag @ y.imag
        moving = np.abs(flow.eigenvalues) > 0.0
        decay = exponentials(flow.eigenvalues[moving], t)
        shapes = flow.V[:, moving] * self._free[moving]
        x = shapes.real @ decay.real
        x -= shapes.imag @ decay.imag
        drift = np.stack([self._drift_0, self._drift_1, np.zeros_like(self.y0)], axis=1)
        still = flow.still
        drift[still] = np.stack([self.y0[still], self.beta[still, 0], 0.5 * self.beta[still, 1]], axis=1)
        x += (flow.V @ drift).real @ np.stack([np.ones_like(t), t, t * t])
        return x

    def integrals(self, t: float, count: int) -> list[np.ndarray]:
        """(n,) ndarrays: x integrated once to ``count`` times from 0 to t."""
        flow, q, found = self.flow, self.beta.shape[1], []
        phi = phi_functions(flow.eigenvalues * t, q + count)
        for k in range(1, count + 1):
            y = self.y0 * phi[k] * t**k
            for j in range(q):
                y = y + factorial(j) * self.beta[:, j] * phi[j + 1 + k] * t ** (j + 1 + k)
            found.append(flow.V.real @ y.real - flow.V.imag @ y.imag)
        return found

    def integral(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Coordinates integrated from 0, (n, samples), from the coordinates y at these times."""
        flow = self.flow
        if t[-1] * flow.fastest < EARLY:
            return self._by_phi(t, slice(None), 1)
        # from y' = lambda y + b; what is slow would cancel
        powers = t ** np.arange(1, self.beta.shape[1] + 1)[:, None] / np.arange(1, self.beta.shape[1] + 1)[:, None]
        rate = np.where(np.abs(flow.eigenvalues) < SLOW, 1.0, flow.eigenvalues)
        total = (y - self.y0[:, None] - self.beta @ powers) / rate[:, None]
        few = np.flatnonzero(np.abs(flow.eigenvalues) < SLOW)
        if few.size:
            total[few] = self._by_phi(t, few, 1)
        return total

    def derivatives(self, t: np.ndarray, order: int) -> list[np.ndarray]:
        """Coordinates (n, samples) and their time derivatives."""
        y = [self._coordinates(t)]
        for k in range(order):
            y.append(self.flow.eigenvalues[:, None] * y[k] + value_at(self._forcings[k], t))
        return y

    def weights(self, rows: np.ndarray) -> np.ndarray:
        """What `size` needs of rows on the coordinates."""
        return np.abs(rows)

    def size(self, value: np.ndarray) -> np.ndarray:
        """``weights(rows) @ size(value)`` bounds the terms that ``rows @ value`` sums up."""
        return np.abs(value)

    def largest_second(self, second: np.ndarray, t: np.ndarray, until: float) -> np.ndarray:
        """`size` of ``x''`` from t until then: that of a mode that does not grow only grows by the input's bending."""
        grown = np.abs(second)
        if self._bends.shape[1]:
            grown = grown + (until - t) * value_at(self._bends, np.array([until]))
        if self.flow.growth:
            grown = grown * np.exp(self.flow.grows[:, None] * (until - t))
        return grown


class DenseTrajectory:
    """One solution by matrix exponentials; bounds are tight where A is dissipative, ``A + A^T <= 0``."""

    def __init__(self, flow: Flow, x0: np.ndarray, b: np.ndarray):
        self.flow, self.x0, self.b = flow, x0, b

    @cached_property
    def _augmented(self) -> np.ndarray:
        n, q = self.b.shape
        matrix = np.zeros((n + q, n + q))
        matrix[:n, :n] = self.flow.A
        matrix[:n, n:] = self.b * [factorial(j) for j in range(q)]
        matrix[n:, n:] = np.diag(np.ones(q - 1), -1)
        return matrix

    def state(self, t: np.ndarray, integrals: int = 0) -> np.ndarray:
        n, q = self.b.shape
        matrix = np.zeros((n + q + integrals * n,) * 2)
        matrix[: n + q, : n + q] = self._augmented
        for k in range(integrals):
            row = n + q + k * n
            source = 0 if k == 0 else row - n
            matrix[row : row + n, source : source + n] = np.eye(n)
        start = np.zeros(len(matrix))
        start[:n], start[n] = self.x0, 1.0
        first = 0 if integrals == 0 else len(matrix) - n
        result = np.empty((n, t.size))
        steps: dict[float, np.ndarray] = {}
        now, at = start, 0.0
        for i in np.argsort(t):
            # samples on a grid take the same step again and again
            step = float(t[i] - at)
            key = round(step, 15)
            if key not in steps:
                steps[key] = scipy.linalg.expm(matrix * step)
            now, at = steps[key] @ now, float(t[i])
            result[:, i] = now[first : first + n]
        return result

    def integral(self, t: np.ndarray, y: np.ndarray) -> np.ndarray:
        return self.state(t, integrals=1)

    def integrals(self, t: float, count: int) -> list[np.ndarray]:
        return [self.state(np.array([t]), integrals=k)[:, 0] for k in range(1, count + 1)]

    def derivatives(self, t: np.ndarray, order: int) -> list[np.ndarray]:
        x = [self.state(t)]
        for k, forcing in enumerate(polynomial_derivatives(self.b, order - 1)[:order]):
            x.append(self.flow.A @ x[k] + value_at(forcing, t))
        return x

    def weights(self, rows: np.ndarray) -> np.ndarray:
        return np.linalg.norm(rows, axis=1)[:, None]

    def size(self, value: np.ndarray) -> np.ndarray:
        return np.linalg.norm(value, axis=0)[None, :]

    def largest_second(self, second: np.ndarray, t: np.ndarray, until: float) -> np.ndarray:
        bending = value_at(polynomial_derivatives(np.abs(self.b), 2)[2], np.array([until]))
        return (self.size(second) + (until - t) * np.linalg.norm(bending)) * np.exp(self.flow.growth * (until - t))


class WithIntegrals:
    """A trajectory whose coordinates have their integrals behind them: for what only integrates, as a twist in a gap."""

    def __init__(self, trajectory: ModalTrajectory | DenseTrajectory):
        self.trajectory = trajectory

    def derivatives(self, t: np.ndarray, order: int) -> list[np.ndarray]:
        y = self.trajectory.derivatives(t, order)
        return [np.vstack([y[k], y[k - 1] if k else self.trajectory.integral(t, y[0])]) for k in range(order + 1)]

    def weights(self, rows: np.ndarray) -> np.ndarray:
        half = rows.shape[1] // 2
        return np.hstack([self.trajectory.weights(rows[:, :half]), self.trajectory.weights(rows[:, half:])])

    def size(self, value: np.ndarray) -> np.ndarray:
        half = len(value) // 2
        return np.vstack([self.trajectory.size(value[:half]), self.trajectory.size(value[half:])])

    def largest_second(self, second: np.ndarray, t: np.ndarray, until: float) -> np.ndarray:
        half = len(second) // 2
        bend = self.trajectory.largest_second(second[:half], t, until)
        return np.vstack([bend, self.trajectory.size(second[half:]) + (until - t) * bend])


def integrated_square(A: np.ndarray, start: np.ndarray, rows: np.ndarray, duration: float) -> np.ndarray:
    """(rows,) ndarray: integrals of ``(row x)^2`` along ``x' = A x`` from starts (n, pieces), summed over the pieces.

    Van Loan (IEEE Trans. Autom. Control 23 (1978) 395-404) over a short step, doubled until it is the whole duration.
    """
    n = len(A)
    doublings = max(0, ceil(log2(max(2.0 * duration * float(np.linalg.norm(A, 1)), 1.0))))
    block = np.zeros((2 * n, 2 * n))
    block[:n, :n], block[n:, n:] = -A.T, A
    sums = np.empty(len(rows))
    for i, row in enumerate(rows):
        block[:n, n:] = np.outer(row, row)
        # where |A| h <= 1/2 so many terms of the series leave nothing
        step = term = np.eye(2 * n)
        for k in range(1, TERMS):
            term = term @ block * (duration / 2.0**doublings / k)
            step = step + term
        flow = step[n:, n:]
        gramian = flow.T @ step[:n, n:]
        for _ in range(doublings):
            gramian = gramian + flow.T @ gramian @ flow
            flow = flow @ flow
        sums[i] = np.sum(start * (gramian @ start))
    return sums


def polynomial_derivatives(coefficients: np.ndarray, order: int) -> list[np.ndarray]:
    """Coefficients of the polynomials (..., q) and of their derivatives up to an order."""
    derivatives = [coefficients]
    for _ in range(order):
        last = derivatives[-1]
        derivatives.append(last[..., 1:] * np.arange(1, last.shape[-1]))
    return derivatives


def value_at(coefficients: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Values (..., samples) of the polynomials (..., q) at these times."""
    degree = coefficients.shape[-1] - 1
    if degree < 1:
        return np.repeat(coefficients.sum(axis=-1, keepdims=True), len(t), axis=-1)
    value = coefficients[..., degree, None] * t
    for j in range(degree - 1, 0, -1):
        value = (value + coefficients[..., j, None]) * t
    return value + coefficients[..., 0, None]
