"""Two-mass control models of all variants."""

from __future__ import annotations

import numpy as np

from ..driveline.collection import Driveline
from ..reduction.condensed import two_mass
from ..reduction.twomass import TwoMass
from .structure import one_by_one
from .variants import Variants

FIELDS = ("J1", "J2", "stiffness", "damping", "ratio", "rim_share")


def two_masses_of(variants: Variants) -> dict[str, np.ndarray]:
    """Fields of `TwoMass` (n,) of some variants, by the method "modal"."""
    models = one_by_one(variants, _modal)
    return {name: np.array([getattr(model, name) for model in models]) for name in FIELDS}


def _modal(car: Driveline) -> TwoMass:
    return two_mass(car)
