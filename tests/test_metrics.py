"""Ride metrics against closed forms.

Of hybrid/bandpass too.
"""

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.metrics import REACHED


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


def test_what_never_leaves_the_band_has_settled_at_once():
    t = np.linspace(0.0, 2.0, 2001)
    metrics = pt.ride_metrics(t, 1.0 + 0.04 * np.cos(20.0 * t), final=1.0)
    assert metrics.settling == 0.0
    # it is there before the first sample could show when
    assert (metrics.t50, metrics.t90, metrics.t10_90) == (0.0, 0.0, 0.0)


def test_what_is_there_from_the_start_on_is_there_at_the_start_of_the_manoeuvre():
    t = np.linspace(1.0, 3.0, 2001)
    assert pt.ride_metrics(t, np.ones_like(t), final=1.0, start=1.5).t90 == pytest.approx(0.0, abs=1e-12)
    assert pt.ride_metrics(t, np.ones_like(t), final=1.0, start=0.9).t90 == pytest.approx(0.1)


@pytest.mark.parametrize(("short", "expected"), [(0.5 * REACHED, 0.9), (2.0 * REACHED, np.nan)])
def test_a_level_is_reached_but_for_rounding(short, expected):
    t = np.linspace(0.0, 2.0, 2001)
    a = np.minimum(t, 0.9 - short)  # it stays just below 90 %
    metrics = pt.ride_metrics(t, a, final=1.0)
    np.testing.assert_allclose(metrics.t90, expected, atol=1e-9)


@pytest.mark.parametrize(("beyond", "expected"), [(0.5 * REACHED, 0.0), (2.0 * REACHED, 1.001)])
def test_the_edge_of_the_band_is_inside_but_for_rounding(beyond, expected):
    t = np.linspace(0.0, 2.0, 2001)
    a = np.where(t <= 1.0, 1.05 + beyond, 1.0)
    assert pt.ride_metrics(t, a, final=1.0).settling == pytest.approx(expected)


@pytest.mark.parametrize(("higher", "expected"), [(0.5 * REACHED, 0.8), (2.0 * REACHED, 0.3)])
def test_of_peaks_equally_high_the_first_counts(higher, expected):
    # peaks of 1.3 at 0.5 s and 1.5 s, troughs of 0.5 at 1.0 s and 1.0 at 2 s
    t = np.linspace(0.0, 2.0, 2001)
    a = np.interp(t, [0.0, 0.5, 1.0, 1.5, 2.0], [0.0, 1.3, 0.5, 1.3 + higher, 1.0])
    assert pt.ride_metrics(t, a, final=1.0).peak_to_peak == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize(("late", "first"), [(1e-9, 0.5), (2e-3, 0.501)])
def test_a_sample_at_the_start_counts_but_for_rounding(late, first):
    """The acceleration is 1 in one sample, at 0.5 s, and 0 elsewhere; late in a long record rounding is larger."""
    t = 0.001 * np.arange(2000.0) + 1e5
    a = np.where(np.arange(2000) == 500, 1.0, 0.0)
    overshoot = pt.ride_metrics(t, 2.0 * a, final=1.0, start=1e5 + 0.5 + late * 0.001).overshoot
    assert overshoot == (1.0 if first == 0.5 else 0.0)


@pytest.mark.parametrize(("share", "permitted"), [(0.5e-6, True), (3e-6, False)])
def test_times_are_evenly_spaced_but_for_rounding(share, permitted):
    t = 0.001 * np.arange(1000.0)
    t[500:] += share * 0.001
    if permitted:
        assert pt.ride_metrics(t, np.ones_like(t), final=1.0).overshoot == 0.0
    else:
        with pytest.raises(pt.SignalError, match="evenly spaced"):
            pt.ride_metrics(t, np.ones_like(t), final=1.0)
