"""The clutch as control.NonlinearIOSystem, continuous and discrete, against the exact core.

Of hybrid/discrete.
"""

import copy
import dataclasses
import re

import control
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.base.systems import linear_system

TORQUE, CAPACITY = pt.ramp(1.5, 0.22, 350.0), pt.ramp(1.5, 0.22, 370.0)


def car():
    return pt.examples.conventional(damping="open")


def sampled(system, t, **signals):
    u = np.zeros((system.ninputs, len(t)))
    for name, signal in signals.items():
        u[system.find_input(name)] = signal(t) if callable(signal) else signal
    return u


def launched(system, t, **settings):
    u = sampled(system, t, engine_torque=TORQUE, clutch_capacity=CAPACITY)
    start = pt.initial_state(system, car(), {"engine": pt.rpm(5000)})
    return control.input_output_response(system, t, u, start, **settings)


def test_discrete_system_is_exact_at_the_samples():
    t = np.arange(1400, 3001) * 0.001  # the ramps begin at 1.5 s
    system, exact = pt.nonlinear_system(car(), dt=0.001), pt.launch(car(), timepts=t)
    response = launched(system, t)
    for name in exact.outputs:
        if name.endswith("_speed"):
            np.testing.assert_allclose(response.outputs[system.find_output(name)], exact[name], atol=1e-8)
    mode = response.outputs[system.find_output("clutch_mode")]
    assert np.count_nonzero(mode != exact["clutch_mode"]) <= 1  # a corner at a sample shows in the next one


def test_discrete_system_with_held_inputs_is_exact_too():
    dt = 0.01
    t = np.arange(0, 301) * dt
    system = pt.nonlinear_system(car(), dt=dt, hold="zero")
    response = launched(system, t)

    def held(ramp):
        return sum((pt.step(x, float(ramp(x) - ramp(x - dt))) for x in t[1:]), pt.step(0.0, 0.0))

    inputs = {"engine_torque": held(TORQUE), "clutch_capacity": held(CAPACITY)}
    exact = pt.simulate(car(), t, inputs, {"engine": pt.rpm(5000)})
    for node in ("engine", "clutch_secondary", "vehicle"):
        name = f"{node}_speed"
        np.testing.assert_allclose(response.outputs[system.find_output(name)], exact[name], atol=1e-8)


def test_continuous_system_with_the_recommended_settings_follows_the_exact_core():
    t = np.linspace(0.0, 3.5, 3501)
    system, exact = pt.nonlinear_system(car()), pt.launch(car(), timepts=t)
    response = launched(system, t, **pt.solver_settings(TORQUE, CAPACITY))
    vehicle = response.outputs[system.find_output("vehicle_speed")] / 0.35  # as wheel speed
    np.testing.assert_allclose(vehicle, exact["vehicle_speed"] / 0.35, atol=1e-4)
    stuck = t > exact.events[-1].time + 0.1
    assert np.abs(response.outputs[system.find_output("clutch_slip_speed")][stuck]).max() < 1e-9
    assert (response.outputs[system.find_output("clutch_mode")][stuck] == 0).all()


def transfer(G, s):
    return G.C @ np.linalg.solve(s * np.eye(G.nstates) - G.A, G.B) + G.D


@pytest.mark.parametrize("state", ["stuck", "slipping"])
def test_linearisation_is_the_state_space_of_that_clutch_state(state):
    system = pt.nonlinear_system(car())
    speed = {} if state == "stuck" else {"engine": 300.0}
    x = pt.initial_state(system, car(), speed)
    u = sampled(system, np.zeros(1), clutch_capacity=100.0)[:, 0]
    lin = control.linearize(system, x, u, copy_names=True)
    known = pt.state_space(car().lock() if state == "stuck" else car().release())
    names = ["engine_speed", "vehicle_speed", "drive_shafts_torque"]
    rows, known_rows = ([G.output_labels.index(n) for n in names] for G in (lin, known))
    columns = [lin.input_labels.index(n) for n in known.input_labels]
    for f in (0.5, 2.64, 7.25, 22.0):
        s = 2j * np.pi * f
        expected = transfer(known, s)[known_rows]
        # Torques on the slip itself see the 0.1 ms of the stuck torque; all others see a rigid clutch.
        np.testing.assert_allclose(
            transfer(lin, s)[np.ix_(rows, columns)], expected, atol=2e-3 * np.abs(expected).max()
        )
    poles, expected = lin.poles(), pt.poles(car().lock() if state == "stuck" else car().release())
    if state == "stuck":
        assert np.abs(poles + 1e4).min() < 1.0  # slip dies out with the stick time
    for pole in expected[np.abs(expected) < 300.0]:
        assert np.abs(poles - pole).min() < 1e-4 * max(abs(pole), 1.0)
    if state == "slipping":
        # the capacity is the torque that drives the input shaft and loads the engine
        j = lin.input_labels.index("clutch_capacity")
        a, b = (lin.input_labels.index(f"clutch_{side}_torque") for side in ("secondary", "primary"))
        np.testing.assert_allclose(lin.B[:, j], lin.B[:, a] - lin.B[:, b], atol=1e-4 * np.abs(lin.B).max())


def two_clutches():
    return pt.Driveline(
        *(pt.Inertia(name, J=J) for name, J in (("a", 1.0), ("b", 0.5), ("c", 2.0))),
        pt.Clutch("ab", "a", "b", max_torque=4.0),
        pt.Clutch("bc", "b", "c", max_torque=3.0),
    )


def test_two_clutches_that_stick_together_share_the_torque_rightly():
    t = np.linspace(0.0, 6.0, 601)
    torque = pt.ramp(3.0, 2.0, 3.0)
    exact = pt.simulate(two_clutches(), t, {"a_torque": torque}, {"a": 10.0})
    system = pt.nonlinear_system(two_clutches())
    u = sampled(system, t, a_torque=torque, ab_capacity=4.0, bc_capacity=3.0)
    start = pt.initial_state(system, two_clutches(), {"a": 10.0})
    response = control.input_output_response(system, t, u, start, **pt.solver_settings(torque))
    # the run has both clutches stuck at the same time
    assert (exact["ab_mode"][300:] == 0).all()
    assert (exact["bc_mode"][300:] == 0).all()
    for name in ("a_speed", "b_speed", "c_speed"):
        np.testing.assert_allclose(response.outputs[system.find_output(name)], exact[name], atol=1e-3)
    for name in ("ab_torque", "bc_torque"):
        late = t > 3.1
        np.testing.assert_allclose(response.outputs[system.find_output(name)][late], exact[name][late], atol=1e-3)


def test_a_speed_controller_can_be_wired_to_it():
    dt = 0.005
    plant = pt.nonlinear_system(car(), dt=dt, hold="zero")
    gain = linear_system([], [], [], [[-0.8]], dt=dt, inputs=["engine_speed"], outputs=["engine_torque"], name="idle")
    loop = control.interconnect(
        [plant, gain],
        inplist=["driveline.clutch_capacity"],
        inputs=["clutch_capacity"],
        outlist=["driveline.engine_speed", "driveline.clutch_mode"],
        outputs=["engine_speed", "clutch_mode"],
        check_unused=False,
    )
    start = pt.initial_state(plant, car(), {"engine": 100.0})
    t = np.arange(0, 201) * dt
    y = control.input_output_response(loop, t, np.zeros(201), start).outputs
    # free engine side: J w' = -0.8 w, held over each sample; its mean speed decays by 1 - 0.8 dt / J
    assert y[0, -1] == pytest.approx(100.0 * (1 - 0.8 * dt / 0.44) ** 200, rel=0.02)
    assert (y[1] == 2).all()


def switched():
    closed = pt.two_mass(pt.examples.conventional(), method="source")
    slipping = pt.two_mass(car().release("clutch"), method="source")
    return pt.SwitchedTwoMass(closed=closed, slipping=slipping)


def test_switched_control_model_is_2_21_while_slipping_and_2_13_after():
    model = switched()
    t = np.linspace(0.0, 3.5, 3501)
    response = pt.launch(model, timepts=t)
    assert [e.kind for e in response.events] == ["slip", "lock"]
    lock = response.events[1].time
    before, after = t < lock, t > lock
    # while slipping: the input shaft model alone, driven by the capacity
    alone = pt.simulate(model.slipping, t, {"clutch_secondary_torque": CAPACITY})
    for name in ("clutch_secondary_speed", "wheels_speed", "vehicle_acceleration"):
        np.testing.assert_allclose(response[name][before], alone[name][before], atol=1e-9)
    # after lock: the closed model from the state at lock
    head = pt.simulate(
        model,
        np.array([0.0, lock - 1e-9]),
        {"engine_torque": TORQUE, "clutch_capacity": CAPACITY},
        {"engine": pt.rpm(5000)},
    )
    closed = pt.state_space(model.closed, "engine_torque", ["engine_speed", "wheels_speed", "vehicle_acceleration"])
    engine, wheels, R = head.final.speed["engine"], head.final.speed["wheels"], model.closed.ratio
    J1, J2 = model.closed.J1, model.closed.J2
    start = {
        "drive_shafts_twist": head.final.twist["drive_shafts"],
        "drive_shafts_twist_rate": engine / R - wheels,
        "engine_free_speed": (J1 * engine + J2 * wheels / R) / (J1 + J2 / R**2),
    }
    tail = np.linspace(lock, 3.5, 851)
    expected = control.forced_response(closed, tail, np.full(851, 350.0), [start[s] for s in closed.state_labels])
    for i, name in enumerate(("engine_speed", "wheels_speed", "vehicle_acceleration")):
        np.testing.assert_allclose(
            np.interp(tail[5:], t[after], response[name][after]), expected.outputs[i, 5:], rtol=2e-5, atol=2e-4
        )
    for name in ("engine_speed", "wheels_speed"):
        assert np.abs(np.diff(response[name])).max() < 2.5  # no jump at lock


@pytest.mark.parametrize(("stuck", "slipping"), [(80.0, 20.0), (20.0, 80.0), (50.8, 49.9)])
def test_a_control_model_that_switches_lets_go_once_where_slipping_it_could_not_hold(stuck, slipping):
    model = switched()
    model = pt.SwitchedTwoMass(
        closed=dataclasses.replace(model.closed, damping=stuck),
        slipping=dataclasses.replace(model.slipping, damping=slipping),
    )
    inputs = {"engine_torque": 200.0, "clutch_capacity": pt.ramp(0.0, 0.2, 370.0)}
    first = pt.simulate(model, [0.0, 0.2], inputs, {"engine": 5.0})
    assert [event.kind for event in first.events] == ["lock", "slip", "lock"]
    t = [0.0, first.events[1].time, 0.2]
    response, part = pt.simulate(model, t, inputs, {"engine": 5.0}), model.slipping
    twist, engine, wheels = (response[f"{name}"][1] for name in ("drive_shafts_twist", "engine_speed", "wheels_speed"))
    behind = (part.stiffness * twist + slipping * (engine / part.ratio - wheels)) / part.ratio
    # engine and input shaft turn together under what each takes of engine torque less shaft torque
    share = part.J1 / model.closed.J1
    assert 200.0 * share + behind * (1.0 - share) == pytest.approx(response["clutch_capacity"][1], rel=1e-9)


def test_switched_control_model_is_one_discrete_system():
    model, dt = switched(), 0.001
    t = np.arange(0, 3001) * dt
    system = pt.nonlinear_system(model, dt=dt)
    u = sampled(system, t, engine_torque=TORQUE, clutch_capacity=CAPACITY)
    response = control.input_output_response(system, t, u, pt.initial_state(system, model, {"engine": pt.rpm(5000)}))
    exact = pt.launch(model, timepts=t)
    for name in ("engine_speed", "clutch_secondary_speed", "wheels_speed"):
        np.testing.assert_allclose(response.outputs[system.find_output(name)], exact[name], atol=1e-8)
    with pytest.raises(pt.PowertrainError, match="needs memory of its clutch; give dt"):
        pt.nonlinear_system(model)


def test_models_that_do_not_belong_together_are_refused():
    model = switched()
    other = pt.two_mass(pt.examples.conventional(gear_ratio=3.0, damping="open").release("clutch"), method="source")
    with pytest.raises(pt.PowertrainError, match=r"ratio is 18.* when closed and 9.* when slipping"):
        pt.SwitchedTwoMass(closed=model.closed, slipping=other)
    with pytest.raises(pt.PowertrainError, match='both models are driven at "engine"'):
        pt.SwitchedTwoMass(closed=model.closed, slipping=model.closed)


# --- bad input

T = np.linspace(0.0, 1.0, 11)
NAN = np.where(np.arange(11) == 4, np.nan, 1.0)
BAD = [
    ({"inputs": {"clutch_capacity": -1.0}}, 'input "clutch_capacity" is -1 N m at t = 0 s, permitted: >= 0'),
    (
        {"inputs": {"clutch_capacity": pt.ramp(0.25, 0.5, -2.0, 2.0)}},
        'input "clutch_capacity" is -2 N m at t = 0.75 s',
    ),
    ({"inputs": {"engine_torque": NAN}}, 'input "engine_torque" is nan at t = 0.4 s, permitted: finite'),
    (
        {"inputs": {"engine_torque": lambda t: 1.0 / (t < 0.7) if t < 0.7 else float("inf")}},
        'input "engine_torque" is inf at t = 0.7 s',
    ),
    ({"inputs": {"engine_torque": np.ones(5)}}, 'input "engine_torque" has shape (5,), permitted: (11,)'),
    (
        {"inputs": {"engin_torque": 1.0}},
        'signal "engin_torque" is not an input of this driveline; did you mean "engine_torque"?',
    ),
    ({"timepts": [0.0, 0.5, 0.5, 1.0]}, "timepts go from 0.5 s to 0.5 s, permitted: increasing"),
    ({"timepts": [0.0]}, "timepts of shape (1,), permitted"),
    ({"timepts": [0.0, np.inf]}, "timepts of shape (2,), permitted: one-dimensional, finite"),
    ({"initial_speed": {"motor": 1.0}}, 'node "motor" is not in this driveline'),
    ({"initial_speed": {"engine": np.nan}}, "initial speed: engine = nan, permitted: finite"),
    (
        {"initial_speed": {"transmission": 6.0, "gearbox_output": 2.0}},
        "contradicts what gears allow together with",
    ),
]


@pytest.mark.parametrize(("options", "message"), BAD)
def test_bad_input_names_signal_and_time(options, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)):
        pt.simulate(car(), **{"timepts": T, **options})


def test_speeds_and_state_exclude_each_other():
    final = pt.simulate(car(), T).final
    with pytest.raises(pt.PowertrainError, match="both given"):
        pt.simulate(car(), T + 1.0, initial_speed={"engine": 1.0}, initial_state=final)
    with pytest.raises(pt.PowertrainError, match="of another driveline"):
        pt.simulate(pt.examples.front_wheel_drive(), T + 1.0, initial_state=final)


def test_systems_refuse_what_is_not_finite_or_negative():
    system = pt.nonlinear_system(car(), dt=0.01)
    u = sampled(system, np.zeros(2), clutch_capacity=np.array([1.0, -1.0]))
    with pytest.raises(pt.PowertrainError, match=r'"clutch_capacity" is -1 N m at t = 0\.01 s'):
        control.input_output_response(system, np.array([0.0, 0.01]), u, pt.initial_state(system, car()))
    for options in ({"dt": 0.0}, {"dt": 0.01, "hold": "cubic"}):
        with pytest.raises(pt.PowertrainError, match="permitted"):
            pt.nonlinear_system(car(), **options)


def test_too_many_events_stop_with_time_and_log(monkeypatch):
    from powertrain_ctrl.hybrid import run

    monkeypatch.setattr(run, "MOST_EVENTS", 3)
    monkeypatch.setattr(run, "WITHIN", 1.0)
    fast = {"engine_torque": pt.ramp(1.5, 0.1, 350.0), "clutch_capacity": pt.ramp(1.5, 0.1, 370.0)}
    soft = pt.examples.conventional(damping=None)
    with pytest.raises(
        pt.PowertrainError, match=r"clutch is .* by turns, more than 3 times within .* before t = .*last events: clutch"
    ):
        pt.simulate(soft, np.linspace(0.0, 3.0, 11), fast, {"engine": pt.rpm(5000)})


def test_signals_of_a_response_by_name_and_as_control_data():
    response = pt.launch(car(), timepts=np.linspace(0.0, 3.0, 301))
    data = response.to_control()
    np.testing.assert_array_equal(data.outputs["engine_speed"], response["engine_speed"])
    np.testing.assert_array_equal(data.inputs["clutch_capacity"], response["clutch_capacity"])
    few = response.to_control(["vehicle_speed", "clutch_torque"])
    np.testing.assert_array_equal(few.outputs, [response["vehicle_speed"], response["clutch_torque"]])
    with pytest.raises(pt.PowertrainError, match='"engine_sped" is not in this response; did you mean "engine_speed"'):
        response["engine_sped"]
    assert "lock" in repr(response)
    assert "<table>" in response._repr_html_()
    import matplotlib.pyplot as plt

    small = pt.simulate(pt.Driveline(pt.Inertia("a", J=1.0)), T, {"a_torque": 1.0}).to_control()
    assert small.plot() is not None
    plt.close("all")


def test_load_change_is_that_of_forced_response():
    for model in (pt.examples.conventional(), pt.two_mass(pt.examples.conventional(), method="source")):
        response = pt.load_change(model)
        names = ["engine_speed", "wheels_speed", "vehicle_acceleration", "drive_shafts_torque"]
        G = pt.state_space(model, "engine_torque", names)
        m = pt.assemble(model)
        motion = m.rigid_motion / m.rigid_motion[m.nodes.index("engine")] * pt.rpm(2000)
        start = [motion[m.nodes.index("engine")] if s == "engine_free_speed" else 0.0 for s in G.state_labels]
        expected = control.forced_response(G, response.time, response["engine_torque"], start).outputs
        for name, y in zip(names, expected, strict=True):
            np.testing.assert_allclose(response[name], y, rtol=0, atol=1e-8 * max(1.0, np.abs(y).max()))


def test_load_change_carries_the_torque_of_a_locked_clutch_and_leaves_an_open_one_alone():
    locked = pt.load_change(pt.examples.conventional())
    total = 0.3 + 0.05 + 0.1 + 0.03 + 0.05 / 36 + (4 + 2000 * 0.35**2) / 324
    assert locked["clutch_torque"][-1] == pytest.approx(250.0 * (1 - 0.44 / total), rel=0.1)
    assert not locked.events
    released = pt.load_change(pt.examples.conventional().release("clutch"))
    assert np.abs(released["vehicle_speed"]).max() < 1e-12


def test_input_values_are_those_of_the_signals_in_the_order_of_the_system():
    system, times = pt.nonlinear_system(car(), dt=0.5), np.arange(5) * 0.5
    values = pt.input_values(
        system, car(), times, {"engine_torque": pt.step(1.0, 80.0), "vehicle_force": np.sin, "clutch_capacity": times}
    )
    expected = {
        "engine_torque": [0.0, 0.0, 80.0, 80.0, 80.0],
        "vehicle_force": np.sin(times),
        "clutch_capacity": times,
    }
    for name, row in zip(system.input_labels, values, strict=True):
        np.testing.assert_array_equal(row, expected.get(name, np.zeros(5)))
    untouched = pt.input_values(system, car(), times)
    assert (untouched[system.find_input("clutch_capacity")] == car()["clutch"].max_torque).all()


def test_input_values_refuse_what_is_no_signal():
    system, times = pt.nonlinear_system(car(), dt=0.5), np.arange(3) * 0.5
    with pytest.raises(pt.UnknownNameError, match=r'"engin_torque".*did you mean "engine_torque"'):
        pt.input_values(system, car(), times, {"engin_torque": 1.0})
    with pytest.raises(pt.SignalError, match=r'"engine_torque" is nan at t = 0\.5 s'):
        pt.input_values(system, car(), times, {"engine_torque": [0.0, np.nan, 0.0]})
    with pytest.raises(pt.SignalError, match=r"shape \(2,\)"):
        pt.input_values(system, car(), times, {"engine_torque": [0.0, 1.0]})
    with pytest.raises(pt.PowertrainError, match="not that of this driveline"):
        pt.input_values(system, pt.examples.front_wheel_drive(), times)


@pytest.mark.parametrize("capacity", [0.0, 120.0, 370.0])
def test_accelerations_of_the_continuous_system_are_the_rates_of_its_speeds_and_obey_newton(capacity):
    car = pt.examples.conventional(damping="open")
    system = pt.nonlinear_system(car)
    random = np.random.default_rng(5)
    x = random.normal(size=system.nstates)
    u = random.normal(size=system.ninputs) * 100.0
    u[system.find_input("clutch_capacity")] = capacity
    y, rate = system.output(0.0, x, u), system.dynamics(0.0, x, u)
    ahead = system.output(0.0, x + rate, u)  # speeds are linear in the state
    labels = system.output_labels
    speeds = [name for name in labels if name.endswith("_speed") and not name.endswith("slip_speed")]
    for name in speeds:
        i = labels.index(name)
        j = labels.index(name.replace("_speed", "_acceleration"))
        assert y[j] == pytest.approx(ahead[i] - y[i], rel=1e-9, abs=1e-9 * np.abs(rate).max()), name
    is_, given = dict(zip(labels, y, strict=True)), dict(zip(system.input_labels, u, strict=True))
    for node, J, torque in (
        ("engine", 0.3, given["engine_torque"] - is_["damper_spring_torque"]),
        ("clutch_primary", 0.09, given["clutch_primary_torque"] + is_["clutch_shaft_torque"] - is_["clutch_torque"]),
        ("clutch_secondary", 0.01, given["clutch_secondary_torque"] + is_["clutch_torque"] - is_["input_shaft_torque"]),
    ):
        assert J * is_[f"{node}_acceleration"] == pytest.approx(torque, rel=1e-9, abs=1e-9), node
    assert abs(is_["clutch_torque"]) <= capacity


@pytest.mark.parametrize(
    ("name", "values"),
    [("engine", {"J": 1.2}), ("drive_shafts", {"stiffness": 4 * 3.44e4}), ("gearbox", {"ratio": 3.6})],
)
def test_the_state_of_a_driveline_with_other_values_is_not_taken(name, values):
    final = pt.simulate(pt.examples.conventional(), [0.0, 0.5], {"engine_torque": 100.0}).final
    with pytest.raises(pt.PowertrainError, match="with other values"):
        pt.simulate(pt.examples.conventional().replace(name, **values), [0.5, 1.0], initial_state=final)


def test_corners_a_rounding_apart_do_not_stop_the_solver():
    pulse = pt.ramp(0.2, 0.1, 50.0) + pt.ramp(0.3, 0.1, -50.0)
    assert 0.0 < np.diff(pulse.times).min() < 1e-15
    assert pt.solver_settings(pulse)["solve_ivp_kwargs"]["max_step"] == 0.05
    with pytest.raises(pt.SignalError, match=r"got 370.0, permitted: a ramp"):
        pt.solver_settings(370.0)


def test_linear_models_of_a_model_that_switches_have_the_clutch_open():
    model = switched()
    assert model.driveline.released == {"clutch"}
    wanted, found = pt.modes(model.slipping), pt.modes(model)
    assert found.n_rigid == 2
    np.testing.assert_allclose(found.frequency_hz[2], wanted.frequency_hz[1], rtol=1e-9)
    np.testing.assert_allclose(found.damping_ratio[2], wanted.damping_ratio[1], rtol=1e-9)


def test_a_capacity_that_is_negative_between_the_samples_is_named():
    pair = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=2.0))
    with pytest.raises(pt.SignalError, match=r"clutch_capacity\" is -0.05 N m at t = 0.25 s, permitted: >= 0"):
        pt.simulate(pair, [0.0, 0.5, 1.0], {"clutch_capacity": lambda t: 10.0 * (t - 0.25) ** 2 - 0.05})


@pytest.mark.parametrize("hold", ["zero", "linear"])
def test_speeds_of_a_sample_do_not_depend_on_its_inputs_to_the_last_bit(hold):
    pair = pt.Driveline(pt.Inertia("a", J=1.0), pt.Clutch("k", "a", "b", max_torque=50.0), pt.Inertia("b", J=3.0))
    system = pt.nonlinear_system(pair, dt=1e-3, hold=hold)
    # two speeds a rounding apart, which a clutch that sticks would bring together
    x = np.zeros(system.nstates)
    x[:2] = 10 / 3, 10 / 3 + 2e-15
    seen = [system.find_output(name) for name in ("a_speed", "b_speed", "k_slip_speed")]
    outputs = []
    for torque in (0.0, -1000.0, 40.0):
        u = np.zeros(3)
        u[system.find_input("k_capacity")], u[system.find_input("b_torque")] = 50.0, torque
        outputs.append(system.output(0.0, x, u)[seen])
    np.testing.assert_array_equal(outputs[1], outputs[0])
    np.testing.assert_array_equal(outputs[2], outputs[0])
    np.testing.assert_allclose(outputs[0][:2], x[:2], rtol=1e-15)


def test_an_engine_started_through_its_clutch_runs_in_a_closed_loop():
    hybrid = pt.Driveline(
        pt.Inertia("engine", J=0.18),
        pt.Clutch("drag", "engine", max_torque=25.0),
        pt.Clutch("separator", "engine", "motor", max_torque=0.0),
        pt.Inertia("motor", J=0.08),
        pt.Gear("gear", "motor", "axle", ratio=10.0),
        pt.SpringDamper("half", "axle", "wheels", stiffness=9e3, damping=40.0),
        pt.Inertia("wheels", J=2.0),
        pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=6e5, damping=3e3),
        pt.Mass("vehicle", m=1500.0),
    )
    dt, count = 0.005, 401
    system = pt.nonlinear_system(hybrid, dt=dt, hold="zero")
    speed_control = control.nlsys(
        lambda t, x, u, p: [x[0] + dt * (150 - u[0])],
        lambda t, x, u, p: [3 * (150 - u[0]) + 20 * x[0]],
        inputs=["motor_speed"],
        outputs=["motor_torque"],
        states=["i"],
        dt=dt,
        name="speed_control",
    )
    seen = ["motor_speed", "engine_speed"]
    inputs = ["separator_capacity", "drag_capacity"]
    with pytest.warns(UserWarning, match="Unused"):
        loop = control.interconnect([system, speed_control], inputs=inputs, outputs=seen)
    t = dt * np.arange(count)
    capacity = np.round(np.interp(t, [0.3, 0.5, 0.9, 1.0], [0, 80, 80, 250.0]), 6)
    start = np.append(pt.initial_state(system, hybrid, {"motor": 150.0, "engine": 0.0}), 0.0)
    response = control.input_output_response(loop, t, np.array([capacity, np.full(count, 25.0)]), start)
    # the same loop stepped by hand
    k = {name: system.find_input(name) for name in system.input_labels}
    x, integral, expected = start[:-1], 0.0, []
    for value in capacity:
        u = np.zeros(system.ninputs)
        u[k["separator_capacity"]], u[k["drag_capacity"]] = value, 25.0
        y = system.output(0.0, x, u)
        expected.append([y[system.find_output(name)] for name in seen])
        u[k["motor_torque"]] = 3 * (150 - expected[-1][0]) + 20 * integral
        integral += dt * (150 - expected[-1][0])
        x = system.dynamics(0.0, x, u)
    np.testing.assert_allclose(response.outputs, np.transpose(expected), atol=1e-9)
    assert response.outputs[1, -1] == pytest.approx(
        response.outputs[0, -1], abs=1e-6
    )  # the engine turns with the motor


def sliding_pair():
    """A body of 1 kg m^2 that a clutch of 20 N m brakes against a slower one."""
    return pt.Driveline(pt.Inertia("a", J=1.0), pt.Clutch("k", "a", "b", max_torque=20.0), pt.Inertia("b", J=3.0))


def run_loop(loop, t, speed):
    """Run a loop around the sliding pair whose inputs are all 20 N m, one body at this speed."""
    start = np.eye(1, loop.nstates)[0] * speed
    return control.input_output_response(loop, t, np.full((loop.ninputs, len(t)), 20.0), start)


def static(gain, reads, drives, dt=None, name="controller"):
    return linear_system([], [], [], [[gain]], *([] if dt is None else [dt]), inputs=reads, outputs=drives, name=name)


def wired(system, *controllers, inputs=("k_capacity",), outputs=("a_speed",)):
    return control.interconnect([system, *controllers], inputs=list(inputs), outputs=list(outputs), check_unused=False)


def test_a_capacity_that_is_negative_only_until_the_speeds_are_found_is_taken():
    dt, t = 1e-3, 1e-3 * np.arange(6)
    system = pt.nonlinear_system(sliding_pair(), dt=dt, hold="zero")
    law = control.nlsys(
        None, lambda t, x, u, p: [2.0 * (u[0] - 90.0)], inputs="a_speed", outputs="k_capacity", dt=dt, name="law"
    )
    loop = wired(system, law, inputs=("a_torque",), outputs=("a_speed", "k_torque"))
    start = pt.initial_state(system, sliding_pair(), {"a": 100.0})
    speed, torque = control.input_output_response(loop, t, np.zeros(6), start).outputs
    # 1 kg m^2 braked by 2 (w - 90), held from sample to sample
    np.testing.assert_allclose(speed, 90.0 + 10.0 * (1.0 - 2.0 * dt) ** np.arange(6), rtol=1e-12)
    np.testing.assert_allclose(torque, 20.0 * (1.0 - 2.0 * dt) ** np.arange(6), rtol=1e-12)
    start = pt.initial_state(system, sliding_pair(), {"a": 80.0})
    with pytest.raises(pt.PowertrainError, match=r'"k_capacity" is -20 N m at t = 0 s, permitted: >= 0'):
        control.input_output_response(loop, t, np.zeros(6), start)


def test_a_controller_that_acts_on_a_speed_may_remember_a_torque():
    dt, t = 1e-3, 1e-3 * np.arange(50)
    system = pt.nonlinear_system(sliding_pair(), dt=dt, hold="zero")
    # torque -2 w + 0.5 x, and x is the clutch torque of the sample before
    reads = ["a_speed", "k_torque"]
    unit = control.ss([[0.0]], [[0.0, 1.0]], [[0.5]], [[-2.0, 0.0]], dt, inputs=reads, outputs="a_torque", name="unit")
    start = np.append(pt.initial_state(system, sliding_pair(), {"a": 5.0, "b": 5.0}), 0.0)
    speed = control.input_output_response(wired(system, unit), t, np.full(50, 20.0), start).outputs
    # stuck: 4 kg m^2 together, of which the clutch drives 3
    expected, x = [5.0], 0.0
    for _ in t[1:]:
        torque = 0.5 * x - 2.0 * expected[-1]
        expected.append(expected[-1] + dt * torque / 4.0)
        x = 0.75 * torque
    np.testing.assert_allclose(speed, expected, rtol=1e-12)


def test_feedback_of_python_control_closes_a_loop_around_all_outputs():
    t = 1e-3 * np.arange(101)
    for dt in (1e-3, None):
        system = pt.nonlinear_system(sliding_pair(), dt, hold="zero") if dt else pt.nonlinear_system(sliding_pair())
        gain = np.zeros((system.ninputs, system.noutputs))
        gain[system.find_input("a_torque"), system.find_output("a_speed")] = 5.0
        controller = linear_system([], [], [], gain, *([dt] if dt else []))
        loop = control.feedback(system, controller)
        start = pt.initial_state(system, sliding_pair(), {"a": 100.0})
        u = sampled(system, t, k_capacity=20.0)
        settings = {} if dt else pt.solver_settings()
        speed = control.input_output_response(loop, t, u, start, **settings).outputs[system.find_output("a_speed")]
        # w' = -5 w - 20; w + 4 dies out
        shrunk = (1.0 - 5.0 * dt) ** np.arange(101) if dt else np.exp(-5.0 * t)
        np.testing.assert_allclose(speed, 104.0 * shrunk - 4.0, rtol=1e-9 if dt else 1e-5)


def test_an_algebraic_loop_says_what_to_do():
    dt, t = 1e-3, 1e-3 * np.arange(20)
    speed_fed_back = static(-5.0, ["a_speed"], ["a_torque"], dt)
    linear, zero = (pt.nonlinear_system(sliding_pair(), dt=dt, hold=hold) for hold in ("linear", "zero"))
    with pytest.raises(pt.PowertrainError, match=r'algebraic loop detected at t = 0\.001 s: .*take .*hold="zero"'):
        run_loop(wired(linear, speed_fed_back), t, 100.0)
    run_loop(wired(zero, speed_fed_back), t, 100.0)
    # with one more system around it, and in a copy
    inner = wired(pt.nonlinear_system(sliding_pair(), dt=dt), outputs=("a_speed",), inputs=("a_torque", "k_capacity"))
    with pytest.raises(pt.PowertrainError, match='hold="zero"'):
        run_loop(wired(inner, speed_fed_back), t, 100.0)
    with pytest.raises(pt.PowertrainError, match='hold="zero"'):
        run_loop(copy.deepcopy(wired(linear, speed_fed_back)), t, 100.0)
    # of a clutch that sticks, the torque follows from the inputs
    for system, unit in ((zero, dt), (pt.nonlinear_system(sliding_pair()), None)):
        loop = wired(system, static(-5.0, ["k_torque"], ["a_torque"], unit), inputs=("k_capacity", "b_torque"))
        with pytest.raises(pt.PowertrainError, match=r"clutch torques .* feed them back through a lag or a delay"):
            run_loop(loop, t, 0.0)


def test_other_errors_in_loops_and_loops_of_others_stay_as_they_are():
    dt, t = 1e-3, 1e-3 * np.arange(3)

    def broken(t, x, u, params):
        raise RuntimeError("no fuel")

    unit = control.nlsys(None, broken, inputs="a_speed", outputs="a_torque", dt=dt, name="unit")
    with pytest.raises(RuntimeError, match=r"^no fuel$"):
        run_loop(wired(pt.nonlinear_system(sliding_pair(), dt=dt, hold="zero"), unit), t, 100.0)
    loop = control.InterconnectedSystem(
        [control.nlsys(None, lambda t, x, u, p: 2.0 * u, inputs=1, outputs=1, dt=dt, name=n) for n in ("one", "two")],
        connections=[["one.u[0]", "two.y[0]"], ["two.u[0]", "one.y[0]"]],
        inplist=["one.u[0]"],
        outlist=["two.y[0]"],
    )
    with pytest.raises(RuntimeError, match=r"^algebraic loop detected$"):
        control.input_output_response(loop, t, np.ones(3))
