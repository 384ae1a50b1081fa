"""Torques that depend on the slips of several laws, such as those of a torque converter, followed closely in steps.

Within a step these torques are polynomials in time; all else is exact under them, events included. At the Lobatto nodes of
the step the polynomials agree with the torques that belong to the slips there (collocation; Hairer, Nørsett, Wanner,
Solving Ordinary Differential Equations I (1993), II.7), and a step is as long as they do so in between too, within a given
part of the torque. What is simulated is then the driveline itself with torques that are wrong by no more than that.
"""

from typing import NamedTuple

import numpy as np

from ..base.errors import PowertrainError
from .motion import Motion
from .plant import Modes, Pattern, Plant
from .segment import Segment

# In a step of unit length: Lobatto nodes, zeros of the derivative of the Legendre polynomial of degree 5 and the ends; and
# times in between, in the middle of the angles of these.
_LEGENDRE = np.polynomial.Legendre.basis(5)
NODES = 0.5 + 0.5 * np.concatenate([[-1.0], np.sort(_LEGENDRE.deriv().roots().real), [1.0]])
BETWEEN = 0.5 - 0.5 * np.cos(0.5 * (np.arccos(1.0 - 2.0 * NODES[1:]) + np.arccos(1.0 - 2.0 * NODES[:-1])))
TIMES = np.sort(np.concatenate([NODES, BETWEEN]))
ORDER = len(NODES)
_AT_NODES = np.searchsorted(TIMES, NODES)
_INVERSE = np.linalg.inv(np.vander(NODES, increasing=True))
_POWERS = np.vander(TIMES, ORDER, increasing=True)
# Lengths [s] of steps are halves of halves of the longest, so that what a step needs is seldom computed anew.
LONGEST, SHORTEST = 0.125, 1e-9
# The polynomials are found by iteration, to this part of the closeness wanted or to rounding, or the step is too long.
ITERATIONS, SETTLED, ROUNDED = 40, 1e-2, 1e-14
# A slip is beyond an edge if it is so by this part of the slips and by this [rad/s] besides: clearly in the next region, or,
# if it is not by half of that, in none.
BEYOND = 1e-9


class Close(NamedTuple):
    """Motion that holds for so long [s], and how long the next step may be."""

    motion: Motion
    length: float
    trial: float


def acting(plant: Plant, x: np.ndarray, segment: Segment) -> Segment:
    """The segment with the torques that depend on several slips as they are in this state."""
    if not plant.coupled:
        return segment
    slips = plant.slip(x)[plant.coupled]
    forms = _forms(plant, slips, 0.0)[0]
    return segment.with_coupled(_torques(forms, slips[:, None]))


def followed(
    plant: Plant,
    modes: Modes,
    x: np.ndarray,
    segment: Segment,
    time: float,
    left: float,
    trial: float,
    closeness: float,
) -> Close:
    """Motion from a state at a time, as far as one step goes but no further than ``left``."""
    slips = plant.slip(x)[plant.coupled]
    forms, edges = _forms(plant, slips, time)
    free = Motion(plant, modes, x, segment.with_coupled(np.zeros((len(slips), 1))))
    rows = plant.G[:, plant.coupled].T @ free.pattern.dynamics.basis
    h = trial
    while 0.5 * h >= max(left, SHORTEST):
        h *= 0.5
    while True:
        response = _response(free.pattern, h)
        without = rows @ free.trajectory.state(h * TIMES)
        with np.errstate(over="ignore", invalid="ignore"):  # where the iteration leads nowhere
            torques, moved, error = _collocated(forms, without, response, closeness)
        if error <= closeness:
            break
        halves = 2 if error == np.inf else max(1, int(np.ceil(np.log2(error / closeness) / ORDER)))
        h *= 0.5**halves
        if h < SHORTEST:
            names = ", ".join(plant.laws[group.laws[0]].owner for group in plant.groups)
            raise PowertrainError(
                f"{names}: cannot be followed at t = {time:.9g} s in steps of {SHORTEST:g} s; give what turns with it more "
                "inertia"
            )
    motion = free
    if torques.any():
        polynomials = (torques @ _INVERSE.T) / h ** np.arange(ORDER)
        motion = Motion(plant, modes, x, segment.with_coupled(polynomials))
    length = min(h, left, _within(edges, motion, rows, moved, h))
    grown = 2.0 * h if error * 2.0 ** (ORDER + 1) < closeness and h < LONGEST else h
    return Close(motion, length, grown)


def _collocated(
    forms: np.ndarray, without: np.ndarray, response: np.ndarray, closeness: float
) -> tuple[np.ndarray, np.ndarray, float]:
    """Torques at the nodes, slips at all times, and by what part of themselves the torques differ in between."""
    k = len(without)
    torques = np.repeat(_torques(forms, without[:, :1]), ORDER, axis=1)
    for _ in range(ITERATIONS):
        slips = without + (response @ (torques @ _INVERSE.T).ravel()).reshape(k, -1)
        wanted = _torques(forms, slips)
        size = float(_torques(abs(forms), abs(slips)).max())
        change = float(abs(wanted[:, _AT_NODES] - torques).max())
        torques = wanted[:, _AT_NODES]
        if not np.isfinite(size):
            break
        if abs(wanted).max() <= ROUNDED * size:  # pump and turbine held together
            return np.zeros_like(torques), slips, 0.0
        if change <= max(SETTLED * closeness, ROUNDED) * size:
            error = float(abs(wanted - (torques @ _INVERSE.T) @ _POWERS.T).max())
            return torques, slips, error / size if size else 0.0
    return torques, without, float("inf")


def _torques(forms: np.ndarray, slips: np.ndarray) -> np.ndarray:
    """(laws, times) ndarray of torques under slips (laws, times)."""
    return np.einsum("lij,it,jt->lt", forms, slips, slips)


def _forms(plant: Plant, slips: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
    """(laws, laws, laws) and (edges, laws) ndarrays: the forms of all torques where they are now, and its edges."""
    k = len(slips)
    forms, edges, first = np.zeros((k, k, k)), [], 0
    for group in plant.groups:
        own, law = slice(first, first + len(group.laws)), plant.laws[group.laws[0]]
        first += len(group.laws)
        least = (group.edges @ slips[own]).min(axis=1)
        place = int(least.argmax())
        if (group.edges[place] @ slips[own] < -0.5 * _slack(group.edges[place], slips[own])).any():
            shown = ", ".join(f"{value:.6g}" for value in slips[own])
            raise PowertrainError(
                f"{law.owner}: slips {shown} rad/s at t = {time:.9g} s, permitted: {law.cover}; end the run before, or give "
                "what it turns with a torque or friction that keeps it so"
            )
        forms[own, own, own] = group.forms[place]
        edge = np.zeros((group.edges.shape[1], k))
        edge[:, own] = group.edges[place]
        edges.append(edge)
    return forms, np.vstack(edges)


def _slack(edges: np.ndarray, slips: np.ndarray) -> np.ndarray:
    """(edges,) ndarray: how far beyond each slips are clearly so [rad/s]."""
    return BEYOND * (abs(edges).max(axis=1) + abs(edges) @ abs(slips))


def _within(edges: np.ndarray, motion: Motion, rows: np.ndarray, slips: np.ndarray, h: float) -> float:
    """How long the slips, known at all times of a step, stay within these edges."""
    slack = _slack(edges, abs(slips).max(axis=1))
    inside = edges @ slips + slack[:, None]
    left = np.flatnonzero((inside < 0.0).any(axis=0))
    if not left.size:
        return np.inf
    last, ends = int(left[0]), []
    for edge, reach in zip(edges[inside[:, last] < 0.0], slack[inside[:, last] < 0.0], strict=True):

        def over(t: float, edge: np.ndarray = edge, reach: float = reach) -> float:
            return float(edge @ rows @ motion.trajectory.state(np.array([t]))[:, 0] + reach)

        before, after = h * TIMES[last - 1], h * TIMES[last]
        # near the edge the slips of the motion differ by rounding from those that were looked at
        if over(before) <= 0.0 or over(after) >= 0.0:
            ends.append(after if over(after) >= 0.0 else before)
        else:
            from scipy.optimize import brentq  # slow to import, and seldom needed

            ends.append(brentq(over, before, after, xtol=1e-15))
    return min(ends)


def _response(pattern: Pattern, h: float) -> np.ndarray:
    """(laws x times, laws x powers) ndarray: slips over a step from rest under unit powers of ``t / h`` as torques."""
    if h in pattern.responses:
        return pattern.responses[h]
    plant, dynamics = pattern.plant, pattern.dynamics
    rows = plant.G[:, plant.coupled].T @ dynamics.basis
    columns = []
    for i in plant.coupled:
        for power in range(ORDER):
            b = np.zeros((rows.shape[1], ORDER))
            b[:, power] = pattern.force_tau[:, i] / h**power
            columns.append((rows @ dynamics.flow.trajectory(np.zeros(len(b)), b).state(h * TIMES)).ravel())
    pattern.responses[h] = found = np.array(columns).T
    return found
