"""Exact simulation of a driveline with dry-friction clutches: from event to event.

Between events the `motion` is exact. At zero slip the torques solve a complementarity problem: each clutch is stuck
where it can hold, slides where it cannot, and all agree with the motion that follows; ties are decided by derivatives.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np

from .errors import PowertrainError
from .motion import BACKWARD, FORWARD, FREE, INDIFFERENT, STUCK, Motion, Plant, Segment
from .propagation import polynomial_derivatives, value_at
from .signals import Pieces

# A slip below this [rad/s] is zero when an event is resolved.
ZERO_SLIP = 1e-9
# Times closer than this [s] are one.
TICK = 1e-14
MAX_EVENTS_PER_SECOND = 1000


class Interval(NamedTuple):
    """One stretch without events."""

    start: float
    stop: float
    modes: tuple[int, ...]
    motion: Motion


class EventRecord(NamedTuple):
    """A clutch that changed its mode."""

    time: float
    clutch: int
    before: int
    after: int


@dataclass
class Run:
    """A simulation in progress: state, modes, log.

    ``plant_of`` gives the plant for a tuple of modes, where a driveline is described differently by clutch state.
    With ``started`` False the modes are found from the state and the first inputs.
    """

    plant_of: Callable[[tuple[int, ...]], Plant]
    x: np.ndarray
    modes: tuple[int, ...]
    time: float
    started: bool = False

    def __post_init__(self) -> None:
        self.plant = self.plant_of(self.modes)
        self.events: list[EventRecord] = []
        self._recent: deque[float] = deque(maxlen=MAX_EVENTS_PER_SECOND)

    def advance(self, segment: Segment, duration: float, stop: float | None = None) -> Iterator[Interval]:
        """Intervals of one segment; state, modes and time are those at its end afterwards.

        ``stop`` is the time of the end where start plus duration would miss it by rounding.
        """
        end, done = self.time + duration if stop is None else stop, 0.0
        free = segment.free
        resolved = self.settle(segment)
        while True:
            left = duration - done
            local = segment.later(done)
            motion = Motion(self.plant, self.modes, self.x, local)
            event = motion.first_event(left, resolved)
            if event is not None and left - event <= TICK * max(1.0, abs(end)):
                event = None  # the next segment decides what happens at its start
            length = left if event is None else event
            if length > 0.0 or event is None:
                until = end if event is None else min(self.time + length, end)
                yield Interval(self.time, until, self.modes, motion)
                self.x = motion.state(np.array([length]))[:, 0]
                self.time = until
            if event is None:
                return
            done += length
            self._resolve(segment.later(done), free)
            resolved = True

    def torque_now(self, segment: Segment) -> np.ndarray:
        """(clutches,) ndarray: torque at this instant, with modes that agree with the inputs."""
        if not self.settle(segment):
            motion = Motion(self.plant, self.modes, self.x, segment)
            if motion.violated():
                self._resolve(segment, segment.free)
        motion = Motion(self.plant, self.modes, self.x, segment)
        return motion.clutch_torque(np.zeros(1), self.x[:, None])[:, 0]

    def settle(self, segment: Segment) -> bool:
        """Find the modes if they are unknown or a capacity appears or vanishes; True if that was so."""
        free = segment.free
        if self.started and all((mode == FREE) == is_free for mode, is_free in zip(self.modes, free, strict=True)):
            return False
        self._resolve(segment, free)
        self.started = True
        return True

    def _resolve(self, segment: Segment, free: np.ndarray) -> None:
        """Modes that hold from this instant on; clutches at zero slip stick if they can."""
        before = self.modes
        slip = self.plant.slip(self.x)
        scale = np.abs(self.plant.G.T) @ np.abs(self.x)
        near = [i for i in range(len(before)) if not free[i] and abs(slip[i]) <= ZERO_SLIP + 1e-14 * scale[i]]
        if near:
            self.x = self.plant.held(self.x, near)
        fixed = [FREE if free[i] else int(np.sign(s)) for i, s in enumerate(slip)]
        self.modes = self._consistent(fixed, near, segment) if near else tuple(fixed)
        plant = self.plant_of(self.modes)
        if plant is not self.plant:
            self.x = plant.state(self.plant.twist(self.x), self.plant.speed(self.x))
            self.plant = plant
        if not self.started:
            return
        for i, (old, new) in enumerate(zip(before, self.modes, strict=True)):
            if old != new:
                self.events.append(EventRecord(self.time, i, old, new))
        self._guard()

    def _consistent(self, fixed: list[int], near: list[int], segment: Segment) -> tuple[int, ...]:
        """Assignment of stuck, forward, backward to the clutches at zero slip that agrees with its own motion."""

        def attempt(choice: Sequence[int]) -> tuple[tuple[int, ...], list[int]]:
            modes = list(fixed)
            for i, mode in zip(near, choice, strict=True):
                modes[i] = mode
            return tuple(modes), _contradictions(self.plant, tuple(modes), near, self.x, segment)

        # All stuck, then let go whoever cannot hold; that nearly always settles it.
        choice = [STUCK] * len(near)
        for _ in range(2 * len(near) + 1):
            modes, wanted = attempt(choice)
            if wanted == choice:
                return modes
            choice = wanted
        for trial in sorted(product((STUCK, FORWARD, BACKWARD), repeat=len(near)), key=lambda c: np.count_nonzero(c)):
            modes, wanted = attempt(trial)
            if wanted == list(trial):
                return modes
        raise PowertrainError(f"no consistent clutch state at t = {self.time:.9g} s; {self._log()}")

    def _guard(self) -> None:
        self._recent.append(self.time)
        if len(self._recent) == MAX_EVENTS_PER_SECOND and self.time - self._recent[0] < 1.0:
            raise PowertrainError(
                f"more than {MAX_EVENTS_PER_SECOND} clutch events within a second before t = {self.time:.9g} s; "
                + self._log()
            )

    def _log(self) -> str:
        names = [row.name for row in self.plant.clutches]
        last = [f"{names[e.clutch]} {e.before:+d} to {e.after:+d} at {e.time:.9g} s" for e in self.events[-6:]]
        return "last events: " + ("; ".join(last) or "none")


def _contradictions(
    plant: Plant, modes: tuple[int, ...], near: list[int], x: np.ndarray, segment: Segment
) -> list[int]:
    """What each clutch at zero slip would do in the motion of these modes: what it is doing, if all agree."""
    motion = Motion(plant, modes, x, segment)
    rows, _, polynomials, terms, clutches = motion.functionals
    now = np.zeros(1)
    y = motion.trajectory.derivatives(now, 3)
    known = [value_at(p, now) for p in polynomial_derivatives(polynomials, 3)]
    weights = motion.trajectory.weights(rows)
    value = np.array([(rows @ d).real + p for d, p in zip(y, known, strict=True)])[:, :, 0]
    bounds = [value_at(p, now) for p in polynomial_derivatives(terms, 3)]
    driven = [value_at(p, now) for p in polynomial_derivatives(motion.driving_terms, 3)]
    size = np.array([weights @ motion.trajectory.size(d) + p for d, p in zip(y, bounds, strict=True)])[:, :, 0]
    size[1:] += np.array(driven)[:3, :, 0]
    size[0] += TICK / INDIFFERENT * size[1]  # what a tick takes to zero is zero
    value[np.abs(value) <= INDIFFERENT * size] = 0.0
    wanted = {i: modes[i] for i in near}
    side = {i: 1 for i in near}
    for column, i in enumerate(clutches):
        if i not in wanted:
            continue
        if modes[i] == STUCK:
            # reserve against forward, then backward sliding
            leading = value[:3, column][value[:3, column] != 0.0]
            if leading.size and leading[0] < 0.0:
                wanted[i] = FORWARD if side[i] == 1 else BACKWARD
            side[i] = -1
        else:
            leading = value[1:, column][value[1:, column] != 0.0]
            if not leading.size or leading[0] < 0.0:
                wanted[i] = STUCK
    return [wanted[i] for i in near]


def segments(pieces: Pieces, n_inputs: int) -> Iterator[tuple[float, float, Segment]]:
    """Duration, end and polynomials of each piece; capacities follow the inputs."""
    for start, stop, coefficients in zip(pieces.edges[:-1], pieces.edges[1:], pieces.coefficients, strict=True):
        yield float(stop - start), float(stop), Segment(coefficients[:n_inputs], coefficients[n_inputs:])
