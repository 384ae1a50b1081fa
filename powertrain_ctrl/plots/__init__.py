"""Figures of results. Each function draws on the axes it is given, or on new ones, and returns them.

Responses over time are those of `powertrain_ctrl.simulate` and the manoeuvres, or ``control.TimeResponseData``.
Nothing here computes physics or changes matplotlib's settings. Another number of axes than a figure needs is a
`PowertrainError`, a signal that a response does not have an `UnknownNameError`.
"""

from ..base.errors import absent
from .antijerk import controlled_launch, tip_in, trade_off
from .characteristics import characteristic
from .comparisons import error_against_order, hankel, model_errors, ramp_responses
from .excitation import campbell, order_map, orders
from .families import bode_band, gear_map, histogram, tornado
from .identified import measured, residual_spectrum
from .launches import launch, launch_compared
from .loops import disk, nyquist, pole_map
from .proof import robust_responses, robust_spread
from .responses import bode, load_change
from .schematics import schematic, schematic_size
from .shapes import mode_energies, mode_energies_size, mode_shape, mode_shape_size
from .style import Signals, signals
from .tuned import pareto

__all__ = [
    "Signals",
    "bode",
    "bode_band",
    "campbell",
    "characteristic",
    "controlled_launch",
    "disk",
    "error_against_order",
    "gear_map",
    "hankel",
    "histogram",
    "launch",
    "launch_compared",
    "load_change",
    "measured",
    "mode_energies",
    "mode_energies_size",
    "mode_shape",
    "mode_shape_size",
    "model_errors",
    "nyquist",
    "order_map",
    "orders",
    "pareto",
    "pole_map",
    "ramp_responses",
    "residual_spectrum",
    "robust_responses",
    "robust_spread",
    "schematic",
    "schematic_size",
    "signals",
    "tip_in",
    "tornado",
    "trade_off",
]

__getattr__ = absent(__name__, __all__)
