"""Where a driveline is driven and what it drives: engine, driven part, wheels, vehicle, and the ratio between them."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

from ..base.errors import TopologyError
from ..base.records import Record
from ..elements import Tyre
from .collection import Driveline, HasDriveline
from .kinematics import eliminate

# Torque of the engine [N m] that is sure to close play and small enough to leave springs in their first stage.
DRIVES = 1.0


@dataclass(frozen=True)
class Ends(Record):
    """The ends of a driveline.

    Attributes
    ----------
    car : Driveline
    stated_wheels : tuple of str
        What a control model says of its wheels; without them they are found.
    actuator : str or None
        The node that drives; without it it is found.
    """

    car: Driveline
    stated_wheels: tuple[str, ...] = ()
    actuator: str | None = None

    @cached_property
    def engine(self) -> str:
        """Node that drives: "engine", else the first one, of those that nothing holds at rest."""
        return self.actuator or _driving_node(self.car)

    @cached_property
    def part(self) -> Driveline:
        """Part that carries the vehicle; a driveline in several parts of which none carries one is a `TopologyError`."""
        parts = self.car.parts()
        if len(parts) == 1:
            return self.car
        if self.vehicle is None:
            raise TopologyError(
                "the driveline is in several parts and none carries a vehicle; choose one with car.part(node)"
            )
        return self.car.part(self.vehicle)

    @cached_property
    def driving(self) -> str:
        """Node that drives the part with the vehicle: the engine or, where a clutch is open, the node behind that."""
        nodes = set(self.part.nodes)
        if self.engine in nodes:
            return self.engine
        clutches = [self.car[name].nodes for name in self.car.clutches if name in self.car.released]
        behind = [node for ends in clutches if not set(ends) <= nodes for node in ends if node in nodes]
        return behind[0] if behind else _driving_node(self.part)

    @cached_property
    def driven_tyres(self) -> tuple[Tyre, ...]:
        """Tyres between the driving node and the road, without those of axles that only roll along."""
        tyres = [element for element in self.car if isinstance(element, Tyre)]
        if not tyres:
            return ()
        driven = reached(self.part, self.driving, [tyre.name for tyre in tyres])
        return tuple(tyre for tyre in tyres if tyre.wheel in driven)

    @cached_property
    def wheels(self) -> tuple[str, ...]:
        """Nodes whose mean speed is that of the wheels: "wheels", else the wheels of all tyres that are driven."""
        if self.stated_wheels:
            return self.stated_wheels
        nodes = self.car.nodes if self.vehicle is None else self.part.nodes
        return ("wheels",) if "wheels" in nodes else tuple(tyre.wheel for tyre in self.driven_tyres)

    @cached_property
    def vehicles(self) -> tuple[str, ...]:
        """Nodes that move along the road."""
        return tuple(node for node in self.car.nodes if node in self.car.translating)

    @property
    def vehicle(self) -> str | None:
        """The first of them."""
        return next(iter(self.vehicles), None)

    def at_wheels(self, motion: Mapping[str, float]) -> float:
        """Speed of the wheels in a motion of the nodes."""
        return sum(motion[wheel] for wheel in self.wheels) / len(self.wheels)

    def ratio(self, motion: Mapping[str, float]) -> float:
        """Speed of the driving node over that of the wheels, in a motion as one body."""
        return motion[self.driving] / self.at_wheels(motion)


def ends(car: HasDriveline, actuator: str | None = None) -> Ends:
    """The ends of a driveline or of a control model."""
    wheels = getattr(car, "wheels", None)
    return Ends(car.driveline, () if wheels is None else (wheels,), actuator)


def driven(car: HasDriveline, actuator: str | None = None) -> HasDriveline:
    """A car as it is while the engine drives: itself if it is linear, else about a torque that closes its play."""
    driveline = car.driveline
    if all(law.is_clutch for element in driveline for law in element.laws):
        return car
    found = ends(car, actuator)
    vehicle = found.vehicle
    speed = None if vehicle is None or vehicle not in driveline.translating else {vehicle: 0.0}
    return driveline.at(torques={f"{found.driving}_torque": DRIVES}, speed=speed)


def resting_nodes(car: Driveline) -> frozenset[str]:
    """Nodes that constraints and locked brakes hold at rest, whatever the rest does: a ring, a carrier."""
    rows = [row.coefficients for e in car for row in e.constraints]
    rows += [law.coefficients for e in car for law in e.laws if law.is_clutch and law.name not in car.released]
    if all(len(row) > 1 for row in rows):
        return frozenset()
    expressions = eliminate(sorted(rows, key=len), car.nodes).expressions
    return frozenset(node for node in car.nodes if not expressions[node])


def reached(car: Driveline, node: str, without: Collection[str]) -> set[str]:
    """Nodes connected with a node when these elements, the open clutches and what is held at rest are left out."""
    resting = resting_nodes(car)
    links = [set(e.nodes) - resting for e in car if e.name not in without and e.name not in car.released]
    found: set[str] = set()
    added = {node}
    while added:
        found |= added
        added = set().union(*(link for link in links if link & added)) - found
    return found


def _driving_node(car: Driveline) -> str:
    resting = resting_nodes(car)
    moving = [node for node in car.nodes if node not in resting] or car.nodes
    return "engine" if "engine" in moving else moving[0]
