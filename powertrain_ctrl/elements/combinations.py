"""Compliances and constraints on any combination of node motions, and one torque on several nodes."""

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass

from ..base.checks import NOT_NEGATIVE, NOT_ZERO, POSITIVE, checked_number
from ..base.doors import called
from ..base.errors import ParameterError
from .element import Coefficients, ComplianceRow, ConstraintRow, Element, InertiaRow, quantity


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


# Shares of a torque add up to 1 but for this.
WHOLE = 1e-9


@called
@dataclass(frozen=True)
class TorqueSplit(Constraint):
    """One torque that acts on several nodes, each with its share: engine and e-machine under one command.

    The torque acts at a node of its own, without inertia, whose speed is ``sum(share * speed)``: so the power given
    there is that which the others get, and they get their shares.

    Parameters
    ----------
    name : str
        Own name.
    coefficients : mapping
        Node to its share of the torque [-], each > 0, 1 in sum; at least two.
    node : str
        Node at which the torque acts.

    Raises
    ------
    ParameterError
        Fewer than two shares, one that is not > 0, or a sum that is not 1.
    PowertrainError
        A name or node that is not an identifier, or a node that has a share of itself.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> split = pt.TorqueSplit("split", {"engine": 0.6, "emachine": 0.4}, "both")
    >>> car = pt.Driveline(pt.Inertia("engine", J=0.2), pt.Inertia("emachine", J=0.1), split)
    >>> "both_torque" in pt.state_space(car).input_labels
    True
    """

    node: str

    def __post_init__(self) -> None:
        super().__post_init__()
        shares = self.coefficients
        for node, share in shares.items():
            checked_number(self.name, f'share of "{node}"', share, "", POSITIVE)
        if len(shares) < 2 or abs(sum(shares.values()) - 1.0) > WHOLE:
            raise ParameterError(self.name, "shares", dict(shares), "", "two or more nodes, 1 in sum")

    @property
    def nodes(self) -> tuple[str, ...]:
        return (*self.coefficients, self.node)

    @property
    def inertias(self) -> tuple[InertiaRow, ...]:
        return (InertiaRow((self.node,), ((0.0,),)),)

    @property
    def constraints(self) -> tuple[ConstraintRow, ...]:
        return (ConstraintRow(self.name, {**self.coefficients, self.node: -1.0}),)
