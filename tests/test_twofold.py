"""Twin of `report/twofold`."""

import io
import re

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from powertrain_ctrl.report.twofold import TwofoldCanvas

NUMBER = re.compile(r"-?\d+\.?\d*(?:e-?\d+)?")
# Names that follow from the numbers of what they name.
NAME = re.compile(r"\b\w*[0-9a-f]{10}\b")


def everything(dpi=200):
    """Artists as in the figures of a report, none of which has its place by the size of a text.

    The height is no whole number of pixels.
    """
    figure = Figure(figsize=(5.0, 4.003), dpi=dpi)
    left, right = figure.subplots(1, 2)
    x = np.linspace(0.0, 10.0, 301)
    left.plot(x, np.sin(x), "--")
    left.plot(x[::30], np.cos(x[::30]), "o", markersize=4)
    left.fill_between(x, np.sin(x) - 0.2, np.sin(x) + 0.2, alpha=0.3)
    left.scatter(x[::20], np.cos(x[::20]), s=x[::20], marker="D")
    left.set_xlim(2.0, 8.0)
    left.set_ylabel("a label\nof two lines")
    left.annotate("here", (4.0, 0.0), xytext=(4, 5), textcoords="offset points")
    left.text(5.0, 0.5, "slanted", rotation=30.0, rotation_mode="anchor", ha="center")
    right.pcolormesh([0.0, 1.0, 2.0], [0.0, 1.0, 2.0], [[1.0, 2.0], [3.0, 4.0]])
    (line,) = right.plot([0.0, 2.0], [0.0, 2.0])
    line.set_clip_path(Circle((1.0, 1.0), 0.5, transform=right.transData))
    right.barh([0.5], [1.5], hatch="/")
    return figure


@pytest.fixture
def plain():
    with matplotlib.rc_context({"svg.hashsalt": "everything", "svg.fonttype": "none"}):
        yield


def twofold(figure):
    renderer = TwofoldCanvas(figure).renderer
    figure.draw(renderer)
    return renderer


def test_pixels_are_those_of_a_renderer_of_pixels_alone(plain):
    alone = FigureCanvasAgg(everything())
    alone.draw()
    assert (twofold(everything()).image() == np.asarray(alone.buffer_rgba())).all()


def numbers(svg, pattern):
    return np.array([float(n) for part in re.findall(pattern, svg) for n in NUMBER.findall(part)])


def test_vectors_are_those_of_a_renderer_of_vectors_alone(plain):
    file = io.BytesIO()
    FigureCanvasSVG(everything()).print_svg(file, metadata={"Date": None, "Creator": None})
    alone, found = (NAME.sub("name", svg.decode()) for svg in (file.getvalue(), twofold(everything()).svg()))
    assert NUMBER.sub("#", found) == NUMBER.sub("#", alone)
    # figures in SVG have six digits; texts stand where they have room by the pixels
    for pattern, tolerance in (
        ('style="[^"]*"', 0.0),
        (' d="[^"]*"', 2e-4),
        ("<rect [^>]*>", 2e-4),
        ("<use [^>]*>", 2e-4),
    ):
        assert numbers(found, pattern) == pytest.approx(numbers(alone, pattern), abs=tolerance), pattern
    assert numbers(found, "<text [^>]*>") == pytest.approx(numbers(alone, "<text [^>]*>"), abs=2.0)


def test_a_text_begins_where_its_anchor_is(plain):
    figure = Figure(figsize=(4.0, 3.0), dpi=150)
    figure.text(0.25, 0.5, "begins", va="baseline")
    text = re.search(r'<text [^>]* x="([^"]*)" y="([^"]*)"[^>]*>begins', twofold(figure).svg().decode())
    # a quarter of 288 pt from the left, half of 216 pt from the top
    assert (float(text[1]), float(text[2])) == pytest.approx((72.0, 108.0), abs=0.5)
