"""Springs, dampers and elastic shafts."""

from dataclasses import KW_ONLY, dataclass, replace
from math import pi

from ..base.checks import NOT_NEGATIVE, POSITIVE, checked_number
from ..base.doors import called
from ..base.errors import ParameterError
from .element import ComplianceRow, Element, InertiaRow, OperatingPoint, TwoEnded, quantity
from .frictions import coulomb
from .laws import Law


@called
@dataclass(frozen=True)
class SpringDamper(TwoEnded):
    """Linear torsional spring and damper in parallel: ``torque = k * twist + d * d(twist)/dt``.

    Parameters
    ----------
    name, a, b : str
        Own name; node on the driving side; node on the driven side.
    stiffness, damping : float
        k [N m/rad], >= 0; d [N m s/rad], >= 0; not both 0. Stiffness 0 is a pure damper.
        Between two nodes that move along the road the units are N/m and N s/m.
    loss_factor : float
        Structural damping eta [-], >= 0: ``k (1 + j eta)`` in steady harmonic motion, in `frequency_response`,
        `forced_response`, `order_response` and, as damping ratio, in `modes`. What computes over time refuses it.

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
    loss_factor: float = quantity("", NOT_NEGATIVE, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self._require_one(self.stiffness, self.damping, "N m/rad")

    @property
    def compliances(self) -> tuple[ComplianceRow, ...]:
        ends = {self.a: 1.0, self.b: -1.0}
        return (ComplianceRow(self.name, ends, self.stiffness, self.damping, self.loss_factor),)


@called
@dataclass(frozen=True)
class Shaft(TwoEnded):
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

    @classmethod
    @called
    def from_geometry(
        cls,
        name: str,
        a: str,
        b: str,
        *,
        length: float,
        outer_diameter: float,
        inner_diameter: float = 0.0,
        shear_modulus: float = 79.3e9,
        density: float = 7850.0,
        damping: float = 0.0,
    ) -> "Shaft":
        """Solid or hollow round shaft: ``k = G I / L``, ``J = rho I L`` with ``I = pi (D^4 - d^4) / 32``.

        Saint-Venant torsion of a circular section (Timoshenko, Strength of Materials, part 1, chapter 10).

        Parameters
        ----------
        name, a, b : str
            Own name; node on the driving side; node on the driven side.
        length, outer_diameter, inner_diameter : float
            L and D [m], > 0; d [m], >= 0 and below D.
        shear_modulus, density : float
            G [N/m^2] and rho [kg/m^3], > 0; those of steel if not given.
        damping : float
            d [N m s/rad], >= 0.

        Returns
        -------
        Shaft

        Raises
        ------
        ParameterError
            A value that is not > 0, an inner diameter that leaves no wall.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> size = {"length": 1.5, "outer_diameter": 0.06, "inner_diameter": 0.055}
        >>> tube = pt.Shaft.from_geometry("propshaft", "gearbox", "axle", **size)
        >>> round(tube.stiffness, 1), round(tube.inertia, 6)
        (19771.3, 0.004404)
        """
        given = {
            "length": (length, "m"),
            "outer_diameter": (outer_diameter, "m"),
            "shear_modulus": (shear_modulus, "N/m^2"),
            "density": (density, "kg/m^3"),
        }
        L, D, G, rho = (checked_number(name, what, value, unit, POSITIVE) for what, (value, unit) in given.items())
        d = checked_number(name, "inner_diameter", inner_diameter, "m", NOT_NEGATIVE)
        if d >= D:
            raise ParameterError(name, "inner_diameter", d, "m", f"below {D:g}, the outer diameter")
        area = pi * (D**4 - d**4) / 32.0
        return cls(name, a, b, stiffness=G * area / L, inertia=rho * area * L, damping=damping)

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
    """Damper, and if wanted spring or Coulomb friction, from a node to ground.

    Parameters
    ----------
    name, node : str
        Own name; the node it holds.
    damping, stiffness : float
        d [N m s/rad], k [N m/rad]; both >= 0 (N s/m and N/m on a node that moves along the road).
    friction : float
        Coulomb friction [N m], >= 0 (N along the road): against the motion, and up to as much at rest. With it the
        driveline is not linear: `simulate` follows it exactly, for linear models take ``car.at(...)``.

    Raises
    ------
    ParameterError
        A negative value, or all of them 0.
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
    friction: float = quantity("N m", NOT_NEGATIVE, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.friction:
            self._require_one(self.stiffness, self.damping, "N m/rad")

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.node,)

    @property
    def compliances(self) -> tuple[ComplianceRow, ...]:
        if not (self.stiffness or self.damping):
            return ()
        return (ComplianceRow(self.name, {self.node: 1.0}, self.stiffness, self.damping),)

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        return (replace(self, friction=0.0),) if self.compliances else ()

    @property
    def laws(self) -> tuple[Law, ...]:
        if not self.friction:
            return ()
        return (coulomb(f"{self.name}_friction", {self.node: 1.0}, self.friction, self.name),)
