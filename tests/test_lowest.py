"""The slowest modes of long drivelines against closed forms, the dense computation, and what they may cost."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import powertrain_ctrl as pt


def chain(n, J=None, k=None, backwards=False):
    """Equal or given inertias in a row."""
    J, k = np.full(n, 0.5) if J is None else J, np.full(n - 1, 1e5) if k is None else k
    springs = [pt.SpringDamper(f"k{i}", f"J{i}", f"J{i + 1}", stiffness=float(k[i]), damping=1.0) for i in range(n - 1)]
    return pt.Driveline(
        *(pt.Inertia(f"J{i}", J=float(J[i])) for i in range(n)), *(springs[::-1] if backwards else springs)
    )


@pytest.mark.parametrize("backwards", [False, True])
def test_a_row_of_equal_bodies_has_the_frequencies_of_the_closed_form(backwards):
    """omega_j = 2 sqrt(k / J) sin(j pi / 2 n), shapes cos(j pi (i + 1/2) / n)."""
    n, j = 2000, np.arange(8)
    result = pt.modes(chain(n, backwards=backwards), count=8)
    expected = 2.0 * np.sqrt(1e5 / 0.5) * np.sin(j * np.pi / (2 * n))
    assert result.omega[0] == 0.0
    np.testing.assert_allclose(result.omega, expected, rtol=1e-12)
    shapes = np.cos(np.pi / n * np.outer(np.arange(n) + 0.5, j))
    np.testing.assert_allclose(np.abs(result.shapes), np.abs(shapes / np.abs(shapes).max(axis=0)), atol=1e-8)
    # damping in proportion to stiffness
    np.testing.assert_allclose(result.damping_ratio[1:], 0.5 * 1e-5 * expected[1:], rtol=1e-12)


def tree(n, seed):
    """Random tree with gears, a shaft with inertia, a spring to ground in one and pure dampers in the other half."""
    random = np.random.default_rng(seed)
    elements = [pt.Inertia(f"J{i}", J=float(10.0 ** random.uniform(-1, 1))) for i in range(n)]
    for i in range(1, n):
        parent, start = f"J{random.integers(0, i)}", f"start{i}"
        elements.append(pt.Gear(f"gear{i}", parent, start, ratio=float(random.choice([-2.0, 0.5, 1.0, 3.0]))))
        stiffness, damping = float(1e4 * 10.0 ** random.uniform(0, 2)), float(random.uniform(0, 5))
        elements.append(pt.SpringDamper(f"k{i}", start, f"J{i}", stiffness=stiffness, damping=damping))
    elements.append(pt.Inertia("tail", J=1.0))
    elements.append(pt.Shaft("shaft", "J1", "tail", stiffness=3e4, inertia=0.2))
    elements.append(pt.SpringDamper("converter", "J0", "free", stiffness=0.0, damping=2.0))
    elements.append(pt.Inertia("free", J=0.5))
    return pt.Driveline(*elements, *([pt.Drag("mount", "J2", damping=1.0, stiffness=10.0)] if seed % 2 else []))


@pytest.mark.parametrize("seed", [0, 1])
def test_the_slowest_modes_of_a_tree_are_the_first_of_all(seed):
    car = tree(320, seed)
    some, every = pt.modes(car, count=6), pt.modes(car)
    assert (len(some), some.n_rigid) == (6, every.n_rigid)
    np.testing.assert_allclose(some.omega, every.omega[:6], rtol=1e-10)
    first = some.n_rigid
    np.testing.assert_allclose(some.damping_ratio[first:], every.damping_ratio[first:6], rtol=1e-8)
    np.testing.assert_allclose(some.shapes[:, first:], every.shapes[:, first:6], atol=1e-8)
    np.testing.assert_allclose(some.strain_energy, every.strain_energy[:, :6], atol=1e-8)
    np.testing.assert_allclose(some.kinetic_energy[:, first:], every.kinetic_energy[:, first:6], atol=1e-8)


def test_of_a_short_driveline_the_slowest_modes_are_the_first_ones():
    car = pt.examples.conventional()
    some, every = pt.modes(car, count=3), pt.modes(car)
    np.testing.assert_array_equal(some.omega, every.omega[:3])
    np.testing.assert_array_equal(some.shapes, every.shapes[:, :3])
    assert len(pt.modes(car, count=100)) == 7
    with pytest.raises(pt.PowertrainError, match="count = 0"):
        pt.modes(car, count=0)


@pytest.mark.skipif(
    not Path("/proc/self/status").exists(), reason="the peak of a process's own memory is read from /proc"
)
def test_ten_modes_of_ten_thousand_bodies_take_little_memory():
    """In a process of its own, whose memory no other test has used; ru_maxrss would count that of the process before it."""
    code = (
        "import powertrain_ctrl as pt\n"
        "n = 10_000\n"
        "car = pt.Driveline(*(pt.Inertia(f'J{i}', J=1.0) for i in range(n)),\n"
        "    *(pt.SpringDamper(f'k{i}', f'J{i}', f'J{i + 1}', stiffness=1e5) for i in range(n - 1)))\n"
        "pt.modes(car, count=10)\n"
        "print(next(line for line in open('/proc/self/status') if line.startswith('VmHWM')).split()[1])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert float(done.stdout) * 1024 < 2**30
