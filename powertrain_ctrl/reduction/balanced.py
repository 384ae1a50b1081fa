"""Models of lower order: balanced reduction and modal truncation, both with the right steady state."""

from __future__ import annotations

import operator
import warnings
from collections.abc import Iterable
from typing import Any

import control
import numpy as np
import scipy.linalg
import slycot

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.systems import linear_system
from ..base.units import to_hz
from ..driveline.collection import HasDriveline
from ..linear.quadratic import EQUALLY_FAST, by_magnitude
from ..linear.stability import is_eigenvalue
from ..linear.statespace import state_space

# A pole this much smaller than the largest one is an integrator; of one rounding leaves 1e-15.
INTEGRATOR = 1e-10
# Poles that are this sensitive to a change of the model are the two of a double one, which belong together like a pair.
DOUBLE = 1e6
# A pole that grows by less than this share of the largest one does so by rounding.
GROWTH = 1e-9


@checked
def reduced(
    car: HasDriveline,
    order: Any,
    method: str = "balanced",
    inputs: Iterable[str] | str | None = None,
    outputs: Iterable[str] | str | None = None,
) -> control.StateSpace:
    """Model of lower order of a driveline, for given inputs and outputs.

    Integrators, one for each rigid motion that the outputs see, are split off exactly, kept, and count in the order.
    The steady state of the rest is that of the full model.

    Parameters
    ----------
    car : Driveline or TwoMass
    order : int
        Number of states, more than the integrators, at most that of the full model. Where fewer than these already
        are the whole response, "balanced" returns those.
    method : {"balanced", "modal"}
        "balanced": balanced reduction by singular perturbation, which matches the static gain (python-control's
        ``balred``, SLICOT). The error is at most twice the sum of the Hankel singular values left out
        (K. Glover, Int. J. Control 39 (1984) 1115, theorem 9.6; for singular perturbation Y. Liu, B. D. O. Anderson,
        Int. J. Control 50 (1989) 1379).
        "modal": the slowest modes are kept, the others respond at once (static correction).
    inputs, outputs : str or list of str, optional
        As in `state_space`.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    PowertrainError
        A method that is not known; an order that is not possible, or with "modal" would split a pair of poles;
        "balanced" with an undamped mode; a reduced model that is unstable.
    UnknownNameError
        A signal that is not there.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> G = pt.reduced(car, 2, inputs="engine_torque", outputs="vehicle_acceleration")
    >>> G.nstates, round(float(G.dcgain()), 6)
    (2, 0.015557)
    """
    if method not in ("balanced", "modal"):
        raise PowertrainError(f'method = {method!r}, permitted: "balanced", "modal"')
    full = state_space(car, inputs, outputs)
    rigid, elastic = _split_integrators(_scaled(full))
    n_rigid = rigid.nstates
    least = n_rigid + (1 if elastic.nstates else 0)
    if not _is_whole(order) or not least <= order <= full.nstates:
        raise PowertrainError(
            f"order = {order!r}, permitted: {least} to {full.nstates} ({n_rigid} integrators in {full.nstates} states)"
        )
    if order == full.nstates:
        return full
    lower = (_balanced if method == "balanced" else _modal)(elastic, int(order) - n_rigid)
    return _checked(_in_parallel(rigid, lower, full), full)


@checked
def hankel_singular_values(
    car: HasDriveline, inputs: Iterable[str] | str | None = None, outputs: Iterable[str] | str | None = None
) -> np.ndarray:
    """Hankel singular values of a driveline without its integrators, by which to choose the order.

    Parameters
    ----------
    car : Driveline or TwoMass
    inputs, outputs : str or list of str, optional
        As in `state_space`.

    Returns
    -------
    (n,) ndarray
        Descending, in units of output per input; n is the order of the full model without its integrators.

    Raises
    ------
    PowertrainError
        A mode without damping.
    UnknownNameError
        A signal that is not there.

    Examples
    --------
    One mode dominates; the third value is far below the second:

    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> pt.hankel_singular_values(car, "engine_torque", "vehicle_acceleration")[:4].round(4)
    array([0.0445, 0.0366, 0.0023, 0.0021])
    """
    _, elastic = _split_integrators(_scaled(state_space(car, inputs, outputs)))
    return _hankel(elastic)


def _hankel(system: control.StateSpace) -> np.ndarray:
    _require_decay(system)
    if not system.nstates:
        return np.zeros(0)
    # Factors of the Gramians by Hammarling's method: the product of the Gramians would lose half the digits.
    G = _scaled(system)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", slycot.exceptions.SlycotResultWarning)  # the reduced model is not wanted
        return slycot.ab09ad("C", "B", "N", G.nstates, G.ninputs, G.noutputs, G.A, G.B, G.C, nr=1)[-1]


def _split_integrators(system: control.StateSpace) -> tuple[control.StateSpace, control.StateSpace]:
    """The integrators and the stable rest, exactly in parallel."""
    A, nothing = system.A, np.zeros_like(system.D)
    n, speeds = len(A), np.abs(system.poles())
    count = int((speeds <= INTEGRATOR * speeds.max(initial=0.0)).sum())
    if count == 0:
        return linear_system([], [], [], nothing), system
    right = np.linalg.svd(A)[2][n - count :].T
    left = np.linalg.svd(A.T)[2][n - count :].T
    spread = np.linalg.solve(left.T @ right, left.T)
    stable = scipy.linalg.null_space(left.T)
    rigid = linear_system(np.zeros((count, count)), spread @ system.B, system.C @ right, nothing)
    rest = np.eye(n) - right @ spread
    project = stable.T @ rest
    return rigid, linear_system(stable.T @ A @ stable, project @ system.B, system.C @ stable, system.D)


def _scaled(system: control.StateSpace) -> control.StateSpace:
    """The same system with states of like size (diagonal scaling, LAPACK gebal)."""
    _, (scale, _) = scipy.linalg.matrix_balance(system.A, permute=False, separate=True)
    return linear_system(system.A * scale / scale[:, None], system.B / scale[:, None], system.C * scale, system.D)


def _balanced(system: control.StateSpace, order: int) -> control.StateSpace:
    _require_decay(system)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", slycot.exceptions.SlycotResultWarning)  # fewer states are the whole response
        return control.balred(_scaled(system), order, method="matchdc")


def _require_decay(system: control.StateSpace) -> None:
    """Every pole to the left of the axis by more than rounding; otherwise there are no Gramians."""
    poles = system.poles()
    lasting = poles[(poles.real >= 0.0) | is_eigenvalue(system.A, 1j * poles.imag)]
    if lasting.size:
        f = to_hz(np.abs(lasting).min())
        raise PowertrainError(
            f"the mode at {f:.4g} Hz is undamped, so its Hankel singular value is infinite; "
            'give it damping or reduce with method="modal"'
        )


def _is_whole(order: object) -> bool:
    try:
        operator.index(order)  # type: ignore[arg-type]
    except TypeError:
        return False
    return not isinstance(order, bool)


def _modal(system: control.StateSpace, order: int) -> control.StateSpace:
    A, B, C, D = system.A, system.B, system.C, system.D
    values, right = (array.astype(complex) for array in np.linalg.eig(A))
    try:
        left = np.linalg.inv(right)
    except np.linalg.LinAlgError:
        raise PowertrainError(
            'two poles are one double pole, which has no modes; reduce with method="balanced"'
        ) from None
    # one of each pair stands for both, counted twice
    one = np.array([i for i in by_magnitude(values) if values[i].imag >= 0.0], dtype=int)
    values, right, left = values[one], right[:, one], left[one]
    sensitivity = np.linalg.norm(right, axis=0) * np.linalg.norm(left, axis=1)
    right, left = _settled(values, right, left, B)
    count = np.where(values.imag > 0.0, 2, 1)
    kept = int(np.searchsorted(np.cumsum(count), order, side="right"))
    if count[:kept].sum() != order or (0 < kept < len(one) and sensitivity[kept - 1 : kept + 1].min() > DOUBLE):
        split = values[min(kept, len(one) - 1)]
        raise PowertrainError(f"order would split the pole pair {split:.4g}; take one state more or one less")
    slow = np.hstack([part for i in range(kept) for part in _real_columns(values[i], right[:, i])])
    slow_left = np.linalg.lstsq(slow, ((right * count)[:, :kept] @ left[:kept]).real, rcond=None)[0]
    fast = ((right * count / values)[:, kept:] @ left[kept:]).real
    return linear_system(slow_left @ A @ slow, slow_left @ B, C @ slow, D - C @ fast @ B)


def _settled(values: np.ndarray, right: np.ndarray, left: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvectors of which, where a pole is repeated, the first ones are those that the inputs drive most."""
    start = 0
    for stop in range(1, len(values) + 1):
        if stop < len(values) and abs(values[stop] - values[stop - 1]) <= EQUALLY_FAST * abs(values[stop]):
            continue
        if stop - start > 1:
            U = np.linalg.svd(left[start:stop] @ B)[0]
            right[:, start:stop] = right[:, start:stop] @ U
            left[start:stop] = U.conj().T @ left[start:stop]
        start = stop
    return right, left


def _real_columns(value: complex, vector: np.ndarray) -> list[np.ndarray]:
    """Real and imaginary part of the vector of a pair, or the vector of a real pole."""
    return [vector.real[:, None], vector.imag[:, None]] if value.imag > 0.0 else [vector.real[:, None]]


def _in_parallel(rigid: control.StateSpace, lower: control.StateSpace, full: control.StateSpace) -> control.StateSpace:
    return linear_system(
        scipy.linalg.block_diag(rigid.A, lower.A),
        np.vstack([rigid.B, lower.B]),
        np.hstack([rigid.C, lower.C]),
        lower.D,
        dt=0,
        inputs=full.input_labels,
        outputs=full.output_labels,
        name=f"driveline_of_order_{rigid.nstates + lower.nstates}",
    )


def _checked(lower: control.StateSpace, full: control.StateSpace) -> control.StateSpace:
    """The reduced system, if it is stable where the full one is."""
    growth = lower.poles().real.max(initial=0.0)
    if growth > GROWTH * np.abs(full.poles()).max():
        raise PowertrainError(f"the reduced model of order {lower.nstates} is unstable (pole at {growth:.3g} 1/s)")
    return lower
