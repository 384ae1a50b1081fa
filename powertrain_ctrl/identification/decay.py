"""Frequency and damping of a decaying oscillation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.linalg
import scipy.optimize

from ..base.checks import Period
from ..base.doors import called, checked
from ..base.errors import PowertrainError, SignalError
from ..base.records import Record
from ..base.tables import Listed
from ..base.units import to_hz

# Fewer samples than this do not tell an oscillation from its offset and drift.
FEWEST = 16
# Of the candidates of a matrix pencil, in descending size.
CANDIDATES = 4
# What dies out faster than this a sample is no oscillation that samples see.
FASTEST_DECAY, MOST_STEPS = 3.0, 200
# A fit has to take away this part of what offset and drift leave, else there is no oscillation.
OSCILLATES = 0.5
# What changes by less than this part of its size is constant.
CONSTANT = 1e-9


@called
@dataclass(frozen=True, eq=False, repr=False)
class RingDown(Listed, Record):
    """One decaying oscillation: frequency and damping with their standard errors.

    Attributes
    ----------
    frequency_hz, damping_ratio : float
        Undamped natural frequency [Hz]; damping ratio [-].
    frequency_error, damping_error : float
        Their standard errors, the residuals taken as white [Hz], [-].
    time, signal, model : (N,) ndarray
        What was fitted [s], and the oscillation with its offset and drift.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> t = np.arange(0.0, 2.0, 0.01)
    >>> pt.ring_down(0.3 + np.exp(-2.0 * t) * np.cos(20.0 * t), 0.01)
    RingDown: f = 3.1990 Hz (+- 0.0000), zeta = 0.0995 (+- 0.0000)
    """

    frequency_hz: float
    damping_ratio: float
    frequency_error: float
    damping_error: float
    time: np.ndarray
    signal: np.ndarray
    model: np.ndarray

    UNITS: ClassVar[Mapping[str, str]] = {"frequency_hz": "Hz", "frequency_error": "Hz"}

    @property
    def pole(self) -> complex:
        """``-zeta w + j w sqrt(1 - zeta^2)`` [rad/s]."""
        omega = self.frequency_hz / to_hz(1.0)
        return complex(-self.damping_ratio * omega, omega * np.sqrt(1.0 - self.damping_ratio**2))

    def __repr__(self) -> str:
        return (
            f"RingDown: f = {self.frequency_hz:.4f} Hz (+- {self.frequency_error:.4f}), "
            f"zeta = {self.damping_ratio:.4f} (+- {self.damping_error:.4f})"
        )


@checked
def ring_down(signal: np.ndarray, dt: Period) -> RingDown:
    """Frequency and damping of one oscillation that dies out, by least squares together with its offset and drift.

    Take the stretch behind a tip-in or tip-out, best of the difference of two speeds, in which one mode is left. Least
    squares use every sample; a logarithmic decrement of a well damped driveline has two extrema above the noise.

    Parameters
    ----------
    signal : (N,) array_like
        Samples, N >= 16.
    dt : float
        Sample time [s].

    Returns
    -------
    RingDown

    Raises
    ------
    SignalError
        Fewer samples, or a constant signal.
    PowertrainError
        A signal in which nothing oscillates and dies out.

    Notes
    -----
    ``y = exp(-sigma t) (a cos w t + b sin w t) + c + d t``, started from a matrix pencil (Hua, Sarkar, IEEE Trans. Acoust.
    Speech Signal Process. 38 (1990) 814-824); a, b, c, d enter linearly and are eliminated. The errors are those of white
    noise.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> t, w = np.arange(0.0, 2.0, 0.01), 2.0 * np.pi * 3.0
    >>> found = pt.ring_down(np.exp(-0.1 * w * t) * np.sin(np.sqrt(0.99) * w * t), 0.01)
    >>> round(found.frequency_hz, 9), round(found.damping_ratio, 9)
    (3.0, 0.1)
    """
    if signal.ndim != 1 or len(signal) < FEWEST:
        raise SignalError(f"ring_down: signal of shape {signal.shape}, permitted: (N,) with N >= {FEWEST}")
    if np.ptp(signal) <= CONSTANT * np.abs(signal).max():
        raise SignalError("ring_down: the signal does not change, permitted: one that oscillates")
    # in samples, and in its own size
    n, y = np.arange(len(signal), dtype=float), (signal - signal.mean()) / np.ptp(signal)
    drift = np.column_stack([np.ones_like(n), n / len(n)])
    plain = left_of(drift, y)
    starts = _pencil(plain) if np.linalg.norm(plain) > CONSTANT * np.linalg.norm(y) else []
    fits = [_fitted(start, n, y, drift) for start in starts]
    best = min(fits, key=lambda fit: fit.cost, default=None)
    if best is None or 2.0 * best.cost > OSCILLATES * (plain @ plain):
        raise PowertrainError(
            "ring_down: nothing in the signal oscillates and dies out; take the stretch behind a tip-in"
        )
    sigma, omega = best.x / dt
    size = np.hypot(sigma, omega)
    information = best.jac.T @ best.jac
    covariance = np.linalg.inv(information) * (2.0 * best.cost / (len(n) - 6)) / dt**2
    of_size = np.array([sigma, omega]) / size
    of_ratio = np.array([omega**2, -sigma * omega]) / size**3
    return RingDown(
        frequency_hz=float(to_hz(size)),
        damping_ratio=float(sigma / size),
        frequency_error=float(to_hz(np.sqrt(of_size @ covariance @ of_size))),
        damping_error=float(np.sqrt(of_ratio @ covariance @ of_ratio)),
        time=n * dt,
        signal=signal,
        model=(y - best.fun) * np.ptp(signal) + signal.mean(),
    )


def _fitted(start: complex, n: np.ndarray, y: np.ndarray, drift: np.ndarray) -> scipy.optimize.OptimizeResult:
    """Decay and frequency per sample with the least residual."""

    def waves(p: np.ndarray) -> np.ndarray:
        decay = np.exp(-p[0] * n)
        return np.column_stack([decay * np.cos(p[1] * n), decay * np.sin(p[1] * n)])

    def residual(p: np.ndarray) -> np.ndarray:
        return left_of(np.hstack([waves(p), drift]), y)

    def jacobian(p: np.ndarray) -> np.ndarray:
        # of what the linear shares cannot take up (Kaufman): exact where nothing is left
        wave = waves(p)
        basis = np.hstack([wave, drift])
        a, b = np.linalg.lstsq(basis, y, rcond=None)[0][:2]
        by_sigma, by_omega = -n * (wave @ [a, b]), n * (wave @ [b, -a])
        return -left_of(basis, np.column_stack([by_sigma, by_omega]))

    low, high = np.array([-1.0 / len(n), 1e-6]), np.array([FASTEST_DECAY, np.pi])
    first = np.clip([-start.real, start.imag], low + 1e-9, high - 1e-9)
    return scipy.optimize.least_squares(
        residual,
        first,
        jacobian,
        bounds=(low, high),
        x_scale="jac",
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        max_nfev=MOST_STEPS,
    )


def left_of(basis: np.ndarray, y: np.ndarray) -> np.ndarray:
    """What a basis leaves of y."""
    return y - basis @ np.linalg.lstsq(basis, y, rcond=None)[0]


def _pencil(y: np.ndarray) -> list[complex]:
    """Rates per sample of the oscillations that a matrix pencil finds, with positive frequency."""
    length = len(y) // 3
    hankel = scipy.linalg.hankel(y[: len(y) - length], y[len(y) - length - 1 :])
    V = np.linalg.svd(hankel, full_matrices=False)[2][:CANDIDATES].T
    z = np.linalg.eigvals(np.linalg.lstsq(V[:-1], V[1:], rcond=None)[0]).astype(complex)
    rates = np.log(z[z != 0.0])
    return [complex(rate) for rate in rates if rate.imag > 0.0]
