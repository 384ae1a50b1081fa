"""One matrix takes the exact core one sample further, or says that it may not.

Of hybrid/plant, hybrid/segment.
"""

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.hybrid.model import plants_of
from powertrain_ctrl.hybrid.run import Run
from powertrain_ctrl.hybrid.segment import Segment
from powertrain_ctrl.hybrid.steps import Instant, Step, physical_states

CAR = pt.Driveline(
    pt.Inertia("a", J=0.3),
    pt.Inertia("b", J=0.2),
    pt.Inertia("c", J=0.5),
    pt.Clutch("clutch", "a", "b", max_torque=20.0),
    pt.Backlash("play", "b", "c", gap=0.02, stiffness=900.0, damping=2.0),
)
PLANTS = plants_of(CAR)
PLANT = PLANTS.slipping
PHYSICAL = physical_states(PLANT)
H = 0.002
SLIDING, STUCK, FREE = 1, 0, 2
MODES = [(clutch, play) for clutch in (SLIDING, STUCK, FREE) for play in (0, 1, 2)]


def step(modes, h):
    return Step(PLANT, modes, h, Instant(PLANT, modes).outputs)


def start(clutch, play, slip=4.0):
    """x in which these modes hold for a while."""
    speed = np.array([3.0 + slip * (clutch != STUCK), 3.0, 2.0 + (play == 1) + 2.0 * (play == 2)])
    twist = {0: 0.001, 1: 0.011, 2: -0.011}[play]
    x = PLANT.state(np.zeros(0), np.linalg.lstsq(PLANT.model.T, speed, rcond=None)[0], twist)
    modes = (clutch, play)
    x, chosen = PLANT.started(x, modes)
    assert chosen[1] == play
    return x, modes


def values(clutch, torque):
    return np.array([torque, 0.5, -1.0, 0.0 if clutch == FREE else 15.0])


@pytest.mark.parametrize(("clutch", "play"), MODES)
def test_a_step_is_the_run_of_one_sample(clutch, play):
    x, modes = start(clutch, play)
    before, behind = values(clutch, 1.0), values(clutch, 3.0)
    run = Run(lambda _: PLANT, x, modes, 0.0, started=True)
    lines = np.stack([before, (behind - before) / H], axis=1)
    assert len(list(run.advance(Segment(lines[:3], lines[3:]), H))) == 1
    moved, outputs = step(modes, H)(PHYSICAL @ x, before, behind)
    np.testing.assert_allclose(moved, PHYSICAL @ run.x, rtol=0.0, atol=1e-13 * np.abs(moved).max())
    expected = Instant(PLANT, modes)(PHYSICAL @ run.x, behind)
    np.testing.assert_allclose(outputs, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_a_step_in_which_a_clutch_locks_is_refused():
    # a slip of 0.4 rad/s falls by 15 (1/0.3 + 1/0.2) = 125 rad/s^2: locked after 3.2 ms
    x, modes = start(SLIDING, 0, slip=0.4)
    still = np.array([0.0, 0.0, 0.0, 15.0])
    assert step(modes, 0.0031)(PHYSICAL @ x, still, still) is not None
    assert step(modes, 0.0033)(PHYSICAL @ x, still, still) is None


def test_a_step_in_which_a_gap_closes_and_opens_again_is_refused():
    # a torque of 20 N m pushes b back: twist 8.5 mrad + 0.4 t - 50 t^2 is 9.3 mrad at its highest, inside the gap; with
    # 0.6 t it is 10.3 mrad after 6 ms, and back at 9.9 mrad after 9 ms
    back, modes = np.array([0.0, -20.0, 0.0, 0.0]), (FREE, 0)
    for speed, after, refused in ((0.4, 0.004, False), (0.6, 0.009, True)):
        x = PLANT.state(np.zeros(0), np.linalg.lstsq(PLANT.model.T, [0.0, speed, 0.0], rcond=None)[0], 0.0085)
        assert (step(modes, after)(PHYSICAL @ x, back, back) is None) == refused


def test_neither_a_step_nor_an_instant_believes_that_a_clutch_that_slips_is_stuck():
    x, modes = start(STUCK, 0)
    x[: PLANT.N] += PLANT.G[:, 0]
    assert step(modes, H)(PHYSICAL @ x, values(STUCK, 1.0), values(STUCK, 1.0)) is None
    assert Instant(PLANT, modes)(PHYSICAL @ x, values(STUCK, 1.0)) is None


@pytest.mark.parametrize(("clutch", "play"), MODES)
def test_outputs_at_an_instant_are_those_of_the_run(clutch, play):
    x, modes = start(clutch, play)
    u = values(clutch, 1.0)
    run = Run(lambda _: PLANT, x, modes, 0.0, started=True)
    torque = run.torque_now(Segment(u[:3, None], u[3:, None]))
    assert run.modes == modes
    expected = PLANTS.output_values(PLANT, x[:, None], torque[:, None], u[:, None], np.zeros((2, 1)))[:, 0]
    y = Instant(PLANT, modes)(PHYSICAL @ x, u)
    np.testing.assert_allclose(y, expected[: len(y)], rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_an_instant_at_which_a_stuck_clutch_is_overloaded_is_refused():
    x, modes = start(STUCK, 0)
    assert Instant(PLANT, modes)(PHYSICAL @ x, np.array([30.0, 0.0, 0.0, 15.0])) is not None
    # J_b / (J_a + J_b) of the torque goes through the clutch
    assert Instant(PLANT, modes)(PHYSICAL @ x, np.array([37.4, 0.0, 0.0, 15.0])) is not None
    assert Instant(PLANT, modes)(PHYSICAL @ x, np.array([37.6, 0.0, 0.0, 15.0])) is None
