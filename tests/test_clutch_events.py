"""Clutch events with closed-form solutions, published ones, and invariances of the exact core.

Of hybrid/simulation, hybrid/response, hybrid/model.
"""

import json
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate
from hypothesis import given, settings
from hypothesis import strategies as st

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid import flow

TIME, HEAT = 1e-9, 1e-8


def pair(J1=1.0, J2=1.0, torque=2.0, static_ratio=1.0):
    return pt.Driveline(
        pt.Inertia("a", J=J1),
        pt.Inertia("b", J=J2),
        pt.Clutch("clutch", "a", "b", max_torque=torque, static_ratio=static_ratio),
    )


def run(car, end, inputs=None, speed=None, n=2001):
    return pt.simulate(car, np.linspace(0.0, end, n), inputs, speed)


def events(response):
    return [(e.time, e.element, e.mode) for e in response.events]


def locks(response):
    return [e.time for e in response.events if e.kind == "lock"]


# --- closed forms


@pytest.mark.parametrize("torque", [0.5, 2.0, 40.0])
def test_isolated_pair_locks_on_time_and_its_heat_does_not_depend_on_the_capacity(torque):
    J1, J2, slip = 1.0, 3.0, 10.0
    response = run(pair(J1, J2, torque), 40.0, speed={"a": slip})
    [(time, _, mode)] = events(response)
    assert time == pytest.approx(slip / (torque * (1 / J1 + 1 / J2)), abs=TIME)
    assert mode == 0
    assert response.slip_energy["clutch"] == pytest.approx(0.5 * slip**2 * J1 * J2 / (J1 + J2), rel=HEAT)
    assert response["b_speed"][-1] == pytest.approx(J1 * slip / (J1 + J2), abs=1e-10)  # momentum


def test_capacity_ramp_locks_when_its_impulse_is_enough():
    # slip' = -2 c t -> slip = 10 - c t^2
    response = run(pair(), 4.0, {"clutch_capacity": pt.ramp(0.0, 4.0, 12.0)}, {"a": 10.0})
    assert locks(response) == [pytest.approx(np.sqrt(10.0 / 3.0), abs=TIME)]
    # heat: the kinetic energy that is missing, 1/2 (1/2) 10^2
    assert response.slip_energy["clutch"] == pytest.approx(25.0, rel=HEAT)


@pytest.mark.parametrize("ratio", [1.0, 1.2])
def test_a_stuck_clutch_breaks_away_at_its_static_limit(ratio):
    # torque t on a of two equal inertias: the clutch carries t / 2 and breaks at t = 2 ratio capacity
    response = run(pair(torque=2.0, static_ratio=ratio), 8.0, {"a_torque": pt.ramp(0.0, 8.0, 8.0)})
    [(time, _, mode)] = events(response)
    assert (time, mode) == (pytest.approx(4.0 * ratio, abs=TIME), 1)
    # afterwards slip' = (t - 2) - 2 from there on
    slip = 0.5 * 8.0**2 - 4.0 * 8.0 - (0.5 * time**2 - 4.0 * time)
    assert response["clutch_slip_speed"][-1] == pytest.approx(slip, abs=1e-9)
    heat = 2.0 * (lambda t: t**3 / 6 - 2 * t**2 - (0.5 * time**2 - 4 * time) * t)(8.0)
    heat -= 2.0 * (lambda t: t**3 / 6 - 2 * t**2 - (0.5 * time**2 - 4 * time) * t)(time)
    assert response.slip_energy["clutch"] == pytest.approx(heat, rel=HEAT)


def test_slip_passes_through_zero_without_locking_when_the_load_is_too_large():
    # slip = 10 - (2*1 + 6) t until 1.25 s, then |torque to lock| = 3 > 1: on at -(6 - 2)
    response = run(pair(torque=1.0), 3.0, {"b_torque": 6.0}, {"a": 10.0})
    assert events(response) == [(pytest.approx(1.25, abs=TIME), "clutch", -1)]
    assert response["clutch_slip_speed"][-1] == pytest.approx(-4.0 * 1.75, abs=1e-9)


@pytest.mark.parametrize(("gap", "hits"), [(1e-5, False), (-1e-5, True)])
def test_a_graze_of_a_few_microseconds_is_decided_rightly(gap, hits):
    # slip = gap + m (t - t0)^2 with the curvature of a torque ramp that turns the fall into a rise
    t0, m = 0.7, 8e5
    start = gap + m * t0**2
    inputs = {"a_torque": pt.ramp(0.0, 2.0, 2 * m * 2.0 - 2 * m * t0 + 2.0, -2 * m * t0 + 2.0), "clutch_capacity": 1.0}
    response = run(pair(), 2.0, inputs, {"a": start}, n=21)
    # slip' = torque - 2 capacity
    if not hits:
        assert not response.events
    else:
        reaches = t0 - np.sqrt(-gap / m)
        assert response.events[0].time == pytest.approx(reaches, abs=TIME)


def test_two_clutches_lock_at_the_same_instant():
    bodies = [pt.Inertia(name, J=1.0) for name in "abcd"]
    car = pt.Driveline(*bodies, pt.Clutch("one", "a", "b", max_torque=3.0), pt.Clutch("two", "c", "d", max_torque=1.5))
    response = run(car, 1.0, speed={"a": 3.0, "c": 1.5})
    assert events(response) == [(pytest.approx(0.5, abs=TIME), name, 0) for name in ("one", "two")]


def test_coupled_pair_of_clutches_locks_at_once():
    # b between a and c: slips 6 and 6 with equal capacities, b without net torque
    car = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in "abc"),
        pt.Clutch("ab", "a", "b", max_torque=2.0),
        pt.Clutch("bc", "b", "c", max_torque=2.0),
    )
    response = run(car, 5.0, speed={"a": 6.0, "b": 0.0, "c": -6.0})
    assert events(response) == [(pytest.approx(3.0, abs=TIME), name, 0) for name in ("ab", "bc")]
    np.testing.assert_allclose([response[f"{n}_speed"][-1] for n in "abc"], 0.0, atol=1e-10)


def test_dual_clutch_handover():
    # engine 1 on two shafts that turn at w1 = 4 v, w2 = 2 v of a heavy output; clutch 2 closes, clutch 1 opens
    J, Jo = 0.2, 50.0
    car = pt.Driveline(
        pt.Inertia("engine", J=J),
        pt.Inertia("out", J=Jo),
        pt.Clutch("first", "engine", "s1", max_torque=0.0),
        pt.Clutch("second", "engine", "s2", max_torque=0.0),
        pt.Gear("g1", "s1", "out", ratio=4.0),
        pt.Gear("g2", "s2", "out", ratio=2.0),
    )
    capacity = {"first_capacity": pt.step(0.5, 0.0, 200.0), "second_capacity": pt.step(0.5, 150.0)}
    response = run(car, 2.0, {**capacity, "engine_torque": 100.0}, {"engine": 200.0, "out": 50.0})
    # stuck in first: J_total = J 16 + Jo at the output, torque 4 * 100
    v = 50.0 + 400.0 / (J * 16 + Jo) * 0.5
    slip = 4.0 * v - 2.0 * v
    # sliding in second: engine (100 - 150) / J, output 2 * 150 / Jo
    rate = (100.0 - 150.0) / J - 2.0 * 300.0 / Jo
    assert events(response) == [
        (pytest.approx(0.5, abs=TIME), "first", 2),
        (pytest.approx(0.5, abs=TIME), "second", 1),
        (pytest.approx(0.5 - slip / rate, abs=TIME), "second", 0),
    ]
    torque = response["second_torque"][-1]
    assert torque == pytest.approx(100.0 * Jo / (Jo + 4 * J), rel=1e-9)


def test_brake_to_standstill_and_hold():
    car = pt.Driveline(pt.Inertia("wheel", J=2.0), pt.Clutch("brake", "wheel", max_torque=4.0))
    response = run(car, 5.0, {"wheel_torque": pt.step(3.0, 3.0)}, {"wheel": 5.0})
    assert events(response) == [(pytest.approx(2.5, abs=TIME), "brake", 0)]
    assert response["wheel_speed"][-1] == 0.0
    assert response["brake_torque"][-1] == pytest.approx(3.0, rel=1e-12)
    assert response.slip_energy["brake"] == pytest.approx(25.0, rel=HEAT)


def test_without_capacity_there_are_two_drivelines():
    car = pt.examples.conventional().release("clutch")
    inputs = {"engine_torque": pt.ramp(0.1, 0.1, 50.0), "vehicle_force": pt.step(0.2, -500.0)}
    t = np.linspace(0.0, 1.0, 201)
    whole = pt.simulate(car, t, {**inputs, "clutch_capacity": 0.0})
    assert not whole.events
    assert (whole["clutch_mode"] == 2).all()
    for node in ("engine", "vehicle"):
        name = "engine_torque" if node == "engine" else "vehicle_force"
        alone = pt.simulate(car.part(node), t, {name: inputs[name]})
        np.testing.assert_allclose(whole[f"{node}_speed"], alone[f"{node}_speed"], atol=1e-11)


def test_capacity_from_zero_at_rest_sticks_and_with_a_load_slips():
    assert [e.mode for e in run(pair(), 1.0, {"clutch_capacity": pt.ramp(0.2, 0.5, 5.0)}).events] == [0]
    loaded = run(pair(), 3.0, {"clutch_capacity": pt.ramp(0.0, 1.0, 5.0), "a_torque": 1.0})
    # slip' = 1 - 10 t: up, back to zero at t = 0.2
    assert locks(loaded) == [pytest.approx(0.2, abs=TIME)]


# --- published


def coupled_clutches(t):
    car = pt.Driveline(
        *(pt.Inertia(f"J{i}", J=1.0) for i in (1, 2, 3, 4)),
        *(pt.Clutch(f"clutch{i}", f"J{i}", f"J{i + 1}", max_torque=0.0, static_ratio=1.1) for i in (1, 2, 3)),
    )
    inputs = {
        "J1_torque": lambda t: 10.0 * np.sin(2 * np.pi * 5 * t),
        "clutch1_capacity": lambda t: max(0.0, 10.0 * np.cos(2 * np.pi * 0.2 * t)),
        "clutch2_capacity": pt.step(0.4, 10.0),
        "clutch3_capacity": pt.step(0.9, 10.0),
    }
    return pt.simulate(car, t, inputs, {"J1": 10.0})


def test_three_coupled_clutches_of_modelica():
    data = json.loads((Path(__file__).parent / "reference" / "coupled_clutches.json").read_text())
    t = np.array(sorted({v["t"] for v in data["values"]} | set(np.linspace(0.0, 1.5, 301))))
    response = coupled_clutches(t)
    exact = data["events_exact"][1:]
    assert len(response.events) == len(exact)
    modes = list(data["events_exact"][0]["mode"])
    for event, expected in zip(response.events, exact, strict=True):
        modes[int(event.element[-1]) - 1] = event.mode
        assert modes == expected["mode"]
        assert event.time == pytest.approx(expected["t"], abs=1e-6)
    published = [e["t"] for e in data["events_published"] if not e["start_flag"]][1:]
    np.testing.assert_allclose([e.time for e in response.events], published, atol=1e-4)
    for value in data["values"]:
        i = int(np.searchsorted(t, value["t"]))
        speeds = [response[f"J{k}_speed"][i] for k in (1, 2, 3, 4)]
        np.testing.assert_allclose(speeds, value["w"], atol=data["suggested_tolerance"]["exact_solver"]["w"])
        np.testing.assert_allclose(speeds, value["w_published"], atol=1e-4)


# --- energy


def energy_balance(car, inputs, speed, start, end):
    """(work in, change of stored energy, dissipation in dampers, heat) by Gauss quadrature between events and corners."""
    coarse = pt.simulate(car, np.array([start, end]), inputs, speed)
    edges = {start, end, *(e.time for e in coarse.events)}
    for signal in inputs.values():
        edges |= {t for t in getattr(signal, "times", ()) if start < t < end}
    nodes, weights = np.polynomial.legendre.leggauss(8)
    times, areas = [], []
    for a, b in pairwise(sorted(edges)):
        fine = np.linspace(a, b, max(2, int((b - a) / 1e-4) + 1))
        for u, v in pairwise(fine):
            times.append(0.5 * (u + v) + 0.5 * (v - u) * nodes)
            areas.append(0.5 * (v - u) * weights)
    t, area = np.concatenate(times), np.concatenate(areas)
    response = pt.simulate(car, np.concatenate([[start], t, [end]]), inputs, speed)
    m = pt.assemble(car.release())

    def at(name):
        return response[name][1:-1]

    work = sum(area @ (at(name) * at(f"{name.rsplit('_', 1)[0]}_speed")) for name in m.inputs)
    lost = 0.0
    for i, name in enumerate(m.compliances):
        if m.damping[i]:
            spring = m.stiffness[i] * at(f"{name}_twist") if m.stiffness[i] else 0.0
            lost += area @ ((at(f"{name}_torque") - spring) ** 2 / m.damping[i])
    stored = []
    for k in (0, -1):
        speeds = np.array([response[f"{node}_speed"][k] for node in m.nodes])
        twists = [
            m.stiffness[i] * response[f"{name}_twist"][k] ** 2 for i, name in enumerate(m.compliances) if m.stiffness[i]
        ]
        stored.append(0.5 * speeds @ m.J @ speeds + 0.5 * sum(twists))
    return work, stored[1] - stored[0], lost, sum(response.slip_energy.values())


def test_work_is_stored_or_lost_in_dampers_or_heat():
    car = pt.examples.conventional(damping="closed")
    inputs = {"engine_torque": pt.ramp(0.1, 0.22, 350.0), "clutch_capacity": pt.ramp(0.1, 0.22, 370.0)}
    work, stored, lost, heat = energy_balance(car, inputs, {"engine": pt.rpm(5000)}, 0.0, 1.6)
    assert work == pytest.approx(stored + lost + heat, rel=1e-9)
    assert heat > 9e4


# --- the launch


LAUNCH = {"open": 2.6506, "closed": 2.6524}


@pytest.mark.parametrize("damping", ["open", "closed"])
def test_launch_has_one_clean_lock_when_the_source_has_it(damping):
    response = pt.launch(pt.examples.conventional(damping=damping))
    assert [e.kind for e in response.events] == ["slip", "lock"]
    assert response.events[1].time == pytest.approx(LAUNCH[damping], abs=2e-4)


def dominant_frequency(t, a):
    """Least squares of a damped oscillation on a straight line, frequency by a fine grid and refinement."""
    t = t - t[0]

    def misfit(f, zeta):
        w = 2 * np.pi * f
        basis = np.column_stack(
            [np.ones_like(t), t, np.exp(-zeta * w * t) * np.cos(w * t), np.exp(-zeta * w * t) * np.sin(w * t)]
        )
        return np.linalg.norm(a - basis @ np.linalg.lstsq(basis, a, rcond=None)[0])

    grid = [(misfit(f, z), f) for f in np.arange(1.0, 12.0, 0.01) for z in (0.01, 0.03, 0.05)]
    return min(grid)[1]


def test_acceleration_shows_the_printed_frequencies_before_and_after_lock():
    t = np.arange(0.0, 4.5, 0.005)
    response = pt.launch(pt.examples.conventional(damping="open"), timepts=t)
    a = response["vehicle_acceleration"]
    lock = response.events[1].time
    slipping = (t > 1.8) & (t < lock)
    stuck = t > lock + 0.1
    assert dominant_frequency(t[slipping], a[slipping]) == pytest.approx(7.25, abs=0.05)
    assert dominant_frequency(t[stuck], a[stuck]) == pytest.approx(2.64, abs=0.03)


def damped_by_shaft():
    """Damping of another study of the same launch, which has its values at seven instants (rad/s, N m, m/s^2)."""
    values = {
        "damper_spring": 0.5,
        "clutch_shaft": 1.0,
        "input_shaft": 2.0,
        "output_shaft": 0.15 * 36,
        "drive_shafts": 50.0,
        "tyres": 200.0,
    }
    car = pt.examples.conventional(damping=None)
    for name, damping in values.items():
        car = car.replace(name, damping=damping)
    return car


STUDY = [
    (1.600, 522.8768, 521.8865, 31.5949, 9.1633, 168.182, 1, 4.8625),
    (2.000, 505.8338, 505.9534, 198.2837, 177.0080, 370.000, 1, 9.3844),
    (2.300, 492.2414, 492.2216, 315.7604, 315.1929, 370.000, 1, 9.6752),
    (2.600, 478.6105, 478.5732, 442.7782, 452.8236, 370.000, 1, 9.1335),
    (2.700, 478.9551, 480.0946, 480.0946, 495.9648, 305.679, 0, 7.5508),
    (3.000, 580.6712, 580.8011, 580.8011, 569.0161, 312.533, 0, 7.8998),
    (4.000, 857.4122, 857.2458, 857.2458, 851.1796, 144.544, 0, 3.1622),
]


def test_launch_with_other_dampers_is_that_of_an_independent_study():
    t = np.array([0.0, *(row[0] for row in STUDY)])
    response = pt.launch(damped_by_shaft(), timepts=t)
    assert locks(response) == [pytest.approx(2.64904, abs=1e-5)]
    for i, (_, engine, primary, secondary, vehicle, torque, mode, acceleration) in enumerate(STUDY, start=1):
        speeds = [response[f"{n}_speed"][i] for n in ("engine", "clutch_primary", "clutch_secondary")]
        np.testing.assert_allclose(speeds, [engine, primary, secondary], atol=6e-5)
        assert response["vehicle_speed"][i] / 0.35 * 18 == pytest.approx(vehicle, abs=6e-5)
        assert response["clutch_torque"][i] == pytest.approx(torque, abs=6e-4)
        assert response["clutch_mode"][i] == mode
        assert response["vehicle_acceleration"][i] == pytest.approx(acceleration, abs=6e-5)


def event_located(car, inputs, engine_speed, end):
    """Event times of one clutch by DOP853 at rtol 1e-11 on matrices of its own, mode by mode, from t = 1.5 s."""
    m = pt.assemble(car.release())
    F, k = m.F, m.stiffness
    Mi = np.linalg.inv(m.M)
    g = (m.S @ m.T)[0]
    torque_on = m.T.T @ m.B[:, m.inputs.index("engine_torque")]
    W = g @ Mi @ g
    A, b = Mi @ np.hstack([-F.T * k, -m.D]), Mi @ torque_on

    def engine_torque(t):
        return np.interp(t, inputs["engine_torque"].times, inputs["engine_torque"].values)

    def capacity(t):
        return np.interp(t, inputs["clutch_capacity"].times, inputs["clutch_capacity"].values)

    def free(x, t):
        return A @ x + b * engine_torque(t)

    def clutch_torque(t, x, mode):
        return mode * capacity(t) if mode else g @ free(x, t) / W

    def rate(t, x, mode):
        return np.concatenate([F @ x[len(k) :], free(x, t) - Mi @ g * clutch_torque(t, x, mode)])

    spinning = np.zeros(len(m.nodes))
    for node in ("engine", "torsional_damper", "clutch_primary"):
        spinning[m.nodes.index(node)] = engine_speed
    z0 = np.linalg.lstsq(m.T, spinning, rcond=None)[0]
    x, t, mode, found = np.concatenate([np.zeros(len(k)), z0]), 1.5, 1, []
    corner = inputs["engine_torque"].times[1]
    while t < end:
        stop = corner if t < corner - 1e-12 else end

        def slip(t, x, mode=mode):
            return mode * (g @ x[len(k) :])

        def reserve(t, x, mode=mode):
            return capacity(t) - abs(clutch_torque(t, x, 0))

        event = slip if mode else reserve
        solution = _solve(rate, t, stop, x, mode, event)
        x, t = solution.y[:, -1], solution.t[-1]
        if solution.status != 1:
            continue
        if mode:
            x[len(k) :] -= Mi @ g * (g @ x[len(k) :]) / W
            needed = clutch_torque(t, x, 0)
            mode = 0 if abs(needed) <= capacity(t) else int(np.sign(needed))
        else:
            mode = int(np.sign(clutch_torque(t, x, 0)))
            # a first step away from zero slip, so that the start is not found as an event
            step = 1e-7
            x = x + step * rate(t, x, mode)
            t = t + step
        found.append((t, mode))
    return found


def _solve(rate, start, stop, x, mode, event):
    def wrapped(t, x):
        return event(t, x)

    wrapped.terminal, wrapped.direction = True, -1.0
    return scipy.integrate.solve_ivp(
        lambda t, x: rate(t, x, mode), (start, stop), x, "DOP853", events=wrapped, rtol=1e-11, atol=1e-12, max_step=1e-3
    )


def test_fast_ramps_lock_five_times_as_an_event_located_solver_finds():
    car = damped_by_shaft()
    inputs = {"engine_torque": pt.ramp(1.5, 0.1, 350.0), "clutch_capacity": pt.ramp(1.5, 0.1, 370.0)}
    response = pt.simulate(car, np.array([0.0, 1.5, 2.7]), inputs, {"engine": pt.rpm(5000)})
    assert len(locks(response)) == 5
    assert locks(response)[0] == pytest.approx(2.55698, abs=1e-5)
    assert locks(response)[-1] == pytest.approx(2.62412, abs=1e-5)
    expected = event_located(car, inputs, pt.rpm(5000), 2.7)
    assert [e.mode for e in response.events[1:]] == [mode for _, mode in expected]
    np.testing.assert_allclose([e.time for e in response.events[1:]], [t for t, _ in expected], atol=1e-6)


# --- invariances


def two_clutch_car(flip=False, order=1):
    clutches = [
        pt.Clutch("c1", *(("b", "a") if flip else ("a", "b")), max_torque=8.0),
        pt.Clutch("c2", "c", "d", max_torque=5.0, static_ratio=1.1),
    ][::order]
    return pt.Driveline(
        *(pt.Inertia(n, J=J) for n, J in (("a", 1.0), ("b", 0.5), ("c", 0.7), ("d", 3.0))),
        pt.SpringDamper("s", "b", "c", stiffness=400.0, damping=0.5),
        *clutches,
    )


INPUTS = {
    "a_torque": pt.ramp(1.6, 0.5, 25.0) + pt.step(2.3, -30.0),
    "d_torque": pt.step(1.0, -9.0) + pt.step(1.3, 15.0),
}
SPEED = {"a": 20.0}


def test_order_and_direction_of_clutches_change_nothing():
    t = np.linspace(0.0, 3.0, 301)
    first = pt.simulate(two_clutch_car(), t, INPUTS, SPEED)
    assert len(first.events) >= 4
    for other in (two_clutch_car(order=-1), two_clutch_car(flip=True)):
        second = pt.simulate(other, t, INPUTS, SPEED)
        np.testing.assert_allclose([e.time for e in second.events], [e.time for e in first.events], atol=1e-9)
        for node in "abcd":
            np.testing.assert_allclose(second[f"{node}_speed"], first[f"{node}_speed"], atol=1e-9)
        assert second.slip_energy == pytest.approx(first.slip_energy, rel=1e-9)


@given(st.floats(0.05, 2.95))
@settings(max_examples=25)
def test_a_run_may_be_split_anywhere(split):
    car = two_clutch_car()
    whole = pt.simulate(car, np.array([0.0, split, 3.0]), INPUTS, SPEED)
    head = pt.simulate(car, np.array([0.0, split]), INPUTS, SPEED)
    tail = pt.simulate(car, np.array([split, 3.0]), INPUTS, initial_state=head.final)
    for node in "abcd":
        assert tail[f"{node}_speed"][-1] == pytest.approx(whole[f"{node}_speed"][-1], abs=1e-9)
    times = [e.time for e in (*head.events, *tail.events)]
    np.testing.assert_allclose(times, [e.time for e in whole.events], atol=1e-9)
    heat = {c: head.slip_energy[c] + tail.slip_energy[c] for c in head.slip_energy}
    assert heat == pytest.approx(whole.slip_energy, rel=1e-9)


@given(st.lists(st.floats(-20.0, 20.0), min_size=4, max_size=4), st.lists(st.floats(0.0, 12.0), min_size=4, max_size=4))
@settings(max_examples=25)
def test_coulomb_friction_holds_at_every_sample(torques, capacities):
    t = np.linspace(0.0, 3.0, 4)
    fine = np.linspace(0.0, 3.0, 601)
    car = two_clutch_car()
    inputs = {"a_torque": np.interp(fine, t, torques), "c1_capacity": np.interp(fine, t, capacities)}
    response = pt.simulate(car, fine, inputs, {"a": 5.0, "d": -3.0})
    for name, ratio in (("c1", 1.0), ("c2", 1.1)):
        capacity, torque = response[f"{name}_capacity"], response[f"{name}_torque"]
        mode, slip = response[f"{name}_mode"], response[f"{name}_slip_speed"]
        assert (np.abs(torque) <= ratio * capacity + 1e-7).all()
        sliding = np.abs(mode) == 1
        np.testing.assert_allclose(torque[sliding], mode[sliding] * capacity[sliding], atol=1e-9)
        assert (mode[sliding] * slip[sliding] >= -1e-9).all()
        assert (np.abs(slip[mode == 0]) < 1e-9).all()


def test_corners_off_the_grid_are_honoured():
    car = pt.examples.conventional(damping="open")
    inputs = {"engine_torque": pt.ramp(1.50037, 0.2171, 350.0), "clutch_capacity": pt.ramp(1.49983, 0.2223, 370.0)}
    coarse = pt.simulate(car, np.array([0.0, 1.0, 3.3]), inputs, {"engine": 500.0})
    corners = sorted({t for s in inputs.values() for t in s.times})
    fine = pt.simulate(car, np.array([0.0, 1.0, *corners, 2.0, 2.5, 3.3]), inputs, {"engine": 500.0})
    assert coarse["vehicle_speed"][-1] == pytest.approx(fine["vehicle_speed"][-1], abs=1e-10)
    np.testing.assert_allclose([e.time for e in coarse.events], [e.time for e in fine.events], atol=1e-12)


# --- the flow


def critically_damped(d):
    """J = 1/2 reduced, k = 50: critical at d = 10."""
    return pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("b", J=1.0),
        pt.Inertia("c", J=2.0),
        pt.SpringDamper("s", "a", "b", stiffness=50.0, damping=d),
        pt.Clutch("clutch", "b", "c", max_torque=3.0),
    )


def test_critical_damping_falls_back_to_the_matrix_exponential(monkeypatch):
    t = np.linspace(0.0, 4.0, 41)
    inputs = {"a_torque": pt.ramp(0.5, 1.0, 9.0), "clutch_capacity": pt.ramp(0.0, 3.0, 5.0)}
    used = []
    dense = flow.DenseTrajectory.__init__
    monkeypatch.setattr(flow.DenseTrajectory, "__init__", lambda self, *args: (used.append(1), dense(self, *args))[1])
    exact = pt.simulate(critically_damped(10.0), t, inputs, {"a": 8.0})
    assert used
    used.clear()
    near = [pt.simulate(critically_damped(10.0 * (1 + sign * 1e-4)), t, inputs, {"a": 8.0}) for sign in (-1, 1)]
    assert not used
    for name in ("a_speed", "c_speed", "s_torque"):
        middle = 0.5 * (near[0][name] + near[1][name])
        np.testing.assert_allclose(exact[name], middle, atol=1e-6)
    times = 0.5 * (np.array(locks(near[0])) + np.array(locks(near[1])))
    np.testing.assert_allclose(locks(exact), times, atol=1e-7)


def test_both_flows_agree_where_both_are_well_conditioned(monkeypatch):
    t = np.linspace(0.0, 1.0, 21)
    modal = pt.simulate(two_clutch_car(), t, INPUTS, SPEED)
    monkeypatch.setattr(flow, "ILL_CONDITIONED", 0.0)
    from powertrain_ctrl.hybrid.model import _kept_plants

    _kept_plants.cache_clear()
    dense = pt.simulate(two_clutch_car(), t, INPUTS, SPEED)
    _kept_plants.cache_clear()
    np.testing.assert_allclose([e.time for e in dense.events], [e.time for e in modal.events], atol=1e-10)
    assert dense.slip_energy == pytest.approx(modal.slip_energy, rel=1e-9)
    np.testing.assert_allclose(dense["d_speed"], modal["d_speed"], atol=1e-10)


def test_phi_functions_against_mpmath():
    import mpmath

    z = np.array([0.0, 1e-8, 0.3j, -0.9, 0.999 + 0.04j, -1.2, 4.9j, -5.5 + 3j, -300.0, 200j])
    for order in (3, 9):
        phi = flow.phi_functions(z, order)
        for k in range(order + 1):
            for value, point in zip(phi[k], z, strict=True):
                # phi_k is Kummer's function 1F1(1; k + 1; z) / k!
                with mpmath.workdps(40):
                    exact = complex(mpmath.hyp1f1(1, k + 1, mpmath.mpc(complex(point))) / mpmath.factorial(k))
                assert abs(value - exact) <= 5e-13 * max(abs(exact), 1e-3)


# --- earlier runs

# Written down before clutches became one kind of law among others. Event: time, element, mode, heat so far.
EARLIER = json.loads((Path(__file__).parent / "reference" / "clutch_runs.json").read_text())
AGAIN = {
    "launch": lambda t: pt.launch(pt.examples.conventional(damping="open"), timepts=t),
    "launch, closed damping": lambda t: pt.launch(pt.examples.conventional(), timepts=t),
    "stress": lambda t: pt.launch(damped_by_shaft(), duration=0.1, timepts=t),
    "coupled clutches": coupled_clutches,
}


@pytest.mark.parametrize("name", EARLIER)
def test_runs_are_what_they_were_when_friction_was_the_only_law(name):
    earlier, again = EARLIER[name], AGAIN[name](np.array(EARLIER[name]["time"]))
    assert [[e.element, e.mode] for e in again.events] == [event[1:3] for event in earlier["events"]]
    for event, (time, _, _, heat) in zip(again.events, earlier["events"], strict=True):
        assert event.time == pytest.approx(time, rel=0, abs=1e-12)
        assert event.heat == pytest.approx(heat, rel=1e-12)
    assert again.slip_energy == pytest.approx(earlier["slip_energy"], rel=1e-12)
    for signal, values in earlier["signals"].items():
        np.testing.assert_allclose(again[signal], values, rtol=0, atol=1e-12 * np.abs(values).max(), err_msg=signal)
