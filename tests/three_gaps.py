"""The source's car with three gaps, by another road: Table 2.1 seen from the engine, DOP853 from event to event.

``python tests/three_gaps.py`` takes some seconds and writes reference/three_gaps.json. A step over two crossings that are
some microseconds apart goes on in a wrong mode and ends hundreds of rad/s wrong: steps are short where the gaps rattle.
"""

import json
from pathlib import Path

import numpy as np
import scipy.integrate

GEAR, FINAL, RADIUS = 6.0, 3.0, 0.35
# engine, damper, clutch (locked), transmission, differential, wheels, vehicle [kg m^2 at the engine]
J = np.array([0.3, 0.05, 0.09 + 0.01, 0.03, 0.05 / GEAR**2, 4.0 / (GEAR * FINAL) ** 2, 2000.0 * (RADIUS / 18.0) ** 2])
# damper spring, clutch shaft, input shaft, output shaft, drive shafts, tyres, and the ratio between engine and each
RATIO = np.array([1.0, 1.0, 1.0, GEAR, GEAR * FINAL, GEAR * FINAL])
STIFFNESS = np.array([2e3, 5e4, 1e6, 1e6, 34.4e3, 980e3 * RADIUS**2]) / RATIO**2
DAMPING = np.array([1.46, 0.5, 10.0, 10.0, 417.6, 11897.0 * RADIUS**2]) / RATIO**2
HALF_GAP_DEG = {"input_shaft": 0.1, "output_shaft": 0.2, "drive_shafts": 1.0}
SPRING = {"input_shaft": 2, "output_shaft": 3, "drive_shafts": 4}
TORQUE_BEFORE, TORQUE, START, DURATION, SPEED, END = -30.0, 250.0, 0.2, 0.1, 200.0, 2.0
# Steps [s] up to this time, by when all gaps have closed for good, and after it.
SHORT, RATTLES_UNTIL, LONG = 2e-5, 0.34, 2e-4

PLAYS = list(HALF_GAP_DEG)
HALF = np.zeros(6)
for play, half in HALF_GAP_DEG.items():
    HALF[SPRING[play]] = np.radians(half) * RATIO[SPRING[play]]


def engine_torque(t):
    return TORQUE_BEFORE + (TORQUE - TORQUE_BEFORE) * np.clip((t - START) / DURATION, 0.0, 1.0)


def push(x, i, side):
    """What spring and damper beyond a flank push with, negative if they would pull."""
    twist, slip = x[i], x[6 + i] - x[7 + i]
    return STIFFNESS[i] * (side * twist - HALF[i]) + DAMPING[i] * side * slip


def torques(x, modes):
    tau = STIFFNESS * x[:6] + DAMPING * -np.diff(x[6:])
    for play, (side, pushes) in zip(PLAYS, modes, strict=True):
        i = SPRING[play]
        tau[i] = side * push(x, i, side) if pushes else 0.0
    return tau


def rate(t, x, modes):
    tau = torques(x, modes)
    load = np.concatenate([-tau, [0.0]]) + np.concatenate([[engine_torque(t)], tau])
    return np.concatenate([-np.diff(x[6:]), load / J])


def exits(modes):
    """(function that stays positive, play, mode that follows): a mode is a flank, or 0, and whether it pushes."""
    for k, (play, (side, pushes)) in enumerate(zip(PLAYS, modes, strict=True)):
        i = SPRING[play]
        if not side:
            yield lambda t, x, i=i: HALF[i] - x[i], k, (1, True)
            yield lambda t, x, i=i: HALF[i] + x[i], k, (-1, True)
        elif pushes:
            yield lambda t, x, i=i, side=side: push(x, i, side), k, (side, False)
        else:
            yield lambda t, x, i=i, side=side: side * x[i] - HALF[i], k, (0, False)
            yield lambda t, x, i=i, side=side: -push(x, i, side), k, (side, True)


def event_times():
    """(time, play, flank, whether it pushes) of every event."""
    carried = TORQUE_BEFORE * np.cumsum(J[::-1])[::-1][1:] / J.sum()
    modes = [(int(np.sign(carried[SPRING[play]])), True) for play in PLAYS]
    x = np.concatenate([carried / STIFFNESS + np.sign(carried) * HALF, np.full(7, SPEED)])
    x[6:] += TORQUE_BEFORE / J.sum() * START
    t, found = START, []
    while t < END:
        stop = next(corner for corner in (START + DURATION, RATTLES_UNTIL, END) if corner > t)
        functions, owners, following = zip(*exits(modes), strict=True)
        for function in functions:
            function.terminal, function.direction = True, -1.0
        solution = scipy.integrate.solve_ivp(
            lambda t, x, modes=tuple(modes): rate(t, x, modes),
            (t, stop),
            x,
            "DOP853",
            events=functions,
            rtol=1e-11,
            atol=1e-13,
            max_step=SHORT if t < RATTLES_UNTIL else LONG,
        )
        t, x = float(solution.t[-1]), solution.y[:, -1]
        for j, times in enumerate(solution.t_events):
            if len(times):
                modes[owners[j]] = following[j]
                found.append((t, PLAYS[owners[j]], *following[j]))
    return found, x


if __name__ == "__main__":
    found, x = event_times()
    note = "written by tests/three_gaps.py: time [s], element, flank (0 in the gap), whether it pushes"
    rows = ",\n    ".join(map(json.dumps, found))
    path = Path(__file__).parent / "reference" / "three_gaps.json"
    path.write_text(
        f'{{\n  "note": "{note}",\n  "engine_speed": {float(x[6])!r},\n  "events": [\n    {rows}\n  ]\n}}\n'
    )
