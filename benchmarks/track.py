"""A simulated test track: the source's car with its sensors, by matrix exponentials and nothing of the package.

Engine speed with noise of 0.5 rpm in steps of 0.25 rpm; wheel speed from the edges of two wheels of 48 teeth, each up to
0.3 % of a tooth off, a timer of 1 us, whole teeth in a window of 10 ms, 1/128 km/h; torque with noise of 1 N m in steps of
1 N m.
"""

import numpy as np
import scipy.linalg

# Table 2.1, third gear: inertias [kg m^2, the vehicle at the wheels], stiffnesses [N m/rad], dampings [N m s/rad].
RATIO, FINAL, RADIUS, MASS = 3.6, 3.0, 0.35, 2000.0
INERTIA = (0.3, 0.05, 0.1, 0.03, 0.05, 4.0, MASS * RADIUS**2)
STIFFNESS = (2000.0, 50e3, 1e6, 1e6, 34.4e3, 980e3 * RADIUS**2)
DAMPING = (1.46, 0.5, 10.0, 10.0, 417.6, 11897.0 * RADIUS**2)
# Each spring from the speed of its driving to that of its driven side.
ENDS = ((1, 1), (1, 1), (1, 1), (1 / RATIO, 1), (1 / FINAL, 1), (1, 1))
ENGINE, WHEELS = 0, 5
TIP_INS = ([0, 1.0, 1.05, 4.0, 4.05, 6.5, 6.55, 9.0], [30, 30, 150, 150, 40, 40, 180, 180])


def speeds(t, torque, h=0.001):
    """Speeds of engine and wheels on an even grid of h from steady motion, the torque linear in between."""
    n, r = len(INERTIA), len(STIFFNESS)
    E = np.zeros((r, n))
    for i, (before, behind) in enumerate(ENDS):
        E[i, i], E[i, i + 1] = before, -behind
    M, K, D = np.diag(INERTIA), E.T * STIFFNESS @ E, E.T * DAMPING @ E
    A = np.block([[np.zeros((r, r)), E], [-np.linalg.solve(M, E.T * STIFFNESS), -np.linalg.solve(M, D)]])
    B = np.zeros((r + n, 1))
    B[r + ENGINE] = 1.0 / INERTIA[0]
    step = scipy.linalg.expm(
        np.block([[A * h, B * h, 0 * B], [np.zeros((1, r + n)), 0.0, 1.0], [np.zeros((1, r + n + 2))]])
    )
    size = r + n
    phi, late = step[:size, :size], step[:size, size + 1]
    early = step[:size, size] - late
    assert np.allclose(K, E.T @ np.diag(STIFFNESS) @ E)
    # a road load holds the first torque in balance, so what follows is the answer to the rest
    extra = torque - torque[0]
    x = np.zeros((len(t), size))
    for k in range(len(t) - 1):
        x[k + 1] = phi @ x[k] + early * extra[k] + late * extra[k + 1]
    return x[:, r + ENGINE], x[:, r + WHEELS]


def wheel_sensor(t, speed, rng, teeth=48, pitch_error=0.003, window=0.01, timer=1e-6):
    """Whole teeth between the last edges of two windows over their time."""
    angle = rng.uniform(0.0, 6.28) + np.concatenate([[0.0], np.cumsum(0.5 * np.diff(t) * (speed[1:] + speed[:-1]))])
    errors = rng.normal(0.0, pitch_error, teeth) * 2 * np.pi / teeth
    errors -= errors.mean()
    k = np.arange(int(np.ceil(angle[0] * teeth / 2 / np.pi)), int(angle[-1] * teeth / 2 / np.pi))
    edges = np.floor(np.interp(k * 2 * np.pi / teeth + errors[k % teeth], angle, t) / timer) * timer
    last = np.searchsorted(edges, np.arange(0.0, t[-1] + 1e-9, window), side="right") - 1
    found, held, before = [], speed[0], None
    for j in last:
        if j >= 0 and before is not None and j > before:
            held = (j - before) * 2 * np.pi / teeth / (edges[j] - edges[before])
        if j >= 0:
            before = j
        found.append(held)
    return np.array(found)


FINE = np.arange(9001) * 0.001
TORQUE = np.interp(FINE, *TIP_INS)
EXACT: list = []


def run(seed, early=0.0, start=12.0):
    """Signals of one run at 100 Hz by name; ``early`` [s]: the torque is recorded before it acts."""
    if not EXACT:
        EXACT.extend(speeds(FINE, TORQUE))
    rng = np.random.default_rng(seed)
    engine, wheels = EXACT[0] + start / RADIUS * RATIO * FINAL, EXACT[1] + start / RADIUS
    noisy = engine[::10] * 30 / np.pi + rng.normal(0.0, 0.5, 901)
    turned = np.mean([wheel_sensor(FINE, wheels, rng) for _ in range(2)], axis=0)
    torque = np.interp(FINE[::10] + early, *TIP_INS)
    return {
        "time": FINE[::10],
        "engine_torque": np.round(torque + rng.normal(0.0, 1.0, 901)),
        "engine_speed": np.round(noisy / 0.25) * 0.25 * np.pi / 30,
        "wheels_speed": np.round(turned * RADIUS * 3.6 * 128) / 128 / 3.6 / RADIUS,
    }
