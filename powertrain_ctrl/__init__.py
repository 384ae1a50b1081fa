"""Torsional oscillations of vehicle powertrains as python-control systems.

Describe a driveline by its elements, then ask for what you need:

>>> import powertrain_ctrl as pt
>>> car = pt.Driveline(
...     pt.Inertia("engine", J=0.25),
...     pt.Gear("gearbox", "engine", "axle", ratio=12.0),
...     pt.SpringDamper("halfshafts", "axle", "wheels", stiffness=12e3, damping=60.0),
...     pt.Inertia("wheels", J=3.0),
...     pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=8e5, damping=4e3),
...     pt.Mass("vehicle", m=1400.0),
... )
>>> pt.modes(car).frequency_hz.round(2)
array([ 0.  ,  3.05, 26.89])
>>> G = pt.state_space(car, inputs="engine_torque", outputs="vehicle_acceleration")  # a control.StateSpace
>>> G.nstates
4

Names of signals, presets and element types are in the docstrings of the functions below; SI units throughout.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from . import examples
from .assembly import TorsionalModel, assemble
from .driveline import Driveline
from .elements import (
    Clutch,
    Compliance,
    Constraint,
    Drag,
    Gear,
    Inertia,
    Mass,
    Planetary,
    Shaft,
    SpringDamper,
    Tyre,
)
from .errors import (
    FileError,
    ParameterError,
    PowertrainError,
    SignalError,
    TopologyError,
    UnknownNameError,
)
from .files import load
from .manoeuvres import launch, load_change
from .modal import Modes, modes, poles
from .signals import ramp, step
from .simulation import Event, Response, State, simulate
from .twomass import SwitchedTwoMass, TwoMass, two_mass
from .units import kmh, rpm

if TYPE_CHECKING:
    from .comparison import ModelComparison, compare_models
    from .nonlinear import initial_state, nonlinear_system, solver_settings
    from .reduction import hankel_singular_values, reduced
    from .statespace import state_space

# Imported on first use, because they import python-control or pyplot.
_ON_FIRST_USE = {
    "state_space": "statespace",
    "nonlinear_system": "nonlinear",
    "initial_state": "nonlinear",
    "solver_settings": "nonlinear",
    "reduced": "reduction",
    "hankel_singular_values": "reduction",
    "compare_models": "comparison",
    "SampledPlant": "sampled",
    "Sensors": "sampled",
    "closed_loop": "sampled",
    "ControllerStepper": "sampled",
    "controlled_launch": "driveaway",
    "ride_metrics": "metrics",
    "loop_margins": "loops",
    "robustness": "studies",
    "tip_in": "studies",
    "tip_out": "studies",
    "wheel_disturbance": "studies",
    "studies": "studies",
    "antijerk": "antijerk",
    "ModelComparison": "comparison",
    "plots": "plots",
}

__version__ = "0.1.0"
__all__ = [
    "Clutch",
    "Compliance",
    "Constraint",
    "Drag",
    "Driveline",
    "Event",
    "FileError",
    "Gear",
    "Inertia",
    "Mass",
    "ModelComparison",
    "Modes",
    "ParameterError",
    "Planetary",
    "PowertrainError",
    "Response",
    "Shaft",
    "SignalError",
    "SpringDamper",
    "State",
    "SwitchedTwoMass",
    "TopologyError",
    "TorsionalModel",
    "TwoMass",
    "Tyre",
    "UnknownNameError",
    "assemble",
    "compare_models",
    "examples",
    "hankel_singular_values",
    "initial_state",
    "kmh",
    "launch",
    "load",
    "load_change",
    "modes",
    "nonlinear_system",
    "poles",
    "ramp",
    "reduced",
    "rpm",
    "simulate",
    "solver_settings",
    "state_space",
    "step",
    "two_mass",
]


def __getattr__(name: str):
    if name not in _ON_FIRST_USE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f".{_ON_FIRST_USE[name]}", __name__)
    return module if _ON_FIRST_USE[name] == name else getattr(module, name)


def __dir__():
    return sorted({*globals(), *__all__})
