"""What is nonlinear in a driveline, stated as a table: laws, their modes, and the guards that end a mode.

A *law* acts by a torque on one linear combination of node motions. The rate of that combination is its *slip*, the
combination itself its *twist*; a law may have a *stretch* of its own besides, what of the twist loads it. In each of its
modes the torque is affine in stretch and slip, or the slip is held at zero and the torque is what that takes. A mode lasts
while all its guards are positive; the first that is not names the mode that follows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from math import isfinite
from typing import NamedTuple

from ..base.errors import PowertrainError

# Numbers of the modes of dry friction.
FORWARD, STUCK, BACKWARD, FREE = 1, 0, -1, 2
# Twists [rad] that differ by less than this part of the larger one, or of 1 rad, are the same: a law may start on an edge.
EDGE = 1e-12


class Guard(NamedTuple):
    """What must stay positive while a mode lasts: a sum of these parts of what the law does; and the mode ``then``.

    ``twist * q + stretch * y + slip * s + torque * tau + level + capacity * c + load * mu`` with twist q [rad], stretch y
    [rad], slip s [rad/s], torque tau [N m], the input ``<name>_capacity`` c [N m] and the load mu [N m] of the law.
    """

    then: int
    twist: float = 0.0
    stretch: float = 0.0
    slip: float = 0.0
    torque: float = 0.0
    level: float = 0.0
    capacity: float = 0.0
    load: float = 0.0


class Mode(NamedTuple):
    """How a law acts: ``tau = stiffness y + damping s + torque + c (capacity + slope s)``; if ``held``, what keeps s at 0.

    With a ``share`` it is that part of the load of the law besides.

    The stretch y goes on with ``y' = s`` if it ``follows`` the twist, and fades with ``leak`` [1/s] besides; with an
    infinite leak it is 0 at once. A mode with an ``origin`` begins with ``y = twist - origin``. ``kind`` is the word for the
    event with which it begins. If it ``heats``, the part of the torque that depends on neither stretch nor slip is
    friction. ``stored`` is the stiffness whose energy the stretch keeps; what it loses besides by the law is heat.
    """

    name: str
    guards: tuple[Guard, ...] = ()
    kind: str = "slip"
    held: bool = False
    stiffness: float = 0.0
    damping: float = 0.0
    torque: float = 0.0
    capacity: float = 0.0
    slope: float = 0.0
    follows: bool = False
    leak: float = 0.0
    origin: float | None = None
    heats: bool = False
    stored: float = 0.0
    share: float = 0.0


class Region(NamedTuple):
    """Where the slips s of some laws of an element are, ``edge s >= 0`` for all ``edges``, and their torques there.

    These are ``s form s``: one form, a symmetric matrix, for each of these laws; across edges the torques do not jump.
    """

    edges: tuple[tuple[float, ...], ...]
    forms: tuple[tuple[tuple[float, ...], ...], ...]


class Law(NamedTuple):
    """Torque on ``slip = sum(coefficient * speed)`` by modes.

    ``max_torque`` is the capacity [N m] where no input ``<name>_capacity`` is given (or ``<name>_<signal>``); a law with
    None has no such input. Without any capacity it is in the mode ``idle``. A law of an element with several laws has the
    name of that ``element`` besides; the torques of one that ``weighs`` are parts of the weight of its node. One that
    ``imposes`` has a single mode, in which the slip is its input; the value is the inertia that it has added. One that is
    ``memoryless`` is at any twist and slip in the mode to which its guards lead from the one at rest there. One whose
    torque depends on the slips of other laws of its element too has that of a `Region` besides; it has the same ``regions``
    as they, which ``cover`` what these words say, and a single mode. Such a torque is not followed exactly, but closely. The
    ``load`` of a law is the torque mu of the constraint with these coefficients, which acts on its nodes as ``-mu *
    coefficient``; a law with a load may hold its slip in several modes, which differ in what they hold.
    """

    name: str
    coefficients: dict[str, float]
    modes: Mapping[int, Mode]
    max_torque: float | None = None
    idle: int | None = None
    element: str = ""
    signal: str = "capacity"
    weighs: bool = False
    imposes: float | None = None
    memoryless: bool = False
    regions: tuple[Region, ...] = ()
    cover: str = ""
    load: dict[str, float] | None = None

    def on(self, weight: float) -> Law:
        """The law on a node of this weight [N]: where it ``weighs``, its torques are parts of that."""
        if not self.weighs:
            return self
        modes = {number: mode._replace(torque=weight * mode.torque) for number, mode in self.modes.items()}
        return self._replace(modes=modes, weighs=False)

    @property
    def input(self) -> str:
        """Name of the input that closes it."""
        return f"{self.name}_{self.signal}"

    @property
    def is_rigid(self) -> bool:
        """Whether nothing ends the mode that holds the slip but its input: then it takes up whatever slip there is."""
        return self.is_clutch and self.held is not None and not self.modes[self.held].guards

    def shown(self, number: int) -> int:
        """Number of a mode as users see it: of a clutch -1, 0, 1 or 2, on whatever part of its friction curve."""
        if not self.is_clutch or number in (FORWARD, STUCK, BACKWARD, FREE):
            return number
        return FORWARD if number > 0 else BACKWARD

    @property
    def owner(self) -> str:
        """Name of the element whose law it is."""
        return self.element or self.name

    @property
    def is_clutch(self) -> bool:
        """Whether a capacity closes it: then it is locked or released in the linear models."""
        return self.max_torque is not None

    @property
    def held(self) -> int | None:
        """Number of the mode that holds the slip at zero, of the first if there are several, None if there is none."""
        return next((number for number, mode in self.modes.items() if mode.held), None)

    @property
    def blocks(self) -> int:
        """Sign of the slip that it does not allow, whatever torque that takes; 0 if it lets go either way."""
        if self.held is None or self.is_clutch:
            return 0
        ends = [guard.torque for guard in self.modes[self.held].guards]
        return int(not any(end < 0.0 for end in ends)) - int(not any(end > 0.0 for end in ends))

    @property
    def has_twist(self) -> bool:
        """Whether its twist or a stretch matters."""
        return any(
            mode.stiffness or mode.follows or mode.origin is not None or any(g.twist or g.stretch for g in mode.guards)
            for mode in self.modes.values()
        )

    @property
    def carries(self) -> bool:
        """Whether it carries a steady load by its twist; friction does not, at rest it is anywhere between its limits."""
        return self.has_twist and not self.element

    @property
    def dissipates(self) -> bool:
        """Whether it turns energy into heat, or takes it in an impact."""
        return self.is_rigid or any(
            mode.heats or mode.damping or mode.leak or mode.slope for mode in self.modes.values()
        )

    def kind(self, before: int, after: int) -> str:
        """Word for the event that takes it from one mode to another."""
        sliding = [number != self.idle and not self.modes[number].held for number in (before, after)]
        if self.held is not None and sliding[1] and len(self.modes) > 4:
            return "stage" if sliding[0] and before * after > 0 else "slip"
        return self.modes[after].kind

    @property
    def static_ratio(self) -> float:
        """Static over kinetic friction [-]: what it holds, as a part of its capacity."""
        guards = () if self.held is None else self.modes[self.held].guards
        return max((g.capacity for g in guards), default=1.0)

    def sliding(self, slip: float, now: int | None = None) -> int:
        """Mode in which it slides with this slip [rad/s], not zero; the one it is in ``now`` if that is one.

        Raises
        ------
        PowertrainError
            None of its modes allows a slip of this sign.
        """
        edge = EDGE * (1.0 + abs(slip))
        able = {number: mode for number, mode in self.modes.items() if not mode.held and number != self.idle}
        for number in (now, *able):
            # the one that it is in may have come to its end just now
            least = -edge if number == now else 0.0
            if number in able and all(g.slip * slip + g.level > least for g in able[number].guards if g.slip):
                return number
        for number, mode in able.items():
            if all(g.slip * slip + g.level > -edge for g in mode.guards if g.slip):
                return number
        raise PowertrainError(
            f"{self.name}: slip = {slip:g} rad/s, permitted: of the other sign or 0; it would have to hold what slips"
        )

    def starting(self, twist: float) -> tuple[int, float]:
        """Mode and stretch [rad] at rest at a twist [rad].

        Raises
        ------
        PowertrainError
            None of its modes is possible there.
        """
        for number, mode in self.modes.items():
            if mode.held:
                continue
            stretch = 0.0 if mode.origin is None else twist - mode.origin
            torque = mode.stiffness * stretch + mode.torque
            edge = EDGE * (1.0 + abs(twist)) * (1.0 + mode.stiffness)
            if all(
                g.twist * twist + g.stretch * stretch + g.torque * torque + g.level >= -edge
                for g in mode.guards
                if g.twist or g.stretch or g.torque
            ):
                return number, stretch
        raise PowertrainError(f"{self.name}: twist = {twist:g} rad, permitted: within what its modes cover")

    def at(self, twist: float, slip: float) -> tuple[int, float]:
        """Mode and torque [N m] of a law that is memoryless.

        Raises
        ------
        PowertrainError
            None of its modes is possible at this twist, or its guards send it round.

        Examples
        --------
        A clipped shaft does not pull where it leaves the flank faster than it untwists:

        >>> play = clipped("mesh", {"a": 1.0, "b": -1.0}, gap=0.02, stiffness=5e3, damping=10.0)
        >>> [play.at(0.012, slip) for slip in (0.0, -0.5, -2.0)]
        [(1, 10.0), (1, 5.0), (3, 0.0)]
        """
        number, _ = self.starting(twist)
        for _ in range(2 * len(self.modes)):
            mode = self.modes[number]
            stretch = 0.0 if mode.origin is None else twist - mode.origin
            torque = mode.stiffness * stretch + mode.damping * slip + mode.torque
            sums = (g.twist * twist + g.stretch * stretch + g.slip * slip + g.torque * torque for g in mode.guards)
            ends = [g.then for g, value in zip(mode.guards, sums, strict=True) if value + g.level < 0.0]
            if not ends:
                return number, torque
            number = ends[0]
        raise PowertrainError(
            f"{self.name}: at a twist of {twist:g} rad and a slip of {slip:g} rad/s its guards lead from mode to mode, "
            "permitted: to one of them, in a law that is memoryless"
        )


def region_at(regions: Sequence[Region], slips: Sequence[float]) -> Region:
    """The one in which the slips are, or the one that they are least far from."""
    least = [min(sum(a * s for a, s in zip(edge, slips, strict=True)) for edge in region.edges) for region in regions]
    return regions[least.index(max(least))]


def coupled_torques(laws: Sequence[Law], slips: Sequence[float]) -> list[float]:
    """Torques of laws that depend on the slips of all of them.

    Examples
    --------
    >>> product = Region(edges=((1.0, 0.0),), forms=(((0.0, 0.5), (0.5, 0.0)), ((1.0, 0.0), (0.0, 0.0))))
    >>> coupled_torques([Law(name, {name: 1.0}, {}, regions=(product,)) for name in "ab"], [2.0, 3.0])
    [6.0, 4.0]
    """
    region = region_at(laws[0].regions, slips)
    return [
        sum(
            one * value * other
            for one, row in zip(slips, form, strict=True)
            for value, other in zip(row, slips, strict=True)
        )
        for form in region.forms
    ]


def check(law: Law, nodes: Sequence[str]) -> None:
    """Refuse a law that is no complete table: every mode that a guard names is there, and every number one.

    Raises
    ------
    PowertrainError
        A node that is none of the element's, a mode that is not there, two that hold the slip, a part of a capacity that
        there is not, a number that is not finite, or a stiffness or leak < 0.
    """
    for node in law.coefficients:
        if node not in nodes:
            raise PowertrainError(f'{law.name}: acts on "{node}", permitted: nodes of its element: {", ".join(nodes)}')
    modes = ", ".join(map(str, law.modes))
    for number, mode in law.modes.items():
        own = (isfinite(mode.leak) and mode.leak > 0.0) or (mode.follows and mode.origin is None)
        if law.memoryless and (own or mode.held or law.is_clutch):
            raise PowertrainError(
                f'{law.name}: mode {number} ("{mode.name}") holds its slip, takes part of a capacity or has a stretch of '
                "its own, permitted: none of these, in a law that is memoryless"
            )
    if law.idle is not None and law.idle not in law.modes:
        raise PowertrainError(f"{law.name}: idle = {law.idle}, permitted: one of its modes {modes}")
    if law.load is None and len(holding := [mode.name for mode in law.modes.values() if mode.held]) > 1:
        raise PowertrainError(f"{law.name}: modes {', '.join(holding)} hold its slip, permitted: one of them")
    for number, mode in law.modes.items():
        for guard in mode.guards:
            if guard.then not in law.modes or guard.then == number:
                raise PowertrainError(
                    f'{law.name}: after mode {number} ("{mode.name}") comes {guard.then}, permitted: another of {modes}'
                )
        if not law.is_clutch and any((mode.capacity, mode.slope, *(guard.capacity for guard in mode.guards))):
            raise PowertrainError(
                f'{law.name}: mode {number} ("{mode.name}") takes part of a capacity, permitted: with max_torque, the '
                "capacity where no input is given"
            )
        is_positive = all(value >= 0.0 for value in (mode.stiffness, mode.leak, mode.stored))
        sizes = map(abs, (*mode[4:9], mode.origin or 0.0, *(value for guard in mode.guards for value in guard)))
        if not (is_positive and isfinite(sum(sizes) + mode.stored)):
            raise PowertrainError(
                f"{law.name}: in {mode}, permitted: finite numbers, of stiffness, leak and stored >= 0 (a leak may be inf)"
            )


def friction(
    name: str,
    coefficients: dict[str, float],
    max_torque: float,
    static_ratio: float = 1.0,
    over_slip: Sequence[tuple[float, float]] = ((0.0, 1.0),),
) -> Law:
    """Dry friction, of a clutch or brake: it slides with its capacity against the slip, or sticks up to its static limit.

    Parameters
    ----------
    name : str
    coefficients : mapping
        Node to coefficient of the slip.
    max_torque, static_ratio : float
        Capacity [N m] where no input is given; static over kinetic friction [-].
    over_slip : sequence of (float, float)
        Points (magnitude of slip [rad/s], factor of the capacity), from slip 0 on; the last factor stays.

    Examples
    --------
    >>> law = friction("clutch", {"a": 1.0, "b": -1.0}, max_torque=300.0)
    >>> [mode.name for mode in law.modes.values()], law.sliding(-2.0)
    (['forward', 'stuck', 'backward', 'free'], -1)
    """
    lines: list[tuple[float, float | None, float, float]] = [
        (s0, s1, f0, (f1 - f0) / (s1 - s0)) for (s0, f0), (s1, f1) in pairwise(over_slip)
    ]
    lines.append((over_slip[-1][0], None, over_slip[-1][1], 0.0))
    modes = {
        FORWARD: _sliding(1, 0, lines),
        STUCK: Mode(
            "stuck",
            (
                Guard(FORWARD, torque=-1.0, capacity=static_ratio),
                Guard(BACKWARD, torque=1.0, capacity=static_ratio),
            ),
            kind="lock",
            held=True,
        ),
        BACKWARD: _sliding(-1, 0, lines),
        FREE: Mode("free", kind="release"),
    }
    for line in range(1, len(lines)):
        modes |= {side * (FREE + line): _sliding(side, line, lines) for side in (1, -1)}
    return Law(name, coefficients, modes, max_torque, idle=FREE)


def _sliding(side: int, line: int, lines: Sequence[tuple[float, float | None, float, float]]) -> Mode:
    """Sliding to one side on one of the lines (slip from, to, factor there, slope) of the friction over slip."""
    first, last, factor, slope = lines[line]
    numbers = [side, *(side * (FREE + i) for i in range(1, len(lines)))]
    guards = [Guard(numbers[line - 1] if line else STUCK, slip=float(side), level=-first)]
    if last is not None:
        guards.append(Guard(numbers[line + 1], slip=-float(side), level=last))
    word, kind = "forward" if side > 0 else "backward", "stage" if line else "slip"
    return Mode(word, tuple(guards), kind, capacity=side * (factor - slope * first), slope=slope, heats=True)


def dog(name: str, coefficients: dict[str, float]) -> Law:
    """Dog clutch: holds whatever slip there is at zero while it is engaged.

    Examples
    --------
    >>> dog("second", {"shaft": 1.0, "gear": -1.0}).input
    'second_engaged'
    """
    modes = {STUCK: Mode("engaged", kind="lock", held=True), FREE: Mode("open", kind="release")}
    return Law(name, coefficients, modes, 1.0, idle=FREE, signal="engaged")


def one_way(name: str, coefficients: dict[str, float]) -> Law:
    """One-way clutch: holds the slip at zero while it carries a torque >= 0, and lets it become negative.

    Examples
    --------
    >>> law = one_way("freewheel", {"starter": 1.0, "engine": -1.0})
    >>> law.sliding(-3.0), law.modes[0].held
    (1, True)
    """
    modes = {
        0: Mode("driving", (Guard(1, torque=1.0),), kind="lock", held=True),
        1: Mode("overrunning", (Guard(0, slip=-1.0),), kind="release"),
    }
    return Law(name, coefficients, modes)


def nordin(name: str, coefficients: dict[str, float], gap: float, stiffness: float, damping: float) -> Law:
    """Play in series with a shaft whose own twist relaxes in the open gap.

    Nordin, Galic, Gutman: New models for backlash and gear play, Int. J. Adapt. Control Signal Process. 11 (1997) 49-63.
    In contact ``tau = k y + d s`` until it would pull; in the gap ``y' = -(k / d) y`` until twist less y reaches a flank.

    Examples
    --------
    >>> law = nordin("mesh", {"a": 1.0, "b": -1.0}, gap=0.02, stiffness=5e3, damping=10.0)
    >>> [(law.modes[number].name, round(y, 9)) for number, y in map(law.starting, (0.0, 0.015, -0.011))]
    [('gap', 0.0), ('right', 0.005), ('left', -0.001)]
    """
    half = 0.5 * gap
    leak = stiffness / damping if damping else float("inf")
    modes = {
        0: Mode(
            "gap",
            (Guard(1, twist=-1.0, stretch=1.0, level=half), Guard(2, twist=1.0, stretch=-1.0, level=half)),
            kind="open",
            leak=leak,
            stored=stiffness,
        ),
        1: _contact("right", (Guard(0, torque=1.0),), stiffness, damping, half),
        2: _contact("left", (Guard(0, torque=-1.0),), stiffness, damping, -half),
    }
    return Law(name, coefficients, modes)


def clipped(name: str, coefficients: dict[str, float], gap: float, stiffness: float, damping: float) -> Law:
    """Play in series with a shaft that never pulls: ``tau = k y + d s`` or 0, y the twist beyond the flank.

    As ``ElastoBacklash2`` of the Modelica Standard Library 4.0: the shaft forgets what it was twisted by.

    Examples
    --------
    >>> law = clipped("mesh", {"a": 1.0, "b": -1.0}, gap=0.02, stiffness=5e3, damping=10.0)
    >>> [mode.name for mode in law.modes.values()]
    ['gap', 'right', 'left', 'right, off', 'left, off']
    """
    half = 0.5 * gap
    forgetting = Mode("", kind="open", leak=float("inf"), stored=stiffness)

    def off(side: float, contact: int) -> tuple[Guard, ...]:
        pushes = Guard(contact, twist=-side * stiffness, slip=-side * damping, level=stiffness * half)
        return (Guard(0, twist=side, level=-half), pushes)

    modes = {
        0: forgetting._replace(name="gap", guards=(Guard(1, twist=-1.0, level=half), Guard(2, twist=1.0, level=half))),
        1: _contact("right", (Guard(3, torque=1.0),), stiffness, damping, half),
        2: _contact("left", (Guard(4, torque=-1.0),), stiffness, damping, -half),
        3: forgetting._replace(name="right, off", guards=off(1.0, 1)),
        4: forgetting._replace(name="left, off", guards=off(-1.0, 2)),
    }
    return Law(name, coefficients, modes, memoryless=True)


def _contact(name: str, guards: tuple[Guard, ...], stiffness: float, damping: float, flank: float) -> Mode:
    return Mode(
        name, guards, "contact", stiffness=stiffness, damping=damping, follows=True, origin=flank, stored=stiffness
    )
