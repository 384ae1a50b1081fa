"""The first section: what was found, in five numbers and one figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..base.tables import words
from .subject import Finding, Picture, Section, Subject, new_figure

if TYPE_CHECKING:
    from ..hybrid.response import Response

NUMBERS = 5
# Name of the verdict's figure and of its files.
FIGURE = "verdict"


@dataclass(frozen=True)
class Verdict:
    """Paragraphs, findings with the title of the section that shows them, and a figure if there is one."""

    text: tuple[str, ...]
    findings: tuple[tuple[Finding, str], ...]
    picture: Picture | None


def verdict_of(subject: Subject, sections: Mapping[str, Section], left_out: Sequence[str] = ()) -> Verdict:
    """The findings that say most, in the order of the sections, and the figure of the last section that has one."""
    found = [(finding, section.title) for section in sections.values() for finding in section.findings]
    most = sorted(found, key=lambda pair: pair[0].rank)[:NUMBERS]
    shown = [section.highlight for section in sections.values() if section.highlight is not None]
    return Verdict(
        _text(subject, left_out), tuple(pair for pair in found if pair in most), shown[-1] if shown else None
    )


def accelerations(
    responses: Mapping[str, Response], vehicle: str, unit: str, caption: str, signal: str | None = None
) -> Picture:
    """The verdict's figure: how the vehicle accelerates, without and with what helps; ``signal`` if it has another name."""
    from ..plots.style import design_line, finish, legend

    figure = new_figure(0.0, 2.7)
    ax = figure.subplots()
    for i, (label, response) in enumerate(responses.items()):
        ax.plot(response.time, response[signal or f"{vehicle}_acceleration"], label=label, **design_line(i))
    ax.set_xlabel("time [s]")
    ax.set_ylabel(f"{words(vehicle)}\nacceleration [{unit}]")
    if len(responses) > 1:
        legend(ax, len(responses))
    finish([ax])
    return Picture(FIGURE, caption, figure)


def _text(subject: Subject, left_out: Sequence[str]) -> tuple[str, ...]:
    text = []
    if subject.is_source:
        text.append(
            'The source is a section of a dissertation, "2.2.2 Oscillation Analysis and Control Models", on conventional '
            "powertrains. (2.12), Table 2.1 or Fig. 2.8 are its equations, tables and figures; those of this report "
            "have numbers without a point."
        )
    if left_out:
        text.append(f"Left out of this quick report: {' and '.join(left_out)}.")
    return tuple(text)
