"""What is required of an anti-jerk controller on the source's car, and by which designs it is missed."""

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import PowertrainError, suggestion
from ..hybrid.metrics import RideMetrics
from .proof import Robustness

# What misses a limit by less than this share of it meets it.
AT_LIMIT = 1e-9
# Over a limit smaller than this nothing is told.
SMALLEST = 1e-3
# Names of the groups of `variations`.
ONE_AT_A_TIME, CORNERS = "one at a time", "corners"


@dataclass(frozen=True)
class Requirement:
    """A requirement on a quantity of `Proof`, on the nominal plant or as the worst of a group of plants."""

    quantity: str
    name: str
    among: str
    limit: float
    unit: str
    is_least: bool = True

    @property
    def text(self) -> str:
        return f"{'≥' if self.is_least else '≤'} {self.written(self.limit, 'g')}"

    def written(self, value: float, form: str = ".4g") -> str:
        """A value with its unit; a dash where there is none."""
        if not np.isfinite(value):
            return "–"
        scale, unit = (100.0, "%") if self.unit == "%" else (1.0, self.unit)
        return f"{scale * value:{form}}{'' if unit == '-' else ' ' + unit}"

    def value_in(self, result: Robustness) -> float:
        """The value that counts of a proof."""
        return result.worst(self.quantity, GROUPS[self.among])[1]

    def missed_by(self, value: float) -> float:
        """How far a value is on the wrong side of the limit, over the limit; negative where it is on the right side."""
        return (self.limit - value if self.is_least else value - self.limit) / max(abs(self.limit), SMALLEST)

    def used_by(self, value: float) -> float:
        """The share that a value uses of what the limit allows: 1 at the limit."""
        if self.quantity.endswith("reduction"):
            return (1.0 - value) / max(1.0 - self.limit, SMALLEST)
        if self.quantity == "t90_ratio":
            return (value - 1.0) / max(self.limit - 1.0, SMALLEST)
        return self.limit / max(value, SMALLEST) if self.is_least else value / max(self.limit, SMALLEST)

    def is_met(self, value: float) -> bool:
        return self.missed_by(value) <= AT_LIMIT


# What is required of a design for any car: on the nominal plant and, "worst_...", on each that it can turn out to be.
DEFAULTS = {
    "disk_margin": 0.8,
    "worst_disk_margin": 0.5,
    "oscillation_reduction": 0.9,
    "worst_oscillation_reduction": 0.75,
    "t90_ratio": 1.3,
    "worst_disturbance_reduction": -0.05,
}
# Quantities by unit, of which the least is worst; those of which the largest is worst.
LEAST = {
    "disk_margin": "-",
    "gain_margin_db": "dB",
    "phase_margin_deg": "deg",
    "zeta_first": "-",
    "zeta_second": "-",
    "oscillation_reduction": "%",
    "disturbance_reduction": "%",
}
LARGEST = {"t90_ratio": "-"} | dict(
    zip((item.name for item in dataclasses.fields(RideMetrics)), RideMetrics.UNITS, strict=True)
)
del LARGEST["final"]
WORST = "worst_"


def asked(name: str, limit: float) -> Requirement:
    """The requirement of this name; a name that is not known is a `PowertrainError`."""
    quantity = name.removeprefix(WORST)
    if quantity not in LEAST | LARGEST:
        raise PowertrainError(f'requirement "{name}"{suggestion(quantity, LEAST | LARGEST)}')
    among = "all" if name.startswith(WORST) else "nominal"
    unit = (LEAST | LARGEST)[quantity]
    return Requirement(quantity, quantity.replace("_", " "), among, limit, unit, quantity in LEAST)


# What is required on the detailed model of the source's car.
REQUIREMENTS = (
    Requirement("oscillation_reduction", "oscillation", "nominal", 0.95, "%"),
    Requirement("overshoot", "overshoot", "nominal", 0.04, "%", is_least=False),
    Requirement("peak_jerk", "jerk", "nominal", 34.0, "m/s³", is_least=False),
    Requirement("vdv", "VDV", "nominal", 0.80, "m/s^1.75", is_least=False),
    Requirement("t90_ratio", "t90", "nominal", 1.20, "-", is_least=False),
    Requirement("zeta_first", "ζ first", "nominal", 0.35, "-"),
    Requirement("zeta_second", "ζ second", "nominal", 0.05, "-"),
    Requirement("disk_margin", "disk margin", "nominal", 0.9, "-"),
    Requirement("disturbance_reduction", "disturbance", "nominal", 0.65, "%"),
    Requirement("oscillation_reduction", "oscillation", ONE_AT_A_TIME, 0.90, "%"),
    Requirement("oscillation_reduction", "oscillation", CORNERS, 0.85, "%"),
    Requirement("t90_ratio", "t90", "all", 1.30, "-", is_least=False),
    Requirement("zeta_first", "ζ first", "all", 0.15, "-"),
    Requirement("zeta_second", "ζ second", "all", 0.015, "-"),
    Requirement("disk_margin", "disk margin", "all", 0.6, "-"),
    Requirement("disturbance_reduction", "disturbance", "all", 0.45, "%"),
)

# The same for designs that do not read the wheel speed.
ENGINE_SPEED_DESIGNS = ("rigid reference", "LQG, engine speed")
ENGINE_SPEED_REQUIREMENTS = (
    Requirement("oscillation_reduction", "oscillation", "nominal", 0.95, "%"),
    Requirement("disk_margin", "disk margin", "nominal", 0.85, "-"),
    Requirement("oscillation_reduction", "oscillation", "all", 0.80, "%"),
)

GROUPS: dict[str, Callable[[str], bool]] = {
    "nominal": lambda name: name == "nominal",
    ONE_AT_A_TIME: lambda name: not name.startswith(("corner", "hidden")),
    CORNERS: lambda name: name.startswith("corner"),
    "all": lambda name: True,
}


def requirements_missed(result: Robustness, requirements: Sequence[Requirement] = REQUIREMENTS) -> list[Requirement]:
    """The requirements that a design does not meet on the plants it was proven on."""
    return [
        requirement
        for requirement in requirements
        if not requirement.is_met(result.worst(requirement.quantity, GROUPS[requirement.among])[1])
    ]
