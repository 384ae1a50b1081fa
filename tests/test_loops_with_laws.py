"""Sampled loops of cars with play and stages."""

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk, studies
from powertrain_ctrl.hybrid.model import plants_of
from powertrain_ctrl.sampled.controller import ControllerStepper
from powertrain_ctrl.sampled.cores import HybridCore
from powertrain_ctrl.sampled.loop import sampled_loop

SOURCE = pt.examples.conventional()
SHAFTS = SOURCE["drive_shafts"]
LIMITS = (-100.0, 400.0)
LINEAR = pt.SampledPlant(car=SOURCE, torque_limits=LIMITS)
# speed difference through lead and notch with 6 N m s/rad, torque through the inverse notch of the control model
MODEL = pt.two_mass(SOURCE)
PROVEN = antijerk.two_dof(
    LINEAR,
    MODEL,
    antijerk.speed_difference(LINEAR, 6.0, antijerk.lead_notch(LINEAR, (0.03, 0.01), 21.0885)),
    antijerk.inverse_notch(LINEAR, MODEL, damping_ratio=0.7, frequency_hz=4.0),
)


def with_play(half_degrees):
    """The source's car with play in series with the drive shafts."""
    gap = 2.0 * np.deg2rad(half_degrees)
    play = pt.Backlash(
        "drive_shafts", "final_drive_output", "wheels", gap=gap, stiffness=SHAFTS.stiffness, damping=SHAFTS.damping
    )
    car = pt.Driveline(*(play if e.name == "drive_shafts" else e for e in SOURCE))
    return pt.SampledPlant(car=car, torque_limits=LIMITS)


def test_without_a_gap_it_is_the_linear_loop():
    demand, options = pt.ramp(0.2, 0.1, 250.0, -30.0), {"duration": 2.0, "initial_torque": -30.0}
    one, other = (pt.closed_loop(plant, PROVEN, demand, **options) for plant in (LINEAR, with_play(1e-12)))
    for name in one.outputs:
        np.testing.assert_allclose(other[name], one[name], rtol=0.0, atol=1e-9 * np.abs(one[name]).max())


def test_a_push_on_the_vehicle_goes_through_the_same_core():
    push = pt.ramp(0.3, 0.05, -500.0) + pt.ramp(0.5, 0.05, 500.0)
    options = {"duration": 1.0, "initial_torque": 100.0, "disturbance": push}
    one, other = (pt.closed_loop(plant, PROVEN, lambda t: 100.0, **options) for plant in (LINEAR, with_play(1e-12)))
    np.testing.assert_allclose(
        other["vehicle_acceleration"],
        one["vehicle_acceleration"],
        atol=1e-9 * np.abs(one["vehicle_acceleration"]).max(),
    )


def from_overrun(plant, controller):
    """Tip-in from -30 N m to 250 N m in 0.1 s, all in steady motion with that torque before it."""
    plants = plants_of(plant.car, as_set=True)
    time = plant.dt / 10.0 * np.arange(2001)
    load = {"engine_torque": -30.0}
    core = HybridCore(plant, plants.model, plants.unknown, time, 10, {**plants.capacity}, {}, load)
    demand, stepper = pt.ramp(0.2, 0.1, 280.0), None if controller is None else ControllerStepper(controller, plant.dt)
    rate = -30.0 / plant.inertia

    def command(k, measured, limited):
        wanted = float(demand(k * plant.dt))
        # deviations from the steady motion before
        moved = measured - rate * k * plant.dt / np.array([1.0, plant.ratio])
        return wanted if stepper is None else stepper.advance(np.array([wanted, *moved, limited, plant.ratio]))

    sampled_loop(plant, core, command, (-70.0, 430.0), 200, 200)
    return core


@pytest.mark.parametrize(
    ("half", "controller", "peak", "ratio"),
    # of an independent computation
    [
        (0.5, PROVEN, 2910.0, 1.053),
        (1.0, PROVEN, 3008.0, 1.090),
        (2.0, PROVEN, 3170.0, 1.149),
        (1.0, None, 5300.0, 1.935),
    ],
)
def test_a_tip_in_through_the_gap_has_the_peaks_of_an_independent_computation(half, controller, peak, ratio):
    plant = with_play(half)
    found = from_overrun(plant, controller).signals()
    final = 250.0 * plant.final_acceleration
    assert found["drive_shafts_torque"].max() == pytest.approx(peak, rel=0.01)
    assert found["vehicle_acceleration"].max() / final == pytest.approx(ratio, rel=0.01)


def test_there_is_no_limit_cycle_after_a_pulse_without_load():
    demand = pt.step(0.2, 15.0) + pt.step(0.3, -15.0)
    response = pt.closed_loop(with_play(1.0), PROVEN, demand, duration=6.0)
    swing = response["speed_difference"]
    early = np.ptp(swing[(response.time > 0.2) & (response.time < 1.2)])
    late = np.ptp(swing[response.time > 5.0])
    assert early > 0.1
    assert late < 0.02 * early


def test_response_and_proof_of_a_car_with_play():
    plant = with_play(1.0)
    response = pt.tip_in(plant, PROVEN)
    assert [event.kind for event in response.events] == ["contact"]
    assert response["drive_shafts_twist"][-1] > np.deg2rad(1.0)
    # design and margins are those in contact
    assert pt.loop_margins(plant, PROVEN).disk_margin == pytest.approx(pt.loop_margins(LINEAR, PROVEN).disk_margin)
    plants = studies.variations(plant)
    assert plants["drive shafts +20 %"].car["drive_shafts"].stiffness == pytest.approx(1.2 * SHAFTS.stiffness)
    proof = pt.robustness(plant, PROVEN, {"modal damping": plants["modal damping"]})
    assert proof.stable


def test_a_two_stage_damper_is_scaled_and_proven_too():
    spring = SOURCE["damper_spring"]
    k = spring.stiffness
    stages = pt.MultiStageSpring(
        "damper_spring",
        spring.a,
        spring.b,
        twists=(-0.05, 0.02, 0.3),
        torques=(-0.05 * k, 0.02 * k, 0.02 * k + 0.56 * k),
    )
    car = pt.Driveline(*(stages if e.name == "damper_spring" else e for e in SOURCE))
    plant = pt.SampledPlant(car=car, torque_limits=LIMITS)
    stiffer = studies.scale_stiffness(car, 1.2, ["damper_spring"])
    assert stiffer["damper_spring"].torques[-1] == pytest.approx(1.2 * 0.58 * k)
    response = pt.tip_in(plant, antijerk.designs(plant)["two degrees of freedom"])
    assert "stage" in {event.kind for event in response.events}


def test_a_controlled_launch_goes_through_play():
    plant = with_play(1.0)
    response = pt.controlled_launch(plant, PROVEN, end=3.0)
    kinds = [event.kind for event in response.events]
    assert kinds.index("contact") < kinds.index("lock")
