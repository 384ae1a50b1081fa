"""The kernel in C99: sizes and tables of a car in front of the text that is the same for all cars."""

from __future__ import annotations

from functools import cache
from importlib import resources

import numpy as np

from ..elements import laws
from ..hybrid import matrices, motion, run, trace
from .c_unit import in_comment
from .kernel import Kernel

# Texts of the kernel, each standing on those before it.
KERNEL = ("algebra", "build", "patterns", "motion", "margins", "events", "stepping", "plant")
# Tables of whole numbers.
WHOLE = {"CURVED", "IS_STATE", "ZERO_PERMITTED", "ELASTIC", "CARRIED"}
SHAPES = {
    "NO_CAPACITY": "ZL",
    "CURVED": "ZL",
    "IS_STATE": "ZO",
    "IMPOSING": "NM][NX",
    "MOVING": "NM][NX",
    "START": "NZ",
    "PARAMETERS": "NP",
    "ZERO_PERMITTED": "NP",
    "MASS_0": "NN][NN",
    "MASS_BY": "NP][NN][NN",
    "STIFFNESS_0": "ZK",
    "STIFFNESS_BY": "NP][ZK",
    "DAMPING_0": "ZK",
    "DAMPING_BY": "NP][ZK",
    "TWIST": "ZK][ZR",
    "COMPLIANCE": "ZK][NN",
    "ELASTIC": "ZR",
    "LOAD": "NU][NN",
    "SLIP": "ZL][NN",
    "ON_TWIST": "ZO][ZR",
    "ON_SPEED": "ZO][NN",
    "ON_ACCELERATION": "ZO][NN",
    "ON_TORQUE": "ZO][ZL",
    "ON_LOAD": "ZO][NU",
    "CARRIED": "ZO",
    "SPEED_0": "NN",
}


@cache
def text(name: str) -> str:
    """One of the texts of the package."""
    return (resources.files(__package__) / "c" / f"{name}.c").read_text(encoding="utf-8")


def source(data: Kernel, name: str) -> str:
    """C99 source of a car."""
    parts = [_heading(data, name), _sizes(data), text("types"), _laws(data), _numbers(data), *map(text, KERNEL)]
    return "\n".join(part.replace("@NAME@", name) for part in parts)


def _heading(data: Kernel, name: str) -> str:
    parameters = [each.name for each in data.parameters]
    lines = [
        f"/* {name}: exact plant with steps of {data.dt!r} s, {data.sizes['NX']} states in energy coordinates.",
        "",
        f"   static {name}_plant plant;            all of its memory, no heap",
        f"   int {name}_init(&plant, parameters)   to the start; 0 instead of parameters takes those of the export",
        f"   int {name}_step(&plant, u0, u1)       dt further, inputs straight from u0 to u1; the same twice holds them",
        f"   int {name}_outputs(&plant, u, y)      outputs now, with these inputs",
        f"   const char *{name}_message(status)    what a status that is not 0 means",
        "",
        f"   inputs u[{data.sizes['NV']}]: {in_comment(data.inputs)}",
        f"   outputs y[{data.sizes['NY']}]: {in_comment(data.outputs)}",
    ]
    if parameters:
        lines.append(f"   parameters[{len(parameters)}]: {in_comment(parameters)}")
    return "\n".join(lines) + " */\n"


def _sizes(data: Kernel) -> str:
    sizes = data.sizes
    whole = [f"{key} = {value}" for key, value in sizes.items() if key != "NP"]
    # no array is of size 0, and compilers see pairs of laws
    whole.append(f"ZL = {max(sizes['NL'], 2)}")
    least = {"ZM": "NM", "ZE": "NE", "ZO": "NO"}
    least |= {"ZK": "NK", "ZR": "NR"} if sizes["NP"] else {}
    whole += [f"{key} = {max(sizes[of], 1)}" for key, of in least.items()]
    whole += [f"ZG = {max(sizes['MOST_GUARDS'], 2)}", "NZ = NX + NE", f"NW = {max(sizes['NX'], sizes['NL'])}"]
    whole += [
        f"PATTERNS = {16 if sizes['NL'] else 1}",
        f"PROPAGATORS = {8 if sizes['NL'] else 1}",
        "MOST_DOUBLINGS = 60",
    ]
    whole = [each for each in whole if not each.startswith("NM ")]
    constants = {
        "DT": data.dt,
        "EPSILON": float(np.finfo(float).eps),
        "ROUNDING": float(matrices.ROUNDING),
        "REDUNDANT": matrices.REDUNDANT,
        "INDIFFERENT": motion.INDIFFERENT,
        "LENIENT": motion.LENIENT,
        "TICK": motion.TICK,
        "LONGEST_DOUBT": motion.LONGEST_DOUBT,
        "FIRST_STEP": motion.FIRST_STEP,
        "SAME_TIME": motion.SAME_TIME,
        "ZERO_SLIP": run.ZERO_SLIP,
        "KNOWN_SLIP": run.KNOWN_SLIP,
        "WITHIN": run.WITHIN,
        "EDGE": laws.EDGE,
        "SAFE": trace.SAFE,
    }
    lines = [
        "#include <math.h>",
        "#include <string.h>",
        "",
        f"#define NP {sizes['NP']}",
        f"#define NM {sizes['NM']}",
        f"enum {{ {', '.join(whole)}, MOST_EVENTS = {run.MOST_EVENTS} }};",
        "#define MOST_LOOKS 1000000L",
        "enum { OK, NOT_FINITE, NEGATIVE, NO_MODES, NO_SLIDING, NO_END, BAD_PARAMETERS };",
    ]
    lines += [f"static const double {key} = {float(value)!r};" for key, value in constants.items()]
    return "\n".join(lines) + "\n"


def _laws(data: Kernel) -> str:
    lines = []
    for kind, size, rows in (("law", "ZL", data.laws), ("mode", "", data.modes), ("guard", "", data.guards)):
        written = [f"{{{', '.join(map(_literal, row))}}}" for row in rows] or ["{0}"]
        lines.append(f"static const {kind} {kind.upper()}S[{size}] = {{\n    {f',{chr(10)}    '.join(written)}}};")
    return "\n".join(lines) + "\n"


def _literal(value: float) -> str:
    return repr(value) if isinstance(value, int) else repr(float(value))


def _numbers(data: Kernel) -> str:
    lines = []
    if not data.parameters:
        fields = (_braces(data.tables[f"BASE_{field}"]) for field in ("A", "B", "G", "W", "OUT"))
        lines.append(f"static const matrices MATRICES = {{{', '.join(fields)}}};")
    for key, values in data.tables.items():
        if key in SHAPES:
            kind = "int" if key in WHOLE else "double"
            lines.append(f"static const {kind} {key}[{SHAPES[key]}] = {_braces(values, key in WHOLE)};")
    return "\n".join(lines) + "\n"


def _braces(values: np.ndarray, whole: bool = False) -> str:
    if values.ndim == 0:
        return repr(int(values)) if whole else repr(float(values))
    if not values.size:
        return "{" * values.ndim + "0" + "}" * values.ndim
    inner = [_braces(value, whole) for value in values]
    between = ",\n  " if values.ndim > 1 else ", "
    return f"{{{between.join(inner)}}}"
