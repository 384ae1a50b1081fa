"""Published cases beside what this package computes: `validation.md` shows them, tests/test_published.py checks them.

Parameters and published values are those of ``tests/reference`` and ``powertrain_ctrl/examples``.
"""

import json
from dataclasses import dataclass
from math import floor, log10
from pathlib import Path

REFERENCE = Path(__file__).parents[2] / "tests" / "reference"


def reference(file: str) -> dict[str, dict]:
    """Cases of a file of references, by name."""
    return {case["name"]: case for case in json.loads((REFERENCE / f"{file}.json").read_text())["cases"]}


@dataclass(frozen=True)
class Row:
    """One number: as published (text has the printed digits), as computed here, and how far apart they may be."""

    quantity: str
    published: float | str
    computed: float
    unit: str
    allowed: float

    @property
    def difference(self) -> float:
        return abs(self.computed - float(self.published))

    @property
    def ours(self) -> str:
        """With one digit more than may differ."""
        return f"{self.computed + 0.0:.{max(0, 1 - floor(log10(self.allowed))) if self.allowed else 0}f}"

    @property
    def theirs(self) -> str:
        if isinstance(self.published, str):
            return self.published
        return min(f"{self.published:.15g}", f"{self.published:.{len(self.ours.partition('.')[2])}f}", key=len)


@dataclass(frozen=True)
class Case:
    """What was published, where, and how it compares."""

    title: str
    source: str
    rows: tuple[Row, ...]

    @property
    def holds(self) -> bool:
        return all(row.difference <= row.allowed for row in self.rows)

    def _repr_markdown_(self) -> str:
        lines = [f"**{self.title}.** {self.source}", "", "| | published | computed | difference | allowed |"]
        lines.append("|---|--:|--:|--:|--:|")
        for row in self.rows:
            unit = f" [{row.unit}]" if row.unit else ""
            differences = f"{row.difference:.1e} | {row.allowed:.1e}" if row.allowed else "none | none"
            lines.append(f"| {row.quantity.replace('_', ' ')}{unit} | {row.theirs} | {row.ours} | {differences} |")
        return "\n".join(lines)


@dataclass(frozen=True)
class Summary:
    """How many numbers of each chapter are compared, and whether all are as far apart as they may be."""

    chapters: dict[str, list[Case]]

    def _repr_markdown_(self) -> str:
        lines = ["| | cases | numbers | within what is allowed |", "|---|--:|--:|--:|"]
        for title, cases in self.chapters.items():
            rows = [row for case in cases for row in case.rows]
            within = sum(row.difference <= row.allowed for row in rows)
            lines.append(f"| {title} | {len(cases)} | {len(rows)} | {within} |")
        return "\n".join(lines)


def last_digit(printed: str) -> float:
    """What one unit of the last printed digit is worth."""
    mantissa, _, exponent = printed.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def printed(quantity: str, text: str, computed: float, unit: str, units: float = 0.5) -> Row:
    """A row whose published value is rounded (half a unit of its last digit), or truncated (a whole one)."""
    return Row(quantity, text, float(computed), unit, units * last_digit(text) * (1.0 + 1e-12))
