"""States to start from: twists, steady loads, the state of an earlier run, one made by hand.

Of hybrid/starts, driveline/static.
"""

import pickle
import re
from itertools import pairwise

import numpy as np
import pytest

import powertrain_ctrl as pt

T = np.linspace(0.0, 0.5, 51)


def bodies(*names, J=1.0):
    return [pt.Inertia(name, J=J) for name in names]


def spring(name, a, b, k=1e3, d=0.0):
    return pt.SpringDamper(name, a, b, stiffness=k, damping=d)


def play(name, a, b, gap=0.1, k=1e3, **values):
    return pt.Backlash(name, a, b, gap=gap, stiffness=k, **values)


# --- twists


def test_a_spring_starts_with_its_twist_and_the_others_with_none():
    car = pt.Driveline(*bodies("a", "b", "c"), spring("one", "a", "b", 500.0), spring("two", "b", "c"))
    response = pt.simulate(car, [0.0, 1e-3], None, {"a": 2.0}, initial_twist={"one": 0.02})
    assert response["one_torque"][0] == pytest.approx(10.0, rel=1e-14)
    assert response["two_torque"][0] == pytest.approx(0.0, abs=1e-12)
    assert [response[f"{node}_speed"][0] for node in "abc"] == pytest.approx([2.0] * 3, rel=1e-14)


def test_springs_in_a_loop_share_what_is_left():
    # ac = ab + bc; with ab = 0.1 the sum of bc^2 and ac^2 is least at -0.05 and 0.05
    loop = [spring("ab", "a", "b"), spring("bc", "b", "c"), spring("ac", "a", "c")]
    response = pt.simulate(pt.Driveline(*bodies("a", "b", "c"), *loop), [0.0, 1e-3], initial_twist={"ab": 0.1})
    twists = [response[f"{name}_twist"][0] for name in ("ab", "bc", "ac")]
    assert twists == pytest.approx([0.1, -0.05, 0.05], abs=1e-14)


def test_a_twist_of_play_is_the_whole_one():
    car = pt.Driveline(*bodies("a", "b", "c"), play("p", "a", "b"), spring("s", "b", "c"))
    for twist, torque in ((0.03, 0.0), (0.07, 20.0), (-0.25, -200.0), (0.05, 0.0)):
        response = pt.simulate(car, [0.0, 1e-4], initial_twist={"p": twist})
        assert response["p_twist"][0] == pytest.approx(twist, rel=1e-14)
        assert response["p_torque"][0] == pytest.approx(torque, abs=1e-11)
        assert response["s_torque"][0] == pytest.approx(0.0, abs=1e-11)


@pytest.mark.parametrize("gap", [0.1, 0.07, 0.013, 0.3, 1.1, 0.9])
def test_play_that_starts_on_its_flank_stays_there(gap):
    # rounding would twist the springs beside it a little, and that would push it to either side
    springs = spring("r", "z", "a", 3e4), spring("s", "b", "c"), spring("t", "c", "d", 7e5)
    car = pt.Driveline(*bodies("z", "a", "b", "c", "d", J=0.7), play("p", "a", "b", gap), *springs)
    for side in (0.5, -0.5):
        response = pt.simulate(car, [0.0, 0.1], initial_twist={"p": side * gap})
        assert [response[f"{name}_torque"][0] for name in "rst"] == [0.0] * 3
        np.testing.assert_allclose(response["p_torque"], 0.0, atol=1e-12)
        np.testing.assert_allclose(response["p_twist"], side * gap, rtol=1e-14)


def test_a_twisted_spring_swings_about_its_rest():
    # two bodies of 1 kg m^2 on 800 N m/rad: 40 rad/s
    car = pt.Driveline(*bodies("a", "b"), spring("s", "a", "b", 800.0))
    response = pt.simulate(car, T, None, {"a": 3.0}, initial_twist={"s": 0.04})
    np.testing.assert_allclose(response["s_twist"], 0.04 * np.cos(40.0 * T), rtol=0, atol=1e-14)
    np.testing.assert_allclose(response["a_speed"] + response["b_speed"], 6.0, rtol=1e-14)


# --- loads

GEARED = pt.Driveline(
    *bodies("engine", J=0.3),
    *bodies("wheel", "flywheel", J=2.0),
    pt.Gear("gear", "engine", "shaft", ratio=3.0),
    play("teeth", "shaft", "wheel", gap=0.04, k=4e3, damping=9.0),
    spring("damper", "flywheel", "engine", 900.0, 0.6),
)
PLANETARY = pt.Driveline(
    *bodies("sun", "carrier", "load", "hub", J=0.4),
    pt.Planetary("set", "sun", "ring", "carrier", ratio=2.0),
    pt.Inertia("ring", J=0.1),
    spring("support", "ring", "hub", 5e3, 1.0),
    play("teeth", "carrier", "load", gap=0.02, contact="clipped", damping=2.0),
    pt.OneWayClutch("freewheel", "hub", "load"),
)
SERIES = pt.Driveline(
    *bodies("a", "b", "c", "d", J=0.5),
    play("ab", "a", "b", gap=0.1),
    play("bc", "b", "c", gap=0.3, contact="clipped", damping=4.0),
    play("cd", "d", "c", gap=0.02),
)
BESIDE = pt.Driveline(
    *bodies("a", "b"), spring("s", "a", "b", 300.0, 0.5), play("p", "a", "b", gap=0.2), play("q", "a", "b", gap=0.5)
)
STEADY = [
    (GEARED, {"engine_torque": 40.0, "wheel_torque": -25.0}),
    (GEARED, {"flywheel_torque": -12.0}),
    (SERIES, {"a_torque": 30.0}),
    (SERIES, {"d_torque": 7.0, "b_torque": -20.0}),
    (BESIDE, {"a_torque": 40.0}),  # 20 N m: 0.0667 rad of the spring, the play of 0.2 rad is open
    (BESIDE, {"a_torque": -120.0}),
    (BESIDE, {"b_torque": 900.0}),
    (PLANETARY, {"sun_torque": 15.0}),
    (pt.examples.conventional(), {"engine_torque": 120.0, "vehicle_force": -800.0}),
]


@pytest.mark.parametrize(("car", "load"), STEADY)
def test_under_its_load_a_steady_motion_stays_as_it_is(car, load):
    response = pt.simulate(car, T, load, initial_load=load)
    assert not response.events
    for name in response.outputs:
        if name.endswith(("_torque", "_twist", "_acceleration", "_mode")):
            size = max(1e-3, np.abs(response[name]).max())
            np.testing.assert_allclose(response[name], response[name][0], rtol=0, atol=1e-9 * size, err_msg=name)


def test_the_torque_of_a_load_is_what_accelerates_all_as_one_body():
    # 30 N m on four bodies of 0.5: 15 rad/s^2, behind a there are three of them, then two, then one
    response = pt.simulate(SERIES, [0.0, 0.1], {"a_torque": 30.0}, initial_load={"a_torque": 30.0})
    assert response["ab_torque"][0] == pytest.approx(22.5, rel=1e-12)
    assert response["bc_torque"][0] == pytest.approx(15.0, rel=1e-12)
    assert response["cd_torque"][0] == pytest.approx(-7.5, rel=1e-12)
    twists = [response[f"{name}_twist"][0] for name in ("ab", "bc", "cd")]
    assert twists == pytest.approx([0.05 + 0.0225, 0.15 + 0.015, -0.01 - 0.0075], rel=1e-12)
    assert response["d_acceleration"][0] == pytest.approx(15.0, rel=1e-12)


def test_play_beside_a_spring_carries_what_is_left_of_it():
    # 900 N m on two equal bodies: 450 N m = 300 q + 1000 (q - 0.1) + 1000 (q - 0.25)
    response = pt.simulate(BESIDE, [0.0, 0.1], {"a_torque": 900.0}, initial_load={"a_torque": 900.0})
    twist = (450.0 + 100.0 + 250.0) / 2300.0
    assert response["s_twist"][0] == pytest.approx(twist, rel=1e-12)
    assert response["p_torque"][0] == pytest.approx(1000.0 * (twist - 0.1), rel=1e-12)
    assert response["q_torque"][0] == pytest.approx(1000.0 * (twist - 0.25), rel=1e-12)


def test_flanks_that_face_each_other_share_a_load_by_the_one_that_is_reached():
    # 2 N m of 4 go on to b: p closes, q is open
    car = pt.Driveline(*bodies("a", "b"), play("p", "a", "b"), play("q", "b", "a", gap=0.3))
    response = pt.simulate(car, T, {"a_torque": 4.0}, initial_load={"a_torque": 4.0})
    assert not response.events
    np.testing.assert_allclose(response["p_torque"], 2.0, rtol=1e-12)
    np.testing.assert_array_equal(response["q_torque"], 0.0)


def test_play_without_load_is_in_the_middle_of_its_gap():
    response = pt.simulate(SERIES, T, {"a_torque": 0.0}, {"a": 5.0}, initial_load={})
    assert not response.events
    for name in ("ab", "bc", "cd"):
        assert response[f"{name}_twist"][0] == 0.0
    # of four equal bodies each with its own load nothing is passed on
    load = dict.fromkeys(("a_torque", "b_torque", "c_torque", "d_torque"), 7.0)
    response = pt.simulate(SERIES, T, load, initial_load=load)
    assert not response.events
    for name in ("ab", "bc", "cd"):
        assert response[f"{name}_torque"][0] == 0.0
        assert response[f"{name}_twist"][0] == pytest.approx(0.0, abs=1e-12)


def test_what_nothing_holds_runs_away_and_the_rest_is_steady():
    # a is pulled back from a one-way clutch: it carries nothing, and b and c turn with their own load
    car = pt.Driveline(*bodies("a", "b", "c"), pt.OneWayClutch("f", "a", "b"), spring("s", "b", "c"))
    back = {"a_torque": -5.0, "b_torque": 8.0}
    response = pt.simulate(car, T, back, initial_load=back)
    np.testing.assert_allclose(response["s_torque"], 4.0, rtol=1e-12)
    np.testing.assert_allclose(response["f_torque"], 0.0, atol=1e-12)
    on = {"a_torque": 9.0}
    response = pt.simulate(car, T, on, initial_load=on)
    np.testing.assert_allclose(response["s_torque"], 3.0, rtol=1e-12)
    np.testing.assert_allclose(response["f_torque"], 6.0, rtol=1e-12)


def test_friction_slides_at_a_speed_and_holds_at_rest():
    car = pt.Driveline(*bodies("a", "b"), spring("s", "a", "b"), pt.Drag("d", "b", damping=0.0, friction=4.0))

    def torque(load, speed):
        response = pt.simulate(car, T, {"a_torque": load}, dict.fromkeys("ab", speed), initial_load={"a_torque": load})
        np.testing.assert_allclose(response["s_torque"], response["s_torque"][0], rtol=1e-9)
        return response["s_torque"][0]

    # half of what is left of the load goes into either body
    assert torque(20.0, 10.0) == pytest.approx(12.0, rel=1e-12)
    assert torque(20.0, 0.0) == pytest.approx(12.0, rel=1e-12)
    assert torque(20.0, -80.0) == pytest.approx(8.0, rel=1e-12)
    assert torque(3.0, 0.0) == pytest.approx(3.0, rel=1e-12)


def test_a_load_at_a_speed_turns_the_dampers_that_it_has_to_turn():
    # 40 rad/s against a drag of 0.5 N m s/rad takes 20 N m: nothing accelerates
    car = pt.Driveline(*bodies("a", "b"), play("p", "a", "b", damping=3.0), pt.Drag("drag", "b", damping=0.5))
    start = {"initial_speed": {"a": 40.0, "b": 40.0}, "initial_load": {"a_torque": 20.0}}
    response = pt.simulate(car, T, {"a_torque": 20.0}, **start)
    assert not response.events
    np.testing.assert_allclose(response["b_speed"], 40.0, rtol=1e-13)
    np.testing.assert_allclose(response["p_torque"], 20.0, rtol=1e-12)


def test_a_car_climbs_at_a_steady_speed_under_the_load_that_this_takes():
    climbing = 150.0 + 0.02 * 1000.0 * 9.80665  # N, at a wheel of 0.3 m
    car = pt.Driveline(
        *bodies("a", "b"),
        play("p", "a", "b", k=4e3, damping=20.0),
        pt.Tyre("tyre", "b", "v", radius=0.3),
        pt.Mass("v", m=1000.0),
        pt.RoadLoad("road", "v", constant=150.0, grade=0.02),
    )
    load, speed = {"a_torque": 0.3 * climbing}, {"a": 50.0, "b": 50.0, "v": 15.0}
    response = pt.simulate(car, T, load, speed, initial_load=load)
    assert not response.events
    np.testing.assert_allclose(response["v_speed"], 15.0, rtol=1e-12)
    np.testing.assert_allclose(response["p_torque"], 0.3 * climbing, rtol=1e-10)


# --- the state of an earlier run

CAR = pt.Driveline(
    *bodies("a", "b", "c", "d", J=0.3),
    play("p", "a", "b", damping=3.0),
    play("q", "b", "c", gap=0.05, damping=3.0, contact="clipped"),
    pt.OneWayClutch("f", "c", "d"),
    pt.Clutch("k", "d", max_torque=6.0, static_ratio=1.3),
)
TIMES, TORQUES = [0.0, 0.2, 0.2, 0.5, 0.9, 1.0], [20.0, 20.0, -25.0, 30.0, -20.0, 8.0]
CAPACITY = pt.ramp(0.3, 0.3, 1.0, 6.0) + pt.ramp(0.9, 0.1, 30.0)
END = 1.2


def inputs(corner=0.0):
    """Torque and capacity; a corner more on a straight line changes nothing but where the steps of a run begin."""
    extra = pt.samples([0.0, corner, END], [0.0, 0.0, 0.0])
    return {"a_torque": pt.samples(TIMES, TORQUES) + extra, "k_capacity": CAPACITY}


def head(split):
    return pt.simulate(CAR, [0.0, split], inputs(split))


WHOLE = pt.simulate(CAR, [0.0, END], inputs())
EVENTS = [e.time for e in WHOLE.events]
MIDDLES = [0.5 * (a + b) for a, b in pairwise(EVENTS)]
BETWEEN = MIDDLES[5::16]


def signature(response):
    return [(e.element, e.kind, e.mode) for e in response.events]


def test_there_is_enough_to_split():
    assert {(element, kind) for element, kind, _ in signature(WHOLE)} >= {
        *(("p", kind) for kind in ("contact", "open")),
        *(("q", kind) for kind in ("contact", "open")),
        *(("f", kind) for kind in ("lock", "release")),
        *(("k", kind) for kind in ("lock", "slip")),
    }
    assert len(BETWEEN) > 2


@pytest.mark.parametrize("split", BETWEEN)
def test_a_run_goes_on_from_the_final_state_to_the_last_bit(split):
    first, whole = head(split), pt.simulate(CAR, [0.0, END], inputs(split))
    state = pickle.loads(pickle.dumps(first.final))
    rest = pt.simulate(CAR, [split, END], inputs(split), initial_state=state)
    events = [(e.time, e.element, e.mode) for e in first.events + rest.events]
    assert events == [(e.time, e.element, e.mode) for e in whole.events]
    assert (rest.final.speed, rest.final.twist, rest.final.mode) == (
        whole.final.speed,
        whole.final.twist,
        whole.final.mode,
    )
    for name in rest.outputs:
        assert rest[name][-1] == whole[name][-1]
    assert signature(whole) == signature(WHOLE)


@pytest.mark.parametrize("split", EVENTS[2::13])
def test_a_run_may_be_split_at_the_very_time_of_an_event(split):
    first = head(split)
    rest = pt.simulate(CAR, [split, END], inputs(split), initial_state=first.final)
    assert signature(first) + signature(rest) == signature(WHOLE)
    times = [e.time for e in first.events + rest.events]
    np.testing.assert_allclose(times, EVENTS, rtol=0, atol=1e-11)
    for node in CAR.nodes:
        assert rest.final.speed[node] == pytest.approx(WHOLE.final.speed[node], rel=0, abs=1e-10)


def by_hand(state, **changed):
    values = {"time": state.time, "twist": state.twist, "speed": state.speed, "mode": state.mode}
    return pt.State(**values | changed)


@pytest.mark.parametrize("names", ["modes", "numbers", "none"])
def test_a_state_made_by_hand_goes_on_like_the_run_that_it_describes(names):
    # in contact: how far the shaft of p is untwisted in its gap, a state has no word for
    touching = [e.mode != "gap" for e in WHOLE.events if e.element == "p"]
    times = [e.time for e in WHOLE.events if e.element == "p"]
    split = max(
        (t for t in MIDDLES if touching[np.searchsorted(times, t) - 1]), key=lambda t: min(abs(t - np.array(EVENTS)))
    )
    first = head(split)
    modes = {
        "modes": first.final.mode,
        "numbers": {name: int(first[f"{name}_mode"][-1]) for name in first.modes},
        "none": {},
    }[names]
    rest = pt.simulate(CAR, [split, END], inputs(split), initial_state=by_hand(first.final, mode=modes))
    assert signature(first) + signature(rest) == signature(WHOLE)
    for node in CAR.nodes:
        assert rest.final.speed[node] == pytest.approx(WHOLE.final.speed[node], rel=0, abs=1e-9)


def test_a_state_made_by_hand_needs_no_run():
    state = pt.State(time=0.0, twist={"p": 0.06}, speed={"a": 4.0, "b": 4.0, "c": 1.0, "d": 2.0}, mode={})
    mine = pt.simulate(CAR, [0.0, END], inputs(), initial_state=state)
    theirs = pt.simulate(CAR, [0.0, END], inputs(), state.speed, initial_twist={"p": 0.06})
    assert mine.events == theirs.events
    assert mine.final.speed == theirs.final.speed


def test_runs_go_on_in_the_very_part_of_a_friction_curve():
    # all of these parts have one name
    road = pt.Driveline(pt.Mass("v", m=1000.0), pt.RoadLoad("road", "v", constant=100.0, quadratic=0.4))
    curve = ((0.0, 1.0), (10.0, 0.8), (20.0, 0.7))
    clutch = pt.Driveline(*bodies("a", "b"), pt.Clutch("k", "a", "b", max_torque=5.0, friction=curve))
    for car, speed, split in ((road, {"v": 40.0}, 10.0), (clutch, {"a": 80.0}, 1.0)):
        whole = pt.simulate(car, [0.0, 20.0], None, speed)
        state = pt.simulate(car, [0.0, split], None, speed).final
        after = [(pytest.approx(e.time, abs=1e-12), e.mode) for e in whole.events if e.time > split]
        assert len(after) > 0
        for start in (state, by_hand(state)):
            rest = pt.simulate(car, [split, 20.0], initial_state=start)
            assert [(e.time, e.mode) for e in rest.events] == after


def test_a_switched_model_goes_on_from_a_state_made_by_hand_in_the_model_of_its_mode():
    car = pt.examples.conventional()
    closed, slipping = (pt.two_mass(c, method="modal") for c in (car, car.release("clutch")))
    switched = pt.SwitchedTwoMass(closed=closed, slipping=slipping)
    torque = {"engine_torque": pt.ramp(0.0, 0.2, 200.0), "clutch_capacity": 370.0}
    state = pt.simulate(switched, [0.0, 3.0], torque, {"engine": 100.0}).final
    assert state.mode == {"clutch": 0}
    exact, made = (
        pt.simulate(switched, [3.0, 4.0], torque, initial_state=start).final for start in (state, by_hand(state))
    )
    assert made.speed == pytest.approx(exact.speed, rel=1e-12)


# --- what is refused


def refused(message, car=CAR, **start):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)) as error:
        pt.simulate(car, [0.0, 0.1], **start)
    return error.value


SPRINGS = pt.Driveline(*bodies("a", "b"), spring("s", "a", "b"), spring("t", "a", "b"), pt.Constraint("c", {"w": 1.0}))
STATE = pt.State(time=0.0, twist={"p": 0.06}, speed=dict.fromkeys("abcd", 1.0), mode={})
MODES = {"p": "right", "q": "gap", "f": "driving", "k": 1}


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"initial_twist": {"x": 0.1}}, 'spring or play "x" is not in this driveline; there is p, q'),
        ({"initial_twist": {"f": 0.1}}, 'spring or play "f" is not in this driveline'),
        ({"initial_twist": {"p": np.nan}}, "initial twist: p = nan rad, permitted: finite"),
        ({"initial_twist": [0.1]}, "initial_twist is of type list, permitted: a mapping"),
        ({"initial_load": {"x_torque": 1.0}}, 'input "x_torque" is not of this driveline'),
        ({"initial_load": {"k_capacity": 1.0}}, 'input "k_capacity" is not of this driveline'),
        ({"initial_load": {"a_torque": np.inf}}, "initial load: a_torque = inf N m, permitted: finite"),
        (
            {"initial_twist": {}, "initial_load": {}},
            "initial_twist and initial_load are both given, permitted: one of them",
        ),
        *(
            ({name: {}, "initial_state": STATE}, f"{name} and initial_state are both given, permitted: one of them")
            for name in ("initial_speed", "initial_twist", "initial_load")
        ),
        ({"initial_state": {"p": 0.0}}, "initial_state: expected a State"),
        ({"initial_state": by_hand(STATE, mode={"x": 0})}, 'clutch or law "x" is not in this driveline'),
        (
            {"initial_state": by_hand(STATE, mode={"p": "middle"})},
            "p: mode = 'middle', permitted: 0 (gap), 1 (right), 2 (left)",
        ),
        ({"initial_state": by_hand(STATE, speed={"x": 1.0})}, 'node "x" is not in this driveline'),
        ({"initial_state": by_hand(STATE, twist={"x": 1.0})}, 'spring or play "x" is not in this driveline'),
        (
            {"initial_state": by_hand(STATE, mode=MODES | {"p": "left"})},
            "initial_state: p in mode 'left' contradicts its twist = 0.06 rad, slip = 0 rad/s",
        ),
        (
            {"initial_state": by_hand(STATE, mode=MODES | {"q": "right, off"})},
            "initial_state: q in mode 'right, off' contradicts its twist = 0 rad",
        ),
        (
            {"initial_state": by_hand(STATE, mode=MODES, speed={**STATE.speed, "d": 2.0})},
            "initial_state: f in mode 'driving' contradicts its slip = -1 rad/s",
        ),
        (
            {"initial_state": by_hand(STATE, mode=MODES | {"f": "overrunning"}, speed={**STATE.speed, "d": 0.5})},
            "initial_state: f in mode 'overrunning' contradicts its slip = 0.5 rad/s",
        ),
        (
            {"initial_state": by_hand(STATE, mode=MODES | {"k": -1})},
            "initial_state: k in mode -1 contradicts its slip = 1 rad/s",
        ),
        (
            {"initial_state": by_hand(STATE, mode=MODES | {"k": 0})},
            "initial_state: k in mode 0 contradicts its slip = 1 rad/s",
        ),
    ],
)
def test_a_start_that_cannot_be_is_named(start, message):
    refused(message, **start)


def test_twists_that_contradict_each_other_are_named():
    refused('initial twist of "', SPRINGS, initial_twist={"s": 0.1, "t": 0.2})
    car = pt.Driveline(*bodies("a"), pt.Constraint("fixed", {"w": 1.0, "a": -1.0}), spring("s", "a", "w"))
    refused('initial twist of "s" = 0.1 contradicts what holds it at rest', car, initial_twist={"s": 0.1})


def test_the_state_of_another_driveline_is_refused_and_so_is_that_of_other_values():
    state = head(0.1).final
    for other in (CAR.replace("c", J=0.4), SERIES):
        refused("initial_state is of another driveline, or of one with other values", other, initial_state=state)
