"""Anti-jerk control over time, and what its designs trade."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.checks import checked_mapping
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.units import to_rpm
from ..hybrid.metrics import RideMetrics
from ..hybrid.response import Response
from .style import (
    COLOURS,
    design_line,
    finish,
    grid,
    labelled,
    legend,
    new_axes,
    require_signals,
    shade,
    words,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .style import Panels


@checked
def tip_in(
    responses: Mapping[str, Response] | Response, axes: Panels = None, vehicle: str = "vehicle", unit: str = "m/s²"
) -> np.ndarray:
    """Torque, vehicle acceleration, speed difference and intervention over time, loops against each other.

    Parameters
    ----------
    responses : Response, or dict of str to Response
        Of `closed_loop` or a manoeuvre of `studies`, by the label in the legend; the demand is that of the first.
    axes : sequence of 4 matplotlib Axes, optional
    vehicle, unit : str
        What is driven, and the unit in which it accelerates: of a `SampledPlant` that is no car "rotor" and "rad/s²".

    Returns
    -------
    ndarray of 4 matplotlib Axes

    Raises
    ------
    PowertrainError
        No response.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> axes = pt.plots.tip_in({"open loop": pt.tip_in(plant)})
    >>> axes[0].get_ylabel(), axes[3].get_xlabel()
    ('torque [N m]', 'time [s]')
    """
    responses = labelled("responses", responses, "response")
    axes = new_axes(axes, 4, (6.8, 7.6), sharex=True, height_ratios=(4, 4, 3, 3))
    torque, acceleration, difference, intervention = axes
    first = next(iter(responses.values()))
    torque.plot(first.time, first["torque_demand"], color=shade(0.75), linewidth=4.0, label="demand")
    for i, (label, response) in enumerate(responses.items()):
        line = design_line(i)
        torque.plot(response.time, response["torque_command"], label=f"command, {label}", **line)
        acceleration.plot(response.time, response["vehicle_acceleration"], label=label, **line)
        difference.plot(response.time, to_rpm(response["speed_difference"]), label=label, **line)
        intervention.plot(response.time, response["intervention"], label=label, **line)
    torque.set_ylabel("torque [N m]")
    acceleration.set_ylabel(f"{words(vehicle)}\nacceleration [{unit}]")
    difference.set_ylabel("speed\ndifference [rpm]")
    intervention.set_ylabel("intervention\n[N m]")
    intervention.set_xlabel("time [s]")
    legend(torque, 1 + len(responses) if len(responses) < 3 else 2)
    if len(responses) > 2:
        legend(acceleration, 3)
    finish(axes)
    return axes


@checked
def controlled_launch(
    responses: Mapping[str, Response] | Response,
    ratio: float | None = None,
    axes: Panels = None,
    driving: str = "engine",
    wheels: str = "wheels",
    vehicle: str = "vehicle",
) -> np.ndarray:
    """Torque, speeds and vehicle acceleration of launches over time; a vertical line where a clutch locks.

    Parameters
    ----------
    responses : Response, or dict of str to Response
        Of `controlled_launch`, by the label in the legend; demand and clutch capacity are those of the first.
    ratio : float, optional
        Driving speed / wheel speed [-], by which the wheel speed is multiplied; None leaves the wheels out.
    axes : sequence of 3 matplotlib Axes, optional
    driving, wheels, vehicle : str
        Names of the nodes.

    Returns
    -------
    ndarray of 3 matplotlib Axes

    Raises
    ------
    PowertrainError
        No response.
    SignalError
        A signal that a response does not have.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional(damping="open"))
    >>> axes = pt.plots.controlled_launch({"open loop": pt.controlled_launch(plant, None)}, plant.ratio)
    >>> axes[1].get_ylabel(), axes[2].get_ylabel()
    ('speed [rpm]', 'vehicle\\nacceleration [m/s²]')
    """
    responses = labelled("responses", responses, "response")
    axes = new_axes(axes, 3, (6.8, 6.6), sharex=True, height_ratios=(4, 4, 4))
    torque, speed, acceleration = axes
    first = next(iter(responses.values()))
    torque.plot(first.time, first["torque_demand"], color=shade(0.75), linewidth=4.0, label="demand")
    for i, (label, response) in enumerate(responses.items()):
        require_signals(response, driving=driving, vehicle=vehicle, wheels=None if ratio is None else wheels)
        line = design_line(i)
        torque.plot(response.time, response["torque_command"], label=f"command, {label}", **line)
        speed.plot(response.time, to_rpm(response[f"{driving}_speed"]), label=f"{words(driving)}, {label}", **line)
        if ratio is not None:
            speed.plot(
                response.time,
                to_rpm(ratio * response[f"{wheels}_speed"]),
                label=f"{words(wheels)} × {ratio:.4g}, {label}",
                **line | {"linewidth": 0.9},
            )
        acceleration.plot(response.time, response[f"{vehicle}_acceleration"], label=label, **line)
        for event in response.events:
            if event.kind == "lock":
                for ax in axes:
                    ax.axvline(event.time, color=line["color"], linewidth=0.7, alpha=0.6, zorder=0.5)
    torque.set_ylabel("torque [N m]")
    speed.set_ylabel("speed [rpm]")
    acceleration.set_ylabel(f"{words(vehicle)}\nacceleration [m/s²]")
    acceleration.set_xlabel("time [s]")
    legend(torque, 3)
    legend(speed, 2)
    finish(axes)
    return axes


@checked
def trade_off(
    points: Mapping[str, RideMetrics], baseline: Mapping[float, RideMetrics] | None = None, ax: Axes | None = None
) -> Axes:
    """Overshoot against rise time of designs, beside a pedal that is just slower.

    Parameters
    ----------
    points : dict of str to RideMetrics
        Design to the metrics of its tip-in; numbered in this order.
    baseline : dict of float to RideMetrics, optional
        Length of the ramp [s] to the metrics without a controller.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        Points that are not a mapping; neither points nor a baseline.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> open_loop = {0.1: pt.studies.tip_in_metrics(plant, pt.tip_in(plant))}
    >>> pt.plots.trade_off({}, open_loop).get_ylabel()
    'overshoot [% of final value], logarithmic above 1 %'
    """
    points = checked_mapping("points", points, "from label to metrics")
    if not points and not baseline:
        raise PowertrainError("points and baseline are empty, permitted: at least one of them with metrics")
    ax = new_axes(ax, 1, (7.2, 4.4))[0]
    if baseline:
        t90 = [1e3 * metrics.t90 for metrics in baseline.values()]
        overshoot = [100.0 * metrics.overshoot for metrics in baseline.values()]
        ax.plot(
            t90,
            overshoot,
            color=shade(0.35),
            linewidth=1.4,
            marker="|",
            markersize=9,
            label="slower pedal, open loop",
            zorder=2,
        )
        for length, x, y in zip(baseline, t90, overshoot, strict=True):
            ax.annotate(
                f"{1e3 * length:.0f} ms",
                (x, y),
                xytext=(5, 4),
                textcoords="offset points",
                fontsize="x-small",
                color=shade(0.35),
            )
    for i, (label, metrics) in enumerate(points.items()):
        ax.plot(
            [1e3 * metrics.t90],
            [100.0 * metrics.overshoot],
            linestyle="none",
            marker="o",
            color=COLOURS[0],
            markerfacecolor="none",
            markersize=6,
            label=f"{i + 1}  {label}",
            zorder=3,
        )
    ax.set_yscale("symlog", linthresh=1.0, linscale=0.6)
    ax.set_ylim(bottom=-0.15)
    ax.set_yticks([0, 0.5, 1, 2, 5, 10, 20, 50], ["0", "0.5", "1", "2", "5", "10", "20", "50"])
    ax.set_xlabel("time to 90 % of the final acceleration [ms]")
    ax.margins(x=0.12)  # for the lengths beside the line
    ax.set_ylabel("overshoot [% of final value], logarithmic above 1 %")
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize="small", handlelength=1.0)
    grid(ax, "both")
    _number_points(ax, np.array([[1e3 * each.t90, 100.0 * each.overshoot] for each in points.values()]))
    return ax


def _number_points(ax: Axes, points: np.ndarray) -> None:
    """Number each point where its number is farthest from other points and numbers."""
    if not len(points):
        return
    root: Any = ax.figure.figure
    root.draw_without_rendering()
    scale = 72.0 / ax.figure.dpi
    place = scale * ax.transData.transform(points)
    directions = np.array([(1, 0.6), (1, -0.8), (-1, 0.6), (-1, -0.8), (0, 1.1), (0, -1.2), (1.1, 0), (-1.1, 0)])
    taken = [*place]
    for i, at in enumerate(place):
        if not np.isfinite(at).all():
            continue
        others = np.array([other for j, other in enumerate(taken) if j != i and np.isfinite(other).all()])
        tries = at + 9.5 * directions
        room = np.full(len(tries), np.inf)
        if len(others):
            room = np.linalg.norm(tries[:, None] - others[None], axis=2).min(axis=1)
        best = int(np.minimum(room, 14.0).argmax())
        taken.append(tries[best])
        offset = 9.5 * directions[best]
        ax.annotate(
            str(i + 1), points[i], xytext=offset, textcoords="offset points", fontsize="small", ha="center", va="center"
        )
