"""What an element states: four kinds of rows and laws, and values that are checked at the door.

==========  ==========================================================================
row         meaning
==========  ==========================================================================
inertia     inertia at one node, or a consistent inertia matrix over several
compliance  spring and damper on a linear combination of node motions (the *twist*)
constraint  a linear combination of node speeds that is always zero
coupling    torques on several nodes that depend on all their speeds (linear models alone)
law         what is nonlinear, on a linear combination of node motions (see `laws`)
==========  ==========================================================================
"""

from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from functools import cache
from typing import Any, NamedTuple

from ..base.checks import SMALLEST, checked_number
from ..base.errors import ParameterError, PowertrainError
from .laws import Law


class InertiaRow(NamedTuple):
    """Inertia matrix over ``nodes`` [kg m^2, or kg for a node that moves along the road]."""

    nodes: tuple[str, ...]
    matrix: tuple[tuple[float, ...], ...]


class ComplianceRow(NamedTuple):
    """``torque = stiffness * twist + damping * d(twist)/dt``, ``twist = sum(coefficient * motion)``.

    In steady harmonic motion the stiffness is ``stiffness * (1 + j loss_factor)``.
    """

    name: str
    coefficients: dict[str, float]
    stiffness: float
    damping: float
    loss_factor: float = 0.0


class ConstraintRow(NamedTuple):
    """``sum(coefficient * speed) = 0``."""

    name: str
    coefficients: dict[str, float]


class CouplingRow(NamedTuple):
    """Torques ``-damping speeds`` on ``nodes`` [N m s/rad], a matrix that need not be symmetric."""

    name: str
    nodes: tuple[str, ...]
    damping: tuple[tuple[float, ...], ...]


class OperatingPoint(NamedTuple):
    """Where a driveline is linearised: the mode of each law by its name, the speed of each node [rad/s or m/s].

    Without a given speed there are none.
    """

    modes: Mapping[str, int]
    speed: Mapping[str, float]


class Coefficients(dict[str, float]):
    """Node to coefficient, unchangeable like the element that holds it, so that what is kept of a driveline stays true."""

    def _refuse(self, *args: Any, **kwargs: Any) -> Any:
        raise TypeError("coefficients of an element do not change; take car.replace(name, coefficients=...)")

    __setitem__ = __delitem__ = __ior__ = _refuse
    clear = pop = popitem = setdefault = update = _refuse

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(frozenset(self.items()))

    def __reduce__(self) -> tuple:
        return (type(self), (dict(self),))


def quantity(unit: str, permitted: str, default: Any = MISSING, optional: bool = False) -> Any:
    """Field of a physical value: unit and permitted range live with the field, for checks and files."""
    return field(default=default, metadata={"unit": unit, "permitted": permitted, "optional": optional})


def smallest_of(item: Field) -> float:
    """Least size but 0 of a value; a damper may be as weak as it likes: nothing is divided by it."""
    return 0.0 if item.name == "damping" else SMALLEST


class Statement(NamedTuple):
    """What an element states."""

    inertias: tuple[InertiaRow, ...]
    compliances: tuple[ComplianceRow, ...]
    constraints: tuple[ConstraintRow, ...]
    laws: tuple[Law, ...]
    couplings: tuple[CouplingRow, ...] = ()


class _Quantity(NamedTuple):
    """What is asked of a value of an element."""

    name: str
    unit: str
    permitted: str
    optional: bool
    smallest: float


@cache
def _quantities(kind: type) -> tuple[_Quantity, ...]:
    found = []
    for item in fields(kind):
        if "permitted" in item.metadata:
            unit, permitted, optional = (item.metadata[key] for key in ("unit", "permitted", "optional"))
            found.append(_Quantity(item.name, unit, permitted, optional, smallest_of(item)))
    return tuple(found)


@dataclass(frozen=True)
class Element:
    """Common part of all elements: the name, the checks and, by default, no rows at all.

    Raises
    ------
    ParameterError
        A value that is not a number or outside the range its element states.
    PowertrainError
        A name or node that is not an identifier; an element that connects a node with itself.
    """

    name: str

    def __post_init__(self) -> None:
        _check_identifier(self.name, f"{type(self).__name__} name")
        for each in _quantities(type(self)):  # type: ignore[arg-type]  # a class has a hash
            value = getattr(self, each.name)
            if value is not None or not each.optional:
                value = checked_number(self.name, each.name, value, each.unit, each.permitted, each.smallest)
                object.__setattr__(self, each.name, value)
        ends = self.nodes
        for node in ends:
            _check_identifier(node, f"{self.name}: node")
        if len(set(ends)) < len(ends):
            raise PowertrainError(f'{self.name}: connects node "{ends[0]}" with itself, permitted: different nodes')

    def _require_one(self, stiffness: float, damping: float, unit: str) -> None:
        if not (stiffness or damping):
            permitted = "> 0, or 0 together with damping > 0 (a pure damper)"
            raise ParameterError(self.name, "stiffness", stiffness, unit, permitted)

    @property
    def nodes(self) -> tuple[str, ...]:
        """Nodes the element touches."""
        return ()

    @property
    def translating(self) -> tuple[str, ...]:
        """Those of its nodes that must move along the road."""
        return ()

    @property
    def inertias(self) -> tuple[InertiaRow, ...]:
        """Inertia matrices of its nodes."""
        return ()

    @property
    def compliances(self) -> tuple[ComplianceRow, ...]:
        """Springs and dampers on combinations of node motions."""
        return ()

    @property
    def constraints(self) -> tuple[ConstraintRow, ...]:
        """Combinations of node speeds that are always zero."""
        return ()

    @property
    def couplings(self) -> tuple[CouplingRow, ...]:
        """Torques on its nodes that depend on all their speeds."""
        return ()

    @property
    def laws(self) -> tuple[Law, ...]:
        """What is nonlinear: clutches, brakes, play."""
        return ()

    def linearised(self, point: OperatingPoint) -> tuple["Element", ...] | None:
        """Elements in its place for small motion about a point; None for what its rows and the modes of its laws say."""
        return None


def statement_of(element: Element) -> Statement:
    return Statement(element.inertias, element.compliances, element.constraints, element.laws, element.couplings)


@dataclass(frozen=True)
class TwoEnded(Element):
    """Element between node ``a`` (driving side) and node ``b`` (driven side)."""

    a: str
    b: str

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.a, self.b)


def _check_identifier(name: object, what: str) -> None:
    if not isinstance(name, str) or not name.isidentifier():
        raise PowertrainError(
            f"{what} {name!r} is not an identifier, permitted: letters, digits and _ "
            "(it becomes part of the signal names of python-control)"
        )
