"""Plants of `pt.export.c_plant` and FMUs, compiled and called from here."""

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import control
import numpy as np

import powertrain_ctrl as pt

COMPILER = next(filter(None, map(shutil.which, ("gcc", "cc", "clang"))), None)
WITHOUT = "no C compiler"
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow", "-Wpedantic"]
FOLDER = tempfile.TemporaryDirectory()
SIZE = "\nunsigned long driveline_size(void) { return sizeof(driveline_plant); }\n"


def compiled(source, name, flags=("-O2",)):
    """Shared library of a source, which no warning is permitted in."""
    file = Path(FOLDER.name) / f"{name}.c"
    file.write_text(source)
    library = file.with_suffix(".so")
    done = subprocess.run(
        [COMPILER, *STRICT, *flags, "-fPIC", "-shared", "-o", str(library), str(file), "-lm"],
        capture_output=True,
        text=True,
    )
    assert not done.returncode, done.stderr
    return ctypes.CDLL(str(library))


def numbers(values):
    return np.ascontiguousarray(values, dtype=float).ctypes.data_as(ctypes.POINTER(ctypes.c_double))


class CPlant:
    """One plant: `init`, `step`, `outputs` as in C."""

    def __init__(self, car, name, flags=("-O2",), changed=str, **options):
        self.lib = compiled(changed(pt.export.c_plant(car, **options)) + SIZE, name, flags)
        self.lib.driveline_size.restype = ctypes.c_ulong
        self.lib.driveline_message.restype = ctypes.c_char_p
        self.memory = ctypes.create_string_buffer(self.lib.driveline_size())
        self.init()

    def init(self, parameters=None):
        return self.lib.driveline_init(self.memory, None if parameters is None else numbers(parameters))

    def step(self, before, after):
        before, after = np.array(before, dtype=float), np.array(after, dtype=float)
        return self.lib.driveline_step(self.memory, numbers(before), numbers(after))

    def outputs(self, u, count):
        u, y = np.array(u, dtype=float), np.zeros(count)
        status = self.lib.driveline_outputs(self.memory, numbers(u), numbers(y))
        assert status == 0, self.message(status)
        return y

    def message(self, status):
        return self.lib.driveline_message(status).decode()


def of_the_package(car, dt, times, inputs, speed=None, hold="zero"):
    """System, input values and outputs of `nonlinear_system`."""
    system = pt.nonlinear_system(car, dt=dt, hold=hold)
    u = pt.input_values(system, car, times, inputs)
    start = pt.initial_state(system, car, speed)
    return system, u, control.input_output_response(system, times, u, start).outputs


def of_c(plant, u, count, hold="zero"):
    """(outputs, samples) ndarray."""
    shown = [plant.outputs(u[:, 0], count)]
    for now, after in zip(u.T, u.T[1:], strict=False):
        status = plant.step(now, now if hold == "zero" else after)
        assert status == 0, plant.message(status)
        shown.append(plant.outputs(after, count))
    return np.array(shown).T


def gearbox():
    """Engine and damper, two planetary gears between two clutches and two brakes, shaft, wheels, vehicle."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.SpringDamper("damper", "engine", "turbine", stiffness=1500.0, damping=3.0),
        *(
            pt.Inertia(name, J=J)
            for name, J in {"turbine": 0.05, "s1": 0.01, "c1": 0.03, "r1": 0.04, "s2": 0.01, "c2": 0.05}.items()
        ),
        pt.Planetary("p1", sun="s1", ring="r1", carrier="c1", ratio=2.5),
        pt.Planetary("p2", sun="s2", ring="r1", carrier="c2", ratio=3.0),
        pt.Clutch("k1", "turbine", "s1", max_torque=400.0),
        pt.Clutch("k2", "turbine", "c1", max_torque=400.0),
        pt.Clutch("b1", "c1", max_torque=900.0),
        pt.Clutch("b2", "s2", max_torque=900.0, static_ratio=1.2),
        pt.SpringDamper("shaft", "c2", "wheels", stiffness=9000.0, damping=60.0),
        pt.Inertia("wheels", J=1.5),
        pt.Tyre("tyre", "wheels", "vehicle", radius=0.3, stiffness=2e5, damping=1000.0),
        pt.Mass("vehicle", m=1800.0),
    )


def played(contact="nordin"):
    """Two bodies with play in between, the second one on a spring."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.Backlash("play", "engine", "wheels", gap=0.05, stiffness=8000.0, damping=30.0, contact=contact),
        pt.Inertia("wheels", J=2.0),
        pt.SpringDamper("tyre", "wheels", "body", stiffness=2e4, damping=100.0),
        pt.Inertia("body", J=150.0),
    )


def staged():
    """Two stages with friction behind a spring, a one-way clutch, rubbing."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.MultiStageSpring(
            "dmf",
            "engine",
            "second",
            twists=(-0.3, -0.1, 0.1, 0.3),
            torques=(-300, -20, 20, 300),
            damping=0.5,
            friction=8.0,
            friction_stiffness=5000.0,
        ),
        pt.Inertia("second", J=0.1),
        pt.SpringDamper("shaft", "second", "load", stiffness=800.0, damping=3.0),
        pt.Inertia("load", J=20.0),
        pt.Drag("rubbing", "load", damping=0.1, friction=4.0),
        pt.OneWayClutch("freewheel", "load", "generator"),
        pt.Inertia("generator", J=1.0),
        pt.Drag("air", "generator", damping=0.5),
    )


def falling():
    """A clutch whose friction falls with slip, then grows."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.Clutch("clutch", "engine", "box", max_torque=200.0, friction=((0, 1.0), (20, 0.9), (100, 1.1))),
        pt.Inertia("box", J=0.1),
        pt.SpringDamper("shaft", "box", "load", stiffness=800.0, damping=1.0),
        pt.Inertia("load", J=20.0),
    )


def rig():
    """A dog clutch, and a node that is moved."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.DogClutch("dog", "engine", "box"),
        pt.Inertia("box", J=0.1),
        pt.SpringDamper("shaft", "box", "load", stiffness=800.0, damping=1.0),
        pt.Inertia("load", J=20.0),
        pt.SpringDamper("drive", "load", "table", stiffness=500.0, damping=2.0),
        pt.SpeedSource("rig", "table"),
    )


def rigid():
    """The source's car with its clutch closed for good."""
    car = pt.examples.conventional()
    return pt.Driveline(
        *(e for e in car if e.name != "clutch"), pt.Gear("closed", "clutch_primary", "clutch_secondary", ratio=1.0)
    )


def two_bodies(capacity):
    car = pt.Driveline(
        pt.Inertia("a", J=0.3), pt.Clutch("clutch", "a", "b", max_torque=capacity), pt.Inertia("b", J=0.7)
    )
    return car, 100.0 / (capacity * (1.0 / 0.3 + 1.0 / 0.7))


def switching():
    closed = pt.two_mass(pt.examples.conventional(), method="source")
    slipping = pt.two_mass(pt.examples.conventional(damping="open").release("clutch"), method="source")
    return pt.SwitchedTwoMass(closed=closed, slipping=slipping)


def swinging(mean, amplitude, omega):
    times = np.linspace(0.0, 2.0, 401)
    return pt.samples(times, mean + amplitude * np.sin(omega * times))


SHIFT = {
    "engine_torque": pt.ramp(0.02, 0.1, 150.0),
    "b1_capacity": pt.ramp(0.03, 0.05, 800.0) + pt.ramp(0.3, 0.03, -800.0),
    "b2_capacity": pt.ramp(0.04, 0.05, 800.0),
    "k1_capacity": pt.ramp(0.06, 0.1, 300.0) + pt.ramp(0.35, 0.03, -300.0),
    "k2_capacity": pt.ramp(0.35, 0.05, 250.0),
}
LAUNCH = {"engine_torque": pt.ramp(0.01, 0.1, 350.0), "clutch_capacity": pt.ramp(0.01, 0.1, 370.0)}
BLOWS = pt.samples(np.array([0, 0.02, 0.02, 0.25, 0.25, 0.45]), np.array([0, 0, 100, 100, -100, -100.0]))
# name: car, step [s], samples, inputs, speeds at the start, permitted difference of speeds [rad/s, m/s]
CASES = {
    "linear": (rigid(), 1e-3, 500, {"engine_torque": pt.ramp(0.1, 0.2, 250.0)}, {"engine": 200.0}, 1e-9),
    "clutch": (pt.examples.conventional(damping="open"), 2e-3, 700, LAUNCH, {"engine": 500.0}, 1e-8),
    "four clutches": (gearbox(), 1e-3, 700, SHIFT, {"engine": 150.0}, 1e-8),
    "backlash": (played(), 2e-3, 250, {"engine_torque": BLOWS}, None, 1e-8),
    "clipped backlash": (played("clipped"), 2e-3, 250, {"engine_torque": BLOWS}, None, 1e-8),
    "stages": (staged(), 5e-3, 160, {"engine_torque": swinging(60.0, 80.0, 35.0)}, None, 1e-8),
    "friction over slip": (
        falling(),
        5e-3,
        100,
        {"engine_torque": pt.ramp(0.05, 0.05, 100.0), "clutch_capacity": pt.ramp(0.1, 0.2, 160.0)},
        {"engine": 150.0},
        1e-8,
    ),
    "dog and moved node": (
        rig(),
        5e-3,
        100,
        {
            "engine_torque": pt.ramp(0.02, 0.05, 20.0),
            "dog_engaged": pt.step(0.2, 1.0),
            "rig_speed": pt.ramp(0.1, 0.3, 30.0),
        },
        {"engine": 20.0},
        1e-8,
    ),
}
