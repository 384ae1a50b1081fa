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
# Laws are put into the modes that carry a load in at most so many rounds; each ends where the force along its step has
# fallen to this part, or after so many trials.
ROUNDS, FLAT, TRIALS = 256, 1e-6, 100


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
        if k.all():
            return moved, modes
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

    def balance(moved: np.ndarray) -> tuple[list[int], np.ndarray, np.ndarray]:
        """Modes, force that is not balanced, stiffness."""
        twists = rows @ moved
        modes = [law.starting(twist)[0] for law, twist in zip(laws, twists.tolist(), strict=True)]
        k, origin, torque = lines(laws, modes)
        left = force - elastic @ moved - rows.T @ (k * (twists - origin) + torque + beside * twists)
        return modes, left, elastic + (rows.T * (k + beside)) @ rows

    moved = np.zeros(rows.shape[1])
    modes, left, K = balance(moved)
    for _ in range(ROUNDS):
        step = np.linalg.lstsq(K, left, rcond=1e-14)[0]
        before, least, low, high, share = modes, FLAT * (step @ left), 0.0, 1.0, 1.0
        modes, left, K = balance(moved + step)
        if modes == before:
            break
        # not beyond the lowest point in this direction, where the force along it is zero: Newton's method again
        for _ in range(TRIALS):
            along = step @ left
            if abs(along) <= least or (share == 1.0 and along > 0.0):
                break
            low, high = (share, high) if along > 0.0 else (low, share)
            share += along / (step @ K @ step)
            if not low < share < high:
                share = 0.5 * (low + high)
            modes, left, K = balance(moved + share * step)
        moved = moved + share * step
    return modes


def lines(laws: Sequence[Law], modes: Sequence[int]) -> np.ndarray:
    """(3, laws) ndarray: stiffness, and twist and torque of a point, of the line of each law in its mode."""
    chosen = [law.modes[number] for law, number in zip(laws, modes, strict=True)]
    lines = [(mode.stiffness, mode.origin or 0.0, mode.torque) for mode in chosen]
    return np.array(lines, dtype=float).reshape(len(laws), 3).T
