"""Parameters from measured runs, measured by matrix exponentials and integrators of their own.

Of identification/advice, identification/channels, identification/columns, identification/decay, identification/descent,
identification/fitting, identification/identified, identification/measured, identification/motion, identification/noise,
identification/separable, identification/tracking, identification/unknowns, plots/identified,
identification/prediction and identification/output_error.
"""

from functools import lru_cache
from itertools import pairwise

import control
import numpy as np
import pytest
import scipy.integrate
import scipy.io
import scipy.linalg

import powertrain_ctrl as pt
from benchmarks import coverage, track
from powertrain_ctrl.identification import motion, noise
from powertrain_ctrl.identification.channels import channels

TRUE = coverage.TRUE
T = 0.01 * np.arange(501)
U = np.interp(T, *track.TIP_INS)


def run_of(time, **signals):
    return pt.plots.Signals(time=np.asarray(time, dtype=float), values=signals)


def file_run(folder, **signals):
    """The same through a file, where samples may be missing."""
    scipy.io.savemat(folder / "run.mat", signals)
    return pt.read_run(folder / "run.mat", **{name: name for name in signals})


def far_car():
    """The car of the track, its parameters 20 to 40 % off."""
    car = pt.examples.conventional(gear_ratio=track.RATIO)
    car = car.replace("drive_shafts", stiffness=24e3, damping=580.0)
    return car.replace("vehicle", m=2400.0).replace("engine", J=0.22)


@lru_cache
def exact_run(late=0.0, slow=0.0):
    """Noise-free, in deviation from steady motion: the torque acts later than recorded, wheel speed is recorded later."""
    fine = 1e-4 * np.arange(50001)
    engine, wheels = track.speeds(fine, np.interp(fine - late, T, U), h=1e-4)
    seen = [np.clip(np.round((T - by) / 1e-4).astype(int), 0, 50000) for by in (0.0, slow)]
    return run_of(T, engine_torque=U, engine_speed=engine[seen[0]], wheels_speed=wheels[seen[1]])


def assert_found(fit, true, bar):
    for name, value in true.items():
        assert fit.values[name] == pytest.approx(value, rel=bar), name


# ------------------------------------------------------------------------------------------------ noise-free


@pytest.mark.parametrize(("late", "slow"), [(0.0, 0.0), (0.03, 0.0), (0.0123, 0.0047), (-0.0211, 0.0)])
def test_noise_free_runs_give_every_parameter_and_delay(late, slow):
    fit = pt.identify(
        far_car(), exact_run(late, slow), list(TRUE), delays=["engine_torque", "wheels_speed"], road_load=True
    )
    assert_found(fit, TRUE, 1e-9)
    assert fit.delays == pytest.approx({"engine_torque": late, "wheels_speed": slow}, abs=1e-6)
    # 30 N m at the engine are held by the road, track.speeds leaves both out
    assert fit.runs[0].road_load == pytest.approx(-30.0 * 10.8 / 0.35, rel=1e-9)
    assert fit.not_determined == ()
    assert min(fit.runs[0].fit.values()) > 100.0 - 1e-6
    assert max(fit.before[0].fit.values()) < 99.0


def two_mass_run(model, t, torque, wheels, start):
    """Two masses by `solve_ivp` between the time stamps of a logger, from any state."""

    def rate(s, x):
        twist = model.stiffness * x[2] + model.damping * (x[0] / model.ratio - x[1])
        driving = np.interp(s, t, torque) - twist / model.ratio
        return [driving / model.J1, twist / model.J2, x[0] / model.ratio - x[1]]

    found = [np.array(start, dtype=float)]
    for a, b in pairwise(t):
        found.append(
            scipy.integrate.solve_ivp(rate, (a, b), found[-1], method="DOP853", rtol=3e-14, atol=1e-13).y[:, -1]
        )
    engine, behind, _ = np.array(found).T
    share = model.rim_share if wheels else 0.0
    return run_of(
        t, engine_torque=torque, engine_speed=engine, wheels_speed=(1 - share) * behind + share * engine / model.ratio
    )


MODEL = pt.TwoMass(J1=0.45, J2=250.0, stiffness=2.4e4, damping=280.0, ratio=10.8, radius=0.35, rim_share=0.25)
FIELDS = ["J1", "J2", "stiffness", "damping", "rim_share"]


def test_two_masses_are_found_on_uneven_time_stamps_from_any_start():
    rng = np.random.default_rng(1)
    t = 0.015 * (np.arange(160) + rng.uniform(-0.4, 0.4, 160))
    torque = 60.0 + 40.0 * np.sin(7.0 * t) + 30.0 * np.sin(17.0 * t + 1.0)
    run = two_mass_run(MODEL, t, torque, True, [30.0, 2.5, 0.01])
    start = MODEL.replace(J1=0.36, J2=320.0, stiffness=1.8e4, damping=370.0, rim_share=0.19)
    fit = pt.identify(start, run, FIELDS)
    assert_found(fit, {name: getattr(MODEL, name) for name in FIELDS}, 1e-9)
    assert fit.car == MODEL.replace(**fit.values)
    assert fit.units["stiffness"] == "N m/rad"


def test_a_start_at_critical_damping_is_no_obstacle():
    w, reduced = np.sqrt(2.4e4 * MODEL.compliance_of_inertia), 1.0 / MODEL.compliance_of_inertia
    critical = MODEL.replace(damping=2.0 * reduced * w, rim_share=0.0)
    assert critical.damping_ratio == pytest.approx(1.0, abs=1e-15)
    t = np.arange(0.0, 1.5, 0.02)
    run = two_mass_run(critical, t, 50.0 + 40.0 * np.sin(9.0 * t), False, [30.0, 2.5, 0.01])
    fit = pt.identify(critical.replace(stiffness=2e4), run, ["stiffness"])
    assert fit.values["stiffness"] == pytest.approx(2.4e4, rel=1e-8)
    # from where it is to be found on, too
    assert pt.identify(critical.replace(J1=0.4), run, ["J1"]).values["J1"] == pytest.approx(0.45, rel=1e-8)


def test_several_runs_share_parameters_and_have_their_own_road_load():
    fine = 1e-3 * np.arange(3001)
    runs = []
    for high, load in ((100.0, 20.0), (150.0, 60.0)):
        torque = np.interp(fine, [0.0, 0.5, 0.55, 2.0], [load, load, high, high])
        engine, wheels = track.speeds(fine, torque)
        runs.append(
            run_of(fine[::10], engine_torque=torque[::10], engine_speed=engine[::10], wheels_speed=wheels[::10])
        )
    fit = pt.identify(far_car(), runs, list(TRUE), road_load=True)
    assert_found(fit, TRUE, 1e-9)
    assert [each.road_load for each in fit.runs] == pytest.approx([-20.0 * 10.8 / 0.35, -60.0 * 10.8 / 0.35], rel=1e-8)


def test_bounds_hold_and_are_told():
    fit = pt.identify(
        far_car().replace("vehicle", m=2400.0),
        exact_run(),
        ["vehicle.m", "engine.J"],
        road_load=True,
        bounds={"vehicle.m": (2200.0, 2600.0)},
    )
    assert fit.values["vehicle.m"] == 2200.0
    assert np.isnan(fit.standard_errors["vehicle.m"])
    assert fit.not_determined == ("vehicle.m: on its bound of 2200 kg; give wider bounds, or hold it",)


def test_the_car_that_is_found_is_a_car_and_the_start_stays():
    start = far_car()
    fit = pt.identify(start, exact_run(), list(TRUE), road_load=True)
    assert fit.start == start
    assert fit.car == pt.examples.conventional(gear_ratio=3.6) or pt.modes(fit.car).frequency_hz[1] == pytest.approx(
        pt.modes(pt.examples.conventional(gear_ratio=3.6)).frequency_hz[1], rel=1e-9
    )


# ------------------------------------------------------------------------------------------------ the motion itself


def test_the_response_is_that_of_exponentials_on_any_grid_and_critical_damping_too():
    pair = pt.Driveline(
        pt.Inertia("a", J=0.5), pt.Inertia("b", J=2.0), pt.SpringDamper("s", "a", "b", stiffness=90.0, damping=12.0)
    )
    assert pt.modes(pair).damping_ratio[1] == pytest.approx(1.0, abs=1e-12)
    rng = np.random.default_rng(2)
    knots = np.concatenate([[0.0], np.sort(rng.uniform(0.0, 3.0, 40))])
    u = rng.normal(size=41)
    car = motion.LinearCar(pair, ["a_torque"], ["a_speed", "s_torque", "b_acceleration"])
    value = u[None]
    slope = np.append(np.diff(u) / np.diff(knots), 0.0)[None]
    looks = np.sort(rng.uniform(0.0, 3.0, 25))
    found, rates = motion.responses([car], [motion.Forcing(knots, value, slope)], [looks] * 3)
    G = pt.state_space(pair, "a_torque", ["a_speed", "s_torque", "b_acceleration"])
    n = G.nstates
    big = np.zeros((n + 2, n + 2))
    big[:n, :n], big[:n, n], big[n, n + 1] = G.A, G.B[:, 0], 1.0
    for look, values in zip(looks, found[0].T, strict=True):
        x = np.zeros(n)
        for k, (a, b) in enumerate(zip(knots, np.append(knots[1:], np.inf), strict=True)):
            h = min(b, look) - a
            if h <= 0.0:
                break
            now = scipy.linalg.expm(big * h) @ np.concatenate([x, [u[k], slope[0, k]]])
            x, torque = now[:n], now[n]
        np.testing.assert_allclose(values, G.C @ x + G.D[:, 0] * torque, rtol=1e-6, atol=1e-7)
    assert rates.shape == found.shape


def test_whitening_is_that_of_the_whole_covariance(tmp_path):
    """Against the Cholesky factor of the covariance of all samples together."""
    t = 0.02 * np.arange(60)
    model = MODEL.replace(rim_share=0.0)
    rng = np.random.default_rng(4)
    measured = rng.normal(size=(2, 60))
    measured[1, [7, 8, 30]] = np.nan
    t = t + np.where(np.arange(60) >= 40, 0.06, 0.0)  # three samples are missing altogether
    run = channels(
        file_run(
            tmp_path, time=t, engine_torque=rng.normal(size=60), engine_speed=measured[0], wheels_speed=measured[1]
        ),
        ["engine_torque"],
        ["engine_speed", "wheels_speed"],
    )
    car = motion.LinearCar(model, ["engine_torque"], ["engine_speed", "wheels_speed"])
    levels = noise.Levels(np.array([3.0]), np.array([0.2, 0.05]))
    whiten = noise.Whitening(run, car, levels)
    phi, B0, B1 = car.step(0.02, 1)
    count = 63
    response = np.zeros((count, 2, count))
    for j in range(count):
        x = np.zeros(len(phi))
        for k in range(count):
            if k:
                x = phi @ x + B0[:, 0] * (k - 1 == j) + B1[:, 0] * (k == j)
            response[k, :, j] = car.C @ x + car.D[:, 0] * (k == j)
    there = np.zeros((count, 2), dtype=bool)
    there[np.round(t / 0.02).astype(int)] = np.isfinite(measured.T)
    H = response[there]
    sensor = np.broadcast_to(np.square(levels.outputs), there.shape)[there]
    R = 9.0 * H @ H.T + np.diag(sensor)
    factor = np.linalg.cholesky(R)
    left = measured.T[np.isfinite(measured.T)]
    np.testing.assert_allclose(
        whiten(np.nan_to_num(measured)[:, :, None])[:, 0], np.linalg.solve(factor, left), rtol=2e-5, atol=2e-6
    )
    assert whiten.log_determinant == pytest.approx(2.0 * np.log(np.diag(factor)).sum(), rel=1e-6)


# ------------------------------------------------------------------------------------------------ noise


@pytest.mark.parametrize("quiet", [0.0, 1e-6, 1e-4])
def test_a_channel_that_is_all_but_exact_beside_a_noisy_one_gives_what_it_knows(quiet):
    """The engine's speed to 1 rpm, that of the wheels as computed: as good as the better of both, and never worse."""
    rng = np.random.default_rng(0)
    truth = pt.examples.conventional().replace("drive_shafts", stiffness=3.0e4)
    torque = pt.samples([0.0, 1.0, 1.1, 5.0], [20.0, 20.0, 200.0, 200.0])
    drive = pt.simulate(truth, T, {"engine_torque": torque})
    run = run_of(
        T,
        engine_torque=torque(T),
        engine_speed=drive["engine_speed"] + pt.rpm(1.0) * rng.standard_normal(len(T)),
        wheels_speed=drive["wheels_speed"] + quiet * rng.standard_normal(len(T)),
    )
    found = pt.identify(pt.examples.conventional(), run, ["drive_shafts.stiffness"])
    error = found.standard_errors["drive_shafts.stiffness"]
    assert 0.0 < error < 2.0
    assert abs(found.values["drive_shafts.stiffness"] - 3.0e4) < 4.0 * error + 1e-3


def test_noise_that_the_fit_has_taken_up_is_counted():
    """Twelve samples with five unknowns: white noise has the variance of what is left times 12 / (12 - 5)."""
    rng = np.random.default_rng(2)
    columns, derivatives = rng.normal(size=(1, 12, 2)), rng.normal(size=(1, 12, 3))
    noisy = rng.normal(size=12)
    every = np.concatenate([columns, derivatives], axis=2)[0]
    left = noisy - every @ np.linalg.lstsq(every, noisy, rcond=None)[0]
    t = 0.02 * np.arange(12)
    run = channels(run_of(t, engine_torque=np.sin(t), engine_speed=noisy), ["engine_torque"], ["engine_speed"])
    car = motion.LinearCar(MODEL, ["engine_torque"], ["engine_speed"])
    remainder = noise.Remainder(left[None], columns, np.zeros(2), derivatives)
    start = noise.Levels(np.array([0.0]), np.array([0.1]))
    (found,) = noise.noise_levels([run], [car], [remainder], [start])
    assert found.outputs[0] == pytest.approx(np.sqrt(left @ left / 7.0), rel=1e-3)


@pytest.fixture(scope="module")
def study():
    """Twenty runs of the track, starts 20 to 40 % off."""
    fits = []
    for seed in range(20):
        signals = track.run(seed)
        run = run_of(signals.pop("time"), **signals)
        fits.append(pt.identify(far_car(), run, list(TRUE), delays=["wheels_speed"], road_load=True))
    return fits


@pytest.mark.campaign
@pytest.mark.parametrize("name", TRUE)
def test_bias_and_spread_of_twenty_noisy_runs(study, name):
    off = np.array([fit.values[name] for fit in study]) / TRUE[name] - 1.0
    assert abs(off.mean()) <= 0.005
    assert off.std() <= 0.01
    # the standard errors are of that size
    errors = np.array([fit.standard_errors[name] for fit in study]) / TRUE[name]
    assert 0.6 < off.std() / errors.mean() < 1.5
    assert np.mean(np.abs(off) < 1.96 * errors) >= 0.8


@pytest.mark.campaign
def test_the_noise_that_was_put_in_is_found(study):
    found = {name: np.median([fit.noise[name] for fit in study]) for name in ("engine_torque", "engine_speed")}
    # noise and half a step of resolution
    assert found["engine_torque"] == pytest.approx(np.sqrt(1.0 + 1.0 / 12.0), rel=0.1)
    assert found["engine_speed"] == pytest.approx(np.sqrt(0.5**2 + 0.25**2 / 12.0) * np.pi / 30.0, rel=0.1)


def test_torque_recorded_30_ms_early_is_found_and_spoils_nothing():
    for seed in range(3):
        signals = track.run(seed, early=0.03)
        run = run_of(signals.pop("time"), **signals)
        fit = pt.identify(far_car(), run, list(TRUE), delays=["engine_torque", "wheels_speed"], road_load=True)
        assert fit.delays["engine_torque"] == pytest.approx(0.03, abs=1e-3)
        assert fit.values["engine.J"] == pytest.approx(0.3, rel=0.01)
    blind = pt.identify(far_car(), run, list(TRUE), road_load=True)
    assert abs(blind.values["engine.J"] / 0.3 - 1.0) > 0.05


def test_a_run_with_holes_and_uneven_stamps_is_used_as_it_is(tmp_path):
    signals = track.run(3)
    keep = np.delete(np.arange(901), [100, 101, 333, 700])
    signals = {name: values[keep] for name, values in signals.items()}
    signals["wheels_speed"][200:230] = np.nan
    run = file_run(tmp_path, **signals)
    assert len(run.gaps) == 10
    fit = pt.identify(far_car(), run, list(TRUE), delays=["wheels_speed"], road_load=True)
    for name, value in TRUE.items():
        assert abs(fit.values[name] - value) < 3.0 * fit.standard_errors[name]


# ------------------------------------------------------------------------------------------------ what is not told apart


def test_two_stiffnesses_that_one_speed_does_not_tell_apart_are_named_and_get_no_number():
    signals = track.run(1)
    run = run_of(signals["time"], engine_torque=signals["engine_torque"], engine_speed=signals["engine_speed"])
    car = (
        pt.examples.conventional(gear_ratio=3.6)
        .replace("drive_shafts", stiffness=24e3)
        .replace("tyres", stiffness=1.2e6)
    )
    fit = pt.identify(car, run, ["drive_shafts.stiffness", "tyres.stiffness", "vehicle.m"], road_load=True)
    assert np.isnan([fit.values[name] for name in ("drive_shafts.stiffness", "tyres.stiffness")]).all()
    assert np.isnan([fit.standard_errors[name] for name in ("drive_shafts.stiffness", "tyres.stiffness")]).all()
    assert fit.correlation[0, 1] < -0.99
    assert fit.values["vehicle.m"] == pytest.approx(2000.0, rel=0.005)
    (said,) = fit.not_determined
    assert "drive_shafts.stiffness and tyres.stiffness: correlation -1.00" in said
    assert "measure wheels_speed too" in said or "measure vehicle_speed too" in said
    assert said in repr(fit)


def test_two_inertias_on_one_shaft_are_named_without_noise_too():
    car = pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.Gear("rigid", "engine", "flywheel", ratio=1.0),
        pt.Inertia("flywheel", J=0.25),
        pt.Gear("ratio", "flywheel", "axle", ratio=MODEL.ratio),
        pt.SpringDamper("shaft", "axle", "wheels", stiffness=2e4, damping=280.0),
        pt.Inertia("wheels", J=250.0),
    )
    t = np.arange(0.0, 1.5, 0.02)
    run = two_mass_run(MODEL.replace(rim_share=0.0), t, 50.0 + 40.0 * np.sin(9.0 * t), False, [30.0, 2.5, 0.01])
    fit = pt.identify(car, run, ["engine.J", "flywheel.J", "shaft.stiffness"])
    assert np.isnan(fit.values["engine.J"])
    assert np.isnan(fit.values["flywheel.J"])
    assert fit.values["shaft.stiffness"] == pytest.approx(2.4e4, rel=1e-7)
    assert fit.not_determined[0].startswith("engine.J and flywheel.J: correlation -1.00")


def test_delays_of_all_signals_together_are_not_told_apart():
    fit = pt.identify(
        far_car(), exact_run(), list(TRUE), delays=["engine_torque", "engine_speed", "wheels_speed"], road_load=True
    )
    assert np.isnan(list(fit.delays.values())).all()
    assert "delay of engine_torque, delay of engine_speed and delay of wheels_speed" in fit.not_determined[0]
    assert_found(fit, TRUE, 1e-8)


def test_what_nothing_depends_on_is_named():
    car = pt.Driveline(*MODEL.driveline, pt.Inertia("fan", J=0.1))
    t = np.arange(0.0, 1.5, 0.02)
    run = two_mass_run(MODEL, t, 50.0 + 40.0 * np.sin(9.0 * t), True, [30.0, 2.5, 0.01])
    fit = pt.identify(car, run, ["fan.J", "engine.J"])
    assert np.isnan(fit.values["fan.J"])
    assert fit.not_determined == (
        "fan.J: not determined by what was measured, nothing measured depends on it; hold it",
    )


# ------------------------------------------------------------------------------------------------ play

PLAY = {"engine.J": 0.46, "wheels.J": 251.8, "mesh.stiffness": 24535.0, "mesh.damping": 284.0, "mesh.gap": 0.05}


def with_play(**off):
    value = {name: v * off.get(name.split(".")[1] if name != "wheels.J" else "J2", 1.0) for name, v in PLAY.items()}
    return pt.Driveline(
        pt.Inertia("engine", J=value["engine.J"]),
        pt.Gear("ratio", "engine", "shaft", ratio=10.8),
        pt.Backlash(
            "mesh",
            "shaft",
            "wheels",
            gap=value["mesh.gap"],
            stiffness=value["mesh.stiffness"],
            damping=value["mesh.damping"],
            contact="clipped",
        ),
        pt.Inertia("wheels", J=value["wheels.J"]),
    )


def play_run(t, torque, seed=None):
    """A dead zone with a contact that cannot pull, by the midpoint rule in steps of 50 us and nothing of the package."""
    J1, J2, k, d, gap = PLAY.values()
    R, h, sub = 10.8, 5e-5, 200
    w1 = w2 = 0.0
    twist = gap / 2 + torque[0] * R / k * J2 / (J1 * R * R + J2)

    def contact(y, rate):
        beyond = y - np.copysign(gap / 2, y)
        force = k * beyond + d * rate
        return force if abs(y) > gap / 2 and force * y > 0.0 else 0.0

    found = [(w1, w2)]
    for a, b in pairwise(torque):
        for i in range(sub):
            u = a + (b - a) * (i + 0.5) / sub
            S = contact(twist, w1 / R - w2)
            m1, m2 = w1 + 0.5 * h * (u - S / R) / J1, w2 + 0.5 * h * S / J2
            S = contact(twist + 0.5 * h * (w1 / R - w2), m1 / R - m2)
            twist += h * (m1 / R - m2)
            w1, w2 = w1 + h * (u - S / R) / J1, w2 + h * S / J2
        found.append((w1, w2))
    engine, wheels = np.array(found).T
    if seed is None:
        return run_of(t, engine_torque=torque, engine_speed=engine, wheels_speed=wheels)
    rng = np.random.default_rng(seed)
    engine = np.round((engine * 30 / np.pi + rng.normal(0.0, 0.5, len(t))) / 0.25) * 0.25 * np.pi / 30
    noisy = np.round(torque + rng.normal(0.0, 1.0, len(t)))
    return run_of(t, engine_torque=noisy, engine_speed=engine, wheels_speed=wheels + rng.normal(0.0, 0.04, len(t)))


REVERSALS = ([0, 0.3, 0.4, 1.0, 1.1, 1.8, 1.9, 2.2], [40, 40, -35, -35, 120, 120, -30, -30])


@pytest.mark.campaign
def test_a_gap_of_a_twentieth_of_a_radian_is_found_to_two_percent():
    t = 0.01 * np.arange(221)
    run = play_run(t, np.interp(t, *REVERSALS), seed=11)
    fit = pt.identify(with_play(gap=0.6, stiffness=0.75, damping=1.4, J=0.87, J2=1.2), run, list(PLAY))
    assert fit.values["mesh.gap"] == pytest.approx(0.05, rel=0.02)
    for name, value in PLAY.items():
        assert abs(fit.values[name] - value) < 3.0 * fit.standard_errors[name], name


def closing_clutch(t):
    """Two discs, one dragged by the other until they turn as one, by their closed form; capacity 40 t after 0.5 s."""
    J1, J2, drive = 0.3, 0.8, 5.0
    after = np.maximum(t - 0.5, 0.0)
    engine = 100.0 + (drive * t - 20.0 * after**2) / J1
    behind = 20.0 * after**2 / J2
    # 100 + (drive s + drive 0.5 - 20 s^2)/J1 = 20 s^2 / J2
    a, b, c = -20.0 / J1 - 20.0 / J2, drive / J1, 100.0 + 0.5 * drive / J1
    lock = 0.5 + (-b - np.sqrt(b * b - 4 * a * c)) / (2 * a)
    together = 20.0 * (lock - 0.5) ** 2 / J2 + drive / (J1 + J2) * (t - lock)
    locked = t > lock
    return run_of(
        t,
        a_torque=np.full(len(t), drive),
        clutch_capacity=40.0 * after,
        a_speed=np.where(locked, together, engine),
        b_speed=np.where(locked, together, behind),
    )


def test_inertias_are_found_through_a_clutch_that_slips_and_locks():
    t = 0.02 * np.arange(201)
    car = pt.Driveline(pt.Inertia("a", J=0.25), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=200.0))
    fit = pt.identify(car, closing_clutch(t), ["a.J", "b.J"])
    assert_found(fit, {"a.J": 0.3, "b.J": 0.8}, 1e-9)


def test_without_a_torque_the_measured_speed_drives():
    """Wheels behind a shaft whose other end moves as measured: ``J w' = k q + d q'``, ``q' = v / R - w``."""
    t, J, k, d, R = 0.01 * np.arange(101), 250.0, 2.4e4, 280.0, 10.8
    v = 100.0 + np.interp(t, [0.0, 0.1, 0.3, 0.5, 0.6], [0.0, 0.0, 20.0, 20.0, 10.0])
    A = np.array([[0.0, -1.0], [k / J, -d / J]])
    B = np.array([1.0 / R, d / (J * R)])
    x = np.array([0.0, 100.0 / R])
    wheels = [x[1]]
    for a, b in pairwise(v):
        big = np.zeros((4, 4))
        big[:2, :2], big[:2, 2], big[2, 3] = A * 0.01, B * 0.01, 1.0
        x = (scipy.linalg.expm(big) @ [*x, a, b - a])[:2]
        wheels.append(x[1])
    car = pt.Driveline(
        pt.SpeedSource("engine", "input"),
        pt.Gear("gear", "input", "axle", ratio=R),
        pt.SpringDamper("shaft", "axle", "wheels", stiffness=3.1e4, damping=200.0),
        pt.Inertia("wheels", J=J),
    )
    run = run_of(t, engine_speed=v, wheels_speed=np.array(wheels))
    fit = pt.identify(car, run, ["shaft.stiffness", "shaft.damping"])
    assert_found(fit, {"shaft.stiffness": k, "shaft.damping": d}, 1e-9)


# ------------------------------------------------------------------------------------------------ validation


def test_a_response_of_control_is_a_run():
    G = pt.state_space(pt.examples.conventional(gear_ratio=3.6), "engine_torque", ["engine_speed", "wheels_speed"])
    run = control.forced_response(G, T, U)
    assert_found(pt.identify(far_car(), run, list(TRUE)), TRUE, 1e-9)
    both = control.step_response(pt.state_space(MODEL, ["engine_torque", "tread_torque"], "wheels_speed"), T[:60])
    with pytest.raises(pt.SignalError, match="several runs, one for each input"):
        pt.identify(MODEL, both, ["J1"])


def test_validation_is_the_fit_of_a_car_to_a_run_that_it_did_not_see():
    seen, other = track.run(0), track.run(5)
    fit = pt.identify(far_car(), run_of(seen.pop("time"), **seen), list(TRUE), delays=["wheels_speed"], road_load=True)
    run = run_of(other.pop("time"), **other)
    checked = pt.validate(fit.car, run, delays=fit.delays, road_load=True)
    assert checked.fit["engine_speed"] == pytest.approx(fit.runs[0].fit["engine_speed"], abs=0.1)
    assert pt.validate(fit.start, run, road_load=True).fit["engine_speed"] < 98.0
    assert repr(checked).startswith("Validation on run: engine_speed 99.")
    e = checked.residual("engine_speed")
    y = other["engine_speed"]
    assert checked.fit["engine_speed"] == pytest.approx(
        100 * (1 - np.linalg.norm(e) / np.linalg.norm(y - y.mean())), abs=1e-9
    )


def test_a_mode_that_the_model_lacks_is_a_peak_of_the_residual_spectrum():
    t = 0.01 * np.arange(1001)
    signals = {"engine_torque": U[0] + np.interp(t, *track.TIP_INS) * 0 + 20 * np.sin(5 * t)}
    engine, wheels = track.speeds(t, signals["engine_torque"], h=0.01)
    run = run_of(t, **signals, engine_speed=engine + 0.3 * np.sin(2 * np.pi * 12.5 * t), wheels_speed=wheels)
    frequency, density = pt.validate(pt.examples.conventional(gear_ratio=3.6), run, road_load=True).spectrum(
        "engine_speed"
    )
    assert frequency[density.argmax()] == pytest.approx(12.5, abs=0.3)
    # half the square of the amplitude
    assert np.trapezoid(density, frequency) == pytest.approx(0.045, rel=0.05)


# ------------------------------------------------------------------------------------------------ bad input

RUN = exact_run()
REFUSED = {
    "no element": (
        lambda: pt.identify(far_car(), RUN, ["drive_shaft.stiffness"]),
        pt.UnknownNameError,
        'did you mean "drive_shafts"',
    ),
    "no value": (
        lambda: pt.identify(far_car(), RUN, ["drive_shafts.colour"]),
        pt.UnknownNameError,
        '"drive_shafts.colour" is not one of',
    ),
    "a node": (
        lambda: pt.identify(far_car(), RUN, ["drive_shafts.a"]),
        pt.UnknownNameError,
        '"drive_shafts.a" is not one of',
    ),
    "an element alone": (
        lambda: pt.identify(far_car(), RUN, ["engine"]),
        pt.PowertrainError,
        '"element.value".*engine has J',
    ),
    "no field": (lambda: pt.identify(MODEL, RUN, ["J3"]), pt.UnknownNameError, '"J3" is not one of a TwoMass'),
    "nothing": (lambda: pt.identify(far_car(), RUN, []), pt.PowertrainError, "no parameter is given"),
    "twice": (lambda: pt.identify(far_car(), RUN, ["engine.J", "engine.J"]), pt.PowertrainError, "each once"),
    "from nothing": (
        lambda: pt.identify(far_car().replace("drive_shafts", damping=0.0), RUN, ["drive_shafts.damping"]),
        pt.ParameterError,
        "not 0 to start from",
    ),
    "no run": (lambda: pt.identify(far_car(), [], ["engine.J"]), pt.PowertrainError, "no run is given"),
    "no such delay": (
        lambda: pt.identify(far_car(), RUN, ["engine.J"], delays=["wheel_speed"]),
        pt.UnknownNameError,
        'did you mean "wheels_speed"',
    ),
    "a delay twice": (
        lambda: pt.identify(far_car(), RUN, ["engine.J"], delays=["wheels_speed"] * 2),
        pt.PowertrainError,
        "each signal once",
    ),
    "bounds elsewhere": (
        lambda: pt.identify(far_car(), RUN, ["engine.J"], bounds={"engine.J": (0.3, 0.4)}),
        pt.PowertrainError,
        "the start in between",
    ),
    "bounds of another": (
        lambda: pt.identify(far_car(), RUN, ["engine.J"], bounds={"vehicle.m": (1.0, 2.0)}),
        pt.UnknownNameError,
        '"vehicle.m" is not one of the parameters',
    ),
    "no output": (
        lambda: pt.identify(far_car(), run_of(T, engine_torque=U, motor_speed=U), ["engine.J"]),
        pt.SignalError,
        "no output of this car",
    ),
    "no input": (
        lambda: pt.identify(far_car(), run_of(T, engine_speed=U), ["engine.J"]),
        pt.SignalError,
        "no input of this car, permitted: at least one of engine_torque",
    ),
    "a constant input": (
        lambda: pt.identify(far_car(), run_of(T, engine_torque=0 * U + 30.0, engine_speed=U), ["engine.J"]),
        pt.SignalError,
        "engine_torque does not change",
    ),
    "a constant output": (
        lambda: pt.identify(far_car(), run_of(T, engine_torque=U, engine_speed=0 * U + 100.0), ["engine.J"]),
        pt.SignalError,
        "engine_speed does not change",
    ),
    "too short": (
        lambda: pt.identify(
            far_car(), run_of(T[95:110], engine_torque=U[95:110], engine_speed=U[95:110]), ["engine.J"]
        ),
        pt.PowertrainError,
        "15 samples for 14 unknowns .* permitted: at least 42",
    ),
    "a road load that is measured": (
        lambda: pt.identify(
            far_car(), run_of(T, engine_torque=U, vehicle_force=-U, engine_speed=U), ["engine.J"], road_load=True
        ),
        pt.PowertrainError,
        "vehicle_force is measured",
    ),
    "no car": (lambda: pt.identify("car", RUN, ["engine.J"]), pt.PowertrainError, "a Driveline or a TwoMass"),
    "no response": (lambda: pt.identify(far_car(), 3.0, ["engine.J"]), pt.PowertrainError, "a response"),
    "no signal": (
        lambda: pt.identify(far_car(), RUN, ["engine.J"], signals=["car_speed"]),
        pt.UnknownNameError,
        "not in this run",
    ),
    "no output of the car": (
        lambda: pt.validate(far_car(), run_of(T, engine_torque=U, motor_speed=U), signals=["motor_speed"]),
        pt.UnknownNameError,
        "an output of this car",
    ),
    "no residual": (
        lambda: pt.validate(far_car(), RUN).residual("vehicle_speed"),
        pt.UnknownNameError,
        "an output of this run",
    ),
}


@pytest.mark.parametrize("what", REFUSED)
def test_what_cannot_be_identified_is_refused_by_name(what):
    call, error, message = REFUSED[what]
    with pytest.raises(error, match=message):
        call()


def test_an_input_with_a_gap_is_refused_and_its_parts_are_two_runs(tmp_path):
    torque = np.where((T > 3.0) & (T < 3.5), np.nan, U)
    run = file_run(
        tmp_path, time=T, engine_torque=torque, engine_speed=RUN["engine_speed"], wheels_speed=RUN["wheels_speed"]
    )
    with pytest.raises(pt.SignalError, match=r"engine_torque has a gap from 3 to 3.5 s.*run.part\(start, stop\)"):
        pt.identify(far_car(), run, list(TRUE), road_load=True)
    fit = pt.identify(far_car(), [run.part(0.0, 3.0), run.part(3.5, 5.0)], list(TRUE), road_load=True)
    assert_found(fit, TRUE, 1e-9)
