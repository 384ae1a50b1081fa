"""Shafts with play."""

from dataclasses import KW_ONLY, dataclass

from ..base.checks import NOT_NEGATIVE, POSITIVE
from ..base.doors import called
from ..base.errors import ParameterError, PowertrainError
from .element import Element, OperatingPoint, TwoEnded, quantity
from .laws import Law, clipped, nordin
from .springs import SpringDamper

CONTACTS = {"nordin": nordin, "clipped": clipped}


@called
@dataclass(frozen=True)
class Backlash(TwoEnded):
    """Elastic shaft in series with play: no torque inside the gap, spring and damper beyond it, and never a pull.

    Parameters
    ----------
    name, a, b : str
        Own name; node on the driving side; node on the driven side.
    gap : float
        Whole free angle [rad], > 0; it is centred, so that contact is at a twist of +gap/2 and -gap/2.
    stiffness, damping : float
        k [N m/rad], > 0; d [N m s/rad], >= 0, of the shaft in contact.
    contact : {"nordin", "clipped"}
        What a damped shaft does that leaves the flank. "nordin" (Nordin, Galic, Gutman, Int. J. Adapt. Control Signal
        Process. 11 (1997) 49-63): it is let go where its torque is zero and untwists by itself in the gap. "clipped"
        (``ElastoBacklash2`` of the Modelica Standard Library): torque ``k y + d y'`` or, if that would pull, none. Without
        damping they are the same.

    Raises
    ------
    ParameterError
        A gap or stiffness that is not > 0, damping that is not >= 0, a contact that is not known.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> mesh = pt.Backlash("mesh", "pinion", "wheel", gap=0.02, stiffness=5e3, damping=4.0)
    >>> [mode.name for mode in mesh.laws[0].modes.values()]
    ['gap', 'right', 'left']
    """

    _: KW_ONLY
    gap: float = quantity("rad", POSITIVE)
    stiffness: float = quantity("N m/rad", POSITIVE)
    damping: float = quantity("N m s/rad", NOT_NEGATIVE, default=0.0)
    contact: str = "nordin"

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.contact, str) or self.contact not in CONTACTS:
            permitted = ", ".join(f'"{name}"' for name in CONTACTS)
            raise ParameterError(self.name, "contact", self.contact, "", permitted)

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        if not self.laws[0].modes[point.modes[self.name]].stiffness:
            raise PowertrainError(
                f"{self.name}: the operating point lies inside its gap, where it carries nothing; give torques that load "
                f'it, or twists={{"{self.name}": ...}} beyond {0.5 * self.gap:g} rad'
            )
        return (SpringDamper(self.name, self.a, self.b, stiffness=self.stiffness, damping=self.damping),)

    @property
    def laws(self) -> tuple[Law, ...]:
        law = CONTACTS[self.contact]
        return (law(self.name, {self.a: 1.0, self.b: -1.0}, self.gap, self.stiffness, self.damping),)
