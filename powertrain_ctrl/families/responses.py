"""Time responses of all variants at once: what they hold, and the load change."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.doors import called, checked
from ..base.errors import UnknownNameError
from ..base.records import Record
from ..base.signal_units import unit_of
from ..driveline.collection import Driveline
from ..driveline.ends import ends
from ..hybrid.manoeuvres import load_change
from ..hybrid.metrics import metrics_of
from ..hybrid.response import Response
from ..hybrid.signals import PiecewiseLinear, input_pieces
from ..linear.stepping import forced
from .failures import Failure
from .results import Family, FamilyArray, OfFamily, Quantity
from .structure import Stack, Value, one_by_one, parts_of
from .variants import Variants


@called
@dataclass(frozen=True, eq=False, repr=False)
class FamilyResponse(OfFamily, Record):
    """Time responses of all variants; ``response["vehicle_acceleration"]`` is an (n, N) array.

    Attributes
    ----------
    family : Family
    time : (N,) ndarray
        [s].
    signals : tuple of str
        Names.
    final : (n,) ndarray
        Vehicle acceleration at which each variant ends [m/s^2].
    start : float
        When the manoeuvre begins [s].
    errors : dict
        Number of a variant to the `Failure` for which it has nan.

    Raises
    ------
    UnknownNameError
        From ``response[name]``: a signal that is not there.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> loads = pt.family(pt.examples.conventional(), {"vehicle.m": [1600.0, 2000.0, 2400.0]})
    >>> response = loads.load_change(outputs=["vehicle_acceleration"])
    >>> response["vehicle_acceleration"].shape, response["vehicle_acceleration"].max(axis=1).round(2)
    ((3, 1301), array([6.34, 5.68, 5.14]))
    >>> response.metrics()["overshoot"].round(3)
    array([0.433, 0.461, 0.481])
    """

    family: Family
    time: np.ndarray
    signals: tuple[str, ...]
    final: np.ndarray
    start: float
    _values: np.ndarray
    errors: dict[int, Failure] = field(default_factory=dict)

    def keys(self) -> tuple[str, ...]:
        """Names of all signals."""
        return self.signals

    _ipython_key_completions_ = keys

    @checked
    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.signals:
            raise UnknownNameError("signal", name, self.signals, "in this response")
        return self._values[:, self.signals.index(name)]

    @called
    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.signals

    @checked
    def metrics(self, signal: str = "vehicle_acceleration") -> FamilyArray:
        """Ride metrics of each variant, as of `ride_metrics` from the start of the manoeuvre on.

        Parameters
        ----------
        signal : str
            An acceleration of the vehicle.

        Returns
        -------
        FamilyArray
            (n,), with a field for each of `RideMetrics`: ``metrics()["vdv"]``.

        Raises
        ------
        UnknownNameError
            A signal that is not there.
        SignalError
            Times that are not evenly spaced.
        """
        there = [i for i in range(len(self.final)) if i not in self.errors] if self.errors else slice(None)
        found = metrics_of(self.time, np.ascontiguousarray(self[signal][there]), self.final[there], self.start)
        array = np.full(len(self.final), np.nan, dtype=[(name, float) for name in found])
        for name, values in found.items():
            array[name][there] = values
        return FamilyArray(array, self.family, "metrics", errors=self.errors)

    def quantities(self) -> dict[str, Quantity]:
        """By name, what the result holds of each variant."""
        return {
            name: Quantity(self._values[:, i], unit_of(name, self.family.nominal.translating), ("time",))
            for i, name in enumerate(self.signals)
        }

    def _coordinates(self) -> dict[str, Any]:
        return {"time": ("time", self.time, {"units": "s"})}

    headers = ("signal", "unit", "least", "largest", "in variants")

    def rows(self) -> Iterator[list[str]]:
        """Rows of the printed table."""
        for i, name in enumerate(self.signals):
            values = self._values[:, i]
            least, largest = values.min(axis=1), values.max(axis=1)
            low, high = int(np.nanargmin(least)), int(np.nanargmax(largest))
            yield [
                name,
                unit_of(name, self.family.nominal.translating),
                f"{least[low]:.4g}",
                f"{largest[high]:.4g}",
                f"{low}, {high}",
            ]


@dataclass(frozen=True)
class LoadChange:
    """What `load_change` is told."""

    torque: PiecewiseLinear
    start: float
    engine_speed: float
    times: np.ndarray
    options: dict[str, Any]


def load_changes_of(variants: Variants, change: LoadChange, signals: tuple[str, ...]) -> dict[str, np.ndarray]:
    """``values`` (n, signals, N) and ``final`` (n,) of some variants."""
    values = np.empty((len(variants), len(signals), len(change.times)))
    final = np.empty(len(variants))
    for places, part, stack in parts_of(variants):
        motion = None if stack is None or stack.has_loss or _is_held(stack) else stack.rolling
        if stack is None or motion is None:
            responses = one_by_one(part, lambda car: _single(car, change))
            values[places] = [[response[name] for name in signals] for response in responses]
            final[places] = [
                response["vehicle_acceleration"][-1] if "vehicle_acceleration" in response else np.nan
                for response in responses
            ]
            continue
        values[places], final[places] = _load_changes(stack, motion, change, signals)
    return {"values": values, "final": final}


def signals_of(car: Driveline) -> tuple[str, ...]:
    """Signals of a load change that are computed of all variants at once; those of locked clutches are not among them."""
    springs = [row for element in car for row in element.compliances]
    return (
        f"{ends(car).engine}_torque",
        *(f"{node}_speed" for node in car.nodes),
        *(f"{node}_acceleration" for node in car.nodes),
        *(f"{row.name}_torque" for row in springs),
        *(f"{row.name}_twist" for row in springs if row.stiffness),
    )


def _single(car: Driveline, change: LoadChange) -> Response:
    return load_change(car, timepts=change.times, **change.options)


def _is_held(stack: Stack) -> bool:
    """Whether springs or dampers to ground let it not turn as one body to begin with."""
    return any(len(row.coefficients) == 1 for row in stack.compliances)


class Lifted:
    """A stack in energy coordinates: scaled twists of all springs, scaled speeds; loops of springs share their twists."""

    def __init__(self, stack: Stack):
        self.stack = stack
        H, C = stack.every(stack.factor), stack.every(stack.dampers)
        self.r, self.n = H.shape[1:]
        self.A = np.zeros((stack.count, self.r + self.n, self.r + self.n))
        self.A[:, : self.r, self.r :] = H
        self.A[:, self.r :, : self.r] = -np.swapaxes(H, 1, 2)
        self.A[:, self.r :, self.r :] = -(np.swapaxes(C, 1, 2) @ C)

    def node(self, name: str) -> np.ndarray:
        """(n, states) ndarray: speed of a node; and what a torque at it does to the states."""
        row = np.zeros((self.stack.count, self.r + self.n))
        row[:, self.r :] = self.stack.scaled([self.stack.motion[name]], [1.0])[:, 0]
        return row

    def acceleration(self, name: str) -> np.ndarray:
        """(n, states) ndarray: acceleration of a node without what inputs add."""
        return (self.node(name)[:, None] @ self.A)[:, 0]

    def twist(self, c: int) -> np.ndarray:
        """(n, states) ndarray: twist of a spring."""
        row = np.zeros((self.stack.count, self.r + self.n))
        row[:, self.stack.elastic.index(c)] = 1.0 / np.sqrt(self.stack.compliances[c].stiffness)
        return row

    def torque(self, c: int) -> np.ndarray:
        """(n, states) ndarray: torque of a compliance."""
        stack, compliance = self.stack, self.stack.compliances[c]
        row = np.zeros((stack.count, self.r + self.n))
        if c in stack.elastic:
            row[:, stack.elastic.index(c)] = np.sqrt(compliance.stiffness)
        if c in stack.damped:
            row[:, self.r :] = stack.scaled([stack.twists[c]], [compliance.damping])[:, 0]
        return row


def _load_changes(
    stack: Stack, motion: dict[str, Value], change: LoadChange, signals: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    system, engine = Lifted(stack), ends(stack.car).engine
    n = system.r + system.n
    b = system.node(engine)
    speeds = stack.filled((system.n, 1), [((j, 0), motion[name]) for j, name in enumerate(stack.coordinates)])
    at_engine = stack.column(stack.combined({engine: 1.0}, motion))
    start = np.zeros((stack.count, n))
    start[:, system.r :] = (change.engine_speed / at_engine)[:, None] * stack.lifted(speeds)[:, :, 0]
    pieces = input_pieces({"torque": change.torque}, ("torque",), change.times)
    rows = np.zeros((stack.count, len(signals), n + 2))
    for i, name in enumerate(signals):
        _fill(rows[:, i], name, system, engine, b)
    values = rows @ forced(system.A, b, start, pieces.edges, pieces.coefficients[:, 0, :2], change.times)
    return values, stack.final_acceleration(engine) * change.torque.values[-1]


def _fill(row: np.ndarray, signal: str, system: Lifted, engine: str, b: np.ndarray) -> None:
    """Row (n, states + 2) of a signal on states, torque and its slope."""
    stack, n = system.stack, system.r + system.n
    subject, _, kind = signal.rpartition("_")
    if kind == "speed" and subject in stack.nodes:
        row[:, :n] = system.node(subject)
    elif kind == "acceleration" and subject in stack.nodes:
        row[:, :n] = system.acceleration(subject)
        row[:, n] = (system.node(subject)[:, None] @ b[..., None])[:, 0, 0]
    elif kind in ("torque", "twist") and subject in stack.names:
        c = stack.names.index(subject)
        row[:, :n] = system.torque(c) if kind == "torque" else system.twist(c)
    elif signal == f"{engine}_torque":
        row[:, n] = 1.0
    else:
        raise UnknownNameError("signal", signal, signals_of(stack.car), "of a load change of a family")
