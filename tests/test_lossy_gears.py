"""Gears with losses: `elements/gears`, `elements/frictions`, and what loads them, `hybrid/loads`."""

from itertools import pairwise

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import powertrain_ctrl as pt

SIGNS = [(ratio, side) for ratio in (3.0, -3.0) for side in (1.0, -1.0)]


def pair(efficiency, ratio=3.0, Ja=0.2, Jb=0.5):
    return pt.Driveline(
        pt.Inertia("a", J=Ja), pt.Gear("gear", "a", "b", ratio=ratio, efficiency=efficiency), pt.Inertia("b", J=Jb)
    )


@pytest.mark.parametrize(("ratio", "side"), SIGNS)
@pytest.mark.parametrize("driven", [False, True])
def test_what_leaves_it_is_what_enters_times_the_efficiency(ratio, side, driven):
    # T_b = ratio T_a * efficiency while a drives, / efficiency while b does, so that J_a counts by ratio^2 times that
    efficiency, speed, torque, end = 0.8, side * 300.0, side * 40.0, 0.5
    car = pair(efficiency, ratio)
    load = "b_torque" if driven else "a_torque"
    response = pt.simulate(car, [0.0, end], {load: torque * (np.sign(ratio) if driven else 1.0)}, {"a": speed})
    if driven:
        entering = torque * np.sign(ratio)
        rise = entering / (ratio**2 * 0.2 / efficiency + 0.5)
        power = entering - 0.5 * rise
        turned = speed / ratio * end + 0.5 * rise * end**2
    else:
        rise = efficiency * ratio * torque / (efficiency * ratio**2 * 0.2 + 0.5)
        power = torque - 0.2 * ratio * rise
        turned = speed * end + 0.5 * ratio * rise * end**2
    assert response["b_speed"][-1] == pytest.approx(speed / ratio + rise * end, rel=1e-13)
    assert response["a_speed"] == pytest.approx(ratio * response["b_speed"], rel=1e-13)
    # heat is what of the work that enters does not leave
    assert response.slip_energy["gear"] == pytest.approx((1.0 - efficiency) * power * turned, rel=1e-11)
    assert not response.events


@pytest.mark.parametrize(("ratio", "side"), SIGNS)
def test_against_a_spring_it_swings_by_half_periods_and_sticks_between_its_two_equilibria(ratio, side):
    # while a drives b swings about efficiency * ratio * T / k, while the spring drives about ratio * T / (efficiency k)
    efficiency, k, Ja, Jb, torque = 0.9, 800.0, 0.02, 0.5, 40.0 * side
    car = pt.Driveline(*pair(efficiency, ratio, Ja, Jb), pt.Drag("spring", "b", damping=0.0, stiffness=k))
    response = pt.simulate(car, [0.0, 1.0], {"a_torque": torque})
    twist, time, times = 0.0, 0.0, []
    for part in (efficiency, 1.0 / efficiency, efficiency, 1.0 / efficiency, efficiency):
        twist = 2.0 * part * ratio * torque / k - twist
        time += np.pi * np.sqrt((part * ratio**2 * Ja + Jb) / k)
        times.append(time)
    middle = ratio * torque / k
    assert efficiency < twist / middle < 1.0 / efficiency
    assert [event.time for event in response.events] == pytest.approx(times, abs=1e-13)
    assert [event.kind for event in response.events] == ["slip"] * 4 + ["lock"]
    assert response["spring_twist"][-1] == pytest.approx(twist, rel=1e-13)
    assert response["gear_torque"][-1] == pytest.approx(torque - k * twist / ratio, rel=1e-11)
    lost = torque * ratio * twist - 0.5 * k * twist**2
    assert response.slip_energy["gear"] == pytest.approx(lost, rel=1e-11)


K, D, JA, JB, JL, RATIO, ETA = 800.0, 1.0, 0.2, 0.5, 4.0, 3.0, 0.9
SHAFT = pt.Driveline(*pair(ETA), pt.SpringDamper("s", "b", "l", stiffness=K, damping=D), pt.Inertia("l", J=JL))
TORQUE = pt.samples([0.0, 0.5, 1.0, 2.0], [40.0, 40.0, -60.0, 30.0])


def own_run():
    """The same by an integrator of its own that stops where the load of the gear turns round."""

    def shaft(y):
        return K * y[2] + D * (y[0] - y[1])

    def rise(t, y, part):
        return (part * RATIO * float(TORQUE(t)) - shaft(y)) / (part * RATIO**2 * JA + JB)

    def rates(t, y, part):
        return rise(t, y, part), shaft(y) / JL, y[0] - y[1]

    def load(t, y, part):
        return float(TORQUE(t)) - JA * RATIO * rise(t, y, part)

    load.terminal = True
    y, part, times = np.array([100.0, 100.0, 0.0]), ETA, []
    for begin, end in pairwise((0.0, 0.5, 1.0, 2.0)):
        while begin < end:
            run = solve_ivp(rates, (begin, end), y, "DOP853", rtol=1e-13, atol=1e-12, events=load, args=(part,))
            begin, y = run.t[-1], run.y[:, -1]
            if begin < end:
                times.append(begin)
                part = 1.0 / part
                y = y + 1e-9 * np.array(rates(begin, y, part))  # over the zero at which it has stopped
                begin += 1e-9
    return y, times


def test_it_is_driving_and_driven_when_an_independent_integrator_says_so():
    y, times = own_run()
    response = pt.simulate(SHAFT, [0.0, 2.0], {"a_torque": TORQUE}, {"a": 300.0})
    assert [event.time for event in response.events] == pytest.approx(times, abs=2e-9)
    assert {event.kind for event in response.events} == {"stage"}
    end = [response[name][-1] for name in ("b_speed", "l_speed", "s_twist")]
    assert end == pytest.approx(y, abs=1e-8)


def test_all_that_is_lost_is_heat_of_the_gears():
    stiffness = {"s": 900.0, "t": 700.0}
    J = {"a": 0.3, "b": 0.1, "c": 0.5, "d": 0.05, "e": 1.0}
    car = pt.Driveline(
        *(pt.Inertia(node, J=value) for node, value in J.items()),
        pt.Gear("first", "a", "b", ratio=-2.0, efficiency=0.9),
        pt.SpringDamper("s", "b", "c", stiffness=stiffness["s"]),
        pt.Gear("second", "c", "d", ratio=1.5, efficiency=0.95),
        pt.SpringDamper("t", "d", "e", stiffness=stiffness["t"]),
    )
    response = pt.simulate(car, np.linspace(0.0, 1.5, 16), {}, {"a": 40.0, "c": 0.0, "e": 0.0})
    held = sum(0.5 * value * response[f"{node}_speed"] ** 2 for node, value in J.items())
    held = held + sum(0.5 * k * response[f"{name}_twist"] ** 2 for name, k in stiffness.items())
    assert len(response.events) > 10
    assert {event.kind for event in response.events} >= {"stage", "slip"}
    assert held[0] - held[-1] == pytest.approx(sum(response.slip_energy.values()), abs=1e-11 * held[0])
    assert min(response.slip_energy.values()) > 0.01 * held[0]


def test_without_loss_it_is_the_gear_without_an_efficiency():
    lossless = pt.Gear("gear", "a", "b", ratio=3.0)
    assert pt.Gear("gear", "a", "b", ratio=3.0, efficiency=1.0) == lossless
    assert lossless.laws == ()
    nearly = SHAFT.replace("gear", efficiency=1.0 - 1e-6)
    one, other = (
        pt.simulate(car, [0.0, 1.0, 2.0], {"a_torque": TORQUE}, {"a": 300.0})
        for car in (nearly, SHAFT.replace("gear", efficiency=1.0))
    )
    assert one["l_speed"] == pytest.approx(other["l_speed"], rel=1e-6)
    assert not other.events


def test_turned_round_it_is_the_same():
    turned = pt.Driveline(
        *(pt.Gear("gear", "b", "a", ratio=1.0 / RATIO, efficiency=ETA) if e.name == "gear" else e for e in SHAFT)
    )
    one, other = (
        pt.simulate(car, np.linspace(0.0, 2.0, 21), {"a_torque": TORQUE}, {"a": 300.0}) for car in (SHAFT, turned)
    )
    assert other["l_speed"] == pytest.approx(one["l_speed"], abs=1e-9)
    assert [e.time for e in other.events] == pytest.approx([e.time for e in one.events], abs=1e-11)
    assert other.slip_energy["gear"] == pytest.approx(one.slip_energy["gear"], rel=1e-10)


@pytest.mark.parametrize("torque", [40.0, -40.0])
def test_a_start_under_load_is_steady(torque):
    load = {"a_torque": torque}
    response = pt.simulate(SHAFT, np.linspace(0.0, 1.0, 11), load, {"a": 300.0}, initial_load=load)
    part = ETA if torque > 0.0 else 1.0 / ETA
    rise = part * RATIO * torque / (part * RATIO**2 * JA + JB + JL)
    assert response["s_torque"] == pytest.approx(np.full(11, JL * rise), abs=1e-9)
    assert response["l_acceleration"] == pytest.approx(np.full(11, rise), abs=1e-9)
    assert not response.events


def test_a_rig_that_turns_it_feels_its_losses():
    car = pt.Driveline(
        pt.SpeedSource("rig", "a"),
        pt.Gear("gear", "a", "b", ratio=4.0, efficiency=0.8),
        pt.Inertia("b", J=0.5),
        pt.Drag("brake", "b", damping=6.0),
    )
    response = pt.simulate(car, [0.0, 0.5, 1.0], {"rig_speed": pt.samples([0.0, 1.0], [100.0, 140.0])})
    # b turns with 25 + 10 t and takes 6 omega + 0.5 * 10
    taken = (6.0 * np.array([25.0, 30.0, 35.0]) + 5.0) / (4.0 * 0.8)
    assert np.abs(response["rig_torque"]) == pytest.approx(taken, rel=1e-12)


def test_a_torque_that_oscillates_goes_through_it():
    # b holds against it with 90 N m, so that a always drives: omega_b' = (part * i * 10 cos w t - 90) / M
    w, end, M = 50.0, 0.123, ETA * RATIO**2 * JA + JB
    inputs = {"a_torque": pt.harmonic(10.0, w), "b_torque": -90.0}
    response = pt.simulate(pair(ETA), [0.0, end], inputs, {"a": 300.0})
    expected = 100.0 + (ETA * RATIO * 10.0 * np.sin(w * end) / w - 90.0 * end) / M
    assert response["b_speed"][-1] == pytest.approx(expected, rel=1e-12)
    assert not response.events


def test_the_discrete_system_is_the_simulation():
    times, start = np.arange(101) * 0.01, {"a": 300.0}
    system = pt.nonlinear_system(SHAFT, dt=0.01)
    values = pt.input_values(system, SHAFT, times, {"a_torque": TORQUE})
    response = control.input_output_response(system, times, values, pt.initial_state(system, SHAFT, start))
    exact = pt.simulate(SHAFT, times, {"a_torque": TORQUE}, start)
    for name in ("b_speed", "l_speed", "s_torque", "gear_torque"):
        assert response.outputs[system.find_output(name)] == pytest.approx(exact[name], abs=1e-9)


def test_a_controlled_car_loses_as_much_behind_a_lag():
    car = pt.examples.conventional(damping="open")
    nearly = car.replace("gearbox", efficiency=1.0 - 1e-7)
    plants = (pt.SampledPlant(car=each, lag=0.03, delay=0.01) for each in (car, nearly))
    one, other = (pt.closed_loop(plant, None, pt.ramp(0.0, 0.1, 100.0), duration=0.3) for plant in plants)
    assert other["vehicle_acceleration"] == pytest.approx(one["vehicle_acceleration"], abs=1e-5)


def test_a_launch_with_losses_takes_longer_and_keeps_the_energy():
    car = pt.examples.conventional(damping="open")
    lossy = car.replace("gearbox", efficiency=0.97).replace("final_drive", efficiency=0.98)
    times = [0.0, 3.5]
    plain, response = (pt.launch(each, timepts=times) for each in (car, lossy))
    locks = [next(e.time for e in r.events if e.kind == "lock" and e.element == "clutch") for r in (plain, response)]
    # the clutch carries 370 N m: behind it 5 % less drive the same car
    assert 0.02 < locks[1] / locks[0] - 1.0 < 0.05
    assert {"gearbox", "final_drive"} < response.slip_energy.keys()
    # gears go on turning from driving to driven after the clutch has locked
    family = pt.family(car.replace("final_drive", efficiency=0.98), {"gearbox.efficiency": [1.0, 0.97]})
    assert family.launch()["lock_time"][1] == pytest.approx(locks[1], abs=1e-9)
    assert response["vehicle_speed"][-1] == pytest.approx(0.951 * plain["vehicle_speed"][-1], rel=0.02)


def test_linear_models_refuse_it_and_its_operating_point_has_no_loss():
    with pytest.raises(pt.PowertrainError, match=r"gear: is not linear, .* car.at\("):
        pt.modes(SHAFT)
    assert SHAFT.at(speed={"a": 100.0}) == SHAFT.replace("gear", efficiency=1.0)
    with pytest.raises(pt.PowertrainError, match=r"gear needs memory of its mode; give dt"):
        pt.nonlinear_system(SHAFT)
    with pytest.raises(pt.PowertrainError, match=r"gear loses a part of its load, permitted in C: .* efficiency of 1"):
        pt.export.c_plant(SHAFT)


def test_in_a_family_it_has_losses_where_a_variant_has_them():
    lossless = SHAFT.replace("gear", efficiency=1.0)
    family = pt.family(lossless, {"gear.efficiency": [1.0, 0.9]})
    told = r"variant 1 \(gear.efficiency = 0.9\): PowertrainError: gear: is not linear"
    with pytest.warns(RuntimeWarning, match=told):
        omega = family.natural_frequencies()
    assert np.isfinite(omega[0]).all()
    assert np.isnan(omega[1]).all()


@pytest.mark.parametrize("efficiency", [0.0, -0.5, 1.01, float("nan")])
def test_an_efficiency_is_more_than_0_and_at_most_1(efficiency):
    with pytest.raises(pt.ParameterError, match=r"gear: efficiency = .*, permitted: > 0, at most 1"):
        pt.Gear("gear", "a", "b", ratio=2.0, efficiency=efficiency)


def test_gears_that_hold_each_other_are_refused_by_name_and_remedy():
    car = pt.Driveline(*pair(ETA), pt.Gear("other", "a", "b", ratio=3.0))
    with pytest.raises(
        pt.TopologyError, match=r"gear: other gears or locked clutches hold what it holds.* efficiency 1"
    ):
        pt.simulate(car, [0.0, 1.0], {})


def test_a_gear_between_springs_alone_needs_an_inertia():
    car = pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.SpringDamper("s", "engine", "a", stiffness=1e3),
        pt.Gear("gear", "a", "b", ratio=2.0, efficiency=0.9),
        pt.SpringDamper("t", "b", "wheels", stiffness=1e3),
        pt.Inertia("wheels", J=1.0),
    )
    with pytest.raises(pt.TopologyError, match=r'node "[ab]" has no inertia and gear .* give it an Inertia'):
        pt.simulate(car, [0.0, 1.0], {})


def test_files_give_it_back_equal(tmp_path):
    SHAFT.save(tmp_path / "car.toml")
    assert pt.load(tmp_path / "car.toml") == SHAFT
    assert "efficiency = 0.9" in (tmp_path / "car.toml").read_text()
    SHAFT.replace("gear", efficiency=1.0).save(tmp_path / "car.toml")
    assert pt.load(tmp_path / "car.toml")["gear"].efficiency == 1.0


def test_its_characteristic_is_its_friction_over_what_it_carries():
    ax = pt.plots.characteristic(pt.Gear("gear", "a", "b", ratio=3.0, efficiency=0.8))
    forward, backward = (dict(zip(*line.get_data(), strict=True)) for line in ax.get_lines()[:2])
    # 125 N m enter for 100 through it; where b drives, 80 of 100 leave
    assert forward == pytest.approx({-100.0: 20.0, 0.0: 0.0, 100.0: 25.0})
    assert backward == pytest.approx({-100.0: -25.0, 0.0: 0.0, 100.0: -20.0})
