"""Tables as plain text, Markdown and HTML, from headers and rows of strings; results that print as one."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from html import escape
from typing import Any, ClassVar

Rows = Sequence[Sequence[str]]


class Printed:
    """Base of results that print as a table, text in a terminal and HTML in a notebook; without rows there is no table.

    They say ``headers``, ``rows()`` and, if there is something above or below the table, ``heading`` and ``note``.
    """

    @property
    def headers(self) -> Sequence[str]:
        """Heads of the printed table."""
        raise NotImplementedError

    @property
    def heading(self) -> str:
        """What stands above the printed table."""
        return ""

    @property
    def note(self) -> str:
        """What stands below the printed table."""
        return ""

    def rows(self) -> Iterable[Sequence[str]]:
        """Rows of the printed table."""
        raise NotImplementedError

    def __repr__(self) -> str:
        rows = list(self.rows())
        table = text_table(self.headers, rows) if rows else ""
        return "\n".join(part for part in (self.heading, table, self.note) if part)

    def _repr_html_(self) -> str:
        rows = list(self.rows())
        heading, note = (f"<p>{html_text(text)}</p>" if text else "" for text in (self.heading, self.note))
        return heading + (html_table(self.headers, rows) if rows else "") + note


class Listed:
    """Base of records that a notebook shows as a table of their values; `UNITS` has the unit of a field by its name."""

    UNITS: ClassVar[Mapping[str, str]] = {}

    def listed(self) -> Rows:
        """Name, value and unit: of the fields that are numbers, words or pairs of them, unless a class knows better."""
        shown = [(item.name, getattr(self, item.name)) for item in fields(self)]  # type: ignore[arg-type]
        return [
            [name, _value(value), self.UNITS.get(name, "")]
            for name, value in shown
            if isinstance(value, int | float | str | tuple) and not name.startswith("_")
        ]

    def _repr_html_(self) -> str:
        return f"<p>{escape(type(self).__name__)}</p>{html_table(('', 'value', 'unit'), self.listed())}"


def _value(value: Any) -> str:
    if isinstance(value, tuple):
        return ", ".join(map(_value, value))
    return str(value) if isinstance(value, str | bool) else number(value, 6)


def text_table(headers: Sequence[str], rows: Rows) -> str:
    """Columns padded with spaces; columns of numbers are right-aligned.

    >>> print(text_table(["mode", "f [Hz]"], [["1", "2.64"], ["2", "21.09"]]))
    mode  f [Hz]
    1       2.64
    2      21.09
    """
    table = [list(headers), *[list(row) for row in rows]]
    width = [max(len(row[i]) for row in table) for i in range(len(headers))]
    right = [_is_numeric([row[i] for row in rows]) for i in range(len(headers))]
    lines = []
    for row in table:
        cells = [
            cell.rjust(w) if i and is_right else cell.ljust(w)
            for i, (cell, w, is_right) in enumerate(zip(row, width, right, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def markdown_table(headers: Sequence[str], rows: Rows) -> str:
    """GitHub-flavoured Markdown."""
    right = [_is_numeric([row[i] for row in rows]) for i in range(len(headers))]
    lines = [_pipes(headers), _pipes(["--:" if r else "---" for r in right])]
    return "\n".join([*lines, *(_pipes(row) for row in rows)])


def html_table(headers: Sequence[str], rows: Rows) -> str:
    """A bare ``<table>`` whose first column heads its rows; numbers are right-aligned, powers raised."""
    right = [_is_numeric([row[i] for row in rows]) for i in range(len(headers))]
    style = [f' style="text-align:{"right" if r else "left"}"' for r in right]
    head = "".join(f'<th scope="col"{s}>{html_text(h)}</th>' for h, s in zip(headers, style, strict=True))
    body = "".join(f"<tr>{_html_cells(row, style)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _html_cells(row: Sequence[str], style: Sequence[str]) -> str:
    texts = [_raised(escape(cell)) for cell in row]
    first = f'<th scope="row"{style[0]}>{texts[0]}</th>' if texts else ""
    return first + "".join(f"<td{s}>{text}</td>" for text, s in zip(texts[1:], style[1:], strict=True))


def html_text(text: str) -> str:
    """Text for HTML with its powers raised and zeta as the letter.

    >>> html_text("RMSE [m/s^2] < 1, VDV in m/s^1.75, zeta 0.1.")
    'RMSE [m/s<sup>2</sup>] &lt; 1, VDV in m/s<sup>1.75</sup>, ζ 0.1.'
    """
    return re.sub(r"\bzeta\b", "ζ", _raised(escape(text.replace(">=", "≥").replace("<=", "≤"))))


def plain_text(text: str) -> str:
    """Text without markup, with its powers raised as far as there are letters for them, and zeta as the letter.

    >>> plain_text("jerk [m/s^3], zeta 0.1")
    'jerk [m/s³], ζ 0.1'
    """
    return re.sub(r"\bzeta\b", "ζ", re.sub(r"\^([23])(?![0-9.]*[0-9])", lambda found: "²³"[int(found[1]) - 2], text))


def number(value: float, digits: int = 4) -> str:
    """A value to so many digits, without an exponent where it can be read without.

    >>> number(34444.4), number(0.0413889), number(1e6), number(2.5e-7)
    ('34440', '0.04139', '1e6', '2.5e-7')
    """
    text = f"{float(f'{value:.{digits}g}'):.{max(digits, 6)}g}"
    return re.sub(r"e([+-])0*", lambda found: "e" + found[1].strip("+"), text)


def words(name: str) -> str:
    """A name as it is read.

    >>> words("drive_shafts")
    'drive shafts'
    """
    return name.replace("_", " ")


def _raised(text: str) -> str:
    return re.sub(r"\^([0-9]+(?:\.[0-9]+)?)", r"<sup>\1</sup>", text)


def markdown_text(text: str) -> str:
    """Text for Markdown that shows as it is.

    >>> print(markdown_text("my_car <b>"))
    my\\_car &lt;b&gt;
    """
    return re.sub(r"([\\`*_{}\[\]#|~])", r"\\\1", escape(" ".join(text.split()), quote=False))


def _pipes(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _is_numeric(cells: Sequence[str]) -> bool:
    return all(cell[:1] in "0123456789+-–.−" or not cell for cell in cells)
