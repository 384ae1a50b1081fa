"""Engine start of a hybrid that drives: the separation clutch turns the engine up, the e-machine makes up for it."""

from __future__ import annotations

import numpy as np

from ..base.checks import Capacity, Duration, Period, Speed, Torque
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError, UnknownNameError
from ..base.units import rpm
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.ends import driven, ends
from ..linear.assembly import as_driveline
from ..linear.steady import static_gain
from .plans import SWITCHED, Plan, capacities_as_set, capacity_of, course, ends_of_clutch, inertia_at, steady
from .response import Response
from .signals import Times
from .simulation import simulate

# What the preset start takes [s].
LENGTH = 2.5


@checked
def engine_start(
    car: HasDriveline,
    clutch: str = "separation_clutch",
    torque: Torque = 60.0,
    capacity: Capacity = 60.0,
    speed: Speed = rpm(1500.0),
    blending: Period = 0.3,
    start: Duration = 0.5,
    compensated: bool = True,
    timepts: Times | None = None,
) -> Response:
    """Engine start of a hybrid in electric drive through its separation clutch, the e-machine compensating what that takes.

    The e-machine drives, the engine rests. The clutch gets a capacity that turns the engine up, and the e-machine as much
    more torque. At the planned end of the slip the clutch is closed and the extra torque taken back; then the engine takes
    over from the e-machine. The engine's own friction and compression are left out. The response is exact, the
    signals are what a control unit without feedback would plan.

    Parameters
    ----------
    car : Driveline
        Its other clutches stay as they are.
    clutch : str
        Between engine and e-machine.
    torque : float
        Of the e-machine that drives the car, and afterwards of the engine [N m].
    capacity : float
        Of the clutch while it turns the engine up [N m], > 0.
    speed : float
        Of the e-machine at t = 0 [rad/s], > 0.
    blending : float
        In which the engine takes over [s].
    start : float
        When the clutch begins to close [s].
    compensated : bool
        Whether the e-machine makes up for the clutch; if not the car pays for the start.
    timepts : (N,) array_like, optional
        [s]; every 1 ms to 2.5 s if not given.

    Returns
    -------
    Response

    Raises
    ------
    UnknownNameError
        A clutch that is not there.
    ParameterError
        No capacity, or a speed that is not positive.
    PowertrainError
        A clutch that has less capacity than the torques need; one that cannot bring the engine up to the car's speed.
    TopologyError
        A clutch with no engine behind it.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car = pt.examples.p2_hybrid()
    >>> with_it, without = (pt.engine_start(car, compensated=each) for each in (True, False))
    >>> [(event.element, event.kind) for event in with_it.events]
    [('separation_clutch', 'slip'), ('separation_clutch', 'lock')]
    >>> [round(float(np.ptp(each["vehicle_acceleration"])), 1) for each in (with_it, without)]
    [0.8, 3.8]
    """
    car = as_driveline(car)
    plan = start_plan(car, clutch, torque, capacity, speed, blending, start, compensated)
    timepts = np.linspace(0.0, LENGTH, 2501) if timepts is None else timepts
    return simulate(car, timepts, plan.inputs, initial_state=plan.state)


def start_plan(
    car: Driveline,
    clutch: str,
    torque: float,
    capacity: float,
    speed: float,
    blending: float,
    start: float,
    compensated: bool,
) -> Plan:
    """Signals of an engine start, and the steady electric drive before it."""
    if clutch not in car.clutches:
        raise UnknownNameError("clutch", clutch, car.clutches, "in this driveline")
    for name, value, unit in (("capacity", capacity, "N m"), ("speed", speed, "rad/s")):
        if not value > 0.0:
            raise ParameterError("engine_start", name, value, unit, "> 0")
    full = capacity_of(car, clutch, max(capacity, abs(torque)))
    electric = car.release(clutch)
    driving = ends(electric).driving
    _, far = ends_of_clutch(electric, clutch, driving)
    turned = electric.part(far)
    engine = ends(turned).engine
    driven_part = driven(electric).driveline.part(driving)
    acceleration = torque * static_gain(driven_part, f"{driving}_torque", f"{driving}_acceleration").item()
    # both sides as bodies; the capacity rises in a time of its own, on average half of it
    gained = capacity / inertia_at(turned, far) - acceleration
    if gained <= 0.0:
        raise PowertrainError(
            f"capacity = {capacity:g} N m, permitted: more than {acceleration * inertia_at(turned, far):g} N m, with which "
            f"the engine would only just keep up with {driving}"
        )
    synchronous = start + 0.5 * SWITCHED + (speed + acceleration * (start + 0.5 * SWITCHED)) / gained
    over = synchronous + SWITCHED
    extra = [(start, 0.0), (start + SWITCHED, capacity), (synchronous, capacity), (over, 0.0)]
    blend = [(over, 0.0), (over + blending, torque)]
    machine = course((start, torque), *((t, torque + (value if compensated else 0.0)) for t, value in extra[1:]))
    inputs = capacities_as_set(electric) | {
        f"{driving}_torque": machine + course(*((t, -value) for t, value in blend)),
        f"{engine}_torque": course(*blend),
        f"{clutch}_capacity": course(*extra[:3], (over, full)),
    }
    return Plan(inputs, steady(electric, driving, torque, speed), driving, torque)
