"""Sampled loops on many plants as long as no limit acts: linear systems, many samples by one product."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ..sampled.fold import Fold

# Values of a demand that are on a straight line to this part of the largest are on it.
STRAIGHT = 1e-12
# Outputs of 2**BLOCK samples are one product; states go on by at most 2**LONGEST such blocks at once.
BLOCK, LONGEST = 4, 2


class Piece(NamedTuple):
    """So many samples of a demand on a straight line, its first value and its change from sample to sample."""

    samples: int
    value: float
    slope: float


def pieces_of(wanted: np.ndarray) -> list[Piece]:
    """The straight pieces of a demand.

    Examples
    --------
    >>> for piece in pieces_of(np.array([0.0, 0.0, 1.0, 2.0, 2.0, 2.0])):
    ...     print(*piece)
    1 0.0 0.0
    2 0.0 1.0
    3 2.0 0.0
    """
    bends = np.abs(np.diff(wanted, 2)) > STRAIGHT * np.abs(wanted).max(initial=0.0)
    edges = np.unique([0, *(np.flatnonzero(bends) + 1), len(wanted) - 1]).tolist()
    pieces = [Piece(b - a, float(wanted[a]), float(wanted[b] - wanted[a]) / (b - a)) for a, b in pairwise(edges)]
    # the last sample is on the last of them
    *before, last = pieces or [Piece(0, float(wanted[0]), 0.0)]
    return [*before, last._replace(samples=last.samples + 1)]


class Unlimited:
    """Loops of a fold: ``z P`` is the next of states (n, R).

    They are those of plant and controller, as many commands as are under way, the last one first, demand and its slope, and
    the ratio.
    """

    def __init__(self, fold: Fold, whole: np.ndarray):
        """Of loops whose commands arrive so many samples later (n,), rests of a sample besides."""
        n, own, count = fold.n, fold.own, len(fold.M)
        self.whole, self.held, self.reads_ratio = whole, int(whole.max()) + 1, fold.reads_ratio
        self.n, self.last = n, n + own
        self.wanted, self.slope, self.ratio = (self.last + self.held + i for i in range(3))
        first, wanted, slope, ratio = self.last, self.wanted, self.slope, self.ratio
        N = np.zeros((count, ratio + 1, ratio + 1))
        read = [*range(n + own), first, wanted, ratio]
        own_rows = [*range(n, n + own), first]
        N[:, np.array(own_rows)[:, None], read] = fold.M[:, n:][
            :, :, [*range(n + own), fold.limited, fold.demand, fold.ratio]
        ]
        self.asked = np.ascontiguousarray(N[:, first, :, None])
        N[:, :n, :n] = fold.M[:, :n, :n]
        acting = np.swapaxes(fold.M[:, :n, [fold.new, fold.old]], 1, 2)
        N[:, :n] += np.swapaxes(self._through(acting), 1, 2)
        for i in range(1, self.held):
            N[:, first + i, first + i - 1] = 1.0
        N[:, wanted, [wanted, slope]] = N[:, slope, slope, None] = N[:, ratio, ratio, None] = 1.0
        self.powers = [np.ascontiguousarray(np.swapaxes(N, 1, 2))]

    def seen(self, on_states: np.ndarray, on_acting: np.ndarray) -> np.ndarray:
        """(n, R, q) ndarray: what reads the plant's states (n, states, q) and what acts (n, 2, q)."""
        seen = self._through(on_acting)
        seen[:, : self.n] += on_states
        return seen

    def _through(self, acting: np.ndarray) -> np.ndarray:
        """(n, R, q) ndarray: what reads what acts, the command that arrives in a sample and the one before (n, 2, q)."""
        seen = np.zeros((len(acting), self.ratio + 1, acting.shape[2]))
        for whole in np.unique(self.whole):
            chosen = np.flatnonzero(self.whole == whole)
            if whole:
                seen[chosen, self.last + whole - 1] = acting[chosen, 0]
            else:  # the command of this sample acts at once
                seen[chosen] = self.asked[chosen] * acting[chosen, :1]
            seen[chosen, self.last + whole] += acting[chosen, 1]
        return seen

    def start(self, ratio: np.ndarray) -> np.ndarray:
        """(n, R) states at rest."""
        z = np.zeros((len(ratio), self.ratio + 1))
        z[:, self.ratio] = ratio
        return z

    def outputs(
        self, z: np.ndarray, pieces: Sequence[Piece], seen: Sequence[np.ndarray], into: Sequence[np.ndarray]
    ) -> None:
        """What is seen (n, R, q) of the states in each sample, from the states z on, into arrays (n, samples q) of zeros."""
        in_blocks = [self._in_block(each) for each in seen]
        z, done = z.copy(), 0
        for samples, value, slope in pieces:
            z[:, self.wanted], z[:, self.slope] = value, slope
            # where nothing is asked for, nothing moves
            if value or slope or self.reads_ratio or z[:, : self.wanted].any():
                blocks, rest = samples >> BLOCK, samples % 2**BLOCK
                states = self._every_block(z, blocks + 1)
                for out, each, block in zip(into, seen, in_blocks, strict=True):
                    q, width = each.shape[2], block.shape[2]
                    behind = done * q + blocks * width
                    whole = out[:, done * q : behind].reshape(len(z), blocks, width)
                    np.matmul(states[:, :blocks], block, out=whole)
                    out[:, behind : behind + rest * q] = (states[:, blocks:] @ block[:, :, : rest * q])[:, 0]
                z = self._advanced(states[:, blocks], rest)
            done += samples

    def _power(self, exponent: int) -> np.ndarray:
        """P to the power of two to this."""
        while len(self.powers) <= exponent:
            self.powers.append(self.powers[-1] @ self.powers[-1])
        return self.powers[exponent]

    def _in_block(self, seen: np.ndarray) -> np.ndarray:
        """(n, R, 2**BLOCK q) ndarray: what is seen in a block of samples."""
        n, R, q = seen.shape
        block = np.empty((n, R, q << BLOCK))
        block[:, :, :q] = seen
        for i in range(BLOCK):
            np.matmul(self._power(i), block[:, :, : q << i], out=block[:, :, q << i : q << (i + 1)])
        return block

    def _every_block(self, z: np.ndarray, count: int) -> np.ndarray:
        """(n, count, R) states at the beginning of blocks."""
        states = np.empty((len(z), count, z.shape[1]))
        states[:, 0] = z
        done, more = 1, 0
        while done < count:
            here = min(1 << more, count - done)
            behind = done - (1 << more)
            np.matmul(states[:, behind : behind + here], self._power(BLOCK + more), out=states[:, done : done + here])
            done += here
            if more < LONGEST and done >= 2 << more:
                more += 1
        return states

    def _advanced(self, z: np.ndarray, samples: int) -> np.ndarray:
        """States so many samples, less than a block, later."""
        for i in range(BLOCK):
            if samples >> i & 1:
                z = (z[:, None] @ self._power(i))[:, 0]
        return z
