"""A driveline as a plant in C99, for hardware in the loop: the exact core with its laws, without heap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..base.checks import POSITIVE, Period, checked_number
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..driveline.collection import HasDriveline
from . import c_tables
from .kernel import kernel

# C99 tells names apart by their first 63 characters, of which the longest ending needs 8.
LONGEST_NAME = 50


@checked
def c_plant(
    car: HasDriveline,
    dt: Period = 0.001,
    name: str = "driveline",
    initial_speed: Mapping[str, Any] | None = None,
    parameters: Sequence[str] = (),
) -> str:
    """C99 source of a driveline with its laws: exact steps, events within a step located, no heap.

    It is `nonlinear_system` in C, sample by sample: ``NAME_init(&plant, parameters)`` goes to the start,
    ``NAME_step(&plant, u0, u1)`` one step further with inputs that are straight lines from u0 to u1 (the same twice holds
    them), ``NAME_outputs(&plant, u, y)`` gives the outputs. Inputs and outputs are those of `nonlinear_system` in its order;
    the heading of the source lists them. Functions return 0 or a status that ``NAME_message(status)`` explains; after
    another status the plant is as it was. All memory is in one static ``NAME_plant``.

    Parameters
    ----------
    car : Driveline or TwoMass
        Whether its clutches are locked or released does not matter: the capacity decides.
    dt : float
        Step [s].
    name : str
        Prefix of the C names; an identifier.
    initial_speed : mapping, optional
        Node to speed at the start, as in `simulate`; at rest unless told.
    parameters : sequence of str
        ``"element.value"``, such as ``"vehicle.m"`` or ``"drive_shafts.stiffness"``, that can be given to ``NAME_init``:
        those that act linearly on inertias, stiffnesses and dampers.

    Returns
    -------
    str

    Raises
    ------
    UnknownNameError
        A node or parameter that is not there.
    PowertrainError
        A car that cannot be exported, and why: it switches between two descriptions, is too large, has a torque converter
        or gears with losses, or a parameter does something else; a step that is not > 0 and finite, a name that is no
        identifier.

    Notes
    -----
    The first step in modes that are new tabulates their exact steps, ``dt / 2^k`` by doubling (scaling and squaring); those
    of the last 8 are kept. Every other step without an event costs two products of a matrix and a vector.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> source = pt.export.c_plant(pt.examples.conventional(), dt=0.001)
    >>> "int driveline_step(driveline_plant *s, const double before[], const double after[])" in source
    True
    """
    dt = checked_number("c_plant", "dt", dt, "s", POSITIVE)
    require_c_name(name)
    return c_tables.source(kernel(car, dt, initial_speed, parameters), name)


def require_c_name(name: str) -> None:
    """Refuse what is no identifier in C."""
    if not name.isidentifier() or not name.isascii() or name.startswith("_") or len(name) > LONGEST_NAME:
        raise PowertrainError(f"name = {name!r}, permitted: a C identifier of at most {LONGEST_NAME} characters")
