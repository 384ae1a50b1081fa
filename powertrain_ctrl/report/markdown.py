"""A report as Markdown, which shows the figures that lie beside it."""

from __future__ import annotations

from html import escape

from ..base.tables import markdown_table, markdown_text
from .numbering import Numbered, Numbering
from .origin import Origin
from .subject import Subject, Table
from .verdict import Verdict


def markdown(subject: Subject, verdict: Verdict, numbers: Numbering, origin: Origin) -> str:
    def plain(text: str) -> str:
        return numbers.resolved(_safe(text), lambda found: found.label)

    blocks = [f"# {markdown_text(subject.name)}"]
    findings = [f"- **{_safe(found.value)}** {plain(found.what)}" for found, _ in verdict.findings]
    blocks += ["\n".join(findings)] if findings else []
    blocks += [plain(text) for text in verdict.text]
    blocks += _item(numbers.first) if numbers.first else []
    for chapter in numbers.chapters:
        blocks.append(f"## {_safe(chapter.section.title)}")
        blocks += [plain(text) for text in (*chapter.section.text, *chapter.section.definitions)]
        for topic in chapter.topics:
            blocks += [f"### {_safe(topic.title)}"] if topic.title else []
            blocks += [block for each in topic.items for block in _item(each)]
    blocks.append(_safe(origin.text))
    return "\n\n".join(blocks) + "\n"


def _item(each: Numbered) -> list[str]:
    caption = f"{each.label}. {_safe(each.item.caption)}"
    if isinstance(each.item, Table):
        note = [_safe(each.item.note)] if each.item.note else []
        headers = [_safe(head) for head in each.item.headers]
        rows = [[_safe(cell) for cell in row] for row in each.item.rows]
        return [f"**{caption}**", markdown_table(headers, rows), *note]
    return [f"![{caption}](figures/{each.item.name}.png)", f"*{caption}*"]


def _safe(text: str) -> str:
    """Text in which nothing becomes a tag or the end of a cell."""
    return escape(text, quote=False).replace("|", "\\|")
