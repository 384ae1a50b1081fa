"""Exact flows against matrix exponentials and solve_ivp.

Of hybrid/flow.
"""

import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from powertrain_ctrl.hybrid.flow import DenseTrajectory, Flow, ModalTrajectory, exponentials, value_at


def dissipative(seed, n=5, zeros=1):
    """Oscillators with dampers in energy coordinates and some rigid motion."""
    random = np.random.default_rng(seed)
    H = random.normal(size=(n - zeros, n)) * 10.0 ** random.uniform(0.0, 2.0)
    R = random.normal(size=(n - zeros, n - zeros)) * 0.3
    damper = R @ H / np.linalg.norm(H)
    r = n - zeros
    return np.block([[np.zeros((r, r)), H], [-H.T, -damper.T @ damper]])


@given(st.integers(0, 10**6), st.sampled_from([2, 4]))
@settings(max_examples=30)
def test_both_flows_are_the_same_motion_and_have_the_same_integrals(seed, degree):
    A = dissipative(seed)
    random = np.random.default_rng(seed + 1)
    x0, b = random.normal(size=len(A)), random.normal(size=(len(A), degree))
    t = np.array([0.0, 1e-6, 0.013, 0.5])
    flow = Flow(A)
    assert flow.is_modal
    modal, dense = ModalTrajectory(flow, x0, b), DenseTrajectory(flow, x0, b)
    for integrals in (0, 1, 2):
        np.testing.assert_allclose(modal.state(t, integrals), dense.state(t, integrals), atol=1e-10)


@given(st.integers(0, 10**6))
@settings(max_examples=10)
def test_flow_is_that_of_solve_ivp(seed):
    A = dissipative(seed, n=3)
    random = np.random.default_rng(seed + 2)
    x0, b = random.normal(size=len(A)), random.normal(size=(len(A), 3))
    t = np.array([0.1, 0.2])
    expected = scipy.integrate.solve_ivp(
        lambda t, x: A @ x + b @ t ** np.arange(3), (0.0, 0.2), x0, "DOP853", t, rtol=1e-11, atol=1e-12
    ).y
    np.testing.assert_allclose(Flow(A).trajectory(x0, b).state(t), expected, atol=1e-8)


@pytest.mark.parametrize("gap", [0.0, 1e-14, 1e-12])
def test_equal_poles_go_by_the_matrix_exponential(gap):
    # (s + 5)^2, critically damped, and as good as critically damped
    A = np.array([[0.0, 5.0], [-5.0, -10.0 * (1.0 + gap)]])
    flow = Flow(A)
    assert not flow.is_modal
    x = flow.trajectory(np.array([1.0, 2.0]), np.zeros((2, 2))).state(np.array([0.3]))[:, 0]
    N = A + 5.0 * np.eye(2)
    np.testing.assert_allclose(x, np.exp(-1.5) * (np.eye(2) + 0.3 * N) @ [1.0, 2.0], atol=1e-10)


@given(st.integers(0, 10**6), st.floats(0.001, 1.0))
@settings(max_examples=30)
def test_no_functional_bends_more_than_its_bound(seed, until):
    A = dissipative(seed)
    random = np.random.default_rng(seed + 3)
    x0, b, rows = random.normal(size=len(A)), random.normal(size=(len(A), 4)), random.normal(size=(3, len(A)))
    for kind in (ModalTrajectory, DenseTrajectory):
        flow = Flow(A)
        trajectory = kind(flow, x0, b)
        on_y = flow.rows(rows) if kind is ModalTrajectory else rows
        now = np.zeros(1)
        second = trajectory.derivatives(now, 2)[2]
        bound = (trajectory.weights(on_y) @ trajectory.largest_second(second, now, until))[:, 0]
        bend = np.abs((on_y @ trajectory.derivatives(np.linspace(0.0, until, 101), 2)[2]).real)
        assert (bend.max(axis=1) <= bound * (1.0 + 1e-9)).all()


@pytest.mark.parametrize("kind", [ModalTrajectory, DenseTrajectory])
def test_the_bound_knows_an_input_that_bends_from_rest(kind):
    # x' = -x + t^2 from 0: x'' = 2 (1 - exp(-t)), nothing at first
    flow = Flow(np.array([[-1.0]]))
    trajectory = kind(flow, np.zeros(1), np.array([[0.0, 0.0, 1.0]]))
    on_y = flow.rows(np.ones((1, 1))) if kind is ModalTrajectory else np.ones((1, 1))
    now = np.zeros(1)
    bound = trajectory.weights(on_y) @ trajectory.largest_second(trajectory.derivatives(now, 2)[2], now, 0.5)
    assert bound[0, 0] >= 2.0 * (1.0 - np.exp(-0.5))


def test_exponentials_on_an_even_grid_are_those_one_by_one():
    rates = np.array([-0.3 + 40.0j, -2000.0, 0.0])
    t = 0.7 + 1e-3 * np.arange(5001)
    np.testing.assert_allclose(exponentials(rates, t), np.exp(rates[:, None] * t), rtol=1e-11, atol=1e-300)


def test_polynomials_by_rows():
    p = np.array([[1.0, 2.0, 3.0], [0.0, 0.0, -1.0]])
    np.testing.assert_allclose(value_at(p, np.array([0.0, 2.0])), [[1.0, 17.0], [0.0, -4.0]])


def test_what_is_not_connected_stays_at_rest_to_the_last_bit():
    one, other = dissipative(3), dissipative(4)
    n, random = len(one), np.random.default_rng(5)
    place = random.permutation(n + len(other))
    A = scipy.linalg.block_diag(one, other)[np.ix_(place, place)]
    x0 = np.where(place < n, random.normal(size=len(A)), 0.0)
    x = Flow(A).trajectory(x0, np.zeros((len(A), 2))).state(np.linspace(0.0, 1.0, 7))
    assert x[place < n].any()
    assert not x[place >= n].any()
