"""Sums of orders over the crank angle."""

from __future__ import annotations

import numpy as np

# Samples in the shortest oscillation, and steps of Newton's method from them to each crest.
FINE, STEPS = 16, 4
# A crest may be higher than its sample by this part of the sum of the amplitudes: half the square of the angle to it.
MISSED = 0.5 * (np.pi / FINE) ** 2


def extremes(amplitudes: np.ndarray, orders: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Largest and smallest value (...,) of ``sum Re(amplitude exp(j order phi))`` over all angles.

    Parameters
    ----------
    amplitudes : (n, ...) ndarray of complex
    orders : (n,) ndarray
        Multiples of one half.

    Examples
    --------
    >>> highest, lowest = extremes(np.array([[1.0], [-0.25j]]), np.array([1.0, 2.0]))
    >>> highest.round(9), lowest.round(9)
    (array([1.10091737]), array([-1.10091737]))
    """
    shape = amplitudes.shape[1:]
    flat = amplitudes.reshape(len(orders), -1)
    return _highest(flat, orders).reshape(shape), -_highest(-flat, orders).reshape(shape)


def _highest(amplitudes: np.ndarray, orders: np.ndarray) -> np.ndarray:
    multiples = np.rint(2.0 * orders).astype(int)
    unit = int(np.gcd.reduce(multiples))
    k = multiples // unit
    count = FINE * int(k.max())
    spectrum = np.zeros((amplitudes.shape[1], count // 2 + 1), dtype=complex)
    spectrum[:, k] = amplitudes.T
    samples = np.fft.irfft(spectrum, count, axis=1) * (0.5 * count)
    size = np.abs(amplitudes).sum(axis=0)
    highest = samples.max(axis=1)
    is_crest = (samples >= np.roll(samples, 1, axis=1)) & (samples >= np.roll(samples, -1, axis=1))
    is_crest &= samples >= (highest - MISSED * size)[:, None]
    row, place = np.nonzero(is_crest)
    angle, own = place * (2.0 * np.pi / count), amplitudes[:, row]
    for _ in range(STEPS):
        wave = own * np.exp(1j * np.multiply.outer(k, angle))
        slope, bend = -(k @ wave.imag), -((k * k) @ wave.real)
        step = np.where(bend < 0.0, -slope / np.where(bend < 0.0, bend, -1.0), 0.0)
        angle = angle + np.clip(step, -2.0 * np.pi / count, 2.0 * np.pi / count)
    refined = (own * np.exp(1j * np.multiply.outer(k, angle))).real.sum(axis=0)
    np.maximum.at(highest, row, refined)
    return highest
