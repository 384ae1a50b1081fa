"""Figures in a web page: text that can be read and searched, colours that follow light and dark."""

from __future__ import annotations

import re
from html import escape

from ..base.tables import plain_text
from .subject import COLUMN, Picture

# Colours of the figures by their name in the style sheet, which has a brighter one for the dark.
NAMED = {
    "#0072b2": "blue",
    "#e69f00": "orange",
    "#d55e00": "red",
    "#009e73": "green",
    "#cc79a7": "pink",
    "#56b4e9": "sky",
}
# The page and its text in the dark, by red, green and blue.
PAGE, INK = (0x14, 0x17, 0x1A), (0xE8, 0xEA, 0xED)
# Wider drawings than the column, in points, keep their size on a phone, where they scroll.
WIDE = 72.0 * COLUMN + 1.0
GREY = re.compile(r"#([0-9a-f]{2})\1\1\b")


def embedded(svg: str, picture: Picture) -> str:
    """The ``<svg>`` element alone: its identifiers made unique by the picture's name, its colours those of the page."""
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>|<!--.*?-->", "", svg, flags=re.DOTALL)
    svg = re.sub(r' xmlns(:xlink)?="[^"]*"', "", svg).replace("xlink:href=", "href=")
    svg = re.sub(r'\bid="', f'id="{picture.name}-', svg)
    svg = re.sub(r'href="#', f'href="#{picture.name}-', svg)
    svg = svg.replace("url(#", f"url(#{picture.name}-")
    svg = re.sub(r"'DejaVu Sans'[^\";]*", "var(--drawn)", svg)
    svg = GREY.sub(r"var(--grey-\1)", svg)
    for colour, name in NAMED.items():
        svg = svg.replace(colour, f"var(--{name})")
    width = float(re.search(r'width="([\d.]+)pt"', svg)[1])  # type: ignore[index]
    label = escape(plain_text(picture.caption))
    wide = ' class="wide"' if width > WIDE else ""
    head = f'<svg{wide} role="img" aria-label="{label}" style="--width: {width:.0f}pt"'
    return svg.replace("<svg", head, 1).strip()


def shades(content: str) -> str:
    """Style of the greys that the figures of a page have, in the light and in the dark."""
    found = sorted(set(re.findall(r"var\(--grey-([0-9a-f]{2})\)", content)))
    light = " ".join(f"--grey-{level}: #{3 * level};" for level in found)
    dark = " ".join(f"--grey-{level}: {_in_the_dark(int(level, 16) / 255.0)};" for level in found)
    return f":root {{ {light} }}\n@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n"


def _in_the_dark(lightness: float) -> str:
    mixed = (ink + lightness * (page - ink) for page, ink in zip(PAGE, INK, strict=True))
    return "#" + "".join(f"{round(level):02x}" for level in mixed)
