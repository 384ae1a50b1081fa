"""Parameters of a car that act linearly on its inertias, stiffnesses and dampers, so that they can be changed in C."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..base.errors import PowertrainError, UnknownNameError
from ..driveline.collection import Driveline
from ..linear.assembly import TorsionalModel, assemble_with_laws

# What is linear in a parameter is so to this part.
LINEAR = 1e-9


class Adjustable(NamedTuple):
    """One of them: its name and unit, its value, whether 0 is permitted, and what one unit more of it adds."""

    name: str
    unit: str
    value: float
    zero: bool
    inertia: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray


def adjustable(car: Driveline, names: Sequence[str]) -> list[Adjustable]:
    """The parameters by name, ``"vehicle.m"``.

    Raises
    ------
    UnknownNameError
        An element or a parameter that is not there.
    PowertrainError
        Names given twice, a parameter that does something else, or a car in which something is condensed.
    """
    if len(set(names)) < len(names):
        raise PowertrainError(f"parameters {list(names)}, permitted: each once")
    found = [_adjustable(car, name) for name in names]
    model = assemble_with_laws(car)
    if found and (model.following.names or not (np.diag(model.M) > 0.0).all()):
        condensed = ", ".join(model.following.names)
        raise PowertrainError(
            f'parameters {list(names)}: permitted in a car all of whose nodes have inertia; "{condensed}" has none, give it '
            "an Inertia, or export the car without parameters"
        )
    return found


def _adjustable(car: Driveline, name: str) -> Adjustable:
    element, _, field = str(name).partition(".")
    there = car[element]
    items = {item.name: item for item in dataclasses.fields(there) if "unit" in item.metadata}
    if field not in items or not isinstance(value := getattr(there, field), float):
        known = [f"{element}.{each}" for each in items]
        raise UnknownNameError("parameter", name, known or ["none"], f"one of {element}")
    metadata, is_zero = items[field].metadata, value == 0.0
    step = 1.0 if is_zero else value
    try:
        models = [assemble_with_laws(car.release().replace(element, **{field: value + k * step})) for k in range(3)]
    except PowertrainError as error:
        raise PowertrainError(f"{name} cannot be a parameter in C: {error}") from error
    if not _only_matrices_differ(models):
        raise PowertrainError(
            f"{name} cannot be a parameter in C, permitted: inertias, masses, stiffnesses and dampers that act linearly; a "
            "capacity is an input; export another car for another value"
        )
    first, second, third = models
    parts = []
    for what in ("J", "stiffness", "damping"):
        slope = (getattr(second, what) - getattr(first, what)) / step
        bend = getattr(third, what) - getattr(first, what) - 2.0 * step * slope
        if np.abs(bend).max(initial=0.0) > LINEAR * np.abs(step * slope).max(initial=0.0):
            raise PowertrainError(
                f"{name} cannot be a parameter in C: what it does is not linear in it; export another car for another value"
            )
        parts.append(slope)
    zero = field == "damping" and metadata["permitted"].startswith(">= 0")
    return Adjustable(name, metadata["unit"], value, zero, *parts)


def _only_matrices_differ(models: Sequence[TorsionalModel]) -> bool:
    """Whether motion, laws and names are the same."""
    first = models[0]
    return all(
        model.laws == first.laws
        and model.coordinates == first.coordinates
        and model.compliances == first.compliances
        and np.array_equal(model.T, first.T)
        and np.array_equal(model.S, first.S)
        and np.array_equal(model.E, first.E)
        and np.array_equal(model.elastic_rows, first.elastic_rows)
        for model in models[1:]
    )
