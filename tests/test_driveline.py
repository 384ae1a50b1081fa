"""The checked collection of elements."""

import re

import pytest
from hypothesis import given
from strategies import drivelines

import powertrain_ctrl as pt


def car():
    return pt.examples.conventional()


def pair(*extra):
    return pt.Driveline(
        pt.Inertia("engine", J=1.0),
        pt.Inertia("wheel", J=2.0),
        pt.SpringDamper("shaft", "engine", "wheel", stiffness=3.0),
        *extra,
    )


def test_nodes_with_inertia_come_first():
    assert car().nodes == (
        *("engine", "torsional_damper", "clutch_primary", "clutch_secondary"),
        *("transmission", "differential", "wheels", "vehicle", "gearbox_output", "final_drive_output"),
    )


def test_replace_makes_a_copy():
    before = pair()
    after = before.replace("shaft", stiffness=4.0)
    assert (before["shaft"].stiffness, after["shaft"].stiffness) == (3.0, 4.0)
    assert before != after
    assert before == after.replace("shaft", stiffness=3.0)


def test_clutch_state_survives_replace_and_goes_with_part():
    released = car().release("clutch")
    assert released.replace("gearbox", ratio=3.0).released == {"clutch"}
    assert released.lock("clutch") == car()
    part = released.part("vehicle")
    assert "clutch" not in part
    assert part.nodes[:5] == ("clutch_secondary", "transmission", "differential", "wheels", "vehicle")
    assert car().part("wheels") == car()


def test_an_open_clutch_tears_the_driveline_in_two():
    assert [len(part) for part in car().release("clutch").parts()] == [3, 7]


WRONG = [
    (lambda: pair(pt.Inertia("engine", J=1.0)), 'the name "engine" is given twice'),
    (lambda: pair(pt.Gear("shaft", "engine", "x", ratio=1.0)), 'the name "shaft" is given twice'),
    (lambda: pair(pt.SpringDamper("s", "engine", "shaft", stiffness=1.0)), '"shaft" is a node of "s"'),
    (
        lambda: pair(pt.SpringDamper("s", "engin", "wheel", stiffness=1.0)),
        'node "engin" of s has no inertia; give it an Inertia or merge the springs on either side; '
        'did you mean "engine"?',
    ),
    (lambda: pt.Driveline(), "a driveline needs at least one Inertia or Mass"),
    (lambda: pt.Driveline("engine"), "a driveline is made of elements, got 'engine'"),
    (
        lambda: pt.Driveline(*(pt.Inertia(n, J=1.0) for n in "ab"), pt.Tyre("tyre", "a", "b", radius=0.3)),
        'tyre: its body "b" turns, permitted: a Mass',
    ),
    (
        lambda: pair(pt.Mass("body", m=1.0), pt.SpringDamper("s", "wheel", "body", stiffness=1.0)),
        "s: connects turning and moving nodes wheel and body; use a Tyre between them",
    ),
    (lambda: pair()["shft"], 'element "shft" is not in this driveline; did you mean "shaft"?'),
    (lambda: pair().replace("shaft", stifness=1.0), 'shaft has no parameter "stifness"; did you mean "stiffness"?'),
    (lambda: pair().replace("shaft", name="shift"), 'shaft has no parameter "name"; there is a, b, stiffness, damping'),
    (lambda: pair().replace("shaft", stiffness=-1.0), "shaft: stiffness = -1.0 N m/rad"),
    (lambda: car().release("cluch"), 'clutch "cluch" is not in this driveline; did you mean "clutch"?'),
    (lambda: car().part("wheel"), 'node "wheel" is not in this driveline; did you mean "wheels"?'),
]


@pytest.mark.parametrize(("make", "message"), WRONG)
def test_what_is_wrong_is_named(make, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)) as error:
        make()
    assert isinstance(error.value, ValueError)


@given(drivelines())
def test_parts_share_out_the_nodes_and_stand_alone(car):
    open_car = car.release() if car.clutches else car
    parts = open_car.parts()
    assert sorted(node for part in parts for node in part) == sorted(car.nodes)
    # a tree: each open clutch cuts once, unless a spring goes round it
    assert len(car.parts()) == 1
    assert len(parts) <= 1 + len(car.clutches)
    for part in parts:
        alone = open_car.part(next(iter(part)))
        assert set(alone.nodes) == part
        # an open clutch with both ends in the part stays, and stays open
        assert alone.released == {name for name in car.clutches if part.issuperset(car[name].nodes)}


@given(drivelines())
def test_equal_drivelines_hash_equal_and_any_change_tells(car):
    again = pt.Driveline(*car.elements)
    assert (again, hash(again)) == (car, hash(car))
    assert car.replace("J0", J=2 * car["J0"].J) != car
    if car.clutches:
        assert car.release() != car
        assert car.release().lock() == car


def test_prints_with_units():
    assert "stiffness = 34400 N m/rad" in repr(car())
    assert "Clutch (released)" in repr(car().release("clutch"))
