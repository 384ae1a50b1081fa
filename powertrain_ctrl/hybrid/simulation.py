"""Time responses of drivelines, exact between the samples of their inputs and at every clutch event."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError, SignalError
from ..driveline.collection import HasDriveline
from ..elements.laws import STUCK, Law
from .model import NO_CAPACITY, Plants, initial_speeds, plants_of
from .plant import Plant
from .response import Event, Response, State
from .run import Interval, Run, segments
from .signals import Pieces, Signal, Times, checked_times, input_pieces

# A capacity that is negative by no more than this part of its largest value is 0 as closely as functions are followed.
NEGATIVE = 1e-9


@checked
def simulate(
    car: HasDriveline,
    timepts: Times,
    inputs: Mapping[str, Signal] | None = None,
    initial_speed: Mapping[str, Any] | None = None,
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
        is at rest, no spring is loaded.
    initial_state : State, optional
        ``final`` of an earlier response, instead of ``initial_speed``.

    Returns
    -------
    Response

    Raises
    ------
    ParameterError
        An initial speed that is not a finite number.
    SignalError
        An input that is not finite, negative where it is a capacity, or of the wrong length; timepts not increasing.
    UnknownNameError
        A signal or node that is not there.
    PowertrainError
        Speeds that gears forbid; both ``initial_speed`` and ``initial_state``, or the state of another driveline.

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
    t [s]     clutch  event  heat so far [kJ]
    2.500000  clutch  lock              0.025
    """
    return _simulate(plants_of(car), timepts, inputs, initial_speed, initial_state)


def simulate_as_set(
    car: HasDriveline, timepts: Times, inputs: Mapping[str, Signal], initial_speed: Mapping[str, float]
) -> Response:
    """Linear response with the clutches as they are in the driveline: locked ones rigid, released ones open."""
    return _simulate(plants_of(car, as_set=True), timepts, inputs, initial_speed, None)


def _simulate(
    plants: Plants,
    timepts: Times,
    inputs: Mapping[str, Signal] | None,
    initial_speed: Mapping[str, Any] | None,
    initial_state: State | None,
) -> Response:
    timepts = checked_times(timepts)
    pieces = input_pieces(plants.signals(inputs), plants.inputs, timepts)
    pieces = _with_capacities(pieces, plants)
    if initial_state is None:
        speed = initial_speeds(plants.model, initial_speed)
        x = plants.slipping.state(np.zeros(plants.slipping.r), speed)
        run = Run(plants, x, plants.unknown, float(timepts[0]))
    elif initial_speed is not None:
        raise PowertrainError("initial_speed and initial_state are both given, permitted: one of them")
    else:
        run = _continued(plants, initial_state, float(timepts[0]))
    recorder = Recorder(plants.slipping, timepts)
    for duration, stop, segment in segments(pieces, len(plants.model.inputs)):
        for interval in run.advance(segment, duration, stop):
            recorder.add(interval)
    return _response(plants, recorder, run)


def _with_capacities(pieces: Pieces, plants: Plants) -> Pieces:
    """Pieces whose capacities are not negative, and exactly 0 where only rounding has left something."""
    width = np.diff(pieces.edges)
    kept = pieces.coefficients.copy()
    for j, law in enumerate(plants.slipping.clutches, start=len(plants.model.inputs)):
        coefficients = pieces.coefficients[:, j]
        highest = np.sum([np.abs(coefficients[:, k]) * width**k for k in range(coefficients.shape[1])], axis=0)
        lowest, time = _lowest(coefficients, width)
        if (lowest < -NEGATIVE * highest.max()).any():
            i = int(lowest.argmin())
            raise SignalError(
                f'input "{plants.inputs[j]}" is {lowest[i]:g} N m at t = {pieces.edges[i] + time[i]:g} s, permitted: >= 0'
            )
        kept[highest <= NO_CAPACITY * (law.max_torque or 0.0), j] = 0.0
    return Pieces(pieces.edges, kept)


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


def _continued(plants: Plants, state: State, start: float) -> Run:
    if tuple(state.mode) == plants.names:
        modes = tuple(
            number
            for law, given in zip(plants.laws, state.mode.values(), strict=True)
            for number, mode in law.modes.items()
            if given in (number, mode.name)
        )
        if len(modes) == len(plants.laws) and len(state._exact) == plants(modes).size:
            run = Run(plants, state._exact.copy(), modes, start, started=True)
            # the exact state is in energy coordinates: with other values it would be that of other twists and speeds
            here = _final_state(run, plants)
            if _same(here.twist, state.twist) and _same(here.speed, state.speed):
                return run
    raise PowertrainError(
        "initial_state is of another driveline, or of one with other values, permitted: the final of the same one; "
        "to go on with a changed one give its speeds as initial_speed"
    )


def _same(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    size = max(map(abs, other.values()), default=0.0)
    return one.keys() == other.keys() and all(abs(one[name] - other[name]) <= 1e-9 * size for name in one)


class Recorder:
    """Collects samples, heat and events of a run."""

    def __init__(self, plant: Plant, timepts: np.ndarray):
        self.timepts, self.plant = timepts, plant
        count, m = len(timepts), len(plant.laws)
        self.x = np.zeros((plant.size, count))
        self.inputs = np.zeros((plant.B.shape[1] + len(plant.clutches), count))
        self.torque = np.zeros((m, count))
        self.modes = np.zeros((m, count))
        self.heat = np.zeros(m)
        self._heat_at: list[tuple[float, np.ndarray]] = []

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
            self.modes[:, inside] = np.array(interval.modes, dtype=float)[:, None]
            self.inputs[:, inside] = motion.segment.values(t)
        self.heat = self.heat + interval.motion.heat(interval.stop - interval.start)
        self._heat_at.append((interval.stop, self.heat))

    @property
    def slip_energy(self) -> dict[str, float]:
        """Heat of each law that can slide [J]."""
        heat = zip(self.plant.laws, self.heat.tolist(), strict=True)
        return {law.name: value for law, value in heat if law.held is not None}

    def events(self, run: Run) -> Iterator[Event]:
        times = np.array([time for time, _ in self._heat_at])
        for record in run.events:
            known = int(np.searchsorted(times, record.time, side="right")) - 1
            heat = float(self._heat_at[known][1][record.law]) if known >= 0 else 0.0
            law = self.plant.laws[record.law]
            kind = law.modes[record.after].kind
            yield Event(record.time, law.name, kind, _shown(law, record.after), heat)


def _shown(law: Law, number: int) -> int | str:
    """A mode as users see it: the number of a clutch's, the name of others."""
    return number if law.is_clutch else law.modes[number].name


def _response(plants: Plants, recorder: Recorder, run: Run) -> Response:
    n = len(plants.inputs)
    values = np.empty((n + len(plants.outputs), len(recorder.timepts)))
    values[:n] = recorder.inputs
    samples = (recorder.x, recorder.torque, recorder.inputs, recorder.modes)
    values[n:] = plants.output_values(plants.slipping, *samples)
    if plants.stuck is not plants.slipping:
        here = (recorder.modes == STUCK).any(axis=0)
        values[n:, here] = plants.output_values(plants.stuck, *(a[:, here] for a in samples))
    return Response(
        time=recorder.timepts,
        inputs=plants.inputs,
        outputs=plants.outputs,
        events=tuple(recorder.events(run)),
        slip_energy=recorder.slip_energy,
        final=_final_state(run, plants),
        _values=values,
        modes=plants.mode_names,
    )


def _final_state(run: Run, plants: Plants) -> State:
    plant, model = run.plant, run.plant.model
    springs = model.stiffness > 0.0
    twist = (model.twist_factor @ plant.twist(run.x))[springs]
    speed = model.T @ plant.speed(run.x)
    twists = {model.compliances[i]: float(value) for i, value in zip(np.flatnonzero(springs), twist, strict=True)}
    twists |= {plants.names[i]: float(run.x[q]) for i, q in plant.twisted.items()}
    return State(
        time=run.time,
        twist=twists,
        speed=dict(zip(model.nodes, speed.tolist(), strict=True)),
        mode={law.name: _shown(law, number) for law, number in zip(plants.laws, run.modes, strict=True)},
        _exact=run.x,
    )
