"""A control unit in the gear in which a manoeuvre begins, stepped as a plain controller is; and which limits count."""

from __future__ import annotations

import numpy as np

from .actuator import limits_at
from .controller import ControllerStepper
from .plant import SampledPlant
from .unit import Controller, ControlUnit, check_acting


class Engaged:
    """A unit that has driven steadily in the gear of a plant, its ``torque`` [N m] in balance with the load.

    It is stepped by what goes beyond that, as a `ControllerStepper`; the unit itself reads whole torques and speeds.
    """

    def __init__(self, unit: ControlUnit, plant: SampledPlant, torque: float):
        self.before = torque, plant.speed, plant.speed / plant.ratio
        self.at_work = unit.start(torque)
        # it has engaged before the first sample: a demand that jumps there is answered, and not taken for the gear's own
        self.at_work.step(*self.before, plant.ratio)

    def advance(self, signals: np.ndarray) -> float:
        """Command [N m] of one sample from the values of all `CONTROLLER_INPUTS`; its last command it knows itself."""
        demand, engine, wheels, _, ratio = signals.tolist()
        torque, engine_before, wheels_before = self.before
        return self.at_work.step(demand + torque, engine + engine_before, wheels + wheels_before, ratio) - torque


def stepper_of(controller: Controller, plant: SampledPlant, torque: float) -> ControllerStepper | Engaged | None:
    """What commands a plant from a steady ``torque`` [N m] on; None passes the demand."""
    check_acting(controller, plant.dt)
    if isinstance(controller, ControlUnit):
        return Engaged(controller, plant, torque)
    return None if controller is None else ControllerStepper(controller, plant.dt)


def limits_with(plant: SampledPlant, controller: Controller) -> tuple[float, float]:
    """Smallest and largest command [N m] before a manoeuvre: what a plant and, of a unit, the unit permit."""
    low, high = plant.limits
    if isinstance(controller, ControlUnit):
        least, most = limits_at(controller.torque_limits, plant.speed)
        low, high = max(low, least), min(high, most)
    return low, high
