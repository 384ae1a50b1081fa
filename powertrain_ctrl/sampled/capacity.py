"""Clutches whose capacity a sampled controller commands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..base.errors import PowertrainError, SignalError
from .plant import is_sampled_every

if TYPE_CHECKING:
    import control

# What a controller of a clutch can ask for by the names of its inputs, and what it gives.
CLUTCH_INPUTS = ("slip_speed", "planned_capacity", "torque_command")
CAPACITY = "capacity"


class CapacityStepper:
    """A discrete-time python-control system that commands a capacity, one sample at a time; it never is negative."""

    def __init__(self, clutch: str, system: control.NonlinearIOSystem, dt: float):
        known = ", ".join(CLUTCH_INPUTS)
        if not is_sampled_every(dt, system):
            raise PowertrainError(
                f"the controller of {clutch} has dt = {system.dt} s, permitted: {dt:g} s as the plant"
            )
        for label in system.input_labels:
            if label not in CLUTCH_INPUTS:
                raise PowertrainError(f'the controller of {clutch} has the input "{label}", permitted: {known}')
        if list(system.output_labels) != [CAPACITY]:
            raise PowertrainError(
                f"the controller of {clutch} has outputs {system.output_labels}, permitted: {CAPACITY} alone"
            )
        self.clutch, self.system = clutch, system
        self.x, self.time = np.zeros(system.nstates), 0.0
        self._picked = [CLUTCH_INPUTS.index(label) for label in system.input_labels]

    def step(self, slip_speed: float, planned_capacity: float, torque_command: float) -> float:
        """Capacity [N m] over the sample that begins with this slip [rad/s], plan and last torque command [N m]."""
        u = np.array([slip_speed, planned_capacity, torque_command])[self._picked]
        capacity = float(np.asarray(self.system.output(self.time, self.x, u))[0])
        self.x = np.asarray(self.system.dynamics(self.time, self.x, u))
        if not np.isfinite(capacity):
            raise SignalError(
                f"the capacity of {self.clutch} is not finite at t = {self.time:g} s; its loop is unstable"
            )
        self.time += float(self.system.dt)
        return max(capacity, 0.0)
