"""Random search for the anti-jerk designs, the same for every family: `python -m benchmarks.tune [family ...]`.

Each family gets the same number of candidates, the same plants and the same score. The plants are drawn at random inside
the tolerances; the grid on which designs are proven afterwards (`powertrain_ctrl.studies.variations`) is not among
them. The score adds up by how much each bar is missed, relative to the bar; ties go to the least oscillation.
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

CANDIDATES, PLANTS, SEED = 400, 8, 20260


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


def missed(value, bar, small_is_good=False):
    gap = (value - bar) / abs(bar) if small_is_good else (bar - value) / abs(bar)
    return max(0.0, gap) if np.isfinite(gap) else 10.0


def nominal_score(p, engine_only):
    score = missed(p.oscillation_reduction, 0.95) + missed(p.metrics.overshoot, 0.04, True)
    score += (
        missed(p.metrics.peak_jerk, 34.0, True) + missed(p.metrics.vdv, 0.80, True) + missed(p.t90_ratio, 1.2, True)
    )
    score += missed(p.margins.disk_margin, 0.85 if engine_only else 0.9)
    if not engine_only:
        score += missed(p.margins.zeta_first, 0.35) + missed(p.margins.zeta_second, 0.05)
        score += missed(p.disturbance_reduction, 0.65)
    return score


def worst_score(proofs, engine_only):
    def worst(name, pick=min):
        return pick(p.value(name) for p in proofs)

    score = missed(worst("oscillation_reduction"), 0.8 if engine_only else 0.88)
    score += missed(worst("t90_ratio", max), 1.3, True)
    if not engine_only:
        score += missed(worst("zeta_first"), 0.15) + missed(worst("zeta_second"), 0.015)
        score += missed(worst("disk_margin"), 0.6) + missed(worst("disturbance_reduction"), 0.45)
    return score - 1e-3 * worst("oscillation_reduction")


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
