"""What a manoeuvre with clutches is made of: the signals that drive it and the steady motion that it starts from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..base.errors import PowertrainError, TopologyError
from ..driveline.collection import Driveline
from ..driveline.ends import driven
from ..linear.assembly import assemble
from .model import plants_of
from .response import State
from .signals import PiecewiseLinear
from .starts import final_state, started

# What is opened or closed takes this long [s].
SWITCHED = 0.05


@dataclass(frozen=True, eq=False)
class Plan:
    """Signals by the names of their inputs, a state to start from, the driving node and its torque there [N m]."""

    inputs: Mapping[str, PiecewiseLinear]
    state: State
    driving: str
    torque: float


def course(*points: tuple[float, float]) -> PiecewiseLinear:
    """Signal through (time, value), one after the other."""
    times, values = zip(*points, strict=True)
    return PiecewiseLinear(tuple(map(float, times)), tuple(map(float, values)))


def capacities_as_set(car: Driveline) -> dict[str, PiecewiseLinear]:
    """Of each clutch by its input: all that it has where it is locked, none where it is released."""
    plants = plants_of(car)
    clutches = plants.slipping.clutches
    return {
        law.input: course((0.0, 0.0 if law.name in car.released else plants.capacity[law.input])) for law in clutches
    }


def capacity_of(car: Driveline, clutch: str, least: float) -> float:
    """The capacity of a clutch [N m]; less than what it is to carry is an error."""
    capacity = next(law.max_torque for law in car[clutch].laws if law.is_clutch) or 0.0
    if capacity < least:
        raise PowertrainError(f"{clutch}: max_torque = {capacity:g} N m, permitted for this torque: >= {least:g} N m")
    return capacity


def steady(car: Driveline, driving: str, torque: float, speed: float) -> State:
    """Steady motion of a car, its clutches as they are, under the torque of a node that turns with this speed.

    What is not connected with that node is at rest.
    """
    part = car.part(driving)
    moving = {node: speed * motion for node, motion in turning(part, driving).items() if node in part.nodes}
    plants = plants_of(car, as_set=True)
    at_rest = dict.fromkeys(plants.model.nodes, 0.0)
    found = final_state(started(plants, 0.0, at_rest | moving, None, {f"{driving}_torque": torque}), plants)
    return State(0.0, found.twist, found.speed, {})


def turning(part: Driveline, node: str) -> dict[str, float]:
    """Motion of every node of a connected part as one body with this node turning by 1."""
    model = assemble(driven(part))
    motion = model.rigid_motion / model.rigid_motion[model.nodes.index(node)]
    return dict(zip(model.nodes, motion.tolist(), strict=True))


def inertia_at(part: Driveline, node: str) -> float:
    """Inertia of a connected part at the speed of one of its nodes [kg m^2]."""
    motion = np.array(list(turning(part, node).values()))
    return float(motion @ assemble(driven(part)).J @ motion)


def ends_of_clutch(car: Driveline, clutch: str, beside: str) -> tuple[str, str]:
    """The node of a clutch on the side of a node, and the one on the other side; ``car`` has it released."""
    nodes, near = car[clutch].nodes, set(car.part(beside).nodes)
    sides = [node for node in nodes if node in near]
    if len(nodes) != 2 or len(sides) != 1:
        raise TopologyError(f'{clutch}: permitted: a clutch between two shafts, one of them on the side of "{beside}"')
    return sides[0], next(node for node in nodes if node != sides[0])
