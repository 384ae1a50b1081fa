"""Which motions last: decided against rounding, never by the sign of a computed number."""

import numpy as np
import scipy.linalg

from ..driveline.collection import HasDriveline
from .modal import modes

# Least damping ratio of a mode that dies out. Damping ratios are sums of squares of twists, so rounding leaves less than
# 1e-13 of a mode that no damper resists; no real one has less than 1e-4.
UNDAMPED = 1e-10
# Share of the size of a matrix by which it may be off. What is computed is off by up to 1e-15; a mode of 0.5 Hz with a
# damping ratio of 1e-6 sampled every 0.1 ms is still told from an undamped one.
ROUNDING = 1e-12
# Least imaginary part, over the magnitude, of a pole that oscillates; of a double real one rounding leaves 1e-7.
OSCILLATES = 1e-4


def undamped_modes(car: HasDriveline) -> np.ndarray:
    """Elastic modes that no damper resists, by their numbers in `modes`.

    With K and D semidefinite a motion goes on for ever only if it is an undamped mode that twists no damper. So this
    needs no damped pole, whose distance from the axis is lost in the rounding of the fastest one.

    Parameters
    ----------
    car : Driveline or TwoMass

    Returns
    -------
    (k,) ndarray of int

    Examples
    --------
    Two equal half-shafts, damped only in front of the differential: the wheels swing against each other for ever.

    >>> import powertrain_ctrl as pt
    >>> car = pt.Driveline(
    ...     pt.Inertia("engine", J=0.2),
    ...     pt.Inertia("differential", J=0.1),
    ...     pt.SpringDamper("shaft", "engine", "differential", stiffness=1e3, damping=1.0),
    ...     *(pt.SpringDamper(f"{s}_shaft", "differential", s, stiffness=1e3) for s in ("left", "right")),
    ...     *(pt.Inertia(s, J=2.0) for s in ("left", "right")),
    ... )
    >>> undamped_modes(car), pt.modes(car).frequency_hz.round(2)[1:3]
    (array([1]), array([3.56, 9.2 ]))
    """
    result = modes(car)
    # a rigid motion has no damping ratio, and nan is not less than anything
    return np.flatnonzero(result.damping_ratio < UNDAMPED)


def is_eigenvalue(A: np.ndarray, points: np.ndarray, rounding: float = ROUNDING) -> np.ndarray:
    """Which points of the complex plane are eigenvalues of a matrix that differs from A by no more than rounding.

    The smallest singular value of ``point I - A`` is the size of the least change of A that has this eigenvalue, however
    defective A is (L. N. Trefethen, M. Embree, Spectra and Pseudospectra, 2005, section 2).

    Parameters
    ----------
    A : (n, n) ndarray
        Scaled here, so that the units of its states do not count.
    points : (k,) ndarray of complex
    rounding : float
        Share of the norm of A by which it may be off.

    Returns
    -------
    (k,) ndarray of bool

    Examples
    --------
    The two poles of a double integrator can be off by the root of the rounding, and yet:

    >>> A = np.array([[1.0, 1.0], [0.0, 1.0]])
    >>> is_eigenvalue(A, np.array([1.0, 1.0 + 1e-8, 1.0 + 1e-5]))
    array([ True,  True, False])
    """
    if not len(A) or not len(points):
        return np.zeros(len(points), dtype=bool)
    A, _ = scipy.linalg.matrix_balance(A)
    least = rounding * np.linalg.norm(A, 2)
    return np.linalg.svd(points[:, None, None] * np.eye(len(A)) - A, compute_uv=False)[:, -1] <= least


def without_motion_at(point: float, A: np.ndarray, rounding: float = ROUNDING) -> np.ndarray:
    """Matrix with all eigenvalues of A but one at this point; A itself if there is none within rounding.

    Parameters
    ----------
    point : float
        0 for the rigid motion of a continuous system, 1 for that of a discrete one.
    A : (n, n) ndarray
    rounding : float
        As in `is_eigenvalue`.

    Returns
    -------
    (n - 1, n - 1) or (n, n) ndarray

    Examples
    --------
    >>> A = np.array([[1.0, 0.2], [0.0, 0.7]])
    >>> without_motion_at(1.0, A).round(12), without_motion_at(0.9, A) is A
    (array([[0.7]]), True)
    """
    if not len(A):
        return A
    balanced, _ = scipy.linalg.matrix_balance(A)
    _, sizes, Vt = np.linalg.svd(point * np.eye(len(A)) - balanced)
    if sizes[-1] > rounding * np.linalg.norm(balanced, 2):
        return A
    # its direction first, the others at right angles to it
    Q = scipy.linalg.qr(Vt[-1:].T)[0]
    return (Q.T @ balanced @ Q)[1:, 1:]
