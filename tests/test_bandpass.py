"""The band-pass without phase against scipy's filter run forward and backward over signals continued for long."""

import numpy as np
import pytest
import scipy.signal

from powertrain_ctrl.hybrid.bandpass import band_passed


@pytest.mark.parametrize("dt", [0.001, 0.004, 0.02])
@pytest.mark.parametrize("count", [2, 63, 64, 65, 1000])
def test_it_is_the_filter_run_both_ways_over_a_signal_that_stays_at_its_ends(dt, count):
    signals = np.random.default_rng(0).standard_normal((3, count)).cumsum(axis=1) + 5.0
    sections = scipy.signal.butter(2, (1.0, 10.0), btype="bandpass", fs=1.0 / dt, output="sos")
    more = int(12.0 / dt)  # after which the slowest pole of the filter has left less than 1e-15
    longer = np.pad(signals, ((0, 0), (more, more)), mode="edge")
    expected = scipy.signal.sosfiltfilt(sections, longer, padtype=None)[:, more : more + count]
    np.testing.assert_allclose(band_passed(signals, dt, 2, (1.0, 10.0)), expected, atol=1e-10 * np.abs(signals).max())


def test_no_signal_depends_on_the_others():
    signals = np.random.default_rng(1).standard_normal((7, 300))
    together = band_passed(signals, 0.001, 2, (1.0, 10.0))
    for i in range(7):
        assert band_passed(signals[i : i + 1], 0.001, 2, (1.0, 10.0)).tobytes() == together[i].tobytes()
