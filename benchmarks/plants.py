"""The core in C: its results against the discrete NonlinearIOSystem, then what a step costs."""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import control
import numpy as np

import powertrain_ctrl as pt

from .samples import CAR, START, T
from .timing import ratio_row

COMPILER = next(filter(None, map(shutil.which, ("gcc", "cc", "clang"))), None)
# All samples in C, so that no call from here is timed; seconds of each step if asked for.
RUN = """
#include <time.h>
static driveline_plant it;
int run(int count, const double u[][NV], double y[][NY], double seconds[])
{
    struct timespec a, b;
    int status = driveline_init(&it, 0);
    if (!status) status = driveline_outputs(&it, u[0], y[0]);
    for (int k = 1; k < count && !status; ++k) {
        if (seconds) clock_gettime(CLOCK_MONOTONIC, &a);
        status = driveline_step(&it, u[k - 1], u[k - 1]);
        if (seconds) {
            clock_gettime(CLOCK_MONOTONIC, &b);
            seconds[k - 1] = (double)(b.tv_sec - a.tv_sec) + 1e-9 * (double)(b.tv_nsec - a.tv_nsec);
        }
        if (!status) status = driveline_outputs(&it, u[k], y[k]);
    }
    return status;
}
unsigned long size(void) { return sizeof it; }
"""


def compiled(car, speed, folder):
    source = Path(folder) / "plant.c"
    source.write_text(pt.export.c_plant(car, dt=0.001, initial_speed=speed) + RUN)
    library = source.with_name(f"{len(car)}.so")
    flags = ["-std=gnu99", "-O3", "-fPIC", "-shared"]
    subprocess.run([COMPILER, *flags, "-o", str(library), str(source), "-lm"], check=True)
    return ctypes.CDLL(str(library))


def pointer(values):
    return values.ctypes.data_as(ctypes.c_void_p)


def gearbox():
    """Engine and damper, two planetary gears between two clutches and two brakes, shaft, wheels, vehicle."""
    inertias = {
        "engine": 0.2,
        "turbine": 0.05,
        "s1": 0.01,
        "c1": 0.03,
        "r1": 0.04,
        "s2": 0.01,
        "c2": 0.05,
        "wheels": 1.5,
    }
    return pt.Driveline(
        *(pt.Inertia(name, J=J) for name, J in inertias.items()),
        pt.Mass("vehicle", m=1800.0),
        pt.SpringDamper("damper", "engine", "turbine", stiffness=1500.0, damping=3.0),
        pt.Planetary("p1", sun="s1", ring="r1", carrier="c1", ratio=2.5),
        pt.Planetary("p2", sun="s2", ring="r1", carrier="c2", ratio=3.0),
        pt.Clutch("k1", "turbine", "s1", max_torque=400.0),
        pt.Clutch("k2", "turbine", "c1", max_torque=400.0),
        pt.Clutch("b1", "c1", max_torque=900.0),
        pt.Clutch("b2", "s2", max_torque=900.0),
        pt.SpringDamper("shaft", "c2", "wheels", stiffness=9000.0, damping=60.0),
        pt.Tyre("tyre", "wheels", "vehicle", radius=0.3, stiffness=2e5, damping=1000.0),
    )


LAUNCH = {"engine_torque": pt.ramp(1.5, 0.22, 350.0), "clutch_capacity": pt.ramp(1.5, 0.22, 370.0)}
SHIFT = {
    "engine_torque": pt.ramp(0.02, 0.1, 150.0),
    "b1_capacity": pt.ramp(0.03, 0.05, 800.0) + pt.ramp(1.3, 0.03, -800.0),
    "b2_capacity": pt.ramp(0.04, 0.05, 800.0),
    "k1_capacity": pt.ramp(0.06, 0.1, 300.0) + pt.ramp(1.35, 0.03, -300.0),
    "k2_capacity": pt.ramp(1.35, 0.05, 250.0),
}


def steps_in_c():
    """Row of the launch, and what a step costs in it and in a gear shift of two planetary gears."""
    if COMPILER is None:
        print("the core in C: no compiler here")
        return True
    met, notes = True, []
    for name, car, inputs, speed in (
        ("launch, plant in C / discrete NonlinearIOSystem", CAR, LAUNCH, START),
        ("gear shift, four clutches, plant in C / NonlinearIOSystem", gearbox(), SHIFT, {"engine": 150.0}),
    ):
        system = pt.nonlinear_system(car, dt=0.001, hold="zero")
        u = pt.input_values(system, car, T, inputs)
        start, given = pt.initial_state(system, car, speed), np.ascontiguousarray(u.T)
        y, seconds = np.empty((len(T), system.noutputs)), np.zeros((15, len(T) - 1))
        with tempfile.TemporaryDirectory() as folder:
            library = compiled(car, speed, folder)

        def fast(library=library, given=given, y=y, seconds=None):
            if library.run(len(T), pointer(given), pointer(y), seconds):
                raise RuntimeError("the plant in C stops")

        def slow(system=system, u=u, start=start):
            return control.input_output_response(system, T, u, start).outputs

        expected = slow()
        fast()
        speeds = [i for i, label in enumerate(system.output_labels) if label.endswith("_speed")]
        difference = np.abs(y.T - expected)[speeds].max()
        met &= ratio_row(name, 30, fast, slow, difference, 1e-8, 3, 5)
        for row in seconds:
            fast(seconds=pointer(row))
        quick = 1e6 * seconds.min(axis=0)  # the least of all runs is without interruptions
        library.size.restype = ctypes.c_ulong
        notes.append(
            f"  {len(car)} elements: a step of 1 ms {np.median(quick):.2f} us, with events at most {quick.max():.0f} us "
            f"(new modes, whose exact steps are tabulated); {library.size() / 1024:.0f} kB"
        )
    print("\n".join(notes))
    return met
