"""Proof of a controller on the plants that a car can turn out to be: manoeuvres, tolerances, margins."""

from ..base.errors import absent
from .courses import braking, change_of_mind, let_off
from .indices import SobolIndices, sobol
from .proof import Proof, Robustness, prove, robustness
from .tolerances import (
    scale_damping,
    scale_mass,
    scale_stiffness,
    softest_shafts,
    variations,
    with_modal_damping,
)
from .trials import residual_rms, tip_in, tip_in_metrics, tip_out, wheel_disturbance

__all__ = [
    "Proof",
    "Robustness",
    "SobolIndices",
    "braking",
    "change_of_mind",
    "let_off",
    "prove",
    "residual_rms",
    "robustness",
    "scale_damping",
    "scale_mass",
    "scale_stiffness",
    "sobol",
    "softest_shafts",
    "tip_in",
    "tip_in_metrics",
    "tip_out",
    "variations",
    "wheel_disturbance",
    "with_modal_damping",
]

__getattr__ = absent(__name__, __all__)
