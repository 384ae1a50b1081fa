"""Launching: the clutch slips, locks and changes the system."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.doors import checked
from ..base.units import to_rpm
from ..hybrid.response import Response
from .style import (
    COLOURS,
    LINES,
    Signals,
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
    from matplotlib.axes import Axes

    from .style import Panels, Run

DETAILED: dict[str, Any] = {"linestyle": LINES[0], "linewidth": 1.5}
CONTROL: dict[str, Any] = {"linestyle": (0, (4, 2)), "linewidth": 1.5}


@checked
def launch(
    response: Run,
    ratio: float | None = None,
    axes: Panels = None,
    locks: Sequence[float] | None = None,
    clutch: str = "clutch",
    driving: str = "engine",
    input_shaft: str = "clutch_secondary",
    wheels: str = "wheels",
    vehicle: str = "vehicle",
    unit: str = "m/s²",
) -> np.ndarray:
    """Torques, speeds and vehicle acceleration of a launch, as in Fig. 2.11; vertical lines where the clutch locks.

    Between speeds and acceleration stands the difference of the speeds of input shaft and wheels.

    Parameters
    ----------
    response : Response or control.TimeResponseData
    ratio : float, optional
        Driving speed / wheel speed with the clutch closed [-]; None leaves the wheels and the difference out.
    axes : sequence of 4 matplotlib Axes, optional
        Or of 3 without the difference.
    locks : sequence of float, optional
        Times at which the clutch locks [s]; those of the response's events, or of its mode, if not given.
    clutch, driving, input_shaft, wheels, vehicle : str
        Names of the clutch and of nodes; the input shaft is the node behind the clutch.
    unit : str
        Unit of the acceleration, for a vehicle that is a rotating inertia.

    Returns
    -------
    ndarray of 4 or 3 matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> axes = pt.plots.launch(pt.launch(pt.examples.conventional(damping="open")), ratio=18.0)
    >>> [text.get_text() for text in axes[1].texts]
    ['clutch closed']
    """
    with_difference = ratio is not None and (axes is None or len(axes) != 3)
    panels = (3, 4, 3, 4) if with_difference else (3, 4, 4)
    axes = new_axes(axes, len(panels), (6.8, 1.0 + 0.5 * sum(panels)), sharex=True, height_ratios=panels)
    torque, speed, acceleration = axes[0], axes[1], axes[-1]
    named = {"clutch": clutch, "driving": driving, "input_shaft": input_shaft, "vehicle": vehicle}
    require_signals(signals(response), **named, wheels=None if ratio is None else wheels)
    locks = _locks(response, clutch) if locks is None else locks
    response = signals(response)
    _torques(torque, response, clutch, driving)
    speed.plot(response.time, to_rpm(response[f"{driving}_speed"]), color=COLOURS[0], label=words(driving), **DETAILED)
    speed.plot(
        response.time,
        to_rpm(response[f"{input_shaft}_speed"]),
        color=COLOURS[2],
        label="input shaft",
        linestyle=LINES[1],
        linewidth=1.4,
    )
    if ratio is not None:
        turned = to_rpm(ratio * response[f"{wheels}_speed"])
        label = f"{words(wheels)} × {ratio:.4g}"
        speed.plot(response.time, turned, color=COLOURS[3], label=label, linestyle=LINES[2], linewidth=1.4)
    if with_difference and ratio is not None:
        difference(axes[2], response, input_shaft, ratio, wheels, color=COLOURS[0], **DETAILED)
        axes[2].set_ylabel(f"input shaft −\n{words(wheels)} × {ratio:.4g} [rpm]")
    acceleration.plot(response.time, response[f"{vehicle}_acceleration"], color=COLOURS[0], **DETAILED)
    speed.set_ylabel("speed [rpm]")
    acceleration.set_ylabel(f"{words(vehicle)}\nacceleration [{unit}]")
    legend(speed, 3)
    _mark_locks(axes, locks, speed)
    return axes


@checked
def launch_compared(
    responses: Mapping,
    axes: Panels = None,
    locks: Sequence[float] | None = None,
    clutch: str = "clutch",
    driving: str = "engine",
    input_shaft: str = "clutch_secondary",
    wheels: str = "wheels",
    vehicle: str = "vehicle",
    unit: str = "m/s²",
) -> np.ndarray:
    """Launch of the detailed and of a control model, as in Fig. 2.13, and by how much their speeds differ.

    Parameters
    ----------
    responses : dict of str to Response or control.TimeResponseData
        Two of them by the label in the legend, the detailed model first; it gives the torques and the lock.
    axes : sequence of 5 matplotlib Axes, optional
        Or of 4 without the difference.
    locks : sequence of float, optional
        Times at which the detailed model's clutch locks [s], as in `launch`.
    clutch, driving, input_shaft, wheels, vehicle : str
        As in `launch`.
    unit : str
        Unit of the acceleration.

    Returns
    -------
    ndarray of 5 or 4 matplotlib Axes

    Raises
    ------
    PowertrainError
        Responses that are not a mapping, or empty.
    SignalError
        A signal that a response does not have.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> closed = pt.two_mass(pt.examples.conventional(), "source")
    >>> car = pt.examples.conventional(damping="open")
    >>> slipping = pt.two_mass(car.release("clutch"), "source")
    >>> control_model = pt.SwitchedTwoMass(closed=closed, slipping=slipping)
    >>> axes = pt.plots.launch_compared({"detailed": pt.launch(car), "control": pt.launch(control_model)})
    >>> [ax.get_ylabel() for ax in axes][1:3]
    ['speed [rpm]', 'wheels\\nspeed [rpm]']
    """
    responses = labelled("responses", responses)
    panels = (3, 4, 4, 4) if axes is not None and len(axes) == 4 else (3, 4, 4, 3, 4)
    axes = new_axes(axes, len(panels), (6.8, 0.3 + 0.5 * sum(panels)), sharex=True, height_ratios=panels)
    torque, speed, wheel, acceleration = axes[0], axes[1], axes[2], axes[-1]
    first = next(iter(responses.values()))
    named = {"driving": driving, "input_shaft": input_shaft, "wheels": wheels, "vehicle": vehicle, "clutch": clutch}
    for given in responses.values():
        require_signals(signals(given), **named)
    locks = _locks(first, clutch) if locks is None else locks
    _torques(torque, signals(first), clutch, driving)
    for i, (label, given) in enumerate(responses.items()):
        response, line = signals(given), CONTROL if i else DETAILED
        engine, shaft, one = (COLOURS[5], COLOURS[2], COLOURS[2]) if i else (COLOURS[0], COLOURS[1], COLOURS[0])
        rpm = {node: to_rpm(response[f"{node}_speed"]) for node in (driving, input_shaft, wheels)}
        speed.plot(response.time, rpm[driving], color=engine, label=f"{words(driving)}, {label}", **line)
        speed.plot(response.time, rpm[input_shaft], color=shaft, label=f"input shaft, {label}", **line)
        wheel.plot(response.time, rpm[wheels], color=one, label=label, **line)
        acceleration.plot(response.time, response[f"{vehicle}_acceleration"], color=one, label=label, **line)
    if len(panels) == 5:
        _differences(
            axes[3], responses, {driving: COLOURS[0], input_shaft: COLOURS[2], wheels: COLOURS[3]}, input_shaft
        )
    speed.set_ylabel("speed [rpm]")
    wheel.set_ylabel(f"{words(wheels)}\nspeed [rpm]")
    acceleration.set_ylabel(f"{words(vehicle)}\nacceleration [{unit}]")
    legend(speed, len(responses))
    legend(wheel, len(responses))
    legend(acceleration, len(responses))
    _mark_locks(axes, locks, speed)
    return axes


def _differences(ax: Axes, responses: Mapping, nodes: Mapping[str, str], input_shaft: str) -> None:
    """Speed of each node in the second response less that in the first one, where that has samples."""
    first, second = (
        [signals(response) for response in list(responses.values())[:2]] if len(responses) > 1 else (None, None)
    )
    if first is None or second is None:
        return
    for i, (node, colour) in enumerate(nodes.items()):
        name = "input shaft" if node == input_shaft else words(node)
        other = np.interp(first.time, second.time, second[f"{node}_speed"])
        line: dict[str, Any] = {"color": colour, "linestyle": LINES[i], "linewidth": 1.3, "label": name}
        ax.plot(first.time, to_rpm(other - first[f"{node}_speed"]), **line)
    ax.set_ylabel("second − first\n[rpm]")
    legend(ax, len(nodes))


def _torques(ax: Axes, response: Response | Signals, clutch: str, driving: str) -> None:
    ax.plot(
        response.time, response[f"{driving}_torque"], color=shade(0.15), label=f"{words(driving)} torque", **DETAILED
    )
    ax.plot(
        response.time,
        response[f"{clutch}_capacity"],
        color=COLOURS[2],
        label=f"{words(clutch)} torque, reference",
        linestyle=LINES[1],
        linewidth=1.5,
    )
    ax.set_ylabel("torque [N m]")
    legend(ax, 2)


def _locks(response: Run, clutch: str) -> list[float]:
    """Times of lock: of the events where the response has them, else the first samples in mode 0."""
    if hasattr(response, "events"):
        return [event.time for event in response.events if (event.element, event.kind) == (clutch, "lock")]
    response = signals(response)
    stuck = response[f"{clutch}_mode"] == 0.0
    return list(response.time[1:][stuck[1:] & ~stuck[:-1]])


def _mark_locks(axes: Sequence[Axes] | np.ndarray, locks: Sequence[float], labelled: Axes) -> None:
    axes[-1].set_xlabel("time [s]")
    finish(axes)
    for ax in axes:
        for time in locks:
            ax.axvline(time, color=shade(0.35), linewidth=0.9, linestyle=(0, (2, 2)), zorder=1.5)
    if len(locks):
        labelled.annotate(
            "clutch closed",
            (float(np.max(locks)), 0.06),
            xycoords=labelled.get_xaxis_transform(),
            xytext=(4, 0),
            textcoords="offset points",
            fontsize="small",
            color=shade(0.25),
        )
