"""Seconds of CPU of what has no other side: a search for a controller, all designs, a redraw with sliders, a start."""

import os
import statistics
import subprocess
import sys
import time
from math import inf
from pathlib import Path

import powertrain_ctrl as pt
from powertrain_ctrl.notebook.explorer import Explorer
from powertrain_ctrl.notebook.sliders import drawn

ROOT = Path(__file__).parent.parent


def within(name, most, function, values):
    """Print one row: seconds of CPU for each of the values, their median against the most that it may be."""
    took = []
    for value in values:
        start = _seconds()
        function(value)
        took.append(_seconds() - start)
    median = statistics.median(took)
    bar = f", at most {1e3 * most:.0f}: {'met' if median < most else 'MISSED'}" if most < inf else ""
    print(f"{name:62s} {1e3 * median:8.0f} ms of CPU{bar}")
    return median < most


def _seconds():
    """Of CPU, those of processes that have ended included."""
    took = os.times()
    return took.children_user + took.children_system + time.process_time()


def python(arguments):
    """A Python process of its own."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    subprocess.run([sys.executable, *arguments], env=environment, stdout=subprocess.DEVNULL, check=True)


def plants(first):
    """Of the source's car and an electric one, heavier each time so that nothing is known before."""
    quick = {"lag": 0.005, "delay": 0.002, "dt": 0.002}
    cars = [(pt.examples.conventional(), {}), (pt.examples.electric(), quick)]
    masses = [first + i for i in range(4)]
    return [pt.SampledPlant(car=car.replace("vehicle", m=m), **times) for m in masses for car, times in cars]


def ships():
    """The marine train, driven at its low-pressure turbine; another one each time."""
    car, quick = pt.examples.marine(), {"lag": 0.002, "delay": 5e-4, "dt": 0.001, "torque_limits": (-1e6, 1e6)}
    heavier = [car.replace("lp_turbine", J=(1.0 + 0.001 * i) * car["lp_turbine"].J) for i in range(2)]
    return [pt.SampledPlant(car=each, actuator="lp_turbine", **quick) for each in heavier]


def rows():
    car = pt.examples.conventional()
    explorer, toml = Explorer(car), str(pt.examples.path("conventional"))
    pt.antijerk.designs(pt.SampledPlant(car=car))  # what is imported
    return all(
        [
            within("tune, one plant, with its proof on 29", 4.0, pt.antijerk.tune, plants(1500.0)),
            within("tune, marine train, 1 ms", 4.0, pt.antijerk.tune, ships()),
            within("designs of one plant, the tuned one among them", 1.0, pt.antijerk.designs, plants(1600.0)),
            within(
                "a redraw of explore",
                0.1,
                lambda m: drawn(explorer, car, {"vehicle.m": m}),
                [1500.0 + 100.0 * i for i in range(9)],
            ),
            within("import powertrain_ctrl, a new process", 0.6, python, [["-c", "import powertrain_ctrl"]] * 5),
            within("powertrain-ctrl --help", inf, python, [["-m", "powertrain_ctrl", "--help"]] * 5),
            within(
                "powertrain-ctrl modes conventional.toml", inf, python, [["-m", "powertrain_ctrl", "modes", toml]] * 5
            ),
        ]
    )
