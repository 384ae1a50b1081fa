"""Whatever a public function is given, it answers or raises a `PowertrainError`, and does not hang.

Of base/kinds.
"""

import contextlib
import decimal
import fractions
import inspect
import io
import itertools
import os
import pickle
import random
import signal
from dataclasses import dataclass
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import powertrain_ctrl as pt
from powertrain_ctrl.base.systems import linear_system

# Calls of the suite; the environment variable POWERTRAIN_CASES asks for more.
CASES = int(os.environ.get("POWERTRAIN_CASES", "1500"))
# A call that takes longer than this [s] hangs.
PATIENCE = 20

CAR = pt.Driveline(
    pt.Inertia("engine", J=0.3),
    pt.Clutch("clutch", "engine", "input", max_torque=300.0),
    pt.Inertia("input", J=0.05),
    pt.Gear("gearbox", "input", "axle", ratio=8.0),
    pt.SpringDamper("shafts", "axle", "wheels", stiffness=1e4, damping=50.0),
    pt.Inertia("wheels", J=2.0),
    pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=5e5, damping=2e3),
    pt.Mass("vehicle", m=1400.0),
)
RIGID = pt.Driveline(*(e for e in CAR if e.name != "clutch"), pt.Gear("flange", "engine", "input", ratio=1.0))
PLANT = pt.SampledPlant(car=RIGID)
MODEL = pt.two_mass(RIGID)
SLIPPING = pt.two_mass(CAR.release())
FEEDBACK = pt.antijerk.speed_difference(PLANT)
FEEDFORWARD = pt.antijerk.inverse_notch(PLANT, MODEL)
CONTROLLER = pt.antijerk.one_dof(PLANT, FEEDBACK)
MODES = pt.modes(RIGID)
TIMES = [0.0, 0.1, 0.2]
RESPONSE = pt.simulate(CAR, TIMES, {"engine_torque": 50.0})
TIP_IN = pt.tip_in(PLANT)
DEMAND = pt.ramp(0.0, 0.1, 100.0)
SYSTEM = pt.nonlinear_system(CAR, dt=0.01)
COMPARISON = pt.compare_models(RIGID, {"modal": MODEL}, ramps=0.1)
MARGINS = pt.loop_margins(PLANT, CONTROLLER)
TUNED = pt.antijerk.tune(PLANT)
METRICS = pt.studies.tip_in_metrics(PLANT, TIP_IN)
ROBUSTNESS = pt.robustness(PLANT, CONTROLLER, {"nominal": PLANT})
GENERALISED = control.ss([[1.0]], [[1.0, 0.0, 1.0]], [[1.0], [0.0], [1.0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]])
SENSORS = pt.Sensors(engine_noise=0.1)
SHORT = {"duration": 0.3}
FREQUENCIES = {"car": control.frequency_response(pt.state_space(RIGID, "engine_torque", "wheels_speed"), [1.0, 2.0])}


@dataclass(frozen=True)
class Odd:
    """Frozen, and neither a number nor anything else that is wanted."""

    driveline: object = 3


NASTY = {
    "zero": 0,
    "minus one": -1,
    "one": 1,
    "two and a half": 2.5,
    "ninety-nine": 99,
    "true": True,
    "numpy true": np.True_,
    "none": None,
    "nan": float("nan"),
    "inf": float("inf"),
    "minus inf": float("-inf"),
    "1e18": 1e18,
    "-1e18": -1e18,
    "1e308": 1e308,
    "-1e308": -1e308,
    "1e-308": 1e-308,
    "5e-324": 5e-324,
    "1e-12": 1e-12,
    "1e12": 1e12,
    "10**9": 10**9,
    "10**18": 10**18,
    "10**400": 10**400,
    "-10**400": -(10**400),
    "10**5000": 10**5000,
    "complex": 1j,
    "real complex": 2 + 0j,
    "numpy complex": np.complex128(1.0 + 2.0j),
    "numpy nan": np.float64("nan"),
    "numpy int": np.int64(3),
    "float32": np.float32(0.2),
    "fraction": fractions.Fraction(1, 3),
    "decimal": decimal.Decimal("0.1"),
    "empty text": "",
    "text": "text",
    "number as text": "1.0",
    "nul": "a\0b",
    "surrogate": "\udcff",
    "bytes": b"engine",
    "bytearray": bytearray(b"x"),
    "engine": "engine",
    "engine_torque": "engine_torque",
    "empty list": [],
    "list": [1.0, 2.0],
    "decreasing": [1.0, 0.0],
    "none inside": [None],
    "ragged": [[1.0], [1.0, 2.0]],
    "text inside": ["a", 1.0],
    "nan inside": [0.0, float("nan"), 2.0],
    "far apart": [0.0, 1.0, 1e308],
    "years apart": [0.0, 1.0, 1e9],
    "ages apart": [0.0, 1.0, 1e14],
    "a moment apart": [0.0, 1e-300, 1.0],
    "names": ["engine", "engine"],
    "deep list": [[[[1.0]]]],
    "empty tuple": (),
    "tuple": (1.0, 2.0),
    "wrong order": (2.0, 1.0),
    "three": (1.0, 2.0, 3.0),
    "set": {1.0},
    "empty dict": {},
    "dict": {"a": 1},
    "dict of none": {"engine": None},
    "dict of odd keys": {(): 1.0, 3: 2.0},
    "dict of text": {"engine": "fast"},
    "torque of text": {"engine_torque": "x"},
    "torque of nan": {"engine_torque": [0.0, float("nan"), 1.0]},
    "torque that fails": {"engine_torque": lambda t: 1.0 / 0.0},
    "dict of objects": {"engine": object()},
    "empty array": np.zeros(0),
    "array": np.array([1.0, 2.0]),
    "matrix": np.eye(3),
    "complex array": np.array([1j]),
    "object array": np.array([object()]),
    "text array": np.array(["a"]),
    "flags": np.array([True, False]),
    "date": np.datetime64("2020-01-01"),
    "no dimension": np.array(3.0),
    "object": object(),
    "odd": Odd(),
    "class": pt.Driveline,
    "type": float,
    "module": np,
    "ellipsis": ...,
    "not implemented": NotImplemented,
    "range": range(3),
    "slice": slice(None),
    "endless": itertools.repeat("engine_speed"),
    "built-in": len,
    "function of none": lambda: 1.0,
    "function to text": lambda t: "x",
    "function to none": lambda t: None,
    "function to list": lambda t: [1.0, 2.0],
    "function to complex": lambda t: 1j,
    "function to nan": lambda t: float("nan"),
    "function that fails": lambda t: {}["x"],
    "error": ValueError("x"),
    "path": Path("nowhere"),
    "car": CAR,
    "plant": PLANT,
    "model": MODEL,
    "modes": MODES,
    "response": RESPONSE,
    "state": RESPONSE.final,
    "controller": CONTROLLER,
    "feedback": FEEDBACK,
    "continuous": pt.state_space(RIGID, "engine_torque", "wheels_speed"),
    "empty system": linear_system([], [], [], [[1.0]], 0.01),
    "system without time": control.ss([[0.5]], [[1.0]], [[1.0]], [[0.0]], dt=True),
    "transfer function": control.tf([1.0], [1.0, 1.0]),
    "ramp": DEMAND,
    "margins": MARGINS,
    "metrics": METRICS,
    "element": pt.Inertia("odd", J=1.0),
}

SORTS = ((bool,), (int, float), (str,), (list, tuple, np.ndarray), (dict,))


def alike(value):
    """Names of the nasty values of the same sort as a right one, all of them where there are none."""
    sort = next((sort for sort in SORTS if isinstance(value, sort)), (type(value),))
    return [name for name, nasty in NASTY.items() if isinstance(nasty, sort)] or list(NASTY)


def step_of_a_controller(**signals):
    return pt.ControllerStepper(CONTROLLER, 0.01).step(**signals)


READ = {"torque_demand": 1.0, "engine_speed": 1.0, "wheels_speed": 0.1, "torque_limited": 0.0}
STATE = {"time": 0.2, "twist": {"shafts": 0.0}, "speed": {"engine": 1.0}, "mode": {"clutch": 0}}
TWO_MASS = {"J1": 0.5, "J2": 200.0, "stiffness": 1e4, "damping": 30.0, "ratio": 8.0, "radius": 0.3, "rim_share": 0.1}
NAMES = {"driving": "engine", "wheels": "wheels", "vehicle": "vehicle", "shaft": "shafts"}
PULSE = {"torque": 100.0, "duration": 0.1, "start": 0.1}
LAUNCH = {**PULSE, "capacity": 300.0, "engine_speed": 200.0}
LOOP = {"duration": 0.3, "disturbance": 5.0, "initial_torque": 5.0, "sensors": SENSORS, "steps_per_sample": 2}
EXPERIMENT = {"plant": PLANT, "controller": CONTROLLER, "torque": 100.0}
OUTPUTS = {"inputs": "engine_torque", "outputs": ["wheels_speed"]}
BELONGS = {"system": SYSTEM, "car": CAR}
TUNED_LQG = {
    "effort": 0.02,
    "load_noise": 1.0,
    "torque_noise": 10.0,
    "speed_noise": 0.5,
    "engine_only": False,
    "wheels_only": False,
}

# What can be called, with arguments that are right, by keyword; "*" are those by position.
ENTRIES = {
    "Inertia": (pt.Inertia, {"name": "a", "J": 1.0}),
    "Mass": (pt.Mass, {"name": "a", "m": 1.0}),
    "SpringDamper": (pt.SpringDamper, {"name": "s", "a": "a", "b": "b", "stiffness": 1.0, "damping": 1.0}),
    "Shaft": (pt.Shaft, {"name": "s", "a": "a", "b": "b", "stiffness": 1.0, "inertia": 1.0, "damping": 1.0}),
    "Drag": (pt.Drag, {"name": "s", "node": "a", "damping": 1.0, "stiffness": 1.0}),
    "Gear": (pt.Gear, {"name": "s", "a": "a", "b": "b", "ratio": 2.0}),
    "Planetary": (pt.Planetary, {"name": "s", "sun": "a", "ring": "b", "carrier": "c", "ratio": 2.0}),
    "Tyre": (pt.Tyre, {"name": "s", "wheel": "a", "body": "b", "radius": 0.3, "stiffness": 1.0, "damping": 1.0}),
    "Clutch": (pt.Clutch, {"name": "s", "a": "a", "b": "b", "max_torque": 1.0, "static_ratio": 1.2}),
    "Compliance": (pt.Compliance, {"name": "s", "coefficients": {"a": 1.0}, "stiffness": 1.0, "damping": 1.0}),
    "Constraint": (pt.Constraint, {"name": "s", "coefficients": {"a": 1.0, "b": -2.0}}),
    "TorqueSplit": (pt.TorqueSplit, {"name": "s", "coefficients": {"a": 0.6, "b": 0.4}, "node": "both"}),
    "Driveline": (pt.Driveline, {"*": [pt.Inertia("a", J=1.0)]}),
    "Driveline.replace": (CAR.replace, {"*": ["shafts"], "stiffness": 1.0, "damping": 1.0}),
    "Driveline.replace, gear": (CAR.replace, {"*": ["gearbox"], "ratio": 1.0}),
    "Driveline.lock": (CAR.lock, {"*": ["clutch"]}),
    "Driveline.release": (CAR.release, {"*": ["clutch"]}),
    "Driveline.part": (CAR.part, {"node": "engine"}),
    "Driveline[]": (CAR.__getitem__, {"*": ["engine"]}),
    "in Driveline": (CAR.__contains__, {"*": ["engine"]}),
    "Driveline.save": (CAR.save, {"path": "car.toml"}),
    "TwoMass": (pt.TwoMass, TWO_MASS | NAMES),
    "TwoMass.replace": (MODEL.replace, TWO_MASS),
    "TwoMass.response": (MODEL.response, {"omega": [1.0, 2.0]}),
    "SwitchedTwoMass": (
        pt.SwitchedTwoMass,
        {"closed": MODEL, "slipping": SLIPPING, "max_torque": 9.0, "clutch": "clutch"},
    ),
    "SampledPlant": (
        pt.SampledPlant,
        {"car": RIGID, "lag": 0.02, "delay": 0.01, "dt": 0.01, "torque_limits": (0, 300)},
    ),
    "SampledPlant.discrete": (PLANT.discrete, {}),
    "SampledPlant.with_delay": (PLANT.with_delay, {"A": [[1.0]], "B": [[1.0]]}),
    "SampledPlant.step_matrices": (
        PLANT.step_matrices,
        {"A": [[1.0]], "B": [[1.0]], "duration": 0.01, "rest": 0.0},
    ),
    "Sensors": (
        lambda **given: pt.Sensors(**given).errors(3),
        {"engine_noise": 0.1, "wheels_noise": 0.1, "engine_resolution": 0.1, "wheels_resolution": 0.1, "seed": 3},
    ),
    "Sensors.errors": (SENSORS.errors, {"count": 3}),
    "Sensors.quantised": (SENSORS.quantised, {"speeds": np.array([1.0, 2.0])}),
    "State": (lambda **given: repr(pt.State(**given)), STATE),
    "simulate from a State": (lambda **given: pt.simulate(CAR, TIMES, initial_state=pt.State(**given)), STATE),
    "ControllerStepper": (pt.ControllerStepper, {"controller": CONTROLLER, "dt": 0.01}),
    "ControllerStepper.step": (step_of_a_controller, READ),
    "Response[]": (RESPONSE.__getitem__, {"*": ["engine_speed"]}),
    "in Response": (RESPONSE.__contains__, {"*": ["engine_speed"]}),
    "Response.to_control": (RESPONSE.to_control, {"outputs": ["engine_speed"]}),
    "Modes.dominant_compliance": (MODES.dominant_compliance, {"mode": 1}),
    "ramp": (pt.ramp, {"start": 0.0, "duration": 0.1, "final": 1.0, "initial": 0.0}),
    "step": (pt.step, {"time": 0.0, "final": 1.0, "initial": 0.0}),
    "ramp(t)": (DEMAND, {"t": 0.1}),
    "ramp + ": (lambda other: DEMAND + other, {"*": [DEMAND]}),
    "harmonic + ": (lambda other: pt.harmonic(2.0, 10.0) + other, {"*": [DEMAND]}),
    "harmonic": (pt.harmonic, {"amplitude": 2.0, "omega": 10.0, "phase": 0.0}),
    "ramp * ": (lambda factor: DEMAND * factor, {"*": [2.0]}),
    " * ramp": (lambda factor: factor * DEMAND, {"*": [2.0]}),
    "rpm": (pt.rpm, {"speed": 1000.0}),
    "kmh": (pt.kmh, {"speed": 100.0}),
    "load": (pt.load, {"path": pt.examples.path("conventional")}),
    "load_plant": (pt.load_plant, {"path": pt.examples.path("electric")}),
    "assemble": (pt.assemble, {"car": CAR}),
    "modes": (pt.modes, {"car": CAR}),
    "poles": (pt.poles, {"car": CAR}),
    "two_mass": (pt.two_mass, {"car": RIGID, "method": "modal"}),
    "reflected": (pt.reflected, {"car": RIGID, "reference": "engine"}),
    "state_space": (pt.state_space, {"car": RIGID, **OUTPUTS, "coordinates": "twist", "reference": None}),
    "static_gain": (pt.static_gain, {"car": RIGID, **OUTPUTS}),
    "state_space, angle": (pt.state_space, {"car": RIGID, "coordinates": "angle", "reference": "engine"}),
    "reduced": (pt.reduced, {"car": RIGID, "order": 3, "method": "balanced", **OUTPUTS}),
    "hankel_singular_values": (pt.hankel_singular_values, {"car": RIGID, **OUTPUTS}),
    "compare_models": (
        pt.compare_models,
        {"car": RIGID, "models": {"m": MODEL}, "band": (0.0, 10.0), "ramps": [0.1]},
    ),
    "simulate": (
        pt.simulate,
        {"car": CAR, "timepts": TIMES, "inputs": {"engine_torque": [1.0, 2.0, 3.0]}, "initial_speed": {"engine": 9.0}},
    ),
    "simulate on": (pt.simulate, {"car": CAR, "timepts": [0.2, 0.3], "inputs": {}, "initial_state": RESPONSE.final}),
    "simulate, one input": (
        lambda torque, capacity: pt.simulate(CAR, TIMES, {"engine_torque": torque, "clutch_capacity": capacity}),
        {"torque": 1.0, "capacity": 20.0},
    ),
    "simulate, one speed": (lambda speed: pt.simulate(CAR, TIMES, {}, {"engine": speed}), {"speed": 3.0}),
    "load_change": (pt.load_change, {"car": RIGID, **PULSE, "engine_speed": 100.0, "timepts": TIMES}),
    "launch": (pt.launch, {"car": CAR, **LAUNCH, "timepts": TIMES}),
    "controlled_launch": (
        pt.controlled_launch,
        {"plant": pt.SampledPlant(car=CAR), "controller": None, **LAUNCH, "end": 0.2, "steps_per_sample": 2},
    ),
    "ControlUnit": (
        pt.ControlUnit,
        {"controllers": {18.0: CONTROLLER}, "dt": 0.01, "torque_limits": (0.0, 300.0), "torque_rate": (1e3, 2e3)},
    ),
    "ControlUnit.start": (pt.ControlUnit(controllers=CONTROLLER, dt=0.01).start, {"torque": 20.0}),
    "controlled_run": (
        pt.controlled_run,
        {
            "plant": PLANT,
            "controller": CONTROLLER,
            "demand": DEMAND,
            "inputs": {"vehicle_force": 5.0},
            "duration": 0.1,
            "car": PLANT.car,
            "initial_state": None,
            "clutch_controllers": None,
        },
    ),
    "change_of_mind": (pt.change_of_mind, {**EXPERIMENT, "duration": 0.1, "hold": 0.3}),
    "let_off": (
        pt.let_off,
        {
            "plant": pt.SampledPlant(car=RIGID, torque_limits=(-50.0, 350.0)),
            "controller": CONTROLLER,
            "torque": 50.0,
            "drag": -20.0,
            "duration": 0.1,
        },
    ),
    "braking": (
        pt.braking,
        {
            "plant": PLANT,
            "controller": CONTROLLER,
            "brake": 100.0,
            "abs_frequency": 5.0,
            "torque": 10.0,
            "engine_speed": 300.0,
        },
    ),
    "controlled_shift": (
        pt.controlled_shift,
        {
            "plant": pt.SampledPlant(car=pt.examples.p2_hybrid()),
            "controller": None,
            "offgoing": "odd_clutch",
            "oncoming": "even_clutch",
            "torque": 100.0,
            "engine_speed": 300.0,
            "torque_phase": 0.1,
            "speed_phase": 0.2,
            "start": 0.1,
            "car": pt.examples.p2_hybrid(),
        },
    ),
    "controlled_start": (
        pt.controlled_start,
        {
            "plant": pt.SampledPlant(car=pt.examples.p2_hybrid().release("separation_clutch").part("vehicle")),
            "controller": None,
            "car": pt.examples.p2_hybrid(),
            "clutch": "separation_clutch",
            "torque": 50.0,
            "capacity": 60.0,
            "speed": 150.0,
            "blending": 0.3,
            "start": 0.1,
            "compensated": True,
        },
    ),
    "closed_loop": (pt.closed_loop, {"plant": PLANT, "controller": CONTROLLER, "demand": DEMAND, **LOOP}),
    "loop_margins": (pt.loop_margins, {"plant": PLANT, "controller": CONTROLLER}),
    "ride_metrics": (
        pt.ride_metrics,
        {"time": 0.01 * np.arange(9), "acceleration": np.arange(9), "final": 8.0, "start": 0.0},
    ),
    "nonlinear_system": (pt.nonlinear_system, {"car": CAR, "dt": 0.01, "hold": "zero"}),
    "initial_state": (pt.initial_state, {**BELONGS, "initial_speed": {"engine": 1.0}}),
    "input_values": (pt.input_values, {**BELONGS, "timepts": TIMES, "inputs": {"engine_torque": [1.0, 2.0, 3.0]}}),
    "solver_settings": (pt.solver_settings, {"*": [DEMAND]}),
    "robustness": (pt.robustness, {"plant": PLANT, "controller": CONTROLLER, "plants": {"a": PLANT}}),
    "Robustness[]": (ROBUSTNESS.__getitem__, {"*": ["nominal"]}),
    "Robustness.worst": (ROBUSTNESS.worst, {"quantity": "overshoot", "among": lambda name: True}),
    "Proof.value": (ROBUSTNESS["nominal"].value, {"quantity": "overshoot"}),
    "ModelComparison[]": (COMPARISON.__getitem__, {"*": ["modal"]}),
    "prove": (pt.studies.prove, {"plant": PLANT, "controller": CONTROLLER}),
    "tip_in": (pt.tip_in, EXPERIMENT | SHORT),
    "tip_in, loop": (pt.tip_in, EXPERIMENT | {k: v for k, v in LOOP.items() if k != "duration"}),
    "tip_out": (pt.tip_out, EXPERIMENT | SHORT),
    "wheel_disturbance": (pt.wheel_disturbance, EXPERIMENT | SHORT),
    "tip_in_metrics": (pt.studies.tip_in_metrics, {"plant": PLANT, "response": TIP_IN}),
    "residual_rms": (pt.studies.residual_rms, {"response": TIP_IN}),
    "variations": (pt.studies.variations, {"plant": PLANT}),
    "softest_shafts": (pt.studies.softest_shafts, {"car": RIGID}),
    "scale_mass": (pt.studies.scale_mass, {"car": RIGID, "factor": 1.1}),
    "scale_stiffness": (pt.studies.scale_stiffness, {"car": RIGID, "factor": 1.1, "names": ["shafts"]}),
    "scale_stiffness of two masses": (pt.studies.scale_stiffness, {"car": MODEL, "factor": 1.1, "names": ["shafts"]}),
    "scale_damping": (pt.studies.scale_damping, {"car": RIGID, "factor": 1.1}),
    "with_modal_damping": (pt.studies.with_modal_damping, {"car": RIGID, "damping_ratios": [0.1, 0.2]}),
    "designs": (pt.antijerk.designs, {"plant": PLANT, "model": MODEL}),
    "speed_difference": (pt.antijerk.speed_difference, {"plant": PLANT, "gain": 6.0, "shaping": None}),
    "lead_notch": (
        pt.antijerk.lead_notch,
        {"plant": PLANT, "lead": (0.03, 0.01), "notch_hz": 20.0, "notch_damping": (0.1, 0.5)},
    ),
    "rigid_reference": (pt.antijerk.rigid_reference, {"plant": PLANT, "gain": 8.0, "bandwidth_hz": 0.5}),
    "inverse_notch": (
        pt.antijerk.inverse_notch,
        {"plant": PLANT, "model": MODEL, "damping_ratio": 0.7, "frequency_hz": 4.0},
    ),
    "zv_shaper": (pt.antijerk.zv_shaper, {"plant": PLANT, "model": MODEL}),
    "zvd_shaper": (pt.antijerk.zvd_shaper, {"plant": PLANT, "model": MODEL}),
    "lqg": (pt.antijerk.lqg, {"plant": PLANT, "model": MODEL, **TUNED_LQG}),
    "hinf": (pt.antijerk.hinf, {"plant": PLANT, "model": MODEL, "effort": 0.1, "corner_hz": 8.0, "noise": 0.05}),
    "hinf_synthesis": (
        pt.antijerk.hinf_synthesis,
        {"P": GENERALISED, "measurements": 1, "controls": 1, "back_off": 1.1},
    ),
    "one_dof": (pt.antijerk.one_dof, {"plant": PLANT, "feedback": FEEDBACK}),
    "two_dof": (
        pt.antijerk.two_dof,
        {"plant": PLANT, "model": MODEL, "feedback": FEEDBACK, "feedforward": FEEDFORWARD},
    ),
    "scheduled": (pt.antijerk.scheduled, {"controllers": {8.0: CONTROLLER}, "dt": 0.01}),
    "c_source": (pt.antijerk.c_source, {"controller": CONTROLLER, "name": "unit", "precision": "double"}),
    "conventional": (pt.examples.conventional, {"gear_ratio": 6.0, "damping": "closed"}),
    "path": (pt.examples.path, {"name": "conventional"}),
    "gear_shift": (
        pt.gear_shift,
        {
            "car": pt.examples.p2_hybrid(),
            "offgoing": "odd_clutch",
            "oncoming": "even_clutch",
            "torque": 100.0,
            "engine_speed": 300.0,
            "torque_phase": 0.1,
            "speed_phase": 0.2,
            "start": 0.1,
            "timepts": [0.0, 0.1, 0.2],
        },
    ),
    "engine_start": (
        pt.engine_start,
        {
            "car": pt.examples.p2_hybrid(),
            "clutch": "separation_clutch",
            "torque": 50.0,
            "capacity": 60.0,
            "speed": 150.0,
            "blending": 0.3,
            "start": 0.1,
            "compensated": True,
            "timepts": [0.0, 0.1, 0.2],
        },
    ),
    "p2_hybrid": (pt.examples.p2_hybrid, {"gear": 2, "preselected": 3}),
    "rear_wheel_drive": (pt.examples.rear_wheel_drive, {"gear": 2}),
    "all_wheel_drive": (pt.examples.all_wheel_drive, {"gear": 2}),
    "truck": (pt.examples.truck, {"gear": 2}),
    "plots.bode": (pt.plots.bode, {"responses": FREQUENCIES, "axes": None, "unit": "rad/s"}),
    "plots.load_change": (
        pt.plots.load_change,
        {
            "responses": {"car": RESPONSE},
            "ratio": 8.0,
            "axes": None,
            "unit": "m/s²",
            **{k: v for k, v in NAMES.items() if k != "shaft"},
        },
    ),
    "plots.launch": (pt.plots.launch, {"response": RESPONSE, "ratio": 8.0, "locks": [0.1], "input_shaft": "input"}),
    "plots.launch_compared": (
        pt.plots.launch_compared,
        {"responses": {"car": RESPONSE}, "locks": [0.1], "input_shaft": "input", "wheels": "wheels"},
    ),
    "plots.controlled_launch": (
        pt.plots.controlled_launch,
        {"responses": {"car": TIP_IN}, "ratio": 8.0, "axes": None, "driving": "engine", "wheels": "wheels"},
    ),
    "plots.tip_in": (pt.plots.tip_in, {"responses": {"car": TIP_IN}, "axes": None}),
    "plots.trade_off": (pt.plots.trade_off, {"points": {"a": METRICS}, "baseline": {0.1: METRICS}, "ax": None}),
    "plots.pareto": (pt.plots.pareto, {"tuned": TUNED, "ax": None}),
    "plots.pole_map": (pt.plots.pole_map, {"margins": {"a": MARGINS}, "ax": None}),
    "plots.nyquist": (pt.plots.nyquist, {"margins": {"a": MARGINS}, "ax": None}),
    "plots.disk": (pt.plots.disk, {"alpha": 1.0}),
    "plots.model_errors": (pt.plots.model_errors, {"comparison": COMPARISON, "axes": None}),
    "plots.ramp_responses": (pt.plots.ramp_responses, {"comparison": COMPARISON, "duration": 0.1, "axes": None}),
    "plots.hankel": (pt.plots.hankel, {"values": [2.0, 1.0], "ax": None}),
    "plots.error_against_order": (pt.plots.error_against_order, {"comparison": COMPARISON, "ax": None}),
    "plots.robust_spread": (pt.plots.robust_spread, {"robustness": ROBUSTNESS, "axes": None}),
    "plots.robust_responses": (
        pt.plots.robust_responses,
        {"responses": {"a": TIP_IN}, "ax": None, "final": {"a": 3.0}, "worst": "a"},
    ),
    "plots.schematic": (pt.plots.schematic, {"car": CAR, "ax": None}),
    "plots.schematic_size": (pt.plots.schematic_size, {"car": CAR}),
    "plots.mode_shape": (pt.plots.mode_shape, {"modes": MODES, "mode": 1, "ax": None}),
    "plots.mode_shape_size": (pt.plots.mode_shape_size, {"nodes": 5}),
    "plots.mode_energies": (pt.plots.mode_energies, {"modes": MODES, "ax": None, "count": 3}),
    "plots.mode_energies_size": (pt.plots.mode_energies_size, {"springs": 3, "modes": 3}),
    "plots.signals": (pt.plots.signals, {"response": RESPONSE}),
    "plots.Signals": (
        lambda **given: repr(pt.plots.Signals(**given)),
        {"time": np.zeros(1), "values": {"a": np.zeros(1)}},
    ),
}


class Hangs(BaseException):
    """A call that takes too long."""


def _alarm(*_):
    raise Hangs


def answer(function, arguments):
    """What came of a call: "answered", "refused", or the error that a user should not meet."""
    by_keyword = {name: value for name, value in arguments.items() if name != "*"}
    before = signal.signal(signal.SIGALRM, _alarm)
    signal.alarm(PATIENCE)
    try:
        function(*arguments.get("*", ()), **by_keyword)
        return "answered"
    except pt.PowertrainError as error:
        return "refused" if str(error) else "refused without a word"
    except Hangs:
        return "hangs"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def malformed(count, seed=0):
    """Calls with one nasty argument, then with two, an unknown one or one left out; every entry in turn."""
    rng = random.Random(seed)
    names = list(ENTRIES)
    for i in range(count):
        name = names[i % len(names)]
        function, right = ENTRIES[name]
        arguments = {key: list(value) if key == "*" else value for key, value in right.items()}
        places = [key for key in right if key != "*"] + [("*", j) for j in range(len(right.get("*", ())))]
        said = []
        for place in rng.sample(places, min(len(places), rng.choice((1, 1, 2)))):
            value = arguments["*"][place[1]] if isinstance(place, tuple) else arguments[place]
            nasty = rng.choice(alike(value) if rng.random() < 0.5 else list(NASTY))
            said.append(f"{place} = {nasty}")
            if isinstance(place, tuple):
                arguments["*"][place[1]] = NASTY[nasty]
            else:
                arguments[place] = NASTY[nasty]
        kind = rng.random()
        if getattr(function, "__name__", "").startswith(("<", "__")):
            pass
        elif kind < 0.03:
            arguments["nonsense"] = 1.0
            said.append("nonsense")
        elif kind < 0.06 and places and not isinstance(places[0], tuple):
            del arguments[places[0]]
            said.append(f"without {places[0]}")
        yield f"{name}: {', '.join(said)}", function, arguments


def test_right_arguments_are_answered(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, (function, arguments) in ENTRIES.items():
        if name not in ("simulate from a State",):
            assert answer(function, arguments) == "answered", name


def test_malformed_calls_are_answered_or_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    wrong = []
    for said, function, arguments in malformed(CASES):
        with contextlib.redirect_stdout(io.StringIO()):
            came = answer(function, arguments)
        plt.close("all")
        if came not in ("answered", "refused"):
            wrong.append(f"{said}: {came}")
    assert not wrong, "\n".join(wrong)


SPACES = (pt, pt.studies, pt.antijerk, pt.plots, pt.examples)


def test_every_public_function_has_a_door():
    functions = {f"{space.__name__}.{name}": getattr(space, name) for space in SPACES for name in space.__all__}
    open_ones = [n for n, f in functions.items() if inspect.isfunction(f) and not hasattr(f, "__wrapped__")]
    classes = {name: c for name, c in functions.items() if inspect.isclass(c) and not issubclass(c, Exception)}
    assert not open_ones
    assert not [name for name, c in classes.items() if not hasattr(c.__init__, "__wrapped__")]


def test_a_function_with_a_door_can_be_sent_to_another_process():
    for function in (pt.launch, pt.antijerk.lqg, pt.studies.prove):
        assert pickle.loads(pickle.dumps(function)) is function
