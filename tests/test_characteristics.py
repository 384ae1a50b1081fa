"""Characteristics of elements show the torque that their values say."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import powertrain_ctrl as pt
from powertrain_ctrl.plots.style import shade


def drawn(element):
    ax = pt.plots.characteristic(element, Figure().subplots())
    return ax, [line.get_xydata() for line in ax.get_lines() if line.get_color() != shade(0.4)]


def test_play_has_no_torque_inside_its_gap_and_a_straight_line_outside():
    ax, (curve,) = drawn(pt.Backlash("mesh", "a", "b", gap=0.02, stiffness=5e3))
    twist, torque = curve.T
    np.testing.assert_allclose(torque, 5e3 * (twist - np.clip(twist, -0.01, 0.01)), atol=1e-9)
    assert twist[0] < -0.01
    assert twist[-1] > 0.01
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == ("twist [rad]", "torque [N m]", "mesh")


def test_stages_go_through_their_points_with_friction_as_a_band():
    spring = pt.MultiStageSpring("damper", "a", "b", twists=[-0.1, 0.0, 0.1], torques=[-10.0, 0.0, 40.0], friction=3.0)
    _, curves = drawn(spring)
    below, middle, above = sorted(curves, key=lambda curve: np.interp(0.05, *curve.T))
    np.testing.assert_allclose(np.interp([-0.1, 0.0, 0.1], *middle.T), [-10.0, 0.0, 40.0], atol=1e-9)
    np.testing.assert_allclose(above[:, 1] - middle[:, 1], 3.0, atol=1e-9)
    np.testing.assert_allclose(middle[:, 1] - below[:, 1], 3.0, atol=1e-9)


def test_a_clutch_holds_up_to_its_torque_and_slides_with_it():
    ax, curves = drawn(pt.Clutch("clutch", "a", "b", max_torque=300.0))
    held = next(curve for curve in curves if (curve[:, 0] == 0.0).all())
    np.testing.assert_allclose(np.sort(held[:, 1]), [-300.0, 300.0])
    sliding = [curve for curve in curves if np.abs(curve[:, 0]).max() > 0.0]
    for curve in sliding:
        np.testing.assert_allclose(curve[:, 1], 300.0 * np.sign(curve[:, 0].sum()))
    assert len(sliding) == 2
    assert ax.get_xlabel() == "slip [rad/s]"


def test_a_linear_element_has_no_characteristic():
    with pytest.raises(pt.PowertrainError, match="shaft is linear or its speed is not given"):
        pt.plots.characteristic(pt.SpringDamper("shaft", "a", "b", stiffness=1e3))
