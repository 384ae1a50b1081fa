"""Ready designs for a `SampledPlant`, by name."""

from __future__ import annotations

import control
import numpy as np

from ..base.doors import checked
from ..linear.modal import modes
from ..reduction.condensed import two_mass
from ..reduction.twomass import TwoMass
from ..sampled.plant import SampledPlant
from .feedback import lead_notch, rigid_reference, speed_difference
from .feedforward import SHAPED, inverse_notch, zv_shaper, zvd_shaper
from .optimal import lqg
from .parts import feedback_system
from .robust import hinf
from .structure import one_dof, two_dof

# What a random search of 400 candidates for each family found (benchmarks/tune.py): the same score, the same eight plants
# drawn inside the tolerances, none of them on the grid of `studies.variations`. The source's car, first gear.
TUNED: dict[str, dict] = {
    "speed difference": {
        "feedback": {"gain": 7.43, "lead": (0.0421, 0.00899), "notch": 20.3 / 21.09, "notch_damping": (0.113, 0.570)},
        "feedforward": {"damping_ratio": 0.784, "frequency_hz": 4.20},
    },
    "rigid reference": {
        "feedback": {"gain": 6.43, "bandwidth_hz": 0.733},
        "feedforward": {"damping_ratio": 0.791, "frequency_hz": 4.81},
    },
    "LQG": {
        "feedback": {"effort": 0.00627, "load_noise": 8.33, "torque_noise": 1.11, "speed_noise": 0.0877},
        "feedforward": {"damping_ratio": 0.675, "frequency_hz": 4.38},
    },
    "LQG, engine speed": {
        "feedback": {"effort": 0.0023, "load_noise": 1.04, "torque_noise": 1.20, "speed_noise": 0.355},
        "feedforward": {"damping_ratio": 0.787, "frequency_hz": 4.52},
    },
    "H-infinity": {
        "feedback": {"effort": 0.0514, "corner_hz": 38.4, "noise": 0.0718},
        "feedforward": {"damping_ratio": 0.735, "frequency_hz": 4.66},
    },
}


@checked
def designs(plant: SampledPlant, model: TwoMass | None = None) -> dict[str, control.StateSpace]:
    """Controllers for a plant: the plain ones, feedforward alone, and the tuned ones with both.

    Gains and weights are those chosen for the source's car in first gear, whatever the plant; ratio, design model and
    notch are the plant's. For another car they are where to start from.

    Parameters
    ----------
    plant : SampledPlant
    model : TwoMass, optional
        Design model, ``two_mass(plant.car)`` if not given.

    Returns
    -------
    dict
        Name to controller; the shapers only where the model's first mode oscillates. The tuned ones are those of
        `TUNED`, in two degrees of freedom; "proven" meets every bar on the detailed model of the source's car.

    Raises
    ------
    TopologyError
        A driveline that has no two-mass model, as in `two_mass`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> designs = pt.antijerk.designs(plant)
    >>> sorted(designs)[:3], round(pt.loop_margins(plant, designs["proven"]).disk_margin, 2)
    (['H-infinity', 'LQG', 'LQG, engine speed'], 1.19)
    """
    model = two_mass(plant.linear) if model is None else model
    second = second_mode_hz(plant)
    standard = inverse_notch(plant, model)
    lead_and_notch = speed_difference(plant, 6.0, lead_notch(plant, notch_hz=second))
    nothing = feedback_system(
        np.zeros((0, 0)),
        np.zeros((0, 2)),
        np.zeros((1, 0)),
        np.zeros((1, 2)),
        plant.dt,
        ("engine_speed", "wheels_speed"),
    )
    shapers = {"ZV": zv_shaper, "ZVD": zvd_shaper} if model.damping_ratio < SHAPED else {}
    shaped = {name: shaper(plant, model) for name, shaper in shapers.items()}
    found = {
        "P": one_dof(plant, speed_difference(plant, 6.0)),
        "P, lead": one_dof(plant, speed_difference(plant, 6.0, lead_notch(plant))),
        "P, lead, notch": one_dof(plant, lead_and_notch),
        "rigid reference alone": one_dof(plant, rigid_reference(plant)),
        "inverse notch alone": two_dof(plant, model, nothing, standard),
        **{f"{name} alone": two_dof(plant, model, nothing, shaper) for name, shaper in shaped.items()},
    }
    if shaped:
        found["ZV and P, lead, notch"] = two_dof(plant, model, lead_and_notch, shaped["ZV"])
    found["proven"] = two_dof(plant, model, lead_and_notch, standard)
    for name, tuned in TUNED.items():
        forward = inverse_notch(plant, model, **tuned["feedforward"])
        found[name] = two_dof(plant, model, _feedback(name, dict(tuned["feedback"]), plant, model, second), forward)
    return found


def second_mode_hz(plant: SampledPlant) -> float | None:
    """Second elastic mode of the plant's driveline [Hz] if the sampling can see it, for the notch."""
    result = modes(plant.linear)
    elastic = result.frequency_hz[result.n_rigid :]
    return float(elastic[1]) if len(elastic) > 1 and elastic[1] < 0.45 / plant.dt else None


def _feedback(name: str, values: dict, plant: SampledPlant, model: TwoMass, second: float | None) -> control.StateSpace:
    if name == "speed difference":
        notch = values["notch"] * second if second else None
        shaping = lead_notch(plant, values["lead"], notch, values["notch_damping"])
        return speed_difference(plant, values["gain"], shaping)
    if name == "rigid reference":
        return rigid_reference(plant, **values)
    if name == "H-infinity":
        return hinf(plant, model, **values)
    return lqg(plant, model, **values, engine_only=name != "LQG")
