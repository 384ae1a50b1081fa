"""A driveline as ``control.StateSpace`` with named states, inputs and outputs."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

import control
import numpy as np
import scipy.linalg

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.systems import linear_system
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.kinematics import product
from ..elements import CouplingRow
from .assembly import TorsionalModel, as_driveline, assemble
from .couplings import coupling_matrix, couplings_of, require_bodies, uncoupled
from .outputs import OutputRows, output_rows, select
from .reflection import reflection
from .separation import Separation, separate
from .steady import motions, steady

# Signals of which this part is not a combination of others do not depend on them.
INDEPENDENT = 1e-9


@checked
def state_space(
    car: HasDriveline,
    inputs: Iterable[str] | str | None = None,
    outputs: Iterable[str] | str | None = None,
    coordinates: str = "twist",
    reference: str | None = None,
) -> control.StateSpace:
    """Linear model of a driveline with its clutches as they are, locked or released.

    Parameters
    ----------
    car : Driveline or TwoMass
    inputs : str or list of str, optional
        ``<inertia>_torque`` [N m], ``<mass>_force`` [N], also of nodes without inertia on springs; None means all.
    outputs : str or list of str, optional
        ``<node>_speed``, ``<node>_acceleration`` [rad/s or m/s, per s]; ``<compliance>_torque`` [N m],
        ``<compliance>_twist`` [rad]; ``<clutch>_torque`` [N m], ``<clutch>_slip_speed`` [rad/s]; ``<node>_angle``
        [rad or m]. None means all, angles only with coordinates="angle".
    coordinates : {"twist", "angle"}
        "twist": twists of the springs, their rates and rigid speeds, as few as what is asked needs: rigid motions that no
        output sees, and parts that no input or no output touches, are left out. A free motion is a state of its own,
        ``<node>_free_speed``, the speed that everything would have as one body; its row and column of A are exact
        zeros, and with an angle there is its integral behind it. Where nodes without inertia creep along with dampers,
        ``<node>_relative_speed`` of bodies takes the place of the rates. "angle": angle and speed of every coordinate,
        equation (2.8) to the letter, with two zero poles per rigid motion.
    reference : str, optional
        With "angle": the states are reflected to this node, equation (2.2). Inputs and outputs stay physical.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    UnknownNameError
        A signal or node that is not there.
    TopologyError
        A driveline that cannot be assembled; reflection where not all nodes are connected by single ratios.
    PowertrainError
        Coordinates that are not known, or "angle" where nodes creep; a reference with "twist"; no signal at all, or one
        twice; an output that would need the derivative of an input, at a node without inertia.

    Notes
    -----
    With "twist", ``dcgain`` of a single channel is right, inf where the output sees the free motion. Of several channels
    together python-control says inf for all of them as soon as one sees it, or nan; `static_gain` gives each its own.
    ``control.sample_system``, ``append`` and ``interconnect`` keep the integrator exact; ``minreal``, ``tf`` and products
    of systems do not, and ``control.margin``, which goes through a transfer function, can be wrong for a driveline that
    moves freely. `loop_margins` goes by the frequency response.

    Examples
    --------
    Torque to vehicle acceleration, whose steady state is one over the inertia:

    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> G = pt.state_space(car, "engine_torque", "vehicle_acceleration")
    >>> G.nstates, round(float(G.dcgain()), 6)
    (12, 0.015557)

    The engine's speed rises for ever under a constant torque; the smallest pole is 0, not nearly 0:

    >>> speed = pt.state_space(car, "engine_torque", "engine_speed")
    >>> float(speed.dcgain()), float(abs(speed.poles()).min()), speed.state_labels[-1]
    (inf, 0.0, 'engine_free_speed')

    System matrix (2.9):

    >>> pt.state_space(car, coordinates="angle", reference="engine").A.shape
    (14, 14)
    """
    driveline = as_driveline(car)
    coupled = couplings_of(driveline)
    if coupled:
        return _coupled(driveline, coupled, inputs, outputs, coordinates, reference)
    return _uncoupled(assemble(car), inputs, outputs, coordinates, reference)


def _coupled(
    car: Driveline,
    coupled: tuple[CouplingRow, ...],
    inputs: Iterable[str] | str | None,
    outputs: Iterable[str] | str | None,
    coordinates: str,
    reference: str | None,
) -> control.StateSpace:
    """The rest of the driveline with loads at the coupled nodes, which depend on the speeds there."""
    rest = assemble(uncoupled(car))
    require_bodies(coupled, rest.nodes, rest.following)
    nodes = list(dict.fromkeys(node for row in coupled for node in row.nodes))
    acting = [rest.inputs[i] for i in select(inputs, rest.inputs, "input")]
    shown = list(output_rows(rest, outputs, outputs is not None, select(acting, rest.inputs, "input")).names)
    seen = [f"{node}_speed" for node in nodes]
    wanted = [*shown, *(name for name in seen if name not in shown)]
    loads = [f"{node} load" for node in nodes]
    at = np.eye(len(rest.nodes))[:, [rest.nodes.index(node) for node in nodes]]
    loaded = replace(rest, inputs=(*rest.inputs, *loads), B=np.hstack([rest.B, at]))
    G = _uncoupled(loaded, [*acting, *loads], wanted, coordinates, reference)
    D, m = coupling_matrix(coupled, nodes), len(acting)
    speeds = G.C[[wanted.index(name) for name in seen]]
    A, C = (M - on_loads @ D @ speeds for M, on_loads in ((G.A, G.B[:, m:]), (G.C, G.D[:, m:])))
    return linear_system(
        A,
        G.B[:, :m],
        C[: len(shown)],
        G.D[: len(shown), :m],
        dt=0,
        states=list(G.state_labels),
        inputs=acting,
        outputs=shown,
        name="driveline",
    )


def _uncoupled(
    model: TorsionalModel,
    inputs: Iterable[str] | str | None,
    outputs: Iterable[str] | str | None,
    coordinates: str,
    reference: str | None,
) -> control.StateSpace:
    index = select(inputs, model.inputs, "input")
    if coordinates == "twist":
        if reference is not None:
            raise PowertrainError('reference is for coordinates="angle"; twists and their rates belong to no node')
        return _in_twists(model, index, output_rows(model, outputs, outputs is not None, index))
    if coordinates == "angle":
        return _in_angles(model, index, output_rows(model, outputs, True, index), reference)
    raise PowertrainError(f'coordinates = {coordinates!r}, permitted: "twist", "angle"')


class _Separated(NamedTuple):
    """``x' = A x + B u``, ``v' = P u``, ``y = C x + D u + X v``: twists, their rates and resisted speeds x, free speeds v.

    Angles see the integrals of the free speeds besides, and ``turned`` of those of ``turning x + turning_load u``, speeds
    which do not die out.
    """

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    P: np.ndarray
    X: np.ndarray
    turning: np.ndarray
    turning_load: np.ndarray
    turned: np.ndarray
    turning_names: list[str]
    free_angle: np.ndarray


def _separated(model: TorsionalModel, parts: Separation, index: list[int], rows: OutputRows) -> _Separated:
    r, s, q, u = len(model.elastic_rows), parts.R.shape[1], parts.resisted.shape[1], len(index)
    elastic, rate = model.elastic_rows, model.twist_rate
    twist, speed = np.eye(r, r + s + q), np.hstack([np.zeros((len(model.M), r)), parts.R, parts.resisted])
    swing = np.hstack([np.zeros((len(model.F), r)), parts.on_R, parts.on_resisted])
    dampers = model.damping[:, None] * swing
    torque = (model.stiffness[:, None] * model.twist_factor) @ twist + dampers
    load = model.T.T @ model.B[:, index]
    plant = _linear(model, index, rows, twist, speed, torque)
    A = np.vstack(
        [
            swing[elastic] + rate.on_twist[elastic] @ twist,
            -(parts.rates @ model.solve_mass(model.F.T)) @ torque,
            # a rigid motion twists no spring, so only dampers act on it
            -parts.resistance @ dampers,
        ]
    )
    B = np.vstack(
        [rate.on_load[elastic] @ model.B[:, index], parts.rates @ plant.accelerated, parts.resisted_rate @ load]
    )
    C = plant.C
    if model.following.U.shape[1]:
        turned, turning, turning_load, names = _turning_outputs(model, index, rows, speed, C)
    else:
        turning, turning_load = np.eye(q, 2 * r + q, 2 * r), np.zeros((q, u))
        names = [f"{name}_rigid_angle" for name in parts.names]
        C[:, :r] += rows.angle @ parts.R
        turned = product(rows.angle, parts.resisted)
        if turned.any():
            resting = _resting(model, index, rows)
            # where the speed dies out its integral is a combination of the states and needs no integrator
            C[resting] += turned[resting] @ np.linalg.inv(A)[2 * r :]
            turned[resting] = 0.0
    return _Separated(
        A,
        B,
        C,
        plant.D,
        P=product(parts.free_rate, load),
        X=product(rows.speed, parts.free),
        turning=turning,
        turning_load=turning_load,
        turned=turned,
        turning_names=names,
        free_angle=product(rows.angle, parts.free),
    )


def _turning_outputs(
    model: TorsionalModel,
    index: list[int],
    rows: OutputRows,
    speed: np.ndarray,
    C: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Integrators of the angles whose speed does not die out, one each; the others are added to C."""
    r = len(model.elastic_rows)
    pull = model.following.creep.T @ (model.stiffness[:, None] * model.twist_factor)
    turning = rows.angle @ speed
    turning[:, :r] -= rows.creep @ pull
    turning_load = rows.creep @ (model.following.U.T @ model.B[:, index])
    if not (turning.any() or turning_load.any()):
        return np.zeros((len(C), 0)), turning[:0], turning_load[:0], []
    resting = _resting(model, index, rows)
    by_twist, by_speed = motions(model).turned(model.damping)
    C[resting, :r] += rows.motion[resting] @ by_twist
    C[resting] += rows.motion[resting] @ (by_speed[:, : len(speed)] @ speed)
    going = np.flatnonzero(~resting)
    return np.eye(len(C))[:, going], turning[going], turning_load[going], [f"{rows.names[i]}_turned" for i in going]


def _resting(model: TorsionalModel, index: list[int], rows: OutputRows) -> np.ndarray:
    """Outputs that see no motion which constant inputs keep going, free ones left out."""
    going = steady(model, model.B[:, index]).going
    return np.count_nonzero(product(rows.motion, going), axis=1) == 0


def _in_twists(model: TorsionalModel, index: list[int], rows: OutputRows) -> control.StateSpace:
    """States: twists, twist rates, resisted rigid speeds, then free speeds and angles, as few as the outputs see."""
    parts = separate(model)
    plant = _separated(model, parts, index, rows)
    r, s = len(model.elastic_rows), parts.R.shape[1]
    springs, rates, resisted = _touched(model, parts, plant, index)
    kept = np.concatenate([springs, r + rates, r + s + resisted])
    states = [f"{model.compliances[i]}_twist" for i in model.elastic_rows[springs]]
    states += [parts.rate_names[j] for j in rates]
    states += [f"{parts.names[j]}_rigid_speed" for j in resisted]
    # the free motions as each output sees them, an angle their integrals; without what no input drives
    seen = plant.X + plant.free_angle
    is_angle = np.count_nonzero(plant.free_angle, axis=1) > 0
    driven = product(seen, plant.P)
    speeds = _independent(seen)
    angles = _independent(np.where(is_angle[:, None], seen, 0.0))
    share_of_speed, share_of_angle = _shares(seen, speeds), _shares(seen, angles)
    carried = share_of_speed[angles]
    share_of_speed[is_angle], share_of_angle[~is_angle] = 0.0, 0.0
    moving, turning = (np.count_nonzero(driven[picked], axis=1) > 0 for picked in (speeds, angles))
    turned = np.flatnonzero(
        plant.turned.any(axis=0) & (plant.turning[:, kept].any(axis=1) | plant.turning_load.any(axis=1))
    )
    states += [f"{_subject(rows.names[i])}_free_speed" for i in np.array(speeds, dtype=int)[moving]]
    states += [plant.turning_names[j] for j in turned]
    states += [f"{_subject(rows.names[i])}_free_angle" for i in np.array(angles, dtype=int)[turning]]
    sizes = len(kept), int(moving.sum()), len(turned), int(turning.sum())
    A = scipy.linalg.block_diag(plant.A[np.ix_(kept, kept)], *(np.zeros((size, size)) for size in sizes[1:]))
    first = np.cumsum(sizes)
    A[first[1] : first[2], : sizes[0]] = plant.turning[np.ix_(turned, kept)]
    A[first[2] :, first[0] : first[1]] = carried[turning][:, moving]
    still = np.zeros((sizes[3], len(index)))
    B = np.vstack([plant.B[kept], driven[speeds][moving], plant.turning_load[turned], still])
    free = share_of_speed[:, moving], share_of_angle[:, turning]
    C = np.hstack([plant.C[:, kept], free[0], plant.turned[:, turned], free[1]])
    return _system(model, index, rows, A, B, C, plant.D, states)


def _touched(
    model: TorsionalModel, parts: Separation, plant: _Separated, index: list[int]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Springs, their rates and resisted motions of those connected parts that an input drives and an output sees."""
    driven = np.unique(model.all_parts[(model.following.kinematics.T @ model.B[:, index]).any(axis=1)])
    seen = plant.C.any(axis=0) | plant.turning[plant.turned.any(axis=0)].any(axis=0)
    resisted = model.parts[(parts.resisted != 0.0).argmax(axis=0)] if parts.resisted.size else np.zeros(0, dtype=int)
    groups = [model.parts_of_twists[model.elastic_rows], parts.rate_parts, resisted]
    wanted = np.intersect1d(driven, np.concatenate(groups)[seen])
    springs, rates, rigid = (np.flatnonzero(np.isin(group, wanted)) for group in groups)
    return springs, rates, rigid


def _independent(matrix: np.ndarray) -> list[int]:
    """Indices of the first rows that are linearly independent."""
    found: list[int] = []
    basis = np.zeros((0, matrix.shape[1]))
    for i, row in enumerate(matrix):
        size = np.linalg.norm(row)
        rest = row - basis.T @ (basis @ row)
        rest = rest - basis.T @ (basis @ rest)
        if np.linalg.norm(rest) > INDEPENDENT * size:
            found.append(i)
            basis = np.vstack([basis, rest / np.linalg.norm(rest)])
    return found


def _shares(matrix: np.ndarray, chosen: list[int]) -> np.ndarray:
    """(rows, chosen) ndarray: every row as a combination of the chosen ones, of which each is itself."""
    shares = np.zeros((len(matrix), len(chosen)))
    if chosen:
        shares = np.linalg.lstsq(matrix[chosen].T, matrix.T, rcond=None)[0].T
        shares[np.abs(shares) <= INDEPENDENT * np.abs(shares).max(axis=1, keepdims=True)] = 0.0
        shares[chosen] = np.eye(len(chosen))
    return shares


def _subject(signal: str) -> str:
    """What a speed or angle is of."""
    return signal.removesuffix("_speed").removesuffix("_angle")


class _Linear(NamedTuple):
    """``z' = acceleration x + accelerated u``, ``y = C x + D u`` without angles; z are the coordinate speeds."""

    acceleration: np.ndarray
    accelerated: np.ndarray
    C: np.ndarray
    D: np.ndarray


def _linear(
    model: TorsionalModel, index: list[int], rows: OutputRows, twist: np.ndarray, speed: np.ndarray, torque: np.ndarray
) -> _Linear:
    """In any states x, that are given by the twists, coordinate speeds and torques of the compliances that each makes."""
    acceleration = -model.solve_mass(model.F.T @ torque)
    accelerated = model.solve_mass(model.T.T @ model.B[:, index])
    C = rows.twist @ twist + product(rows.speed, speed) + rows.acceleration @ acceleration
    D = rows.acceleration @ accelerated + rows.load[:, index]
    if rows.friction[:, model.locked].any():
        unit, still = np.eye(len(model.inputs)), np.zeros((len(twist) + len(speed), len(index)))
        C += rows.friction @ model.locked_torque(twist, speed, acceleration, np.zeros((len(unit), twist.shape[1])))
        D += rows.friction @ model.locked_torque(still[: len(twist)], still[len(twist) :], accelerated, unit[:, index])
    return _Linear(acceleration, accelerated, C, D)


def _in_angles(model: TorsionalModel, index: list[int], rows: OutputRows, reference: str | None) -> control.StateSpace:
    if model.following.U.shape[1]:
        names = ", ".join(model.following.names)
        raise PowertrainError(
            f'coordinates="angle": {names} have no inertia and creep with their dampers, so the states are not angles and '
            'speeds alone; permitted: "twist"'
        )
    n, r = len(model.coordinates), len(model.elastic_rows)
    twists, speeds = np.eye(r, r + n), np.eye(n, r + n, r)
    torque = (model.stiffness[:, None] * model.twist_factor) @ twists + (model.damping[:, None] * model.F) @ speeds
    plant = _linear(model, index, rows, twists, speeds, torque)
    scale, suffix = np.ones(n), ""
    if reference is not None:
        scale, suffix = reflection(model, reference), "_reflected"
    twist = model.F[model.elastic_rows] * scale
    A = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [
                (plant.acceleration[:, :r] @ twist) / scale[:, None],
                plant.acceleration[:, r:] * scale / scale[:, None],
            ],
        ]
    )
    B = np.vstack([np.zeros((n, len(index))), plant.accelerated / scale[:, None]])
    C = np.hstack([rows.angle * scale + plant.C[:, :r] @ twist, plant.C[:, r:] * scale])
    states = [f"{name}_{kind}{suffix}" for kind in ("angle", "speed") for name in model.coordinates]
    return _system(model, index, rows, A, B, C, plant.D, states)


def _system(
    model: TorsionalModel,
    index: list[int],
    rows: OutputRows,
    A: np.ndarray,
    B: np.ndarray,
    C: np.ndarray,
    D: np.ndarray,
    states: list[str],
) -> control.StateSpace:
    inputs = [model.inputs[i] for i in index]
    return linear_system(A, B, C, D, dt=0, states=states, inputs=inputs, outputs=list(rows.names), name="driveline")
