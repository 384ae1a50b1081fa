"""Exact response of a linear car to inputs that are linear between their samples, wherever it is looked at.

In modal coordinates ``y' = lambda y + b(t)``, and over a stretch of length h on which ``b = b0 + b1 t``

    y(h) = phi_0(lambda h) y(0) + h phi_1(lambda h) b0 + h^2 phi_2(lambda h) b1

with the phi-functions of exponential integrators: no step is too long and time stamps may be as uneven as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg

from ..driveline.collection import HasDriveline
from ..hybrid.flow import Flow, phi_functions
from ..hybrid.model import output_map
from ..hybrid.plant import Plant
from ..linear.assembly import assemble
from ..linear.outputs import output_rows, select

# Steps that differ by less than so many roundings of the time stamps are one.
SAME_STEP = 8.0
# By this part the damping is changed where eigenvectors run together, as at critical damping.
NUDGE = 1e-8


class Forcing(NamedTuple):
    """Inputs (inputs, stretches) as value at the beginning and slope of each stretch, that begin at ``knots`` [s]."""

    knots: np.ndarray
    value: np.ndarray
    slope: np.ndarray


class LinearCar:
    """``x' = A x + B u``, ``y = C x + D u`` of a car in energy coordinates, and its modes."""

    def __init__(self, car: HasDriveline, inputs: Sequence[str], outputs: Sequence[str]):
        model = assemble(car)
        plant = Plant(model)
        driving = select(inputs, model.inputs, "input") if inputs else []
        rows = output_map(plant)[select(outputs, output_rows(model).names, "output")]
        self._springs = plant.r
        self.A, self.B = plant.A, plant.B[:, driving]
        self.C, self.D = rows[:, : plant.N], rows[:, -len(model.inputs) :][:, driving]

    @cached_property
    def _modes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rates, ``x = Re(V y)``, and y of x."""
        flow = Flow(self.A)
        if not flow.is_modal:
            nudged = self.A.copy()
            nudged[self._springs :, self._springs :] *= 1.0 + NUDGE
            flow = Flow(nudged)
        return flow.eigenvalues, flow.V, flow.V_inverse

    @property
    def rates(self) -> np.ndarray:
        return self._modes[0]

    @cached_property
    def seen(self) -> np.ndarray:
        """(outputs, modes) ndarray: outputs from modal coordinates."""
        return self.C @ self._modes[1]

    @cached_property
    def driven(self) -> np.ndarray:
        """(modes, inputs) ndarray."""
        return self._modes[2] @ self.B

    def coordinates(self, x: np.ndarray) -> np.ndarray:
        """Modal coordinates y of x."""
        return self._modes[2] @ x

    def free(self, times: Sequence[np.ndarray], start: float, sizes: np.ndarray) -> np.ndarray:
        """(outputs, N, starts) ndarray: each output at its times from each of the `starts` by itself, given at ``start``."""
        rates, found = self.rates[self._fading], []
        for seen, t in zip(self.seen, times, strict=True):
            modes = seen[self._fading] * self._out(sizes) * np.exp(np.outer(t - start, rates))
            found.append(np.hstack([modes.real, -modes.imag[:, rates.imag > 0.0]]))
        return np.array(found)

    def starts(self, share: np.ndarray, sizes: np.ndarray) -> np.ndarray:
        """State from its shares: real parts of the modes that are not still, and imaginary ones of those that oscillate."""
        rates = self.rates[self._fading]
        y = share[: len(rates)].astype(complex)
        y[rates.imag > 0.0] += 1j * share[len(rates) :]
        return (self._modes[1][:, self._fading] @ (self._out(sizes) * y)).real

    @property
    def fading(self) -> int:
        """Number of states whose motion does not stay for ever."""
        return len(self._fading) + int(np.count_nonzero(self.rates.imag > 0.0))

    @cached_property
    def _fading(self) -> np.ndarray:
        return np.flatnonzero(self.rates)

    def _out(self, sizes: np.ndarray) -> np.ndarray:
        """How far modes are out when inputs of these sizes are taken away: ``|b u / lambda|``."""
        return (np.abs(self.driven) @ sizes)[self._fading] / np.abs(self.rates[self._fading])

    def step(self, h: float, inputs: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """``x+ = A x + B0 u + B1 u+`` over h for the first inputs, linear in between."""
        n, B = len(self.A), self.B[:, :inputs]
        still = np.zeros((inputs, n + inputs))
        matrix = np.block(
            [
                [self.A * h, B * h, np.zeros((n, inputs))],
                [still, np.eye(inputs)],
                [np.zeros((inputs, n + 2 * inputs))],
            ]
        )
        E = scipy.linalg.expm(matrix)
        return E[:n, :n], E[:n, n : n + inputs] - E[:n, n + inputs :], E[:n, n + inputs :]


def responses(
    cars: Sequence[LinearCar], forcings: Sequence[Forcing], times: Sequence[np.ndarray], x0: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Outputs of several cars at once and their rates, from rest or from the state x0 at the first knot.

    Parameters
    ----------
    cars : sequence of LinearCar
        With as many states, inputs and outputs each.
    forcings : sequence of Forcing
        One for each car, on the same knots.
    times : sequence of (N,) ndarray
        Of each output [s], not before the first knot.
    x0 : (states,) ndarray, optional

    Returns
    -------
    values, rates : (cars, outputs, N) ndarray
    """
    knots = forcings[0].knots
    tick = SAME_STEP * np.finfo(float).eps * max(float(np.abs(knots).max()), 1.0)
    width = max(len(car.rates) for car in cars)
    decay, gain = (np.zeros((len(knots) - 1, len(cars), width), dtype=complex) for _ in range(2))
    forced = []
    for i, (car, forcing) in enumerate(zip(cars, forcings, strict=True)):
        b, slope = car.driven @ forcing.value, car.driven @ forcing.slope
        phi = _phi(car.rates, np.diff(knots), tick)
        decay[:, i, : len(b)] = phi[0].T
        gain[:, i, : len(b)] = (phi[1] * b[:, :-1] + phi[2] * slope[:, :-1]).T
        forced.append((b, slope))
    y = np.zeros((len(knots), len(cars), width), dtype=complex)
    if x0 is not None:
        for i, car in enumerate(cars):
            y[0, i, : len(car.rates)] = car.coordinates(x0)
    now = y[0]
    for k in range(len(knots) - 1):
        now = decay[k] * now
        now += gain[k]
        y[k + 1] = now
    values = np.empty((len(cars), len(times), len(times[0])))
    rates = np.empty_like(values)
    for j, t in enumerate(times):
        last = np.searchsorted(knots, t, side="right") - 1
        h = t - knots[last]
        for i, (car, forcing, (b, slope)) in enumerate(zip(cars, forcings, forced, strict=True)):
            phi = _phi(car.rates, h, tick)
            there = phi[0] * y[last, i, : len(b)].T + phi[1] * b[:, last] + phi[2] * slope[:, last]
            values[i, j] = (car.seen[j] @ there).real + car.D[j] @ (forcing.value[:, last] + forcing.slope[:, last] * h)
            rate = car.rates[:, None] * there + b[:, last] + slope[:, last] * h
            rates[i, j] = (car.seen[j] @ rate).real + car.D[j] @ forcing.slope[:, last]
    return values, rates


def _phi(rates: np.ndarray, h: np.ndarray, tick: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(modes, steps) ndarrays ``phi_0``, ``h phi_1``, ``h^2 phi_2``; steps of the same length are computed once."""
    lengths, which = np.unique(tick * np.round(h / tick), return_inverse=True)
    phi = phi_functions(rates[:, None] * lengths, 2)
    return phi[0][:, which], (phi[1] * lengths)[:, which], (phi[2] * lengths**2)[:, which]
