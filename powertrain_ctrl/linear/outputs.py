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
    """``y = angle @ q + twist @ theta + speed @ z + acceleration @ z' + friction @ tau``; arrays (outputs, ...)."""

    names: tuple[str, ...]
    angle: np.ndarray
    twist: np.ndarray
    speed: np.ndarray
    acceleration: np.ndarray
    friction: np.ndarray


def output_rows(model: TorsionalModel, names: Iterable[str] | str | None = None, angles: bool = False) -> OutputRows:
    """Rows of the outputs asked for, of all there are if None; node angles only where the states hold them."""
    table = _all_outputs(model, angles)
    index = select(names, table.names, "output")
    return OutputRows(tuple(table.names[i] for i in index), *(array[index] for array in table[1:]))


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
    springs = [name for name, k in zip(model.compliances, model.stiffness, strict=True) if k > 0.0]
    laws = [law.name for law in model.laws]
    holding = [i for i, law in enumerate(model.laws) if law.held is not None]
    zeros = {"angle": n, "twist": r, "speed": n, "acceleration": n, "friction": m}
    blocks = [
        ([f"{node}_angle" for node in model.nodes] if angles else [], {"angle": model.T} if angles else {}),
        ([f"{node}_speed" for node in model.nodes], {"speed": model.T}),
        ([f"{node}_acceleration" for node in model.nodes], {"acceleration": model.T}),
        (
            [f"{name}_torque" for name in model.compliances],
            {
                "twist": model.stiffness[:, None] * model.twist_factor,
                "speed": model.damping[:, None] * model.F,
            },
        ),
        ([f"{name}_twist" for name in springs], {"twist": model.twist_factor[model.stiffness > 0.0]}),
        ([f"{name}_torque" for name in laws], {"friction": np.eye(m)}),
        ([f"{laws[i]}_slip_speed" for i in holding], {"speed": (model.S @ model.T)[holding]}),
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
