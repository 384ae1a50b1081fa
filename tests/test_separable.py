"""What information tells apart, and in which words, on matrices made by hand."""

import numpy as np
import pytest

from powertrain_ctrl.identification.separable import analysed, in_words


def information(errors, correlation):
    """Of unknowns with these standard errors and correlations."""
    errors = np.array(errors)
    return np.linalg.inv(np.outer(errors, errors) * correlation)


def matrix(r):
    return np.array([[1.0, r], [r, 1.0]])


@pytest.mark.parametrize(
    ("r", "errors", "apart"), [(-0.97, (0.3, 0.3), True), (-0.999, (0.3, 0.3), False), (0.999, (0.01, 0.02), True)]
)
def test_two_are_told_apart_unless_they_go_together_and_one_is_vague(r, errors, apart):
    found = analysed(information(errors, matrix(r)), 2, 2)
    assert found.groups == (() if apart else ((0, 1),))
    np.testing.assert_allclose(found.correlation, matrix(r), rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), errors, rtol=1e-9)


def test_a_direction_that_nothing_sees_is_a_group_and_leaves_the_others_their_errors():
    # two unknowns only as their sum, a third by itself, with errors of 1 and 2 %
    J = np.array([[100.0, 100.0, 0.0], [0.0, 0.0, 50.0]])
    found = analysed(J.T @ J, 3, 3)
    assert found.groups == ((0, 1),)
    assert found.correlation[0, 1] == -1.0
    assert np.sqrt(found.covariance[2, 2]) == pytest.approx(0.02)
    assert in_words(found, ["a.k", "b.k", "c.k"], {(0, 1): "measure x too"}) == (
        "a.k and b.k: correlation -1.00, not told apart by what was measured; measure x too",
    )


def test_what_nothing_depends_on_or_is_known_to_no_better_than_half_is_unknown():
    found = analysed(np.diag([1e4, 0.0, 1.0 / 0.8**2]), 3, 3)
    assert found.unknown == (1, 2)
    said = in_words(found, ["a", "b", "c"], {})
    assert said[0] == "b: not determined by what was measured, nothing measured depends on it; hold it"
    assert said[1].startswith("c: not determined by what was measured, standard error 80 % of its value")


def test_what_is_held_is_taken_as_known_and_what_is_not_named_is_taken_out():
    full = information((0.01, 0.02, 0.03), np.array([[1.0, 0.5, 0.2], [0.5, 1.0, 0.1], [0.2, 0.1, 1.0]]))
    found = analysed(full, 2, 2, held=(1,))
    # of the first with the second known, the third not
    left = np.linalg.inv(full[np.ix_([0, 2], [0, 2])])[0, 0]
    assert found.covariance.shape == (2, 2)
    assert found.covariance[0, 0] == pytest.approx(left)
    assert found.unknown == ()
    assert found.lost == set()
