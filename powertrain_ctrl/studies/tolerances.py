"""Cars as they can turn out: scaled mass, stiffness and damping, other actuators, and the set a controller is proven on."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Sequence
from itertools import product
from typing import Any

import numpy as np

from ..base.checks import Factor, Number, Positive
from ..base.doors import checked
from ..base.errors import PowertrainError, TopologyError
from ..driveline.collection import Driveline, HasDriveline, rebuilt
from ..driveline.ends import driven
from ..elements import Backlash, Compliance, Drag, Element, Mass, MultiStageSpring, Shaft, SpringDamper, Tyre
from ..linear.assembly import as_driveline, assemble, kept
from ..linear.modal import modes
from ..reduction.halves import Cut
from ..reduction.twomass import TwoMass
from ..sampled.actuator import Directed, written
from ..sampled.plant import SampledPlant

# Modal damping ratios of the harder validation plant.
MODAL_DAMPING = (0.0964, 0.05, 0.03, 0.02)
# What delay and lag can become.
DELAYED, QUICK, SLOW = 2.0, 2.0 / 3.0, 5.0 / 3.0
# Share of the largest momentum in a mode below which a node is at rest.
AT_REST = 1e-12
_SPRINGS = (SpringDamper, Shaft, Drag, Tyre, Compliance, Backlash)


@checked
def variations(plant: SampledPlant) -> dict[str, SampledPlant]:
    """The plants a controller is proven on: one change at a time, corners, and a case that two masses hide.

    Vehicle mass +-25 %, all stiffness or that of the drive shafts +-20 %, twice the delay, 2/3 or 5/3 of the lag (20
    ms, 20 and 50 ms on the source's car), damping halved, modal damping; 16 corners of mass, stiffness, delay and
    lag; and halved damping with 2/3 of the lag, where a controller can drive the second mode unstable that no
    two-mass model has. A plant whose torque rises and falls differently keeps doing so, with both times multiplied; besides
    there is one with the faster of both, as margins are those of the slower.

    Parameters
    ----------
    plant : SampledPlant
        With a `Driveline` or a `TwoMass`.

    Returns
    -------
    dict
        Name to plant, 29 in all, fewer without lag or delay or where nothing but dampers holds the car together, one more
        where the torque rises and falls differently; "nominal" is the first.

    Raises
    ------
    TopologyError
        A driveline without an elastic mode.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> plants = pt.studies.variations(plant)
    >>> len(plants), plants["mass +25 %"].car["vehicle"].m, plants["delay 20 ms"].delay
    (29, 2500.0, 0.02)
    """
    return dict(_variations(plant))


@kept(16)
def _variations(plant: SampledPlant) -> dict[str, SampledPlant]:
    car = plant.car
    shafts = softest_shafts(car)
    change = dataclasses.replace
    late, quick, slow = _times(plant)
    plants = {
        "nominal": plant,
        "mass -25 %": change(plant, car=scale_mass(car, 0.75)),
        "mass +25 %": change(plant, car=scale_mass(car, 1.25)),
        "stiffness -20 %": change(plant, car=scale_stiffness(car, 0.8)),
        "stiffness +20 %": change(plant, car=scale_stiffness(car, 1.2)),
        "drive shafts -20 %": change(plant, car=scale_stiffness(car, 0.8, shafts)),
        "drive shafts +20 %": change(plant, car=scale_stiffness(car, 1.2, shafts)),
        f"delay {_ms(late)}": change(plant, delay=late),
        f"lag {_ms(quick)}": change(plant, lag=quick),
        f"lag {_ms(slow)}": change(plant, lag=slow),
        "damping halved": change(plant, car=scale_damping(car, 0.5)),
    }
    for little in _modally_damped(plant):
        plants["modal damping"] = little
    for mass, stiffness, delay, lag in product((0.75, 1.25), (0.8, 1.2), (plant.delay, late), (quick, slow)):
        name = f"corner m {mass:g} k {stiffness:g} delay {_ms(delay)} lag {_ms(lag)}"
        plants[name] = _corner(plant, mass, stiffness, delay, lag)
    plants[f"hidden: damping halved, lag {_ms(quick)}"] = change(plant, car=scale_damping(car, 0.5), lag=quick)
    for faster in _faster(plant):
        plants[f"faster of both: lag {_ms(faster.lag)}, delay {_ms(faster.delay)}"] = faster
    return plants


@kept(16)
def hard_ones(plant: SampledPlant) -> tuple[SampledPlant, ...]:
    """The nominal plant and those of its `variations` on which designs are decided: eight, or nine with a direction."""
    late, quick, slow = _times(plant)
    corners = (
        (0.75, 1.2, late, slow),
        (1.25, 1.2, late, slow),
        (1.25, 0.8, plant.delay, quick),
        (0.75, 1.2, late, quick),
        (1.25, 0.8, late, slow),
        (0.75, 0.8, late, slow),
    )
    hidden = dataclasses.replace(plant, car=scale_damping(plant.car, 0.5), lag=quick)
    corner_plants = (_corner(plant, *corner) for corner in corners)
    return plant, *corner_plants, hidden, *_modally_damped(plant), *_faster(plant)


def _modally_damped(plant: SampledPlant) -> tuple[SampledPlant, ...]:
    """The plant with modal damping; none where nothing but a damper holds the car together, as a tyre that only creeps."""
    car = with_modal_damping(plant.car)
    if len(car.driveline.parts()) > len(plant.car.driveline.parts()):
        return ()
    return (dataclasses.replace(plant, car=car),)


def _faster(plant: SampledPlant) -> tuple[SampledPlant, ...]:
    """The plant with the faster of both directions; none where there is but one."""
    if not plant.has_direction:
        return ()
    return (dataclasses.replace(plant, lag=min(plant.lags), delay=min(plant.delays)),)


def _times(plant: SampledPlant) -> tuple[Directed, Directed, Directed]:
    """What the delay can become, and the lag."""
    return _scaled(plant.delay, DELAYED), _scaled(plant.lag, QUICK), _scaled(plant.lag, SLOW)


def _scaled(time: Directed, factor: float) -> Directed:
    if isinstance(time, tuple):
        return _rounded(factor * time[0]), _rounded(factor * time[1])
    return _rounded(factor * time)


def _corner(plant: SampledPlant, mass: float, stiffness: float, delay: Directed, lag: Directed) -> SampledPlant:
    car = scale_stiffness(scale_mass(plant.car, mass), stiffness)
    return dataclasses.replace(plant, car=car, delay=delay, lag=lag)


def _ms(time: Directed) -> str:
    return written(time, 4)


def _rounded(time: float) -> float:
    """A time [s] without the last bits of a product: 2/3 of 0.03 s is 0.02 s."""
    return float(f"{time:.12g}")


@checked
def scale_mass(car: HasDriveline, factor: Positive) -> Driveline | TwoMass:
    """Driveline with its masses scaled; inertias stay. Of a two-mass model J2 is scaled, which is nearly all vehicle.

    Parameters
    ----------
    car : Driveline or TwoMass
    factor : float
        [-], > 0.

    Returns
    -------
    Driveline or TwoMass
        As given.

    Raises
    ------
    ParameterError
        A factor that is not > 0.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.studies.scale_mass(pt.examples.conventional(), 1.25)["vehicle"].m
    2500.0
    """
    if isinstance(car, TwoMass):
        return car.replace(J2=car.J2 * factor)
    return _changed(car, lambda e: {"m": e.m * factor} if isinstance(e, Mass) else {})


@checked
def scale_stiffness(
    car: HasDriveline, factor: Positive, names: str | Iterable[str] | None = None
) -> Driveline | TwoMass:
    """Driveline with the stiffness of its springs, tyres included, or of some of them scaled.

    Parameters
    ----------
    car : Driveline or TwoMass
    factor : float
        [-], > 0.
    names : str or iterable of str, optional
        Elements to scale; all if not given.

    Returns
    -------
    Driveline or TwoMass
        As given.

    Raises
    ------
    ParameterError
        A factor that the elements do not permit.
    UnknownNameError
        An element that is not there.
    PowertrainError
        An element without stiffness.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.studies.scale_stiffness(pt.examples.conventional(), 1.25, ["drive_shafts"])
    >>> car["drive_shafts"].stiffness, car["tyres"].stiffness
    (43000.0, 980000.0)
    """
    if isinstance(car, TwoMass) and names in (None, car.shaft, [car.shaft], (car.shaft,)):
        return car.replace(stiffness=car.stiffness * factor)
    car = as_driveline(car)
    chosen = None if names is None else (names,) if isinstance(names, str) else tuple(names)
    if chosen == ():
        raise PowertrainError("names is empty, permitted: at least one element, or None for all")
    for name in chosen or ():
        if not (getattr(car[name], "stiffness", 0.0) or isinstance(car[name], MultiStageSpring)):
            raise PowertrainError(f"{name} has no stiffness to scale")

    def values(e: Element) -> dict[str, Any]:
        if chosen is not None and e.name not in chosen:
            return {}
        if isinstance(e, MultiStageSpring):
            return {"torques": tuple(factor * torque for torque in e.torques)}
        return {"stiffness": e.stiffness * factor} if isinstance(e, _SPRINGS) and e.stiffness else {}

    return _changed(car, values)


@checked
def scale_damping(car: HasDriveline, factor: Factor) -> Driveline | TwoMass:
    """Driveline with its dampers, those of tyres and shafts included, scaled.

    Parameters
    ----------
    car : Driveline or TwoMass
    factor : float
        [-], >= 0.

    Returns
    -------
    Driveline or TwoMass
        As given.

    Raises
    ------
    ParameterError
        A negative factor, or 0 where an element is nothing but a damper.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.studies.scale_damping(pt.examples.conventional(), 0.5)["tyres"].damping
    5948.5
    """
    if isinstance(car, TwoMass):
        return car.replace(damping=car.damping * factor)
    damped = (*_SPRINGS, MultiStageSpring)
    return _changed(car, lambda e: {"damping": e.damping * factor} if isinstance(e, damped) else {})


@checked
def with_modal_damping(car: HasDriveline, damping_ratios: Sequence[Number] = MODAL_DAMPING) -> Driveline | TwoMass:
    """Driveline whose elastic modes have these damping ratios, the last for all that follow.

    Each mode gets a damper on its own coordinate ``phi^T M z``, with ``2 zeta omega``; all other dampers go, so what
    nothing but a damper held moves freely then.

    Parameters
    ----------
    car : Driveline or TwoMass
    damping_ratios : sequence of float
        zeta [-], > 0, at least one.

    Returns
    -------
    Driveline or TwoMass
        As given.

    Raises
    ------
    TopologyError
        A driveline that cannot be assembled.
    PowertrainError
        No damping ratio, or one that is not > 0.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.studies.with_modal_damping(pt.examples.conventional(), [0.1, 0.05])
    >>> pt.modes(car).damping_ratio.round(3)
    array([ nan, 0.1 , 0.05, 0.05, 0.05, 0.05, 0.05])
    """
    if not damping_ratios or not all(np.isfinite(zeta) and zeta > 0.0 for zeta in damping_ratios):
        raise PowertrainError(
            f"damping_ratios = {list(damping_ratios)!r}, permitted: at least one, each > 0 and finite"
        )
    if isinstance(car, TwoMass):
        return car.replace(damping=2.0 * damping_ratios[0] * car.omega / car.compliance_of_inertia)
    given = as_driveline(car)
    bare = _without_dampers(given)
    linear = driven(bare)
    model, result = assemble(linear), modes(linear)
    shapes = result.shapes[[model.nodes.index(name) for name in model.coordinates]]
    dampers = []
    for k, mode in enumerate(range(result.n_rigid, len(result))):
        phi = shapes[:, mode]
        row = model.M @ phi / np.sqrt(phi @ model.M @ phi)
        zeta = damping_ratios[min(k, len(damping_ratios) - 1)]
        # a node at rest in this mode has no part in it, also where rounding lets it move
        moving = np.abs(row) > AT_REST * np.abs(row).max()
        names = [name for name, moves in zip(model.coordinates, moving.tolist(), strict=True) if moves]
        coefficients = dict(zip(names, row[moving].tolist(), strict=True))
        damper = Compliance(
            f"mode_{k + 1}_damper", coefficients, stiffness=0.0, damping=2.0 * zeta * float(result.omega[mode])
        )
        dampers.append(damper)
    return rebuilt(given, [*bare, *dampers])


@checked
def softest_shafts(car: HasDriveline) -> tuple[str, ...]:
    """Names of the springs that twist most in the first elastic mode: one on each path from engine to vehicle.

    Parameters
    ----------
    car : Driveline or TwoMass

    Returns
    -------
    tuple of str
        Both half-shafts of an axle; where the driveline is not divided in two, the spring with most strain energy alone.

    Raises
    ------
    TopologyError
        A driveline without an elastic mode.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.studies.softest_shafts(pt.examples.conventional())
    ('drive_shafts',)
    """
    if isinstance(car, TwoMass):
        return (car.shaft,)
    car = driven(car)
    try:
        return tuple(Cut(as_driveline(car)).shafts)
    except TopologyError:
        result = modes(car)
    if len(result) == result.n_rigid:
        raise TopologyError("the driveline has no elastic mode")
    return (result.dominant_compliance(result.n_rigid),)


def _changed(car: HasDriveline, values: Callable[..., dict]) -> Driveline:
    car = as_driveline(car)
    new = {f"{element.name}.{name}": value for element in car for name, value in values(element).items()}
    return car.replace(new) if new else car


def _without_dampers(car: Driveline) -> Driveline:
    """Driveline without damping; what is nothing but a damper goes."""
    kept = rebuilt(car, [e for e in car if not (isinstance(e, _SPRINGS) and e.stiffness == 0.0)])
    damped = (*_SPRINGS, MultiStageSpring)
    return _changed(kept, lambda e: {"damping": 0.0} if isinstance(e, damped) else {})
