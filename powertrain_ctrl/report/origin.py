"""Where a report comes from: versions, command, day and driveline file."""

from __future__ import annotations

import platform
from dataclasses import dataclass
from importlib.metadata import version

from .. import __version__
from ..driveline.collection import Driveline
from ..driveline.standing import stated
from ..driveline.toml import text_of

NUMERICS = ("control", "numpy", "scipy", "matplotlib", "slycot")


@dataclass(frozen=True)
class Origin:
    """What the foot of a report says; without a command and a day it is the same for the same driveline."""

    command: str = ""
    day: str = ""

    @property
    def text(self) -> str:
        by = f"Made{f' on {self.day}' if self.day else ''}{f' by {self.command}' if self.command else ''} with "
        return (
            by
            + f"powertrain_ctrl {__version__}, {', '.join(f'{name} {version(name)}' for name in NUMERICS)}, "
            + (f"Python {platform.python_version()}.")
        )


def driveline_file(car: Driveline) -> str:
    """The driveline as the file that gives it."""
    return text_of(car.elements, stated(car, car.nodes, car.released))
