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
    return InPlane(A, B, C).response(points)


class InPlane:
    """A linear system decomposed, for its response at several sets of points; arguments as of `plane_response`."""

    def __init__(self, A: np.ndarray, B: np.ndarray, C: np.ndarray):
        self.shape = len(A), C.shape[0], B.shape[1]
        if len(A):
            balanced, (scale, _) = scipy.linalg.matrix_balance(A, permute=False, separate=True)
            self.T, Q = scipy.linalg.schur(balanced, output="complex")
            self.right, self.left = Q.conj().T @ (B / scale[:, None]), (C * scale) @ Q

    def response(self, points: np.ndarray) -> np.ndarray:
        """(N, outputs, inputs) ndarray of complex."""
        n, outputs, inputs = self.shape
        if not n:
            return np.zeros((len(points), outputs, inputs), dtype=complex)
        states = np.empty((n, inputs, len(points)), dtype=complex)
        flat = states.reshape(n, -1)
        for i in reversed(range(n)):
            faster = (self.T[i, i + 1 :] @ flat[i + 1 :]).reshape(inputs, -1)
            distance = points - self.T[i, i]
            distance[distance == 0.0] = ROUNDING * points[distance == 0.0]
            np.divide(self.right[i, :, None] + faster, distance, out=states[i])
        return (self.left @ flat).reshape(outputs, inputs, -1).transpose(2, 0, 1)
