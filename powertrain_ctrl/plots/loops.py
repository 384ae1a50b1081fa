"""Loops of anti-jerk control: poles, and the gain in the complex plane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.doors import checked
from ..base.units import to_hz
from ..sampled.margins import NO_FEEDBACK, LoopMargins
from .style import COLOURS, DESIGN_COLOURS, MARKERS, design_line, grid, labelled, legend, new_axes, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Areas of the markers of the first loop, the second, ...
SIZES = (30.0, 150.0, 100.0, 60.0, 28.0, 12.0)
# What is seen of a Nyquist diagram: the point -1 in the middle of where loops are decided, and marked frequencies [Hz].
SEEN = (-2.6, 1.4)
MARKED_HZ = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 30.0, 50.0)
ZETA_LINES = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7)


@checked
def pole_map(margins: Mapping[str, LoopMargins] | LoopMargins, ax: Axes | None = None) -> Axes:
    """Poles ``log(z) / dt`` of loops in the upper half plane, with lines of damping ratio and the plant's own modes.

    The arcs are at the frequencies that the first and the second mode of the first plant have without feedback.

    Modes beyond the Nyquist frequency, which sampling shows folded, are left out.

    Parameters
    ----------
    margins : LoopMargins, or dict of str to LoopMargins
        Several by the label in the legend.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        No margins.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> pt.plots.pole_map({"open loop": pt.loop_margins(plant, None)}).get_ylabel()
    'imaginary part / 2π [Hz]'
    """
    margins = labelled("margins", margins, "loop")
    ax = new_axes(ax, 1, (6.2, 5.4))[0]
    poles = {
        label: to_hz(record.poles[(record.poles.imag >= 0.0) & ~record.folded]) for label, record in margins.items()
    }
    every = np.concatenate(list(poles.values()))
    first = next(iter(margins.values()))
    own = to_hz(np.abs(first.modes[:2]))
    own = own[own <= to_hz(first.omega[-1])]  # sampling shows no others
    highest = 2.0 * own.max(initial=0.0) or np.inf
    seen = every[(np.abs(every) <= highest) & (-every.real < 0.5 * np.abs(every))]
    top = 1.25 * max(np.abs(seen).max(initial=0.0), 1.1 * own.max(initial=0.0)) or 1.0
    right = max(0.04 * top, 1.1 * every.real.max(initial=0.0))
    left = -0.95 * top
    for f, colour, name in zip(own, (COLOURS[5], COLOURS[1]), ("first mode", "second mode"), strict=False):
        label = f"{name} of the plant, {f:.3g} Hz"
        arc = f * np.exp(1j * np.linspace(np.pi / 2.0, np.pi, 61))
        ax.plot(arc.real, arc.imag, color=colour, linewidth=1.2, label=label, zorder=1)
    reach = 0.98 * np.hypot(left, top)
    for zeta in ZETA_LINES:
        ray = reach * np.exp(1j * (np.pi / 2.0 + np.arcsin(zeta)))
        shrink = min(1.0, 0.985 * top / ray.imag, 0.985 * left / ray.real)
        ray *= shrink
        ax.plot([0.0, ray.real], [0.0, ray.imag], color=shade(0.6), linewidth=0.7, linestyle=(0, (2, 2)), zorder=1)
        label = f"ζ = {zeta:g}" if zeta == ZETA_LINES[-1] else f"{zeta:g}"
        ax.text(ray.real, ray.imag, label, fontsize="x-small", clip_on=True)
    ax.axvline(0.0, color=shade(0.4), linewidth=0.8, zorder=1)
    for i, (label, values) in enumerate(poles.items()):
        marker = MARKERS[i % len(MARKERS)]
        face = DESIGN_COLOURS[i % len(DESIGN_COLOURS)] if marker == "x" else "none"
        edge: dict[str, Any] = {} if marker == "x" else {"edgecolors": DESIGN_COLOURS[i % len(DESIGN_COLOURS)]}
        # one inside the other where they are at the same place
        size = SIZES[min(i, len(SIZES) - 1)]
        ax.scatter(
            values.real, values.imag, s=size, marker=marker, c=face, linewidths=1.3, label=label, zorder=3, **edge
        )
    ax.set_xlim(left, right)
    ax.set_ylim(-0.02 * top, top)
    ax.set_aspect("equal")
    ax.set_xlabel("real part / 2π [Hz]")
    ax.set_ylabel("imaginary part / 2π [Hz]")
    legend(ax, 3)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


@checked
def nyquist(margins: Mapping[str, LoopMargins] | LoopMargins, ax: Axes | None = None) -> Axes:
    """Loop gain at the plant input in the complex plane about -1, and the disk each loop keeps clear of.

    Dots are at frequencies in Hz; what is far from -1 decides nothing and is cut.

    A balanced disk margin alpha means that the loop stays outside the circle through ``-(2 + alpha) / (2 - alpha)``
    and ``-(2 - alpha) / (2 + alpha)`` on the real axis, and touches it.

    Parameters
    ----------
    margins : LoopMargins, or dict of str to LoopMargins
        Several by the label in the legend; one without feedback is left out.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        No margins.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.designs(plant)["proven"]
    >>> pt.plots.nyquist({"proven": pt.loop_margins(plant, controller)}).get_xlabel()
    'real part [-]'
    """
    from matplotlib.patches import Circle

    margins = labelled("margins", margins, "loop")
    ax = new_axes(ax, 1, (6.2, 5.6))[0]
    for i, (label, record) in enumerate(margins.items(), start=1):
        if not record.loop.any():
            continue
        line = design_line(i)
        alpha = record.disk_margin
        name = f"{label}, disk margin {alpha:.2f}" if alpha > 0.0 else f"{label}, unstable"
        ax.plot(record.loop.real, record.loop.imag, label=name, **line)
        _mark_frequencies(ax, record, line["color"])
        if 0.0 < alpha < NO_FEEDBACK:
            centre, radius = disk(alpha)
            ax.add_patch(Circle((centre, 0.0), radius, color=line["color"], alpha=0.10, linewidth=0.0))
            ax.add_patch(Circle((centre, 0.0), radius, fill=False, edgecolor=line["color"], linewidth=0.8))
    ax.plot([-1.0], [0.0], marker="+", color=shade(0.0), markersize=10, markeredgewidth=1.6, linestyle="none")
    ax.annotate("−1", (-1.0, 0.0), xytext=(4, 5), textcoords="offset points")
    ax.axhline(0.0, color=shade(0.4), linewidth=0.7, zorder=0.8)
    ax.axvline(0.0, color=shade(0.4), linewidth=0.7, zorder=0.8)
    ax.set_xlim(*SEEN)
    ax.set_ylim(-0.375 * (SEEN[1] - SEEN[0]), 0.375 * (SEEN[1] - SEEN[0]))
    ax.set_aspect("equal")
    ax.set_xlabel("real part [-]")
    ax.set_ylabel("imaginary part [-]")
    if ax.get_legend_handles_labels()[0]:
        legend(ax, 2)
    grid(ax, "both")
    return ax


def _mark_frequencies(ax: Axes, record: LoopMargins, colour: str) -> None:
    """Dots with their frequency where a loop comes by in the part that is seen."""
    frequency = to_hz(record.omega)
    marked = np.array([f for f in MARKED_HZ if frequency[0] <= f <= frequency[-1]])
    real, imag = (np.interp(marked, frequency, part) for part in (record.loop.real, record.loop.imag))
    last = np.inf + 0j
    for f, at in zip(marked, real + 1j * imag, strict=True):
        # not where numbers would lie on each other: in the middle, and close to the last one
        if abs(at) < 0.12 or abs(at - last) < 0.15:
            continue
        last = at
        ax.plot(at.real, at.imag, marker="o", markersize=3.5, color=colour, linestyle="none")
        ax.annotate(
            f"{f:g} Hz", (at.real, at.imag), xytext=(4, 3), textcoords="offset points", fontsize="x-small", color=colour,
            clip_on=True, annotation_clip=True,
        )  # fmt: skip


@checked
def disk(alpha: float) -> tuple[float, float]:
    """Centre on the real axis and radius of the circle that a loop keeps clear of.

    Parameters
    ----------
    alpha : float
        Balanced disk margin [-], 0 to 2, not 2.

    Returns
    -------
    centre, radius : float
        [-].

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> centre, radius = pt.plots.disk(1.0)
    >>> round(centre - radius, 6), round(centre + radius, 6)
    (-3.0, -0.333333)
    """
    return -(4.0 + alpha**2) / (4.0 - alpha**2), 4.0 * alpha / (4.0 - alpha**2)
