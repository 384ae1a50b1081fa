"""Modes and poles.

Of linear/modal, linear/spectrum, linear/solved, linear/mass.
"""

import dataclasses
import math
from itertools import pairwise

import by_hand
import mpmath
import numpy as np
import pytest
import scipy.linalg
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from strategies import drivelines, log_floats, ratios, trees

import powertrain_ctrl as pt


def chain(J, k, d=None, order=None):
    n = len(J)
    d = np.zeros(n - 1) if d is None else d
    elements = [pt.Inertia(f"n{i}", J=J[i]) for i in range(n)]
    elements += [pt.SpringDamper(f"s{i}", f"n{i}", f"n{i + 1}", stiffness=k[i], damping=d[i]) for i in range(n - 1)]
    return pt.Driveline(*(elements if order is None else [elements[i] for i in order]))


def exact_frequencies(J, k):
    """60 digits: eigenvalues of the mass-scaled stiffness."""
    with mpmath.workdps(60):
        n = len(J)
        K = mpmath.zeros(n)
        for i, stiffness in enumerate(k):
            for a, b, sign in ((i, i, 1), (i + 1, i + 1, 1), (i, i + 1, -1), (i + 1, i, -1)):
                K[a, b] += sign * mpmath.mpf(float(stiffness)) / mpmath.sqrt(mpmath.mpf(float(J[a])) * float(J[b]))
        values = mpmath.eigsy(K, eigvals_only=True)
        return np.array([float(mpmath.sqrt(abs(v))) for v in values])


@pytest.mark.parametrize("spread", [0.0, 6.0, 12.0])
@pytest.mark.parametrize("n", [7, 20, 50])
@pytest.mark.parametrize("shuffled", [False, True])
def test_frequencies_keep_twelve_digits_whatever_the_spread(n, spread, shuffled):
    random = np.random.default_rng(n + int(spread))
    J, k = 10.0 ** random.uniform(-2, 1, n), 1e3 * 10.0 ** random.uniform(0, spread, n - 1)
    order = random.permutation(2 * n - 1) if shuffled else None
    omega = pt.modes(chain(J, k, order=order)).omega
    assert omega[0] == 0.0
    np.testing.assert_allclose(omega[1:], np.sort(exact_frequencies(J, k))[1:], rtol=1e-12)


@pytest.mark.parametrize("spread", [0.0, 6.0, 12.0])
@pytest.mark.parametrize("seed", range(4))
def test_frequencies_of_geared_trees_keep_twelve_digits_whatever_the_spread(seed, spread):
    random = np.random.default_rng(seed)
    n = 15
    J, k = 10.0 ** random.uniform(-2, 1, n), 1e3 * 10.0 ** random.uniform(0, spread, n)
    ratio = random.choice([-6.0, 0.3, 1.0, 3.7], n)
    parent = [int(random.integers(0, max(i, 1))) for i in range(n)]
    elements = [pt.Inertia(f"n{i}", J=J[i]) for i in range(n)]
    for i in range(1, n):
        elements.append(pt.Gear(f"g{i}", f"n{parent[i]}", f"m{i}", ratio=ratio[i]))
        elements.append(pt.SpringDamper(f"s{i}", f"m{i}", f"n{i}", stiffness=k[i]))
    omega = pt.modes(pt.Driveline(*(elements[i] for i in random.permutation(len(elements))))).omega
    with mpmath.workdps(60):
        B = mpmath.zeros(n - 1, n)
        for i in range(1, n):
            root = mpmath.sqrt(mpmath.mpf(k[i]))
            B[i - 1, i] = -root / mpmath.sqrt(mpmath.mpf(J[i]))
            B[i - 1, parent[i]] = root / mpmath.mpf(ratio[i]) / mpmath.sqrt(mpmath.mpf(J[parent[i]]))
        values = mpmath.eigsy(B * B.T, eigvals_only=True)  # the springs' side has no zero
        exact = np.sort([float(mpmath.sqrt(v)) for v in values])
    assert omega[0] == 0.0
    np.testing.assert_allclose(omega[1:], exact, rtol=1e-12)


@given(trees())
def test_rigid_motions_are_exactly_zero_and_counted(car):
    modes = pt.modes(car)
    assert modes.n_rigid == 1
    assert modes.omega[0] == 0.0
    assert (modes.omega[1:] > 0.0).all()


@given(drivelines())
def test_rigid_motions_are_counted_by_rank(car):
    other = by_hand.matrices(car)
    springs = other.W[other.stiffness > 0.0]
    modes = pt.modes(car)
    assert modes.n_rigid == len(other.M) - (np.linalg.matrix_rank(springs) if springs.size else 0)
    assert (modes.omega[: modes.n_rigid] == 0.0).all()
    assert (modes.omega[modes.n_rigid :] > 0.0).all()


@given(drivelines())
def test_frequencies_and_shapes_are_those_of_dense_eigenvalues(car):
    other, modes = by_hand.matrices(car), pt.modes(car)
    values = scipy.linalg.eigh(other.K, other.M, eigvals_only=True)
    size = values[-1] or 1.0
    np.testing.assert_allclose(modes.omega**2, values, rtol=1e-9, atol=1e-11 * size)
    shapes = modes.shapes[[modes.nodes.index(node) for node in other.nodes]]
    motion = np.linalg.lstsq(other.Z, shapes, rcond=None)[0]
    np.testing.assert_allclose(other.Z @ motion, shapes, atol=1e-10)  # every shape keeps the gear ratios
    residual = other.K @ motion - other.M @ motion * modes.omega**2
    assert np.abs(residual).max() <= 1e-10 * max(np.abs(other.K).max(), 1.0)
    assert (np.abs(modes.shapes).max(axis=0) == 1.0).all()


@given(drivelines())
def test_energy_shares_add_up_to_one(car):
    modes = pt.modes(car)
    np.testing.assert_allclose(modes.kinetic_energy.sum(axis=0), 1.0, rtol=1e-9)
    np.testing.assert_allclose(modes.strain_energy[:, modes.n_rigid :].sum(axis=0), 1.0, rtol=1e-9)
    assert not modes.strain_energy[:, : modes.n_rigid].any()


@given(trees(damped=False), log_floats(-5.0, -3.0))
def test_damping_ratio_is_exact_for_proportional_damping(car, beta):
    for element in list(car):
        if isinstance(element, pt.SpringDamper):
            car = car.replace(element.name, damping=beta * element.stiffness)
    modes = pt.modes(car)
    np.testing.assert_allclose(modes.damping_ratio[1:], beta * modes.omega[1:] / 2.0, rtol=1e-9)
    assert np.isnan(modes.damping_ratio[0])


@given(trees(most=5))
def test_poles_are_the_roots_of_the_characteristic_equation(car):
    model = pt.assemble(car)
    L = np.linalg.cholesky(model.M)
    Kt, Dt = (np.linalg.solve(L, np.linalg.solve(L, X).T) for X in (model.K, model.D))
    n = len(Kt)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-Kt, -Dt]])
    size = np.abs(np.linalg.eigvals(A)).max()
    poles = pt.poles(car)
    assert np.count_nonzero(poles == 0.0) == 1  # of the double zero in angles one is left
    for s in poles[1:]:
        smallest = np.linalg.svd(s**2 * np.eye(n) + s * Dt + Kt, compute_uv=False)[-1]
        assert smallest <= 1e-9 * size * max(abs(s), 1.0)
    assert poles.sum().real == pytest.approx(-np.trace(Dt), rel=1e-8, abs=1e-10)


@given(drivelines())
def test_poles_of_any_driveline_satisfy_the_dense_equation_and_none_is_missing(car):
    other = by_hand.matrices(car)
    n = len(other.M)
    L = np.linalg.cholesky(other.M)
    Kt, Dt = (np.linalg.solve(L, np.linalg.solve(L, X).T) for X in (other.K, other.D))
    size = max(np.linalg.norm(Dt, 2), np.sqrt(np.linalg.norm(Kt, 2)), 1e-300)
    poles = pt.poles(car)
    for s in poles:
        smallest = np.linalg.svd(s**2 * np.eye(n) + s * Dt + Kt, compute_uv=False)[-1]
        assert smallest <= 1e-11 * size * max(size, abs(s))
    # of 2 n poles, one zero is left out for each motion that no spring resists
    rank = np.linalg.matrix_rank(other.W[other.stiffness > 0.0]) if (other.stiffness > 0.0).any() else 0
    free = n - (np.linalg.matrix_rank(other.W) if other.W.size else 0)
    assert len(poles) == n + rank
    assert np.count_nonzero(poles == 0.0) == free
    assert poles.sum() == pytest.approx(-np.trace(Dt), rel=1e-9, abs=1e-9 * size)
    assert (poles.real <= 1e-12 * size).all()


@given(trees(damped=False), log_floats(-4.0, 1.0))
def test_poles_of_proportional_damping_are_the_roots_of_each_mode_overdamped_or_not(car, beta):
    for element in list(car):
        if isinstance(element, pt.SpringDamper):
            car = car.replace(element.name, damping=beta * element.stiffness)
    omega = pt.modes(car).omega[1:]
    # away from critical damping, where a double root is known to half the digits only
    assume((np.abs(beta * omega / 2.0 - 1.0) > 1e-3).all())
    root = np.sqrt((beta * omega / 2.0).astype(complex) ** 2 - 1.0)
    fast = -omega * (beta * omega / 2.0 + root)
    expected = np.concatenate([[0.0], fast, omega**2 / fast])
    poles = pt.poles(car)
    assert len(poles) == len(expected)
    size = np.abs(expected).max()
    for s in expected:
        assert np.abs(poles - s).min() <= 1e-9 * abs(s) + 1e-12 * size


def test_undamped_poles_lie_on_the_axis():
    car = pt.examples.conventional(damping=None)
    assert not pt.poles(car).real.any()
    np.testing.assert_allclose(np.sort(pt.poles(car).imag)[-6:], pt.modes(car).omega[1:], rtol=1e-12)


def test_overdamped_poles_are_real_and_both_there():
    # J s^2 + d s + k with J = 1/2 reduced: s = -1 and -19 for k = 19/2, d = 10
    car = chain([1.0, 1.0], [9.5], [10.0])
    np.testing.assert_allclose(pt.poles(car), [0.0, -1.0, -19.0], atol=1e-12)


def test_a_damper_without_spring_has_a_single_real_pole():
    car = pt.Driveline(
        pt.Inertia("a", J=1.0), pt.Inertia("b", J=3.0), pt.SpringDamper("d", "a", "b", stiffness=0, damping=6)
    )
    np.testing.assert_allclose(pt.poles(car), [0.0, -8.0], atol=1e-12)
    assert pt.modes(car).n_rigid == 2


def test_drag_alone_leaves_no_zero_pole():
    car = pt.Driveline(pt.Inertia("a", J=2.0), pt.Drag("bearing", "a", damping=0.5))
    np.testing.assert_allclose(pt.poles(car), [-0.25])


def test_repeated_modes_have_damping_ratios_of_their_own():
    # Four equal branches, one of them damped more: within the triple frequency the dampers decide the shapes.
    hub = [pt.Inertia("hub", J=1.0)]
    branches = [
        element
        for i, d in enumerate((1.0, 1.0, 1.0, 3.0))
        for element in (
            pt.Inertia(f"b{i}", J=1.0),
            pt.SpringDamper(f"s{i}", "hub", f"b{i}", stiffness=100.0, damping=d),
        )
    ]
    modes = pt.modes(pt.Driveline(*hub, *branches))
    # shapes with the hub at rest: two see d = 1 alone, the third (1, 1, 1, -3)/sqrt(12) sees (3 * 1 + 9 * 3) / 12 = 2.5
    np.testing.assert_allclose(np.sort(modes.damping_ratio[1:4]), np.array([1.0, 1.0, 2.5]) / 20.0, rtol=1e-9)


@given(st.permutations([1.0, 2.0, 3.0, 5.0, 5.0]))
def test_dampers_choose_the_shapes_of_a_repeated_frequency(dampers):
    # Five equal arms, hub at rest: motions with sum 0. Within them the damping is diag(d) projected.
    arms = [
        element
        for i, d in enumerate(dampers)
        for element in (
            pt.Inertia(f"b{i}", J=1.0),
            pt.SpringDamper(f"s{i}", "hub", f"b{i}", stiffness=100.0, damping=d),
        )
    ]
    modes = pt.modes(pt.Driveline(pt.Inertia("hub", J=1.0), *arms))
    Z = scipy.linalg.null_space(np.ones((1, 5)))
    expected = np.linalg.eigvalsh((Z.T * dampers) @ Z) / 20.0
    np.testing.assert_allclose(np.sort(modes.damping_ratio[1:5]), expected, rtol=1e-9)
    shapes = modes.shapes[1:, 1:5] / np.linalg.norm(modes.shapes[1:, 1:5], axis=0)
    np.testing.assert_allclose((shapes.T * dampers) @ shapes, np.diag(20.0 * modes.damping_ratio[1:5]), atol=1e-9)


def test_repeated_frequency_of_a_star_has_independent_shapes_at_full_accuracy():
    # hub J = 4, four arms J = 1, k = 100: three times sqrt(k / J), once sqrt(k (1 / J + 4 / hub))
    arms = [
        e
        for i in range(4)
        for e in (pt.Inertia(f"b{i}", J=1.0), pt.SpringDamper(f"s{i}", "hub", f"b{i}", stiffness=100.0))
    ]
    modes = pt.modes(pt.Driveline(pt.Inertia("hub", J=4.0), *arms))
    np.testing.assert_allclose(modes.omega, [0.0, 10.0, 10.0, 10.0, 200.0**0.5], rtol=1e-14)
    assert np.linalg.matrix_rank(modes.shapes) == 5
    np.testing.assert_allclose(modes.shapes[modes.nodes.index("hub"), 1:4], 0.0, atol=1e-14)
    assert not modes.damping_ratio[1:].any()


def test_springs_to_ground_leave_no_rigid_motion():
    # two equal bodies, each held by k, coupled by kc: sqrt(k / J) and sqrt((k + 2 kc) / J)
    car = pt.Driveline(
        pt.Inertia("a", J=2.0),
        pt.Inertia("b", J=2.0),
        pt.Drag("hold_a", "a", damping=0.0, stiffness=50.0),
        pt.Drag("hold_b", "b", damping=0.0, stiffness=50.0),
        pt.SpringDamper("coupling", "a", "b", stiffness=75.0),
    )
    modes = pt.modes(car)
    assert modes.n_rigid == 0
    np.testing.assert_allclose(modes.omega, [5.0, 10.0], rtol=1e-14)


def test_two_gears_that_disagree_over_springs_are_wound_up_not_locked():
    # twists (a / 2 - b) and (a - b): K = k1 [[1/4, -1/2], [-1/2, 1]] + k2 [[1, -1], [-1, 1]]
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("b", J=1.0),
        pt.Gear("gear", "a", "x", ratio=2.0),
        pt.SpringDamper("direct", "a", "b", stiffness=7.0),
        pt.SpringDamper("geared", "x", "b", stiffness=3.0),
    )
    K = 3.0 * np.array([[0.25, -0.5], [-0.5, 1.0]]) + 7.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    modes = pt.modes(car)
    assert modes.n_rigid == 0
    np.testing.assert_allclose(modes.omega**2, np.linalg.eigvalsh(K), rtol=1e-12)
    with pytest.raises(pt.TopologyError, match="no single ratio"):
        _ = modes.reflected_shapes


@pytest.mark.parametrize("first", [3.6, 49 / 13, 1 / 3, 1.9, 13 / 49])
@pytest.mark.parametrize("second", [1.7, 4.9, 0.3])
def test_a_spring_across_rigidly_geared_parts_does_not_twist_by_rounding(first, second):
    # c and d turn alike, over two gears and over one; what remains is d with e on a spring of 100 N m/rad
    car = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in "acde"),
        pt.Gear("g1", "a", "b", ratio=first),
        pt.Gear("g2", "b", "c", ratio=second),
        pt.Gear("g3", "a", "d", ratio=first * second),
        pt.SpringDamper("idle", "c", "d", stiffness=1e6, damping=1.0),
        pt.SpringDamper("shaft", "d", "e", stiffness=100.0),
    )
    modes = pt.modes(car)
    assert (modes.n_rigid, modes.omega[0]) == (1, 0.0)
    assert modes.omega[1] == pytest.approx(np.sqrt(100.0 * (1.0 + 1.0 / (2.0 + (first * second) ** 2))), rel=1e-12)
    assert len(pt.poles(car)) == pt.state_space(car).nstates == 3


def test_free_planetary_has_two_rigid_motions_and_no_reflection():
    car = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in ("sun", "ring", "carrier", "wheel")),
        pt.Planetary("gears", "sun", "ring", "carrier", ratio=2.0),
        pt.SpringDamper("shaft", "carrier", "wheel", stiffness=10.0),
    )
    modes = pt.modes(car)
    assert modes.n_rigid == 2
    with pytest.raises(pt.TopologyError, match="no single ratio"):
        _ = modes.reflected_shapes


def test_brake_on_the_ring_makes_a_planetary_a_gear():
    def geared(*elements):
        return pt.modes(pt.Driveline(pt.Inertia("sun", J=1.0), pt.Inertia("wheel", J=5.0), *elements)).omega

    planetary = geared(
        pt.Planetary("gears", "sun", "ring", "carrier", ratio=2.0),
        pt.Constraint("brake", {"ring": 1.0}),
        pt.SpringDamper("shaft", "carrier", "wheel", stiffness=10.0),
    )
    gear = geared(
        pt.Gear("gear", "sun", "carrier", ratio=3.0), pt.SpringDamper("shaft", "carrier", "wheel", stiffness=10.0)
    )
    np.testing.assert_allclose(planetary, gear, rtol=1e-14)


def test_loop_of_springs_against_dense_eigenvalues():
    J, k = [1.0, 2.0, 3.0], [100.0, 200.0, 300.0]
    ends = [(0, 1), (1, 2), (2, 0)]
    car = pt.Driveline(
        *(pt.Inertia(f"n{i}", J=J[i]) for i in range(3)),
        *(pt.SpringDamper(f"s{i}", f"n{a}", f"n{b}", stiffness=k[i]) for i, (a, b) in enumerate(ends)),
    )
    K = np.zeros((3, 3))
    for (a, b), stiffness in zip(ends, k, strict=True):
        K[a, a] += stiffness
        K[b, b] += stiffness
        K[a, b] -= stiffness
        K[b, a] -= stiffness
    np.testing.assert_allclose(pt.modes(car).omega[1:] ** 2, scipy.linalg.eigh(K, np.diag(J))[0][1:], rtol=1e-12)


def test_distributed_shaft_converges_to_the_wave_equation():
    # free-free shaft: omega = pi sqrt(k / J), from above with the consistent matrix, error of order 1/n^2
    n, k, J = 40, 1000.0, 2.0
    shafts = [pt.Shaft(f"s{i}", f"n{i}", f"n{i + 1}", stiffness=n * k, inertia=J / n) for i in range(n)]
    first = pt.modes(pt.Driveline(*shafts)).omega[1]
    assert first == pytest.approx(np.pi * np.sqrt(k / J), rel=3e-4)
    assert first > np.pi * np.sqrt(k / J)


@given(trees(most=5), ratios)
@settings(max_examples=25)
def test_poles_do_not_change_when_a_part_moves_through_a_gear(car, ratio):
    last = [e for e in car if isinstance(e, pt.SpringDamper)][-1]
    leaf = last.b
    if any(leaf in e.nodes for e in car if e.name not in (last.name, leaf)):
        return
    rest = [e for e in car if e.name not in (last.name, leaf)]
    J, k, d = car[leaf].J, last.stiffness, last.damping
    behind = pt.Driveline(
        *rest,
        pt.Gear("moved", last.a, "turned", ratio=ratio),
        pt.SpringDamper(last.name, "turned", leaf, stiffness=k * ratio**2, damping=d * ratio**2),
        pt.Inertia(leaf, J=J * ratio**2),
    )
    before, after = pt.modes(car), pt.modes(behind)
    np.testing.assert_allclose(after.omega, before.omega, rtol=1e-9)
    np.testing.assert_allclose(after.damping_ratio[1:], before.damping_ratio[1:], rtol=1e-6)


@given(trees(), log_floats(-3.0, 3.0))
def test_common_scale_of_inertia_and_stiffness_changes_nothing(car, scale):
    scaled = car
    for element in car:
        if isinstance(element, pt.Inertia):
            scaled = scaled.replace(element.name, J=element.J * scale)
        if isinstance(element, pt.SpringDamper):
            scaled = scaled.replace(element.name, stiffness=element.stiffness * scale, damping=element.damping * scale)
    np.testing.assert_allclose(pt.modes(scaled).omega, pt.modes(car).omega, rtol=1e-10)


def renamed(element, new):
    """The element with every name in it replaced."""
    values = {item.name: getattr(element, item.name) for item in dataclasses.fields(element)}
    return type(element)(**{key: new.get(v, v) if isinstance(v, str) else v for key, v in values.items()})


@given(drivelines(), st.randoms(use_true_random=False))
def test_order_and_names_of_the_elements_change_nothing(car, random):
    names = sorted({*car.nodes, *(element.name for element in car)})
    new = dict(zip(names, random.sample([f"x{i}" for i in range(len(names))], len(names)), strict=True))
    elements = [renamed(element, new) for element in car]
    random.shuffle(elements)
    before, after = pt.modes(car), pt.modes(pt.Driveline(*elements))
    np.testing.assert_allclose(after.omega, before.omega, rtol=1e-10, atol=0.0)
    one, two = pt.poles(car), pt.poles(pt.Driveline(*elements))
    assert len(one) == len(two)
    for exponent in (1, 2):  # sums of powers: the set, whatever its order
        size = (np.abs(one) ** exponent).sum()
        assert abs((one**exponent).sum() - (two**exponent).sum()) <= 1e-9 * size


@given(trees(), st.booleans())
def test_a_spring_turned_end_for_end_is_the_same_spring(car, all_of_them):
    springs = [e for e in car if isinstance(e, pt.SpringDamper)]
    turned = car
    for spring in springs if all_of_them else springs[:1]:
        turned = turned.replace(spring.name, a=spring.b, b=spring.a)
    np.testing.assert_allclose(pt.modes(turned).omega, pt.modes(car).omega, rtol=1e-10)


@given(drivelines(), st.floats(0.1, 0.9))
def test_a_body_in_two_halves_with_a_locked_clutch_between_is_the_whole(car, share):
    J = car["J0"].J
    halves = car.replace("J0", J=share * J)
    halves = pt.Driveline(
        *halves, pt.Inertia("half", J=(1.0 - share) * J), pt.Clutch("joint", "J0", "half", max_torque=1.0)
    )
    # all locked, also where that holds everything at rest
    before, after = pt.modes(car.lock()), pt.modes(halves.lock())
    np.testing.assert_allclose(after.omega, before.omega, rtol=1e-9, atol=0.0)
    assert after.n_rigid == before.n_rigid


def test_two_bodies_merged_by_a_locked_clutch_are_one():
    def pair(*elements):
        shaft = pt.SpringDamper("shaft", "b", "c", stiffness=50.0)
        return pt.modes(pt.Driveline(pt.Inertia("b", J=1.5), pt.Inertia("c", J=2.0), shaft, *elements)).omega

    locked = pair(pt.Inertia("a", J=0.5), pt.Clutch("clutch", "a", "b", max_torque=10.0))
    merged = pt.modes(
        pt.Driveline(pt.Inertia("b", J=2.0), pt.Inertia("c", J=2.0), pt.SpringDamper("s", "b", "c", stiffness=50.0))
    ).omega
    np.testing.assert_allclose(locked, merged, rtol=1e-14)


def test_table_prints_and_converts():
    modes = pt.modes(pt.examples.conventional())
    assert "drive_shafts" in repr(modes)
    assert "<table>" in modes._repr_html_()
    assert modes.to_dict()["damping_ratio"][0] is None
    assert len(modes) == 7


def test_two_thousand_inertias_are_no_special_case():
    random = np.random.default_rng(1)
    n = 2000
    modes = pt.modes(chain(10.0 ** random.uniform(-2, 1, n), 10.0 ** random.uniform(2, 6, n - 1)))
    assert (len(modes), modes.n_rigid, modes.omega[0]) == (n, 1, 0.0)
    # trace of the mass-scaled stiffness
    random = np.random.default_rng(1)
    J, k = 10.0 ** random.uniform(-2, 1, n), 10.0 ** random.uniform(2, 6, n - 1)
    trace = np.sum(k / J[:-1] + k / J[1:])
    assert np.sum(modes.omega**2) == pytest.approx(trace, rel=1e-10)


def test_ten_decades_of_stiffness_cost_a_long_chain_no_digits():
    """The product of all elastic ``omega**2`` of a free chain is ``prod(k) sum(J) / prod(J)`` (matrix-tree theorem)."""
    random = np.random.default_rng(0)
    n = 302  # beyond the size of the Jacobi method
    J, k = 10.0 ** random.uniform(-2, 2, n), np.sort(10.0 ** random.uniform(2, 12, n - 1))[::-1]
    expected = math.fsum([*np.log(k), *-np.log(J), math.log(math.fsum(J))])
    found = 2.0 * math.fsum(np.log(pt.modes(chain(J, k)).omega[1:]))
    assert found == pytest.approx(expected, abs=2e-11)  # rounding of the logarithms is 3e-12


def test_a_mode_that_cannot_oscillate_is_pointed_out():
    car = pt.examples.front_wheel_drive()
    assert repr(pt.modes(car)).splitlines()[-1].startswith("zeta >= 1 in mode 2: what oscillates there")
    assert "ζ ≥ 1 in mode 2" in pt.modes(car)._repr_html_()
    assert pt.modes(car.replace("tyres", stiffness=None, damping=0.0)).note == ""


def test_links_are_what_springs_and_rigid_connections_join():
    modes = pt.modes(pt.examples.conventional())
    heavy = [node for node, moves in zip(modes.nodes, modes.kinetic_energy.any(axis=1), strict=True) if moves]
    assert modes.links == tuple(pairwise(heavy))
    star = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in ("left", "hub", "right")),
        pt.SpringDamper("left_shaft", "hub", "left", stiffness=8.0),
        pt.SpringDamper("right_shaft", "hub", "right", stiffness=8.0),
    )
    assert pt.modes(star).links == (("left", "hub"), ("hub", "right"))


def test_the_table_names_the_springs_that_hold_half_of_the_strain_energy():
    pair = pt.Driveline(
        pt.Inertia("engine", J=1.0),
        pt.Inertia("wheels", J=2.0),
        *(pt.SpringDamper(f"{side}_shaft", "engine", "wheels", stiffness=50.0) for side in ("left", "middle", "right")),
    )
    rows = list(pt.modes(pair).rows())
    assert rows[1][3:] == ["67 %", "left_shaft, middle_shaft"]
    assert rows[0][3:] == ["–", "rigid motion"]


def test_links_pass_through_gears_and_end_at_a_differential():
    axle = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in ("engine", "case", "left", "right", "left_wheel", "right_wheel")),
        pt.Gear("final_drive", "engine", "case", ratio=4.0),
        pt.Planetary("differential", "left", "right", "case", ratio=1.0),
        pt.SpringDamper("left_shaft", "left", "left_wheel", stiffness=8.0),
        pt.SpringDamper("right_shaft", "right", "right_wheel", stiffness=9.0),
    )
    assert pt.modes(axle).links == (("engine", "case"), ("left", "left_wheel"), ("right", "right_wheel"))


def test_the_sign_of_a_shape_does_not_hang_on_rounding():
    # the left side swings against the right one, both by the same: the first node is +1
    for k in (100.0, 100.0 * (1.0 + 1e-15), 100.0 * (1.0 - 1e-15)):
        car = pt.Driveline(
            *(pt.Inertia(name, J=1.0) for name in ("left", "right")),
            pt.Inertia("hub", J=2.0),
            pt.SpringDamper("a", "hub", "left", stiffness=100.0, damping=1.0),
            pt.SpringDamper("b", "hub", "right", stiffness=k, damping=1.0),
        )
        shapes = pt.modes(car).shapes
        np.testing.assert_allclose(shapes[:2, 1], [1.0, -1.0], atol=1e-9)
        assert (np.abs(shapes).max(axis=0) == 1.0).all()


def test_poles_are_in_order_of_size_and_equal_ones_by_their_imaginary_part():
    branches = [
        part
        for name in "abc"
        for part in (pt.Inertia(name, J=1.0), pt.SpringDamper(f"s{name}", "hub", name, stiffness=25.0, damping=0.2))
    ]
    poles = pt.poles(pt.Driveline(pt.Inertia("hub", J=2.0), *branches))
    assert (poles[1:3].imag < 0.0).all()  # two branches against each other: a pair twice
    assert (poles[3:5].imag > 0.0).all()
    np.testing.assert_allclose(poles[1:5], [-0.1 - 1j * np.sqrt(24.99)] * 2 + [-0.1 + 1j * np.sqrt(24.99)] * 2)


def test_slow_poles_are_as_accurate_as_fast_ones():
    # a heavy body on a weak drag behind a stiff spring: slow pole -d / (J1 + J2) up to (d / omega J)^2
    car = pt.Driveline(
        pt.Inertia("a", J=1e-3),
        pt.SpringDamper("s", "a", "b", stiffness=1e9, damping=3.0),
        pt.Inertia("b", J=1e4),
        pt.Drag("d", "b", damping=1e-3),
    )
    assert pt.poles(car)[0].real == pytest.approx(-1e-3 / (1e4 + 1e-3), rel=1e-12)


def test_a_mode_that_no_damper_reaches_keeps_its_poles_on_the_axis():
    car = pt.Driveline(
        pt.Inertia("hub", J=2.0),
        pt.Inertia("left", J=1.0),
        pt.Inertia("right", J=1.0),
        pt.SpringDamper("a", "hub", "left", stiffness=100.0),
        pt.SpringDamper("b", "hub", "right", stiffness=100.0),
        pt.Drag("drag", "hub", damping=3.0),
    )
    poles = pt.poles(car)
    on_axis = poles[poles.real == 0.0]
    np.testing.assert_allclose(on_axis, [-10j, 10j], rtol=1e-12)
    assert (poles[poles.real != 0.0].real < -1e-3).all()


def test_a_mode_is_pointed_out_from_critical_damping_on():
    for zeta, note in ((1.0 - 1e-12, True), (1.0 + 1e-12, True), (1.0 - 1e-6, False)):
        car = pt.Driveline(pt.Inertia("a", J=1.0), pt.Drag("d", "a", stiffness=4.0, damping=4.0 * zeta))
        assert bool(pt.modes(car).note) == note


def test_a_rigid_motion_turns_everything_alike_where_bodies_share_inertia():
    car = pt.Driveline(
        pt.Inertia("a", J=0.3),
        pt.Shaft("first", "a", "b", stiffness=100.0, inertia=0.5, damping=1.0),
        pt.Shaft("second", "b", "c", stiffness=300.0, inertia=2.0),
        pt.Inertia("c", J=0.05),
    )
    result = pt.modes(car)
    np.testing.assert_allclose(result.shapes[:, 0], 1.0, rtol=1e-12)
    np.testing.assert_allclose(pt.poles(car)[0], 0.0)


def test_dampers_choose_the_shapes_of_the_highest_frequency_too():
    # k (a + b)^2 + k (a - b)^2 = 2 k (a^2 + b^2): any two shapes at right angles are modes; the damper has its own
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("b", J=1.0),
        pt.Compliance("sum", {"a": 1.0, "b": 1.0}, stiffness=50.0),
        pt.Compliance("difference", {"a": 1.0, "b": -1.0}, stiffness=50.0),
        pt.Compliance("damper", {"a": 0.6, "b": 0.8}, stiffness=0.0, damping=3.0),
    )
    assert sorted(pt.modes(car).damping_ratio.round(12)) == [0.0, 0.15]
