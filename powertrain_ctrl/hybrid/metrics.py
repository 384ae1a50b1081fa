"""Ride metrics of a vehicle acceleration."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import Acceleration, Seconds
from ..base.doors import called, checked
from ..base.errors import PowertrainError, SignalError
from ..base.tables import Printed
from .bandpass import band_passed

# Band in which people feel the shuffle [Hz], order of the Butterworth filter run forward and backward.
BAND, ORDER = (1.0, 10.0), 2
# What is within this share of the final value of a level has reached it, and two peaks are as high.
REACHED = 1e-9
# Signals whose metrics are taken together, so that they stay near the processor.
TOGETHER = 64
# Times this much of a spacing apart are one.
SAME_INSTANT = 1e-6


@called
@dataclass(frozen=True, repr=False)
class RideMetrics(Printed):
    """How an acceleration settles to its final value.

    Attributes
    ----------
    final : float
        Final acceleration a_ss [m/s^2].
    overshoot : float
        Highest value above the final one, over the final one [-].
    peak_to_peak : float
        Highest peak minus the lowest trough after it, over the final value [-]; 0 if it never falls.
    peak_jerk : float
        Largest magnitude of the derivative [m/s^3].
    vdv : float
        Vibration dose value, fourth root of the integral of the fourth power, of the 1-10 Hz band-passed acceleration
        [m/s^1.75]; a wanted rise has one too, about 0.7 here.
    rms : float
        Root mean square of the same [m/s^2].
    t50, t90, t10_90 : float
        From the start of the manoeuvre to 50 % and 90 % of the final value, and from 10 % to 90 % [s].
    settling : float
        Until it stays within 5 % [s]; the length of the window if it never does.

    Examples
    --------
    A vibration of 2.6 Hz with damping ratio 0.1 overshoots by ``p = exp(-pi 0.1 / sqrt(1 - 0.1^2)) = 0.729``; from its
    peak to the trough after it are ``p + p^2 = 1.261``:

    >>> import numpy as np, powertrain_ctrl as pt
    >>> t, pole = np.linspace(0.0, 3.0, 3001), 2.0 * np.pi * 2.6 * (-0.1 + 1j * np.sqrt(1.0 - 0.1**2))
    >>> acceleration = 1.0 - (np.exp(pole * t) * (1.0 + 1j * pole.real / pole.imag)).real
    >>> metrics = pt.ride_metrics(t, acceleration, final=1.0)
    >>> round(metrics.overshoot, 3), round(metrics.peak_to_peak, 3)
    (0.729, 1.261)
    """

    final: float
    overshoot: float
    peak_to_peak: float
    peak_jerk: float
    vdv: float
    rms: float
    t50: float
    t90: float
    t10_90: float
    settling: float

    headers = ("metric", "value", "unit")
    UNITS = ("m/s^2", "-", "-", "m/s^3", "m/s^1.75", "m/s^2", "s", "s", "s", "s")

    def rows(self) -> list[list[str]]:
        """Rows of the printed table."""
        return [
            [f.name, f"{getattr(self, f.name):.4g}", unit] for f, unit in zip(fields(self), self.UNITS, strict=True)
        ]


@checked
def ride_metrics(time: ArrayLike, acceleration: ArrayLike, final: Acceleration, start: Seconds = 0.0) -> RideMetrics:
    """Metrics of an acceleration that goes from 0 to a final value.

    The window is all of ``time`` from ``start`` on. The 1-10 Hz band-pass is a Butterworth filter of order 2, run forward
    and backward, so without phase; the acceleration is continued by its end values.

    Parameters
    ----------
    time, acceleration : (N,) array_like
        [s] evenly spaced, by less than 50 ms; [m/s^2].
    final : float
        Final acceleration [m/s^2], not 0; a negative one (tip-out) turns everything round.
    start : float
        When the manoeuvre begins [s].

    Returns
    -------
    RideMetrics

    Raises
    ------
    SignalError
        Times that are not evenly spaced or not as many as accelerations, an acceleration that is not finite.
    PowertrainError
        A final acceleration of 0.

    Examples
    --------
    Of a lag of 0.1 s, 90 % after ``0.1 ln 10`` and from 10 % to 90 % in ``0.1 ln 9``:

    >>> import numpy as np, powertrain_ctrl as pt
    >>> t = np.linspace(0, 3, 3001)
    >>> metrics = pt.ride_metrics(t, 1 - np.exp(-t / 0.1), final=1.0)
    >>> round(metrics.t90, 3), round(metrics.t10_90, 3)
    (0.23, 0.22)
    """
    time, acceleration = np.asarray(time, dtype=float), np.asarray(acceleration, dtype=float)
    if time.ndim != 1 or time.shape != acceleration.shape or len(time) < 2:
        raise SignalError(
            f"times {time.shape} and accelerations {acceleration.shape}, permitted: as many of each, >= 2"
        )
    if not np.isfinite(acceleration).all():
        raise SignalError(f"the acceleration is not finite at t = {time[~np.isfinite(acceleration)][0]:g} s")
    if not final or not np.isfinite(final):
        raise PowertrainError(f"final = {final:g} m/s^2, permitted: not 0 and finite")
    found = metrics_of(time, acceleration[None], np.array([final]), start)
    return RideMetrics(**{name: float(value[0]) for name, value in found.items()})


def metrics_of(time: np.ndarray, acceleration: np.ndarray, final: np.ndarray, start: float) -> dict[str, np.ndarray]:
    """Fields of `RideMetrics` (n,) of many accelerations (n, N), each with its final value (n,)."""
    spacing = np.diff(time)
    if (np.abs(spacing - spacing[0]) > SAME_INSTANT * spacing[0]).any() or not 0.0 < spacing[0] < 0.5 / BAND[1]:
        raise SignalError(
            f"times {spacing.min():g} to {spacing.max():g} s apart, permitted: evenly spaced, by less than 50 ms"
        )
    dt = float(spacing[0])
    inside = time >= start - SAME_INSTANT * dt
    if np.count_nonzero(inside) < 2:
        raise SignalError(f"start = {start:g} s, permitted: before the end at {time[-1]:g} s")
    first = int(inside.argmax())
    t = time[first:] - start
    parts = [
        _metrics(t, acceleration[i : i + TOGETHER], final[i : i + TOGETHER, None], first, dt)
        for i in range(0, len(acceleration), TOGETHER)
    ]
    return {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def _metrics(
    t: np.ndarray, acceleration: np.ndarray, final: np.ndarray, first: int, dt: float
) -> dict[str, np.ndarray]:
    felt = band_passed(acceleration, dt, ORDER, BAND)[:, first:]
    felt *= felt
    a = acceleration[:, first:] / final
    highest = a.max(axis=1, keepdims=True)
    is_outside = (a > 1.05 + REACHED) | (a < 0.95 - REACHED)
    last = len(t) - 1 - is_outside[:, ::-1].argmax(axis=1)
    t10, t50, t90 = (first_time(t, a, level) for level in (0.1, 0.5, 0.9))
    squares, change = felt.sum(axis=1), np.diff(acceleration[:, first:], axis=1)
    felt *= felt
    return {
        "final": final[:, 0],
        "overshoot": np.maximum(highest[:, 0] - 1.0, 0.0),
        "peak_to_peak": first_fall(a, highest),
        "peak_jerk": np.maximum(change.max(axis=1), -change.min(axis=1)) / dt,
        "vdv": (felt.sum(axis=1) * dt) ** 0.25,
        "rms": np.sqrt(squares / len(t)),
        "t50": t50,
        "t90": t90,
        "t10_90": t90 - t10,
        "settling": np.where(is_outside.any(axis=1), t[np.minimum(last + 1, len(t) - 1)], 0.0),
    }


def first_time(t: np.ndarray, a: np.ndarray, level: float) -> np.ndarray:
    """When each signal first reaches a level, by straight lines between samples; nan if it never does."""
    reached = a >= level - REACHED
    i = reached.argmax(axis=1)
    each = np.arange(len(a))
    before = np.maximum(i - 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.minimum((level - a[each, before]) / (a[each, i] - a[each, before]), 1.0)
        found = np.where(i == 0, t[0], t[before] + share * (t[i] - t[before]))
    return np.where(reached[each, i], found, np.nan)


def first_fall(a: np.ndarray, highest: np.ndarray) -> np.ndarray:
    """Highest peak, the first of those as high, minus the lowest trough after it."""
    peak = (a >= highest - REACHED).argmax(axis=1)
    return np.array([row[i] - row[i:].min() for row, i in zip(a, peak, strict=True)])
