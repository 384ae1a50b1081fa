"""Twin of `report/drawn`."""

import io

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.image import imread
from PIL import Image

from powertrain_ctrl.report.drawn import DPI, drawn
from powertrain_ctrl.report.subject import Picture, new_figure


def made():
    figure = new_figure(5.0, 3.0)
    ax = figure.subplots()
    ax.semilogy([0.0, 1.0, 2.0], [1.0, 20.0, 300.0], label="gain")
    ax.set_xlabel("time [s]")
    ax.legend()
    return Picture("gain", "A gain", figure)


@pytest.fixture
def picture():
    return made()


def test_a_png_says_its_resolution_and_has_no_transparency(picture):
    image = Image.open(io.BytesIO(drawn(picture)["png"]))
    image.verify()  # the checksums
    assert (image.format, image.mode) == ("PNG", "RGB")
    assert image.info["dpi"] == pytest.approx((DPI, DPI), abs=0.01)


def test_a_picture_has_the_pixels_that_matplotlib_draws_in_its_layout(picture):
    found = imread(io.BytesIO(drawn(picture)["png"]))
    figure = picture.figure
    figure.dpi = DPI
    figure.get_layout_engine().execute(figure)
    figure.set_layout_engine(None)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    assert (np.round(255.0 * found) == np.asarray(canvas.buffer_rgba())[..., :3]).all()


def test_figures_made_alike_have_the_same_bytes():
    assert drawn(made()) == drawn(made())


def test_a_figure_is_left_as_it_was(picture):
    figure = picture.figure
    before = figure.dpi, figure.canvas, figure.get_layout_engine()
    drawn(picture)
    assert (figure.dpi, figure.canvas, figure.get_layout_engine()) == before


def test_texts_of_the_svg_are_texts(picture):
    text = drawn(picture)["svg"].decode()
    assert ">time [s]</text>" in text
    assert ">gain</text>" in text


def test_powers_on_logarithmic_axes_are_plain_texts(picture):
    text = drawn(picture)["svg"].decode()
    assert all(f">10{power}</text>" in text for power in "⁰¹²")
    assert "mathdefault" not in text


def test_labels_have_the_room_that_they_have_with_spines_in_the_layout(picture):
    drawn(picture)
    (ax,) = picture.figure.axes
    found = ax.get_position().bounds
    assert not ax.spines["left"].get_in_layout()
    ax.spines[:].set_in_layout(True)
    picture.figure.dpi = DPI
    picture.figure.get_layout_engine().execute(picture.figure)
    assert ax.get_position().bounds == pytest.approx(found, abs=1e-12)
