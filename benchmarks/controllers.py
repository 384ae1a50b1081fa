"""Seconds of CPU of what has no other side: a search for a controller, all designs, a redraw with sliders."""

import statistics
import time

import powertrain_ctrl as pt
from powertrain_ctrl.notebook.explorer import Explorer
from powertrain_ctrl.notebook.sliders import drawn


def within(name, most, function, values):
    """Print one row: seconds of CPU for each of the values, their median against the most that it may be."""
    took = []
    for value in values:
        start = time.process_time()
        function(value)
        took.append(time.process_time() - start)
    median = statistics.median(took)
    print(f"{name:62s} {1e3 * median:8.0f} ms of CPU, at most {1e3 * most:.0f}: {'met' if median < most else 'MISSED'}")
    return median < most


def plants(first):
    """Of the source's car and an electric one, heavier each time so that nothing is known before."""
    quick = {"lag": 0.005, "delay": 0.002, "dt": 0.002}
    cars = [(pt.examples.conventional(), {}), (pt.examples.electric(), quick)]
    masses = [first + i for i in range(4)]
    return [pt.SampledPlant(car=car.replace("vehicle", m=m), **times) for m in masses for car, times in cars]


def rows():
    car = pt.examples.conventional()
    explorer = Explorer(car)
    pt.antijerk.designs(pt.SampledPlant(car=car))  # what is imported
    return all(
        [
            within("tune, one plant, with its proof on 29", 4.0, pt.antijerk.tune, plants(1500.0)),
            within("designs of one plant, the tuned one among them", 1.0, pt.antijerk.designs, plants(1600.0)),
            within(
                "a redraw of explore",
                0.1,
                lambda m: drawn(explorer, car, {"vehicle.m": m}),
                [1500.0 + 100.0 * i for i in range(9)],
            ),
        ]
    )
