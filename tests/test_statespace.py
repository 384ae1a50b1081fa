"""control.StateSpace in twists and in angles.

Of linear/outputs, linear/separation.
"""

import re

import by_hand
import control
import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from strategies import drivelines, trees

import powertrain_ctrl as pt


def impedance(car, omega, torque_at, speed_of):
    """Speed over torque from M, D, K by a dense solve, no state space."""
    m = pt.assemble(car)
    s = 1j * omega
    motion = np.linalg.solve(m.K + s * m.D + s**2 * m.M, m.T[m.nodes.index(torque_at)])
    return s * m.T[m.nodes.index(speed_of)] @ motion


def transfer(G, s):
    """By a dense solve; python-control's own evaluation loses digits far above the low modes."""
    return G.C @ np.linalg.solve(s * np.eye(G.nstates) - G.A, G.B) + G.D


def total_inertia(car, node):
    m = pt.assemble(car)
    motion = m.rigid_motion / m.rigid_motion[m.nodes.index(node)]
    return motion @ m.J @ motion


def test_steady_acceleration_is_one_over_the_inertia():
    by_hand = (0.3 + 0.05 + 0.1 + 0.03 + 0.05 / 36) * 324 + 4 + 2000 * 0.35**2
    G = pt.state_space(pt.examples.conventional(), "engine_torque", ["vehicle_acceleration", "engine_acceleration"])
    np.testing.assert_allclose(G.dcgain().ravel(), [18 * 0.35 / by_hand, 324 / by_hand], rtol=1e-10)
    assert G.nstates == 12


@given(trees(most=5))
@settings(max_examples=30)
def test_steady_acceleration_of_any_tree(car):
    G = pt.state_space(car, "J0_torque", "J0_acceleration")
    if G.nstates:
        assert float(G.dcgain()) == pytest.approx(1.0 / total_inertia(car, "J0"), rel=1e-6)


def test_one_zero_pole_for_the_rigid_motion_and_only_if_it_is_seen():
    car = pt.examples.conventional()
    scale = 1e-9 * np.abs(pt.poles(car)).max()
    for outputs, zeros, states in (
        ("vehicle_speed", 1, 13),
        ("vehicle_acceleration", 0, 12),
        ("drive_shafts_torque", 0, 12),
        (["clutch_torque", "tyres_twist"], 0, 12),
        (None, 1, 13),
    ):
        G = pt.state_space(car, "engine_torque", outputs)
        assert (np.count_nonzero(np.abs(G.poles()) < scale), G.nstates) == (zeros, states)
        assert control.minreal(G, verbose=False).nstates == states


def test_states_have_the_names_of_what_they_are():
    car = pt.Driveline(
        pt.Inertia("engine", J=1.0),
        pt.Inertia("wheel", J=2.0),
        pt.SpringDamper("shaft", "engine", "wheel", stiffness=3.0),
    )
    for outputs, states in (
        (None, ["shaft_twist", "shaft_twist_rate", "engine_free_speed"]),
        ("wheel_speed", ["shaft_twist", "shaft_twist_rate", "wheel_free_speed"]),
        ("wheel_angle", ["shaft_twist", "shaft_twist_rate", "wheel_free_speed", "wheel_free_angle"]),
        ("shaft_torque", ["shaft_twist", "shaft_twist_rate"]),
    ):
        G = pt.state_space(car, outputs=outputs)
        assert G.state_labels == states
        assert (G.input_labels, G.dt) == (["engine_torque", "wheel_torque"], 0)
    angles = ["engine_angle", "wheel_angle", "engine_speed", "wheel_speed"]
    assert pt.state_space(car, coordinates="angle").state_labels == angles


def test_poles_are_those_of_the_driveline():
    car = pt.examples.conventional()
    G = pt.state_space(car)
    np.testing.assert_allclose(np.sort_complex(G.poles()), np.sort_complex(pt.poles(car)), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("damping", ["closed", "open"])
def test_both_coordinates_are_the_same_system(damping):
    car = pt.examples.conventional(damping=damping)
    names = {"inputs": ["engine_torque", "vehicle_force"], "outputs": ["wheels_speed", "clutch_torque", "tyres_torque"]}
    twist = pt.state_space(car, **names)
    for reference in (None, "engine", "wheels"):
        angle = pt.state_space(car, **names, coordinates="angle", reference=reference)
        for f in (0.3, 2.6, 21.0, 150.0):
            s = 2j * np.pi * f
            np.testing.assert_allclose(transfer(angle, s), transfer(twist, s), rtol=1e-6)


def test_response_is_that_of_the_impedance():
    car = pt.examples.conventional()
    G = pt.state_space(car, "engine_torque", "vehicle_speed")
    for f in (0.1, 2.64, 21.1, 189.0):
        omega = 2 * np.pi * f
        assert G(1j * omega) == pytest.approx(impedance(car, omega, "engine", "vehicle"), rel=1e-6)


def test_locked_clutch_transmits_what_accelerates_the_inertia_behind_it():
    car = pt.examples.conventional()
    G = pt.state_space(car, "engine_torque", ["clutch_torque", "clutch_slip_speed"])
    total = total_inertia(car, "engine")
    behind = total - (0.3 + 0.05 + 0.09)
    np.testing.assert_allclose(G.dcgain().ravel(), [behind / total, 0.0], atol=1e-10)
    # at any frequency: torque = damper torque of the shaft in front minus what its own inertia takes
    s = 2j * np.pi * 30.0
    H = pt.state_space(car, "engine_torque", ["clutch_torque", "clutch_shaft_torque", "clutch_primary_acceleration"])(s)
    assert H[0, 0] == pytest.approx(H[1, 0] - 0.09 * H[2, 0], rel=1e-9)


def test_brake_torque_holds_the_reaction():
    car = pt.Driveline(
        pt.Inertia("sun", J=1.0),
        pt.Inertia("carrier", J=1e-3),
        pt.Planetary("gears", "sun", "ring", "carrier", ratio=2.0),
        pt.Clutch("brake", "ring", max_torque=10.0),
        pt.Drag("load", "carrier", damping=7.0),
    )
    G = pt.state_space(car, "sun_torque", ["brake_torque", "load_torque"])
    # From outside the set takes torques as 1 : ratio : -(1 + ratio). The brake pushes the ring by +ratio, which is a
    # negative torque through it; the load takes 1 + ratio.
    np.testing.assert_allclose(G.dcgain().ravel(), [-2.0, 3.0], rtol=1e-9)


def test_an_open_clutch_passes_nothing():
    car = pt.examples.conventional().release("clutch")
    G = pt.state_space(car, "engine_torque", ["vehicle_speed", "clutch_torque"])
    assert G.nstates == 0
    assert not G.D.any()
    assert G.dt == 0
    both = pt.state_space(car, ["engine_torque", "vehicle_force"], "clutch_slip_speed")
    # each side can turn, but their difference is one integrator
    assert np.count_nonzero(np.abs(both.poles()) < 1e-6) == 1


def test_every_branch_has_a_torque_of_its_own():
    # two shafts from the same node: momentum of an impulse on the hub spreads, torques are not merged
    car = pt.Driveline(
        *(pt.Inertia(name, J=J) for name, J in (("hub", 1.0), ("left", 2.0), ("right", 3.0))),
        pt.SpringDamper("to_left", "hub", "left", stiffness=100.0, damping=1.0),
        pt.SpringDamper("to_right", "hub", "right", stiffness=300.0, damping=1.0),
    )
    names = ["hub_speed", "left_speed", "right_speed", "to_left_torque", "to_right_torque"]
    t = np.linspace(0.0, 0.5, 501)
    y = control.impulse_response(pt.state_space(car, "hub_torque", names), t).outputs[:, 0]
    np.testing.assert_allclose(np.array([1.0, 2.0, 3.0]) @ y[:3], 1.0, rtol=1e-9)
    np.testing.assert_allclose(np.gradient(y[1], t)[1:-1] * 2.0, y[3][1:-1], atol=0.05 * np.abs(y[3]).max())


def test_a_spring_to_ground_is_kept():
    car = pt.Driveline(pt.Inertia("a", J=2.0), pt.Drag("held", "a", damping=0.4, stiffness=50.0))
    G = pt.state_space(car, "a_torque", ["held_twist", "held_torque"])
    np.testing.assert_allclose(G.dcgain().ravel(), [1.0 / 50.0, 1.0], rtol=1e-12)


def referred_to_its_wheels():
    """The front-wheel-drive car with everything referred to its wheels, the tyre a damper."""
    return pt.Driveline(
        pt.Inertia("engine", J=13.724939141999998),
        pt.Inertia("transmission", J=0.4178308668),
        pt.Inertia("wheel", J=1.8176),
        pt.Inertia("vehicle", J=121.42235),
        pt.SpringDamper("gearbox_shaft", "engine", "transmission", stiffness=50642.611706865915, damping=65.512836),
        pt.SpringDamper("drive_shafts", "transmission", "wheel", stiffness=7200.0, damping=5.0),
        pt.SpringDamper("tyre", "wheel", "vehicle", stiffness=0.0, damping=1400.0),
    )


def test_a_pure_damper_has_no_twist_but_a_torque():
    car = referred_to_its_wheels()
    G = pt.state_space(car)
    assert "tyre_twist" not in G.output_labels
    assert "tyre_torque" in G.output_labels
    assert control.minreal(pt.state_space(car, "engine_torque", "tyre_torque"), verbose=False).nstates == 5


def test_partly_seen_rigid_motions_leave_no_extra_integrator():
    car = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in ("sun", "ring", "carrier", "wheel")),
        pt.Planetary("gears", "sun", "ring", "carrier", ratio=2.0),
        pt.SpringDamper("shaft", "carrier", "wheel", stiffness=10.0, damping=0.1),
    )
    for outputs, zeros in (("shaft_torque", 0), ("wheel_speed", 1), (None, 2)):
        G = pt.state_space(car, "sun_torque", outputs)
        assert np.count_nonzero(np.abs(G.poles()) < 1e-9) == zeros
    wheel = pt.state_space(car, "sun_torque", "wheel_speed")
    assert wheel(1.7j) == pytest.approx(impedance(car, 1.7, "sun", "wheel"), rel=1e-9)


WRONG = [
    (
        {"inputs": "engin_torque"},
        'signal "engin_torque" is not an input of this driveline; did you mean "engine_torque"?',
    ),
    (
        {"outputs": "wheel_speed"},
        'signal "wheel_speed" is not an output of this driveline; did you mean "wheels_speed"?',
    ),
    ({"inputs": 0}, 'signal "0" is not an input of this driveline; there is engine_torque, '),
    ({"outputs": [0, 1]}, 'signal "0" is not an output of this driveline'),
    ({"outputs": []}, "permitted: at least one signal, each once"),
    ({"inputs": ["engine_torque"] * 2}, "permitted: at least one signal, each once"),
    ({"coordinates": "modal"}, 'coordinates = \'modal\', permitted: "twist", "angle"'),
    ({"reference": "engine"}, 'reference is for coordinates="angle"'),
    ({"coordinates": "angle", "reference": "motor"}, 'node "motor" is not'),
]


@pytest.mark.parametrize(("options", "message"), WRONG)
def test_wrong_names_are_named(options, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)):
        pt.state_space(pt.examples.conventional(), **options)


def test_reflection_needs_a_connected_driveline():
    car = pt.examples.conventional().release("clutch")
    with pytest.raises(pt.TopologyError, match=r'not every node is connected with "engine"; take car.part\("engine"\)'):
        pt.state_space(car, coordinates="angle", reference="engine")


def test_colliding_signal_names_are_refused():
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("a_slip", J=1.0),
        pt.Inertia("b", J=1.0),
        pt.Clutch("c", "a", "a_slip", max_torque=1.0),
        pt.SpringDamper("s", "a_slip", "b", stiffness=1.0),
    )
    assert "a_slip_speed" in pt.state_space(car).output_labels
    clash = pt.Driveline(*(e for e in car if e.name != "c"), pt.Clutch("a2", "a", "b", max_torque=1.0))
    clash = pt.Driveline(*clash, pt.Inertia("a2_slip", J=1.0), pt.SpringDamper("s2", "a2_slip", "b", stiffness=1.0))
    with pytest.raises(pt.PowertrainError, match='two signals would be named "a2_slip_speed"'):
        pt.state_space(clash)


FREQUENCIES = np.geomspace(0.05, 300.0, 60)


@pytest.mark.parametrize("damping", ["closed", "open"])
@pytest.mark.parametrize("state", ["closed", "open"])
def test_twists_and_angles_answer_alike_over_the_whole_band(state, damping):
    car = pt.examples.conventional(damping=damping)
    car = car if state == "closed" else car.release("clutch").part("vehicle")
    first = car.nodes[0]
    names = {"inputs": [f"{first}_torque", "vehicle_force"], "outputs": None}
    twist = pt.state_space(car, **names)
    angle = pt.state_space(car, names["inputs"], twist.output_labels, coordinates="angle", reference=first)
    for f in FREQUENCIES:
        H, G = transfer(angle, 2j * np.pi * f), transfer(twist, 2j * np.pi * f)
        np.testing.assert_allclose(H, G, rtol=1e-6, atol=1e-12)


@given(drivelines(most=5))
def test_both_coordinates_answer_as_the_dense_matrices(car):
    other = by_hand.matrices(car)
    seen = [f"{node}_speed" for node in car.nodes]
    for coordinates in ("twist", "angle"):
        G = pt.state_space(car, "J0_torque", seen, coordinates=coordinates)
        for omega in (0.7, 4.3, 29.0, 170.0):
            expected = np.array([other.speed_over_torque(1j * omega, "J0", node) for node in car.nodes])
            found = transfer(G, 1j * omega)[:, 0] if G.nstates else G.D[:, 0]
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8 * np.abs(expected).max())


@given(drivelines(most=5, geared=False))
def test_torques_leave_the_momentum_of_every_body_in_balance(car):
    G = pt.state_space(car)
    H = dict(zip(G.output_labels, transfer(G, 11.0j), strict=True))
    torque_on = {node: np.zeros(len(G.input_labels), dtype=complex) for node in car.nodes}
    for element in car:
        if isinstance(element, pt.SpringDamper | pt.Clutch):
            torque_on[element.a] -= H[f"{element.name}_torque"]
            torque_on[element.b] += H[f"{element.name}_torque"]
        if isinstance(element, pt.Drag):
            torque_on[element.node] -= H[f"{element.name}_torque"]
    for load, label in zip(np.eye(len(G.input_labels)), G.input_labels, strict=True):
        body = label.removesuffix("_torque")
        np.testing.assert_allclose(car[body].J * H[f"{body}_acceleration"], load + torque_on[body], atol=1e-9)


@given(drivelines(most=5))
def test_at_most_one_zero_pole_per_rigid_motion(car):
    G = pt.state_space(car)
    modes = pt.modes(car)
    other = by_hand.matrices(car)
    free = len(other.M) - (np.linalg.matrix_rank(other.W) if other.W.size else 0)
    singular = np.linalg.svd(G.A, compute_uv=False)
    assert np.count_nonzero(singular <= 1e-12 * singular[0]) == free if singular[0] else G.nstates == free
    # one state per independent spring, one per coordinate
    assert G.nstates == 2 * len(modes) - modes.n_rigid


def test_locked_clutch_torque_is_the_limit_of_a_stiff_spring():
    car = pt.examples.conventional()
    names = {"inputs": ["engine_torque", "vehicle_force"], "outputs": "clutch_torque"}
    locked = pt.state_space(car, **names)

    def stiff(k):
        spring = pt.SpringDamper("clutch", "clutch_primary", "clutch_secondary", stiffness=k)
        return pt.state_space(pt.Driveline(*(e for e in car if e.name != "clutch"), spring), **names)

    for f in (0.1, 2.6, 21.0, 189.0):
        s = 2j * np.pi * f
        rigid = transfer(locked, s)
        errors = [np.abs(transfer(stiff(k), s) - rigid).max() / np.abs(rigid).max() for k in (1e9, 1e10)]
        assert errors[1] < 1e-3
        assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)  # the error is the compliance


@pytest.mark.parametrize("coordinates", ["twist", "angle"])
def test_locked_clutch_torque_in_a_gear_train_by_hand(coordinates):
    # engine 2 | clutch | gear 4 | output 8: the inertia behind, seen from the clutch, is 8 / 16
    car = pt.Driveline(
        pt.Inertia("engine", J=2.0),
        pt.Clutch("clutch", "engine", "input_shaft", max_torque=10.0),
        pt.Gear("gear", "input_shaft", "output", ratio=4.0),
        pt.Inertia("output", J=8.0),
    )
    G = pt.state_space(car, None, "clutch_torque", coordinates=coordinates)
    assert G.input_labels == ["engine_torque", "output_torque"]
    # engine torque: behind / total; a torque on the output pushes back through the clutch, 1 / 4 of it, by front / total
    np.testing.assert_allclose(transfer(G, 1j) if G.nstates else G.D, [[0.5 / 2.5, -0.25 * 2.0 / 2.5]], rtol=1e-12)


def test_free_planetary_accelerates_as_its_constraint_says():
    # M w' + c lambda = e_sun, c . w' = 0 with c = (1, i0, -(1 + i0))
    J, c = np.array([0.3, 0.7, 2.0]), np.array([1.0, 2.0, -3.0])
    car = pt.Driveline(
        *(pt.Inertia(name, J=inertia) for name, inertia in zip(("sun", "ring", "carrier"), J, strict=True)),
        pt.Planetary("gears", "sun", "ring", "carrier", ratio=2.0),
    )
    system = np.block([[np.diag(J), c[:, None]], [c[None], np.zeros((1, 1))]])
    expected = np.linalg.solve(system, [1.0, 0.0, 0.0, 0.0])[:3]
    names = ["sun_acceleration", "ring_acceleration", "carrier_acceleration"]
    np.testing.assert_allclose(pt.state_space(car, "sun_torque", names).D[:, 0], expected, rtol=1e-13)
    speeds = pt.state_space(car, "sun_torque", [name.replace("acceleration", "speed") for name in names])
    np.testing.assert_allclose(5.0j * transfer(speeds, 5.0j)[:, 0], expected, rtol=1e-12)


def test_a_loop_of_springs_has_a_twist_less_and_every_torque():
    J, k, d = [1.0, 2.0, 3.0], np.array([100.0, 200.0, 300.0]), np.array([0.5, 0.0, 1.0])
    ends = [(0, 1), (1, 2), (2, 0)]
    car = pt.Driveline(
        *(pt.Inertia(f"n{i}", J=J[i]) for i in range(3)),
        *(pt.SpringDamper(f"s{i}", f"n{a}", f"n{b}", stiffness=k[i], damping=d[i]) for i, (a, b) in enumerate(ends)),
    )
    G = pt.state_space(car, "n0_torque", ["s0_torque", "s1_torque", "s2_torque"])
    assert G.nstates == 4  # two twists, two twist rates: the rigid motion shows in no torque
    assert control.minreal(G, verbose=False).nstates == 4
    assert pt.state_space(car).nstates == 5
    W = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0], [-1.0, 0.0, 1.0]])
    for s in (0.3j, 12.0j, 15.1j, 80.0j):
        coupling = k + d * s
        motion = np.linalg.solve(np.diag(J) * s**2 + W.T @ np.diag(coupling) @ W, [1.0, 0.0, 0.0])
        np.testing.assert_allclose(transfer(G, s)[:, 0], coupling * (W @ motion), rtol=1e-9)


def test_an_open_clutch_passes_nothing_in_angles_either():
    car = pt.examples.conventional().release("clutch")
    behind = ["vehicle_speed", "drive_shafts_torque", "clutch_torque", "wheels_angle"]
    G = pt.state_space(car, "engine_torque", behind, coordinates="angle")
    for f in (0.1, 7.3, 200.0):
        assert not transfer(G, 2j * np.pi * f).any()


def stepped(J, k, d, W, t):
    """Speeds of bodies under a unit torque on the first, and torques of the springs, from hand-written equations."""
    m, n = W.shape
    load = np.eye(n)[:, :1]
    rows = np.block([np.zeros((m, m)), W, np.zeros((m, 1))])
    rows = np.vstack([rows, np.hstack([-W.T * k, -(W.T * d) @ W, load]) / J[:, None], np.zeros((1, m + n + 1))])
    step, x = scipy.linalg.expm(rows * t[1]), [np.eye(m + n + 1)[-1]]
    for _ in t[1:]:
        x.append(step @ x[-1])
    twist, speed = np.array(x).T[:m], np.array(x).T[m : m + n]
    return np.vstack([speed, k[:, None] * twist + d[:, None] * (W @ speed)])


def test_step_response_of_a_star_has_every_speed_and_every_torque():
    J, k, d = np.array([1.0, 2.0, 3.0, 0.5]), np.array([100.0, 300.0, 50.0]), np.array([0.5, 0.0, 2.0])
    W = np.array([[1.0, -1.0, 0.0, 0.0], [1.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, -1.0]])
    car = pt.Driveline(
        *(pt.Inertia(name, J=inertia) for name, inertia in zip(("hub", "b0", "b1", "b2"), J, strict=True)),
        *(pt.SpringDamper(f"s{i}", "hub", f"b{i}", stiffness=k[i], damping=d[i]) for i in range(3)),
    )
    t = np.linspace(0.0, 2.0, 401)
    expected = stepped(J, k, d, W, t)
    names = [*(f"{n}_speed" for n in ("hub", "b0", "b1", "b2")), *(f"s{i}_torque" for i in range(3))]
    y = control.step_response(pt.state_space(car, "hub_torque", names), t).outputs[:, 0]
    np.testing.assert_allclose(y, expected, atol=1e-10)
    np.testing.assert_allclose(J @ y[:4], t, atol=1e-9)  # momentum is the impulse


def test_step_response_of_the_car_with_a_damper_for_a_tyre():
    car = referred_to_its_wheels()
    J = np.array([car[name].J for name in ("engine", "transmission", "wheel", "vehicle")])
    k, d = np.array([50642.611706865915, 7200.0, 0.0]), np.array([65.512836, 5.0, 1400.0])
    W = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 1.0, -1.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
    t = np.linspace(0.0, 0.5, 251)
    expected = stepped(J, k, d, W, t)
    names = [f"{n}_speed" for n in ("engine", "transmission", "wheel", "vehicle")]
    names += ["gearbox_shaft_torque", "drive_shafts_torque", "tyre_torque"]
    G = pt.state_space(car, "engine_torque", names)
    assert G.noutputs == 7
    y = control.step_response(G, t).outputs[:, 0]
    np.testing.assert_allclose(y, expected, atol=1e-10)


def test_impulse_response_against_a_spring_to_ground_in_closed_form():
    J, d, k = 2.0, 0.4, 50.0
    car = pt.Driveline(pt.Inertia("a", J=J), pt.Drag("held", "a", damping=d, stiffness=k))
    t = np.linspace(0.0, 5.0, 501)
    y = control.impulse_response(pt.state_space(car, "a_torque", "held_twist"), t).outputs.ravel()
    omega, zeta = np.sqrt(k / J), d / (2.0 * np.sqrt(k * J))
    damped = omega * np.sqrt(1.0 - zeta**2)
    np.testing.assert_allclose(y, np.exp(-zeta * omega * t) * np.sin(damped * t) / (J * damped), atol=1e-12)


def test_a_spring_turned_end_for_end_turns_the_sign_of_its_torque():
    def pair(a, b):
        shaft = pt.SpringDamper("shaft", a, b, stiffness=9.0, damping=0.1)
        return pt.state_space(
            pt.Driveline(pt.Inertia("low", J=1.0), pt.Inertia("high", J=2.0), shaft), "low_torque", "shaft_torque"
        )

    for s in (0.1j, 3.0j, 50.0j):
        np.testing.assert_allclose(transfer(pair("low", "high"), s), -transfer(pair("high", "low"), s), rtol=1e-12)
    assert float(pair("low", "high").dcgain()) == pytest.approx(2.0 / 3.0, rel=1e-12)  # drives the side b


@given(trees(most=4))
@settings(max_examples=30)
def test_in_angles_reflected_to_any_node_signals_stay_physical(car):
    plain = pt.state_space(car, "J0_torque", ["J1_speed", "J1_angle"], coordinates="angle")
    for node in car.nodes:
        reflected = pt.state_space(car, "J0_torque", ["J1_speed", "J1_angle"], coordinates="angle", reference=node)
        for s in (0.9j, 40.0j):
            H = transfer(plain, s)
            np.testing.assert_allclose(transfer(reflected, s), H, rtol=1e-7)
            np.testing.assert_allclose(H[0], s * H[1], rtol=1e-7)  # angle' = speed


def test_a_hold_to_ground_does_not_hinder_the_reflection():
    # J, k, d of what lies behind a gear R divide by R^2, (2.1); the bearing stands in front of it
    R = 4.0
    car = pt.Driveline(
        pt.Inertia("engine", J=0.5),
        pt.Inertia("wheels", J=8.0),
        pt.Gear("gearbox", "engine", "axle", ratio=R),
        pt.SpringDamper("shaft", "axle", "wheels", stiffness=320.0, damping=1.6),
        pt.Drag("bearing", "engine", damping=0.25, stiffness=10.0),
    )
    J, k, d = np.array([0.5, 8.0 / R**2]), 320.0 / R**2, 1.6 / R**2
    coupled, held = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.diag([1.0, 0.0])
    K, D = (k * coupled + 10.0 * held) / J[:, None], (d * coupled + 0.25 * held) / J[:, None]
    expected = np.block([[np.zeros((2, 2)), np.eye(2)], [-K, -D]])
    system = pt.state_space(car, coordinates="angle", reference="engine")
    np.testing.assert_allclose(system.A, expected, rtol=1e-12)
    values, vectors = scipy.linalg.eigh(K * J[:, None], np.diag(J))
    modes = pt.modes(car)
    np.testing.assert_allclose(modes.omega**2, values, rtol=1e-12)
    shapes = vectors / vectors[np.abs(vectors).argmax(axis=0), [0, 1]]
    np.testing.assert_allclose(modes.reflected_shapes[:2], shapes, rtol=1e-12)


def test_the_integrator_stays_exact_in_sampling_and_connecting():
    car = pt.examples.conventional()
    G = pt.state_space(car, "engine_torque", ["engine_speed", "wheels_speed"])
    free = G.state_labels.index("engine_free_speed")
    assert not G.A[free].any()
    assert not G.A[:, free].any()
    assert np.abs(control.sample_system(G, 0.01).poles() - 1.0).min() == 0.0
    assert np.abs(control.append(G, control.ss(-1.0, 1.0, 1.0, 0.0)).poles()).min() == 0.0
    lag = control.ss(-30.0, 30.0, 1.0, 0.0, inputs="command", outputs="engine_torque", name="lag")
    both = control.interconnect([lag, G], inputs="command", outputs=["engine_speed", "wheels_speed"])
    assert np.abs(both.poles()).min() == 0.0
    steps = control.step_info(pt.state_space(car, "engine_torque", "engine_speed"))
    assert np.isnan(steps["SteadyStateValue"])


def test_static_gain_of_the_source_s_car_by_hand():
    # acceleration 1 over the inertia; the clutch carries what accelerates all behind its secondary side
    behind = (0.01 + 0.03 + 0.05 / 36) * 324 + 4 + 2000 * 0.35**2
    total = behind + (0.3 + 0.05 + 0.09) * 324
    outputs = ["vehicle_acceleration", "engine_acceleration", "clutch_torque", "damper_spring_torque", "wheels_speed"]
    gain = pt.static_gain(pt.examples.conventional(), "engine_torque", [*outputs, "damper_spring_twist"])
    spring = 1.0 - 0.3 * 324 / total
    expected = [18 * 0.35 / total, 324 / total, behind / total, spring, np.inf, spring / 2000.0]
    np.testing.assert_allclose(gain[:, 0], expected, rtol=1e-12)


def test_static_gain_tells_channels_apart_that_python_control_does_not():
    car = pt.examples.conventional()
    G = pt.state_space(car, ["engine_torque", "vehicle_force"], ["engine_speed", "damper_spring_torque"])
    gain = pt.static_gain(car, ["engine_torque", "vehicle_force"], ["engine_speed", "damper_spring_torque"])
    assert np.isinf(gain[0]).all()
    assert np.isfinite(gain[1]).all()
    assert not np.isfinite(G.dcgain()).any()


def test_angles_stand_behind_the_free_speed():
    car = pt.examples.conventional()
    names = {"inputs": "engine_torque", "outputs": ["engine_angle", "vehicle_angle", "tyres_torque"]}
    twist, angle = pt.state_space(car, **names), pt.state_space(car, **names, coordinates="angle")
    assert twist.nstates == 14
    assert twist.state_labels[-2:] == ["engine_free_speed", "engine_free_angle"]
    for omega in (0.5, 16.6, 140.0):
        np.testing.assert_allclose(transfer(twist, 1j * omega), transfer(angle, 1j * omega), rtol=1e-5)
    np.testing.assert_array_equal(pt.static_gain(car, **names)[:, 0] == np.inf, [True, True, False])
    assert "engine_angle" not in pt.state_space(car).output_labels


def test_a_motion_that_only_dampers_resist_has_an_angle_too():
    # load 4 kg m^2 behind a damper of 2, drag of 1 on the load: a torque of 1 turns the load at 1 rad/s in the end
    car = pt.Driveline(
        pt.Inertia("motor", J=1.0),
        pt.SpringDamper("coupling", "motor", "load", stiffness=0.0, damping=2.0),
        pt.Inertia("load", J=4.0),
        pt.Drag("bearing", "load", damping=1.0),
    )
    G = pt.state_space(car, "motor_torque", ["load_angle", "motor_speed"])
    assert G.state_labels == ["motor_rigid_speed", "load_rigid_speed", "load_rigid_angle"]
    np.testing.assert_allclose(pt.static_gain(car, "motor_torque", ["motor_speed", "load_speed"])[:, 0], [1.5, 1.0])
    assert pt.static_gain(car, "motor_torque", "load_angle")[0, 0] == np.inf
    for omega in (0.1, 3.0):
        s = 1j * omega
        by_hand = np.linalg.solve([[s + 2.0, -2.0], [-2.0, 4.0 * s + 3.0]], [1.0, 0.0])
        np.testing.assert_allclose(transfer(G, s)[:, 0], [by_hand[1] / s, by_hand[0]], rtol=1e-12)


def test_an_angle_that_comes_to_rest_has_a_finite_gain():
    # a torque on the body between drag and spring turns that body to rest; the dragged one has turned by the damper's push
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.SpringDamper("between", "a", "b", stiffness=0.0, damping=2.0),
        pt.Inertia("b", J=1.0),
        pt.Drag("drag", "a", damping=3.0),
        pt.Drag("hold", "b", damping=0.0, stiffness=50.0),
    )
    # b comes to 1/50 rad; momentum of a: 2 (angle_b - angle_a) = 3 angle_a
    by_hand = 2.0 / 5.0 / 50.0
    assert pt.static_gain(car, "b_torque", "a_angle")[0, 0] == pytest.approx(by_hand, rel=1e-12)
    assert float(pt.state_space(car, "b_torque", "a_angle").dcgain()) == pytest.approx(by_hand, rel=1e-9)
