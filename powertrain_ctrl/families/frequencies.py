"""Natural frequencies, damping ratios and shapes of all variants at once."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..base.doors import called, checked
from ..base.records import Record, read_only
from ..base.units import to_hz
from ..driveline.collection import Driveline
from ..linear.modal import REPEATED, SPREAD, modes
from .chains import chain_frequencies, chain_of
from .failures import Failure
from .results import Family, OfFamily, Quantity
from .structure import Stack, one_by_one, parts_of
from .variants import Variants


@called
@dataclass(frozen=True, eq=False, repr=False)
class FamilyModes(OfFamily, Record):
    """Modes of all variants, ascending in frequency; rigid motions have exactly 0.0 Hz.

    Attributes
    ----------
    family : Family
    omega, frequency_hz : (n, modes) ndarray
        Undamped natural frequency [rad/s]; the same [Hz]. Variants with fewer modes have nan behind theirs.
    damping_ratio : (n, modes) ndarray
        As of `Modes`; nan for a rigid motion.
    errors : dict
        Number of a variant to the `Failure` for which it has nan.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> gears = pt.family(pt.examples.conventional(), {"gearbox.ratio": [6.0, 3.6, 2.2]})
    >>> gears.modes().frequency_hz[:, :3].round(2)
    array([[ 0.  ,  2.64, 21.09],
           [ 0.  ,  3.75, 21.24],
           [ 0.  ,  5.51, 21.6 ]])
    >>> gears.modes().worst("damping_ratio").variant
    0
    """

    family: Family
    omega: np.ndarray
    damping_ratio: np.ndarray
    errors: dict[int, Failure] = field(default_factory=dict)

    @property
    def frequency_hz(self) -> np.ndarray:
        """(n, modes) ndarray: undamped natural frequency [Hz]."""
        return to_hz(self.omega)

    @cached_property
    def shapes(self) -> np.ndarray:
        """(n, nodes, modes) ndarray: motion of each node, the largest of each mode 1, computed when first asked for."""
        return read_only(self.family._computed(shapes_of)[0]["shapes"])

    @checked
    def tracked(self) -> FamilyModes:
        """Modes in the order of the first variant, each followed from one variant to the next by its shape.

        Of two neighbours along the last axis of the family those are one mode whose shapes agree best by the modal
        assurance criterion, weighted with the inertia of the nodes (R. J. Allemang, Sound and Vibration 37 (2003) 14),
        on the whole; so frequencies may cross. Steps have to be small against what changes a shape.

        Returns
        -------
        FamilyModes
        """
        order = _tracked(self.shapes, self.family)
        take = np.take_along_axis
        result = FamilyModes(self.family, take(self.omega, order, 1), take(self.damping_ratio, order, 1), self.errors)
        vars(result)["shapes"] = read_only(take(self.shapes, order[:, None, :], 2))
        return result

    def quantities(self) -> dict[str, Quantity]:
        """By name, what the result holds of each variant."""
        return {
            "frequency_hz": Quantity(self.frequency_hz, "Hz", ("mode",)),
            "damping_ratio": Quantity(self.damping_ratio, "", ("mode",)),
        }

    def _coordinates(self) -> dict[str, Any]:
        return {"mode": np.arange(self.omega.shape[1])}


def modes_of(variants: Variants) -> dict[str, np.ndarray]:
    """``omega`` and ``damping_ratio`` (n, modes) of some variants."""
    found = []
    for places, part, stack in parts_of(variants):
        if stack is None:
            found.append((places, *_one_by_one(part)))
            continue
        omega, zeta, is_sure = _modes(stack)
        found.append((places[is_sure], omega[is_sure], zeta[is_sure]))
        if not is_sure.all():
            found.append((places[~is_sure], *_one_by_one(part.part(~is_sure))))
    return {"omega": gathered(found, 1, len(variants)), "damping_ratio": gathered(found, 2, len(variants))}


def omega_of(variants: Variants) -> dict[str, np.ndarray]:
    """``omega`` (n, modes) alone, which takes half the time."""
    found = []
    for places, part, stack in parts_of(variants):
        if stack is None:
            found.append((places, _one_by_one(part)[0]))
            continue
        chain = chain_of(stack)
        omega, is_sure = _values(stack) if chain is None else chain_frequencies(stack, chain)
        found.append((places[is_sure], omega[is_sure]))
        if not is_sure.all():
            found.append((places[~is_sure], _one_by_one(part.part(~is_sure))[0]))
    return {"omega": gathered(found, 1, len(variants))}


def _values(stack: Stack) -> tuple[np.ndarray, np.ndarray]:
    return _ascending(stack, np.linalg.svd(_stiffest_first(stack)[0], compute_uv=False))


def shapes_of(variants: Variants) -> dict[str, np.ndarray]:
    """``shapes`` (n, nodes, modes) of some variants."""
    found = []
    for places, part, stack in parts_of(variants):
        if stack is None or stack.free.independent != stack.springless.independent:
            found.append((places, np.array(one_by_one(part, _shapes_of_one))))
            continue
        shapes, is_sure = _shapes(stack)
        found.append((places[is_sure], shapes[is_sure]))
        if not is_sure.all():
            found.append((places[~is_sure], np.array(one_by_one(part.part(~is_sure), _shapes_of_one))))
    return {"shapes": gathered(found, 1, len(variants))}


def gathered(found: list[tuple], what: int, count: int) -> np.ndarray:
    """(count, ...) of what was found of variants at their places; fewer values than others have nan behind them."""
    if len(found) == 1 and len(found[0][0]) == count:
        return found[0][what]
    last = max(each[what].shape[-1] for each in found)
    first = found[0][what]
    array = np.full((count, *first.shape[1:-1], last), np.nan, dtype=first.dtype)
    for each in found:
        array[each[0], ..., : each[what].shape[-1]] = each[what]
    return array


def _one_by_one(variants: Variants) -> tuple[np.ndarray, np.ndarray]:
    results = one_by_one(variants, modes)
    return np.array([result.omega for result in results]), np.array([result.damping_ratio for result in results])


def _stiffest_first(stack: Stack) -> tuple[np.ndarray, np.ndarray | None]:
    """`sorted_factor`, the rows of each variant by size, and their order if it is another than that of the springs.

    With the largest rows first small singular values of badly scaled rows keep their digits.
    """
    B = stack.every(stack.sorted_factor)
    size = np.einsum("vij,vij->vi", B, B)
    unsorted = np.flatnonzero((size[:, 1:] > size[:, :-1]).any(axis=1))
    if not unsorted.size:
        return B, None
    order = np.tile(np.arange(B.shape[1]), (len(B), 1))
    order[unsorted] = np.argsort(-size[unsorted], axis=1, kind="stable")
    B = np.array(B)
    B[unsorted] = np.take_along_axis(B[unsorted], order[unsorted, :, None], 1)
    return B, order


def _ascending(stack: Stack, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """omega (n, modes) from singular values, and of which variants they are accurate."""
    elastic = values[:, : len(stack.coordinates) - stack.n_rigid][:, ::-1]
    omega = np.concatenate([np.zeros((len(elastic), stack.n_rigid)), elastic], axis=1)
    is_sure = np.ones(len(omega), dtype=bool) if not elastic.size else elastic[:, -1] < SPREAD * elastic[:, 0]
    return omega, is_sure


def _modes(stack: Stack) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """omega, damping ratios (n, modes), and which variants are accurate and have no repeated frequency."""
    B, order = _stiffest_first(stack)
    U, values, Vt = np.linalg.svd(B, full_matrices=False)
    omega, is_sure = _ascending(stack, values)
    zeta = np.full(omega.shape, np.nan)
    elastic = omega[:, stack.n_rigid :]
    count = elastic.shape[1]
    power = np.zeros((len(omega), count))
    springs = [c for c in stack.damped if c in stack.elastic]
    if springs:
        # of a spring the twist is u omega / sqrt(k)
        share = np.zeros((len(omega), len(stack.elastic)))
        for c in springs:
            row = stack.compliances[c]
            share[:, stack.springs.index(c)] = row.damping / row.stiffness
        if order is not None:
            share = np.take_along_axis(share, order, 1)
        power = (share[:, :, None] * U[:, :, :count][:, :, ::-1] ** 2).sum(axis=1) * elastic**2
    alone = [i for i, c in enumerate(stack.damped) if c not in stack.elastic]
    if alone:
        rate = stack.every(stack.dampers[:, alone]) @ np.swapaxes(Vt[:, :count], 1, 2)[:, :, ::-1]
        power = power + (rate**2).sum(axis=1)
    zeta[:, stack.n_rigid :] = power / (2.0 * elastic)
    if stack.has_loss:
        # a share u^2 of the strain energy is in each spring
        loss = np.zeros((len(omega), len(stack.springs)))
        for i, c in enumerate(stack.springs):
            loss[:, i] = stack.compliances[c].loss_factor
        loss = loss if order is None else np.take_along_axis(loss, order, 1)
        zeta[:, stack.n_rigid :] += 0.5 * (loss[:, :, None] * U[:, :, :count][:, :, ::-1] ** 2).sum(axis=1)
    return omega, zeta, is_sure & ~_has_repeated(elastic)


def _has_repeated(elastic: np.ndarray) -> np.ndarray:
    return np.any(np.diff(elastic, axis=1) <= REPEATED * elastic[:, 1:], axis=1)


def _shapes_of_one(car: Driveline) -> np.ndarray:
    return modes(car).shapes


def _shapes(stack: Stack) -> tuple[np.ndarray, np.ndarray]:
    """Shapes (n, nodes, modes), and of which variants they are accurate and determined."""
    _, values, Vt = np.linalg.svd(_stiffest_first(stack)[0], full_matrices=False)
    omega, is_sure = _ascending(stack, values)
    n, rigid = len(stack.coordinates), stack.n_rigid
    place = {name: j for j, name in enumerate(stack.springless.independent)}
    motions = stack.filled(
        (n, rigid),
        [
            ((i, place[name]), value)
            for i, coordinate in enumerate(stack.coordinates)
            for name, value in stack.springless.expressions[coordinate].items()
        ],
    )
    if rigid > 1:  # as `modes` chooses among them: at right angles
        scaled = stack.every(stack.lifted(motions))
        motions = stack.lowered(np.linalg.qr(scaled / np.linalg.norm(scaled, axis=1, keepdims=True))[0])
    elastic = stack.lowered(np.swapaxes(Vt[:, : n - rigid], 1, 2)[:, :, ::-1])
    Phi = np.concatenate([stack.every(motions), elastic], axis=2)
    motion = np.zeros((stack.count, len(stack.nodes), n))
    for i, node in enumerate(stack.nodes):
        for name, value in stack.motion[node].items():
            motion[:, i] += stack.column(value)[:, None] * Phi[:, stack.coordinates.index(name)]
    size = np.abs(motion)
    largest = size.max(axis=1, keepdims=True)
    first = (size >= largest * (1.0 - REPEATED)).argmax(axis=1)[:, None]
    shapes = motion / np.copysign(largest, np.take_along_axis(motion, first, 1))
    return shapes, is_sure & ~_has_repeated(omega[:, rigid:])


def _tracked(shapes: np.ndarray, family: Family) -> np.ndarray:
    """(n, modes) ndarray of int: for each variant its modes in the order of those of the first variant."""
    from scipy.optimize import linear_sum_assignment

    inertia = dict.fromkeys(family.nominal.nodes, 0.0)
    for element in family.nominal:
        for row in element.inertias:
            for i, node in enumerate(row.nodes):
                inertia[node] += row.matrix[i][i]
    weighted = shapes * np.sqrt(np.array(list(inertia.values())))[:, None]
    weighted = weighted / np.linalg.norm(weighted, axis=1, keepdims=True)
    last = family.shape[-1]
    order = np.tile(np.arange(shapes.shape[2]), (len(shapes), 1))
    for i in range(1, len(shapes)):
        before = i - 1 if i % last else i - last
        if np.isnan(weighted[i]).all():  # without shapes it stands for its neighbour
            weighted[i], order[i] = weighted[before], order[before]
        agreement = np.abs(weighted[before][:, order[before]].T @ weighted[i]) ** 2
        order[i] = linear_sum_assignment(-np.nan_to_num(agreement))[1]
    return order
