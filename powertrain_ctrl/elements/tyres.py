"""Tyres: from what turns to what moves along the road."""

from dataclasses import KW_ONLY, dataclass

from ..base.checks import NOT_NEGATIVE, POSITIVE
from ..base.doors import called
from ..base.errors import ParameterError, PowertrainError
from .element import ComplianceRow, ConstraintRow, Element, OperatingPoint, quantity
from .laws import Guard, Law, Mode
from .springs import SpringDamper


@called
@dataclass(frozen=True)
class Tyre(Element):
    """Tyre of a rolling wheel: a spring and damper between wheel and body, or rigid rolling.

    Its twist is that of the wheel, ``phi_wheel - s_body / radius`` [rad], its torque acts about the wheel axis
    [N m]; the force on the road is torque / radius. Hence ``k = stiffness radius^2`` as in equation (2.6).

    Parameters
    ----------
    name, wheel, body : str
        Own name; the turning node; the node that moves along the road.
    radius : float
        Dynamic rolling radius r [m], > 0.
    stiffness, damping : float
        Longitudinal, at the contact [N/m], [N s/m]; >= 0, not both 0. Stiffness None is rigid rolling, without damping.

    Raises
    ------
    ParameterError
        Radius that is not > 0, a negative value, stiffness and damping both 0, or damping with rigid rolling.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> round(pt.Tyre("tyres", "wheels", "vehicle", radius=0.35, stiffness=9.8e5).compliances[0].stiffness, 3)
    120050.0
    """

    wheel: str
    body: str
    _: KW_ONLY
    radius: float = quantity("m", POSITIVE)
    stiffness: float | None = quantity("N/m", NOT_NEGATIVE, default=None, optional=True)
    damping: float = quantity("N s/m", NOT_NEGATIVE, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.stiffness is None:
            if self.damping:
                raise ParameterError(
                    self.name, "damping", self.damping, "N s/m", "0 for rigid rolling (stiffness None)"
                )
        else:
            self._require_one(self.stiffness, self.damping, "N/m")

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.wheel, self.body)

    @property
    def translating(self) -> tuple[str, ...]:
        return (self.body,)

    @property
    def _rolling(self) -> dict[str, float]:
        return {self.wheel: 1.0, self.body: -1.0 / self.radius}

    @property
    def compliances(self) -> tuple[ComplianceRow, ...]:
        if self.stiffness is None:
            return ()
        square = self.radius**2
        return (ComplianceRow(self.name, self._rolling, self.stiffness * square, self.damping * square),)

    @property
    def constraints(self) -> tuple[ConstraintRow, ...]:
        return () if self.stiffness is not None else (ConstraintRow(self.name, self._rolling),)


@called
@dataclass(frozen=True)
class SlipTyre(Element):
    """Tyre with slip: a force that follows the slip over a relaxation length, and does not exceed a limit.

    ``F = C / sigma z``, ``z' = v_slip - V / sigma z`` with ``v_slip = radius omega - v``: Pacejka, Tyre and Vehicle Dynamics
    (2012), chapter 7, a single contact point. At rest (V = 0) it is a spring C / sigma, without relaxation a damper C / V.
    At ``max_force`` the relaxing state stands still until the slip falls. Its torque acts about the wheel axis [N m].

    Parameters
    ----------
    name, wheel, body : str
        Own name; the turning node; the node that moves along the road.
    radius : float
        Dynamic rolling radius [m], > 0.
    slip_stiffness : float
        C [N], > 0: force per slip (slip speed over travelling speed).
    relaxation_length : float
        sigma [m], >= 0.
    speed : float or None
        Travelling speed V [m/s] at which it is taken, >= 0; > 0 without relaxation. None is given by
        ``car.at(speed=...)``.
    max_force : float or None
        Largest force [N], > 0; None is no limit.

    Raises
    ------
    ParameterError
        A value that is not permitted, a speed of 0 without relaxation.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends. Of a driveline that is simulated: no speed.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> tyre = pt.SlipTyre("tyres", "wheels", "vehicle", radius=0.3, slip_stiffness=1.2e5, relaxation_length=0.3, speed=10.0)
    >>> mode = tyre.laws[0].modes[0]
    >>> round(mode.stiffness), round(1.0 / mode.leak, 9)
    (36000, 0.03)
    """

    wheel: str
    body: str
    _: KW_ONLY
    radius: float = quantity("m", POSITIVE)
    slip_stiffness: float = quantity("N", POSITIVE)
    relaxation_length: float = quantity("m", NOT_NEGATIVE, default=0.0)
    speed: float | None = quantity("m/s", NOT_NEGATIVE, default=None, optional=True)
    max_force: float | None = quantity("N", POSITIVE, default=None, optional=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.speed == 0.0 and not self.relaxation_length:
            raise ParameterError(self.name, "speed", 0.0, "m/s", "> 0 without a relaxation_length")

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.wheel, self.body)

    @property
    def translating(self) -> tuple[str, ...]:
        return (self.body,)

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        speed = self.speed if self.speed is not None else point.speed.get(self.body)
        if speed is None:
            raise PowertrainError(
                f'{self.name}: needs a travelling speed; give it, e.g. car.at(speed={{"{self.body}": 20.0}})'
            )
        speed, length = abs(speed), self.relaxation_length
        if not (speed or length):
            raise PowertrainError(f"{self.name}: speed = 0 m/s, permitted: not 0 without a relaxation_length")
        if not length:
            return (
                Tyre(
                    self.name,
                    self.wheel,
                    self.body,
                    radius=self.radius,
                    stiffness=0.0,
                    damping=self.slip_stiffness / speed,
                ),
            )
        if not speed:
            return (Tyre(self.name, self.wheel, self.body, radius=self.radius, stiffness=self.slip_stiffness / length),)
        # a spring in series with a damper
        contact, stiffness = f"{self.name}_contact", self.slip_stiffness * self.radius**2 / length
        damper = Tyre(
            f"{self.name}_slip",
            contact,
            self.body,
            radius=self.radius,
            stiffness=0.0,
            damping=self.slip_stiffness / speed,
        )
        return (SpringDamper(self.name, self.wheel, contact, stiffness=stiffness), damper)

    @property
    def laws(self) -> tuple[Law, ...]:
        rolling = {self.wheel: 1.0, self.body: -1.0 / self.radius}
        limit = None if self.max_force is None else self.max_force * self.radius
        if self.speed is None:
            return (Law(self.name, rolling, {}),)
        if not self.relaxation_length:
            return (saturated(self.name, rolling, self.slip_stiffness * self.radius**2 / self.speed, limit),)
        stiffness = self.slip_stiffness * self.radius**2 / self.relaxation_length
        return (relaxing(self.name, rolling, stiffness, self.speed / self.relaxation_length, limit),)


def relaxing(name: str, coefficients: dict[str, float], stiffness: float, leak: float, limit: float | None) -> Law:
    """Spring [N m/rad] whose stretch fades by itself [1/s] and stands still while its torque is at a limit [N m]."""
    if limit is None:
        mode = Mode("adhering", stiffness=stiffness, follows=True, leak=leak, stored=stiffness)
        return Law(name, coefficients, {0: mode})
    reach = limit / stiffness
    ends = (Guard(1, stretch=-1.0, level=reach), Guard(-1, stretch=1.0, level=reach))
    modes = {0: Mode("adhering", ends, "lock", stiffness=stiffness, follows=True, leak=leak, stored=stiffness)}
    for side, word in ((1, "forward"), (-1, "backward")):
        back = Guard(0, slip=float(side), level=-leak * reach)
        modes[side] = Mode(f"limit {word}", (back,), "slip", torque=side * limit, heats=True, stored=stiffness)
    return Law(name, coefficients, modes)


def saturated(name: str, coefficients: dict[str, float], damping: float, limit: float | None) -> Law:
    """Damper [N m s/rad] up to a limit [N m]."""
    if limit is None:
        return Law(name, coefficients, {0: Mode("adhering", damping=damping)}, memoryless=True)
    reach = limit / damping
    modes = {
        0: Mode(
            "adhering", (Guard(1, slip=-1.0, level=reach), Guard(-1, slip=1.0, level=reach)), "lock", damping=damping
        )
    }
    for side, word in ((1, "forward"), (-1, "backward")):
        back = Guard(0, slip=float(side), level=-reach)
        modes[side] = Mode(f"limit {word}", (back,), "slip", torque=side * limit, heats=True)
    return Law(name, coefficients, modes, memoryless=True)
