"""Dry friction clutches and brakes."""

from dataclasses import KW_ONLY, dataclass

from ..base.checks import AT_LEAST_ONE, NOT_NEGATIVE
from ..base.doors import called
from .element import Element, FrictionRow, quantity


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
