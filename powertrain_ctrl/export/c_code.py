"""A controller as C99 source."""

from __future__ import annotations

from collections.abc import Iterable

import control
import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError


@checked
def c_source(controller: control.StateSpace, name: str = "anti_jerk", precision: str = "double") -> str:
    """C99 source of a discrete-time linear controller: no heap, no library, one call per sample.

    ``void NAME_reset(NAME_state *s)`` starts it, ``void NAME_step(NAME_state *s, const REAL u[], REAL y[])`` takes the
    inputs and gives the outputs of one sample, both in the order of the system's labels, which are in a comment.

    Parameters
    ----------
    controller : control.StateSpace
        Discrete.
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
    if not isinstance(controller, control.StateSpace) or not controller.isdtime(strict=True):
        raise PowertrainError("only a linear discrete-time system can be exported to C")
    if not name.isidentifier() or not name.isascii():
        raise PowertrainError(f"name = {name!r}, permitted: a C identifier")
    if precision not in ("double", "float"):
        raise PowertrainError(f'precision = {precision!r}, permitted: "double", "float"')
    matrices = controller.A, controller.B, controller.C, controller.D
    with np.errstate(over="ignore"):
        kept = [
            np.asarray(M, dtype=float).astype(np.float64 if precision == "double" else np.float32) for M in matrices
        ]
    if not all(np.isfinite(M).all() for M in kept):
        raise PowertrainError(f"the controller has coefficients that are not finite in {precision} precision")
    n, m, p = controller.nstates, controller.ninputs, controller.noutputs
    suffix = "" if precision == "double" else "f"
    rows = _rows("next", controller.A, controller.B, suffix)
    outputs = _rows("y", controller.C, controller.D, suffix)
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


def in_comment(labels: Iterable[str]) -> str:
    """Labels in one line from which no comment ends."""
    return " ".join(", ".join(labels).split()).replace("*/", "* /")


def _rows(target: str, on_state: np.ndarray, on_input: np.ndarray, suffix: str) -> list[str]:
    lines = []
    for i, (state_row, input_row) in enumerate(zip(on_state, on_input, strict=True)):
        terms = [f"{_literal(value, suffix)} * x[{j}]" for j, value in enumerate(state_row) if value]
        terms += [f"{_literal(value, suffix)} * u[{j}]" for j, value in enumerate(input_row) if value]
        lines.append(f"    {target}[{i}] = {' + '.join(terms) or '0'};")
    return lines


def _literal(value: float, suffix: str) -> str:
    return f"({float(value)!r}{suffix})"
