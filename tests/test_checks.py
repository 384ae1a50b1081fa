"""What is handed over in the wrong place, or is no number, is named.

Of base/errors.
"""

import control
import numpy as np
import pytest

import powertrain_ctrl as pt

CAR = pt.examples.conventional()
PLANT = pt.SampledPlant(car=CAR)
MODEL = pt.two_mass(CAR)
P = pt.antijerk.one_dof(PLANT, pt.antijerk.speed_difference(PLANT, gain=6.0))
TIP_IN = pt.tip_in(PLANT)

A_CAR_FOR_A_PLANT = {
    "loop_margins": lambda: pt.loop_margins(CAR, P),
    "closed_loop": lambda: pt.closed_loop(CAR, P, pt.step(0.0, 1.0)),
    "controlled_launch": lambda: pt.controlled_launch(CAR, P),
    "robustness": lambda: pt.robustness(CAR, P),
    "robustness, plants": lambda: pt.robustness(PLANT, P, {"mine": CAR}),
    "variations": lambda: pt.studies.variations(CAR),
    "tip_in": lambda: pt.tip_in(CAR),
    "wheel_disturbance": lambda: pt.wheel_disturbance(CAR),
    "designs": lambda: pt.antijerk.designs(CAR),
    "one_dof": lambda: pt.antijerk.one_dof(CAR, P),
    "speed_difference": lambda: pt.antijerk.speed_difference(CAR),
    "lqg": lambda: pt.antijerk.lqg(CAR, MODEL),
}
A_CAR_FOR_A_MODEL = {
    "lqg": lambda: pt.antijerk.lqg(PLANT, CAR),
    "hinf": lambda: pt.antijerk.hinf(PLANT, CAR),
    "inverse_notch": lambda: pt.antijerk.inverse_notch(PLANT, CAR),
    "zv_shaper": lambda: pt.antijerk.zv_shaper(PLANT, CAR),
    "zvd_shaper": lambda: pt.antijerk.zvd_shaper(PLANT, CAR),
    "two_dof": lambda: pt.antijerk.two_dof(PLANT, CAR, pt.antijerk.speed_difference(PLANT)),
}
NOT_BY_NAME = [
    (lambda: pt.compare_models(CAR, MODEL), "models is of type TwoMass, permitted: a mapping"),
    (lambda: pt.simulate(CAR, [0.0, 1.0], np.ones((2, 2))), "inputs is of type ndarray, permitted: a mapping"),
    (lambda: pt.simulate(CAR, [0.0, 1.0], {}, 5.0), "initial_speed is of type float, permitted: a mapping"),
    (lambda: pt.robustness(PLANT, P, [PLANT]), "plants is of type list, permitted: a mapping"),
    (lambda: pt.robustness(PLANT, P, {}), "plants is empty"),
    (lambda: pt.plots.bode(pt.state_space(CAR)), '"response" has several inputs or outputs, permitted: one of each'),
    (lambda: pt.plots.robust_responses(TIP_IN), "responses is of type Response, permitted: a mapping"),
    (lambda: pt.plots.launch_compared(TIP_IN), "responses is of type Response, permitted: a mapping"),
    (lambda: pt.plots.pole_map({}), "margins is empty"),
]
NOT_A_NUMBER = [
    (lambda: pt.ramp("1", 0.2, 3.0), "ramp: start = '1' s, permitted: a number, finite"),
    (lambda: pt.ramp(1.0, 0.2, None), "ramp: final = None, permitted: a number, finite"),
    (lambda: pt.step("soon", 3.0), "step: time = 'soon' s, permitted: a number, finite"),
    (lambda: pt.launch(CAR, torque="350"), "launch: torque = '350' N m, permitted: a number, finite"),
    (lambda: pt.SampledPlant(car=CAR, lag="0.03"), "sampled plant: lag = '0.03' s, permitted: a number, >= 0"),
    (lambda: pt.SampledPlant(car=CAR, dt=True), "sampled plant: dt = True s, permitted: a number, > 0"),
    (lambda: pt.SampledPlant(car=CAR, torque_limits=("0", "350")), "torque_limits = ('0', '350') N m, permitted"),
    (lambda: pt.Sensors(engine_noise=[1.0]), "sensors: engine_noise = [1.0] rad/s, permitted: a number, >= 0"),
    (lambda: MODEL.replace(stiffness="stiff"), "two-mass model: stiffness = 'stiff' N m/rad, permitted: a number, > 0"),
    (lambda: MODEL.replace(rim_share=1.5), "two-mass model: rim_share = 1.5, permitted: 0 to 1"),
    (lambda: pt.nonlinear_system(CAR, dt="1 ms"), "nonlinear_system: dt = '1 ms' s, permitted: a number, > 0"),
    (lambda: pt.antijerk.speed_difference(PLANT, gain="6"), "gain = '6' N m s/rad, permitted: a number, > 0"),
    (
        lambda: pt.antijerk.lead_notch(PLANT, lead=(0.03, np.nan)),
        "lead = (0.03, nan) s, permitted: 2 values, each",
    ),
    (
        lambda: pt.antijerk.lead_notch(PLANT, notch_hz=20.0, notch_damping=(0.1, np.inf)),
        "notch_damping = (0.1, inf), perm",
    ),
    (
        lambda: pt.simulate(CAR, [0.0, 1.0], None, {"engine": "fast"}),
        "initial speed: engine = 'fast', permitted",
    ),
    (lambda: pt.simulate(CAR, [0.0, "end"]), "timepts is [0.0, 'end'], permitted: real numbers"),
    (
        lambda: pt.simulate(CAR, [0.0, 1.0], {"engine_torque": [1.0, 2.0j]}),
        'input "engine_torque" is [1.0, 2j], permitted: real numbers',
    ),
]
NOT_A_NAME = [
    (lambda: pt.state_space(CAR, inputs=[["engine_torque"]]), "signal \"['engine_torque']\" is not an input"),
    (lambda: CAR.part(["engine"]), "node \"['engine']\" is not in this driveline"),
    (lambda: pt.two_mass(CAR, ["modal"]), "method = ['modal'], permitted: a string"),
]


@pytest.mark.parametrize("call", A_CAR_FOR_A_PLANT.values(), ids=A_CAR_FOR_A_PLANT)
def test_a_car_is_no_sampled_plant(call):
    with pytest.raises(pt.PowertrainError, match=r"expected a SampledPlant, got a Driveline; pt.SampledPlant\(car="):
        call()


@pytest.mark.parametrize("call", A_CAR_FOR_A_MODEL.values(), ids=A_CAR_FOR_A_MODEL)
def test_a_car_is_no_two_mass_model(call):
    with pytest.raises(pt.PowertrainError, match=r"expected a TwoMass, got a Driveline; pt.two_mass\(car\)"):
        call()


@pytest.mark.parametrize(("call", "message"), NOT_BY_NAME + NOT_A_NUMBER + NOT_A_NAME)
def test_the_error_names_the_argument(call, message):
    with pytest.raises(pt.PowertrainError) as error:
        call()
    assert message in str(error.value)


def test_whole_numbers_and_those_of_numpy_are_numbers():
    ramp = pt.ramp(np.int64(1), np.float32(0.5), 3)
    assert float(ramp(1.25)) == 1.5
    assert pt.SampledPlant(car=CAR, lag=np.float64(0.03), delay=0).delay == 0.0
    G = pt.nonlinear_system(CAR, dt=1)
    assert isinstance(G, control.NonlinearIOSystem)
    assert G.dt == 1.0


BAD_CALLS = [
    (lambda: pt.Inertia("e", I=0.3), 'Inertia has no parameter "I"; did you mean "J"?'),
    (lambda: pt.Inertia("e", 0.3), "Inertia: 2 values by position, permitted: 1 (name); give by keyword: J=..."),
    (lambda: pt.Inertia("e"), "Inertia: not given: J=..."),
    (lambda: pt.SpringDamper("s", "a", "b", k=3.0), 'no parameter "k"; did you mean "stiffness"?'),
    (lambda: pt.SpringDamper("s", "a", "b", c=3.0), 'no parameter "c"; did you mean "stiffness" or "damping"?'),
    (lambda: pt.Gear("g", "a", "b", i=3.0), 'no parameter "i"; did you mean "ratio"?'),
    (lambda: pt.Mass("car", mass=3.0), 'no parameter "mass"; did you mean "m"?'),
    (lambda: pt.launch(CAR, torqe=3.0), 'launch has no parameter "torqe"; did you mean "torque"?'),
    (lambda: pt.launch(), "launch: not given: car=..."),
    (lambda: pt.modes(CAR, car=CAR), "modes: car is given twice, by position and by keyword"),
    (lambda: CAR.replace("drive_shafts", k=3.0), 'no parameter "k"; did you mean "stiffness"?'),
    (lambda: pt.tip_in(PLANT, sensor=None), 'closed_loop has no parameter "sensor"; did you mean "sensors"?'),
]


@pytest.mark.parametrize(("call", "message"), BAD_CALLS)
def test_a_call_that_does_not_fit_is_named(call, message):
    with pytest.raises(pt.PowertrainError) as error:
        call()
    assert message in str(error.value)


def test_a_call_that_does_not_fit_is_a_type_error_too():
    with pytest.raises(TypeError) as error:
        pt.modes(CAR, 3, 4)
    assert isinstance(error.value, pt.ArgumentError)


# Elements are named where a value is so far out that squares and ratios would leave the doubles.
ENDS = [
    (
        lambda: pt.SpringDamper("s", "a", "b", stiffness=1e308),
        "s: stiffness = 1e+308 N m/rad, permitted: >= 0",
    ),
    (lambda: pt.Inertia("a", J=5e-324), "a: J = 5e-324 kg m^2, permitted: > 0 and finite, at least 1e-15"),
    (
        lambda: pt.Drag("d", "a", damping=1e308),
        "d: damping = 1e+308 N m s/rad, permitted: >= 0 and finite, at most 1e+15",
    ),
    (lambda: pt.Gear("g", "a", "b", ratio=1e-200), "g: ratio = 1e-200, permitted: not 0, finite, at least 1e-15"),
    (lambda: pt.launch(CAR, torque=1e308), "launch: torque = 1e+308 N m, permitted: finite, at most 1e+15 in size"),
    (lambda: pt.simulate(CAR, [0.0, 1.0, 1e308]), "timepts go from 0 s to 1e+308 s"),
    (lambda: pt.simulate(CAR, [0.0, 1.0, 1e10]), "timepts go from 0 s to 1e+10 s, permitted: within 1e+09 s of 0"),
    (lambda: pt.simulate(CAR, [0.0, 1.0], {"engine_torque": 1e308}), 'input "engine_torque" is 1e+308 at t = 0 s'),
    (lambda: MODEL.response(np.array([0.0, 1.0])), "two-mass model: omega"),
]


@pytest.mark.parametrize(("call", "message"), ENDS)
def test_values_at_the_ends_of_the_doubles_are_refused(call, message):
    with pytest.raises(pt.PowertrainError) as error:
        call()
    assert message in str(error.value)


@pytest.mark.parametrize("J", [1e-15, 1e15])
@pytest.mark.parametrize("stiffness", [1e-15, 1e15])
def test_values_within_are_taken_and_give_numbers(J, stiffness):
    """Two bodies of the same J on a spring: omega = sqrt(2 k / J)."""
    shaft = pt.SpringDamper("shaft", "a", "b", stiffness=stiffness, damping=5e-324)
    pair = pt.Driveline(pt.Inertia("a", J=J), pt.Inertia("b", J=J), shaft)
    np.testing.assert_allclose(pt.modes(pair).omega, [0.0, np.sqrt(2.0 * stiffness / J)], rtol=1e-14)
    assert np.isfinite(pt.state_space(pair).A).all()


FUNCTIONS = [
    (lambda t: "x", "the torque demand is 'x' at t = 0 s, permitted: a number"),
    (lambda t: None, "the torque demand is None at t = 0 s, permitted: a number"),
    (lambda t: [1.0, 2.0], "the torque demand is [1.0, 2.0] at t = 0 s, permitted: a number"),
    (lambda t: 1j, "the torque demand is 1j at t = 0 s, permitted: a number"),
    (lambda t: 1.0 / t, "the torque demand fails at t = 0 s: ZeroDivisionError: float division by zero"),
]


@pytest.mark.parametrize(("function", "message"), FUNCTIONS)
def test_a_function_that_gives_no_number_is_named_with_the_time(function, message):
    with pytest.raises(pt.SignalError) as error:
        pt.closed_loop(PLANT, None, function)
    assert message in str(error.value)
    with pytest.raises(pt.SignalError, match='input "engine_torque"'):
        pt.simulate(CAR, [0.0, 1.0], {"engine_torque": function})


@pytest.mark.parametrize("factor", [1j, True, "2", None, np.ones(2)])
def test_a_ramp_is_multiplied_by_numbers_alone(factor):
    for product in (lambda: pt.ramp(0.0, 1.0, 2.0) * factor, lambda: factor * pt.ramp(0.0, 1.0, 2.0)):
        with pytest.raises(pt.PowertrainError, match="permitted: a number"):
            product()
    assert (np.float64(3.0) * pt.ramp(0.0, 1.0, 2.0)).values == (0.0, 6.0)


def test_a_name_that_cannot_be_a_key_is_not_in_a_driveline():
    assert [] not in CAR
    assert np.ones(2) not in TIP_IN


@pytest.mark.parametrize("mode", [99, -1, 7])
def test_a_mode_that_is_not_there_is_named(mode):
    with pytest.raises(pt.PowertrainError, match=f"mode = {mode}, permitted: 0 to 6"):
        pt.modes(CAR).dominant_compliance(mode)


def test_as_many_samples_as_no_memory_holds_are_refused():
    with pytest.raises(pt.PowertrainError, match=r"1e\+12 points, permitted: at most 1e\+07"):
        pt.closed_loop(PLANT, None, pt.step(0.0, 1.0), duration=1e9)
    with pytest.raises(pt.PowertrainError, match="the delay is 1e\\+07 samples, permitted: at most 5000"):
        pt.SampledPlant(car=CAR, delay=0.01, dt=1e-9).discrete()


@pytest.mark.parametrize(
    ("name", "meant"), [("Damper", "SpringDamper"), ("bode", "plots.bode"), ("simulat", "simulate")]
)
def test_a_name_that_is_guessed_is_answered(name, meant):
    with pytest.raises(AttributeError, match=rf"did you mean .*{meant}"):
        getattr(pt, name)


def test_speeds_are_converted_one_by_one_or_many():
    assert pt.rpm([60.0, 120.0]).tolist() == [2.0 * np.pi, 4.0 * np.pi]
    assert pt.kmh(36) == 10.0
