"""Dry friction clutches and brakes, one-way clutches and dog clutches."""

from collections.abc import Iterable, Mapping
from dataclasses import KW_ONLY, dataclass, field
from itertools import pairwise

from ..base.checks import AT_LEAST_ONE, NOT_NEGATIVE, checked_points
from ..base.doors import called
from ..base.errors import ParameterError
from .combinations import Constraint
from .element import Element, OperatingPoint, TwoEnded, quantity
from .laws import Law, dog, friction, one_way


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
    friction : sequence of (float, float)
        Points (magnitude of slip [rad/s], factor of the capacity [-]) of a polyline, slips increasing from 0, where the
        factor is 1; beyond the last it stays. Friction that falls with slip makes a launch judder: Centea, Rahnejat, Menday,
        Appl. Math. Modelling 25 (2001) 177-192.

    Raises
    ------
    ParameterError
        Capacity that is not >= 0, static ratio that is not >= 1, points that do not begin with (0, 1), slips that do not
        increase, a negative factor.
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
    friction: tuple[tuple[float, float], ...] = field(default=((0.0, 1.0),), metadata={"array": "rad/s, -"})

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "friction", self._checked_friction())

    def _checked_friction(self) -> tuple[tuple[float, float], ...]:
        points, what = self.friction, "pairs (slip, factor), the first (0, 1)"
        if isinstance(points, str | bytes | Mapping) or not isinstance(points, Iterable):
            raise ParameterError(self.name, "friction", points, "", what)
        rows = [checked_points(self.name, "friction", point, "", NOT_NEGATIVE) for point in points]
        for row in rows:
            if len(row) != 2:
                raise ParameterError(self.name, "friction", row, "", what)
        if not rows or rows[0] != (0.0, 1.0):
            raise ParameterError(self.name, "friction", rows[0] if rows else (), "", "a first point (0, 1)")
        for (before, _), (slip, _) in pairwise(rows):
            if slip <= before:
                raise ParameterError(self.name, "friction", slip, "rad/s", f"> {before:g}, the slip before")
        return tuple((slip, factor) for slip, factor in rows)

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.a,) if self.b is None else (self.a, self.b)

    @property
    def laws(self) -> tuple[Law, ...]:
        coefficients = {self.a: 1.0} if self.b is None else {self.a: 1.0, self.b: -1.0}
        return (friction(self.name, coefficients, self.max_torque, self.static_ratio, self.friction),)


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

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        if not self.laws[0].modes[point.modes[self.name]].held:
            return ()
        return (Constraint(self.name, {self.a: 1.0, self.b: -1.0}),)

    @property
    def laws(self) -> tuple[Law, ...]:
        return (one_way(self.name, {self.a: 1.0, self.b: -1.0}),)


@called
@dataclass(frozen=True)
class DogClutch(TwoEnded):
    """Dog clutch: a rigid coupling that the input ``<name>_engaged`` closes (1) and opens (0); gears that are pre-selected.

    When it closes what slips is brought to one speed at once, its momentum kept; the energy that is lost is the ``heat`` of
    the event. In linear models it is locked or released like a clutch.

    Parameters
    ----------
    name, a, b : str
        Own name; node on the driving side; node on the driven side.

    Raises
    ------
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> [mode.name for mode in pt.DogClutch("second", "shaft", "gear").laws[0].modes.values()]
    ['engaged', 'open']
    """

    @property
    def laws(self) -> tuple[Law, ...]:
        return (dog(self.name, {self.a: 1.0, self.b: -1.0}),)
