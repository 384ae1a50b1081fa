"""The exact core on random drivelines: the laws of dry friction, momentum and energy; cases that rounding makes delicate.

Of hybrid/motion, hybrid/run, hybrid/continuous.
"""

from itertools import pairwise

import control
import numpy as np
import pytest
import scipy.integrate
import scipy.optimize
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.continuous import friction_torque
from powertrain_ctrl.hybrid.signals import PiecewiseLinear

END = 2.0


def bodies(names, J=1.0):
    return [pt.Inertia(name, J=J) for name in names]


def modes_over_time(response):
    return [(e.element, e.mode) for e in response.events]


# --- random drivelines


def signals(scale, lowest):
    """Ramps and jumps, with zeros and even values often enough that events coincide."""
    value = st.one_of(st.floats(lowest, 1.0).map(lambda v: round(v, 6)), st.sampled_from([0.0, 0.5, 1.0])).map(
        lambda v: scale * v
    )
    time = st.one_of(st.floats(0.0, END).map(lambda t: round(t, 6)), st.sampled_from([0.0, 0.5, 1.0, 1.5]))

    def build(times, values):
        return PiecewiseLinear(tuple(sorted(times)), tuple(values))

    pairs = st.integers(1, 5).flatmap(
        lambda n: st.tuples(*(st.lists(s, min_size=n, max_size=n) for s in (time, value)))
    )
    return pairs.map(lambda pair: build(*pair))


@st.composite
def runs(draw, redundant=True):
    """A driveline of 2 to 5 bodies with 1 to 3 clutches and brakes, inputs, initial speeds."""
    count, wanted = draw(st.integers(2, 5)), draw(st.integers(1, 3))
    elements = [pt.Inertia(f"J{i}", J=draw(st.sampled_from([0.05, 0.5, 1.0, 2.0, 8.0]))) for i in range(count)]
    clutches = []

    def clutch(*ends):
        name = f"c{len(clutches)}"
        ratio = draw(st.sampled_from([1.0, 1.0, 1.2]))
        clutches.append(pt.Clutch(name, *ends, max_torque=draw(st.floats(0.5, 10.0)), static_ratio=ratio))

    for i in range(1, count):
        start = f"J{draw(st.integers(0, i - 1))}"
        if draw(st.integers(0, 3)) == 0:
            elements.append(pt.Gear(f"g{i}", start, f"n{i}", ratio=draw(st.sampled_from([-2.0, 0.5, 3.0]))))
            start = f"n{i}"
        if len(clutches) < wanted and draw(st.booleans()):
            clutch(start, f"J{i}")
        else:
            stiffness, damping = draw(st.floats(10.0, 2e4)), draw(st.sampled_from([0.0, 0.3, 3.0]))
            elements.append(pt.SpringDamper(f"s{i}", start, f"J{i}", stiffness=stiffness, damping=damping))
    while len(clutches) < wanted and (redundant or not clutches):
        clutch(f"J{draw(st.integers(0, count - 1))}")
    inputs = {f"J{i}_torque": draw(signals(20.0, -1.0)) for i in range(count) if draw(st.booleans())}
    inputs |= {f"{c.name}_capacity": draw(signals(15.0, 0.0)) for c in clutches if draw(st.booleans())}
    speed = {f"J{i}": draw(st.sampled_from([-3.0, 0.0, 1.0, 4.7])) for i in range(count) if draw(st.booleans())}
    return pt.Driveline(*elements, *clutches), inputs, speed


def quadrature(edges, fastest):
    """Gauss-Legendre nodes and weights on pieces that resolve the fastest mode."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    grid = np.concatenate(
        [np.linspace(a, b, int((b - a) * fastest) + 2)[:-1] for a, b in pairwise(edges)] + [edges[-1:]]
    )
    middle, half = 0.5 * (grid[1:] + grid[:-1]), 0.5 * np.diff(grid)
    t, area = (middle[:, None] + half[:, None] * nodes).ravel(), (half[:, None] * weights).ravel()
    kept = np.concatenate([[t[0] > 0.0], np.diff(t) > 0.0]) & (t < END)
    return t[kept], area[kept]


@given(runs())
@settings(max_examples=60)
def test_motion_obeys_coulomb_newton_and_the_first_law(case):
    car, inputs, speed = case
    response = pt.simulate(car, np.array([0.0, END]), inputs, speed)
    m = pt.assemble(car.release())
    corners = {t for s in inputs.values() for t in s.times if 0.0 < t < END}
    edges = np.array(sorted({0.0, END, *corners, *(e.time for e in response.events)}))
    coupling = np.linalg.solve(m.M, m.K)
    fastest = np.sqrt(np.abs(np.linalg.eigvals(coupling)).max()) + np.abs(np.linalg.solve(m.M, m.D)).max()
    assume(len(edges) * 2 + fastest * END < 4000)
    t, area = quadrature(edges, fastest)
    fine = pt.simulate(car, np.concatenate([[0.0], t, [END]]), inputs, speed)
    assert modes_over_time(fine) == modes_over_time(response)

    def at(name):
        return fine[name][1:-1]

    size = 1.0 + max(np.abs(fine[f"{node}_speed"]).max() for node in m.nodes)
    for clutch in m.clutches:
        capacity, torque, mode, slip = (at(f"{clutch.name}_{x}") for x in ("capacity", "torque", "mode", "slip_speed"))
        assert (np.abs(torque) <= np.where(mode == 0, clutch.static_ratio, 1.0) * capacity + 1e-8).all()
        sliding = np.abs(mode) == 1
        np.testing.assert_allclose(torque[sliding], mode[sliding] * capacity[sliding], atol=1e-9)
        assert (mode[sliding] * slip[sliding] >= -1e-9 * size).all()
        assert (np.abs(slip[mode == 0]) <= 1e-9 * size).all()
        assert (np.abs(capacity[mode == 2]) <= 1e-12).all()
    # momentum: impulse of all torques on each coordinate
    u = np.array([at(name) for name in m.inputs])
    springs = np.array([at(f"{name}_torque") for name in m.compliances]).reshape(len(m.compliances), len(t))
    tau = np.array([at(f"{row.name}_torque") for row in m.clutches])
    load = m.T.T @ (m.B @ u - m.E.T @ springs - m.S.T @ tau)
    z = np.array([fine[f"{name}_speed"] for name in m.coordinates])
    np.testing.assert_allclose(m.M @ (z[:, -1] - z[:, 0]), load @ area, atol=1e-9 * (1.0 + np.abs(load) @ area).max())
    # energy
    work = sum(area @ (at(name) * at(name.replace("_torque", "_speed"))) for name in m.inputs)
    lost = 0.0
    stored = 0.5 * np.einsum("it,ij,jt->t", z[:, [0, -1]], m.M, z[:, [0, -1]])
    for i, name in enumerate(m.compliances):
        twist = fine[f"{name}_twist"]
        stored = stored + 0.5 * m.stiffness[i] * twist[[0, -1]] ** 2
        if m.damping[i]:
            lost += area @ ((at(f"{name}_torque") - m.stiffness[i] * twist[1:-1]) ** 2 / m.damping[i])
    heat = sum(fine.slip_energy.values())
    assert work == pytest.approx(
        stored[1] - stored[0] + lost + heat, abs=1e-9 * (1.0 + abs(work) + lost + heat + stored.max())
    )


@given(runs())
@settings(max_examples=25)
def test_discrete_system_equals_the_core_on_random_drivelines(case):
    car, inputs, speed = case
    t = np.arange(0, 41) * 0.05
    system = pt.nonlinear_system(car, dt=0.05)
    given_inputs = {f"{name}_capacity": car[name].max_torque for name in car.clutches} | inputs
    u = np.zeros((system.ninputs, len(t)))
    for name, signal in given_inputs.items():
        u[system.find_input(name)] = signal(t) if callable(signal) else signal
    response = control.input_output_response(system, t, u, pt.initial_state(system, car, speed))
    exact = pt.simulate(car, t, dict(zip(system.input_labels, u, strict=True)), speed)
    for name in exact.outputs:
        if name.endswith("_speed"):
            np.testing.assert_allclose(response.outputs[system.find_output(name)], exact[name], atol=1e-8)


@given(runs(), st.floats(0.01, 1.99))
@settings(max_examples=25)
def test_random_runs_may_be_split_anywhere_even_at_an_event(case, anywhere):
    car, inputs, speed = case
    whole = pt.simulate(car, np.array([0.0, END]), inputs, speed)
    for split in (anywhere, *(e.time for e in whole.events[:2] if 0.0 < e.time < END)):
        head = pt.simulate(car, np.array([0.0, split]), inputs, speed)
        tail = pt.simulate(car, np.array([split, END]), inputs, initial_state=head.final)
        assert modes_over_time(head) + modes_over_time(tail) == modes_over_time(whole)
        for node in car.nodes:
            assert tail[f"{node}_speed"][-1] == pytest.approx(whole[f"{node}_speed"][-1], abs=1e-9)


def torque_of_least_work(W, a, capacity):
    """Friction at zero slip as a bounded least-squares problem, an independent road to the complementarity solution."""
    L = np.linalg.cholesky(W)
    width = np.maximum(capacity, 1e-12)
    solution = scipy.optimize.lsq_linear(L.T * width, np.linalg.solve(L, a), (-1.0, 1.0), method="bvls", tol=1e-15)
    return solution.x * width


@given(st.integers(0, 10**6))
@settings(max_examples=150)
def test_torque_of_the_continuous_system_solves_its_complementarity_problem(seed):
    random = np.random.default_rng(seed)
    m = int(random.integers(1, 5))
    # every other time clutches that depend on each other
    S = np.round(random.normal(size=(m, int(random.integers(1, m + 2)))) * 2.0) + np.eye(m, 1)
    W, b = S @ S.T, S @ random.normal(size=S.shape[1])
    assume((np.diag(W) > 0.0).all())
    capacity = random.uniform(0.0, 1.0, m) * (random.random(m) < 0.8)
    torque = friction_torque(W, b, capacity)
    assert (np.abs(torque) <= capacity * (1.0 + 1e-12)).all()
    # the slip acceleration b - W tau is zero inside the capacity and pushes outwards at it
    slip_rate = b - W @ torque
    np.testing.assert_allclose(torque, np.clip(torque + slip_rate, -capacity, capacity), atol=1e-9)


# --- against an event-located solver


def chain():
    return pt.Driveline(
        *(pt.Inertia(name, J=J) for name, J in (("a", 0.4), ("b", 0.2), ("c", 0.3), ("d", 1.5))),
        pt.Clutch("ab", "a", "b", max_torque=9.0),
        pt.SpringDamper("s", "b", "c", stiffness=300.0, damping=0.2),
        pt.Clutch("cd", "c", "d", max_torque=6.0),
    )


def by_dop853(car, inputs, speed, end):
    """Final coordinate speeds and event times: DOP853 at 1e-11, modes from the bounded least-squares problem."""
    m = pt.assemble(car.release())
    r = len(m.compliances)
    Mi = np.linalg.inv(m.M)
    S = m.S @ m.T
    capacity = np.array([row.max_torque for row in m.clutches])
    W = S @ Mi @ S.T

    def free(t, x):
        u = np.array([float(inputs[name](t)) if name in inputs else 0.0 for name in m.inputs])
        return Mi @ (m.T.T @ m.B @ u - m.F.T @ (m.stiffness * x[:r]) - m.D @ x[r:])

    def torque(t, x, modes):
        tau = modes * capacity
        stuck = modes == 0
        if stuck.any():
            tau[stuck] = np.linalg.solve(W[np.ix_(stuck, stuck)], (S @ free(t, x) - W @ tau)[stuck])
        return tau

    def rate(t, x, modes):
        return np.concatenate([m.F @ x[r:], free(t, x) - Mi @ S.T @ torque(t, x, modes)])

    def choose(t, x):
        slip = S @ x[r:]
        modes = np.where(np.abs(slip) > 1e-7, np.sign(slip), 0.0)
        near = np.flatnonzero(modes == 0)
        if near.size:
            held = np.ix_(near, near)
            x = x.copy()
            x[r:] -= Mi @ S[near].T @ np.linalg.solve(W[held], slip[near])
            # just behind the event, so that a torque that reaches its limit has left it
            a = (S @ free(t + 1e-7, x) - W @ (modes * capacity))[near]
            tau = torque_of_least_work(W[held], a, capacity[near])
            modes[near] = np.where(np.abs(tau) >= capacity[near] * (1 - 1e-9), np.sign(tau), 0.0)
        return modes, x

    x = np.concatenate([np.zeros(r), [speed.get(name, 0.0) for name in m.coordinates]])
    corners = sorted({end, *(c for s in inputs.values() for c in s.times if 0.0 < c < end)})
    t, found = 0.0, []
    modes, x = choose(0.0, x)
    while t < end - 1e-12:
        stop = next(c for c in corners if c > t + 1e-12)
        events = []
        for i in range(len(capacity)):
            for side in (1, -1) if modes[i] == 0 else (int(modes[i]),):

                def margin(t, x, i=i, side=side, modes=modes):
                    return (
                        capacity[i] - side * torque(t, x, modes)[i] if modes[i] == 0 else side * (S[i] @ x[r:]) + 1e-13
                    )

                margin.terminal, margin.direction = True, -1.0
                events.append(margin)
        solution = scipy.integrate.solve_ivp(
            lambda t, x, modes=modes: rate(t, x, modes),
            (t, stop),
            x,
            "DOP853",
            rtol=1e-11,
            atol=1e-13,
            max_step=5e-3,
            events=events,
        )
        t, x = float(solution.t[-1]), solution.y[:, -1]
        new, x = choose(t, x)
        if (new != modes).any():
            found.append((t, tuple(new)))
        modes = new
    return x[r:], found


@pytest.mark.parametrize("torque", [pt.ramp(0.3, 0.5, 14.0) + pt.step(1.3, -26.0), pt.ramp(0.9, 0.6, -17.0)])
def test_two_clutches_with_a_spring_between_move_as_an_event_located_solver_finds(torque):
    inputs, speed = {"a_torque": torque, "d_torque": pt.step(0.7, -4.0)}, {"a": 6.0, "c": -2.0}
    response = pt.simulate(chain(), np.array([0.0, END]), inputs, {**speed, "b": 0.0, "d": 0.0})
    z, found = by_dop853(chain(), inputs, speed, END)
    assert len(found) >= 4
    sequence, modes = [], {"ab": 1, "cd": -1}
    for event in (e for e in response.events if e.time > 0.0):
        modes[event.element] = event.mode
        if sequence and sequence[-1][0] == event.time:
            sequence.pop()
        sequence.append((event.time, tuple(modes.values())))
    assert [m for _, m in sequence] == [m for _, m in found]
    np.testing.assert_allclose([t for t, _ in sequence], [t for t, _ in found], atol=1e-6)
    np.testing.assert_allclose([response[f"{name}_speed"][-1] for name in "abcd"], z, atol=1e-6)


# --- delicate cases


def test_the_last_sample_is_the_final_state():
    # durations between these corners, added up one by one, miss the end by rounding
    corners = [0.13360539877759525, 1.355737704725066, 2.0826505216694824, 2.135566527950503, 2.1524582044450318]
    corners += [2.2295585778047373, 2.2718570453758624, 2.424130945790173, 2.445995132493605, 2.92509989276127]
    time = 0.0
    for a, b in pairwise([0.0, *corners, 3.0]):
        time += b - a
    assert time < 3.0
    car = pt.Driveline(*bodies("ab"), pt.Clutch("clutch", "a", "b", max_torque=0.3))
    inputs = {"a_torque": sum((pt.step(t, 0.1) for t in corners), pt.step(0.0, 1.2))}
    response = pt.simulate(car, np.linspace(0.0, 3.0, 7), inputs)
    assert response["a_torque"][-1] == pytest.approx(2.2)
    assert response["a_speed"][-1] == pytest.approx(response.final.speed["a"], rel=1e-14)
    assert response["a_speed"][-1] > 0.0


@pytest.mark.parametrize("slope", [0.0, -0.5])
def test_a_jump_of_capacity_frees_a_stuck_clutch_even_if_its_load_does_not_grow(slope):
    # torque 4 + slope (t - 1) on one of two equal bodies: the clutch carries half of it, from 1 s on it can carry 1
    car = pt.Driveline(*bodies("ab"), pt.Clutch("clutch", "a", "b", max_torque=5.0))
    inputs = {"a_torque": pt.ramp(1.0, 2.0, 4.0 + 2.0 * slope, 4.0), "clutch_capacity": pt.step(1.0, 1.0, 5.0)}
    response = pt.simulate(car, np.linspace(0.0, 2.0, 21), inputs)
    assert [(e.time, e.mode) for e in response.events] == [(1.0, 1)]
    assert response["clutch_slip_speed"][-1] == pytest.approx((4.0 - 2.0) + 0.5 * slope, abs=1e-12)


def test_a_jump_of_torque_frees_a_stuck_clutch():
    car = pt.Driveline(*bodies("ab"), pt.Clutch("clutch", "a", "b", max_torque=1.0))
    response = pt.simulate(car, np.linspace(0.0, 2.0, 21), {"a_torque": pt.step(1.0, 3.0)})
    assert [(e.time, e.mode) for e in response.events] == [(1.0, 1)]
    assert response["clutch_slip_speed"][-1] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("first", [10.0, 4.0])
def test_two_brakes_on_one_shaft_hold_the_sum_of_their_capacities(first):
    brakes = [pt.Clutch("service", "a", max_torque=first), pt.Clutch("parking", "a", max_torque=1.0)]
    car = pt.Driveline(*bodies("a", J=2.0), *brakes)
    total = first + 1.0
    response = pt.simulate(car, np.linspace(0.0, 1.0, 101), {"a_torque": pt.ramp(0.0, 1.0, 2.0 * total)})
    t = response.time
    assert np.abs(response["a_speed"][t <= 0.5]).max() < 1e-12
    # 2 w' = 2 total t - total from half time on
    np.testing.assert_allclose(response["a_speed"], 0.5 * total * np.maximum(t - 0.5, 0.0) ** 2, atol=1e-9)
    for brake in brakes:
        assert np.abs(response[f"{brake.name}_torque"]).max() <= brake.max_torque + 1e-12
    assert response.slip_energy["service"] == pytest.approx(first * total * 0.5**3 / 6.0, rel=1e-8)


def test_two_brakes_bring_a_shaft_to_rest_together():
    brakes = [pt.Clutch(f"b{i}", "a", max_torque=capacity) for i, capacity in enumerate((0.3, 1.7))]
    response = pt.simulate(pt.Driveline(*bodies("a"), *brakes), np.linspace(0.0, 3.0, 31), {}, {"a": 4.0})
    assert [(e.time, e.mode) for e in response.events] == [(pytest.approx(2.0, abs=1e-9), 0)] * 2
    assert response["a_speed"][-1] == 0.0


@pytest.mark.parametrize("again", [0.0, 6.0])
def test_capacity_that_falls_to_zero_under_no_load_only_releases(again):
    # stuck without load; capacity goes to zero at an odd time, and stays there or comes back
    capacity = pt.ramp(0.3, 1.7 / 3.0, 0.0, 7.0) + pt.ramp(0.3 + 1.7 / 3.0, 1.0, again)
    car = pt.Driveline(*bodies("ab"), pt.Clutch("clutch", "a", "b", max_torque=0.0))
    response = pt.simulate(car, np.linspace(0.0, 2.5, 26), {"clutch_capacity": capacity}, {"a": 1.0, "b": 1.0})
    assert len(response.events) <= 3
    np.testing.assert_allclose(response["clutch_slip_speed"], 0.0, atol=1e-12)
    if not again:
        assert response["clutch_mode"][-1] == 2


def test_a_clutch_without_springs_breaks_when_its_falling_capacity_meets_the_load():
    # the load is 0.2906..., a share that no rounding hits; capacity falls by 17.5 N m/s
    J, load, start, slope = (1.0, 2.0), 0.8719335753, 2.446755155927382, 17.53123649
    car = pt.Driveline(pt.Inertia("a", J=J[0]), pt.Inertia("b", J=J[1]), pt.Clutch("clutch", "a", "b", max_torque=0.0))
    duration = 5.338814797318041 / slope
    inputs = {"b_torque": load, "clutch_capacity": pt.ramp(start, duration, 0.0, slope * duration)}
    response = pt.simulate(car, np.array([0.0, start + duration]), inputs)
    carried = load * J[0] / (J[0] + J[1])
    breaks = start + duration - carried / slope
    assert [(e.time, e.mode) for e in response.events] == [(pytest.approx(breaks, abs=1e-9), -1)]
    # behind it slip' = -load / 2 + (1 + 1/2) capacity, that is -1.5 slope (t - t_break)
    assert response["clutch_slip_speed"][-1] == pytest.approx(-0.75 * slope * (carried / slope) ** 2, abs=1e-12)
