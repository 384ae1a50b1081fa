"""Play: a tip-in through one gap against an implicit solver, and the time of an event over the number of gaps."""

import statistics
from functools import partial

import numpy as np
import scipy.integrate
import scipy.linalg

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.model import plants_of

from .timing import ratio_row, timed

SOURCE = pt.examples.conventional()
T = np.linspace(0.0, 2.0, 2001)
TORQUE = pt.ramp(0.2, 0.1, 250.0, -30.0)
START = {"initial_speed": {"engine": 200.0, "wheels": 200.0 / 18.0}, "initial_load": {"engine_torque": -30.0}}


def with_gap(half, name="drive_shafts", contact="clipped", car=SOURCE):
    shaft = car[name]
    play = pt.Backlash(
        name, shaft.a, shaft.b, gap=2.0 * half, stiffness=shaft.stiffness, damping=shaft.damping, contact=contact
    )
    return pt.Driveline(*(play if element is shaft else element for element in car))


def tip_in_through_a_gap():
    """The right-hand side as one would write it: the contact where twist and rate push, nothing where they would pull."""
    car, half = with_gap(np.deg2rad(1.0)), np.deg2rad(1.0)
    model = pt.assemble(car.at(torques={"engine_torque": 100.0}))
    shaft = model.compliances.index("drive_shafts")
    row, k, d = model.F[shaft], model.stiffness[shaft], model.damping[shaft]
    others = np.arange(len(model.compliances)) != shaft
    F, n = model.F[others], len(model.M)
    K, D = (F.T * model.stiffness[others]) @ F, (F.T * model.damping[others]) @ F
    load = model.T.T @ model.B[:, model.inputs.index("engine_torque")]
    inverse = np.linalg.inv(model.M)

    def contact(twist, slip):
        right, left = k * (twist - half) + d * slip, k * (twist + half) + d * slip
        return max(right, 0.0) if twist > half else min(left, 0.0) if twist < -half else 0.0

    def rate(t, y):
        q, v = y[:n], y[n:]
        torque = contact(row @ q, row @ v)
        return np.concatenate([v, inverse @ (load * float(TORQUE(t)) - K @ q - D @ v - row * torque)])

    response = pt.simulate(car, T, {"engine_torque": TORQUE}, **START)
    begin = pt.simulate(car, [0.0, 1e-9], {"engine_torque": TORQUE}, **START).final
    twists = np.array([begin.twist[name] for name in model.compliances if name in begin.twist])
    rows = model.F[[name in begin.twist for name in model.compliances]]
    q0 = np.linalg.lstsq(rows, twists, rcond=None)[0]
    v0 = np.linalg.lstsq(model.T, [begin.speed[node] for node in model.nodes], rcond=None)[0]
    start = np.concatenate([q0, v0])

    def slow(rtol=1e-6, atol=1e-8):
        return scipy.integrate.solve_ivp(rate, (0.0, 2.0), start, "Radau", T, rtol=rtol, atol=atol, max_step=0.05)

    def fast():
        return pt.simulate(car, T, {"engine_torque": TORQUE}, **START)

    engine = model.T[model.nodes.index("engine")]
    closer = engine @ slow(1e-9, 1e-11).y[n:]
    difference, other = (np.abs(speed - closer).max() for speed in (response["engine_speed"], engine @ slow().y[n:]))
    print(
        f"tip-in through a gap: Radau 1e-6 differs from Radau 1e-9 by {other:.1g} rad/s, which the row must not reach"
    )
    name = "tip-in through a gap, 2001 samples / Radau 1e-6, plain right-hand side"
    return ratio_row(name, 30, fast, slow, difference, other, 5, 5)


def with_seven_shafts():
    """The source's car, its output and drive shafts halved by a flange each."""
    elements = [pt.Inertia("output_flange", J=0.02), pt.Inertia("wheel_flange", J=0.1)]
    for element in SOURCE:
        flange = {"output_shaft": "output_flange", "drive_shafts": "wheel_flange"}.get(element.name)
        if flange is None:
            elements.append(element)
            continue
        halves = {"stiffness": 2.0 * element.stiffness, "damping": 2.0 * element.damping}
        elements.append(pt.SpringDamper(element.name, element.a, flange, **halves))
        elements.append(pt.SpringDamper(f"{element.name}_behind", flange, element.b, **halves))
    return pt.Driveline(*elements)


def growth():
    """Time of an event over the number of gaps; only sets of modes that a run comes to are computed."""
    print("\ntip-in of the source's car, two shafts halved, through 1 to 7 gaps of 0.2 degrees, 2001 samples")
    names = ("drive_shafts", "output_shaft", "input_shaft", "clutch_shaft", "damper_spring")
    car = with_seven_shafts()
    for count, name in enumerate((*names, "drive_shafts_behind", "output_shaft_behind"), start=1):
        car = with_gap(np.deg2rad(0.2), name, "nordin", car)
        run = partial(pt.simulate, car, T, {"engine_torque": TORQUE}, **START)
        first, response = timed(run), run()
        each = statistics.median(timed(run) for _ in range(3))
        events, visited = len(response.events), plants_of(car).slipping.pattern.cache_info().currsize
        print(
            f"  {count} gaps: {1e3 * each:7.1f} ms ({1e3 * first:.1f} the first time), {events} events, "
            f"{1e3 * each / max(events, 1):.2f} ms each; {visited} of {3**count} sets of modes"
        )
