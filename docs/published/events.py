"""Clutches, play and friction from event to event: examples of the Modelica Standard Library and closed forms."""

import json

import numpy as np

import powertrain_ctrl as pt

from . import REFERENCE, Case, Row, reference

LAWS = reference("laws_cases")
MODELICA = "Modelica Standard Library 4, `Rotational.Examples`; results of Dymola at a tolerance of 1e-6."
# Dymola's own error [s] in these examples, as the same events computed in two exact ways show it.
DYMOLA_TIME = 1e-7
DYMOLA_CLUTCHES = 1e-5


def coupled_clutches() -> Case:
    data = json.loads((REFERENCE / "coupled_clutches.json").read_text())
    car = pt.Driveline(
        *(pt.Inertia(f"J{i}", J=1.0) for i in (1, 2, 3, 4)),
        *(pt.Clutch(f"clutch{i}", f"J{i}", f"J{i + 1}", max_torque=0.0, static_ratio=1.1) for i in (1, 2, 3)),
    )
    inputs = {
        "J1_torque": lambda t: 10.0 * np.sin(2.0 * np.pi * 5.0 * t),
        "clutch1_capacity": lambda t: max(0.0, 10.0 * np.cos(2.0 * np.pi * 0.2 * t)),
        "clutch2_capacity": pt.step(0.4, 10.0),
        "clutch3_capacity": pt.step(0.9, 10.0),
    }
    response = pt.simulate(car, np.linspace(0.0, 1.5, 301), inputs, {"J1": 10.0})
    published = [event["t"] for event in data["events_published"] if not event["start_flag"]][1:]
    rows = [
        Row(f"{event.element}: {event.kind}", t, event.time, "s", DYMOLA_CLUTCHES)
        for event, t in zip(response.events, published, strict=True)
    ]
    return Case("CoupledClutches", MODELICA, tuple(rows))


def backlash() -> Case:
    p = LAWS["msl_backlash"]["parameters"]
    names = ("first_pull_off", "enters_gap", "second_contact", "elastobacklash2_second_pull_off")
    values = {"gap": p["total_gap"], "stiffness": p["stiffness"], "damping": p["damping"], "contact": "clipped"}
    car = pt.Driveline(
        pt.Inertia("a", J=p["J"]),
        pt.Backlash("play", "wall", "a", **values),
        pt.Constraint("wall_is_fixed", {"wall": 1.0}),
    )
    response = pt.simulate(car, [0.0, 0.1], initial_twist={"play": -p["phi0"]})
    rows = [
        Row(name.removeprefix("elastobacklash2_").replace("_", " "), p["published"][name], event.time, "s", DYMOLA_TIME)
        for name, event in zip(names, response.events, strict=False)
    ]
    return Case("Backlash (`ElastoBacklash2`)", MODELICA, tuple(rows))


def one_way_clutch() -> Case:
    p = LAWS["msl_one_way_clutch"]["parameters"]
    car = pt.Driveline(pt.Inertia("a", J=p["J1"]), pt.Inertia("b", J=p["J2"]), pt.OneWayClutch("freewheel", "a", "b"))
    torque = pt.harmonic(p["amplitude"], 2.0 * np.pi * p["frequency_hz"], -0.5 * np.pi)
    response = pt.simulate(car, [0.0, 0.25], {"a_torque": torque}, {"a": -0.5, "b": 0.0})
    row = Row("locks", p["published"]["lock_time"], response.events[0].time, "s", DYMOLA_TIME)
    return Case("OneWayClutch, until it is engaged", MODELICA, (row,))


def step_through_play() -> Case:
    case = LAWS["tip_in_step_through_backlash"]
    p, e = case["parameters"], {name: value["value"] for name, value in case["expected"].items()}
    car = pt.Driveline(
        pt.Inertia("a", J=p["J1"]),
        pt.Backlash("play", "a", "b", gap=2.0 * p["half_gap"], stiffness=p["stiffness"]),
        pt.Inertia("b", J=p["J2"]),
    )
    t = [0.0, e["enters_contact"], e["time_of_peak"]]
    speed = {"a": p["speed"], "b": p["speed"]}
    before = {"initial_load": {"a_torque": p["torque_before"]}}
    response = pt.simulate(car, t, {"a_torque": p["torque"]}, speed, **before)
    leaves, enters = response.events[:2]
    closing = response["a_speed"][1] - response["b_speed"][1]
    rows = (
        Row("leaves contact", e["leaves_contact"], leaves.time, "s", 1e-11),
        Row("enters contact", e["enters_contact"], enters.time, "s", 1e-11),
        Row("closing speed", e["closing_speed"], float(closing), "rad/s", 1e-9),
        Row("peak torque", e["peak_torque"], float(response["play_torque"][2]), "N m", 1e-8),
    )
    return Case("Torque step through play, two masses", "Closed form, from the energy of the relative motion.", rows)


def judder() -> Case:
    case = LAWS["judder_growth_and_stick_slip"]
    p, e = case["parameters"], {name: value["value"] for name, value in case["expected"].items()}
    high, mu0 = 50.0, p["mu0"]
    friction = ((0.0, 1.0), (high, 1.0 + p["mu_slope"] / mu0 * high))
    car = pt.Driveline(
        # so heavy that its speed is constant
        pt.Inertia("drive", J=1e11),
        pt.Inertia("disc", J=p["J"]),
        pt.Drag("spring", "disc", damping=p["damping"], stiffness=p["stiffness"]),
        pt.Clutch("clutch", "drive", "disc", max_torque=p["normal_torque"] * mu0, friction=friction),
    )
    rest = p["normal_torque"] * (mu0 + p["mu_slope"] * p["drive_speed"]) / p["stiffness"]
    start = {"initial_speed": {"drive": p["drive_speed"], "disc": p["w_init"]}, "initial_twist": {"spring": rest}}
    events = pt.simulate(car, [0.0, 2.0], **start).events
    locks, slips = ([event.time for event in events if event.kind == kind] for kind in ("lock", "slip"))
    rows = (
        Row("first sticks", e["first_stick"], locks[0], "s", case["tolerance"]),
        Row("first slips again", e["first_break"], slips[0], "s", case["tolerance"]),
        Row("period of stick and slip", e["stick_slip_period"], locks[-1] - locks[-2], "s", case["tolerance"]),
    )
    text = "Closed form; criterion as in Centea, Rahnejat, Menday 2001 and Crowther et al. 2004."
    return Case("Judder: friction that falls with slip", text, rows)


def coulomb_decay() -> Case:
    case = LAWS["coulomb_and_spring_free_decay"]
    p, e = case["parameters"], {name: value["value"] for name, value in case["expected"].items()}
    car = pt.Driveline(
        pt.Inertia("J", J=p["J"]),
        pt.Drag("spring", "J", damping=0.0, stiffness=p["stiffness"], friction=p["friction"]),
    )
    response = pt.simulate(car, [0.0, 0.5], initial_twist={"spring": p["q0"]})
    rows = (
        Row("comes to rest", e["time_of_rest"], response.events[-1].time, "s", 1e-12),
        Row("twist at rest", e["twist_at_rest"], response.final.twist["spring"], "rad", 1e-12),
        Row("heat", e["heat"], response.slip_energy["spring"], "J", 1e-11),
    )
    return Case("Spring with Coulomb friction, let go", "Closed form: 2 F/k less each half cycle.", rows)


def cases() -> list[Case]:
    return [coupled_clutches(), backlash(), one_way_clutch(), step_through_play(), judder(), coulomb_decay()]
