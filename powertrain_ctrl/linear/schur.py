"""Response of a linear system in the whole plane, by one decomposition for all points."""

import numpy as np
import scipy.linalg

from .stability import ROUNDING


def plane_response(A: np.ndarray, B: np.ndarray, C: np.ndarray, points: np.ndarray) -> np.ndarray:
    """``C (s I - A)^-1 B`` at points s or z of the plane, by substitution in the Schur form of A.

    Parameters
    ----------
    A, B, C : (n, n), (n, inputs), (outputs, n) ndarray
    points : (N,) ndarray of complex

    Returns
    -------
    (N, outputs, inputs) ndarray of complex
        At an undamped pole, to the last bit, as large as can be told.

    Examples
    --------
    >>> one = np.eye(1)
    >>> plane_response(-2.0 * one, one, one, np.array([0.0, 2.0j]))[:, 0, 0].round(3)
    array([0.5 +0.j  , 0.25-0.25j])
    """
    if not len(A):
        return np.zeros((len(points), C.shape[0], B.shape[1]), dtype=complex)
    balanced, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
    T, Q = scipy.linalg.schur(balanced, output="complex")
    right = Q.conj().T @ (B / scale[:, None])
    states = np.empty((len(A), len(points), B.shape[1]), dtype=complex)
    for i in reversed(range(len(A))):
        faster = np.tensordot(T[i, i + 1 :], states[i + 1 :], axes=1)
        distance = points - T[i, i]
        states[i] = (right[i] + faster) / np.where(distance == 0.0, ROUNDING * points, distance)[:, None]
    return np.tensordot((C * scale) @ Q, states, axes=1).transpose(1, 0, 2)
