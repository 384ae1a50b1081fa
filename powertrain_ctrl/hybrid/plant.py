"""A driveline in energy coordinates, and its matrices while each of its laws stays in one mode.

In energy coordinates ``(sqrt(k) twist, sqrt(J) speed)`` the driveline reads ``x' = A x + B u - G tau`` with
``A + A^T <= 0`` and the slips of its laws ``G^T x``. Stretches of laws are coordinates besides; in a mode with stiffness k
that is ``sqrt(k) y``, so that the matrix keeps ``A + A^T <= 0``. A twist on which nothing depends, as across an open gap,
is no coordinate but an integral of the slip. What holds its slip at zero confines x to the null space of its column of G.
"""

from collections.abc import Sequence
from functools import cached_property, lru_cache, partial
from math import isfinite

import numpy as np
import scipy.linalg

from ..base.errors import TopologyError
from ..driveline.kinematics import product
from ..elements import Law, Mode
from ..linear.assembly import TorsionalModel
from ..linear.energy import energy_form
from .flow import Flow, value_at
from .groups import groups_of
from .harmonics import Tone
from .loads import Loads, virtual_motions
from .matrices import (
    REDUNDANT,
    ROUNDING,
    Dynamics,
    Guards,
    Holding,
    Losses,
    Watch,
    null_basis,
    sum_without_rounding,
    without_rounding,
)
from .segment import Segment

# Patterns that are kept; a run seldom visits as many.
KEPT = 1024
# Torque [N m] for an acceleration of 1 rad/s^2 that no torque prevents: beyond any limit, and of it no rounding counts.
UNBOUNDED = 1e12

Modes = tuple[int, ...]


class Plant:
    """A driveline in energy coordinates; those of its clutches that are not locked act by friction.

    x holds the energy coordinates of springs and bodies; the torque that follows the input with index ``lagging`` with the
    ``lag`` [s], of which a lag of 0 leaves the place alone, while the input acts itself; oscillators of the ``tones`` of the
    inputs; then stretches and twists of those laws that have any (``elastic``).
    """

    def __init__(self, model: TorsionalModel, lagging: int | None = None, lag: float = 0.0, tones: Sequence[Tone] = ()):
        self.model = model
        moved = np.array([law.imposes is not None for law in model.laws], dtype=bool)
        self.active, self.moved = np.flatnonzero(~model.locked & ~moved), np.flatnonzero(moved)
        self.laws: list[Law] = [model.laws[i] for i in self.active]
        self.clutches = [law for law in self.laws if law.is_clutch]
        self.holds = [law.held for law in self.laws]
        self.rigid = [i for i, law in enumerate(self.laws) if law.is_rigid]
        self.elastic = [i for i, law in enumerate(self.laws) if law.has_twist]
        self.curved = [i for i, law in enumerate(self.laws) if any(mode.slope for mode in law.modes.values())]
        self.groups = groups_of(self.laws)
        self.coupled = [i for group in self.groups for i in group.laws]
        self.loaded = [i for i, law in enumerate(self.laws) if law.load is not None]
        self._require_inertia_at_laws()
        self.energy = energy = energy_form(model)
        self.r, self.n = energy.H.shape
        self.A, self.B = energy.matrix(), energy.driven(model.B)
        # slips are G^T x, torques of the laws act by W
        self.W = self.G = energy.driven(model.S[self.active].T)
        if self.moved.size:
            self._impose()
        self.lagging: tuple[int, int] | None = None
        if lagging is not None:
            self.lagging = (lagging, len(self.A)) if lag else None
            self._add_lag(lagging, lag)
        self.tones, self.sounding = tuple(tones), slice(len(self.A), len(self.A) + 2 * len(tones))
        self._add_oscillators()
        m = len(self.elastic)
        self.N = len(self.A) + m
        self.size = self.N + m
        self.A = scipy.linalg.block_diag(self.A, np.zeros((m, m)))
        self.B, self.G, self.W = (np.vstack([M, np.zeros((m, M.shape[1]))]) for M in (self.B, self.G, self.W))
        self.stretch = {i: self.N - m + j for j, i in enumerate(self.elastic)}
        self.twisted = {i: self.N + j for j, i in enumerate(self.elastic)}
        self.loads = self._loads() if self.loaded else None
        self.pattern = lru_cache(maxsize=KEPT)(partial(Pattern, self))
        self.dynamics = lru_cache(maxsize=KEPT)(self._dynamics)
        self.holding = lru_cache(maxsize=KEPT)(self._holding)
        self.multiplier = lru_cache(maxsize=KEPT)(self._multiplier)
        self.matrices = lru_cache(maxsize=KEPT)(self._matrices)
        self.required = lru_cache(maxsize=KEPT)(self._required)
        self._judge: tuple[Plant, np.ndarray] | None = None

    def _require_inertia_at_laws(self) -> None:
        """Where a node only creeps along a slip would jump with every torque."""
        for law, row in zip(self.laws, self.model.S[self.active], strict=True):
            if product(row[None, :], self.model.following.U).any():
                node = self.model.nodes[int((row[:, None] * self.model.following.U).any(axis=1).argmax())]
                raise TopologyError(f'node "{node}" has no inertia and {law.name} acts there; give it an Inertia')

    def _add_lag(self, index: int, lag: float) -> None:
        n, driven = len(self.A), self.B[:, [index]]
        self.A = np.pad(self.A, ((0, 1), (0, 1)))
        self.B = np.vstack([self.B, np.zeros(self.B.shape[1])])
        if lag:
            self.A[:n, n:], self.A[n, n] = driven, -1.0 / lag
            self.B[:, index] = 0.0
            self.B[-1, index] = 1.0 / lag
        self.G, self.W = (np.vstack([M, np.zeros(M.shape[1])]) for M in (self.G, self.W))

    def _add_oscillators(self) -> None:
        """Two states for each tone, ``size (cos, sin)(omega t)``, of which it drives the inputs."""
        n, k = len(self.A), 2 * len(self.tones)
        waves, self._sizes = np.zeros((len(self.model.inputs), k)), np.ones(len(self.tones))
        turning = np.zeros((k, k))
        for j, (omega, amplitudes) in enumerate(self.tones):
            # of the size of the torque, so that the oscillator is neither large nor small beside what it drives
            self._sizes[j] = max(map(abs, amplitudes))
            part = np.array(amplitudes) / self._sizes[j]
            waves[:, 2 * j], waves[:, 2 * j + 1] = part.real, -part.imag
            turning[2 * j, 2 * j + 1], turning[2 * j + 1, 2 * j] = -omega, omega
        self.A = np.block([[self.A, self.B[:, : len(waves)] @ waves], [np.zeros((k, n)), turning]])
        self.B, self.G, self.W = (np.vstack([M, np.zeros((k, M.shape[1]))]) for M in (self.B, self.G, self.W))
        self._waves = waves

    def _loads(self) -> Loads:
        """What loads the laws that take a share of it, from all that works on their virtual motions."""
        model, inputs = self.model, len(self.model.inputs)
        along = virtual_motions(model, [self.laws[i] for i in self.loaded], model.S[self.moved])
        x, inertia = np.eye(self.N), along @ model.J @ model.T
        torque = model.stiffness[:, None] * (model.twist_factor @ self.twist(x))
        torque += model.damping[:, None] * (model.F @ self.speed(x))
        direct = np.zeros((len(along), self.B.shape[1]))
        direct[:, :inputs] = along @ model.B
        acting, at_once = np.zeros((direct.shape[1], self.N)), np.eye(direct.shape[1])
        acting[:inputs] = self.harmonic(x)
        if self.lagging is not None:
            index, column = self.lagging
            acting[index], at_once[index] = x[column], 0.0
        return Loads(
            sum_without_rounding((-along @ model.E.T, torque), (direct, acting), (-inertia, self.speed(self.A))),
            sum_without_rounding((direct, at_once), (-inertia, self.speed(self.B))),
            sum_without_rounding((-along, model.S[self.active].T), (inertia, self.speed(self.W))),
            self.loaded,
        )

    def harmonic(self, x: np.ndarray) -> np.ndarray:
        """(inputs, ...) ndarray: what the oscillators add to the torques and forces."""
        return self._waves @ x[self.sounding]

    def tuned(self, x: np.ndarray, time: float) -> np.ndarray:
        """x, with or without oscillators, with those as they are at a time."""
        angle = time * np.array([tone.omega for tone in self.tones])
        waves = (self._sizes * np.array([np.cos(angle), np.sin(angle)])).T.ravel()
        behind = len(x) - (self.size - self.sounding.stop)
        return np.concatenate([x[: self.sounding.start], waves, x[behind:]])

    def silent(self, x: np.ndarray) -> np.ndarray:
        """x without the oscillators, as a plant without tones has it."""
        return np.delete(x, self.sounding)

    def _impose(self) -> None:
        """Move nodes: their part of x' is a given acceleration, an input besides; their sources take what else acts."""
        rows = self.energy.driven(self.model.S[self.moved].T)
        inertia = np.linalg.inv(rows.T @ rows)
        self.imposing, self.moving_rows = rows @ inertia, rows
        # torque of a source: what it takes for the acceleration, less what acts there anyway
        self.source = (inertia, -self.imposing.T @ self.A, -self.imposing.T @ self.B, self.imposing.T @ self.G)
        rest = np.eye(len(rows)) - self.imposing @ rows.T
        self.A, self.W = rest @ self.A, rest @ self.G
        self.B = np.hstack([rest @ self.B, self.imposing])

    def imposed(self, x: np.ndarray, speeds: np.ndarray) -> np.ndarray:
        """x with the moved nodes at these speeds."""
        n, x = len(self.moving_rows), x.copy()
        x[:n] += self.imposing @ (speeds - self.moving_rows.T @ x[:n])
        return x

    def state(
        self,
        twist: np.ndarray,
        speed: np.ndarray,
        law_twist: np.ndarray | float = 0.0,
        stretch: np.ndarray | float = 0.0,
    ) -> np.ndarray:
        """x from independent twists [rad], coordinate speeds, twists and stretches of the laws; the lagging torque is 0."""
        x = np.zeros(self.size)
        x[: self.r + self.n] = self.energy.state(twist, speed)
        x[self.N - len(self.elastic) : self.N] = stretch
        x[self.N :] = law_twist
        return x

    def twist(self, x: np.ndarray) -> np.ndarray:
        return self.energy.twist(x)

    def speed(self, x: np.ndarray) -> np.ndarray:
        return self.energy.speed(x)

    def slip(self, x: np.ndarray) -> np.ndarray:
        return self.G.T @ x[: self.N]

    def started(self, x: np.ndarray, modes: Modes) -> tuple[np.ndarray, Modes]:
        """x and modes with those of the elastic laws found from their twists."""
        x, chosen = x.copy(), list(modes)
        for i in self.elastic:
            if self.laws[i].held is None:
                chosen[i], x[self.stretch[i]] = self.laws[i].starting(float(x[self.twisted[i]]))
        return x, tuple(chosen)

    def entered(self, x: np.ndarray, before: Modes, modes: Modes) -> np.ndarray:
        """x with the stretches with which these modes begin."""
        if before == modes or not self.elastic:
            return x
        x = x.copy()
        for i in self.elastic:
            mode = self.laws[i].modes[modes[i]]
            if before[i] == modes[i]:
                continue
            if mode.origin is not None:
                x[self.stretch[i]] = x[self.twisted[i]] - mode.origin
            elif mode.leak == np.inf:
                x[self.stretch[i]] = 0.0
        return x

    def segment(self, polynomials: np.ndarray, duration: float) -> Segment:
        """A piece of inputs, capacities and imposed speeds (signals, degree + 1); friction over slip as at its middle."""
        n, m = len(self.model.inputs), len(self.clutches)
        levels = value_at(polynomials[[n + i for i in self.curved]], np.array([0.5 * duration]))[:, 0]
        inputs, capacities, speeds = polynomials[:n], polynomials[n : n + m], polynomials[n + m :]
        if not len(speeds):
            return Segment(inputs, capacities, tuple(levels.tolist()))
        accelerations = np.zeros_like(speeds)
        accelerations[:, :-1] = speeds[:, 1:] * np.arange(1, speeds.shape[1])
        return Segment(np.vstack([inputs, accelerations]), capacities, tuple(levels.tolist()), speeds[:, 0])

    def stored(self, x: np.ndarray, modes: Modes) -> np.ndarray:
        """(laws,) ndarray: energy [J] that the stretches of the laws keep."""
        energy = np.zeros(len(self.laws))
        for i in self.elastic:
            energy[i] = 0.5 * self.laws[i].modes[modes[i]].stored * x[self.stretch[i]] ** 2
        return energy

    def held(self, x: np.ndarray, laws: Sequence[int]) -> np.ndarray:
        """x after these laws have taken up their slip; keeps the momentum on either side."""
        x = x.copy()
        x[: self.N] -= self.W[:, list(laws)] @ (self.multiplier(tuple(laws)) @ x[: self.N])
        return x

    def _multiplier(self, laws: tuple[int, ...], share: tuple[float, ...] = ()) -> np.ndarray:
        """(laws, N) ndarray: torques of these laws that a rate of x takes to keep their slips as they are.

        Laws with loads take this share of them.
        """
        # redundant clutches in parallel share their torque with least norm
        columns = self.G[:, laws]
        if not (self.moved.size or self.loaded):
            return np.linalg.pinv(columns, rcond=REDUNDANT)
        return np.linalg.pinv(columns.T @ self.matrices(share)[2][:, laws], rcond=REDUNDANT) @ columns.T

    def modes_of(self, modes: Modes) -> list[Mode]:
        return [law.modes[number] for law, number in zip(self.laws, modes, strict=True)]

    def key(self, modes: Modes, levels: tuple[float, ...]) -> tuple:
        """What of the modes changes the matrices: of what is held, only which; of others stiffness, damping, leak, share."""
        damping = [mode.damping for mode in self.modes_of(modes)]
        for i, level in zip(self.curved, levels, strict=True):
            damping[i] += level * self.laws[i].modes[modes[i]].slope
        chosen = zip(self.modes_of(modes), damping, strict=True)
        return tuple((m.held, m.stiffness, d, m.follows, m.leak, m.share) for m, d in chosen)

    def shares(self, key: tuple) -> tuple[float, ...]:
        """What part of their loads the laws take that have any."""
        return tuple(key[i][-1] for i in self.loaded)

    def _matrices(self, share: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """A, B and W where laws take this share of their loads."""
        if self.loads is None or not any(share):
            return self.A, self.B, self.W
        on_x, on_u, on_tau = self.loads.under(np.array(share))
        taken = self.W[:, self.loaded] * share
        return self.A - taken @ on_x, self.B - taken @ on_u, self.W + taken @ on_tau

    def _dynamics(self, key: tuple) -> Dynamics:
        A, _, W = self.matrices(self.shares(key))
        A = A.copy()
        moving = np.ones(self.N, dtype=bool)
        scale = np.ones(self.N)
        for i, (_, stiffness, damping, follows, leak, _) in enumerate(key):
            column, acting = self.G[:, i], W[:, i]
            if damping:
                A -= damping * np.outer(acting, column)
            if i in self.stretch:
                y = self.stretch[i]
                moving[y] = follows or (leak > 0.0 and isfinite(leak))
                scale[y] = np.sqrt(stiffness) if stiffness else 1.0
                A[:, y] -= stiffness * acting
                A[y] += follows * column
                A[y, y] -= leak if isfinite(leak) else 0.0
        held = [i for i, mode in enumerate(key) if mode[0]]
        basis = null_basis(self.G[:, held])
        if self.elastic:
            first = self.N - len(self.elastic)
            bodies = basis[:first, abs(basis[:first]).any(axis=0)]
            basis = scipy.linalg.block_diag(bodies, np.eye(len(self.elastic)))
            basis = basis[:, np.append(np.ones(bodies.shape[1], dtype=bool), moving[first:])]
        inverse = basis.T * scale
        basis = basis / scale[:, None]
        push = inverse
        if (self.moved.size or self.loaded) and held:
            push = inverse - inverse @ W[:, held] @ self.multiplier(tuple(held), self.shares(key))
        # rounding must not turn a spring that stuck clutches keep from twisting
        return Dynamics(A, basis, inverse, push, Flow(without_rounding(push, A, basis)))

    def judged_by(self, other: "Plant") -> None:
        """Let the other plant say what laws must hold: described differently by what holds, they would contradict it."""
        units, n = np.eye(self.N), self.r + self.n
        turned = np.eye(self.N)
        turned[:n, :n] = other.energy.state(self.twist(units[:, :n]), self.speed(units[:, :n]))
        self._judge = (other, turned)

    def _required(self, laws: tuple[int, ...], key: tuple) -> Holding:
        """What these laws would have to carry to hold: less than their limit, or they slide.

        Where a moved node takes along what they would hold, no torque is enough.
        """
        if self._judge is None:
            holding = self.holding(laws, key)
        else:
            other, turned = self._judge
            holding = other.holding(laws, key)
            holding = holding._replace(on_x=holding.on_x @ turned)
        if not (self.moved.size and laws):
            return holding
        columns, first = self.G[:, laws], len(self.model.inputs)
        size, shapes = np.linalg.eigh(columns.T @ self.W[:, laws])
        vain = shapes[:, size <= REDUNDANT * np.sum(columns**2, axis=0).max()]
        on_u = holding.on_u.copy()
        on_u[:, first:] += UNBOUNDED * without_rounding(vain, vain.T, columns.T, self.B[:, first:])
        return holding._replace(on_u=on_u)

    def _holding(self, laws: tuple[int, ...], key: tuple) -> Holding:
        """What these laws carry while all of them are held and the others are as in the key."""
        _, B, W = self.matrices(self.shares(key))
        multiplier = self.multiplier(laws, self.shares(key)).copy()
        multiplier[abs(multiplier) <= ROUNDING * np.linalg.norm(multiplier, axis=1)[:, None]] = 0.0
        size = np.sum(multiplier**2, axis=1)
        weight = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
        # what does not act on them must not do so by rounding
        on_x, on_u, on_tau = (without_rounding(multiplier, M) for M in (self.dynamics(key).A, B, W))
        return Holding(on_x, on_u, -on_tau, weight)


class Pattern:
    """A driveline while each law stays in one mode."""

    def __init__(self, plant: Plant, modes: Modes, levels: tuple[float, ...] = ()):
        self.plant, self.modes, self.key = plant, modes, plant.key(modes, levels)
        self.mode = plant.modes_of(modes)
        self.damping = np.array([damping for _, _, damping, _, _, _ in self.key])
        _, self.B, self.W = plant.matrices(plant.shares(self.key))
        self.held = [i for i, mode in enumerate(self.mode) if mode.held]
        self.dynamics = plant.dynamics(self.key)
        self.holding = plant.holding(tuple(self.held), self.key)
        self.torque = np.array([mode.torque for mode in self.mode])
        self.capacity = np.array([mode.capacity for mode in self.mode])
        self.force_u = self.dynamics.push @ self.B
        self.force_tau = -self.dynamics.push @ self.W
        # what steps of some length need, if there are any
        self.responses: dict[float, np.ndarray] = {}

    def given(self, segment: Segment) -> np.ndarray:
        """(laws, degree + 1) polynomials: torque of each law that depends on nothing but its mode and capacity."""
        given = np.zeros((len(self.mode), segment.inputs.shape[1]))
        clutches = len(segment.capacities)
        given[:clutches] = self.capacity[:clutches, None] * segment.capacities
        given[:, 0] += self.torque
        if segment.coupled is not None:
            given[self.plant.coupled] += segment.coupled
        return given

    @cached_property
    def is_whole(self) -> bool:
        """Whether nothing is held, so that the coordinates of the flow are those of x."""
        basis = self.dynamics.basis
        return basis.shape == (self.plant.N, self.plant.N) and bool((basis == np.eye(self.plant.N)).all())

    @cached_property
    def on_torque(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Matrices of the torques of all laws on x, inputs and given torques."""
        return self._torques(self.holding)

    def _torques(self, holding: Holding) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        plant = self.plant
        on_x, on_u = np.zeros((len(self.mode), plant.N)), np.zeros((len(self.mode), plant.B.shape[1]))
        on_tau = np.eye(len(self.mode))
        for i, mode in enumerate(self.mode):
            on_x[i] = self.damping[i] * plant.G[:, i]
            if mode.stiffness:
                on_x[i, plant.stretch[i]] += mode.stiffness
        on_x[self.held], on_u[self.held], on_tau[self.held] = holding[:3]
        if plant.loads is not None:
            mine, share = self._loads(on_x, on_u, on_tau), np.array([self.mode[i].share for i in plant.loaded])
            for on, load in zip((on_x, on_u, on_tau), mine, strict=True):
                on[plant.loaded] += share[:, None] * load
        return on_x, on_u, on_tau

    def _loads(self, on_x: np.ndarray, on_u: np.ndarray, on_tau: np.ndarray) -> tuple[np.ndarray, ...]:
        """Matrices of the loads on x, inputs and given torques, from those of the torques without shares."""
        plant = self.plant
        assert plant.loads is not None
        load_x, load_u, load_tau = plant.loads.under(np.array([self.mode[i].share for i in plant.loaded]))
        unit = np.eye(len(load_x))
        return (
            sum_without_rounding((unit, load_x), (load_tau, on_x)),
            sum_without_rounding((unit, load_u), (load_tau, on_u)),
            sum_without_rounding((load_tau, on_tau)),
        )

    @cached_property
    def on_load(self) -> dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Of each law with a load its rows on x, inputs and given torques."""
        plant = self.plant
        if plant.loads is None:
            return {}
        on_x, on_u, on_tau = (on.copy() for on in self.on_torque)
        free = [i for i in plant.loaded if not self.mode[i].held]
        # what they take of their loads is in these already
        on_x[free], on_u[free], on_tau[free] = 0.0, 0.0, np.eye(len(self.mode))[free]
        rows = self._loads(on_x, on_u, on_tau)
        return {i: (rows[0][j], rows[1][j], rows[2][j]) for j, i in enumerate(plant.loaded)}

    @cached_property
    def held_too(self) -> list[int]:
        """Laws that slide, whose slip the held ones keep at zero: they share a load with those at their capacity."""
        rows, basis = self.plant.G.T, self.dynamics.basis
        sliding = [i for i, law in enumerate(self.plant.laws) if law.held is not None and not self.mode[i].held]
        return [i for i in sliding if np.linalg.norm(rows[i] @ basis) <= REDUNDANT * np.linalg.norm(rows[i])]

    @cached_property
    def slides(self) -> list[bool]:
        """Which laws turn their given torque into heat."""
        return [mode.heats for mode in self.mode]

    @cached_property
    def losses(self) -> Losses:
        """What is lost to dampers, to fading and to gears."""
        plant, basis = self.plant, self.dynamics.basis
        laws, factors, rows = [], [], []
        for i, mode in enumerate(self.mode):
            if self.damping[i] and not mode.held:
                laws.append(i)
                factors.append(self.damping[i])
                rows.append(plant.G[:, i] @ basis)
            if mode.stored and mode.leak and isfinite(mode.leak):
                laws.append(i)
                factors.append(mode.stored * mode.leak)
                rows.append(basis[plant.stretch[i]])
        on_u, on_tau = [np.zeros(plant.B.shape[1])] * len(laws), [np.zeros(len(self.mode))] * len(laws)
        for i, (load_x, load_u, load_tau) in self.on_load.items():
            # load times slip, a difference of two squares
            for side in (1.0, -1.0) if self.mode[i].share else ():
                laws.append(i)
                factors.append(0.25 * side * self.mode[i].share)
                rows.append((load_x + side * plant.G[:, i]) @ basis)
                on_u.append(load_u)
                on_tau.append(load_tau)
        return Losses(
            laws,
            np.array(factors),
            np.array(rows).reshape(len(laws), basis.shape[1]),
            np.array(on_u).reshape(len(laws), plant.B.shape[1]),
            np.array(on_tau).reshape(len(laws), len(self.mode)),
        )

    def integrated(self, i: int) -> bool:
        """Whether the twist of this law is no coordinate, but an integral of its slip."""
        mode = self.mode[i]
        return not (mode.follows and not mode.leak)

    @cached_property
    def guards(self) -> Guards:
        """What must stay positive in this pattern."""
        plant = self.plant
        torque_x, torque_u, torque_tau = self._torques(plant.required(tuple(self.held), self.key))
        guards = [
            (i, g)
            for i, mode in enumerate(self.mode)
            for g in mode.guards
            if not (i in self.held_too and plant.laws[i].modes[g.then].held)
        ]
        count = len(guards)
        on_x, on_u = np.zeros((count, plant.size)), np.zeros((count, plant.B.shape[1]))
        on_tau, on_c = np.zeros((count, len(self.mode))), np.zeros((count, len(plant.clutches)))
        for j, (i, g) in enumerate(guards):
            on_x[j, : plant.N] = g.slip * plant.G[:, i] + g.torque * torque_x[i]
            on_u[j], on_tau[j] = g.torque * torque_u[i], g.torque * torque_tau[i]
            if g.capacity:
                on_c[j, i] = g.capacity
            if g.load:
                load_x, load_u, load_tau = self.on_load[i]
                on_x[j, : plant.N] += g.load * load_x
                on_u[j] += g.load * load_u
                on_tau[j] += g.load * load_tau
            if g.twist or g.stretch:
                on_x[j, plant.stretch[i]] += g.stretch
                on_x[j, plant.twisted[i]] += g.twist
        level = np.array([g.level for _, g in guards])
        laws, then, on_forcing = [i for i, _ in guards], [g.then for _, g in guards], np.hstack([on_u, on_tau, on_c])
        on_load = np.array([bool(g.load and not g.torque) for _, g in guards], dtype=bool)
        return Guards(laws, then, on_x, on_u, on_tau, on_c, level, on_forcing, on_load)

    @cached_property
    def guard_sizes(self) -> tuple[np.ndarray, np.ndarray]:
        """Magnitudes of what state and forcing do to the guards."""
        return abs(self.guards.on_x), abs(self.guards.on_forcing)

    @cached_property
    def watch(self) -> Watch:
        """The guards on the coordinates of a trajectory."""
        plant, on_x = self.plant, self.guards.on_x
        rows, start = on_x[:, : plant.N].copy(), np.zeros_like(on_x)
        sums = np.zeros_like(rows)
        for i, q in plant.twisted.items():
            y, on_twist = plant.stretch[i], on_x[:, q]
            start[:, q] = on_twist
            if self.integrated(i):
                sums += np.outer(on_twist, plant.G[:, i])
            else:  # twist less stretch stays as it is
                rows[:, y] += on_twist
                start[:, y] -= on_twist
            if not self.dynamics.basis[y].any():
                start[:, y] += rows[:, y]
                rows[:, y] = 0.0
        basis, flow = self.dynamics.basis, self.dynamics.flow
        on_flow, on_integrals = flow.rows(rows @ basis), flow.rows(sums @ basis)
        weights = flow.weights(on_flow), flow.weights(on_integrals)
        return Watch(on_flow, on_integrals if sums.any() else None, start, *weights)
