"""Engine orders: where they meet modes, and how much of each is left where."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.checks import Count
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.units import to_rpm
from ..orders.critical import CriticalSpeeds
from ..orders.response import OrderResponse
from .style import COLOURS, LINES, grid, legend, new_axes, shade, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Orders below this part of the largest amplitude are not drawn.
SEEN = 1e-4


@checked
def campbell(critical: CriticalSpeeds, ax: Axes | None = None) -> Axes:
    """Frequencies of the modes over the speed, rays of the orders, and dots where they meet, by size as they are driven.

    Parameters
    ----------
    critical : CriticalSpeeds
        Of `critical_speeds`.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> engine = pt.Engine(cylinders=4, firing_order=(1, 3, 4, 2), orders={2.0: 200.0, 4.0: 90.0})
    >>> critical = pt.critical_speeds(pt.examples.conventional(gear_ratio=3.6), engine, (500.0, 4000.0))
    >>> ax = pt.plots.campbell(critical)
    >>> ax.get_xlabel(), ax.get_ylabel()
    ('engine speed [rpm]', 'frequency [Hz]')
    """
    ax = new_axes(ax, 1, (6.4, 4.4))[0]
    rpm, highest = critical.grid_rpm, float(critical.frequency_hz.max(initial=0.0))
    top = 1.15 * highest if highest else float(critical.grid_hz.max(initial=1.0))
    for frequency in critical.grid_hz:
        ax.plot(rpm, frequency, color=shade(0.25), linewidth=1.2)
    for order in np.unique(critical.order):
        ax.plot(rpm, order * rpm / 60.0, color=COLOURS[5], linewidth=0.9)
        # at the right edge, or where the ray leaves at the top
        x = min(rpm[-1], 60.0 * top / order)
        above = x < rpm[-1]
        ax.annotate(
            f"{order:g}",
            (x, order * x / 60.0),
            xytext=(0, 2) if above else (3, 0),
            textcoords="offset points",
            ha="center" if above else "left",
            va="bottom" if above else "center",
            fontsize=7,
            color=COLOURS[0],
            annotation_clip=False,
        )
    ax.scatter(critical.rpm, critical.frequency_hz, s=8.0 + 40.0 * critical.phase_sum, color=COLOURS[2], zorder=3)
    ax.set_xlim(rpm[0], rpm[-1])
    ax.set_ylim(0.0, top)
    ax.set_xlabel("engine speed [rpm]")
    ax.set_ylabel("frequency [Hz]")
    grid(ax, "both")
    return ax


@checked
def order_map(response: OrderResponse, output: str, ax: Axes | None = None) -> Axes:
    """Waterfall: each order as a ray over speed and frequency, as dark as its amplitude there.

    Parameters
    ----------
    response : OrderResponse
        Of `order_response`, at two speeds or more.
    output : str
        Name of the signal.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    UnknownNameError
        A signal that the response does not have.
    PowertrainError
        A response at one speed, or of a signal that no order reaches.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> engine = pt.Engine(cylinders=4, firing_order=(1, 3, 4, 2), orders={2.0: 200.0, 4.0: 90.0})
    >>> speed = pt.rpm(np.linspace(800.0, 3000.0, 50))
    >>> response = pt.order_response(pt.examples.conventional(gear_ratio=3.6), engine, speed)
    >>> ax = pt.plots.order_map(response, "damper_spring_torque")
    >>> len(ax.collections), ax.get_ylabel()
    (2, 'frequency [Hz]')
    """
    from matplotlib.collections import LineCollection
    from matplotlib.colors import LogNorm

    amplitude, rpm = _ascending(response, output)
    largest = float(amplitude.max())
    ax = new_axes(ax, 1, (6.4, 4.4))[0]
    shade = LogNorm(vmin=SEEN * largest, vmax=largest, clip=True)
    for order, row in zip(response.orders, amplitude, strict=True):
        if row.max() > SEEN * largest:
            points = np.column_stack([rpm, order * rpm / 60.0])
            lines = LineCollection(list(np.stack([points[:-1], points[1:]], axis=1)), cmap="magma_r", norm=shade)
            lines.set_array(np.sqrt(row[1:] * row[:-1]))
            lines.set_linewidth(3.0)
            ax.add_collection(lines)
    ax.set_xlim(rpm[0], rpm[-1])
    ax.set_ylim(0.0, float(response.orders[amplitude.max(axis=1) > SEEN * largest].max()) * rpm[-1] / 60.0)
    ax.set_xlabel("engine speed [rpm]")
    ax.set_ylabel("frequency [Hz]")
    bar = ax.figure.colorbar(ax.collections[0], ax=ax)
    bar.set_label(f"{words(output)}, amplitude")
    grid(ax, "both")
    return ax


@checked
def orders(response: OrderResponse, output: str, ax: Axes | None = None, count: Count = 4) -> Axes:
    """Amplitude of the largest orders of a signal over the speed, and the peak of all of them together.

    Parameters
    ----------
    response : OrderResponse
        Of `order_response`, at two speeds or more.
    output : str
        Name of the signal.
    ax : matplotlib Axes, optional
    count : int
        How many orders.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    UnknownNameError
        A signal that the response does not have.
    PowertrainError
        A response at one speed, or of a signal that no order reaches.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> engine = pt.Engine(cylinders=4, firing_order=(1, 3, 4, 2), orders={2.0: 200.0, 4.0: 90.0})
    >>> speed = pt.rpm(np.linspace(800.0, 3000.0, 50))
    >>> response = pt.order_response(pt.examples.conventional(gear_ratio=3.6), engine, speed)
    >>> [line.get_label() for line in pt.plots.orders(response, "damper_spring_torque").lines]
    ['peak', 'order 2', 'order 4']
    """
    amplitude, rpm = _ascending(response, output)
    ax = new_axes(ax, 1, (6.4, 3.8))[0]
    peak = response.peak(output)[np.argsort(response.speed)]
    ax.plot(rpm, peak, color=shade(0.2), linewidth=1.5, label="peak")
    largest = amplitude.max(axis=1)
    chosen = np.sort(np.argsort(-largest, kind="stable")[:count])
    for i, k in enumerate(k for k in chosen if largest[k] > SEEN * largest.max()):
        colour, line = COLOURS[i % len(COLOURS)], LINES[i % len(LINES)]
        ax.plot(rpm, amplitude[k], color=colour, linestyle=line, linewidth=1.4, label=f"order {response.orders[k]:g}")
    ax.set_xlim(rpm[0], rpm[-1])
    ax.set_ylim(0.0, 1.05 * float(peak.max()))
    ax.set_xlabel("engine speed [rpm]")
    ax.set_ylabel(f"{words(output)}\namplitude")
    legend(ax, 5)
    grid(ax, "both")
    return ax


def _ascending(response: OrderResponse, output: str) -> tuple[np.ndarray, np.ndarray]:
    """Amplitudes (orders, speeds) and speeds [1/min], ascending."""
    along = np.argsort(response.speed)
    amplitude = response.amplitude(output)[:, along]
    if len(along) < 2:
        raise PowertrainError(
            "the response is at one speed, permitted: two or more; give order_response a range of speeds"
        )
    if not amplitude.any():
        raise PowertrainError(f"{output} is 0 at all orders and speeds, permitted: a signal that the engine reaches")
    return amplitude, to_rpm(response.speed[along])
