"""Blows: dog clutches that close and nodes that jump, against one-way clutches that let nothing slip forward."""

import numpy as np
import pytest
import scipy.optimize

import powertrain_ctrl as pt

T = np.linspace(0.0, 1.0, 11)


def chain(*joints, J=(1.0, 1.0, 2.0)):
    return pt.Driveline(*(pt.Inertia(name, J=value) for name, value in zip("abc", J, strict=False)), *joints)


def test_a_dog_clutch_that_closes_takes_along_what_a_one_way_clutch_drives():
    car = chain(pt.DogClutch("dog", "a", "b"), pt.OneWayClutch("free", "b", "c"))
    response = pt.simulate(car, T, {"dog_engaged": pt.step(0.5, 1.0)}, {"a": 10.0, "b": 1.0, "c": 1.0})
    # momentum 1 x 10 + 3 x 1 on 4 kg m^2
    assert response.final.speed == pytest.approx(dict.fromkeys("abc", 3.25), rel=1e-13)
    assert [(e.element, e.kind) for e in response.events] == [("dog", "lock")]
    assert response.slip_energy == {"dog": pytest.approx(0.5 * (100.0 + 3.0 - 4.0 * 3.25**2), rel=1e-13)}


def test_a_dog_clutch_that_closes_lets_a_one_way_clutch_overrun():
    car = chain(pt.DogClutch("dog", "a", "b"), pt.OneWayClutch("free", "b", "c"))
    response = pt.simulate(car, T, {"dog_engaged": pt.step(0.5, 1.0)}, {"a": -10.0, "b": 1.0, "c": 1.0})
    assert response.final.speed == pytest.approx({"a": -4.5, "b": -4.5, "c": 1.0}, rel=1e-13)
    assert [(e.element, e.kind) for e in response.events] == [("dog", "lock"), ("free", "release")]


def test_a_moved_node_that_jumps_takes_along_what_a_one_way_clutch_drives():
    car = chain(pt.SpeedSource("motor", "a"), pt.OneWayClutch("free", "a", "b"), J=(1.0, 2.0))
    response = pt.simulate(car, T, {"motor_speed": pt.step(0.5, 3.0)})
    assert response.final.speed == pytest.approx({"a": 3.0, "b": 3.0}, rel=1e-13)
    # the source gives 2 x 3 x 3 J, half of it stays
    assert response.slip_energy["free"] == pytest.approx(9.0, rel=1e-13)


def test_what_overruns_is_struck_when_a_node_jumps_past_it():
    car = chain(pt.SpeedSource("motor", "a"), pt.OneWayClutch("free", "a", "b"), J=(1.0, 2.0))
    response = pt.simulate(car, T, {"motor_speed": pt.step(0.5, 3.0)}, {"b": 2.0})
    assert [(e.element, e.kind, e.heat) for e in response.events] == [("free", "lock", pytest.approx(1.0, rel=1e-13))]
    back = pt.simulate(car, T, {"motor_speed": pt.step(0.5, -3.0)}, {"b": 2.0})
    assert (back.events, back.slip_energy) == ((), {})


@pytest.mark.parametrize("seed", range(20))
def test_a_blow_changes_the_speeds_as_little_as_what_holds_and_what_blocks_permit(seed):
    random = np.random.default_rng(seed)
    names = [f"n{i}" for i in range(6)]
    J, speed = random.uniform(0.1, 2.0, 6), random.uniform(-10.0, 10.0, 6)
    joints, rows, blocks = [], [], []
    for i in range(1, 6):
        a, b = random.permutation([i, int(random.integers(i))]).tolist()
        row = np.zeros(6)
        row[a], row[b] = 1.0, -1.0
        if random.random() < 0.4 or i == 1:
            joints.append(pt.DogClutch(f"d{i}", names[a], names[b]))
        else:
            a, b = (a, b) if speed[a] < speed[b] else (b, a)  # the driven side is ahead
            row = np.where(np.arange(6) == a, 1.0, np.where(np.arange(6) == b, -1.0, 0.0))
            joints.append(pt.OneWayClutch(f"f{i}", names[a], names[b]))
        rows.append(row)
        blocks.append(isinstance(joints[-1], pt.OneWayClutch))
    car = pt.Driveline(*(pt.Inertia(n, J=float(j)) for n, j in zip(names, J, strict=True)), *joints)
    inputs = {f"{e.name}_engaged": pt.step(0.5, 1.0) for e in joints if isinstance(e, pt.DogClutch)}
    response = pt.simulate(car, T, inputs, dict(zip(names, speed, strict=True)))
    # least change of the speeds, weighed by the inertias (Moreau), by its dual
    S = np.array(rows) / np.sqrt(J)
    low = np.where(blocks, 0.0, -np.inf)
    blow = scipy.optimize.lsq_linear(S.T, np.sqrt(J) * speed, (low, np.inf), method="bvls", tol=1e-15).x
    expected = speed - S.T @ blow / np.sqrt(J)
    assert [response.final.speed[n] for n in names] == pytest.approx(expected, rel=1e-9, abs=1e-9)
    lost = 0.5 * (J @ speed**2 - J @ expected**2)
    assert sum(response.slip_energy.values()) == pytest.approx(lost, rel=1e-9, abs=1e-9)
