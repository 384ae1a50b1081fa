"""Launch with the anti-jerk loop closed: sampled control of the engine torque through slip and lock."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .assembly import as_driveline, assemble
from .errors import PowertrainError, TopologyError
from .hybrid import FREE, STUCK, Plant, Run, Segment
from .outputs import output_rows
from .sampled import COMMAND, ControllerStepper, SampledPlant
from .signals import PiecewiseLinear, ramp
from .simulation import Event, Response, State, initial_speeds, output_map
from .units import rpm

# After a change of controller the difference of the commands dies out with this time constant [s].
BUMP = 0.05


def controlled_launch(
    plant: SampledPlant,
    controller,
    torque: float = 350.0,
    capacity: float = 370.0,
    duration: float = 0.22,
    start: float = 1.5,
    engine_speed: float = rpm(5000.0),
    end: float = 3.5,
    steps_per_sample: int = 10,
) -> Response:
    """Race start with lag, delay, limits and sampling of the engine torque, and the controller engaged at lock.

    While the clutch slips the engine torque does not reach the wheels, so the demand passes. When the clutch has
    locked, the controller starts from rest relative to the speeds of that sample; the step that its command then
    makes is taken off and dies out within 50 ms, so the torque has no bump. At re-slip the demand passes again.

    Parameters
    ----------
    plant : SampledPlant
        Its car has one clutch, which the capacity closes here.
    controller : control.StateSpace, control.NonlinearIOSystem or None
        For the closed clutch; None passes the demand through.
    torque, capacity, duration, start, engine_speed
        As in `launch`.
    end : float
        [s].
    steps_per_sample : int
        Points of the response per sample.

    Returns
    -------
    Response
        Signals of `simulate` and ``torque_demand``, ``torque_command`` [N m].

    Raises
    ------
    TopologyError
        A driveline with no clutch or more than one.

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
    index = model.inputs.index(f"{plant.engine}_torque")
    core = Plant(model, index, plant.lag)
    count = round(end / plant.dt)
    if count < 1:
        raise PowertrainError(f"end = {end} s, permitted: at least one sample of {plant.dt:g} s")
    whole, rest = plant._delay
    demand, closing = ramp(start, duration, torque), ramp(start, duration, capacity)
    speed = initial_speeds(model, {plant.engine: engine_speed})
    run = Run(lambda modes: core, core.state(np.zeros(core.r), speed), (FREE,), 0.0)
    supervisor = _Supervisor(plant, controller)
    measured = model.T[[model.nodes.index(plant.engine), model.nodes.index(plant.wheels)]]
    recorder = _Recorder(core, steps_per_sample, plant.dt, count)
    commands = np.zeros(count + whole + 2)
    for k in range(count):
        t = k * plant.dt
        wanted = float(demand(t))
        command = supervisor.command(wanted, measured @ core.speed(run.x), run.modes[0] == STUCK)
        commands[k + whole + 1] = command
        for offset, length, held in ((0.0, rest, commands[k]), (rest, plant.dt - rest, commands[k + 1])):
            if length > 0.0:
                for segment, part in _pieces(model, index, held, closing, t + offset, length):
                    for interval in run.advance(segment, part):
                        recorder.add(interval)
        recorder.note(k, wanted, command)
    return recorder.response(run, driveline.clutches[0], plant.engine)


class _Supervisor:
    """Passes the demand while the clutch slips, and the controller's command, without a bump, while it is stuck."""

    def __init__(self, plant: SampledPlant, controller):
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
                self.bump += self.limited - target
        self.bump *= np.exp(-self.plant.dt / BUMP)
        self.limited = float(min(max(target + self.bump, low), high))
        return self.limited


def _pieces(model, index: int, command: float, closing: PiecewiseLinear, start: float, length: float):
    """Segments of constant command, split at the corners of the capacity."""
    corners = [t for t in closing.times if start < t < start + length]
    edges = [start, *corners, start + length]
    for a, b in pairwise(edges):
        inputs = np.zeros((len(model.inputs), 2))
        inputs[index, 0] = command
        slope = float((closing(b) - closing(a)) / (b - a))
        yield Segment(inputs, np.array([[float(closing(a)), slope]])), b - a


class _Recorder:
    """Samples, heat and events of a controlled launch."""

    def __init__(self, core: Plant, steps_per_sample: int, dt: float, count: int):
        self.core, self.steps = core, steps_per_sample
        self.time = (dt / steps_per_sample) * np.arange(count * steps_per_sample + 1)
        shape = len(self.time)
        self.x = np.zeros((len(core.A), shape))
        self.torque, self.mode, self.capacity = np.zeros((1, shape)), np.zeros(shape), np.zeros(shape)
        self.demand, self.command = np.zeros(shape), np.zeros(shape)
        self.heat = 0.0
        self.heat_at: list[tuple[float, float]] = []

    def add(self, interval):
        first = int(np.searchsorted(self.time, interval.start - 1e-12))
        last = int(np.searchsorted(self.time, interval.stop + 1e-12))
        inside = slice(first, last)
        t = np.maximum(self.time[inside] - interval.start, 0.0)
        if len(t):
            self.x[:, inside] = x = interval.motion.state(t)
            self.torque[:, inside] = interval.motion.clutch_torque(t, x)
            self.mode[inside] = interval.modes[0]
            self.capacity[inside] = interval.motion.segment.values(t)[-1]
        self.heat += float(interval.motion.heat(interval.stop - interval.start)[0])
        self.heat_at.append((interval.stop, self.heat))

    def note(self, k: int, wanted: float, command: float):
        self.demand[k * self.steps :], self.command[k * self.steps :] = wanted, command

    def response(self, run: Run, clutch: str, engine: str) -> Response:
        core, model = self.core, self.core.model
        rows = output_rows(model)
        u = np.zeros((len(model.inputs), len(self.time)))
        index = model.inputs.index(f"{engine}_torque")
        u[index] = self.command if len(core.A) == core.r + core.n else self.x[-1]
        mechanical = self.x[: core.r + core.n]
        y = output_map(Plant(model)) @ np.concatenate([mechanical, self.torque, u])
        times = np.array([time for time, _ in self.heat_at])
        events = []
        for record in run.events:
            known = int(np.searchsorted(times, record.time, side="right")) - 1
            kind = {STUCK: "lock", FREE: "release"}.get(record.after, "slip")
            events.append(Event(record.time, clutch, kind, record.after, self.heat_at[known][1] if known >= 0 else 0.0))
        inputs = ("torque_demand", f"{clutch}_capacity")
        outputs = (*rows.names, f"{clutch}_mode", COMMAND, f"{engine}_torque")
        values = np.vstack([self.demand, self.capacity, y, self.mode, self.command, u[index]])
        final = State(float(self.time[-1]), {}, {}, {clutch: run.modes[0]})
        return Response(
            self.time, inputs, outputs, tuple(events), {clutch: self.heat}, final, values, title="controlled launch"
        )
