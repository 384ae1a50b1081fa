"""Measured runs over what a car would have been measured to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.doors import checked
from ..identification.identified import Validation
from .style import COLOURS, LINES, finish, legend, new_axes, shade, words

if TYPE_CHECKING:
    from .style import Panels

MEASURED = {"linewidth": 0.0, "marker": ".", "markersize": 2.5}
MODEL = {"color": COLOURS[0], "linestyle": LINES[0], "linewidth": 1.4}
BEFORE = {"color": COLOURS[2], "linestyle": LINES[1], "linewidth": 1.2}


@checked
def measured(run: Validation, before: Validation | None = None, axes: Panels = None) -> np.ndarray:
    """Inputs and outputs of a run over time, the model over what was measured.

    Parameters
    ----------
    run : Validation
        Of `validate`, or one of the ``runs`` of an `Identified`.
    before : Validation, optional
        The same run with another car, as one of ``before`` of an `Identified`.
    axes : sequence of matplotlib Axes, optional
        One for each input and each output.

    Returns
    -------
    ndarray of matplotlib Axes

    Raises
    ------
    PowertrainError
        Another number of axes.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car, t = pt.examples.conventional(), np.arange(0.0, 3.0, 0.01)
    >>> run = pt.simulate(car, t, {"engine_torque": np.interp(t, [0.5, 0.6], [0.0, 100.0])})
    >>> axes = pt.plots.measured(pt.validate(car, run, signals="engine_speed"))
    >>> [ax.get_ylabel() for ax in axes]
    ['engine torque', 'engine speed']
    """
    names = [*run.inputs, *run.measured]
    axes = new_axes(axes, len(names), (6.5, 1.0 + 1.7 * len(names)), sharex=True)
    for ax, (name, (time, values)) in zip(axes, run.inputs.items(), strict=False):
        ax.plot(time, values, color=shade(0.15), linewidth=1.2)
        ax.set_ylabel(words(name))
    outputs = axes[len(run.inputs) :]
    for ax, name in zip(outputs, run.measured, strict=True):
        ax.plot(run.time, run.measured[name], label="measured", color=shade(0.45), **MEASURED)
        if before is not None and name in before.model:
            ax.plot(before.time, before.model[name], label=f"before, {before.fit[name]:.1f} %", **BEFORE)
        ax.plot(run.time, run.model[name], label=f"model, fit {run.fit[name]:.1f} %", **MODEL)
        ax.set_ylabel(words(name))
        legend(ax, 3)
    axes[-1].set_xlabel("time [s]")
    finish(axes)
    return axes


@checked
def residual_spectrum(run: Validation, axes: Panels = None) -> np.ndarray:
    """What the model leaves of each output, over frequency: a mode that it lacks, or an order, is a peak.

    Parameters
    ----------
    run : Validation
    axes : sequence of matplotlib Axes, optional
        One for each output.

    Returns
    -------
    ndarray of matplotlib Axes

    Raises
    ------
    PowertrainError
        Another number of axes.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car, t = pt.examples.conventional(), np.arange(0.0, 3.0, 0.01)
    >>> run = pt.simulate(car, t, {"engine_torque": np.interp(t, [0.5, 0.6], [0.0, 100.0])})
    >>> softer = car.replace("drive_shafts", stiffness=3.3e4)
    >>> axes = pt.plots.residual_spectrum(pt.validate(softer, run, signals="engine_speed"))
    >>> axes[0].get_xlabel()
    'frequency [Hz]'
    """
    axes = new_axes(axes, len(run.measured), (6.5, 1.0 + 1.7 * len(run.measured)), sharex=True)
    for ax, name in zip(axes, run.measured, strict=True):
        frequency, density = run.spectrum(name)
        ax.semilogy(frequency[1:], np.sqrt(density[1:]), color=COLOURS[0], linewidth=1.2)
        ax.set_ylabel(f"{words(name)}\nper root Hz")
    axes[-1].set_xlabel("frequency [Hz]")
    finish(axes)
    return axes
