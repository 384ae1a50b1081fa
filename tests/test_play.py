"""The report's section on play: what is not linear is named, and its tip-in beside the linear one."""

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.report.play import AFTER, BEFORE, LENGTH, START, TIMES, play_section
from powertrain_ctrl.report.subject import Subject, subject_of

CAR = pt.Driveline(
    pt.Inertia("engine", J=0.27),
    pt.Gear("gearbox", "engine", "axle", ratio=12.0),
    pt.Backlash("mesh", "axle", "hub", gap=0.04, stiffness=4e4, damping=20.0),
    pt.Inertia("hub", J=0.5),
    pt.SpringDamper("halfshafts", "hub", "wheels", stiffness=12e3, damping=60.0),
    pt.Inertia("wheels", J=3.0),
    pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=8e5, damping=4e3),
    pt.Mass("vehicle", m=1400.0),
)


@pytest.fixture(scope="module")
def section():
    return play_section(subject_of(CAR, "car"))


def test_a_linear_driveline_has_no_such_section():
    assert play_section(Subject(pt.examples.conventional(), "car")) is None


def test_what_is_not_linear_is_named_and_drawn(section):
    assert section.title == "Play and stages"
    assert section.text[0].startswith("Not linear: mesh.")
    assert [picture.name for picture in section.pictures] == ["characteristics", "play_tip_in"]


def test_the_largest_torque_is_that_of_a_simulation_from_the_loaded_side(section):
    peaks, events = section.tables
    engine, ratio = 200.0, 12.0
    speed = {"engine": engine, "axle": engine / ratio, "hub": engine / ratio, "wheels": engine / ratio}
    speed["vehicle"] = 0.3 * engine / ratio
    torque = pt.ramp(START, LENGTH, AFTER, BEFORE)
    response = pt.simulate(CAR, TIMES, {"engine_torque": torque}, speed, initial_load={"engine_torque": BEFORE})
    ((element, largest, linear, heat),) = peaks.rows
    assert element == "mesh"
    assert float(largest) == pytest.approx(np.abs(response["mesh_torque"]).max(), abs=0.051)
    assert float(largest) > float(linear)  # the play lets the sides meet with a speed
    assert float(heat) == pytest.approx(response.slip_energy["mesh"], abs=0.0051)
    assert events.caption == f"Tip-in, {len(response.events)} events"


@pytest.mark.parametrize(("damping", "verdict"), [(60.0, "it still swings."), (900.0, "no limit cycle.")])
def test_it_says_whether_the_driveline_has_come_to_rest(damping, verdict):
    section = play_section(subject_of(CAR.replace("halfshafts", damping=damping), "car"))
    assert section.text[-1].endswith(verdict)
