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

Physical values are given by keyword, in SI units. Names of signals and presets are in the docstrings of the functions
below.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from . import examples, orders
from .base.errors import (
    ArgumentError,
    FileError,
    ParameterError,
    PowertrainError,
    SignalError,
    TopologyError,
    UnknownNameError,
)
from .base.errors import absent as _absent
from .base.units import kmh, rpm
from .driveline.collection import Driveline
from .driveline.files import load
from .elements import (
    Backlash,
    Clutch,
    Compliance,
    Constraint,
    Differential,
    DogClutch,
    Drag,
    Gear,
    Inertia,
    Mass,
    MultiStageSpring,
    OneWayClutch,
    Pendulum,
    Planetary,
    RoadLoad,
    Shaft,
    SlipTyre,
    SpeedCoupling,
    SpeedSource,
    SpringDamper,
    TorqueConverter,
    TorqueSplit,
    Tyre,
)
from .families.collection import Family
from .families.frequencies import FamilyModes
from .families.impedances import FamilyForcedResponse
from .families.making import family
from .families.responses import FamilyResponse
from .families.sampling import sample
from .hybrid.cranking import engine_start
from .hybrid.harmonics import harmonic
from .hybrid.manoeuvres import launch, load_change
from .hybrid.response import Event, Response, State
from .hybrid.shifting import gear_shift
from .hybrid.signals import ramp, samples, step
from .hybrid.simulation import simulate
from .linear.assembly import TorsionalModel, assemble
from .linear.forced import ForcedResponse, forced_response, frequency_response
from .linear.modal import Modes, modes
from .linear.reflection import reflected
from .linear.spectrum import poles
from .orders.critical import CriticalSpeeds, critical_speeds
from .orders.engine import Engine
from .orders.response import OrderResponse, order_response
from .reduction.condensed import two_mass
from .reduction.twomass import SwitchedTwoMass, TwoMass

if TYPE_CHECKING:
    from . import antijerk, export, plots, studies
    from .hybrid.metrics import RideMetrics, ride_metrics
    from .hybrid.nonlinear import initial_state, input_values, nonlinear_system, solver_settings
    from .identification import (
        Identified,
        MeasuredRun,
        RingDown,
        Tracked,
        Validation,
        identify,
        order_tracking,
        read_run,
        ring_down,
        validate,
    )
    from .linear.describing import DescribedFrequency, describing_frequency
    from .linear.statespace import state_space
    from .linear.steady import static_gain
    from .notebook.sliders import explore
    from .reduction.balanced import hankel_singular_values, reduced
    from .reduction.comparison import ModelComparison, compare_models
    from .sampled.controller import ControllerStepper
    from .sampled.driving import controlled_run
    from .sampled.files import load_plant
    from .sampled.loop import closed_loop
    from .sampled.manoeuvres import controlled_launch, controlled_shift, controlled_start
    from .sampled.margins import LoopMargins, loop_margins
    from .sampled.plant import SampledPlant
    from .sampled.rate_limit import RateMargin
    from .sampled.sensors import Sensors
    from .sampled.unit import ControlUnit
    from .studies import Robustness, braking, change_of_mind, let_off, robustness, tip_in, tip_out, wheel_disturbance

# Imported on first use, because they import python-control or pyplot: what each of these modules exports.
_ON_FIRST_USE = {
    "reduction.comparison": ("ModelComparison", "compare_models"),
    "sampled.driving": ("controlled_run",),
    "sampled.manoeuvres": ("controlled_launch", "controlled_shift", "controlled_start"),
    "sampled.margins": ("LoopMargins", "loop_margins"),
    "hybrid.metrics": ("RideMetrics", "ride_metrics"),
    "identification": (
        "Identified",
        "MeasuredRun",
        "RingDown",
        "Tracked",
        "Validation",
        "identify",
        "order_tracking",
        "read_run",
        "ring_down",
        "validate",
    ),
    "hybrid.nonlinear": ("initial_state", "input_values", "nonlinear_system", "solver_settings"),
    "reduction.balanced": ("hankel_singular_values", "reduced"),
    "sampled.files": ("load_plant",),
    "sampled.plant": ("SampledPlant",),
    "sampled.rate_limit": ("RateMargin",),
    "linear.describing": ("DescribedFrequency", "describing_frequency"),
    "linear.statespace": ("state_space",),
    "linear.steady": ("static_gain",),
    "notebook.sliders": ("explore",),
    "sampled.controller": ("ControllerStepper",),
    "sampled.loop": ("closed_loop",),
    "sampled.sensors": ("Sensors",),
    "sampled.unit": ("ControlUnit",),
    "studies": (
        "Robustness",
        "braking",
        "change_of_mind",
        "let_off",
        "robustness",
        "tip_in",
        "tip_out",
        "wheel_disturbance",
    ),
}
_MODULE_OF = {name: module for module, names in _ON_FIRST_USE.items() for name in names}
_LAZY_MODULES = ("antijerk", "export", "plots", "studies")
# Words by which what is here is looked for.
_GUESSED = {
    "Spring": "SpringDamper",
    "Damper": "SpringDamper",
    "Body": "Inertia",
    "Flywheel": "Inertia",
    "Rotor": "Inertia",
    "Disc": "Inertia",
    "Wheel": "Inertia",
    "Vehicle": "Mass",
    "Brake": "Clutch",
    "Powertrain": "Driveline",
    "read": "load",
    "read_csv": "read_run",
    "fit": "identify",
    "loadmat": "export.load",
    "savemat": "export.mat",
    "eig": "modes",
    "eigenfrequencies": "modes",
    "natural_frequencies": "modes",
    "tip_in_metrics": "studies.tip_in_metrics",
    "characteristic": "plots.characteristic",
    "campbell": "plots.campbell",
    "wiebe": "orders.wiebe",
    "eigenvalues": "poles",
    "ss": "state_space",
    "transfer_function": "state_space",
    "freqresp": "frequency_response",
    "bode": "plots.bode",
    "nyquist": "plots.nyquist",
    "mode_shape": "plots.mode_shape",
    "schematic": "plots.schematic",
    "designs": "antijerk.designs",
    "c_source": "antijerk.c_source",
    "variations": "studies.variations",
    "conventional": "examples.conventional",
}

__version__ = "0.2.0"
__all__ = [
    "ArgumentError",
    "Backlash",
    "Clutch",
    "Compliance",
    "Constraint",
    "ControlUnit",
    "ControllerStepper",
    "CriticalSpeeds",
    "DescribedFrequency",
    "Differential",
    "DogClutch",
    "Drag",
    "Driveline",
    "Engine",
    "Event",
    "Family",
    "FamilyForcedResponse",
    "FamilyModes",
    "FamilyResponse",
    "FileError",
    "ForcedResponse",
    "Gear",
    "Identified",
    "Inertia",
    "LoopMargins",
    "Mass",
    "MeasuredRun",
    "ModelComparison",
    "Modes",
    "MultiStageSpring",
    "OneWayClutch",
    "OrderResponse",
    "ParameterError",
    "Pendulum",
    "Planetary",
    "PowertrainError",
    "RateMargin",
    "Response",
    "RideMetrics",
    "RingDown",
    "RoadLoad",
    "Robustness",
    "SampledPlant",
    "Sensors",
    "Shaft",
    "SignalError",
    "SlipTyre",
    "SpeedCoupling",
    "SpeedSource",
    "SpringDamper",
    "State",
    "SwitchedTwoMass",
    "TopologyError",
    "TorqueConverter",
    "TorqueSplit",
    "TorsionalModel",
    "Tracked",
    "TwoMass",
    "Tyre",
    "UnknownNameError",
    "Validation",
    "antijerk",
    "assemble",
    "braking",
    "change_of_mind",
    "closed_loop",
    "compare_models",
    "controlled_launch",
    "controlled_run",
    "controlled_shift",
    "controlled_start",
    "critical_speeds",
    "describing_frequency",
    "engine_start",
    "examples",
    "explore",
    "export",
    "family",
    "forced_response",
    "frequency_response",
    "gear_shift",
    "hankel_singular_values",
    "harmonic",
    "identify",
    "initial_state",
    "input_values",
    "kmh",
    "launch",
    "let_off",
    "load",
    "load_change",
    "load_plant",
    "loop_margins",
    "modes",
    "nonlinear_system",
    "order_response",
    "order_tracking",
    "orders",
    "plots",
    "poles",
    "ramp",
    "read_run",
    "reduced",
    "reflected",
    "ride_metrics",
    "ring_down",
    "robustness",
    "rpm",
    "sample",
    "samples",
    "simulate",
    "solver_settings",
    "state_space",
    "static_gain",
    "step",
    "studies",
    "tip_in",
    "tip_out",
    "two_mass",
    "validate",
    "wheel_disturbance",
]


def _schematic(car: Driveline) -> str | None:
    from .notebook.pictures import schematic_svg

    return schematic_svg(car)


# What a notebook shows of a driveline is drawn with figures, of which the driveline itself knows nothing.
Driveline._repr_svg_ = _schematic  # type: ignore[attr-defined]


def __getattr__(name: str) -> Any:
    if name in _LAZY_MODULES:
        return import_module(f".{name}", __name__)
    if name in _MODULE_OF:
        return getattr(import_module(f".{_MODULE_OF[name]}", __name__), name)
    if name in _GUESSED:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; did you mean pt.{_GUESSED[name]}?")
    return _absent(__name__, __all__)(name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
