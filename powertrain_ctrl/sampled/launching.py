"""Launch with the anti-jerk loop closed: sampled control of the engine torque through slip and lock."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..base.checks import AtLeastOne, Capacity, Duration, Seconds, Speed, Torque
from ..base.doors import checked
from ..base.errors import ParameterError, TopologyError
from ..base.units import rpm
from ..hybrid.response import Response, State
from ..hybrid.signals import ramp
from ..linear.assembly import as_driveline
from .driving import Drive, unit_of
from .plant import SampledPlant

if TYPE_CHECKING:
    import control


@checked
def controlled_launch(
    plant: SampledPlant,
    controller: control.NonlinearIOSystem | None,
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
    locked, the controller starts from rest relative to the speeds of that sample; the step that its command then
    makes is taken off and dies out with a time constant of 50 ms, so the torque has no bump. At re-slip the
    demand passes again, the step to it taken off in the same way.

    Parameters
    ----------
    plant : SampledPlant
        Its car has one clutch, which the capacity closes here.
    controller : control.StateSpace, control.NonlinearIOSystem or None
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
