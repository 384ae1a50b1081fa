"""Clutches and play by another road: exact steps on a fine grid, events by bisection, modes by trial.

Of the package it knows the elements only. Its matrices are those of `by_hand`. Modes have the numbers that the package
shows: of a clutch 1, -1, 0 stuck, 2 free; of a one-way clutch 0 driving, 1 overrunning; of play 0 gap, 1 right, 2 left, and
3, 4 where a clipped shaft would pull.
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
# A torque [N m] that is none.
NOTHING = 1e-12
BLOCK = 64


class Machine:
    """``X = (twists of springs, speeds, of each play its whole twist and that of its shaft, 1, inputs, their slopes)``.

    Capacities are inputs too. In each mode ``X' = A X``.
    """

    def __init__(self, car):
        hand = matrices(car.release())
        clutches, freewheels, self.plays = (
            [e for e in car if isinstance(e, kind)] for kind in (pt.Clutch, pt.OneWayClutch, pt.Backlash)
        )
        self.laws = [*clutches, *freewheels, *self.plays]
        # clutches come first, then the others that can hold
        self.c, self.h, self.m = len(clutches), len(clutches) + len(freewheels), len(self.laws)
        self.inputs = [*hand.nodes, *(clutch.name for clutch in clutches)]
        self.Z, self.nodes = hand.Z, hand.nodes
        springs = hand.stiffness > 0.0
        names = [e.name for e in car if isinstance(e, pt.SpringDamper | pt.Tyre | pt.Drag)]
        self.springs = [name for name, is_spring in zip(names, springs, strict=True) if is_spring]
        W, k = hand.W[springs], hand.stiffness[springs]
        self.r, self.n, self.u = len(W), len(hand.M), len(self.inputs)
        self.p = self.r + self.n
        self.i = self.p + 2 * len(self.plays) + 1  # where the inputs begin
        unit = np.eye(self.i + 2 * self.u)
        self.speeds = slice(self.r, self.p)
        self.twist, self.own = unit[self.p : self.i - 1 : 2], unit[self.p + 1 : self.i - 1 : 2]
        self.one = unit[self.i - 1]
        S = np.array([hand.row(e.a) - (0.0 if e.b is None else hand.row(e.b)) for e in self.laws])
        self.slip = np.zeros((self.m, len(unit)))
        self.slip[:, self.speeds] = S
        self.capacity = unit[self.i + len(self.nodes) :][: self.c]
        self.ratio = np.array([clutch.static_ratio for clutch in clutches])
        forces = np.zeros((self.n, len(unit)))
        forces[:, : self.r] = -W.T * k
        forces[:, self.speeds] = -hand.D
        forces[:, self.i :][:, : len(self.nodes)] = hand.Z.T
        self.S, self.inverse, self.forces = S, np.linalg.inv(hand.M), forces
        self.open = np.zeros((len(unit),) * 2)
        self.open[: self.r, self.speeds] = W
        self.open[self.speeds] = self.inverse @ forces
        self.open[self.p : self.i - 1 : 2] = self.slip[self.h :]
        self.open[self.i : -self.u, -self.u :] = np.eye(self.u)
        K, D = W.T @ (k[:, None] * W), hand.D
        for play, row in zip(self.plays, S[self.h :], strict=True):
            K, D = K + play.stiffness * np.outer(row, row), D + play.damping * np.outer(row, row)
        fastest = np.sqrt(np.abs(np.linalg.eigvals(self.inverse @ K)).max())
        fastest += 2.0 * np.abs(np.linalg.eigvals(self.inverse @ D)).max()
        self.step = 0.2 / max(fastest, 100.0, *map(leak, self.plays))
        weight = S[: self.h] @ self.inverse @ S[: self.h].T
        self.redundant = self.h > 0 and np.linalg.matrix_rank(weight, 1e-9 * np.abs(weight).max()) < self.h
        self._modes = {}

    def mode(self, modes):
        """A, torque rows, who is held by others in parallel, exits of each law (mode that follows, row), all rows, powers.

        Rows are of what stays positive, powers those of the step.
        """
        if modes not in self._modes:
            torque, A = np.zeros_like(self.slip), self.open.copy()
            for i, mode in enumerate(modes):
                if i < self.c and mode in (1, -1):
                    torque[i] = mode * self.capacity[i]
            for j, play in enumerate(self.plays):
                i, y = self.h + j, self.p + 2 * j + 1
                if modes[i] in (1, 2):
                    torque[i] = play.stiffness * self.own[j] + play.damping * self.slip[i]
                    A[y] = self.slip[i]
                elif modes[i] == 0:
                    A[y] = -leak(play) * self.own[j]
            held = [i for i in range(self.h) if modes[i] == 0]
            weight = self.S @ self.inverse @ self.S.T
            free = self.S @ self.inverse @ self.forces
            if held:
                missing = free[held] - weight[held] @ torque
                torque[held] = np.linalg.pinv(weight[np.ix_(held, held)], rcond=1e-9) @ missing
            A[self.speeds] -= self.inverse @ self.S.T @ torque
            moved = np.abs(self.slip @ A).max(axis=1)
            shared = moved <= 1e-9 * np.abs(self.slip @ self.open).max(axis=1)  # by others in parallel
            exits = [self.exits(i, mode, torque[i], shared[i]) for i, mode in enumerate(modes)]
            rows = np.array([row for of_law in exits for _, row in of_law]).reshape(-1, len(A))
            powers, step = [np.eye(len(A))], scipy.linalg.expm(A * self.step)
            for _ in range(BLOCK):
                powers.append(step @ powers[-1])
            self._modes[modes] = A, torque, shared, exits, rows, np.array(powers)
        return self._modes[modes]

    def exits(self, i, mode, torque, shared):
        """(mode that follows, row that stays positive until then) of a law."""
        nothing = NOTHING * self.one
        if i < self.c:
            if mode == 0:
                return [(side, self.ratio[i] * self.capacity[i] - side * torque + nothing) for side in (1, -1)]
            return [] if mode == FREE or shared else [(0, mode * self.slip[i])]
        if i < self.h:
            return [(1, torque + nothing)] if mode == 0 else [(0, -self.slip[i])]
        play, j = self.plays[i - self.h], i - self.h
        half = 0.5 * play.gap * self.one
        if mode == 0:
            in_gap = self.twist[j] - self.own[j]
            return [(1, half - in_gap), (2, half + in_gap)]
        side = 1.0 if mode in (1, 3) else -1.0
        if mode in (1, 2):
            return [(0 if play.contact == "nordin" else mode + 2, side * torque)]
        beyond = side * self.twist[j] - half
        return [(0, beyond), (mode - 2, -play.stiffness * beyond - side * play.damping * self.slip[i])]

    def start(self, speed, twist):
        """X from speeds of nodes and twists of springs and play; inputs are not yet known."""
        X = np.zeros(len(self.open))
        given = np.array([speed.get(node, np.nan) for node in self.nodes])
        known = ~np.isnan(given)
        X[self.speeds] = np.linalg.lstsq(self.Z[known], given[known], rcond=None)[0]
        X[: self.r] = [twist.get(name, 0.0) for name in self.springs]
        X[self.p : self.i - 1 : 2] = [twist.get(play.name, 0.0) for play in self.plays]
        X[self.i - 1] = 1.0
        return X

    # --- modes at an instant

    def resolved(self, X, before=None):
        """Modes that agree with the motion of the next `TRIAL`, and X as it goes on in them.

        What has reached zero slip has none, and shafts of play begin with the twist of their contact.
        """
        slip = self.slip @ X
        free = [(self.capacity[i] @ X == 0.0) and not X[-self.c + i] > 0.0 for i in range(self.c)]
        near = [i for i in range(self.h) if not (i < self.c and free[i]) and abs(slip[i]) < NEAR]
        if near:
            X = X.copy()
            weight = self.S[near] @ self.inverse @ self.S[near].T
            X[self.speeds] -= self.inverse @ self.S[near].T @ np.linalg.pinv(weight, rcond=1e-9) @ slip[near]
        modes = [FREE if free[i] else int(np.sign(slip[i])) for i in range(self.c)]
        modes += [1] * (self.h - self.c)
        if any(slip[i] > 0.0 for i in range(self.c, self.h) if i not in near):
            raise RuntimeError("a one-way clutch slips the wrong way")
        modes += [self.side(j, X) for j in range(len(self.plays))] if before is None else before[self.h :]
        for i in near:
            modes[i] = 0
        choice, looked_at = tuple(modes), [*near, *range(self.h, self.m)]
        for _ in range(4 * len(looked_at) + 1):
            wanted = self.wanted(choice, looked_at, self.entered(X, before, choice))
            if wanted == choice:
                return choice, self.entered(X, before, choice)
            choice = wanted
        options = [(0, 1, -1) if i < self.c else (0, 1) if i < self.h else range(5) for i in looked_at]
        for trial in sorted(product(*options), key=np.count_nonzero):
            choice = list(modes)
            for i, mode in zip(looked_at, trial, strict=True):
                choice[i] = mode
            choice = tuple(choice)
            if self.wanted(choice, looked_at, self.entered(X, before, choice)) == choice:
                return choice, self.entered(X, before, choice)
        raise RuntimeError("no choice agrees with its own motion")

    def side(self, j, X):
        """Mode of play j at a twist."""
        twist, half = self.twist[j] @ X, 0.5 * self.plays[j].gap
        return 1 if twist > half else 2 if twist < -half else 0

    def entered(self, X, before, modes):
        """X with shafts of play as they begin: in contact twisted by what is beyond the flank, clipped ones by none."""
        X = X.copy()
        for j, play in enumerate(self.plays):
            now = modes[self.h + j]
            if now in (1, 2) and (before is None or before[self.h + j] != now):
                X[self.p + 2 * j + 1] = X[self.p + 2 * j] - (0.5 if now == 1 else -0.5) * play.gap
            elif now in (0, 3, 4) and not leak(play):
                X[self.p + 2 * j + 1] = 0.0
        return X

    def wanted(self, modes, looked_at, X):
        A, _, shared, exits, _, _ = self.mode(modes)
        # powers of A on X one by one: what has moved, without the rounding of what has not
        term, moved = X, np.zeros_like(X)
        for k in range(1, 8):
            term = A @ term * (TRIAL / k)
            moved = moved + term
        wanted = list(modes)
        for i in looked_at:
            if i < self.h and modes[i] != 0:  # at zero slip it slides only if it does so
                if not shared[i]:
                    ((_, row),) = exits[i]
                    wanted[i] = modes[i] if row @ moved > 0.0 else 0
                continue
            for then, row in exits[i]:
                now, rounding = row @ X, 1e-12 * (np.abs(row) @ np.abs(X)) + NOTHING * (i < self.h)
                if (now if abs(now) > 10.0 * rounding else 0.0) + row @ moved < -1e-3 * rounding:
                    wanted[i] = then
                    break
        return tuple(wanted)

    # --- motion

    def first_event(self, modes, X, duration):
        """Time of the first zero of what must stay positive, or None, and X there or at the end."""
        A, _, _, _, watched, powers = self.mode(modes)
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


def leak(play):
    """Rate [1/s] at which the shaft of play untwists in the gap by itself; 0 where it has none or forgets it at once."""
    return play.stiffness / play.damping if play.damping and play.contact == "nordin" else 0.0


def integrated(car, signals, speed, end, twist=None):
    """(changes, X, machine): (time, modes) wherever a mode changes from 0 s on, and the state at the end.

    Speeds of nodes, twists of springs and play at the start.
    """
    machine = Machine(car)
    clutches = machine.laws[: machine.c]
    values = {clutch.name: signals.get(f"{clutch.name}_capacity", clutch.max_torque) for clutch in clutches}
    values |= {node: signals.get(f"{node}_torque", 0.0) for node in machine.nodes}
    corners = {0.0, end}
    for signal in values.values():
        corners |= {t for t in getattr(signal, "times", ()) if 0.0 < t < end}
    X = machine.start(speed, twist or {})
    changes, before, stretches = [], None, 0
    for t0, t1 in pairwise(sorted(corners)):
        for j, name in enumerate(machine.inputs):
            first, slope = line(values[name], t0, t1)
            X[machine.i + j], X[machine.i + machine.u + j] = first, slope
        t = t0
        while t < t1 - 1e-12:
            modes, X = machine.resolved(X, before)
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
