"""Control unit: gears engage and let go without a bump, limits and rate are kept, nothing winds up."""

import control
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.base.systems import linear_system
from powertrain_ctrl.sampled.driving import Gears

DT = 0.01
FORGET = np.exp(-DT / 0.05)


def gain_of(gain, ratio):
    """Demand minus gain times twist rate."""
    inputs = ["torque_demand", "engine_speed", "wheels_speed"]
    return linear_system([], [], [], [[1.0, -gain, gain * ratio]], dt=DT, inputs=inputs, outputs=["torque_command"])


def following(share):
    """From what came of the last command towards the demand, by a share of what is missing."""
    inputs = ["torque_demand", "torque_limited"]
    A, B, C, D = [[0.0]], [[share, 1.0 - share]], [[1.0]], [[0.0, 0.0]]
    return linear_system(A, B, C, D, dt=DT, inputs=inputs, outputs=["torque_command"])


def unit(controllers, **values):
    return pt.ControlUnit(controllers=controllers, dt=DT, **values)


def test_without_controller_the_demand_passes_within_limits_and_rate():
    stepper = unit(None, torque_limits=(-20.0, 50.0), torque_rate=(500.0, 1000.0)).start(torque=0.0)
    given = [stepper.step(demand, 0.0, 0.0, 18.0) for demand in (8.0, *[100.0] * 11, 0.0, *[-100.0] * 8)]
    expected = [
        5.0,
        *(min(5.0 + 5.0 * k, 50.0) for k in range(1, 12)),
        40.0,
        *(max(40.0 - 10.0 * k, -20.0) for k in range(1, 9)),
    ]
    np.testing.assert_allclose(given, expected, atol=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_the_rate_is_never_exceeded_whatever_is_asked_for(seed):
    rng = np.random.default_rng(seed)
    stepper = unit(
        {18.0: gain_of(6.0, 18.0), 10.0: gain_of(4.0, 10.0)}, torque_limits=(-50.0, 300.0), torque_rate=(1.5e3, 3e3)
    ).start(20.0)
    given = [20.0]
    for _ in range(300):
        demand, engine, wheels = rng.normal(100.0, 200.0), rng.normal(200.0, 50.0), rng.normal(15.0, 5.0)
        given.append(stepper.step(demand, engine, wheels, float(rng.choice([0.0, 18.0, 10.0]))))
    change = np.diff(given) / DT
    assert change.min() >= -3e3 - 1e-6
    assert change.max() <= 1.5e3 + 1e-6
    assert min(given) >= -50.0
    assert max(given) <= 300.0


def test_from_gear_to_gear_the_command_has_no_step_and_the_difference_dies_out():
    """Twist rate 10 rad/s at the engine when the second gear engages: in the end 4 N m s/rad take 40 N m off."""
    stepper = unit({18.0: gain_of(6.0, 18.0), 10.0: gain_of(4.0, 10.0)}).start(100.0)
    first = [stepper.step(100.0, 180.0, 10.0, 18.0) for _ in range(3)]
    slipping = [stepper.step(100.0, 150.0, 10.0, 0.0) for _ in range(2)]
    second = [stepper.step(100.0, 110.0, 10.0, 10.0) for _ in range(4)]
    np.testing.assert_allclose(first + slipping, 100.0, rtol=1e-14)
    np.testing.assert_allclose(second, [100.0 - 40.0 * (1.0 - FORGET**k) for k in range(4)], rtol=1e-12)


def test_filters_of_a_gear_that_engages_have_read_for_50_ms_what_they_read_then():
    """Lead on a twist rate of 10 rad/s: answer of so many samples later, its first value taken off and dying out."""
    pole, through, gain = 0.4, 3.0, 1.0
    C = (gain - through) * (1.0 - pole)
    inputs = ["torque_demand", "engine_speed", "wheels_speed"]
    lead = linear_system(
        [[pole]],
        [[0.0, -1.0, 18.0]],
        [[C]],
        [[1.0, -through, 18.0 * through]],
        dt=DT,
        inputs=inputs,
        outputs=["torque_command"],
    )
    answer = [10.0 * (through + C * (1.0 - pole**k) / (1.0 - pole)) for k in range(30)]
    stepper = unit({18.0: lead}).start(100.0)
    given = [stepper.step(100.0, 180.0, 10.0 - 10.0 / 18.0, ratio) for ratio in (0.0, *[18.0] * 20)]
    expected = [100.0 - answer[5 + k] + answer[5] * FORGET**k for k in range(20)]
    np.testing.assert_allclose(given, [100.0, *expected], rtol=1e-12)
    # so that the command goes down only, as by a gain
    assert np.diff(given[1:]).max() < 0.0


@pytest.mark.parametrize(("ratio", "gain"), [(18.0, 6.0), (17.0, 6.0), (14.0, 6.0), (13.9, 4.0), (2.0, 4.0)])
def test_the_controller_of_the_nearest_ratio_counts_and_of_two_equally_near_the_first(ratio, gain):
    stepper = unit({18.0: gain_of(6.0, ratio), 10.0: gain_of(4.0, ratio)}).start(0.0)
    given = [stepper.step(0.0, ratio + 5.0, 1.0, ratio) for _ in range(200)]
    # relative to a rigid driveline at the first sample: 5 rad/s of twist rate over all
    assert given[0] == pytest.approx(0.0, abs=1e-12)
    assert given[-1] == pytest.approx(-5.0 * gain, rel=1e-9)


def test_a_controller_that_is_told_what_came_of_its_command_does_not_wind_up():
    stepper = unit(following(0.2), torque_limits=(-100.0, 100.0)).start(0.0)
    stepper.step(0.0, 18.0, 1.0, 18.0)
    held = [stepper.step(300.0, 18.0, 1.0, 18.0) for _ in range(200)]
    back = [stepper.step(50.0, 18.0, 1.0, 18.0) for _ in range(300)]
    assert max(held) == 100.0
    assert min(back[5:]) < 60.0  # at once, not after what 2 s of being at the limit could have piled up
    assert back[-1] == pytest.approx(50.0, abs=1e-6)


def test_what_compensates_goes_past_the_controller():
    """It neither is taken for a demand nor for a torque that the controller's own command became."""
    stepper, alone = (unit({18.0: following(0.3)}).start(10.0) for _ in range(2))
    for k in range(50):
        added = 40.0 * np.sin(0.3 * k)
        given = stepper.step(10.0 + k, 18.0, 1.0, 18.0, torque_compensation=added)
        assert given == pytest.approx(alone.step(10.0 + k, 18.0, 1.0, 18.0) + added, rel=1e-12)


def test_a_schedule_over_gears_of_its_own_reads_the_ratio():
    gears = {18.0: gain_of(6.0, 18.0), 10.0: gain_of(4.0, 10.0)}
    whole, parts = unit(pt.antijerk.scheduled(gears, dt=DT)).start(50.0), unit(gears).start(50.0)
    for k in range(40):
        read = (50.0 + k, 180.0 + np.sin(k), 10.0, 18.0)
        assert whole.step(*read) == pytest.approx(parts.step(*read), rel=1e-12)


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        (
            {"torque_limits": (50.0, -50.0)},
            pt.ParameterError,
            r"torque_limits = \(50.0, -50.0\) N m, permitted: \(smallest, largest\)",
        ),
        (
            {"torque_rate": (0.0, 10.0)},
            pt.ParameterError,
            r"torque_rate = \(0.0, 10.0\) N m/s, permitted: > 0",
        ),
        ({"dt": 0.02}, pt.PowertrainError, "the controller has dt = 0.01 s, the plant dt = 0.02 s"),
        ({"controllers": control.ss([], [], [], [[1.0]])}, pt.PowertrainError, "the controller is"),
    ],
)
def test_a_unit_that_cannot_be_is_refused(values, error, message):
    with pytest.raises(error, match=message):
        pt.ControlUnit(**{"controllers": gain_of(6.0, 18.0), "dt": DT} | values)


def test_a_unit_says_in_one_line_what_it_is():
    shown = repr(unit({18.0: gain_of(6.0, 18.0)}, torque_limits=(0.0, 350.0), torque_rate=(2e3, 4e3)))
    assert (
        shown == "ControlUnit: dt 10 ms, torque 0 to 350 N m, at most 2000 up and 4000 N m/s down; controllers for 18"
    )
    assert repr(unit(None)) == "ControlUnit: dt 10 ms, torque without limits, at any rate; controllers for none"
    lifted = unit(gain_of(6.0, 18.0), torque_limits=(-np.inf, 350.0), torque_rate=(np.inf, 500.0))
    assert "10 ms, torque up to 350 N m, at most 500 N m/s down; controllers for any gear" in repr(lifted)


# --- which gear drives


def test_the_ratio_is_that_of_the_clutches_that_hold():
    car = pt.examples.p2_hybrid(1, 2)
    gears = Gears(car, pt.SampledPlant(car=car))
    joined = {"separation_clutch"}
    cases = {
        frozenset(joined | {"odd_clutch"}): 3.92 * 4.1,
        frozenset(joined | {"even_clutch"}): 2.43 * 4.1,
        frozenset(joined): 0.0,
        frozenset({"odd_clutch"}): 0.0,  # the engine is behind the open separation clutch
        frozenset(joined | {"odd_clutch", "even_clutch"}): 0.0,  # both: at standstill
        frozenset(): 0.0,
    }
    for holding, ratio in cases.items():
        assert gears.ratio(holding) == pytest.approx(ratio, rel=1e-12)


def test_a_car_without_clutches_always_drives():
    car = pt.examples.electric()
    assert Gears(car, pt.SampledPlant(car=car)).ratio(frozenset()) == pytest.approx(9.5, rel=1e-12)
