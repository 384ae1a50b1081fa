"""From a driveline to its two-mass control model, by four methods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError, TopologyError, UnknownNameError
from ..driveline.collection import HasDriveline
from ..linear.assembly import as_driveline
from .halves import Cut
from .twomass import TwoMass


@checked
def two_mass(car: HasDriveline, method: str = "modal", driving: str | None = None) -> TwoMass:
    """Two-mass control model of a driveline; with an open clutch, of the part that carries the vehicle.

    Parameters
    ----------
    car : Driveline
        A `TwoMass` comes back as it is.
    method : {"modal", "source", "series", "fit"}
        "source": equations (2.14), (2.22). The driveline is cut at the spring that twists most in the first mode; the
        inertias on either side are added up, the spring keeps its stiffness, and the damping is chosen so that the
        resonance peak of torque to vehicle acceleration is that of the detailed model. Without the tyre it rings
        14 % too high on the source's car.
        "series": the same with the tyre's stiffness in series, each tyre with the shaft that drives its wheel; the cut is
        at the shafts, however soft the tyre is.
        "modal": frequency, damping ratio and the driving node's participation are those of the first elastic mode;
        the total inertia is kept.
        "fit": least squares on the responses from torque to vehicle acceleration and engine speed up to
        four times the first frequency, from "modal"; the total inertia is kept.
    driving : str, optional
        Node that drives; the engine, the node of that name or else the first one, if not given.

    Returns
    -------
    TwoMass

    Raises
    ------
    UnknownNameError
        A node that is not there.
    TopologyError
        No elastic mode that dominates, more than one rigid motion, or a driveline that its springs do not divide in
        two; with "source" or "series" also a first mode without a resonance peak.
    PowertrainError
        A method that is not known; a fit that does not converge, or one of an undamped driveline.

    Examples
    --------
    Tables 2.2 and 2.3:

    >>> import powertrain_ctrl as pt
    >>> pt.two_mass(pt.examples.conventional(), method="source")
    TwoMass: f = 3.014 Hz, zeta = 0.0964
      J1 = 0.4814 kg m^2 (engine), J2 = 249 kg m^2 (wheels), ratio = 18, radius = 0.35 m
      stiffness = 34400 N m/rad, damping = 350.006 N m s/rad (drive_shafts)
    >>> launching = pt.examples.conventional(damping="open").release("clutch")
    >>> round(pt.two_mass(launching, method="source").J1, 4)
    0.0414

    With the right frequency:

    >>> pt.two_mass(pt.examples.conventional())
    TwoMass: f = 2.638 Hz, zeta = 0.0987
      J1 = 0.4725 kg m^2 (engine), J2 = 251.884 kg m^2 (wheels), ratio = 18, radius = 0.35 m
      stiffness = 26154 N m/rad, damping = 311.422 N m s/rad (drive_shafts), 22.3 % of the twist in the tyre
    """
    if not isinstance(method, str) or method not in METHODS:
        raise PowertrainError(f"method = {method!r}, permitted: {', '.join(map(repr, METHODS))}")
    if isinstance(car, TwoMass):
        return car
    if driving is not None and driving not in car.driveline.nodes:
        raise UnknownNameError("driving node", driving, car.driveline.nodes, "a node of the driveline")
    # only the source's own way leaves the tyre out, and so cuts there if it is the softest
    return METHODS[method](Cut(as_driveline(car), method == "source", driving))


def _source(cut: Cut) -> TwoMass:
    behind_the_sensor = 1.0 if cut.first[cut.node(cut.wheels)] else 0.0
    return _added_up(cut, cut.shaft_stiffness(), behind_the_sensor)


def _series(cut: Cut) -> TwoMass:
    return _added_up(cut, *cut.series)


def _added_up(cut: Cut, stiffness: float, rim_share: float) -> TwoMass:
    """Inertias of both sides, damping by the height of the resonance."""
    undamped = cut.two_mass(cut.inertia(cut.first), stiffness, 0.0, rim_share)
    zeta = _damping_ratio_of_peak(_resonance_peak(cut))
    return replace(undamped, damping=2.0 * zeta * undamped.omega / undamped.compliance_of_inertia)


def _modal(cut: Cut) -> TwoMass:
    """With the mass-normalised shape phi of the first mode, ``phi_1^2 = J2' / (J1 (J1 + J2'))`` as of two masses."""
    participation = cut.modal_shapes[cut.at, 1] ** 2
    J1 = cut.total / (1.0 + participation * cut.total)
    unit = cut.two_mass(J1, 1.0, 0.0, cut.series[1])
    omega, zeta = cut.modes.omega[1], cut.modes.damping_ratio[1]
    compliance = unit.compliance_of_inertia
    return replace(unit, stiffness=float(omega**2 / compliance), damping=float(2.0 * zeta * omega / compliance))


def _fit(cut: Cut) -> TwoMass:
    import scipy.optimize

    start = _modal(cut)
    if not start.damping:
        raise PowertrainError("an undamped driveline has no finite resonance to fit; use method='modal' or add damping")
    omega = np.linspace(0.02, 4.0, 400) * cut.modes.omega[1]
    acceleration, speed = cut.response(omega)
    scale = np.abs(acceleration).max()

    def model(parameters: np.ndarray) -> TwoMass:
        J1, stiffness, damping = np.exp(parameters) * [start.J1, start.stiffness, start.damping]
        return cut.two_mass(float(J1), float(stiffness), float(damping), start.rim_share)

    def residual(parameters: np.ndarray) -> np.ndarray:
        if np.exp(parameters[0]) * start.J1 >= cut.total:
            return np.full(3 * len(omega), 1e3)
        a, w = model(parameters).response(omega)
        error = (a - acceleration) / scale
        # the speed varies over decades: its logarithm, and little weight, decide how the inertia divides
        return np.concatenate([error.real, error.imag, 0.1 * np.log(np.abs(w / speed))])

    solution = scipy.optimize.least_squares(residual, np.zeros(3), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    if not solution.success or not np.isfinite(solution.cost):
        raise PowertrainError(f"the fit did not converge: {solution.message}")
    return model(solution.x)


METHODS = {"modal": _modal, "source": _source, "series": _series, "fit": _fit}


def _resonance_peak(cut: Cut) -> float:
    """Largest gain from driving torque to acceleration of the driven side near the first mode, over the static gain."""
    import scipy.optimize

    if not cut.model.damping.any():
        return np.inf

    def gain(omega: float) -> float:
        return float(np.abs(cut.response(np.array([omega]))[0][0]))

    omega_1 = cut.modes.omega[1]
    # with much damping the peak lies far below the undamped frequency
    bounds, tolerance = (0.2 * omega_1, 1.5 * omega_1), {"xatol": 1e-10 * omega_1}
    peak = scipy.optimize.minimize_scalar(lambda omega: -gain(omega), bounds=bounds, options=tolerance)
    return -peak.fun / (abs(cut.motion[cut.node(cut.driven)]) / cut.total)


def _damping_ratio_of_peak(peak: float) -> float:
    """Damping ratio of ``(1 + 2 zeta s) / (1 + 2 zeta s + s^2)`` from its largest gain."""
    import scipy.optimize

    if np.isinf(peak):
        return 0.0

    def excess(zeta: float) -> float:
        x = 2.0 / (1.0 + np.sqrt(1.0 + 8.0 * zeta**2))  # (omega / omega_0)^2 at the peak
        return float(np.sqrt((1.0 + 4.0 * zeta**2 * x) / ((1.0 - x) ** 2 + 4.0 * zeta**2 * x))) - peak

    if excess(10.0) >= 0.0:
        raise TopologyError("the first mode has no resonance peak, so no control model of two masses can be fitted")
    return float(scipy.optimize.brentq(excess, 1e-9, 10.0, xtol=1e-15))
