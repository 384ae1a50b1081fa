"""Exact simulation of a driveline from event to event.

Between events the `motion` is exact. At zero slip the torques solve a complementarity problem: each clutch is stuck
where it can hold, slides where it cannot, and all agree with the motion that follows; ties are decided by derivatives.
"""

from collections import defaultdict, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import chain, combinations
from typing import NamedTuple

import numpy as np

from ..base.errors import PowertrainError
from .collocation import LONGEST, acting, followed
from .motion import TICK, Hit, Motion
from .plant import Modes, Plant
from .segment import Segment
from .signals import Pieces
from .sticking import consistent_modes
from .trace import Trace

# A slip below this [rad/s] is zero when an event is resolved.
ZERO_SLIP = 1e-9
# A slip that is known to be zero, because the clutch was stuck or the search has found it so, may be rounded by this part
# of the speeds, or of 1 rad/s; more than that is a state that never was stuck.
KNOWN_SLIP = 1e-6
# More events of one law within this time [s] are events without end: a million a second, where an engine's orders make
# a thousand.
MOST_EVENTS, WITHIN = 1000, 1e-3

# Torques that depend on several slips are followed to this part of themselves.
CLOSENESS = 1e-8

# Of a trace so many pieces are tried at once, and up to so many where no event is near.
SHORT_BLOCK, LONG_BLOCK = 16, 1024


class Interval(NamedTuple):
    """One stretch without events; ``lost`` [J] is the energy that each law has lost by the event at its start."""

    start: float
    stop: float
    modes: Modes
    motion: Motion | Trace
    lost: np.ndarray


class Resolved(NamedTuple):
    """Laws that have been looked at at an instant, and the motion that follows."""

    laws: list[int]
    motion: Motion


class EventRecord(NamedTuple):
    """A law that changed its mode."""

    time: float
    law: int
    before: int
    after: int


@dataclass
class Run:
    """A simulation in progress: state, modes, log.

    ``plant_of`` gives the plant for a tuple of modes, where a driveline is described differently by clutch state.
    With ``started`` False the modes are found from the state and the first inputs. ``closeness`` is the part of
    themselves to which torques that depend on several slips are followed.
    """

    plant_of: Callable[[Modes], Plant]
    x: np.ndarray
    modes: Modes
    time: float
    started: bool = False
    closeness: float = CLOSENESS

    def __post_init__(self) -> None:
        self.plant = self.plant_of(self.modes)
        self.events: list[EventRecord] = []
        self.lost = np.zeros(len(self.plant.laws))
        self._trial = LONGEST
        self._recent: dict[int, deque[tuple[float, int]]] = defaultdict(lambda: deque(maxlen=MOST_EVENTS))

    def over(self, pieces: Pieces, n_inputs: int) -> Iterator[Interval]:
        """Intervals of all pieces, the first so many of whose signals are inputs and the others capacities.

        Of a trace, which has many short ones, as many are taken at once as no event can be in.
        """
        edges, polynomials = pieces
        k, block, count = 0, SHORT_BLOCK, len(polynomials)
        is_trace = count >= 2 * SHORT_BLOCK and polynomials.shape[2] == 2 and not self.plant.curved
        is_trace = is_trace and not (self.plant.moved.size or self.plant.coupled or self.plant.loaded)
        while k < count:
            if is_trace and self.started and self.plant.pattern(self.modes).dynamics.flow.is_modal:
                last = min(k + block, count)
                trace = Trace(self.plant, self.modes, self.x, Pieces(edges[k : last + 1], polynomials[k:last]))
                safe = min(trace.safe, self._settled(polynomials[k:last, n_inputs:]))
                if safe:
                    stop = float(edges[k + safe])
                    yield Interval(self.time, stop, self.modes, trace, self._losses())
                    self.x, self.time = trace.state(trace.segment.edges[[safe]])[:, 0], stop
                    k += safe
                block = min(4 * block, LONG_BLOCK) if k == last else SHORT_BLOCK
                if k == last:
                    continue
            start, stop = float(edges[k]), float(edges[k + 1])
            segment = self.plant.segment(polynomials[k], stop - start)
            yield from self.advance(segment, stop - start, stop)
            k += 1

    def _losses(self) -> np.ndarray:
        """Energy lost since the last interval [J]."""
        lost, self.lost = self.lost, np.zeros_like(self.lost)
        return lost

    def _settled(self, capacities: np.ndarray) -> int:
        """On how many pieces, from the first on, no capacity (pieces, clutches, degree + 1) appears or vanishes."""
        idle = [self.modes[i] == law.idle for i, law in enumerate(self.plant.clutches)]
        other = ((~capacities.any(axis=2)) != idle).any(axis=1)
        return int(other.argmax()) if other.any() else len(other)

    def advance(self, segment: Segment, duration: float, stop: float | None = None) -> Iterator[Interval]:
        """Intervals of one segment; state, modes and time are those at its end afterwards.

        ``stop`` is the time of the end where start plus duration would miss it by rounding.
        """
        end, done = self.time + duration if stop is None else stop, 0.0
        if segment.imposed is not None:
            self._jump(segment)
        tick = TICK * max(1.0, duration) + 8.0 * np.spacing(abs(end))
        resolved, event = self.settle(acting(self.plant, self.x, segment)), None
        while True:
            left = duration - done
            motion, reach = self._motion(segment.later(done), left, tick, resolved)
            event = motion.first_event(reach, resolved.laws if resolved else (), event)
            if event is not None and left - event.time <= tick + event.doubt:
                event = None  # the next segment decides what happens at its start
                reach = left
            length = reach if event is None else event.time
            is_last = event is None and reach == left
            if length > 0.0 or is_last:
                until = end if is_last else min(self.time + length, end)
                yield Interval(self.time, until, self.modes, motion, self._losses())
                self.x = motion.state(np.array([length]))[:, 0]
                self.time = until
            if is_last:
                return
            done += length
            now = motion.segment.later(length) if self.plant.coupled else segment.later(done)
            resolved = None if event is None else self._resolve(now, event)

    def _motion(self, segment: Segment, left: float, tick: float, resolved: Resolved | None) -> tuple[Motion, float]:
        """Motion from here, and how far it holds: to the end, but where torques are followed in steps."""
        if not self.plant.coupled:
            return resolved.motion if resolved else Motion(self.plant, self.modes, self.x, segment), left
        if not left > tick:
            return Motion(self.plant, self.modes, self.x, acting(self.plant, self.x, segment)), left
        close = followed(self.plant, self.modes, self.x, segment, self.time, left, self._trial, self.closeness)
        self._trial = close.trial
        return close.motion, left if left - close.length <= tick else close.length

    def _jump(self, segment: Segment) -> None:
        """Bring moved nodes to their speeds; what they held, or kept from turning, is looked at again if they jump."""
        x = self.plant.imposed(self.x, np.asarray(segment.imposed))
        before = self.plant.slip(self.x)
        jumped = np.abs(self.plant.slip(x) - before).max(initial=0.0)
        self.x = x
        if self.started and jumped > ZERO_SLIP:
            self._struck([], before)
            self._resolve(acting(self.plant, self.x, segment))

    def torque_now(self, segment: Segment) -> np.ndarray:
        """(laws,) ndarray: torque at this instant, with modes that agree with the inputs."""
        segment = acting(self.plant, self.x, segment)
        if not self.settle(segment) and Motion(self.plant, self.modes, self.x, segment).violated():
            self._resolve(segment)
        motion = Motion(self.plant, self.modes, self.x, segment)
        return motion.torque(np.zeros(1), self.x[:, None])[:, 0]

    def settle(self, segment: Segment) -> Resolved | None:
        """Find the modes if they are unknown or a capacity appears or vanishes; None if neither."""
        idle = [self.modes[i] == law.idle for i, law in enumerate(self.plant.clutches)]
        if self.started and idle == segment.free.tolist():
            return None
        if not self.started:
            self.x, self.modes = self.plant.started(self.x, self.modes)
        resolved = self._resolve(segment)
        self.started = True
        return resolved

    def _resolve(self, segment: Segment, hit: Hit | None = None) -> Resolved:
        """Modes that hold from this instant on; laws at zero slip stick if they can."""
        plant, before = self.plant, self.modes
        free = [*segment.free, *[False] * (len(plant.laws) - len(plant.clutches))]
        slip = plant.slip(self.x)
        rigid = [i for i in plant.rigid if not free[i]]
        if rigid:
            self._struck(rigid, slip)
            segment = acting(plant, self.x, segment)
            slip = plant.slip(self.x)
        near = sorted({*rigid, *(i for i in self._at_rest(slip, hit) if not free[i])})
        others = [
            i
            for i, holds in enumerate(plant.holds)
            if holds is None or (plant.laws[i].load is not None and i not in near)
        ]
        if near:
            self.x = plant.held(self.x, near)
        modes = list(before)
        for i, law in enumerate(plant.laws):
            if free[i] and law.idle is not None:
                modes[i] = law.idle
            elif (holds := plant.holds[i]) is not None:
                modes[i] = holds if i in near else law.sliding(float(slip[i]), before[i])
        # where no more than rounding is left of a load nothing happens
        if hit is not None and hit.law not in near and plant.laws[hit.law].load is None:
            modes[hit.law] = hit.then
        first = tuple(modes)
        entered = plant.entered(self.x, before, first)

        @cache
        def motion_in(choice: Modes) -> Motion:
            return Motion(plant, choice, plant.entered(entered, first, choice), segment)

        chosen = consistent_modes(plant, first, near, motion_in, hit, others)
        if chosen is None:
            names = ", ".join(plant.laws[i].name for i in near or others)
            raise PowertrainError(
                f"no choice of modes of {names} agrees with its own motion at t = {self.time:.9g} s; "
                f"if they hold each other in parallel, make one clutch of them; {self._log()}"
            )
        self.modes, motion = chosen, motion_in(chosen)
        if self.started:
            self.lost += plant.stored(self.x, before) - plant.stored(motion.start, chosen)
        self.x = motion.start
        changed = self.plant_of(self.modes)
        if changed is not plant:
            self.x = changed.tuned(changed.state(plant.twist(self.x), plant.speed(self.x)), self.time)
            self.plant, motion = changed, Motion(changed, chosen, self.x, segment)
        if self.started:
            for i, (old, new) in enumerate(zip(before, self.modes, strict=True)):
                if old != new:
                    self.events.append(EventRecord(self.time, i, old, new))
            if hit is not None:
                self._guard(hit.law)
        return Resolved(near + others, motion)

    def _at_rest(self, slip: np.ndarray, hit: Hit | None) -> list[int]:
        """Laws that can hold and whose slip is zero: to rounding, or because they held or have just been found to."""
        plant = self.plant
        scale = np.abs(plant.G.T) @ np.abs(self.x[: plant.N])
        known = np.array([mode.held for mode in plant.modes_of(self.modes)], dtype=bool)
        if hit is not None and plant.laws[hit.law].modes[hit.then].held:
            known[hit.law] = True
        zero = np.where(known, KNOWN_SLIP * (1.0 + scale), ZERO_SLIP + 1e-14 * scale)
        return [i for i in np.flatnonzero(np.abs(slip) <= zero).tolist() if plant.holds[i] is not None]

    def _struck(self, rigid: list[int], before: np.ndarray) -> None:
        """Rigid couplings take up their slip at once, and so does what blocks the slip that this would give it.

        What blocks pushes only; ``before`` are slips that it allowed. What the blow costs is shared by the slips.
        """
        plant, slip = self.plant, self.plant.slip(self.x)
        zero = ZERO_SLIP + 1e-14 * (np.abs(plant.G.T) @ np.abs(self.x[: plant.N]))
        side = np.array([law.blocks for law in plant.laws])
        blocking = np.flatnonzero((side != 0) & (side * before <= zero)).tolist()
        for extra in chain.from_iterable(combinations(blocking, count) for count in range(len(blocking) + 1)):
            laws = [*rigid, *extra]
            x, blow = plant.held(self.x, laws), plant.multiplier(tuple(laws)) @ self.x[: plant.N]
            pushes = side[list(extra)] * blow[len(rigid) :]
            allowed = side[blocking] * plant.slip(x)[blocking] <= zero[blocking]
            if allowed.all() and (pushes >= -KNOWN_SLIP * np.abs(blow).max(initial=0.0)).all():
                break
        else:
            laws, x, blow = [], self.x, np.zeros(0)
        taken = np.where(abs(slip) > zero, slip, 0.0)[laws]
        if taken.any():
            self.lost[laws] += max(0.5 * float(blow @ slip[laws]), 0.0) * taken**2 / (taken @ taken)
        self.x = x

    def _guard(self, law: int) -> None:
        """Refuse events of one law without end at nearly one instant."""
        recent = self._recent[law]
        recent.append((self.time, self.modes[law]))
        if len(recent) == MOST_EVENTS and self.time - recent[0][0] < WITHIN:
            culprit = self.plant.laws[law]
            modes = " and ".join(sorted({f'"{culprit.modes[number].name}"' for _, number in recent}))
            remedy = ", or, if its static_ratio is above 1, static_ratio=1" if culprit.is_clutch else ""
            raise PowertrainError(
                f"{culprit.name} is in modes {modes} by turns, more than {MOST_EVENTS} times within {1e3 * WITHIN:g} ms "
                f"before t = {self.time:.9g} s; give the bodies beside it more inertia or their springs damping{remedy}; "
                f"{self._log()}"
            )

    def _log(self) -> str:
        laws = self.plant.laws
        last = [
            f"{laws[e.law].name} {laws[e.law].modes[e.before].name} to {laws[e.law].modes[e.after].name} at {e.time:.9g} s"
            for e in self.events[-6:]
        ]
        return "last events: " + ("; ".join(last) or "none")
