"""What a closed driveline starts with is what it has at the end and what its elements have turned into heat."""

import numpy as np
import pytest

import powertrain_ctrl as pt

J = {"a": 0.3, "b": 0.5, "c": 0.2}
K = 900.0
STAGES = {"twists": (-0.1, -0.02, 0.02, 0.1), "torques": (-90.0, -10.0, 10.0, 90.0)}
ELEMENTS = {
    "play": pt.Backlash("e", "a", "b", gap=0.02, stiffness=3000.0, damping=4.0),
    "play without damping": pt.Backlash("e", "a", "b", gap=0.02, stiffness=3000.0),
    "play, clipped": pt.Backlash("e", "a", "b", gap=0.02, stiffness=3000.0, damping=4.0, contact="clipped"),
    "stages": pt.MultiStageSpring("e", "a", "b", **STAGES, damping=0.3),
    "stages and friction": pt.MultiStageSpring("e", "a", "b", **STAGES, damping=0.3, friction=3.0),
    "stages and elastic friction": pt.MultiStageSpring(
        "e", "a", "b", **STAGES, friction=3.0, friction_stiffness=2000.0
    ),
    "one-way clutch": pt.OneWayClutch("e", "b", "a"),
    "clutch": pt.Clutch("e", "a", "b", max_torque=6.0),
    "falling friction": pt.Clutch("e", "a", "b", max_torque=6.0, friction=((0.0, 1.0), (2.0, 0.6), (9.0, 0.9))),
}


def closed(element):
    """The element in a loop with a spring beside it, so that it is loaded to and fro."""
    bodies = [pt.Inertia(name, J=value) for name, value in J.items()]
    return pt.Driveline(
        *bodies,
        element,
        pt.SpringDamper("s", "b", "c", stiffness=K),
        pt.SpringDamper("t", "c", "a", stiffness=0.3 * K),
    )


def kinetic_and_springs(response, i):
    moving = sum(0.5 * value * response[f"{name}_speed"][i] ** 2 for name, value in J.items())
    return moving + 0.5 * K * response["s_twist"][i] ** 2 + 0.15 * K * response["t_twist"][i] ** 2


def polyline(twist):
    """Energy of the stages: straight lines of torque from 0 to the twist."""
    knots = np.unique([0.0, *(q for q in STAGES["twists"] if 0.0 < q * np.sign(twist) < abs(twist)), twist])
    torque = np.interp(knots, (-10.1, *STAGES["twists"], 10.1), (-10090.0, *STAGES["torques"], 10090.0))
    return abs(np.sum(0.5 * (torque[1:] + torque[:-1]) * np.diff(knots)))


def held_by(element, response):
    """Energy that the element holds at the end: twists of stages, what play and elastic friction are stretched by."""
    twist = response.final.twist.get("e", 0.0)
    if isinstance(element, pt.Backlash):
        k = element.stiffness
        mode = response.final.mode["e"]
        if mode in ("right", "left"):
            return 0.5 * k * (abs(twist) - 0.5 * element.gap) ** 2
        return None if element.damping and element.contact == "nordin" else 0.0
    if isinstance(element, pt.MultiStageSpring):
        if element.friction_stiffness is None:
            return polyline(twist)
        pull = response["e_torque"][-1] - float(np.interp(twist, STAGES["twists"], STAGES["torques"]))
        return polyline(twist) + 0.5 * pull**2 / element.friction_stiffness
    return 0.0


@pytest.mark.parametrize("name", ELEMENTS)
def test_nothing_is_lost_but_what_is_heat(name):
    element = ELEMENTS[name]
    speed = {"a": 4.0, "b": -1.0, "c": 0.5} if name != "one-way clutch" else {"a": 4.0, "b": -1.0}
    kept = None
    for end in np.linspace(0.6, 1.4, 9):  # until it ends where all that is held is seen
        response = pt.simulate(closed(element), [0.0, end], initial_speed=speed)
        kept = held_by(element, response)
        if kept is not None:
            break
    start = kinetic_and_springs(response, 0)
    lost = start - kinetic_and_springs(response, -1) - kept
    assert response.events
    assert sum(response.slip_energy.values()) == pytest.approx(lost, abs=1e-11 * start)
    if name not in ("play without damping", "one-way clutch"):
        assert lost > 0.01 * start


@pytest.mark.parametrize("name", ["play", "stages", "falling friction"])
def test_the_heat_at_an_event_is_that_of_a_run_that_ends_there(name):
    speed = {"a": 4.0, "b": -1.0, "c": 0.5}
    whole = pt.simulate(closed(ELEMENTS[name]), [0.0, 0.6], initial_speed=speed)
    later = [event for event in whole.events if event.time > 0.0]
    assert len(later) > 1
    for event in later:
        run = pt.simulate(closed(ELEMENTS[name]), [0.0, event.time], initial_speed=speed)
        assert event.heat == pytest.approx(sum(run.slip_energy.values()), rel=1e-9, abs=1e-12)
