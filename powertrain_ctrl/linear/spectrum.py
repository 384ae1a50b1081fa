"""Poles of a damped driveline."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from ..base.doors import checked
from ..driveline.collection import Driveline, HasDriveline
from .assembly import TorsionalModel, as_driveline, assemble
from .couplings import coupling_matrix, couplings_of, require_bodies, uncoupled
from .energy import energy_form
from .modal import modal_basis, undamped
from .quadratic import by_magnitude, damped_poles, dissipative_poles
from .solved import solved

# A mode whose damping is below this part of its frequency is undamped: rounding gives some 1e-30, physics 1e-6 and more.
UNDAMPED = 1e-18
# A motion that couplings resist by less than this part of what they do to others is free of them.
FREE = 1e-12


@checked
def poles(car: HasDriveline) -> np.ndarray:
    """Poles of the damped driveline: one 0 for each rigid motion, pairs, and the real ones of overdamped modes.

    Parameters
    ----------
    car : Driveline or TwoMass

    Returns
    -------
    poles : (k,) ndarray of complex
        [rad/s], ascending in magnitude, the conjugate with negative imaginary part first. A motion that only dampers
        resist has a single, real pole. None has a positive real part, since no damper drives a driveline; a torque converter
        at an operating point may.

    Warns
    -----
    RuntimeWarning
        A pole that cannot be trusted, in a driveline whose values lie many decades apart.

    Raises
    ------
    TopologyError
        A driveline that cannot be assembled, as in `assemble`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.poles(pt.examples.conventional())[:3].round(2)
    array([ 0.  +0.j , -1.64-16.5j, -1.64+16.5j])
    """
    driveline = as_driveline(car)
    if couplings_of(driveline):
        found = _coupled_poles(driveline)
        return found[by_magnitude(found)]
    rows = solved(driveline)
    if rows is not None and rows.has_loss:
        rows = None  # which the assembly refuses
    if rows is None and (creeping := assemble(driveline)).following.U.shape[1]:
        found = _creeping_poles(creeping)
        return found[by_magnitude(found)]
    model = undamped(driveline, rows)
    omega, Phi, n_rigid = modal_basis(model)
    dampers = np.sqrt(model.damping)[:, None] * (model.F @ Phi)
    # Rigid motions come first in the basis, those that no damper resists before the others.
    n_free = model.free.shape[1]
    share = np.einsum("ij,ij->j", dampers, dampers)
    still = np.flatnonzero(share <= UNDAMPED * omega)
    still = still[still >= n_rigid]
    damped = np.setdiff1d(np.arange(n_free, len(omega)), still)
    moving = damped_poles(omega[damped], dampers[:, damped])
    found = np.concatenate([np.zeros(n_free), -1j * omega[still], 1j * omega[still], moving])
    return found[by_magnitude(found)]


def _creeping_poles(model: TorsionalModel) -> np.ndarray:
    """Poles where nodes creep: eigenvalues in energy coordinates, one 0 for each free motion besides."""
    energy, L = energy_form(model), model.mass_factor
    free = L.T @ model.free_motions
    moving = scipy.linalg.qr(free)[0][:, free.shape[1] :] if free.size else None
    return np.concatenate([np.zeros(free.shape[1]), dissipative_poles(energy.matrix(moving), len(energy.H))])


def _coupled_poles(car: Driveline) -> np.ndarray:
    """Poles where torques depend on several speeds: eigenvalues in energy coordinates, and a 0 for each free motion."""
    model, rows = assemble(uncoupled(car)), couplings_of(car)
    require_bodies(rows, model.nodes, model.following)
    energy, D = energy_form(model), coupling_matrix(rows, model.nodes)
    r = len(energy.H)
    A = energy.matrix()
    A[:, r:] -= energy.driven(D @ scipy.linalg.solve_triangular(model.mass_factor, model.T.T, lower=True).T)
    # what neither springs nor dampers nor couplings resist
    springless = model.free_motions
    resisted = D @ model.T @ springless
    size = np.abs(D).max() * np.abs(model.T).max() * np.abs(springless).max(initial=0.0)
    free = springless @ scipy.linalg.null_space(np.vstack([resisted / size, np.zeros((1, springless.shape[1]))]), FREE)
    moving = np.eye(len(A))
    if free.size:
        still = np.vstack([np.zeros((r, free.shape[1])), model.mass_factor.T @ free])
        moving = scipy.linalg.qr(still)[0][:, free.shape[1] :]
    return np.concatenate([np.zeros(free.shape[1]), np.linalg.eigvals(moving.T @ A @ moving)]).astype(complex)
