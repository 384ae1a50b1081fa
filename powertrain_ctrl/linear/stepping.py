"""Exact steps of many linear systems at once."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

# The series of the exponential is taken of a matrix of at most this norm, in so many terms: the next one is 2e-18.
NORM, TERMS = 0.25, 12
# Steps that differ by less than this share are the same.
SAME_STEP = 1e-9


def exponential(A: np.ndarray) -> np.ndarray:
    """``exp(A)`` of (n, N, N) matrices, each scaled by a power of two and squared as often as it needs."""
    size = np.abs(A).sum(axis=2).max(axis=1, initial=0.0)
    power = np.maximum(np.frexp(size / NORM)[1], 0)
    A = np.ldexp(A, -power[:, None, None])
    one = np.eye(A.shape[1])
    E = one + A / TERMS
    for k in range(TERMS - 1, 0, -1):
        E = one + (A @ E) / k
    for k in range(int(power.max(initial=0))):
        further = power > k
        if further.all():
            E = E @ E
        else:
            E[further] = E[further] @ E[further]
    return E


def evenly_stepped(step: np.ndarray, start: np.ndarray, count: int) -> np.ndarray:
    """(n, N, count) states of ``x' = step x`` from the start (n, N) on, by doubling."""
    states = np.empty((*start.shape, count))
    states[:, :, 0] = start
    power, done = step, 1
    while done < count:
        more = min(done, count - done)
        states[:, :, done : done + more] = power @ states[:, :, :more]
        done += more
        if done < count:
            power = power @ power
    return states


def forced(
    A: np.ndarray, b: np.ndarray, start: np.ndarray, edges: np.ndarray, lines: np.ndarray, times: np.ndarray
) -> np.ndarray:
    """(n, N + 2, times) states of ``x' = A x + b u``, and u and its slope, under an input that is linear piece by piece.

    Parameters
    ----------
    A, b, start : (n, N, N), (n, N), (n, N) ndarray
    edges, lines : (pieces + 1,), (pieces, 2) ndarray
        [s], from the first to the last of the times; value at the beginning and slope of each piece.
    times : (T,) ndarray
        [s], increasing.
    """
    n, N = b.shape
    W = np.zeros((n, N + 2, N + 2))
    W[:, :N, :N], W[:, :N, N] = A, b
    W[:, N, N + 1] = 1.0
    known: dict[float, np.ndarray] = {}

    def over(h: float) -> np.ndarray:
        if h not in known:
            known[h] = exponential(W * h)
        return known[h]

    instant = SAME_STEP * float(np.diff(times).min(initial=np.inf))
    states = np.empty((n, N + 2, len(times)))
    now = np.zeros((n, N + 2))
    now[:, :N] = start
    for (begin, end), (value, slope) in zip(pairwise(edges), lines, strict=True):
        now[:, N], now[:, N + 1] = value, slope
        first, last = np.searchsorted(times, (begin - instant, end - instant), side="left")
        inside = times[first:last]
        at = begin
        if len(inside):
            if inside[0] > at + instant:
                now = (over(float(inside[0] - at)) @ now[..., None])[..., 0]
            steps = np.diff(inside)
            h = float(steps.mean()) if len(steps) else 0.0
            if (np.abs(steps - h) <= SAME_STEP * h).all():
                part = evenly_stepped(over(h) if len(steps) else W, now, len(inside))
                states[:, :, first:last], now = part, part[:, :, -1]
            else:
                states[:, :, first] = now
                for i, step in enumerate(steps, start=first + 1):
                    now = (over(float(step)) @ now[..., None])[..., 0]
                    states[:, :, i] = now
            at = float(inside[-1])
        if end > at + instant:
            now = (over(float(end - at)) @ now[..., None])[..., 0]
    states[:, :, -1] = now
    return states


def pulsed(
    A: np.ndarray, g: np.ndarray, peaks: np.ndarray, start: float, duration: float, times: np.ndarray
) -> np.ndarray:
    """(n, N + 2, times) states of ``x' = A x + g f``, f and its quarter period ahead, f one half-sine; evenly spaced times.

    Of its own peak (n,) for each."""
    n, N = g.shape
    omega = np.pi / duration
    W = np.zeros((n, N + 2, N + 2))
    W[:, :N, :N] = A
    free = W.copy()
    W[:, :N, N] = g
    W[:, N, N + 1], W[:, N + 1, N] = omega, -omega
    h = float(times[1] - times[0])
    states = np.zeros((n, N + 2, len(times)))
    first, last = np.searchsorted(times, (start - SAME_STEP * h, start + duration - SAME_STEP * h), side="left")
    if first == len(times):
        return states
    begun = np.zeros((n, N + 2))
    begun[:, N + 1] = peaks
    if last > first:
        late = max(float(times[first] - start), 0.0)
        now = begun if late <= SAME_STEP * h else (exponential(W * late) @ begun[..., None])[..., 0]
        states[:, :, first:last] = evenly_stepped(exponential(W * h), now, last - first)
    if last < len(times):
        end = (exponential(W * duration) @ begun[..., None])[..., 0]
        end[:, N:] = 0.0
        late = max(float(times[last] - start - duration), 0.0)
        now = end if late <= SAME_STEP * h else (exponential(free * late) @ end[..., None])[..., 0]
        states[:, :, last:] = evenly_stepped(exponential(free * h), now, len(times) - last)
    return states
