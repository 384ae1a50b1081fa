"""States to start from: speeds, twists, loads, or the state of an earlier run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import scipy.linalg

from ..base.checks import FINITE, checked_mapping, checked_number
from ..base.errors import PowertrainError, UnknownNameError
from ..driveline.kinematics import product
from ..driveline.static import carried
from ..elements import Law
from ..linear.assembly import TorsionalModel
from .model import Plants
from .response import State
from .run import Run

# Values that gears or loops tie together agree to this part.
AGREE = 1e-9


def started(
    plants: Plants,
    time: float,
    initial_speed: Mapping[str, Any] | None,
    initial_twist: Mapping[str, Any] | None,
    initial_load: Mapping[str, Any] | None,
) -> Run:
    """A run whose modes are yet to be found, from speeds and either twists or the load that twists the springs."""
    if initial_twist is not None and initial_load is not None:
        raise PowertrainError("initial_twist and initial_load are both given, permitted: one of them")
    plant = plants.slipping
    speed = initial_speeds(plants.model, initial_speed)
    moved = _displaced(plants, initial_twist) if initial_load is None else _loaded(plants, initial_load, speed)
    twist = plants.model.following.twists[plants.model.elastic_rows] @ moved
    law_twist = (plants.model.S @ plants.model.following.motions)[plant.active[plant.elastic]] @ moved
    x = plant.state(twist, speed, law_twist)
    plant.started(x, plants.unknown)  # refuses a twist that no mode covers
    return Run(plants, x, plants.unknown, time)


def continued(plants: Plants, state: State, time: float) -> Run:
    """The run that goes on from a state: that of an earlier run to the last bit, or one made by hand."""
    if not len(state._exact):
        run, modes = started(plants, time, state.speed, state.twist, None), _modes(plants.laws, state)
        if len(modes) == len(plants.laws):
            x, unknown = plants.slipping.started(run.x, plants.unknown)
            run = Run(plants, plants.slipping.entered(x, unknown, modes), modes, time, started=True)
        return run
    if state.speed.keys() == set(_bodies(plants.model)) and state.mode.keys() == {law.name for law in plants.laws}:
        modes = _modes(plants.laws, state)
        if len(state._exact) == plants(modes).size:
            run = Run(plants, state._exact.copy(), modes, time, started=True)
            # the exact state is in energy coordinates: with other values it would be that of other twists and speeds
            here = final_state(run, plants)
            if _same(here.twist, state.twist) and _same(here.speed, state.speed):
                return run
    raise PowertrainError(
        "initial_state is of another driveline, or of one with other values, permitted: the final of the same one; "
        "to go on with a changed one give its speeds as initial_speed"
    )


def final_state(run: Run, plants: Plants) -> State:
    """State at which a run is."""
    plant, model = run.plant, run.plant.model
    springs = model.stiffness > 0.0
    twist = (model.twist_factor @ plant.twist(run.x))[springs]
    speeds = dict(zip(model.nodes, (model.T @ plant.speed(run.x)).tolist(), strict=True))
    twists = {model.compliances[i]: float(value) for i, value in zip(np.flatnonzero(springs), twist, strict=True)}
    twists |= {plants.names[i]: float(run.x[q]) for i, q in plant.twisted.items()}
    return State(
        time=run.time,
        twist=twists,
        speed={node: speeds[node] for node in _bodies(model)},
        mode={law.name: shown_mode(law, number) for law, number in zip(plants.laws, run.modes, strict=True)},
        _exact=run.x,
    )


def _bodies(model: TorsionalModel) -> list[str]:
    """Nodes that move with the coordinates alone; others follow loads too."""
    following = model.following
    alone = ~(following.U.any(axis=1) | following.V.any(axis=1))
    return [model.nodes[i] for i in np.flatnonzero(alone)]


def shown_mode(law: Law, number: int) -> int | str:
    """A mode as users see it: the number of a clutch's, the name of others."""
    return law.shown(number) if law.is_clutch else law.modes[number].name


def _modes(laws: Sequence[Law], state: State) -> tuple[int, ...]:
    """Numbers of the modes that a state names, as many as there are laws if it names all of them."""
    names = [law.name for law in laws]
    for name in state.mode:
        if name not in names:
            raise UnknownNameError("clutch or law", name, names, "in this driveline")
    chosen = []
    for law in laws:
        if law.name not in state.mode:
            continue
        given = state.mode[law.name]
        number = next((number for number, mode in law.modes.items() if given in (number, mode.name)), None)
        if number is None:
            permitted = ", ".join(f"{number} ({mode.name})" for number, mode in law.modes.items())
            raise PowertrainError(f"{law.name}: mode = {given!r}, permitted: {permitted}")
        chosen.append(number)
    return tuple(chosen)


def _same(one: Mapping[str, float], other: Mapping[str, float]) -> bool:
    size = max(map(abs, other.values()), default=0.0)
    return one.keys() == other.keys() and all(abs(one[name] - other[name]) <= AGREE * size for name in one)


def initial_speeds(model: TorsionalModel, given: Mapping[str, float] | None) -> np.ndarray:
    """(n,) ndarray: coordinate speeds that agree with those given and twist the springs between them least."""
    given = checked_mapping("initial_speed", given, "from node to speed")
    for node, value in given.items():
        if node not in model.nodes:
            raise UnknownNameError("node", node, model.nodes, "in this driveline")
        checked_number("initial speed", node, value, "", FINITE)
    if not given:
        return np.zeros(len(model.coordinates))
    rows = model.T[[model.nodes.index(node) for node in given]]
    play = [i for i, law in enumerate(model.laws) if law.has_twist]
    return _least_twisted(rows, given, "speed", np.vstack([model.F[model.resisting_rows], model.S[play] @ model.T]))


def _displaced(plants: Plants, given: Mapping[str, Any] | None) -> np.ndarray:
    """(n + p,) ndarray: motion of coordinates and creeping directions with these twists and else the least."""
    given = checked_mapping("initial_twist", given, "from spring or play to twist")
    names, rows = _twisted_rows(plants)
    for name, value in given.items():
        if name not in names:
            raise UnknownNameError("spring or play", name, names, "in this driveline")
        checked_number("initial twist", name, value, "rad", FINITE)
    if not given:
        return np.zeros(rows.shape[1])
    return _least_twisted(rows[[names.index(name) for name in given]], given, "twist", rows)


def _twisted_rows(plants: Plants) -> tuple[list[str], np.ndarray]:
    """Names of all that has a twist, and each twist from the motion of coordinates and creeping directions."""
    model, plant = plants.model, plants.slipping
    springs = np.flatnonzero(model.stiffness > 0.0)
    names = [model.compliances[i] for i in springs] + [plants.names[i] for i in plant.elastic]
    laws = (model.S @ model.following.motions)[plant.active[plant.elastic]]
    return names, np.vstack([model.following.twists[springs], laws])


def _least_twisted(rows: np.ndarray, given: Mapping[str, float], what: str, resisting: np.ndarray) -> np.ndarray:
    """Motion with the given values of these rows that moves the resisting rows least."""
    wanted = np.array(list(given.values()), dtype=float)
    motion = np.linalg.lstsq(rows, wanted, rcond=None)[0]
    missed = np.abs(rows @ motion - wanted)
    if (missed > AGREE * np.abs(wanted).max()).any():
        name = list(given)[int(missed.argmax())]
        others = ", ".join(other for other in given if other != name)
        allowed = f"what gears allow together with {others}" if others else "what holds it at rest"
        raise PowertrainError(f'initial {what} of "{name}" = {given[name]:g} contradicts {allowed}')
    # rows' null space: motions still free to follow
    _, singular, Vt = np.linalg.svd(rows)
    follow = Vt[int((singular > 1e-12 * singular[0]).sum()) :].T
    twisted = product(resisting, follow)
    return motion - follow @ np.linalg.lstsq(twisted, resisting @ motion, rcond=1e-12)[0]


def _loaded(plants: Plants, given: Mapping[str, Any], speed: np.ndarray) -> np.ndarray:
    """(n + p,) ndarray: motion of coordinates and creeping directions that twists all as in steady motion.

    What turns as one body accelerates; the springs carry what that takes. Clutches are taken as stuck.
    """
    given = checked_mapping("initial_load", given, "from input to torque or force")
    model, plant = plants.model, plants.slipping
    load = np.zeros(len(model.inputs))
    for name, value in given.items():
        if name not in model.inputs:
            raise UnknownNameError("input", name, model.inputs, "of this driveline")
        load[model.inputs.index(name)] = checked_number("initial load", name, value, "N m", FINITE)
    motions, twists = model.following.motions, model.following.twists
    slips = (model.S @ motions)[plant.active]
    held = [i for i, law in enumerate(plants.laws) if law.held is not None]
    free = scipy.linalg.null_space(slips[held]) if held else np.eye(motions.shape[1])
    springs, laws = twists @ free, slips[plant.elastic] @ free
    loads = motions.T @ model.B @ load
    force = free.T @ (loads - twists.T @ (model.damping * _steady_rates(model, speed, loads)))
    # what twists nothing accelerates
    rigid = scipy.linalg.null_space(np.vstack([springs[model.stiffness > 0.0], laws, np.zeros((1, free.shape[1]))]))
    mass = free[: len(model.M)].T @ model.M @ free[: len(model.M)]
    force = force - mass @ (rigid @ np.linalg.lstsq(rigid.T @ mass @ rigid, rigid.T @ force, rcond=1e-14)[0])
    moved, _ = carried(springs, model.stiffness, laws, [plants.laws[i] for i in plant.elastic], force)
    return free @ moved


def _steady_rates(model: TorsionalModel, speed: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """(compliances,) ndarray: twist rates at these coordinate speeds, creeping nodes moving with their springs."""
    n, twists, sprung = len(speed), model.following.twists, model.stiffness > 0.0
    rates, creep = twists[:, :n] @ speed, twists[:, n:]
    if not creep.shape[1]:
        return rates
    rates = rates - creep @ np.linalg.lstsq(creep[sprung], rates[sprung], rcond=1e-12)[0]
    # those that dampers alone hold, in balance
    alone = scipy.linalg.null_space(np.vstack([creep[sprung], np.zeros((1, creep.shape[1]))]))
    damped = creep @ alone
    unbalanced = alone.T @ loads[n:] - damped.T @ (model.damping * rates)
    return rates + damped @ np.linalg.solve((damped.T * model.damping) @ damped, unbalanced)
