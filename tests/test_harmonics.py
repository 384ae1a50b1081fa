"""Harmonic inputs and engines over time (hybrid/harmonics, orders/runup): closed forms, orders, events, run-ups."""

import numpy as np
import pytest

import powertrain_ctrl as pt

ENGINE = pt.Engine(
    cylinders=4,
    firing_order=(1, 3, 4, 2),
    bore=0.0825,
    stroke=0.0928,
    rod=0.144,
    reciprocating_mass=0.55,
    pressure=pt.orders.wiebe(mean_torque=150.0, compression_ratio=10.5),
)
CAR = pt.examples.conventional(gear_ratio=3.6)
TORQUE = pt.harmonic(80.0, 150.0, 0.3) + pt.harmonic(20.0, 300.0) + pt.step(0.0, 5.0)


def rattling():
    """Engine, damper, a gear that is loose in its mesh."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.SpringDamper("damper", "engine", "hub", stiffness=1500.0, damping=2.0),
        pt.Inertia("hub", J=0.01),
        pt.Backlash("mesh", "hub", "gear", gap=0.01, stiffness=2e4, damping=2.0),
        pt.Inertia("gear", J=0.005),
        pt.Drag("oil", "gear", damping=0.02),
    )


def as_function(signal):
    """The same signal as a function of time, which is followed by polynomials."""
    return lambda t: float(signal(t))


def test_signals_add_up_scale_and_have_the_phase_at_time_zero():
    t = np.linspace(-1.0, 2.0, 7)
    signal = 2.0 * (pt.ramp(0.0, 1.0, 3.0) + pt.harmonic(4.0, 5.0, 0.7) + pt.harmonic(1.0, 2.0) * -3.0)
    expected = 2.0 * (3.0 * np.clip(t, 0.0, 1.0) + 4.0 * np.cos(5.0 * t + 0.7) - 3.0 * np.cos(2.0 * t))
    np.testing.assert_allclose(signal(t), expected, atol=1e-14)
    np.testing.assert_allclose((-signal)(t), -expected, atol=1e-14)
    assert sum([pt.harmonic(1.0, 2.0), pt.harmonic(2.0, 3.0)], start=pt.step(0.0, 0.0))(0.0) == 3.0


def test_an_undamped_resonance_grows_as_the_closed_form_says():
    omega = 20.0
    car = pt.Driveline(pt.Inertia("disc", J=0.5), pt.Drag("spring", "disc", damping=0.0, stiffness=0.5 * omega**2))
    t = np.linspace(0.0, 5.0, 501)
    response = pt.simulate(car, t, {"disc_torque": pt.harmonic(3.0, omega)})
    # J theta'' + k theta = T cos(omega t) from rest: theta = T / (2 J omega) t sin(omega t)
    angle = 3.0 / (2.0 * 0.5 * omega) * t * np.sin(omega * t)
    np.testing.assert_allclose(response["spring_twist"], angle, atol=1e-9)


@pytest.mark.parametrize("car", [CAR, CAR.replace("clutch_shaft", damping=0.0)], ids=["damped", "less damped"])
def test_after_a_while_the_sum_of_orders_is_left(car):
    speed = pt.rpm(1500.0)
    period = 4.0 * np.pi / speed
    orders, amplitudes = ENGINE.torque_orders(speed)
    torque = ENGINE.signal(speed) + pt.step(-1.0, -ENGINE.mean_torque())
    t = np.concatenate([[0.0], 40.0 + np.linspace(0.0, period, 361)])
    run, steady = pt.simulate(car, t, {"engine_torque": torque}), pt.order_response(car, ENGINE, speed)
    turn = np.exp(1j * np.multiply.outer(orders * speed, t[1:]))
    for name in (
        "engine_speed",
        "damper_spring_torque",
        "drive_shafts_torque",
        "vehicle_acceleration",
        "clutch_torque",
    ):
        wave = (steady[name][:, 0] @ turn).real
        found = run[name][1:] - run[name][1:-1].mean()
        assert np.abs(found - wave).max() < 1e-9 * np.abs(wave).max(), name
    np.testing.assert_allclose(run["engine_torque"][1:], (amplitudes[:, 0] @ turn).real, atol=1e-6)


def test_rattle_through_a_gap_has_the_events_of_the_same_torque_as_a_function():
    t = np.linspace(0.0, 0.1, 201)
    one, other = (
        pt.simulate(rattling(), t, {"engine_torque": torque}, initial_speed={"engine": 100.0})
        for torque in (TORQUE, as_function(TORQUE))
    )
    assert len(one.events) > 8
    assert [e.kind for e in one.events] == [e.kind for e in other.events]
    np.testing.assert_allclose([e.time for e in one.events], [e.time for e in other.events], atol=1e-11)
    np.testing.assert_allclose(one["mesh_torque"], other["mesh_torque"], atol=1e-6)


def test_a_clutch_that_sticks_and_slips_under_a_second_order_has_the_events_and_the_heat_of_the_function():
    pair = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=2.0))
    t, torque = np.linspace(2.5, 2.7, 41), 0.1 * TORQUE
    one, other = (
        pt.simulate(pair, t, {"a_torque": each}, initial_speed={"a": 0.2}) for each in (torque, as_function(torque))
    )
    assert {e.kind for e in one.events} == {"lock", "slip"}
    np.testing.assert_allclose([e.time for e in one.events], [e.time for e in other.events], atol=1e-11)
    assert one.slip_energy["clutch"] == pytest.approx(other.slip_energy["clutch"], rel=1e-9)


def test_two_halves_are_the_whole():
    inputs, t = {"engine_torque": TORQUE}, np.linspace(0.0, 0.2, 21)
    whole = pt.simulate(rattling(), t, inputs, initial_speed={"engine": 50.0})
    first = pt.simulate(rattling(), t[:11], inputs, initial_speed={"engine": 50.0})
    second = pt.simulate(rattling(), t[10:], inputs, initial_state=first.final)
    for node, speed in second.final.speed.items():
        assert speed == pytest.approx(whole.final.speed[node], rel=1e-9)
    # without the torque it goes on from there too
    onward = pt.simulate(rattling(), t[10:], initial_state=first.final)
    assert onward["engine_speed"][0] == pytest.approx(first["engine_speed"][-1], rel=1e-13)


def test_torques_at_several_nodes_share_the_oscillator_of_a_frequency():
    tones = {"engine_torque": pt.harmonic(50.0, 90.0), "wheels_torque": pt.harmonic(-20.0, 90.0, 1.0)}
    t = np.linspace(0.0, 0.5, 101)
    together = pt.simulate(CAR, t, tones)
    apart = [pt.simulate(CAR, t, {name: signal}) for name, signal in tones.items()]
    for name in ("engine_speed", "tyres_torque", "vehicle_acceleration", "wheels_torque"):
        np.testing.assert_allclose(together[name], apart[0][name] + apart[1][name], atol=1e-9)


def test_on_nodes_without_inertia_and_beside_a_moved_node_it_acts_too():
    spring = pt.SpringDamper("two", "flange", "b", stiffness=300.0, damping=1.0)
    flange = pt.Driveline(
        pt.Inertia("a", J=0.2),
        pt.SpringDamper("one", "a", "flange", stiffness=900.0, damping=0.5),
        spring,
        pt.Inertia("b", J=1.0),
    )
    rig = pt.Driveline(
        pt.SpeedSource("motor", "a"), spring, pt.SpringDamper("one", "a", "flange", stiffness=900.0), pt.Inertia("b", J=1.0),
        pt.Inertia("flange", J=0.1),
    )  # fmt: skip
    t, torque = np.linspace(0.0, 0.3, 61), pt.harmonic(10.0, 40.0, 0.2)
    for car, inputs in (
        (flange, {"flange_torque": torque}),
        (rig, {"a_torque": torque, "motor_speed": pt.ramp(0.0, 1.0, 5.0)}),
    ):
        one = pt.simulate(car, t, inputs)
        other = pt.simulate(car, t, {k: v if k == "motor_speed" else as_function(v) for k, v in inputs.items()})
        for name in one.outputs:
            np.testing.assert_allclose(
                one[name], other[name], atol=1e-7 * (1.0 + np.abs(other[name]).max()), err_msg=name
            )


def test_a_control_model_that_switches_at_the_lock_goes_on_sounding():
    car = pt.examples.conventional(damping="open")
    model = pt.SwitchedTwoMass(
        closed=pt.two_mass(car, method="source"), slipping=pt.two_mass(car.release("clutch"), method="source")
    )
    t = np.linspace(0.0, 2.0, 201)
    torque = pt.harmonic(30.0, 40.0) + pt.step(0.0, 200.0)
    inputs = {"clutch_capacity": pt.ramp(0.0, 0.2, 370.0)}
    one, other = (
        pt.simulate(model, t, inputs | {"engine_torque": each}, initial_speed={"engine": 150.0})
        for each in (torque, as_function(torque))
    )
    assert [e.kind for e in one.events] == [e.kind for e in other.events]
    assert "lock" in [e.kind for e in one.events]
    np.testing.assert_allclose(one["vehicle_speed"], other["vehicle_speed"], atol=1e-8)
    np.testing.assert_allclose(one["engine_torque"], torque(t), atol=1e-9)


def test_a_capacity_may_be_harmonic_too():
    pair = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=2.0))
    capacity = pt.step(-1.0, 2.0) + pt.harmonic(0.5, 10.0)
    response = pt.simulate(pair, [0.0, 1.0], {"clutch_capacity": capacity}, initial_speed={"a": 10.0})
    # what b has gained is the integral of the capacity
    assert response.final.speed["b"] == pytest.approx(2.0 + 0.05 * np.sin(10.0), rel=1e-9)


def test_an_engine_given_as_it_is_has_the_speed_with_which_its_node_starts():
    t, speed = np.linspace(0.0, 0.1, 21), pt.rpm(1200.0)
    start = {"engine": speed}
    one = pt.simulate(CAR, t, {"engine_torque": ENGINE}, initial_speed=start)
    other = pt.simulate(CAR, t, {"engine_torque": ENGINE.signal(speed)}, initial_speed=start)
    np.testing.assert_allclose(one["drive_shafts_torque"], other["drive_shafts_torque"], atol=1e-8)
    with pytest.raises(pt.PowertrainError, match=r"speed = 0\.0 rad/s, permitted: > 0"):
        pt.simulate(CAR, t, {"engine_torque": ENGINE})


def test_cylinders_at_nodes_of_their_own_make_up_the_engine():
    t, speed = np.linspace(0.0, 0.3, 50), 120.0
    parts = [ENGINE.signal(speed, cylinders=[cylinder]) for cylinder in (1, 2, 3, 4)]
    np.testing.assert_allclose(sum(part(t) for part in parts), ENGINE.signal(speed)(t), atol=1e-9)
    angle = speed * t + 0.4
    exact = ENGINE.signal(speed, highest_order=80.0, angle=0.4)(t)
    np.testing.assert_allclose(exact, ENGINE.torque(angle, speed), atol=1e-3 * np.abs(exact).max())


def test_a_run_up_has_the_orders_of_its_speed_at_the_angle_it_has_turned():
    course = pt.ramp(0.5, 2.0, 300.0, 100.0)
    engine = pt.Engine(cylinders=1, orders={2.0: 40.0 - 30.0j})
    t = np.array([-1.0, 0.2, 0.5, 1.3, 2.5, 3.0])
    # by hand: the integral of the speed from t = 0 on
    turned = np.where(t < 0.5, 100.0 * t, 50.0 + 100.0 * (t - 0.5) + 50.0 * (t - 0.5) ** 2)
    turned = np.where(t > 2.5, 50.0 + 400.0 + 300.0 * (t - 2.5), turned)
    expected = ((40.0 - 30.0j) * np.exp(2j * turned)).real
    np.testing.assert_allclose(engine.signal(course)(t), expected, atol=1e-10)


@pytest.mark.parametrize("error", [1e-3, 1e-5])
def test_the_straight_lines_of_a_run_up_miss_it_by_no_more_than_is_stated(error):
    course = pt.ramp(0.1, 0.5, 250.0, 80.0)
    signal = ENGINE.signal(course, error=error)
    lines = signal.over(0.0, 0.8)
    t = np.linspace(0.0, 0.8, 40001)
    size = np.abs(ENGINE.torque_orders(np.linspace(80.0, 250.0, 50))[1]).sum(axis=0).max()
    missed = np.abs(lines(t) - signal(t)).max()
    assert 0.02 * error * size < missed <= error * size
    spacing = np.diff(lines.times)
    assert spacing[-1] < 0.5 * spacing[0]  # finer where it turns faster


def test_a_slow_run_up_passes_a_critical_speed_with_the_peak_of_the_order():
    pair = pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.SpringDamper("shaft", "engine", "load", stiffness=4000.0, damping=1.5),
        pt.Inertia("load", J=0.2),
    )
    engine = pt.Engine(cylinders=1, orders={2.0: 20.0})
    course = pt.ramp(0.0, 10.0, 130.0, 70.0)
    t = np.linspace(0.0, 10.0, 20001)
    run = pt.simulate(pair, t, {"engine_torque": engine.signal(course)}, initial_speed={"engine": 70.0})
    steady = pt.order_response(pair, engine, np.linspace(70.0, 130.0, 601)).peak("shaft_torque")
    assert np.abs(run["shaft_torque"]).max() == pytest.approx(steady.max(), rel=0.02)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: pt.harmonic(1.0, 0.0), "omega = 0.0 rad/s, permitted: > 0"),
        (lambda: pt.harmonic(float("nan"), 1.0), "amplitude = nan"),
        (lambda: pt.harmonic(1.0, 2.0) * float("inf"), "factor = inf"),
        (lambda: ENGINE.signal(-5.0), "speed = -5.0 rad/s"),
        (lambda: ENGINE.signal(100.0, cylinders=[5]), "cylinder = 5, permitted: 1 to 4"),
        (lambda: ENGINE.signal(pt.ramp(0.0, 1.0, 100.0), error=0.0), "error = 0.0, permitted: > 0"),
        (lambda: ENGINE.signal(pt.ramp(0.0, 1.0, 100.0)).over(0.0, 1.0), "speed of the engine is 0 rad/s at t = 0 s"),
        (lambda: ENGINE.signal(pt.ramp(0.0, 1.0, 9e4, 8e4), error=1e-9).over(0.0, 9.0), "give a larger error"),
        (
            lambda: pt.simulate(CAR, [0.0, 1.0], {"motor_torque": pt.harmonic(1.0, 2.0)}),
            '"motor_torque" is not an input',
        ),
    ],
)
def test_what_makes_no_signal_is_named(make, words):
    with pytest.raises(pt.PowertrainError, match=words):
        make()
