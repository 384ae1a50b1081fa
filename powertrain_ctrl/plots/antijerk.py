"""Figures of anti-jerk control. As in `plots`: each draws on the axes it is given, or on new ones, and returns them."""

from collections.abc import Mapping, Sequence

import numpy as np

from ..loops import FIRST_MODE, NO_FEEDBACK, SECOND_MODE, LoopMargins
from ..metrics import RideMetrics
from ..response import Response
from ..studies import Robustness
from ..units import to_hz, to_rpm
from .style import COLOURS, LINES, grid, legend, new_axes, words

# Open loop first, then designs.
ORDER = (COLOURS[2], COLOURS[0], COLOURS[3], COLOURS[1], COLOURS[4], COLOURS[5])
STYLES = (LINES[1], LINES[0], *LINES[2:])
MARKERS = ("x", "o", "s", "^", "D", "v")
ZETA_LINES = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7)


def tip_in(responses: Mapping[str, Response], axes=None):
    """Torque, vehicle acceleration, speed difference and intervention over time, loops against each other.

    Parameters
    ----------
    responses : dict of str to Response
        Of `closed_loop` or a manoeuvre of `studies`, by the label in the legend; the demand is that of the first.
    axes : sequence of 4 matplotlib Axes, optional

    Returns
    -------
    ndarray of 4 matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> axes = tip_in({"open loop": pt.tip_in(plant)})
    >>> axes[0].get_ylabel(), axes[3].get_xlabel()
    ('torque [N m]', 'time [s]')
    """
    axes = new_axes(axes, 4, (6.8, 7.6), sharex=True, height_ratios=(4, 4, 3, 3))
    torque, acceleration, difference, intervention = axes
    first = next(iter(responses.values()))
    torque.plot(first.time, first["torque_demand"], color="0.75", linewidth=4.0, label="demand")
    for i, (label, response) in enumerate(responses.items()):
        line = _line(i)
        torque.plot(response.time, response["torque_command"], label=f"command, {label}", **line)
        acceleration.plot(response.time, response["vehicle_acceleration"], label=label, **line)
        difference.plot(response.time, to_rpm(response["speed_difference"]), label=label, **line)
        intervention.plot(response.time, response["intervention"], label=label, **line)
    torque.set_ylabel("torque [N m]")
    acceleration.set_ylabel("vehicle\nacceleration [m/s²]")
    difference.set_ylabel("speed\ndifference [rpm]")
    intervention.set_ylabel("intervention [N m]")
    intervention.set_xlabel("time [s]")
    legend(torque, 1 + len(responses) if len(responses) < 3 else 2)
    if len(responses) > 2:
        legend(acceleration, 3)
    _finish(axes)
    return axes


def controlled_launch(
    responses: Mapping[str, Response],
    ratio: float | None = None,
    axes=None,
    driving: str = "engine",
    wheels: str = "wheels",
    vehicle: str = "vehicle",
):
    """Torque, speeds and vehicle acceleration of launches over time; a vertical line where a clutch locks.

    Parameters
    ----------
    responses : dict of str to Response
        Of `controlled_launch`, by the label in the legend; demand and clutch capacity are those of the first.
    ratio : float, optional
        Driving speed / wheel speed [-], by which the wheel speed is multiplied; None leaves the wheels out.
    axes : sequence of 3 matplotlib Axes, optional
    driving, wheels, vehicle : str
        Names of the nodes.

    Returns
    -------
    ndarray of 3 matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional(damping="open"))
    >>> axes = controlled_launch({"open loop": pt.controlled_launch(plant, None)}, plant.ratio)
    >>> axes[1].get_ylabel(), axes[2].get_ylabel()
    ('speed [rpm]', 'vehicle\\nacceleration [m/s²]')
    """
    axes = new_axes(axes, 3, (6.8, 6.6), sharex=True, height_ratios=(4, 4, 4))
    torque, speed, acceleration = axes
    first = next(iter(responses.values()))
    torque.plot(first.time, first["torque_demand"], color="0.75", linewidth=4.0, label="demand")
    for i, (label, response) in enumerate(responses.items()):
        line = _line(i)
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
    _finish(axes)
    return axes


def pole_map(margins: Mapping[str, LoopMargins], ax=None):
    """Poles ``log(z) / dt`` of loops in the upper half plane, with lines of damping ratio and the bands of both modes.

    Parameters
    ----------
    margins : dict of str to LoopMargins
        By the label in the legend.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> pole_map({"open loop": pt.loop_margins(plant, None)}).get_ylabel()
    'imaginary part / 2π [Hz]'
    """
    from matplotlib.patches import Wedge

    ax = new_axes(ax, 1, (6.2, 5.4))[0]
    poles = {label: to_hz(record.poles[record.poles.imag >= 0.0]) for label, record in margins.items()}
    every = np.concatenate(list(poles.values()))
    seen = every[(np.abs(every) <= SECOND_MODE[1]) & (-every.real < 0.5 * np.abs(every))]
    top = 1.25 * max(np.abs(seen).max(initial=0.0), 1.1 * FIRST_MODE[1])
    right = max(0.04 * top, 1.1 * every.real.max(initial=0.0))
    left = -0.95 * top
    for (low, high), colour, name in (
        (FIRST_MODE, COLOURS[5], "first mode"),
        (SECOND_MODE, COLOURS[1], "second mode"),
    ):
        label = f"{name}, {low:g}–{high:g} Hz"
        ax.add_patch(
            Wedge((0.0, 0.0), high, 90.0, 180.0, width=high - low, color=colour, alpha=0.15, linewidth=0.0, label=label)
        )
    reach = 0.98 * np.hypot(left, top)
    for zeta in ZETA_LINES:
        ray = reach * np.exp(1j * (np.pi / 2.0 + np.arcsin(zeta)))
        shrink = min(1.0, 0.985 * top / ray.imag, 0.985 * left / ray.real)
        ray *= shrink
        ax.plot([0.0, ray.real], [0.0, ray.imag], color="0.6", linewidth=0.7, linestyle=(0, (2, 2)), zorder=1)
        ax.text(ray.real, ray.imag, f"ζ = {zeta:g}" if zeta == ZETA_LINES[-1] else f"{zeta:g}", fontsize="x-small")
    ax.axvline(0.0, color="0.4", linewidth=0.8, zorder=1)
    for i, (label, values) in enumerate(poles.items()):
        marker = MARKERS[i % len(MARKERS)]
        face = ORDER[i % len(ORDER)] if marker == "x" else "none"
        edge = {} if marker == "x" else {"edgecolors": ORDER[i % len(ORDER)]}
        ax.scatter(values.real, values.imag, s=38, marker=marker, c=face, linewidths=1.6, label=label, zorder=3, **edge)
    ax.set_xlim(left, right)
    ax.set_ylim(-0.02 * top, top)
    ax.set_aspect("equal")
    ax.set_xlabel("real part / 2π [Hz]")
    ax.set_ylabel("imaginary part / 2π [Hz]")
    legend(ax, 3)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


def nyquist(margins: Mapping[str, LoopMargins], ax=None):
    """Loop gain at the plant input in the complex plane, the point -1 and the disk each loop keeps clear of.

    A balanced disk margin alpha means that the loop stays outside the circle through ``-(2 + alpha) / (2 - alpha)``
    and ``-(2 - alpha) / (2 + alpha)`` on the real axis, and touches it.

    Parameters
    ----------
    margins : dict of str to LoopMargins
        By the label in the legend; one without feedback is left out.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.designs(plant)["proven"]
    >>> nyquist({"proven": pt.loop_margins(plant, controller)}).get_xlabel()
    'real part [-]'
    """
    from matplotlib.patches import Circle

    ax = new_axes(ax, 1, (6.2, 5.6))[0]
    sizes, left = [1.2], 2.4
    for i, (label, record) in enumerate(margins.items(), start=1):
        if not record.loop.any():
            continue
        line = _line(i)
        alpha = record.disk_margin
        name = f"{label}, disk margin {alpha:.2f}" if alpha > 0.0 else f"{label}, unstable"
        ax.plot(record.loop.real, record.loop.imag, label=name, **line)
        sizes.append(np.abs(record.loop).max())
        if 0.0 < alpha < NO_FEEDBACK:
            centre, radius = disk(alpha)
            ax.add_patch(Circle((centre, 0.0), radius, color=line["color"], alpha=0.10, linewidth=0.0))
            left = max(left, min(1.05 * (radius - centre), 6.0))
            ax.add_patch(Circle((centre, 0.0), radius, fill=False, edgecolor=line["color"], linewidth=0.8))
    ax.plot([-1.0], [0.0], marker="+", color="black", markersize=10, markeredgewidth=1.6, linestyle="none")
    ax.annotate("−1", (-1.0, 0.0), xytext=(4, 5), textcoords="offset points")
    ax.axhline(0.0, color="0.4", linewidth=0.7, zorder=0.8)
    ax.axvline(0.0, color="0.4", linewidth=0.7, zorder=0.8)
    reach = 1.08 * min(max(sizes), 6.0)
    ax.set_xlim(-left, reach)
    ax.set_ylim(-0.72 * reach, 0.72 * reach)
    ax.set_aspect("equal")
    ax.set_xlabel("real part [-]")
    ax.set_ylabel("imaginary part [-]")
    if len(ax.get_lines()) > 3:
        legend(ax, 2)
    grid(ax, "both")
    return ax


def disk(alpha: float) -> tuple[float, float]:
    """Centre on the real axis and radius of the circle that a loop with disk margin ``alpha`` < 2 keeps clear of.

    >>> centre, radius = disk(1.0)
    >>> round(centre - radius, 6), round(centre + radius, 6)
    (-3.0, -0.333333)
    """
    return -(4.0 + alpha**2) / (4.0 - alpha**2), 4.0 * alpha / (4.0 - alpha**2)


SPREAD = (
    ("oscillation_reduction", "oscillation\nless than open [%]", 100.0, "{:.1f}"),
    ("disk_margin", "disk margin [-]", 1.0, "{:.2f}"),
    ("zeta_first", "ζ of first\nmode [-]", 1.0, "{:.2f}"),
    ("zeta_second", "ζ of second\nmode [-]", 1.0, "{:.3f}"),
)


def robust_spread(robustness: Robustness, axes=None):
    """Tip-in oscillation, disk margin and damping ratios of one controller on every plant, the worst marked.

    Parameters
    ----------
    robustness : Robustness
        The vertical line is its first plant. Plants with an unstable loop are named so and have no oscillation.
    axes : sequence of 4 matplotlib Axes, optional
        Beside each other, with the same vertical axis.

    Returns
    -------
    ndarray of 4 matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> result = pt.robustness(plant, pt.antijerk.designs(plant)["proven"], {"nominal": plant})
    >>> [ax.get_xlabel().replace(chr(10), " ") for ax in robust_spread(result)][1]
    'disk margin [-]'
    """
    count = len(robustness.proofs)
    if axes is None:
        import matplotlib.pyplot as plt

        height = 1.3 + 0.19 * count
        _, axes = plt.subplots(1, 4, figsize=(7.4, height), layout="constrained", sharey=True)
    axes = new_axes(axes, 4, (7.4, 6.0))
    names = list(robustness.proofs)
    place = np.arange(count)
    for ax, (quantity, label, scale, number) in zip(axes, SPREAD, strict=True):
        values = scale * np.array([_value(proof, quantity) for proof in robustness.proofs.values()])
        finite = np.isfinite(values)
        if finite[0]:
            ax.axvline(values[0], color="0.45", linewidth=0.8, zorder=1)
        ax.scatter(values[finite], place[finite], s=20, color=COLOURS[0], zorder=3)
        if finite.any():
            worst = names.index(robustness.worst(quantity)[0]) if finite.all() else int(np.nanargmin(_masked(values)))
            ax.scatter(
                values[worst], worst, s=60, marker="D", facecolor="none", edgecolor=COLOURS[2], zorder=4, linewidth=1.5
            )
            low, high = values[finite].min(), values[finite].max()
            room = 0.16 * max(high - low, 1e-3)
            ax.set_xlim(low - 1.4 * room, high + room)
            is_left = values[worst] < 0.5 * (low + high)
            ax.annotate(
                number.format(values[worst]),
                (values[worst], worst),
                xytext=(8 if is_left else -8, 0),
                textcoords="offset points",
                ha="left" if is_left else "right",
                va="center",
                color=COLOURS[2],
                fontsize="small",
                fontweight="bold",
            )
        ax.set_xlabel(label, fontsize="small")
        ax.tick_params(axis="x", labelsize="small")
        grid(ax, "both")
    stable = [proof.margins.stable for proof in robustness.proofs.values()]
    labels = [name if ok else f"{name} (unstable)" for name, ok in zip(names, stable, strict=True)]
    axes[0].set_yticks(place, labels, fontsize="x-small")
    axes[0].set_ylim(count - 0.4, -0.6)
    for ax in axes[1:]:
        ax.tick_params(axis="y", length=0, labelleft=False)
    return axes


def robust_responses(
    responses: Mapping[str, Response], ax=None, final: Mapping[str, float] | None = None, worst: str | None = None
):
    """Vehicle acceleration of every plant over its final value, the first one and the worst on top.

    Parameters
    ----------
    responses : dict of str to Response
        Plant name to tip-in; the first is the nominal plant.
    ax : matplotlib Axes, optional
    final : dict of str to float, optional
        Final accelerations [m/s^2]; the last value of each response if not given.
    worst : str, optional
        Plant to show by name.

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> robust_responses({"nominal": pt.tip_in(plant)}).get_ylabel()
    'vehicle acceleration / final value [-]'
    """
    ax = new_axes(ax, 1, (6.8, 3.4))[0]
    nominal = next(iter(responses))
    others = [name for name in responses if name not in (nominal, worst)]
    for name, response in responses.items():
        a = response["vehicle_acceleration"]
        line = {"color": "0.65", "linewidth": 0.7, "zorder": 2}
        if others and name == others[0]:
            line["label"] = f"{len(others)} other plants"
        if name == worst and worst != nominal:
            line = {
                "color": COLOURS[2],
                "linewidth": 1.5,
                "linestyle": LINES[1],
                "zorder": 3,
                "label": f"worst: {name}",
            }

        if name == nominal:
            line = {"color": COLOURS[0], "linewidth": 1.6, "zorder": 4, "label": name}
        ax.plot(response.time, a / (a[-1] if final is None else final[name]), **line)
    ax.set_xlabel("time [s]")
    ax.set_ylabel("vehicle acceleration / final value [-]")
    ax.margins(x=0.0)
    legend(ax, 1 + bool(others))
    grid(ax, "both")
    return ax


def trade_off(points: Mapping[str, RideMetrics], baseline: Mapping[float, RideMetrics] | None = None, ax=None):
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

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> open_loop = {0.1: pt.studies.tip_in_metrics(plant, pt.tip_in(plant))}
    >>> trade_off({}, open_loop).get_ylabel()
    'overshoot [% of final value]'
    """
    ax = new_axes(ax, 1, (7.2, 4.4))[0]
    if baseline:
        t90 = [1e3 * metrics.t90 for metrics in baseline.values()]
        overshoot = [100.0 * metrics.overshoot for metrics in baseline.values()]
        ax.plot(
            t90,
            overshoot,
            color="0.35",
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
                color="0.35",
            )
    for i, (label, metrics) in enumerate(points.items()):
        ax.plot(
            [1e3 * metrics.t90],
            [100.0 * metrics.overshoot],
            linestyle="none",
            marker=MARKERS[1 + i % 5],
            color=ORDER[(1 + i) % len(ORDER)],
            markersize=7,
            label=f"{i + 1}  {label}",
            zorder=3,
        )
    ax.set_yscale("symlog", linthresh=1.0, linscale=0.6)
    ax.set_ylim(bottom=-0.15)
    ax.set_yticks([0, 0.5, 1, 2, 5, 10, 20, 50], ["0", "0.5", "1", "2", "5", "10", "20", "50"])
    ax.set_xlabel("time to 90 % of the final acceleration [ms]")
    ax.set_ylabel("overshoot [% of final value]")
    ax.legend(loc="center left", bbox_to_anchor=(1.01, 0.5), frameon=False, fontsize="small")
    grid(ax, "both")
    _number_points(ax, np.array([[1e3 * each.t90, 100.0 * each.overshoot] for each in points.values()]))
    return ax


def _number_points(ax, points: np.ndarray):
    """Number each point where its number is farthest from other points and numbers."""
    if not len(points):
        return
    ax.figure.draw_without_rendering()
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


def _line(i: int) -> dict:
    return {"color": ORDER[i % len(ORDER)], "linestyle": STYLES[i % len(STYLES)], "linewidth": 1.5}


def _finish(axes: Sequence):
    for ax in axes:
        ax.margins(x=0.0)
        grid(ax, "both")
        ax.label_outer()
    axes[0].figure.align_ylabels(list(axes))


def _value(proof, quantity: str) -> float:
    return getattr(proof if hasattr(proof, quantity) else proof.margins, quantity)


def _masked(values: np.ndarray) -> np.ndarray:
    return np.where(np.isfinite(values), values, np.nan)
