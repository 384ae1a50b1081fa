"""Errors with which a sampled controller reads the speeds."""

from dataclasses import dataclass

import numpy as np

from ..base.checks import Count, Seed, SpeedError
from ..base.doors import checked

# Half a quantum counts as a whole one, also if rounding leaves this much [-].
ROUNDED = 1e-9


@checked
@dataclass(frozen=True)
class Sensors:
    """Measurement errors of the speed sensors, independent at each sample.

    Steps of an angle counted over a sample have the quantum ``2 pi / (steps * dt)``: of a resolver or encoder with 4096
    steps and 2 ms 0.77 rad/s, of a tooth wheel of 48 teeth and 10 ms 13 rad/s. Where the time between two teeth is
    counted by a clock of frequency f, a speed omega has the quantum ``omega^2 * teeth / (2 pi f)``: at 200 rad/s, 48
    teeth and 1 MHz 0.31 rad/s.

    Parameters
    ----------
    engine_noise, wheels_noise : float
        Standard deviation [rad/s].
    engine_resolution, wheels_resolution : float
        Quantum [rad/s]; 0 is none.
    seed : int
        Of the noise; the same seed gives the same errors.

    Raises
    ------
    ParameterError
        A deviation or quantum that is not >= 0 and finite.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> sensors = pt.Sensors(engine_noise=0.1, wheels_noise=0.01, engine_resolution=0.5)
    >>> sensors.errors(20000).std(axis=1).round(2)
    array([0.1 , 0.01])
    >>> sensors.quantised(np.array([1.3, 0.27]))
    array([1.5 , 0.27])
    """

    engine_noise: SpeedError = 0.0
    wheels_noise: SpeedError = 0.0
    engine_resolution: SpeedError = 0.0
    wheels_resolution: SpeedError = 0.0
    seed: Seed = 0

    @checked
    def errors(self, count: Count) -> np.ndarray:
        """(2, count) ndarray: noise of engine and wheel speed."""
        scale = np.array([[self.engine_noise], [self.wheels_noise]])
        return scale * np.random.default_rng(self.seed).standard_normal((2, count))

    @checked
    def quantised(self, speeds: np.ndarray) -> np.ndarray:
        """(2,) ndarray: engine and wheel speed [rad/s] rounded to their quanta, half a quantum up."""
        quanta = np.array([self.engine_resolution, self.wheels_resolution])
        counts = np.floor(speeds / np.where(quanta > 0.0, quanta, 1.0) + (0.5 + ROUNDED))
        return np.where(quanta > 0.0, counts * quanta, speeds)
