"""The actuator of a sampled plant: any node, times and limits over speed, rates that are never exceeded; as a file says it.

Of sampled/actuator, sampled/files.
"""

import dataclasses

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk

PLANT = pt.SampledPlant(car=pt.examples.conventional())
# 150 N m up to a base speed of 200 rad/s, then 30 kW in two chords
MACHINE = {0.0: (-150.0, 150.0), 200.0: (-150.0, 150.0), 400.0: (-75.0, 75.0), 800.0: (-37.5, 37.5)}
HIGH_GAIN = antijerk.one_dof(PLANT, antijerk.speed_difference(PLANT, 6.0))


def hybrid():
    """Engine and electric machine on one shaft, a car behind 9 : 1."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.15),
        pt.SpringDamper("damper", "engine", "machine", stiffness=800.0, damping=2.0),
        pt.Inertia("machine", J=0.05),
        pt.Gear("gear", "machine", "shaft", ratio=9.0),
        pt.SpringDamper("half_shafts", "shaft", "wheels", stiffness=12e3, damping=60.0),
        pt.Inertia("wheels", J=2.0),
        pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=2e5, damping=4e3),
        pt.Mass("vehicle", m=1600.0),
    )


def test_a_time_by_speed_is_read_in_straight_lines():
    plant = dataclasses.replace(PLANT, lag={100.0: 0.06, 300.0: 0.02}, delay={0.0: 0.03, 300.0: 0.0}, speed=200.0)
    assert plant.lag == pytest.approx(0.04, rel=1e-14)
    assert plant.delay == pytest.approx(0.01, rel=1e-14)


@pytest.mark.parametrize(("speed", "largest"), [(0.0, 150.0), (300.0, 112.5), (600.0, 56.25), (900.0, 37.5)])
def test_limits_by_speed_are_read_in_straight_lines(speed, largest):
    plant = dataclasses.replace(PLANT, torque_limits=MACHINE, speed=speed)
    assert plant.limits == pytest.approx((-largest, largest))
    assert plant.limits_at(600.0) == pytest.approx((-56.25, 56.25))


def test_a_demand_beyond_constant_power_follows_the_limit_of_each_sample():
    plant = dataclasses.replace(PLANT, torque_limits=MACHINE, speed=250.0, lag=0.0, delay=0.0)
    response = pt.closed_loop(plant, None, pt.ramp(0.5, 0.1, 400.0), duration=6.0, steps_per_sample=1)
    speed = 250.0 + response["engine_speed"]
    assert speed[-1] > 400.0
    permitted = np.interp(speed, list(MACHINE), [high for _, high in MACHINE.values()])
    late = response.time > 0.7
    np.testing.assert_allclose(response["torque_command"][late], permitted[late], rtol=1e-12)


@pytest.mark.parametrize("controller", [None, HIGH_GAIN], ids=["open loop", "one degree of freedom"])
@pytest.mark.parametrize("rate", [700.0, (700.0, 1500.0)])
@pytest.mark.parametrize("sensors", [None, pt.Sensors(engine_noise=0.5)], ids=["exact", "noise"])
def test_the_rate_of_the_torque_is_never_exceeded(controller, rate, sensors):
    plant = dataclasses.replace(PLANT, torque_rate=rate)
    wanted = pt.samples([0.0, 0.5, 0.5, 1.5, 1.5], [0.0, 0.0, 250.0, 250.0, 50.0])
    response = pt.closed_loop(plant, controller, wanted, duration=3.0, sensors=sensors, steps_per_sample=1)
    rates = np.diff(response["torque_command"]) / plant.dt
    rise, fall = rate if isinstance(rate, tuple) else (rate, rate)
    assert rates.max() <= rise * (1.0 + 1e-9)
    assert rates.min() >= -fall * (1.0 + 1e-9)
    # and it is made use of: the demand jumps both ways
    assert rates.max() >= rise * (1.0 - 1e-9)
    assert rates.min() <= -fall * (1.0 - 1e-9)


RATES = (200.0, 400.0)


def slow_with(gain, **plant):
    """A plant with these rates and its feedback."""
    plant = pt.SampledPlant(**{"torque_limits": (-500.0, 500.0), "torque_rate": RATES} | plant)
    return plant, antijerk.one_dof(plant, antijerk.speed_difference(plant, gain))


def tip_in_of_a_tuned_one():
    plant = dataclasses.replace(PLANT, torque_rate=RATES)
    return plant, pt.tip_in(plant, antijerk.tune(PLANT).controller)


def of(manoeuvre):
    plant, controller = slow_with(6.0, car=pt.examples.conventional())
    return plant, manoeuvre(plant, controller)


def launched():
    plant, controller = slow_with(6.0, car=pt.examples.conventional(damping="open"))
    return plant, pt.controlled_launch(plant, controller)


def gear_shifted():
    plant, controller = slow_with(4.0, car=pt.examples.p2_hybrid())
    return plant, pt.controlled_shift(plant, controller, "odd_clutch", "even_clutch")


def engine_started():
    car = pt.examples.p2_hybrid(2)
    plant, controller = slow_with(2.0, car=car.release("separation_clutch").part("vehicle"), lag=0.005, delay=0.002)
    return plant, pt.controlled_start(plant, controller, car)


def driven():
    plant, controller = slow_with(6.0, car=pt.examples.conventional())
    return plant, pt.controlled_run(plant, controller, pt.step(0.2, 200.0) + pt.step(0.8, -300.0), duration=1.5)


MANOEUVRES = {
    "tip-in": lambda: of(pt.tip_in),
    "tip-in, tuned": tip_in_of_a_tuned_one,
    "tip-out": lambda: of(pt.tip_out),
    "change of mind": lambda: of(pt.change_of_mind),
    "let-off": lambda: of(pt.let_off),
    "braking": lambda: of(pt.braking),
    "wheel disturbance": lambda: of(pt.wheel_disturbance),
    "launch": launched,
    "gear shift": gear_shifted,
    "engine start": engine_started,
    "run": driven,
}


@pytest.mark.parametrize("name", MANOEUVRES)
def test_in_every_manoeuvre_what_is_sent_keeps_the_rate_and_makes_use_of_it(name):
    plant, response = MANOEUVRES[name]()
    points = round(plant.dt / (response.time[1] - response.time[0]))
    command = response["torque_command"]
    assert not ((np.flatnonzero(np.diff(command)) + 1) % points).any()  # held from sample to sample
    change = np.diff(command[::points])
    rise, fall = RATES[0] * plant.dt, RATES[1] * plant.dt
    assert change.max() <= rise * (1.0 + 1e-9)
    assert change.min() >= -fall * (1.0 + 1e-9)
    assert change.max() >= rise * (1.0 - 1e-9) or change.min() <= -fall * (1.0 - 1e-9)


def test_a_rate_that_is_never_reached_changes_nothing():
    free = pt.tip_in(PLANT, HIGH_GAIN)
    slow = pt.tip_in(dataclasses.replace(PLANT, torque_rate=1e6), HIGH_GAIN)
    for name in ("torque_command", "vehicle_acceleration"):
        np.testing.assert_array_equal(slow[name], free[name])


def test_through_play_the_rate_holds_too():
    car = pt.examples.conventional()
    shafts = car["drive_shafts"]
    play = pt.Backlash("drive_shafts", shafts.a, shafts.b, gap=0.02, stiffness=shafts.stiffness, damping=shafts.damping)
    changed = pt.Driveline(*(play if element is shafts else element for element in car))
    plant = dataclasses.replace(PLANT, car=changed, torque_rate=1200.0, torque_limits=(-50.0, 350.0))
    response = pt.closed_loop(plant, HIGH_GAIN, pt.step(0.3, 200.0, -30.0), duration=1.0, initial_torque=-30.0)
    rates = np.diff(response["torque_command"][::10]) / plant.dt
    assert 1200.0 * (1.0 - 1e-9) <= np.abs(rates).max() <= 1200.0 * (1.0 + 1e-9)


def test_any_node_that_turns_can_be_the_actuator():
    car = hybrid()
    plants = {node: pt.SampledPlant(car=car, actuator=node) for node in ("engine", "machine")}
    for node, plant in plants.items():
        assert plant.engine == node
        assert plant.ratio == pytest.approx(9.0)
        system = pt.state_space(car, [f"{node}_torque"], [f"{node}_speed", "vehicle_acceleration"])
        s = 5j
        expected = (system.C @ np.linalg.solve(s * np.eye(system.nstates) - system.A, system.B) + system.D)[:, 0]
        P = plant.continuous
        got = (P.C @ np.linalg.solve(s * np.eye(P.nstates) - P.A, P.B[:, :1]) + P.D[:, :1])[:, 0]
        np.testing.assert_allclose(got[[0, 3]] * (s * plant.lag + 1.0), expected, rtol=1e-9)


def test_signals_keep_their_names_whatever_the_actuator_is_called():
    plant = pt.SampledPlant(car=hybrid(), actuator="machine")
    assert plant.discrete().input_labels == ["torque_command"]
    assert plant.discrete().output_labels[:2] == ["engine_speed", "wheels_speed"]
    response = pt.tip_in(plant)
    assert {"torque_demand", "torque_command", "engine_torque"} <= set(response.outputs) | {"torque_demand"}


def test_without_wheels_the_heaviest_other_inertia_is_the_load():
    car = pt.Driveline(
        pt.Inertia("rotor", J=4e6),
        pt.SpringDamper("shaft", "rotor", "hub", stiffness=1e8, damping=1e5),
        pt.Inertia("hub", J=2e4),
        pt.Gear("gearbox", "generator", "hub", ratio=90.0),
        pt.Inertia("generator", J=90.0),
    )
    plant = pt.SampledPlant(car=car, actuator="generator", torque_limits=(-1e4, 1e4))
    assert (plant.vehicle, plant.wheels, plant.push) == ("rotor", ("rotor",), "rotor_torque")
    assert plant.inertia == pytest.approx(90.0 + (2e4 + 4e6) / 90.0**2)


def test_the_repr_says_rate_and_speed():
    plant = dataclasses.replace(PLANT, torque_limits=MACHINE, speed=300.0, torque_rate=(800.0, 2000.0))
    assert "torque -112.5 to 112.5 N m at 300 rad/s, at most 800 up and 2000 N m/s down" in repr(plant)
    assert "at most 900 N m/s" in repr(dataclasses.replace(PLANT, torque_rate=900.0))
    free = repr(dataclasses.replace(PLANT, torque_limits=(-np.inf, np.inf), torque_rate=(np.inf, 900.0)))
    assert "torque without limits, at most 900 N m/s down; engine" in free


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"actuator": "engin"}, 'actuator "engin" is not a node of the driveline; did you mean "engine"'),
        ({"actuator": "vehicle"}, "actuator = 'vehicle', permitted: a node that turns"),
        ({"torque_limits": (350.0, 0.0)}, r"torque_limits = \(350.0, 0.0\) N m, permitted: \(smallest, largest\)"),
        ({"torque_limits": {0.0: (10.0, 5.0)}}, "torque_limits = .* permitted"),
        ({"torque_limits": {}}, "torque_limits = .* permitted"),
        ({"torque_rate": 0.0}, r"torque_rate = 0.0 N m/s, permitted: > 0"),
        ({"torque_rate": (100.0, -1.0)}, r"torque_rate = \(100.0, -1.0\) N m/s, permitted: > 0"),
        ({"torque_rate": (1.0, 2.0, 3.0)}, "torque_rate = .* permitted"),
        ({"lag": 30}, "lag = 30.0 s, permitted: >= 0 and below 1; 30 ms is 0.03 s"),
        ({"dt": 10}, "dt = 10.0 s, permitted: > 0 and below 1; 10 ms is 0.01 s"),
        ({"lag": {100.0: 30.0}}, "lag = 30.0 s, permitted"),
        ({"delay": {}}, "delay = {} s, permitted: at least one speed"),
    ],
)
def test_what_no_actuator_has_is_refused(values, message):
    with pytest.raises(pt.PowertrainError, match=message):
        dataclasses.replace(PLANT, **values)


def file_with(tmp_path, table):
    path = tmp_path / "car.toml"
    hybrid().save(path)
    path.write_text(f"{path.read_text()}\n[plant]\n{table}\n")
    return path


def test_a_file_says_what_drives_the_car(tmp_path):
    path = file_with(
        tmp_path,
        'lag = 0.005\ndelay = [[0.0, 0.004], [400.0, 0.002]]\ndt = 0.002\nspeed = 200.0\nactuator = "machine"\n'
        "torque_limits = [[0.0, -150, 150], [400.0, -75, 75]]\ntorque_rate = [1500.0, 3000.0]",
    )
    plant = pt.load_plant(path)
    assert plant.car == pt.load(path) == hybrid()
    assert (plant.engine, plant.lag, plant.dt, plant.rates) == ("machine", 0.005, 0.002, (1500.0, 3000.0))
    assert plant.delay == pytest.approx(0.003)
    assert plant.limits == pytest.approx((-112.5, 112.5))


def test_without_a_table_a_plant_has_its_defaults(tmp_path):
    path = tmp_path / "car.toml"
    hybrid().save(path)
    assert pt.load_plant(path) == pt.SampledPlant(car=hybrid())


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ("lagg = 0.03", r'\[plant\]: unknown key "lagg"; did you mean "lag"'),
        ("lag = 30", r"\[plant\]: .*lag = 30.0 s, permitted"),
        ("torque_rate = 0", r"\[plant\]: .*torque_rate = 0 N m/s"),
        ('actuator = "motor"', r'\[plant\]: actuator "motor" is not a node'),
        ("lag = []", r"\[plant\]: .*lag"),
        ('lag = "slow"', r"\[plant\]: .*lag"),
    ],
)
def test_what_a_table_cannot_say_names_the_file(tmp_path, table, message):
    with pytest.raises(pt.FileError, match=message):
        pt.load_plant(file_with(tmp_path, table))


@pytest.mark.parametrize(
    "name", ["electric", "p2_hybrid", "rear_wheel_drive", "all_wheel_drive", "truck", "wind_turbine", "marine"]
)
def test_every_example_says_what_drives_it(name):
    plant = pt.load_plant(pt.examples.path(name))
    assert plant.limits != (0.0, 350.0)
    assert pt.loop_margins(plant, None).stable


SHARES = {"engine": 0.6, "machine": 0.4}


def responses_of(actuator):
    """From the command to all outputs at some frequencies, (outputs, frequencies)."""
    plant = pt.SampledPlant(car=hybrid(), actuator=actuator)
    return np.array([plant.continuous(2j * np.pi * f)[:, 0] for f in (0.3, 2.0, 7.0, 20.0, 90.0)]).T


def test_of_a_command_for_two_machines_each_gets_its_share():
    """Speeds and acceleration under a sum of torques are those under each of them, added up."""
    both, engine, machine = (responses_of(actuator) for actuator in (SHARES, "engine", "machine"))
    for output in (1, 3):  # wheels, vehicle
        np.testing.assert_allclose(both[output], 0.6 * engine[output] + 0.4 * machine[output], rtol=1e-10)


def test_the_speed_of_two_machines_is_that_at_which_their_power_is_the_command_s():
    """The response of the weighted speed is the quadratic form of the shares on the matrix of both nodes."""
    G = pt.state_space(hybrid(), ["engine_torque", "machine_torque"], ["engine_speed", "machine_speed"])
    share, lag = np.array([0.6, 0.4]), 0.03
    expected = [share @ G(2j * np.pi * f) @ share / (1.0 + lag * 2j * np.pi * f) for f in (0.3, 2.0, 7.0, 20.0, 90.0)]
    np.testing.assert_allclose(responses_of(SHARES)[0], expected, rtol=1e-10)


def test_machines_at_different_ratios_have_the_mean_speed_and_all_of_the_inertia():
    """A second machine behind 9 : 1: mean speed 0.6 + 0.4 / 9 of the first one's, inertia over its square."""
    plant, engine = (pt.SampledPlant(car=hybrid(), actuator=a) for a in ({"engine": 0.6, "shaft": 0.4}, "engine"))
    speed = 0.6 + 0.4 / 9.0
    assert plant.ratio == pytest.approx(9.0 * speed, rel=1e-12)
    assert plant.inertia == pytest.approx(engine.inertia / speed**2, rel=1e-12)
    assert plant.final_acceleration == pytest.approx(engine.final_acceleration * speed, rel=1e-12)


def test_through_play_a_shared_command_acts_as_two_torques():
    rest = [element for element in hybrid() if element.name != "gear"]
    gear, sides = pt.Gear("gear", "machine", "pinion", ratio=9.0), [pt.Inertia(n, J=0.02) for n in ("pinion", "shaft")]
    play = pt.Backlash("play", "pinion", "shaft", gap=0.02, stiffness=4e4, damping=20.0)
    car = pt.Driveline(*rest, gear, *sides, play)
    plant = pt.SampledPlant(car=car, actuator=SHARES, lag=0.0, delay=0.0, torque_limits=(-300.0, 300.0))
    shared = pt.closed_loop(plant, None, pt.ramp(0.0, 0.0, 100.0, 20.0), duration=1.0, initial_torque=20.0)
    force = -20.0 * plant.ratio / plant.vehicle_radius
    inputs = {"engine_torque": 60.0, "machine_torque": 40.0, "vehicle_force": force}
    load = {"engine_torque": 12.0, "machine_torque": 8.0, "vehicle_force": force}
    both = pt.simulate(car, shared.time, inputs=inputs, initial_load=load)
    assert np.ptp(both["vehicle_acceleration"]) > 1.0
    np.testing.assert_allclose(shared["vehicle_acceleration"], both["vehicle_acceleration"], atol=1e-8)
    np.testing.assert_allclose(shared["play_torque"], both["play_torque"], atol=1e-6)


def test_a_shared_command_is_tuned_and_proven_like_any_other():
    car = pt.examples.p2_hybrid(3)
    plant = pt.SampledPlant(car=car, actuator={"engine": 0.6, "emachine": 0.4}, torque_limits=(-60.0, 400.0))
    tuned = antijerk.tune(plant)
    assert tuned.unmet == {}
    assert len(tuned.proof.proofs) == 29
    alone = pt.robustness(plant, tuned.controller, {"mass +25 %": pt.studies.variations(plant)["mass +25 %"]})
    assert alone["mass +25 %"].t90_ratio == pytest.approx(tuned.proof["mass +25 %"].t90_ratio, rel=1e-9)


def test_a_plant_with_a_shared_command_can_be_changed_and_read_from_a_file(tmp_path):
    plant = pt.SampledPlant(car=hybrid(), actuator=SHARES)
    assert dataclasses.replace(plant, lag=0.02) == pt.SampledPlant(car=hybrid(), actuator=SHARES, lag=0.02)
    file = tmp_path / "car.toml"
    hybrid().save(file)
    file.write_text(file.read_text() + "\n[plant]\nactuator = { engine = 0.6, machine = 0.4 }\n")
    assert pt.load_plant(file) == plant
    plant.car.save(file)
    assert pt.load(file) == plant.car


@pytest.mark.parametrize(
    ("shares", "message"),
    [
        ({"engine": 1.0}, "permitted: a node, or two and more with their shares"),
        ({}, "permitted: a node, or two and more with their shares"),
        ({"engine": 0.6, "machin": 0.4}, '"machin" is not a node.*did you mean "machine"'),
        ({"engine": 0.6, "vehicle": 0.4}, "actuator = 'vehicle'.*nodes that turn"),
        ({"engine": 0.6, "machine": 0.6}, "shares = .*1 in sum"),
        ({"engine": 1.4, "machine": -0.4}, 'share of "machine" = -0.4'),
        (["engine"], "permitted: a node, or {node: share}"),
    ],
)
def test_shares_that_cannot_be_are_refused(shares, message):
    with pytest.raises(pt.PowertrainError, match=message):
        pt.SampledPlant(car=hybrid(), actuator=shares)
