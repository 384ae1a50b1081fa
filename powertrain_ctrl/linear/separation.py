"""Twists and rigid motions told apart: ``z = R theta' + N v`` with coordinate speeds z, twists theta, rigid speeds v.

Where nodes without inertia creep, twist rates are no motions of the coordinates alone; then ``z = R w + N v`` with the
speeds w of some coordinates, rigid motions left out. The columns of N are the motions that twist no spring, and
``N^T M R = 0``. A motion that no damper resists either is *free*: nothing acts on it but the inputs, so its row and its
column of the system matrix are zero, exactly and not to rounding.
"""

from typing import NamedTuple

import numpy as np
import scipy.linalg

from ..driveline.kinematics import CANCELLED, product
from .assembly import TorsionalModel
from .condensing import untwisting


class Separation(NamedTuple):
    """A driveline with n coordinates, s motions that twist springs, f free and q resisted rigid motions.

    Attributes
    ----------
    rates : (s, n) ndarray
        Twist rates of the independent springs, or relative speeds w, from the coordinate speeds.
    rate_names, rate_parts : tuple of str, (s,) ndarray of int
        Names of these and numbers of the connected parts they belong to.
    R : (n, s) ndarray
        Coordinate motion when one of these rates is 1 and no rigid motion has momentum.
    free, resisted : (n, f), (n, q) ndarray
        Rigid motions that nothing resists, and those that dampers resist: N.
    names : tuple of str
        Coordinate that each resisted motion is named after.
    on_R, on_resisted : (compliances, s), (compliances, q) ndarray
        Twist of every compliance; in a free motion there is none.
    free_rate, resisted_rate : (f, n), (q, n) ndarray
        Acceleration of the rigid motions from loads on the coordinates.
    resistance : (q, compliances) ndarray
        The same, of the resisted ones, from torques that the compliances take up.
    """

    rates: np.ndarray
    rate_names: tuple[str, ...]
    rate_parts: np.ndarray
    R: np.ndarray
    free: np.ndarray
    resisted: np.ndarray
    names: tuple[str, ...]
    on_R: np.ndarray
    on_resisted: np.ndarray
    free_rate: np.ndarray
    resisted_rate: np.ndarray
    resistance: np.ndarray


def separate(model: TorsionalModel) -> Separation:
    """Twists, resisted and free rigid motions of a model."""
    damper, elastic, n = model.stiffness == 0.0, model.elastic_rows, len(model.M)
    creeps = model.following.U.shape[1] > 0
    if creeps:
        springless = untwisting(model.following, np.flatnonzero(~damper), model.damping)
    else:
        springless = model.null_motions(np.flatnonzero(~damper))
    free = model.free_motions
    free_rate = accelerated(model.M, free, free.T)
    chosen = complement(springless, free)
    resisted = springless[:, chosen]
    resisted = resisted - free @ (free_rate @ (model.M @ resisted))
    resisted_rate = accelerated(model.M, resisted, resisted.T)
    on_resisted = product(model.F, resisted)
    if creeps:
        rigid = np.hstack([free, resisted])
        moving = moving_ones(springless, np.sqrt(np.diag(model.M)))
        R = _one_moves(rigid.T @ model.M, moving)
        rates = np.eye(n)[moving] - rigid[moving] @ np.vstack([free_rate, resisted_rate]) @ model.M
        names, numbers = [f"{model.coordinates[i]}_relative_speed" for i in moving], model.parts[moving]
        on_R = product(model.F, R)
    else:
        R = one_twist(model.F[elastic], springless, np.sqrt(np.diag(model.M)))
        R = R - free @ (free_rate @ (model.M @ R)) - resisted @ (resisted_rate @ (model.M @ R))
        rates, names = model.F[elastic], [f"{model.compliances[i]}_twist_rate" for i in elastic]
        numbers, on_R = model.parts_of_twists[elastic], np.array(model.twist_factor)
        on_R[damper], on_resisted[~damper] = product(model.F[damper], R), 0.0
    return Separation(
        rates=rates,
        rate_names=tuple(names),
        rate_parts=numbers,
        R=R,
        free=free,
        resisted=resisted,
        names=tuple(model.coordinates[i] for i in _unit_rows(springless)[chosen]),
        on_R=on_R,
        on_resisted=on_resisted,
        free_rate=free_rate,
        resisted_rate=resisted_rate,
        resistance=accelerated(model.M, resisted, on_resisted.T),
    )


def accelerated(M: np.ndarray, motions: np.ndarray, loads: np.ndarray) -> np.ndarray:
    """``(N^T M N)^-1 loads``, of loads on the motions N."""
    if not motions.shape[1]:
        return loads
    return scipy.linalg.cho_solve(scipy.linalg.cho_factor(motions.T @ M @ motions), loads)


def complement(springless: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Columns of the springless motions that complete the free ones, which they contain."""
    everyone = np.arange(springless.shape[1])
    if not free.shape[1]:
        return everyone
    shares = free[_unit_rows(springless)]
    _, _, order = scipy.linalg.qr(shares.T, mode="economic", pivoting=True)
    return np.setdiff1d(everyone, order[: free.shape[1]])


def _unit_rows(basis: np.ndarray) -> np.ndarray:
    """For each column of an eliminated basis the row of its own coordinate."""
    single = np.count_nonzero(basis, axis=1) == 1
    return np.array([np.flatnonzero(single & (column == 1.0))[0] for column in basis.T], dtype=int)


def one_twist(E: np.ndarray, springless: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(n, r) ndarray: one spring twists by 1, no other, and the heaviest coordinate of each rigid motion rests.

    Were another one at rest, the small motion of the heavy bodies would be a difference of large numbers.
    """
    moving, motion = moving_ones(springless, weight), np.zeros(E.T.shape)
    if len(moving):
        inverse = np.linalg.inv(E[:, moving])
        inverse[np.abs(inverse) <= CANCELLED * np.abs(inverse).max(axis=0)] = 0.0
        motion[moving] = inverse
    return motion


def moving_ones(springless: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Coordinates (indices) that are left if the heaviest one of each rigid motion rests."""
    # motions of nodes without inertia alone move none of the others
    own = _unit_rows(springless)
    heavy = weight[own] > 0.0
    resting = own[~heavy]
    if heavy.any():
        weighted = (springless[:, heavy] * weight[:, None]).T
        order = scipy.linalg.qr(weighted, mode="economic", pivoting=True)[2]
        resting = np.append(resting, order[: np.count_nonzero(heavy)])
    return np.setdiff1d(np.arange(len(weight)), resting)


def _one_moves(momentum: np.ndarray, moving: np.ndarray) -> np.ndarray:
    """(n, s) ndarray: one of the moving coordinates moves by 1, the others as momenta (rows) of 0 ask for."""
    n = momentum.shape[1]
    resting, motion = np.setdiff1d(np.arange(n), moving), np.zeros((n, len(moving)))
    motion[moving] = np.eye(len(moving))
    motion[resting] = -np.linalg.solve(momentum[:, resting], momentum[:, moving])
    return motion
