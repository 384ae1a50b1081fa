"""python-control systems that can be copied, pickled and sent to another process.

A ``control.StateSpace`` and what ``control.interconnect`` gives hold functions that read their own system, and those of
python-control 0.10.2 can be neither pickled nor copied: in a deep copy they still read the original. With this module
imported they are left out and made anew. Everything else in a system is carried over as it is.
"""

import copyreg
from collections.abc import Callable
from typing import Any

import control


def _all_but_functions(system: control.NonlinearIOSystem) -> dict[str, Any]:
    return {name: value for name, value in vars(system).items() if name not in ("updfcn", "outfcn")}


def _blank(kind: Any) -> control.NonlinearIOSystem:
    """A system of this kind with the functions of python-control, which read what it is given later."""
    system = kind.__new__(kind)
    if issubclass(kind, control.StateSpace):
        control.StateSpace.__init__(system, 0.0, 0.0, 0.0, 0.0, name="blank")
    else:
        control.InterconnectedSystem.__init__(system, [], inputs=0, outputs=0, name="blank")
    return system


def _reduced(system: control.NonlinearIOSystem) -> tuple:
    return _blank, (type(system),), _all_but_functions(system)


for _kind in (control.StateSpace, control.InterconnectedSystem, control.LinearICSystem):
    copyreg.pickle(_kind, _reduced)


class PicklableSystem(control.NonlinearIOSystem):
    """The system that ``make(*made_of)`` gives; a copy of it, and one in another process, is made of the same again."""

    def __init__(self, make: Callable[..., control.NonlinearIOSystem], *made_of: Any):
        self.__dict__.update(vars(make(*made_of)))
        self._made_by = (make, *made_of)

    def __reduce__(self) -> tuple:
        return type(self), self._made_by, _all_but_functions(self)
