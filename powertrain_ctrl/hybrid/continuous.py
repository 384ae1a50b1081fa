"""A driveline with clutches as a continuous system for python-control: friction is the saturated stick torque."""

from collections.abc import Callable
from itertools import product

import numpy as np

from ..elements.laws import FREE, STUCK
from .model import Plants

# Time in which the stuck clutch takes up slip [s]. Its only error is a boundary layer of that length at lock.
STICK_TIME = 1e-4


def functions(plants: Plants) -> tuple[Callable, Callable]:
    """Update and output function of the continuous system."""
    plant, model = plants.slipping, plants.model
    r, m, k = plant.r, len(plants.clutches), len(model.inputs)
    elastic, rate = model.elastic_rows, model.twist_rate
    spring = -model.solve_mass(model.F.T @ (model.stiffness[:, None] * model.twist_factor))
    A = np.block([[rate.on_twist[elastic], rate.on_speed[elastic]], [spring, -model.solve_mass(model.D)]])
    B = np.vstack([rate.on_load[elastic] @ model.B, model.solve_mass(model.T.T @ model.B)])
    slip = np.hstack([np.zeros((m, r)), model.S @ model.T])
    G = np.vstack([np.zeros((r, m)), model.solve_mass((model.S @ model.T).T)])
    W, slip_A, slip_B = slip @ G, slip @ A, slip @ B
    rows = plants.rows
    on_state = np.hstack([rows.twist, rows.speed])

    def motion(x: np.ndarray, u: np.ndarray, params: dict) -> tuple[np.ndarray, np.ndarray]:
        torque = friction_torque(W, slip_A @ x + slip_B @ u[:k] + slip @ x / params["stick_time"], u[k:])
        return torque, A @ x + B @ u[:k] - G @ torque

    def update(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        return motion(x, u, params)[1]

    def output(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        torque, rate = motion(x, u, params)
        y = on_state @ x + rows.load @ u[:k] + rows.acceleration @ rate[r:] + rows.friction @ torque
        held = np.abs(torque) < u[k:]
        mode = np.where(u[k:] <= 0.0, FREE, np.where(held, STUCK, np.sign(torque)))
        return np.concatenate([y, mode])

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
