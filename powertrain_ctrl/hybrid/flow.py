"""Exact solution of ``x' = A x + b(t)`` for polynomial ``b``, and rigorous bounds on how fast it bends.

With ``A = V diag(lambda) V^-1`` every modal coordinate is ``exp(lambda t) y0 + sum_j j! beta_j t^(j+1)
phi_(j+1)(lambda t)``, with the phi-functions of exponential integrators (Hochbruck, Ostermann: Exponential
integrators, Acta Numerica 19 (2010), equation (2.9)). Where A has no well-conditioned eigenvectors (critical
damping) the matrix exponential of the augmented system is used instead.
"""

from collections import defaultdict
from collections.abc import Sequence
from functools import cache, cached_property
from math import ceil, factorial, log2
from typing import NamedTuple

import numpy as np
import scipy.linalg

# Eigenvectors worse conditioned than this are not used.
ILL_CONDITIONED = 1e5
# Modes slower than this [rad/s] are nearly integrators; their response to a ramp is not split into free and driven.
SLOW = 1.0
# So early that no mode has moved by more than this, what has begun with zero must not be drowned in differences of what has
# not: phi-functions again.
EARLY = 1e-3
# Terms of an exponential series of at most 1/16.
TERMS = 12


def phi_functions(z: np.ndarray, order: int) -> list[np.ndarray]:
    """``phi_0 ... phi_order`` of complex z: ``phi_0 = exp(z)``, ``phi_(k+1) = (phi_k - 1/k!) / z``.

    Examples
    --------
    >>> [phi.real.round(6).tolist() for phi in phi_functions(np.array([0.0, 1.0]), 2)]
    [[1.0, 2.718282], [1.0, 1.718282], [0.5, 0.718282]]
    """
    z = np.asarray(z, dtype=complex)
    near = np.abs(z) < (1.0 if order <= 3 else 5.0)
    phi = [np.exp(z)]
    safe = np.where(near, 1.0, z)
    for k in range(order):
        phi.append((phi[k] - 1.0 / factorial(k)) / safe)
    if near.any():
        series = _series(order)
        powers = np.repeat(z[near][None, :], len(series), axis=0)
        powers[0] = 1.0
        np.cumprod(powers, axis=0, out=powers)
        for k, values in enumerate(series.T @ powers.real + 1j * (series.T @ powers.imag)):
            if k:
                phi[k][near] = values
    return phi


@cache
def _series(order: int) -> np.ndarray:
    """(terms, order + 1) ndarray: ``phi_k = sum_i z^i / (k + i)!``, the terms that count where z is small."""
    terms = 22 if order <= 3 else 48
    return np.array([[1.0 / factorial(k + i) for k in range(order + 1)] for i in range(terms)])


def exponentials(rates: np.ndarray, t: np.ndarray) -> np.ndarray:
    """``exp(rates t)`` (rates, samples); on an even grid by multiplying coarse and fine steps."""
    count = len(t)
    block = int(np.sqrt(count))
    if count < 64:
        return np.exp(rates[:, None] * t)
    step = (t[-1] - t[0]) / (count - 1)
    if abs(np.diff(t) - step).max() > 1e-13 * max(1.0, abs(t[-1])):
        return np.exp(rates[:, None] * t)
    coarse = np.exp(rates[:, None] * (t[0] + step * block * np.arange(-(-count // block))))
    fine = np.exp(rates[:, None] * (step * np.arange(block)))
    products = coarse[:, :, None] * fine[:, None, :]
    return products.reshape(len(rates), coarse.shape[1] * block)[:, :count]


def connected(touching: np.ndarray) -> np.ndarray:
    """(n,) ndarray: number of the part to which each of n things belongs; those that touch are of one part.

    Examples
    --------
    >>> connected(np.array([[0, 0, 1], [0, 0, 0], [0, 0, 0]], dtype=bool))
    array([0, 1, 0])
    """
    near = touching | touching.T | np.eye(len(touching), dtype=bool)
    first = np.arange(len(touching))
    while True:
        # the first of what each touches, and the first of what that touches
        earlier = np.where(near, first, len(first)).min(axis=1, initial=len(first))
        earlier = earlier[earlier]
        if (earlier == first).all():
            return np.unique(first, return_inverse=True)[1]
        first = earlier


class Flow:
    """All solutions of one ``x' = A x + b(t)``.

    ``growth`` bounds the rate [1/s] at which coordinates of a trajectory can grow by themselves; 0 for a driveline, unless
    friction falls with slip.
    """

    def __init__(self, A: np.ndarray):
        self.A = A
        # what is not connected does not mix: parts at rest stay so to the last bit
        part = connected(A != 0.0)
        # fast rows first: then the QR algorithm is accurate for slow modes too (G. W. Stewart, on graded matrices)
        order = np.argsort(-np.abs(A).max(axis=1, initial=0.0), kind="stable")
        parts = [order[part[order] == i] for i in range(1 + part.max(initial=-1))]
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
            self.still, self.moving = np.flatnonzero(size == 0.0), np.flatnonzero(size)
            self.slow = np.flatnonzero((self.eigenvalues != 0.0) & (size < SLOW))
            # by which what is not slow is divided
            self.rate = np.where(size < SLOW, 1.0, self.eigenvalues)
        else:
            # of the norm: 0 where A + A^T <= 0; a lag in front of a driveline may add something
            self.growth = max(float(np.linalg.eigvalsh(0.5 * (A + A.T)).max(initial=0.0)), 0.0)

    def rows(self, functionals: np.ndarray) -> np.ndarray:
        """Functionals on x as functionals on the coordinates of `derivatives` of a trajectory."""
        return functionals @ self.V if self.is_modal else functionals

    def weights(self, rows: np.ndarray) -> np.ndarray:
        """What `size` of its trajectories needs of rows on their coordinates."""
        return (ModalTrajectory if self.is_modal else DenseTrajectory).weights(rows)

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
        # y = free exp(lambda t) + drift_0 + drift_1 t + drift_2 t^2; slow modes would cancel, they go by phi-functions
        self.is_closed = b.shape[1] == 2 and not flow.slow.size
        if b.shape[1] == 2:
            self.drift, still = np.zeros((len(self.y0), 3), dtype=complex), flow.still
            self.drift[:, 1] = -self.beta[:, 1] / flow.rate
            self.drift[:, 0] = (self.drift[:, 1] - self.beta[:, 0]) / flow.rate
            self.drift[still, 0], self.drift[still, 1:] = self.y0[still], self.beta[still] / [1.0, 2.0]
            self.free = self.y0 - self.drift[:, 0]

    def _coordinates(self, t: np.ndarray) -> np.ndarray:
        """Modal coordinates (n, samples) at the times."""
        if not t[-1]:
            return np.repeat(self.y0[:, None], len(t), axis=1)
        if self.beta.shape[1] != 2 or t[-1] * self.flow.fastest < EARLY:
            return self._by_phi(t, slice(None), 0)
        flow = self.flow
        y = np.exp(flow.eigenvalues[:, None] * t)
        y *= self.free[:, None]
        y += value_at(self.drift, t)
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
        if integrals or not self.is_closed:
            y = self._by_phi(t, slice(None), integrals) if integrals else self._coordinates(t)
            return flow.V.real @ y.real - flow.V.imag @ y.imag
        # real and imaginary parts of the exponentials, then powers of time
        n = len(flow.moving)
        terms = np.empty((2 * n + 3, len(t)))
        decay = exponentials(flow.eigenvalues[flow.moving], t)
        terms[:n], terms[n : 2 * n], terms[2 * n], terms[2 * n + 1] = decay.real, decay.imag, 1.0, t
        np.multiply(t, t, out=terms[2 * n + 2])
        shapes = flow.V[:, flow.moving] * self.free[flow.moving]
        return np.concatenate([shapes.real, -shapes.imag, (flow.V @ self.drift).real], axis=1) @ terms

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
        if not t[-1]:
            return np.zeros_like(y)
        if t[-1] * flow.fastest < EARLY:
            return self._by_phi(t, slice(None), 1)
        # from y' = lambda y + b; what is slow would cancel
        powers = t ** np.arange(1, self.beta.shape[1] + 1)[:, None] / np.arange(1, self.beta.shape[1] + 1)[:, None]
        total = (y - self.y0[:, None] - self.beta @ powers) / flow.rate[:, None]
        if flow.still.size:
            total[flow.still] = self.y0[flow.still, None] * t
            for j in range(self.beta.shape[1]):
                total[flow.still] += self.beta[flow.still, j, None] * t ** (j + 2) / ((j + 1) * (j + 2))
        if flow.slow.size:
            total[flow.slow] = self._by_phi(t, flow.slow, 1)
        return total

    def derivatives(self, t: np.ndarray, order: int) -> list[np.ndarray]:
        """Coordinates (n, samples) and their time derivatives."""
        y, rates = [self._coordinates(t)], self.flow.eigenvalues[:, None]
        for k, forcing in enumerate(self._forcings[:order]):
            rate = rates * y[k]
            if forcing.shape[1]:
                rate += value_at(forcing, t) if forcing.shape[1] > 1 else forcing
            y.append(rate)
        return y

    @staticmethod
    def weights(rows: np.ndarray) -> np.ndarray:
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

    is_closed = False

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

    @staticmethod
    def weights(rows: np.ndarray) -> np.ndarray:
        return np.linalg.norm(rows, axis=1)[:, None]

    def size(self, value: np.ndarray) -> np.ndarray:
        return np.linalg.norm(value, axis=0)[None, :]

    def largest_second(self, second: np.ndarray, t: np.ndarray, until: float) -> np.ndarray:
        bending = value_at(polynomial_derivatives(np.abs(self.b), 2)[2], np.array([until]))
        return (self.size(second) + (until - t) * np.linalg.norm(bending)) * np.exp(self.flow.growth * (until - t))


def integrated_square(A: np.ndarray, start: np.ndarray, rows: np.ndarray, duration: np.ndarray | float) -> np.ndarray:
    """(..., rows) ndarray: integrals of ``(row x)^2`` along ``x' = A x`` from starts, summed over the pieces.

    A is (..., n, n), the starts (..., n, pieces), rows (..., rows, n) and durations (...).

    ``x0^T W x0`` with ``W = int exp(A^T t) row^T row exp(A t) dt``, whose series over a short step is that of the Lyapunov
    operator ``X -> A^T X + X A``; doubled until it is the whole duration, as by Van Loan (IEEE Trans. Autom. Control 23
    (1978) 395-404).
    """
    size = float(np.max(duration * np.abs(A).sum(axis=-2).max(axis=-1)))
    doublings = max(0, ceil(log2(max(16.0 * size, 1.0))))
    h = np.asarray(duration)[..., None, None, None] / 2.0**doublings
    A = A[..., None, :, :]
    # where |A| h <= 1/16 so many terms leave nothing
    flow = power = np.eye(A.shape[-1])
    sums = term = h * rows[..., :, :, None] * rows[..., :, None, :]
    for k in range(1, TERMS):
        power = power @ A * (h / k)
        flow = flow + power
        half = term @ A
        term = (half + half.swapaxes(-1, -2)) * (h / (k + 1))
        sums = sums + term
    for _ in range(doublings):
        sums = sums + flow.swapaxes(-1, -2) @ sums @ flow
        flow = flow @ flow
    start = start[..., None, :, :]
    return np.sum(start * (sums @ start), axis=(-2, -1))


class Squares(NamedTuple):
    """Integrals of squares still to be found, as by `integrated_square`; each with its factor goes to a law."""

    A: np.ndarray
    start: np.ndarray
    rows: np.ndarray
    duration: float
    laws: Sequence[int]
    factors: np.ndarray

    @property
    def shape(self) -> tuple[int, ...]:
        """That of what can be integrated together."""
        return (*self.rows.shape, self.start.shape[1])


def integrated(squares: Sequence[Squares], laws: int) -> np.ndarray:
    """(squares, laws) ndarray: what each of them comes to for every law."""
    found = np.zeros((len(squares), laws))
    together = defaultdict(list)
    for place, each in enumerate(squares):
        together[each.shape].append(place)
    for places in together.values():
        A, start, rows, duration = (np.array([squares[place][i] for place in places]) for i in range(4))
        for place, each in zip(places, integrated_square(A, start, rows, duration), strict=True):
            np.add.at(found[place], squares[place].laws, squares[place].factors * each)
    return found


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
