"""Sensitivities of modes against differences of cars, and the shares of energy that they are."""

from dataclasses import KW_ONLY, dataclass

import numpy as np
import pytest
from test_families import CAR, axle, numbers, split_axle, with_drag

import powertrain_ctrl as pt
from powertrain_ctrl.elements import Element, quantity
from powertrain_ctrl.elements.element import ComplianceRow

STEP = 1e-4


def by_differences(car, mode, name, quantity):
    """Fourth-order central difference of the logarithm over that of the value."""
    element, parameter = name.split(".")
    value = getattr(car[element], parameter)
    logs = {}
    for k in (-2, -1, 1, 2):
        changed = car.replace(element, **{parameter: value * np.exp(k * STEP)})
        logs[k] = np.log(getattr(pt.modes(changed), quantity)[mode])
    return (8.0 * (logs[1] - logs[-1]) - (logs[2] - logs[-2])) / (12.0 * STEP)


@pytest.mark.parametrize("quantity", ["frequency_hz", "damping_ratio"])
@pytest.mark.parametrize(
    "car",
    [CAR, axle(), with_drag(), split_axle(), CAR.replace("drive_shafts", loss_factor=0.05)],
    ids=["source", "axle", "drag", "loop", "loss"],
)
def test_sensitivities_are_the_limits_of_differences(car, quantity):
    result = pt.modes(car)
    for mode in range(result.n_rigid, len(result)):
        found = result.sensitivity(mode, of=quantity)
        for name in numbers(car):
            if name.endswith("max_torque"):
                continue
            expected = by_differences(car, mode, name, quantity)
            assert found[name] == pytest.approx(expected, abs=3e-8), (mode, name)


def test_sensitivities_are_half_the_shares_of_energy():
    """d ln f / d ln k is half the share of the spring in the strain energy, d ln f / d ln J minus half that of the body."""
    result = pt.modes(CAR)
    for mode in range(1, len(result)):
        found = result.sensitivity(mode)
        for name in ("damper_spring", "drive_shafts", "tyres"):
            share = result.strain_energy[result.compliances.index(name), mode]
            assert found[f"{name}.stiffness"] == pytest.approx(0.5 * share, abs=1e-12)
        for name in ("engine", "wheels"):
            share = result.kinetic_energy[result.nodes.index(name), mode]
            assert found[f"{name}.J"] == pytest.approx(-0.5 * share, abs=1e-12)


def test_scaling_all_stiffness_and_all_inertia_together_changes_no_frequency():
    result = pt.modes(CAR)
    for mode in range(1, len(result)):
        found = result.sensitivity(mode)
        stiffness = sum(value for name, value in found.items() if name.endswith("stiffness"))
        inertia = sum(value for name, value in found.items() if name.endswith((".J", ".m")))
        assert (stiffness, inertia) == (pytest.approx(0.5, abs=1e-10), pytest.approx(-0.5, abs=1e-10))


@dataclass(frozen=True)
class Stepped(Element):
    """Spring whose row takes no complex numbers."""

    a: str
    b: str
    _: KW_ONLY
    size: float = quantity("", "> 0 and finite")

    @property
    def nodes(self):
        return (self.a, self.b)

    @property
    def compliances(self):
        return (ComplianceRow(self.name, {self.a: 1.0, self.b: -1.0}, max(self.size, 0.0) ** 4, 0.0),)


def test_elements_of_ones_own_are_differentiated_too():
    car = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=2.0), Stepped("shaft", "a", "b", size=7.0))
    assert pt.modes(car).sensitivity(1)["shaft.size"] == pytest.approx(2.0, abs=1e-8)
    assert np.isnan(pt.modes(car).sensitivity(1, of="damping_ratio")["a.J"])


def test_modes_without_a_derivative_are_refused():
    with pytest.raises(pt.PowertrainError, match="mode = 0, permitted: 1 to 6"):
        pt.modes(CAR).sensitivity(0)
    with pytest.raises(pt.PowertrainError, match="of = 'shape'"):
        pt.modes(CAR).sensitivity(1, of="shape")
    twins = pt.Driveline(
        pt.Inertia("hub", J=1.0),
        *(pt.Inertia(f"blade_{i}", J=0.1) for i in range(3)),
        *(pt.SpringDamper(f"root_{i}", "hub", f"blade_{i}", stiffness=100.0) for i in range(3)),
    )
    with pytest.raises(pt.PowertrainError, match="modes 1, 2 have one frequency"):
        pt.modes(twins).sensitivity(1)
