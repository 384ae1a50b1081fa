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
    torque : float
        [N m].
    duration : float
        [s].
    **options
        Of `closed_loop`.

    Returns
    -------
    Response
    """
    return closed_loop(plant, controller, ramp(START, duration, torque), **{"duration": END, **options})


def tip_out(
    plant: SampledPlant, controller=None, torque: float = TORQUE, duration: float = RAMP, **options
) -> Response:
    """Response to a torque demand that falls from ``torque``, in balance with the load, to 0.

    Parameters are those of `tip_in`.
    """
    demand = ramp(START, duration, 0.0, torque)
    return closed_loop(plant, controller, demand, **{"duration": END, "initial_torque": torque, **options})


def wheel_disturbance(plant: SampledPlant, controller=None, torque: float = PULSE, **options) -> Response:
    """Response to a half-sine of 100 ms against the vehicle, ``torque`` [N m] at the wheels, in steady driving.

    Parameters
    ----------
    plant : SampledPlant
    controller : control.StateSpace, control.NonlinearIOSystem or None
    torque : float
        Peak [N m].
    **options
        Of `closed_loop`.

    Returns
    -------
    Response
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
    """Ride metrics of a `tip_in`, or with a negative torque of a `tip_out`."""
    return ride_metrics(response.time, response["vehicle_acceleration"], torque * plant.final_acceleration, START)


def residual_rms(response: Response) -> float:
    """Root mean square of the vehicle acceleration of `wheel_disturbance` from 50 ms after its pulse on [m/s^2]."""
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
        With a `Driveline`, or a two-mass model (without modal damping then).

    Returns
    -------
    dict
        Name to plant, 29 in all; "nominal" is the first.
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
    """Driveline with its masses scaled."""
    return _changed(car, lambda e: {"m": e.m * factor} if isinstance(e, Mass) else {})


def scale_stiffness(car: Driveline, factor: float, names: Iterable[str] | None = None) -> Driveline:
    """Driveline with the stiffness of its springs, or of some of them, scaled."""
    chosen = None if names is None else set(names)

    def values(e):
        stiff = isinstance(e, _SPRINGS) and e.stiffness
        return {"stiffness": e.stiffness * factor} if stiff and (chosen is None or e.name in chosen) else {}

    return _changed(car, values)


def scale_damping(car: Driveline, factor: float) -> Driveline:
    """Driveline with its dampers scaled."""
    return _changed(car, lambda e: {"damping": e.damping * factor} if isinstance(e, _SPRINGS) else {})


_SPRINGS = (SpringDamper, Shaft, Drag, Tyre, Compliance)


def with_modal_damping(car: Driveline, damping_ratios: Sequence[float] = MODAL_DAMPING) -> Driveline:
    """Driveline whose elastic modes have these damping ratios, the last for all that follow.

    Each mode gets a damper on its own coordinate ``phi^T M z``, with ``2 zeta omega``; all other dampers go.

    Raises
    ------
    TopologyError
        A driveline that a damper without spring would let move freely.
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
    """Name of the spring that twists most in the first elastic mode."""
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
    metrics, open_metrics : RideMetrics
        Of the tip-in.
    oscillation_reduction : float
        One minus peak-to-peak over that of the open loop [-].
    t90_ratio : float
        Over that of the open loop [-].
    disturbance_reduction : float
        One minus the residual RMS after a wheel disturbance over that of the open loop [-].
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
    """

    proofs: dict[str, Proof]

    def __getitem__(self, name: str) -> Proof:
        return self.proofs[name]

    @property
    def stable(self) -> bool:
        return all(proof.margins.stable for proof in self.proofs.values())

    def worst(self, quantity: str, among: Callable[[str], bool] = lambda name: True) -> tuple[str, float]:
        """Plant and value that are worst in a column of the table: "zeta_first", "disk_margin", "t90_ratio", ..."""
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
    """
    plants = variations(plant) if plants is None else dict(plants)
    return Robustness({name: prove(each, controller) for name, each in plants.items()})


def prove(plant: SampledPlant, controller) -> Proof:
    """A controller on one plant; an unstable loop has no metrics."""
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
