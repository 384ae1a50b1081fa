"""Python-control systems, also without states."""

from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike


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
