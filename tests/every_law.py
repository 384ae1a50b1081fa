"""All laws by another road: exact steps on a fine grid, events by bisection, modes by trial, blows by least squares.

Of the package it knows the elements only, and each law by the equations in the docstring of its element. Its matrices are
those of `by_hand`.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise, product

import numpy as np
import scipy.linalg
import scipy.optimize
from by_hand import matrices
from event_located import BLOCK, NEAR, NOTHING, TRIAL, Machine, line

import powertrain_ctrl as pt

G = 9.80665  # standard gravity [m/s^2]
Row = np.ndarray


@dataclass
class How:
    """A mode: a torque, or a slip that is held; how its own states move and begin, and what row must stay positive until
    which mode."""

    name: str
    torque: Row | None = None
    exits: Callable[[Row], list] = field(default=lambda torque: [])
    rates: dict[int, Row] = field(default_factory=dict)
    enter: Callable[[np.ndarray], np.ndarray] = field(default=lambda X: X)
    side: int = 0  # of the slip, where it slides

    @property
    def holds(self):
        return self.torque is None


@dataclass
class Acting:
    """A law in a driveline: its modes, its row on the speeds, and how to find its mode."""

    name: str
    slip: Row
    modes: dict[int, How]
    find: Callable[[np.ndarray], int]  # at a state, if it was in no mode before
    idle: int | None = None
    moved: Row | None = None  # of a source: slip that it wants
    blocks: bool = False  # lets nothing slip forward

    @property
    def held(self):
        return next((number for number, how in self.modes.items() if how.holds), None)


class Every:
    """``X = (twists of springs, speeds, states of laws, 1, inputs, their slopes)``; in each mode ``X' = A X``."""

    def __init__(self, car, values):
        linear = [e for e in car if isinstance(e, pt.Inertia | pt.SpringDamper | pt.Drag | pt.Gear)]
        linear += [pt.Inertia(e.name, J=e.m) for e in car if isinstance(e, pt.Mass)]
        hand = matrices(linear)
        self.Z, self.nodes, self.values = hand.Z, hand.nodes, values
        self.mass = {e.name: e.m for e in car if isinstance(e, pt.Mass)}
        springs = hand.stiffness > 0.0
        W, k = hand.W[springs], hand.stiffness[springs]
        self.r, self.n, self.inputs = len(W), len(hand.M), list(values)
        self.speeds = slice(self.r, self.r + self.n)
        laws = [e for e in car if not isinstance(e, pt.Inertia | pt.Mass | pt.SpringDamper | pt.Gear)]
        self.own = sum(states_of(e) for e in laws)
        self.i = self.r + self.n + self.own + 1
        self.u = len(self.inputs)
        self.size = self.i + 2 * self.u
        self.unit = np.eye(self.size)
        self.one, self.hand, self._next = self.unit[self.i - 1], hand, self.r + self.n
        self.forces = np.zeros((self.n, self.size))
        self.forces[:, : self.r], self.forces[:, self.speeds] = -W.T * k, -hand.D
        for j, name in enumerate(self.inputs):
            if name in self.nodes:
                self.forces[:, self.i + j] = hand.row(name)
        self.inverse = np.linalg.inv(hand.M)
        self.twisted = {}
        self.laws = [law for element in laws for law in self.acting(element)]
        assert self._next == self.i - 1
        self.S = np.array([law.slip[self.speeds] for law in self.laws])
        self.open = np.zeros((self.size,) * 2)
        self.open[: self.r, self.speeds] = W
        self.open[self.speeds] = self.inverse @ self.forces
        self.open[self.i : -self.u, -self.u :] = np.eye(self.u)
        for j, law in self.twisted.values():
            self.open[j] = law
        self._modes = {}
        self.step = 0.2 / max(self.fastest(W, k), 100.0)

    def fastest(self, W, k):
        """Bound on how fast it moves in any mode [rad/s]."""
        K, D, others = (W.T * k) @ W, self.hand.D.copy(), 0.0
        for law, row in zip(self.laws, self.S, strict=True):
            stiff, damp = 0.0, 0.0
            for how in law.modes.values():
                if not how.holds:
                    stiff = max(stiff, float(abs(how.torque[self.r + self.n : self.i - 1]).max(initial=0.0)))
                    damp = max(damp, float(abs(how.torque[self.speeds]).max()) / float(abs(row).max()))
                others = max(others, *(abs(rate[j]) for j, rate in how.rates.items()), 0.0)
            K, D = K + stiff * np.outer(row, row), D + damp * np.outer(row, row)
        frequencies = np.sqrt(np.abs(np.linalg.eigvals(self.inverse @ K)).max())
        return max(frequencies + 2.0 * np.abs(np.linalg.eigvals(self.inverse @ D)).max(), others)

    # --- laws

    def row(self, **coefficients):
        row = np.zeros(self.size)
        row[self.speeds] = sum(value * self.hand.row(node) for node, value in coefficients.items())
        return row

    def state(self):
        self._next += 1
        return self._next - 1

    def twist(self, name, slip):
        """State that is the whole twist."""
        if name not in self.twisted:
            self.twisted[name] = self.state(), slip
        return self.twisted[name][0]

    def acting(self, e):
        match e:
            case pt.Drag():
                return [self.dry(f"{e.name}_friction", self.row(**{e.node: 1.0}), e.friction)] if e.friction else []
            case pt.Clutch():
                return [self.clutch(e)]
            case pt.OneWayClutch():
                slip = self.row(**{e.a: 1.0, e.b: -1.0})
                modes = {
                    0: How("driving", exits=lambda torque: [(1, torque + NOTHING * self.one)]),
                    1: How("overrunning", np.zeros(self.size), lambda torque: [(0, -slip)], side=-1),
                }
                return [Acting(e.name, slip, modes, lambda X: 1, blocks=True)]
            case pt.DogClutch():
                modes = {0: How("engaged"), 2: How("open", np.zeros(self.size))}
                return [Acting(e.name, self.row(**{e.a: 1.0, e.b: -1.0}), modes, lambda X: 2, idle=2)]
            case pt.SpeedSource():
                wanted = self.unit[self.i + self.inputs.index(e.name)]
                return [Acting(e.name, self.row(**{e.node: 1.0}), {0: How("moved")}, lambda X: 0, moved=wanted)]
            case pt.Backlash():
                return [self.play(e)]
            case pt.MultiStageSpring():
                return self.staged(e)
            case pt.SlipTyre():
                return [self.tyre(e)]
            case pt.RoadLoad():
                return self.road(e)
        raise NotImplementedError(e)

    def over_slip(self, slip, points, last_slope):
        """Modes of friction along lines through (magnitude of slip, torque): numbers 1, 2, ... forward, negative ones
        backward, 0 held up to the first torque."""
        lines = [(s0, s1, t0, (t1 - t0) / (s1 - s0)) for (s0, t0), (s1, t1) in pairwise(points)]
        if last_slope is not None:
            s, t = points[-1]
            lines.append((s, None, t, last_slope))
        elif lines:
            lines[-1] = (lines[-1][0], None, *lines[-1][2:])
        most = points[0][1] * self.one + NOTHING * self.one

        def both(torque):
            return [(1, most - torque), (-1, most + torque)]

        modes = {0: How("stuck", exits=both)}
        for n, (first, last, torque, slope) in enumerate(lines, start=1):
            for side, word in ((1, "forward"), (-1, "backward")):
                exits = [(side * (n - 1), side * slip - first * self.one)]
                exits += [] if last is None else [(side * (n + 1), last * self.one - side * slip)]
                row = side * (torque - slope * first) * self.one + slope * slip
                modes[side * n] = How(word, row, lambda torque, exits=exits: exits, side=side)
        knots = np.array([first for first, *_ in lines])

        def find(X):
            now = float(slip @ X)
            return int(np.sign(now)) * max(int(np.searchsorted(knots, abs(now), side="right")), 1)

        return modes, find

    def dry(self, name, slip, torque):
        modes, find = self.over_slip(slip, [(0.0, torque)], 0.0)
        return Acting(name, slip, modes, find)

    def clutch(self, e):
        slip = self.row(**({e.a: 1.0} if e.b is None else {e.a: 1.0, e.b: -1.0}))
        if len(e.friction) > 1:  # at a constant capacity
            modes, find = self.over_slip(slip, [(s, e.max_torque * f) for s, f in e.friction], 0.0)
            return Acting(e.name, slip, modes, find)
        capacity = self.unit[self.i + self.inputs.index(e.name)]
        most = e.static_ratio * capacity + NOTHING * self.one
        modes = {
            0: How("stuck", exits=lambda torque: [(1, most - torque), (-1, most + torque)]),
            1: How("forward", capacity, lambda torque: [(0, slip)], side=1),
            -1: How("backward", -capacity, lambda torque: [(0, -slip)], side=-1),
            2: How("free", np.zeros(self.size)),
        }
        return Acting(e.name, slip, modes, lambda X: 1 if slip @ X > 0.0 else -1, idle=2)

    def play(self, e):
        slip, one = self.row(**{e.a: 1.0, e.b: -1.0}), self.one
        q, y = self.twist(e.name, slip), self.state()
        twist, own, half, modes = self.unit[q], self.unit[y], 0.5 * e.gap, {}
        slack = e.stiffness / e.damping if e.damping and e.contact == "nordin" else 0.0

        def forget(X):
            X[y] = 0.0
            return X

        in_gap = twist - own
        to_flanks = [(1, half * one - in_gap), (2, half * one + in_gap)]
        modes[0] = How(
            "gap", np.zeros(self.size), lambda torque: to_flanks, {y: -slack * own}, (lambda X: X) if slack else forget
        )
        for number, side, word in ((1, 1.0, "right"), (2, -1.0, "left")):
            off = 0 if e.contact == "nordin" else number + 2

            def begin(X, side=side):
                X[y] = X[q] - side * half
                return X

            modes[number] = How(
                word,
                e.stiffness * own + e.damping * slip,
                lambda torque, side=side, off=off: [(off, side * torque)],
                {y: slip},
                begin,
            )
            if off:
                beyond = side * twist - half * one
                ends = [(0, beyond), (number, -e.stiffness * beyond - side * e.damping * slip)]
                modes[off] = How(f"{word}, off", np.zeros(self.size), lambda torque, ends=ends: ends, {}, forget)
        return Acting(e.name, slip, modes, lambda X: 1 if X[q] > half else 2 if X[q] < -half else 0)

    def staged(self, e):
        slip = self.row(**{e.a: 1.0, e.b: -1.0})
        q = self.twist(e.name, slip)
        twist, modes, last = self.unit[q], {}, len(e.twists) - 2
        points = zip(pairwise(e.twists), pairwise(e.torques), strict=True)
        for i, ((q0, q1), (t0, t1)) in enumerate(points):
            k = (t1 - t0) / (q1 - q0)
            exits = ([(i - 1, twist - q0 * self.one)] if i else []) + (
                [(i + 1, q1 * self.one - twist)] if i < last else []
            )
            row = k * twist + (t0 - k * q0) * self.one + e.damping * slip
            modes[i] = How(f"stage {i + 1}", row, lambda torque, exits=exits: exits)
        inner = np.array(e.twists[1:-1])
        laws = [Acting(e.name, slip, modes, lambda X: int(np.searchsorted(inner, X[q])))]
        name = f"{e.name}_friction"
        if e.friction and e.friction_stiffness is None:
            laws.append(self.dry(name, slip, e.friction))
        elif e.friction:
            y, k = self.state(), e.friction_stiffness
            most = e.friction * self.one
            modes = {
                0: How("stuck", k * self.unit[y], lambda t: [(1, most - t), (-1, most + t)], {y: slip}),
                1: How("forward", most, lambda torque: [(0, slip)], {}),
                -1: How("backward", -most, lambda torque: [(0, -slip)], {}),
            }
            laws.append(Acting(name, slip, modes, lambda X: 0))
        return laws

    def tyre(self, e):
        slip = self.row(**{e.wheel: 1.0, e.body: -1.0 / e.radius})
        limit = None if e.max_force is None else e.max_force * e.radius
        if e.relaxation_length:
            y, k, rate = (
                self.state(),
                e.slip_stiffness * e.radius**2 / e.relaxation_length,
                e.speed / e.relaxation_length,
            )
            force, rates, back = k * self.unit[y], {y: slip - rate * self.unit[y]}, rate * (limit or 0.0) / k
        else:
            d = e.slip_stiffness * e.radius**2 / e.speed
            force, rates, back = d * slip, {}, (limit or 0.0) / d
        modes = {0: How("adhering", force, rates=rates)}
        if limit is not None:
            most = limit * self.one
            modes[0].exits = lambda torque: [(1, most - torque), (-1, most + torque)]
            for side, word in ((1, "forward"), (-1, "backward")):
                ends = [(0, side * slip - back * self.one)]
                modes[side] = How(f"limit {word}", side * most, lambda torque, ends=ends: ends)
        return Acting(e.name, slip, modes, lambda X: 0)

    def road(self, e):
        slip, laws = self.row(**{e.body: 1.0}), []
        if e.constant or e.linear or e.quadratic:
            width = 2.0 * np.sqrt(e.error / e.quadratic) if e.quadratic else 1.0
            speeds = [width * i for i in range(40 if e.quadratic else 2)]  # no faster here
            points = [(v, e.constant + e.linear * v + e.quadratic * v * v) for v in speeds]
            laws.append(Acting(e.name, slip, *self.over_slip(slip, points, None)))
        if e.grade:
            weight = {0: How("weight", e.grade * self.mass[e.body] * G * self.one)}
            laws.append(Acting(f"{e.name}_grade" if laws else e.name, slip, weight, lambda X: 0))
        return laws

    # --- motion in modes

    def mode(self, modes):
        """A, torque rows, who is held by others in parallel, exits of each law, all of their rows, powers of the step."""
        if modes not in self._modes:
            hows = [law.modes[mode] for law, mode in zip(self.laws, modes, strict=True)]
            torque = np.array([np.zeros(self.size) if how.holds else how.torque for how in hows])
            A = self.open.copy()
            for how in hows:
                for j, rate in how.rates.items():
                    A[j] = rate
            held = [i for i, how in enumerate(hows) if how.holds]
            weight, free = self.S @ self.inverse @ self.S.T, self.S @ self.inverse @ self.forces
            if held:
                wanted = np.array([self.rate_of(law) for law in self.laws])
                missing = (free - wanted)[held] - weight[held] @ torque
                torque[held] = np.linalg.pinv(weight[np.ix_(held, held)], rcond=1e-9) @ missing
            A[self.speeds] -= self.inverse @ self.S.T @ torque
            slips = np.array([law.slip for law in self.laws])
            moved, could = np.abs(slips @ A).max(axis=1), np.abs(slips @ self.open).max(axis=1)
            shared = (moved <= 1e-9 * could) & (could > 0.0)
            exits = [
                [] if law.moved is not None else how.exits(t)
                for law, how, t in zip(self.laws, hows, torque, strict=True)
            ]
            rows = np.array([row for of_law in exits for _, row in of_law]).reshape(-1, self.size)
            powers, step = [np.eye(self.size)], scipy.linalg.expm(A * self.step)
            for _ in range(BLOCK):
                powers.append(step @ powers[-1])
            self._modes[modes] = A, torque, shared, exits, rows, np.array(powers)
        return self._modes[modes]

    def rate_of(self, law):
        """Row of the rate that a held slip has: 0, or the slope of what a source is given."""
        return np.zeros(self.size) if law.moved is None else np.roll(law.moved, self.u)

    first_event, _zero, _dips = Machine.first_event, staticmethod(Machine._zero), staticmethod(Machine._dips)

    # --- modes at an instant

    def resolved(self, X, before=None):
        """Modes that agree with the motion of the next `TRIAL`, and X as it goes on in them."""
        X, laws = X.copy(), self.laws
        idle = [law.idle is not None and self.is_idle(law, X) for law in laws]
        self.blow(X, idle)
        slip = np.array([law.slip @ X - (0.0 if law.moved is None else law.moved @ X) for law in laws])
        rigid = [law.moved is not None or isinstance_dog(law) for law in laws]
        near = [
            i
            for i, law in enumerate(laws)
            if law.held is not None and not idle[i] and (rigid[i] or abs(slip[i]) < NEAR)
        ]
        if near:
            weight = self.S[near] @ self.inverse @ self.S[near].T
            X[self.speeds] -= self.inverse @ self.S[near].T @ np.linalg.pinv(weight, rcond=1e-9) @ slip[near]
        modes = []
        for i, law in enumerate(laws):
            known = None if before is None else before[i]
            if idle[i]:
                modes.append(law.idle)
            elif i in near:
                modes.append(law.held)
            elif known is None or known == law.idle or (law.held is not None and self.lost(law, known, slip[i])):
                modes.append(law.find(X))
            else:
                modes.append(known)
        looked_at = [i for i in range(len(laws)) if not idle[i] and not rigid[i] and len(laws[i].modes) > 1]
        choice = tuple(modes)
        for _ in range(4 * len(looked_at) + 1):
            wanted = self.wanted(choice, looked_at, near, self.entered(X, before, choice))
            if wanted == choice:
                return choice, self.entered(X, before, choice)
            choice = wanted
        options = [self.options(laws[i], i in near, modes[i]) for i in looked_at]
        for trial in sorted(product(*options), key=lambda trial: sum(map(lambda a, b: a != b[0], trial, options))):
            choice = list(modes)
            for i, mode in zip(looked_at, trial, strict=True):
                choice[i] = mode
            choice = tuple(choice)
            if self.wanted(choice, looked_at, near, self.entered(X, before, choice)) == choice:
                return choice, self.entered(X, before, choice)
        raise RuntimeError("no choice agrees with its own motion")

    def is_idle(self, law, X):
        """Whether it is open: no capacity now, nor one that begins."""
        j = self.i + self.inputs.index(law.name)
        return X[j] == 0.0 and not X[j + self.u] > 0.0

    @staticmethod
    def lost(law, mode, slip):
        """Whether it can no longer be in that mode: it slips that was held, or to the other side."""
        return law.modes[mode].holds or law.modes[mode].side * slip < 0.0

    @staticmethod
    def options(law, is_near, now):
        if law.held is None:
            return [now, *(number for number in law.modes if number != now)]
        if is_near:
            first = [exit_ for how in law.modes.values() if how.holds for exit_, _ in how.exits(np.zeros(1))]
            return [law.held, *first]
        return [now, *(number for number in (now - 1, now + 1) if number in law.modes and number * now > 0)]

    def blow(self, X, idle):
        """What is rigid takes up its slip at once; what blocks takes part where it pushes (least change of the speeds)."""
        rigid = [i for i, law in enumerate(self.laws) if law.moved is not None or (isinstance_dog(law) and not idle[i])]
        blocks = [i for i, law in enumerate(self.laws) if law.blocks]
        wanted = np.array([0.0 if law.moved is None else law.moved @ X for law in self.laws])
        both, v = [*rigid, *blocks], X[self.speeds]
        slip = self.S @ v - wanted
        if abs(slip[rigid]).max(initial=0.0) < NEAR and slip[blocks].max(initial=0.0) < NEAR:
            return
        L = np.linalg.cholesky(self.hand.M)
        goal = np.linalg.lstsq(self.S[both] @ np.linalg.inv(L).T, wanted[both], rcond=None)[0]
        columns = np.linalg.solve(L, self.S[both].T)
        low = np.array([-np.inf] * len(rigid) + [0.0] * len(blocks))
        target = L.T @ v - goal
        push = scipy.optimize.lsq_linear(columns, target, (low, np.inf), method="bvls", tol=1e-15).x
        X[self.speeds] = np.linalg.solve(L.T, L.T @ v - columns @ push)

    def entered(self, X, before, modes):
        X = X.copy()
        for i, (law, now) in enumerate(zip(self.laws, modes, strict=True)):
            if before is None or before[i] != now:
                X = law.modes[now].enter(X)
        return X

    def wanted(self, modes, looked_at, near, X):
        A, _, shared, exits, _, _ = self.mode(modes)
        term, moved = X, np.zeros_like(X)
        for k in range(1, 8):
            term = A @ term * (TRIAL / k)
            moved = moved + term
        wanted = list(modes)
        for i in looked_at:
            law, how = self.laws[i], self.laws[i].modes[modes[i]]
            if i in near and not how.holds:  # at zero slip it slides only if it does so
                if not shared[i]:
                    wanted[i] = modes[i] if how.side * (law.slip @ moved) > 0.0 else law.held
                continue
            residual = law.slip @ A @ X if how.holds else 0.0
            if abs(residual) > 1e-6 * (1.0 + np.abs(law.slip) @ np.abs(A @ X)):  # a source takes it along
                sides = {mode.side: number for number, mode in law.modes.items() if not mode.holds}
                wanted[i] = sides.get(int(np.sign(residual)), modes[i])
                continue
            for then, row in exits[i]:
                now, rounding = row @ X, 1e-12 * (np.abs(row) @ np.abs(X)) + NOTHING * how.holds
                if (now if abs(now) > 10.0 * rounding else 0.0) + row @ moved < -1e-3 * rounding:
                    wanted[i] = then
                    break
        return tuple(wanted)

    # --- the whole run

    def start(self, speed, twist):
        X = np.zeros(self.size)
        given = np.array([speed.get(node, np.nan) for node in self.nodes])
        known = ~np.isnan(given)
        X[self.speeds] = np.linalg.lstsq(self.Z[known], given[known], rcond=None)[0]
        for name, (j, _) in self.twisted.items():
            X[j] = twist.get(name, 0.0)
        X[self.i - 1] = 1.0
        return X

    def names(self, modes):
        """Names of the modes by law, without sources, which have none."""
        pairs = zip(self.laws, modes, strict=True)
        return {law.name: law.modes[mode].name for law, mode in pairs if law.moved is None}

    def run(self, speed, twist, end):
        """(changes, X): (time, modes) wherever a mode changes, and the state at the end."""
        corners = {0.0, end}
        for signal in self.values.values():
            corners |= {t for t in getattr(signal, "times", ()) if 0.0 < t < end}
        X, changes, before, stretches = self.start(speed, twist), [], None, 0
        for t0, t1 in pairwise(sorted(corners)):
            for j, name in enumerate(self.inputs):
                X[self.i + j], X[self.i + self.u + j] = line(self.values[name], t0, t1)
            t = t0
            while t < t1 - 1e-12:
                modes, X = self.resolved(X, before)
                if modes != before:
                    changes.append((t, modes))
                before = modes
                event, X = self.first_event(modes, X, t1 - t)
                t = t1 if event is None else t + event
                stretches += 1
                if stretches > 5000:
                    raise RuntimeError("events without end")
        return changes, X


def isinstance_dog(law):
    return law.idle is not None and len(law.modes) == 2


def states_of(e):
    """How many states a law has of its own."""
    match e:
        case pt.Backlash():
            return 2
        case pt.MultiStageSpring():
            return 2 if e.friction and e.friction_stiffness else 1
        case pt.SlipTyre():
            return int(e.relaxation_length > 0.0)
    return 0
