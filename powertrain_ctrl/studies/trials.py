"""Tip-in, tip-out and wheel disturbance of a sampled loop."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import Duration, Torque
from ..doors import checked
from ..metrics import RideMetrics, ride_metrics
from ..response import Response
from ..sampled import SampledPlant, check_plant
from ..signals import ramp
from ..stepping import closed_loop

if TYPE_CHECKING:
    import control

# The tip-in: torque [N m], ramp [s], start [s], end [s].
TORQUE, RAMP, START, END = 250.0, 0.1, 0.5, 4.0
# The wheel disturbance: peak torque at the wheels [N m], half-sine of that length [s].
PULSE, PULSE_LENGTH = 800.0, 0.1
# The residual counts from so long after the pulse on [s], about when a controller can have answered it.
ANSWER = 0.05


@checked
def tip_in(
    plant: SampledPlant,
    controller: control.NonlinearIOSystem | None = None,
    torque: Torque = TORQUE,
    duration: Duration = RAMP,
    **options: Any,
) -> Response:
    """Response to a torque demand that rises from 0 to ``torque`` in ``duration`` from t = 0.5 s on.

    Parameters
    ----------
    plant : SampledPlant
    controller : control.StateSpace, control.NonlinearIOSystem or None
        As in `closed_loop`.
    torque : float
        Final demand [N m].
    duration : float
        Of the ramp [s], >= 0.
    **options
        Of `closed_loop`; its ``duration``, the end of the response, is 4 s here.

    Returns
    -------
    Response
        Signals of `closed_loop`.

    Raises
    ------
    PowertrainError
        As of `closed_loop`.

    Examples
    --------
    Without a controller the acceleration goes 61 % beyond its final 3.89 m/s^2:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> acceleration = pt.tip_in(plant)["vehicle_acceleration"]
    >>> round(float(acceleration.max()), 2), round(250.0 * plant.final_acceleration, 2)
    (6.24, 3.89)
    """
    check_plant(plant)
    return closed_loop(plant, controller, ramp(START, duration, torque), **{"duration": END, **options})


@checked
def tip_out(
    plant: SampledPlant,
    controller: control.NonlinearIOSystem | None = None,
    torque: Torque = TORQUE,
    duration: Duration = RAMP,
    **options: Any,
) -> Response:
    """Response to a torque demand that falls from ``torque``, in balance with the load, to 0.

    Parameters
    ----------
    plant, controller : SampledPlant; control.StateSpace, control.NonlinearIOSystem or None
        As in `tip_in`.
    torque, duration : float
        Demand before the ramp [N m], within the torque limits; length of the ramp [s].
    **options
        As in `tip_in`.

    Returns
    -------
    Response
        Signals of `closed_loop`.

    Raises
    ------
    PowertrainError
        As of `closed_loop`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> response = pt.tip_out(plant)
    >>> response["torque_demand"][[0, -1]], round(float(response["vehicle_acceleration"].min()), 2)
    (array([250.,   0.]), -6.24)
    """
    demand = ramp(START, duration, 0.0, torque)
    return closed_loop(plant, controller, demand, **{"duration": END, "initial_torque": torque, **options})


@checked
def wheel_disturbance(
    plant: SampledPlant, controller: control.NonlinearIOSystem | None = None, torque: Torque = PULSE, **options: Any
) -> Response:
    """Response to a half-sine of 100 ms against the vehicle from t = 0.5 s on, in steady driving.

    The demand stays at the initial torque, halfway between the torque limits if not given.

    Parameters
    ----------
    plant : SampledPlant
    controller : control.StateSpace, control.NonlinearIOSystem or None
        As in `closed_loop`.
    torque : float
        Peak at the wheels [N m].
    **options
        Of `closed_loop`; its ``duration`` is 4 s here.

    Returns
    -------
    Response
        Signals of `closed_loop`.

    Raises
    ------
    PowertrainError
        As of `closed_loop`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> response = pt.wheel_disturbance(plant)
    >>> float(response["torque_demand"][0]), round(float(response["vehicle_acceleration"].min()), 2)
    (175.0, -1.03)
    """
    check_plant(plant)
    force = _HalfSine(-torque / plant.vehicle_radius)
    low, high = plant.torque_limits
    level = 0.5 * (low + high) if np.isfinite([low, high]).all() else float(np.clip(0.0, low, high))
    options = {"duration": END, "initial_torque": level, **options}
    return closed_loop(plant, controller, lambda t: options["initial_torque"], disturbance=force, **options)


@dataclass(frozen=True)
class _HalfSine:
    """Pulse of the wheel disturbance."""

    peak: float

    def __call__(self, t: float) -> float:
        phase = (t - START) / PULSE_LENGTH
        return self.peak * np.sin(np.pi * phase) if 0.0 < phase < 1.0 else 0.0


@checked
def tip_in_metrics(plant: SampledPlant, response: Response, torque: Torque = TORQUE) -> RideMetrics:
    """Ride metrics of a `tip_in`, or with a negative torque of a `tip_out`.

    Parameters
    ----------
    plant : SampledPlant
    response : Response
        Of that plant.
    torque : float
        Change of the torque [N m], not 0.

    Returns
    -------
    RideMetrics

    Raises
    ------
    PowertrainError
        Torque 0.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> metrics = pt.studies.tip_in_metrics(plant, pt.tip_in(plant))
    >>> round(metrics.overshoot, 3), round(metrics.t90, 3)
    (0.605, 0.176)
    """
    return ride_metrics(response.time, response["vehicle_acceleration"], torque * plant.final_acceleration, START)


@checked
def residual_rms(response: Response) -> float:
    """Root mean square of the vehicle acceleration of `wheel_disturbance` from 50 ms after its pulse on.

    Parameters
    ----------
    response : Response

    Returns
    -------
    float
        [m/s^2].

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> [round(pt.studies.residual_rms(pt.wheel_disturbance(plant, each)), 3) for each in (None, controller)]
    [0.078, 0.027]
    """
    after = response.time >= START + PULSE_LENGTH + ANSWER
    return float(np.sqrt(np.mean(response["vehicle_acceleration"][after] ** 2)))
