"""Figures of families show the numbers of their results (plots/families)."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from matplotlib.figure import Figure

import powertrain_ctrl as pt
from powertrain_ctrl import plots

CAR = pt.examples.conventional()
LOADS = {"vehicle.m": [1600.0, 2400.0], "gearbox.ratio": [6.0, 2.2, 1.1]}


@pytest.fixture(scope="module")
def cars():
    return pt.sample(CAR, {"vehicle.m": 0.1, "drive_shafts.stiffness": 0.2}, n=60)


def test_band_of_a_frequency_response_holds_nine_tenths_of_the_gains(cars):
    omega = 2.0 * np.pi * np.geomspace(0.5, 60.0, 50)
    response = cars.frequency_response(omega, "engine_torque", "vehicle_acceleration")
    gain, phase = plots.bode_band(response, "vehicle_acceleration", axes=Figure().subplots(2))
    decibel = 20.0 * np.log10(np.abs(response["vehicle_acceleration"]))
    np.testing.assert_allclose(gain.lines[0].get_ydata(), np.median(decibel, axis=0), rtol=1e-12)
    corners = gain.collections[0].get_paths()[0].vertices
    np.testing.assert_allclose(corners[1:51, 1], np.percentile(decibel, 5.0, axis=0), rtol=1e-12)
    alone = pt.frequency_response(cars.car(3), omega, "engine_torque", "vehicle_acceleration")
    apart = np.unwrap(np.angle(np.ravel(alone.frdata))) - np.radians(phase.lines[0].get_ydata())
    assert abs(np.angle(np.exp(1j * apart[0]))) < 0.1
    assert np.abs(apart - 2.0 * np.pi * np.round(apart[0] / (2.0 * np.pi))).max() < np.pi


def test_histogram_counts_every_variant(cars):
    ax = plots.histogram(cars.modes(), "frequency_hz", 1, ax=Figure().subplots())
    assert sum(bar.get_height() for bar in ax.patches) == 60
    np.testing.assert_allclose(
        [line.get_xdata()[0] for line in ax.lines], np.percentile(cars.modes().frequency_hz[:, 1], (5.0, 50.0, 95.0))
    )


def test_histogram_of_something_that_is_not_there(cars):
    with pytest.raises(pt.UnknownNameError, match=r"did you mean .*frequency_hz"):
        plots.histogram(cars.modes(), "frequency_hz_")
    with pytest.raises(pt.PowertrainError, match="index = 40, permitted: 0 to"):
        plots.histogram(cars.modes(), "frequency_hz", 40)


def test_tornado_shows_the_sensitivities_the_largest_on_top():
    modes = pt.modes(CAR)
    ax = plots.tornado(modes, 1, ax=Figure().subplots())
    found, widths = modes.sensitivity(1), [bar.get_width() for bar in ax.patches]
    shown = dict(zip([label.get_text() for label in ax.get_yticklabels()], widths, strict=True))
    assert shown == {name: found[name] for name in shown}
    assert np.all(np.diff(np.abs(widths)) <= 1e-9)
    assert ax.yaxis_inverted()


def test_gear_map_has_a_line_for_each_load():
    modes = pt.family(CAR, LOADS, grid=True).modes()
    ax = plots.gear_map(modes, "frequency_hz", 1, ax=Figure().subplots())
    for line, row in zip(ax.lines, modes.frequency_hz[:, 1].reshape(2, 3), strict=True):
        np.testing.assert_array_equal(line.get_xdata(), LOADS["gearbox.ratio"])
        np.testing.assert_array_equal(line.get_ydata(), row)


def test_gear_map_of_one_axis_and_of_three():
    ax = plots.gear_map(
        pt.family(CAR, {"gearbox.ratio": [6.0, 2.2]}).modes(), "damping_ratio", 1, ax=Figure().subplots()
    )
    assert len(ax.lines) == 1
    assert ax.get_xlabel() == "gearbox.ratio"
    more = pt.family(CAR, {**LOADS, "tyres.radius": [0.3, 0.31]}, grid=True)
    with pytest.raises(pt.PowertrainError, match="3 axes, permitted: one or two"):
        plots.gear_map(more.modes(), "frequency_hz", 1)
