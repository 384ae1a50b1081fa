"""How often the 95 % intervals of `identify` hold the truth: `python -m benchmarks.coverage [seeds]`.

The car, its sensors and the torque noise of `track`. A table of bias, spread, mean standard error and coverage is printed;
on 400 seeds it is

    parameter                    bias   spread    error   covers
    drive_shafts.stiffness     0.019%   0.305%   0.307%    95.8%
    drive_shafts.damping      -0.121%   0.989%   0.922%    93.8%
    vehicle.m                 -0.004%   0.098%   0.093%    93.2%
    engine.J                   0.039%   0.547%   0.535%    94.5%
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys

import numpy as np

import powertrain_ctrl as pt

from . import track

TRUE = {"drive_shafts.stiffness": 34.4e3, "drive_shafts.damping": 417.6, "vehicle.m": 2000.0, "engine.J": 0.3}


def start(off=1.05):
    """The car of the track, its parameters off by this factor; where a fit ends does not depend on it."""
    car = pt.examples.conventional(gear_ratio=track.RATIO)
    for name, value in TRUE.items():
        element, parameter = name.split(".")
        car = car.replace(element, **{parameter: value * off})
    return car


def found(seed):
    """What is identified from one run."""
    signals = track.run(seed)
    run = pt.plots.Signals(time=signals.pop("time"), values=signals)
    return pt.identify(start(), run, list(TRUE), delays=["wheels_speed"], road_load=True)


def main(seeds):
    fits = [found(seed) for seed in range(seeds)]
    print(f"{seeds} seeds")
    print(f"{'parameter':24}{'bias':>9}{'spread':>9}{'error':>9}{'covers':>9}")
    for name, true in TRUE.items():
        off = np.array([fit.values[name] for fit in fits]) / true - 1.0
        errors = np.array([fit.standard_errors[name] for fit in fits]) / true
        inside = np.mean(np.abs(off) < 1.96 * errors)
        numbers = [100 * off.mean(), 100 * off.std(), 100 * errors.mean()]
        print(f"{name:24}" + "".join(f"{each:8.3f}%" for each in numbers) + f"{100 * inside:8.1f}%")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400)
