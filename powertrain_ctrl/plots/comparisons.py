"""Simpler models against the detailed one."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.units import to_hz
from ..reduction.comparison import ModelComparison
from .style import COLOURS, HOLLOW, finish, grid, legend, new_axes, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from .style import Panels

# Wide and pale, so that what lies on it is seen.
DETAILED: dict[str, Any] = {"linestyle": "-", "linewidth": 5.0, "solid_capstyle": "butt"}
DASHES = ((0, (5, 2)), "-.", ":", (0, (8, 2, 1, 2, 1, 2)), (0, (2, 1)), (0, (1, 2)))
# Gains this far below the largest one are at the bottom of the axis [dB].
DEPTH = 60.0
# Shares of the largest gain below this are rounding.
LEAST = 1e-12
# Errors over time below this share of the response are not shown: their logarithm has a needle at each change of sign.
ROUGH = 1e-5
# How far single models of the same order stand apart.
BESIDE = 0.16


@checked
def model_errors(comparison: ModelComparison, axes: Panels = None) -> np.ndarray:
    """Gain from torque to acceleration [dB] over the band, and below it the error of each model.

    The error is ``|G_model - G|`` over the largest ``|G|``; its maximum is `ModelError.largest_error`.

    Parameters
    ----------
    comparison : ModelComparison
    axes : sequence of 2 matplotlib Axes, optional

    Returns
    -------
    ndarray of 2 matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> table = pt.compare_models(car, {m: pt.two_mass(car, m) for m in ("source", "modal")})
    >>> axes = pt.plots.model_errors(table)
    >>> axes[1].get_yscale(), axes[1].get_xlabel()
    ('log', 'frequency [Hz]')
    """
    axes = new_axes(axes, 2, (6.8, 5.6), sharex=True, height_ratios=(1, 1))
    gain, error = axes
    frequency, largest = to_hz(comparison.omega), np.abs(comparison.detailed).max()
    gain.plot(frequency, _decibel(comparison.detailed), label="detailed", color=shade(0.8), zorder=2, **DETAILED)
    for i, (name, response) in enumerate(comparison.models.items()):
        gain.plot(frequency, _decibel(response), label=name, zorder=3, **_line(i))
        share = np.abs(response - comparison.detailed) / largest
        error.semilogy(frequency, np.where(share > 0.0, share, np.nan), **_line(i))
    top = max(_decibel(response).max() for response in (comparison.detailed, *comparison.models.values()))
    gain.set_ylim(bottom=max(gain.get_ylim()[0], top - DEPTH))
    gain.set_ylabel("gain [dB]\n0 dB = 1 (m/s²)/(N m)")
    error.set_ylabel("error /\nlargest gain [-]")
    error.set_ylim(bottom=max(error.get_ylim()[0], LEAST))
    error.set_xlabel("frequency [Hz]")
    legend(gain, _columns(len(comparison.models) + 1))
    finish(axes)
    error.set_xlim(0.0, frequency[-1])
    return axes


@checked
def ramp_responses(comparison: ModelComparison, duration: float, axes: Panels = None) -> np.ndarray:
    """Vehicle acceleration of all models after a torque ramp, and below it how far each is off.

    Parameters
    ----------
    comparison : ModelComparison
    duration : float
        Of the ramp [s], one of those compared.
    axes : sequence of 2 matplotlib Axes, optional

    Returns
    -------
    ndarray of 2 matplotlib Axes

    Raises
    ------
    PowertrainError
        A ramp that was not compared.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> table = pt.compare_models(car, {"modal": pt.two_mass(car)})
    >>> response, error = pt.plots.ramp_responses(table, 0.1)
    >>> [line.get_label() for line in response.lines], error.get_yscale()
    (['detailed', 'modal'], 'log')
    """
    if duration not in comparison.ramps:
        known = ", ".join(f"{known:g}" for known in comparison.ramps)
        raise PowertrainError(f"duration = {duration:g} s, permitted: {known}")
    axes = new_axes(axes, 2, (6.8, 4.8), sharex=True, height_ratios=(1, 1))
    response, error = axes
    curves = comparison.ramps[duration]
    response.plot(comparison.time, curves["detailed"], label="detailed", color=shade(0.8), zorder=2, **DETAILED)
    for i, name in enumerate(comparison.errors):
        response.plot(comparison.time, curves[name], label=name, zorder=3, **_line(i))
        off = np.abs(curves[name] - curves["detailed"])
        error.semilogy(comparison.time, np.where(off > 0.0, off, np.nan), **_line(i) | {"linewidth": 1.1})
    response.set_ylabel("vehicle\nacceleration [m/s²]")
    error.set_ylabel("magnitude of\nthe error [m/s²]")
    error.set_ylim(bottom=max(error.get_ylim()[0], ROUGH * np.ptp(curves["detailed"])))
    error.set_xlabel("time [s]")
    legend(response, _columns(len(curves)))
    finish(axes)
    return axes


@checked
def hankel(
    values: ArrayLike | ModelComparison | Mapping[str, ArrayLike | ModelComparison], ax: Axes | None = None
) -> Axes:
    """Hankel singular values over their number, largest first; what lies below a gap can be left out.

    Parameters
    ----------
    values : ModelComparison, (n,) array_like, or dict of str to either
        Several by the label in the legend.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> ax = pt.plots.hankel(pt.hankel_singular_values(car, "engine_torque", "vehicle_acceleration"))
    >>> ax.get_yscale()
    'log'
    """
    ax = new_axes(ax, 1, (5.4, 3.2))[0]
    several = values if isinstance(values, Mapping) else {"": values}
    for i, (label, given) in enumerate(several.items()):
        sigma = np.asarray(given.hankel if isinstance(given, ModelComparison) else given, dtype=float)
        shown = np.where(sigma > 0.0, sigma, np.nan)
        ax.semilogy(
            np.arange(1, len(sigma) + 1),
            shown,
            color=COLOURS[(0, 2, 3, 1, 4, 5)[i % 6]],
            linestyle=":",
            linewidth=1.0,
            marker=HOLLOW[i % len(HOLLOW)],
            markersize=5.5,
            markerfacecolor="none",
            label=label,
        )
    _whole_numbers(ax)
    ax.set_xlabel("state, balanced")
    ax.set_ylabel("Hankel singular value\n[(m/s²)/(N m)]")
    if len(several) > 1:
        legend(ax, len(several))
    grid(ax, "both")
    return ax


@checked
def error_against_order(comparison: ModelComparison, ax: Axes | None = None) -> Axes:
    """Band error of each model over its order; models whose names differ only in a number at the end are joined.

    Single models of one order stand a little beside each other.

    Parameters
    ----------
    comparison : ModelComparison
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> signals = {"inputs": "engine_torque", "outputs": "vehicle_acceleration"}
    >>> models = {f"balanced {n}": pt.reduced(car, n, **signals) for n in (2, 4, 6)}
    >>> ax = pt.plots.error_against_order(pt.compare_models(car, models | {"modal": pt.two_mass(car)}))
    >>> [line.get_label() for line in ax.lines]
    ['balanced', 'modal']
    """
    ax = new_axes(ax, 1, (5.8, 3.4))[0]
    groups: dict[str, list[tuple[int, float]]] = {}
    for name, error in comparison.errors.items():
        group = re.sub(r"\W*\d+$", "", name) or name
        groups.setdefault(group, []).append((error.order, error.band_error))
    alone = [group for group, points in groups.items() if len(points) == 1]
    for i, (group, points) in enumerate(groups.items()):
        order, error = np.array(sorted(points)).T
        if group in alone:  # beside each other, since most have the same order
            order = order + BESIDE * (alone.index(group) - 0.5 * (len(alone) - 1))
        line = _line(i) | {"linewidth": 1.2} | ({"linestyle": "none"} if len(points) == 1 else {})
        marker = {"marker": HOLLOW[i % len(HOLLOW)], "markersize": 6.5, "markerfacecolor": "none"}
        ax.semilogy(order, np.where(error > 0.0, error, np.nan), **line, **marker, label=group)
    _whole_numbers(ax)
    ax.margins(x=0.08)
    ax.set_xlabel("order of the model")
    ax.set_ylabel(f"band error to {to_hz(comparison.omega[-1]):.0f} Hz [-]")
    legend(ax, _columns(len(groups)))
    grid(ax, "both")
    return ax


def _decibel(response: np.ndarray) -> np.ndarray:
    gain = np.abs(response)
    return 20.0 * np.log10(np.where(gain > 0.0, gain, np.nan))


def _line(i: int) -> dict:
    return {"color": COLOURS[(2, 3, 4, 0, 1, 5)[i % 6]], "linestyle": DASHES[i % len(DASHES)], "linewidth": 1.5}


def _columns(entries: int) -> int:
    return entries if entries <= 5 else -(-entries // 2)


def _whole_numbers(ax: Axes) -> None:
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator("auto", integer=True))
