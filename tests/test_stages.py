"""Springs with stages, and friction beside them, against closed forms."""

import json
import math

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.elements import MultiStageSpring
from tests.cases import case


def against_a_wall(spring, J):
    return pt.Driveline(pt.Inertia("J", J=J), pt.Inertia("wall", J=1.0), pt.Constraint("fixed", {"wall": 1.0}), spring)


def two_stages(p):
    knee = p.k1 * p.q1
    twists, torques = (-2.0 * p.q1, -p.q1, p.q1, 2.0 * p.q1), (-knee - p.k2 * p.q1, -knee, knee, knee + p.k2 * p.q1)
    return against_a_wall(MultiStageSpring("s", "J", "wall", twists=twists, torques=torques), p.J)


@pytest.mark.parametrize("amplitude", [0.06, 0.1, 0.3])
@pytest.mark.parametrize("name", ["two_stage_frequency_amplitude", "free_play_frequency_amplitude"])
def test_a_period_over_the_amplitude_is_the_closed_form(name, amplitude):
    reference = case(name)
    period = reference.values[f"period_at_amplitude_{amplitude:g}"]
    car = two_stages(reference.p)
    end = pt.simulate(car, [0.0, period], initial_twist={"s": amplitude}).final
    # back at the same twist, at rest: a time error of t makes a speed of t times the acceleration, of at most 1e5 rad/s^2
    assert end.twist["s"] == pytest.approx(amplitude, abs=1e-13)
    assert abs(end.speed["J"]) < 1e-12 * reference.p.k2 * amplitude / reference.p.J * 10.0


def test_half_a_period_is_at_the_other_side():
    reference = case("two_stage_frequency_amplitude")
    half = 0.5 * reference.e.__dict__["period_at_amplitude_0.1"]
    end = pt.simulate(two_stages(reference.p), [0.0, half], initial_twist={"s": 0.1}).final
    assert end.twist["s"] == pytest.approx(-0.1, abs=1e-13)


def decaying(p, elastic=False):
    k, q = p.stiffness, 1.0
    if elastic:
        return pt.Driveline(pt.Inertia("J", J=p.J), pt.Drag("s", "J", damping=0.0, stiffness=k, friction=p.friction))
    spring = MultiStageSpring("s", "J", "wall", twists=(-q, q), torques=(-k * q, k * q), friction=p.friction)
    return against_a_wall(spring, p.J)


@pytest.mark.parametrize("as_drag", [False, True])
def test_coulomb_friction_beside_a_spring_stops_it_on_time(as_drag):
    reference = case("coulomb_and_spring_free_decay")
    response = pt.simulate(decaying(reference.p, as_drag), [0.0, 0.5], initial_twist={"s": reference.p.q0})
    assert response.events[-1].kind == "lock"
    assert response.events[-1].time == pytest.approx(reference.e.time_of_rest, abs=1e-12)
    assert response.final.twist["s"] == pytest.approx(reference.e.twist_at_rest, abs=1e-12)
    assert response.slip_energy["s"] == pytest.approx(reference.e.heat, rel=1e-12)
    assert {event.element for event in response.events} == {"s"}
    # it turns six times and then stays
    assert [event.kind for event in response.events] == ["slip"] * int(reference.e.half_cycles - 1) + ["lock"]


@pytest.mark.parametrize("friction_stiffness", [None, 2000.0])
def test_a_loop_loses_its_area(friction_stiffness):
    # an inertia so large that it does not feel the loop drives it: twist A cos(w t)
    reference = case("hysteresis_loss_per_cycle")
    p, w, J = reference.p, 2.0 * math.pi, 1e12
    spring = MultiStageSpring(
        "s",
        "J",
        "wall",
        twists=(-1.0, 1.0),
        torques=(-1e-3, 1e-3),
        friction=p.friction,
        friction_stiffness=friction_stiffness,
    )
    ground = pt.Drag("ground", "J", damping=0.0, stiffness=J * w * w)
    car = pt.Driveline(*against_a_wall(spring, J), ground)
    start = pt.simulate(car, [0.0, 1.0], initial_twist={"s": p.amplitude})
    cycle = pt.simulate(car, [1.0, 2.0], initial_state=start.final)
    expected = reference.e.loss_coulomb if friction_stiffness is None else reference.e.loss_jenkins
    assert cycle.slip_energy["s"] == pytest.approx(expected, rel=1e-9)


def test_torque_of_the_element_is_spring_damper_and_friction_together():
    spring = MultiStageSpring(
        "s", "a", "b", twists=(-0.1, 0.1, 0.2), torques=(-10.0, 10.0, 110.0), damping=0.5, friction=3.0
    )
    car = pt.Driveline(pt.Inertia("a", J=0.1), pt.Inertia("b", J=0.2), spring)
    response = pt.simulate(car, np.linspace(0.0, 0.2, 201), {"b_torque": -5.0}, {"a": 20.0})
    twist, slip = response["s_twist"], response["a_speed"] - response["b_speed"]
    polyline = np.interp(twist, [-1.1, -0.1, 0.1, 0.2, 1.2], [-110.0, -10.0, 10.0, 110.0, 1110.0])
    moving = np.abs(slip) > 1e-6
    expected = polyline + 0.5 * slip + 3.0 * np.sign(slip)
    np.testing.assert_allclose(response["s_torque"][moving], expected[moving], atol=1e-9)
    np.testing.assert_allclose(0.1 * response["a_acceleration"], -response["s_torque"], atol=1e-9)


def test_reflection_of_the_twist_reflects_the_response():
    points = {"twists": (-0.1, 0.02, 0.2), "torques": (-30.0, -6.0, 174.0)}
    mirror = {"twists": (-0.2, -0.02, 0.1), "torques": (-174.0, 6.0, 30.0)}
    one, other = (
        pt.Driveline(
            pt.Inertia("a", J=0.1),
            pt.Inertia("b", J=0.2),
            MultiStageSpring("s", *ends, **points, friction=2.0, damping=0.1),
        )
        for ends, points in ((("a", "b"), points), (("b", "a"), mirror))
    )
    t, load = np.linspace(0.0, 0.5, 501), {"a_torque": pt.ramp(0.1, 0.1, 20.0)}
    first, second = (pt.simulate(car, t, load, {"a": 3.0}) for car in (one, other))
    np.testing.assert_allclose(second["a_speed"], first["a_speed"], atol=1e-10)
    np.testing.assert_allclose(second["s_torque"], -first["s_torque"], atol=1e-8)
    assert [event.kind for event in second.events] == [event.kind for event in first.events]


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"twists": (0.0, 0.0, 1.0)}, "a steep stage"),
        ({"twists": (1.0, 0.0, 2.0)}, "> 1, the one before"),
        ({"torques": (0.0, 2.0, 1.0)}, ">= 2, the one before"),
        ({"twists": (0.0, 1.0)}, "as many of each"),
        ({"twists": (0.0,), "torques": (0.0,)}, "at least two"),
        ({"twists": (0.0, 1.0, math.nan)}, "finite"),
        ({"twists": "012"}, "a sequence of numbers"),
        ({"friction": -1.0}, ">= 0"),
        ({"friction_stiffness": 0.0}, "> 0"),
        ({"damping": -1.0}, ">= 0"),
    ],
)
def test_a_wrong_value_names_element_and_remedy(values, message):
    given = {"twists": (0.0, 1.0, 2.0), "torques": (0.0, 1.0, 2.0)} | values
    with pytest.raises(pt.PowertrainError, match=message) as caught:
        MultiStageSpring("damper", "a", "b", **given)
    assert "damper" in str(caught.value)


def test_a_file_gives_it_back(tmp_path):
    car = two_stages(case("two_stage_frequency_amplitude").p)
    car.save(tmp_path / "car.toml")
    assert pt.load(tmp_path / "car.toml") == car
    assert json.dumps(pt.simulate(car, [0.0, 0.1], initial_twist={"s": 0.06}).to_dict())


@pytest.mark.parametrize("friction_stiffness", [None, 3000.0])
def test_a_steady_load_moves_nothing(friction_stiffness):
    spring = MultiStageSpring(
        "s",
        "a",
        "b",
        twists=(-0.06, 0.06, 0.3),
        torques=(-24.0, 24.0, 504.0),
        friction=8.0,
        friction_stiffness=friction_stiffness,
    )
    car = pt.Driveline(pt.Inertia("a", J=0.2), pt.Inertia("b", J=0.6), spring)
    load = {"a_torque": 60.0}
    response = pt.simulate(car, np.linspace(0.0, 1.0, 101), load, {"a": 10.0}, initial_load=load)
    # three quarters of the load go through the spring, 45 = 24 + 2000 (q - 0.06)
    np.testing.assert_allclose(response["s_twist"], 0.06 + 21.0 / 2000.0, atol=1e-13)
    assert not response.events
