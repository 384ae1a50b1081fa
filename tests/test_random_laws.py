"""Clutches, one-way clutches and play in random trees against an integrator that shares the elements only."""

import os
import random

import numpy as np
import pytest
from event_located import integrated, merged

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.signals import PiecewiseLinear

# More of them for a campaign: POWERTRAIN_CASES=300
CASES = int(os.environ.get("POWERTRAIN_CASES", 8))
END = 0.8


def play(rng, name, a, b):
    k = round(10.0 ** rng.uniform(2.3, 4.0))
    damping = rng.choice([0.0, round(10.0 ** rng.uniform(-1.0, 1.0), 2)])
    gap, contact = round(10.0 ** rng.uniform(-2.5, -0.5), 4), rng.choice(["nordin", "clipped"])
    return pt.Backlash(name, a, b, gap=gap, stiffness=k, damping=damping, contact=contact)


def drive(seed):
    """Chain or tree of two to six bodies, one to three laws and a brake perhaps; inputs, speeds and twists to start from."""
    rng = random.Random(seed)
    bodies = [f"n{i}" for i in range(rng.randint(2, 6))]
    elements = [pt.Inertia(body, J=round(10.0 ** rng.uniform(-1.5, 0.5), 3)) for body in bodies]
    is_chain, links = rng.random() < 0.5, len(bodies) - 1
    laws = set(rng.sample(range(links), min(links, rng.randint(1, 3))))
    for i, body in enumerate(bodies[1:]):
        parent = bodies[i] if is_chain else rng.choice(bodies[: i + 1])
        ends = (parent, body) if rng.random() < 0.7 else (body, parent)
        kind = rng.choice(["play", "play", "freewheel", "clutch"]) if i in laws else rng.choice(["spring", "gear"])
        if kind == "play":
            elements.append(play(rng, f"p{i}", *ends))
        elif kind == "freewheel":
            elements.append(pt.OneWayClutch(f"f{i}", *ends))
        elif kind == "clutch":
            elements.append(pt.Clutch(f"c{i}", *ends, max_torque=round(rng.uniform(3.0, 40.0), 1)))
        else:
            k, d = round(10.0 ** rng.uniform(2.5, 4.0)), round(rng.uniform(0.0, 2.0), 2)
            if kind == "gear":
                elements.append(pt.Gear(f"g{i}", ends[0], f"m{i}", ratio=rng.choice([0.5, 2.0, 3.0, -1.5])))
                ends = (f"m{i}", ends[1])
            elements.append(pt.SpringDamper(f"s{i}", *ends, stiffness=k, damping=d))
    if rng.random() < 0.2 and len(laws) < 3:
        elements.append(pt.Clutch("brake", rng.choice(bodies), max_torque=round(rng.uniform(1.0, 10.0), 1)))
    car = pt.Driveline(*elements)
    inputs = {}
    for clutch in car.clutches:
        if rng.random() < 0.5:
            times = sorted(round(rng.uniform(0.0, END), 3) for _ in range(3))
            values = [rng.choice([0.0, round(rng.uniform(5.0, 50.0), 1)]) for _ in times]
            inputs[f"{clutch}_capacity"] = PiecewiseLinear(tuple(times), tuple(values))
    for node in rng.sample(bodies, min(len(bodies), 2)):
        times = sorted(round(rng.uniform(0.0, END), 3) for _ in range(3))
        times = sorted([*times, rng.choice(times)])  # a jump
        values = [round(rng.uniform(-40.0, 40.0), 1) for _ in times]
        inputs[f"{node}_torque"] = PiecewiseLinear(tuple(times), tuple(values))
    plays = [e for e in car if isinstance(e, pt.Backlash)]
    twist = {e.name: round(rng.uniform(-0.8, 0.8) * e.gap, 5) for e in plays if rng.random() < 0.5}
    freewheels = [e for e in car if isinstance(e, pt.OneWayClutch)]
    speed = {} if freewheels else {rng.choice(bodies): round(rng.uniform(-20.0, 20.0), 1)}
    if len(freewheels) == 1:  # its driven end is ahead
        speed = {freewheels[0].a: 0.0, freewheels[0].b: round(rng.uniform(0.0, 20.0), 1)}
    return car, inputs, speed, twist


# 157 and 264: one-way clutches whose torque grows from rest as the square of time
@pytest.mark.parametrize("seed", sorted({*range(CASES), 157, 264}))
def test_events_and_speeds_are_those_of_an_independent_integrator(seed):
    car, inputs, speed, twist = drive(seed)
    response = pt.simulate(car, [0.0, END], inputs, speed, initial_twist=twist)
    start = {node: float(response[f"{node}_speed"][0]) for node in car.nodes}
    turned = {e.name: float(response[f"{e.name}_twist"][0]) for e in car if f"{e.name}_twist" in response}
    changes, X, machine = integrated(car, inputs, start, END, turned)
    names = [law.name for law in machine.laws]
    modes, mine = [int(response[f"{name}_mode"][0]) for name in names], []
    number = {name: {mode: n for n, mode in response.modes[name].items()} for name in names}
    for event in response.events:
        given = number[event.element].get(event.mode, event.mode)
        modes[names.index(event.element)] = given
        mine.append((event.time, tuple(modes)))
    expected, found = merged(changes), merged(mine)
    assert [m for _, m in found] == [m for _, m in expected]
    np.testing.assert_allclose([t for t, _ in found], [t for t, _ in expected], rtol=0, atol=1e-6)
    speeds = machine.Z @ X[machine.speeds]
    for node, value in zip(machine.nodes, speeds, strict=True):
        assert response.final.speed[node] == pytest.approx(value, abs=1e-6)
