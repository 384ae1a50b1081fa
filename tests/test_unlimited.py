"""Loops on many plants at once, as linear systems while no limit acts, against each of them sample by sample.

Of families/unlimited, families/loops.
"""

from dataclasses import replace

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk
from powertrain_ctrl.families.loops import SIGNALS, loops_among, trial_of
from powertrain_ctrl.families.unlimited import pieces_of

CARS = [pt.examples.conventional(), pt.examples.electric(), pt.examples.rear_wheel_drive(gear=3)]
# A push by one half-sine is followed exactly here and to 1e-8 by pieces in the loop of one plant.
PUSHED, ALONE = 1e-8, 1e-10
BY_SPEED = ((0.0, -90.0, 260.0), (100.0, -90.0, 260.0), (130.0, -60.0, 120.0), (400.0, -40.0, 60.0))


def controllers(plant, random):
    lead = antijerk.lead_notch(plant, (0.02, 0.01), None)
    feedback = antijerk.speed_difference(plant, float(random.uniform(1.0, 8.0)), lead)
    model = pt.two_mass(plant.car)
    shaped = antijerk.inverse_notch(plant, model, 1.0, 1.3 * model.frequency_hz)
    return [None, antijerk.one_dof(plant, feedback), antijerk.two_dof(plant, model, feedback, shaped)]


@pytest.mark.parametrize("seed", range(32))
def test_loops_at_once_are_those_one_by_one(seed):
    random = np.random.default_rng(seed)
    pick = lambda *values: values[int(random.integers(len(values)))]  # noqa: E731
    dt, most = pick(0.002, 0.01), pick(80.0, 250.0, 700.0)
    plant = pt.SampledPlant(
        car=CARS[seed % 3],
        lag=0.02,
        delay=0.01,
        dt=dt,
        torque_limits=pick((-0.3 * most, most), BY_SPEED, (-np.inf, np.inf)),
        torque_rate=pick(np.inf, 2000.0, (3000.0, 1500.0)),
        speed=pick(0.0, 110.0, 125.0),
    )
    with_lag, plants = random.random() < 0.8, []
    for _ in range(4):
        car = plant.car.replace("vehicle", m=plant.car["vehicle"].m * random.uniform(0.7, 1.3))
        delay, lag = pick(0.0, dt, 0.37 * dt, 2.5 * dt, 3.0 * dt), pick(0.005, 0.02, 0.05) if with_lag else 0.0
        plants.append(replace(plant, car=car, lag=lag, delay=delay))
    initial = pick(0.0, 25.0)
    demand = pt.ramp(0.3, pick(0.0, 0.05, 0.1), initial + pick(0.0, 30.0, 0.6 * most), initial)
    pulse = pick(None, (0.2, 0.1), (0.3037, 0.0431), (0.0, 0.013), (0.85, 0.1))
    forces = [-random.uniform(200.0, 3000.0) for _ in plants] if pulse else None
    controller, steps = pick(*controllers(plant, random)), pick(1, 2, 10)
    trial = trial_of(plant, controller, demand, 0.9, pulse, initial, steps)
    values, final = loops_among(plants, trial, SIGNALS, forces)
    for i, each in enumerate(plants):
        alone = pt.closed_loop(
            each,
            controller,
            demand,
            duration=0.9,
            disturbance=pt.hybrid.signals.HalfSine(forces[i], *pulse) if pulse else None,
            initial_torque=initial,
            steps_per_sample=steps,
        )
        assert final[i] == pytest.approx(each.final_acceleration, rel=1e-12)
        for name, found in zip(SIGNALS, values[i], strict=True):
            allowed = (PUSHED if pulse else ALONE) * max(float(np.abs(alone[name]).max()), 1e-2)
            np.testing.assert_allclose(found, alone[name], rtol=0.0, atol=allowed, err_msg=name)


def test_a_loop_leaves_limits_over_speed_no_sooner_and_no_later_than_the_actuator():
    """Full torque up to 100 rad/s above a standstill, half of it 30 rad/s further; the demand asks for all of it."""
    plant = pt.SampledPlant(car=CARS[0], dt=0.01, torque_limits=BY_SPEED, speed=95.0)
    trial = trial_of(plant, None, pt.step(0.05, 250.0), 1.5, steps=1)
    names = ["torque_command", "engine_speed"]
    (found, other), _ = loops_among([plant, replace(plant, lag=0.02)], trial, names)
    for command, speed in (found, other):
        at = plant.speed + speed
        most = np.interp(at, [100.0, 130.0, 400.0], [260.0, 120.0, 60.0])
        asked = np.where(np.arange(len(command)) >= 5, 250.0, 0.0)
        np.testing.assert_allclose(command, np.minimum(asked, most), atol=1e-9)
        assert at.max() > 110.0


@pytest.mark.parametrize(("rates", "sign"), [((6000.0, 1000.0), -1.0), ((1000.0, 6000.0), 1.0)])
def test_a_rate_acts_in_its_own_direction_alone(rates, sign):
    """100 N m in 50 ms are 2000 N m/s: more than the slower rate, less than the other one."""
    plant = pt.SampledPlant(car=CARS[0], dt=0.01, torque_limits=(-200.0, 200.0), torque_rate=rates)
    for direction, slowest in ((sign, 1000.0), (-sign, 2000.0)):
        trial = trial_of(plant, None, pt.ramp(0.05, 0.05, direction * 100.0), 0.5, steps=1)
        ((command,),), _ = loops_among([plant], trial, ["torque_command"])
        assert np.abs(np.diff(command)).max() == pytest.approx(slowest * plant.dt, rel=1e-9)


@pytest.mark.parametrize("duration", [0.01, 0.03])
def test_a_loop_that_ends_before_its_torque_arrives_stands_still(duration):
    plant = pt.SampledPlant(car=CARS[0], dt=0.01, delay=0.05, torque_limits=(-50.0, 50.0))
    trial = trial_of(plant, None, pt.step(0.0, 250.0), duration)
    found, _ = loops_among([plant, replace(plant, delay=0.064)], trial, ["torque_command", "engine_speed"])
    assert (found[:, 0] == 50.0).all()
    assert not found[:, 1].any()


def test_pieces_are_as_long_as_the_demand():
    wanted = np.concatenate([np.zeros(50), np.linspace(0.0, 250.0, 11), np.full(340, 250.0)])
    pieces = pieces_of(wanted)
    assert len(pieces) == 3
    rebuilt = np.concatenate([value + slope * np.arange(samples) for samples, value, slope in pieces])
    np.testing.assert_allclose(rebuilt, wanted, atol=1e-12)
    assert pieces_of(np.array([3.0])) == [(1, 3.0, 0.0)]
