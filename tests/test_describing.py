"""Frequency over amplitude by the describing function, against the closed forms of play and stages."""

import numpy as np
import pytest

import powertrain_ctrl as pt
from tests.cases import case


def on_a_wall(p):
    knee = p.k1 * p.q1
    spring = pt.MultiStageSpring(
        "s",
        "J",
        "wall",
        twists=(-2.0 * p.q1, -p.q1, p.q1, 2.0 * p.q1),
        torques=(-knee - p.k2 * p.q1, -knee, knee, knee + p.k2 * p.q1),
    )
    return pt.Driveline(pt.Inertia("J", J=p.J), pt.Inertia("wall", J=1e12), spring)


@pytest.mark.parametrize("name", ["two_stage_frequency_amplitude", "free_play_frequency_amplitude"])
def test_stiffness_and_error_are_the_closed_forms(name):
    reference = case(name)
    amplitudes = (0.06, 0.1, 0.3)
    found = pt.describing_frequency(on_a_wall(reference.p), 1, amplitudes)
    for i, amplitude in enumerate(amplitudes):
        N = reference.values[f"describing_function_at_{amplitude:g}"]
        assert found.stiffness[i] == pytest.approx(N, rel=1e-9)
        assert found.error[i] == pytest.approx(
            reference.values[f"frequency_error_of_describing_function_at_{amplitude:g}"], abs=1e-7
        )
        assert found.frequency_hz[i] == pytest.approx(np.sqrt(N / reference.p.J) / (2.0 * np.pi), rel=1e-9)


def test_play_is_the_stage_without_stiffness():
    p = case("free_play_frequency_amplitude").p
    play = pt.Backlash("s", "J", "wall", gap=2.0 * p.q1, stiffness=p.k2)
    car = pt.Driveline(*(e for e in on_a_wall(p) if e.name != "s"), play)
    one, other = (pt.describing_frequency(c, 1, [0.06, 0.2]) for c in (car, on_a_wall(p)))
    np.testing.assert_allclose(one.stiffness, other.stiffness, rtol=1e-12)
    np.testing.assert_allclose(one.error, other.error, rtol=1e-9)


def test_a_lopsided_spring_swings_about_where_no_mean_torque_is_left():
    # T = 100 q to the left, 900 q to the right: N and b solve T's mean and fundamental by quadrature
    spring = pt.MultiStageSpring("s", "J", "wall", twists=(-1.0, 0.0, 1.0), torques=(-100.0, 0.0, 900.0))
    car = pt.Driveline(pt.Inertia("J", J=0.2), pt.Inertia("wall", J=1e12), spring)
    found = pt.describing_frequency(car, 1, [0.5])
    theta = (np.arange(200000) + 0.5) * (2.0 * np.pi / 200000)

    def torque(b):
        q = b + 0.5 * np.cos(theta)
        return np.where(q > 0.0, 900.0 * q, 100.0 * q)

    low, high = -0.5, 0.5
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if torque(middle).mean() > 0.0 else (middle, high)
    N = 2.0 * (torque(low) * np.cos(theta)).mean() / 0.5
    assert found.stiffness[0] == pytest.approx(N, rel=1e-8)
    # the exact period is half of each side's
    exact = np.pi * np.sqrt(0.2) * (1.0 / 10.0 + 1.0 / 30.0)
    assert found.error[0] == pytest.approx(exact * np.sqrt(N / 0.2) / (2.0 * np.pi) - 1.0, abs=1e-7)


def test_the_car_with_play_is_softer_the_smaller_it_swings():
    source, half = pt.examples.conventional(), np.deg2rad(1.0)
    shafts = source["drive_shafts"]
    play = pt.Backlash(
        "drive_shafts",
        "final_drive_output",
        "wheels",
        gap=2.0 * half,
        stiffness=shafts.stiffness,
        damping=shafts.damping,
    )
    car = pt.Driveline(*(play if e.name == "drive_shafts" else e for e in source))
    found = pt.describing_frequency(car, 1, half * np.array([1.1, 1.5, 2.0, 3.0, 5.0, 10.0]))
    # of an independent computation
    np.testing.assert_allclose(found.frequency_hz, [0.54, 1.37, 1.78, 2.12, 2.35, 2.50], atol=0.005)


def test_what_it_cannot_describe_is_named():
    car = on_a_wall(case("free_play_frequency_amplitude").p)
    with pytest.raises(pt.PowertrainError, match=r"amplitude = 0\.05 rad, permitted: > 0\.05"):
        pt.describing_frequency(car, 1, [0.05])
    with pytest.raises(pt.PowertrainError, match="springs with play or stages: none"):
        pt.describing_frequency(pt.examples.conventional(), 1, [0.1])
    with pytest.raises(pt.PowertrainError, match="mode = 5, permitted: 0 to 1"):
        pt.describing_frequency(car, 5, [0.1])
