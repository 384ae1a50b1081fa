"""Which modes hold from an instant on.

Of laws at zero slip each sticks where it can hold and slides where it cannot, and all laws agree with the motion that
follows. What is zero is decided by the derivatives that follow it.
"""

from collections.abc import Callable, Sequence
from itertools import product

from .motion import LENIENT, Hit, Motion
from .plant import Modes, Plant


def consistent_modes(
    plant: Plant,
    modes: Modes,
    near: Sequence[int],
    motion_in: Callable[[Modes], Motion],
    hit: Hit | None = None,
    others: Sequence[int] = (),
) -> Modes | None:
    """The modes with those of the laws at zero slip (``near``) chosen so that they agree with their own motion.

    All of these stuck, then let go at once whoever cannot hold; that nearly always settles it. Where it does not, the choice
    with the fewest sliding that agrees, and where rounding leaves none, the one that contradicts itself least. None
    if that is by more than `LENIENT` tolerances. ``others`` are laws that hold no slip, each in its mode unless that
    contradicts itself. ``motion_in`` gives the motion that follows in some modes.
    """
    looked_at = (*near, *others)
    first = (*(plant.laws[i].held for i in near), *(modes[i] for i in others))
    options: list[dict[int, None]] = [{number: None} for number in first if number is not None]
    for i, permitted in zip(near, options, strict=False):
        law = plant.laws[i]
        permitted |= {number: None for number, mode in law.modes.items() if mode.held}
        permitted |= {g.then: None for number in permitted for g in law.modes[number].guards}
    choice = _with(modes, looked_at, tuple(next(iter(permitted)) for permitted in options))
    for _ in range(2 * len(looked_at) + 1):
        wanted, _ = _contradictions(plant, choice, looked_at, motion_in, hit)
        if wanted == choice:
            return choice
        choice = wanted
        for i, permitted in zip(looked_at, options, strict=True):
            permitted[choice[i]] = None
    least, best = LENIENT, None
    changes = [tuple(enumerate(permitted)) for permitted in options]
    for trial in sorted(product(*changes), key=lambda trial: sum(place > 0 for place, _ in trial)):
        choice = _with(modes, looked_at, tuple(number for _, number in trial))
        wanted, excess = _contradictions(plant, choice, looked_at, motion_in, hit)
        if wanted == choice:
            return choice
        if excess < least:
            least, best = excess, choice
    return best


def _with(modes: Modes, laws: Sequence[int], choice: Sequence[int]) -> Modes:
    chosen = dict(zip(laws, choice, strict=True))
    return tuple(chosen.get(i, mode) for i, mode in enumerate(modes))


def _contradictions(
    plant: Plant, modes: Modes, laws: Sequence[int], motion_in: Callable[[Modes], Motion], hit: Hit | None
) -> tuple[Modes, float]:
    """What these laws would do in the motion of these modes, and by how many tolerances that differs."""
    wanted, worst = list(modes), 0.0
    found = [(margin.excess, margin) for margin in motion_in(modes).margins(laws, hit)]
    for excess, margin in sorted(found, key=lambda each: each[0] or 0.0):
        if excess is None and plant.laws[margin.law].modes[margin.then].held:
            wanted[margin.law] = margin.then  # nothing makes it slide
        elif excess is not None and excess > 0.0:
            wanted[margin.law] = margin.then  # of two sides the one that is further beyond, which comes last
            worst = excess
    return tuple(wanted), worst
