"""Torque converters: `elements/converters`, `hybrid/groups`, `hybrid/collocation`, linear by `linear/couplings`."""

from bisect import bisect_right
from itertools import pairwise

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import powertrain_ctrl as pt
from tests.cases import case

# K-factors [rpm / sqrt(lbf ft)] and torque ratios that go with MathWorks' example "Modeling an Automatic Transmission
# Controller", equation 2 there, T = (N / K)^2; every second point of the upper half. The last point, where nothing slips, is
# ours: the table ends at 0.94.
RATIOS = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.82, 0.84, 0.86, 0.88, 0.9, 0.92, 0.94, 1.0)
K_FACTORS = np.array(
    [
        *(137.4652, 137.0650, 135.8644, 135.6644, 137.5653, 140.3666, 145.2689, 152.8725),
        *(162.9773, 166.1788, 170.0807, 175.3832, 183.5871, 197.6938, 215.9024, 244.5160),
    ]
)
LBF_FT = 0.45359237 * 9.80665 * 0.3048
CAPACITIES = (*(LBF_FT / (K_FACTORS * np.pi / 30.0) ** 2), 0.0)
TORQUE_RATIOS = (
    2.232,
    2.075,
    1.975,
    1.846,
    1.72,
    1.564,
    1.409,
    1.254,
    1.096,
    1.061,
    1.028,
    1.002,
    1.001,
    0.999,
    1.001,
    1.002,
)
TORQUE_RATIOS = (*TORQUE_RATIOS, 1.0)
CONVERTER = pt.TorqueConverter(
    "converter", "engine", "turbine", speed_ratios=RATIOS, capacities=CAPACITIES, torque_ratios=TORQUE_RATIOS
)
K_SHAFT, D_SHAFT, K_AXLE, D_AXLE, K_TYRE, D_TYRE = 2e4, 5.0, 1.5e4, 150.0, 1e6, 2e3
RADIUS, RATIO = 0.32, 10.0
CAR = pt.Driveline(
    pt.Inertia("engine", J=0.3),
    pt.Inertia("turbine", J=0.05),
    CONVERTER,
    pt.Clutch("lockup", "engine", "turbine", max_torque=0.0),
    pt.SpringDamper("input_shaft", "turbine", "transmission", stiffness=K_SHAFT, damping=D_SHAFT),
    pt.Inertia("transmission", J=0.021),
    pt.Gear("gears", "transmission", "axle", ratio=RATIO),
    pt.SpringDamper("drive_shafts", "axle", "wheels", stiffness=K_AXLE, damping=D_AXLE),
    pt.Inertia("wheels", J=2.0),
    pt.Tyre("tyres", "wheels", "vehicle", radius=RADIUS, stiffness=K_TYRE, damping=D_TYRE),
    pt.Mass("vehicle", m=1600.0),
)
OPEN = CAR.release("lockup")
TORQUE = pt.ramp(0.2, 0.1, 220.0, initial=40.0)
LOCKING = pt.ramp(2.3, 0.3, 400.0)
DRIVE_OFF = {"engine_torque": TORQUE, "lockup_capacity": LOCKING}


def interpolated(x, xs, ys):
    i = min(bisect_right(xs, x), len(xs) - 1)
    return ys[i - 1] + (x - xs[i - 1]) / (xs[i] - xs[i - 1]) * (ys[i] - ys[i - 1])


def by_the_tables(pump, turbine):
    """Torques of pump and turbine, written down from the definition."""
    if turbine > pump:
        torque = -interpolated(pump / turbine, RATIOS, CAPACITIES) * turbine**2
        return torque, torque
    ratio = max(turbine / pump, 0.0)
    torque = interpolated(ratio, RATIOS, CAPACITIES) * pump**2
    return torque, torque * interpolated(ratio, RATIOS, TORQUE_RATIOS)


@pytest.fixture(scope="module")
def drive_off():
    times = np.linspace(0.0, 3.0, 301)
    return pt.simulate(CAR, times, DRIVE_OFF, {"engine": 80.0})


def test_the_run_up_against_a_stalled_turbine_is_the_closed_form():
    reference = case("converter_stall_run_up")
    p = reference.p
    almost = 1.0 - 1e-9
    converter = pt.TorqueConverter(
        "converter",
        "pump",
        "turbine",
        speed_ratios=(0.0, almost, 1.0),
        capacities=(1.0 / p.K**2, 1.0 / p.K**2, 0.0),
        torque_ratios=(1.0, 1.0, 1.0),
    )
    car = pt.Driveline(pt.Inertia("pump", J=p.J), pt.Inertia("turbine", J=1e12), converter)
    response = pt.simulate(car, [0.0, 0.1, 0.5, 20.0], {"pump_torque": p.torque})
    speed = response["pump_speed"]
    expected = [reference.e.speed_at_0p1_s, reference.e.speed_at_0p5_s, reference.e.stall_speed]
    assert speed[1:] == pytest.approx(expected, abs=1e-9)
    assert np.abs(speed[1:] - expected).max() < response.error_estimate["pump_speed"] < 1e-5


def own_run(times):
    """The same drive-off by an integrator of its own on the plain equations; speeds, and the time of lock-up."""
    transmission = 0.021

    def rates(t, y, is_locked):
        pump, turbine, gear, wheel, speed, shaft, axle, tyre = y
        torque, capacity = float(TORQUE(t)), float(LOCKING(t))
        first = K_SHAFT * shaft + D_SHAFT * (turbine - gear)
        second = K_AXLE * axle + D_AXLE * (gear / RATIO - wheel)
        force = K_TYRE * RADIUS * tyre + D_TYRE * (RADIUS * wheel - speed)
        if is_locked:
            ahead = behind = (torque - first) / 0.35
        else:
            taken, given = by_the_tables(pump, turbine)
            ahead, behind = (torque - taken - capacity) / 0.3, (given + capacity - first) / 0.05
        turning = (first - second / RATIO) / transmission
        rolling = (second - RADIUS * force) / 2.0
        slips = (turbine - gear, gear / RATIO - wheel, wheel - speed / RADIUS)
        return (ahead, behind, turning, rolling, force / 1600.0, *slips)

    def slip(t, y, is_locked):
        return y[0] - y[1]

    slip.terminal, slip.direction = True, -1
    y, is_locked, lock, found = np.array([80.0, *[0.0] * 7]), False, None, np.zeros((8, len(times)))
    for begin, end in pairwise((0.0, 0.2, 0.3, 2.3, 2.6, 3.0)):
        while begin < end:
            events = None if is_locked else slip
            run = solve_ivp(
                rates,
                (begin, end),
                y,
                "DOP853",
                rtol=1e-12,
                atol=1e-12,
                events=events,
                args=(is_locked,),
                dense_output=True,
            )
            here = (times >= begin) & (times <= run.t[-1])
            found[:, here] = run.sol(times[here])
            begin, y = run.t[-1], run.y[:, -1]
            if begin < end:
                is_locked, lock, y[1] = True, begin, y[0]
    return found, lock


def test_a_drive_off_with_lock_up_is_that_of_an_independent_integrator(drive_off):
    own, lock = own_run(drive_off.time)
    names = ("engine_speed", "turbine_speed", "transmission_speed", "wheels_speed", "vehicle_speed")
    for name, values in zip(names, own, strict=False):
        assert np.abs(drive_off[name] - values).max() < drive_off.error_estimate[name] < 1e-3
    assert [event.kind for event in drive_off.events] == ["slip", "lock"]
    assert abs(drive_off.events[-1].time - lock) < 1e-7
    assert drive_off.error_estimate["events"] < 1e-6


def test_the_torques_shown_are_those_of_the_tables(drive_off):
    for pump, turbine, first, second in zip(
        *(
            drive_off[f"{name}"]
            for name in ("engine_speed", "turbine_speed", "converter_torque", "converter_turbine_torque")
        ),
        strict=True,
    ):
        if abs(pump - turbine) > 1e-6:
            assert (first, second) == pytest.approx(by_the_tables(pump, turbine), rel=1e-7, abs=1e-4)
        else:
            assert (first, second) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_the_heat_of_the_converter_is_what_the_pump_takes_and_the_turbine_does_not_give():
    times = np.linspace(0.0, 1.0, 8001)
    response = pt.simulate(CAR, times, {"engine_torque": 150.0}, {"engine": 150.0})
    power = response["converter_torque"] * response["engine_speed"]
    power = power - response["converter_turbine_torque"] * response["turbine_speed"]
    simpson = float(times[1] / 3.0 * np.sum(np.r_[1.0, np.tile([4.0, 2.0], 3999), 4.0, 1.0] * power))
    assert response.slip_energy["converter"] == pytest.approx(simpson, rel=1e-8)
    assert power.min() > -1e-9


def test_work_in_is_stored_and_dissipated():
    # the angle of the engine, for the work of its torque, is the twist of a very soft spring
    car = pt.Driveline(
        pt.Inertia("engine", J=0.3),
        pt.Drag("angle", "engine", damping=0.0, stiffness=1e-9),
        CONVERTER,
        pt.Inertia("turbine", J=0.5),
        pt.SpringDamper("shaft", "turbine", "load", stiffness=4e3),
        pt.Inertia("load", J=20.0),
        pt.Clutch("lockup", "engine", "turbine", max_torque=0.0),
    )
    inputs = {"engine_torque": 120.0, "lockup_capacity": pt.ramp(0.5, 0.1, 300.0)}
    response = pt.simulate(car, [0.0, 0.5, 1.0], inputs, {"engine": 100.0})
    speeds = [response[f"{name}_speed"][-1] for name in ("engine", "turbine", "load")]
    shaft, angle = response["shaft_twist"][-1], response["angle_twist"][-1]
    stored = 0.5 * np.dot((0.3, 0.5, 20.0), np.square(speeds)) + 0.5 * 4e3 * shaft**2 + 0.5 * 1e-9 * angle**2
    work = 0.5 * 0.3 * 100.0**2 + 120.0 * angle
    assert work == pytest.approx(stored + sum(response.slip_energy.values()), rel=1e-11)


def test_in_overrun_the_turbine_drives_the_pump():
    times = np.linspace(0.0, 1.0, 11)
    response = pt.simulate(CAR, times, {"engine_torque": -30.0}, {"engine": 250.0, "turbine": 250.0})
    assert (response["turbine_speed"][1:] > response["engine_speed"][1:]).all()
    assert response["converter_torque"][1:].max() < 0.0
    assert response["converter_turbine_torque"] == pytest.approx(response["converter_torque"], abs=1e-9)
    own = [
        by_the_tables(*speeds)[0] for speeds in zip(response["engine_speed"], response["turbine_speed"], strict=True)
    ]
    assert response["converter_torque"] == pytest.approx(own, abs=1e-5)


def test_while_its_lock_up_clutch_holds_it_is_not_there():
    times, inputs = np.linspace(0.0, 1.0, 101), {"engine_torque": TORQUE, "lockup_capacity": 400.0}
    without = pt.Driveline(*(e for e in CAR if e.name != "converter"))
    start = {"engine": 80.0, "turbine": 80.0}
    one, other = (pt.simulate(car, times, inputs, start) for car in (CAR, without))
    for name in ("engine_speed", "vehicle_acceleration", "lockup_torque"):
        assert one[name] == pytest.approx(other[name], rel=1e-11, abs=1e-9)
    assert not one["converter_torque"].any()
    assert one.slip_energy["converter"] == 0.0


def test_it_starts_from_rest_and_runs_through_play_with_all_events():
    shafts = pt.Backlash("drive_shafts", "axle", "wheels", gap=0.03, stiffness=K_AXLE, damping=D_AXLE)
    car = pt.Driveline(*(shafts if e.name == "drive_shafts" else e for e in CAR))
    response = pt.simulate(car, np.linspace(0.0, 3.0, 31), DRIVE_OFF)
    assert [event.kind for event in response.events] == ["contact", "slip", "lock"]
    assert response.error_estimate["events"] < 1e-6
    assert not response["engine_speed"][0]
    assert response["engine_speed"][-1] > 300.0


def test_a_run_goes_on_from_the_state_of_another():
    whole = pt.simulate(CAR, [0.0, 0.5, 1.0], {"engine_torque": 120.0}, {"engine": 100.0})
    first = pt.simulate(CAR, [0.0, 0.5], {"engine_torque": 120.0}, {"engine": 100.0})
    second = pt.simulate(CAR, [0.5, 1.0], {"engine_torque": 120.0}, initial_state=first.final)
    assert second["turbine_speed"][-1] == pytest.approx(whole["turbine_speed"][-1], abs=1e-6)


def test_order_and_names_do_not_matter():
    renamed = pt.TorqueConverter(
        "fluid", "engine", "turbine", speed_ratios=RATIOS, capacities=CAPACITIES, torque_ratios=TORQUE_RATIOS
    )
    other = pt.Driveline(*reversed([renamed if e.name == "converter" else e for e in CAR]))
    inputs, start = {"engine_torque": 150.0}, {"engine": 120.0}
    one, two = (pt.simulate(car, [0.0, 0.3, 0.6], inputs, start) for car in (CAR, other))
    assert two["vehicle_speed"] == pytest.approx(one["vehicle_speed"], abs=1e-9)
    assert two["fluid_torque"] == pytest.approx(one["converter_torque"], abs=1e-5)


def test_the_discrete_system_is_the_simulation():
    times, start = np.arange(51) * 0.01, {"engine": 80.0}
    system = pt.nonlinear_system(CAR, dt=0.01)
    values = pt.input_values(system, CAR, times, DRIVE_OFF)
    response = control.input_output_response(system, times, values, pt.initial_state(system, CAR, start))
    exact = pt.simulate(CAR, times, DRIVE_OFF, start)
    for name in ("engine_speed", "turbine_speed", "converter_turbine_torque"):
        assert response.outputs[system.find_output(name)] == pytest.approx(exact[name], abs=1e-3)
    assert response.outputs[system.find_output("vehicle_speed")] == pytest.approx(exact["vehicle_speed"], abs=1e-8)


def test_the_continuous_system_and_its_code_are_refused_by_name():
    with pytest.raises(pt.PowertrainError, match=r"converter is followed in steps of its own; give dt"):
        pt.nonlinear_system(CAR)
    with pytest.raises(
        pt.PowertrainError, match=r"converter is a torque converter, .* its lock-up clutch in its place"
    ):
        pt.export.c_plant(CAR)


def test_a_loop_around_a_car_with_a_locked_lock_up_clutch_is_that_without_a_converter():
    without = pt.Driveline(*(e for e in CAR if e.name != "converter"))
    one, other = (pt.tip_in(pt.SampledPlant(car=car), duration=1.0) for car in (CAR, without))
    assert one["vehicle_acceleration"] == pytest.approx(other["vehicle_acceleration"], abs=1e-9)


def test_a_loop_around_an_open_converter_is_refused_by_name():
    with pytest.raises(pt.PowertrainError, match=r"converter: its torques depend .* or lock its lock-up clutch"):
        pt.SampledPlant(car=OPEN)


def test_a_load_change_begins_with_both_sides_turning_alike():
    response = pt.load_change(OPEN, timepts=np.linspace(0.0, 1.5, 31), engine_speed=200.0)
    before = response.time < 1.0
    assert response["engine_speed"][before] == pytest.approx(200.0, abs=1e-9)
    assert response["turbine_speed"][before] == pytest.approx(200.0, abs=1e-9)
    assert response["engine_speed"][-1] > response["turbine_speed"][-1] > 200.0


def test_springs_start_with_what_the_turbine_gives_at_the_speeds_of_the_start():
    torque = by_the_tables(250.0, 150.0)[1]
    response = pt.simulate(
        OPEN,
        [0.0, 0.001],
        {"engine_torque": 100.0, "lockup_capacity": 0.0},
        {"engine": 250.0, "turbine": 150.0},
        initial_load={"engine_torque": 100.0},
    )
    # less what accelerates the turbine: inertia behind the converter, seen there
    behind = 0.021 + (2.0 + 1600.0 * RADIUS**2) / RATIO**2
    assert response["input_shaft_torque"][0] == pytest.approx(torque * behind / (behind + 0.05), rel=1e-9)


@pytest.mark.parametrize("speeds", [(250.0, 130.0), (250.0, 213.0), (200.0, 240.0), (150.0, 0.0), (150.0, -20.0)])
def test_at_a_point_it_is_the_slope_of_its_torques(speeds):
    h, matrix = 1e-4, np.zeros((2, 2))
    for j in range(2):
        up, down = (list(speeds), list(speeds))
        up[j] += h * (j == 0 or speeds[1] != 0.0)
        down[j] -= h
        rise = np.subtract(by_the_tables(*up), by_the_tables(*down)) / (up[j] - down[j])
        matrix[:, j] = rise
    coupling = OPEN.at(speed={"engine": speeds[0], "turbine": speeds[1]})["converter"]
    if speeds[1] == 0.0:
        # at stall the slope of one side: the turbine backwards, where the values at stall hold
        matrix[:, 1] = 0.0
    # torques on the nodes: the pump loses, the turbine gains
    assert coupling.damping == pytest.approx(np.array([matrix[0], -matrix[1]]), rel=1e-5, abs=1e-6)


def own_matrix(D):
    """A of the drive-off's equations, pump and turbine coupled by D [N m s/rad]; twists last."""
    A = np.zeros((8, 8))
    pump, turbine, gear, wheel, car, shaft, axle, tyre = np.eye(8)
    first = K_SHAFT * shaft + D_SHAFT * (turbine - gear)
    second = K_AXLE * axle + D_AXLE * (gear / RATIO - wheel)
    force = K_TYRE * RADIUS * tyre + D_TYRE * (RADIUS * wheel - car)
    A[0], A[1] = -(D[0, 0] * pump + D[0, 1] * turbine) / 0.3, (-(D[1, 0] * pump + D[1, 1] * turbine) - first) / 0.05
    A[2], A[3], A[4] = (first - second / RATIO) / 0.021, (second - RADIUS * force) / 2.0, force / 1600.0
    A[5], A[6], A[7] = turbine - gear, gear / RATIO - wheel, wheel - car / RADIUS
    return A


def in_order(values):
    return np.array(sorted(np.asarray(values, dtype=complex), key=lambda z: (round(z.real, 6), round(z.imag, 6))))


def test_poles_and_state_space_at_a_point_are_those_of_the_equations():
    car = OPEN.at(speed={"engine": 250.0, "turbine": 190.0})
    own = own_matrix(np.array(car["converter"].damping))
    expected = in_order(np.linalg.eigvals(own))
    assert in_order(pt.poles(car)) == pytest.approx(expected, rel=1e-9, abs=1e-9)
    system = pt.state_space(car, "engine_torque", ["turbine_speed", "engine_acceleration"])
    assert in_order(np.linalg.eigvals(system.A)) == pytest.approx(expected, rel=1e-8, abs=1e-8)
    s = 1j * 12.0
    moved = np.linalg.solve(s * np.eye(8) - own, np.eye(8)[0] / 0.3)
    assert system(s)[:, 0] == pytest.approx([moved[1], s * moved[0]], rel=1e-9)
    in_angles = pt.state_space(car, "engine_torque", "turbine_speed", coordinates="angle")
    assert in_angles(s) == pytest.approx(moved[1], rel=1e-9)


def test_small_motion_about_a_point_is_that_of_the_simulation():
    # steady at 220 and 170 rad/s: torques of the tables at both ends, so that nothing but the step moves it
    speeds = {"engine": 220.0, "vehicle": 170.0 / RATIO * RADIUS}
    taken, given = by_the_tables(220.0, 170.0)
    load, times = {"engine_torque": taken, "vehicle_force": -given * RATIO / RADIUS}, np.linspace(0.0, 0.3, 61)
    steady = {"initial_speed": speeds, "initial_load": load}
    response = pt.simulate(OPEN, times, load | {"engine_torque": taken + 0.01, "lockup_capacity": 0.0}, **steady)
    linear = pt.state_space(OPEN.at(speed=speeds), "engine_torque", ["engine_speed", "turbine_speed"])
    small = np.asarray(control.forced_response(linear, times, np.full(len(times), 0.01)).outputs)
    assert response["engine_speed"] - 220.0 == pytest.approx(small[0], abs=2e-3 * np.abs(small[0]).max())
    assert response["turbine_speed"] - 170.0 == pytest.approx(small[1], abs=2e-3 * np.abs(small[1]).max())


def test_modes_have_the_frequencies_of_the_rest_and_its_damping_to_first_order():
    car = OPEN.at(speed={"engine": 250.0, "turbine": 190.0})
    rest = pt.Driveline(*(e for e in OPEN if e.name != "converter")).release("lockup")
    found, plain = pt.modes(car), pt.modes(rest)
    assert found.n_rigid == plain.n_rigid == 2
    assert found.omega == pytest.approx(plain.omega)
    own = np.array(car["converter"].damping)
    for mode in range(2, len(found)):
        shape = dict(zip(found.nodes, found.shapes[:, mode], strict=True))
        inertia = 0.3 * shape["engine"] ** 2 + 0.05 * shape["turbine"] ** 2 + 0.021 * shape["transmission"] ** 2
        inertia += 2.0 * shape["wheels"] ** 2 + 1600.0 * shape["vehicle"] ** 2
        ends = np.array([shape["engine"], shape["turbine"]])
        added = ends @ own @ ends / (2.0 * found.omega[mode] * inertia)
        assert found.damping_ratio[mode] == pytest.approx(plain.damping_ratio[mode] + added, rel=1e-9)
    with pytest.raises(pt.PowertrainError, match="converter: couples speeds"):
        found.sensitivity(2, of="damping_ratio")
    assert found.sensitivity(2)["engine.J"] == pytest.approx(plain.sensitivity(2)["engine.J"])


def test_where_nothing_slips_it_is_a_damper_and_one_motion_is_free():
    car = OPEN.at(speed={"engine": 200.0, "turbine": 200.0})
    assert isinstance(car["converter"], pt.SpringDamper)
    slope = CAPACITIES[-2] / (1.0 - RATIOS[-2]) * 200.0
    assert car["converter"].damping == pytest.approx(slope)
    assert pt.poles(car)[0] == 0.0


def test_a_coupling_that_resists_no_common_motion_leaves_it_free():
    pair = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("b", J=2.0),
        pt.SpeedCoupling("coupling", "a", "b", damping=((3.0, -3.0), (-1.0, 1.0))),
    )
    # a' = -3 (a - b), 2 b' = a - b: the slip fades with 3 + 1/2, and any common speed stays
    assert pt.poles(pair) == pytest.approx([0.0, -3.5], abs=1e-12)
    assert pt.poles(pair)[0] == 0.0


@pytest.mark.parametrize(
    "use",
    [
        lambda car: pt.simulate(car, [0.0, 1.0]),
        lambda car: pt.assemble(car),
        lambda car: pt.two_mass(car),
        lambda car: pt.frequency_response(car, [1.0]),
        lambda car: pt.family(car, {"vehicle.m": [1500.0, 1700.0]}).load_change(),
        lambda car: pt.static_gain(car),
    ],
)
def test_what_knows_springs_and_dampers_alone_refuses_a_converter_at_a_point(use):
    with pytest.raises(
        pt.PowertrainError, match="converter: couples speeds by a matrix that no springs and dampers make"
    ):
        use(OPEN.at(speed={"engine": 250.0, "turbine": 190.0}))


def test_the_operating_point_needs_the_speeds_of_both_sides():
    with pytest.raises(pt.PowertrainError, match=r'converter: .* give both, e.g. car.at\(speed={"engine": 200.0'):
        OPEN.at(speed={"engine": 200.0})
    assert CAR.at(speed={"engine": 200.0}) == CAR.at(speed={"vehicle": 200.0 / RATIO * RADIUS})


def test_play_behind_it_carries_what_the_turbine_gives():
    shafts = pt.MultiStageSpring(
        "drive_shafts", "axle", "wheels", twists=(-0.05, 0.05, 0.2), torques=(-500.0, 500.0, 6500.0), damping=D_AXLE
    )
    car = pt.Driveline(*(shafts if e.name == "drive_shafts" else e for e in CAR)).release("lockup")
    # stall at 100 rad/s gives some 1450 N m behind the gear, the second stage; at 30 rad/s 130 N m, the first
    stiff, soft = (car.at(speed={"engine": speed, "turbine": 0.0})["drive_shafts"].stiffness for speed in (100.0, 30.0))
    assert (stiff, soft) == pytest.approx((4e4, 1e4))


def test_a_pump_that_turns_backwards_is_refused_by_name_and_remedy():
    with pytest.raises(
        pt.PowertrainError, match=r"converter: slips .* permitted: a pump that turns forwards; end the run"
    ):
        pt.simulate(CAR, [0.0, 1.0], {"engine_torque": -10.0})


def test_a_node_without_inertia_is_refused():
    rest = (
        pt.Inertia("engine", J=0.3),
        pt.SpringDamper("shaft", "turbine", "load", stiffness=1e3, damping=1.0),
        pt.SpringDamper("other", "turbine", "load", stiffness=1e3),
        pt.Inertia("load", J=1.0),
    )
    coupling = pt.SpeedCoupling("coupling", "engine", "turbine", damping=((1.0, 0.0), (0.0, 1.0)))
    with pytest.raises(pt.TopologyError, match='"turbine" has no inertia'):
        pt.simulate(pt.Driveline(*rest, CONVERTER), [0.0, 1.0])
    for use in (pt.poles, pt.state_space):
        with pytest.raises(pt.TopologyError, match='"turbine" has no inertia'):
            use(pt.Driveline(*rest, coupling))


def tables(**changed):
    values = {"speed_ratios": (0.0, 0.8, 1.0), "capacities": (3e-3, 2e-3, 0.0), "torque_ratios": (2.0, 1.0, 1.0)}
    return values | changed


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (
            {"speed_ratios": (0.0, 1.0)},
            "speed_ratios, capacities and torque_ratios = '2, 3, 3 values', permitted: as many",
        ),
        ({"speed_ratios": (0.0, 0.0, 1.0)}, "speed_ratios = 0.0, permitted: > 0, the one before"),
        (
            {"speed_ratios": (0.1, 0.8, 1.0)},
            "speed_ratios = 0.1, permitted: 0, the first one, where the turbine is stalled",
        ),
        ({"speed_ratios": (0.0, 0.8, 0.9)}, "speed_ratios = 0.9, permitted: 1, the last one"),
        ({"capacities": (3e-3, -2e-3, 0.0)}, r"capacities = -0.002 N m s\^2/rad\^2, permitted: >= 0"),
        (
            {"capacities": (3e-3, 2e-3, 1e-3)},
            r"capacities = 0.001 .* permitted: 0 at speed ratio 1, .* add a last point",
        ),
        ({"torque_ratios": (2.0, -1.0, 1.0)}, "torque_ratios = -1.0, permitted: >= 0"),
        ({"torque_ratios": (2.0, 1.3, 1.0)}, "permitted: at most 1.25 at speed ratio 0.8, an efficiency of 1"),
        # 2.4 at 0.5 would be 1.2; both ends of the line are fine
        (
            {"speed_ratios": (0.0, 0.9, 1.0), "torque_ratios": (4.0, 1.0, 1.0)},
            "permitted: at most .* an efficiency of 1",
        ),
        ({"torque_ratios": "2, 1, 1"}, "permitted: a sequence of numbers"),
        ({"capacities": (3e-3, float("nan"), 0.0)}, "capacities = nan"),
    ],
)
def test_tables_that_are_none_are_refused_by_name_value_and_remedy(changed, message):
    with pytest.raises(pt.ParameterError, match=message):
        pt.TorqueConverter("converter", "engine", "turbine", **tables(**changed))


@pytest.mark.parametrize("damping", [5.0, ((1.0, 2.0),), ((1.0, 2.0), (1.0,)), ((1.0, 2.0), (1.0, "a")), "ab"])
def test_a_coupling_is_two_rows_of_two_numbers(damping):
    with pytest.raises(pt.ParameterError, match="coupling: damping"):
        pt.SpeedCoupling("coupling", "a", "b", damping=damping)


def test_files_give_it_back_equal(tmp_path):
    for car in (OPEN, OPEN.at(speed={"engine": 250.0, "turbine": 190.0})):
        car.save(tmp_path / "car.toml")
        assert pt.load(tmp_path / "car.toml") == car


def test_its_characteristic_is_drawn_over_the_speed_ratio():
    ax = pt.plots.characteristic(CONVERTER)
    assert ax.get_xlabel() == "speed ratio, turbine over pump [-]"
    pump, turbine = ax.get_lines()[:2]
    ratios = pump.get_xdata()
    expected = np.array([by_the_tables(100.0, 100.0 * ratio) for ratio in ratios])
    assert pump.get_ydata() == pytest.approx(expected[:, 0])
    assert turbine.get_ydata() == pytest.approx(expected[:, 1])


def test_a_schematic_shows_converter_and_lock_up_clutch_beside_each_other():
    ax = pt.plots.schematic(OPEN)
    height = {text.get_text(): text.get_position()[1] for text in ax.texts}
    assert height["converter"] > height["lockup"]


def test_the_file_in_the_docstring_is_the_converter_of_its_example(tmp_path):
    lines = pt.TorqueConverter.__doc__.split("code-block:: toml\n")[1].splitlines()
    bodies = '[engine]\ntype = "Inertia"\nJ = 0.2\n[turbine]\ntype = "Inertia"\nJ = 0.05\n'
    (tmp_path / "car.toml").write_text(bodies + "\n".join(line.strip() for line in lines))
    loaded = pt.load(tmp_path / "car.toml")["converter"]
    assert loaded == pt.TorqueConverter(
        "converter",
        "engine",
        "turbine",
        speed_ratios=(0.0, 0.6, 0.85, 1.0),
        capacities=(3e-3, 3e-3, 2e-3, 0.0),
        torque_ratios=(2.0, 1.4, 1.0, 1.0),
    )


def test_at_stall_and_at_the_coupling_point_it_gives_what_its_tables_say():
    # stall: K = 137.4652 rpm / sqrt(lbf ft), torque ratio 2.232; 1 lbf ft = 1.3558179 N m
    pump, turbine = CONVERTER.torques(1900.0 * np.pi / 30.0, 0.0)
    assert pump == pytest.approx((1900.0 / 137.4652) ** 2 * 1.3558179, rel=1e-7)
    assert turbine == pytest.approx(2.232 * pump, rel=1e-12)
    # from the coupling point on, 0.86, it multiplies no longer
    pump, turbine = CONVERTER.torques(200.0, 0.86 * 200.0)
    assert turbine == pytest.approx(1.002 * pump, rel=1e-12)
    assert CONVERTER.torques(200.0, 200.0) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_stalled_car_runs_up_to_the_stall_speed():
    # the brake holds the wheels; at rest the pump takes what the engine gives
    car = pt.Driveline(*CAR, pt.Clutch("brake", "wheels", max_torque=1e5)).release("lockup")
    inputs = {"engine_torque": 150.0, "lockup_capacity": 0.0}
    response = pt.simulate(car, [0.0, 5.0], inputs, {"engine": 80.0})
    assert response["engine_speed"][-1] == pytest.approx(np.sqrt(150.0 / CAPACITIES[0]), rel=1e-5)
    assert response["converter_turbine_torque"][-1] == pytest.approx(2.232 * 150.0, rel=1e-4)
    assert response["drive_shafts_torque"][-1] == pytest.approx(2.232 * 150.0 * RATIO, rel=1e-4)
