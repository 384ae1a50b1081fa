"""The slowest modes of long drivelines, from sparse rows: time and memory grow with the number of inertias alone.

Lanczos iteration on the inverse of the stiffness, shifted so little below zero that rigid motions have one
(``scipy.sparse.linalg.eigsh``), then the frequency of each shape from its twists, ``omega^2 = sum(k twist^2)`` at unit
kinetic energy, which forms no difference of large numbers. Ten modes of 10 000 inertias take some 50 MiB, of 100 000 ten
times that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sparse
from scipy.sparse.csgraph import breadth_first_order

from ..driveline.kinematics import eliminate
from .solved import SolvedRows

# The shift below zero, as a part of the smallest stiffness over inertia that n equal bodies in a row could have.
SHIFT = 1e-3


class Lowest(NamedTuple):
    """Angular frequencies (modes,) ascending, their shapes (n, modes) at unit kinetic energy, and sparse matrices.

    Motion of nodes T and twist of compliances F from the coordinates, inertia J of the nodes.
    """

    omega: np.ndarray
    Phi: np.ndarray
    n_rigid: int
    T: sparse.csr_array
    F: sparse.csr_array
    J: sparse.csr_array


def lowest(rows: SolvedRows, count: int) -> Lowest:
    """The ``count`` slowest modes, rigid motions among them.

    Parameters
    ----------
    rows : SolvedRows
        Of one driveline, with more coordinates than modes wanted.
    count : int

    Returns
    -------
    Lowest
    """
    from scipy.sparse.linalg import eigsh

    n, place = len(rows.coordinates), rows.place
    F = _matrix(rows.twists, place)
    T = _matrix([rows.motion[node] for node in rows.nodes], place)
    M = _symmetric(n, rows.mass)
    J = _inertia(rows)
    k = np.array([row.stiffness for row in rows.compliances])
    rigid = _rigid(rows, F)
    n_rigid = rigid.shape[1]
    scale = sparse.diags_array(1.0 / np.sqrt(M.diagonal()))
    K, mass = (sparse.csc_array(scale @ matrix @ scale) for matrix in (F.T @ sparse.diags_array(k) @ F, M))
    shift = -SHIFT * abs(K).sum(axis=0).max() / n**2
    # no random start: the same numbers each time
    start = np.random.default_rng(0).standard_normal(n)
    _, found = eigsh(K, k=count, M=None if rows.is_diagonal else mass, sigma=shift, which="LM", v0=start)
    Phi = scale @ found
    if n_rigid:
        rigid = rigid @ np.linalg.inv(np.linalg.cholesky(rigid.T @ (M @ rigid))).T
        Phi = Phi - rigid @ (rigid.T @ (M @ Phi))
    size = np.sqrt(np.einsum("nm,nm->m", Phi, M @ Phi))
    twist = F @ Phi
    omega = np.sqrt(k @ twist**2) / np.where(size == 0.0, 1.0, size)
    # what was rigid has lost all of itself
    order = np.argsort(np.where(size < 0.5, -1.0, omega))[n_rigid:]
    return Lowest(
        omega=np.concatenate([np.zeros(n_rigid), omega[order]])[:count],
        Phi=np.hstack([rigid, (Phi / np.where(size == 0.0, 1.0, size))[:, order]])[:, :count],
        n_rigid=min(n_rigid, count),
        T=T,
        F=F,
        J=J,
    )


def _rigid(rows: SolvedRows, F: sparse.csr_array) -> np.ndarray:
    """(n, motions) ndarray: motions that twist no spring, springs taken from the first body on outwards."""
    elastic = F[rows.elastic]
    linked = sparse.csr_array(abs(elastic).T @ abs(elastic))
    reached = np.full(len(rows.coordinates), -1)
    count = 0
    for first in range(len(reached)):
        if reached[first] < 0:
            part = breadth_first_order(linked, first, directed=False, return_predecessors=False)
            reached[part] = np.arange(count, count + len(part))
            count += len(part)
    furthest = [max((reached[rows.place[name]] for name in rows.twists[c]), default=0) for c in rows.elastic]
    outwards = [rows.twists[rows.elastic[i]] for i in np.argsort(furthest, kind="stable")]
    columns = [rows.coordinates[i] for i in np.argsort(reached)]
    motions = eliminate(outwards, columns)
    places = {name: j for j, name in enumerate(motions.independent)}
    basis = np.zeros((len(columns), len(places)))
    for name, i in rows.place.items():
        for other, value in motions.expressions[name].items():
            basis[i, places[other]] = value
    return basis


def _matrix(rows: Sequence[Mapping[str, float]], place: Mapping[str, int]) -> sparse.csr_array:
    i = [c for c, row in enumerate(rows) for _ in row]
    j = [place[name] for row in rows for name in row]
    values = [value for row in rows for value in row.values()]
    return sparse.csr_array((values, (i, j)), shape=(len(rows), len(place)), dtype=float)


def _symmetric(n: int, entries: Mapping[tuple[int, int], float]) -> sparse.csr_array:
    both = {**entries, **{(j, i): value for (i, j), value in entries.items()}}
    i, j = zip(*both, strict=True)
    return sparse.csr_array((list(both.values()), (i, j)), shape=(n, n), dtype=float)


def _inertia(rows: SolvedRows) -> sparse.csr_array:
    place = {node: i for i, node in enumerate(rows.nodes)}
    entries: list[Any] = [
        (value, place[a], place[b])
        for row in rows.inertias
        for a, line in zip(row.nodes, row.matrix, strict=True)
        for b, value in zip(row.nodes, line, strict=True)
    ]
    values, i, j = zip(*entries, strict=True)
    return sparse.csr_array((values, (i, j)), shape=(len(place), len(place)), dtype=float)
