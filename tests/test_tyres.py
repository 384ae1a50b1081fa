"""Tyres with slip: relaxation, limit, and what they become at rest and without relaxation."""

import numpy as np
import pytest
import scipy.linalg

import powertrain_ctrl as pt
from tests.cases import case


def wheel(**values):
    p = case("tyre_relaxation_and_limit").p
    given = {
        "radius": p.radius,
        "slip_stiffness": p.slip_stiffness,
        "relaxation_length": p.relaxation_length,
        "speed": p.speed,
    }
    # a road so heavy that it does not move
    return pt.Driveline(
        pt.Inertia("wheel", J=p.wheel_inertia),
        pt.Mass("road", m=1e13),
        pt.SlipTyre("tyre", "wheel", "road", **(given | values)),
    )


def test_the_limit_is_reached_and_left_on_time():
    reference = case("tyre_relaxation_and_limit")
    response = pt.simulate(wheel(max_force=reference.p.force_limit), [0.0, 0.1], {"wheel_torque": reference.p.torque})
    reached, left = response.events[:2]
    assert (reached.kind, reached.mode, left.kind) == ("slip", "limit forward", "lock")
    assert reached.time == pytest.approx(reference.e.time_limit_reached, abs=1e-11)
    assert left.time == pytest.approx(reference.e.time_limit_left, abs=1e-11)
    at_limit = pt.simulate(
        wheel(max_force=reference.p.force_limit), [0.0, reached.time], {"wheel_torque": reference.p.torque}
    )
    assert at_limit.final.speed["wheel"] == pytest.approx(reference.e.wheel_speed_at_limit, rel=1e-10)


def test_frequency_and_damping_at_a_speed_are_the_closed_form():
    reference = case("tyre_relaxation_and_limit")
    car = wheel(speed=None).at(speed={"road": reference.p.speed})
    pole = pt.poles(car)[-1]
    assert abs(pole) == pytest.approx(reference.e.natural_frequency, rel=1e-9)
    assert -pole.real / abs(pole) == pytest.approx(reference.e.damping_ratio, rel=1e-8)


def test_steady_slip_carries_the_torque():
    # nothing drives the heavy road: the slip ends at T / (C r) V
    p = case("tyre_relaxation_and_limit").p
    response = pt.simulate(wheel(), [0.0, 5.0], {"wheel_torque": 100.0})
    slip = p.radius * response["wheel_speed"][-1] - response["road_speed"][-1]
    assert slip == pytest.approx(100.0 / (p.slip_stiffness * p.radius) * p.speed, rel=1e-9)
    assert response["tyre_torque"][-1] == pytest.approx(100.0)


def test_at_rest_it_is_the_spring_tyre_and_without_relaxation_the_damper_tyre():
    p = case("tyre_relaxation_and_limit").p
    t, load = np.linspace(0.0, 0.2, 201), {"wheel_torque": pt.ramp(0.0, 0.05, 100.0)}
    spring = pt.Tyre("tyre", "wheel", "road", radius=p.radius, stiffness=p.slip_stiffness / p.relaxation_length)
    damper = pt.Tyre("tyre", "wheel", "road", radius=p.radius, stiffness=0.0, damping=p.slip_stiffness / 10.0)
    for tyre, other in ((wheel(speed=0.0), spring), (wheel(relaxation_length=0.0), damper)):
        same = pt.Driveline(*(e for e in tyre if e.name != "tyre"), other)
        one, two = pt.simulate(tyre, t, load), pt.simulate(same, t, load)
        np.testing.assert_allclose(one["wheel_speed"], two["wheel_speed"], atol=1e-9 * np.abs(two["wheel_speed"]).max())
        np.testing.assert_allclose(one["tyre_torque"], two["tyre_torque"], atol=1e-9 * 100.0)


def test_a_simulation_is_the_exponential_of_its_equations():
    # J w' = T - k y, y' = w - (V / sigma) y
    p = case("tyre_relaxation_and_limit").p
    k, leak = p.slip_stiffness * p.radius**2 / p.relaxation_length, p.speed / p.relaxation_length
    A = np.array([[0.0, -k / p.wheel_inertia, 80.0 / p.wheel_inertia], [1.0, -leak, 0.0], [0.0, 0.0, 0.0]])
    response = pt.simulate(wheel(), [0.0, 0.013, 0.08], {"wheel_torque": 80.0})
    for t, speed in zip(response.time[1:], response["wheel_speed"][1:], strict=True):
        assert speed == pytest.approx((scipy.linalg.expm(A * t) @ [0.0, 0.0, 1.0])[0], rel=1e-9)


def test_without_a_speed_it_says_how_to_give_one():
    car = wheel(speed=None)
    with pytest.raises(pt.PowertrainError, match=r"tyre: needs a speed; take the driveline at one.*car\.replace"):
        pt.simulate(car, [0.0, 1.0])
    with pytest.raises(pt.PowertrainError, match=r"car.at\(speed="):
        car.at()
    with pytest.raises(pt.ParameterError, match="> 0 without a relaxation_length"):
        wheel(speed=0.0, relaxation_length=0.0)
