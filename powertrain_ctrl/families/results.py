"""What every result of a family can do: percentiles, the worst variant with its car, dicts, labelled arrays, a table."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from ..base.checks import Number
from ..base.doors import checked
from ..base.errors import PowertrainError, UnknownNameError
from ..base.tables import Printed
from ..driveline.collection import Driveline
from .failures import Failure

if TYPE_CHECKING:
    import xarray

# Quantities of which the least is worst; of all others the largest is.
LEAST_IS_WORST = frozenset(
    (
        "damping_ratio",
        "disk_margin",
        "disturbance_reduction",
        "frequency_hz",
        "gain_margin_db",
        "oscillation_reduction",
        "phase_margin_deg",
        "stable",
        "zeta_first",
        "zeta_second",
    )
)
# Rows of a printed table.
SHOWN = 6


class Family(Protocol):
    """What a result needs of the family that it is of."""

    @property
    def nominal(self) -> Driveline: ...

    @property
    def values(self) -> dict[str, np.ndarray]: ...

    @property
    def shape(self) -> tuple[int, ...]: ...

    def __len__(self) -> int: ...

    @property
    def units(self) -> dict[str, str]: ...

    def car(self, variant: int) -> Driveline: ...

    def _computed(
        self, function: Callable[..., dict[str, np.ndarray]], *more: Any
    ) -> tuple[dict[str, np.ndarray], dict[int, Failure]]: ...


class Quantity(NamedTuple):
    """Values of all variants (n, ...), their unit and the names of the other axes."""

    values: np.ndarray
    unit: str = ""
    axes: tuple[str, ...] = ()


class Worst(NamedTuple):
    """Number of a variant and its value."""

    variant: int
    value: float


class OfFamily(Printed):
    """Common part of the results of a family."""

    family: Family
    errors: dict[int, Failure]

    def quantities(self) -> dict[str, Quantity]:
        """By name, what the result holds of each variant."""
        raise NotImplementedError

    def _quantity(self, name: str) -> Quantity:
        known = self.quantities()
        if name not in known:
            raise UnknownNameError("quantity", name, known, "of this result")
        return known[name]

    @checked
    def percentiles(self, q: Number | Sequence[Number] = (5.0, 50.0, 95.0)) -> Any:
        """Percentiles over the variants.

        Parameters
        ----------
        q : float or sequence of float
            Percentages, 0 to 100.

        Returns
        -------
        dict or ndarray
            Name to (len(q), ...) ndarray; of a result that is an array, one such array. Variants without a value do not
            count; of complex values real and imaginary parts have percentiles of their own.
        """
        share = np.asarray(q, dtype=float)
        if not ((share >= 0.0) & (share <= 100.0)).all():
            raise PowertrainError(f"q = {q}, permitted: 0 to 100")
        found = {name: _percentiles(quantity.values, share) for name, quantity in self.quantities().items()}
        return found if len(found) > 1 or not isinstance(self, np.ndarray) else next(iter(found.values()))

    @checked
    def worst(self, name: str) -> Worst:
        """Variant that is worst in a quantity; its driveline is ``result.car(worst.variant)``.

        Parameters
        ----------
        name : str
            Of damping ratios, frequencies (without rigid motions), margins and reductions the least is worst, of all
            others the largest; of poles the one that is damped least.

        Returns
        -------
        Worst
            ``variant`` and ``value``.

        Raises
        ------
        UnknownNameError
            No quantity of that name.
        PowertrainError
            No variant has a value.
        """
        values = self._quantity(name).values
        if np.iscomplexobj(values):
            with np.errstate(divide="ignore", invalid="ignore"):
                values = np.where(values.imag > 0.0, -values.real / np.abs(values), np.nan)
            least = True
        else:
            values, least = np.asarray(values, dtype=float), name in LEAST_IS_WORST
        if name == "frequency_hz":
            values = np.where(values > 0.0, values, np.nan)
        if np.isnan(values).all():
            raise PowertrainError(f"{name}: no variant has a value")
        place = int(np.nanargmin(values) if least else np.nanargmax(values))
        return Worst(place // (values.size // len(values)), float(values.flat[place]))

    @checked
    def car(self, variant: int) -> Driveline:
        """Driveline of a variant.

        Parameters
        ----------
        variant : int
            0 to n - 1.

        Returns
        -------
        Driveline
        """
        return self.family.car(variant)

    def to_dict(self) -> dict[str, list]:
        """Lists by name, for JSON or pandas: values of the variants, then what was computed.

        What is missing is None, a complex number is a pair.
        """
        columns = {name: column.tolist() for name, column in self.family.values.items()}
        return {**columns, **{name: _listed(quantity.values) for name, quantity in self.quantities().items()}}

    def to_xarray(self) -> xarray.Dataset:
        """As ``xarray.Dataset``, with units, along ``variant``, whose coordinates are the values (extra ``studies``).

        Raises
        ------
        PowertrainError
            xarray is not installed.
        """
        try:
            import xarray
        except ImportError as error:
            raise PowertrainError('to_xarray needs xarray: pip install "powertrain-ctrl[studies]"') from error
        data = {
            name: (("variant", *_axes(quantity, name)), np.asarray(quantity.values), {"units": quantity.unit})
            for name, quantity in self.quantities().items()
        }
        units = self.family.units
        coordinates = {
            name: ("variant", column if column.dtype != object else column.astype(str), {"units": units[name]})
            for name, column in self.family.values.items()
        }
        return xarray.Dataset(data, coords={**coordinates, **self._coordinates()})

    def _coordinates(self) -> dict[str, Any]:
        """Coordinates of other axes than that of the variants."""
        return {}

    headers = ("quantity", "unit", "5 %", "median", "95 %")

    def rows(self) -> Iterator[list[str]]:
        """Rows of the printed table: percentiles of each quantity, of the first few numbers that it has."""
        for name, quantity in self.quantities().items():
            values = quantity.values
            if values.dtype.kind not in "biufc":
                continue
            three = _percentiles(values, np.array([5.0, 50.0, 95.0])).reshape(3, -1)
            for i in range(min(three.shape[1], SHOWN)):
                label = name if three.shape[1] == 1 else f"{name}[{i}]"
                yield [label, quantity.unit, *("–" if np.isnan(value) else f"{value:.4g}" for value in three[:, i])]
            if three.shape[1] > SHOWN:
                yield [f"{name}[...{three.shape[1] - 1}]", quantity.unit, "", "", ""]

    @property
    def heading(self) -> str:
        """What stands above the printed table."""
        failed = f", {len(self.errors)} of them failed" if self.errors else ""
        return f"{self._called}: {len(self.family)} variants{failed}"

    @property
    def _called(self) -> str:
        return type(self).__name__


class FamilyArray(OfFamily, np.ndarray):
    """(n, ...) ndarray of a value of each variant, in order; parts of it and what is computed with it are plain arrays.

    Attributes
    ----------
    errors : dict
        Number of a variant to the `Failure` for which it has no value.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> gears = pt.family(pt.examples.conventional(), {"gearbox.ratio": [6.0, 3.6, 2.2]})
    >>> first = gears.evaluate(lambda car: pt.modes(car).frequency_hz[1])
    >>> first.round(2), first.worst("value").variant
    (array([2.64, 3.75, 5.51]), 2)
    """

    _label: tuple[str, str, tuple[str, ...]]

    def __new__(
        cls,
        values: np.ndarray,
        family: Family,
        name: str = "value",
        unit: str = "",
        axes: tuple[str, ...] = (),
        errors: dict[int, Failure] | None = None,
    ) -> FamilyArray:
        array = np.asarray(values).view(cls)
        array.family, array.errors, array._label = family, dict(errors or {}), (name, unit, axes)
        array.flags.writeable = False
        return array

    def __array_finalize__(self, source: Any) -> None:
        # a part, or what a method computes, is of no family
        self.family: Family = getattr(self, "family", None)  # type: ignore[assignment]

    def __getitem__(self, key: Any) -> Any:
        return np.asarray(self)[key]

    def __repr__(self) -> str:
        return repr(np.asarray(self)) if self.family is None else super().__repr__()

    def __array_wrap__(self, array: Any, context: Any = None, return_scalar: bool = False) -> Any:
        return array[()] if return_scalar else np.asarray(array)

    def __reduce__(self) -> tuple:
        return type(self), (np.array(self), self.family, *self._label, self.errors)

    def __copy__(self) -> FamilyArray:
        make, made_of = self.__reduce__()
        return make(*made_of)

    def __deepcopy__(self, memo: dict[int, Any] | None) -> FamilyArray:
        return self.__copy__()

    def quantities(self) -> dict[str, Quantity]:
        """By name, what the result holds of each variant."""
        name, unit, axes = self._label
        plain = np.asarray(self)
        if plain.dtype.names:
            return {field: Quantity(plain[field]) for field in plain.dtype.names}
        return {name: Quantity(plain, unit, axes)}

    @property
    def _called(self) -> str:
        return self._label[0]


def fields_of(
    family: Family, found: Mapping[str, np.ndarray], name: str, errors: dict[int, Failure] | None = None
) -> FamilyArray:
    """One value of each variant by name, as a structured array."""
    array = np.empty(len(family), dtype=[(field, values.dtype) for field, values in found.items()])
    for field, values in found.items():
        array[field] = values
    return FamilyArray(array, family, name, errors=errors)


def _percentiles(values: np.ndarray, q: np.ndarray) -> np.ndarray:
    if np.iscomplexobj(values):
        return _percentiles(values.real, q) + 1j * _percentiles(values.imag, q)
    if values.dtype.kind not in "biuf":
        raise PowertrainError(f"values of type {values.dtype}, permitted: numbers")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of columns without any value
        return np.nanpercentile(values.astype(float), q, axis=0)


def _axes(quantity: Quantity, name: str) -> tuple[str, ...]:
    more = quantity.values.ndim - 1
    return quantity.axes if len(quantity.axes) == more else tuple(f"{name}_{i}" for i in range(more))


def _listed(values: np.ndarray) -> list:
    if np.iscomplexobj(values):
        return np.stack([values.real, values.imag], axis=-1).tolist()
    if values.dtype.kind == "f" and np.isnan(values).any():
        return np.where(np.isnan(values), np.array(None), values.astype(object)).tolist()
    return values.tolist()
