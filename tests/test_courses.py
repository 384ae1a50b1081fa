"""Change of mind, let-off and braking: by superposition and by momentum, and what a controller makes of them."""

import dataclasses

import numpy as np
import pytest

import powertrain_ctrl as pt

CAR = pt.examples.conventional()
PLANT = pt.SampledPlant(car=CAR, torque_limits=(-500.0, 500.0))
FEEDBACK = pt.antijerk.one_dof(PLANT, pt.antijerk.speed_difference(PLANT, gain=6.0))
ELECTRIC = pt.SampledPlant(car=pt.examples.electric(), lag=0.005, delay=0.002, dt=0.005, torque_limits=(-300.0, 300.0))
GAIN = 2.0


def shifted(values, time, by):
    """The same response later."""
    count = round(by / (time[1] - time[0]))
    return np.concatenate([np.zeros(count), values[: len(values) - count]])


@pytest.mark.parametrize("controller", [None, FEEDBACK])
def test_a_change_of_mind_is_three_tip_ins_over_each_other(controller):
    """The loop is linear within its limits: once there, once off 0.4 s later, once more there after 0.8 s."""
    response, single = pt.change_of_mind(PLANT, controller), pt.tip_in(PLANT, controller)
    for name in ("torque_demand", "torque_command", "vehicle_acceleration", "speed_difference"):
        one = single[name]
        expected = one - shifted(one, single.time, 0.4) + shifted(one, single.time, 0.8)
        np.testing.assert_allclose(response[name], expected, rtol=0.0, atol=1e-9 * np.abs(one).max())


def test_a_controller_takes_most_of_the_swing_behind_a_change_of_mind():
    swings = []
    for controller in (None, FEEDBACK):
        response = pt.change_of_mind(PLANT, controller)
        swings.append(np.ptp(response["vehicle_acceleration"][response.time > 2.0]))
    assert swings[1] < 0.2 * swings[0]


def test_a_let_off_is_a_tip_out_of_both_torques_together():
    response, out = pt.let_off(PLANT, FEEDBACK), pt.tip_out(PLANT, FEEDBACK, torque=130.0, duration=0.3)
    assert response["torque_demand"][[0, -1]] == pytest.approx([100.0, -30.0], abs=1e-12)
    for name in ("vehicle_acceleration", "speed_difference"):
        np.testing.assert_allclose(response[name], out[name], rtol=0.0, atol=1e-8 * np.abs(out[name]).max())


def test_a_let_off_takes_play_from_one_side_to_the_other():
    shafts = pt.Backlash("drive_shafts", "differential", "wheels", gap=0.03, stiffness=12000.0, damping=60.0)
    loose = pt.Driveline(*(shafts if each.name == "drive_shafts" else each for each in CAR))
    response = pt.let_off(dataclasses.replace(PLANT, car=loose))
    twist = response["drive_shafts_twist"]
    # half the gap is 0.015 rad
    assert twist[0] > 0.015
    assert twist[-1] < -0.015
    kinds = [(event.kind, event.mode) for event in response.events]
    assert kinds[0] == ("open", "gap")
    assert kinds[-1] == ("contact", "left")


def impulse(brake, frequency):
    """Of the brake over time [N m s], piece by piece: up, full, down; and what each pulse takes away."""
    pulses = 0 if frequency is None else int(np.floor((1.0 - 0.05 - 0.05 - 1e-12) * frequency))
    # a quarter cycle down, one low, one up: on average so much below
    return brake * (0.95 - pulses * (0.7 * 0.5 * 0.25 + 0.7 * 0.25 + 0.7 * 0.5 * 0.25) / (frequency or 1.0))


@pytest.mark.parametrize("frequency", [None, 4.0, 8.0])
@pytest.mark.parametrize("plant", [PLANT, ELECTRIC, pt.SampledPlant(car=pt.examples.all_wheel_drive())], ids="CEA")
def test_the_brake_takes_the_momentum_that_its_torque_over_time_is(plant, frequency):
    response = pt.braking(plant, brake=900.0, abs_frequency=frequency)
    engine = response[f"{plant.engine}_speed"]
    change = -impulse(900.0, frequency) / (plant.ratio * plant.inertia)
    late = response.time > 3.0
    assert engine[late].mean() - engine[0] == pytest.approx(change, rel=2e-3)
    brake = sum(response[f"{wheel}_torque"] for wheel in plant.wheels)
    assert brake.min() == pytest.approx(-900.0, rel=1e-12)
    assert brake[response.time < 0.5].max() == 0.0


@pytest.mark.parametrize("frequency", [None, 8.0])
def test_a_controller_keeps_the_machine_with_braked_wheels(frequency):
    controller = pt.antijerk.one_dof(ELECTRIC, pt.antijerk.speed_difference(ELECTRIC, gain=GAIN))
    twisting = []
    for each in (None, controller):
        response = pt.braking(ELECTRIC, each, abs_frequency=frequency)
        twisting.append(np.abs(response["motor_speed"] - ELECTRIC.ratio * response["wheels_speed"]).max())
    assert twisting[1] < 0.7 * twisting[0]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pt.change_of_mind(PLANT, hold=0.1), "hold = 0.1 s, permitted: longer than a ramp of 0.1 s"),
        (lambda: pt.let_off(PLANT, drag=30.0), "drag = 30.0 N m, permitted: of the other sign than torque = 100 N m"),
        (
            lambda: pt.let_off(pt.SampledPlant(car=CAR)),
            "drag = -30.0 N m, permitted: within the torque limits 0 to 350",
        ),
        (lambda: pt.braking(PLANT, brake=-1.0), "brake = -1.0 N m, permitted: >= 0"),
        (lambda: pt.braking(PLANT, abs_frequency=80.0), "abs_frequency = 80.0 Hz, permitted: at most 50"),
        (lambda: pt.braking(PLANT, abs_frequency=0.0), "abs_frequency = 0.0 Hz, permitted: > 0"),
    ],
)
def test_a_manoeuvre_that_cannot_be_is_refused(call, message):
    with pytest.raises(pt.ParameterError, match=message):
        call()
