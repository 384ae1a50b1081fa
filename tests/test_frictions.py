"""Friction over slip, clutches whose friction falls with slip, dog clutches."""

import numpy as np
import pytest
import scipy.linalg

import powertrain_ctrl as pt
from tests.cases import case


def judder():
    reference = case("judder_growth_and_stick_slip")
    p, high = reference.p, 50.0
    # a drive so heavy that its speed is constant
    car = pt.Driveline(
        pt.Inertia("drive", J=1e11),
        pt.Inertia("disc", J=p.J),
        pt.Drag("s", "disc", damping=p.damping, stiffness=p.stiffness),
        pt.Clutch(
            "c",
            "drive",
            "disc",
            max_torque=p.normal_torque * p.mu0,
            friction=((0.0, 1.0), (high, 1.0 + p.mu_slope / p.mu0 * high)),
        ),
    )
    rest = p.normal_torque * (p.mu0 + p.mu_slope * p.drive_speed) / p.stiffness
    return reference, car, {"initial_speed": {"drive": p.drive_speed, "disc": p.w_init}, "initial_twist": {"s": rest}}


def test_judder_grows_sticks_and_slips_as_the_closed_form_says():
    reference, car, start = judder()
    response = pt.simulate(car, np.linspace(0.0, 2.0, 201), **start)
    locks = [event.time for event in response.events if event.kind == "lock"]
    slips = [event.time for event in response.events if event.kind == "slip"]
    assert locks[0] == pytest.approx(reference.e.first_stick, abs=1e-9)
    assert slips[0] == pytest.approx(reference.e.first_break, abs=1e-9)
    assert locks[-1] - locks[-2] == pytest.approx(reference.e.stick_slip_period, abs=1e-9)


def last_swing(slope):
    reference, _, _ = judder()
    p = reference.p
    car = pt.Driveline(
        pt.Inertia("drive", J=1e11),
        pt.Inertia("disc", J=p.J),
        pt.Drag("s", "disc", damping=p.damping, stiffness=p.stiffness),
        pt.Clutch("c", "drive", "disc", max_torque=300.0, friction=((0.0, 1.0), (50.0, 1.0 + slope / p.mu0 * 50.0))),
    )
    rest = 300.0 * (1.0 + slope / p.mu0 * p.drive_speed) / p.stiffness
    response = pt.simulate(
        car,
        np.linspace(0.0, 20.0, 20001),
        initial_speed={"drive": p.drive_speed, "disc": 0.1},
        initial_twist={"s": rest},
    )
    return np.abs(response["disc_speed"][-1000:]).max()


def test_the_critical_slope_by_bisection_is_that_of_the_eigenvalues():
    # growing or not after 20 s; the eigenvalue of the disc crosses zero where N mu' = -d
    stable, unstable = -0.0005, -0.002
    for _ in range(10):
        middle = 0.5 * (stable + unstable)
        stable, unstable = (stable, middle) if last_swing(middle) > 0.1 else (middle, unstable)
    assert 0.5 * (stable + unstable) == pytest.approx(
        case("judder_growth_and_stick_slip").e.critical_mu_slope, rel=0.01
    )


def test_a_ramp_of_the_capacity_says_how_far_it_is_from_exact():
    reference = case("capacity_ramp_times_mu_of_slip")
    p = reference.p
    falling = ((0.0, 1.0), (400.0, 1.0 + p.mu_slope * 400.0))
    car = pt.Driveline(pt.Inertia("J", J=p.J), pt.Clutch("c", "J", max_torque=400.0, friction=falling))
    response = pt.simulate(car, [0.0, 0.5, 1.0], {"c_capacity": pt.ramp(0.0, 1.0, p.capacity_rate)}, {"J": p.slip0})
    lock = next(event.time for event in response.events if event.kind == "lock")
    error = abs(lock - reference.e.lock_time)
    assert error < 1e-6
    assert error < response.error_estimate["events"]
    slip_error = abs(response["J_speed"][1] - reference.e.slip_at_0p5_s)
    assert slip_error < response.error_estimate["J_speed"]


def test_friction_that_does_not_depend_on_slip_is_exact_and_says_so():
    car = pt.examples.conventional(damping="open")
    flat = car.replace("clutch", friction=((0.0, 1.0), (1000.0, 1.0)))
    one, other = pt.launch(car), pt.launch(flat)
    assert one.error_estimate == other.error_estimate == {}
    assert other.events[-1].time == pytest.approx(one.events[-1].time, abs=1e-12)


def test_a_launch_with_stribeck_friction_is_that_of_small_steps():
    # constant capacity 300 N m, factor 1 to 0.87 within 30 rad/s, by an integrator of its own up to the first lock
    points = ((0.0, 1.0), (30.0, 0.87))
    car = pt.examples.conventional(damping="open").replace("clutch", friction=points)
    response = pt.simulate(car, [0.0, 0.7], {"clutch_capacity": 300.0, "engine_torque": 200.0}, {"engine": 300.0})
    model = pt.assemble(car.release("clutch"))
    slip_row = model.S[0] @ model.T
    M, D, K = model.M, model.D, model.K
    load = model.T.T @ model.B[:, model.inputs.index("engine_torque")] * 200.0

    def rate(t, y):
        q, v = np.split(y, 2)
        slip = slip_row @ v
        friction = 300.0 * np.interp(slip, *np.transpose(points))
        return np.concatenate([v, np.linalg.solve(M, load - slip_row * friction - D @ v - K @ q)])

    def locked(t, y):
        return slip_row @ y[len(M) :]

    locked.terminal = True
    start = np.zeros(2 * len(M))
    # what turns with the engine before the clutch
    ahead = np.linalg.lstsq(
        np.vstack([model.F[model.stiffness > 0.0], model.T[0]]),
        np.r_[np.zeros((model.stiffness > 0.0).sum()), 300.0],
        rcond=None,
    )[0]
    start[len(M) :] = ahead
    lower = scipy.integrate.solve_ivp(rate, (0.0, 0.7), start, "DOP853", events=locked, rtol=1e-10, atol=1e-10)
    first, second = response.events[:2]
    assert (first.kind, second.kind) == ("stage", "lock")
    assert second.time == pytest.approx(lower.t_events[0][0], abs=1e-6)


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (((0.0, 0.9),), r"a first point \(0, 1\)"),
        ((), r"a first point \(0, 1\)"),
        (((0.0, 1.0), (0.0, 0.5)), "> 0, the slip before"),
        (((0.0, 1.0), (1.0, -0.5)), ">= 0"),
        (((0.0, 1.0, 2.0),), "pairs"),
        (5.0, "pairs"),
    ],
)
def test_points_that_are_no_friction_are_refused(points, message):
    with pytest.raises(pt.PowertrainError, match=message):
        pt.Clutch("c", "a", "b", max_torque=1.0, friction=points)


def test_a_bearing_with_friction_coasts_down_in_a_straight_line():
    car = pt.Driveline(pt.Inertia("J", J=0.5), pt.Drag("bearing", "J", damping=0.0, friction=2.0))
    response = pt.simulate(car, [0.0, 1.0, 5.0], {"J_torque": 0.5}, {"J": 6.0})
    # (2 - 0.5) / 0.5 = 3 rad/s^2: at rest after 2 s, and the torque of 0.5 N m does not move it again
    assert response["J_speed"].tolist() == pytest.approx([6.0, 3.0, 0.0], abs=1e-13)
    assert [(event.element, event.kind, event.time) for event in response.events] == [
        ("bearing", "lock", pytest.approx(2.0))
    ]
    assert response.slip_energy["bearing"] == pytest.approx(2.0 * 6.0)
    assert response["bearing_torque"][-1] == pytest.approx(0.5)


def gearbox():
    return pt.Driveline(
        pt.Inertia("a", J=0.3),
        pt.Inertia("b", J=0.5),
        pt.DogClutch("dog", "a", "b"),
        pt.Inertia("c", J=0.2),
        pt.SpringDamper("s", "b", "c", stiffness=900.0),
    )


def test_a_dog_clutch_keeps_the_momentum_and_says_what_it_costs():
    engaged = pt.step(0.2, 1.0) + pt.step(0.7, -1.0)
    response = pt.simulate(
        gearbox(), np.linspace(0.0, 1.0, 101), {"dog_engaged": engaged, "a_torque": 5.0}, {"a": 10.0}
    )
    momentum = 0.3 * response["a_speed"] + 0.5 * response["b_speed"] + 0.2 * response["c_speed"]
    np.testing.assert_allclose(momentum, 3.0 + 5.0 * response.time, rtol=1e-12)
    # a at 10 + 5/0.3 0.2 rad/s meets b at rest
    slip = 10.0 + 5.0 * 0.2 / 0.3
    assert response.slip_energy["dog"] == pytest.approx(0.5 * 0.3 * 0.5 / 0.8 * slip**2, rel=1e-12)
    assert [(event.kind, round(event.time, 12)) for event in response.events] == [("lock", 0.2), ("release", 0.7)]
    assert response.events[0].heat == pytest.approx(response.slip_energy["dog"])


def test_a_dog_clutch_is_locked_and_released_in_linear_models():
    car = gearbox()
    two, three = pt.modes(car).frequency_hz, pt.modes(car.release("dog")).frequency_hz
    # 0.8 and 0.2 on the spring, or 0.5 and 0.2
    assert two[-1] == pytest.approx(np.sqrt(900.0 * (1 / 0.8 + 1 / 0.2)) / (2.0 * np.pi))
    assert three[-1] == pytest.approx(np.sqrt(900.0 * (1 / 0.5 + 1 / 0.2)) / (2.0 * np.pi))


@pytest.mark.parametrize("signal", [0.5, pt.ramp(0.1, 0.1, 1.0), -1.0])
def test_half_engaged_is_refused(signal):
    with pytest.raises(pt.SignalError, match=r"dog_engaged.*permitted: 0"):
        pt.simulate(gearbox(), [0.0, 1.0], {"dog_engaged": signal})
