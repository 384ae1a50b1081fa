"""Sampled plants from files."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from ..base.doors import checked
from ..base.errors import FileError, PowertrainError, suggestion
from ..base.paths import written
from ..driveline.files import load
from ..driveline.toml import plant_table
from .plant import SampledPlant

# What the table says, all but the car.
KEYS = tuple(item.name for item in dataclasses.fields(SampledPlant) if item.name != "car")


@checked
def load_plant(path: str | Path) -> SampledPlant:
    """Read a driveline and what drives it, the table ``[plant]``, from a TOML file.

    Parameters
    ----------
    path : str or Path
        A file as of `load`. Keys of its table ``[plant]`` are the parameters of `SampledPlant`, those that are not
        there have their default: ``lag = 0.005``, ``torque_limits = [-300.0, 300.0]``; over speed as rows,
        ``torque_limits = [[0.0, -300.0, 300.0], [500.0, -150.0, 150.0]]``, ``lag = [[100.0, 0.06], [300.0, 0.02]]``;
        of a rise and of a fall ``lag = [0.06, 0.03]``, over speed ``lag = [[100.0, 0.06, 0.03], [300.0, 0.02, 0.01]]``.

    Returns
    -------
    SampledPlant

    Raises
    ------
    FileError
        As of `load`; an unknown key, a value out of range.
    TopologyError
        A driveline that a `SampledPlant` cannot be.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.load_plant(pt.examples.path("electric"))
    SampledPlant: lag 5 ms, delay 2 ms, dt 2 ms, torque -300 to 300 N m; motor, wheels, vehicle, ratio 9.5
    """
    car = load(path)
    table = plant_table(path)
    where = f"{written(path)}: [plant]"
    for key in table:
        if key not in KEYS:
            raise FileError(f'{where}: unknown key "{key}"{suggestion(key, KEYS)}')
    try:
        return SampledPlant(car=car, **table)
    except PowertrainError as error:
        raise FileError(f"{where}: {error}") from error
