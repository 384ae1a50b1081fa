"""Ratios of computing times: `python -m benchmarks`.

One BLAS thread, the two sides of a row in turn, medians. Before anything is timed the results are compared with those of
the other side or an exact reference; a row whose results differ prints FAIL and no ratio. `docs/benchmarks.txt` keeps it.
"""

import os

for threads in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[threads] = "1"

import platform
import statistics
import sys
import warnings
from functools import partial
from pathlib import Path

import control
import numpy as np
import scipy

import powertrain_ctrl as pt

from . import controllers, families, frequencies, plants, play, samples
from .timing import ratio_row, timed


def launch_against_radau():
    car = pt.examples.conventional(damping="open")
    t = np.linspace(0.0, 5.0, 5001)
    torque, capacity = pt.ramp(1.5, 0.22, 350.0), pt.ramp(1.5, 0.22, 370.0)
    system = pt.nonlinear_system(car)
    u = np.zeros((system.ninputs, len(t)))
    u[system.find_input("engine_torque")], u[system.find_input("clutch_capacity")] = torque(t), capacity(t)
    start = pt.initial_state(system, car, {"engine": pt.rpm(5000)})

    def slow():
        return control.input_output_response(system, t, u, start, **pt.solver_settings(torque, capacity))

    def fast():
        return pt.launch(car, timepts=t)

    difference = np.abs(slow().outputs[system.find_output("vehicle_speed")] - fast()["vehicle_speed"]).max() / 0.35
    return ratio_row("launch, 5 s, 5001 samples / NonlinearIOSystem, Radau 1e-6", 80, fast, slow, difference, 1e-4)


def tip_in_against_radau():
    """The sampled loop, each sample integrated by Radau between the instants at which the delayed command changes."""
    plant = pt.SampledPlant(car=pt.examples.conventional())
    controller = pt.antijerk.designs(plant)["two degrees of freedom"]
    demand, dt, count = pt.ramp(0.5, 0.1, 250.0), plant.dt, 400
    P = plant.continuous
    system = control.nlsys(
        lambda t, x, u, params: P.A @ x + P.B[:, 0] * u[0],
        lambda t, x, u, params: P.C @ x,
        inputs=1,
        outputs=P.noutputs,
        states=P.nstates,
    )
    settings = {"solve_ivp_method": "Radau", "solve_ivp_kwargs": {"rtol": 1e-6, "atol": 1e-8}}

    def slow():
        unit, x, limited, last, speeds = pt.ControllerStepper(controller, dt), np.zeros(P.nstates), 0.0, 0.0, []
        for k in range(count):
            y = P.C[:2] @ x
            command = unit.step(
                torque_demand=float(demand(k * dt)), engine_speed=y[0], wheels_speed=y[1], torque_limited=limited
            )
            # a delay of one sample: the command of the sample before acts
            acting, last = last, min(max(command, plant.torque_limits[0]), plant.torque_limits[1])
            limited = last
            span = np.linspace(k * dt, (k + 1) * dt, 11)
            response = control.input_output_response(system, span, np.full(11, acting), x, **settings)
            x = response.states[:, -1]
            speeds.append(P.C[0] @ x)
        return np.array(speeds)

    def fast():
        return pt.closed_loop(plant, controller, demand, duration=count * dt)

    difference = np.abs(slow() - fast()["engine_speed"][10::10]).max()
    return ratio_row("tip-in, 4 s closed loop / input_output_response, Radau 1e-6", 40, fast, slow, difference, 1e-2, 3)


def growth():
    """Times of the exact core over the number of clutches and inertias."""
    print("\nexact core, 2 s with all clutches slipping and locking, 401 samples")
    for clutches in (1, 2, 3, 4):
        cells = []
        for inertias in (8, 16, 32, 64):
            car, inputs, speed = chain(inertias, clutches)
            t = np.linspace(0.0, 2.0, 401)
            response = pt.simulate(car, t, inputs, speed)
            each = statistics.median(timed(partial(pt.simulate, car, t, inputs, speed)) for _ in range(5))
            per_event = 1e3 * each / max(len(response.events), 1)
            cells.append(
                f"{inertias} inertias {1e3 * each:6.1f} ms ({len(response.events)} events, {per_event:.1f} each)"
            )
        print(f"  {clutches} clutches: " + "   ".join(cells))


def chain(inertias, clutches):
    every = inertias // (clutches + 1)
    elements = [pt.Inertia(f"J{i}", J=0.1 + 0.01 * (i % 7)) for i in range(inertias)]
    for i in range(inertias - 1):
        if (i + 1) % every == 0 and (i + 1) // every <= clutches:
            elements.append(pt.Clutch(f"c{(i + 1) // every}", f"J{i}", f"J{i + 1}", max_torque=20.0))
        else:
            elements.append(pt.SpringDamper(f"s{i}", f"J{i}", f"J{i + 1}", stiffness=2e4, damping=1.0))
    return pt.Driveline(*elements), {"J0_torque": pt.ramp(0.5, 0.5, 15.0)}, {"J0": 30.0}


def machine():
    """What the times were taken on and with."""
    cpus = Path("/proc/cpuinfo")
    lines = cpus.read_text().splitlines() if cpus.exists() else []
    name = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.machine())
    versions = {module.__name__: module.__version__ for module in (pt, np, scipy, control)}
    print(f"{name}, {os.cpu_count()} cores; one BLAS thread")
    print(
        f"Python {platform.python_version()}",
        *(f"{each} {version}" for each, version in versions.items()),
        sep=", ",
        end="\n\n",
    )


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    machine()
    met = [
        launch_against_radau(),
        tip_in_against_radau(),
        samples.noisy_launch_by_trace(),
        samples.linear_trace(),
        samples.discrete_system(),
        plants.steps_in_c(),
        controllers.rows(),
        families.rows(),
        play.tip_in_through_a_gap(),
        frequencies.responses(),
        frequencies.order_map(),
    ]
    growth()
    play.growth()
    frequencies.growth()
    sys.exit(0 if all(met) else 1)
