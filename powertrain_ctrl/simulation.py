"""Time responses of drivelines, exact between the samples of their inputs and at every clutch event."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from .assembly import TorsionalModel, as_driveline, assemble
from .errors import PowertrainError, SignalError, UnknownNameError
from .hybrid import FREE, STUCK, Interval, Plant, Run, segments
from .outputs import output_rows, select
from .signals import input_pieces
from .tables import html_table, text_table

if TYPE_CHECKING:
    import control


@dataclass(frozen=True)
class Event:
    """A clutch that starts to slip, locks or is released.

    Attributes
    ----------
    time : float
        [s].
    clutch : str
    kind : {"lock", "slip", "release"}
    mode : int
        Mode from then on: +1 sliding with side a faster, -1 with side b faster, 0 stuck, 2 free.
    slip_energy : float
        Heat of this clutch so far [J].
    """

    time: float
    clutch: str
    kind: str
    mode: int
    slip_energy: float


@dataclass(frozen=True, eq=False)
class State:
    """State of a driveline to go on from: twists [rad] by spring, speeds by node, modes by clutch."""

    time: float
    twist: Mapping[str, float]
    speed: Mapping[str, float]
    mode: Mapping[str, int]
    _exact: np.ndarray = field(repr=False, default_factory=lambda: np.zeros(0))


@dataclass(frozen=True, eq=False, repr=False)
class Response:
    """Time response with every signal of the driveline.

    ``response["engine_speed"]`` is a signal as an array on ``time``; inputs are signals too.

    Attributes
    ----------
    time : (N,) ndarray
        [s].
    inputs, outputs : tuple of str
        Names of the signals.
    events : tuple of Event
        In order of time.
    slip_energy : dict
        Heat of each clutch [J].
    final : State
        State at the end, to go on from.
    """

    time: np.ndarray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    events: tuple[Event, ...]
    slip_energy: dict[str, float]
    final: State
    _values: np.ndarray
    title: str = "response"

    def __getitem__(self, name: str) -> np.ndarray:
        names = (*self.inputs, *self.outputs)
        if name not in names:
            raise UnknownNameError("signal", name, names, "in this response")
        return self._values[names.index(name)]

    def __contains__(self, name: object) -> bool:
        return name in self.inputs or name in self.outputs

    def to_control(self, outputs: Iterable[str] | str | None = None) -> control.TimeResponseData:
        """As ``control.TimeResponseData``, which plots itself.

        Parameters
        ----------
        outputs : str or list of str, optional
            Those to take, a few for a plot; None means all.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> data = pt.load_change(pt.examples.conventional()).to_control(["engine_speed", "vehicle_acceleration"])
        >>> data.outputs["vehicle_acceleration"].shape
        (1301,)
        """
        import control

        n = len(self.inputs)
        chosen = select(outputs, self.outputs, "output")
        return control.TimeResponseData(
            self.time,
            self._values[n:][chosen],
            inputs=self._values[:n],
            output_labels=[self.outputs[i] for i in chosen],
            input_labels=list(self.inputs),
            title=self.title,
            issiso=False,
        )

    def __repr__(self) -> str:
        return "\n".join([self._heading(), *([text_table(*self._event_table())] if self.events else [])])

    def _repr_html_(self) -> str:
        return f"<p>{self._heading()}</p>" + (html_table(*self._event_table()) if self.events else "")

    def _heading(self) -> str:
        span = f"{self.time[0]:g} to {self.time[-1]:g} s, {len(self.time)} samples"
        return f"Response: {span}, {len(self.outputs)} outputs, {len(self.events)} clutch events"

    def _event_table(self) -> tuple[list[str], list[list[str]]]:
        rows = [[f"{e.time:.6f}", e.clutch, e.kind, f"{e.slip_energy / 1e3:.3f}"] for e in self.events]
        return ["t [s]", "clutch", "event", "heat so far [kJ]"], rows


def simulate(
    car,
    timepts,
    inputs: Mapping[str, object] | None = None,
    initial_speed: Mapping[str, float] | None = None,
    initial_state: State | None = None,
) -> Response:
    """Exact response of a driveline to torques and clutch capacities.

    Between its clutch events a driveline is linear and is propagated exactly; events are found exactly too, so
    the spacing of ``timepts`` decides only where the result is shown and how sampled inputs are read.

    Parameters
    ----------
    car : Driveline or TwoMass
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
    SignalError
        An input that is not finite, negative where it is a capacity, or of the wrong length; timepts not increasing.
    UnknownNameError
        A signal or node that is not there.
    PowertrainError
        Speeds that gears forbid.

    Examples
    --------
    Two discs, one clutch. Slip 10 rad/s, torque 2 N m: relative deceleration 4 rad/s^2, locked after 2.5 s, and
    the heat is the kinetic energy that is missing afterwards, 25 J.

    >>> import numpy as np, powertrain_ctrl as pt
    >>> pair = pt.Driveline(
    ...     pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=2.0)
    ... )
    >>> pt.simulate(pair, np.linspace(0.0, 4.0, 401), initial_speed={"a": 10.0})
    Response: 0 to 4 s, 401 samples, 7 outputs, 1 clutch events
    t [s]     clutch  event  heat so far [kJ]
    2.500000  clutch  lock              0.025
    """
    plants = plants_of(car)
    return _simulate(plants, timepts, plants.capacity | dict(inputs or {}), initial_speed, initial_state)


def simulate_as_set(car, timepts, inputs: Mapping[str, object], initial_speed: Mapping[str, float]) -> Response:
    """Linear response with the clutches as they are in the driveline: locked ones rigid, released ones open."""
    return _simulate(plants_of(car, as_set=True), timepts, inputs, initial_speed, None)


class Plants:
    """What is propagated: a driveline, or one while its clutch slips and another one while it is stuck."""

    def __init__(self, car, as_set: bool = False):
        stuck = getattr(car, "stuck_driveline", None)
        slipping = as_driveline(car)
        self.slipping = Plant(assemble(slipping if as_set else slipping.release()))
        self.stuck = self.slipping if stuck is None else Plant(assemble(stuck.release()))
        self.model = self.slipping.model
        self.clutches = tuple(row.name for row in self.slipping.clutches)
        self.inputs = (*self.model.inputs, *(f"{name}_capacity" for name in self.clutches))
        self.rows = output_rows(self.model)
        self.outputs = (*self.rows.names, *(f"{name}_mode" for name in self.clutches))
        self.capacity = {f"{row.name}_capacity": row.max_torque for row in self.slipping.clutches}

    def __call__(self, modes: tuple[int, ...]) -> Plant:
        return self.stuck if STUCK in modes else self.slipping

    @cached_property
    def _output_maps(self) -> dict[Plant, np.ndarray]:
        return {plant: output_map(plant) for plant in {self.slipping, self.stuck}}

    def output_values(self, plant: Plant, x, torque, inputs, modes) -> np.ndarray:
        """(outputs, samples) ndarray from states, clutch torques, inputs and modes at the samples."""
        linear = self._output_maps[plant]
        y = np.empty((len(self.outputs), x.shape[1]))
        np.matmul(linear, np.concatenate([x, torque, inputs[: len(self.model.inputs)]]), out=y[: len(linear)])
        y[len(linear) :] = modes
        return y


def plants_of(car, as_set: bool = False) -> Plants:
    """The plants of a car; those of the last few cars are kept, so that the next run of the same one starts at once."""
    as_driveline(car)
    return _kept_plants(car, as_set)


_kept_plants = lru_cache(maxsize=16)(Plants)


def output_map(plant: Plant) -> np.ndarray:
    """Matrix of the outputs on state, torques of the clutches that act by friction, and inputs."""
    model = plant.model
    rows = output_rows(model)
    n_x, n_tau, n_u = len(plant.A), plant.G.shape[1], plant.B.shape[1]
    # unit states, torques and inputs side by side
    x = np.eye(n_x, n_x + n_tau + n_u)
    torque = np.eye(n_tau, n_x + n_tau + n_u, n_x)
    u = np.eye(n_u, n_x + n_tau + n_u, n_x + n_tau)
    rate = plant.A @ x + plant.B @ u - plant.G @ torque
    twist, speed, acceleration = plant.twist(x), plant.speed(x), plant.speed(rate)
    friction = model.locked_torque(twist, speed, acceleration, u)
    friction[plant.active] = torque
    return rows.twist @ twist + rows.speed @ speed + rows.acceleration @ acceleration + rows.friction @ friction


def _simulate(plants: Plants, timepts, inputs, initial_speed, initial_state) -> Response:
    timepts = checked_times(timepts)
    for name in inputs:
        if name not in plants.inputs:
            raise UnknownNameError("signal", name, plants.inputs, "an input of this driveline")
    pieces = input_pieces(inputs, plants.inputs, timepts)
    _check_capacities(pieces, plants.inputs, len(plants.model.inputs))
    if initial_state is None:
        speed = initial_speeds(plants.model, initial_speed or {})
        modes = (FREE,) * len(plants.clutches)
        run = Run(plants, plants.slipping.state(np.zeros(plants.slipping.r), speed), modes, float(timepts[0]))
    elif initial_speed is not None:
        raise PowertrainError("initial_speed and initial_state are both given, permitted: one of them")
    else:
        run = _continued(plants, initial_state, float(timepts[0]))
    recorder = _Recorder(plants, timepts)
    for duration, stop, segment in segments(pieces, len(plants.model.inputs)):
        for interval in run.advance(segment, duration, stop):
            recorder.add(interval)
    return recorder.response(run)


def checked_times(timepts) -> np.ndarray:
    """timepts as an array; not increasing or not finite is a `SignalError`."""
    timepts = np.array(timepts, dtype=float)
    if timepts.ndim != 1 or len(timepts) < 2 or not np.isfinite(timepts).all():
        raise SignalError(f"timepts of shape {timepts.shape}, permitted: one-dimensional, finite, at least two")
    if (np.diff(timepts) <= 0.0).any():
        first = int(np.flatnonzero(np.diff(timepts) <= 0.0)[0])
        raise SignalError(f"timepts go from {timepts[first]:g} s to {timepts[first + 1]:g} s, permitted: increasing")
    return timepts


def _check_capacities(pieces, names: tuple[str, ...], first: int):
    width = np.diff(pieces.edges)
    for j, name in enumerate(names[first:], start=first):
        coefficients = pieces.coefficients[:, j]
        scale = np.abs(coefficients[:, 0]).max()
        for share in (0.0, 0.5, 1.0):
            t = width * share
            value = sum(coefficients[:, k] * t**k for k in range(coefficients.shape[1]))
            if (value < -1e-9 * scale).any():
                i = int(value.argmin())
                raise SignalError(
                    f'input "{name}" is {value[i]:g} N m at t = {pieces.edges[i] + t[i]:g} s, permitted: >= 0'
                )


def initial_speeds(model: TorsionalModel, given: Mapping[str, float]) -> np.ndarray:
    """(n,) ndarray: coordinate speeds that agree with those given and twist the springs between them least."""
    for node, value in given.items():
        if node not in model.nodes:
            raise UnknownNameError("node", node, model.nodes, "in this driveline")
        if not np.isfinite(value):
            raise SignalError(f'initial speed of "{node}" is {value}, permitted: finite')
    if not given:
        return np.zeros(len(model.coordinates))
    rows = model.T[[model.nodes.index(node) for node in given]]
    wanted = np.array(list(given.values()), dtype=float)
    speed = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    missed = np.abs(rows @ speed - wanted)
    if (missed > 1e-9 * np.abs(wanted).max()).any():
        node = list(given)[int(missed.argmax())]
        others = ", ".join(name for name in given if name != node)
        raise PowertrainError(
            f'initial speed of "{node}" = {given[node]:g} contradicts '
            + (f"what gears allow together with {others}" if others else "what holds it at rest")
        )
    # rows' null space: speeds still free to follow
    _, singular, Vt = np.linalg.svd(rows)
    follow = Vt[int((singular > 1e-12 * singular[0]).sum()) :].T
    resisting = model.F[model.resisting_rows]
    follow_twist = np.linalg.lstsq(resisting @ follow, -resisting @ speed, rcond=1e-12)[0]
    return speed + follow @ follow_twist


def _continued(plants: Plants, state: State, start: float) -> Run:
    plant = plants(tuple(state.mode.values()))
    if len(state._exact) != plant.r + plant.n or tuple(state.mode) != plants.clutches:
        raise PowertrainError("initial_state is of another driveline")
    return Run(plants, state._exact.copy(), tuple(state.mode.values()), start, started=True)


class _Recorder:
    """Collects samples, heat and events of a run."""

    def __init__(self, plants: Plants, timepts: np.ndarray):
        self.plants, self.timepts = plants, timepts
        count, m = len(timepts), len(plants.clutches)
        self.x = np.zeros((plants.slipping.r + plants.slipping.n, count))
        self.inputs = np.zeros((len(plants.inputs), count))
        self.torque = np.zeros((m, count))
        self.modes = np.zeros((m, count))
        self.is_stuck_plant = np.zeros(count, dtype=bool)
        self.heat = np.zeros(m)
        self.heat_at: list[tuple[float, np.ndarray]] = []

    def add(self, interval: Interval):
        """Samples from the start of the interval to its end; the next interval overwrites those at a shared end."""
        first = int(np.searchsorted(self.timepts, interval.start, side="left"))
        last = int(np.searchsorted(self.timepts, interval.stop, side="right"))
        if last > first:
            inside = slice(first, last)
            t = self.timepts[inside] - interval.start
            motion = interval.motion
            self.x[:, inside] = x = motion.state(t)
            self.torque[:, inside] = motion.clutch_torque(t, x)
            self.modes[:, inside] = np.array(interval.modes, dtype=float)[:, None]
            self.is_stuck_plant[inside] = motion.plant is not self.plants.slipping
            self.inputs[:, inside] = motion.segment.values(t)
        self.heat = self.heat + interval.motion.heat(interval.stop - interval.start)
        self.heat_at.append((interval.stop, self.heat))

    def response(self, run: Run) -> Response:
        plants = self.plants
        values = np.empty((len(plants.inputs) + len(plants.outputs), len(self.timepts)))
        values[: len(plants.inputs)] = self.inputs
        samples = (self.x, self.torque, self.inputs, self.modes)
        values[len(plants.inputs) :] = plants.output_values(plants.slipping, *samples)
        if plants.stuck is not plants.slipping:
            here = self.is_stuck_plant
            values[len(plants.inputs) :, here] = plants.output_values(plants.stuck, *(a[:, here] for a in samples))
        values.flags.writeable = False
        self.timepts.flags.writeable = False
        return Response(
            time=self.timepts,
            inputs=plants.inputs,
            outputs=plants.outputs,
            events=tuple(self._events(run)),
            slip_energy=dict(zip(plants.clutches, self.heat.tolist(), strict=True)),
            final=_final_state(run, plants.clutches),
            _values=values,
        )

    def _events(self, run: Run) -> Iterator[Event]:
        times = np.array([time for time, _ in self.heat_at])
        for record in run.events:
            known = int(np.searchsorted(times, record.time, side="right")) - 1
            heat = self.heat_at[known][1] if known >= 0 else np.zeros(len(self.plants.clutches))
            kind = {STUCK: "lock", FREE: "release"}.get(record.after, "slip")
            clutch = record.clutch
            yield Event(record.time, self.plants.clutches[clutch], kind, record.after, float(heat[clutch]))


def _final_state(run: Run, clutches: tuple[str, ...]) -> State:
    model = run.plant.model
    springs = model.stiffness > 0.0
    twist = (model.twist_factor @ run.plant.twist(run.x))[springs]
    speed = model.T @ run.plant.speed(run.x)
    return State(
        time=run.time,
        twist={model.compliances[i]: float(value) for i, value in zip(np.flatnonzero(springs), twist, strict=True)},
        speed=dict(zip(model.nodes, speed.tolist(), strict=True)),
        mode=dict(zip(clutches, run.modes, strict=True)),
        _exact=run.x,
    )
