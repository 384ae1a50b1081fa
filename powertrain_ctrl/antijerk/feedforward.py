"""Feedforward: command torques that do not excite the first mode."""

from __future__ import annotations

import control
import numpy as np

from ..base.checks import Frequency, Positive
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError
from ..base.systems import linear_system
from ..reduction.twomass import TwoMass
from ..sampled.plant import SAME_INSTANT, SampledPlant
from .parts import FEEDFORWARD, sampled_filter

# With a damping ratio from here on a mode has no period to shape by: half of it leaves 3e-10 of a motion.
SHAPED = 0.99


@checked
def inverse_notch(
    plant: SampledPlant, model: TwoMass, damping_ratio: Positive = 0.7, frequency_hz: Frequency = 4.0
) -> control.StateSpace:
    """Exchange the poles of the first mode for well damped ones: ``(s^2 + 2 z1 w1 s + w1^2) / (s^2 + 2 z w s + w^2)``.

    Parameters
    ----------
    plant : SampledPlant
    model : TwoMass
        Its frequency w1 and damping ratio z1 are cancelled.
    damping_ratio, frequency_hz : float
        z [-] and w [Hz] of the new poles, > 0; a faster pole asks for more torque.

    Returns
    -------
    control.StateSpace
        From ``torque_demand`` to ``feedforward_torque`` [N m], gain 1 at steady state.

    Raises
    ------
    ParameterError
        A damping ratio or frequency that is not > 0 and finite, a frequency not below the Nyquist frequency.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> round(float(pt.antijerk.inverse_notch(plant, pt.two_mass(plant.car)).dcgain()), 9)
    1.0
    """
    nyquist = 0.5 / plant.dt
    for name, f in (("frequency_hz", frequency_hz), ("frequency of the model", model.frequency_hz)):
        if not f < nyquist:
            raise ParameterError("inverse notch", name, f, "Hz", f"below Nyquist, {nyquist:g} Hz")
    w1, w = model.omega, 2.0 * np.pi * frequency_hz
    numerator = np.array([1.0, 2.0 * model.damping_ratio * w1, w1**2]) * (w / w1) ** 2
    return _named(sampled_filter(numerator, [1.0, 2.0 * damping_ratio * w, w**2], plant.dt, prewarp=w1), plant)


@checked
def zv_shaper(plant: SampledPlant, model: TwoMass) -> control.StateSpace:
    """Two impulses half a period of the first mode apart that leave no residual vibration.

    N. C. Singer, W. P. Seering, J. Dyn. Sys. Meas. Control 112 (1990) 76. An instant between two samples is shared
    by both of them.

    Parameters
    ----------
    plant : SampledPlant
        Its sample time counts.
    model : TwoMass
        Its frequency and damping ratio, below 0.99, count.

    Returns
    -------
    control.StateSpace
        From ``torque_demand`` to ``feedforward_torque`` [N m], gain 1 at steady state.

    Examples
    --------
    The first impulse, and the second between the 19th and the 20th sample after it, half a period of 2.6 Hz:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> shaper = pt.antijerk.zv_shaper(plant, pt.two_mass(plant.car))
    >>> round(float(shaper.D[0, 0]), 3), shaper.C[0, -2:].round(3)
    (0.577, array([0.402, 0.021]))
    """
    return _shaper(plant, model, derivatives=0)


@checked
def zvd_shaper(plant: SampledPlant, model: TwoMass) -> control.StateSpace:
    """Three impulses over a period; less sensitive to the frequency than `zv_shaper`, and slower.

    Of Singer and Seering too: the derivative of the residual vibration by the frequency is zero as well.

    Parameters
    ----------
    plant, model : SampledPlant, TwoMass
        As in `zv_shaper`.

    Returns
    -------
    control.StateSpace
        As of `zv_shaper`.

    Examples
    --------
    What either shaper leaves of a first mode that is 10 % faster than its model:

    >>> import numpy as np, powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> model = pt.two_mass(plant.car)
    >>> z = np.exp(1.1 * pt.poles(model)[-1] * plant.dt)
    >>> [round(float(abs(shaper(plant, model)(z))), 3) for shaper in (pt.antijerk.zv_shaper, pt.antijerk.zvd_shaper)]
    [0.184, 0.034]
    """
    return _shaper(plant, model, derivatives=1)


def _shaper(plant: SampledPlant, model: TwoMass, derivatives: int) -> control.StateSpace:
    zeta = model.damping_ratio
    if zeta >= SHAPED:
        raise PowertrainError(
            f"the design model has zeta = {zeta:.3g}, so no period to shape by, permitted: < {SHAPED}"
        )
    decay = np.exp(-zeta * np.pi / np.sqrt(1.0 - zeta**2))
    half_period = np.pi / (model.omega * np.sqrt(1.0 - zeta**2))
    impulses = np.array([1.0])
    for _ in range(derivatives + 1):
        impulses = np.convolve(impulses, [1.0, decay])
    impulses /= impulses.sum()
    positions = half_period * np.arange(len(impulses)) / plant.dt
    # one that rounding has moved off a sample is at the sample, so that it needs no tap more
    positions = np.where(np.abs(positions - np.round(positions)) < SAME_INSTANT, np.round(positions), positions)
    taps = np.zeros(int(np.ceil(positions[-1])) + 2)
    for size, position in zip(impulses, positions, strict=True):
        before = int(position)
        taps[before] += size * (1.0 - (position - before))
        taps[before + 1] += size * (position - before)
    taps = np.trim_zeros(taps, "b")
    n = len(taps) - 1
    return _named(linear_system(np.eye(n, k=-1), np.eye(n, 1), taps[None, 1:], [[taps[0]]], dt=plant.dt), plant)


def _named(system: control.StateSpace, plant: SampledPlant) -> control.StateSpace:
    return linear_system(
        system.A, system.B, system.C, system.D, dt=plant.dt, inputs=["torque_demand"], outputs=[FEEDFORWARD]
    )
