"""Least squares with damped Gauss-Newton steps; what enters linearly is eliminated (variable projection).

The residuals are whitened run by run; what is left after the best combination of the columns is what counts, and the
derivative of that is the projected one (Golub, Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432; Kaufman, BIT 15 (1975)
49-57), which is exact where nothing is left.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from .prediction import Prediction

# Columns that are combinations of others to this part are left out.
DEPENDENT = 1e-13
# A step of so small a part of the standard errors has arrived; without noise rounding ends it.
ARRIVED = 1e-3
# By so much what is left may grow at the end, where it is the same but for rounding.
ROUNDING = 1e-9
# After a step of less than this part of them the derivatives are still the same.
NEAR = 0.1
MOST_STEPS, REFUSED = 100, 3
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
        self,
        predictions: Sequence[Prediction],
        whiten: Sequence[Whiten],
        low: np.ndarray,
        high: np.ndarray,
        longest: np.ndarray,
    ):
        self.predictions, self.whiten = predictions, whiten
        self.low, self.high, self.longest = low, high, longest

    def at(self, p: np.ndarray) -> Point:
        left, shares, spaces = [], [], []
        for prediction, whiten in zip(self.predictions, self.whiten, strict=True):
            values, columns = prediction.modelled(p)
            residual = prediction.run.measured - values
            whitened = whiten(np.concatenate([residual[:, :, None], columns], axis=2))
            e, share, space = _projected(whitened[:, 0], whitened[:, 1:], prediction.known)
            left.append(e)
            shares.append(share)
            spaces.append(space)
        return Point(p, left, shares, spaces)

    def derivatives(self, point: Point) -> np.ndarray:
        """(samples, unknowns) ndarray: of the whitened model, what the columns can take up left out."""
        found = []
        for prediction, whiten, share, space in zip(
            self.predictions, self.whiten, point.shares, point.spaces, strict=True
        ):
            J = whiten(prediction.sensitivities(point.p, share))
            J = np.concatenate([J, np.zeros((len(space) - len(J), J.shape[1]))])
            found.append(J - space @ (space.T @ J))
        return np.concatenate(found)

    def settled(self, p: np.ndarray, arrived: float = ARRIVED) -> tuple[Point, np.ndarray]:
        """The point of least squares and the derivatives there, from p on."""
        point, damping = self.at(np.clip(p, self.low, self.high)), 1e-3
        J, refused = self.derivatives(point), 0
        for _ in range(MOST_STEPS):
            if damping > STRONGEST or refused >= REFUSED:
                break
            found = self._after(point, J, damping)
            # in standard errors of what is left
            moved = np.linalg.norm(J @ (found.p - point.p)) / np.sqrt(point.cost / max(len(J) - len(p), 1) or 1.0)
            if not found.cost <= point.cost * (1.0 + (ROUNDING if moved <= arrived else 0.0)):
                damping *= 10.0
                # steps of less than what noise or rounding moves it by, and no less is left: here it is
                refused += moved < 1.0
                continue
            # without noise there is less and less left, down to rounding
            done = moved <= arrived and found.cost >= 0.25 * point.cost
            point, damping, refused = found, max(damping / 10.0, WEAKEST), 0
            if moved > NEAR:
                J = self.derivatives(point)
            if done:
                break
        return point, J

    def _after(self, point: Point, J: np.ndarray, damping: float) -> Point:
        """Where a damped step leads to."""
        slope, size = J.T @ np.concatenate(point.left), np.linalg.norm(J, axis=0)
        # what would leave its bounds stays on them
        held = ((point.p <= self.low) & (slope <= 0.0)) | ((point.p >= self.high) & (slope >= 0.0)) | (size == 0.0)
        scaled = J[:, ~held] / size[~held]
        step = np.zeros(len(point.p))
        normal = scaled.T @ scaled + damping * np.eye(scaled.shape[1])
        step[~held] = np.linalg.solve(normal, slope[~held] / size[~held]) / size[~held]
        step *= min(1.0, float((self.longest / np.maximum(np.abs(step), 1e-300)).min()))
        return self.at(np.clip(point.p + step, self.low, self.high))


def _projected(e: np.ndarray, columns: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What the columns leave of e, their shares, and an orthogonal basis of what they span.

    That shares are known to be about 0 are measurements too, in rows below the others.
    """
    e = np.concatenate([e, np.zeros(np.count_nonzero(known))])
    columns = np.concatenate([columns, np.diag(known)[known > 0.0]])
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    U, values, Vt = np.linalg.svd(columns / size, full_matrices=False)
    kept = values > DEPENDENT * values.max(initial=0.0)
    space = U[:, kept]
    along = space.T @ e
    share = (Vt[kept].T @ (along / values[kept])) / size
    return e - space @ along, share, space
