"""The source's two manoeuvres: load change and launch."""

from __future__ import annotations

import numpy as np

from ..base.checks import Capacity, Duration, Seconds, Speed, Torque
from ..base.doors import checked
from ..base.errors import TopologyError
from ..base.units import rpm
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.ends import ends
from ..elements import Constraint
from ..linear.assembly import as_driveline, assemble_with_laws
from .response import Response
from .signals import Times, ramp
from .simulation import simulate, simulate_as_set
from .starts import initial_speeds


@checked
def load_change(
    car: HasDriveline,
    torque: Torque = 250.0,
    duration: Duration = 0.2,
    start: Seconds = 1.0,
    engine_speed: Speed = rpm(2000.0),
    timepts: Times | None = None,
) -> Response:
    """Response to a torque ramp at the engine; the clutches stay as they are, locked or released (Figs. 2.7, 2.9).

    Everything turns as one body until the torque rises from 0 to ``torque`` in ``duration``. The response is exact.

    Parameters
    ----------
    car : Driveline or TwoMass
        Its engine is the node of that name, otherwise the first node.
    torque : float
        Final engine torque [N m].
    duration, start : float
        Of the ramp [s]; duration >= 0.
    engine_speed : float
        Before the ramp [rad/s].
    timepts : (N,) array_like, optional
        [s]; every 2 ms to 2.6 s if not given.

    Returns
    -------
    Response

    Raises
    ------
    ParameterError
        A ramp that is not possible.
    SignalError
        Times that are not possible.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> response = pt.load_change(pt.examples.conventional())
    >>> round(float(response["vehicle_acceleration"].max()), 2)
    5.68
    """
    car = as_driveline(car)
    engine = ends(car).engine
    timepts = np.linspace(0.0, 2.6, 1301) if timepts is None else timepts
    inputs = {f"{engine}_torque": ramp(start, duration, torque)}
    return simulate_as_set(car, timepts, inputs, _as_one_body(car, engine, engine_speed))


def _as_one_body(car: Driveline, engine: str, speed: float) -> dict[str, float]:
    """Speeds to start with, also of turbines, which without slip turn with their pumps."""
    slipping = [e for e in car if any(law.regions for law in e.laws)]
    if not slipping:
        return {engine: speed}
    rigid = [Constraint(e.name, dict(zip(e.nodes, (1.0, -1.0), strict=True))) if e in slipping else e for e in car]
    tied = Driveline(*rigid)
    model = assemble_with_laws(tied.release(*car.released) if car.released else tied)
    turning = dict(zip(model.nodes, model.T @ initial_speeds(model, {engine: speed}), strict=True))
    return {node: float(turning[node]) for node in (engine, *(node for e in slipping for node in e.nodes))}


@checked
def launch(
    car: HasDriveline,
    torque: Torque = 350.0,
    capacity: Capacity = 370.0,
    duration: Duration = 0.22,
    start: Seconds = 1.5,
    engine_speed: Speed = rpm(5000.0),
    timepts: Times | None = None,
) -> Response:
    """Race start: the engine runs, all else rests; clutch capacity and torque rise together (Figs. 2.11, 2.13).

    The source gives neither end points nor durations of its ramps; those preset here let the slip end at
    the printed 2.65 s with one clean lock.

    Parameters
    ----------
    car : Driveline or SwitchedTwoMass
        With one clutch. Its engine is the node of that name, otherwise the first node.
    torque, capacity : float
        Final engine torque and clutch capacity [N m]; capacity >= 0. It takes the place of the clutch's ``max_torque``.
    duration, start : float
        Of both ramps [s]; duration >= 0.
    engine_speed : float
        At the beginning [rad/s]; what the springs connect with the engine turns with it.
    timepts : (N,) array_like, optional
        [s]; every 1 ms to 3.5 s if not given.

    Returns
    -------
    Response

    Raises
    ------
    TopologyError
        A driveline with no clutch or more than one.
    ParameterError
        A ramp that is not possible.
    SignalError
        Times that are not possible, a negative capacity.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.launch(pt.examples.conventional(damping="open"))
    Response: 0 to 3.5 s, 3501 samples, 35 outputs, 2 events
    t [s]     element  event  heat so far [kJ]
    1.500000  clutch   slip              0.000
    2.650596  clutch   lock            100.214
    """
    driveline = as_driveline(car)
    engine, clutches = ends(driveline).engine, driveline.clutches
    if len(clutches) != 1:
        raise TopologyError(f"launch needs one clutch, there are {len(clutches)}; use simulate")
    timepts = np.linspace(0.0, 3.5, 3501) if timepts is None else timepts
    inputs = {
        f"{engine}_torque": ramp(start, duration, torque),
        f"{clutches[0]}_capacity": ramp(start, duration, capacity),
    }
    return simulate(car, timepts, inputs, {engine: engine_speed})
