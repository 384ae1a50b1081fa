"""Commands on their way to an actuator: when each begins to act, and with which lag the torque follows it."""

from __future__ import annotations

from collections import deque
from typing import NamedTuple

from .plant import SampledPlant

# A change of the command by less than this share of the largest one so far has no direction: it goes the way of the change
# before, lest rounding overtake what is under way.
SAME_COMMAND = 1e-9


class Acting(NamedTuple):
    """A command [N m] that acts from an instant of a sample on [s]."""

    since: float
    command: float


class Arrivals:
    """The delay of a plant: one command is sent in each sample, and before the first one 0 acts."""

    def __init__(self, plant: SampledPlant):
        self.rise, self.fall = plant.delays_in_samples
        self.delay, self.sent, self.largest, self.acting = self.rise, 0.0, 0.0, 0.0
        self.under_way: deque[tuple[tuple[int, float], float]] = deque()

    def send(self, sample: int, command: float) -> None:
        """A command of a sample; older ones that are not there before it never act."""
        change = command - self.sent
        self.sent, self.largest = command, max(self.largest, abs(command))
        if abs(change) > SAME_COMMAND * self.largest:
            self.delay = self.rise if change > 0.0 else self.fall
        whole, rest = self.delay
        instant = (sample + whole, rest)
        while self.under_way and self.under_way[-1][0] >= instant:
            self.under_way.pop()
        self.under_way.append((instant, command))

    def during(self, sample: int) -> list[Acting]:
        """What acts in a sample, the first from its beginning on; to be asked for every one, in order."""
        found = [Acting(0.0, self.acting)]
        while self.under_way and self.under_way[0][0][0] == sample:
            (_, since), command = self.under_way.popleft()
            if since == 0.0:
                found = []
            found.append(Acting(since, command))
        self.acting = found[-1].command
        return found


def lag_towards(command: float, torque: float, lags: tuple[float, float]) -> float:
    """Lag [s], of those of a rise and a fall, with which a torque goes to a command: it never crosses it."""
    return lags[0] if command > torque else lags[1]
