"""The frequency tables of a report, with the source's printed values beside them; light, so that they come at once."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from importlib import resources
from typing import Any

from .. import examples
from ..base.errors import PowertrainError, TopologyError
from ..base.tables import words
from ..linear.modal import Modes
from .subject import Subject, Table

# Marks a damping ratio of one and more.
MARK = " †"


def frequency_tables(subject: Subject) -> list[Table]:
    """All of them, as far as the driveline has them."""
    found: list[Table | None] = []
    try:
        found.append(closed_table(subject))
    except TopologyError:
        pass  # not every clutch can be closed
    found += [in_file_table(subject), *open_tables(subject)]
    return [table for table in found if table is not None]


def closed_table(subject: Subject) -> Table:
    """Of the driveline with every clutch closed; a `TopologyError` where that is not possible."""
    result = subject.closed_modes
    if subject.is_source:
        return _printed_beside("closed clutch, equation (2.12)", printed()["closed"]["printed"], result)
    return _table("Natural frequencies" + (", every clutch closed" if subject.car.clutches else ""), result)


def in_file_table(subject: Subject) -> Table | None:
    """With the clutches as in the file, where that is neither all closed nor all open."""
    released = subject.car.released
    if not released or released == set(subject.car.clutches):
        return None
    return _table(f"Natural frequencies, {', '.join(sorted(released))} open", subject.as_given)


def open_tables(subject: Subject) -> list[Table]:
    """Of the parts that an open clutch leaves, the one that the source prints first."""
    if not subject.car.clutches:
        return []
    try:
        parts = subject.open_parts
    except PowertrainError:
        return []
    tables: list[Table] = []
    for part, result in parts:
        if subject.is_source and subject.vehicle in part.nodes:
            tables.insert(0, _printed_beside("open clutch, equation (2.20)", printed()["open"]["printed"], result))
        else:
            name = f"the part with {words(part.nodes[0])}"
            tables.append(_table(f"Natural frequencies, open clutch, {name}", result))
    return tables


def printed() -> dict[str, Any]:
    """The source's printed values."""
    return tomllib.loads(resources.files(examples).joinpath("source_tables.toml").read_text(encoding="utf-8"))


def _table(caption: str, result: Modes) -> Table:
    rows, note = _marked(result)
    return Table(caption, result.headers, rows, is_frequency=True, note=note)


def _printed_beside(what: str, values: Sequence[str], result: Modes) -> Table:
    headers = ("mode", "f printed [Hz]", "f computed [Hz]", *result.headers[2:])
    rows, note = _marked(result)
    beside = [[row[0], value, *row[1:]] for row, value in zip(rows, values, strict=True)]
    return Table(f"Natural frequencies, {what}", headers, beside, is_frequency=True, note=note)


def _marked(result: Modes) -> tuple[list[list[str]], str]:
    """Rows in which the modes of the note are marked, and the note."""
    column, rows = result.headers.index("zeta [-]"), list(result.rows())
    over = set(result.overdamped.tolist())
    if not over:
        return rows, ""
    for mode, row in enumerate(rows):
        row[column] += MARK if mode in over else " " * len(MARK)
    return rows, f"†: {result.note}."
