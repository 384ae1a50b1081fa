"""Signals: ramps, steps and their sums, and the polynomial pieces that the core propagates."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.signals import input_pieces, shift


def value(pieces, t, signal=0):
    """Value from the pieces, at a jump the one behind it."""
    i = min(int(np.searchsorted(pieces.edges, t, side="right")) - 1, len(pieces.edges) - 2)
    return np.polynomial.polynomial.polyval(t - pieces.edges[i], pieces.coefficients[i, signal])


times = st.floats(0.0, 3.0)
ramps = st.builds(pt.ramp, times, st.sampled_from([0.0, 0.1, 0.7, 2.0]), st.floats(-5.0, 5.0), st.floats(-5.0, 5.0))


@given(ramps, ramps, times)
def test_a_sum_is_at_every_time_the_sum_of_its_signals(a, b, t):
    assert (a + b)(t) == pytest.approx(a(t) + b(t), abs=1e-12)
    assert (-a)(t) == -a(t)
    assert (2.5 * a)(t) == pytest.approx(2.5 * a(t), abs=1e-12)


@given(ramps, times)
def test_pieces_take_the_values_of_the_signal(signal, t):
    pieces = input_pieces({"u": signal}, ["u"], np.array([0.0, 3.0]))
    if min(abs(t - corner) for corner in (*signal.times, 3.0)) > 1e-9:
        assert value(pieces, t) == pytest.approx(float(signal(t)), abs=1e-9)


def test_signals_keep_each_its_own_corners_on_common_pieces():
    signals = {"a": pt.ramp(0.2, 0.5, 3.0), "b": pt.step(0.45, 2.0), "c": 4.0}
    pieces = input_pieces(signals, ["a", "nothing", "b", "c"], np.array([0.0, 1.0]))
    np.testing.assert_allclose(pieces.edges, [0.0, 0.2, 0.45, 0.7, 1.0])
    for t in (0.1, 0.3, 0.46, 0.8):
        expected = [float(signals["a"](t)), 0.0, float(signals["b"](t)), 4.0]
        np.testing.assert_allclose([value(pieces, t, j) for j in range(4)], expected, atol=1e-14)


def test_samples_are_joined_by_straight_lines_even_if_unevenly_spaced():
    t = np.array([0.0, 0.1, 0.15, 0.9, 1.0])
    u = np.array([0.0, 1.0, -1.0, 3.0, 3.0])
    pieces = input_pieces({"u": u}, ["u"], t)
    for at in np.linspace(0.01, 0.99, 23):
        assert value(pieces, at) == pytest.approx(np.interp(at, t, u), abs=1e-13)


@pytest.mark.parametrize(
    "function", [lambda t: np.sin(30.0 * t), lambda t: abs(t - 0.317), lambda t: 1.0 if t < 0.7301 else -2.0]
)
def test_functions_are_followed_to_ten_digits_corners_and_jumps_included(function):
    pieces = input_pieces({"u": function}, ["u"], np.linspace(0.0, 1.0, 11))
    for t in np.linspace(0.003, 0.997, 331):
        assert value(pieces, t) == pytest.approx(function(t), abs=2e-9)


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=6), st.floats(-2.0, 2.0), st.floats(-1.0, 1.0))
def test_a_shifted_polynomial_is_the_same_function(coefficients, by, t):
    moved = shift(np.array(coefficients), by)
    expected = np.polynomial.polynomial.polyval(t + by, coefficients)
    assert np.polynomial.polynomial.polyval(t, moved) == pytest.approx(expected, abs=1e-9)


def test_signals_that_cannot_be_are_refused():
    for build, message in (
        (lambda: pt.ramp(0.0, -1.0, 2.0), "duration = -1.0 s, permitted: >= 0"),
        (lambda: pt.ramp(0.0, 1.0, np.nan), "permitted: finite"),
        (lambda: pt.hybrid.signals.PiecewiseLinear((1.0, 0.0), (0.0, 0.0)), "times not decreasing"),
        (lambda: pt.hybrid.signals.PiecewiseLinear((1.0,), (0.0, 0.0)), "1 times and 2 values"),
    ):
        with pytest.raises(pt.PowertrainError, match=message):
            build()


@pytest.mark.parametrize("timepts", [[0.0, 1.0], [0.0, 0.5, 1.0], np.linspace(0.0, 1.0, 101)])
def test_a_function_that_differs_at_each_call_is_refused_in_the_end(timepts):
    noise = np.random.default_rng(5)
    car = pt.Driveline(pt.Inertia("a", J=1.0))
    with pytest.raises(pt.SignalError, match=r'input "a_torque" changes at every instant near t = .* as samples'):
        pt.simulate(car, timepts, {"a_torque": lambda t: noise.normal()})


def test_a_function_is_followed_at_late_times_as_closely_as_times_are_told_apart():
    start = 2.0**29  # neighbouring times are 1.2e-7 s apart
    car = pt.Driveline(pt.Inertia("a", J=1.0))
    jump = start + 0.3
    response = pt.simulate(car, [start, start + 1.0], {"a_torque": lambda t: 2.0 * (t >= jump)})
    assert response["a_speed"][-1] == pytest.approx(2.0 * 0.7, abs=4e-6)


def test_samples_with_time_stamps_are_joined_held_outside_and_jump_where_a_time_is_given_twice():
    signal = pt.samples([0.0, 0.1, 0.1, 0.4], [0.0, 50.0, 80.0, 20.0])
    assert signal(np.array([-1.0, 0.05, 0.1, 0.25, 9.0])).tolist() == pytest.approx([0.0, 25.0, 80.0, 50.0, 20.0])
    # of one body of 2 kg m^2 the integral: 2.5, 15 and 0.6 s of 20 N m
    body = pt.Driveline(pt.Inertia("a", J=2.0))
    response = pt.simulate(body, [0.0, 0.1, 0.4, 1.0], {"a_torque": signal})
    np.testing.assert_allclose(response["a_speed"], [0.0, 1.25, 8.75, 14.75], rtol=1e-14)
    assert response["a_torque"][1] == 80.0  # behind the jump
    assert pt.samples([3.0], [7.0])(np.array([0.0, 3.0, 9.0])).tolist() == [7.0, 7.0, 7.0]


@pytest.mark.parametrize(
    ("t", "values", "message"),
    [
        ([0.0, 0.2, 0.1], [1.0, 2.0, 3.0], "t goes from 0.2 s back to 0.1 s, permitted: not decreasing"),
        ([0.0, np.nan, 0.1], [1.0, 2.0, 3.0], "t is nan at sample 1, permitted: finite"),
        ([0.0, np.inf], [1.0, 2.0], "t is inf at sample 1, permitted: finite"),
        ([0.0, 0.1], [1.0, np.nan], "the signal is nan at t = 0.1 s, permitted: finite"),
        ([0.0, 0.1, 0.2], [1.0, 2.0], "t of shape (3,), values of shape (2,), permitted: (N,) both, N >= 1"),
        ([], [], "t of shape (0,), values of shape (0,), permitted: (N,) both, N >= 1"),
    ],
)
def test_samples_that_cannot_be_are_refused(t, values, message):
    with pytest.raises(pt.SignalError) as error:
        pt.samples(t, values)
    assert str(error.value) == message
