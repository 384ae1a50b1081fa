"""A planetary gear with one member held is a gear, for everything that sees a driveline from one of its nodes."""

import numpy as np
import pytest

import powertrain_ctrl as pt

# Willis, ring at rest: omega_sun = (1 + i0) omega_carrier
I0 = 1.7
HELD = {
    "brake": [pt.Clutch("band", "ring", max_torque=900.0)],
    "constraint": [pt.Constraint("band", {"ring": 1.0})],
    "brake behind a shaft": [
        pt.SpringDamper("reaction", "ring", "drum", stiffness=1e9),
        pt.Inertia("drum", J=0.1),
        pt.Clutch("band", "drum", max_torque=900.0),
    ],
}


def car(*middle):
    return pt.Driveline(
        pt.Inertia("engine", J=0.3),
        pt.SpringDamper("damper", "engine", "turbine", stiffness=2e3, damping=3.0),
        pt.Inertia("turbine", J=0.05),
        *middle,
        pt.Inertia("carrier", J=0.03),
        pt.Gear("final", "carrier", "axle", ratio=4.0),
        pt.SpringDamper("half", "axle", "wheels", stiffness=12e3, damping=60.0),
        pt.Inertia("wheels", J=2.0),
        pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=4e5, damping=3e3),
        pt.Mass("vehicle", m=1500.0),
    )


def automatic(held):
    planet = pt.Planetary("planet", "turbine", "ring", "carrier", ratio=I0)
    return car(pt.Inertia("ring", J=0.02), planet, *HELD[held])


GEARED = car(pt.Gear("planet", "turbine", "carrier", ratio=1.0 + I0))


@pytest.mark.parametrize("method", ["modal", "source", "series", "fit"])
@pytest.mark.parametrize("held", ["brake", "constraint"])
def test_two_masses_are_those_of_the_gear(held, method):
    mine, theirs = pt.two_mass(automatic(held), method), pt.two_mass(GEARED, method)
    for name in ("J1", "J2", "stiffness", "damping", "ratio", "radius", "rim_share"):
        assert getattr(mine, name) == pytest.approx(getattr(theirs, name), rel=1e-12 if method != "fit" else 1e-9)


def test_a_ring_held_behind_a_shaft_is_nearly_that():
    mine, theirs = pt.two_mass(automatic("brake behind a shaft")), pt.two_mass(GEARED)
    for name in ("J1", "J2", "stiffness", "damping", "ratio", "radius"):
        assert getattr(mine, name) == pytest.approx(getattr(theirs, name), rel=1e-4)  # the shaft gives way by 1e-5
    assert mine.ratio == pytest.approx(4.0 * (1.0 + I0), rel=1e-12)


@pytest.mark.parametrize("held", ["brake", "constraint"])
def test_reflection_shapes_and_state_space_are_those_of_the_gear(held):
    mine = automatic(held)
    np.testing.assert_allclose(pt.poles(pt.reflected(mine)), pt.poles(GEARED), atol=1e-9)
    shapes, expected = pt.modes(mine), pt.modes(GEARED)
    assert not shapes.reflected_shapes[shapes.nodes.index("ring")].any()
    for node in expected.nodes:
        row, wanted = shapes.nodes.index(node), expected.nodes.index(node)
        np.testing.assert_allclose(
            shapes.reflected_shapes[row], expected.reflected_shapes[wanted], rtol=1e-12, atol=1e-14
        )
    names = {"inputs": "engine_torque", "outputs": ["wheels_speed", "half_torque"]}
    for options in ({"coordinates": "angle", "reference": "engine"}, {}):
        A, B = (pt.state_space(each, **names, **options) for each in (mine, GEARED))
        np.testing.assert_allclose(A(3j), B(3j), rtol=1e-12)


@pytest.mark.parametrize("held", ["brake", "constraint"])
def test_controllers_and_margins_are_those_of_the_gear(held):
    mine, theirs = pt.SampledPlant(car=automatic(held)), pt.SampledPlant(car=GEARED)
    assert mine.ratio == pytest.approx(theirs.ratio, rel=1e-12)
    for name, controller in pt.antijerk.designs(mine).items():
        expected = pt.antijerk.designs(theirs)[name]
        z = np.exp(0.4j)
        np.testing.assert_allclose(controller(z), expected(z), rtol=1e-9)
        assert pt.loop_margins(mine, controller).disk_margin == pytest.approx(
            pt.loop_margins(theirs, expected).disk_margin, rel=1e-6
        )


def power_split(held):
    """Sun on the first machine, ring on the second and the wheels, carrier on the engine."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.18),
        pt.Inertia("generator", J=0.023),
        pt.Inertia("motor", J=0.023),
        pt.Planetary("split", "generator", "motor", "engine", ratio=2.6),
        pt.Gear("final", "motor", "axle", ratio=4.1),
        pt.SpringDamper("half", "axle", "wheels", stiffness=6.5e3, damping=40.0),
        pt.Inertia("wheels", J=2.0),
        pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=5e5, damping=2e3),
        pt.Mass("vehicle", m=1500.0),
        pt.Constraint("hold", {held: 1.0}),
    )


@pytest.mark.parametrize(
    ("held", "driving", "ratio", "inertia"),
    [
        # engine at rest: generator = -2.6 motor; generator at rest: 3.6 engine = 2.6 motor
        ("engine", "generator", -2.6 * 4.1, 0.023 + 0.023 / 2.6**2),
        ("generator", "engine", 2.6 / 3.6 * 4.1, 0.18 + 0.023 * (3.6 / 2.6) ** 2),
    ],
)
def test_a_power_split_with_one_member_held_is_driven_by_what_moves(held, driving, ratio, inertia):
    model = pt.two_mass(power_split(held), "series")
    assert (model.driving, model.ratio) == (driving, pytest.approx(ratio, rel=1e-12))
    assert model.J1 == pytest.approx(inertia, rel=1e-12)
    plant = pt.SampledPlant(car=power_split(held))
    assert (plant.engine, plant.ratio) == (driving, pytest.approx(ratio, rel=1e-12))


def test_a_spring_to_a_node_at_rest_is_a_spring_to_ground():
    mount = [
        pt.Inertia("frame", J=1.0),
        pt.Clutch("lock", "frame", max_torque=1.0),
        pt.SpringDamper("mount", "engine", "frame", stiffness=50.0, damping=1.0),
    ]
    ground = pt.Drag("mount", "engine", stiffness=50.0, damping=1.0)
    mine, theirs = pt.Driveline(*GEARED, *mount), pt.Driveline(*GEARED, ground)
    np.testing.assert_allclose(pt.poles(mine), pt.poles(theirs), rtol=1e-9)
    np.testing.assert_allclose(pt.poles(pt.reflected(mine)), pt.poles(pt.reflected(theirs)), rtol=1e-9)


def test_without_a_hold_the_message_names_what_turns_for_itself():
    spring = pt.Drag("band", "ring", stiffness=1e6, damping=0.0)
    loose = car(pt.Inertia("ring", J=0.02), pt.Planetary("planet", "turbine", "ring", "carrier", ratio=I0), spring)
    with pytest.raises(pt.TopologyError, match="it turns with engine and with ring, each for itself; hold one of them"):
        pt.two_mass(loose)


def test_nothing_is_seen_from_a_node_at_rest():
    with pytest.raises(pt.TopologyError, match='"ring" rests when everything turns as one body'):
        pt.reflected(automatic("brake"), "ring")
    two = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("wheels", J=1.0),
        pt.SpringDamper("s", "a", "wheels", stiffness=5.0),
        pt.Inertia("b", J=1.0),
        pt.SpringDamper("t", "a", "b", stiffness=5.0),
        pt.Clutch("brake", "wheels", max_torque=1.0),
    )
    with pytest.raises(pt.TopologyError):
        pt.two_mass(two)


def test_what_rests_in_the_rigid_motion_but_moves_with_a_mode_stays_as_it_is_in_the_reflected_state():
    # the ring gives way by its shaft: it has a state, and no ratio to reflect it by
    mine = automatic("brake behind a shaft")
    names = {"inputs": "engine_torque", "outputs": ["wheels_speed", "reaction_torque"]}
    angle = pt.state_space(mine, **names, coordinates="angle", reference="engine")
    twist = pt.state_space(mine, **names)
    assert np.isfinite(angle.A).all()
    for omega in (3.0, 60.0, 900.0):
        s = 1j * omega
        found, expected = (G.C @ np.linalg.solve(s * np.eye(G.nstates) - G.A, G.B) + G.D for G in (angle, twist))
        np.testing.assert_allclose(found, expected, rtol=1e-6)
