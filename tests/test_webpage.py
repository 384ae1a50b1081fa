"""The report as a web page: what a reader meets first, what can be linked, and that nothing in it becomes a tag.

Of report/webpage, report/drawings, report/numbering, report/origin, report/verdict, report/folder.
"""

import dataclasses
import re
from html import unescape
from html.parser import HTMLParser

import matplotlib
import numpy as np
import pytest
from chromium import PATH, chromium

import powertrain_ctrl as pt
from powertrain_ctrl.report.antijerk import antijerk_section
from powertrain_ctrl.report.drawings import embedded, shades
from powertrain_ctrl.report.folder import require_writable
from powertrain_ctrl.report.linear import as_in_file_section, bode_section, closed_clutch_section
from powertrain_ctrl.report.numbering import numbered
from powertrain_ctrl.report.origin import Origin
from powertrain_ctrl.report.page import write_report
from powertrain_ctrl.report.subject import Finding, Picture, Section, Subject, Table, _pumps, new_figure, subject_of
from powertrain_ctrl.report.verdict import Verdict, verdict_of
from powertrain_ctrl.report.webpage import webpage

EVIL = "<script>alert(1)</script> & \"x\" 'y'"


@pytest.fixture(scope="module")
def page(source_report):
    return source_report.files[-1].read_text(encoding="utf-8")


def words_of(page):
    """Words that are read: without style sheet, figures and files."""
    text = re.sub(r"<(style|svg|pre)\b.*?</\1>", " ", page, flags=re.DOTALL)
    return len(re.sub(r"<[^>]*>", " ", text).split())


def of_pair(**changes):
    discs = pt.Driveline(
        pt.Inertia("a", J=1.0), pt.SpringDamper("shaft", "a", "b", stiffness=1e4), pt.Inertia("b", J=3.0)
    )
    return Subject(discs, changes.pop("name", "pair"))


def page_of(sections, name="pair", verdict=None, origin=None):
    subject = of_pair(name=name)
    verdict = verdict or verdict_of(subject, {section.title: section for section in sections})
    files = {
        f"figures/{p.name}.svg": b'<svg width="100pt" xmlns="http://www.w3.org/2000/svg"></svg>'
        for section in sections
        for p in section.pictures
    }
    return webpage(subject, verdict, numbered(verdict, sections), files, origin or Origin())


def test_the_verdict_comes_first_with_five_numbers_and_a_figure(page):
    first = page[: page.index('<section id="driveline">')]
    assert len(re.findall(r"<li><a href=\"#[\w-]+\"><strong>", first)) == 5
    assert first.count("<svg") == 1
    assert "2.638 Hz" in first
    assert "2.2.2 Oscillation Analysis and Control Models" in first


def test_numbers_of_the_verdict_are_those_of_the_package(page):
    car = pt.examples.conventional()
    values = re.findall(r"<strong>([^<]*)</strong>", page[: page.index('<section id="driveline">')])
    heat = pt.launch(pt.examples.conventional(damping="open")).slip_energy["clutch"]
    f1 = pt.modes(car).frequency_hz[1]
    off = 100.0 * (pt.two_mass(car, "source").frequency_hz / f1 - 1.0)
    assert values[:3] == [f"{f1:.3f} Hz", f"{off:+.0f} %", f"{heat / 1e3:.1f} kJ"]
    assert values[4] == "29 of 29"


def test_findings_that_say_most_are_shown_in_the_order_of_the_sections():
    sections = {
        str(i): Section(str(i), findings=[Finding(f"{i}", "what", rank)])
        for i, rank in enumerate((6, 1, 2, 9, 0, 3, 4))
    }
    assert [found.value for found, _ in verdict_of(of_pair(), sections).findings] == ["1", "2", "4", "5", "6"]


def test_every_figure_and_table_has_a_number_and_an_anchor_of_its_own(page):
    labels = re.findall(r'<a class="label" href="#([^"]*)">((?:Table|Figure) \d+)</a>', page)
    for kind in ("Table", "Figure"):
        assert [label for _, label in labels if label.startswith(kind)] == [
            f"{kind} {i + 1}" for i in range(sum(label.startswith(kind) for _, label in labels))
        ]
    assert all(f'id="{anchor}"' in page for anchor, _ in labels)
    assert len(labels) == page.count("<svg") + page.count("<table>")


def test_contents_name_every_section_and_stay_in_sight(page):
    contents = page[page.index("<nav") : page.index("</nav>")]
    for title in re.findall(r"<h2>(.*?)</h2>", page):
        assert f">{title}</a>" in contents
    assert re.search(r"nav \{ position: sticky", page)


def test_the_page_is_short(page):
    assert words_of(page) < 3000


def test_the_foot_says_versions_command_day_and_the_driveline(page):
    foot = page[page.index("<footer") :]
    for name in ("powertrain_ctrl", "control", "numpy", "scipy", "matplotlib"):
        assert re.search(rf"{name} \d+\.\d+", foot)
    assert "powertrain-ctrl report --output" in foot
    assert re.search(r"on \d{4}-\d\d-\d\d", foot)
    assert "[drive_shafts]" in foot


def test_text_in_figures_is_text(page):
    assert page.count("<text") > 300
    assert ">acceleration [m/s²]<" in page


def test_heads_of_tables_say_what_they_head(page):
    assert page.count('<th scope="row"') > 50
    assert not re.search(r"<th(?! scope)", page.replace("<thead", ""))


def test_overdamped_modes_are_marked(page):
    assert "1.1966 †" in page
    assert "†: ζ ≥ 1 in mode 3" in page


def test_long_tables_are_folded_and_short_ones_are_not():
    rows = [[str(i), "x"] for i in range(30)]
    text = page_of([Section("A", tables=[Table("long", ["n", "x"], rows), Table("short", ["n", "x"], rows[:3])])])
    assert text.count('<details class="table"') == 1
    assert "(30 rows)" in text


def test_requirements_stand_before_what_they_judge(page):
    section = unescape(page[page.index('<section id="anti-jerk-control">') :])
    captions = [caption.strip() for caption in re.findall(r"</a> ([^<]*)", section)]
    assert captions.index("What is required of the source's car, besides stability on all") < next(
        i for i, caption in enumerate(captions) if caption.startswith("Designs on the nominal plant")
    )


class Tags(HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.tags, self.texts = [], []
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)

    def handle_data(self, data):
        self.texts.append(data)


def test_whatever_is_named_so_is_no_tag_in_the_page():
    picture = Picture("drawn", EVIL, new_figure(1.0, 1.0))
    section = Section(
        EVIL,
        [EVIL],
        definitions=[EVIL],
        tables=[Table(EVIL, [EVIL, "x"], [[EVIL, EVIL]], note=EVIL, topic=EVIL)],
        pictures=[picture],
        findings=[Finding(EVIL, EVIL, 0)],
    )
    text = page_of([section], name=EVIL, origin=Origin(command=EVIL, day=EVIL))
    found = Tags(text)
    assert "script" not in found.tags
    assert "".join(found.texts).count("<script>alert(1)</script>") >= 12
    label = re.search(r'aria-label="([^"]*)"', text[text.index("<svg") :])[1]
    assert "<" not in label


def test_a_name_in_a_figure_is_no_tag_in_its_svg(tmp_path):
    discs = pt.Driveline(pt.Inertia("a", J=1.0), pt.SpringDamper("s", "a", "b", stiffness=1e4), pt.Inertia("b", J=3.0))
    report = write_report(discs, tmp_path, car_name=EVIL)
    for file in report.files:
        if file.suffix in (".svg", ".html", ".md"):
            assert "<script" not in file.read_text()
    figure = new_figure(2.0, 2.0)
    figure.text(0.5, 0.5, EVIL)
    with matplotlib.rc_context({"svg.fonttype": "none"}):
        figure.savefig(tmp_path / "evil.svg")
    assert "<script" not in embedded((tmp_path / "evil.svg").read_text(), Picture("evil", EVIL, figure))


def test_colours_of_figures_are_those_of_the_page_and_greys_turn_round_in_the_dark():
    svg = '<svg width="10pt"><path style="stroke: #000000; fill: #ffffff"/><path style="stroke: #0072b2"/></svg>'
    text = embedded(svg, Picture("p", "c", new_figure(1.0, 1.0)))
    assert "#" not in re.sub(r"url\(#\w+\)", "", text)
    style = shades(text)
    assert "--grey-00: #000000" in style
    assert "--grey-ff: #ffffff" in style
    dark = style[style.index("@media") :]
    levels = [int(re.search(rf"--grey-{grey}: #(..)", dark)[1], 16) for grey in ("00", "ff")]
    assert levels[0] > 200 > 50 > levels[1]


def test_a_reference_in_a_text_becomes_a_link_and_an_unknown_one_stays():
    section = Section("A", ["see @drawn and @absent"], pictures=[Picture("drawn", "c", new_figure(1.0, 1.0))])
    assert '<p>see <a href="#figure-drawn">Figure 1</a> and @absent</p>' in page_of([section])


def test_without_findings_there_are_no_numbers():
    assert "findings" not in page_of([], verdict=Verdict((), (), None)).split("</style>")[1]


def test_a_folder_that_cannot_be_written_is_refused_before_any_work_and_a_good_one_is_left_as_it_was(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(pt.FileError, match="cannot be written there"):
        require_writable(tmp_path / "file" / "deep")
    require_writable(tmp_path / "new" / "deep")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    with pytest.raises(pt.FileError):
        require_writable(tmp_path / "a\0b")


# --- whatever car it is on


def converter_car(lockup):
    locks = [pt.Clutch("lockup", "engine", "turbine", max_torque=400.0)] if lockup else []
    tables = {"speed_ratios": (0.0, 0.6, 0.85, 1.0), "capacities": (3e-3, 3e-3, 2e-3, 0.0)}
    return pt.Driveline(
        pt.Inertia("engine", J=0.2),
        pt.TorqueConverter("converter", "engine", "turbine", **tables, torque_ratios=(2.0, 1.4, 1.0, 1.0)),
        *locks,
        pt.Inertia("turbine", J=0.05),
        pt.Gear("gears", "turbine", "axle", ratio=8.0),
        pt.SpringDamper("drive_shafts", "axle", "wheels", stiffness=12e3, damping=150.0),
        pt.Inertia("wheels", J=3.0),
        pt.Tyre("tyres", "wheels", "vehicle", radius=0.3),
        pt.Mass("vehicle", m=1500.0),
    )


def with_play():
    car = pt.examples.conventional()
    s = car["drive_shafts"]
    play = pt.Backlash(s.name, s.a, s.b, gap=0.035, stiffness=s.stiffness, damping=s.damping)
    return pt.Driveline(*(play if element is s else element for element in car))


def with_pendulum():
    return pt.Driveline(*pt.examples.conventional(), pt.Pendulum("absorber", "engine", J=0.02, order=2.0))


def with_losses():
    return pt.examples.conventional().replace("drive_shafts", loss_factor=0.05)


def two_discs(*more, **shaft):
    return pt.Driveline(
        pt.Inertia("a", J=1.0),
        pt.SpringDamper("shaft", "a", "b", stiffness=1e4, **shaft),
        pt.Inertia("b", J=3.0),
        *more,
    )


CARS = {
    "conventional": pt.examples.conventional,
    "front_wheel_drive": pt.examples.front_wheel_drive,
    "rear_wheel_drive": pt.examples.rear_wheel_drive,
    "all_wheel_drive": pt.examples.all_wheel_drive,
    "electric": pt.examples.electric,
    "p2_hybrid": lambda: pt.examples.p2_hybrid(2),
    "truck": lambda: pt.examples.truck(3),
    "wind_turbine": pt.examples.wind_turbine,
    "marine": pt.examples.marine,
    "with_play": with_play,
    "with_pendulum": with_pendulum,
    "with_losses": with_losses,
    "converter": lambda: converter_car(False),
    "converter_with_lockup": lambda: converter_car(True),
}
ALONE = {
    "losses_alone": lambda: two_discs(loss_factor=0.05),
    "pendulum_alone": lambda: two_discs(pt.Pendulum("absorber", "a", J=0.05, order=2.0)),
}


def require_sound(report):
    """No number that is none, and something in every panel of every figure."""
    text = re.sub(r"<(style|pre)\b.*?</\1>", " ", report.files[-1].read_text(encoding="utf-8"), flags=re.DOTALL)
    assert re.findall(r".{0,40}\b(?:nan|NaN|inf)\b.{0,20}", unescape(re.sub(r"<[^>]*>", " ", text))) == []
    for picture in (picture for section in report.sections for picture in section.pictures):
        for ax in (ax for ax in picture.figure.axes if ax.get_visible()):
            lines = [np.ma.masked_invalid(np.asarray(line.get_ydata(), float)).count() for line in ax.lines]
            assert any(lines) or ax.collections or ax.patches or ax.images or ax.texts, picture.name


@pytest.mark.parametrize("name", ALONE)
def test_a_report_of_what_has_no_vehicle_shows_its_modes_and_says_what_it_cannot(name, tmp_path):
    report = write_report(ALONE[name](), tmp_path)
    require_sound(report)
    page = report.files[-1].read_text(encoding="utf-8")
    assert "18.378" in page or "Natural frequencies" in page
    assert "the driveline has no Mass and no node called" in unescape(page)


def test_a_slipping_converter_is_linear_where_its_pump_takes_the_load():
    """At 20 m/s the turbine turns with 8 * 20 / 0.3 = 533 rad/s; the pump faster, so that it takes 100 N m."""
    subject = subject_of(converter_car(False), "car")
    assert subject.about == "under 100 N m at 20 m/s"
    turbine = 8.0 * 20.0 / 0.3
    (pump,) = _pumps(converter_car(False), {"vehicle": 20.0}).values()
    assert pump > turbine
    assert converter_car(False)["converter"].torques(pump, turbine)[0] == pytest.approx(100.0, rel=1e-9)
    assert _pumps(converter_car(True), {"vehicle": 20.0}) == {}


def test_clutches_that_cannot_all_be_closed_leave_the_verdict_its_first_mode():
    subject = subject_of(pt.examples.p2_hybrid(2), "car")
    section = as_in_file_section(subject)
    f1 = pt.modes(pt.examples.p2_hybrid(2)).frequency_hz[1]
    assert section.findings[0].value == f"{f1:.3f} Hz"
    assert {picture.name for picture in section.pictures} == {"mode_1", "mode_2", "mode_3", "energies"}
    assert closed_clutch_section(subject).findings == ()


def test_a_vehicle_of_any_name_is_in_the_verdict():
    car = pt.examples.electric()
    tyres, vehicle = car["tyres"], car["vehicle"]
    others = [element for element in car if element not in (tyres, vehicle)]
    body = pt.Driveline(*others, dataclasses.replace(tyres, body="body"), pt.Mass("body", m=vehicle.m))
    found = antijerk_section(subject_of(body, "car"))
    assert found.highlight is not None
    assert {finding.value for finding in found.findings} >= {"29 of 29"}


def test_the_bode_diagram_shows_every_mode():
    car = pt.examples.electric()
    (picture,) = bode_section(subject_of(car, "car")).pictures
    low, high = picture.figure.axes[0].get_xlim()
    assert low < pt.modes(car).frequency_hz[1] < pt.modes(car).frequency_hz[-1] < high


@pytest.mark.campaign
@pytest.mark.parametrize("name", CARS)
def test_no_report_has_a_number_that_is_none_or_an_empty_figure(name, tmp_path):
    report = write_report(CARS[name](), tmp_path)
    require_sound(report)
    assert {section.title for section in report.sections} >= {"Driveline", "Load change", "Anti-jerk control"}


# --- in a browser


@pytest.fixture(scope="module")
def browser():
    if PATH is None:
        pytest.skip("no Chromium is installed")
    with chromium() as found:
        yield found


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [400, 1280])
def test_a_browser_finds_no_fault_and_nothing_scrolls_sideways(browser, source_report, width, scheme):
    browser.open(source_report.files[-1].as_uri(), width, scheme=scheme)
    assert browser.faults == []
    assert browser.value("document.documentElement.scrollWidth") <= width
    background = browser.value("getComputedStyle(document.body).backgroundColor")
    lightness = np.mean([int(level) for level in re.findall(r"\d+", background)[:3]])
    assert (lightness > 200) == (scheme == "light")


def test_on_a_phone_captions_and_first_columns_stay_in_sight(browser, source_report):
    browser.open(source_report.files[-1].as_uri(), 400)
    widest = browser.value(
        "Math.max(...[...document.querySelectorAll('figcaption, summary, .note')].map(e => e.getBoundingClientRect().right))"
    )
    assert widest <= 400
    browser.value("document.querySelectorAll('details').forEach(e => e.open = true)")
    browser.value("document.querySelectorAll('.scroll').forEach(e => e.scrollLeft = 1e4)")
    left = browser.value(
        "Math.min(...[...document.querySelectorAll('tbody th')].map(e => e.getBoundingClientRect().left))"
    )
    assert left >= 0
