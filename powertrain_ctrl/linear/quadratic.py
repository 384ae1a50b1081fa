"""Roots of the quadratic eigenvalue problem ``(lambda^2 + lambda Delta + Omega^2) x = 0`` of a damped driveline."""

import warnings

import numpy as np

# Eigenvalues smaller than this part of the largest one are corrected one by one: rounding is in proportion to the largest.
SMALL = 1e-6
# Poles whose magnitudes are nearer than this are equally fast.
EQUALLY_FAST = 1e-9
# Corrections after which an eigenvalue must have settled, and how far.
CORRECTIONS, SETTLED = 5, 1e-8


def damped_poles(omega: np.ndarray, dampers: np.ndarray) -> np.ndarray:
    """Poles of modes with dampers: two of each elastic mode, one of each rigid motion, none of which grows.

    Parameters
    ----------
    omega : (n,) ndarray
        Undamped natural frequencies Omega [rad/s]; 0 for a rigid motion that dampers resist.
    dampers : (dampers, n) ndarray
        Factor of the damping in mass-scaled modal coordinates, ``Delta = dampers^T dampers``.

    Returns
    -------
    (poles,) ndarray of complex
        [rad/s]. Small ones are as accurate as large ones.

    Examples
    --------
    A slow and a fast mode, 9 decades apart, with one damper on both:

    >>> [f"{pole:.6g}" for pole in damped_poles(np.array([1e-3, 1e6]), np.array([[1e-2, 1e2]]))]
    ['-5000+999987j', '-5000-999987j', '-5e-05+0.000998749j', '-5e-05-0.000998749j']
    """
    n = len(omega)
    Delta = dampers.T @ dampers
    damping = np.diag(Delta)
    A = np.block([[np.zeros((n, n)), np.diag(omega)], [-np.diag(omega), -Delta]])
    # Rows in order of the speed at which they change, fast ones first: then the QR algorithm is accurate for the slow
    # ones too (G. W. Stewart, on graded matrices).
    fast = np.maximum(omega, damping)
    rate = np.concatenate([omega * (omega / fast), fast]) if n else np.zeros(0)
    order = np.argsort(-rate, kind="stable")
    order = order[(order >= n) | (omega[order % n] > 0.0)] if n else order
    poles = np.linalg.eigvals(A[np.ix_(order, order)]).astype(complex)
    small = np.abs(poles) < SMALL * np.abs(poles).max(initial=0.0)
    for i in np.flatnonzero(small & (poles.imag >= 0.0)):
        poles[i] = corrected = _corrected(poles[i], omega, dampers)
        if corrected.imag:
            poles[i + 1] = corrected.conjugate()  # LAPACK puts the second of a pair behind the first
    # no damper drives a mode: what rounding has put to the right of the axis is on it
    poles.real = np.minimum(poles.real, 0.0)
    return poles


def dissipative_poles(A: np.ndarray, r: int) -> np.ndarray:
    """Eigenvalues of a nonsingular ``[[-S, H], [-H^T, -Delta]]`` with S (r, r) and Delta semidefinite; none of them grows.

    Parameters
    ----------
    A : (n, n) ndarray
        In energy coordinates.
    r : int
        How many of these belong to springs.

    Returns
    -------
    (n,) ndarray of complex
        [rad/s]

    Examples
    --------
    A mass of 1 kg on a spring of 4 N/m, which yields with 5 N s/m in series:

    >>> dissipative_poles(np.array([[-4.0 / 5.0, 2.0], [-2.0, 0.0]]), 1).round(6)
    array([-0.4+1.959592j, -0.4-1.959592j])
    """
    rate = np.abs(A).max(axis=1, initial=0.0)
    order = np.argsort(-rate, kind="stable")
    poles = np.linalg.eigvals(A[np.ix_(order, order)]).astype(complex)
    sign = np.where(np.arange(len(A)) < r, -1.0, 1.0)
    small = np.abs(poles) < SMALL * np.abs(poles).max(initial=0.0)
    for i in np.flatnonzero(small & (poles.imag >= 0.0)):
        poles[i] = corrected = _settled(poles[i], A, sign)
        if corrected.imag:
            poles[i + 1] = corrected.conjugate()
    poles.real = np.minimum(poles.real, 0.0)
    return poles


def _settled(start: complex, A: np.ndarray, sign: np.ndarray) -> complex:
    """Eigenvalue near this one by inverse iteration; with signs A is symmetric, which gives the left vector."""
    value, x = start, 1.0 + np.arange(len(A)) / len(A)
    tiny = np.finfo(float).eps * np.abs(A).max(axis=1)
    for _ in range(CORRECTIONS):
        shifted = A - value * np.eye(len(A))
        for _ in range(2):
            try:
                x = np.linalg.solve(shifted, x)
            except np.linalg.LinAlgError:
                x = np.linalg.solve(shifted + np.diag(tiny), x)
            x = x / np.abs(x).max()
        weight = x @ (sign * x)
        nearest = complex((sign * x) @ (A @ x) / weight) if weight else value
        if not start.imag:
            nearest = complex(nearest.real)
        moved, value = abs(nearest - value), nearest
        if moved <= SETTLED * abs(value):
            return value
    return start


def _corrected(start: complex, omega: np.ndarray, dampers: np.ndarray) -> complex:
    """Root near this one by inverse iteration and the quadratic ``x^T x lambda^2 + x^T Delta x lambda + x^T Omega^2 x``."""
    value = start
    damping = np.einsum("ij,ij->j", dampers, dampers)
    x = 1.0 + np.arange(len(omega)) / len(omega)
    for _ in range(CORRECTIONS):
        scale = 1.0 / np.sqrt(abs(value) ** 2 + abs(value) * damping + omega**2)
        scaled = dampers * scale
        Q = np.diag((value**2 + omega**2) * scale**2) + value * (scaled.T @ scaled)
        for _ in range(2):
            # at the root Q is singular; rounding in its place makes x the null vector
            try:
                x = np.linalg.solve(Q + np.finfo(float).eps * np.diag(1.0 + np.arange(len(x))), x)
            except np.linalg.LinAlgError:  # singular to the last bit, with that rounding
                x = np.linalg.svd(Q)[2][-1].conj()
            x = x / np.abs(x).max()
        z = scale * x
        a, b, c = z @ z, (dampers @ z) @ (dampers @ z), (omega * z) @ (omega * z)
        root = np.emath.sqrt(b * b - 4.0 * a * c)
        # the sum without cancellation
        q = -0.5 * (b + (root if (np.conj(b) * root).real >= 0.0 else -root))
        roots = np.array([q / a, c / q])
        nearest = complex(roots[np.abs(roots - value).argmin()])
        if not start.imag:
            nearest = complex(nearest.real)
        moved, value = abs(nearest - value), nearest
        if moved <= SETTLED * abs(value):
            return value
    warnings.warn(
        f"the pole near {start:.6g} rad/s is not to be trusted: the values of this driveline lie too far apart",
        RuntimeWarning,
        stacklevel=4,
    )
    return start


def by_magnitude(poles: np.ndarray) -> np.ndarray:
    """Order of poles from the slowest to the fastest; of equally fast ones the lower in the plane comes first.

    Parameters
    ----------
    poles : (k,) ndarray of complex

    Returns
    -------
    (k,) ndarray of int

    Examples
    --------
    >>> by_magnitude(np.array([5.0 + 0.0j, 3.0 + 4.0j, 3.0 - 4.0000000001j, 1.0]))
    array([3, 2, 0, 1])
    """
    rising = np.argsort(np.abs(poles), kind="stable")
    speed = np.abs(poles[rising])
    group = np.cumsum(np.diff(speed, prepend=speed[:1]) > EQUALLY_FAST * speed)
    return rising[np.lexsort((poles[rising].imag, group))]
