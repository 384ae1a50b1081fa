"""Two-mass control models of a driveline."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.optimize

from .assembly import as_driveline, assemble
from .driveline import Driveline
from .elements import Clutch, Compliance, Constraint, Gear, Inertia, Tyre
from .errors import PowertrainError, TopologyError
from .modal import modes
from .units import to_hz

METHODS = ("source",)


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

    def __repr__(self) -> str:
        radius = "" if self.radius is None else f", radius = {self.radius:.4g} m"
        rim = f", {100 * self.rim_share:.1f} % of the twist in the tyre" if self.rim_share else ""
        return (
            f"TwoMass: f = {self.frequency_hz:.3f} Hz, zeta = {self.damping_ratio:.4f}\n"
            f"  J1 = {self.J1:.4g} kg m^2 ({self.driving}), J2 = {self.J2:.6g} kg m^2 ({self.wheels}), "
            f"ratio = {self.ratio:.6g}{radius}\n"
            f"  stiffness = {self.stiffness:.6g} N m/rad, damping = {self.damping:.6g} N m s/rad ({self.shaft}){rim}"
        )


def two_mass(car, method: str = "source") -> TwoMass:
    """Two-mass control model of a driveline; with an open clutch, of the part that carries the vehicle.

    Parameters
    ----------
    car : Driveline
    method : {"source"}
        "source": equations (2.14), (2.22). The driveline is cut at the spring that twists most in the first mode; the
        inertias on either side are added up, the spring keeps its stiffness, and the damping is chosen
        so that the resonance peak of torque to vehicle acceleration is that of the detailed model.

    Returns
    -------
    TwoMass

    Raises
    ------
    TopologyError
        No elastic mode, more than one rigid motion, or a spring that does not divide the driveline in two.

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
    """
    if method not in METHODS:
        raise PowertrainError(f"method = {method!r}, permitted: {', '.join(map(repr, METHODS))}")
    return _source(_Cut(as_driveline(car)))


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


class _Cut:
    """A driveline divided in two at the spring that twists most in its first elastic mode."""

    def __init__(self, car: Driveline):
        self.car = _vehicle_part(car)
        self.model = model = assemble(self.car)
        self.modes = modes(self.car)
        first = self.modes.n_rigid
        if first != 1 or len(self.modes) < 2:
            raise TopologyError(
                "a two-mass model needs one rigid motion and an elastic mode; "
                f"there are {first} and {len(self.modes) - first}"
            )
        self.shaft = self.modes.dominant_compliance(first)
        driving = self.car.nodes[0]
        self.motion = model.rigid_motion / model.rigid_motion[0]
        sides = Driveline(*(e for e in self.car if e.name != self.shaft)).parts()
        if len(sides) != 2:
            raise TopologyError(
                f"{self.shaft} twists most in the first mode, but cutting it does not divide the driveline in two"
            )
        self.first = np.array([node in next(s for s in sides if driving in s) for node in model.nodes])
        self.wheels = self._wheel_node()
        self.vehicle = next((node for node in model.nodes if node in model.translating), None)

    def _wheel_node(self) -> str:
        """Wheel of a tyre, else the node behind the spring."""
        for element in self.car:
            if isinstance(element, Tyre):
                return element.wheel
        ends = self.model.E[self.model.compliances.index(self.shaft)]
        return self.model.nodes[int(np.flatnonzero((ends != 0.0) & ~self.first)[0])]

    def inertia(self, side: np.ndarray) -> float:
        """Inertia of one side, at the speed of the driving node."""
        motion = np.where(side, self.motion, 0.0)
        return float(motion @ self.model.J @ motion)

    def stiffness(self, wheel_motion: float) -> float:
        """Stiffness of the spring, at the wheel."""
        row = self.model.compliances.index(self.shaft)
        twist = self.model.E[row] @ np.where(self.first, self.motion, 0.0) / wheel_motion
        return float(self.model.stiffness[row] * twist**2)


def _vehicle_part(car: Driveline) -> Driveline:
    if len(car.parts()) == 1:
        return car
    moving = [node for node in car.nodes if node in car.translating]
    if not moving:
        raise TopologyError(
            "the driveline is in several parts and none carries a vehicle; choose one with car.part(node)"
        )
    return car.part(moving[0])


def _source(cut: _Cut) -> TwoMass:
    model = cut.model
    wheel_motion = float(cut.motion[model.nodes.index(cut.wheels)])
    radius = None if cut.vehicle is None else float(cut.motion[model.nodes.index(cut.vehicle)]) / wheel_motion
    parameters = {
        "J1": cut.inertia(cut.first),
        "J2": cut.inertia(~cut.first) / wheel_motion**2,
        "stiffness": cut.stiffness(wheel_motion),
        "ratio": 1.0 / wheel_motion,
        "radius": radius,
        "rim_share": 1.0 if cut.first[model.nodes.index(cut.wheels)] else 0.0,
        "driving": model.nodes[0],
        "wheels": cut.wheels,
        "shaft": cut.shaft,
    }
    if cut.vehicle is not None:
        parameters["vehicle"] = cut.vehicle
    undamped = TwoMass(damping=0.0, **parameters)
    zeta = _damping_ratio_of_peak(_resonance_peak(cut))
    return TwoMass(damping=2.0 * zeta * undamped.omega / undamped.compliance_of_inertia, **parameters)


def _resonance_peak(cut: _Cut) -> float:
    """Largest gain from driving torque to acceleration of the driven side near the first mode, over the static gain."""
    model = cut.model
    if not model.damping.any():
        return np.inf
    seen = model.nodes.index(cut.vehicle or cut.wheels)

    def gain(omega: float) -> float:
        impedance = model.K + 1j * omega * model.D - omega**2 * model.M
        return float(abs(omega**2 * model.T[seen] @ np.linalg.solve(impedance, model.T[0])))

    omega_1 = cut.modes.omega[1]
    peak = scipy.optimize.minimize_scalar(
        lambda w: -gain(w), bounds=(0.5 * omega_1, 1.5 * omega_1), options={"xatol": 1e-10 * omega_1}
    )
    static = abs(cut.motion[seen]) / cut.inertia(np.ones_like(cut.first))
    return -peak.fun / static


def _damping_ratio_of_peak(peak: float) -> float:
    """Damping ratio of ``(1 + 2 zeta s) / (1 + 2 zeta s + s^2)`` from its largest gain."""
    if np.isinf(peak):
        return 0.0

    def excess(zeta: float) -> float:
        x = 2.0 / (1.0 + np.sqrt(1.0 + 8.0 * zeta**2))  # (omega / omega_0)^2 at the peak
        return float(np.sqrt((1.0 + 4.0 * zeta**2 * x) / ((1.0 - x) ** 2 + 4.0 * zeta**2 * x))) - peak

    if peak <= excess(10.0) + peak:
        raise TopologyError(
            "the first mode has no resonance peak, so no control model of two masses can be fitted to it"
        )
    return float(scipy.optimize.brentq(excess, 1e-9, 10.0, xtol=1e-15))
