"""From elements to matrices: ``M z'' + D z' + K z = T^T B u`` with node speeds ``omega = T z'``.

Constraint rows are solved for the speeds, so M, D, K come out symmetric and semidefinite, and the factors
of a gear, ``J / R^2`` and ``k / R^2`` of equation (2.1), appear by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TypeVar

import numpy as np
from scipy.sparse.csgraph import connected_components

from ..base.doors import called, checked
from ..base.errors import PowertrainError, TopologyError
from ..base.records import Record, read_only
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.kinematics import Elimination, eliminate, product, times
from ..elements import ComplianceRow, ConstraintRow, Law
from .admissible import require_inertia, require_no_loss, standstill
from .condensing import Combination, Following, follow, independent_twists, shares_of
from .couplings import require_none
from .mass import MassFactor, mass_factor

# Standard gravity [m/s^2].
GRAVITY = 9.80665

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
    following : Following
        How nodes without inertia follow the coordinates, all of which have some; T is its T.
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
    stiffness, damping, loss_factor : (compliances,) ndarray
        k [N m/rad], d [N m s/rad], eta [-] with which k is ``k (1 + j eta)`` in steady harmonic motion.
    constraints : tuple of mapping
        Node to coefficient of each combination of node speeds that is zero, locked clutches apart.
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
    following: Following
    E: np.ndarray
    B: np.ndarray
    S: np.ndarray
    J: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    loss_factor: np.ndarray
    constraints: tuple[Mapping[str, float], ...]

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
        return self.following.F

    @property
    def undamped(self) -> TorsionalModel:
        """This model as its dampers fade: creeping nodes follow the springs, if any act on them."""
        if not self.following.U.shape[1]:
            return self
        heavy = np.diag(self.J) > 0.0
        still = follow(
            self.all_coordinates, self.following.kinematics, self.E, heavy, self.stiffness, self.damping, undamped=True
        )
        return replace(self, T=still.T, following=still)

    @cached_property
    def T_released(self) -> np.ndarray:
        """(nodes, n0) ndarray, T if all clutches were open."""
        return read_only(eliminate(self.constraints, self.nodes).basis(self.nodes))

    @cached_property
    def M(self) -> np.ndarray:
        """(n, n) ndarray, inertia in the coordinates: ``T^T J T``."""
        return read_only(_symmetric(times(self.T.T, times(self.J, self.T))))

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
        return read_only(independent_twists(self.following, np.flatnonzero(self.stiffness > 0.0)))

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
            factor[redundant] = shares_of(self.following.twists, rows, redundant)
        return read_only(factor)

    @cached_property
    def locked_torque_from_load(self) -> np.ndarray:
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
        carried = self.torque
        springs = carried.on_twist @ twist + carried.on_speed @ speed + carried.on_load @ (self.B @ inputs)
        load = self.B @ inputs - self.E.T @ springs - self.J @ (self.T @ acceleration)
        return self.locked_torque_from_load @ load

    @cached_property
    def speed(self) -> Combination:
        """Of every node, without what follows the change of a load."""
        U, creep, pull = self.following.U, self.following.creep, self.stiffness[:, None] * self.twist_factor
        return Combination(*map(read_only, (-U @ (creep.T @ pull), self.T, U @ U.T)))

    @cached_property
    def twist_rate(self) -> Combination:
        """Of every compliance, without what follows the change of a load."""
        U, creep, pull = self.following.U, self.following.creep, self.stiffness[:, None] * self.twist_factor
        return Combination(*map(read_only, (-creep @ (creep.T @ pull), self.F, creep @ U.T)))

    @cached_property
    def torque(self) -> Combination:
        """Of every compliance."""
        k, d, rate, bent = self.stiffness[:, None], self.damping[:, None], self.twist_rate, self.following
        on_twist, on_speed = k * self.twist_factor + d * rate.on_twist, d * rate.on_speed
        return Combination(*map(read_only, (on_twist, on_speed, k * (bent.bend @ bent.V.T) + d * rate.on_load)))

    @cached_property
    def resisting_rows(self) -> np.ndarray:
        """Compliances (indices) that resist motion by a spring, a damper or both."""
        return read_only(np.flatnonzero((self.stiffness > 0.0) | (self.damping > 0.0)))

    def solve_mass(self, right: np.ndarray) -> np.ndarray:
        """``M^-1 right``."""
        return self.mass.solve(right)

    @cached_property
    def mass_factor(self) -> np.ndarray:
        """(n, n) ndarray L, lower triangular, with ``M = L L^T``."""
        return read_only(self.mass.L)

    @cached_property
    def mass(self) -> MassFactor:
        """The same, of which a diagonal one is known to be one."""
        return MassFactor(*(None if part is None else read_only(part) for part in mass_factor(self.M)))

    @cached_property
    def springless_motions(self) -> np.ndarray:
        """(n, motions) ndarray: coordinate motions in which no spring need twist."""
        return read_only(self.null_motions(np.flatnonzero(self.stiffness > 0.0)))

    @cached_property
    def free_motions(self) -> np.ndarray:
        """(n, motions) ndarray: coordinate motions in which neither spring nor damper need twist."""
        alone = (self.damping > 0.0) & (self.stiffness == 0.0)
        return read_only(self.null_motions(self.resisting_rows)) if alone.any() else self.springless_motions

    def null_motions(self, rows: np.ndarray) -> np.ndarray:
        """(n, motions) ndarray: coordinate motions in which nothing need twist these compliance rows (indices)."""
        motions = self._motions(rows)
        if not self.following.names:
            return motions.basis(self.coordinates)
        own = [name in self.coordinates for name in motions.independent]
        return motions.basis(self.coordinates)[:, own]

    @cached_property
    def all_coordinates(self) -> tuple[str, ...]:
        """Coordinates, with those that follow behind them: columns of ``following.kinematics``."""
        return self.coordinates + self.following.names

    @cached_property
    def all_twists(self) -> np.ndarray:
        """(compliances, n + m) ndarray: twist of each from all coordinates, exactly 0 where its terms cancel."""
        if not self.following.names:
            return self.F
        return read_only(product(self.E, self.following.kinematics))

    @cached_property
    def all_parts(self) -> np.ndarray:
        """(n + m,) ndarray of int: number of the connected part of each coordinate, also of those that follow."""
        touched = (self.all_twists[self.resisting_rows] != 0.0).astype(float)
        n, linked = len(self.coordinates), touched.T @ touched > 0.0
        linked[:n, :n] |= self.M != 0.0
        return read_only(connected_components(linked, directed=False)[1])

    @cached_property
    def parts(self) -> np.ndarray:
        """(n,) ndarray of int: number of the connected part each coordinate belongs to."""
        return read_only(self.all_parts[: len(self.coordinates)])

    @cached_property
    def parts_of_twists(self) -> np.ndarray:
        """(compliances,) ndarray of int: number of the connected part that each twists in, -1 for one that cannot twist."""
        touched = self.all_twists != 0.0
        return read_only(np.where(touched.any(axis=1), self.all_parts[touched.argmax(axis=1)], -1))

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
            moving = self.following.kinematics.any(axis=1)
            between = np.flatnonzero(np.count_nonzero(self.E[:, moving], axis=1) > 1)
            motions = self._motions(between)
        basis = self.following.kinematics @ motions.basis(self.all_coordinates)
        several = np.count_nonzero(basis, axis=1) > 1
        if several.any():
            i = int(several.argmax())
            turned = " and with ".join(np.array(motions.independent)[basis[i] != 0.0])
            raise TopologyError(
                f'node "{self.nodes[i]}" has no single ratio to the others: it turns with {turned}, each for itself',
                "hold one of them rigidly (a locked brake) or lock a clutch",
            )
        if not self._turning(motions).all():
            culprit = self.coordinates[int((self.parts == self._turning(motions).argmin()).argmax())]
            raise TopologyError(
                f'node "{culprit}" has no single ratio to the others: it cannot turn without twisting a spring',
                "release a brake or correct a ratio",
            )
        return read_only(basis.sum(axis=1))

    def _motions(self, rows: np.ndarray) -> Elimination:
        """Coordinates as they move when these compliances (indices) do not twist."""
        names, twists = self.all_coordinates, self.all_twists[rows]
        sparse: list[dict[str, float]] = [{} for _ in twists]
        i, j = np.nonzero(twists)
        for row, column, value in zip(i.tolist(), j.tolist(), twists[i, j].tolist(), strict=True):
            sparse[row][names[column]] = value
        return eliminate(sparse, names)

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
        What is neither a driveline nor has one; elements that are not linear, or have a loss factor.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> model = pt.assemble(pt.examples.conventional())
    >>> model.coordinates[:3], model.M.shape
    (('engine', 'torsional_damper', 'clutch_primary'), (7, 7))
    """
    model = assemble_with_loss(car)
    require_no_loss(model.compliances, model.loss_factor)
    return model


def assemble_with_loss(car: HasDriveline) -> TorsionalModel:
    """Matrices of a linear driveline, also of one with loss factors, which only steady harmonic motion has a use for."""
    driveline = as_driveline(car)
    require_none(driveline)
    model = _assembled(driveline)
    for law in model.laws:
        if not law.is_clutch:
            raise PowertrainError(
                f"{law.owner}: is not linear, permitted in a linear model: springs, dampers, gears and clutches; take the "
                "driveline at an operating point, car.at(torques=...), car.at(twists=...) or car.at(speed=...)"
            )
    return model


def assemble_with_laws(car: HasDriveline) -> TorsionalModel:
    """Matrices of a driveline with whatever laws it has; those of the last drivelines are kept."""
    driveline = as_driveline(car)
    require_none(driveline)
    model = _assembled(driveline)
    require_no_loss(model.compliances, model.loss_factor)
    return model


@kept(256)
def _assembled(driveline: Driveline) -> TorsionalModel:
    stated = driveline.stated
    compliances = [row for each in stated for row in each.compliances]
    J, nodes = _inertia_matrix(driveline), driveline.nodes
    weight = dict(zip(nodes, (GRAVITY * np.diag(J)).tolist(), strict=True))
    laws = [law.on(weight[next(iter(law.coefficients))]) for each in stated for law in each.laws]
    laws.sort(key=lambda law: not law.is_clutch)
    locked = [law for law in laws if law.is_clutch and law.name not in driveline.released]
    constraints: list[ConstraintRow | Law] = [row for each in stated for row in each.constraints]
    constraints += locked
    # What is held by a single node comes first, so that only the others can contradict each other.
    constraints.sort(key=lambda row: len(row.coefficients) > 1)
    kinematics = eliminate([row.coefficients for row in constraints], driveline.nodes)
    if kinematics.standstill_row is not None:
        raise standstill(constraints, kinematics.standstill_row)
    if not kinematics.independent:
        raise TopologyError(f"every node is held at rest by {', '.join(row.name for row in constraints)}")
    E = _coefficient_matrix(compliances, nodes)
    stiffness, damping = (np.array([getattr(row, what) for row in compliances]) for what in ("stiffness", "damping"))
    coordinates, all_motions = tuple(kinematics.independent), kinematics.basis(nodes)
    following = follow(coordinates, all_motions, E, np.diag(J) > 0.0, stiffness, damping)
    n = following.T.shape[1]
    loaded = _bodies(driveline)
    if n < len(coordinates):
        loaded |= {nodes[i] for i in np.flatnonzero(all_motions[:, n:].any(axis=1))}
    inputs = [j for j, node in enumerate(nodes) if node in loaded]
    B = np.zeros((len(nodes), len(inputs)))
    B[inputs, range(len(inputs))] = 1.0
    model = TorsionalModel(
        nodes=nodes,
        coordinates=coordinates[:n],
        compliances=tuple(row.name for row in compliances),
        inputs=tuple(_input_name(nodes[j], driveline) for j in inputs),
        laws=tuple(laws),
        locked=np.array([law.is_clutch and law.name not in driveline.released for law in laws], dtype=bool),
        translating=driveline.translating,
        T=following.T,
        following=following,
        E=E,
        B=B,
        S=_coefficient_matrix(laws, nodes),
        J=J,
        stiffness=stiffness,
        damping=damping,
        loss_factor=np.array([row.loss_factor for row in compliances]),
        constraints=tuple(row.coefficients for row in constraints if isinstance(row, ConstraintRow)),
    )
    _require_no_slip_at_condensed_nodes(model)
    require_inertia(model.M, model.coordinates)
    return model


def as_driveline(car: HasDriveline) -> Driveline:
    """The driveline of whatever has one (a `Driveline`, a `TwoMass`)."""
    driveline = getattr(car, "driveline", None)
    if not isinstance(driveline, Driveline):
        raise PowertrainError(f"expected a Driveline or a TwoMass, got {car!r}")
    return driveline


def _bodies(driveline: Driveline) -> set[str]:
    """Nodes where a torque or force can act: with inertia of their own, or moving along the road."""
    return {node for each in driveline.stated for row in each.inertias for node in row.nodes} | driveline.translating


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
    for each in driveline.stated:
        for row in each.inertias:
            for a, line in zip(row.nodes, row.matrix, strict=True):
                for b, value in zip(row.nodes, line, strict=True):
                    J[position[a], position[b]] += value
    return J


def _require_no_slip_at_condensed_nodes(model: TorsionalModel) -> None:
    for law, row, is_locked in zip(model.laws, model.S, model.locked, strict=True):
        if not is_locked and product(row[None, :], model.following.V).any():
            node = model.nodes[int((row[:, None] * model.following.V).any(axis=1).argmax())]
            raise TopologyError(
                f'node "{node}" has no inertia and {law.name} acts there, so that only springs say how it moves',
                "give it an Inertia, or, for linear models, damping to the spring that holds it",
            )


def _symmetric(matrix: np.ndarray) -> np.ndarray:
    return 0.5 * (matrix + matrix.T)
