"""What a limited torque rate makes of the margins of a loop: up to which torques they hold, and what it may keep swinging."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import control
import numpy as np
from numpy.typing import ArrayLike

from ..base.doors import called
from ..base.records import Record
from ..base.tables import number
from ..linear.schur import InPlane
from .plant import SampledPlant

# Amplitude over that at which the rate is just reached from which on the limited torque is a triangle [-].
FULL = float(np.sqrt(1.0 + 0.25 * np.pi**2))
# Values of the describing function below `FULL`; between them straight lines are within 1e-6 of it.
POINTS = 1001
# What the limiter is asked for exceeds what it gives by more than this share [-], or rounding may have made a cycle of a
# controller that follows its own command at low frequencies.
EXCEEDS = 1e-3


@called
@dataclass(frozen=True, eq=False, repr=False)
class RateMargin(Record):
    """Up to which torques the margins of a loop hold, whose actuator has a torque rate.

    Margins are those of small motions. A larger command than ``unaltered`` asks for more than the slower of the rates of
    rise and fall, and what is sent lags behind it and is less. Where that takes the loop to the limit of its stability an
    oscillation may be kept up, as the describing function of the rate has it, which leaves out harmonics: by 10 to 20 %.

    Attributes
    ----------
    rate : float
        Slower of the rates of rise and fall [N m/s].
    frequency_hz : float
        Where the disk margin is decided [Hz].
    unaltered : float
        Amplitude of the command [N m] there, up to which the rate does not touch it.
    cycle_frequency_hz, cycle_amplitude : (n,) ndarray
        Frequency [Hz] and amplitude of the command [N m] of oscillations that the rate may keep up within the torque limits,
        the least first: one that is larger grows, up to the next. None of them, and every motion of a stable loop dies out.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional(), torque_rate=1000.0)
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> pt.loop_margins(plant, controller).rate
    """

    rate: float
    frequency_hz: float
    unaltered: float
    cycle_frequency_hz: np.ndarray
    cycle_amplitude: np.ndarray

    def __repr__(self) -> str:
        reach = (
            f"margins hold for commands up to {number(self.unaltered, 3)} N m at {number(self.frequency_hz, 3)} Hz, where the "
            f"disk margin is decided: {number(self.rate)} N m/s delay larger ones"
        )
        if not self.cycle_amplitude.size:
            return f"{reach}, but keep up no oscillation"
        amplitude, frequency = number(self.cycle_amplitude[0], 2), number(self.cycle_frequency_hz[0], 2)
        return f"{reach} and, from about {amplitude} N m on, may keep up an oscillation of {frequency} Hz"


def rate_margin(
    plant: SampledPlant, controller: control.StateSpace | None, omega: np.ndarray, loop: np.ndarray
) -> RateMargin | None:
    """What the torque rate makes of the margins of a stable loop; None without a rate or without feedback.

    Parameters
    ----------
    plant : SampledPlant
    controller : control.StateSpace or None
        Linear.
    omega, loop : (N,) ndarray
        As of `LoopMargins`.
    """
    rate = min(plant.rates)
    if controller is None or not np.isfinite(rate) or not loop.any():
        return None
    reached = rate * plant.dt / (2.0 * np.sin(0.5 * omega * plant.dt))
    closest = int(np.abs((1.0 - loop) / (1.0 + loop)).argmax())
    own = _own(controller, np.exp(1j * omega * plant.dt))
    # the limiter gives what drives the plant and what the controller reads of its command: 1 - asked = (1 - own) (1 + loop)
    frequency, ratio, gain = _balanced(omega, own - (1.0 - own) * loop, plant.dt)
    amplitude = ratio * np.interp(frequency, omega, reached)
    low, high = plant.limits
    order = np.argsort(amplitude, kind="stable")
    order = order[amplitude[order] <= gain[order] * 0.5 * (high - low)]
    return RateMargin(
        rate=rate,
        frequency_hz=float(omega[closest] / (2.0 * np.pi)),
        unaltered=float(reached[closest]),
        cycle_frequency_hz=frequency[order] / (2.0 * np.pi),
        cycle_amplitude=amplitude[order],
    )


def describing_function(ratio: ArrayLike) -> np.ndarray:
    """Gain and phase with which the fundamental of a sine passes a limiter of its rate.

    The slope of a sine of ``ratio`` times the amplitude at which it just reaches the rate is ``ratio cos(theta)`` over the
    rate. From ``cos(theta) = 1 / ratio`` on, where ``tan(theta) = -s``, the limited one rises as a straight line until
    it meets the sine again, an angle t later: ``s (1 - cos(t)) = t - sin(t)``. From t = pi on, `FULL`, it is a triangle,
    of ``4 / (pi ratio)`` and the lag ``acos(pi / (2 ratio))`` (H. Duda, Flight control system design considering rate
    saturation, Aerospace Science and Technology 2 (1998) 265).

    Parameters
    ----------
    ratio : array_like
        Amplitude over that at which the rate is just reached [-], >= 0.

    Returns
    -------
    ndarray of complex
        1 up to a ratio of 1.

    Examples
    --------
    >>> describing_function([1.0, 1.5, np.pi]).round(3)
    """
    ratio = np.asarray(ratio, dtype=float)
    far = np.maximum(ratio, FULL)
    triangle = 4.0 / (np.pi * far) * np.exp(-1j * np.arccos(0.5 * np.pi / far))
    return np.where(ratio < FULL, np.interp(ratio, *_partly()), triangle)


@cache
def _partly() -> tuple[np.ndarray, np.ndarray]:
    """Ratios up to `FULL`, and the describing function there: the fundamental of the limited slope over that of the sine."""
    t = np.linspace(0.0, np.pi, POINTS)[1:]
    s = (t - np.sin(t)) / (1.0 - np.cos(t))
    ratio = np.sqrt(1.0 + s**2)
    before, after = np.exp(1j * np.arctan(s)), np.exp(1j * (np.arctan(s) - t))
    line, sine = 1j * (after - before), 0.5 * ratio * (np.pi - t + 0.5j * (before**2 - after**2))
    return np.append(1.0, ratio), np.append(1.0, 2.0 / (np.pi * ratio) * (line + sine))


def _own(controller: control.StateSpace, z: np.ndarray) -> np.ndarray:
    """From what was sent, which the controller reads a sample later, to the command."""
    labels = list(controller.input_labels)
    if "torque_limited" not in labels:
        return np.zeros(len(z), dtype=complex)
    own = [labels.index("torque_limited")]
    response = InPlane(controller.A, controller.B[:, own], controller.C).response(z) + controller.D[:, own]
    return response[:, 0, 0] / z


def _balanced(omega: np.ndarray, asked: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies [rad/s] at which the limiter is asked for the sine that it gives, ratios of amplitude, and ``asked`` there.

    That is where ``asked`` times the describing function is 1: the amplitude follows from its size, the rest from its phase.
    """
    size = np.abs(asked)
    partly, described = _partly()
    ratio = np.where(size < 0.25 * np.pi * FULL, np.interp(size, 1.0 / np.abs(described), partly), 4.0 * size / np.pi)
    # a limiter of samples turns at the first one beyond the crossing with the command: the steeper that is, the earlier
    # than in the middle of a held sample; slope is that of the command there over the rate
    slope = np.sqrt(np.maximum(ratio**2 - 0.25 * np.pi**2, 1.0))
    lag = -np.angle(describing_function(ratio)) - 0.5 * omega * dt * (1.0 - 1.0 / slope)
    ahead = np.angle(asked * np.exp(-1j * lag))
    is_possible = (size > 1.0 + EXCEEDS) & (np.abs(ahead) < 0.5 * np.pi)
    left = np.flatnonzero(((ahead >= 0.0)[:-1] != (ahead >= 0.0)[1:]) & is_possible[:-1] & is_possible[1:])
    share = ahead[left] / (ahead[left] - ahead[left + 1])

    def there(values: np.ndarray) -> np.ndarray:
        return values[left] + share * (values[left + 1] - values[left])

    return there(omega), there(ratio), there(size)
