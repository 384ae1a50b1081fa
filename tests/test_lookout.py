"""Guards along a trajectory by sums of exponentials and by its coordinates."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_propagation import dissipative

from powertrain_ctrl.hybrid.flow import EARLY, Flow
from powertrain_ctrl.hybrid.lookout import Lookout
from powertrain_ctrl.hybrid.matrices import Watch


def lookout(seed, sums):
    """Three guards on a random motion that begins with forces along straight lines, and perhaps on its integrals."""
    random, flow = np.random.default_rng(seed), Flow(dissipative(seed))
    n = len(flow.A)
    rows, on_integrals = random.normal(size=(2, 3, n))
    on_flow, behind = flow.rows(rows), flow.rows(on_integrals)
    watch = Watch(on_flow, behind if sums else None, np.zeros((3, n)), flow.weights(on_flow), flow.weights(behind))
    trajectory = flow.trajectory(random.normal(size=n), 30.0 * random.normal(size=(n, 2)))
    lines = random.normal(size=(3, 2))
    return Lookout(watch, trajectory, lines, abs(lines)), rows, on_integrals * sums, lines


@given(st.integers(0, 10**6), st.booleans())
@settings(max_examples=25)
def test_values_and_slopes_are_those_of_the_motion_whatever_the_way_they_are_found(seed, sums):
    guards, rows, on_integrals, lines = lookout(seed, sums)
    flow, trajectory = guards.trajectory.flow, guards.trajectory
    assert trajectory.is_closed == (not flow.slow.size)
    t = np.sort(np.random.default_rng(seed).uniform(0.1, 3.0, 5)) * EARLY / flow.fastest
    for times in (t, 300.0 * t):
        x, integral = trajectory.state(times), trajectory.state(times, integrals=1)
        # x' by the equation of motion, the forces from the modal ones
        rate = flow.A @ x + (flow.V @ (trajectory.beta @ [np.ones_like(times), times])).real
        look = guards(times, float(times[-1]))
        value = rows @ x + on_integrals @ integral + lines @ [np.ones_like(times), times]
        slope = rows @ rate + on_integrals @ x + lines[:, 1:]
        np.testing.assert_allclose(look.value, value, rtol=0, atol=1e-11 * look.size.max())
        np.testing.assert_allclose(look.slope, slope, rtol=0, atol=1e-11 * abs(slope).max())
        assert (look.size >= abs(value) * (1.0 - 1e-12)).all()


@given(st.integers(0, 10**6), st.booleans())
@settings(max_examples=25)
def test_no_guard_bends_more_than_its_bound(seed, sums):
    guards, *_ = lookout(seed, sums)
    for begin in (0.0, 0.02):
        bound = guards(np.array([begin]), begin + 0.3).bend[:, 0]
        t = np.linspace(begin, begin + 0.3, 4001)
        slopes = np.concatenate([guards(t[i : i + 1], 1.0).slope for i in range(0, len(t), 100)], axis=1)
        bends = abs(np.diff(slopes, axis=1)) / (t[100] - t[0])
        assert (bends.max(axis=1) <= bound * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("sums", [False, True])
def test_far_from_the_start_the_bound_is_that_of_what_is_left(sums):
    # all motions but the rigid ones and what the forces drive have decayed; lines bend no guard
    flow = Flow(np.diag([-50.0, -80.0]))
    on_flow = flow.rows(np.eye(2))
    watch = Watch(on_flow, on_flow if sums else None, np.zeros((2, 2)), flow.weights(on_flow), flow.weights(on_flow))
    guards = Lookout(watch, flow.trajectory(np.ones(2), np.ones((2, 2))), np.zeros((2, 2)), np.zeros((2, 2)))
    driven = np.array([1.0 / 50.0, 1.0 / 80.0]) if sums else 0.0  # the integral of a ramp bends
    np.testing.assert_allclose(guards(np.array([2.0]), 9.0).bend[:, 0], driven, atol=1e-12)
