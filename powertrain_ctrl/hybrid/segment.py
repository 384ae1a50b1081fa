"""A piece of time in which inputs and capacities are polynomials."""

from typing import NamedTuple

import numpy as np

from .flow import value_at
from .signals import shift


class Segment(NamedTuple):
    """Inputs and capacities of the clutches as polynomials (signals, degree + 1) in local time.

    ``levels`` are the capacities at which clutches are taken whose friction depends on slip, in that dependence alone.
    Behind the inputs are the accelerations of nodes that are moved; ``imposed`` are their speeds at the start of a piece.
    ``coupled`` are torques of laws that depend on the slips of several, of as many coefficients.
    """

    inputs: np.ndarray
    capacities: np.ndarray
    levels: tuple[float, ...] = ()
    imposed: np.ndarray | None = None
    coupled: np.ndarray | None = None

    @property
    def free(self) -> np.ndarray:
        """Which clutches have no capacity at all."""
        return np.logical_not(self.capacities.any(axis=1))

    def values(self, t: np.ndarray) -> np.ndarray:
        """(inputs and capacities, samples) ndarray at local times."""
        return value_at(np.vstack([self.inputs, self.capacities]), t)

    def later(self, by: float) -> "Segment":
        if not by:
            return self
        coupled = None if self.coupled is None else shift(self.coupled, by)
        return Segment(shift(self.inputs, by), shift(self.capacities, by), self.levels, None, coupled)

    def with_coupled(self, coupled: np.ndarray) -> "Segment":
        """The same with these torques (laws, degree + 1)."""
        width = max(coupled.shape[1], self.inputs.shape[1])
        inputs, capacities, coupled = (_widened(part, width) for part in (self.inputs, self.capacities, coupled))
        return self._replace(inputs=inputs, capacities=capacities, coupled=coupled)


def _widened(polynomials: np.ndarray, width: int) -> np.ndarray:
    """The same polynomials with so many coefficients."""
    wide = np.zeros((len(polynomials), width))
    wide[:, : polynomials.shape[1]] = polynomials
    return wide
