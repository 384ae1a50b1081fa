"""Time responses of drivelines, exact between the samples of their inputs and at every clutch event."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError, SignalError
from ..driveline.collection import HasDriveline
from ..elements.laws import STUCK
from .flow import Squares, integrated
from .harmonics import separated
from .model import NO_CAPACITY, Plants, plants_of
from .plant import Plant
from .response import Event, Response, State
from .run import Interval, Run
from .signals import Pieces, Signal, Times, checked_times, input_pieces, shift
from .starts import continued, final_state, shown_mode, started

# A capacity that is negative by no more than this part of its largest value is 0 as closely as functions are followed.
NEGATIVE = 1e-9
# Where friction depends on slip a capacity that changes is taken in so many steps of its largest value, and in twice as
# many until the events move by no more than this [s], or to so many.
STAIRS, MOST_STAIRS = 16, 1024
CLOSE = 2e-6
# Torques that depend on several slips are followed to this part of themselves, and in each further run to that part of this,
# but not closer than rounding permits.
FIRST_CLOSENESS, CLOSER, CLOSEST = 1e-6, 1e-2, 1e-10
# Of so many intervals the losses are integrated at once.
TOGETHER = 128


@checked
def simulate(
    car: HasDriveline,
    timepts: Times,
    inputs: Mapping[str, Signal] | None = None,
    initial_speed: Mapping[str, Any] | None = None,
    initial_twist: Mapping[str, Any] | None = None,
    initial_load: Mapping[str, Any] | None = None,
    initial_state: State | None = None,
) -> Response:
    """Exact response of a driveline to torques and clutch capacities.

    Between its clutch events a driveline is linear and is propagated exactly; events are found exactly too, so
    the spacing of ``timepts`` decides only where the result is shown and how sampled inputs are read.

    Parameters
    ----------
    car : Driveline, TwoMass or SwitchedTwoMass
        Whether its clutches are locked or released does not matter: the capacity decides.
    timepts : (N,) array_like
        Times of the result [s], increasing, N >= 2; need not be even.
    inputs : mapping, optional
        ``<inertia>_torque`` [N m], ``<mass>_force`` [N], ``<clutch>_capacity`` [N m], each to a number, an array on
        ``timepts`` (linear in between), a `ramp`, `step` or sum of them (corners and jumps are honoured wherever they
        are) or a function of time. A torque that is not given is 0, a capacity the clutch's ``max_torque``.
    initial_speed : mapping, optional
        Node to speed [rad/s or m/s]. What springs and gears connect with a node given turns with it, all else
        is at rest, no spring is loaded: for a car that drives give a node on either side of its clutches.
    initial_twist : mapping, optional
        Spring or play to twist [rad], of play the whole one; all others are twisted as little as that allows.
    initial_load : mapping, optional
        Input to torque [N m] or force [N]: springs and play start as in steady motion under this load, clutches
        that do not slip stuck, at the speeds of ``initial_speed``; play without load is in the middle of its gap.
    initial_state : State, optional
        ``final`` of an earlier response, or a `State` made by hand, instead of the others.

    Returns
    -------
    Response
        Without outputs that would need the derivative of an input that is given: speeds of nodes without inertia that
        springs alone hold, under a torque there.

    Raises
    ------
    ParameterError
        An initial speed that is not a finite number.
    SignalError
        An input that is not finite, negative where it is a capacity, or of the wrong length; timepts not increasing.
    UnknownNameError
        A signal or node that is not there.
    PowertrainError
        Speeds or twists that gears forbid, or that no mode of a law covers; both a state and something else to start
        from, or the state of another driveline.

    Examples
    --------
    Two discs, one clutch. Slip 10 rad/s, torque 2 N m: relative deceleration 4 rad/s^2, locked after 2.5 s, and
    the heat is the kinetic energy that is missing afterwards, 25 J.

    >>> import numpy as np, powertrain_ctrl as pt
    >>> pair = pt.Driveline(
    ...     pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=2.0)
    ... )
    >>> pt.simulate(pair, np.linspace(0.0, 4.0, 401), initial_speed={"a": 10.0})
    Response: 0 to 4 s, 401 samples, 7 outputs, 1 events
    t [s]     element  event  heat so far [kJ]
    2.500000  clutch   lock              0.025
    """
    plants, timepts = plants_of(car, acting=() if inputs is None else inputs), checked_times(timepts)
    if initial_state is None:
        run = started(plants, float(timepts[0]), initial_speed, initial_twist, initial_load)
    else:
        for name, value in {
            "initial_speed": initial_speed,
            "initial_twist": initial_twist,
            "initial_load": initial_load,
        }.items():
            if value is not None:
                raise PowertrainError(f"{name} and initial_state are both given, permitted: one of them")
        run = continued(plants, initial_state, float(timepts[0]))
    return _simulate(plants, timepts, inputs, run)


def simulate_as_set(
    car: HasDriveline, timepts: Times, inputs: Mapping[str, Signal], initial_speed: Mapping[str, float]
) -> Response:
    """Linear response with the clutches as they are in the driveline: locked ones rigid, released ones open."""
    plants, timepts = plants_of(car, as_set=True, acting=inputs), checked_times(timepts)
    return _simulate(plants, timepts, inputs, started(plants, float(timepts[0]), initial_speed, None, None))


def _simulate(plants: Plants, timepts: np.ndarray, inputs: Mapping[str, Signal] | None, run: Run) -> Response:
    signals, tones = separated(_at_speeds(plants.signals(inputs), plants, run, timepts), plants.model.inputs)
    pieces = _with_capacities(input_pieces(signals, plants.inputs, timepts), plants)
    if tones:
        plants = plants.with_tones(tones)
        run = dataclasses.replace(run, plant_of=plants, x=plants(run.modes).tuned(run.x, run.time))
    plant = plants.slipping
    rises = any(pieces.coefficients[:, len(plants.model.inputs) + i, 1:].any() for i in plant.curved)
    if not (rises or plant.coupled):
        return _run_over(pieces, plants, timepts, run)

    def nearer(stairs: int, closeness: float) -> Response:
        steps = _in_stairs(pieces, plants, stairs) if rises else pieces
        return _run_over(steps, plants, timepts, dataclasses.replace(run, closeness=closeness))

    stairs, closeness = STAIRS, FIRST_CLOSENESS
    fine = nearer(stairs, closeness)
    while True:
        coarse, stairs, closeness = fine, 2 * stairs, max(CLOSER * closeness, CLOSEST)
        fine = nearer(stairs, closeness)
        differences = _differences(fine, coarse)
        if differences["events"] <= CLOSE or stairs >= MOST_STAIRS or not (rises or closeness > CLOSEST):
            return dataclasses.replace(fine, error_estimate=differences)


def _at_speeds(inputs: Mapping[str, Signal], plants: Plants, run: Run, timepts: np.ndarray) -> dict[str, Signal]:
    """Signals, of an engine that at the speed with which its node starts, and of what runs up its course."""
    speeds = dict(zip(plants.model.nodes, plants.model.T @ run.plant.speed(run.x), strict=True))
    found: dict[str, Any] = dict(inputs)
    for name, signal in inputs.items():
        if hasattr(signal, "signal"):
            found[name] = signal = signal.signal(speeds.get(name.removesuffix("_torque"), 0.0))
        if hasattr(signal, "over"):
            found[name] = signal.over(float(timepts[0]), float(timepts[-1]))
    return found


def _run_over(pieces: Pieces, plants: Plants, timepts: np.ndarray, run: Run) -> Response:
    recorder = Recorder(plants.slipping, timepts)
    for interval in run.over(pieces, len(plants.model.inputs)):
        recorder.add(interval)
    return _response(plants, recorder, run)


def _in_stairs(pieces: Pieces, plants: Plants, stairs: int) -> Pieces:
    """Pieces on each of which capacities that friction over slip multiplies change by at most a part of their largest."""
    plant, n = plants.slipping, len(plants.model.inputs)
    width = np.diff(pieces.edges)
    counts = np.ones(len(width), dtype=int)
    for i in plant.curved:
        coefficients = pieces.coefficients[:, n + i]
        change = np.sum([np.abs(coefficients[:, k]) * width**k for k in range(1, coefficients.shape[1])], axis=0)
        largest = max(float(np.abs(coefficients[:, 0]).max()), float(change.max()))
        if change.any():
            counts = np.maximum(counts, np.ceil(stairs * change / largest).astype(int))
    index = np.repeat(np.arange(len(width)), counts)
    place = np.arange(len(index)) - np.repeat(np.cumsum(counts) - counts, counts)
    since = place * (width / counts)[index]
    edges = np.append(pieces.edges[index] + since, pieces.edges[-1])
    return Pieces(edges, shift(pieces.coefficients[index], since[:, None] * np.ones(pieces.coefficients.shape[1])))


def _differences(fine: Response, coarse: Response) -> dict[str, float]:
    """Largest difference of each output, and of the times of the events, infinite if they are not the same ones."""
    found = {
        name: float(np.abs(fine[name] - coarse[name]).max()) for name in fine.outputs if not name.endswith("_mode")
    }
    kinds = [[(event.element, event.kind) for event in response.events] for response in (fine, coarse)]
    if kinds[0] != kinds[1]:
        return found | {"events": float("inf")}
    times = zip(fine.events, coarse.events, strict=True)
    return found | {"events": max((abs(one.time - other.time) for one, other in times), default=0.0)}


def _with_capacities(pieces: Pieces, plants: Plants) -> Pieces:
    """Pieces whose capacities are not negative, and exactly 0 where only rounding has left something."""
    width = np.diff(pieces.edges)
    kept = pieces.coefficients.copy()
    for j, law in enumerate(plants.slipping.clutches, start=len(plants.model.inputs)):
        coefficients = pieces.coefficients[:, j]
        if law.is_rigid:
            _check_engaged(pieces, j, plants.inputs[j])
        highest = np.sum([np.abs(coefficients[:, k]) * width**k for k in range(coefficients.shape[1])], axis=0)
        lowest, time = _lowest(coefficients, width)
        if (lowest < -NEGATIVE * highest.max()).any():
            i = int(lowest.argmin())
            raise SignalError(
                f'input "{plants.inputs[j]}" is {lowest[i]:g} N m at t = {pieces.edges[i] + time[i]:g} s, permitted: >= 0'
            )
        kept[highest <= NO_CAPACITY * (law.max_torque or 0.0), j] = 0.0
    return Pieces(pieces.edges, kept)


def _check_engaged(pieces: Pieces, j: int, name: str) -> None:
    coefficients = pieces.coefficients[:, j]
    wrong = coefficients[:, 1:].any(axis=1) | ~np.isin(coefficients[:, 0], (0.0, 1.0))
    if wrong.any():
        i = int(wrong.argmax())
        changes = ", changing" if coefficients[i, 1:].any() else ""
        raise SignalError(
            f'input "{name}" is {coefficients[i, 0]:g}{changes} at t = {pieces.edges[i]:g} s, permitted: 0 (open) or 1 '
            "(engaged); between samples signals are straight lines, so give steps: step(...), or samples(...) with jumps"
        )


def _lowest(coefficients: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(pieces,) ndarrays: lowest value of each polynomial on its piece, and the local time of it."""
    curved = np.flatnonzero(coefficients[:, 2:].any(axis=1))
    # where a curved piece is lowest its slope is zero
    turns = [np.roots(np.polynomial.polynomial.polyder(coefficients[i])[::-1]).real for i in curved]
    times = np.zeros((2 + max(map(len, turns), default=0), len(width)))
    times[1] = width
    for i, roots in zip(curved, turns, strict=True):
        times[2 : 2 + len(roots), i] = np.clip(roots, 0.0, width[i])
    values = np.sum([coefficients[:, k] * times**k for k in range(coefficients.shape[1])], axis=0)
    lowest, each = values.argmin(axis=0), np.arange(len(width))
    return values[lowest, each], times[lowest, each]


class Recorder:
    """Collects samples, heat and events of a run."""

    def __init__(self, plant: Plant, timepts: np.ndarray):
        self.timepts, self.plant = timepts, plant
        m, k = len(plant.laws), plant.B.shape[1] + len(plant.clutches)
        ends = np.cumsum([plant.size, m, k])
        self.samples = np.zeros((ends[-1], len(timepts)))
        self.x, self.torque, self.inputs = np.split(self.samples, ends[:-1])
        self.modes = np.zeros((m, len(timepts)))
        self._spans: list[tuple[float, float]] = []
        self._heats: list[np.ndarray] = []  # what is lost before each interval, and in it
        self._squares: list[tuple[int, Squares]] = []  # what is still to be added, and where

    def add(self, interval: Interval) -> None:
        """Samples from the start of the interval to its end; the next interval overwrites those at a shared end."""
        first = int(np.searchsorted(self.timepts, interval.start, side="left"))
        last = int(np.searchsorted(self.timepts, interval.stop, side="right"))
        if last > first:
            inside = slice(first, last)
            t = self.timepts[inside] - interval.start
            motion = interval.motion
            self.x[:, inside] = x = motion.state(t)
            self.torque[:, inside] = motion.torque(t, x)
            for row, law, number in zip(self.modes, self.plant.laws, interval.modes, strict=True):
                row[inside] = law.shown(number)
            self.inputs[:, inside] = motion.segment.values(t)
        duration = interval.stop - interval.start
        self._spans.append((interval.start, interval.stop))
        self._heats += [interval.lost, interval.motion.heat(duration)]
        squares = interval.motion.squares(duration)
        if squares is not None:
            self._squares.append((len(self._heats) - 1, squares))
            if len(self._squares) == TOGETHER:
                self._integrate()

    def _integrate(self) -> None:
        losses = integrated([each for _, each in self._squares], len(self.plant.laws))
        for (place, _), lost in zip(self._squares, losses, strict=True):
            self._heats[place] = self._heats[place] + lost
        self._squares = []

    @property
    def heat(self) -> np.ndarray:
        """(2 intervals, laws) ndarray: heat so far [J] at the start of each interval, once struck, and at its end."""
        self._integrate()
        return np.cumsum(np.reshape(self._heats, (len(self._heats), len(self.plant.laws))), axis=0)

    @property
    def slip_energy(self) -> dict[str, float]:
        """Heat of each element whose laws dissipate, or have been struck [J]."""
        energy: dict[str, float] = {}
        whole = self.heat[-1] if self._heats else np.zeros(len(self.plant.laws))
        for law, heat in zip(self.plant.laws, whole.tolist(), strict=True):
            if law.dissipates or heat:
                energy[law.owner] = energy.get(law.owner, 0.0) + heat
        return energy

    def events(self, run: Run) -> Iterator[Event]:
        times, heats = np.ravel(self._spans), self.heat
        owners = np.array([law.owner for law in self.plant.laws])
        for record in run.events:
            known = int(np.searchsorted(times, record.time, side="right")) - 1
            law = self.plant.laws[record.law]
            heat = float(heats[known, owners == law.owner].sum()) if known >= 0 else 0.0
            kind = law.kind(record.before, record.after)
            yield Event(record.time, law.owner, kind, shown_mode(law, record.after), heat)


def _response(plants: Plants, recorder: Recorder, run: Run) -> Response:
    n = len(plants.inputs)
    values = np.empty((n + len(plants.outputs), len(recorder.timepts)))
    plant, k = plants.slipping, len(plants.model.inputs)
    behind = plant.B.shape[1]
    values[:k], values[k : n - behind + k] = recorder.inputs[:k] + plant.harmonic(recorder.x), recorder.inputs[behind:]
    if plant.moved.size:
        values[n - behind + k : n] = plant.moving_rows.T @ recorder.x[: len(plant.moving_rows)]
    samples = recorder.samples[: plant.size + len(plant.laws) + behind]
    plants.put_outputs(plant, samples, recorder.modes, values[n:])
    if plants.stuck is not plants.slipping:
        here = (recorder.modes == STUCK).any(axis=0)
        stuck = np.empty((len(plants.outputs), np.count_nonzero(here)))
        plants.put_outputs(plants.stuck, samples[:, here], recorder.modes[:, here], stuck)
        values[n:, here] = stuck
    return Response(
        time=recorder.timepts,
        inputs=plants.inputs,
        outputs=plants.outputs,
        events=tuple(recorder.events(run)),
        slip_energy=recorder.slip_energy,
        final=final_state(run, plants),
        _values=values,
        modes=plants.mode_names,
    )
