"""Engine orders and forced vibration: a crankshaft, a turbine, the slider-crank, a pendulum."""

import numpy as np

import powertrain_ctrl as pt

from . import Case, Row, printed, reference

CASES = reference("breadth_cases")
# lb in s^2 in kg m^2, lb in in N m
INCH = 0.11298


def crankshaft() -> Case:
    case = CASES["mwm_six_cylinder_crankshaft"]
    throws = [f"n{i}" for i in case["cylinders_at_nodes"]]
    springs = [
        pt.SpringDamper(f"s{i}", f"n{i}", f"n{i + 1}", stiffness=k, loss_factor=case["loss_factor"])
        for i, k in enumerate(case["stiffness"])
    ]
    car = pt.Driveline(
        *(pt.Inertia(f"n{i}", J=J) for i, J in enumerate(case["J"])),
        *springs,
        *(pt.Drag(f"d_{node}", node, damping=case["drag_of_nodes_2_to_7"]) for node in throws),
    )
    found = pt.modes(car).frequency_hz[1:]
    rows = [Row(f"f{i + 1}", hz, float(found[i]), "Hz", 1e-9 * hz) for i, hz in enumerate(case["frequencies_hz"])]
    for wanted in case["rows"][:3]:
        engine = pt.Engine(cylinders=6, firing_order=tuple(case["firing_order"]), orders={wanted["order"]: 100.0})
        response = pt.order_response(car, engine, pt.rpm(float(wanted["rpm"])), nodes=throws)
        torque, theirs = float(response.amplitude("s7_torque")[0, 0]), wanted["flywheel_shaft_torque_abs"]
        what = f"shaft at the flywheel, order {wanted['order']} at {wanted['rpm']} rpm"
        rows.append(Row(what, theirs, torque, "N m", 1e-9 * theirs))
    text = (
        "A. S. Mendes, P. S. Meirelles, D. E. Zampieri, J. Multi-body Dynamics 222 (2008), Fig. 4, values as in "
        "openTorsion's example; beside ours are those of a dense solution by another program."
    )
    return Case("Six-cylinder crankshaft", text, tuple(rows))


def turbine(loss_factor: float = 0.0) -> pt.Driveline:
    bodies = {"propeller": 2.454e6, "bull": 0.826e6, "lp_wheel": 1.283e4, "lp_turbine": 1.509e4}
    bodies |= {"hp_wheel": 2.723e4, "hp_turbine": 2.612e2}
    springs = [
        ("shaft", "propeller", "bull", 826e6),
        ("lp_quill", "lp_pinion", "lp_wheel", 203.94e6),
        ("lp_shaft", "lp_pinion2", "lp_turbine", 30.51e6),
        ("hp_quill", "hp_pinion", "hp_wheel", 24.17e6),
        ("hp_shaft", "hp_pinion2", "hp_turbine", 14.26e6),
    ]
    gears = [
        ("lp1", "lp_pinion", "bull", 9.4094),
        ("lp2", "lp_pinion2", "lp_wheel", 40.0424 / 9.4094),
        ("hp1", "hp_pinion", "bull", 9.4094),
        ("hp2", "hp_pinion2", "hp_wheel", 78.2365 / 9.4094),
    ]
    drags = {"propeller": 3.86e6, "hp_turbine": 42.738, "lp_turbine": 108.77}
    return pt.Driveline(
        *(pt.Inertia(name, J=J * INCH) for name, J in bodies.items()),
        *(pt.SpringDamper(name, a, b, stiffness=k * INCH, loss_factor=loss_factor) for name, a, b, k in springs),
        *(pt.Gear(name, a, b, ratio=ratio) for name, a, b, ratio in gears),
        *(pt.Drag(f"{node}_drag", node, damping=d * INCH) for node, d in drags.items()),
    )


def marine_turbine() -> Case:
    case = CASES["gunter_chen_8_1_forced"]
    found = 60.0 * pt.modes(turbine()).frequency_hz[1:4]
    rows = [
        printed(f"f{i + 1}", f"{cpm:.1f}", f, "1/min")
        for i, (cpm, f) in enumerate(zip(case["published_cpm"], found, strict=True))
    ]
    # a modal damping ratio of 0.00398 is half a loss factor of all shafts
    rpm, blades = np.linspace(30.0, 40.0, 1001), pt.Engine(cylinders=1, orders={5.0: 1.0})
    response = pt.order_response(turbine(2 * 0.00398), blades, pt.rpm(rpm), nodes="propeller", outputs="shaft_torque")
    torque = response.amplitude("shaft_torque")[0] * 0.1 * 22.24e6 * (rpm / 85.0) ** 2
    at, peak = case["digitised_peak"]
    rows.append(Row("peak under the blades (read off the figure)", peak, float(torque.max()), "lb in", 0.01 * peak))
    rows.append(Row("its speed (read off the figure)", at, float(rpm[torque.argmax()]), "1/min", 0.01 * at))
    text = "E. J. Gunter, W. J. Chen, Introduction to Dynamics of Rotor-Bearing Systems (2001), example 8.1."
    return Case("Geared marine turbine", text, tuple(rows))


def slider_crank() -> Case:
    wanted = CASES["reciprocating_inertia_torque_harmonics"]["by_lambda"]["0.25"]
    engine = pt.Engine(cylinders=1, stroke=0.1, rod=0.2, reciprocating_mass=0.8)
    orders, torque = engine.torque_orders(300.0, highest_order=6)
    sine = dict(zip(orders.tolist(), (-torque[:, 0].imag / (0.8 * 0.05**2 * 300.0**2)).tolist(), strict=True))
    rows = [Row(f"order {order}", value, sine[float(order)], "", 1e-12) for order, value in wanted.items()]
    text = (
        "Sine coefficients over m r² ω² at r/l = 1/4. Beside ours is quadrature in 30 digits; Den Hartog's leading terms: "
        "λ/4, -1/2, -3λ/4, -λ²/4."
    )
    return Case("Inertia torque of a slider-crank", text, tuple(rows))


def pendulum() -> Case:
    case = CASES["centrifugal_pendulum"]
    car = pt.Driveline(
        pt.Inertia("rotor", J=case["rotor_J"]),
        pt.Pendulum("absorber", "rotor", J=case["pendulum_J"], order=case["tuning_order"]),
    )
    rows = []
    for wanted in case["rows"][:6]:
        speed = pt.rpm(float(wanted["rpm"]))
        response = pt.forced_response(
            car.at(speed={"rotor": speed}), [wanted["order"] * speed], {"rotor_torque": case["torque"]}
        )
        angle, theirs = float(response["rotor_angle"][0].real), wanted["rotor_angle"]
        rows.append(Row(f"angle of the rotor, order {wanted['order']}", theirs, angle, "rad", 1e-12))
    text = "Closed form of Den Hartog: the pendulum is an inertia J/(1 - n²/n0²); at 800 rpm, tuned to order 2."
    return Case("Centrifugal pendulum", text, tuple(rows))


def cases() -> list[Case]:
    return [crankshaft(), marine_turbine(), slider_crank(), pendulum()]
