"""Homogeneous relations between speeds, solved."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from powertrain_ctrl.driveline.kinematics import eliminate

COLUMNS = ["a", "b", "c", "d", "e", "f"]
rows = st.dictionaries(
    st.sampled_from(COLUMNS), st.sampled_from([-3.0, -1.0, 0.5, 1.0, 2.0, 6.0]), min_size=1, max_size=4
)


def dense(rows):
    return np.array([[row.get(column, 0.0) for column in COLUMNS] for row in rows]).reshape(len(rows), len(COLUMNS))


@given(st.lists(rows, max_size=7))
def test_the_basis_is_the_null_space_of_the_rows(rows):
    solved = eliminate(rows, COLUMNS)
    T, A = solved.basis(COLUMNS), dense(rows)
    rank = np.linalg.matrix_rank(A) if rows else 0
    assert len(solved.independent) == len(COLUMNS) - rank == (np.linalg.matrix_rank(T) if T.size else 0)
    np.testing.assert_allclose(A @ T, 0.0, atol=1e-12 * max(np.abs(T).max(initial=0.0), 1.0))
    # independent columns are themselves
    index = [COLUMNS.index(name) for name in solved.independent]
    np.testing.assert_array_equal(T[index], np.eye(len(index)))


@given(st.lists(rows, min_size=1, max_size=7))
def test_the_used_rows_are_independent_and_say_as_much_as_all(rows):
    used = eliminate(rows, COLUMNS).used_rows
    A = dense(rows)
    assert len(used) == np.linalg.matrix_rank(A) == np.linalg.matrix_rank(A[used])


def test_what_has_cancelled_can_still_be_solved_for():
    # x = p + q and q = r - p give x = r, in which p no longer stands when it comes to rest
    rows = [{"x": 1.0, "p": -1.0, "q": -1.0}, {"q": 1.0, "r": -1.0, "p": 1.0}, {"p": 1.0}]
    solved = eliminate(rows, ["p", "r", "q", "x"])
    assert solved.independent == ["r"]
    assert solved.expressions == {"p": {}, "r": {"r": 1.0}, "q": {"r": 1.0}, "x": {"r": 1.0}}


def test_cars_of_the_same_ratios_share_what_was_solved_and_others_do_not():
    gear = [{"a": 1.0, "b": -2.0}, {"b": 1.0, "c": -4.0}]
    first, again = eliminate(gear, "abc"), eliminate([dict(row) for row in gear], ["a", "b", "c"])
    assert first is again
    assert first.expressions == {"a": {"a": 1.0}, "b": {"a": 0.5}, "c": {"a": 0.125}}
    assert eliminate([gear[0], {"b": 1.0, "c": -8.0}], "abc").expressions["c"] == {"a": 0.0625}
    assert eliminate(gear, "cba").expressions == {"c": {"c": 1.0}, "b": {"c": 4.0}, "a": {"c": 8.0}}
    many = eliminate([{"a": np.ones(2), "b": -np.array([2.0, 4.0])}], "ab")
    np.testing.assert_array_equal(many.expressions["b"]["a"], [0.5, 0.25])
