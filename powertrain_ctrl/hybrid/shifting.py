"""Gear shifts of a gearbox with two clutches: torque is handed over from one to the other, speed follows or goes before."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..base.checks import Duration, Period, Speed, Torque
from ..base.doors import checked
from ..base.errors import PowertrainError, TopologyError, UnknownNameError
from ..base.units import rpm
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.ends import driven, ends
from ..linear.assembly import as_driveline
from ..linear.steady import static_gain
from .plans import SWITCHED, Plan, capacities_as_set, capacity_of, course, inertia_at, steady, turning
from .response import Response
from .signals import Times
from .simulation import simulate

# What the preset shift takes [s].
LENGTH = 2.5
# The torque of the speed phase comes and goes in this share of it.
SLANT = 0.2
# A clutch from which torque is taken holds so much more than that until it is open, one that is to slip so much less [-].
HOLDS, SLIPS = 1.15, 0.97
# Ratios that are nearer to each other than this share are one gear.
SAME_RATIO = 1e-6


@checked
def gear_shift(
    car: HasDriveline,
    offgoing: str,
    oncoming: str,
    torque: Torque = 150.0,
    engine_speed: Speed = rpm(3000.0),
    torque_phase: Period = 0.15,
    speed_phase: Period = 0.3,
    start: Duration = 0.5,
    timepts: Times | None = None,
) -> Response:
    """Shift under torque from the gear behind one clutch to that behind another one.

    Up under driving torque (and down under braking torque) the torque is handed over first: the capacity of the oncoming
    clutch rises to what the old one carries while that one opens, then the driving node is brought to its new speed.
    Otherwise the speed phase comes first, the offgoing clutch slipping. In the speed phase the clutch carries on and the
    torque at the driving node changes by what its side of the clutches needs for the change of speed. A slip that is left
    ends as the oncoming clutch closes. The response is exact, the signals are what a control unit without feedback would
    plan.

    Parameters
    ----------
    car : Driveline
        Its driving node is the engine or, with a separation clutch open, the node behind that; other clutches stay as they
        are.
    offgoing, oncoming : str
        Clutches of the old and of the new gear, which is engaged.
    torque : float
        Of the driving node, which accelerates the car with it [N m].
    engine_speed : float
        Of the driving node at t = 0 [rad/s].
    torque_phase, speed_phase : float
        [s].
    start : float
        When the shift begins [s].
    timepts : (N,) array_like, optional
        [s]; every 1 ms to 2.5 s if not given.

    Returns
    -------
    Response

    Raises
    ------
    UnknownNameError
        A clutch that is not there.
    PowertrainError
        Twice the same clutch, two gears of the same ratio, or a clutch that cannot carry the torque.
    TopologyError
        A driveline that one of the clutches does not connect.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.p2_hybrid(gear=1, preselected=2)
    >>> response = pt.gear_shift(car, offgoing="odd_clutch", oncoming="even_clutch")
    >>> [(event.element, event.kind) for event in response.events if event.kind != "slip"]
    [('odd_clutch', 'release'), ('even_clutch', 'lock')]
    """
    car = as_driveline(car)
    plan = shift_plan(car, offgoing, oncoming, torque, engine_speed, torque_phase, speed_phase, start)
    timepts = np.linspace(0.0, LENGTH, 2501) if timepts is None else timepts
    return simulate(car, timepts, plan.inputs, initial_state=plan.state)


def shift_plan(
    car: Driveline,
    offgoing: str,
    oncoming: str,
    torque: float,
    engine_speed: float,
    torque_phase: float,
    speed_phase: float,
    start: float,
) -> Plan:
    """Signals of a shift, and the steady motion before it."""
    for clutch in (offgoing, oncoming):
        if clutch not in car.clutches:
            raise UnknownNameError("clutch", clutch, car.clutches, "in this driveline")
    if offgoing == oncoming:
        raise PowertrainError(f'offgoing and oncoming are both "{offgoing}", permitted: two clutches')
    old, new = car.lock(offgoing).release(oncoming), car.lock(oncoming).release(offgoing)
    driving = ends(old).driving
    before, after = _gear(old, driving, offgoing), _gear(new, driving, oncoming)
    if abs(before.ratio - after.ratio) < SAME_RATIO * abs(before.ratio):
        raise PowertrainError(
            f"{offgoing} and {oncoming} lead to the same ratio {before.ratio:g}, permitted: two gears"
        )
    is_torque_first = torque * (abs(after.ratio) - abs(before.ratio)) <= 0.0
    handing = start if is_torque_first else start + speed_phase
    turning_over = start + torque_phase if is_torque_first else start
    # speed behind the gears as the speed phase begins; what goes on then is the gear that carries
    carrying = after if is_torque_first else before
    speed = engine_speed / before.ratio + torque * before.acceleration * turning_over
    if is_torque_first:
        speed += 0.5 * torque * (after.acceleration - before.acceleration) * torque_phase
    reached = speed + torque * carrying.acceleration * speed_phase
    change = after.ratio * reached - before.ratio * speed
    side = inertia_at(car.release(offgoing, oncoming).part(driving), driving)
    slant, synchronous = SLANT * speed_phase, turning_over + speed_phase
    slipping = torque * carrying.carried * (1.0 if is_torque_first else SLIPS)
    level = slipping + side * change / (speed_phase - slant)
    off, on = (abs(torque * gear.carried) for gear in (before, after))
    off *= HOLDS if is_torque_first else SLIPS
    full_off, full_on = capacity_of(car, offgoing, off), capacity_of(car, oncoming, on)
    end = max(handing + torque_phase, synchronous)
    inputs = capacities_as_set(old) | {
        f"{driving}_torque": course(
            (turning_over, torque), (turning_over + slant, level), (synchronous - slant, level), (synchronous, torque)
        ),
        f"{offgoing}_capacity": course(
            (start - SWITCHED, full_off), (start, off), (handing, off), (handing + torque_phase, 0.0)
        ),
        f"{oncoming}_capacity": course(
            (handing, 0.0), (handing + torque_phase, on), (end, on), (end + SWITCHED, full_on)
        ),
    }
    return Plan(inputs, steady(old, driving, torque, engine_speed), driving, torque)


class _Gear(NamedTuple):
    """Ratio of the driving node to the vehicle; per driving torque the acceleration there and the torque of the clutch."""

    ratio: float
    acceleration: float
    carried: float


def _gear(car: Driveline, driving: str, clutch: str) -> _Gear:
    linear = driven(car).driveline
    part = linear.part(driving)
    behind = ends(car).vehicle or part.nodes[-1]
    if behind not in part.nodes or not {*car[clutch].nodes} <= {*part.nodes}:
        raise TopologyError(f'{clutch} does not connect "{driving}" with "{behind}", permitted: a clutch that drives')
    ratio = 1.0 / turning(part, driving)[behind]
    outputs = [f"{behind}_acceleration", f"{clutch}_torque"]
    acceleration, carried = static_gain(part, f"{driving}_torque", outputs)[:, 0].tolist()
    return _Gear(ratio, acceleration, carried)
