"""Centrifugal pendulums against the pendulum of the textbook and closed forms."""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg

import powertrain_ctrl as pt

REFERENCE = json.loads((Path(__file__).parent / "reference" / "breadth_cases.json").read_text())["cases"]
CASE = next(case for case in REFERENCE if case["name"] == "centrifugal_pendulum")


def rotor(**pendulum):
    return pt.Driveline(pt.Inertia("rotor", J=0.2), pt.Pendulum("absorber", "rotor", **pendulum))


@pytest.mark.parametrize("row", CASE["rows"], ids=lambda row: f"{row['rpm']} rpm, order {row['order']}")
def test_seen_from_its_node_it_is_the_inertia_of_den_hartog(row):
    car, speed = rotor(J=CASE["pendulum_J"], order=CASE["tuning_order"]), pt.rpm(float(row["rpm"]))
    n, omega = row["order"], row["order"] * speed
    angle = pt.forced_response(car.at(speed={"rotor": speed}), [omega], {"rotor_torque": CASE["torque"]})[
        "rotor_angle"
    ][0]
    assert angle == pytest.approx(row["rotor_angle"], rel=CASE["tolerance"])
    assert angle == pytest.approx(-100.0 / (omega**2 * (0.2 + 0.02 / (1.0 - n**2 / 4.0))), rel=1e-12)


@pytest.mark.parametrize("speed", [60.0, 157.0, 400.0])
def test_at_its_own_order_it_takes_the_whole_torque_at_any_speed(speed):
    response = pt.forced_response(
        rotor(J=0.02, order=1.5).at(speed={"rotor": speed}), [1.5 * speed], {"rotor_torque": 10.0}
    )
    assert response.amplitude("rotor_angle")[0] < 1e-12 * 10.0 / (0.2 * (1.5 * speed) ** 2)
    assert response["absorber_torque"][0] == pytest.approx(10.0, rel=1e-12)


def test_it_is_the_linearised_mass_on_a_pendulum():
    # kinetic energy J w^2 / 2 + m |v|^2 / 2 of a mass on the length L, its pivot on the radius R, for small swings phi
    J, m, R, L, speed = 0.3, 0.8, 0.12, 0.03, 150.0
    M = [[J + m * (R + L) ** 2, m * L * (R + L)], [m * L * (R + L), m * L**2]]
    K = [[0.0, 0.0], [0.0, m * R * L * speed**2]]
    values, vectors = scipy.linalg.eigh(K, M)
    car = pt.Driveline(
        pt.Inertia("rotor", J=J), pt.Pendulum("absorber", "rotor", J=m * (R + L) ** 2, order=np.sqrt(R / L))
    ).at(speed={"rotor": speed})
    modes = pt.modes(car)
    assert modes.omega[1] == pytest.approx(np.sqrt(values[1]), rel=1e-13)
    # the swing is 1 + order^2 times the twist
    turned, bob = modes.shapes[:, 1]
    swing = -(1.0 + R / L) * (turned - bob)
    assert swing / turned == pytest.approx(vectors[1, 1] / vectors[0, 1], rel=1e-12)


def test_behind_a_gear_it_turns_with_its_own_node():
    car = pt.Driveline(
        pt.Inertia("engine", J=0.1),
        pt.Gear("gear", "engine", "shaft", ratio=-2.0),
        pt.Pendulum("absorber", "shaft", J=0.01, order=3.0, damping=0.2),
    )
    linear = car.at(speed={"engine": 100.0})
    assert linear["absorber"].stiffness == 3.0**2 * 0.01 * 50.0**2
    assert (linear["absorber"].damping, linear["absorber_bob"].J) == (0.2, 0.01)


def test_without_a_speed_it_is_refused_and_the_remedy_said():
    car = rotor(J=0.01, order=2.0)
    for function in (pt.modes, pt.state_space, lambda car: pt.forced_response(car, [1.0], {"rotor_torque": 1.0})):
        with pytest.raises(pt.PowertrainError, match=r"absorber: is not linear.*car.at\(speed="):
            function(car)
    with pytest.raises(pt.PowertrainError, match=r"absorber: needs a speed; take the driveline at one, car.at\(speed="):
        pt.simulate(car, [0.0, 1.0])
    with pytest.raises(pt.PowertrainError, match='absorber: speed of "rotor" = 0 rad/s, permitted: not 0'):
        car.at(speed={"rotor": 0.0})
    assert car.at(torques={"rotor_torque": 5.0}) == car


@pytest.mark.parametrize(
    "values", [{"J": 0.0, "order": 2.0}, {"J": 0.1, "order": -1.0}, {"J": 0.1, "order": 2, "damping": -1}]
)
def test_values_that_are_not_permitted_are_named(values):
    with pytest.raises(pt.ParameterError, match="absorber: "):
        pt.Pendulum("absorber", "rotor", **values)


def test_a_file_keeps_it_and_a_schematic_shows_it(tmp_path):
    car = rotor(J=0.01, order=2.0)
    car.save(tmp_path / "car.toml")
    assert pt.load(tmp_path / "car.toml") == car
    ax = pt.plots.schematic(car)
    assert "absorber" in [text.get_text() for text in ax.texts]
    assert any(line.get_marker() == "o" for line in ax.lines)
