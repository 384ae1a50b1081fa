"""What a car would have been measured to do in a run, and how that depends on every unknown.

Unknown besides the parameters are the delays and what a run brings with it and the fit only has to take out: an offset of
each output, the state of the car at the start, a constant road load. A linear car's output is linear in these, so they are
columns. With laws (play, clutches that slip) the start is near steady motion and the road load one more number to look for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from ..base.errors import PowertrainError
from ..driveline.collection import Driveline, HasDriveline
from ..elements import Compliance, Constraint, Element
from ..hybrid.signals import samples
from ..hybrid.simulation import simulate
from ..linear.assembly import as_driveline, assemble, kept
from .channels import Channels
from .motion import Forcing, LinearCar, responses
from .unknowns import Unknowns

# At the start modes are out by up to so many times what taking away all inputs would leave.
STARTS_OUT = 3.0
# Step of the central differences in the logarithm of a parameter; they are off by its square.
DIFFERENCE = 1e-5
# Step of the one-sided differences of simulations.
FORWARD = 1e-6


class Prediction(Protocol):
    """What `output_error` needs of a run."""

    run: Channels
    road: str | None
    # 1 for each column whose share is known to be about 0, give or take 1, before anything is measured; 0 for others
    known: np.ndarray

    @property
    def near(self) -> LinearPrediction:
        """A linear car that does about the same: by it noise of torques and forces reaches the outputs."""
        ...

    def modelled(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(outputs, N) what the car does by itself; (outputs, N, columns) what is added to it.

        p are the logarithms of the parameters, the delays and, of cars with laws, the road load of each run.
        """
        ...

    def sensitivities(self, p: np.ndarray, share: np.ndarray) -> np.ndarray:
        """(outputs, N, unknowns) derivative of the model by p, its columns with these shares."""
        ...


class LinearPrediction:
    """A linear car in one run."""

    def __init__(self, run: Channels, unknowns: Unknowns, delayed: Sequence[str], road: str | None):
        self.run, self.unknowns, self.delayed, self.road = run, unknowns, tuple(delayed), road
        self.inputs = (*run.inputs, *([road] if road else []))
        self.linear = kept(2 * len(unknowns.names) + 4)(self._linear)
        # a car starts with modes that are out by about what its inputs can hold out, stiff ones by little
        sizes = [STARTS_OUT * float(np.ptp(values)) for _, values in run.inputs.values()]
        self.sizes = np.array([*sizes, *([0.0] if road else [])])
        states = self.linear(tuple(np.zeros(len(unknowns.names)))).fading
        self.known = np.concatenate([np.zeros(len(run.outputs)), np.ones(states), np.zeros(int(bool(road)))])

    def _linear(self, q: Any) -> LinearCar:
        return LinearCar(self.unknowns.car_at(np.array(q)), self.inputs, self.run.outputs)

    @property
    def near(self) -> LinearPrediction:
        return self

    def at_run(self, run: Channels) -> LinearPrediction:
        """The same car in another run; one with the same signals shares what has been computed."""
        other = LinearPrediction(run, self.unknowns, self.delayed, self.road)
        if (*run.inputs, *run.outputs) == (*self.run.inputs, *self.run.outputs):
            other.linear = self.linear
        return other

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

    def _parts(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Logarithms, delays, and when each output happened that was recorded at the time stamps."""
        count = len(self.unknowns.names)
        q, delays = p[:count], p[count : count + len(self.delayed)]
        return q, delays, happened(self.run, self.delayed, delays)

    def modelled(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        q, delays, times = self._parts(p)
        car = self.linear(tuple(q))
        start = min(t[0] for t in times)
        forcing = self.forcing(delays, start)
        constant = np.zeros_like(forcing.value)
        if self.road:
            constant[-1] = 1.0
        values, _ = responses([car, car], [forcing, Forcing(forcing.knots, constant, np.zeros_like(constant))], times)
        outputs, count = self.run.measured.shape
        offsets = np.repeat(np.eye(outputs)[:, None, :], count, axis=1)
        columns = [offsets, car.free(times, start, self.sizes), *([values[1][:, :, None]] if self.road else [])]
        return values[0], np.concatenate(columns, axis=2)

    def sensitivities(self, p: np.ndarray, share: np.ndarray) -> np.ndarray:
        (q, delays, times), outputs = self._parts(p), len(self.run.outputs)
        start = min(t[0] for t in times)
        forcing = self.forcing(delays, start)
        car = self.linear(tuple(q))
        x0 = car.starts(share[outputs : outputs + car.fading], self.sizes)
        if self.road:
            forcing.value[-1] = share[-1]
        steps = DIFFERENCE * np.concatenate([np.eye(len(q)), -np.eye(len(q))])
        varied = [self.linear(tuple(q + step)) for step in steps]
        cars = [*varied, car]
        values, rates = responses(cars, [forcing] * len(cars), times, x0)
        by_parameter = (values[: len(q)] - values[len(q) : -1]) / (2.0 * DIFFERENCE)
        unknown = np.zeros((len(p), *values.shape[1:]))
        unknown[: len(q)] = by_parameter
        unknown[len(q) : len(q) + len(delays)] = self._by_delay(car, forcing, times, rates[-1])
        return unknown.transpose(1, 2, 0)

    def _by_delay(self, car: LinearCar, forcing: Forcing, times: Sequence[np.ndarray], rates: np.ndarray) -> np.ndarray:
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


class SimulatedPrediction:
    """A car with laws in one run, by exact simulation; it starts in steady motion under its first inputs."""

    def __init__(self, run: Channels, unknowns: Unknowns, delayed: Sequence[str], road: str | None, number: int):
        self.run, self.unknowns, self.delayed, self.road, self.number = run, unknowns, tuple(delayed), road, number
        near = _Near(unknowns)
        # capacities and imposed speeds are no inputs of a linear car
        torques = assemble(near.car_at(np.zeros(len(unknowns.names)))).inputs
        driving = {name: pair for name, pair in run.inputs.items() if name in torques}
        self.near = LinearPrediction(run._replace(inputs=driving), near, delayed, road)
        self.known = self.near.known[: len(self.near.known) - bool(road)]
        self._simulated = kept(4)(self._simulated_at)

    def modelled(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        # a start off steady motion, as the first torque is off, fades as in contact
        _, columns = self.near.modelled(p)
        return self._simulated(tuple(p)), columns[:, :, : len(self.known)]

    def sensitivities(self, p: np.ndarray, share: np.ndarray) -> np.ndarray:
        here = self._simulated(tuple(p))
        found = np.zeros((*here.shape, len(p)))
        own = len(self.unknowns.names) + len(self.delayed)
        for i in [*range(own), *([own + self.number] if self.road else [])]:
            step = np.zeros(len(p))
            step[i] = FORWARD * max(abs(p[i]), 1.0) if i >= own else FORWARD
            found[:, :, i] = (self._simulated_at(tuple(p + step)) - here) / step[i]
        return found

    def disturbed(self, p: np.ndarray, errors: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """(outputs, N) ndarray: how far outputs are off if torques and forces are, by normal errors of these sizes."""
        off = dict(self.run.inputs)
        for (name, (times, values)), error in zip(self.near.run.inputs.items(), errors, strict=True):
            off[name] = times, values + error * rng.standard_normal(len(values))
        return self._simulated_at(tuple(p), off) - self._simulated(tuple(p))

    def _simulated_at(
        self, p: tuple[float, ...], driving: Mapping[str, tuple[np.ndarray, np.ndarray]] | None = None
    ) -> np.ndarray:
        """(outputs, N) ndarray, under the inputs as measured or others."""
        count = len(self.unknowns.names)
        q, delays = np.array(p[:count]), np.array(p[count : count + len(self.delayed)])
        late = dict(zip(self.delayed, delays, strict=True))
        times = happened(self.run, self.delayed, delays)
        inputs: dict[str, Any] = {
            name: samples(t + late.get(name, 0.0), values) for name, (t, values) in (driving or self.run.inputs).items()
        }
        if self.road:
            inputs[self.road] = p[count + len(delays) + self.number]
        grid, where = np.unique(np.concatenate(times), return_inverse=True)
        loads = {
            name: s if isinstance(s, float) else float(s(grid[0])) for name, s in inputs.items() if name in self._loads
        }
        response = simulate(
            self.unknowns.car_at(q), grid, inputs, initial_speed=self._start, initial_load=loads if loads else None
        )
        shape = len(times), -1
        return np.array([response[n][w] for n, w in zip(self.run.outputs, where.reshape(shape), strict=True)])

    @cached_property
    def _loads(self) -> tuple[str, ...]:
        """Inputs under which it starts in steady motion; none of a car that has no steady motion, as a tyre creeps."""
        loads = (*self.near.run.inputs, *([self.road] if self.road else []))
        car = self.unknowns.car_at(np.zeros(len(self.unknowns.names)))
        try:
            simulate(car, [0.0, 1e-6], initial_speed=self._start, initial_load=dict.fromkeys(loads, 1.0))
        except PowertrainError:
            return ()
        return loads

    @cached_property
    def _start(self) -> dict[str, float]:
        """The first speed that was measured in each part that open clutches leave."""
        found: dict[str, float] = {}
        for part in as_driveline(self.unknowns.car).release().parts():
            for name, values in zip(self.run.outputs, self.run.measured, strict=True):
                node = name.removesuffix("_speed")
                if name.endswith("_speed") and node in part and not found.keys() & part:
                    found[node] = float(values[np.isfinite(values)][0])
        return found


class _Near(Unknowns):
    """The unknowns of a car with a spring in the place of every law that has one; others are left out."""

    def __init__(self, unknowns: Unknowns):
        vars(self).update(vars(unknowns))
        self._of = unknowns

    def car_at(self, q: np.ndarray) -> Driveline:
        return in_contact(self._of.car_at(q))


def in_contact(car: HasDriveline) -> Driveline:
    """A driveline whose play is taken up, whose clutches are as they are and whose imposed motions rest."""
    driveline = as_driveline(car)
    elements = [part for element in driveline for part in _taken_up(element)]
    near = Driveline(*elements)
    released = [name for name in near.clutches if name in driveline.released]
    return near.release(*released) if released else near


def _taken_up(element: Element) -> list[Element]:
    """An element's law as the stiffest of its springs, or as what holds two sides together; others are left out."""
    law = next((law for law in element.laws if not law.is_clutch), None)
    if law is None:
        return [element]
    stiffest = max(law.modes.values(), key=lambda mode: (mode.stiffness, mode.damping))
    if stiffest.stiffness or stiffest.damping:
        spring = {"stiffness": stiffest.stiffness, "damping": stiffest.damping}
        return [Compliance(element.name, law.coefficients, **spring)]
    if law.imposes is not None or (law.held is not None and len(law.coefficients) > 1):
        return [Constraint(element.name, law.coefficients)]
    rows = [(row.coefficients, row.stiffness, row.damping) for row in element.compliances]
    return [Compliance(element.name, of, stiffness=stiffness, damping=damping) for of, stiffness, damping in rows]


def happened(run: Channels, delayed: Sequence[str], delays: np.ndarray) -> list[np.ndarray]:
    """When each output happened that was recorded at the time stamps."""
    late = dict(zip(delayed, delays, strict=True))
    return [run.time - late.get(name, 0.0) for name in run.outputs]
