"""How long and how hard a tip-in tries a car: with its first mode, and with the torque that it has."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..linear.assembly import kept
from ..linear.modal import modes
from ..sampled.plant import SAME_INSTANT, SampledPlant

# On the source's car, first mode 2.64 Hz and 350 N m at most, 250 N m in 100 ms, seen for 3.5 s.
SOURCE_HZ = 2.638
TORQUE, LARGEST, RAMP, WINDOW = 250.0, 350.0, 0.1, 3.5
# It starts then [s], or with the next sample.
START = 0.5


class Times(NamedTuple):
    """Torque of a tip-in [N m], its start, the length of its ramp and its end [s]."""

    torque: float
    start: float
    ramp: float
    end: float


@kept(256)
def times_of(plant: SampledPlant) -> Times:
    """Whole samples, nearest to what has the same ratio to the period of the first mode as on the source's car."""
    found = modes(plant.linear)
    elastic = found.frequency_hz[found.n_rigid :]
    longer = SOURCE_HZ / float(elastic[0]) if elastic.size else 1.0
    torque = torque_of(plant)

    def samples(time: float) -> float:
        return max(1.0, np.floor(time / plant.dt + 0.5)) * plant.dt

    start = float(np.ceil(START / plant.dt - SAME_INSTANT) * plant.dt)
    return Times(torque, start, samples(RAMP * longer), start + samples(WINDOW * longer))


def torque_of(plant: SampledPlant) -> float:
    """The same share of the largest torque as on the source's car; where it has no limit, as much as there."""
    low, high = plant.limits
    largest = high if high > 0.0 else low
    return TORQUE / LARGEST * largest if np.isfinite(largest) and largest else TORQUE
