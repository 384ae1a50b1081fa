"""Roots of damped modes that lie decades apart, against determinants of many digits."""

import mpmath as mp
import numpy as np
import pytest

from powertrain_ctrl.linear.quadratic import SMALL, damped_poles


def largest_correction(omega, dampers, poles):
    """Of one step of Newton's method from each pole, relative to it."""
    with mp.workdps(80):
        factor = mp.matrix(dampers.tolist())
        Delta, Omega = factor.T * factor, mp.diag([mp.mpf(w) ** 2 for w in omega])

        def determinant(s):
            return mp.det(s**2 * mp.eye(len(omega)) + s * Delta + Omega)

        steps = []
        for pole in poles:
            s, h = mp.mpc(pole.real, pole.imag), mp.mpf(10) ** -30
            value, ahead = determinant(s), determinant(s * (1 + h))
            steps.append(abs(value / (ahead - value) * h))
        return float(max(steps))


@pytest.mark.parametrize("seed", range(8))
def test_slow_roots_that_are_not_corrected_keep_their_digits_too(seed):
    rng = np.random.default_rng(seed)
    # five decades apart: none is so small that it is corrected by itself
    omega = np.sort(10.0 ** rng.uniform(0.0, 5.0, 6))
    dampers = rng.standard_normal((6, 6)) * np.sqrt(0.05 * omega)
    poles = damped_poles(omega, dampers)
    assert np.abs(poles).min() > SMALL * np.abs(poles).max()
    assert largest_correction(omega, dampers, poles) < 1e-13
