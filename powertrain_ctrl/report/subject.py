"""The driveline of a report, what several of its sections need, and what a section is made of."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from matplotlib.figure import Figure

from .. import examples
from ..base.errors import PowertrainError, TopologyError
from ..base.tables import text_table
from ..driveline.collection import Driveline
from ..driveline.ends import Ends, ends
from ..linear.assembly import assemble
from ..linear.modal import Modes, modes
from ..reduction.condensed import two_mass
from ..reduction.twomass import TwoMass
from ..sampled.plant import SampledPlant

# Responses of larger drivelines take minutes; their modes do not.
RESPONSE_LIMIT = 200
# Torque of the engine [N m] and speed [m/s] about which a driveline with laws is linear here.
LOAD, ROAD_SPEED = 100.0, 20.0


@dataclass(frozen=True)
class Table:
    """Headers and rows of text under a caption; ``is_frequency`` tables are printed by the command line."""

    caption: str
    headers: Sequence[str]
    rows: Sequence[Sequence[str]]
    is_frequency: bool = False

    @property
    def text(self) -> str:
        return text_table(self.headers, self.rows)


@dataclass(frozen=True)
class Picture:
    """A matplotlib figure, the name of its files and what it shows."""

    name: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Section:
    """Title, paragraphs, a listing of fixed-width text, tables and pictures."""

    title: str
    text: Sequence[str] = ()
    listing: str = ""
    tables: Sequence[Table] = ()
    pictures: Sequence[Picture] = ()


def subject_of(car: Driveline, name: str, plant: SampledPlant | None = None) -> "Subject":
    """Subject of a report, with what drives it if that is known.

    Of a driveline with play, stages or other laws it is small motion while the engine drives.
    """
    if all(law.is_clutch for element in car for law in element.laws):
        return Subject(car, name, plant=plant)
    found = ends(car)
    speed = {found.vehicle: ROAD_SPEED} if found.vehicle in car.translating else None
    linear = car.at(torques={f"{found.engine}_torque": LOAD}, speed=speed)
    about = f"under {LOAD:g} N m" + (f" at {ROAD_SPEED:g} m/s" if speed else "")
    return Subject(linear, name, car, about, plant)


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
    """Figure of this size [in] that pyplot does not know."""
    return Figure(figsize=(width, height), layout="constrained")
