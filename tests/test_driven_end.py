"""report/driven_end, report/required: what the report says of control where nothing is a car: a turbine, a ship."""

import dataclasses
import re

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.report.antijerk import antijerk_section
from powertrain_ctrl.report.driven_end import REQUIRED
from powertrain_ctrl.report.required import listed, what_is_met, why_none
from powertrain_ctrl.report.subject import subject_of
from powertrain_ctrl.report.verdict import verdict_of

FILES = {"turbine": "wind_turbine", "ship": "marine"}


def section_of(name):
    plant = pt.load_plant(pt.examples.path(FILES[name]))
    return plant, antijerk_section(subject_of(plant.car, name, plant))


@pytest.fixture(scope="module")
def turbine():
    return section_of("turbine")


def column(table, name):
    return [row[table.headers.index(name)] for row in table.rows]


def test_the_verdict_comes_first_with_stability_margin_and_damping_at_the_rotor(turbine):
    """Against the margins of the controller, and the ringing of the rotor after a push, each computed here."""
    plant, section = turbine
    tuned = pt.antijerk.tune(plant, requirements={**REQUIRED, "zeta_first": 0.075})
    alone, margins = pt.loop_margins(plant, None), pt.loop_margins(plant, tuned.controller)
    ringing = []
    for controller in (None, tuned.controller):
        pushed = pt.wheel_disturbance(plant, controller, duration=4.0)
        after = pushed.time > 0.65 - 1e-9
        ringing.append(np.sqrt(np.mean(pushed["vehicle_acceleration"][after] ** 2)))
    text = section.text[0]
    assert text.startswith("A controller of the torque at the generator, tuned for this driveline, is stable on all 29")
    assert f"disk margin is {margins.disk_margin:.2f}" in text
    assert (
        f"the rotor, the first mode is damped by ζ = {margins.zeta_first:.3f} instead of {alone.zeta_first:.3f}" in text
    )
    assert f"of a push there {100 * (1 - ringing[1] / ringing[0]):.0f} % less is left" in text
    assert "It meets every requirement" in text
    # damped half as much again at least, NREL's 5 % alone
    assert alone.zeta_first == pytest.approx(0.05, abs=2e-4)
    assert margins.zeta_first > 1.5 * alone.zeta_first


def test_tables_show_what_is_required_and_every_plant(turbine):
    required, proven = turbine[1].tables
    assert set(column(required, "met")) == {"yes"}
    assert {"stability", "disk margin", "zeta first", "disturbance reduction"} <= set(column(required, "quantity"))
    assert len(proven.rows) == 29
    assert set(column(proven, "stable")) == {"yes"}
    worst = min(float(value) for value in column(proven, "zeta first"))
    assert f"at worst by {worst:.3f}" in turbine[1].text[0]


def test_figures_call_the_driven_end_by_its_name_and_unit(turbine):
    section = turbine[1]
    assert [picture.name for picture in section.pictures] == [
        "antijerk_push",
        "antijerk_poles",
        "antijerk_nyquist",
        "antijerk_spread",
    ]
    for picture in (section.pictures[0], section.highlight):
        labels = [ax.get_ylabel().replace("\n", " ") for ax in picture.figure.axes]
        assert "rotor acceleration [rad/s²]" in labels
        assert not any("vehicle" in label for label in labels)


def test_the_damping_is_in_the_verdict_of_the_page(turbine):
    plant, section = turbine
    verdict = verdict_of(subject_of(plant.car, "turbine", plant), {"Anti-jerk control": section})
    values = [finding.value for finding, _ in verdict.findings]
    assert "29 of 29" in values
    assert any(re.fullmatch(r"0\.050 → 0\.\d{3}", value) for value in values)
    assert verdict.picture is section.highlight


@pytest.mark.campaign
def test_the_ship_is_damped_at_its_propeller():
    _, section = section_of("ship")
    assert "is stable on all 29 plants" in section.text[0]
    assert "the propeller, the first mode is damped" in section.text[0]
    assert "It meets every requirement" in section.text[0]


@pytest.mark.parametrize("make", [pt.examples.wind_turbine, pt.examples.marine])
def test_without_a_table_of_what_drives_it_one_sentence_says_so(make):
    section = antijerk_section(subject_of(make(), "driveline"))
    (text,) = section.text
    assert text.startswith("Not shown: the driveline is no car; a table [plant] in its file says what drives it")
    assert text.count(".") == 1
    assert [*section.tables, *section.pictures, *section.findings] == []


def test_an_actuator_that_comes_too_late_is_named():
    """Of the ship's shafts those at 21 and 42 Hz have next to no damping, and torque comes 45 ms late."""
    plant = dataclasses.replace(pt.load_plant(pt.examples.path("marine")), lag=0.03, delay=0.01, dt=0.01)
    (text,) = antijerk_section(subject_of(plant.car, "ship", plant)).text
    assert "stable on all plants with a lag of 30 ms and a delay of 10 ms" in text


def test_a_driveline_that_never_settles_has_no_controller():
    discs = pt.Driveline(
        pt.Inertia("a", J=1.0), pt.SpringDamper("shaft", "a", "b", stiffness=1e3), pt.Inertia("b", J=2.0)
    )
    (text,) = antijerk_section(subject_of(discs, "discs", pt.SampledPlant(car=discs))).text
    assert text.startswith("Not shown: without damping")


def test_what_is_missed_is_told_with_what_is_required(turbine):
    plant = turbine[0]
    tuned = pt.antijerk.tune(plant, requirements={**REQUIRED, "zeta_first": 0.075})
    missed = dataclasses.replace(tuned, requirements={"disk_margin": 1.9}, unmet={"disk_margin": 1.39}, best={})
    assert what_is_met(missed).startswith("It misses disk margin (required ≥ 1.9, reached 1.39). Among ")


def test_where_it_is_unstable_is_told(turbine):
    plant = turbine[0]
    tuned = pt.antijerk.tune(plant, requirements={**REQUIRED, "zeta_first": 0.075})
    proofs = dict(tuned.proof.proofs)
    for name in ("nominal", "mass -25 %"):
        proofs[name] = dataclasses.replace(
            proofs[name], margins=dataclasses.replace(proofs[name].margins, stable=False)
        )
    text = why_none(dataclasses.replace(tuned, proof=dataclasses.replace(tuned.proof, proofs=proofs)))
    assert 'unstable on "nominal" and "mass -25 %".' in text


def test_names_in_a_row():
    assert [listed(names) for names in ([], ["a"], ["a", "b", "c"])] == ["none", "a", "a, b and c"]
