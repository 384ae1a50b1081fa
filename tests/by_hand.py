"""Matrices of a driveline by another road: dense, from the values of its elements, constraints by an orthonormal basis."""

from typing import NamedTuple

import numpy as np
import scipy.linalg

import powertrain_ctrl as pt


class Matrices(NamedTuple):
    """``M q'' + D q' + K q = Z^T load``, node motion Z q; twist of each compliance W q."""

    M: np.ndarray
    D: np.ndarray
    K: np.ndarray
    Z: np.ndarray
    W: np.ndarray
    stiffness: np.ndarray
    nodes: list[str]

    def row(self, node):
        return self.Z[self.nodes.index(node)]

    def speed_over_torque(self, s, torque_at, speed_of):
        motion = np.linalg.solve(self.K + s * self.D + s**2 * self.M, self.row(torque_at).astype(complex))
        return s * self.row(speed_of) @ motion


def matrices(car):
    """Of a driveline of bodies, springs, tyres, dampers, gears, planetary sets, clutches and laws, which are left out."""
    nodes = sorted({node for element in car for node in element.nodes})
    unit = dict(zip(nodes, np.eye(len(nodes)), strict=True))
    J, zero, twists = np.zeros(len(nodes)), [np.zeros(len(nodes))], []
    for element in car:
        match element:
            case pt.Inertia(name, J=inertia):
                J[nodes.index(name)] += inertia
            case pt.Mass(name, m=mass):
                J[nodes.index(name)] += mass
            case pt.Tyre(_, wheel, body, radius=r, stiffness=k, damping=d):
                twists.append((unit[wheel] - unit[body] / r, k * r**2, d * r**2))
            case pt.SpringDamper(_, a, b, stiffness=k, damping=d):
                twists.append((unit[a] - unit[b], k, d))
            case pt.Drag(_, node, stiffness=k, damping=d):
                twists.append((unit[node], k, d))
            case pt.Gear(_, a, b, ratio=ratio):
                zero.append(unit[a] - ratio * unit[b])
            case pt.Planetary(_, sun, ring, carrier, ratio=ratio):
                zero.append(unit[sun] + ratio * unit[ring] - (1.0 + ratio) * unit[carrier])
            case pt.Clutch(name, a, b):
                if name not in car.released:
                    zero.append(unit[a] - unit[b])
            case pt.OneWayClutch() | pt.Backlash():
                pass  # laws, not matrices
            case _:
                raise NotImplementedError(element)
    Z = scipy.linalg.null_space(np.array(zero))
    W = np.array([row for row, _, _ in twists]).reshape(len(twists), len(nodes)) @ Z
    W[np.abs(W) < 1e-13] = 0.0  # a spring across rigid parts: rounding, not a twist
    k, d = np.array([k for _, k, _ in twists]), np.array([d for _, _, d in twists])
    return Matrices(Z.T @ (J[:, None] * Z), (W.T * d) @ W, (W.T * k) @ W, Z, W, k, nodes)
