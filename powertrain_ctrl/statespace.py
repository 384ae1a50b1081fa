"""A driveline as ``control.StateSpace`` with named states, inputs and outputs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import control
import numpy as np
import scipy.linalg

from .assembly import TorsionalModel, assemble
from .doors import checked
from .driveline import HasDriveline
from .errors import PowertrainError
from .kinematics import CANCELLED
from .outputs import OutputRows, output_rows, select
from .reflection import reflection


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
        ``<inertia>_torque`` [N m], ``<mass>_force`` [N]; None means all.
    outputs : str or list of str, optional
        ``<node>_speed``, ``<node>_acceleration`` [rad/s or m/s, per s]; ``<compliance>_torque`` [N m],
        ``<compliance>_twist`` [rad]; ``<clutch>_torque`` [N m], ``<clutch>_slip_speed`` [rad/s]; with "angle" also
        ``<node>_angle`` [rad or m]. None means all.
    coordinates : {"twist", "angle"}
        "twist": twists of the springs and speeds, minimal for what is asked: rigid motions that no output sees, and
        parts that no input or no output touches, are left out, so there is at most one zero pole per rigid motion
        and ``dcgain`` is right. "angle": angle and speed of every coordinate, equation (2.8), with two zero poles per
        rigid motion.
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
        Coordinates that are not known, a reference with "twist", no signal at all, or one twice.

    Examples
    --------
    Torque to vehicle acceleration, whose steady state is one over the inertia:

    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> G = pt.state_space(car, "engine_torque", "vehicle_acceleration")
    >>> G.nstates, round(float(G.dcgain()), 6)
    (12, 0.015557)

    System matrix (2.9):

    >>> pt.state_space(car, coordinates="angle", reference="engine").A.shape
    (14, 14)
    """
    model = assemble(car)
    index = select(inputs, model.inputs, "input")
    if coordinates == "twist":
        if reference is not None:
            raise PowertrainError('reference is for coordinates="angle"; twists and their rates belong to no node')
        return _in_twists(model, index, output_rows(model, outputs))
    if coordinates == "angle":
        return _in_angles(model, index, output_rows(model, outputs, angles=True), reference)
    raise PowertrainError(f'coordinates = {coordinates!r}, permitted: "twist", "angle"')


class _Linear(NamedTuple):
    """``z' = a_twist theta + a_speed z + a_input u`` and outputs in the same terms; z are the coordinate speeds."""

    a_twist: np.ndarray
    a_speed: np.ndarray
    a_input: np.ndarray
    y_twist: np.ndarray
    y_speed: np.ndarray
    y_input: np.ndarray


def _linear(model: TorsionalModel, index: list[int], rows: OutputRows) -> _Linear:
    a_twist = -model.solve_mass(model.F.T @ (model.stiffness[:, None] * model.twist_factor))
    a_speed = -model.solve_mass(model.D)
    a_input = model.solve_mass(model.T.T @ model.B[:, index])
    y_twist = rows.twist + rows.acceleration @ a_twist
    y_speed = rows.speed + rows.acceleration @ a_speed
    y_input = rows.acceleration @ a_input
    if rows.friction[:, model.locked].any():
        r, n, u = a_twist.shape[1], a_speed.shape[0], len(model.inputs)
        none = (np.zeros((r, n)), np.zeros((n, r)), np.zeros((u, r)), np.zeros((u, n)))
        y_twist = y_twist + rows.friction @ model.locked_torque(np.eye(r), none[1], a_twist, none[2])
        y_speed = y_speed + rows.friction @ model.locked_torque(none[0], np.eye(n), a_speed, none[3])
        chosen = np.eye(u)[:, index]
        zero = np.zeros((r, len(index))), np.zeros((n, len(index)))
        y_input = y_input + rows.friction @ model.locked_torque(*zero, a_input, chosen)
    return _Linear(a_twist, a_speed, a_input, y_twist, y_speed, y_input)


def _in_twists(model: TorsionalModel, index: list[int], rows: OutputRows) -> control.StateSpace:
    plant = _linear(model, index, rows)
    kept = _touched_coordinates(model, plant)
    twists = np.flatnonzero(model.F[model.elastic_rows][:, kept].any(axis=1))
    spinning, speed_names = _speed_states(model, kept, rows)
    speeds = np.linalg.pinv(spinning)  # coordinate speeds from the speed states, up to motions that nothing sees
    rate = model.F[model.elastic_rows[twists]]
    A = np.block(
        [
            [np.zeros((len(twists), len(twists))), rate @ speeds],
            [spinning @ plant.a_twist[:, twists], spinning @ plant.a_speed @ speeds],
        ]
    )
    B = np.vstack([np.zeros((len(twists), len(index))), spinning @ plant.a_input])
    C = np.hstack([plant.y_twist[:, twists], plant.y_speed @ speeds])
    states = [f"{model.compliances[i]}_twist" for i in model.elastic_rows[twists]] + speed_names
    return _system(model, index, rows, A, B, C, plant.y_input, states)


def _in_angles(model: TorsionalModel, index: list[int], rows: OutputRows, reference: str | None) -> control.StateSpace:
    plant = _linear(model, index, rows)
    n = len(model.coordinates)
    scale, suffix = np.ones(n), ""
    if reference is not None:
        scale, suffix = reflection(model, reference), "_reflected"
    twist = model.F[model.elastic_rows] * scale
    A = np.block(
        [
            [np.zeros((n, n)), np.eye(n)],
            [(plant.a_twist @ twist) / scale[:, None], plant.a_speed * scale / scale[:, None]],
        ]
    )
    B = np.vstack([np.zeros((n, len(index))), plant.a_input / scale[:, None]])
    C = np.hstack([rows.angle * scale + plant.y_twist @ twist, plant.y_speed * scale])
    states = [f"{name}_{kind}{suffix}" for kind in ("angle", "speed") for name in model.coordinates]
    return _system(model, index, rows, A, B, C, plant.y_input, states)


def _touched_coordinates(model: TorsionalModel, plant: _Linear) -> np.ndarray:
    """Coordinates in parts that some input drives and some output sees (boolean mask)."""
    kept = np.zeros(len(model.coordinates), dtype=bool)
    for part in range(model.parts.max() + 1):
        inside = model.parts == part
        twists = model.F[model.elastic_rows][:, inside].any(axis=1)
        seen = plant.y_speed[:, inside].any() or plant.y_twist[:, twists].any()
        kept |= inside & (seen and plant.a_input[inside].any())
    return kept


def _speed_states(model: TorsionalModel, kept: np.ndarray, rows: OutputRows) -> tuple[np.ndarray, list[str]]:
    """Rows (speed states, n) on the coordinate speeds and their names.

    All coordinate speeds if the outputs see every rigid motion; otherwise the rates of the twists, which no rigid
    motion moves, and as many of the outputs as see the remaining ones.
    """
    free = model.null_motions(model.resisting_rows)
    free = free[:, free[kept].any(axis=0)]
    seen = rows.speed @ free
    seen[np.abs(seen) <= CANCELLED * (np.abs(rows.speed) @ np.abs(free))] = 0.0
    picked = _independent(seen)
    if len(picked) == free.shape[1]:
        return np.eye(len(kept))[kept], [
            f"{name}_speed" for name, keep in zip(model.coordinates, kept, strict=True) if keep
        ]
    rates = [i for i in model.independent_rows(model.resisting_rows) if model.F[i, kept].any()]
    names = [*(f"{model.compliances[i]}_twist_rate" for i in rates), *(rows.names[i] for i in picked)]
    return np.vstack([model.F[rates], rows.speed[picked]]), names


def _independent(matrix: np.ndarray) -> list[int]:
    """Indices of linearly independent rows."""
    if not matrix.any():
        return []
    _, R, order = scipy.linalg.qr(matrix.T, mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    return sorted(order[: int((size > 1e-9 * size[0]).sum())].tolist())


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
    return control.ss(A, B, C, D, dt=0, states=states, inputs=inputs, outputs=list(rows.names), name="driveline")
