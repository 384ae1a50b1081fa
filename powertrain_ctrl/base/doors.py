"""What a public function is given is checked once, at its door, against its annotations (`kinds`); inner code stays bare."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cached_property, wraps
from typing import Any, TypeVar, cast

from .errors import ArgumentError, PowertrainError, suggestion
from .kinds import Kind, Refused, kind_of

T = TypeVar("T", bound=Callable[..., Any])

# Records that are spoken of by other words than their name.
SPOKEN = {"SampledPlant": "sampled plant", "Sensors": "sensors", "TwoMass": "two-mass model"}
# What Python gives a method by itself.
BOUND = ("self", "cls")


def checked(thing: T) -> T:
    """A function, method or record that checks what it is given; what cannot be computed is a `PowertrainError` too.

    >>> from powertrain_ctrl.base.checks import Seconds
    >>> @checked
    ... def wait(time: Seconds): ...
    >>> wait("soon")
    Traceback (most recent call last):
    ...
    powertrain_ctrl.base.errors.ParameterError: wait: time = 'soon' s, permitted: a number, finite
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
        given, by_keyword = door.taken(args, kwargs) if values else (args, kwargs)
        try:
            return function(*given, **by_keyword)
        except PowertrainError:
            raise
        except TypeError:
            # names and number of the arguments Python checks too; the door has the words for it
            door.taken(args, kwargs)
            raise
        except (ArithmeticError, ValueError, MemoryError) as error:
            # Never TypeError, IndexError, ...: those are mistakes of this package.
            raise PowertrainError(f"{name}: cannot be computed with these values: {error}") from error

    return guarded


class _Door:
    """What a function takes, found out at its first call."""

    def __init__(self, function: Callable[..., Any], name: str, values: bool):
        self.function, self.name, self.values = function, name, values

    @cached_property
    def _parameters(self) -> tuple:
        """By position, all that may be given so; by name, all that may be; what takes the rest of each; what is needed."""
        by_position: list[tuple[str, Kind | None]] = []
        by_name: dict[str, Kind | None] = {}
        rest: dict[Any, tuple[str, Kind | None]] = {}
        needed = []
        many, others = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
        for p in inspect.signature(self.function).parameters.values():
            kind = kind_of(p, self.function.__globals__) if self.values else None
            if p.kind in (many, others):
                rest[p.kind] = p.name, kind
                continue
            if p.kind is not p.KEYWORD_ONLY:
                by_position.append((p.name, kind))
            if p.kind is not p.POSITIONAL_ONLY:
                by_name[p.name] = kind
            if p.default is p.empty:
                needed.append(p.name)
        return by_position, by_name, rest.get(many), rest.get(others), needed

    def taken(self, args: tuple, kwargs: dict[str, Any]) -> tuple[list, dict[str, Any]]:
        """The arguments as the function wants them, or the error that names what is wrong with them."""
        by_position, by_name, many, others, needed = self._parameters
        placed = len(args)
        given, named = [], {}
        try:
            for (parameter, kind), value in zip(by_position, args, strict=False):  # noqa: B007
                given.append(value if kind is None else kind.take(value))
            if placed > len(by_position):
                if many is None:
                    raise self._too_many(placed)
                kind = many[1]
                for i, value in enumerate(args[len(by_position) :]):
                    parameter = f"{many[0]}[{i}]"
                    given.append(value if kind is None else kind.take(value))
            for parameter, value in kwargs.items():
                if parameter in by_name:
                    kind = by_name[parameter]
                elif others is None:
                    raise ArgumentError(f'{self.name} has no parameter "{parameter}"{suggestion(parameter, self._own)}')
                else:
                    kind = others[1]
                named[parameter] = value if kind is None else kind.take(value)
        except Refused as refused:
            assert kind is not None
            error = refused.error(self.name, parameter, kind)
        else:
            self._require_each_once([name for name, _ in by_position[:placed]], named, needed)
            return given, named
        raise error

    def _require_each_once(self, placed: list[str], named: dict[str, Any], needed: list[str]) -> None:
        by_name = self._parameters[1]
        for name in placed:
            if name in named and name in by_name:
                raise ArgumentError(f"{self.name}: {name} is given twice, by position and by keyword")
        missing = [name for name in needed if name not in placed and name not in named]
        if missing:
            written = [f"{name}=..." if name in by_name else name for name in missing]
            raise ArgumentError(f"{self.name}: not given: {', '.join(written)}")

    @property
    def _own(self) -> list[str]:
        """Names that a user may give."""
        return [name for name in self._parameters[1] if name not in BOUND and not name.startswith("_")]

    def _too_many(self, count: int) -> ArgumentError:
        names = [name for name, _ in self._parameters[0] if name not in BOUND]
        own = len(self._parameters[0]) - len(names)
        others = [f"{name}=..." for name in self._own if name not in names]
        takes = f"permitted: {len(names)}" + (f" ({', '.join(names)})" if names else "")
        keyword = f"; give by keyword: {', '.join(others)}" if others else ""
        return ArgumentError(f"{self.name}: {count - own} values by position, {takes}{keyword}")
