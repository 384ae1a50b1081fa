"""Friction laws without a capacity to be controlled: constant, over slip, and behind a spring."""

from itertools import pairwise

from .laws import BACKWARD, FORWARD, STUCK, Guard, Law, Mode


def coulomb(name: str, coefficients: dict[str, float], torque: float, element: str = "") -> Law:
    """Constant friction torque [N m] against the slip; at rest it carries up to as much.

    Examples
    --------
    >>> law = coulomb("bearing", {"a": 1.0}, torque=3.0)
    >>> law.is_clutch, law.modes[law.sliding(-2.0)].torque
    (False, -3.0)
    """
    return over_slip(name, coefficients, ((0.0, torque),), element=element)


def over_slip(
    name: str, coefficients: dict[str, float], points: tuple[tuple[float, float], ...], element: str = ""
) -> Law:
    """Friction torque [N m] along straight lines through points (magnitude of slip, torque), the last slope going on.

    The first point is at slip 0; there it carries up to as much at rest.

    Examples
    --------
    >>> law = over_slip("road", {"vehicle": 1.0}, ((0.0, 100.0), (10.0, 140.0), (20.0, 260.0)))
    >>> law.sliding(25.0), law.sliding(-5.0), law.modes[2].damping, law.modes[-2].torque
    (2, -1, 12.0, -20.0)
    """
    lines = [(s, (torque - last) / (s - before), before, last) for (before, last), (s, torque) in pairwise(points)]
    if len(points) == 1:
        lines = [(float("inf"), 0.0, 0.0, points[0][1])]
    modes = {STUCK: sticking(points[0][1])}
    for number, (_, slope, first, torque) in enumerate(lines, start=1):
        ends = (first, points[number][0] if number < len(lines) else None)
        for side, word in ((1, "forward"), (-1, "backward")):
            guards = slipping(side, number, *ends)
            constant = torque - slope * first
            modes[side * number] = Mode(
                word, guards, "slip" if number == 1 else "stage", damping=slope, torque=side * constant, heats=True
            )
    return Law(name, coefficients, modes, element=element)


def sticking(torque: float = 0.0, static_ratio: float = 0.0) -> Mode:
    """Held by friction up to a torque, or to that part of the capacity."""
    sides = ((FORWARD, -1.0), (BACKWARD, 1.0))
    guards = tuple(Guard(then, torque=sign, level=torque, capacity=static_ratio) for then, sign in sides)
    return Mode("stuck", guards, kind="lock", held=True)


def slipping(side: int, number: int, first: float, last: float | None) -> tuple[Guard, ...]:
    """Guards of the line of that number, from 1 on, between two magnitudes of slip on one side."""
    below = side * (number - 1)
    guards = [Guard(below, slip=float(side), level=-first)]
    if last is not None:
        guards.append(Guard(side * (number + 1), slip=-float(side), level=last))
    return tuple(guards)


def jenkins(name: str, coefficients: dict[str, float], torque: float, stiffness: float, element: str = "") -> Law:
    """Coulomb friction [N m] behind a spring [N m/rad]: the spring is twisted up to that torque, and then slides.

    Iwan's elasto-slip element: Iwan, A distributed-element model for hysteresis, J. Appl. Mech. 33 (1966) 893-900.

    Examples
    --------
    >>> law = jenkins("damper", {"a": 1.0, "b": -1.0}, torque=8.0, stiffness=2e3)
    >>> [mode.name for mode in law.modes.values()], law.held is None
    (['stuck', 'forward', 'backward'], True)
    """
    reach = torque / stiffness
    modes = {
        STUCK: Mode(
            "stuck",
            (Guard(FORWARD, stretch=-1.0, level=reach), Guard(BACKWARD, stretch=1.0, level=reach)),
            kind="lock",
            stiffness=stiffness,
            follows=True,
            stored=stiffness,
        ),
        FORWARD: Mode("forward", (Guard(STUCK, slip=1.0),), torque=torque, heats=True, stored=stiffness),
        BACKWARD: Mode("backward", (Guard(STUCK, slip=-1.0),), torque=-torque, heats=True, stored=stiffness),
    }
    return Law(name, coefficients, modes, element=element)


def load_friction(name: str, node: str, constraint: dict[str, float], efficiency: float) -> Law:
    """Friction of a part of the torque mu that a gear carries: what enters it leaves it times the efficiency.

    The node gives ``mu + tau`` to the gear and mu goes through: ``mu = efficiency (mu + tau)`` while the node drives,
    ``mu + tau = efficiency mu`` while it is driven; at standstill tau is between these two.

    Examples
    --------
    >>> law = load_friction("gears", "a", {"a": 1.0, "b": -3.0}, efficiency=0.8)
    >>> [(law.modes[number].name, round(law.modes[number].share, 9)) for number in (1, 2)]
    [('forward, driving', 0.25), ('forward, driven', -0.2)]
    """
    driving, driven = 1.0 / efficiency - 1.0, efficiency - 1.0
    modes = {STUCK: _loaded_at_rest("stuck", 1.0, ((1, driving), (-2, driven)))}
    modes |= {3: _loaded_at_rest("stuck, reversed", -1.0, ((-1, driving), (2, driven)))}
    # which way it turns, which way it is loaded: what power does in these
    for number, side, load, word, share in (
        (1, 1.0, 1.0, "forward, driving", driving),
        (2, 1.0, -1.0, "forward, driven", driven),
        (-1, -1.0, -1.0, "backward, driving", driving),
        (-2, -1.0, 1.0, "backward, driven", driven),
    ):
        other = {1: 2, 2: 1, -1: -2, -2: -1}[number]
        guards = (Guard(STUCK if load > 0.0 else 3, slip=side), Guard(other, load=load))
        modes[number] = Mode(word, guards, share=share, heats=True)
    return Law(name, {node: 1.0}, modes, load=constraint)


def _loaded_at_rest(name: str, side: float, ends: tuple[tuple[int, float], ...]) -> Mode:
    """Held while the torque is between these two parts of a load of this sign, each with the mode beyond it."""
    (high, most), (low, least) = ends
    guards = (Guard(high, torque=-side, load=side * most), Guard(low, torque=side, load=-side * least))
    return Mode(name, guards, kind="lock", held=True)
