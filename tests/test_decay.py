"""Ring-down and order tracking, identification/tracking."""

import numpy as np
import pytest

import powertrain_ctrl as pt
from benchmarks import track

T = np.arange(290) * 0.01


def oscillation(f, zeta, t=T, phase=0.3):
    w = 2 * np.pi * f
    return np.exp(-zeta * w * t) * np.cos(w * np.sqrt(1 - zeta**2) * t + phase)


@pytest.mark.parametrize("zeta", [0.001, 0.05, 0.136, 0.4])
@pytest.mark.parametrize("f", [1.2, 3.755, 9.0])
def test_frequency_and_damping_of_a_clean_signal_are_exact(f, zeta):
    found = pt.ring_down(1.7 * oscillation(f, zeta) + 250.0 - 3.0 * T, 0.01)
    assert found.frequency_hz == pytest.approx(f, rel=1e-9)
    assert found.damping_ratio == pytest.approx(zeta, rel=1e-8, abs=1e-11)
    w = 2 * np.pi * f
    assert found.pole == pytest.approx(complex(-zeta * w, w * np.sqrt(1 - zeta**2)), rel=1e-8)


def test_the_errors_are_those_of_white_noise():
    rng = np.random.default_rng(0)
    clean = oscillation(3.755, 0.136) + 0.5 - 0.1 * T
    found = [pt.ring_down(clean + rng.normal(0.0, 0.03, len(T)), 0.01) for _ in range(60)]
    for name, error, true in (("frequency_hz", "frequency_error", 3.755), ("damping_ratio", "damping_error", 0.136)):
        values, errors = (np.array([getattr(each, what) for each in found]) for what in (name, error))
        assert values.std() == pytest.approx(errors.mean(), rel=0.25)
        assert abs(values.mean() - true) < 3.0 * errors.mean() / np.sqrt(60)
        assert 0.85 <= np.mean(np.abs(values - true) < 1.96 * errors) <= 1.0


def test_ring_down_after_a_measured_tip_in_is_the_pole_of_the_car():
    """The first pole of the matrices of the test track, by numpy alone."""
    run = track.run(4)
    stretch = slice(106, 396)
    found = pt.ring_down(run["engine_speed"][stretch] / 10.8 - run["wheels_speed"][stretch], 0.01)
    E = np.zeros((6, 7))
    for i, (before, behind) in enumerate(track.ENDS):
        E[i, i], E[i, i + 1] = before, -behind
    M = np.diag(1.0 / np.array(track.INERTIA))
    K, D = E.T * track.STIFFNESS @ E, E.T * track.DAMPING @ E
    poles = np.linalg.eigvals(np.block([[np.zeros((7, 7)), np.eye(7)], [-M @ K, -M @ D]]))
    pole = min((p for p in poles if p.imag > 1.0), key=abs)
    assert found.frequency_hz == pytest.approx(abs(pole) / 2 / np.pi, rel=0.005)
    assert found.damping_ratio == pytest.approx(-pole.real / abs(pole), rel=0.05)
    assert abs(found.frequency_hz - abs(pole) / 2 / np.pi) < 3.0 * found.frequency_error


def run_up(rpm_from=800.0, rpm_to=2200.0, duration=20.0, dt=0.002):
    t = np.arange(0.0, duration, dt)
    speed = pt.rpm(rpm_from + (rpm_to - rpm_from) * t / duration)
    return t, speed, pt.rpm(rpm_from * t + 0.5 * (rpm_to - rpm_from) * t**2 / duration)


@pytest.mark.parametrize("order", [0.5, 2.0, 3.7])
def test_an_order_goes_with_the_speed(order):
    t, speed, angle = run_up()
    noise = np.random.default_rng(1).normal(0.0, 0.3, len(t))
    found = pt.order_tracking(np.sin(order * angle) + noise, 0.002, speed)
    assert found.kind == "order"
    assert found.order == pytest.approx(order, rel=0.01)
    assert repr(found).startswith(f"order {found.order:.3f}: frequency goes with speed to the ")


@pytest.mark.parametrize("f", [6.3, 22.7, 60.0])
def test_a_mode_stays_where_it_is(f):
    t, speed, _ = run_up()
    noise = np.random.default_rng(2).normal(0.0, 0.3, len(t))
    found = pt.order_tracking(np.sin(2 * np.pi * f * t) + noise, 0.002, speed)
    assert found.kind == "mode"
    assert found.frequency_hz == pytest.approx(f, rel=0.01)


def test_what_goes_with_the_root_of_the_speed_is_neither():
    _, speed, _ = run_up()
    found = pt.order_tracking(np.sin(np.cumsum(10.0 * np.sqrt(speed)) * 0.002), 0.002, speed)
    assert found.kind == "neither"
    assert found.exponent == pytest.approx(0.5, abs=0.02)


def test_at_constant_speed_an_order_and_a_mode_look_the_same_and_it_is_said():
    with pytest.raises(pt.PowertrainError, match="at constant speed an order and a mode look the same"):
        pt.order_tracking(np.sin(20.0 * T), 0.01, np.full(len(T), 100.0))


REFUSED = {
    "too short": (lambda: pt.ring_down(np.arange(10.0), 0.01), "permitted: \\(N,\\) with N >= 16"),
    "constant": (lambda: pt.ring_down(np.full(50, 3.0), 0.01), "does not change"),
    "a ramp": (lambda: pt.ring_down(np.arange(50.0), 0.01), "nothing in the signal oscillates"),
    "noise": (
        lambda: pt.ring_down(np.random.default_rng(0).normal(size=200), 0.01),
        "nothing in the signal oscillates",
    ),
    "not finite": (lambda: pt.ring_down(np.array([np.nan] * 50), 0.01), "finite"),
    "no time": (lambda: pt.ring_down(oscillation(3.0, 0.1), 0.0), "dt = 0.0 s"),
    "two lengths": (lambda: pt.order_tracking(T, 0.01, T[1:]), "permitted: \\(N,\\) both"),
    "backwards": (lambda: pt.order_tracking(T, 0.01, T - 1.0), "permitted: > 0"),
    "few samples": (lambda: pt.order_tracking(T[:60], 0.01, 1.0 + T[:60]), "60 samples, permitted: at least"),
    "few cycles": (lambda: pt.order_tracking(np.sin(0.1 * T), 0.01, 1.0 + T), "too few cycles"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_tells_nothing_is_refused(what):
    call, message = REFUSED[what]
    with pytest.raises(pt.PowertrainError, match=message):
        call()
