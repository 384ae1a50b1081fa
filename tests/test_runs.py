"""Measured runs: what a file says, to the last bit, and what is wrong with it.

identification/columns and identification/measured.
"""

import csv
import sys
import types

import numpy as np
import pytest
import scipy.io

import powertrain_ctrl as pt

rng = np.random.default_rng(3)
TIME = np.cumsum(rng.uniform(0.008, 0.012, 60))
TORQUE, SPEED = rng.normal(50.0, 20.0, 60), rng.normal(1500.0, 100.0, 60)


def written(
    folder, delimiter=";", comma=False, header=("t", "T_ice", "n_ice"), before=(), units=(), name="run.csv", rows=None
):
    lines = [*before, delimiter.join(header), *([delimiter.join(units)] if units else [])]
    for row in np.transpose([TIME, TORQUE, SPEED]).tolist() if rows is None else rows:
        cells = [each if isinstance(each, str) else repr(each) for each in row]
        lines.append(delimiter.join(cell.replace(".", ",") if comma else cell for cell in cells))
    (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / name


def read(path, **more):
    return pt.read_run(path, time="t", engine_torque="T_ice", engine_speed="n_ice", **more)


WAYS = [(delimiter, comma) for delimiter in (";", "\t", ",", "|", "  ") for comma in (False, True)]
WAYS.remove((",", True))


@pytest.mark.parametrize(("delimiter", "comma"), WAYS)
def test_a_file_with_any_delimiter_reads_as_it_was_to_the_last_bit(tmp_path, delimiter, comma):
    run = read(written(tmp_path, delimiter, comma))
    np.testing.assert_array_equal(run.time, TIME)
    np.testing.assert_array_equal(run["engine_torque"], TORQUE)
    np.testing.assert_array_equal(run["engine_speed"], SPEED)
    assert (run.inputs, run.outputs) == (("engine_torque",), ("engine_speed",))
    assert isinstance(run, pt.Response)


def test_lines_before_the_header_units_below_it_and_quotes_are_passed_over(tmp_path):
    before = ["Logger 4.2; serial 17", "", "driver;unknown;third gear"]
    file = written(tmp_path, before=before, units=("s", "Nm", "1/min"), header=('"t"', '"T_ice"', '"n_ice"'))
    np.testing.assert_array_equal(read(file)["engine_speed"], SPEED)


def test_a_file_of_windows_is_read(tmp_path):
    file = written(
        tmp_path, header=("t", "T_ice", "n_ice", "Öltemperatur"), rows=[[0.0, 1.0, 2.0, 80.0], [0.1, 1.5, 2.5, 80.0]]
    )
    file.write_bytes(file.read_text(encoding="utf-8").encode("cp1252"))
    np.testing.assert_array_equal(read(file)["engine_torque"], [1.0, 1.5])


def test_csv_of_the_standard_library_is_read(tmp_path):
    with open(tmp_path / "run.csv", "w", newline="") as file:
        csv.writer(file, quoting=csv.QUOTE_ALL).writerows(
            [["t", "T_ice", "n_ice"], *np.transpose([TIME, TORQUE, SPEED]).tolist()]
        )
    np.testing.assert_array_equal(read(tmp_path / "run.csv").time, TIME)


def test_units_are_converted_where_they_are_told(tmp_path):
    file = written(tmp_path, rows=[[0.0, 0.25, 60.0], [10.0, 0.5, 120.0]])
    run = read(file, units={"time": "ms", "engine_torque": "kNm", "engine_speed": "rpm"})
    np.testing.assert_allclose(run.time, [0.0, 0.01], rtol=1e-15)
    np.testing.assert_allclose(run["engine_torque"], [250.0, 500.0], rtol=1e-15)
    np.testing.assert_allclose(run["engine_speed"], [2 * np.pi, 4 * np.pi], rtol=1e-15)
    wheel = read(file, units={"engine_speed": 1.0 / (3.6 * 0.31)})["engine_speed"]
    np.testing.assert_allclose(wheel, np.array([60.0, 120.0]) / 3.6 / 0.31, rtol=1e-15)


@pytest.mark.parametrize(
    ("unit", "one"), [("km/h", 1 / 3.6), ("deg", np.pi / 180), ("1/min", np.pi / 30), ("rev/s", 2 * np.pi)]
)
def test_one_of_a_unit_is_so_much(tmp_path, unit, one):
    run = read(written(tmp_path, rows=[[0.0, 1.0, 1.0], [1.0, 1.0, 2.0]]), units={"engine_speed": unit})
    np.testing.assert_allclose(run["engine_speed"], [one, 2 * one], rtol=1e-15)


def test_mat_files_of_scipy_are_read_and_fields_of_structures(tmp_path):
    scipy.io.savemat(tmp_path / "flat.mat", {"t": TIME, "T_ice": TORQUE[:, None], "n_ice": SPEED})
    np.testing.assert_array_equal(read(tmp_path / "flat.mat")["engine_torque"], TORQUE)
    scipy.io.savemat(tmp_path / "deep.mat", {"run": {"t": TIME, "n": SPEED}})
    deep = pt.read_run(tmp_path / "deep.mat", time="run.t", engine_speed="run.n")
    np.testing.assert_array_equal(deep["engine_speed"], SPEED)


def test_parquet_is_read_where_pandas_is_there(tmp_path, monkeypatch):
    class Column(np.ndarray):
        def to_numpy(self):
            return np.asarray(self)

    class Table(dict):
        columns = property(lambda self: list(self))

    table = Table((name, values.view(Column)) for name, values in (("t", TIME), ("T_ice", TORQUE), ("n_ice", SPEED)))
    stand_in = types.SimpleNamespace(read_parquet=lambda file: table if file.read() == b"PAR1" else None)
    (tmp_path / "run.parquet").write_bytes(b"PAR1")
    monkeypatch.setitem(sys.modules, "pandas", stand_in)
    np.testing.assert_array_equal(read(tmp_path / "run.parquet")["engine_torque"], TORQUE)
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(pt.FileError, match="Parquet needs pandas"):
        read(tmp_path / "run.parquet")


def test_cells_without_a_value_are_no_samples_and_are_told(tmp_path):
    rows = [[0.01 * i, 5.0 + i % 3, "" if i in (7, 8) else 100.0 + i] for i in range(20)]
    run = read(written(tmp_path, rows=rows))
    assert np.isnan(run["engine_speed"][[7, 8]]).all()
    assert [(gap.signal, gap.missing) for gap in run.gaps] == [("engine_speed", 2)]
    assert (run.gaps[0].start, run.gaps[0].stop) == (0.06, 0.09)
    assert "gap in engine_speed: 0.06 to 0.09 s, 2 samples" in repr(run)
    assert "without sample" in run._repr_html_()


def test_a_single_sample_that_stands_out_is_told_and_corners_are_not(tmp_path):
    t = 0.01 * np.arange(400)
    torque = np.interp(t, [0.0, 1.0, 1.05, 2.0, 2.0001, 4.0], [30.0, 30.0, 150.0, 150.0, -20.0, -20.0])
    speed = 100.0 + 8.0 * np.sin(2 * np.pi * 4.0 * t) + rng.normal(0.0, 0.05, 400)
    speed[150] += 3.0
    run = read(written(tmp_path, rows=np.transpose([t, torque, speed]).tolist()))
    assert [(each.signal, round(each.time, 9)) for each in run.outliers] == [("engine_speed", 1.5)]
    assert "outlier in engine_speed at 1.5 s" in repr(run)
    cleaned = run.without_outliers()
    assert np.isnan(cleaned["engine_speed"][150])
    assert cleaned.outliers == ()
    assert "1 outliers taken out" in cleaned.title


def test_resampling_is_on_straight_lines_says_so_and_crosses_no_gap_unasked(tmp_path):
    t = np.delete(0.01 * np.arange(101), slice(40, 50))
    run = read(written(tmp_path, rows=np.transpose([t, t, 3.0 * t]).tolist()))
    with pytest.raises(pt.SignalError, match=r"has a gap from 0.39 to 0.5 s, permitted: up to 0 s; give longest_gap"):
        run.resampled(0.02)
    even = run.resampled(0.02, longest_gap=0.2)
    np.testing.assert_allclose(even.time, 0.02 * np.arange(51), atol=1e-15)
    np.testing.assert_allclose(even["engine_speed"], 3.0 * even.time, atol=1e-14)
    assert even.title == "run.csv, on straight lines every 0.02 s"


def test_a_part_of_a_run_is_a_run(tmp_path):
    run = read(written(tmp_path))
    part = run.part(TIME[10], TIME[20])
    np.testing.assert_array_equal(part["engine_speed"], SPEED[10:21])
    assert part.final.speed == {"engine": SPEED[20]}
    with pytest.raises(pt.SignalError, match="there are 0 samples, permitted: at least two"):
        run.part(100.0, 200.0)


def test_a_run_goes_to_control(tmp_path):
    data = read(written(tmp_path)).to_control()
    np.testing.assert_array_equal(data.outputs["engine_speed"], SPEED)


BAD = {
    "a column that is missing": (
        dict(header=("t", "T_icE", "n_ice")),
        'column "T_ice" is not there; did you mean "T_icE"',
    ),
    "no column at all": (dict(header=("a", "b", "c")), 'column "t" is not there; there is a, b, c'),
    "a column twice": (dict(header=("t", "T_ice", "n_ice", "t")), 'column "t" is there 2 times'),
    "time that goes back": (
        dict(rows=[[0.0, 1, 2.0], [0.2, 2, 3.0], [0.1, 3, 4.0]]),
        "time goes from 0.2 s to 0.1 s in sample 3",
    ),
    "time that stands": (dict(rows=[[0.0, 1, 2.0], [0.0, 2, 3.0]]), "permitted: increasing"),
    "time that is missing": (dict(rows=[[0.0, 1, 2.0], ["", 2, 3.0], [1.0, 2, 3.0]]), "time is nan in sample 2"),
    "a word": (
        dict(rows=[[0.0, 1, 2.0], [0.1, "off", 3.0]]),
        "line 3, column \"T_ice\": 'off', permitted: a number or nothing",
    ),
    "no end": (dict(rows=[[0.0, 1, 2.0], [0.1, "inf", 3.0]]), 'signal "engine_torque" is inf at t = 0.1 s'),
    "a line that is cut": (dict(rows=[[0.0, 1, 2.0], [0.1, 2]]), "line 3 has 2 values, the header 3"),
    "a decimal comma between commas": (dict(delimiter=",", comma=True), None),
    "one sample": (dict(rows=[[0.0, 1, 2.0]]), "1 samples, permitted: at least two"),
    "a signal of one sample": (dict(rows=[[0.0, 1, ""], [0.1, 2, ""], [0.2, 2, 3.0]]), '"engine_speed" has 1 samples'),
}


@pytest.mark.parametrize("what", BAD)
def test_a_file_with_a_fault_is_refused_by_name(tmp_path, what):
    given, message = BAD[what]
    with pytest.raises(pt.PowertrainError) as caught:
        read(written(tmp_path, **given))
    assert message is None or message in str(caught.value)


@pytest.mark.parametrize("name", ["missing.csv", "missing.mat", "folder", "wrong.mat", "new.mat", "wrong.parquet"])
def test_what_is_no_such_file_is_refused(tmp_path, name):
    (tmp_path / "folder").mkdir()
    for wrong in ("wrong.mat", "wrong.parquet"):
        (tmp_path / wrong).write_bytes(b"no such file")
    (tmp_path / "new.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(512))
    with pytest.raises(pt.FileError, match=name.replace(".", r"\.")):
        read(tmp_path / name)


def test_units_and_signals_that_are_not_known_are_refused(tmp_path):
    file = written(tmp_path)
    with pytest.raises(pt.PowertrainError, match='engine_speed: unit "rmp" is not known; did you mean "rpm"'):
        read(file, units={"engine_speed": "rmp"})
    with pytest.raises(pt.UnknownNameError, match='"wheel_speed" is not one that is asked for'):
        read(file, units={"wheel_speed": "rpm"})
    with pytest.raises(pt.PowertrainError, match="no signal is asked for"):
        pt.read_run(file, time="t")
