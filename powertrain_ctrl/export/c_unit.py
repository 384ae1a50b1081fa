"""A control unit as C99 source."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from string import Template

import control
import numpy as np

from ..sampled.plant import CONTROLLER_INPUTS
from ..sampled.unit import AS_NEAR, ControlUnit

# What the step is called with, but for the state.
SIGNALS = (
    ("torque_demand", "N m"),
    ("engine_speed", "rad/s"),
    ("wheels_speed", "rad/s"),
    ("ratio", "of engine to wheel speed as a gear drives, 0 where none does"),
    ("torque_compensation", "N m, goes past the controller"),
)

SOURCE = Template("""\
/* ${name}: control unit, $shown.
   ${name}_start(&s, torque) once, with the command [N m] before the start; then in every sample ${name}_step(&s, ...) gives
   the command [N m]. Its arguments:
$signals */
#include <math.h>

enum { ${name}_gears = $gears, ${name}_states = $states, ${name}_points = $points };

typedef struct {
    $REAL dt;          /* s, sample time */
    $REAL speed[$points];       /* rad/s, of the engine, at which limits are given */
    $REAL torque_low[$points];  /* N m, smallest command there */
    $REAL torque_high[$points]; /* N m, largest command there */
    $REAL rise;        /* N m/s, fastest rise of the command */
    $REAL fall;        /* N m/s, fastest fall of the command */
    $REAL forget;      /* -, what is left of a bump a sample later */
    $REAL as_near;     /* -, share of a ratio by which two gears are equally near */
    $REAL ratio[$rows];    /* -, engine over wheel speed of each gear */
    /* each gear: next x = A x + B u, torque [N m] = C x + D u;
       u: $inputs */
    $REAL A[$rows][$states][$states];
    $REAL B[$rows][$states][$width];
    $REAL C[$rows][$states];
    $REAL D[$rows][$width];
    $REAL begin[$rows][$states][$width]; /* x = begin u as a gear engages */
} ${name}_parameters;

typedef struct {
    $REAL x[$states];
    $REAL base[4];  /* N m, rad/s, rad/s, N m: what u is counted from */
    $REAL bump;     /* N m */
    $REAL limited;  /* N m, last command */
    $REAL net;      /* N m, last command without what compensates */
    int gear;        /* whose controller works, -1: none */
} ${name}_state;

void ${name}_start(${name}_state *s, $REAL torque);
$REAL ${name}_step(${name}_state *s,
    $arguments);

static const ${name}_parameters ${name}_values = {
$values
};

static $REAL ${name}_within($REAL value, $REAL low, $REAL high)
{
    if (value < low) value = low;
    return value > high ? high : value;
}

/* A limit [N m] at a speed [rad/s]: straight lines in between, outside as at the ends. */
static $REAL ${name}_limit(const $REAL limit[$points], $REAL speed)
{
    const ${name}_parameters *p = &${name}_values;
    int i = 1;
    while (i < ${name}_points && p->speed[i] < speed) ++i;
    if (speed <= p->speed[0]) return limit[0];
    if (i == ${name}_points) return limit[i - 1];
    return (limit[i] - limit[i - 1]) / (p->speed[i] - p->speed[i - 1]) * (speed - p->speed[i - 1]) + limit[i - 1];
}

/* The gear whose ratio is nearest, of two equally near the first; -1 where none drives. */
static int ${name}_gear($REAL ratio)
{
    const ${name}_parameters *p = &${name}_values;
    const $REAL size = ratio < 0 ? -ratio : ratio;
    $REAL least = 0;
    int nearest = -1;
    if (!(size > 0)) return -1;
    for (int pass = 0; pass < 2; ++pass) {
        for (int i = 0; i < ${name}_gears; ++i) {
            const $REAL beyond = p->ratio[i] - ratio;
            const $REAL distance = beyond < 0 ? -beyond : beyond;
            if (pass == 0 && (i == 0 || distance < least)) least = distance;
            if (pass == 1 && nearest < 0 && distance <= least + p->as_near * size) nearest = i;
        }
    }
    return nearest;
}

/* The state with which the controller of a gear engages. */
static void ${name}_engage(${name}_state *s, int gear, const $REAL u[$width])
{
    const ${name}_parameters *p = &${name}_values;
    for (int i = 0; i < ${name}_states; ++i) {
        s->x[i] = 0;
        for (int j = 0; j < $width; ++j) s->x[i] += p->begin[gear][i][j] * u[j];
    }
}

/* Torque of the controller of a gear [N m]; its state moves on. */
static $REAL ${name}_controller(${name}_state *s, int gear, const $REAL u[$width])
{
    const ${name}_parameters *p = &${name}_values;
    $REAL next[$states];
    $REAL torque = 0;
    for (int i = 0; i < ${name}_states; ++i) torque += p->C[gear][i] * s->x[i];
    for (int j = 0; j < $width; ++j) torque += p->D[gear][j] * u[j];
    for (int i = 0; i < ${name}_states; ++i) {
        next[i] = 0;
        for (int j = 0; j < ${name}_states; ++j) next[i] += p->A[gear][i][j] * s->x[j];
        for (int j = 0; j < $width; ++j) next[i] += p->B[gear][i][j] * u[j];
    }
    for (int i = 0; i < ${name}_states; ++i) s->x[i] = next[i];
    return torque;
}

void ${name}_start(${name}_state *s, $REAL torque)
{
    const ${name}_state fresh = {.limited = torque, .net = torque, .gear = -1};
    *s = fresh;
}

$REAL ${name}_step(${name}_state *s,
    $arguments)
{
    const ${name}_parameters *p = &${name}_values;
    const int gear = ${name}_gear(ratio);
    $REAL target = torque_demand;
    s->bump *= p->forget;
    if (gear >= 0) {
        if (gear != s->gear) { /* relative to what there is at this sample */
            s->base[0] = s->base[3] = torque_demand;
            s->base[1] = engine_speed;
            s->base[2] = engine_speed / ratio;
        }
        const $REAL u[$width] = {
            torque_demand - s->base[0], engine_speed - s->base[1], wheels_speed - s->base[2], s->net - s->base[3], ratio};
        if (gear != s->gear) ${name}_engage(s, gear, u);
        target = ${name}_controller(s, gear, u) + s->base[0];
    }
    if (gear != s->gear) {
        s->gear = gear;
        s->bump = s->net - target;
    }
    const $REAL low = ${name}_limit(p->torque_low, engine_speed);
    const $REAL high = ${name}_limit(p->torque_high, engine_speed);
    const $REAL command = ${name}_within(target + s->bump + torque_compensation, low, high);
    s->limited = ${name}_within(command, s->limited - p->fall * p->dt, s->limited + p->rise * p->dt);
    s->net = s->limited - torque_compensation;
    return s->limited;
}
""")


def unit_source(unit: ControlUnit, gears: Mapping[float | None, control.StateSpace], name: str, precision: str) -> str:
    """C99 source of a control unit with these controllers by ratio, None for any."""
    rows, width = max(len(gears), 1), len(CONTROLLER_INPUTS)
    states = max([1, *(controller.nstates for controller in gears.values())])
    shapes = (states, states), (states, width), (states,), (width,), (states, width)
    A, B, C, D, begin = (np.zeros((rows, *shape)) for shape in shapes)
    for i, controller in enumerate(gears.values()):
        n, read = controller.nstates, [CONTROLLER_INPUTS.index(label) for label in controller.input_labels]
        A[i, :n, :n], B[i, :n, read], C[i, :n] = controller.A, controller.B.T, controller.C[0]
        D[i, read] = controller.D[0]
        for _ in range(unit.run_in):
            begin[i] = A[i] @ begin[i] + B[i]
    speed, low, high = np.array(unit.limits).T
    rise, fall = unit.rates
    ratios = np.zeros(rows)
    ratios[: len(gears)] = [0.0 if ratio is None else ratio for ratio in gears]
    values = {
        "dt": unit.dt,
        "speed": speed,
        "torque_low": low,
        "torque_high": high,
        "rise": rise,
        "fall": fall,
        "forget": unit.forget,
        "as_near": AS_NEAR,
        "ratio": ratios,
        "A": A,
        "B": B,
        "C": C,
        "D": D,
        "begin": begin,
    }
    return SOURCE.substitute(
        name=name,
        REAL=precision,
        shown=repr(unit).removeprefix("ControlUnit: "),
        signals="\n".join(f"   {signal}: {what}" for signal, what in SIGNALS),
        gears=len(gears),
        points=len(speed),
        states=states,
        rows=rows,
        width=width,
        inputs=in_comment(CONTROLLER_INPUTS),
        arguments=",\n    ".join(f"{precision} {signal}" for signal, _ in SIGNALS),
        values="\n".join(
            f"    .{member} = {_nested(np.asarray(value), precision)}," for member, value in values.items()
        ),
    )


def in_comment(labels: Iterable[str]) -> str:
    """Labels in one line from which no comment ends."""
    return " ".join(", ".join(labels).split()).replace("*/", "* /")


def literal(value: float, precision: str) -> str:
    """A number in C."""
    if np.isinf(value):
        return "INFINITY" if value > 0.0 else "-INFINITY"
    return f"{float(value)!r}{'' if precision == 'double' else 'f'}"


def _nested(values: np.ndarray, precision: str) -> str:
    if values.ndim == 0:
        return literal(float(values), precision)
    return "{" + ", ".join(_nested(each, precision) for each in values) + "}"
