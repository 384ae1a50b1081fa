"""Matrices, names and the topology that is refused.

Of linear/admissible.
"""

import by_hand
import numpy as np
import pytest
from hypothesis import given
from strategies import drivelines

import powertrain_ctrl as pt


@given(drivelines())
def test_matrices_are_symmetric_and_semidefinite(car):
    m = pt.assemble(car)
    for X in (m.M, m.D, m.K):
        np.testing.assert_array_equal(X, X.T)
    assert (np.linalg.eigvalsh(m.M) > 0.0).all()
    for X in (m.D, m.K):
        assert np.linalg.eigvalsh(X)[0] >= -1e-12 * np.abs(X).max()
    for X, values in ((m.K, m.stiffness), (m.D, m.damping)):
        np.testing.assert_allclose(X, m.F.T @ np.diag(values) @ m.F, rtol=1e-12, atol=1e-12 * np.abs(X).max())


@given(drivelines())
def test_matrices_are_those_of_a_dense_road(car):
    m, other = pt.assemble(car), by_hand.matrices(car)
    # the coordinates of the one in those of the other: both bases span the motions the constraints leave
    Z = other.Z[[other.nodes.index(node) for node in m.nodes]]
    change = np.linalg.lstsq(Z, m.T, rcond=None)[0]
    np.testing.assert_allclose(Z @ change, m.T, atol=1e-12 * np.abs(m.T).max())
    for X, Y in ((m.M, other.M), (m.D, other.D), (m.K, other.K)):
        expected = change.T @ Y @ change
        np.testing.assert_allclose(X, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max(initial=1e-300))


def test_gear_gives_the_factors_of_equation_2_1():
    m = pt.assemble(
        pt.Driveline(
            pt.Inertia("k", J=1.0),
            pt.Inertia("l", J=8.0),
            pt.Gear("gear", "k", "shaft", ratio=2.0),
            pt.SpringDamper("s", "shaft", "l", stiffness=40.0),
        )
    )
    reflected = np.diag(m.rigid_motion[[m.nodes.index(c) for c in m.coordinates]])
    np.testing.assert_allclose(reflected @ m.M @ reflected, np.diag([1.0, 8.0 / 4.0]))
    np.testing.assert_allclose(reflected @ m.K @ reflected, 40.0 / 4.0 * np.array([[1.0, -1.0], [-1.0, 1.0]]))


def test_external_gear_turns_the_other_way():
    m = pt.assemble(pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=4.0), pt.Gear("mesh", "a", "b", ratio=-2.0)))
    np.testing.assert_allclose(m.T[:, 0], [1.0, -0.5])
    assert m.M[0, 0] == 2.0


def test_gear_on_a_moving_support_is_a_row_of_three():
    m = pt.assemble(
        pt.Driveline(
            *(pt.Inertia(name, J=1.0) for name in ("a", "b", "support")),
            pt.Constraint("mesh", {"a": 1.0, "b": -3.0, "support": 2.0}),
        )
    )
    speed = m.T @ np.array([6.0, 0.0][: m.T.shape[1]])
    a, b, support = (speed[m.nodes.index(n)] for n in ("a", "b", "support"))
    assert a - 3.0 * b + 2.0 * support == pytest.approx(0.0, abs=1e-14)
    assert m.M.shape == (2, 2)


def test_tyre_row_gives_equations_2_5_to_2_7():
    m = pt.assemble(
        pt.Driveline(
            pt.Inertia("wheel", J=4.0),
            pt.Tyre("tyre", "wheel", "vehicle", radius=0.5, stiffness=1000.0, damping=8.0),
            pt.Mass("vehicle", m=100.0),
        )
    )
    assert (m.stiffness[0], m.damping[0]) == (250.0, 2.0)
    total = m.rigid_motion @ m.J @ m.rigid_motion
    assert total == pytest.approx(4.0 + 100.0 * 0.25)


def test_consistent_gears_in_a_loop_are_redundant_not_wrong():
    bodies = [pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0)]
    twice = pt.Driveline(*bodies, pt.Gear("g1", "a", "b", ratio=3.0), pt.Gear("g2", "b", "a", ratio=1.0 / 3.0))
    assert len(pt.assemble(twice).coordinates) == 1


@pytest.mark.parametrize("order", [1, -1])
def test_contradicting_gears_are_standstill(order):
    bodies = [pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0)]
    gears = [pt.Gear("first", "a", "b", ratio=3.0), pt.Gear("second", "a", "b", ratio=2.0)][::order]
    with pytest.raises(pt.TopologyError, match=r"(first|second) holds a, b at standstill together with (first|second)"):
        pt.assemble(pt.Driveline(*bodies, *gears))


def test_both_clutches_of_a_dual_clutch_gearbox_locked_are_standstill():
    car = pt.Driveline(
        pt.Inertia("engine", J=1.0),
        pt.Inertia("output", J=1.0),
        *(pt.Inertia(f"shaft{i}", J=0.1) for i in (1, 2)),
        *(pt.Clutch(f"clutch{i}", "engine", f"shaft{i}", max_torque=100.0) for i in (1, 2)),
        pt.Gear("gear1", "shaft1", "output", ratio=4.0),
        pt.Gear("gear2", "shaft2", "output", ratio=2.0),
    )
    with pytest.raises(pt.TopologyError, match="clutch2 holds engine, shaft2 at standstill together with clutch1"):
        pt.assemble(car.lock())
    assert len(pt.assemble(car.release("clutch2")).coordinates) == 1


def test_standstill_names_what_takes_part_and_nothing_else():
    car = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in "abcde"),
        pt.Gear("ab", "a", "b", ratio=2.0),
        pt.Gear("bc", "b", "c", ratio=3.0),
        pt.Gear("de", "d", "e", ratio=5.0),
        pt.SpringDamper("shaft", "c", "d", stiffness=10.0),
        pt.Gear("ca", "c", "a", ratio=1.0 / 7.0),
    )
    with pytest.raises(pt.TopologyError, match="ca holds c, a at standstill together with ab, bc;") as error:
        pt.assemble(car)
    assert isinstance(error.value, ValueError)
    assert len(pt.assemble(car.replace("ca", ratio=1.0 / 6.0)).coordinates) == 2


def test_a_node_that_only_constraints_touch_needs_inertia_from_somewhere():
    bodies = [pt.Inertia("a", J=1.0)]
    gears = [pt.Gear("g", "a", "x", ratio=2.0), pt.Planetary("p", "x", "y", "z", ratio=2.0)]
    with pytest.raises(pt.TopologyError, match=r'node "[yz]" has no inertia; give it an Inertia or merge the springs'):
        pt.assemble(pt.Driveline(*bodies, *gears))
    assert len(pt.assemble(pt.Driveline(*bodies, *gears, pt.Inertia("y", J=1.0))).coordinates) == 2


def test_a_braked_shaft_is_no_contradiction():
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("b", J=1.0),
        pt.Inertia("c", J=1.0),
        pt.Clutch("brake", "a", max_torque=100.0),
        pt.Gear("gear", "a", "b", ratio=2.0),
        pt.SpringDamper("shaft", "b", "c", stiffness=10.0),
    )
    assert pt.assemble(car).coordinates == ("c",)
    assert pt.modes(car).omega[0] == pytest.approx(np.sqrt(10.0))


@pytest.mark.parametrize("order", [1, -1])
def test_gears_that_disagree_are_no_contradiction_on_a_shaft_at_rest(order):
    elements = [
        pt.Gear("first", "a", "b", ratio=3.0),
        pt.Gear("second", "a", "b", ratio=2.0),
        pt.Clutch("brake", "a", max_torque=1.0),
    ]
    bodies = [pt.Inertia(name, J=2.0) for name in "abc"]
    car = pt.Driveline(*bodies, *elements[::order], pt.SpringDamper("shaft", "b", "c", stiffness=50.0))
    assert pt.modes(car).omega == pytest.approx([5.0])
    with pytest.raises(pt.TopologyError, match="at standstill"):
        pt.assemble(car.release("brake"))


def test_everything_braked_is_named():
    car = pt.Driveline(pt.Inertia("a", J=1.0), pt.Clutch("brake", "a", max_torque=1.0))
    with pytest.raises(pt.TopologyError, match="every node is held at rest by brake"):
        pt.assemble(car)


def test_massless_side_of_an_open_clutch_is_named():
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("c", J=1.0),
        pt.Clutch("clutch", "a", "flange", max_torque=1.0),
        pt.SpringDamper("shaft", "flange", "c", stiffness=10.0),
    )
    assert pt.modes(car).n_rigid == 1
    with pytest.raises(pt.TopologyError, match='node "flange" has no inertia'):
        pt.modes(car.release())


def test_only_drivelines_are_assembled():
    with pytest.raises(pt.PowertrainError, match="expected a Driveline or a TwoMass, got 3"):
        pt.modes(3)
