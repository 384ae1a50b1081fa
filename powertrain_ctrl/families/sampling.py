"""Random variants that fill the space of their tolerances evenly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..base.checks import NOT_NEGATIVE, AtLeastOne, Seed, checked_number
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError, shown
from ..driveline.collection import Driveline, HasDriveline, require_parameter
from ..linear.assembly import as_driveline
from .collection import Family
from .making import family

METHODS = ("latin hypercube", "sobol")


@checked
def sample(
    car: HasDriveline,
    spread: Mapping[str, Any],
    n: AtLeastOne = 1000,
    seed: Seed = 0,
    method: str = "latin hypercube",
) -> Family:
    """Random variants of a driveline, independent in each parameter.

    Parameters
    ----------
    car : Driveline or TwoMass
    spread : mapping
        ``"element.parameter"`` to the standard deviation of its logarithm, 0.1 for about 10 %, of a log-normal
        distribution around its value; or to ``(least, largest)``, between which it is uniform.
    n : int
        Variants.
    seed : int
        The same seed gives the same variants.
    method : {"latin hypercube", "sobol"}
        Each of n equally probable ranges of each parameter once (M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21
        (1979) 239); or a scrambled Sobol' sequence, even in several parameters together where n is a power of 2.

    Returns
    -------
    Family

    Raises
    ------
    UnknownNameError
        An element that is not there.
    ParameterError
        A spread that is negative, bounds that are not in order or not permitted.
    PowertrainError
        A parameter that is not there, or that has no value to spread around; a method that is not known.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> cars = pt.sample(
    ...     pt.examples.conventional(), {"drive_shafts.stiffness": 0.1, "vehicle.m": (1600.0, 2400.0)}, n=1000, seed=1
    ... )
    >>> round(float(np.log(cars.values["drive_shafts.stiffness"]).std()), 2), round(cars.values["vehicle.m"].mean())
    (0.1, 2000)
    >>> cars.modes().percentiles()["frequency_hz"][:, 1].round(1)
    array([2.5, 2.6, 2.8])
    """
    if method not in METHODS:
        raise PowertrainError(f"method = {method!r}, permitted: {', '.join(map(repr, METHODS))}")
    if not spread:
        raise PowertrainError('spread is empty, permitted: {"element.parameter": 0.1, ...}')
    nominal = as_driveline(car)
    return family(nominal, values_at(nominal, spread, _shares(len(spread), n, seed, method)))


def values_at(nominal: Driveline, spread: Mapping[str, Any], shares: np.ndarray) -> dict[str, np.ndarray]:
    """Values (n,) by ``element.parameter`` at probabilities (n, parameters)."""
    values = {}
    for name, wide, column in zip(spread, spread.values(), shares.T, strict=True):
        key, _, parameter = str(name).partition(".")
        require_parameter(nominal[key], parameter)
        values[name] = _spread(name, getattr(nominal[key], parameter), wide, column)
    return values


def _shares(count: int, n: int, seed: int, method: str) -> np.ndarray:
    """(n, count) ndarray of probabilities."""
    from scipy.stats import qmc

    engine = qmc.LatinHypercube if method == "latin hypercube" else qmc.Sobol
    random = np.random.default_rng(seed)
    return engine(count, seed=random).random(n)


def _spread(name: str, nominal: Any, wide: Any, share: np.ndarray) -> np.ndarray:
    from scipy.special import ndtri

    element, _, parameter = name.partition(".")
    if isinstance(wide, tuple | list | np.ndarray):
        bounds = [checked_number(element, f"{parameter}: bound", bound, "", "finite") for bound in wide]
        if len(bounds) != 2 or not bounds[0] <= bounds[1]:
            raise ParameterError(element, f"{parameter}: bounds", shown(wide), "", "(least, largest)")
        return bounds[0] + share * (bounds[1] - bounds[0])
    deviation = checked_number(element, f"spread of {parameter}", wide, "", NOT_NEGATIVE)
    if not isinstance(nominal, float) or not nominal:
        raise PowertrainError(f"{name} = {nominal}, permitted: a value to spread around; give its (least, largest)")
    inside = np.clip(share, np.finfo(float).tiny, 1.0 - np.finfo(float).epsneg)
    return nominal * np.exp(deviation * ndtri(inside))
