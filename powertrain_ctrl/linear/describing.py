"""How the frequency of a mode depends on its amplitude where one spring has play or stages: by the describing function.

The spring is replaced by the stiffness that carries as much of the fundamental: ``N(A) = 1 / (pi A)`` times the integral of
``T(b + A cos(theta)) cos(theta)`` over a period, about the bias b at which no mean torque is left (Gelb, Vander Velde:
Multiple-Input Describing Functions and Nonlinear System Design (1968), chapter 2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.optimize
from numpy.typing import ArrayLike

from ..base.checks import Count
from ..base.doors import called, checked
from ..base.errors import PowertrainError
from ..base.records import Record
from ..base.tables import html_table, text_table
from ..driveline.collection import Driveline, HasDriveline, rebuilt
from ..elements import Compliance, Element, Law
from .assembly import as_driveline
from .modal import modes


@called
@dataclass(frozen=True, eq=False, repr=False)
class DescribedFrequency(Record):
    """Frequency of a mode over the amplitude of a spring with play or stages; approximate.

    Attributes
    ----------
    element : str
        The spring.
    amplitude : (n,) ndarray
        Of its twist about the middle of the swing [rad].
    stiffness : (n,) ndarray
        That acts on the fundamental [N m/rad].
    frequency_hz : (n,) ndarray
        Undamped frequency of the mode [Hz].
    error : (n,) ndarray
        By how much the same approximation is wrong for one inertia on this spring, whose period is known exactly [-].

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> play = pt.Backlash("play", "a", "b", gap=0.02, stiffness=4000.0)
    >>> car = pt.Driveline(pt.Inertia("a", J=0.2), pt.Inertia("b", J=0.2), play)
    >>> pt.describing_frequency(car, 1, [0.02, 0.2]).frequency_hz.round(2)
    array([19.9, 30.8])
    """

    element: str
    amplitude: np.ndarray
    stiffness: np.ndarray
    frequency_hz: np.ndarray
    error: np.ndarray

    def _table(self) -> tuple[list[str], list[list[str]]]:
        header = [f"amplitude of {self.element} [rad]", "stiffness [N m/rad]", "about f [Hz]", "error, one inertia [%]"]
        columns = (self.amplitude, self.stiffness, self.frequency_hz, 100.0 * self.error)
        return header, [[f"{value:.4g}" for value in row] for row in zip(*columns, strict=True)]

    def __repr__(self) -> str:
        return text_table(*self._table())

    def _repr_html_(self) -> str:
        return html_table(*self._table())


@checked
def describing_frequency(car: HasDriveline, mode: Count, amplitudes: ArrayLike) -> DescribedFrequency:
    """Approximate frequency of a mode over the amplitude of the one spring that has play or stages.

    Parameters
    ----------
    car : Driveline
        Its only law besides clutches and friction is that of a `Backlash` or a `MultiStageSpring`; dampers are left out.
    mode : int
        Number of the mode, as in the table of `modes`, of the driveline with that stiffness.
    amplitudes : (n,) array_like
        Of the twist of that spring [rad], > 0, of play beyond half the gap.

    Returns
    -------
    DescribedFrequency

    Raises
    ------
    PowertrainError
        None or more than one such spring, an amplitude that does not reach a flank, a mode that is not there.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pair = pt.Driveline(
    ...     pt.Inertia("a", J=0.2), pt.Inertia("b", J=1e6), pt.Backlash("play", "a", "b", gap=0.1, stiffness=4000.0)
    ... )
    >>> pt.describing_frequency(pair, 1, [0.06, 0.1, 0.3])
    amplitude of play [rad]  stiffness [N m/rad]  about f [Hz]  error, one inertia [%]
                       0.06                318.4          6.35                   18.02
                        0.1                 1564         14.07                   2.338
                        0.3                 3155         19.99                  0.1213
    """
    driveline = as_driveline(car)
    found = [(e, law) for e in driveline for law in e.laws if law.carries]
    others = [law.owner for e in driveline for law in e.laws if not law.is_clutch and law.owner != e.name]
    if len(found) != 1 or others:
        names = ", ".join(e.name for e, _ in found) or "none"
        raise PowertrainError(f"springs with play or stages: {names}, permitted: one; the others by car.at(...)")
    (element, law), chosen = found[0], np.atleast_1d(np.asarray(amplitudes, dtype=float))
    line = _Polyline(law)
    stiffness, error, frequency = np.empty((3, len(chosen)))
    for i, amplitude in enumerate(chosen):
        if not (np.isfinite(amplitude) and amplitude > line.least):
            raise PowertrainError(
                f"{element.name}: amplitude = {amplitude:g} rad, permitted: > {line.least:g} rad, finite"
            )
        stiffness[i] = line.stiffness(float(amplitude))
        error[i] = np.sqrt(stiffness[i]) * line.period(float(amplitude)) / (2.0 * np.pi) - 1.0
        frequency[i] = _frequency(driveline, element, law, stiffness[i], mode)
    return DescribedFrequency(element.name, chosen, stiffness, frequency, error)


def _frequency(driveline: Driveline, element: Element, law: Law, stiffness: float, mode: int) -> float:
    spring = Compliance(element.name, law.coefficients, stiffness=stiffness, damping=0.0)
    found = modes(rebuilt(driveline, (spring if e is element else e for e in driveline)))
    if not mode < len(found):
        raise PowertrainError(f"mode = {mode}, permitted: 0 to {len(found) - 1}")
    return float(found.frequency_hz[mode])


class _Polyline:
    """Torque over twist of a law without its dampers, as lines between knots."""

    def __init__(self, law: Law):
        contacts = [mode for mode in law.modes.values() if not mode.held and mode.kind != "open"]
        knots = {
            round(q, 15): t
            for mode in contacts
            for q, t in _ends(mode.guards, mode.origin, mode.torque, mode.stiffness)
        }
        self.q = np.array(sorted(knots))
        self.T = np.array([knots[q] for q in self.q])
        slopes = sorted((mode.origin or 0.0, mode.stiffness) for mode in contacts)
        self.first, self.last = slopes[0][1], slopes[-1][1]
        flat = self.q[self.T == 0.0]
        self.least = 0.5 * float(np.ptp(flat)) if len(flat) else 0.0

    def lines(self, low: float, high: float) -> Sequence[tuple[float, float, float, float]]:
        """Pieces (from, to, torque at the start, slope) between two twists."""
        q, T = self.q, self.T
        edges = np.unique([low, *q[(q > low) & (q < high)], high])
        far = float(high - low)
        grid = np.r_[q[0] - far, q, q[-1] + far]
        torque = np.interp(edges, grid, np.r_[T[0] - far * self.first, T, T[-1] + far * self.last])
        return [
            (a, b, s, (t - s) / (b - a))
            for a, b, s, t in zip(edges[:-1], edges[1:], torque[:-1], torque[1:], strict=True)
        ]

    def _integrals(self, bias: float, amplitude: float) -> tuple[float, float]:
        """Of T and of T cos over half a period."""
        mean = fundamental = 0.0
        for a, b, torque, slope in self.lines(bias - amplitude, bias + amplitude):
            far, near = (np.arccos(np.clip((q - bias) / amplitude, -1.0, 1.0)) for q in (a, b))
            constant, linear = torque + slope * (bias - a), slope * amplitude

            def of(angle: float, constant: float = constant, linear: float = linear) -> tuple[float, float]:
                sine = np.sin(angle)
                half = 0.5 * (angle + sine * np.cos(angle))
                return constant * angle + linear * sine, constant * sine + linear * half

            (mean_far, first_far), (mean_near, first_near) = of(far), of(near)
            mean, fundamental = mean + mean_far - mean_near, fundamental + first_far - first_near
        return mean, fundamental

    def stiffness(self, amplitude: float) -> float:
        """That of the fundamental, about the bias without mean torque."""
        bias = _zero(lambda b: self._integrals(b, amplitude)[0], self.q, amplitude)
        return 2.0 * self._integrals(bias, amplitude)[1] / (np.pi * amplitude)

    def period(self, amplitude: float) -> float:
        """Exact period of an inertia of 1 kg m^2 [s] that swings by the amplitude to either side of the middle."""

        def work(middle: float) -> float:
            return sum(
                (b - a) * (t + 0.5 * k * (b - a)) for a, b, t, k in self.lines(middle - amplitude, middle + amplitude)
            )

        middle = _zero(work, self.q, amplitude)
        energy = half = 0.0
        pieces = self.lines(middle - amplitude, middle + amplitude)
        for a, b, torque, slope in pieces:
            speed = np.sqrt(max(2.0 * energy, 0.0))
            energy -= (b - a) * (torque + 0.5 * slope * (b - a))
            after = np.sqrt(max(2.0 * energy, 0.0)) if b < pieces[-1][1] else 0.0
            if slope > 0.0:
                w, rest = np.sqrt(slope), a - torque / slope
                half += (np.arctan2(speed / w, a - rest) - np.arctan2(after / w, b - rest)) / w
            else:
                half += 2.0 * (b - a) / (speed + after)
        return 2.0 * float(half)


def _ends(guards: Sequence, origin: float | None, torque: float, stiffness: float) -> list[tuple[float, float]]:
    """Twists at which a mode ends, with its torque there."""
    twists = [g.level / -g.twist for g in guards if g.twist and not g.stretch]
    if not twists and origin is not None:
        twists = [origin]
    return [(q, torque + stiffness * (q - (origin if origin is not None else q))) for q in twists]


def _zero(function: object, knots: np.ndarray, amplitude: float) -> float:
    """Where a function that rises with the bias is zero; 0 if it is so there."""
    if function(0.0) == 0.0:  # type: ignore[operator]
        return 0.0
    reach = float(np.abs(knots).max()) + amplitude
    return float(scipy.optimize.brentq(function, -reach, reach, xtol=1e-15))  # type: ignore[call-overload]
