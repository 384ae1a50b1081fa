"""Section on launching: Figs. 2.11 and 2.13 through ``control.NonlinearIOSystem``, and the events of the clutch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import control
import numpy as np

from .. import examples, plots
from ..base.errors import PowertrainError
from ..base.tables import number, words
from ..driveline.collection import HasDriveline
from ..driveline.ends import ends
from ..hybrid.manoeuvres import launch
from ..hybrid.nonlinear import initial_state, nonlinear_system
from ..hybrid.response import Event, Response
from ..reduction.condensed import two_mass
from ..reduction.twomass import SwitchedTwoMass
from .subject import Finding, Picture, Section, Subject, Table, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Spacing of the samples, on which the corners of the preset ramps lie [s].
SAMPLE_TIME = 0.001
WINDOW = (1.2, 3.2)
# Nothing changes before the ramps begin at 1.5 s, so the run may begin with the axes of the figures.
TIMES = np.linspace(*WINDOW, round((WINDOW[1] - WINDOW[0]) / SAMPLE_TIME) + 1)


def launch_section(subject: Subject) -> Section | None:
    car = subject.car
    if _input_shaft(subject) is None:
        return None
    title = "Launch"
    if why := subject.why_no_response():
        return Section(title, [f"Not shown: {why}."])
    detailed = examples.conventional(damping="open") if subject.is_source else car
    try:
        direct = {"detailed model": launch(detailed, timepts=TIMES)}
        sampled = {"detailed model": through_control(detailed, direct["detailed model"])}
        ratio = subject.ratio
    except PowertrainError as error:
        return Section(title, [f"Not shown: {error}."])
    text = [
        f"The clutch is open, the {words(subject.driving)} turns at 5000 rpm, all else rests. From t = 1.5 s the reference "
        "of the clutch torque rises to 370 N m and the engine torque to 350 N m, both in 0.22 s. The curves are samples "
        "every 1 ms of a discrete-time control.NonlinearIOSystem, exact there; the events are those of the simulation.",
    ]
    if subject.is_source:
        text.append(
            "The source prints neither end nor duration of its ramps; with these the slip ends at its 2.65 s. "
            'The detailed model has the damping set "open" throughout, so it rings longer after the lock than in the load '
            'change, which has the set "closed".'
        )
    try:
        control_model = _control_model(subject)
        direct["control model"] = launch(control_model, timepts=TIMES)
        sampled["control model"] = through_control(control_model, direct["control model"])
        text.append(_about_control_model(subject))
    except PowertrainError as error:
        text.append(f"There is no control model that switches: {error}.")
    pictures = _pictures(subject, direct["detailed model"], sampled, ratio)
    table = _event_table(direct, _is_turned(subject))
    return Section(title, text, tables=[table], pictures=pictures, findings=_lock(direct["detailed model"]))


def _lock(response: Response) -> list[Finding]:
    locks = [event for event in response.events if event.kind == "lock"]
    if not locks:
        return []
    what = f"heat in the clutch of a launch at 5000 rpm; it locks at {locks[-1].time:.2f} s"
    return [Finding(f"{number(locks[-1].heat / 1e3)} kJ", what, 3)]


def through_control(car: HasDriveline, direct: Response) -> control.TimeResponseData:
    """The same run through the discrete ``control.NonlinearIOSystem``, with the inputs and the first speed of ``direct``."""
    engine = ends(car).engine
    system = nonlinear_system(car, dt=SAMPLE_TIME)
    inputs = np.array([direct[name] for name in system.input_labels])
    start = initial_state(system, car, {engine: direct[f"{engine}_speed"][0]})
    return control.input_output_response(system, direct.time, inputs, start)


def _input_shaft(subject: Subject) -> str | None:
    """Node behind the only clutch where that joins the engine to the vehicle, else None."""
    if len(subject.car.clutches) != 1:
        return None
    sides = set(subject.car[subject.car.clutches[0]].nodes)
    parts = subject.car.release().parts()
    front = next(part for part in parts if subject.driving in part)
    behind = next((part for part in parts if subject.vehicle in part), front)
    return next(iter(behind & sides)) if behind is not front and behind & sides and front & sides else None


def _control_model(subject: Subject) -> SwitchedTwoMass:
    (clutch,) = subject.car.clutches
    closed = examples.conventional(damping="closed") if subject.is_source else subject.closed
    slipping = two_mass(subject.open, method="source")
    model = SwitchedTwoMass(closed=two_mass(closed, method="source"), slipping=slipping, clutch=clutch)
    shown = {subject.driving, _input_shaft(subject), subject.vehicle, subject.wheels} - {None}
    if not shown <= set(model.driveline.nodes):
        raise PowertrainError(f"it has the nodes {', '.join(model.driveline.nodes)}")
    return model


def _about_control_model(subject: Subject) -> str:
    tables = " (Table 2.3)", " (Table 2.2)"
    slipping, closed = tables if subject.is_source else ("", "")
    return (
        f"The control model is the two-mass model of the open clutch{slipping} while the clutch slips, and that of the "
        f"closed clutch{closed} from the lock on; twist and speeds are carried over."
    )


def _pictures(subject: Subject, direct: Response, sampled: dict, ratio: float | None) -> list[Picture]:
    (clutch,) = subject.car.clutches
    locks = [event.time for event in direct.events if event.kind == "lock"]
    names: dict[str, Any] = {
        "clutch": clutch,
        "driving": subject.driving,
        "input_shaft": _input_shaft(subject),
        "vehicle": subject.vehicle,
        "unit": subject.unit,
        "locks": locks,
    }
    panels = (3, 4, 3, 4) if subject.wheels and ratio is not None else (3, 4, 4)
    figure = new_figure(6.8, 1.0 + 0.5 * sum(panels))
    axes = figure.subplots(len(panels), sharex=True, height_ratios=panels)
    if subject.wheels:
        names["wheels"] = subject.wheels
    plots.launch(sampled["detailed model"], ratio, axes, **names)
    _as_in_source(subject, axes)
    caption = "Launch of the detailed model"
    pictures = [Picture("launch", f"{caption} (Fig. 2.11)" if subject.is_source else caption, figure)]
    if len(sampled) > 1 and subject.wheels:
        figure = new_figure(6.8, 8.6)
        axes = figure.subplots(5, sharex=True, height_ratios=(3, 4, 4, 3, 4))
        plots.launch_compared(sampled, axes, **names)
        _as_in_source(subject, axes, is_compared=True)
        caption = "Launch, detailed model and two-mass control model that switches at the lock"
        pictures.append(Picture("launch_compared", f"{caption} (Fig. 2.13)" if subject.is_source else caption, figure))
    return pictures


def _as_in_source(subject: Subject, axes: Sequence[Axes] | np.ndarray, is_compared: bool = False) -> None:
    axes[0].set_xlim(*WINDOW)
    axes[0].set_xticks(np.arange(1.2, 3.21, 0.2))
    if not subject.is_source:
        return
    # the ticks of the source; the curves reach a little beyond its axes
    axes[0].set_ylim(-5.0, 400.0)
    axes[0].set_yticks([0, 100, 200, 300, 400])
    axes[1].set_ylim(-150.0, 6300.0)
    axes[1].set_yticks([0, 2000, 4000, 6000])
    if is_compared:
        axes[2].set_ylim(-8.0, 345.0)
        axes[2].set_yticks([0, 100, 200, 300])
    axes[-1].set_ylim(-0.4, 10.8)
    axes[-1].set_yticks([0, 5, 10])


def _is_turned(subject: Subject) -> bool:
    """Whether side a of the clutch, whose speed counts positive in the slip, is the input shaft and not the engine's."""
    return subject.car[subject.car.clutches[0]].nodes[0] == _input_shaft(subject)


def _event_table(responses: dict[str, Response], is_turned: bool) -> Table:
    rows = [
        [
            label,
            f"{event.time:.4f}",
            words(event.element),
            _what_happened(event, is_turned and label == "detailed model"),
            f"{event.heat / 1e3:.3f}",
        ]
        for label, response in responses.items()
        for event in response.events
    ]
    headers = ("model", "time [s]", "clutch", "what happened", "heat so far [kJ]")
    return Table("Events of the clutch", headers, rows)


def _what_happened(event: Event, is_turned: bool) -> str:
    sides = [", driven side faster", ", driving side faster"]
    driven, driving = reversed(sides) if is_turned else sides
    faster = {1: driving, -1: driven}.get(int(event.mode), "")
    return {"lock": "locks", "slip": "starts to slip", "release": "is released"}[event.kind] + faster
