"""What a driveline comes to under constant loads.

Its springs are at rest, motions that dampers resist go on at constant speed, free ones at constant acceleration. Nodes
without inertia that creep are at rest with their springs too, so that here they are coordinates like the others.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ..base.doors import checked
from ..driveline.collection import HasDriveline
from ..driveline.kinematics import product
from .assembly import TorsionalModel, assemble
from .outputs import output_rows, select
from .separation import accelerated, complement, one_twist


class Motions(NamedTuple):
    """Motions (n + p, ...) of the coordinates and creeping directions.

    ``R`` twists one spring by 1 and has no momentum in the ``free`` ones, which nothing resists; ``resisted`` are the other
    ones that twist no spring. ``on_R`` and ``on_resisted`` are the twists of the compliances, M is the inertia.
    """

    R: np.ndarray
    free: np.ndarray
    resisted: np.ndarray
    on_R: np.ndarray
    on_resisted: np.ndarray
    M: np.ndarray

    def turned(self, damping: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far all has turned, from the twists and from the speeds, where loads have left the resisted motions alone.

        By the integral of the balance on these, ``N^T D (R theta + N q) = -N^T M z``.
        """
        dampers = self.on_resisted.T * damping
        resistance = dampers @ self.on_resisted
        lost = np.hstack([dampers @ self.on_R, self.resisted.T @ self.M])
        back = self.resisted @ np.linalg.solve(resistance, lost)
        return self.R - back[:, : self.R.shape[1]], -back[:, self.R.shape[1] :]


class Steady(NamedTuple):
    """Under some loads: (r, loads) twists; and motions (n + p, loads) of the coordinates and creeping directions.

    ``going`` are speeds that dampers resist, ``turned`` the angles besides those that grow with time, ``accelerating`` the
    accelerations of free motions.
    """

    twist: np.ndarray
    going: np.ndarray
    turned: np.ndarray
    accelerating: np.ndarray


def motions(model: TorsionalModel) -> Motions:
    """Motions of a model with its creeping nodes as coordinates."""
    F, n = model.following.twists, len(model.M)
    M = np.zeros(2 * F.shape[1:])
    M[:n, :n] = model.M
    springless = model.following.untwisted(np.flatnonzero(model.stiffness))
    free = model.following.untwisted(model.resisting_rows)
    resisted = springless[:, complement(springless, free)]
    resisted = resisted - free @ accelerated(M, free, free.T @ M @ resisted)
    R = one_twist(F[model.elastic_rows], springless, np.sqrt(np.diag(M)))
    R = R - free @ accelerated(M, free, free.T @ M @ R)
    on_R, on_resisted = np.array(model.twist_factor), np.zeros((len(F), resisted.shape[1]))
    damper = model.stiffness == 0.0
    on_R[damper], on_resisted[damper] = product(F[damper], R), product(F[damper], resisted)
    return Motions(R, free, resisted, on_R, on_resisted, M)


def steady(model: TorsionalModel, load: np.ndarray) -> Steady:
    """What constant loads (nodes, loads) lead to."""
    parts, force = motions(model), model.following.motions.T @ load
    dampers = model.damping[:, None] * parts.on_resisted
    speed = np.linalg.solve(parts.on_resisted.T @ dampers, product(parts.resisted.T, force))
    stiffness = (model.twist_factor.T * model.stiffness) @ model.twist_factor
    twist = np.linalg.solve(stiffness, product(parts.R.T, force) - parts.on_R.T @ (dampers @ speed))
    going, (by_twist, by_speed) = product(parts.resisted, speed), parts.turned(model.damping)
    accelerating = parts.free @ accelerated(parts.M, parts.free, product(parts.free.T, force))
    return Steady(twist, going, by_twist @ twist + by_speed @ going, accelerating)


@checked
def static_gain(
    car: HasDriveline, inputs: Iterable[str] | str | None = None, outputs: Iterable[str] | str | None = None
) -> np.ndarray:
    """What each output comes to under each input at 1, held for ever: the response at frequency 0.

    Under a constant torque a driveline without ground goes on to accelerate while its springs are twisted and its
    accelerations are constant, so these have a gain, and speeds have none.

    Parameters
    ----------
    car : Driveline or TwoMass
    inputs, outputs : str or list of str, optional
        As in `state_space`; None means all, angles left out.

    Returns
    -------
    (outputs, inputs) ndarray
        In units of output per input; inf where the output grows without bound.

    Raises
    ------
    UnknownNameError
        A signal that is not there.
    TopologyError
        A driveline that cannot be assembled.
    PowertrainError
        No signal at all, or one twice; an output that would need the derivative of an input, at a node without inertia.

    Examples
    --------
    Of 1 N m at the engine the clutch passes on what accelerates the inertia behind it, 65 %:

    >>> import powertrain_ctrl as pt
    >>> pt.static_gain(pt.examples.conventional(), "engine_torque", ["clutch_torque", "engine_speed"]).round(2)
    array([[0.65],
           [ inf]])
    """
    model = assemble(car)
    index = select(inputs, model.inputs, "input")
    rows = output_rows(model, outputs, outputs is not None, index)
    unit, n = np.eye(len(model.inputs))[:, index], len(model.coordinates)
    twist, going, turned, accelerating = steady(model, model.B[:, index])
    speed, acceleration = going[:n], accelerating[:n]
    friction = model.locked_torque(twist, speed, acceleration, unit)
    signals = [rows.twist, rows.speed, rows.acceleration, rows.friction, rows.load, rows.motion]
    gain = product(np.hstack(signals), np.vstack([twist, speed, acceleration, friction, unit, turned]))
    # springs at rest leave nothing but this, exactly
    hastened = [name.endswith("_acceleration") for name in rows.names]
    gain[hastened] = product(rows.acceleration[hastened], acceleration)
    grows = product(rows.speed, acceleration), product(rows.motion, going), product(rows.motion, accelerating)
    gain[np.any([signal != 0.0 for signal in grows], axis=0)] = np.inf
    return gain
