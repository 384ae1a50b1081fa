"""The source's tables and figures, from the file that also feeds the report."""

import tomllib
from importlib import resources

import numpy as np
import pytest

import powertrain_ctrl as pt

TABLES = tomllib.loads(resources.files(pt.examples).joinpath("source_tables.toml").read_text())
SETS = [None, "closed", "open"]


def car(state, damping=None):
    whole = pt.examples.conventional(damping=damping)
    return whole if state == "closed" else whole.release("clutch").part("vehicle")


@pytest.mark.parametrize("state", ["closed", "open"])
@pytest.mark.parametrize("damping", SETS)
def test_frequencies_are_the_computed_ones_of_the_table(state, damping):
    table = TABLES[state]
    np.testing.assert_allclose(pt.modes(car(state, damping)).frequency_hz, table["computed"], atol=table["tolerance"])


@pytest.mark.parametrize("state", ["closed", "open"])
def test_frequencies_have_the_printed_digits(state):
    for f, printed in zip(pt.modes(car(state)).frequency_hz, TABLES[state]["printed"], strict=True):
        decimals = len(printed.partition(".")[2])
        rounded, truncated = f"{f:.{decimals}f}", f"{np.floor(f * 10**decimals) / 10**decimals:.{decimals}f}"
        assert printed == (truncated if printed == "31.6" else rounded)


def test_engine_side_of_the_open_clutch():
    engine_side = pt.examples.conventional().release("clutch").part("engine")
    table = TABLES["engine_side"]
    np.testing.assert_allclose(pt.modes(engine_side).frequency_hz, table["computed"], atol=table["tolerance"])


@pytest.mark.parametrize("state", ["closed", "open"])
def test_shape_of_the_dominant_mode_is_that_of_the_figure(state):
    table = TABLES[state]["shape"]
    modes = pt.modes(car(state))
    shape = modes.reflected_shapes[[modes.nodes.index(node) for node in table["nodes"]], 1]
    np.testing.assert_allclose(shape, table["computed"], atol=table["tolerance"])


def test_largest_twist_of_the_dominant_mode_is_in_the_drive_shafts():
    for state in ("closed", "open"):
        assert pt.modes(car(state)).dominant_compliance(1) == "drive_shafts"


@pytest.mark.parametrize(("number", "state", "damping"), [("2.2", "closed", "closed"), ("2.3", "open", "open")])
def test_control_models_are_those_of_tables_2_2_and_2_3(number, state, damping):
    model, table = pt.two_mass(car(state, damping), method="source"), TABLES[f"table_{number}"]
    by_hand = {
        # (2.14), (2.22) with (2.3), (2.5)
        "closed": 0.3 + 0.05 + 0.09 + 0.01 + 0.03 + 0.05 / 36,
        "open": 0.01 + 0.03 + 0.05 / 36,
    }[state]
    assert model.J1 == pytest.approx(by_hand, rel=1e-12)
    assert model.J2 == pytest.approx(4 + 2000 * 0.35**2, rel=1e-12)
    assert f"{model.J1:.3g}" == table["J1"] or f"{model.J1:.3f}" == table["J1"]
    assert (f"{model.J2:.0f}", model.ratio) == (table["J2"], pytest.approx(float(table["ratio"]), rel=1e-12))
    assert model.stiffness == pytest.approx(float(table["stiffness"]), rel=1e-12)
    # the damping sets were chosen to give the printed damping
    assert model.damping == pytest.approx(float(table["damping"]), rel=4e-3)


def test_left_and_right_taken_per_side_would_not_give_the_printed_frequency():
    doubled = pt.examples.conventional().replace("wheels", J=8.0).replace("drive_shafts", stiffness=6.88e4)
    trap = TABLES["left_and_right_doubled"]
    assert pt.modes(doubled).frequency_hz[1] == pytest.approx(trap["first_frequency"], abs=trap["tolerance"])


def by_hand(J, c, d):
    """(2.9) from parameters already reflected by (2.1)-(2.7)."""
    n = len(J)
    K = np.zeros((n, n))
    D = np.zeros((n, n))
    for i in range(n - 1):
        pair = np.zeros(n)
        pair[i], pair[i + 1] = 1.0, -1.0
        K -= c[i] * np.outer(pair, pair)
        D -= d[i] * np.outer(pair, pair)
    M = np.diag(J)
    return np.block([[np.zeros((n, n)), np.eye(n)], [np.linalg.solve(M, K), np.linalg.solve(M, D)]])


@pytest.mark.parametrize("damping", SETS)
@pytest.mark.parametrize("state", ["closed", "open"])
def test_system_matrix_is_that_of_the_source(state, damping):
    d = pt.examples.DAMPING[damping] or dict.fromkeys(pt.examples.DAMPING["closed"], 0.0)
    r = 0.35
    J = [0.3, 0.05, 0.09 + 0.01, 0.03, 0.05 / 36, 4 / 324, 2000 * r**2 / 324]
    c = [2e3, 5e4, 1e6, 1e6 / 36, 3.44e4 / 324, 9.8e5 * r**2 / 324]
    dampers = [d["damper_spring"], d["clutch_shaft"], d["input_shaft"], d["output_shaft"] / 36]
    dampers += [d["drive_shafts"] / 324, d["tyres"] * r**2 / 324]
    reference = "engine"
    if state == "open":
        J, c, dampers, reference = [0.01, *J[3:]], c[2:], dampers[2:], "clutch_secondary"
    system = pt.state_space(car(state, damping), coordinates="angle", reference=reference)
    expected = by_hand(J, c, dampers)
    np.testing.assert_allclose(system.A, expected, rtol=1e-12, atol=0.0)
    order = ["engine", "torsional_damper", "clutch_primary", "transmission", "differential", "wheels", "vehicle"]
    order = order if state == "closed" else ["clutch_secondary", *order[3:]]
    assert system.state_labels == [f"{node}_{kind}_reflected" for kind in ("angle", "speed") for node in order]
    # inputs stay physical: T_ICE on the first node, a force F on the vehicle is F r / 18 at the engine
    torque = system.B[:, system.input_labels.index(f"{order[0]}_torque")]
    force = system.B[:, system.input_labels.index("vehicle_force")]
    assert torque[len(order)] == pytest.approx(1.0 / J[0], rel=1e-12)
    assert force[-1] == pytest.approx(r / 18 / J[-1], rel=1e-12)


def test_control_model_has_the_equations_2_13():
    model = pt.TwoMass(J1=0.481, J2=249.0, stiffness=3.44e4, damping=350.0, ratio=18.0, radius=0.35)
    system = pt.state_space(model, coordinates="angle")
    J1, J2, c, d, R = 0.481, 249.0, 3.44e4, 350.0, 18.0
    expected = np.array(
        [
            [0.0, 0.0, 1.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [-c / R**2 / J1, c / R / J1, -d / R**2 / J1, d / R / J1],
            [c / R / J2, -c / J2, d / R / J2, -d / J2],
        ]
    )
    np.testing.assert_allclose(system.A, expected, rtol=1e-12, atol=1e-15)
    assert system.state_labels == ["engine_angle", "wheels_angle", "engine_speed", "wheels_speed"]
    assert pt.state_space(model).nstates == 3
    row = system.C[system.output_labels.index("vehicle_acceleration")]
    np.testing.assert_allclose(row, 0.35 * expected[3], rtol=1e-12)  # (2.15)
