"""Change of mind, let-off and braking of a sampled loop."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

from ..base.checks import Duration, Frequency, Period, Speed, Torque
from ..base.doors import checked
from ..base.errors import ParameterError
from ..base.units import rpm
from ..hybrid.plans import course, steady
from ..hybrid.response import Response
from ..linear.assembly import as_driveline
from ..sampled.driving import controlled_run
from ..sampled.loop import closed_loop
from ..sampled.plant import SampledPlant
from ..sampled.unit import Controller
from .trials import END, RAMP, START, TORQUE

# From each change of the mind to the next [s]: from the first tip-in to the second it is less than a second.
HOLD = 0.4
# The brake is on for so long [s], rises and falls so fast [s], and between the pulses of an ABS it keeps this share [-].
BRAKED, BITE, KEPT = 1.0, 0.05, 0.3
# Of each cycle of an ABS the pressure rises in one quarter and falls in another.
QUARTER = 0.25


@checked
def change_of_mind(
    plant: SampledPlant,
    controller: Controller = None,
    torque: Torque = TORQUE,
    duration: Duration = RAMP,
    hold: Period = HOLD,
    **options: Any,
) -> Response:
    """Response to a tip-in at t = 0.5 s, a tip-out and another tip-in, each before the car has come to rest from the last.

    Parameters
    ----------
    plant : SampledPlant
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        As in `closed_loop`.
    torque : float
        Demand of the tip-ins [N m].
    duration : float
        Of each ramp [s], >= 0.
    hold : float
        From the start of a ramp to that of the next [s], longer than a ramp.
    **options
        Of `closed_loop`; its ``duration``, the end of the response, is 4 s here.

    Returns
    -------
    Response
        Signals of `closed_loop`.

    Raises
    ------
    ParameterError
        A hold that is shorter than a ramp.
    PowertrainError
        As of `closed_loop`.

    Examples
    --------
    Without a controller the second tip-in meets the swing of the first:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> responses = [pt.change_of_mind(plant, each) for each in (None, controller)]
    >>> [round(float(response["vehicle_acceleration"].min()), 2) for response in responses]
    [-1.21, -0.75]
    """
    if hold <= duration:
        raise ParameterError("change of mind", "hold", hold, "s", f"longer than a ramp of {duration:g} s")
    points: list[tuple[float, float]] = []
    for begin, (before, after) in enumerate(pairwise((0.0, torque, 0.0, torque))):
        start = START + begin * hold
        points += [(start, before), (start + duration, after)]
    return closed_loop(plant, controller, course(*points), **{"duration": END, **options})


@checked
def let_off(
    plant: SampledPlant,
    controller: Controller = None,
    torque: Torque = 100.0,
    drag: Torque = -30.0,
    duration: Duration = 0.3,
    **options: Any,
) -> Response:
    """Response to a demand that falls from ``torque`` through zero to the drag of an engine or to what a machine recovers.

    Play in the driveline changes its side on the way.

    Parameters
    ----------
    plant : SampledPlant
        Its torque limits have both torques.
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        As in `closed_loop`.
    torque, drag : float
        Demand before, in balance with the load, and behind the ramp [N m], of opposite signs.
    duration : float
        Of the ramp [s], >= 0.
    **options
        Of `closed_loop`; its ``duration`` is 4 s here.

    Returns
    -------
    Response
        Signals of `closed_loop`.

    Raises
    ------
    ParameterError
        Torques of the same sign, or beyond the limits.
    PowertrainError
        As of `closed_loop`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional(gear_ratio=2.0)
    >>> tight = car["drive_shafts"]
    >>> play = pt.Backlash(tight.name, tight.a, tight.b, gap=0.03, stiffness=tight.stiffness, damping=tight.damping)
    >>> loose = pt.Driveline(*(play if each.name == tight.name else each for each in car))
    >>> response = pt.let_off(pt.SampledPlant(car=loose, torque_limits=(-50.0, 350.0)))
    >>> [(event.kind, event.mode) for event in response.events[:2]]
    [('open', 'gap'), ('contact', 'left')]
    """
    low, high = plant.limits
    if not drag * torque < 0.0:
        raise ParameterError("let-off", "drag", drag, "N m", f"of the other sign than torque = {torque:g} N m")
    for name, value in (("torque", torque), ("drag", drag)):
        if not low <= value <= high:
            raise ParameterError("let-off", name, value, "N m", f"within the torque limits {low:g} to {high:g} N m")
    demand = course((START, torque), (START + duration, drag))
    return closed_loop(plant, controller, demand, **{"duration": END, "initial_torque": torque, **options})


@checked
def braking(
    plant: SampledPlant,
    controller: Controller = None,
    brake: Torque = 1500.0,
    abs_frequency: Frequency | None = None,
    torque: Torque = 0.0,
    engine_speed: Speed = rpm(3000.0),
) -> Response:
    """Response to a brake at the wheels from t = 0.5 s to 1.5 s, or to the pulses of an anti-lock system in that time.

    Parameters
    ----------
    plant : SampledPlant
        Its wheels have inertia.
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        As in `controlled_run`.
    brake : float
        Torque at all wheels together that are driven, against the motion [N m], >= 0.
    abs_frequency : float, optional
        The brake goes down to 30 % and up again at this frequency [Hz], > 0 and at most half the sampling rate.
    torque : float
        Demand, which stays [N m].
    engine_speed : float
        Of the actuator before [rad/s], forward and fast enough for the car not to stop.

    Returns
    -------
    Response
        Signals of `controlled_run`, to 4 s.

    Raises
    ------
    ParameterError
        A brake that is negative, a frequency that is too high.
    PowertrainError
        As of `controlled_run`.

    Examples
    --------
    How much the machine of an electric car runs ahead of its wheels or behind them [rad/s], under the pulses of an ABS:

    >>> import numpy as np, powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(
    ...     car=pt.examples.electric(), lag=0.005, delay=0.002, dt=0.005, torque_limits=(-300.0, 300.0)
    ... )
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=2.0))
    >>> for each in (None, controller):
    ...     response = pt.braking(plant, each, abs_frequency=8.0)
    ...     twisting = response["motor_speed"] - plant.ratio * response["wheels_speed"]
    ...     print(round(float(np.abs(twisting).max()), 1))
    36.5
    12.7
    """
    if brake < 0.0:
        raise ParameterError("braking", "brake", brake, "N m", ">= 0")
    if abs_frequency is not None and abs_frequency * plant.dt > 0.5:
        raise ParameterError("braking", "abs_frequency", abs_frequency, "Hz", f"at most {0.5 / plant.dt:g}")
    points = [(START, 0.0), (START + BITE, brake)]
    if abs_frequency is not None:
        cycle = 1.0 / abs_frequency
        begin = START + BITE
        while begin + cycle < START + BRAKED - BITE:
            low, shape = KEPT * brake, (0.0, QUARTER, 2.0 * QUARTER, 3.0 * QUARTER)
            levels = (brake, low, low, brake)
            points += [(begin + share * cycle, level) for share, level in zip(shape, levels, strict=True)]
            begin += cycle
    points += [(START + BRAKED - BITE, brake), (START + BRAKED, 0.0)]
    on_each = -1.0 / len(plant.wheels) * course(*points)
    car = as_driveline(plant.car)
    state = steady(car, plant.engine, torque, engine_speed)
    brakes = {f"{wheel}_torque": on_each for wheel in plant.wheels}
    demand = course((0.0, torque))
    return controlled_run(plant, controller, demand, brakes, duration=END, initial_state=state)
