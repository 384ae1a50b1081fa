"""Names of the signals between the parts of an anti-jerk controller, and checks that they share."""

from collections.abc import Sequence

import control
import numpy as np
from numpy.typing import ArrayLike

from ..base.systems import linear_system

INTERVENTION = "torque_intervention"
FEEDFORWARD = "feedforward_torque"
READS = ("engine_speed", "wheels_speed", "torque_limited")


def feedback_system(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, dt: float, inputs: Sequence[str] = READS
) -> control.StateSpace:
    """Feedback with named signals."""
    return linear_system(A, B, C, D, dt=dt, inputs=list(inputs), outputs=[INTERVENTION])


def sampled_filter(
    numerator: ArrayLike, denominator: ArrayLike, dt: float, prewarp: float | None = None
) -> control.StateSpace:
    """Continuous transfer function by Tustin's rule, exact at the frequency ``prewarp`` [rad/s]."""
    continuous = control.tf2ss(control.tf(numerator, denominator))
    return control.sample_system(continuous, dt, method="tustin", prewarp_frequency=prewarp)
