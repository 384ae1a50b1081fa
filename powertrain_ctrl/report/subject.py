"""The driveline of a report, what several of its sections need, and what a section is made of.

Nothing here loads matplotlib or python-control before a figure is drawn, so that the frequency tables come at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

from .. import examples
from ..base.errors import PowertrainError, TopologyError
from ..base.tables import text_table
from ..driveline.collection import Driveline
from ..driveline.ends import Ends, ends
from ..driveline.operating import operating_point
from ..elements import TorqueConverter
from ..linear.assembly import assemble
from ..linear.modal import Modes, modes
from ..reduction.condensed import two_mass
from ..reduction.twomass import TwoMass

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..sampled.plant import SampledPlant

# Figures are at least as wide as the text beside them [in], so that a page has one width.
COLUMN = 7.4
# Responses of larger drivelines take minutes; their modes do not.
RESPONSE_LIMIT = 200
# Torque of the engine [N m] and speed of the vehicle [m/s], or of the engine where none has a mass [rad/s], about which a
# driveline with laws is linear here.
LOAD, ROAD_SPEED, SPEED = 100.0, 20.0, 200.0
# Above this speed [rad/s] no pump of a torque converter is sought that takes the load.
FASTEST = 1e4


@dataclass(frozen=True)
class Table:
    """Headers and rows of text under a caption and above a note; the text of a report calls it ``@name``.

    ``is_frequency`` tables are printed by the command line; those of one ``topic`` stand under a heading.
    """

    caption: str
    headers: Sequence[str]
    rows: Sequence[Sequence[str]]
    is_frequency: bool = False
    note: str = ""
    topic: str = ""
    name: str = ""

    @property
    def text(self) -> str:
        return text_table(self.headers, self.rows) + (f"\n{self.note}" if self.note else "")


@dataclass(frozen=True)
class Picture:
    """A matplotlib figure, the name of its files, by which the text calls it ``@name``, and what it shows."""

    name: str
    caption: str
    figure: Figure
    topic: str = ""


Shown = TypeVar("Shown", Table, Picture)


def under(topic: str, items: Iterable[Shown]) -> list[Shown]:
    """Tables or pictures under a heading."""
    return [replace(item, topic=topic) for item in items]


@dataclass(frozen=True)
class Finding:
    """A number for the verdict, its unit with it, and what it is; findings of a lower rank say more."""

    value: str
    what: str
    rank: int


@dataclass(frozen=True)
class Section:
    """Title, paragraphs, definitions that are folded away, tables and pictures; what of it belongs in the verdict."""

    title: str
    text: Sequence[str] = ()
    definitions: Sequence[str] = ()
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()
    findings: Sequence[Finding] = ()
    highlight: Picture | None = None


def subject_of(car: Driveline, name: str, plant: SampledPlant | None = None) -> Subject:
    """Subject of a report, with what drives it if that is known.

    Of a driveline with play, stages or other laws it is small motion while the engine drives.
    """
    if all(law.is_clutch for element in car for law in element.laws):
        return Subject(car, name, plant=plant)
    found = ends(car)
    speed = {found.engine: SPEED} if found.vehicle is None else {found.vehicle: ROAD_SPEED}
    linear = car.at(torques={f"{found.engine}_torque": LOAD}, speed=speed | _pumps(car, speed))
    about = f"under {LOAD:g} N m at " + (f"{SPEED:g} rad/s" if found.vehicle is None else f"{ROAD_SPEED:g} m/s")
    return Subject(linear, name, car, about, plant)


def _pumps(car: Driveline, speed: dict[str, float]) -> dict[str, float]:
    """Speeds of the pumps of torque converters that slip under the load, by node."""
    converters = [element for element in car if isinstance(element, TorqueConverter)]
    if not converters:
        return {}
    from scipy.optimize import brentq

    known = operating_point(car.elements, car.nodes, car.released, None, None, speed).speed
    found = {}
    for converter in converters:
        turbine = known.get(converter.b, 0.0)
        if converter.a not in known and converter.torques(FASTEST, turbine)[0] > LOAD:

            def excess(pump: float, c: TorqueConverter = converter, turbine: float = turbine) -> float:
                return c.torques(pump, turbine)[0] - LOAD

            found[converter.a] = float(brentq(excess, turbine, FASTEST))
    return found


class Subject:
    """The driveline of a report and what several sections need of it; ``nonlinear`` is it with its laws."""

    def __init__(
        self,
        car: Driveline,
        name: str,
        nonlinear: Driveline | None = None,
        about: str = "",
        plant: SampledPlant | None = None,
    ):
        self.car, self.nonlinear, self.about, self.plant = car, nonlinear, about, plant
        self.name = name
        # The printed tables know no damping, so any set will do.
        sets = [known for known in examples.DAMPING if car.lock() == examples.conventional(damping=known)]
        self.is_source = bool(sets)
        self.damping = sets[0] if sets else None
        self.closed = car.lock()
        # The source's control models have one damping for each state of the clutch.
        self.open = (examples.conventional(damping="open") if self.is_source else car).release()

    @cached_property
    def as_given(self) -> Modes:
        return modes(self.car)

    @cached_property
    def closed_modes(self) -> Modes:
        return self.as_given if not self.car.released else modes(self.closed)

    @cached_property
    def open_parts(self) -> list[tuple[Driveline, Modes]]:
        """Parts with an elastic mode when every clutch is open."""
        parts = [self.open.part(next(iter(nodes))) for nodes in self.open.parts()]
        return [(part, result) for part in parts if len(result := modes(part)) > result.n_rigid]

    @cached_property
    def ends(self) -> Ends:
        return ends(self.car)

    @property
    def driving(self) -> str:
        return self.ends.engine

    @property
    def wheels(self) -> str | None:
        return next(iter(self.ends.wheels), "wheel" if "wheel" in self.car.nodes else None)

    @property
    def vehicle(self) -> str | None:
        return self.ends.vehicle or ("vehicle" if "vehicle" in self.car.nodes else None)

    @property
    def unit(self) -> str:
        return "m/s²" if self.vehicle in self.car.translating else "rad/s²"

    @cached_property
    def ratio(self) -> float | None:
        """Driving speed over wheel speed when everything turns as one body."""
        if self.wheels is None:
            return None
        model = assemble(self.responding)
        motion = dict(zip(model.nodes, model.rigid_motion.tolist(), strict=True))
        return Ends(self.responding, (self.wheels,)).ratio(motion)

    @cached_property
    def control_model(self) -> TwoMass:
        return two_mass(self.responding, method="source")

    @cached_property
    def responding(self) -> Driveline:
        """The driveline whose responses are shown: clutches closed where that can be, else as in the file."""
        try:
            self.closed_modes  # noqa: B018
        except TopologyError:
            return self.car
        return self.closed

    @cached_property
    def compared(self) -> dict[str, Any]:
        """Models to compare by label: the detailed one and, if there is one with the same ends, the control model."""
        models: dict[str, Any] = {"detailed model": self.responding}
        shown = {self.driving, self.vehicle, self.wheels} - {None}
        try:
            if shown <= set(self.control_model.driveline.nodes):
                models["control model"] = self.control_model
        except PowertrainError:
            pass  # the section on the control model says why
        return models

    def why_no_response(self) -> str:
        """Why the responses to driving torque cannot be shown, or nothing."""
        if self.driving in self.car.translating:
            return f'the node "{self.driving}" is not driven by a torque'
        if self.vehicle is None:
            return 'the driveline has no Mass and no node called "vehicle"'
        if len(self.as_given) > RESPONSE_LIMIT:
            return f"the driveline has {len(self.as_given)} modes; responses are shown up to {RESPONSE_LIMIT}"
        if not any({self.driving, self.vehicle} <= part for part in self.responding.parts()):
            return f'"{self.driving}" and "{self.vehicle}" are not connected'
        return ""


def new_figure(width: float, height: float) -> Figure:
    """Figure of this size [in], or as wide as the column, that pyplot does not know."""
    from matplotlib.figure import Figure

    return Figure(figsize=(max(width, COLUMN), height), layout="constrained")
