"""One sampled controller on all variants at once, stepped exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any, NamedTuple

import control
import numpy as np

from ..base.errors import PowertrainError, SignalError
from ..hybrid.response import Response
from ..hybrid.signals import HalfSine, PiecewiseLinear, TimeFunction, value_at
from ..linear.assembly import as_driveline
from ..linear.stepping import exponential, pulsed
from ..sampled.engaged import limits_with
from ..sampled.fold import Fold
from ..sampled.loop import closed_loop, require_within, whole_samples
from ..sampled.margins import loop_margins
from ..sampled.plant import SAME_INSTANT, SampledPlant
from ..sampled.unit import Controller, check_acting
from .responses import Lifted
from .structure import Stack, one_by_one, parts_of
from .variants import Variants, variants_among

# Values of a demand that are on a straight line to this part of the largest are on it, and pieces beyond which it is no
# longer worth while to take them as lines.
STRAIGHT, MOST_PIECES = 1e-12, 16
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
            values[places], final[places] = _loops(batch, trial, signals), batch.final
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
    if first.is_limited_by_speed or plants.have_direction:
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
    forced = _forced(batch, trial)
    speeds, late = batch.C[:, :2], points.late[:, -1]
    fold = Fold((points.Phi, late, points.early[:, -1]), speeds, trial.controller)  # type: ignore[arg-type]
    pieces = lines_of(trial.wanted)
    if forced is not None or len(pieces) > MOST_PIECES:
        return _finite(_signals(batch, trial, points, forced, _stepped(batch, trial, fold, late, forced), signals))
    run = unlimited_run(fold, batch, pieces, len(trial.wanted))
    low, high = (limit - trial.initial_torque for limit in batch.plant.limits)
    rise, fall = (rate * batch.plant.dt for rate in batch.plant.rates)
    steps = np.diff(run.unlimited, axis=0, prepend=0.0)
    is_within = (run.unlimited >= low) & (run.unlimited <= high) & (steps <= rise) & (steps >= -fall)
    is_within = (is_within & np.isfinite(run.unlimited)).all(axis=0)
    values = _signals(batch, trial, points, None, run, signals)
    if not is_within.all():
        there = np.flatnonzero(~is_within)
        some, inner = batch.part(there), _Inside(*(array[there] for array in points))
        again = _stepped(some, trial, fold.part(there), late[there], None)
        values[there] = _signals(some, trial, inner, None, again, signals)
    return _finite(values)


def _finite(values: np.ndarray) -> np.ndarray:
    if not np.isfinite(values).all():
        raise SignalError("the response is not finite; the loop is unstable")
    return values


def _forced(batch: Batch, trial: Trial) -> np.ndarray | None:
    """(n, 5, N) ndarray: what the force on the vehicle adds to the outputs."""
    if trial.pulse is None:
        return None
    size = batch.B.shape[1]
    times = (batch.plant.dt / trial.steps) * np.arange(trial.count * trial.steps + 1)
    states = pulsed(batch.A, batch.G, batch.force, *trial.pulse, times)
    return np.concatenate([batch.C, batch.E[:, :, None]], axis=2) @ states[:, : size + 1]


class _Trajectory(NamedTuple):
    """States of the plants (n, samples, states), commands (samples, n) as they are asked for and as they are limited."""

    states: np.ndarray
    unlimited: np.ndarray
    commands: np.ndarray


def lines_of(wanted: np.ndarray) -> list[tuple[int, int, float, float]]:
    """First and last sample, first value and slope of the straight pieces of a demand."""
    bends = np.abs(np.diff(wanted, 2)) > STRAIGHT * np.abs(wanted).max(initial=0.0)
    edges = np.concatenate([[0], np.flatnonzero(bends) + 1, [len(wanted) - 1]])
    return [
        (int(a), int(b), float(wanted[a]), float(wanted[b] - wanted[a]) / max(b - a, 1))
        for a, b in pairwise(np.unique(edges))
    ]


def unlimited_run(
    fold: Fold, batch: Batch, pieces: Sequence[tuple[int, int, float, float]], samples: int
) -> _Trajectory:
    """The loops without limits: linear systems under a demand of straight pieces, stepped by doubling.

    Their states are those of plant and controller, as many commands as are under way, demand and its slope, and the ratio.
    """
    n, own, count, whole = fold.n, fold.own, len(fold.M), batch.whole
    held = int(whole.max()) + 1
    first, wanted, slope, ratio = (n + own + i for i in (0, held, held + 1, held + 2))
    N = np.zeros((count, ratio + 1, ratio + 1))
    read = [*range(n + own), first, wanted, ratio]
    own_rows = [*range(n, n + own), first]
    N[:, np.array(own_rows)[:, None], read] = fold.M[:, n:][
        :, :, [*range(n + own), fold.limited, fold.demand, fold.ratio]
    ]
    N[:, :n, :n] = fold.M[:, :n, :n]
    for steps in np.unique(whole):
        chosen = np.flatnonzero(whole == steps)
        late, early = fold.M[chosen, :n, fold.new], fold.M[chosen, :n, fold.old]
        if steps:
            N[chosen, :n, first + steps - 1] = late
        else:  # the command of this sample acts at once
            N[chosen, :n] += late[:, :, None] * N[chosen, None, first]
        N[chosen, :n, first + steps] += early
    for i in range(1, held):
        N[:, first + i, first + i - 1] = 1.0
    N[:, wanted, [wanted, slope]] = N[:, slope, slope, None] = N[:, ratio, ratio, None] = 1.0
    powers = [np.ascontiguousarray(np.swapaxes(N, 1, 2))]
    states = np.zeros((count, samples + 1, ratio + 1))
    now = np.zeros((count, ratio + 1))
    now[:, ratio] = batch.ratio
    for begin, end, value, rate in pieces:
        now[:, wanted], now[:, slope] = value, rate
        part = states[:, begin : end + (2 if end == samples - 1 else 1)]
        part[:, 0] = now
        done, power = 1, 0
        while done < part.shape[1]:
            more = min(done, part.shape[1] - done)
            part[:, done : done + more] = part[:, :more] @ powers[power]
            done, power = done + more, power + 1
            if power == len(powers):
                powers.append(powers[-1] @ powers[-1])
        now = states[:, end].copy()
    commands = states[:, 1:, first].T
    return _Trajectory(states[:, :-1, :n], commands, commands)


def _stepped(batch: Batch, trial: Trial, fold: Fold, late: np.ndarray, forced: np.ndarray | None) -> _Trajectory:
    """The loops, sample by sample."""
    count, n = batch.B.shape
    rows, new, old = fold.rows, fold.new, fold.old
    low, high = (limit - trial.initial_torque for limit in batch.plant.limits)
    rise, fall = (rate * batch.plant.dt for rate in batch.plant.rates)
    is_slewed = bool(np.isfinite([rise, fall]).any())
    samples, most = trial.count + 1, int(batch.whole.max()) + 1
    commands = np.zeros((most + samples, count))
    unlimited = np.zeros((samples, count))
    M = fold.M if forced is not None else np.ascontiguousarray(fold.M[:, :, : fold.forced])
    z = np.zeros((samples + 1, count, M.shape[2]))
    z[:-1, :, fold.demand] = trial.wanted[:, None]
    z[:, :, fold.ratio] = batch.ratio
    if forced is not None:
        z[:-1, :, fold.forced :] = forced[:, :2, :: trial.steps].transpose(2, 0, 1)
    groups = [(np.flatnonzero(batch.whole == whole), int(whole)) for whole in np.unique(batch.whole)]
    # where nothing is asked for, nothing moves
    for k in range(fold.begin(trial.wanted, forced), samples):
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
        np.clip(command, low, high, out=command)
        commands[most + k] = command
        if groups[0][1] == 0:  # without delay a command acts at once
            chosen = slice(None) if len(groups) == 1 else groups[0][0]
            now[chosen, new] = command[chosen]
            then[chosen, :n] += command[chosen, None] * late[chosen]
    if not np.isfinite(unlimited).all():
        k = int(np.argmin(np.isfinite(unlimited).all(axis=1)))
        raise SignalError(f"the command is not finite at t = {k * batch.plant.dt:g} s; the loop is unstable")
    return _Trajectory(z[:-1, :, :n].swapaxes(0, 1), unlimited, commands[most:])


def _signals(
    batch: Batch,
    trial: Trial,
    points: _Inside,
    forced: np.ndarray | None,
    run: _Trajectory,
    signals: Sequence[str],
) -> np.ndarray:
    count, n, steps = *batch.B.shape, trial.steps
    fine = np.arange(trial.count * steps + 1)
    values = np.empty((count, len(signals), len(fine)))
    held = {
        "torque_demand": np.broadcast_to(trial.wanted[:, None], run.commands.shape) + trial.initial_torque,
        "torque_command": run.commands + trial.initial_torque,
        "torque_unlimited": run.unlimited + trial.initial_torque,
        "intervention": run.commands - trial.wanted[:, None],
    }
    acting = _acting(batch, run.commands)
    for i, name in enumerate(signals):
        if name in held:
            values[:, i] = held[name].T[:, fine // steps]
            continue
        o = OUTPUTS.index(name)
        row, through = batch.C[:, o], batch.D[:, o, None]
        on_states = np.empty((count, n, steps))
        on_states[:, :, 0] = row
        for j in range(1, steps):
            on_states[:, :, j] = (on_states[:, None, :, j - 1] @ points.step)[:, 0]
        on_acting = np.stack(
            [
                (points.late[:, :steps] @ row[..., None])[..., 0] + through * points.is_new,
                (points.early[:, :steps] @ row[..., None])[..., 0] + through * ~points.is_new,
            ],
            axis=1,
        )
        found = run.states @ on_states
        found += acting @ on_acting
        values[:, i] = found.reshape(count, -1)[:, : len(fine)]
        if forced is not None:
            values[:, i] += forced[:, o]
        if name == "engine_torque":
            values[:, i] += trial.initial_torque
    return values


def _acting(batch: Batch, commands: np.ndarray) -> np.ndarray:
    """(n, samples, 2) ndarray: the commands that act in a sample, the one that arrives and the one before."""
    acting = np.zeros((commands.shape[1], len(commands), 2))
    for whole in np.unique(batch.whole):
        members = np.flatnonzero(batch.whole == whole)
        for i, back in enumerate((whole, whole + 1)):
            acting[members, back:, i] = commands[: len(commands) - back, members].T
    return acting
