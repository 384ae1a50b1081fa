"""The report: what it holds, that it stands alone, and that it is written whole or not at all."""

import re
from html.parser import HTMLParser
from pathlib import Path

import matplotlib
import pytest

matplotlib.use("Agg")

import powertrain_ctrl as pt
from powertrain_ctrl import report as report_module
from powertrain_ctrl.report import write_report


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


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    return write_report(pt.examples.conventional(), tmp_path_factory.mktemp("source"), "The source's car")


def written(report, name):
    return next(file for file in report.files if file.name == name).read_text(encoding="utf-8")


def titles(report):
    return {section.title: section for section in report.sections}


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


def test_every_file_listed_is_there(source):
    assert all(file.stat().st_size > 500 for file in source.files)
    names = {file.name for file in source.files}
    figures = ("mode_1", "mode_open_1", "energies", "load_change", "load_change_compared", "bode")
    assert names == {"report.html", "report.md"} | {f"{name}.{kind}" for name in figures for kind in ("svg", "png")}


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
    assert page.tags.count("svg") == 6


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
    pictures = re.findall(r"!\[[^]]*\]\(([^)]*)\)", written(source, "report.md"))
    assert len(pictures) == 6
    assert all((folder / picture).exists() for picture in pictures)


def test_a_copy_of_the_source_car_gets_the_printed_values(tmp_path):
    pt.examples.conventional().release("clutch").save(tmp_path / "copy.toml")
    report = write_report(pt.load(tmp_path / "copy.toml"), tmp_path / "out")
    assert sum("f printed [Hz]" in table.headers for table in report.frequency_tables) == 2


def test_another_gear_has_no_printed_values(tmp_path):
    report = write_report(pt.examples.conventional(gear_ratio=3.6), tmp_path)
    assert not any("f printed [Hz]" in table.headers for table in report.frequency_tables)


def test_own_driveline_gets_all_that_applies(tmp_path):
    report = write_report(own_car(), tmp_path, car_name="Own <car> & more")
    figures = {file.name for file in report.files if file.suffix == ".svg"}
    assert {"mode_1.svg", "mode_2.svg", "mode_open_input_1.svg", "energies.svg", "bode.svg"} <= figures
    assert {"load_change.svg", "load_change_compared.svg"} <= figures
    assert "<h1>Own &lt;car&gt; &amp; more</h1>" in written(report, "report.html")
    assert len(report.frequency_tables) == 2


def test_the_same_driveline_gives_the_same_bytes(tmp_path):
    first, second = (write_report(own_car(), tmp_path / name) for name in ("a", "b"))
    for a, b in zip(first.files, second.files, strict=True):
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


def test_clutches_that_cannot_all_be_closed_leave_the_state_of_the_file(tmp_path):
    report = write_report(two_speed().release("second"), tmp_path)
    sections = titles(report)
    assert "standstill" in sections["Natural frequencies, closed clutch"].text[0]
    assert sections["Natural frequencies, clutches as in the file"].tables[0].is_frequency
    assert "Clutches as in the file." in sections["Frequency response"].text
    assert any(file.name == "load_change.svg" for file in report.files)


def test_a_driveline_that_cannot_be_assembled_writes_nothing(tmp_path):
    with pytest.raises(pt.TopologyError):
        write_report(two_speed(), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_below_a_file_leaves_nothing(tmp_path):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(pt.FileError, match="cannot be written"):
        write_report(own_car(), tmp_path / "file" / "deep" / "out")
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
        write_report(own_car(), tmp_path / "deep" / "out")
    assert not list(tmp_path.iterdir())


def test_a_failure_keeps_an_earlier_report(tmp_path, monkeypatch):
    earlier = write_report(own_car(), tmp_path)
    before = {file: file.read_bytes() for file in earlier.files}
    (tmp_path / "figures" / "bode.png").unlink()
    (tmp_path / "figures" / "bode.png").mkdir()
    with pytest.raises(pt.FileError, match=r"bode\.png is a folder"):
        write_report(own_car().replace("engine", J=0.5), tmp_path)
    assert all(file.read_bytes() == before[file] for file in earlier.files if file.is_file())
    assert not list(tmp_path.glob(".report-*"))


def test_a_failure_while_drawing_writes_nothing(tmp_path, monkeypatch):
    def fails(picture, kind):
        raise RuntimeError("drawing")

    monkeypatch.setattr(report_module, "_drawn", fails)
    with pytest.raises(RuntimeError):
        write_report(own_car(), tmp_path / "out")
    assert not (tmp_path / "out").exists()
