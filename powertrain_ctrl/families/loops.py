"""One sampled controller on all variants at once, stepped exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np

from ..base.errors import ParameterError, PowertrainError, SignalError
from ..hybrid.response import Response
from ..hybrid.signals import HalfSine, TimeFunction, value_at
from ..sampled.controller import check_controller
from ..sampled.loop import ROUNDED, closed_loop, whole_samples
from ..sampled.plant import CONTROLLER_INPUTS, SAME_INSTANT, SampledPlant
from .responses import Lifted
from .stepping import exponential, pulsed
from .structure import Stack, parts_of
from .variants import Variants

OUTPUTS = ("engine_speed", "wheels_speed", "speed_difference", "vehicle_acceleration", "engine_torque")
SIGNALS = ("torque_demand", "torque_command", "torque_unlimited", "intervention", *OUTPUTS)


@dataclass(frozen=True, eq=False)
class Plants:
    """Sampled plants that are variants of one: of its car, and of its times, (n,) arrays [s]."""

    plant: SampledPlant
    lag: np.ndarray
    delay: np.ndarray

    def part(self, places: np.ndarray) -> Plants:
        return Plants(self.plant, self.lag[places], self.delay[places])

    def one(self, i: int, variants: Variants) -> SampledPlant:
        """One of them."""
        try:
            return replace(self.plant, car=variants.car_of(i), lag=float(self.lag[i]), delay=float(self.delay[i]))
        except PowertrainError as error:
            error.args = (f"{variants.called(i)}: {error}",)
            raise


@dataclass(frozen=True, eq=False)
class Trial:
    """What a closed loop is told: as of `closed_loop`, the demand at the samples."""

    controller: control.NonlinearIOSystem | None
    demand: TimeFunction
    wanted: np.ndarray
    disturbance: HalfSine | None
    initial_torque: float
    steps: int

    @property
    def count(self) -> int:
        return len(self.wanted) - 1


def trial_of(
    plant: SampledPlant,
    controller: control.NonlinearIOSystem | None,
    demand: TimeFunction,
    duration: float,
    disturbance: Any,
    initial_torque: float,
    steps: int,
) -> Trial:
    """The trial, its controller and its demand checked."""
    if controller is not None:
        check_controller(controller, plant.dt)
    if not callable(demand):
        raise SignalError(f"the demand is {type(demand).__name__}, permitted: a function of time, such as a ramp")
    count = whole_samples(plant, duration, steps)
    low, high = plant.torque_limits
    slack = ROUNDED * abs(initial_torque)
    if not low - initial_torque <= slack or not high - initial_torque >= -slack:
        raise ParameterError("closed loop", "initial_torque", initial_torque, "N m", f"within {plant.torque_limits}")
    samples = plant.dt * np.arange(count + 1)
    wanted = np.array([value_at(demand, float(t), "the torque demand") for t in samples]) - initial_torque
    return Trial(controller, demand, wanted, disturbance, initial_torque, steps)


def loops_of(variants: Variants, plants: Plants, trial: Trial, signals: Sequence[str]) -> dict[str, np.ndarray]:
    """``values`` (n, signals, N) of some variants, and their ``final`` (n,) acceleration per engine torque."""
    values = np.empty((len(variants), len(signals), trial.count * trial.steps + 1))
    final = np.empty(len(variants))
    for places, part, stack in parts_of(variants):
        some = plants.part(places)
        batch = None if stack is None or not _is_linear(trial) else batch_of(stack, some)
        if batch is not None:
            values[places], final[places] = _loops(batch, trial, signals), batch.final
            continue
        for i, place in enumerate(places):
            plant = some.one(i, part)
            response = _single(plant, trial)
            values[place], final[place] = [response[name] for name in signals], plant.final_acceleration
    return {"values": values, "final": final}


def _is_linear(trial: Trial) -> bool:
    is_linear = trial.controller is None or isinstance(trial.controller, control.StateSpace)
    return is_linear and (trial.disturbance is None or isinstance(trial.disturbance, HalfSine))


def _single(plant: SampledPlant, trial: Trial) -> Response:
    duration = trial.count * plant.dt
    return closed_loop(
        plant,
        trial.controller,
        trial.demand,
        duration=duration,
        disturbance=trial.disturbance,
        initial_torque=trial.initial_torque,
        steps_per_sample=trial.steps,
    )


@dataclass(frozen=True, eq=False)
class Batch:
    """Sampled plants as ``x' = A x + command B + force G``, outputs ``C x + command D + force E``, arrays (n, ...).

    ``whole`` and ``rest`` are samples and rest [s] of the delay, ``ratio`` and ``final`` as of `SampledPlant`.
    """

    plant: SampledPlant
    A: np.ndarray
    B: np.ndarray
    G: np.ndarray
    C: np.ndarray
    D: np.ndarray
    E: np.ndarray
    whole: np.ndarray
    rest: np.ndarray
    ratio: np.ndarray
    final: np.ndarray


def batch_of(stack: Stack, plants: Plants) -> Batch | None:
    """Plants of one structure; None where one of them has to be stepped by itself."""
    first = plants.one(0, stack.variants)
    motion = stack.rolling
    with_lag = plants.lag > 0.0
    if motion is None or (with_lag.any() and not with_lag.all()):
        return None
    system = Lifted(stack)
    n, count = system.r + system.n, stack.count
    share = 1.0 / len(first.wheels)
    wheels = sum(system.node(wheel) for wheel in first.wheels) * share
    wheel_motion = stack.combined(dict.fromkeys(first.wheels, share), motion)
    ratio = np.array(stack.column(stack.combined({first.engine: 1.0}, motion) / wheel_motion))
    engine, vehicle = system.node(first.engine), system.node(first.vehicle)
    speeds = np.stack([engine, wheels, engine - ratio[:, None] * wheels], axis=1)
    acceleration = system.acceleration(first.vehicle)
    direct, force = ((vehicle[:, None] @ load[..., None])[:, 0, 0] for load in (engine, vehicle))
    size = n + 1 if with_lag.all() else n
    A, B, G = np.zeros((count, size, size)), np.zeros((count, size)), np.zeros((count, size))
    C, D, E = np.zeros((count, 5, size)), np.zeros((count, 5)), np.zeros((count, 5))
    A[:, :n, :n], G[:, :n] = system.A, vehicle
    C[:, :3, :n], C[:, 3, :n], E[:, 3] = speeds, acceleration, force
    if with_lag.all():
        A[:, :n, n], A[:, n, n], B[:, n] = engine, -1.0 / plants.lag, 1.0 / plants.lag
        C[:, 3, n], C[:, 4, n] = direct, 1.0
    else:
        B[:, :n] = engine
        D[:, 3], D[:, 4] = direct, 1.0
    dt = first.dt
    whole = np.floor(plants.delay / dt + SAME_INSTANT).astype(int)
    rest = plants.delay - whole * dt
    rest[rest <= SAME_INSTANT * dt] = 0.0
    return Batch(first, A, B, G, C, D, E, whole, rest, ratio, stack.final_acceleration(first.engine))


@dataclass(frozen=True, eq=False)
class _Inside:
    """States at points of a sample: ``Phi x + new command times late + the one before times early``.

    Arrays (n, points + 1, ...); the last one is the next sample. ``is_new`` (n, points) where the new command acts.
    """

    Phi: np.ndarray
    late: np.ndarray
    early: np.ndarray
    is_new: np.ndarray


def inside(batch: Batch, points: int) -> _Inside:
    """Matrices from a sample to the points inside it."""
    count, size = batch.B.shape
    h = batch.plant.dt / points
    W = np.zeros((count, size + 1, size + 1))
    W[:, :size, :size], W[:, :size, size] = batch.A, batch.B
    fine = exponential(W * h)
    step, added = fine[:, :size, :size], fine[:, :size, size]
    arrival = np.ceil(batch.rest / h - SAME_INSTANT * points).astype(int)
    first = np.zeros((count, size))
    if batch.rest.any():
        first = exponential(W * np.maximum(arrival * h - batch.rest, 0.0)[:, None, None])[:, :size, size]
    Phi = np.empty((count, points + 1, size, size))
    late, whole = np.zeros((count, points + 1, size)), np.zeros((count, points + 1, size))
    Phi[:, 0] = np.eye(size)
    late[:, 0] = np.where(arrival[:, None] == 0, first, 0.0)
    for i in range(1, points + 1):
        Phi[:, i] = step @ Phi[:, i - 1]
        whole[:, i] = (step @ whole[:, i - 1, :, None])[..., 0] + added
        further = (step @ late[:, i - 1, :, None])[..., 0] + added
        late[:, i] = np.where(arrival[:, None] == i, first, np.where(arrival[:, None] < i, further, 0.0))
    is_new = arrival[:, None] <= np.arange(points)
    return _Inside(Phi, late, whole - late, is_new)


def _loops(batch: Batch, trial: Trial, signals: Sequence[str]) -> np.ndarray:
    """(n, signals, N) ndarray."""
    points = inside(batch, trial.steps)
    forced = _forced(batch, trial)
    states, commands, unlimited = _stepped(batch, trial, points, forced)
    return _signals(batch, trial, points, forced, (states, commands, unlimited), signals)


def _forced(batch: Batch, trial: Trial) -> np.ndarray | None:
    """(n, 5, N) ndarray: what the force on the vehicle adds to the outputs."""
    force = trial.disturbance
    if force is None:
        return None
    size = batch.B.shape[1]
    times = (batch.plant.dt / trial.steps) * np.arange(trial.count * trial.steps + 1)
    states = pulsed(batch.A, batch.G, force.peak, force.start, force.length, times)
    return np.concatenate([batch.C, batch.E[:, :, None]], axis=2) @ states[:, : size + 1]


class _Controller:
    """Matrices of a controller on its own states, the two speeds, the limited command, demand and ratio."""

    def __init__(self, controller: control.StateSpace | None):
        if controller is None:
            self.A, self.C = np.zeros((0, 0)), np.zeros((1, 0))
            B, D, labels = np.zeros((0, 1)), np.ones((1, 1)), ["torque_demand"]
        else:
            self.A, self.C, B, D = (np.asarray(M, dtype=float) for M in (controller.A, controller.C, controller.B, controller.D))
            labels = list(controller.input_labels)
        picked = np.zeros((len(labels), len(CONTROLLER_INPUTS)))
        for i, label in enumerate(labels):
            picked[i, CONTROLLER_INPUTS.index(label)] = 1.0
        self.B, self.D = B @ picked, D @ picked


def _stepped(
    batch: Batch, trial: Trial, points: _Inside, forced: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States (n, samples, states + 2), the commands that act new and before among them; commands, limited or not."""
    K = _Controller(trial.controller)  # type: ignore[arg-type]
    count, n = batch.B.shape
    own = len(K.A)
    last = points.Phi.shape[1] - 1
    Phi, late, early = points.Phi[:, last], points.late[:, last], points.early[:, last]
    demand, engine, wheels, limited, ratio = (CONTROLLER_INPUTS.index(name) for name in CONTROLLER_INPUTS)
    # one matrix for a sample: on plant, the two acting commands, controller, its last command, demand, ratio, the speeds forced
    at_own = n + 2
    at_limited, at_demand, at_ratio, at_forced = (at_own + own + i for i in range(4))
    width = at_forced + 2
    M = np.zeros((count, n + own + 1, width))
    M[:, :n, :n], M[:, :n, n], M[:, :n, n + 1] = Phi, late, early
    speeds = batch.C[:, :2]
    for rows, on_states, on_inputs in ((slice(n, n + own), K.A, K.B), (slice(n + own, n + own + 1), K.C, K.D)):
        read = on_inputs[:, [engine, wheels]]
        M[:, rows, :n] = np.matmul(read, speeds)
        M[:, rows, at_own : at_own + own] = on_states
        M[:, rows, at_limited] = on_inputs[:, limited]
        M[:, rows, at_demand] = on_inputs[:, demand]
        M[:, rows, at_ratio] = on_inputs[:, ratio]
        M[:, rows, at_forced:] = read
    low, high = (limit - trial.initial_torque for limit in batch.plant.torque_limits)
    pad = int(batch.whole.max()) + 1
    commands = np.zeros((pad + trial.count + 1, count))
    unlimited = np.empty((trial.count + 1, count))
    states = np.empty((trial.count + 1, count, n + 2))
    z = np.zeros((count, width))
    z[:, at_ratio] = batch.ratio
    everyone = np.arange(count)
    same = int(batch.whole[0]) if (batch.whole == batch.whole[0]).all() else None
    is_direct = batch.whole == 0
    for k in range(trial.count + 1):
        z[:, at_demand] = trial.wanted[k]
        if forced is not None:
            z[:, at_forced:] = forced[:, :2, k * trial.steps]
        if same is not None:
            z[:, n], z[:, n + 1] = commands[pad + k - same], commands[pad + k - same - 1]
        else:
            z[:, n] = commands[pad + k - batch.whole, everyone]
            z[:, n + 1] = commands[pad + k - batch.whole - 1, everyone]
        w = (M @ z[..., None])[..., 0]
        command = w[:, -1]
        unlimited[k] = command
        limit = np.minimum(np.maximum(command, low), high)
        commands[pad + k] = limit
        if is_direct.any():  # without delay the command acts at once
            z[:, n] = np.where(is_direct, limit, z[:, n])
            w[:, :n] += np.where(is_direct, limit, 0.0)[:, None] * late
        states[k] = z[:, : n + 2]
        z[:, :n] = w[:, :n]
        z[:, at_own : at_own + own] = w[:, n:-1]
        z[:, at_limited] = limit
    if not np.isfinite(unlimited).all():
        k = int(np.argmin(np.isfinite(unlimited).all(axis=1)))
        raise SignalError(f"the command is not finite at t = {k * batch.plant.dt:g} s; the loop is unstable")
    return np.swapaxes(states, 0, 1), commands[pad:].T, unlimited.T


def _signals(
    batch: Batch,
    trial: Trial,
    points: _Inside,
    forced: np.ndarray | None,
    stepped: tuple[np.ndarray, np.ndarray, np.ndarray],
    signals: Sequence[str],
) -> np.ndarray:
    states, commands, unlimited = stepped
    count, n, steps = *batch.B.shape, trial.steps
    fine = np.arange(trial.count * steps + 1)
    values = np.empty((count, len(signals), len(fine)))
    held = {
        "torque_demand": np.broadcast_to(trial.wanted, commands.shape) + trial.initial_torque,
        "torque_command": commands + trial.initial_torque,
        "torque_unlimited": unlimited + trial.initial_torque,
        "intervention": commands - trial.wanted,
    }
    for i, name in enumerate(signals):
        if name in held:
            values[:, i] = held[name][:, fine // steps]
            continue
        o = OUTPUTS.index(name)
        rows = np.zeros((count, n + 2, steps))
        row = batch.C[:, None, o, None]
        rows[:, :n] = np.swapaxes((row @ points.Phi[:, :steps])[:, :, 0], 1, 2)
        through = batch.D[:, o, None]
        rows[:, n] = (row @ points.late[:, :steps, :, None])[:, :, 0, 0] + through * points.is_new
        rows[:, n + 1] = (row @ points.early[:, :steps, :, None])[:, :, 0, 0] + through * ~points.is_new
        values[:, i] = (states @ rows).reshape(count, -1)[:, : len(fine)]
        if forced is not None:
            values[:, i] += forced[:, o]
        if name == "engine_torque":
            values[:, i] += trial.initial_torque
    return values
