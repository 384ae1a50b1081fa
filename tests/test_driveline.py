"""The checked collection of elements.

Of driveline/collection, driveline/consistency.
"""

import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given
from strategies import drivelines

import powertrain_ctrl as pt
from powertrain_ctrl.elements import ConstraintRow, Element


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
    (lambda: pt.Clutch("clutch", "engine", "gearbox"), "Clutch: not given: max_torque=..."),
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
    (lambda: pt.Driveline([pt.Inertia("a", J=1.0)]), "of a list: Driveline(*list)"),
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


@pytest.mark.parametrize(
    ("read", "hint"),
    [
        (lambda: car().clutch, "has no attribute 'clutch'; it is in brackets, [\"clutch\"]"),
        (lambda: pt.load_change(car()).wheels_speed, 'it is in brackets, ["wheels_speed"]'),
        (lambda: pt.load_change(car())["time"], "whose times are response.time"),
        (lambda: pt.modes(car()).freq, 'did you mean "frequency_hz"?'),
        (lambda: pt.modes(car()).zeta, 'did you mean "damping_ratio"?'),
        (lambda: pt.modes(car()).shape, 'did you mean "shapes"?'),
        (lambda: car().poles(), "it is a function, pt.poles(...)"),
        (lambda: pt.SampledPlant(car=car()).delai, 'did you mean "delay"?'),
    ],
)
def test_what_is_looked_for_in_the_wrong_place_says_where_it_is(read, hint):
    with pytest.raises((AttributeError, pt.UnknownNameError), match=re.escape(hint)):
        read()


@pytest.mark.parametrize(
    ("read", "hint"),
    [
        (lambda: pt.modes(car())[1], "frequency_hz[1]"),
        (lambda: list(pt.modes(car())), "shapes[:, 0]"),
        (lambda: pt.family(car(), {"vehicle.m": [1500.0, 1800.0]})[1], "family.car(1)"),
        (lambda: car() + pt.Inertia("flywheel", J=0.1), "pt.Driveline(*car, element)"),
    ],
)
def test_what_python_would_write_otherwise_says_how_it_is_written(read, hint):
    with pytest.raises(TypeError, match=re.escape(hint)):
        read()


def test_an_attribute_that_is_like_nothing_has_no_hint():
    with pytest.raises(AttributeError, match=r"'Driveline' object has no attribute 'foo'$"):
        getattr(car(), "foo")  # noqa: B009


@pytest.mark.parametrize(
    ("package", "wrong", "hint"),
    [
        (pt.examples, "electrics", 'did you mean "electric"?'),
        (pt.antijerk, "tun", 'did you mean "tune"?'),
        (pt.plots, "bodes", 'did you mean "bode"?'),
        (pt.orders, "vibe", 'did you mean "wiebe"?'),
        (pt.studies, "robustnes", 'did you mean "robustness"?'),
        (pt.export, "simulink", "there is c_plant, fmu, json, load, mat"),
    ],
)
def test_a_name_that_a_package_does_not_have_is_met_with_what_it_has(package, wrong, hint):
    with pytest.raises(AttributeError, match=f"has no attribute '{wrong}'; {re.escape(hint)}"):
        getattr(package, wrong)
    assert not hasattr(package, "__wrapped__")


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


def test_variations_of_a_car_have_hashes_of_their_own():
    """Values count, so that what is kept of drivelines is found without comparing them one by one."""
    plant = pt.SampledPlant(car=car())
    cars = {plant.car for plant in pt.studies.variations(plant).values()}
    assert len({hash(each) for each in cars}) == len(cars) > 10


def test_the_hash_follows_equality():
    """Order, number and clutch state count, the sign of a zero and the kind of a number do not."""
    first, second, shaft = pair().elements
    assert pt.Driveline(second, first, shaft) != pair()
    assert hash(pt.Driveline(second, first, shaft)) != hash(pair())
    assert pair(pt.Drag("bearing", "wheel", damping=1.0)) != pair()
    assert pair() != pair(pt.Drag("bearing", "wheel", damping=1.0))
    assert hash(car().release("clutch")) != hash(car())
    for damping in (0, 0.0, -0.0, np.float32(0.0)):
        same = pair().replace("shaft", damping=damping)
        assert (same, hash(same)) == (pair(), hash(pair()))


@dataclasses.dataclass(frozen=True)
class Table(Element):
    """An element of one's own whose values have no hash: a gear of the mean ratio of a table."""

    ratios: object = ()

    @property
    def nodes(self):
        return ("wheel", "axle")

    @property
    def constraints(self):
        return (ConstraintRow(self.name, {"wheel": 1.0, "axle": -float(np.mean(self.ratios))}),)


@pytest.mark.parametrize("kind", [list, np.array])
def test_an_element_of_ones_own_need_not_have_a_hash(kind):
    """Two cars that differ in nothing else are not taken for each other, whether or not such values can be compared."""
    two, four = (pair(Table("table", kind(ratios))) for ratios in ([1.0, 3.0], [3.0, 5.0]))
    with pytest.raises(TypeError, match="unhashable"):
        hash(two["table"])
    assert (two, hash(two)) == (pt.Driveline(*two.elements), hash(pt.Driveline(*two.elements)))
    assert two != four
    for each, ratio in ((two, 2.0), (four, 4.0), (two, 2.0)):
        final = pt.simulate(each, [0.0, 1.0], {"engine_torque": 1.0}).final
        assert final.speed["wheel"] == pytest.approx(ratio * final.speed["axle"])


def test_prints_with_units():
    assert "stiffness = 34400 N m/rad" in repr(car())
    assert "Clutch (released)" in repr(car().release("clutch"))


def test_nothing_is_assigned_to_a_driveline():
    car = pt.examples.conventional()
    with pytest.raises(
        AttributeError, match=r'a driveline does not change; car\.replace\("vehicle", parameter=value\)'
    ):
        car.vehicle = 1
    with pytest.raises(AttributeError, match=r'car\.replace\("element", parameter=value\)'):
        car.speed = 1.0
    assert isinstance(car["vehicle"], pt.Mass)
    assert not hasattr(car, "speed")
