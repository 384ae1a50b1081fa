"""A torque that rises and falls differently: against an integration of its differential equations, and what carries it.

Of sampled/directed too.
"""

import dataclasses
import itertools
import pickle

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk, studies
from powertrain_ctrl.antijerk.families import FAMILIES, feedback_with
from powertrain_ctrl.antijerk.scales import scales_of
from powertrain_ctrl.sampled.arrivals import Acting, Arrivals

J, K, D, RATIO = (0.3, 3.0, 200.0), (900.0, 9e3), (1.5, 20.0), 8.0
GAP, DT, POINTS = 0.06, 0.01, 5
LIMITS, RATES, GAIN = (-60.0, 150.0), (2500.0, 6000.0), 1.5
# up, down, up again before all is there, and a little later to and fro
TIMES = [0.0, 0.05, 0.08, 0.13, 0.15, 0.155, 0.21, 0.3, 0.31, 0.35, 0.36, 0.6]
TORQUES = [0.0, 0.0, 200.0, 200.0, -50.0, -50.0, 90.0, 90.0, 60.0, 60.0, 100.0, 100.0]
DIRECTIONS = [
    ((0.05, 0.02), (0.03, 0.01)),
    ((0.02, 0.05), (0.013, 0.004)),
    ((0.0, 0.03), 0.01),
    ((0.04, 0.0), (0.004, 0.047)),
    (0.03, (0.057, 0.002)),
    (0.0, (0.031, 0.012)),
    ((0.06, 0.005), 0.0),
]


def car(with_play):
    if with_play:
        first = pt.Backlash("damper", "engine", "box", gap=GAP, stiffness=K[0], damping=0.0)
    else:
        first = pt.SpringDamper("damper", "engine", "box", stiffness=K[0], damping=D[0])
    return pt.Driveline(
        pt.Inertia("engine", J=J[0]),
        first,
        pt.Inertia("box", J=J[1]),
        pt.Gear("gear", "box", "shaft", ratio=RATIO),
        pt.SpringDamper("shafts", "shaft", "wheels", stiffness=K[1], damping=D[1]),
        pt.Inertia("wheels", J=J[2]),
    )


def plant_of(lag, delay, with_play=False, **more):
    values = {"dt": DT, "torque_limits": LIMITS, "torque_rate": RATES, **more}
    return pt.SampledPlant(car=car(with_play), lag=lag, delay=delay, **values)


def controller_of(plant):
    return antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=GAIN))


class Integrated:
    """Engine, box and wheels with their springs, and the torque, by DOP853 from instant to instant."""

    def __init__(self, lag, delay, with_play, torque):
        self.lags, self.delays = (value if isinstance(value, tuple) else (value, value) for value in (lag, delay))
        self.with_play, self.load = with_play, -torque * RATIO
        self.y = np.zeros(6)  # both twists, speeds, torque
        self.y[0] = torque / K[0] + (np.sign(torque) * GAP / 2.0 if with_play else 0.0)
        self.y[1], self.y[5] = torque * RATIO / K[1], torque
        self.time, self.sent, self.before = 0.0, [], torque

    def command(self, value):
        """Sent now."""
        delay = self.delays[0] if value > self.before else self.delays[1]
        if value != self.before:
            self.sent.append((self.time + delay, value))
        self.before = value

    def acting(self, first):
        """The newest of the commands that have arrived."""
        arrived = [value for at, value in self.sent if at <= self.time + 1e-12]
        return arrived[-1] if arrived else first

    def rates(self, t, y, command, lag, side):
        twist, shaft, engine, box, wheels, torque = y
        carried = K[0] * side * (side * twist - GAP / 2.0) if side else 0.0
        if not self.with_play:
            carried = K[0] * twist + D[0] * (engine - box)
        behind = K[1] * shaft + D[1] * (box / RATIO - wheels)
        return [
            engine - box,
            box / RATIO - wheels,
            (torque - carried) / J[0],
            (carried - behind / RATIO) / J[1],
            (behind + self.load) / J[2],
            (command - torque) / lag if lag else 0.0,
        ]

    def go(self, until, first):
        """On to an instant, stopping where a command arrives or the play changes its side."""
        while self.time < until - 1e-12:
            command = self.acting(first)
            end = min([until, *(at for at, _ in self.sent if at > self.time + 1e-12)])
            lag = self.lags[0] if command > self.y[5] else self.lags[1]
            if not lag:
                self.y[5] = command
            while self.time < end - 1e-12:
                twist, rate = self.y[0], self.y[2] - self.y[3]
                # at the flank the motion says on which side of it the next moment is
                over = abs(twist) - GAP / 2.0
                side = np.sign(twist) * (over > 1e-9 or (over > -1e-9 and rate * twist > 0.0))
                crossing = lambda t, y, *rest: abs(y[0]) - GAP / 2.0  # noqa: E731
                crossing.terminal, crossing.direction = True, -1.0 if side else 1.0
                found = solve_ivp(
                    self.rates,
                    (self.time, end),
                    self.y,
                    method="DOP853",
                    rtol=1e-12,
                    atol=1e-13,
                    args=(command, lag, side),
                    events=[crossing] if self.with_play else None,
                )
                self.y, self.time = found.y[:, -1].copy(), float(found.t[-1])
            self.time = end
        if not self.lags[0 if self.acting(first) > self.y[5] else 1]:
            self.y[5] = self.acting(first)


def integrated(lag, delay, with_play, torque, is_closed):
    """Torque, engine speed, wheel speed (3, points) and commands."""
    motion, limited = Integrated(lag, delay, with_play, torque), torque
    found, commands = [], []
    for k in range(round(TIMES[-1] / DT)):
        # to the microsecond, so that a corner at a sample is one
        wanted = torque + np.interp(round(k * DT, 6), TIMES, TORQUES)
        difference = motion.y[2] - RATIO * motion.y[4]
        asked = wanted - GAIN * difference * is_closed
        asked = min(max(asked, limited - RATES[1] * DT), limited + RATES[0] * DT)
        limited = min(max(asked, LIMITS[0]), LIMITS[1])
        motion.command(limited)
        commands.append(limited)
        for i in range(POINTS):
            motion.go(k * DT + i * DT / POINTS, torque)
            found.append(motion.y[[5, 2, 4]])
        motion.go((k + 1) * DT, torque)
    return np.array(found).T, np.array(commands)


def same_as_integrated(lag, delay, with_play, torque, is_closed):
    plant = plant_of(lag, delay, with_play)
    demand = pt.samples(TIMES, np.array(TORQUES) + torque)
    controller = controller_of(plant) if is_closed else None
    response = pt.closed_loop(
        plant, controller, demand, duration=TIMES[-1], initial_torque=torque, steps_per_sample=POINTS
    )
    (torques, *speeds), commands = integrated(lag, delay, with_play, torque, is_closed)
    count = len(torques)
    np.testing.assert_allclose(response["torque_command"][:count:POINTS], commands, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(response["engine_torque"][:count], torques, rtol=0.0, atol=1e-8)
    for name, expected in zip(("engine_speed", "wheels_speed"), speeds, strict=True):
        np.testing.assert_allclose(response[name][:count], expected, rtol=0.0, atol=1e-8)
    return response


@pytest.mark.parametrize(("lag", "delay"), DIRECTIONS)
@pytest.mark.parametrize("is_closed", [False, True], ids=["open", "closed"])
def test_a_linear_car_moves_as_its_equations_say(lag, delay, is_closed):
    same_as_integrated(lag, delay, False, 0.0, is_closed)


@pytest.mark.parametrize(("lag", "delay"), DIRECTIONS)
def test_a_car_with_play_moves_as_its_equations_say(lag, delay):
    response = same_as_integrated(lag, delay, True, -20.0, True)
    assert {event.kind for event in response.events} >= {"open", "contact"}


# --- other roads that a torque takes


def torque_of(plant, commands, times, before):
    """The torque in closed form: exponentials towards whichever of the commands that have arrived was sent last."""
    arrivals, last = [], before
    for k, command in enumerate(commands):
        if command != last:
            arrivals.append((round(k * plant.dt + plant.delays[0 if command > last else 1], 12), command))
        last = command
    torque, goal, now, found = before, before, 0.0, []
    for t in times:
        edges = sorted({at for at, _ in arrivals if now < at + 1e-12 and at <= t + 1e-12})
        for edge in [*edges, t]:
            lag = plant.lags[0 if goal > torque else 1]
            torque = goal + (torque - goal) * (np.exp(-(edge - now) / lag) if lag else 0.0)
            now = edge
            goal = ([before] + [command for at, command in arrivals if at <= edge + 1e-12])[-1]
        found.append(goal if not plant.lags[0 if goal > torque else 1] else torque)
    return np.array(found)


@pytest.mark.parametrize(("lag", "delay"), DIRECTIONS)
def test_engine_torque_of_a_launch_is_exponentials_towards_what_has_arrived(lag, delay):
    plant = pt.SampledPlant(
        car=pt.examples.conventional(damping="open"),
        lag=lag,
        delay=delay,
        torque_rate=RATES,
        torque_limits=(0.0, 400.0),
    )
    controller = antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=4.0))
    response = pt.controlled_launch(plant, controller, start=0.1, engine_speed=150.0, end=1.5)
    assert np.diff(response["torque_command"]).min() < -1.0
    expected = torque_of(plant, response["torque_command"][:-1:10], response.time[:-1], 0.0)
    np.testing.assert_allclose(response["engine_torque"][:-1], expected, rtol=0.0, atol=1e-8)


GEARS = {gears: pt.examples.p2_hybrid(*gears) for gears in ((1, 2), (2, 1))}
SHIFTS = [("odd_clutch", "even_clutch", 1, 300.0), ("even_clutch", "odd_clutch", 2, 200.0)]


@pytest.mark.parametrize(("lag", "delay"), DIRECTIONS[:4])
@pytest.mark.parametrize("shift", SHIFTS, ids=["up", "down"])
def test_engine_torque_of_a_shift_is_exponentials_towards_what_has_arrived(lag, delay, shift):
    *clutches, gear, speed = shift
    plants = [pt.SampledPlant(car=each, lag=lag, delay=delay, torque_limits=(-200.0, 300.0)) for each in GEARS.values()]
    loops = {each.ratio: antijerk.one_dof(each, antijerk.speed_difference(each, gain=3.0)) for each in plants}
    unit = pt.ControlUnit(controllers=loops, dt=0.01, torque_limits=(-200.0, 300.0), torque_rate=(600.0, 1500.0))
    response = pt.controlled_shift(plants[gear - 1], unit, *clutches, engine_speed=speed)
    assert ("lock", clutches[1]) in [(event.kind, event.element) for event in response.events]
    commands = response["torque_command"][:-1:10]
    changes = np.diff(commands) / 0.01
    assert (changes.min(), changes.max()) == pytest.approx((-1500.0, 600.0))
    expected = torque_of(plants[gear - 1], commands, response.time[:-1], 150.0)
    np.testing.assert_allclose(response["engine_torque"][:-1], expected, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(("lag", "delay"), DIRECTIONS[2:6])
def test_machine_torque_of_an_engine_start_is_exponentials_towards_what_has_arrived(lag, delay):
    whole = pt.examples.p2_hybrid(2)
    electric = whole.release("separation_clutch").part("vehicle")
    values = {"torque_limits": (-200.0, 300.0), "torque_rate": (300.0, 900.0)}
    plant = pt.SampledPlant(car=electric, lag=lag, delay=delay, **values)
    response = pt.controlled_start(plant, None, whole)
    assert [event.kind for event in response.events] == ["slip", "lock"]
    commands = response["torque_command"][:-1:10]
    changes = np.diff(commands) / plant.dt
    assert (changes.min(), changes.max()) == pytest.approx((-900.0, 300.0))
    expected = torque_of(plant, commands, response.time[:-1], 60.0)
    np.testing.assert_allclose(response["emachine_torque"][:-1], expected, rtol=0.0, atol=1e-8)


def test_a_clutch_locks_when_an_integration_of_its_launch_says():
    """Engine, clutch and one shaft; the demand rises, falls and rises again before it locks."""
    launching = pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.Clutch("clutch", "engine", "box", max_torque=500.0),
        pt.Inertia("box", J=0.05),
        pt.SpringDamper("shafts", "box", "wheels", stiffness=400.0, damping=2.0),
        pt.Inertia("wheels", J=4.0),
    )
    plant = pt.SampledPlant(
        car=launching, actuator="engine", lag=(0.06, 0.02), delay=(0.033, 0.01), torque_limits=(0.0, 150.0)
    )
    demand, capacity = pt.samples([0.0, 0.2, 0.3, 0.5, 0.8], [0.0, 140.0, 20.0, 20.0, 120.0]), pt.ramp(0.1, 0.2, 160.0)
    state = pt.State(0.0, {}, {"engine": 300.0}, {})
    response = pt.controlled_run(plant, None, demand, {"clutch_capacity": capacity}, 1.5, launching.release(), state)
    lock = next(event.time for event in response.events if event.kind == "lock")
    assert lock > 0.7

    def rates(t, y):
        _, box, wheels, twist = y
        carried, shaft = 160.0 * np.clip((t - 0.1) / 0.2, 0.0, 1.0), 400.0 * twist + 2.0 * (box - wheels)
        torque = torque_of(plant, commands, [t], 0.0)[0]
        return [(torque - carried) / 0.2, (carried - shaft) / 0.05, shaft / 4.0, box - wheels]

    commands = np.interp(np.round(0.01 * np.arange(150), 6), [0.0, 0.2, 0.3, 0.5, 0.8], [0.0, 140.0, 20.0, 20.0, 120.0])
    slips = lambda t, y: y[0] - y[1]  # noqa: E731
    slips.terminal = True
    y = [300.0, 0.0, 0.0, 0.0]
    arrivals = [k * 0.01 + delay for k in range(150) for delay in plant.delays]
    edges = sorted({round(at, 9) for at in [*arrivals, 0.0, 0.1, 0.3]})
    for begin, end in itertools.pairwise(edges):
        found = solve_ivp(rates, (begin, end), y, "DOP853", rtol=1e-11, atol=1e-11, events=slips, max_step=end - begin)
        y = found.y[:, -1]
        if found.t_events[0].size:
            break
    assert lock == pytest.approx(float(found.t_events[0][0]), abs=1e-8)


@pytest.mark.parametrize(("lag", "delay"), DIRECTIONS)
def test_a_run_where_nothing_slips_is_the_closed_loop(lag, delay):
    car = pt.examples.p2_hybrid(2, 3)
    plant = pt.SampledPlant(car=car, lag=lag, delay=delay, torque_limits=(-200.0, 300.0), torque_rate=RATES)
    controller, demand = antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=4.0)), pt.samples(TIMES, TORQUES)
    run = pt.controlled_run(plant, controller, demand, duration=0.6)
    loop = pt.closed_loop(plant, controller, demand, duration=0.6)
    for name in ("engine_torque", "engine_speed", "vehicle_acceleration"):
        np.testing.assert_allclose(run[name][:-1], loop[name][: len(run.time) - 1], rtol=0.0, atol=1e-8)


def test_what_rises_without_a_lag_is_there_at_the_last_instant_too():
    """Of a demand that only rises the lag of a fall says nothing."""
    demand = pt.samples([0.0, 0.1], [0.0, 100.0])
    runs = [pt.closed_loop(plant_of(lag, 0.01), None, demand, duration=0.1) for lag in ((0.0, 0.03), 0.0)]
    for name in ("engine_torque", "engine_speed", "vehicle_acceleration"):
        np.testing.assert_allclose(*(run[name] for run in runs), rtol=0.0, atol=1e-10, err_msg=name)
    assert np.ptp(runs[0]["engine_torque"][-2:]) > 1.0


def test_a_push_at_the_vehicle_adds_to_what_an_open_loop_does():
    plant, demand, push = plant_of((0.05, 0.02), (0.03, 0.013)), pt.samples(TIMES, TORQUES), pt.ramp(0.1, 0.05, 80.0)
    both = pt.closed_loop(plant, None, demand, duration=0.6, disturbance=push)
    alone = [pt.closed_loop(plant, None, *given) for given in ((demand, 0.6), (pt.ramp(0.0, 0.0, 0.0), 0.6, push))]
    for name in ("engine_speed", "vehicle_acceleration", "engine_torque"):
        np.testing.assert_allclose(both[name], alone[0][name] + alone[1][name], rtol=0.0, atol=1e-9)


def test_every_variant_of_a_family_has_its_own_closed_loop():
    plant = pt.SampledPlant(car=pt.examples.conventional(), lag=(0.05, 0.02), delay=(0.013, 0.004))
    controller = antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=4.0))
    family, demand = pt.family(plant.car, {"vehicle.m": [1600.0, 2400.0]}), pt.ramp(0.1, 0.1, 250.0)
    found = family.closed_loop(plant, controller, demand, duration=0.6, outputs="vehicle_acceleration")
    for i, mass in enumerate((1600.0, 2400.0)):
        own = dataclasses.replace(plant, car=plant.car.replace({"vehicle.m": mass}))
        expected = pt.closed_loop(own, controller, demand, duration=0.6)["vehicle_acceleration"]
        np.testing.assert_array_equal(found["vehicle_acceleration"][i], expected)


# --- commands under way


def test_a_newer_command_that_is_there_first_supersedes_older_ones():
    """A rise takes 3.5 samples, a fall 1 sample: by hand."""
    arrivals = Arrivals(plant_of(0.03, (0.035, 0.01)))
    acting = []
    for k, command in enumerate([0.0, 10.0, 20.0, 5.0, 5.0, 8.0, 8.0, 8.0, 8.0]):
        arrivals.send(k, command)
        acting.append([(round(each.since, 9), each.command) for each in arrivals.during(k)])
    # 10 N m would be there at 4.5 samples and 20 N m at 5.5; the fall to 5 N m of sample 3 is there at 4
    assert [each[-1][1] for each in acting] == [0.0, 0.0, 0.0, 0.0, 5.0, 5.0, 5.0, 5.0, 8.0]
    assert acting[8] == [(0.0, 5.0), (0.005, 8.0)]
    assert isinstance(Arrivals(plant_of(0.0, 0.0)).during(0)[0], Acting)


# --- the pair


@pytest.mark.parametrize("pair", [(0.03, 0.03), [0.03, 0.03], {0.0: (0.05, 0.02), 100.0: (0.03, 0.03)}], ids=str)
def test_equal_times_are_one(pair):
    one, other = plant_of(0.03, 0.03), plant_of(pair, pair, speed=100.0)
    assert (other.lag, other.delay, other.has_direction) == (0.03, 0.03, False)
    assert dataclasses.replace(other, speed=0.0) == one
    assert "up" not in repr(other).split("torque")[0]


def test_almost_equal_times_do_almost_the_same():
    demand, near = pt.samples(TIMES, TORQUES), 1e-12
    one = pt.closed_loop(plant_of(0.03, 0.013), None, demand, duration=0.6)
    other = pt.closed_loop(plant_of((0.03, 0.03 + near), (0.013, 0.013 + near)), None, demand, duration=0.6)
    np.testing.assert_allclose(other["engine_speed"], one["engine_speed"], rtol=0.0, atol=1e-8)


def test_pairs_over_speed_are_read_at_the_speed():
    """Half way between both rows, by hand."""
    for table in ({100.0: (0.06, 0.03), 300.0: (0.02, 0.01)}, [[100.0, 0.06, 0.03], [300.0, 0.02, 0.01]]):
        plant = plant_of(table, table, speed=200.0)
        assert plant.lags == plant.delays == pytest.approx((0.04, 0.02))


def test_a_plant_with_directions_is_a_record():
    plant = plant_of((0.05, 0.02), (0.03, 0.01))
    assert pickle.loads(pickle.dumps(plant)) == plant
    assert hash(dataclasses.replace(plant, lag=[0.05, 0.02])) == hash(plant)
    changed = dataclasses.replace(plant, lag=(0.02, 0.05))
    assert changed != plant
    assert (changed.lags, changed.delays) == ((0.02, 0.05), (0.03, 0.01))
    text = repr(plant)
    assert "lag 50 ms up, 20 ms down, delay 30 ms up, 10 ms down, dt 10 ms (linear: the longer of both)" in text


def test_a_file_may_say_pairs(tmp_path):
    path = tmp_path / "car.toml"
    car(False).save(path)
    table = "lag = [0.05, 0.02]\ndelay = [[0.0, 0.03, 0.01], [100.0, 0.01, 0.01]]\nspeed = 50.0"
    path.write_text(f"{path.read_text()}\n[plant]\n{table}\n")
    plant = pt.load_plant(path)
    assert plant.lag == (0.05, 0.02)
    assert plant.delay == pytest.approx((0.02, 0.01))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ((0.05, 0.02, 0.01), r"\(0.05, 0.02, 0.01\) s, permitted: one number, or that of a rise and of a fall"),
        ((0.05,), "permitted: one number, or that of a rise"),
        ((0.05, -0.02), "= -0.02 s, permitted: >= 0"),
        ((50, 20), "= 50.0 s, permitted: >= 0 and below 1; 50 ms is 0.05 s"),
        ((0.05, "fast"), "= 'fast' s"),
        ((0.05, float("nan")), "= nan s"),
        ({100.0: 0.05, 300.0: (0.05, 0.02)}, "at each speed one number, or at each two"),
        ([[100.0, 0.05, 0.02], [300.0, 0.03]], "at each speed one number, or at each two"),
        ([[100.0, 0.05, 0.02, 0.01]], "permitted"),
    ],
)
@pytest.mark.parametrize("name", ["lag", "delay"])
def test_what_is_no_pair_is_refused_by_name(name, wrong, message):
    with pytest.raises(pt.ParameterError, match=f"sampled plant: {name} .*{message}|sampled plant: {name} {message}"):
        plant_of(**{"lag": 0.03, "delay": 0.01, name: wrong})


def test_a_sample_time_has_no_direction():
    with pytest.raises(pt.ParameterError, match="dt = "):
        plant_of(0.03, 0.01, dt=(0.01, 0.02))


# --- what is linear, and what is proven

DIRECTED = pt.SampledPlant(car=pt.examples.conventional(), lag=(0.03, 0.02), delay=(0.004, 0.01))
SLOWER = dataclasses.replace(DIRECTED, lag=0.03, delay=0.01)


def test_what_is_linear_has_the_longer_of_both():
    for of in (lambda plant: plant.continuous, pt.SampledPlant.discrete):
        for letter in "ABCD":
            np.testing.assert_array_equal(getattr(of(DIRECTED), letter), getattr(of(SLOWER), letter))
    assert scales_of(DIRECTED) == scales_of(SLOWER)
    model = pt.two_mass(DIRECTED.car)
    for name in FAMILIES:
        mine, other = (
            antijerk.two_dof(plant, model, feedback_with(name, plant, scales_of(plant), 1.0))
            for plant in (DIRECTED, SLOWER)
        )
        for letter in "ABCD":
            np.testing.assert_allclose(getattr(mine, letter), getattr(other, letter), rtol=1e-9, atol=1e-12)
        margins = pt.loop_margins(DIRECTED, mine), pt.loop_margins(SLOWER, mine)
        assert margins[0].disk_margin == margins[1].disk_margin


def test_a_controller_is_proven_with_the_faster_of_both_too():
    plants = studies.variations(DIRECTED)
    name, faster = list(plants.items())[-1]
    assert (name, len(plants)) == ("faster of both: lag 20 ms, delay 4 ms", 30)
    assert (faster.lag, faster.delay) == (0.02, 0.004)
    assert len(studies.variations(SLOWER)) == 29
    assert plants["delay 8 ms up, 20 ms down"].delays == (0.008, 0.02)
    assert plants["lag 50 ms up, 33.33 ms down"].lags == pytest.approx((0.05, 0.1 / 3.0))
    tuned = antijerk.tune(DIRECTED)
    assert (tuned.unmet, len(tuned.proof.proofs)) == ({}, 30)
    assert tuned.proof[name].margins.stable


def test_no_file_of_a_linear_system_holds_a_direction(tmp_path):
    with pytest.raises(
        pt.PowertrainError, match=r'"plant" has a lag or a delay that depends on direction.*discrete\(\)'
    ):
        pt.export.json({"plant": DIRECTED}, tmp_path / "plant.json")


def test_a_loop_that_is_unstable_says_so():
    plant = plant_of((0.05, 0.02), (0.03, 0.01), torque_limits=(-np.inf, np.inf), torque_rate=np.inf)
    controller = antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=1e4))
    with pytest.raises(pt.SignalError, match="unstable"):
        pt.closed_loop(plant, controller, pt.ramp(0.0, 0.1, 100.0), duration=30.0)
