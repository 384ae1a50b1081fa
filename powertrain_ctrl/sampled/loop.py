"""A sampled controller on its plant, stepped exactly from sample to sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import isfinite
from typing import Any, NamedTuple

import control
import numpy as np

from ..base.checks import MOST, AtLeastOne, Seconds, Torque
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError, SignalError
from ..hybrid.model import plants_of
from ..hybrid.response import Response, State
from ..hybrid.signals import HalfSine, PiecewiseLinear, TimeFunction, value_at
from ..hybrid.simulation import simulate_as_set
from ..linear.assembly import kept
from .arrivals import Arrivals
from .cores import Core, HybridCore, LinearCore, sample_matrices
from .directed import DirectedCore
from .engaged import limits_with, stepper_of
from .fold import Fold
from .plant import SampledPlant
from .sensors import Sensors
from .unit import Controller

# Half a sample counts as a whole one and a torque is at its limit, also if rounding leaves this much [-].
ROUNDED = 1e-9


@checked
def closed_loop(
    plant: SampledPlant,
    controller: Controller,
    demand: TimeFunction,
    duration: Seconds = 4.0,
    disturbance: TimeFunction | float | None = None,
    initial_torque: Torque = 0.0,
    sensors: Sensors | None = None,
    steps_per_sample: AtLeastOne = 10,
) -> Response:
    """Exact response of plant and controller to a torque demand and a force on the vehicle.

    Parameters
    ----------
    plant : SampledPlant
    controller : ControlUnit, control.StateSpace, control.NonlinearIOSystem or None
        As in `ControllerStepper`; None passes the demand through. A unit has driven steadily in the gear nearest to the
        plant's ratio. Its own limits and rate count first, and its controller is told of them; then those of the plant,
        of which it is not, as in `controlled_run`.
    demand : callable
        Torque demand [N m] as a function of time, read at the samples; a `ramp` for example.
    duration : float
        Length of the response [s], at least one sample.
    disturbance : callable or float, optional
        Force on the vehicle [N]: a `ramp`, `step` or sum of them, whose corners are honoured exactly, a function of
        time, or one number.
    initial_torque : float
        Torque before the manoeuvre, in balance with the load [N m], within all limits; the controller sees what goes
        beyond it.
    sensors : Sensors, optional
        Noise and quantisation of the measured speeds.
    steps_per_sample : int
        Points of the response per sample, >= 1.

    Returns
    -------
    Response
        ``torque_demand``, ``torque_command`` (limited), ``torque_unlimited`` (before the limits of the plant),
        ``engine_torque`` [N m], ``engine_speed``, ``wheels_speed``, ``speed_difference`` [rad/s],
        ``vehicle_acceleration`` [m/s^2], ``intervention`` (command minus demand) [N m]; of a car with play, stages
        or other laws, which is followed exactly too, all signals of the driveline and the events besides.

    Raises
    ------
    PowertrainError
        A controller that does not fit; less than one sample.
    ParameterError
        An initial torque outside the limits.
    SignalError
        A demand, command or response that is not finite.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> tip_in = pt.closed_loop(plant, None, pt.ramp(0.5, 0.1, 250.0))
    >>> round(float(tip_in["vehicle_acceleration"].max()), 2)
    6.24
    """
    dt = plant.dt
    stepper = stepper_of(controller, plant, initial_torque)
    count = whole_samples(plant, duration, steps_per_sample)
    for name, signal in (("demand", demand), ("disturbance", disturbance)):
        if not (callable(signal) or (name == "disturbance" and isinstance(signal, float | int | None))):
            raise SignalError(f"the {name} is {type(signal).__name__}, permitted: a function of time, such as a ramp")
    samples = dt * np.arange(count + 1)
    if isinstance(demand, PiecewiseLinear):
        wanted = np.asarray(demand(samples)) - initial_torque
    else:
        wanted = np.array([value_at(demand, float(t), "the torque demand") for t in samples]) - initial_torque
    if not np.isfinite(wanted).all():
        raise SignalError(f"the torque demand is not finite at t = {samples[~np.isfinite(wanted)][0]:g} s")
    require_within("closed loop", limits_with(plant, controller), initial_torque)
    low, high = (limit - initial_torque for limit in plant.limits)
    noise = (sensors or Sensors()).errors(count + 1)

    demanded, ratio = wanted.tolist(), plant.ratio

    def command(k: int, measured: np.ndarray, limited: float) -> float:
        if stepper is None:
            return demanded[k]
        if sensors is not None:
            measured = sensors.quantised(measured + noise[:, k])
        return stepper.advance(np.array([demanded[k], *measured.tolist(), limited, ratio]))

    fine = (dt / steps_per_sample) * np.arange(count * steps_per_sample + 1)
    is_folded = plant.is_linear and sensors is None and not plant.has_direction
    if is_folded and (controller is None or isinstance(controller, control.StateSpace)):
        forced = _forced(plant, disturbance, count, steps_per_sample)
        commands, x = _folded(plant, controller, wanted, forced, (low, high), steps_per_sample)
        outputs = sample_matrices(plant, steps_per_sample).outputs(x, commands.acting) + forced
        torques = wanted, commands.unlimited, commands.limited
        return _response(plant, fine, torques, outputs, initial_torque, steps_per_sample)
    core: LinearCore | DirectedCore | HybridCore
    if plant.is_linear:
        forced = _forced(plant, disturbance, count, steps_per_sample)
        core = (DirectedCore if plant.has_direction else LinearCore)(plant, count, steps_per_sample, forced)
    else:
        core = _law_core(plant, disturbance, fine, steps_per_sample, initial_torque)
    # the command of the last sample is shown, though nothing follows it
    commands = sampled_loop(plant, core, command, (low, high), count + 1, steps=count)
    torques = wanted, commands.unlimited, commands.limited
    if isinstance(core, HybridCore):
        return _law_response(plant, core, torques, initial_torque, steps_per_sample)
    return _response(plant, fine, torques, core.outputs(commands.acting), initial_torque, steps_per_sample)


def _forced(
    plant: SampledPlant, disturbance: Callable[[float], Any] | float | None, count: int, steps_per_sample: int
) -> np.ndarray:
    """What the force on the vehicle adds; kept, but a function of the user's may change between two calls."""
    is_fixed = disturbance is None or isinstance(disturbance, PiecewiseLinear | HalfSine | float | int)
    return (_kept_disturbed if is_fixed else _disturbed)(plant, disturbance, count, steps_per_sample)


def _law_core(
    plant: SampledPlant,
    disturbance: Callable[[float], Any] | float | None,
    time: np.ndarray,
    steps_per_sample: int,
    initial_torque: float,
) -> HybridCore:
    """A car with play, stages or other laws, its torque in balance with a force on the vehicle."""
    engine, force = f"{plant.engine}_torque", plant.push
    balance = -initial_torque * plant.ratio / plant.vehicle_radius
    total: Any = balance
    if isinstance(disturbance, PiecewiseLinear):
        total = disturbance + PiecewiseLinear((0.0,), (balance,))
    elif callable(disturbance):
        total = lambda t: balance + value_at(disturbance, t, "the disturbance")  # noqa: E731
    elif disturbance is not None:
        total = balance + disturbance
    plants = plants_of(plant.car, as_set=True)
    inputs = {force: total, **plants.capacity}
    load = {engine: initial_torque, force: balance}
    return HybridCore(plant, plants.model, plants.unknown, time, steps_per_sample, inputs, {}, load)


class Limiter:
    """What the actuator makes of a command: not faster than its rate, not beyond its limits.

    Torques and speeds are those beyond the initial ones; ``limits`` are the plant's at its initial speed.
    """

    def __init__(self, plant: SampledPlant, limits: tuple[float, float], initial_speed: float | None = None):
        self.plant, self.by_speed = plant, plant.is_limited_by_speed
        self.low, self.high = limits
        self.initial_torque = plant.limits[0] - self.low if self.by_speed else 0.0
        self.initial_speed = plant.speed if initial_speed is None else initial_speed
        rise, fall = plant.rates
        self.rise, self.fall = rise * plant.dt, fall * plant.dt

    def __call__(self, command: float, before: float, speed: float) -> float:
        """The command [N m] after that of the sample before, at a speed [rad/s]."""
        low, high = self.low, self.high
        if self.by_speed:
            low, high = (limit - self.initial_torque for limit in self.plant.limits_at(self.initial_speed + speed))
        return min(max(min(max(command, before - self.fall), before + self.rise), low), high)


def require_within(owner: str, limits: tuple[float, float], initial_torque: float) -> None:
    """An initial torque outside the limits is a `ParameterError`; a computed one is at a limit but for rounding."""
    low, high = limits
    slack = ROUNDED * abs(initial_torque)
    if not low - initial_torque <= slack or not high - initial_torque >= -slack:
        raise ParameterError(owner, "initial_torque", initial_torque, "N m", f"within {limits}")


class Commands(NamedTuple):
    """Commands [N m] of all samples, and those acting (samples, 2) at the beginning and at the end of each."""

    unlimited: np.ndarray
    limited: np.ndarray
    acting: np.ndarray


@np.errstate(over="ignore", invalid="ignore")
def _folded(
    plant: SampledPlant,
    controller: control.StateSpace | None,
    wanted: np.ndarray,
    forced: np.ndarray,
    limits: tuple[float, float],
    points: int,
) -> tuple[Commands, np.ndarray]:
    """`sampled_loop` of a linear controller, a sample by one product; and the states (samples, n) of the plant."""
    known, limiter = sample_matrices(plant, points), Limiter(plant, limits)
    whole, n, engine = plant.delay_in_samples[0], plant.continuous.nstates, plant.continuous.C[0]
    fold = Fold((known.Phi, known.late, known.early), plant.continuous.C[:2], controller)
    M, read = np.ascontiguousarray(fold.M), forced[:2, ::points]
    unlimited, acting, limited = np.zeros(len(wanted)), [0.0] * (len(wanted) + whole + 1), 0.0
    z = np.zeros((len(wanted) + 1, fold.width))
    z[:-1, fold.demand], z[:, fold.ratio], z[:-1, fold.forced :] = wanted, plant.ratio, read.T
    for k in range(fold.begin(wanted, read), len(wanted)):
        now, then = z[k], z[k + 1, : fold.rows]
        now[fold.new], now[fold.old] = acting[k + 1], acting[k]
        np.dot(M, now, out=then)
        unlimited[k] = asked = float(then[-1])
        if not isfinite(asked):
            raise SignalError(f"the command is not finite at t = {k * plant.dt:g} s; the loop is unstable")
        speed = float(engine @ now[:n]) + read[0, k] if limiter.by_speed else 0.0
        acting[k + whole + 1] = then[-1] = limited = limiter(asked, limited, speed)
        if not whole:  # it acts at once
            then[:n] += known.late * limited
    commands, count = np.array(acting), len(wanted)
    between = np.column_stack([commands[:count], commands[1 : count + 1]])
    return Commands(unlimited, commands[whole + 1 :], between), z[:-1, :n]


@np.errstate(over="ignore", invalid="ignore")
def sampled_loop(
    plant: SampledPlant,
    core: Core,
    command: Callable[[int, np.ndarray, float], float],
    limits: tuple[float, float],
    samples: int,
    steps: int,
    initial_speed: float | None = None,
) -> Commands:
    """Measure, command, limit, delay and hold, sample by sample.

    ``command`` gives the torque [N m] from the number of the sample, what is measured there and the limited command of
    the sample before.
    """
    arrivals, limiter = Arrivals(plant), Limiter(plant, limits, initial_speed)
    unlimited, sent, acting = np.zeros(samples), np.zeros(samples), np.zeros((samples, 2))
    limited = 0.0
    for k in range(samples):
        measured = core.measured
        asked = command(k, measured, limited)
        if not isfinite(asked):
            raise SignalError(f"the command is not finite at t = {k * plant.dt:g} s; the loop is unstable")
        unlimited[k] = asked
        sent[k] = limited = float(limiter(asked, limited, float(measured[0])))
        arrivals.send(k, limited)
        now = arrivals.during(k)
        acting[k] = now[0].command, now[-1].command
        if k < steps:
            core.step(now)
    return Commands(unlimited, sent, acting)


def whole_samples(plant: SampledPlant, duration: float, steps_per_sample: int) -> int:
    """Samples in a duration, at least one."""
    count = int(np.floor(duration / plant.dt + (0.5 + ROUNDED))) if np.isfinite(duration) else 0
    if count < 1:
        raise PowertrainError(f"the response ends at {duration} s, permitted: at least one sample of {plant.dt:g} s")
    if count * steps_per_sample > MOST:
        raise PowertrainError(
            f"the response to {duration:g} s has {count * steps_per_sample:g} points, permitted: at most {MOST:g}; end it "
            "earlier or take fewer steps_per_sample"
        )
    return count


def _disturbed(
    plant: SampledPlant, disturbance: Callable[[float], Any] | float | None, count: int, steps_per_sample: int
) -> np.ndarray:
    """(outputs, times) ndarray: what the force on the vehicle adds without the controller; the plant is linear."""
    times = (plant.dt / steps_per_sample) * np.arange(count * steps_per_sample + 1)
    outputs = np.zeros((len(plant.outputs), len(times)))
    if disturbance is None:
        return outputs
    response = simulate_as_set(plant.car, times, {plant.push: disturbance}, {})
    outputs[0] = response[f"{plant.engine}_speed"]
    outputs[1] = np.mean([response[f"{wheel}_speed"] for wheel in plant.wheels], axis=0)
    outputs[2] = outputs[0] - plant.ratio * outputs[1]
    outputs[3] = response[f"{plant.vehicle}_acceleration"]
    return outputs


_kept_disturbed = kept(64)(_disturbed)


def _law_response(
    plant: SampledPlant,
    core: HybridCore,
    torques: tuple[np.ndarray, ...],
    initial_torque: float,
    steps_per_sample: int,
) -> Response:
    """The response of a car with laws: all signals of the driveline and the events besides."""
    found, recorder = core.signals(), core.recorder
    engine = found[f"{plant.engine}_speed"]
    wheels = np.mean([found[f"{wheel}_speed"] for wheel in plant.wheels], axis=0)
    acceleration = found[f"{plant.vehicle}_acceleration"]
    torque = found[core.command] - initial_torque
    outputs = np.array([engine, wheels, engine - plant.ratio * wheels, acceleration, torque])
    response = _response(plant, recorder.timepts, torques, outputs, initial_torque, steps_per_sample)
    more = {name: values for name, values in found.items() if name not in response}
    return replace(
        response,
        outputs=(*response.outputs, *more),
        events=tuple(recorder.events(core.run)),
        slip_energy=recorder.slip_energy,
        _values=np.vstack([response._values, *more.values()]),
    )


def _response(
    plant: SampledPlant,
    fine: np.ndarray,
    torques: tuple[np.ndarray, ...],
    outputs: np.ndarray,
    initial_torque: float,
    steps_per_sample: int,
) -> Response:
    wanted, unlimited, commands = (torque + initial_torque for torque in torques)
    index = np.arange(len(fine)) // steps_per_sample
    outputs[plant.outputs.index("engine_torque")] += initial_torque
    signals: Mapping[str, np.ndarray] = {
        "torque_demand": wanted[index],
        "torque_command": commands[index],
        "torque_unlimited": unlimited[index],
        "intervention": (commands - wanted)[index],
        **dict(zip(plant.outputs, outputs, strict=True)),
    }
    values = np.array(list(signals.values()))
    if not np.isfinite(values).all():
        raise SignalError("the response is not finite; the loop is unstable")
    names = tuple(signals)
    final = State(float(fine[-1]), {}, {}, {})
    return Response(fine, names[:1], names[1:], (), {}, final, values, title="closed loop")
