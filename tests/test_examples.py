"""Examples: frequencies as published, typical cars plausible, every one of them fit for what the package does.

Of examples/files, examples/published, examples/typical.
"""

import matplotlib.pyplot as plt
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.cli import main
from powertrain_ctrl.examples.files import CARS
from powertrain_ctrl.examples.typical import ALL_GEARS, P2_GEARS, REAR_GEARS, TRUCK_GEARS

MAKERS = {name: getattr(pt.examples, name) for name in CARS}
GEARED = {"p2_hybrid": P2_GEARS, "rear_wheel_drive": REAR_GEARS, "all_wheel_drive": ALL_GEARS, "truck": TRUCK_GEARS}
TYPICAL = ("electric", *GEARED)
# first mode in first and highest gear [Hz]: shuffle of trucks and cars lies between 0.5 and 10 Hz
SHUFFLE = (0.5, 10.0)


def test_every_example_has_a_function_and_a_file():
    assert set(CARS) | {"path"} | {"DAMPING"} == set(pt.examples.__all__)
    assert {path.stem for path in pt.examples.path("truck").parent.glob("*.toml")} == {*CARS, "source_tables"}


@pytest.mark.parametrize("name", CARS)
def test_file_and_function_give_the_same_driveline(name):
    car = MAKERS[name](damping="closed") if name == "conventional" else MAKERS[name]()
    assert pt.load(pt.examples.path(name)) == car


def test_the_wind_turbine_swings_as_published():
    """NREL/TP-500-38060: free at both ends 2.22 Hz, 5 % of critical damping."""
    modes = pt.modes(pt.examples.wind_turbine())
    J1, J2, k, d = 534.116 * 97.0**2, 38759236.0, 867637000.0, 6215000.0
    omega = np.sqrt(k / J1 + k / J2)
    assert modes.omega[1] == pytest.approx(omega, rel=1e-12)
    assert f"{modes.frequency_hz[1]:.2f}" == "2.22"
    assert modes.damping_ratio[1] == pytest.approx(d * omega / (2.0 * k), rel=1e-9)
    assert f"{100 * modes.damping_ratio[1]:.0f}" == "5"


def test_the_marine_train_swings_as_published():
    """Gunter, Chen (2001), example 8.1: 177.7, 220.2, 1282.6 cycles a minute."""
    cycles = 60.0 * pt.modes(pt.examples.marine()).frequency_hz[1:4]
    assert [f"{each:.1f}" for each in cycles] == ["177.7", "220.2", "1282.6"]


def test_the_marine_train_has_the_inches_and_pounds_of_the_book():
    car, unit = pt.examples.marine(), 0.45359237 * 9.80665 * 0.0254  # N m of a lb in
    inertias = {"propeller": 2.454e6, "bull_gear": 0.826e6, "lp_turbine": 1.509e4, "hp_turbine": 2.612e2}
    for name, value in inertias.items():
        assert car[name].J == pytest.approx(value * unit, rel=1e-9)
    stiffnesses = {"propeller_shaft": 826e6, "lp_quill": 203.94e6, "hp_quill": 24.17e6, "lp_shaft": 30.51e6}
    for name, value in stiffnesses.items():
        assert car[name].stiffness == pytest.approx(value * unit, rel=1e-9)
    for side, ratio in {"hp": 78.2365, "lp": 40.0424}.items():
        steps = [car[f"{side}_{step}_reduction"].ratio for step in ("first", "second")]
        assert np.prod(steps) == pytest.approx(ratio, rel=1e-12)


@pytest.mark.parametrize("name", GEARED)
def test_gears_get_longer_and_the_shuffle_faster_with_each(name):
    assert list(GEARED[name]) == sorted(GEARED[name], reverse=True)
    first = [pt.modes(MAKERS[name](gear)).frequency_hz[1] for gear in range(1, len(GEARED[name]) + 1)]
    assert first == sorted(first)
    assert SHUFFLE[0] < first[0] < first[-1] < SHUFFLE[1]
    for gear in (0, len(GEARED[name]) + 1, 1.5):
        with pytest.raises(pt.ParameterError, match=f"gear = {gear}, permitted: "):
            MAKERS[name](gear)


def test_the_steps_of_the_truck_are_those_of_a_gearbox_with_splitter_and_range():
    """Twelve gears in geometric steps of 1.25 to 1.31, published with two decimals."""
    steps = np.array(TRUCK_GEARS[:-1]) / TRUCK_GEARS[1:]
    assert len(TRUCK_GEARS) == 12
    assert (np.abs(steps - 14.94 ** (1 / 11)) < 0.04).all()


@pytest.mark.parametrize("gear", range(1, 7))
def test_gears_of_the_hybrid_drive_through_their_own_half_of_the_gearbox(gear):
    car = pt.examples.p2_hybrid(gear)
    driving, waiting = ("odd", "even") if gear % 2 else ("even", "odd")
    assert car.released == {f"{waiting}_clutch"}
    assert car[f"{driving}_gear"].ratio == P2_GEARS[gear - 1]
    assert car[f"{waiting}_gear"].ratio == P2_GEARS[gear if gear < 6 else 4]
    assert pt.SampledPlant(car=car).ratio == pytest.approx(P2_GEARS[gear - 1] * 4.1, rel=1e-12)


def test_any_gear_of_the_other_half_can_be_preselected_and_no_other():
    assert pt.examples.p2_hybrid(3, preselected=2)["even_gear"].ratio == 2.43
    with pytest.raises(pt.PowertrainError, match=r"preselected = 5, permitted with gear = 3: even gears"):
        pt.examples.p2_hybrid(3, preselected=5)


def test_the_electric_drive_of_the_hybrid_has_no_engine():
    hybrid = pt.examples.p2_hybrid()
    electric = hybrid.release("separation_clutch").part("vehicle")
    assert "engine" not in electric.nodes
    assert pt.modes(electric).frequency_hz[1] > pt.modes(hybrid).frequency_hz[1]
    assert pt.two_mass(hybrid.release("separation_clutch")).driving == "emachine"


def test_unequal_half_shafts_carry_equal_torques():
    car = pt.examples.rear_wheel_drive()
    response = pt.load_change(car, timepts=np.linspace(0.0, 2.6, 53))
    np.testing.assert_allclose(response["left_shaft_torque"], response["right_shaft_torque"], atol=1e-8)
    assert np.abs(response["left_shaft_twist"] - response["right_shaft_twist"]).max() > 0.01


@pytest.mark.parametrize("name", CARS)
@pytest.mark.parametrize("method", ["modal", "source", "series"])
def test_every_example_has_its_control_model(name, method):
    car = MAKERS[name]()
    if name == "front_wheel_drive":
        car = car.replace("tyres", stiffness=None, damping=0.0)  # a damper alone is no spring to cut at
    model = pt.two_mass(car, method)
    # the tyre left out rings up to a quarter too high
    tolerance = {"modal": 1e-9, "source": 0.25, "series": 0.07}[method]
    assert model.frequency_hz == pytest.approx(pt.modes(car).frequency_hz[1], rel=tolerance)


@pytest.mark.parametrize("name", TYPICAL)
def test_everything_in_a_typical_car_is_damped(name):
    poles = pt.poles(MAKERS[name]())
    assert poles.real.max() < 1e-9
    rings = poles[np.abs(poles.imag) > 1e-6]
    assert (-rings.real / np.abs(rings)).min() > 0.02


@pytest.mark.parametrize("name", CARS)
def test_every_example_can_be_drawn(name):
    axes = pt.plots.schematic(MAKERS[name]())
    shown = {text.get_text() for text in axes.texts}
    assert any("vehicle" in text or "rotor" in text or "propeller" in text for text in shown)
    plt.close(axes.figure)


@pytest.mark.parametrize("name", CARS)
def test_the_command_line_shows_the_modes_of_every_example(name, capsys):
    assert main(["modes", str(pt.examples.path(name))]) == 0
    assert "rigid motion" in capsys.readouterr().out


@pytest.mark.parametrize("name", CARS)
def test_the_file_says_what_is_published_and_what_typical(name):
    text = pt.examples.path(name).read_text()
    said = MAKERS[name].__doc__
    if name not in ("conventional", "front_wheel_drive"):
        assert "ublished" in text
        assert "ublished" in said
    if name in TYPICAL:
        assert "ypical" in text
        assert "not published" in text
        assert "ypical" in said
