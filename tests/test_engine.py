"""Torque of an engine and its orders: quadrature of many digits, closed integrals, phase sums.

Of orders/crank, orders/firing, orders/waves, orders/pressure, orders/gas, orders/response and orders/critical.
"""

import json
from dataclasses import replace
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest

import powertrain_ctrl as pt

REFERENCE = json.loads((Path(__file__).parent / "reference" / "breadth_cases.json").read_text())["cases"]
CASE = {case["name"]: case for case in REFERENCE}
CRANK = {"bore": 0.0825, "stroke": 0.0928, "rod": 0.144, "reciprocating_mass": 0.55}
PETROL = {"cylinders": 4, "firing_order": (1, 3, 4, 2), **CRANK}


def petrol(**values):
    return pt.Engine(**(PETROL | {"pressure": pt.orders.wiebe(mean_torque=150.0, compression_ratio=10.5)} | values))


def table(pressure, count=73, cycle=4.0 * np.pi):
    """A pressure table of so many angles, from a function."""
    angle = np.linspace(0.0, cycle, count)
    return angle, pressure(angle)


@pytest.mark.parametrize("ratio", CASE["reciprocating_inertia_torque_harmonics"]["by_lambda"])
def test_harmonics_of_the_inertia_torque_are_those_of_the_exact_slider_crank(ratio):
    wanted = CASE["reciprocating_inertia_torque_harmonics"]["by_lambda"][ratio]
    ratio_ = 1.0 / 3.0 if ratio == "0.333333" else float(ratio)  # the key is printed, the values are those of a third
    engine = pt.Engine(cylinders=1, stroke=0.1, rod=0.05 / ratio_, reciprocating_mass=0.8)
    orders, torque = engine.torque_orders(300.0, highest_order=6)
    sine = dict(zip(orders.tolist(), (-torque[:, 0].imag / (0.8 * 0.05**2 * 300.0**2)).tolist(), strict=True))
    for order, value in wanted.items():
        assert sine[float(order)] == pytest.approx(value, abs=1e-12)
    assert np.abs(torque[:, 0].real).max() < 1e-12 * np.abs(torque).max()
    assert not torque[orders % 1.0 == 0.5].any()


@pytest.mark.parametrize(
    ("name", "order"),
    [
        ("three_1_3_2", (1, 3, 2)),
        ("four_1_3_4_2", (1, 3, 4, 2)),
        ("six_1_5_3_6_2_4", (1, 5, 3, 6, 2, 4)),
    ],
)
def test_cylinders_that_fire_evenly_add_up_at_multiples_of_half_their_number(name, order):
    engine = pt.Engine(cylinders=len(order), firing_order=order, orders={n / 2: 1.0 for n in range(1, 13)})
    orders, torque = engine.torque_orders(1.0, highest_order=6)
    for n, value in zip(orders.tolist(), np.abs(torque[:, 0]).tolist(), strict=True):
        assert value == pytest.approx(CASE["phase_vector_sums"][name][str(n)], abs=1e-12)


def test_a_later_cylinder_lags_and_the_torque_is_that_of_the_cylinders_at_their_angles():
    amplitude = 30.0 - 40.0j
    engine = pt.Engine(cylinders=2, firing_angles=(0.0, 2.5), orders={1.5: amplitude})
    phi = np.linspace(0.0, 12.0, 7)
    expected = sum((amplitude * np.exp(1.5j * (phi - late))).real for late in (0.0, 2.5))
    np.testing.assert_allclose(engine.torque(phi, 100.0), expected, rtol=1e-14)
    _, torque = engine.torque_orders(100.0)
    np.testing.assert_allclose((torque[0, 0] * np.exp(1.5j * phi)).real, expected, rtol=1e-13)


def test_orders_add_up_to_the_torque():
    engine, speed = petrol(), pt.rpm(2500.0)
    phi = np.linspace(0.0, 4.0 * np.pi, 400)
    orders, torque = engine.torque_orders(speed, highest_order=80)
    total = engine.mean_torque() + (torque[:, 0] @ np.exp(1j * np.multiply.outer(orders, phi))).real
    wanted = engine.torque(phi, speed)
    # what is left are orders above 80, of the corners where valves open
    assert np.abs(total - wanted).max() < 2e-4 * np.abs(wanted).max()


@pytest.mark.parametrize("strokes", [2, 4])
def test_orders_of_a_pressure_table_are_those_of_quadrature(strokes):
    cycle = strokes * np.pi
    angle, pressure = table(lambda phi: 1e5 * (3.0 + 2.0 * np.cos(2 * np.pi * phi / cycle - 0.3)), 9, cycle)
    engine = pt.Engine(cylinders=1, bore=0.08, stroke=0.09, rod=0.14, pressure=(angle, pressure), strokes=strokes)
    orders, torque = engine.torque_orders(100.0, highest_order=3)
    with mp.workdps(25):
        r, l, area = mp.mpf(0.09) / 2, mp.mpf(0.14), mp.pi * mp.mpf(0.08) ** 2 / 4
        knots = [mp.mpf(a) for a in angle.tolist()]

        def gas(phi):
            i = min(int(mp.floor(phi / knots[1])), len(knots) - 2)
            share = (phi - knots[i]) / (knots[i + 1] - knots[i])
            p = (1 - share) * pressure[i] + share * pressure[i + 1] - 1e5
            s, c = mp.sin(phi), mp.cos(phi)
            return area * p * (r * s + r**2 * s * c / mp.sqrt(l**2 - (r * s) ** 2))

        for order, value in zip(orders.tolist(), torque[:, 0].tolist(), strict=True):
            wanted = 2 * mp.quad(lambda phi, n=order: gas(phi) * mp.expj(-n * phi), knots) / knots[-1]
            assert abs(mp.mpc(value) - wanted) < 1e-12 * abs(torque).max()
        mean = mp.quad(gas, knots) / knots[-1]
    assert engine.mean_torque() == pytest.approx(float(mean), rel=1e-12)
    assert orders[0] == 2.0 / strokes


def test_the_mean_torque_of_a_rectangle_is_its_area_over_the_cycle():
    # 20 bar during the power stroke, 1 bar otherwise: work is 19 bar times the swept volume
    angle = np.array([0.0, np.pi, np.pi, 4.0 * np.pi])
    engine = pt.Engine(**(PETROL | {"pressure": (angle, [20e5, 20e5, 1e5, 1e5])}))
    swept = 0.25 * np.pi * 0.0825**2 * 0.0928
    assert engine.mean_torque() == pytest.approx(4 * 19e5 * swept / (4.0 * np.pi), rel=1e-12)


@pytest.mark.parametrize("mean_torque", [150.0, 12.0, 400.0])
def test_the_closed_integral_of_a_computed_cycle_is_the_mean_torque_asked_for(mean_torque):
    engine = petrol(pressure=pt.orders.wiebe(mean_torque=mean_torque, compression_ratio=10.5))
    assert engine.mean_torque() == pytest.approx(mean_torque, rel=1e-12)
    angle, (motored, fired) = engine.pressure.table(engine.crank)
    # of pressure lines over the angle: the integral of p dV is less the sum of slope times integral of V
    nodes, weights = np.polynomial.legendre.leggauss(6)
    half = 0.5 * np.diff(angle)
    phi = angle[:-1, None] + half[:, None] * (1.0 + nodes)
    r, l, area = 0.0464, 0.144, 0.25 * np.pi * 0.0825**2
    volume = area * (r * (1.0 - np.cos(phi)) + l - np.sqrt(l**2 - (r * np.sin(phi)) ** 2))
    work = [-(np.diff(p) / 2.0 * (volume @ weights)).sum() for p in (motored, fired)]
    assert 4 * work[0] / (4 * np.pi) == pytest.approx(engine.mean_torque("fuel cut"), rel=1e-10)
    heat = (mean_torque * np.pi - work[0]) / work[1]
    assert 4 * (work[0] + heat * work[1]) / (4 * np.pi) == pytest.approx(mean_torque, rel=1e-10)
    for load in (mean_torque, 50.0):
        assert engine.mean_torque(load) == pytest.approx(load, rel=1e-10)


def test_a_computed_cycle_is_plausible():
    engine = petrol()
    orders, torque = engine.torque_orders(pt.rpm(1500.0), highest_order=8)
    found = dict(zip(orders.tolist(), np.abs(torque[:, 0]).round(0).tolist(), strict=True))
    assert {n: found[n] for n in (2.0, 4.0, 6.0, 8.0)} == {2.0: 225.0, 4.0: 111.0, 6.0: 39.0, 8.0: 15.0}
    assert -10.0 < engine.mean_torque("fuel cut") < 0.0


def test_a_load_of_each_speed_goes_with_it():
    engine, speeds = petrol(), pt.rpm(np.array([1000.0, 3000.0]))
    together = engine.torque_orders(speeds, load=[20.0, 200.0])[1]
    for i, load in enumerate((20.0, 200.0)):
        np.testing.assert_allclose(together[:, i], engine.torque_orders(speeds[i], load=load)[1][:, 0], rtol=1e-14)
    coasting = engine.torque_orders(speeds, load="fuel cut")[1]
    lowest = engine.torque_orders(speeds, load=engine.mean_torque("fuel cut") + 1e-12)[1]
    np.testing.assert_allclose(coasting, lowest, rtol=1e-11, atol=1e-10)


def test_a_v8_at_90_degrees_fires_evenly_and_a_v6_on_three_pins_does_not():
    orders = {n / 2: 1.0 for n in range(1, 13)}
    eight = {"cylinders": 8, "firing_order": (1, 5, 4, 8, 6, 3, 7, 2), "orders": orders}
    even, banked = pt.Engine(**eight), pt.Engine(bank_angle=np.pi / 2, **eight)
    np.testing.assert_allclose(banked.firing, even.firing, atol=1e-14)
    six = pt.Engine(cylinders=6, firing_order=(1, 6, 5, 4, 3, 2), bank_angle=np.pi / 2, orders=orders)
    found, torque = six.torque_orders(1.0, highest_order=6)
    for n, value in zip(found.tolist(), np.abs(torque[:, 0]).tolist(), strict=True):
        pairs = 3.0 if n % 1.5 == 0.0 else 0.0
        assert value == pytest.approx(pairs * abs(1 + np.exp(-0.5j * np.pi * n)), abs=1e-12)


@pytest.mark.parametrize("cylinders", range(1, 13))
def test_any_number_of_cylinders_on_one_crank_has_the_mean_torque_of_all(cylinders):
    pressure = pt.orders.wiebe(mean_torque=100.0)
    order = tuple(range(1, cylinders + 1))
    engine = pt.Engine(cylinders=cylinders, firing_order=order, **CRANK, pressure=pressure)
    assert engine.mean_torque() == pytest.approx(100.0, rel=1e-12)
    orders, torque = engine.torque_orders(200.0, highest_order=cylinders)
    lowest = orders[np.abs(torque[:, 0]) > 1e-9 * np.abs(torque).max()][0]
    assert lowest == cylinders / 2.0


def test_the_crank_train_is_an_inertia_with_the_mean_of_what_reciprocates():
    engine = petrol()
    with mp.workdps(20):
        r, l = mp.mpf(0.0464), mp.mpf(0.144)
        mean = mp.quad(
            lambda a: (r * mp.sin(a) + r**2 * mp.sin(a) * mp.cos(a) / mp.sqrt(l**2 - (r * mp.sin(a)) ** 2)) ** 2,
            mp.linspace(0, 2 * mp.pi, 9),
        ) / (2 * mp.pi)
    whole, one = engine.inertia("engine", J=0.2), engine.inertia("throw1", J=0.01, cylinders=1)
    assert (whole.name, one.name) == ("engine", "throw1")
    assert whole.J == pytest.approx(0.2 + 4 * 0.55 * float(mean), rel=1e-13)
    assert one.J == pytest.approx(0.01 + 0.55 * float(mean), rel=1e-13)
    assert pt.Engine(cylinders=1, orders={1.0: 1.0}).inertia("engine", J=0.2).J == 0.2
    with pytest.raises(pt.ParameterError, match="cylinders = 5, permitted: 1 to 4"):
        engine.inertia("engine", J=0.2, cylinders=5)


def test_orders_and_inertia_add_up():
    engine = pt.Engine(cylinders=1, stroke=0.09, rod=0.14, reciprocating_mass=0.5, orders={2.0: 10j})
    inertia = replace(engine, orders=None)
    difference = engine.torque_orders(200.0)[1] - inertia.torque_orders(200.0)[1]
    assert difference[3, 0] == pytest.approx(10j, rel=1e-12)
    assert np.abs(np.delete(difference, 3, axis=0)).max() == 0.0


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"firing_order": (1, 3, 3, 2)}, r"firing_order = \(1, 3, 3, 2\), permitted: each of 1 to 4 once"),
        ({"firing_order": (1, 2)}, "each of 1 to 4 once"),
        ({"firing_order": None}, "firing_order = None, permitted: given"),
        ({"firing_angles": (0.0, 1.0, 2.0, 3.0)}, "without firing_order and bank_angle"),
        ({"firing_angles": (0.0, 1.0), "firing_order": None}, "2 values' rad, permitted: one for each of 4 cylinders"),
        ({"firing_angles": (0.0, 1.0, 2.0, float("nan")), "firing_order": None}, r"firing_angles\[3\] = nan"),
        ({"cylinders": 13}, "cylinders = 13, permitted: <= 12"),
        ({"cylinders": 0}, "cylinders = 0, permitted: >= 1"),
        ({"bank_angle": 7.0}, "bank_angle = 7.0 rad, permitted: of at least four cylinders in pairs, < 6.28319 rad"),
        ({"cylinders": 3, "firing_order": (1, 3, 2), "bank_angle": 1.0}, "at least four cylinders in pairs"),
        ({"rod": 0.04}, "rod = 0.04 m, permitted: > 0.0464 m, half the stroke"),
        ({"bore": -1.0}, "bore = -1.0 m"),
        ({"stroke": None}, "stroke = None, permitted: given, or orders="),
        ({"pressure": None, "reciprocating_mass": None}, "reciprocating_mass = None"),
        ({"strokes": 3}, "strokes = 3, permitted: 2 or 4"),
        ({"strokes": 2}, "for strokes=4; of two strokes give a table"),
        ({"orders": {2.0: 1.0}}, "pressure and orders = 'both given'"),
        ({"pressure": None, "orders": {}}, "orders = {}, permitted: {order: complex torque}"),
        ({"pressure": None, "orders": {-2.0: 1.0}}, "order = -2.0, permitted: a multiple of 0.5, > 0"),
        ({"pressure": None, "orders": {float("nan"): 1.0}}, "order = nan"),
        ({"pressure": None, "orders": {0.7: 1.0}}, "order = 0.7, permitted: a multiple of 0.5"),
        ({"pressure": None, "orders": {0.0: 1.0}}, "order = 0.0"),
        ({"pressure": None, "orders": {"two": 1.0}}, "order = 'two'"),
        ({"pressure": None, "orders": {2.0: "much"}}, "torque of order 2 = 'much' N m, permitted: a complex number"),
        ({"pressure": None, "orders": {2.0: complex("nan")}}, "torque of order 2 = .*nan.* permitted: finite"),
        ({"pressure": ([0.0, 6.0], [1e5, 1e5])}, "'from 0 to 6' rad, permitted: over the whole cycle of 12.5664 rad"),
        ({"pressure": ([0.0, 5.0, 4.0], [1e5] * 3)}, "pressure = 4.0 rad, permitted: >= 5 rad, the angle before"),
        ({"pressure": ([0.0, 4 * np.pi], [1e5, float("inf")])}, "pressure = inf Pa, permitted: finite"),
        ({"pressure": ([0.0, 4 * np.pi], [1e5])}, "as many of each"),
        ({"pressure": 3.0}, "as many of each"),
        ({"pressure": "high"}, "as many of each"),
    ],
)
def test_what_makes_no_engine_is_named(values, words):
    with pytest.raises(pt.PowertrainError, match=words):
        petrol(**values)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"compression_ratio": 1.0}, "compression_ratio = 1.0, permitted: > 1"),
        ({"polytropic": 0.9}, "polytropic = 0.9, permitted: > 1"),
        ({"start": 3.0}, "within half a turn of top dead centre"),
        ({"duration": 0.0}, "duration = 0.0, permitted: > 0"),
        ({"mean_torque": float("nan")}, "mean_torque = nan N m"),
    ],
)
def test_what_makes_no_cycle_is_named(values, words):
    with pytest.raises(pt.PowertrainError, match=words):
        pt.orders.wiebe(**({"mean_torque": 100.0} | values))


@pytest.mark.parametrize(
    ("ask", "words"),
    [
        (lambda e: e.torque_orders(-1.0), "speed = -1.0 rad/s, permitted: > 0"),
        (lambda e: e.torque_orders([100.0, float("nan")]), "speed = nan rad/s"),
        (lambda e: e.torque_orders(100.0, highest_order=0.2), "highest_order = 0.2, permitted: 0.5 to 200"),
        (lambda e: e.torque_orders(100.0, highest_order=float("nan")), "highest_order = nan"),
        (lambda e: e.torque_orders(100.0, load=-30.0), r"load = -30.0 N m, permitted: >= -1.557 N m.*fuel cut"),
        (lambda e: e.torque_orders(100.0, load=[1.0, 2.0]), "mean torque .N m., one or one for each of 1 speeds"),
        (lambda e: e.torque_orders(100.0, load="idle"), "load = 'idle'"),
        (lambda e: replace(e, pressure=None).torque_orders(100.0, load=5.0), "there is but one load"),
        (lambda e: replace(e, pressure=table(lambda p: 1e5 + p)).mean_torque(5.0), "give an Engine of another table"),
    ],
)
def test_speeds_orders_and_loads_that_are_not_permitted_are_named(ask, words):
    with pytest.raises(pt.ParameterError, match=words):
        ask(petrol())
