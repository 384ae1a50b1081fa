"""Load change and launch as they are preset, and other ways to call the simulation."""

import control
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.base.systems import linear_system


def car():
    return pt.examples.conventional(damping="open")


def test_presets_are_those_of_the_figures():
    change, launch = pt.load_change(pt.examples.conventional()), pt.launch(car())
    t = change.time
    np.testing.assert_allclose(t, 0.002 * np.arange(1301), rtol=1e-15)
    np.testing.assert_allclose(change["engine_torque"], 250.0 * np.clip((t - 1.0) / 0.2, 0.0, 1.0), atol=1e-10)
    np.testing.assert_allclose(change["engine_speed"][t < 1.0], 2000 * 2 * np.pi / 60, rtol=1e-12)
    np.testing.assert_allclose(change["wheels_speed"][t < 1.0] * 18, 2000 * 2 * np.pi / 60, rtol=1e-12)
    t = launch.time
    np.testing.assert_allclose(t, 0.001 * np.arange(3501), rtol=1e-15)
    rise = np.clip((t - 1.5) / 0.22, 0.0, 1.0)
    np.testing.assert_allclose(launch["engine_torque"], 350.0 * rise, atol=1e-9)
    np.testing.assert_allclose(launch["clutch_capacity"], 370.0 * rise, atol=1e-9)
    for node in ("engine", "torsional_damper", "clutch_primary"):
        np.testing.assert_allclose(launch[f"{node}_speed"][t < 1.5], 5000 * 2 * np.pi / 60, rtol=1e-12)
    assert np.abs(launch["vehicle_speed"][t < 1.5]).max() < 1e-12  # rounding of the 524 rad/s beside it


def test_launch_needs_one_clutch():
    with pytest.raises(pt.TopologyError, match="launch needs one clutch, there are 0; use simulate"):
        pt.launch(pt.examples.front_wheel_drive())


def test_uneven_times_and_all_kinds_of_inputs_are_one_run():
    even = np.linspace(0.0, 3.0, 3001)
    uneven = np.unique(np.concatenate([[0.0, 3.0], np.random.default_rng(0).uniform(0.0, 3.0, 300)]))
    torque, capacity = pt.ramp(1.5, 0.22, 350.0), pt.ramp(1.5, 0.22, 370.0)
    speed = {"engine": pt.rpm(5000)}
    objects = pt.simulate(car(), uneven, {"engine_torque": torque, "clutch_capacity": capacity}, speed)
    functions = pt.simulate(
        car(),
        uneven,
        {"engine_torque": lambda t: float(torque(t)), "clutch_capacity": lambda t: float(capacity(t))},
        speed,
    )
    samples = pt.simulate(car(), even, {"engine_torque": torque(even), "clutch_capacity": capacity(even)}, speed)
    for name in ("engine_speed", "vehicle_speed"):
        np.testing.assert_allclose(functions[name], objects[name], atol=1e-6)
        np.testing.assert_allclose(samples[name][-1], objects[name][-1], atol=1e-9)
    np.testing.assert_allclose([e.time for e in functions.events], [e.time for e in objects.events], atol=1e-7)


@pytest.mark.parametrize("bad", [float("nan"), float("inf")])
def test_a_capacity_that_is_not_finite_is_named(bad):
    capacity = np.full(11, 100.0)
    capacity[6] = bad
    with pytest.raises(
        pt.PowertrainError, match=r'input "clutch_capacity" is (nan|inf) at t = 0\.6 s, permitted: finite'
    ):
        pt.simulate(car(), np.linspace(0.0, 1.0, 11), {"clutch_capacity": capacity})


def test_continuous_system_can_be_wired_to_a_controller():
    plant = pt.nonlinear_system(car())
    idle = linear_system([], [], [], [[-0.8]], inputs=["engine_speed"], outputs=["engine_torque"], name="idle")
    loop = control.interconnect(
        [plant, idle],
        inplist=["driveline.clutch_capacity"],
        inputs=["clutch_capacity"],
        outlist=["driveline.engine_speed", "driveline.vehicle_speed"],
        outputs=["engine_speed", "vehicle_speed"],
        check_unused=False,
    )
    t = np.linspace(0.0, 1.0, 201)
    start = pt.initial_state(plant, car(), {"engine": 100.0})
    y = control.input_output_response(loop, t, np.zeros(201), start, **pt.solver_settings()).outputs
    # open clutch: the engine side of 0.44 kg m^2 is braked by 0.8 N m s/rad
    assert y[0, -1] == pytest.approx(100.0 * np.exp(-0.8 / 0.44), rel=0.02)
    assert np.abs(y[1]).max() < 1e-9
