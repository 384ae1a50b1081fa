"""From elements to matrices: ``M z'' + D z' + K z = T^T B u`` with node speeds ``omega = T z'``.

Constraint rows are solved for the speeds, so M, D, K come out symmetric and semidefinite, and the factors
of a gear, ``J / R^2`` and ``k / R^2`` of equation (2.1), appear by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np
import scipy.linalg
from scipy.sparse.csgraph import connected_components

from ..base.doors import called, checked
from ..base.errors import PowertrainError, TopologyError
from ..base.records import Record, read_only
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.kinematics import Elimination, eliminate, product
from ..elements import ComplianceRow, ConstraintRow, Law

Found = TypeVar("Found")


def kept(size: int) -> Callable[[Callable[..., Found]], Callable[..., Found]]:
    """Decorator of a function of a car, or of a plant with one: what it found for the last ``size`` of them is kept.

    Cars never change and compare and hash by their values, so what is kept cannot be that of another one.
    """
    return lru_cache(maxsize=size)


@called
@dataclass(frozen=True, eq=False, repr=False)
class TorsionalModel(Record):
    """Matrices and names of a driveline with n coordinates; SI throughout.

    Attributes
    ----------
    nodes, coordinates : tuple of str
        All nodes; those whose motion is a coordinate.
    compliances : tuple of str
        Rows of E.
    inputs : tuple of str
        Columns of B: ``<inertia>_torque`` [N m], ``<mass>_force`` [N].
    laws : tuple of Law
        Rows of S, the clutches first, with ``name``, ``max_torque`` [N m] and ``static_ratio``.
    locked : (laws,) ndarray of bool
        Which of them, clutches, are taken as rigid.
    translating : frozenset of str
        Nodes that move along the road.
    T : (nodes, n) ndarray
        Node motion from coordinate motion.
    T_released : (nodes, n0) ndarray
        T if all clutches were open.
    E : (compliances, nodes) ndarray
        Twist of each compliance from node motion; ``K = (E T)^T diag(stiffness) (E T)``.
    B : (nodes, inputs) ndarray
        Torque [N m] or force [N] on each node from the inputs.
    S : (laws, nodes) ndarray
        Slip speed of each law from node speeds.
    J : (nodes, nodes) ndarray
        Inertia of the nodes before the constraints [kg m^2 or kg].
    stiffness, damping : (compliances,) ndarray
        k [N m/rad], d [N m s/rad].
    M, D, K : (n, n) ndarray
        Inertia, damping, stiffness in the coordinates; M positive definite, D and K semidefinite.

    Examples
    --------
    Behind a gear of 4 an axle of 1.6 kg m^2 adds a sixteenth of that at the engine, equation (2.1):

    >>> import powertrain_ctrl as pt
    >>> model = pt.assemble(
    ...     pt.Driveline(
    ...         pt.Inertia("engine", J=0.2), pt.Gear("gear", "engine", "axle", ratio=4.0), pt.Inertia("axle", J=1.6)
    ...     )
    ... )
    >>> model.coordinates, model.M.round(9), model.T[:, 0]
    (('engine',), array([[0.3]]), array([1.  , 0.25]))
    """

    nodes: tuple[str, ...]
    coordinates: tuple[str, ...]
    compliances: tuple[str, ...]
    inputs: tuple[str, ...]
    laws: tuple[Law, ...]
    locked: np.ndarray
    translating: frozenset[str]
    T: np.ndarray
    T_released: np.ndarray
    E: np.ndarray
    B: np.ndarray
    S: np.ndarray
    J: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray

    def __repr__(self) -> str:
        return (
            f"TorsionalModel: {len(self.nodes)} nodes, {len(self.coordinates)} coordinates, "
            f"{len(self.compliances)} compliances, {len(self.clutches)} clutches"
        )

    @property
    def clutches(self) -> tuple[Law, ...]:
        """Those of the laws that a capacity closes, the first rows of S."""
        return tuple(law for law in self.laws if law.is_clutch)

    @cached_property
    def F(self) -> np.ndarray:
        """(compliances, n) ndarray, twist from coordinates: ``E T``, exactly 0 where its terms cancel."""
        # a spring across rigidly geared parts must not twist by rounding
        return read_only(product(self.E, self.T))

    @cached_property
    def M(self) -> np.ndarray:
        """(n, n) ndarray, inertia in the coordinates: ``T^T J T``."""
        return read_only(_symmetric(self.T.T @ self.J @ self.T))

    @cached_property
    def D(self) -> np.ndarray:
        """(n, n) ndarray, damping in the coordinates: ``F^T diag(damping) F``."""
        return read_only(_symmetric(self.F.T @ (self.damping[:, None] * self.F)))

    @cached_property
    def K(self) -> np.ndarray:
        """(n, n) ndarray, stiffness in the coordinates: ``F^T diag(stiffness) F``; the source's is negative."""
        return read_only(_symmetric(self.F.T @ (self.stiffness[:, None] * self.F)))

    @cached_property
    def elastic_rows(self) -> np.ndarray:
        """(r,) ndarray of int: compliances with stiffness whose twists are independent; theirs are the twist states."""
        return read_only(self.independent_rows(np.flatnonzero(self.stiffness > 0.0)))

    @cached_property
    def twist_factor(self) -> np.ndarray:
        """(compliances, r) ndarray: twist of every spring from the independent ones; 0 for a pure damper.

        More rows than columns only where springs form a loop; it is taken as unloaded at rest.
        """
        rows = self.elastic_rows
        factor = np.zeros((len(self.compliances), len(rows)))
        factor[rows, np.arange(len(rows))] = 1.0
        redundant = np.setdiff1d(np.flatnonzero(self.stiffness > 0.0), rows)
        if redundant.size:
            factor[redundant] = np.linalg.lstsq(self.F[rows].T, self.F[redundant].T, rcond=None)[0].T
        return read_only(factor)

    @cached_property
    def _locked_torque_from_load(self) -> np.ndarray:
        """(laws, nodes) ndarray: torque of the locked clutches from the loads that only they can balance.

        With open clutches ``T0^T load = T0^T S^T tau``; redundant clutches share the torque with least norm.
        """
        spread = np.zeros((len(self.laws), len(self.nodes)))
        if self.locked.any():
            held = self.S[self.locked] @ self.T_released
            spread[self.locked] = np.linalg.pinv(held.T) @ self.T_released.T
        return read_only(spread)

    def locked_torque(
        self, twist: np.ndarray, speed: np.ndarray, acceleration: np.ndarray, inputs: np.ndarray
    ) -> np.ndarray:
        """(laws, ...) ndarray: torque through the locked clutches [N m], 0 for the others.

        Parameters
        ----------
        twist, speed, acceleration, inputs : (r, ...), (n, ...), (n, ...), (inputs, ...) ndarray
            Independent twists, coordinate speeds and accelerations, inputs.
        """
        springs = (self.stiffness[:, None] * self.twist_factor) @ twist + (self.damping[:, None] * self.F) @ speed
        load = self.B @ inputs - self.E.T @ springs - self.J @ (self.T @ acceleration)
        return self._locked_torque_from_load @ load

    @cached_property
    def resisting_rows(self) -> np.ndarray:
        """Compliances (indices) that resist motion by a spring, a damper or both."""
        return read_only(np.flatnonzero((self.stiffness > 0.0) | (self.damping > 0.0)))

    def solve_mass(self, right: np.ndarray) -> np.ndarray:
        """``M^-1 right``."""
        L = self.mass_factor
        diagonal = np.diag(L)
        if np.array_equal(L, np.diag(diagonal)):
            return (right.T / diagonal**2).T
        return scipy.linalg.cho_solve((L, True), right)

    @cached_property
    def mass_factor(self) -> np.ndarray:
        """(n, n) ndarray L, lower triangular, with ``M = L L^T``."""
        diagonal = np.diag(self.M)
        if np.array_equal(self.M, np.diag(diagonal)):
            return read_only(np.diag(np.sqrt(diagonal)))
        return read_only(scipy.linalg.cholesky(self.M, lower=True))

    def null_motions(self, rows: np.ndarray) -> np.ndarray:
        """(n, motions) ndarray: coordinate motions that twist none of these compliance rows (indices)."""
        return self._motions(rows).basis(self.coordinates)

    def independent_rows(self, rows: np.ndarray) -> np.ndarray:
        """Those of the compliance rows (indices) that are not a combination of earlier ones."""
        used = self._motions(rows).used_rows
        return np.asarray(rows, dtype=int)[used]

    def _rows(self, rows: Iterable[int]) -> list[dict[str, float]]:
        return [{self.coordinates[j]: self.F[i, j] for j in np.flatnonzero(self.F[i])} for i in rows]

    @cached_property
    def parts(self) -> np.ndarray:
        """(n,) ndarray of int: number of the connected part each coordinate belongs to."""
        touched = (self.F[self.resisting_rows] != 0.0).astype(float)
        return read_only(connected_components((self.M != 0.0) | (touched.T @ touched > 0.0), directed=False)[1])

    @cached_property
    def rigid_motion(self) -> np.ndarray:
        """(nodes,) ndarray: motion of every node when each connected part turns as one body, its first node by 1.

        Springs and dampers to ground are left out. What is held at rest (the ring of a planetary gear by a brake) has 0.
        This is the factor of the reflection, equation (2.2).

        Raises
        ------
        TopologyError
            A part that can turn in no way, or in more than one, without twisting (planetary gears).
        """
        between = np.flatnonzero(np.count_nonzero(self.E, axis=1) > 1)
        motions = self._motions(between)
        if not self._turning(motions).all():
            # a spring to a node at rest is one to ground
            moving = self.T.any(axis=1)
            between = np.flatnonzero(np.count_nonzero(self.E[:, moving], axis=1) > 1)
            motions = self._motions(between)
        basis = self.T @ motions.basis(self.coordinates)
        several = np.count_nonzero(basis, axis=1) > 1
        if several.any():
            i = int(several.argmax())
            turned = " and with ".join(np.array(motions.independent)[basis[i] != 0.0])
            raise TopologyError(
                f'node "{self.nodes[i]}" has no single ratio to the others: it turns with {turned}, each for itself; '
                "hold one of them rigidly (a locked brake) or lock a clutch"
            )
        if not self._turning(motions).all():
            culprit = self.coordinates[int((self.parts == self._turning(motions).argmin()).argmax())]
            raise TopologyError(
                f'node "{culprit}" has no single ratio to the others: it cannot turn without twisting a spring; '
                "release a brake or correct a ratio"
            )
        return read_only(basis.sum(axis=1))

    def _motions(self, rows: np.ndarray) -> Elimination:
        """Coordinates as they move when these compliances (indices) do not twist."""
        return eliminate(self._rows(rows), self.coordinates)

    def _turning(self, motions: Elimination) -> np.ndarray:
        """(parts,) ndarray of bool: parts of which some coordinate moves."""
        moving = np.count_nonzero(motions.basis(self.coordinates), axis=1) > 0
        return np.array([moving[self.parts == part].any() for part in range(self.parts.max() + 1)])


@checked
def assemble(car: HasDriveline) -> TorsionalModel:
    """Matrices of a driveline, its locked clutches taken as rigid.

    Parameters
    ----------
    car : Driveline, or anything with a ``driveline``

    Returns
    -------
    TorsionalModel

    Raises
    ------
    TopologyError
        A coordinate without inertia, or elements that hold each other at standstill.
    PowertrainError
        What is neither a driveline nor has one.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> model = pt.assemble(pt.examples.conventional())
    >>> model.coordinates[:3], model.M.shape
    (('engine', 'torsional_damper', 'clutch_primary'), (7, 7))
    """
    model = assemble_with_laws(car)
    for law in model.laws:
        if not law.is_clutch:
            raise PowertrainError(
                f"{law.name}: is not linear, permitted in a linear model: springs, dampers, gears and clutches; "
                "put one of them in its place"
            )
    return model


def assemble_with_laws(car: HasDriveline) -> TorsionalModel:
    """Matrices of a driveline with whatever laws it has; those of the last drivelines are kept."""
    return _assembled(as_driveline(car))


@kept(256)
def _assembled(driveline: Driveline) -> TorsionalModel:
    compliances = [row for e in driveline for row in e.compliances]
    laws = sorted((law for e in driveline for law in e.laws), key=lambda law: not law.is_clutch)
    locked = [law for law in laws if law.is_clutch and law.name not in driveline.released]
    constraints: list[ConstraintRow | Law] = [row for e in driveline for row in e.constraints]
    constraints += locked
    # What is held by a single node comes first, so that only the others can contradict each other.
    constraints.sort(key=lambda row: len(row.coefficients) > 1)
    kinematics = eliminate([row.coefficients for row in constraints], driveline.nodes)
    if kinematics.standstill_row is not None:
        raise _standstill(constraints, kinematics.standstill_row)
    if not kinematics.independent:
        raise TopologyError(f"every node is held at rest by {', '.join(row.name for row in constraints)}")
    nodes = driveline.nodes
    rigid = [row.coefficients for row in constraints if row not in locked]
    released = eliminate(rigid, nodes) if locked else kinematics
    model = TorsionalModel(
        nodes=nodes,
        coordinates=tuple(kinematics.independent),
        compliances=tuple(row.name for row in compliances),
        inputs=tuple(_input_name(node, driveline) for node in _bodies(driveline)),
        laws=tuple(laws),
        locked=np.array([law in locked for law in laws], dtype=bool),
        translating=driveline.translating,
        T=kinematics.basis(nodes),
        T_released=released.basis(nodes),
        E=_coefficient_matrix(compliances, nodes),
        B=np.eye(len(nodes))[:, [nodes.index(node) for node in _bodies(driveline)]],
        S=_coefficient_matrix(laws, nodes),
        J=_inertia_matrix(driveline),
        stiffness=np.array([row.stiffness for row in compliances]),
        damping=np.array([row.damping for row in compliances]),
    )
    _require_inertia(model)
    return model


def as_driveline(car: HasDriveline) -> Driveline:
    """The driveline of whatever has one (a `Driveline`, a `TwoMass`)."""
    driveline = getattr(car, "driveline", None)
    if not isinstance(driveline, Driveline):
        raise PowertrainError(f"expected a Driveline or a TwoMass, got {car!r}")
    return driveline


def _bodies(driveline: Driveline) -> list[str]:
    """Nodes where a torque or force can act: with inertia of their own, or moving along the road."""
    heavy = {node for e in driveline for row in e.inertias for node in row.nodes}
    return [node for node in driveline.nodes if node in heavy or node in driveline.translating]


def _input_name(node: str, driveline: Driveline) -> str:
    return f"{node}_force" if node in driveline.translating else f"{node}_torque"


def _coefficient_matrix(rows: Sequence[ComplianceRow | Law], nodes: tuple[str, ...]) -> np.ndarray:
    position = {node: j for j, node in enumerate(nodes)}
    matrix = np.zeros((len(rows), len(nodes)))
    for i, row in enumerate(rows):
        for node, value in row.coefficients.items():
            matrix[i, position[node]] = value
    return matrix


def _inertia_matrix(driveline: Driveline) -> np.ndarray:
    position = {node: j for j, node in enumerate(driveline.nodes)}
    J = np.zeros((len(position), len(position)))
    for element in driveline:
        for row in element.inertias:
            index = [position[node] for node in row.nodes]
            J[np.ix_(index, index)] += row.matrix
    return J


def _require_inertia(model: TorsionalModel) -> None:
    diagonal = np.diag(model.M)
    if (diagonal > 0.0).all():
        scale = 1.0 / np.sqrt(diagonal)
        smallest, shapes = np.ones(1), np.eye(1)
        if np.count_nonzero(model.M) > len(diagonal):
            smallest, shapes = scipy.linalg.eigh(scale[:, None] * model.M * scale, subset_by_index=[0, 0])
        if smallest[0] > 1e-13:
            return
        culprit = int(np.abs(shapes[:, 0]).argmax())
    else:
        culprit = int(diagonal.argmin())
    raise TopologyError(
        f'node "{model.coordinates[culprit]}" has no inertia; give it an Inertia or merge the springs on either side'
    )


def _standstill(constraints: Sequence[ConstraintRow | Law], index: int) -> TopologyError:
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
        f"{culprit.name} holds {', '.join(culprit.coefficients)} at standstill together with {others}; "
        "release a clutch or correct a ratio"
    )


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)
