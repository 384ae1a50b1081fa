"""A report on one driveline: frequency tables, figures, ``report.html`` and ``report.md``.

The sections are functions, a module for each subject; here they are drawn and written to files.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ..base.doors import checked
from ..driveline.collection import HasDriveline
from ..identification.identified import Identified, Validation
from ..linear.assembly import as_driveline
from ..sampled.plant import SampledPlant
from .antijerk import antijerk_section
from .comparing import comparison_section
from .drawn import drawn
from .excitation import orders_section
from .folder import require_writable, write_all
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
from .markdown import markdown
from .measured import measured_section
from .numbering import numbered
from .origin import Origin
from .play import play_section
from .subject import Picture, Section, Subject, Table, subject_of
from .verdict import verdict_of
from .webpage import webpage

SECTIONS: dict[str, Callable[[Subject], Section | None]] = {
    "Driveline": elements_section,
    "Natural frequencies, closed clutch": closed_clutch_section,
    "Natural frequencies, clutches as in the file": as_in_file_section,
    "Natural frequencies, open clutch": open_clutch_section,
    "Two-mass control model": control_model_section,
    "Load change": load_change_section,
    "Frequency response": bode_section,
    "Engine orders": orders_section,
    "Control models compared": comparison_section,
    "Launch": launch_section,
    "Play and stages": play_section,
    "Anti-jerk control": antijerk_section,
}
# Most of the time goes into these.
NOT_QUICK = ("Control models compared", "Anti-jerk control")


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
    car: HasDriveline,
    folder: str | Path,
    car_name: str = "Driveline",
    quick: bool = False,
    progress: Callable[[str], object] | None = None,
    origin: Origin | None = None,
    measured: Identified | Sequence[Validation] | None = None,
    plant: SampledPlant | None = None,
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
    quick : bool
        Without control models compared and anti-jerk control, which take most of the time.
    progress : callable, optional
        Called with the title of each step when it begins.
    origin : Origin, optional
        Command and day for the foot of the page.
    measured : Identified or sequence of Validation, optional
        What `powertrain_ctrl.identify` gave, or `powertrain_ctrl.validate` for each run, for a section on measured runs.
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
    require_writable(Path(folder))
    begin = progress or (lambda step: None)
    subject = subject_of(as_driveline(car), car_name, plant)
    _ = subject.as_given  # what is wrong with the whole driveline is said once, before anything is drawn
    left_out = NOT_QUICK if quick else ()
    sections: dict[str, Section] = {}
    files: dict[str, bytes] = {}
    for title in (title for title in SECTIONS if title not in left_out):
        begin(title)
        if (section := SECTIONS[title](subject)) is None:
            continue
        sections[title] = section
        for picture in section.pictures:
            files |= _files(picture)
    if measured is not None:
        sections["Measured"] = measured_section(measured)
        for picture in sections["Measured"].pictures:
            files |= _files(picture)
    begin("Verdict and page")
    verdict = verdict_of(subject, sections, left_out)
    if verdict.picture is not None:
        files |= _files(verdict.picture)
    numbers = numbered(verdict, list(sections.values()))
    origin = origin or Origin()
    files["report.md"] = markdown(subject, verdict, numbers, origin).encode()
    files["report.html"] = webpage(subject, verdict, numbers, files, origin).encode()
    return Report(subject.name, tuple(sections.values()), write_all(Path(folder), files))


def _files(picture: Picture) -> dict[str, bytes]:
    return {f"figures/{picture.name}.{kind}": content for kind, content in drawn(picture).items()}
