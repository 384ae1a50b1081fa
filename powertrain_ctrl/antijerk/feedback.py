"""Feedback without a plant model: speed difference, and engine speed against a rigid reference."""

from __future__ import annotations

import control
import numpy as np

from ..base.checks import Frequency, Period, Positive, SpeedGain
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError
from ..base.systems import linear_system
from ..sampled.plant import SampledPlant, is_sampled_every
from .parts import feedback_system, sampled_filter


@checked
def speed_difference(
    plant: SampledPlant, gain: SpeedGain = 6.0, shaping: control.StateSpace | None = None
) -> control.StateSpace:
    """Feedback on the twist rate: ``intervention = -gain * shaping * (engine_speed - ratio * wheels_speed)``.

    Parameters
    ----------
    plant : SampledPlant
    gain : float
        [N m s/rad], > 0.
    shaping : control.StateSpace, optional
        Discrete filter with one input, one output and the plant's sample time, e.g. `lead_notch`.

    Returns
    -------
    control.StateSpace
        From ``engine_speed`` and ``wheels_speed`` [rad/s] to ``torque_intervention`` [N m].

    Raises
    ------
    ParameterError
        A gain that is not > 0 and finite.
    PowertrainError
        A filter with another sample time.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> pt.antijerk.speed_difference(plant, gain=6.0).D.round(9)
    array([[ -6., 108.]])
    """
    row = -gain * np.array([[1.0, -plant.ratio]])
    inputs = ("engine_speed", "wheels_speed")
    if shaping is not None and not is_sampled_every(plant.dt, shaping):
        raise PowertrainError(f"the shaping filter has dt = {shaping.dt} s, permitted: {plant.dt:g} s as the plant")
    if shaping is None:
        return feedback_system(np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), row, plant.dt, inputs)
    return feedback_system(shaping.A, shaping.B @ row, shaping.C, shaping.D @ row, plant.dt, inputs)


@checked
def lead_notch(
    plant: SampledPlant,
    lead: tuple[Period, Period] | None = (0.03, 0.01),
    notch_hz: Frequency | None = None,
    notch_damping: tuple[Positive, Positive] = (0.1, 0.5),
) -> control.StateSpace:
    """Shaping filter ``(T1 s + 1) / (T2 s + 1)`` with a notch at the second mode, by Tustin's rule.

    The lead makes up for the phase of actuator and delay at the first mode; the notch keeps the gain off a mode that no
    two-mass model has.

    Parameters
    ----------
    plant : SampledPlant
    lead : (float, float) or None
        T1, T2 [s], > 0.
    notch_hz : float, optional
        Centre of the notch [Hz], below the Nyquist frequency.
    notch_damping : (float, float)
        Damping ratios of numerator and denominator [-], > 0.

    Returns
    -------
    control.StateSpace
        One input, one output, gain 1 at steady state.

    Raises
    ------
    ParameterError
        A time or damping ratio that is not > 0, a notch that is not below the Nyquist frequency.

    Examples
    --------
    At its centre the notch lets a fifth through, the ratio of its damping ratios:

    >>> import numpy as np, powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> notch = pt.antijerk.lead_notch(plant, lead=None, notch_hz=21.0)
    >>> float(abs(notch(np.exp(2j * np.pi * 21.0 * plant.dt))).round(6))
    0.2
    """
    system = linear_system([], [], [], [[1.0]], dt=plant.dt)
    if lead is not None:
        system = sampled_filter([lead[0], 1.0], [lead[1], 1.0], plant.dt) * system
    if notch_hz is not None:
        nyquist = 0.5 / plant.dt
        if not 0.0 < notch_hz < nyquist:
            permitted = f"> 0 and below Nyquist, {nyquist:g} Hz"
            raise ParameterError("anti-jerk controller", "notch_hz", notch_hz, "Hz", permitted)
        w = 2.0 * np.pi * notch_hz
        numerator, denominator = ([1.0, 2.0 * zeta * w, w**2] for zeta in notch_damping)
        system = sampled_filter(numerator, denominator, plant.dt, prewarp=w) * system
    return system


@checked
def rigid_reference(plant: SampledPlant, gain: SpeedGain = 8.0, bandwidth_hz: Frequency = 0.5) -> control.StateSpace:
    """Feedback on the engine speed alone, against that of a rigid driveline whose load is estimated.

    The reference integrates the limited command, through lag and delay, over the whole inertia. An observer with two
    equal poles at ``bandwidth_hz`` corrects its speed and its load, so that a wanted acceleration is not braked.

    Parameters
    ----------
    plant : SampledPlant
    gain : float
        [N m s/rad], > 0.
    bandwidth_hz : float
        [Hz], > 0, well below the first mode.

    Returns
    -------
    control.StateSpace
        From ``engine_speed``, ``wheels_speed`` (not used) [rad/s] and ``torque_limited`` [N m] to
        ``torque_intervention`` [N m].

    Raises
    ------
    ParameterError
        A gain or bandwidth that is not > 0 and finite.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.rigid_reference(plant))
    >>> round(pt.loop_margins(plant, None).zeta_first, 2), round(pt.loop_margins(plant, controller).zeta_first, 2)
    (0.1, 0.38)
    """
    J, lag = plant.inertia, max(*plant.lags, 1e-6)
    # states: speed, load at the engine, torque, commands under way
    A, B = plant.with_delay(
        np.array([[0.0, -1.0 / J, 1.0 / J], [0.0, 0.0, 0.0], [0.0, 0.0, -1.0 / lag]]),
        np.array([[0.0], [0.0], [1.0 / lag]]),
    )
    pole = np.exp(-2.0 * np.pi * bandwidth_hz * plant.dt)
    measured = np.zeros((1, len(A)))
    measured[0, 0] = 1.0
    correct = np.zeros((len(A), 1))
    correct[:2, 0] = 1.0 - pole**2, -J / plant.dt * (1.0 - pole) ** 2
    keep = np.eye(len(A)) - correct @ measured
    B_all = np.hstack([correct, np.zeros_like(correct), keep @ B])
    # intervention = -gain (engine speed - reference after correction)
    C = gain * measured @ keep @ A
    D = gain * measured @ B_all - gain * np.array([[1.0, 0.0, 0.0]])
    return feedback_system(keep @ A, B_all, C, D, plant.dt)
