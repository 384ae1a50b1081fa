"""Sobol' indices against variances in closed form."""

import numpy as np
import pytest

import powertrain_ctrl as pt

CAR = pt.examples.conventional()
TOLERANCES = {"drive_shafts.stiffness": 0.1, "vehicle.m": (1500.0, 2500.0), "tyres.radius": 0.05}


def test_a_sum_is_shared_by_the_variances_of_its_terms():
    result = pt.studies.sobol(
        CAR,
        TOLERANCES,
        lambda cars: 3.0 * np.log(cars.values["drive_shafts.stiffness"]) + cars.values["vehicle.m"] / 1e3,
        n=4096,
    )
    parts = np.array([9.0 * 0.1**2, 1.0 / 12.0])  # of a normal and of a uniform distribution
    expected = dict(zip(TOLERANCES, [*(parts / parts.sum()), 0.0], strict=True))
    for name, share in expected.items():
        assert result.first[name] == pytest.approx(share, abs=0.01)
        assert result.total[name] == pytest.approx(share, abs=0.01)
    assert result.deviation == pytest.approx(np.sqrt(parts.sum()), rel=0.01)


def test_a_product_is_shared_by_both_together():
    """Of x y with equal means m and variances v, alone v m^2 each, together v^2 besides."""
    bounds = (1500.0, 2500.0)
    tolerances = {"vehicle.m": bounds, "damper_spring.stiffness": bounds}
    result = pt.studies.sobol(
        CAR, tolerances, lambda cars: cars.values["vehicle.m"] * cars.values["damper_spring.stiffness"], n=4096
    )
    m, v = 2000.0, 1000.0**2 / 12.0
    whole = 2.0 * v * m**2 + v**2
    for name in tolerances:
        assert result.first[name] == pytest.approx(v * m**2 / whole, abs=0.01)
        assert result.total[name] == pytest.approx((v * m**2 + v**2) / whole, abs=0.01)


def test_the_first_frequency_is_shared_as_its_sensitivities_say():
    tolerances = {"drive_shafts.stiffness": 0.05, "vehicle.m": 0.05, "engine.J": 0.05}
    result = pt.studies.sobol(CAR, tolerances, lambda cars: cars.natural_frequencies()[:, 1], n=1024)
    squares = {name: pt.modes(CAR).sensitivity(1)[name] ** 2 for name in tolerances}
    for name, square in squares.items():
        assert result.first[name] == pytest.approx(square / sum(squares.values()), abs=0.02)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"n": 100}, "n = 100, permitted: a power of 2"),
        ({"spread": {"vehicle.m": 0.1}}, "at least two"),
        ({"quantity": lambda cars: 1.0}, "a finite number for each"),
        ({"quantity": lambda cars: np.full(len(cars), np.nan)}, "a finite number for each"),
        ({"spread": {"vehicle.mass": 0.1, "wheels.J": 0.1}}, 'did you mean "m"'),
    ],
)
def test_what_has_no_indices_is_refused(changes, message):
    given = {"spread": TOLERANCES, "quantity": lambda cars: cars.natural_frequencies()[:, 1], "n": 8, **changes}
    with pytest.raises(pt.PowertrainError, match=message):
        pt.studies.sobol(CAR, **given)
