"""Homogeneous linear relations between node speeds, solved by sparse elimination.

Gears, locked clutches and springs taken as rigid all say ``sum(coefficient * speed) = 0``. Each such row expresses one
speed by the others. For gear trains and trees the coefficients that come out are plain products and quotients of
ratios, so rank, rigid motions and redundancy are decided without a tolerance on stiffness or inertia.

A coefficient may be an array with the values of many variants of a driveline; then each decision must be the same for all
of them (`agreed`).
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache, reduce
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array

# A sum that is this much smaller than its terms has cancelled: ratios carry rounding of a few eps.
CANCELLED = 1e-10
# A coefficient below this part of the largest one of its row is rounding: to divide by it would make that large.
NEGLIGIBLE = 1e-9
# Entries from which on it pays to leave out those that are zero.
LARGE = 100**2
# Eliminations that are kept, of drivelines of so many nodes at most: of those whose ratios are the same, one serves all.
KEPT, SMALL = 64, 1000


class Mixed(Exception):
    """Variants that go different ways: ``takes`` says for each whether it takes the first one."""

    def __init__(self, takes: np.ndarray):
        super().__init__("variants differ in structure")
        self.takes = takes


def agreed(decision: Any) -> bool:
    """A decision, or that which all variants share.

    >>> agreed(np.array([2.0, 3.0]) > 1.0), agreed(0.5 > 1.0)
    (True, False)
    """
    if isinstance(decision, np.ndarray):
        first = bool(decision.flat[0])
        if (decision != first).any():
            raise Mixed(decision)
        return first
    return bool(decision)


class Elimination(NamedTuple):
    """Every column as a combination of the independent ones; not to be changed, for it may serve many."""

    independent: list[str]
    expressions: dict[str, dict[str, float]]
    used_rows: list[int]
    standstill_row: int | None

    def basis(self, columns: Sequence[str]) -> np.ndarray:
        """Matrix (columns, independent) of the expressions."""
        position = {name: j for j, name in enumerate(self.independent)}
        T = np.zeros((len(columns), len(self.independent)))
        for i, column in enumerate(columns):
            for name, value in self.expressions[column].items():
                T[i, position[name]] = value
        return T


def eliminate(rows: Iterable[Mapping[str, float]], columns: Sequence[str]) -> Elimination:
    """Solve the homogeneous rows; columns late in the order are expressed by early ones.

    Parameters
    ----------
    rows : iterable of mappings
        Column to coefficient, a number or (variants,) ndarray.
    columns : sequence of str
        Names in order of preference: the first ones stay independent where possible.

    Returns
    -------
    Elimination
        ``used_rows`` are the indices of the rows that were not redundant; ``standstill_row`` is the first row
        that brings two or more moving columns to rest, None if there is none.

    Raises
    ------
    Mixed
        Variants that differ in what cancels or depends on what.

    Examples
    --------
    >>> gear = eliminate([{"a": 1.0, "b": -2.0}], ["a", "b"])
    >>> gear.independent, gear.expressions["b"]
    (['a'], {'a': 0.5})
    """
    rows = list(rows)
    if len(columns) > SMALL or any(np.ndarray in map(type, row.values()) for row in rows):
        return _eliminated(rows, columns)
    return _known(tuple([tuple(row.items()) for row in rows]), tuple(columns))


@lru_cache(maxsize=KEPT)
def _known(rows: tuple[tuple[tuple[str, float], ...], ...], columns: tuple[str, ...]) -> Elimination:
    return _eliminated(map(dict, rows), columns)


def _eliminated(rows: Iterable[Mapping[str, Any]], columns: Sequence[str]) -> Elimination:
    order = {name: i for i, name in enumerate(columns)}
    expressions = {name: {name: 1.0} for name in columns}
    users = {name: {name} for name in columns}
    used_rows: list[int] = []
    standstill_row = None
    for index, row in enumerate(rows):
        reduced = combined(row, expressions)
        if not reduced:
            continue
        used_rows.append(index)
        if len(reduced) == 1 and standstill_row is None and sum(bool(expressions[column]) for column in row) > 1:
            standstill_row = index
        pivot = _pivot(reduced, order)
        scale = -reduced.pop(pivot)
        replacement = {name: value / scale for name, value in reduced.items()}
        for name in users.pop(pivot):
            expression = expressions[name]
            factor = expression.pop(pivot)
            for other, value in replacement.items():
                added = factor * value
                if other not in expression:
                    expression[other] = added
                    users[other].add(name)
                    continue
                before = expression[other]
                if agreed(abs(before + added) <= CANCELLED * (abs(before) + abs(added))):
                    del expression[other]
                    users[other].discard(name)
                else:
                    expression[other] = before + added
    return Elimination([name for name in columns if name in users], expressions, used_rows, standstill_row)


def _pivot(row: Mapping[str, Any], order: Mapping[str, int]) -> str:
    """The last column of a row, of those whose coefficient is not negligible."""
    sizes = {name: abs(value) for name, value in row.items()}
    is_batch = np.ndarray in map(type, sizes.values())
    least = NEGLIGIBLE * (reduce(np.maximum, sizes.values()) if is_batch else max(sizes.values()))
    for name in sorted(row, key=order.__getitem__, reverse=True):
        if agreed(sizes[name] > least):
            return name
    raise AssertionError("the largest is not negligible")


def combined(row: Mapping[str, Any], expressions: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """A combination of columns in the independent ones, without what cancels."""
    total: dict[str, Any] = {}
    size: dict[str, Any] = {}
    for column, coefficient in row.items():
        for name, value in expressions[column].items():
            term = coefficient * value
            if name in total:
                size[name] = size.get(name, abs(total[name])) + abs(term)
                total[name] = total[name] + term
            else:
                total[name] = term
    for name, terms in size.items():
        if not agreed(abs(total[name]) > CANCELLED * terms):
            del total[name]
    return total


def times(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """``A @ B``; of large matrices without the zeros of A, of which those of long drivelines are full."""
    return A @ B if A.size < LARGE else csr_array(A) @ B


def product(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """``A @ B``, exactly 0 where its terms cancel: ratios carry rounding.

    >>> third = 1.0 / 3.0
    >>> product(np.array([[1.0, -third]]), np.array([[0.1 * third], [0.1]]))
    array([[0.]])
    """
    result = times(A, B)
    # Only small entries are compared with their terms, which keeps this cheap.
    largest = np.abs(A).sum(axis=1, keepdims=True) * np.abs(B).max(initial=0.0)
    i, j = np.nonzero((result != 0.0) & (np.abs(result) <= CANCELLED * largest))
    if not len(i):
        return result
    terms = np.einsum("ck,kc->c", np.abs(A[i]), np.abs(B[:, j]))
    cancelled = np.abs(result[i, j]) <= CANCELLED * terms
    result[i[cancelled], j[cancelled]] = 0.0
    return result
