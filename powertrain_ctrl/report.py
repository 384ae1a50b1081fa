"""A report on one driveline: frequency tables, figures, ``report.html`` and ``report.md``.

Each section is one function of the driveline that returns a `Section`, or None where it does not apply; `SECTIONS`
lists them in order. What does not apply to a driveline for a reason says so in its section instead of failing.
"""

import io
import re
import tempfile
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from importlib import resources
from pathlib import Path
from typing import Any

import control
import matplotlib
import numpy as np
from matplotlib.figure import Figure

from . import __version__, examples, plots
from .assembly import as_driveline, assemble
from .driveline import Driveline
from .elements import Tyre
from .errors import FileError, PowertrainError, TopologyError
from .manoeuvres import engine_node, load_change
from .modal import Modes, modes
from .statespace import state_space
from .tables import html_table, markdown_table, text_table
from .twomass import TwoMass, two_mass

# Responses of larger drivelines take minutes; their modes do not.
RESPONSE_LIMIT = 200
SHAPES_SHOWN = 3
ELEMENTS_SHOWN = 60


@dataclass(frozen=True)
class Table:
    """Headers and rows of text under a caption; ``is_frequency`` tables are printed by the command line."""

    caption: str
    headers: Sequence[str]
    rows: Sequence[Sequence[str]]
    is_frequency: bool = False

    @property
    def text(self) -> str:
        return text_table(self.headers, self.rows)


@dataclass(frozen=True)
class Picture:
    """A matplotlib figure, the name of its files and what it shows."""

    name: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Section:
    """Title, paragraphs, a listing of fixed-width text, tables and pictures."""

    title: str
    text: Sequence[str] = ()
    listing: str = ""
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()


@dataclass(frozen=True)
class Report:
    """What was written."""

    title: str
    sections: tuple[Section, ...]
    files: tuple[Path, ...] = field(default=())

    @property
    def frequency_tables(self) -> tuple[Table, ...]:
        return tuple(table for section in self.sections for table in section.tables if table.is_frequency)


def write_report(car, folder, car_name: str = "Driveline") -> Report:
    """Write ``report.html``, ``report.md`` and the figures as SVG and PNG to a folder, all of them or none.

    For the source's car (`powertrain_ctrl.examples.conventional` in first gear) the printed values stand beside the
    computed ones. ``report.html`` is one self-contained file.

    Parameters
    ----------
    car : Driveline or TwoMass
    folder : str or Path
        Made if it is not there; files of an earlier report are replaced.
    car_name : str
        Title of the report.

    Returns
    -------
    Report

    Raises
    ------
    TopologyError
        A driveline that cannot be assembled.
    FileError
        The folder cannot be written; nothing is left in it then.

    Examples
    --------
    >>> import tempfile
    >>> import powertrain_ctrl as pt
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = write_report(pt.examples.front_wheel_drive(), folder)
    ...     sorted(file.name for file in report.files)[-2:]
    ['report.html', 'report.md']
    """
    subject = _Subject(as_driveline(car), car_name)
    _ = subject.as_given  # what is wrong with the whole driveline is said once, before anything is drawn
    sections = tuple(section for make in SECTIONS if (section := make(subject)) is not None)
    report = Report(subject.name, sections)
    files: dict[str, bytes] = {}
    for section in sections:
        for picture in section.pictures:
            for kind in ("svg", "png"):
                files[f"figures/{picture.name}.{kind}"] = _drawn(picture, kind)
    files["report.md"] = _markdown(report).encode()
    files["report.html"] = _html(report, files).encode()
    return Report(subject.name, sections, _write_all(Path(folder), files))


class _Subject:
    """The driveline of a report and what several sections need of it."""

    def __init__(self, car: Driveline, name: str):
        self.car = car
        self.name = name
        # The printed tables know no damping, so any set will do.
        sets = [known for known in examples.DAMPING if car.lock() == examples.conventional(damping=known)]
        self.is_source = bool(sets)
        self.damping = sets[0] if sets else None
        self.closed = car.lock()
        # The source's control models have one damping for each state of the clutch.
        self.open = (examples.conventional(damping="open") if self.is_source else car).release()

    @cached_property
    def as_given(self) -> Modes:
        return modes(self.car)

    @cached_property
    def closed_modes(self) -> Modes:
        return self.as_given if not self.car.released else modes(self.closed)

    @cached_property
    def open_parts(self) -> list[tuple[Driveline, Modes]]:
        """Parts with an elastic mode when every clutch is open."""
        parts = [self.open.part(next(iter(nodes))) for nodes in self.open.parts()]
        return [(part, result) for part in parts if len(result := modes(part)) > result.n_rigid]

    @cached_property
    def driving(self) -> str:
        return engine_node(self.car)

    @cached_property
    def wheels(self) -> str | None:
        tyres = (element.wheel for element in self.car if isinstance(element, Tyre))
        return next(tyres, next((name for name in ("wheels", "wheel") if name in self.car.nodes), None))

    @cached_property
    def vehicle(self) -> str | None:
        moving = (node for node in self.car.nodes if node in self.car.translating)
        return next(moving, "vehicle" if "vehicle" in self.car.nodes else None)

    @property
    def unit(self) -> str:
        return "m/s²" if self.vehicle in self.car.translating else "rad/s²"

    @cached_property
    def ratio(self) -> float | None:
        """Driving speed over wheel speed when everything turns as one body."""
        if self.wheels is None:
            return None
        model = assemble(self.responding)
        motion = model.rigid_motion
        return float(motion[model.nodes.index(self.driving)] / motion[model.nodes.index(self.wheels)])

    @cached_property
    def control_model(self) -> TwoMass:
        return two_mass(self.closed, method="source")

    @cached_property
    def responding(self) -> Driveline:
        """The driveline whose responses are shown: clutches closed where that can be, else as in the file."""
        try:
            self.closed_modes  # noqa: B018
        except TopologyError:
            return self.car
        return self.closed

    @cached_property
    def compared(self) -> dict[str, Any]:
        """Models to compare by label: the detailed one and, if there is one with the same ends, the control model."""
        models: dict[str, Any] = {"detailed model": self.responding}
        ends = {self.driving, self.vehicle, self.wheels} - {None}
        try:
            if ends <= set(self.control_model.driveline.nodes):
                models["control model"] = self.control_model
        except PowertrainError:
            pass  # the section on the control model says why
        return models

    def why_no_response(self) -> str:
        """Why the responses to driving torque cannot be shown, or nothing."""
        if self.driving in self.car.translating:
            return f'the node "{self.driving}" is not driven by a torque'
        if self.vehicle is None:
            return 'the driveline has no Mass and no node called "vehicle"'
        if len(self.as_given) > RESPONSE_LIMIT:
            return f"the driveline has {len(self.as_given)} modes; responses are shown up to {RESPONSE_LIMIT}"
        if not any({self.driving, self.vehicle} <= part for part in self.responding.parts()):
            return f'"{self.driving}" and "{self.vehicle}" are not connected'
        return ""


# --- sections


def _elements(subject: _Subject) -> Section:
    lines = repr(subject.car).splitlines()
    if len(lines) > ELEMENTS_SHOWN:
        lines = [*lines[:ELEMENTS_SHOWN], f"  ... {len(lines) - ELEMENTS_SHOWN} more"]
    text = ["SI units throughout; torque is positive when side a is turned ahead of side b."]
    if subject.is_source:
        text.append(
            "Parameters of Table 2.1. Its rows for the left and right side are taken as totals of both sides; only "
            "then do the printed frequencies come out. The source gives no damping for this model."
        )
    if subject.damping:
        text.append(
            "The damping here makes the resonance peak of the first mode that of the source's control model for the "
            f"{subject.damping} clutch, Table {'2.2' if subject.damping == 'closed' else '2.3'}."
        )
    return Section("Driveline", text, listing="\n".join(lines))


def _closed_clutch(subject: _Subject) -> Section:
    title = "Natural frequencies, closed clutch" if subject.car.clutches else "Natural frequencies"
    try:
        result = subject.closed_modes
    except TopologyError as error:
        return Section(title, [f"Not with every clutch closed: {error}."])
    caption = "Natural frequencies, every clutch closed" if subject.car.clutches else "Natural frequencies"
    if subject.is_source:
        tables = [_printed_beside("closed clutch, equation (2.12)", _printed()["closed"]["printed"], result)]
        shown = {1: "Mode shape of the dominant frequency, closed clutch (Fig. 2.8)"}
    else:
        tables = [Table(caption, result.headers, list(result.rows()), is_frequency=True)]
        shown = {
            mode: f"Mode shape {mode}"
            for mode in range(result.n_rigid, min(len(result), result.n_rigid + SHAPES_SHOWN))
        }
    text = [
        "Undamped natural frequencies. The damping ratio is that of the mode by itself, to first order in the damping."
    ]
    pictures, reasons = _shapes(result, shown, "mode", subject.closed)
    if result.strain_energy.any():
        springs, elastic = int(result.strain_energy.any(axis=1).sum()), len(result) - result.n_rigid
        figure = _figure(*plots.mode_energies_size(springs, min(elastic, 12)))
        plots.mode_energies(result, figure.subplots())
        pictures.append(Picture("energies", "Where the strain energy of each mode is", figure))
    return Section(title, [*text, *reasons], tables=tables, pictures=pictures)


def _as_in_file(subject: _Subject) -> Section | None:
    released = subject.car.released
    if not released or released == set(subject.car.clutches):
        return None
    caption = f"Natural frequencies, {', '.join(sorted(released))} open"
    rows = list(subject.as_given.rows())
    table = Table(caption, subject.as_given.headers, rows, is_frequency=True)
    return Section("Natural frequencies, clutches as in the file", tables=[table])


def _open_clutch(subject: _Subject) -> Section | None:
    if not subject.car.clutches:
        return None
    title = "Natural frequencies, open clutch"
    try:
        parts = subject.open_parts
    except PowertrainError as error:
        return Section(title, [f"Not with every clutch open: {error}."])
    text, tables, pictures = [], [], []
    if subject.is_source:
        text.append(
            "Launching: the part behind the open clutch. The other part, with the engine, is not analysed in the "
            "source. Damping is that of the second set, which makes the peak of the first mode that of Table 2.3."
        )
    for part, result in parts:
        name = f"the part with {_words(part.nodes[0])}"
        if subject.is_source and subject.vehicle in part.nodes:
            tables.append(_printed_beside("open clutch, equation (2.20)", _printed()["open"]["printed"], result))
            shown = {1: "Mode shape of the dominant frequency, open clutch (Fig. 2.12)"}
            drawn, reasons = _shapes(result, shown, "mode_open", part)
        else:
            tables.append(
                Table(
                    f"Natural frequencies, open clutch, {name}", result.headers, list(result.rows()), is_frequency=True
                )
            )
            if subject.is_source:
                continue
            shown = {result.n_rigid: f"First elastic mode, open clutch, {name}"}
            drawn, reasons = _shapes(result, shown, f"mode_open_{part.nodes[0]}", part)
        pictures += drawn
        text += reasons
    if not parts:
        text.append("No part has an elastic mode when every clutch is open.")
    tables.sort(key=lambda table: "f printed [Hz]" not in table.headers)
    return Section(title, text, tables=tables, pictures=pictures)


def _control_model(subject: _Subject) -> Section:
    title = "Two-mass control model"
    try:
        closed = subject.control_model
    except PowertrainError as error:
        return Section(title, [f"There is none: {error}."])
    if not subject.is_source:
        rows = [[name, unit, f"{value:.6g}"] for name, unit, value in _parameters(closed)]
        rows += [["natural frequency", "Hz", f"{closed.frequency_hz:.4f}"]]
        text = [
            f"The inertias on either side of {closed.shaft}, which twists most in the first mode, are added up; the "
            "damping is chosen so that the resonance peak is that of the detailed model."
        ]
        return Section(title, text, tables=[Table("Control model", ["parameter", "unit", "computed"], rows)])
    launching = two_mass(subject.open, method="source")
    tables = []
    for number, label, model in (("2.2", "closed", closed), ("2.3", "open", launching)):
        printed = _printed()[f"table_{number}"]
        rows = [[name, unit, printed[name], f"{value:.6g}"] for name, unit, value in _parameters(model)]
        tables.append(
            Table(f"Control model, {label} clutch, Table {number}", ["parameter", "unit", "printed", "computed"], rows)
        )
    first = subject.closed_modes.frequency_hz[1]
    text = [
        "Equations (2.14) and (2.22). The inertias on either side of the drive shafts are added up and the drive "
        "shafts keep their stiffness; the damping is chosen so that the resonance peak is that of the detailed model.",
        f"Closed, this model rings at {closed.frequency_hz:.2f} Hz and the detailed one at {first:.2f} Hz, because the "
        "stiffness leaves the tyres out.",
    ]
    return Section(title, text, tables=tables)


def _load_change(subject: _Subject) -> Section:
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
    for shown, name, caption, number in figures:
        figure = _figure(6.8, 6.4)
        axes = figure.subplots(3, sharex=True, height_ratios=(3, 4, 4))
        plots.load_change(
            shown, ratio, axes, subject.driving, subject.wheels or "wheels", subject.vehicle, unit=subject.unit
        )
        if subject.is_source:
            axes[0].set_xlim(0.6, 2.6)
            axes[0].set_xticks(np.arange(0.6, 2.61, 0.2))
            axes[0].set_ylim(-5.0, 300.0)
            axes[0].set_yticks([0, 100, 200, 300])
        pictures.append(Picture(name, f"{caption} ({number})" if subject.is_source else caption, figure))
    text = [
        f"Everything turns as one body with the {_words(subject.driving)} at 2000 rpm; from t = 1 s its torque "
        "rises from 0 to 250 N m in 0.2 s. The response is exact for this piecewise linear torque.",
    ]
    if subject.is_source:
        text.append("The source prints the axes of this figure but neither the end of the ramp nor its duration.")
    return Section(title, text, pictures=pictures)


def _bode(subject: _Subject) -> Section:
    title = "Frequency response"
    if why := subject.why_no_response():
        return Section(title, [f"Not shown: {why}."])
    torque, acceleration = f"{subject.driving}_torque", f"{subject.vehicle}_acceleration"
    result = modes(subject.responding)
    elastic = result.frequency_hz[result.n_rigid :]
    if not elastic.size:
        return Section(title, ["Not shown: no mode is elastic."])
    low, high = 10.0 ** np.floor(np.log10(elastic[0] / 10.0)), 10.0 ** np.round(np.log10(elastic[-1]))
    omega = 2.0 * np.pi * np.geomspace(low, max(high, 100.0 * low), 2000)
    responses = {
        label: control.frequency_response(state_space(model, torque, acceleration), omega)
        for label, model in subject.compared.items()
    }
    if not all(response.magnitude.any() for response in responses.values()):
        return Section(title, [f"Not shown: {_words(torque)} does not accelerate the {_words(subject.vehicle)}."])
    figure = _figure(6.8, 5.2)
    axes = figure.subplots(2, sharex=True, height_ratios=(3, 2))
    plots.bode(responses, axes, unit=f"({subject.unit})/(N m)")
    models = "detailed model and two-mass control model" if len(responses) > 1 else "detailed model"
    caption = f"Bode diagram, {_words(torque)} to {_words(acceleration)}, {models}"
    closed = "closed" if not subject.responding.released else "as in the file"
    text = [f"Clutches {closed}."] if subject.car.clutches else []
    return Section(title, text, pictures=[Picture("bode", caption, figure)])


SECTIONS = (_elements, _closed_clutch, _as_in_file, _open_clutch, _control_model, _load_change, _bode)


# --- parts of sections


def _printed() -> dict[str, Any]:
    """The source's printed values."""
    tables = tomllib.loads(resources.files(examples).joinpath("source_tables.toml").read_text(encoding="utf-8"))
    return tables


def _printed_beside(what: str, printed: Sequence[str], result: Modes) -> Table:
    headers = ("mode", "f printed [Hz]", "f computed [Hz]", "zeta [-]", "energy", "most strain energy in")
    rows = [[row[0], value, *row[1:]] for row, value in zip(result.rows(), printed, strict=True)]
    return Table(f"Natural frequencies, {what}", headers, rows, is_frequency=True)


def _parameters(model: TwoMass) -> list[tuple[str, str, float]]:
    return [
        ("J1", "kg m²", model.J1),
        ("J2", "kg m²", model.J2),
        ("stiffness", "N m/rad", model.stiffness),
        ("damping", "N m s/rad", model.damping),
        ("ratio", "–", model.ratio),
    ]


def _shapes(result: Modes, shown: dict[int, str], name: str, car: Driveline) -> tuple[list[Picture], list[str]]:
    """Pictures of mode shapes, and why there are none."""
    pictures = []
    nodes = int(result.kinetic_energy.any(axis=1).sum())
    for mode, caption in shown.items():
        figure = _figure(*plots.mode_shape_size(nodes))
        try:
            plots.mode_shape(result, mode, figure.subplots(), connect=_is_chain(car))
        except PowertrainError as error:
            return pictures, [f"Mode shapes are not shown: {error}."]
        pictures.append(Picture(f"{name}_{mode}", caption, figure))
    return pictures, []


def _is_chain(car: Driveline) -> bool:
    """Whether the inertias follow one another in the order given, without branch or loop."""
    place = {node: i for i, node in enumerate(car.nodes)}
    heavy = {node for element in car for row in element.inertias for node in row.nodes}
    joined: dict[str, set[str]] = {node: set() for node in car.nodes}
    for element in car:
        for node in element.nodes:
            joined[node] |= set(element.nodes) - {node}
    # Nodes without inertia are passed over: their neighbours are each other's.
    for node in car.nodes:
        if node not in heavy:
            for other in joined[node]:
                joined[other] = (joined[other] | joined[node]) - {node, other}
    return all(abs(place[node] - place[other]) == 1 for node in heavy for other in joined[node])


def _words(name: str) -> str:
    return name.replace("_", " ")


def _figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained")


# --- files


def _drawn(picture: Picture, kind: str) -> bytes:
    """The same bytes for the same figure: no date, no random identifiers."""
    file = io.BytesIO()
    metadata = {"Date": None, "Creator": None} if kind == "svg" else {"Software": None}
    with matplotlib.rc_context({"svg.hashsalt": picture.name, "svg.fonttype": "path"}):
        picture.figure.savefig(file, format=kind, dpi=200, metadata=metadata)
    return file.getvalue()


def _markdown(report: Report) -> str:
    blocks = [f"# {report.title}"]
    for section in report.sections:
        blocks.append(f"## {section.title}")
        blocks += section.text
        if section.listing:
            blocks.append(f"```\n{section.listing}\n```")
        for table in section.tables:
            blocks += [f"**{table.caption}**", markdown_table(table.headers, table.rows)]
        for picture in section.pictures:
            blocks += [f"![{picture.caption}](figures/{picture.name}.png)", f"*{picture.caption}*"]
    blocks.append(f"powertrain_ctrl {__version__}")
    return "\n\n".join(blocks) + "\n"


STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #1c1c1c; background: #fff; max-width: 62rem;
  margin: 2.5rem auto; padding: 0 1.25rem; }
h1 { font-size: 1.7rem; line-height: 1.25; margin: 0 0 .5rem; }
h2 { font-size: 1.25rem; margin: 2.75rem 0 .75rem; padding-top: .75rem; border-top: 1px solid #ddd; }
nav { color: #555; } nav a { color: #0b5a94; margin-right: 1.1rem; white-space: nowrap; }
p { max-width: 46rem; }
pre { font: 12px/1.45 ui-monospace, monospace; background: #f6f7f8; padding: .8rem; overflow-x: auto; }
.table { overflow-x: auto; margin: 1.25rem 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
caption { caption-side: top; text-align: left; font-weight: 600; padding-bottom: .35rem; white-space: nowrap; }
th { border-bottom: 1.5px solid #333; font-weight: 600; }
th, td { padding: .25rem .9rem .25rem 0; } td { border-bottom: 1px solid #e6e6e6; }
figure { margin: 1.75rem 0; } figure svg { max-width: 100%; height: auto; }
figcaption { color: #444; font-size: .93rem; }
footer { margin-top: 3rem; color: #666; font-size: .85rem; }
@media print { body { margin: 0; max-width: none; } figure, .table { break-inside: avoid; } }
"""


def _html(report: Report, files: dict[str, bytes]) -> str:
    parts, links = [], []
    for number, section in enumerate(report.sections, 1):
        links.append(f'<a href="#section-{number}">{escape(section.title)}</a>')
        parts.append(f'<h2 id="section-{number}">{escape(section.title)}</h2>')
        parts += [f"<p>{escape(paragraph)}</p>" for paragraph in section.text]
        if section.listing:
            parts.append(f"<pre>{escape(section.listing)}</pre>")
        for table in section.tables:
            body = html_table(table.headers, table.rows)
            captioned = body.replace("<table>", f"<table><caption>{escape(table.caption)}</caption>", 1)
            parts.append(f'<div class="table">{captioned}</div>')
        for picture in section.pictures:
            svg = _inline(files[f"figures/{picture.name}.svg"].decode(), picture)
            parts.append(f"<figure>{svg}<figcaption>{escape(picture.caption)}</figcaption></figure>")
    return "\n".join(
        [
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(report.title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>",
            f"<h1>{escape(report.title)}</h1>\n<nav>{' '.join(links)}</nav>",
            *parts,
            f"<footer>powertrain_ctrl {__version__}</footer>\n</body>\n</html>\n",
        ]
    )


def _inline(svg: str, picture: Picture) -> str:
    """The ``<svg>`` element alone, its identifiers made unique by the picture's name."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:xlink)?="[^"]*"', "", svg).replace("xlink:href=", "href=")
    svg = re.sub(r'\bid="', f'id="{picture.name}-', svg)
    svg = re.sub(r'href="#', f'href="#{picture.name}-', svg)
    svg = svg.replace("url(#", f"url(#{picture.name}-")
    return svg.replace("<svg", f'<svg role="img" aria-label="{escape(picture.caption)}"', 1).strip()


def _write_all(folder: Path, files: dict[str, bytes]) -> tuple[Path, ...]:
    """Write all files or none: they are finished in a hidden folder beside their places and then moved."""
    made = [path for path in (folder / "figures", folder, *folder.parents) if not path.exists()]
    try:
        (folder / "figures").mkdir(parents=True, exist_ok=True)
        blocked = next((folder / name for name in files if (folder / name).is_dir()), None)
        if blocked is not None:
            raise IsADirectoryError(0, f"{blocked.name} is a folder")
        with tempfile.TemporaryDirectory(dir=folder, prefix=".report-") as staging:
            for name, content in files.items():
                copy = Path(staging, name)
                copy.parent.mkdir(exist_ok=True)
                copy.write_bytes(content)
            for name in files:
                Path(staging, name).replace(folder / name)
    except OSError as error:
        for path in made:
            try:
                path.rmdir()
            except OSError:
                break
        raise FileError(f"{folder}: the report cannot be written there: {error.strerror}") from error
    return tuple(folder / name for name in files)
