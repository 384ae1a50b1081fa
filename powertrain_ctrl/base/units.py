"""The only place where units are converted: SI inside, ``rpm(1400)`` at the door.

>>> round(rpm(3000), 3), round(kmh(36), 3)
(314.159, 10.0)
"""

from __future__ import annotations

from math import pi
from typing import TypeVar

import numpy as np

from .doors import checked
from .errors import PowertrainError, suggestion

Number = TypeVar("Number", float, np.ndarray)


@checked
def rpm(speed: Number) -> Number:
    """Angular speed [rad/s] from revolutions per minute.

    Parameters
    ----------
    speed : float or ndarray
        [1/min].

    Returns
    -------
    float or ndarray
        [rad/s].

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> round(pt.rpm(60), 6)
    6.283185
    """
    return speed * (pi / 30.0)


@checked
def kmh(speed: Number) -> Number:
    """Speed [m/s] from kilometres per hour.

    Parameters
    ----------
    speed : float or ndarray
        [km/h].

    Returns
    -------
    float or ndarray
        [m/s].

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.kmh(90.0)
    25.0
    """
    return speed / 3.6


def to_rpm(omega: Number) -> Number:
    """Revolutions per minute from an angular speed [rad/s].

    >>> round(to_rpm(rpm(5000)), 9)
    5000.0
    """
    return omega * (30.0 / pi)


def to_hz(omega: Number) -> Number:
    """Frequency [Hz] from an angular frequency [rad/s].

    >>> round(to_hz(2 * pi), 9)
    1.0
    """
    return omega / (2.0 * pi)


# One of each in SI units.
IN_SI = {
    "s": 1.0,
    "ms": 1e-3,
    "us": 1e-6,
    "min": 60.0,
    "rad": 1.0,
    "deg": pi / 180.0,
    "rev": 2.0 * pi,
    "rad/s": 1.0,
    "rpm": pi / 30.0,
    "1/min": pi / 30.0,
    "deg/s": pi / 180.0,
    "rev/s": 2.0 * pi,
    "rad/s^2": 1.0,
    "m/s": 1.0,
    "km/h": 1.0 / 3.6,
    "mph": 0.44704,
    "m/s^2": 1.0,
    "g": 9.80665,
    "N": 1.0,
    "kN": 1e3,
    "N m": 1.0,
    "Nm": 1.0,
    "kNm": 1e3,
}


def in_si(values: np.ndarray, unit: str | float, what: str) -> np.ndarray:
    """Values in SI units from those in a unit, by name or by how many SI units it has; as they are for 1.

    >>> in_si(np.array([36.0]), "km/h", "vehicle_speed").round(9)
    array([10.])
    """
    if isinstance(unit, str) and unit not in IN_SI:
        raise PowertrainError(
            f'{what}: unit "{unit}" is not known{suggestion(unit, IN_SI)}; permitted: one of these, or a factor'
        )
    factor = IN_SI[unit] if isinstance(unit, str) else unit
    return values if factor == 1.0 else values * factor
