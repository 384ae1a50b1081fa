"""Rigid gears: a pair, a planetary set."""

from dataclasses import KW_ONLY, dataclass, replace

from ..base.checks import NOT_ZERO, PART
from ..base.doors import called
from ..base.errors import ParameterError
from .element import ConstraintRow, Element, OperatingPoint, TwoEnded, quantity
from .frictions import load_friction
from .laws import Law


@called
@dataclass(frozen=True)
class Gear(TwoEnded):
    """Rigid gear pair, equation (2.1): ``omega_a = ratio * omega_b``.

    With an efficiency below 1 a part of the power that enters it, on whichever side, leaves it as heat:
    ``T_b = ratio * efficiency * T_a`` while a drives, ``T_a = efficiency * T_b / ratio`` while b does, as ``LossyGear`` of
    the Modelica Standard Library 4.0 with ``eta_mf1 = eta_mf2`` and no bearing friction. At standstill it holds what lies
    between the two. ``<name>_torque`` is what that takes, a friction at the side of a; ``slip_energy`` has its heat. An
    impact goes through without loss.

    Parameters
    ----------
    name, a, b : str
        Own name; node on the driving side; node on the driven side.
    ratio : float
        i = omega_a / omega_b [-], not 0; negative where the direction of rotation changes.
    efficiency : float, optional
        Power out over power in [-], in either direction, > 0 and <= 1. For small motion about an operating point,
        `Driveline.at`, its loss is left out, as friction is.

    Raises
    ------
    ParameterError
        Ratio 0 or not finite, an efficiency out of range.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Gear("gearbox", "input", "output", ratio=6.0).constraints[0].coefficients
    {'input': 1.0, 'output': -6.0}

    Of what 100 N m do on 1 kg m^2 behind it, 5 % is heat:

    >>> gear = pt.Gear("gearbox", "input", "output", ratio=6.0, efficiency=0.95)
    >>> car = pt.Driveline(pt.Inertia("input", J=1e-9), gear, pt.Inertia("output", J=1.0))
    >>> response = pt.simulate(car, [0.0, 1.0], {"input_torque": 100.0})
    >>> round(float(response["output_speed"][-1]), 3), round(response.slip_energy["gearbox"] / (0.5 * 570.0**2), 4)
    (570.0, 0.0526)
    """

    _: KW_ONLY
    ratio: float = quantity("", NOT_ZERO)
    efficiency: float = quantity("", PART, default=1.0)

    @property
    def constraints(self) -> tuple[ConstraintRow, ...]:
        return (ConstraintRow(self.name, {self.a: 1.0, self.b: -self.ratio}),)

    @property
    def laws(self) -> tuple[Law, ...]:
        if self.efficiency == 1.0:
            return ()
        return (load_friction(self.name, self.a, self.constraints[0].coefficients, self.efficiency),)

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        return (replace(self, efficiency=1.0),)


@called
@dataclass(frozen=True)
class Planetary(Element):
    """Planetary gear set: ``omega_sun + i0 omega_ring = (1 + i0) omega_carrier`` (Willis).

    One equation for three speeds, so two of the three nodes need inertia or springs to what has some. With ratio 1 it is a
    `Differential`.

    Parameters
    ----------
    name, sun, ring, carrier : str
        Own name and the three nodes.
    ratio : float
        i0 = teeth of the ring / teeth of the sun [-], not 0 and not -1; negative for double pinions; a differential
        has 1.

    Raises
    ------
    ParameterError
        Ratio 0, -1 (the carrier would drop out of the equation) or not finite.
    PowertrainError
        A name or node that is not an identifier, or the same node twice.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Planetary("differential", "left", "right", "case", ratio=1.0).constraints[0].coefficients
    {'left': 1.0, 'right': 1.0, 'case': -2.0}
    """

    sun: str
    ring: str
    carrier: str
    _: KW_ONLY
    ratio: float = quantity("", NOT_ZERO)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.ratio == -1.0:
            raise ParameterError(self.name, "ratio", self.ratio, "", "not 0 and not -1 (the carrier would drop out)")

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.sun, self.ring, self.carrier)

    @property
    def constraints(self) -> tuple[ConstraintRow, ...]:
        return (ConstraintRow(self.name, {self.sun: 1.0, self.ring: self.ratio, self.carrier: -(1.0 + self.ratio)}),)
