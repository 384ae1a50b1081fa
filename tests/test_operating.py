"""Drivelines at an operating point.

Of driveline/static.
"""

import numpy as np
import pytest

import powertrain_ctrl as pt

SOURCE = pt.examples.conventional()
HALF = np.deg2rad(1.0)
SHAFTS = SOURCE["drive_shafts"]
PLAY = pt.Backlash(
    "drive_shafts", "final_drive_output", "wheels", gap=2.0 * HALF, stiffness=SHAFTS.stiffness, damping=SHAFTS.damping
)
CAR = pt.Driveline(*(PLAY if e.name == "drive_shafts" else e for e in SOURCE))


@pytest.mark.parametrize(
    "point",
    [{"torques": {"engine_torque": 20.0}}, {"torques": {"vehicle_force": 9.0}}, {"twists": {"drive_shafts": -0.02}}],
)
def test_play_in_contact_is_the_shaft(point):
    assert CAR.at(**point) == SOURCE


def test_inside_the_gap_there_is_no_stiffness_to_take():
    for point in ({}, {"twists": {"drive_shafts": 0.5 * HALF}}):
        with pytest.raises(pt.PowertrainError, match="drive_shafts: the operating point lies inside its gap"):
            CAR.at(**point)


def test_linear_models_refuse_a_law_and_say_how():
    for function in (pt.modes, pt.state_space, pt.poles, pt.two_mass, pt.assemble):
        with pytest.raises(pt.PowertrainError, match=r"drive_shafts: is not linear.*car.at\(torques="):
            function(CAR)


def test_the_stage_is_that_of_the_load():
    damper = pt.MultiStageSpring(
        "damper", "a", "b", twists=(-0.06, 0.06, 0.3), torques=(-24.0, 24.0, 504.0), friction=8.0
    )
    car = pt.Driveline(pt.Inertia("a", J=0.2), pt.Inertia("b", J=0.6), damper)
    # b is accelerated by three quarters of the torque
    for torque, stiffness in ((30.0, 400.0), (31.9, 400.0), (32.1, 2000.0), (-500.0, 400.0)):
        linear = car.at(torques={"a_torque": torque})
        assert linear["damper"].stiffness == pytest.approx(stiffness)
        expected = np.sqrt(stiffness * (1 / 0.2 + 1 / 0.6)) / (2.0 * np.pi)
        assert pt.modes(linear).frequency_hz[-1] == pytest.approx(expected)


def test_a_one_way_clutch_holds_where_it_is_driven():
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.OneWayClutch("freewheel", "a", "b"),
        pt.Inertia("b", J=1.0),
        pt.SpringDamper("s", "b", "c", stiffness=10.0),
        pt.Inertia("c", J=1.0),
    )
    driven, overrun = (car.at(torques={"a_torque": torque}) for torque in (1.0, -1.0))
    assert pt.modes(driven).frequency_hz[-1] == pytest.approx(np.sqrt(10.0 * 1.5) / (2.0 * np.pi))
    assert pt.modes(overrun).frequency_hz[-1] == pytest.approx(np.sqrt(10.0 * 2.0) / (2.0 * np.pi))


def test_clutches_stay_as_they_are_and_a_linear_driveline_is_itself():
    assert SOURCE.release("clutch").at() == SOURCE.release("clutch")
    assert "clutch" in CAR.release("clutch").at(twists={"drive_shafts": 0.03}).released


def test_the_small_response_is_that_of_the_simulation_about_the_point():
    # a step of 1 N m on top of 100 N m in contact, against the difference of two exact runs
    t, load = np.linspace(0.0, 0.5, 251), {"engine_torque": 100.0}
    speed = {"engine": 200.0, "wheels": 200.0 / 18.0}
    one, two = (
        pt.simulate(CAR, t, {"engine_torque": torque}, initial_speed=speed, initial_load=load)
        for torque in (100.0, 101.0)
    )
    linear = pt.simulate(CAR.at(torques=load), t, {"engine_torque": 1.0})
    difference = two["drive_shafts_torque"] - one["drive_shafts_torque"]
    np.testing.assert_allclose(difference, linear["drive_shafts_torque"], atol=1e-7)


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ({"torques": {"engine": 1.0}}, 'input "engine" is not'),
        ({"twists": {"tyres": 1.0}}, 'play or stages "tyres" is not'),
        ({"speed": {"moon": 1.0}}, 'node "moon" is not'),
        ({"torques": {"engine_torque": float("nan")}}, "finite"),
        ({"speed": {"engine": 100.0, "wheels": 100.0}}, "contradicts the others"),
        ({"torques": 5.0}, "permitted: a mapping"),
    ],
)
def test_a_wrong_point_is_named(point, message):
    with pytest.raises(pt.PowertrainError, match=message):
        CAR.at(**point)


def test_play_beside_a_spring_is_open_until_the_spring_has_turned_through_its_gap():
    ends = (pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.SpringDamper("s", "a", "b", stiffness=300.0))
    car = pt.Driveline(*ends, pt.Backlash("p", "a", "b", gap=0.2, stiffness=1e3))
    # half of the torque goes on to b: 30 N m are 0.1 rad of the spring
    with pytest.raises(pt.PowertrainError, match="p: the operating point lies inside its gap"):
        car.at(torques={"a_torque": 59.0})
    assert car.at(torques={"a_torque": 61.0})["p"] == pt.SpringDamper("p", "a", "b", stiffness=1e3)
    assert car.at(torques={"b_torque": 61.0})["p"] == pt.SpringDamper("p", "a", "b", stiffness=1e3)
