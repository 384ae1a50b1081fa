"""From measured runs to the car: runs from files, parameters by output error, ring-down and order tracking."""

from .decay import RingDown, Tracked, order_tracking, ring_down
from .identified import Identified, Validation
from .output_error import identify, validate
from .runs import MeasuredRun, read_run

__all__ = [
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
]
