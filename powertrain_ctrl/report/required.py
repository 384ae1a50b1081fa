"""What a tuned controller reaches of what is required, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

from ..antijerk import Tuned
from ..studies import Robustness
from ..studies.requirements import asked

UNDAMPED = "Not shown: without damping the driveline itself never settles; give it some."


def several(tuned: Tuned) -> str:
    """The plants on which it is proven."""
    return f"all {len(tuned.proof.proofs)} plants of its tolerances"


def why_none(tuned: Tuned) -> str:
    """On which plants the best of its structure is unstable."""
    return (
        f'No controller of the structure "{tuned.structure}" was found that is stable on {several(tuned)}; the best one is '
        f"unstable on {unstable_on(tuned.proof)}. A quicker actuator or a shorter delay helps."
    )


def unstable_on(robustness: Robustness) -> str:
    """Plants whose loop is unstable, in a row."""
    return listed([f'"{name}"' for name, proof in robustness.proofs.items() if not proof.margins.stable])


def what_is_met(tuned: Tuned) -> str:
    """That every requirement is met, or which are missed and what is in the way."""
    if not tuned.unmet:
        return f"It meets every requirement, {asked(tuned.binding, 0.0).name} most narrowly."
    missed = []
    for name in tuned.unmet:
        requirement = asked(name, tuned.requirements[name])
        among = "" if requirement.among == "nominal" else " at worst"
        best = (
            f", with the rest kept at best {requirement.written(tuned.best[name], '.3g')}" if name in tuned.best else ""
        )
        value = requirement.written(tuned.unmet[name], ".3g")
        missed.append(f"{requirement.name}{among} (required {requirement.text}, reached {value}{best})")
    tried = f"Among {len(tuned.candidates)} candidates none was found that keeps them all"
    return f"It misses {listed(missed)}. {tried}: lag, delay and sampling leave no more."


def listed(names: Sequence[str]) -> str:
    """Names in a row, or "none"."""
    if not names:
        return "none"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
