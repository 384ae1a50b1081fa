"""Derivatives of frequency and damping of a mode with respect to every value of a driveline.

In node motions x the modes obey ``(K - omega^2 J) x + A^T lambda = 0`` and ``A x = 0`` with the constraint rows A, so that

    d(omega^2) = x^T (dK - omega^2 dJ) x + 2 lambda^T dA x    where x^T J x = 1

(R. L. Fox, M. P. Kapoor, AIAA Journal 6 (1968) 2426, with constraints). The change of the shape, on which that of the
damping ratio depends, solves the same equations differentiated once. Rows of elements are differentiated by a complex step
(W. Squire, G. Trapp, SIAM Review 40 (1998) 110), which is exact.
"""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from ..driveline.collection import Driveline
from ..elements import Element

# Share of a value by which it is changed: of a complex step, and of the two steps where rows take no complex numbers.
COMPLEX_STEP, REAL_STEP = 1e-30, 1e-6


class _Matrices(NamedTuple):
    """Inertia, twists, stiffness, damping, stiffness times loss factor, and constraints in node motions; or derivatives."""

    J: np.ndarray
    E: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    loss: np.ndarray
    A: np.ndarray


def log_derivatives(car: Driveline, omega: float, shape: np.ndarray) -> tuple[dict[str, float], dict[str, float]]:
    """``d ln f / d ln p`` and ``d ln zeta / d ln p`` of a mode with a frequency of its own, by ``element.parameter``.

    Parameters
    ----------
    car : Driveline
    omega : float
        Of the mode [rad/s], > 0.
    shape : (nodes,) ndarray
        Motion of the nodes, of any size.

    Returns
    -------
    frequency, damping : dict
        The latter nan where nothing damps the mode.
    """
    owners = [element for element in car if element.inertias or element.compliances or element.constraints]
    here = _stated(car, [(element, element) for element in owners])
    x = shape / np.sqrt(shape @ here.J @ shape)
    twist = here.E @ x
    force = here.E.T @ (here.stiffness * twist) - omega**2 * (here.J @ x)
    held = np.linalg.lstsq(here.A.T, -force, rcond=None)[0]
    # 2 zeta omega^2
    dissipated = omega * (here.damping @ twist**2) + here.loss @ twist**2
    frequency, damping = {}, {}
    shapes = _Bordered(here, omega, x)
    for name, rate in _rates(car, owners):
        dtwist = rate.E @ x
        push = rate.E.T @ (here.stiffness * twist) + here.E.T @ (rate.stiffness * twist + here.stiffness * dtwist)
        push = push - omega**2 * (rate.J @ x)
        square = x @ push + 2.0 * held @ (rate.A @ x)
        frequency[name] = float(0.5 * square / omega**2)
        dx = shapes.solve(push - square * (here.J @ x) + rate.A.T @ held, rate.A @ x, 0.5 * x @ rate.J @ x)
        moved = dtwist + here.E @ dx
        viscous = rate.damping @ twist**2 + 2.0 * (here.damping * twist) @ moved
        viscous += frequency[name] * (here.damping @ twist**2)
        changed = omega * viscous + rate.loss @ twist**2 + 2.0 * (here.loss * twist) @ moved
        damping[name] = float(changed / dissipated - 2.0 * frequency[name]) if dissipated else float("nan")
    return frequency, damping


class _Bordered:
    """``[[K - omega^2 J, A^T, J x], [A, 0, 0], [x^T J, 0, 0]]``, which has an inverse although omega is a frequency."""

    def __init__(self, here: _Matrices, omega: float, x: np.ndarray):
        K = here.E.T @ (here.stiffness[:, None] * here.E) - omega**2 * here.J
        border = np.vstack([here.A, (here.J @ x)[None]])
        whole = np.block([[K, border.T], [border, np.zeros((len(border), len(border)))]])
        # equations and unknowns scaled to size 1; redundant constraints have no unique multipliers, but shapes
        size = np.sqrt(np.abs(whole).max(axis=0))
        self.scale = 1.0 / np.where(size == 0.0, 1.0, size)
        self.inverse = np.linalg.pinv(whole * self.scale * self.scale[:, None], rcond=1e-14)
        self.n = len(K)

    def solve(self, push: np.ndarray, pull: np.ndarray, size: float) -> np.ndarray:
        right = -np.concatenate([push, pull, [size]])
        return (self.scale * (self.inverse @ (self.scale * right)))[: self.n]


def _rates(car: Driveline, owners: list[Element]) -> Iterator[tuple[str, _Matrices]]:
    """Name of each value that is not None, and ``p d/dp`` of the matrices."""
    for element in owners:
        for item in dataclasses.fields(element):
            value = getattr(element, item.name)
            if "permitted" in item.metadata and value is not None:
                yield f"{element.name}.{item.name}", _rate(car, owners, element, item.name, value)


def _rate(car: Driveline, owners: list[Element], element: Element, name: str, value: float) -> _Matrices:
    def at(changed: Any) -> _Matrices:
        other = copy.copy(element)
        object.__setattr__(other, name, changed)
        return _stated(car, [(each, other if each is element else None) for each in owners])

    try:
        return _Matrices(*(matrix.imag / COMPLEX_STEP for matrix in at(value * (1.0 + 1j * COMPLEX_STEP))))
    except TypeError:
        up, down = at(value * (1.0 + REAL_STEP)), at(value * (1.0 - REAL_STEP))
        return _Matrices(*((a - b).real / (2.0 * REAL_STEP) for a, b in zip(up, down, strict=True)))


def _stated(car: Driveline, stating: list[tuple[Element, Element | None]]) -> _Matrices:
    """Matrices of what elements state, or others in their place; rows of None stay 0."""
    place = {node: i for i, node in enumerate(car.nodes)}
    n = len(place)
    compliances = [row for element, _ in stating for row in element.compliances]
    constraints = [row for element, _ in stating for row in element.constraints]
    locked = [law for element in car for law in element.laws if law.is_clutch and law.name not in car.released]
    kind = complex if any(other is not None and other is not element for element, other in stating) else float
    J, E = np.zeros((n, n), dtype=kind), np.zeros((len(compliances), n), dtype=kind)
    stiffness, damping, loss = (np.zeros(len(compliances), dtype=kind) for _ in range(3))
    A = np.zeros((len(constraints) + len(locked), n), dtype=kind)
    c = a = 0
    for element, other in stating:
        if other is None:
            c, a = c + len(element.compliances), a + len(element.constraints)
            continue
        for inertia in other.inertias:
            index = [place[node] for node in inertia.nodes]
            J[np.ix_(index, index)] += inertia.matrix
        for row in other.compliances:
            stiffness[c], damping[c], loss[c] = row.stiffness, row.damping, row.stiffness * row.loss_factor
            for node, value in row.coefficients.items():
                E[c, place[node]] = value
            c += 1
        for constraint in other.constraints:
            for node, value in constraint.coefficients.items():
                A[a, place[node]] = value
            a += 1
    if kind is float:
        for law in locked:
            for node, value in law.coefficients.items():
                A[a, place[node]] = value
            a += 1
    return _Matrices(J, E, stiffness, damping, loss, A)
