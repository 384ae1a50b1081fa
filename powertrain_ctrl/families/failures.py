"""Variants without a result: those that failed, that a worker had in hand when it died, that were not reached."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..base.errors import PowertrainError
from .variants import Variants

# Why a variant that was not reached has no result.
INTERRUPTED = "interrupted before"


class Failure(NamedTuple):
    """Variant that could not be computed: its number, its values and what was wrong."""

    variant: int
    values: dict[str, Any]
    reason: str

    def __str__(self) -> str:
        values = ", ".join(f"{name} = {value}" for name, value in self.values.items())
        return f"variant {self.variant} ({values}): {self.reason}"


def failed(variants: Variants, reason: str) -> dict[int, Failure]:
    """All of some variants, by number, for one reason."""
    return {number: Failure(number, variants.of(i), reason) for i, number in enumerate(variants.numbers.tolist())}


def said(error: BaseException, called: str = "") -> str:
    """Kind and words of an error, without the variant that they may begin with."""
    words = str(error).removeprefix(f"{called}: ")
    return f"{type(error).__name__}: {words}" if words else type(error).__name__


def require_some(failures: Mapping[int, Failure], count: int) -> None:
    """Not all variants failed."""
    if len(failures) == count:
        raise PowertrainError(f"no variant could be computed: {failures[0]}")


def warn_of(failures: Mapping[int, Failure], count: int, stacklevel: int) -> None:
    """Say how many variants failed, and the first of them; `stacklevel` is that of whom to tell, from the caller."""
    if failures:
        first = failures[min(failures)]
        message = f"{len(failures)} of {count} variants failed: {first}"
        warnings.warn(message, RuntimeWarning, stacklevel=stacklevel + 1)
