"""Search for a design: feedbacks by their loops on a few hard plants, then a feedforward for each of the best."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, NamedTuple

import control
import numpy as np

from ..sampled.margins import loop_margins
from ..sampled.plant import SampledPlant
from ..studies.proof import UNNOTICED
from ..studies.times import times_of
from ..studies.tolerances import hard_ones
from .candidates import Judged, judged, view_of
from .rises import Rises
from .scales import Scales
from .shaping import (
    CLOSER_FIRST,
    CLOSER_SECOND,
    FEEDBACK,
    FEEDFORWARD,
    around,
    drawn,
    feedback_gain,
    feedback_of,
    named,
)
from .structure import one_dof, two_dof

# Candidates: feedbacks drawn, then near the best; feedforwards for each feedback that is taken on, then near the best.
DRAWN, NEAR, SHAPED, REFINED = 500, 120, 60, 40
# Shares of the box in which is looked near the best.
CLOSER = (0.25, 0.1)
# Worst disk margins for which the feedback that rings least is taken on, and of weak ones where those miss something.
LEVELS = (0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.15, 1.3)
WEAK = (1.5, 1.7)
# Place among the hard plants of that with half the damping.
HIDDEN = 7
# Candidates tried at most for one that is stable beyond rounding.
TRIED = 20
# Where something is missed so many of the best feedbacks are looked at again, and feedforwards in finer steps.
AGAIN, MORE, FINER = 3, 150, (0.25, 0.15, 0.08, 0.04)
# Of the frequency at which new poles use up the rate of the torque, the share down to which they are searched.
SLOWEST = 0.7
# Length of the push at the vehicle over the period of the first mode: 100 ms on the source's car.
PUSH = 0.264
# What is aimed at where no requirement is stricter, jerk over that of the open loop; what a feedback cannot damp,
# because torque comes too late, is not asked.
AIMS = {
    "disk_margin": 0.95,
    "worst_disk_margin": 0.6,
    "worst_ringing": 0.6,
    "oscillation_reduction": 0.96,
    "worst_oscillation_reduction": 0.75,
    "t90_ratio": 1.3,
    "worst_t90_ratio": 1.6,
    "jerk": 0.8,
}
# Of the shares of what is aimed at the largest counts most.
POWER = 4.0
# Reserve that is kept to a requirement, and what it costs to miss it by all of it.
RESERVE, MISSED = 0.05, 5.0
# A quotient by less than this is none.
LEAST = 1e-3


class Found(NamedTuple):
    """A design: its numbers, its parts, the shares that it uses of what is aimed at, and its score, least is best."""

    gains: dict[str, Any]
    feedback: control.StateSpace
    known: Judged
    forward: np.ndarray
    shares: dict[str, float]
    score: float


class Search:
    """The candidates of one plant; of each complete one ``seen`` has disk margin, swings left and t90 ratio."""

    def __init__(self, plant: SampledPlant, scales: Scales, limits: Mapping[str, float], seed: int):
        self.plant, self.scales, self.limits = plant, scales, limits
        self.aims = AIMS | {name: limit for name, limit in limits.items() if name in AIMS and _is_stricter(name, limit)}
        self.random = np.random.default_rng(seed)
        self.plants = hard_ones(plant)
        self.times = times_of(plant)
        (low, high), (up, down), torque = plant.limits, plant.rates, self.times.torque
        most, *rates = (high, up, down) if torque > 0.0 else (-low, down, up)
        self.largest = max(1.0, most / abs(torque))
        self.rates = np.array(rates) / abs(torque)  # of a rise and of a fall
        demanded = Rises(self.plants, scales, None, self.times)
        self.plain = demanded.of(demanded.within(self.rates[0])[None])
        self.box, self.closer = (
            _below_nyquist(_slow_enough(box, scales.model.omega, self.rates[0]), scales.model.frequency_hz, plant.dt)
            for box in (FEEDFORWARD, CLOSER_FIRST)
        )
        if scales.second_hz is not None:
            self.closer = np.vstack([self.closer, _below_nyquist(CLOSER_SECOND, scales.second_hz, plant.dt)])
        self.weak: list[tuple[dict[str, Any], Judged]] = []
        self.seen: list[np.ndarray] = []

    def feedbacks(self, done: Callable[[], None]) -> list[tuple[dict[str, Any], Judged]]:
        """Numbers and judgement of the feedbacks on the twist rate that are worth a feedforward."""
        push = PUSH / self.scales.model.frequency_hz
        views = [view_of(each, self.plant.ratio, push) for each in self.plants]

        def judge(x: np.ndarray, sign: np.ndarray) -> Judged:
            return judged(views, [feedback_gain(self.scales, view.omega, x, sign) for view in views])

        x = drawn(self.random, FEEDBACK, DRAWN)
        sign = np.where(self.random.permutation(DRAWN) % 2, 1.0, -1.0)
        known = judge(x, sign)
        done()
        for share in CLOSER:
            best = int(score_of(self.loop_shares(known)).argmin())
            more, same = around(self.random, FEEDBACK, x[best], share, NEAR), np.full(NEAR, sign[best])
            known, x, sign = known.joined(judge(more, same)), np.vstack([x, more]), np.append(sign, same)
            done()
        margin, ringing = known.disk_margin.min(axis=0), known.ringing.max(axis=0)
        is_safe = known.disk_margin[0] >= self.aims["disk_margin"]
        safe = np.flatnonzero(is_safe & (margin >= self.aims["worst_disk_margin"]))
        if safe.size:
            self.aims["worst_ringing"] = max(self.aims["worst_ringing"], float(ringing[safe].min()))

        least_damped = (self.plants[0], self.plants[HIDDEN])

        @cache
        def is_stable(i: int) -> bool:
            """Beyond rounding, which stiff loops with modes without damping are not."""
            controller = one_dof(self.plant, feedback_of(self.plant, named(self.scales, x[i], float(sign[i]))))
            return bool(margin[i] > 0.0) and all(loop_margins(each, controller).stable for each in least_damped)

        def first_stable(places: np.ndarray) -> list[int]:
            some = places[:: max(1, -(-len(places) // TRIED))].tolist()
            return next(([i] for i in some if is_stable(i)), [])

        def found(levels: Sequence[float], others: Sequence[int] = ()) -> list[tuple[dict[str, Any], Judged]]:
            """Of each level the one that rings least."""
            chosen = list(others)
            for level in levels:
                enough = np.flatnonzero(is_safe & (margin >= level))
                chosen += first_stable(enough[ringing[enough].argsort(kind="stable")])
            return [
                (named(self.scales, x[i], float(sign[i])), known.part(np.array([i]))) for i in dict.fromkeys(chosen)
            ]

        self.weak = found(WEAK)
        return found(LEVELS, first_stable(score_of(self.loop_shares(known)).argsort(kind="stable")))

    def judged_exactly(self, feedback: control.StateSpace) -> Judged:
        """Judgement of any feedback: margins as they are, and for the ringing the damping that it gives the first mode."""
        controller = two_dof(self.plant, self.scales.model, feedback)
        margins = [loop_margins(each, controller) for each in self.plants]
        ringing = []
        for each, found in zip(self.plants, margins, strict=True):
            plain = loop_margins(each, None).zeta_first
            ringing.append(np.sqrt(plain / found.zeta_first) if found.zeta_first > 0.0 else np.inf)
        return Judged(np.array([[each.disk_margin] for each in margins]), np.array(ringing)[:, None])

    def with_feedforward(self, feedback: control.StateSpace, gains: dict[str, Any], known: Judged) -> Found:
        """The best design that has this feedback."""
        return self._shaped(feedback, gains, known, self.box, SHAPED, CLOSER)

    def looked_closer(self, found: Sequence[Found]) -> list[Found]:
        """With the best feedbacks of these designs, and with weak ones, feedforwards that exchange the second mode too."""
        parts = [(design.feedback, design.gains, design.known) for design in found[:AGAIN]]
        parts += [(feedback_of(self.plant, gains), gains, known) for gains, known in self.weak]
        return [self._shaped(*each, self.closer, MORE, FINER) for each in parts]

    def _shaped(
        self,
        feedback: control.StateSpace,
        gains: dict[str, Any],
        known: Judged,
        box: np.ndarray,
        count: int,
        closer: Sequence[float],
    ) -> Found:
        rises = Rises(self.plants, self.scales, feedback, self.times)
        loop = self.loop_shares(known)
        y = drawn(self.random, box, count)
        shares = self._shares(rises, y, known)
        for share in closer:
            best = y[self._score(loop | shares).argmin()]
            more = around(self.random, box, best, share, REFINED)
            y = np.vstack([y, more])
            shares = {
                name: np.append(shares[name], values) for name, values in self._shares(rises, more, known).items()
            }
        score = self._score(loop | shares)
        best = int(score.argmin())
        mine = {name: float(values[0 if name in loop else best]) for name, values in (loop | shares).items()}
        return Found(gains, feedback, known, y[best], mine, float(score[best]))

    def loop_shares(self, known: Judged) -> dict[str, np.ndarray]:
        """Shares (n,) that loops use of what is aimed at."""
        margin, worst = (np.maximum(values, LEAST) for values in (known.disk_margin[0], known.disk_margin.min(axis=0)))
        return {
            "disk_margin": self.aims["disk_margin"] / margin,
            "worst_disk_margin": self.aims["worst_disk_margin"] / worst,
            "worst_ringing": known.ringing.max(axis=0) / self.aims["worst_ringing"],
        }

    def _shares(self, rises: Rises, y: np.ndarray, known: Judged) -> dict[str, np.ndarray]:
        """Shares (n,) that feedforwards use, and by how much a torque is beyond what there is."""
        risen = rises.of(rises.shaped(y))
        left, later = risen.swing / np.maximum(self.plain.swing, UNNOTICED), risen.t90 / self.plain.t90
        later = np.where(np.isnan(later), np.inf, later)
        values = {
            "oscillation_reduction": 1.0 - left[0],
            "worst_oscillation_reduction": 1.0 - left.max(axis=0),
            "t90_ratio": later[0],
            "worst_t90_ratio": later.max(axis=0),
        }
        self.seen.append(
            np.stack([np.full(len(y), known.disk_margin[0, 0]), left[0], left.max(axis=0), later[0]], axis=1)
        )
        shares = {name: share_of(name, value, self.aims[name]) for name, value in values.items()}
        shares["jerk"] = risen.jerk[0] / self.plain.jerk[0] / self.aims["jerk"]
        missed = sum(
            np.maximum(share_of(name, value, self.limits[name]) - 1.0 + RESERVE, 0.0)
            for name, value in values.items()
            if name in self.limits
        )
        used = (risen.torque / self.largest, risen.rise / self.rates[0], risen.fall / self.rates[1])
        beyond = sum(np.maximum(share - 1.0, 0.0) for share in used)
        return shares | {"beyond": np.minimum(MISSED * (missed + beyond), 1e3)}

    def _score(self, shares: Mapping[str, np.ndarray]) -> np.ndarray:
        return score_of({name: share for name, share in shares.items() if name != "beyond"}) + shares["beyond"]


def _slow_enough(box: np.ndarray, omega: float, rate: float) -> np.ndarray:
    """A box of feedforwards of which some rise no faster than a rate [1/s]: a double pole at w reaches w / e."""
    box = box.copy()
    box[1, 0] = min(box[1, 0], SLOWEST * np.exp(1.0) * rate / omega)
    return box


def _below_nyquist(box: np.ndarray, hz: float, dt: float) -> np.ndarray:
    """A box of feedforwards whose new poles the sampling can have."""
    box = box.copy()
    box[1, 1] = max(min(box[1, 1], 0.45 / dt / hz), 1.0)
    box[1, 0] = min(box[1, 0], 0.9 * box[1, 1])
    return box


def score_of(shares: Mapping[str, np.ndarray]) -> np.ndarray:
    """Mean of shares of which the largest counts most: at most 1 where all are."""
    total = sum(np.minimum(share, 1e9) ** POWER for share in shares.values())
    return (np.asarray(total) / len(shares)) ** (1.0 / POWER)


def share_of(name: str, value: np.ndarray, limit: float) -> np.ndarray:
    """How much of what a limit allows is used: 1 at the limit."""
    if name.endswith("reduction"):
        return (1.0 - value) / max(1.0 - limit, LEAST)
    return np.maximum(value - 1.0, 0.0) / max(limit - 1.0, LEAST)


def _is_stricter(name: str, limit: float) -> bool:
    return limit < AIMS[name] if name.endswith(("ratio", "ringing")) else limit > AIMS[name]
