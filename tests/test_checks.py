"""What is handed over in the wrong place, or is no number, is named."""

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
    (lambda: pt.plots.bode(pt.state_space(CAR)), "responses is of type StateSpace, permitted: a mapping"),
    (lambda: pt.plots.load_change(pt.load_change(CAR)), "responses is of type Response, permitted: a mapping"),
    (lambda: pt.plots.tip_in(TIP_IN), "responses is of type Response, permitted: a mapping"),
    (lambda: pt.plots.robust_responses(TIP_IN), "responses is of type Response, permitted: a mapping"),
    (lambda: pt.plots.controlled_launch(TIP_IN), "responses is of type Response, permitted: a mapping"),
    (lambda: pt.plots.launch_compared(TIP_IN), "responses is of type Response, permitted: a mapping"),
    (lambda: pt.plots.nyquist(pt.loop_margins(PLANT, P)), "margins is of type LoopMargins, permitted: a mapping"),
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
