"""Speeds at which orders meet modes (orders/critical)."""

import json

import numpy as np
import pytest
import scipy.linalg

import powertrain_ctrl as pt

ENGINE = pt.Engine(cylinders=4, firing_order=(1, 3, 4, 2), orders={n / 2: 1.0 for n in range(1, 25)})


def pair(*more):
    shaft = pt.SpringDamper("shaft", "engine", "load", stiffness=4000.0, damping=0.5)
    return pt.Driveline(pt.Inertia("engine", J=0.2), pt.Inertia("load", J=0.3), shaft, *more)


def test_they_are_the_frequency_over_the_order():
    critical = pt.critical_speeds(pair(), ENGINE, (400.0, 3000.0))
    f = np.sqrt(4000.0 * (1 / 0.2 + 1 / 0.3)) / (2 * np.pi)
    # of four cylinders at one node only even orders are left
    assert critical.order.tolist() == [2.0, 4.0]
    np.testing.assert_allclose(critical.rpm, 60.0 * f / critical.order, rtol=1e-14)
    np.testing.assert_allclose(critical.frequency_hz, f, rtol=1e-14)
    assert critical.mode.tolist() == [1, 1]
    assert critical.compliance == ("shaft", "shaft")
    assert critical.damping_ratio == pytest.approx(pt.modes(pair()).damping_ratio[1])
    # the engine has the largest motion of the mode, so all cylinders act there at once
    np.testing.assert_allclose(critical.phase_sum, 1.0)


def test_those_of_the_source_s_car_in_third_gear():
    critical = pt.critical_speeds(pt.examples.conventional(gear_ratio=3.6), ENGINE, (500.0, 6000.0), highest_order=8.0)
    found = {
        (int(m), float(n)): round(float(r)) for m, n, r in zip(critical.mode, critical.order, critical.rpm, strict=True)
    }
    expected = {(2, 2.0): 637, (3, 2.0): 949, (4, 2.0): 5646, (4, 4.0): 2823, (4, 6.0): 1882, (4, 8.0): 1412}
    assert found == expected | {(5, 8.0): 5223}


def test_a_pendulum_splits_a_mode_at_speeds_that_the_matrices_have_too():
    J, order = 0.02, 2.0
    car = pair(pt.Pendulum("absorber", "engine", J=J, order=order))
    critical = pt.critical_speeds(car, pt.Engine(cylinders=1, orders={1.5: 1.0, 2.0: 1.0, 3.0: 1.0}), (300.0, 4000.0))
    # of its own order the pendulum takes all: what would swing there, the load alone, is not driven
    assert list(zip(critical.mode.tolist(), critical.order.tolist(), strict=True)) == [(1, 1.5), (2, 3.0)]
    for mode, n, rpm in zip(critical.mode, critical.order, critical.rpm, strict=True):
        omega = pt.rpm(float(rpm))
        k = order**2 * J * omega**2
        M = np.diag([0.2, 0.3, J])
        K = np.array([[4000.0 + k, -4000.0, -k], [-4000.0, 4000.0, 0.0], [-k, 0.0, k]])
        assert np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)[mode]) == pytest.approx(n * omega, rel=1e-9)


def test_cylinders_at_the_nodes_of_a_mode_are_weighted_with_its_shape():
    throws = [pt.Inertia(f"t{i}", J=0.1) for i in range(4)]
    shafts = [pt.SpringDamper(f"s{i}", f"t{i}", f"t{i + 1}", stiffness=1e5) for i in range(3)]
    car = pt.Driveline(*throws, *shafts)
    critical = pt.critical_speeds(car, ENGINE, (1000.0, 60000.0), nodes=[f"t{i}" for i in range(4)], highest_order=4)
    modes = pt.modes(car)
    for mode, order, total in zip(critical.mode, critical.order, critical.phase_sum, strict=True):
        firing = np.array([0.0, 3.0, 1.0, 2.0]) * np.pi
        expected = abs(modes.shapes[:, mode] @ np.exp(-1j * order * firing)) / 4
        assert total == pytest.approx(expected, abs=1e-12)
        assert total > 1e-12
    assert {1.0, 1.5} & set(critical.order.tolist())


def test_a_table_prints_and_becomes_a_dict():
    critical = pt.critical_speeds(pair(), ENGINE, (400.0, 3000.0))
    assert len(critical) == 2
    assert (
        repr(critical).splitlines()[0].split()
        == "mode order f [Hz] rpm zeta [-] phase sum most strain energy in".split()
    )
    written = json.loads(json.dumps(critical.to_dict()))
    assert written["rpm"] == critical.rpm.tolist()
    assert set(written) >= {"mode", "order", "frequency_hz", "rpm"}
    nothing = pt.critical_speeds(pair(), ENGINE, (1.0, 2.0))
    assert repr(nothing) == "no order meets a mode in this range"
    assert nothing.to_dict()["rpm"] == []


@pytest.mark.parametrize(
    ("rpm", "words"),
    [
        ((0.0, 100.0), "permitted: 0 < lowest < highest"),
        ((200.0, 100.0), "permitted: 0 < lowest < highest"),
        ((float("nan"), 100.0), "rpm"),
        (100.0, "rpm"),
    ],
)
def test_a_range_that_is_none_is_named(rpm, words):
    with pytest.raises(pt.PowertrainError, match=words):
        pt.critical_speeds(pair(), ENGINE, rpm)


def test_a_node_that_is_not_there_is_named():
    with pytest.raises(pt.UnknownNameError, match='node "motor" is not in this driveline'):
        pt.critical_speeds(pair(), ENGINE, (100.0, 200.0), nodes="motor")
