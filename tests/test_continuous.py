"""Laws without memory as a continuous system, against the exact core."""

import re

import control
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.elements import Guard, Law, Mode

T = np.linspace(0.0, 0.8, 161)
STAGES = {"twists": (-0.1, -0.02, 0.02, 0.1), "torques": (-50.0, -2.0, 2.0, 50.0)}


def rotor(*elements):
    return pt.Driveline(
        pt.Inertia("a", J=0.2), pt.Inertia("b", J=0.5), pt.SpringDamper("s", "b", "c", stiffness=900.0, damping=0.5),
        pt.Inertia("c", J=1.5), *elements,
    )  # fmt: skip


def with_body(*elements):
    body = (pt.Tyre("rigid", "c", "car", radius=0.3, stiffness=None), pt.Mass("car", m=120.0))
    return rotor(pt.SpringDamper("first", "a", "b", stiffness=700.0, damping=0.4), *body, *elements)


CARS = {
    "clipped play": rotor(
        pt.Backlash("x", "a", "b", gap=0.04, stiffness=2e3, damping=2.0, contact="clipped"),
    ),
    "stages": rotor(pt.MultiStageSpring("x", "a", "b", damping=0.4, **STAGES)),
    "stages with friction": rotor(pt.MultiStageSpring("x", "a", "b", damping=0.4, friction=3.0, **STAGES)),
    "friction to ground": with_body(pt.Drag("x", "c", damping=0.05, friction=6.0)),
    "friction over slip": rotor(
        pt.Clutch("x", "a", "b", max_torque=30.0, friction=((0.0, 1.0), (5.0, 0.7), (20.0, 0.9))),
    ),
    "road load": with_body(pt.RoadLoad("x", "car", constant=12.0, quadratic=0.4, grade=0.01)),
    "slip tyre": rotor(
        pt.SpringDamper("first", "a", "b", stiffness=700.0, damping=0.4),
        pt.SlipTyre("x", "c", "car", radius=0.3, slip_stiffness=2e3, speed=4.0, max_force=60.0),
        pt.Mass("car", m=120.0),
    ),
}


@pytest.mark.parametrize("kind", CARS)
def test_it_follows_the_exact_simulation(kind):
    car, torque = CARS[kind], pt.ramp(0.1, 0.1, 40.0) + pt.ramp(0.4, 0.05, -70.0)
    system = pt.nonlinear_system(car)
    exact = pt.simulate(car, T, {"a_torque": torque}, {"a": 3.0, "b": 0.0} if kind == "friction over slip" else None)
    assert any(event.element == "x" for event in exact.events)
    speed = {name: exact[f"{name}_speed"][0] for name in ("a", "b", "c")}
    values = pt.input_values(system, car, T, {"a_torque": torque})
    settings = {"solve_ivp_method": "Radau", "solve_ivp_kwargs": {"rtol": 1e-6, "atol": 1e-8, "max_step": 0.02}}
    found = control.input_output_response(
        system, T, values, pt.initial_state(system, car, speed), params={"stick_time": 1e-5}, **settings
    )
    for name in ("a_speed", "b_speed", "c_speed", "s_torque"):
        size = np.abs(exact[name]).max()
        # the stick time of 1e-5 s at every lock, and 1e-6 of every step
        np.testing.assert_allclose(
            found.outputs[system.find_output(name)], exact[name], rtol=0, atol=2e-4 * size, err_msg=name
        )
    modes = [found.outputs[system.find_output(name)] != exact[name] for name in exact.outputs if name.endswith("_mode")]
    # a mode may show a sample early or late at each of its events
    assert np.count_nonzero(modes) <= 2 * len(exact.events)


MEMORY = {
    "play whose shaft has a twist of its own": pt.Backlash("odd", "a", "b", gap=0.1, stiffness=1e3, damping=1.0),
    "elastic friction": pt.MultiStageSpring("odd", "a", "b", friction=2.0, friction_stiffness=1e3, **STAGES),
    "a one-way clutch": pt.OneWayClutch("odd", "a", "b"),
    "a dog clutch": pt.DogClutch("odd", "a", "b"),
    "a moved node": pt.SpeedSource("odd", "b"),
    "a relaxing tyre": pt.SlipTyre("odd", "c", "car", radius=0.3, slip_stiffness=2e3, speed=4.0, relaxation_length=0.3),
}


@pytest.mark.parametrize("kind", MEMORY)
def test_what_needs_memory_is_refused_by_name(kind):
    car = rotor(MEMORY[kind], pt.Mass("car", m=120.0))
    with pytest.raises(pt.PowertrainError, match=re.escape("odd ") + ".*; give dt, e.g. dt=0.001"):
        pt.nonlinear_system(car)


def test_its_outputs_are_torque_twist_and_mode_at_that_instant():
    system = pt.nonlinear_system(CARS["clipped play"])
    state = np.zeros(system.nstates)
    state[system.find_state("x_twist")], state[system.find_state("a_speed")] = 0.03, -0.5
    y = system._out(0.0, state, np.zeros(system.ninputs))
    shown = [y[system.find_output(f"x_{what}")] for what in ("twist", "torque", "mode")]
    assert shown == pytest.approx([0.03, 2e3 * 0.01 - 2.0 * 0.5, 1.0], rel=1e-12)


def test_a_law_whose_guards_lead_in_a_circle_is_no_law_without_memory():
    modes = {0: Mode("one", (Guard(1, slip=-1.0),)), 1: Mode("other", (Guard(0, slip=-1.0),))}
    law = Law("x", {"a": 1.0}, modes, memoryless=True)
    with pytest.raises(
        pt.PowertrainError, match="x: at a twist of 0 rad and a slip of 1 rad/s its guards lead from mode"
    ):
        law.at(0.0, 1.0)
