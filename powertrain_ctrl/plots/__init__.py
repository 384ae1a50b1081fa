"""Figures of results. Each function draws on the axes it is given, or on new ones, and returns them.

Responses over time are those of `powertrain_ctrl.simulate` and the manoeuvres, or ``control.TimeResponseData``.
Nothing here computes physics or changes matplotlib's settings.
"""

from .comparisons import error_against_order, hankel, model_errors, ramp_responses
from .launches import launch, launch_compared
from .responses import bode, load_change
from .shapes import mode_energies, mode_energies_size, mode_shape, mode_shape_size
from .style import COLOURS, LABELLED, LINES, Signals, signals
from .style import grid as _grid  # noqa: F401
from .style import legend as _legend  # noqa: F401
from .style import new_axes as _axes  # noqa: F401
from .style import words as _words  # noqa: F401

__all__ = [
    "COLOURS",
    "LABELLED",
    "LINES",
    "Signals",
    "bode",
    "error_against_order",
    "hankel",
    "launch",
    "launch_compared",
    "load_change",
    "mode_energies",
    "mode_energies_size",
    "mode_shape",
    "mode_shape_size",
    "model_errors",
    "ramp_responses",
    "signals",
]
