"""The fit of all runs together: what is most likely under the noise that makes it so, and how well it is known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from .channels import LONGEST_DELAY, Channels
from .descent import Descent, Point, Whiten
from .identified import Validation
from .noise import ROUNDING, Levels, Remainder, Weights, Whitening, noise_levels
from .prediction import LinearPrediction, Prediction, SimulatedPrediction
from .separable import Analysis, analysed
from .unknowns import Unknowns

# Standard deviation of what the first fit may leave, as a part of each output's size.
FIRST = 0.01
# Where less than this part of an output is left, there is no noise to be modelled; and no less than that counts as left.
NOISELESS, LEAST = 1e-8, 1e-15
# Noise of an input to start from, as a part of its size.
INPUT_NOISE = 3e-3
# Noise and parameters are found in turn, so often at most, or until the parameters move by no more standard errors.
ROUNDS, SAME = 4, 3.0
# The sensors' noise is found when it is no longer less than this part of what it was taken for.
HALF = 0.5
# The noise of cars with laws is simulated so often: their standard errors are known to an eighth.
TRIALS = 32
# A delay is no larger than this part of the run, and changes by no more than so many samples at once.
OF_RUN, SAMPLES_AT_ONCE = 0.25, 5.0


class Found(NamedTuple):
    """Where a fit has ended: what is known there, the derivatives of the whitened outputs, the noise of each run."""

    point: Point
    analysis: Analysis
    information: np.ndarray
    levels: list[Levels]
    held: tuple[int, ...]


class Fit:
    """The unknowns of all runs together: logarithms of the parameters, delays, road loads of cars with laws."""

    def __init__(self, unknowns: Unknowns, delayed: Sequence[str], predictions: Sequence[Prediction], roads: bool):
        self.unknowns, self.delayed, self.predictions = unknowns, tuple(delayed), list(predictions)
        count, delays = len(unknowns.names), len(delayed)
        self.own = count + delays
        roads_there = len(predictions) if roads else 0
        longest = min(LONGEST_DELAY, *(OF_RUN * float(each.run.time[-1]) for each in predictions))
        self.low = np.concatenate([unknowns.low, np.full(delays, -longest), np.full(roads_there, -np.inf)])
        self.high = np.concatenate([unknowns.high, np.full(delays, longest), np.full(roads_there, np.inf)])
        steps = np.full(delays, SAMPLES_AT_ONCE * max(each.run.step for each in predictions))
        self.longest = np.concatenate([np.ones(count), steps, np.full(roads_there, np.inf)])
        self.start = np.zeros(len(self.low))
        for i in range(roads_there):
            near = self.predictions[i].near
            near_fit = Descent([near], [Weights(near.run, near.run.size)], self.low, self.high, self.longest)
            self.start[self.own + i] = near_fit.at(self.start).shares[0][-1]

    def descent(self, whiten: Sequence[Whiten]) -> Descent:
        return Descent(self.predictions, whiten, self.low, self.high, self.longest)

    def left(self, point: Point) -> list[np.ndarray]:
        """(outputs, N) ndarray of each run: measured less model."""
        found = []
        for prediction, share in zip(self.predictions, point.shares, strict=True):
            values, columns = prediction.modelled(point.p)
            found.append(prediction.run.measured - values - columns @ share)
        return found

    def _remainders(self, point: Point) -> list[Remainder]:
        found = []
        for prediction, share in zip(self.predictions, point.shares, strict=True):
            values, columns = prediction.modelled(point.p)
            left = prediction.run.measured - values - columns @ share
            derivatives = prediction.sensitivities(point.p, share)
            found.append(Remainder(left, columns, prediction.known, derivatives))
        return found

    def held_at(self, delays: np.ndarray) -> Point:
        """The car as it was given, with these delays; only what a run brings with it is found."""
        whiten = [Weights(prediction.run, FIRST * prediction.run.size) for prediction in self.predictions]
        p = self.start.copy()
        p[len(self.unknowns.names) : self.own] = delays
        held = Descent(self.predictions, whiten, p.copy(), p.copy(), self.longest)
        held.low[self.own :], held.high[self.own :] = -np.inf, np.inf
        return held.settled(p)[0] if len(p) > self.own else held.at(p)

    def found(self) -> Found:
        """The point that is most likely."""
        near = [prediction.near for prediction in self.predictions]
        runs = [prediction.run for prediction in near]
        spread = {name: FIRST * float(size) for run in runs for name, size in zip(run.outputs, run.size, strict=True)}
        point, falls = Point(self.start, [], [], []), True
        while falls:
            levels = [Levels(np.zeros(len(run.inputs)), np.array([spread[n] for n in run.outputs])) for run in runs]
            whiten = [Weights(run, level.outputs) for run, level in zip(runs, levels, strict=True)]
            point, J = self.descent(whiten).settled(point.p)
            before, spread = spread, self._spread(point)
            # without noise less and less is left, the less what a start is known to be counts
            falls = any(spread[name] < HALF * before[name] for name in spread)
        sizes = {name: size for run in runs for name, size in zip(run.outputs, run.size, strict=True)}
        if all(spread[name] <= NOISELESS * size for name, size in sizes.items()):
            return self._found(point, J, levels)
        levels = [self._first_levels(run, left) for run, left in zip(runs, self.left(point), strict=True)]
        for _ in range(ROUNDS):
            cars = [each.linear(tuple(point.p[: len(self.unknowns.names)])) for each in near]
            levels = noise_levels(runs, cars, self._remainders(point), levels)
            filters = [Whitening(*each) for each in zip(runs, cars, levels, strict=True)]
            p = point.p
            point, J = self.descent(filters).settled(p)
            if np.linalg.norm(J @ (point.p - p)) <= SAME:
                break
        found = self._found(point, J, levels)
        with_laws = [each for each in self.predictions if isinstance(each, SimulatedPrediction)]
        if with_laws:
            found = self._simulated(found, J, filters, with_laws)
        pulled = sum(pull(*each) for each in zip(near, [point.p] * len(runs), filters, levels, strict=True))
        known = [i for i in range(self.own) if i not in found.analysis.lost and i not in found.held]
        p = point.p.copy()
        p[known] += found.analysis.covariance[np.ix_(known, known)] @ np.asarray(pulled)[known]
        return found._replace(point=self.descent(filters).at(np.clip(p, self.low, self.high)))

    def _found(self, point: Point, J: np.ndarray, levels: list[Levels]) -> Found:
        held = tuple(np.flatnonzero((point.p <= self.low) | (point.p >= self.high)).tolist())
        information = J.T @ J
        analysis = analysed(information, len(self.unknowns.names), self.own, held)
        return Found(point, analysis, information, levels, held)

    def _simulated(
        self, found: Found, J: np.ndarray, filters: Sequence[Whitening], predictions: Sequence[SimulatedPrediction]
    ) -> Found:
        """The same, but what is known of the unknowns by how far simulated noise takes them.

        What an error of the torque does while play is open no linear car tells.
        """
        lost = {*found.analysis.lost, *found.held}
        known = [i for i in range(J.shape[1]) if i not in lost]
        rng = np.random.default_rng(0)
        moved = np.zeros((TRIALS, len(known)))
        normal = J[:, known].T @ J[:, known]
        for row in moved:
            off = []
            for prediction, filter, level in zip(predictions, filters, found.levels, strict=True):
                outputs = level.outputs[:, None] * rng.standard_normal(prediction.run.measured.shape)
                off.append(filter((outputs + prediction.disturbed(found.point.p, level.inputs, rng))[:, :, None])[:, 0])
                off.append(np.zeros(np.count_nonzero(prediction.known)))
            row[:] = np.linalg.solve(normal, J[:, known].T @ np.concatenate(off))
        named = [k for k, i in enumerate(known) if i < self.own]
        block = np.ix_([known[k] for k in named], [known[k] for k in named])
        covariance, correlation = found.analysis.covariance.copy(), found.analysis.correlation.copy()
        covariance[block] = moved[:, named].T @ moved[:, named] / TRIALS
        deviation = np.sqrt(np.diag(covariance[block]))
        correlation[block] = covariance[block] / np.outer(deviation, deviation)
        return found._replace(analysis=found.analysis._replace(covariance=covariance, correlation=correlation))

    def _spread(self, point: Point) -> dict[str, float]:
        """Output to the standard deviation of what is left of it in all runs."""
        squares: dict[str, float] = {}
        counts: dict[str, int] = {}
        sizes: dict[str, float] = {}
        for prediction, left in zip(self.predictions, self.left(point), strict=True):
            for name, row, size in zip(prediction.run.outputs, left, prediction.run.size, strict=True):
                known = row[np.isfinite(row)]
                squares[name] = squares.get(name, 0.0) + float(known @ known)
                counts[name] = counts.get(name, 0) + len(known)
                sizes[name] = max(sizes.get(name, 0.0), float(size))
        return {name: max(float(np.sqrt(squares[name] / counts[name])), LEAST * sizes[name]) for name in squares}

    def _first_levels(self, run: Channels, left: np.ndarray) -> Levels:
        """What a walk leaves from one sample to the next is of the sensors."""
        inputs = [INPUT_NOISE * float(np.ptp(values)) for _, values in run.inputs.values()]
        outputs = [np.nanstd(np.diff(row[np.isfinite(row)])) / np.sqrt(2.0) for row in left]
        return Levels(np.array(inputs), np.maximum(outputs, ROUNDING * run.size))

    def validations(self, point: Point) -> tuple[Validation, ...]:
        found = []
        for i, (prediction, share) in enumerate(zip(self.predictions, point.shares, strict=True)):
            run = prediction.run
            values, columns = prediction.modelled(point.p)
            road = 0.0
            if prediction.road:
                road = float(point.p[self.own + i] if len(point.p) > self.own else share[-1])
            found.append(
                Validation(
                    title=run.title,
                    time=run.time + run.origin,
                    measured=dict(zip(run.outputs, run.measured, strict=True)),
                    model=dict(zip(run.outputs, values + columns @ share, strict=True)),
                    inputs={
                        name: np.array([times + run.origin, values]) for name, (times, values) in run.inputs.items()
                    },
                    road_load=road,
                )
            )
        return tuple(found)


def pull(prediction: LinearPrediction, p: np.ndarray, filter: Whitening, levels: Levels) -> np.ndarray:
    """(unknowns,) ndarray: what the errors of the inputs add to the slope of the likelihood on average, taken off.

    The derivatives of the outputs are computed with the inputs as they were measured, so that they and the residuals
    have the same errors in them: sum over samples of ``variance (whitened response) (its derivative)``.
    """
    run, h = prediction.run, prediction.run.step
    late = p[len(prediction.unknowns.names) : len(prediction.unknowns.names) + len(prediction.delayed)]
    at = 2 + int(np.ceil(np.abs(late).max(initial=0.0) / h))
    count = len(run.time) + at
    time = h * np.arange(count)
    # an error decays in the innovations; the later it happens the less of it is in the run
    weight = np.clip(len(run.time) + at - np.arange(count), 0, len(run.time))
    total = np.zeros(len(p))
    for name, level in zip(run.inputs, levels.inputs, strict=True):
        impulse = (np.arange(count) == at).astype(float)
        inputs = {each: (time, impulse if each == name else np.zeros(count)) for each in run.inputs}
        once = prediction.at_run(run._replace(time=time, inputs=inputs, measured=np.zeros((len(run.outputs), count))))
        values, columns = once.modelled(p)
        derivatives = once.sensitivities(p, np.zeros(columns.shape[2]))
        whitened = filter.settled(np.concatenate([values[:, :, None], derivatives], axis=2))
        total += level**2 * np.einsum("k,kc,kcp->p", weight, whitened[:, :, 0], whitened[:, :, 1:])
    return total
