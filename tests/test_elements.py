"""What elements accept, and what they say when they do not.

Of elements/bodies, elements/clutches, elements/combinations, elements/element, elements/gears,
elements/springs.
"""

import copy
import pickle
import re

import pytest

import powertrain_ctrl as pt

BAD_VALUES = [
    (lambda: pt.Inertia("engine", J=0.0), "engine: J = 0.0 kg m^2, permitted: > 0 and finite"),
    (lambda: pt.Inertia("engine", J=-0.3), "engine: J = -0.3 kg m^2, permitted: > 0 and finite"),
    (lambda: pt.Inertia("engine", J=float("nan")), "engine: J = nan kg m^2, permitted: > 0 and finite"),
    (lambda: pt.Inertia("engine", J=float("inf")), "engine: J = inf kg m^2, permitted: > 0 and finite"),
    (lambda: pt.Inertia("engine", J="0.3"), "engine: J = '0.3' kg m^2, permitted: a number, > 0 and finite"),
    (lambda: pt.Inertia("engine", J=True), "engine: J = True kg m^2, permitted: a number, > 0 and finite"),
    (lambda: pt.Mass("vehicle", m=-1), "vehicle: m = -1.0 kg, permitted: > 0 and finite"),
    (
        lambda: pt.SpringDamper("shaft", "a", "b", stiffness=-12e3),
        "shaft: stiffness = -12000.0 N m/rad, permitted: >= 0 and finite",
    ),
    (
        lambda: pt.SpringDamper("shaft", "a", "b", stiffness=1.0, damping=-2),
        "shaft: damping = -2.0 N m s/rad, permitted: >= 0 and finite",
    ),
    (
        lambda: pt.SpringDamper("shaft", "a", "b", stiffness=0.0),
        "shaft: stiffness = 0.0 N m/rad, permitted: > 0, or 0 together with damping > 0 (a pure damper)",
    ),
    (lambda: pt.SpringDamper("shaft", "a", "a", stiffness=1.0), 'shaft: connects node "a" with itself'),
    (lambda: pt.Drag("drag", "a", damping=0.0), "drag: stiffness = 0.0"),
    (lambda: pt.Gear("gear", "a", "b", ratio=0.0), "gear: ratio = 0.0, permitted: not 0, finite"),
    (lambda: pt.Planetary("set", "s", "r", "c", ratio=-1), "set: ratio = -1.0, permitted: not 0 and not -1"),
    (
        lambda: pt.Tyre("tyre", "w", "v", radius=0.0, stiffness=1.0),
        "tyre: radius = 0.0 m, permitted: > 0 and finite",
    ),
    (lambda: pt.Tyre("tyre", "w", "v", radius=-0.3), "tyre: radius = -0.3 m, permitted: > 0 and finite"),
    (
        lambda: pt.Tyre("tyre", "w", "v", radius=0.3, damping=5.0),
        "tyre: damping = 5.0 N s/m, permitted: 0 for rigid rolling (stiffness None)",
    ),
    (lambda: pt.Clutch("clutch", "a", "b", max_torque=-1), "clutch: max_torque = -1.0 N m, permitted: >= 0"),
    (
        lambda: pt.Clutch("clutch", "a", "b", max_torque=1, static_ratio=0.9),
        "clutch: static_ratio = 0.9, permitted: >= 1 and finite",
    ),
    (lambda: pt.Shaft("s", "a", "b", stiffness=1.0, inertia=0.0), "s: inertia = 0.0 kg m^2, permitted: > 0"),
    (lambda: pt.Compliance("c", {}, stiffness=1.0), "c: coefficients = {}"),
    (lambda: pt.Compliance("c", {"a": 0.0}, stiffness=1.0), 'c: coefficient of "a" = 0.0'),
    (lambda: pt.Constraint("c", {"a": "x"}), "c: coefficient of \"a\" = 'x'"),
    (lambda: pt.Inertia("engine speed", J=1.0), "Inertia name 'engine speed' is not an identifier"),
    (lambda: pt.SpringDamper("s", "a.b", "c", stiffness=1.0), "s: node 'a.b' is not an identifier"),
]


@pytest.mark.parametrize(("make", "message"), BAD_VALUES)
def test_bad_values_name_element_value_unit_and_what_is_permitted(make, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)) as error:
        make()
    assert isinstance(error.value, ValueError)


NODES = {
    "Gear": "ab",
    "SpringDamper": "ab",
    "Shaft": "ab",
    "Tyre": "ab",
    "Clutch": "ab",
    "Drag": "a",
    "Planetary": "src",
}
GOOD = {
    "Inertia": {"J": 1.0},
    "Mass": {"m": 1.0},
    "SpringDamper": {"stiffness": 1.0, "damping": 1.0},
    "Shaft": {"stiffness": 1.0, "inertia": 1.0, "damping": 1.0},
    "Drag": {"damping": 1.0, "stiffness": 1.0},
    "Gear": {"ratio": 2.0},
    "Planetary": {"ratio": 2.0},
    "Tyre": {"radius": 0.3, "stiffness": 1.0, "damping": 1.0},
    "Clutch": {"max_torque": 1.0, "static_ratio": 1.0},
    "Compliance": {"stiffness": 1.0, "damping": 1.0},
}
NEVER = [float("nan"), float("inf"), -float("inf"), 10**400, -(10**400), "1", True, 1j, [1.0]]
ZERO_IS_WRONG = {"J", "m", "inertia", "radius", "ratio", "static_ratio"}
UNITS = {
    **{"J": "kg m^2", "inertia": "kg m^2", "m": "kg", "radius": "m", "max_torque": "N m", "ratio": ""},
    **{"static_ratio": "", "stiffness": "N m/rad", "damping": "N m s/rad"},
    **{("Tyre", "stiffness"): "N/m", ("Tyre", "damping"): "N s/m"},
}


def build(kind, values):
    first = [{"a": 1.0}] if kind == "Compliance" else list(NODES.get(kind, ""))
    return getattr(pt, kind)("part", *first, **values)


@pytest.mark.parametrize(("kind", "parameter"), [(kind, p) for kind, values in GOOD.items() for p in values])
def test_no_element_takes_a_value_that_is_not_a_permitted_number(kind, parameter):
    build(kind, GOOD[kind])
    wrong = [*NEVER, *([0.0] if parameter in ZERO_IS_WRONG or (kind == "Shaft" and parameter == "stiffness") else [])]
    wrong += [] if parameter == "ratio" else [-1.0]
    wrong += [] if (kind, parameter) == ("Tyre", "stiffness") else [None]  # None is rigid rolling
    unit = UNITS.get((kind, parameter), UNITS[parameter])
    for value in wrong:
        with pytest.raises(pt.ParameterError) as error:
            build(kind, GOOD[kind] | {parameter: value})
        message = str(error.value)
        assert message.startswith(f"part: {parameter} = ")
        assert f"{unit}, permitted: ".lstrip() in message


def test_a_whole_number_beyond_the_floats_is_no_coefficient():
    with pytest.raises(pt.PowertrainError, match='coefficient of "a" = inf, permitted: not 0, finite'):
        pt.Constraint("c", {"a": 10**400})


@pytest.mark.parametrize("ends", [("x", "x", "y"), ("x", "y", "x"), ("y", "x", "x")])
def test_a_planetary_needs_three_nodes(ends):
    with pytest.raises(pt.PowertrainError, match="permitted: different nodes"):
        pt.Planetary("gears", *ends, ratio=2.0)


def test_every_element_prints_itself():
    for kind, values in GOOD.items():
        assert eval(repr(build(kind, values)), vars(pt)) == build(kind, values)


def test_elements_cannot_be_changed():
    with pytest.raises(AttributeError):
        pt.Inertia("engine", J=1.0).J = 2.0


def test_numbers_of_any_kind_become_floats():
    import numpy as np

    assert pt.Inertia("engine", J=np.float32(0.5)) == pt.Inertia("engine", J=0.5)
    assert isinstance(pt.Mass("v", m=3).m, float)


@pytest.mark.parametrize(("sun", "ring", "i0"), [(30, 70, 70 / 30), (24, 96, 4.0)])
def test_a_planetary_gear_turns_as_its_teeth_say(sun, ring, i0):
    """Speeds of sun and ring relative to the carrier are as minus ring over sun teeth, whatever the carrier does."""
    (row,) = pt.Planetary("gears", "sun", "ring", "carrier", ratio=i0).constraints
    for carrier, of_ring in ((0.0, 1.0), (1.0, 0.0), (1.0, 1.0), (-2.0, 3.0)):
        of_sun = carrier - ring / sun * (of_ring - carrier)
        speeds = {"sun": of_sun, "ring": of_ring, "carrier": carrier}
        assert sum(c * speeds[node] for node, c in row.coefficients.items()) == pytest.approx(0.0, abs=1e-12)


def test_coefficients_cannot_be_changed_and_can_be_copied():
    mesh = pt.Compliance("mesh", {"a": 1, "b": -1.0}, stiffness=100.0)
    for change in (
        lambda: mesh.coefficients.__setitem__("a", 5.0),
        lambda: mesh.coefficients.update(a=5.0),
        lambda: mesh.coefficients.pop("a"),
        mesh.coefficients.clear,
    ):
        with pytest.raises(TypeError, match=r"take car.replace\(name, coefficients=...\)"):
            change()
    assert mesh.coefficients == {"a": 1.0, "b": -1.0}
    assert copy.deepcopy(mesh) == pickle.loads(pickle.dumps(mesh)) == mesh
    assert hash(mesh) == hash(pt.Compliance("mesh", {"b": -1.0, "a": 1.0}, stiffness=100.0))


def test_a_shaft_by_its_size_is_a_steel_bar_or_tube():
    """A bar of 50 mm and 1 m has I = 6.1359e-7 m^4, 15.413 kg and J = m r^2 / 2; a tube is a bar less its core."""
    bar, core = (pt.Shaft.from_geometry("s", "a", "b", length=1.0, outer_diameter=D) for D in (0.05, 0.04))
    tube = pt.Shaft.from_geometry("s", "a", "b", length=1.0, outer_diameter=0.05, inner_diameter=0.04)
    assert bar.stiffness == pytest.approx(79.3e9 * 6.1359e-7, rel=1e-5)
    assert bar.inertia == pytest.approx(0.5 * 15.413 * 0.025**2, rel=1e-4)
    assert tube.stiffness == pytest.approx(bar.stiffness - core.stiffness, rel=1e-12)
    assert tube.inertia == pytest.approx(bar.inertia - core.inertia, rel=1e-12)


@pytest.mark.parametrize(
    ("size", "message"),
    [
        (
            {"length": 1.0, "outer_diameter": 0.05, "inner_diameter": 0.05},
            "inner_diameter = 0.05 m, permitted: below 0.05",
        ),
        ({"length": 0.0, "outer_diameter": 0.05}, "s: length = 0.0 m, permitted: > 0"),
        ({"length": 1.0}, "not given: outer_diameter=..."),
    ],
)
def test_a_shaft_without_a_wall_or_a_length_is_refused(size, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)):
        pt.Shaft.from_geometry("s", "a", "b", **size)


def test_a_method_of_a_class_counts_what_the_caller_gives():
    with pytest.raises(pt.ArgumentError, match=r"5 values by position, permitted: 3 \(name, a, b\)"):
        pt.Shaft.from_geometry("s", "a", "b", 1.0, 0.05)
