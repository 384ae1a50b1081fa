"""Nodes whose motion is given: test rigs, measured speeds."""

from dataclasses import dataclass

from ..base.doors import called
from .combinations import Constraint
from .element import Element, InertiaRow, OperatingPoint
from .laws import Law, Mode

# A node that is moved needs no inertia; this one [kg m^2 or kg] makes the matrices regular, its torque is taken off again.
MOVED = 1.0


@called
@dataclass(frozen=True)
class SpeedSource(Element):
    """A node that moves as the input ``<name>_speed`` [rad/s or m/s] says, whatever that takes.

    ``<name>_torque`` [N m or N] is what the source does to the node. A jump of the speed jumps the node; what a clutch holds
    to it then slips. For small motion, ``car.at(...)``, the node is at rest.

    Parameters
    ----------
    name, node : str
        Own name; the node that is moved, with or without inertia.

    Raises
    ------
    PowertrainError
        A name or node that is not an identifier.

    Examples
    --------
    A spring and a flywheel on a test rig whose speed rises by 10 rad/s^2; a second later the flywheel lags by what its
    inertia twists the spring by, 0.5 * 10 / 100 = 0.05 rad:

    >>> import powertrain_ctrl as pt
    >>> rig = pt.Driveline(
    ...     pt.SpeedSource("motor", "input"),
    ...     pt.SpringDamper("shaft", "input", "flywheel", stiffness=100.0, damping=20.0),
    ...     pt.Inertia("flywheel", J=0.5),
    ... )
    >>> round(pt.simulate(rig, [0.0, 5.0], {"motor_speed": pt.ramp(0.0, 9.0, 90.0)}).final.twist["shaft"], 6)
    0.05
    """

    node: str

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.node,)

    @property
    def inertias(self) -> tuple[InertiaRow, ...]:
        return (InertiaRow((self.node,), ((MOVED,),)),)

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        return (Constraint(self.name, {self.node: 1.0}),)

    @property
    def laws(self) -> tuple[Law, ...]:
        return (Law(self.name, {self.node: 1.0}, {0: Mode("moved", held=True)}, signal="speed", imposes=MOVED),)
