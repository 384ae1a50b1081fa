"""Checks of the values that users give: what is not permitted raises an error that names it."""

from collections.abc import Mapping
from math import inf, isfinite
from numbers import Real
from typing import Any

from .errors import ParameterError, PowertrainError

FINITE = "finite"
POSITIVE = "> 0 and finite"
NOT_NEGATIVE = ">= 0 and finite"
NOT_ZERO = "not 0, finite"
AT_LEAST_ONE = ">= 1 and finite"
SHARE = "0 to 1"
_HOLDS = {
    FINITE: lambda x: True,
    POSITIVE: lambda x: x > 0.0,
    NOT_NEGATIVE: lambda x: x >= 0.0,
    NOT_ZERO: lambda x: x != 0.0,
    AT_LEAST_ONE: lambda x: x >= 1.0,
    SHARE: lambda x: 0.0 <= x <= 1.0,
}


def checked_number(owner: str, parameter: str, value: Any, unit: str, permitted: str) -> float:
    """The value as a float, or a `ParameterError`."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise ParameterError(owner, parameter, value, unit, f"a number, {permitted}")
    try:
        number = float(value)
    except OverflowError:  # a whole number beyond the floats, of either sign
        number = inf
    if not (isfinite(number) and _HOLDS[permitted](number)):
        raise ParameterError(owner, parameter, number, unit, permitted)
    return number


def checked_mapping(what: str, given: Any, meaning: str) -> dict[str, Any]:
    """Named values as a dict, empty for None; anything but a mapping is a `PowertrainError`."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise PowertrainError(f"{what} is of type {type(given).__name__}, permitted: a mapping, {meaning}")
    return dict(given)
