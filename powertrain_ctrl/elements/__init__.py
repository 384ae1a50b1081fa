"""Driveline elements: frozen records that state their rows (see `element`) and nothing else.

Signs: the torque through an element is positive when side ``a`` is turned ahead of side ``b``; it then
drives ``b`` and loads ``a``. Everything is SI. A node that carries a `Mass`, or is the body of a `Tyre`,
moves along the road [m], every other node turns [rad]. All values are finite, and names and nodes are identifiers.
"""

from .backlash import Backlash
from .bodies import Inertia, Mass
from .clutches import Clutch, DogClutch, OneWayClutch
from .combinations import Compliance, Constraint, TorqueSplit
from .converters import SpeedCoupling, TorqueConverter
from .differentials import Differential
from .element import (
    Coefficients,
    ComplianceRow,
    ConstraintRow,
    CouplingRow,
    Element,
    InertiaRow,
    OperatingPoint,
    Statement,
    quantity,
    statement_of,
)
from .gears import Gear, Planetary
from .laws import Guard, Law, Mode, Region, friction
from .pendulums import Pendulum
from .road import RoadLoad
from .sources import SpeedSource
from .springs import Drag, Shaft, SpringDamper
from .stages import MultiStageSpring
from .tyres import SlipTyre, Tyre

ELEMENT_TYPES: dict[str, type[Element]] = {
    cls.__name__: cls
    for cls in (
        Inertia,
        Mass,
        SpringDamper,
        Shaft,
        Drag,
        Gear,
        Planetary,
        Differential,
        Tyre,
        SlipTyre,
        RoadLoad,
        Clutch,
        OneWayClutch,
        DogClutch,
        TorqueConverter,
        Backlash,
        MultiStageSpring,
        Pendulum,
        SpeedSource,
        Compliance,
        Constraint,
        TorqueSplit,
        SpeedCoupling,
    )
}

__all__ = [
    *sorted(ELEMENT_TYPES),
    "ELEMENT_TYPES",
    "Coefficients",
    "ComplianceRow",
    "ConstraintRow",
    "CouplingRow",
    "Element",
    "Guard",
    "InertiaRow",
    "Law",
    "Mode",
    "OperatingPoint",
    "Region",
    "Statement",
    "friction",
    "quantity",
    "statement_of",
]
