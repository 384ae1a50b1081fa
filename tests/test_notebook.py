"""What a notebook shows: names to complete, tables, the schematic, and sliders.

Of notebook/explorer, notebook/sliders, notebook/pictures.
"""

import base64
import io
import re
import sys

import matplotlib
import matplotlib.image
import numpy as np
import pytest
from chromium import PATH, chromium

import powertrain_ctrl as pt
from powertrain_ctrl.notebook.explorer import Explorer, sliding
from powertrain_ctrl.notebook.pictures import schematic_svg
from powertrain_ctrl.notebook.sliders import drawn

CAR = pt.examples.conventional()


def engine():
    return pt.Engine(cylinders=4, firing_order=(1, 3, 4, 2), orders={2.0: 100.0})


@pytest.fixture(scope="module")
def results():
    return {
        "car": CAR,
        "response": pt.load_change(CAR, timepts=[0.0, 1.0, 2.0]),
        "forced": pt.forced_response(CAR, [10.0, 20.0], {"engine_torque": 1.0}),
        "orders": pt.order_response(CAR, engine(), speed=[100.0, 200.0]),
        "family": pt.family(CAR, {"vehicle.m": [1500.0, 2000.0]}).load_change(timepts=[0.0, 1.0]),
        "comparison": pt.compare_models(CAR, {"modal": pt.two_mass(CAR)}),
        "signals": pt.plots.Signals(time=np.array([0.0, 1.0]), values={"engine_speed": np.array([1.0, 2.0])}),
    }


@pytest.mark.parametrize("name", ["car", "response", "forced", "orders", "family", "comparison", "signals"])
def test_every_name_that_is_offered_is_there(results, name):
    result = results[name]
    names = result.keys()
    assert len(names) == len(set(names)) > 0
    assert tuple(result._ipython_key_completions_()) == tuple(names)
    for each in names:
        assert result[each] is not None


def test_names_of_a_driveline_are_those_of_its_elements():
    assert CAR.keys() == tuple(element.name for element in CAR)
    assert dict(CAR)["drive_shafts"] is CAR["drive_shafts"]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: pt.two_mass(CAR), ["2.638", "Hz", "26150", "N m/rad"]),
        (lambda: pt.SampledPlant(car=CAR), ["lag", "0.03", "torque_limits", "0, 350", "N m"]),
        (
            lambda: pt.load_change(CAR, timepts=[0.0, 1.0]).final,
            ["engine speed", "209.44", "drive_shafts twist", "rad"],
        ),
        (lambda: pt.launch(pt.examples.conventional(damping="open")).events[1], ["lock", "2.6506", "clutch", "100214"]),
        (lambda: pt.forced_response(CAR, [10.0, 20.0], {"engine_torque": 1.0}), ["vehicle_acceleration", "Hz"]),
        (lambda: pt.order_response(CAR, engine(), speed=[100.0]), ["damper_spring_torque", "peak"]),
        (
            lambda: pt.ring_down(np.exp(-np.arange(0, 2, 0.01)) * np.cos(20 * np.arange(0, 2, 0.01)), 0.01),
            ["3.187", "Hz"],
        ),
    ],
)
def test_what_had_no_table_has_one(make, words):
    html = make()._repr_html_()
    assert html.count("<table>") == 1
    for word in words:
        assert word in re.sub(r"<[^>]*>", "|", html)


def test_a_driveline_shows_its_schematic():
    svg = CAR._repr_svg_()
    assert svg.startswith("<svg")
    assert svg.rstrip().endswith("</svg>")
    for word in ("engine", "torsional", "2000 kg"):
        assert f">{word}<" in svg
    assert svg == schematic_svg(CAR)


def test_a_large_driveline_shows_none():
    discs = [pt.Inertia(f"n{i}", J=1.0) for i in range(60)]
    springs = [pt.SpringDamper(f"s{i}", f"n{i}", f"n{i + 1}", stiffness=1e3) for i in range(59)]
    assert pt.Driveline(*discs, *springs)._repr_svg_() is None


# --- sliders


def with_play():
    shafts = CAR["drive_shafts"]
    play = pt.Backlash(shafts.name, shafts.a, shafts.b, gap=0.02, stiffness=shafts.stiffness, damping=shafts.damping)
    return pt.Driveline(*(play if element is shafts else element for element in CAR))


CARS = {
    "conventional": CAR,
    "front wheel drive": pt.examples.front_wheel_drive().replace("tyres", stiffness=None, damping=0.0),
    "with play": with_play(),
}


@pytest.fixture(scope="module")
def explorers():
    return {name: Explorer(car) for name, car in CARS.items()}


@pytest.mark.parametrize("name", list(CARS))
def test_any_car_can_be_explored(explorers, name):
    explorer, car = explorers[name], CARS[name]
    picture = matplotlib.image.imread(io.BytesIO(explorer.png(explorer.curves(car))))
    assert picture.shape[:2] == (272, 880)
    assert picture[..., :3].std() > 0.05


def test_curves_are_those_of_the_variant(explorers):
    heavy = CAR.replace("vehicle", m=2600.0)
    curves = explorers["conventional"].curves(heavy)
    expected = pt.modes(heavy)
    assert curves.text.startswith(f"first mode {expected.frequency_hz[1]:.4g} Hz")
    gain = pt.frequency_response(heavy, explorers["conventional"].omega, "engine_torque", "vehicle_acceleration")
    np.testing.assert_allclose(curves.gain, 20.0 * np.log10(np.ravel(gain.magnitude)))


def test_every_slider_changes_the_picture(explorers):
    explorer = explorers["conventional"]
    before = drawn(explorer, CAR, {})
    for name in sliding(CAR, 6):
        element, parameter = name.split(".")
        after = drawn(explorer, CAR, {name: 1.3 * getattr(CAR[element], parameter)})
        assert after.startswith("<img")
        assert after.split("src=")[1] != before.split("src=")[1]
    assert drawn(explorer, CAR, {}) == before


def test_a_picture_says_its_numbers_in_words(explorers):
    html = drawn(explorers["conventional"], CAR, {"vehicle.m": 2000.0})
    assert 'alt="first mode 2.638 Hz, ζ = 0.0987, vehicle.m 2000"' in html
    assert base64.b64decode(re.search(r"base64,([^\"]*)", html)[1]).startswith(b"\x89PNG")


def test_a_value_that_is_not_possible_is_said_and_no_error(explorers):
    assert "stiffness = -1" in drawn(explorers["conventional"], CAR, {"drive_shafts.stiffness": -1.0})


def test_sliders_are_on_the_values_that_the_first_mode_depends_on_most():
    found = pt.modes(CAR).sensitivity(1)
    chosen = sliding(CAR, 6)
    assert chosen[0] in ("gearbox.ratio", "final_drive.ratio")
    assert (
        min(abs(found[name]) for name in chosen) >= max(abs(found[name]) for name in found.keys() - set(chosen)) - 1e-9
    )


def test_without_ipywidgets_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    with pytest.raises(pt.PowertrainError, match=r'pip install "powertrain-ctrl\[notebook\]"'):
        pt.explore(CAR)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (["drive_shafts"], '"element.parameter"'),
        (["shafts.stiffness"], 'did you mean "input_shaft"|element "shafts" is not'),
        (["drive_shafts.k"], "k"),
        (["drive_shafts.a"], "permitted: a number"),
    ],
)
def test_sliders_for_what_is_no_value(values, message):
    with pytest.raises(pt.PowertrainError, match=message):
        pt.explore(CAR, values)


def test_moving_a_slider_draws_anew():
    widgets = pytest.importorskip("ipywidgets")
    box = pt.explore(CAR, ["vehicle.m", "gearbox.ratio"])
    sliders, picture = box.children
    assert [slider.description for slider in sliders.children] == ["vehicle.m", "gearbox.ratio"]
    assert isinstance(picture, widgets.HTML)
    before = picture.value
    sliders.children[0].value = 3000.0
    assert picture.value != before
    assert "vehicle.m 3000" in picture.value


def test_a_car_without_vehicle_cannot_be_explored():
    pair = pt.Driveline(pt.Inertia("a", J=1.0), pt.SpringDamper("s", "a", "b", stiffness=1e4), pt.Inertia("b", J=3.0))
    with pytest.raises(pt.PowertrainError, match="give the driveline a Mass"):
        Explorer(pair)


@pytest.mark.skipif(PATH is None, reason="no Chromium is installed")
def test_a_browser_shows_the_schematic(tmp_path):
    (tmp_path / "car.html").write_text(f"<!DOCTYPE html><meta charset=utf-8>{CAR._repr_svg_()}")
    with chromium() as browser:
        browser.open((tmp_path / "car.html").as_uri(), 1280)
        assert browser.faults == []
        assert browser.value("document.querySelector('svg').getBBox().width") > 300
