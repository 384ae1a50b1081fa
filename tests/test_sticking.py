"""Which clutches stick where letting go of those that cannot hold does not settle it."""

from types import SimpleNamespace

import pytest

from powertrain_ctrl.elements.laws import BACKWARD, FORWARD, STUCK, friction
from powertrain_ctrl.hybrid import sticking
from powertrain_ctrl.hybrid.motion import LENIENT


def chosen(monkeypatch, wanted):
    """The mode of one clutch at zero slip, of which each mode would rather be another, by so many tolerances."""

    def contradictions(plant, modes, near, motion_in, hit):
        then, excess = wanted[modes[0]]
        return (then,), excess

    monkeypatch.setattr(sticking, "_contradictions", contradictions)
    plant = SimpleNamespace(laws=[friction("clutch", {"a": 1.0}, max_torque=1.0)])
    return sticking.consistent_modes(plant, (STUCK,), [0], None)


@pytest.mark.parametrize(("right", "wrong"), [(FORWARD, BACKWARD), (BACKWARD, FORWARD)])
def test_the_mode_that_agrees_is_found_where_the_others_send_each_other_round(monkeypatch, right, wrong):
    wanted = {STUCK: (wrong, 50.0), wrong: (STUCK, 50.0), right: (right, 0.0)}
    assert chosen(monkeypatch, wanted) == (right,)


def test_where_rounding_leaves_none_the_one_that_contradicts_itself_least_is_taken(monkeypatch):
    wanted = {STUCK: (FORWARD, 5.0), FORWARD: (STUCK, 3.0), BACKWARD: (STUCK, 6.0)}
    assert chosen(monkeypatch, wanted) == (FORWARD,)


@pytest.mark.parametrize(("excess", "expected"), [(0.99 * LENIENT, (STUCK,)), (1.01 * LENIENT, None)])
def test_a_contradiction_beyond_rounding_is_none(monkeypatch, excess, expected):
    wanted = {STUCK: (FORWARD, excess), FORWARD: (STUCK, 99.0), BACKWARD: (STUCK, 99.0)}
    assert chosen(monkeypatch, wanted) == expected
