"""Responses over time and over frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.units import to_hz, to_rpm
from .style import COLOURS, LINES, finish, labelled, legend, new_axes, require_signals, signals, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .style import Panels

# A phase that jumps up by half a turn less than this [rad] has jumped down: beside an undamped resonance the response is
# small against its terms and its phase is off by up to 1e-3.
HALF_TURN = 1e-2


@checked
def load_change(
    responses: Mapping,
    ratio: float | None = None,
    axes: Panels = None,
    driving: str = "engine",
    wheels: str = "wheels",
    vehicle: str = "vehicle",
    unit: str = "m/s²",
) -> np.ndarray:
    """Driving torque, speeds and vehicle acceleration over time, as in Figs. 2.7 and 2.9.

    Parameters
    ----------
    responses : dict of str to Response or control.TimeResponseData
        By the label in the legend; the first one gives the torque.
    ratio : float, optional
        Driving speed / wheel speed [-], by which the wheel speed is multiplied; None leaves the wheels out, and
        colours then tell the responses apart.
    axes : sequence of 3 matplotlib Axes, optional
    driving, wheels, vehicle : str
        Names of the nodes.
    unit : str
        Unit of the acceleration, for a vehicle that is a rotating inertia.

    Returns
    -------
    ndarray of 3 matplotlib Axes

    Raises
    ------
    PowertrainError
        Responses that are not a mapping, or empty.
    SignalError
        A signal that a response does not have.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> axes = pt.plots.load_change({"detailed": pt.load_change(pt.examples.conventional())}, ratio=18.0)
    >>> axes[2].get_xlabel(), axes[1].get_ylabel()
    ('time [s]', 'speed [rpm]')
    """
    responses = labelled("responses", responses)
    several = len(responses) > 1
    axes = new_axes(axes, 3, (6.5, 6.4), sharex=True, height_ratios=(3, 4, 4))
    torque, speed, acceleration = axes
    for i, (label, given) in enumerate(responses.items()):
        response = signals(given)
        require_signals(response, driving=driving, vehicle=vehicle, wheels=None if ratio is None else wheels)
        line, name = {"linestyle": LINES[i % len(LINES)], "linewidth": 1.4}, f", {label}" if several else ""
        colour = COLOURS[(0, 2, 3, 4, 1, 5)[i % 6]]
        if i == 0:
            torque.plot(response.time, response[f"{driving}_torque"], color="0.15", linewidth=1.5)
        speed.plot(
            response.time,
            to_rpm(response[f"{driving}_speed"]),
            color=COLOURS[0] if ratio is not None else colour,
            label=f"{words(driving)}{name}",
            **line,
        )
        if ratio is not None:
            speed.plot(
                response.time,
                to_rpm(ratio * response[f"{wheels}_speed"]),
                color=COLOURS[1],
                label=f"{words(wheels)} × {ratio:.4g}{name}",
                **(line if several else line | {"linestyle": LINES[1]}),
            )
        acceleration.plot(response.time, response[f"{vehicle}_acceleration"], color=colour, label=label, **line)
    torque.set_ylabel(f"{words(driving)}\ntorque [N m]")
    speed.set_ylabel("speed [rpm]")
    acceleration.set_ylabel(f"{words(vehicle)}\nacceleration [{unit}]")
    acceleration.set_xlabel("time [s]")
    if ratio is None:
        speed.set_ylabel(f"{words(driving)}\nspeed [rpm]")
    else:
        legend(speed, 2)
    if several:
        legend(acceleration, len(responses))
    finish(axes)
    return axes


@checked
def bode(responses: Mapping, axes: Panels = None, unit: str = "") -> np.ndarray:
    """Magnitude [dB] and phase [deg] over frequency [Hz].

    Parameters
    ----------
    responses : dict of str to control.FrequencyResponseData
        By the label in the legend; one input and one output each, over angular frequencies ``omega`` [rad/s].
    axes : sequence of 2 matplotlib Axes, optional
    unit : str
        Unit of the gain, named as that of 0 dB.

    Returns
    -------
    ndarray of 2 matplotlib Axes

    Raises
    ------
    PowertrainError
        Responses that are not a mapping, or empty; something else in it than a frequency response.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> omega = 2 * np.pi * np.geomspace(0.1, 1e3, 50)
    >>> G = pt.frequency_response(pt.examples.conventional(), omega, "engine_torque", "vehicle_acceleration")
    >>> axes = pt.plots.bode({"detailed": G})
    >>> axes[0].get_ylabel(), axes[1].get_xlabel()
    ('magnitude [dB]', 'frequency [Hz]')
    """
    responses = labelled("responses", responses)
    for label, response in responses.items():
        if not hasattr(response, "magnitude"):
            raise PowertrainError(
                f'"{label}" is a {type(response).__name__}, permitted: pt.frequency_response(car, omega, input, output)'
            )
    axes = new_axes(axes, 2, (6.5, 5.0), sharex=True, height_ratios=(3, 2))
    for i, (label, response) in enumerate(responses.items()):
        gain = np.ravel(response.magnitude).astype(float)
        gain[gain == 0.0] = np.nan
        frequency, phase = to_hz(np.asarray(response.omega)), np.degrees(_unwrapped(np.ravel(response.phase)))
        line = {
            "color": COLOURS[(0, 2, 3, 1, 4, 5)[i % 6]],
            "linestyle": LINES[i % len(LINES)],
            "linewidth": 1.5,
            "label": label,
        }
        axes[0].semilogx(frequency, 20.0 * np.log10(gain), **line)
        axes[1].semilogx(frequency, phase, **line)
    axes[0].set_ylabel(f"magnitude [dB]\n0 dB = 1 {unit}" if unit else "magnitude [dB]")
    axes[1].set_ylabel("phase [deg]")
    axes[1].set_xlabel("frequency [Hz]")
    _ticks(axes[0], 20.0, most=8)
    _ticks(axes[1], 90.0, most=6)
    if len(responses) > 1:
        legend(axes[0], len(responses))
    finish(axes)
    return axes


def _ticks(ax: Axes, step: float, most: int) -> None:
    """Ticks at multiples of a step that Bode diagrams have, wider where there would be too many."""
    low, high = ax.get_ylim()
    step *= max(1.0, np.ceil((high - low) / (most * step)))
    ax.set_yticks(np.arange(step * np.ceil(low / step), high + 1e-9, step))


def _unwrapped(phase: np.ndarray) -> np.ndarray:
    """Phase without jumps of a full turn; half a turn, as at an undamped resonance, counts as a lag."""
    half = np.pi + HALF_TURN
    return phase[0] + np.concatenate([[0.0], np.cumsum((np.diff(phase) + half) % (2.0 * np.pi) - half)])
