"""Frequency responses and engine orders: impedances from the leaves against matrices that are solved."""

import statistics
from functools import partial

import control
import numpy as np

import powertrain_ctrl as pt

from .timing import ratio_row, timed

try:
    import opentorsion
except ImportError:  # not a dependency: pip install --no-deps opentorsion==0.3.2
    opentorsion = None

# Inertias, frequencies; of these the peers take a part, and their time is scaled; how many times faster at least than
# batched LAPACK, python-control and openTorsion. Without a bar it is shown.
SIZES = {7: (4800, 600, (7, 40, 85)), 50: (4800, 100, (0, 0, 0)), 200: (1000, 20, (60, 80, 180))}


def chain(inertias):
    random = np.random.default_rng(1)
    J, k = random.uniform(0.05, 1.0, inertias), random.uniform(1e4, 1e6, inertias - 1)
    elements = [pt.Inertia(f"n{i}", J=value) for i, value in enumerate(J)]
    elements += [
        pt.SpringDamper(f"s{i}", f"n{i}", f"n{i + 1}", stiffness=value, damping=1e-5 * value)
        for i, value in enumerate(k)
    ]
    return pt.Driveline(*elements), J, k


def lapack(model, omega, load):
    full = model.K - (omega**2)[:, None, None] * model.M + 1j * omega[:, None, None] * model.D
    return np.linalg.solve(full, np.broadcast_to(load[:, None], (len(omega), len(load), 1)))[..., 0]


def responses():
    """Angles of all inertias under a torque at the first one."""
    return all([met for inertias, size in SIZES.items() for met in _rows(inertias, *size)])


def _rows(inertias, count, fewer, bars):
    car, J, k = chain(inertias)
    omega, angles = np.linspace(5.0, 2000.0, count), [f"n{i}_angle" for i in range(inertias)]
    model, load = pt.assemble(car), np.eye(inertias)[0]
    some = omega[:: count // fewer]
    tried = some if inertias > 100 else omega

    def ours():
        return pt.forced_response(car, omega, {"n0_torque": 1.0}, angles)

    found = ours()
    table = np.array([found[name][:: count // fewer] for name in angles]).T
    largest = np.abs(table).max()

    def row(peer, bar, theirs, some_of_theirs, tolerance, part):
        error = np.abs(some_of_theirs - table).max() / largest
        name = f"{inertias} inertias, {count} frequencies / {peer}"
        return ratio_row(
            name, bar, ours, theirs, error, tolerance, inner=10 if inertias < 20 else 3, scale=count / len(part)
        )

    yield row("batched LAPACK", bars[0], lambda: lapack(model, tried, load), lapack(model, some, load), 1e-10, tried)
    G = pt.state_space(car, "n0_torque", angles, coordinates="angle")
    theirs = np.squeeze(control.frequency_response(G, some).frdata).T
    yield row("python-control", bars[1], lambda: control.frequency_response(G, some), theirs, 1e-5, some)
    if opentorsion is None:
        print(f"{inertias} inertias, {count} frequencies / openTorsion: not installed")
        return
    shafts = [opentorsion.Shaft(i, i + 1, None, None, k=value, I=0, c=1e-5 * value) for i, value in enumerate(k)]
    assembly = opentorsion.Assembly(shafts, disk_elements=[opentorsion.Disk(i, value) for i, value in enumerate(J)])
    torque = np.outer(load, np.ones(len(some))).astype(complex)
    theirs = assembly.ss_response(torque, some)[0].T
    yield row("openTorsion ss_response", bars[2], lambda: assembly.ss_response(torque, some), theirs, 1e-10, some)


def growth():
    print("\nforced response, 1000 frequencies, all angles, over the number of inertias")
    cells, omega = [], np.linspace(5.0, 2000.0, 1000)
    for inertias in (25, 50, 100, 200, 400):
        arguments = chain(inertias)[0], omega, {"n0_torque": 1.0}, [f"n{i}_angle" for i in range(inertias)]
        pt.forced_response(*arguments)
        each = statistics.median(timed(partial(pt.forced_response, *arguments)) for _ in range(5))
        cells.append(f"{inertias}: {1e3 * each:.2f} ms ({1e6 * each / inertias:.0f} us each)")
    print("  " + "   ".join(cells))


def order_map():
    """266 speeds, 24 orders, all outputs of a car with seven inertias, against a solution for each order and speed."""
    car = pt.examples.conventional(gear_ratio=3.6)
    engine = pt.Engine(
        cylinders=4, firing_order=(1, 3, 4, 2), bore=0.0825, stroke=0.0928, rod=0.144, reciprocating_mass=0.55,
        pressure=pt.orders.wiebe(mean_torque=150.0, compression_ratio=10.5),
    )  # fmt: skip
    speed = pt.rpm(np.linspace(700.0, 6000.0, 266))
    model = pt.assemble(car)
    place = model.nodes.index("engine")

    def fast():
        return pt.order_response(car, engine, speed)

    def slow():
        orders, torque = engine.torque_orders(speed)
        omega = np.multiply.outer(orders, speed).ravel()
        x = lapack(model, omega, model.T[place].astype(complex)) * torque.ravel()[:, None]
        angle = model.T @ x.T
        twist = model.F @ x.T
        carried = (model.stiffness[:, None] + 1j * omega * model.damping[:, None]) * twist
        return [angle, 1j * omega * angle, -(omega**2) * angle, twist, carried]

    found, wanted = fast(), slow()
    error = 0.0
    for i, name in enumerate(model.compliances):
        torque = wanted[4][i].reshape(24, -1)
        error = max(error, np.abs(found[f"{name}_torque"] - torque).max() / np.abs(torque).max())
    return ratio_row("order map, 266 speeds x 24 orders, all outputs / LAPACK", 1, fast, slow, error, 1e-9)
