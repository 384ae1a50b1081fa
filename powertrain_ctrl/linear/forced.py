"""Steady response of a driveline to harmonic torques: frequency responses and complex amplitudes of every signal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import LARGEST
from ..base.doors import called, checked
from ..base.errors import ParameterError, SignalError, UnknownNameError, shown
from ..base.records import Record
from ..base.tables import Listed, Rows, number
from ..base.units import to_hz
from ..driveline.collection import HasDriveline
from .assembly import as_driveline
from .oscillator import oscillator_of
from .outputs import select

if TYPE_CHECKING:
    import control

# So many frequencies at once stay in the cache of a processor.
AT_ONCE = 8192


@called
@dataclass(frozen=True, eq=False, repr=False)
class ForcedResponse(Listed, Record):
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

    def keys(self) -> tuple[str, ...]:
        """Names of all signals."""
        return self.outputs

    _ipython_key_completions_ = keys

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

    def listed(self) -> Rows:
        """Signals with their largest amplitude and where it is."""
        peaks = {name: np.abs(value) for name, value in self._values.items()}
        at = {name: to_hz(float(self.omega[peak.argmax()])) for name, peak in peaks.items()}
        return [[name, number(float(peak.max())), f"at {number(at[name])} Hz"] for name, peak in peaks.items()]

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
    frequencies = checked_frequencies("forced_response", omega)
    oscillator = oscillator_of(as_driveline(car))
    chosen = oscillator.chosen(outputs)
    index = select(list(inputs), oscillator.model.inputs, "input")
    amplitudes = [_amplitude(name, value, frequencies) for name, value in inputs.items()]
    values = np.empty((len(chosen), len(frequencies)), dtype=complex)
    for part in _parts(frequencies):
        torques = {j: a[part] if np.ndim(a) else a for j, a in zip(index, amplitudes, strict=True)}
        oscillator.response(frequencies[part], torques, chosen, values[:, part])
    return ForcedResponse(frequencies, tuple(chosen), dict(zip(chosen, values, strict=True)))


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

    Notes
    -----
    On trees every amplitude is right to 1e-12 of itself, except about an antiresonance: there to a few roundings of the
    values that it hangs on, whose last digits move the antiresonance.

    Examples
    --------
    Above all resonances the source's engine is alone with its torque, ``1 / (J omega)``:

    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> G = pt.frequency_response(car, [1e5], "engine_torque", ["engine_speed", "vehicle_speed"])
    >>> round(float(abs(G.frdata[0, 0, 0])) * car["engine"].J * 1e5, 5), G.output_labels
    (1.0, ['engine_speed', 'vehicle_speed'])
    """
    import control

    frequencies = checked_frequencies("frequency_response", omega)
    oscillator = oscillator_of(as_driveline(car))
    chosen = oscillator.chosen(outputs)
    if outputs is None:
        chosen = [name for name in chosen if oscillator.signals[name].kind != "angle"]
    index = select(inputs, oscillator.model.inputs, "input")
    data = np.empty((len(chosen), len(index), len(frequencies)), dtype=complex)
    for k, j in enumerate(index):
        for part in _parts(frequencies):
            oscillator.response(frequencies[part], {j: 1.0}, chosen, data[:, k, part])
    labels = {"inputs": [oscillator.model.inputs[j] for j in index], "outputs": chosen}
    return control.FrequencyResponseData(data, frequencies, **labels, name="driveline")


def checked_frequencies(owner: str, given: ArrayLike) -> np.ndarray:
    """Angular frequencies as a one-dimensional array; one that is not > 0 and finite is a `ParameterError`."""
    omega = np.atleast_1d(np.asarray(given, dtype=float))
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
