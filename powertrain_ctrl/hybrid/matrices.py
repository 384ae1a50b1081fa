"""Matrices of a driveline in its modes: dynamics, what is held and what it takes, guards."""

from functools import reduce
from typing import NamedTuple

import numpy as np
import scipy.linalg

from .flow import Flow, connected

# Sums smaller than this part of the terms they consist of are zero.
ROUNDING = 64.0 * np.finfo(float).eps
# Slips of clutches that depend on each other do so to this part.
REDUNDANT = 1e-10


class Holding(NamedTuple):
    """What laws carry that hold their slips at zero together, ``tau = on_x x + on_u u + on_tau tau_given``.

    ``weight`` is the slip acceleration that a unit of torque too little gives each of them while the others hold.
    """

    on_x: np.ndarray
    on_u: np.ndarray
    on_tau: np.ndarray
    weight: np.ndarray


class Dynamics(NamedTuple):
    """``x' = A x + ...`` in modes of the same stiffnesses, and its flow ``w' = push A basis w``.

    ``x = basis w``, ``w = inverse x``; forces come to w by ``push``, which is ``inverse`` unless nodes are moved.
    """

    A: np.ndarray
    basis: np.ndarray
    inverse: np.ndarray
    push: np.ndarray
    flow: Flow


class Guards(NamedTuple):
    """Functionals ``g = on_x x + on_u u + on_tau tau + on_c c + level`` that must stay positive: of which laws, and what
    modes follow. ``on_forcing`` is (on_u, on_tau, on_c) beside each other; ``on_load`` are those of a load alone, at whose
    zero nothing jumps."""

    laws: list[int]
    then: list[int]
    on_x: np.ndarray
    on_u: np.ndarray
    on_tau: np.ndarray
    on_c: np.ndarray
    level: np.ndarray
    on_forcing: np.ndarray
    on_load: np.ndarray


class Losses(NamedTuple):
    """Powers that are lost: factor times the square of ``rows w + on_u u + on_tau tau_given``, and to which laws."""

    laws: list[int]
    factors: np.ndarray
    rows: np.ndarray
    on_u: np.ndarray
    on_tau: np.ndarray


class Watch(NamedTuple):
    """Guards along a trajectory: ``on_x x = rows v + sums w + start x0``.

    v are the coordinates of the trajectory, w their integrals; ``sums`` is None where no guard needs these. The weights are
    those with which the rows bound sizes (`Flow.weights`).
    """

    rows: np.ndarray
    sums: np.ndarray | None
    start: np.ndarray
    weights: np.ndarray
    sum_weights: np.ndarray


def without_rounding(*factors: np.ndarray) -> np.ndarray:
    """Product of matrices, exactly 0 where no more than rounding is left of its terms."""
    product, terms = reduce(np.matmul, factors), reduce(np.matmul, map(abs, factors))
    product[abs(product) <= ROUNDING * terms] = 0.0
    return product


def sum_without_rounding(*products: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Sum of products of two matrices each, exactly 0 where no more than rounding is left of its terms."""
    total, terms = sum(a @ b for a, b in products), sum(abs(a) @ abs(b) for a, b in products)
    return np.where(abs(total) <= ROUNDING * terms, 0.0, total)


def null_basis(held: np.ndarray) -> np.ndarray:
    """Orthonormal basis of the states on which these columns do nothing; what they do not connect does not mix."""
    touched = held != 0.0
    group = connected(touched.T @ touched)
    blocks = [np.eye(len(held))[:, ~touched.any(axis=1)]]
    for i in range(1 + group.max(initial=-1)):
        rows = np.flatnonzero(touched[:, group == i].any(axis=1))
        Q, R, _ = scipy.linalg.qr(held[np.ix_(rows, group == i)], pivoting=True)
        rank = np.count_nonzero(abs(np.diag(R)) > REDUNDANT * abs(R[0, 0]))
        block = np.zeros((len(held), len(rows) - rank))
        block[rows] = Q[:, rank:]
        blocks.append(block)
    return np.hstack(blocks)
