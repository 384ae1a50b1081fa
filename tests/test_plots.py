"""Figures show the numbers of the results, with units, and leave matplotlib's settings alone."""

from itertools import pairwise

import control
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from matplotlib.figure import Figure

import powertrain_ctrl as pt
from powertrain_ctrl import plots
from powertrain_ctrl.units import to_hz, to_rpm


@pytest.fixture(scope="module")
def car():
    return pt.examples.conventional()


@pytest.fixture(scope="module")
def responses(car):
    return {"detailed": pt.load_change(car), "control": pt.load_change(pt.two_mass(car, method="source"))}


@pytest.fixture(scope="module")
def frequency_responses(car):
    omega = 2.0 * np.pi * np.geomspace(0.1, 1000.0, 80)
    return {"detailed": control.frequency_response(pt.state_space(car, "engine_torque", "vehicle_acceleration"), omega)}


def new_axes(count):
    return Figure().subplots(count)


def longest_line(ax):
    return max(ax.get_lines(), key=lambda line: len(line.get_xdata()))


def test_mode_shape_is_the_reflected_shape_of_the_nodes_with_inertia(car):
    modes = pt.modes(car)
    ax = plots.mode_shape(modes, 1, new_axes(1))
    heavy = [modes.nodes.index(e.name) for e in car if isinstance(e, pt.Inertia | pt.Mass)]
    np.testing.assert_array_equal(longest_line(ax).get_ydata(), modes.reflected_shapes[heavy, 1])
    labels = [label.get_text().replace("\n", "_") for label in ax.get_xticklabels()]
    assert labels == [modes.nodes[i] for i in heavy]


def test_mode_shape_names_frequency_and_unit(car):
    ax = plots.mode_shape(pt.modes(car), 1, new_axes(1))
    assert "2.638 Hz" in ax.get_title()
    assert "[-]" in ax.get_ylabel()


@pytest.mark.parametrize("mode", [-1, 7])
def test_mode_shape_of_a_mode_that_is_not_there(car, mode):
    with pytest.raises(pt.PowertrainError, match="permitted: 0 to 6"):
        plots.mode_shape(pt.modes(car), mode, new_axes(1))


def test_mode_shape_of_many_nodes_has_no_label_each():
    elements = [pt.Inertia(f"n{i}", J=1.0) for i in range(60)]
    elements += [pt.SpringDamper(f"s{i}", f"n{i}", f"n{i + 1}", stiffness=1e3) for i in range(59)]
    ax = plots.mode_shape(pt.modes(pt.Driveline(*elements)), 1, new_axes(1))
    assert len(ax.get_xticks()) < 20


def test_mode_energies_are_those_of_the_elastic_modes(car):
    modes = pt.modes(car)
    ax = plots.mode_energies(modes, new_axes(1))
    np.testing.assert_allclose(ax.collections[0].get_array().reshape(6, 6), 100.0 * modes.strain_energy[:, 1:])
    assert "[Hz]" in ax.get_xlabel()


def test_mode_energies_without_an_elastic_mode():
    with pytest.raises(pt.PowertrainError, match="no mode"):
        plots.mode_energies(pt.modes(pt.Driveline(pt.Inertia("engine", J=1.0))), new_axes(1))


def test_mode_energies_of_a_single_spring():
    car = pt.Driveline(pt.Inertia("engine", J=1.0), pt.Drag("mount", "engine", damping=0.0, stiffness=100.0))
    ax = plots.mode_energies(pt.modes(car), new_axes(1))
    assert [text.get_text() for text in ax.texts] == ["100"]


def test_phase_of_an_undamped_resonance_falls():
    car = pt.examples.conventional(damping=None)
    omega = 2.0 * np.pi * np.geomspace(0.1, 1000.0, 500)
    response = control.frequency_response(pt.state_space(car, "engine_torque", "vehicle_acceleration"), omega)
    axes = plots.bode({"undamped": response}, new_axes(2))
    assert (np.diff(axes[1].lines[0].get_ydata()) < 1.0).all()


def test_load_change_shows_the_signals_of_the_response(responses):
    axes = plots.load_change(responses, ratio=18.0, axes=new_axes(3))
    detailed, reduced = responses.values()
    np.testing.assert_array_equal(axes[0].lines[0].get_ydata(), detailed["engine_torque"])
    shown = [line.get_ydata() for line in axes[1].lines]
    expected = [s for r in (detailed, reduced) for s in (r["engine_speed"], 18.0 * r["wheels_speed"])]
    np.testing.assert_allclose(shown, to_rpm(np.array(expected)))
    np.testing.assert_array_equal(axes[2].lines[1].get_ydata(), reduced["vehicle_acceleration"])
    np.testing.assert_array_equal(axes[2].lines[0].get_xdata(), detailed.time)


def test_load_change_axes_carry_units(responses):
    axes = plots.load_change(responses, ratio=18.0, axes=new_axes(3))
    assert [label[label.index("[") :] for label in (ax.get_ylabel() for ax in axes)] == ["[N m]", "[rpm]", "[m/s²]"]
    assert axes[2].get_xlabel() == "time [s]"


def test_load_change_lines_differ_in_black_and_white(responses):
    axes = plots.load_change(responses, ratio=18.0, axes=new_axes(3))
    looks = {(line.get_color(), line.get_linestyle()) for line in axes[1].lines}
    assert len(looks) == 4
    assert len({line.get_linestyle() for line in axes[2].lines}) == 2


def test_load_change_without_wheels(responses):
    axes = plots.load_change({"detailed": responses["detailed"]}, axes=new_axes(3))
    assert len(axes[1].lines) == 1


def test_bode_is_in_decibel_degrees_and_hertz(frequency_responses):
    axes = plots.bode(frequency_responses, axes=new_axes(2), unit="(m/s²)/(N m)")
    response = frequency_responses["detailed"]
    x, gain = axes[0].lines[0].get_data()
    np.testing.assert_allclose(x, to_hz(response.omega))
    np.testing.assert_allclose(gain, 20.0 * np.log10(response.magnitude))
    shown = np.radians(axes[1].lines[0].get_ydata())
    np.testing.assert_allclose(np.exp(1j * shown), np.exp(1j * response.phase), atol=1e-12)
    assert np.abs(np.diff(shown)).max() < np.pi
    assert "[dB]" in axes[0].get_ylabel()
    assert "[deg]" in axes[1].get_ylabel()
    assert axes[1].get_xlabel() == "frequency [Hz]"
    assert axes[1].get_xscale() == "log"


def test_wrong_number_of_axes(responses):
    with pytest.raises(pt.PowertrainError, match="2 given, this figure needs 3"):
        plots.load_change(responses, axes=new_axes(2))


def test_settings_of_matplotlib_stay_as_they_are(car, responses, frequency_responses):
    before = dict(matplotlib.rcParams)
    plots.mode_shape(pt.modes(car), 1, new_axes(1))
    plots.mode_energies(pt.modes(car), new_axes(1))
    plots.load_change(responses, 18.0, new_axes(3))
    plots.bode(frequency_responses, new_axes(2))
    assert dict(matplotlib.rcParams) == before


@pytest.mark.parametrize("figure", ["mode_shape", "load_change", "bode"])
def test_legends_and_labels_do_not_overlap(figure, car, responses, frequency_responses):
    canvas = Figure(figsize=(7.2, 6.0), layout="constrained")
    if figure == "mode_shape":
        axes = [plots.mode_shape(pt.modes(car), 1, canvas.subplots())]
    elif figure == "load_change":
        axes = plots.load_change(responses, 18.0, canvas.subplots(3, sharex=True))
    else:
        axes = plots.bode(frequency_responses | {"again": frequency_responses["detailed"]}, canvas.subplots(2))
    canvas.draw_without_rendering()
    for ax in axes:
        for labels in (ax.get_xticklabels(), ax.get_yticklabels()):
            boxes = [label.get_window_extent() for label in labels if label.get_text() and label.get_visible()]
            inside = [box for box in boxes if canvas.bbox.contains(*box.min) and canvas.bbox.contains(*box.max)]
            assert not any(a.overlaps(b) for a, b in pairwise(inside))
        if ax.get_legend():
            assert ax.get_legend().get_window_extent().y0 >= ax.get_window_extent().y1 - 1.0
