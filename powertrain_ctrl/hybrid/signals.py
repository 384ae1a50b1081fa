"""Input signals as exact pieces: ramps and steps, samples, functions of time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import LARGEST, Duration, Number, Seconds, as_number
from ..base.doors import checked
from ..base.errors import PowertrainError, SignalError, shown
from ..base.kinds import Refused, real_numbers

# Functions are represented by polynomials of this degree, refined until they agree to this part of their range.
DEGREE = 5
AGREEMENT = 1e-10
# At this time [s] a double still tells a tenth of a microsecond, so events have their instants.
LATEST = 1e9
# A jump or corner of a function is located this closely [s].
SHORTEST = 1e-10
# So many pieces of that length in a row are no corner.
ROUGH = 64


class Exact:
    """A signal that a simulation follows exactly; such signals add up."""

    __slots__ = ()


@dataclass(frozen=True, eq=False)
class PiecewiseLinear(Exact):
    """Signal through given points, constant before the first and after the last; a time given twice is a jump.

    Signals add up, and times a number they scale.

    Examples
    --------
    A pulse with slanted sides:

    >>> import powertrain_ctrl as pt
    >>> pulse = pt.ramp(1.0, 0.1, 50.0) + pt.ramp(1.4, 0.1, -50.0)
    >>> [round(float(pulse(t)), 6) for t in (0.5, 1.05, 1.2, 2.0)]
    [0.0, 25.0, 50.0, 0.0]
    """

    times: tuple[float, ...]
    values: tuple[float, ...]
    __array_ufunc__ = None  # an array times a signal is for the signal to answer

    def __post_init__(self) -> None:
        if len(self.times) != len(self.values) or not self.times:
            raise SignalError(
                f"{len(self.times)} times and {len(self.values)} values, permitted: as many of each, >= 1"
            )
        if not (np.abs([*self.times, *self.values]) <= LARGEST).all() or (np.diff(self.times) < 0.0).any():
            raise SignalError(
                f"times {self.times}, values {self.values}: permitted: finite, at most {LARGEST:g} in size, "
                "times not decreasing"
            )

    @checked
    def __call__(self, t: float | np.ndarray) -> np.ndarray:
        """Value at t; at a jump the one behind it."""
        times, values = np.array(self.times), np.array(self.values)
        right = np.searchsorted(times, t, side="right")
        left = np.clip(right - 1, 0, len(times) - 1)
        right = np.clip(right, 0, len(times) - 1)
        width = np.where(times[right] > times[left], times[right] - times[left], 1.0)
        share = np.clip((np.asarray(t) - times[left]) / width, 0.0, 1.0)
        return values[left] + share * (values[right] - values[left])

    @checked
    def __add__(self, other: Exact) -> PiecewiseLinear:
        if not isinstance(other, PiecewiseLinear):
            return NotImplemented
        times = np.unique([*self.times, *other.times])
        before, after = (self._limits(times, side) + other._limits(times, side) for side in ("left", "right"))
        kept = np.column_stack([before != after, np.full(len(times), True)])
        points = np.column_stack([times, times])[kept], np.column_stack([before, after])[kept]
        return PiecewiseLinear(*(tuple(array.tolist()) for array in points))

    @checked
    def __mul__(self, factor: Number) -> PiecewiseLinear:
        return PiecewiseLinear(self.times, tuple(factor * value for value in self.values))

    __rmul__ = __mul__

    def __neg__(self) -> PiecewiseLinear:
        return -1.0 * self

    def _limits(self, t: np.ndarray, side: str) -> np.ndarray:
        """Values just before or just behind the times t."""
        values = self(t)
        if side == "left":
            times = np.array(self.times)
            first = np.minimum(np.searchsorted(times, t, side="left"), len(times) - 1)
            values = np.where(times[first] == t, np.array(self.values)[first], values)
        return values


@checked
def ramp(start: Seconds, duration: Duration, final: Number, initial: Number = 0.0) -> PiecewiseLinear:
    """Signal that goes from ``initial`` at ``start`` to ``final`` in ``duration`` and stays.

    Parameters
    ----------
    start, duration : float
        [s], duration >= 0.
    final, initial : float
        In the unit of the signal.

    Returns
    -------
    PiecewiseLinear
        A function of time that can be added to others and multiplied by a number.

    Raises
    ------
    ParameterError
        A negative duration, or a value that is not a finite number.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> torque = pt.ramp(1.0, 0.2, 250.0)
    >>> round(float(torque(1.1)), 9)
    125.0
    """
    return PiecewiseLinear((start, start + duration), (initial, final))


@checked
def step(time: Seconds, final: Number, initial: Number = 0.0) -> PiecewiseLinear:
    """Signal that jumps from ``initial`` to ``final``, the value at that time.

    Parameters
    ----------
    time : float
        [s].
    final, initial : float
        In the unit of the signal.

    Returns
    -------
    PiecewiseLinear
        As of `ramp`.

    Raises
    ------
    ParameterError
        A value that is not a finite number.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> torque = pt.step(0.5, 10.0)
    >>> float(torque(0.4)), float(torque(0.5))
    (0.0, 10.0)
    """
    return ramp(time, 0.0, final, initial)


# Times of a result, checked by `checked_times`.
Times = Any
TimeFunction = Callable[[float], Any]
# What an input can be: a number or samples, a ramp or step or sum of them, a function of time.
Signal = ArrayLike | PiecewiseLinear | Callable[[float], float]


@checked
def samples(t: ArrayLike, values: ArrayLike) -> PiecewiseLinear:
    """Signal through samples with time stamps of their own, as a measured series has them.

    Parameters
    ----------
    t : (N,) array_like
        Times [s], not decreasing; a time given twice is a jump.
    values : (N,) array_like
        In the unit of the signal.

    Returns
    -------
    PiecewiseLinear
        Linear in between, held before the first and after the last; one point is a constant.

    Raises
    ------
    SignalError
        Times that go back, values that are not finite, or not as many of each.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> torque = pt.samples([0.0, 0.1, 0.1, 0.4], [0.0, 50.0, 80.0, 20.0])
    >>> [float(torque(t)) for t in (-1.0, 0.05, 0.1, 9.0)]
    [0.0, 25.0, 80.0, 20.0]
    """
    times, values = checked_array("t", t), checked_array("values", values)
    if times.ndim != 1 or values.shape != times.shape or not len(times):
        raise SignalError(f"t of shape {times.shape}, values of shape {values.shape}, permitted: (N,) both, N >= 1")
    if (wrong := np.flatnonzero(~np.isfinite(times))).size:
        raise SignalError(f"t is {times[wrong[0]]} at sample {wrong[0]}, permitted: finite")
    if (back := np.flatnonzero(np.diff(times) < 0.0)).size:
        i = int(back[0])
        raise SignalError(f"t goes from {times[i]:g} s back to {times[i + 1]:g} s, permitted: not decreasing")
    if (wrong := np.flatnonzero(~np.isfinite(values))).size:
        raise _not_finite("the signal", values[wrong[0]], times[wrong[0]])
    return PiecewiseLinear(tuple(times.tolist()), tuple(values.tolist()))


def checked_array(what: str, values: Any) -> np.ndarray:
    """Values as an array of real numbers, or a `SignalError`."""
    try:
        return np.array(real_numbers(values))
    except Refused:
        raise SignalError(f"{what} is {shown(values)}, permitted: real numbers") from None


def checked_times(timepts: ArrayLike) -> np.ndarray:
    """timepts as an array; not increasing or not finite is a `SignalError`."""
    timepts = checked_array("timepts", timepts)
    if timepts.ndim != 1 or len(timepts) < 2 or not np.isfinite(timepts).all():
        raise SignalError(f"timepts of shape {timepts.shape}, permitted: one-dimensional, finite, at least two")
    if np.abs(timepts).max() > LATEST:
        raise SignalError(f"timepts go from {timepts[0]:g} s to {timepts[-1]:g} s, permitted: within {LATEST:g} s of 0")
    if (np.diff(timepts) <= 0.0).any():
        first = int(np.flatnonzero(np.diff(timepts) <= 0.0)[0])
        raise SignalError(f"timepts go from {timepts[first]:g} s to {timepts[first + 1]:g} s, permitted: increasing")
    return timepts


@dataclass(frozen=True)
class HalfSine:
    """Signal that is one half of a sine from ``start`` [s] on for ``length`` [s], and 0 before and after."""

    peak: float
    start: float
    length: float

    def __call__(self, t: float) -> float:
        phase = (t - self.start) / self.length
        return self.peak * np.sin(np.pi * phase) if 0.0 < phase < 1.0 else 0.0


def value_at(function: Callable[[float], Any], t: float, what: str) -> float:
    """Value of a function of time; one that fails or gives no real number is a `SignalError`."""
    try:
        value = function(t)
    except PowertrainError:
        raise
    except Exception as error:
        raise SignalError(f"{what} fails at t = {t:g} s: {type(error).__name__}: {error}") from error
    number = as_number(value.item() if isinstance(value, np.ndarray) and value.size == 1 else value)
    if number is None:
        raise SignalError(f"{what} is {shown(value)} at t = {t:g} s, permitted: a number")
    return number


def at_samples(signal: Signal, timepts: np.ndarray, name: str) -> np.ndarray:
    """Values of a number, an array on ``timepts`` or a function of time; not finite or of wrong number: `SignalError`."""
    if isinstance(signal, PiecewiseLinear):
        values = signal(timepts)
    elif callable(signal):
        values = np.array([value_at(signal, float(t), f'input "{name}"') for t in timepts])
    else:
        values = checked_array(f'input "{name}"', signal)
        values = np.full(timepts.shape, values) if values.ndim == 0 else values
    _check_samples(values, timepts, name)
    return values


class Pieces(NamedTuple):
    """Polynomials in local time: ``value(t) = sum_j coefficients[i, ..., j] (t - edges[i])^j`` on piece i."""

    edges: np.ndarray
    coefficients: np.ndarray


def input_pieces(inputs: Mapping[str, Signal], names: Sequence[str], timepts: np.ndarray) -> Pieces:
    """All inputs on common pieces from the first to the last of ``timepts``; those not given are 0.

    Parameters
    ----------
    inputs : mapping
        Name to number, samples on ``timepts`` (linear in between), `PiecewiseLinear` or function of time.
    names : sequence of str
        Order of the signals in the result.
    timepts : (N,) ndarray
        [s], increasing.

    Returns
    -------
    Pieces
        Coefficients (pieces, signals, degree + 1).

    Raises
    ------
    SignalError
        Values not finite (names signal and time) or samples of the wrong number.
    """
    nothing = Pieces(timepts[[0, -1]], np.zeros((1, 2)))
    single = [_pieces(inputs[name], timepts, name) if name in inputs else nothing for name in names]
    edges = np.unique(np.concatenate([timepts[[0, -1]], *(pieces.edges for pieces in single)]))
    edges = edges[(edges >= timepts[0]) & (edges <= timepts[-1])]
    degree = max((pieces.coefficients.shape[1] for pieces in single), default=1)
    coefficients = np.zeros((len(edges) - 1, len(names), degree))
    for j, pieces in enumerate(single):
        if pieces is nothing:
            continue
        index = np.searchsorted(pieces.edges, edges[:-1], side="right") - 1
        shifted = shift(pieces.coefficients[index], edges[:-1] - pieces.edges[index])
        coefficients[:, j, : shifted.shape[1]] = shifted
    return Pieces(edges, coefficients)


def shift(coefficients: np.ndarray, by: float | np.ndarray) -> np.ndarray:
    """Coefficients (..., q) of the same polynomials about an origin that lies ``by`` later."""
    by = np.asarray(by, dtype=float)[..., None]
    shifted = np.array(coefficients, dtype=float)
    q = shifted.shape[-1]
    for first in range(q - 1):
        for j in range(q - 2, first - 1, -1):
            shifted[..., j : j + 1] += by * shifted[..., j + 1 : j + 2]
    return shifted


def _pieces(signal: Signal, timepts: np.ndarray, name: str) -> Pieces:
    if isinstance(signal, PiecewiseLinear):
        return _from_points(np.array(signal.times), np.array(signal.values), timepts)
    if callable(signal):
        return _from_function(signal, timepts, name)
    values = checked_array(f'input "{name}"', signal)
    if values.ndim == 0:
        values = np.full(2, values)
        return _from_samples(values, timepts[[0, -1]], name)
    return _from_samples(values, timepts, name)


def _check_samples(values: np.ndarray, times: np.ndarray, name: str) -> None:
    if values.shape != times.shape:
        raise SignalError(
            f'input "{name}" has shape {values.shape}, permitted: {times.shape} like timepts, or one number'
        )
    far = np.flatnonzero(~(np.abs(values) <= LARGEST))
    if far.size:
        raise _not_finite(f'input "{name}"', values[far[0]], times[far[0]])


def _not_finite(what: str, value: float, t: float) -> SignalError:
    size = f", at most {LARGEST:g} in size" if np.isfinite(value) else ""
    return SignalError(f"{what} is {value} at t = {t:g} s, permitted: finite{size}")


def _from_samples(values: np.ndarray, times: np.ndarray, name: str) -> Pieces:
    _check_samples(values, times, name)
    kept = _corners(values, times)
    return _linear(times[kept], values[kept])


def _corners(values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Indices of the samples that straight lines between them need; all others lie on these lines to rounding."""
    if len(values) < 3:
        return np.arange(len(values))
    share = (times[1:-1] - times[:-2]) / (times[2:] - times[:-2])
    bend = np.abs(values[:-2] + share * (values[2:] - values[:-2]) - values[1:-1])
    rounding = 8.0 * np.finfo(float).eps * np.abs(values).max()
    kept = np.concatenate([[0], 1 + np.flatnonzero(bend > rounding), [len(values) - 1]])
    if np.abs(np.interp(times, times[kept], values[kept]) - values).max() > 4.0 * rounding:
        return np.arange(len(values))
    return kept


def _from_points(times: np.ndarray, values: np.ndarray, timepts: np.ndarray) -> Pieces:
    start = min(timepts[0], times[0]) - 1.0
    stop = max(timepts[-1], times[-1]) + 1.0
    return _linear(np.concatenate([[start], times, [stop]]), np.concatenate([values[:1], values, values[-1:]]))


def _linear(times: np.ndarray, values: np.ndarray) -> Pieces:
    width = np.diff(times)
    real = width > 0.0
    slope = np.diff(values)[real] / width[real]
    edges = np.append(times[:-1][real], times[-1])
    return Pieces(edges, np.column_stack([values[:-1][real], slope]))


def _from_function(function: Callable[[float], float], timepts: np.ndarray, name: str) -> Pieces:
    """Polynomial pieces of a function, checked at every sample and between; refined where they disagree."""

    def value(t: float) -> float:
        result = value_at(function, float(t), f'input "{name}"')
        if not abs(result) <= LARGEST:
            raise _not_finite(f'input "{name}"', result, t)
        return result

    grid = np.sort(np.concatenate([timepts, 0.5 * (timepts[1:] + timepts[:-1])]))
    known = np.array([value(t) for t in grid])
    tolerance = AGREEMENT * max(np.abs(known).max(), np.finfo(float).tiny)
    # Chebyshev points in [0, 1], and the map from values there to coefficients
    nodes = 0.5 - 0.5 * np.cos(np.pi * np.arange(DEGREE + 1) / DEGREE)
    to_coefficients = np.linalg.inv(np.vander(nodes, increasing=True))
    edges: list[float] = []
    coefficients: list[np.ndarray] = []
    shortest = max(SHORTEST, 8.0 * np.spacing(np.abs(grid).max()))
    in_a_row = 0

    def fit(a: float, b: float) -> np.ndarray:
        # The end of a piece belongs to the next one: a jump there must not bend this piece.
        inside = np.minimum(a + (b - a) * nodes, np.nextafter(b, a))
        return to_coefficients @ [value(t) for t in inside]

    def add(a: float, b: float, scaled: np.ndarray) -> None:
        edges.append(a)
        coefficients.append(scaled / (b - a) ** np.arange(DEGREE + 1))

    def cover(a: float, b: float, times: np.ndarray, values: np.ndarray) -> None:
        nonlocal in_a_row
        scaled = fit(a, b)
        # also between the nodes of the fit: samples alone may all be nodes
        between = a + (b - a) * np.array([0.17, 0.37, 0.61, 0.83])
        checked = np.concatenate([times, between])
        known = np.concatenate([values, [value(t) for t in between]])
        if np.abs(np.polynomial.polynomial.polyval((checked - a) / (b - a), scaled) - known).max() <= tolerance:
            add(a, b, scaled)
            in_a_row = 0
        elif b - a <= shortest:
            add(a, b, np.array([value(a), *np.zeros(DEGREE)]))
            in_a_row += 1
            if in_a_row > ROUGH:
                raise SignalError(
                    f'input "{name}" changes at every instant near t = {a:g} s, permitted: a function that gives the same '
                    "value at the same time, smooth but for corners and jumps; give noise as samples, one for each of "
                    "timepts"
                )
        else:
            middle = 0.5 * (a + b)
            cover(a, middle, times[times < middle], values[times < middle])
            cover(middle, b, times[times >= middle], values[times >= middle])

    cover(grid[0], grid[-1], grid[:-1], known[:-1])
    return Pieces(np.append(edges, grid[-1]), np.array(coefficients))
