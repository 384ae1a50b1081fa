"""Figures as bytes of SVG and PNG, the same ones for figures made alike: no date, no random identifiers."""

from __future__ import annotations

import io
import zlib

import matplotlib
import numpy as np

from .subject import Picture

# Resolution of the PNG [1/in].
DPI = 200
# Of zlib; the next level takes nearly twice as long for files an eighth smaller.
EFFORT = 3


def drawn(picture: Picture) -> dict[str, bytes]:
    """PNG and SVG of a picture in one layout."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    figure, svg = picture.figure, io.BytesIO()
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
        pixels = FigureCanvasAgg(figure)
        figure.dpi = DPI
        if layout is not None:
            layout.execute(figure)
        figure.set_layout_engine(None)
        pixels.draw()
        image = png(np.asarray(pixels.buffer_rgba())[..., :3])
        FigureCanvasSVG(figure).print_svg(svg, metadata={"Date": None, "Creator": None})
        figure.dpi = dpi
        figure.set_layout_engine(layout)
        figure.set_canvas(canvas)
    return {"png": image, "svg": svg.getvalue()}


def png(pixels: np.ndarray) -> bytes:
    """Opaque pixels, (height, width, 3) of uint8, as PNG.

    Rows are not filtered (ISO/IEC 15948, clause 9), which drawings of lines need not: the files are as large as
    matplotlib's own, in a quarter of the time.
    """
    height, width = pixels.shape[:2]
    # each row begins with the number of its filter, 0 for none
    rows = np.zeros((height, 1 + 3 * width), dtype=np.uint8)
    rows[:, 1:] = pixels.reshape(height, -1)
    per_metre = round(DPI / 0.0254).to_bytes(4, "big")
    header = width.to_bytes(4, "big") + height.to_bytes(4, "big") + bytes([8, 2, 0, 0, 0])  # 8 bits of each colour
    chunks = {
        b"IHDR": header,
        b"pHYs": 2 * per_metre + b"\1",
        b"IDAT": zlib.compress(rows.tobytes(), EFFORT),
        b"IEND": b"",
    }
    return b"\x89PNG\r\n\x1a\n" + b"".join(_chunk(name, data) for name, data in chunks.items())


def _chunk(name: bytes, data: bytes) -> bytes:
    return len(data).to_bytes(4, "big") + name + data + zlib.crc32(name + data).to_bytes(4, "big")
