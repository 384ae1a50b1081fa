"""Which clutches at zero slip stick from an instant on, and which slide.

Each is stuck where it can hold, slides where it cannot, and all agree with the motion that follows. What is zero is
decided by the derivatives that follow it.
"""

from collections.abc import Sequence
from itertools import product

import numpy as np

from .motion import BACKWARD, FORWARD, LENIENT, STUCK, Hit, Motion, Plant, Segment

Modes = tuple[int, ...]


def consistent_modes(
    plant: Plant, modes: Modes, near: Sequence[int], x: np.ndarray, segment: Segment, hit: Hit | None = None
) -> Modes | None:
    """The modes with those of the clutches at zero slip (``near``) chosen so that they agree with their own motion.

    All stuck, then let go at once whoever cannot hold; that nearly always settles it. Where it does not, the choice
    with the fewest sliding that agrees, and where rounding leaves none, the one that contradicts itself least. None
    if that is by more than `LENIENT` tolerances.
    """
    choice = _with(modes, near, (STUCK,) * len(near))
    for _ in range(2 * len(near) + 1):
        wanted, _ = _contradictions(plant, choice, near, x, segment, hit)
        if wanted == choice:
            return choice
        choice = wanted
    least, best = LENIENT, None
    for trial in sorted(product((STUCK, FORWARD, BACKWARD), repeat=len(near)), key=np.count_nonzero):
        choice = _with(modes, near, trial)
        wanted, excess = _contradictions(plant, choice, near, x, segment, hit)
        if wanted == choice:
            return choice
        if excess < least:
            least, best = excess, choice
    return best


def _with(modes: Modes, near: Sequence[int], choice: Sequence[int]) -> Modes:
    chosen = dict(zip(near, choice, strict=True))
    return tuple(chosen.get(i, mode) for i, mode in enumerate(modes))


def _contradictions(
    plant: Plant, modes: Modes, near: Sequence[int], x: np.ndarray, segment: Segment, hit: Hit | None
) -> tuple[Modes, float]:
    """What the clutches at zero slip would do in the motion of these modes, and by how many tolerances that differs."""
    wanted, worst = list(modes), 0.0
    for margin in sorted(Motion(plant, modes, x, segment).margins(near, hit), key=lambda margin: margin.excess or 0.0):
        excess = margin.excess
        if excess is None and margin.then == STUCK:
            wanted[margin.clutch] = STUCK  # nothing makes it slide
        elif excess is not None and excess > 0.0:
            wanted[margin.clutch] = margin.then  # of two sides the one that is further beyond, which comes last
            worst = excess
    return tuple(wanted), worst
