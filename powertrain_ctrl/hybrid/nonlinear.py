"""A driveline with clutches as ``control.NonlinearIOSystem``, continuous or as an exact discrete map."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import product
from typing import Any

import control
import numpy as np

from ..base.checks import POSITIVE, Period, checked_number
from ..base.doors import called, checked
from ..base.errors import PowertrainError, SignalError
from ..base.systems import PicklableSystem
from ..driveline.collection import HasDriveline
from ..elements.laws import FREE, STUCK
from .model import NO_CAPACITY, Plants, plants_of
from .plant import Segment
from .run import Run
from .signals import PiecewiseLinear, Signal, Times, at_samples, checked_times
from .starts import initial_speeds

# Time in which the stuck clutch of the continuous system takes up slip [s]. Its only error is a boundary layer of that
# length at lock.
STICK_TIME = 1e-4
# What python-control's "algebraic loop detected" asks for.
DIRECT = (
    "clutch torques and modes and the accelerations of the driveline depend on the inputs of the same instant; feed them "
    "back through a lag or a delay"
)
LINEAR_HOLD = (
    'with hold="linear" the outputs of a sample depend on its own inputs; take nonlinear_system(..., hold="zero"), with '
    "which speeds and twists do not"
)
# Evaluations of the discrete system that are kept, more than a loop needs at one sample.
KEPT = 16


@checked
def nonlinear_system(car: HasDriveline, dt: Period | None = None, hold: str = "linear") -> control.NonlinearIOSystem:
    """Driveline with slipping and sticking clutches for ``interconnect``, ``linearize`` and ``input_output_response``.

    Parameters
    ----------
    car : Driveline, TwoMass or SwitchedTwoMass
        Whether its clutches are locked or released does not matter: the capacity decides.
    dt : float, optional
        Sample time [s] of the discrete system, which is exact at the samples, clutch events inside a step
        included. None gives the continuous system.
    hold : {"linear", "zero"}
        Discrete system only: inputs between samples are straight lines, as `simulate` reads samples, so that a
        sample's outputs depend on its own inputs; or constant, as a digital controller holds them. In a closed loop
        take "zero", with which speeds and twists do not depend on the inputs of their own sample.

    Returns
    -------
    control.NonlinearIOSystem
        Inputs ``<inertia>_torque`` [N m], ``<mass>_force`` [N], ``<clutch>_capacity`` [N m], in this order; outputs all
        those of `simulate`, with ``<clutch>_mode`` +1 and -1 sliding, 0 stuck, 2 free. States are the twists [rad]
        and the coordinate speeds, and for a discrete system the clutch modes and, with "linear", the inputs before.

    Raises
    ------
    PowertrainError
        A `SwitchedTwoMass` without ``dt``; a sample time that is not > 0 and finite, a hold that is not known. Later,
        from the discrete system: an input that is not finite, a negative capacity in its update. From a loop around
        it: an output that depends on itself.

    Notes
    -----
    In the continuous system the torque of a clutch minimises ``tau W tau / 2 - tau (a + slip / stick_time)`` within its
    capacity: ``a`` is the slip acceleration without clutch torques, ``W`` what the torques add to it. For one clutch
    that is the stick torque saturated at the capacity. It is exactly Coulomb friction outside, has no creep inside,
    and is right when several clutches stick together. ``params={"stick_time": ...}`` changes the 1e-4 s.
    A static ratio above 1 needs memory, which only `simulate` and the discrete system have.

    Integrate it with `solver_settings`: an implicit method (Radau), since driveline modes above 1 kHz make explicit
    ones crawl at their stability limit; a relative tolerance of 1e-6, since the default 1e-3 is wrong by several
    rad/s; and a largest step, since an adaptive method at rest steps over a ramp that begins later.

    In a loop python-control evaluates all controllers first with inputs 0, before it knows a speed; one that divides by
    a speed must not give infinity then.

    Examples
    --------
    >>> import numpy as np, control, powertrain_ctrl as pt
    >>> car = pt.examples.conventional(damping="open")
    >>> system = pt.nonlinear_system(car, dt=0.001)
    >>> times = np.arange(0, 2001) * 0.001
    >>> ramps = {"engine_torque": pt.ramp(1.5, 0.22, 350.0), "clutch_capacity": pt.ramp(1.5, 0.22, 370.0)}
    >>> inputs = pt.input_values(system, car, times, ramps)
    >>> start = pt.initial_state(system, car, {"engine": pt.rpm(5000)})
    >>> response = control.input_output_response(system, times, inputs, start)
    >>> round(float(response.outputs[system.find_output("engine_speed"), -1]), 2)
    505.85
    """
    plants = plants_of(car)
    if dt is None:
        if plants.stuck is not plants.slipping:
            raise PowertrainError("a control model that switches needs memory of its clutch; give dt, e.g. dt=0.001")
        for law in plants.laws:
            if not law.is_clutch:
                raise PowertrainError(f"{law.name} needs memory of its mode; give dt, e.g. dt=0.001")
        return PicklableSystem(_system, car, None, hold)
    dt = checked_number("nonlinear system", "dt", dt, "s", POSITIVE)
    if hold not in ("linear", "zero"):
        raise PowertrainError(f'hold = {hold!r}, permitted: "linear", "zero"')
    return PicklableSystem(_system, car, dt, hold)


def _system(car: HasDriveline, dt: float | None, hold: str) -> control.NonlinearIOSystem:
    plants = plants_of(car)
    return _continuous(plants) if dt is None else _discrete(plants, dt, hold)


@checked
def initial_state(
    system: control.NonlinearIOSystem, car: HasDriveline, initial_speed: Mapping[str, Any] | None = None
) -> np.ndarray:
    """State vector of `nonlinear_system` for given speeds, with no spring loaded.

    Parameters
    ----------
    system : control.NonlinearIOSystem
        From ``nonlinear_system(car, ...)``.
    car : Driveline, TwoMass or SwitchedTwoMass
    initial_speed : mapping, optional
        Node to speed, as in `simulate`.

    Returns
    -------
    (states,) ndarray
        Twists and speeds; for a discrete system also no twist of any play, the clutches as free, and the inputs before as
        not yet known.

    Raises
    ------
    UnknownNameError
        A node that is not there.
    ParameterError
        A speed that is not a finite number.
    PowertrainError
        Speeds that gears forbid, or the system of another driveline.

    Examples
    --------
    Up to the clutch everything turns with the engine, behind it all is at rest:

    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> system = pt.nonlinear_system(car, dt=0.001)
    >>> start = pt.initial_state(system, car, {"engine": 100.0})
    >>> names = ("engine_speed", "clutch_primary_speed", "clutch_secondary_speed")
    >>> [round(float(start[system.find_state(name)]), 6) for name in names]
    [100.0, 100.0, 0.0]
    """
    plants = plants_of(car)
    _check_belongs(system, plants)
    speed = initial_speeds(plants.model, initial_speed)
    start = np.concatenate([np.zeros(plants.slipping.r), speed])
    if system.isdtime(strict=True):
        start = np.concatenate([start, np.zeros(2 * len(plants.slipping.elastic)), plants.unknown])
    return np.concatenate([start, np.zeros(system.nstates - len(start))])


@checked
def input_values(
    system: control.NonlinearIOSystem, car: HasDriveline, timepts: Times, inputs: Mapping[str, Signal] | None = None
) -> np.ndarray:
    """Input array of `nonlinear_system` for ``control.input_output_response``, from signals by name.

    Parameters
    ----------
    system : control.NonlinearIOSystem
        From ``nonlinear_system(car, ...)``.
    car : Driveline, TwoMass or SwitchedTwoMass
    timepts : (N,) array_like
        [s], increasing.
    inputs : mapping, optional
        As in `simulate`: a torque that is not given is 0, a capacity the clutch's ``max_torque``.

    Returns
    -------
    (inputs, N) ndarray
        In the order of ``system.input_labels``; at a jump the value behind it.

    Raises
    ------
    UnknownNameError
        A signal that is not there.
    SignalError
        Values that are not finite or of the wrong number.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> system = pt.nonlinear_system(car, dt=0.5)
    >>> values = pt.input_values(system, car, np.arange(4) * 0.5, {"engine_torque": pt.ramp(0.5, 0.5, 250.0)})
    >>> values[system.find_input("engine_torque")].tolist(), values[system.find_input("clutch_capacity")].tolist()
    ([0.0, 0.0, 250.0, 250.0], [370.0, 370.0, 370.0, 370.0])
    """
    plants = plants_of(car)
    _check_belongs(system, plants)
    timepts, given = checked_times(timepts), plants.signals(inputs)
    return np.array([at_samples(given.get(name, 0.0), timepts, name) for name in plants.inputs])


def _check_belongs(system: control.NonlinearIOSystem, plants: Plants) -> None:
    states = _physical_states(plants)
    if plants.inputs != tuple(system.input_labels) or states != list(system.state_labels[: len(states)]):
        raise PowertrainError("the system is not that of this driveline")


@called
def solver_settings(*signals: Any) -> dict:
    """Keyword arguments with which ``control.input_output_response`` integrates the continuous system rightly.

    Parameters
    ----------
    *signals : PiecewiseLinear
        The ramps that drive it; the largest step is half the shortest of them. Shorter ones than 1 ns are jumps.

    Returns
    -------
    dict
        ``solve_ivp_method`` and ``solve_ivp_kwargs``: tolerances and the largest step, at most 50 ms.

    Raises
    ------
    SignalError
        A signal that is no ramp, step or sum of them.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.solver_settings(pt.ramp(1.5, 0.02, 370.0))["solve_ivp_kwargs"]["max_step"]
    0.01
    """
    for signal in signals:
        if not isinstance(signal, PiecewiseLinear):
            raise SignalError(f"solver_settings got {signal!r}, permitted: a ramp, a step or a sum of them")
    # the sum of a ramp to 0.2 + 0.1 s and one from 0.3 s has two corners a rounding apart
    widths = [width for signal in signals for width in np.diff(signal.times) if width > 1e-9]
    largest = round(float(min([0.05, *(0.5 * width for width in widths)])), 12)
    return {"solve_ivp_method": "Radau", "solve_ivp_kwargs": {"rtol": 1e-6, "atol": 1e-8, "max_step": largest}}


def _continuous(plants: Plants) -> control.NonlinearIOSystem:
    plant, model = plants.slipping, plants.model
    r, m, k = plant.r, len(plants.clutches), len(model.inputs)
    spring = -model.solve_mass(model.F.T @ (model.stiffness[:, None] * model.twist_factor))
    A = np.block([[np.zeros((r, r)), model.F[model.elastic_rows]], [spring, -model.solve_mass(model.D)]])
    B = np.vstack([np.zeros((r, k)), model.solve_mass(model.T.T @ model.B)])
    slip = np.hstack([np.zeros((m, r)), model.S @ model.T])
    G = np.vstack([np.zeros((r, m)), model.solve_mass((model.S @ model.T).T)])
    W, slip_A, slip_B = slip @ G, slip @ A, slip @ B
    rows = plants.rows
    on_state = np.hstack([rows.twist, rows.speed])

    def motion(x: np.ndarray, u: np.ndarray, params: dict) -> tuple[np.ndarray, np.ndarray]:
        torque = _friction_torque(W, slip_A @ x + slip_B @ u[:k] + slip @ x / params["stick_time"], u[k:])
        return torque, A @ x + B @ u[:k] - G @ torque

    def update(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        return motion(x, u, params)[1]

    def output(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        torque, rate = motion(x, u, params)
        y = on_state @ x + rows.acceleration @ rate[r:] + rows.friction @ torque
        held = np.abs(torque) < u[k:]
        mode = np.where(u[k:] <= 0.0, FREE, np.where(held, STUCK, np.sign(torque)))
        return np.concatenate([y, mode])

    system = control.nlsys(
        update,
        output,
        inputs=list(plants.inputs),
        outputs=list(plants.outputs),
        states=_physical_states(plants),
        params={"stick_time": STICK_TIME},
        name="driveline",
    )
    system.loop_remedy = DIRECT
    return system


def _friction_torque(W: np.ndarray, b: np.ndarray, capacity: np.ndarray) -> np.ndarray:
    """Minimiser of ``tau W tau / 2 - b tau`` with ``|tau| <= capacity``."""
    capacity = np.maximum(capacity, 0.0)
    if len(b) == 1:
        return np.clip(b / W[0], -capacity, capacity)
    # Free torques solve their rows; each torque is clamped or let go where its own condition says so.
    side = np.zeros(len(b))
    for _ in range(4 * len(b)):
        torque, wanted = _clamped(W, b, capacity, side)
        if np.array_equal(wanted, side):
            return torque
        side = wanted
    for trial in product((0.0, 1.0, -1.0), repeat=len(b)):
        torque, wanted = _clamped(W, b, capacity, np.array(trial))
        if np.array_equal(wanted, trial):
            return torque
    return torque


def _clamped(W: np.ndarray, b: np.ndarray, capacity: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torques with those of side +-1 at their capacity, and the side each of them should be on."""
    torque = side * capacity
    free = side == 0.0
    if free.any():
        torque[free] = np.linalg.lstsq(W[np.ix_(free, free)], (b - W @ torque)[free], rcond=None)[0]
    slope = W @ torque - b
    # where clutches depend on each other the slope is zero, to rounding
    rounding = 1e-12 * (np.abs(W) @ np.abs(torque) + np.abs(b))
    beyond = np.abs(torque) > capacity * (1.0 + 1e-12)
    wanted = np.where(free, np.where(beyond, np.sign(torque), 0.0), np.where(slope * side > rounding, 0.0, side))
    return torque, wanted


def _discrete(plants: Plants, dt: float, hold: str) -> control.NonlinearIOSystem:
    linear = hold == "linear"
    plant, k = plants.slipping, len(plants.model.inputs)
    # where the states of one kind end: twists, speeds, twists and stretches of laws, modes
    twists, speeds = plant.r, plant.r + plant.n
    turned = speeds + len(plant.elastic)
    physical = turned + len(plant.elastic)
    known = physical + len(plants.laws)
    no_torque = np.zeros((len(plants.laws), 1))
    no_inputs = np.zeros((len(plants.inputs), 1))

    def begin(x: np.ndarray) -> Run:
        """A run in the state of the system."""
        modes = tuple(round(float(mode)) for mode in x[physical:known])
        plant = plants(modes)
        exact = plant.state(x[:twists], x[twists:speeds], x[speeds:turned], x[turned:physical])
        slip = plant.slip(exact)
        agrees = all(
            mode in law.modes and (mode != law.held or abs(s) < 1e-6)
            for law, mode, s in zip(plants.laws, modes, slip, strict=True)
        )
        return Run(plants, exact, modes if agrees else plants.unknown, 0.0, started=agrees)

    # python-control asks again and again for the same while it resolves a loop

    @lru_cache(maxsize=KEPT)
    def advanced(x: bytes, first: bytes, last: bytes) -> Run:
        """The run one step later, inputs going straight from the first to the last."""
        run, u = begin(np.frombuffer(x)), np.frombuffer(first)
        values = np.stack([u, (np.frombuffer(last) - u) / dt], axis=1)
        for _ in run.advance(Segment(values[:k], values[k:]), dt):
            pass
        return run

    @lru_cache(maxsize=KEPT)
    def at_sample(state: bytes, inputs: bytes) -> tuple[Run, np.ndarray]:
        """The run at the sample, and what its outputs are without torques and inputs."""
        x = np.frombuffer(state)
        if linear and x[-1]:
            run = advanced(state, x[known:-1].tobytes(), inputs)
        else:
            run = begin(x)
        return run, plants.output_values(run.plant, run.x[:, None], no_torque, no_inputs, no_torque)[:, 0]

    @lru_cache(maxsize=KEPT)
    def outputs(state: bytes, inputs: bytes) -> np.ndarray:
        # Speeds and twists are those of the sample, to the last bit, whatever the inputs: a loop must see that they are.
        sample, before = at_sample(state, inputs if linear else b"")
        run, u = Run(plants, sample.x, sample.modes, 0.0, started=sample.started), np.frombuffer(inputs)
        torque = run.torque_now(Segment(u[:k, None], u[k:, None]))
        modes = np.array(run.modes, dtype=float)[:, None]
        y = plants.output_values(run.plant, run.x[:, None], torque[:, None], u[:, None], modes)[:, 0]
        return np.where(plants.is_state, before, y)

    def packed(run: Run) -> np.ndarray:
        stretch = run.x[run.plant.N - len(run.plant.elastic) : run.plant.N]
        return np.concatenate(
            [run.plant.twist(run.x), run.plant.speed(run.x), run.x[run.plant.N :], stretch, run.modes]
        )

    def update(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        x, u = np.asarray(x, dtype=float), _finite(u, plants, t)
        _check_not_negative(u[k:], plants.inputs[k:], t)
        if linear:
            return np.concatenate([packed(at_sample(x.tobytes(), u.tobytes())[0]), u, [1.0]])
        return packed(advanced(x.tobytes(), u.tobytes(), u.tobytes()))

    def output(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        x, u = np.asarray(x, dtype=float), _finite(u, plants, t)
        # While a loop is being resolved its controllers have not yet seen the speeds: it is the update that refuses.
        u[k:] = np.maximum(u[k:], 0.0)
        return outputs(x.tobytes(), u.tobytes()).copy()

    states = [*_physical_states(plants), *(f"{name}_mode" for name in plants.names)]
    if linear:
        states += [f"{name}_before" for name in plants.inputs] + ["running"]
    system = control.nlsys(
        update,
        output,
        inputs=list(plants.inputs),
        outputs=list(plants.outputs),
        states=states,
        dt=dt,
        name="driveline",
    )
    system.loop_remedy = LINEAR_HOLD if linear else DIRECT
    return system


def _finite(u: np.ndarray, plants: Plants, t: float) -> np.ndarray:
    """Inputs, all of them finite, with exactly 0 where only rounding has left something of a capacity."""
    u = np.array(u, dtype=float)
    wrong = ~np.isfinite(u)
    if wrong.any():
        raise PowertrainError(f'input "{plants.inputs[int(wrong.argmax())]}" is not finite at t = {t:g} s')
    capacities = u[len(plants.model.inputs) :]
    capacities[np.abs(capacities) <= NO_CAPACITY * np.array([law.max_torque for law in plants.slipping.clutches])] = 0.0
    return u


def _check_not_negative(capacities: np.ndarray, names: tuple[str, ...], t: float) -> None:
    for name, value in zip(names, capacities, strict=True):
        if value < 0.0:
            raise PowertrainError(f'input "{name}" is {value:g} N m at t = {t:g} s, permitted: >= 0')


def _physical_states(plants: Plants) -> list[str]:
    model = plants.model
    twists = [f"{model.compliances[i]}_twist" for i in model.elastic_rows]
    laws = [f"{plants.names[i]}_{kind}" for kind in ("twist", "stretch") for i in plants.slipping.elastic]
    return [*twists, *(f"{name}_speed" for name in model.coordinates), *laws]
