"""Driveline elements: frozen records that state their rows (`rows`) and nothing else.

Signs: the torque through an element is positive when side ``a`` is turned ahead of side ``b``; it then
drives ``b`` and loads ``a``. Everything is SI. A node that carries a `Mass`, or is the body of a `Tyre`,
moves along the road [m], every other node turns [rad]. All values are finite, and names and nodes are identifiers.
"""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass

from .checks import AT_LEAST_ONE, NOT_NEGATIVE, NOT_ZERO, POSITIVE, checked_number
from .doors import called
from .errors import ParameterError
from .rows import Coefficients, ComplianceRow, ConstraintRow, Element, FrictionRow, InertiaRow, quantity


@called
@dataclass(frozen=True)
class Inertia(Element):
    """Turning body; it makes the node of its own name.

    Parameters
    ----------
    name : str
        Name of body and node.
    J : float
        Moment of inertia J [kg m^2], > 0.

    Raises
    ------
    ParameterError
        J that is not > 0 and finite.
    PowertrainError
        A name that is not an identifier.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Inertia("engine", J=0.3)
    Inertia(name='engine', J=0.3)
    """

    _: KW_ONLY
    J: float = quantity("kg m^2", POSITIVE)

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def inertias(self) -> tuple[InertiaRow, ...]:
        return (InertiaRow((self.name,), ((self.J,),)),)


@called
@dataclass(frozen=True)
class Mass(Element):
    """Body that moves along the road; it makes the node of its own name.

    Parameters
    ----------
    name : str
        Name of body and node.
    m : float
        Mass m [kg], > 0.

    Raises
    ------
    ParameterError
        m that is not > 0 and finite.
    PowertrainError
        A name that is not an identifier.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Mass("vehicle", m=2000.0)
    Mass(name='vehicle', m=2000.0)
    """

    _: KW_ONLY
    m: float = quantity("kg", POSITIVE)

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def translating(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def inertias(self) -> tuple[InertiaRow, ...]:
        return (InertiaRow((self.name,), ((self.m,),)),)


@dataclass(frozen=True)
class _TwoEnded(Element):
    """Element between node ``a`` (driving side) and node ``b`` (driven side)."""

    a: str
    b: str

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.a, self.b)


@called
@dataclass(frozen=True)
class SpringDamper(_TwoEnded):
    """Linear torsional spring and damper in parallel: ``torque = k * twist + d * d(twist)/dt``.

    Parameters
    ----------
    name, a, b : str
        Own name; node on the driving side; node on the driven side.
    stiffness, damping : float
        k [N m/rad], >= 0; d [N m s/rad], >= 0; not both 0. Stiffness 0 is a pure damper.
        Between two nodes that move along the road the units are N/m and N s/m.

    Raises
    ------
    ParameterError
        A negative value, or both 0.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.SpringDamper("halfshafts", "differential", "wheels", stiffness=12e3, damping=30.0).stiffness
    12000.0
    """

    _: KW_ONLY
    stiffness: float = quantity("N m/rad", NOT_NEGATIVE)
    damping: float = quantity("N m s/rad", NOT_NEGATIVE, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_one(self.stiffness, self.damping, "N m/rad")

    @property
    def compliances(self) -> tuple[ComplianceRow, ...]:
        return (ComplianceRow(self.name, {self.a: 1.0, self.b: -1.0}, self.stiffness, self.damping),)


@called
@dataclass(frozen=True)
class Shaft(_TwoEnded):
    """Elastic shaft with its own, evenly distributed inertia: consistent matrix ``J/6 [[2, 1], [1, 2]]``.

    Split a long shaft into several to see its own higher modes; the linear finite element is
    that of Przemieniecki, Theory of Matrix Structural Analysis (1968), chapter 11.

    Parameters
    ----------
    name, a, b : str
        Own name; node on the driving side; node on the driven side.
    stiffness, inertia, damping : float
        k [N m/rad], > 0; J of the whole shaft [kg m^2], > 0; d [N m s/rad], >= 0.

    Raises
    ------
    ParameterError
        Stiffness or inertia that is not > 0, damping that is not >= 0.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Shaft("propshaft", "gearbox", "axle", stiffness=2e4, inertia=0.06).inertias[0].matrix
    ((0.02, 0.01), (0.01, 0.02))
    """

    _: KW_ONLY
    stiffness: float = quantity("N m/rad", POSITIVE)
    inertia: float = quantity("kg m^2", POSITIVE)
    damping: float = quantity("N m s/rad", NOT_NEGATIVE, default=0.0)

    @property
    def inertias(self) -> tuple[InertiaRow, ...]:
        third, sixth = self.inertia / 3.0, self.inertia / 6.0
        return (InertiaRow((self.a, self.b), ((third, sixth), (sixth, third))),)

    @property
    def compliances(self) -> tuple[ComplianceRow, ...]:
        return (ComplianceRow(self.name, {self.a: 1.0, self.b: -1.0}, self.stiffness, self.damping),)


@called
@dataclass(frozen=True)
class Drag(Element):
    """Damper, and if wanted spring, from a node to ground.

    Parameters
    ----------
    name, node : str
        Own name; the node it holds.
    damping, stiffness : float
        d [N m s/rad], k [N m/rad]; both >= 0, not both 0 (N s/m and N/m on a node that moves along the road).

    Raises
    ------
    ParameterError
        A negative value, or both 0.
    PowertrainError
        A name or node that is not an identifier.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Drag("bearing", "engine", damping=0.05).compliances[0].coefficients
    {'engine': 1.0}
    """

    node: str
    _: KW_ONLY
    damping: float = quantity("N m s/rad", NOT_NEGATIVE)
    stiffness: float = quantity("N m/rad", NOT_NEGATIVE, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_one(self.stiffness, self.damping, "N m/rad")

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.node,)

    @property
    def compliances(self) -> tuple[ComplianceRow, ...]:
        return (ComplianceRow(self.name, {self.node: 1.0}, self.stiffness, self.damping),)


@called
@dataclass(frozen=True)
class Gear(_TwoEnded):
    """Rigid gear pair, equation (2.1): ``omega_a = ratio * omega_b``.

    Parameters
    ----------
    name, a, b : str
        Own name; node on the driving side; node on the driven side.
    ratio : float
        i = omega_a / omega_b [-], not 0; negative where the direction of rotation changes.

    Raises
    ------
    ParameterError
        Ratio 0 or not finite.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Gear("gearbox", "input", "output", ratio=6.0).constraints[0].coefficients
    {'input': 1.0, 'output': -6.0}
    """

    _: KW_ONLY
    ratio: float = quantity("", NOT_ZERO)

    @property
    def constraints(self) -> tuple[ConstraintRow, ...]:
        return (ConstraintRow(self.name, {self.a: 1.0, self.b: -self.ratio}),)


@called
@dataclass(frozen=True)
class Planetary(Element):
    """Planetary gear set: ``omega_sun + i0 omega_ring = (1 + i0) omega_carrier`` (Willis).

    One equation for three speeds, so two of the three nodes need inertia: of a differential, its case and a side gear.

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
class Clutch(Element):
    """Dry friction clutch between two nodes, or a brake when ``b`` is None.

    Slipping, it transmits its capacity against the slip ``omega_a - omega_b``; stuck, whatever keeps the slip at zero,
    up to ``static_ratio`` times the capacity.

    Parameters
    ----------
    name, a : str
        Own name; node on the driving side.
    b : str or None
        Node on the driven side; None for a brake against ground.
    max_torque : float
        Capacity [N m], >= 0, where no ``<name>_capacity`` input is given.
    static_ratio : float
        Static over kinetic friction [-], >= 1.

    Raises
    ------
    ParameterError
        Capacity that is not >= 0, static ratio that is not >= 1.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Clutch("clutch", "flywheel", "input_shaft", max_torque=400.0).frictions[0].coefficients
    {'flywheel': 1.0, 'input_shaft': -1.0}
    >>> pt.Clutch("brake", "ring", max_torque=900.0).nodes
    ('ring',)
    """

    a: str
    b: str | None = None
    _: KW_ONLY
    max_torque: float = quantity("N m", NOT_NEGATIVE)
    static_ratio: float = quantity("", AT_LEAST_ONE, default=1.0)

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.a,) if self.b is None else (self.a, self.b)

    @property
    def frictions(self) -> tuple[FrictionRow, ...]:
        coefficients = {self.a: 1.0} if self.b is None else {self.a: 1.0, self.b: -1.0}
        return (FrictionRow(self.name, coefficients, self.max_torque, self.static_ratio),)


@dataclass(frozen=True)
class _Combination(Element):
    """Element on a linear combination of node motions."""

    coefficients: Mapping[str, float]

    def __post_init__(self) -> None:
        if not isinstance(self.coefficients, Mapping) or not self.coefficients:
            raise ParameterError(self.name, "coefficients", self.coefficients, "", "{node: coefficient, ...}")
        checked = {
            node: checked_number(self.name, f'coefficient of "{node}"', value, "", NOT_ZERO)
            for node, value in self.coefficients.items()
        }
        object.__setattr__(self, "coefficients", Coefficients(checked))
        super().__post_init__()

    @property
    def nodes(self) -> tuple[str, ...]:
        return tuple(self.coefficients)


@called
@dataclass(frozen=True)
class Compliance(_Combination):
    """Spring and damper on ``twist = sum(coefficient * motion)``, for whatever has no element of its own.

    Parameters
    ----------
    name : str
        Own name.
    coefficients : mapping
        Node to coefficient, e.g. ``{"engine": 1, "axle": -18}``.
    stiffness, damping : float
        On the twist [N m/rad], [N m s/rad]; >= 0, not both 0.

    Raises
    ------
    ParameterError
        No mapping or an empty one, a coefficient that is 0 or not finite, a negative value, or both 0.
    PowertrainError
        A name or node that is not an identifier.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> mesh = pt.Compliance("mesh", {"pinion": 0.04, "wheel": 0.12}, stiffness=2e8)
    >>> mesh.nodes
    ('pinion', 'wheel')
    """

    _: KW_ONLY
    stiffness: float = quantity("N m/rad", NOT_NEGATIVE)
    damping: float = quantity("N m s/rad", NOT_NEGATIVE, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_one(self.stiffness, self.damping, "N m/rad")

    @property
    def compliances(self) -> tuple[ComplianceRow, ...]:
        return (ComplianceRow(self.name, dict(self.coefficients), self.stiffness, self.damping),)


@called
@dataclass(frozen=True)
class Constraint(_Combination):
    """``sum(coefficient * speed) = 0``, for whatever has no element of its own; one node alone is held at rest.

    Parameters
    ----------
    name : str
        Own name.
    coefficients : mapping
        Node to coefficient; a gear on a moving support is ``{"a": 1, "b": -i, "support": i - 1}``.

    Raises
    ------
    ParameterError
        No mapping or an empty one, or a coefficient that is 0 or not finite.
    PowertrainError
        A name or node that is not an identifier.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Constraint("mesh", {"a": 1, "b": -3, "support": 2}).constraints[0].coefficients["support"]
    2.0
    """

    @property
    def constraints(self) -> tuple[ConstraintRow, ...]:
        return (ConstraintRow(self.name, dict(self.coefficients)),)


ELEMENT_TYPES: dict[str, type[Element]] = {
    cls.__name__: cls
    for cls in (
        Inertia,
        Mass,
        SpringDamper,
        Shaft,
        Drag,
        Gear,
        Planetary,
        Tyre,
        Clutch,
        Compliance,
        Constraint,
    )
}
