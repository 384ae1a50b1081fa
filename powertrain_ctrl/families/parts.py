"""What is computed of all variants at once, in parts that need no more than so much memory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
from .executors import Progress, completed
from .failures import INTERRUPTED, Failure, failed, require_some, said
from .variants import Variants

# Working memory of what is computed at once [bytes]; a part holds as many variants as fit.
MEMORY = 32 * 2**20
# The largest block that it learns from [bytes].
FREED = 31 * 2**20
# Numbers that a result holds at most: 2 GiB.
MOST_KEPT = 2**28


class Piece(NamedTuple):
    """Arrays of some variants, so many, or why they have none."""

    size: int
    arrays: dict[str, np.ndarray]
    reason: str = ""


def in_parts(
    variants: Variants,
    function: Callable[..., dict[str, np.ndarray]],
    more: Sequence[Any],
    floats: int,
    executor: Executor | None,
    progress: Progress | None,
) -> tuple[dict[str, np.ndarray], dict[int, Failure]]:
    """``function(variants, *more)`` of all variants, each array with theirs in order, and why some have nan.

    Parameters
    ----------
    floats : int
        Numbers held of one variant meanwhile; 0 stands for those of modes and poles.

    Raises
    ------
    PowertrainError
        None could be computed, or the nominal car cannot either: then it is not for their values.
    KeyboardInterrupt
        Before any was reached.
    """
    size = at_once(floats or _floats(variants.car))
    # glibc gives freed blocks back to the system, which clears their pages each time, unless as large a one has been
    # freed before; this one costs nothing, for none of its pages is touched
    np.empty(FREED // 8)
    parts = list(variants.chunks(size))
    work, sizes = [(function, part, more) for part in parts], [len(part) for part in parts]
    found: dict[str, np.ndarray] = {}
    failures: dict[int, Failure] = {}
    start = 0
    try:
        for place, pieces, error in completed(_pieces, work, executor, progress, sizes):
            if isinstance(error, PowertrainError):
                raise error
            for piece in pieces if error is None else [Piece(sizes[place], {}, said(error))]:
                if piece.reason:
                    failures |= failed(variants.part(slice(start, start + piece.size)), piece.reason)
                for name, array in piece.arrays.items():
                    found[name] = _with(found.get(name), array, start, len(variants))
                start += piece.size
    except KeyboardInterrupt:
        if not start:
            raise
        failures |= failed(variants.part(slice(start, None)), INTERRUPTED)
    require_some(failures, len(variants))
    return {name: _without(array, list(failures)) for name, array in found.items()}, failures


def _pieces(function: Callable[..., dict[str, np.ndarray]], variants: Variants, more: Sequence[Any]) -> list[Piece]:
    """Arrays of some variants; where they cannot be computed, but the nominal car can, without those that fail."""
    try:
        return [Piece(len(variants), function(variants, *more))]
    except Exception as error:
        try:
            function(Variants(variants.car, {}, variants.numbers[:1]), *more)
        except Exception:
            raise error from None
        return _halves(function, variants, more)


def _halves(function: Callable[..., dict[str, np.ndarray]], variants: Variants, more: Sequence[Any]) -> list[Piece]:
    found = []
    for part in variants.chunks((len(variants) + 1) // 2):
        try:
            found.append(Piece(len(part), function(part, *more)))
        except Exception as error:
            alone = [Piece(1, {}, said(error, part.called(0)))]
            found += alone if len(part) == 1 else _halves(function, part, more)
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


def _without(array: np.ndarray, lost: list[int]) -> np.ndarray:
    """The same with nan for some variants."""
    if lost:
        array = array if array.dtype.kind in "fc" else array.astype(float)
        array[lost] = np.nan
    return array


def _floats(car: Driveline) -> int:
    """Numbers held of one variant while its modes or poles are computed."""
    return 20 * len(car.nodes) ** 2
