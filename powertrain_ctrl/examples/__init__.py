"""Drivelines to start from: the source's car, others with published frequencies, and typical cars of each layout."""

from ..base.errors import absent
from .files import path
from .published import DAMPING, conventional, front_wheel_drive, marine, wind_turbine
from .typical import all_wheel_drive, electric, p2_hybrid, rear_wheel_drive, truck

__all__ = [
    "DAMPING",
    "all_wheel_drive",
    "conventional",
    "electric",
    "front_wheel_drive",
    "marine",
    "p2_hybrid",
    "path",
    "rear_wheel_drive",
    "truck",
    "wind_turbine",
]

__getattr__ = absent(__name__, __all__)
