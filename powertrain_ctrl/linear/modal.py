"""Undamped modes of a driveline."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple, NoReturn

import numpy as np
import scipy.linalg

from ..base.checks import AtLeastOne
from ..base.doors import called, checked
from ..base.errors import PowertrainError, TopologyError
from ..base.records import Record, read_only
from ..base.tables import Printed
from ..base.units import to_hz
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.kinematics import times
from ..elements import CouplingRow
from .assembly import TorsionalModel, as_driveline, assemble_with_loss
from .couplings import coupling_matrix, couplings_of, require_none, uncoupled
from .links import links_of
from .lowest import lowest
from .mass import MassFactor, mass_factor
from .sensitivity import log_derivatives
from .solved import SolvedRows, dense, solved

# Singular values with the largest rows first lose as many digits as frequencies are decades apart, less about four. Beyond
# this spread they are computed by one-sided Jacobi, which loses none, up to a size at which it takes some 0.1 s.
SPREAD, JACOBI_LIMIT = 1e4, 300
# Up to so many coordinates, or so many times the modes wanted, dense matrices are faster than sparse ones.
DENSE, FEW = 300, 4
# Frequencies nearer than this are one repeated frequency: only their common subspace is determined.
REPEATED = 1e-9


@called
@dataclass(frozen=True, eq=False, repr=False)
class Modes(Printed, Record):
    """Modes of a driveline, ascending in frequency; the first ``n_rigid`` have exactly 0.0 Hz.

    Attributes
    ----------
    nodes, compliances : tuple of str
        What the rows of the shapes and energy shares are.
    omega, frequency_hz : (modes,) ndarray
        Undamped natural frequency [rad/s]; the same [Hz].
    damping_ratio : (modes,) ndarray
        ``phi^T D phi / (2 omega)`` [-], exact for proportional damping, else to first order in the damping
        (`poles` is always exact), and half the loss factors weighted by strain energy; nan for a rigid motion, which has
        none.
    shapes : (nodes, modes) ndarray
        Motion of each node as it is, rad or m; the largest of each mode is 1.
    n_rigid : int
        Number of motions that twist no spring.
    strain_energy : (compliances, modes) ndarray
        Share of each spring in the strain energy of the mode; 0 for rigid motions.
    kinetic_energy : (nodes, modes) ndarray
        Share of each node in the kinetic energy of the mode.

    Examples
    --------
    Wheels and vehicle in the first elastic mode of the source's car, reflected as in Fig. 2.8:

    >>> import powertrain_ctrl as pt
    >>> result = pt.modes(pt.examples.conventional())
    >>> float(result.frequency_hz[1].round(2)), result.dominant_compliance(1)
    (2.64, 'drive_shafts')
    >>> rows = [result.nodes.index(name) for name in ("engine", "wheels", "vehicle")]
    >>> result.reflected_shapes[rows, 1].round(4)
    array([ 1.    , -0.2733, -0.6219])
    """

    nodes: tuple[str, ...]
    compliances: tuple[str, ...]
    omega: np.ndarray
    damping_ratio: np.ndarray
    shapes: np.ndarray
    n_rigid: int
    strain_energy: np.ndarray
    kinetic_energy: np.ndarray
    _car: Driveline

    @property
    def _model(self) -> TorsionalModel:
        return assemble_with_loss(self._car).undamped

    @property
    def frequency_hz(self) -> np.ndarray:
        """(modes,) ndarray: undamped natural frequency [Hz]."""
        return to_hz(self.omega)

    @cached_property
    def reflected_shapes(self) -> np.ndarray:
        """(nodes, modes) ndarray: shapes as seen from the first node of each part, largest entry 1 (equation (2.2)).

        A node that rests in the rigid motion, such as a ring that a brake holds, has no ratio and is shown as it moves.

        Raises
        ------
        TopologyError
            Nodes without a single ratio between them (a free planetary gear).
        """
        motion = self._model.rigid_motion
        reflected = self.shapes / np.where(motion == 0.0, 1.0, motion)[:, None]
        return read_only(_largest_one(reflected))

    @cached_property
    def links(self) -> tuple[tuple[str, str], ...]:
        """Pairs of nodes with inertia that a spring, a damper or a rigid connection joins, by their place in `nodes`."""
        return links_of(self._model, np.asarray(self.kinetic_energy.any(axis=1)))

    def __getitem__(self, mode: object) -> NoReturn:
        raise TypeError(
            f"modes have no items: frequency_hz[{mode!r}] and damping_ratio[{mode!r}] are of one mode, as "
            f"shapes[:, {mode!r}] is"
        )

    def __len__(self) -> int:
        return len(self.omega)

    @checked
    def dominant_compliance(self, mode: int) -> str:
        """Name of the compliance with most of the strain energy of a mode; empty for a rigid motion."""
        if not 0 <= mode < len(self):
            raise PowertrainError(f"mode = {mode}, permitted: 0 to {len(self) - 1}")
        share = self.strain_energy[:, mode]
        return self.compliances[first_largest(share)] if share.any() else ""

    @checked
    def sensitivity(self, mode: int, of: str = "frequency_hz") -> dict[str, float]:
        """Change of frequency or damping of a mode, in per cent, for one per cent of each value of the driveline.

        Parameters
        ----------
        mode : int
            An elastic one, with a frequency of its own.
        of : {"frequency_hz", "damping_ratio"}

        Returns
        -------
        dict
            ``"element.parameter"`` to ``d ln f / d ln p``, or ``d ln zeta / d ln p``, of every value of bodies, springs,
            gears and tyres. Those of the damping ratio, which is that of `damping_ratio`, are nan where nothing damps it.

        Raises
        ------
        PowertrainError
            A mode that is not there, a rigid motion, or one of several modes with the same frequency.

        Examples
        --------
        The drive shafts decide the first mode of the source's car, the second gear of the ratio most:

        >>> import powertrain_ctrl as pt
        >>> result = pt.modes(pt.examples.conventional()).sensitivity(1)
        >>> {name: round(result[name], 3) for name in ("drive_shafts.stiffness", "engine.J", "gearbox.ratio")}
        {'drive_shafts.stiffness': 0.382, 'engine.J': -0.197, 'gearbox.ratio': -0.595}
        """
        if not self.n_rigid <= mode < len(self):
            raise PowertrainError(f"mode = {mode}, permitted: {self.n_rigid} to {len(self) - 1}, the elastic ones")
        if of not in ("frequency_hz", "damping_ratio"):
            raise PowertrainError(f'of = {of!r}, permitted: "frequency_hz", "damping_ratio"')
        if of == "damping_ratio":
            require_none(self._car)
        omega = self.omega[mode]
        alike = np.flatnonzero(np.abs(self.omega - omega) <= REPEATED * omega)
        if len(alike) > 1:
            raise PowertrainError(
                f"modes {', '.join(map(str, alike))} have one frequency, so none has a derivative of its own"
            )
        frequency, damping = log_derivatives(self._car, float(omega), self.shapes[:, mode])
        return frequency if of == "frequency_hz" else damping

    def to_dict(self) -> dict:
        """Plain lists by column, for JSON or pandas; a missing damping ratio is None."""
        return {
            "mode": list(range(len(self))),
            "frequency_hz": self.frequency_hz.tolist(),
            "damping_ratio": [None if np.isnan(zeta) else float(zeta) for zeta in self.damping_ratio],
            "compliance": [self.dominant_compliance(mode) for mode in range(len(self))],
            "strain_energy_share": [float(share) for share in self.strain_energy.max(axis=0, initial=0.0)],
        }

    def rows(self) -> Iterator[list[str]]:
        """Rows of the printed table."""
        for mode, (f, zeta) in enumerate(zip(self.frequency_hz, self.damping_ratio, strict=True)):
            energy = self.strain_energy[:, mode]
            order = np.argsort(-energy.round(9), kind="stable")
            # as many springs as hold half of it
            most = (
                order[: 1 + int(np.searchsorted(np.cumsum(energy[order]), 0.5 - 1e-9))] if energy.any() else order[:0]
            )
            yield [
                str(mode),
                f"{f:.4f}",
                "–" if np.isnan(zeta) else f"{zeta:.4f}",
                f"{100.0 * energy[most].sum():.0f} %" if len(most) else "–",
                ", ".join(self.compliances[i] for i in most) or "rigid motion",
            ]

    headers = ("mode", "f [Hz]", "zeta [-]", "energy", "most strain energy in")

    @property
    def overdamped(self) -> np.ndarray:
        """Numbers of the modes whose damping ratio is 1 or more."""
        return np.flatnonzero(self.damping_ratio >= 1.0 - REPEATED)

    @property
    def note(self) -> str:
        """What the table does not show: modes damped so much that they do not oscillate; empty if there are none."""
        names = [str(mode) for mode in self.overdamped]
        if not names:
            return ""
        return f"zeta >= 1 in mode {', '.join(names)}: what oscillates there, if anything, only the damped poles tell"


@checked
def modes(car: HasDriveline, count: AtLeastOne | None = None) -> Modes:
    """Natural frequencies, damping ratios and mode shapes of a driveline.

    The frequencies are the singular values of ``B = k^(1/2) E T M^(-1/2)``, for which ``B^T B`` is the stiffness in
    mass-scaled coordinates. Forming the stiffness first would lose half the digits of the lowest mode.

    Parameters
    ----------
    car : Driveline or TwoMass
    count : int, optional
        The slowest ones alone, rigid motions among them. Of a driveline of hundreds of inertias they come from sparse
        matrices, in time and memory that grow with their number only: ten modes of 10 000 take some 50 MiB.

    Returns
    -------
    Modes

    Raises
    ------
    TopologyError
        A driveline that cannot be assembled, as in `assemble`.

    Examples
    --------
    Frequencies (2.12) of the source:

    >>> import powertrain_ctrl as pt
    >>> pt.modes(pt.examples.conventional())
    mode     f [Hz]  zeta [-]  energy  most strain energy in
    0        0.0000         –       –  rigid motion
    1        2.6377    0.0987    76 %  drive_shafts
    2       21.0857    0.0626    96 %  damper_spring
    3       31.4941    1.1966    77 %  tyres
    4      188.7027    0.0163    98 %  clutch_shaft
    5      706.6229    0.1231    94 %  output_shaft
    6     1064.6325    0.0351    95 %  input_shaft
    zeta >= 1 in mode 3: what oscillates there, if anything, only the damped poles tell
    """
    driveline = as_driveline(car)
    coupled = couplings_of(driveline)
    if coupled:
        return _coupled_modes(driveline, coupled, count)
    rows = solved(driveline)
    if rows is not None and count is not None and FEW * count < len(rows.coordinates) > DENSE:
        omega, Phi, n_rigid, T, F, J = lowest(rows, count)
        twist, motion = F @ Phi, T @ Phi
        return _modes(driveline, rows.names, _values(rows), omega, n_rigid, twist, motion, motion * (J @ motion))
    model = undamped(driveline, rows)
    omega, Phi, n_rigid = modal_basis(model)
    if count is not None:
        omega, Phi, n_rigid = omega[:count], Phi[:, :count], min(n_rigid, count)
    twist, motion = times(model.F, Phi), times(model.T, Phi)
    kinetic = motion * times(model.J, motion)
    values = _Values(model.stiffness, model.damping, model.loss_factor)
    return _modes(driveline, model.compliances, values, omega, n_rigid, twist, motion, kinetic)


def _coupled_modes(car: Driveline, rows: tuple[CouplingRow, ...], count: int | None) -> Modes:
    """Modes of the rest, which the couplings damp or drive besides."""
    rest = modes(uncoupled(car), count=count)
    J, D, motion = (
        assemble_with_loss(uncoupled(car)).J,
        coupling_matrix(rows, rest.nodes),
        rest.shapes[:, rest.n_rigid :],
    )
    damping_ratio = rest.damping_ratio.copy()
    inertia, lost = (np.sum(motion * (matrix @ motion), axis=0) for matrix in (J, D))
    damping_ratio[rest.n_rigid :] += lost / (2.0 * rest.omega[rest.n_rigid :] * inertia)
    return replace(rest, damping_ratio=damping_ratio, _car=car)


def _modes(
    car: Driveline,
    compliances: tuple[str, ...],
    values: _Values,
    omega: np.ndarray,
    n_rigid: int,
    twist: np.ndarray,
    motion: np.ndarray,
    kinetic: np.ndarray,
) -> Modes:
    squares = twist**2
    # damping of each mode by itself
    with np.errstate(divide="ignore", invalid="ignore"):
        damping_ratio = (values.damping @ squares) / (2.0 * omega)
    strain = values.stiffness[:, None] * squares
    total = strain.sum(axis=0)
    strain[:, :n_rigid] = 0.0
    strain[:, n_rigid:] /= total[n_rigid:]
    if values.loss_factor.any():
        damping_ratio += values.loss_factor @ strain / 2.0
    damping_ratio[:n_rigid] = np.nan
    return Modes(
        nodes=car.nodes,
        compliances=compliances,
        omega=omega,
        damping_ratio=damping_ratio,
        shapes=_largest_one(motion),
        n_rigid=n_rigid,
        strain_energy=strain,
        kinetic_energy=kinetic / kinetic.sum(axis=0),
        _car=car,
    )


class Undamped(NamedTuple):
    """Matrices of a driveline as its dampers fade: as of `TorsionalModel`, and motions that twist no spring.

    ``free`` are those that no damper resists either.
    """

    nodes: tuple[str, ...]
    compliances: tuple[str, ...]
    T: np.ndarray
    F: np.ndarray
    J: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray
    loss_factor: np.ndarray
    mass: MassFactor
    springless: np.ndarray
    free: np.ndarray


def undamped(car: Driveline, rows: SolvedRows | None) -> Undamped:
    if rows is None:
        model = assemble_with_loss(car).undamped
        names, motions = (model.nodes, model.compliances), (model.springless_motions, model.free_motions)
        values = model.T, model.F, model.J, model.stiffness, model.damping, model.loss_factor
        return Undamped(*names, *values, model.mass, *motions)
    n, place = len(rows.coordinates), rows.place
    T, F, J = np.zeros((len(car.nodes), n)), np.zeros((len(rows.compliances), n)), np.zeros((len(car.nodes),) * 2)
    node_place = {node: i for i, node in enumerate(car.nodes)}
    for node, i in node_place.items():
        for name, value in rows.motion[node].items():
            T[i, place[name]] = value
    for c, twist in enumerate(rows.twists):
        for name, value in twist.items():
            F[c, place[name]] = value
    for row in rows.inertias:
        for a, line in zip(row.nodes, row.matrix, strict=True):
            for b, value in zip(row.nodes, line, strict=True):
                J[node_place[a], node_place[b]] += value
    springless = rows.springless.basis(rows.coordinates)
    free = springless if rows.free is rows.springless else rows.free.basis(rows.coordinates)
    if rows.is_diagonal:
        mass = MassFactor(np.sqrt([rows.mass[j, j] for j in range(n)]))
    else:
        mass = mass_factor(dense(n, rows.mass))
    return Undamped(car.nodes, rows.names, T, F, J, *_values(rows), mass, springless, free)


class _Values(NamedTuple):
    """Stiffness, damping and loss factor of each compliance."""

    stiffness: np.ndarray
    damping: np.ndarray
    loss_factor: np.ndarray


def _values(rows: SolvedRows) -> _Values:
    return _Values(*(np.array([getattr(row, what) for row in rows.compliances]) for what in _Values._fields))


def modal_basis(model: Undamped) -> tuple[np.ndarray, np.ndarray, int]:
    """omega (n,) ascending, mass-normalised shapes (n, n) in the coordinates, number of rigid motions."""
    elastic = np.flatnonzero(model.stiffness > 0.0)
    rigid = _rigid_basis(model)
    n, n_rigid = rigid.shape
    B = np.sqrt(model.stiffness[elastic])[:, None] * model.mass.scaled(model.F[elastic])
    values, vectors = _singular(B, n - n_rigid)
    omega = np.concatenate([np.zeros(n_rigid), values[: n - n_rigid][::-1]])
    scaled = np.concatenate([rigid, vectors[:, : n - n_rigid][:, ::-1]], axis=1)
    Phi = model.mass.lowered(scaled)
    _settle_repeated(model, omega, Phi, n_rigid)
    return omega, Phi, n_rigid


def _singular(B: np.ndarray, rank: int) -> tuple[np.ndarray, np.ndarray]:
    """Singular values, descending, and right singular vectors (n, min) of B (springs, n), of which ``rank`` are not 0."""
    if not B.size:
        return np.zeros(0), np.zeros((B.shape[1], 0))
    order = np.argsort(-np.einsum("ij,ij->i", B, B), kind="stable")
    _, values, Vt = np.linalg.svd(B[order], full_matrices=False)
    if rank and max(B.shape) <= JACOBI_LIMIT and values[0] > SPREAD * values[rank - 1]:
        tall = B.T if B.shape[0] < B.shape[1] else B
        # joba 4: full pivoting, accurate for a matrix badly scaled in rows and columns (LAPACK dgejsv)
        values, U, V, work, _, info = scipy.linalg.lapack.dgejsv(np.asfortranarray(tall), joba=4, jobt=0)
        if info == 0:
            return values * (work[0] / work[1]), U[:, : len(values)] if tall is not B else V
    return values, Vt.T


def _rigid_basis(model: Undamped) -> np.ndarray:
    """Orthonormal mass-scaled motions that twist no spring; first those that no damper resists either."""
    free, springless = model.mass.lifted(model.free), model.mass.lifted(model.springless)
    basis = free / np.sqrt(np.einsum("ij,ij->j", free, free))
    if basis.shape[1] > 1:
        basis = np.linalg.qr(basis)[0]
    remaining = springless.shape[1] - basis.shape[1]
    if remaining:
        springless = springless / np.linalg.norm(springless, axis=0)
        rest = springless - basis @ (basis.T @ springless)
        basis = np.hstack([basis, np.linalg.svd(rest)[0][:, :remaining]])
    return basis


def _settle_repeated(model: Undamped, omega: np.ndarray, Phi: np.ndarray, n_rigid: int) -> None:
    """Within each repeated frequency choose the shapes that do not couple through the dampers."""
    elastic = omega[n_rigid:]
    is_next = elastic[1:] - elastic[:-1] > REPEATED * elastic[1:]
    if is_next.all():
        return
    ends = [n_rigid, *(n_rigid + 1 + np.flatnonzero(is_next)).tolist(), len(omega)]
    for start, stop in pairwise(ends):
        if stop - start > 1:
            twist = np.sqrt(model.damping)[:, None] * (model.F @ Phi[:, start:stop])
            Phi[:, start:stop] = Phi[:, start:stop] @ scipy.linalg.eigh(twist.T @ twist)[1]


def _largest_one(shapes: np.ndarray) -> np.ndarray:
    """Each column scaled so that its largest entry in magnitude is +1."""
    if not shapes.size:
        raise TopologyError("a driveline without motion has no modes")
    size = np.abs(shapes)
    largest = size.max(axis=0)
    first = (size >= largest - REPEATED * largest).argmax(axis=0)
    return shapes / np.copysign(largest, shapes[first, np.arange(shapes.shape[1])])


def first_largest(values: np.ndarray) -> int:
    """Index of the largest value, of equal ones the first: two half-shafts differ by rounding.

    >>> first_largest(np.array([0.1, 0.7, 0.7 + 1e-16]))
    1
    """
    return int((values >= values.max() - REPEATED * np.abs(values).max()).argmax())
