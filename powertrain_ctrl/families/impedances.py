"""Steady response of all variants to harmonic torques, by impedances from the leaves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.doors import called, checked
from ..base.errors import UnknownNameError
from ..base.records import Record
from ..base.signal_units import unit_of
from ..driveline.collection import Driveline
from ..linear.forced import forced_response
from ..linear.impedance import Impedance, Network
from ..linear.solved import Value
from .failures import Failure
from .frequencies import gathered
from .parts import at_once
from .results import Family, OfFamily, Quantity
from .structure import Stack, one_by_one, parts_of
from .variants import Variants

# Signals of a node by powers of j omega.
POWERS = {"angle": 0, "speed": 1, "acceleration": 2}
# As few frequencies at once cost little more than all of them, and leave room for more variants.
FEW = 50


@called
@dataclass(frozen=True, eq=False, repr=False)
class FamilyForcedResponse(OfFamily, Record):
    """Steady responses of all variants to harmonic torques: complex amplitudes, peak values.

    ``response["damper_spring_torque"]`` is an (n, N) array.

    Attributes
    ----------
    family : Family
    omega : (N,) ndarray
        Angular frequencies [rad/s].
    outputs : tuple of str
        Names of the signals.
    errors : dict
        Number of a variant to the `Failure` for which it has nan.

    Raises
    ------
    UnknownNameError
        From ``response[name]``: a signal that is not there.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> loads = pt.family(pt.examples.conventional(), {"vehicle.m": [1600.0, 2000.0, 2400.0]})
    >>> omega = 2.0 * np.pi * np.linspace(0.5, 10.0, 200)
    >>> response = loads.frequency_response(omega, "engine_torque", "vehicle_acceleration")
    >>> response.amplitude("vehicle_acceleration").max(axis=1).round(4)
    array([0.0901, 0.0824, 0.0756])
    """

    family: Family
    omega: np.ndarray
    outputs: tuple[str, ...]
    _values: np.ndarray
    errors: dict[int, Failure] = field(default_factory=dict)

    def keys(self) -> tuple[str, ...]:
        """Names of all signals."""
        return self.outputs

    _ipython_key_completions_ = keys

    @checked
    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.outputs:
            raise UnknownNameError("signal", name, self.outputs, "in this response")
        return self._values[:, self.outputs.index(name)]

    @called
    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.outputs

    @checked
    def amplitude(self, output: str) -> np.ndarray:
        """(n, N) ndarray: peak value of a signal."""
        return np.abs(self[output])

    def quantities(self) -> dict[str, Quantity]:
        """By name, the amplitudes of each variant."""
        car = self.family.nominal
        return {
            name: Quantity(self.amplitude(name), unit_of(name, car.translating), ("omega",)) for name in self.outputs
        }

    def _coordinates(self) -> dict[str, Any]:
        return {"omega": ("omega", self.omega, {"units": "rad/s"})}

    headers = ("signal", "unit", "largest", "at [Hz]", "in variant")

    def rows(self) -> Iterator[list[str]]:
        """Rows of the printed table."""
        for name in self.outputs:
            size = self.amplitude(name)
            variant, k = np.unravel_index(int(np.nanargmax(size)), size.shape)
            hertz = self.omega[k] / (2.0 * np.pi)
            yield [
                name,
                unit_of(name, self.family.nominal.translating),
                f"{size[variant, k]:.4g}",
                f"{hertz:.4g}",
                str(variant),
            ]


def numbers_held(nodes: int, signals: int, frequencies: int) -> int:
    """Numbers held of one variant: its results, or what `harmonics_of` needs of few frequencies meanwhile."""
    return 2 * max(signals * frequencies, 3 * nodes * min(frequencies, FEW))


def harmonics_of(
    variants: Variants, omega: np.ndarray, inputs: Mapping[str, complex], outputs: Sequence[str]
) -> dict[str, np.ndarray]:
    """``values`` (n, outputs, N) of some variants."""
    found = []
    for places, part, stack in parts_of(variants):
        if stack is None or not all(_is_known(name, stack) for name in outputs):
            found.append((places, np.array(one_by_one(part, lambda car: _single(car, omega, inputs, outputs)))))
        else:
            found.append((places, _responses(stack, omega, inputs, outputs)))
    return {"values": gathered(found, 1, len(variants))}


def _single(
    car: Driveline, omega: np.ndarray, inputs: Mapping[str, complex], outputs: Sequence[str]
) -> list[np.ndarray]:
    response = forced_response(car, omega, dict(inputs), list(outputs))
    return [response[name] for name in outputs]


def _is_known(signal: str, stack: Stack) -> bool:
    subject, _, kind = signal.rpartition("_")
    return (kind in POWERS and subject in stack.nodes) or (kind in ("torque", "twist") and subject in stack.names)


def _responses(stack: Stack, omega: np.ndarray, inputs: Mapping[str, complex], outputs: Sequence[str]) -> np.ndarray:
    rows = [_row(stack, twist) for twist in stack.twists]
    impedances = [
        Impedance(
            _column(row.stiffness * (1.0 + 1j * row.loss_factor) if np.any(row.loss_factor) else row.stiffness),
            _column(row.damping),
        )
        for row in stack.compliances
    ]
    for motion, inertia in _squares(stack):
        rows.append(_row(stack, motion))
        impedances.append(Impedance(inertia=_column(inertia)))
    loads: dict[int, Value] = {}
    for name, amplitude in inputs.items():
        for coordinate, share in stack.motion[name.rpartition("_")[0]].items():
            j = stack.place[coordinate]
            loads[j] = loads.get(j, 0.0) + _column(share) * amplitude
    asked = [name.rpartition("_")[::2] for name in outputs]
    twists = sorted({stack.names.index(subject) for subject, kind in asked if kind not in POWERS})
    wanted = sorted({stack.place[c] for subject, kind in asked if kind in POWERS for c in stack.motion[subject]})
    network = Network(rows, len(stack.coordinates))
    values = np.empty((stack.count, len(outputs), len(omega)), dtype=complex)
    size = at_once(6 * len(stack.nodes) * stack.count)
    for start in range(0, len(omega), size):
        there = slice(start, start + size)
        s, square = 1j * omega[there], -(omega[there] ** 2)
        powers: tuple[Value, ...] = (1.0, s, square)
        moved = network.steady(impedances, loads, omega[there], wanted, twists)
        for i, (subject, kind) in enumerate(asked):
            if kind in POWERS:
                places = [(stack.place[name], share) for name, share in stack.motion[subject].items()]
                terms = [_scaled(share, moved.motion[j]) for j, share in places if j in moved.motion]
                shown = sum(terms[1:], terms[0]) if terms else np.zeros(1)
                np.multiply(powers[POWERS[kind]], shown, out=values[:, i, there])
                continue
            c = stack.names.index(subject)
            carried = 1.0 if kind == "twist" else impedances[c].at(s, square)
            np.multiply(carried, moved.twist.get(c, 0.0), out=values[:, i, there])
    return values


def _scaled(share: Value, motion: np.ndarray) -> np.ndarray:
    return motion if isinstance(share, float) and share == 1.0 else _column(share) * motion


def _row(stack: Stack, motion: Mapping[str, Value]) -> dict[int, Value]:
    return {stack.place[name]: _column(value) for name, value in motion.items()}


def _column(value: Value) -> Value:
    """Values of the variants, to be combined with those of the frequencies."""
    return value[:, None] if isinstance(value, np.ndarray) else value


def _squares(stack: Stack) -> Iterator[tuple[dict[str, Value], Value]]:
    """Inertias as weighted squares of motions: combinations of the coordinates, and weights."""
    for row in stack.inertias:
        left = [list(line) for line in row.matrix]
        for k in range(len(left)):
            weight = left[k][k]
            if not np.all(weight > 0.0):
                continue
            share = [left[i][k] / weight for i in range(len(left))]
            for i in range(k + 1, len(left)):
                for j in range(k + 1, len(left)):
                    left[i][j] = left[i][j] - share[i] * left[k][j]
            combined: dict[str, Value] = {}
            for node, factor in zip(row.nodes[k:], share[k:], strict=True):
                for name, value in stack.motion[node].items():
                    combined[name] = combined.get(name, 0.0) + factor * value
            yield combined, weight
