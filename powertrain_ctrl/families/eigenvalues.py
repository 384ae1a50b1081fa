"""Damped poles of all variants at once."""

from __future__ import annotations

import numpy as np

from ..driveline.collection import Driveline
from ..linear.quadratic import EQUALLY_FAST
from ..linear.spectrum import poles
from .frequencies import gathered
from .structure import Stack, one_by_one, parts_of
from .variants import Variants

# Variants with a pole smaller than this part of their largest one are computed one by one, where small ones are corrected.
SMALL = 1e-4


def poles_of(variants: Variants) -> dict[str, np.ndarray]:
    """``poles`` (n, k) of some variants, as `poles` orders them."""
    found = []
    for places, part, stack in parts_of(variants):
        if stack is None or stack.has_loss or not (stack.damped and has_energy_form(stack)):
            found.append((places, np.array(one_by_one(part, _poles))))
            continue
        values, is_sure = _moving_poles(stack)
        found.append((places[is_sure], values[is_sure]))
        if not is_sure.all():
            found.append((places[~is_sure], np.array(one_by_one(part.part(~is_sure), _poles))))
    return {"poles": gathered(found, 1, len(variants))}


def _poles(car: Driveline) -> np.ndarray:
    return poles(car)


def _moving_poles(stack: Stack) -> tuple[np.ndarray, np.ndarray]:
    """Poles in order, and of which variants they are accurate."""
    free = len(stack.free.independent)
    found = np.linalg.eigvals(energy_matrix(stack))
    size = np.abs(found)
    is_sure = size.min(axis=1, initial=np.inf) > SMALL * size.max(axis=1, initial=0.0)
    found = found.astype(complex)
    # no damper drives a mode
    found.real = np.minimum(found.real, 0.0)
    found = np.concatenate([np.zeros((len(found), free), dtype=complex), found], axis=1)
    return np.take_along_axis(found, _by_magnitude(found), 1), is_sure


def has_energy_form(stack: Stack) -> bool:
    """Whether `energy_matrix` has no more states than there are: springs in loops only where dampers alone hold nothing."""
    rank = len(stack.coordinates) - stack.n_rigid
    return len(stack.elastic) == rank or len(stack.free.independent) == stack.n_rigid


def energy_matrix(stack: Stack) -> np.ndarray:
    """(n, states, states) ndarray A of ``x' = A x`` in energy coordinates, without the motions that nothing resists.

    The states are ``sqrt(k) twist`` of the independent springs and speeds at right angles to the free motions, so that
    ``A + A^T <= 0``.
    """
    H, C = spring_and_damper_factors(stack)
    r, n = H.shape[1:]
    A = np.zeros((stack.count, r + n, r + n))
    A[:, :r, r:] = H
    A[:, r:, :r] = -np.swapaxes(H, 1, 2)
    A[:, r:, r:] = -(np.swapaxes(C, 1, 2) @ C)
    return A


def spring_and_damper_factors(stack: Stack) -> tuple[np.ndarray, np.ndarray]:
    """(n, springs, speeds) and (n, dampers, speeds) ndarrays in speeds at right angles to the free motions."""
    H, C = stack.every(stack.factor), stack.every(stack.dampers)
    across = complement(stack)
    if across is not None:
        H, C = H @ across, C @ across
    rank = len(stack.coordinates) - stack.n_rigid
    if H.shape[1] > rank:  # springs in loops: as many rows as twists are independent
        H = np.asarray(np.linalg.qr(H, mode="r"))[:, :rank]
    return H, C


def complement(stack: Stack) -> np.ndarray | None:
    """(n, coordinates, speeds) ndarray: orthonormal mass-scaled motions at right angles to the free ones; None for all."""
    free = len(stack.free.independent)
    if not free:
        return None
    n = len(stack.coordinates)
    place = {name: j for j, name in enumerate(stack.free.independent)}
    entries = [
        ((i, place[name]), value)
        for i, coordinate in enumerate(stack.coordinates)
        for name, value in stack.free.expressions[coordinate].items()
    ]
    return np.linalg.qr(stack.every(stack.lifted(stack.filled((n, free), entries))), mode="complete")[0][:, :, free:]


def _by_magnitude(poles: np.ndarray) -> np.ndarray:
    """`by_magnitude` of each row."""
    rising = np.argsort(np.abs(poles), axis=1, kind="stable")
    sorted_poles = np.take_along_axis(poles, rising, 1)
    speed = np.abs(sorted_poles)
    group = np.cumsum(np.diff(speed, axis=1, prepend=speed[:, :1]) > EQUALLY_FAST * speed, axis=1)
    return np.take_along_axis(rising, np.lexsort((sorted_poles.imag, group), axis=1), 1)
