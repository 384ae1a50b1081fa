"""Null spaces and products of what is held, without what rounding would add."""

import numpy as np

from powertrain_ctrl.hybrid.matrices import null_basis, without_rounding


def test_a_basis_of_what_is_not_held_does_not_mix_what_is_not_connected():
    held = np.zeros((6, 2))
    held[[0, 2], 0] = 3.0, -4.0
    held[[3, 5], 1] = 1.0, 1.0
    basis = null_basis(held)
    assert basis.shape == (6, 4)
    np.testing.assert_allclose(basis.T @ basis, np.eye(4), atol=1e-15)
    np.testing.assert_allclose(held.T @ basis, 0.0, atol=1e-15)
    parts = [{int(i) for i in np.flatnonzero(column)} for column in basis.T]
    assert sorted(map(sorted, parts)) == [[0, 2], [1], [3, 5], [4]]


def test_columns_that_say_the_same_hold_once():
    held = np.array([[1.0, 2.0], [-1.0, -2.0], [0.0, 0.0]])
    assert null_basis(held).shape == (3, 2)
    assert null_basis(held[:, :0]).shape == (3, 3)


def test_what_cancels_in_a_product_is_exactly_zero():
    third = 1.0 / 3.0
    left = np.array([[0.1, 0.2, -0.3]])
    right = np.array([[1.0, third], [1.0, third], [1.0, third]])
    assert left.sum() != 0.0  # 5.6e-17 by rounding
    assert not without_rounding(left, right).any()
    np.testing.assert_array_equal(without_rounding(np.eye(2), np.diag([1e-30, 2.0])), np.diag([1e-30, 2.0]))
