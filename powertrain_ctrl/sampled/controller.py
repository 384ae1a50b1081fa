"""A controller as a discrete-time python-control system: what is permitted, and one step of it."""

from __future__ import annotations

import control
import numpy as np

from ..base.checks import LARGEST, Period, as_number
from ..base.doors import called, checked
from ..base.errors import PowertrainError, SignalError, shown
from .plant import COMMAND, CONTROLLER_INPUTS, is_sampled_every

# A pole of a controller may be outside the unit circle by this much: two integrators in a row come out at 1 + 1e-8.
OUTSIDE = 1e-6
# After a change of controller the difference of the commands dies out with this time constant [s].
BUMP = 0.05


@checked
class ControllerStepper:
    """A discrete-time python-control system, stepped one sample at a time.

    Parameters
    ----------
    controller : control.StateSpace or control.NonlinearIOSystem
        Discrete, with the plant's sample time; inputs among ``torque_demand`` [N m], ``engine_speed``,
        ``wheels_speed`` [rad/s], ``torque_limited`` (the limited command of the sample before [N m]) and ``ratio`` (of
        engine to wheel speed, as the gear is); one output ``torque_command`` [N m].
    dt : float
        Sample time [s].

    Raises
    ------
    PowertrainError
        A continuous, otherwise sampled or unstable controller, or wrong signal names.

    Examples
    --------
    The engine is 2 rad/s ahead of the wheels, so 6 N m s/rad take 12 N m off the demand:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> unit = pt.ControllerStepper(controller, plant.dt)
    >>> unit.step(torque_demand=100.0, engine_speed=2.0, wheels_speed=0.0, torque_limited=0.0)
    88.0
    """

    def __init__(self, controller: control.NonlinearIOSystem, dt: Period):
        check_controller(controller, dt)
        self.controller = controller
        self._picked = np.array([CONTROLLER_INPUTS.index(label) for label in controller.input_labels], dtype=int)
        self._linear = isinstance(controller, control.StateSpace)
        self.x = np.zeros(controller.nstates)
        self.time = 0.0
        if self._linear:
            self._A, self._B, self._C, self._D = (
                np.array(M) for M in (controller.A, controller.B, controller.C, controller.D)
            )

    @called
    def step(self, **signals: float) -> float:
        """Command [N m] for one sample from the controller's inputs by name; the state moves on.

        Parameters
        ----------
        **signals : float
            All inputs of the controller, in their units; others are not read.

        Returns
        -------
        float

        Raises
        ------
        SignalError
            An input of the controller that is missing or not a finite number; the state stays as it was.
        """
        missing = [label for label in self.controller.input_labels if label not in signals]
        if missing:
            raise SignalError(f"step needs {', '.join(missing)}")
        read = dict.fromkeys(CONTROLLER_INPUTS, 0.0)
        for label in self.controller.input_labels:
            read[label] = _finite(label, signals[label])
        return self.advance(np.array(list(read.values())))

    def advance(self, signals: np.ndarray) -> float:
        """The same from the values of all `CONTROLLER_INPUTS`."""
        u = signals[self._picked]
        if self._linear:
            command = float((self._C @ self.x + self._D @ u)[0])
            self.x = self._A @ self.x + self._B @ u
        else:
            command = float(self.controller.output(self.time, self.x, u)[0])
            self.x = np.asarray(self.controller.dynamics(self.time, self.x, u))
        self.time += self.controller.dt
        return command


def _finite(label: str, value: object) -> float:
    number = as_number(value)
    if number is None or not abs(number) <= LARGEST:
        raise SignalError(f'input "{label}" is {shown(value)}, permitted: a finite number, at most {LARGEST:g} in size')
    return number


def check_controller(controller: control.NonlinearIOSystem, dt: float) -> None:
    """Raise a `PowertrainError` unless this is a controller for a plant with sample time ``dt``."""
    if not isinstance(controller, control.NonlinearIOSystem):
        raise PowertrainError(f"expected a discrete-time python-control system as controller, got {controller!r}")
    if not controller.isdtime(strict=True) or controller.dt is True:
        kind = "continuous" if controller.isctime(strict=True) else "without a sample time"
        raise PowertrainError(
            f"the controller is {kind}, permitted: discrete with dt = {dt:g} s (control.sample_system)"
        )
    if not is_sampled_every(dt, controller):
        raise PowertrainError(
            f"the controller has dt = {controller.dt:g} s, the plant dt = {dt:g} s, permitted: the same"
        )
    for label in controller.input_labels:
        if label not in CONTROLLER_INPUTS:
            raise PowertrainError(f'controller input "{label}" is not known, permitted: {", ".join(CONTROLLER_INPUTS)}')
    if list(controller.output_labels) != [COMMAND]:
        raise PowertrainError(f"controller outputs {controller.output_labels}, permitted: {COMMAND} alone")
    if isinstance(controller, control.StateSpace):
        largest = np.abs(np.linalg.eigvals(controller.A)).max(initial=0.0)
        if largest > 1.0 + OUTSIDE:
            raise PowertrainError(
                f"the controller is unstable by itself, a pole has |z| = {largest:.4g}, permitted: <= 1"
            )
