"""Differentials: one shaft drives two, which may turn at different speeds."""

from dataclasses import dataclass

from ..base.doors import called
from .element import ConstraintRow, Element


@called
@dataclass(frozen=True)
class Differential(Element):
    """Open differential: ``2 omega_carrier = omega_left + omega_right``, so both sides carry the same torque.

    Its inertias are those of the nodes; side nodes, and the carrier too, may be without any if springs lead on from them.

    Parameters
    ----------
    name, carrier, left, right : str
        Own name; the driven cage; the two side gears, for a centre differential front and rear.

    Raises
    ------
    PowertrainError
        A name or node that is not an identifier, or the same node twice.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Differential("differential", "carrier", "left", "right").constraints[0].coefficients
    {'carrier': 2.0, 'left': -1.0, 'right': -1.0}
    """

    carrier: str
    left: str
    right: str

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.carrier, self.left, self.right)

    @property
    def constraints(self) -> tuple[ConstraintRow, ...]:
        return (ConstraintRow(self.name, {self.carrier: 2.0, self.left: -1.0, self.right: -1.0}),)
