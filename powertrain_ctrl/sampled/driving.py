"""A control unit that drives a car through slip and lock of its clutches: exact from sample to sample and event to event."""

from __future__ import annotations

from collections.abc import Mapping

import control
import numpy as np

from ..base.checks import Seconds
from ..base.doors import checked
from ..base.errors import SignalError, TopologyError, UnknownNameError
from ..driveline.collection import Driveline, HasDriveline
from ..hybrid.model import plants_of
from ..hybrid.plans import capacities_as_set, turning
from ..hybrid.response import Response, State
from ..hybrid.signals import Pieces, Signal, TimeFunction, value_at
from ..hybrid.starts import started
from ..linear.assembly import as_driveline
from .cores import HybridCore
from .loop import sampled_loop, whole_samples
from .plant import COMMAND, SampledPlant
from .unit import NO_GEAR, CapacityStepper, Controller, ControlUnit, check_acting

# Points of the response per sample.
STEPS = 10
Systems = Mapping[str, control.NonlinearIOSystem]


@checked
def controlled_run(
    plant: SampledPlant,
    controller: Controller,
    demand: TimeFunction,
    inputs: Mapping[str, Signal] | None = None,
    duration: Seconds = 4.0,
    car: HasDriveline | None = None,
    initial_state: State | None = None,
    clutch_controllers: Systems | None = None,
) -> Response:
    """A manoeuvre in which clutches slip and lock, with lag, delay, limits and sampling of the torque and its controller.

    Parameters
    ----------
    plant : SampledPlant
        Actuator, sensors and sample time; its engine and wheels are nodes of the car.
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        A plain controller works for every gear that engages, as in a `ControlUnit`; None passes the demand.
    demand : callable
        Torque demand [N m] as a function of time, read at the samples; that at 0 s is what the actuator starts from.
    inputs : mapping, optional
        Other inputs as of `simulate`: capacities, torques of other nodes, forces. A capacity that is not given is that of
        the clutch's state in the car: all that it has, or none.
    duration : float
        Length of the response [s], at least one sample.
    car : Driveline, optional
        What is driven, if it is more than the plant's car: with an engine behind an open clutch, another gear.
    initial_state : State, optional
        At rest if not given.
    clutch_controllers : mapping, optional
        Clutch to a discrete python-control system that commands its capacity; inputs among ``slip_speed`` [rad/s],
        ``planned_capacity`` (that of ``inputs``, at the sample) and ``torque_command`` (of the sample before) [N m], one
        output ``capacity`` [N m], held over the sample and never below 0.

    Returns
    -------
    Response
        Signals of `simulate` and ``torque_demand``, ``torque_command`` [N m], ``ratio`` of the gear that drives [-], 0 where
        none does.

    Raises
    ------
    PowertrainError
        A controller that does not fit; an end before the first sample.
    UnknownNameError
        An input or a node that the car does not have.
    SignalError
        A demand that is not finite.

    Examples
    --------
    The road pulls the wheels back with 300 N m for 50 ms:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.electric(), torque_limits=(-300.0, 300.0))
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=0.3))
    >>> pull = pt.ramp(0.2, 0.0, -300.0) + pt.ramp(0.25, 0.0, 300.0)
    >>> response = pt.controlled_run(plant, controller, pt.step(0.0, 0.0), {"wheels_torque": pull}, duration=1.0)
    >>> bool(abs(response["torque_command"]).max() > 1.0)
    True
    """
    driven_car = as_driveline(plant.car if car is None else car)
    unit = unit_of(controller, plant)
    torque = float(np.clip(value_at(demand, 0.0, "the torque demand"), *plant.limits))
    drive = Drive(plant, driven_car, dict(inputs or {}), initial_state, torque, duration)
    for clutch, system in (clutch_controllers or {}).items():
        drive.command_clutch(clutch, system)
    return drive.response(unit, demand, "controlled run")


def unit_of(controller: Controller, plant: SampledPlant) -> ControlUnit:
    """A plain controller as a unit with the limits and the rate of a plant."""
    check_acting(controller, plant.dt)
    if isinstance(controller, ControlUnit):
        return controller
    return ControlUnit(
        controllers=controller, dt=plant.dt, torque_limits=plant.torque_limits, torque_rate=plant.torque_rate
    )


class Gears:
    """Ratios of a car from the driving node of a plant to its wheels, by the clutches that hold."""

    def __init__(self, car: Driveline, plant: SampledPlant):
        self.car, self.plant = car.release(), plant
        self._known: dict[frozenset[str], float] = {}

    def ratio(self, holding: frozenset[str]) -> float:
        """Speed of the driving node over that of the wheels, 0 where nothing connects them or all is held at rest."""
        if holding not in self._known:
            self._known[holding] = self._found(holding)
        return self._known[holding]

    def _found(self, holding: frozenset[str]) -> float:
        locked = self.car.lock(*holding) if holding else self.car
        part = locked.part(self.plant.engine)
        if not set(self.plant.wheels) <= set(part.nodes):
            return NO_GEAR
        try:
            motion = turning(part, self.plant.engine)
        except TopologyError:
            return NO_GEAR
        at_wheels = sum(motion[wheel] for wheel in self.plant.wheels) / len(self.plant.wheels)
        return 1.0 / at_wheels if at_wheels else NO_GEAR


class Drive:
    """A car with the actuator of a plant, ready for one run of a unit."""

    def __init__(
        self,
        plant: SampledPlant,
        car: Driveline,
        inputs: Mapping[str, Signal],
        state: State | None,
        torque: float,
        duration: float,
        steps_per_sample: int = STEPS,
    ):
        self.plant, self.torque, self.steps = plant, torque, steps_per_sample
        for node in (plant.engine, *plant.wheels):
            if node not in car.nodes:
                raise UnknownNameError("node", node, car.nodes, "in the car that the plant is to drive")
        self.gears, plants = Gears(car, plant), plants_of(car)
        self.count = whole_samples(plant, duration, steps_per_sample)
        command = f"{plant.engine}_torque"
        for name in inputs:
            if name not in plants.inputs or name == command:
                known = [name for name in plants.inputs if name != command]
                raise UnknownNameError("signal", name, known, "an input of this car besides that of the actuator")
        as_set: Mapping[str, Signal] = capacities_as_set(car)
        self.given = tuple(inputs)
        time = (plant.dt / steps_per_sample) * np.arange(self.count * steps_per_sample + 1)
        state = State(0.0, {}, {}, {}) if state is None else state
        x = started(plants, 0.0, state.speed, state.twist, None).x
        self.core = HybridCore(
            plant, plants.model, plants.unknown, time, steps_per_sample, {**as_set, **inputs}, {}, {command: torque}, x
        )
        self.clutches: dict[str, CapacityStepper] = {}

    def command_clutch(self, clutch: str, system: control.NonlinearIOSystem) -> None:
        """Let a controller command the capacity of a clutch."""
        names = [law.name for law in self.core.plant.clutches]
        if clutch not in names:
            raise UnknownNameError("clutch", clutch, names, "in this driveline")
        stepper = CapacityStepper(clutch, system, self.plant.dt)
        signal = self.core.plant.clutches[names.index(clutch)].input
        self.clutches[signal] = stepper
        self.given = tuple(dict.fromkeys([*self.given, signal]))

    def _command_clutches(self, k: int, limited: float) -> None:
        core = self.core
        for law, slip in zip(core.plant.clutches, core.plant.slip(core.run.x).tolist(), strict=False):
            if law.input in self.clutches:
                planned = _value_of(core.inputs, core.names.index(law.input), float(core.times[k]))
                core.held[law.input] = self.clutches[law.input].step(slip, planned, limited)

    def response(
        self, unit: ControlUnit, demand: TimeFunction, title: str, compensation: TimeFunction | None = None
    ) -> Response:
        """Signals of `simulate`, demand, command and ratio."""
        core, plant = self.core, self.plant
        wanted, past = (
            self._sampled(signal, what) for signal, what in ((demand, "demand"), (compensation, "compensation"))
        )
        at_work, ratios = unit.start(self.torque), np.zeros(self.count)

        def command(k: int, measured: np.ndarray, limited: float) -> float:
            self._command_clutches(k, limited + self.torque)
            ratios[k] = self.gears.ratio(core.holding)
            engine, wheels = measured.tolist()
            given = at_work.step(float(wanted[k]), engine, wheels, float(ratios[k]), float(past[k]))
            return given - self.torque

        low, high = (limit - self.torque for limit in plant.limits)
        commands = sampled_loop(plant, core, command, (low, high), self.count, self.count, initial_speed=0.0)
        sample = np.minimum(np.arange(len(core.recorder.timepts)) // self.steps, self.count - 1)
        sent, found = commands.limited + self.torque, core.signals()
        torque = found.pop(core.command)
        given = [core.recorder.inputs[core.names.index(name)] for name in self.given]
        laws = zip(core.plant.laws, core.run.modes, strict=True)
        return Response(
            time=core.recorder.timepts,
            inputs=("torque_demand", *self.given),
            outputs=(*found, COMMAND, core.command, "ratio"),
            events=tuple(core.recorder.events(core.run)),
            slip_energy=core.recorder.slip_energy,
            final=State(core.run.time, {}, {}, {law.name: law.shown(mode) for law, mode in laws}),
            _values=np.vstack([wanted[sample], *given, *found.values(), sent[sample], torque, ratios[sample]]),
            title=title,
        )

    def _sampled(self, signal: TimeFunction | None, what: str) -> np.ndarray:
        if signal is None:
            return np.zeros(len(self.core.times))
        values = np.array([value_at(signal, float(t), f"the torque {what}") for t in self.core.times])
        if not np.isfinite(values).all():
            wrong = float(self.core.times[~np.isfinite(values)][0])
            raise SignalError(f"the torque {what} is not finite at t = {wrong:g} s")
        return values


def _value_of(pieces: Pieces, signal: int, time: float) -> float:
    """Value of one of the signals at a time, at a jump that behind it."""
    i = int(np.clip(np.searchsorted(pieces.edges, time, side="right") - 1, 0, len(pieces.coefficients) - 1))
    return float(np.polynomial.polynomial.polyval(time - pieces.edges[i], pieces.coefficients[i, signal]))
