"""Many candidates of a feedback on several plants at once, judged by the frequency response of their loops."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..linear.assembly import kept
from ..linear.schur import plane_response
from ..sampled.margins import NO_FEEDBACK
from ..sampled.plant import SampledPlant

# Frequencies over the Nyquist frequency, and around each resonance in widths of it.
COARSE = np.unique(np.concatenate([np.geomspace(1e-3, 1.0, 100), np.linspace(0.0, 1.0, 101)[1:]]))
AROUND = np.array([-5.0, -3.0, -2.0, -1.4, -1.0, -0.7, -0.45, -0.2, 0.0, 0.2, 0.45, 0.7, 1.0, 1.4, 2.0, 3.0, 5.0])
# A loop keeps this distance from -1, or it counts as unstable: up to there the steps of its phase are sure to be small.
TOO_NEAR = 0.05


class View(NamedTuple):
    """A plant as a feedback on its speed difference sees it.

    ``omega`` (N,) [rad/s]; ``twisting`` (N,) complex, the speed difference [rad/s] per command [N m]; ``ringing`` (N,), the
    share of each frequency in the square of the speed difference after a push at the vehicle, in sum 1.
    """

    omega: np.ndarray
    twisting: np.ndarray
    ringing: np.ndarray


@kept(64)
def view_of(plant: SampledPlant, ratio: float, push: float) -> View:
    """The plant with speeds whose difference is formed with this ratio, pushed by a half-sine of this length [s]."""
    G, P = plant.discrete(), plant.continuous
    poles = P.poles()
    upper = poles[poles.imag > 0.0]
    nyquist = np.pi / plant.dt
    around = (upper.imag[:, None] + np.abs(upper.real)[:, None] * AROUND).ravel()
    omega = np.unique(np.concatenate([COARSE * nyquist, around[(around > 1e-3 * nyquist) & (around < nyquist)]]))
    row = np.array([[1.0, -ratio]])
    twisting = plane_response(G.A, G.B, row @ G.C[:2], np.exp(1j * omega * plant.dt))[:, 0, 0]
    pushed = plane_response(P.A, P.B[:, 1:], row @ P.C[:2], 1j * omega)[:, 0, 0]
    share = np.abs(pushed * half_sine(omega, push)) ** 2 * np.gradient(omega)
    return View(omega, twisting, share / share.sum())


def half_sine(omega: np.ndarray, length: float) -> np.ndarray:
    """(N,) ndarray: size of the spectrum of a half-sine, 1 at low frequency."""
    x = omega * length / np.pi
    x = np.where(np.abs(x - 1.0) < 1e-6, 1.0 + 1e-6, x)
    return np.abs(np.cos(0.5 * np.pi * x) / (1.0 - x**2))


class Judged(NamedTuple):
    """Of m plants and n candidates, (m, n) arrays.

    ``disk_margin``, 0 if unstable; ``ringing``, the RMS of the speed difference after a push at the vehicle over that
    without feedback, inf if unstable.
    """

    disk_margin: np.ndarray
    ringing: np.ndarray

    def joined(self, other: Judged) -> Judged:
        """Both sets of candidates."""
        return Judged(*(np.concatenate(pair, axis=1) for pair in zip(self, other, strict=True)))

    def part(self, places: np.ndarray) -> Judged:
        """Some of the candidates."""
        return Judged(self.disk_margin[:, places], self.ringing[:, places])


def judged(views: Sequence[View], shaping: Sequence[np.ndarray]) -> Judged:
    """Candidates from their gain (n, N) [N m s/rad] on each plant, positive where torque is taken off.

    The plants are stable, so a loop is if it does not go round -1 (Nyquist). The disk margin is that of `loop_margins`.
    """
    margin, ringing = [], []
    for view, gain in zip(views, shaping, strict=True):
        loop = gain * view.twisting
        back = 1.0 + loop
        size = np.abs(back)
        turns = np.angle(back[:, 1:] / back[:, :-1]).sum(axis=1)
        stable = (np.abs(turns) < 1.0) & (size.min(axis=1) > TOO_NEAR)
        disk = np.minimum(NO_FEEDBACK, 2.0 * (size / np.abs(1.0 - loop)).min(axis=1))
        margin.append(np.where(stable, disk, 0.0))
        ringing.append(np.where(stable, np.sqrt((view.ringing / size**2).sum(axis=1)), np.inf))
    return Judged(np.array(margin), np.array(ringing))
