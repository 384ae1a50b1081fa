"""Lines of a picture are the springs, gears and locked clutches of the driveline."""

from itertools import pairwise

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.plots.shapes import branches


def gear_pair(*more, driven="output"):
    return pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in ("motor", "odd", "even", "output")),
        pt.Clutch("odd_clutch", "motor", "odd", max_torque=100.0),
        pt.Clutch("even_clutch", "motor", "even", max_torque=100.0),
        pt.Gear("odd_gear", "odd", "output", ratio=4.0),
        pt.Gear("even_gear", "even", "output", ratio=2.0),
        pt.SpringDamper("shaft", driven, "load", stiffness=100.0),
        pt.Inertia("load", J=5.0),
        *more,
    )


@pytest.mark.parametrize(("locked", "idle"), [("odd", "even"), ("even", "odd")])
def test_of_two_gears_the_idle_one_hangs_at_the_shaft_behind_and_is_no_link_of_the_chain(locked, idle):
    modes = pt.modes(gear_pair().release().lock(f"{locked}_clutch"))
    assert set(map(frozenset, modes.links)) == {
        frozenset(pair) for pair in (("motor", locked), (locked, "output"), (idle, "output"), ("output", "load"))
    }
    place, branch = branches(list(modes.nodes), modes.links)
    assert place == {"motor": 0, locked: 1, "output": 2, idle: 3, "load": 3}
    assert branch["motor"] == branch[locked] == branch["output"] == 0
    assert {branch[idle], branch["load"]} == {0, 1}


def test_the_hybrid_s_shafts_are_two_ways_to_the_output_shaft():
    links = set(map(frozenset, pt.modes(pt.examples.p2_hybrid(2)).links))
    assert frozenset(("odd_shaft", "even_shaft")) not in links
    assert {frozenset((f"{each}_shaft", "output_shaft")) for each in ("odd", "even")} <= links
    assert frozenset(("emachine", "even_shaft")) in links


def test_a_spring_ends_at_its_own_node_of_those_that_turn_together():
    """The idle shaft drives something: it is its line, though the output shaft is nearer to it by its number."""
    car = gear_pair(pt.SpringDamper("pump_shaft", "odd", "pump", stiffness=10.0), pt.Inertia("pump", J=0.1))
    links = set(map(frozenset, pt.modes(car.release().lock("even_clutch")).links))
    assert frozenset(("odd", "pump")) in links
    assert frozenset(("output", "pump")) not in links


def test_nodes_without_inertia_are_passed_over():
    """From a motor over two gears in a row with nothing between them, to a shaft that begins at a bare node."""
    car = pt.Driveline(
        pt.Inertia("motor", J=1.0),
        pt.Gear("first", "motor", "between", ratio=3.0),
        pt.Gear("second", "between", "axle", ratio=2.0),
        pt.Inertia("axle", J=1.0),
        pt.Gear("third", "axle", "bare", ratio=2.0),
        pt.SpringDamper("shaft", "bare", "wheel", stiffness=50.0),
        pt.Inertia("wheel", J=1.0),
    )
    assert pt.modes(car).links == (("motor", "axle"), ("axle", "wheel"))


def test_a_planetary_gear_with_its_ring_held_joins_sun_and_carrier():
    car = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in ("carrier", "load", "sun")),
        pt.Planetary("planetary", "sun", "ring", "carrier", ratio=2.5),
        pt.Constraint("held", {"ring": 1.0}),
        pt.SpringDamper("shaft", "carrier", "load", stiffness=50.0),
    )
    assert set(map(frozenset, pt.modes(car).links)) == {frozenset(("sun", "carrier")), frozenset(("carrier", "load"))}


@pytest.mark.parametrize("locked", [("a_b", "b_c"), ("a_b", "b_c", "a_c")])
def test_rigid_connections_never_make_a_loop(locked):
    """Three discs and three clutches, two of which hold them all."""
    pairs = {"a_b": ("a", "b"), "b_c": ("b", "c"), "a_c": ("a", "c")}
    car = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in "abc"),
        *(pt.Clutch(name, *ends, max_torque=10.0) for name, ends in pairs.items()),
        pt.SpringDamper("shaft", "c", "d", stiffness=9.0),
        pt.Inertia("d", J=1.0),
    )
    car = car.release().lock(*locked)
    assert len(pt.modes(car).links) == 3


@pytest.mark.parametrize("make", [pt.examples.conventional, pt.examples.electric, pt.examples.truck])
def test_a_chain_stays_a_chain(make):
    modes = pt.modes(make())
    heavy = [node for node, moves in zip(modes.nodes, np.any(modes.kinetic_energy, axis=1), strict=True) if moves]
    assert modes.links == tuple(pairwise(heavy))
