"""A car as numbers for the C kernel: matrices in energy coordinates, laws as tables, names in their order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, isinf, log2
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import PowertrainError
from ..driveline.collection import HasDriveline
from ..elements import Law
from ..hybrid.model import NO_CAPACITY, Plants, output_map, plants_of
from ..hybrid.plant import Plant
from ..hybrid.starts import initial_speeds
from ..linear.assembly import as_driveline
from .adjustable import Adjustable, adjustable

# Tabulated steps dt / 2^k: as many as the fastest motion asks for, and no more than memory is for.
MOST_LEVELS = 16
# States of a car that is not too large for tables of fixed size.
MOST_STATES = 200

Numbers = dict[str, np.ndarray]


class Kernel(NamedTuple):
    """Sizes, constant tables and names; ``tables`` are numbers by their name in C, ``laws`` rows of the structures."""

    sizes: dict[str, int]
    tables: Numbers
    laws: list[tuple]
    modes: list[tuple]
    guards: list[tuple]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    law_names: tuple[str, ...]
    capacities: dict[str, float]
    parameters: tuple[Adjustable, ...]
    translating: frozenset[str]
    dt: float


def kernel(
    car: HasDriveline, dt: float, initial_speed: Mapping[str, Any] | None = None, parameters: Sequence[str] = ()
) -> Kernel:
    """Everything that the C kernel needs to know of a car.

    Raises
    ------
    PowertrainError
        A car that switches between two descriptions, is too large, or has a torque converter or a gear with losses; a
        speed that is not permitted; a parameter that cannot be changed in C.
    """
    plants = plants_of(car)
    if plants.stuck is not plants.slipping:
        raise PowertrainError(
            "a control model that switches cannot be exported as C, permitted: a Driveline or a TwoMass; export its "
            "driveline"
        )
    plant = plants.slipping
    for law in plants.laws:
        if law.regions:
            raise PowertrainError(
                f"{law.owner} is a torque converter, permitted in C: what moves exactly from event to event; leave it out, "
                "with its lock-up clutch in its place"
            )
        if law.load is not None:
            raise PowertrainError(
                f"{law.owner} loses a part of its load, permitted in C: gears with an efficiency of 1"
            )
    if plant.size > MOST_STATES:
        raise PowertrainError(
            f"the car has {plant.size} states, permitted in C: at most {MOST_STATES}; make one body of those on stiff "
            "springs, or export pt.two_mass(car)"
        )
    speed = initial_speeds(plants.model, initial_speed)
    adjusted = adjustable(as_driveline(car), parameters) if parameters else []
    laws, modes, guards = _tables(plants)
    widest = max((len(law.modes) for law in plants.laws), default=1)
    sizes = {
        "NX": plant.N,
        "NE": len(plant.elastic),
        "NU": plant.B.shape[1],
        "NI": len(plants.model.inputs),
        "NC": len(plant.clutches),
        "NM": len(plants.sources),
        "NL": len(plants.laws),
        "NV": len(plants.inputs),
        "NO": len(plants.rows.names),
        "NY": len(plants.outputs),
        "NP": len(adjusted),
        "MOST_GUARDS": sum(max(len(mode.guards) for mode in law.modes.values()) for law in plants.laws),
        "ZMODES": widest,
        "LEVELS": _levels(plant, dt, bool(adjusted)),
    }
    tables = {
        "NO_CAPACITY": np.array([NO_CAPACITY * (law.max_torque or 0.0) for law in plant.clutches]),
        "CURVED": np.array([float(i in plant.curved) for i in range(len(plants.laws))]),
        "IS_STATE": plants.is_state[: sizes["NO"]].astype(float),
    }
    if plant.moved.size:
        lift = np.zeros((plant.N - plant.r - plant.n, plant.moving_rows.shape[1]))
        tables["IMPOSING"] = np.vstack([plant.imposing, lift]).T
        tables["MOVING"] = np.vstack([plant.moving_rows, lift]).T
    if adjusted:
        if plant.moved.size:
            raise PowertrainError("parameters in a car with a SpeedSource are not permitted in C; export it without")
        tables |= _description(plants, adjusted, speed)
        sizes |= {"NN": plant.n, "NR": plant.r, "NK": len(plants.model.compliances)}
    else:
        tables |= {"BASE_A": plant.A, "BASE_B": plant.B, "BASE_G": plant.G.T, "BASE_W": plant.W.T}
        tables["BASE_OUT"] = output_map(plant, plants.acting)
        start = plant.state(np.zeros(plant.r), speed)
        tables["START"] = start
    return Kernel(
        sizes,
        tables,
        laws,
        modes,
        guards,
        plants.inputs,
        plants.outputs,
        plants.names,
        {law.input: float(law.max_torque or 0.0) for law in plant.clutches},
        tuple(adjusted),
        plants.model.translating,
        dt,
    )


def _tables(plants: Plants) -> tuple[list[tuple], list[tuple], list[tuple]]:
    """Rows of the structures law, mode and guard."""
    laws: list[tuple] = []
    modes: list[tuple] = []
    guards: list[tuple] = []
    elastic = {i: e for e, i in enumerate(plants.slipping.elastic)}
    for i, law in enumerate(plants.laws):
        place = {number: index for index, number in enumerate(law.modes)}
        first = len(modes)
        for number, mode in law.modes.items():
            begin = len(guards)
            for g in mode.guards:
                guards.append((place[g.then], g.twist, g.stretch, g.slip, g.torque, g.level, g.capacity))
            leak = -1.0 if isinf(mode.leak) else mode.leak
            origin = 0.0 if mode.origin is None else mode.origin
            modes.append(
                (
                    float(number),
                    *map(int, (mode.held, mode.follows, mode.origin is not None)),
                    *(begin, len(mode.guards)),
                    *(mode.stiffness, mode.damping, mode.torque, mode.capacity, mode.slope, leak, origin),
                )
            )
        held, idle = (-1 if number is None else place[number] for number in (law.held, law.idle))
        unknown = place[plants.unknown[i]]
        flags = int(law.is_clutch), int(law.is_rigid)
        laws.append((first, len(law.modes), *flags, held, idle, unknown, elastic.get(i, -1)))
    return laws, modes, guards


def _levels(plant: Plant, dt: float, adjusted: bool) -> int:
    """How many halvings of dt the fastest motion of any modes asks for."""

    def most(law: Law, i: int) -> float:
        slip, push = np.linalg.norm(plant.G[:, i]), np.linalg.norm(plant.W[:, i])
        capacity = 2.0 * (law.max_torque or 0.0)
        sizes = (
            (abs(mode.damping) + capacity * abs(mode.slope)) * slip * push
            + np.sqrt(mode.stiffness) * (slip + push)
            + (0.0 if isinf(mode.leak) else mode.leak)
            for mode in law.modes.values()
        )
        return float(max(sizes)) + float(slip) * law.has_twist

    fastest = float(np.linalg.norm(plant.A)) + sum(most(law, i) for i, law in enumerate(plant.laws))
    needed = max(0, ceil(log2(max(2.0 * fastest * dt, 1.0)))) + 1
    return min(needed + 2 * adjusted, MOST_LEVELS)


def _description(plants: Plants, adjusted: Sequence[Adjustable], speed: np.ndarray) -> Numbers:
    """What the matrices are made of, for a car all of whose nodes have inertia."""
    model, rows = plants.model, plants.rows
    start = np.array([each.value for each in adjusted])
    mass = np.array([model.T.T @ each.inertia @ model.T for each in adjusted])
    stiffness, damping = (np.array([getattr(each, what) for each in adjusted]) for what in ("stiffness", "damping"))
    carried = np.full(len(rows.names), -1.0)
    for i, name in enumerate(model.compliances):
        carried[rows.names.index(f"{name}_torque")] = i
    return {
        "PARAMETERS": start,
        "ZERO_PERMITTED": np.array([float(each.zero) for each in adjusted]),
        "MASS_0": model.M - np.tensordot(start, mass, 1),
        "MASS_BY": mass,
        "STIFFNESS_0": model.stiffness - start @ stiffness,
        "STIFFNESS_BY": stiffness,
        "DAMPING_0": model.damping - start @ damping,
        "DAMPING_BY": damping,
        "TWIST": model.twist_factor,
        "COMPLIANCE": model.F,
        "ELASTIC": model.elastic_rows.astype(float),
        "LOAD": (model.T.T @ model.B).T,
        "SLIP": model.S[plants.slipping.active] @ model.T,
        "ON_TWIST": rows.twist,
        "ON_SPEED": rows.speed,
        "ON_ACCELERATION": rows.acceleration,
        "ON_TORQUE": rows.friction[:, plants.slipping.active],
        "ON_LOAD": rows.load,
        "CARRIED": carried,
        "SPEED_0": speed,
    }
