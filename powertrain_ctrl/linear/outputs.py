"""Names of inputs and outputs, and each output as a linear combination of what a driveline does.

An output is a combination of the independent twists, the coordinate speeds, the coordinate accelerations and the clutch
torques; state space and simulation share these rows.
"""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from ..base.errors import PowertrainError, UnknownNameError
from .assembly import TorsionalModel


class OutputRows(NamedTuple):
    """``y = angle @ q + twist @ theta + speed @ z + acceleration @ z' + friction @ tau + load @ u``; arrays (outputs, ...).

    Node angles see what has crept besides, ``creep @ integral(U^T (B u - E^T torque of the springs))``; ``motion`` is them
    from all coordinates and creeping directions. An output that would need how fast an input changes has that in
    ``load_rate``.
    """

    names: tuple[str, ...]
    angle: np.ndarray
    twist: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    friction: np.ndarray
    load: np.ndarray
    creep: np.ndarray
    motion: np.ndarray
    load_rate: np.ndarray


def output_rows(
    model: TorsionalModel,
    names: Iterable[str] | str | None = None,
    angles: bool = False,
    inputs: Sequence[int] | None = None,
) -> OutputRows:
    """Rows of the outputs asked for, of all there are if None; node angles only where the states hold them.

    Parameters
    ----------
    inputs : sequence of int, optional
        Those that act, by their numbers; all if None. An output that needs how fast one of them changes is refused, or
        left out where all there are are wanted.

    Raises
    ------
    PowertrainError
        An output that would need the derivative of an input.
    """
    table = _all_outputs(model, angles)
    acting = list(range(len(model.inputs))) if inputs is None else list(inputs)
    index = select(names, table.names, "output")
    hurried = set(np.flatnonzero(table.load_rate[:, acting].any(axis=1)))
    if names is None:
        index = [i for i in index if i not in hurried]
    for i in index:
        if i in hurried:
            by = ", ".join(model.inputs[j] for j in acting if table.load_rate[i, j])
            raise PowertrainError(
                f"{table.names[i]} would need the derivative of {by}: only springs hold what it acts on; leave one of the "
                "two out, or give the node an Inertia, or its spring damping"
            )
    return OutputRows(tuple(table.names[i] for i in index), *(array[index] for array in table[1:]))


def hurrying(model: TorsionalModel) -> tuple[str, ...]:
    """Inputs whose change some output would need."""
    return tuple(model.inputs[j] for j in np.flatnonzero(_all_outputs(model, False).load_rate.any(axis=0)))


def select(names: Iterable[str] | str | None, known: Sequence[str], what: str) -> list[int]:
    """Indices of the signals asked for; None means all."""
    if names is None:
        return list(range(len(known)))
    names = list(names) if isinstance(names, Iterable) and not isinstance(names, str) else [names]
    position = {name: i for i, name in enumerate(known)}
    for name in names:
        if not isinstance(name, str) or name not in position:
            raise UnknownNameError("signal", name, known, f"an {what} of this driveline")
    if not names or len(set(names)) < len(names):
        raise PowertrainError(f"{what}s {names!r}: permitted: at least one signal, each once")
    return [position[name] for name in names]


def _all_outputs(model: TorsionalModel, angles: bool) -> OutputRows:
    r, n, m = len(model.elastic_rows), len(model.coordinates), len(model.laws)
    sprung = np.flatnonzero(model.stiffness)
    springs = [name for name, k in zip(model.compliances, model.stiffness, strict=True) if k > 0.0]
    laws = [law.name for law in model.laws]
    # what an element carries is the sum of its spring and its laws, but a torque converter not the same at both its ends
    owners = [law.name if law.regions else law.owner for law in model.laws]
    apart = [name for name in dict.fromkeys(owners) if name not in model.compliances]
    holding = [
        i for i, law in enumerate(model.laws) if law.held is not None and law.imposes is None and law.load is None
    ]
    B, S, (U, V, bend) = model.B, model.S[holding], (model.following.U, model.following.V, model.following.bend)
    speed, torque, rate = model.speed, model.torque, model.twist_rate
    at_once = V @ (V.T @ B)
    # an acceleration follows the rates of the twists that creep a node along
    pull = speed.on_twist
    turned = {"angle": model.T, "creep": U, "motion": model.following.motions, "load": at_once}
    moving = {"twist": speed.on_twist, "speed": speed.on_speed, "load": speed.on_load @ B, "load_rate": at_once}
    hastened = {
        "twist": pull @ rate.on_twist[model.elastic_rows],
        "speed": pull @ rate.on_speed[model.elastic_rows],
        "acceleration": model.T,
        "load": pull @ (rate.on_load[model.elastic_rows] @ B),
        "load_rate": np.abs(speed.on_load @ B) + np.abs(at_once),
    }
    zeros = {"angle": n, "twist": r, "speed": n, "acceleration": n, "friction": m}
    zeros |= {"load": B.shape[1], "creep": U.shape[1], "motion": n + U.shape[1], "load_rate": B.shape[1]}
    blocks = [
        ([f"{node}_angle" for node in model.nodes] if angles else [], turned if angles else {}),
        ([f"{node}_speed" for node in model.nodes], moving),
        ([f"{node}_acceleration" for node in model.nodes], hastened),
        (
            [f"{name}_torque" for name in model.compliances],
            {
                "twist": torque.on_twist,
                "speed": torque.on_speed,
                "load": torque.on_load @ B,
                "friction": _sums(model.compliances, owners),
            },
        ),
        (
            [f"{name}_twist" for name in springs],
            {"twist": model.twist_factor[sprung], "load": (bend @ (V.T @ B))[sprung]},
        ),
        ([f"{name}_torque" for name in apart], {"friction": _sums(apart, owners)}),
        ([f"{laws[i]}_slip_speed" for i in holding], {what: S @ array for what, array in moving.items()}),
    ]
    names = tuple(name for block, _ in blocks for name in block)
    if len(set(names)) < len(names):
        double = next(name for name in names if names.count(name) > 1)
        raise PowertrainError(f'two signals would be named "{double}"; rename an element')
    arrays = (
        np.vstack([columns.get(kind, np.zeros((len(block), width))) for block, columns in blocks])
        for kind, width in zeros.items()
    )
    return OutputRows(names, *arrays)


def _sums(elements: Sequence[str], owners: Sequence[str]) -> np.ndarray:
    """(elements, laws) ndarray: sums over the laws of each element."""
    return np.array([[float(owner == name) for owner in owners] for name in elements]).reshape(
        len(elements), len(owners)
    )
