"""Launches of all variants at once: when the clutch locks, and its heat.

While the clutch slides, and while it sticks, a driveline is linear and moves exactly by its modes. The slip is followed
until it is zero by steps none of which can miss a zero: its second derivative is bounded by that of its modes now, which
no longer grow (the same bound by which the capacity is known not to give way after the lock). What does not go this way
alone, as a clutch that slips again, is launched one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..base.errors import TopologyError
from ..driveline.collection import Driveline
from ..driveline.ends import ends
from ..driveline.kinematics import combined
from ..hybrid.flow import phi_functions
from ..hybrid.manoeuvres import launch
from .responses import Lifted
from .structure import Stack, one_by_one, parts_of
from .variants import LOCKED, Variants

# Product of the norms of eigenvectors and of their inverse up to which modes keep their digits.
INDEPENDENT = 1e6
# A rate below this part of the largest is that of a body that turns freely; a slower one than SLOW [1/s] besides is not
# told from it.
STILL, SLOW = 1e-12, 1e-3
# A slip below so many roundings of its terms is zero; steps until it is found, at most.
ROUNDING, MOST_STEPS = 64.0 * np.finfo(float).eps, 400


@dataclass(frozen=True)
class Launch:
    """What `launch` is told, and until when."""

    torque: float
    capacity: float
    duration: float
    start: float
    engine_speed: float
    until: float

    def of(self, car: Driveline) -> tuple[float, float]:
        """Time at which the clutch has locked, nan if it slips at the end, and its heat."""
        response = launch(
            car, self.torque, self.capacity, self.duration, self.start, self.engine_speed, [0.0, self.until]
        )
        clutch = car.clutches[0]
        last = next((event for event in reversed(response.events) if event.element == clutch), None)
        closed = last.time if last is not None and last.kind == "lock" else np.nan
        return closed, response.slip_energy[clutch]

    def pieces(self) -> Iterator[tuple[float, float, np.ndarray, np.ndarray]]:
        """Begin and length, torque and capacity as value and slope, until the end."""
        edges = np.minimum([0.0, self.start, self.start + self.duration, self.until], self.until)
        for k, (begin, end) in enumerate(pairwise(edges.tolist())):
            if end > begin:
                share = ((0.0, 0.0), (0.0, 1.0 / max(self.duration, 1e-300)), (1.0, 0.0))[k]
                yield begin, end - begin, self.torque * np.array(share), self.capacity * np.array(share)


def launches_of(variants: Variants, task: Launch) -> dict[str, np.ndarray]:
    """``lock_time`` and ``heat`` (n,) of some variants."""
    clutches = variants.car.clutches
    if len(clutches) != 1:
        raise TopologyError(f"launch needs one clutch, there are {len(clutches)}; use evaluate")
    values = {name: column for name, column in variants.values.items() if not name.endswith(f".{LOCKED}")}
    lock, heat = np.empty(len(variants)), np.empty(len(variants))
    for places, part, stack in parts_of(Variants(variants.car.release(clutches[0]), values, variants.numbers)):
        is_sure = np.zeros(len(part), dtype=bool)
        if stack is not None:
            lock[places], heat[places], is_sure = _Launches(stack, task).found()
        if not is_sure.all():
            others = one_by_one(part.part(~is_sure), task.of)
            lock[places[~is_sure]], heat[places[~is_sure]] = np.transpose(others)
    return {"lock_time": lock, "heat": heat}


class Functional(NamedTuple):
    """``sum Re(share exp(rates t)) + line[0] + line[1] t + line[2] t^2`` of each variant."""

    rates: np.ndarray
    share: np.ndarray
    line: np.ndarray

    def plus(self, line: np.ndarray) -> Functional:
        """With (n, 2) value and slope."""
        return self._replace(line=self.line + np.pad(line, ((0, 0), (0, 1))))

    def times(self, factor: float) -> Functional:
        return self._replace(share=factor * self.share, line=factor * self.line)

    def first_zero(self, stop: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """When each falls to zero, inf where it stays positive until its stop; and of which that is sure."""
        t, found = np.zeros(len(stop)), np.full(len(stop), np.inf)
        is_sure = np.ones(len(stop), dtype=bool)
        second = np.abs(self.share) * np.abs(self.rates) ** 2
        powers = np.stack([np.ones(len(stop)), stop, stop**2], axis=1)
        size = np.abs(self.share).sum(axis=1) + (np.abs(self.line) * powers).sum(axis=1)
        going = np.arange(len(stop))
        for _ in range(MOST_STEPS):
            at, line = t[going], self.line[going]
            moved = np.exp(self.rates[going] * at[:, None])
            bound = (second[going] * np.abs(moved)).sum(axis=1) + 2.0 * np.abs(line[:, 2])
            moved *= self.share[going]
            value = moved.real.sum(axis=1) + line[:, 0] + at * (line[:, 1] + at * line[:, 2])
            moved *= self.rates[going]
            slope = moved.real.sum(axis=1) + line[:, 1] + 2.0 * at * line[:, 2]
            is_zero = value <= ROUNDING * size[going]
            root = np.sqrt(slope**2 + 2.0 * bound * np.maximum(value, 0.0))
            # the way to the zero of value + slope h - bound h^2 / 2, which is below it
            rising = (slope + root) / np.maximum(bound, 1e-250)
            h = np.where(slope < 0.0, 2.0 * value / (root - np.minimum(slope, -1e-250)), rising)
            is_there = is_zero | (h <= np.finfo(float).eps * np.maximum(at, 1.0))
            found[going[is_there]] = at[is_there]
            # what touches zero and does not fall through it, or is beyond it from the start
            doubtful = is_there & ((slope >= 0.0) | (value < -ROUNDING * size[going]))
            is_sure[going[doubtful]] = False
            t[going] = at + h
            going = going[~is_there & (at + h < stop[going])]
            if not going.size:
                return found, is_sure
        is_sure[going] = False
        return found, is_sure

    def integral(self, weight: np.ndarray, stop: np.ndarray) -> np.ndarray:
        """(n,) integrals of it, times value and slope ``weight`` (2,), from 0 to the stops."""
        s = stop[:, None]
        _, one, two = phi_functions(self.rates * s, 2)
        c, d = weight
        swinging = (self.share * s * (c * one + d * s * (one - two))).real.sum(axis=1)
        powers = stop[:, None] ** np.arange(1, 4) / np.arange(1, 4)
        more = stop[:, None] ** np.arange(2, 5) / np.arange(2, 5)
        return swinging + (self.line * (c * powers + d * more)).sum(axis=1)


class Motion(NamedTuple):
    """Modal coordinates ``free exp(rates t) + drift[0] + drift[1] t + drift[2] t^2``, and the states that they are."""

    rates: np.ndarray
    V: np.ndarray
    free: np.ndarray
    drift: np.ndarray

    def at(self, t: np.ndarray) -> np.ndarray:
        """(n, states) ndarray at a time of each variant."""
        y = self.free * np.exp(self.rates * t[:, None])
        y = y + self.drift[0] + t[:, None] * (self.drift[1] + t[:, None] * self.drift[2])
        return (self.V.real @ y.real[..., None] - self.V.imag @ y.imag[..., None])[..., 0]

    def of(self, row: np.ndarray) -> Functional:
        """A combination (n, states) of the states."""
        seen = (row[:, None, :] @ self.V)[:, 0]
        line = np.stack([(seen * drift).real.sum(axis=1) for drift in self.drift], axis=1)
        return Functional(self.rates, seen * self.free, line)


class _Modal:
    """Modes of (n, N, N) matrices, one of each pair, as many in each; ``is_sure`` where they keep their digits."""

    def __init__(self, A: np.ndarray):
        rates, V = np.linalg.eig(A)
        rates = rates.astype(complex)
        W = _inverse(V)
        size = np.abs(rates)
        is_still = size <= STILL * size.max(axis=1, keepdims=True)
        with np.errstate(invalid="ignore"):
            self.is_sure = np.linalg.norm(V, axis=(1, 2)) * np.linalg.norm(W, axis=(1, 2)) < INDEPENDENT
        self.is_sure &= (is_still | (size > SLOW)).all(axis=1)
        kept = rates.imag >= 0.0
        self.count = kept.sum(axis=1)
        order = np.argsort(~kept, axis=1, kind="stable")
        pairs = np.where(rates.imag > 0.0, 2.0, 1.0)
        # nothing drives a mode, but rounding may seem to
        rates = np.where(is_still, 0.0, np.minimum(rates.real, 0.0) + 1j * rates.imag)
        self.rates = np.take_along_axis(rates, order, 1)
        self.V = np.take_along_axis(V * pairs[:, None, :], order[:, None, :], 2).astype(complex)
        self.W = np.take_along_axis(W, order[:, :, None], 1).astype(complex)

    def motion(self, chosen: np.ndarray, m: int, x: np.ndarray, b0: np.ndarray, b1: np.ndarray) -> Motion:
        """From states x (n, N) on, under a force that rises from b0 with the slope b1; of the chosen with m modes."""
        rates, V, W = self.rates[chosen, :m], self.V[chosen, :, :m], self.W[chosen, :m]
        y, c0, c1 = ((W @ each[..., None])[..., 0] for each in (x, b0, b1))
        is_still = rates == 0.0
        over = 1.0 / np.where(is_still, 1.0, rates)
        slope = np.where(is_still, c0, -c1 * over)
        value = np.where(is_still, 0.0, (slope - c0) * over)
        drift = np.array([value, slope, np.where(is_still, 0.5 * c1, 0.0)])
        return Motion(rates, V, y - value, drift)


def _inverse(V: np.ndarray) -> np.ndarray:
    try:
        return np.linalg.inv(V)
    except np.linalg.LinAlgError:
        found = np.full_like(V, np.nan)
        for each, inverse in zip(V, found, strict=True):
            try:
                inverse[:] = np.linalg.inv(each)
            except np.linalg.LinAlgError:
                continue
        return found


class _Launches:
    """Launches of a stack whose clutch is open."""

    def __init__(self, stack: Stack, task: Launch):
        self.stack, self.task = stack, task

    def found(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Time of the lock, heat (n,), and of which variants they are sure."""
        stack, n = self.stack, self.stack.count
        self.lock, self.heat, self.is_sure = np.full(n, np.nan), np.zeros(n), np.ones(n, dtype=bool)
        start = self._start()
        if start is None:
            return self.lock, self.heat, np.zeros(n, dtype=bool)
        system = Lifted(stack)
        (clutch,) = (law for each in stack.car.stated for law in each.laws)
        self.b = system.node(ends(stack.car).engine)
        self.g = np.zeros((n, system.r + system.n))
        self.g[:, system.r :] = stack.scaled([combined(clutch.coefficients, stack.motion)], [1.0])[:, 0]
        self.x = np.zeros((n, system.r + system.n))
        self.x[:, system.r :] = start
        slip = (self.g * self.x).sum(axis=1)
        self.is_sure &= slip != 0.0
        self.side = np.sign(slip)
        # what holds the slip takes off what would change it: torque of the clutch g^T (A x + b T) / g^T g
        gg = (self.g**2).sum(axis=1)[:, None]
        self.held = (self.g[:, None, :] @ system.A)[:, 0] / gg
        self.held_by_torque = (self.g * self.b).sum(axis=1) / gg[:, 0]
        self.across = np.eye(system.r + system.n) - self.g[:, :, None] * (self.g / gg)[:, None, :]
        sliding, sticking = _Modal(system.A), _Modal(self.across @ system.A @ self.across)
        self.is_sure &= sliding.is_sure & sticking.is_sure
        # by number of modes, so that sums run over as many whatever else is in the stack
        for count in np.unique(sliding.count):
            for other in np.unique(sticking.count):
                chosen = np.flatnonzero((sliding.count == count) & (sticking.count == other) & self.is_sure)
                if chosen.size:
                    self._launch(chosen, sliding, int(count), sticking, int(other))
        return self.lock, self.heat, self.is_sure

    def _start(self) -> np.ndarray | None:
        """(n, coordinates) scaled speeds: the engine turns, and with it what springs connect; None where that is not all."""
        stack = self.stack
        friction = [getattr(element, "friction", ((0.0, 1.0),)) for element in stack.car if element.laws]
        if stack.has_loss or any(len(points) > 1 for points in friction):
            return None
        if any(len(stack.twists[c]) > 1 for c in stack.damped if c not in stack.elastic):
            return None
        engine = stack.motion[ends(stack.car).engine]
        parts = {name for coordinate in engine for name in stack.springless.expressions[coordinate]}
        if len(parts) != 1:
            return None
        (name,) = parts
        motion = {c: stack.springless.expressions[c].get(name, 0.0) for c in stack.coordinates}
        at_engine = stack.column(stack.combined({ends(stack.car).engine: 1.0}, motion))
        speeds = stack.filled((len(motion), 1), [((j, 0), motion[c]) for j, c in enumerate(stack.coordinates)])
        return (self.task.engine_speed / at_engine)[:, None] * stack.every(stack.lifted(speeds))[:, :, 0]

    def _launch(self, chosen: np.ndarray, sliding: _Modal, m: int, sticking: _Modal, k: int) -> None:
        side, going, stuck = self.side, chosen, chosen[:0]
        for begin, length, torque, capacity in self.task.pieces():
            forces = zip(torque, capacity, strict=True)
            drive = [self.b[going] * T - self.g[going] * (side[going] * c)[:, None] for T, c in forces]
            motion = sliding.motion(going, m, self.x[going], *drive)
            stop = np.full(len(going), length)
            if capacity.any():
                slip = motion.of(self.g[going] * side[going, None])
                zero, is_sure = slip.first_zero(stop)
                self.is_sure[going[~is_sure]] = False
                stop = np.minimum(zero, length)
                self.heat[going] += slip.integral(capacity, stop)
                self.lock[going] = begin + np.where(zero < length, zero, np.nan)
            self.x[going] = motion.at(stop)
            is_locked = stop < length
            now = going[is_locked]
            self.x[now] = (self.across[now] @ self.x[now][..., None])[..., 0]
            self._stick(now, stop[is_locked], length, torque, capacity, sticking, k)
            self._stick(stuck, np.zeros(len(stuck)), length, torque, capacity, sticking, k)
            going, stuck = going[~is_locked], np.concatenate([stuck, now])

    def _stick(
        self,
        these: np.ndarray,
        since: np.ndarray,
        length: float,
        torque: np.ndarray,
        capacity: np.ndarray,
        modal: _Modal,
        m: int,
    ) -> None:
        """Move on with the clutch closed to the end of a piece; not sure where the capacity would not hold it."""
        if not these.size:
            return
        T, c = (np.stack([line[0] + since * line[1], np.full(len(since), line[1])], 1) for line in (torque, capacity))
        across, b = self.across[these], self.b[these]
        drive = (across @ b[..., None])[..., 0]
        motion = modal.motion(these, m, self.x[these], drive * T[:, :1], drive * T[:, 1:])
        left = length - since
        carried = motion.of(self.held[these]).plus(self.held_by_torque[these, None] * T)
        for sign in (1.0, -1.0):
            gives_way, is_sure = carried.times(-sign).plus(c).first_zero(left)
            self.is_sure[these[~is_sure | np.isfinite(gives_way)]] = False
        self.x[these] = motion.at(left)
