"""Balanced reduction and modal truncation; comparison of models."""

import re

import control
import numpy as np
import pytest
import scipy.integrate

import powertrain_ctrl as pt

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
    assert error <= 2.0 * pt.hankel_singular_values(CAR, **{"inputs": IO["inputs"], "outputs": IO["outputs"]})[
        order:
    ].sum() * (1 + 1e-6)
    assert float(low.dcgain()) == pytest.approx(float(full.dcgain()), rel=1e-9)


def test_hankel_values_are_those_measured_and_those_of_another_road():
    closed = pt.hankel_singular_values(CAR, "engine_torque", "vehicle_acceleration")
    np.testing.assert_allclose(closed[:4], [0.04453, 0.03655, 0.00226, 0.00206], atol=6e-6)
    launching = pt.examples.conventional(damping="open").release("clutch")
    opened = pt.hankel_singular_values(launching, "clutch_secondary_torque", "vehicle_acceleration")
    np.testing.assert_allclose(opened[:4], [0.1658, 0.1531, 0.0023, 0.0016], atol=6e-5)
    # SLICOT's square-root method on the unscaled system
    import slycot

    G = pt.state_space(CAR, **IO)
    hsv = slycot.ab09ad("C", "B", "S", G.nstates, 1, 1, G.A, G.B, G.C, nr=2)[4]
    np.testing.assert_allclose(closed[:4], hsv[:4], rtol=1e-6)


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
]


@pytest.mark.parametrize(("options", "message"), WRONG)
def test_impossible_orders_say_why(options, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)):
        pt.reduced(CAR, **{"inputs": "engine_torque", **options})


# --- comparison


def test_error_measures_by_another_road():
    """Frequency response by a dense impedance, ramp by DOP853, both from M, D, K."""
    model = pt.two_mass(CAR, "source")
    table = pt.compare_models(CAR, {"source": model}, ramps=[0.1])
    omega = 2 * np.pi * np.linspace(0.005, 10.0, 2000)

    def response(x):
        m = pt.assemble(x)
        i = m.nodes.index("vehicle")
        return np.array([-(w**2) * m.T[i] @ np.linalg.solve(m.K + 1j * w * m.D - w**2 * m.M, m.T[0]) for w in omega])

    a, b = response(CAR), response(model)
    error = table["source"]
    assert error.largest_error == pytest.approx(np.abs(a - b).max() / np.abs(a).max(), rel=1e-5)
    assert error.band_error == pytest.approx(np.linalg.norm(a - b) / np.linalg.norm(a), rel=1e-5)
    static = 18 * 0.35 / ((0.3 + 0.05 + 0.1 + 0.03 + 0.05 / 36) * 324 + 249)
    x, y = a / static, b / static
    chordal = np.abs(x - y) / np.sqrt((1 + np.abs(x) ** 2) * (1 + np.abs(y) ** 2))
    assert error.chordal_distance == pytest.approx(chordal.max(), rel=1e-5)

    def ramp(x):
        m = pt.assemble(x)
        n, i = len(m.coordinates), m.nodes.index("vehicle")
        Mi = np.linalg.inv(m.M)

        def rate(t, q):
            torque = 250.0 * min(t / 0.1, 1.0)
            return np.concatenate([q[n:], Mi @ (m.T[0] * torque - m.K @ q[:n] - m.D @ q[n:])])

        t = np.arange(0.0, 3.0005, 0.001)
        q = scipy.integrate.solve_ivp(rate, (0, 3), np.zeros(2 * n), "Radau", t, rtol=1e-7, atol=1e-9, max_step=0.02).y
        return np.array([m.T[i] @ rate(s, q[:, k])[n:] for k, s in enumerate(t)])

    assert error.rmse[0.1] == pytest.approx(np.sqrt(np.mean((ramp(CAR) - ramp(model)) ** 2)), rel=1e-3)


def test_the_model_itself_has_no_error():
    error = pt.compare_models(CAR, {"same": CAR, "full": pt.state_space(CAR)})
    for name in ("same", "full"):
        assert error[name].band_error < 1e-6
        assert abs(error[name].frequency_error) < 1e-9
        assert max(error[name].rmse.values()) < 1e-6


def test_table_prints_and_converts():
    table = pt.compare_models(CAR, {"modal": pt.two_mass(CAR), "balanced": pt.reduced(CAR, 2, **IO)})
    columns = table.to_dict()
    assert {len(values) for values in columns.values()} == {2}
    assert columns["J1"][1] is None
    assert "modal" in repr(table)
    assert "<table>" in table._repr_html_()


COMPARISON_WRONG = [
    (
        {"models": {"bare": control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])}},
        'model "bare" has no signal "engine_torque"',
    ),
    ({"models": {}, "band": (5.0, 1.0)}, "band = (5.0, 1.0) Hz, permitted: 0 <= low < high"),
    ({"models": {}, "ramps": [0.0]}, "ramps = (0.0,) s, permitted"),
    ({"models": {}, "ramps": []}, "ramps = () s, permitted"),
]


@pytest.mark.parametrize(("options", "message"), COMPARISON_WRONG)
def test_impossible_comparisons_say_why(options, message):
    with pytest.raises(pt.PowertrainError, match=re.escape(message)):
        pt.compare_models(CAR, **options)
    with pytest.raises(pt.PowertrainError, match="one vehicle, there are 0"):
        pt.compare_models(pt.Driveline(pt.Inertia("a", J=1.0)), {})
