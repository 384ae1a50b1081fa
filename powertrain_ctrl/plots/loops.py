"""Loops of anti-jerk control: poles, and the gain in the complex plane."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.doors import checked
from ..base.units import to_hz
from ..sampled.margins import NO_FEEDBACK, LoopMargins
from .style import COLOURS, DESIGN_COLOURS, MARKERS, design_line, grid, labelled, legend, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ZETA_LINES = (0.05, 0.1, 0.2, 0.35, 0.5, 0.7)


@checked
def pole_map(margins: Mapping[str, LoopMargins], ax: Axes | None = None) -> Axes:
    """Poles ``log(z) / dt`` of loops in the upper half plane, with lines of damping ratio and the plant's own modes.

    The arcs are at the frequencies that the first and the second mode of the first plant have without feedback.

    Modes beyond the Nyquist frequency, which sampling shows folded, are left out.

    Parameters
    ----------
    margins : dict of str to LoopMargins
        By the label in the legend.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        Margins that are not a mapping, or empty.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> pt.plots.pole_map({"open loop": pt.loop_margins(plant, None)}).get_ylabel()
    'imaginary part / 2π [Hz]'
    """
    margins = labelled("margins", margins)
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
        ax.plot([0.0, ray.real], [0.0, ray.imag], color="0.6", linewidth=0.7, linestyle=(0, (2, 2)), zorder=1)
        label = f"ζ = {zeta:g}" if zeta == ZETA_LINES[-1] else f"{zeta:g}"
        ax.text(ray.real, ray.imag, label, fontsize="x-small", clip_on=True)
    ax.axvline(0.0, color="0.4", linewidth=0.8, zorder=1)
    for i, (label, values) in enumerate(poles.items()):
        marker = MARKERS[i % len(MARKERS)]
        face = DESIGN_COLOURS[i % len(DESIGN_COLOURS)] if marker == "x" else "none"
        edge: dict[str, Any] = {} if marker == "x" else {"edgecolors": DESIGN_COLOURS[i % len(DESIGN_COLOURS)]}
        ax.scatter(values.real, values.imag, s=38, marker=marker, c=face, linewidths=1.6, label=label, zorder=3, **edge)
    ax.set_xlim(left, right)
    ax.set_ylim(-0.02 * top, top)
    ax.set_aspect("equal")
    ax.set_xlabel("real part / 2π [Hz]")
    ax.set_ylabel("imaginary part / 2π [Hz]")
    legend(ax, 3)
    ax.spines[["top", "right"]].set_visible(False)
    return ax


@checked
def nyquist(margins: Mapping[str, LoopMargins], ax: Axes | None = None) -> Axes:
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

    Raises
    ------
    PowertrainError
        Margins that are not a mapping, or empty.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.designs(plant)["two degrees of freedom"]
    >>> pt.plots.nyquist({"proven": pt.loop_margins(plant, controller)}).get_xlabel()
    'real part [-]'
    """
    from matplotlib.patches import Circle

    margins = labelled("margins", margins)
    ax = new_axes(ax, 1, (6.2, 5.6))[0]
    sizes, left = [1.2], 2.4
    for i, (label, record) in enumerate(margins.items(), start=1):
        if not record.loop.any():
            continue
        line = design_line(i)
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
