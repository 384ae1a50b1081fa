"""Linear-quadratic feedback with a Kalman filter."""

from __future__ import annotations

import warnings

import control
import numpy as np
import scipy.linalg

from ..base.checks import Effort, SpeedNoise, TorqueNoise
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..reduction.twomass import TwoMass
from ..sampled.plant import SampledPlant
from .parts import feedback_system

# Weights and noises that are there for the Riccati equations alone, over what counts.
SMALL = 1e-9


@checked
def lqg(
    plant: SampledPlant,
    model: TwoMass,
    effort: Effort = 0.02,
    load_noise: TorqueNoise = 1.0,
    torque_noise: TorqueNoise = 10.0,
    speed_noise: SpeedNoise = 0.5,
    engine_only: bool = False,
    wheels_only: bool = False,
) -> control.StateSpace:
    """Linear-quadratic feedback on the twist rate, with a Kalman filter that estimates the load as well.

    The regulator minimises the sum of ``speed_difference^2 + effort * intervention^2``. The rigid motion is left to
    the driver: it is estimated and not regulated. The filter reads the limited command, so it does not wind up.

    Parameters
    ----------
    plant : SampledPlant
        Actuator and sample time; the driveline is that of the model.
    model : TwoMass
        Design model.
    effort : float
        [(rad/s / N m)^2], > 0.
    load_noise, torque_noise : float
        Standard deviation per sample of the step of the load [N m at the engine] and of the engine torque [N m], > 0.
    speed_noise : float
        Standard deviation of the engine speed [rad/s], > 0; that of the wheel speed is this over the ratio.
    engine_only, wheels_only : bool
        Without the sensor of the wheels, or without that of the engine.

    Returns
    -------
    control.StateSpace
        From ``engine_speed``, ``wheels_speed`` [rad/s] and ``torque_limited`` [N m] to ``torque_intervention`` [N m].

    Raises
    ------
    ParameterError
        A weight or noise that is not > 0 and finite.
    PowertrainError
        An effort or noises for which a Riccati equation has no solution; without both sensors.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.lqg(plant, pt.two_mass(plant.car)))
    >>> round(pt.loop_margins(plant, None).zeta_first, 2), round(pt.loop_margins(plant, controller).zeta_first, 2)
    (0.1, 0.33)
    """
    if engine_only and wheels_only:
        raise PowertrainError("engine_only and wheels_only leave no sensor, permitted: one of them")
    A, B, C = design_model(plant, model)
    n, read = len(A), [0] if engine_only else [1] if wheels_only else [0, 1]
    # The regulator knows only what vibrates: twist, twist rate, torque and commands under way.
    vibrating = np.delete(np.arange(n), [2, 3])
    difference = (C[0] - plant.ratio * C[1])[vibrating]
    size = _sizes(plant, model, n)
    weight = np.outer(difference, difference) + np.diag(SMALL / size[vibrating] ** 2)
    gain = np.zeros((1, n))
    regulated = A[np.ix_(vibrating, vibrating)]
    measured = C[read]
    noise = np.diag(np.array([speed_noise, speed_noise / plant.ratio])[read] ** 2)
    # torque errors enter like the torque does, the load walks
    covariance = torque_noise**2 * np.outer(A[:, 4], A[:, 4])
    covariance[3, 3] += load_noise**2
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", scipy.linalg.LinAlgWarning)
            gain[:, vibrating] = control.dlqr(regulated, B[vibrating], weight, [[effort]], method="scipy")[0]
            _, P, _ = control.dlqe(
                A, np.eye(n), measured, covariance + np.diag(SMALL * (speed_noise * size) ** 2), noise, method="scipy"
            )
    except (np.linalg.LinAlgError, scipy.linalg.LinAlgWarning) as error:
        raise PowertrainError(
            f"the Riccati equations have no solution for this effort and these noises: {error}"
        ) from error
    correct = P @ measured.T @ np.linalg.inv(measured @ P @ measured.T + noise)
    keep = np.eye(n) - correct @ measured
    # the state is the estimate after the last correction
    B_all = np.hstack([np.zeros((n, 2)), keep @ B])
    B_all[:, read] = correct
    return feedback_system(keep @ A, B_all, -gain @ keep @ A, -gain @ B_all, plant.dt)


def _sizes(plant: SampledPlant, model: TwoMass, n: int) -> np.ndarray:
    """What the states of `design_model` come to when the engine swings with 1 rad/s in the first mode."""
    speed, torque = 1.0 / model.ratio, model.J1 * model.omega
    return np.array([speed / model.omega, speed, 1.0, *[torque] * (n - 3)])


def design_model(plant: SampledPlant, model: TwoMass) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Discrete A, B from the command and C to engine and wheel speed.

    States: twist at the wheel [rad], its rate, engine speed [rad/s], load at the engine [N m], engine torque [N m],
    commands under way [N m].
    """
    R, ci = model.ratio, model.compliance_of_inertia
    c, d, J1, J2 = model.stiffness, model.damping, model.J1, model.J2
    lag = max(*plant.lags, 1e-6)
    A = np.zeros((5, 5))
    A[0, 1] = 1.0
    A[1] = [-c * ci, -d * ci, 0.0, R / J2, 1.0 / (J1 * R)]
    A[2] = [-c / (J1 * R), -d / (J1 * R), 0.0, 0.0, 1.0 / J1]
    A[4, 4] = -1.0 / lag
    Ad, Bd = plant.with_delay(A, np.array([[0.0], [0.0], [0.0], [0.0], [1.0 / lag]]))
    C = np.zeros((2, len(Ad)))
    C[0, 2] = 1.0
    # the rim turns with the tread plus its share of the twist rate; the tread with the engine minus all of it
    C[1, 1], C[1, 2] = model.rim_share - 1.0, 1.0 / R
    return Ad, Bd, C
