"""Play and one-way clutches: closed forms, published examples, the source's car, invariances, energy.

Of elements/backlash, elements/clutches.
"""

import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import cases
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.elements import Element, Law, Mode

REFERENCE = Path(__file__).parent / "reference"
CONTACTS = ("nordin", "clipped")
# [s], and part of a torque
TIME, TORQUE = 1e-11, 1e-10


def case(name):
    """Parameters and expected values."""
    record = cases.case(name)
    return vars(record.p), record.values


def at(time):
    return pytest.approx(time, rel=0, abs=TIME)


def pair(J1, J2, half_gap, **values):
    return pt.Driveline(
        pt.Inertia("a", J=J1), pt.Inertia("b", J=J2), pt.Backlash("play", "a", "b", gap=2.0 * half_gap, **values)
    )


def events(response, *elements):
    return [(e.time, e.mode) for e in response.events if not elements or e.element in elements]


def kinds(response):
    return [(e.time, e.kind) for e in response.events]


# --- closed forms


@pytest.mark.parametrize("contact", CONTACTS)
def test_time_of_flight_through_a_gap_and_the_contact_that_follows(contact):
    p, expected = case("gap_time_of_flight")
    J1, J2, k = p["J1"], p["J2"], p["stiffness"]
    car = pair(J1, J2, p["half_gap"], stiffness=k, contact=contact)
    # contact: e = (Ts / k) (1 - cos w t) + (v / w) sin w t, largest where tan w t = -k v / (w Ts)
    closes, v = expected["contact_time"], expected["closing_speed"]
    w, Ts = np.sqrt(k * (J1 + J2) / (J1 * J2)), p["torque"] * J2 / (J1 + J2)
    peak = closes + (np.pi - np.arctan(k * v / (w * Ts))) / w
    t = [0.0, 0.5 * closes, closes, peak, closes + expected["contact_duration"], 0.061]
    response = pt.simulate(car, t, {"a_torque": p["torque"]}, initial_twist={"play": -p["half_gap"]})
    assert events(response) == [(at(t[2]), "right"), (at(t[4]), "gap")]
    assert response["a_speed"][2] - response["b_speed"][2] == pytest.approx(v, rel=1e-12)
    assert response["play_torque"][3] == pytest.approx(expected["peak_torque"], rel=TORQUE)
    assert response["play_torque"][1] == 0.0
    assert response["play_torque"][5] == 0.0


@pytest.mark.parametrize("contact", CONTACTS)
@pytest.mark.parametrize("zeta", [0.0, 0.2])
def test_one_contact_between_free_bodies_gives_back_what_its_damping_leaves(zeta, contact):
    p, expected = case(f"contact_exchange_zeta_{zeta:g}")
    J1, J2, k, v0, half = (p[name] for name in ("J1", "J2", "stiffness", "v0", "half_gap"))
    mu = J1 * J2 / (J1 + J2)
    w, phi = np.sqrt(k / mu), np.arcsin(zeta)
    peak = expected["contact_time"] + (0.5 * np.pi - 3.0 * phi) / (w * np.cos(phi))
    car = pair(J1, J2, half, stiffness=k, damping=p["damping"], contact=contact)
    t = [0.0, expected["contact_time"], peak, expected["separation_time"], 0.0316]
    response = pt.simulate(car, t, None, {"a": v0, "b": 0.0}, initial_twist={"play": -half})
    assert kinds(response)[:2] == [(at(t[1]), "contact"), (at(t[3]), "open")]
    assert response["play_torque"][2] == pytest.approx(expected["peak_torque"], rel=TORQUE)
    assert response["a_speed"][3] == pytest.approx(expected["speed1_after"], rel=1e-11)
    assert response["b_speed"][3] == pytest.approx(expected["speed2_after"], rel=1e-11)
    restitution = (response["b_speed"][-1] - response["a_speed"][-1]) / v0
    assert restitution == pytest.approx(expected["restitution"], rel=1e-11)
    # the shaft is let go while it is still twisted
    assert response["play_twist"][3] - half == pytest.approx(expected.get("residual_compression", 0.0), abs=1e-13)


@pytest.mark.parametrize("contact", CONTACTS)
def test_a_torque_step_through_play_peaks_as_the_energy_of_the_relative_motion_says(contact):
    p, expected = case("tip_in_step_through_backlash")
    car = pair(p["J1"], p["J2"], p["half_gap"], stiffness=p["stiffness"], contact=contact)
    t = [0.0, expected["enters_contact"], expected["time_of_peak"], 0.21]
    response = pt.simulate(
        car,
        t,
        {"a_torque": p["torque"]},
        {"a": p["speed"], "b": p["speed"]},
        initial_load={"a_torque": p["torque_before"]},
    )
    assert events(response) == [(at(expected["leaves_contact"]), "gap"), (at(expected["enters_contact"]), "right")]
    assert response["a_speed"][1] - response["b_speed"][1] == pytest.approx(expected["closing_speed"], rel=1e-11)
    assert response["play_torque"][2] == pytest.approx(192.778755111719, rel=TORQUE)
    assert expected["peak_torque"] == pytest.approx(192.778755111719, rel=1e-14)


@pytest.mark.parametrize("seed", range(8))
def test_clunks_follow_their_formula(seed):
    rng = np.random.default_rng(seed)
    J1, J2, k = *rng.uniform(0.1, 3.0, 2).tolist(), float(10.0 ** rng.uniform(2.0, 4.0))
    half, before, T = rng.uniform(0.01, 0.5), -rng.uniform(5.0, 50.0), rng.uniform(20.0, 200.0)
    mu = J1 * J2 / (J1 + J2)
    Ts, T0, w = T * J2 / (J1 + J2), -before * J2 / (J1 + J2), np.sqrt(k / mu)
    # relative motion: Ts - (Ts + T0) cos w t until it is 0, free fall through the gap, Ts (1 - cos) + k v / w sin
    opens = np.arccos(Ts / (Ts + T0)) / w
    leaves = np.sqrt((Ts + T0) ** 2 - Ts**2) * w / k
    v = np.sqrt(leaves**2 + 4.0 * half * Ts / mu)
    closes = opens + (v - leaves) * mu / Ts
    peak = closes + (np.pi - np.arctan(k * v / (w * Ts))) / w
    car = pair(J1, J2, half, stiffness=k)
    response = pt.simulate(car, [0.0, peak], {"a_torque": T}, initial_load={"a_torque": before})
    assert events(response) == [(at(opens), "gap"), (at(closes), "right")]
    assert response["play_torque"][1] == pytest.approx(Ts + np.sqrt((Ts + T0) ** 2 + 4.0 * half * k * Ts), rel=TORQUE)


@pytest.mark.parametrize("amplitude", [0.06, 0.1, 0.3])
@pytest.mark.parametrize("name", ["free_play_frequency_amplitude", "two_stage_frequency_amplitude"])
def test_periods_of_free_play_and_of_play_beside_a_spring(name, amplitude):
    # two bodies of 2 J have the reduced inertia J; k1 and play of k2 - k1 side by side are k1, then k2
    p, expected = case(name)
    car = pair(2.0 * p["J"], 2.0 * p["J"], p["q1"], stiffness=p["k2"] - p["k1"])
    if p["k1"]:
        car = pt.Driveline(*car, pt.SpringDamper("first_stage", "a", "b", stiffness=p["k1"]))
    period = expected[f"period_at_amplitude_{amplitude:g}"]
    t = period * np.array([0.0, 0.25, 0.5, 1.0, 3.0])
    response = pt.simulate(car, t, initial_twist={"play": amplitude})
    # a quarter of a period of either side, and its end, are where the twist is 0 and the speed 0
    np.testing.assert_allclose(response["play_twist"], amplitude * np.array([1.0, 0.0, -1.0, 1.0, 1.0]), atol=1e-13)
    assert np.abs(response["a_speed"][[0, 2, 3, 4]]).max() < 1e-10 * np.abs(response["a_speed"][1])


@dataclass(frozen=True)
class Push(Element):
    """Torque along with the speed of a node: a drag that is negative."""

    node: str
    rate: float

    @property
    def nodes(self):
        return (self.node,)

    @property
    def laws(self):
        return (Law(self.name, {self.node: 1.0}, {0: Mode("pushes", damping=-self.rate)}),)


def held(name):
    """A node at rest."""
    return pt.Constraint(f"{name}_is_fixed", {name: 1.0})


def test_the_limit_cycle_between_two_damped_flanks():
    p, expected = case("free_play_limit_cycle")
    half, v, T = p["half_gap"], expected["entry_speed"], expected["period"]
    play = pt.Backlash(
        "play", "a", "wall", gap=2 * half, stiffness=p["stiffness"], damping=p["damping"], contact="clipped"
    )
    car = pt.Driveline(pt.Inertia("a", J=p["J"]), play, held("wall"), Push("push", "a", p["negative_drag"]))
    # e' = 0 in contact, e = v exp(-s t) sin(wd t) / wd
    s = 0.5 * (p["damping"] - p["negative_drag"]) / p["J"]
    wd = np.sqrt(p["stiffness"] / p["J"] - s * s)
    turns = np.arctan2(wd, s) / wd
    t = [0.0, turns, 0.5 * T, T, 5.0 * T]
    response = pt.simulate(car, t, None, {"a": v}, initial_twist={"play": half})
    np.testing.assert_allclose(response["play_twist"][2:], [-half, half, half], atol=1e-12)
    np.testing.assert_allclose(response["a_speed"][2:], [-v, v, v], rtol=1e-10)
    assert response["play_twist"][1] == pytest.approx(expected["amplitude"], rel=1e-10)
    lets_go = [time for time, mode in events(response) if mode.endswith("off")]
    enters = [0.0, *(time for time, kind in kinds(response) if kind == "contact")]
    lasts = np.subtract(lets_go[:10], enters[:10])
    np.testing.assert_allclose(lasts, expected["contact_duration"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(np.diff(enters[:10]), 0.5 * T, rtol=0, atol=1e-10)


def test_a_one_way_clutch_makes_a_rectifier():
    p, expected = case("one_way_clutch_rectifier")
    car = pt.Driveline(pt.Inertia("a", J=p["J1"]), pt.Inertia("b", J=p["J2"]), pt.OneWayClutch("freewheel", "a", "b"))
    T, half = p["torque"], 0.5 * p["period"]
    square = pt.samples([0.0, half, half, 0.4, 0.4, 0.6, 0.6], [T, T, -T, -T, T, T, -T])
    inputs = {"a_torque": square, "b_torque": -p["load"]}
    response = pt.simulate(car, [0.0, 0.1, 0.4, expected["lock_time"], 0.6, 0.8], inputs)
    assert kinds(response) == [
        (at(expected["release_time"]), "release"),
        (pytest.approx(0.5555555556, abs=1e-10), "lock"),
        (at(0.6), "release"),
    ]
    assert response.events[1].time == pytest.approx(expected["lock_time"], rel=0, abs=1e-12)
    a, b = response["a_speed"], response["b_speed"]
    assert a[2] == pytest.approx(expected["speed1_before_reversal"], abs=1e-12)
    np.testing.assert_allclose([a[3], b[3]], expected["speed_at_lock"], atol=1e-12)
    np.testing.assert_allclose([a[4], b[4]], expected["speed_after_second_drive"], atol=1e-12)
    # driving: T - (T - TL) J1 / (J1 + J2)
    driving = T - (T - p["load"]) * p["J1"] / (p["J1"] + p["J2"])
    np.testing.assert_allclose(response["freewheel_torque"][:5], [driving, driving, 0.0, driving, 0.0], atol=1e-11)
    assert response.slip_energy == {}  # it takes up no slip


# --- examples of the Modelica Standard Library


def test_modelica_example_backlash():
    # J = 5 at phi = pi / 2; twist of spring and damper is -phi
    p, expected = case("msl_backlash")
    play = pt.Backlash(
        "play",
        "wall",
        "a",
        gap=p["total_gap"],
        stiffness=p["stiffness"],
        damping=p["damping"],
        contact="clipped",
    )
    car = pt.Driveline(pt.Inertia("a", J=p["J"]), play, held("wall"))
    response = pt.simulate(car, [0.0, 0.03, 1.0], initial_twist={"play": -p["phi0"]})
    assert len(response.events) == expected["events_in_1s_elastobacklash2"]
    assert [e.mode for e in response.events[:4]] == ["left, off", "gap", "right", "right, off"]
    times = [e.time for e in response.events[:4]]
    names = ("first_pull_off", "enters_gap", "second_contact", "elastobacklash2_second_pull_off")
    np.testing.assert_allclose(times, [expected[name] for name in names], rtol=0, atol=1e-9)
    np.testing.assert_allclose(times, [p["published"][name] for name in names], rtol=0, atol=1e-7)
    assert response["a_speed"][1] == pytest.approx(expected["gap_speed"], rel=1e-10)
    assert -response["play_twist"][2] == pytest.approx(expected["final_phi_elastobacklash2"], abs=1e-9)


def test_modelica_example_one_way_clutch_until_it_is_engaged():
    p, expected = case("msl_one_way_clutch")
    w = 2.0 * np.pi * p["frequency_hz"]
    car = pt.Driveline(pt.Inertia("a", J=p["J1"]), pt.Inertia("b", J=p["J2"]), pt.OneWayClutch("freewheel", "a", "b"))
    inputs = {"a_torque": lambda t: p["amplitude"] * np.sin(w * t)}
    response = pt.simulate(car, [0.0, expected["release_time"], 0.25], inputs, {"a": -0.5, "b": 0.0})
    # w1 = -0.5 + T / w (1 - cos w t) = 0
    locks = np.arccos(1.0 - 0.5 * w / p["amplitude"]) / w
    expected_events = [
        (pytest.approx(locks, abs=1e-9), "lock"),
        (pytest.approx(0.5 * 2 * np.pi / w, abs=1e-9), "release"),
    ]
    assert kinds(response) == expected_events
    assert locks == pytest.approx(expected["lock_time"], abs=1e-15)
    assert locks == pytest.approx(p["published"]["lock_time"], abs=1e-7)
    assert response["a_speed"][1] == pytest.approx(expected["speed_at_release"], abs=1e-9)


# --- the source's car


def with_play(car, half_gaps_deg, contact):
    """The car with half gaps [degrees] in series with these springs."""

    def changed(e):
        if e.name not in half_gaps_deg:
            return e
        gap = 2.0 * np.radians(half_gaps_deg[e.name])
        return pt.Backlash(e.name, e.a, e.b, gap=gap, stiffness=e.stiffness, damping=e.damping, contact=contact)

    return pt.Driveline(*map(changed, car))


def tipped_in(half_gaps_deg, contact, t):
    """From steady overrun at -30 N m and 200 rad/s to 250 N m from 0.2 s to 0.3 s."""
    car = with_play(pt.examples.conventional(damping="closed"), half_gaps_deg, contact)
    speed = {"engine": 200.0, "vehicle": 200.0 / 18.0 * 0.35}
    torque = pt.ramp(0.2, 0.1, 250.0, -30.0)
    return pt.simulate(car, t, {"engine_torque": torque}, speed, initial_load={"engine_torque": -30.0})


def test_the_cars_tip_in_through_a_clipped_gap():
    _, expected = case("car_tip_in_backlash_drive_shafts")
    t = [0.0, 0.19, expected["time_of_peak"], 2.0]
    response = tipped_in({"drive_shafts": 1.0}, "clipped", t)
    assert events(response) == [
        (at(expected["pull_off"]), "left, off"),
        (at(expected["enters_gap"]), "gap"),
        (at(expected["enters_contact"]), "right"),
    ]
    torque = response["drive_shafts_torque"]
    assert torque[1] == pytest.approx(torque[0], rel=1e-9)  # steady before
    assert torque[2] == pytest.approx(expected["peak_shaft_torque_clip"], rel=TORQUE)
    assert response["engine_speed"][-1] == pytest.approx(expected["engine_speed_at_2s"], rel=1e-11)
    vehicle = response["vehicle_speed"][-1] / 0.35 * 18.0
    assert vehicle == pytest.approx(expected["vehicle_speed_at_2s_reflected"], rel=1e-11)


def test_the_cars_tip_in_through_a_gap_in_which_the_shaft_untwists():
    _, expected = case("car_tip_in_nordin")
    peak = case("car_tip_in_backlash_drive_shafts")[1]["peak_shaft_torque_nordin"]
    response = tipped_in({"drive_shafts": 1.0}, "nordin", [0.0, *np.linspace(0.434, 0.437, 3001)])
    assert events(response) == [(at(expected["contact_opens"]), "gap"), (at(expected["contact_closes"]), "right")]
    # a sample is within half a microsecond of the peak, which is then too low by (16.6 / s)^2 of that squared at most
    assert response["drive_shafts_torque"].max() == pytest.approx(peak, rel=TORQUE)


def test_the_cars_launch_through_a_gap():
    _, expected = case("car_launch_through_gap")
    t, end = np.linspace(0.0, 2.0, 20001), 0.22
    inputs = {"engine_torque": pt.ramp(0.0, end, 350.0), "clutch_capacity": pt.ramp(0.0, end, 370.0)}
    car = pt.examples.conventional(damping="open")
    play = with_play(car, {"drive_shafts": 1.0}, "clipped")
    response = pt.simulate(play, t, inputs, {"engine": pt.rpm(5000)})
    closes, locks = (pytest.approx(expected[name], abs=1e-11) for name in ("gap_closes", "clutch_locks"))
    assert [(e.element, e.kind, e.time) for e in response.events] == [
        ("drive_shafts", "contact", closes),
        ("clutch", "lock", locks),
    ]
    assert response["drive_shafts_torque"].max() == pytest.approx(expected["peak_shaft_torque"], rel=1e-6)
    without = pt.simulate(car, [0.0, 2.0], inputs, {"engine": pt.rpm(5000)})
    assert without.events[-1].time == pytest.approx(expected["clutch_locks_without_gap"], abs=1e-8)


def test_three_gaps_of_the_car_rattle_as_an_integrator_with_short_steps_finds():
    found = json.loads((REFERENCE / "three_gaps.json").read_text())
    p, expected = case("car_tip_in_three_gaps_rattle")
    response = tipped_in(p["half_gaps_deg"], "clipped", [0.0, 2.0])
    name = {
        (0, False): "gap",
        (1, True): "right",
        (-1, True): "left",
        (1, False): "right, off",
        (-1, False): "left, off",
    }
    assert len(found["events"]) == expected["events"] == 99
    modes = [(element, name[flank, pushes]) for _, element, flank, pushes in found["events"]]
    assert [(e.element, e.mode) for e in response.events] == modes
    times = [e.time for e in response.events]
    np.testing.assert_allclose(times, [time for time, *_ in found["events"]], rtol=0, atol=1e-8)
    assert [times[9], times[49], times[98]] == pytest.approx(
        [expected[f"event_{i}"] for i in (10, 50, 99)], rel=0, abs=1e-8
    )
    assert np.diff(times).min() == pytest.approx(expected["shortest_interval"], rel=1e-4)
    assert response["engine_speed"][-1] == pytest.approx(found["engine_speed"], rel=1e-9)


# --- invariances

T = np.linspace(0.0, 1.5, 151)
TORQUE_OF_A = pt.samples([0.1, 0.1, 0.4, 0.5, 0.9, 0.9], [-8.0, 25.0, 25.0, -30.0, -30.0, 12.0])


def chain(contact, ends=("b", "c")):
    """Three bodies, a spring, play, a one-way clutch and a brake."""
    return [
        pt.Inertia("a", J=0.2),
        pt.Inertia("b", J=0.3),
        pt.Inertia("c", J=0.6),
        pt.Inertia("d", J=0.4),
        pt.SpringDamper("shaft", "a", "b", stiffness=900.0, damping=0.4),
        pt.Backlash("play", *ends, gap=0.1, stiffness=1500.0, damping=1.2, contact=contact),
        pt.OneWayClutch("freewheel", "c", "d"),
        pt.Clutch("brake", "c", max_torque=1.5),
    ]


def run(elements, sign=1.0, t=T, names=None):
    named = names or {name: name for name in "ad"}
    inputs = {f"{named['a']}_torque": sign * TORQUE_OF_A, f"{named['d']}_torque": -sign * 0.8}
    return pt.simulate(pt.Driveline(*elements), t, inputs)


MIRRORED = {
    "gap": "gap",
    "right": "left",
    "left": "right",
    "right, off": "left, off",
    "left, off": "right, off",
}


def assert_same_run(one, other, signals, sign=1.0, atol=1e-10):
    assert len(one.events) > 8
    for name in signals:
        np.testing.assert_allclose(sign * one[name], other[name], rtol=0, atol=atol * max(1.0, np.abs(one[name]).max()))


@pytest.mark.parametrize("contact", CONTACTS)
def test_order_of_elements_does_not_matter(contact):
    forward, backward = run(chain(contact)), run(chain(contact)[::-1])
    order = [(at(e.time), e.element, e.mode) for e in forward.events]
    assert [(e.time, e.element, e.mode) for e in backward.events] == order
    assert_same_run(forward, backward, forward.outputs)
    assert backward.slip_energy == pytest.approx(forward.slip_energy, rel=1e-10)


@pytest.mark.parametrize("contact", CONTACTS)
def test_names_do_not_matter(contact):
    # names in another order of the alphabet
    names = dict(zip("abcd", "zyxw", strict=True))
    renamed = [
        pt.Inertia("z", J=0.2),
        pt.Inertia("y", J=0.3),
        pt.Inertia("x", J=0.6),
        pt.Inertia("w", J=0.4),
        pt.SpringDamper("n4", "z", "y", stiffness=900.0, damping=0.4),
        pt.Backlash("n3", "y", "x", gap=0.1, stiffness=1500.0, damping=1.2, contact=contact),
        pt.OneWayClutch("n2", "x", "w"),
        pt.Clutch("n1", "x", max_torque=1.5),
    ]
    elements = {"play": "n3", "freewheel": "n2", "brake": "n1"}
    before, after = run(chain(contact)), run(renamed, names=names)
    expected = [(e.time, elements[e.element], e.mode) for e in before.events]
    assert [(e.time, e.element, e.mode) for e in after.events] == expected
    np.testing.assert_array_equal(before["play_torque"], after["n3_torque"])
    np.testing.assert_array_equal(before["d_speed"], after["w_speed"])


@pytest.mark.parametrize("contact", CONTACTS)
def test_play_with_its_ends_swapped_has_the_other_sign(contact):
    one, other = run(chain(contact)), run(chain(contact, ends=("c", "b")))
    swapped = [(at(time), MIRRORED[mode]) for time, mode in events(one, "play")]
    assert events(other, "play") == swapped
    assert [(e.time, e.mode) for e in other.events if e.element != "play"] == [
        (at(e.time), e.mode) for e in one.events if e.element != "play"
    ]
    assert_same_run(one, other, ("play_torque", "play_twist"), sign=-1.0)
    assert_same_run(one, other, ("a_speed", "b_speed", "c_speed", "d_speed", "freewheel_torque"))


@pytest.mark.parametrize("contact", CONTACTS)
def test_everything_turned_the_other_way_is_the_same(contact):
    other = [e for e in chain(contact) if e.name != "freewheel"] + [pt.OneWayClutch("freewheel", "d", "c")]
    one, mirror = run(chain(contact)), run(other, sign=-1.0)
    turned = {"freewheel": lambda mode: mode, "play": MIRRORED.get, "brake": lambda mode: mode if mode == 2 else -mode}
    expected = [(at(e.time), e.element, turned[e.element](e.mode)) for e in one.events]
    assert [(e.time, e.element, e.mode) for e in mirror.events] == expected
    assert_same_run(one, mirror, ("a_speed", "b_speed", "c_speed", "d_speed", "play_torque", "play_twist"), sign=-1.0)
    assert_same_run(one, mirror, ("freewheel_torque",))


@pytest.mark.parametrize("contact", CONTACTS)
def test_play_seen_through_a_gear_is_wider_and_softer(contact):
    R = 4.0
    geared = [e for e in chain(contact) if e.name != "play"]
    geared += [
        pt.Gear("in", "b", "slow_b", ratio=R),
        pt.Backlash(
            "play", "slow_b", "slow_c", gap=0.1 / R, stiffness=1500.0 * R**2, damping=1.2 * R**2, contact=contact
        ),
        pt.Gear("out", "c", "slow_c", ratio=R),
    ]
    one, other = run(chain(contact)), run(geared)
    assert [(e.time, e.element, e.mode) for e in other.events] == [(at(e.time), e.element, e.mode) for e in one.events]
    np.testing.assert_allclose(other["play_torque"], R * one["play_torque"], atol=1e-8)
    np.testing.assert_allclose(other["play_twist"], one["play_twist"] / R, atol=1e-12)


@pytest.mark.parametrize(("contact", "damping"), [("nordin", 417.6), ("nordin", 0.0), ("clipped", 0.0)])
def test_a_gap_that_vanishes_leaves_the_shaft(contact, damping):
    # the difference goes with the gap; with damping a clipped shaft is another one, since it never pulls
    shaft = pt.examples.conventional(damping="closed").replace("drive_shafts", damping=damping)
    t, speed = np.linspace(0.0, 1.2, 121), {"engine": 200.0, "vehicle": 200.0 / 18.0 * 0.35}
    torque, load = {"engine_torque": pt.ramp(0.2, 0.1, 250.0, -30.0)}, {"engine_torque": -30.0}
    linear = pt.simulate(shaft, t, torque, speed, initial_load=load)["drive_shafts_torque"]
    differences = []
    for half_gap in (1e-4, 1e-5, 1e-6):
        car = with_play(shaft, {"drive_shafts": np.degrees(half_gap)}, contact)
        response = pt.simulate(car, t, torque, speed, initial_load=load)
        difference = np.abs(response["drive_shafts_torque"] - linear)
        assert difference.max() < 20.0 * half_gap * np.abs(linear).max()
        differences.append(difference[t > 0.35].max())  # behind the gap
    np.testing.assert_allclose(np.divide(differences[1:], differences[:-1]), 0.1, rtol=0.05)


# --- energy


@pytest.mark.parametrize("contact", CONTACTS)
def test_work_is_stored_or_becomes_heat(contact):
    coarse = run(chain(contact), t=[0.0, 1.5])
    edges = np.array(sorted({0.0, 1.5, *TORQUE_OF_A.times, *(e.time for e in coarse.events)}))
    nodes, weights = np.polynomial.legendre.leggauss(40)
    width = np.diff(edges)[:, None]
    points = np.concatenate([edges, (edges[:-1, None] + 0.5 * width * (1.0 + nodes)).ravel()])
    order = np.argsort(points)
    t, area = points[order], np.concatenate([np.zeros(len(edges)), (0.5 * width * weights).ravel()])[order]
    fine = run(chain(contact), t=t)
    assert [e.mode for e in fine.events] == [e.mode for e in coarse.events]
    inertia = dict(zip("abcd", (0.2, 0.3, 0.6, 0.4), strict=True))
    moving = sum(0.5 * J * fine[f"{x}_speed"] ** 2 for x, J in inertia.items())
    stored = moving + 0.5 * 900.0 * fine["shaft_twist"] ** 2
    work = sum(area @ (fine[f"{x}_torque"] * fine[f"{x}_speed"]) for x in "ad")
    damped = area @ (fine["shaft_torque"] - 900.0 * fine["shaft_twist"]) ** 2 / 0.4
    torque, slip, twist = fine["play_torque"], fine["b_speed"] - fine["c_speed"], fine["play_twist"]
    into_play = area @ (torque * slip)
    assert work == pytest.approx(stored[-1] - stored[0] + damped + fine.slip_energy["brake"] + into_play, rel=1e-11)
    # at the end the gap is open, for more than 30 times d / k: the shaft keeps nothing
    opened, last = events(fine, "play")[-1]
    assert last == "gap"
    assert 1.5 - opened > 30.0 * 1.2 / 1500.0
    assert fine.slip_energy["play"] == pytest.approx(into_play, rel=1e-9)
    # a one-way clutch takes nothing
    assert np.abs(fine["freewheel_torque"] * (fine["c_speed"] - fine["d_speed"])).max() < 1e-9
    # play takes what its spring stores and its damper loses while it is in contact, and nothing in the gap
    contacts = 0
    for a, b in pairwise(np.searchsorted(t, edges)):
        inside = slice(a + 1, b)
        taken = area[inside] @ (torque * slip)[inside]
        if fine.modes["play"][int(fine["play_mode"][a + 1])] in ("right", "left"):
            energy = 0.5 * 1500.0 * (np.abs(twist[[a, b]]) - 0.05) ** 2
            lost = 1.2 * area[inside] @ slip[inside] ** 2
            assert taken == pytest.approx(energy[1] - energy[0] + lost, rel=1e-9, abs=1e-12)
            contacts += 1
        else:
            assert taken == 0.0
    assert contacts > 3


# --- what is refused


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"gap": -0.1}, "play: gap = -0.1 rad, permitted: > 0 and finite"),
        ({"gap": 0.0}, "play: gap = 0.0 rad, permitted: > 0 and finite"),
        ({"stiffness": -5.0}, "play: stiffness = -5.0 N m/rad, permitted: > 0 and finite"),
        ({"damping": -1.0}, "play: damping = -1.0 N m s/rad, permitted: >= 0 and finite"),
        ({"contact": "rigid"}, 'play: contact = \'rigid\', permitted: "nordin", "clipped"'),
        ({"contact": None}, 'play: contact = None, permitted: "nordin", "clipped"'),
    ],
)
def test_values_that_play_cannot_have_are_named(values, message):
    with pytest.raises(pt.ParameterError) as error:
        pt.Backlash("play", "a", "b", **{"gap": 0.1, "stiffness": 1e3, **values})
    assert str(error.value) == message


def test_linear_models_refuse_play_and_one_way_clutches_by_name():
    for element in (pt.Backlash("odd", "a", "b", gap=0.1, stiffness=1e3), pt.OneWayClutch("odd", "a", "b")):
        car = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), element)
        for linear in (pt.assemble, pt.modes, pt.poles, pt.state_space, pt.two_mass):
            with pytest.raises(pt.PowertrainError, match="odd: is not linear"):
                linear(car)
