"""What a public function is given is checked once, at its door, against the annotations it has.

``float`` takes a finite real number, ``Seconds`` and the like of `checks` one with unit and range, ``str`` a string,
``ArrayLike`` real finite numbers, a class its instances, and so on through unions, mappings and sequences. Values come out
as the function wants them: numbers as ``float``, arrays as ``ndarray``, names as a tuple. Inner code stays bare.
"""

from __future__ import annotations

import builtins
import inspect
import os
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, wraps
from itertools import islice
from numbers import Integral, Number, Real
from pathlib import Path
from types import NoneType, UnionType
from typing import Any, TypeVar, cast

import numpy as np

from .checks import FINITE, LARGEST, MOST, NOT_ZERO, POSITIVE, SMALLEST, as_number, outside
from .errors import ArgumentError, FileError, ParameterError, PowertrainError, SignalError, shown, suggestion

T = TypeVar("T", bound=Callable[..., Any])

# Records that are spoken of by other words than their name.
SPOKEN = {"SampledPlant": "sampled plant", "Sensors": "sensors", "TwoMass": "two-mass model"}
WORDS = {"NonlinearIOSystem": "a discrete-time python-control system as controller"}
# How to come by what is wanted.
REMEDIES = {
    "SampledPlant": "pt.SampledPlant(car=...) makes one of a car",
    "TwoMass": "pt.two_mass(car) makes one of a car",
    "HasDriveline": "pt.Driveline(...) or pt.load(path) makes one",
    "Modes": "pt.modes(car) makes them of a car",
    "Response": "pt.simulate, the manoeuvres and pt.closed_loop give one",
    "ModelComparison": "pt.compare_models(car, models) makes one",
    "Robustness": "pt.robustness(plant, controller) makes one",
    "LoopMargins": "pt.loop_margins(plant, controller) makes one",
    "RideMetrics": "pt.ride_metrics(...) makes one",
}


def checked(thing: T) -> T:
    """A function, method or record that checks what it is given; what cannot be computed is a `PowertrainError` too.

    >>> from powertrain_ctrl.checks import Seconds
    >>> @checked
    ... def wait(time: Seconds): ...
    >>> wait("soon")
    Traceback (most recent call last):
    ...
    powertrain_ctrl.errors.ParameterError: wait: time = 'soon' s, permitted: a number, finite
    """
    return _guarded(thing, values=True)


def called(thing: T) -> T:
    """The same for records that check their values themselves, or hold results: only names and number of the arguments."""
    return _guarded(thing, values=False)


def _guarded(thing: T, values: bool) -> T:
    if isinstance(thing, type):
        name = SPOKEN.get(thing.__name__, thing.__name__)
        thing.__init__ = _behind_door(thing.__init__, name, values)  # type: ignore[misc]
        return thing
    return cast(T, _behind_door(thing, thing.__qualname__, values))


def _behind_door(function: Callable[..., Any], name: str, values: bool) -> Callable[..., Any]:
    door = _Door(function, name, values)

    @wraps(function)
    def guarded(*args: Any, **kwargs: Any) -> Any:
        given, by_keyword = door.taken(args, kwargs)
        try:
            return function(*given, **by_keyword)
        except PowertrainError:
            raise
        except (ArithmeticError, ValueError, MemoryError) as error:
            # Never TypeError, IndexError, ...: those are mistakes of this package.
            raise PowertrainError(f"{name}: cannot be computed with these values: {error}") from error

    return guarded


class Refused(Exception):
    """A value of the wrong sort; or, where ``permitted`` is given, of the right sort and wrong in itself at ``where``."""

    def __init__(self, value: object, permitted: str = "", where: str = "", kind: Kind | None = None):
        self.value, self.permitted, self.where, self.kind = value, permitted, where, kind


@dataclass(frozen=True)
class Kind:
    """What an annotation permits: in words, as a function that takes a value, and the error that a refusal is."""

    says: str
    take: Callable[[Any], Any]
    unit: str = ""
    error: Callable[[str, str, object, str, Kind], PowertrainError] = lambda *refused: _wrong_value(*refused)
    remedy: str = ""


class _Door:
    def __init__(self, function: Callable[..., Any], name: str, values: bool):
        self.function, self.name, self.values = function, name, values

    @cached_property
    def _parameters(self) -> tuple:
        """By position, all that may be so given; by name; what takes the rest; those that must be given."""
        parameters = inspect.signature(self.function).parameters.values()
        names = _Names(self.function.__globals__)
        kinds = {p.name: _kind_of(p, names) if self.values else None for p in parameters}
        by_position = [(p.name, kinds[p.name]) for p in parameters if p.kind <= p.POSITIONAL_OR_KEYWORD]
        by_name = {p.name: kinds[p.name] for p in parameters if p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)}
        rest = {p.kind: (p.name, kinds[p.name]) for p in parameters if p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD)}
        needed = [
            p.name for p in parameters if p.default is p.empty and p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)
        ]
        many, named = rest.get(inspect.Parameter.VAR_POSITIONAL), rest.get(inspect.Parameter.VAR_KEYWORD)
        return by_position, by_name, many, named, needed

    def taken(self, args: tuple, kwargs: dict[str, Any]) -> tuple[list, dict[str, Any]]:
        by_position, by_name, many, named, needed = self._parameters
        if len(args) > len(by_position) and many is None:
            raise self._too_many(len(args))
        given = [
            value if kind is None else self._take(name, kind, value)
            for (name, kind), value in zip(by_position, args, strict=False)
        ]
        for i, value in enumerate(args[len(by_position) :]):
            given.append(value if many[1] is None else self._take(f"{many[0]}[{i}]", many[1], value))
        by_keyword = {}
        for name, value in kwargs.items():
            if name not in by_name:
                if named is None:
                    raise ArgumentError(f'{self.name} has no parameter "{name}"{suggestion(name, self._shown)}')
                kind = named[1]
            else:
                kind = by_name[name]
                if any(name == other for other, _ in by_position[: len(args)]):
                    raise ArgumentError(f"{self.name}: {name} is given twice, by position and by keyword")
            by_keyword[name] = value if kind is None else self._take(name, kind, value)
        if len(args) + len(kwargs) < len(needed) or kwargs or len(needed) > len(args):
            placed = {name for name, _ in by_position[: len(args)]}
            missing = [name for name in needed if name not in placed and name not in by_keyword]
            if missing:
                keyword = [f"{name}=..." if name in by_name else name for name in missing]
                raise ArgumentError(f"{self.name}: not given: {', '.join(keyword)}")
        return given, by_keyword

    @property
    def _shown(self) -> list[str]:
        return [name for name in self._parameters[1] if name != "self" and not name.startswith("_")]

    def _too_many(self, count: int) -> ArgumentError:
        by_position, by_name, *_ = self._parameters
        names = [name for name, _ in by_position if name != "self"]
        own = len(by_position) - len(names)
        others = [f"{name}=..." for name in by_name if name not in names and name != "self"]
        takes = f"permitted: {len(names)}" + (f" ({', '.join(names)})" if names else "")
        keyword = f"; give by keyword: {', '.join(others)}" if others else ""
        return ArgumentError(f"{self.name}: {count - own} values by position, {takes}{keyword}")

    def _take(self, parameter: str, kind: Kind, value: Any) -> Any:
        try:
            return kind.take(value)
        except Refused as refused:
            error = self._error(parameter, kind, refused)
        raise error

    def _error(self, parameter: str, kind: Kind, refused: Refused) -> PowertrainError:
        kind = refused.kind or kind
        permitted = refused.permitted or kind.says
        return kind.error(self.name, parameter + refused.where, refused.value, permitted, kind)


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


class _Named(type):
    """Class that is known by name only, because its module may not have been imported; instances are told by their names."""

    def __instancecheck__(cls, value: object) -> bool:
        return any(c.__name__ == cls.__name__ and c.__module__.startswith(cls.__module__) for c in type(value).__mro__)


class _Package:
    """Package that may not have been imported; its classes are known by name."""

    def __init__(self, name: str):
        self._name = name

    def __getattr__(self, name: str) -> type:
        return _Named(name, (), {"__module__": self._name})


class ArrayLike:
    """In an annotation: real finite numbers."""


class Signal:
    """In an annotation: what an input can be. Its values are checked where it is read."""


class HasDriveline:
    """In an annotation: a driveline, or what has one."""


class Run:
    """In an annotation: a time response of this package or of python-control."""


class Panels:
    """In an annotation: axes of matplotlib, or None for new ones."""


class _Names(dict):
    """What the names of annotations mean; those imported for type checking only become classes known by name."""

    OURS: typing.ClassVar = {cls.__name__: cls for cls in (ArrayLike, Signal, HasDriveline, Panels, Run)}

    def __init__(self, names: dict[str, Any]):
        super().__init__({**names, **self.OURS})

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name):
            raise KeyError(name)
        if name == "control":
            return _Package("control")
        return _Named(name, (), {"__module__": "matplotlib" if name == "Axes" else "powertrain_ctrl"})


def _kind_of(parameter: inspect.Parameter, names: _Names) -> Kind | None:
    annotation = parameter.annotation
    if annotation is parameter.empty or parameter.name == "self" or parameter.name.startswith("_"):
        return None
    if isinstance(annotation, str):
        annotation = eval(annotation, {}, names)
    return _kind(annotation)


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
        what = "time" if of[0] == [float] else "one value"
        return Kind(f"a function of {what}", _function, error=_wrong_function)
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


def _quantity(unit: str, permitted: str) -> Kind:
    def number(value: Any) -> float:
        number = as_number(value)
        if number is None:
            raise Refused(value)
        if reason := outside(number, permitted, SMALLEST if permitted in (POSITIVE, NOT_ZERO) else 0.0):
            raise Refused(number, reason, kind=kind)
        return number

    kind = Kind(f"a number, {permitted}", number, unit)
    return kind


def _union(kinds: list[Kind | None]) -> Kind | None:
    if None in kinds:
        return None
    members = [kind for kind in kinds if kind is not None]
    said = [kind.says for kind in members if kind is not _NOTHING]
    first = _PATH if _PATH in members else members[0]

    def take(value: Any) -> Any:
        if value is None and _NOTHING in members:
            return None
        nearest: Refused | None = None
        for kind in members:
            try:
                return kind.take(value)
            except Refused as refused:
                if refused.permitted or refused.where:
                    nearest = nearest or refused
        raise nearest or Refused(value)

    return Kind(" or ".join(dict.fromkeys(said)), take, first.unit, first.error, first.remedy)


def _instance(cls: type) -> Kind:
    name = cls.__name__

    def take(value: Any) -> Any:
        if not isinstance(value, cls):
            raise Refused(value)
        return value

    remedy = f"; {REMEDIES[name]}" if name in REMEDIES else ""
    says = WORDS.get(name, f"{'an' if name[0] in 'AEIOU' else 'a'} {name}")
    return Kind(says, take, error=_wrong_class, remedy=remedy)


def _mapping(key: Kind | None = None, item: Kind | None = None) -> Kind:
    def take(value: Any) -> dict:
        if not isinstance(value, Mapping):
            raise Refused(value)
        return {_inside(key, k, f" key {shown(k)}"): _inside(item, v, f"[{shown(k)}]") for k, v in value.items()}

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
            found = [_inside(item, each, f"[{i}]") for i, each in enumerate(value)]
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


def _inside(kind: Kind | None, value: Any, where: str) -> Any:
    if kind is None:
        return value
    try:
        return kind.take(value)
    except Refused as refused:
        raise Refused(refused.value, refused.permitted, where + refused.where, refused.kind or kind) from None


def _function(value: Any) -> Any:
    # a system of python-control can be called, but with a frequency
    if not callable(value) or hasattr(value, "ninputs"):
        raise Refused(value)
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):  # a built-in that does not say
        return value
    try:
        signature.bind(0.0)
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
    if not isinstance(getattr(value, "driveline", None), _DRIVELINE):
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


_RESPONSES = [_Named(name, (), {"__module__": "powertrain_ctrl"}) for name in ("Response", "Signals")]
_RESPONSES.append(_Named("TimeResponseData", (), {"__module__": "control"}))
_AXES = _Named("Axes", (), {"__module__": "matplotlib"})
_DRIVELINE = _Named("Driveline", (), {"__module__": "powertrain_ctrl"})
_NOTHING = Kind("None", _nothing)
_PATH = Kind("a path", _path, error=_wrong_path)
_SIMPLE: dict[Any, Kind] = {
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
    HasDriveline: Kind(
        "a Driveline or a TwoMass", _driveline, error=_wrong_class, remedy=f"; {REMEDIES['HasDriveline']}"
    ),
    Run: _union([_instance(cls) for cls in _RESPONSES]),
    Panels: Kind("axes of matplotlib", _panels, error=_wrong_class),
}
_COLLECTIONS: dict[Any, Callable[..., Kind]] = {
    Mapping: _mapping,
    dict: _mapping,
    tuple: _tuple,
    Sequence: _sequence,
    Iterable: _names,
}
