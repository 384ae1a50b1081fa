"""A driveline in energy coordinates, ``x = (sqrt(k) twist, sqrt(J) speed)``, in which ``A + A^T`` is semidefinite.

What is lost is lost in dampers: those with which nodes without inertia creep act on the springs, the others on the bodies.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import scipy.linalg

from .assembly import TorsionalModel


class EnergyForm(NamedTuple):
    """``x' = [[-S S^T, H], [-H^T, -D^T D]] x + driven(loads)`` with r springs and n coordinates.

    Attributes
    ----------
    spring_factor : (r, r) ndarray
        Upper triangular; springs hold half of ``|spring_factor twist|^2``.
    mass_factor : (n, n) ndarray
        Lower triangular; bodies hold half of ``|mass_factor^T speed|^2``.
    H : (r, n) ndarray
        Springs and bodies on each other [rad/s].
    S, D : (r, p), (compliances, n) ndarray
        Dampers on springs and on bodies.
    U, T : (nodes, p), (nodes, n) ndarray
        Motion of the nodes, as in `Following`.
    """

    spring_factor: np.ndarray
    mass_factor: np.ndarray
    H: np.ndarray
    S: np.ndarray
    D: np.ndarray
    U: np.ndarray
    T: np.ndarray

    def matrix(self, moving: np.ndarray | None = None) -> np.ndarray:
        """A; given an orthonormal basis (n, motions) of some motions that of these."""
        H, D = (self.H, self.D) if moving is None else (self.H @ moving, self.D @ moving)
        return np.block([[-self.S @ self.S.T, H], [-H.T, -D.T @ D]])

    def driven(self, loads: np.ndarray) -> np.ndarray:
        """(r + n, k) ndarray: rates under loads (nodes, k)."""
        return np.vstack(
            [
                self.S @ (self.U.T @ loads),
                scipy.linalg.solve_triangular(self.mass_factor, self.T.T @ loads, lower=True),
            ]
        )

    def state(self, twist: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """x from independent twists (r, ...) and coordinate speeds (n, ...)."""
        return np.concatenate([self.spring_factor @ twist, self.mass_factor.T @ speed])

    def twist(self, x: np.ndarray) -> np.ndarray:
        """(r, ...) ndarray: independent twists from x, which may have more behind."""
        r = len(self.spring_factor)
        return scipy.linalg.solve_triangular(self.spring_factor, x[:r]) if r else x[:0]

    def speed(self, x: np.ndarray) -> np.ndarray:
        """(n, ...) ndarray: coordinate speeds from x."""
        r, n = self.H.shape
        return scipy.linalg.solve_triangular(self.mass_factor, x[r : r + n], lower=True, trans="T")


def energy_form(model: TorsionalModel) -> EnergyForm:
    """Energy coordinates of a model.

    Examples
    --------
    A mass of 4 kg on a spring of 9 N/m whose other end a damper of 3 N s/m holds:

    >>> import powertrain_ctrl as pt
    >>> body = pt.Driveline(
    ...     pt.Mass("body", m=4.0),
    ...     pt.SpringDamper("spring", "body", "end", stiffness=9.0),
    ...     pt.Drag("damper", "end", damping=3.0),
    ... )
    >>> abs(energy_form(pt.assemble(body)).matrix())
    array([[3. , 1.5],
           [1.5, 0. ]])
    """
    L, rows = model.mass_factor, model.elastic_rows
    spread = np.sqrt(model.stiffness)[:, None] * model.twist_factor
    factor = np.asarray(np.linalg.qr(spread, mode="r")) if len(rows) else np.zeros((0, 0))
    H, D = (scipy.linalg.solve_triangular(L, F.T, lower=True).T for F in (model.F[rows], model.F))
    S = factor @ model.following.creep[rows]
    return EnergyForm(factor, L, factor @ H, S, np.sqrt(model.damping)[:, None] * D, model.following.U, model.T)
