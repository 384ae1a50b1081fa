"""Launch, gear shift and engine start with the anti-jerk loop closed: sampled control through slip and lock."""

from __future__ import annotations

from ..base.checks import AtLeastOne, Capacity, Duration, Period, Seconds, Speed, Torque
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError, TopologyError
from ..base.units import rpm
from ..driveline.collection import HasDriveline
from ..hybrid.cranking import start_plan
from ..hybrid.plans import Plan
from ..hybrid.response import Response, State
from ..hybrid.shifting import shift_plan
from ..hybrid.signals import ramp
from ..linear.assembly import as_driveline
from .driving import Drive, unit_of
from .plant import SampledPlant
from .unit import Controller

# What is seen of a shift or engine start from its beginning on [s].
LENGTH = 2.0


@checked
def controlled_launch(
    plant: SampledPlant,
    controller: Controller,
    torque: Torque = 350.0,
    capacity: Capacity = 370.0,
    duration: Duration = 0.22,
    start: Seconds = 1.5,
    engine_speed: Speed = rpm(5000.0),
    end: Seconds = 3.5,
    steps_per_sample: AtLeastOne = 10,
) -> Response:
    """Race start with lag, delay, limits and sampling of the engine torque, and the controller engaged at lock.

    While the clutch slips the engine torque does not reach the wheels, so the demand passes. When the clutch has
    locked, the controller starts as that of a `ControlUnit`; the step that its command then makes is taken off and dies out
    with a time constant of 50 ms, so the torque has no bump. At re-slip the demand passes again, the step to it
    taken off in the same way.

    Parameters
    ----------
    plant : SampledPlant
        Its car has one clutch, which the capacity closes here.
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        For the closed clutch; None passes the demand through.
    torque, capacity, duration, start, engine_speed : float
        As in `launch`.
    end : float
        End of the response [s], at least one sample.
    steps_per_sample : int
        Points of the response per sample, >= 1.

    Returns
    -------
    Response
        Signals of `simulate` and ``torque_demand``, ``torque_command`` [N m].

    Raises
    ------
    ParameterError
        A negative capacity, a ramp that is not possible.
    TopologyError
        A driveline with no clutch or more than one.
    PowertrainError
        A controller that does not fit; an end before the first sample.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional(damping="open"))
    >>> pt.controlled_launch(plant, None).events[-1].kind
    'lock'
    """
    driveline = as_driveline(plant.car)
    if len(driveline.clutches) != 1:
        raise TopologyError(f"launch needs one clutch, there are {len(driveline.clutches)}")
    if not capacity >= 0.0:
        raise ParameterError("controlled launch", "capacity", capacity, "N m", ">= 0")
    closing = {f"{driveline.clutches[0]}_capacity": ramp(start, duration, capacity)}
    state = State(0.0, {}, {plant.engine: engine_speed}, {})
    drive = Drive(plant, driveline, closing, state, 0.0, end, steps_per_sample)
    return drive.response(unit_of(controller, plant), ramp(start, duration, torque), "controlled launch")


@checked
def controlled_shift(
    plant: SampledPlant,
    controller: Controller,
    offgoing: str,
    oncoming: str,
    torque: Torque = 150.0,
    engine_speed: Speed = rpm(3000.0),
    torque_phase: Period = 0.15,
    speed_phase: Period = 0.3,
    start: Duration = 0.5,
    car: HasDriveline | None = None,
) -> Response:
    """Gear shift as `gear_shift` plans it, through lag, delay, limits and sampling, its controller changing with the gear.

    The plan's torque is the demand. The controller of the old gear works until its clutch slips; the demand passes in the
    speed phase; the controller of the new gear engages as that clutch locks, both without a bump.

    Parameters
    ----------
    plant : SampledPlant
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        A unit with a controller for each gear, one for any gear, or None, which passes the demand.
    offgoing, oncoming : str
        Clutches of the old and of the new gear, which is engaged.
    torque, engine_speed, torque_phase, speed_phase, start : float
        As in `gear_shift`.
    car : Driveline, optional
        The plant's if not given.

    Returns
    -------
    Response
        Signals of `controlled_run`, to 2 s behind the start.

    Raises
    ------
    PowertrainError
        As of `gear_shift` and `controlled_run`; a car that the plant's engine does not drive.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.p2_hybrid(), torque_limits=(-50.0, 300.0))
    >>> response = pt.controlled_shift(plant, None, offgoing="odd_clutch", oncoming="even_clutch")
    >>> [(event.element, event.kind) for event in response.events][-1], response["ratio"][[0, -1]].round(3)
    (('even_clutch', 'lock'), array([16.072,  9.963]))
    """
    driven_car = as_driveline(plant.car if car is None else car)
    plan = shift_plan(driven_car, offgoing, oncoming, torque, engine_speed, torque_phase, speed_phase, start)
    inputs = _others(plan, plant)
    drive = Drive(plant, driven_car, inputs, plan.state, torque, start + LENGTH)
    return drive.response(unit_of(controller, plant), plan.inputs[f"{plan.driving}_torque"], "controlled gear shift")


@checked
def controlled_start(
    plant: SampledPlant,
    controller: Controller,
    car: HasDriveline,
    clutch: str = "separation_clutch",
    torque: Torque = 60.0,
    capacity: Capacity = 60.0,
    speed: Speed = rpm(1500.0),
    blending: Period = 0.3,
    start: Duration = 0.5,
    compensated: bool = True,
) -> Response:
    """Engine start as `engine_start` plans it, the e-machine behind lag, delay, limits and sampling, its loop closed.

    The demand is the torque that drives; what makes up for the clutch, and later gives way to the engine, goes past the
    controller. The engine's own torque is as planned.

    Parameters
    ----------
    plant : SampledPlant
        Of the e-machine: of the car's part that it drives while the clutch is open, for example.
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        As in `controlled_run`.
    car : Driveline
        With the engine.
    clutch : str
        Between engine and e-machine.
    torque, capacity, speed, blending, start : float
        As in `engine_start`.
    compensated : bool
        Whether the e-machine makes up for the clutch.

    Returns
    -------
    Response
        Signals of `controlled_run`, to 2 s behind the start.

    Raises
    ------
    PowertrainError
        As of `engine_start` and `controlled_run`; a car that the plant's engine does not drive.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.p2_hybrid()
    >>> electric = car.release("separation_clutch").part("vehicle")
    >>> plant = pt.SampledPlant(car=electric, lag=0.005, delay=0.002, dt=0.002, torque_limits=(-200.0, 200.0))
    >>> response = pt.controlled_start(plant, None, car)
    >>> [(event.element, event.kind) for event in response.events]
    [('separation_clutch', 'slip'), ('separation_clutch', 'lock')]
    """
    driven_car = as_driveline(car)
    plan = start_plan(driven_car, clutch, torque, capacity, speed, blending, start, compensated)
    inputs, machine = _others(plan, plant), plan.inputs[f"{plan.driving}_torque"]
    drive = Drive(plant, driven_car, inputs, plan.state, torque, start + LENGTH)
    demand = ramp(0.0, 0.0, torque, torque)
    return drive.response(unit_of(controller, plant), demand, "controlled engine start", machine + -demand)


def _others(plan: Plan, plant: SampledPlant) -> dict:
    """Signals of a plan but for that of the actuator."""
    if plan.driving != plant.engine:
        raise PowertrainError(f"the plant drives {plant.engine}, permitted here: {plan.driving}, which drives the car")
    return {name: signal for name, signal in plan.inputs.items() if name != f"{plan.driving}_torque"}
