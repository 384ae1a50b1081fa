"""What lasts, on both sides of the tolerances."""

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.linear.quadratic import by_magnitude
from powertrain_ctrl.linear.stability import ROUNDING, UNDAMPED, is_eigenvalue, undamped_modes, without_motion_at


def two_mass(zeta):
    model = pt.TwoMass(J1=0.5, J2=250.0, stiffness=3e4, damping=0.0, ratio=18.0, radius=0.35)
    return model.replace(damping=2.0 * zeta * model.omega / model.compliance_of_inertia)


@pytest.mark.parametrize("share", [0.5, 2.0])
def test_a_mode_is_undamped_below_the_tolerance_and_damped_above(share):
    assert list(undamped_modes(two_mass(share * UNDAMPED))) == ([1] if share < 1.0 else [])


def test_a_slow_mode_with_next_to_no_damping_is_damped_beside_fast_ones():
    # 0.5 Hz with zeta 1e-6 beside a spring that is 1e8 times as stiff
    k = (2.0 * np.pi * 0.5) ** 2
    car = pt.Driveline(
        pt.Drag("mount", "a", stiffness=k, damping=2.0 * 1e-6 * np.sqrt(k)),
        pt.Inertia("a", J=0.5),
        pt.SpringDamper("shaft", "a", "b", stiffness=1e8 * k, damping=1.0),
        pt.Inertia("b", J=0.5),
    )
    assert pt.modes(car).damping_ratio[0] == pytest.approx(1e-6, rel=1e-3)
    assert not undamped_modes(car).size


def test_equal_half_shafts_swing_undamped_whatever_damps_the_engine():
    sides = [
        element
        for side in ("left", "right")
        for element in (pt.SpringDamper(f"{side}_shaft", "diff", side, stiffness=7e3), pt.Inertia(side, J=1.3))
    ]
    shaft = pt.SpringDamper("shaft", "engine", "diff", stiffness=1e4, damping=30.0)
    car = pt.Driveline(pt.Inertia("engine", J=0.2), shaft, pt.Inertia("diff", J=0.1), *sides)
    (mode,) = undamped_modes(car)
    # the wheels against each other, the differential at rest
    assert pt.modes(car).omega[mode] == pytest.approx(np.sqrt(7e3 / 1.3), rel=1e-12)
    damped = car.replace("left_shaft", damping=1e-3).replace("right_shaft", damping=1e-3)
    assert not undamped_modes(damped).size


@pytest.mark.parametrize(("distance", "expected"), [(0.3, True), (3.0, False)])
def test_a_point_is_an_eigenvalue_within_rounding(distance, expected):
    A = np.diag([1.0, 0.5])  # of norm 1
    assert is_eigenvalue(A, np.array([1.0 + distance * ROUNDING])).tolist() == [expected]


def test_units_of_the_states_do_not_count():
    A = np.array([[0.6, 0.8], [-0.8, 0.6]])
    scaled = A * [[1.0, 1e9], [1e-9, 1.0]]
    assert is_eigenvalue(scaled, np.array([0.6 + 0.8j, 0.61 + 0.8j])).tolist() == [True, False]


def test_one_motion_is_taken_out_of_a_double_integrator():
    A = np.array([[1.0, 0.01], [0.0, 1.0]])
    once = without_motion_at(1.0, A)
    assert once.shape == (1, 1)
    assert is_eigenvalue(once, np.ones(1)).all()
    assert without_motion_at(1.0, without_motion_at(1.0, once)).shape == (0, 0)
    slow = np.array([[1.0, 0.01], [0.0, 1.0 - 1e-7]])
    assert not is_eigenvalue(without_motion_at(1.0, slow), np.ones(1)).any()


@pytest.mark.parametrize(("off", "left"), [(0.5, 1), (2.0, 2)])
def test_rounding_is_a_share_of_the_size_of_the_matrix(off, left):
    A = np.diag([1.0 + off * ROUNDING * 1e3, 1e3])
    assert len(without_motion_at(1.0, A)) == left
    assert is_eigenvalue(A, np.ones(1)).tolist() == [left == 1]


def test_equally_fast_poles_have_one_order_whatever_rounding_does():
    poles = np.array([1.0, 5.0, 3.0 + 4.0j, 3.0 - 4.0j, -4.0 + 3.0j, -4.0 - 3.0j])
    for turn in (1e-12, -1e-12):
        nearly = poles * (1.0 + turn * np.arange(6.0))
        assert by_magnitude(nearly).tolist() == [0, 3, 5, 1, 4, 2]
    # told apart where they differ by more
    assert by_magnitude(np.array([5.0 + 1e-7, 3.0 + 4.0j])).tolist() == [1, 0]
    assert by_magnitude(np.array([5.0 + 1e-12, 3.0 + 4.0j])).tolist() == [0, 1]
