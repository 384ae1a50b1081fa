"""C of a control unit: compiled without a warning it commands what Python does, through shifts, limits, rates and bumps."""

import shutil
import subprocess

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk

DT = 0.01
COMPILER = shutil.which("cc") or shutil.which("gcc")
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-pedantic", "-O1")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
MAIN = """
#include <stdio.h>
int main(void) {
    static unit_state s;
    double u[5];
    unit_start(&s, (REAL)%r);
    while (scanf("%%lf %%lf %%lf %%lf %%lf", &u[0], &u[1], &u[2], &u[3], &u[4]) == 5)
        printf("%%.17g\\n", (double)unit_step(&s, (REAL)u[0], (REAL)u[1], (REAL)u[2], (REAL)u[3], (REAL)u[4]));
    return 0;
}
"""


def two_dof(plant):
    """Feedforward, reference model and feedback: a controller with states."""
    model = pt.two_mass(plant.car)
    feedback = antijerk.speed_difference(plant, gain=4.0)
    return antijerk.two_dof(plant, model, feedback, antijerk.inverse_notch(plant, model))


def plant_of(gear, other):
    return pt.SampledPlant(car=pt.examples.p2_hybrid(gear, other), torque_limits=(-200.0, 300.0))


PLANTS = {gear: plant_of(gear, other) for gear, other in ((1, 2), (2, 1))}
GEARS = {plant.ratio: two_dof(plant) for plant in PLANTS.values()}
UNITS = {
    "gears": {"controllers": GEARS, "torque_limits": (-200.0, 300.0), "torque_rate": (1500.0, 3000.0)},
    "any gear": {"controllers": GEARS[PLANTS[1].ratio], "torque_limits": (0.0, 160.0)},
    "one gear": {"controllers": {PLANTS[1].ratio: GEARS[PLANTS[1].ratio]}},
    "constant power": {
        "controllers": GEARS,
        "torque_limits": {0.0: (-200.0, 200.0), 150.0: (-200.0, 200.0), 200.0: (-150.0, 150.0), 300.0: (-100.0, 100.0)},
    },
    "no controller": {"controllers": None, "torque_limits": (-200.0, 120.0), "torque_rate": 800.0},
}


def compiled(unit, folder, precision="double", torque=0.0):
    """The program that reads signals and prints commands."""
    source = antijerk.c_source(unit, "unit", precision) + MAIN.replace("REAL", precision) % torque
    (folder / "unit.c").write_text(source)
    subprocess.run([COMPILER, *STRICT, "unit.c", "-o", "unit"], cwd=folder, check=True)
    return folder / "unit"


def commands(program, signals):
    text = "\n".join(" ".join(repr(float(value)) for value in row) for row in signals)
    out = subprocess.run([program], input=text, capture_output=True, text=True, check=True).stdout
    return np.array(out.split(), float)


@needs_compiler
@pytest.mark.parametrize("name", UNITS)
def test_compiled_it_commands_what_python_does_over_a_shift(name, tmp_path):
    """Signals of the loop as it drove; commands equal to 1e-12 of their size, and within its limits those of the loop."""
    unit = pt.ControlUnit(dt=DT, **UNITS[name])
    response = pt.controlled_shift(PLANTS[1], unit, "odd_clutch", "even_clutch")
    names = ("torque_demand", "engine_speed", "wheels_speed", "ratio")
    signals = np.column_stack([*(response[name][:-1:10] for name in names), np.zeros(250)])
    assert len({*signals[:, 3].round(6)}) == 3  # first gear, none, second gear
    stepper = unit.start(150.0)
    expected = [stepper.step(*row) for row in signals.tolist()]
    found = commands(compiled(unit, tmp_path, torque=150.0), signals)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    drove = response["torque_command"][:-1:10]
    np.testing.assert_allclose(np.clip(found, -200.0, 300.0), drove, rtol=1e-12, atol=1e-12)


@needs_compiler
@pytest.mark.parametrize(("precision", "tolerance"), [("double", 1e-12), ("float", 2e-4)])
@pytest.mark.parametrize("name", UNITS)
def test_compiled_it_commands_what_python_does_whatever_it_reads(name, precision, tolerance, tmp_path):
    """Limits, rates, gears and compensation at random; ratios between two gears too."""
    unit, rng = pt.ControlUnit(dt=DT, **UNITS[name]), np.random.default_rng(3)
    speed = 200.0 + np.cumsum(rng.normal(0.0, 1.0, 400))
    ratios = np.repeat(rng.choice([0.0, 16.072, 9.963, 13.1, 13.0, 40.0], 40), 10)
    signals = np.column_stack(
        [
            rng.normal(100.0, 80.0, 400),
            speed,
            speed / 16.0 + rng.normal(0.0, 0.1, 400),
            ratios,
            rng.normal(0, 20.0, 400),
        ]
    )
    stepper = unit.start(40.0)
    expected = [stepper.step(*row) for row in signals.tolist()]
    found = commands(compiled(unit, tmp_path, precision, torque=40.0), signals)
    np.testing.assert_allclose(found, expected, rtol=tolerance, atol=tolerance * 300.0)


def test_its_numbers_are_in_one_constant_with_their_units():
    source = antijerk.c_source(pt.ControlUnit(dt=DT, **UNITS["gears"]), "unit")
    assert source.count("static const") == 1
    assert ".rise = 1500.0," in source
    assert "double rise;        /* N m/s, fastest rise of the command */" in source
    assert f".ratio = {{{PLANTS[1].ratio!r}, {PLANTS[2].ratio!r}}}," in source
    assert not any(word in source for word in ("malloc", "inf,", "nan", "stdlib"))


def test_what_has_no_limit_has_none_in_c():
    source = antijerk.c_source(pt.ControlUnit(controllers=None, dt=DT), "unit")
    assert ".torque_low = {-INFINITY}," in source
    assert ".rise = INFINITY," in source


def test_a_unit_with_a_controller_that_is_not_linear_is_refused():
    unit = pt.ControlUnit(controllers=antijerk.scheduled(GEARS, dt=DT), dt=DT)
    with pytest.raises(pt.PowertrainError, match="a schedule over gears are for a ControlUnit to have"):
        antijerk.c_source(unit)
