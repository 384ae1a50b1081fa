"""Frequencies of chains of bodies, by quotients and differences of all variants at once.

The stiffness factor of a chain is bidiagonal, and the squares q and e of its entries are products and quotients of the
values. The differential quotient-difference algorithm (K. V. Fernando, B. N. Parlett, Numerische Mathematik 67 (1994) 191)
takes the smallest eigenvalue off them without a subtraction that loses digits. Each shift is the bound ``1 / trace(T^-1)``,
which is below that eigenvalue and nears it quadratically; each variant takes as many as it needs.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .structure import Stack

# Shifts for an eigenvalue, at least and at most, and the share of it that may be left beside it then; where more is left the
# variant is computed otherwise.
FEWEST, MOST, LEFT = 3, 40, 1e-16
# Springs up to which this is faster than singular values of each variant by itself.
LONGEST = 10
# Shifts stay this part below the bound, which rounding can lift.
BELOW = 1.0 - 1e-14


class Chain(NamedTuple):
    """Springs of a stack from one end of a chain to the other, and the coordinates that they link, one more."""

    springs: list[int]
    coordinates: list[str]


def chain_of(stack: Stack) -> Chain | None:
    """The chain that the springs of a stack are, free at both ends; None for anything else."""
    links = {c: list(stack.twists[c]) for c in stack.elastic}
    if not (stack.is_diagonal and 0 < len(links) <= LONGEST and len(links) == len(stack.coordinates) - 1):
        return None
    if any(len(ends) != 2 for ends in links.values()):
        return None
    near: dict[str, list[int]] = {name: [] for name in stack.coordinates}
    for c, ends in links.items():
        for name in ends:
            near[name].append(c)
    ends = [name for name, springs in near.items() if len(springs) == 1]
    if len(ends) != 2 or any(len(springs) > 2 for springs in near.values()):
        return None
    order, springs = [ends[0]], list[int]()
    while len(order) <= len(links):
        ahead = [c for c in near[order[-1]] if c not in springs[-1:]]
        if not ahead:
            return None  # a ring besides
        springs.append(ahead[0])
        order.append(next(name for name in links[ahead[0]] if name != order[-1]))
    return Chain(springs, order)


def chain_frequencies(stack: Stack, chain: Chain) -> tuple[np.ndarray, np.ndarray]:
    """omega (n, modes), ascending, and which of the variants are accurate."""
    q, e = list[np.ndarray](), list[np.ndarray]()
    for c, a, b in zip(chain.springs, chain.coordinates, chain.coordinates[1:], strict=False):
        for name, squares in ((a, q), (b, e)):
            j = stack.place[name]
            value = stack.compliances[c].stiffness * stack.twists[c][name] ** 2 / stack.mass[j, j]
            squares.append(np.array(stack.column(value)))
    found, is_sure = eigenvalues(q, e)
    omega = np.zeros((stack.count, len(found) + 1))
    np.sqrt(np.sort(np.array(found), axis=0).T, out=omega[:, 1:])
    return omega, is_sure


def eigenvalues(q: list[np.ndarray], e: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
    """Squares of the singular values, in any order, of bidiagonal matrices with rows (sqrt(q_i), sqrt(e_i)), one longer.

    Parameters
    ----------
    q, e : list of (n,) ndarray
        Positive.

    Returns
    -------
    values : list of (n,) ndarray
    is_sure : (n,) ndarray of bool

    Examples
    --------
    Three equal bodies have 1 and 3 times k / J:

    >>> one = np.ones(1)
    >>> [float(value[0].round(15)) for value in eigenvalues([one, one], [one, one])[0]]
    [1.0, 3.0]
    """
    q, e = _square(q, e)
    shifted = np.zeros_like(q[0])
    is_sure = np.ones(len(shifted), dtype=bool)
    values: list[np.ndarray] = []
    with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
        while len(q) > 1:
            is_sure &= _without_smallest(q, e, shifted)
            values.append(shifted + q.pop())
            e.pop()
        values.append(shifted + q[0])
    return values, is_sure


def _without_smallest(q: list[np.ndarray], e: list[np.ndarray], shifted: np.ndarray) -> np.ndarray:
    """Shift, in place, until the smallest eigenvalue stands alone in the last row; which have come so far."""
    for _ in range(FEWEST):
        shifted += _shift(q, e)
    for _ in range(FEWEST, MOST):
        others = np.flatnonzero(~_stands_alone(q, e, shifted))
        if not others.size:
            return np.ones(len(shifted), dtype=bool)
        if others.size == len(shifted):
            shifted += _shift(q, e)
            continue
        some_q, some_e = [each[others] for each in q], [each[others] for each in e]
        shifted[others] += _shift(some_q, some_e)
        for whole, part in zip([*q, *e], [*some_q, *some_e], strict=True):
            whole[others] = part
    return _stands_alone(q, e, shifted)


def _stands_alone(q: list[np.ndarray], e: list[np.ndarray], shifted: np.ndarray) -> np.ndarray:
    return e[-1] <= LEFT * (shifted + q[-1])


def _square(q: list[np.ndarray], e: list[np.ndarray]) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """The same eigenvalues but 0, of square matrices."""
    new_q, new_e = [], []
    d = q[0]
    for i in range(len(q) - 1):
        new_q.append(d + e[i])
        t = q[i + 1] / new_q[i]
        new_e.append(e[i] * t)
        d = d * t
    return [*new_q, d + e[-1]], new_e


def _shift(q: list[np.ndarray], e: list[np.ndarray]) -> np.ndarray:
    """Eigenvalues smaller by the shift that is returned, one over the trace of the inverse, in place."""
    d = q[0]
    trace = 1.0 / d
    for next_q, each_e in zip(q[1:], e, strict=True):
        d = d * (next_q / (d + each_e))
        trace += 1.0 / d
    shift = BELOW / trace
    d = q[0] - shift
    for i in range(len(e)):
        q[i] = d + e[i]
        t = q[i + 1] / q[i]
        e[i] = e[i] * t
        d = d * t - shift
    # where the last eigenvalue is gone rounding decides the sign of what is left
    q[-1] = np.maximum(d, 0.0)
    return shift
