"""What runs in a control unit: controllers by gear, engaged and let go without a bump; limits, rate; a clutch's capacity."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import Any, TypeAlias

import control
import numpy as np

from ..base.checks import Period, Ratio, Torque
from ..base.doors import checked
from ..base.errors import PowertrainError, SignalError
from ..base.records import Record
from .actuator import both, limits_at, limits_of, limits_written, rate_of, rates_written
from .controller import BUMP, ControllerStepper, check_controller
from .plant import SAME_INSTANT, is_sampled_every

# Ratios that are nearer to the one read by less than this share of it are equally near.
AS_NEAR = 1e-9
# A ratio [-] that says that no gear drives the wheels: a clutch slips or is open.
NO_GEAR = 0.0
# What a controller of a clutch can ask for by the names of its inputs, and what it gives.
CLUTCH_INPUTS = ("slip_speed", "planned_capacity", "torque_command")
CAPACITY = "capacity"


@checked
@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class ControlUnit(Record):
    """Controllers by gear behind one supervisor, with limits and a rate of change; what `c_source` makes C of.

    While a clutch slips the torque does not reach the wheels, so the demand passes. When a gear engages, its controller
    starts relative to the demand and the engine speed of that sample, its filters as if what twists then had done so for
    50 ms; the step that the command then makes is taken off and dies out with that time constant, and so it is when the gear
    lets go. A compensation, of what a clutch takes away, goes past the controller. The command keeps within the limits and
    changes no faster than it may; the controller is told what became of it (``torque_limited``), by which it does not wind
    up. A unit stands wherever a controller does: in `closed_loop` and every manoeuvre, in `loop_margins` and `robustness`.

    Parameters
    ----------
    controllers : mapping, control system or None
        Ratio of engine to wheel speed (`SampledPlant.ratio`) to controller as in `ControllerStepper`, the nearest counts; or
        one for any gear; None passes the demand.
    dt : float
        Sample time [s].
    torque_limits : (float, float) or mapping
        Smallest and largest command [N m], or these by speed of the engine [rad/s], as of a `SampledPlant`.
    torque_rate : float or (float, float)
        Fastest change of the command [N m/s], > 0; two of them are that of a rise and that of a fall.

    Raises
    ------
    PowertrainError
        A controller that does not fit.
    ParameterError
        Limits that are not in order, a rate that is not > 0.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> unit = pt.ControlUnit(controllers=controller, dt=0.01, torque_limits=(0.0, 350.0), torque_rate=(2e3, 4e3))
    >>> stepper = unit.start(torque=100.0)
    >>> gears = (0.0, 18.0, 18.0)  # a clutch slips, then first gear drives
    >>> read = {"torque_demand": 150.0, "engine_speed": 190.0, "wheels_speed": 10.0}
    >>> [round(stepper.step(**read, ratio=gear), 2) for gear in gears]
    [120.0, 120.0, 114.56]
    """

    controllers: Mapping[Ratio, control.NonlinearIOSystem] | control.NonlinearIOSystem | None
    dt: Period
    torque_limits: Any = (-inf, inf)
    torque_rate: Any = inf

    def __post_init__(self) -> None:
        for _, controller in self.by_ratio:
            check_controller(controller, self.dt)
        object.__setattr__(self, "torque_limits", limits_of(self.torque_limits, "control unit"))
        object.__setattr__(self, "torque_rate", rate_of(self.torque_rate, "control unit"))

    def __repr__(self) -> str:
        table = self.limits
        limits = limits_written(min(row[1] for row in table), max(row[2] for row in table))
        gears = ", ".join("any gear" if ratio is None else f"{ratio:g}" for ratio, _ in self.by_ratio) or "none"
        return f"ControlUnit: dt {1e3 * self.dt:g} ms, {limits}, {rates_written(*self.rates)}; controllers for {gears}"

    @property
    def limits(self) -> tuple[tuple[float, float, float], ...]:
        """Speed [rad/s], smallest and largest command there [N m]; one row where they are the same at any speed."""
        limits = self.torque_limits
        return limits if isinstance(limits[0], tuple) else ((0.0, *limits),)

    @property
    def rates(self) -> tuple[float, float]:
        """Fastest rise and fall of the command [N m/s]."""
        return both(self.torque_rate)

    @property
    def by_ratio(self) -> tuple[tuple[float | None, control.NonlinearIOSystem], ...]:
        """Ratio and controller of each gear; None is the ratio of a controller for any."""
        if self.controllers is None:
            return ()
        if isinstance(self.controllers, Mapping):
            return tuple(self.controllers.items())
        return ((None, self.controllers),)

    @checked
    def at_ratio(self, ratio: Ratio) -> control.NonlinearIOSystem | None:
        """The controller that acts at a ratio, the nearest; None where the demand passes."""
        gear = self.gear_at(ratio)
        return None if gear is None else self.by_ratio[gear][1]

    def gear_at(self, ratio: float) -> int | None:
        """Its place in `by_ratio`."""
        if ratio == NO_GEAR or not self.by_ratio:
            return None
        distances = [0.0 if own is None else abs(own - ratio) for own, _ in self.by_ratio]
        near = min(distances) + AS_NEAR * abs(ratio)
        return next(i for i, distance in enumerate(distances) if distance <= near)

    @property
    def run_in(self) -> int:
        """Samples for which a controller that engages has read what it reads then."""
        return round(BUMP / self.dt)

    @property
    def forget(self) -> float:
        """What is left of a bump a sample later [-]."""
        return float(np.exp(-self.dt / BUMP))

    @checked
    def start(self, torque: Torque = 0.0) -> UnitStepper:
        """The unit at work, after a command of ``torque`` [N m]."""
        return UnitStepper(self, torque)


# What commands a torque: a unit, the controller that a unit then has for any gear, or the demand alone.
Controller: TypeAlias = ControlUnit | control.NonlinearIOSystem | None


def check_acting(controller: Controller, dt: float) -> None:
    """Raise a `PowertrainError` unless this commands the torque of a plant with sample time ``dt``."""
    if isinstance(controller, ControlUnit):
        if abs(controller.dt - dt) > SAME_INSTANT * dt:
            raise PowertrainError(f"the unit has dt = {controller.dt:g} s, the plant {dt:g} s, permitted: the same")
    elif controller is not None:
        check_controller(controller, dt)


class UnitStepper:
    """A `ControlUnit` at work: ``gear`` is the place of its controller or None, ``limited`` the last command [N m].

    ``net`` is the last command without what compensates.
    """

    def __init__(self, unit: ControlUnit, torque: float):
        self.unit, self.limited, self.net = unit, torque, torque
        self.gear: int | None = None
        self.bump, self.base = 0.0, np.zeros(4)

    def step(
        self,
        torque_demand: float,
        engine_speed: float,
        wheels_speed: float,
        ratio: float,
        torque_compensation: float = 0.0,
    ) -> float:
        """Command [N m] of one sample; ``ratio`` of engine to wheel speed as a gear drives, 0 where none does."""
        unit, wanted = self.unit, torque_demand
        gear = unit.gear_at(ratio)
        self.bump *= unit.forget
        target = wanted
        if gear is not None:
            if gear != self.gear:
                self._stepper = ControllerStepper(unit.by_ratio[gear][1], unit.dt)
                # what twists at this sample is no deviation that stays: it is there to be damped
                self.base = np.array([wanted, engine_speed, engine_speed / ratio, wanted])
            read = np.append(np.array([wanted, engine_speed, wheels_speed, self.net]) - self.base, ratio)
            if gear != self.gear:
                for _ in range(unit.run_in):
                    self._stepper.advance(read)
            target = self._stepper.advance(read) + float(self.base[0])
        if gear != self.gear:
            self.gear, self.bump = gear, self.net - target
        (low, high), (rise, fall) = limits_at(unit.torque_limits, engine_speed), unit.rates
        command = min(max(target + self.bump + torque_compensation, low), high)
        self.limited = float(min(max(command, self.limited - fall * unit.dt), self.limited + rise * unit.dt))
        self.net = self.limited - torque_compensation
        return self.limited


class CapacityStepper:
    """A discrete-time python-control system that commands a capacity, one sample at a time; it never is negative."""

    def __init__(self, clutch: str, system: control.NonlinearIOSystem, dt: float):
        known = ", ".join(CLUTCH_INPUTS)
        if not is_sampled_every(dt, system):
            raise PowertrainError(
                f"the controller of {clutch} has dt = {system.dt} s, permitted: {dt:g} s as the plant"
            )
        for label in system.input_labels:
            if label not in CLUTCH_INPUTS:
                raise PowertrainError(f'the controller of {clutch} has the input "{label}", permitted: {known}')
        if list(system.output_labels) != [CAPACITY]:
            raise PowertrainError(
                f"the controller of {clutch} has outputs {system.output_labels}, permitted: {CAPACITY} alone"
            )
        self.clutch, self.system = clutch, system
        self.x, self.time = np.zeros(system.nstates), 0.0
        self._picked = [CLUTCH_INPUTS.index(label) for label in system.input_labels]

    def step(self, slip_speed: float, planned_capacity: float, torque_command: float) -> float:
        """Capacity [N m] over the sample that begins with this slip [rad/s], plan and last torque command [N m]."""
        u = np.array([slip_speed, planned_capacity, torque_command])[self._picked]
        capacity = float(np.asarray(self.system.output(self.time, self.x, u))[0])
        self.x = np.asarray(self.system.dynamics(self.time, self.x, u))
        if not np.isfinite(capacity):
            raise SignalError(
                f"the capacity of {self.clutch} is not finite at t = {self.time:g} s; its loop is unstable"
            )
        self.time += float(self.system.dt)
        return max(capacity, 0.0)
