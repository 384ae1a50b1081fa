"""Least squares with damped Gauss-Newton steps, what enters linearly eliminated (variable projection, Golub and Pereyra 1973).

The residuals are whitened run by run; what is left after the best combination of the columns is what counts, and the
derivative of that is the projected one (Kaufman, BIT 15 (1975) 49-57), which is exact where nothing is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from ..base.errors import PowertrainError
from .prediction import Prediction

# Columns that are combinations of others to this part are left out.
DEPENDENT = 1e-10
# A step of so small a part of the standard errors has arrived; without noise rounding ends it.
ARRIVED = 1e-3
MOST_STEPS = 100
WEAKEST, STRONGEST = 1e-12, 1e8

Whiten = Callable[[np.ndarray], np.ndarray]


class Point(NamedTuple):
    """Unknowns, and what is left of each run: whitened and projected residuals, shares of the columns, their space."""

    p: np.ndarray
    left: list[np.ndarray]
    shares: list[np.ndarray]
    spaces: list[np.ndarray]

    @property
    def cost(self) -> float:
        return float(sum(e @ e for e in self.left))


class Descent:
    """The problem of finding the unknowns p of `prediction` between bounds, by steps of at most ``longest`` each."""

    def __init__(
        self, predictions: Sequence[Prediction], whiten: Sequence[Whiten], low: np.ndarray, high: np.ndarray, longest: np.ndarray
    ):
        self.predictions, self.whiten = predictions, whiten
        self.low, self.high, self.longest = low, high, longest

    def at(self, p: np.ndarray) -> Point:
        left, shares, spaces = [], [], []
        for prediction, whiten in zip(self.predictions, self.whiten, strict=True):
            values, columns = prediction.modelled(p)
            residual = prediction.run.measured - values
            whitened = whiten(np.concatenate([residual[:, :, None], columns], axis=2))
            if not np.isfinite(whitened).all():
                raise PowertrainError("the model of the car grows beyond all bounds in this run; give bounds or another start")
            e, share, space = _projected(whitened[:, 0], whitened[:, 1:])
            left.append(e)
            shares.append(share)
            spaces.append(space)
        return Point(p, left, shares, spaces)

    def derivatives(self, point: Point) -> np.ndarray:
        """(samples, unknowns) ndarray: of the whitened model, what the columns can take up left out."""
        found = []
        for prediction, whiten, share, space in zip(self.predictions, self.whiten, point.shares, point.spaces, strict=True):
            J = whiten(prediction.sensitivities(point.p, share))
            found.append(J - space @ (space.T @ J))
        return np.concatenate(found)

    def settled(self, p: np.ndarray, arrived: float = ARRIVED) -> tuple[Point, np.ndarray]:
        """The point of least squares and the derivatives there, from p on."""
        point, damping = self.at(np.clip(p, self.low, self.high)), 1e-3
        for _ in range(MOST_STEPS):
            J, e = self.derivatives(point), np.concatenate(point.left)
            slope = J.T @ e
            # what would leave its bounds stays on them
            held = ((point.p <= self.low) & (slope <= 0.0)) | ((point.p >= self.high) & (slope >= 0.0))
            size = np.linalg.norm(J, axis=0)
            held |= size == 0.0
            scaled = J[:, ~held] / size[~held]
            normal = scaled.T @ scaled
            found = None
            while found is None and damping < STRONGEST:
                step = np.zeros(len(p))
                step[~held] = np.linalg.solve(normal + damping * np.eye(len(normal)), slope[~held] / size[~held]) / size[~held]
                step *= min(1.0, float((self.longest / np.maximum(np.abs(step), 1e-300)).min()))
                after = self._tried(np.clip(point.p + step, self.low, self.high))
                if after is not None and after.cost <= point.cost:
                    found = after
                else:
                    damping *= 10.0
            if found is None:
                break
            moved = J @ (found.p - point.p)
            small = moved @ moved <= arrived**2 * point.cost / max(len(e) - len(p), 1)
            # a fall that is no more than rounding is none
            done = small and found.cost >= 0.25 * point.cost
            point, damping = found, max(damping / 10.0, WEAKEST)
            if done:
                break
        return point, self.derivatives(point)

    def _tried(self, p: np.ndarray) -> Point | None:
        try:
            return self.at(p)
        except PowertrainError:
            return None


def _projected(e: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the columns leave of e, their shares, and an orthogonal basis of what they span."""
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    U, values, Vt = np.linalg.svd(columns / size, full_matrices=False)
    kept = values > DEPENDENT * values.max(initial=0.0)
    space = U[:, kept]
    along = space.T @ e
    share = (Vt[kept].T @ (along / values[kept])) / size
    return e - space @ along, share, space
