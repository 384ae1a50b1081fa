"""Frequencies, eigenvalues and shapes of other programs and books."""

import numpy as np

import powertrain_ctrl as pt

from . import Case, Row, printed, reference

MODAL = reference("modal_cases")
BREADTH = reference("breadth_cases")
# Cycles a minute, as printed.
MARINE = ("177.7", "220.2", "1282.6")


def build(case: dict) -> pt.Driveline:
    def node(name: str) -> str:
        return f"n{name}" if name.isdigit() else name

    return pt.Driveline(
        *(pt.Inertia(node(name), J=J) for name, J in case["inertias"].items() if J),
        *(
            pt.SpringDamper(f"shaft{i}", node(a), node(b), stiffness=stiffness, damping=damping)
            for i, (a, b, stiffness, damping) in enumerate(case["shafts"])
        ),
        *(pt.Gear(f"gear{i}", node(a), node(b), ratio=ratio) for i, (a, b, ratio) in enumerate(case.get("gears", []))),
    )


def branched() -> Case:
    case = MODAL["friswell_963_geared_branched"]
    found = pt.modes(build(case)).frequency_hz
    rows = [
        Row(f"f{i}", hz, float(f), "Hz", case["tolerance"]["abs_hz"])
        for i, (hz, f) in enumerate(zip(case["expected_hz"], found, strict=True))
    ]
    text = "M. I. Friswell et al., Dynamics of Rotating Machines, section 9.6.3, as in the tests of openTorsion."
    return Case("Geared system with two branches", text, tuple(rows))


def front_wheel_drive() -> list[Case]:
    case = MODAL["ttc066_fwd_four_mass_gear2_published"]
    system = pt.state_space(build(case))
    values, vectors = np.linalg.eig(system.A)
    eigenvalues, shapes = [], []
    for number, ((real, imag), allowed) in enumerate(
        zip(case["expected_eigenvalues"], case["tolerance"]["abs_eig"], strict=True)
    ):
        at = np.abs(values - complex(real, imag)).argmin()
        eigenvalues.append(Row(f"real part, {number}", real, float(values[at].real), "1/s", allowed))
        eigenvalues.append(Row(f"imaginary part, {number}", imag, float(values[at].imag), "rad/s", allowed))
        # speeds have the shape of angles: one is the other times the eigenvalue
        speeds = system.C @ vectors[:, at]
        mode = {n: speeds[system.output_labels.index(f"{n}_speed")] for n in case["inertias"]}
        published = {n: complex(*value) for n, value in case["expected_complex_modes"].get(str(number), {}).items()}
        for node, value in published.items():
            ours = mode[node] / next(mode[n] for n, v in published.items() if v == 1.0)
            for part, theirs, our in (("real", value.real, ours.real), ("imaginary", value.imag, ours.imag)):
                quantity = f"mode {number}, {node}, {part}"
                shapes.append(Row(quantity, theirs, float(our), "", case["tolerance"]["abs_mode"][0]))
    text = "B. Mason, course notes TTC066, Loughborough University, section 7."
    return [
        Case("Eigenvalues of a front-wheel-drive car in second gear", text, tuple(eigenvalues)),
        Case("Complex shapes of the same car", text, tuple(shapes)),
    ]


def wind_turbine() -> Case:
    case = BREADTH["nrel_5mw"]
    car = pt.Driveline(
        pt.Inertia("rotor", J=case["rotor_J"]),
        pt.SpringDamper("shaft", "rotor", "hub", stiffness=case["stiffness"], damping=case["damping"]),
        pt.Gear("gearbox", "generator", "hub", ratio=case["ratio"]),
        pt.Inertia("generator", J=case["generator_J"]),
    )
    row = printed("free-free frequency", f"{case['published_hz']:.2f}", pt.modes(car).frequency_hz[1], "Hz")
    return Case("Drive train of a wind turbine", "NREL 5 MW reference turbine.", (row,))


def marine() -> Case:
    found = 60.0 * pt.modes(pt.examples.marine()).frequency_hz[1:4]
    rows = [printed(f"f{i}", text, f, "1/min") for i, (text, f) in enumerate(zip(MARINE, found, strict=True), start=1)]
    text = "E. J. Gunter, W. J. Chen, Introduction to Dynamics of Rotor-Bearing Systems (2001), example 8.1."
    return Case("Marine train of two turbines with double reduction", text, tuple(rows))


def star() -> Case:
    case = MODAL["star_four_equal_branches"]
    found = pt.modes(build(case)).frequency_hz
    rows = [
        Row(f"f{i}", hz, float(f), "Hz", case["tolerance"]["rel"] * max(hz, 1.0))
        for i, (hz, f) in enumerate(zip(case["expected_hz"], found, strict=True))
    ]
    return Case("Hub with four equal branches", "Closed form: ω² = 0, k/J three times, 5 k/J.", tuple(rows))


def cases() -> list[Case]:
    return [branched(), *front_wheel_drive(), wind_turbine(), marine(), star()]
