"""Controllers from feedback and feedforward, and their schedule over gears."""

from __future__ import annotations

from collections.abc import Mapping

import control
import numpy as np
import scipy.linalg

from ..base.checks import Period, Ratio
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.systems import PicklableSystem, linear_system
from ..reduction.twomass import TwoMass
from ..sampled.controller import BUMP, check_controller
from ..sampled.plant import COMMAND, CONTROLLER_INPUTS, SampledPlant, is_sampled_every
from .parts import FEEDFORWARD, INTERVENTION, READS

# Ratios that are nearer to the one read by less than this share of the largest are equally near.
AS_NEAR = 1e-9


@checked
def one_dof(plant: SampledPlant, feedback: control.StateSpace) -> control.StateSpace:
    """Demand plus intervention: the feedback sees the speeds as they are.

    Parameters
    ----------
    plant : SampledPlant
    feedback : control.StateSpace
        From `speed_difference`, `rigid_reference`, `lqg` or `hinf`.

    Returns
    -------
    control.StateSpace
        Controller for `closed_loop`.

    Raises
    ------
    PowertrainError
        What is not a feedback, or has another sample time than the plant.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> dict(zip(controller.input_labels, controller.D[0].round(9).tolist()))
    {'torque_demand': 1.0, 'engine_speed': -6.0, 'wheels_speed': 108.0, 'torque_limited': 0.0}
    """
    B, D = _on_reads(feedback, plant)
    zero = np.zeros((feedback.nstates, 1))
    return _controller(feedback.A, np.hstack([zero, B]), feedback.C, np.hstack([[[1.0]], D]), plant)


@checked
def two_dof(
    plant: SampledPlant,
    model: TwoMass,
    feedback: control.StateSpace,
    feedforward: control.StateSpace | None = None,
) -> control.StateSpace:
    """Feedforward, and feedback on what the speeds differ from those that the feedforward makes the model take.

    So the feedback neither brakes the wanted twist nor a wanted acceleration; where the model is right it does nothing.

    Parameters
    ----------
    plant : SampledPlant
        Actuator and sample time.
    model : TwoMass
        Reference model of the driveline.
    feedback, feedforward : control.StateSpace
        Feedback as in `one_dof`; feedforward from `inverse_notch`, `zv_shaper` or `zvd_shaper`, without one the demand
        is taken as it is.

    Returns
    -------
    control.StateSpace
        Controller for `closed_loop`.

    Raises
    ------
    PowertrainError
        What is not a feedback or not a feedforward, or a feedback with another sample time than the plant.

    Examples
    --------
    The feedforward alone, and with a feedback on what it leaves: overshoot of a tip-in.

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> model, feedback = pt.two_mass(plant.car), pt.antijerk.speed_difference(plant, gain=6.0)
    >>> controller = pt.antijerk.two_dof(plant, model, feedback, pt.antijerk.inverse_notch(plant, model))
    >>> tip_ins = [pt.tip_in(plant, each) for each in (None, controller)]
    >>> [round(pt.studies.tip_in_metrics(plant, each).overshoot, 2) for each in tip_ins]
    [0.61, 0.02]
    """
    if feedforward is None:
        feedforward = linear_system([], [], [], [[1.0]], dt=plant.dt, inputs=["torque_demand"], outputs=[FEEDFORWARD])
    if list(feedforward.input_labels) != ["torque_demand"] or list(feedforward.output_labels) != [FEEDFORWARD]:
        raise PowertrainError(f"a feedforward goes from torque_demand to {FEEDFORWARD}")
    if not is_sampled_every(plant.dt, feedforward):
        raise PowertrainError(f"the feedforward has dt = {feedforward.dt} s, permitted: {plant.dt:g} s as the plant")
    reference = SampledPlant(car=model, lag=plant.lag, delay=plant.delay, dt=plant.dt).discrete()
    B, D = _on_reads(feedback, plant)
    speeds = reference.C[:2]
    # states: feedforward, reference model, feedforward torque of the sample before, feedback
    f, r, b = feedforward.nstates, reference.nstates, feedback.nstates
    wanted = np.hstack([feedforward.C, np.zeros((1, r + 1 + b))])
    # what the feedback reads: speeds minus the reference's, limited torque minus the wanted one, all a sample ago
    seen = np.zeros((3, f + r + 1 + b))
    seen[:2, f : f + r] = -speeds
    seen[2, f + r] = -1.0
    A = scipy.linalg.block_diag(feedforward.A, reference.A, np.zeros((1, 1)), feedback.A)
    A[f : f + r] += reference.B @ wanted
    A[f + r] += wanted[0]
    A[f + r + 1 :] += B @ seen
    through = feedforward.D
    B_all = np.zeros((len(A), 4))
    B_all[:f, :1] = feedforward.B
    B_all[f : f + r, :1] = reference.B @ through
    B_all[f + r, :1] = through
    B_all[f + r + 1 :, 1:] = B
    C = wanted + D @ seen
    C[:, f + r + 1 :] += feedback.C
    return _controller(A, B_all, C, np.hstack([through, D]), plant)


@checked
def scheduled(controllers: Mapping[Ratio, control.NonlinearIOSystem], dt: Period) -> control.NonlinearIOSystem:
    """Controllers by gear as one system that reads ``ratio`` too and switches without a bump.

    All controllers run along with the same signals; after a change the difference of their commands dies out with a time
    constant of 50 ms.

    Parameters
    ----------
    controllers : mapping
        Ratio of engine to wheel speed (`SampledPlant.ratio`) to controller; the one nearest to the ratio read counts,
        of two equally near the one given first.
    dt : float
        Sample time [s].

    Returns
    -------
    control.NonlinearIOSystem
        Controller for `closed_loop`.

    Raises
    ------
    PowertrainError
        No controller at all, or one that does not fit, as in `ControllerStepper`.

    Examples
    --------
    From first to a higher gear the twist rate read jumps from 0.2 to 0.92 rad/s; the command does not:

    >>> import powertrain_ctrl as pt
    >>> plants = [pt.SampledPlant(car=pt.examples.conventional(gear_ratio=ratio)) for ratio in (6.0, 3.6)]
    >>> gears = {each.ratio: pt.antijerk.one_dof(each, pt.antijerk.speed_difference(each)) for each in plants}
    >>> unit = pt.ControllerStepper(pt.antijerk.scheduled(gears, dt=0.01), dt=0.01)
    >>> read = {"torque_demand": 100.0, "engine_speed": 2.0, "wheels_speed": 0.1, "torque_limited": 0.0}
    >>> [round(unit.step(ratio=ratio, **read), 2) for ratio in (18.0, 10.8, 10.8)]
    [98.8, 98.8, 98.02]
    """
    if not controllers:
        raise PowertrainError("a schedule needs at least one controller")
    ratios = np.array(list(controllers), dtype=float)
    systems = list(controllers.values())
    for system in systems:
        check_controller(system, dt)
        if not isinstance(system, control.StateSpace):
            raise PowertrainError("a schedule is made of linear controllers (control.StateSpace)")
    return Schedule(_scheduled, ratios, systems, dt)


class Schedule(PicklableSystem):
    """Controllers by ratio; where the ratio stays it is one of them."""

    def at_ratio(self, ratio: float) -> control.StateSpace:
        """The controller that acts at a ratio."""
        _, ratios, systems, _ = self._made_by
        return systems[_nearest(ratios, ratio)]


def _nearest(ratios: np.ndarray, ratio: float) -> int:
    distance = np.abs(ratios - ratio)
    return int((distance <= distance.min() + AS_NEAR * np.abs(ratios).max()).argmax())


def _scheduled(ratios: np.ndarray, systems: list[control.StateSpace], dt: float) -> control.NonlinearIOSystem:
    sizes = [system.nstates for system in systems]
    starts = np.concatenate([[0], np.cumsum(sizes)])
    picked = [[CONTROLLER_INPUTS.index(label) for label in system.input_labels] for system in systems]
    forget = np.exp(-dt / BUMP)

    def commands(x: np.ndarray, u: np.ndarray) -> np.ndarray:
        parts = zip(systems, starts[:-1], starts[1:], picked, strict=True)
        return np.array([(s.C @ x[i:j] + s.D @ u[p])[0] for s, i, j, p in parts])

    def bump(x: np.ndarray, u: np.ndarray) -> tuple[float, float]:
        """What is left of the last step between commands."""
        now, before = _nearest(ratios, u[-1]), round(float(x[-2])) - 1  # the state starts at 0, before any gear
        every = commands(x, u)
        jump = 0.0 if before < 0 or before == now else every[before] - every[now]
        return every[now], x[-1] + jump

    def update(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        parts = zip(systems, starts[:-1], starts[1:], picked, strict=True)
        states = [s.A @ x[i:j] + s.B @ u[p] for s, i, j, p in parts]
        return np.concatenate([*states, [_nearest(ratios, u[-1]) + 1, forget * bump(x, u)[1]]])

    def output(t: float, x: np.ndarray, u: np.ndarray, params: dict) -> np.ndarray:
        return np.array([sum(bump(x, u))])

    inputs = list(CONTROLLER_INPUTS)
    names = [f"x{i}" for i in range(starts[-1])] + ["gear_before", "bump"]
    return control.nlsys(update, output, inputs=inputs, outputs=[COMMAND], states=names, dt=dt, name="scheduled")


def _on_reads(feedback: control.StateSpace, plant: SampledPlant) -> tuple[np.ndarray, np.ndarray]:
    """B and D of a feedback on all signals a feedback can read."""
    if not isinstance(feedback, control.StateSpace) or list(feedback.output_labels) != [INTERVENTION]:
        labels = getattr(feedback, "output_labels", type(feedback).__name__)
        raise PowertrainError(f"expected a feedback with the output {INTERVENTION}, got {labels}")
    if not is_sampled_every(plant.dt, feedback):
        raise PowertrainError(
            f"the feedback has dt = {feedback.dt} s, the plant dt = {plant.dt:g} s, permitted: the same"
        )
    B, D = np.zeros((feedback.nstates, 3)), np.zeros((1, 3))
    for j, label in enumerate(feedback.input_labels):
        if label not in READS:
            raise PowertrainError(f'feedback input "{label}" is not known, permitted: {", ".join(READS)}')
        B[:, READS.index(label)], D[:, READS.index(label)] = feedback.B[:, j], feedback.D[:, j]
    return B, D


def _controller(A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray, plant: SampledPlant) -> control.StateSpace:
    return linear_system(A, B, C, D, dt=plant.dt, inputs=["torque_demand", *READS], outputs=[COMMAND])
