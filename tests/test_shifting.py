"""Gear shifts with two clutches: events by another road, order of the phases, what is carried, energy.

Of hybrid/plans too.
"""

import numpy as np
import pytest
from event_located import integrated, merged

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.plans import inertia_at
from powertrain_ctrl.hybrid.shifting import shift_plan

# gear, next gear, torque [N m], engine speed [rad/s]: up and down under driving and braking torque
SHIFTS = {
    "up, driving": (1, 2, 150.0, 300.0),
    "down, driving": (3, 2, 150.0, 150.0),
    "up, braking": (2, 3, -40.0, 250.0),
    "down, braking": (2, 1, -40.0, 150.0),
    "up, driving hard": (3, 4, 250.0, 300.0),
}
SIDES = ("odd_clutch", "even_clutch")


def of(name):
    gear, other, torque, speed = SHIFTS[name]
    offgoing, oncoming = SIDES if gear % 2 else SIDES[::-1]
    return pt.examples.p2_hybrid(gear, other), {"offgoing": offgoing, "oncoming": oncoming}, torque, speed


def shift(name, timepts=None):
    car, clutches, torque, speed = of(name)
    return pt.gear_shift(car, **clutches, torque=torque, engine_speed=speed, timepts=timepts)


@pytest.mark.parametrize("name", SHIFTS)
def test_every_event_is_that_of_an_independent_integration(name):
    """Fine exact steps, zeros by bisection, modes by trial: times to 1e-8 s, the motion at the end to 1e-8 of its size."""
    car, clutches, torque, speed = of(name)
    plan = shift_plan(car, **clutches, torque=torque, engine_speed=speed, torque_phase=0.15, speed_phase=0.3, start=0.5)
    response = shift(name)
    changes, X, machine = integrated(car, plan.inputs, plan.state.speed, response.time[-1], plan.state.twist)
    expected = [time for time, _ in merged(changes)]
    found = sorted({round(event.time, 9) for event in response.events})
    assert len(found) == len(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8)
    modes = [int(response[f"{law.name}_mode"][-1]) for law in machine.laws]
    assert modes == list(changes[-1][1])
    speeds = dict(zip(machine.nodes, machine.Z @ X[machine.speeds], strict=True))
    for node in ("engine", "emachine", "wheels", "vehicle"):
        assert speeds[node] == pytest.approx(response[f"{node}_speed"][-1], rel=1e-9)


@pytest.mark.parametrize("name", SHIFTS)
def test_the_engine_turns_with_the_new_gear_in_the_end(name):
    car, clutches, *_ = of(name)
    response = shift(name)
    ratio = car[clutches["oncoming"].replace("clutch", "gear")].ratio
    assert response["emachine_speed"][-1] == pytest.approx(ratio * response["output_shaft_speed"][-1], rel=1e-9)
    assert response[f"{clutches['offgoing']}_capacity"][-1] == 0.0
    assert response[f"{clutches['oncoming']}_capacity"][-1] == 450.0
    assert response.events[-1].time < 1.2


@pytest.mark.parametrize("name", SHIFTS)
def test_torque_is_handed_over_before_the_speed_changes_up_under_drive_and_down_under_braking_only(name):
    _, clutches, *_ = of(name)
    response = shift(name)
    slips = [event.time for event in response.events if event.element == clutches["offgoing"] and event.kind == "slip"]
    torque_first = name.startswith("up, driving") or name == "down, braking"
    # the offgoing clutch holds on while it carries, or slips at once
    assert (slips[0] > 0.55) == torque_first
    begin = response.time < 0.6
    assert (response[f"{clutches['oncoming']}_capacity"][begin].max() > 0.0) == torque_first


@pytest.mark.parametrize("name", SHIFTS)
def test_before_the_shift_the_car_accelerates_steadily(name):
    car, clutches, torque, _ = of(name)
    response = shift(name)
    before = response.time < 0.45
    acceleration = response["vehicle_acceleration"][before]
    np.testing.assert_allclose(acceleration, acceleration[0], rtol=0.0, atol=1e-9)
    # by hand: everything at the vehicle, i = engine over vehicle
    gear = car[clutches["offgoing"].replace("clutch", "gear")].ratio
    other = car[clutches["oncoming"].replace("clutch", "gear")].ratio
    i, r = gear * 4.1, 0.32
    J = (0.16 + 0.05 + 0.07 + 0.008) * i**2 + 0.008 * (other * 4.1) ** 2 + 0.006 * 4.1**2 + 0.07 + 2.4
    assert acceleration[0] == pytest.approx(torque * i / r / (J / r**2 + 1750.0), rel=1e-9)


def test_the_car_is_driven_all_through_an_up_shift_and_jerks_little():
    """Between the accelerations of the two gears but for what swings, and no harder than 15 m/s^3."""
    response = shift("up, driving")
    acceleration, step = response["vehicle_acceleration"], response.time[1]
    assert acceleration.min() > 0.85 * acceleration[-1]
    assert np.abs(np.diff(acceleration)).max() / step < 15.0
    assert acceleration.max() < 1.01 * acceleration[0]


def test_the_torque_of_the_speed_phase_takes_the_engine_side_to_its_new_speed():
    """What is missing from the torque carried on, over time, is the momentum that the engine side gives away."""
    car, clutches, torque, speed = of("up, driving")
    response = pt.gear_shift(car, **clutches, torque=torque, engine_speed=speed, timepts=np.linspace(0.0, 2.5, 25001))
    phase = (response.time >= 0.65) & (response.time <= 0.95)
    side = inertia_at(car.release(*SIDES).part("engine"), "engine")
    assert side == pytest.approx(0.16 + 0.05 + 0.07, rel=1e-12)
    net = response["engine_torque"] - response["even_clutch_torque"]
    impulse = np.trapezoid(net[phase], response.time[phase])
    inner = sum(
        J * response[f"{node}_speed"][phase] for node, J in (("engine", 0.16), ("flywheel", 0.05), ("emachine", 0.07))
    )
    assert impulse == pytest.approx(inner[-1] - inner[0], rel=1e-4)


@pytest.mark.parametrize("name", SHIFTS)
def test_work_of_the_engine_is_motion_springs_and_heat(name):
    car = of(name)[0]
    response = shift(name, np.linspace(0.0, 2.5, 50001))
    t = response.time
    work = np.trapezoid(response["engine_torque"] * response["engine_speed"], t)
    inertias = {e.name: getattr(e, "J", getattr(e, "m", None)) for e in car if e.nodes == (e.name,)}
    kinetic = sum(0.5 * J * response[f"{name}_speed"] ** 2 for name, J in inertias.items())
    # of the tyre by the force at the road, as everywhere
    springs = {"dual_mass_spring": (900.0, 2.0), "drive_shafts": (12000.0, 70.0)}
    springs["tyres"] = (380000.0 * 0.32**2, 3000.0 * 0.32**2)
    elastic = sum(0.5 * k * response[f"{name}_twist"] ** 2 for name, (k, _) in springs.items())
    rates = {name: np.gradient(response[f"{name}_twist"], t) for name in springs}
    damped = sum(np.trapezoid(d * rates[name] ** 2, t) for name, (_, d) in springs.items())
    stored = (kinetic + elastic)[-1] - (kinetic + elastic)[0]
    assert work == pytest.approx(stored + damped + sum(response.slip_energy.values()), rel=1e-5)


def test_with_an_open_separation_clutch_the_emachine_shifts_and_the_engine_rests():
    car = pt.examples.p2_hybrid(1, 2).release("separation_clutch")
    response = pt.gear_shift(car, "odd_clutch", "even_clutch", torque=100.0)
    assert np.abs(response["engine_speed"]).max() < 1e-12
    assert response["emachine_torque"].min() < 100.0
    assert response.events[-1].kind == "lock"


def test_a_car_with_play_shifts_too():
    car = pt.examples.p2_hybrid(1, 2)
    shafts = pt.Backlash("drive_shafts", "differential", "wheels", gap=0.03, stiffness=12000.0, damping=70.0)
    loose = pt.Driveline(*(e for e in car if e.name != "drive_shafts"), shafts).release("even_clutch")
    taut, with_play = (pt.gear_shift(each, "odd_clutch", "even_clutch") for each in (car, loose))
    # the play stays closed, so nothing is different but where it lies
    np.testing.assert_allclose(with_play["vehicle_acceleration"], taut["vehicle_acceleration"], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"offgoing": "clutch"}, pt.UnknownNameError, 'clutch "clutch" is not in this driveline'),
        ({"oncoming": "odd_clutch"}, pt.PowertrainError, 'offgoing and oncoming are both "odd_clutch"'),
        ({"torque": 900.0}, pt.PowertrainError, "odd_clutch: max_torque = 450 N m, permitted for this torque: >= "),
        ({"speed_phase": 0.0}, pt.ParameterError, "speed_phase = 0.0 s, permitted: > 0"),
        ({"offgoing": "separation_clutch"}, pt.TopologyError, 'even_clutch does not connect "engine" with "vehicle"'),
    ],
)
def test_a_shift_that_cannot_be_is_refused(values, error, message):
    given = {"offgoing": "odd_clutch", "oncoming": "even_clutch"} | values
    with pytest.raises(error, match=message):
        pt.gear_shift(pt.examples.p2_hybrid(), **given)


def test_two_gears_of_one_ratio_are_no_shift():
    car = pt.examples.p2_hybrid().replace("even_gear", ratio=3.92)
    with pytest.raises(pt.PowertrainError, match=r"odd_clutch and even_clutch lead to the same ratio \d+"):
        pt.gear_shift(car, "odd_clutch", "even_clutch")
