"""A controller tuned for the plant in hand, and what it reaches of what is required."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np

from ..base.checks import Number, Seed
from ..base.doors import called, checked
from ..base.errors import PowertrainError, suggestion
from ..base.records import Record
from ..base.tables import Printed
from ..linear.assembly import kept
from ..reduction.twomass import TwoMass
from ..sampled.actuator import written
from ..sampled.margins import LoopMargins, loop_margins
from ..sampled.plant import SampledPlant
from ..studies.proof import Robustness, robustness
from ..studies.requirements import DEFAULTS, asked
from .candidates import Judged
from .families import AUTHORITIES, FAMILIES
from .scales import scales_of
from .search import Found, Search
from .shaping import assembled, feedback_of, with_forward

Progress = Callable[[int, int], object]

TWO = "two degrees of freedom"
STRUCTURES = (TWO, *FAMILIES)
# Rounds of the search that are reported: feedbacks three times, feedforwards, proof.
ROUNDS = 5
# Designs that are proven at most if the better ones miss a requirement, and of a closer look besides.
PROVEN, CLOSER = 4, 2


@called
@dataclass(frozen=True, eq=False, repr=False)
class Tuned(Printed, Record):
    """A controller tuned for one plant.

    Attributes
    ----------
    structure : str
    controller : control.StateSpace
        Linear, discrete, for `closed_loop`.
    gains : dict
        Its numbers in physical units.
    margins : LoopMargins
        Of the loop with the nominal plant.
    requirements : dict
        What was required by name; ``worst_...`` of all plants of `variations`, otherwise of the nominal plant.
    reached : dict
        The same as it has come out.
    unmet : dict
        Of the requirements those that are missed, with the value reached; "stable" if a loop is unstable.
    best : dict
        For each quantity that all candidates have (disk margin, reduction of the oscillation, nominal and on the hard
        plants, and t90 ratio) the best value among those candidates that keep what is required of the others: what the
        structure can do with this lag and delay. Without an entry where no candidate keeps the others.
    binding : str
        The requirement of which least is left.
    proof : Robustness
        On all plants of `variations`.
    candidates : (n, 4) ndarray
        Disk margin, swing of the tip-in over that of the open loop, nominal and worst of the hard plants, and t90
        over that of the open loop, of every complete design that was tried.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> tuned = pt.antijerk.tune(pt.SampledPlant(car=pt.examples.conventional()))
    >>> tuned.unmet, tuned.proof.stable, tuned.margins.disk_margin > 1.0
    ({}, True, True)
    """

    structure: str
    controller: control.StateSpace
    gains: dict[str, Any]
    margins: LoopMargins
    requirements: dict[str, float]
    reached: dict[str, float]
    unmet: dict[str, float]
    best: dict[str, float]
    binding: str
    proof: Robustness
    candidates: np.ndarray

    @property
    def safe(self) -> np.ndarray:
        """(n, 4) ndarray: the candidates with the disk margin required."""
        return self.candidates[self.candidates[:, 0] >= self.requirements.get("disk_margin", 0.0)]

    @property
    def front(self) -> np.ndarray:
        """(n, 2) ndarray: t90 ratio and swing left of those safe candidates than which none is better in both."""
        points = self.safe[np.isfinite(self.safe).all(axis=1)][:, [3, 1]]
        points = points[np.lexsort((points[:, 1], points[:, 0]))]
        before = np.minimum.accumulate(np.append(np.inf, points[:, 1]))[:-1]
        return points[points[:, 1] < before]

    headers = ("quantity", "plants", "required", "reached", "best of candidates", "met")

    @property
    def heading(self) -> str:
        """What stands above the printed table."""
        state = "meets every requirement" if not self.unmet else f"misses {', '.join(self.unmet)}"
        where = f"{len(self.proof.proofs)} plants"
        return f"Tuned {self.structure}: {state} on {where}; {self.binding} binds"

    @property
    def note(self) -> str:
        """What stands below the printed table."""
        written = {
            name: value if not isinstance(value, tuple) else f"({', '.join(f'{each:.4g}' for each in value)})"
            for name, value in self.gains.items()
        }
        return ", ".join(
            f"{name} {value if isinstance(value, str) or value is None else f'{value:.4g}'}"
            for name, value in written.items()
        )

    def rows(self) -> list[list[str]]:
        """Rows of the printed table."""
        rows = [
            ["stability", "all", "yes", "yes" if self.proof.stable else "NO", "–", "yes" if self.proof.stable else "NO"]
        ]
        for name, limit in self.requirements.items():
            requirement = asked(name, limit)
            best = requirement.written(self.best.get(name, np.nan))
            met = "NO" if name in self.unmet else "yes"
            reached = requirement.written(self.reached[name])
            rows.append([requirement.name, requirement.among, requirement.text, reached, best, met])
        return rows


@checked
def tune(
    plant: SampledPlant,
    structure: str = TWO,
    requirements: Mapping[str, Number] | None = None,
    seed: Seed = 0,
    progress: Callable | None = None,
    model: TwoMass | None = None,
) -> Tuned:
    """Tune a controller for this plant and prove it on all its `variations`.

    A random search over gains in units of the plant's own numbers: reduced inertia, first mode, lag and delay.
    Feedbacks are judged by disk margin and by what a push at the vehicle leaves, on the nominal plant and on eight
    hard ones, or nine where a torque rises and falls differently; for the best of them the feedforward is searched
    for that leaves least of a tip-in, in time, within limits and rate of the torque. What is made small is a mean of
    the shares used of what is aimed at, of which the largest counts most; so a feedback that damps less may have a
    larger disk margin than the one found. The best is proven on all plants; if it misses a requirement, so are those
    of the next ones, then of others with weaker feedbacks and with feedforwards that exchange the second mode too,
    that miss less on the nominal plant; the one that misses least is what comes back. A car with play, stages or
    other laws is taken for small motion while the actuator drives; a torque that rises and falls differently is taken
    with the slower of both until it is proven.

    Parameters
    ----------
    plant : SampledPlant
    structure : {"two degrees of freedom", "rigid reference", "LQG", "LQG, engine speed", "LQG, wheel speed", "H-infinity"}
        The feedback: on the twist rate through lead and notch, or one of the others, in two degrees of freedom. "rigid
        reference" and "LQG, engine speed" read the actuator's speed alone, "LQG, wheel speed" that of the wheels alone,
        the others both.
    requirements : mapping, optional
        Limits by quantity of `Proof`, its margins or its metrics; ``worst_...`` is that of the worst plant. Instead
        of, or besides: disk margin 0.8 and 0.5 at worst, 90 % and 75 % less oscillation, t90 at most 1.3 times that
        of the open loop, after a push at the vehicle at worst 5 % more than in open loop.
    seed : int
        The same seed gives the same design.
    progress : callable, optional
        Called with rounds done and all.
    model : TwoMass, optional
        Design model; that of the car as the actuator drives it, ``two_mass(plant.car, driving=...)``, if not given.

    Returns
    -------
    Tuned

    Raises
    ------
    TopologyError
        A driveline that has no two-mass model, as in `two_mass`.
    PowertrainError
        A structure or requirement that is not known, requirements that contradict each other; a first mode above the Nyquist
        frequency; a plant that is not stable by itself; no feedback of this structure that is stable on all hard plants.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional(gear_ratio=3.6))
    >>> tuned = pt.antijerk.tune(plant, requirements={"disk_margin": 0.9})
    >>> tuned.unmet, sorted(tuned.gains)[:3]
    ({}, ['cancelled_damping_ratio', 'cancelled_hz', 'damping_ratio'])
    """
    if structure not in STRUCTURES:
        raise PowertrainError(f'structure "{structure}"{suggestion(structure, STRUCTURES)}')
    limits = {**DEFAULTS, **(requirements or {})}
    wanted = tuple(sorted(limits.items(), key=lambda item: list(limits).index(item[0])))
    _check(limits)
    report = progress or (lambda done, total: None)
    tuned = _kept(plant, structure, wanted, seed, _Silent(report), model)
    report(ROUNDS, ROUNDS)
    return tuned


class _Silent:
    """A callback that is not part of what a result is kept by."""

    def __init__(self, report: Progress):
        self.report, self.count = report, 0

    def __call__(self) -> None:
        self.count += 1
        self.report(self.count, ROUNDS)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Silent)

    def __hash__(self) -> int:
        return 0


@kept(32)
def _kept(plant: SampledPlant, structure: str, wanted: tuple, seed: int, done: _Silent, model: TwoMass | None) -> Tuned:
    if not loop_margins(plant, None).stable:
        raise PowertrainError(
            "the plant is not stable by itself: a driveline without damping never settles; give it some"
        )
    if not plant.is_linear:
        plant = replace(plant, car=plant.linear)
    scales, limits = scales_of(plant, model), dict(wanted)
    search = Search(plant, scales, limits, seed)
    found = _found(search, structure, done)
    done()
    proven = _proofs(search, structure, found[:PROVEN], limits, [])
    if proven[-1].unmet:
        closer = sorted(search.looked_closer(found), key=lambda design: design.score)
        proven = _proofs(search, structure, closer[:CLOSER], limits, proven)
    return min(proven, key=lambda tuned: _missed(tuned.unmet, limits))


def _proofs(
    search: Search, structure: str, designs: Sequence[Found], limits: dict[str, float], proven: list[Tuned]
) -> list[Tuned]:
    """What is proven, and designs that may miss less, to the first that misses nothing."""
    proven = list(proven)
    for design in designs:
        gains = with_forward(search.scales, design.gains, design.forward)
        controller = assembled(search.plant, search.scales, design.feedback, gains)
        least = min((_missed(tuned.unmet, limits) for tuned in proven), default=np.inf)
        if proven and _missed_on_nominal(search.plant, controller, limits) >= least:
            continue
        proven.append(_proven(search, structure, controller, gains, limits))
        if not proven[-1].unmet:
            break
    return proven


def _found(search: Search, structure: str, done: Callable[[], None]) -> list[Found]:
    """Complete designs of a structure, the best first."""
    plant, scales = search.plant, search.scales
    if structure == TWO:
        designs = [
            search.with_feedforward(feedback_of(plant, gains), gains, known) for gains, known in search.feedbacks(done)
        ]
    else:
        designs = [
            search.with_feedforward(feedback, numbers, known)
            for feedback, numbers, known in _by_authority(search, structure)
            if known.disk_margin.min() > 0.0
        ]
    if not designs:
        raise PowertrainError(
            f"no {structure} is stable on all plants with a lag of {written(plant.lag)} and a delay of "
            f"{written(plant.delay)}: the first mode has a period of {1e3 / scales.model.frequency_hz:.3g} ms"
        )
    return sorted(designs, key=lambda design: design.score)


def _by_authority(search: Search, structure: str) -> list[tuple[control.StateSpace, dict, Judged]]:
    numbers_of, feedback_from = FAMILIES[structure]
    found = []
    for authority in AUTHORITIES:
        numbers = numbers_of(search.plant, search.scales, authority)
        try:
            feedback = feedback_from(search.plant, search.scales, numbers)
        except PowertrainError:
            continue
        found.append((feedback, numbers, search.judged_exactly(feedback)))
    return found


def _proven(
    search: Search, structure: str, controller: control.StateSpace, gains: dict[str, Any], limits: dict[str, float]
) -> Tuned:
    proof = robustness(search.plant, controller)
    reached, unmet = _reached(proof, limits)
    candidates = np.concatenate(search.seen)
    used = {name: asked(name, limit).used_by(reached[name]) for name, limit in limits.items()}
    return Tuned(
        structure=structure,
        controller=controller,
        gains=gains,
        margins=proof["nominal"].margins,
        requirements=dict(limits),
        reached=reached,
        unmet=unmet,
        best=_best(candidates, limits),
        binding=max(used, key=lambda name: used[name] if np.isfinite(used[name]) else np.inf),
        proof=proof,
        candidates=candidates,
    )


def _reached(proof: Robustness, limits: Mapping[str, float]) -> tuple[dict[str, float], dict[str, float]]:
    """What is reached, and of it what misses its limit."""
    reached = {name: asked(name, limit).value_in(proof) for name, limit in limits.items()}
    unmet = {name: reached[name] for name, limit in limits.items() if not asked(name, limit).is_met(reached[name])}
    return reached, unmet if proof.stable else {"stable": 0.0, **unmet}


def _best(candidates: np.ndarray, limits: Mapping[str, float]) -> dict[str, float]:
    """Of each quantity that candidates have the best value among those that keep what is required of the others."""
    values = {
        "disk_margin": candidates[:, 0],
        "oscillation_reduction": 1.0 - candidates[:, 1],
        "worst_oscillation_reduction": 1.0 - candidates[:, 2],
        "t90_ratio": candidates[:, 3],
    }
    met = {
        name: np.array([asked(name, limits[name]).is_met(value) for value in values[name].tolist()])
        for name in values
        if name in limits
    }
    best = {}
    for name, value in values.items():
        others = [kept for other, kept in met.items() if other != name]
        among = value[np.isfinite(value) & np.all(others, axis=0)] if others else value[np.isfinite(value)]
        if among.size:
            best[name] = float(among.min() if name == "t90_ratio" else among.max())
    return best


def _missed_on_nominal(plant: SampledPlant, controller: control.StateSpace, limits: Mapping[str, float]) -> float:
    """How far a design is from what is required on the nominal plant alone; more plants can only add to it."""
    _, unmet = _reached(robustness(plant, controller, {"nominal": plant}), limits)
    return _missed(unmet, limits)


def _missed(unmet: Mapping[str, float], limits: Mapping[str, float]) -> float:
    """How far what is missed is from what is required; beyond anything if a loop is unstable."""
    if "stable" in unmet:
        return np.inf
    missed = [asked(name, limits[name]).missed_by(value) for name, value in unmet.items()]
    return float(sum(each if np.isfinite(each) else 1e3 for each in missed))


def _check(limits: Mapping[str, float]) -> None:
    """Limits that nothing can meet, or that contradict each other."""
    for name, limit in limits.items():
        requirement = asked(name, limit)
        most = MOST.get(requirement.quantity)
        if most is not None and (limit > most if requirement.is_least else limit < most):
            word = "at most" if requirement.is_least else "at least"
            raise PowertrainError(
                f"requirement {name} = {limit:g}, permitted: {word} {most:g}, which nothing can exceed"
            )
        worst = limits.get(f"worst_{name}")
        if worst is not None and (worst > limit if requirement.is_least else worst < limit):
            raise PowertrainError(
                f"requirements {name} = {limit:g} and worst_{name} = {worst:g} contradict each other: the nominal plant is "
                "one of those of which the worst counts"
            )


MOST = {
    "disk_margin": 2.0,
    "oscillation_reduction": 1.0,
    "disturbance_reduction": 1.0,
    "zeta_first": 1.0,
    "zeta_second": 1.0,
    "overshoot": 0.0,
    "peak_to_peak": 0.0,
    "t90_ratio": 0.0,
}
