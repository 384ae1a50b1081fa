"""A driveline as a continuous system for python-control: friction is the saturated stick torque, play acts by its twist."""

from collections.abc import Callable
from itertools import product

import numpy as np

from ..elements import Law
from .model import Plants

# Time in which the stuck clutch takes up slip [s]. Its only error is a boundary layer of that length at lock.
STICK_TIME = 1e-4


def is_direct(law: Law) -> bool:
    """Whether twist and slip alone, and the inputs, give its torque, or the most that it holds in either direction."""
    if law.load is not None or law.regions:
        return False
    if law.held is None:
        return law.memoryless
    mirrored = {-1.0 * guard.torque for guard in law.modes[law.held].guards} == {1.0, -1.0}
    for number, mode in law.modes.items():
        if not mode.held and number != law.idle:
            other = law.modes.get(-number)
            mirrored &= other is not None and other[4:9] == (
                mode.stiffness,
                mode.damping,
                -mode.torque,
                -mode.capacity,
                mode.slope,
            )
    return mirrored and not law.has_twist


def state_names(plants: Plants) -> tuple[str, ...]:
    """Names of the states: those of a sample but the stretches of laws, which follow from the twists."""
    return plants.states[: len(plants.states) - len(plants.slipping.elastic)]


class Friction:
    """Torque with which friction slides forward, by straight lines over the slip; backward it is the same."""

    def __init__(self, law: Law):
        lines = []
        for number, mode in law.modes.items():
            ahead = all(g.slip >= 0.0 or g.level > 0.0 for g in mode.guards)
            if not mode.held and number != law.idle and number > 0 and ahead:
                first = max((-g.level / g.slip for g in mode.guards if g.slip > 0.0), default=0.0)
                lines.append((first, number, mode))
        self.first, self.numbers, self.modes = zip(*sorted(lines, key=lambda line: line[0]), strict=True)

    def sliding(self, slip: float, capacity: float) -> tuple[int, float]:
        """Number of the mode at a magnitude of slip, and torque."""
        line = max(int(np.searchsorted(self.first, slip, side="right")) - 1, 0)
        mode = self.modes[line]
        torque = mode.torque + mode.damping * slip + capacity * (mode.capacity + mode.slope * slip)
        return self.numbers[line], max(torque, 0.0)


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
    frictions = {i: Friction(laws[i]) for i in holding}
    W_held = W[np.ix_(holding, holding)]
    outputs = plants.rows
    on_state = np.hstack([outputs.twist, outputs.speed])

    def torques(x: np.ndarray, u: np.ndarray, stick_time: float) -> tuple[np.ndarray, np.ndarray]:
        """Torques of all laws and the modes that they show."""
        torque, modes, slips = np.zeros(m), np.zeros(m), slip @ x[:p]
        twists = dict(zip(elastic, x[p:].tolist(), strict=True))
        for i, law in enumerate(laws):
            if i not in frictions:
                modes[i], torque[i] = law.at(twists.get(i, 0.0), float(slips[i]))
        # clutches come first, in the order of their capacities
        capacity = {i: max(float(u[k + i]), 0.0) for i in range(len(plants.clutches))}
        sliding = [frictions[i].sliding(abs(float(slips[i])), capacity.get(i, 0.0)) for i in holding]
        most = np.array([limit for _, limit in sliding])
        idle = [laws[i].idle is not None and not capacity[i] for i in holding]
        most[idle] = 0.0
        rates = slip_A @ x[:p] + slip_B @ u[:k] - W @ torque + slips / stick_time
        torque[holding] = friction_torque(W_held, rates[holding], most)
        for i, (number, limit), is_idle in zip(holding, sliding, idle, strict=True):
            side = 0 if abs(torque[i]) < limit else int(np.sign(torque[i]))
            modes[i] = laws[i].idle if is_idle else laws[i].shown(side * number) if side else laws[i].held
        return torque, modes

    def update(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        return A @ x + B @ u[:k] - G @ torques(x, u, params["stick_time"])[0]

    def output(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        torque, modes = torques(x, u, params["stick_time"])
        rate = A @ x + B @ u[:k] - G @ torque
        y = on_state @ x[:p] + outputs.load @ u[:k] + outputs.acceleration @ rate[r:p] + outputs.friction @ torque
        return np.concatenate([y, x[p:], modes])

    return update, output


def friction_torque(W: np.ndarray, b: np.ndarray, capacity: np.ndarray) -> np.ndarray:
    """Minimiser of ``tau W tau / 2 - b tau`` with ``|tau| <= capacity``."""
    capacity = np.maximum(capacity, 0.0)
    if len(b) == 1:
        return np.clip(b / W[0], -capacity, capacity)
    # Free torques solve their rows; each torque is clamped or let go where its own condition says so.
    side = np.zeros(len(b))
    for _ in range(4 * len(b)):
        torque, wanted = _clamped(W, b, capacity, side)
        if np.array_equal(wanted, side):
            return torque
        side = wanted
    for trial in product((0.0, 1.0, -1.0), repeat=len(b)):
        torque, wanted = _clamped(W, b, capacity, np.array(trial))
        if np.array_equal(wanted, trial):
            return torque
    return torque


def _clamped(W: np.ndarray, b: np.ndarray, capacity: np.ndarray, side: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torques with those of side +-1 at their capacity, and the side each of them should be on."""
    torque = side * capacity
    free = side == 0.0
    if free.any():
        torque[free] = np.linalg.lstsq(W[np.ix_(free, free)], (b - W @ torque)[free], rcond=None)[0]
    slope = W @ torque - b
    # where clutches depend on each other the slope is zero, to rounding
    rounding = 1e-12 * (np.abs(W) @ np.abs(torque) + np.abs(b))
    beyond = np.abs(torque) > capacity * (1.0 + 1e-12)
    wanted = np.where(free, np.where(beyond, np.sign(torque), 0.0), np.where(slope * side > rounding, 0.0, side))
    return torque, wanted
