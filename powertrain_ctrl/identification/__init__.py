"""From measured runs to the car: runs from files, parameters by output error, ring-down and order tracking."""

from .decay import RingDown, ring_down
from .identified import Identified, Validation
from .measured import MeasuredRun
from .output_error import identify, validate
from .runs import read_run
from .tracking import Tracked, order_tracking

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
