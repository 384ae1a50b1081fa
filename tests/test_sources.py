"""Nodes whose motion is given."""

import numpy as np
import pytest
import scipy.integrate

import powertrain_ctrl as pt


def rig(*others, J=None):
    shaft = pt.SpringDamper("shaft", "input", "disc", stiffness=100.0, damping=0.8)
    body = [] if J is None else [pt.Inertia("input", J=J)]
    return pt.Driveline(pt.SpeedSource("motor", "input"), *body, shaft, pt.Inertia("disc", J=0.5), *others)


def test_the_node_moves_as_it_is_told_and_the_rest_follows():
    t, signal = np.linspace(0.0, 2.0, 201), pt.ramp(0.2, 0.5, 20.0)
    response = pt.simulate(rig(), t, {"motor_speed": signal, "disc_torque": -3.0})
    np.testing.assert_allclose(response["input_speed"], signal(t), atol=1e-11)
    np.testing.assert_allclose(response["motor_speed"], signal(t), atol=1e-11)

    def rate(t, y):
        twist, disc = y
        slip = float(signal(t)) - disc
        return [slip, (100.0 * twist + 0.8 * slip - 3.0) / 0.5]

    parts, start = [], [0.0, 0.0]
    for a, b in ((0.0, 0.2), (0.2, 0.7), (0.7, 2.0)):
        inside = t[(t >= a - 1e-12) & (t <= b + 1e-12)]
        solution = scipy.integrate.solve_ivp(
            rate, (a, b), start, "DOP853", np.clip(inside, a, b), rtol=1e-12, atol=1e-12
        )
        parts.append(solution.y[1][: -1 if b < 2.0 else None])
        start = solution.y[:, -1]
    np.testing.assert_allclose(response["disc_speed"], np.concatenate(parts), atol=1e-9)


@pytest.mark.parametrize("J", [None, 0.3])
def test_its_torque_is_what_spring_damper_and_inertia_take(J):
    t = np.linspace(0.0, 1.0, 101)
    response = pt.simulate(rig(J=J), t, {"motor_speed": pt.ramp(0.0, 1.0, 20.0), "input_torque": 1.5})
    inside = slice(1, -1)
    expected = response["shaft_torque"] + (J or 0.0) * 20.0 - 1.5
    np.testing.assert_allclose(response["motor_torque"][inside], expected[inside], atol=1e-9)


def test_work_of_the_source_is_what_the_disc_and_the_damper_have():
    t = np.linspace(0.0, 3.0, 30001)
    response = pt.simulate(rig(), t, {"motor_speed": lambda t: 10.0 * np.sin(3.0 * t)})
    work = scipy.integrate.simpson(response["motor_torque"] * response["motor_speed"], x=t)
    slip = response["input_speed"] - response["disc_speed"]
    lost = scipy.integrate.simpson(0.8 * slip**2, x=t)
    stored = 0.25 * response["disc_speed"][-1] ** 2 + 50.0 * response["shaft_twist"][-1] ** 2
    assert work == pytest.approx(lost + stored, rel=1e-7)


def test_a_heavy_flywheel_with_the_same_speed_does_the_same():
    # the same node with 1e9 kg m^2 and the torque that moves it so
    t, signal = np.linspace(0.0, 1.0, 101), pt.ramp(0.1, 0.4, 30.0)
    play = pt.Backlash("play", "disc", "end", gap=0.05, stiffness=300.0, damping=0.5)
    end = pt.Inertia("end", J=0.1)
    told = pt.simulate(rig(play, end), t, {"motor_speed": signal})
    heavy = pt.Driveline(*(e for e in rig(play, end) if e.name != "motor"), pt.Inertia("input", J=1e9))
    accelerated = 1e9 * 75.0 * (pt.step(0.1, 1.0) + pt.step(0.5, -1.0))
    driven = pt.simulate(heavy, t, {"input_torque": accelerated})
    assert [event.kind for event in told.events] == [event.kind for event in driven.events]
    np.testing.assert_allclose(
        [event.time for event in told.events], [event.time for event in driven.events], atol=1e-6
    )
    np.testing.assert_allclose(told["end_speed"], driven["end_speed"], atol=1e-5)


def test_a_clutch_to_a_moved_node_slips_and_locks():
    # 4 N m on 0.5 kg m^2: 8 rad/s^2 against a node that turns with 6 rad/s
    car = pt.Driveline(
        pt.SpeedSource("motor", "input"),
        pt.Clutch("clutch", "input", "disc", max_torque=4.0),
        pt.Inertia("disc", J=0.5),
    )
    response = pt.simulate(car, [0.0, 0.5, 1.0], {"motor_speed": 6.0})
    assert [(event.kind, event.time) for event in response.events] == [("lock", pytest.approx(0.75, abs=1e-12))]
    assert response["motor_torque"].tolist() == pytest.approx([4.0, 4.0, 0.0], abs=1e-9)
    # locked it follows a ramp of less than 8 rad/s^2, and slips with a jump
    jump = pt.ramp(1.0, 1.0, 4.0, 0.0) + pt.step(3.0, 2.0) + 6.0 * pt.step(-1.0, 1.0)
    later = pt.simulate(car, [0.0, 4.0], {"motor_speed": jump})
    assert [event.kind for event in later.events] == ["lock", "slip", "lock"]
    assert later.events[2].time == pytest.approx(3.0 + 2.0 / 8.0, abs=1e-12)


def test_the_discrete_system_is_the_simulation():
    import control

    car = rig()
    system = pt.nonlinear_system(car, dt=0.01)
    t = np.arange(101) * 0.01
    values = pt.input_values(system, car, t, {"motor_speed": 5.0 * np.sin(6.0 * t)})
    sampled = control.input_output_response(system, t, values, 0.0)
    direct = pt.simulate(car, t, {"motor_speed": 5.0 * np.sin(6.0 * t)})
    row = sampled.outputs[system.find_output("disc_speed")]
    np.testing.assert_allclose(row, direct["disc_speed"], atol=1e-10)


def test_for_small_motion_the_node_is_at_rest():
    car = rig()
    with pytest.raises(pt.PowertrainError, match=r"motor: is not linear.*car.at"):
        pt.modes(car)
    assert pt.modes(car.at()).frequency_hz == pytest.approx([np.sqrt(200.0) / (2.0 * np.pi)])
    with pytest.raises(pt.PowertrainError, match=r"motor needs memory.*give dt"):
        pt.nonlinear_system(car)


@pytest.mark.parametrize("friction", [2.0, 50.0])
def test_friction_holds_nothing_that_a_source_takes_along(friction):
    car = pt.Driveline(
        pt.Inertia("a", J=0.2),
        pt.Inertia("b", J=0.3),
        pt.SpeedSource("motor", "a"),
        pt.DogClutch("dog", "a", "b"),
        pt.Drag("bearing", "b", damping=0.0, friction=friction),
    )
    inputs = {"motor_speed": pt.ramp(0.0, 2.0, -2.0, 2.0), "dog_engaged": 1.0}
    response = pt.simulate(car, np.linspace(0.0, 2.0, 21), inputs, {"a": 2.0, "b": 2.0})
    assert [(e.time, e.mode) for e in response.events] == [(pytest.approx(1.0, abs=1e-12), "backward")]
    # -2 rad/s^2 on 0.5 kg m^2, and the friction on whichever side it slips
    side = np.sign(1.0 - response.time[response.time != 1.0])
    np.testing.assert_allclose(response["motor_torque"][response.time != 1.0], -1.0 + side * friction, atol=1e-9)
    assert response.slip_energy["bearing"] == pytest.approx(2.0 * friction, rel=1e-12)


@pytest.mark.parametrize(("capacity", "slipping"), [(20.0, "bearing"), (3.0, "clutch")])
def test_of_a_clutch_to_a_source_and_a_bearing_the_weaker_one_slides(capacity, slipping):
    car = pt.Driveline(
        pt.Inertia("a", J=0.2),
        pt.Inertia("b", J=0.3),
        pt.SpeedSource("motor", "a"),
        pt.Clutch("clutch", "a", "b", max_torque=capacity),
        pt.Drag("bearing", "b", damping=0.0, friction=8.0),
    )
    # the source comes to rest and goes on
    speed = pt.ramp(0.0, 1.0, 0.0, 2.0) + pt.ramp(1.5, 1.0, 3.0)
    response = pt.simulate(car, np.linspace(0.0, 2.5, 26), {"motor_speed": speed}, {"a": 2.0, "b": 2.0})
    assert response.final.mode[{"bearing": "bearing_friction", "clutch": "clutch"}[slipping]] in (1, "forward")
    assert response.final.speed["b"] == pytest.approx(3.0 if slipping == "bearing" else 0.0, abs=1e-9)


def test_a_bearing_beside_a_source_turns_with_it():
    car = pt.Driveline(
        pt.Inertia("a", J=0.2), pt.SpeedSource("motor", "a"), pt.Drag("bearing", "a", damping=0.0, friction=5.0)
    )  # fmt: skip
    response = pt.simulate(car, np.linspace(0.0, 2.0, 21), {"motor_speed": pt.ramp(0.0, 2.0, -2.0, 2.0)}, {"a": 2.0})
    assert [(e.time, e.mode) for e in response.events] == [(pytest.approx(1.0, abs=1e-12), "backward")]
    assert response["motor_torque"][[0, -1]] == pytest.approx([-0.4 + 5.0, -0.4 - 5.0], abs=1e-9)
