"""Clutches of random drivelines against an integrator that shares nothing with the package but the elements."""

import os
import random

import numpy as np
import pytest
from event_located import integrated, merged

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.signals import PiecewiseLinear

# More of them for a campaign: POWERTRAIN_CASES=3000
CASES = int(os.environ.get("POWERTRAIN_CASES", 12))


def launch(seed):
    """Two to five bodies on springs, gears and one to three clutches or brakes; ramps and jumps of torque and capacity."""
    rng = random.Random(seed)
    bodies = [f"n{i}" for i in range(rng.randint(2, 5))]
    elements = [pt.Inertia(body, J=round(10.0 ** rng.uniform(-1.5, 0.5), 3)) for body in bodies]
    inputs, tree = {}, []
    for i, body in enumerate(bodies[1:]):
        parent = rng.choice(bodies[: i + 1])
        tree.append((parent, body))
        kind = rng.choice(["clutch", "clutch", "spring", "gear"])
        if kind == "clutch":
            elements.append(pt.Clutch(f"c{i}", parent, body, max_torque=round(rng.uniform(5.0, 60.0), 1)))
        elif kind == "spring":
            k, d = round(10.0 ** rng.uniform(2.5, 4.0)), round(rng.uniform(0.0, 2.0), 2)
            elements.append(pt.SpringDamper(f"s{i}", parent, body, stiffness=k, damping=d))
        else:
            elements += [
                pt.Gear(f"g{i}", parent, f"m{i}", ratio=rng.choice([0.5, 2.0, 3.0, -1.5])),
                pt.SpringDamper(f"s{i}", f"m{i}", body, stiffness=round(10.0 ** rng.uniform(3.0, 4.0)), damping=0.3),
            ]
    if rng.random() < 0.4 or not any(isinstance(element, pt.Clutch) for element in elements):
        elements.append(pt.Clutch("brake", rng.choice(bodies), max_torque=round(rng.uniform(2.0, 30.0), 1)))
    car = pt.Driveline(*elements)
    for clutch in car.clutches:
        if rng.random() < 0.6:
            times = sorted(round(rng.uniform(0.0, 0.8), 3) for _ in range(3))
            values = [rng.choice([0.0, round(rng.uniform(5.0, 70.0), 1)]) for _ in times]
            inputs[f"{clutch}_capacity"] = PiecewiseLinear(tuple(times), tuple(values))
    node = rng.choice(bodies)
    times = sorted(round(rng.uniform(0.0, 0.8), 3) for _ in range(2))
    inputs[f"{node}_torque"] = PiecewiseLinear(tuple(times), tuple(round(rng.uniform(-60.0, 60.0), 1) for _ in times))
    return car, inputs, {rng.choice(bodies): round(rng.uniform(-60.0, 60.0), 1)}


@pytest.mark.parametrize("seed", range(CASES))
def test_events_and_speeds_are_those_of_an_independent_integrator(seed):
    car, inputs, speed = launch(seed)
    response = pt.simulate(car, [0.0, 1.0], inputs, speed)
    start = {node: float(response[f"{node}_speed"][0]) for node in car.nodes}
    changes, X, machine = integrated(car, inputs, start, 1.0)
    modes = [int(response[f"{clutch.name}_mode"][0]) for clutch in machine.laws]
    names, mine = [clutch.name for clutch in machine.laws], []
    for event in response.events:
        modes[names.index(event.element)] = event.mode
        mine.append((event.time, tuple(modes)))
    expected, found = merged(changes), merged(mine)
    assert [m for _, m in found] == [m for _, m in expected]
    np.testing.assert_allclose([t for t, _ in found], [t for t, _ in expected], rtol=0, atol=1e-6)
    speeds = machine.Z @ X[machine.r : machine.r + machine.n]
    for node, value in zip(machine.nodes, speeds, strict=True):
        assert response.final.speed[node] == pytest.approx(value, abs=1e-6)
