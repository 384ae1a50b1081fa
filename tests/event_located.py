"""Friction by another road: exact steps on a fine grid, events by bisection, stick or slip by trial.

Of the package it knows the elements only. Its matrices are those of `by_hand`.
"""

from itertools import pairwise, product

import numpy as np
import scipy.linalg
import scipy.optimize
from by_hand import matrices

import powertrain_ctrl as pt

FREE = 2
# What happens within this time behind an event [s] decides who sticks.
TRIAL = 1e-7
NEAR = 1e-8
BLOCK = 64


class Machine:
    """``X = (spring twists, speeds, inputs and capacities, their slopes)``, linear in each mode: ``X' = A X``."""

    def __init__(self, car):
        hand = matrices(car.release())
        self.clutches = [element for element in car if isinstance(element, pt.Clutch)]
        self.inputs = [*hand.nodes, *(clutch.name for clutch in self.clutches)]
        self.Z, self.nodes = hand.Z, hand.nodes
        springs = hand.stiffness > 0.0
        W, k = hand.W[springs], hand.stiffness[springs]
        self.r, self.n, self.u = len(W), len(hand.M), len(self.inputs)
        self.m = len(self.clutches)
        size = self.r + self.n + 2 * self.u
        self.speeds = slice(self.r, self.r + self.n)
        S = np.array([hand.row(c.a) - (0.0 if c.b is None else hand.row(c.b)) for c in self.clutches])
        self.slip = np.zeros((self.m, size))
        self.slip[:, self.speeds] = S
        self.capacity = np.eye(size)[self.r + self.n + len(self.nodes) :][: self.m]
        self.ratio = np.array([clutch.static_ratio for clutch in self.clutches])
        forces = np.zeros((self.n, size))
        forces[:, : self.r] = -W.T * k
        forces[:, self.speeds] = -hand.D
        forces[:, self.r + self.n :][:, : len(self.nodes)] = hand.Z.T
        self.S, self.inverse, self.forces = S, np.linalg.inv(hand.M), forces
        self.open = np.zeros((size, size))
        self.open[: self.r, self.speeds] = W
        self.open[self.speeds] = self.inverse @ forces
        self.open[self.r + self.n : -self.u, -self.u :] = np.eye(self.u)
        fastest = np.abs(np.linalg.eigvals(self.open)).max() + np.abs(np.linalg.eigvals(self.inverse @ hand.D)).max()
        self.step = 0.2 / max(fastest, 100.0)
        weight = S @ self.inverse @ S.T
        self.redundant = np.linalg.matrix_rank(weight, 1e-9 * np.abs(weight).max()) < self.m
        self._modes = {}

    def mode(self, modes):
        """A, torque rows, who is held by others in parallel, rows that stay positive, powers of the step."""
        if modes not in self._modes:
            stuck = [i for i, mode in enumerate(modes) if mode == 0]
            torque = np.array([[mode if mode in (1, -1) else 0.0] for mode in modes]) * self.capacity
            weight = self.S @ self.inverse @ self.S.T
            free = self.S @ self.inverse @ self.forces
            if stuck:
                missing = free[stuck] - weight[stuck] @ torque
                torque[stuck] = np.linalg.pinv(weight[np.ix_(stuck, stuck)], rcond=1e-9) @ missing
            A = self.open.copy()
            A[self.speeds] -= self.inverse @ self.S.T @ torque
            moved = np.abs(self.slip @ A).max(axis=1)
            held = moved <= 1e-9 * np.abs(self.slip @ self.open).max(axis=1)  # by others in parallel
            watched = []
            for i, mode in enumerate(modes):
                if mode == 0:
                    watched += [self.ratio[i] * self.capacity[i] - side * torque[i] for side in (1, -1)]
                elif mode != FREE and not held[i]:
                    watched.append(mode * self.slip[i])
            step = scipy.linalg.expm(A * self.step)
            powers = [np.eye(len(A))]
            for _ in range(BLOCK):
                powers.append(step @ powers[-1])
            self._modes[modes] = A, torque, held, np.array(watched).reshape(-1, len(A)), np.array(powers)
        return self._modes[modes]

    def start(self, speed, signals):
        X = np.zeros(self.r + self.n + 2 * self.u)
        given = np.array([speed.get(node, np.nan) for node in self.nodes])
        known = ~np.isnan(given)
        X[self.speeds] = np.linalg.lstsq(self.Z[known], given[known], rcond=None)[0]
        return X

    # --- modes at an instant

    def resolved(self, X):
        """Modes that agree with the motion of the next `TRIAL`, and X without the slips that have become zero."""
        slip = self.slip @ X
        free = (self.capacity @ X == 0.0) & ~(X[-self.m :] > 0.0)
        near = [i for i in range(self.m) if not free[i] and abs(slip[i]) < NEAR]
        if near:
            X = X.copy()
            weight = self.S[near] @ self.inverse @ self.S[near].T
            X[self.speeds] -= self.inverse @ self.S[near].T @ np.linalg.pinv(weight, rcond=1e-9) @ slip[near]
        base = [FREE if free[i] else int(np.sign(slip[i])) for i in range(self.m)]

        def attempt(choice):
            modes = list(base)
            for i, mode in zip(near, choice, strict=True):
                modes[i] = mode
            return tuple(modes)

        choice = (0,) * len(near)
        tried = [choice]
        for _ in range(2 * len(near)):
            choice = self.wanted(attempt(choice), near, X)
            if choice == tried[-1]:
                return attempt(choice), X
            tried.append(choice)
        for choice in sorted(product((0, 1, -1), repeat=len(near)), key=np.count_nonzero):
            if self.wanted(attempt(choice), near, X) == choice:
                return attempt(choice), X
        raise RuntimeError("no choice agrees with its own motion")

    def wanted(self, modes, near, X):
        A, torque, held, _, _ = self.mode(modes)
        # powers of A on X one by one: what has moved, without the rounding of what has not
        term, moved = X, np.zeros_like(X)
        for k in range(1, 8):
            term = A @ term * (TRIAL / k)
            moved = moved + term
        wanted = []
        for i in near:
            if modes[i] == 0:
                now, rise = torque[i] @ X, torque[i] @ moved
                limit, opens = self.ratio[i] * (self.capacity[i] @ X), self.ratio[i] * (self.capacity[i] @ moved)
                rounding = 1e-12 * (np.abs(torque[i]) @ np.abs(X) + limit)
                beyond = [(side * now - limit, side * rise - opens, side) for side in (1, -1)]
                over = [side for a, b, side in beyond if (a if abs(a) > 10 * rounding else 0.0) + b > 1e-3 * rounding]
                wanted.append(over[0] if over else 0)
            elif held[i]:
                wanted.append(modes[i])
            else:
                wanted.append(modes[i] if modes[i] * (self.slip[i] @ moved) > 0.0 else 0)
        return tuple(wanted)

    # --- motion

    def first_event(self, modes, X, duration):
        """Time of the first zero of what must stay positive, or None, and X there or at the end."""
        A, _, _, watched, powers = self.mode(modes)
        done = 0.0
        lead = min(TRIAL, duration)
        X = scipy.linalg.expm(A * lead) @ X
        done = lead
        slopes = watched @ A
        while done < duration:
            count = min(BLOCK, int((duration - done) / self.step))
            if count:
                states = powers[: count + 1] @ X
                widths = np.full(count, self.step)
            else:
                states = np.array([X, scipy.linalg.expm(A * (duration - done)) @ X])
                widths = np.array([duration - done])
            g, g1 = states @ watched.T, states @ slopes.T
            hit = (g[1:] < 0.0) | ((g1[:-1] < 0.0) & (g1[1:] > 0.0) & self._dips(g, g1, widths))
            for k in np.flatnonzero(hit.any(axis=1)):
                found = [self._zero(A, watched[j], slopes[j], states[k], widths[k]) for j in np.flatnonzero(hit[k])]
                found = [t for t in found if t is not None]
                if found:
                    t = min(found)
                    return done + float(widths[:k].sum()) + t, scipy.linalg.expm(A * t) @ states[k]
            X = states[-1]
            done = done + float(widths.sum()) if count else duration
        return None, X

    @staticmethod
    def _dips(g, g1, widths):
        """Whether the cubic between two samples comes near zero."""
        h = widths[:, None]
        lowest = np.minimum(g[:-1], g[1:])
        for s in (0.25, 0.5, 0.75):
            a, b = (1 + 2 * s) * (1 - s) ** 2, s * s * (3 - 2 * s)
            c, d = s * (1 - s) ** 2, -s * s * (1 - s)
            lowest = np.minimum(lowest, a * g[:-1] + b * g[1:] + h * (c * g1[:-1] + d * g1[1:]))
        return lowest < 0.3 * (h * (np.abs(g1[:-1]) + np.abs(g1[1:])))

    @staticmethod
    def _zero(A, row, slope, X, width):
        def value(t, row=row):
            return float(row @ scipy.linalg.expm(A * t) @ X)

        end = width
        if value(width) >= 0.0:
            if not (value(0.0, slope) < 0.0 < value(width, slope)):
                return None
            end = scipy.optimize.brentq(lambda t: value(t, slope), 0.0, width, xtol=1e-16)
            if value(end) >= 0.0:
                return None
        if value(0.0) <= 0.0:
            return 0.0
        return scipy.optimize.brentq(value, 0.0, end, xtol=1e-16)


def integrated(car, signals, speed, end):
    """(changes, X, machine): (time, modes) wherever a mode changes from 0 s on, and the state at the end."""
    machine = Machine(car)
    values = {clutch.name: signals.get(f"{clutch.name}_capacity", clutch.max_torque) for clutch in machine.clutches}
    values |= {node: signals.get(f"{node}_torque", 0.0) for node in machine.nodes}
    corners = {0.0, end}
    for signal in values.values():
        corners |= {t for t in getattr(signal, "times", ()) if 0.0 < t < end}
    X = machine.start(speed, values)
    changes, before, stretches = [], None, 0
    for t0, t1 in pairwise(sorted(corners)):
        for j, name in enumerate(machine.inputs):
            first, slope = line(values[name], t0, t1)
            X[machine.r + machine.n + j], X[machine.r + machine.n + machine.u + j] = first, slope
        t = t0
        while t < t1 - 1e-12:
            modes, X = machine.resolved(X)
            if before is not None and modes != before:
                changes.append((t, modes))
            before = modes
            event, X = machine.first_event(modes, X, t1 - t)
            t = t1 if event is None else t + event
            stretches += 1
            if stretches > 5000:
                raise RuntimeError("events without end")
    return changes, X, machine


def line(signal, t0, t1):
    """Value behind t0 and slope up to t1 of a signal without corners between."""
    if not isinstance(signal, pt.hybrid.signals.PiecewiseLinear):
        return float(signal), 0.0
    before = [(t, v) for t, v in zip(signal.times, signal.values, strict=True) if t <= t0]
    after = [(t, v) for t, v in zip(signal.times, signal.values, strict=True) if t > t0]
    if not before or not after:
        return (before[-1] if before else after[0])[1], 0.0
    (ta, a), (tb, b) = before[-1], after[0]
    slope = (b - a) / (tb - ta)
    return a + slope * (t0 - ta), slope


def merged(changes, within=2e-6):
    """Changes of mode, those at nearly one instant as one."""
    result = []
    for t, modes in changes:
        if result and t - result[-1][0] < within:
            result[-1] = (result[-1][0], modes)
        else:
            result.append((t, modes))
    kept, before = [], None
    for t, modes in result:
        if modes != before:
            kept.append((t, modes))
        before = modes
    return kept
