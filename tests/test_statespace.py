"""control.StateSpace in twists and in angles."""

import re

import control
import numpy as np
import pytest
from hypothesis import given, settings
from strategies import trees

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


def test_a_pure_damper_has_no_twist_but_a_torque():
    car = pt.examples.front_wheel_drive()
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
    ({"outputs": []}, "permitted: at least one signal, each once"),
    ({"inputs": ["engine_torque"] * 2}, "permitted: at least one signal, each once"),
    ({"coordinates": "modal"}, 'coordinates = \'modal\', permitted: "twist", "angle"'),
    ({"reference": "engine"}, 'reference is for coordinates="angle"'),
    ({"coordinates": "angle", "reference": "motor"}, 'signal "motor" is not'),
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
