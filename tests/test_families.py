"""Families against the same variants one by one, and against themselves in other parts and by other hands.

Of families/variants, families/structure, families/chains, families/frequencies, families/eigenvalues, families/responses,
families/loops, families/launches, families/impedances, families/reductions, families/executors, families/results,
families/parts, families/failures, families/evaluation, families/collection, families/making, families/sampling.
"""

import copy
import multiprocessing
import os
import pickle
import subprocess
import sys
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import KW_ONLY, dataclass
from math import sqrt
from pathlib import Path

import mpmath
import numpy as np
import pytest
import scipy.linalg

import powertrain_ctrl as pt
from powertrain_ctrl.elements import Element, quantity
from powertrain_ctrl.elements.element import ComplianceRow, InertiaRow
from powertrain_ctrl.families import launches, parts
from powertrain_ctrl.families.failures import failed

ROOT = Path(__file__).parents[1]
CAR = pt.examples.conventional()


def numbers(car):
    """Every parameter of every element that is a number."""
    return [
        f"{element.name}.{name}"
        for element in car
        for name in ("J", "m", "stiffness", "damping", "ratio", "radius", "inertia", "max_torque", "loss_factor")
        if getattr(element, name, 0.0)
    ]


def around(car, n, spread=0.1, seed=0, names=None):
    """Values around those of a car, for each name."""
    random = np.random.default_rng(seed)
    values = {}
    for name in names or numbers(car):
        element, parameter = name.split(".")
        values[name] = getattr(car[element], parameter) * np.exp(spread * random.standard_normal(n))
    return values


def axle():
    """Open differential, two half-shafts and tyres: a planetary set, springs in a loop, a shaft with inertia."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.25),
        pt.Gear("gearbox", "engine", "pinion", ratio=9.0),
        pt.Shaft("propshaft", "pinion", "case", stiffness=2e4, inertia=0.05, damping=3.0),
        pt.Inertia("case", J=0.1),
        pt.Planetary("differential", "left_side", "right_side", "case", ratio=1.0),
        pt.Inertia("left_side", J=0.01),
        pt.SpringDamper("left_shaft", "left_side", "left_wheel", stiffness=9e3, damping=20.0),
        pt.SpringDamper("right_shaft", "right_side", "right_wheel", stiffness=8e3, damping=25.0),
        pt.Inertia("left_wheel", J=1.2),
        pt.Inertia("right_wheel", J=1.3),
        pt.Tyre("left_tyre", "left_wheel", "vehicle", radius=0.3, stiffness=3e5, damping=2e3),
        pt.Tyre("right_tyre", "right_wheel", "vehicle", radius=0.31, stiffness=3.1e5, damping=2e3),
        pt.Mass("vehicle", m=1400.0),
    )


def with_drag():
    return pt.Driveline(
        *CAR, pt.Drag("bearing", "wheels", damping=4.0), pt.Drag("mount", "engine", damping=0.2, stiffness=5.0)
    )


def split_axle():
    """Two shafts from one body to one vehicle: a loop of springs."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.25),
        pt.SpringDamper("left", "engine", "left_wheel", stiffness=9e3, damping=20.0),
        pt.SpringDamper("right", "engine", "right_wheel", stiffness=7e3, damping=10.0),
        pt.Inertia("left_wheel", J=1.2),
        pt.Inertia("right_wheel", J=1.5),
        pt.Tyre("left_tyre", "left_wheel", "vehicle", radius=0.3, stiffness=3e5, damping=2e3),
        pt.Tyre("right_tyre", "right_wheel", "vehicle", radius=0.3, stiffness=3.1e5, damping=2e3),
        pt.Mass("vehicle", m=1400.0),
    )


CARS = {
    "source": CAR,
    "released": CAR.release("clutch"),
    "open differential": axle(),
    "drag and mount": with_drag(),
    "drag": pt.Driveline(*CAR, pt.Drag("bearing", "wheels", damping=4.0), pt.Drag("oil", "engine", damping=0.1)),
    "loop of springs": split_axle(),
    "pure damper": pt.Driveline(
        *CAR.release("clutch"),
        pt.SpringDamper("slip", "clutch_primary", "clutch_secondary", stiffness=0.0, damping=5.0),
    ).release("clutch"),
}


@pytest.mark.parametrize("name", CARS)
def test_modes_of_a_family_are_those_of_each_car(name):
    car = CARS[name]
    family = pt.family(car, around(car, 7))
    together = family.modes()
    for i, each in enumerate(family):
        alone = pt.modes(each)
        n = alone.n_rigid
        assert (together.omega[i, :n] == 0.0).all()
        np.testing.assert_allclose(together.omega[i], alone.omega, rtol=1e-12)
        np.testing.assert_allclose(together.damping_ratio[i], alone.damping_ratio, rtol=1e-12)
        np.testing.assert_allclose(together.shapes[i], alone.shapes, atol=1e-9)
    np.testing.assert_allclose(family.natural_frequencies(), together.frequency_hz, rtol=1e-12)


def test_loss_factors_damp_the_modes_of_a_family_and_have_no_poles():
    car = CAR.replace({"drive_shafts.loss_factor": 0.05, "damper_spring.loss_factor": 0.1})
    family = pt.family(car, around(car, 4))
    for zeta, each in zip(family.modes().damping_ratio, family, strict=True):
        np.testing.assert_allclose(zeta, pt.modes(each).damping_ratio, rtol=1e-11)
    for refused in (family.poles, family.load_change):
        with pytest.raises(pt.PowertrainError, match=r"variant 0 .*loss_factor"):
            refused()


@pytest.mark.parametrize("name", CARS)
def test_poles_of_a_family_are_those_of_each_car(name):
    car = CARS[name]
    family = pt.family(car, around(car, 5))
    for found, each in zip(family.poles(), family, strict=True):
        expected = pt.poles(each)
        assert (found[expected == 0.0] == 0.0).all()
        np.testing.assert_allclose(found, expected, rtol=1e-10)


@pytest.mark.parametrize("name", CARS)
def test_load_changes_of_a_family_are_those_of_each_car(name):
    car = CARS[name]
    family = pt.family(car, around(car, 3))
    together = family.load_change(timepts=np.linspace(0.0, 2.0, 401))
    for i, each in enumerate(family):
        alone = pt.load_change(each, timepts=together.time)
        for signal in together.signals:
            size = max(np.abs(alone[signal]).max(), 1e-6)
            np.testing.assert_allclose(together[signal][i], alone[signal], atol=1e-9 * size, err_msg=signal)


@pytest.mark.parametrize("name", CARS)
def test_forced_responses_of_a_family_are_those_of_each_car(name):
    car = CARS[name]
    family = pt.family(car, around(car, 3))
    omega = np.geomspace(0.1, 2e4, 80)
    inputs = {"engine_torque": 10.0 + 5.0j, "vehicle_force": -30.0}
    together = family.forced_response(omega, inputs)
    for i, each in enumerate(family):
        alone = pt.forced_response(each, omega, inputs)
        assert together.outputs == alone.outputs
        for signal in alone.outputs:
            np.testing.assert_allclose(together[signal][i], alone[signal], rtol=1e-9, atol=1e-300, err_msg=signal)


def test_frequency_responses_of_a_family_take_loss_factors_and_one_input():
    car = CAR.replace("drive_shafts", loss_factor=0.05)
    family = pt.family(car, around(car, 3))
    omega = np.geomspace(0.1, 2e4, 50)
    found = family.frequency_response(omega, "engine_torque", ["vehicle_acceleration", "tyres_torque"])
    for i, each in enumerate(family):
        G = pt.frequency_response(each, omega, "engine_torque", ["vehicle_acceleration", "tyres_torque"]).frdata
        np.testing.assert_allclose(found["vehicle_acceleration"][i], G[0, 0], rtol=1e-12)
        np.testing.assert_allclose(found["tyres_torque"][i], G[1, 0], rtol=1e-12)
    with pytest.raises(pt.UnknownNameError, match="engine_torque"):
        family.frequency_response(omega, "engin_torque")
    with pytest.raises(pt.ParameterError, match="omega"):
        family.frequency_response([0.0, 1.0], "engine_torque")


def test_load_changes_at_uneven_times_are_those_at_even_ones():
    family = pt.family(CAR, around(CAR, 2))
    times = np.array([0.0, 0.5, 0.99, 1.0, 1.013, 1.1, 1.35, 2.0])
    uneven = family.load_change(timepts=times, outputs="vehicle_acceleration")["vehicle_acceleration"]
    even = family.load_change(timepts=np.linspace(0.0, 2.0, 2001), outputs="vehicle_acceleration")[
        "vehicle_acceleration"
    ]
    np.testing.assert_allclose(uneven, even[:, np.round(1000 * times).astype(int)], atol=1e-9)


MASSES = np.linspace(1200.0, 3000.0, 4)
ONE_CLUTCH = {
    "source": (CAR, {"vehicle.m": MASSES}, {}),
    "no lock": (CAR, {"vehicle.m": MASSES}, {"until": 2.0}),
    "no capacity": (CAR, {"vehicle.m": MASSES}, {"capacity": 0.0}),
    "some slip again": (CAR, {"vehicle.m": MASSES}, {"torque": 600.0, "engine_speed": 20.0}),
    "steps": (CAR, {"vehicle.m": MASSES[:2]}, {"duration": 0.0}),
    "locked and released": (CAR, {"clutch.locked": [True, False]}, {}),
    "lags behind": (CAR, {"vehicle.m": MASSES[:2]}, {"engine_speed": -300.0}),
    "never slips": (CAR, {"vehicle.m": MASSES[:2]}, {"engine_speed": 0.0}),
    "drag and a clutch the other way round": (
        pt.Driveline(
            pt.Inertia("engine", J=0.25),
            pt.Drag("bearings", "engine", damping=0.05),
            pt.Clutch("clutch", "input", "engine", max_torque=300.0, static_ratio=1.2),
            pt.Inertia("input", J=0.02),
            pt.Gear("gearbox", "input", "axle", ratio=12.0),
            pt.SpringDamper("halfshafts", "axle", "wheels", stiffness=12e3, damping=60.0),
            pt.Inertia("wheels", J=3.0),
            pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=8e5, damping=4e3),
            pt.Mass("vehicle", m=1400.0),
            pt.Drag("air", "vehicle", damping=20.0),
        ),
        {"halfshafts.stiffness": [6e3, 2e4], "gearbox.ratio": [13.0, 9.0]},
        {},
    ),
    "brake": (
        pt.Driveline(
            pt.Inertia("engine", J=0.2),
            pt.SpringDamper("shaft", "engine", "drum", stiffness=1e3, damping=1.0),
            pt.Inertia("drum", J=0.1),
            pt.Clutch("brake", "drum", max_torque=100.0),
        ),
        {"drum.J": [0.1, 0.2]},
        {"torque": 10.0, "capacity": 100.0},
    ),
    "friction that falls": (
        CAR.replace("clutch", friction=((0.0, 1.0), (100.0, 0.8))), {"vehicle.m": MASSES[:2]}, {"until": 2.5}
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", ONE_CLUTCH)
def test_launches_of_a_family_are_those_of_each_car(name):
    car, values, options = ONE_CLUTCH[name]
    family = pt.family(car, values)
    found = family.launch(**options)
    times = [0.0, options.get("until", 3.5)]
    for i, each in enumerate(family):
        response = pt.launch(each, timepts=times, **{k: v for k, v in options.items() if k != "until"})
        locks = [event for event in response.events if event.kind in ("lock", "slip", "release")]
        is_locked = bool(locks) and locks[-1].kind == "lock"
        np.testing.assert_allclose(found["lock_time"][i], locks[-1].time if is_locked else np.nan, rtol=1e-11)
        np.testing.assert_allclose(found["heat"][i], response.slip_energy[each.clutches[0]], rtol=1e-10, atol=1e-9)


def test_launches_of_a_family_are_computed_at_once(monkeypatch):
    monkeypatch.setattr(launches, "launch", None)
    assert np.isfinite(pt.family(CAR, {"vehicle.m": MASSES}).launch()["heat"]).all()


def test_a_launch_of_a_family_needs_one_clutch():
    with pytest.raises(pt.PowertrainError, match="needs one clutch, there are 0"):
        pt.family(pt.Driveline(pt.Inertia("a", J=1.0)), {"a.J": [1.0, 2.0]}).launch()


def test_metrics_of_a_load_change_are_ride_metrics_of_each_car():
    family = pt.family(CAR, around(CAR, 3))
    metrics = family.load_change(outputs="vehicle_acceleration").metrics()
    for i, car in enumerate(family):
        response = pt.load_change(car)
        final = 250.0 * pt.SampledPlant(car=car).final_acceleration
        alone = pt.ride_metrics(response.time, response["vehicle_acceleration"], final, start=1.0)
        for name in metrics.dtype.names:
            assert metrics[name][i] == pytest.approx(getattr(alone, name), rel=1e-9, nan_ok=True), name


@pytest.mark.parametrize("delay", [0.0, 0.004, 0.01, 0.025])
@pytest.mark.parametrize("lag", [0.0, 0.03])
def test_closed_loops_of_a_family_are_those_of_each_car(delay, lag):
    plant = pt.SampledPlant(car=CAR, lag=lag, delay=delay, torque_limits=(0.0, 260.0))
    controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    family = pt.family(CAR, around(CAR, 3))
    demand = pt.ramp(0.5, 0.1, 250.0)
    together = family.closed_loop(plant, controller, demand, duration=1.0, initial_torque=5.0)
    for i, car in enumerate(family):
        alone = pt.closed_loop(
            pt.SampledPlant(car=car, lag=lag, delay=delay, torque_limits=(0.0, 260.0)),
            controller,
            demand,
            duration=1.0,
            initial_torque=5.0,
        )
        assert together.signals == (*alone.inputs, *alone.outputs)
        for signal in together.signals:
            size = max(np.abs(alone[signal]).max(), 1e-6)
            np.testing.assert_allclose(together[signal][i], alone[signal], atol=1e-9 * size, err_msg=signal)


def test_a_loop_that_overflows_has_failed_even_if_it_does_so_in_the_last_sample():
    """And numpy warns of nothing."""
    values = {"lag": 0.0, "delay": 0.0, "torque_limits": (-np.inf, np.inf)}
    plant = pt.SampledPlant(car=CAR, **values)
    controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=20.0))
    family, demand = pt.family(CAR, {"engine.J": [0.3, 0.03]}), pt.ramp(0.1, 0.1, 100.0)
    with pytest.raises(pt.SignalError, match="unstable") as told:
        pt.closed_loop(pt.SampledPlant(car=family.car(1), **values), controller, demand, 30.0)
    at = float(str(told.value).split()[8])
    for duration in (at, at + 0.1):
        with pytest.warns(RuntimeWarning) as warned:
            found = family.closed_loop(plant, controller, demand, duration=duration)
        assert [str(each.message).partition(":")[0] for each in warned] == ["1 of 2 variants failed"]
        assert list(found.errors) == [1]
        assert str(told.value) in found.errors[1].reason
        assert np.isfinite(found["torque_unlimited"][0]).all()
        assert np.isnan(found["torque_unlimited"][1]).all()
    assert not family.closed_loop(plant, controller, demand, duration=at - 0.1).errors


def test_variants_that_fail_together_have_their_own_values():
    variants = pt.family(CAR, {"vehicle.m": [1500.0, 1600.0, 1700.0]})._variants.part(slice(1, 3))
    assert {number: each.values for number, each in failed(variants, "lost").items()} == {
        1: {"vehicle.m": 1600.0},
        2: {"vehicle.m": 1700.0},
    }


def test_margins_of_a_family_are_those_of_each_car():
    plant = pt.SampledPlant(car=CAR)
    controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    family = pt.family(CAR, {"vehicle.m": [1500.0, 2500.0]})
    margins = family.loop_margins(plant, controller)
    for i, car in enumerate(family):
        alone = pt.loop_margins(pt.SampledPlant(car=car), controller)
        assert margins["disk_margin"][i] == pytest.approx(alone.disk_margin, rel=1e-9)
        assert margins["zeta_first"][i] == pytest.approx(alone.zeta_first, rel=1e-9)
    assert margins.worst("disk_margin").variant == int(margins["disk_margin"].argmin())


def test_two_masses_of_a_family_are_those_of_each_car():
    family = pt.family(CAR, around(CAR, 4))
    models = family.two_mass()
    for i, car in enumerate(family):
        alone = pt.two_mass(car)
        for name in models.dtype.names:
            assert models[name][i] == pytest.approx(getattr(alone, name), rel=1e-10), name


# --- structure ---------------------------------------------------------------------------------------------------------


def test_a_locked_clutch_and_an_open_one_are_in_one_family():
    family = pt.family(CAR, {"clutch.locked": [True, False, True], "vehicle.m": [1500.0, 1600.0, 1700.0]})
    found = family.modes()
    assert [car.released for car in family] == [frozenset(), {"clutch"}, frozenset()]
    for i, car in enumerate(family):
        alone = pt.modes(car)
        np.testing.assert_allclose(found.omega[i, : len(alone)], alone.omega, rtol=1e-12)
        assert np.isnan(found.omega[i, len(alone) :]).all()


def test_a_gear_set_with_other_nodes_and_a_rigid_tyre_are_in_one_family():
    car = pt.Driveline(
        pt.Inertia("engine", J=0.3),
        pt.SpringDamper("shaft", "engine", "first", stiffness=3e3),
        pt.Inertia("first", J=0.02),
        pt.SpringDamper("layshaft", "first", "second", stiffness=9e3),
        pt.Inertia("second", J=0.03),
        pt.Gear("gears", "first", "wheels", ratio=4.0),
        pt.Inertia("wheels", J=2.0),
        pt.Tyre("tyre", "wheels", "vehicle", radius=0.3, stiffness=4e5),
        pt.Mass("vehicle", m=1200.0),
    )
    family = pt.family(car, {"gears.a": ["first", "second"], "tyre.stiffness": [4e5, None]}, grid=True)
    assert family.shape == (2, 2)
    for found, each in zip(family.modes().omega, family, strict=True):
        alone = pt.modes(each).omega
        np.testing.assert_allclose(found[: len(alone)], alone, rtol=1e-12)
        assert np.isnan(found[len(alone) :]).all()


def test_variants_that_cancel_where_others_do_not_are_told_apart():
    """Two gears in parallel agree in the first variant, so that one spring never twists; in the others it does."""
    car = pt.Driveline(
        pt.Inertia("a", J=0.3),
        pt.Gear("one", "a", "b", ratio=2.0),
        pt.Gear("other", "a", "c", ratio=2.0),
        pt.Inertia("b", J=0.2),
        pt.SpringDamper("between", "b", "c", stiffness=50.0, damping=0.1),
        pt.SpringDamper("out", "b", "d", stiffness=100.0, damping=0.1),
        pt.Inertia("d", J=1.0),
    )
    family = pt.family(car, {"other.ratio": [2.0, 2.5, 2.0, 3.0]})
    for i, each in enumerate(family):
        alone = pt.modes(each)
        np.testing.assert_allclose(family.modes().omega[i], alone.omega, rtol=1e-12)
        poles = pt.poles(each)
        np.testing.assert_allclose(family.poles()[i][: len(poles)], poles, rtol=1e-10)
        assert np.isnan(family.poles()[i][len(poles) :]).all()


def test_gears_that_contradict_each_other_in_one_variant_name_it():
    car = pt.Driveline(*CAR, pt.Gear("second_gear", "transmission", "gearbox_output", ratio=6.0))
    family = pt.family(car, {"second_gear.ratio": [6.0, 6.0, 4.0]})
    reason = (
        r"1 of 3 variants failed: variant 2 \(second_gear.ratio = 4.0\): TopologyError: second_gear holds .*standstill"
    )
    with pytest.warns(RuntimeWarning, match=reason):
        found = family.modes()
    assert list(found.errors) == [2]
    assert found.omega[:2].tobytes() == pt.family(car, {"second_gear.ratio": [6.0, 6.0]}).modes().omega.tobytes()
    assert np.isnan(found.omega[2]).all()


def test_repeated_frequencies_are_computed_one_by_one():
    car = pt.Driveline(
        pt.Inertia("hub", J=1.0),
        *(pt.Inertia(f"blade_{i}", J=0.1) for i in range(3)),
        *(pt.SpringDamper(f"root_{i}", "hub", f"blade_{i}", stiffness=100.0, damping=0.1 * i) for i in range(3)),
    )
    family = pt.family(car, {"hub.J": [1.0, 2.0]})
    for found, zeta, each in zip(family.modes().omega, family.modes().damping_ratio, family, strict=True):
        np.testing.assert_allclose(found, pt.modes(each).omega, rtol=1e-12)
        np.testing.assert_allclose(zeta, pt.modes(each).damping_ratio, rtol=1e-11)


@dataclass(frozen=True)
class Steel(Element):
    """Shaft of a diameter, with a root that no array has."""

    a: str
    b: str
    _: KW_ONLY
    diameter: float = quantity("m", "> 0 and finite")

    def __post_init__(self):
        super().__post_init__()
        if self.diameter > 0.5:
            raise pt.PowertrainError(f"{self.name}: thicker than the car")

    @property
    def nodes(self):
        return (self.a, self.b)

    @property
    def compliances(self):
        stiffness = 1e9 * sqrt(self.diameter) ** 8
        return (ComplianceRow(self.name, {self.a: 1.0, self.b: -1.0}, stiffness, 0.0),)


def test_elements_of_ones_own_need_no_arithmetic_for_arrays():
    car = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=2.0), Steel("shaft", "a", "b", diameter=0.03))
    family = pt.family(car, {"shaft.diameter": [0.03, 0.04], "a.J": [1.0, 1.5]})
    np.testing.assert_allclose(family.modes().omega, [pt.modes(each).omega for each in family], rtol=1e-12)
    with pytest.raises(pt.PowertrainError, match=r"variant 1 .*thicker than the car"):
        pt.family(car, {"shaft.diameter": [0.03, 0.6]})


@dataclass(frozen=True)
class Rubber(Element):
    """Ring whose structural damping rises with its temperature, by a root that no array has."""

    a: str
    b: str
    _: KW_ONLY
    temperature: float = quantity("K", "> 0 and finite")

    @property
    def nodes(self):
        return (self.a, self.b)

    @property
    def compliances(self):
        loss_factor = 0.1 * sqrt(self.temperature / 300.0)
        return (ComplianceRow(self.name, {self.a: 1.0, self.b: -1.0}, 4e4, 0.0, loss_factor),)


def test_elements_of_ones_own_keep_their_loss_factor():
    """Of a pair on one spring the damping ratio is half the loss factor, at any inertia."""
    car = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=2.0), Rubber("ring", "a", "b", temperature=300.0))
    family = pt.family(car, {"ring.temperature": [300.0, 432.0], "a.J": [1.0, 1.5]})
    np.testing.assert_allclose(family.modes().damping_ratio[:, 1], [0.05, 0.06], rtol=1e-12)
    omega = [10.0, 190.0, 2000.0]
    found = family.forced_response(omega, {"a_torque": 1.0}, "ring_torque")["ring_torque"]
    for torque, J, loss_factor in zip(found, (1.0, 1.5), (0.1, 0.12), strict=True):
        # twist q of the pair: reduced inertia Jr, (k (1 + j eta) - Jr w^2) q = Jr / J
        reduced = J * 2.0 / (J + 2.0)
        k = 4e4 * (1.0 + 1j * loss_factor)
        np.testing.assert_allclose(torque, k * (reduced / J) / (k - reduced * np.square(omega)), rtol=1e-12)


# --- parts and hands ---------------------------------------------------------------------------------------------------


def everything(family):
    plant = pt.SampledPlant(car=CAR, delay=0.014)
    controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
    modes = family.modes()
    loops = family.closed_loop(plant, controller, pt.ramp(0.1, 0.1, 250.0), duration=0.5)
    changes = family.load_change(timepts=np.linspace(0.9, 1.3, 41))
    metrics = family.load_change(timepts=np.linspace(0.9, 1.9, 101), outputs="vehicle_acceleration").metrics()
    return [
        modes.omega,
        modes.damping_ratio,
        modes.shapes,
        family.natural_frequencies(),
        family.poles(),
        *(loops[name] for name in loops.signals),
        *(changes[name] for name in changes.signals),
        *(metrics[name] for name in metrics.dtype.names),
        *(
            family.frequency_response([1.0, 30.0, 900.0], "engine_torque")[name]
            for name in ("vehicle_speed", "tyres_torque")
        ),
        *(family.two_mass()[name] for name in ("J1", "stiffness", "damping")),
        *(family.launch()[name] for name in ("lock_time", "heat")),
    ]


def spectra(family):
    return [family.modes().omega, family.modes().damping_ratio, family.modes().shapes, family.poles()]


@pytest.mark.parametrize(
    ("name", "computed"), [("source", everything), ("open differential", spectra), ("loop of springs", spectra)]
)
def test_no_variant_depends_on_what_else_is_in_the_family(name, computed, monkeypatch):
    car = CARS[name]
    family = pt.family(car, around(car, 23))
    whole = computed(family)
    monkeypatch.setattr(parts, "MEMORY", 2**16)
    in_parts = computed(family)
    alone = computed(pt.family(car, {key: column[5:6] for key, column in family.values.items()}))
    for a, b, c in zip(whole, in_parts, alone, strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()
        assert np.asarray(a)[5].tobytes() == np.asarray(c)[0].tobytes()


@pytest.mark.parametrize("name", ["source", "open differential", "loop of springs"])
@pytest.mark.parametrize("memory", [1, 2**12, 2**16])
def test_no_response_depends_on_how_many_variants_and_frequencies_are_computed_at_once(name, memory, monkeypatch):
    family, omega = pt.family(CARS[name], around(CARS[name], 7)), np.geomspace(3.0, 3000.0, 13)
    first, last = family.nominal.nodes[0], family.nominal.nodes[-1]
    asked = omega, f"{first}_torque", [f"{last}_acceleration", f"{first}_angle", *_torques(family.nominal)]
    whole = family.frequency_response(*asked)
    monkeypatch.setattr(parts, "MEMORY", memory)
    in_parts = family.frequency_response(*asked)
    for output in whole.outputs:
        assert whole[output].tobytes() == in_parts[output].tobytes()


def _torques(car):
    return [f"{element.name}_torque" for element in car if isinstance(element, (pt.SpringDamper, pt.Tyre))]


def first_frequency(car):
    return pt.modes(car).frequency_hz[1]


def lock_and_heat(car):
    response = pt.launch(car, timepts=[0.0, 3.5])
    return {"lock": response.events[-1].time, "heat": response.slip_energy["clutch"]}


def refuses_heavy_cars(car):
    if car["vehicle"].m > 2000.0:
        raise RuntimeError("too heavy")
    return car["vehicle"].m


def ends_the_worker(car):
    if car["vehicle"].m > 2000.0:
        os._exit(1)
    return car["vehicle"].m


class SubmitOnly(Executor):
    """Executor whose map refuses, as that of dask refuses iterators."""

    def submit(self, function, /, *args, **kwargs):
        future = Future()
        try:
            future.set_result(pickle.loads(pickle.dumps(function))(*pickle.loads(pickle.dumps(args)), **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future

    def map(self, *iterables, **kwargs):
        raise TypeError("iterators are not supported")


def forkserver(workers=2):
    return ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("forkserver"))


def test_every_executor_gives_identical_numbers():
    car = pt.examples.conventional(damping="open")
    family = pt.family(car, around(car, 6, names=["vehicle.m", "gearbox.ratio", "clutch.max_torque"]))
    here, modes = family.evaluate(lock_and_heat), family.modes()
    for executor in (ThreadPoolExecutor(2), SubmitOnly(), forkserver()):
        with executor:
            there = family.evaluate(lock_and_heat, executor=executor)
            assert there.tobytes() == here.tobytes()
            assert family.modes(executor=executor).damping_ratio.tobytes() == modes.damping_ratio.tobytes()


def test_joblib_gives_identical_numbers():
    joblib = pytest.importorskip("joblib")
    family = pt.family(CAR, {"vehicle.m": [1500.0, 2000.0, 2500.0]})
    with joblib.externals.loky.ProcessPoolExecutor(max_workers=2) as executor:
        assert (
            family.evaluate(first_frequency, executor=executor).tobytes() == family.evaluate(first_frequency).tobytes()
        )


def test_dask_gives_identical_numbers():
    distributed = pytest.importorskip("distributed")
    family = pt.family(CAR, {"vehicle.m": [1500.0, 2000.0, 2500.0]})
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            executor = client.get_executor()
            assert (
                family.evaluate(first_frequency, executor=executor).tobytes()
                == family.evaluate(first_frequency).tobytes()
            )
            assert family.modes(executor=executor).omega.tobytes() == family.modes().omega.tobytes()


def test_script_for_a_cluster_runs_on_two_workers_of_this_machine():
    pytest.importorskip("distributed")
    done = subprocess.run(
        [sys.executable, ROOT / "docs" / "study_on_a_cluster.py"],
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
    )
    assert done.stdout.startswith("lock: median 2.654, nine tenths within 2.523 to 2.805, largest of car 8\n"), (
        done.stderr
    )


def test_a_variant_that_fails_is_named_and_the_others_are_kept():
    family = pt.family(CAR, {"vehicle.m": [1500.0, 2500.0, 1800.0]})
    with pytest.warns(
        RuntimeWarning, match=r"1 of 3 variants failed: variant 1 \(vehicle.m = 2500.0\): RuntimeError: too heavy"
    ):
        result = family.evaluate(refuses_heavy_cars)
    np.testing.assert_array_equal(result, [1500.0, np.nan, 1800.0])
    assert result.errors[1].values == {"vehicle.m": 2500.0}
    assert result.worst("value").variant == 2
    np.testing.assert_array_equal(result.percentiles(50.0), 1650.0)


def test_all_variants_failing_is_an_error():
    family = pt.family(CAR, {"vehicle.m": [2500.0, 2600.0]})
    with pytest.raises(pt.PowertrainError, match=r"no variant could be computed: variant 0 .*too heavy"):
        family.evaluate(refuses_heavy_cars)


def test_a_worker_that_dies_is_reported_and_finished_work_is_kept():
    masses = [1500.0] * 40 + [2500.0] + [1600.0] * 40
    family = pt.family(CAR, {"vehicle.m": masses})
    with forkserver(1) as executor, pytest.warns(RuntimeWarning, match="BrokenProcessPool"):
        result = family.evaluate(ends_the_worker, executor=executor)
    assert 40 in result.errors
    assert (result[:30] == 1500.0).all()


def test_interrupted_work_returns_what_is_done():
    family = pt.family(CAR, {"vehicle.m": [1500.0, 1600.0, 1700.0, 1800.0]})

    def until_the_third(car):
        if car["vehicle"].m > 1650.0:
            raise KeyboardInterrupt
        return car["vehicle"].m

    with pytest.warns(RuntimeWarning, match="2 of 4 variants failed: variant 2 .*interrupted"):
        result = family.evaluate(until_the_third)
    np.testing.assert_array_equal(result, [1500.0, 1600.0, np.nan, np.nan])


@dataclass(frozen=True)
class Trap(Element):
    """Inertia that ends a worker, but not this process."""

    node: str
    _: KW_ONLY
    J: float = quantity("kg m^2", "> 0 and finite")

    @property
    def nodes(self):
        return (self.node,)

    @property
    def inertias(self):
        if np.any(np.asarray(self.J) == 0.5) and multiprocessing.parent_process() is not None:
            os._exit(1)
        return (InertiaRow((self.node,), ((self.J,),)),)


def test_a_worker_that_dies_of_what_is_computed_at_once_is_reported_and_finished_work_is_kept(monkeypatch):
    car = pt.Driveline(*CAR, Trap("ring", "engine", J=0.1))
    family = pt.family(car, {"ring.J": [0.1, 0.2, 0.3, 0.5, 0.1, 0.2]})
    monkeypatch.setattr(parts, "MEMORY", 1)
    said = r"3 of 6 variants failed: variant 3 \(ring.J = 0.5\): BrokenProcessPool: "
    with forkserver(1) as executor, pytest.warns(RuntimeWarning, match=said):
        found = family.modes(executor=executor)
    assert [(i, failure.values) for i, failure in found.errors.items()] == [
        (i, {"ring.J": value}) for i, value in ((3, 0.5), (4, 0.1), (5, 0.2))
    ]
    assert found.omega[:3].tobytes() == family.modes().omega[:3].tobytes()
    assert np.isnan(found.omega[3:]).all()


class Losing(SubmitOnly):
    """Executor whose worker dies of the part in which one variant is."""

    def __init__(self, variant):
        self.variant = variant

    def submit(self, function, /, *args, **kwargs):
        if any(self.variant in arg.numbers for arg in args if hasattr(arg, "numbers")):
            raise BrokenExecutor("a worker died")
        return super().submit(function, *args, **kwargs)


PLANT = pt.SampledPlant(car=CAR)
CONTROLLER = pt.antijerk.one_dof(PLANT, pt.antijerk.speed_difference(PLANT, gain=6.0))
AT_ONCE = {
    "modes": lambda family, executor: family.modes(executor),
    "natural_frequencies": lambda family, executor: family.natural_frequencies(executor),
    "poles": lambda family, executor: family.poles(executor),
    "frequency_response": lambda family, executor: family.frequency_response(
        [3.0, 40.0], "engine_torque", executor=executor
    ),
    "forced_response": lambda family, executor: family.forced_response(
        [3.0, 40.0], {"engine_torque": 2.0}, executor=executor
    ),
    "load_change": lambda family, executor: family.load_change(executor=executor),
    "launch": lambda family, executor: family.launch(executor=executor),
    "two_mass": lambda family, executor: family.two_mass(executor),
    "closed_loop": lambda family, executor: family.closed_loop(
        PLANT, CONTROLLER, pt.ramp(0.5, 0.1, 250.0), 1.0, executor=executor
    ),
    "loop_margins": lambda family, executor: family.loop_margins(PLANT, CONTROLLER, executor),
}


@pytest.mark.parametrize("call", AT_ONCE)
def test_what_a_lost_worker_had_in_hand_is_nan_and_all_else_is_as_ever(call, monkeypatch):
    family = pt.family(CAR, {"vehicle.m": [1500.0, 1600.0, 1700.0, 1800.0]})
    whole = AT_ONCE[call](family, None).quantities()
    monkeypatch.setattr(parts, "MEMORY", 1)
    said = r"1 of 4 variants failed: variant 1 \(vehicle.m = 1600.0\): BrokenExecutor: a worker died"
    with pytest.warns(RuntimeWarning, match=said) as warned:
        found = AT_ONCE[call](family, Losing(1))
    assert len(warned) == 1
    assert found.errors == {1: (1, {"vehicle.m": 1600.0}, "BrokenExecutor: a worker died")}
    assert "4 variants, 1 of them failed" in found.heading
    for name, quantity_ in found.quantities().items():
        values = quantity_.values
        assert np.isnan(values[1]).all(), name
        for i in (0, 2, 3):
            np.testing.assert_array_equal(values[i], whole[name].values[i])
    assert list(found.rows())
    assert found.worst(next(iter(whole))).variant != 1


def test_metrics_and_tracked_modes_go_on_without_a_lost_variant(monkeypatch):
    family = pt.family(CAR, {"vehicle.m": [1500.0, 1600.0, 1700.0]})
    metrics, tracked = family.load_change().metrics(), family.modes().tracked()
    monkeypatch.setattr(parts, "MEMORY", 1)
    with pytest.warns(RuntimeWarning, match="1 of 3"):
        fewer, modes = family.load_change(executor=Losing(1)).metrics(), family.modes(Losing(1)).tracked()
    assert list(fewer.errors) == list(modes.errors) == [1]
    for name in metrics.dtype.names:
        np.testing.assert_array_equal(fewer[name], np.where([True, False, True], metrics[name], np.nan))
    np.testing.assert_array_equal(modes.omega[2], tracked.omega[2])


@pytest.mark.parametrize("call", ["modes", "load_change", "launch", "closed_loop"])
def test_one_variant_that_fails_in_a_thread_is_named_and_all_else_is_as_ever(call):
    car = pt.Driveline(*CAR, pt.Gear("second_gear", "transmission", "gearbox_output", ratio=6.0))
    family = pt.family(car, {"second_gear.ratio": [6.0, 4.0, 6.0], "vehicle.m": [1500.0, 1600.0, 1700.0]})
    said = r"1 of 3 variants failed: variant 1 \(second_gear.ratio = 4.0, vehicle.m = 1600.0\): TopologyError: "
    with ThreadPoolExecutor(2) as threads, pytest.warns(RuntimeWarning, match=said):
        found = AT_ONCE[call](family, threads)
    assert list(found.errors) == [1]
    alone = AT_ONCE[call](pt.family(car, {"vehicle.m": [1500.0, 1700.0]}), None)
    for name, quantity_ in found.quantities().items():
        assert np.isnan(quantity_.values[1]).all()
        np.testing.assert_array_equal(quantity_.values[[0, 2]], alone.quantities()[name].values)


@pytest.mark.parametrize("call", AT_ONCE)
def test_what_the_nominal_car_cannot_do_either_is_an_error_of_the_call(call):
    car = pt.Driveline(*CAR, pt.OneWayClutch("freewheel", "engine", "wheels"))
    with pytest.raises(pt.PowertrainError, match=r"freewheel|no single ratio"):
        AT_ONCE[call](pt.family(car, {"vehicle.m": [1500.0, 1600.0]}), None)


@pytest.mark.parametrize("call", ["modes", "load_change"])
def test_interrupted_work_at_once_returns_what_is_done(call, monkeypatch):
    family = pt.family(CAR, {"vehicle.m": [1500.0, 1600.0, 1700.0, 1800.0]})
    whole = getattr(family, call)()
    monkeypatch.setattr(parts, "MEMORY", 1)

    def until_the_third(done, count):
        if done == 3:
            raise KeyboardInterrupt

    with pytest.warns(RuntimeWarning, match="2 of 4 variants failed: variant 2 .*interrupted"):
        found = getattr(family, call)(progress=until_the_third)
    assert list(found.errors) == [2, 3]
    for name, quantity_ in found.quantities().items():
        np.testing.assert_array_equal(quantity_.values[:2], whole.quantities()[name].values[:2])
        assert np.isnan(quantity_.values[2:]).all()


@pytest.mark.parametrize("call", ["modes", "evaluate"])
def test_an_interrupt_before_anything_is_done_is_one(call):
    family = pt.family(CAR, {"vehicle.m": [1500.0, 1600.0]})

    def at_once(*_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        family.modes(progress=at_once) if call == "modes" else family.evaluate(at_once)


def test_progress_counts_variants():
    seen = []
    family = pt.family(CAR, {"vehicle.m": [1500.0, 1600.0, 1700.0]})
    family.evaluate(first_frequency, progress=lambda done, count: seen.append((done, count)))
    family.modes(progress=lambda done, count: seen.append((done, count)))
    assert seen == [(1, 3), (2, 3), (3, 3), (3, 3)]


def test_any_value_comes_back_in_order():
    family = pt.family(CAR, {"vehicle.m": [1500.0, 2500.0]})
    assert family.evaluate(lambda car: pt.modes(car).shapes).shape == (2, 10, 7)
    assert [len(found) for found in family.evaluate(lambda car: pt.poles(car)[: int(car["vehicle"].m / 500)])] == [3, 5]
    assert family.evaluate(lambda car: car)[1] == family.car(1)


# --- accuracy ----------------------------------------------------------------------------------------------------------


def test_badly_scaled_variants_keep_their_digits():
    """Chains whose stiffnesses lie up to twelve decades apart, against 60 digits."""
    n, random = 7, np.random.default_rng(3)
    car = pt.Driveline(
        *(pt.Inertia(f"J{i}", J=1.0) for i in range(n)),
        *(pt.SpringDamper(f"k{i}", f"J{i}", f"J{i + 1}", stiffness=1.0) for i in range(n - 1)),
    )
    k = 10.0 ** random.uniform(-6.0, 6.0, (4, n - 1))
    J = 10.0 ** random.uniform(-1.0, 1.0, (4, n))
    values = {f"k{i}.stiffness": k[:, i] for i in range(n - 1)} | {f"J{i}.J": J[:, i] for i in range(n)}
    family = pt.family(car, values)
    with mpmath.workdps(60):
        for v in range(4):
            A = mpmath.zeros(n)
            for i in range(n - 1):
                for a, b, sign in ((i, i, 1), (i + 1, i + 1, 1), (i, i + 1, -1), (i + 1, i, -1)):
                    A[a, b] += sign * mpmath.mpf(k[v, i]) / mpmath.sqrt(mpmath.mpf(J[v, a]) * mpmath.mpf(J[v, b]))
            squares = sorted(mpmath.eigsy(A, eigvals_only=True))
            expected = np.array([float(mpmath.sqrt(square)) for square in squares[1:]])
            for omega in (family.modes().omega[v], 2.0 * np.pi * family.natural_frequencies()[v]):
                assert omega[0] == 0.0
                np.testing.assert_allclose(omega[1:], expected, rtol=1e-11)


@pytest.mark.parametrize("decades", [0.0, 2.0, 10.0])
def test_frequencies_of_chains_keep_their_digits(decades):
    """Nine bodies in a row, springs decades apart and some equal, in any order, against one-sided Jacobi."""
    n, random = 9, np.random.default_rng(5)
    order = random.permutation(n)
    car = pt.Driveline(
        *(pt.Inertia(f"J{i}", J=1.0) for i in range(n)),
        *(pt.SpringDamper(f"k{i}", f"J{order[i]}", f"J{order[i + 1]}", stiffness=1.0) for i in range(n - 1)),
    )
    k = 10.0 ** random.uniform(0.0, decades, (50, n - 1))
    J = 10.0 ** random.uniform(-1.0, 1.0, (50, n))
    k[::3, 4] = k[::3, 2]
    values = {f"k{i}.stiffness": k[:, i] for i in range(n - 1)} | {f"J{i}.J": J[:, i] for i in range(n)}
    found = pt.family(car, values).natural_frequencies()
    for v in range(50):
        B = np.zeros((n, n - 1))
        for i in range(n - 1):
            B[order[[i, i + 1]], i] = np.sqrt(k[v, i] / J[v, order[[i, i + 1]]]) * [1.0, -1.0]
        values_of_B, _, _, work, _, _ = scipy.linalg.lapack.dgejsv(np.asfortranarray(B), joba=4, jobt=0)
        expected = np.sort(values_of_B * (work[0] / work[1])) / (2.0 * np.pi)
        assert found[v][0] == 0.0
        np.testing.assert_allclose(found[v][1:], expected, rtol=3e-14)


# --- results -----------------------------------------------------------------------------------------------------------


def test_a_grid_has_every_value_with_every_other():
    family = pt.family(CAR, {"gearbox.ratio": [6.0, 3.0], "vehicle.m": [1500.0, 1600.0, 1700.0]}, grid=True)
    assert (len(family), family.shape) == (6, (2, 3))
    assert [(car["gearbox"].ratio, car["vehicle"].m) for car in family][3:5] == [(3.0, 1500.0), (3.0, 1600.0)]


def test_a_single_value_is_that_of_all_variants():
    family = pt.family(CAR, {"gearbox.ratio": 3.0, "vehicle.m": [1500.0, 1600.0]})
    assert [car["gearbox"].ratio for car in family] == [3.0, 3.0]


def test_samples_have_the_spread_asked_for_in_equal_shares():
    family = pt.sample(CAR, {"vehicle.m": 0.2, "gearbox.ratio": (3.0, 6.0)}, n=400, seed=5)
    log = np.sort(np.log(family.values["vehicle.m"] / 2000.0))
    # a Latin hypercube has one of 400 in each of 400 equal shares
    shares = np.array([mpmath.ncdf(value / 0.2) for value in log], dtype=float)
    assert (np.floor(400 * shares) == np.arange(400)).all()
    assert (np.floor(400 * (np.sort(family.values["gearbox.ratio"]) - 3.0) / 3.0) == np.arange(400)).all()
    again = pt.sample(CAR, {"vehicle.m": 0.2, "gearbox.ratio": (3.0, 6.0)}, n=400, seed=5)
    assert family.values["vehicle.m"].tobytes() == again.values["vehicle.m"].tobytes()
    other = pt.sample(CAR, {"vehicle.m": 0.2, "gearbox.ratio": (3.0, 6.0)}, n=400, seed=6)
    assert (family.values["vehicle.m"] != other.values["vehicle.m"]).any()


def test_sobol_samples_halve_every_parameter():
    family = pt.sample(CAR, {"vehicle.m": (1.0, 3.0), "wheels.J": (1.0, 3.0)}, n=64, method="sobol")
    heavy = family.values["vehicle.m"] > 2.0, family.values["wheels.J"] > 2.0
    assert [int(np.count_nonzero(a & b)) for a in (heavy[0], ~heavy[0]) for b in (heavy[1], ~heavy[1])] == [16] * 4


def test_tracked_modes_keep_their_shape_where_frequencies_cross():
    """Two bodies, each on a spring of its own to ground, loosely coupled: as one spring stiffens the frequencies cross."""
    car = pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.Inertia("b", J=1.0),
        pt.Drag("to_a", "a", damping=0.1, stiffness=100.0),
        pt.Drag("to_b", "b", damping=0.1, stiffness=150.0),
        pt.SpringDamper("between", "a", "b", stiffness=1e-3),
    )
    family = pt.family(car, {"to_a.stiffness": np.linspace(100.0, 200.0, 50)})
    plain, tracked = family.modes(), family.modes().tracked()
    assert (np.diff(plain.frequency_hz, axis=1) > 0.0).all()
    assert (np.diff(tracked.frequency_hz[:, 0]) > 0.0).all()
    np.testing.assert_allclose(tracked.frequency_hz[:, 1], 150.0**0.5 / (2 * np.pi), rtol=1e-4)
    assert (np.abs(tracked.shapes[:, 0, 0]) == 1.0).all()


def test_the_worst_variant_comes_with_its_car():
    family = pt.family(CAR, {"drive_shafts.damping": [400.0, 100.0, 200.0]})
    worst = family.modes().worst("damping_ratio")
    assert worst.value == np.nanmin(family.modes().damping_ratio)
    assert family.poles().worst("poles").variant == 1
    first = family.evaluate(lambda car: pt.modes(car).damping_ratio[1])
    assert first.worst("value").variant == 0
    assert first.car(1)["drive_shafts"].damping == 100.0


@pytest.mark.parametrize("way", [copy.copy, copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))])
def test_arrays_of_a_family_stay_so_in_copies_and_their_parts_are_plain(way):
    found = pt.family(CAR, {"vehicle.m": [1500.0, 2500.0]}).poles()
    again = way(found)
    assert (again.tobytes(), again.worst("poles"), again.car(1)) == (
        found.tobytes(),
        found.worst("poles"),
        found.car(1),
    )
    assert not again.flags.writeable
    for plain in (found[0], found[:, 1:], 2.0 * found, np.abs(found), found.sum()):
        assert type(plain) in (np.ndarray, np.complex128)
    assert repr(found.round(3)).startswith("array(")


def test_results_become_dicts_and_tables():
    family = pt.family(CAR, {"vehicle.m": [1500.0, 2500.0], "clutch.locked": [True, False]})
    columns = family.modes().to_dict()
    assert columns["vehicle.m"] == [1500.0, 2500.0]
    assert columns["damping_ratio"][0][0] is None
    assert columns["frequency_hz"][0][1] == family.modes().frequency_hz[0, 1]
    for thing in (family, family.modes(), family.poles(), family.evaluate(first_frequency)):
        assert "2 variants" in repr(thing)
        assert thing._repr_html_().startswith("<p>")
    response = pt.family(CAR, {"vehicle.m": [1500.0, 2500.0]}).load_change(outputs="vehicle_speed")
    assert "vehicle_speed  m/s" in repr(response)


def test_results_become_labelled_arrays():
    xarray = pytest.importorskip("xarray")
    family = pt.family(CAR, {"vehicle.m": [1500.0, 2500.0]})
    data = family.modes().to_xarray()
    assert isinstance(data, xarray.Dataset)
    assert data["frequency_hz"].dims == ("variant", "mode")
    assert (data["frequency_hz"].attrs["units"], data["vehicle.m"].attrs["units"]) == ("Hz", "kg")
    np.testing.assert_array_equal(data["vehicle.m"], [1500.0, 2500.0])
    response = family.load_change(outputs="engine_speed").to_xarray()
    assert response["engine_speed"].dims == ("variant", "time")
    assert family.evaluate(lock_and_heat_of_nothing).to_xarray()["heat"].dims == ("variant",)


def lock_and_heat_of_nothing(car):
    return {"heat": car["vehicle"].m}


# --- what is refused ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"gear_box.ratio": [1.0]}, 'element "gear_box" is not in this driveline; did you mean "gearbox"?'),
        ({"gearbox.ration": [1.0]}, 'gearbox has no parameter "ration"; did you mean "ratio"?'),
        ({"vehicle.mass": [1.0]}, 'vehicle has no parameter "mass"; did you mean "m"?'),
        (
            {"gearbox": [1.0]},
            '"gearbox" is an element, permitted: one of its parameters: "gearbox.a", "gearbox.b", "gearbox.ratio"',
        ),
        (
            {"vehicle.m": [1.0, 2.0], "wheels.J": [1.0, 2.0, 3.0]},
            r"different length \(vehicle.m: 2, wheels.J: 3\).*grid=True",
        ),
        ({"vehicle.m": [1500.0, -1.0]}, "vehicle: m of variant 1 = -1.0 kg, permitted: > 0 and finite"),
        ({"vehicle.m": [1500.0, np.nan]}, "vehicle: m of variant 1 = nan kg"),
        ({"vehicle.m": [1500.0, "heavy"]}, r"variant 1 .*m = 'heavy' kg"),
        ({"tyres.stiffness": [None, 1e5]}, r"variant 0 .*damping = 11897.0 N s/m, permitted: 0 for rigid rolling"),
        ({"tyres.stiffness": [1e5, 0.0], "tyres.damping": [0.0, 0.0]}, r"variant 1 .*tyres: stiffness = 0.0"),
        ({"clutch.locked": [1.0]}, "clutch.locked = .*True or False"),
        ({"vehicle.m": np.ones((2, 2))}, r"shape \(2, 2\), permitted: one-dimensional"),
        ({"vehicle.m": []}, "0 variants"),
        ({}, "values is empty"),
    ],
)
def test_what_is_no_family_is_refused(values, message):
    with pytest.raises(pt.PowertrainError, match=message):
        pt.family(CAR, values)


@pytest.mark.parametrize(
    ("spread", "more", "message"),
    [
        ({"vehicle.m": -0.1}, {}, "vehicle: spread of m = -0.1, permitted: >= 0 and finite"),
        ({"vehicle.m": (2.0, 1.0)}, {}, "bounds"),
        ({"vehicle.m": (-2.0, 1.0)}, {}, "m of variant"),
        ({"vehicle.m": 0.1}, {"method": "halton"}, "method = 'halton', permitted: 'latin hypercube', 'sobol'"),
        ({"gearbox.a": 0.1}, {}, "permitted: a value to spread around"),
        ({}, {}, "spread is empty"),
    ],
)
def test_what_is_no_sample_is_refused(spread, more, message):
    with pytest.raises(pt.PowertrainError, match=message):
        pt.sample(CAR, spread, n=4, **more)


def test_what_an_analysis_cannot_be_asked_is_refused():
    family = pt.family(CAR, {"vehicle.m": [1500.0, 2500.0]})
    with pytest.raises(pt.PowertrainError, match="variant = 2, permitted: 0 to 1"):
        family.car(2)
    with pytest.raises(pt.UnknownNameError, match="vehicle_speed"):
        family.load_change(outputs="vehicle_sped")
    with pytest.raises(pt.UnknownNameError, match="damping_ratio"):
        family.modes().worst("damping")
    with pytest.raises(pt.PowertrainError, match=r"q = .*permitted: 0 to 100"):
        family.modes().percentiles(101.0)
    with pytest.raises(pt.PowertrainError, match="executor: expected an Executor, got 'threads'"):
        family.evaluate(first_frequency, executor="threads")
    with pytest.raises(pt.PowertrainError, match="choose outputs"):
        pt.family(CAR, {"vehicle.m": np.full(100_000, 1e3)}).load_change()
    with pytest.raises(pt.PowertrainError, match=r"variant 0 .*freewheel"):
        pt.family(pt.Driveline(*CAR, pt.OneWayClutch("freewheel", "engine", "wheels")), {"vehicle.m": [1.0]}).modes()


def test_signals_of_variants_have_the_units_of_their_names():
    fleet = pt.family(CAR, {"vehicle.m": [1500.0, 1800.0]})
    names = ("engine_angle", "vehicle_speed", "wheels_acceleration", "drive_shafts_twist", "drive_shafts_torque")
    response = fleet.frequency_response([10.0, 20.0], "engine_torque", names)
    assert [quantity.unit for quantity in response.quantities().values()] == ["rad", "m/s", "rad/s^2", "rad", "N m"]
