"""Any function of a driveline, for each variant: what it gave, and what failed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import Executor
from typing import Any

import numpy as np

from ..driveline.collection import Driveline
from .executors import Progress, completed
from .failures import INTERRUPTED, Failure, failed, require_some, said
from .variants import Variants

# Variants that go to a worker together.
SHARE = 16
_MISSING = object()


def evaluated(
    variants: Variants,
    function: Callable[[Driveline], Any],
    executor: Executor | None,
    progress: Progress | None,
) -> tuple[np.ndarray, dict[int, Failure]]:
    """(n, ...) values in the order of the variants, and why some have none.

    Raises
    ------
    PowertrainError
        None has a value.
    KeyboardInterrupt
        Before any was reached.
    """
    size = 1 if executor is None else max(1, min(SHARE, len(variants) // (4 * SHARE)))
    parts = list(variants.chunks(size))
    values: list[Any] = [_MISSING] * len(variants)
    failures: dict[int, Failure] = {}
    tasks = completed(_each, [(function, part) for part in parts], executor, progress, [len(part) for part in parts])
    reached = 0
    try:
        for place, found, error in tasks:
            part = parts[place]
            if error is not None:
                failures |= failed(part, said(error))
            for i, (value, reason) in enumerate(found or ()):
                if reason:
                    failures |= failed(part.part(slice(i, i + 1)), reason)
                else:
                    values[reached + i] = value
            reached += len(part)
    except KeyboardInterrupt:
        if not reached:
            raise
        failures |= failed(variants.part(slice(reached, None)), INTERRUPTED)
    require_some(failures, len(variants))
    return _together(values), failures


def _each(function: Callable[[Driveline], Any], variants: Variants) -> list[tuple[Any, str]]:
    """Value, or what was wrong, of each variant."""
    results: list[tuple[Any, str]] = []
    for i in range(len(variants)):
        try:
            results.append((function(variants.car_of(i)), ""))
        except Exception as error:
            results.append((None, said(error, variants.called(i))))
    return results


def _together(values: list[Any]) -> np.ndarray:
    """(n, ...) ndarray of values of which some are missing."""
    there = [value for value in values if value is not _MISSING]
    if all(isinstance(value, Mapping) for value in there):
        names = list(dict.fromkeys(str(name) for value in there for name in value))
        columns = {
            name: _together([_MISSING if value is _MISSING else value.get(name, _MISSING) for value in values])
            for name in names
        }
        array = np.empty(
            len(values), dtype=[(name, column.dtype, column.shape[1:]) for name, column in columns.items()]
        )
        for name, column in columns.items():
            array[name] = column
        return array
    try:
        known = np.array(there)
    except ValueError:  # of different lengths
        known = np.empty(0, dtype=object)
    if known.dtype.kind not in "biufc":
        array = np.empty(len(values), dtype=object)
        for i, value in enumerate(values):
            array[i] = None if value is _MISSING else value
        return array
    if len(there) == len(values):
        return known
    array = np.full((len(values), *known.shape[1:]), np.nan, dtype=complex if known.dtype.kind == "c" else float)
    array[[value is not _MISSING for value in values]] = known
    return array
