"""A driveline referred to one node: the source's (2.1) to (2.7), a published car, and invariance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from strategies import trees

import powertrain_ctrl as pt


def test_the_source_s_car_is_its_chain_of_seven():
    gear, total, r = 6.0, 18.0, 0.35
    chain = pt.reflected(pt.examples.conventional(damping="closed"), "engine")
    inertias = [0.3, 0.05, 0.09 + 0.01, 0.03, 0.05 / gear**2, 4.0 / total**2, 2000.0 * r**2 / total**2]
    springs = [2e3, 5e4, 1e6, 1e6 / gear**2, 3.44e4 / total**2, 9.8e5 * r**2 / total**2]
    dampers = [1.46, 0.5, 10.0, 10.0 / gear**2, 417.6 / total**2, 11897.0 * r**2 / total**2]
    bodies = [e for e in chain if isinstance(e, pt.Inertia)]
    shafts = [e for e in chain if isinstance(e, pt.SpringDamper)]
    assert len(bodies) + len(shafts) == len(chain)
    np.testing.assert_allclose([e.J for e in bodies], inertias, rtol=1e-14)
    np.testing.assert_allclose([e.stiffness for e in shafts], springs, rtol=1e-14)
    np.testing.assert_allclose([e.damping for e in shafts], dampers, rtol=1e-14)


def test_the_part_behind_the_open_clutch_is_a_chain_of_five():
    part = pt.examples.conventional().release("clutch").part("vehicle")
    chain = pt.reflected(part)
    assert [e.name for e in chain if isinstance(e, pt.Inertia)] == [
        "clutch_secondary",
        "transmission",
        "differential",
        "wheels",
        "vehicle",
    ]
    np.testing.assert_allclose(pt.modes(chain).omega, pt.modes(part).omega, rtol=1e-12)


def test_the_front_wheel_drive_car_has_its_published_values_at_the_wheels():
    # B. Mason, TTC066: "all rotations are referred to angles measured downstream of final drive ratio"
    chain = pt.reflected(pt.examples.front_wheel_drive(), "wheels")
    published = {"engine": 13.724939142, "transmission": 0.4178308668, "wheels": 1.8176, "vehicle": 121.42235}
    for name, J in published.items():
        assert chain[name].J == pytest.approx(J, rel=1e-9)
    assert chain["clutch_springs"].stiffness == pytest.approx(50642.61, rel=1e-4)
    assert chain["clutch_springs"].damping == pytest.approx(65.512836, rel=1e-9)
    assert chain["tyres"].damping == pytest.approx(1400.0, rel=1e-6)


@given(trees(), st.data())
def test_poles_do_not_change_and_inertia_is_that_of_the_rigid_motion(car, data):
    reference = data.draw(st.sampled_from(car.nodes))
    chain = pt.reflected(car, reference)
    np.testing.assert_allclose(np.abs(pt.poles(chain)), np.abs(pt.poles(car)), rtol=1e-6, atol=1e-6)
    model = pt.assemble(car)
    motion = model.rigid_motion / model.rigid_motion[model.nodes.index(reference)]
    assert sum(e.J for e in chain if isinstance(e, pt.Inertia)) == pytest.approx(motion @ model.J @ motion, rel=1e-9)


def test_ground_brakes_and_open_clutches_are_reflected_too():
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Gear("gear", "a", "b", ratio=-3.0),
        pt.Inertia("b", J=2.0),
        pt.SpringDamper("shaft", "b", "c", stiffness=90.0, damping=0.9),
        pt.Inertia("c", J=4.0),
        pt.Drag("bearing", "c", damping=1.8, stiffness=0.9),
        pt.Clutch("brake", "c", max_torque=60.0, static_ratio=1.2),
        pt.Clutch("slipping", "b", "c", max_torque=12.0),
    ).release()
    chain = pt.reflected(car, "a")
    assert chain["bearing"].damping == pytest.approx(0.2)
    assert chain["bearing"].stiffness == pytest.approx(0.1)
    assert chain["brake"].max_torque == pytest.approx(20.0)
    assert chain["slipping"].max_torque == pytest.approx(4.0)
    assert chain.released == {"brake", "slipping"}
    t = np.linspace(0.0, 3.0, 301)
    inputs = {"brake_capacity": 60.0, "slipping_capacity": 12.0}
    direct = pt.simulate(car, t, inputs, {"a": 30.0})
    seen = pt.simulate(chain, t, {"brake_capacity": 20.0, "slipping_capacity": 4.0}, {"a": 30.0})
    np.testing.assert_allclose(seen["a_speed"], direct["a_speed"], atol=1e-9)
    np.testing.assert_allclose(seen["c_speed"], -3.0 * direct["c_speed"], atol=1e-9)
    assert seen.slip_energy["brake"] == pytest.approx(direct.slip_energy["brake"], rel=1e-9)


def test_what_has_no_single_ratio_is_refused():
    with pytest.raises(pt.TopologyError, match=r'not every node is connected with "engine"; take car\.part'):
        pt.reflected(pt.examples.conventional().release("clutch"), "engine")
    free = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in ("sun", "ring", "carrier")),
        pt.Planetary("gears", "sun", "ring", "carrier", ratio=2.0),
    )
    with pytest.raises(pt.TopologyError, match="no single ratio"):
        pt.reflected(free)
    with pytest.raises(pt.UnknownNameError, match='node "motor"'):
        pt.reflected(pt.examples.conventional(), "motor")
    shaft = pt.Driveline(
        pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Shaft("shaft", "a", "b", stiffness=9.0, inertia=0.6)
    )
    with pytest.raises(pt.TopologyError, match="a and b share inertia"):
        pt.reflected(shaft)


def test_without_a_reference_the_first_node_is_it():
    car = pt.Driveline(
        pt.Inertia("engine", J=0.3),
        pt.Gear("gearbox", "engine", "axle", ratio=4.0),
        pt.SpringDamper("shaft", "axle", "wheels", stiffness=8e3),
        pt.Inertia("wheels", J=3.2),
    )
    assert [e.J for e in pt.reflected(car) if isinstance(e, pt.Inertia)] == pytest.approx([0.3, 3.2 / 16], rel=1e-14)
    backwards = pt.Driveline(*reversed(tuple(car)))
    at_first = [e.J for e in pt.reflected(backwards) if isinstance(e, pt.Inertia)]
    assert sorted(at_first) == pytest.approx(sorted([3.2, 0.3 * 16]), rel=1e-14)
