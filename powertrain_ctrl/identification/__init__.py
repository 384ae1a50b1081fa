"""From measured runs to the car: runs from files, parameters by output error, ring-down and order tracking."""

from .identified import Identified, RingDown, Validation
from .output_error import identify, validate
from .runs import MeasuredRun, read_run

__all__ = [
    "Identified",
    "MeasuredRun",
    "RingDown",
    "Validation",
    "identify",
    "read_run",
    "validate",
]
