"""Errors that a user can meet; each names the culprit, what is permitted and, if there is one, the remedy."""

import reprlib
import sys
from collections.abc import Callable, Iterable
from difflib import get_close_matches
from typing import Any

# Letters and words of other books for what is a parameter here.
ALSO_CALLED = {
    "k": ("stiffness",),
    "c": ("stiffness", "damping"),
    "d": ("damping",),
    "b": ("damping",),
    "i": ("ratio", "J", "inertia"),
    "j": ("J", "inertia"),
    "inertia": ("J",),
    "moment_of_inertia": ("J", "inertia"),
    "mass": ("m",),
    "r": ("radius", "ratio"),
    "teeth": ("ratio",),
    "gear_ratio": ("ratio",),
    "capacity": ("max_torque",),
    "torque": ("max_torque",),
    "zeta": ("damping_ratio",),
    "f": ("frequency_hz",),
    "freq": ("frequency_hz",),
    "frequency": ("frequency_hz",),
    "frequencies": ("frequency_hz",),
    "mode_shapes": ("shapes",),
    "play": ("gap",),
    "lash": ("gap",),
    "eta": ("efficiency", "loss_factor"),
    "sample_time": ("dt",),
    "ts": ("dt",),
    "tau": ("lag",),
    "time_constant": ("lag",),
    "dead_time": ("delay",),
    "t": ("timepts", "time"),
    "time": ("timepts",),
}

_SHORT = reprlib.Repr()
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80


class PowertrainError(ValueError):
    """Base of every error this package raises on bad input.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> try:
    ...     pt.Gear("gearbox", "input", "output", ratio=0.0)
    ... except pt.PowertrainError as error:
    ...     print(error)
    gearbox: ratio = 0.0, permitted: not 0, finite
    """

    def __reduce__(self) -> tuple:
        # what a subclass is made of is not kept, only what it says
        return _said_again, (type(self), self.args), vars(self)


def _said_again(kind: type[PowertrainError], args: tuple) -> PowertrainError:
    error = kind.__new__(kind)
    error.args = args
    return error


class ParameterError(PowertrainError):
    """A physical value outside what is permitted.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.SpringDamper("halfshafts", "differential", "wheels", stiffness=-12e3)
    Traceback (most recent call last):
    ...
    powertrain_ctrl.base.errors.ParameterError: halfshafts: stiffness = -12000.0 N m/rad, permitted: >= 0 and finite
    """

    def __init__(self, name: str, parameter: str, value: object, unit: str, permitted: str):
        written = f"{shown(value)} {unit}".rstrip()
        super().__init__(f"{name}: {parameter} = {written}, permitted: {permitted}")


class ArgumentError(PowertrainError, TypeError):
    """A call that does not fit: a keyword that is not known, a value that is missing or in a place that is not its own.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.Inertia("engine", I=0.3)
    Traceback (most recent call last):
    ...
    powertrain_ctrl.base.errors.ArgumentError: Inertia has no parameter "I"; did you mean "J"?
    """


class TopologyError(PowertrainError):
    """Elements that do not make a driveline: without inertia, torn apart, or held at standstill.

    Attributes
    ----------
    fact : str
        What is so, without the advice that follows it in the message.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> try:
    ...     pt.Driveline(pt.Inertia("engine", J=0.3), pt.SpringDamper("shaft", "engine", "flange", stiffness=2e3))
    ... except pt.TopologyError as error:
    ...     print(error)
    node "flange" of shaft has no inertia; give it an Inertia or merge the springs on either side; there is engine
    """

    def __init__(self, fact: str, advice: str = ""):
        super().__init__(f"{fact}; {advice}" if advice else fact)
        self.fact = fact


class UnknownNameError(PowertrainError):
    """A name that is not there; carries a suggestion.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.examples.conventional()["gear_box"]
    Traceback (most recent call last):
    ...
    powertrain_ctrl.base.errors.UnknownNameError: element "gear_box" is not in this driveline; did you mean "gearbox"?
    """

    def __init__(self, what: str, name: object, known: Iterable[str], owner: str):
        known = list(known)
        written = name if isinstance(name, str) else shown(name)
        super().__init__(f'{what} "{written}" is not {owner}{suggestion(written, known)}')


class SignalError(PowertrainError):
    """A signal that is missing, not finite, not permitted or of the wrong length.

    One that is unknown is an `UnknownNameError`.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.simulate(pt.examples.conventional(), [0.0, 1.0], {"engine_torque": [0.0, float("nan")]})
    Traceback (most recent call last):
    ...
    powertrain_ctrl.base.errors.SignalError: input "engine_torque" is nan at t = 1 s, permitted: finite
    """


class FileError(PowertrainError):
    """A driveline file that cannot be read or written; names file, table and key.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.load("missing.toml")
    Traceback (most recent call last):
    ...
    powertrain_ctrl.base.errors.FileError: missing.toml: cannot be read: No such file or directory
    """


def shown(value: object) -> str:
    """A value as it is written, in one line and shortened."""
    try:
        return " ".join(_SHORT.repr(float(value) if isinstance(value, float) else value).split())
    except ValueError:  # Python writes no whole numbers of more than 4300 digits
        return f"{type(value).__name__} with too many digits to be written"


def suggestion(name: object, known: Iterable[str]) -> str:
    """``; did you mean "x"?`` or, when nothing is near, the first few names there are."""
    known = list(known)
    listed = ", ".join(known[:12]) + (", ..." if len(known) > 12 else "")
    return _meant(name, known) or (f"; there is {listed}" if known else "")


def _meant(name: object, known: list[str]) -> str:
    """``; did you mean "x"?`` or nothing."""
    element, dot, own = str(name).rpartition(".")
    meant = [word for other in ALSO_CALLED.get(own.lower(), ()) if (word := element + dot + other) in known]
    if meant:
        return "; did you mean " + " or ".join(f'"{word}"' for word in meant) + "?"
    lower = {item.lower(): item for item in known}
    near = get_close_matches(str(name).lower(), lower, n=1)
    return f'; did you mean "{lower[near[0]]}"?' if near else ""


def no_attribute(owner: object, name: str, keys: Iterable[str] = ()) -> AttributeError:
    """What is raised where a record has no such attribute: a key has brackets, a function takes it, or another is meant.

    Notebooks show what an error says, not what Python would add in a terminal; so the hint is in the words.
    """
    said = f"{type(owner).__name__!r} object has no attribute {name!r}"
    if name.startswith("_"):
        return AttributeError(said)
    if name in keys:
        return AttributeError(f'{said}; it is in brackets, ["{name}"]')
    package = sys.modules[__name__.partition(".")[0]]
    if name in getattr(package, "__all__", ()) and callable(getattr(package, name)):
        return AttributeError(f"{said}; it is a function, pt.{name}(...)")
    return AttributeError(said + _meant(name, [word for word in dir(owner) if not word.startswith("_")]))


def absent(package: str, known: Iterable[str]) -> Callable[[str], Any]:
    """``__getattr__`` of a package that says what could be meant by a name that is not there."""

    def missing(name: str) -> Any:
        hint = "" if name.startswith("_") else suggestion(name, known)
        raise AttributeError(f"module {package!r} has no attribute {name!r}{hint}")

    return missing
