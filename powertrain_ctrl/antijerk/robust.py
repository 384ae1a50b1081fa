"""H-infinity feedback, with a synthesis that is checked."""

from __future__ import annotations

import control
import numpy as np
import slycot

from ..base.checks import AtLeastOne, Factor, Frequency, Positive, SpeedNoise
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..reduction.twomass import TwoMass
from ..sampled.plant import SampledPlant
from .parts import feedback_system


@checked
def hinf(
    plant: SampledPlant,
    model: TwoMass,
    effort: Positive = 0.1,
    corner_hz: Frequency = 8.0,
    noise: SpeedNoise = 0.05,
) -> control.StateSpace:
    """H-infinity feedback on the speed difference against disturbances at the plant input.

    Mixed sensitivity with the disturbance at the plant output would cancel the lightly damped pole instead of damping it.
    Here a torque disturbance of 1 N m shall move the speed difference, in rad/s, and the intervention, weighted by
    ``effort`` and rising above ``corner_hz``, as little as possible. Designed in continuous time with the delay and
    the hold as Pade approximation, then sampled by Tustin's rule; what counts is the proof on the sampled plant.

    Parameters
    ----------
    plant : SampledPlant
    model : TwoMass
        Design model.
    effort : float
        Weight of the intervention at low frequency [-], > 0.
    corner_hz : float
        Above it the weight rises tenfold [Hz], > 0.
    noise : float
        Measurement noise relative to a torque disturbance [rad/s per N m], > 0.

    Returns
    -------
    control.StateSpace
        From ``engine_speed`` and ``wheels_speed`` [rad/s] to ``torque_intervention`` [N m].

    Raises
    ------
    ParameterError
        A weight, corner or noise that is not > 0 and finite.
    PowertrainError
        A synthesis that finds no controller which stabilises the design model.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.hinf(plant, pt.two_mass(plant.car)))
    >>> round(pt.loop_margins(plant, None).zeta_first, 2), round(pt.loop_margins(plant, controller).zeta_first, 2)
    (0.1, 0.52)
    """
    R, ci = model.ratio, model.compliance_of_inertia
    shaft = control.ss(
        [[0.0, 1.0], [-model.stiffness * ci, -model.damping * ci]],
        [[0.0], [1.0 / (model.J1 * R)]],
        [[0.0, R * (1.0 - model.rim_share)]],
        [[0.0]],
    )
    numerator, denominator = control.pade(max(plant.delays) + 0.5 * plant.dt, 2)
    actuator = control.tf2ss(control.tf(numerator, denominator))
    if lag := max(plant.lags):
        actuator = control.ss([[-1.0 / lag]], [[1.0 / lag]], [[1.0]], [[0.0]]) * actuator
    G = shaft * actuator
    corner = 2.0 * np.pi * corner_hz
    # effort (s/w + 1) / (s/(10 w) + 1)
    W = control.ss([[-10.0 * corner]], [[1.0]], [[effort * -90.0 * corner]], [[10.0 * effort]])
    P = _generalised(G, W, noise, model.J1 * model.omega)
    K, _ = hinf_synthesis(P, 1, 1)
    sampled = control.sample_system(K, plant.dt, method="tustin")
    row = np.array([[1.0, -plant.ratio]])
    inputs = ("engine_speed", "wheels_speed")
    return feedback_system(sampled.A, sampled.B @ row, sampled.C, sampled.D @ row, plant.dt, inputs)


def _generalised(G: control.StateSpace, W: control.StateSpace, noise: float, unit: float) -> control.StateSpace:
    """Inputs disturbance, noise, command; outputs speed difference, weighted command, measured speed difference.

    Disturbance and noise have a unit of their own [N m s/rad], that of the gain, so that the norm has none.
    """
    n, w = G.nstates, W.nstates
    A = np.block([[G.A, np.zeros((n, w))], [np.zeros((w, n)), W.A]])
    B = np.block([[unit * G.B, np.zeros((n, 1)), G.B], [np.zeros((w, 2)), W.B]])
    C = np.block([[G.C, np.zeros((1, w))], [np.zeros((1, n)), W.C], [G.C, np.zeros((1, w))]])
    D = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, W.D[0, 0]], [0.0, unit * noise, 0.0]])
    return control.ss(A, B, C, D)


@checked
def hinf_synthesis(
    P: control.StateSpace, measurements: AtLeastOne, controls: AtLeastOne, back_off: Factor = 1.1
) -> tuple[control.StateSpace, float]:
    """Controller that nearly minimises the H-infinity norm, each candidate checked for stability and norm.

    ``control.hinfsyn`` can return a controller that destabilises and a norm that is wrong. Here gamma is
    bisected on SLICOT's SB10AD for one gamma at a time, a candidate counts only if the loop it closes is stable with
    a norm that is what it claims, and the result is taken at ``back_off`` times the least gamma, where the controller
    has no pole that is needlessly fast.

    Parameters
    ----------
    P : control.StateSpace
        Continuous generalised plant; last outputs are measured, last inputs are controls.
    measurements, controls : int
        Number of the outputs that are measured, of the inputs that are controls.
    back_off : float
        Multiple of the least gamma [-], >= 1.

    Returns
    -------
    K : control.StateSpace
        From the measurements to the controls, to be closed as ``P.lft(K)``.
    gamma : float
        Norm of the closed loop.

    Raises
    ------
    PowertrainError
        No candidate passes.

    Examples
    --------
    For ``x' = x + w + u``, ``z = (x, u)``, ``y = x + v`` both Riccati equations have the same solution, and the least
    gamma is ``1 + sqrt(3) = 2.73``; 10 % above it:

    >>> import control, powertrain_ctrl as pt
    >>> B, C = [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]]
    >>> P = control.ss([[1.0]], B, C, [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    >>> K, gamma = pt.antijerk.hinf_synthesis(P, measurements=1, controls=1)
    >>> round(gamma, 1), bool((P.lft(K).poles().real < 0.0).all())
    (3.0, True)
    """
    if not P.isctime() or measurements >= P.noutputs or controls >= P.ninputs:
        raise PowertrainError(
            f"a generalised plant of {P.ninputs} inputs and {P.noutputs} outputs, permitted: a continuous one with more "
            f"than the {controls} controls and the {measurements} measurements"
        )
    low, high, gamma = 1e-6, np.inf, 1.0
    for _ in range(60):
        if _candidate(P, measurements, controls, gamma) is not None:
            high = gamma
        else:
            low = gamma
        gamma = np.sqrt(low * high) if np.isfinite(high) else 4.0 * gamma
        if high < 1.01 * low:
            break
        if gamma > 1e9:
            raise PowertrainError("no controller stabilises the generalised plant; is it stabilisable and detectable?")
    for factor in (back_off, 1.5 * back_off, 1.0):
        found = _candidate(P, measurements, controls, factor * high)
        if found is not None:
            return found
    raise PowertrainError("the H-infinity synthesis found no controller that passes its check")


def _candidate(
    P: control.StateSpace, measurements: int, controls: int, gamma: float
) -> tuple[control.StateSpace, float] | None:
    try:
        result = slycot.sb10ad(
            P.nstates, P.ninputs, P.noutputs, controls, measurements, gamma, P.A, P.B, P.C, P.D, job=4
        )
    except (slycot.exceptions.SlycotError, ValueError):
        return None
    K = control.ss(*result[1:5])
    loop = P.lft(K)
    if not np.isfinite(loop.A).all():
        return None
    poles = loop.poles()
    # left of the axis by more than rounding
    if (poles.real >= -1e-9 * np.abs(poles).max(initial=0.0)).any():
        return None
    norm = float(control.linfnorm(loop)[0])
    return (K, norm) if norm <= 1.02 * gamma else None
