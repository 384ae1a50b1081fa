"""Section on simpler models: how wrong each is, for both states of the clutch, over the order and over the gears."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .. import examples, plots
from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
from ..driveline.ends import ends
from ..hybrid.manoeuvres import load_change
from ..linear.modal import modes
from ..linear.stability import undamped_modes
from ..reduction.balanced import reduced
from ..reduction.comparison import ModelComparison, compare_models
from ..reduction.condensed import two_mass
from .linear import load_change_axes_of_source
from .subject import Picture, Section, Subject, Table, new_figure, under

if TYPE_CHECKING:
    import control

METHODS = ("source", "series", "modal", "fit")
SHOWN_IN_LOAD_CHANGE = ("source", "series", "modal")
BALANCED = (2, 4)
ORDERS = range(2, 9)
RAMP = 0.1
GEARS = (6.0, 3.6, 2.4, 1.7, 1.3)
# What the modal model keeps in first gear: band error to 10 Hz, root mean square error [m/s^2] at 100 ms.
BOUNDS = {"closed": (0.04, 0.025), "open": (0.06, 0.03)}


def comparison_section(subject: Subject) -> Section:
    title = "Control models compared"
    if why := subject.why_no_response():
        return Section(title, [f"Not shown: {why}."])
    text = [
        "Simpler models from torque to vehicle acceleration, up to 10 Hz and after torque ramps to 250 N m. "
        '"source" adds up the inertias on either side of the drive shafts and keeps their stiffness; "series" puts '
        'the tyres in series with them; "modal" has the first elastic mode; "fit" is least squares over frequency; '
        '"balanced" is balanced reduction to that many states. Band error: root of the integral of the squared error '
        "over that of the squared gain."
    ]
    tables: list[Table] = []
    pictures: list[Picture] = []
    compared: dict[str, ModelComparison] = {}
    for state, car in _states(subject).items():
        try:
            comparison, left_out = _compared(car)
        except PowertrainError as error:
            text.append(f"{_named(state)}: not shown: {error}.")
            continue
        text += [f"{_named(state)}: {reason}" for reason in left_out]
        compared[state] = comparison
        tables += under(_named(state), _tables(comparison, state))
        pictures += under(_named(state), _curves(comparison, state))
    if subject.is_source:
        text.append(
            'The source\'s stiffness leaves the tyres out, so "source" '
            f"rings {100.0 * compared['closed']['source'].frequency_error:.0f} % too high."
        )
        tables += under("Every gear", [_gears()])
        text.append(_about_gears())
    if compared:
        text.append("Modal reduction keeps the slowest modes and the static response of the others.")
        first, last = (
            under("Load change", _load_change(subject)),
            under("Order of the model", _order(subject, compared)),
        )
        pictures = [*pictures, *first, *last]
    return Section(title, text, tables=tables, pictures=pictures)


def _states(subject: Subject) -> dict[str, Driveline]:
    """What is compared: the driveline with clutches closed and, where it has one, what is behind the open clutch.

    Where clutches cannot all be closed, the driveline as in the file.
    """
    closed = examples.conventional(damping="closed") if subject.is_source else subject.responding
    if not subject.car.clutches:
        return {"": closed}
    return {"file" if closed.released else "closed": closed, "open": subject.open}


def _named(state: str) -> str:
    return {"": "Driveline", "file": "Clutches as in the file"}.get(state, f"{state.capitalize()} clutch")


def _of_clutch(state: str) -> str:
    return {"": "", "file": ", clutches as in the file"}.get(state, f", {state} clutch")


def _compared(car: Driveline) -> tuple[ModelComparison, list[str]]:
    """Comparison of the models there are, and why others are not there."""
    _check(car)
    models: dict[str, object] = {}
    reasons: dict[str, list[str]] = {}
    for method in METHODS:
        try:
            models[method] = two_mass(car, method)
        except PowertrainError as error:
            reasons.setdefault(str(error), []).append(f'"{method}"')
    models |= {f"balanced, order {order}": _balanced(car, order) for order in BALANCED if order < _states_of(car)}
    left_out = [f"no {', '.join(names)}: {why}." for why, names in reasons.items()]
    return compare_models(car, models), left_out


def _check(car: Driveline) -> None:
    """A driveline that has no simpler model, or none whose error is finite, is a `PowertrainError`."""
    body, _, _ = _signals(car)
    result = modes(body)
    if not result.n_rigid or len(result) == result.n_rigid:
        raise PowertrainError("it needs a rigid motion and an elastic mode")
    undamped = undamped_modes(body)
    if undamped.size:
        raise PowertrainError(
            f"the oscillation with {result.frequency_hz[undamped[0]]:.4g} Hz is undamped, so no error is finite"
        )


def _signals(car: Driveline) -> tuple[Driveline, str, str]:
    """Part that carries the vehicle, the torque that drives it and its acceleration."""
    between = ends(car)
    if between.vehicle is None:
        raise PowertrainError("the driveline has no Mass")
    return between.part, f"{between.driving}_torque", f"{between.vehicle}_acceleration"


def _states_of(car: Driveline) -> int:
    return 2 * len(modes(ends(car).part)) - 1


def _balanced(car: Driveline, order: int) -> control.StateSpace:
    body, torque, acceleration = _signals(car)
    return reduced(body, order, inputs=torque, outputs=acceleration)


def _tables(comparison: ModelComparison, state: str) -> list[Table]:
    """The printed table in two, so that it fits a page: parameters, and errors."""
    headers, rows = comparison.headers, comparison.rows()
    split = headers.index("damping [N m s/rad]") + 1
    return [
        Table(f"Control models{_of_clutch(state)}", headers[:split], [row[:split] for row in rows]),
        Table(
            f"Errors of torque to vehicle acceleration{_of_clutch(state)}",
            [headers[0], *headers[split:]],
            [[row[0], *row[split:]] for row in rows],
        ),
    ]


def _curves(comparison: ModelComparison, state: str) -> list[Picture]:
    name = f"_{state}" if state else ""
    figure = new_figure(6.8, 5.6)
    plots.model_errors(comparison, figure.subplots(2, sharex=True))
    errors = Picture(f"model_errors{name}", f"Gain and error of the models{_of_clutch(state)}", figure)
    figure = new_figure(6.8, 4.8)
    axes = plots.ramp_responses(comparison, RAMP, figure.subplots(2, sharex=True))
    axes[0].set_xlim(0.0, 1.5)
    caption = f"Torque ramp to 250 N m in {1e3 * RAMP:.0f} ms{_of_clutch(state)}"
    return [errors, Picture(f"ramp{name}", caption, figure)]


def _load_change(subject: Subject) -> list[Picture]:
    """Fig. 2.9 with more control models than the source's."""
    car = _states(subject).get("closed", subject.responding)
    responses = {"detailed": load_change(car)}
    for method in SHOWN_IN_LOAD_CHANGE:
        try:
            responses[method] = load_change(two_mass(car, method))
        except PowertrainError:
            continue  # the text says why
    ends = [f"{subject.driving}_speed", f"{subject.vehicle}_acceleration"]
    responses = {label: r for label, r in responses.items() if all(end in r for end in ends)}
    if len(responses) < 2:
        return []
    figure = new_figure(6.8, 6.4)
    axes = figure.subplots(3, sharex=True, height_ratios=(2, 3, 6))
    plots.load_change(responses, None, axes, subject.driving, vehicle=subject.vehicle or "vehicle", unit=subject.unit)
    if subject.is_source:
        load_change_axes_of_source(axes)
    caption = "Load change, detailed model and control models"
    caption = f"{caption} (Fig. 2.9 with further models)" if subject.is_source else caption
    return [Picture("load_change_models", caption, figure)]


def _order(subject: Subject, compared: dict[str, ModelComparison]) -> list[Picture]:
    """Hankel singular values, and the band error over the order."""
    figure = new_figure(5.8, 3.4)
    plots.hankel({_named(state): comparison for state, comparison in compared.items()}, figure.subplots())
    pictures = [Picture("hankel", "Hankel singular values, torque to vehicle acceleration", figure)]
    for state, car in _states(subject).items():
        if state not in compared:
            continue
        body, torque, acceleration = _signals(car)
        models: dict[str, object] = {}
        for method in ("balanced", "modal"):
            for order in ORDERS:
                if order >= _states_of(car):
                    continue
                try:
                    models[f"{method} reduction {order}"] = reduced(body, order, method, torque, acceleration)
                except PowertrainError:
                    continue  # an order that would split a pair of poles
        for method in METHODS:
            try:
                models[f"two masses, {method}"] = two_mass(car, method)
            except PowertrainError:
                continue
        if not models:
            continue
        figure = new_figure(6.8, 3.8)
        plots.error_against_order(compare_models(car, models, ramps=(RAMP,)), figure.subplots())
        name = f"order_{state}" if state else "order"
        pictures.append(Picture(name, f"Error over the order of the model{_of_clutch(state)}", figure))
    return pictures


def _gears() -> Table:
    """The modal model in every gear of the preset, and whether the bounds of first gear hold."""
    rows = []
    for state, bounds in BOUNDS.items():
        for gear in GEARS:
            car = examples.conventional(gear_ratio=gear, damping=state)
            car = car if state == "closed" else car.release("clutch")
            error = compare_models(car, {"modal": two_mass(car)}, ramps=(RAMP,))["modal"]
            frequency = modes(ends(car).part).frequency_hz
            measured = error.band_error, error.rmse[RAMP]
            names = ("band error", "RMSE")
            beyond = [name for name, value, most in zip(names, measured, bounds, strict=True) if value > most]
            rows.append(
                [
                    state,
                    f"{gear:g}",
                    *(f"{value:.2f}" for value in frequency[1:3]),
                    *(f"{value:.2g}" for value in measured),
                    f"no: {', '.join(beyond)}" if beyond else "yes",
                ]
            )
    headers = ["clutch", "gear ratio", "f1 [Hz]", "f2 [Hz]", "band error to 10 Hz", "RMSE 100 ms [m/s^2]"]
    return Table('"modal" in every gear', [*headers, "within the bounds of first gear"], rows)


def _about_gears() -> str:
    (closed, closed_rmse), (launching, launching_rmse) = BOUNDS.values()
    return (
        f'In first gear "modal" has a band error below {closed:g} with closed and {launching:g} with open clutch and a root '
        f"mean square error below {closed_rmse:g} and {launching_rmse:g} m/s^2. Higher gears keep the latter."
    )
