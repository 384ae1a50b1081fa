"""Section on measured runs: what was found from them, how well the car does what was measured, and what it leaves."""

from __future__ import annotations

from collections.abc import Sequence

from .. import plots
from ..identification.identified import Identified, Validation
from .subject import Picture, Section, Table, new_figure


def measured_section(measured: Identified | Sequence[Validation]) -> Section:
    """Parameters with their errors where they were found here, the fit of every run, its curves and what is left."""
    runs: Sequence[Validation]
    before: Sequence[Validation | None]
    if isinstance(measured, Identified):
        runs, before = measured.runs, measured.before
        text = [
            "Parameters found from measured runs. The standard errors are those under noise of the sensors and of the "
            "measured torques; twice as much to either side holds 95 %.",
            *(f"Not determined: {sentence}." for sentence in measured.not_determined),
        ]
        tables = [Table("Parameters and delays", *measured.table())]
    else:
        runs, before = measured, [None] * len(measured)
        text, tables = ["The car beside runs that it was not fitted to."], []
    text.append("Fit: 100 % is exact, 0 % no better than the mean of what was measured.")
    tables.append(_fits(runs, before))
    pictures = []
    for number, (run, other) in enumerate(zip(runs, before, strict=True), 1):
        pictures += [_curves(number, run, other), _left(number, run)]
    return Section("Measured", text, tables=tables, pictures=pictures)


def _fits(runs: Sequence[Validation], before: Sequence[Validation | None]) -> Table:
    rows = []
    for run, other in zip(runs, before, strict=True):
        for name, percent in run.fit.items():
            rows.append([run.title, name, "–" if other is None else f"{other.fit[name]:.1f}", f"{percent:.1f}"])
    return Table("Fit of each run", ("run", "signal", "before [%]", "fit [%]"), rows)


def _curves(number: int, run: Validation, before: Validation | None) -> Picture:
    count = len(run.inputs) + len(run.measured)
    figure = new_figure(6.8, 1.0 + 1.7 * count)
    plots.measured(run, before, figure.subplots(count, sharex=True, squeeze=False)[:, 0])
    return Picture(f"measured_{number}", f"Model over measured, {run.title}", figure)


def _left(number: int, run: Validation) -> Picture:
    count = len(run.measured)
    figure = new_figure(6.8, 1.0 + 1.7 * count)
    plots.residual_spectrum(run, figure.subplots(count, sharex=True, squeeze=False)[:, 0])
    return Picture(f"residual_{number}", f"Spectrum of what is left, {run.title}", figure)
