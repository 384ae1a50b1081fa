"""Every example has a controller that keeps what is required in every gear, or it is said what is missed."""

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk
from powertrain_ctrl.antijerk.candidates import judged, view_of
from powertrain_ctrl.antijerk.rises import Rises
from powertrain_ctrl.antijerk.scales import scales_of
from powertrain_ctrl.antijerk.search import PUSH
from powertrain_ctrl.antijerk.shaping import FEEDBACK, feedback_gain, feedback_of, named
from powertrain_ctrl.examples.typical import ALL_GEARS, P2_GEARS, REAR_GEARS, TRUCK_GEARS
from powertrain_ctrl.report.antijerk import verdict
from powertrain_ctrl.studies.proof import UNNOTICED
from powertrain_ctrl.studies.requirements import DEFAULTS, asked
from powertrain_ctrl.studies.times import times_of
from powertrain_ctrl.studies.tolerances import hard_ones

MACHINES = {
    "fast": {"lag": 0.005, "delay": 0.002, "dt": 0.002, "torque_limits": (-300.0, 300.0)},
    "slow": {"lag": 0.03, "delay": 0.01, "dt": 0.01, "torque_limits": (-300.0, 300.0)},
}
ENGINE = {"lag": 0.03, "delay": 0.01, "dt": 0.01, "torque_limits": (-60.0, 400.0)}
TRUCK = ENGINE | {"torque_limits": (-300.0, 2500.0)}


def every_plant():
    found = {f"electric, {name}": pt.SampledPlant(car=pt.examples.electric(), **m) for name, m in MACHINES.items()}
    for gear in range(1, len(P2_GEARS) + 1):
        car = pt.examples.p2_hybrid(gear)
        electric = car.release("separation_clutch")
        found[f"p2_hybrid({gear}), engine"] = pt.SampledPlant(car=car, actuator="engine", **ENGINE)
        for name, machine in MACHINES.items():
            found[f"p2_hybrid({gear}), both, {name}"] = pt.SampledPlant(car=car, actuator="emachine", **machine)
            found[f"p2_hybrid({gear}), electric, {name}"] = pt.SampledPlant(
                car=electric, actuator="emachine", **machine
            )
    cars = (
        (pt.examples.rear_wheel_drive, REAR_GEARS, ENGINE),
        (pt.examples.all_wheel_drive, ALL_GEARS, ENGINE),
        (pt.examples.truck, TRUCK_GEARS, TRUCK),
    )
    for make, gears, actuator in cars:
        for gear in range(1, len(gears) + 1):
            found[f"{make.__name__}({gear})"] = pt.SampledPlant(car=make(gear), **actuator)
    return found


PLANTS = every_plant()
# Torque that comes 45 ms late to a first mode of 76 and of 68 ms, and twice the delay on half of the plants.
FORBIDDEN = ("p2_hybrid(5), electric, slow", "p2_hybrid(6), electric, slow")
# Second modes of the engine on its dual-mass flywheel, which feedforwards for two masses ring.
FEW = ("p2_hybrid(5), both, fast", "p2_hybrid(6), both, fast", "p2_hybrid(6), both, slow")


def require_all_met(plant):
    tuned = antijerk.tune(plant)
    assert tuned.proof.stable
    assert len(tuned.proof.proofs) == 29
    assert tuned.unmet == {}
    nominal, proof = tuned.proof["nominal"], tuned.proof
    assert nominal.margins.disk_margin >= 0.8
    assert nominal.oscillation_reduction >= 0.9
    assert nominal.t90_ratio <= 1.3
    assert proof.worst("disk_margin")[1] >= 0.5
    assert proof.worst("oscillation_reduction")[1] >= 0.75
    assert proof.worst("disturbance_reduction")[1] >= -0.05


@pytest.mark.parametrize("name", FEW)
def test_a_machine_between_engine_and_gearbox_gets_what_is_required_in_the_highest_gears(name):
    require_all_met(PLANTS[name])


@pytest.mark.campaign
@pytest.mark.parametrize("name", [name for name in PLANTS if name not in FORBIDDEN])
def test_every_example_gets_what_is_required_in_every_gear(name):
    require_all_met(PLANTS[name])


@pytest.mark.parametrize("name", FORBIDDEN)
def test_what_the_delay_forbids_is_named_and_the_design_is_stable_on_all_plants(name):
    tuned = antijerk.tune(PLANTS[name])
    assert tuned.proof.stable
    assert tuned.margins.disk_margin >= 0.8
    assert tuned.proof["nominal"].oscillation_reduction >= 0.9
    assert tuned.unmet
    assert set(tuned.unmet) <= {"worst_oscillation_reduction", "t90_ratio", "worst_disturbance_reduction"}
    # of the candidates that keep everything else none reaches what is missed, and the report says so with the number
    shown = set(tuned.unmet) & {"worst_oscillation_reduction", "t90_ratio"}
    assert shown
    for name in shown:
        requirement = asked(name, tuned.requirements[name])
        assert not requirement.is_met(tuned.best[name])
        assert f"with the rest kept at best {requirement.written(tuned.best[name], '.3g')}" in verdict(tuned)


def latin(random, box, count):
    """Evenly over the logarithm of a box of (least, largest)."""
    low, high = np.log(np.asarray(box).T)
    return np.exp(low + (high - low) * random.random((count, len(box))))


def random_designs(plant, seed, feedbacks, feedforwards):
    """Rows of oscillation reduction, worst one and t90 ratio of random designs that keep margins and disturbance."""
    random, scales = np.random.default_rng(seed), scales_of(plant)
    plants, times, model = hard_ones(plant), times_of(plant), scales.model
    x, sign = latin(random, FEEDBACK, 4000), np.where(random.random(4000) < 0.5, -1.0, 1.0)
    views = [view_of(each, plant.ratio, PUSH / model.frequency_hz) for each in plants]
    parts = [slice(i, i + 500) for i in range(0, 4000, 500)]
    found = [judged(views, [feedback_gain(scales, v.omega, x[p], sign[p]) for v in views]) for p in parts]
    margin = np.hstack([each.disk_margin for each in found])
    ringing = np.hstack([each.ringing for each in found]).max(axis=0)
    keeps = (margin[0] >= DEFAULTS["disk_margin"]) & (margin.min(axis=0) >= DEFAULTS["worst_disk_margin"])
    kept = np.flatnonzero(keeps & (ringing <= 1.0 - DEFAULTS["worst_disturbance_reduction"]))[:feedbacks]
    shaped = [(0.3, 1.5), (0.7, 0.45 / plant.dt / model.frequency_hz), (0.5, 3.0), (0.8, 1.2)]
    if scales.second_hz is not None:
        shaped += [(0.3, 1.5), (0.7, 0.45 / plant.dt / scales.second_hz), (0.4, 3.0), (0.8, 1.2)]
    plain = Rises(plants, scales, None, times)
    open_loop = plain.of(plain.demand[None])
    rows = []
    for i in [None, *kept]:  # without feedback too
        feedback = None if i is None else feedback_of(plant, named(scales, x[i], float(sign[i])))
        rises = Rises(plants, scales, feedback, times)
        risen = rises.of(rises.shaped(latin(random, shaped, feedforwards)))
        left = risen.swing / np.maximum(open_loop.swing, UNNOTICED)
        within = risen.torque <= max(plant.limits) / times.torque
        late = np.where(np.isnan(risen.t90[0]), np.inf, risen.t90[0]) / open_loop.t90[0]
        rows.append(np.stack([1.0 - left[0], 1.0 - left.max(axis=0), late])[:, within])
    return np.hstack(rows)


@pytest.mark.campaign
@pytest.mark.parametrize("name", FORBIDDEN)
def test_of_ten_thousand_random_designs_none_meets_what_the_delay_forbids(name):
    nominal, worst, late = random_designs(PLANTS[name], 2026, feedbacks=20, feedforwards=900)
    assert nominal.size > 10_000
    meets = (nominal >= 0.9) & (worst >= 0.75) & (late <= 1.3)
    assert not meets.any()
