"""Harmonic input signals: sines that a simulation follows exactly, each frequency by two states of an oscillator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from ..base.checks import LARGEST, POSITIVE, Number
from ..base.doors import checked
from ..base.errors import SignalError
from .signals import Exact, PiecewiseLinear, Signal

AngularFrequency = Annotated[float, "rad/s", POSITIVE]


NOTHING = PiecewiseLinear((0.0,), (0.0,))


class Tone(NamedTuple):
    """One frequency [rad/s] and its complex amplitude in each of the inputs."""

    omega: float
    amplitudes: tuple[complex, ...]


@dataclass(frozen=True, eq=False)
class Harmonic(Exact):
    """Sum of ``Re(amplitude exp(j omega t))`` over some frequencies, and of a signal through points.

    Signals add up, and times a number they scale.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> torque = pt.harmonic(30.0, omega=100.0) + pt.ramp(0.0, 1.0, 50.0)
    >>> [round(float(torque(t)), 6) for t in (0.0, 0.5)]
    [30.0, 53.948981]
    """

    tones: tuple[tuple[float, complex], ...]
    rest: PiecewiseLinear = NOTHING
    __array_ufunc__ = None  # an array times a signal is for the signal to answer

    def __post_init__(self) -> None:
        for omega, amplitude in self.tones:
            if not 0.0 < omega <= LARGEST or not abs(amplitude) <= LARGEST:
                permitted = f"frequencies > 0, amplitudes finite, at most {LARGEST:g} in size"
                raise SignalError(f"omega = {omega} rad/s, amplitude = {amplitude}, permitted: {permitted}")

    def __call__(self, t: float | np.ndarray) -> np.ndarray:
        """Value at t."""
        waves = [(amplitude * np.exp(1j * omega * np.asarray(t))).real for omega, amplitude in self.tones]
        return self.rest(t) + sum(waves)

    @checked
    def __add__(self, other: Exact) -> Harmonic:
        if isinstance(other, PiecewiseLinear):
            return Harmonic(self.tones, self.rest + other)
        if not isinstance(other, Harmonic):
            return NotImplemented
        return Harmonic(self.tones + other.tones, self.rest + other.rest)

    __radd__ = __add__

    @checked
    def __mul__(self, factor: Number) -> Harmonic:
        return Harmonic(tuple((omega, factor * amplitude) for omega, amplitude in self.tones), factor * self.rest)

    __rmul__ = __mul__

    def __neg__(self) -> Harmonic:
        return -1.0 * self


@checked
def harmonic(amplitude: Number, omega: AngularFrequency, phase: Number = 0.0) -> Harmonic:
    """Signal ``amplitude cos(omega t + phase)``, which `simulate` follows exactly as a torque or force.

    Parameters
    ----------
    amplitude : float
        Peak value, in the unit of the signal.
    omega : float
        [rad/s], > 0.
    phase : float
        At t = 0 [rad].

    Returns
    -------
    Harmonic
        A function of time that can be added to others, to `ramp` and `step`, and multiplied by a number.

    Raises
    ------
    ParameterError
        A frequency that is not > 0, a value that is not a finite number.

    Examples
    --------
    A free inertia of 0.5 kg m^2 under 10 N m at 20 rad/s swings by ``10 / (0.5 20) = 1`` rad/s:

    >>> import numpy as np, powertrain_ctrl as pt
    >>> disc = pt.Driveline(pt.Inertia("disc", J=0.5))
    >>> response = pt.simulate(disc, np.linspace(0.0, 1.0, 101), {"disc_torque": pt.harmonic(10.0, omega=20.0)})
    >>> bool(abs(response["disc_speed"] - np.sin(20.0 * response.time)).max() < 1e-12)
    True
    """
    return Harmonic(((omega, complex(amplitude * np.exp(1j * phase))),))


def separated(inputs: Mapping[str, Signal], names: Sequence[str]) -> tuple[dict[str, Signal], tuple[Tone, ...]]:
    """Signals without the tones of these inputs, and the tones by frequency."""
    found: dict[float, list[complex]] = {}
    rest: dict[str, Any] = dict(inputs)
    for place, name in enumerate(names):
        signal = rest.get(name)
        if isinstance(signal, Harmonic):
            rest[name] = signal.rest
            for omega, amplitude in signal.tones:
                found.setdefault(omega, [0j] * len(names))[place] += amplitude
    tones = (Tone(omega, tuple(amplitudes)) for omega, amplitudes in found.items())
    return rest, tuple(tone for tone in tones if any(tone.amplitudes))
