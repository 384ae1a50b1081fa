"""How springs and laws carry a steady load."""

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from ..base.errors import PowertrainError
from ..elements import Law
from .kinematics import product

# Torques below this part of the loads are none.
AGREE = 1e-9
# Beside what has a gap lies a spring of this part of its stiffness while its mode is sought, the softest last.
SOFT = (1e-3, 1e-6, 1e-9)
# Laws are put into the modes that carry a load in at most so many rounds, each ended by so many halvings.
ROUNDS, HALVINGS = 256, 50


def carried(
    springs: np.ndarray,
    stiffness: np.ndarray,
    rows: np.ndarray,
    laws: Sequence[Law],
    force: np.ndarray,
    size: float,
) -> tuple[np.ndarray, list[int]]:
    """Motion in which springs and laws balance a force, and the mode of each law.

    Parameters
    ----------
    springs, rows : (springs, n), (laws, n) ndarray
        Twists of springs and laws from motions.
    stiffness : (springs,) ndarray
        [N m/rad].
    laws : sequence of Law
        Such as have a twist, but no friction. Without load they are in the middle of their gap.
    force : (n,) ndarray
        On the motions, in balance with the inertia of what turns as one body.
    size : float
        Magnitude of the loads that it is made of.

    Raises
    ------
    PowertrainError
        A law that creeps under a load, or carries its load in none of its modes.
    """
    for law in laws:
        if any(mode.stiffness and mode.origin is None for mode in law.modes.values()):
            raise PowertrainError(f"{law.owner} creeps under a load; give initial speeds and twists instead")
    elastic = (springs.T * stiffness) @ springs
    for soft in SOFT:
        modes = _modes(elastic, rows, laws, force, soft)
        k, origin, torque = lines(laws, modes)
        K = elastic + (rows.T * k) @ rows
        moved = np.linalg.lstsq(K, force + rows.T @ (k * origin - torque), rcond=1e-14)[0]
        missed = K @ moved - force - rows.T @ (k * origin - torque)
        if np.abs(missed).max(initial=0.0) > AGREE * size:
            continue  # more than nothing is carried by what was taken to be in its gap
        # what carries nothing is in the middle, if nothing else says where
        still = np.vstack([springs[stiffness > 0.0], rows[k > 0.0], np.zeros((1, rows.shape[1]))])
        follow, flat = scipy.linalg.null_space(still), rows[k == 0.0]
        turned = product(flat, follow)
        return moved - follow @ np.linalg.lstsq(turned, flat @ moved, rcond=1e-12)[0], modes
    names = ", ".join(law.owner for law in laws)
    raise PowertrainError(f"{names}: carry this load in none of their modes at rest; give twists instead of a load")


def _modes(elastic: np.ndarray, rows: np.ndarray, laws: Sequence[Law], force: np.ndarray, soft: float) -> list[int]:
    """Modes in the minimum of a potential that is convex, since no torque falls with its twist: Newton's method."""
    stiffest = [max(mode.stiffness for mode in law.modes.values()) for law in laws]
    beside = soft * np.array(stiffest) * [any(not mode.stiffness for mode in law.modes.values()) for law in laws]

    def starting(moved: np.ndarray) -> list[int]:
        return [law.starting(float(twist))[0] for law, twist in zip(laws, rows @ moved, strict=True)]

    def left(moved: np.ndarray) -> np.ndarray:
        """Force that is not balanced."""
        k, origin, torque = lines(laws, starting(moved))
        twists = rows @ moved
        return force - elastic @ moved - rows.T @ (k * (twists - origin) + torque + beside * twists)

    moved = np.zeros(rows.shape[1])
    for _ in range(ROUNDS):
        modes = starting(moved)
        k, _, _ = lines(laws, modes)
        K = elastic + (rows.T * (k + beside)) @ rows
        step = np.linalg.lstsq(K, left(moved), rcond=1e-14)[0]
        if starting(moved + step) == modes:
            break
        # not beyond the lowest point in this direction
        share, low = 1.0, 0.0
        for _ in range(HALVINGS * bool(step @ left(moved + step) < 0.0)):
            middle = 0.5 * (low + share)
            low, share = (middle, share) if step @ left(moved + middle * step) > 0.0 else (low, middle)
        moved = moved + share * step
    return modes


def lines(laws: Sequence[Law], modes: Sequence[int]) -> np.ndarray:
    """(3, laws) ndarray: stiffness, and twist and torque of a point, of the line of each law in its mode."""
    chosen = [law.modes[number] for law, number in zip(laws, modes, strict=True)]
    lines = [(mode.stiffness, mode.origin or 0.0, mode.torque) for mode in chosen]
    return np.array(lines, dtype=float).reshape(len(laws), 3).T
