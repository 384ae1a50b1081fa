"""Balanced reduction and modal truncation.

Of reduction/balanced.
"""

import re
import warnings

import numpy as np
import pytest
import scipy.linalg

import powertrain_ctrl as pt
from powertrain_ctrl.base.systems import linear_system
from powertrain_ctrl.reduction.balanced import INTEGRATOR, _modal

IO = {"inputs": "engine_torque", "outputs": "vehicle_acceleration"}
CAR = pt.examples.conventional()


@pytest.mark.parametrize(("state", "f1", "band", "rmse"), [("closed", 1e-3, 0.01, 0.004), ("open", 1e-3, 0.002, 0.003)])
def test_balanced_order_two_is_as_good_as_it_promises(state, f1, band, rmse):
    car = pt.examples.conventional(damping=state)
    car = car if state == "closed" else car.release("clutch")
    driving = car.part("vehicle").nodes[0]
    model = pt.reduced(car, 2, inputs=f"{driving}_torque", outputs="vehicle_acceleration")
    error = pt.compare_models(car, {"balanced": model})["balanced"]
    assert error.order == 2
    assert abs(error.frequency_error) <= f1
    assert error.band_error <= band
    assert error.rmse[0.1] <= rmse


def gain(G, omega):
    s = 1j * np.atleast_1d(omega)[:, None, None]
    return G.C @ np.linalg.solve(s * np.eye(G.nstates) - G.A, G.B.astype(complex)[None]) + G.D


@pytest.mark.parametrize("order", [2, 4, 6, 8])
def test_balanced_error_is_below_twice_the_values_left_out(order):
    full, low = pt.state_space(CAR, **IO), pt.reduced(CAR, order, **IO)
    omega = np.geomspace(0.1, 2e4, 3000)
    error = np.abs(gain(full, omega) - gain(low, omega)).max()
    left_out = pt.hankel_singular_values(CAR, **IO)[order:].sum()
    assert error <= 2.0 * left_out * (1 + 1e-6)
    assert float(low.dcgain()) == pytest.approx(float(full.dcgain()), rel=1e-9)


@pytest.mark.parametrize("order", [3, 5, 7])
def test_what_is_left_of_speeds_beside_their_integrator_is_bounded_too(order):
    signals = {"inputs": "engine_torque", "outputs": ["engine_speed", "vehicle_speed", "drive_shafts_twist"]}
    full, low = pt.state_space(CAR, **signals), pt.reduced(CAR, order, **signals)
    omega = np.geomspace(0.1, 2e4, 1000)
    error = np.linalg.norm(gain(full, omega) - gain(low, omega), axis=(1, 2)).max()  # of one input
    assert error <= 2.0 * pt.hankel_singular_values(CAR, **signals)[order - 1 :].sum() * (1 + 1e-6)


def test_hankel_values_are_those_measured():
    closed = pt.hankel_singular_values(CAR, "engine_torque", "vehicle_acceleration")
    np.testing.assert_allclose(closed[:4], [0.04453, 0.03655, 0.00226, 0.00206], atol=6e-6)
    launching = pt.examples.conventional(damping="open").release("clutch")
    opened = pt.hankel_singular_values(launching, "clutch_secondary_torque", "vehicle_acceleration")
    np.testing.assert_allclose(opened[:4], [0.1658, 0.1531, 0.0023, 0.0016], atol=6e-5)


@pytest.mark.parametrize("method", ["balanced", "modal"])
def test_the_integrator_of_a_speed_is_kept_exactly(method):
    outputs = ["engine_speed", "vehicle_speed"]
    low = pt.reduced(CAR, 3, method, "engine_torque", outputs)
    total = (0.3 + 0.05 + 0.1 + 0.03 + 0.05 / 36) * 324 + 4 + 2000 * 0.35**2
    assert np.count_nonzero(low.poles() == 0.0) == 1
    omega = 1e-3
    np.testing.assert_allclose(
        (1j * omega * gain(low, omega)[0, :, 0]).real, [324 / total, 18 * 0.35 / total], rtol=1e-6
    )


def test_modal_truncation_is_the_sum_of_the_slow_modes_and_the_static_rest():
    undamped = pt.examples.conventional(damping=None)
    for name, k in (
        ("drive_shafts", 3.44e4),
        ("tyres", 9.8e5),
        ("damper_spring", 2e3),
        ("clutch_shaft", 5e4),
        ("input_shaft", 1e6),
        ("output_shaft", 1e6),
    ):
        undamped = undamped.replace(name, damping=1e-3 * k)
    m, modes = pt.assemble(undamped), pt.modes(undamped)
    shapes = modes.shapes / np.sqrt(np.sum(modes.shapes * (m.J @ modes.shapes), axis=0))
    i, j = m.nodes.index("engine"), m.nodes.index("vehicle")
    low = pt.reduced(undamped, 4, "modal", "engine_torque", "vehicle_acceleration")
    for s in (3j, 16j, 90j, 200j):
        rigid = shapes[i, 0] * shapes[j, 0]
        slow = sum(
            shapes[i, k] * shapes[j, k] * s**2 / (s**2 + 1e-3 * w**2 * s + w**2)
            for k, w in enumerate(modes.omega[1:3], start=1)
        )
        assert gain(low, s.imag)[0, 0, 0] == pytest.approx(rigid + slow, rel=1e-6)  # the rest is 0 at rest


def test_full_order_is_the_model_itself_and_mimo_keeps_its_names():
    full = pt.state_space(CAR, **IO)
    assert pt.reduced(CAR, full.nstates, **IO).nstates == full.nstates
    low = pt.reduced(
        CAR, 5, inputs=["engine_torque", "vehicle_force"], outputs=["engine_speed", "vehicle_acceleration"]
    )
    assert low.input_labels == ["engine_torque", "vehicle_force"]
    assert low.output_labels == ["engine_speed", "vehicle_acceleration"]
    assert low.nstates == 5


WRONG = [
    ({"order": 1, "outputs": "engine_speed"}, "order = 1, permitted: 2 to 13 (1 integrators in 13 states)"),
    ({"order": 13, **IO}, "order = 13, permitted: 1 to 12"),
    ({"order": 2.0, **IO}, "order = 2.0, permitted"),
    ({"order": 1, "method": "modal", **IO}, "order would split the pole pair"),
    ({"order": 2, "method": "krylov", **IO}, 'method = \'krylov\', permitted: "balanced", "modal"'),
    ({"order": 12, "method": "krylov", **IO}, 'method = \'krylov\', permitted: "balanced", "modal"'),
    ({"order": True, **IO}, "order = True, permitted: 1 to 12"),
    ({"order": 0, **IO}, "order = 0, permitted: 1 to 12"),
]


@pytest.mark.parametrize(("options", "message"), WRONG)
def test_impossible_orders_say_why(options, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)):
        pt.reduced(CAR, **{"inputs": "engine_torque", **options})


def test_a_numpy_integer_is_an_order():
    assert pt.reduced(CAR, np.int64(2), **IO).nstates == 2


UNDAMPED = "the mode at 2.638 Hz is undamped, so its Hankel singular value is infinite"


def test_an_undamped_mode_has_no_hankel_value_but_can_be_truncated():
    undamped = pt.examples.conventional(damping=None)
    with pytest.raises(pt.PowertrainError, match=UNDAMPED):
        pt.hankel_singular_values(undamped, **IO)
    with pytest.raises(pt.PowertrainError, match=UNDAMPED):
        pt.reduced(undamped, 2, **IO)
    low = pt.reduced(undamped, 2, "modal", **IO)
    assert low.nstates == 2
    assert np.abs(low.poles()).max() / (2 * np.pi) == pytest.approx(2.63774, abs=1e-4)  # (2.12)


def test_integrator_gain_of_a_speed_is_one_over_the_total_inertia():
    """The integrator stands first and alone, so its gain can be read off."""
    total = (0.3 + 0.05 + 0.1 + 0.03 + 0.05 / 36) * 324 + 4 + 2000 * 0.35**2
    for method in ("balanced", "modal"):
        low = pt.reduced(CAR, 3, method, "engine_torque", ["engine_speed", "wheels_speed", "vehicle_speed"])
        assert not low.A[0].any()
        assert not low.A[:, 0].any()
        np.testing.assert_allclose(low.C[:, 0] * low.B[0, 0], [324 / total, 18 / total, 18 * 0.35 / total], rtol=1e-11)


def test_two_integrators_where_an_open_clutch_parts_the_car():
    launching = pt.examples.conventional(damping="open").release("clutch")
    signals = {"inputs": ["engine_torque", "clutch_secondary_torque"], "outputs": ["engine_speed", "vehicle_speed"]}
    low = pt.reduced(launching, 4, **signals)
    assert np.count_nonzero(low.poles() == 0.0) == 2
    omega = 1e-4
    rest = (1j * omega * gain(low, omega)[0]).real
    geared = (0.01 + 0.03 + 0.05 / 36) * 324 + 4 + 2000 * 0.35**2
    np.testing.assert_allclose(rest, np.diag([1 / (0.3 + 0.05 + 0.09), 18 * 0.35 / geared]), rtol=1e-6, atol=1e-9)


MIMO = {"inputs": ["engine_torque", "vehicle_force"], "outputs": ["engine_acceleration", "vehicle_acceleration"]}


def gramian_factors(G):
    """Factors of the Gramians, summed up in modal coordinates: ``P_ij = -(b b^H)_ij / (s_i + conj s_j)``."""
    values, V = np.linalg.eig(G.A)
    b, c = np.linalg.solve(V, G.B.astype(complex)), G.C @ V
    P = V @ (-(b @ b.conj().T) / (values[:, None] + values.conj()[None, :])) @ V.conj().T
    Vi = np.linalg.inv(V)
    Q = Vi.conj().T @ (-(c.conj().T @ c) / (values.conj()[:, None] + values[None, :])) @ Vi
    return [v * np.sqrt(np.maximum(w, 0.0)) for w, v in map(scipy.linalg.eigh, (P.real, Q.real))]


@pytest.mark.parametrize("signals", [IO, MIMO])
def test_hankel_values_by_factors_of_the_gramians(signals):
    G = pt.state_space(CAR, **signals)
    _, (scale, _) = scipy.linalg.matrix_balance(G.A, permute=False, separate=True)
    G.A, G.B, G.C = G.A * scale / scale[:, None], G.B / scale[:, None], G.C * scale
    controllable, observable = gramian_factors(G)
    expected = scipy.linalg.svdvals(observable.T @ controllable)
    np.testing.assert_allclose(pt.hankel_singular_values(CAR, **signals)[:6], expected[:6], rtol=1e-5)


@pytest.mark.parametrize("signals", [IO, MIMO])
def test_all_hankel_values_in_sixty_digits(signals):
    """From the eigenvectors of A in arithmetic of 60 digits; the last values are 1e-9 of the first."""
    mp = pytest.importorskip("mpmath").mp
    before, mp.dps = mp.dps, 60
    try:
        G = pt.state_space(CAR, **signals)
        n = G.nstates
        values, V = mp.eig(mp.matrix(G.A.tolist()))
        b, c = V**-1 * mp.matrix(G.B.tolist()), mp.matrix(G.C.tolist()) * V
        P, Q = b * b.H, c.H * c
        for i in range(n):
            for j in range(n):
                P[i, j] /= -(values[i] + mp.conj(values[j]))
                Q[i, j] /= -(mp.conj(values[i]) + values[j])
        squares = mp.eig(P * Q, left=False, right=False)
        expected = sorted((float(mp.sqrt(mp.re(x))) for x in squares), reverse=True)
    finally:
        mp.dps = before
    found = pt.hankel_singular_values(CAR, **signals)
    np.testing.assert_allclose(found[:4], expected[:4], rtol=1e-10)
    np.testing.assert_allclose(found, expected, rtol=1e-6)


@pytest.mark.parametrize("order", [2, 4, 6, 9])
def test_balanced_error_of_several_inputs_and_outputs_is_bounded_too(order):
    full, low = pt.state_space(CAR, **MIMO), pt.reduced(CAR, order, **MIMO)
    difference = gain(full, np.geomspace(0.1, 2e4, 3000)) - gain(low, np.geomspace(0.1, 2e4, 3000))
    error = np.linalg.svd(difference, compute_uv=False)[:, 0].max()
    assert error <= 2.0 * pt.hankel_singular_values(CAR, **MIMO)[order:].sum() * (1 + 1e-6)
    np.testing.assert_allclose(low.dcgain(), full.dcgain(), rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("method", ["balanced", "modal"])
@pytest.mark.parametrize("state", ["closed", "open"])
@pytest.mark.parametrize("order", [2, 4, 8])
def test_static_gain_is_one_over_the_inertia_and_the_model_is_stable(method, state, order):
    car = pt.examples.conventional(damping=state)
    behind = [0.3, 0.05, 0.1, 0.03] if state == "closed" else [0.01, 0.03]
    car = car if state == "closed" else car.release("clutch")
    total = (sum(behind) + 0.05 / 36) * 324 + 249
    try:
        low = pt.reduced(car, order, method, f"{car.part('vehicle').nodes[0]}_torque", "vehicle_acceleration")
    except pt.PowertrainError as error:
        assert "order would split the pole pair" in str(error)  # noqa: PT017
        return
    assert low.nstates == order
    assert (low.poles().real < 0.0).all()
    assert float(low.dcgain()) == pytest.approx(18 * 0.35 / total, rel=1e-8)


def star(arms, **values):
    elements = [pt.Inertia("hub", J=1.0)]
    for i in range(arms):
        elements += [pt.Inertia(f"arm{i}", J=0.5), pt.SpringDamper(f"s{i}", "hub", f"arm{i}", **values)]
    return pt.Driveline(*elements)


STAR = star(3, stiffness=100.0, damping=0.2)


def star_modes(s, of_hub):
    """Driving-point responses by hand: arms against each other at k/J, all against the hub at k (1/J + 3/hub)."""
    stiffness = 100.0 + 0.2 * s
    inner = s**2 / (s**2 + stiffness / 0.5)
    outer = s**2 / (s**2 + stiffness * (1 / 0.5 + 3.0))
    if of_hub:
        return 0.4 - 0.4 * outer  # hub torque to arm acceleration
    return 0.4 + (2 / 3) * 2.0 * inner + (2.0 / 3 - 0.4) * outer


@pytest.mark.parametrize("torque", ["hub", "arm0"])
def test_equal_branches_reduce_to_the_modes_that_matter(torque):
    signals = {"inputs": f"{torque}_torque", "outputs": "arm0_acceleration"}
    hankel = pt.hankel_singular_values(STAR, **signals)
    seen = 2 if torque == "hub" else 4
    assert hankel[seen - 1] > 0.1
    assert (hankel[seen:] < 1e-6 * hankel[0]).all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        exact = pt.reduced(STAR, 5, **signals)  # more than there is to keep
    assert exact.nstates <= 5
    omega = np.array([0.3, 9.0, 14.1, 20.0, 22.4, 60.0])
    for low in (exact, pt.reduced(STAR, seen, **signals)):
        for w, value in zip(omega, gain(low, omega)[:, 0, 0], strict=True):
            assert value == pytest.approx(star_modes(1j * w, torque == "hub"), rel=1e-6)


def test_modal_truncation_between_two_equal_pole_pairs_splits_none():
    low = pt.reduced(STAR, 2, "modal", "arm0_torque", "arm0_acceleration")
    np.testing.assert_allclose(np.abs(low.poles()), 200.0**0.5, rtol=1e-9)
    for order in (1, 3, 5):
        with pytest.raises(pt.PowertrainError, match="order would split the pole pair"):
            pt.reduced(STAR, order, "modal", "arm0_torque", "arm0_acceleration")
    four = pt.reduced(STAR, 4, "modal", "arm0_torque", "arm0_acceleration")
    for w in (0.3, 9.0, 14.1, 20.0):
        outer = star_modes(1j * w, False) - (2.0 / 3 - 0.4) * (-(w**2)) / (-(w**2) + (100 + 0.2j * w) * 5)
        assert gain(four, w)[0, 0, 0] == pytest.approx(outer, rel=1e-9)


def test_full_order_answers_as_the_model():
    full = pt.state_space(CAR, **MIMO)
    same = pt.reduced(CAR, full.nstates, **MIMO)
    omega = np.geomspace(0.1, 1e4, 50)
    np.testing.assert_array_equal(gain(full, omega), gain(same, omega))


def test_a_body_alone_is_its_own_integrator():
    body = pt.Driveline(pt.Inertia("a", J=2.0))
    low = pt.reduced(body, 1, outputs="a_speed")
    assert low.C[0, 0] * low.B[0, 0] == pytest.approx(0.5, rel=1e-15)
    assert pt.hankel_singular_values(body, outputs="a_speed").size == 0


@pytest.mark.parametrize(("share", "integrators"), [(0.1, 1), (10.0, 0)])
def test_a_slow_pole_is_an_integrator_below_the_tolerance(share, integrators):
    """Two bodies, the one with a drag that stops it at `share` times 1e-10 of the rate of the other."""
    fast = 1e4
    car = pt.Driveline(
        pt.Inertia("slow", J=1.0),
        pt.Drag("drag", "slow", damping=share * INTEGRATOR * fast),
        pt.Inertia("fast", J=1.0),
        pt.Drag("brake", "fast", damping=fast),
    )
    low = pt.reduced(car, 2, "modal", ["slow_torque", "fast_torque"], ["slow_speed", "fast_speed"])
    assert low.nstates == 2
    with pytest.raises(pt.PowertrainError, match=rf"\({integrators} integrators in 2 states\)"):
        pt.reduced(car, 3, "modal", ["slow_torque", "fast_torque"], ["slow_speed", "fast_speed"])


@pytest.mark.parametrize(("zeta", "decays"), [(1e-14, False), (1e-9, True)])
def test_a_mode_decays_from_the_tolerance_on(zeta, decays):
    w = 20.0
    damping = 2.0 * zeta * w
    car = pt.Driveline(pt.Inertia("a", J=1.0), pt.Drag("mount", "a", stiffness=w**2, damping=damping))
    if decays:
        # of 1 / (s^2 + 2 zeta w s + w^2) both are nearly 1 / (4 zeta w^2)
        values = pt.hankel_singular_values(car, "a_torque", "mount_twist")
        np.testing.assert_allclose(values, 1.0 / (4.0 * zeta * w**2), rtol=1e-5)
    else:
        with pytest.raises(pt.PowertrainError, match=r"the mode at 3\.183 Hz is undamped"):
            pt.hankel_singular_values(car, "a_torque", "mount_twist")


@pytest.mark.parametrize("shift", [-1e-13, 0.0, 1e-13])
def test_a_critically_damped_mode_is_never_split(shift):
    """Whether rounding makes it a pair or two real poles, at 10 rad/s beside one pole each at 1 and 1000 rad/s."""
    A = scipy.linalg.block_diag(-1.0, [[0.0, 1.0], [-100.0, -20.0 * (1.0 + shift)]], -1000.0)
    system = linear_system(A, np.array([[1.0, 0.0, 1.0, 1.0]]).T, np.ones((1, 4)), [[0.0]])
    for order in (1, 3):
        assert _modal(system, order).nstates == order
    with pytest.raises(pt.PowertrainError, match="order would split the pole pair"):
        _modal(system, 2)


@pytest.mark.parametrize("shift", [-1e-12, 0.0, 1e-12])
def test_of_equal_pole_pairs_the_one_that_is_driven_is_kept(shift):
    """Of three equal arms two modes have one frequency; pushed at arm 0, arms 1 and 2 swing alike or not at all."""
    car = STAR.replace("s1", stiffness=100.0 * (1.0 + shift))
    low = pt.reduced(car, 2, "modal", "arm0_torque", "arm0_acceleration")
    for w in (0.3, 9.0, 14.1, 20.0):
        inner = -(w**2) / (-(w**2) + (100.0 + 0.2j * w) / 0.5)
        assert gain(low, w)[0, 0, 0] == pytest.approx(0.4 + (2.0 / 3.0) * 2.0 * inner, rel=1e-6)
