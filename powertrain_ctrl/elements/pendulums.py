"""Centrifugal pendulums: absorbers that are tuned to an order, not to a frequency."""

from dataclasses import KW_ONLY, dataclass

from ..base.checks import NOT_NEGATIVE, POSITIVE
from ..base.doors import called
from ..base.errors import PowertrainError
from .bodies import Inertia
from .element import Element, OperatingPoint, quantity
from .laws import Law
from .springs import SpringDamper


@called
@dataclass(frozen=True)
class Pendulum(Element):
    """Centrifugal pendulum for small swings: an inertia J behind a spring ``order^2 J Omega^2`` at the speed Omega.

    A mass m on a pendulum of length L, whose pivot turns on the radius R, is ``J = m (R + L)^2`` tuned to the order
    ``(R / L)^(1/2)``: Den Hartog, Mechanical Vibrations (1956), section 5.6. Seen from its node it is an inertia
    ``J / (1 - (n / order)^2)`` at the order n, infinite where n is its own. `order_response` takes it at each engine speed,
    ``car.at(speed=...)`` at one; there its mass is the node ``<name>_bob``.

    Parameters
    ----------
    name, node : str
        Own name; the node it hangs on.
    J : float
        Moment of inertia of its masses about the shaft [kg m^2], > 0.
    order : float
        Tuned order [-], > 0: oscillations per revolution of its node.
    damping : float
        On its twist [N m s/rad], >= 0. The masses swing by ``1 + order^2`` times the twist.

    Raises
    ------
    ParameterError
        J or order that is not > 0, damping that is not >= 0.
    PowertrainError
        A name or node that is not an identifier.

    Examples
    --------
    At 1500 rpm the second order has 50 Hz, and so has the pendulum by itself:

    >>> import powertrain_ctrl as pt
    >>> car = pt.Driveline(pt.Inertia("flywheel", J=1e6), pt.Pendulum("absorber", "flywheel", J=0.01, order=2.0))
    >>> pt.modes(car.at(speed={"flywheel": pt.rpm(1500.0)})).frequency_hz.round(6)
    array([ 0., 50.])
    """

    node: str
    _: KW_ONLY
    J: float = quantity("kg m^2", POSITIVE)
    order: float = quantity("", POSITIVE)
    damping: float = quantity("N m s/rad", NOT_NEGATIVE, default=0.0)

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.node,)

    @property
    def laws(self) -> tuple[Law, ...]:
        return (Law(self.name, {self.node: 1.0}, {}),)

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        if self.node not in point.speed:
            return (self,)
        speed, bob = point.speed[self.node], f"{self.name}_bob"
        if not speed:
            raise PowertrainError(f'{self.name}: speed of "{self.node}" = 0 rad/s, permitted: not 0')
        stiffness = self.order**2 * self.J * speed**2
        spring = SpringDamper(self.name, self.node, bob, stiffness=stiffness, damping=self.damping)
        return (Inertia(bob, J=self.J), spring)
