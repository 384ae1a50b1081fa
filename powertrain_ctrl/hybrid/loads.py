"""Torques of constraints, of which laws take their share: what a gear carries that does not do so without loss."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base.errors import TopologyError
from ..elements import Law
from ..linear.assembly import TorsionalModel

# A motion that leaves other constraints by less than this part leaves its own one alone.
ALONE = 1e-9


class Loads(NamedTuple):
    """Loads of some laws, ``mu = on_x x + on_u u + on_tau tau`` with the torques tau of all laws; ``own`` are theirs."""

    on_x: np.ndarray
    on_u: np.ndarray
    on_tau: np.ndarray
    own: list[int]

    def under(self, share: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same while these laws take these shares of their loads, tau being what all take besides.

        Examples
        --------
        Half of the load again, which is itself loaded by that:

        >>> loads = Loads(np.array([[3.0]]), np.array([[6.0]]), np.array([[-1.0]]), own=[0])
        >>> [rows.tolist() for rows in loads.under(np.array([0.5]))]
        [[[2.0]], [[4.0]], [[-0.6666666666666666]]]
        """
        back = np.linalg.inv(np.eye(len(share)) - self.on_tau[:, self.own] * share)
        return back @ self.on_x, back @ self.on_u, back @ self.on_tau


def virtual_motions(model: TorsionalModel, laws: Sequence[Law], moved: np.ndarray) -> np.ndarray:
    """(laws, nodes) ndarray: motions that each leave one constraint alone, by 1: that which loads the law.

    By d'Alembert's principle its torque is the work on this motion, ``mu = motion . (f - J omega')`` with all forces f.
    Nodes that are ``moved`` (rows) do not take part.

    Raises
    ------
    TopologyError
        A constraint that others hold too, or springs and dampers on it whose other node has no inertia.
    """
    rows = np.vstack([_rows(model), model.S[model.locked]])
    light = model.following.U.any(axis=1) | model.following.V.any(axis=1)
    motions = []
    for law in laws:
        wanted = np.zeros(len(rows))
        wanted[model.constraints.index(law.load or {})] = 1.0
        motion = np.linalg.lstsq(rows, wanted, rcond=None)[0]
        if np.abs(rows @ motion - wanted).max() > ALONE:
            raise TopologyError(
                f"{law.owner}: other gears or locked clutches hold what it holds, so that nothing says what each of them "
                "carries; give it the efficiency 1"
            )
        if len(moved):
            motion = motion - model.T @ np.linalg.lstsq(moved @ model.T, moved @ motion, rcond=None)[0]
        touched = (abs(model.E @ motion) > ALONE) @ (model.E != 0.0)
        if (touched & light).any():
            node = model.nodes[int((touched & light).argmax())]
            raise TopologyError(
                f'node "{node}" has no inertia and {law.owner}, which has losses, is beside it; give it an Inertia'
            )
        motions.append(motion)
    return np.array(motions)


def _rows(model: TorsionalModel) -> np.ndarray:
    matrix = np.zeros((len(model.constraints), len(model.nodes)))
    for i, row in enumerate(model.constraints):
        for node, value in row.items():
            matrix[i, model.nodes.index(node)] = value
    return matrix
