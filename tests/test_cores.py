"""One sampled loop and its two cores: what reaches a core, and that both move a car in the same way.

Of sampled/loop.
"""

import dataclasses

import numpy as np
import pytest
import scipy.linalg

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk
from powertrain_ctrl.sampled.arrivals import Acting
from powertrain_ctrl.sampled.cores import HybridCore, LinearCore
from powertrain_ctrl.sampled.loop import sampled_loop

CAR = pt.examples.conventional()
PLANT = pt.SampledPlant(car=CAR)


class Recording:
    """A core that measures the number of the sample and keeps what it is given."""

    def __init__(self):
        self.given = []

    @property
    def measured(self):
        return np.array([len(self.given), 0.0])

    def step(self, acting):
        self.given.append(tuple(command for _, command in acting))


@pytest.mark.parametrize(
    ("delay", "expected"),
    [
        (0.0, [(1,), (2,), (3,), (4,)]),
        (0.003, [(0, 1), (1, 2), (2, 3), (3, 4)]),
        (0.01, [(0,), (1,), (2,), (3,)]),
        (0.023, [(0,), (0,), (0, 1), (1, 2)]),
    ],
)
def test_a_command_arrives_after_the_delay(delay, expected):
    core, plant = Recording(), dataclasses.replace(PLANT, delay=delay)
    found = sampled_loop(plant, core, lambda k, measured, limited: k + 1.0, (-10.0, 10.0), samples=4, steps=4)
    assert core.given == expected
    np.testing.assert_array_equal(found.limited, [1.0, 2.0, 3.0, 4.0])


def test_what_is_beyond_the_limits_is_limited_and_told_to_the_next_sample():
    seen = []

    def command(k, measured, limited):
        seen.append((k, measured[0], limited))
        return [5.0, 50.0, -50.0][k]

    found = sampled_loop(PLANT, Recording(), command, (-1.0, 20.0), samples=3, steps=2)
    np.testing.assert_array_equal(found.unlimited, [5.0, 50.0, -50.0])
    np.testing.assert_array_equal(found.limited, [5.0, 20.0, -1.0])
    assert seen == [(0, 0.0, 0.0), (1, 1.0, 5.0), (2, 2.0, 20.0)]


def test_a_command_that_is_no_number_ends_the_loop_at_its_time():
    with pytest.raises(pt.SignalError, match=r"not finite at t = 0\.02 s; the loop is unstable"):
        sampled_loop(PLANT, Recording(), lambda k, measured, limited: [0.0, 0.0, np.nan][k], (0.0, 1.0), 3, 3)


def test_the_linear_core_steps_by_the_exponential_of_the_plant():
    plant = dataclasses.replace(PLANT, delay=0.004)
    P, n = plant.continuous, plant.continuous.nstates
    core = LinearCore(plant, 2, 1, np.zeros((5, 3)))
    x = np.zeros(n)
    for before, after in ((0.0, 100.0), (100.0, -30.0)):
        core.step([Acting(0.0, before), Acting(0.004, after)])
        for command, length in ((before, 0.004), (after, 0.006)):
            whole = scipy.linalg.expm(length * np.block([[P.A, P.B[:, :1]], [np.zeros((1, n + 1))]]))
            x = whole[:n, :n] @ x + whole[:n, n] * command
        np.testing.assert_allclose(core.measured, P.C[:2] @ x, rtol=1e-12)


@pytest.mark.parametrize(("lag", "delay"), [(0.03, 0.01), (0.03, 0.013), (0.0, 0.004), (0.0, 0.0)])
def test_both_cores_move_a_car_that_never_switches_in_the_same_way(lag, delay):
    plant = pt.SampledPlant(car=CAR, lag=lag, delay=delay)
    controller = antijerk.one_dof(plant, antijerk.speed_difference(plant, gain=6.0))
    count, points = 40, 5
    time = plant.dt / points * np.arange(count * points + 1)
    linear = LinearCore(plant, count, points, np.zeros((5, len(time))))
    hybrid = HybridCore(plant, pt.assemble(CAR), (), time, points, {}, {"engine": 0.0})
    found = {}
    for core in (linear, hybrid):
        unit, measured = pt.ControllerStepper(controller, plant.dt), []

        def command(k, speeds, limited, unit=unit, measured=measured):
            measured.append(speeds)
            named = {"engine_speed": speeds[0], "wheels_speed": speeds[1], "torque_limited": limited}
            return unit.step(torque_demand=100.0, ratio=plant.ratio, **named)

        commands = sampled_loop(plant, core, command, (-200.0, 200.0), count + 1, steps=count)
        found[core] = commands, np.array(measured)
    (one, speeds), (other, same) = found[linear], found[hybrid]
    np.testing.assert_allclose(other.limited, one.limited, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(same, speeds, rtol=0.0, atol=1e-10 * np.abs(speeds).max())
    recorded = hybrid.plant.speed(hybrid.recorder.x)[hybrid.plant.model.nodes.index("engine")]
    np.testing.assert_allclose(recorded, linear.outputs(one.acting)[0], rtol=0.0, atol=1e-10 * np.abs(recorded).max())
