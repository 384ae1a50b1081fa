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
from .style import COLOURS, HOLLOW, finish, grid, legend, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike

    from .style import Panels

DETAILED: dict[str, Any] = {"color": "0.15", "linestyle": "-", "linewidth": 2.0}
DASHES = ((0, (5, 2)), "-.", ":", (0, (8, 2, 1, 2, 1, 2)), (0, (2, 1)), (0, (1, 2)))
# Gains this far below the largest one are at the bottom of the axis [dB].
DEPTH = 60.0


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
    axes = new_axes(axes, 2, (6.8, 5.6), sharex=True, height_ratios=(3, 2))
    gain, error = axes
    frequency, largest = to_hz(comparison.omega), np.abs(comparison.detailed).max()
    gain.plot(frequency, _decibel(comparison.detailed), label="detailed", zorder=2, **DETAILED)
    for i, (name, response) in enumerate(comparison.models.items()):
        gain.plot(frequency, _decibel(response), label=name, zorder=3, **_line(i))
        share = np.abs(response - comparison.detailed) / largest
        error.semilogy(frequency, np.where(share > 0.0, share, np.nan), **_line(i))
    top = max(_decibel(response).max() for response in (comparison.detailed, *comparison.models.values()))
    gain.set_ylim(bottom=max(gain.get_ylim()[0], top - DEPTH))
    gain.set_ylabel("gain [dB]\n0 dB = 1 (m/s²)/(N m)")
    error.set_ylabel("error /\nlargest gain [-]")
    error.set_ylim(bottom=max(error.get_ylim()[0], 1e-6))
    error.set_xlabel("frequency [Hz]")
    legend(gain, _columns(len(comparison.models) + 1))
    finish(axes)
    error.set_xlim(0.0, frequency[-1])
    return axes


@checked
def ramp_responses(comparison: ModelComparison, duration: float, ax: Axes | None = None) -> Axes:
    """Vehicle acceleration of all models after a torque ramp.

    Parameters
    ----------
    comparison : ModelComparison
    duration : float
        Of the ramp [s], one of those compared.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        A ramp that was not compared.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> table = pt.compare_models(car, {"modal": pt.two_mass(car)})
    >>> [line.get_label() for line in pt.plots.ramp_responses(table, 0.1).lines]
    ['detailed', 'modal']
    """
    if duration not in comparison.ramps:
        known = ", ".join(f"{known:g}" for known in comparison.ramps)
        raise PowertrainError(f"duration = {duration:g} s, permitted: {known}")
    ax = new_axes(ax, 1, (6.8, 3.2))[0]
    curves = comparison.ramps[duration]
    ax.plot(comparison.time, curves["detailed"], label="detailed", zorder=2, **DETAILED)
    for i, name in enumerate(comparison.errors):
        ax.plot(comparison.time, curves[name], label=name, zorder=3, **_line(i))
    ax.set_ylabel("vehicle acceleration [m/s²]")
    ax.set_xlabel("time [s]")
    legend(ax, _columns(len(curves)))
    finish([ax])
    return ax


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
    for i, (group, points) in enumerate(groups.items()):
        order, error = np.array(sorted(points)).T
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
