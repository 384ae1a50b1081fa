"""One sampled controller on all variants at once, stepped exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NamedTuple

import control
import numpy as np

from ..base.errors import PowertrainError, SignalError
from ..hybrid.response import Response
from ..hybrid.signals import HalfSine, PiecewiseLinear, TimeFunction, value_at
from ..linear.assembly import as_driveline
from ..linear.stepping import exponential, pulsed
from ..sampled.actuator import limits_over
from ..sampled.engaged import limits_with
from ..sampled.fold import Fold
from ..sampled.loop import closed_loop, require_within, whole_samples
from ..sampled.margins import loop_margins
from ..sampled.plant import SAME_INSTANT, SampledPlant
from ..sampled.unit import Controller, check_acting
from .responses import Lifted
from .structure import Stack, one_by_one, parts_of
from .unlimited import Piece, Unlimited, pieces_of
from .variants import Variants, variants_among

# Straight pieces of a demand beyond which it is no longer worth while to take them as lines.
MOST_PIECES = 16
OUTPUTS = ("engine_speed", "wheels_speed", "speed_difference", "vehicle_acceleration", "engine_torque")
SIGNALS = ("torque_demand", "torque_command", "torque_unlimited", "intervention", *OUTPUTS)


@dataclass(frozen=True, eq=False)
class Plants:
    """Sampled plants that are variants of one: of its car, of its times [s], the longer of two, and of a force [N], (n,)."""

    plant: SampledPlant
    lag: np.ndarray
    delay: np.ndarray
    force: np.ndarray
    given: tuple[SampledPlant, ...] = ()

    def part(self, places: np.ndarray) -> Plants:
        given = tuple(self.given[i] for i in places) if self.given else ()
        return Plants(self.plant, self.lag[places], self.delay[places], self.force[places], given)

    @property
    def have_direction(self) -> bool:
        """Whether one of them rises with another lag or delay than it falls."""
        return any(plant.has_direction for plant in self.given or (self.plant,))

    def one(self, i: int, variants: Variants) -> SampledPlant:
        """One of them."""
        if self.given:
            return self.given[i]
        try:
            return replace(self.plant, car=variants.car_of(i))
        except PowertrainError as error:
            error.args = (f"{variants.called(i)}: {error}",)
            raise


@dataclass(frozen=True, eq=False)
class Trial:
    """What a closed loop is told: as of `closed_loop`, the demand at the samples, start and length of a half-sine [s]."""

    controller: Controller
    demand: TimeFunction
    wanted: np.ndarray
    pulse: tuple[float, float] | None
    initial_torque: float
    steps: int

    @property
    def count(self) -> int:
        return len(self.wanted) - 1


def trial_of(
    plant: SampledPlant,
    controller: Controller,
    demand: TimeFunction,
    duration: float,
    pulse: tuple[float, float] | None = None,
    initial_torque: float = 0.0,
    steps: int = 10,
) -> Trial:
    """The trial, its controller and its demand checked."""
    check_acting(controller, plant.dt)
    if not callable(demand):
        raise SignalError(f"the demand is {type(demand).__name__}, permitted: a function of time, such as a ramp")
    count = whole_samples(plant, duration, steps)
    require_within("closed loop", limits_with(plant, controller), initial_torque)
    samples = plant.dt * np.arange(count + 1)
    if isinstance(demand, PiecewiseLinear):
        wanted = np.asarray(demand(samples)) - initial_torque
    else:
        wanted = np.array([value_at(demand, float(t), "the torque demand") for t in samples]) - initial_torque
    return Trial(controller, demand, wanted, pulse, initial_torque, steps)


def loops_with(variants: Variants, plant: SampledPlant, trial: Trial, signals: Sequence[str]) -> dict[str, np.ndarray]:
    """Loops of variants with the times of one plant."""
    lag, delay, none = (np.full(len(variants), value) for value in (max(plant.lags), max(plant.delays), 0.0))
    return loops_of(variants, Plants(plant, lag, delay, none), trial, signals)


def margins_with(variants: Variants, plant: SampledPlant, controller: Controller) -> dict[str, np.ndarray]:
    """Fields of `LoopMargins` (n,) of variants with the times of one plant."""
    found = one_by_one(variants, lambda car: loop_margins(replace(plant, car=car), controller))
    return {
        name: np.array([getattr(margins, name) for margins in found])
        for name in ("stable", "zeta_first", "zeta_second", "disk_margin", "gain_margin_db", "phase_margin_deg")
    }


def loops_among(
    plants: Sequence[SampledPlant], trial: Trial, signals: Sequence[str], force: Sequence[float] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Values (n, signals, N) and final accelerations (n,) of plants of one sample time and with the same limits."""
    values = np.empty((len(plants), len(signals), trial.count * trial.steps + 1))
    final = np.empty(len(plants))
    for places, variants in variants_among([as_driveline(plant.car) for plant in plants]):
        chosen = tuple(plants[i] for i in places)
        lag, delay = (np.array([max(getattr(plant, what)) for plant in chosen]) for what in ("lags", "delays"))
        peaks = np.zeros(len(chosen)) if force is None else np.array([force[i] for i in places])
        found = loops_of(variants, Plants(chosen[0], lag, delay, peaks, chosen), trial, signals)
        values[places], final[places] = found["values"], found["final"]
    return values, final


def loops_of(variants: Variants, plants: Plants, trial: Trial, signals: Sequence[str]) -> dict[str, np.ndarray]:
    """``values`` (n, signals, N) of some variants, and their ``final`` (n,) acceleration per engine torque."""
    values = np.empty((len(variants), len(signals), trial.count * trial.steps + 1))
    final = np.empty(len(variants))
    for places, part, stack in parts_of(variants):
        some = plants.part(places)
        batch = None if stack is None or not _is_linear(trial) else batch_of(stack, some)
        if batch is not None:
            found = _loops(batch, trial, signals)
            if len(found) == len(variants):
                return {"values": found, "final": batch.final}
            values[places], final[places] = found, batch.final
            continue
        for i, place in enumerate(places):
            plant = some.one(i, part)
            response = _single(plant, trial, float(some.force[i]))
            values[place], final[place] = [response[name] for name in signals], plant.final_acceleration
    return {"values": values, "final": final}


def _is_linear(trial: Trial) -> bool:
    return trial.controller is None or isinstance(trial.controller, control.StateSpace)


def _single(plant: SampledPlant, trial: Trial, force: float) -> Response:
    duration = trial.count * plant.dt
    return closed_loop(
        plant,
        trial.controller,
        trial.demand,
        duration=duration,
        disturbance=None if trial.pulse is None else HalfSine(force, *trial.pulse),
        initial_torque=trial.initial_torque,
        steps_per_sample=trial.steps,
    )


@dataclass(frozen=True, eq=False)
class Batch:
    """Sampled plants as ``x' = A x + command B + force G``, outputs ``C x + command D + force E``, arrays (n, ...).

    ``force`` is the peak of the one on the vehicle,
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
    force: np.ndarray

    def part(self, places: np.ndarray) -> Batch:
        arrays = {item.name: getattr(self, item.name)[places] for item in fields(self) if item.name != "plant"}
        return replace(self, **arrays)


def batch_of(stack: Stack, plants: Plants) -> Batch | None:
    """Plants of one structure; None where one of them has to be stepped by itself."""
    first = plants.one(0, stack.variants)
    if plants.have_direction:
        return None
    motion = stack.rolling
    with_lag = plants.lag > 0.0
    if motion is None or stack.has_loss or (with_lag.any() and not with_lag.all()):
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
    final = np.array(stack.column(stack.final_gain(first.engine, first.vehicle)))
    return Batch(first, A, B, G, C, D, E, whole, rest, ratio, final, plants.force)


class _Inside(NamedTuple):
    """States at points of a sample: ``step^i x + new command times late + the one before times early``.

    ``late`` and ``early`` (n, points + 1, states), the last of them at the next sample, where ``Phi = step^points``;
    ``is_new`` (n, points) where the new command acts.
    """

    step: np.ndarray
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
    late, whole = np.zeros((count, points + 1, size)), np.zeros((count, points + 1, size))
    late[:, 0] = np.where(arrival[:, None] == 0, first, 0.0)
    for i in range(1, points + 1):
        whole[:, i] = (step @ whole[:, i - 1, :, None])[..., 0] + added
        further = (step @ late[:, i - 1, :, None])[..., 0] + added
        late[:, i] = np.where(arrival[:, None] == i, first, np.where(arrival[:, None] < i, further, 0.0))
    is_new = arrival[:, None] <= np.arange(points)
    return _Inside(step, np.linalg.matrix_power(step, points), late, whole - late, is_new)


@np.errstate(over="ignore", invalid="ignore")
def _loops(batch: Batch, trial: Trial, signals: Sequence[str]) -> np.ndarray:
    """(n, signals, N) ndarray; what is not finite is a `SignalError`."""
    points = inside(batch, trial.steps)
    fold = Fold((points.Phi, points.late[:, -1], points.early[:, -1]), batch.C[:, :2], trial.controller)  # type: ignore[arg-type]
    # the first sample that no force follows
    free = 0 if trial.pulse is None else int(np.ceil(sum(trial.pulse) / batch.plant.dt - SAME_INSTANT))
    pieces = pieces_of(trial.wanted[free:]) if free <= trial.count else []
    if not pieces or len(pieces) > MOST_PIECES:
        return _finite(_limited_loops(batch, trial, points, fold, signals)[0])
    values, is_within = _free_loops(batch, trial, points, fold, signals, pieces)
    if not is_within.all():
        there = np.flatnonzero(~is_within)
        inner = _Inside(*(array[there] for array in points))
        values[there], _ = _limited_loops(batch.part(there), trial, inner, fold.part(there), signals)
    return _finite(values)


def _finite(values: np.ndarray) -> np.ndarray:
    if not np.isfinite(values).all():
        raise SignalError("the response is not finite; the loop is unstable")
    return values


def _limited_loops(
    batch: Batch, trial: Trial, points: _Inside, fold: Fold, signals: Sequence[str]
) -> tuple[np.ndarray, _Trajectory]:
    """(n, signals, N) ndarray, sample by sample; and the trajectory, at its end with what the force has added."""
    forced, pushed = _forced(batch, trial)
    run = _stepped(batch, trial, fold, points.late[:, -1], forced)
    values = np.empty((len(batch.whole), len(signals), trial.count * trial.steps + 1))
    fine = np.arange(values.shape[2]) // trial.steps
    held = _held(trial, run.unlimited, run.commands)
    acting = _acting(batch, run.commands)
    for i, name in enumerate(signals):
        if name in held:
            values[:, i] = held[name].T[:, fine]
            continue
        on_states, on_acting = _rows(batch, points, name)
        found = run.states[:, :, : batch.B.shape[1]] @ on_states
        found += acting @ on_acting
        values[:, i] = found.reshape(len(found), -1)[:, : len(fine)]
        if forced is not None:
            values[:, i] += forced[:, OUTPUTS.index(name)]
        if name == "engine_torque":
            values[:, i] += trial.initial_torque
    run.states[:, -1, : pushed.shape[1]] += pushed
    return values, run


def _free_loops(
    batch: Batch, trial: Trial, points: _Inside, fold: Fold, signals: Sequence[str], pieces: Sequence[Piece]
) -> tuple[np.ndarray, np.ndarray]:
    """(n, signals, N) ndarray, without limits in the pieces at the end of the demand; and where none would act (n,)."""
    free = trial.count + 1 - sum(piece.samples for piece in pieces)
    steps, names = trial.steps, [name for name in signals if name in OUTPUTS]
    wide = np.zeros((len(batch.whole), len(signals), (trial.count + 1) * steps))
    run = Unlimited(fold, batch.whole)
    z = run.start(batch.ratio)
    unlimited, commands = np.zeros((2, trial.count + 1, len(batch.whole)))
    if free:
        begun = replace(trial, wanted=trial.wanted[: free + 1])
        wide[:, :, : free * steps + 1], first = _limited_loops(batch, begun, points, fold, signals)
        sent = np.concatenate([np.zeros((run.held, len(z))), first.commands[:free]])[: -run.held - 1 : -1]
        z[:, : run.last + run.held] = np.concatenate([first.states[:, -1], sent.T], axis=1)
        unlimited[:free], commands[:free] = first.unlimited[:free], first.commands[:free]
    asked, speeds = np.zeros((2, len(batch.whole), trial.count + 1 - free))
    seen, into = [run.asked], [asked]
    for name in names:
        on_states, on_acting = _rows(batch, points, name)
        seen.append(run.seen(on_states, on_acting))
        into.append(wide[:, signals.index(name), free * steps :])
    if batch.plant.is_limited_by_speed:
        seen.append(run.seen(batch.C[:, 0, :, None], np.zeros((len(asked), 2, 1))))
        into.append(speeds)
    run.outputs(z, pieces, seen, into)
    unlimited[free:] = commands[free:] = asked.T
    held = _held(trial, unlimited, commands)
    values = wide[:, :, : trial.count * steps + 1]
    for i, name in enumerate(signals):
        if name in held:
            values[:, i] = held[name].T[:, np.arange(values.shape[2]) // steps]
        elif name == "engine_torque":
            values[:, i, free * steps :] += trial.initial_torque
    low, high = _limits(batch.plant, trial, speeds.T)
    rise, fall = (rate * batch.plant.dt for rate in batch.plant.rates)
    change = np.diff(commands, axis=0, prepend=0.0)[free:]
    asked = asked.T
    is_within = (asked >= low) & (asked <= high) & (change <= rise) & (change >= -fall) & np.isfinite(asked)
    return values, is_within.all(axis=0)


def _limits(plant: SampledPlant, trial: Trial, speeds: np.ndarray) -> tuple[Any, Any]:
    """Smallest and largest command beyond the initial torque; of limits over speed at speeds beyond the plant's."""
    if not plant.is_limited_by_speed:
        low, high = plant.limits
    else:
        low, high = limits_over(plant.torque_limits, plant.speed + speeds)
    return low - trial.initial_torque, high - trial.initial_torque


def _held(trial: Trial, unlimited: np.ndarray, commands: np.ndarray) -> dict[str, np.ndarray]:
    """Signals (samples, n) that are held for a sample."""
    return {
        "torque_demand": np.broadcast_to(trial.wanted[:, None], commands.shape) + trial.initial_torque,
        "torque_command": commands + trial.initial_torque,
        "torque_unlimited": unlimited + trial.initial_torque,
        "intervention": commands - trial.wanted[:, None],
    }


def _rows(batch: Batch, points: _Inside, name: str) -> tuple[np.ndarray, np.ndarray]:
    """(n, states, steps) and (n, 2, steps) ndarray: an output at the points of a sample on its states and what acts."""
    o, steps = OUTPUTS.index(name), points.is_new.shape[1]
    row, through = batch.C[:, o], batch.D[:, o, None]
    on_states = np.empty((*row.shape, steps))
    on_states[:, :, 0] = row
    for j in range(1, steps):
        on_states[:, :, j] = (on_states[:, None, :, j - 1] @ points.step)[:, 0]
    on_acting = [
        (points.late[:, :steps] @ row[..., None])[..., 0] + through * points.is_new,
        (points.early[:, :steps] @ row[..., None])[..., 0] + through * ~points.is_new,
    ]
    return on_states, np.stack(on_acting, axis=1)


def _forced(batch: Batch, trial: Trial) -> tuple[np.ndarray | None, np.ndarray]:
    """(n, 5, N) and (n, states) ndarray: what the force on the vehicle adds to the outputs, and to the states at the end."""
    if trial.pulse is None:
        return None, np.zeros(batch.B.shape)
    size = batch.B.shape[1]
    times = (batch.plant.dt / trial.steps) * np.arange(trial.count * trial.steps + 1)
    states = pulsed(batch.A, batch.G, batch.force, *trial.pulse, times)
    outputs = np.concatenate([batch.C, batch.E[:, :, None]], axis=2) @ states[:, : size + 1]
    return outputs, states[:, :size, -1]


class _Trajectory(NamedTuple):
    """States of plants and controllers (n, samples, states), commands (samples, n) as asked for and as limited."""

    states: np.ndarray
    unlimited: np.ndarray
    commands: np.ndarray


def _stepped(batch: Batch, trial: Trial, fold: Fold, late: np.ndarray, forced: np.ndarray | None) -> _Trajectory:
    """The loops, sample by sample."""
    count, n = batch.B.shape
    rows, new, old = fold.rows, fold.new, fold.old
    plant, engine = batch.plant, batch.C[:, 0]
    low, high = _limits(plant, trial, np.zeros(count))
    rise, fall = (rate * plant.dt for rate in plant.rates)
    is_slewed = bool(np.isfinite([rise, fall]).any())
    samples, most = trial.count + 1, int(batch.whole.max()) + 1
    commands = np.zeros((most + samples, count))
    unlimited = np.zeros((samples, count))
    M = fold.M if forced is not None else np.ascontiguousarray(fold.M[:, :, : fold.forced])
    z = np.zeros((samples + 1, count, M.shape[2]))
    z[:-1, :, fold.demand] = trial.wanted[:, None]
    z[:, :, fold.ratio] = batch.ratio
    pushes = np.zeros((count, 2, samples)) if forced is None else forced[:, :2, :: trial.steps]
    if forced is not None:
        z[:-1, :, fold.forced :] = pushes.transpose(2, 0, 1)
    groups = [(np.flatnonzero(batch.whole == whole), int(whole)) for whole in np.unique(batch.whole)]
    for k in range(fold.begin(trial.wanted, pushes), samples):
        now, then = z[k], z[k + 1, :, :rows]
        for members, whole in groups:
            chosen: Any = slice(None) if len(groups) == 1 else members
            now[chosen, new] = commands[most + k - whole, chosen]
            now[chosen, old] = commands[most + k - whole - 1, chosen]
        np.matmul(M, now[..., None], out=then[..., None])
        command = then[:, -1]
        unlimited[k] = command
        if is_slewed:
            before = commands[most + k - 1]
            np.clip(command, before - fall, before + rise, out=command)
        if plant.is_limited_by_speed:
            low, high = _limits(plant, trial, (engine * now[:, :n]).sum(axis=1) + pushes[:, 0, k])
        np.clip(command, low, high, out=command)
        commands[most + k] = command
        if groups[0][1] == 0:  # without delay a command acts at once
            chosen = slice(None) if len(groups) == 1 else groups[0][0]
            now[chosen, new] = command[chosen]
            then[chosen, :n] += command[chosen, None] * late[chosen]
    if not np.isfinite(unlimited).all():
        k = int(np.argmin(np.isfinite(unlimited).all(axis=1)))
        raise SignalError(f"the command is not finite at t = {k * plant.dt:g} s; the loop is unstable")
    return _Trajectory(z[:-1, :, : n + fold.own].swapaxes(0, 1), unlimited, commands[most:])


def _acting(batch: Batch, commands: np.ndarray) -> np.ndarray:
    """(n, samples, 2) ndarray: the commands that act in a sample, the one that arrives and the one before."""
    acting = np.zeros((commands.shape[1], len(commands), 2))
    for whole in np.unique(batch.whole):
        members = np.flatnonzero(batch.whole == whole)
        for i, back in enumerate((whole, whole + 1)):
            acting[members, back:, i] = commands[: max(len(commands) - back, 0), members].T
    return acting
