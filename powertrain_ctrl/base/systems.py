"""python-control systems without states, and ones that can be copied, pickled and sent to another process.

A ``control.StateSpace`` and what ``control.interconnect`` gives hold functions that read their own system, and those of
python-control 0.10.2 can be neither pickled nor copied: in a deep copy they still read the original. With this module
imported they are left out and made anew. Everything else in a system is carried over as it is.

``control.interconnect`` passes through the systems of a loop once more than there are of them, then says "algebraic loop
detected". That is too few where one controller reads a speed, on which its output depends at once, and a torque, on which
it does not. With this module imported a loop around a system that has a ``loop_remedy`` gets as many passes as it takes,
and where it is an algebraic loop, that remedy is said.
"""

import copyreg
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from .errors import PowertrainError


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

    # what to do where it stands in an algebraic loop
    loop_remedy = ""

    def __init__(self, make: Callable[..., control.NonlinearIOSystem], *made_of: Any):
        self.__dict__.update(vars(make(*made_of)))
        self._made_by = (make, *made_of)

    def __reduce__(self) -> tuple:
        return type(self), self._made_by, _all_but_functions(self)


_signals = control.InterconnectedSystem._compute_static_io
# One more pass through a loop, and nothing else.
_NOTHING = SimpleNamespace(ninputs=0, noutputs=0, nstates=0, _out=lambda t, x, u: np.zeros(0))


def _patient_signals(loop: control.InterconnectedSystem, t: float, x: np.ndarray, u: np.ndarray) -> tuple:
    """Inputs and outputs of the systems of a loop at one instant, found by python-control in as many passes as it takes."""
    ours = [system for system in _systems(loop) if isinstance(system, PicklableSystem) and system.loop_remedy]
    if not ours:
        return _signals(loop, t, x, u)
    # each system once for what it does at once, and once for what follows from the others
    passes = [*loop.syslist, *[_NOTHING] * len(loop.syslist)]
    patient = SimpleNamespace(syslist=passes, connect_map=loop.connect_map, input_map=loop.input_map)
    try:
        return _signals(patient, t, x, u)
    except RuntimeError as error:
        if str(error) != "algebraic loop detected":
            raise
        remedies = "; ".join(dict.fromkeys(system.loop_remedy for system in ours))
        raise PowertrainError(f"{error} at t = {t:g} s: {remedies}") from error


control.InterconnectedSystem._compute_static_io = _patient_signals


def _systems(loop: control.InterconnectedSystem) -> Iterator[control.NonlinearIOSystem]:
    for system in loop.syslist:
        yield from _systems(system) if isinstance(system, control.InterconnectedSystem) else [system]


def linear_system(
    A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, *dt: float, **labels: Any
) -> control.StateSpace:
    """``control.ss`` of arrays, which without states does not set the shape of an array, deprecated since numpy 2.5.

    Parameters
    ----------
    A, B, C, D : (n, n), (n, inputs), (outputs, n), (outputs, inputs) array_like
    *dt, **labels
        As of ``control.ss``.

    Returns
    -------
    control.StateSpace

    Examples
    --------
    >>> gain = linear_system([], [], [], [[2.0, 3.0]], 0.01, inputs=["a", "b"], outputs=["y"], states=[])
    >>> gain.nstates, gain.B.shape, gain.C.shape, gain.D
    (0, (0, 2), (1, 0), array([[2., 3.]]))
    """
    D = np.asarray(D, dtype=float)
    if np.size(A):
        return control.ss(A, B, C, D, *dt, **labels)
    # one state that neither input nor output touches, which python-control takes out again
    none = np.zeros((1, 1)), np.zeros((1, D.shape[1])), np.zeros((D.shape[0], 1))
    named = {what: names for what, names in labels.items() if what != "states"}
    return control.ss(*none, D, *dt, **named, remove_useless_states=True)
