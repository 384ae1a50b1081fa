"""What a torque rate does to a loop: its describing function against a simulated limiter, cycles against simulated loops."""

import dataclasses

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk
from powertrain_ctrl.base.systems import linear_system
from powertrain_ctrl.sampled.rate_limit import FULL, describing_function

CAR = pt.examples.conventional()
FREE = pt.SampledPlant(car=CAR, torque_limits=(-1e5, 1e5))
SLOW = dataclasses.replace(FREE, torque_rate=1000.0)
READS = ["torque_demand", "engine_speed", "wheels_speed"]


def difference(gain, plant=SLOW):
    return antijerk.one_dof(plant, antijerk.speed_difference(plant, gain))


def smoothed(gain, time, follows_what_was_sent, plant=SLOW):
    """Feedback of the speed difference behind a low-pass, of what was sent or of what was asked for: one loop if small."""
    a = np.exp(-plant.dt / time)
    row = (1.0 - a) * np.array([[1.0, -gain, gain * plant.ratio]])
    if follows_what_was_sent:
        inputs = [*READS, "torque_limited"]
        return linear_system([], [], [], np.hstack([row, [[a]]]), plant.dt, inputs=inputs, outputs=["torque_command"])
    return linear_system([[a]], row, [[a]], row, plant.dt, inputs=READS, outputs=["torque_command"])


def by_changes(gain, plant=SLOW):
    """What was sent, changed by what the feedback of the speed difference changes from sample to sample."""
    row = np.array([[1.0, -gain, gain * plant.ratio, 0.0]])
    inputs = [*READS, "torque_limited"]
    D = np.array([[1.0, -gain, gain * plant.ratio, 1.0]])
    return linear_system([[0.0]], row, [[-1.0]], D, plant.dt, inputs=inputs, outputs=["torque_command"])


def fundamental(values, angle):
    """Of a signal that swings by an angle each sample, weighted to zero at its ends."""
    weights = np.hanning(len(values))
    return 2.0 * np.sum(weights * values * np.exp(-1j * angle * np.arange(len(values)))) / weights.sum()


def limited(values):
    """What changes by 1 at most from value to value."""
    sent, before = [], 0.0
    for value in values.tolist():
        before = min(max(value, before - 1.0), before + 1.0)
        sent.append(before)
    return np.array(sent)


def after_a_pulse(plant, controller, torque, duration=15.0):
    """Frequency [Hz] and amplitude [N m] of the command in the last third, after a pulse of 120 ms."""
    pulse = pt.ramp(0.5, 0.0, torque) + pt.ramp(0.62, 0.0, -torque)
    response = pt.closed_loop(plant, controller, pulse, duration=duration, steps_per_sample=1)
    late = response["torque_unlimited"][-int(duration / 3.0 / plant.dt) :]
    frequencies = np.linspace(0.5, 15.0, 1500)
    sizes = [abs(fundamental(late - late.mean(), 2.0 * np.pi * f * plant.dt)) for f in frequencies]
    return frequencies[int(np.argmax(sizes))], max(sizes)


# --- the describing function


@pytest.mark.parametrize("ratio", [0.5, 1.0, 1.05, 1.3, 1.7, FULL, 2.0, 3.0, 10.0])
def test_it_is_the_fundamental_of_a_simulated_limiter(ratio):
    period, count = 4000, 16  # it takes a triangle some periods to find its mean
    angle = 2.0 * np.pi / period
    sine = ratio / (2.0 * np.sin(0.5 * angle)) * np.sin(angle * np.arange(count * period))
    seen = np.fft.fft(limited(sine)[-period:])[1] / np.fft.fft(sine[-period:])[1]
    assert abs(describing_function(ratio, angle) / seen - 1.0) < 1e-3


@pytest.mark.parametrize("ratio", [2.0, 3.0, 5.0, 8.0])
@pytest.mark.parametrize("angle", [0.1001, 0.2003, 0.3003])
def test_of_few_samples_the_lag_is_less_by_a_part_of_half_a_sample(ratio, angle):
    sine = ratio / (2.0 * np.sin(0.5 * angle)) * np.sin(angle * np.arange(20000))
    seen = fundamental(limited(sine)[400:], angle) / fundamental(sine[400:], angle)
    error = describing_function(ratio, angle) / seen
    assert abs(abs(error) - 1.0) < 5e-3
    assert abs(np.angle(error)) < 0.15 * angle
    assert abs(np.angle(describing_function(ratio) / seen)) > abs(np.angle(error))


def test_one_over_a_triangle_is_a_vertical_line():
    """4 / (pi x) and acos(pi / (2 x)): 1 / N has the real part pi x / 4 pi / (2 x) = pi^2 / 8, whatever the amplitude."""
    inverse = 1.0 / describing_function([FULL, 2.0, 5.0, 100.0])
    np.testing.assert_allclose(inverse.real, np.pi**2 / 8.0, rtol=1e-12)
    np.testing.assert_allclose(abs(inverse), 0.25 * np.pi * np.array([FULL, 2.0, 5.0, 100.0]), rtol=1e-12)


# --- up to which torques margins hold


def test_without_a_rate_nothing_is_said():
    margins = pt.loop_margins(FREE, difference(6.0))
    assert margins.rate is None
    assert margins.note == ""
    assert repr(margins).splitlines()[-1].startswith("phase_margin_deg")
    with_rate = pt.loop_margins(SLOW, difference(6.0))
    assert repr(with_rate) == f"{margins!r}\n{with_rate.note}"


@pytest.mark.parametrize("controller", [None, difference(50.0)], ids=["no feedback", "unstable"])
def test_where_there_are_no_margins_nothing_is_said(controller):
    margins = pt.loop_margins(SLOW, controller)
    assert margins.stable == (controller is None)
    assert margins.rate is None


def test_it_holds_at_the_frequency_at_which_the_disk_margin_is_decided():
    margins = pt.loop_margins(SLOW, difference(6.0))
    S = 1.0 / (1.0 + margins.loop)
    worst = np.abs(S - margins.loop * S).argmax()
    assert margins.disk_margin == pytest.approx(2.0 / np.abs(S - margins.loop * S)[worst], rel=1e-12)
    assert margins.rate.frequency_hz == pytest.approx(margins.omega[worst] / (2.0 * np.pi), rel=1e-12)


@pytest.mark.parametrize("rates", [800.0, (800.0, 2000.0), (2000.0, 800.0)])
def test_up_to_that_amplitude_a_sine_is_sent_as_it_is_and_beyond_it_is_not(rates):
    plant = dataclasses.replace(FREE, torque_rate=rates)
    margin = pt.loop_margins(plant, difference(6.0, plant)).rate
    assert margin.rate == 800.0
    omega = 2.0 * np.pi * margin.frequency_hz
    for share, side in [(1.0 - 1e-9, 1.0), (1.0 - 1e-9, -1.0), (1.0 + 1e-4, 1.0), (1.0 + 1e-4, -1.0)]:
        # steepest from the first sample to the second
        def sine(t, size=share * side * margin.unaltered):
            return size * np.sin(omega * (t - 0.5 * plant.dt))

        response = pt.closed_loop(plant, None, sine, duration=1.0, steps_per_sample=1)
        change = np.abs(response["torque_command"] - response["torque_demand"]).max() / margin.unaltered
        is_slow_way = plant.rates[0 if side > 0.0 else 1] == 800.0
        if share < 1.0:
            assert change < 1e-12
        elif is_slow_way:
            assert change > 1e-6


def test_it_goes_with_the_rate():
    one, three = (
        pt.loop_margins(dataclasses.replace(FREE, torque_rate=rate), difference(20.0)).rate for rate in (1e3, 3e3)
    )
    assert three.unaltered == pytest.approx(3.0 * one.unaltered, rel=1e-12)
    np.testing.assert_allclose(three.cycle_amplitude, 3.0 * one.cycle_amplitude, rtol=1e-12)


# --- what it keeps up

LATE = dataclasses.replace(SLOW, delay=0.06)
CASES = {
    "high gain": (SLOW, difference(30.0)),
    "just beyond": (SLOW, difference(20.0)),
    "long delay": (LATE, difference(6.0, LATE)),
    "follows what was sent": (SLOW, smoothed(30.0, 0.01, follows_what_was_sent=True)),
    "follows what it asked for": (SLOW, smoothed(30.0, 0.01, follows_what_was_sent=False)),
}


@pytest.mark.parametrize("case", CASES)
def test_what_the_rate_keeps_up_is_found_in_the_loop(case):
    plant, controller = CASES[case]
    margin = pt.loop_margins(plant, controller).rate
    assert margin.disk_margin == 0.0
    least, kept_up = margin.cycle_amplitude
    frequency, amplitude = after_a_pulse(plant, controller, 2.0 * kept_up)
    assert frequency == pytest.approx(margin.cycle_frequency_hz[1], rel=0.05)
    assert amplitude == pytest.approx(kept_up, rel=0.1)
    assert after_a_pulse(plant, controller, 0.6 * least)[1] < 0.1 * least
    assert f"may keep up an oscillation of {margin.cycle_frequency_hz[0]:.2g} Hz" in repr(margin)


def test_one_loop_of_small_motions_is_two_for_large_ones():
    """Whether a low-pass is in the controller or in what it reads of its own command: only the limiter tells."""
    sent, asked = (pt.loop_margins(*CASES[name]) for name in ("follows what was sent", "follows what it asked for"))
    assert sent.disk_margin == pytest.approx(asked.disk_margin, rel=1e-6)
    assert sent.rate.unaltered == pytest.approx(asked.rate.unaltered, rel=1e-6)
    assert asked.rate.cycle_amplitude[1] > 1.5 * sent.rate.cycle_amplitude[1]


CALM = {
    "gain 6": difference(6.0),
    "LQG": antijerk.one_dof(SLOW, antijerk.lqg(SLOW, pt.two_mass(CAR))),
    "H-infinity": antijerk.one_dof(SLOW, antijerk.hinf(SLOW, pt.two_mass(CAR))),
    "changes what was sent": by_changes(20.0),
}


@pytest.mark.parametrize("name", CALM)
def test_where_a_margin_is_left_large_motions_die_out(name):
    margin = pt.loop_margins(SLOW, CALM[name]).rate
    assert margin.disk_margin > 0.4
    assert not margin.cycle_amplitude.size
    for torque in (100.0, 4000.0):
        assert after_a_pulse(SLOW, CALM[name], torque)[1] < 1e-3 * margin.unaltered
    assert repr(margin).endswith(f"leaves a disk margin of about {margin.disk_margin:.2g}")


@pytest.mark.parametrize("name", CALM)
def test_what_is_left_is_the_least_disk_margin_over_frequencies_and_amplitudes(name):
    """Of the loop at the plant with the describing function in the place of the limiter, from its parts."""
    K, margins = CALM[name], pt.loop_margins(SLOW, CALM[name])
    z = np.exp(2j * np.pi * SLOW.dt * np.linspace(0.3, 8.0, 400))
    parts = K(z)[0]
    of = dict(zip(K.input_labels, parts, strict=True))
    G, nothing = SLOW.discrete()(z)[:, 0], np.zeros(len(z))
    ours = of.get("engine_speed", nothing) * G[0] + of.get("wheels_speed", nothing) * G[1]
    own = of.get("torque_limited", nothing) / z
    N = describing_function(np.geomspace(1.0, 30.0, 400)[:, None], np.angle(z))
    loop = -N * ours / (1.0 - N * own)
    expected = 2.0 / np.abs((1.0 - loop) / (1.0 + loop)).max()
    assert margins.rate.disk_margin == pytest.approx(min(expected, margins.disk_margin), rel=0.05)


def test_too_small_a_margin_is_said_to_be_so():
    """A gain of 18 misses it by 1.4 deg, and in the loop it swings on."""
    margin = pt.loop_margins(SLOW, difference(18.0)).rate
    assert 0.0 < margin.disk_margin < 0.1
    assert repr(margin).endswith("too little to rule out an oscillation that it keeps up")
    assert after_a_pulse(SLOW, difference(18.0), 400.0)[1] > margin.unaltered


def test_of_rates_that_differ_the_slower_counts_and_that_is_the_safe_side():
    plant = dataclasses.replace(FREE, torque_rate=(1000.0, 3000.0))
    margin = pt.loop_margins(plant, difference(20.0)).rate
    assert margin.cycle_amplitude.tolist() == pt.loop_margins(SLOW, difference(20.0)).rate.cycle_amplitude.tolist()
    assert after_a_pulse(plant, difference(20.0), 400.0)[1] < 1e-3


def test_a_cycle_beyond_the_torque_limits_is_none():
    """A rate of 1e4 N m/s has its cycles at 525 and 4432 N m, of which 175 N m cannot be sent."""
    wide = dataclasses.replace(FREE, torque_rate=1e4)
    narrow = dataclasses.replace(wide, torque_limits=(0.0, 350.0))
    assert len(pt.loop_margins(wide, difference(30.0)).rate.cycle_amplitude) == 2
    margin = pt.loop_margins(narrow, difference(30.0)).rate
    assert not margin.cycle_amplitude.size
    assert margin.disk_margin > 0.0


def test_where_the_limits_end_before_the_rate_is_reached_it_takes_nothing():
    """A command of 50 N m at least is needed to reach 1e4 N m/s within a sample, and 0.5 N m are permitted."""
    narrow = dataclasses.replace(FREE, torque_rate=1e4, torque_limits=(0.0, 1.0))
    margins = pt.loop_margins(narrow, difference(6.0))
    assert margins.rate.disk_margin == pytest.approx(margins.disk_margin, rel=1e-9)


def test_without_limits_it_is_the_same():
    endless = dataclasses.replace(SLOW, torque_limits=(-np.inf, np.inf))
    ours, theirs = (pt.loop_margins(plant, difference(30.0)).rate for plant in (endless, SLOW))
    assert ours.cycle_amplitude.tolist() == theirs.cycle_amplitude.tolist()


# --- the rate of a unit


def unit(controller, **values):
    return pt.ControlUnit(controllers=controller, dt=0.01, **values)


@pytest.mark.parametrize("rates", [(1000.0, np.inf), (1000.0, 3000.0), (1000.0, 1000.0)])
@pytest.mark.parametrize("limits", [(-1e5, 1e5), (-20.0, 20.0)], ids=["wide", "narrow"])
def test_the_rate_of_a_unit_is_that_of_a_plant_as_slow(rates, limits):
    inside, outside = rates
    controller = CASES["follows what was sent"][1]
    plant = dataclasses.replace(FREE, torque_rate=outside)
    expected = pt.loop_margins(dataclasses.replace(SLOW, torque_limits=limits), controller)
    found = pt.loop_margins(plant, unit(controller, torque_rate=inside, torque_limits=limits))
    assert found.note == expected.note != ""
    assert found.rate.disk_margin == expected.rate.disk_margin
    np.testing.assert_array_equal(found.rate.cycle_amplitude, expected.rate.cycle_amplitude)
    assert len(found.rate.cycle_amplitude) == (2 if limits[1] == 1e5 else 0)


@pytest.mark.parametrize("rate", [np.inf, 5000.0])
def test_a_unit_is_not_told_of_the_rate_of_a_plant(rate):
    """Its low-pass of what was sent then is one of what was asked for."""
    whole = unit(CASES["follows what was sent"][1], torque_rate=rate)
    margin = pt.loop_margins(SLOW, whole).rate
    asked = pt.loop_margins(*CASES["follows what it asked for"]).rate
    np.testing.assert_allclose(margin.cycle_amplitude, asked.cycle_amplitude, rtol=1e-6)
    kept_up = margin.cycle_amplitude[1]
    assert after_a_pulse(SLOW, unit(whole.controllers), 2.0 * kept_up)[1] == pytest.approx(kept_up, rel=0.1)
