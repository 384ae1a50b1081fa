"""Modes and poles."""

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from strategies import log_floats, ratios, trees

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


@given(trees())
def test_rigid_motions_are_exactly_zero_and_counted(car):
    modes = pt.modes(car)
    assert modes.n_rigid == 1
    assert modes.omega[0] == 0.0
    assert (modes.omega[1:] > 0.0).all()


@given(trees())
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
    import scipy.linalg

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


@given(trees())
def test_order_of_the_elements_changes_nothing(car):
    np.testing.assert_allclose(pt.modes(pt.Driveline(*list(car)[::-1])).omega, pt.modes(car).omega, rtol=1e-10)


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
