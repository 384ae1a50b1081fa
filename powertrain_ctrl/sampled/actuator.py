"""What an actuator gives: times, limits and rates of its torque, as numbers or over speed; and to which nodes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np

from ..base.checks import FINITE, checked_number
from ..base.errors import ParameterError, UnknownNameError
from ..driveline.collection import Driveline, rebuilt
from ..elements import TorqueSplit

OWNER = "sampled plant"
# Lag, delay and sample time are shorter than this [s]: a slower actuator or controller cannot act on a shuffle of some
# hertz, and 1 or more is a time in milliseconds.
LONGEST = 1.0
BOTH = "that of a rise and of a fall"
# One value for both directions, or that of a rise and that of a fall.
Directed = float | tuple[float, float]


def both(value: Directed) -> tuple[float, float]:
    """That of a rise and that of a fall."""
    return value if isinstance(value, tuple) else (value, value)


def written(time: Directed, digits: int = 6) -> str:
    """A time in milliseconds.

    >>> written(0.03), written((0.05, 0.02))
    ('30 ms', '50 ms up, 20 ms down')
    """
    words = [f"{1e3 * each:.{digits}g} ms" for each in both(time)]
    return f"{words[0]} up, {words[1]} down" if isinstance(time, tuple) else words[0]


def time_of(name: str, given: Any, permitted: str, speed: float) -> Directed:
    """A time [s], or that of a rise and of a fall; of a table over speed [rad/s] that at this one, in straight lines.

    Times that are the same in both directions are one.
    """
    rows = _rows(given)
    if rows is None:
        found = _times(name, given, permitted)
    elif not rows:
        raise ParameterError(OWNER, name, {}, "s", "at least one speed")
    else:
        points = {
            checked_number(OWNER, f"speed of {name}", at, "rad/s", FINITE): _times(name, value, permitted)
            for at, value in rows
        }
        if len({len(times) for times in points.values()}) > 1:
            raise ParameterError(OWNER, name, given, "s", f"at each speed one number, or at each two, {BOTH}")
        speeds = sorted(points)
        columns = zip(*(points[at] for at in speeds), strict=True)
        found = tuple(float(np.interp(speed, speeds, column)) for column in columns)
    return found[0] if found[0] == found[-1] else (found[0], found[-1])


def _rows(given: Any) -> list[tuple[Any, Any]] | None:
    """Speeds of a table and what it says there; None of what is no table."""
    if isinstance(given, Mapping):
        return list(given.items())
    if isinstance(given, Sequence) and all(isinstance(row, Sequence) and len(row) in (2, 3) for row in given):
        return [(row[0], row[1] if len(row) == 2 else row[1:]) for row in given]
    return None


def _times(name: str, given: Any, permitted: str) -> tuple[float, ...]:
    """One time, or two, each checked."""
    if not isinstance(given, Sequence) or isinstance(given, str):
        return (_time(name, given, permitted),)
    if len(given) != 2:
        raise ParameterError(OWNER, name, given, "s", f"one number, or {BOTH}")
    return tuple(_time(name, time, permitted) for time in given)


def _time(name: str, given: Any, permitted: str) -> float:
    time = checked_number(OWNER, name, given, "s", permitted)
    if time >= LONGEST:
        permitted = f"{permitted.removesuffix(' and finite')} and below {LONGEST:g}; {time:g} ms is {1e-3 * time:g} s"
        raise ParameterError(OWNER, name, time, "s", permitted)
    return time


def limits_of(given: Any, owner: str = OWNER) -> tuple:
    """A pair of limits, or of a table rows of speed, smallest and largest torque, as they are kept."""
    if isinstance(given, Mapping):
        given = [(speed, *pair) if isinstance(pair, Sequence) else pair for speed, pair in given.items()]
    rows: list[Any] = list(given) if isinstance(given, Sequence) and not isinstance(given, str) else []
    is_table = bool(rows) and all(isinstance(row, Sequence) and len(row) == 3 for row in rows)
    pairs = [row[1:] for row in rows] if is_table else [rows if len(rows) == 2 else (0.0, 0.0)]
    for low, high in pairs:
        if not (isinstance(low, Real) and isinstance(high, Real) and float(low) < float(high)):
            raise ParameterError(owner, "torque_limits", given, "N m", "(smallest, largest), or these by speed")
    if not is_table:
        return tuple(rows)
    speeds = [checked_number(owner, "speed of torque_limits", row[0], "rad/s", FINITE) for row in rows]
    return tuple(sorted((speed, float(row[1]), float(row[2])) for speed, row in zip(speeds, rows, strict=True)))


def limits_at(limits: tuple, speed: float) -> tuple[float, float]:
    """Smallest and largest torque [N m] at a speed [rad/s], outside of a table as at its ends."""
    if not isinstance(limits[0], tuple):
        return limits
    low, high = limits_over(limits, speed)
    return float(low), float(high)


def limits_over(table: tuple, speeds: Any) -> tuple[Any, Any]:
    """Smallest and largest torques [N m] of a table at speeds [rad/s]."""
    at, low, high = np.array(table).T
    return np.interp(speeds, at, low), np.interp(speeds, at, high)


def rate_of(given: Any, owner: str = OWNER) -> Directed:
    """A rate for rise and fall, or one for each."""
    rates = list(given) if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    if not (
        len(rates) in (1, 2)
        and all(isinstance(rate, Real) and not isinstance(rate, bool) and float(rate) > 0.0 for rate in rates)
    ):
        raise ParameterError(owner, "torque_rate", given, "N m/s", f"> 0, one number or {BOTH}")
    return float(rates[0]) if len(rates) == 1 else (float(rates[0]), float(rates[1]))


def limits_written(low: float, high: float) -> str:
    """Smallest and largest torque in words.

    >>> limits_written(0.0, 350.0), limits_written(-np.inf, 350.0), limits_written(-np.inf, np.inf)
    ('torque 0 to 350 N m', 'torque up to 350 N m', 'torque without limits')
    """
    if np.isfinite([low, high]).all():
        return f"torque {low:g} to {high:g} N m"
    if np.isfinite(high):
        return f"torque up to {high:g} N m"
    return f"torque from {low:g} N m on" if np.isfinite(low) else "torque without limits"


def rates_written(rise: float, fall: float) -> str:
    """Fastest rise and fall in words.

    >>> rates_written(2e3, 2e3), rates_written(2e3, 4e3)
    ('at most 2000 N m/s', 'at most 2000 up and 4000 N m/s down')
    >>> rates_written(2e3, np.inf), rates_written(np.inf, np.inf)
    ('at most 2000 N m/s up', 'at any rate')
    """
    if rise == fall:
        return f"at most {rise:g} N m/s" if np.isfinite(rise) else "at any rate"
    if np.isfinite([rise, fall]).all():
        return f"at most {rise:g} up and {fall:g} N m/s down"
    return f"at most {rise:g} N m/s up" if np.isfinite(rise) else f"at most {fall:g} N m/s down"


def split_among(car: Driveline, shares: Mapping[str, Any]) -> tuple[Driveline, str]:
    """A car with a node at which one torque acts on several others with these shares, and that node."""
    if len(shares) < 2:
        raise ParameterError(OWNER, "actuator", dict(shares), "", "a node, or two and more with their shares")
    for node in shares:
        if node not in car.nodes:
            raise UnknownNameError("actuator", node, car.nodes, "a node of the driveline")
        if node in car.translating:
            raise ParameterError(OWNER, "actuator", node, "", "nodes that turn")
    node = "_and_".join(map(str, shares))
    return rebuilt(car, [*car, TorqueSplit(f"{node}_split", shares, node)]), node
