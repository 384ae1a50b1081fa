"""Random loops closed by control.interconnect around the discrete system, against the same loops stepped by hand."""

import os
import random
from typing import NamedTuple

import control
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.base.systems import linear_system

# More of them for a campaign: POWERTRAIN_CASES=500
CASES = int(os.environ.get("POWERTRAIN_CASES", 15))


class Block(NamedTuple):
    """A discrete controller ``x+ = update(x, u)``, ``y = output(x, u)``; ``reads`` names what it sees."""

    name: str
    reads: tuple
    output: object
    update: object = None
    start: float = 0.0
    delayed: bool = False  # y does not depend on u, which may then be a torque

    def system(self, dt):
        inputs = [f"u{i}" for i in range(len(self.reads))]
        labels = {"inputs": inputs, "outputs": ["y"], "name": self.name, "dt": dt}
        if self.delayed:  # linear, of one input
            b = self.update(0.0, [1.0])
            return linear_system([[self.update(1.0, [0.0])]], [[b]], [[self.output(1.0, None)]], [[0.0]], **labels)
        if self.update is None:
            return control.nlsys(None, lambda t, x, u, params: [self.output(None, u)], **labels)
        return control.nlsys(
            lambda t, x, u, params: [self.update(x[0], u)],
            lambda t, x, u, params: [self.output(x[0], u)],
            states=["x"],
            **labels,
        )


class Loop(NamedTuple):
    car: pt.Driveline
    dt: float
    speed: dict
    blocks: list
    drives: dict  # input of the driveline: what is added to it
    external: dict  # signal: samples


def driveline(rng):
    """Bodies on springs, gears, planetary sets and one to three clutches or brakes, with or without ground."""
    bodies = [f"n{i}" for i in range(rng.randint(2, 5))]
    elements = [pt.Inertia(body, J=round(10.0 ** rng.uniform(-1.3, 0.5), 3)) for body in bodies]
    clutches = 0
    for i, body in enumerate(bodies[1:]):
        parent = rng.choice(bodies[: i + 1])
        kind = rng.choice(["clutch", "clutch", "spring", "gear", "geared spring", "planetary"])
        stiffness, damping = round(10.0 ** rng.uniform(2.5, 4.3)), round(rng.uniform(0.1, 5.0), 2)
        if kind == "clutch" and clutches < 2:
            clutches += 1
            ratio = rng.choice([1.0, 1.0, 1.3])
            elements.append(pt.Clutch(f"c{i}", parent, body, max_torque=40.0, static_ratio=ratio))
        elif kind == "gear":
            elements.append(pt.Gear(f"g{i}", parent, body, ratio=rng.choice([0.5, 2.0, 3.0, -1.5])))
        elif kind == "geared spring":
            elements.append(pt.Gear(f"g{i}", parent, f"m{i}", ratio=rng.choice([0.5, 2.0, 3.0, -1.5])))
            elements.append(pt.SpringDamper(f"s{i}", f"m{i}", body, stiffness=stiffness, damping=damping))
        elif kind == "planetary":
            elements.append(pt.Inertia(f"p{i}", J=0.2))
            elements.append(pt.Planetary(f"g{i}", parent, body, f"p{i}", ratio=2.0))
        else:
            elements.append(pt.SpringDamper(f"s{i}", parent, body, stiffness=stiffness, damping=damping))
    if not clutches or rng.random() < 0.4:
        elements.append(pt.Clutch("brake", rng.choice(bodies), max_torque=20.0))
    if rng.random() < 0.25:
        elements.append(pt.Drag("ground", rng.choice(bodies), stiffness=rng.choice([0.0, 300.0]), damping=0.5))
    return pt.Driveline(*elements), bodies


def controllers(rng, car, bodies, dt, steps):
    """Blocks, what drives each input of the driveline, and the samples of the signals from outside."""
    blocks, drives, external = [], {}, {}
    names = iter(f"b{i}" for i in range(100))

    def add(reads, output, update=None, start=0.0, delayed=False):
        blocks.append(Block(next(names), tuple(reads), output, update, start, delayed))
        return blocks[-1].name

    def held(values):
        """Samples that jump two to five times."""
        jumps = sorted(rng.randrange(steps) for _ in range(rng.randint(2, 5)))
        name = f"external{len(external)}"
        external[name] = np.array([values[np.searchsorted(jumps, k, side="right") % len(values)] for k in range(steps)])
        return name

    def limited(signal, low, high):
        return add([signal], lambda x, u: min(max(u[0], low), high))

    def lagged(signal):
        """A lag of first order, or a delay of one sample."""
        a = rng.choice([0.0, 0.5, 0.9])
        return add([signal], lambda x, u: x, lambda x, u: a * x + (1.0 - a) * u[0], delayed=True)

    alone = rng.random() < 0.2  # one controller, which leaves python-control the fewest passes
    for body in bodies:
        J, kind = car[body].J, rng.choice(["none", "torque", "P", "PI", "P lagged", "P and torque", "damping"])
        if alone:
            kind = "P and torque" if body == bodies[0] else rng.choice(["none", "torque"])
        gain = rng.uniform(0.02, 0.3) * J / dt
        signals = []
        if kind.startswith("P"):
            reference, speed = held([round(rng.uniform(-60.0, 60.0), 1) for _ in range(3)]), f"{body}_speed"
            if kind == "P lagged":
                speed = lagged(speed)
            if kind == "PI":
                part = 0.05 * gain
                signal = add(
                    [reference, speed],
                    lambda x, u, gain=gain: gain * (u[0] - u[1]) + x,
                    lambda x, u, part=part: x + part * (u[0] - u[1]),
                    start=1.0,
                )
            elif kind == "P and torque":
                # the torque of a clutch, which follows from the output, is only looked at for the next sample
                signal = add(
                    [reference, speed, f"{rng.choice(car.clutches)}_torque"],
                    lambda x, u, gain=gain: gain * (u[0] - u[1]) - 0.2 * x,
                    lambda x, u: 0.5 * x + 0.5 * u[2],
                )
            else:
                signal = add([reference, speed], lambda x, u, gain=gain: gain * (u[0] - u[1]))
            signals.append(limited(signal, -50.0, 80.0) if not alone and rng.random() < 0.6 else signal)
        if kind == "torque":
            signals.append(held([round(rng.uniform(-50.0, 50.0), 1) for _ in range(3)]))
        if kind == "damping":
            felt = lagged(rng.choice([f"{body}_acceleration", *(f"{c}_torque" for c in car.clutches)]))
            size = 0.1 * J if blocks[-1].reads[0].endswith("acceleration") else 0.3
            signals.append(add([felt], lambda x, u, size=size: -size * u[0]))
        if signals:
            drives[f"{body}_torque"] = signals
    for clutch in car.clutches:
        kind = "table" if alone else rng.choice(["table", "slip", "slip PI", "bias", "torque", "mode"])
        high = round(rng.uniform(10.0, 80.0), 1)
        slip = f"{clutch}_slip_speed"
        if kind == "table":
            signal = held([0.0, high, rng.choice([0.0, 0.4 * high])])
        elif kind == "slip":
            gain, target = rng.uniform(0.1, 3.0), rng.uniform(0.0, 20.0)
            signal = limited(add([slip], lambda x, u, gain=gain, target=target: gain * (abs(u[0]) - target)), 0.0, high)
        elif kind == "slip PI":
            target = held([5.0, 20.0, 0.0])
            signal = add(
                [slip, target],
                lambda x, u: max(0.5 * (abs(u[0]) - u[1]) + x, 0.0),
                lambda x, u, high=high: min(max(x + 0.05 * (abs(u[0]) - u[1]), 0.0), high),
                start=high / 2,
            )
        elif kind == "bias":
            # negative as long as python-control has not yet brought the bias to it
            bias = limited(held([5.0, 15.0]), 5.0, 15.0)
            signal = add([slip, bias], lambda x, u: 0.5 * abs(u[0]) + u[1] - 5.0)
        elif kind == "torque":
            felt = lagged(f"{clutch}_torque")
            signal = add([felt, held([0.0, 5.0, 15.0])], lambda x, u: 1.2 * abs(u[0]) + u[1])
        else:
            delayed = add([f"{clutch}_mode"], lambda x, u: x, lambda x, u: u[0], delayed=True)
            signal = add([delayed], lambda x, u, high=high: high if round(u[0]) == 0 else 0.5 * high)
        drives[f"{clutch}_capacity"] = [signal]
    return blocks, drives, external


def closed_loop(seed):
    rng = random.Random(seed)
    car, bodies = driveline(rng)
    dt = rng.choice([0.0005, 0.001, 0.0025, 0.005, 0.01])
    steps, blocks = rng.randint(50, 90), []
    while not blocks:
        blocks, drives, external = controllers(rng, car, bodies, dt, steps)
    return Loop(car, dt, {rng.choice(bodies): round(rng.uniform(-60.0, 60.0), 1)}, blocks, drives, external)


def interconnected(loop, seed):
    """(nodes, N) ndarray: speeds of the loop as python-control connects and steps it."""
    plant = pt.nonlinear_system(loop.car, dt=loop.dt, hold="zero")
    systems = [plant, *(block.system(loop.dt) for block in loop.blocks)]
    random.Random(seed).shuffle(systems)
    blocks = {block.name for block in loop.blocks}

    def source(signal):
        return f"{signal}.y" if signal in blocks else f"driveline.{signal}"

    into = [(f"driveline.{name}", signals) for name, signals in loop.drives.items()]
    into += [(f"{b.name}.u{i}", [signal]) for b in loop.blocks for i, signal in enumerate(b.reads)]
    connections = [
        [sink, source(signal)] for sink, signals in into for signal in signals if signal not in loop.external
    ]
    entries = [[sink for sink, signals in into if signal in signals] for signal in loop.external]
    nodes = loop.car.nodes
    connected = control.interconnect(
        systems,
        connections=connections,
        inplist=entries,
        inputs=list(loop.external),
        outlist=[f"driveline.{node}_speed" for node in nodes],
        outputs=list(nodes),
        check_unused=False,
    )
    start = {"driveline": pt.initial_state(plant, loop.car, loop.speed)} | {b.name: [b.start] for b in loop.blocks}
    start = np.concatenate([start[system.name] for system in systems if system.nstates])
    steps = len(next(iter(loop.external.values()), np.zeros(80)))
    u = np.array(list(loop.external.values())).reshape(-1, steps)
    return control.input_output_response(connected, loop.dt * np.arange(steps), u, start, squeeze=False).outputs


def by_hand(loop):
    """(nodes, N) ndarray: speeds of the loop, one `simulate` from sample to sample."""
    steps = len(next(iter(loop.external.values()), np.zeros(80)))
    states = {block.name: block.start for block in loop.blocks}
    state, found = None, []
    speed = pt.simulate(loop.car, [0.0, 1e-9], {f"{c}_capacity": 0.0 for c in loop.car.clutches}, loop.speed)
    sensed = {name: float(speed[name][0]) for name in speed.outputs if name.endswith("_speed")}
    for k in range(steps):
        signals = {name: float(values[k]) for name, values in loop.external.items()} | sensed
        signals |= {b.name: b.output(states[b.name], None) for b in loop.blocks if b.delayed}
        for block in loop.blocks:
            if not block.delayed:
                signals[block.name] = block.output(
                    states[block.name], [signals.get(name, np.nan) for name in block.reads]
                )
        inputs = {name: sum(signals[signal] for signal in drive) for name, drive in loop.drives.items()}
        start = {"initial_speed": loop.speed} if state is None else {"initial_state": state}
        response = pt.simulate(loop.car, [k * loop.dt, (k + 1) * loop.dt], inputs, **start)
        signals |= {name: float(response[name][0]) for name in response.outputs if name not in sensed}
        found.append([sensed[f"{node}_speed"] for node in loop.car.nodes])
        for block in loop.blocks:
            if block.update is not None:
                states[block.name] = block.update(states[block.name], [signals[name] for name in block.reads])
        state = response.final
        sensed = {name: float(response[name][-1]) for name in sensed}
    return np.transpose(found)


@pytest.mark.parametrize("seed", range(CASES))
def test_a_loop_that_python_control_connects_is_the_one_stepped_by_hand(seed):
    loop = closed_loop(seed)
    expected = by_hand(loop)
    speeds = interconnected(loop, seed)
    np.testing.assert_allclose(speeds, expected, rtol=0, atol=1e-9 * max(1.0, np.abs(expected).max()))
