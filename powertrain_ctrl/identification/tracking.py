"""Whether a peak goes with a speed or stays where it is: order or mode."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..base.checks import Period
from ..base.doors import called, checked
from ..base.errors import PowertrainError, SignalError
from ..base.records import Record
from ..base.tables import html_table, text_table
from ..base.units import to_hz, to_rpm
from .decay import FEWEST, left_of

# Speeds have to differ by this part for an order to be told from a mode.
SWEEP = 0.05
# An exponent of frequency over speed this many standard errors from 0 or 1 is not that.
SURE = 3.0
# Stretches overlap by half; their number, and cycles that each has to hold.
STRETCHES, CYCLES = 16, 6.0


@called
@dataclass(frozen=True, eq=False, repr=False)
class Tracked(Record):
    """How the strongest frequency of a signal goes with a speed: order of a rotation, or mode.

    Attributes
    ----------
    kind : {"order", "mode", "neither"}
        "order" if the frequency is proportional to the speed, "mode" if it stays where it is.
    exponent, exponent_error : float
        Of frequency over speed, 1 for an order and 0 for a mode, and its standard error.
    order : float
        Frequency / rotation frequency, the median of the stretches [-].
    frequency_hz : float
        Median of the stretches [Hz].
    time, speed, frequency : (stretches,) ndarray
        Middle of each stretch [s], speed [rad/s] and strongest frequency [Hz].

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> t = np.arange(0.0, 20.0, 0.002)
    >>> speed = pt.rpm(1000.0 + 60.0 * t)
    >>> turned = pt.rpm(1000.0 * t + 30.0 * t**2)
    >>> found = pt.order_tracking(np.sin(2.0 * turned), 0.002, speed)
    >>> found.kind, round(found.order, 2)
    ('order', 2.0)
    """

    kind: str
    exponent: float
    exponent_error: float
    order: float
    frequency_hz: float
    time: np.ndarray
    speed: np.ndarray
    frequency: np.ndarray

    def __repr__(self) -> str:
        what = {
            "order": f"order {self.order:.3f}",
            "mode": f"mode at {self.frequency_hz:.3f} Hz",
            "neither": "neither an order nor a mode",
        }[self.kind]
        heading = f"{what}: frequency goes with speed to the {self.exponent:.3f} (+- {self.exponent_error:.3f})"
        return "\n".join([heading, text_table(*self._table())])

    def _repr_html_(self) -> str:
        return html_table(*self._table())

    def _table(self) -> tuple[list[str], list[list[str]]]:
        rows = [
            [f"{t:.2f}", f"{to_rpm(w):.1f}", f"{f:.3f}", f"{f / to_hz(w):.3f}"]
            for t, w, f in zip(self.time, self.speed, self.frequency, strict=True)
        ]
        return ["t [s]", "speed [rpm]", "f [Hz]", "order"], rows


@checked
def order_tracking(signal: np.ndarray, dt: Period, speed: np.ndarray) -> Tracked:
    """Whether the strongest oscillation of a run-up is an order of a rotation or a mode.

    The run is cut into stretches; in each the strongest frequency is found. That of an order is proportional to the speed,
    that of a mode does not know it: the exponent between them, by least squares in logarithms, tells.

    Parameters
    ----------
    signal : (N,) array_like
        Samples of what oscillates.
    dt : float
        Sample time [s].
    speed : (N,) array_like
        Of the rotation [rad/s], > 0, changing by a twentieth or more.

    Returns
    -------
    Tracked

    Raises
    ------
    SignalError
        Arrays of other lengths, a speed that is not positive, or too short a run.
    PowertrainError
        A speed that is constant: an order and a mode then look the same.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> t = np.arange(0.0, 20.0, 0.002)
    >>> pt.order_tracking(np.sin(2.0 * np.pi * 22.7 * t), 0.002, pt.rpm(1000.0 + 60.0 * t)).kind
    'mode'
    """
    if signal.ndim != 1 or speed.shape != signal.shape:
        raise SignalError(f"signal of shape {signal.shape}, speed of shape {speed.shape}, permitted: (N,) both")
    if not (speed > 0.0).all():
        raise SignalError(f"speed is {speed[~(speed > 0.0)][0]:g} rad/s, permitted: > 0")
    if speed.max() < (1.0 + SWEEP) * speed.min():
        raise PowertrainError(
            f"speed goes from {speed.min():g} to {speed.max():g} rad/s, permitted: a change by {100 * SWEEP:g} % or more; "
            "at constant speed an order and a mode look the same"
        )
    length = 2 * len(signal) // (STRETCHES + 1)
    if length < FEWEST:
        raise SignalError(f"{len(signal)} samples, permitted: at least {FEWEST * (STRETCHES + 1) // 2 + 1}")
    firsts = range(0, len(signal) - length + 1, length // 2)
    found = np.array([_strongest(signal[i : i + length], dt) for i in firsts])
    speeds = np.array([speed[i : i + length].mean() for i in firsts])
    times = np.array([(i + 0.5 * length) * dt for i in firsts])
    usable = found * length * dt >= CYCLES
    if np.count_nonzero(usable) < 4:
        raise SignalError(
            f"{len(signal) * dt:g} s hold too few cycles of the strongest frequency, permitted: a longer run-up"
        )
    found, speeds, times = found[usable], speeds[usable], times[usable]
    x = np.log(speeds) - np.log(speeds).mean()
    y = np.log(found)
    slope = float(x @ y / (x @ x))
    left = y - y.mean() - slope * x
    # no finer than a hundredth of what a stretch resolves
    floor = 0.01 / (found.mean() * length * dt)
    error = float(np.sqrt(max(left @ left / (len(x) - 2), floor**2) / (x @ x)))
    kind = "neither"
    if abs(slope - 1.0) <= SURE * error < 0.5:
        kind = "order"
    elif abs(slope) <= SURE * error < 0.5:
        kind = "mode"
    return Tracked(
        kind=kind,
        exponent=slope,
        exponent_error=error,
        order=float(np.median(found / to_hz(speeds))),
        frequency_hz=float(np.median(found)),
        time=times,
        speed=speeds,
        frequency=found,
    )


def _strongest(signal: np.ndarray, dt: float) -> float:
    """Frequency [Hz] of the highest peak of a windowed spectrum, between its lines by a parabola in logarithms."""
    n = np.arange(len(signal))
    plain = left_of(np.column_stack([np.ones(len(n)), n]), signal)
    size = 4 * len(signal)
    spectrum = np.abs(np.fft.rfft(plain * np.hanning(len(signal)), size))
    k = int(spectrum[1:-1].argmax()) + 1
    a, b, c = np.log(np.maximum(spectrum[k - 1 : k + 2], np.finfo(float).tiny))
    bend = a - 2.0 * b + c
    return float((k + (0.5 * (a - c) / bend if bend < 0.0 else 0.0)) / (size * dt))
