"""Inputs given as samples: many pieces at once equal piece by piece, events and all."""

import os
from itertools import pairwise

import numpy as np
import pytest
import scipy.linalg

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.model import plants_of
from powertrain_ctrl.hybrid.run import Run
from powertrain_ctrl.hybrid.segment import Segment
from powertrain_ctrl.hybrid.signals import Pieces
from powertrain_ctrl.hybrid.starts import initial_speeds
from powertrain_ctrl.hybrid.trace import Trace

CAR = pt.examples.conventional(damping="open")
T = np.linspace(0.0, 3.5, 3501)
SEEDS = range(int(os.environ.get("POWERTRAIN_CASES", 8)))


def noisy_launch(seed=0):
    random = np.random.default_rng(seed)
    torque, capacity = pt.ramp(1.5, 0.22, 350.0)(T), pt.ramp(1.5, 0.22, 370.0)(T)
    torque[1500:] += random.normal(0.0, 20.0, 2001)
    capacity[1500:] *= 1.0 + 0.05 * np.sin(np.arange(2001.0))
    return {"engine_torque": torque, "clutch_capacity": capacity}


def piece_by_piece(car, t, values, start):
    """Events and states at the samples, each piece by the event search alone."""
    plants = plants_of(car)
    plant, model = plants.slipping, plants.model
    x = plant.state(np.zeros(plant.r), initial_speeds(model, start))
    run = Run(plants, x, plants.unknown, float(t[0]))
    table = np.array(
        [np.broadcast_to(values.get(name, plants.capacity.get(name, 0.0)), t.shape) for name in plants.inputs]
    )
    states = []
    for k, h in enumerate(np.diff(t)):
        line = np.stack([table[:, k], (table[:, k + 1] - table[:, k]) / h], axis=1)
        for _ in run.advance(Segment(line[: len(model.inputs)], line[len(model.inputs) :]), h, float(t[k + 1])):
            pass
        states.append(run.x.copy())
    events = [(plants.names[e.law], e.time) for e in run.events]
    speeds = model.T @ plant.speed(np.array(states).T)
    return events, dict(zip(model.nodes, speeds, strict=True))


def agree(car, t, values, start, time=1e-12, speed=1e-9):
    events, speeds = piece_by_piece(car, t, values, start)
    response = pt.simulate(car, t, values, start)
    assert [e.element for e in response.events] == [name for name, _ in events]
    np.testing.assert_allclose([e.time for e in response.events], [at for _, at in events], rtol=0.0, atol=time)
    size = max(float(np.abs(value).max()) for value in speeds.values())
    for node, value in speeds.items():
        np.testing.assert_allclose(response[f"{node}_speed"][1:], value, rtol=0.0, atol=speed * size)
    return response


def test_a_noisy_launch_has_the_events_and_speeds_of_the_search_piece_by_piece():
    response = agree(CAR, T, noisy_launch(), {"engine": pt.rpm(5000)})
    assert [e.kind for e in response.events] == ["slip", "lock"]


def test_without_events_it_is_the_exact_step_of_the_linear_car():
    t, torque = T[:501], np.random.default_rng(1).normal(0.0, 20.0, 501)
    G = pt.state_space(CAR, "engine_torque", ["engine_speed", "drive_shafts_torque", "vehicle_speed"])
    n = G.nstates
    augmented = np.zeros((n + 2, n + 2))
    augmented[:n, :n], augmented[:n, n], augmented[n, n + 1] = 1e-3 * G.A, 1e-3 * G.B[:, 0], 1.0
    step, x, expected = scipy.linalg.expm(augmented), np.zeros(n), [np.zeros(3)]
    for before, behind in pairwise(torque):
        x = (step @ [*x, before, behind - before])[:n]
        expected.append(G.C @ x)
    response = pt.simulate(CAR, t, {"engine_torque": torque})
    for name, value in zip(G.output_labels, np.transpose(expected), strict=True):
        np.testing.assert_allclose(response[name], value, rtol=0.0, atol=1e-10 * np.abs(value).max())


def test_time_stamps_may_be_uneven_and_other_than_those_of_the_result():
    random, values = np.random.default_rng(2), noisy_launch()
    stamps = T + np.r_[0.0, random.uniform(-4e-4, 4e-4, 3499), 0.0]
    events, speeds = piece_by_piece(CAR, stamps, values, {"engine": pt.rpm(5000)})
    signals = {name: pt.samples(stamps, value) for name, value in values.items()}
    shown = np.linspace(0.0, 3.5, 1234)
    response = pt.simulate(CAR, np.union1d(shown, stamps), signals, {"engine": pt.rpm(5000)})
    np.testing.assert_allclose([e.time for e in response.events], [at for _, at in events], rtol=0.0, atol=1e-12)
    at = np.searchsorted(response.time, stamps[1:])
    np.testing.assert_allclose(response["engine_speed"][at], speeds["engine"], rtol=0.0, atol=1e-9 * 524.0)
    few = pt.simulate(CAR, shown, signals, {"engine": pt.rpm(5000)})
    for name in ("engine_speed", "drive_shafts_torque", "vehicle_acceleration"):
        whole = response[name][np.searchsorted(response.time, shown)]
        np.testing.assert_allclose(few[name], whole, rtol=0.0, atol=1e-8 * np.abs(whole).max())
    assert few.slip_energy["clutch"] == pytest.approx(response.slip_energy["clutch"], rel=1e-11)


def test_the_heat_of_a_trace_is_torque_times_slip_integrated():
    response = pt.simulate(CAR, T, noisy_launch(), {"engine": pt.rpm(5000)})
    fine = np.union1d(np.linspace(0.0, 3.5, 70001), T)
    values = {name: np.interp(fine, T, value) for name, value in noisy_launch().items()}
    again = pt.simulate(CAR, fine, values, {"engine": pt.rpm(5000)})
    power = again["clutch_torque"] * again["clutch_slip_speed"]
    assert response.slip_energy["clutch"] == pytest.approx(np.trapezoid(power, fine), rel=1e-6)


def joint(kind, i, random):
    ends, k, gap = (f"{kind}{i}", f"J{i}", f"J{i + 1}"), float(random.uniform(200.0, 4000.0)), random.uniform(0.01, 0.1)
    if kind == "clutch":
        return pt.Clutch(*ends, max_torque=30.0)
    if kind == "play":
        return pt.Backlash(*ends, gap=float(gap), stiffness=k, damping=0.4)
    if kind == "spring":
        return pt.SpringDamper(*ends, stiffness=k, damping=0.4)
    return pt.OneWayClutch(*ends)


@pytest.mark.parametrize("seed", SEEDS)
def test_random_drivelines_with_noisy_inputs_have_the_same_events(seed):
    random = np.random.default_rng(seed)
    count, t = int(random.integers(3, 7)), np.linspace(0.0, 1.0, 201)
    elements = [pt.Inertia(f"J{i}", J=float(random.uniform(0.02, 0.4))) for i in range(count)]
    kinds = ["clutch", "play", "spring", *random.choice(["clutch", "play", "spring", "one_way"], count - 3)][
        : count - 1
    ]
    elements += [joint(kind, i, random) for i, kind in enumerate(random.permutation(kinds))]
    car = pt.Driveline(*elements)
    values = {"J0_torque": random.normal(0.0, 15.0, 201) + 10.0 * np.sin(9.0 * t)}
    values |= {f"{c.name}_capacity": np.abs(random.normal(8.0, 4.0, 201)) for c in elements if isinstance(c, pt.Clutch)}
    # a contact that grazes makes much of a rounding
    agree(car, t, values, {}, time=1e-9, speed=1e-6)


def test_a_trace_says_how_far_it_is_safe():
    # slip 10 rad/s that falls by 4 rad/s^2: from 2.5 s on the clutch could lock
    pair = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Clutch("clutch", "a", "b", max_torque=2.0))
    plants = plants_of(pair)
    x = plants.slipping.state(np.zeros(0), initial_speeds(plants.model, {"a": 10.0}))
    edges = np.linspace(0.0, 4.0, 401)
    lines = np.zeros((400, 3, 2))
    lines[:, 2, 0] = 2.0
    trace = Trace(plants.slipping, (1,), x, Pieces(edges, lines))
    assert trace.safe in (249, 250)
    assert trace.heat(2.0) == pytest.approx([2.0 * (10.0 * 2.0 - 0.5 * 4.0 * 2.0**2)])
