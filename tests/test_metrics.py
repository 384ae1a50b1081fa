"""Ride metrics against closed forms."""

import numpy as np
import pytest

import powertrain_ctrl as pt


@pytest.mark.parametrize("final", [1.0, -2.5])
def test_times_of_a_lag_are_those_of_the_exponential(final):
    t, T = np.linspace(0.0, 3.0, 30001), 0.1
    metrics = pt.ride_metrics(t, final * (1.0 - np.exp(-t / T)), final)
    assert metrics.t50 == pytest.approx(T * np.log(2.0), rel=1e-3)
    assert metrics.t90 == pytest.approx(T * np.log(10.0), rel=1e-3)
    assert metrics.t10_90 == pytest.approx(T * np.log(9.0), rel=1e-3)
    assert metrics.settling == pytest.approx(T * np.log(20.0), rel=1e-3)
    assert metrics.peak_jerk == pytest.approx(abs(final) / T, rel=1e-3)
    assert (metrics.overshoot, metrics.peak_to_peak) == (0.0, 0.0)


def test_what_is_felt_of_a_sine_in_the_middle_of_the_band_is_all_of_it():
    # gain 1 at the geometric mean of 1 and 10 Hz; 3/8 is the mean of the fourth power of a sine
    t, amplitude = np.linspace(0.0, 60.0, 60001), 0.7
    a = amplitude * np.sin(2.0 * np.pi * np.sqrt(10.0) * t)
    metrics = pt.ride_metrics(t, a, final=4.0)
    assert metrics.rms == pytest.approx(amplitude / np.sqrt(2.0), rel=0.01)
    assert metrics.vdv == pytest.approx(amplitude * (60.0 * 3.0 / 8.0) ** 0.25, rel=0.01)


def test_what_never_settles_takes_the_whole_window():
    t = np.linspace(0.0, 2.0, 2001)
    metrics = pt.ride_metrics(t, 0.5 * np.ones_like(t), final=1.0)
    assert metrics.settling == 2.0
    assert np.isnan(metrics.t90)
