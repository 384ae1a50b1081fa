"""Nodes without inertia: condensed where springs hold them, first-order states where dampers do; and open differentials.

Of elements/differentials, linear/condensing, linear/energy, linear/steady.
"""

import os
import random

import control
import mpmath as mp
import numpy as np
import pytest
import scipy.linalg
from exact import Exact, massless

import powertrain_ctrl as pt

# More of them for a campaign: POWERTRAIN_CASES=300
CASES = int(os.environ.get("POWERTRAIN_CASES", 15))
# exponents of inertia, stiffness, damping: no node that relaxes within less than 0.1 us
MODERATE = ((-2, 1), (3, 5), (0, 2))


def ev(damping=0.0, tyre_damping=0.0):
    """Electric drive with an open differential and unequal half-shafts on side gears without inertia."""
    return pt.Driveline(
        pt.Inertia("motor", J=0.05),
        pt.Gear("reduction", "motor", "carrier", ratio=9.0),
        pt.Differential("differential", "carrier", "left", "right"),
        pt.SpringDamper("left_shaft", "left", "left_wheel", stiffness=6500.0, damping=6.5 * damping),
        pt.SpringDamper("right_shaft", "right", "right_wheel", stiffness=8500.0, damping=8.5 * damping),
        *(pt.Inertia(f"{side}_wheel", J=1.2) for side in ("left", "right")),
        *(
            pt.Tyre(f"{side}_tyre", f"{side}_wheel", "vehicle", radius=0.32, stiffness=4e5, damping=tyre_damping)
            for side in ("left", "right")
        ),
        pt.Mass("vehicle", m=1700.0),
    )


def ev_in_one_row(damping=0.0, tyre_damping=0.0):
    """The same with both half-shafts as one row: their torques are equal, so that the flexibilities of its twist add up."""
    k = 6500.0 * 8500.0 / (6500.0 + 8500.0)
    row = {"carrier": 2.0, "left_wheel": -1.0, "right_wheel": -1.0}
    names = ("differential", "left_shaft", "right_shaft")
    rest = [e for e in ev(damping, tyre_damping) if e.name not in names]
    return pt.Driveline(*rest, pt.Compliance("half_shafts", row, stiffness=k, damping=1e-3 * k * damping))


def split(car, name, ratio, share):
    """A spring between two nodes as two in series without inertia between them, behind a gear and its reverse."""
    spring = car[name]
    k, d = spring.stiffness, spring.damping
    first, second = 1.0 / share, 1.0 / (1.0 - share)
    parts = [
        pt.SpringDamper(f"{name}_1", spring.a, "middle", stiffness=first * k, damping=first * d),
        pt.Gear("there", "middle", "geared", ratio=ratio),
        pt.Gear("back", "geared", "behind", ratio=1.0 / ratio),
        pt.SpringDamper(f"{name}_2", "behind", spring.b, stiffness=second * k, damping=second * d),
    ]
    return pt.Driveline(*(e for e in car if e.name != name), *parts)


def scaled_solve(matrix, right):
    """Solution with rows and columns brought to like size, so that rounding goes by each and not by the largest."""
    rows = columns = np.ones(len(matrix))
    for _ in range(8):
        size = np.abs(rows[:, None] * matrix * columns)
        rows, columns = rows / np.sqrt(size.max(axis=1)), columns / np.sqrt(size.max(axis=0))
    return columns[:, None] * np.linalg.solve(rows[:, None] * matrix * columns, rows[:, None] * right)


# --- closed forms -----------------------------------------------------------------------------------------------------


def test_an_open_differential_with_unequal_half_shafts_has_the_frequencies_of_their_row():
    """Those that small inertias of the side gears approach."""
    assert pt.modes(ev()).frequency_hz == pytest.approx([0.0, 8.89140, 29.40421, 32.32829], abs=6e-6)
    assert pt.modes(ev()).frequency_hz == pytest.approx(pt.modes(ev_in_one_row()).frequency_hz, rel=1e-12)


def test_both_sides_of_an_open_differential_carry_half_the_torque():
    car = ev(damping=1.0, tyre_damping=1000.0)
    gain = pt.static_gain(car, "motor_torque", ["left_shaft_torque", "right_shaft_torque", "vehicle_acceleration"])
    # at the wheels: 9 N m of torque, and inertia of the motor, the wheels and the vehicle
    acceleration = 9.0 / (81.0 * 0.05 + 2 * 1.2 + 1700.0 * 0.32**2)
    carried = (9.0 - 81.0 * 0.05 * acceleration) / 2.0
    assert gain[:, 0] == pytest.approx([carried, carried, 0.32 * acceleration], rel=1e-12)


def test_springs_on_either_side_of_a_gear_are_in_series():
    """k1 and k2 behind ratio i: seen from a, 1 / k = 1 / k1 + i^2 / k2."""
    car = pt.Driveline(
        pt.Inertia("a", J=0.2),
        pt.SpringDamper("first", "a", "pinion", stiffness=3e4),
        pt.Gear("gear", "pinion", "wheel", ratio=3.0),
        pt.SpringDamper("second", "wheel", "b", stiffness=9e4),
        pt.Inertia("b", J=1.8),
    )
    k, J = 1.0 / (1.0 / 3e4 + 9.0 / 9e4), 1.0 / (1.0 / 0.2 + 9.0 / 1.8)
    assert pt.modes(car).omega == pytest.approx([0.0, np.sqrt(k / J)], rel=1e-13)
    assert pt.state_space(car, "a_torque", "b_speed").nstates == 3


def held(*elements):
    return pt.Driveline(pt.Inertia("body", J=2.0), *elements)


@pytest.mark.parametrize(
    ("car", "polynomial"),
    [
        # Maxwell: torque k d s / (k + d s) per speed; s (J s^2 (k + d s) + k d s) = 0, once without the rigid motion
        (
            held(pt.SpringDamper("k", "body", "x", stiffness=50.0), pt.Drag("d", "x", damping=4.0)),
            [2.0 * 4.0, 2.0 * 50.0, 50.0 * 4.0],
        ),
        # Zener: a spring k0 beside a spring and a damper in series
        (
            held(
                pt.Drag("k0", "body", damping=0.0, stiffness=30.0),
                pt.SpringDamper("k", "body", "x", stiffness=50.0),
                pt.Drag("d", "x", damping=4.0),
            ),
            [2.0 * 4.0, 2.0 * 50.0, (50.0 + 30.0) * 4.0, 30.0 * 50.0],
        ),
        # two dampers in series are one
        (
            held(
                pt.SpringDamper("d1", "body", "x", stiffness=0.0, damping=3.0),
                pt.Drag("d2", "x", damping=6.0),
                pt.Drag("k0", "body", damping=0.0, stiffness=30.0),
            ),
            [2.0, 2.0, 30.0],
        ),
    ],
)
def test_springs_and_dampers_in_series_have_the_poles_of_their_polynomial(car, polynomial):
    by_size = pt.poles(car)
    assert np.sort_complex(by_size) == pytest.approx(np.sort_complex(np.roots(polynomial)), rel=1e-12)
    G = pt.state_space(car, "body_torque", "body_speed")
    assert np.sort_complex(G.poles()) == pytest.approx(np.sort_complex(by_size), rel=1e-10)


def test_modes_are_those_to_which_a_driveline_comes_as_its_dampers_fade():
    """A damper in series with a spring lets it go: only k0 is left; in parallel it changes nothing."""
    zener = held(
        pt.Drag("k0", "body", damping=0.0, stiffness=30.0),
        pt.SpringDamper("k", "body", "x", stiffness=50.0),
        pt.Drag("d", "x", damping=4.0),
    )
    assert pt.modes(zener).omega == pytest.approx([np.sqrt(30.0 / 2.0)])
    both = held(
        pt.SpringDamper("k", "body", "x", stiffness=50.0, damping=1.0), pt.Drag("k2", "x", damping=4.0, stiffness=50.0)
    )
    assert pt.modes(both).omega == pytest.approx([np.sqrt(25.0 / 2.0)])
    slow = [both.replace("k", damping=x * 1.0).replace("k2", damping=x * 4.0) for x in (1e-4, 1e-5)]
    errors = [abs(np.abs(pt.poles(car).imag).max() - np.sqrt(12.5)) for car in slow]
    assert errors[1] < 0.02 * errors[0]


def test_a_torque_at_a_condensed_node_twists_its_springs_at_once():
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.SpringDamper("left", "a", "flange", stiffness=100.0),
        pt.SpringDamper("right", "flange", "b", stiffness=300.0),
        pt.Inertia("b", J=1.0),
    )
    G = pt.state_space(car, "flange_torque", ["left_twist", "right_twist", "left_torque", "a_acceleration"])
    # both ends at rest: the flange moves by 1 / 400, against the left spring and with the right one
    assert G.D[:, 0] == pytest.approx([-1.0 / 400.0, 1.0 / 400.0, -0.25, 0.25], rel=1e-13)
    response = pt.simulate(car, [0.0, 1e-9], {"flange_torque": 8.0})
    assert response["right_twist"] == pytest.approx([0.02, 0.02], rel=1e-9)
    assert response["b_acceleration"] == pytest.approx([6.0, 6.0], rel=1e-9)


# --- random drivelines ------------------------------------------------------------------------------------------------


@pytest.fixture
def digits():
    with mp.workdps(200):
        yield


@pytest.mark.usefixtures("digits")
def test_poles_are_roots_of_the_determinant_and_none_is_missing():
    for seed in range(CASES):
        car = massless(seed)
        M, D, K = Exact(car).matrices()

        def det(s, M=M, D=D, K=K):
            return mp.det(s**2 * M + s * D + K)

        poles = pt.poles(car)
        moving, large = poles[poles != 0.0], mp.mpf(10) ** 30
        highest, lowest = (round(float(mp.log(abs(det(x**2) / det(x))) / mp.log(x))) for x in (large, 1 / large))
        assert len(moving) == highest - lowest, seed
        step = mp.mpf(10) ** -60
        for pole in moving[moving.imag >= 0.0]:
            s = mp.mpc(pole.real, pole.imag)
            value, ahead = det(s), det(s * (1 + step))
            assert value == 0 or abs(value / (ahead - value) * step) < 1e-9, (seed, pole)


@pytest.mark.parametrize("car", [ev(1.0, 1000.0), ev(0.0, 1000.0), *(massless(seed, MODERATE) for seed in range(5))])
def test_poles_are_those_of_the_descriptor_form(car):
    """``E x' = A x`` of angles, speeds and multipliers, whose eigenvalues are infinite where nothing moves by itself."""
    exact = Exact(car)
    n, m = len(exact.nodes), len(exact.constraints)
    E, A = np.zeros((2, 2 * n + m, 2 * n + m))
    E[:n, :n], E[n : 2 * n, n : 2 * n] = np.eye(n), np.array(exact.J.tolist(), dtype=float)
    A[:n, n : 2 * n] = np.eye(n)
    for _, row, k, d in exact.twists:
        for i, x in row.items():
            for j, y in row.items():
                A[n + i, j] -= float(k * x * y)
                A[n + i, n + j] -= float(d * x * y)
    for p, (_, row) in enumerate(exact.constraints):
        for i, x in row.items():
            A[n + i, 2 * n + p] = A[2 * n + p, n + i] = float(x)
    alpha, beta = scipy.linalg.eig(A, E, right=False, homogeneous_eigvals=True)
    found = alpha[beta != 0.0] / beta[beta != 0.0]
    for pole in pt.poles(car):
        if pole:
            assert np.abs(found - pole).min() <= 1e-9 * abs(pole), pole


@pytest.mark.usefixtures("digits")
def test_responses_and_static_gains_are_those_of_the_elements():
    for seed in range(CASES):
        car, rng = massless(seed), random.Random(seed)
        model, exact = pt.assemble(car), Exact(car)
        light = [name for name in model.inputs if name.rpartition("_")[0] in model.following.names]
        inputs = list(dict.fromkeys([rng.choice(light), rng.choice(model.inputs)]))
        # open clutches are not in the exact model
        known = [
            name
            for name in pt.state_space(car, inputs).output_labels
            if not name.endswith("_slip_speed") and name.removesuffix("_torque") not in car.released
        ]
        outputs = [*rng.sample(known, min(6, len(known))), f"{rng.choice(car.nodes)}_angle"]
        G, gain = pt.state_space(car, inputs, outputs), pt.static_gain(car, inputs, outputs)
        for j, load in enumerate(inputs):
            node = load.rpartition("_")[0]
            steady = exact.response(mp.mpf(10) ** -70, node)
            responses = {omega: exact.response(mp.mpc(0, omega), node) for omega in (0.003, 1.7, 90.0, 4e3)}
            for omega, response in responses.items():
                states = (
                    scaled_solve(1j * omega * np.eye(G.nstates) - G.A, G.B[:, [j]]) if G.nstates else np.zeros((0, 1))
                )
                values, terms = (
                    (G.C @ states)[:, 0] + G.D[:, j],
                    (np.abs(G.C) @ np.abs(states))[:, 0] + np.abs(G.D[:, j]),
                )
                for name, value, size in zip(outputs, values, terms, strict=True):
                    kind = name.rpartition("_")[2]
                    largest = max(abs(v) for r in responses.values() for k, v in r.items() if k.endswith(kind))
                    error = abs(mp.mpc(complex(value)) - response[name])
                    # size: an acceleration of a node that relaxes at once is a difference of large terms
                    bound = 1e-9 * (abs(response[name]) + 0.1 * largest) + 1e-14 * size
                    assert error <= (bound if largest > mp.mpf(10) ** -150 else 1e-15), (seed, omega, load, name)
            for i, name in enumerate(outputs):
                if abs(steady[name]) > mp.mpf(10) ** 40:
                    assert gain[i, j] == np.inf, (seed, load, name)
                    continue
                alike = [abs(v) for k, v in steady.items() if k.endswith(name.rpartition("_")[2]) and abs(v) < 1e40]
                error = abs(gain[i, j] - steady[name])
                assert error <= 1e-9 * abs(steady[name]) + 1e-11 * max(alike) + 1e-15, (seed, load, name)


def sampled_exactly(G, timepts, u):
    """Outputs under inputs linear between the samples, by the exponential of the system with its inputs."""
    n, m, dt = G.nstates, G.ninputs, timepts[1] - timepts[0]
    system = np.zeros((n + 2 * m, n + 2 * m))
    system[:n, :n], system[:n, n : n + m], system[n : n + m, n + m :] = G.A, G.B, np.eye(m)
    step, x, y = scipy.linalg.expm(system * dt), np.zeros(n), [G.D @ u[:, 0]]
    for now, then in zip(u.T[:-1], u.T[1:], strict=True):
        x = (step @ np.concatenate([x, now, (then - now) / dt]))[:n]
        y.append(G.C @ x + G.D @ then)
    return np.array(y).T


def test_a_simulation_is_the_exponential_of_the_state_space():
    """With open and with stuck clutches elsewhere; capacities that hold whatever comes."""
    timepts, simulated = np.linspace(0.0, 0.4, 9), 0
    for seed in range(2 * CASES):
        car, rng = massless(seed, MODERATE), random.Random(seed)
        model = pt.assemble(car)
        light = [name for name in model.inputs if name.rpartition("_")[0] in model.following.names]
        names = list(dict.fromkeys([rng.choice(light), rng.choice(model.inputs)]))
        loads = {name: pt.ramp(0.1, 0.1, rng.choice([1.0, -2.0])) for name in names}
        capacities = {f"{name}_capacity": 0.0 if name in car.released else 1e9 for name in car.clutches}
        try:
            response = pt.simulate(car, timepts, loads | capacities)
        except pt.TopologyError:  # a clutch at a node without inertia
            continue
        simulated += 1
        known = [name for name in pt.state_space(car, names).output_labels if name in response.outputs]
        G = pt.state_space(car, names, known)
        y = sampled_exactly(G, timepts, np.array([[float(loads[name](t)) for t in timepts] for name in names]))
        # what rounding leaves of outputs that are differences of large terms: accelerations of nodes that relax at once
        states = control.ss(G.A, G.B, np.eye(G.nstates), np.zeros((G.nstates, G.ninputs)))
        x = sampled_exactly(states, timepts, np.array([[float(loads[name](t)) for t in timepts] for name in names]))
        terms = (np.abs(G.C) @ np.abs(x)).max(axis=1)
        for name, wanted, size in zip(known, y, terms, strict=True):
            alike = [i for i, other in enumerate(known) if other.endswith(name.rpartition("_")[2])]
            error = np.abs(response[name] - wanted).max()
            assert error <= 1e-9 * (np.abs(wanted).max() + 0.1 * np.abs(y[alike]).max()) + 1e-13 * size + 1e-15, (
                seed,
                name,
            )
    assert simulated > CASES


# --- the same driveline with and without the node ---------------------------------------------------------------------


def test_a_launch_is_that_of_the_merged_spring():
    """Dampers in proportion to their springs: the node follows them both, and what is left of it is in no other motion."""
    car = pt.examples.conventional(damping="open")
    for parted in (
        split(car, "drive_shafts", 2.5, 0.3),
        split(car.replace("drive_shafts", damping=0.0), "drive_shafts", -0.7, 0.8),
    ):
        whole = car.replace("drive_shafts", damping=0.0) if not parted["drive_shafts_1"].damping else car
        wanted, found = pt.launch(whole), pt.launch(parted)
        assert [(e.element, e.kind, e.mode) for e in found.events] == [
            (e.element, e.kind, e.mode) for e in wanted.events
        ]
        assert [e.time for e in found.events] == pytest.approx([e.time for e in wanted.events], abs=1e-9)
        for name in ("engine_speed", "wheels_speed", "vehicle_acceleration", "tyres_torque", "clutch_torque"):
            assert np.abs(found[name] - wanted[name]).max() <= 1e-9 * np.abs(wanted[name]).max(), name
        carried = found["drive_shafts_2_torque"]
        assert np.abs(carried - wanted["drive_shafts_torque"]).max() <= 1e-9 * np.abs(carried).max()
        assert found.slip_energy["clutch"] == pytest.approx(wanted.slip_energy["clutch"], rel=1e-9)


def test_load_change_models_and_loops_of_an_open_differential_are_those_of_its_row():
    car, whole = ev(1.0, 1000.0), ev_in_one_row(1.0, 1000.0)
    found, wanted = pt.load_change(car), pt.load_change(whole)
    for name in ("motor_speed", "vehicle_acceleration", "left_tyre_torque"):
        assert np.abs(found[name] - wanted[name]).max() <= 1e-9 * np.abs(wanted[name]).max(), name
    assert (
        np.abs(found["left_shaft_torque"] - wanted["half_shafts_torque"]).max()
        <= 1e-9 * np.abs(found["left_shaft_torque"]).max()
    )
    # between the wheels, which turn alike, the side gears divide what the half-shafts are twisted by
    assert np.abs(found["left_speed"] + found["right_speed"] - 2.0 * found["carrier_speed"]).max() < 1e-9
    two, other = pt.two_mass(car), pt.two_mass(whole)
    assert (two.stiffness, two.damping) == pytest.approx((other.stiffness, other.damping), rel=1e-9)
    plant, other = pt.SampledPlant(car=car), pt.SampledPlant(car=whole)
    assert plant.ratio == pytest.approx(other.ratio)
    # the creeping of the side gears is not seen from the engine
    controller = pt.antijerk.designs(other)["two degrees of freedom"]
    for unit in (None, controller):
        found, wanted = (pt.closed_loop(each, unit, pt.ramp(0.5, 0.1, 250.0), duration=2.0) for each in (plant, other))
        for name in ("vehicle_acceleration", "engine_speed", "torque_command"):
            assert np.abs(found[name] - wanted[name]).max() <= 1e-9 * np.abs(wanted[name]).max(), name
    margins, wanted = pt.loop_margins(plant, controller), pt.loop_margins(other, controller)
    assert margins.disk_margin == pytest.approx(wanted.disk_margin, rel=1e-9)


def test_wheels_without_inertia_are_what_light_ones_approach():
    car = pt.examples.conventional(damping="open")
    bare = [e for e in car if e.name != "wheels"]
    lock, speed = [], []
    for J in (1e-4, 1e-5, None):
        wheels = [] if J is None else [pt.Inertia("wheels", J=J)]
        response = pt.controlled_launch(pt.SampledPlant(car=pt.Driveline(*bare, *wheels)), None)
        lock.append(response.events[-1].time)
        speed.append(response["wheels_speed"][-1])
    for values in (lock, speed):
        far, near = abs(values[0] - values[2]), abs(values[1] - values[2])
        assert 0.0 < near < 0.2 * far < 1e-5


def test_reflection_keeps_massless_nodes_and_the_frequencies():
    seen = pt.reflected(ev(1.0, 1000.0), "motor")
    assert pt.modes(seen).frequency_hz == pytest.approx(pt.modes(ev()).frequency_hz, rel=1e-12)
    assert np.sort_complex(pt.poles(seen)) == pytest.approx(
        np.sort_complex(pt.poles(ev(1.0, 1000.0))), rel=1e-9, abs=1e-9
    )


# --- starts, states and systems ---------------------------------------------------------------------------------------

ZENER = pt.Driveline(
    pt.Inertia("motor", J=0.5),
    pt.SpringDamper("soft", "motor", "joint", stiffness=2e3),
    pt.SpringDamper("joint_damper", "joint", "flange", stiffness=0.0, damping=20.0),
    pt.SpringDamper("stop", "joint", "flange", stiffness=5e3),
    pt.SpringDamper("shaft", "flange", "hub", stiffness=9e3, damping=3.0),
    pt.SpringDamper("bypass", "motor", "free", stiffness=800.0),
    pt.SpringDamper("dashpot", "free", "hub", stiffness=0.0, damping=6.0),
    pt.Inertia("hub", J=1.5),
    pt.Clutch("clutch", "hub", "load", max_torque=500.0),
    pt.Inertia("load", J=2.0),
    pt.Drag("road", "load", damping=0.1),
)
FREE = pt.Driveline(*(e for e in ZENER if e.name != "road"))


def test_a_start_under_load_is_steady():
    loads = {"motor_torque": 40.0, "joint_torque": -5.0}
    response = pt.simulate(FREE, np.linspace(0.0, 0.5, 51), loads, initial_load=loads)
    for name in ("soft_torque", "stop_torque", "shaft_torque", "hub_acceleration", "clutch_torque"):
        assert np.ptp(response[name]) < 1e-9 * np.abs(response[name]).max(), name
    total = 35.0 / (0.5 + 1.5 + 2.0)
    assert response["hub_acceleration"] == pytest.approx(total, rel=1e-9)
    # a damper in series lets its spring go
    assert response["dashpot_torque"] == pytest.approx(0.0, abs=1e-9)


def test_a_start_with_twists_holds_them():
    response = pt.simulate(ZENER, [0.0, 1e-9], initial_twist={"soft": 0.02, "bypass": -0.01})
    assert response["soft_twist"][0] == pytest.approx(0.02, rel=1e-9)
    assert response["bypass_twist"][0] == pytest.approx(-0.01, rel=1e-9)
    # each spring torque passes its node on, through the damper beside it
    assert response["joint_damper_torque"][0] + response["stop_torque"][0] == pytest.approx(40.0, rel=1e-9)
    assert response["dashpot_torque"][0] == pytest.approx(-8.0, rel=1e-9)


def test_a_run_goes_on_from_its_final_state():
    inputs = {"motor_torque": pt.ramp(0.05, 0.1, 60.0), "joint_torque": pt.step(0.12, 7.0)}
    whole = pt.simulate(ZENER, np.linspace(0.0, 0.4, 41), inputs)
    first = pt.simulate(ZENER, np.linspace(0.0, 0.2, 21), inputs)
    assert set(first.final.speed) == {"motor", "hub", "load"}
    by_hand = pt.State(first.final.time, first.final.twist, first.final.speed, first.final.mode)
    for state in (first.final, by_hand):
        rest = pt.simulate(ZENER, np.linspace(0.2, 0.4, 21), inputs, initial_state=state)
        for name in whole.outputs:
            size = max(np.abs(whole[name]).max(), 1e-3)
            assert np.abs(rest[name] - whole[name][20:]).max() <= 1e-9 * size, name


def test_systems_of_python_control_are_the_simulation():
    timepts = np.linspace(0.0, 0.3, 301)
    inputs = {"motor_torque": pt.ramp(0.05, 0.1, 60.0), "joint_torque": pt.ramp(0.1, 0.1, 7.0)}
    wanted = pt.simulate(ZENER, timepts, inputs)
    for system in (pt.nonlinear_system(ZENER), pt.nonlinear_system(ZENER, dt=0.001)):
        settings = {} if system.isdtime(strict=True) else pt.solver_settings(*inputs.values())
        settings |= (
            {} if system.isdtime(strict=True) else {"solve_ivp_kwargs": {"rtol": 1e-9, "atol": 1e-11, "max_step": 0.01}}
        )
        values = pt.input_values(system, ZENER, timepts, inputs)
        found = control.input_output_response(system, timepts, values, pt.initial_state(system, ZENER), **settings)
        tolerance = 1e-9 if system.isdtime(strict=True) else 1e-5
        for name in ("hub_speed", "soft_torque", "joint_speed", "shaft_torque"):
            error = np.abs(found.outputs[system.find_output(name)] - wanted[name]).max()
            # the continuous one takes up slip within its stick time
            assert error <= tolerance * np.abs(wanted[name]).max(), (name, system.dt)


# --- what is refused --------------------------------------------------------------------------------------------------

CONDENSED = pt.Driveline(
    pt.Inertia("a", J=1.0),
    pt.SpringDamper("left", "a", "flange", stiffness=100.0),
    pt.SpringDamper("right", "flange", "b", stiffness=300.0),
    pt.Inertia("b", J=1.0),
)


def test_an_output_that_needs_the_derivative_of_an_input_is_refused_by_name():
    for output in ("flange_speed", "flange_acceleration"):
        with pytest.raises(
            pt.PowertrainError, match=f"{output} would need the derivative of flange_torque: .* an Inertia, or"
        ):
            pt.state_space(CONDENSED, ["a_torque", "flange_torque"], output)
        with pytest.raises(pt.PowertrainError, match=f"{output} would need the derivative of flange_torque"):
            pt.static_gain(CONDENSED, "flange_torque", output)
        assert output not in pt.state_space(CONDENSED).output_labels
        assert output in pt.state_space(CONDENSED, "a_torque").output_labels
    # a damper at the flange makes its speed follow its torque, and its acceleration alone the derivative
    damped = CONDENSED.replace("left", damping=0.5)
    assert pt.state_space(damped, "flange_torque", "flange_speed").D[0, 0] == pytest.approx(1.0 / 0.5)
    with pytest.raises(pt.PowertrainError, match="flange_acceleration would need the derivative of flange_torque"):
        pt.state_space(damped, "flange_torque", "flange_acceleration")


def test_a_simulation_shows_what_its_inputs_allow():
    timepts, torque = np.linspace(0.0, 1.0, 11), {"a_torque": 1.0}
    assert "flange_speed" in pt.simulate(CONDENSED, timepts, torque).outputs
    at_flange = pt.simulate(CONDENSED, timepts, torque | {"flange_torque": 0.0})
    assert "flange_speed" not in at_flange.outputs
    assert "left_twist" in at_flange.outputs
    with pytest.raises(pt.UnknownNameError, match="flange_speed"):
        at_flange["flange_speed"]


def test_a_law_at_a_node_without_inertia_is_refused_with_what_helps():
    car = pt.Driveline(*CONDENSED, pt.Clutch("clutch", "flange", "drum", max_torque=5.0), pt.Inertia("drum", J=0.1))
    assert len(pt.assemble(car).coordinates) == 3  # locked, it holds the flange to the drum
    with pytest.raises(
        pt.TopologyError, match=r'node "flange" has no inertia and clutch acts there.* an Inertia, or, for linear'
    ):
        pt.modes(car.release())
    with pytest.raises(pt.TopologyError, match=r'node "flange" has no inertia and clutch acts there'):
        pt.simulate(car, [0.0, 1.0])
    damped = car.replace("left", damping=0.5)
    assert len(pt.poles(damped.release())) == 5  # a pair, of the flange, and two rigid motions
    with pytest.raises(
        pt.TopologyError, match=r'node "flange" has no inertia and clutch acts there; give it an Inertia$'
    ):
        pt.simulate(damped, [0.0, 1.0])
    heavy = pt.Driveline(*car, pt.Inertia("flange", J=1e-3))
    assert pt.simulate(heavy, [0.0, 1.0]).outputs
    play = pt.Driveline(
        *CONDENSED, pt.Backlash("play", "flange", "drum", gap=0.1, stiffness=1e3), pt.Inertia("drum", J=0.1)
    )
    with pytest.raises(pt.TopologyError, match=r'node "flange" has no inertia and play acts there'):
        pt.simulate(play, [0.0, 1.0])


def test_what_nothing_holds_is_refused_and_the_remedies_named_help():
    gears = [pt.Inertia("a", J=1.0), pt.Planetary("p", "a", "y", "z", ratio=2.0)]
    with pytest.raises(
        pt.TopologyError, match=r"an Inertia or .*a Compliance with the ratio.*a Differential with a spring"
    ):
        pt.modes(pt.Driveline(*gears))
    held_by = [pt.SpringDamper("k", "y", "b", stiffness=10.0), pt.SpringDamper("l", "z", "b", stiffness=10.0)]
    assert pt.modes(pt.Driveline(*gears, *held_by, pt.Inertia("b", J=1.0))).n_rigid == 1
    with pytest.raises(pt.TopologyError, match='node "b" of k has no inertia'):
        pt.Driveline(*gears, *held_by[:1])


def test_angles_and_speeds_are_the_states_only_where_no_node_creeps():
    G = pt.state_space(CONDENSED, coordinates="angle", inputs="a_torque", outputs=["b_speed", "flange_angle"])
    # 100 and 300 N m/rad in series between two bodies of 1 kg m^2
    assert np.sort(G.poles().imag) == pytest.approx([-(150.0**0.5), 0.0, 0.0, 150.0**0.5], abs=1e-6)
    with pytest.raises(pt.PowertrainError, match='coordinates="angle": flange have no inertia and creep'):
        pt.state_space(CONDENSED.replace("left", damping=0.5), coordinates="angle")


def test_the_torque_of_an_engine_without_inertia_is_refused_in_a_loop():
    car = pt.Driveline(
        pt.SpringDamper("shaft", "engine", "wheel", stiffness=1e3, damping=5.0),
        pt.SpringDamper("other", "engine", "wheel", stiffness=1e3, damping=5.0),
        pt.Inertia("wheel", J=1.0),
        pt.Tyre("tyre", "wheel", "vehicle", radius=0.3, stiffness=1e5, damping=100.0),
        pt.Mass("vehicle", m=1000.0),
    )
    car = pt.Driveline(*car, pt.Drag("bearing", "engine", damping=0.1))
    with pytest.raises(pt.PowertrainError, match="engine has no inertia, so its torque sets speeds at once"):
        pt.SampledPlant(car=car).discrete()
