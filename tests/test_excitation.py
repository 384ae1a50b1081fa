"""Figures and the report's section on engine orders (plots/excitation, report/excitation)."""

import numpy as np
import pytest
from matplotlib.figure import Figure

import powertrain_ctrl as pt
from powertrain_ctrl import plots
from powertrain_ctrl.report.excitation import FLAT, MAIN_ORDERS, orders_section
from powertrain_ctrl.report.subject import Subject

ENGINE = pt.Engine(cylinders=4, firing_order=(1, 3, 4, 2), orders={2.0: 200.0, 4.0: 90.0j, 6.0: 30.0})
CAR = pt.examples.conventional(gear_ratio=3.6)
RPM = np.linspace(800.0, 3000.0, 23)


@pytest.fixture(scope="module")
def response():
    return pt.order_response(CAR, ENGINE, pt.rpm(RPM))


def new_ax():
    return Figure(layout="constrained").subplots()


def test_a_campbell_diagram_has_the_modes_the_rays_and_the_crossings():
    critical = pt.critical_speeds(CAR, ENGINE, (500.0, 6000.0))
    ax = plots.campbell(critical, new_ax())
    elastic = pt.modes(CAR).frequency_hz[1:]
    for line, frequency in zip(ax.lines, elastic, strict=False):
        np.testing.assert_allclose(line.get_ydata(), frequency)
    rays = ax.lines[len(elastic) :]
    assert [ray.get_ydata()[-1] / ray.get_xdata()[-1] * 60.0 for ray in rays] == pytest.approx([2.0, 4.0, 6.0])
    np.testing.assert_allclose(ax.collections[0].get_offsets(), np.column_stack([critical.rpm, critical.frequency_hz]))
    assert {text.get_text() for text in ax.texts} == {"2", "4", "6"}


def test_a_campbell_diagram_without_a_crossing_shows_the_modes():
    ax = plots.campbell(pt.critical_speeds(CAR, ENGINE, (1.0, 2.0)), new_ax())
    assert ax.get_ylim()[1] == pytest.approx(pt.modes(CAR).frequency_hz.max())


def test_an_order_map_has_a_ray_of_each_order_with_its_amplitude(response):
    ax = plots.order_map(response, "damper_spring_torque", new_ax())
    amplitude = response.amplitude("damper_spring_torque")
    assert len(ax.collections) == 3
    for k, rays in enumerate(ax.collections):
        np.testing.assert_allclose([segment[0, 0] for segment in rays.get_segments()], RPM[:-1])
        np.testing.assert_allclose(rays.get_segments()[-1][1], [RPM[-1], (2.0 + 2.0 * k) * RPM[-1] / 60.0])
        np.testing.assert_allclose(rays.get_array() ** 2, amplitude[k, 1:] * amplitude[k, :-1])


def test_curves_of_orders_are_those_of_the_response_in_the_order_of_speed(response):
    backwards = pt.order_response(CAR, ENGINE, pt.rpm(RPM[::-1]), outputs="damper_spring_torque")
    for each in (response, backwards):
        ax = plots.orders(each, "damper_spring_torque", new_ax(), count=2)
        peak, *rest = ax.lines
        np.testing.assert_allclose(peak.get_xdata(), RPM)
        np.testing.assert_allclose(peak.get_ydata(), response.peak("damper_spring_torque"))
        assert [line.get_label() for line in rest] == ["order 2", "order 4"]
        np.testing.assert_allclose(rest[1].get_ydata(), response.amplitude("damper_spring_torque")[1])


@pytest.mark.parametrize("draw", [plots.order_map, plots.orders])
def test_what_cannot_be_drawn_is_named(draw, response):
    with pytest.raises(pt.UnknownNameError, match='"damper_torque" is not in this response'):
        draw(response, "damper_torque")
    with pytest.raises(pt.PowertrainError, match="the response is at one speed, permitted: two or more"):
        draw(pt.order_response(CAR, ENGINE, 100.0), "damper_spring_torque")
    behind = pt.order_response(CAR.release("clutch"), ENGINE, [100.0, 200.0])
    with pytest.raises(pt.PowertrainError, match="vehicle_speed is 0 at all orders and speeds"):
        draw(behind, "vehicle_speed")
    with pytest.raises(pt.PowertrainError, match=r"expected an OrderResponse, got a Modes; pt\.order_response"):
        draw(pt.modes(CAR), "vehicle_speed")


def test_the_report_says_where_main_orders_meet_modes_that_can_resonate():
    section = orders_section(Subject(CAR, "car"))
    (table,), (picture,) = section.tables, section.pictures
    damping = pt.modes(CAR).damping_ratio
    for mode, order, frequency, rpm, *_ in table.rows:
        assert damping[int(mode)] <= FLAT
        assert float(order) in MAIN_ORDERS
        assert float(rpm) == pytest.approx(60.0 * float(frequency) / float(order), rel=1e-3)
    assert {row[0] for row in table.rows} >= {"2", "4"}
    assert picture.name == "campbell"


def test_the_report_has_no_orders_where_there_is_no_engine():
    rolling = pt.Driveline(pt.Mass("a", m=1.0), pt.Mass("b", m=1.0), pt.SpringDamper("spring", "a", "b", stiffness=1.0))
    assert orders_section(Subject(rolling, "car")) is None
    slow = pt.Driveline(
        pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.SpringDamper("spring", "a", "b", stiffness=1.0)
    )
    assert "no main order of an engine at a meets a mode" in orders_section(Subject(slow, "car")).text[0]
