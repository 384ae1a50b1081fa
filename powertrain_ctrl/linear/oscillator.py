"""A linear driveline in steady harmonic motion: the network of its springs and inertias, and the signals in it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ..driveline.collection import Driveline
from ..driveline.kinematics import CANCELLED
from ..elements import InertiaRow
from .assembly import TorsionalModel, assemble_with_loss, kept
from .impedance import Impedance, Network, Value
from .outputs import output_rows, select

# Signals of a node, each the derivative of the one before.
OF_NODES = ("angle", "speed", "acceleration")


class Signal(NamedTuple):
    """What a name of an output means: a kind, and the number of the node, compliance or law."""

    kind: str
    number: int


class Oscillator:
    """A linear driveline in steady harmonic motion: rows of its springs and inertias over its coordinates."""

    def __init__(self, car: Driveline):
        self.model = model = assemble_with_loss(car)
        kinematics = model.following.kinematics
        self.motions = list(map(_coefficients, kinematics))
        inertias = [part for e in car for row in e.inertias for part in _squares(row)]
        place = {node: i for i, node in enumerate(model.nodes)}
        weights = np.zeros((len(inertias), len(model.nodes)))
        for k, (row, _) in enumerate(inertias):
            for node, value in row.items():
                weights[k, place[node]] = value
        self.network = Network(
            [*map(_coefficients, model.all_twists), *map(_coefficients, weights @ kinematics)], kinematics.shape[1]
        )
        self.impedances = [Impedance(*values) for values in zip(stiffness_of(model), model.damping, strict=True)]
        self.impedances += [Impedance(inertia=J) for _, J in inertias]
        self.signals = _signals(model)

    def chosen(self, outputs: Iterable[str] | str | None) -> list[str]:
        """Names of the signals asked for; None means all."""
        known = tuple(self.signals)
        return [known[i] for i in select(outputs, known, "output")]

    def response(
        self,
        omega: np.ndarray,
        inputs: Mapping[int, Value],
        wanted: Sequence[str],
        out: np.ndarray,
        impedances: Sequence[Impedance] | None = None,
    ) -> None:
        """Complex amplitudes (wanted, ...) of signals under inputs by their numbers, each broadcasting with omega.

        ``impedances`` replace those of the driveline, row by row.
        """
        model, impedances = self.model, self.impedances if impedances is None else impedances
        chosen = [self.signals[name] for name in wanted]
        clutches = any(signal.kind == "clutch" for signal in chosen)
        loads: dict[int, Value] = {}
        for number, torque in inputs.items():
            for j, share in self.motions[int(model.B[:, number].argmax())].items():
                loads[j] = loads.get(j, 0.0) + share * torque
        nodes = {s.number for s in chosen if s.kind in OF_NODES}
        nodes |= {i for s in chosen if s.kind == "slip_speed" for i in np.flatnonzero(model.S[s.number]).tolist()}
        twists = {s.number for s in chosen if s.kind in ("twist", "torque")}
        if clutches:
            nodes, twists = set(range(len(model.nodes))), set(range(len(model.compliances)))
        coordinates = {j for i in nodes for j in self.motions[i]}
        moved = self.network.steady(impedances, loads, omega, sorted(coordinates), sorted(twists))
        angle = {i: _combined(self.motions[i], moved.motion) for i in nodes}
        carried = {s.number for s in chosen if s.kind == "torque"} if not clutches else twists
        s, square = 1j * omega, -(omega**2)
        torque = {c: impedances[c].at(s, square) * moved.twist[c] for c in carried if c in moved.twist}
        held = self._held(omega, inputs, angle, torque) if clutches else {}
        factors: dict[str, Value] = dict(zip(OF_NODES, (1.0, s, square), strict=True))
        for (kind, number), signal in zip(chosen, out, strict=True):
            if kind in factors:
                np.multiply(factors[kind], angle[number], out=signal)
            elif kind == "slip_speed":
                np.multiply(factors["speed"], _combined(_coefficients(model.S[number]), angle), out=signal)
            else:
                signal[...] = {"twist": moved.twist, "torque": torque, "clutch": held}[kind].get(number, 0.0)

    def _held(
        self,
        omega: np.ndarray,
        inputs: Mapping[int, Value],
        angle: Mapping[int, Value],
        torque: Mapping[int, Value],
    ) -> dict[int, Value]:
        """Torques of the clutches: of locked ones what they alone can balance."""
        model = self.model
        load = np.zeros((len(model.nodes), *omega.shape), dtype=complex)
        for number, value in inputs.items():
            load[int(model.B[:, number].argmax())] += value
        for c, value in torque.items():
            for i in np.flatnonzero(model.E[c]).tolist():
                load[i] -= model.E[c, i] * value
        for i, j in zip(*map(np.ndarray.tolist, np.nonzero(model.J)), strict=True):
            load[i] += model.J[i, j] * omega**2 * angle[j]
        held = np.tensordot(model.locked_torque_from_load, load, axes=1)
        return dict(enumerate(held))


@kept(64)
def oscillator_of(car: Driveline) -> Oscillator:
    """A driveline as it answers to harmonic torques."""
    return Oscillator(car)


def stiffness_of(model: TorsionalModel) -> np.ndarray:
    """(compliances,) ndarray: stiffness of each, complex where one has a loss factor."""
    if not model.loss_factor.any():
        return model.stiffness
    return model.stiffness * (1.0 + 1j * model.loss_factor)


def _combined(row: Mapping[int, float], values: Mapping[int, Value]) -> Value:
    """Sum of values times coefficients; a value that is not there is 0."""
    terms = [values[j] if f == 1.0 else f * values[j] for j, f in row.items() if j in values]
    return sum(terms[1:], terms[0]) if terms else 0.0


def _coefficients(row: np.ndarray) -> dict[int, float]:
    return {j: float(row[j]) for j in np.flatnonzero(row).tolist()}


def _squares(row: InertiaRow) -> list[tuple[dict[str, float], float]]:
    """A consistent inertia as a sum of weighted squares of motions, by elimination: combinations of nodes and weights."""
    left, found = np.array(row.matrix), []
    for k, own in enumerate(np.diag(left).copy()):
        weight = float(left[k, k])
        if weight > CANCELLED * own:
            combined = left[:, k] / weight
            left -= weight * np.outer(combined, combined)
            found.append(({node: float(f) for node, f in zip(row.nodes, combined, strict=True) if f}, weight))
    return found


def _signals(model: TorsionalModel) -> dict[str, Signal]:
    """Name of each output and what it means."""
    laws, found = [law.owner for law in model.laws], {}
    for name in output_rows(model, None, angles=True, inputs=[]).names:
        subject, _, kind = name.rpartition("_")
        if name.endswith("_slip_speed") and name.removesuffix("_slip_speed") in laws:
            found[name] = Signal("slip_speed", laws.index(name.removesuffix("_slip_speed")))
        elif kind in ("angle", "speed", "acceleration"):
            found[name] = Signal(kind, model.nodes.index(subject))
        elif subject in model.compliances:
            found[name] = Signal(kind, model.compliances.index(subject))
        else:
            found[name] = Signal("clutch", laws.index(subject))
    return found
