"""Families: how their variants spread, and what from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.checks import Count
from ..base.doors import checked
from ..base.errors import PowertrainError, UnknownNameError
from ..base.units import to_hz
from ..families.impedances import FamilyForcedResponse
from ..families.results import OfFamily, Quantity
from ..linear.modal import Modes
from .style import COLOURS, LINES, finish, grid, legend, new_axes, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .style import Panels

# Bars of a tornado, the rest are too short to be seen.
BARS = 12
# Gains this far below the largest one are at the bottom of the axis [dB].
DEPTH = 80.0


@checked
def bode_band(response: FamilyForcedResponse, output: str, axes: Panels = None) -> np.ndarray:
    """Gain [dB] and phase [deg] over the frequency: median of the variants, and the band that holds nine tenths of them.

    Parameters
    ----------
    response : FamilyForcedResponse
    output : str
        Signal.
    axes : sequence of 2 matplotlib Axes, optional

    Returns
    -------
    ndarray of 2 matplotlib Axes

    Raises
    ------
    UnknownNameError
        A signal that is not there.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> cars = pt.sample(pt.examples.conventional(), {"vehicle.m": 0.1, "drive_shafts.stiffness": 0.1}, n=100)
    >>> omega = 2.0 * np.pi * np.geomspace(0.5, 100.0, 200)
    >>> response = cars.frequency_response(omega, "engine_torque", "vehicle_acceleration")
    >>> axes = pt.plots.bode_band(response, "vehicle_acceleration")
    >>> axes[0].get_xscale(), axes[1].get_xlabel()
    ('log', 'frequency [Hz]')
    """
    gain, phase = axes = new_axes(axes, 2, (6.8, 5.2), sharex=True, height_ratios=(3, 2))
    values, hertz = response[output], to_hz(response.omega)
    values = values[~np.isnan(values).any(axis=1)]
    with np.errstate(divide="ignore"):
        decibel = 20.0 * np.log10(np.abs(values))
    # phases of neighbouring variants are told apart by whole turns only
    turned = np.unwrap(np.angle(values), axis=1)
    turned -= 2.0 * np.pi * np.round((turned[:, :1] - turned[:1, :1]) / (2.0 * np.pi))
    for ax, quantity in ((gain, decibel), (phase, np.degrees(turned))):
        low, middle, high = np.percentile(quantity, (5.0, 50.0, 95.0), axis=0)
        ax.fill_between(hertz, low, high, color=COLOURS[0], alpha=0.25, linewidth=0.0, label="5 to 95 %")
        ax.plot(hertz, middle, color=COLOURS[0], linewidth=1.6, label="median")
        ax.set_xscale("log")
    gain.set_ylim(bottom=max(gain.get_ylim()[0], decibel[np.isfinite(decibel)].max() - DEPTH))
    gain.set_ylabel("gain [dB]")
    phase.set_ylabel("phase [°]")
    phase.set_xlabel("frequency [Hz]")
    legend(gain, 2)
    finish(axes)
    return axes


@checked
def histogram(result: OfFamily, quantity: str, index: Count = 0, ax: Axes | None = None) -> Axes:
    """How often a quantity of the variants has which value, with its 5 %, 50 % and 95 %.

    Parameters
    ----------
    result : FamilyModes or another result of a family
    quantity : str
        Its name: ``frequency_hz``, ``damping_ratio``, a field of metrics, "value" of an `evaluate` of numbers.
    index : int
        Of the mode, where there are several values.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    UnknownNameError
        A quantity that the result does not have.
    PowertrainError
        An index that there is not, or no numbers.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> cars = pt.sample(pt.examples.conventional(), {"vehicle.m": 0.1}, n=200)
    >>> pt.plots.histogram(cars.modes(), "frequency_hz", 1).get_xlabel()
    'frequency_hz of mode 1 [Hz]'
    """
    ax = new_axes(ax, 1, (6.4, 3.2))[0]
    found = _found(result, quantity)
    values = _at(found, quantity, index)
    there = values[np.isfinite(values)]
    if not there.size:
        raise PowertrainError(f"{quantity}: no variant has a value")
    ax.hist(there, bins="auto", color=COLOURS[0], alpha=0.7)
    for share, line in zip(np.percentile(there, (5.0, 50.0, 95.0)), (LINES[1], LINES[0], LINES[1]), strict=True):
        ax.axvline(share, color=shade(0.15), linestyle=line, linewidth=1.2)
    ax.set_xlabel(_label(found, quantity, index))
    ax.set_ylabel("variants")
    grid(ax, "y")
    return ax


@checked
def tornado(modes: Modes, mode: Count, of: str = "frequency_hz", ax: Axes | None = None) -> Axes:
    """What a mode depends on: change of its frequency in per cent for one per cent of each value, the largest on top.

    Parameters
    ----------
    modes : Modes
    mode : int
        An elastic one.
    of : {"frequency_hz", "damping_ratio"}
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        A mode without sensitivities, as in `Modes.sensitivity`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> ax = pt.plots.tornado(pt.modes(pt.examples.conventional()), 1)
    >>> [label.get_text() for label in ax.get_yticklabels()][:2]
    ['gearbox.ratio', 'final_drive.ratio']
    """
    found = modes.sensitivity(mode, of)
    names = sorted(found, key=lambda name: -round(abs(found[name]), 9))[:BARS]
    ax = new_axes(ax, 1, (6.4, 0.9 + 0.3 * len(names)))[0]
    values = [found[name] for name in names]
    ax.barh(range(len(names)), values, color=[COLOURS[0] if value > 0.0 else COLOURS[2] for value in values])
    ax.set_yticks(range(len(names)), names)
    ax.invert_yaxis()
    ax.axvline(0.0, color=shade(0.15), linewidth=0.8)
    what = "frequency" if of == "frequency_hz" else "damping ratio"
    ax.set_xlabel(f"change of the {what} of mode {mode} [% per %]")
    grid(ax, "x")
    return ax


@checked
def gear_map(result: OfFamily, quantity: str, index: Count = 0, ax: Axes | None = None) -> Axes:
    """A quantity over the last axis of a grid of variants, one line for each value of the axis before: gears, loads.

    Parameters
    ----------
    result : FamilyModes or another result of a family
        Of a family with one or two axes.
    quantity : str
        As in `histogram`.
    index : int
        Of the mode, where there are several values.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    UnknownNameError
        A quantity that the result does not have.
    PowertrainError
        A family with more axes, or whose last one has no numbers; an index that there is not.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> loads = {"vehicle.m": [1600.0, 2000.0, 2400.0], "gearbox.ratio": [6.0, 3.6, 2.2, 1.5, 1.1]}
    >>> ax = pt.plots.gear_map(pt.family(pt.examples.conventional(), loads, grid=True).modes(), "frequency_hz", 1)
    >>> ax.get_xlabel(), [line.get_label() for line in ax.lines]
    ('gearbox.ratio', ['vehicle.m = 1600 kg', 'vehicle.m = 2000 kg', 'vehicle.m = 2400 kg'])
    """
    family, shape = result.family, result.family.shape
    names = list(family.values)
    if len(shape) > 2:
        raise PowertrainError(f"a family with {len(shape)} axes, permitted: one or two")
    last = names[-1]
    if family.values[last].dtype == object:
        raise PowertrainError(f"{last} has no numbers, permitted on the last axis of a family: numbers")
    ax = new_axes(ax, 1, (6.4, 3.6))[0]
    found = _found(result, quantity)
    values = _at(found, quantity, index).reshape(-1, shape[-1])
    across = family.values[last].reshape(-1, shape[-1])
    for i, (x, y) in enumerate(zip(across, values, strict=True)):
        label = None
        if len(shape) == 2:
            label = f"{names[0]} = {_written(family.values[names[0]][i * shape[-1]])} {family.units[names[0]]}".rstrip()
        style: dict[str, Any] = {
            "color": COLOURS[i % len(COLOURS)],
            "linestyle": LINES[i % len(LINES)],
            "marker": "o",
            "markersize": 4,
        }
        ax.plot(x, y, label=label, **style)
    unit = family.units[last]
    ax.set_xlabel(f"{last} [{unit}]" if unit else last)
    ax.set_ylabel(_label(found, quantity, index))
    if len(shape) == 2:
        legend(ax, min(len(values), 3))
    grid(ax, "both")
    return ax


def _found(result: OfFamily, quantity: str) -> Quantity:
    known = result.quantities()
    if quantity not in known:
        raise UnknownNameError("quantity", quantity, known, "of this result")
    return known[quantity]


def _at(found: Quantity, quantity: str, index: int) -> np.ndarray:
    """(n,) ndarray: the one value of each variant that is shown."""
    values = found.values.reshape(len(found.values), -1)
    if values.dtype.kind not in "biuf":
        raise PowertrainError(f"{quantity} has values of type {values.dtype}, permitted: real numbers")
    if not index < values.shape[1]:
        raise PowertrainError(f"index = {index}, permitted: 0 to {values.shape[1] - 1}")
    return values[:, index].astype(float)


def _label(found: Quantity, quantity: str, index: int) -> str:
    which = f" of {found.axes[0]} {index}" if found.axes else ""
    return f"{quantity}{which} [{found.unit or '-'}]"


def _written(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
