"""A controller or a control unit as C99 source."""

from __future__ import annotations

import control
import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..sampled.unit import ControlUnit
from .c_unit import in_comment, literal, unit_source


@checked
def c_source(controller: control.StateSpace | ControlUnit, name: str = "anti_jerk", precision: str = "double") -> str:
    """C99 source of a linear controller or of a whole control unit: no heap, no library, one call per sample.

    Of a controller ``void NAME_reset(NAME_state *s)`` starts it, ``void NAME_step(NAME_state *s, const REAL u[], REAL y[])``
    takes the inputs and gives the outputs of one sample, both in the order of the system's labels, which are in a comment.

    Of a unit ``void NAME_start(NAME_state *s, REAL torque)`` starts it, ``REAL NAME_step(NAME_state *s, REAL torque_demand,
    REAL engine_speed, REAL wheels_speed, REAL ratio, REAL torque_compensation)`` gives the command as its ``step`` does:
    gears that engage and let go without a bump, limits, rate. Its numbers are in one ``static const`` struct, with units.

    Parameters
    ----------
    controller : control.StateSpace or ControlUnit
        Discrete; linear too are the controllers of the unit.
    name : str
        Prefix of the C names; an identifier.
    precision : {"double", "float"}
        Type of all numbers, REAL above.

    Returns
    -------
    str

    Raises
    ------
    PowertrainError
        A controller that is not linear and discrete or not finite, a name that is no identifier, another precision.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> source = pt.antijerk.c_source(pt.antijerk.speed_difference(plant))
    >>> "void anti_jerk_step(anti_jerk_state *s, const double u[2], double y[1])" in source
    True
    """
    if not name.isidentifier() or not name.isascii():
        raise PowertrainError(f"name = {name!r}, permitted: a C identifier")
    if precision not in ("double", "float"):
        raise PowertrainError(f'precision = {precision!r}, permitted: "double", "float"')
    if isinstance(controller, ControlUnit):
        gears = {ratio: _linear(system, precision) for ratio, system in controller.by_ratio}
        return unit_source(controller, gears, name, precision)
    _linear(controller, precision)
    n, m, p = controller.nstates, controller.ninputs, controller.noutputs
    rows = _rows("next", controller.A, controller.B, precision)
    outputs = _rows("y", controller.C, controller.D, precision)
    lines = [
        f"/* {name}: {n} states, sample time {float(controller.dt)!r} s",
        f"   inputs u: {in_comment(controller.input_labels)}",
        f"   outputs y: {in_comment(controller.output_labels)} */",
        f"typedef struct {{ {precision} x[{max(n, 1)}]; }} {name}_state;",
        "",
        f"void {name}_reset({name}_state *s)",
        "{",
        f"    for (int i = 0; i < {max(n, 1)}; ++i) s->x[i] = 0;",
        "}",
        "",
        f"void {name}_step({name}_state *s, const {precision} u[{m}], {precision} y[{p}])",
        "{",
        f"    const {precision} *x = s->x;",
        *outputs,
    ]
    if n:
        lines += [f"    {precision} next[{n}];", *rows, f"    for (int i = 0; i < {n}; ++i) s->x[i] = next[i];"]
    else:
        lines.append("    (void)x;")
    if not (controller.B.any() or controller.D.any()):
        lines.append("    (void)u;")
    return "\n".join([*lines, "}", ""])


def _linear(system: control.NonlinearIOSystem, precision: str) -> control.StateSpace:
    """The system, if it is one that C can have."""
    if not isinstance(system, control.StateSpace) or not system.isdtime(strict=True):
        raise PowertrainError(
            "only a linear discrete-time system can be exported to C; limits, a rate and a schedule over gears are for a "
            "ControlUnit to have"
        )
    kind = np.float64 if precision == "double" else np.float32
    with np.errstate(over="ignore"):
        kept = [np.asarray(M, dtype=float).astype(kind) for M in (system.A, system.B, system.C, system.D)]
    if not all(np.isfinite(M).all() for M in kept):
        raise PowertrainError(f"the controller has coefficients that are not finite in {precision} precision")
    return system


def _rows(target: str, on_state: np.ndarray, on_input: np.ndarray, precision: str) -> list[str]:
    lines = []
    for i, (state_row, input_row) in enumerate(zip(on_state, on_input, strict=True)):
        terms = [f"({literal(value, precision)}) * x[{j}]" for j, value in enumerate(state_row) if value]
        terms += [f"({literal(value, precision)}) * u[{j}]" for j, value in enumerate(input_row) if value]
        lines.append(f"    {target}[{i}] = {' + '.join(terms) or '0'};")
    return lines
