"""The report: what it holds, that it stands alone, and that it is written whole or not at all.

Of report/page, report/subject, report/linear, report/comparing, report/launching, report/measured, report/markdown,
report/frequencies.
"""

import re
from html.parser import HTMLParser
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl import studies
from powertrain_ctrl.report import antijerk, launching
from powertrain_ctrl.report import page as report_module
from powertrain_ctrl.report.comparing import BOUNDS, GEARS, comparison_section
from powertrain_ctrl.report.launching import TIMES, _what_happened, launch_section, through_control
from powertrain_ctrl.report.linear import closed_clutch_section, open_clutch_section
from powertrain_ctrl.report.measured import measured_section
from powertrain_ctrl.report.page import SECTIONS, write_report
from powertrain_ctrl.report.subject import Subject

COMPARED = (
    "load_change_models",
    "hankel",
    *(f"{n}_{s}" for n in ("model_errors", "ramp", "order") for s in ("closed", "open")),
)
LAUNCHED = ("launch", "launch_compared")


class Page(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.ids, self.references = [], [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        for name, value in attrs:
            if name == "id":
                self.ids.append(value)
            if name in ("src", "href", "xlink:href", "data", "srcset"):
                self.references.append(value)


@pytest.fixture
def source(source_report):
    return source_report


# A run through python-control takes a second, and several tests look at the same car.
kept_run = {}


def kept_through_control(car, direct):
    if car not in kept_run:
        kept_run[car] = through_control(car, direct)
    return kept_run[car]


@pytest.fixture(scope="module", autouse=True)
def small_studies():
    """One run of a car through python-control, three plants and one play where the report is not on the source's car."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(launching, "through_control", kept_through_control)
        patch.setattr(antijerk, "variations", lambda plant: dict(islice(studies.variations(plant).items(), 3)))
        patch.setattr(antijerk, "HALF_GAPS", (1.0,))
        yield


def written(report, name):
    return next(file for file in report.files if file.name == name).read_text(encoding="utf-8")


def titles(report):
    return {section.title: section for section in report.sections}


def pictures(report):
    return [picture for section in report.sections for picture in section.pictures]


def plain_car():
    """No clutch and no Mass, so no response is compared."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.25),
        pt.SpringDamper("shaft", "engine", "vehicle", stiffness=1e4, damping=20.0),
        pt.Inertia("vehicle", J=3.0),
    )


def pair():
    """Quicker still: nothing drives."""
    return pt.Driveline(
        pt.Inertia("a", J=1.0), pt.SpringDamper("shaft", "a", "b", stiffness=1e4), pt.Inertia("b", J=3.0)
    )


def own_car():
    return pt.Driveline(
        pt.Inertia("engine", J=0.25),
        pt.Clutch("clutch", "engine", "input", max_torque=300.0),
        pt.Inertia("input", J=0.02),
        pt.Gear("gearbox", "input", "axle", ratio=12.0),
        pt.SpringDamper("halfshafts", "axle", "wheels", stiffness=12e3, damping=60.0),
        pt.Inertia("wheels", J=3.0),
        pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=8e5, damping=4e3),
        pt.Mass("vehicle", m=1400.0),
    )


def driven_by(name):
    """The same without a clutch, its engine named so."""
    elements = [e for e in own_car() if e.name not in ("engine", "clutch", "input", "gearbox")]
    return pt.Driveline(pt.Inertia(name, J=0.27), pt.Gear("gearbox", name, "axle", ratio=12.0), *elements)


def test_every_file_listed_is_there(source):
    assert all(file.stat().st_size > 500 for file in source.files)
    names = {file.name for file in source.files}
    figures = ("mode_1", "mode_open_1", "energies", "load_change", "load_change_compared", "bode", *COMPARED, *LAUNCHED)
    assert {picture.name for picture in pictures(source)} >= set(figures)
    drawn = {f"{name}.{kind}" for name in {"verdict", *(p.name for p in pictures(source))} for kind in ("svg", "png")}
    assert names == {"report.html", "report.md"} | drawn


def test_nothing_else_is_left_in_the_folder(source):
    folder = source.files[-1].parent
    assert {file for file in folder.rglob("*") if file.is_file()} == set(source.files)


def test_the_page_refers_to_nothing_outside_itself(source):
    text = written(source, "report.html")
    page = Page(text)
    assert page.references
    assert all(reference.startswith("#") for reference in page.references)
    assert not re.search(r"https?:|@import|<script|<link", text)
    assert all(url.startswith("#") for url in re.findall(r"url\(([^)]*)\)", text))


def test_identifiers_on_the_page_are_unique_and_all_references_resolve(source):
    text = written(source, "report.html")
    page = Page(text)
    assert len(page.ids) == len(set(page.ids))
    used = {reference[1:] for reference in page.references} | set(re.findall(r"url\(#([^)]*)\)", text))
    assert used <= set(page.ids)
    assert page.tags.count("svg") == len(pictures(source)) + 1  # and the verdict's


@pytest.mark.parametrize("file", ["report.html", "report.md"])
@pytest.mark.parametrize(
    "values",
    [
        ("2.6", "2.6377"),
        ("188.7", "188.7027"),
        ("7.3", "7.2542"),
        ("31.6", "31.6516"),
        ("0.481", "0.481389"),
        ("0.0414", "0.0413889"),
    ],
)
def test_printed_values_stand_beside_computed_ones(source, file, values):
    rows = re.findall(r"<tr>.*?</tr>|^\|.*\|$", written(source, file), flags=re.MULTILINE)
    cells = [re.split(r"\s*\|\s*|<[^>]*>+", row) for row in rows]
    assert any(set(values) <= set(row) for row in cells)


def test_markdown_refers_to_figures_that_are_there(source):
    folder = source.files[-1].parent
    drawn = re.findall(r"!\[[^]]*\]\(([^)]*)\)", written(source, "report.md"))
    assert len(drawn) == len(pictures(source)) + 1
    assert all((folder / picture).exists() for picture in drawn)


def frequency_tables(car):
    """Of the sections without responses, which take the time."""
    subject = Subject(car, "car")
    return [table for make in (closed_clutch_section, open_clutch_section) for table in make(subject).tables]


def test_a_copy_of_the_source_car_gets_the_printed_values(tmp_path):
    pt.examples.conventional().release("clutch").save(tmp_path / "copy.toml")
    tables = frequency_tables(pt.load(tmp_path / "copy.toml"))
    assert sum("f printed [Hz]" in table.headers for table in tables) == 2


def test_another_gear_has_no_printed_values():
    tables = frequency_tables(pt.examples.conventional(gear_ratio=3.6))
    assert not any("f printed [Hz]" in table.headers for table in tables)


@pytest.fixture(scope="module")
def own_counted(tmp_path_factory, assemblies):
    with assemblies() as counts:
        return write_report(own_car(), tmp_path_factory.mktemp("own"), car_name="Own <car> & more"), counts


@pytest.fixture
def own(own_counted):
    return own_counted[0]


def test_a_report_assembles_each_driveline_once(own_counted):
    _, counts = own_counted
    assert len(counts) > 10
    assert set(counts.values()) == {1}


def test_own_driveline_gets_all_that_applies(own):
    report = own
    figures = {file.name for file in report.files if file.suffix == ".svg"}
    assert {"mode_1.svg", "mode_2.svg", "mode_open_input_1.svg", "energies.svg", "bode.svg"} <= figures
    assert {"load_change.svg", "load_change_compared.svg"} <= figures
    assert "<h1>Own &lt;car&gt; &amp; more</h1>" in written(report, "report.html")
    assert len(report.frequency_tables) == 2


def test_the_same_driveline_gives_the_same_bytes(own, tmp_path, monkeypatch):
    monkeypatch.setattr(launching, "through_control", through_control)
    again = write_report(own_car(), tmp_path, car_name="Own <car> & more")
    assert len(own.files) == len(again.files)
    for a, b in zip(own.files, again.files, strict=True):
        assert a.read_bytes() == b.read_bytes()


def test_what_does_not_apply_says_why(tmp_path):
    grounded = pt.Driveline(pt.Inertia("engine", J=0.3), pt.Drag("spring", "engine", damping=0.1, stiffness=100.0))
    sections = titles(write_report(grounded, tmp_path))
    assert "one rigid motion" in sections["Two-mass control model"].text[0]
    assert "no Mass" in sections["Load change"].text[0]
    assert "no Mass" in sections["Frequency response"].text[0]


def test_no_elastic_mode_at_all(tmp_path):
    sections = titles(write_report(pt.Driveline(pt.Mass("vehicle", m=1.0)), tmp_path))
    assert not any(section.pictures for section in sections.values())


def two_speed():
    return pt.Driveline(
        pt.Inertia("engine", J=0.3),
        pt.Clutch("first", "engine", "low", max_torque=300.0),
        pt.Clutch("second", "engine", "high", max_torque=300.0),
        pt.Gear("low_gear", "low", "output", ratio=3.0),
        pt.Gear("high_gear", "high", "output", ratio=2.0),
        pt.Inertia("output", J=0.1),
        pt.SpringDamper("shafts", "output", "vehicle", stiffness=1e4, damping=10.0),
        pt.Inertia("vehicle", J=100.0),
    )


def test_clutches_that_cannot_all_be_closed_leave_the_state_of_the_file():
    subject = Subject(two_speed().release("second"), "two speeds")
    sections = {section.title: section for make in SECTIONS.values() if (section := make(subject)) is not None}
    assert sections["Natural frequencies, closed clutch"].text == [
        "Not with every clutch closed: second holds engine, high at standstill together with first, high_gear, low_gear. So "
        "second stays open, as in the file."
    ]
    assert sections["Natural frequencies, clutches as in the file"].tables[0].is_frequency
    assert "Clutches as in the file." in sections["Frequency response"].text
    assert any(picture.name == "load_change" for picture in sections["Load change"].pictures)


def test_sections_on_control_take_the_clutches_as_in_the_file_where_they_cannot_all_be_closed(monkeypatch):
    """Two gears of a dual clutch with wheels and vehicle; the one that is released stays so."""
    elements = [e for e in two_speed() if e.name != "vehicle"]
    elements[-1] = pt.SpringDamper("shafts", "output", "wheels", stiffness=1e4, damping=100.0)
    tyre = pt.Tyre("tyres", "wheels", "vehicle", radius=0.3, stiffness=9e5, damping=5e3)
    car = pt.Driveline(*elements, pt.Inertia("wheels", J=2.0), tyre, pt.Mass("vehicle", m=1500.0)).release("second")
    studied = []

    def study(plant, is_full):
        studied.append(plant.car)
        raise pt.PowertrainError("enough")

    monkeypatch.setattr(antijerk, "_study", study)
    subject = Subject(car, "dual clutch")
    assert antijerk.antijerk_section(subject).text == ["Not shown: enough."]
    assert studied == [car]
    assert subject.control_model.ratio == pytest.approx(3.0)
    compared = comparison_section(subject)
    assert "clutches as in the file" in compared.tables[0].caption
    assert not any("standstill" in text for text in compared.text)


def test_the_title_stands_in_the_markdown_as_it_is(tmp_path):
    car = pt.Driveline(pt.Inertia("a", J=1.0))
    write_report(car, tmp_path, car_name="my_car <script> [x](y) *\n# b")
    heading = (tmp_path / "report.md").read_text().splitlines()[0]
    assert heading == r"# my\_car &lt;script&gt; \[x\](y) \* \# b"


def test_a_driveline_that_cannot_be_assembled_writes_nothing(tmp_path):
    with pytest.raises(pt.TopologyError):
        write_report(two_speed().lock(), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_below_a_file_leaves_nothing(tmp_path):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(pt.FileError, match="cannot be written"):
        write_report(pair(), tmp_path / "file" / "deep" / "out")
    assert [path.name for path in tmp_path.rglob("*")] == ["file"]
    assert (tmp_path / "file").read_text() == "kept"


def test_a_failure_while_writing_leaves_nothing(tmp_path, monkeypatch):
    write_bytes = Path.write_bytes

    def full_disk(path, content):
        if path.name == "report.html":
            raise OSError(28, "No space left on device")
        return write_bytes(path, content)

    monkeypatch.setattr(Path, "write_bytes", full_disk)
    with pytest.raises(pt.FileError, match="No space left"):
        write_report(pair(), tmp_path / "deep" / "out")
    assert not list(tmp_path.iterdir())


def test_a_failure_keeps_an_earlier_report(tmp_path, monkeypatch):
    earlier = write_report(pair(), tmp_path)
    before = {file: file.read_bytes() for file in earlier.files}
    (tmp_path / "figures" / "mode_1.png").unlink()
    (tmp_path / "figures" / "mode_1.png").mkdir()
    with pytest.raises(pt.FileError, match=r"mode_1\.png is a folder"):
        write_report(pair().replace("a", J=0.5), tmp_path)
    assert all(file.read_bytes() == before[file] for file in earlier.files if file.is_file())
    assert not list(tmp_path.glob(".report-*"))


def test_a_failure_while_drawing_writes_nothing(tmp_path, monkeypatch):
    def fails(picture):
        raise RuntimeError("drawing")

    monkeypatch.setattr(report_module, "drawn", fails)
    with pytest.raises(RuntimeError):
        write_report(pair(), tmp_path / "out")
    assert not (tmp_path / "out").exists()


# --- launch


def control_model():
    closed = pt.two_mass(pt.examples.conventional(damping="closed"), method="source")
    slipping = pt.two_mass(pt.examples.conventional(damping="open").release("clutch"), method="source")
    return pt.SwitchedTwoMass(closed=closed, slipping=slipping)


@pytest.mark.parametrize(
    "car", [pt.examples.conventional(damping="open"), control_model()], ids=["detailed", "control"]
)
def test_curves_through_the_nonlinear_system_are_those_of_the_direct_call(car):
    direct = pt.launch(car, timepts=TIMES)
    sampled = pt.plots.signals(kept_through_control(car, direct))
    np.testing.assert_array_equal(sampled.time, direct.time)
    for name in ("engine_speed", "clutch_secondary_speed", "wheels_speed", "vehicle_acceleration", "clutch_slip_speed"):
        np.testing.assert_allclose(sampled[name], direct[name], rtol=0, atol=1e-8)
    # at the sample where the ramp begins the clutch is still free or already slips
    different = sampled["clutch_mode"] != direct["clutch_mode"]
    assert different.sum() <= 1
    assert set(direct.time[different].round(9)) <= {1.5}


@pytest.mark.parametrize(
    "car", [pt.examples.conventional(damping="open"), control_model()], ids=["detailed", "control"]
)
def test_the_lock_is_seen_by_the_nonlinear_system_at_the_sample_after_the_event(car):
    direct = pt.launch(car, timepts=TIMES)
    lock = next(event.time for event in direct.events if event.kind == "lock")
    sampled = pt.plots.signals(kept_through_control(car, direct))
    first_stuck = sampled.time[sampled["clutch_mode"] == 0.0][0]
    assert lock <= first_stuck < lock + 0.001 + 1e-9


def test_a_launch_from_the_first_time_of_the_figure_is_the_whole_one():
    car = pt.examples.conventional(damping="open")
    whole, shown = pt.launch(car), pt.launch(car, timepts=TIMES)
    for a, b in zip(whole.events, shown.events, strict=True):
        assert (a.kind, a.element) == (b.kind, b.element)
        assert a.time == pytest.approx(b.time, abs=1e-9)
        assert a.heat == pytest.approx(b.heat, rel=1e-9)


@pytest.mark.parametrize("damping", [None, "closed", "open"])
def test_launch_of_the_source_car_has_its_own_damping_whatever_the_report_is_on(damping):
    section = launch_section(Subject(pt.examples.conventional(damping=damping), "car"))
    (table,) = section.tables
    assert [row[:4] for row in table.rows if row[0] == "detailed model"] == [
        ["detailed model", "1.5000", "clutch", "starts to slip, driving side faster"],
        ["detailed model", "2.6506", "clutch", "locks"],
    ]
    heat = pt.launch(pt.examples.conventional(damping="open")).slip_energy["clutch"]
    assert [float(row[4]) for row in table.rows[:2]] == pytest.approx([0.0, heat / 1000.0], abs=5.1e-4)
    locked = next(row for row in table.rows if row[0] == "control model" and row[3] == "locks")
    assert float(locked[1]) == pytest.approx(pt.launch(control_model()).events[-1].time, abs=5e-5)
    assert [picture.name for picture in section.pictures] == list(LAUNCHED)
    assert ["Fig. 2.11" in section.pictures[0].caption, "Fig. 2.13" in section.pictures[1].caption] == [True, True]
    assert any('damping set "open" throughout' in paragraph for paragraph in section.text)


def test_launch_figures_have_the_axes_of_the_source(source):
    drawn = {p.name: p.figure for p in titles(source)["Launch"].pictures}
    for name, ticks in {
        "launch": ([0, 400], [0, 6000], [0, 10]),
        "launch_compared": ([0, 400], [0, 6000], [0, 300], [0, 10]),
    }.items():
        axes = [ax for ax in drawn[name].axes if "−" not in ax.get_ylabel()]
        assert [[ax.get_yticks()[0], ax.get_yticks()[-1]] for ax in axes] == [list(pair) for pair in ticks]
        assert axes[0].get_xlim() == (1.2, 3.2)
        for ax in axes:
            low, high = ax.get_ylim()
            assert all(
                low <= y.min() and y.max() <= high
                for y in (line.get_ydata() for line in ax.lines if len(line.get_xdata()) > 2)
            )


def test_own_car_with_one_clutch_is_launched(own):
    section = titles(own)["Launch"]
    events = pt.launch(own_car()).events
    detailed = [row for row in section.tables[0].rows if row[0] == "detailed model"]
    assert [row[1] for row in detailed] == [f"{event.time:.4f}" for event in events if event.time <= TIMES[-1]]
    assert [picture.name for picture in section.pictures] == list(LAUNCHED)
    assert not any("Fig." in picture.caption for picture in section.pictures)


def test_a_clutch_the_other_way_round_has_the_same_input_shaft(own):
    elements = [e for e in own_car() if e.name != "clutch"]
    turned = pt.Driveline(*elements, pt.Clutch("clutch", "input", "engine", max_torque=300.0))
    a, b = (section.tables[0].rows for section in (titles(own)["Launch"], launch_section(Subject(turned, "car"))))
    assert [row[1] for row in a] == [row[1] for row in b]
    assert [row[3] for row in a] == [row[3] for row in b]
    assert "driving side faster" in a[0][3]


def test_a_clutch_that_the_vehicle_drives_says_so():
    event = pt.Event(time=1.0, element="clutch", kind="slip", mode=-1, heat=0.0)
    assert _what_happened(event, is_turned=False) == "starts to slip, driven side faster"
    assert _what_happened(event, is_turned=True) == "starts to slip, driving side faster"


@pytest.mark.parametrize(
    "car",
    [
        plain_car(),
        two_speed().release("second"),
        pt.Driveline(*plain_car(), pt.Clutch("brake", "vehicle", max_torque=100.0)),
        pt.examples.front_wheel_drive(),
    ],
    ids=["no clutch", "two clutches", "a brake", "no engine"],
)
def test_no_launch_without_one_clutch_between_engine_and_vehicle(car):
    assert launch_section(Subject(car, "car")) is None


def test_a_launch_without_control_model_says_why():
    car = pt.Driveline(
        pt.Inertia("engine", J=0.3),
        pt.Clutch("clutch", "engine", "shaft", max_torque=200.0),
        pt.Inertia("shaft", J=0.02),
        pt.SpringDamper("spring", "shaft", "vehicle", stiffness=500.0, damping=1.0),
        pt.Inertia("vehicle", J=3.0),
    )
    section = launch_section(Subject(car, "car"))
    assert any("There is no control model that switches" in text for text in section.text)
    assert [picture.name for picture in section.pictures] == ["launch"]


# --- comparison


def test_both_clutch_states_are_compared_with_every_model(source):
    tables = {table.caption: table for table in titles(source)["Control models compared"].tables}
    models = ["source", "series", "modal", "fit", "balanced, order 2", "balanced, order 4"]
    for state in ("closed", "open"):
        for caption in ("Control models", "Errors of torque to vehicle acceleration"):
            assert [row[0] for row in tables[f"{caption}, {state} clutch"].rows] == models


def test_compared_values_are_those_of_compare_models(source):
    tables = {table.caption: table for table in titles(source)["Control models compared"].tables}
    car = pt.examples.conventional()
    error = pt.compare_models(car, {"source": pt.two_mass(car, "source")})["source"]
    table = tables["Control models, closed clutch"]
    assert table.rows[0][table.headers.index("f1 error [%]")] == f"{100 * error.frequency_error:+.2f}" == "+14.28"
    table = tables["Errors of torque to vehicle acceleration, closed clutch"]
    assert table.rows[0][table.headers.index("band error")] == f"{error.band_error:.2g}" == "0.81"


def test_every_gear_says_whether_the_bounds_of_first_gear_hold(source):
    tables = {table.caption: table for table in titles(source)["Control models compared"].tables}
    table = tables['"modal" in every gear']
    rows = {(row[0], float(row[1])): dict(zip(table.headers, row, strict=True)) for row in table.rows}
    assert set(rows) == {(state, gear) for state in BOUNDS for gear in GEARS}
    verdict = "within the bounds of first gear"
    for (state, gear), row in rows.items():
        band, rmse = float(row["band error to 10 Hz"]), float(row["RMSE 100 ms [m/s^2]"])
        assert (row[verdict] == "yes") == (band <= BOUNDS[state][0] and rmse <= BOUNDS[state][1]), (state, gear)
    assert rows["closed", 6.0][verdict] == rows["open", 6.0][verdict] == "yes"
    assert all(rows["closed", gear][verdict] == "no: band error" for gear in GEARS[1:])
    assert [gear for gear in GEARS if rows["open", gear][verdict] != "yes"] == [3.6]
    assert rows["open", 3.6][verdict] == "no: band error"


def test_models_are_compared_alike_whatever_the_order_of_the_elements(own):
    one = titles(own)["Control models compared"]
    other = comparison_section(Subject(pt.Driveline(*reversed([*own_car()])), "car"))
    assert [table.caption for table in other.tables] == [table.caption for table in one.tables]
    for a, b in zip(one.tables, other.tables, strict=True):
        assert [row[:3] for row in a.rows] == [row[:3] for row in b.rows]


def test_load_change_of_the_methods_shows_acceleration_of_all(source):
    drawn = {p.name: p.figure for p in titles(source)["Control models compared"].pictures}
    acceleration = drawn["load_change_models"].axes[2]
    assert [line.get_label() for line in acceleration.lines] == ["detailed", "source", "series", "modal"]
    detailed = pt.load_change(pt.examples.conventional())["vehicle_acceleration"]
    np.testing.assert_allclose(acceleration.lines[0].get_ydata(), detailed)
    assert len({line.get_linestyle() for line in acceleration.lines}) == 4


@pytest.mark.parametrize(
    ("car", "reason"),
    [
        (plain_car(), "no Mass"),
        (own_car().replace("halfshafts", damping=0.0).replace("tyres", damping=0.0), "2.96 Hz is undamped"),
        (pt.Driveline(*reversed(list(driven_by("motor")))), '"vehicle" is not driven by a torque'),
    ],
)
def test_what_cannot_be_compared_says_why(car, reason):
    section = comparison_section(Subject(car, "car"))
    assert any(reason in paragraph for paragraph in section.text)
    assert not section.tables


def test_the_ratio_of_the_figures_is_engine_over_wheel_speed(source):
    assert Subject(pt.examples.conventional(), "car").ratio == pytest.approx(18.0, rel=1e-12)
    (speed,) = (p.figure.axes[1] for p in titles(source)["Load change"].pictures if p.name == "load_change")
    response = pt.load_change(pt.examples.conventional())
    engine, wheels = speed.lines[:2]
    np.testing.assert_allclose(engine.get_ydata(), response["engine_speed"] * 30.0 / np.pi)
    np.testing.assert_allclose(wheels.get_ydata(), 18.0 * response["wheels_speed"] * 30.0 / np.pi)


def test_the_tuned_design_misses_no_requirement_and_the_plain_gain_some(source):
    (table,) = (t for t in titles(source)["Anti-jerk control"].tables if "requirements missed" in t.headers)
    missed = {row[0]: row[-1] for row in table.rows}
    assert missed["two degrees of freedom"] == "none"
    assert "oscillation" in missed["P"]
    paragraph = next(text for text in titles(source)["Anti-jerk control"].text if "Every requirement is met by" in text)
    assert '"two degrees of freedom"' in paragraph.split("Every requirement is met by")[1]


def test_anti_jerk_control_takes_the_tip_in_through_play(source):
    table = titles(source)["Anti-jerk control"].tables[-1]
    assert [row[0] for row in table.rows] == ["0", "0.5", "1", "2"]
    columns = np.array([row[1:] for row in table.rows], dtype=float).T
    # more play, higher peaks; with the controller lower ones, and it comes to rest
    for opened, controlled in zip(columns[0:4:2], columns[1:4:2], strict=True):
        assert (np.diff(opened) > 0.0).all()
        assert (np.diff(controlled) > 0.0).all()
        assert (controlled < opened).all()
    # what is left after 1.4 s, 0.5 % of the final acceleration, is below what a driver feels
    assert (columns[5] < 0.02).all()
    assert (columns[5] < 0.02 * columns[4]).all()


def measured_pair():
    """Torque up and down on one of two discs; both speeds with the second one 2 rad/s off."""
    time = 0.002 * np.arange(200)
    torque = np.interp(time, [0.0, 0.1, 0.12, 0.25, 0.26], [0.0, 0.0, 50.0, 50.0, -20.0])
    response = pt.simulate(pair(), time, {"a_torque": torque})
    values = {"a_torque": torque, "a_speed": response["a_speed"], "b_speed": response["b_speed"] + 2.0}
    return pt.plots.Signals(time=time, values=values)


def test_parameters_found_from_a_run_stand_in_the_report_with_fit_and_curves(tmp_path):
    found = pt.identify(pair().replace("b", J=2.4), measured_pair(), ["b.J"])
    report = write_report(found.car, tmp_path, measured=found)
    section = titles(report)["Measured"]
    parameters, fits = section.tables
    assert parameters.rows[0][:3] == ["b.J", "3", "kg m^2"]
    assert [(row[1], row[3]) for row in fits.rows] == [("a_speed", "100.0"), ("b_speed", "100.0")]
    assert all(float(row[2]) < 99.0 for row in fits.rows)
    names = {file.name for file in report.files}
    assert {"measured_1.svg", "residual_1.svg"} <= names
    model = section.pictures[0].figure.axes[1].lines[-1].get_ydata()
    np.testing.assert_allclose(model, measured_pair()["a_speed"], atol=1e-9)
    assert "## Measured" in written(report, "report.md")


def test_a_car_beside_runs_it_was_not_fitted_to_has_no_parameters_in_the_report():
    runs = [pt.validate(pair(), measured_pair()), pt.validate(pair().replace("b", J=2.4), measured_pair())]
    section = measured_section(runs)
    (fits,) = section.tables
    assert [row[2] for row in fits.rows] == ["–"] * 4
    assert [float(row[3]) for row in fits.rows[:2]] == [100.0, 100.0]
    assert all(float(row[3]) < 99.0 for row in fits.rows[2:])
    assert [p.name for p in section.pictures] == ["measured_1", "residual_1", "measured_2", "residual_2"]
