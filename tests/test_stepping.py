"""Exact steps of many systems against mpmath and scipy's integrator."""

from itertools import pairwise

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from powertrain_ctrl.linear.stepping import evenly_stepped, exponential, forced, pulsed


def systems(count=3, n=4, seed=0):
    """Systems whose motion dies out, and a load on each."""
    random = np.random.default_rng(seed)
    A = random.standard_normal((count, n, n)) * 5.0
    return A - np.swapaxes(A, 1, 2) - np.eye(n), random.standard_normal((count, n))


def test_the_exponential_of_matrices_of_all_sizes_is_exact():
    random = np.random.default_rng(0)
    A = random.standard_normal((4, 5, 5)) * np.array([1e-3, 1.0, 30.0, 0.0])[:, None, None]
    A = A - np.swapaxes(A, 1, 2) - np.eye(5)
    for found, matrix in zip(exponential(A), A, strict=True):
        with mpmath.workdps(40):
            expected = np.array(mpmath.expm(mpmath.matrix(matrix.tolist()), method="taylor").tolist(), dtype=float)
        np.testing.assert_allclose(found, expected, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize("count", [1, 2, 3, 8, 9, 100])
def test_doubling_is_stepping_one_by_one(count):
    A, start = systems()
    step = exponential(0.01 * A)
    found = evenly_stepped(step, start, count)
    state = start
    for k in range(count):
        np.testing.assert_allclose(found[:, :, k], state, atol=1e-13)
        state = (step @ state[..., None])[..., 0]


@pytest.mark.parametrize(
    "times",
    [np.linspace(0.0, 2.0, 41), np.linspace(0.0, 2.0, 30), np.array([0.0, 0.3, 0.35, 1.0, 1.013, 2.0])],
    ids=["corners on the grid", "corners between", "uneven"],
)
def test_states_under_a_ramp_are_those_of_the_integrator(times):
    A, b = systems()
    start = np.ones((3, 4))
    edges, lines = np.array([0.0, 0.5, 1.0, 2.0]), np.array([[2.0, 0.0], [2.0, 4.0], [4.0, -1.0]])

    def load(t):
        i = min(int(np.searchsorted(edges, t, side="right")) - 1, 2)
        return lines[i, 0] + lines[i, 1] * (t - edges[i])

    found = forced(A, b, start, edges, lines, times)
    for v in range(3):
        pieces, state = [start[v][:, None]], start[v]
        for begin, end in pairwise(edges):
            there = times[(times > begin) & (times <= end)]
            run = solve_ivp(
                lambda t, x, v=v: A[v] @ x + b[v] * load(np.clip(t, begin, end - 1e-12)),  # noqa: B023
                (begin, end),
                state,
                "DOP853",
                np.union1d(there, end),
                rtol=1e-12,
                atol=1e-13,
            )
            pieces.append(run.y[:, : len(there)])
            state = run.y[:, -1]
        np.testing.assert_allclose(found[v, :4], np.hstack(pieces), atol=1e-9)


@pytest.mark.parametrize("start", [0.5, 0.513])
def test_a_half_sine_moves_as_the_integrator_says(start):
    A, g = systems(2)
    times, peaks, length = np.linspace(0.0, 1.5, 61), np.array([3.0, -1.0]), 0.2
    found = pulsed(A, g, peaks, start, length, times)
    for v in range(2):
        run = solve_ivp(
            lambda t, x, v=v: (
                A[v] @ x + g[v] * peaks[v] * np.sin(np.pi * (t - start) / length) * (start < t < start + length)
            ),
            (0.0, 1.5),
            np.zeros(4),
            "DOP853",
            times,
            rtol=1e-11,
            atol=1e-12,
            max_step=0.005,
        )
        np.testing.assert_allclose(found[v, :4], run.y, atol=1e-7)
