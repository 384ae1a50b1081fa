"""Tip-in, tip-out and wheel disturbance of a sampled loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.checks import Duration, Torque
from ..base.doors import checked
from ..base.errors import PowertrainError, SignalError
from ..families.loops import loops_among, trial_of
from ..hybrid.metrics import RideMetrics, metrics_of, ride_metrics
from ..hybrid.response import Response
from ..hybrid.signals import HalfSine, ramp, step
from ..sampled.engaged import limits_with
from ..sampled.loop import closed_loop
from ..sampled.plant import SampledPlant
from ..sampled.unit import Controller
from .times import RAMP, START, TORQUE, times_of

# When a manoeuvre ends [s].
END = 4.0
# The wheel disturbance: peak torque at the wheels [N m], half-sine of that length [s].
PULSE, PULSE_LENGTH = 800.0, 0.1
# The residual counts from so long after the pulse on [s], about when a controller can have answered it.
ANSWER = 0.05
# A change of the torque demand by less than this share of it is none.
UNCHANGED = 1e-9


@checked
def tip_in(
    plant: SampledPlant,
    controller: Controller = None,
    torque: Torque = TORQUE,
    duration: Duration = RAMP,
    **options: Any,
) -> Response:
    """Response to a torque demand that rises from 0 to ``torque`` in ``duration`` from t = 0.5 s on.

    Parameters
    ----------
    plant : SampledPlant
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        As in `closed_loop`.
    torque : float
        Final demand [N m].
    duration : float
        Of the ramp [s], >= 0; `robustness` takes the same share of the period of the first mode on every car.
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
    return closed_loop(plant, controller, ramp(START, duration, torque), **{"duration": END, **options})


@checked
def tip_out(
    plant: SampledPlant,
    controller: Controller = None,
    torque: Torque = TORQUE,
    duration: Duration = RAMP,
    **options: Any,
) -> Response:
    """Response to a torque demand that falls from ``torque``, in balance with the load, to 0.

    Parameters
    ----------
    plant, controller : SampledPlant; ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
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
    plant: SampledPlant, controller: Controller = None, torque: Torque = PULSE, **options: Any
) -> Response:
    """Response to a half-sine of 100 ms against the vehicle from t = 0.5 s on, in steady driving.

    The demand stays at the initial torque, halfway between the torque limits if not given.

    Parameters
    ----------
    plant : SampledPlant
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
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
    force = HalfSine(-torque / plant.vehicle_radius, START, PULSE_LENGTH)
    options = {"duration": END, "initial_torque": _level(limits_with(plant, controller)), **options}
    return closed_loop(plant, controller, lambda t: options["initial_torque"], disturbance=force, **options)


@checked
def tip_in_metrics(plant: SampledPlant, response: Response) -> RideMetrics:
    """Ride metrics of a `tip_in` or a `tip_out`, against the acceleration that its change of torque demand gives.

    Parameters
    ----------
    plant : SampledPlant
    response : Response
        Of that plant; ``torque_demand`` at its end minus that at its beginning is the change of the torque.

    Returns
    -------
    RideMetrics

    Raises
    ------
    UnknownNameError
        A response without ``torque_demand``.
    SignalError
        A response at whose end the demand is that at its beginning.

    Examples
    --------
    The plant is linear, so the torque does not count:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> for torque in (250.0, 300.0):
    ...     metrics = pt.studies.tip_in_metrics(plant, pt.tip_in(plant, torque=torque))
    ...     print(round(metrics.final, 2), round(metrics.overshoot, 3), round(metrics.t90, 3))
    3.89 0.605 0.176
    4.67 0.605 0.176
    """
    demand = response["torque_demand"]
    change = float(demand[-1] - demand[0])
    if abs(change) <= UNCHANGED * np.abs(demand).max():
        raise SignalError(f"the torque demand is {demand[0]:g} N m at both ends, permitted: a tip-in or tip-out")
    return ride_metrics(response.time, response["vehicle_acceleration"], change * plant.final_acceleration, START)


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

    Raises
    ------
    PowertrainError
        A response that ends before.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> [round(pt.studies.residual_rms(pt.wheel_disturbance(plant, each)), 3) for each in (None, controller)]
    [0.078, 0.027]
    """
    after = _after(response.time)
    if not after.any():
        end = START + PULSE_LENGTH + ANSWER
        raise PowertrainError(f"the response ends at {response.time[-1]:g} s, permitted: after the pulse, {end:g} s")
    return float(np.sqrt(np.mean(response["vehicle_acceleration"][after] ** 2)))


class Trials(NamedTuple):
    """What `tip_in_metrics` and `residual_rms` say of a plant with a controller."""

    metrics: RideMetrics
    residual_rms: float


def trials(plants: Sequence[SampledPlant], controller: Controller, nominal: SampledPlant) -> list[Trials]:
    """Tip-in of the nominal plant and wheel disturbance of many plants, those with the same samples and limits at once."""
    groups: dict[tuple, list[int]] = {}
    for i, plant in enumerate(plants):
        groups.setdefault((plant.dt, plant.torque_limits, plant.torque_rate, plant.speed), []).append(i)
    found: dict[int, Trials] = {}
    times = times_of(nominal)
    for places in groups.values():
        chosen = [plants[i] for i in places]
        level = _level(limits_with(chosen[0], controller))
        tipped = trial_of(chosen[0], controller, ramp(times.start, times.ramp, times.torque), times.end)
        acceleration, final = loops_among(chosen, tipped, ["vehicle_acceleration"])
        time = chosen[0].dt / tipped.steps * np.arange(acceleration.shape[2])
        metrics = metrics_of(time, acceleration[:, 0], times.torque * final, times.start)
        pulse = (START, PULSE_LENGTH)
        pushed = trial_of(chosen[0], controller, step(0.0, level, level), END, pulse, level)
        force = [-PULSE / plant.vehicle_radius for plant in chosen]
        pushes, _ = loops_among(chosen, pushed, ["vehicle_acceleration"], force)
        time = chosen[0].dt / pushed.steps * np.arange(pushes.shape[2])
        rms = np.sqrt(np.mean(pushes[:, 0, _after(time)] ** 2, axis=1))
        for k, i in enumerate(places):
            mine = RideMetrics(**{name: float(values[k]) for name, values in metrics.items()})
            found[i] = Trials(mine, float(rms[k]))
    return [found[i] for i in range(len(plants))]


def _level(limits: tuple[float, float]) -> float:
    """Torque of steady driving: halfway between the limits."""
    low, high = limits
    return 0.5 * (low + high) if np.isfinite([low, high]).all() else float(np.clip(0.0, low, high))


def _after(time: np.ndarray) -> np.ndarray:
    """Samples from 50 ms after the pulse on; one at that time counts."""
    return time >= START + PULSE_LENGTH + ANSWER - 1e-9
