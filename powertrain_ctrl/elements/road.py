"""Resistance of the road."""

from dataclasses import KW_ONLY, dataclass

from ..base.checks import FINITE, NOT_NEGATIVE
from ..base.doors import called
from ..base.errors import ParameterError, PowertrainError
from .element import Element, OperatingPoint, quantity
from .frictions import over_slip
from .laws import Law, Mode
from .springs import Drag

# The parabola of the drag is replaced by chords between multiples of this speed [m/s], up to the fastest; beyond that the
# last one goes on.
CHORD, FASTEST = 2.0, 100.0


@called
@dataclass(frozen=True)
class RoadLoad(Element):
    """Rolling resistance, drag and gradient: ``constant + linear |v| + quadratic v^2`` against the motion, and the grade.

    The parabola is replaced by chords every 2 m/s up to 100 m/s, exact at their ends and nowhere too large by more than
    `error`. At rest the constant part holds the vehicle up to its size. The driveline is not linear with it: `simulate`
    follows it exactly, for linear models take ``car.at(speed=...)``.

    Parameters
    ----------
    name, body : str
        Own name; the node that moves along the road.
    constant, linear, quadratic : float
        [N], [N s/m], [N s^2/m^2], each >= 0: coefficients of a coast-down.
    grade : float
        Slope of the road [-]: that part of the weight of the body pulls it back.

    Raises
    ------
    ParameterError
        A negative coefficient, or all of them and the grade 0.
    PowertrainError
        A name or node that is not an identifier.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> road = pt.RoadLoad("road", "vehicle", constant=150.0, quadratic=0.4)
    >>> round(road.error, 9), len(road.laws[0].modes)
    (0.4, 101)
    """

    body: str
    _: KW_ONLY
    constant: float = quantity("N", NOT_NEGATIVE, default=0.0)
    linear: float = quantity("N s/m", NOT_NEGATIVE, default=0.0)
    quadratic: float = quantity("N s^2/m^2", NOT_NEGATIVE, default=0.0)
    grade: float = quantity("", FINITE, default=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not (self.constant or self.linear or self.quadratic or self.grade):
            raise ParameterError(self.name, "constant", 0.0, "N", "one of constant, linear, quadratic and grade not 0")

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.body,)

    @property
    def translating(self) -> tuple[str, ...]:
        return (self.body,)

    @property
    def error(self) -> float:
        """Bound [N] of what the chords add to the parabola, up to 100 m/s."""
        return self.quadratic * CHORD**2 / 4.0

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        if not (self.linear or self.quadratic):
            return ()
        if self.body not in point.speed:
            raise PowertrainError(
                f'{self.name}: its drag depends on the speed; give it, e.g. car.at(speed={{"{self.body}": 20.0}})'
            )
        slope = self.linear + 2.0 * self.quadratic * abs(point.speed[self.body])
        return (Drag(self.name, self.body, damping=slope),) if slope else ()

    @property
    def laws(self) -> tuple[Law, ...]:
        along, laws = {self.body: 1.0}, []
        if self.constant or self.linear or self.quadratic:
            speeds = [CHORD * i for i in range(round(FASTEST / CHORD) + 1)] if self.quadratic else [0.0, CHORD]
            points = [(v, self.constant + self.linear * v + self.quadratic * v * v) for v in speeds]
            laws.append(over_slip(self.name, along, tuple(points), self.name))
        if self.grade:
            name = f"{self.name}_grade" if laws else self.name
            weight = {0: Mode("weight", torque=self.grade)}
            laws.append(Law(name, along, weight, element=self.name, weighs=True, memoryless=True))
        return tuple(laws)
