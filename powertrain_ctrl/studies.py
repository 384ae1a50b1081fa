"""Proof of a controller on the plants that a car can turn out to be."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from .assembly import as_driveline, assemble
from .driveline import Driveline
from .elements import Compliance, Drag, Mass, Shaft, SpringDamper, Tyre
from .errors import PowertrainError, TopologyError
from .loops import LoopMargins, loop_margins
from .metrics import RideMetrics, ride_metrics
from .modal import modes
from .response import Response
from .sampled import SampledPlant
from .signals import ramp
from .stepping import closed_loop
from .tables import html_table, text_table

__all__ = [
    "Proof",
    "Robustness",
    "prove",
    "residual_rms",
    "robustness",
    "scale_damping",
    "scale_mass",
    "scale_stiffness",
    "softest_shaft",
    "tip_in",
    "tip_in_metrics",
    "tip_out",
    "variations",
    "wheel_disturbance",
    "with_modal_damping",
]

# The tip-in: torque [N m], ramp [s], start [s], end [s].
TORQUE, RAMP, START, END = 250.0, 0.1, 0.5, 4.0
# The wheel disturbance: peak torque at the wheels [N m], half-sine of that length [s].
PULSE, PULSE_LENGTH = 800.0, 0.1
# The residual counts from so long after the pulse on [s], about when a controller can have answered it.
ANSWER = 0.05
# Modal damping ratios of the harder validation plant.
MODAL_DAMPING = (0.0964, 0.05, 0.03, 0.02)


# --- manoeuvres


def tip_in(plant: SampledPlant, controller=None, torque: float = TORQUE, duration: float = RAMP, **options) -> Response:
    """Response to a torque demand that rises from 0 to ``torque`` in ``duration`` from t = 0.5 s on.

    Parameters
    ----------
    plant : SampledPlant
    controller : control.StateSpace, control.NonlinearIOSystem or None
        As in `closed_loop`.
    torque : float
        Final demand [N m].
    duration : float
        Of the ramp [s], >= 0.
    **options
        Of `closed_loop`; its ``duration``, the end of the response, is 4 s here.

    Returns
    -------
    Response
        Signals of `closed_loop`.

    Raises
    ------
    PowertrainError
        As of `closed_loop`.

    Examples
    --------
    Without a controller the acceleration goes 61 % beyond its final 3.89 m/s^2:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> acceleration = pt.tip_in(plant)["vehicle_acceleration"]
    >>> round(float(acceleration.max()), 2), round(250.0 * plant.final_acceleration, 2)
    (6.24, 3.89)
    """
    return closed_loop(plant, controller, ramp(START, duration, torque), **{"duration": END, **options})


def tip_out(
    plant: SampledPlant, controller=None, torque: float = TORQUE, duration: float = RAMP, **options
) -> Response:
    """Response to a torque demand that falls from ``torque``, in balance with the load, to 0.

    Parameters
    ----------
    plant, controller : SampledPlant; control.StateSpace, control.NonlinearIOSystem or None
        As in `tip_in`.
    torque, duration : float
        Demand before the ramp [N m], within the torque limits; length of the ramp [s].
    **options
        As in `tip_in`.

    Returns
    -------
    Response
        Signals of `closed_loop`.

    Raises
    ------
    PowertrainError
        As of `closed_loop`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> response = pt.tip_out(plant)
    >>> response["torque_demand"][[0, -1]], round(float(response["vehicle_acceleration"].min()), 2)
    (array([250.,   0.]), -6.24)
    """
    demand = ramp(START, duration, 0.0, torque)
    return closed_loop(plant, controller, demand, **{"duration": END, "initial_torque": torque, **options})


def wheel_disturbance(plant: SampledPlant, controller=None, torque: float = PULSE, **options) -> Response:
    """Response to a half-sine of 100 ms against the vehicle from t = 0.5 s on, in steady driving.

    The demand stays at the initial torque, halfway between the torque limits if not given.

    Parameters
    ----------
    plant : SampledPlant
    controller : control.StateSpace, control.NonlinearIOSystem or None
        As in `closed_loop`.
    torque : float
        Peak at the wheels [N m].
    **options
        Of `closed_loop`; its ``duration`` is 4 s here.

    Returns
    -------
    Response
        Signals of `closed_loop`.

    Raises
    ------
    PowertrainError
        As of `closed_loop`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> response = pt.wheel_disturbance(plant)
    >>> float(response["torque_demand"][0]), round(float(response["vehicle_acceleration"].min()), 2)
    (175.0, -1.03)
    """
    force = _HalfSine(-torque / plant.vehicle_radius)
    level = 0.5 * sum(plant.torque_limits)
    options = {"duration": END, "initial_torque": level, **options}
    return closed_loop(plant, controller, lambda t: options["initial_torque"], disturbance=force, **options)


@dataclass(frozen=True)
class _HalfSine:
    """Pulse of the wheel disturbance."""

    peak: float

    def __call__(self, t: float) -> float:
        phase = (t - START) / PULSE_LENGTH
        return self.peak * np.sin(np.pi * phase) if 0.0 < phase < 1.0 else 0.0


def tip_in_metrics(plant: SampledPlant, response: Response, torque: float = TORQUE) -> RideMetrics:
    """Ride metrics of a `tip_in`, or with a negative torque of a `tip_out`.

    Parameters
    ----------
    plant : SampledPlant
    response : Response
        Of that plant.
    torque : float
        Change of the torque [N m], not 0.

    Returns
    -------
    RideMetrics

    Raises
    ------
    PowertrainError
        Torque 0.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> metrics = pt.studies.tip_in_metrics(plant, pt.tip_in(plant))
    >>> round(metrics.overshoot, 3), round(metrics.t90, 3)
    (0.605, 0.176)
    """
    return ride_metrics(response.time, response["vehicle_acceleration"], torque * plant.final_acceleration, START)


def residual_rms(response: Response) -> float:
    """Root mean square of the vehicle acceleration of `wheel_disturbance` from 50 ms after its pulse on.

    Parameters
    ----------
    response : Response

    Returns
    -------
    float
        [m/s^2].

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> [round(pt.studies.residual_rms(pt.wheel_disturbance(plant, each)), 3) for each in (None, controller)]
    [0.078, 0.027]
    """
    after = response.time >= START + PULSE_LENGTH + ANSWER
    return float(np.sqrt(np.mean(response["vehicle_acceleration"][after] ** 2)))


# --- plants


def variations(plant: SampledPlant) -> dict[str, SampledPlant]:
    """The plants a controller is proven on: one change at a time, corners, and a case that two masses hide.

    Vehicle mass +-25 %, all stiffness or that of the drive shafts +-20 %, delay 20 ms, lag 20 or 50 ms, damping halved,
    modal damping; 16 corners of mass, stiffness, delay and lag; and halved damping with a lag of 20 ms, where
    a controller can drive the second mode unstable that no two-mass model has.

    Parameters
    ----------
    plant : SampledPlant
        With a `Driveline` or a `TwoMass`.

    Returns
    -------
    dict
        Name to plant, 29 in all; "nominal" is the first.

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
    car = as_driveline(plant.car)
    change = dataclasses.replace
    plants = {
        "nominal": plant,
        "mass -25 %": change(plant, car=scale_mass(car, 0.75)),
        "mass +25 %": change(plant, car=scale_mass(car, 1.25)),
        "stiffness -20 %": change(plant, car=scale_stiffness(car, 0.8)),
        "stiffness +20 %": change(plant, car=scale_stiffness(car, 1.2)),
        "drive shafts -20 %": change(plant, car=scale_stiffness(car, 0.8, [softest_shaft(car)])),
        "drive shafts +20 %": change(plant, car=scale_stiffness(car, 1.2, [softest_shaft(car)])),
        "delay 20 ms": change(plant, delay=0.02),
        "lag 20 ms": change(plant, lag=0.02),
        "lag 50 ms": change(plant, lag=0.05),
        "damping halved": change(plant, car=scale_damping(car, 0.5)),
        "modal damping": change(plant, car=with_modal_damping(car)),
    }
    for mass, stiffness, delay, lag in product((0.75, 1.25), (0.8, 1.2), (0.01, 0.02), (0.02, 0.05)):
        name = f"corner m {mass:g} k {stiffness:g} delay {1e3 * delay:g} ms lag {1e3 * lag:g} ms"
        corner = scale_stiffness(scale_mass(car, mass), stiffness)
        plants[name] = change(plant, car=corner, delay=delay, lag=lag)
    plants["hidden: damping halved, lag 20 ms"] = change(plant, car=scale_damping(car, 0.5), lag=0.02)
    return plants


def scale_mass(car: Driveline, factor: float) -> Driveline:
    """Driveline with its masses scaled; inertias stay.

    Parameters
    ----------
    car : Driveline
    factor : float
        [-], > 0.

    Returns
    -------
    Driveline

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
    return _changed(car, lambda e: {"m": e.m * factor} if isinstance(e, Mass) else {})


def scale_stiffness(car: Driveline, factor: float, names: Iterable[str] | None = None) -> Driveline:
    """Driveline with the stiffness of its springs, tyres included, or of some of them scaled.

    Parameters
    ----------
    car : Driveline
    factor : float
        [-], > 0.
    names : iterable of str, optional
        Elements to scale; all if not given.

    Returns
    -------
    Driveline

    Raises
    ------
    ParameterError
        A factor that the elements do not permit.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.studies.scale_stiffness(pt.examples.conventional(), 1.25, ["drive_shafts"])
    >>> car["drive_shafts"].stiffness, car["tyres"].stiffness
    (43000.0, 980000.0)
    """
    chosen = None if names is None else set(names)

    def values(e):
        stiff = isinstance(e, _SPRINGS) and e.stiffness
        return {"stiffness": e.stiffness * factor} if stiff and (chosen is None or e.name in chosen) else {}

    return _changed(car, values)


def scale_damping(car: Driveline, factor: float) -> Driveline:
    """Driveline with its dampers, those of tyres and shafts included, scaled.

    Parameters
    ----------
    car : Driveline
    factor : float
        [-], >= 0.

    Returns
    -------
    Driveline

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
    return _changed(car, lambda e: {"damping": e.damping * factor} if isinstance(e, _SPRINGS) else {})


_SPRINGS = (SpringDamper, Shaft, Drag, Tyre, Compliance)


def with_modal_damping(car: Driveline, damping_ratios: Sequence[float] = MODAL_DAMPING) -> Driveline:
    """Driveline whose elastic modes have these damping ratios, the last for all that follow.

    Each mode gets a damper on its own coordinate ``phi^T M z``, with ``2 zeta omega``; all other dampers go, so what
    nothing but a damper held moves freely then.

    Parameters
    ----------
    car : Driveline
    damping_ratios : sequence of float
        zeta [-], > 0, at least one.

    Returns
    -------
    Driveline

    Raises
    ------
    TopologyError
        A driveline that cannot be assembled.
    ParameterError
        A damping ratio that is not > 0.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.studies.with_modal_damping(pt.examples.conventional(), [0.1, 0.05])
    >>> pt.modes(car).damping_ratio.round(3)
    array([ nan, 0.1 , 0.05, 0.05, 0.05, 0.05, 0.05])
    """
    bare = _without_dampers(car)
    model, result = assemble(bare), modes(bare)
    shapes = result.shapes[[model.nodes.index(name) for name in model.coordinates]]
    dampers = []
    for k, mode in enumerate(range(result.n_rigid, len(result))):
        phi = shapes[:, mode]
        row = model.M @ phi / np.sqrt(phi @ model.M @ phi)
        zeta = damping_ratios[min(k, len(damping_ratios) - 1)]
        coefficients = {name: float(c) for name, c in zip(model.coordinates, row, strict=True) if c}
        damper = Compliance(
            f"mode_{k + 1}_damper", coefficients, stiffness=0.0, damping=2.0 * zeta * float(result.omega[mode])
        )
        dampers.append(damper)
    return Driveline(*bare, *dampers).release(*car.released) if car.released else Driveline(*bare, *dampers)


def softest_shaft(car: Driveline) -> str:
    """Name of the spring that holds most of the strain energy of the first elastic mode.

    Parameters
    ----------
    car : Driveline or TwoMass

    Returns
    -------
    str

    Raises
    ------
    TopologyError
        A driveline without an elastic mode.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.studies.softest_shaft(pt.examples.conventional())
    'drive_shafts'
    """
    result = modes(car)
    if len(result) == result.n_rigid:
        raise TopologyError("the driveline has no elastic mode")
    return result.dominant_compliance(result.n_rigid)


def _changed(car: Driveline, values: Callable[..., dict]) -> Driveline:
    for element in car:
        if new := values(element):
            car = car.replace(element.name, **new)
    return car


def _without_dampers(car: Driveline) -> Driveline:
    """Driveline without damping; what is nothing but a damper goes."""
    kept = Driveline(*(e for e in car if not (isinstance(e, _SPRINGS) and e.stiffness == 0.0)))
    kept = kept.release(*car.released) if car.released else kept
    return _changed(kept, lambda e: {"damping": 0.0} if isinstance(e, _SPRINGS) else {})


# --- proof


@dataclass(frozen=True)
class Proof:
    """A controller on one plant, against the same plant in open loop.

    Attributes
    ----------
    margins : LoopMargins
        Of the closed loop.
    metrics, open_metrics : RideMetrics
        Of the tip-in, closed and open loop; nan in an unstable closed loop.
    oscillation_reduction : float
        One minus peak-to-peak over that of the open loop [-]; -inf if unstable.
    t90_ratio : float
        Over that of the open loop [-]; inf if unstable.
    disturbance_reduction : float
        One minus the residual RMS after a wheel disturbance over that of the open loop [-]; -inf if unstable.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.designs(plant)["proven"]
    >>> proof = pt.studies.prove(plant, controller)
    >>> less = 1.0 - proof.metrics.peak_to_peak / proof.open_metrics.peak_to_peak
    >>> proof.margins.stable, round(less, 2), round(proof.oscillation_reduction, 2)
    (True, 0.98, 0.98)
    """

    margins: LoopMargins
    metrics: RideMetrics
    open_metrics: RideMetrics
    oscillation_reduction: float
    t90_ratio: float
    disturbance_reduction: float


@dataclass(frozen=True, eq=False, repr=False)
class Robustness:
    """Proof on every plant; ``robustness["nominal"]`` is one of them.

    Attributes
    ----------
    proofs : dict
        Plant name to `Proof`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> heavy = pt.SampledPlant(car=pt.studies.scale_mass(plant.car, 1.25))
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> result = pt.robustness(plant, controller, {"nominal": plant, "heavy": heavy})
    >>> result
    plant    stable  zeta 1st  zeta 2nd  disk margin  p2p [%]  p2p less [%]  t90 ratio  disturbance less [%]
    nominal  yes        0.269     0.051         1.02     27.5          73.7       1.08                    65
    heavy    yes        0.280     0.051         1.02     26.3          75.7       1.08                    66
    >>> name, damping_ratio = result.worst("zeta_first")
    >>> name, round(damping_ratio, 3), result["heavy"].margins.stable
    ('nominal', 0.269, True)
    """

    proofs: dict[str, Proof]

    def __getitem__(self, name: str) -> Proof:
        return self.proofs[name]

    @property
    def stable(self) -> bool:
        """Whether the loop is stable on every plant."""
        return all(proof.margins.stable for proof in self.proofs.values())

    def worst(self, quantity: str, among: Callable[[str], bool] = lambda name: True) -> tuple[str, float]:
        """Plant and value that are worst in a quantity of the proofs.

        Parameters
        ----------
        quantity : str
            "zeta_first", "zeta_second", "disk_margin", "oscillation_reduction", "disturbance_reduction", of which the
            least is worst; "t90_ratio", "overshoot", "peak_to_peak", "peak_jerk", "vdv", of which the largest is.
        among : callable
            Whether a plant of this name counts; all if not given.

        Returns
        -------
        name : str
        value : float
            nan if it is nan on every plant.

        Raises
        ------
        PowertrainError
            A quantity that proofs do not have, or no plant that counts.
        """
        values = {name: _quantity(proof, quantity) for name, proof in self.proofs.items() if among(name)}
        if not values:
            raise PowertrainError("there is no such plant among those proven")
        known = {name: value for name, value in values.items() if not np.isnan(value)}
        if not known:
            return next(iter(values)), float("nan")
        pick = max if quantity in _SMALL_IS_GOOD else min
        name = pick(known, key=known.__getitem__)
        return name, known[name]

    headers = (
        "plant",
        "stable",
        "zeta 1st",
        "zeta 2nd",
        "disk margin",
        "p2p [%]",
        "p2p less [%]",
        "t90 ratio",
        "disturbance less [%]",
    )

    def rows(self) -> list[list[str]]:
        """Rows of the printed table."""
        return [
            [
                name,
                "yes" if p.margins.stable else "NO",
                f"{p.margins.zeta_first:.3f}",
                f"{p.margins.zeta_second:.3f}",
                f"{p.margins.disk_margin:.2f}",
                f"{100 * p.metrics.peak_to_peak:.1f}",
                f"{100 * p.oscillation_reduction:.1f}",
                f"{p.t90_ratio:.2f}",
                f"{100 * p.disturbance_reduction:.0f}",
            ]
            for name, p in self.proofs.items()
        ]

    def __repr__(self) -> str:
        return text_table(self.headers, self.rows())

    def _repr_html_(self) -> str:
        return html_table(self.headers, self.rows())


_SMALL_IS_GOOD = ("t90_ratio", "overshoot", "peak_to_peak", "peak_jerk", "vdv")


def _quantity(proof: Proof, name: str) -> float:
    for record in (proof, proof.margins, proof.metrics):
        if hasattr(record, name):
            return float(getattr(record, name))
    raise PowertrainError(f'"{name}" is not a quantity of a proof')


def robustness(plant: SampledPlant, controller, plants: Mapping[str, SampledPlant] | None = None) -> Robustness:
    """Prove a controller on many plants: stability, margins, tip-in and wheel disturbance, each against open loop.

    Parameters
    ----------
    plant : SampledPlant
        Nominal plant.
    controller : control.StateSpace or None
        Fixed, as designed for the nominal plant.
    plants : mapping, optional
        Name to plant; `variations` of the nominal plant if not given.

    Returns
    -------
    Robustness

    Raises
    ------
    PowertrainError
        A controller that does not fit or is not linear.
    TopologyError
        `variations` of a driveline without an elastic mode.

    Examples
    --------
    On two of the 29 plants:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.designs(plant)["proven"]
    >>> plants = {name: pt.studies.variations(plant)[name] for name in ("nominal", "lag 50 ms")}
    >>> result = pt.robustness(plant, controller, plants)
    >>> result.stable, [round(100 * proof.oscillation_reduction) for proof in result.proofs.values()]
    (True, [98, 98])
    """
    plants = variations(plant) if plants is None else dict(plants)
    return Robustness({name: prove(each, controller) for name, each in plants.items()})


def prove(plant: SampledPlant, controller) -> Proof:
    """Margins, tip-in and wheel disturbance of a controller on one plant, against the open loop.

    Parameters
    ----------
    plant : SampledPlant
    controller : control.StateSpace or None
        As in `loop_margins`.

    Returns
    -------
    Proof
        Of an unstable loop without metrics.

    Raises
    ------
    PowertrainError
        A controller that does not fit or is not linear.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> proof = pt.studies.prove(plant, controller)
    >>> round(proof.oscillation_reduction, 2), round(proof.t90_ratio, 2), round(proof.disturbance_reduction, 2)
    (0.74, 1.08, 0.65)
    """
    margins = loop_margins(plant, controller)
    open_metrics, open_rms = _open_loop(plant)
    if not margins.stable:
        nan = float("nan")
        lost = RideMetrics(*[nan] * len(dataclasses.fields(RideMetrics)))
        return Proof(margins, lost, open_metrics, -np.inf, np.inf, -np.inf)
    metrics = tip_in_metrics(plant, tip_in(plant, controller))
    return Proof(
        margins,
        metrics,
        open_metrics,
        1.0 - metrics.peak_to_peak / open_metrics.peak_to_peak,
        metrics.t90 / open_metrics.t90,
        1.0 - residual_rms(wheel_disturbance(plant, controller)) / open_rms,
    )


def _open_loop(plant: SampledPlant) -> tuple[RideMetrics, float]:
    if "_open_loop" not in plant.__dict__:
        known = tip_in_metrics(plant, tip_in(plant)), residual_rms(wheel_disturbance(plant))
        plant.__dict__["_open_loop"] = known
    return plant.__dict__["_open_loop"]
