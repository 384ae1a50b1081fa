"""The parameters that are looked for: by name, in logarithms, within what a car permits."""

from __future__ import annotations

import dataclasses
import typing
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.checks import AT_LEAST_ONE, SHARE, as_number
from ..base.errors import ParameterError, PowertrainError, UnknownNameError
from ..driveline.collection import Driveline, HasDriveline
from ..reduction.twomass import TwoMass

# A parameter may end up this many times larger or smaller than it starts.
FURTHEST = 30.0


class Parameter(NamedTuple):
    """One number of a car: whose, which, its unit, where it starts and between what it is looked for."""

    name: str
    element: str
    field: str
    unit: str
    start: float
    low: float
    high: float


class Unknowns:
    """What is looked for in a car, as ``value = start exp(q)``."""

    def __init__(
        self, car: HasDriveline, names: Sequence[str], bounds: Mapping[str, tuple[float, float]] | None = None
    ):
        if names and not isinstance(car, Driveline | TwoMass):
            raise PowertrainError(
                f"a {type(car).__name__} has no parameters to look for, permitted: a Driveline or a TwoMass"
            )
        if len(set(names)) < len(names):
            raise PowertrainError(f"parameters {list(names)}, permitted: each once")
        for name in bounds or {}:
            if name not in names:
                raise UnknownNameError("bounds of", name, names, "one of the parameters")
        self.car = car
        self.parameters = [_parameter(car, name, (bounds or {}).get(name)) for name in names]
        self.names = tuple(names)
        self.start = np.array([p.start for p in self.parameters])
        self.low = np.log(np.array([p.low / p.start for p in self.parameters]))
        self.high = np.log(np.array([p.high / p.start for p in self.parameters]))

    def values(self, q: np.ndarray) -> np.ndarray:
        """(parameters,) ndarray, those on a bound to the last bit on it."""
        low, high = np.array([[p.low, p.high] for p in self.parameters]).reshape(-1, 2).T
        values = self.start * np.exp(q)
        # of a negative ratio the lower bound is the larger magnitude
        return np.clip(values, np.minimum(low, high), np.maximum(low, high))

    def car_at(self, q: np.ndarray) -> Any:
        """The car with these values."""
        car = self.car
        for parameter, value in zip(self.parameters, self.values(q).tolist(), strict=True):
            changed = {parameter.field: value}
            car = car.replace(parameter.element, **changed) if parameter.element else car.replace(**changed)  # type: ignore[attr-defined]
        return car


def _parameter(car: Any, name: str, bounds: tuple[float, float] | None) -> Parameter:
    element, _, field = name.rpartition(".")
    if isinstance(car, TwoMass):
        known = [item.name for item in dataclasses.fields(car) if as_number(getattr(car, item.name)) is not None]
        if name not in known:
            raise UnknownNameError("parameter", name, known, "one of a TwoMass")
        hint = typing.get_type_hints(TwoMass, include_extras=True)[name]
        quantity = next(each for each in (hint, *typing.get_args(hint)) if hasattr(each, "__metadata__"))
        unit, permitted = quantity.__metadata__
        start = float(getattr(car, name))
    else:
        if not element:
            listed = ", ".join(numbers_of(car, name)) if name in car else ""
            remedy = f"; {name} has {listed}" if listed else ""
            raise PowertrainError(
                f'parameter "{name}", permitted: "element.value", such as "drive_shafts.stiffness"{remedy}'
            )
        known = numbers_of(car, element)  # refuses an element that is not there
        if field not in known:
            raise UnknownNameError("parameter", name, [f"{element}.{each}" for each in known], f"one of {element}")
        metadata = next(item.metadata for item in dataclasses.fields(car[element]) if item.name == field)
        unit, permitted = metadata["unit"], metadata["permitted"]
        start = float(getattr(car[element], field))
    if start == 0.0:
        raise ParameterError(
            element or "TwoMass", field, start, unit, "not 0 to start from; give it about the size that it may have"
        )
    low, high = start / FURTHEST, start * FURTHEST
    if permitted == SHARE:
        high = min(high, 1.0)
    if permitted == AT_LEAST_ONE:
        low = max(low, 1.0)
    if bounds is not None:
        low, high = bounds if start > 0.0 else bounds[::-1]
        if not (bounds[0] <= start <= bounds[1] and bounds[0] < bounds[1] and low * start > 0.0 and high * start > 0.0):
            raise PowertrainError(
                f"{name}: bounds {bounds[0]:g} to {bounds[1]:g} {unit} and the start {start:g} {unit}, permitted: the start "
                "in between, both of its sign"
            )
    return Parameter(name, element, field, unit, start, low, high)


def numbers_of(car: Driveline, element: str) -> list[str]:
    """Names of the values of an element that are numbers."""
    there = car[element]
    return [
        item.name
        for item in dataclasses.fields(there)
        if "unit" in item.metadata and as_number(getattr(there, item.name)) is not None
    ]
