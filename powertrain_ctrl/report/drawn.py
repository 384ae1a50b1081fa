"""Figures as bytes of SVG and PNG, the same ones for figures made alike: no date, no random identifiers."""

from __future__ import annotations

import io
import re
from typing import TYPE_CHECKING

import matplotlib

from .subject import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Resolution of the PNG [1/in].
DPI = 200
# Of zlib; files are a thirteenth larger than at its default, and quicker written.
EFFORT = 3
# A power of ten as matplotlib's parser wants it.
POWER = re.compile(r"\$\\mathdefault\{10\^\{(-?\d+)\}\}\$")
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def drawn(picture: Picture) -> dict[str, bytes]:
    """PNG and SVG of a picture in one layout."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from PIL import Image

    figure, png, svg = picture.figure, io.BytesIO(), io.BytesIO()
    _write_powers_plainly(figure)
    _leave_spines_out(figure)
    layout, dpi, canvas = figure.get_layout_engine(), figure.dpi, figure.canvas
    with matplotlib.rc_context(
        {
            "svg.hashsalt": picture.name,
            "svg.fonttype": "none",
            "figure.autolayout": False,
            "figure.constrained_layout.use": False,
        }
    ):
        # laid out once, by the renderer of the PNG, which then knows the sizes of all texts
        canvas_of_pixels = FigureCanvasAgg(figure)
        figure.dpi = DPI
        if layout is not None:
            layout.execute(figure)
        figure.set_layout_engine(None)
        canvas_of_pixels.draw()
        pixels, size = canvas_of_pixels.buffer_rgba(), canvas_of_pixels.get_width_height(physical=True)
        image = Image.frombytes("RGB", size, pixels, "raw", "RGBX")
        image.save(png, "png", dpi=(DPI, DPI), compress_level=EFFORT)
        FigureCanvasSVG(figure).print_svg(svg, metadata={"Date": None, "Creator": None})
        figure.dpi = dpi
        figure.set_layout_engine(layout)
        figure.set_canvas(canvas)
    return {"png": png.getvalue(), "svg": svg.getvalue()}


def _write_powers_plainly(figure: Figure) -> None:
    """Ticks of logarithmic axes as plain text, which is much quicker set than what has to be parsed."""
    from matplotlib.ticker import FuncFormatter, LogFormatterMathtext

    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            formatter = axis.get_major_formatter()
            if isinstance(formatter, LogFormatterMathtext):
                axis.set_major_formatter(FuncFormatter(lambda x, place, form=formatter: _plain(form(x, place))))


def _leave_spines_out(figure: Figure) -> None:
    """Spines with labels at them, beyond which these reach, out of the layout, for which they set all ticks again."""
    for ax in figure.axes:
        for axis, side in ((ax.xaxis, "bottom"), (ax.yaxis, "left")):
            if side in ax.spines and axis.get_visible() and axis.get_tick_params().get(f"label{side}"):
                ax.spines[side].set_in_layout(False)


def _plain(text: str) -> str:
    """A power as matplotlib writes it for its parser, without it; other texts as they are."""
    found = POWER.fullmatch(text)
    return f"10{found[1].translate(RAISED)}" if found else text
