"""What annotations of public functions permit: each becomes a kind of value, with words for it and a function that takes it.

``float`` takes a finite real number, ``Seconds`` and the like of `checks` one with unit and range, ``str`` a string,
``ArrayLike`` real numbers, a class its instances, and so on through unions, mappings and sequences. Values come out as
functions want them: numbers as ``float``, arrays as ``ndarray``, names as a tuple.
"""

from __future__ import annotations

import builtins
import inspect
import os
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from numbers import Integral, Number, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar

import numpy as np

from .checks import FINITE, LARGEST, MOST, NEITHER, NOT_NEGATIVE, NOT_ZERO, POSITIVE, SMALLEST, as_number, outside
from .errors import FileError, ParameterError, PowertrainError, SignalError, shown

# Classes that are spoken of by other words than their name.
WORDS = {"NonlinearIOSystem": "a discrete-time python-control system as controller"}
# How to come by what is wanted.
A_CAR = "; pt.Driveline(...) or pt.load(path) makes one"
REMEDIES = {
    "SampledPlant": "; pt.SampledPlant(car=...) makes one of a car",
    "TwoMass": "; pt.two_mass(car) makes one of a car",
    "Modes": "; pt.modes(car) makes them of a car",
    "Response": "; pt.simulate, the manoeuvres and pt.closed_loop give one",
    "ModelComparison": "; pt.compare_models(car, models) makes one",
    "Robustness": "; pt.robustness(plant, controller) makes one",
    "LoopMargins": "; pt.loop_margins(plant, controller) makes one",
    "CriticalSpeeds": "; pt.critical_speeds(car, engine, rpm) makes them",
    "OrderResponse": "; pt.order_response(car, engine, speed) makes one",
    "Engine": "; pt.Engine(cylinders=...) makes one",
    "Validation": "; pt.validate(car, run) makes one",
    "RideMetrics": "; pt.ride_metrics(...) makes one",
}


class Refused(Exception):
    """A value of the wrong sort; or, where ``permitted`` is given, of the right sort and wrong in itself at ``where``."""

    def __init__(self, value: object, permitted: str = "", where: str = "", kind: Kind | None = None):
        self.value, self.permitted, self.where, self.kind = value, permitted, where, kind

    def error(self, owner: str, parameter: str, kind: Kind) -> PowertrainError:
        """The refusal as the user sees it; ``kind`` is that of the whole parameter."""
        kind = self.kind or kind
        return kind.error(owner, parameter + self.where, self.value, self.permitted or kind.says, kind)


def _wrong_value(owner: str, parameter: str, value: object, permitted: str, kind: Kind) -> PowertrainError:
    return ParameterError(owner, parameter, value, kind.unit, permitted)


def _wrong_class(owner: str, parameter: str, value: object, permitted: str, kind: Kind) -> PowertrainError:
    got = shown(value) if isinstance(value, Number | str | bytes | None) else f"a {type(value).__name__}"
    return PowertrainError(f"{owner}: {parameter}: expected {permitted}, got {got}{kind.remedy}")


def _wrong_collection(owner: str, parameter: str, value: object, permitted: str, kind: Kind) -> PowertrainError:
    return PowertrainError(f"{owner}: {parameter} is of type {type(value).__name__}, permitted: {permitted}")


def _wrong_array(owner: str, parameter: str, value: object, permitted: str, kind: Kind) -> PowertrainError:
    return SignalError(f"{owner}: {parameter} is {shown(value)}, permitted: {permitted}")


def _wrong_function(owner: str, parameter: str, value: object, permitted: str, kind: Kind) -> PowertrainError:
    return SignalError(f"{owner}: the {parameter} is {type(value).__name__}, permitted: {permitted}")


def _wrong_path(owner: str, parameter: str, value: object, permitted: str, kind: Kind) -> PowertrainError:
    return FileError(f"{owner}: {parameter} is {shown(value)}, permitted: {permitted}")


@dataclass(frozen=True, eq=False)
class Kind:
    """What an annotation permits: in words, as a function that takes a value, and the error that a refusal is."""

    says: str
    take: Callable[[Any], Any]
    unit: str = ""
    error: Callable[[str, str, object, str, Kind], PowertrainError] = _wrong_value
    remedy: str = ""


class _Named(type):
    """Class that is known by name only, because its module may not have been imported; instances are told by their names."""

    def __instancecheck__(cls, value: object) -> bool:
        return any(c.__name__ == cls.__name__ and c.__module__.startswith(cls.__module__) for c in type(value).__mro__)


def _named(name: str, package: str = "powertrain_ctrl") -> type:
    return _Named(name, (), {"__module__": package})


class _Package:
    """Package that may not have been imported; its classes are known by name."""

    def __init__(self, name: str):
        self._name = name

    def __getattr__(self, name: str) -> type:
        return _named(name, self._name)


class ArrayLike:
    """In an annotation: real finite numbers."""


class Signal:
    """In an annotation: what an input can be. Its values are checked where it is read."""


class HasDriveline:
    """In an annotation: a driveline, or what has one."""


class Controller:
    """In an annotation: what commands a torque."""


class Run:
    """In an annotation: a time response of this package or of python-control."""


class Panels:
    """In an annotation: axes of matplotlib, or None for new ones."""


class _Names(dict):
    """What the names of annotations mean; those imported for type checking only become classes known by name."""

    OURS: typing.ClassVar = {cls.__name__: cls for cls in (ArrayLike, Signal, HasDriveline, Controller, Panels, Run)}

    def __init__(self, names: dict[str, Any]):
        super().__init__({**names, **self.OURS})

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name):
            raise KeyError(name)
        if name == "control":
            return _Package("control")
        return _named(name, "matplotlib") if name == "Axes" else _named(name)


def kind_of(parameter: inspect.Parameter, names: dict[str, Any]) -> Kind | None:
    """What a parameter permits, its annotation read with the names of its module; None is anything."""
    annotation = parameter.annotation
    if annotation is parameter.empty or parameter.name == "self" or parameter.name.startswith("_"):
        return None
    return _kind(eval(annotation, {}, _Names(names)) if isinstance(annotation, str) else annotation)


def _kind(annotation: Any) -> Kind | None:
    """What an annotation permits; None is anything."""
    if annotation in (Any, object) or annotation is inspect.Parameter.empty:
        return None
    if annotation in _SIMPLE:
        return _SIMPLE[annotation]
    origin, of = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is typing.Annotated:
        return (_whole if of[0] is int else _quantity)(*of[1:])
    if origin in (typing.Union, UnionType):
        return _union([_kind(each) for each in of])
    if isinstance(annotation, TypeVar):
        return _union([_kind(each) for each in annotation.__constraints__])
    if origin is Callable:
        count = len(of[0]) if isinstance(of[0], list) else 1
        what = "time" if of[0] == [float] else "one value" if count == 1 else f"{count} values"
        return Kind(f"a function of {what}", partial(_function, count=count), error=_wrong_function)
    for base, make in _COLLECTIONS.items():
        if base in (annotation, origin):
            return (_sequence if ... in of else make)(*(_kind(each) for each in of if each is not ...))
    return _instance(annotation)


def _whole(unit: str, least: float, most: float) -> Kind:
    def take(value: Any) -> int:
        if isinstance(value, bool) or not isinstance(value, Integral):
            raise Refused(value)
        number = int(value)
        if not least <= number <= most:
            raise Refused(value, f">= {least:g}" if number < least else f"<= {most:g}", kind=kind)
        return number

    kind = Kind("a whole number" + (f", {least:g} to {most:g}" if least > -most else ""), take, unit)
    return kind


# Between these a number is permitted without a closer look; where there is no word for it, none is.
_PLAIN = {FINITE: (-LARGEST, LARGEST), POSITIVE: (SMALLEST, LARGEST), NOT_NEGATIVE: (0.0, LARGEST)}


def _quantity(unit: str, permitted: str) -> Kind:
    low, high = _PLAIN.get(permitted, (1.0, 0.0))
    smallest = SMALLEST if permitted in (POSITIVE, NOT_ZERO, NEITHER) else 0.0

    def take(value: Any) -> float:
        if type(value) is float and low <= value <= high:
            return value
        number = as_number(value)
        if number is None:
            raise Refused(value)
        if reason := outside(number, permitted, smallest):
            raise Refused(number, reason, kind=kind)
        return number

    kind = Kind(f"a number, {permitted}", take, unit)
    return kind


def _union(kinds: list[Kind | None]) -> Kind | None:
    if None in kinds:
        return None
    members = [kind for kind in kinds if kind is not None]
    if optional := _NOTHING in members:
        members.remove(_NOTHING)
    first = _PATH if _PATH in members else members[0]

    def take(value: Any) -> Any:
        if optional and value is None:
            return None
        nearest: Refused | None = None
        for kind in members:
            try:
                return kind.take(value)
            except Refused as refused:
                if refused.permitted or refused.where:
                    nearest = nearest or refused
        raise nearest or Refused(value)

    says = " or ".join(dict.fromkeys(kind.says for kind in members))
    return Kind(says, take, first.unit, first.error, first.remedy)


def _instance(cls: type) -> Kind:
    name = cls.__name__

    def take(value: Any) -> Any:
        if not isinstance(value, cls):
            raise Refused(value)
        return value

    says = WORDS.get(name, f"{'an' if name[0] in 'AEIOU' else 'a'} {name}")
    return Kind(says, take, error=_wrong_class, remedy=REMEDIES.get(name, ""))


def _mapping(key: Kind | None = None, item: Kind | None = None) -> Kind:
    def take(value: Any) -> dict:
        if not isinstance(value, Mapping):
            raise Refused(value)
        return {_inside(key, k, k, " key {}"): _inside(item, v, k) for k, v in value.items()}

    says = (
        f"a mapping from {'name' if key is None or key.says == 'a string' else key.says}"
        if item or key
        else "a mapping"
    )
    return Kind(says + (f" to {item.says}" if item else ""), take, error=_wrong_collection)


def _sequence(item: Kind | None = None) -> Kind:
    def take(value: Any) -> Sequence:
        if isinstance(value, np.ndarray) and value.ndim == 1:
            value = value.tolist()
        if isinstance(value, str | bytes) or not isinstance(value, Sequence):
            raise Refused(value)
        try:
            found = [_inside(item, each, i) for i, each in enumerate(value)]
        except Refused as refused:
            permitted = f"each {refused.permitted}" if refused.permitted else ""
            raise Refused(refused.value, permitted, refused.where, refused.kind) from None
        return found if isinstance(value, list) else tuple(found)

    says = f"a sequence of {item.says}" if item else "a sequence"
    return Kind(says, take, item.unit if item else "", item.error if item else _wrong_collection)


def _names(item: Kind | None = None) -> Kind:
    """Names as a tuple; what is no name the function that looks it up tells best, with those there are."""

    def take(value: Any) -> tuple:
        if isinstance(value, str) or not isinstance(value, Iterable):
            value = (value,)
        try:
            names = tuple(islice(value, MOST + 1))
        except TypeError:  # an array without dimension
            raise Refused(value) from None
        if len(names) > MOST:
            raise Refused(value)
        return names

    return Kind("names", take, error=_wrong_collection)


def _tuple(*items: Kind | None) -> Kind:
    item = items[0] or Kind("value", lambda value: value)
    says = f"{len(items)} values, each {item.says}"
    every = _sequence(item)

    def take(value: Any) -> tuple:
        try:
            found = tuple(every.take(value))
        except Refused:
            found = ()
        if len(found) != len(items):
            raise Refused(value, says, kind=kind)
        return found

    kind = Kind(says, take, item.unit)
    return kind


def _inside(kind: Kind | None, value: Any, place: Any, where: str = "[{}]") -> Any:
    if kind is None:
        return value
    try:
        return kind.take(value)
    except Refused as refused:
        where = where.format(shown(place)) + refused.where
        raise Refused(refused.value, refused.permitted, where, refused.kind or kind) from None


def _function(value: Any, count: int = 1) -> Any:
    # a system of python-control can be called, but with a frequency
    if not callable(value) or hasattr(value, "ninputs"):
        raise Refused(value)
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):  # a built-in that does not say
        return value
    try:
        signature.bind(*count * [0.0])
    except TypeError:
        raise Refused(value) from None
    return value


def _any_number(value: Any) -> Any:
    """What is read later; None, text and containers of such are not."""
    if value is None or isinstance(value, str | bytes | bool | complex | Mapping | set | frozenset | type):
        raise Refused(value)
    if callable(value):
        return _function(value)
    return value


def real_numbers(values: Any) -> np.ndarray:
    """Values as an array of floats, or `Refused`."""
    try:
        array = np.asarray(values)
        if array.dtype.kind == "O":
            each = array.ravel().tolist()
            if all(isinstance(value, Real) and not isinstance(value, bool) for value in each):
                array = np.array([float(value) for value in each]).reshape(array.shape)
    except (TypeError, ValueError, OverflowError):
        raise Refused(values) from None
    if array.dtype.kind not in "fiu" or isinstance(values, set | frozenset | Mapping):
        raise Refused(values)
    return array.astype(float, copy=False)


def _array(values: Any) -> np.ndarray:
    array = real_numbers(values)
    if not array.ndim:
        raise Refused(values)
    far = array[np.isfinite(array) & (np.abs(array) > LARGEST)]
    if far.size:
        raise Refused(float(far[0]), f"at most {LARGEST:g} in size")
    return array


def _finite_array(values: Any) -> np.ndarray:
    array = _array(values)
    if not np.isfinite(array).all():
        raise Refused(float(array[~np.isfinite(array)][0]), "finite")
    return array


def _flag(value: Any) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise Refused(value)
    return bool(value)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise Refused(value)
    return value


def _path(value: Any) -> Any:
    if not isinstance(value, str | os.PathLike) or not isinstance(os.fspath(value), str):
        raise Refused(value)
    return value


def _driveline(value: Any) -> Any:
    if not isinstance(getattr(value, "driveline", None), _DRIVELINE) or type(value).__hash__ is None:
        raise Refused(value)
    return value


def _response(value: Any) -> Any:
    if not isinstance(value, _RESPONSES):
        raise Refused(value)
    return value


def _panels(value: Any) -> Any:
    axes = np.asarray(value, dtype=object).ravel().tolist()
    if value is not None and not all(isinstance(ax, _AXES) for ax in axes):
        raise Refused(value)
    return value


def _nothing(value: Any) -> None:
    if value is not None:
        raise Refused(value)


_AXES, _DRIVELINE = _named("Axes", "matplotlib"), _named("Driveline")
_RESPONSES = _named("Response"), _named("Signals"), _named("TimeResponseData", "control")
_NOTHING = Kind("None", _nothing)
_PATH = Kind("a path", _path, error=_wrong_path)
_SIMPLE: dict[Any, Kind | None] = {
    NoneType: _NOTHING,
    None: _NOTHING,
    float: _quantity("", FINITE),
    int: _whole("", -LARGEST, LARGEST),
    bool: Kind("True or False", _flag),
    str: Kind("a string", _text),
    Path: _PATH,
    np.ndarray: Kind("real numbers", _finite_array, error=_wrong_array),
    ArrayLike: Kind("real numbers", _array, error=_wrong_array),
    Signal: Kind("number, samples or function of time", _any_number, error=_wrong_array),
    HasDriveline: Kind("a Driveline or a TwoMass", _driveline, error=_wrong_class, remedy=A_CAR),
    Controller: _union([_instance(_named("NonlinearIOSystem", "control")), _instance(_named("ControlUnit")), _NOTHING]),
    Run: Kind("a response", _response, error=_wrong_class),
    Panels: Kind("axes of matplotlib", _panels, error=_wrong_class),
}
_COLLECTIONS: dict[Any, Callable[..., Kind]] = {
    Mapping: _mapping,
    dict: _mapping,
    tuple: _tuple,
    Sequence: _sequence,
    Iterable: _names,
}
