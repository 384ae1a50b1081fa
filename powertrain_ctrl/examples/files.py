"""Where the examples are: one file each, to copy and change."""

from __future__ import annotations

from pathlib import Path

from ..base.doors import checked
from ..base.errors import PowertrainError

CARS = (
    "conventional",
    "front_wheel_drive",
    "electric",
    "p2_hybrid",
    "rear_wheel_drive",
    "all_wheel_drive",
    "truck",
    "wind_turbine",
    "marine",
)
_FOLDER = Path(__file__).parent


@checked
def path(name: str) -> Path:
    """Path of an example's file, to copy and change.

    Parameters
    ----------
    name : str
        As its function is called.

    Returns
    -------
    Path

    Raises
    ------
    PowertrainError
        No example of that name.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.examples.path("conventional").name
    'conventional.toml'
    """
    if name not in CARS:
        raise PowertrainError(f'there is no example "{name}", permitted: {", ".join(CARS)}')
    return _FOLDER / f"{name}.toml"
