"""How springs and laws carry a steady load."""

from collections.abc import Sequence

import numpy as np

from ..base.errors import PowertrainError
from ..elements import Law

# Torques below this part of the loads are none.
AGREE = 1e-9
# Laws are put into the modes that carry a load in at most so many rounds.
ROUNDS = 64


def carried(
    springs: np.ndarray, stiffness: np.ndarray, rows: np.ndarray, laws: Sequence[Law], force: np.ndarray
) -> tuple[np.ndarray, list[int]]:
    """Motion in which springs and laws balance a force, and the mode of each law.

    Parameters
    ----------
    springs, rows : (springs, n), (laws, n) ndarray
        Twists of springs and laws from motions.
    stiffness : (springs,) ndarray
        [N m/rad].
    laws : sequence of Law
        Such as have a twist. Without load they are in the middle of their gap.
    force : (n,) ndarray
        On the motions, in balance with the inertia of what turns as one body.

    Raises
    ------
    PowertrainError
        A law that carries its load in none of its modes, or several side by side that share it in no steady way.
    """
    size = float(np.abs(force).max(initial=0.0))
    for law in laws:
        if any(mode.stiffness and mode.leak for mode in law.modes.values()):
            raise PowertrainError(f"{law.owner} creeps under a load; give initial speeds and twists, or its speed 0")
    modes = [_stiffest(law) for law in laws]
    for _ in range(ROUNDS):
        lines = [_line(law, number) for law, number in zip(laws, modes, strict=True)]
        k, origin, torque = np.array(lines).reshape(len(laws), 3).T
        K = (springs.T * stiffness) @ springs + (rows.T * k) @ rows
        moved = np.linalg.lstsq(K, force + rows.T @ (k * origin - torque), rcond=1e-14)[0]
        loads = k * (rows @ moved - origin) + torque
        chosen = [_carrying(law, float(load), size) for law, load in zip(laws, loads, strict=True)]
        if chosen == modes:
            return moved, modes
        modes = chosen
    raise PowertrainError(
        "play and springs side by side share this load in no steady way; give twists instead of a load"
    )


def _stiffest(law: Law) -> int:
    return max(law.modes, key=lambda number: law.modes[number].stiffness)


def _line(law: Law, number: int) -> tuple[float, float, float]:
    """Stiffness, twist and torque of a point of a mode's line; what carries nothing is kept in the middle."""
    mode = law.modes[number]
    if mode.stiffness:
        return mode.stiffness, mode.origin or 0.0, mode.torque
    return law.modes[_stiffest(law)].stiffness, 0.0, mode.torque


def _carrying(law: Law, torque: float, size: float) -> int:
    """Mode in which a law carries a torque at rest."""
    at_rest = law.starting(0.0)[0]
    for number, mode in law.modes.items():
        if mode.stiffness:
            twist = (mode.origin or 0.0) + (torque - mode.torque) / mode.stiffness
            if law.starting(twist)[0] == number:
                return number
    if abs(torque - law.modes[at_rest].torque) <= AGREE * size or not size:
        return at_rest
    raise PowertrainError(f"{law.owner} carries {torque:g} N m in none of its modes at rest")
