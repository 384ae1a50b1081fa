"""A controller on many plants, each against its own open loop."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from ..base.checks import checked_mapping
from ..base.doors import called, checked
from ..base.errors import PowertrainError, UnknownNameError
from ..base.tables import Printed
from ..families.executors import Progress, completed
from ..hybrid.metrics import RideMetrics
from ..linear.assembly import kept
from ..sampled.margins import LoopMargins, acting_on, margins_among
from ..sampled.plant import SampledPlant
from ..sampled.unit import Controller, ControlUnit
from .tolerances import variations
from .trials import Trials, trials

# Plants that a worker computes at once, or that lie between two calls of a progress.
AT_ONCE = 8
# Values that differ by less than this share are the same.
SAME = 1e-9
# An oscillation of less than this, over the final value or in m/s^2, is rounding.
NOTHING = 1e-9
# A tip-in that swings by less than this share of its final acceleration without a controller has no shuffle to take
# away; what a controller leaves is measured by this.
UNNOTICED = 0.05


@called
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
        One minus peak-to-peak over that of the open loop, or over 0.05 of the final value where that is more [-]; -inf if
        unstable.
    t90_ratio : float
        Over that of the open loop [-]; inf if unstable.
    disturbance_reduction : float
        One minus the residual RMS after a wheel disturbance over that of the open loop [-]; -inf if unstable.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.designs(plant)["two degrees of freedom"]
    >>> proof = pt.studies.prove(plant, controller)
    >>> less = 1.0 - proof.metrics.peak_to_peak / proof.open_metrics.peak_to_peak
    >>> proof.margins.stable, round(less, 2), round(proof.oscillation_reduction, 2)
    (True, 0.99, 0.99)
    """

    margins: LoopMargins
    metrics: RideMetrics
    open_metrics: RideMetrics
    oscillation_reduction: float
    t90_ratio: float
    disturbance_reduction: float

    @checked
    def value(self, quantity: str) -> float:
        """A number of the proof by name, its own or one of its margins or metrics.

        Parameters
        ----------
        quantity : str
            As in `Robustness.worst`.

        Returns
        -------
        float

        Raises
        ------
        PowertrainError
            There is no such number.
        """
        for record in (self, self.margins, self.metrics):
            found = getattr(record, quantity, None)
            if isinstance(found, bool | int | float | np.number):
                return float(found)
        raise PowertrainError(f'"{quantity}" is not a quantity of a proof')


@called
@dataclass(frozen=True, eq=False, repr=False)
class Robustness(Printed):
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
    plant    stable  zeta first  zeta second  disk margin  oscillation [%]  less [%]  t90 ratio  disturbance less [%]
    nominal  yes          0.269        0.051         1.02             27.5      73.7       1.08                    65
    heavy    yes          0.280        0.051         1.02             26.3      75.7       1.08                    66
    >>> name, damping_ratio = result.worst("zeta_first")
    >>> name, round(damping_ratio, 3), result["heavy"].margins.stable
    ('nominal', 0.269, True)
    """

    proofs: dict[str, Proof]

    def keys(self) -> tuple[str, ...]:
        """Names of all plants."""
        return tuple(self.proofs)

    _ipython_key_completions_ = keys

    @checked
    def __getitem__(self, name: str) -> Proof:
        if name not in self.proofs:
            raise UnknownNameError("plant", name, self.proofs, "among those proven")
        return self.proofs[name]

    @property
    def stable(self) -> bool:
        """Whether the loop is stable on every plant."""
        return all(proof.margins.stable for proof in self.proofs.values())

    @checked
    def worst(self, quantity: str, among: Callable[[str], bool] = lambda name: True) -> tuple[str, float]:
        """Plant and value that are worst in a quantity of the proofs.

        Parameters
        ----------
        quantity : str
            "zeta_first", "zeta_second", "disk_margin", "oscillation_reduction", "disturbance_reduction", of which the
            least is worst; "t90_ratio", "overshoot", "peak_jerk", "settling" and the other `RideMetrics`, of which
            the largest is.
        among : callable
            Whether a plant of this name counts; all if not given.

        Returns
        -------
        name : str
        value : float
            nan where a time is never reached, or a damping ratio is missing on every plant.

        Raises
        ------
        PowertrainError
            A quantity that proofs do not have, or no plant that counts.
        """
        try:
            counted = [name for name in self.proofs if among(name)]
        except Exception as error:
            raise PowertrainError(f"among fails: {type(error).__name__}: {error}") from error
        values = {name: self.proofs[name].value(quantity) for name in counted}
        if not values:
            raise PowertrainError("there is no such plant among those proven")
        known = {name: value for name, value in values.items() if not np.isnan(value)}
        if quantity in _SMALL_IS_GOOD and len(known) < len(values):
            return next(name for name in values if name not in known), float("nan")  # it never gets there
        if not known:
            return next(iter(values)), float("nan")
        worst = (max if quantity in _SMALL_IS_GOOD else min)(known.values())
        # of plants that differ by rounding the first
        name = next(name for name, value in known.items() if value == worst or abs(value - worst) <= SAME * abs(worst))
        return name, known[name]

    headers = (
        "plant",
        "stable",
        "zeta first",
        "zeta second",
        "disk margin",
        "oscillation [%]",
        "less [%]",
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
                _written(100 * p.metrics.peak_to_peak, ".1f"),
                _written(100 * p.oscillation_reduction, ".1f"),
                _written(p.t90_ratio, ".2f"),
                _written(100 * p.disturbance_reduction, ".0f"),
            ]
            for name, p in self.proofs.items()
        ]


_SMALL_IS_GOOD = ("t90_ratio", *(item.name for item in dataclasses.fields(RideMetrics) if item.name != "final"))


@checked
def robustness(
    plant: SampledPlant,
    controller: Controller,
    plants: Mapping[str, SampledPlant] | None = None,
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> Robustness:
    """Prove a controller on many plants: stability, margins, tip-in and wheel disturbance, each against open loop.

    Parameters
    ----------
    plant : SampledPlant
        Nominal plant.
    controller : ControlUnit, control.StateSpace or None
        Fixed, as designed for the nominal plant; of a unit and of a schedule over gears on each plant that of its ratio.
        Responses are those of the whole unit, within its limits and its rate.
    plants : mapping, optional
        Name to plant; `variations` of the nominal plant if not given.
    executor : concurrent.futures.Executor, optional
        Where the plants are computed, a few at once; here, all at once, if not given. The numbers are the same.
    progress : callable, optional
        ``progress(done, all)`` after some plants.

    Returns
    -------
    Robustness

    Raises
    ------
    PowertrainError
        A controller that does not fit or is not linear, a worker of the executor that died.
    TopologyError
        `variations` of a driveline without an elastic mode.

    Examples
    --------
    On two of the 29 plants:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.designs(plant)["two degrees of freedom"]
    >>> plants = {name: pt.studies.variations(plant)[name] for name in ("nominal", "lag 50 ms")}
    >>> result = pt.robustness(plant, controller, plants)
    >>> result.stable, [round(100 * proof.oscillation_reduction) for proof in result.proofs.values()]
    (True, [99, 98])
    """
    plants = variations(plant) if plants is None else checked_mapping("plants", plants, "from name to SampledPlant")
    if not plants:
        raise PowertrainError("plants is empty, permitted: at least one plant")
    each, size = tuple(plants.values()), len(plants) if executor is None and progress is None else AT_ONCE
    parts = [each[start : start + size] for start in range(0, len(each), size)]
    proofs: list[Proof] = []
    work = [(part, controller, plant) for part in parts]
    for done in completed(_proofs, work, executor, progress, [len(part) for part in parts]):
        if isinstance(done.error, PowertrainError):
            raise done.error
        if done.error is not None:
            names = ", ".join(list(plants)[len(proofs) : len(proofs) + len(parts[done.place])])
            raise PowertrainError(f"robustness: {names}: {type(done.error).__name__}: {done.error}") from done.error
        proofs += done.result
    return Robustness(dict(zip(plants, proofs, strict=True)))


@checked
def prove(plant: SampledPlant, controller: Controller) -> Proof:
    """Margins, tip-in and wheel disturbance of a controller on one plant, against the open loop.

    Parameters
    ----------
    plant : SampledPlant
    controller : ControlUnit, control.StateSpace or None
        As in `robustness`.

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
    return _proofs((plant,), controller, plant)[0]


def _proofs(plants: tuple[SampledPlant, ...], controller: Controller, nominal: SampledPlant) -> list[Proof]:
    # a unit acts as a whole, with its limits
    own = [controller if isinstance(controller, ControlUnit) else acting_on(plant, controller) for plant in plants]
    if any(each is not controller for each in own):
        return [proof for plant, each in zip(plants, own, strict=True) for proof in _proofs((plant,), each, nominal)]
    margins = margins_among(plants, controller)
    stable = [i for i, each in enumerate(margins) if each.stable]
    closed = dict(zip(stable, trials(tuple(plants[i] for i in stable), controller, nominal), strict=True))
    proofs = []
    for i, open_loop in enumerate(_open_loops(plants, nominal)):
        if i not in closed:
            nan = float("nan")
            lost = RideMetrics(*[nan] * len(dataclasses.fields(RideMetrics)))
            proofs.append(Proof(margins[i], lost, open_loop.metrics, -np.inf, np.inf, -np.inf))
            continue
        mine = closed[i]
        proofs.append(
            Proof(
                margins[i],
                mine.metrics,
                open_loop.metrics,
                1.0 - mine.metrics.peak_to_peak / max(open_loop.metrics.peak_to_peak, UNNOTICED),
                mine.metrics.t90 / open_loop.metrics.t90,
                _reduction(mine.residual_rms, open_loop.residual_rms),
            )
        )
    return proofs


def _written(value: float, form: str) -> str:
    """A number, or a dash where there is none."""
    return format(value, form) if np.isfinite(value) else "–"


def _reduction(value: float, open_value: float) -> float:
    """One minus the ratio; where there is nothing to reduce, 0 or -inf."""
    if open_value <= NOTHING:
        return 0.0 if value <= NOTHING else -np.inf
    return 1.0 - value / open_value


@kept(64)
def _open_loops(plants: tuple[SampledPlant, ...], nominal: SampledPlant) -> list[Trials]:
    return trials(plants, None, nominal)
