"""`family`: variants of a driveline from the values in which they differ."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..base.doors import checked
from ..driveline.collection import HasDriveline
from ..linear.assembly import as_driveline
from .collection import Family
from .variants import variants_of


@checked
def family(car: HasDriveline, values: Mapping[str, Any], grid: bool = False) -> Family:
    """Variants of a driveline: seven gears, three loads, a tolerance on every stiffness.

    Parameters
    ----------
    car : Driveline or TwoMass
    values : mapping
        ``"element.parameter"`` to the values of its variants, as many of each; a single value is that of all. Any parameter
        of any element: inertias and stiffnesses, ratios and radii, but also nodes, or None for rigid rolling;
        ``"clutch.locked"`` is True or False. Where variants differ in structure they are computed apart.
    grid : bool
        Every value with every other: gears times loads. With two values of each, the corners of the tolerances.

    Returns
    -------
    Family

    Raises
    ------
    UnknownNameError
        An element that is not there.
    ParameterError
        A value that is not permitted; the variant is named.
    PowertrainError
        A parameter that an element does not have, values of different length without a grid, a variant that is no
        driveline.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> corners = pt.family(car, {"vehicle.m": (1600.0, 2400.0), "drive_shafts.stiffness": (3e4, 4e4)}, grid=True)
    >>> corners.modes().frequency_hz[:, 1].round(2)
    array([2.62, 2.92, 2.42, 2.7 ])
    >>> pt.family(car, {"clutch.locked": [True, False]}).modes().frequency_hz[:, :3].round(2)
    array([[ 0.  ,  2.64, 21.09],
           [ 0.  ,  0.  ,  7.25]])
    """
    nominal = as_driveline(car)
    variants, shape = variants_of(nominal, values, grid)
    return Family(nominal, variants.values, shape, variants)
