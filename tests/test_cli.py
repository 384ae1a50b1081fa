"""The command line: exit codes, one clear line for what is wrong, and nothing heavy imported for help and tables.

Of __main__.
"""

import json
import re
import subprocess
import sys

import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl.cli import main
from powertrain_ctrl.report.page import NOT_QUICK, SECTIONS

SOURCE_FILE = str(pt.examples.path("conventional"))
# Two discs of 1 kg m^2 that swing with 60 Hz against each other, k = J / 2 omega^2; quick to report.
PAIR = pt.Driveline(
    pt.Inertia("a", J=1.0),
    pt.Inertia("b", J=1.0),
    pt.SpringDamper("shaft", "a", "b", stiffness=0.5 * (2.0 * np.pi * 60.0) ** 2),
)


@pytest.fixture
def pair(tmp_path):
    PAIR.save(tmp_path / "pair.toml")
    return str(tmp_path / "pair.toml")


def run(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "powertrain_ctrl", *arguments], capture_output=True, text=True, timeout=120
    )


def one_line(text):
    return len(text.strip().splitlines()) == 1 and "Traceback" not in text


def test_modes_prints_the_table_alone(capsys):
    assert main(["modes", SOURCE_FILE]) == 0
    assert capsys.readouterr().out == f"{pt.modes(pt.load(SOURCE_FILE))!r}\n"


def test_modes_takes_the_clutches_as_the_file_has_them(tmp_path, capsys):
    pt.examples.conventional().release("clutch").save(tmp_path / "open.toml")
    assert main(["modes", str(tmp_path / "open.toml")]) == 0
    assert "7.2542" in capsys.readouterr().out


def test_modes_as_json(capsys):
    assert main(["modes", SOURCE_FILE, "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    assert table["frequency_hz"] == pt.modes(pt.load(SOURCE_FILE)).frequency_hz.tolist()
    assert table["damping_ratio"][0] is None


def test_report_prints_printed_beside_computed_and_lists_its_files(source_command):
    code, out, report = source_command
    assert code == 0
    for printed, computed in [("2.6", "2.6377"), ("1064.6", "1064.6325"), ("7.3", "7.2542"), ("1839.6", "1839.6499")]:
        assert any(printed in row.split() and computed in row.split() for row in out.splitlines())
    folder = report.files[-1].parent
    assert folder.name == "out"
    assert out.splitlines()[-1] == f"Open {folder / 'report.html'}"
    assert out.splitlines()[-2].endswith(
        f"{sum(file.suffix == '.svg' for file in report.files)} figures as SVG and PNG"
    )


def test_report_says_each_section_with_its_seconds_after_the_tables(source_command):
    _, out, _ = source_command
    steps = re.findall(r"^  (\S.*?) +\d+\.\d s$", out, flags=re.MULTILINE)
    assert set(steps) <= {"matplotlib and python-control", *SECTIONS, "Verdict and page"}
    assert steps.index("Driveline") < steps.index("Anti-jerk control")
    assert out.index("1064.6325") < out.index("  Driveline  ")


def test_report_of_a_file(pair, tmp_path, capsys):
    assert main(["report", pair, "--output", str(tmp_path / "out")]) == 0
    assert "60.0000" in capsys.readouterr().out
    assert (tmp_path / "out" / "report.html").exists()


def test_a_quick_report_leaves_out_what_takes_long_and_says_so(tmp_path, capsys):
    assert main(["report", SOURCE_FILE, "--quick", "--output", str(tmp_path)]) == 0
    out, page = capsys.readouterr().out, (tmp_path / "report.html").read_text()
    assert "Left out of this quick report" in page
    for title in NOT_QUICK:
        assert title not in out
        assert f"<h2>{title}" not in page


def test_report_goes_to_the_folder_report(pair, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["report", pair]) == 0
    assert (tmp_path / "report" / "report.md").exists()


@pytest.mark.parametrize("command", [["modes"], ["report", "--output", "unused"]])
@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[engine\n", "not TOML"),
        ('[engine]\ntype = "Inertia"\nJ = -1.0\n', "J = -1.0 kg m^2, permitted"),
        ('[engine]\ntype = "Inertia"\nj = 1.0\n', 'unknown key "j" for Inertia'),
        ('[engine]\ntype = "Motor"\n', "type = 'Motor'"),
    ],
)
def test_a_bad_file_is_one_line_on_standard_error(command, text, named, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "car.toml").write_text(text)
    assert main([command[0], "car.toml", *command[1:]]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert one_line(err)
    assert named in err
    assert not (tmp_path / "unused").exists()


def test_a_file_that_is_not_there(tmp_path):
    process = run("modes", str(tmp_path / "none.toml"))
    assert process.returncode == 1
    assert one_line(process.stderr)
    assert "none.toml" in process.stderr


@pytest.mark.parametrize("file", ["/dev/zero", "/", "a\0b", ""])
def test_what_is_no_file_is_one_line_on_standard_error(file, capsys):
    assert main(["modes", file]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert one_line(err)
    assert "cannot be read" in err


def test_an_unwritable_folder_is_one_line_on_standard_error(pair, tmp_path, capsys):
    (tmp_path / "file").write_text("")
    assert main(["report", pair, "--output", str(tmp_path / "file" / "out")]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert one_line(err)


# One process for several commands, each begun as ``python -m powertrain_ctrl`` does: exit codes, and what was imported.
SEVERAL = """
import json, runpy, sys
codes = []
for arguments in json.loads(sys.argv[1]):
    sys.argv = ["powertrain_ctrl", *arguments]
    try:
        runpy.run_module("powertrain_ctrl", run_name="__main__", alter_sys=True)
    except SystemExit as end:
        codes.append(end.code)
print(json.dumps([codes, sorted(sys.modules)]))
"""


def test_help_and_tables_import_neither_matplotlib_nor_control_and_no_command_is_an_error():
    commands = [["--help"], ["report", "--help"], ["modes", SOURCE_FILE], []]
    process = subprocess.run(
        [sys.executable, "-c", SEVERAL, json.dumps(commands)], capture_output=True, text=True, timeout=120
    )
    codes, imported = json.loads(process.stdout.splitlines()[-1])
    assert codes == [0, 0, 0, 2]
    assert "powertrain_ctrl.cli" in imported
    assert not {name for name in imported if name.split(".")[0] in ("matplotlib", "control")}


def test_a_reader_that_stops_early_is_no_error():
    process = subprocess.run(
        f"'{sys.executable}' -m powertrain_ctrl modes '{SOURCE_FILE}' | head -1",
        shell=True,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert process.stderr == ""


def test_orders_prints_the_critical_speeds_of_an_evenly_firing_engine(capsys):
    assert main(["orders", SOURCE_FILE, "--cylinders", "6", "--rpm", "500", "3000", "--highest", "9"]) == 0
    engine = pt.Engine(cylinders=6, firing_order=(1, 2, 3, 4, 5, 6), orders={n / 2: 1.0 for n in range(1, 19)})
    expected = pt.critical_speeds(pt.load(SOURCE_FILE), engine, (500.0, 3000.0))
    assert capsys.readouterr().out == f"{expected!r}\n"
    assert set(expected.order.tolist()) <= {3.0, 6.0, 9.0}


def test_orders_as_json(capsys, pair):
    assert main(["orders", pair, "--node", "b", "--json"]) == 0
    table = json.loads(capsys.readouterr().out)
    # 60 Hz, orders 2 and 4 of four cylinders, and 6 at the lower end
    assert table["rpm"] == pytest.approx([1800.0, 900.0, 600.0])
    assert table["order"] == [2.0, 4.0, 6.0]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--cylinders", "13"], "cylinders = 13, permitted: <= 12"),
        (["--rpm", "900", "300"], "permitted: 0 < lowest < highest"),
        (["--highest", "0"], "highest_order = 0.0, permitted: 0.5 to 200"),
        (["--node", "motor"], 'node "motor" is not in this driveline'),
    ],
)
def test_orders_says_in_one_line_what_is_wrong(arguments, words, capsys, pair):
    assert main(["orders", pair, *arguments]) == 1
    error = capsys.readouterr().err
    assert one_line(error)
    assert words in error
