"""Errors that a user can meet; each names the culprit, what is permitted and, if there is one, the remedy."""

from collections.abc import Iterable
from difflib import get_close_matches


class PowertrainError(ValueError):
    """Base of every error this package raises on bad input."""


class ParameterError(PowertrainError):
    """A physical value outside what is permitted."""

    def __init__(self, name: str, parameter: str, value: object, unit: str, permitted: str):
        shown = f"{value!r} {unit}".rstrip()
        super().__init__(f"{name}: {parameter} = {shown}, permitted: {permitted}")


class TopologyError(PowertrainError):
    """Elements that do not make a driveline: without inertia, torn apart, or held at standstill."""


class UnknownNameError(PowertrainError):
    """A name that is not there; carries a suggestion."""

    def __init__(self, what: str, name: object, known: Iterable[str], owner: str):
        known = list(known)
        super().__init__(f'{what} "{name}" is not {owner}{suggestion(name, known)}')


class SignalError(PowertrainError):
    """A signal that is unknown, not finite or of the wrong length."""


class FileError(PowertrainError):
    """A driveline file that cannot be read, names file, table and key."""


def suggestion(name: object, known: Iterable[str]) -> str:
    """``; did you mean "x"?`` or, when nothing is near, the first few names there are."""
    known = list(known)
    lower = {item.lower(): item for item in known}
    near = get_close_matches(str(name).lower(), lower, n=1)
    if near:
        return f'; did you mean "{lower[near[0]]}"?'
    listed = ", ".join(known[:12]) + (", ..." if len(known) > 12 else "")
    return f"; there is {listed}" if known else ""
