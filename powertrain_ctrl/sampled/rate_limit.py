"""What a torque rate makes of the margins of a loop: up to which torques they hold, and what it may keep swinging."""

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
from .engaged import limits_with
from .plant import SampledPlant
from .unit import Controller, ControlUnit

# Amplitude over that at which the rate is just reached from which on the limited torque is a triangle [-].
FULL = float(np.sqrt(1.0 + 0.25 * np.pi**2))
# Ratios to that amplitude at which a disk margin is looked for; the least is found within 5 %, or 0.02 where it is small.
RATIOS = np.append([1.0, 1.05, 1.15, 1.3, 1.55], np.geomspace(FULL, 20.0, 8))
# Disk margin below which the describing function is not exact enough to rule out that an oscillation is kept up; one at
# 0.21 has been seen, of a controller that smooths its own command, which harmonics then pass.
SURE = 0.25
# Values of the describing function below `FULL`; between them straight lines are within 1e-6 of it.
POINTS = 1001
# Only where the limiter is asked for more than it sends, by more than this share [-], it may be that of a cycle: a
# controller that follows its own command at low frequencies asks for the same but for rounding.
EXCEEDS = 1e-3


@called
@dataclass(frozen=True, eq=False, repr=False)
class RateMargin(Record):
    """Up to which torques the margins of a loop hold whose actuator has a torque rate, and what is left beyond.

    Margins are those of small motions. A command of more than ``unaltered`` asks for more than the rate: what is sent lags
    behind it and is less. The describing function of the rate says what that does to a motion of any amplitude; it leaves
    out harmonics, by which phases are wrong by up to 10 deg and amplitudes mostly by up to 10 %.

    Attributes
    ----------
    rate : float
        Slowest of the rates of rise and fall [N m/s], of plant and of a unit, taken for all.
    frequency_hz : float
        Where the disk margin is decided [Hz].
    unaltered : float
        Amplitude of the command [N m] there up to which the rate does not touch it.
    disk_margin : float
        Of the loop with the describing function at the amplitude that is worst of those whose torque is within the limits,
        whatever the rate; 0 if there is a cycle.
    cycle_frequency_hz, cycle_amplitude : (n,) ndarray
        Frequency [Hz] and amplitude of the command [N m] of the oscillations that the rate keeps up, the least amplitude
        first: a smaller motion dies out, a larger one grows up to the next.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional(), torque_rate=1000.0)
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> margin = pt.loop_margins(plant, controller).rate
    >>> round(margin.unaltered, 1), round(margin.frequency_hz, 2), round(margin.disk_margin, 2)
    (40.6, 3.93, 0.59)
    """

    rate: float
    frequency_hz: float
    unaltered: float
    disk_margin: float
    cycle_frequency_hz: np.ndarray
    cycle_amplitude: np.ndarray

    def __repr__(self) -> str:
        reach, frequency = number(self.unaltered, 3), number(self.frequency_hz, 3)
        small = (
            f"margins hold for commands up to {reach} N m at {frequency} Hz, where the disk margin is decided; "
            f"beyond, the rate of {number(self.rate)} N m/s"
        )
        if self.cycle_amplitude.size:
            least, frequency = number(self.cycle_amplitude[0], 2), number(self.cycle_frequency_hz[0], 2)
            return f"{small} may keep up an oscillation of {frequency} Hz from about {least} N m on"
        left = f"{small} leaves a disk margin of about {number(self.disk_margin, 2)}"
        return left if self.disk_margin >= SURE else f"{left}, too little to rule out an oscillation that it keeps up"


def rate_margin(
    plant: SampledPlant, controller: Controller, own: control.StateSpace | None, omega: np.ndarray, loop: np.ndarray
) -> RateMargin | None:
    """What the torque rate of a plant or a unit makes of the margins of a stable loop; None without rate or feedback.

    What the limiter sends drives the plant and, if the controller reads ``torque_limited``, the controller too. Where both
    together ask for the very sine of which that was sent, the rate keeps it up (harmonic balance). Of the limiter of a plant
    a unit's controller is not told, of the unit's own it is; of the two the slower one counts.

    Parameters
    ----------
    plant : SampledPlant
    controller : ControlUnit, control.StateSpace or None
    own : control.StateSpace or None
        The controller of the plant's ratio, linear.
    omega, loop : (N,) ndarray
        As of `LoopMargins`.
    """
    within = min(controller.rates) if isinstance(controller, ControlUnit) else np.inf
    rate, dt = min(*plant.rates, within), plant.dt
    if own is None or not np.isfinite(rate) or not loop.any():
        return None
    reached = rate * dt / (2.0 * np.sin(0.5 * omega * dt))
    closest = int(np.abs((1.0 - loop) / (1.0 + loop)).argmax())
    # 1 - asked = (1 - told) (1 + loop), for the loop of small motions has the controller's own command closed inside
    is_told = not isinstance(controller, ControlUnit) or within == rate
    told = _told(own, np.exp(1j * omega * dt)) if is_told else np.zeros_like(loop)
    asked = told - (1.0 - told) * loop
    size = np.abs(asked)
    # last the ratio at which the limiter sends as much as it is asked for, so that only phases are left to agree
    ratios = RATIOS[:, None], _ratio(size)
    amplitude = np.vstack([ratio * reached for ratio in ratios])
    described = np.vstack([describing_function(ratio, omega * dt) for ratio in ratios])
    low, high = limits_with(plant, controller)
    is_possible = amplitude * np.abs(described) <= 0.5 * (high - low)
    is_possible[0] = True  # small motions always are
    balance = described * asked
    # with the describing function the loop is (described told - balance) / (1 - described told)
    worst = np.abs((1.0 + balance - 2.0 * described * told) / (1.0 - balance))[is_possible].max()
    may = is_possible[-1] & (size > 1.0 + EXCEEDS)
    frequency, cycle = _cycles(np.angle(balance[-1]), may, omega / (2.0 * np.pi), amplitude[-1])
    return RateMargin(
        rate=rate,
        frequency_hz=float(omega[closest] / (2.0 * np.pi)),
        unaltered=float(reached[closest]),
        disk_margin=0.0 if cycle.size else float(2.0 / worst),
        cycle_frequency_hz=frequency,
        cycle_amplitude=cycle,
    )


def _cycles(phase: np.ndarray, may: np.ndarray, frequency: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    """Frequencies and amplitudes (2, n) at which the phase is zero, the least amplitude first."""
    above, may = phase >= 0.0, may & (np.abs(phase) < 0.5 * np.pi)
    left = np.flatnonzero((above[:-1] != above[1:]) & may[:-1] & may[1:])
    share = phase[left] / (phase[left] - phase[left + 1])
    found = np.array([x[left] + share * (x[left + 1] - x[left]) for x in (frequency, amplitude)])
    return found[:, np.argsort(found[1], kind="stable")]


def describing_function(ratio: ArrayLike, angle: ArrayLike = 0.0) -> np.ndarray:
    """Gain and phase with which the fundamental of a sine passes a limiter of its rate.

    The slope of a sine of ``ratio`` times the amplitude at which it just reaches the rate is ``ratio cos(theta)`` over the
    rate. From ``cos(theta) = 1 / ratio`` on, where ``tan(theta) = -s``, the limited one rises as a straight line until
    it meets the sine again, an angle t later: ``s (1 - cos(t)) = t - sin(t)``. From t = pi on, `FULL`, it is a triangle,
    of ``4 / (pi ratio)`` and the lag ``acos(pi / (2 ratio))`` (H. Duda, J. Guidance, Control, and Dynamics 20 (1997) 581).

    The triangle of a limiter of samples turns at the first sample beyond its crossing with the sine; to first order in the
    angle of a sample that is ``angle (1 - 1 / m) / 2`` earlier, m the slope of the sine there over the rate.

    Parameters
    ----------
    ratio : array_like
        Amplitude over that at which the rate is just reached [-], >= 0.
    angle : array_like
        Of the sine from sample to sample [rad]; 0 without samples.

    Returns
    -------
    ndarray of complex
        1 up to a ratio of 1.

    Examples
    --------
    >>> describing_function([1.0, 1.5, np.pi]).round(3)
    array([1.   +0.j   , 0.807-0.228j, 0.203-0.351j])
    """
    ratio = np.asarray(ratio, dtype=float)
    far = np.maximum(ratio, FULL)
    slope = np.sqrt(far**2 - 0.25 * np.pi**2)
    lag = np.arccos(0.5 * np.pi / far) - 0.5 * np.asarray(angle) * (1.0 - 1.0 / slope)
    triangle = 4.0 / (np.pi * far) * np.exp(-1j * lag)
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


def _told(controller: control.StateSpace, z: np.ndarray) -> np.ndarray:
    """From what was sent, which the controller reads a sample later, to the command."""
    labels = list(controller.input_labels)
    if "torque_limited" not in labels:
        return np.zeros(len(z), dtype=complex)
    own = [labels.index("torque_limited")]
    response = InPlane(controller.A, controller.B[:, own], controller.C).response(z) + controller.D[:, own]
    return response[:, 0, 0] / z


def _ratio(size: np.ndarray) -> np.ndarray:
    """Ratio at which the describing function is one over a size >= 1."""
    partly, described = _partly()
    return np.where(size < 0.25 * np.pi * FULL, np.interp(size, 1.0 / np.abs(described), partly), 4.0 * size / np.pi)
