"""Random search for the anti-jerk designs, the same for every family: `python -m benchmarks.tune [family ...]`.

Each family gets the same number of candidates, the same plants and the same score. The plants are drawn at random inside
the tolerances; the grid on which designs are proven afterwards (`powertrain_ctrl.studies.variations`) is not among
them. The score adds up by how much each requirement of the report is missed, relative to its limit; ties go to the least
oscillation.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import dataclasses
import json
import sys
import warnings

import numpy as np

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk, studies
from powertrain_ctrl.studies.requirements import ENGINE_SPEED_REQUIREMENTS, REQUIREMENTS, Requirement

CANDIDATES, PLANTS, SEED = 400, 8, 20260
# Of plants inside the tolerances: between what is required one at a time and at the corners.
INSIDE = Requirement("oscillation_reduction", "oscillation", "inside", 0.88, "%")
# What designs that read the engine speed only cannot keep up.
LEFT_OUT = {
    "nominal": ("zeta_first", "zeta_second", "disturbance_reduction"),
    "all": ("zeta_first", "zeta_second", "disk_margin", "disturbance_reduction"),
}


def log_uniform(random, low, high):
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def difference(random):
    lead = log_uniform(random, 0.01, 0.06)
    values = {
        "gain": log_uniform(random, 2.0, 14.0),
        "lead": [lead, lead / log_uniform(random, 1.5, 6.0)],
        "notch_hz": random.uniform(19.0, 24.0),
        "notch_damping": [log_uniform(random, 0.05, 0.3), log_uniform(random, 0.3, 1.0)],
    }

    def build(plant, model):
        shaping = antijerk.lead_notch(plant, values["lead"], values["notch_hz"], values["notch_damping"])
        return antijerk.speed_difference(plant, values["gain"], shaping)

    return values, build


def reference(random):
    values = {"gain": log_uniform(random, 2.0, 16.0), "bandwidth_hz": log_uniform(random, 0.1, 1.5)}
    return values, lambda plant, model: antijerk.rigid_reference(plant, **values)


def linear_quadratic(random, engine_only=False):
    values = {
        "effort": log_uniform(random, 1e-4, 0.1),
        "load_noise": log_uniform(random, 0.01, 30.0),
        "torque_noise": log_uniform(random, 1.0, 100.0),
        "speed_noise": log_uniform(random, 0.02, 2.0),
        "engine_only": engine_only,
    }
    return values, lambda plant, model: antijerk.lqg(plant, model, **values)


def h_infinity(random):
    values = {
        "effort": log_uniform(random, 0.01, 1.0),
        "corner_hz": log_uniform(random, 2.0, 40.0),
        "noise": log_uniform(random, 0.003, 0.3),
    }
    return values, lambda plant, model: antijerk.hinf(plant, model, **values)


FAMILIES = {
    "speed_difference": difference,
    "rigid_reference": reference,
    "lqg": linear_quadratic,
    "lqg_engine_only": lambda random: linear_quadratic(random, engine_only=True),
    "hinf": h_infinity,
}
ENGINE_ONLY = ("rigid_reference", "lqg_engine_only")


def training_plants(plant):
    random = np.random.default_rng(SEED)
    plants = []
    for _ in range(PLANTS):
        car = studies.scale_mass(plant.car, random.uniform(0.75, 1.25))
        car = studies.scale_stiffness(car, random.uniform(0.8, 1.2))
        car = studies.scale_damping(car, random.uniform(0.5, 1.0))
        plants.append(
            dataclasses.replace(plant, car=car, delay=random.uniform(0.01, 0.02), lag=random.uniform(0.02, 0.05))
        )
    return plants


def required(engine_only, among):
    """Requirements of the report for a group of plants by quantity, those for designs of one speed where they differ."""
    left_out = LEFT_OUT[among] if engine_only else ()
    known = [*REQUIREMENTS, *(ENGINE_SPEED_REQUIREMENTS if engine_only else ())]
    return {each.quantity: each for each in known if each.among == among and each.quantity not in left_out}


def missed(requirement, value):
    gap = requirement.missed_by(value)
    return max(0.0, gap) if np.isfinite(gap) else 10.0


def nominal_score(proof, engine_only):
    return sum(missed(each, proof.value(each.quantity)) for each in required(engine_only, "nominal").values())


def worst_score(proofs, engine_only):
    def worst(requirement):
        pick = min if requirement.is_least else max
        return pick(proof.value(requirement.quantity) for proof in proofs)

    asked = {INSIDE.quantity: INSIDE} | required(engine_only, "all")
    return sum(missed(each, worst(each)) for each in asked.values()) - 1e-3 * worst(INSIDE)


def search(family, plant, model, plants):
    random = np.random.default_rng(SEED + 1)
    engine_only = family in ENGINE_ONLY
    best = (np.inf, None)
    for _ in range(CANDIDATES):
        values, build = FAMILIES[family](random)
        forward = {"damping_ratio": random.uniform(0.6, 1.0), "frequency_hz": random.uniform(3.0, 5.0)}
        try:
            feedforward = antijerk.inverse_notch(plant, model, **forward)
            controller = antijerk.two_dof(plant, model, build(plant, model), feedforward)
            proof = studies.prove(plant, controller)
        except (pt.PowertrainError, ValueError, np.linalg.LinAlgError):
            continue
        if not proof.margins.stable:
            continue
        score = nominal_score(proof, engine_only)
        if score >= best[0] + 0.01:
            continue
        proofs = [studies.prove(each, controller) for each in plants]
        score += worst_score(proofs, engine_only)
        if score < best[0]:
            best = (score, {"feedback": values, "feedforward": forward})
            print(f"{family}: {score:.4f} {json.dumps(best[1])}", flush=True)
    return best


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    nominal = pt.SampledPlant(car=pt.examples.conventional())
    control_model = pt.two_mass(nominal.car)
    drawn = training_plants(nominal)
    for name in sys.argv[1:] or FAMILIES:
        search(name, nominal, control_model, drawn)
