"""Which unknowns a run tells apart, and which it does not: named in words, with what would help."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

# Directions in which the outputs change by less than this part of the largest are none: the differences are off by 3e-8.
NOTHING = 1e-6
# Two parameters are not told apart that correlate by more than this while one of them is known to no better than that part.
ALIKE, VAGUE = 0.99, 0.05
# A parameter that is known to no better than this part of itself is not known.
UNKNOWN = 0.5
# An unknown that takes part in a direction by more than this share is named with it.
TAKES_PART = 0.2


class Analysis(NamedTuple):
    """Covariance of the unknowns (parameters as parts of themselves), correlation, groups not told apart, and not known."""

    covariance: np.ndarray
    correlation: np.ndarray
    groups: tuple[tuple[int, ...], ...]
    unknown: tuple[int, ...]

    @property
    def lost(self) -> set[int]:
        """Unknowns without a number."""
        return {*self.unknown, *(i for group in self.groups for i in group)}


def analysed(information: np.ndarray, parameters: int, named: int, held: Sequence[int] = ()) -> Analysis:
    """What the information (unknowns, unknowns) of whitened residuals tells of parameters and, behind them, delays.

    Only the first ``named`` unknowns are reported; those that are ``held`` are taken as known.
    """
    size = np.sqrt(np.diag(information))
    largest = size[:parameters].max(initial=0.0)
    dead = [i for i in range(len(size)) if i not in held and size[i] <= (NOTHING * largest if i < parameters else 0.0)]
    alive = [i for i in range(len(size)) if i not in dead and i not in held]
    scaled = information[np.ix_(alive, alive)] / np.outer(size[alive], size[alive])
    values, vectors = np.linalg.eigh(scaled)
    nothing = values <= NOTHING**2 * values.max(initial=1.0)
    inverse = (vectors[:, ~nothing] / values[~nothing]) @ vectors[:, ~nothing].T
    covariance = np.full(information.shape, np.nan)
    covariance[np.ix_(alive, alive)] = inverse / np.outer(size[alive], size[alive])
    deviation = np.sqrt(np.diag(covariance))
    correlation = covariance / np.outer(deviation, deviation)
    groups = []
    for v in vectors[:, nothing].T:
        taking_part = np.flatnonzero(np.abs(v) > TAKES_PART * np.abs(v).max())
        group = tuple(alive[i] for i in taking_part)
        # along a direction that nothing sees the correlation is whole
        correlation[np.ix_(group, group)] = np.outer(np.sign(v[taking_part]), np.sign(v[taking_part]))
        groups.append(tuple(i for i in group if i < named))
    for i in range(parameters):
        alike = np.flatnonzero((np.abs(correlation[i, :parameters]) > ALIKE) & (deviation[:parameters] > 0.0))
        together = tuple(int(j) for j in alike if j != i)
        if together and max(deviation[[i, *together]]) > VAGUE:
            groups.append(tuple(sorted((i, *together))))
    groups = _merged(groups)
    grouped = {i for group in groups for i in group}
    vague = [i for i in range(parameters) if i not in grouped and i not in held and not deviation[i] <= UNKNOWN]
    unknown = sorted(i for i in {*dead, *vague} if i < named)
    return Analysis(covariance[:named, :named], correlation[:named, :named], tuple(groups), tuple(unknown))


def _merged(groups: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    merged: list[set[int]] = []
    for group in groups:
        apart = [other for other in merged if not other & set(group)]
        merged = [*apart, set(group).union(*(other for other in merged if other & set(group)))]
    return [tuple(sorted(group)) for group in merged]


def in_words(analysis: Analysis, names: Sequence[str], help_by: dict[tuple[int, ...], str]) -> tuple[str, ...]:
    """One sentence for each group and for each unknown that is not known."""
    said = []
    for group in analysis.groups:
        listed = (
            " and ".join([", ".join(names[i] for i in group[:-1]), names[group[-1]]])
            if len(group) > 1
            else names[group[0]]
        )
        strongest = max((analysis.correlation[i, j] for i in group for j in group if i < j), key=abs, default=1.0)
        remedy = help_by.get(group, "hold one of them, or take a run that moves them differently")
        said.append(f"{listed}: correlation {strongest:.2f}, not told apart by what was measured; {remedy}")
    for i in analysis.unknown:
        deviation = np.sqrt(analysis.covariance[i, i])
        how = (
            f"standard error {100 * deviation:.0f} % of its value"
            if np.isfinite(deviation)
            else "nothing measured depends on it"
        )
        remedy = help_by.get((i,), "hold it")
        said.append(f"{names[i]}: not determined by what was measured, {how}; {remedy}")
    return tuple(said)
