"""What is required of an anti-jerk controller: by how much it is missed, and that search and report read the same."""

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.studies.requirements import (
    DEFAULTS,
    REQUIREMENTS,
    Requirement,
    asked,
    requirements_missed,
)


@pytest.mark.parametrize(("is_least", "met"), [(True, [False, True, True]), (False, [True, True, False])])
def test_a_requirement_is_met_on_its_own_side(is_least, met):
    requirement = Requirement("overshoot", "overshoot", "nominal", 0.5, "-", is_least)
    assert [requirement.is_met(value) for value in (0.4, 0.5, 0.6)] == met
    assert requirement.text == ("≥ 0.5" if is_least else "≤ 0.5")
    sign = -1.0 if is_least else 1.0
    assert [requirement.is_met(0.5 + sign * beyond) for beyond in (1e-10, 2e-9)] == [True, False]
    assert not requirement.is_met(np.nan)


@pytest.mark.parametrize("is_least", [True, False])
def test_what_is_missed_counts_over_the_limit(is_least):
    requirement = Requirement("overshoot", "overshoot", "nominal", 0.5, "-", is_least)
    assert [requirement.missed_by(value) for value in (0.4, 0.5, 0.6)] == pytest.approx(
        [0.2, 0.0, -0.2] if is_least else [-0.2, 0.0, 0.2]
    )


def test_the_report_lists_what_a_study_misses(source_study):
    missed = {name: requirements_missed(result) for name, result in source_study.proofs.items()}
    assert missed["two degrees of freedom"] == []
    assert {each.quantity for each in missed["P"]} >= {"oscillation_reduction", "overshoot"}


def test_a_requirement_by_name_says_what_counts_and_which_way():
    worst = asked("worst_disk_margin", 0.5)
    assert (worst.quantity, worst.among, worst.is_least) == ("disk_margin", "all", True)
    slow = asked("t90_ratio", 1.3)
    assert (slow.among, slow.is_least, slow.text) == ("nominal", False, "≤ 1.3")
    assert asked("oscillation_reduction", 0.9).text == "≥ 90 %"
    assert all(asked(name, limit).limit == limit for name, limit in DEFAULTS.items())
    with pytest.raises(pt.PowertrainError, match=r'requirement "disc_margin".*did you mean "disk_margin"'):
        asked("disc_margin", 0.5)


@pytest.mark.parametrize(
    ("name", "limit", "value", "share"),
    [
        ("disk_margin", 0.8, 1.6, 0.5),
        ("oscillation_reduction", 0.9, 0.95, 0.5),
        ("t90_ratio", 1.3, 1.15, 0.5),
        ("vdv", 0.8, 0.4, 0.5),
    ],
)
def test_a_share_of_what_is_allowed_is_one_at_the_limit(name, limit, value, share):
    assert asked(name, limit).used_by(value) == pytest.approx(share)
    assert asked(name, limit).used_by(limit) == pytest.approx(1.0)


def test_what_is_required_of_the_source_s_car_is_stricter_than_of_any_car():
    known = {(each.quantity, each.among): each.limit for each in REQUIREMENTS}
    assert known["disk_margin", "nominal"] >= DEFAULTS["disk_margin"]
    assert known["disk_margin", "all"] >= DEFAULTS["worst_disk_margin"]
    assert known["oscillation_reduction", "nominal"] >= DEFAULTS["oscillation_reduction"]
    assert known["t90_ratio", "nominal"] <= DEFAULTS["t90_ratio"]
