"""Figures show the numbers of the results, with units, and leave matplotlib's settings alone.

Of plots/comparisons, plots/identified, plots/launches, plots/responses, plots/shapes, plots/style.
"""

from itertools import pairwise

import control
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from matplotlib.figure import Figure

import powertrain_ctrl as pt
from powertrain_ctrl import plots
from powertrain_ctrl.base.units import to_hz, to_rpm
from powertrain_ctrl.plots.responses import HALF_TURN
from powertrain_ctrl.plots.shapes import branches


@pytest.fixture(scope="module")
def car():
    return pt.examples.conventional()


@pytest.fixture(scope="module")
def responses(car):
    return {"detailed": pt.load_change(car), "control": pt.load_change(pt.two_mass(car, method="source"))}


@pytest.fixture(scope="module")
def frequency_responses(car):
    omega = 2.0 * np.pi * np.geomspace(0.1, 1000.0, 80)
    return {"detailed": pt.frequency_response(car, omega, "engine_torque", "vehicle_acceleration")}


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
    response = pt.frequency_response(car, omega, "engine_torque", "vehicle_acceleration")
    axes = plots.bode({"undamped": response}, new_axes(2))
    assert (np.diff(axes[1].lines[0].get_ydata()) < 1.0).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_half_a_turn_within_the_tolerance_is_a_lag(sign):
    """Whichever way rounding has turned it; what rises by less than half a turn does rise."""
    for missing, falls in ((0.5 * HALF_TURN, True), (2.0 * HALF_TURN, False)):
        jump = sign * (np.pi - missing)
        response = control.FrequencyResponseData(np.exp(1j * np.array([0.0, jump])), [1.0, 2.0])
        shown = plots.bode({"": response}, new_axes(2))[1].lines[0].get_ydata()
        expected = jump - 2.0 * np.pi if falls and sign > 0.0 else jump
        np.testing.assert_allclose(np.diff(shown), [np.degrees(expected)], rtol=1e-9)


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


# --- responses of python-control


def test_signals_of_a_control_response_are_its_inputs_and_outputs(car):
    response = pt.load_change(car)
    read = plots.signals(response.to_control())
    assert plots.signals(response) is response
    np.testing.assert_array_equal(read.time, response.time)
    for name in (*response.inputs, *response.outputs):
        assert name in read
        np.testing.assert_array_equal(read[name], response[name])


def test_signals_of_a_response_with_one_input_and_output(car):
    G = pt.state_space(car, "engine_torque", "vehicle_acceleration")
    read = plots.signals(control.step_response(G, np.linspace(0.0, 1.0, 11)))
    assert read["vehicle_acceleration"].shape == read["engine_torque"].shape == (11,)
    assert "wheels_speed" not in read
    with pytest.raises(pt.UnknownNameError, match="vehicle_acceleration"):
        read["vehicle_accelaration"]


def test_a_response_to_each_of_several_inputs_is_not_one_response(car):
    G = pt.state_space(car, ["engine_torque", "vehicle_force"], ["engine_speed", "wheels_speed"])
    times = np.linspace(0.0, 1.0, 11)
    with pytest.raises(pt.SignalError, match="several runs"):
        plots.signals(control.step_response(G, times))
    read = plots.signals(control.step_response(G, times, input=0))
    assert read["wheels_speed"].shape == (11,)


def test_a_control_response_is_drawn_as_it_is(responses):
    own, theirs = (
        plots.load_change({"detailed": r}, 18.0, new_axes(3))
        for r in (responses["detailed"], responses["detailed"].to_control())
    )
    for a, b in zip(own, theirs, strict=True):
        for line, other in zip(a.lines, b.lines, strict=True):
            np.testing.assert_array_equal(line.get_ydata(), other.get_ydata())


# --- launch


@pytest.fixture(scope="module")
def launches():
    car = pt.examples.conventional(damping="open")
    slipping = pt.two_mass(car.release("clutch"), "source")
    switched = pt.SwitchedTwoMass(closed=pt.two_mass(pt.examples.conventional(), "source"), slipping=slipping)
    return {"detailed": pt.launch(car), "control": pt.launch(switched)}


def curves(ax):
    return [line for line in ax.lines if len(line.get_xdata()) > 2]


def test_launch_shows_the_signals_of_the_response(launches):
    response = launches["detailed"]
    torque, speed, acceleration = plots.launch(response, 18.0, new_axes(3))
    shown = [line.get_ydata() for line in curves(torque)]
    np.testing.assert_array_equal(shown, [response["engine_torque"], response["clutch_capacity"]])
    expected = [response["engine_speed"], response["clutch_secondary_speed"], 18.0 * response["wheels_speed"]]
    np.testing.assert_allclose([line.get_ydata() for line in curves(speed)], to_rpm(np.array(expected)))
    np.testing.assert_array_equal(curves(acceleration)[0].get_ydata(), response["vehicle_acceleration"])
    labels = [ax.get_ylabel() for ax in (torque, speed, acceleration)]
    assert [label[label.index("[") :] for label in labels] == ["[N m]", "[rpm]", "[m/s²]"]


def test_launch_marks_the_lock_on_every_axes(launches):
    lock = launches["detailed"].events[-1].time
    axes = plots.launch(launches["detailed"], 18.0, new_axes(3))
    for ax in axes:
        (mark,) = [line for line in ax.lines if len(line.get_xdata()) == 2]
        assert set(mark.get_xdata()) == {lock}
    assert "clutch closed" in [text.get_text() for text in axes[1].texts]


def test_the_last_lock_is_the_one_that_is_named(launches):
    axes = plots.launch_compared({"detailed": launches["detailed"]}, axes=new_axes(4), locks=[2.0, 2.65])
    named = [text.xy[0] for ax in axes for text in ax.texts if text.get_text() == "clutch closed"]
    assert named == [2.65]


def test_lock_of_a_control_response_is_the_first_stuck_sample(launches):
    axes = plots.launch(launches["detailed"].to_control(), 18.0, new_axes(3))
    (mark,) = [line for line in axes[0].lines if len(line.get_xdata()) == 2]
    assert mark.get_xdata()[0] == pytest.approx(2.651)


def test_launch_that_never_locks_has_no_mark():
    response = pt.launch(pt.examples.conventional(damping="open"), timepts=np.linspace(1.2, 2.0, 81))
    axes = plots.launch(response, axes=new_axes(3))
    assert not [line for ax in axes for line in ax.lines if len(line.get_xdata()) == 2]
    assert not axes[1].texts
    assert len(axes[1].lines) == 2


def test_launch_compared_shows_both_models(launches):
    axes = plots.launch_compared(launches, new_axes(4))
    detailed, simple = launches.values()
    expected = [r[f"{node}_speed"] for r in (detailed, simple) for node in ("engine", "clutch_secondary")]
    np.testing.assert_allclose([line.get_ydata() for line in curves(axes[1])], to_rpm(np.array(expected)))
    np.testing.assert_allclose(curves(axes[2])[1].get_ydata(), to_rpm(simple["wheels_speed"]))
    np.testing.assert_array_equal(curves(axes[3])[1].get_ydata(), simple["vehicle_acceleration"])
    assert len({(line.get_color(), line.get_linestyle()) for line in curves(axes[1])}) == 4
    assert len({line.get_linestyle() for line in curves(axes[3])}) == 2


# --- comparisons


@pytest.fixture(scope="module")
def comparison(car):
    signals = {"inputs": "engine_torque", "outputs": "vehicle_acceleration"}
    models = {method: pt.two_mass(car, method) for method in ("source", "series", "modal", "fit")}
    return pt.compare_models(car, models | {f"balanced {n}": pt.reduced(car, n, **signals) for n in (2, 4)})


def test_model_errors_show_gain_and_error(comparison):
    gain, error = plots.model_errors(comparison, new_axes(2))
    assert [line.get_label() for line in gain.lines] == ["detailed", *comparison.models]
    np.testing.assert_allclose(gain.lines[0].get_ydata(), 20.0 * np.log10(np.abs(comparison.detailed)))
    largest = [line.get_ydata().max() for line in error.lines]
    np.testing.assert_allclose(largest, [e.largest_error for e in comparison.errors.values()])
    np.testing.assert_allclose(gain.lines[0].get_xdata(), to_hz(comparison.omega))
    assert len({(line.get_color(), line.get_linestyle()) for line in gain.lines}) == 7
    assert "[dB]" in gain.get_ylabel()
    assert error.get_xlabel() == "frequency [Hz]"


def test_ramp_responses_are_those_compared(comparison):
    response, error = plots.ramp_responses(comparison, 0.1, new_axes(2))
    assert [line.get_label() for line in response.lines] == ["detailed", *comparison.errors]
    curves = comparison.ramps[0.1]
    for line in response.lines:
        np.testing.assert_array_equal(line.get_ydata(), curves[line.get_label()])
    for line, name in zip(error.lines, comparison.errors, strict=True):
        off = np.abs(curves[name] - curves["detailed"])
        np.testing.assert_array_equal(np.nan_to_num(line.get_ydata()), off)
    assert "[m/s²]" in response.get_ylabel()


def test_a_ramp_that_was_not_compared(comparison):
    with pytest.raises(pt.PowertrainError, match=r"duration = 0.3 s, permitted: 0.05, 0.1, 0.2"):
        plots.ramp_responses(comparison, 0.3, new_axes(2))


def test_hankel_takes_a_comparison_values_or_several(comparison):
    alone = plots.hankel(comparison, new_axes(1))
    several = plots.hankel({"car": comparison, "values": [1.0, 0.1, 0.0]}, new_axes(1))
    np.testing.assert_array_equal(alone.lines[0].get_ydata(), comparison.hankel)
    np.testing.assert_array_equal(alone.lines[0].get_xdata(), 1 + np.arange(len(comparison.hankel)))
    np.testing.assert_array_equal(several.lines[0].get_ydata(), comparison.hankel)
    np.testing.assert_array_equal(several.lines[1].get_ydata(), [1.0, 0.1, np.nan])
    assert alone.get_legend() is None
    assert len(several.get_legend().get_texts()) == 2


def test_error_against_order_joins_models_that_differ_in_a_number(comparison):
    ax = plots.error_against_order(comparison, new_axes(1))
    shown = {line.get_label(): line.get_xydata() for line in ax.lines}
    assert list(shown) == ["source", "series", "modal", "fit", "balanced"]
    expected = [(e.order, e.band_error) for name, e in comparison.errors.items() if name.startswith("balanced")]
    np.testing.assert_allclose(shown["balanced"], expected)
    assert "10 Hz" in ax.get_ylabel()


def test_new_figures_leave_legends_outside_the_data_and_settings_alone(launches, comparison):
    before = dict(matplotlib.rcParams)
    for draw, count in (
        (lambda axes: plots.launch(launches["detailed"], 18.0, axes), 3),
        (lambda axes: plots.launch_compared(launches, axes), 4),
        (lambda axes: plots.model_errors(comparison, axes), 2),
        (lambda axes: plots.ramp_responses(comparison, 0.1, axes), 2),
        (lambda axes: [plots.error_against_order(comparison, axes)], 1),
        (lambda axes: [plots.hankel({"a": comparison, "b": comparison}, axes)], 1),
    ):
        canvas = Figure(figsize=(6.8, 7.2), layout="constrained")
        axes = draw(canvas.subplots(count, sharex=True))
        canvas.draw_without_rendering()
        for ax in axes:
            legend = ax.get_legend()
            if legend:
                assert legend.get_window_extent().y0 >= ax.get_window_extent().y1 - 1.0
                assert legend.get_window_extent().x1 <= canvas.bbox.x1
    assert dict(matplotlib.rcParams) == before


def test_a_wrong_node_is_named_with_its_argument():
    car = pt.Driveline(
        pt.Inertia("motor", J=0.3),
        pt.Clutch("coupling", "motor", "shaft", max_torque=300.0),
        pt.Inertia("shaft", J=0.05),
        pt.Gear("gear", "shaft", "axle", ratio=9.0),
        pt.SpringDamper("half_shafts", "axle", "wheel", stiffness=9e3, damping=50.0),
        pt.Inertia("wheel", J=2.0),
        pt.Tyre("tyre", "wheel", "vehicle", radius=0.3),
        pt.Mass("vehicle", m=900.0),
    )
    response = pt.launch(car, capacity=300.0)
    names = {"clutch": "coupling", "driving": "motor", "input_shaft": "shaft", "wheels": "wheel"}
    for argument in names:
        given = {key: value for key, value in names.items() if key != argument}
        with pytest.raises(pt.SignalError, match=f'{argument}="..."'):
            pt.plots.launch(response, 9.0, new_axes(3), **given)
    assert pt.plots.launch(response, 9.0, new_axes(3), **names)[2].get_xlabel() == "time [s]"
    with pytest.raises(pt.SignalError, match=r'driving="..."'):
        pt.plots.load_change({"car": pt.load_change(car)}, axes=new_axes(3))


def test_a_bode_diagram_takes_a_system_a_response_or_several(car):
    G = pt.state_space(car, "engine_torque", "vehicle_acceleration")
    expected = control.frequency_response(G)
    for given in (G, expected, {"car": G}, {"car": expected}):
        gain, phase = plots.bode(given, new_axes(2))
        np.testing.assert_allclose(gain.lines[0].get_ydata(), 20.0 * np.log10(np.ravel(expected.magnitude)))
        np.testing.assert_allclose(gain.lines[0].get_xdata(), expected.omega / (2.0 * np.pi))
        assert len(phase.lines) == 1


@pytest.mark.parametrize("given", [{"car": 5}, {"car": pt.examples.conventional()}])
def test_a_bode_diagram_of_something_else_says_what_it_wants(given):
    with pytest.raises(pt.PowertrainError, match=r'"car" is a \w+, permitted: pt\.frequency_response'):
        plots.bode(given, new_axes(2))


def test_figures_over_time_take_a_single_response(car):
    response = pt.load_change(car)
    alone, named = (plots.load_change(given, 18.0, new_axes(4)) for given in (response, {"response": response}))
    for a, b in zip(alone, named, strict=True):
        for one, other in zip(a.lines, b.lines, strict=True):
            np.testing.assert_array_equal(one.get_xydata(), other.get_xydata())


def test_the_difference_of_speeds_has_a_panel_of_its_own(car):
    response = pt.load_change(car)
    axes = plots.load_change(response, 18.0, new_axes(4))
    expected = (response["engine_speed"] - 18.0 * response["wheels_speed"]) * 30.0 / np.pi
    np.testing.assert_allclose(axes[2].lines[0].get_ydata(), expected)
    assert len(plots.load_change(response, 18.0)) == 4
    assert len(plots.load_change(response)) == 3


def test_launches_show_differences_of_speeds(launches):
    detailed, simple = launches.values()
    axes = plots.launch(detailed, 18.0, new_axes(4))
    expected = (detailed["clutch_secondary_speed"] - 18.0 * detailed["wheels_speed"]) * 30.0 / np.pi
    np.testing.assert_allclose(axes[2].lines[0].get_ydata(), expected)
    axes = plots.launch_compared(launches, new_axes(5))
    expected = (simple["engine_speed"] - detailed["engine_speed"]) * 30.0 / np.pi
    np.testing.assert_allclose(axes[3].lines[0].get_ydata(), expected, atol=1e-9)


def forked():
    """Two half-shafts of different length behind a differential."""
    return pt.Driveline(
        pt.Inertia("motor", J=0.05),
        pt.Gear("reducer", "motor", "cage", ratio=9.0),
        pt.Inertia("cage", J=0.05),
        pt.SpringDamper("left_shaft", "cage", "left_wheel", stiffness=8e3),
        pt.SpringDamper("right_shaft", "cage", "right_wheel", stiffness=9e3),
        pt.Inertia("left_wheel", J=1.0),
        pt.Inertia("right_wheel", J=1.0),
        pt.SpringDamper("left_tyre", "left_wheel", "road", stiffness=3e4),
        pt.SpringDamper("right_tyre", "right_wheel", "road", stiffness=3e4),
        pt.Inertia("road", J=100.0),
    )


def test_branches_of_a_driveline_lie_over_each_other_and_do_not_cross():
    modes = pt.modes(forked())
    place, branch = branches(["motor", "cage", "left_wheel", "right_wheel", "road"], modes.links)
    assert place["left_wheel"] == place["right_wheel"] == place["cage"] + 1
    assert place["road"] == place["left_wheel"] + 1
    assert sorted(branch.values()) == [0, 0, 0, 0, 1]
    ax = plots.mode_shape(modes, 1, new_axes(1))
    labels = [label.get_text().replace("\n", " ") for label in ax.get_xticklabels()]
    assert labels == ["motor", "cage", "left wheel & right wheel", "road"]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["to right wheel"]


def test_a_chain_is_one_branch_in_the_order_of_its_joints():
    place, branch = branches(["c", "a", "b"], [("a", "b"), ("a", "c")])
    assert place == {"c": 0, "a": 1, "b": 2}
    assert set(branch.values()) == {0}


def test_figures_are_seen_in_a_dark_style(car, comparison):
    with matplotlib.style.context("dark_background"):
        drawn = [
            plots.schematic(car, new_axes(1)),
            plots.load_change(pt.load_change(car), 18.0, new_axes(4))[0],
            plots.model_errors(comparison, new_axes(2))[0],
        ]
    for ax in drawn:
        for line in ax.lines:
            assert max(matplotlib.colors.to_rgb(line.get_color())) > 0.15
        for text in ax.texts:
            behind = text.get_bbox_patch()
            if behind is not None:
                ground = matplotlib.colors.to_rgb(behind.get_facecolor())
                assert abs(np.mean(ground) - np.mean(matplotlib.colors.to_rgb(text.get_color()))) > 0.4


def test_measured_runs_lie_over_the_model_with_their_fit():
    t = np.arange(0.0, 2.0, 0.01)
    run = pt.simulate(pt.examples.conventional(), t, {"engine_torque": np.interp(t, [0.5, 0.6], [0.0, 100.0])})
    heavy = pt.examples.conventional().replace("vehicle", m=2300.0)
    checked = pt.validate(pt.examples.conventional(), run, signals=["engine_speed", "wheels_speed"])
    before = pt.validate(heavy, run, signals=["engine_speed", "wheels_speed"])
    axes = pt.plots.measured(checked, before)
    assert [ax.get_ylabel() for ax in axes] == ["engine torque", "engine speed", "wheels speed"]
    labels = [line.get_label() for line in axes[1].get_lines()]
    assert labels == ["measured", f"before, {before.fit['engine_speed']:.1f} %", "model, fit 100.0 %"]
    np.testing.assert_array_equal(axes[1].get_lines()[0].get_ydata(), run["engine_speed"])
    np.testing.assert_array_equal(axes[1].get_lines()[1].get_ydata(), before.model["engine_speed"])
    with pytest.raises(pt.PowertrainError, match="2 given, this figure needs 3"):
        pt.plots.measured(checked, axes=axes[:2])
    spectra = pt.plots.residual_spectrum(before)
    assert [ax.get_ylabel() for ax in spectra] == ["engine speed\nper root Hz", "wheels speed\nper root Hz"]
    _, density = before.spectrum("engine_speed")
    np.testing.assert_array_equal(spectra[0].get_lines()[0].get_ydata(), np.sqrt(density[1:]))
