"""Slider-crank: where the piston is, and what torque its inertia and a pressure on it make."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# Samples of a revolution: what is periodic and smooth is integrated by their mean to the last digit.
SAMPLES = 4096
# Points of Gauss's rule on each piece of a pressure table, and the longest piece times the highest order [rad]: a product of
# a line, the lever and a harmonic is integrated to the last digit.
POINTS, LONGEST = 4, 0.1


@dataclass(frozen=True)
class SliderCrank:
    """Crank of radius ``stroke / 2`` and its rod [m]; angles [rad] from top dead centre."""

    stroke: float
    rod: float

    def travel(self, angle: np.ndarray) -> np.ndarray:
        """Way of the piston from top dead centre [m]."""
        r, l = 0.5 * self.stroke, self.rod
        swing = (r * np.sin(angle)) ** 2
        # not as differences of lengths, which cancel near the dead centre
        return 2.0 * r * np.sin(0.5 * angle) ** 2 + swing / (l + np.sqrt(l**2 - swing))

    def lever(self, angle: np.ndarray) -> np.ndarray:
        """Torque on the crank per force on the piston: derivative of the travel [m/rad]."""
        r, s, c = 0.5 * self.stroke, np.sin(angle), np.cos(angle)
        return r * s + r**2 * s * c / np.sqrt(self.rod**2 - (r * s) ** 2)

    def bend(self, angle: np.ndarray) -> np.ndarray:
        """Second derivative of the travel [m/rad^2]."""
        r, s, c = 0.5 * self.stroke, np.sin(angle), np.cos(angle)
        root = np.sqrt(self.rod**2 - (r * s) ** 2)
        return r * c + r**2 * (c * c - s * s) / root + r**4 * (s * c) ** 2 / root**3

    @property
    def mean_square(self) -> float:
        """Mean of the lever's square over a revolution [m^2]: the inertia that a mass at the piston has."""
        return float(np.mean(self.lever(_revolution()) ** 2))

    def inertia_torque(self, angle: np.ndarray) -> np.ndarray:
        """Torque of a mass at the piston at constant speed, per mass and speed squared [m^2]."""
        return -self.lever(angle) * self.bend(angle)

    def inertia_orders(self, orders: np.ndarray) -> np.ndarray:
        """Its complex amplitudes at these orders, none at half orders."""
        spectrum = 2.0 * np.fft.rfft(self.inertia_torque(_revolution())) / SAMPLES
        whole = np.rint(orders).astype(int)
        return np.where(np.abs(orders - whole) < 0.25, spectrum[whole], 0.0)

    def work_orders(self, angles: np.ndarray, pressures: np.ndarray, orders: np.ndarray) -> np.ndarray:
        """Complex amplitudes (tables, orders) of lever times pressure per area over the cycle that the table spans [Pa m].

        Parameters
        ----------
        angles : (n,) ndarray
            From the first to the last one a whole cycle, not decreasing.
        pressures : (tables, n) ndarray
            Linear in between [Pa]; an angle given twice is a jump.
        orders : (orders,) ndarray
            0 gives the mean.
        """
        piece = np.minimum(LONGEST / max(float(orders.max()), 6.0), np.diff(angles).max())
        count = np.ceil(np.diff(angles) / piece).astype(int)
        of = np.repeat(np.arange(len(count)), count)
        width = (np.diff(angles) / np.maximum(count, 1))[of]
        within = np.arange(len(of)) - np.repeat(np.cumsum(count) - count, count)
        nodes, weights = np.polynomial.legendre.leggauss(POINTS)
        phi = (angles[of] + width * within)[:, None] + 0.5 * width[:, None] * (1.0 + nodes)
        share = (phi - angles[of][:, None]) / np.diff(angles)[of][:, None]
        pressure = pressures[:, of, None] * (1.0 - share) + pressures[:, of + 1, None] * share
        weighted = pressure * self.lever(phi) * (0.5 * width[:, None] * weights)
        harmonic = np.exp(-1j * np.multiply.outer(phi.ravel(), orders))
        factor = np.where(orders > 0.0, 2.0, 1.0) / (angles[-1] - angles[0])
        return factor * (weighted.reshape(len(pressures), -1) @ harmonic)


def _revolution() -> np.ndarray:
    return 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
