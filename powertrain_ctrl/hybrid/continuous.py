"""A driveline as a continuous system for python-control: friction is the saturated stick torque, play acts by its twist."""

from collections.abc import Callable
from itertools import product

import numpy as np

from ..elements import Law
from .model import Plants

# Time in which the stuck clutch takes up slip [s]. Its only error is a boundary layer of that length at lock.
STICK_TIME = 1e-4


def is_direct(law: Law) -> bool:
    """Whether twist and slip alone, and the inputs, give its torque, or the most and least that it holds."""
    return law.memoryless if law.held is None else not (law.is_rigid or law.has_twist)


def state_names(plants: Plants) -> tuple[str, ...]:
    """Names of the states: those of a sample but the stretches of laws, which follow from the twists."""
    return plants.states[: len(plants.states) - len(plants.slipping.elastic)]


class Limits:
    """Least and largest torque with which friction, or a one-way clutch, can hold, and the mode in which it slides."""

    def __init__(self, law: Law):
        self.law = law
        self.lines: dict[int, list] = {1: [], -1: []}
        for number, mode in law.modes.items():
            if mode.held or number == law.idle:
                continue
            after = max((-g.level / g.slip for g in mode.guards if g.slip > 0.0), default=-np.inf)
            before = min((-g.level / g.slip for g in mode.guards if g.slip < 0.0), default=np.inf)
            if before > 0.0:
                self.lines[1].append((max(after, 0.0), number, mode))
            if after < 0.0:
                self.lines[-1].append((max(-before, 0.0), number, mode))
        self.first = {side: np.array([first for first, *_ in lines]) for side, lines in self.lines.items()}

    def sliding(self, side: int, slip: float, capacity: float) -> tuple[int | None, float]:
        """Mode and torque at a magnitude of slip to one side; that it does not allow it holds with any torque."""
        lines = self.lines[side]
        if not lines:
            return None, side * np.inf
        place = max(int(np.searchsorted(self.first[side], slip, side="right")) - 1, 0)
        _, number, mode = lines[place]
        slip = side * max(slip, self.first[side][0])
        return number, mode.damping * slip + mode.torque + capacity * (mode.capacity + mode.slope * slip)


def functions(plants: Plants) -> tuple[Callable, Callable]:
    """Update and output function of the continuous system."""
    plant, model, laws = plants.slipping, plants.model, plants.laws
    r, m, k, elastic = plant.r, len(laws), len(model.inputs), plant.elastic
    p = r + plant.n
    rows, rate = model.elastic_rows, model.twist_rate
    spring = -model.solve_mass(model.F.T @ (model.stiffness[:, None] * model.twist_factor))
    A = np.block([[rate.on_twist[rows], rate.on_speed[rows]], [spring, -model.solve_mass(model.D)]])
    B = np.vstack([rate.on_load[rows] @ model.B, model.solve_mass(model.T.T @ model.B)])
    slip = np.hstack([np.zeros((m, r)), model.S @ model.T])
    G = np.vstack([np.zeros((r, m)), model.solve_mass((model.S @ model.T).T)])
    W, slip_A, slip_B = slip @ G, slip @ A, slip @ B
    # twists of laws are states behind the others
    A = np.block([[A, np.zeros((p, len(elastic)))], [slip[elastic], np.zeros((len(elastic),) * 2)]])
    B, G = (np.vstack([M, np.zeros((len(elastic), M.shape[1]))]) for M in (B, G))
    holding = [i for i, law in enumerate(laws) if law.held is not None]
    limits = {i: Limits(laws[i]) for i in holding}
    outputs = plants.rows
    on_state = np.hstack([outputs.twist, outputs.speed])

    def torques(x: np.ndarray, u: np.ndarray, stick_time: float) -> tuple[np.ndarray, np.ndarray]:
        """Torques of all laws and the modes that they show."""
        torque, modes, slips = np.zeros(m), np.zeros(m), slip @ x[:p]
        twists = dict(zip(elastic, x[p:].tolist(), strict=True))
        for i, law in enumerate(laws):
            if i not in limits:
                modes[i], torque[i] = law.at(twists.get(i, 0.0), float(slips[i]))
        rates = slip_A @ x[:p] + slip_B @ u[:k] - W @ torque + slips / stick_time
        # clutches come first, in the order of their capacities
        capacity = {i: max(float(u[k + i]), 0.0) for i in range(len(plants.clutches))}
        sides = {
            side: [limits[i].sliding(side, abs(float(slips[i])), capacity.get(i, 0.0)) for i in holding]
            for side in (1, -1)
        }
        high, low = (np.array([bound for _, bound in sides[side]]) for side in (1, -1))
        idle = [laws[i].idle is not None and not capacity[i] for i in holding]
        high[idle] = low[idle] = 0.0
        torque[holding] = friction_torque(W[np.ix_(holding, holding)], rates[holding], low, high)
        for j, i in enumerate(holding):
            at_end = next((s for s in (1, -1) if s * torque[i] >= s * sides[s][j][1]), None)
            number = laws[i].idle if idle[j] else laws[i].held if at_end is None else sides[at_end][j][0]
            modes[i] = laws[i].shown(number if number is not None else 0)
        return torque, modes

    def update(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        return A @ x + B @ u[:k] - G @ torques(x, u, params["stick_time"])[0]

    def output(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        torque, modes = torques(x, u, params["stick_time"])
        rate = A @ x + B @ u[:k] - G @ torque
        y = on_state @ x[:p] + outputs.load @ u[:k] + outputs.acceleration @ rate[r:p] + outputs.friction @ torque
        return np.concatenate([y, x[p:], modes])

    return update, output


def friction_torque(W: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Minimiser of ``tau W tau / 2 - b tau`` with ``low <= tau <= high``."""
    if len(b) == 1:
        return np.clip(b / W[0], low, high)
    # Free torques solve their rows; each torque is clamped or let go where its own condition says so.
    side = np.zeros(len(b))
    for _ in range(4 * len(b)):
        torque, wanted = _clamped(W, b, low, high, side)
        if np.array_equal(wanted, side):
            return torque
        side = wanted
    torque = np.zeros(len(b))
    for trial in product((0.0, 1.0, -1.0), repeat=len(b)):
        torque, wanted = _clamped(W, b, low, high, np.array(trial))
        if np.array_equal(wanted, trial):
            return torque
    return torque


def _clamped(
    W: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray, side: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Torques with those of side +-1 at their bound, and the side each of them should be on."""
    bound = np.where(side > 0.0, high, np.where(side < 0.0, low, 0.0))
    side = np.where(np.isfinite(bound), side, 0.0)
    torque = np.where(side == 0.0, 0.0, bound)
    free = side == 0.0
    if free.any():
        torque[free] = np.linalg.lstsq(W[np.ix_(free, free)], (b - W @ torque)[free], rcond=None)[0]
    slope = W @ torque - b
    # where clutches depend on each other the slope is zero, to rounding
    rounding = 1e-12 * (np.abs(W) @ np.abs(torque) + np.abs(b))
    above, below = torque > high + 1e-12 * np.abs(high), torque < low - 1e-12 * np.abs(low)
    beyond = np.where(above, 1.0, np.where(below, -1.0, 0.0))
    return torque, np.where(free, beyond, np.where(slope * side > rounding, 0.0, side))
