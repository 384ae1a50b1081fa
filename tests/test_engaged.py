"""sampled/engaged: a control unit stands wherever a controller does, with its own limits, in the gear of each plant."""

import dataclasses

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.studies import prove

CAR = pt.examples.conventional()
# Wide enough for nothing here to reach them.
PLANT = pt.SampledPlant(car=CAR, torque_limits=(-1e6, 1e6))
THIRD = dataclasses.replace(PLANT, car=CAR.replace("gearbox", ratio=2.0))
STATIC = pt.antijerk.one_dof(PLANT, pt.antijerk.speed_difference(PLANT, gain=6.0))
DYNAMIC = pt.antijerk.designs(PLANT)["two degrees of freedom"]
WEAKER = pt.antijerk.one_dof(THIRD, pt.antijerk.speed_difference(THIRD, gain=2.0))
GEARS = {PLANT.ratio: DYNAMIC, THIRD.ratio: WEAKER}
AND_BACK = pt.ramp(0.5, 0.1, 250.0) + pt.ramp(1.5, 0.1, -300.0)
WHOLE = ("torque_command", "engine_torque", "engine_speed", "wheels_speed", "vehicle_acceleration")


def unit(controllers, **values):
    return pt.ControlUnit(controllers=controllers, dt=0.01, **values)


def assert_same(found, expected, signals=WHOLE, rtol=1e-12):
    for name in signals:
        scale = max(float(np.abs(expected[name]).max()), 1.0)
        np.testing.assert_allclose(found[name], expected[name], rtol=0.0, atol=rtol * scale, err_msg=name)


@pytest.mark.parametrize("controller", [STATIC, DYNAMIC])
@pytest.mark.parametrize("demand", [AND_BACK, pt.step(0.0, 250.0)], ids=["ramp", "jump at 0 s"])
def test_a_unit_without_limits_is_its_controller(controller, demand):
    expected = pt.closed_loop(PLANT, controller, demand, 2.5)
    assert_same(pt.closed_loop(PLANT, unit(controller), demand, 2.5), expected, expected.keys())


@pytest.mark.parametrize("plant", [PLANT, THIRD])
def test_the_controller_of_the_gear_acts(plant):
    own = GEARS[plant.ratio]
    assert_same(pt.closed_loop(plant, unit(GEARS), AND_BACK), pt.closed_loop(plant, own, AND_BACK))


def test_a_unit_limits_as_a_plant_with_the_same_limits_and_rate():
    values = {"torque_limits": (-20.0, 220.0), "torque_rate": (1500.0, 2500.0)}
    expected = pt.closed_loop(dataclasses.replace(PLANT, **values), DYNAMIC, AND_BACK)
    assert expected["torque_command"].max() == 220.0
    assert np.ptp(pt.closed_loop(PLANT, DYNAMIC, AND_BACK)["torque_command"]) > 250.0
    for plant in (PLANT, dataclasses.replace(PLANT, **values)):
        assert_same(pt.closed_loop(plant, unit(DYNAMIC, **values), AND_BACK), expected)


def test_limits_over_speed_are_read_at_the_whole_speed():
    """From 200 rad/s on, where a table gives 350 N m, to 100 N m at 240 rad/s."""
    table = {200.0: (-100.0, 350.0), 240.0: (-100.0, 100.0)}
    limited = dataclasses.replace(PLANT, torque_limits=table, speed=200.0)
    expected = pt.closed_loop(limited, STATIC, pt.ramp(0.1, 0.1, 250.0))
    assert expected["torque_command"].max() > 200.0
    assert expected["torque_command"][-1] < 120.0
    plant = dataclasses.replace(PLANT, speed=200.0)
    assert_same(
        pt.closed_loop(plant, unit(STATIC, torque_limits=table), pt.ramp(0.1, 0.1, 250.0)), expected, rtol=1e-11
    )


def test_a_closed_loop_is_a_controlled_run_with_a_closed_clutch():
    """The narrower limits of the plant count too, and the unit is not told of them."""
    plant = dataclasses.replace(PLANT, torque_limits=(-1e6, 180.0))
    whole = unit(GEARS, torque_limits=(-20.0, 220.0), torque_rate=(1500.0, 2500.0))
    expected = pt.controlled_run(plant, whole, AND_BACK, {"clutch_capacity": 1e9})
    assert expected["torque_command"].max() == 180.0
    assert_same(pt.closed_loop(plant, whole, AND_BACK), expected, (*WHOLE[:1], *WHOLE[2:]), rtol=1e-9)


def test_a_unit_is_stepped_on_a_car_with_play_too():
    tight = THIRD.car["drive_shafts"]
    play = pt.Backlash("drive_shafts", tight.a, tight.b, gap=0.03, stiffness=tight.stiffness, damping=tight.damping)
    loose = pt.Driveline(*(play if each.name == tight.name else each for each in THIRD.car))
    plant = dataclasses.replace(THIRD, car=loose)
    expected = pt.let_off(plant, WEAKER)
    assert [event.kind for event in expected.events][:2] == ["open", "contact"]
    assert_same(pt.let_off(plant, unit(GEARS)), expected, rtol=1e-9)


def test_what_the_sensors_do_reaches_a_unit():
    sensors = pt.Sensors(engine_noise=0.5, engine_resolution=0.8, wheels_noise=0.02)
    expected = pt.closed_loop(PLANT, STATIC, AND_BACK, 1.0, sensors=sensors)
    assert_same(pt.closed_loop(PLANT, unit(STATIC), AND_BACK, 1.0, sensors=sensors), expected)


@pytest.mark.parametrize(
    "manoeuvre", [pt.tip_in, pt.tip_out, pt.wheel_disturbance, pt.change_of_mind], ids=lambda each: each.__name__
)
def test_every_manoeuvre_of_a_closed_loop_takes_a_unit(manoeuvre):
    assert_same(manoeuvre(PLANT, unit(GEARS)), manoeuvre(PLANT, DYNAMIC))


def test_a_launch_takes_a_unit():
    car = pt.examples.conventional(damping="open")
    plant = pt.SampledPlant(car=car)
    whole = unit(STATIC, torque_limits=plant.torque_limits)
    found, expected = (pt.controlled_launch(plant, each) for each in (whole, STATIC))
    assert_same(found, expected, ("torque_command", "engine_speed"))


# --- margins and proof


@pytest.mark.parametrize("plant", [PLANT, THIRD])
def test_margins_of_a_unit_are_those_of_the_controller_of_the_gear(plant):
    scheduled = pt.antijerk.scheduled(GEARS, dt=0.01)
    expected = pt.loop_margins(plant, GEARS[plant.ratio])
    for controllers in (GEARS, scheduled):
        found = pt.loop_margins(plant, unit(controllers, torque_limits=(0.0, 1.0)))
        assert (found.disk_margin, found.zeta_first) == (expected.disk_margin, expected.zeta_first)


def test_a_unit_without_controllers_is_the_open_loop():
    assert pt.loop_margins(PLANT, unit(None)).zeta_first == pt.loop_margins(PLANT, None).zeta_first
    assert_same(pt.tip_in(PLANT, unit(None)), pt.tip_in(PLANT))


def test_a_unit_without_limits_is_proven_as_its_controllers_are():
    plants = {"first": PLANT, "third": THIRD}
    found = pt.robustness(PLANT, unit(GEARS), plants)
    expected = pt.robustness(PLANT, pt.antijerk.scheduled(GEARS, dt=0.01), plants)
    for name in plants:
        for quantity in ("oscillation_reduction", "t90_ratio", "disturbance_reduction", "disk_margin"):
            assert found[name].value(quantity) == pytest.approx(expected[name].value(quantity), rel=1e-9)


def test_the_rate_of_a_unit_is_in_its_proof():
    """250 N m at 500 N m/s take 0.5 s instead of 0.1 s."""
    plant = pt.SampledPlant(car=CAR)
    fast, slow = prove(plant, unit(STATIC)), prove(plant, unit(STATIC, torque_rate=500.0))
    assert slow.margins.disk_margin == fast.margins.disk_margin
    assert slow.metrics.t90 > fast.metrics.t90 + 0.2


def test_a_proof_drives_steadily_within_the_limits_of_plant_and_unit():
    """Halfway: between -50 and 350 N m of the plant and -200 and 100 N m of the unit that is 25 N m."""
    plant = dataclasses.replace(PLANT, torque_limits=(-50.0, 350.0))
    response = pt.wheel_disturbance(plant, unit(STATIC, torque_limits=(-200.0, 100.0)))
    np.testing.assert_array_equal(response["torque_demand"], 25.0)
    assert np.abs(response["torque_command"] - 25.0).max() > 1.0
    assert prove(plant, unit(STATIC, torque_limits=(-200.0, 300.0))).disturbance_reduction > 0.5


def test_a_family_drives_each_variant_in_its_own_gear():
    cars = pt.family(CAR, {"gearbox.ratio": [CAR["gearbox"].ratio, 2.0]})
    whole = unit(GEARS, torque_limits=(0.0, 240.0))
    found = cars.closed_loop(PLANT, whole, pt.ramp(0.5, 0.1, 250.0), duration=1.0, outputs="torque_command")
    margins = cars.loop_margins(PLANT, whole)
    for i, plant in enumerate((PLANT, THIRD)):
        alone = pt.closed_loop(plant, whole, pt.ramp(0.5, 0.1, 250.0), duration=1.0)
        np.testing.assert_allclose(found["torque_command"][i], alone["torque_command"], atol=1e-9)
        expected = pt.loop_margins(plant, GEARS[plant.ratio]).disk_margin
        assert margins["disk_margin"][i] == pytest.approx(expected, rel=1e-9)


# --- refused


@pytest.mark.parametrize(
    "take",
    [
        lambda whole: pt.closed_loop(PLANT, whole, AND_BACK),
        lambda whole: pt.loop_margins(PLANT, whole),
        lambda whole: pt.robustness(PLANT, whole, {"nominal": PLANT}),
        lambda whole: pt.family(CAR, {"vehicle.m": [1600.0]}).closed_loop(PLANT, whole, AND_BACK),
    ],
)
def test_a_unit_of_another_sample_time_is_refused(take):
    with pytest.raises(pt.PowertrainError, match=r"the unit has dt = 0\.02 s, the plant 0\.01 s"):
        take(pt.ControlUnit(controllers=None, dt=0.02))


def test_a_torque_before_that_the_unit_does_not_permit_is_refused():
    with pytest.raises(pt.ParameterError, match=r"initial_torque = 250.0 N m, permitted: within \(0.0, 100.0\)"):
        pt.tip_out(PLANT, unit(STATIC, torque_limits=(0.0, 100.0)))


def test_margins_of_a_unit_with_a_controller_that_is_not_linear_are_refused():
    import control

    steep = control.nlsys(
        None, lambda t, x, u, params: u**3, inputs=["torque_demand"], outputs=["torque_command"], dt=0.01
    )
    with pytest.raises(pt.PowertrainError, match="margins are those of a linear controller"):
        pt.loop_margins(PLANT, unit({PLANT.ratio: steep}))


def test_limits_over_speed_of_a_unit_count_at_the_speed_of_the_plant():
    """Half way between both rows, 200 N m, by hand."""
    plant, whole = dataclasses.replace(PLANT, speed=200.0), unit(STATIC, torque_limits={0.0: (0, 300), 400.0: (0, 100)})
    with pytest.raises(pt.ParameterError, match=r"within \(0\.0, 200\.0\)"):
        pt.tip_out(plant, whole)
    assert pt.wheel_disturbance(plant, whole)["torque_demand"][0] == pytest.approx(100.0)
