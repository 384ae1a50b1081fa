"""A report as one self-contained web page: verdict, contents, sections, and where it comes from."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from html import escape
from importlib import resources

from ..base.tables import html_table, html_text
from .drawings import embedded, shades
from .numbering import Chapter, Numbered, Numbering
from .origin import Origin, driveline_file
from .subject import Finding, Picture, Subject, Table
from .verdict import Verdict

# Longer tables are folded away, longer drivelines are not printed in the foot.
ROWS_OPEN, FILE_SHOWN = 20, 2000


def webpage(subject: Subject, verdict: Verdict, numbers: Numbering, files: Mapping[str, bytes], origin: Origin) -> str:
    """The page; ``files`` has the figures as SVG by ``figures/<name>.svg``."""
    body = [*_verdict(subject, verdict, numbers, files)]
    for chapter in numbers.chapters:
        body += _chapter(chapter, numbers, files)
    style = resources.files(__package__).joinpath("page.css").read_text(encoding="utf-8")
    content = "\n".join(body)
    return "\n".join(
        [
            '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            f"<title>{escape(subject.name)}</title>\n<style>\n{shades(content)}{style}</style>\n</head>\n<body>",
            _contents(numbers),
            f"<main>\n{content}\n{_foot(subject, origin)}\n</main>\n</body>\n</html>\n",
        ]
    )


def _contents(numbers: Numbering) -> str:
    lines = ['<nav aria-label="Contents"><ol>', '<li><a href="#verdict">Verdict</a></li>']
    for chapter in numbers.chapters:
        topics = "".join(_entry(topic.anchor, topic.title) for topic in chapter.topics if topic.title)
        below = f"<ol>{topics}</ol>" if topics else ""
        lines.append(f'<li><a href="#{chapter.anchor}">{html_text(chapter.section.title)}</a>{below}</li>')
    return "\n".join([*lines, _entry("origin", "Where this comes from"), "</ol></nav>"])


def _entry(anchor: str, title: str) -> str:
    return f'<li><a href="#{anchor}">{html_text(title)}</a></li>'


def _verdict(subject: Subject, verdict: Verdict, numbers: Numbering, files: Mapping[str, bytes]) -> Iterator[str]:
    yield f'<section id="verdict">\n<h1>{escape(subject.name)}</h1>'
    anchors = {chapter.section.title: chapter.anchor for chapter in numbers.chapters}
    if verdict.findings:
        yield f'<ul class="findings">{"".join(_finding(*found, anchors) for found in verdict.findings)}</ul>'
    if numbers.first is not None:
        yield _figure(numbers.first, files)
    yield from (_paragraph(text, numbers) for text in verdict.text)
    yield "</section>"


def _finding(found: Finding, title: str, anchors: Mapping[str, str]) -> str:
    what = html_text(found.what)
    return f'<li><a href="#{anchors[title]}"><strong>{html_text(found.value)}</strong> {what}</a></li>'


def _chapter(chapter: Chapter, numbers: Numbering, files: Mapping[str, bytes]) -> Iterator[str]:
    section = chapter.section
    yield f'<section id="{chapter.anchor}">\n<h2>{html_text(section.title)}</h2>'
    yield from (_paragraph(text, numbers) for text in section.text)
    if section.definitions:
        text = "".join(_paragraph(text, numbers) for text in section.definitions)
        yield f"<details><summary>How it is defined and was tuned</summary>{text}</details>"
    for topic in chapter.topics:
        if topic.title:
            yield f'<h3 id="{topic.anchor}">{html_text(topic.title)}</h3>'
        for each in topic.items:
            yield _table(each, each.item) if isinstance(each.item, Table) else _figure(each, files)
    yield "</section>"


def _paragraph(text: str, numbers: Numbering) -> str:
    def link(each: Numbered) -> str:
        return f'<a href="#{each.anchor}">{each.label}</a>'

    return f"<p>{numbers.resolved(html_text(text), link)}</p>"


def _table(each: Numbered, table: Table) -> str:
    """A table that scrolls below its caption; a long one is folded away."""
    caption = f"{_label(each)} {html_text(table.caption)}"
    body = f'<div class="scroll" tabindex="0">{html_table(table.headers, table.rows)}</div>'
    note = f'<p class="note">{html_text(table.note)}</p>' if table.note else ""
    if len(table.rows) > ROWS_OPEN:
        summary = f"{caption} <small>({len(table.rows)} rows)</small>"
        return f'<details class="table" id="{each.anchor}"><summary>{summary}</summary>{body}{note}</details>'
    return f'<figure class="table" id="{each.anchor}"><figcaption>{caption}</figcaption>{body}{note}</figure>'


def _figure(each: Numbered, files: Mapping[str, bytes]) -> str:
    assert isinstance(each.item, Picture)
    svg = embedded(files[f"figures/{each.item.name}.svg"].decode(), each.item)
    caption = f"<figcaption>{_label(each)} {html_text(each.item.caption)}</figcaption>"
    return f'<figure id="{each.anchor}"><div class="scroll" tabindex="0">{svg}</div>{caption}</figure>'


def _label(each: Numbered) -> str:
    return f'<a class="label" href="#{each.anchor}">{each.label}</a>'


def _foot(subject: Subject, origin: Origin) -> str:
    car = subject.nonlinear or subject.car
    file = ""
    if len(car) <= FILE_SHOWN:
        text = re.sub(r"\n\n+", "\n\n", driveline_file(car))
        file = f"<details><summary>The driveline as a file</summary><pre>{escape(text)}</pre></details>"
    return f'<footer id="origin"><p>{escape(origin.text)}</p>{file}</footer>'
