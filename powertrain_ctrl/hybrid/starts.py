"""States to start from: speeds, twists, loads, or the state of an earlier run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from ..base.checks import FINITE, checked_mapping, checked_number
from ..base.errors import PowertrainError, UnknownNameError
from ..driveline.kinematics import product
from ..driveline.static import carried, lines
from ..elements import Law
from ..elements.laws import coupled_torques
from ..linear.assembly import TorsionalModel, kept
from .loads import virtual_motions
from .model import Plants
from .plant import REDUNDANT, Modes, Plant
from .response import State
from .run import KNOWN_SLIP, Run

# Values that gears or loops tie together agree to this part.
AGREE = 1e-9
# What gears lose under a steady load is found by iteration to this part of the loads, or after so many steps not at all.
SETTLED, STEPS = 1e-13, 1000
# A twist is 0 where the motions of its ends cancel to this part: what rounding leaves would decide which way play departs.
CANCELLED = 1e-14


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
    moved = _displaced(plant, initial_twist) if initial_load is None else _loaded(plants, initial_load, speed)
    x = _at_rest(plant, moved, speed)
    plant.started(x, plants.unknown)  # refuses a twist that no mode covers
    return Run(plants, x, plants.unknown, time)


def _at_rest(plant: Plant, moved: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """x where coordinates and creeping directions have moved so far, at these coordinate speeds."""
    model = plant.model
    springs, laws = model.following.twists[model.elastic_rows], model.S @ model.following.motions
    return plant.state(_twist(springs, moved), speed, _twist(laws[plant.active[plant.elastic]], moved))


def _twist(rows: np.ndarray, moved: np.ndarray) -> np.ndarray:
    twist = rows @ moved
    twist[abs(twist) <= CANCELLED * (abs(rows) @ abs(moved))] = 0.0
    return twist


def continued(plants: Plants, state: State, time: float) -> Run:
    """The run that goes on from a state: that of an earlier run to the last bit, or one made by hand."""
    if len(state._exact):
        return _resumed(plants, state, time)
    named = _named_modes(plants.laws, state)
    if len(named) < len(plants.laws):
        return started(plants, time, state.speed, state.twist, None)
    # a car that is described differently by the state of its clutch is so by all modes of one name
    plant = plants(tuple(numbers[0] for numbers in named))
    x = _at_rest(plant, _displaced(plant, state.twist), initial_speeds(plant.model, state.speed))
    x, found = plant.started(x, plants.unknown)
    modes = tuple(_agreeing(plant, i, numbers, x, found) for i, numbers in enumerate(named))
    return Run(plants, plant.entered(x, found, modes), modes, time, started=True)


def _resumed(plants: Plants, state: State, time: float) -> Run:
    count = len(state._exact) - len(plants.laws)
    if state.speed.keys() == set(_bodies(plants.model)) and state.mode.keys() == set(plants.names) and count >= 0:
        modes = tuple(map(round, state._exact[count:].tolist()))
        if all(number in law.modes for law, number in zip(plants.laws, modes, strict=True)):
            if count == plants(modes).size:
                run = Run(plants, state._exact[:count].copy(), modes, time, started=True)
                # the exact state is in energy coordinates: with other values it would be that of other twists and speeds
                here = final_state(run, plants)
                if _same(here.twist, state.twist) and _same(here.speed, state.speed) and here.mode == state.mode:
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
        _exact=np.concatenate([plant.silent(run.x), run.modes]),
    )


def _bodies(model: TorsionalModel) -> list[str]:
    """Nodes that move with the coordinates alone; others follow loads too."""
    following = model.following
    alone = ~(following.U.any(axis=1) | following.V.any(axis=1))
    return [model.nodes[i] for i in np.flatnonzero(alone)]


def shown_mode(law: Law, number: int) -> int | str:
    """A mode as users see it: the number of a clutch's, the name of others."""
    return law.shown(number) if law.is_clutch else law.modes[number].name


def _named_modes(laws: Sequence[Law], state: State) -> list[list[int]]:
    """Of each law whose mode a state names the numbers of the modes of that name."""
    names = [law.name for law in laws]
    for name in state.mode:
        if name not in names:
            raise UnknownNameError("clutch or law", name, names, "in this driveline")
    named = []
    for law in laws:
        if law.name not in state.mode:
            continue
        given = state.mode[law.name]
        numbers = [number for number, mode in law.modes.items() if given in (law.shown(number), mode.name)]
        if not numbers:
            permitted = ", ".join(f"{number} ({mode.name})" for number, mode in law.modes.items())
            raise PowertrainError(f"{law.name}: mode = {given!r}, permitted: {permitted}")
        named.append(numbers)
    return named


def _agreeing(plant: Plant, i: int, numbers: Sequence[int], x: np.ndarray, found: Modes) -> int:
    """The first of these modes of a law that its twist and slip do not contradict."""
    law, slip = plant.laws[i], float(plant.slip(x)[i])
    zero = KNOWN_SLIP * (1.0 + float(abs(plant.G[:, i]) @ abs(x[: plant.N])))
    slip = 0.0 if abs(slip) <= zero else slip
    for number in numbers:
        mode, twist, stretch = law.modes[number], 0.0, 0.0
        if i in plant.stretch:
            entered = plant.entered(x, found, (*found[:i], number, *found[i + 1 :]))
            twist, stretch = float(x[plant.twisted[i]]), float(entered[plant.stretch[i]])
        torque = mode.stiffness * stretch + mode.damping * slip + mode.torque
        sums = [
            (g.twist * twist, g.stretch * stretch, g.slip * slip, g.torque * torque, g.level)
            for g in mode.guards
            if not (g.capacity or g.load or (g.torque and (mode.held or mode.capacity)))
        ]
        if not (mode.held and slip) and all(sum(terms) >= -AGREE * sum(map(abs, terms)) for terms in sums):
            return number
    at = f"twist = {twist:g} rad, slip = {slip:g} rad/s" if i in plant.stretch else f"slip = {slip:g} rad/s"
    raise PowertrainError(
        f"initial_state: {law.name} in mode {shown_mode(law, numbers[0])!r} contradicts its {at}, permitted: a mode in "
        "which it can be there, or mode={}: modes are then found"
    )


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


def _displaced(plant: Plant, given: Mapping[str, Any] | None) -> np.ndarray:
    """(n + p,) ndarray: motion of coordinates and creeping directions with these twists and else the least."""
    given = checked_mapping("initial_twist", given, "from spring or play to twist")
    names, rows = _twisted_rows(plant)
    for name, value in given.items():
        if name not in names:
            raise UnknownNameError("spring or play", name, names, "in this driveline")
        checked_number("initial twist", name, value, "rad", FINITE)
    if not given:
        return np.zeros(rows.shape[1])
    return _least_twisted(rows[[names.index(name) for name in given]], given, "twist", rows)


def _twisted_rows(plant: Plant) -> tuple[list[str], np.ndarray]:
    """Names of all that has a twist, and each twist from the motion of coordinates and creeping directions."""
    model = plant.model
    springs = np.flatnonzero(model.stiffness > 0.0)
    names = [model.compliances[i] for i in springs] + [plant.laws[i].name for i in plant.elastic]
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

    What turns as one body accelerates; the springs carry what that takes. Clutches are taken as stuck; other friction
    slides where there is slip, and what holds does so while it can. Gears lose what they do at these speeds.
    """
    given = checked_mapping("initial_load", given, "from input to torque or force")
    model, plant = plants.model, plants.slipping
    load = np.zeros(len(model.inputs))
    for name, value in given.items():
        if name not in model.inputs:
            raise UnknownNameError("input", name, model.inputs, "of this driveline")
        load[model.inputs.index(name)] = checked_number("initial load", name, value, "N m", FINITE)
    motions, twists = model.following.motions, model.following.twists
    slips, loads = (model.S @ motions)[plant.active], motions.T @ model.B @ load
    damping = model.damping * _steady_rates(model, speed, loads)
    slip = (model.S @ model.T)[plant.active] @ speed
    torques = _coupled_torques(plant, slip)
    slip[abs(slip) <= KNOWN_SLIP * (1.0 + abs((model.S @ model.T)[plant.active]) @ abs(speed))] = 0.0
    modes = _steady_modes(plants.laws, slip.tolist())
    geared = [i for i in plant.loaded if slip[i]]
    along = virtual_motions(model, [plant.laws[i] for i in geared], model.S[plant.moved]).reshape(-1, len(model.nodes))
    torques |= dict.fromkeys(geared, 0.0)
    for _ in range(STEPS):
        held = [i for i, number in modes.items() if number == plants.laws[i].held]
        sliding = {i: plants.laws[i].modes[number] for i, number in modes.items() if i not in held}
        known = {i: mode.torque + mode.damping * slip[i] for i, mode in sliding.items()} | torques
        drags, damped = [slips[i] * torque for i, torque in known.items()], twists.T @ damping
        size = float(np.abs([loads, damped, *drags]).max(initial=0.0))
        balance = _balanced(plant, slips, held, loads - damped - np.sum(drags, axis=0), size)
        for i, tau in zip(held, balance.held.tolist(), strict=True):
            guards = () if plants.laws[i].is_clutch else plants.laws[i].modes[modes[i]].guards
            ends = [g.then for g in guards if g.torque * tau + g.level < -AGREE * max(size, abs(g.level))]
            if ends:
                modes[i] = ends[0]
                break
        else:
            acting = np.zeros(len(plant.laws))
            acting[list(known)] = list(known.values())
            acting[held], acting[balance.elastic] = balance.held, balance.torques
            force = model.B @ load - model.S[plant.active].T @ acting - model.E.T @ (damping + balance.springs)
            change = 0.0
            for i, mu in zip(geared, (along @ (force - model.J @ (model.T @ balance.rate))).tolist(), strict=True):
                share = _share(plants.laws[i], slip[i], mu)
                step = (share * mu - torques[i]) / (1.0 + max(share, 0.0))
                torques[i], change = torques[i] + step, max(change, abs(step))
            if change <= SETTLED * size:
                return balance.moved
    names = ", ".join(plants.laws[i].owner for i in geared)
    raise PowertrainError(f"{names}: no steady motion under this load is found; give initial speeds and twists instead")


def _coupled_torques(plant: Plant, slip: np.ndarray) -> dict[int, float]:
    """Torques of laws that depend on the slips of several, at these slips of all."""
    found: dict[int, float] = {}
    for group in plant.groups:
        torques = coupled_torques([plant.laws[i] for i in group.laws], slip[group.laws].tolist())
        found |= dict(zip(group.laws, torques, strict=True))
    return found


def _steady_modes(laws: Sequence[Law], slips: Sequence[float]) -> dict[int, int]:
    """Modes to begin with of all laws that do not carry a load by their twist, but friction beside one that does.

    A clutch holds where it does not slip; one that does has the torque of no capacity.
    """
    carrying = {law.owner for law in laws if law.carries}
    modes = {}
    for i, (law, slip) in enumerate(zip(laws, slips, strict=True)):
        if law.load is not None:
            continue
        if law.held is not None and (law.is_rigid or (not slip and (law.is_clutch or law.owner not in carrying))):
            modes[i] = law.held
        elif not law.has_twist and (slip or law.held is None):
            modes[i] = law.sliding(slip)
    return modes


def _share(law: Law, slip: float, load: float) -> float:
    """The part of its load that a law takes that slides."""
    for mode in law.modes.values():
        if not mode.held and all(g.slip * slip + g.load * load >= 0.0 for g in mode.guards):
            return mode.share
    return 0.0


class Balance(NamedTuple):
    """Motion in which springs and laws balance a push while some slips are held, at which rate what is free accelerates.

    What springs, elastic laws (their numbers), and those that are held carry.
    """

    moved: np.ndarray
    rate: np.ndarray
    springs: np.ndarray
    elastic: list[int]
    torques: np.ndarray
    held: np.ndarray


def _balanced(plant: Plant, slips: np.ndarray, held: Sequence[int], push: np.ndarray, size: float) -> Balance:
    """Balance of a push."""
    model, n = plant.model, len(plant.model.M)
    free, springs, laws, carrying, mass, accelerating = _free_motions(plant, tuple(held))
    elastic, push_free = [plant.laws[i] for i in carrying], free.T @ push
    rate = accelerating @ push_free
    moved, chosen = carried(springs, model.stiffness, laws, elastic, push_free - mass @ rate, size)
    k, origin, torque = lines(elastic, chosen)
    sprung, torques = model.stiffness * (springs @ moved), k * (laws @ moved - origin) + torque
    left = push - model.following.twists.T @ sprung - slips[carrying].T @ torques
    left[:n] -= model.M @ (free[:n] @ rate)
    holding = np.linalg.lstsq(slips[held].T, left, rcond=REDUNDANT)[0] if held else np.zeros(0)
    return Balance(free @ moved, free[:n] @ rate, sprung, carrying, torques, holding)


@kept(16)
def _free_motions(plant: Plant, held: tuple[int, ...]) -> tuple:
    """Motions while some slips are held, what they do to springs and to laws that carry, and which laws these are; their
    masses, and the acceleration of what twists nothing by a push."""
    model, n = plant.model, len(plant.model.M)
    slips = (model.S @ model.following.motions)[plant.active]
    carrying = [i for i in plant.elastic if plant.laws[i].carries]
    free = scipy.linalg.null_space(slips[list(held)]) if held else np.eye(slips.shape[1])
    springs, laws = model.following.twists @ free, slips[carrying] @ free
    rigid = scipy.linalg.null_space(np.vstack([springs[model.stiffness > 0.0], laws, np.zeros((1, free.shape[1]))]))
    mass = free[:n].T @ model.M @ free[:n]
    return free, springs, laws, carrying, mass, rigid @ np.linalg.pinv(rigid.T @ mass @ rigid, rcond=1e-14) @ rigid.T


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
