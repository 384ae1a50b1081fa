"""Steady response of a driveline to harmonic torques: frequency responses and complex amplitudes of every signal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import LARGEST
from ..base.doors import called, checked
from ..base.errors import ParameterError, SignalError, UnknownNameError, shown
from ..base.records import Record
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.kinematics import CANCELLED
from ..elements import InertiaRow
from .assembly import TorsionalModel, as_driveline, assemble_with_loss, kept
from .impedance import Impedance, Network, Value
from .outputs import output_rows, select

if TYPE_CHECKING:
    import control

# So many frequencies at once stay in the cache of a processor.
AT_ONCE = 4096


@called
@dataclass(frozen=True, eq=False, repr=False)
class ForcedResponse(Record):
    """Steady response to harmonic torques: complex amplitudes, peak values, of ``Re(amplitude exp(j omega t))``.

    ``response["damper_spring_torque"]`` is a signal as an array on ``omega``.

    Attributes
    ----------
    omega : (n,) ndarray
        Angular frequencies [rad/s].
    outputs : tuple of str
        Names of the signals.

    Raises
    ------
    UnknownNameError
        From ``response[name]``: a signal that is not there.

    Examples
    --------
    A torque of 1 N m turns a free inertia of 2 kg m^2 to and fro by ``1 / (J omega^2)``, against the torque:

    >>> import powertrain_ctrl as pt
    >>> disc = pt.Driveline(pt.Inertia("disc", J=2.0))
    >>> response = pt.forced_response(disc, [5.0, 10.0], {"disc_torque": 1.0})
    >>> response["disc_angle"].real, response.amplitude("disc_speed")
    (array([-0.02 , -0.005]), array([0.1 , 0.05]))
    """

    omega: np.ndarray
    outputs: tuple[str, ...]
    _values: dict[str, np.ndarray]

    @checked
    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._values:
            raise UnknownNameError("signal", name, self.outputs, "in this response")
        return self._values[name]

    @called
    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._values

    @checked
    def amplitude(self, output: str) -> np.ndarray:
        """(n,) ndarray: peak value of a signal."""
        return np.abs(self[output])

    def to_dict(self) -> dict:
        """Plain lists, for JSON or pandas: ``omega``, and of each signal its ``amplitude`` and ``phase`` [rad]."""
        signals = {
            name: {"amplitude": np.abs(value).tolist(), "phase": np.angle(value).tolist()}
            for name, value in self._values.items()
        }
        return {"omega": self.omega.tolist(), "outputs": signals}

    def __repr__(self) -> str:
        span = f"{self.omega.min():g} to {self.omega.max():g} rad/s, {len(self.omega)} frequencies"
        return f"ForcedResponse: {span}, {len(self.outputs)} outputs"


@checked
def forced_response(
    car: HasDriveline, omega: ArrayLike, inputs: Mapping[str, Any], outputs: Iterable[str] | str | None = None
) -> ForcedResponse:
    """Steady response of a linear driveline to harmonic torques, by impedances from the leaves; loss factors included.

    Parameters
    ----------
    car : Driveline or TwoMass
        Clutches as they are, locked or released.
    omega : (n,) array_like
        Angular frequencies [rad/s], > 0.
    inputs : mapping
        ``<inertia>_torque`` [N m] or ``<mass>_force`` [N] to its complex amplitude, a peak value: one number or one for each
        frequency.
    outputs : str or list of str, optional
        ``<node>_angle``, ``_speed``, ``_acceleration``; ``<compliance>_torque``, ``_twist``; ``<clutch>_torque``,
        ``_slip_speed``, all SI. None means all.

    Returns
    -------
    ForcedResponse

    Raises
    ------
    ParameterError
        A frequency that is not > 0 and finite.
    SignalError
        An amplitude that is no finite number, or not as many as frequencies.
    UnknownNameError
        A signal that is not there.
    TopologyError
        A driveline that cannot be assembled.
    PowertrainError
        Elements that are not linear, such as a `Pendulum` without a speed.

    Notes
    -----
    At an undamped resonance amplitudes are as large as rounding leaves them.

    Examples
    --------
    A loss factor of 2 % at resonance twists a shaft fifty times as far as the same torque at rest:

    >>> import numpy as np, powertrain_ctrl as pt
    >>> pair = pt.Driveline(
    ...     pt.Inertia("engine", J=0.2),
    ...     pt.SpringDamper("shaft", "engine", "wheel", stiffness=800.0, loss_factor=0.02),
    ...     pt.Constraint("wall", {"wheel": 1.0}),
    ... )
    >>> response = pt.forced_response(pair, [np.sqrt(800.0 / 0.2)], {"engine_torque": 8.0})
    >>> response.amplitude("shaft_twist").round(12)
    array([0.5])
    """
    omega = checked_frequencies("forced_response", omega)
    oscillator = oscillator_of(as_driveline(car))
    chosen = oscillator.chosen(outputs)
    index = select(list(inputs), oscillator.model.inputs, "input")
    amplitudes = [_amplitude(name, value, omega) for name, value in inputs.items()]
    values = {name: np.zeros(omega.shape, dtype=complex) for name in chosen}
    for part in _parts(omega):
        torques = {j: a[part] if np.ndim(a) else a for j, a in zip(index, amplitudes, strict=True)}
        for name, value in oscillator.response(omega[part], torques, chosen).items():
            values[name][part] = value
    return ForcedResponse(omega, tuple(chosen), values)


@checked
def frequency_response(
    car: HasDriveline,
    omega: ArrayLike,
    inputs: Iterable[str] | str | None = None,
    outputs: Iterable[str] | str | None = None,
) -> control.FrequencyResponseData:
    """Frequency response of a linear driveline, by impedances from the leaves to each input.

    Unlike ``control.frequency_response`` of its state space it loses no digits, neither beside the free motion nor far
    above the resonances, takes loss factors, and its time goes by the number of inertias, not by its cube.

    Parameters
    ----------
    car : Driveline or TwoMass
        Clutches as they are, locked or released.
    omega : (n,) array_like
        Angular frequencies [rad/s], > 0; at 0 there is `static_gain`.
    inputs : str or list of str, optional
        ``<inertia>_torque`` [N m], ``<mass>_force`` [N]; None means all.
    outputs : str or list of str, optional
        As of `forced_response`; None means all but angles.

    Returns
    -------
    control.FrequencyResponseData
        ``frdata`` (outputs, inputs, n) with names of the signals; it plots itself.

    Raises
    ------
    ParameterError
        A frequency that is not > 0 and finite.
    UnknownNameError
        A signal that is not there.
    TopologyError
        A driveline that cannot be assembled.
    PowertrainError
        No signal at all, or one twice; elements that are not linear.

    Examples
    --------
    Above all resonances the source's engine is alone with its torque, ``1 / (J omega)``:

    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> G = pt.frequency_response(car, [1e5], "engine_torque", ["engine_speed", "vehicle_speed"])
    >>> round(abs(G.frdata[0, 0, 0]) * car["engine"].J * 1e5, 6), G.output_labels
    (1.0, ['engine_speed', 'vehicle_speed'])
    """
    import control

    omega = checked_frequencies("frequency_response", omega)
    oscillator = oscillator_of(as_driveline(car))
    chosen = oscillator.chosen(outputs)
    if outputs is None:
        chosen = [name for name in chosen if oscillator.signals[name].kind != "angle"]
    index = select(inputs, oscillator.model.inputs, "input")
    data = np.zeros((len(chosen), len(index), len(omega)), dtype=complex)
    for k, j in enumerate(index):
        for part in _parts(omega):
            for name, value in oscillator.response(omega[part], {j: 1.0}, chosen).items():
                data[chosen.index(name), k, part] = value
    labels = {"inputs": [oscillator.model.inputs[j] for j in index], "outputs": chosen}
    return control.FrequencyResponseData(data, omega, **labels, name="driveline")


class Signal(NamedTuple):
    """What a name of an output means: a kind, and the number of the node, compliance or law."""

    kind: str
    number: int


class Oscillator:
    """A linear driveline in steady harmonic motion: rows of its springs and inertias over its coordinates."""

    def __init__(self, car: Driveline):
        self.model = model = assemble_with_loss(car)
        self.kinematics = model.following.kinematics
        inertias = [part for e in car for row in e.inertias for part in _squares(row)]
        place = {node: i for i, node in enumerate(model.nodes)}
        weights = np.zeros((len(inertias), len(model.nodes)))
        for k, (row, _) in enumerate(inertias):
            for node, value in row.items():
                weights[k, place[node]] = value
        self.network = Network(
            [*map(_coefficients, model.all_twists), *map(_coefficients, weights @ self.kinematics)],
            self.kinematics.shape[1],
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
        impedances: Sequence[Impedance] | None = None,
    ) -> dict[str, np.ndarray]:
        """Complex amplitudes of wanted signals under inputs by their numbers, each broadcasting with omega.

        ``impedances`` replace those of the driveline, row by row.
        """
        model, impedances = self.model, self.impedances if impedances is None else impedances
        chosen = [self.signals[name] for name in wanted]
        clutches = [signal for signal in chosen if signal.kind == "clutch"]
        loads: dict[int, Value] = {}
        for number, torque in inputs.items():
            share = self.kinematics[int(model.B[:, number].argmax())]
            for j in np.flatnonzero(share).tolist():
                loads[j] = loads.get(j, 0.0) + share[j] * torque
        nodes = {s.number for s in chosen if s.kind in ("angle", "speed", "acceleration")}
        nodes |= {i for s in chosen if s.kind == "slip_speed" for i in np.flatnonzero(model.S[s.number]).tolist()}
        twists = {s.number for s in chosen if s.kind in ("twist", "torque")}
        if clutches:
            nodes, twists = set(range(len(model.nodes))), set(range(len(model.compliances)))
        coordinates = {j for i in nodes for j in np.flatnonzero(self.kinematics[i]).tolist()}
        moved = self.network.steady(impedances, loads, omega, sorted(coordinates), sorted(twists))
        angle = {i: self._motion(self.kinematics[i], moved.motion) for i in nodes}
        torque = {
            c: impedances[c].at(omega) * moved.twist[c] if c in moved.twist else 0.0
            for c in twists
            if clutches or any(s == Signal("torque", c) for s in chosen)
        }
        held = self._held(omega, inputs, angle, torque, impedances) if clutches else {}
        found = {}
        for name, (kind, number) in zip(wanted, chosen, strict=True):
            if kind == "twist":
                value = moved.twist.get(number, 0.0)
            elif kind in ("torque", "clutch"):
                value = (torque if kind == "torque" else held)[number]
            elif kind == "slip_speed":
                value = 1j * omega * self._motion(model.S[number], angle)
            else:
                value = {"angle": 1.0, "speed": 1j * omega, "acceleration": -(omega**2)}[kind] * angle[number]
            found[name] = np.broadcast_to(value, omega.shape)
        return found

    @staticmethod
    def _motion(row: np.ndarray, motion: Mapping[int, Value]) -> Value:
        return sum(row[j] * motion[j] for j in np.flatnonzero(row).tolist() if j in motion)

    def _held(
        self,
        omega: np.ndarray,
        inputs: Mapping[int, Value],
        angle: Mapping[int, Value],
        torque: Mapping[int, Value],
        impedances: Sequence[Impedance],
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


def checked_frequencies(owner: str, omega: np.ndarray) -> np.ndarray:
    """Angular frequencies as a one-dimensional array; one that is not > 0 and finite is a `ParameterError`."""
    omega = np.atleast_1d(omega)
    wrong = ~((omega > 0.0) & (omega <= LARGEST))
    if omega.ndim != 1 or not omega.size:
        raise ParameterError(owner, "omega", f"of shape {omega.shape}", "rad/s", "one-dimensional, at least one")
    if wrong.any():
        permitted = f"> 0, at most {LARGEST:g}" + (", pt.static_gain gives the response at 0" if 0.0 in omega else "")
        raise ParameterError(owner, "omega", float(omega[wrong][0]), "rad/s", permitted)
    return omega


def _amplitude(name: str, value: Any, omega: np.ndarray) -> np.ndarray:
    try:
        array = np.asarray(value)
    except ValueError:
        array = np.asarray(None)
    if array.dtype.kind not in "iufc":
        raise SignalError(f'input "{name}" is {shown(value)}, permitted: complex amplitudes')
    if array.shape not in ((), omega.shape):
        raise SignalError(f'input "{name}" has shape {array.shape}, permitted: {omega.shape} like omega, or one number')
    if (wrong := ~(np.abs(array) <= LARGEST)).any():
        raise SignalError(f'input "{name}" is {array[wrong][0]}, permitted: finite, at most {LARGEST:g} in size')
    return array


def _parts(omega: np.ndarray) -> list[slice]:
    return [slice(start, start + AT_ONCE) for start in range(0, len(omega), AT_ONCE)]


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
