"""One controller on every plant that the car can turn out to be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..hybrid.response import Response
from ..studies import Robustness
from ..studies.requirements import GROUPS, Requirement
from .style import COLOURS, LINES, grid, labelled, legend, new_axes, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .style import Panels

SPREAD = (
    ("oscillation_reduction", "oscillation\nless than open [%]", 100.0, "{:.1f}"),
    ("disk_margin", "disk margin [-]", 1.0, "{:.2f}"),
    ("zeta_first", "ζ of first\nmode [-]", 1.0, "{:.2f}"),
    ("zeta_second", "ζ of second\nmode [-]", 1.0, "{:.3f}"),
)


@checked
def robust_spread(robustness: Robustness, axes: Panels = None, requirements: Sequence[Requirement] = ()) -> np.ndarray:
    """Tip-in oscillation, disk margin and damping ratios of one controller on every plant, the worst marked.

    Parameters
    ----------
    robustness : Robustness
        The vertical line is its first plant. Plants with an unstable loop are named so and have no oscillation.
    axes : sequence of 4 matplotlib Axes, optional
        Beside each other, with the same vertical axis.
    requirements : sequence of Requirement
        Limits to draw beside the plants that they are for, such as `powertrain_ctrl.studies.requirements.REQUIREMENTS`.

    Returns
    -------
    ndarray of 4 matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> result = pt.robustness(plant, pt.antijerk.designs(plant)["two degrees of freedom"], {"nominal": plant})
    >>> [ax.get_xlabel().replace(chr(10), " ") for ax in pt.plots.robust_spread(result)][1]
    'disk margin [-]'
    """
    count = len(robustness.proofs)
    axes = new_axes(axes, 4, (7.4, 1.3 + 0.21 * count), beside=True, sharey=True)
    names = list(robustness.proofs)
    place = np.arange(count)
    for ax, (quantity, label, scale, number) in zip(axes, SPREAD, strict=True):
        values = scale * np.array([proof.value(quantity) for proof in robustness.proofs.values()])
        finite = np.isfinite(values)
        limits = _limits(requirements, quantity, names)
        for limit, rows in limits:
            start, stop = rows[0] - 0.5, rows[-1] + 0.5
            ax.plot([scale * limit] * 2, [start, stop], color=COLOURS[2], linewidth=1.4, linestyle=LINES[1], zorder=2)
        if finite[0]:
            ax.axvline(values[0], color=shade(0.45), linewidth=0.8, zorder=1)
        ax.scatter(values[finite], place[finite], s=20, color=COLOURS[0], zorder=3)
        if finite.any():
            worst = (
                names.index(robustness.worst(quantity)[0])
                if finite.all()
                else int(np.nanargmin(np.where(finite, values, np.nan)))
            )
            ax.scatter(
                values[worst], worst, s=60, marker="D", facecolor="none", edgecolor=COLOURS[2], zorder=4, linewidth=1.5
            )
            seen = [*values[finite], *(scale * limit for limit, _ in limits)]
            low, high = min(seen), max(seen)
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
    axes[0].set_yticks(place, labels, fontsize="small")
    axes[0].set_ylim(count - 0.4, -0.6)
    for ax in axes[1:]:
        # the lines of a grid alone, as one, which costs less than ticks that show nothing else
        ax.yaxis.set_visible(False)
        across, down = np.tile([0.0, 1.0, np.nan], count), np.repeat(place, 3)
        ax.plot(across, down, transform=ax.get_yaxis_transform(), color=shade(0.88), linewidth=0.6, zorder=0.5)
    return axes


def _limits(requirements: Sequence[Requirement], quantity: str, names: list[str]) -> list[tuple[float, list[int]]]:
    """Limits of a quantity with the places of the plants that they are for, those for all of several plants."""
    found = []
    for each in requirements:
        rows = [i for i, name in enumerate(names) if GROUPS[each.among](name)]
        if each.quantity == quantity and len(rows) > 1:
            found.append((each.limit, rows))
    return found


@checked
def robust_responses(
    responses: Mapping[str, Response],
    ax: Axes | None = None,
    final: Mapping[str, float] | None = None,
    worst: str | None = None,
) -> Axes:
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

    Raises
    ------
    PowertrainError
        Responses that are not a mapping, or empty; a final value that is missing or 0.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> pt.plots.robust_responses({"nominal": pt.tip_in(plant)}).get_ylabel()
    'vehicle acceleration / final value [-]'
    """
    responses = labelled("responses", responses)
    for name in responses:
        if final is not None and not final.get(name):
            raise PowertrainError(
                f'final of "{name}" is {final.get(name)}, permitted: a number that is not 0, one for each'
            )
    ax = new_axes(ax, 1, (6.8, 3.4))[0]
    nominal = next(iter(responses))
    others = [name for name in responses if name not in (nominal, worst)]
    for name, response in responses.items():
        a = response["vehicle_acceleration"]
        line: dict[str, Any] = {"color": shade(0.65), "linewidth": 0.7, "zorder": 2}
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
