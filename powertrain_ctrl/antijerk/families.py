"""Other feedbacks by numbers that travel: their weights in units of the plant's own scales."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import control
import numpy as np

from ..sampled.plant import SampledPlant
from .feedback import rigid_reference
from .optimal import lqg
from .robust import hinf
from .scales import Scales

# What a random search of 400 candidates for each family found on the source's car, over its scales: J1 omega1 7.84 N
# m s/rad, f1 2.638 Hz, omega1 dt 0.1658 rad. ``authority`` 1 is that car's. Those of the wheel speed alone are
# the best of a few by hand, and weaker, so that a push at the vehicle is not answered late by cars in high gears and trucks.


def reference(plant: SampledPlant, scales: Scales, authority: float) -> dict[str, Any]:
    """Numbers of `rigid_reference`."""
    return {"gain": 0.82 * authority * scales.gain, "bandwidth_hz": 0.278 * scales.model.frequency_hz}


def quadratic(effort: float, load: float, torque: float, speed: float) -> Callable[..., dict[str, Any]]:
    """Numbers of `lqg`; noises of a walk grow with the square root of the sample, that of a measurement falls with it."""

    def numbers(plant: SampledPlant, scales: Scales, authority: float) -> dict[str, Any]:
        walk = np.sqrt(scales.radians / 0.1658)
        return {
            "effort": effort / (authority * scales.gain) ** 2,
            "load_noise": float(load * walk),
            "torque_noise": float(torque * walk),
            "speed_noise": float(speed / scales.gain / walk),
        }

    return numbers


def infinity(plant: SampledPlant, scales: Scales, authority: float) -> dict[str, Any]:
    """Numbers of `hinf`."""
    return {
        "effort": 0.403 / authority / scales.gain,
        "corner_hz": 14.6 * scales.model.frequency_hz,
        "noise": 0.563 / scales.gain,
    }


def _rigid(plant: SampledPlant, scales: Scales, numbers: dict[str, Any]) -> control.StateSpace:
    return rigid_reference(plant, **numbers)


def _both(plant: SampledPlant, scales: Scales, numbers: dict[str, Any]) -> control.StateSpace:
    return lqg(plant, scales.model, **numbers)


def _engine(plant: SampledPlant, scales: Scales, numbers: dict[str, Any]) -> control.StateSpace:
    return lqg(plant, scales.model, **numbers, engine_only=True)


def _wheels(plant: SampledPlant, scales: Scales, numbers: dict[str, Any]) -> control.StateSpace:
    return lqg(plant, scales.model, **numbers, wheels_only=True)


def _robust(plant: SampledPlant, scales: Scales, numbers: dict[str, Any]) -> control.StateSpace:
    return hinf(plant, scales.model, **numbers)


FAMILIES: dict[str, tuple[Callable[..., dict[str, Any]], Callable[..., control.StateSpace]]] = {
    "rigid reference": (reference, _rigid),
    "LQG": (quadratic(0.385, 8.33, 1.11, 0.687), _both),
    "LQG, engine speed": (quadratic(0.141, 1.04, 1.20, 2.78), _engine),
    "LQG, wheel speed": (quadratic(1.0, 1.0, 0.5, 3.0), _wheels),
    "H-infinity": (infinity, _robust),
}
# How strong they are tried, one after the other.
AUTHORITIES = (1.4, 1.0, 0.7, 0.5, 0.35, 0.25, 0.15)


def feedback_with(name: str, plant: SampledPlant, scales: Scales, authority: float) -> control.StateSpace:
    """The feedback of a family with this authority."""
    numbers_of, feedback_from = FAMILIES[name]
    return feedback_from(plant, scales, numbers_of(plant, scales, authority))
