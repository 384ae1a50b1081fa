"""What a tuned controller trades: what is left of the oscillation against the rise time."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..antijerk.tuning import Tuned
from ..base.doors import checked
from ..studies.requirements import asked
from .style import DESIGN_COLOURS, grid, legend, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@checked
def pareto(tuned: Tuned, ax: Axes | None = None) -> Axes:
    """Oscillation that is left against rise time of all candidates of a search, the front among them and what was taken.

    Parameters
    ----------
    tuned : Tuned
        Its candidates that keep the disk margin required are shown, both against the open loop, with the limits required.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> tuned = pt.antijerk.tune(pt.SampledPlant(car=pt.examples.conventional()))
    >>> pt.plots.pareto(tuned).get_ylabel()
    'oscillation left [% of open loop]'
    """
    ax = new_axes(ax, 1, (6.4, 4.2))[0]
    safe, front = tuned.safe, tuned.front
    ax.plot(safe[:, 3], 100.0 * safe[:, 1], ".", color="0.75", markersize=3, label="candidates")
    ax.plot(*front.T * [[1.0], [100.0]], color=DESIGN_COLOURS[1], linewidth=1.4, label="no candidate is better in both")
    nominal = tuned.proof["nominal"]
    left = 1.0 - nominal.oscillation_reduction
    ax.plot([nominal.t90_ratio], [100.0 * left], "o", color=DESIGN_COLOURS[0], label="taken", zorder=3)
    limits = tuned.requirements
    if "t90_ratio" in limits:
        ax.axvline(limits["t90_ratio"], color="0.35", linestyle=":", linewidth=1.0, label="required")
    if "oscillation_reduction" in limits:
        required = asked("oscillation_reduction", limits["oscillation_reduction"])
        ax.axhline(100.0 * (1.0 - required.limit), color="0.35", linestyle=":", linewidth=1.0)
    ax.set_yscale("log")
    ax.set_xlim(min(0.9, nominal.t90_ratio - 0.05), max(1.6, nominal.t90_ratio + 0.1))
    ax.set_ylim(bottom=0.02)
    ax.set_xlabel("t90 over that of the open loop [-]")
    ax.set_ylabel("oscillation left [% of open loop]")
    legend(ax, 4)
    grid(ax, "both")
    return ax
