"""The only place where units are converted: SI inside, ``rpm(1400)`` at the door.

>>> round(rpm(3000), 3), round(kmh(36), 3)
(314.159, 10.0)
"""

from __future__ import annotations

from math import pi
from typing import TypeVar

import numpy as np

from .doors import checked

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
