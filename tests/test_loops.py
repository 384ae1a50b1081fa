"""Stability and damping ratios of sampled loops by other roads; both sides of every tolerance.

Of sampled/margins, sampled/loopmodes.
"""

import dataclasses

import control
import numpy as np
import pytest
import scipy.optimize

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk, studies
from powertrain_ctrl.base.systems import linear_system
from powertrain_ctrl.sampled.loopmodes import beyond_nyquist, damping_ratios, loop_matrix, oscillations, owners
from powertrain_ctrl.sampled.margins import _feedback_path, margins_among

CAR = pt.examples.conventional()
PLANT = pt.SampledPlant(car=CAR)
MODEL = pt.TwoMass(J1=0.5, J2=250.0, stiffness=3e4, damping=0.0, ratio=18.0, radius=0.35)


def with_zeta(zeta, model=MODEL):
    return model.replace(damping=2.0 * zeta * model.omega / model.compliance_of_inertia)


def gain_on_difference(plant, gain):
    """Feedback of either sign on the speed difference, without states."""
    row = [[1.0, -gain, gain * plant.ratio]]
    inputs = ["torque_demand", "engine_speed", "wheels_speed"]
    return linear_system([], [], [], row, dt=plant.dt, inputs=inputs, outputs=["torque_command"])


def half_shafts(damping):
    """Both equal and, of the springs, the only ones that may be undamped: the wheels can swing against each other."""
    sides = []
    for side in ("left", "right"):
        sides += [
            pt.SpringDamper(f"{side}_shaft", "diff", side, stiffness=7e3, damping=damping),
            pt.Inertia(side, J=1.3),
            pt.Tyre(f"{side}_tyre", side, "vehicle", radius=0.3, stiffness=4e5, damping=0.0),
        ]
    gear = pt.Gear("gear", "engine", "diff", ratio=10.0)
    # damps all in which the engine takes part
    damper = pt.SpringDamper("rubber", "engine", "ring", stiffness=1e3, damping=3.0)
    bodies = pt.Inertia("engine", J=0.2), pt.Inertia("ring", J=0.05), pt.Mass("vehicle", m=1500.0)
    return pt.Driveline(*bodies, damper, gear, *sides)


# --- stability


@pytest.mark.parametrize("dt", [0.01, 0.008, 0.005, 0.004, 1e-3, 1e-4])
def test_an_undamped_plant_is_never_stable(dt):
    plant = pt.SampledPlant(car=studies.scale_damping(CAR, 0.0), dt=dt, delay=0.0)
    margins = pt.loop_margins(plant, None)
    assert (margins.stable, margins.disk_margin, margins.phase_margin_deg) == (False, 0.0, 0.0)
    # a controller that does not act on the speeds changes nothing in that
    inputs = ["torque_demand", "engine_speed"]
    idle = linear_system([], [], [], [[1.0, 0.0]], dt=dt, inputs=inputs, outputs=["torque_command"])
    assert not pt.loop_margins(plant, idle).stable


@pytest.mark.parametrize("dt", [0.01, 1e-4])
def test_a_plant_with_next_to_no_damping_is_stable(dt):
    model = with_zeta(1e-6, MODEL.replace(stiffness=MODEL.stiffness * (2.0 * np.pi * 0.5 / MODEL.omega) ** 2))
    assert model.frequency_hz == pytest.approx(0.5)
    plant = pt.SampledPlant(car=model, dt=dt, delay=0.0, lag=0.0)
    margins = pt.loop_margins(plant, None)
    assert margins.stable
    assert margins.zeta_first == pytest.approx(1e-6, rel=1e-3)
    # told from an undamped one even where the poles must decide, beside a feedback of nearly nothing
    assert pt.loop_margins(plant, gain_on_difference(plant, 1e-12)).stable


def test_what_feedback_damps_is_stable_as_soon_as_it_is_more_than_rounding():
    plant = pt.SampledPlant(car=MODEL, dt=1e-3, delay=0.0, lag=0.0)
    # without lag and delay, gain / J1 is damping per inertia; half a sample of delay takes a little
    stable = {gain: pt.loop_margins(plant, gain_on_difference(plant, gain)).stable for gain in (-1e-4, 1e-13, 1e-4)}
    assert stable == {-1e-4: False, 1e-13: False, 1e-4: True}


def test_a_mode_that_feedback_does_not_reach_decides_too():
    for damping, expected in ((0.0, False), (1e-3, True)):
        plant = pt.SampledPlant(car=half_shafts(damping), lag=0.0, delay=0.0, dt=1e-3)
        for controller in (None, gain_on_difference(plant, 0.5)):
            assert pt.loop_margins(plant, controller).stable is expected


def test_an_integrator_beside_the_rigid_motion_is_not_stable():
    plant = dataclasses.replace(PLANT, delay=0.0)

    def integrating(forget):
        row = -0.1 * np.array([[1.0, -plant.ratio]])
        inputs = ["engine_speed", "wheels_speed"]
        feedback = control.ss(
            [[1.0 - forget]], row, [[1.0]], [[0.0, 0.0]], plant.dt, inputs=inputs, outputs=["torque_intervention"]
        )
        return antijerk.one_dof(plant, feedback)

    assert not pt.loop_margins(plant, integrating(0.0)).stable
    assert pt.loop_margins(plant, integrating(1e-7)).stable


def test_slow_double_poles_of_an_observer_are_no_rigid_motion():
    # two equal poles at 1 - 3e-5, as near as the root of the rounding would confuse
    plant = pt.SampledPlant(car=CAR, dt=1e-4, delay=1e-4, lag=0.01)
    controller = antijerk.one_dof(plant, antijerk.rigid_reference(plant, gain=4.0, bandwidth_hz=0.05))
    assert pt.loop_margins(plant, controller).stable


@pytest.mark.parametrize(("gain", "expected"), [(-1e-6, False), (1e-6, True)])
def test_a_slow_growth_of_the_whole_car_is_no_rigid_motion(gain, expected):
    inputs = ["torque_demand", "engine_speed"]
    controller = linear_system([], [], [], [[1.0, -gain]], PLANT.dt, inputs=inputs, outputs=["torque_command"])
    # the whole car's pole moves by gain / inertia
    rate = -gain / PLANT.inertia
    margins = pt.loop_margins(PLANT, controller)
    assert margins.stable is expected
    assert np.abs(margins.poles - rate).min() == pytest.approx(0.0, abs=1e-3 * abs(rate))


def test_many_samples_of_delay_do_not_make_a_loop_unstable():
    plant = dataclasses.replace(PLANT, delay=0.4)
    assert pt.loop_margins(plant, gain_on_difference(plant, 0.01)).stable


# --- damping ratios


@pytest.mark.parametrize("gain", [0.0, 2.0, 6.0, 12.0, 15.0])
def test_feedback_on_the_twist_rate_adds_to_the_damping(gain):
    model = with_zeta(0.1)
    plant = pt.SampledPlant(car=model, dt=1e-4, delay=0.0, lag=0.0)
    margins = pt.loop_margins(plant, gain_on_difference(plant, gain) if gain else None)
    # of x'' = -(d ci + gain / J1) x' - c ci x
    expected = 0.1 + gain / model.J1 / (2.0 * model.omega)
    assert margins.zeta_first == pytest.approx(min(expected, 1.0), rel=2e-3)
    assert margins.zeta_second == 1.0  # there is none


def test_a_fast_first_mode_has_a_damping_ratio_too():
    # 12.4 Hz, beyond what a passenger car has
    car = CAR.replace("drive_shafts", stiffness=2e6).replace("vehicle", m=200.0)
    s = next(pole for pole in pt.poles(car) if pole.imag > 0.0)
    assert abs(s) > 2.0 * np.pi * 9.0
    zeta = -s.real / abs(s)
    assert pt.loop_margins(pt.SampledPlant(car=car), None).zeta_first == pytest.approx(zeta, rel=1e-9)


@pytest.mark.parametrize("gear", [6.0, 3.6, 2.4, 1.7, 1.3, 1.0, 0.8])
def test_damping_ratios_are_numbers_in_every_gear(gear):
    plant = pt.SampledPlant(car=pt.examples.conventional(gear_ratio=gear))
    for controller in (None, *antijerk.designs(plant).values()):
        margins = pt.loop_margins(plant, controller)
        assert np.isfinite([margins.zeta_first, margins.zeta_second]).all()


def test_an_overdamped_mode_counts_as_one():
    for zeta, expected in ((1.5, 1.0), (1.0, 1.0), (1.0 - 1e-6, 1.0 - 1e-6), (0.9, 0.9)):
        margins = pt.loop_margins(pt.SampledPlant(car=with_zeta(zeta)), None)
        assert margins.zeta_first == pytest.approx(expected, rel=1e-9)
        assert len(margins.modes) == (zeta < 1.0)


def test_the_first_mode_is_followed_wherever_feedback_moves_it():
    """At a gain of 45 it rings at 7.3 Hz, the only one between 5 and 15 Hz that is not well damped."""
    controller = gain_on_difference(PLANT, 45.0)
    G = PLANT.discrete()
    z = np.linalg.eigvals(G.A - 45.0 * G.B @ (G.C[:1] - PLANT.ratio * G.C[1:2]))
    s = np.log(z) / PLANT.dt
    moved = s[(s.imag > 2 * np.pi * 5.0) & (s.imag < 2 * np.pi * 15.0) & (np.abs(s.real) < 0.2 * s.imag)]
    assert len(moved) == 1
    zeta = float(-moved[0].real / abs(moved[0]))
    assert pt.loop_margins(PLANT, controller).zeta_first == pytest.approx(zeta, rel=1e-6)


def test_a_mode_beyond_nyquist_has_the_damping_that_it_has_in_continuous_time():
    car = pt.examples.front_wheel_drive()  # rattle at 60 Hz, which samples of 10 ms show at 42 Hz
    slow, fast = (pt.loop_margins(pt.SampledPlant(car=car, dt=dt), None) for dt in (0.01, 0.005))
    rattle = [pole for pole in pt.poles(car) if pole.imag > 0.0][1]
    assert rattle.imag > np.pi / 0.01
    for margins in (slow, fast):
        assert margins.zeta_second == pytest.approx(-rattle.real / abs(rattle), rel=1e-6)
    assert np.count_nonzero(slow.folded) == 2
    assert not fast.folded.any()


@pytest.mark.parametrize(("share", "folded"), [(1.0 - 1e-7, 0), (1.0 + 1e-7, 2)])
def test_a_mode_is_folded_from_the_nyquist_frequency_on(share, folded):
    model = with_zeta(0.01)
    dt = share * np.pi / (model.omega * np.sqrt(1.0 - 0.01**2))
    assert np.count_nonzero(pt.loop_margins(pt.SampledPlant(car=model, dt=dt), None).folded) == folded


def test_the_nyquist_frequency_itself_is_not_beyond_it():
    beyond = beyond_nyquist(1j * np.pi / 0.01 * np.array([1.0, 1.0 + 0.5e-9, 1.0 + 2e-9]), 0.01)
    assert beyond.tolist() == [False, False, True]


def test_poles_of_the_controller_count_where_they_ring_near_a_mode():
    """A resonator at 1.25 times the first frequency with a damping ratio of 0.02, which hardly feels the plant."""
    w = 1.25 * abs(pt.loop_margins(PLANT, None).modes[0])
    resonator = control.tf([w**2], [1.0, 2.0 * 0.02 * w, w**2])
    shaping = control.sample_system(control.tf2ss(resonator), PLANT.dt, method="tustin", prewarp_frequency=w)

    def zeta(gain):
        return pt.loop_margins(PLANT, antijerk.one_dof(PLANT, antijerk.speed_difference(PLANT, gain, shaping)))

    assert zeta(1e-6).zeta_first == pytest.approx(0.02, rel=0.01)
    assert zeta(1e-6).zeta_second == pytest.approx(pt.loop_margins(PLANT, None).zeta_second, rel=1e-4)


@pytest.mark.parametrize("shift", [-1e-12, 0.0, 1e-12])
def test_a_pole_halfway_between_two_modes_counts_for_both(shift):
    modes = np.array([-0.1 + 10.0j, -0.1 + 40.0j])
    halfway = np.sqrt(abs(modes[0]) * abs(modes[1])) * (1.0 + shift) * np.exp(1j * np.arccos(-0.001))
    poles = np.concatenate([modes, modes.conj(), [halfway, halfway.conj()]])
    owner = np.array([0, 1, 0, 1, -1, -1])
    assert damping_ratios(poles, owner, modes, 0.01) == pytest.approx((0.001, 0.001))
    for place, expected in ((1.0 - 1e-6, (0.001, 0.0025)), (1.0 + 1e-6, (0.01, 0.001))):
        poles[4:] = place * np.array([halfway, halfway.conj()])
        assert damping_ratios(poles, owner, modes, 0.01) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("ratio", "counts"), [(2.999, True), (3.001, False)])
def test_a_pole_counts_up_to_three_times_the_frequency_of_a_mode(ratio, counts):
    modes = np.array([-0.1 + 10.0j])
    other = ratio * abs(modes[0]) * np.exp(1j * np.arccos(-0.001))
    poles = np.array([modes[0], modes[0].conj(), other, other.conj()])
    assert (damping_ratios(poles, np.array([0, 0, -1, -1]), modes, 0.01)[0] < 0.002) is counts


def test_the_loop_gain_is_shown_at_the_top_of_a_narrow_resonance_of_the_plant():
    """Of zeta 1e-5, whose damping the feedback makes 100 times as large: L at the resonance is nearly 99."""
    zeta = 1e-5
    model = with_zeta(zeta)
    plant = pt.SampledPlant(car=model, dt=1e-4, delay=0.0, lag=0.0)
    gain = 99.0 * 2.0 * zeta * model.omega * model.J1
    margins = pt.loop_margins(plant, gain_on_difference(plant, gain))
    assert np.abs(margins.loop).max() == pytest.approx(99.0, rel=0.01)


@pytest.mark.parametrize("zeta", [1e-5, 1e-4, 3e-4, 1e-3, 3e-3])
def test_a_resonance_between_two_points_of_the_grid_is_shown_to_its_top(zeta):
    """At half the Nyquist frequency, from a thousandth of the grid's spacing wide to as wide; against a dense sweep."""
    model = with_zeta(zeta)
    plant = pt.SampledPlant(car=model, dt=0.5007 * np.pi / model.omega, delay=0.0, lag=0.0)
    gain = 20.0 * zeta * model.omega * model.J1
    margins = pt.loop_margins(plant, gain_on_difference(plant, gain))
    G = plant.discrete()
    omega = model.omega * (1.0 + zeta * np.linspace(-4.0, 4.0, 4001))
    z = np.exp(1j * omega * plant.dt)
    speeds = np.linalg.solve(z[:, None, None] * np.eye(G.nstates) - G.A, G.B)
    loop = gain * (np.array([1.0, -plant.ratio]) @ G.C[:2]) @ speeds
    assert margins.stable
    assert np.abs(margins.loop).max() == pytest.approx(np.abs(loop).max(), rel=0.01)


@pytest.mark.parametrize(
    ("lag", "delay", "softer", "gain"), [(0.02, 0.01, 1.0, None), (0.03, 0.01, 0.8, 6.43), (0.02, 0.02, 0.8, 6.43)]
)
def test_poles_are_followed_as_in_very_small_steps(lag, delay, softer, gain):
    """An H-infinity design or a rigid reference, whose poles meet those of the first mode and in one step change places."""
    plant = dataclasses.replace(PLANT, lag=lag, delay=delay, car=studies.scale_stiffness(CAR, softer))
    if gain is None:
        feedback = antijerk.hinf(PLANT, pt.two_mass(CAR), effort=0.0514, corner_hz=38.4, noise=0.0718)
    else:
        feedback = antijerk.rigid_reference(PLANT, gain=gain, bandwidth_hz=0.733)
    G, K = plant.discrete(), _feedback_path(antijerk.one_dof(plant, feedback), plant.dt)
    modes = np.exp(oscillations(plant) * plant.dt)

    def followed(steps):
        z = np.linalg.eigvals(loop_matrix(G, K, 0.0))
        ours = np.array([np.abs(z - pole).argmin() for pole in (*modes[:2], *modes[:2].conj())])
        for share in np.linspace(0.0, 1.0, steps + 1)[1:]:
            later = np.linalg.eigvals(loop_matrix(G, K, share))
            place = scipy.optimize.linear_sum_assignment(np.abs(z[:, None] - later))[1]
            z, ours = later, place[ours]
        return [set(ours[k::2].tolist()) for k in (0, 1)]

    z, owner = owners(G, K, modes, np.linalg.eigvals(loop_matrix(G, K, 0.0)))
    assert (z == np.linalg.eigvals(loop_matrix(G, K))).all()
    assert [set(np.flatnonzero(owner == k).tolist()) for k in (0, 1)] == followed(1000)
    assert followed(1) != followed(1000)


def test_a_feedback_of_one_speed_and_its_own_command_is_all_in_the_loop():
    """Against plant and controller put together with all their states."""
    K = antijerk.one_dof(PLANT, antijerk.rigid_reference(PLANT, gain=6.0, bandwidth_hz=0.7))
    G = PLANT.discrete()
    reads = [list(K.input_labels).index(name) for name in ("engine_speed", "wheels_speed", "torque_limited")]
    B, D = K.B[:, reads], K.D[:, reads]
    n, k = len(G.A), len(K.A)
    # states of plant, of controller, and the command of the sample before
    whole = np.zeros((n + k + 1, n + k + 1))
    command = np.hstack([D[:, :2] @ G.C[:2], K.C, D[:, 2:]])
    whole[:n] = G.B @ command
    whole[:n, :n] += G.A
    whole[n:-1] = np.hstack([B[:, :2] @ G.C[:2], K.A, B[:, 2:]])
    whole[-1:] = command
    expected = np.linalg.eigvals(whole)
    expected = expected[(np.abs(expected - 1.0) > 1e-9) & (np.abs(expected) > 1e-9)]
    found = np.exp(pt.loop_margins(PLANT, K).poles * PLANT.dt)
    assert len(found) == len(expected)
    for pole in expected:
        assert np.abs(found - pole).min() < 1e-7


# --- margins


def test_a_loop_gain_of_exactly_one_at_a_frequency_of_the_grid_is_a_crossing():
    from powertrain_ctrl.sampled.margins import _gain_margin, _phase_margin

    # -2, -1, -1/2 along the real axis from above to below it: gain margin 0 dB; phase at the gain of 1
    falling = np.array([2.0j, 1.0j, 0.5j, 0.1j])
    assert _phase_margin(falling) == pytest.approx(90.0)
    through = np.array([-2.0 + 0.5j, -1.5 + 0.0j, -1.0 - 0.5j, -0.1 - 0.1j])
    assert _gain_margin(through) == pytest.approx(20.0 * np.log10(1.5))


@pytest.mark.parametrize(("size", "expected"), [(0.5e-6, np.inf), (2e-6, 20.0 * np.log10(0.5e6))])
def test_a_gain_of_nothing_has_no_margin(size, expected):
    from powertrain_ctrl.sampled.margins import _gain_margin

    assert _gain_margin(size * np.array([-1.0 + 0.1j, -1.0 - 0.1j, 1.0])) == pytest.approx(expected)


def test_a_controller_is_asked_for_the_sample_time_of_every_plant():
    with pytest.raises(pt.PowertrainError, match=r"dt = 0\.01.*0\.005"):
        margins_among((PLANT, dataclasses.replace(PLANT, dt=0.005)), gain_on_difference(PLANT, 6.0))
