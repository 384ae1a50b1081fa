"""Launch with the anti-jerk loop closed: sampled control of the engine torque through slip and lock."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.checks import AtLeastOne, Capacity, Duration, Seconds, Speed, Torque
from ..base.doors import checked
from ..base.errors import ParameterError, TopologyError
from ..base.units import rpm
from ..elements.laws import FREE, STUCK
from ..hybrid.model import output_map
from ..hybrid.plant import Plant
from ..hybrid.response import Response, State
from ..hybrid.run import Run
from ..hybrid.signals import input_pieces, ramp
from ..hybrid.simulation import Recorder
from ..hybrid.starts import initial_speeds
from ..linear.assembly import as_driveline, assemble
from ..linear.outputs import output_rows
from .controller import BUMP, ControllerStepper
from .loop import whole_samples
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
    model = assemble(driveline.release())
    torque_name, capacity_name = f"{plant.engine}_torque", f"{driveline.clutches[0]}_capacity"
    index, names = model.inputs.index(torque_name), (*model.inputs, capacity_name)
    core = Plant(model, index, plant.lag)
    count = whole_samples(plant, end, steps_per_sample)
    whole, rest = plant.delay_in_samples
    if not capacity >= 0.0:
        raise ParameterError("controlled launch", "capacity", capacity, "N m", ">= 0")
    demand, closing = ramp(start, duration, torque), ramp(start, duration, capacity)
    speed = initial_speeds(model, {plant.engine: engine_speed})
    run = Run(lambda modes: core, core.state(np.zeros(core.r), speed), (FREE,), 0.0)
    supervisor = _Supervisor(plant, controller)
    speeds = [f"{plant.engine}_speed", *(f"{wheel}_speed" for wheel in plant.wheels)]
    rows = output_rows(model, speeds, inputs=[index])
    on_twist, on_speed = (np.vstack([a[0], a[1:].mean(axis=0)]) for a in (rows.twist, rows.speed))
    time = (plant.dt / steps_per_sample) * np.arange(count * steps_per_sample + 1)
    recorder = Recorder(core, time)
    demands, commands = np.zeros(count), np.zeros(count + whole + 2)
    for k in range(count):
        t, next_sample = (float(time[i * steps_per_sample]) for i in (k, k + 1))
        demands[k] = demand(t)
        stuck = run.modes[0] == STUCK
        measured = on_twist @ core.twist(run.x) + on_speed @ core.speed(run.x)
        commands[k + whole + 1] = supervisor.command(demands[k], measured, stuck)
        for begin, end_of_part, held in ((t, t + rest, commands[k]), (t + rest, next_sample, commands[k + 1])):
            if end_of_part > begin:
                pieces = input_pieces(
                    {torque_name: held, capacity_name: closing}, names, np.array([begin, end_of_part])
                )
                for interval in run.over(pieces, len(model.inputs)):
                    recorder.add(interval)
    sample = np.minimum(np.arange(len(time)) // steps_per_sample, count - 1)
    return _response(recorder, run, core, index, demands[sample], commands[whole + 1 :][sample])


class _Supervisor:
    """Passes the demand while the clutch slips, and the controller's command, without a bump, while it is stuck."""

    def __init__(self, plant: SampledPlant, controller: control.NonlinearIOSystem | None):
        self.plant, self.controller = plant, controller
        if controller is not None:
            ControllerStepper(controller, plant.dt)
        self.stepper: ControllerStepper | None = None
        self.limited = self.bump = 0.0
        self.base = np.zeros(3)

    def command(self, wanted: float, speeds: np.ndarray, stuck: bool) -> float:
        low, high = self.plant.torque_limits
        if self.controller is None or not stuck:
            target = wanted
            if self.stepper is not None:
                self.stepper, self.bump = None, self.limited - wanted
        else:
            stepper = self.stepper or ControllerStepper(self.controller, self.plant.dt)
            first = self.stepper is None
            if first:
                self.stepper = stepper
                # Deviations from a rigid driveline at this sample; a twist rate there is stays to be damped.
                self.base = np.array([wanted, speeds[0], speeds[0] / self.plant.ratio])
            signals = np.array([wanted, *speeds, self.limited]) - np.append(self.base, self.base[0])
            target = stepper.advance(np.append(signals, self.plant.ratio)) + self.base[0]
            if first:
                self.bump = self.limited - target
        self.limited = float(min(max(target + self.bump, low), high))
        self.bump *= np.exp(-self.plant.dt / BUMP)
        return self.limited


def _response(
    recorder: Recorder, run: Run, core: Plant, index: int, demand: np.ndarray, command: np.ndarray
) -> Response:
    """Signals of `simulate`, demand and command; ``core`` is the plant with its lag, ``index`` its commanded input."""
    model, mechanical = core.model, core.r + core.n
    u = recorder.inputs[: len(model.inputs)]
    if core.N > mechanical:
        u[index] = recorder.x[mechanical]
    y = output_map(Plant(model), [index]) @ np.concatenate([recorder.x[:mechanical], recorder.torque, u])
    (clutch,) = (law.name for law in core.clutches)
    inputs = ("torque_demand", f"{clutch}_capacity")
    outputs = (*output_rows(model, inputs=[index]).names, f"{clutch}_mode", COMMAND, model.inputs[index])
    values = np.vstack([demand, recorder.inputs[-1], y, recorder.modes, command, u[index]])
    return Response(
        time=recorder.timepts,
        inputs=inputs,
        outputs=outputs,
        events=tuple(recorder.events(run)),
        slip_energy=recorder.slip_energy,
        final=State(run.time, {}, {}, {clutch: run.modes[0]}),
        _values=values,
        title="controlled launch",
    )
