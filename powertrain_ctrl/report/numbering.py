"""Tables and figures in the order in which a reader meets them, with numbers and anchors."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from .subject import Picture, Section, Table
from .verdict import Verdict

REFERENCE = re.compile(r"@([a-z]\w*)")


@dataclass(frozen=True)
class Numbered:
    """A table or a picture with what it is called and where it is found."""

    label: str
    anchor: str
    item: Table | Picture


@dataclass(frozen=True)
class Topic:
    """What a section shows under one heading, or under none."""

    title: str
    anchor: str
    items: Sequence[Numbered]


@dataclass(frozen=True)
class Chapter:
    """A section with its topics."""

    section: Section
    anchor: str
    topics: Sequence[Topic]


@dataclass(frozen=True)
class Numbering:
    """The verdict's figure, the chapters, and label and anchor of each picture and named table by name."""

    first: Numbered | None
    chapters: Sequence[Chapter]
    names: Mapping[str, Numbered]

    def resolved(self, text: str, link: Callable[[Numbered], str]) -> str:
        """Text in which ``@name`` stands for a figure or a table; what is not there is left out."""
        return REFERENCE.sub(lambda found: link(self.names[found[1]]) if found[1] in self.names else found[0], text)


def numbered(verdict: Verdict, sections: Sequence[Section]) -> Numbering:
    counts = {"Table": 0, "Figure": 0}
    names: dict[str, Numbered] = {}

    def give(item: Table | Picture) -> Numbered:
        kind = "Figure" if isinstance(item, Picture) else "Table"
        counts[kind] += 1
        anchor = f"figure-{item.name}" if isinstance(item, Picture) else f"table-{counts[kind]}"
        made = Numbered(f"{kind} {counts[kind]}", anchor, item)
        if item.name:
            names[item.name] = made
        return made

    first = None if verdict.picture is None else give(verdict.picture)
    chapters = []
    for section in sections:
        anchor = slug(section.title)
        items: list[Table | Picture] = [*section.tables, *section.pictures]
        topics = [
            Topic(title, f"{anchor}-{slug(title)}", [give(item) for item in items if item.topic == title])
            for title in dict.fromkeys(item.topic for item in items)
        ]
        chapters.append(Chapter(section, anchor, topics))
    return Numbering(first, chapters, names)


def slug(title: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")
