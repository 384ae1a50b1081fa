"""Road load: chords with a bound, coast-down, grade."""

import numpy as np
import pytest

import powertrain_ctrl as pt


def exact(force, m, start, end=0.0):
    """Time of coast-down from start to end speed under Coulomb friction and quadratic drag (closed form)."""
    constant, quadratic = force
    root = np.sqrt(quadratic / constant)
    return m / np.sqrt(constant * quadratic) * (np.arctan(start * root) - np.arctan(end * root))


def test_a_coast_down_comes_to_rest_within_the_bound():
    m, constant, quadratic, start = 1500.0, 180.0, 0.45, 42.0
    road = pt.RoadLoad("road", "car", constant=constant, quadratic=quadratic)
    response = pt.simulate(pt.Driveline(pt.Mass("car", m=m), road), [0.0, 400.0], initial_speed={"car": start})
    rest = response.events[-1].time
    # chords lie above the parabola by no more than the bound: the time lies between those of the two forces
    assert exact((constant + road.error, quadratic), m, start) < rest < exact((constant, quadratic), m, start)
    assert response.events[-1].kind == "lock"
    assert response.slip_energy["road"] == pytest.approx(0.5 * m * start**2, rel=1e-11)
    assert road.error == pytest.approx(quadratic * 2.0**2 / 4.0)


def test_at_the_ends_of_the_chords_it_is_the_parabola():
    road = pt.RoadLoad("road", "car", constant=180.0, linear=3.0, quadratic=0.45)
    car = pt.Driveline(pt.Mass("car", m=1e9), road)
    for speed in (2.0, 30.0, -14.0):
        response = pt.simulate(car, [0.0, 1e-9], initial_speed={"car": speed})
        expected = np.sign(speed) * (180.0 + 3.0 * abs(speed) + 0.45 * speed**2)
        assert response["road_torque"][0] == pytest.approx(expected, rel=1e-9)


def test_a_grade_pulls_back_and_friction_may_hold():
    weight = 1000.0 * 9.80665
    for grade, moves in ((0.01, False), (0.03, True)):
        car = pt.Driveline(pt.Mass("car", m=1000.0), pt.RoadLoad("road", "car", constant=200.0, grade=grade))
        final = pt.simulate(car, [0.0, 1.0]).final.speed["car"]
        expected = -(weight * grade - 200.0) / 1000.0 if moves else 0.0
        assert final == pytest.approx(expected, abs=1e-12)
    alone = pt.Driveline(pt.Mass("car", m=1000.0), pt.RoadLoad("hill", "car", grade=0.1))
    assert pt.simulate(alone, [0.0, 2.0]).final.speed["car"] == pytest.approx(-2.0 * 0.980665)


def test_it_is_linear_at_a_speed():
    car = pt.Driveline(pt.Mass("car", m=1000.0), pt.RoadLoad("road", "car", constant=200.0, linear=2.0, quadratic=0.4))
    pole = pt.poles(car.at(speed={"car": 20.0}))
    assert pole.real == pytest.approx([-(2.0 + 2.0 * 0.4 * 20.0) / 1000.0])
    with pytest.raises(pt.PowertrainError, match=r"road: its drag depends on the speed; give it, e.g. car.at\(speed="):
        car.at()


def test_a_negative_coefficient_is_refused_and_so_is_none():
    with pytest.raises(pt.ParameterError, match="road: quadratic"):
        pt.RoadLoad("road", "car", quadratic=-1.0)
    with pytest.raises(pt.ParameterError, match="road: constant = 0"):
        pt.RoadLoad("road", "car")
