"""Sections on the linear models: elements, natural frequencies, control model, load change, frequency response."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import plots
from ..base.errors import PowertrainError, TopologyError
from ..base.tables import number, words
from ..driveline.collection import Driveline
from ..hybrid.manoeuvres import load_change
from ..linear.forced import frequency_response
from ..linear.modal import Modes, modes
from ..linear.reflection import reflected
from ..reduction.condensed import two_mass
from ..reduction.twomass import TwoMass
from .frequencies import closed_table, in_file_table, open_tables, printed
from .subject import Finding, Picture, Section, Subject, Table, new_figure
from .verdict import accelerations

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SHAPES_SHOWN = 3
DEFINED = (
    "Undamped natural frequencies. The damping ratio zeta is that of the mode by itself, to first order in the damping."
)
# Bode diagrams end above the last mode by this factor.
BEYOND = 1.5
# Schematics of larger drivelines are not drawn.
NODES_DRAWN = 30


def elements_section(subject: Subject) -> Section:
    text = [
        "SI units throughout; torque is positive when side a is turned ahead of side b. All values are in the file at the "
        "end."
    ]
    if subject.is_source:
        text.append(
            "Parameters of Table 2.1. Its rows for the left and right side are totals of both; only then do the printed "
            "frequencies come out. The source gives no damping."
        )
    if subject.damping:
        text.append(
            "The damping here gives the first mode the resonance peak of the source's control model for the "
            f"{subject.damping} clutch, Table {'2.2' if subject.damping == 'closed' else '2.3'}."
        )
    shown: dict[str, tuple[str, Callable[[], Any]]] = {"schematic": ("The driveline as it is", lambda: subject.car)}
    if subject.is_source:
        shown["chain"] = (
            "Chain of inertias seen from the engine, gear ratios and tyre radius incorporated (Fig. 2.6)",
            lambda: reflected(subject.closed),
        )
        shown["chain_open"] = (
            "Chain behind the open clutch, seen from the input shaft (Fig. 2.10)",
            lambda: reflected(subject.open.part("vehicle")),
        )
    else:
        shown["chain"] = (
            f"Chain seen from {words(subject.car.nodes[0])}, ratios incorporated",
            lambda: reflected(subject.car),
        )
    return Section("Driveline", text, pictures=_schematics(shown))


def closed_clutch_section(subject: Subject) -> Section:
    title = "Natural frequencies, closed clutch" if subject.car.clutches else "Natural frequencies"
    try:
        result, table = subject.closed_modes, closed_table(subject)
    except TopologyError as error:
        # what to release the file has said
        released = sorted(subject.car.released)
        stay = f"{' and '.join(released)} {'stays' if len(released) == 1 else 'stay'} open, as in the file"
        return Section(title, [f"Not with every clutch closed: {error.fact}. So {stay}."])
    where = ", clutch closed" if subject.car.clutches else ""
    pictures, reasons = _drawn_modes(subject, result, subject.closed)
    return Section(
        title, [DEFINED, *reasons], tables=[table], pictures=pictures, findings=_first_mode(subject, result, where)
    )


def _drawn_modes(subject: Subject, result: Modes, car: Driveline) -> tuple[list[Picture], list[str]]:
    """Mode shapes and energies, and why there are none."""
    if subject.is_source:
        shown = {1: "Mode shape of the dominant frequency, closed clutch (Fig. 2.8)"}
    else:
        shown = {mode: "Mode shape" for mode in range(result.n_rigid, min(len(result), result.n_rigid + SHAPES_SHOWN))}
    pictures, reasons = _shapes(result, shown, "mode", car)
    if result.strain_energy.any():
        springs, elastic = int(result.strain_energy.any(axis=1).sum()), len(result) - result.n_rigid
        figure = new_figure(*plots.mode_energies_size(springs, min(elastic, 12)))
        plots.mode_energies(result, figure.subplots()).set_title("")
        pictures.append(Picture("energies", "Where the strain energy of each mode is, in per cent", figure))
    return pictures, reasons


def _first_mode(subject: Subject, result: Modes, where: str) -> list[Finding]:
    """The lowest frequency, how it is damped and, of the source's car, what is printed."""
    elastic = range(result.n_rigid, len(result))
    swinging = next((mode for mode in elastic if mode not in result.overdamped), None)
    if swinging is None:
        return []
    zeta = result.damping_ratio[swinging]
    what = f"lowest natural frequency{where}"
    what += (
        "; the source prints 2.6 Hz" if subject.is_source else f", most twist in {result.dominant_compliance(swinging)}"
    )
    found = [Finding(f"{number(result.frequency_hz[swinging])} Hz", what, 0)]
    if np.isfinite(zeta):
        found.append(Finding(f"zeta {number(zeta, 3)}", f"damping ratio of this mode{where}", 4))
    return found


def as_in_file_section(subject: Subject) -> Section | None:
    title, table = "Natural frequencies, clutches as in the file", in_file_table(subject)
    if table is None:
        return None
    if subject.responding is not subject.car:
        return Section(title, tables=[table])
    # not all clutches can be closed, so it is this state that all that follows is about
    result = subject.as_given
    pictures, reasons = _drawn_modes(subject, result, subject.car)
    findings = _first_mode(subject, result, ", clutches as in the file")
    return Section(title, [DEFINED, *reasons], tables=[table], pictures=pictures, findings=findings)


def open_clutch_section(subject: Subject) -> Section | None:
    if not subject.car.clutches:
        return None
    title = "Natural frequencies, open clutch"
    try:
        parts = subject.open_parts
    except PowertrainError as error:
        return Section(title, [f"Not with every clutch open: {error}."])
    text, pictures = [], []
    if subject.is_source:
        text.append(
            "Launching: the part behind the open clutch. The other part, with the engine, is not analysed in the "
            "source. Damping is that of the second set, which makes the peak of the first mode that of Table 2.3."
        )
    for part, result in parts:
        if subject.is_source and subject.vehicle in part.nodes:
            shown = {1: "Mode shape of the dominant frequency, open clutch (Fig. 2.12)"}
            drawn, reasons = _shapes(result, shown, "mode_open", part)
        elif subject.is_source:
            continue
        else:
            shown = {result.n_rigid: f"First elastic mode, open clutch, the part with {words(part.nodes[0])}"}
            drawn, reasons = _shapes(result, shown, f"mode_open_{part.nodes[0]}", part)
        pictures += drawn
        text += reasons
    if not parts:
        text.append("No part has an elastic mode when every clutch is open.")
    return Section(title, text, tables=open_tables(subject), pictures=pictures)


def control_model_section(subject: Subject) -> Section:
    title = "Two-mass control model"
    try:
        closed = subject.control_model
    except PowertrainError as error:
        return Section(title, [f"There is none: {error}."])
    if not subject.is_source:
        rows = [[name, unit, number(value, 6)] for name, unit, value in _parameters(closed)]
        rows += [["natural frequency", "Hz", f"{closed.frequency_hz:.4f}"]]
        text = [
            f"The inertias on either side of {closed.shaft}, which twists most in the first mode, are added up; the "
            "damping is chosen so that the resonance peak is that of the detailed model."
        ]
        table = Table("Control model", ["parameter", "unit", "computed"], rows)
        return Section(title, text, tables=[table], findings=_off(subject, closed))
    launching = two_mass(subject.open, method="source")
    tables = []
    for which, label, model in (("2.2", "closed", closed), ("2.3", "open", launching)):
        beside = printed()[f"table_{which}"]
        rows = [[name, unit, beside[name], number(value, 6)] for name, unit, value in _parameters(model)]
        tables.append(
            Table(f"Control model, {label} clutch, Table {which}", ["parameter", "unit", "printed", "computed"], rows)
        )
    shown: dict[str, tuple[str, Callable[[], Any]]] = {
        "two_mass": ("Two-mass control model, closed clutch (Fig. 2.8, right)", lambda: closed),
        "two_mass_open": ("Two-mass control model, open clutch (Fig. 2.12, right)", lambda: launching),
    }
    first = subject.closed_modes.frequency_hz[1]
    text = [
        "Equations (2.14) and (2.22): the inertias on either side of the drive shafts added up; damping that gives the "
        "resonance peak of the detailed model.",
        f"Closed, this model rings at {closed.frequency_hz:.2f} Hz and the detailed one at {first:.2f} Hz, because the "
        "stiffness leaves the tyres out.",
    ]
    return Section(title, text, tables=tables, pictures=_schematics(shown), findings=_off(subject, closed))


def _off(subject: Subject, model: TwoMass) -> list[Finding]:
    """How far the frequency of the control model is off."""
    result = modes(subject.responding)
    elastic = result.frequency_hz[result.n_rigid :]
    if not elastic.size:
        return []
    off = 100.0 * (model.frequency_hz / elastic[0] - 1.0)
    what = "frequency of the two-mass control model against the detailed one"
    return [Finding(f"{off:+.0f} %", f"{what}{'; Table 2.2 leaves the tyres out' if subject.is_source else ''}", 2)]


def load_change_section(subject: Subject) -> Section:
    title = "Load change"
    if why := subject.why_no_response():
        return Section(title, [f"Not shown: {why}."])
    try:
        responses = {label: load_change(model) for label, model in subject.compared.items()}
        ratio = subject.ratio
    except PowertrainError as error:
        return Section(title, [f"Not shown: {error}."])
    detailed = next(iter(responses))
    figures = [({detailed: responses[detailed]}, "load_change", "Load change of the detailed model", "Fig. 2.7")]
    if len(responses) > 1:
        figures.append(
            (responses, "load_change_compared", "Load change, detailed model and two-mass control model", "Fig. 2.9")
        )
    pictures = []
    for shown, name, caption, printed_as in figures:
        panels = (3, 4, 3, 4) if ratio is not None else (3, 4, 4)
        figure = new_figure(6.8, 1.0 + 0.5 * sum(panels))
        axes = figure.subplots(len(panels), sharex=True, height_ratios=panels)
        plots.load_change(
            shown,
            ratio,
            axes,
            subject.driving,
            subject.wheels or "wheels",
            subject.vehicle or "vehicle",
            unit=subject.unit,
        )
        if subject.is_source:
            load_change_axes_of_source(axes)
        pictures.append(Picture(name, f"{caption} ({printed_as})" if subject.is_source else caption, figure))
    text = [
        f"Everything turns as one body with the {words(subject.driving)} at 2000 rpm; from t = 1 s its torque "
        "rises from 0 to 250 N m in 0.2 s. The response is exact for this piecewise linear torque.",
    ]
    if subject.is_source:
        text.append("The source prints the axes of this figure but neither the end of the ramp nor its duration.")
    caption = "After a load change, 0 to 250 N m in 0.2 s, without control"
    highlight = accelerations({detailed: responses[detailed]}, subject.vehicle or "vehicle", subject.unit, caption)
    return Section(title, text, pictures=pictures, highlight=highlight)


def load_change_axes_of_source(axes: Sequence[Axes] | np.ndarray) -> None:
    """The axes of Figs. 2.7 and 2.9, a little wider so that lines on their edges are seen."""
    torque, speed, acceleration = axes[0], axes[1], axes[-1]
    torque.set_xlim(0.6, 2.6)
    torque.set_xticks(np.arange(0.6, 2.61, 0.2))
    torque.set_ylim(-5.0, 300.0)
    torque.set_yticks([0, 100, 200, 300])
    speed.set_ylim(1900.0, 6000.0)
    speed.set_yticks([2000, 4000, 6000])
    acceleration.set_ylim(-0.2, 6.0)
    acceleration.set_yticks([0, 2, 4, 6])


def bode_section(subject: Subject) -> Section:
    title = "Frequency response"
    if why := subject.why_no_response():
        return Section(title, [f"Not shown: {why}."])
    torque, acceleration = f"{subject.driving}_torque", f"{subject.vehicle}_acceleration"
    result = modes(subject.responding)
    elastic = result.frequency_hz[result.n_rigid :]
    if not elastic.size:
        return Section(title, ["Not shown: no mode is elastic."])
    low, high = 10.0 ** np.floor(np.log10(elastic[0] / 10.0)), 10.0 ** np.round(np.log10(elastic[-1]))
    omega = 2.0 * np.pi * np.geomspace(low, max(high, BEYOND * elastic[-1], 100.0 * low), 2000)
    try:
        responses = {
            label: frequency_response(model, omega, torque, acceleration) for label, model in subject.compared.items()
        }
    except PowertrainError as error:  # a torque converter, of which only poles are known
        return Section(title, [f"Not shown: {error}."])
    if not all(response.magnitude.any() for response in responses.values()):
        return Section(
            title, [f"Not shown: {words(torque)} does not accelerate the {words(subject.vehicle or 'vehicle')}."]
        )
    figure = new_figure(6.8, 5.2)
    axes = figure.subplots(2, sharex=True, height_ratios=(3, 2))
    plots.bode(responses, axes, unit=f"({subject.unit})/(N m)")
    models = "detailed model and two-mass control model" if len(responses) > 1 else "detailed model"
    caption = f"Bode diagram, {words(torque)} to {words(acceleration)}, {models}"
    closed = "closed" if not subject.responding.released else "as in the file"
    text = [f"Clutches {closed}."] if subject.car.clutches else []
    return Section(title, text, pictures=[Picture("bode", caption, figure)])


def _parameters(model: TwoMass) -> list[tuple[str, str, float]]:
    return [
        ("J1", "kg m²", model.J1),
        ("J2", "kg m²", model.J2),
        ("stiffness", "N m/rad", model.stiffness),
        ("damping", "N m s/rad", model.damping),
        ("ratio", "–", model.ratio),
    ]


def _schematics(shown: dict[str, tuple[str, Callable[[], Any]]]) -> list[Picture]:
    """Schematics by name, with caption and what gives the driveline; none of one too large or not to be reflected."""
    pictures = []
    for name, (caption, make) in shown.items():
        try:
            car = make()
        except PowertrainError:  # a loop has no chain, nor has what a loss factor damps
            continue
        drawn = 1 < len(car.driveline.nodes) <= NODES_DRAWN
        if drawn and (name != "chain" or all(len(element.nodes) <= 2 for element in car)):
            figure = new_figure(*plots.schematic_size(car))
            plots.schematic(car, figure.subplots())
            pictures.append(Picture(name, caption, figure))
    return pictures


def _shapes(result: Modes, shown: dict[int, str], name: str, car: Driveline) -> tuple[list[Picture], list[str]]:
    """Pictures of mode shapes, and why there are none."""
    pictures: list[Picture] = []
    nodes = int(result.kinetic_energy.any(axis=1).sum())
    for mode, caption in shown.items():
        figure = new_figure(*plots.mode_shape_size(nodes))
        try:
            plots.mode_shape(result, mode, figure.subplots()).set_title("")
        except PowertrainError as error:
            return pictures, [f"Mode shapes are not shown: {error}."]
        caption = f"{caption}, mode {mode} with {number(result.frequency_hz[mode])} Hz"
        pictures.append(Picture(f"{name}_{mode}", caption, figure))
    return pictures, []
