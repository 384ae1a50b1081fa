"""An element of one's own with a friction row is a clutch like the built-in one.

Of elements/laws.
"""

import re
from dataclasses import KW_ONLY, dataclass

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.base.checks import NOT_NEGATIVE
from powertrain_ctrl.elements import Element, friction, quantity


@dataclass(frozen=True)
class LimitedSlip(Element):
    a: str
    b: str
    _: KW_ONLY
    lock_torque: float = quantity("N m", NOT_NEGATIVE)

    @property
    def nodes(self):
        return (self.a, self.b)

    @property
    def laws(self):
        return (friction(self.name, {self.a: 1.0, self.b: -1.0}, self.lock_torque, 1.0),)


def pair(element):
    return pt.Driveline(pt.Inertia("left", J=1.0), pt.Inertia("right", J=1.0), element)


MINE = pair(LimitedSlip("k", "left", "right", lock_torque=2.0))
BUILT_IN = pair(pt.Clutch("k", "left", "right", max_torque=2.0))


def test_it_slips_where_its_capacity_ends():
    # 10 N m against 2 N m for a second, by hand
    mine, theirs = (pt.simulate(car, [0.0, 1.0], {"left_torque": 10.0}) for car in (MINE, BUILT_IN))
    assert mine.final.speed == pytest.approx({"left": 8.0, "right": 2.0}, rel=1e-12)
    assert [(e.kind, e.time) for e in mine.events] == [(e.kind, e.time) for e in theirs.events]
    assert mine.slip_energy["k"] == pytest.approx(2.0 * 0.5 * (8.0 - 2.0), rel=1e-12)


def test_it_is_locked_and_released():
    assert MINE.clutches == ("k",)
    assert len(pt.modes(MINE)) == 1
    opened = MINE.release("k")
    assert (opened.released, len(pt.modes(opened))) == (frozenset({"k"}), 2)
    assert opened.lock() == MINE
    assert opened.part("left").nodes == ("left",)


def test_it_is_saved_and_loaded_open_or_closed(tmp_path):
    for car in (MINE, MINE.release()):
        car.save(tmp_path / "car.toml")
        assert pt.load(tmp_path / "car.toml") == car


def test_it_is_drawn_and_reflected_as_a_clutch():
    ax = pt.plots.schematic(MINE)
    assert any("2 N m" in text.get_text() for text in ax.texts)
    beside = pt.Driveline(*MINE, pt.SpringDamper("s", "left", "right", stiffness=1.0)).release()
    assert pt.reflected(beside)["k"] == pt.Clutch("k", "left", "right", max_torque=2.0)


def test_it_runs_in_a_launch_and_as_a_system():
    mine, theirs = (pt.launch(car, torque=5.0, capacity=4.0, engine_speed=20.0) for car in (MINE, BUILT_IN))
    np.testing.assert_array_equal(mine["left_speed"], theirs["left_speed"])
    assert "k_capacity" in pt.nonlinear_system(MINE, dt=0.01).input_labels


def test_a_law_has_the_name_of_its_element():
    @dataclass(frozen=True)
    class _Twice(LimitedSlip):
        @property
        def laws(self):
            return (*super().laws, super().laws[0]._replace(name="other"))

    with pytest.raises(pt.PowertrainError, match=re.escape('k: laws k, other, permitted: of the name "k"')):
        pair(_Twice("k", "left", "right", lock_torque=2.0))


def test_turning_and_moving_nodes_are_told_apart_for_it_too():
    with pytest.raises(pt.TopologyError, match="connects turning and moving nodes left and car"):
        pt.Driveline(pt.Inertia("left", J=1.0), pt.Mass("car", m=1.0), LimitedSlip("k", "left", "car", lock_torque=1.0))
