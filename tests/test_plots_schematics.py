"""The schematic shows every body and every element, with its value, and branches do not fall on each other.

Of plots/schematics.
"""

import numpy as np
import pytest
from matplotlib.figure import Figure

import powertrain_ctrl as pt


def texts(car):
    ax = pt.plots.schematic(car, Figure(figsize=(8.0, 4.0)).subplots())
    return [text.get_text().replace("\n", " ") for text in ax.texts]


def branched():
    return pt.Driveline(
        pt.Inertia("case", J=0.05),
        pt.Planetary("differential", "left_flange", "right_flange", "case", ratio=1.0),
        *(pt.Inertia(f"{side}_{part}", J=0.5) for side in ("left", "right") for part in ("flange", "wheel")),
        pt.SpringDamper("left_shaft", "left_flange", "left_wheel", stiffness=8e3),
        pt.SpringDamper("right_shaft", "right_flange", "right_wheel", stiffness=6e3),
        pt.Tyre("left_tyre", "left_wheel", "vehicle", radius=0.3, stiffness=2e5, damping=1e3),
        pt.Tyre("right_tyre", "right_wheel", "vehicle", radius=0.3),
        pt.Mass("vehicle", m=1200.0),
        pt.Clutch("brake", "left_wheel", max_torque=100.0),
    ).release("brake")


@pytest.mark.parametrize(
    "car",
    [pt.examples.conventional(), pt.examples.front_wheel_drive(), branched(), pt.two_mass(pt.examples.conventional())],
)
def test_every_element_is_named(car):
    shown = texts(car)
    for element in car.driveline:
        name = element.name.replace("_", " ")
        is_read_off = element.name == "rim"
        assert is_read_off or any(text.startswith(name) for text in shown), name


def test_values_are_those_of_the_elements():
    shown = texts(pt.examples.conventional())
    for value in ("0.3 kg m²", "2000 kg", "2000 N m/rad", "i = 6", "i = 3", "980000 N/m", "370 N m"):
        assert value in shown


def test_the_reflected_chain_has_its_reflected_values():
    shown = texts(pt.reflected(pt.examples.conventional(), "engine"))
    for value in ("0.001389 kg m²", "0.01235 kg m²", "0.7562 kg m²", "106.2 N m/rad", "370.5 N m/rad"):
        assert value in shown
    assert not any(text.startswith("i = ") for text in shown)


def test_an_open_clutch_is_drawn_with_a_gap():
    def widest_gap(car):
        ax = pt.plots.schematic(car, Figure().subplots())
        plates = [line.get_xdata() for line in ax.lines if len(line.get_xdata()) == 2]
        upright = sorted(x[0] for x in plates if x[0] == x[1])
        return upright[-1] - upright[0]

    pair = [pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=5.0)]
    closed = pt.Driveline(*pair)
    assert widest_gap(closed.release()) > 3.0 * widest_gap(closed)


def test_no_two_nodes_are_drawn_in_the_same_place():
    from powertrain_ctrl.plots.schematics import _places

    for car in (branched(), pt.examples.conventional().release("clutch")):
        places = list(_places(car).values())
        assert len(set(places)) == len(places)


def test_an_open_differential_is_a_cage_with_its_bevel_gears():
    car = pt.Driveline(
        pt.Inertia("motor", J=0.05),
        pt.Differential("differential", "motor", "left", "right"),
        *(pt.SpringDamper(f"{side}_shaft", side, f"{side}_wheel", stiffness=7e3) for side in ("left", "right")),
        *(pt.Inertia(f"{side}_wheel", J=1.2) for side in ("left", "right")),
    )
    ax = pt.plots.schematic(car, Figure().subplots())
    crosses = [line for line in ax.lines if line.get_marker() == "x"]
    cages = [line for line in ax.lines if line.get_marker() == "o" and line.get_markersize() > 5]
    assert len(crosses) == len(cages) == 1
    assert (crosses[0].get_xdata()[0], crosses[0].get_ydata()[0]) == (cages[0].get_xdata()[0], cages[0].get_ydata()[0])
    assert "differential" in [text.get_text() for text in ax.texts]


def drawn(element):
    """Curves of more than two points, and texts, of a pair with this element between."""
    ends = (pt.Inertia("left", J=1.0), pt.Inertia("right", J=1.0))
    ax = pt.plots.schematic(pt.Driveline(*ends, element), Figure().subplots())
    curves = [line.get_xydata() for line in ax.lines]
    return curves, [text.get_text() for text in ax.texts]


def test_a_one_way_clutch_points_the_way_in_which_it_drives():
    def tip(a, b):
        arrow = next(curve for curve in drawn(pt.OneWayClutch("freewheel", a, b))[0] if len(curve) == 4)
        return next(x for x, y in arrow if y == 0.0), max(abs(arrow[:, 0] - 0.5))

    (forward, size), (backward, _) = tip("left", "right"), tip("right", "left")
    assert forward == pytest.approx(0.5 + size)
    assert backward == pytest.approx(0.5 - size)
    assert "freewheel" in drawn(pt.OneWayClutch("freewheel", "left", "right"))[1]


def test_play_is_a_spring_and_a_tongue_that_does_not_touch_its_fork():
    curves, texts = drawn(pt.Backlash("teeth", "left", "right", gap=0.02, stiffness=5e3))
    assert {"teeth\n0.02 rad", "5000\nN m/rad"} <= set(texts)
    upper, lower = (next(c for c in curves if len(c) == 4 and np.sign(c[-1, 1]) == side) for side in (1.0, -1.0))
    tongue = next(c for c in curves if len(c) == 2 and c[0, 0] == c[1, 0])
    for prong in (upper, lower):
        assert prong[0, 0] < tongue[0, 0] < prong[-1, 0]
        assert abs(prong[-1, 1]) > 0.0
    assert max(abs(tongue[:, 1])) < max(abs(upper[:, 1]))
