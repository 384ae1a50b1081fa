"""Clutches that open without load, break away beside springs and brakes, and slip to and fro at an engine's orders."""

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.signals import PiecewiseLinear


def events(response):
    return [(event.element, event.kind) for event in response.events]


@pytest.mark.parametrize("end", [0.01, 0.02, 0.07, 0.13, 0.29, 0.51, 0.77, 1.0, 1.43, 2.0, 2.61, 3.0])
def test_a_lock_up_clutch_beside_an_unloaded_spring_holds_until_its_capacity_is_gone(end):
    car = pt.Driveline(
        pt.Inertia("n0", J=1.0),
        pt.Inertia("n4", J=0.3),
        pt.Inertia("n6", J=4.0),
        pt.SpringDamper("spring", "n4", "n6", stiffness=9000.0),
        pt.Clutch("clutch", "n4", "n6", max_torque=30.0),
    )
    opening = {"clutch_capacity": PiecewiseLinear((0.0, end), (32.0, 0.0))}
    response = pt.simulate(car, [0.0, 4.0], opening, {"n0": 36.0})
    assert events(response) == [("clutch", "release")]
    assert response.events[0].time == pytest.approx(end, abs=1e-12)


def test_a_clutch_that_nothing_loads_opens_at_the_end_of_its_ramp():
    car = pt.Driveline(
        *(
            pt.Inertia(name, J=J)
            for name, J in {"n0": 0.01, "n1": 0.05, "n5": 2.0, "n7": 0.8, "n9": 0.2, "n13": 2.0}.items()
        ),
        pt.SpringDamper("s2", "n0", "n1", stiffness=2000.0),
        pt.SpringDamper("s10", "n5", "n9", stiffness=80000.0),
        pt.Gear("g11", "n7", "m12", ratio=2.0),
        pt.SpringDamper("s14", "m12", "n13", stiffness=90000.0, damping=0.2),
        pt.Clutch("c15", "n13", "m12", max_torque=20.0),
    )
    inputs = {"n9_torque": 27.0, "c15_capacity": PiecewiseLinear((0.85, 0.97), (23.0, 0.0))}
    response = pt.simulate(car, [0.0, 1.0], inputs)
    assert events(response) == [("c15", "release")]
    assert response.events[0].time == pytest.approx(0.97, abs=1e-12)


def test_a_clutch_breaks_away_beside_a_brake_on_a_planetary_carrier():
    car = pt.Driveline(
        pt.Inertia("n0", J=0.05),
        pt.Inertia("n1", J=0.017),
        pt.Clutch("c2", "n0", "n1", max_torque=10.0),
        pt.Clutch("c3", "n0", max_torque=50.0),
        pt.Inertia("n4", J=0.5),
        pt.Inertia("n5", J=0.26),
        pt.Planetary("p6", "n4", "n5", "n0", ratio=2.0),
    )
    torque = PiecewiseLinear((0.0, 0.55), (60.0, -74.0))
    response = pt.simulate(car, [0.0, 1.0], {"n1_torque": torque, "c2_capacity": 27.0})
    # by hand: n0 rests; n1 gains (60 - 27) t - 134 / 1.1 t^2 until that is 0, and breaks away where the torque is -27
    assert events(response) == [("c2", "lock"), ("c2", "slip")]
    lock, breakaway = (event.time for event in response.events)
    assert lock == pytest.approx(33.0 * 1.1 / 134.0, rel=1e-9)
    assert breakaway == pytest.approx(0.55 * 87.0 / 134.0, rel=1e-9)


def test_a_brake_may_slip_to_and_fro_more_than_a_thousand_times_a_second():
    rotor = pt.Driveline(pt.Inertia("j", J=1e-3), pt.Clutch("brake", "j", max_torque=2.0))
    t = np.arange(0, 0.05, 1 / 24000)
    response = pt.simulate(rotor, t, {"j_torque": 10.0 * np.sin(2 * np.pi * 600.0 * t)})
    # two reversals a period
    assert len(response.events) == pytest.approx(2 * 600 * 0.05, abs=2)


@pytest.mark.parametrize("inertia", [1e6, 1e9])
def test_a_huge_inertia_breaks_away_to_the_side_that_its_torque_pulls(inertia):
    car = pt.Driveline(
        pt.Inertia("drum", J=inertia),
        pt.SpringDamper("spring", "drum", "mass", stiffness=100.0, damping=0.1),
        pt.Inertia("mass", J=1.0),
        pt.Clutch("brake", "mass", max_torque=10.0, static_ratio=1.5),
    )
    response = pt.simulate(car, [0.0, 4.0], {}, {"drum": 1.0, "mass": 0.0})
    assert len(response.events) > 4
    assert {event.mode for event in response.events} <= {0, 1}  # the drum pulls forward only
    assert all(later.time > event.time for event, later in zip(response.events, response.events[1:], strict=False))


def test_what_rounding_leaves_of_a_sum_of_ramps_is_no_capacity():
    # in doubles 0.3 - 0.1 - 0.2 is -2.8e-17 and 0.8 - 0.1 - 0.7 is 1.1e-16
    pair = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=1.0))
    for first, second in ((0.1, 0.2), (0.1, 0.7)):
        whole = round(first + second, 1)
        opening = pt.step(0.0, whole) + pt.ramp(1.0, 0.2, -first) + pt.ramp(1.0, 0.2, -second)
        assert 0.0 < abs(opening(2.0)) < 1e-15
        response = pt.simulate(pair, [0.0, 2.0], {"clutch_capacity": opening})
        assert events(response)[-1] == ("clutch", "release")
        assert response.events[-1].time == pytest.approx(1.2, abs=1e-9)

        system = pt.nonlinear_system(pair, dt=0.1, hold="zero")
        inputs = [{"clutch_capacity": opening(2.0)}.get(name, 0.0) for name in system.input_labels]
        y = system.output(0.0, np.zeros(system.nstates), inputs)
        assert y[system.output_labels.index("clutch_mode")] == 2
