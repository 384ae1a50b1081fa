"""What is required of an anti-jerk controller: by how much it is missed, and that search and report read the same."""

import dataclasses

import numpy as np
import pytest

from benchmarks import tune
from powertrain_ctrl.studies.requirements import (
    ENGINE_SPEED_REQUIREMENTS,
    REQUIREMENTS,
    Requirement,
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
    assert missed["proven"] == []
    assert {each.quantity for each in missed["P"]} >= {"oscillation_reduction", "overshoot"}


class Values(dict):
    """A proof with these values."""

    value = dict.__getitem__


def at_limits(requirements, missed=None):
    """Values at the limit of each, that of ``missed`` a tenth beyond it."""
    values = {each.quantity: each.limit for each in requirements}
    if missed is not None:
        values[missed.quantity] *= 0.9 if missed.is_least else 1.1
    return Values(values)


NOMINAL = [each for each in REQUIREMENTS if each.among == "nominal"]
ALL = [tune.INSIDE, *(each for each in REQUIREMENTS if each.among == "all")]


def test_the_search_scores_by_the_requirements_of_the_report():
    assert tune.nominal_score(at_limits(NOMINAL), engine_only=False) == 0.0
    for each in NOMINAL:
        assert tune.nominal_score(at_limits(NOMINAL, each), engine_only=False) == pytest.approx(0.1)
    best = -1e-3 * tune.INSIDE.limit
    assert tune.worst_score([at_limits(ALL)], engine_only=False) == pytest.approx(best)
    for each in ALL[1:]:
        assert tune.worst_score([at_limits(ALL), at_limits(ALL, each)], engine_only=False) == pytest.approx(0.1 + best)


def test_the_search_takes_the_worst_plant_and_ten_for_what_is_no_number():
    values = at_limits(ALL)
    never = Values(values | {"t90_ratio": np.inf})
    assert tune.worst_score([values, never], engine_only=False) == pytest.approx(10.0 - 1e-3 * tune.INSIDE.limit)


@pytest.mark.parametrize("among", ["nominal", "all"])
def test_designs_of_one_speed_are_scored_by_their_own_limits(among):
    own = {each.quantity: each for each in ENGINE_SPEED_REQUIREMENTS if each.among == among}
    found = tune.required(engine_only=True, among=among)
    assert own.items() <= found.items()
    assert not {"zeta_first", "zeta_second", "disturbance_reduction"} & found.keys()


def test_a_requirement_that_changes_changes_the_search(monkeypatch):
    changed = [
        dataclasses.replace(each, limit=0.99) if each.quantity == "disk_margin" else each for each in REQUIREMENTS
    ]
    monkeypatch.setattr(tune, "REQUIREMENTS", changed)
    assert tune.required(engine_only=False, among="nominal")["disk_margin"].limit == 0.99
