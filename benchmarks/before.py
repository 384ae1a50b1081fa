"""What was before families: loops over variants, run in a process of its own by an older commit of this package.

``python before.py JOB`` reads a pickled dict of arguments and writes one with ``seconds`` of CPU for one variant and
``found``. Only names that the commit 70a82a6 has are used.
"""

import contextlib
import dataclasses
import io
import pickle
import re
import sys
import tempfile
import time

import control
import numpy as np

import powertrain_ctrl as pt
from powertrain_ctrl.cli import main

NUMBER = re.compile(r"(?<![\w.])\d+\.\d+")
CAR = pt.examples.conventional()


def variant(values, i):
    changes = {}
    for name, column in values.items():
        element, parameter = name.split(".")
        changes.setdefault(element, {})[parameter] = float(column[i])
    car = CAR
    for element, new in changes.items():
        car = car.replace(element, **new)
    return car


def each(values, count, function):
    """Results of the first variants, and the median of the seconds that one of them takes."""
    function(variant(values, 0))
    found, seconds = [], []
    for i in range(count):
        start = time.process_time()
        found.append(function(variant(values, i)))
        seconds.append(time.process_time() - start)
    return found, float(np.median(seconds))


def modes(values, count):
    found, seconds = each(values, count, pt.modes)
    return {"omega": [m.omega for m in found], "damping_ratio": [m.damping_ratio for m in found]}, seconds


def poles(values, count):
    return each(values, count, pt.poles)


def system(controller):
    """The same controller on both sides, from its matrices, sample time and signals."""
    return control.ss(*controller[:5], inputs=controller[5], outputs=controller[6])


def closed_loops(values, count, controller):
    plant, controller = pt.SampledPlant(car=CAR), system(controller)

    def loop(car):
        mine = dataclasses.replace(plant, car=car)
        response = pt.closed_loop(mine, controller, pt.ramp(0.5, 0.1, 250.0))
        metrics = pt.studies.tip_in_metrics(mine, response)
        return response["vehicle_acceleration"], dataclasses.astuple(metrics)

    return each(values, count, loop)


def one_loop(controller):
    plant, controller = pt.SampledPlant(car=CAR), system(controller)
    return repeated(lambda: pt.closed_loop(plant, controller, pt.ramp(0.5, 0.1, 250.0))["vehicle_acceleration"], 20)


def launches(values, count):
    def one(car):
        response = pt.launch(car)
        last = response.events[-1]
        return last.time if last.kind == "lock" else np.nan, response.slip_energy["clutch"]

    return each(values, count, one)


def report():
    """Numbers of the frequency tables that the command prints, and the seconds of one report."""
    seconds, printed = 0.0, io.StringIO()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(printed):
        start = time.process_time()
        main(["report", "--output", folder])
        seconds = time.process_time() - start
    tables = re.split("Written|  matplotlib", printed.getvalue())[0]
    return [float(number) for number in NUMBER.findall(tables)], seconds


def chain(J, k):
    return pt.Driveline(
        *(pt.Inertia(f"J{i}", J=float(value)) for i, value in enumerate(J)),
        *(
            pt.SpringDamper(f"k{i}", f"J{i}", f"J{i + 1}", stiffness=float(value), damping=1.0)
            for i, value in enumerate(k)
        ),
    )


def modes_of_chain(J, k, count):
    cars = [chain(np.append(J[:-1], J[-1] * (1.0 + 1e-9 * i)), k) for i in range(count + 1)]
    return one_after_another(cars, lambda car: pt.modes(car).omega)


def modes_of_car(count):
    cars = [CAR.replace("vehicle", m=2000.0 + 1e-6 * i) for i in range(count + 1)]
    return one_after_another(cars, lambda car: pt.modes(car).omega)


def compare(count):
    models = {method: pt.two_mass(CAR, method) for method in ("source", "series", "modal", "fit")}
    cars = [CAR.replace("vehicle", m=2000.0 + 1e-6 * i) for i in range(count + 1)]

    def errors(car):
        table = pt.compare_models(car, models)
        return [[e.frequency_error, e.largest_error, e.band_error, *e.rmse.values()] for e in table.errors.values()]

    return one_after_another(cars, errors)


def robustness(controllers):
    plant = pt.SampledPlant(car=CAR)

    def proven(controller):
        proofs = pt.robustness(plant, controller).proofs.values()
        return [[p.margins.disk_margin, p.metrics.peak_to_peak, p.disturbance_reduction] for p in proofs]

    return one_after_another([system(controller) for controller in controllers], proven)


def one_after_another(things, function):
    """Result for the last of them, and the median of the seconds for all but the first."""
    function(things[0])
    seconds = []
    for thing in things[1:]:
        start = time.process_time()
        found = function(thing)
        seconds.append(time.process_time() - start)
    return found, float(np.median(seconds))


def repeated(function, count):
    return one_after_another(range(count), lambda i: function())


if __name__ == "__main__":
    import warnings

    warnings.simplefilter("ignore")
    arguments = pickle.load(sys.stdin.buffer)
    found, seconds = globals()[sys.argv[1]](**arguments)
    pickle.dump({"found": found, "seconds": seconds}, sys.stdout.buffer)
