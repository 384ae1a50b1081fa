"""Tyres: from what turns to what moves along the road."""

from dataclasses import KW_ONLY, dataclass

from ..base.checks import NOT_NEGATIVE, POSITIVE
from ..base.doors import called
from ..base.errors import ParameterError
from .element import ComplianceRow, ConstraintRow, Element, quantity


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
