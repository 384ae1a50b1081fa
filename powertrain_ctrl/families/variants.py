"""Variants of a driveline: the values that differ, checked all at once."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import Field, dataclass
from typing import Any

import numpy as np

from ..base.checks import MOST, first_outside, outside
from ..base.errors import ParameterError, PowertrainError, shown
from ..base.records import Record
from ..driveline.collection import Driveline, require_parameter
from ..elements import ELEMENT_TYPES, Clutch, Element
from ..elements.element import smallest_of

# Pseudo-parameter of a clutch: whether the linear models take it as rigid.
LOCKED = "locked"
# Values at which the elements of this package have rules of their own: no stiffness, a carrier that drops out.
SPECIAL = (0.0, -1.0)


@dataclass(frozen=True, eq=False, repr=False)
class Variants(Record):
    """Values by ``element.parameter``, (n,) arrays: of floats, or of objects where a value is no number.

    ``numbers`` are those of the variants in the family that this is a part of.
    """

    car: Driveline
    values: dict[str, np.ndarray]
    numbers: np.ndarray

    def __len__(self) -> int:
        return len(self.numbers)

    def part(self, chosen: np.ndarray | slice) -> Variants:
        """Some of the variants."""
        values = {name: column[chosen] for name, column in self.values.items()}
        return Variants(self.car, values, self.numbers[chosen])

    def chunks(self, size: int) -> Iterator[Variants]:
        """Parts of at most this many variants, in order."""
        for start in range(0, len(self), size):
            yield self.part(slice(start, start + size))

    def of(self, i: int) -> dict[str, Any]:
        """Values of one variant."""
        return {name: column[i].item() if column.dtype != object else column[i] for name, column in self.values.items()}

    def car_of(self, i: int) -> Driveline:
        """Driveline of one variant; what is wrong with it names the variant."""
        values = self.of(i)
        clutches = {name: values.pop(name) for name in list(values) if name.endswith(f".{LOCKED}")}
        try:
            car = self.car.replace(values) if values else self.car
        except PowertrainError as error:
            raise PowertrainError(f"{self.called(i)}: {error}") from error
        for name, locked in clutches.items():
            clutch = name.removesuffix(f".{LOCKED}")
            car = car.lock(clutch) if locked else car.release(clutch)
        return car

    def called(self, i: int) -> str:
        """Variant and its values, for messages."""
        values = [f"{name} = {shown(value)}" for name, value in self.of(i).items()]
        listed = ", ".join(values[:6]) + (", ..." if len(values) > 6 else "")
        return f"variant {self.numbers[i]} ({listed})"


def variants_among(cars: Sequence[Driveline]) -> list[tuple[list[int], Variants]]:
    """Cars that differ in numbers alone, as variants of the first of them; and their places."""
    groups: dict[Any, list[int]] = {}
    for i, car in enumerate(cars):
        kind = tuple((type(element), tuple(_words(element))) for element in car)
        groups.setdefault((kind, car.released), []).append(i)
    found = []
    for places in groups.values():
        columns = {}
        for elements in zip(*(cars[i] for i in places), strict=True):
            for item in dataclasses.fields(elements[0]):
                values = [getattr(element, item.name) for element in elements]
                if is_number(values[0]) and any(value != values[0] for value in values):
                    columns[f"{elements[0].name}.{item.name}"] = np.array(values, dtype=float)
        found.append((places, Variants(cars[places[0]], columns, np.array(places))))
    return found


def _words(element: Element) -> Iterator[Any]:
    """What of an element is no number."""
    for item in dataclasses.fields(element):
        value = getattr(element, item.name)
        yield item.name if is_number(value) else value


def variants_of(car: Driveline, given: Mapping[str, Any], grid: bool) -> tuple[Variants, tuple[int, ...]]:
    """Variants from ``element.parameter`` to values, and the shape of the grid they make.

    Raises
    ------
    UnknownNameError
        An element that is not there.
    ParameterError
        A value that is not permitted; it names the variant.
    PowertrainError
        A parameter that is not there, arrays of different length without a grid, no or too many variants.
    """
    if not given:
        raise PowertrainError('values is empty, permitted: {"element.parameter": values, ...}')
    columns = {name: _column(car, name, values) for name, values in given.items()}
    lengths = {name: len(column) for name, column in columns.items()}
    shape = tuple(lengths.values()) if grid else _common(lengths, given)
    if not 0 < np.prod(shape, dtype=float) <= MOST:
        raise PowertrainError(f"{np.prod(shape, dtype=float):g} variants, permitted: 1 to {MOST:g}")
    if grid:
        places = np.indices(shape).reshape(len(shape), -1)
        columns = {name: column[place] for (name, column), place in zip(columns.items(), places, strict=True)}
    else:
        columns = {
            name: column if len(column) == shape[0] else np.repeat(column, shape[0]) for name, column in columns.items()
        }
    variants = Variants(car, columns, np.arange(int(np.prod(shape))))
    _check(variants)
    return variants, shape


def _common(lengths: Mapping[str, int], given: Mapping[str, Any]) -> tuple[int]:
    """Length of the arrays; a single number goes with any."""
    arrays = {
        name: length
        for name, length in lengths.items()
        if np.ndim(given[name]) or isinstance(given[name], list | tuple)
    }
    if len(set(arrays.values())) > 1:
        listed = ", ".join(f"{name}: {length}" for name, length in arrays.items())
        raise PowertrainError(f"values of different length ({listed}), permitted: as many of each, or grid=True")
    return (next(iter(arrays.values()), 1),)


def _column(car: Driveline, name: str, values: Any) -> np.ndarray:
    """Values of one parameter as an array: of floats where all are numbers."""
    key, _, parameter = str(name).partition(".")
    element = car[key]
    if parameter == LOCKED and isinstance(element, Clutch):
        return _flags(name, values)
    if not parameter:
        fields = ", ".join(f'"{key}.{item.name}"' for item in dataclasses.fields(element)[1:])
        raise PowertrainError(f'"{name}" is an element, permitted: one of its parameters: {fields}')
    require_parameter(element, parameter)
    if isinstance(values, np.ndarray) and values.ndim > 1:
        raise PowertrainError(f"{name}: values of shape {values.shape}, permitted: one-dimensional")
    numbers = np.asarray(values) if "permitted" in _field(element, parameter).metadata else np.zeros(0, dtype=object)
    if numbers.dtype.kind in "iuf":
        return np.array(numbers, dtype=float).reshape(-1)
    listed = list(values) if isinstance(values, Sequence | np.ndarray) and np.ndim(values) != 0 else [values]
    if isinstance(values, str | Mapping):
        listed = [values]
    column = np.empty(len(listed), dtype=object)
    column[:] = listed
    return column


def _flags(name: str, values: Any) -> np.ndarray:
    flags = np.atleast_1d(np.asarray(values))
    if flags.dtype != bool or flags.ndim > 1:
        raise PowertrainError(f"{name} = {shown(values)}, permitted: True or False for each variant")
    return flags.astype(object)


def _field(element: Element, parameter: str) -> Field:
    return next(item for item in dataclasses.fields(element) if item.name == parameter)


def _check(variants: Variants) -> None:
    """Each value by itself, all at once; then one car of each kind, by the elements' own rules."""
    kinds = np.zeros(len(variants), dtype=np.int64)
    has_own_rules = False
    for name, column in variants.values.items():
        key, _, parameter = name.partition(".")
        element = variants.car[key]
        if parameter != LOCKED and "permitted" in _field(element, parameter).metadata:
            _check_numbers(variants, key, _field(element, parameter), column)
        if column.dtype == object:
            order: dict[Any, int] = {}
            marks = np.array([order.setdefault(mark_of(value), len(order)) for value in column])
        else:
            marks = (column == SPECIAL[0]) + 2 * (column == SPECIAL[1])
        has_own_rules |= type(element) not in ELEMENT_TYPES.values()
        if marks.any():
            kinds = np.unique(kinds * (int(marks.max()) + 1) + marks, return_inverse=True)[1]
    chosen = range(len(variants)) if has_own_rules else np.unique(kinds, return_index=True)[1].tolist()
    for i in chosen:
        variants.car_of(i)


def _check_numbers(variants: Variants, key: str, item: Field, column: np.ndarray) -> None:
    unit, permitted, smallest = item.metadata["unit"], item.metadata["permitted"], smallest_of(item)
    there = np.arange(len(column))
    if column.dtype == object:
        there = np.array([i for i, value in enumerate(column) if is_number(value)], dtype=int)
    i = first_outside(column[there].astype(float), permitted, smallest)
    if i is not None:
        value = float(column[there[i]])
        where = f"{item.name} of variant {variants.numbers[there[i]]}"
        raise ParameterError(key, where, value, unit, outside(value, permitted, smallest))


def is_number(value: Any) -> bool:
    return isinstance(value, float | int | np.number) and not isinstance(value, bool)


def mark_of(value: Any) -> Any:
    """What tells values apart that are not numbers; numbers are alike but for the special ones."""
    if is_number(value):
        return "number", value if value in SPECIAL else None
    try:
        hash(value)
    except TypeError:
        return repr(value)
    return type(value), value
