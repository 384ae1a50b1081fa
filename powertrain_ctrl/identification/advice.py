"""What a fit does not tell, in words, and what would help to tell it."""

from __future__ import annotations

import numpy as np

from ..linear.assembly import as_driveline
from .fitting import Fit, Found
from .separable import Analysis, analysed, in_words


def not_determined(fit: Fit, found: Found) -> tuple[str, ...]:
    """A sentence for all that is not told apart, not known, or on a bound."""
    names = (*fit.unknowns.names, *(f"delay of {signal}" for signal in fit.delayed))
    lost = [*found.analysis.groups, *((i,) for i in found.analysis.unknown)]
    said = in_words(found.analysis, names, _remedies(fit, found) if lost else {})
    for i in found.held:
        if i < len(fit.unknowns.names):
            parameter, value = (
                fit.unknowns.parameters[i],
                fit.unknowns.values(found.point.p[: len(fit.unknowns.names)])[i],
            )
            said += (f"{parameter.name}: on its bound of {value:.6g} {parameter.unit}; give wider bounds, or hold it",)
        elif i < fit.own:
            said += (f"{names[i]}: on its bound of {found.point.p[i]:g} s; the signals do not belong together",)
    return said


def _remedies(fit: Fit, found: Found) -> dict[tuple[int, ...], str]:
    """By what is lost: the one speed that was not measured and would tell it best, if one does."""
    lost = [*found.analysis.groups, *((i,) for i in found.analysis.unknown)]
    best: dict[tuple[int, ...], tuple[float, str]] = {}
    for signal in _not_measured(fit):
        analysis = _with(fit, found, signal)
        if analysis is None:
            continue
        for what in lost:
            error = float(np.nanmax(np.diag(analysis.covariance)[list(what)], initial=0.0)) or np.inf
            if not analysis.lost & set(what) and error < best.get(what, (np.inf, ""))[0]:
                best[what] = error, signal
    return {what: f"measure {signal} too" for what, (_, signal) in best.items()}


def _not_measured(fit: Fit) -> list[str]:
    measured = {name for prediction in fit.predictions for name in prediction.run.outputs}
    nodes = as_driveline(fit.unknowns.car).nodes
    return [f"{node}_speed" for node in nodes if f"{node}_speed" not in measured]


def _with(fit: Fit, found: Found, signal: str) -> Analysis | None:
    """What would be known if this speed had been measured as well as the first output was; nothing if it does not move.

    As well means: with noise that is as large a part of its size.
    """
    prediction, p = fit.predictions[0].near, found.point.p
    run = prediction.run
    count = len(run.outputs)
    both = prediction.at_run(
        run._replace(outputs=(*run.outputs, signal), measured=np.vstack([run.measured, np.zeros(len(run.time))]))
    )
    values, columns = both.modelled(p)
    share = np.zeros(columns.shape[2])
    share[count + 1 :] = found.point.shares[0][count:]
    if not np.ptp(values[-1]):
        return None
    J = both.sensitivities(p, share)[-1]
    level = found.levels[0].outputs[0] / run.size[0] * np.ptp(values[-1])
    # an offset and a drift tell nothing
    basis = np.linalg.qr(np.vander(run.time / run.time[-1], 2))[0]
    J = (J - basis @ (basis.T @ J)) / level
    return analysed(found.information + J.T @ J, len(fit.unknowns.names), fit.own, found.held)
