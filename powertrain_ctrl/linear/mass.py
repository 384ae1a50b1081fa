"""Square root of an inertia matrix: mass-scaled coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg


class MassFactor(NamedTuple):
    """L of ``M = L L^T``: the square roots of a diagonal M, or else a lower triangular matrix.

    >>> mass_factor(np.diag([4.0, 9.0])).scaled(np.array([[1.0, 1.0]])).round(3)
    array([[0.5  , 0.333]])
    """

    roots: np.ndarray | None
    lower: np.ndarray | None = None

    @property
    def L(self) -> np.ndarray:
        """(n, n) ndarray."""
        if self.lower is not None:
            return self.lower
        assert self.roots is not None
        return np.diag(self.roots)

    def scaled(self, rows: np.ndarray) -> np.ndarray:
        """(rows, n) ndarray: combinations of the coordinates as those of mass-scaled ones, ``rows L^-T``."""
        if self.roots is not None:
            return rows / self.roots
        return scipy.linalg.solve_triangular(self.L, rows.T, lower=True).T

    def lifted(self, motions: np.ndarray) -> np.ndarray:
        """(n, motions) ndarray: motions of the coordinates in mass-scaled ones, ``L^T motions``."""
        return motions * self.roots[:, None] if self.roots is not None else self.L.T @ motions

    def lowered(self, scaled: np.ndarray) -> np.ndarray:
        """(n, motions) ndarray, the way back: ``L^-T scaled``."""
        if self.roots is not None:
            return scaled / self.roots[:, None]
        return scipy.linalg.solve_triangular(self.L, scaled, lower=True, trans="T")

    def solve(self, right: np.ndarray) -> np.ndarray:
        """``M^-1 right``."""
        if self.roots is not None:
            return (right.T / self.roots**2).T
        return scipy.linalg.cho_solve((self.L, True), right)


def mass_factor(M: np.ndarray) -> MassFactor:
    """Factor of an (n, n) inertia matrix."""
    diagonal = np.diag(M)
    if np.count_nonzero(M) > np.count_nonzero(diagonal):
        return MassFactor(None, scipy.linalg.cholesky(M, lower=True))
    return MassFactor(np.sqrt(diagonal))
