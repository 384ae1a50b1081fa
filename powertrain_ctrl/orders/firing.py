"""When cylinders fire, and which orders there can be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..base.checks import LARGEST, as_number
from ..base.errors import ParameterError

# Orders that differ by this part are the same.
SAME = 1e-9
# Higher orders have no meaning in a crank train.
HIGHEST = 200.0
# What is left of the torques of cylinders that cancel is below this part of them.
CANCELLED = 1e-12


def firing_angles(
    cylinders: int, order: Sequence[int] | None, given: Sequence[float] | None, bank_angle: float | None, cycle: float
) -> np.ndarray:
    """(cylinders,) ndarray: crank angle [rad] at which each fires, by its number.

    Raises
    ------
    ParameterError
        An order that is no permutation, angles that are not as many, a bank angle that cylinders in pairs cannot have.

    Examples
    --------
    Six cylinders at 90 degrees on three common pins fire at uneven distances of 90 and 150 degrees:

    >>> np.rad2deg(firing_angles(6, (1, 6, 5, 4, 3, 2), None, np.pi / 2.0, 4.0 * np.pi)).round(6)
    array([  0., 570., 480., 330., 240.,  90.])
    """
    if given is not None:
        if order is not None or bank_angle is not None:
            raise ParameterError("Engine", "firing_angles", "given", "", "without firing_order and bank_angle")
        if len(given) != cylinders:
            permitted = f"one for each of {cylinders} cylinders"
            raise ParameterError("Engine", "firing_angles", f"{len(given)} values", "rad", permitted)
        return np.array(given, dtype=float)
    if order is None:
        if cylinders > 1:
            raise ParameterError("Engine", "firing_order", None, "", "given, such as (1, 3, 4, 2), or firing_angles")
        order = (1,)
    if sorted(order) != list(range(1, cylinders + 1)):
        raise ParameterError("Engine", "firing_order", tuple(order), "", f"each of 1 to {cylinders} once")
    place = np.argsort(order)
    if bank_angle is None:
        return place * cycle / cylinders
    between = 2.0 * cycle / cylinders
    if cylinders < 4 or cylinders % 2 or bank_angle >= between:
        permitted = f"of at least four cylinders in pairs, < {between:.6g} rad, the distance of the pairs"
        raise ParameterError("Engine", "bank_angle", bank_angle, "rad", permitted)
    return place // 2 * between + place % 2 * bank_angle


def checked_orders(given: Any, step: float) -> dict[float, complex]:
    """Order to complex amplitude, ascending; what is none is a `ParameterError`."""
    if not isinstance(given, Mapping) or not given:
        raise ParameterError("Engine", "orders", given, "", "{order: complex torque}, at least one")
    found = {}
    for key, value in given.items():
        order = as_number(key)
        multiple = 0.0 if order is None or not 0.0 < order <= HIGHEST else order / step
        if order is None or multiple < 0.5 or abs(multiple - round(multiple)) > SAME * multiple:
            raise ParameterError("Engine", "order", key, "", f"a multiple of {step:g}, > 0, at most {HIGHEST:g}")
        if isinstance(value, bool) or not isinstance(value, complex | float | int | np.number):
            raise ParameterError("Engine", f"torque of order {order:g}", value, "N m", "a complex number")
        if not abs(complex(value)) <= LARGEST:
            raise ParameterError("Engine", f"torque of order {order:g}", complex(value), "N m", "finite")
        found[order] = complex(value)
    return dict(sorted(found.items()))


def checked_order(owner: str, highest: float, step: float) -> float:
    """The highest order, or a `ParameterError`."""
    if not step <= highest <= HIGHEST:
        raise ParameterError(owner, "highest_order", highest, "", f"{step:g} to {HIGHEST:g}")
    return highest


def checked_speeds(owner: str, speed: Any) -> np.ndarray:
    """Speeds as a one-dimensional array; one that is not > 0 and finite is a `ParameterError`."""
    speeds = np.atleast_1d(np.asarray(speed, dtype=float))
    if speeds.ndim != 1 or not speeds.size:
        raise ParameterError(owner, "speed", f"of shape {speeds.shape}", "rad/s", "one-dimensional, at least one")
    if (wrong := ~((speeds > 0.0) & (speeds <= LARGEST))).any():
        raise ParameterError(owner, "speed", float(speeds[wrong][0]), "rad/s", f"> 0, at most {LARGEST:g}")
    return speeds


def together(phases: np.ndarray) -> np.ndarray:
    """(orders,) ndarray: sum of phases (orders, cylinders), exactly 0 where they cancel."""
    total = phases.sum(axis=1)
    return np.where(np.abs(total) <= CANCELLED * phases.shape[1], 0.0, total)
