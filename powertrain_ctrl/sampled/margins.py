"""Stability, damping and margins of a sampled anti-jerk loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import control
import numpy as np
import slycot

from ..base.doors import called, checked
from ..base.errors import PowertrainError
from ..base.records import Record
from ..base.systems import linear_system
from ..base.tables import Printed
from ..linear.assembly import assemble, kept
from ..linear.quadratic import by_magnitude
from ..linear.schur import InPlane
from ..linear.stability import ROUNDING, is_eigenvalue, undamped_modes, without_motion_at
from .controller import check_controller
from .loopmodes import beyond_nyquist, damping_ratios, loop_matrix, oscillations, owners
from .plant import MEASURED, SampledPlant
from .rate_limit import RateMargin, rate_margin
from .unit import Controller, ControlUnit, check_acting

# The largest disk margin there is; a loop without feedback has it.
NO_FEEDBACK = 2.0
# A loop gain below this, -120 dB, is none; its sign is rounding.
NO_GAIN = 1e-6
# Only poles beyond this can be on the unit circle; not even rounding in a pole of multiplicity 14 moves one so far.
CLOSE = 0.9
# Entries below this share of a feedback's matrices do not couple its states.
UNREACHED = 1e-9
# What is left of a motion after one sample if it is a pure delay or has died out within it [-].
WITHIN_A_SAMPLE = 1e-9
# Frequencies over the Nyquist frequency, fine where the modes of a driveline are: as finely spaced up to a quarter of it,
# and beyond.
SPACING = 0.25 / 800, 0.75 / 600
GRID = np.unique(
    np.concatenate([np.geomspace(1e-4, 1.0, 700), np.linspace(0.0, 0.25, 801)[1:], np.linspace(0.25, 1.0, 601)])
)


@called
@dataclass(frozen=True, eq=False, repr=False)
class LoopMargins(Printed, Record):
    """What the feedback loop of plant and controller withstands at the plant input.

    Attributes
    ----------
    stable : bool
        All poles inside the unit circle, by more than rounding, but the rigid motion's. A plant without feedback is
        stable if dampers resist every mode, so one without dampers never is.
    zeta_first, zeta_second : float
        Damping ratio of the first and the second of `modes`: that of the pole which its own becomes as the feedback is
        turned up, or of a pole of actuator or controller that comes to oscillate nearer to it than to another mode,
        whichever is less. 1 where nothing oscillates any more, or the plant has no such mode; negative where it grows.
    disk_margin : float
        Balanced disk margin: gain and phase may change together within it; 2 without feedback, 0 if unstable
        (P. Seiler, A. Packard, P. Gahinet, IEEE Control Systems 40 (2020) 78, with skew 0).
    gain_margin_db, phase_margin_deg : float
        Classical margins; inf if nothing crosses, 0 if unstable.
    poles : (n,) ndarray of complex
        ``log(z) / dt`` [rad/s].
    folded : (n,) ndarray of bool
        Poles of modes beyond the Nyquist frequency, which sampling shows at another frequency than they have.
    modes : (m,) ndarray of complex
        Poles [rad/s] with which the plant's own modes oscillate in continuous time, the slowest first; one of each pair.
    omega, loop : (N,) ndarray
        Frequencies [rad/s] and, complex, the loop gain at the plant input [-].
    rate : RateMargin or None
        Up to which torques the margins hold where plant or unit have a torque rate; None without one, or if unstable.

    Examples
    --------
    Damping ratio of the first mode without and with feedback:

    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    >>> round(pt.loop_margins(plant, None).zeta_first, 3)
    0.099
    >>> pt.loop_margins(plant, controller)
    loop              value
    stable            True
    zeta_first        0.2689
    zeta_second       0.05133
    disk_margin       1.02
    gain_margin_db    17.24
    phase_margin_deg  63.54
    """

    stable: bool
    zeta_first: float
    zeta_second: float
    disk_margin: float
    gain_margin_db: float
    phase_margin_deg: float
    poles: np.ndarray
    folded: np.ndarray
    modes: np.ndarray
    omega: np.ndarray
    loop: np.ndarray
    rate: RateMargin | None = None

    headers = ("loop", "value")

    def rows(self) -> list[list[str]]:
        """Rows of the printed table."""
        names = ("zeta_first", "zeta_second", "disk_margin", "gain_margin_db", "phase_margin_deg")
        return [["stable", str(self.stable)], *([name, f"{getattr(self, name):.4g}"] for name in names)]

    @property
    def note(self) -> str:
        """Up to which torques the margins hold; empty where there is no torque rate."""
        return "" if self.rate is None else repr(self.rate)


def acting_on(plant: SampledPlant, controller: Controller) -> control.NonlinearIOSystem | None:
    """The controller itself, or of a unit and of a schedule over ratios that which acts at the ratio of a plant."""
    if isinstance(controller, ControlUnit):
        check_acting(controller, plant.dt)
        controller = controller.at_ratio(plant.ratio)
    at_ratio = getattr(controller, "at_ratio", None)
    return controller if at_ratio is None else at_ratio(plant.ratio)


@checked
def loop_margins(plant: SampledPlant, controller: Controller) -> LoopMargins:
    """Poles and margins of the feedback loop; feedforward and reference model, which it does not contain, are left out.

    Of a lag or a delay that a rise and a fall have their own of the longer one counts.

    Parameters
    ----------
    plant : SampledPlant
    controller : ControlUnit, control.StateSpace or None
        Linear controller as in `closed_loop`; of a unit and of a schedule that of the plant's ratio; None is the plant
        alone.

    Returns
    -------
    LoopMargins

    Raises
    ------
    PowertrainError
        A controller that does not fit or is not linear.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> feedback = pt.antijerk.speed_difference(plant, gain=6.0)
    >>> round(pt.loop_margins(plant, pt.antijerk.one_dof(plant, feedback)).disk_margin, 2)
    1.02
    """
    return margins_among((plant,), controller)[0]


def margins_among(plants: Sequence[SampledPlant], controller: Controller) -> list[LoopMargins]:
    """`loop_margins` of the same controller on each plant."""
    last: tuple[control.NonlinearIOSystem | None, float, _Feedback] | None = None
    found = []
    for plant in plants:
        own = acting_on(plant, controller)
        if last is None or own is not last[0] or plant.dt != last[1]:
            last = own, plant.dt, _Feedback.of(_feedback_path(own, plant.dt))
        margins = _margins(_plant_in_plane(plant), last[2])
        if margins.stable:
            margins = replace(margins, rate=rate_margin(plant, controller, own, margins.omega, margins.loop))
        found.append(margins)
    return found


def _margins(own: _PlantInPlane, feedback: _Feedback, is_reached: bool = False) -> LoopMargins:
    plant, G, K = own.plant, own.G, feedback.K
    rest = _without_rigid_motion(plant, loop_matrix(G, K), own.rounding)
    z, owner = owners(G, K, np.exp(own.modes * plant.dt), np.concatenate([own.z, feedback.z]))
    is_rigid = np.arange(len(z)) == (np.abs(z - 1.0).argmin() if len(rest) < len(z) else -1)
    if K.nstates or K.D.any():
        at_one, stable = _lasting(rest, np.linalg.eigvals(rest) if is_rigid.any() else z, own.rounding)
        if at_one and K.nstates and not is_reached:
            # in coordinates of its own the controller may hide that speeds do not reach its reference model
            return _margins(own, _Feedback.of(_reached_by_inputs(K)), is_reached=True)
    else:
        stable = not undamped_modes(plant.linear).size
    shown = ~is_rigid & (np.abs(z) > WITHIN_A_SAMPLE)  # the others have no place in the s-plane
    z, owner = z[shown], owner[shown]
    poles = np.log(z) / plant.dt
    folded = np.isin(owner, np.flatnonzero(beyond_nyquist(own.modes, plant.dt)))
    zeta = damping_ratios(poles, owner, own.modes, plant.dt)
    omega = GRID * np.pi / plant.dt
    loop = _gain(feedback.on_grid, own.on_grid)
    if stable:

        def refined(more: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            z_more = np.exp(1j * more * plant.dt)
            there = _gain(feedback.response(z_more), own.speeds.response(z_more))
            every, order = np.unique(np.concatenate([omega, more]), return_index=True)
            return every, np.concatenate([loop, there])[order]

        omega, loop = refined(_resonances(np.concatenate([poles, np.log(own.z + 1e-300) / plant.dt]), plant.dt))
        omega, loop = refined(_decisive(omega, loop))
        disk, gain, phase = _disk_margin(loop), _gain_margin(loop), _phase_margin(loop)
    else:
        disk = gain = phase = 0.0
    order = by_magnitude(poles)
    poles, folded = poles[order], folded[order]
    return LoopMargins(
        stable=stable,
        zeta_first=zeta[0],
        zeta_second=zeta[1],
        disk_margin=disk,
        gain_margin_db=gain,
        phase_margin_deg=phase,
        poles=poles,
        folded=folded,
        modes=own.modes,
        omega=omega,
        loop=loop,
    )


def _without_rigid_motion(plant: SampledPlant, A: np.ndarray, rounding: float) -> np.ndarray:
    """System matrix of a loop without the motion of the whole car, where neither drag nor feedback resists it."""
    model = assemble(plant.linear)
    return without_motion_at(1.0, A, rounding) if model.free_motions.size else A


def _lasting(A: np.ndarray, z: np.ndarray, rounding: float) -> tuple[bool, bool]:
    """Whether A may have an eigenvalue at 1, and whether all of them, z, are inside the unit circle, beyond rounding."""
    size = np.abs(z)
    near = size > CLOSE
    at_one, *on_circle = is_eigenvalue(A, np.append(1.0, z[near] / size[near]), rounding)
    return at_one, bool((size < 1.0).all()) and not any(on_circle)


def _resonances(poles: np.ndarray, dt: float) -> np.ndarray:
    """Frequencies [rad/s] around those at which poles resonate, as fine as these resonances are narrow.

    Of those that the grid resolves as finely there are none.
    """
    upper = poles[poles.imag > 0.0]
    upper = upper[0.25 * np.abs(upper.real) * dt / np.pi < np.where(upper.imag * dt / np.pi < 0.25, *SPACING)]
    around = upper.imag[:, None] + upper.real[:, None] * np.linspace(-5.0, 5.0, 41)
    return around[(around > 0.0) & (around < np.pi / dt)]


def _decisive(omega: np.ndarray, loop: np.ndarray) -> np.ndarray:
    """Frequencies [rad/s] in the intervals where disk margin, gain margin and phase margin are decided."""
    crossing = _crosses(np.abs(loop) - 1.0) | (_crosses(loop.imag) & (loop.real[:-1] < 0.0))
    closest = int(np.abs((1.0 - loop) / (1.0 + loop)).argmax())
    left = np.union1d(np.flatnonzero(crossing), np.arange(max(closest - 1, 0), min(closest + 1, len(omega) - 1)))
    return (omega[left] + np.linspace(0.0, 1.0, 101)[:, None] * (omega[left + 1] - omega[left])).ravel()


def _feedback_path(controller: control.StateSpace | None, dt: float) -> control.StateSpace:
    """From the two speeds to the command; what the controller reads of its own command is closed inside."""
    if controller is None:
        return linear_system([], [], [], np.zeros((1, 2)), dt)
    check_controller(controller, dt)
    if not isinstance(controller, control.StateSpace):
        raise PowertrainError("margins are those of a linear controller (control.StateSpace)")
    A, B, C, D = controller.A, controller.B, controller.C, controller.D
    labels = list(controller.input_labels)
    speeds = np.zeros((len(labels), 2))
    for j, name in enumerate(MEASURED):
        if name in labels:
            speeds[labels.index(name), j] = 1.0
    B_y, D_y = B @ speeds, D @ speeds
    if "torque_limited" in labels:
        own = [labels.index("torque_limited")]
        A = np.block([[A, B[:, own]], [C, D[:, own]]])
        B_y, C = np.vstack([B_y, D_y]), np.hstack([C, D[:, own]])
    # Feedforward and reference model are not reached by the speeds; exact zeros tell.
    reached = B_y.any(axis=1)
    while True:
        more = reached | ((A != 0.0) @ reached)
        if (more == reached).all():
            break
        reached = more
    return linear_system(A[np.ix_(reached, reached)], B_y[reached], C[:, reached], D_y, dt)


def _reached_by_inputs(K: control.StateSpace) -> control.StateSpace:
    """What the inputs reach of a feedback, in other coordinates (staircase form, SLICOT's TB01PD)."""
    n, m, p = K.nstates, K.ninputs, K.noutputs
    B, C = np.zeros((n, max(m, p))), np.zeros((max(m, p), n))  # room that SLICOT works in
    B[:, :m], C[:p] = K.B, K.C
    A, B, C, reached = slycot.tb01pd(n, m, p, K.A, B, C, job="C", tol=UNREACHED)
    return linear_system(A[:reached, :reached], B[:reached, :m], C[:p, :reached], K.D, K.dt)


class _PlantInPlane(NamedTuple):
    """What of a plant the margins of all its loops need."""

    plant: SampledPlant
    G: control.StateSpace
    z: np.ndarray  # its poles
    modes: np.ndarray
    rounding: float
    speeds: InPlane  # from the command
    on_grid: np.ndarray


@kept(64)
def _plant_in_plane(plant: SampledPlant) -> _PlantInPlane:
    G = plant.discrete()
    # the matrix exponential of the fastest motion loses as many digits as there are radians in a sample
    rounding = ROUNDING * (1.0 + plant.dt * np.abs(plant.continuous.poles()).max(initial=0.0))
    speeds = InPlane(G.A, G.B, G.C[:2])
    on_grid = speeds.response(np.exp(1j * np.pi * GRID))
    return _PlantInPlane(
        plant, G, np.linalg.eigvals(G.A).astype(complex), oscillations(plant), rounding, speeds, on_grid
    )


class _Feedback(NamedTuple):
    """What of a feedback the loops with all plants need."""

    K: control.StateSpace
    z: np.ndarray  # its poles
    plane: InPlane
    on_grid: np.ndarray

    @classmethod
    def of(cls, K: control.StateSpace) -> _Feedback:
        plane = InPlane(K.A, K.B, K.C)
        z = np.linalg.eigvals(K.A).astype(complex)
        return cls(K, z, plane, plane.response(np.exp(1j * np.pi * GRID)) + K.D)

    def response(self, z: np.ndarray) -> np.ndarray:
        """(N, 1, 2) ndarray of complex, from the speeds to the command."""
        return self.plane.response(z) + self.K.D


def _gain(feedback: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Loop gain from the responses of the command to the speeds and of these to the command."""
    return -np.einsum("kij,kjl->kil", feedback, speeds)[:, 0, 0]


def _crosses(values: np.ndarray) -> np.ndarray:
    """Between which neighbours the sign changes; 0 counts as positive, so that one of them may be the crossing itself."""
    is_above = values >= 0.0
    return is_above[:-1] != is_above[1:]


def _disk_margin(loop: np.ndarray) -> float:
    return float(min(NO_FEEDBACK, 2.0 / np.abs((1.0 - loop) / (1.0 + loop)).max()))


def _gain_margin(loop: np.ndarray) -> float:
    """Least change of gain, up or down, that brings the loop to -1 [dB]."""
    left = np.flatnonzero(_crosses(loop.imag) & (loop.real[:-1] < 0.0))
    share = loop.imag[left] / (loop.imag[left] - loop.imag[left + 1])
    crossing = np.abs(loop.real[left] + share * (loop.real[left + 1] - loop.real[left]))
    if loop.real[-1] < 0.0:  # at the Nyquist frequency the loop is real
        crossing = np.append(crossing, -loop.real[-1])
    crossing = crossing[crossing > NO_GAIN]
    return float(np.abs(20.0 * np.log10(crossing)).min(initial=np.inf))


def _phase_margin(loop: np.ndarray) -> float:
    """Least change of phase where the gain is 1 [deg]."""
    size = np.log(np.maximum(np.abs(loop), 1e-300))
    at = np.flatnonzero(_crosses(size))
    share = size[at] / (size[at] - size[at + 1])
    value = loop[at] + share * (loop[at + 1] - loop[at])
    return float(np.abs(np.degrees(np.angle(-value))).min(initial=np.inf))
