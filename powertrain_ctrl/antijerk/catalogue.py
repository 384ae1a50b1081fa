"""Ready designs for a `SampledPlant`, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial

import control
import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError, UnknownNameError
from ..base.tables import Printed
from ..linear.assembly import kept
from ..reduction.twomass import TwoMass
from ..sampled.margins import loop_margins
from ..sampled.plant import SampledPlant
from .families import FAMILIES, feedback_with
from .feedback import lead_notch, rigid_reference, speed_difference
from .feedforward import SHAPED, inverse_notch, zv_shaper, zvd_shaper
from .parts import feedback_system
from .scales import Scales, scales_of
from .structure import one_dof, two_dof
from .tuning import DEFAULTS, TWO, tune

# Of the source's car, over its scales: a gain of 6 N m s/rad, a lead of 30 ms over 10 ms, 8 N m s/rad against a rigid
# reference of 0.5 Hz, new poles at 4 Hz.
GAIN, LEAD, RIGID, BANDWIDTH, POLES = 0.766, (0.667, 0.222), 1.021, 0.19, 1.516
# How much of its gain a design has, one after the other, until its disk margin is what is required.
SHARES = (1.0, 0.7, 0.5, 0.35, 0.25, 0.17, 0.12)


class Designs(Printed, dict[str, control.StateSpace]):
    """Controllers by name, printed as a table of their margins; ``left_out`` has the names of others with the reason."""

    def __init__(self, found: Mapping[str, control.StateSpace], left_out: Mapping[str, str], plant: SampledPlant):
        super().__init__(found)
        self.left_out, self.plant = dict(left_out), plant

    def __missing__(self, name: str) -> control.StateSpace:
        if name in self.left_out:
            raise PowertrainError(f'"{name}" is left out: {self.left_out[name]}')
        raise UnknownNameError("design", name, self, "among them")

    def __reduce__(self) -> tuple:
        return Designs, (dict(self), self.left_out, self.plant)

    headers = ("design", "disk margin", "zeta 1st", "zeta 2nd")

    def rows(self) -> list[list[str]]:
        """Rows of the printed table."""
        found = {name: loop_margins(self.plant, controller) for name, controller in self.items()}
        return [
            [name, f"{m.disk_margin:.2f}", f"{m.zeta_first:.3f}", f"{m.zeta_second:.3f}"] for name, m in found.items()
        ]

    @property
    def note(self) -> str:
        """What stands below the printed table."""
        return "\n".join(f"{name}: left out, {reason}" for name, reason in self.left_out.items())


@checked
def designs(plant: SampledPlant, model: TwoMass | None = None) -> Designs:
    """Controllers for a plant: the plain ones, feedforward alone, and others with both.

    Gains and weights are in units of the plant's own numbers (J1 omega1 of its two-mass model, first mode, lag, delay and
    sample time); each is turned down until the disk margin is 0.8, or the largest that it comes to.

    Parameters
    ----------
    plant : SampledPlant
    model : TwoMass, optional
        Design model; that of the car as the actuator drives it, ``two_mass(plant.car, driving=...)``, if not given.

    Returns
    -------
    dict
        Name to controller, each stable on this plant; the shapers only where the model's first mode oscillates. "two
        degrees of freedom" is what `tune` finds, unless it misses a requirement. What is not there is in
        ``left_out``, with the reason; asked for, it is a `PowertrainError` that says it.

    Raises
    ------
    TopologyError
        A driveline that has no two-mass model, as in `two_mass`.
    PowertrainError
        A first mode above the Nyquist frequency.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> designs = pt.antijerk.designs(plant)
    >>> sorted(designs)[:3], pt.loop_margins(plant, designs["two degrees of freedom"]).disk_margin > 1.0
    (['H-infinity', 'LQG', 'LQG, engine speed'], True)
    >>> designs.left_out
    {}
    """
    return Designs(*catalogue(plant, model), plant)


@kept(16)
def catalogue(
    plant: SampledPlant, model: TwoMass | None = None
) -> tuple[dict[str, control.StateSpace], dict[str, str]]:
    """Designs by name, and the reasons of those that are not there."""
    scales = scales_of(plant, model)
    design_model = scales.model
    first = design_model.frequency_hz
    standard = inverse_notch(plant, design_model, 0.7, min(POLES * first, 0.45 / plant.dt))
    shapers = {"ZV": zv_shaper, "ZVD": zvd_shaper} if design_model.damping_ratio < SHAPED else {}
    shaped = {name: shaper(plant, design_model) for name, shaper in shapers.items()}
    nothing = _nothing(plant)
    found: dict[str, control.StateSpace] = {}
    missing: dict[str, str] = {}
    for name, make in _with_feedback(plant, scales, standard, shaped.get("ZV")).items():
        controller, reason = strongest(plant, make)
        if controller is None:
            missing[name] = reason
        else:
            found[name] = controller
    for name, forward in {"inverse notch": standard, **shaped}.items():
        found[f"{name} alone"] = two_dof(plant, design_model, nothing, forward)
    try:
        tuned = tune(plant, model=model)
    except PowertrainError as error:
        missing[TWO] = str(error)
    else:
        if tuned.unmet:
            missing[TWO] = f"misses {', '.join(tuned.unmet)}; tune(plant) says by how much"
        else:
            found[TWO] = tuned.controller
    return found, missing


def _with_feedback(
    plant: SampledPlant, scales: Scales, standard: control.StateSpace, zv: control.StateSpace | None
) -> dict[str, Callable[[float], control.StateSpace]]:
    """Designs with a feedback by name, each from the share of its gain that it is to have."""
    lead = LEAD[0] * scales.latency, LEAD[1] * scales.latency
    shapings = {
        "P": None,
        "P, lead": lead_notch(plant, lead),
        "P, lead, notch": lead_notch(plant, lead, scales.second_hz),
    }

    def difference(name: str, share: float) -> control.StateSpace:
        return speed_difference(plant, share * GAIN * scales.gain, shapings[name])

    def single(name: str, share: float) -> control.StateSpace:
        return one_dof(plant, difference(name, share))

    def rigid(share: float) -> control.StateSpace:
        return rigid_reference(plant, share * RIGID * scales.gain, BANDWIDTH * scales.model.frequency_hz)

    def family(name: str, share: float) -> control.StateSpace:
        return two_dof(plant, scales.model, feedback_with(name, plant, scales, share), standard)

    makers: dict[str, Callable[[float], control.StateSpace]] = {name: partial(single, name) for name in shapings}
    makers["rigid reference alone"] = lambda share: one_dof(plant, rigid(share))
    if zv is not None:
        makers["ZV and P, lead, notch"] = lambda share: two_dof(
            plant, scales.model, difference("P, lead, notch", share), zv
        )
    return makers | {name: partial(family, name) for name in FAMILIES}


def strongest(
    plant: SampledPlant, make: Callable[[float], control.StateSpace]
) -> tuple[control.StateSpace | None, str]:
    """The first of a design's shares of its gain with the disk margin required, else that of the largest; or why none."""
    best, largest, reason = None, 0.0, "unstable on this plant with any gain"
    for share in SHARES:
        try:
            controller = make(share)
            margin = loop_margins(plant, controller).disk_margin
        except (PowertrainError, np.linalg.LinAlgError) as error:
            reason = str(error)
            continue
        if margin > largest:
            best, largest = controller, margin
        if margin >= DEFAULTS["disk_margin"]:
            break
    return best, reason


def _nothing(plant: SampledPlant) -> control.StateSpace:
    """A feedback that takes no torque off."""
    none, inputs = np.zeros((0, 0)), ("engine_speed", "wheels_speed")
    return feedback_system(none, np.zeros((0, 2)), np.zeros((1, 0)), np.zeros((1, 2)), plant.dt, inputs)
