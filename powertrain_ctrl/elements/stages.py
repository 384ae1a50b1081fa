"""Springs with stages: torsional dampers, dual-mass flywheels, end stops."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from itertools import pairwise

from ..base.checks import NOT_NEGATIVE, POSITIVE, checked_points
from ..base.doors import called
from ..base.errors import ParameterError
from .element import Element, OperatingPoint, TwoEnded, quantity
from .frictions import coulomb, jenkins
from .laws import Guard, Law, Mode
from .springs import SpringDamper


@called
@dataclass(frozen=True)
class MultiStageSpring(TwoEnded):
    """Spring whose torque is a polyline over its twist, with friction in parallel if wanted.

    Two stages of a clutch disc, the arc springs of a dual-mass flywheel, end stops: ``torque = T(twist) + damping twist'``,
    T through the points and with its first and last slope beyond them.

    Parameters
    ----------
    name, a, b : str
        Own name; node on the driving side; node on the driven side.
    twists, torques : sequence of float
        Points of the polyline [rad], [N m], at least two; twists increasing, torques not falling.
    damping : float
        d [N m s/rad], >= 0, the same in all stages.
    friction : float
        Coulomb friction in parallel [N m], >= 0.
    friction_stiffness : float or None
        Stiffness [N m/rad], > 0, of the spring through which the friction acts (Iwan, J. Appl. Mech. 33 (1966) 893-900);
        None is rigid. In a dual-mass flywheel it is elastic; without, small motion sticks and slips again and again.

    Raises
    ------
    ParameterError
        Points that are not increasing, fewer than two, falling torques; negative damping or friction.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    Soft to 3.4 degrees, then stiff, end stop at 17 degrees:

    >>> import powertrain_ctrl as pt
    >>> damper = pt.MultiStageSpring(
    ...     "damper", "flywheel", "hub", twists=(-0.06, 0.06, 0.30, 0.31), torques=(-24.0, 24.0, 504.0, 1104.0), friction=8.0
    ... )
    >>> [round(mode.stiffness) for mode in damper.laws[0].modes.values()]
    [400, 2000, 60000]
    """

    _: KW_ONLY
    twists: tuple[float, ...] = field(metadata={"array": "rad"})
    torques: tuple[float, ...] = field(metadata={"array": "N m"})
    damping: float = quantity("N m s/rad", NOT_NEGATIVE, default=0.0)
    friction: float = quantity("N m", NOT_NEGATIVE, default=0.0)
    friction_stiffness: float | None = quantity("N m/rad", POSITIVE, default=None, optional=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        for values, unit in (("twists", "rad"), ("torques", "N m")):
            object.__setattr__(self, values, checked_points(self.name, values, getattr(self, values), unit))
        if len(self.twists) < 2 or len(self.twists) != len(self.torques):
            counts = f"{len(self.twists)} and {len(self.torques)} values"
            raise ParameterError(self.name, "twists and torques", counts, "", "as many of each, at least two")
        for before, twist in pairwise(self.twists):
            if not twist > before:
                raise ParameterError(
                    self.name,
                    "twists",
                    twist,
                    "rad",
                    f"> {before:g}, the one before; for a step of preload a steep stage",
                )
        for before, torque in pairwise(self.torques):
            if torque < before:
                raise ParameterError(self.name, "torques", torque, "N m", f">= {before:g}, the one before")

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        stage = self.laws[0].modes[point.modes[self.name]]
        if not (stage.stiffness or stage.damping):
            return ()
        return (SpringDamper(self.name, self.a, self.b, stiffness=stage.stiffness, damping=stage.damping),)

    @property
    def laws(self) -> tuple[Law, ...]:
        coefficients = {self.a: 1.0, self.b: -1.0}
        spring = stages(self.name, coefficients, self.twists, self.torques, self.damping)
        if not self.friction:
            return (spring,)
        parallel = f"{self.name}_friction"
        if self.friction_stiffness is None:
            return (spring, coulomb(parallel, coefficients, self.friction, self.name))
        return (spring, jenkins(parallel, coefficients, self.friction, self.friction_stiffness, self.name))


def stages(
    name: str, coefficients: dict[str, float], twists: Sequence[float], torques: Sequence[float], damping: float
) -> Law:
    """Torque along straight lines through points (twist [rad], torque [N m]), first and last slope going on.

    Examples
    --------
    >>> law = stages("damper", {"a": 1.0, "b": -1.0}, (-0.1, 0.1, 0.2), (-10.0, 10.0, 110.0), 0.0)
    >>> [(law.modes[number].name, round(y, 9)) for number, y in map(law.starting, (0.0, -0.5, 0.13))]
    [('stage 1', 0.1), ('stage 1', -0.4), ('stage 2', 0.03)]
    """
    points = list(zip(twists, torques, strict=True))
    modes, last = {}, len(points) - 2
    for i, ((q, torque), (q_next, torque_next)) in enumerate(pairwise(points)):
        guards = [Guard(i - 1, twist=1.0, level=-q)] if i else []
        guards += [Guard(i + 1, twist=-1.0, level=q_next)] if i < last else []
        stiffness = (torque_next - torque) / (q_next - q)
        modes[i] = Mode(
            f"stage {i + 1}",
            tuple(guards),
            "stage",
            stiffness=stiffness,
            damping=damping,
            torque=torque,
            follows=stiffness > 0.0,
            origin=q if stiffness > 0.0 else None,
        )
    return Law(name, coefficients, modes, memoryless=True)
