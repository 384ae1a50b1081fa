"""A report on one driveline: frequency tables, figures, ``report.html`` and ``report.md``.

The sections are functions, a module for each subject; here they are put on a page and written to files.
"""

from __future__ import annotations

import io
import re
import tempfile
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import matplotlib

from .. import __version__
from ..base.doors import checked
from ..base.errors import FileError
from ..base.paths import written
from ..base.tables import html_table, html_text, markdown_table, markdown_text
from ..driveline.collection import HasDriveline
from ..linear.assembly import as_driveline
from ..sampled.plant import SampledPlant
from .antijerk import antijerk_section
from .comparing import comparison_section
from .excitation import orders_section
from .launching import launch_section
from .linear import (
    as_in_file_section,
    bode_section,
    closed_clutch_section,
    control_model_section,
    elements_section,
    load_change_section,
    open_clutch_section,
)
from .play import play_section
from .subject import Picture, Section, Table, subject_of

SECTIONS = (
    elements_section,
    closed_clutch_section,
    as_in_file_section,
    open_clutch_section,
    control_model_section,
    load_change_section,
    bode_section,
    orders_section,
    comparison_section,
    launch_section,
    play_section,
    antijerk_section,
)


@dataclass(frozen=True)
class Report:
    """What was written."""

    title: str
    sections: tuple[Section, ...]
    files: tuple[Path, ...] = field(default=())

    @property
    def frequency_tables(self) -> tuple[Table, ...]:
        return tuple(table for section in self.sections for table in section.tables if table.is_frequency)


@checked
def write_report(
    car: HasDriveline, folder: str | Path, car_name: str = "Driveline", plant: SampledPlant | None = None
) -> Report:
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
    plant : SampledPlant, optional
        What drives the car, for anti-jerk control, as of `load_plant`; as is usual for an engine if not given.

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
    >>> discs = pt.Driveline(
    ...     pt.Inertia("a", J=1.0), pt.Inertia("b", J=2.0), pt.SpringDamper("shaft", "a", "b", stiffness=400.0)
    ... )
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = write_report(discs, folder)
    ...     [file.name for file in report.files][-2:]
    ['report.md', 'report.html']
    """
    subject = subject_of(as_driveline(car), car_name, plant)
    _ = subject.as_given  # what is wrong with the whole driveline is said once, before anything is drawn
    sections = tuple(section for make in SECTIONS if (section := make(subject)) is not None)
    report = Report(subject.name, sections)
    files: dict[str, bytes] = {}
    for section in sections:
        for picture in section.pictures:
            for kind, content in _drawn(picture).items():
                files[f"figures/{picture.name}.{kind}"] = content
    files["report.md"] = _markdown(report).encode()
    files["report.html"] = _html(report, files).encode()
    return Report(subject.name, sections, _write_all(Path(folder), files))


def _drawn(picture: Picture) -> dict[str, bytes]:
    """SVG and PNG in one layout, the same bytes for the same figure: no date, no random identifiers."""
    files, layout = {}, picture.figure.get_layout_engine()
    for kind, metadata in (("svg", {"Date": None, "Creator": None}), ("png", {"Software": None})):
        file = io.BytesIO()
        with matplotlib.rc_context({"svg.hashsalt": picture.name, "svg.fonttype": "path"}):
            picture.figure.savefig(file, format=kind, dpi=200, metadata=metadata)
        files[kind] = file.getvalue()
        picture.figure.set_layout_engine("none")  # laid out once, which takes as long as drawing
    picture.figure.set_layout_engine(layout)
    return files


def _markdown(report: Report) -> str:
    blocks = [f"# {markdown_text(report.title)}"]
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
caption { caption-side: top; text-align: left; font-weight: 600; padding-bottom: .35rem; }
sup { font-size: .7em; line-height: 0; }
th { border-bottom: 1.5px solid #333; font-weight: 600; }
th, td { padding: .25rem .9rem .25rem 0; } td { border-bottom: 1px solid #e6e6e6; white-space: nowrap; }
td:last-child { white-space: normal; }
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
        parts += [f"<p>{html_text(paragraph)}</p>" for paragraph in section.text]
        if section.listing:
            parts.append(f"<pre>{escape(section.listing)}</pre>")
        for table in section.tables:
            body = html_table(table.headers, table.rows)
            captioned = body.replace("<table>", f"<table><caption>{html_text(table.caption)}</caption>", 1)
            parts.append(f'<div class="table">{captioned}</div>')
        for picture in section.pictures:
            svg = _inline(files[f"figures/{picture.name}.svg"].decode(), picture)
            parts.append(f"<figure>{svg}<figcaption>{html_text(picture.caption)}</figcaption></figure>")
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
    except (OSError, ValueError) as error:  # ValueError: a path with a zero byte
        for path in made:
            try:
                path.rmdir()
            except (OSError, ValueError):
                break
        reason = getattr(error, "strerror", None) or error
        raise FileError(f"{written(folder)}: the report cannot be written there: {reason}") from error
    return tuple(folder / name for name in files)
