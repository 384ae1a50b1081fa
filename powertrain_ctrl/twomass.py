"""Two-mass control models of a driveline."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.optimize

from .assembly import as_driveline, assemble
from .driveline import Driveline
from .elements import Clutch, Compliance, Constraint, Gear, Inertia, Tyre
from .errors import ParameterError, PowertrainError, TopologyError
from .modal import modes
from .units import to_hz


@dataclass(frozen=True, kw_only=True)
class TwoMass:
    """Two inertias, a ratio and a spring with damper: the control model (2.13) or (2.21).

    Wherever a driveline is taken, so is this.

    Attributes
    ----------
    J1, J2 : float
        Driving side [kg m^2], at its own speed; driven side with the vehicle [kg m^2], at wheel speed.
    stiffness, damping : float
        c [N m/rad], d [N m s/rad], on the wheel side.
    ratio : float
        R = driving speed / wheel speed [-].
    radius : float or None
        Vehicle speed / wheel speed [m]; None where there is no vehicle.
    rim_share : float
        Share of the twist that lies behind the wheel sensor, in the tyre; 0 as the source has it.
    driving, wheels, vehicle, shaft : str
        Names of nodes and spring, those of the detailed model.

    Raises
    ------
    ParameterError
        A value outside what is permitted.

    Examples
    --------
    The parameters of Table 2.2:

    >>> TwoMass(J1=0.481, J2=249.0, stiffness=3.44e4, damping=350.0, ratio=18.0, radius=0.35)
    TwoMass: f = 3.015 Hz, zeta = 0.0964
      J1 = 0.481 kg m^2 (engine), J2 = 249 kg m^2 (wheels), ratio = 18, radius = 0.35 m
      stiffness = 34400 N m/rad, damping = 350 N m s/rad (drive_shafts)
    """

    J1: float
    J2: float
    stiffness: float
    damping: float
    ratio: float
    radius: float | None = None
    rim_share: float = 0.0
    driving: str = "engine"
    wheels: str = "wheels"
    vehicle: str = "vehicle"
    shaft: str = "drive_shafts"

    def __post_init__(self):
        for name, unit in (("J1", "kg m^2"), ("J2", "kg m^2"), ("stiffness", "N m/rad")):
            self._require(name, unit, 0.0 < getattr(self, name) < np.inf, "> 0 and finite")
        self._require("damping", "N m s/rad", 0.0 <= self.damping < np.inf, ">= 0 and finite")
        self._require("ratio", "", self.ratio != 0.0 and np.isfinite(self.ratio), "not 0, finite")
        self._require("radius", "m", self.radius is None or 0.0 < self.radius < np.inf, "> 0 and finite, or None")
        self._require("rim_share", "", 0.0 <= self.rim_share <= 1.0, "0 to 1")

    def _require(self, name: str, unit: str, holds: bool, permitted: str):
        if not holds:
            raise ParameterError("two-mass model", name, float(getattr(self, name)), unit, permitted)

    @cached_property
    def driveline(self) -> Driveline:
        """Driveline of this model: nodes `driving`, `wheels`, `vehicle` and, with a tyre share, `tread`."""
        driven = "tread" if self.rim_share else self.wheels
        axle = f"{self.driving}_reflected"
        elements = [
            Inertia(self.driving, J=self.J1),
            Inertia(driven, J=self.J2),
            Gear("ratio", self.driving, axle, ratio=self.ratio),
            Compliance(self.shaft, {axle: 1.0, driven: -1.0}, stiffness=self.stiffness, damping=self.damping),
        ]
        if self.radius is not None:
            elements.append(Tyre("rolling", driven, self.vehicle, radius=self.radius))
        if self.rim_share == 1.0:
            elements.append(Gear("rim", self.wheels, axle, ratio=1.0))
        elif self.rim_share:
            rim = {self.wheels: 1.0, axle: -self.rim_share, driven: self.rim_share - 1.0}
            elements.append(Constraint("rim", rim))
        return Driveline(*elements)

    @property
    def compliance_of_inertia(self) -> float:
        """``1 / (J1 R^2) + 1 / J2`` [1/(kg m^2)], at wheel speed."""
        return 1.0 / (self.J1 * self.ratio**2) + 1.0 / self.J2

    @property
    def omega(self) -> float:
        """Undamped natural frequency [rad/s]."""
        return float(np.sqrt(self.stiffness * self.compliance_of_inertia))

    @property
    def frequency_hz(self) -> float:
        return to_hz(self.omega)

    @property
    def damping_ratio(self) -> float:
        return self.damping * self.compliance_of_inertia / (2.0 * self.omega)

    def response(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frequency response from driving torque: acceleration of the driven side, speed of the driving side.

        Parameters
        ----------
        omega : (N,) array_like
            [rad/s], > 0.

        Returns
        -------
        acceleration, speed : (N,) ndarray of complex
            [m/s^2 per N m] (rad/s^2 where there is no vehicle), [rad/s per N m].
        """
        s = 1j * np.asarray(omega)
        coupling = self.stiffness + self.damping * s
        driving, driven = self.J1 * self.ratio**2, self.J2
        # both masses and the spring at wheel speed
        determinant = s * (driving * driven * s**2 + coupling * (driving + driven))
        acceleration = s * coupling * self.ratio / determinant * (self.radius or 1.0)
        return acceleration, (driven * s**2 + coupling) * self.ratio**2 / determinant

    def __repr__(self) -> str:
        radius = "" if self.radius is None else f", radius = {self.radius:.4g} m"
        rim = f", {100 * self.rim_share:.1f} % of the twist in the tyre" if self.rim_share else ""
        return (
            f"TwoMass: f = {self.frequency_hz:.3f} Hz, zeta = {self.damping_ratio:.4f}\n"
            f"  J1 = {self.J1:.4g} kg m^2 ({self.driving}), J2 = {self.J2:.6g} kg m^2 ({self.wheels}), "
            f"ratio = {self.ratio:.6g}{radius}\n"
            f"  stiffness = {self.stiffness:.6g} N m/rad, damping = {self.damping:.6g} N m s/rad ({self.shaft}){rim}"
        )


@dataclass(frozen=True, kw_only=True)
class SwitchedTwoMass:
    """The control models of both clutch states as one: (2.21) while the clutch slips, (2.13) once it is stuck.

    While it slips, the engine side of inertia ``closed.J1 - slipping.J1`` turns on its own. At lock and
    at re-slip the state is carried over: twist of the spring and all speeds.

    Attributes
    ----------
    closed, slipping : TwoMass
        With the same ratio, radius and names on the wheel side.
    max_torque : float
        Capacity of the clutch where no input gives it [N m].
    clutch : str
        Name of the clutch.

    Raises
    ------
    PowertrainError
        Models that do not belong together.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> closed = pt.two_mass(pt.examples.conventional(), method="source")
    >>> slipping = pt.two_mass(pt.examples.conventional(damping="open").release("clutch"), method="source")
    >>> pt.launch(pt.SwitchedTwoMass(closed=closed, slipping=slipping)).events[-1].kind
    'lock'
    """

    closed: TwoMass
    slipping: TwoMass
    max_torque: float = 0.0
    clutch: str = "clutch"

    def __post_init__(self):
        for name in ("ratio", "radius", "wheels", "vehicle", "shaft"):
            mine, other = getattr(self.closed, name), getattr(self.slipping, name)
            same = mine == other if isinstance(mine, str) or mine is None else np.isclose(mine, other, rtol=1e-9)
            if not same:
                raise PowertrainError(f"{name} is {mine} when closed and {other} when slipping, permitted: the same")
        if bool(self.closed.rim_share) != bool(self.slipping.rim_share):
            raise PowertrainError("only one of the two models has a tyre share, permitted: both by the same method")
        if self.closed.driving == self.slipping.driving:
            raise PowertrainError(
                f'both models are driven at "{self.closed.driving}", permitted: engine and input shaft'
            )
        self._engine_inertia()

    def _engine_inertia(self) -> float:
        J = self.closed.J1 - self.slipping.J1
        if not J > 0.0:
            raise PowertrainError(f"closed.J1 - slipping.J1 = {J:g} kg m^2, permitted: > 0, the inertia of the engine")
        return J

    @cached_property
    def driveline(self) -> Driveline:
        """Driveline while the clutch slips."""
        return self._with_clutch(self.slipping)

    @cached_property
    def stuck_driveline(self) -> Driveline:
        """Driveline while the clutch is stuck."""
        input_shaft = replace(self.closed, J1=self.slipping.J1, driving=self.slipping.driving)
        return self._with_clutch(input_shaft)

    def _with_clutch(self, behind: TwoMass) -> Driveline:
        engine = Inertia(self.closed.driving, J=self._engine_inertia())
        clutch = Clutch(self.clutch, self.closed.driving, behind.driving, max_torque=self.max_torque)
        return Driveline(engine, *behind.driveline, clutch)


def two_mass(car, method: str = "modal") -> TwoMass:
    """Two-mass control model of a driveline; with an open clutch, of the part that carries the vehicle.

    Parameters
    ----------
    car : Driveline
        Its first node drives. A `TwoMass` comes back as it is.
    method : {"modal", "source", "series", "fit"}
        "source": equations (2.14), (2.22). The driveline is cut at the spring that twists most in the first mode; the
        inertias on either side are added up, the spring keeps its stiffness, and the damping is chosen so that the
        resonance peak of torque to vehicle acceleration is that of the detailed model. Without the tyre it rings
        14 % too high on the source's car.
        "series": the same with the tyre's stiffness in series.
        "modal": frequency, damping ratio and the driving node's participation are those of the first elastic mode;
        the total inertia is kept.
        "fit": least squares on the responses from torque to vehicle acceleration and engine speed up to
        four times the first frequency, from "modal"; the total inertia is kept.

    Returns
    -------
    TwoMass

    Raises
    ------
    TopologyError
        No elastic mode that dominates, more than one rigid motion, or a driveline that its springs do not divide in two.
    PowertrainError
        A fit that does not converge.

    Examples
    --------
    Tables 2.2 and 2.3:

    >>> import powertrain_ctrl as pt
    >>> pt.two_mass(pt.examples.conventional(), method="source")
    TwoMass: f = 3.014 Hz, zeta = 0.0964
      J1 = 0.4814 kg m^2 (engine), J2 = 249 kg m^2 (wheels), ratio = 18, radius = 0.35 m
      stiffness = 34400 N m/rad, damping = 350.006 N m s/rad (drive_shafts)
    >>> launching = pt.examples.conventional(damping="open").release("clutch")
    >>> round(pt.two_mass(launching, method="source").J1, 4)
    0.0414

    With the right frequency:

    >>> pt.two_mass(pt.examples.conventional())
    TwoMass: f = 2.638 Hz, zeta = 0.0987
      J1 = 0.4725 kg m^2 (engine), J2 = 251.884 kg m^2 (wheels), ratio = 18, radius = 0.35 m
      stiffness = 26154 N m/rad, damping = 311.422 N m s/rad (drive_shafts), 22.3 % of the twist in the tyre
    """
    if method not in METHODS:
        raise PowertrainError(f"method = {method!r}, permitted: {', '.join(map(repr, METHODS))}")
    return car if isinstance(car, TwoMass) else METHODS[method](_Cut(as_driveline(car)))


class _Cut:
    """A driveline divided in two at the spring that twists most in its first elastic mode."""

    def __init__(self, car: Driveline):
        self.car = _vehicle_part(car)
        self.model = model = assemble(self.car)
        self.modes = modes(self.car)
        self.shaft = self._most_twisted()
        driving = self.car.nodes[0]
        if driving in model.translating:
            raise TopologyError(f'the first node drives, and "{driving}" moves along the road; name the engine first')
        motion = model.rigid_motion / model.rigid_motion[0]
        self.shafts = self._cut_set(driving)
        near = _reached(self.car, driving, self.shafts)
        far = {node for node in model.nodes if node not in near}
        if _reached(self.car, self._far_node(), self.shafts) != far:
            names = ", ".join(self.shafts)
            raise TopologyError(f"{names} twist most in the first mode, but cutting there does not leave two parts")
        self.first = np.array([node in near for node in model.nodes])
        tyres = [e for e in self.car if isinstance(e, Tyre)]
        # an axle that only rolls along is not between engine and vehicle
        driven = _reached(self.car, driving, [tyre.name for tyre in tyres])
        self.tyres = [tyre for tyre in tyres if tyre.wheel in driven]
        self.wheels = self.tyres[0].wheel if self.tyres else self._behind_shaft()
        self.vehicle = next((node for node in model.nodes if node in model.translating), None)
        self.driven = self.vehicle or self.wheels
        self.motion = motion
        self.wheel_motion = float(motion[model.nodes.index(self.wheels)])
        self.total = float(motion @ model.J @ motion)
        self._check_dominance()

    def _most_twisted(self) -> str:
        n_rigid = self.modes.n_rigid
        if n_rigid != 1 or len(self.modes) < 2:
            dampers = [n for n, k in zip(self.model.compliances, self.model.stiffness, strict=True) if k == 0.0]
            hint = f"; {', '.join(dampers)}: without stiffness" if dampers and n_rigid > 1 else ""
            raise TopologyError(
                f"a two-mass model needs one rigid motion and an elastic mode; there are {n_rigid} "
                f"and {len(self.modes) - n_rigid}{hint}"
            )
        return self.modes.dominant_compliance(1)

    def _far_node(self) -> str:
        """The vehicle, else the end of the most twisted spring that swings against the driving node."""
        moving = next((node for node in self.car.nodes if node in self.model.translating), None)
        ends = np.flatnonzero(self.model.E[self.model.compliances.index(self.shaft)])
        shape = self.modes.reflected_shapes[:, 1] * self.modes.reflected_shapes[0, 1]
        return moving or self.model.nodes[int(ends[shape[ends].argmin()])]

    def _cut_set(self, driving: str) -> list[str]:
        """Springs that separate driving and driven side: on every path between them the one that twists most."""
        energy = dict(zip(self.model.compliances, self.modes.strain_energy[:, 1], strict=True))
        shafts: list[str] = []
        while path := _path(self.car, driving, self._far_node(), shafts):
            springs = [name for name in path if energy.get(name, 0.0) > 0.0]
            if not springs:
                raise TopologyError(f"{', '.join(path)} connect {driving} and {self._far_node()} without a spring")
            shafts.append(max(springs, key=energy.__getitem__))
        return shafts

    def _behind_shaft(self) -> str:
        ends = self.model.E[self.model.compliances.index(self.shafts[0])]
        return self.model.nodes[int(np.flatnonzero((ends != 0.0) & ~self.first)[0])]

    def node(self, name: str) -> int:
        return self.model.nodes.index(name)

    def _check_dominance(self):
        """The first elastic mode must have most of the flexibility between driving and driven side."""
        share = np.abs(self.flexibility[1:])
        if share[0] <= 0.5 * share.sum():
            rivals = ", ".join(f"{f:.3g} Hz" for f in self.modes.frequency_hz[1:][share > 0.1 * share.sum()])
            raise TopologyError(
                f"no elastic mode dominates between {self.model.nodes[0]} and {self.driven}: modes at {rivals} have "
                f"{100.0 * share[0] / share.sum():.0f} % of the flexibility in the first, permitted: more than 50 %"
            )

    @cached_property
    def flexibility(self) -> np.ndarray:
        """(modes,) ndarray: part of each mode in the motion of the driven node under a torque at the driving one."""
        shapes = self.modal_shapes
        with np.errstate(divide="ignore"):
            return shapes[0] * shapes[self.node(self.driven)] / self.modes.omega**2

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

    def tyre_stiffness(self) -> float:
        """Stiffness of the driven tyres at the wheel, infinite where one is rigid or the cut itself."""
        if not self.tyres or any(not tyre.stiffness or tyre.name in self.shafts for tyre in self.tyres):
            return np.inf
        nodes = np.array(self.model.nodes)
        return sum(self.wheel_stiffness(tyre.name, nodes == tyre.wheel) for tyre in self.tyres)

    def shaft_stiffness(self) -> float:
        """Stiffness of the cut springs at the wheel."""
        return sum(self.wheel_stiffness(shaft, self.first) for shaft in self.shafts)

    def response(self, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Driving torque to acceleration of the driven node and to speed of the driving node, at these frequencies."""
        model, seen = self.model, self.node(self.driven)
        s = 1j * omega[:, None, None]
        motion = np.linalg.solve(model.K + s * model.D + s**2 * model.M, model.T[0][None, :, None])[:, :, 0]
        return (1j * omega) ** 2 * (motion @ model.T[seen]), 1j * omega * (motion @ model.T[0])

    def two_mass(self, J1: float, stiffness: float, damping: float, rim_share: float) -> TwoMass:
        """Control model with these parameters and, of the total inertia, the rest behind the spring."""
        names = {} if self.vehicle is None else {"vehicle": self.vehicle}
        radius = None if self.vehicle is None else float(self.motion[self.node(self.vehicle)]) / self.wheel_motion
        return TwoMass(
            J1=J1,
            J2=(self.total - J1) / self.wheel_motion**2,
            stiffness=stiffness,
            damping=damping,
            ratio=1.0 / self.wheel_motion,
            radius=radius,
            rim_share=rim_share,
            driving=self.model.nodes[0],
            wheels=self.wheels,
            shaft=self.shafts[0],
            **names,
        )

    def rim_share(self, stiffness_of_tyre: float) -> float:
        """Share of the twist behind the wheel sensor: none, that of the tyre in series, or all of it."""
        if self.first[self.node(self.wheels)]:
            return 1.0
        return self.shaft_stiffness() / (self.shaft_stiffness() + stiffness_of_tyre)


def _vehicle_part(car: Driveline) -> Driveline:
    if len(car.parts()) == 1:
        return car
    moving = [node for node in car.nodes if node in car.translating]
    if not moving:
        raise TopologyError(
            "the driveline is in several parts and none carries a vehicle; choose one with car.part(node)"
        )
    return car.part(moving[0])


def _reached(car: Driveline, node: str, without: Collection[str]) -> set[str]:
    """Nodes connected with a node when these elements and the open clutches are left out."""
    links = [set(e.nodes) for e in car if e.name not in without and e.name not in car.released]
    reached: set[str] = set()
    added = {node}
    while added:
        reached |= added
        added = set().union(*(link for link in links if link & added)) - reached
    return reached


def _path(car: Driveline, start: str, end: str, without: Collection[str]) -> list[str]:
    """Elements on a shortest path between two nodes, none if there is no path without these elements."""
    came: dict[str, tuple[str, str]] = {}
    reached, border = {start}, [start]
    links = [e for e in car if e.name not in without and e.name not in car.released and len(e.nodes) > 1]
    while border and end not in reached:
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
    return names


def _source(cut: _Cut) -> TwoMass:
    return _added_up(cut, np.inf)


def _series(cut: _Cut) -> TwoMass:
    return _added_up(cut, cut.tyre_stiffness())


def _added_up(cut: _Cut, stiffness_of_tyre: float) -> TwoMass:
    """Inertias of both sides, springs in series, damping by the height of the resonance."""
    stiffness = 1.0 / (1.0 / cut.shaft_stiffness() + 1.0 / stiffness_of_tyre)
    undamped = cut.two_mass(cut.inertia(cut.first), stiffness, 0.0, cut.rim_share(stiffness_of_tyre))
    zeta = _damping_ratio_of_peak(_resonance_peak(cut))
    return replace(undamped, damping=2.0 * zeta * undamped.omega / undamped.compliance_of_inertia)


def _modal(cut: _Cut) -> TwoMass:
    """With the mass-normalised shape phi of the first mode, ``phi_1^2 = J2' / (J1 (J1 + J2'))`` as of two masses."""
    participation = cut.modal_shapes[0, 1] ** 2
    J1 = cut.total / (1.0 + participation * cut.total)
    unit = cut.two_mass(J1, 1.0, 0.0, cut.rim_share(cut.tyre_stiffness()))
    omega, zeta = cut.modes.omega[1], cut.modes.damping_ratio[1]
    compliance = unit.compliance_of_inertia
    return replace(unit, stiffness=float(omega**2 / compliance), damping=float(2.0 * zeta * omega / compliance))


def _fit(cut: _Cut) -> TwoMass:
    start = _modal(cut)
    if not start.damping:
        raise PowertrainError("an undamped driveline has no finite resonance to fit; use method='modal' or add damping")
    omega = np.linspace(0.02, 4.0, 400) * cut.modes.omega[1]
    acceleration, speed = cut.response(omega)
    scale = np.abs(acceleration).max()

    def model(parameters: np.ndarray) -> TwoMass:
        J1, stiffness, damping = np.exp(parameters) * [start.J1, start.stiffness, start.damping]
        return cut.two_mass(float(J1), float(stiffness), float(damping), start.rim_share)

    def residual(parameters: np.ndarray) -> np.ndarray:
        if np.exp(parameters[0]) * start.J1 >= cut.total:
            return np.full(3 * len(omega), 1e3)
        a, w = model(parameters).response(omega)
        error = (a - acceleration) / scale
        # the speed varies over decades: its logarithm, and little weight, decide how the inertia divides
        return np.concatenate([error.real, error.imag, 0.1 * np.log(np.abs(w / speed))])

    solution = scipy.optimize.least_squares(residual, np.zeros(3), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    if not solution.success or not np.isfinite(solution.cost):
        raise PowertrainError(f"the fit did not converge: {solution.message}")
    return model(solution.x)


METHODS = {"modal": _modal, "source": _source, "series": _series, "fit": _fit}


def _resonance_peak(cut: _Cut) -> float:
    """Largest gain from driving torque to acceleration of the driven side near the first mode, over the static gain."""
    if not cut.model.damping.any():
        return np.inf

    def gain(omega: float) -> float:
        return float(np.abs(cut.response(np.array([omega]))[0][0]))

    omega_1 = cut.modes.omega[1]
    # with much damping the peak lies far below the undamped frequency
    bounds, tolerance = (0.2 * omega_1, 1.5 * omega_1), {"xatol": 1e-10 * omega_1}
    peak = scipy.optimize.minimize_scalar(lambda omega: -gain(omega), bounds=bounds, options=tolerance)
    return -peak.fun / (abs(cut.motion[cut.node(cut.driven)]) / cut.total)


def _damping_ratio_of_peak(peak: float) -> float:
    """Damping ratio of ``(1 + 2 zeta s) / (1 + 2 zeta s + s^2)`` from its largest gain."""
    if np.isinf(peak):
        return 0.0

    def excess(zeta: float) -> float:
        x = 2.0 / (1.0 + np.sqrt(1.0 + 8.0 * zeta**2))  # (omega / omega_0)^2 at the peak
        return float(np.sqrt((1.0 + 4.0 * zeta**2 * x) / ((1.0 - x) ** 2 + 4.0 * zeta**2 * x))) - peak

    if excess(10.0) >= 0.0:
        raise TopologyError("the first mode has no resonance peak, so no control model of two masses can be fitted")
    return float(scipy.optimize.brentq(excess, 1e-9, 10.0, xtol=1e-15))
