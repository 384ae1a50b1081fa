"""Responses over time and over frequency."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.units import to_hz, to_rpm
from .style import (
    COLOURS,
    LINES,
    difference,
    finish,
    labelled,
    legend,
    new_axes,
    require_signals,
    shade,
    signals,
    words,
)

if TYPE_CHECKING:
    import control
    from matplotlib.axes import Axes

    from .style import Panels, Run

# A phase that jumps up by half a turn less than this [rad] has jumped down: beside an undamped resonance the response is
# small against its terms and its phase is off by up to 1e-3.
HALF_TURN = 1e-2


@checked
def load_change(
    responses: Mapping | Run,
    ratio: float | None = None,
    axes: Panels = None,
    driving: str = "engine",
    wheels: str = "wheels",
    vehicle: str = "vehicle",
    unit: str = "m/s²",
) -> np.ndarray:
    """Driving torque, speeds and vehicle acceleration over time, as in Figs. 2.7 and 2.9.

    Between speeds and acceleration stands the difference of the speeds of driving node and wheels, which swings by less
    than can be seen beside the speeds themselves.

    Parameters
    ----------
    responses : Response or control.TimeResponseData, or dict of str to them
        Several by the label in the legend; the first one gives the torque.
    ratio : float, optional
        Driving speed / wheel speed [-], by which the wheel speed is multiplied; None leaves the wheels and the
        difference out, and colours then tell the responses apart.
    axes : sequence of 4 matplotlib Axes, optional
        Or of 3 without the difference.
    driving, wheels, vehicle : str
        Names of the nodes.
    unit : str
        Unit of the acceleration, for a vehicle that is a rotating inertia.

    Returns
    -------
    ndarray of 4 or 3 matplotlib Axes

    Raises
    ------
    PowertrainError
        No response.
    SignalError
        A signal that a response does not have.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> axes = pt.plots.load_change(pt.load_change(pt.examples.conventional()), ratio=18.0)
    >>> [ax.get_ylabel().replace(chr(10), " ") for ax in axes]
    ['engine torque [N m]', 'speed [rpm]', 'engine − wheels × 18 [rpm]', 'vehicle acceleration [m/s²]']
    """
    responses = labelled("responses", responses, "response")
    several = len(responses) > 1
    with_difference = ratio is not None and (axes is None or len(axes) != 3)
    panels = (3, 4, 3, 4) if with_difference else (3, 4, 4)
    axes = new_axes(axes, len(panels), (6.5, 1.0 + 0.5 * sum(panels)), sharex=True, height_ratios=panels)
    torque, speed, acceleration = axes[0], axes[1], axes[-1]
    for i, (label, given) in enumerate(responses.items()):
        response = signals(given)
        require_signals(response, driving=driving, vehicle=vehicle, wheels=None if ratio is None else wheels)
        line, name = {"linestyle": LINES[i % len(LINES)], "linewidth": 1.4}, f", {label}" if several else ""
        colour = COLOURS[(0, 2, 3, 4, 1, 5)[i % 6]]
        if i == 0:
            torque.plot(response.time, response[f"{driving}_torque"], color=shade(0.15), linewidth=1.5)
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
        if with_difference and ratio is not None:
            difference(axes[2], response, driving, ratio, wheels, color=colour, **line)
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
def bode(
    responses: Mapping | control.FrequencyResponseData | control.StateSpace | control.TransferFunction,
    axes: Panels = None,
    unit: str = "",
) -> np.ndarray:
    """Magnitude [dB] and phase [deg] over frequency [Hz].

    Parameters
    ----------
    responses : frequency response or system of python-control, or dict of str to them
        Several by the label in the legend; one input and one output each. A system is shown at the frequencies that
        python-control finds for it.
    axes : sequence of 2 matplotlib Axes, optional
    unit : str
        Unit of the gain, named as that of 0 dB.

    Returns
    -------
    ndarray of 2 matplotlib Axes

    Raises
    ------
    PowertrainError
        No response; something else than a frequency response or a system.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> omega = 2 * np.pi * np.geomspace(0.1, 1e3, 50)
    >>> G = pt.frequency_response(pt.examples.conventional(), omega, "engine_torque", "vehicle_acceleration")
    >>> axes = pt.plots.bode({"detailed": G})
    >>> axes[0].get_ylabel(), axes[1].get_xlabel()
    ('magnitude [dB]', 'frequency [Hz]')
    """
    responses = {label: _over_frequency(label, r) for label, r in labelled("responses", responses, "response").items()}
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


def _over_frequency(label: str, given: Any) -> Any:
    """A frequency response with one input and one output; a system becomes one."""
    import control

    response = control.frequency_response(given) if isinstance(given, control.lti.LTI) else given
    if not hasattr(response, "magnitude"):
        raise PowertrainError(
            f'"{label}" is a {type(given).__name__}, permitted: pt.frequency_response(car, omega, input, output), or a '
            "system of python-control"
        )
    if np.ravel(response.magnitude).size != np.size(response.omega):
        raise PowertrainError(f'"{label}" has several inputs or outputs, permitted: one of each')
    return response


def _ticks(ax: Axes, step: float, most: int) -> None:
    """Ticks at multiples of a step that Bode diagrams have, wider where there would be too many, with short ones between."""
    low, high = ax.get_ylim()
    wide = step * max(1.0, np.ceil((high - low) / (most * step)))
    ax.set_yticks(np.arange(wide * np.ceil(low / wide), high + 1e-9, wide))
    between = 0.5 * wide
    ax.set_yticks(np.arange(between * np.ceil(low / between), high + 1e-9, between), minor=True)


def _unwrapped(phase: np.ndarray) -> np.ndarray:
    """Phase without jumps of a full turn; half a turn, as at an undamped resonance, counts as a lag."""
    half = np.pi + HALF_TURN
    return phase[0] + np.concatenate([[0.0], np.cumsum((np.diff(phase) + half) % (2.0 * np.pi) - half)])
