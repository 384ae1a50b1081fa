"""What a car would have been measured to do in a run: a linear car exactly, and how it depends on every unknown.

Unknown besides the parameters are the delays and what a run brings with it and the fit only has to take out: an offset of
each output, the state of the car at the start, a constant road load. The output is linear in these, so they are columns.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from .channels import Channels
from .motion import Forcing, LinearCar, responses
from .unknowns import Unknowns

# Step of the central differences in the logarithm of a parameter; they are off by its square.
DIFFERENCE = 1e-5


class Prediction(Protocol):
    """What `output_error` needs of a run."""

    run: Channels
    columns: tuple[str, ...]

    def residuals(self, q: np.ndarray, delays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(outputs, N) measured less model without the columns; (outputs, N, columns) columns."""
        ...

    def sensitivities(self, q: np.ndarray, delays: np.ndarray, share: np.ndarray) -> np.ndarray:
        """(outputs, N, unknowns) derivative of the model by parameters and delays, its columns with these shares."""
        ...

    def linear(self, q: np.ndarray) -> LinearCar:
        """The car by which noise of the inputs reaches the outputs."""
        ...


class LinearPrediction:
    """A linear car in one run."""

    def __init__(self, run: Channels, unknowns: Unknowns, delayed: Sequence[str], road: str | None):
        self.run, self.unknowns, self.delayed, self.road = run, unknowns, tuple(delayed), road
        self.inputs = (*run.inputs, *([road] if road else []))
        self.linear = lru_cache(maxsize=2 * len(unknowns.names) + 4)(self._linear)
        states = len(self.linear(tuple(np.zeros(len(unknowns.names)))).A)
        self.columns = (*(f"offset of {name}" for name in run.outputs), *["state"] * states, *([road] if road else []))

    def _linear(self, q: Any) -> LinearCar:
        return LinearCar(self.unknowns.car_at(np.array(q)), self.inputs, self.run.outputs)

    def times(self, delays: np.ndarray) -> list[np.ndarray]:
        """When each output happened that was recorded at the time stamps."""
        late = dict(zip(self.delayed, delays, strict=True))
        return [self.run.time - late.get(name, 0.0) for name in self.run.outputs]

    def forcing(self, delays: np.ndarray, start: float) -> Forcing:
        """Inputs as they act, from ``start`` on, on the knots of all of them."""
        late = dict(zip(self.delayed, delays, strict=True))
        shifted = [(times + late.get(name, 0.0), values) for name, (times, values) in self.run.inputs.items()]
        knots = np.unique(np.concatenate([[start], *(times for times, _ in shifted)]))
        knots = knots[knots >= start]
        value = np.zeros((len(self.inputs), len(knots)))
        for row, (times, values) in zip(value, shifted, strict=False):
            row[:] = np.interp(knots, times, values)
        slope = np.zeros_like(value)
        slope[:, :-1] = np.diff(value) / np.diff(knots)
        return Forcing(knots, value, slope)

    def residuals(self, q: np.ndarray, delays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        car, times = self.linear(tuple(q)), self.times(delays)
        start = min(t[0] for t in times)
        forcing = self.forcing(delays, start)
        constant = np.zeros_like(forcing.value)
        if self.road:
            constant[-1] = 1.0
        values, _ = responses([car, car], [forcing, Forcing(forcing.knots, constant, np.zeros_like(constant))], times)
        outputs, count = self.run.measured.shape
        offsets = np.repeat(np.eye(outputs)[:, None, :], count, axis=1)
        columns = [offsets, car.free(times, start), *([values[1][:, :, None]] if self.road else [])]
        return self.run.measured - values[0], np.concatenate(columns, axis=2)

    def sensitivities(self, q: np.ndarray, delays: np.ndarray, share: np.ndarray) -> np.ndarray:
        times, outputs = self.times(delays), len(self.run.outputs)
        start = min(t[0] for t in times)
        forcing = self.forcing(delays, start)
        car = self.linear(tuple(q))
        x0 = share[outputs : outputs + len(car.A)]
        if self.road:
            forcing.value[-1] = share[-1]
        steps = DIFFERENCE * np.concatenate([np.eye(len(q)), -np.eye(len(q))])
        varied = [self.linear(tuple(q + step)) for step in steps]
        cars = [*varied, car]
        values, rates = responses(cars, [forcing] * len(cars), times, x0)
        by_parameter = (values[: len(q)] - values[len(q) : -1]) / (2.0 * DIFFERENCE)
        return np.concatenate([by_parameter, self._by_delay(car, forcing, times, rates[-1])]).transpose(1, 2, 0)

    def _by_delay(
        self, car: LinearCar, forcing: Forcing, times: Sequence[np.ndarray], rates: np.ndarray
    ) -> np.ndarray:
        """(delays, outputs, N): of an output what it changes by in a second, of an input the response to its slope."""
        found = np.zeros((len(self.delayed), *rates.shape))
        for derivative, name in zip(found, self.delayed, strict=True):
            if name in self.run.outputs:
                row = self.run.outputs.index(name)
                derivative[row] = -rates[row]
            elif name in self.inputs:
                row = self.inputs.index(name)
                earlier = np.zeros_like(forcing.value)
                earlier[row] = -forcing.slope[row]
                derivative[:] = responses([car], [Forcing(forcing.knots, earlier, np.zeros_like(earlier))], times)[0][0]
        return found
