"""Nodes without inertia: their motion follows from the springs and dampers that hold them.

With ``omega = T z`` the loads on a coordinate without inertia balance at any moment. Directions in which only springs act
are *condensed*: their place is that of least elastic energy, twists there follow loads at once. In the others a damper
acts, whose balance gives a speed: ``omega = T v + U U^T (load - E^T torque of the springs)``, and twists become first-order
states.

Springs left with fewer twists are computed from the torques that hold the node in balance, whose flexibilities add up, and
not as a difference of motions: of two springs in series each carries the same torque, however stiff one of them is.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

from ..base.errors import TopologyError
from ..base.records import Record
from ..driveline.kinematics import CANCELLED, Elimination, eliminate, product


@dataclass(frozen=True, eq=False, repr=False)
class Following(Record):
    """How nodes follow n coordinates with inertia and m without, p of them by creeping.

    Attributes
    ----------
    names : tuple of str
        The coordinates without inertia.
    kinematics : (nodes, n + m) ndarray
        Node motion from all coordinates, before any of them follows others.
    T, F : (nodes, n), (compliances, n) ndarray
        Motion of every node and twist of every compliance, from the coordinates with inertia.
    twists, twist_shape : (compliances, n + p) ndarray
        F with the creeping directions still free, the twists that there can be; rows with the same null space, for which
        no stiffness is needed.
    motions : (nodes, n + p) ndarray
        T with the creeping directions still free.
    U, creep : (nodes, p), (compliances, p) ndarray
        Speed of nodes and twist rate of compliances under loads: mobilities are ``U U^T``, ``creep U^T``.
    V, bend : (nodes, m - p), (compliances, m - p) ndarray
        Motion of nodes and twist of springs that follow loads at once: flexibilities are ``V V^T``, ``bend V^T``.
    """

    names: tuple[str, ...]
    kinematics: np.ndarray
    T: np.ndarray
    F: np.ndarray
    twists: np.ndarray
    twist_shape: np.ndarray
    motions: np.ndarray
    U: np.ndarray
    creep: np.ndarray
    V: np.ndarray
    bend: np.ndarray

    def untwisted(self, rows: np.ndarray) -> np.ndarray:
        """(n + p, motions) ndarray: motions, creeping directions free, that twist none of these compliances (indices)."""
        columns = [str(j) for j in range(self.twist_shape.shape[1])]
        return _eliminated(self.twist_shape[rows], columns).basis(columns)


class Combination(NamedTuple):
    """What the independent twists, the coordinate speeds and the loads on the nodes add up to."""

    on_twist: np.ndarray
    on_speed: np.ndarray
    on_load: np.ndarray


class _Rows(NamedTuple):
    """Motion of nodes, twist of compliances and its shape, from some coordinates."""

    T: np.ndarray
    F: np.ndarray
    shape: np.ndarray


def follow(
    coordinates: tuple[str, ...],
    kinematics: np.ndarray,
    E: np.ndarray,
    heavy: np.ndarray,
    stiffness: np.ndarray,
    damping: np.ndarray,
    undamped: bool = False,
) -> Following:
    """Coordinates without inertia as they follow the others.

    Parameters
    ----------
    coordinates : tuple of str
        n + m names, those with inertia first.
    kinematics : (nodes, n + m) ndarray
        Node motion from coordinate motion.
    E : (compliances, nodes) ndarray
        Twists from node motion.
    heavy : (nodes,) ndarray of bool
        Nodes with inertia of their own.
    stiffness, damping : (compliances,) ndarray
        k [N m/rad], d [N m s/rad].
    undamped : bool
        As dampers fade: springs decide wherever they act.

    Returns
    -------
    Following

    Raises
    ------
    TopologyError
        A coordinate without inertia that neither springs nor dampers hold.

    Examples
    --------
    Springs of 1 and 3 N m/rad in series: a quarter of the twist is in the stiff one.

    >>> E = np.array([[1.0, 0.0, -1.0], [0.0, -1.0, 1.0]])
    >>> heavy = np.array([True, True, False])
    >>> follow(("a", "b", "flange"), np.eye(3), E, heavy, np.array([1.0, 3.0]), np.zeros(2)).F
    array([[ 0.75, -0.75],
           [ 0.25, -0.25]])
    """
    F = product(E, kinematics)
    n = 1 + int(np.flatnonzero(kinematics[heavy].any(axis=0)).max(initial=-1))
    names = coordinates[n:]
    if not names:
        none = np.zeros((len(kinematics), 0)), np.zeros((len(F), 0))
        return Following(names, kinematics, kinematics, F, F, F, kinematics, *none, *none)
    light = F[:, n:]
    _require_hold(light, names)
    # directions that only the first ones hold follow these, the rest the others
    first, others = (damping, stiffness) if undamped else (stiffness, damping)
    alone = _eliminated(light[others > 0.0], names)
    N = alone.basis(names)
    rest = np.eye(len(names))[:, [j for j, name in enumerate(names) if name not in alone.independent]]
    T, F = np.hstack([kinematics[:, :n], kinematics[:, n:] @ rest]), np.hstack([F[:, :n], light @ rest])
    moved = _Rows(product(kinematics[:, n:], N), *2 * [product(light, N)])
    free, at_once = _following(_Rows(T, F, F), moved, first, not undamped)
    kept, creeping = (_Rows(*(array[:, part] for array in free)) for part in (slice(n), slice(n, None)))
    settled, mobile = _following(kept, creeping, others, undamped)
    twists = settled if undamped else free
    return Following(
        names=names,
        kinematics=kinematics,
        T=settled.T,
        F=settled.F,
        twists=twists.F,
        twist_shape=twists.shape,
        motions=twists.T,
        U=creeping.T @ mobile,
        creep=creeping.F @ mobile,
        V=moved.T @ at_once,
        bend=moved.F @ at_once,
    )


def _following(kept: _Rows, moved: _Rows, weight: np.ndarray, elastic: bool) -> tuple[_Rows, np.ndarray]:
    """Directions follow the kept ones such that the sum of weight times squared twist is least.

    With ``elastic`` the weights are those of all springs, so that the shape of their rows needs no stiffness. Directions
    that share no such row are told apart, so that what does not depend on each other has exact zeros. Behind the rows a
    factor R of what loads on the directions do to them, ``R R^T``.
    """
    n, m = kept.T.shape[1], moved.T.shape[1]
    weighted = np.flatnonzero(moved.F.any(axis=1) & (weight > 0.0))
    share, factor = np.zeros((m, n)), np.zeros((m, m))
    blocks = []
    for directions, inside in _blocks(moved.F[weighted]):
        rows = weighted[inside]
        seen = np.flatnonzero(kept.F[rows].any(axis=0))
        leading, root = moved.F[np.ix_(rows, directions)], np.sqrt(weight[rows])[:, None]
        given = kept.F[np.ix_(rows, seen)]
        Q, R, pivots = _graded_qr(root * leading)
        share[np.ix_(directions[pivots], seen)] = -scipy.linalg.solve_triangular(R, Q.T @ (root * given))
        factor[np.ix_(directions[pivots], directions)] = scipy.linalg.solve_triangular(R, np.eye(len(R)))
        blocks.append((rows, seen, *_balanced(leading, given, root)))
    together = np.vstack([np.eye(n), share])
    T, F, shape = (product(np.hstack([a, b]), together) for a, b in zip(kept, moved, strict=True))
    for rows, seen, twists, independent, across in blocks:
        F[rows] = shape[rows] = 0.0
        F[np.ix_(rows, seen)] = twists
        if elastic:
            shape[np.ix_(rows[independent], seen)] = across
        else:
            shape[rows] = F[rows]
    return _Rows(T, F, shape), factor


def _blocks(F: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Columns that rows link with each other, and these rows; indices."""
    touched = (F != 0.0).astype(float)
    parts = connected_components(touched.T @ touched, directed=False)[1]
    columns = [np.flatnonzero(parts == part) for part in range(parts.max(initial=-1) + 1)]
    return [(own, np.flatnonzero(F[:, own].any(axis=1))) for own in columns]


def _balanced(moved: np.ndarray, given: np.ndarray, root: np.ndarray) -> tuple[np.ndarray, list[int], np.ndarray]:
    """Twists of rows by the torques in them that leave the moved directions in balance; rows and values of their shape."""
    labels = [str(row) for row in range(len(moved))]
    balance = _eliminated(moved.T, labels)
    Z = balance.basis(labels)
    across, twists = product(Z.T, given), np.zeros_like(given)
    if Z.shape[1]:
        Q, flexible, order = _graded_qr(Z / root)
        twists = Q @ scipy.linalg.solve_triangular(flexible, across[order], trans="T") / root
    return twists, [int(label) for label in balance.independent], across


def _graded_qr(matrix: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """QR with pivots of a matrix whose rows differ in size: large ones first keeps small ones accurate (Cox, Higham)."""
    order = np.argsort(-np.linalg.norm(matrix, axis=1), kind="stable")
    Q, R, pivots = scipy.linalg.qr(matrix[order], mode="economic", pivoting=True)
    sorted_back = np.empty_like(Q)
    sorted_back[order] = Q
    return sorted_back, R, pivots


def _eliminated(rows: np.ndarray, names: list[str] | tuple[str, ...]) -> Elimination:
    return eliminate([{names[j]: row[j] for j in np.flatnonzero(row)} for row in rows], names)


def _require_hold(light: np.ndarray, names: tuple[str, ...]) -> None:
    loose = _eliminated(light, names).independent
    if loose:
        raise TopologyError(
            f'node "{loose[0]}" has no inertia; give it an Inertia or merge the springs on either side (a Compliance with '
            "the ratio between them, a Differential with a spring on each side): nothing says how it moves"
        )


def independent_twists(following: Following, springs: np.ndarray) -> np.ndarray:
    """Those of the springs (indices) whose twists are independent of those before."""
    shape, twists = following.twist_shape[springs], following.twists[springs]
    columns = [str(j) for j in range(shape.shape[1])]
    used = _eliminated(shape, columns).used_rows
    if len(used) < np.count_nonzero(shape.any(axis=1)) and len(used) < np.count_nonzero(twists.any(axis=1)):
        # in loops the rows may have another shape than the twists: as many, chosen by size
        sizes = np.linalg.norm(twists, axis=1, keepdims=True)
        order = scipy.linalg.qr((twists / np.where(sizes == 0.0, 1.0, sizes)).T, mode="r", pivoting=True)[1]
        used = sorted(order[: len(used)])
    return np.asarray(springs, dtype=int)[used]


def untwisting(following: Following, springs: np.ndarray, damping: np.ndarray) -> np.ndarray:
    """(n, motions) ndarray: coordinate speeds at which none of the springs (indices) twists, creeping nodes going along.

    No stiffness decides that, and of the dampers only whether what they do to the creeping nodes cancels.
    """
    n, columns = following.T.shape[1], [str(j) for j in range(following.twists.shape[1])]
    still = _eliminated(following.twist_shape[springs], columns)
    motions = still.basis(columns)
    loads = product(following.twists[:, n:].T * damping, product(following.twists, motions))
    balanced = _eliminated(loads, still.independent)
    return product(motions, balanced.basis(still.independent))[:n]


def shares_of(twists: np.ndarray, chosen: np.ndarray, others: np.ndarray) -> np.ndarray:
    """(others, chosen) ndarray: rows of the twists as combinations of chosen ones."""
    if not len(chosen):
        return np.zeros((len(others), 0))
    size = np.linalg.norm(twists[chosen], axis=1)
    scaled = np.linalg.lstsq((twists[chosen] / size[:, None]).T, twists[others].T, rcond=None)[0].T
    scaled[np.abs(scaled) <= CANCELLED * np.abs(scaled).max(axis=1, keepdims=True)] = 0.0
    return scaled / size
