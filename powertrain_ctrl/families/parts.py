"""What is computed of all variants at once, in parts that need no more than so much memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import Any

import numpy as np

from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
from .executors import Progress, completed
from .variants import Variants

# Working memory of what is computed at once [bytes]; a part holds as many variants as fit.
MEMORY = 32 * 2**20
# The largest block that it learns from [bytes].
FREED = 31 * 2**20
# Numbers that a result holds at most: 2 GiB.
MOST_KEPT = 2**28


def in_parts(
    variants: Variants,
    function: Callable[..., dict[str, np.ndarray]],
    more: Sequence[Any],
    floats: int,
    executor: Executor | None,
    progress: Progress | None,
) -> dict[str, np.ndarray]:
    """``function(variants, *more)`` of all variants, each array with theirs in order.

    Parameters
    ----------
    floats : int
        Numbers held of one variant meanwhile; 0 stands for those of modes and poles.
    """
    size = at_once(floats or _floats(variants.car))
    # glibc gives freed blocks back to the system, which clears their pages each time, unless as large a one has been
    # freed before; this one costs nothing, for none of its pages is touched
    np.empty(FREED // 8)
    parts = list(variants.chunks(size))
    found: dict[str, np.ndarray] = {}
    tasks = completed(function, [(part, *more) for part in parts], executor, progress, [len(part) for part in parts])
    start = 0
    for place, arrays, error in tasks:
        if error is not None:
            raise error
        for name, array in arrays.items():
            found[name] = _with(found.get(name), array, start, len(variants))
        start += len(parts[place])
    return found


def at_once(floats: int) -> int:
    """How many of what needs so many numbers fit into the working memory."""
    return max(1, MEMORY // (8 * floats))


def require_room(numbers: int) -> None:
    """A result of so many numbers can be held."""
    if numbers > MOST_KEPT:
        raise PowertrainError(f"{numbers:.3g} numbers to keep, permitted: {MOST_KEPT:g}; choose outputs or fewer times")


def _with(whole: np.ndarray | None, part: np.ndarray, start: int, count: int) -> np.ndarray:
    """Array of all variants with those of a part in it; wider ones make it wider, with nan behind the others."""
    if whole is None:
        if len(part) == count:
            return part
        whole = np.empty((count, *part.shape[1:]), dtype=part.dtype)
    if part.ndim > 1 and part.shape[-1] > whole.shape[-1]:
        wider = np.full((*whole.shape[:-1], part.shape[-1]), np.nan, dtype=part.dtype)
        wider[..., : whole.shape[-1]] = whole
        whole = wider
    inside = whole[start : start + len(part)]
    if part.ndim > 1:
        inside[..., part.shape[-1] :] = np.nan
        inside = inside[..., : part.shape[-1]]
    inside[:] = part
    return whole


def _floats(car: Driveline) -> int:
    """Numbers held of one variant while its modes or poles are computed."""
    return 20 * len(car.nodes) ** 2
