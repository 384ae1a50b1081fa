"""Band-pass without phase of many signals at once."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np

# Samples that are filtered by one product; longer blocks cost more of it, shorter ones more steps from block to block.
BLOCK = 32


class _Kernel(NamedTuple):
    """Weights ``g[m] = 2 Re sum(weight pole^(|m| - 1))`` of the samples m before and behind, in blocks.

    Columns are real and imaginary parts: ``here`` (BLOCK + 2 states, BLOCK) gives the output from samples and states of a
    block, ``there`` (BLOCK, 2 states) what its samples add to the states of its neighbours, ``fading`` what is left of
    these states behind a block, ``still`` the states under a constant 1.
    """

    here: np.ndarray
    there: np.ndarray
    fading: np.ndarray
    still: np.ndarray


def band_passed(signals: np.ndarray, dt: float, order: int, band: tuple[float, float]) -> np.ndarray:
    """Signals through a Butterworth band-pass run forward and backward, continued by their end values for ever.

    Forward and backward together the filter weights samples symmetrically, and the partial fractions of its transfer
    function ``H(z) H(1/z)`` split it into a causal filter and the same one in reverse. Both are stepped block by block.

    Parameters
    ----------
    signals : (n, N) ndarray
    dt : float
        Spacing of the samples [s].
    order : int
        Of the low-pass that the band-pass is made of.
    band : (float, float)
        [Hz].

    Returns
    -------
    (n, N) ndarray
        Each row does not depend on the others.

    Examples
    --------
    What does not change is not felt, a sine in the middle of the band is:

    >>> t = np.arange(0.0, 20.0, 0.001)
    >>> both = np.stack([np.full_like(t, 5.0), np.sin(2.0 * np.pi * 10.0**0.5 * t)])
    >>> np.abs(band_passed(both, 0.001, 2, (1.0, 10.0)))[:, 5000:15000].max(axis=1).round(2)
    array([0., 1.])
    """
    kernel = _kernel(dt, order, band)
    n, N = signals.shape
    count = -(-N // BLOCK)
    extended = np.empty((n, count * BLOCK))
    extended[:, :N], extended[:, N:] = signals, signals[:, -1:]
    blocks = extended.reshape(n, count, BLOCK)
    states = len(kernel.fading)
    both = np.empty((n, count, 2, states), dtype=complex)
    added = (blocks @ kernel.there).view(complex).reshape(n, count, 2, states)
    # the one before the block goes forward, the one behind it backward
    steps = np.ascontiguousarray(np.stack([added[:, :, 0], added[:, ::-1, 1]], axis=2).swapaxes(0, 1))
    reached = np.empty((count, n, 2, states), dtype=complex)
    reached[0] = signals[:, [0, -1], None] * kernel.still
    fading = np.broadcast_to(kernel.fading, reached[0].shape).copy()  # as products of equal shape are far faster
    for before, now, added in zip(reached, reached[1:], steps, strict=False):
        np.multiply(fading, before, out=now)
        now += added
    both[:, :, 0], both[:, ::-1, 1] = reached[:, :, 0].swapaxes(0, 1), reached[:, :, 1].swapaxes(0, 1)
    inside = np.concatenate([blocks, both.view(float).reshape(n, count, -1)], axis=2)
    return (inside @ kernel.here).reshape(n, -1)[:, :N]


@lru_cache(maxsize=8)
def _kernel(dt: float, order: int, band: tuple[float, float]) -> _Kernel:
    import scipy.signal

    zeros, poles, gain = scipy.signal.butter(order, band, btype="bandpass", fs=1.0 / dt, output="zpk")

    def at(z: complex, without: complex | None = None) -> complex:
        others = np.array([pole for pole in poles if pole != without])
        return gain * np.prod(z - zeros) / np.prod(z - others)

    upper = poles[poles.imag > 0.0]
    weight = np.array([at(pole, without=pole) * at(1.0 / pole) for pole in upper])
    k = np.arange(BLOCK)
    powers = upper[:, None] ** k
    g = 2.0 * (weight[:, None] * powers).sum(axis=0).real
    # a constant is not felt: the weights add up to 0
    still = 1.0 / (1.0 - upper)
    centre = -4.0 * (weight * still).sum().real
    lags = np.abs(k[:, None] - k)
    here = np.where(lags == 0, centre, g[np.maximum(lags - 1, 0)])
    out = 2.0 * weight[:, None] * powers
    # state z = x + j y adds Re(out z); one view of complex numbers is x, y, x, y, ...
    from_states = np.stack([out.real, -out.imag], axis=1).reshape(-1, BLOCK)
    into = powers[:, ::-1].T
    return _Kernel(
        here=np.vstack([here, from_states, from_states[:, ::-1]]),
        there=np.ascontiguousarray(np.stack([into, into[::-1]], axis=1)).view(float).reshape(BLOCK, -1),
        fading=upper**BLOCK,
        still=still,
    )
