"""A control unit that drives through slip and lock: events and commands by another road, jerk with and without it.

Of sampled/manoeuvres too.
"""

import numpy as np
import pytest
from event_located import integrated, merged

import powertrain_ctrl as pt
from powertrain_ctrl.base.systems import linear_system
from powertrain_ctrl.hybrid.cranking import start_plan
from powertrain_ctrl.hybrid.shifting import shift_plan
from powertrain_ctrl.hybrid.signals import PiecewiseLinear

DT = 0.01
LIMITS = (-200.0, 300.0)
SIDES = ("odd_clutch", "even_clutch")
PLANNED = {"torque": 150.0, "torque_phase": 0.15, "speed_phase": 0.3, "start": 0.5}
# gear, next gear, engine speed [rad/s]: with these gains [N m s/rad] every loop is stable and damps its first mode
SHIFTS = {"up": (1, 2, 300.0), "up again": (2, 3, 300.0), "down": (2, 1, 150.0), "down from third": (3, 2, 150.0)}
GAINS = {1: 4.0, 2: 6.0, 3: 6.0}


def plant_of(gear, other, lag=0.03, delay=0.01, dt=DT):
    return pt.SampledPlant(car=pt.examples.p2_hybrid(gear, other), lag=lag, delay=delay, dt=dt, torque_limits=LIMITS)


def feedback(plant, gain):
    return pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=gain))


def shifted(name, controlled=True, **actuator):
    """Plant, unit and response of a shift; each gear has its controller."""
    gear, other, speed = SHIFTS[name]
    plants = {gear: plant_of(gear, other, **actuator), other: plant_of(other, gear, **actuator)}
    loops = {plant.ratio: feedback(plant, GAINS[gear]) for gear, plant in plants.items()}
    plant = plants[gear]
    unit = pt.ControlUnit(controllers=loops, dt=DT, torque_limits=LIMITS) if controlled else None
    offgoing, oncoming = SIDES if gear % 2 else SIDES[::-1]
    return plant, pt.controlled_shift(plant, unit, offgoing, oncoming, engine_speed=speed, **PLANNED)


def acting(response, plant, before):
    """Commands as the actuator without lag acts: each from its sample plus the delay on."""
    commands = response["torque_command"][:-1:10]
    times = plant.dt * np.arange(len(commands)) + plant.delay
    values = np.concatenate([[before], commands])
    return PiecewiseLinear(tuple(np.repeat(times, 2)), tuple(np.repeat(values, 2)[1:-1]))


def assert_same_events(response, car, inputs, plan):
    changes, X, machine = integrated(car, inputs, plan.state.speed, response.time[-1], plan.state.twist)
    expected = [time for time, _ in merged(changes)]
    found = sorted({round(event.time, 9) for event in response.events})
    assert len(found) == len(expected)
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-8)
    speeds = dict(zip(machine.nodes, machine.Z @ X[machine.speeds], strict=True))
    for node in ("engine", "emachine", "vehicle"):
        assert speeds[node] == pytest.approx(response[f"{node}_speed"][-1], rel=1e-9)


@pytest.mark.parametrize("name", ["up", "down"])
def test_every_event_of_a_controlled_shift_is_that_of_an_independent_integration(name):
    """Under the commands of the loop, which jump at the samples plus the delay: times to 1e-8 s."""
    gear, _, speed = SHIFTS[name]
    plant, response = shifted(name, lag=0.0, delay=0.013)
    offgoing, oncoming = SIDES if gear % 2 else SIDES[::-1]
    plan = shift_plan(plant.car, offgoing, oncoming, engine_speed=speed, **PLANNED)
    assert_same_events(response, plant.car, {**plan.inputs, "engine_torque": acting(response, plant, 150.0)}, plan)


def test_every_event_of_a_controlled_start_is_that_of_an_independent_integration():
    given = {"torque": 60.0, "capacity": 60.0, "speed": 157.0, "blending": 0.3, "start": 0.5, "compensated": True}
    car = pt.examples.p2_hybrid(2)
    electric = car.release("separation_clutch").part("vehicle")
    plant = pt.SampledPlant(car=electric, lag=0.0, delay=0.004, dt=DT, torque_limits=LIMITS)
    response = pt.controlled_start(plant, feedback(plant, 2.0), car, **given)
    plan = start_plan(car, "separation_clutch", **given)
    assert_same_events(response, car, {**plan.inputs, "emachine_torque": acting(response, plant, 60.0)}, plan)


def test_the_commands_of_a_shift_are_those_that_the_measured_speeds_give():
    """Gain by gear, start from rest at lock, bump that dies out, all from the response's own speeds and events."""
    _, response = shifted("up")
    at = slice(0, -1, 10)
    engine, wheels, wanted = (response[name][at] for name in ("engine_speed", "wheels_speed", "torque_demand"))
    release = next(event.time for event in response.events if event.kind == "slip" and event.element == "odd_clutch")
    lock = response.events[-1].time
    last, bump, gear, expected = 150.0, 0.0, None, []
    for k in range(len(wanted)):
        now = 1 if k * DT < release else 2 if k * DT > lock else None
        ratio = {1: 3.92 * 4.1, 2: 2.43 * 4.1}.get(now)
        bump *= np.exp(-DT / 0.05)
        target = wanted[k] if now is None else wanted[k] - GAINS[now] * (engine[k] - ratio * wheels[k])
        if now != gear:
            gear, bump = now, last - target
        last = min(max(target + bump, LIMITS[0]), LIMITS[1])
        expected.append(last)
    np.testing.assert_allclose(response["torque_command"][at], expected, rtol=1e-9)


@pytest.mark.parametrize("name", SHIFTS)
def test_the_controller_takes_most_of_the_swing_behind_a_shift_and_never_bumps(name):
    swings, jerks = [], []
    for controlled in (False, True):
        _, response = shifted(name, controlled)
        locked, step = response.events[-1].time, response.time[1]
        acceleration = response["vehicle_acceleration"]
        swings.append(np.ptp(acceleration[response.time > locked + 0.2]))
        jerks.append(np.abs(np.diff(acceleration[response.time > locked + 0.02])).max() / step)
    assert swings[1] < 0.5 * swings[0]
    assert jerks[1] < 0.95 * jerks[0]


def test_an_engine_start_swings_less_with_the_loop_closed_and_the_engine_drives_in_the_end():
    car = pt.examples.p2_hybrid(2)
    electric = car.release("separation_clutch").part("vehicle")
    plant = pt.SampledPlant(car=electric, lag=0.005, delay=0.002, dt=DT, torque_limits=LIMITS)
    swings = []
    for controller in (None, feedback(plant, 2.0)):
        response = pt.controlled_start(plant, controller, car)
        swings.append(np.ptp(response["vehicle_acceleration"][response.time > 1.6]))
        assert response["engine_torque"][-1] == pytest.approx(60.0, abs=1e-9)
    assert swings[1] < 0.6 * swings[0]


def test_where_nothing_slips_it_is_the_closed_loop():
    plant = pt.SampledPlant(car=pt.examples.conventional(), torque_limits=(-100.0, 350.0))
    controller, demand = feedback(plant, 6.0), pt.ramp(0.2, 0.1, 150.0)
    run = pt.controlled_run(plant, controller, demand, duration=1.5)
    loop = pt.closed_loop(plant, controller, demand, duration=1.5)
    for name in ("torque_command", "engine_torque", "vehicle_acceleration", "engine_speed"):
        np.testing.assert_allclose(run[name][:-1], loop[name][:-1], rtol=0.0, atol=1e-8 * np.abs(loop[name]).max())
    assert set(run["ratio"]) == {18.0}


def slip_controller(gain=0.5, integral=2.0, dt=DT, reads="slip_speed", gives="capacity"):
    """Capacity as planned, and more by the slip and by its sum over time."""
    A, B, C, D = [[1.0]], [[dt * integral, 0.0]], [[1.0]], [[gain, 1.0]]
    return linear_system(A, B, C, D, dt=dt, inputs=[reads, "planned_capacity"], outputs=[gives])


def test_the_capacity_of_a_clutch_can_be_what_is_controlled():
    """A clutch that is to carry 100 N m and slips is closed as it slips faster, by the law that it was given."""
    car = pt.examples.conventional(damping="open")
    plant = pt.SampledPlant(car=car)
    planned, state = pt.ramp(0.1, 0.2, 80.0), pt.State(0.0, {}, {"engine": 120.0}, {})
    response = pt.controlled_run(
        plant,
        None,
        pt.ramp(0.1, 0.2, 100.0),
        {"clutch_capacity": planned},
        duration=1.2,
        initial_state=state,
        clutch_controllers={"clutch": slip_controller()},
    )
    at = slice(0, -1, 10)
    slip, capacity = response["clutch_slip_speed"][at], response["clutch_capacity"][1:-1:10]
    summed = np.concatenate([[0.0], np.cumsum(DT * 2.0 * slip)[:-1]])
    expected = np.maximum(summed + 0.5 * slip + np.asarray(planned(response.time[at])), 0.0)
    np.testing.assert_allclose(capacity, expected, rtol=1e-9)
    # held over the sample
    np.testing.assert_array_equal(capacity, response["clutch_capacity"][9:-1:10])
    assert response.events[-1].kind == "lock"


def test_without_its_capacity_a_clutch_is_as_it_is_in_the_car():
    car = pt.examples.p2_hybrid(1, 2)
    plant = pt.SampledPlant(car=car, torque_limits=LIMITS)
    response = pt.controlled_run(plant, None, pt.step(0.1, 50.0), duration=0.5)
    assert not response.events
    assert set(response["ratio"]) == {3.92 * 4.1}


CAR = pt.examples.conventional()
PLANT = pt.SampledPlant(car=CAR)


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"inputs": {"engine_torque": 1.0}}, pt.UnknownNameError, "besides that of the actuator"),
        ({"inputs": {"clutch_capacty": 1.0}}, pt.UnknownNameError, 'did you mean "clutch_capacity"'),
        ({"car": pt.examples.electric()}, pt.UnknownNameError, 'node "engine" is not in the car that the plant is to'),
        ({"duration": 0.001}, pt.PowertrainError, "permitted: at least one sample of 0.01 s"),
        ({"demand": lambda t: np.inf}, pt.SignalError, "the torque demand is not finite at t = 0 s"),
        ({"controller": pt.ControlUnit(controllers=None, dt=0.02)}, pt.PowertrainError, "the unit has dt = 0.02 s"),
        ({"clutch_controllers": {"k0": slip_controller()}}, pt.UnknownNameError, 'clutch "k0" is not in'),
        (
            {"clutch_controllers": {"clutch": slip_controller(dt=0.02)}},
            pt.PowertrainError,
            "the controller of clutch has dt = 0.02 s, permitted: 0.01 s as the plant",
        ),
        (
            {"clutch_controllers": {"clutch": slip_controller(reads="slip")}},
            pt.PowertrainError,
            'the controller of clutch has the input "slip", permitted: slip_speed, planned_capacity, torque_command',
        ),
        (
            {"clutch_controllers": {"clutch": slip_controller(gives="torque")}},
            pt.PowertrainError,
            "permitted: capacity alone",
        ),
    ],
)
def test_a_run_that_cannot_be_is_refused(values, error, message):
    given = {"plant": PLANT, "controller": None, "demand": pt.step(0.0, 10.0), "duration": 0.1} | values
    with pytest.raises(error, match=message):
        pt.controlled_run(**given)


def test_a_shift_of_a_car_that_another_node_drives_is_refused():
    car = pt.examples.p2_hybrid()
    electric = pt.SampledPlant(car=car.release("separation_clutch").part("vehicle"))
    with pytest.raises(pt.PowertrainError, match="the plant drives emachine, permitted here: engine"):
        pt.controlled_shift(electric, None, *SIDES, car=car)


def test_a_run_keeps_limits_over_speed_and_the_rate_and_tells_the_controller():
    """Constant torque, then constant power; the unit has the actuator's limits, so none of it is taken off behind it."""
    table = {0.0: (-250.0, 250.0), 400.0: (-250.0, 250.0), 500.0: (-200.0, 200.0), 1000.0: (-100.0, 100.0)}
    plant = pt.SampledPlant(
        car=pt.examples.electric(), lag=0.005, delay=0.002, dt=DT, torque_limits=table, torque_rate=(2e3, 4e3)
    )
    demand = pt.step(0.1, 300.0) + pt.step(1.0, -600.0)
    state = pt.State(0.0, {}, {"motor": 450.0, "wheels": 450.0 / 9.5, "vehicle": 450.0 / 9.5 * 0.33}, {})
    response = pt.controlled_run(plant, feedback(plant, 0.5), demand, duration=2.0, initial_state=state)
    at = slice(0, -1, 10)
    command, speed = response["torque_command"][at], response["motor_speed"][at]
    high = np.interp(speed, [400.0, 500.0, 1000.0], [250.0, 200.0, 100.0])
    change = np.diff(command) / DT
    assert (command <= high + 1e-9).all()
    assert (command >= -high - 1e-9).all()
    assert change.max() == pytest.approx(2e3, rel=1e-9)
    assert change.min() == pytest.approx(-4e3, rel=1e-9)
    assert np.abs(command - high).min() < 1e-9
