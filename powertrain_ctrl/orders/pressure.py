"""Pressure in a cylinder over its cycle: a table, or a plausible one by the law of Wiebe."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from ..base.checks import FINITE, LARGEST, POSITIVE, Torque
from ..base.doors import checked
from ..base.errors import ParameterError
from ..base.kinds import Refused, real_numbers
from .crank import SliderCrank

Angle = Annotated[float, "rad", FINITE]
Pressure = Annotated[float, "Pa", POSITIVE]
Positive = Annotated[float, "", POSITIVE]

# Steps of a computed cycle of 720 degrees.
STEPS = 2880
# Angle constant [rad] with which the cylinder empties and fills when a valve opens.
BLOW_DOWN = 0.12
# Wiebe's efficiency factor: 99.9 % has burnt at the end.
BURNT = 6.9
# A table may miss the cycle by this part of it, as printed angles do.
CYCLE = 1e-6


@dataclass(frozen=True)
class Wiebe:
    """Four-stroke cycle whose heat release follows Wiebe; the heat is found from the mean torque. Made by `wiebe`."""

    mean_torque: float
    compression_ratio: float
    start: float
    duration: float
    shape: float
    intake: float
    exhaust: float
    polytropic: float

    def table(self, crank: SliderCrank) -> tuple[np.ndarray, np.ndarray]:
        """Angles (n,) from firing top dead centre, and pressures (2, n): without heat, and per heat over swept area [J/m^2].

        Between the valves ``d(p V^n) = (n - 1) V^(n - 1) dQ``; a volume is a length here, per area of the piston.
        """
        angle = -np.pi + 4.0 * np.pi * np.arange(STEPS + 1) / STEPS
        volume = crank.stroke / (self.compression_ratio - 1.0) + crank.travel(angle)
        closed = angle <= np.pi
        burnt = 1.0 - np.exp(-BURNT * (np.clip(angle - self.start, 0.0, None) / self.duration) ** (self.shape + 1.0))
        n = self.polytropic
        power = volume ** (n - 1.0)
        heated = (n - 1.0) * np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(burnt))])
        motored, fired = self.intake * (volume[0] / volume) ** n, heated / volume**n
        last = int(np.flatnonzero(closed)[-1])
        since, again = np.clip(angle - np.pi, 0.0, None), np.clip(angle - 2.0 * np.pi, 0.0, None)
        emptying, filling = np.exp(-since / BLOW_DOWN), np.exp(-again / BLOW_DOWN)
        rest = self.exhaust + (motored[last] - self.exhaust) * emptying
        rest = np.where(angle < 2.0 * np.pi, rest, self.intake + (self.exhaust - self.intake) * filling)
        pressures = np.array([np.where(closed, motored, rest), np.where(closed, fired, fired[last] * emptying)])
        pressures[1, angle >= 2.0 * np.pi] = 0.0
        return angle, pressures


@checked
def wiebe(
    *,
    mean_torque: Torque,
    compression_ratio: Positive = 10.0,
    start: Angle = -0.17,
    duration: Positive = 1.05,
    shape: Positive = 2.0,
    intake: Pressure = 1.0e5,
    exhaust: Pressure = 1.1e5,
    polytropic: Positive = 1.32,
) -> Wiebe:
    """Pressure of a four-stroke engine with a given mean torque: plausible, not measured; a measured table is better.

    Polytropic compression and expansion, heat release by Wiebe's law, emptying and filling over some degrees: Heywood,
    Internal Combustion Engine Fundamentals (1988), sections 9.2 and 5.5. The heat is what it takes for the mean torque.

    Parameters
    ----------
    mean_torque : float
        Of the gas in all cylinders [N m], pumping included; `order_response` takes others by ``load``.
    compression_ratio : float
        Largest over smallest volume [-], > 1.
    start, duration : float
        Of the burning [rad] of crank angle from top dead centre; duration > 0.
    shape : float
        Wiebe's exponent m [-], > 0.
    intake, exhaust : float
        Pressures [Pa], > 0.
    polytropic : float
        Exponent n [-], > 1.

    Returns
    -------
    Wiebe

    Raises
    ------
    ParameterError
        A value that is not permitted, or a burning that is not over when the exhaust valve opens.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> engine = pt.Engine(
    ...     cylinders=4, firing_order=(1, 3, 4, 2), bore=0.0825, stroke=0.0928, rod=0.144, reciprocating_mass=0.55,
    ...     pressure=pt.orders.wiebe(mean_torque=150.0),
    ... )
    >>> round(engine.mean_torque(), 9)
    150.0
    """
    for name, value in {"compression_ratio": compression_ratio, "polytropic": polytropic}.items():
        if value <= 1.0:
            raise ParameterError("wiebe", name, value, "", "> 1")
    if not -np.pi <= start < start + duration <= np.pi:
        raise ParameterError(
            "wiebe", "start and duration", (start, duration), "rad", "within half a turn of top dead centre"
        )
    return Wiebe(mean_torque, compression_ratio, start, duration, shape, intake, exhaust, polytropic)


def checked_table(given: Any, cycle: float) -> tuple[np.ndarray, np.ndarray]:
    """Angles and pressures of a table that spans the cycle, or a `ParameterError`."""
    try:
        angle, pressure = (real_numbers(each) for each in given)
    except (Refused, TypeError, ValueError):
        raise ParameterError(
            "Engine", "pressure", given, "", "angles [rad] and pressures [Pa], as many of each"
        ) from None
    if angle.ndim != 1 or angle.shape != pressure.shape or len(angle) < 2:
        shapes = f"of shapes {angle.shape} and {pressure.shape}"
        raise ParameterError("Engine", "pressure", shapes, "", "angles [rad] and pressures [Pa], as many of each")
    for values, unit in ((angle, "rad"), (pressure, "Pa")):
        if (wrong := ~(np.abs(values) <= LARGEST)).any():
            raise ParameterError("Engine", "pressure", float(values[wrong][0]), unit, "finite")
    if (np.diff(angle) < 0.0).any():
        i = int((np.diff(angle) < 0.0).argmax())
        raise ParameterError("Engine", "pressure", float(angle[i + 1]), "rad", f">= {angle[i]:g} rad, the angle before")
    if abs(angle[-1] - angle[0] - cycle) > CYCLE * cycle:
        span = f"from {angle[0]:g} to {angle[-1]:g}"
        permitted = f"over the whole cycle of {cycle:.6g} rad, its first value again at the end"
        raise ParameterError("Engine", "pressure", span, "rad", permitted)
    return angle, pressure
