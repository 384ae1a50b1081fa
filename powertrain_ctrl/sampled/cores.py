"""What a sampled loop drives, sample by sample: a linear core for cars that never switch, and one with clutches.

Both are exact, and both do the same for a car whose clutches stay as they are; the linear one is far faster.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Protocol

import numpy as np

from ..elements.laws import STUCK
from ..hybrid.model import output_map, plants_of
from ..hybrid.plant import Modes, Plant
from ..hybrid.run import Run
from ..hybrid.signals import Pieces, Signal, input_pieces, shift
from ..hybrid.simulation import Recorder
from ..hybrid.starts import initial_speeds, started
from ..linear.assembly import TorsionalModel, kept
from ..linear.outputs import output_rows
from .arrivals import Acting, lag_towards
from .plant import SAME_INSTANT, SampledPlant, hold_matrices


class Core(Protocol):
    """The motion of a car under commands that arrive once in each sample."""

    @property
    def measured(self) -> np.ndarray:
        """(2,) ndarray: speed of engine and wheels at this sample [rad/s]."""
        ...

    def step(self, acting: Sequence[Acting]) -> None:
        """Go on by a sample in which these delayed commands act."""
        ...


class LinearCore:
    """A car whose clutches stay as they are: one matrix for a sample, the points in between afterwards.

    ``forced`` is what a disturbance adds to all outputs, (outputs, points) ndarray.
    """

    def __init__(self, plant: SampledPlant, count: int, points: int, forced: np.ndarray):
        self.matrices, self.points, self.forced = sample_matrices(plant, points), points, forced
        self.read = plant.continuous.C[:2]
        self.x = np.zeros((count + 1, plant.continuous.nstates))
        self.sample = 0

    @property
    def measured(self) -> np.ndarray:
        """(2,) ndarray: speed of engine and wheels at this sample [rad/s]."""
        return self.read @ self.x[self.sample] + self.forced[:2, self.sample * self.points]

    def step(self, acting: Sequence[Acting]) -> None:
        """Go on by a sample."""
        known, before, after = self.matrices, acting[0].command, acting[-1].command
        self.x[self.sample + 1] = known.Phi @ self.x[self.sample] + known.late * after + known.early * before
        self.sample += 1

    @np.errstate(over="ignore", invalid="ignore")
    def outputs(self, acting: np.ndarray) -> np.ndarray:
        """(outputs, points) ndarray, from the commands (samples, 2) that act at the beginning and at the end of samples."""
        return self.matrices.outputs(self.x, acting) + self.forced


class _SampleMatrices:
    """Matrices over one sample and to every point in between."""

    def __init__(self, plant: SampledPlant, points: int):
        P, rest = plant.continuous, plant.delay_in_samples[1]
        A, B = P.A, P.B[:, :1]
        self.points = points
        self.Phi, late, early = plant.step_matrices(A, B, plant.dt, rest)
        self.late, self.early = late[:, 0], early[:, 0]
        rows = np.zeros((points, P.noutputs, P.nstates + 2))
        for i in range(points):
            s = i * plant.dt / points
            if s < rest - SAME_INSTANT * plant.dt:
                Phi, early = hold_matrices(A, B, s)
                late, is_new = np.zeros_like(early), 0.0
            else:  # the new command has arrived, if only just
                Phi, late, early = plant.step_matrices(A, B, s, min(rest, s))
                is_new = 1.0
            through = P.D[:, :1]
            rows[i] = np.hstack([P.C @ Phi, P.C @ late + is_new * through, P.C @ early + (1.0 - is_new) * through])
        self.rows = rows.reshape(-1, P.nstates + 2)

    def outputs(self, x: np.ndarray, acting: np.ndarray) -> np.ndarray:
        """(outputs, points) ndarray; nothing is behind the last sample."""
        known = np.column_stack([x, acting[:, ::-1]])
        values = (known @ self.rows.T).reshape(len(x), self.points, -1)
        return values.transpose(2, 0, 1).reshape(values.shape[2], -1)[:, : (len(x) - 1) * self.points + 1]


sample_matrices = kept(64)(_SampleMatrices)


class HybridCore:
    """A car of which this is the model, with clutches that slip and lock as ``inputs``, such as capacities, let them.

    With a ``load`` it starts under it, play closed and springs twisted as in steady motion, or as the state ``x`` of the
    bare plant has them; commands then add to the torque of the engine in it. ``held`` are inputs that keep a value over the
    next sample.
    """

    def __init__(
        self,
        plant: SampledPlant,
        model: TorsionalModel,
        modes: Modes,
        time: np.ndarray,
        points: int,
        inputs: Mapping[str, Signal],
        speed: Mapping[str, float],
        load: Mapping[str, float] | None = None,
        x: np.ndarray | None = None,
    ):
        self.command = f"{plant.engine}_torque"
        index = model.inputs.index(self.command)
        self.lags, self.index = plant.lags, index
        lags, lagging = dict.fromkeys(plant.lags), index if max(plant.lags) else None
        self.plants = {lag: Plant(model, lagging, lag) for lag in lags}
        self.plant = self.plants[max(lags)]
        self.names = (*model.inputs, *(law.input for law in self.plant.clutches))
        self.inputs = input_pieces(inputs, self.names, time)
        self.times = time[::points]
        self.offset = 0.0 if load is None else load[self.command]
        if load is None:
            start = self.plant.state(np.zeros(self.plant.r), initial_speeds(model, speed))
        else:
            if x is None:
                x = started(plants_of(plant.car, as_set=True), float(time[0]), speed, None, load).x
            start = np.insert(x, self._lag, [self.offset] * self._lags)
        self.run = Run(lambda modes: self.plant, start, modes, float(time[0]))
        self.recorder = Recorder(self.plant, time)
        self.acting = [j for j, name in enumerate(model.inputs) if name == self.command or name in inputs]
        rows = output_rows(model, [f"{node}_speed" for node in (plant.engine, *plant.wheels)], inputs=self.acting)
        self.on_twist, self.on_speed = (np.vstack([a[0], a[1:].mean(axis=0)]) for a in (rows.twist, rows.speed))
        self.sample = 0
        self.held: dict[str, float] = {}

    @property
    def _lag(self) -> int:
        """Place of the torque that follows the command, where there is one."""
        return self.plant.r + self.plant.n

    @property
    def _lags(self) -> int:
        return self.plant.N - self._lag - len(self.plant.elastic)

    @property
    def holding(self) -> frozenset[str]:
        """Names of the clutches that hold."""
        run = self.run
        if not run.started:  # what holds at the first instant is found without going on from there
            run = replace(run)
            pieces = self._pieces(float(self.times[0]), float(self.times[1]), 0.0)
            run.settle(self.plant.segment(pieces.coefficients[0], float(np.diff(pieces.edges)[0])))
        modes = zip(self.plant.clutches, run.modes, strict=False)
        return frozenset(law.name for law, mode in modes if mode == STUCK)

    @property
    def measured(self) -> np.ndarray:
        """(2,) ndarray: speed of engine and wheels at this sample [rad/s]."""
        return self.on_twist @ self.plant.twist(self.run.x) + self.on_speed @ self.plant.speed(self.run.x)

    def step(self, acting: Sequence[Acting]) -> None:
        """Go on by a sample."""
        start, stop = (float(time) for time in self.times[self.sample : self.sample + 2])
        edges = [*(self._instant(start + each.since) for each in acting), stop]
        for (begin, end), (_, command) in zip(pairwise(edges), acting, strict=True):
            if end > begin:
                self._turn(command)
                for interval in self.run.over(self._pieces(begin, end, command), len(self.plant.model.inputs)):
                    self.recorder.add(interval)
        self.sample += 1

    def _instant(self, time: float) -> float:
        """A time, if it is that of a point but for rounding that of the point: a torque may jump there."""
        points, near = self.recorder.timepts, SAME_INSTANT * float(self.times[1] - self.times[0])
        first = int(np.searchsorted(points, time - near))
        return float(points[first]) if first < len(points) and points[first] <= time + near else time

    def _turn(self, command: float) -> None:
        """Go on with the lag of the direction in which the torque goes now; without one it is there at once."""
        if len(self.plants) == 1:
            return
        torque = self.offset + command
        lag = lag_towards(torque, float(self.run.x[self._lag]), self.lags)
        self.plant = self.run.plant = self.plants[lag]
        if not lag:
            self.run.x = self.run.x.copy()
            self.run.x[self._lag] = torque

    def _pieces(self, begin: float, end: float, command: float) -> Pieces:
        """All inputs from one time to another under a command."""
        pieces = _between(self.inputs, begin, end)
        pieces.coefficients[:, self.index, 0] = self.offset + command
        for name, value in self.held.items():
            pieces.coefficients[:, self.names.index(name)] = 0.0
            pieces.coefficients[:, self.names.index(name), 0] = value
        return pieces

    def signals(self) -> dict[str, np.ndarray]:
        """Every output of `simulate` by name, and the torque of the engine."""
        plant, recorder = self.plant, self.recorder
        u, x = recorder.inputs[: plant.B.shape[1]].copy(), recorder.x
        if self._lags:
            u[self.index], x = x[self._lag], np.delete(x, self._lag, axis=0)
        bare = Plant(plant.model)
        y = output_map(bare, self.acting) @ np.concatenate([x[: bare.N], recorder.torque, u])
        found = dict(zip(output_rows(plant.model, inputs=self.acting).names, y, strict=True))
        found |= {f"{plant.laws[i].name}_twist": x[q] for i, q in bare.twisted.items()}
        modes = zip(plant.laws, recorder.modes, strict=True)
        return found | {f"{law.name}_mode": mode for law, mode in modes} | {self.command: u[self.index]}


def _between(pieces: Pieces, begin: float, end: float) -> Pieces:
    """The pieces from one time to another."""
    first, last = np.searchsorted(pieces.edges, begin, side="right") - 1, np.searchsorted(pieces.edges, end)
    edges = np.concatenate([[begin], pieces.edges[first + 1 : last], [end]])
    return Pieces(edges, shift(pieces.coefficients[first:last], (edges[:-1] - pieces.edges[first:last])[:, None]))
