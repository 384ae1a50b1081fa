"""The sampled plant, its metrics and margins, and the controlled launch, by other roads.

Of sampled/controller, sampled/plant, sampled/sensors, sampled/manoeuvres, sampled/fold, linear/schur.
"""

import dataclasses
from itertools import pairwise

import control
import numpy as np
import pytest
import scipy.integrate
import scipy.linalg
import scipy.optimize
import scipy.signal

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk, studies
from powertrain_ctrl.base.systems import linear_system
from powertrain_ctrl.hybrid.signals import PiecewiseLinear
from powertrain_ctrl.sampled.unit import ControlUnit

CAR = pt.examples.conventional()
PLANT = pt.SampledPlant(car=CAR)
DESIGNS = antijerk.designs(PLANT)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.01, 0.013, 0.02, 0.027])
def test_delay_of_any_length_is_exact_in_the_discrete_model(delay):
    """Against a plant sampled so finely that the delay is a whole number of samples."""
    plant = dataclasses.replace(PLANT, delay=delay)
    fine = dataclasses.replace(plant, dt=0.001)
    u = np.random.default_rng(0).normal(size=40)
    coarse = control.forced_response(plant.discrete(), np.arange(40) * 0.01, u).outputs
    held = np.repeat(u, 10)
    exact = control.forced_response(fine.discrete(), np.arange(400) * 0.001, held).outputs[:, ::10]
    np.testing.assert_allclose(coarse, exact, atol=1e-9 * np.abs(exact).max())


def test_discrete_model_without_delay_is_the_zero_order_hold():
    plant = dataclasses.replace(PLANT, delay=0.0)
    P = plant.continuous
    whole = scipy.linalg.expm(np.block([[P.A, P.B[:, :1]], [np.zeros((1, len(P.A) + 1))]]) * 0.01)
    n = len(P.A)
    np.testing.assert_allclose(plant.discrete().A, whole[:n, :n], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(plant.discrete().B, whole[:n, n:], rtol=1e-12, atol=1e-12)


def by_solve_ivp(plant, controller, demand, count, force=None):
    """Engine speed and vehicle acceleration at the samples: every stretch of constant command by DOP853."""
    P = plant.continuous
    commands, x, limited, rows = {}, np.zeros(P.nstates), 0.0, []
    unit = None if controller is None else pt.ControllerStepper(controller, plant.dt)
    low, high = plant.torque_limits
    for k in range(count):
        y = P.C @ x
        rows.append([y[0], (y + P.D @ [0.0, 0.0 if force is None else force(k * plant.dt)])[3]])
        command = float(demand(k * plant.dt))
        if unit is not None:
            command = unit.step(torque_demand=command, engine_speed=y[0], wheels_speed=y[1], torque_limited=limited)
        limited = commands[k] = min(max(command, low), high)
        start, stop = k * plant.dt, (k + 1) * plant.dt
        # commands that arrive within this sample
        arrivals = sorted(t for t in (j * plant.dt + plant.delay for j in commands) if start + 1e-12 < t < stop - 1e-12)
        edges = [start, *arrivals, stop]
        for a, b in pairwise(edges):
            j = int(np.floor((0.5 * (a + b) - plant.delay) / plant.dt))
            acting = commands.get(j, 0.0)

            def rate(t, x, acting=acting):
                return P.A @ x + P.B @ [acting, 0.0 if force is None else force(t)]

            x = scipy.integrate.solve_ivp(rate, (a, b), x, "DOP853", rtol=1e-10, atol=1e-11, max_step=0.005).y[:, -1]
    return np.array(rows).T


@pytest.mark.parametrize(("delay", "lag"), [(0.01, 0.03), (0.013, 0.03), (0.0, 0.03), (0.004, 0.05)])
def test_closed_loop_is_that_of_an_ode_solver(delay, lag):
    plant = dataclasses.replace(PLANT, delay=delay, lag=lag, torque_limits=(0.0, 260.0))
    controller = DESIGNS["P, lead, notch"]
    demand = pt.ramp(0.05, 0.1, 250.0)
    response = pt.closed_loop(plant, controller, demand, duration=0.5)
    expected = by_solve_ivp(plant, controller, demand, 50)
    np.testing.assert_allclose(response["engine_speed"][:-1:10], expected[0], atol=1e-7)
    np.testing.assert_allclose(response["vehicle_acceleration"][:-1:10], expected[1], atol=1e-7)
    assert response["torque_command"].max() <= 260.0


def test_points_between_samples_are_on_the_exact_curve():
    plant = dataclasses.replace(PLANT, delay=0.013)
    demand = pt.step(0.0, 100.0)
    few = pt.closed_loop(plant, None, demand, duration=0.3, steps_per_sample=1)
    many = pt.closed_loop(plant, None, demand, duration=0.3, steps_per_sample=7)
    np.testing.assert_allclose(many["engine_speed"][::7], few["engine_speed"], atol=1e-12)
    # against the continuous system driven by the delayed step
    t = many.time
    exact = control.forced_response(plant.continuous[:, 0], np.linspace(0, 0.3, 301), 100.0 * np.ones(301)).outputs
    shifted = np.interp(t - 0.013, np.linspace(0, 0.3, 301), exact[3], left=0.0)
    inside = t > 0.014
    np.testing.assert_allclose(many["vehicle_acceleration"][inside], shifted[inside], atol=2e-3)


def test_a_plant_without_lag_passes_the_command_to_the_engine():
    plant = dataclasses.replace(PLANT, lag=0.0, delay=0.01)
    response = pt.closed_loop(plant, None, pt.step(0.1, 80.0), duration=0.3)
    assert response["engine_torque"][response.time < 0.1095].max() == 0.0
    assert (response["engine_torque"][response.time > 0.1105] == 80.0).all()
    discrete = control.forced_response(plant.discrete(), np.arange(31) * 0.01, np.r_[np.zeros(10), 80.0 * np.ones(21)])
    np.testing.assert_allclose(discrete.outputs[4], response["engine_torque"][::10], atol=1e-12)
    np.testing.assert_allclose(discrete.outputs[0], response["engine_speed"][::10], atol=1e-9)


def test_disturbance_is_exact_with_the_loop_closed():
    controller = DESIGNS["P"]

    def force(t):
        return -2000.0 * np.sin(np.pi * (t - 0.1) / 0.1) if 0.1 < t < 0.2 else 0.0

    plant = dataclasses.replace(PLANT, torque_limits=(-1e3, 1e3))
    response = pt.closed_loop(plant, controller, pt.step(0.0, 0.0), duration=0.5, disturbance=force)
    expected = by_solve_ivp(plant, controller, pt.step(0.0, 0.0), 50, force)
    np.testing.assert_allclose(response["engine_speed"][:-1:10], expected[0], atol=2e-6)
    np.testing.assert_allclose(response["vehicle_acceleration"][:-1:10], expected[1], atol=2e-6)


def test_tip_out_mirrors_tip_in():
    symmetric = dataclasses.replace(PLANT, torque_limits=(-100.0, 350.0))
    controller = DESIGNS["two degrees of freedom"]
    up, down = pt.tip_in(symmetric, controller), pt.tip_out(symmetric, controller)
    np.testing.assert_allclose(down["vehicle_acceleration"], -up["vehicle_acceleration"], atol=1e-9)
    np.testing.assert_allclose(down["torque_command"], 250.0 - up["torque_command"], atol=1e-9)
    metrics = [studies.tip_in_metrics(PLANT, each) for each in (up, down)]
    assert metrics[1].final == pytest.approx(-metrics[0].final, rel=1e-12)
    assert metrics[0].overshoot == pytest.approx(metrics[1].overshoot, rel=1e-6)


def test_sensors_disturb_reproducibly():
    controller = DESIGNS["P"]
    noisy = pt.Sensors(engine_noise=0.5, wheels_noise=0.03, seed=4)
    first, second = (pt.tip_in(PLANT, controller, sensors=noisy) for _ in range(2))
    np.testing.assert_array_equal(first["torque_command"], second["torque_command"])
    clean = pt.tip_in(PLANT, controller)
    spread = np.std((first["torque_command"] - clean["torque_command"])[::10])
    # gain 6 on engine noise 0.5 and 18 times wheel noise 0.03
    assert spread == pytest.approx(6.0 * np.hypot(0.5, 18 * 0.03), rel=0.25)
    coarse = pt.tip_in(PLANT, controller, sensors=pt.Sensors(engine_resolution=1.0, wheels_resolution=0.1))
    assert 0.0 < np.abs(coarse["torque_command"] - clean["torque_command"]).max() < 6.0 * (0.5 + 18 * 0.05) + 20.0


@pytest.mark.parametrize(("more", "whole", "rest"), [(0.0, 3, 0.0), (5e-12, 3, 0.0), (-5e-12, 3, 0.0), (1e-8, 3, 1e-8)])
def test_a_delay_is_whole_samples_but_for_rounding(more, whole, rest):
    found = dataclasses.replace(PLANT, delay=0.03 + more).delay_in_samples
    assert found[0] == whole
    assert found[1] == pytest.approx(rest, rel=1e-6)


def test_errors_of_the_sensors_are_added_to_the_speeds():
    sensors = pt.Sensors(engine_noise=0.5, wheels_noise=0.03, seed=4)
    controller = antijerk.one_dof(PLANT, antijerk.speed_difference(PLANT, 6.0))
    response = pt.closed_loop(PLANT, controller, pt.step(0.0, 100.0), 0.02, sensors=sensors, steps_per_sample=1)
    engine, wheels = sensors.errors(3)
    # all at rest until the first command arrives
    np.testing.assert_allclose(response["intervention"][:2], -6.0 * (engine - 18.0 * wheels)[:2], rtol=1e-12)


@pytest.mark.parametrize("value", [np.nan, -np.inf, None, "12", True, 1j, [1.0], 10**400])
def test_a_stepper_takes_finite_numbers_only_and_stays_as_it_was(value):
    unit = pt.ControllerStepper(DESIGNS["LQG"], PLANT.dt)
    read = {"torque_demand": 100.0, "engine_speed": 2.0, "wheels_speed": 0.1, "torque_limited": 90.0}
    first = unit.step(**read)
    with pytest.raises(pt.SignalError, match=r'input "engine_speed" is .*, permitted: a finite number'):
        unit.step(**read | {"engine_speed": value})
    again = pt.ControllerStepper(unit.controller, PLANT.dt)
    assert again.step(**read) == first
    assert again.step(**read) == unit.step(**read | {"ratio": value})  # which it does not read
    assert unit.time == pytest.approx(0.02)


@pytest.mark.parametrize("value", [np.float32(2.0), np.int64(2), 2])
def test_a_stepper_takes_any_kind_of_number(value):
    unit = pt.ControllerStepper(antijerk.one_dof(PLANT, antijerk.speed_difference(PLANT, 6.0)), PLANT.dt)
    assert unit.step(torque_demand=100.0, engine_speed=value, wheels_speed=0.0, torque_limited=0.0) == 88.0


@dataclasses.dataclass(frozen=True)
class Measured:
    """A force as a user's own frozen record."""

    time: np.ndarray
    force: np.ndarray
    scale: list

    def __call__(self, t):
        return self.scale[0] * float(np.interp(t, self.time, self.force))


def test_a_frozen_record_of_the_users_is_a_disturbance_computed_anew():
    push = Measured(np.array([0.0, 0.1, 0.2]), np.array([0.0, -1000.0, 0.0]), [1.0])
    once = pt.closed_loop(PLANT, None, pt.step(0.0, 0.0), 0.3, disturbance=push)["vehicle_acceleration"]
    push.scale[0] = 2.0
    twice = pt.closed_loop(PLANT, None, pt.step(0.0, 0.0), 0.3, disturbance=push)["vehicle_acceleration"]
    np.testing.assert_allclose(twice, 2.0 * once, atol=1e-9)
    assert np.abs(once).max() > 0.1


def test_the_open_loop_of_a_proof_is_computed_once_for_a_plant_and_not_kept_in_it():
    plant = dataclasses.replace(PLANT, delay=0.0123)
    studies.prove(plant, None)
    assert set(vars(plant)) <= {*vars(PLANT), "ratio", "vehicle", "wheels", "continuous", "outputs", "inertia"}


@pytest.mark.parametrize("name", ["lag", "delay", "dt"])
def test_times_of_a_second_or_more_are_milliseconds(name):
    message = rf"sampled plant: {name} = 30.0 s, permitted: .* and below 1; 30 ms is 0.03 s"
    with pytest.raises(pt.ParameterError, match=message):
        pt.SampledPlant(car=CAR, **{name: 30})
    with pytest.raises(pt.ParameterError, match=r"1 ms is 0\.001 s"):
        pt.SampledPlant(car=CAR, **{name: 1})
    assert getattr(pt.SampledPlant(car=CAR, **{name: 0.999}), name) == 0.999


@pytest.mark.parametrize(("duration", "samples"), [(0.0249, 2), (0.025 - 1e-13, 3), (0.025, 3), (0.026, 3)])
def test_half_a_sample_counts_as_a_whole_one(duration, samples):
    response = pt.closed_loop(PLANT, None, pt.step(0.0, 0.0), duration, steps_per_sample=1)
    assert len(response.time) == samples + 1


def test_half_a_quantum_is_rounded_up_also_where_rounding_leaves_it_short():
    sensors = pt.Sensors(engine_resolution=0.5, wheels_resolution=0.1)
    assert sensors.quantised(np.array([0.75, 0.25])) == pytest.approx([1.0, 0.3])
    assert sensors.quantised(np.array([0.75 - 1e-12, 0.25 - 1e-12])) == pytest.approx([1.0, 0.3])
    assert sensors.quantised(np.array([0.75 - 1e-6, 0.25 - 1e-6])) == pytest.approx([0.5, 0.2])
    assert sensors.quantised(np.array([-0.75, -0.8])) == pytest.approx([-0.5, -0.8])


def test_a_command_that_arrives_at_a_point_of_the_response_acts_there():
    """The delay is 0.3 of a sample, where the third of ten points is, but for rounding."""
    plant = dataclasses.replace(PLANT, lag=0.0, delay=0.003)
    for shift in (0.0, 1e-14, -1e-14):
        response = pt.closed_loop(dataclasses.replace(plant, delay=0.003 + shift), None, pt.step(0.0, 80.0), 0.02)
        assert response["engine_torque"][:5].tolist() == [0.0, 0.0, 0.0, 80.0, 80.0]


@pytest.mark.parametrize(("excess", "expected"), [(0.5e-6, True), (2e-6, False)])
def test_a_controller_on_the_unit_circle_is_permitted_and_one_outside_not(excess, expected):
    labels = {"inputs": ["engine_speed"], "outputs": ["torque_command"]}
    controller = control.ss([[1.0 + excess]], [[0.0]], [[0.0]], [[0.0]], PLANT.dt, **labels)
    if expected:
        assert pt.ControllerStepper(controller, PLANT.dt).step(engine_speed=1.0) == 0.0
    else:
        with pytest.raises(pt.PowertrainError, match="the controller is unstable by itself"):
            pt.ControllerStepper(controller, PLANT.dt)


@pytest.mark.parametrize(("share", "expected"), [(1e-10, True), (1e-8, False)])
def test_sample_times_are_the_same_but_for_rounding(share, expected):
    plant = pt.SampledPlant(car=CAR, dt=1e-4, delay=0.0)
    labels = {"inputs": ["engine_speed"], "outputs": ["torque_command"]}
    controller = linear_system([], [], [], [[0.0]], 1e-4 * (1.0 + share), **labels)
    shaping = linear_system([], [], [], [[1.0]], 1e-4 * (1.0 + share))
    if expected:
        pt.ControllerStepper(controller, plant.dt)
        antijerk.speed_difference(plant, 6.0, shaping)
        return
    for make in (
        lambda: pt.ControllerStepper(controller, plant.dt),
        lambda: antijerk.speed_difference(plant, 6.0, shaping),
    ):
        with pytest.raises(pt.PowertrainError, match="permitted: "):
            make()


def test_the_torque_before_may_be_at_a_limit_but_for_rounding():
    plant = dataclasses.replace(PLANT, torque_limits=(0.0, 0.3))
    steady = pt.closed_loop(plant, None, lambda t: 0.1 + 0.2, 0.1, initial_torque=0.1 + 0.2)
    assert np.abs(steady["vehicle_acceleration"]).max() < 1e-12
    with pytest.raises(pt.ParameterError, match="initial_torque"):
        pt.closed_loop(plant, None, lambda t: 0.3, 0.1, initial_torque=0.3 + 1e-8)


# --- metrics


@pytest.mark.parametrize("torque", [100.0, 300.0])
def test_metrics_of_a_tip_in_are_relative_to_its_own_torque(torque):
    at_250 = studies.tip_in_metrics(PLANT, pt.tip_in(PLANT))
    metrics = studies.tip_in_metrics(PLANT, pt.tip_in(PLANT, torque=torque))
    # 18 / (0.35 * (all inertia at the wheels)) as in the test of integrators
    wheels = (0.3 + 0.05 + 0.1 + 0.03 + 0.05 / 36) * 324 + 4 + 2000 * 0.35**2
    assert metrics.final == pytest.approx(torque * 18.0 * 0.35 / wheels, rel=1e-9)
    for name in ("overshoot", "peak_to_peak", "t90", "settling"):
        assert getattr(metrics, name) == pytest.approx(getattr(at_250, name), rel=1e-9), name


def test_metrics_need_a_change_of_the_torque_demand():
    steady = pt.wheel_disturbance(PLANT)
    with pytest.raises(
        pt.SignalError, match="the torque demand is 175 N m at both ends, permitted: a tip-in or tip-out"
    ):
        studies.tip_in_metrics(PLANT, steady)
    with pytest.raises(pt.UnknownNameError, match='signal "torque_demand" is not in this response'):
        studies.tip_in_metrics(PLANT, pt.load_change(CAR))
    with pytest.raises(pt.SignalError, match="at both ends"):
        studies.tip_in_metrics(PLANT, pt.closed_loop(PLANT, None, pt.ramp(0.5, 0.1, 100.0 + 1e-8, 100.0)))
    assert studies.tip_in_metrics(PLANT, pt.closed_loop(PLANT, None, pt.ramp(0.5, 0.1, 100.001, 100.0))).final > 0.0


def test_metrics_of_a_second_order_step():
    zeta, w = 0.2, 2 * np.pi * 3.0
    t = np.linspace(0.0, 5.0, 50001)
    wd = w * np.sqrt(1 - zeta**2)
    a = 2.0 * (1 - np.exp(-zeta * w * t) * (np.cos(wd * t) + zeta / np.sqrt(1 - zeta**2) * np.sin(wd * t)))
    m = pt.ride_metrics(t, a, final=2.0)
    peak = np.exp(-zeta * np.pi / np.sqrt(1 - zeta**2))
    assert m.overshoot == pytest.approx(peak, rel=1e-6)
    assert m.peak_to_peak == pytest.approx(peak + peak**2, rel=1e-6)
    largest_jerk = 2.0 * w * np.exp(-zeta / np.sqrt(1 - zeta**2) * np.arccos(zeta))
    assert m.peak_jerk == pytest.approx(largest_jerk, rel=1e-5)
    first_90 = t[np.argmax(a >= 1.8)]
    assert m.t90 == pytest.approx(first_90, abs=2e-4)


def test_band_pass_passes_the_shuffle_and_no_trend():
    t = np.linspace(0.0, 20.0, 20001)
    inside = np.sin(2 * np.pi * 3.2 * t)
    m = pt.ride_metrics(t, inside + 0.0, final=1.0)
    assert m.rms == pytest.approx(np.sqrt(0.5), rel=0.02)
    assert m.vdv == pytest.approx((0.375 * 20.0) ** 0.25, rel=0.02)
    assert pt.ride_metrics(t, np.sin(2 * np.pi * 0.05 * t), final=1.0).rms < 0.01


def test_times_are_measured_from_the_start_given():
    zeta, w = 0.2, 2 * np.pi * 3.0
    t, wd = np.linspace(-1.0, 5.0, 6001), w * np.sqrt(1 - zeta**2)
    swing = np.cos(wd * t) + zeta / np.sqrt(1 - zeta**2) * np.sin(wd * t)
    a = np.where(t < 0.0, 0.0, 1.0 - np.exp(-zeta * w * t) * swing)
    now, later = pt.ride_metrics(t, a, final=1.0, start=0.0), pt.ride_metrics(t + 2.0, a, final=1.0, start=2.0)
    for name in ("overshoot", "peak_to_peak", "peak_jerk", "vdv", "rms", "t50", "t90", "t10_90", "settling"):
        assert getattr(later, name) == pytest.approx(getattr(now, name), rel=1e-9), name
    assert later.t90 == pytest.approx(t[np.argmax(a >= 0.9)], abs=1e-3)
    # within 5 % for good: the last extremum of half period k that is outside decides
    extrema = np.exp(-zeta * np.pi / np.sqrt(1 - zeta**2) * np.arange(1, 20))
    k = int(np.count_nonzero(extrema > 0.05))
    assert k * np.pi / wd < later.settling < (k + 1) * np.pi / wd


def test_times_lie_on_the_straight_lines_between_samples():
    # from 0 to 1 within 0.1 to 0.21 s; the line from 0.09 to 0.12 s is not that of the ramp
    t = 0.03 * np.arange(40)
    a = np.clip((t - 0.1) / 0.11, 0.0, 1.0)
    metrics = pt.ride_metrics(t, a, final=1.0)
    t50, t90, t10 = 0.1 + 0.5 * 0.11, 0.1 + 0.9 * 0.11, 0.09 + 0.03 * 0.1 * 0.11 / 0.02
    np.testing.assert_allclose([metrics.t50, metrics.t90, metrics.t10_90], [t50, t90, t90 - t10], atol=1e-12)


@pytest.mark.parametrize(("lag", "delay"), [(0.03, 0.013), (0.03, 0.004), (0.0, 0.027), (0.03, 0.01), (0.0, 0.0)])
def test_between_samples_the_response_is_that_of_the_commands_held_and_delayed(lag, delay):
    plant = pt.SampledPlant(car=CAR, lag=lag, delay=delay)
    controller = DESIGNS["P"]
    response = pt.closed_loop(plant, controller, pt.ramp(0.05, 0.1, 200.0), 0.6, steps_per_sample=10)
    h = plant.dt / 10
    command = response["torque_command"]
    acting = np.concatenate([np.zeros(round(delay / h)), command])[: len(command)]
    P = plant.continuous
    n = len(P.A)
    step = scipy.linalg.expm(h * np.block([[P.A, P.B[:, :1]], [np.zeros((1, n + 1))]]))
    x, expected = np.zeros(n), []
    for u in acting:
        expected.append(P.C @ x + P.D[:, 0] * u)
        x = step[:n, :n] @ x + step[:n, n] * u
    for name, values in zip(P.output_labels, np.transpose(expected), strict=True):
        np.testing.assert_allclose(response[name], values, rtol=0.0, atol=1e-9 * np.abs(values).max(), err_msg=name)


def test_the_speed_difference_of_a_loop_is_that_of_its_speeds():
    response = pt.closed_loop(PLANT, DESIGNS["P"], pt.ramp(0.1, 0.1, 200.0), 1.0, disturbance=pt.step(0.5, -1000.0))
    expected = response["engine_speed"] - PLANT.ratio * response["wheels_speed"]
    np.testing.assert_allclose(response["speed_difference"], expected, rtol=0.0, atol=1e-9)
    assert np.abs(expected[response.time > 0.5]).max() > 1.0


def test_it_has_settled_at_the_first_sample_from_which_it_stays():
    t = 0.01 * np.arange(400)
    a = np.where(np.arange(400) < 31, 0.5, 1.0)
    assert pt.ride_metrics(t, a, final=1.0).settling == pytest.approx(0.31, abs=1e-12)


def test_the_vibration_is_that_of_a_record_held_for_3_s_at_both_ends():
    t = 0.002 * np.arange(2501)
    a = np.where(t > 4.8, 1.0 + 0.3 * np.sin(20.0 * t), 0.0)
    metrics = pt.ride_metrics(t, a, final=1.0)
    held = np.concatenate([np.full(1500, a[0]), a, np.full(1500, a[-1])])
    bands = scipy.signal.butter(2, (1.0, 10.0), btype="bandpass", fs=500.0, output="sos")
    felt = scipy.signal.sosfiltfilt(bands, held, padtype=None)[1500:-1500]
    assert metrics.rms == pytest.approx(np.sqrt(np.mean(felt**2)), rel=1e-9)
    assert metrics.vdv == pytest.approx((np.sum(felt**4) * 0.002) ** 0.25, rel=1e-9)


def test_metrics_refuse_what_they_cannot_measure():
    with pytest.raises(pt.PowertrainError, match="evenly spaced"):
        pt.ride_metrics([0.0, 1.0, 3.0], [0.0, 1.0, 1.0], final=1.0)
    with pytest.raises(pt.PowertrainError, match="permitted: not 0"):
        pt.ride_metrics(np.linspace(0, 4, 401), np.ones(401), final=0.0)
    with pytest.raises(pt.PowertrainError, match="by less than 50 ms"):
        pt.ride_metrics(0.06 * np.arange(60), np.ones(60), final=1.0)


# --- margins


@pytest.mark.parametrize("gain", [6.0, 20.0, 35.0])
def test_margins_are_those_at_the_exact_crossings(gain):
    plant = pt.SampledPlant(car=pt.examples.conventional())
    margins = pt.loop_margins(plant, antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=gain)))
    G = plant.discrete()

    def loop(omega):
        z = np.exp(1j * omega * plant.dt)
        engine, wheels = (G.C[:2] @ np.linalg.solve(z * np.eye(len(G.A)) - G.A, G.B))[:, 0]
        return gain * (engine - plant.ratio * wheels)

    def crossings(function):
        grid = np.linspace(1.0, 0.9999 * np.pi / plant.dt, 4000)
        values = np.array([function(w) for w in grid])
        return [scipy.optimize.brentq(function, *grid[i : i + 2]) for i in np.flatnonzero(np.diff(np.sign(values)))]

    phases = [abs(np.degrees(np.angle(-loop(w)))) for w in crossings(lambda w: abs(loop(w)) - 1.0)]
    assert margins.phase_margin_deg == pytest.approx(min(phases), abs=1e-5)
    real = [loop(w).real for w in crossings(lambda w: loop(w).imag)]
    gains = [abs(20.0 * np.log10(-value)) for value in real if value < -1e-6]
    assert margins.gain_margin_db == pytest.approx(min(gains), abs=1e-5)

    def narrowness(omega):
        return -abs((1.0 - loop(omega)) / (1.0 + loop(omega)))

    grid = np.linspace(1.0, 0.9999 * np.pi / plant.dt, 4000)
    at = int(np.argmin([narrowness(w) for w in grid]))
    bounds = (grid[max(at - 1, 0)], grid[min(at + 1, 3999)])
    best = scipy.optimize.minimize_scalar(narrowness, bounds=bounds, method="bounded", options={"xatol": 1e-9})
    assert margins.disk_margin == pytest.approx(-2.0 / best.fun, rel=1e-8)


@pytest.mark.parametrize("name", ["P", "P, lead, notch", "LQG", "H-infinity"])
def test_margins_are_those_of_python_control(name):
    controller = DESIGNS[name]
    margins = pt.loop_margins(PLANT, controller)
    response = control.FrequencyResponseData(margins.loop, margins.omega)
    gm, pm, *_ = control.stability_margins(response)
    if np.isfinite(gm):
        assert margins.gain_margin_db == pytest.approx(abs(20 * np.log10(gm)), abs=0.3)
    if np.isfinite(pm):
        assert margins.phase_margin_deg <= abs(pm) + 0.3
    # disk margin by its definition on the sensitivity, on a grid of its own
    grid = np.linspace(0.01, 0.999, 7000) * np.pi / PLANT.dt
    L = np.interp(grid, margins.omega, margins.loop.real) + 1j * np.interp(grid, margins.omega, margins.loop.imag)
    S = 1.0 / (1.0 + L)
    assert margins.disk_margin == pytest.approx(min(2.0, 1.0 / np.abs(S - 0.5).max()), rel=2e-3)


@pytest.mark.filterwarnings("ignore:Setting the shape on a NumPy array")  # python-control's own, with numpy 2.5
def test_disk_margin_of_a_known_loop_is_that_of_python_control():
    feedback = antijerk.speed_difference(PLANT, 6.0)
    margins = pt.loop_margins(PLANT, antijerk.one_dof(PLANT, feedback))
    G = PLANT.discrete()
    difference = control.ss(G.A, G.B, 6.0 * G.C[2:3], 6.0 * G.D[2:3], dt=PLANT.dt)
    inside = margins.omega[(margins.omega > 0.5) & (margins.omega < 0.98 * np.pi / PLANT.dt)]
    dm, *_ = control.disk_margins(difference, inside)
    assert margins.disk_margin == pytest.approx(float(dm), rel=1e-3)


def test_poles_are_those_of_the_closed_loop_by_simulation():
    controller = DESIGNS["P"]
    margins = pt.loop_margins(PLANT, controller)
    wide = dataclasses.replace(PLANT, torque_limits=(-1e4, 1e4))
    response = pt.closed_loop(wide, controller, pt.step(0.0, 1.0), duration=3.0)
    a = response["vehicle_acceleration"][::10] - PLANT.final_acceleration
    late = a[60:]
    peaks = np.flatnonzero((late[1:-1] > late[:-2]) & (late[1:-1] > late[2:])) + 1
    decay = np.log(late[peaks[0]] / late[peaks[1]])
    zeta = decay / np.hypot(decay, 2 * np.pi)
    assert zeta == pytest.approx(margins.zeta_first, rel=0.1)


def test_a_response_of_one_sample_is_permitted_and_one_of_less_is_not():
    assert pt.closed_loop(PLANT, None, pt.step(0.0, 1.0), duration=PLANT.dt).time[-1] == pytest.approx(PLANT.dt)
    with pytest.raises(pt.PowertrainError, match="at least one sample"):
        pt.closed_loop(PLANT, None, pt.step(0.0, 1.0), duration=0.4 * PLANT.dt)


def test_an_unstable_loop_has_no_margin_and_no_metrics():
    wild = antijerk.one_dof(PLANT, antijerk.speed_difference(PLANT, 200.0))
    margins = pt.loop_margins(PLANT, wild)
    assert (margins.stable, margins.disk_margin, margins.gain_margin_db) == (False, 0.0, 0.0)
    proof = studies.prove(PLANT, wild)
    assert np.isnan(proof.metrics.overshoot)
    assert (proof.oscillation_reduction, proof.t90_ratio, proof.disturbance_reduction) == (-np.inf, np.inf, -np.inf)


def test_without_feedback_the_margin_is_the_largest_there_is():
    margins = pt.loop_margins(PLANT, None)
    assert (margins.stable, margins.disk_margin) == (True, 2.0)
    assert margins.zeta_first == pytest.approx(0.0987, abs=1e-4)


# --- variations


@pytest.mark.parametrize(("tyre", "softest"), [(5e3, "tyres"), (40e3, "half")])
def test_the_softest_shaft_is_the_tyre_where_it_is_softer_at_the_wheel(tyre, softest):
    car = pt.Driveline(
        pt.Inertia("engine", J=0.25),
        pt.Gear("gear", "engine", "axle", ratio=12.0),
        pt.SpringDamper("half", "axle", "wheels", stiffness=12e3, damping=60.0),
        pt.Inertia("wheels", J=0.5),
        pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=tyre / 0.3**2, damping=300.0),
        pt.Mass("vehicle", m=1400.0),
    )
    assert studies.softest_shafts(car) == (softest,)


def test_variations_change_what_they_say():
    plants = studies.variations(PLANT)
    assert len(plants) == 29
    assert plants["mass -25 %"].car["vehicle"].m == 1500.0
    assert plants["drive shafts +20 %"].car["drive_shafts"].stiffness == pytest.approx(1.2 * 3.44e4)
    assert plants["drive shafts +20 %"].car["tyres"] == CAR["tyres"]
    assert plants["stiffness -20 %"].car["tyres"].stiffness == pytest.approx(0.8 * 9.8e5)
    assert (plants["delay 20 ms"].delay, plants["lag 50 ms"].lag) == (0.02, 0.05)
    assert plants["damping halved"].car["tyres"].damping == pytest.approx(0.5 * 11897.0)


def test_modal_damping_is_exact_and_changes_no_frequency():
    damped = studies.with_modal_damping(CAR)
    modes = pt.modes(damped)
    np.testing.assert_allclose(modes.frequency_hz, pt.modes(CAR).frequency_hz, rtol=1e-12)
    np.testing.assert_allclose(modes.damping_ratio[1:], [0.0964, 0.05, 0.03, 0.02, 0.02, 0.02], rtol=1e-9)
    poles = pt.poles(damped)
    upper = poles[poles.imag > 0]
    np.testing.assert_allclose(-upper.real / np.abs(upper), [0.0964, 0.05, 0.03, 0.02, 0.02, 0.02], rtol=1e-7)
    assert pt.modes(studies.with_modal_damping(damped)).damping_ratio[1] == pytest.approx(0.0964)


# --- launch with the loop closed


def test_controlled_launch_without_actuator_and_controller_is_the_launch():
    car = pt.examples.conventional(damping="open")
    plant = pt.SampledPlant(car=car, lag=0.0, delay=0.0)
    response = pt.controlled_launch(plant, None)
    torque, dt = pt.ramp(1.5, 0.22, 350.0), plant.dt
    held = sum((pt.step(t, float(torque(t) - torque(t - dt))) for t in np.arange(1, 350) * dt), pt.step(0.0, 0.0))
    inputs = {"engine_torque": held, "clutch_capacity": pt.ramp(1.5, 0.22, 370.0)}
    expected = pt.simulate(car, response.time, inputs, {"engine": pt.rpm(5000)})
    for name in ("engine_speed", "vehicle_speed", "vehicle_acceleration"):
        np.testing.assert_allclose(response[name], expected[name], atol=1e-8)
    np.testing.assert_allclose([e.time for e in response.events], [e.time for e in expected.events], atol=1e-10)
    assert response.slip_energy == pytest.approx(expected.slip_energy, rel=1e-9)


def test_lag_of_a_controlled_launch_is_that_of_a_filter():
    plant = pt.SampledPlant(car=pt.examples.conventional(damping="open"), lag=0.05, delay=0.013)
    response = pt.controlled_launch(plant, None, end=2.5)
    t, torque = response.time, pt.ramp(1.5, 0.22, 350.0)
    held = np.array([float(torque(np.floor((x - 0.013) / 0.01 + 1e-9) * 0.01)) for x in t])
    # first-order lag of the held command, by the trapezoidal rule
    filtered = np.zeros_like(t)
    for i in range(1, len(t)):
        filtered[i] = filtered[i - 1] + (1 - np.exp(-(t[i] - t[i - 1]) / 0.05)) * (held[i - 1] - filtered[i - 1])
    np.testing.assert_allclose(response["engine_torque"], filtered, atol=1e-6)


@pytest.mark.parametrize("delay", [0.01, 0.013])
def test_controller_damps_after_lock_without_a_bump(delay):
    car = pt.examples.conventional(damping="open")
    plant = pt.SampledPlant(car=car, delay=delay)
    feedback = antijerk.speed_difference(plant, 6.0, antijerk.lead_notch(plant, notch_hz=21.1))
    controller = antijerk.two_dof(plant, pt.two_mass(car), feedback, antijerk.inverse_notch(plant, pt.two_mass(car)))
    without, with_it = pt.controlled_launch(plant, None), pt.controlled_launch(plant, controller)
    late = without.time > 3.0
    swing = [np.ptp(r["vehicle_acceleration"][late]) for r in (without, with_it)]
    assert swing[1] < 0.35 * swing[0]
    lock = with_it.events[-1].time
    command = with_it["torque_command"][::10]
    k = int(np.ceil(lock / plant.dt))
    assert abs(command[k] - command[k - 1]) < 1.0 + 0.2 * np.abs(with_it["torque_command"] - 350.0).max()


def test_controlled_launch_needs_one_clutch():
    plant = pt.SampledPlant(
        car=pt.Driveline(
            *(e for e in CAR if e.name != "clutch"), pt.Gear("g", "clutch_primary", "clutch_secondary", ratio=1.0)
        )
    )
    with pytest.raises(pt.PowertrainError, match="launch needs one clutch, there are 0"):
        pt.controlled_launch(plant, None)


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.02])
@pytest.mark.parametrize("duration", [0.0, 0.22])
def test_a_launch_without_lag_is_that_of_the_delayed_steps_of_its_commands(delay, duration):
    car = pt.examples.conventional(damping="open")
    plant = pt.SampledPlant(car=car, lag=0.0, delay=delay, dt=0.01)
    controlled = pt.controlled_launch(plant, None, duration=duration, start=1.504, end=3.0)
    samples = plant.dt * np.arange(300)
    demand = pt.ramp(1.504, duration, 350.0)
    changes, levels = np.repeat(samples[1:] + delay, 2), np.repeat(demand(samples), 2)[1:-1]
    inputs = {
        "engine_torque": PiecewiseLinear(tuple(changes), tuple(levels)),
        "clutch_capacity": pt.ramp(1.504, duration, 370.0),
    }
    direct = pt.simulate(car, controlled.time, inputs, {"engine": pt.rpm(5000.0)})
    assert [e.kind for e in controlled.events] == [e.kind for e in direct.events]
    np.testing.assert_allclose(
        [e.time for e in controlled.events], [e.time for e in direct.events], rtol=0.0, atol=1e-9
    )
    for name in ("engine_speed", "wheels_speed"):
        np.testing.assert_allclose(controlled[name], direct[name], rtol=0.0, atol=1e-8)
    assert controlled.slip_energy["clutch"] == pytest.approx(direct.slip_energy["clutch"], rel=1e-9)
    last = np.minimum(np.floor(controlled.time / plant.dt + 1e-9), 299).astype(int)
    for name in ("torque_demand", "torque_command"):  # nothing limits them here
        np.testing.assert_allclose(controlled[name], demand(samples)[last], rtol=0.0, atol=1e-12)
    jumps = np.isin(np.round(controlled.time, 9), np.round(samples + delay, 9))
    np.testing.assert_allclose(
        controlled["engine_torque"][~jumps], direct["engine_torque"][~jumps], rtol=0.0, atol=1e-9
    )


def test_a_plant_says_in_one_line_what_it_is():
    plant = pt.SampledPlant(car=pt.examples.conventional(), delay=0.012)
    assert repr(plant) == (
        "SampledPlant: lag 30 ms, delay 12 ms, dt 10 ms, torque 0 to 350 N m; engine, wheels, vehicle, ratio 18"
    )


def test_the_command_does_not_jump_when_the_controller_engages():
    plant = pt.SampledPlant(car=pt.examples.conventional(damping="open"), torque_limits=(-1e4, 1e4))
    response = pt.controlled_launch(plant, antijerk.designs(plant)["P"])
    command = response["torque_command"][::10]
    engaged = int(np.flatnonzero(response["clutch_mode"][::10] == 0.0)[0])
    assert command[engaged] == pytest.approx(command[engaged - 1], abs=1e-9)
    assert np.abs(command[engaged:] - 350.0).max() > 10.0  # it does act


def test_at_re_slip_the_command_fades_to_the_demand_and_the_motion_is_that_of_the_commands():
    car = pt.examples.conventional(damping="open")
    plant = pt.SampledPlant(car=car, lag=0.0, delay=0.0, torque_limits=(-1e4, 1e4))
    gain = 3.0  # feeds the twist rate back with the wrong sign: it swings until the clutch slips
    undamping = linear_system([], [], [], [[1.0, gain, -gain * plant.ratio]],
        dt=plant.dt, inputs=["torque_demand", "engine_speed", "wheels_speed"], outputs=["torque_command"],
    )  # fmt: skip
    response = pt.controlled_launch(plant, undamping, capacity=360.0)
    assert [event.kind for event in response.events] == ["slip", "lock", "slip", "lock"]
    *_, slip, lock_again = (event.time for event in response.events)
    samples = response.time[::10]
    command = response["torque_command"][::10]
    slipping = np.flatnonzero((samples > slip) & (samples < lock_again))
    assert abs(command[slipping[0] - 1] - 350.0) > 50.0
    fading = (command[slipping[0] - 1] - 350.0) * np.exp(-np.arange(len(slipping)) * plant.dt / 0.05)
    np.testing.assert_allclose(command[slipping] - 350.0, fading, rtol=1e-9)
    locked_again = int(np.flatnonzero(samples > lock_again)[0])
    assert command[locked_again] == pytest.approx(command[locked_again - 1], abs=1e-9)
    held = sum((pt.step(t, dT) for t, dT in zip(samples[1:-1], np.diff(command[:-1]), strict=True)), pt.step(0.0, 0.0))
    inputs = {"engine_torque": held, "clutch_capacity": pt.ramp(1.5, 0.22, 360.0)}
    expected = pt.simulate(car, response.time, inputs, {"engine": pt.rpm(5000.0)})
    np.testing.assert_allclose([e.time for e in expected.events], [e.time for e in response.events], atol=1e-8)
    for name in ("engine_speed", "vehicle_speed"):
        np.testing.assert_allclose(response[name], expected[name], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.0137, 0.02])
def test_without_lag_the_torque_is_the_command_of_a_delay_ago_also_between_the_samples(delay):
    plant = dataclasses.replace(PLANT, lag=0.0, delay=delay)
    response = pt.closed_loop(plant, None, pt.ramp(0.02, 0.1, 250.0), duration=0.3)
    commands = response["torque_command"][::10]
    sent = np.floor((response.time - delay) / plant.dt + 1e-9).astype(int)
    expected = np.where(sent >= 0, commands[np.maximum(sent, 0)], 0.0)
    np.testing.assert_allclose(response["engine_torque"], expected, atol=1e-9)


def test_the_torque_before_a_tip_out_is_the_initial_one():
    response = pt.tip_out(PLANT)
    np.testing.assert_allclose(response["engine_torque"][response.time < 0.5], 250.0, rtol=1e-12)
    assert response["engine_torque"][-1] == pytest.approx(0.0, abs=1e-9)


def test_final_acceleration_and_ratio_do_not_depend_on_the_order_of_the_elements():
    turned = pt.SampledPlant(car=pt.Driveline(*reversed(list(CAR))))
    gain = float(pt.state_space(CAR, "engine_torque", "vehicle_acceleration").dcgain())
    for plant in (PLANT, turned):
        assert plant.final_acceleration == pytest.approx(gain, rel=1e-9)
        assert plant.ratio == pytest.approx(18.0, rel=1e-12)
        assert plant.vehicle_radius == pytest.approx(0.35, rel=1e-12)
        assert plant.inertia == pytest.approx(0.35 / 18.0 / gain, rel=1e-9)


def test_the_controller_engages_and_lets_go_without_a_bump_and_damps_the_twist_rate_it_finds():
    """Gain 6 on a twist rate of 10 rad/s, there when the clutch locks: in the end it takes 60 N m off the demand."""
    plant = dataclasses.replace(PLANT, torque_limits=(0.0, 350.0))
    controller = antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=6.0))
    at_work = ControlUnit(controllers=controller, dt=0.01).start()
    speeds, forget = np.array([190.0, 10.0]), np.exp(-0.01 / 0.05)
    given = []
    for stuck in (False, True, True, True, False, False):
        given.append(at_work.step(200.0, *speeds, plant.ratio if stuck else 0.0))
    engaged = [200.0 - 60.0 * (1.0 - forget**k) for k in range(3)]
    # let go at the last command, from which the demand is reached in the same way
    left = [200.0 + (engaged[-1] - 200.0) * forget**k for k in range(2)]
    np.testing.assert_allclose(given, [200.0, *engaged, *left], rtol=1e-12)


@pytest.mark.parametrize("gain", [0.5, 6.0])
def test_modes_beyond_nyquist_are_found_among_the_poles_of_the_closed_loop(gain):
    fast = PLANT.continuous.poles()
    fast = fast[np.abs(fast.imag) > np.pi / PLANT.dt]
    margins = pt.loop_margins(PLANT, antijerk.one_dof(PLANT, antijerk.speed_difference(PLANT, gain=gain)))
    assert margins.folded.sum() == len(fast)


def test_arrays_of_results_cannot_be_written_to():
    launch = pt.controlled_launch(pt.SampledPlant(car=pt.examples.conventional(damping="open")), None)
    margins, table = pt.loop_margins(PLANT, None), pt.compare_models(CAR, {"modal": pt.two_mass(CAR)})
    arrays = [launch.time, launch["engine_speed"], margins.poles, margins.omega, margins.loop, margins.folded]
    arrays += [table.omega, table.detailed, table.models["modal"], table.time, table.ramps[0.1]["modal"], table.hankel]
    arrays += [pt.modes(CAR).shapes, pt.modes(CAR).reflected_shapes, pt.tip_in(PLANT)["engine_speed"]]
    assert not any(array.flags.writeable for array in arrays)
