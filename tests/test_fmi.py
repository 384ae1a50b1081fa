"""FMUs, loaded as an importer loads them, and by fmpy where that is installed.

Of export/fmi, export/description, export/compilers.
"""

import ctypes
import uuid
import zipfile
from functools import cache
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from in_c import CASES, COMPILER, FOLDER, WITHOUT, compiled, gearbox, numbers, of_the_package, switching, two_bodies

import powertrain_ctrl as pt
from powertrain_ctrl.export import compilers

in_c = pytest.mark.skipif(COMPILER is None or compilers.this_system() is None, reason=WITHOUT)
HERE = [compilers.this_system()]
ERROR = 3


@pytest.fixture(autouse=True)
def quickly_compiled(monkeypatch):
    monkeypatch.setattr(compilers, "FLAGS", [flag for flag in compilers.FLAGS if flag != "-O2"])


def exported(car, version="3.0", systems=HERE, **options):
    """File of a car, with a library for this system."""
    file = Path(FOLDER.name) / f"{uuid.uuid4().hex}.fmu"
    pt.export.fmu(car, file, version=version, systems=systems, **options)
    return file


def described(file):
    """Root of the description, and its variables by name."""
    root = ElementTree.fromstring(zipfile.ZipFile(file).read("modelDescription.xml"))
    return root, {each.get("name"): each for each in root.find("ModelVariables")}


class Importer:
    """One instance of an FMU, called as its standard says."""

    def __init__(self, file, version, parameters=None, start=0.0):
        root, found = described(file)
        self.fmi, self.variables = f"fmi{version[0]}", found
        self.references = {name: int(each.get("valueReference")) for name, each in found.items()}
        archive = zipfile.ZipFile(file)
        library = next(name for name in archive.namelist() if name.startswith("binaries/"))
        copy = Path(FOLDER.name) / uuid.uuid4().hex
        copy.write_bytes(archive.read(library))
        self.library = ctypes.CDLL(str(copy))
        self.messages = []
        if version == "2.0":
            kind = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, ctypes.c_int, *[ctypes.c_char_p] * 3)
            self._log = kind(lambda _, name, status, category, form, message: self.messages.append(message.decode()))
            self._callbacks = (ctypes.c_void_p * 5)(ctypes.cast(self._log, ctypes.c_void_p).value)
            instance = self.function("Instantiate", ctypes.c_void_p)(
                b"car", 1, self.token(root), b"", self._callbacks, 0, 0
            )
        else:
            kind = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, *[ctypes.c_char_p] * 2)
            self._log = kind(lambda _, status, category, message: self.messages.append(message.decode()))
            make = self.function("InstantiateCoSimulation", ctypes.c_void_p)
            instance = make(
                b"car", self.token(root), b"", *[False] * 4, None, ctypes.c_size_t(0), None, self._log, None
            )
        assert instance
        self.instance = ctypes.c_void_p(instance)
        self.begin(parameters, start)

    def begin(self, parameters=None, start=0.0):
        time, wide = ctypes.c_double(start), ctypes.c_double(0.0)
        self.set(parameters or {})
        if self.fmi == "fmi2":
            assert self.call("SetupExperiment", 0, wide, time, 0, wide) == 0
            assert self.call("EnterInitializationMode") == 0
        else:
            assert self.call("EnterInitializationMode", False, wide, time, False, wide) == 0
        assert self.call("ExitInitializationMode") == 0

    def token(self, root):
        return (root.get("guid") or root.get("instantiationToken")).encode()

    def function(self, name, result=ctypes.c_int):
        found = getattr(self.library, self.fmi + name)
        found.restype = result
        return found

    def call(self, name, *arguments):
        return self.function(name)(self.instance, *arguments)

    def _values(self, name, names, values):
        count = ctypes.c_size_t(len(names))
        of = (ctypes.c_uint * len(names))(*(self.references[each] for each in names))
        kind, size = ("Real", ()) if self.fmi == "fmi2" else ("Float64", (count,))
        return self.call(name + kind, of, count, numbers(values), *size)

    def set(self, given):
        return self._values("Set", list(given), np.array(list(given.values()), dtype=float))

    def get(self, *names):
        values = np.zeros(len(names))
        assert self._values("Get", names, values) == 0, self.messages
        return values

    def step(self, time, length):
        arguments = ctypes.c_double(time), ctypes.c_double(length)
        if self.fmi == "fmi2":
            return self.call("DoStep", *arguments, 1)
        flags, last = [ctypes.c_bool() for _ in range(3)], ctypes.c_double()
        return self.call("DoStep", *arguments, True, *map(ctypes.byref, flags), ctypes.byref(last))

    def state(self):
        kept = ctypes.c_void_p()
        assert self.call(f"GetFMU{self.s}tate", ctypes.byref(kept)) == 0
        return kept

    def restore(self, state):
        return self.call(f"SetFMU{self.s}tate", state)

    @property
    def s(self):
        return "s" if self.fmi == "fmi2" else "S"

    def packed(self, state):
        size = ctypes.c_size_t()
        assert self.call(f"SerializedFMU{self.s}tateSize", state, ctypes.byref(size)) == 0
        content = ctypes.create_string_buffer(size.value)
        assert self.call(f"SerializeFMU{self.s}tate", state, content, size) == 0
        return content.raw

    def unpacked(self, content):
        state = ctypes.c_void_p()
        name = "DeSerializeFMUstate" if self.fmi == "fmi2" else "DeserializeFMUState"
        return self.call(name, content, ctypes.c_size_t(len(content)), ctypes.byref(state)), state

    def free(self):
        self.function("FreeInstance", None)(self.instance)


@in_c
@pytest.mark.parametrize(("version", "hold"), [("2.0", "zero"), ("3.0", "linear")])
@pytest.mark.parametrize("case", ["linear", "four clutches", "backlash"])
def test_speeds_and_modes_are_those_of_nonlinear_system(case, version, hold):
    car, dt, count, inputs, speed, permitted = CASES[case]
    times = np.arange(count) * dt
    system, u, expected = of_the_package(car, dt, times, inputs, speed, hold)
    file = exported(car, version, dt=dt, hold=hold, initial_speed=speed)
    at_start = dict(zip(system.input_labels, u[:, 0], strict=True))
    unit = Importer(file, version, at_start)
    names = [name for name in system.output_labels if name.endswith(("_speed", "_mode"))]
    shown = [unit.get(*names)]
    for k in range(count - 1):
        # what is set ahead of a step is held over it, or is where a straight line ends
        unit.set(dict(zip(system.input_labels, u[:, k if hold == "zero" else k + 1], strict=True)))
        assert unit.step(times[k], dt) == 0, unit.messages
        if hold == "zero":
            unit.set(dict(zip(system.input_labels, u[:, k + 1], strict=True)))
        shown.append(unit.get(*names))
    unit.free()
    shown = np.array(shown).T
    assert np.abs(shown - np.asarray(expected)[[system.find_output(name) for name in names]]).max() <= permitted


@pytest.mark.skipif(COMPILER is None, reason=WITHOUT)
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_the_sources_compile_without_a_warning(version):
    archive = zipfile.ZipFile(exported(gearbox(), version, systems=(), parameters=["vehicle.m"]))
    compiled(archive.read("sources/driveline.c").decode(), f"sources_{version[0]}")


@cache
def sliding_bodies(version):
    return exported(two_bodies(47.0)[0], version, dt=0.02, initial_speed={"a": 100.0})


@in_c
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_lock_within_a_step_is_told_to_the_last_digits(version):
    _, expected = two_bodies(47.0)
    unit = Importer(sliding_bodies(version), version, start=10.0)
    assert unit.step(10.0, 0.33) == 0
    assert unit.get("clutch_event_time") == [10.0]  # from free to sliding
    assert unit.step(10.33, 0.2) == 0
    assert abs(unit.get("clutch_event_time")[0] - 10.0 - expected) < 1e-12
    np.testing.assert_allclose(
        unit.get("a_speed", "b_speed", "clutch_mode", "time"), [30.0, 30.0, 0.0, 10.53], rtol=1e-12
    )
    unit.free()


@in_c
def test_steps_have_any_length():
    car, _, _, _, speed, _ = CASES["four clutches"]
    file, ends = exported(car, initial_speed=speed), []
    # many short ones, one that is no multiple of the step inside, and one that is less than rounding of it
    for lengths in ([0.2345], [0.0123, 0.1, 1e-12, 0.1222 - 1e-12], [0.2345 / 700] * 700):
        unit, time = Importer(file, "3.0", {"engine_torque": 100.0}), 0.0
        for length in lengths:
            assert unit.step(time, length) == 0, unit.messages
            time += length
        ends.append(unit.get("engine_speed", "vehicle_speed", "wheels_speed", "k1_event_time"))
        unit.free()
    np.testing.assert_allclose(ends, [ends[0]] * 3, rtol=1e-10)
    assert ends[0][3] > 0.0


@in_c
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_state_is_saved_restored_and_sent_to_another_instance(version):
    car, dt, count, inputs, speed, _ = CASES["clutch"]
    file = exported(car, version, dt=dt, initial_speed=speed)
    units = [Importer(file, version) for _ in range(2)]
    names = [name for name in units[0].references if name.endswith(("_speed", "_mode", "_torque", "_time"))]

    def on(unit, first, last):
        for k in range(first, last):
            unit.set({name: float(signal(k * dt)) for name, signal in inputs.items()})
            assert unit.step(k * dt, dt) == 0, unit.messages
        return unit.get(*names)

    on(units[0], 0, 30)
    state = units[0].state()
    expected = on(units[0], 30, count)
    assert len(np.unique(expected)) > 20
    assert units[0].restore(state) == 0
    np.testing.assert_array_equal(on(units[0], 30, count), expected)
    content = units[0].packed(state)
    status, copy = units[1].unpacked(content)
    assert status == 0
    assert units[1].restore(copy) == 0
    np.testing.assert_array_equal(on(units[1], 30, count), expected)
    for wrong in (content[:-1], b"\xff" * len(content)):
        assert units[1].unpacked(wrong)[0] == ERROR
        assert units[1].messages[-1] == "not a state of this model"
    units[0].call("Reset")
    units[0].begin()
    np.testing.assert_array_equal(on(units[0], 0, count), expected)
    for unit in units:
        unit.call(f"FreeFMU{unit.s}tate", ctypes.byref(state if unit is units[0] else copy))
        unit.free()


@in_c
def test_parameters_are_set_before_the_start_and_only_then():
    car, dt, _, _, speed, _ = CASES["clutch"]
    values = {"vehicle.m": 1234.0, "drive_shafts.stiffness": 9000.0}
    given, times = {"engine_torque": 200.0, "clutch_capacity": 300.0}, np.arange(201) * dt
    system, _, expected = of_the_package(car.replace(values), dt, times, given, speed)
    unit = Importer(exported(car, dt=dt, initial_speed=speed, parameters=list(values)), "3.0", values | given)
    assert unit.step(0.0, times[-1]) == 0, unit.messages
    names = ["engine_speed", "vehicle_speed", "drive_shafts_torque"]
    np.testing.assert_allclose(unit.get(*names), expected[[system.find_output(name) for name in names], -1], rtol=1e-9)
    assert unit.set({"vehicle.m": 1000.0}) == ERROR
    assert "before the initialization has ended" in unit.messages[-1]
    unit.call("Reset")
    with pytest.raises(AssertionError):
        unit.begin({"vehicle.m": -1.0})
    assert "permitted: finite and > 0" in unit.messages[-1]
    unit.free()


@in_c
def test_derivatives_of_inputs_make_straight_lines():
    car, dt, _, _, speed, _ = CASES["linear"]
    times = np.arange(101) * dt
    system, _, expected = of_the_package(car, dt, times, {"engine_torque": 10.0 + 500.0 * times}, speed, "linear")
    unit = Importer(exported(car, "2.0", dt=dt, initial_speed=speed), "2.0", {"engine_torque": 10.0})
    reference, order, slope = ctypes.c_uint(unit.references["engine_torque"]), ctypes.c_int(1), ctypes.c_double(500.0)
    of, order, slope = map(ctypes.byref, (reference, order, slope))
    assert unit.call("SetRealInputDerivatives", of, ctypes.c_size_t(1), order, slope) == 0
    assert unit.step(0.0, times[-1]) == 0
    names = ["engine_speed", "vehicle_speed"]
    np.testing.assert_allclose(unit.get(*names), expected[[system.find_output(name) for name in names], -1], rtol=1e-12)
    assert unit.get("engine_torque") == [60.0]
    # the next step holds what was reached
    assert unit.step(times[-1], dt) == 0
    assert unit.get("engine_torque") == [60.0]
    unit.free()


@in_c
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_what_is_refused_is_told_and_changes_nothing(version):
    unit = Importer(sliding_bodies(version), version)
    assert unit.step(0.0, 0.1) == 0
    before = unit.get("a_speed", "b_speed", "time")
    for wrong, length, message in (
        ({"clutch_capacity": -1.0}, 0.1, "a capacity is negative"),
        ({"clutch_capacity": np.nan}, 0.1, "an input is not finite"),
        ({"clutch_capacity": 47.0}, -0.1, "the length of a step is not >= 0"),
    ):
        unit.set(wrong)
        assert unit.step(0.1, length) == ERROR
        assert message in unit.messages[-1]
    np.testing.assert_array_equal(unit.get("a_speed", "b_speed", "time"), before)
    assert unit.set({"a_speed": 1.0}) == ERROR
    assert "only inputs and parameters" in unit.messages[-1]
    unit.free()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_variables_are_inputs_and_outputs_of_nonlinear_system_with_units(version):
    car = gearbox()
    _, found = described(exported(car, version, systems=(), parameters=["vehicle.m"]))
    system = pt.nonlinear_system(car, dt=0.001)
    for kind, labels in (("input", system.input_labels), ("output", system.output_labels)):
        assert [name for name, each in found.items() if each.get("causality") == kind] == labels
    told = {name: {**each.attrib, **(each[0].attrib if len(each) else {})} for name, each in found.items()}
    assert told["b1_capacity"]["start"] == "900.0"
    assert (told["vehicle.m"]["start"], told["vehicle.m"]["unit"]) == ("1800.0", "kg")
    units = {name: told[name]["unit"] for name in ("vehicle_speed", "engine_speed", "shaft_torque", "vehicle_force")}
    assert units == {"vehicle_speed": "m/s", "engine_speed": "rad/s", "shaft_torque": "N m", "vehicle_force": "N"}


def test_the_same_car_gives_the_same_bytes():
    first, again = (exported(gearbox(), systems=()).read_bytes() for _ in range(2))
    assert first == again
    assert first != exported(gearbox(), systems=(), hold="linear").read_bytes()


@pytest.mark.parametrize("version", ["2.0", "3.0"])
@pytest.mark.parametrize("case", ["linear", "clutch", "four clutches", "backlash"])
@in_c
def test_fmpy_finds_no_problem_and_simulates_the_same(case, version):
    fmpy = pytest.importorskip("fmpy")
    validation = pytest.importorskip("fmpy.validation")
    car, dt, count, inputs, speed, permitted = CASES[case]
    file, times = exported(car, version, dt=dt, initial_speed=speed), np.arange(count) * dt
    assert validation.validate_fmu(str(file)) == []
    system, u, expected = of_the_package(car, dt, times, inputs, speed)
    names = [name for name in system.output_labels if name.endswith("_speed")]
    given = np.rec.fromarrays([times, *u], names=["time", *system.input_labels])
    shown = fmpy.simulate_fmu(str(file), stop_time=times[-1], output_interval=dt, input=given, output=names)
    assert len(shown) == count
    for name in names:
        assert np.abs(shown[name] - expected[system.find_output(name)]).max() <= permitted, name


WRONG = {
    "version": ({"version": "1.0"}, "version = '1.0'"),
    "hold": ({"hold": "cubic"}, "hold"),
    "name": ({"name": "2fast"}, "permitted: a C identifier"),
    "step": ({"dt": -1.0}, "dt = -1.0 s"),
    "system": ({"systems": ["beos"]}, "permitted in FMI 3.0: linux, windows, macos, macos_arm, linux_arm"),
    "parameter": ({"parameters": ["b1.static_ratio"]}, "b1.static_ratio cannot be a parameter in C"),
    "speed": ({"initial_speed": {"engin": 1.0}}, 'did you mean "engine"'),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_exported_writes_nothing(case, tmp_path):
    options, message = WRONG[case]
    with pytest.raises(pt.PowertrainError) as caught:
        pt.export.fmu(gearbox(), tmp_path / "car.fmu", **{"systems": (), **options})
    assert message in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_model_that_switches_is_no_fmu(tmp_path):
    with pytest.raises(pt.PowertrainError, match="switches"):
        pt.export.fmu(switching(), tmp_path / "car.fmu", systems=())
    assert not list(tmp_path.iterdir())


def test_a_path_that_cannot_be_written_is_told(tmp_path):
    for path, message in ((tmp_path / "no" / "car.fmu", "cannot be written"), (tmp_path / "car.zip", "ends in .fmu")):
        with pytest.raises(pt.PowertrainError, match=message):
            pt.export.fmu(gearbox(), path, systems=())
    assert not list(tmp_path.iterdir())


def test_without_a_compiler_there_are_the_sources_only(tmp_path, monkeypatch):
    monkeypatch.setattr(compilers, "found_compilers", dict)
    pt.export.fmu(gearbox(), tmp_path / "car.fmu")
    assert not [name for name in zipfile.ZipFile(tmp_path / "car.fmu").namelist() if name.startswith("binaries")]
    with pytest.raises(pt.PowertrainError, match="pip install ziglang"):
        pt.export.fmu(gearbox(), tmp_path / "other.fmu", systems=["windows"])
    assert [file.name for file in tmp_path.iterdir()] == ["car.fmu"]


def test_a_compiler_that_fails_leaves_the_old_file_as_it_was(tmp_path, monkeypatch):
    file = tmp_path / "car.fmu"
    file.write_bytes(b"old")
    for command, message in ((["false"], "the compiler for linux fails"), (["no such"], "cannot be run")):
        monkeypatch.setattr(compilers, "found_compilers", lambda command=command: {"linux": command})
        with pytest.raises(pt.PowertrainError, match=message):
            pt.export.fmu(gearbox(), file)
    assert file.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [file]


def test_ziglang_makes_libraries_for_all_systems(monkeypatch):
    monkeypatch.setattr(compilers.importlib.util, "find_spec", lambda name: name == "ziglang" or None)
    commands = compilers.found_compilers()
    assert set(commands) == {target.name for target in compilers.TARGETS}
    assert commands["windows"][1:] == ["-m", "ziglang", "cc", "-target", "x86_64-windows-gnu"]
