"""Engine start of a P2 hybrid through its separation clutch: events by another road, what compensation is worth."""

import numpy as np
import pytest
from event_located import integrated, merged

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.cranking import start_plan


@pytest.mark.parametrize("gear", [1, 2, 5])
@pytest.mark.parametrize("compensated", [True, False])
def test_every_event_is_that_of_an_independent_integration(gear, compensated):
    """Fine exact steps, zeros by bisection, modes by trial: times to 1e-8 s."""
    car = pt.examples.p2_hybrid(gear)
    given = {
        "torque": 60.0,
        "capacity": 60.0,
        "speed": 157.0,
        "blending": 0.3,
        "start": 0.5,
        "compensated": compensated,
    }
    plan = start_plan(car, "separation_clutch", **given)
    response = pt.engine_start(car, **given)
    changes, X, machine = integrated(car, plan.inputs, plan.state.speed, response.time[-1], plan.state.twist)
    found = sorted({round(event.time, 9) for event in response.events})
    expected = [time for time, _ in merged(changes)]
    assert len(found) == len(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8)
    speeds = dict(zip(machine.nodes, machine.Z @ X[machine.speeds], strict=True))
    for node in ("engine", "emachine", "vehicle"):
        assert speeds[node] == pytest.approx(response[f"{node}_speed"][-1], rel=1e-9)


@pytest.mark.parametrize("gear", range(1, 7))
def test_compensation_keeps_the_jerk_of_the_start_from_the_car(gear):
    car = pt.examples.p2_hybrid(gear)
    jerks, lowest = [], []
    for compensated in (True, False):
        response = pt.engine_start(car, compensated=compensated)
        acceleration = response["vehicle_acceleration"]
        jerks.append(np.abs(np.diff(acceleration)).max() / response.time[1])
        lowest.append(acceleration.min() / acceleration[0])
        # it is the clutch that turns the engine up, and nothing slips in the end
        assert abs(response["engine_speed"][0]) < 1e-12
        assert response["engine_speed"][-1] == pytest.approx(response["emachine_speed"][-1], rel=1e-2)
    assert jerks[0] < 0.8 * jerks[1]
    # without it the car is braked by its own engine
    assert lowest[0] > 0.3
    assert lowest[1] < 0.0


def test_the_slip_ends_when_both_sides_as_bodies_have_met():
    """In first gear, engine and flywheel as one body, to what the dual-mass flywheel swings."""
    response = pt.engine_start(pt.examples.p2_hybrid(1), torque=0.0, capacity=60.0, speed=150.0, start=0.5)
    lock = response.events[-1].time
    # 60 N m turn 0.21 kg m^2 up to 150 rad/s; the ramp of 50 ms costs half of it
    assert lock == pytest.approx(0.5 + 0.025 + 150.0 * 0.21 / 60.0, abs=0.02)


def test_in_the_end_the_engine_drives_with_the_torque_that_the_emachine_had():
    response = pt.engine_start(pt.examples.p2_hybrid(3), torque=80.0, timepts=np.linspace(0.0, 6.0, 601))
    assert response["emachine_torque"][[0, -1]] == pytest.approx([80.0, 0.0], abs=1e-12)
    assert response["engine_torque"][[0, -1]] == pytest.approx([0.0, 80.0], abs=1e-12)
    acceleration = response["vehicle_acceleration"]
    # with the engine turning too the same torque accelerates less
    electric, hybrid = (
        pt.static_gain(car, f"{node}_torque", "vehicle_acceleration").item() * 80.0
        for node, car in (
            ("emachine", pt.examples.p2_hybrid(3).release("separation_clutch").part("vehicle")),
            ("engine", pt.examples.p2_hybrid(3)),
        )
    )
    assert acceleration[[0, -1]] == pytest.approx([electric, hybrid], rel=1e-3)


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"clutch": "k0"}, pt.UnknownNameError, 'clutch "k0" is not in this driveline'),
        ({"capacity": 0.0}, pt.ParameterError, "capacity = 0.0 N m, permitted: > 0"),
        ({"speed": -5.0}, pt.ParameterError, "speed = -5.0 rad/s, permitted: > 0"),
        ({"capacity": 900.0}, pt.PowertrainError, "separation_clutch: max_torque = 320 N m"),
        ({"capacity": 20.0, "torque": 200.0}, pt.PowertrainError, r"capacity = 20 N m, permitted: more than \d"),
    ],
)
def test_a_start_that_cannot_be_is_refused(values, error, message):
    with pytest.raises(error, match=message):
        pt.engine_start(pt.examples.p2_hybrid(), **values)
