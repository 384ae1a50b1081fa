"""Drivelines from files."""

from __future__ import annotations

from pathlib import Path

from ..base.doors import checked
from ..base.errors import FileError, PowertrainError
from ..base.paths import written
from . import opentorsion, toml
from .collection import Driveline


@checked
def load(path: str | Path) -> Driveline:
    """Read a driveline from a TOML file, or from one of openTorsion.

    Parameters
    ----------
    path : str or Path
        A file that ends in ``.json`` is a driveline of openTorsion ("TORS"): its nodes are n0, n1, ... as they are met from
        where the driveline begins, its shafts and gears are named "component_element".

    Returns
    -------
    Driveline

    Raises
    ------
    FileError
        Not there, not TOML or JSON, an unknown type or key, a missing one, a value out of range; names file, table and key.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.load(pt.examples.path("conventional"))["vehicle"]
    Mass(name='vehicle', m=2000.0)
    """
    is_json = Path(path).suffix.lower() == ".json"
    elements, released = (opentorsion.read(path), {}) if is_json else toml.read(path)
    try:
        car = Driveline(*elements)
    except PowertrainError as error:
        raise FileError(f"{written(path)}: {error}") from error
    for name, is_released in released.items():
        car = car.release(name) if is_released else car.lock(name)
    return car
