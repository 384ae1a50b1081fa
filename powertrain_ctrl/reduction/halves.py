"""A driveline divided in two where it twists most: what the two-mass models are made of."""

from collections.abc import Collection
from functools import cached_property

import numpy as np

from ..base.errors import TopologyError
from ..driveline.collection import Driveline
from ..driveline.ends import ends, reached, resting_nodes
from ..driveline.kinematics import product
from ..elements import Tyre
from ..linear.assembly import assemble
from ..linear.modal import first_largest, modes
from .twomass import TwoMass


class Cut:
    """A driveline divided in two where it twists most in its first elastic mode.

    With ``at_tyres`` False a tyre counts as what lies behind the shafts, however soft it is, and is cut only where nothing
    else twists.
    """

    def __init__(self, car: Driveline, at_tyres: bool = True, driving: str | None = None):
        self.ends = ends(car, driving)
        self.car, self.driving, self.vehicle = self.ends.part, self.ends.driving, self.ends.vehicle
        driving = self.driving
        self.model = model = assemble(self.car)
        self.modes = modes(self.car)
        self._require_one_motion()
        self.at = model.nodes.index(driving)
        if driving in model.translating:
            raise TopologyError(f'the first node drives, and "{driving}" moves along the road; name the engine first')
        self.motion = model.rigid_motion / model.rigid_motion[self.at]
        tyres = [element.name for element in self.car if isinstance(element, Tyre)]
        self.shafts = self._cut_set([] if at_tyres else tyres)
        near = reached(self.car, driving, self.shafts)
        far = {node for node, moves in zip(model.nodes, self.motion, strict=True) if moves and node not in near}
        if far - reached(self.car, self.far_node, self.shafts):
            names = ", ".join(self.shafts)
            raise TopologyError(f"{names} twist most in the first mode, but cutting there does not leave two parts")
        self.first = np.array([node in near for node in model.nodes])
        self.wheels = self.ends.wheels[0] if self.ends.driven_tyres else self._behind_shaft()
        self.driven = self.vehicle or self.wheels
        self.wheel_motion = float(self.motion[model.nodes.index(self.wheels)])
        if not self.wheel_motion:
            raise TopologyError(f'"{self.wheels}" rests when everything turns as one body, so nothing is driven there')
        self.total = float(self.motion @ model.J @ self.motion)
        self._check_dominance()

    def _require_one_motion(self) -> None:
        n_rigid = self.modes.n_rigid
        if n_rigid != 1 or len(self.modes) < 2:
            dampers = [n for n, k in zip(self.model.compliances, self.model.stiffness, strict=True) if k == 0.0]
            hint = ""
            if dampers and n_rigid > 1:
                hint = (
                    f"; {', '.join(dampers)}: without stiffness, give some or, to a Tyre, stiffness None and damping 0"
                )
            raise TopologyError(
                f"a two-mass model needs one rigid motion and an elastic mode; there are {n_rigid} "
                f"and {len(self.modes) - n_rigid}{hint}"
            )

    @cached_property
    def far_node(self) -> str:
        """The vehicle, else the end of the most twisted spring that swings against the driving node."""
        spring = self.model.E[self.model.compliances.index(self.modes.dominant_compliance(1))]
        ends = np.setdiff1d(np.flatnonzero(spring), self.at)
        shape = self.modes.reflected_shapes[:, 1] * self.modes.reflected_shapes[self.at, 1]
        return self.vehicle or self.model.nodes[int(ends[first_largest(-shape[ends])])]

    def _cut_set(self, last: Collection[str]) -> list[str]:
        """Springs that separate driving and driven side: on every path the one that twists most, those in ``last`` last."""
        energy = dict(zip(self.model.compliances, self.modes.strain_energy[:, 1], strict=True))
        shafts: list[str] = []
        while path := _path(self.car, self.driving, self.far_node, shafts):
            springs = [name for name in path if energy.get(name, 0.0) > 0.0]
            if not springs:
                raise TopologyError(f"{', '.join(path)} connect {self.driving} and {self.far_node} without a spring")
            springs = [name for name in springs if name not in last] or springs
            shafts.append(springs[first_largest(np.array([energy[name] for name in springs]))])
        return shafts

    def _behind_shaft(self) -> str:
        ends = self.model.E[self.model.compliances.index(self.shafts[0])]
        return self.model.nodes[int(np.flatnonzero((ends != 0.0) & ~self.first)[0])]

    def node(self, name: str) -> int:
        return self.model.nodes.index(name)

    def _check_dominance(self) -> None:
        """The first elastic mode must have most of the flexibility between driving and driven side."""
        share = np.abs(self.flexibility[1:])
        if share[0] <= 0.5 * share.sum():
            rivals = ", ".join(f"{f:.3g} Hz" for f in self.modes.frequency_hz[1:][share > 0.1 * share.sum()])
            raise TopologyError(
                f"no elastic mode dominates between {self.driving} and {self.driven}: modes at {rivals} have "
                f"{100.0 * share[0] / share.sum():.0f} % of the flexibility in the first, permitted: more than 50 %"
            )

    @cached_property
    def flexibility(self) -> np.ndarray:
        """(modes,) ndarray: part of each mode in the motion of the driven node under a torque at the driving one."""
        shapes = self.modal_shapes
        with np.errstate(divide="ignore"):
            return shapes[self.at] * shapes[self.node(self.driven)] / self.modes.omega**2

    @cached_property
    def modal_shapes(self) -> np.ndarray:
        """(nodes, modes) ndarray: mass-normalised shapes."""
        shapes = self.modes.shapes
        return shapes / np.sqrt(np.sum(shapes * (self.model.J @ shapes), axis=0))

    def inertia(self, side: np.ndarray) -> float:
        """Inertia of one side, at the speed of the driving node."""
        motion = np.where(side, self.motion, 0.0)
        return float(motion @ self.model.J @ motion)

    def wheel_stiffness(self, compliance: str, front: np.ndarray) -> float:
        """Stiffness of a spring with these nodes (boolean mask) on its driving side, at the wheel."""
        row = self.model.compliances.index(compliance)
        twist = self.model.E[row] @ np.where(front, self.motion, 0.0) / self.wheel_motion
        return float(self.model.stiffness[row] * twist**2)

    def shaft_stiffness(self) -> float:
        """Stiffness of the cut springs at the wheel."""
        return sum(self.wheel_stiffness(shaft, self.first) for shaft in self.shafts)

    @cached_property
    def series(self) -> tuple[float, float]:
        """Stiffness at the wheel of the cut springs with the driven tyres behind them, and the tyres' share of the twist.

        All else is rigid: each tyre is in series with what drives its wheel, the axles are side by side.
        """
        tyres = [tyre.name for tyre in self.ends.driven_tyres if tyre.stiffness and tyre.name not in self.shafts]
        soft = [*self.shafts, *tyres]
        groups: list[set[str]] = []
        for node, moves in zip(self.model.nodes, self.motion, strict=True):
            if moves and not any(node in group for group in groups):
                groups.append(reached(self.car, node, soft))
        # twist of each soft spring from the motion of the groups, at the wheel
        motion = np.array([[node in group for group in groups] for node in self.model.nodes]) * self.motion[:, None]
        index = [self.model.compliances.index(name) for name in soft]
        twist = self.model.E[index] @ motion / self.wheel_motion
        K = twist.T @ (self.model.stiffness[index][:, None] * twist)
        near, far = (next(i for i, g in enumerate(groups) if node in g) for node in (self.driving, self.far_node))
        between = [i for i in range(len(groups)) if i not in (near, far)]
        free = -np.linalg.solve(K[np.ix_(between, between)], K[between, near])
        stiffness = float(K[near, near] + K[near, between] @ free)
        moved = dict(zip(between, free.tolist(), strict=True)) | {near: 1.0, far: 0.0}
        wheels = self.ends.wheels if self.ends.driven_tyres else ()
        shares = [moved[i] for wheel in wheels for i, group in enumerate(groups) if wheel in group]
        return stiffness, float(np.mean(shares)) if shares else 0.0

    def response(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Driving torque to acceleration of the driven node and to speed of the driving node, at these frequencies."""
        model, seen = self.model, self.node(self.driven)
        s = 1j * omega[:, None, None]
        # with all coordinates, those without inertia too
        T = model.following.kinematics
        twist = product(model.E, T)
        K, D = (twist.T @ (values[:, None] * twist) for values in (model.stiffness, model.damping))
        motion = np.linalg.solve(K + s * D + s**2 * (T.T @ model.J @ T), T[self.at][None, :, None])[:, :, 0]
        return (1j * omega) ** 2 * (motion @ T[seen]), 1j * omega * (motion @ T[self.at])

    def two_mass(self, J1: float, stiffness: float, damping: float, rim_share: float) -> TwoMass:
        """Control model with these parameters and, of the total inertia, the rest behind the spring."""
        names = {} if self.vehicle is None else {"vehicle": self.vehicle}
        radius = None if self.vehicle is None else float(self.motion[self.node(self.vehicle)]) / self.wheel_motion
        return TwoMass(
            J1=float(J1),
            J2=float((self.total - J1) / self.wheel_motion**2),
            stiffness=stiffness,
            damping=damping,
            ratio=1.0 / self.wheel_motion,
            radius=radius,
            rim_share=rim_share,
            driving=self.driving,
            wheels=self.wheels,
            shaft=self.shafts[0],
            **names,
        )


def _path(car: Driveline, start: str, end: str, without: Collection[str]) -> list[str]:
    """Elements on a shortest path between two nodes, none if there is no path without these elements."""
    came: dict[str, tuple[str, str]] = {}
    reached, border = {start, *resting_nodes(car)}, [start]
    links = [e for e in car if e.name not in without and e.name not in car.released and len(e.nodes) > 1]
    while border and end not in came:
        node = border.pop(0)
        for element in links:
            if node in element.nodes:
                for other in element.nodes:
                    if other not in reached:
                        reached.add(other)
                        came[other] = (node, element.name)
                        border.append(other)
    names = []
    while end in came:
        end, name = came[end]
        names.append(name)
    return names[::-1]
