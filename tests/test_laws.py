"""Tables of modes and guards: what a law states, what is refused, and elements of one's own with laws of their own.

Of elements/laws.
"""

import pickle
import re
from dataclasses import KW_ONLY, dataclass

import control
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.base.checks import NOT_NEGATIVE, POSITIVE
from powertrain_ctrl.elements import Guard, Law, Mode, friction, quantity
from powertrain_ctrl.elements.element import TwoEnded
from powertrain_ctrl.elements.laws import BACKWARD, FORWARD, FREE, STUCK, clipped, nordin, one_way

SLIP = {"a": 1.0, "b": -1.0}


# --- records


def test_friction_slides_against_the_slip_sticks_or_is_free():
    law = friction("clutch", SLIP, max_torque=40.0, static_ratio=1.2)
    assert (law.is_clutch, law.held, law.idle, law.has_twist, law.static_ratio) == (True, STUCK, FREE, False, 1.2)
    assert [law.modes[number].capacity for number in (FORWARD, BACKWARD, STUCK, FREE)] == [1.0, -1.0, 0.0, 0.0]
    assert [law.modes[number].kind for number in (FORWARD, STUCK, FREE)] == ["slip", "lock", "release"]
    assert (law.sliding(3.0), law.sliding(-3.0)) == (FORWARD, BACKWARD)
    # while |torque| < 1.2 capacity it sticks, and slides on to the side to which it is pulled
    assert law.modes[STUCK].guards == (
        Guard(FORWARD, torque=-1.0, capacity=1.2),
        Guard(BACKWARD, torque=1.0, capacity=1.2),
    )


def test_a_one_way_clutch_holds_a_torque_that_drives_and_slips_backward():
    law = one_way("freewheel", SLIP)
    assert (law.is_clutch, law.held, law.idle, law.has_twist) == (False, 0, None, False)
    assert law.modes[0].guards == (Guard(1, torque=1.0),)
    assert law.sliding(-2.0) == 1
    with pytest.raises(
        pt.PowertrainError, match=re.escape("freewheel: slip = 2 rad/s, permitted: of the other sign or 0")
    ):
        law.sliding(2.0)


@pytest.mark.parametrize("make", [nordin, clipped])
@pytest.mark.parametrize(
    ("twist", "mode", "stretch"),
    [(0.0, "gap", 0.0), (0.0099, "gap", 0.0), (0.012, "right", 0.002), (-0.5, "left", -0.49)],
)
def test_play_starts_at_any_twist_in_the_gap_or_loaded_by_what_is_beyond_it(make, twist, mode, stretch):
    law = make("play", SLIP, gap=0.02, stiffness=5e3, damping=10.0)
    number, found = law.starting(twist)
    assert law.modes[number].name == mode
    assert found == pytest.approx(stretch, abs=1e-15)
    assert (law.is_clutch, law.held, law.has_twist) == (False, None, True)


def test_the_shaft_of_play_untwists_in_the_gap_with_its_own_time_constant():
    law = nordin("play", SLIP, gap=0.02, stiffness=5e3, damping=10.0)
    assert law.modes[0].leak == 5e3 / 10.0
    assert nordin("play", SLIP, gap=0.02, stiffness=5e3, damping=0.0).modes[0].leak == np.inf
    assert clipped("play", SLIP, gap=0.02, stiffness=5e3, damping=10.0).modes[0].leak == np.inf


@pytest.mark.parametrize(
    "law",
    [
        friction("k", SLIP, max_torque=3.0, over_slip=((0.0, 1.0), (10.0, 0.8))),
        one_way("f", SLIP),
        nordin("p", SLIP, 0.1, 1e3, 2.0),
        clipped("p", SLIP, 0.1, 1e3, 2.0),
    ],
)
def test_laws_can_be_pickled(law):
    assert pickle.loads(pickle.dumps(law)) == law


# --- what is refused


@dataclass(frozen=True)
class _Own(TwoEnded):
    """An element with whatever law a test needs; as its name begins with _ it has no files."""

    law: Law

    @property
    def laws(self):
        return (self.law,)


def pair(*elements, J=(1.0, 1.0)):
    return pt.Driveline(pt.Inertia("a", J=J[0]), pt.Inertia("b", J=J[1]), *elements)


def own(modes, coefficients=None, **values):
    return pair(_Own("x", "a", "b", Law("x", coefficients or SLIP, modes, **values)))


HOLDS = Mode("holds", held=True)
INCOMPLETE = [
    (
        {"modes": {0: Mode("free", (Guard(7, twist=-1.0),))}},
        'x: after mode 0 ("free") comes 7, permitted: another of 0',
    ),
    (
        {"modes": {0: Mode("free", (Guard(0, twist=1.0),)), 1: Mode("on")}},
        'x: after mode 0 ("free") comes 0, permitted: another of 0, 1',
    ),
    ({"modes": {0: HOLDS, 1: Mode("grips", held=True)}}, "x: modes holds, grips hold its slip, permitted: one of them"),
    ({"modes": {0: HOLDS}, "max_torque": 1.0, "idle": 3}, "x: idle = 3, permitted: one of its modes 0"),
    ({"modes": {0: Mode("on", capacity=1.0)}}, 'x: mode 0 ("on") takes part of a capacity, permitted: with max_torque'),
    ({"modes": {0: Mode("on", slope=1.0)}}, 'x: mode 0 ("on") takes part of a capacity, permitted: with max_torque'),
    (
        {"modes": {0: Mode("on", (Guard(1, capacity=1.0),)), 1: Mode("off")}},
        'x: mode 0 ("on") takes part of a capacity, permitted: with max_torque',
    ),
    (
        {"modes": {0: Mode("on")}, "coefficients": {"a": 1.0, "c": -1.0}},
        'x: acts on "c", permitted: nodes of its element',
    ),
    ({"modes": {0: Mode("on", damping=np.nan)}}, "damping=nan"),
    ({"modes": {0: Mode("on", leak=np.nan)}}, "leak=nan"),
    ({"modes": {0: Mode("on", stiffness=-5.0)}}, "stiffness=-5.0"),
    ({"modes": {0: Mode("on", (Guard(1, level=np.inf),)), 1: Mode("off")}}, "level=inf"),
]


@pytest.mark.parametrize(("values", "message"), INCOMPLETE)
def test_a_table_that_is_not_complete_is_refused_with_what_is_wrong(values, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)):
        own(**values)


def test_a_twist_that_no_mode_covers_is_refused():
    # it would go on at either end into the other mode, which ends there too
    inside = (Guard(1, twist=-1.0, level=1.0), Guard(1, twist=1.0, level=1.0))
    car = own({0: Mode("one", inside), 1: Mode("other", tuple(g._replace(then=0) for g in inside))})
    with pytest.raises(pt.PowertrainError, match="x: twist = 2 rad, permitted: within what its modes cover"):
        pt.simulate(car, [0.0, 1.0], initial_twist={"x": 2.0})


def test_a_one_way_clutch_does_not_start_in_its_forbidden_direction():
    car = pair(pt.OneWayClutch("freewheel", "a", "b"))
    with pytest.raises(pt.PowertrainError) as error:
        pt.simulate(car, [0.0, 1.0], None, {"a": 5.0, "b": 0.0})
    assert str(error.value) == (
        "freewheel: slip = 5 rad/s, permitted: of the other sign or 0; it would have to hold what slips"
    )


def test_only_clutches_are_locked_and_released():
    car = pair(pt.Backlash("play", "a", "b", gap=0.1, stiffness=1e3), pt.OneWayClutch("freewheel", "a", "b"))
    assert car.clutches == ()
    for name in ("play", "freewheel"):
        for change in (car.lock, car.release):
            with pytest.raises(pt.UnknownNameError, match=f'clutch "{name}" is not in this driveline'):
                change(name)


# --- as a system


@pytest.mark.parametrize(
    "element", [pt.Backlash("odd", "a", "b", gap=0.1, stiffness=1e3), pt.OneWayClutch("odd", "a", "b")]
)
def test_a_continuous_system_has_no_memory_of_modes(element):
    with pytest.raises(pt.PowertrainError, match=re.escape("odd needs memory of its mode; give dt, e.g. dt=0.001")):
        pt.nonlinear_system(pair(element))


@pytest.mark.parametrize("contact", ["nordin", "clipped"])
@pytest.mark.parametrize("hold", ["linear", "zero"])
def test_the_discrete_system_of_play_is_the_simulation_sample_by_sample(contact, hold):
    car = pt.Driveline(
        pt.Inertia("a", J=0.2),
        pt.Inertia("b", J=0.3),
        pt.Inertia("c", J=0.5),
        pt.Backlash("play", "a", "b", gap=0.08, stiffness=2e3, damping=1.5, contact=contact),
        pt.OneWayClutch("freewheel", "b", "c"),
    )
    dt, count = 0.004, 250
    t = dt * np.arange(count + 1)
    torque = 20.0 * np.sign(np.sin(11.0 * t)) + 6.0 * np.sin(47.0 * t)
    held = pt.samples(np.repeat(t, 2)[1:-1], np.repeat(torque[:-1], 2))
    system = pt.nonlinear_system(car, dt=dt, hold=hold)
    inputs = {"a_torque": torque, "c_torque": np.full(len(t), -1.0)}
    start = pt.initial_state(system, car, {"a": 0.0, "b": 0.0, "c": 3.0})
    found = control.input_output_response(system, t, pt.input_values(system, car, t, inputs), start)
    exact = pt.simulate(
        car, t, {"a_torque": torque if hold == "linear" else held, "c_torque": -1.0}, {"a": 0.0, "b": 0.0, "c": 3.0}
    )
    assert {e.element for e in exact.events} == {"play", "freewheel"}
    assert len(exact.events) > 20
    for name in ("a_speed", "b_speed", "c_speed", "play_twist"):
        values = found.outputs[system.find_output(name)]
        np.testing.assert_allclose(values, exact[name], rtol=0, atol=1e-9 * np.abs(exact[name]).max(), err_msg=name)
    # a sample of a held input shows what is behind its jump, and so does the system
    for name in ("play_torque", "freewheel_torque", "play_mode", "freewheel_mode"):
        values = found.outputs[system.find_output(name)][:-1]
        np.testing.assert_allclose(
            values, exact[name][:-1], rtol=0, atol=1e-9 * max(1.0, np.abs(exact[name]).max()), err_msg=name
        )


# --- elements of one's own


@dataclass(frozen=True)
class EndStop(TwoEnded):
    """Free up to a twist, then a stiff spring that pushes back."""

    _: KW_ONLY
    reach: float = quantity("rad", POSITIVE)
    stiffness: float = quantity("N m/rad", POSITIVE)

    @property
    def laws(self):
        modes = {
            0: Mode("clear", (Guard(1, twist=-1.0, level=self.reach),), kind="open"),
            1: Mode(
                "stopped",
                (Guard(0, torque=1.0),),
                kind="contact",
                stiffness=self.stiffness,
                follows=True,
                origin=self.reach,
            ),
        }
        return (Law(self.name, {self.a: 1.0, self.b: -1.0}, modes),)


@dataclass(frozen=True)
class DraggingClutch(TwoEnded):
    """Clutch that drags when it is open: its capacity is that of its input and a constant besides."""

    _: KW_ONLY
    max_torque: float = quantity("N m", NOT_NEGATIVE)
    drag: float = quantity("N m", NOT_NEGATIVE)

    @property
    def laws(self):
        sides = ((FORWARD, -1.0), (BACKWARD, 1.0))
        holds = tuple(Guard(then, torque=sign, level=self.drag, capacity=1.0) for then, sign in sides)
        modes = {STUCK: Mode("stuck", holds, kind="lock", held=True)} | {
            number: Mode(
                word, (Guard(STUCK, slip=float(number)),), capacity=number, torque=number * self.drag, heats=True
            )
            for number, word in ((FORWARD, "forward"), (BACKWARD, "backward"))
        }
        return (Law(self.name, {self.a: 1.0, self.b: -1.0}, modes, self.max_torque),)


STOP = EndStop("stop", "a", "b", reach=0.3, stiffness=800.0)
DRAGS = DraggingClutch("k", "a", "b", max_torque=5.0, drag=1.0)


def test_an_end_stop_of_ones_own_throws_back_what_hits_it():
    # bodies of 1 and 3 kg m^2 exchange an elastic blow: 2 rad/s become -1 and 1; contact lasts pi sqrt(mu / k)
    car, lasts = pair(STOP, J=(1.0, 3.0)), np.pi * np.sqrt(0.75 / 800.0)
    response = pt.simulate(car, np.linspace(0.0, 1.0, 11), None, {"a": 2.0, "b": 0.0})
    assert [(e.time, e.element, e.kind, e.mode) for e in response.events] == [
        (pytest.approx(0.15, abs=1e-13), "stop", "contact", "stopped"),
        (pytest.approx(0.15 + lasts, abs=1e-13), "stop", "open", "clear"),
    ]
    assert response.final.speed == pytest.approx({"a": -1.0, "b": 1.0}, abs=1e-12)
    assert response.final.mode == {"stop": "clear"}
    assert response.modes == {"stop": {0: "clear", 1: "stopped"}}


def test_beyond_its_stop_it_starts_loaded():
    response = pt.simulate(pair(STOP), [0.0, 0.01], initial_twist={"stop": 0.5})
    assert response["stop_torque"][0] == pytest.approx(0.2 * 800.0, rel=1e-13)
    assert response["stop_mode"][0] == 1


def test_a_stop_of_ones_own_equals_half_a_play():
    # play of which the other flank is out of reach
    inputs, t = {"a_torque": pt.ramp(0.0, 3.0, 6.0, 5.0)}, np.linspace(0.0, 3.0, 101)
    mine = pt.simulate(pair(STOP), t, inputs)
    play = pt.simulate(pair(pt.Backlash("stop", "a", "b", gap=0.6, stiffness=800.0)), t, inputs)
    expected = [(pytest.approx(e.time, rel=0, abs=1e-12), e.kind) for e in play.events]
    assert [(e.time, e.kind) for e in mine.events] == expected
    assert len(expected) > 3
    np.testing.assert_allclose(mine["stop_torque"], play["stop_torque"], rtol=0, atol=1e-11)


@pytest.mark.parametrize("element", [STOP, DRAGS])
def test_elements_of_ones_own_are_saved_and_pickled(element, tmp_path):
    car = pair(element)
    for state in (car, car.release()):
        state.save(tmp_path / "car.toml")
        assert pt.load(tmp_path / "car.toml") == state
    response = pt.simulate(car, [0.0, 0.2, 0.5], {"a_torque": 9.0})
    copied = pickle.loads(pickle.dumps((car, response)))
    assert copied[0] == car
    np.testing.assert_array_equal(copied[1]["a_speed"], response["a_speed"])
    assert copied[1].events == response.events
    head = pickle.loads(pickle.dumps(pt.simulate(car, [0.0, 0.2], {"a_torque": 9.0}).final))
    assert pt.simulate(car, [0.2, 0.5], {"a_torque": 9.0}, initial_state=head).final.speed == pytest.approx(
        response.final.speed, rel=1e-13
    )


def test_a_clutch_of_ones_own_is_locked_released_and_drawn_like_any_other():
    car = pair(DRAGS)
    assert (car.clutches, len(pt.modes(car)), len(pt.modes(car.release("k")))) == (("k",), 1, 2)
    assert car.release("k").lock("k") == car
    assert car.release("k").part("a").nodes == ("a",)
    assert "5 N m" in [text.get_text() for text in pt.plots.schematic(car).texts]


def test_a_clutch_of_ones_own_drags_where_the_built_in_one_is_free():
    # open it brakes 6 rad/s of two equal bodies with 1 N m: 2 rad/s^2
    response = pt.simulate(pair(DRAGS), [0.0, 1.0, 4.0], {"k_capacity": 0.0}, {"a": 6.0, "b": 0.0})
    assert response["a_speed"][1] - response["b_speed"][1] == pytest.approx(4.0, abs=1e-12)
    assert [(e.time, e.kind) for e in response.events] == [(pytest.approx(3.0, abs=1e-12), "lock")]
    assert response.slip_energy["k"] == pytest.approx(0.5 * 0.5 * 6.0**2, rel=1e-12)
    # closed, it is a clutch of 6 N m
    built_in = pair(pt.Clutch("k", "a", "b", max_torque=6.0))
    torque, t = {"a_torque": pt.ramp(0.0, 1.0, 30.0) + pt.step(1.2, -28.0)}, np.linspace(0.0, 5.0, 51)
    mine, theirs = (pt.simulate(car, t, torque) for car in (pair(DRAGS), built_in))
    assert [(e.kind, e.mode) for e in mine.events] == [(e.kind, e.mode) for e in theirs.events] != []
    np.testing.assert_allclose([e.time for e in mine.events], [e.time for e in theirs.events], rtol=0, atol=1e-12)
    np.testing.assert_allclose(mine["b_speed"], theirs["b_speed"], rtol=0, atol=1e-11)


def test_laws_of_ones_own_go_through_python_control():
    car = pair(STOP, pt.Drag("bearing", "a", damping=0.1))
    dt, t = 0.01, 0.01 * np.arange(101)
    system = pt.nonlinear_system(car, dt=dt)
    inputs = pt.input_values(system, car, t, {"a_torque": 4.0})
    found = control.input_output_response(system, t, inputs, pt.initial_state(system, car))
    exact = pt.simulate(car, t, {"a_torque": 4.0})
    assert exact.events
    np.testing.assert_allclose(found.outputs[system.find_output("a_speed")], exact["a_speed"], rtol=0, atol=1e-11)
