"""What a driveline must not be to become matrices: without inertia, at standstill, with loss factors in time."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.linalg

from ..base.errors import PowertrainError, TopologyError
from ..elements import ConstraintRow, Law


def require_inertia(M: np.ndarray, coordinates: Sequence[str]) -> None:
    diagonal = np.diag(M)
    if (diagonal > 0.0).all():
        scale = 1.0 / np.sqrt(diagonal)
        smallest, shapes = np.ones(1), np.eye(1)
        if np.count_nonzero(M) > len(diagonal):
            smallest, shapes = scipy.linalg.eigh(scale[:, None] * M * scale, subset_by_index=[0, 0])
        if smallest[0] > 1e-13:
            return
        culprit = int(np.abs(shapes[:, 0]).argmax())
    else:
        culprit = int(diagonal.argmin())
    raise TopologyError(
        f'node "{coordinates[culprit]}" has no inertia', "give it an Inertia or merge the springs on either side"
    )


def require_no_loss(compliances: Sequence[str], loss_factor: np.ndarray) -> None:
    for name, loss in zip(compliances, loss_factor, strict=True):
        if loss:
            raise PowertrainError(
                f"{name}: loss_factor = {loss:g}, permitted here: 0, for it means something at one frequency only; take the "
                f'damping that is the same at omega, car.replace("{name}", loss_factor=0, '
                "damping=loss_factor * stiffness / omega)"
            )


def standstill(constraints: Sequence[ConstraintRow | Law], index: int) -> TopologyError:
    culprit = constraints[index]
    involved = {culprit.name: culprit}
    nodes = set(culprit.coefficients)
    for _ in constraints:
        for row in constraints[:index]:
            if nodes & set(row.coefficients):
                involved[row.name] = row
                nodes |= set(row.coefficients)
    others = ", ".join(sorted(set(involved) - {culprit.name})) or "itself"
    return TopologyError(
        f"{culprit.name} holds {', '.join(culprit.coefficients)} at standstill together with {others}",
        "release a clutch or correct a ratio",
    )
