"""Orders in a driveline (orders/response, orders/waves): published crankshaft and turbine, waves over the cycle."""

import json
from pathlib import Path

import numpy as np
import pytest

import powertrain_ctrl as pt

REFERENCE = json.loads((Path(__file__).parent / "reference" / "breadth_cases.json").read_text())["cases"]
CASE = {case["name"]: case for case in REFERENCE}
ENGINE = pt.Engine(
    cylinders=4,
    firing_order=(1, 3, 4, 2),
    bore=0.0825,
    stroke=0.0928,
    rod=0.144,
    reciprocating_mass=0.55,
    pressure=pt.orders.wiebe(mean_torque=150.0, compression_ratio=10.5),
)
CAR = pt.examples.conventional(gear_ratio=3.6)


def crankshaft():
    """Six-cylinder crankshaft of Mendes, Meirelles and Zampieri, J. Multi-body Dynamics 222 (2008), Fig. 4."""
    case = CASE["mwm_six_cylinder_crankshaft"]
    elements = [pt.Inertia(f"n{i}", J=J) for i, J in enumerate(case["J"])]
    elements += [
        pt.SpringDamper(f"s{i}", f"n{i}", f"n{i + 1}", stiffness=k, loss_factor=case["loss_factor"])
        for i, k in enumerate(case["stiffness"])
    ]
    throws = [f"n{i}" for i in case["cylinders_at_nodes"]]
    return pt.Driveline(
        *elements, *(pt.Drag(f"d_{n}", n, damping=case["drag_of_nodes_2_to_7"]) for n in throws)
    ), throws


def six_cylinders(*orders):
    order = tuple(CASE["mwm_six_cylinder_crankshaft"]["firing_order"])
    return pt.Engine(cylinders=6, firing_order=order, orders=dict.fromkeys(orders, 100.0))


def turbine(loss_factor=0.0):
    """Gunter, Chen: Introduction to Dynamics of Rotor-Bearing Systems (2001), example 8.1; in lb, in and s times 0.11298."""
    u, low, high = 0.11298, 9.4094, 9.4094
    bodies = {"propeller": 2.454e6, "bull": 0.826e6, "lp_wheel": 1.283e4, "lp_turbine": 1.509e4}
    bodies |= {"hp_wheel": 2.723e4, "hp_turbine": 2.612e2}
    springs = [
        ("shaft", "propeller", "bull", 826e6),
        ("lp_quill", "lp_pinion", "lp_wheel", 203.94e6),
        ("lp_shaft", "lp_pinion2", "lp_turbine", 30.51e6),
        ("hp_quill", "hp_pinion", "hp_wheel", 24.17e6),
        ("hp_shaft", "hp_pinion2", "hp_turbine", 14.26e6),
    ]
    return pt.Driveline(
        *(pt.Inertia(name, J=J * u) for name, J in bodies.items()),
        *(pt.SpringDamper(name, a, b, stiffness=k * u, loss_factor=loss_factor) for name, a, b, k in springs),
        pt.Gear("lp1", "lp_pinion", "bull", ratio=low),
        pt.Gear("lp2", "lp_pinion2", "lp_wheel", ratio=40.0424 / low),
        pt.Gear("hp1", "hp_pinion", "bull", ratio=high),
        pt.Gear("hp2", "hp_pinion2", "hp_wheel", ratio=78.2365 / high),
        pt.Drag("water", "propeller", damping=3.86e6 * u),
        pt.Drag("hp_drag", "hp_turbine", damping=42.738 * u),
        pt.Drag("lp_drag", "lp_turbine", damping=108.77 * u),
    )


def test_the_crankshaft_has_its_published_frequencies():
    frequencies = pt.modes(crankshaft()[0]).frequency_hz
    np.testing.assert_allclose(frequencies[1:4], [216.58, 592.74, 984.92], atol=0.006)
    wanted = CASE["mwm_six_cylinder_crankshaft"]["frequencies_hz"]
    np.testing.assert_allclose(frequencies[1 : 1 + len(wanted)], wanted, rtol=1e-12)


@pytest.mark.parametrize(
    "row", CASE["mwm_six_cylinder_crankshaft"]["rows"], ids=lambda r: f"{r['rpm']} rpm, {r['order']}"
)
def test_the_crankshaft_swings_as_in_the_reference_rows(row):
    car, throws = crankshaft()
    response = pt.order_response(car, six_cylinders(row["order"]), pt.rpm(float(row["rpm"])), nodes=throws)
    for name, key in {"n0_angle": "front_angle_abs", "s7_torque": "flywheel_shaft_torque_abs"}.items():
        assert response.amplitude(name)[0, 0] == pytest.approx(row[key], rel=1e-9)
    assert response.amplitude("s0_torque")[0, 0] == pytest.approx(row["front_shaft_torque_abs"], rel=1e-9)


def test_six_cylinders_on_a_straight_line_add_up_as_in_the_reference():
    orders = {n / 2: 1.0 for n in range(1, 13)}
    engine = pt.Engine(cylinders=6, firing_order=(1, 5, 3, 6, 2, 4), orders=orders)
    shape = np.arange(6, 0, -1) / 6.0
    for n, phases in zip(orders, engine.phases(np.array(list(orders))), strict=True):
        wanted = CASE["phase_vector_sums"]["six_linear_shape_6_to_1"][str(n)]
        assert abs(shape @ phases) == pytest.approx(wanted, abs=1e-12)


def test_the_turbine_has_its_published_frequencies_and_its_peak_under_the_blades():
    np.testing.assert_allclose(60.0 * pt.modes(turbine()).frequency_hz[1:4], [177.7, 220.2, 1282.6], atol=0.05)
    # a modal damping ratio of 0.00398 is half a loss factor of all shafts
    rpm = np.linspace(30.0, 40.0, 1001)
    blades = pt.Engine(cylinders=1, orders={5.0: 1.0})
    response = pt.order_response(turbine(2 * 0.00398), blades, pt.rpm(rpm), nodes="propeller", outputs="shaft_torque")
    torque = response.amplitude("shaft_torque")[0] * 0.1 * 22.24e6 * (rpm / 85.0) ** 2
    assert torque.max() == pytest.approx(4.17e6, rel=0.01)
    assert rpm[torque.argmax()] == pytest.approx(35.6, abs=0.06)


def test_every_order_is_the_forced_response_at_its_frequency_and_phase():
    speeds = pt.rpm(np.array([800.0, 1500.0, 4200.0]))
    response = pt.order_response(CAR, ENGINE, speeds, highest_order=6)
    orders, torque = ENGINE.torque_orders(speeds, highest_order=6)
    np.testing.assert_array_equal(response.orders, orders)
    for i, order in enumerate(orders.tolist()):
        forced = pt.forced_response(CAR, order * speeds, {"engine_torque": torque[i]})
        assert response.outputs == forced.outputs
        for name in ("engine_speed", "damper_spring_torque", "vehicle_acceleration", "clutch_torque", "tyres_twist"):
            # what the cylinders cancel is exactly nothing in the one and rounding in the other
            np.testing.assert_allclose(
                response[name][i], forced[name], rtol=1e-11, atol=1e-13 * abs(forced[name]).max() + 1e-9
            )
    assert not response["engine_speed"][0].any()  # half orders


def test_cylinders_at_nodes_of_their_own_act_there_in_their_phase():
    car, throws = crankshaft()
    speed, engine = pt.rpm(2000.0), six_cylinders(4.5)
    response = pt.order_response(car, engine, speed, nodes=throws)
    torques = {f"{n}_torque": 100.0 * np.exp(-4.5j * phi) for n, phi in zip(throws, engine.firing, strict=True)}
    forced = pt.forced_response(car, [4.5 * speed], torques)
    for name in ("n0_angle", "s7_torque", "n8_speed"):
        assert response[name][0, 0] == pytest.approx(forced[name][0], rel=1e-11)


def test_peak_and_irregularity_are_those_of_the_wave_over_the_cycle():
    speeds = pt.rpm(np.array([1000.0, 2700.0]))
    response = pt.order_response(CAR, ENGINE, speeds)
    angle = np.linspace(0.0, 4.0 * np.pi, 40001)
    turn = np.exp(1j * np.multiply.outer(response.orders, angle))
    for name in ("engine_speed", "damper_spring_torque"):
        wave = (response[name].T @ turn).real
        np.testing.assert_allclose(response.peak(name), np.abs(wave).max(axis=1), rtol=1e-7)
        assert (response.peak(name) >= np.abs(wave).max(axis=1) * (1 - 1e-14)).all()
    speed = (response["engine_speed"].T @ turn).real
    expected = (speed.max(axis=1) - speed.min(axis=1)) / speeds
    np.testing.assert_allclose(response.irregularity("engine"), expected, rtol=1e-7)


def test_a_wave_of_two_orders_has_its_extremes_in_closed_form():
    # 1 cos(phi) + 0.5 cos(2 phi) is highest at 0 and lowest where cos(phi) = -1/2
    car = pt.Driveline(pt.Inertia("engine", J=1.0))
    omega = 10.0
    orders = {1.0: 1j * omega, 2.0: 0.5 * 2j * omega}
    response = pt.order_response(car, pt.Engine(cylinders=1, orders=orders), omega)
    assert response["engine_speed"][:, 0] == pytest.approx([1.0, 0.5])
    assert response.peak("engine_speed")[0] == pytest.approx(1.5, rel=1e-15)
    assert response.irregularity("engine")[0] == pytest.approx((1.5 + 0.75) / omega, rel=1e-14)


def test_behind_a_gear_the_irregularity_goes_by_the_speed_there():
    wheel = pt.Gear("gear", "engine", "wheel", ratio=-4.0)
    car = pt.Driveline(pt.Inertia("engine", J=0.2), wheel, pt.Inertia("wheel", J=1.0))
    response = pt.order_response(car, pt.Engine(cylinders=1, orders={2.0: 100.0}), [50.0, 90.0])
    np.testing.assert_allclose(response.irregularity("wheel"), response.irregularity("engine"), rtol=1e-14)


def test_a_pendulum_is_taken_at_each_speed():
    speeds = pt.rpm(np.array([900.0, 1700.0, 3000.0]))
    elements = [*CAR, pt.Pendulum("absorber", "transmission", J=0.012, order=2.0, damping=0.02)]
    car = pt.Driveline(*elements)
    response = pt.order_response(car, ENGINE, speeds)
    for i, speed in enumerate(speeds.tolist()):
        alone = pt.order_response(car.at(speed={"engine": speed}), ENGINE, speed)
        for name in ("transmission_speed", "absorber_torque", "absorber_twist", "absorber_bob_angle", "engine_speed"):
            np.testing.assert_allclose(response[name][:, i], alone[name][:, 0], rtol=1e-12)
    without = pt.order_response(CAR, ENGINE, speeds)
    assert (response.amplitude("transmission_speed")[3] < 0.4 * without.amplitude("transmission_speed")[3]).all()


def test_a_dual_mass_flywheel_and_a_pendulum_smooth_the_transmission():
    dual = CAR.replace("engine", J=0.25).replace("torsional_damper", J=0.10)
    dual = dual.replace("damper_spring", stiffness=600.0, damping=1.5)
    absorber = pt.Pendulum("absorber", "torsional_damper", J=0.012, order=2.0, damping=0.02)
    found = [
        float(pt.order_response(car, ENGINE, pt.rpm(1000.0)).irregularity("transmission")[0])
        for car in (CAR, dual, pt.Driveline(*dual, absorber))
    ]
    np.testing.assert_allclose(found, [0.033, 0.0074, 0.0014], rtol=0.02)


def test_a_load_of_each_speed_is_the_load_there():
    speeds = pt.rpm(np.array([800.0, 2000.0]))
    together = pt.order_response(CAR, ENGINE, speeds, load=[15.0, 150.0], outputs="engine_speed")
    for i, load in enumerate((15.0, 150.0)):
        alone = pt.order_response(CAR, ENGINE, speeds[i], load=load, outputs="engine_speed")
        np.testing.assert_allclose(together["engine_speed"][:, i], alone["engine_speed"][:, 0], rtol=1e-12)
    np.testing.assert_allclose(together.mean_torque, [15.0, 150.0], rtol=1e-12)


def test_many_speeds_are_computed_in_parts_that_do_not_matter(monkeypatch):
    speeds = pt.rpm(np.linspace(800.0, 3000.0, 11))
    car = pt.Driveline(*CAR, pt.Pendulum("absorber", "engine", J=0.01, order=2.0))
    whole = pt.order_response(car, ENGINE, speeds, outputs=["engine_speed", "absorber_torque"])
    monkeypatch.setattr("powertrain_ctrl.orders.response.AT_ONCE", 60)
    parts = pt.order_response(car, ENGINE, speeds, outputs=["engine_speed", "absorber_torque"])
    for name in whole.outputs:
        np.testing.assert_allclose(parts[name], whole[name], rtol=1e-14)


def test_a_result_becomes_a_dict_of_lists():
    response = pt.order_response(CAR, ENGINE, pt.rpm([1000.0, 2000.0]), highest_order=4, outputs=["engine_speed"])
    written = json.loads(json.dumps(response.to_dict()))
    assert written["orders"] == [0.5 * n for n in range(1, 9)]
    signal = written["outputs"]["engine_speed"]
    np.testing.assert_allclose(
        signal["amplitude"] * np.exp(1j * np.array(signal["phase"])), response["engine_speed"], atol=1e-15
    )
    assert signal["peak"] == response.peak("engine_speed").tolist()
    assert repr(response) == "OrderResponse: 8 orders, 0.5 to 4; 2 speeds, 1000 to 2000 rpm; 1 outputs"


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"speed": [100.0, -5.0]}, "order_response: speed = -5.0 rad/s, permitted: > 0"),
        ({"speed": float("nan")}, "speed = nan"),
        ({"speed": []}, "at least one"),
        ({"highest_order": -1.0}, "highest_order = -1.0, permitted: 0.5 to 200"),
        ({"highest_order": float("nan")}, "highest_order = nan"),
        ({"nodes": "motor"}, 'node "motor" is not in this driveline'),
        ({"nodes": ["engine", "wheels"]}, "permitted: one node, or one for each of 4 cylinders"),
        ({"nodes": "vehicle"}, 'no torque acts on "vehicle"'),
        ({"nodes": "final_drive_output"}, 'no torque acts on "final_drive_output"'),
        ({"outputs": "crank_speed"}, '"crank_speed" is not an output of this driveline'),
        ({"load": float("nan")}, "load = nan"),
        ({"engine": "petrol"}, "engine: expected an Engine, got 'petrol'"),
    ],
)
def test_what_has_no_response_is_named(values, words):
    arguments = {"engine": ENGINE, "speed": 100.0} | values
    with pytest.raises(pt.PowertrainError, match=words):
        pt.order_response(CAR, **arguments)


def test_what_is_asked_of_a_response_and_is_not_there_is_named():
    response = pt.order_response(CAR.release("clutch"), ENGINE, 100.0, outputs=["vehicle_speed"])
    with pytest.raises(pt.UnknownNameError, match='"engine_speed" is not in this response'):
        response.irregularity("engine")
    with pytest.raises(pt.UnknownNameError, match='"engine_speed" is not in this response'):
        response.amplitude("engine_speed")
    with pytest.raises(pt.PowertrainError, match='"vehicle" does not turn with the engine'):
        response.irregularity("vehicle")
    with pytest.raises(pt.ParameterError, match="at least the lowest order of the engine"):
        pt.order_response(CAR, pt.Engine(cylinders=1, orders={5.0: 1.0}), 100.0, highest_order=3.0)
    play = pt.Backlash("play", "engine", "torsional_damper", gap=0.1, stiffness=1e4)
    with pytest.raises(pt.PowertrainError, match="play: the operating point lies inside its gap"):
        pt.order_response(pt.Driveline(*(play if e.name == "damper_spring" else e for e in CAR)), ENGINE, 100.0)
