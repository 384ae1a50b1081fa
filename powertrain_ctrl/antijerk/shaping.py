"""The two parts of "two degrees of freedom" by numbers that travel: a feedback on the twist rate and inverse notches."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from ..base.systems import linear_system
from ..sampled.plant import SampledPlant
from .feedback import lead_notch, speed_difference
from .feedforward import inverse_notch
from .scales import Scales
from .structure import two_dof

# What is searched, least and largest. Of the feedback: gain over J1 omega1, lead time over latency, lead over lag
# time, which below 1 turns the phase back, notch over second mode, damping ratios of the notch. Both signs are
# searched: where torque comes half a period late, the other one damps.
FEEDBACK = np.array([[0.03, 2.5], [0.1, 3.0], [0.15, 8.0], [0.9, 1.1], [0.05, 0.5], [0.3, 1.0]])
# Of the feedforward: damping ratio of the new poles, their frequency over the first mode; of what it cancels, damping
# ratio and frequency over those of the first mode.
FEEDFORWARD = np.array([[0.6, 1.2], [0.9, 3.0], [1.0, 2.5], [0.93, 1.1]])
# In a closer look: of the first, and of a second one behind it over the second mode.
CLOSER_FIRST = np.array([[0.4, 1.2], [0.9, 4.5], [0.7, 2.5], [0.85, 1.15]])
CLOSER_SECOND = np.array([[0.35, 1.2], [0.9, 4.0], [0.5, 2.0], [0.85, 1.15]])


def drawn(random: np.random.Generator, box: np.ndarray, count: int) -> np.ndarray:
    """(count, numbers) ndarray, evenly over the logarithm; one of each `count` parts of every side (Latin hypercube)."""
    low, high = np.log(box.T)
    places = np.array([random.permutation(count) for _ in box]).T + random.random((count, len(box)))
    return np.exp(low + (high - low) * places / count)


def around(random: np.random.Generator, box: np.ndarray, best: np.ndarray, share: float, count: int) -> np.ndarray:
    """(count, numbers) ndarray within a share of the box about the best one."""
    low, high = np.log(box.T)
    step = share * (high - low) * (2.0 * random.random((count, len(box))) - 1.0)
    return np.exp(np.clip(np.log(best) + step, low, high))


def feedback_gain(scales: Scales, omega: np.ndarray, x: np.ndarray, sign: np.ndarray) -> np.ndarray:
    """(n, N) complex: torque per speed difference [N m s/rad] of n feedbacks, as `speed_difference` has it sampled."""
    s = 2j / scales.dt * np.tan(0.5 * omega * scales.dt)
    lead = x[:, 1:2] * scales.latency
    gain = sign[:, None] * x[:, :1] * scales.gain * (lead * s + 1.0) / (lead / x[:, 2:3] * s + 1.0)
    if scales.second_hz is not None:
        w = 2.0 * np.pi * scales.second_hz * x[:, 3:4]
        warped = 1j * np.tan(0.5 * omega * scales.dt) / np.tan(0.5 * w * scales.dt)
        gain = gain * (warped**2 + 2.0 * x[:, 4:5] * warped + 1.0) / (warped**2 + 2.0 * x[:, 5:6] * warped + 1.0)
    return gain


def named(scales: Scales, x: np.ndarray, sign: float) -> dict[str, Any]:
    """The numbers of one feedback in physical units."""
    lead, notch = float(x[1] * scales.latency), scales.second_hz
    return {
        "gain": float(sign * x[0] * scales.gain),
        "lead": (lead, float(lead / x[2])),
        "notch_hz": None if notch is None else float(notch * x[3]),
        "notch_damping": None if notch is None else (float(x[4]), float(x[5])),
    }


def with_forward(scales: Scales, gains: dict[str, Any], y: np.ndarray) -> dict[str, Any]:
    """The numbers of a feedback and those of its feedforward, which has four for each mode that it exchanges."""
    model = scales.model
    found = dict(gains)
    modes = [("", model.frequency_hz, model.damping_ratio)]
    if len(y) > len(FEEDFORWARD) and scales.second_hz is not None:
        modes.append(("second_", scales.second_hz, scales.second_damping_ratio))
    for (start, hz, zeta), part in zip(modes, y.reshape(-1, len(FEEDFORWARD)), strict=True):
        found |= {
            f"{start}damping_ratio": float(part[0]),
            f"{start}frequency_hz": float(part[1] * hz),
            f"{start}cancelled_damping_ratio": float(part[2] * zeta),
            f"{start}cancelled_hz": float(part[3] * hz),
        }
    return found


def assembled(
    plant: SampledPlant, scales: Scales, feedback: control.StateSpace, gains: dict[str, Any]
) -> control.StateSpace:
    """The controller of a feedback and the feedforward with these numbers."""
    return two_dof(plant, scales.model, feedback, feedforward_of(plant, scales, gains))


def feedback_of(plant: SampledPlant, gains: dict[str, Any]) -> control.StateSpace:
    """The feedback with these numbers."""
    notch = {} if gains["notch_hz"] is None else {"notch_damping": gains["notch_damping"]}
    shaping = lead_notch(plant, gains["lead"], gains["notch_hz"], **notch)
    return speed_difference(plant, abs(gains["gain"]), shaping if gains["gain"] > 0.0 else -shaping)


def feedforward_of(plant: SampledPlant, scales: Scales, gains: dict[str, Any]) -> control.StateSpace:
    """The feedforward with these numbers."""
    first = _exchanged(plant, scales, gains, "")
    if "second_cancelled_hz" not in gains:
        return first
    both = _exchanged(plant, scales, gains, "second_") * first
    labels = {"inputs": first.input_labels, "outputs": first.output_labels}
    return linear_system(both.A, both.B, both.C, both.D, dt=plant.dt, **labels)


def _exchanged(plant: SampledPlant, scales: Scales, gains: dict[str, Any], start: str) -> control.StateSpace:
    """The poles of one mode exchanged."""
    model = scales.model
    share = gains[f"{start}cancelled_hz"] / model.frequency_hz
    cancelled = model.replace(
        stiffness=model.stiffness * share**2,
        damping=2.0 * gains[f"{start}cancelled_damping_ratio"] * share * model.omega / model.compliance_of_inertia,
    )
    return inverse_notch(plant, cancelled, gains[f"{start}damping_ratio"], gains[f"{start}frequency_hz"])
