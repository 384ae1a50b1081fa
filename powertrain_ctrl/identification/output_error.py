"""Parameters of a car from measured runs: output error, with the noise of measured torques in its model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError, UnknownNameError
from ..driveline.collection import HasDriveline
from ..hybrid.model import plants_of
from ..linear.assembly import TorsionalModel
from .advice import not_determined
from .channels import Channels, channels, require_length
from .fitting import Fit, Found
from .identified import Identified, Validation
from .prediction import LinearPrediction, Prediction, SimulatedPrediction
from .unknowns import Unknowns

# A response of this package or of python-control; the door holds it to that.
Run = Any


@checked
def identify(
    car: HasDriveline,
    run: Run | Sequence[Run],
    parameters: Iterable[str],
    delays: Iterable[str] = (),
    road_load: bool = False,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    signals: Iterable[str] | None = None,
) -> Identified:
    """Values of parameters with which a car does what was measured, with their standard errors.

    The car is driven by the measured torques, on straight lines between their samples, and its outputs are fitted to the
    measured ones. An offset of each output and the state at the start are found besides. Cars with play or slipping clutches
    are simulated exactly and start in steady motion under their first torques.

    Parameters
    ----------
    car : Driveline or TwoMass
        With values to start from, 20 to 40 % off at best.
    run : Response, Signals or control.TimeResponseData, or list of them
        Inputs and outputs of the car by their names; several runs share the parameters and delays.
    parameters : list of str
        "element.value", as "drive_shafts.stiffness" or "vehicle.m"; of a `TwoMass` its fields, as "J1".
    delays : list of str, optional
        Signals whose delay is unknown: positive means that a torque acts later than it is recorded, and that a speed is
        recorded later than it happened.
    road_load : bool
        Whether an unknown constant force acts on the vehicle (or torque on the largest inertia) in each run.
    bounds : dict, optional
        Parameter to the least and largest value; otherwise a thirtieth and thirty times the start.
    signals : list of str, optional
        Outputs to fit; None means all that are measured, of a simulated response all speeds.

    Returns
    -------
    Identified

    Raises
    ------
    UnknownNameError
        An element, parameter or signal that is not there.
    ParameterError
        A parameter that starts at 0.
    SignalError
        A run without inputs or outputs of this car, signals that do not change, an input with a gap.
    PowertrainError
        Runs too short for so many unknowns, a delay given twice, a road load that is measured, bounds without the start.

    Notes
    -----
    Sensors are taken to have white noise and so are measured inputs, whose errors the car integrates to a slow random walk.
    The levels of both are those that make what is left most likely; parameters are found by generalised least squares
    under this noise (Ljung, System Identification, 2nd ed. (1999), section 7.2), and the standard errors are those of it. A
    noisy input also pulls parameters to one side (errors in variables, Söderström, Automatica 43 (2007) 939-958); that is
    computed and taken off. On 400 simulated test drives the 95 % intervals of four parameters held the truth in 93 to 96 %
    of the drives (``python -m benchmarks.coverage``).

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car, t = pt.examples.conventional(), np.arange(0.0, 4.0, 0.01)
    >>> run = pt.simulate(car, t, {"engine_torque": np.interp(t, [0.5, 0.6, 2.0, 2.1], [0.0, 100.0, 100.0, 20.0])})
    >>> guess = car.replace("drive_shafts", stiffness=2.5e4).replace("vehicle", m=2300.0)
    >>> found = pt.identify(guess, run, ["drive_shafts.stiffness", "vehicle.m"], signals=["engine_speed", "wheels_speed"])
    >>> {name: round(value, 3) for name, value in found.values.items()}
    {'drive_shafts.stiffness': 34400.0, 'vehicle.m': 2000.0}
    """
    unknowns = Unknowns(car, tuple(parameters), bounds)
    if not unknowns.names:
        raise PowertrainError('no parameter is given, permitted: at least one, such as "drive_shafts.stiffness"')
    given = list(run) if isinstance(run, list | tuple) else [run]
    delayed = tuple(delays)
    predictions, laws = _predictions(
        car, given, unknowns, delayed, road_load, None if signals is None else tuple(signals)
    )
    _check_delayed(delayed, predictions)
    if len(set(delayed)) < len(delayed):
        raise PowertrainError(f"delays {list(delayed)}, permitted: each signal once")
    columns = sum(len(prediction.known) for prediction in predictions)
    require_length([prediction.run for prediction in predictions], len(unknowns.names) + len(delayed) + columns)
    fit = Fit(unknowns, delayed, predictions, laws and road_load)
    return _identified(fit, fit.found())


@checked
def validate(
    car: HasDriveline,
    run: Run,
    delays: Mapping[str, float] | None = None,
    road_load: bool = False,
    signals: Iterable[str] | None = None,
) -> Validation:
    """A car beside a run that it was not fitted to: model over measured, fit, and what is left.

    Parameters
    ----------
    car : Driveline or TwoMass
        As the ``car`` of an `Identified`.
    run : Response, Signals or control.TimeResponseData
        Best one that was not used to find the car.
    delays : dict, optional
        Signal to delay [s], as the ``delays`` of an `Identified`.
    road_load : bool
    signals : list of str, optional
        As of `identify`.

    Returns
    -------
    Validation

    Raises
    ------
    UnknownNameError
        A signal that is not there.
    SignalError
        A run without inputs or outputs of this car, signals that do not change, an input with a gap.
    PowertrainError
        A road load that is measured.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car, t = pt.examples.conventional(), np.arange(0.0, 3.0, 0.01)
    >>> run = pt.simulate(car, t, {"engine_torque": np.interp(t, [0.5, 0.6], [0.0, 100.0])})
    >>> pt.validate(car, run, signals=["engine_speed", "wheels_speed"])
    Validation on run: engine_speed 100.0 %, wheels_speed 100.0 %
    """
    delays = dict(delays or {})
    unknowns = Unknowns(car, ())
    wanted = None if signals is None else tuple(signals)
    predictions, laws = _predictions(car, [run], unknowns, tuple(delays), road_load, wanted)
    _check_delayed(tuple(delays), predictions)
    fit = Fit(unknowns, tuple(delays), predictions, laws and road_load)
    return fit.validations(fit.held_at(np.array(list(delays.values()), dtype=float)))[0]


def _predictions(
    car: HasDriveline,
    runs: Sequence[Any],
    unknowns: Unknowns,
    delayed: Sequence[str],
    road_load: bool,
    wanted: Sequence[str] | None,
) -> tuple[list[Prediction], bool]:
    """One prediction a run, and whether they are simulated."""
    plants = plants_of(car)
    if not runs:
        raise PowertrainError("no run is given, permitted: at least one")
    used = [channels(each, plants.inputs, plants.outputs, wanted) for each in runs]
    moved = any(_changes(each, name) for each in used for name in each.inputs if name.endswith("_capacity"))
    laws = moved or any(not law.is_clutch for law in plants.model.laws)
    road = _road_input(plants.model) if road_load else None
    found: list[Prediction] = []
    for number, each in enumerate(used):
        if road in each.inputs:
            raise PowertrainError(f"road_load: {road} is measured, permitted: road_load=False")
        if laws:
            found.append(SimulatedPrediction(each, unknowns, delayed, road, number))
        else:
            driving = {name: pair for name, pair in each.inputs.items() if name in plants.model.inputs}
            found.append(LinearPrediction(each._replace(inputs=driving), unknowns, delayed, road))
    return found, laws


def _changes(run: Channels, name: str) -> bool:
    return bool(np.ptp(run.inputs[name][1]))


def _road_input(model: TorsionalModel) -> str:
    """Force on what moves along the road, or torque on the inertia that is largest as seen from the rest."""
    forces = [name for name in model.inputs if name.endswith("_force")]
    if forces:
        return forces[0]
    reflected = np.diag(model.J) * model.rigid_motion**2
    nodes = [model.nodes.index(name.removesuffix("_torque")) for name in model.inputs]
    return model.inputs[int(np.argmax(reflected[nodes]))]


def _check_delayed(delayed: Sequence[str], predictions: Sequence[Prediction]) -> None:
    used = sorted({name for each in predictions for name in (*each.run.inputs, *each.run.outputs)})
    for signal in delayed:
        if signal not in used:
            raise UnknownNameError("delayed signal", signal, used, "measured in these runs")


def _identified(fit: Fit, found: Found) -> Identified:
    point, analysis, unknowns = found.point, found.analysis, fit.unknowns
    count = len(unknowns.names)
    q, delays = point.p[:count], point.p[count : fit.own]
    values = unknowns.values(q)
    errors = np.sqrt(np.diag(analysis.covariance)) * np.concatenate([np.abs(values), np.ones(len(delays))])
    for i in analysis.lost:
        errors[i] = np.nan
    names = (*unknowns.names, *fit.delayed)
    noise: dict[str, float] = {}
    for prediction, levels in zip(fit.predictions, found.levels, strict=True):
        noise |= dict(
            zip((*prediction.near.run.inputs, *prediction.run.outputs), np.concatenate(levels).tolist(), strict=True)
        )
    return Identified(
        car=unknowns.car_at(q),
        start=unknowns.car,
        values={
            n: np.nan if i in analysis.lost else float(v)
            for i, (n, v) in enumerate(zip(unknowns.names, values, strict=True))
        },
        standard_errors=dict(zip(names, errors.tolist(), strict=True)),
        delays={
            n: np.nan if count + i in analysis.lost else float(v)
            for i, (n, v) in enumerate(zip(fit.delayed, delays, strict=True))
        },
        correlation=analysis.correlation,
        not_determined=not_determined(fit, found),
        noise=noise,
        runs=fit.validations(point),
        before=fit.validations(fit.held_at(np.zeros(len(delays)))),
        units={parameter.name: parameter.unit for parameter in unknowns.parameters},
    )
