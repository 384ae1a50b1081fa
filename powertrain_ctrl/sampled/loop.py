"""A sampled controller on its plant, stepped exactly from sample to sample."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import control
import numpy as np

from ..base.checks import MOST, AtLeastOne, Seconds, Torque
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError, SignalError
from ..hybrid.response import Response, State
from ..hybrid.signals import HalfSine, PiecewiseLinear, TimeFunction, value_at
from ..hybrid.simulation import simulate_as_set
from ..linear.assembly import kept
from .controller import ControllerStepper
from .fold import Fold
from .plant import SAME_INSTANT, SampledPlant, hold_matrices
from .sensors import Sensors

# Half a sample counts as a whole one and a torque is at its limit, also if rounding leaves this much [-].
ROUNDED = 1e-9


@checked
def closed_loop(
    plant: SampledPlant,
    controller: control.NonlinearIOSystem | None,
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
    controller : control.StateSpace, control.NonlinearIOSystem or None
        As in `ControllerStepper`; None passes the demand through.
    demand : callable
        Torque demand [N m] as a function of time, read at the samples; a `ramp` for example.
    duration : float
        Length of the response [s], at least one sample.
    disturbance : callable or float, optional
        Force on the vehicle [N]: a `ramp`, `step` or sum of them, whose corners are honoured exactly, a function of
        time, or one number.
    initial_torque : float
        Torque before the manoeuvre, in balance with the load [N m], within the limits; the controller sees what goes
        beyond it.
    sensors : Sensors, optional
        Noise and quantisation of the measured speeds.
    steps_per_sample : int
        Points of the response per sample, >= 1.

    Returns
    -------
    Response
        ``torque_demand``, ``torque_command`` (limited), ``torque_unlimited``, ``engine_torque`` [N m], ``engine_speed``,
        ``wheels_speed``, ``speed_difference`` [rad/s], ``vehicle_acceleration`` [m/s^2], ``intervention`` (command minus
        demand) [N m].

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
    stepper = None if controller is None else ControllerStepper(controller, dt)
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
    fine = (dt / steps_per_sample) * np.arange(count * steps_per_sample + 1)
    # a function of the user's may change between two calls, whatever it looks like
    is_fixed = disturbance is None or isinstance(disturbance, PiecewiseLinear | HalfSine | float | int)
    forced = (_kept_disturbed if is_fixed else _disturbed)(plant, disturbance, count, steps_per_sample)
    noise = (sensors or Sensors()).errors(count + 1)

    limits = tuple(limit - initial_torque for limit in plant.torque_limits)
    slack = ROUNDED * abs(initial_torque)  # a torque that has been computed is at a limit but for rounding
    if not limits[0] <= slack or not limits[1] >= -slack:
        raise ParameterError("closed loop", "initial_torque", initial_torque, "N m", f"within {plant.torque_limits}")
    substeps = _substeps(plant, steps_per_sample)
    read = forced[:2, ::steps_per_sample] + noise
    if sensors is None and (controller is None or isinstance(controller, control.StateSpace)):
        x, commands, unlimited = _folded(plant, controller, substeps, wanted, read, limits)
    else:
        x, commands, unlimited = _stepped(plant, stepper, substeps, wanted, read, limits, sensors)
    if not np.isfinite(unlimited).all():
        t = samples[~np.isfinite(unlimited)][0]
        raise SignalError(f"the command is not finite at t = {t:g} s; the loop is unstable")
    outputs = substeps.outputs(x, commands, count) + forced
    torques = wanted, unlimited, commands[plant.delay_in_samples[0] + 1 :]
    return _response(plant, fine, torques, outputs, initial_torque, steps_per_sample)


def _folded(
    plant: SampledPlant,
    controller: control.StateSpace | None,
    substeps: _Substeps,
    wanted: np.ndarray,
    read: np.ndarray,
    limits: tuple[float, ...],
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States (samples, n), commands from those before the start on, and what was asked for, of a linear controller."""
    n, (whole, _) = plant.continuous.nstates, plant.delay_in_samples
    fold = Fold((substeps.Phi, substeps.late, substeps.early), plant.continuous.C[:2], controller)
    (low, high), late, M = limits, substeps.late, np.ascontiguousarray(fold.M)
    commands, unlimited = [0.0] * (len(wanted) + whole + 1), np.zeros(len(wanted))
    z = np.zeros((len(wanted) + 1, fold.width))
    z[:-1, fold.demand], z[:, fold.ratio], z[:-1, fold.forced :] = wanted, plant.ratio, read.T
    with np.errstate(over="ignore", invalid="ignore"):
        for k in range(fold.begin(wanted, read if read.any() else None), len(wanted)):
            now, then = z[k], z[k + 1, : fold.rows]
            now[fold.new], now[fold.old] = commands[k + 1], commands[k]
            np.dot(M, now, out=then)
            unlimited[k] = command = float(then[-1])
            commands[k + whole + 1] = then[-1] = limited = min(max(command, low), high)
            if not whole:  # it acts at once
                then[:n] += late * limited
    return z[:-1, :n], np.array(commands), unlimited


def _stepped(
    plant: SampledPlant,
    stepper: ControllerStepper | None,
    substeps: _Substeps,
    wanted: np.ndarray,
    read: np.ndarray,
    limits: tuple[float, ...],
    sensors: Sensors | None,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The same of any controller, and of speeds in steps."""
    P, (whole, _), (low, high) = plant.continuous, plant.delay_in_samples, limits
    commands, unlimited = np.zeros(len(wanted) + whole + 1), np.full(len(wanted), np.nan)
    x = np.zeros((len(wanted) + 1, P.nstates))
    limited = 0.0
    for k in range(len(wanted)):
        measured = P.C[:2] @ x[k] + read[:, k]
        if sensors is not None:
            measured = sensors.quantised(measured)
        command = wanted[k]
        if stepper is not None:
            command = stepper.advance(np.array([wanted[k], *measured, limited, plant.ratio]))
        unlimited[k] = command
        if not np.isfinite(command):
            break
        commands[k + whole + 1] = limited = min(max(command, low), high)
        x[k + 1] = substeps.Phi @ x[k] + substeps.late * commands[k + 1] + substeps.early * commands[k]
    return x[:-1], commands, unlimited


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


class _Substeps:
    """Matrices over one sample and to every point in between."""

    def __init__(self, plant: SampledPlant, count: int):
        P, rest = plant.continuous, plant.delay_in_samples[1]
        A, B = P.A, P.B[:, :1]
        self.count = count
        self.Phi, late, early = plant.step_matrices(A, B, plant.dt, rest)
        self.late, self.early = late[:, 0], early[:, 0]
        rows = np.zeros((count, P.noutputs, P.nstates + 2))
        for i in range(count):
            s = i * plant.dt / count
            if s < rest - SAME_INSTANT * plant.dt:
                Phi, early = hold_matrices(A, B, s)
                late, is_new = np.zeros_like(early), 0.0
            else:  # the new command has arrived, if only just
                Phi, late, early = plant.step_matrices(A, B, s, min(rest, s))
                is_new = 1.0
            through = P.D[:, :1]
            rows[i] = np.hstack([P.C @ Phi, P.C @ late + is_new * through, P.C @ early + (1.0 - is_new) * through])
        self.rows = rows.reshape(-1, P.nstates + 2)

    def outputs(self, x: np.ndarray, commands: np.ndarray, count: int) -> np.ndarray:
        """(outputs, fine times) ndarray."""
        acting = np.column_stack([x, commands[1 : count + 2], commands[: count + 1]])
        values = (acting @ self.rows.T).reshape(count + 1, self.count, -1)
        return values.transpose(2, 0, 1).reshape(values.shape[2], -1)[:, : count * self.count + 1]


_substeps = kept(64)(_Substeps)


def _disturbed(
    plant: SampledPlant, disturbance: Callable[[float], Any] | float | None, count: int, steps_per_sample: int
) -> np.ndarray:
    """(outputs, times) ndarray: what the force on the vehicle adds without the controller; the plant is linear."""
    times = (plant.dt / steps_per_sample) * np.arange(count * steps_per_sample + 1)
    outputs = np.zeros((len(plant.outputs), len(times)))
    if disturbance is None:
        return outputs
    response = simulate_as_set(plant.car, times, {f"{plant.vehicle}_force": disturbance}, {})
    outputs[0] = response[f"{plant.engine}_speed"]
    outputs[1] = np.mean([response[f"{wheel}_speed"] for wheel in plant.wheels], axis=0)
    outputs[2] = outputs[0] - plant.ratio * outputs[1]
    outputs[3] = response[f"{plant.vehicle}_acceleration"]
    return outputs


_kept_disturbed = kept(64)(_disturbed)


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
