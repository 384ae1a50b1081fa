"""A torque that rises and falls differently: against an integration of its differential equations, and what carries it.

Of sampled/directed too.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk

J, K, D, RATIO = (0.3, 3.0, 200.0), (900.0, 9e3), (1.5, 20.0), 8.0
GAP, DT, POINTS = 0.06, 0.01, 5
LIMITS, RATES, GAIN = (-60.0, 150.0), (2500.0, 6000.0), 1.5
# up, down, up again before all is there, and a little later to and fro
TIMES = [0.0, 0.05, 0.08, 0.13, 0.15, 0.155, 0.21, 0.3, 0.31, 0.35, 0.36, 0.6]
TORQUES = [0.0, 0.0, 200.0, 200.0, -50.0, -50.0, 90.0, 90.0, 60.0, 60.0, 100.0, 100.0]
DIRECTIONS = [
    ((0.05, 0.02), (0.03, 0.01)),
    ((0.02, 0.05), (0.013, 0.004)),
    ((0.0, 0.03), 0.01),
    ((0.04, 0.0), (0.004, 0.047)),
    (0.03, (0.057, 0.002)),
    (0.0, (0.031, 0.012)),
    ((0.06, 0.005), 0.0),
]


def car(with_play):
    if with_play:
        first = pt.Backlash("damper", "engine", "box", gap=GAP, stiffness=K[0], damping=0.0)
    else:
        first = pt.SpringDamper("damper", "engine", "box", stiffness=K[0], damping=D[0])
    return pt.Driveline(
        pt.Inertia("engine", J=J[0]),
        first,
        pt.Inertia("box", J=J[1]),
        pt.Gear("gear", "box", "shaft", ratio=RATIO),
        pt.SpringDamper("shafts", "shaft", "wheels", stiffness=K[1], damping=D[1]),
        pt.Inertia("wheels", J=J[2]),
    )


def plant_of(lag, delay, with_play=False, **more):
    values = {"dt": DT, "torque_limits": LIMITS, "torque_rate": RATES, **more}
    return pt.SampledPlant(car=car(with_play), lag=lag, delay=delay, **values)


def controller_of(plant):
    return antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=GAIN))


class Integrated:
    """Engine, box and wheels with their springs, and the torque, by DOP853 from instant to instant."""

    def __init__(self, lag, delay, with_play, torque):
        self.lags, self.delays = (value if isinstance(value, tuple) else (value, value) for value in (lag, delay))
        self.with_play, self.load = with_play, -torque * RATIO
        self.y = np.zeros(6)  # both twists, speeds, torque
        self.y[0] = torque / K[0] + (np.sign(torque) * GAP / 2.0 if with_play else 0.0)
        self.y[1], self.y[5] = torque * RATIO / K[1], torque
        self.time, self.sent, self.before = 0.0, [], torque

    def command(self, value):
        """Sent now."""
        delay = self.delays[0] if value > self.before else self.delays[1]
        if value != self.before:
            self.sent.append((self.time + delay, value))
        self.before = value

    def acting(self, first):
        """The newest of the commands that have arrived."""
        arrived = [value for at, value in self.sent if at <= self.time + 1e-12]
        return arrived[-1] if arrived else first

    def rates(self, t, y, command, lag, side):
        twist, shaft, engine, box, wheels, torque = y
        carried = K[0] * side * (side * twist - GAP / 2.0) if side else 0.0
        if not self.with_play:
            carried = K[0] * twist + D[0] * (engine - box)
        behind = K[1] * shaft + D[1] * (box / RATIO - wheels)
        return [
            engine - box,
            box / RATIO - wheels,
            (torque - carried) / J[0],
            (carried - behind / RATIO) / J[1],
            (behind + self.load) / J[2],
            (command - torque) / lag if lag else 0.0,
        ]

    def go(self, until, first):
        """On to an instant, stopping where a command arrives or the play changes its side."""
        while self.time < until - 1e-12:
            command = self.acting(first)
            end = min([until, *(at for at, _ in self.sent if at > self.time + 1e-12)])
            lag = self.lags[0] if command > self.y[5] else self.lags[1]
            if not lag:
                self.y[5] = command
            while self.time < end - 1e-12:
                twist, rate = self.y[0], self.y[2] - self.y[3]
                # at the flank the motion says on which side of it the next moment is
                over = abs(twist) - GAP / 2.0
                side = np.sign(twist) * (over > 1e-9 or (over > -1e-9 and rate * twist > 0.0))
                crossing = lambda t, y, *rest: abs(y[0]) - GAP / 2.0  # noqa: E731
                crossing.terminal, crossing.direction = True, -1.0 if side else 1.0
                found = solve_ivp(
                    self.rates,
                    (self.time, end),
                    self.y,
                    method="DOP853",
                    rtol=1e-12,
                    atol=1e-13,
                    args=(command, lag, side),
                    events=[crossing] if self.with_play else None,
                )
                self.y, self.time = found.y[:, -1].copy(), float(found.t[-1])
            self.time = end
        if not self.lags[0 if self.acting(first) > self.y[5] else 1]:
            self.y[5] = self.acting(first)


def integrated(lag, delay, with_play, torque, is_closed):
    """Torque, engine speed, wheel speed (3, points) and commands."""
    motion, limited = Integrated(lag, delay, with_play, torque), torque
    found, commands = [], []
    for k in range(round(TIMES[-1] / DT)):
        # to the microsecond, so that a corner at a sample is one
        wanted = torque + np.interp(round(k * DT, 6), TIMES, TORQUES)
        difference = motion.y[2] - RATIO * motion.y[4]
        asked = wanted - GAIN * difference * is_closed
        asked = min(max(asked, limited - RATES[1] * DT), limited + RATES[0] * DT)
        limited = min(max(asked, LIMITS[0]), LIMITS[1])
        motion.command(limited)
        commands.append(limited)
        for i in range(POINTS):
            motion.go(k * DT + i * DT / POINTS, torque)
            found.append(motion.y[[5, 2, 4]])
        motion.go((k + 1) * DT, torque)
    return np.array(found).T, np.array(commands)


def same_as_integrated(lag, delay, with_play, torque, is_closed):
    plant = plant_of(lag, delay, with_play)
    demand = pt.samples(TIMES, np.array(TORQUES) + torque)
    controller = controller_of(plant) if is_closed else None
    response = pt.closed_loop(
        plant, controller, demand, duration=TIMES[-1], initial_torque=torque, steps_per_sample=POINTS
    )
    (torques, *speeds), commands = integrated(lag, delay, with_play, torque, is_closed)
    count = len(torques)
    np.testing.assert_allclose(response["torque_command"][:count:POINTS], commands, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(response["engine_torque"][:count], torques, rtol=0.0, atol=1e-8)
    for name, expected in zip(("engine_speed", "wheels_speed"), speeds, strict=True):
        np.testing.assert_allclose(response[name][:count], expected, rtol=0.0, atol=1e-8)
    return response


@pytest.mark.parametrize(("lag", "delay"), DIRECTIONS)
@pytest.mark.parametrize("is_closed", [False, True], ids=["open", "closed"])
def test_a_linear_car_moves_as_its_equations_say(lag, delay, is_closed):
    same_as_integrated(lag, delay, False, 0.0, is_closed)


@pytest.mark.parametrize(("lag", "delay"), DIRECTIONS)
def test_a_car_with_play_moves_as_its_equations_say(lag, delay):
    response = same_as_integrated(lag, delay, True, -20.0, True)
    assert {event.kind for event in response.events} >= {"open", "contact"}
