"""Which ratio drives the wheels as the clutches hold and slip."""

from __future__ import annotations

from ..base.errors import TopologyError
from ..driveline.collection import Driveline
from ..hybrid.plans import turning
from .plant import SampledPlant
from .unit import NO_GEAR


class Gears:
    """Ratios of a car from the driving node of a plant to its wheels, by the clutches that hold."""

    def __init__(self, car: Driveline, plant: SampledPlant):
        self.car, self.plant = car.release(), plant
        self._known: dict[frozenset[str], float] = {}

    def ratio(self, holding: frozenset[str]) -> float:
        """Speed of the driving node over that of the wheels, 0 where nothing connects them or all is held at rest."""
        if holding not in self._known:
            self._known[holding] = self._found(holding)
        return self._known[holding]

    def _found(self, holding: frozenset[str]) -> float:
        locked = self.car.lock(*holding) if holding else self.car
        part = locked.part(self.plant.engine)
        if not set(self.plant.wheels) <= set(part.nodes):
            return NO_GEAR
        try:
            motion = turning(part, self.plant.engine)
        except TopologyError:
            return NO_GEAR
        at_wheels = sum(motion[wheel] for wheel in self.plant.wheels) / len(self.plant.wheels)
        return 1.0 / at_wheels if at_wheels else NO_GEAR
