"""Exact simulation of a driveline with dry-friction clutches: from event to event.

Between events the `motion` is exact. At zero slip the torques solve a complementarity problem: each clutch is stuck
where it can hold, slides where it cannot, and all agree with the motion that follows; ties are decided by derivatives.
"""

from collections import defaultdict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..base.errors import PowertrainError
from .motion import BACKWARD, FORWARD, FREE, STUCK, TICK, Hit, Motion, Plant, Segment
from .signals import Pieces
from .sticking import consistent_modes

# A slip below this [rad/s] is zero when an event is resolved.
ZERO_SLIP = 1e-9
# A slip that is known to be zero, because the clutch was stuck or the search has found it so, may be rounded by this part
# of the speeds, or of 1 rad/s; more than that is a state that never was stuck.
KNOWN_SLIP = 1e-6
# More events of one clutch within this time [s] are events without end: a million a second, where an engine's orders make
# a thousand.
MOST_EVENTS, WITHIN = 1000, 1e-3
MODE_WORDS = {FORWARD: "sliding forward", BACKWARD: "sliding backward", STUCK: "stuck", FREE: "free"}


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
        self._recent: dict[int, deque[tuple[float, int]]] = defaultdict(lambda: deque(maxlen=MOST_EVENTS))

    def advance(self, segment: Segment, duration: float, stop: float | None = None) -> Iterator[Interval]:
        """Intervals of one segment; state, modes and time are those at its end afterwards.

        ``stop`` is the time of the end where start plus duration would miss it by rounding.
        """
        end, done = self.time + duration if stop is None else stop, 0.0
        tick = TICK * max(1.0, duration) + 8.0 * np.spacing(abs(end))
        resolved, event = self.settle(segment), None
        while True:
            left = duration - done
            motion = Motion(self.plant, self.modes, self.x, segment.later(done))
            event = motion.first_event(left, resolved, event)
            if event is not None and left - event.time <= tick + event.doubt:
                event = None  # the next segment decides what happens at its start
            length = left if event is None else event.time
            if length > 0.0 or event is None:
                until = end if event is None else min(self.time + length, end)
                yield Interval(self.time, until, self.modes, motion)
                self.x = motion.state(np.array([length]))[:, 0]
                self.time = until
            if event is None:
                return
            done += length
            resolved = self._resolve(segment.later(done), event)

    def torque_now(self, segment: Segment) -> np.ndarray:
        """(clutches,) ndarray: torque at this instant, with modes that agree with the inputs."""
        if not self.settle(segment) and Motion(self.plant, self.modes, self.x, segment).violated():
            self._resolve(segment)
        motion = Motion(self.plant, self.modes, self.x, segment)
        return motion.clutch_torque(np.zeros(1), self.x[:, None])[:, 0]

    def settle(self, segment: Segment) -> list[int]:
        """Find the modes if they are unknown or a capacity appears or vanishes; the clutches at zero slip if so."""
        unchanged = all((mode == FREE) == free for mode, free in zip(self.modes, segment.free, strict=True))
        if self.started and unchanged:
            return []
        near = self._resolve(segment)
        self.started = True
        return near

    def _resolve(self, segment: Segment, hit: Hit | None = None) -> list[int]:
        """Modes that hold from this instant on; clutches at zero slip, which are returned, stick if they can."""
        before, free = self.modes, segment.free
        slip = self.plant.slip(self.x)
        near = [i for i in self._at_rest(slip, hit) if not free[i]]
        if near:
            self.x = self.plant.held(self.x, near)
        modes = tuple(FREE if is_free else int(np.sign(s)) for is_free, s in zip(free, slip, strict=True))
        chosen = consistent_modes(self.plant, modes, near, self.x, segment, hit)
        if chosen is None:
            names = ", ".join(self.plant.clutches[i].name for i in near)
            raise PowertrainError(
                f"no choice of sticking and sliding of {names} agrees with its own motion at t = {self.time:.9g} s; "
                f"if they hold each other in parallel, make one clutch of them; {self._log()}"
            )
        self.modes = chosen
        plant = self.plant_of(self.modes)
        if plant is not self.plant:
            self.x = plant.state(self.plant.twist(self.x), self.plant.speed(self.x))
            self.plant = plant
        if self.started:
            for i, (old, new) in enumerate(zip(before, self.modes, strict=True)):
                if old != new:
                    self.events.append(EventRecord(self.time, i, old, new))
            if hit is not None:
                self._guard(hit.clutch)
        return near

    def _at_rest(self, slip: np.ndarray, hit: Hit | None) -> list[int]:
        """Clutches whose slip is zero: to rounding, or because they were stuck or have just been found to reach it."""
        scale = np.abs(self.plant.G.T) @ np.abs(self.x)
        known = np.array(self.modes) == STUCK
        if hit is not None:
            known[hit.clutch] = True
        zero = np.where(known, KNOWN_SLIP * (1.0 + scale), ZERO_SLIP + 1e-14 * scale)
        return np.flatnonzero(np.abs(slip) <= zero).tolist()

    def _guard(self, clutch: int) -> None:
        """Refuse events of one clutch without end at nearly one instant."""
        recent = self._recent[clutch]
        recent.append((self.time, self.modes[clutch]))
        if len(recent) == MOST_EVENTS and self.time - recent[0][0] < WITHIN:
            name = self.plant.clutches[clutch].name
            modes = " and ".join(sorted({MODE_WORDS[mode] for _, mode in recent}))
            raise PowertrainError(
                f"{name} is {modes} by turns, more than {MOST_EVENTS} times within {1e3 * WITHIN:g} ms before "
                f"t = {self.time:.9g} s; give the bodies beside it more inertia or their springs damping, or, if its "
                f"static_ratio is above 1, static_ratio=1; {self._log()}"
            )

    def _log(self) -> str:
        names = [row.name for row in self.plant.clutches]
        last = [f"{names[e.clutch]} {e.before:+d} to {e.after:+d} at {e.time:.9g} s" for e in self.events[-6:]]
        return "last events: " + ("; ".join(last) or "none")


def segments(pieces: Pieces, n_inputs: int) -> Iterator[tuple[float, float, Segment]]:
    """Duration, end and polynomials of each piece; capacities follow the inputs."""
    for start, stop, coefficients in zip(pieces.edges[:-1], pieces.edges[1:], pieces.coefficients, strict=True):
        yield float(stop - start), float(stop), Segment(coefficients[:n_inputs], coefficients[n_inputs:])
