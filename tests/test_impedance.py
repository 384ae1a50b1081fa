"""Networks of rows (linear/leaves, linear/impedance): trees, loops, many variants, and the matrices solved instead."""

import numpy as np
import pytest

from powertrain_ctrl.linear import impedance, leaves
from powertrain_ctrl.linear.impedance import Impedance, Network

# Four coordinates: springs in a loop with a ratio in it, one over three of them, two side by side, a pair of inertias.
ROWS = [
    {0: 1.0, 1: -1.0},
    {1: 1.0, 2: -2.5},
    {2: 1.0, 3: -1.0},
    {3: 1.0, 0: -0.4},
    {0: 1.0, 1: 1.0, 3: -2.0},
    {2: 2.0, 3: -2.0},
    {0: 1.0},
    {1: 1.0},
    {2: 1.0, 3: 0.5},
    {3: 1.0},
]
VALUES = [
    *(
        Impedance(k, d)
        for k, d in [(900.0, 1.0), (400.0, 0.0), (250.0 + 5j, 0.3), (70.0, 2.0), (30.0, 0.1), (90.0, 0.0)]
    ),
    *(Impedance(inertia=J) for J in (0.2, 0.05, 0.3, 0.1)),
]
OMEGA = np.geomspace(1.0, 300.0, 9)


def solved(rows, values, loads, omega):
    """Motions and twists from the sum of all impedances as one matrix."""
    A, b = np.zeros((len(omega), 4, 4), dtype=complex), np.zeros((len(omega), 4), dtype=complex)
    for row, value in zip(rows, values, strict=True):
        f = np.array([row.get(j, 0.0) for j in range(4)])
        z = value.stiffness + 1j * omega * value.damping - omega**2 * value.inertia
        A += z[:, None, None] * np.outer(f, f)
    for j, load in loads.items():
        b[:, j] = load
    x = np.linalg.solve(A, b[..., None])[..., 0]
    return x, [sum(f * x[:, j] for j, f in row.items()) for row in rows]


def assert_agrees(found, x, twists, tolerance):
    for j in range(4):
        np.testing.assert_allclose(found.motion[j], x[:, j], rtol=tolerance)
    for c, twist in enumerate(twists):
        np.testing.assert_allclose(found.twist[c], twist, rtol=tolerance)


@pytest.mark.parametrize("loads", [{0: 1.0}, {3: 2j, 1: 1.0}, {2: OMEGA * 1j, 0: -1.0}])
def test_a_network_with_loops_ratios_and_rows_over_three_coordinates_is_solved(loads):
    found = Network(ROWS, 4).steady(VALUES, loads, OMEGA, range(4), range(len(ROWS)))
    assert_agrees(found, *solved(ROWS, VALUES, loads, OMEGA), 1e-11)


@pytest.mark.parametrize("limit", ["rows", "pivots"])
def test_where_rows_are_too_many_or_pivots_small_the_matrix_is_solved_in_blocks(limit, monkeypatch):
    if limit == "rows":
        monkeypatch.setattr(leaves, "MOST_ROWS", 0)
    else:
        monkeypatch.setattr(impedance, "SMALL_PIVOT", 2.0)
    monkeypatch.setattr(impedance, "CHUNK", 50)
    found = Network(ROWS, 4).steady(VALUES, {1: 1.0, 2: 1j}, OMEGA, range(4), range(len(ROWS)))
    assert_agrees(found, *solved(ROWS, VALUES, {1: 1.0, 2: 1j}, OMEGA), 1e-13)


@pytest.mark.parametrize("most", [12, 0])
def test_variants_with_stiffness_damping_inertia_and_ratio_of_their_own_are_solved_at_once(most, monkeypatch):
    monkeypatch.setattr(leaves, "MOST_ROWS", most)
    factor = np.array([1.0, 0.7, 1.3])
    rows = [{j: f * factor if c == 1 and j == 2 else f for j, f in row.items()} for c, row in enumerate(ROWS)]
    values = [Impedance(v.stiffness * factor, v.damping * factor, v.inertia / factor) for v in VALUES]
    found = Network(rows, 4).steady(values, {0: 1.0}, OMEGA[:, None], range(4), range(len(rows)))
    for i in range(3):
        of_one = [{j: f[i] if np.ndim(f) else f for j, f in row.items()} for row in rows]
        x, twists = solved(of_one, [Impedance(*(part[i] for part in v)) for v in values], {0: 1.0}, OMEGA)
        for j in range(4):
            np.testing.assert_allclose(found.motion[j][:, i], x[:, j], rtol=1e-11)
        for c, twist in enumerate(twists):
            np.testing.assert_allclose(found.twist[c][:, i], twist, rtol=1e-11)


def test_a_ratio_that_closes_a_loop_without_play_in_one_variant_only_is_kept_for_all():
    # two springs side by side whose rows are multiples of each other in the first variant alone
    rows = [{0: 1.0, 1: -2.0}, {0: 1.0, 1: np.array([-2.0, -3.0])}, {0: 1.0}, {1: 1.0}]
    values = [Impedance(100.0), Impedance(50.0), Impedance(inertia=0.2), Impedance(inertia=1.0)]
    found = Network(rows, 2).steady(values, {0: 1.0}, OMEGA[:, None], [0, 1], [0, 1])
    for i, ratio in enumerate((-2.0, -3.0)):
        A = np.zeros((len(OMEGA), 2, 2))
        for f, z in (
            ([1.0, -2.0], 100.0),
            ([1.0, ratio], 50.0),
            ([1.0, 0.0], -0.2 * OMEGA**2),
            ([0.0, 1.0], -(OMEGA**2)),
        ):
            A += np.outer(f, f) * np.broadcast_to(z, OMEGA.shape)[:, None, None]
        x = np.linalg.solve(A, np.broadcast_to([[1.0], [0.0]], (len(OMEGA), 2, 1)))[..., 0]
        np.testing.assert_allclose(found.motion[1][:, i], x[:, 1], rtol=1e-12)
        np.testing.assert_allclose(found.twist[1][:, i], x[:, 0] + ratio * x[:, 1], rtol=1e-11)


def test_a_tree_is_eliminated_from_its_leaves_one_row_at_a_time_and_its_load_last():
    plan = Network([{0: 1.0, 1: -1.0}, {1: 1.0, 2: -1.0}, {1: 1.0, 3: -1.0}, {3: 1.0, 4: -1.0}, {5: 1.0}], 6).plan([1])
    assert [step.coordinate for step in plan.steps][-1] == 1
    assert {step.coordinate for step in plan.steps} == {0, 1, 2, 3, 4}
    assert all(len(step.rows) <= 1 and step.safe for step in plan.steps)
