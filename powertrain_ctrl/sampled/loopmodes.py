"""Which poles of a sampled loop are those of the plant's own modes."""

import control
import numpy as np
from scipy.optimize import linear_sum_assignment

from ..linear.quadratic import by_magnitude
from ..linear.stability import OSCILLATES
from .plant import SampledPlant

# A pole of actuator or controller counts for the mode nearest to it up to this ratio of their frequencies.
NEAR = 3.0
# Steps in which the feedback is turned up: the first and the least one.
FIRST_STEP, LEAST_STEP = 2.0**-3, 2.0**-8


def oscillations(plant: SampledPlant) -> np.ndarray:
    """Poles [rad/s] with which the plant oscillates in continuous time, one of each pair, the slowest first."""
    poles = plant.continuous.poles()
    upper = poles[poles.imag > OSCILLATES * np.abs(poles)]
    return upper[by_magnitude(upper)]


def beyond_nyquist(modes: np.ndarray, dt: float) -> np.ndarray:
    """Which modes sampling shows at another frequency than they have; one at the Nyquist frequency is not among them."""
    return modes.imag > (1.0 + 1e-9) * np.pi / dt


def loop_matrix(G: control.StateSpace, K: control.StateSpace, share: float = 1.0) -> np.ndarray:
    """System matrix of a plant and a share of the feedback K of its first two outputs."""
    n, speeds = G.nstates, G.C[:2]
    A = np.empty((n + K.nstates,) * 2)
    A[:n, :n], A[:n, n:] = G.A + share * G.B @ K.D @ speeds, share * G.B @ K.C
    A[n:, :n], A[n:, n:] = K.B @ speeds, K.A
    return A


def owners(
    G: control.StateSpace, K: control.StateSpace, modes: np.ndarray, apart: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Poles of the loop, and the number of the mode whose pole each becomes as the feedback is turned up.

    Parameters
    ----------
    G, K : control.StateSpace
        Discrete plant and feedback.
    modes : (m,) ndarray of complex
        Poles z of the plant's modes, one of each pair.
    apart : (n,) ndarray of complex
        Poles z of plant and feedback, each by itself.

    Returns
    -------
    z : (n,) ndarray of complex
        Eigenvalues of `loop_matrix`.
    owner : (n,) ndarray of int
        -1 of a pole that no mode's becomes.

    Examples
    --------
    A mode of the plant and a real pole of the feedback, which by itself is at z = 0.5:

    >>> A = [[0.9, 0.3], [-0.3, 0.9]]
    >>> G = control.ss(A, [[0.0], [1.0]], np.eye(2), np.zeros((2, 1)), dt=True)
    >>> K = control.ss([[0.5]], [[0.1, 0.0]], [[-0.2]], [[0.0, -0.1]], dt=True)
    >>> z, owner = owners(G, K, np.array([0.9 + 0.3j]), np.array([0.9 + 0.3j, 0.9 - 0.3j, 0.5]))
    >>> z.round(2), owner
    (array([0.86+0.31j, 0.86-0.31j, 0.47+0.j  ]), array([ 0,  0, -1]))
    """
    z = apart
    owner = np.full(len(z), -1)
    owner[_matched(np.concatenate([modes, modes.conj()]), z)] = np.tile(np.arange(len(modes)), 2)
    share, step = 0.0 if K.nstates or K.D.any() else 1.0, FIRST_STEP
    while share < 1.0:
        later = np.linalg.eigvals(loop_matrix(G, K, share + step))
        place = _matched(z, later)
        # a pole is followed surely if its way is short against its distance from the next one
        far = np.abs(z[:, None] - z)
        np.fill_diagonal(far, np.inf)
        room = np.maximum(far.min(axis=1, initial=np.inf), 1e-3 * np.abs(1.0 - z))
        is_sure = np.abs(later[place] - z) <= 0.25 * room
        if step > LEAST_STEP and not is_sure[(owner == 0) | (owner == 1)].all():
            step /= 2.0
            continue
        before, owner = owner, np.empty_like(owner)
        owner[place] = before
        share, z = share + step, later
        step = min(2.0 * step, 1.0 - share)
    return z.astype(complex), owner


def damping_ratios(poles: np.ndarray, owner: np.ndarray, modes: np.ndarray, dt: float) -> tuple[float, float]:
    """Damping ratios of the first and the second mode in a loop.

    Parameters
    ----------
    poles : (n,) ndarray of complex
        Poles ``log(z) / dt`` of the loop [rad/s] without those of delays and of the rigid motion.
    owner : (n,) ndarray of int
        As of `owners`.
    modes : (m,) ndarray of complex
        As of `oscillations`.
    dt : float
        Sample time [s].

    Returns
    -------
    first, second : float
        As `LoopMargins` says.

    Examples
    --------
    The second mode is beyond the Nyquist frequency of 50 Hz; where sampling shows it at 42 Hz, it is at 58 Hz:

    >>> modes = np.array([-1.0 + 10.0j, -10.0 + 2j * np.pi * 58.0])
    >>> seen = np.array([-1.0 + 10.0j, -1.0 - 10.0j, -10.0 - 2j * np.pi * 42.0, -10.0 + 2j * np.pi * 42.0])
    >>> [round(zeta, 4) for zeta in damping_ratios(seen, np.array([0, 0, 1, 1]), modes, dt=0.01)]
    [0.0995, 0.0274]
    """
    others = poles[owner < 0]
    distance = np.abs(np.log(np.abs(others[:, None]) / np.abs(modes)))
    ratios = [1.0, 1.0]
    for k, mode in enumerate(modes[:2]):
        # one halfway between two modes counts for both
        is_near = (distance[:, k] <= distance.min(axis=1) + 1e-9) & (distance[:, k] <= np.log(NEAR))
        own = _as_it_is(poles[owner == k], mode, dt)
        mine = np.concatenate([own if own.size else [mode], others[is_near]])  # it may die out within a sample
        ratios[k] = float((-mine.real / np.abs(mine)).min())
    return ratios[0], ratios[1]


def _as_it_is(poles: np.ndarray, mode: complex, dt: float) -> np.ndarray:
    """Poles of one mode at the frequency that it has, of those which sampling does not tell apart."""
    both = np.stack([poles, poles.conj()])
    both = both + 2j * np.pi / dt * np.round((mode.imag - both.imag) * dt / (2.0 * np.pi))
    return both[np.abs(both.imag - mode.imag).argmin(axis=0), np.arange(len(poles))]


def _matched(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """For each of ours its place among theirs, all different, nearest on the whole."""
    return linear_sum_assignment(np.abs(ours[:, None] - theirs))[1]
