"""Bodies: what has inertia."""

from dataclasses import KW_ONLY, dataclass

from ..base.checks import POSITIVE
from ..base.doors import called
from .element import Element, InertiaRow, quantity


@called
@dataclass(frozen=True)
class Inertia(Element):
    """Turning body; it makes the node of its own name.

    Parameters
    ----------
    name : str
        Name of body and node.
    J : float
        Moment of inertia J [kg m^2], > 0.

    Raises
    ------
    ParameterError
        J that is not > 0 and finite.
    PowertrainError
        A name that is not an identifier.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Inertia("engine", J=0.3)
    Inertia(name='engine', J=0.3)
    """

    _: KW_ONLY
    J: float = quantity("kg m^2", POSITIVE)

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def inertias(self) -> tuple[InertiaRow, ...]:
        return (InertiaRow((self.name,), ((self.J,),)),)


@called
@dataclass(frozen=True)
class Mass(Element):
    """Body that moves along the road; it makes the node of its own name.

    Parameters
    ----------
    name : str
        Name of body and node.
    m : float
        Mass m [kg], > 0.

    Raises
    ------
    ParameterError
        m that is not > 0 and finite.
    PowertrainError
        A name that is not an identifier.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Mass("vehicle", m=2000.0)
    Mass(name='vehicle', m=2000.0)
    """

    _: KW_ONLY
    m: float = quantity("kg", POSITIVE)

    @property
    def nodes(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def translating(self) -> tuple[str, ...]:
        return (self.name,)

    @property
    def inertias(self) -> tuple[InertiaRow, ...]:
        return (InertiaRow((self.name,), ((self.m,),)),)
