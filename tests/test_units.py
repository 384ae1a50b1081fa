"""Units are converted at the door and nowhere else."""

import numpy as np
import pytest

from powertrain_ctrl.base.units import kmh, rpm, to_hz, to_rpm


def test_a_turn_is_two_pi_and_a_minute_sixty_seconds():
    assert rpm(60.0) == pytest.approx(2.0 * np.pi, rel=1e-15)
    assert to_hz(2.0 * np.pi) == pytest.approx(1.0, rel=1e-15)
    assert kmh(3.6) == pytest.approx(1.0, rel=1e-15)


def test_there_and_back_is_the_same_for_numbers_and_arrays():
    for speed in (5000.0, np.array([0.0, -750.0, 6500.0])):
        np.testing.assert_allclose(to_rpm(rpm(speed)), speed, rtol=1e-15)
