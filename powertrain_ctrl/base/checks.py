"""Checks of the values that users give: what is not permitted raises an error that names it."""

from collections.abc import Iterable, Mapping
from math import inf, isfinite, isnan
from numbers import Real
from typing import Annotated, Any

import numpy as np

from .errors import ParameterError, PowertrainError

FINITE = "finite"
POSITIVE = "> 0 and finite"
NOT_NEGATIVE = ">= 0 and finite"
NOT_ZERO = "not 0, finite"
NEITHER = "not 0 and finite"
AT_LEAST_ONE = ">= 1 and finite"
SHARE = "0 to 1"
PART = "> 0, at most 1"
LIMIT = "not nan"
# of a number or of an array of them
_HOLDS = {
    FINITE: lambda x: True,
    POSITIVE: lambda x: x > 0.0,
    NOT_NEGATIVE: lambda x: x >= 0.0,
    NOT_ZERO: lambda x: x != 0.0,
    NEITHER: lambda x: x != 0.0,
    AT_LEAST_ONE: lambda x: x >= 1.0,
    SHARE: lambda x: (x >= 0.0) & (x <= 1.0),
    PART: lambda x: (x > 0.0) & (x <= 1.0),
}
# A double carries sixteen digits: of values further apart than this one no longer notices the other. Squares and ratios of
# what lies within are far from the ends of the floats.
LARGEST = 1e15
SMALLEST = 1e-15
# More samples than this are not held at once.
MOST = 10_000_000

# What public functions say of their parameters; the door (`doors.checked`) holds them to it.
Number = Annotated[float, "", FINITE]
Factor = Annotated[float, "", NOT_NEGATIVE]
Positive = Annotated[float, "", POSITIVE]
Ratio = Annotated[float, "", NOT_ZERO]
Share = Annotated[float, "", SHARE]
Seconds = Annotated[float, "s", FINITE]
Duration = Annotated[float, "s", NOT_NEGATIVE]
Period = Annotated[float, "s", POSITIVE]
Hertz = Annotated[float, "Hz", NOT_NEGATIVE]
Frequency = Annotated[float, "Hz", POSITIVE]
MomentOfInertia = Annotated[float, "kg m^2", POSITIVE]
Stiffness = Annotated[float, "N m/rad", POSITIVE]
Damping = Annotated[float, "N m s/rad", NOT_NEGATIVE]
SpeedGain = Annotated[float, "N m s/rad", POSITIVE]
Radius = Annotated[float, "m", POSITIVE]
Torque = Annotated[float, "N m", FINITE]
TorqueLimit = Annotated[float, "N m", LIMIT]
TorqueNoise = Annotated[float, "N m", POSITIVE]
Capacity = Annotated[float, "N m", NOT_NEGATIVE]
Speed = Annotated[float, "rad/s", FINITE]
SpeedError = Annotated[float, "rad/s", NOT_NEGATIVE]
SpeedNoise = Annotated[float, "rad/s", POSITIVE]
Acceleration = Annotated[float, "m/s^2", NEITHER]
Effort = Annotated[float, "(rad/s / N m)^2", POSITIVE]
Seed = Annotated[int, "", 0, LARGEST]
Count = Annotated[int, "", 0, MOST]
AtLeastOne = Annotated[int, "", 1, MOST]


def checked_number(owner: str, parameter: str, value: Any, unit: str, permitted: str, smallest: float = 0.0) -> float:
    """The value as a float, or a `ParameterError`; in size 0, or ``smallest`` to `LARGEST`."""
    number = as_number(value)
    reason = f"a number, {permitted}" if number is None else outside(number, permitted, smallest)
    if reason:
        raise ParameterError(owner, parameter, value if number is None else number, unit, reason)
    return float(value)


def checked_points(owner: str, parameter: str, value: Any, unit: str, permitted: str = FINITE) -> tuple[float, ...]:
    """A sequence of numbers as a tuple of floats, or a `ParameterError` that names the first that is not permitted."""
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        raise ParameterError(owner, parameter, value, unit, "a sequence of numbers")
    return tuple(checked_number(owner, parameter, number, unit, permitted) for number in value)


def as_number(value: Any) -> float | None:
    """A real number as a float, infinite beyond the floats; None for what is none."""
    if type(value) is float:
        return value
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf  # type: ignore[operator]


def outside(number: float, permitted: str, smallest: float = 0.0) -> str:
    """What would be permitted instead of this number; nothing if it is."""
    if permitted == LIMIT:
        return LIMIT if isnan(number) else ""
    if not (isfinite(number) and _HOLDS[permitted](number)):
        return permitted
    if abs(number) > LARGEST:
        return f"{permitted}, at most {LARGEST:g} in size"
    if 0.0 < abs(number) < smallest:
        return f"{permitted}, at least {smallest:g}" + (" or 0" if permitted == NOT_NEGATIVE else "")
    return ""


def first_outside(values: np.ndarray, permitted: str, smallest: float = 0.0) -> int | None:
    """Index of the first number of an array that is not permitted, None if all are."""
    size = np.abs(values)
    fits = (size <= LARGEST) & ((size == 0.0) | (size >= smallest)) & _HOLDS[permitted](values)
    return None if fits.all() else int(fits.argmin())


def checked_mapping(what: str, given: Any, meaning: str) -> dict[str, Any]:
    """Named values as a dict, empty for None; anything but a mapping is a `PowertrainError`."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise PowertrainError(f"{what} is of type {type(given).__name__}, permitted: a mapping, {meaning}")
    return dict(given)
