"""Rows of many variants at once: one structure, coefficients with a batch axis.

Elements state their rows by plain arithmetic on their values, so elements with arrays as values state rows of arrays. The
constraint rows are eliminated once for all variants. What they decide otherwise than others makes another structure.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np

from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
from ..driveline.kinematics import Mixed, agreed
from ..elements import ComplianceRow, ConstraintRow, Element, Gear, InertiaRow, Statement
from ..linear.solved import DEFINITE, SolvedRows, Value
from .variants import LOCKED, Variants, is_number, mark_of

T = TypeVar("T")

# Classes of elements, and their parameters, whose rows of arrays have been found to be those of single variants.
_AS_ARRAYS: set[tuple[type, frozenset[str]]] = set()
# Rows of arrays and those of single variants are the same to this part.
SAME = 1e-12


class Part(NamedTuple):
    """Variants of one structure, by their place among those given; without a stack they are to be computed one by one."""

    places: np.ndarray
    variants: Variants
    stack: Stack | None


def parts_of(variants: Variants) -> Iterator[Part]:
    """Variants by structure."""
    everyone = np.arange(len(variants))
    objects = [column for column in variants.values.values() if column.dtype == object]
    groups: dict[Any, list[int]] = {}
    for i in everyone.tolist() if objects else ():
        groups.setdefault(tuple(mark_of(column[i]) for column in objects), []).append(i)
    for places in map(np.array, groups.values()) if objects else [everyone]:
        yield from _split(variants.part(places), places)


def _split(variants: Variants, places: np.ndarray) -> Iterator[Part]:
    try:
        yield Part(places, variants, _stack(variants))
    except Mixed as mixed:
        takes = mixed.takes.astype(bool)
        for chosen in (takes, ~takes):
            yield from _split(variants.part(chosen), places[chosen])


def _stack(variants: Variants) -> Stack | None:
    """Stack of variants of one structure; None where it is not a linear driveline whose coordinates all have inertia."""
    is_nominal = all(column.dtype != object for column in variants.values.values())
    car = variants.car if is_nominal else variants.car_of(0)
    if any(each.couplings or not all(law.is_clutch for law in each.laws) for each in car.stated):
        return None
    if not all([agreed(column == 1.0) for column in _efficiencies(car, variants)]):
        return None
    stack = Stack(car, variants)
    return stack if stack.has_inertia else None


def _efficiencies(car: Driveline, variants: Variants) -> list[np.ndarray]:
    """Those of gears that differ: without loss in the nominal car, they may have one in others."""
    named = ((name.partition("."), column) for name, column in variants.values.items())
    return [column for (key, _, parameter), column in named if parameter == "efficiency" and isinstance(car[key], Gear)]


def one_by_one(variants: Variants, compute: Callable[[Driveline], T]) -> list[T]:
    """What is computed of each variant by itself; an error names the variant."""
    results = []
    for i in range(len(variants)):
        car = variants.car_of(i)
        try:
            results.append(compute(car))
        except PowertrainError as error:
            error.args = (f"{variants.called(i)}: {error}",)
            raise
    return results


class Stack(SolvedRows):
    """Rows of n variants of one structure in their common coordinates; ``car`` is the first of them.

    Sums run over terms one by one and matrices are multiplied variant by variant, so that no variant depends on what else
    is in the stack.
    """

    def __init__(self, car: Driveline, variants: Variants):
        self.car, self.variants, self.count = car, variants, len(variants)
        locked = [law for each in car.stated for law in each.laws if law.name not in car.released]
        columns = _by_element(variants)
        stated = [_rows(element, columns.get(element.name, {}), self.count) for element in car]
        super().__init__(car.nodes, stated, locked)

    @cached_property
    def has_inertia(self) -> bool:
        """Whether every coordinate has inertia of its own."""
        if not (self.is_free and self.is_heavy):
            return False
        if self.is_diagonal:
            return True
        root = np.sqrt(np.einsum("vii->vi", self.M))
        return agreed(np.linalg.eigvalsh(self.M / root[:, :, None] / root[:, None, :])[:, 0] > DEFINITE)

    @cached_property
    def M(self) -> np.ndarray:
        """(n or 1, coordinates, coordinates) ndarray."""
        n = len(self.coordinates)
        entries = [(place, value) for (i, j), value in self.mass.items() for place in {(i, j), (j, i)}]
        return self.filled((n, n), entries)

    @cached_property
    def roots(self) -> list[Value]:
        """Square roots of a diagonal inertia."""
        return [np.sqrt(self.mass[j, j]) for j in range(len(self.coordinates))]

    @cached_property
    def L(self) -> np.ndarray:
        """(n or 1, coordinates, coordinates) ndarray, lower triangular, ``M = L L^T``."""
        return np.linalg.cholesky(self.M)

    def scaled(self, rows: Sequence[Mapping[str, Value]], factors: Sequence[Value]) -> np.ndarray:
        """(n or 1, rows, coordinates) ndarray: combinations of coordinates, times factors, in mass-scaled ones."""
        place = self.place
        roots = self.roots if self.is_diagonal else [1.0] * len(place)
        entries = [
            ((c, place[name]), factor * value / roots[place[name]])
            for c, (row, factor) in enumerate(zip(rows, factors, strict=True))
            for name, value in row.items()
        ]
        plain = self.filled((len(rows), len(place)), entries)
        return plain if self.is_diagonal else np.swapaxes(_solved(self.L, np.swapaxes(plain, 1, 2)), 1, 2)

    def lifted(self, motions: np.ndarray) -> np.ndarray:
        """(n or 1, coordinates, ...) motions in mass-scaled coordinates, ``L^T motions``."""
        if self.is_diagonal:
            return motions * self._root[:, :, None]
        return np.swapaxes(self.L, 1, 2) @ motions

    def lowered(self, scaled: np.ndarray) -> np.ndarray:
        """The way back, ``L^-T scaled``."""
        if self.is_diagonal:
            return scaled / self._root[:, :, None]
        return _solved(self.L[:, ::-1, ::-1].swapaxes(1, 2), scaled[:, ::-1])[:, ::-1]

    @cached_property
    def _root(self) -> np.ndarray:
        return self.filled((len(self.coordinates),), [((j,), root) for j, root in enumerate(self.roots)])

    @cached_property
    def springs(self) -> list[int]:
        """Compliances with stiffness, in order of their size in the first variant."""
        return sorted(self.elastic, key=self._size, reverse=True)

    def _size(self, c: int) -> float:
        """Square of a row of `factor` in the first variant."""
        size = sum(
            value**2 / self.mass[j, j] for j, value in ((self.place[name], v) for name, v in self.twists[c].items())
        )
        return float(np.ravel(self.compliances[c].stiffness * size)[0])

    @cached_property
    def factor(self) -> np.ndarray:
        """(n or 1, springs, coordinates) ndarray B with ``B^T B`` the stiffness in mass-scaled coordinates [rad/s]."""
        return self._factor(self.elastic)

    @cached_property
    def sorted_factor(self) -> np.ndarray:
        """The same with its rows in the order of `springs`."""
        return self._factor(self.springs)

    def _factor(self, springs: Sequence[int]) -> np.ndarray:
        return self.scaled([self.twists[c] for c in springs], [np.sqrt(self.compliances[c].stiffness) for c in springs])

    @cached_property
    def dampers(self) -> np.ndarray:
        """(n or 1, dampers, coordinates) ndarray, the same of the damping."""
        return self.scaled(
            [self.twists[c] for c in self.damped], [np.sqrt(self.compliances[c].damping) for c in self.damped]
        )

    def final_acceleration(self, engine: str) -> np.ndarray:
        """(n,) ndarray: steady acceleration of the vehicle per engine torque, drag left out; nan without one vehicle."""
        moving = [node for node in self.nodes if node in self.car.translating]
        if len(moving) != 1 or self.rolling is None:
            return np.full(self.count, np.nan)
        return np.array(self.column(self.final_gain(engine, moving[0])))

    def column(self, value: Value) -> np.ndarray:
        """(n,) ndarray of a value."""
        return np.broadcast_to(value, (self.count,))

    def filled(self, shape: tuple[int, ...], entries: Sequence[tuple[tuple[int, ...], Value]]) -> np.ndarray:
        """(n or 1, *shape) ndarray with these entries, each at a place of its own; a batch axis only where one differs."""
        differs = any(isinstance(value, np.ndarray) for _, value in entries)
        array = np.zeros((self.count if differs else 1, *shape))
        for place, value in entries:
            index: tuple[Any, ...] = (slice(None), *place)
            array[index] = value
        return array

    def every(self, array: np.ndarray) -> np.ndarray:
        """(n, ...) of (n or 1, ...)."""
        return np.broadcast_to(array, (self.count, *array.shape[1:]))


def _solved(L: np.ndarray, X: np.ndarray) -> np.ndarray:
    """``L^-1 X`` of lower triangular matrices."""
    count = max(len(L), len(X))
    L, X = np.broadcast_to(L, (count, *L.shape[1:])), np.array(np.broadcast_to(X, (count, *X.shape[1:])))
    for i in range(L.shape[1]):
        for j in range(i):
            X[:, i] -= L[:, i, j, None] * X[:, j]
        X[:, i] /= L[:, i, i, None]
    return X


def _by_element(variants: Variants) -> dict[str, dict[str, np.ndarray]]:
    """Element to parameter to values."""
    columns: dict[str, dict[str, np.ndarray]] = {}
    for name, column in variants.values.items():
        key, _, parameter = name.partition(".")
        if parameter != LOCKED:
            columns.setdefault(key, {})[parameter] = column
    return columns


def _rows(element: Element, columns: Mapping[str, np.ndarray], count: int) -> Statement:
    """Rows of an element in all variants, by arithmetic on arrays or, where it has none for them, from one after another."""
    differ = {
        parameter: column.astype(float)
        for parameter, column in columns.items()
        if column.dtype != object or is_number(column[0])
    }
    if not differ:
        return Statement(element.inertias, element.compliances, element.constraints, ())
    try:
        many = copy.copy(element)
        for parameter, column in differ.items():
            object.__setattr__(many, parameter, column)
        rows = Statement(many.inertias, many.compliances, many.constraints, ())
        kind = type(element), frozenset(differ)
        if kind not in _AS_ARRAYS:
            for i in (0, count - 1):
                _require_same(rows, _single(element, differ, i), i)
            _AS_ARRAYS.add(kind)
        return rows
    except (TypeError, ValueError, AttributeError):
        return _piled([_single(element, differ, i) for i in range(count)])


def _single(element: Element, columns: Mapping[str, np.ndarray], i: int) -> Statement:
    values: dict[str, Any] = {name: float(column[i]) for name, column in columns.items()}
    one = dataclasses.replace(element, **values)
    return Statement(one.inertias, one.compliances, one.constraints, ())


def _require_same(many: Statement, one: Statement, i: int) -> None:
    """Raise a ValueError unless the rows of arrays are at place i those of one variant."""
    if _pattern(many) != _pattern(one):
        raise ValueError("another pattern")
    for value, single in zip(_values(many), _values(one), strict=True):
        here = value[i] if isinstance(value, np.ndarray) else value
        if not abs(here - single) <= SAME * abs(single):
            raise ValueError("another value")


def _pattern(rows: Statement) -> tuple:
    return (
        [row.nodes for row in rows.inertias],
        [(row.name, list(row.coefficients)) for row in rows.compliances],
        [(row.name, list(row.coefficients)) for row in rows.constraints],
    )


def _values(rows: Statement) -> list[Value]:
    values = [value for row in rows.inertias for line in row.matrix for value in line]
    for row in rows.compliances:
        values += [*row.coefficients.values(), row.stiffness, row.damping, row.loss_factor]
    return values + [value for row in rows.constraints for value in row.coefficients.values()]


def _piled(each: Sequence[Statement]) -> Statement:
    """Rows of arrays from those of single variants."""
    patterns = [_pattern(rows) for rows in each]
    if any(pattern != patterns[0] for pattern in patterns):
        raise Mixed(np.array([pattern == patterns[0] for pattern in patterns]))
    values = iter(np.array([_values(rows) for rows in each]).T)
    first = each[0]
    inertias = [
        InertiaRow(r.nodes, tuple(tuple(next(values) for _ in line) for line in r.matrix)) for r in first.inertias
    ]
    compliances = [
        ComplianceRow(r.name, {node: next(values) for node in r.coefficients}, *(next(values) for _ in range(3)))
        for r in first.compliances
    ]
    constraints = [ConstraintRow(r.name, {node: next(values) for node in r.coefficients}) for r in first.constraints]
    return Statement(tuple(inertias), tuple(compliances), tuple(constraints), ())
