"""How wrong is a simpler model? Models of a driveline against the detailed one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import control
import numpy as np

from ..base.checks import SMALLEST, Hertz, Number, checked_mapping
from ..base.doors import called, checked
from ..base.errors import PowertrainError, UnknownNameError
from ..base.records import Record
from ..base.tables import Printed
from ..base.units import to_hz
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.ends import ends
from ..linear.assembly import as_driveline, assemble
from ..linear.modal import modes
from ..linear.quadratic import by_magnitude
from ..linear.schur import plane_response
from ..linear.stability import OSCILLATES
from ..linear.statespace import state_space
from ..linear.stepping import forced
from .balanced import hankel_singular_values
from .twomass import TwoMass

# Torque of the ramps [N m], length of the window [s], spacing of its samples [s].
TORQUE, WINDOW, SPACING = 250.0, 3.0, 0.001
# A mode with a damping ratio from here on does not oscillate.
OVERDAMPED = (1.0 - OSCILLATES**2) ** 0.5


@called
@dataclass(frozen=True)
class ModelError:
    """One model against the detailed one.

    Attributes
    ----------
    order : int
        States from torque to vehicle acceleration.
    frequency_error : float
        Of the first elastic mode [-], undamped; where that is damped too much to oscillate (zeta >= 1), and of a model
        that is a state space, of the magnitude of the first pair of poles.
    damping_ratio : float
        Of the first pair of poles [-].
    largest_error, band_error : float
        Of torque to vehicle acceleration over the band: largest error over the largest gain; root of the
        integral of the squared error over that of the squared gain.
    chordal_distance : float
        Largest pointwise chordal distance of the two responses over the band, each over the gain of the rigid car
        (G. Vinnicombe, Uncertainty and Feedback, 2001, section 2.1; his winding number condition is not tested).
    rmse : dict
        Ramp duration [s] to root mean square error of the vehicle acceleration [m/s^2] in 3 s.
    J1, J2, stiffness, damping : float or None
        Parameters of a `TwoMass`.
    """

    order: int
    frequency_error: float
    damping_ratio: float
    largest_error: float
    band_error: float
    chordal_distance: float
    rmse: dict[float, float]
    J1: float | None = None
    J2: float | None = None
    stiffness: float | None = None
    damping: float | None = None


@called
@dataclass(frozen=True, eq=False, repr=False)
class ModelComparison(Printed, Record):
    """Table of model errors, with the responses they come from.

    Attributes
    ----------
    errors : dict
        Model name to `ModelError`.
    omega : (N,) ndarray
        Band [rad/s].
    detailed : (N,) ndarray of complex
        Response of the detailed model from torque to vehicle acceleration.
    models : dict
        Model name to the same of each model.
    time : (M,) ndarray
        [s].
    ramps : dict
        Ramp duration [s] to a dict of accelerations [m/s^2]; "detailed" and the model names.
    hankel : (n,) ndarray
        Hankel singular values of the detailed model; nan where a mode is undamped.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> table = pt.compare_models(car, {"series": pt.two_mass(car, "series"), "modal": pt.two_mass(car)}, ramps=0.1)
    >>> {name: round(error.rmse[0.1], 3) for name, error in table.errors.items()}
    {'series': 0.042, 'modal': 0.018}
    >>> table.to_dict()["order"], sorted(table.ramps[0.1])
    ([2, 2], ['detailed', 'modal', 'series'])
    """

    errors: dict[str, ModelError]
    omega: np.ndarray
    detailed: np.ndarray
    models: dict[str, np.ndarray]
    time: np.ndarray
    ramps: dict[float, dict[str, np.ndarray]]
    hankel: np.ndarray

    def keys(self) -> tuple[str, ...]:
        """Names of all models."""
        return tuple(self.errors)

    _ipython_key_completions_ = keys

    @checked
    def __getitem__(self, name: str) -> ModelError:
        if name not in self.errors:
            raise UnknownNameError("model", name, self.errors, "in this comparison")
        return self.errors[name]

    def to_dict(self) -> dict:
        """Lists by column, for JSON or pandas."""
        columns: dict[str, list] = {"model": list(self.errors)}
        for name in ("order", "frequency_error", "damping_ratio", "J1", "J2", "stiffness", "damping"):
            columns[name] = [getattr(error, name) for error in self.errors.values()]
        for name in ("largest_error", "band_error", "chordal_distance"):
            columns[name] = [getattr(error, name) for error in self.errors.values()]
        for duration in self.ramps:
            columns[f"rmse_{duration:g}_s"] = [error.rmse[duration] for error in self.errors.values()]
        return columns

    @property
    def headers(self) -> list[str]:
        """Heads of the printed table."""
        band = f"{to_hz(self.omega[-1]):.4g} Hz"
        fixed = ["model", "order", "f1 error [%]", "zeta [-]", "J1 [kg m^2]", "J2 [kg m^2]", "stiffness [N m/rad]"]
        fixed += ["damping [N m s/rad]", f"largest error to {band}", "band error", "chordal"]
        return fixed + [f"RMSE {1e3 * duration:g} ms [m/s^2]" for duration in self.ramps]

    def rows(self) -> list[list[str]]:
        """Rows of the printed table."""
        table = []
        for name, e in self.errors.items():
            row = [name, str(e.order), f"{round(100.0 * e.frequency_error, 2) + 0.0:+.2f}", f"{e.damping_ratio:.4f}"]
            for value, digits in ((e.J1, 4), (e.J2, 4), (e.stiffness, 5), (e.damping, 4)):
                row.append("–" if value is None else f"{value:.{digits}g}")
            row += [f"{value:.2g}" for value in (e.largest_error, e.band_error, e.chordal_distance)]
            table.append(row + [f"{value:.2g}" for value in e.rmse.values()])
        return table


@checked
def compare_models(
    car: HasDriveline,
    models: Mapping[str, object],
    band: tuple[Hertz, Hertz] = (0.0, 10.0),
    ramps: Number | Sequence[Number] = (0.05, 0.1, 0.2),
) -> ModelComparison:
    """Errors of simpler models from torque at the driving node to vehicle acceleration.

    Parameters
    ----------
    car : Driveline
        The detailed model, with one vehicle; with an open clutch the part that carries it counts.
    models : mapping
        Name to `TwoMass`, `Driveline` or continuous ``control.StateSpace`` with the same input and output (others it
        may have); "detailed" is taken.
    band : (float, float)
        Frequencies that count [Hz].
    ramps : float or sequence of float
        Durations of the torque ramps to 250 N m [s].

    Returns
    -------
    ModelComparison

    Raises
    ------
    PowertrainError
        A driveline with no vehicle or more than one; a model without the signals, discrete, or named "detailed"; a band
        or ramp that is not possible.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> table = pt.compare_models(car, {m: pt.two_mass(car, m) for m in ("source", "modal")})
    >>> round(100 * table["source"].frequency_error, 1), round(table["source"].band_error, 2)
    (14.3, 0.81)
    """
    between = ends(as_driveline(car))
    if len(between.vehicles) != 1:
        count = len(between.vehicles)
        raise PowertrainError(f"models are compared by the acceleration of one vehicle, there are {count}")
    (vehicle,), body, driving = between.vehicles, between.part, between.driving
    torque, acceleration = f"{driving}_torque", f"{vehicle}_acceleration"
    omega = _band(band)
    time = np.arange(0.0, WINDOW + 0.5 * SPACING, SPACING)
    durations: list[float] = np.atleast_1d(np.asarray(ramps, dtype=float)).tolist()
    if not durations or any(not SMALLEST <= duration < WINDOW for duration in durations):
        raise PowertrainError(f"ramps = {tuple(durations)} s, permitted: at least one, each > 0 and < {WINDOW:g}")
    models = checked_mapping("models", models, "from name to model")
    if "detailed" in models:
        raise PowertrainError('"detailed" is the name of the model that the others are compared with; take another')
    systems = {name: _transfer(model, torque, acceleration, name) for name, model in models.items()}
    reference = state_space(body, torque, acceleration)
    response = _response(reference, omega)
    static = _rigid_gain(body, driving, vehicle)
    table = modes(body)
    is_overdamped = bool((table.damping_ratio[table.n_rigid : table.n_rigid + 1] >= OVERDAMPED).any())
    steps = {duration: {"detailed": _ramp_response(reference, time, duration)} for duration in durations}
    errors, responses = {}, {}
    for name, system in systems.items():
        responses[name] = mine = _response(system, omega)
        for duration in durations:
            steps[duration][name] = _ramp_response(system, time, duration)
        rmse = {d: float(np.sqrt(np.mean((curves[name] - curves["detailed"]) ** 2))) for d, curves in steps.items()}
        by_pole = is_overdamped or isinstance(models[name], control.StateSpace)
        frequency, zeta = _first_mode(models[name], system, by_pole)
        wanted, _ = _first_mode(body, reference, by_pole)
        errors[name] = ModelError(
            order=system.nstates,
            frequency_error=frequency / wanted - 1.0,
            damping_ratio=zeta,
            largest_error=float(np.abs(mine - response).max() / np.abs(response).max()),
            band_error=float(np.linalg.norm(mine - response) / np.linalg.norm(response)),
            chordal_distance=_chordal(mine / static, response / static),
            rmse=rmse,
            **_parameters(models[name]),
        )
    try:
        hankel = hankel_singular_values(body, torque, acceleration)
    except PowertrainError:
        hankel = np.full(reference.nstates, np.nan)
    return ModelComparison(errors, omega, response, responses, time, steps, hankel)


def _rigid_gain(car: Driveline, driving: str, vehicle: str) -> float:
    """Gain from torque to vehicle acceleration if no spring twisted; unlike the static gain not 0 because of drag."""
    model = assemble(car)
    between = np.flatnonzero(np.count_nonzero(model.E, axis=1) > 1)
    motions = model.null_motions(between)
    first, last = (model.T[model.nodes.index(node)] @ motions for node in (driving, vehicle))
    return float(abs(last @ np.linalg.solve(motions.T @ model.M @ motions, first)))


def _band(band: tuple[float, float]) -> np.ndarray:
    low, high = band if len(band) == 2 else (np.nan, np.nan)
    if not (0.0 <= low < high and np.isfinite(high)):
        raise PowertrainError(f"band = {band} Hz, permitted: 0 <= low < high")
    # evenly spaced, so that sums are integrals; not at 0, where an integrator would have its pole
    return 2.0 * np.pi * np.linspace(max(low, high / 2000.0), high, 2000)


def _transfer(
    model: HasDriveline | control.StateSpace, torque: str, acceleration: str, name: str
) -> control.StateSpace:
    if not isinstance(model, control.StateSpace):
        return state_space(model, torque, acceleration)
    for label, known in ((torque, model.input_labels), (acceleration, model.output_labels)):
        if label not in known:
            raise PowertrainError(f'model "{name}" has no signal "{label}", only {", ".join(known)}')
    if model.isdtime(strict=True):
        raise PowertrainError(f'model "{name}" is sampled every {model.dt:g} s, permitted: continuous models')
    return control.ss(
        model.A,
        model.B[:, [model.input_labels.index(torque)]],
        model.C[[model.output_labels.index(acceleration)]],
        model.D[np.ix_([model.output_labels.index(acceleration)], [model.input_labels.index(torque)])],
    )


def _response(system: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    return plane_response(system.A, system.B, system.C, 1j * omega)[:, 0, 0] + system.D[0, 0]


def _ramp_response(system: control.StateSpace, time: np.ndarray, duration: float) -> np.ndarray:
    edges, lines = np.array([0.0, duration, time[-1]]), np.array([[0.0, TORQUE / duration], [TORQUE, 0.0]])
    n = system.nstates
    states = forced(system.A[None], system.B[None, :, 0], np.zeros((1, n)), edges, lines, time)[0]
    return system.C[0] @ states[:n] + system.D[0, 0] * states[n]


def _first_mode(
    model: HasDriveline | control.StateSpace, system: control.StateSpace, by_pole: bool
) -> tuple[float, float]:
    """Undamped frequency, or magnitude of the pole, [rad/s] and damping ratio of the first oscillation."""
    poles = system.poles()
    pairs = poles[poles.imag > OSCILLATES * np.abs(poles)]
    if not pairs.size:
        return np.nan, np.nan
    pole = pairs[by_magnitude(pairs)[0]]
    zeta = float(-pole.real / np.abs(pole))
    if by_pole:
        return float(np.abs(pole)), zeta
    table = modes(model)
    return float(table.omega[table.n_rigid]), zeta


def _chordal(a: np.ndarray, b: np.ndarray) -> float:
    return float((np.abs(a - b) / np.sqrt((1.0 + np.abs(a) ** 2) * (1.0 + np.abs(b) ** 2))).max())


def _parameters(model: HasDriveline | control.StateSpace) -> dict[str, float]:
    if not isinstance(model, TwoMass):
        return {}
    return {name: getattr(model, name) for name in ("J1", "J2", "stiffness", "damping")}
