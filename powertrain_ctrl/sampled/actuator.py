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


def time_of(name: str, given: Any, permitted: str, speed: float) -> float:
    """A time [s], of a table from speed [rad/s] to time that at this speed, in straight lines in between."""
    if isinstance(given, Sequence) and all(isinstance(row, Sequence) and len(row) == 2 for row in given):
        given = dict(given)
    if not isinstance(given, Mapping):
        return _time(name, given, permitted)
    if not given:
        raise ParameterError(OWNER, name, {}, "s", "at least one speed")
    points = {
        checked_number(OWNER, f"speed of {name}", at, "rad/s", FINITE): _time(name, value, permitted)
        for at, value in given.items()
    }
    speeds = sorted(points)
    return float(np.interp(speed, speeds, [points[at] for at in speeds]))


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
    speeds, low, high = np.array(limits).T
    return float(np.interp(speed, speeds, low)), float(np.interp(speed, speeds, high))


def rate_of(given: Any, owner: str = OWNER) -> float | tuple[float, float]:
    """A rate for rise and fall, or one for each."""
    rates = list(given) if isinstance(given, Sequence) and not isinstance(given, str) else [given]
    if not (
        len(rates) in (1, 2)
        and all(isinstance(rate, Real) and not isinstance(rate, bool) and float(rate) > 0.0 for rate in rates)
    ):
        raise ParameterError(owner, "torque_rate", given, "N m/s", "> 0, one number or that of a rise and of a fall")
    return float(rates[0]) if len(rates) == 1 else (float(rates[0]), float(rates[1]))


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
