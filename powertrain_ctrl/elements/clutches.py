"""Dry friction clutches and brakes, and one-way clutches."""

from dataclasses import KW_ONLY, dataclass

from ..base.checks import AT_LEAST_ONE, NOT_NEGATIVE
from ..base.doors import called
from .element import Element, TwoEnded, quantity
from .laws import Law, friction, one_way


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
    >>> pt.Clutch("clutch", "flywheel", "input_shaft", max_torque=400.0).laws[0].coefficients
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
    def laws(self) -> tuple[Law, ...]:
        coefficients = {self.a: 1.0} if self.b is None else {self.a: 1.0, self.b: -1.0}
        return (friction(self.name, coefficients, self.max_torque, self.static_ratio),)


@called
@dataclass(frozen=True)
class OneWayClutch(TwoEnded):
    """Freewheel: ``a`` drives ``b``, and ``b`` may overrun; slip ``omega_a - omega_b <= 0``, torque >= 0.

    Parameters
    ----------
    name, a, b : str
        Own name; node that drives; node that may run ahead.

    Raises
    ------
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> [mode.name for mode in pt.OneWayClutch("freewheel", "starter", "engine").laws[0].modes.values()]
    ['driving', 'overrunning']
    """

    @property
    def laws(self) -> tuple[Law, ...]:
        return (one_way(self.name, {self.a: 1.0, self.b: -1.0}),)
