"""The exact core in C against `nonlinear_system`, closed forms and `simulate`.

Of export/c_model, export/c_tables, export/kernel, export/adjustable.
"""

import re
import subprocess
from pathlib import Path

import control
import numpy as np
import pytest
from in_c import (
    CASES,
    COMPILER,
    FOLDER,
    STRICT,
    WITHOUT,
    CPlant,
    gearbox,
    of_c,
    of_the_package,
    played,
    rigid,
    switching,
    two_bodies,
)

import powertrain_ctrl as pt

in_c = pytest.mark.skipif(COMPILER is None, reason=WITHOUT)


@in_c
@pytest.mark.parametrize("case", CASES)
def test_speeds_twists_and_modes_are_those_of_nonlinear_system(case):
    car, dt, count, inputs, speed, permitted = CASES[case]
    times = np.arange(count) * dt
    plant = CPlant(car, case.replace(" ", "_"), dt=dt, initial_speed=speed)
    for hold in ("zero", "linear"):
        system, u, expected = of_the_package(car, dt, times, inputs, speed, hold)
        plant.init()
        shown = of_c(plant, u, len(expected), hold)
        for name, mine, theirs in zip(system.output_labels, shown, expected, strict=True):
            if name.endswith("_speed"):
                assert np.abs(mine - theirs).max() <= permitted, name
            elif name.endswith("_mode"):
                assert (mine == theirs).all(), name
            else:  # of what it is a part of: accelerations are torques over inertias, here down to 0.01 kg m^2
                size = np.abs(expected).max() if name.endswith("_acceleration") else max(1.0, np.abs(theirs).max())
                assert np.abs(mine - theirs).max() <= 100.0 * permitted * size, name
        if case != "linear":
            modes = [i for i, name in enumerate(system.output_labels) if name.endswith("_mode")]
            assert (np.diff(shown[modes], axis=1) != 0.0).any()


@in_c
def test_the_search_over_all_choices_finds_the_modes_that_letting_go_finds():
    """It is for where rounding lets no choice agree; here it has to find all of them."""
    car, dt, count, inputs, speed, permitted = CASES["four clutches"]

    def searching(source):
        assert "round < 2 * o.count + 1" in source
        return source.replace("round < 2 * o.count + 1", "round < 0")

    plant = CPlant(car, "searching", ("-O1",), searching, dt=dt, initial_speed=speed)
    system, u, expected = of_the_package(car, dt, np.arange(count) * dt, inputs, speed)
    rows = [i for i, name in enumerate(system.output_labels) if name.endswith(("_speed", "_mode"))]
    assert np.abs(of_c(plant, u, len(expected))[rows] - np.asarray(expected)[rows]).max() <= permitted


@in_c
def test_a_linear_car_is_that_of_sampled_state_space():
    car, dt, count, inputs, _, _ = CASES["linear"]
    plant, times = CPlant(car, "sampled", dt=dt), np.arange(count) * dt
    G = pt.state_space(
        car, "engine_torque", ["engine_speed", "wheels_speed", "vehicle_acceleration", "drive_shafts_torque"]
    )
    torque = inputs["engine_torque"](times)
    expected = control.forced_response(control.sample_system(G, dt), times, torque).outputs
    system = pt.nonlinear_system(car, dt=dt)
    u = pt.input_values(system, car, times, inputs)
    shown = of_c(plant, u, system.noutputs)[[system.find_output(name) for name in G.output_labels]]
    assert (np.abs(shown - expected).max(axis=1) <= [1e-9, 1e-9, 1e-9, 1e-8]).all()


def event_time(plant, law=0, states=2):
    """[s], from behind states and time of the plant."""
    return np.frombuffer(plant.memory, dtype=float, count=states + 2 + law)[-1]


@in_c
def test_a_lock_within_a_step_is_located():
    car, expected = two_bodies(47.0)  # 0.4468 s
    plant = CPlant(car, "lock", dt=0.02, initial_speed={"a": 100.0})
    for _ in range(30):
        assert plant.step([0.0, 0.0, 47.0], [0.0, 0.0, 47.0]) == 0
    assert abs(event_time(plant) - expected) < 1e-12
    # momentum is kept
    np.testing.assert_allclose(plant.outputs([0.0, 0.0, 47.0], 7)[:2], 30.0, rtol=1e-13)


@in_c
def test_a_flank_within_a_step_is_met_on_time():
    car = pt.Driveline(
        pt.Inertia("a", J=0.3),
        pt.Backlash("play", "a", "b", gap=0.05, stiffness=1e4, damping=0.0),
        pt.Inertia("b", J=0.7),
    )
    plant = CPlant(car, "flank", dt=5e-3, initial_speed={"a": 7.0, "b": 0.0})
    plant.step([0.0, 0.0], [0.0, 0.0])
    assert abs(event_time(plant, states=4) - 0.025 / 7.0) < 1e-14
    # in contact for half a period of the two bodies on the spring, then apart at the opposite speed: an elastic blow
    period = 2.0 * np.pi / np.sqrt(1e4 * (1.0 / 0.3 + 1.0 / 0.7))
    for _ in range(3):
        plant.step([0.0, 0.0], [0.0, 0.0])
    assert abs(event_time(plant, states=4) - (0.025 / 7.0 + 0.5 * period)) < 1e-11
    np.testing.assert_allclose(plant.outputs([0.0, 0.0], 7)[:2], [-2.8, 4.2], rtol=1e-12)


@in_c
@pytest.mark.parametrize("case", ["clutch", "four clutches"])
def test_events_come_when_simulate_says(case):
    car, dt, count, inputs, speed, _ = CASES[case]
    times = np.arange(count) * dt
    plant = CPlant(car, f"events_{len(car)}", dt=dt, initial_speed=speed)
    system = pt.nonlinear_system(car, dt=dt)
    u = pt.input_values(system, car, times, inputs)
    of_c(plant, u, system.noutputs, "linear")
    sampled = {name: row for name, row in zip(system.input_labels, u, strict=True)}
    response = pt.simulate(car, times, sampled, initial_speed=speed)
    states = sum(name.endswith(("_twist", "_speed")) for name in system.state_labels)
    for law, name in enumerate(car.clutches):
        last = [event.time for event in response.events if event.element == name][-1]
        assert abs(event_time(plant, law, states) - last) < 1e-9


@in_c
def test_parameters_give_the_car_with_these_values():
    car, dt, count, inputs, speed, _ = CASES["clutch"]
    values = {"vehicle.m": 1234.0, "drive_shafts.stiffness": 9000.0, "engine.J": 0.25, "tyres.damping": 0.0}
    plant = CPlant(car, "parameters", dt=dt, initial_speed=speed, parameters=list(values))
    times, other = np.arange(count) * dt, car.replace(values)
    for changed, given in ((car, None), (other, list(values.values()))):
        system, u, expected = of_the_package(changed, dt, times, inputs, speed)
        assert plant.init(given) == 0
        speeds = [i for i, name in enumerate(system.output_labels) if name.endswith("_speed")]
        assert np.abs(of_c(plant, u, len(expected)) - expected)[speeds].max() <= 1e-8
    assert "permitted: finite and > 0" in plant.message(plant.init([-1.0, 9000.0, 0.25, 0.0]))
    assert plant.init([1234.0, 9000.0, 0.25, np.nan]) != 0


@in_c
def test_what_the_plant_refuses_leaves_it_as_it_was():
    car, _ = two_bodies(47.0)
    plant = CPlant(car, "refusals", initial_speed={"a": 100.0})
    plant.step([1.0, 0.0, 47.0], [1.0, 0.0, 47.0])
    before = plant.outputs([0.0, 0.0, 47.0], 7)
    for wrong, message in ((-1.0, "a capacity is negative"), (np.nan, "an input is not finite")):
        status = plant.step([0.0, 0.0, 47.0], [0.0, 0.0, wrong])
        assert status
        assert message in plant.message(status)
    np.testing.assert_array_equal(plant.outputs([0.0, 0.0, 47.0], 7), before)


@in_c
@pytest.mark.parametrize("case", ["linear", "four clutches", "stages", "dog and moved node"])
def test_neither_compiler_nor_sanitizers_find_anything_and_there_is_no_heap(case):
    car, dt, _, _, speed, _ = CASES[case]
    source = pt.export.c_plant(car, dt, initial_speed=speed)
    assert not re.search(r"alloc\(|\bfree\(|<stdlib.h>", source)
    file = Path(FOLDER.name) / "sanitized.c"
    file.write_text(
        source
        + """
#include <stdio.h>
static driveline_plant it;
int main(void)
{
    double u[NV + 1] = {0.0}, y[NY];
    int status = driveline_init(&it, 0);
    for (int k = 0; k < 300 && !status; ++k) {
        for (int i = 0; i < NV; ++i) u[i] = k < 50 ? 0.0 : 60.0 + 40.0 * ((k / 20 + i) % 3);
        status = driveline_step(&it, u, u);
        if (!status) status = driveline_outputs(&it, u, y);
    }
    printf("%d %s\\n", status, driveline_message(status));
    return status;
}
"""
    )
    flags = ["-O0", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    program = file.with_suffix("")
    built = subprocess.run([COMPILER, *STRICT, *flags, "-o", program, file, "-lm"], capture_output=True, text=True)
    if "sanitize" in built.stderr and "cannot find" in built.stderr:
        pytest.skip("the compiler has no sanitizers")
    assert not built.returncode, built.stderr
    ran = subprocess.run([program], capture_output=True, text=True)
    assert (ran.returncode, ran.stdout) == (0, "0 \n"), ran.stderr


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: pt.export.c_plant(gearbox(), dt=0.0), "dt = 0.0 s, permitted"),
        (lambda: pt.export.c_plant(gearbox(), name="a b"), "permitted: a C identifier"),
        (lambda: pt.export.c_plant(switching()), "switches"),
        (lambda: pt.export.c_plant(gearbox(), parameters=["p1.ratio"]), "p1.ratio cannot be a parameter in C"),
        (lambda: pt.export.c_plant(gearbox(), parameters=["k1.max_torque"]), "a capacity is an input"),
        (lambda: pt.export.c_plant(gearbox(), parameters=["vehicle.mm"]), 'did you mean "vehicle.m"'),
        (lambda: pt.export.c_plant(gearbox(), parameters=["vehicle.m"] * 2), "permitted: each once"),
        (lambda: pt.export.c_plant(gearbox(), parameters=["vehicles.m"]), 'did you mean "vehicle"'),
        (lambda: pt.export.c_plant(played(), parameters=["play.gap"]), "play.gap cannot be a parameter in C"),
        (lambda: pt.export.c_plant(rigid(), initial_speed={"engin": 1.0}), 'did you mean "engine"'),
        (lambda: pt.export.c_plant(CASES["dog and moved node"][0], parameters=["engine.J"]), "SpeedSource"),
        (lambda: pt.export.c_plant(massless(), parameters=["b.J"]), '"joint" has none'),
        (lambda: pt.export.c_plant(long_chain()), "at most 200"),
    ],
)
def test_what_cannot_be_exported_says_why(call, message):
    with pytest.raises(pt.PowertrainError) as caught:
        call()
    assert message in str(caught.value)


def massless():
    """Two bodies on two springs in series."""
    return pt.Driveline(
        pt.Inertia("a", J=0.3),
        pt.SpringDamper("s", "a", "joint", stiffness=100.0),
        pt.SpringDamper("t", "joint", "b", stiffness=300.0),
        pt.Inertia("b", J=0.7),
    )


def long_chain():
    bodies = [pt.Inertia(f"n{i}", J=0.1) for i in range(110)]
    return pt.Driveline(*bodies, *(pt.SpringDamper(f"s{i}", f"n{i}", f"n{i + 1}", stiffness=100.0) for i in range(109)))
