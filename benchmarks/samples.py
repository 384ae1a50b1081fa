"""Inputs given as samples, against the event search piece by piece and against python-control."""

import control
import numpy as np

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.discrete import DiscreteDriveline
from powertrain_ctrl.hybrid.model import plants_of
from powertrain_ctrl.hybrid.run import Run
from powertrain_ctrl.hybrid.segment import Segment
from powertrain_ctrl.hybrid.starts import initial_speeds

from .timing import ratio_row

CAR = pt.examples.conventional(damping="open")
T = np.linspace(0.0, 3.5, 3501)
START = {"engine": pt.rpm(5000)}


def noisy_launch():
    random = np.random.default_rng(0)
    torque, capacity = pt.ramp(1.5, 0.22, 350.0)(T), pt.ramp(1.5, 0.22, 370.0)(T)
    torque[1500:] += random.normal(0.0, 20.0, 2001)
    capacity[1500:] *= 1.0 + 0.05 * np.sin(np.arange(2001.0))
    return {"engine_torque": torque, "clutch_capacity": capacity}


def piece_by_piece(values):
    """The exact core with an event search in every piece."""
    plants = plants_of(CAR)
    plant, model = plants.slipping, plants.model
    table = np.array([np.broadcast_to(values.get(name, 0.0), T.shape) for name in plants.inputs])
    k = len(model.inputs)
    run = Run(plants, plant.state(np.zeros(plant.r), initial_speeds(model, START)), plants.unknown, 0.0)
    for i, h in enumerate(np.diff(T)):
        lines = np.stack([table[:, i], (table[:, i + 1] - table[:, i]) / h], axis=1)
        for _ in run.advance(Segment(lines[:k], lines[k:]), h, float(T[i + 1])):
            pass
    return run.events


def noisy_launch_by_trace():
    values = noisy_launch()

    def fast():
        return pt.simulate(CAR, T, values, START)

    times = [event.time for event in piece_by_piece(values)]
    difference = np.abs(np.array([event.time for event in fast().events]) - times).max()
    return ratio_row(
        "noisy torque and capacity through slip and lock / search piece by piece",
        20,
        fast,
        lambda: piece_by_piece(values),
        difference,
        1e-12,
        3,
        1,
    )


def linear_trace():
    torque = np.random.default_rng(1).normal(0.0, 20.0, len(T))
    G = pt.state_space(CAR, "engine_torque")

    def slow():
        return control.forced_response(G, T, torque)

    def fast():
        return pt.simulate(CAR, T, {"engine_torque": torque})

    expected, response = slow().outputs, fast()
    difference = max(
        np.abs(response[name] - value).max() / np.abs(value).max()
        for name, value in zip(G.output_labels, expected, strict=True)
        if name.endswith(("_torque", "_acceleration", "wheels_speed"))
    )
    return ratio_row("noisy torque without events / control.forced_response", 0.4, fast, slow, difference, 1e-8)


def discrete_system():
    """The same system with and without its matrices of one step."""
    system, plants = pt.nonlinear_system(CAR, dt=0.001), plants_of(CAR)
    start = pt.initial_state(system, CAR, START)
    table = pt.input_values(system, CAR, T, noisy_launch())
    searching = DiscreteDriveline(plants, 0.001, linear=True)
    searching.step = lambda modes: lambda x, before, behind: None
    searching.instant = lambda modes: lambda x, values: None
    other = control.nlsys(
        searching.update,
        searching.output,
        states=system.state_labels,
        inputs=system.input_labels,
        outputs=system.output_labels,
        dt=0.001,
    )

    def fast():
        return control.input_output_response(system, T, table, start)

    def slow():
        return control.input_output_response(other, T, table, start)

    expected = slow().outputs
    difference = (np.abs(fast().outputs - expected).max(axis=1) / np.abs(expected).max(axis=1).clip(1.0)).max()
    return ratio_row("discrete NonlinearIOSystem / search in every sample", 8, fast, slow, difference, 1e-8, 3, 1)
