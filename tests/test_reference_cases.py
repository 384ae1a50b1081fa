"""Published cases of other programs, through the public API; data and sources in reference/modal_cases.json."""

import json
from pathlib import Path

import numpy as np
import pytest

import powertrain_ctrl as pt

CASES = json.loads((Path(__file__).parent / "reference" / "modal_cases.json").read_text())["cases"]
BY_NAME = {case["name"]: case for case in CASES}


def build(case):
    def node(name):
        return f"n{name}" if name.isdigit() else name

    elements = [pt.Inertia(node(name), J=J) for name, J in case["inertias"].items() if J]
    for k, (a, b, stiffness, damping) in enumerate(case["shafts"]):
        elements.append(pt.SpringDamper(f"shaft{k}", node(a), node(b), stiffness=stiffness, damping=damping))
    for k, (a, b, ratio) in enumerate(case.get("gears", [])):
        elements.append(pt.Gear(f"gear{k}", node(a), node(b), ratio=ratio))
    return pt.Driveline(*elements)


def test_geared_branched_system_of_friswell():
    case = BY_NAME["friswell_963_geared_branched"]
    np.testing.assert_allclose(
        pt.modes(build(case)).frequency_hz, case["expected_hz"], atol=case["tolerance"]["abs_hz"]
    )


def test_star_with_four_equal_branches_has_its_mode_three_times():
    case = BY_NAME["star_four_equal_branches"]
    modes = pt.modes(build(case))
    np.testing.assert_allclose(modes.frequency_hz, case["expected_hz"], rtol=case["tolerance"]["rel"])
    assert modes.frequency_hz[0] == 0.0


def test_front_wheel_drive_car_has_its_published_eigenvalues():
    case = BY_NAME["ttc066_fwd_four_mass_gear2_published"]
    for car in (build(case), pt.examples.front_wheel_drive()):
        poles = pt.poles(car)
        upper = poles[poles.imag >= 0.0]
        for (real, imag), tolerance in zip(case["expected_eigenvalues"], case["tolerance"]["abs_eig"], strict=True):
            assert np.abs(upper - complex(real, imag)).min() < tolerance
        assert len(poles) == 6  # one zero, a real one, two pairs


@pytest.mark.parametrize("mode", ["1", "2"])
def test_front_wheel_drive_car_has_its_published_complex_shapes(mode):
    case = BY_NAME["ttc066_fwd_four_mass_gear2_published"]
    system = pt.state_space(build(case))
    values, vectors = np.linalg.eig(system.A)
    real, imag = case["expected_eigenvalues"][int(mode)]
    vector = vectors[:, np.abs(values - complex(real, imag)).argmin()]
    # Angles from speeds: divided by the same eigenvalue, so speeds have the shape.
    speeds = system.C @ vector
    shape = {node: speeds[system.output_labels.index(f"{node}_speed")] for node in case["inertias"]}
    published = {node: complex(*value) for node, value in case["expected_complex_modes"][mode].items()}
    scale = next(shape[node] for node, value in published.items() if value == 1.0)
    for node, value in published.items():
        assert abs(shape[node] / scale - value) < case["tolerance"]["abs_mode"][0]
