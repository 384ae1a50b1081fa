"""Launch with the anti-jerk loop closed: sampled control of the engine torque through slip and lock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.checks import AtLeastOne, Capacity, Duration, Seconds, Speed, Torque
from ..base.doors import checked
from ..base.errors import ParameterError, TopologyError
from ..base.units import rpm
from ..hybrid.model import plants_of
from ..hybrid.response import Response, State
from ..hybrid.signals import ramp
from ..linear.assembly import as_driveline, assemble_with_laws
from .controller import BUMP, ControllerStepper
from .cores import HybridCore
from .loop import sampled_loop, whole_samples
from .plant import COMMAND, SampledPlant

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
    model = assemble_with_laws(driveline.release())
    count = whole_samples(plant, end, steps_per_sample)
    if not capacity >= 0.0:
        raise ParameterError("controlled launch", "capacity", capacity, "N m", ">= 0")
    demand, closing = ramp(start, duration, torque), ramp(start, duration, capacity)
    time = (plant.dt / steps_per_sample) * np.arange(count * steps_per_sample + 1)
    closed_by = {f"{driveline.clutches[0]}_capacity": closing}
    unknown = plants_of(driveline).unknown
    core = HybridCore(plant, model, unknown, time, steps_per_sample, closed_by, {plant.engine: engine_speed})
    wanted = demand(core.times[:-1])
    supervisor = _Supervisor(plant, controller)

    def command(k: int, measured: np.ndarray, limited: float) -> float:
        return supervisor.command(wanted[k], measured, limited, core.stuck)

    commands = sampled_loop(plant, core, command, plant.limits, count, steps=count, initial_speed=0.0)
    sample = np.minimum(np.arange(len(time)) // steps_per_sample, count - 1)
    return _response(core, wanted[sample], commands.limited[sample])


class _Supervisor:
    """Passes the demand while the clutch slips, and the controller's command, without a bump, while it is stuck."""

    def __init__(self, plant: SampledPlant, controller: control.NonlinearIOSystem | None):
        self.plant, self.controller = plant, controller
        if controller is not None:
            ControllerStepper(controller, plant.dt)
        self.stepper: ControllerStepper | None = None
        self.bump = 0.0
        self.base = np.zeros(3)

    def command(self, wanted: float, speeds: np.ndarray, limited: float, stuck: bool) -> float:
        """Command [N m] before the limits; ``limited`` is the one of the sample before behind them."""
        # the bump dies out from one sample to the next, and begins where the command jumps
        self.bump *= np.exp(-self.plant.dt / BUMP)
        if self.controller is None or not stuck:
            target = wanted
            if self.stepper is not None:
                self.stepper, self.bump = None, limited - wanted
        else:
            stepper = self.stepper or ControllerStepper(self.controller, self.plant.dt)
            first = self.stepper is None
            if first:
                self.stepper = stepper
                # Deviations from a rigid driveline at this sample; a twist rate there is stays to be damped.
                self.base = np.array([wanted, speeds[0], speeds[0] / self.plant.ratio])
            signals = np.array([wanted, *speeds, limited]) - np.append(self.base, self.base[0])
            target = stepper.advance(np.append(signals, self.plant.ratio)) + self.base[0]
            if first:
                self.bump = limited - target
        return target + self.bump


def _response(core: HybridCore, demand: np.ndarray, command: np.ndarray) -> Response:
    """Signals of `simulate`, demand and command."""
    found = core.signals()
    torque = found.pop(core.command)
    clutch = core.plant.clutches[0]
    shown = {law.name: law.shown(mode) for law, mode in zip(core.plant.laws, core.run.modes, strict=True)}
    values = np.vstack([demand, core.recorder.inputs[-1], *found.values(), command, torque])
    return Response(
        time=core.recorder.timepts,
        inputs=("torque_demand", clutch.input),
        outputs=(*found, COMMAND, core.command),
        events=tuple(core.recorder.events(core.run)),
        slip_energy=core.recorder.slip_energy,
        final=State(core.run.time, {}, {}, shown),
        _values=values,
        title="controlled launch",
    )
