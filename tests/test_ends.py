"""Which node is engine, wheels and vehicle, which part is driven and in which ratio, on cars where it is not plain."""

import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.driveline.ends import Ends, ends, reached, resting_nodes

ENGINE = pt.Inertia("engine", J=0.25)
CLUTCH = pt.Clutch("clutch", "engine", "input", max_torque=300.0)
INPUT = pt.Inertia("input", J=0.02)
GEAR = pt.Gear("gearbox", "input", "axle", ratio=12.0)
VEHICLE = pt.Mass("vehicle", m=1400.0)


def axle(side, drives=True):
    """A wheel on its tyre and, where it is driven, its half-shaft."""
    shaft = [pt.SpringDamper(f"{side}_shaft", "axle", side, stiffness=6e3)] if drives else []
    return [*shaft, pt.Inertia(side, J=1.5), pt.Tyre(f"{side}_tyre", side, "vehicle", radius=0.3, stiffness=4e5)]


FRONT = [*axle("left"), *axle("right")]
CAR = pt.Driveline(*axle("rear", drives=False), ENGINE, CLUTCH, INPUT, GEAR, *FRONT, VEHICLE)


def test_wheels_that_only_roll_along_are_not_those_that_are_driven():
    found = ends(CAR)
    assert (found.engine, found.driving, found.wheels, found.vehicle) == (
        "engine",
        "engine",
        ("left", "right"),
        "vehicle",
    )
    assert found.part is CAR
    assert [tyre.name for tyre in found.driven_tyres] == ["left_tyre", "right_tyre"]


def test_behind_an_open_clutch_the_node_there_drives():
    found = ends(CAR.release("clutch"))
    assert (found.engine, found.driving, found.wheels) == ("engine", "input", ("left", "right"))
    assert "engine" not in found.part.nodes


def test_a_node_called_wheels_comes_before_the_tyres():
    sensor = pt.SpringDamper("hub", "left", "wheels", stiffness=1e6), pt.Inertia("wheels", J=0.1)
    assert ends(pt.Driveline(*CAR, *sensor)).wheels == ("wheels",)


def test_without_tyres_there_are_no_wheels_and_without_a_mass_no_vehicle():
    found = ends(pt.Driveline(ENGINE, CLUTCH, INPUT))
    assert (found.wheels, found.vehicles, found.vehicle) == ((), (), None)


def test_where_none_of_several_parts_carries_a_vehicle_one_has_to_be_chosen():
    with pytest.raises(
        pt.TopologyError, match=r"in several parts and none carries a vehicle; choose one with car\.part"
    ):
        _ = ends(pt.Driveline(ENGINE, CLUTCH, INPUT).release("clutch")).part


def test_what_is_held_at_rest_does_not_drive():
    planets = pt.Planetary("planets", "sun", "ring", "carrier", ratio=2.0)
    bodies = [pt.Inertia(node, J=0.1) for node in ("ring", "sun", "carrier")]
    car = pt.Driveline(*bodies, planets, pt.Clutch("brake", "ring", max_torque=100.0))
    assert resting_nodes(car) == {"ring"}
    assert ends(car).engine == "sun"
    assert ends(car.release("brake")).engine == "ring"


def test_what_is_reached_ends_at_elements_left_out_open_clutches_and_nodes_at_rest():
    assert reached(CAR, "engine", ["left_shaft", "right_shaft"]) == {"engine", "input", "axle"}
    assert reached(CAR.release("clutch"), "engine", []) == {"engine"}


def test_the_ratio_is_over_the_mean_speed_of_the_wheels():
    motion = {"engine": 12.0, "left": 0.9, "right": 1.1, "vehicle": 0.3}
    assert Ends(CAR).at_wheels(motion) == pytest.approx(1.0)
    assert Ends(CAR).ratio(motion) == pytest.approx(12.0)


def test_a_control_model_says_its_wheels_itself():
    model = pt.two_mass(pt.Driveline(*CAR))
    assert model.rim_share > 0.0  # its tyre is behind them
    assert ends(model).wheels == (model.wheels,) == ("left",)


def test_plant_control_model_and_comparison_have_the_same_ends():
    plant, model = pt.SampledPlant(car=CAR), pt.two_mass(CAR)
    assert (plant.engine, plant.wheels, plant.vehicle) == ("engine", ("left", "right"), "vehicle")
    assert (model.driving, model.wheels, model.vehicle) == ("engine", "left", "vehicle")
    assert plant.ratio == pytest.approx(12.0, rel=1e-12)
    assert model.ratio == pytest.approx(12.0, rel=1e-12)
    assert pt.compare_models(CAR, {"modal": model}, ramps=0.1)["modal"].frequency_error == pytest.approx(0.0, abs=1e-9)


def test_the_report_shows_the_wheels_that_are_driven():
    from powertrain_ctrl.report.subject import Subject

    assert Subject(CAR, "car").wheels == "left"
    assert Subject(CAR, "car").ratio == pytest.approx(12.0, rel=1e-12)
