"""Which tolerances a quantity comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.checks import AtLeastOne, Seed
from ..base.doors import called, checked
from ..base.errors import PowertrainError
from ..base.records import Record
from ..base.tables import Printed
from ..driveline.collection import HasDriveline
from ..families.collection import Family
from ..families.making import family
from ..families.sampling import values_at
from ..linear.assembly import as_driveline


@called
@dataclass(frozen=True, eq=False, repr=False)
class SobolIndices(Printed, Record):
    """Shares of the variance of a quantity.

    Attributes
    ----------
    first, total : dict
        ``element.parameter`` to the share that it makes alone, and to that in which it has a part.
    mean, deviation : float
        Of the quantity over all tolerances.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car, tolerances = pt.examples.conventional(), {"drive_shafts.stiffness": 0.1, "vehicle.m": 0.1}
    >>> pt.studies.sobol(car, tolerances, lambda cars: cars.natural_frequencies()[:, 1], n=1024)
    parameter               alone  in all
    drive_shafts.stiffness   0.80    0.80
    vehicle.m                0.20    0.20
    """

    first: dict[str, float]
    total: dict[str, float]
    mean: float
    deviation: float

    headers = ("parameter", "alone", "in all")

    def rows(self) -> Iterator[list[str]]:
        """Rows of the printed table, the largest share first."""
        for name in sorted(self.total, key=lambda name: -round(self.total[name], 6)):
            yield [name, f"{self.first[name] + 0.0:.2f}", f"{self.total[name] + 0.0:.2f}"]


@checked
def sobol(
    car: HasDriveline,
    spread: Mapping[str, Any],
    quantity: Callable[[Family], Any],
    n: AtLeastOne = 1024,
    seed: Seed = 0,
) -> SobolIndices:
    """Sobol' indices of a quantity: which tolerances its spread comes from.

    Estimators of A. Saltelli et al., Computer Physics Communications 181 (2010) 259, as ``scipy.stats.sobol_indices``
    computes them from ``n (2 + parameters)`` cars.

    Parameters
    ----------
    car : Driveline or TwoMass
    spread : mapping
        As of `sample`, at least two parameters.
    quantity : callable
        Of a `Family`, to a value of each of its variants: ``lambda cars: cars.natural_frequencies()[:, 1]``.
    n : int
        A power of 2.
    seed : int

    Returns
    -------
    SobolIndices

    Raises
    ------
    UnknownNameError
        An element that is not there.
    ParameterError
        A spread that is not possible.
    PowertrainError
        An n that is not a power of 2; a quantity that gives no finite number for each variant.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car, tolerances = pt.examples.conventional(), {"engine.J": 0.1, "vehicle.m": 0.1}
    >>> result = pt.studies.sobol(car, tolerances, lambda cars: cars.modes().damping_ratio[:, 1], n=256)
    >>> {name: round(share, 1) for name, share in result.total.items()}
    {'engine.J': 0.5, 'vehicle.m': 0.5}
    """
    import scipy.stats

    if n < 2 or n & (n - 1):
        raise PowertrainError(f"n = {n}, permitted: a power of 2")
    if len(spread) < 2:
        raise PowertrainError(
            f"spread of {len(spread)} parameters, permitted: at least two, between which it is shared"
        )
    nominal, seen = as_driveline(car), []

    def of_shares(shares: np.ndarray) -> np.ndarray:
        cars = family(nominal, values_at(nominal, spread, shares.reshape(len(spread), -1).T))
        values = np.asarray(quantity(cars), dtype=float)
        if values.shape != (len(cars),) or not np.isfinite(values).all():
            raise PowertrainError(
                f"quantity gives values of shape {values.shape}, permitted: a finite number for each of {len(cars)} variants"
            )
        seen.append(values)
        return values.copy().reshape(1, *shares.shape[1:])

    uniform = [scipy.stats.uniform()] * len(spread)
    found = scipy.stats.sobol_indices(func=of_shares, n=n, dists=uniform, random_state=np.random.default_rng(seed))
    # the first two sets are independent of each other, the others made of them
    independent = np.concatenate(seen)[: 2 * n]
    names = list(spread)
    return SobolIndices(
        first=dict(zip(names, np.ravel(found.first_order).tolist(), strict=True)),
        total=dict(zip(names, np.ravel(found.total_order).tolist(), strict=True)),
        mean=float(independent.mean()),
        deviation=float(independent.std()),
    )
