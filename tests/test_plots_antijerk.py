"""Figures and report section of anti-jerk control show the numbers of the results, with units.

Of plots/loops, plots/proof.
"""

from types import SimpleNamespace

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from matplotlib.figure import Figure

import powertrain_ctrl as pt
from powertrain_ctrl import plots, studies
from powertrain_ctrl.base.units import to_hz, to_rpm
from powertrain_ctrl.report import antijerk as sections_antijerk


@pytest.fixture(scope="module")
def plant():
    return pt.SampledPlant(car=pt.examples.conventional())


@pytest.fixture(scope="module")
def designs(plant):
    return pt.antijerk.designs(plant)


@pytest.fixture(scope="module")
def few(plant):
    names = ("nominal", "delay 20 ms", "corner m 0.75 k 1.2 delay 20 ms lag 50 ms", "hidden: damping halved, lag 20 ms")
    plants = studies.variations(plant)
    return {name: plants[name] for name in names}


@pytest.fixture(scope="module")
def proven(plant, designs, few):
    return pt.robustness(plant, designs["two degrees of freedom"], few)


@pytest.fixture(scope="module")
def tip_ins(plant, designs):
    return {"open loop": pt.tip_in(plant), "proven": pt.tip_in(plant, designs["two degrees of freedom"])}


@pytest.fixture(scope="module")
def study(plant, designs, few):
    return sections_antijerk._study_of(plant, few, designs, True, pt.antijerk.tune(plant))


def new_axes(count, **layout):
    return Figure().subplots(count, **layout)


def labels(axes):
    return [ax.get_ylabel().replace("\n", " ") for ax in axes]


def line(ax, label):
    return next(each for each in ax.get_lines() if each.get_label() == label)


def test_tip_in_shows_demand_command_acceleration_difference_and_intervention(tip_ins):
    axes = plots.tip_in(tip_ins, new_axes(4, sharex=True))
    assert labels(axes) == [
        "torque [N m]",
        "vehicle acceleration [m/s²]",
        "speed difference [rpm]",
        "intervention [N m]",
    ]
    assert axes[3].get_xlabel() == "time [s]"
    np.testing.assert_array_equal(line(axes[0], "demand").get_ydata(), tip_ins["proven"]["torque_demand"])
    for label, response in tip_ins.items():
        np.testing.assert_array_equal(line(axes[0], f"command, {label}").get_ydata(), response["torque_command"])
        np.testing.assert_array_equal(line(axes[1], label).get_ydata(), response["vehicle_acceleration"])
        np.testing.assert_array_equal(line(axes[2], label).get_ydata(), to_rpm(response["speed_difference"]))
        np.testing.assert_array_equal(line(axes[3], label).get_ydata(), response["intervention"])


def test_loops_differ_in_colour_and_line_style(tip_ins):
    ax = plots.tip_in(tip_ins, new_axes(4))[1]
    first, second = (line(ax, label) for label in tip_ins)
    assert first.get_color() != second.get_color()
    assert first.get_linestyle() != second.get_linestyle()


def test_too_few_axes_are_an_error(tip_ins):
    with pytest.raises(pt.PowertrainError, match="needs 4"):
        plots.tip_in(tip_ins, new_axes(3))


def test_pole_map_shows_the_poles_in_the_upper_half_plane(proven):
    margins = proven["nominal"].margins
    ax = plots.pole_map({"proven": margins}, new_axes(1))
    shown = ax.collections[0].get_offsets()
    expected = to_hz(margins.poles[(margins.poles.imag >= 0.0) & ~margins.folded])
    np.testing.assert_allclose(shown, np.column_stack([expected.real, expected.imag]))
    assert "[Hz]" in ax.get_xlabel()
    assert "[Hz]" in ax.get_ylabel()


def test_pole_map_names_damping_ratios_and_both_modes(proven):
    ax = plots.pole_map({"proven": proven["nominal"].margins}, new_axes(1))
    assert {"0.1", "0.2", "0.35"} <= {text.get_text() for text in ax.texts}
    legend = [text.get_text() for text in ax.get_legend().get_texts()]
    # pairs of `poles`, -1.636 +- 16.498j and -8.032 +- 132.315j rad/s
    for label, omega in (("first mode of the plant, 2.64 Hz", 16.579), ("second mode of the plant, 21.1 Hz", 132.559)):
        assert label in legend
        np.testing.assert_allclose(np.hypot(*line(ax, label).get_data()), omega / (2.0 * np.pi), rtol=1e-4)
    rays = [each for each in ax.get_lines() if len(each.get_xdata()) == 2 and each.get_xdata()[1] < 0.0]
    ends = {f"{-x / np.hypot(x, y):.6g}": (x, y) for x, y in (each.get_xydata()[1] for each in rays)}
    for text in ax.texts:
        x, y = ends[text.get_text().removeprefix("ζ = ")]
        assert text.get_position() == (x, y)


def test_loop_touches_the_disk_of_its_disk_margin_and_stays_outside(proven):
    margins = proven["nominal"].margins
    centre, radius = plots.disk(margins.disk_margin)
    distance = np.abs(margins.loop - centre)
    assert distance.min() == pytest.approx(radius, rel=1e-9)


def test_disk_covers_gains_and_phases_that_the_margin_permits():
    alpha = 0.8
    delta = alpha * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 50))
    change = (1.0 + 0.5 * delta) / (1.0 - 0.5 * delta)
    centre, radius = plots.disk(alpha)
    np.testing.assert_allclose(np.abs(-1.0 / change - centre), radius)


def test_nyquist_shows_the_loop_and_its_disk(proven):
    margins = proven["nominal"].margins
    ax = plots.nyquist({"proven": margins}, new_axes(1))
    drawn = line(ax, f"proven, disk margin {margins.disk_margin:.2f}")
    np.testing.assert_array_equal(drawn.get_xdata() + 1j * drawn.get_ydata(), margins.loop)
    centre, radius = plots.disk(margins.disk_margin)
    assert {(patch.center, patch.radius) for patch in ax.patches} == {((centre, 0.0), radius)}


def test_nyquist_leaves_out_what_has_no_feedback(plant):
    ax = plots.nyquist({"open loop": pt.loop_margins(plant, None)}, new_axes(1))
    assert not ax.patches


def test_spread_shows_every_plant_and_marks_the_worst(proven):
    axes = plots.robust_spread(proven, Figure().subplots(1, 4, sharey=True))
    assert [label.get_text() for label in axes[0].get_yticklabels()] == list(proven.proofs)
    columns = [
        (100.0, "oscillation_reduction", lambda p: p.oscillation_reduction),
        (1.0, "disk_margin", lambda p: p.margins.disk_margin),
        (1.0, "zeta_first", lambda p: p.margins.zeta_first),
        (1.0, "zeta_second", lambda p: p.margins.zeta_second),
    ]
    for ax, (scale, quantity, value) in zip(axes, columns, strict=True):
        dots, diamond = ax.collections
        expected = [scale * value(proof) for proof in proven.proofs.values()]
        np.testing.assert_allclose(dots.get_offsets()[:, 0], expected)
        assert {each.get_xdata()[0] for each in ax.get_lines() if len(each.get_xdata()) == 2} == {expected[0]}
        name, worst = proven.worst(quantity)
        np.testing.assert_allclose(diamond.get_offsets(), [[scale * worst, list(proven.proofs).index(name)]])


def test_spread_names_an_unstable_plant(plant, designs, few):
    result = pt.robustness(plant, designs["P, lead"], few)
    axes = plots.robust_spread(result, Figure().subplots(1, 4))
    names = [label.get_text() for label in axes[0].get_yticklabels()]
    assert names[-1] == "hidden: damping halved, lag 20 ms (unstable)"
    assert len(axes[0].collections[0].get_offsets()) == 3


def test_responses_of_all_plants_are_over_their_final_values(plant, few, designs):
    responses = {name: pt.tip_in(each, designs["two degrees of freedom"]) for name, each in few.items()}
    final = {name: 250.0 * each.final_acceleration for name, each in few.items()}
    worst = list(few)[2]
    ax = plots.robust_responses(responses, new_axes(1), final, worst)
    assert len(ax.get_lines()) == len(few)
    assert [each.get_label() for each in ax.get_lines() if "other" in each.get_label()] == ["2 other plants"]
    expected = responses["nominal"]["vehicle_acceleration"] / final["nominal"]
    np.testing.assert_array_equal(line(ax, "nominal").get_ydata(), expected)
    np.testing.assert_allclose(line(ax, f"worst: {worst}").get_ydata()[-1], 1.0, atol=0.01)
    assert ax.get_ylabel().endswith("[-]")


def test_trade_off_shows_designs_beside_the_slower_pedal(plant, proven):
    metrics = proven["nominal"].metrics
    slower = {length: studies.tip_in_metrics(plant, pt.tip_in(plant, duration=length)) for length in (0.1, 0.2)}
    ax = plots.trade_off({"proven": metrics}, slower, new_axes(1))
    assert line(ax, "1  proven").get_xydata().tolist() == [[1e3 * metrics.t90, 100.0 * metrics.overshoot]]
    np.testing.assert_array_equal(
        line(ax, "slower pedal, open loop").get_ydata(), [100.0 * each.overshoot for each in slower.values()]
    )
    assert "[ms]" in ax.get_xlabel()
    assert "[%" in ax.get_ylabel()
    numbers = {text.get_text(): tuple(text.xy) for text in ax.texts}
    assert numbers["1"] == (1e3 * metrics.t90, 100.0 * metrics.overshoot)
    assert numbers["200 ms"] == (1e3 * slower[0.2].t90, 100.0 * slower[0.2].overshoot)


def test_controlled_launch_shows_torque_speeds_and_acceleration(plant, designs):
    response = pt.controlled_launch(plant, designs["two degrees of freedom"], end=2.8)
    axes = plots.controlled_launch({"proven": response}, plant.ratio, new_axes(3))
    assert labels(axes) == ["torque [N m]", "speed [rpm]", "vehicle acceleration [m/s²]"]
    np.testing.assert_array_equal(line(axes[0], "command, proven").get_ydata(), response["torque_command"])
    np.testing.assert_array_equal(
        line(axes[1], "wheels × 18, proven").get_ydata(), to_rpm(plant.ratio * response["wheels_speed"])
    )
    np.testing.assert_array_equal(line(axes[2], "proven").get_ydata(), response["vehicle_acceleration"])
    lock = [event.time for event in response.events if event.kind == "lock"]
    assert [each.get_xdata()[0] for each in axes[2].get_lines() if len(each.get_xdata()) == 2] == lock


@pytest.fixture(scope="module")
def section(study, plant):
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sections_antijerk, "_study_of_source", lambda car: study)
        patch.setattr(sections_antijerk, "HALF_GAPS", (1.0,))
        return sections_antijerk.antijerk_section(SimpleNamespace(is_source=True, responding=plant.car))


def test_section_has_a_row_for_every_design(section, designs):
    nominal, worst = section.tables[:2]
    assert [row[0] for row in nominal.rows] == ["open loop", *designs]
    assert [row[0] for row in worst.rows] == list(designs)
    for table in section.tables:
        assert {len(row) for row in table.rows} == {len(table.headers)}


def test_section_shows_the_values_of_the_study(section, study, few):
    nominal, worst = ({row[0]: row for row in table.rows} for table in section.tables[:2])
    result = study.proofs["two degrees of freedom"]
    proof = result["nominal"]
    values = [100 * proof.oscillation_reduction, 100 * proof.metrics.overshoot, proof.metrics.peak_jerk]
    values += [proof.metrics.vdv, proof.t90_ratio, proof.margins.zeta_first, proof.margins.zeta_second]
    values += [proof.margins.disk_margin, 100 * proof.disturbance_reduction]
    cells = nominal["two degrees of freedom"][1:]
    for cell, value in zip(cells, values, strict=True):
        digits = len(cell.partition(".")[2])
        assert float(cell) == pytest.approx(value, abs=0.5001 * 10.0**-digits)
    one, corner = "delay 20 ms", "corner m 0.75 k 1.2 delay 20 ms lag 50 ms"
    assert float(worst["two degrees of freedom"][3]) == pytest.approx(
        100 * result[corner].oscillation_reduction, abs=0.051
    )
    singles = [100 * result[name].oscillation_reduction for name in ("nominal", one)]
    assert float(worst["two degrees of freedom"][2]) == pytest.approx(min(singles), abs=0.051)
    assert worst["two degrees of freedom"][2] != worst["two degrees of freedom"][3]
    disturbance = min(100 * each.disturbance_reduction for each in result.proofs.values())
    assert float(worst["two degrees of freedom"][8]) == pytest.approx(disturbance, abs=0.51)


def test_section_figure_goes_to_one_on_every_plant(section, few):
    picture = next(each for each in section.pictures if each.name == "antijerk_responses")
    lines = picture.figure.axes[0].get_lines()
    assert len(lines) == len(few)
    np.testing.assert_allclose([each.get_ydata()[-1] for each in lines], 1.0, atol=0.01)


def test_section_says_who_meets_every_requirement_and_who_is_unstable(section):
    worst = {row[0]: row for row in section.tables[1].rows}
    assert worst["two degrees of freedom"][1] == "yes"
    assert worst["two degrees of freedom"][-1] == "none"
    assert worst["P, lead"][1] == "NO"
    assert "disturbance" in worst["LQG"][-1]
    text = " ".join(section.text)
    assert "The LQG design misses" in text
    assert '"P, lead" is unstable on "hidden' in text
    assert "400 candidates" in text


def test_section_has_a_row_for_every_plant(section, few):
    assert [row[0] for row in section.tables[-2].rows] == list(few)


def test_section_has_every_figure(section):
    kinds = ("tip_in", "poles", "nyquist", "spread", "responses", "trade_off", "launch")
    assert [picture.name for picture in section.pictures] == [f"antijerk_{kind}" for kind in kinds]


def test_section_of_a_driveline_without_wheels_says_why():
    car = pt.Driveline(
        pt.Inertia("engine", J=0.3),
        pt.Inertia("load", J=3.0),
        pt.SpringDamper("shaft", "engine", "load", stiffness=1e4),
    )
    section = sections_antijerk.antijerk_section(SimpleNamespace(is_source=False, responding=car))
    assert section.text[0].startswith("Not shown: ")
    assert not section.tables


def test_section_of_an_undamped_driveline_says_why(plant):
    car = studies.scale_damping(plant.car, 0.0)
    section = sections_antijerk.antijerk_section(SimpleNamespace(is_source=False, responding=car))
    assert section.text == ["Not shown: without damping the driveline itself never settles; give it some."]


def test_section_of_another_car_proves_one_design_on_all_plants(monkeypatch, plant, study):
    monkeypatch.setattr(sections_antijerk, "_study", lambda car, is_full: study)
    monkeypatch.setattr(sections_antijerk, "HALF_GAPS", (1.0,))
    car = studies.scale_mass(plant.car, 1.1)
    section = sections_antijerk.antijerk_section(SimpleNamespace(is_source=False, responding=car))
    assert len(section.tables) == 3
    assert "where to start from" in section.text[-1]


def test_lines_of_damping_ratio_are_where_poles_of_that_ratio_are():
    ax = plots.pole_map({"open loop": pt.loop_margins(pt.SampledPlant(car=pt.examples.conventional()), None)})
    rays = [line.get_xydata()[1] for line in ax.lines if len(line.get_xdata()) == 2 and line.get_xydata()[0, 1] == 0.0]
    rays = [ray for ray in rays if ray[0] < 0.0]
    labels = [float(text.get_text().removeprefix("ζ = ")) for text in ax.texts]
    np.testing.assert_allclose([-x / np.hypot(x, y) for x, y in rays], labels, rtol=1e-12)
