"""A driveline as an exact discrete map for python-control: one sample at a time, its events within included."""

from functools import lru_cache
from math import isfinite
from typing import NamedTuple

import numpy as np

from ..base.errors import PowertrainError
from .model import NO_CAPACITY, Plants
from .plant import Modes, Plant
from .run import KNOWN_SLIP, Run
from .steps import Instant, Step, energy_coordinates, physical_states

# Evaluations that are kept, more than a loop needs at one sample: python-control asks again and again for the same.
KEPT = 16
_RUNNING = np.ones(1)


class Sample(NamedTuple):
    """Physical state at a sample and modes before its inputs act; not ``known`` where the inputs have to decide.

    ``outputs`` are those that a step has found besides.
    """

    x: np.ndarray
    modes: Modes
    known: bool
    outputs: np.ndarray | None = None


class DiscreteDriveline:
    """Functions of the discrete system, whose states are the physical ones, the modes and, with ``linear``, inputs before.

    Steps and instants without events go by one matrix each, all others by a `Run`.
    """

    def __init__(self, plants: Plants, dt: float, linear: bool):
        self.plants, self.dt, self.linear = plants, dt, linear
        self.k = len(plants.model.inputs)
        self.physical = len(plants.states)
        self.known = self.physical + len(plants.laws)
        self.least = [NO_CAPACITY * (law.max_torque or 0.0) for law in plants.slipping.clutches]
        # friction over slip and moved nodes have other matrices with every input, torque converters steps of their own, and
        # of gears with losses nobody has asked for more
        slipping = plants.slipping
        self.searches = bool(slipping.curved or plants.sources or slipping.coupled or slipping.loaded)
        self.idle = [law.idle for law in plants.slipping.clutches]
        self.twists = slice(plants.slipping.r + plants.slipping.n, self.physical - len(plants.slipping.elastic))
        both = {plants.slipping, plants.stuck}
        self.enter = {plant: energy_coordinates(plant) for plant in both}
        self.leave = {plant: physical_states(plant) for plant in both}
        self.on_state = {plant: self._on_state(plant) for plant in both}
        self.step = lru_cache(maxsize=None)(lambda modes: Step(plants(modes), modes, dt, self.instant(modes).outputs))
        self.instant = lru_cache(maxsize=None)(lambda modes: Instant(plants(modes), modes))
        self.exist = lru_cache(maxsize=None)(
            lambda modes: all(mode in law.modes for law, mode in zip(plants.laws, modes, strict=True))
        )
        self.numbers = lru_cache(maxsize=None)(lambda modes: np.array(modes, dtype=float))
        self.modes = lru_cache(maxsize=KEPT)(lambda numbers: tuple(map(round, np.frombuffer(numbers).tolist())))
        self.advanced = lru_cache(maxsize=KEPT)(self._advanced)
        self.at_sample = lru_cache(maxsize=KEPT)(self._at_sample)
        self.outputs = lru_cache(maxsize=KEPT)(self._outputs)

    def _on_state(self, plant: Plant) -> np.ndarray:
        """Matrix of the outputs that are states on the physical ones."""
        laws, inputs = np.zeros((len(plant.laws), plant.size)), np.zeros((plant.B.shape[1], plant.size))
        on_x = self.plants.output_values(plant, np.eye(plant.size), laws, inputs, laws)[self.plants.is_state]
        return on_x @ self.enter[plant]

    def begin(self, x: np.ndarray) -> Sample:
        """The sample in the state of the system."""
        modes = self.modes(x[self.physical : self.known].tobytes())
        return Sample(x[: self.physical], modes, self.exist(modes))

    def settled(self, sample: Sample, first: np.ndarray, last: np.ndarray) -> bool:
        """Whether no capacity appears or vanishes."""
        if not sample.known or self.searches:
            return False
        for i, idle in enumerate(self.idle, start=self.k):
            if (sample.modes[i - self.k] == idle) == (first[i] > 0.0 or last[i] > 0.0):
                return False
        return True

    def _advanced(self, state: bytes, first: bytes, last: bytes) -> Sample:
        """The sample one step later, inputs going straight from the first to the last."""
        sample, u, v = self.begin(np.frombuffer(state)), np.frombuffer(first), np.frombuffer(last)
        if self.settled(sample, u, v):
            moved = self.step(sample.modes)(sample.x, u, v)
            if moved is not None:
                return Sample(moved[0], sample.modes, True, moved[1])
        run = self._run(sample)
        for _ in run.advance(run.plant.segment(np.stack([u, (v - u) / self.dt], axis=1), self.dt), self.dt):
            pass
        return Sample(self.leave[run.plant] @ run.x, run.modes, run.started)

    def _run(self, sample: Sample) -> Run:
        """A run from the sample, its modes unknown where what they hold moves."""
        plant = self.plants(sample.modes)
        x = self.enter[plant] @ sample.x
        known = sample.known
        if known:
            held = [i for i, mode in enumerate(plant.modes_of(sample.modes)) if mode.held]
            known = bool((abs(plant.G[:, held].T @ x[: plant.N]) < KNOWN_SLIP).all())
        return Run(self.plants, x, sample.modes if known else self.plants.unknown, 0.0, started=known)

    def _at_sample(self, state: bytes, inputs: bytes) -> tuple[Sample, np.ndarray]:
        """The sample, and those of its outputs that are states."""
        x = np.frombuffer(state)
        if self.linear and x[-1]:
            sample = self.advanced(state, x[self.known : -1].tobytes(), inputs)
        else:
            sample = self.begin(x)
        return sample, self.on_state[self.plants(sample.modes)].dot(sample.x)

    def _outputs(self, state: bytes, inputs: bytes) -> np.ndarray:
        sample, of_state = self.at_sample(state, inputs if self.linear else b"")
        u, y = np.frombuffer(inputs), None
        if self.settled(sample, u, u):
            y = sample.outputs if self.linear else None
            y = self.instant(sample.modes)(sample.x, u) if y is None else y
        if y is not None:
            y = np.concatenate([y, sample.x[self.twists], self.numbers(sample.modes)])
        else:
            run = self._run(sample)
            segment = run.plant.segment(u[:, None], 0.0)
            torque = run.torque_now(segment)
            modes = np.array(run.modes, dtype=float)[:, None]
            y = self.plants.output_values(run.plant, run.x[:, None], torque[:, None], segment.inputs, modes)[:, 0]
        # Speeds and twists are those of the sample, to the last bit, whatever the inputs: a loop must see that they are.
        y[self.plants.is_state] = of_state
        return y

    def update(self, t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        x, u = np.asarray(x, dtype=float), self._finite(u, t)
        for i in range(self.k, self.k + len(self.idle)):
            if u[i] < 0.0:
                name = self.plants.inputs[i]
                raise PowertrainError(f'input "{name}" is {u[i]:g} N m at t = {t:g} s, permitted: >= 0')
        state, inputs = x.tobytes(), u.tobytes()
        sample = self.at_sample(state, inputs)[0] if self.linear else self.advanced(state, inputs, inputs)
        after = (sample.x, self.numbers(sample.modes))
        return np.concatenate((*after, u, _RUNNING) if self.linear else after)

    def output(self, t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        x, u = np.asarray(x, dtype=float), self._finite(u, t)
        # While a loop is being resolved its controllers have not yet seen the speeds: it is the update that refuses.
        for i in range(self.k, self.k + len(self.idle)):
            if u[i] < 0.0:
                u[i] = 0.0
        return self.outputs(x.tobytes(), u.tobytes()).copy()

    def _finite(self, u: np.ndarray, t: float) -> np.ndarray:
        """Inputs, all of them finite, with exactly 0 where only rounding has left something of a capacity."""
        u = np.array(u, dtype=float)
        # quicker one by one, for they are few
        values = u.tolist()
        if not isfinite(sum(values)) and not (finite := np.isfinite(u)).all():
            raise PowertrainError(f'input "{self.plants.inputs[int(finite.argmin())]}" is not finite at t = {t:g} s')
        for i, least in enumerate(self.least, start=self.k):
            if abs(values[i]) <= least:
                u[i] = 0.0
        return u
