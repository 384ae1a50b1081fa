"""Systems, models and responses in MAT and JSON files, and drivelines of openTorsion.

Of driveline/opentorsion, export/plain, export/files and base/signal_units too.
"""

import json
import os

import control
import numpy as np
import pytest
import scipy.io

import powertrain_ctrl as pt

CAR, OPEN = pt.examples.conventional(), pt.examples.conventional(damping="open")
PLANT = pt.SampledPlant(car=CAR)
MODEL = pt.two_mass(CAR)
rng = np.random.default_rng(5)


def odd(*shape):
    """Numbers of all sizes, with their last bits, and zeros with a sign."""
    values = rng.normal(size=shape) * 10.0 ** rng.integers(-300, 300, size=shape)
    values.flat[0] = -0.0
    return values


def play():
    car = pt.Driveline(
        pt.Inertia("a", J=0.3),
        pt.Inertia("b", J=2.0),
        pt.Backlash("mesh", "a", "b", gap=0.02, stiffness=5e3, damping=3.0),
    )
    return pt.simulate(
        car, np.linspace(0.0, 1.0, 50), {"a_torque": np.linspace(20.0, -20.0, 50)}, initial_load={"a_torque": 20.0}
    )


def measured(folder):
    (folder / "run.csv").write_text("t;T;n\n0;1;2\n0,01;;3\n0,02;2;1e-300\n0,03;4;5\n")
    return pt.read_run(folder / "run.csv", time="t", engine_torque="T", engine_speed="n")


SYSTEMS = {
    "driveline": lambda: pt.state_space(CAR),
    "two_masses": lambda: pt.state_space(MODEL),
    "controller": lambda: pt.antijerk.designs(PLANT)["two degrees of freedom"],
    "discrete": lambda: PLANT.discrete(),
    "odd": lambda: control.ss(odd(3, 3), odd(3, 2), odd(1, 3), odd(1, 2), 0.01, inputs=["u", "größe"], outputs=["y"]),
    "gain": lambda: control.ss([], [], [], [[1.0, 2.0]], 0.01, inputs=["a", "b"]),
    "one_number": lambda: control.ss(-1.0, 2.0, 3.0, 0.0),
    "without_time": lambda: control.ss(-0.5, 2.0, 3.0, 0.0, True),
    "any_time": lambda: control.ss(-0.5, 2.0, 3.0, 0.0, None),
}
MODELS = {
    "model": lambda: MODEL,
    "without_vehicle": lambda: MODEL.replace(radius=None, rim_share=0.0, shaft="Welle_größer"),
    "switched": lambda: pt.SwitchedTwoMass(
        closed=pt.two_mass(CAR, method="source"),
        slipping=pt.two_mass(OPEN.release("clutch"), method="source"),
        max_torque=370.0,
    ),
}
RESPONSES = {
    "launch": lambda: pt.launch(OPEN),
    "quiet": lambda: pt.load_change(MODEL),
    "play": play,
    "loop": lambda: pt.tip_in(PLANT),
}
DATA = {
    "data": lambda: pt.load_change(CAR).to_control(["engine_speed"]),
    "step": lambda: control.step_response(pt.state_space(CAR, "engine_torque", "engine_speed"), np.linspace(0, 1, 11)),
    "alone": lambda: control.TimeResponseData(np.arange(3.0), np.arange(3.0), issiso=True),
}
WAYS = {".mat": pt.export.mat, ".json": pt.export.json}
both = pytest.mark.parametrize("suffix", WAYS)


def there_and_back(folder, suffix, **things):
    WAYS[suffix](things, folder / f"file{suffix}")
    found = pt.export.load(folder / f"file{suffix}")
    assert list(found) == list(things)
    return [found[name] for name in things]


def same_bits(one, other):
    one, other = np.asarray(one), np.asarray(other)
    assert one.shape == other.shape
    assert one.dtype == other.dtype == float
    np.testing.assert_array_equal(one.view(np.int64), other.view(np.int64))


@both
@pytest.mark.parametrize("name", SYSTEMS)
def test_systems_come_back_to_the_last_bit_with_all_their_names(tmp_path, suffix, name):
    system = SYSTEMS[name]()
    (found,) = there_and_back(tmp_path, suffix, **{name: system})
    for letter in "ABCD":
        same_bits(getattr(found, letter), getattr(system, letter))
    for names in ("input_labels", "output_labels", "state_labels", "name", "dt"):
        assert getattr(found, names) == getattr(system, names)


@both
@pytest.mark.parametrize("name", MODELS)
def test_two_mass_models_come_back_equal(tmp_path, suffix, name):
    model = MODELS[name]()
    (found,) = there_and_back(tmp_path, suffix, **{name: model})
    assert found == model


@both
@pytest.mark.parametrize("name", RESPONSES)
def test_responses_come_back_to_the_last_bit_and_go_on(tmp_path, suffix, name):
    response = RESPONSES[name]()
    (found,) = there_and_back(tmp_path, suffix, response=response)
    assert type(found) is pt.Response
    same_bits(found.time, response.time)
    for signal in (*response.inputs, *response.outputs):
        same_bits(found[signal], response[signal])
    for each in ("inputs", "outputs", "events", "slip_energy", "title", "modes"):
        assert getattr(found, each) == getattr(response, each)
    for each in ("time", "twist", "speed", "mode"):
        assert getattr(found.final, each) == getattr(response.final, each)


@both
def test_a_run_goes_on_from_the_state_of_a_response_that_was_stored(tmp_path, suffix):
    first = pt.simulate(CAR, [0.0, 0.5], {"engine_torque": 100.0})
    (found,) = there_and_back(tmp_path, suffix, first=first)
    later = [
        pt.simulate(CAR, [0.5, 1.0], {"engine_torque": 100.0}, initial_state=each.final) for each in (first, found)
    ]
    same_bits(later[0]["engine_speed"], later[1]["engine_speed"])


@both
def test_a_measured_run_comes_back_with_what_it_lacks(tmp_path, suffix):
    run = measured(tmp_path)
    (found,) = there_and_back(tmp_path, suffix, run=run)
    assert isinstance(found, pt.MeasuredRun)
    same_bits(found["engine_torque"], run["engine_torque"])
    same_bits(found["engine_speed"], run["engine_speed"])
    assert (found.title, found.gaps) == (run.title, run.gaps)


@both
@pytest.mark.parametrize("name", DATA)
def test_responses_of_control_come_back_to_the_last_bit(tmp_path, suffix, name):
    data = DATA[name]()
    (found,) = there_and_back(tmp_path, suffix, data=data)
    for each in ("t", "y", "u", "x"):
        mine, other = getattr(found, each), getattr(data, each)
        assert (mine is None) == (other is None)
        if mine is not None:
            same_bits(mine, other)
    for each in ("input_labels", "output_labels", "issiso", "title"):
        assert getattr(found, each) == getattr(data, each)


@both
def test_a_plant_is_written_as_its_discrete_model(tmp_path, suffix):
    (found,) = there_and_back(tmp_path, suffix, plant=PLANT)
    same_bits(found.A, PLANT.discrete().A)
    assert found.dt == PLANT.dt


def test_a_mat_file_has_what_matlab_needs(tmp_path):
    """The structure as MATLAB reads it: cells of names in columns, units, the sample time."""
    outputs = ["engine_speed", "vehicle_speed", "vehicle_acceleration", "drive_shafts_torque"]
    pt.export.mat(
        {"G": pt.state_space(CAR, ["engine_torque", "vehicle_force"], outputs), "m": MODEL}, tmp_path / "x.mat"
    )
    found = scipy.io.loadmat(tmp_path / "x.mat")
    G = found["G"][0, 0]
    assert G["InputName"].shape == (2, 1)
    assert [str(cell[0]) for cell in G["InputName"][:, 0]] == ["engine_torque", "vehicle_force"]
    assert [str(cell[0]) for cell in G["InputUnit"][:, 0]] == ["N m", "N"]
    assert [str(cell[0]) for cell in G["OutputUnit"][:, 0]] == ["rad/s", "m/s", "m/s^2", "N m"]
    assert [str(cell[0]) for cell in G["StateUnit"][:2, 0]] == ["rad", "rad"]
    assert G["Ts"].item() == 0.0
    assert found["m"][0, 0]["Unit"][0, 0]["stiffness"].item() == "N m/rad"


def test_structures_that_matlab_has_written_are_systems(tmp_path):
    names = np.array([["torque_demand"], ["engine_speed"]], dtype=object)
    plain = {"A": [[0.5, 0.1], [0.0, 0.2]], "B": np.eye(2), "C": [[1.0, 2.0]], "D": [[0.0, 0.0]], "Ts": 0.01}
    scipy.io.savemat(
        tmp_path / "c.mat",
        {
            "K": {**plain, "InputName": names, "OutputName": np.array([["torque_command"]], dtype=object)},
            "P": {k: plain[k] for k in "ABCD"},
        },
    )
    found = pt.export.load(tmp_path / "c.mat")
    assert (found["K"].dt, found["K"].input_labels, found["K"].output_labels) == (
        0.01,
        ["torque_demand", "engine_speed"],
        ["torque_command"],
    )
    assert found["P"].dt == 0
    same_bits(found["K"].A, plain["A"])


def test_json_is_what_every_reader_takes(tmp_path):
    pt.export.json({"run": measured(tmp_path), "model": MODEL}, tmp_path / "x.json")
    text = (tmp_path / "x.json").read_text()
    assert "NaN" not in text
    content = json.loads(text)["systems"]
    assert content["model"]["stiffness"] == MODEL.stiffness
    assert content["model"]["Unit"]["J1"] == "kg m^2"
    assert content["run"]["OutputUnit"] == ["rad/s"]
    assert content["run"]["Data"] == {"shape": [4, 2], "values": [1.0, 2.0, None, 3.0, 2.0, 1e-300, 4.0, 5.0]}


@both
def test_a_path_that_cannot_be_written_is_refused_and_nothing_is_left(tmp_path, suffix):
    for path in (tmp_path / "no" / f"x{suffix}", tmp_path):
        with pytest.raises(pt.FileError, match="cannot be written"):
            WAYS[suffix]({"m": MODEL}, path)
    assert os.listdir(tmp_path) == []


@both
def test_what_cannot_be_written_leaves_the_old_file(tmp_path, suffix):
    file = tmp_path / f"x{suffix}"
    file.write_text("kept")
    for wrong in (pt.nonlinear_system(CAR), control.tf([1.0], [1.0, 1.0]), CAR, 3.0, None):
        with pytest.raises(pt.PowertrainError, match=r'"other" is a .*permitted: a control.StateSpace'):
            WAYS[suffix]({"m": MODEL, "other": wrong}, file)
    for nothing in ({}, {"": MODEL}):
        with pytest.raises(pt.PowertrainError, match="systems"):
            WAYS[suffix](nothing, file)
    assert file.read_text() == "kept"
    assert os.listdir(tmp_path) == [file.name]


@pytest.mark.parametrize("name", ["_x", "größe", "end", "x" * 64, "a b", "1st"])
def test_names_that_matlab_does_not_take_are_refused(tmp_path, name):
    with pytest.raises(pt.FileError, match="is no name for MATLAB"):
        pt.export.mat({name: MODEL}, tmp_path / "x.mat")
    assert os.listdir(tmp_path) == []


def test_files_that_are_no_such_files_are_refused(tmp_path):
    (tmp_path / "x.mat").write_bytes(b"no")
    (tmp_path / "x.json").write_text("{")
    (tmp_path / "other.json").write_text('{"a": 1}')
    (tmp_path / "list.json").write_text("[" * 100_000)
    (tmp_path / "x.csv").write_text("")
    scipy.io.savemat(tmp_path / "number.mat", {"x": 1.0})
    scipy.io.savemat(tmp_path / "half.mat", {"x": {"A": np.eye(2), "B": np.eye(2)}})
    pt.export.json({"m": MODEL}, tmp_path / "m.json")
    for old, new in (
        ('"J1"', '"J9"'),
        ('"two-mass model"', '"three-mass model"'),
        ('"stiffness": ', '"stiffness": -'),
        ('"J1": ', '"J1": "a", "J3": '),
    ):
        (tmp_path / f"{new.strip(chr(34) + ': -,a')[:5]}.json").write_text(
            (tmp_path / "m.json").read_text().replace(old, new)
        )
    (tmp_path / "m.json").unlink()
    (tmp_path / "folder.json").mkdir()
    for file in [*sorted(tmp_path.iterdir()), tmp_path / "missing.mat", tmp_path / "missing.json"]:
        with pytest.raises(pt.FileError):
            pt.export.load(file)


# ------------------------------------------------------------------------------------------------ openTorsion


def disk(name, J, damping=0.0):
    return {"name": name, "type": "Disk", "inertia": J, "damping": damping}


def shaft(name, k, damping=0.0):
    return {"name": name, "type": "ShaftDiscrete", "stiffness": k, "damping": damping}


def gear(name, J, teeth, **more):
    return {"name": name, "type": "GearElement", "inertia": J, "teeth": teeth, **more}


def tors():
    bar = {"name": "output", "type": "ShaftContinuous", "length": 800.0, "outerDiameter": 70.0, "innerDiameter": 20.0}
    return {
        "components": [
            {"name": "motor", "elements": [disk("rotor", 0.1, 0.2), shaft("stub", 5e3, 1.0), disk("coupling", 0.02)]},
            {
                "name": "box",
                "elements": [
                    shaft("input", 9e3),
                    gear("pinion", 0.004, 20),
                    gear("wheel", 0.06, 61, parent="pinion"),
                    bar,
                ],
            },
            {"name": "load", "elements": [disk("drum", 2.5, 1.0)]},
        ],
        "structure": [["motor.coupling", "box.input"], ["box.output", "load.drum"]],
    }


def test_a_driveline_of_opentorsion_has_its_matrices(tmp_path):
    """M, K, C that openTorsion 0.3.2 assembles from this file."""
    (tmp_path / "car.json").write_text(json.dumps(tors()))
    car = pt.load(tmp_path / "car.json")
    model = pt.assemble(car)
    M = [
        [0.1, 0, 0, 0],
        [0, 0.02, 0, 0],
        [0, 0, 0.010986845720957567, -0.0008188741506897989],
        [0, 0, -0.0008188741506897989, 2.5049951323192077],
    ]
    K = [
        [5000, -5000, 0, 0],
        [-5000, 14000, -9000, 0],
        [0, -9000, 34170.31200890774, 76769.45162716863],
        [0, 0, 76769.45162716863, 234146.82746286434],
    ]
    C = [[1.2, -1, 0, 0], [-1, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1]]
    np.testing.assert_allclose(model.M, M, rtol=1e-14)
    np.testing.assert_allclose(model.K, K, rtol=1e-14)
    np.testing.assert_allclose(model.D, C, rtol=1e-14)
    assert [e.name for e in car if e.nodes != (e.name,)] == [
        "motor_stub",
        "box_input",
        "box_wheel",
        "box_output",
        "drag_0",
        "drag_4",
    ]


def changed(**parts):
    data = tors()
    data.update(parts)
    return data


WRONG = {
    "not JSON": ("{", "not JSON"),
    "something else": (json.dumps({"a": 1}), 'with "components" and "structure"'),
    "an element that is not known": (
        json.dumps(changed(components=[{"name": "a", "elements": [{"name": "b", "type": "Belt"}]}], structure=[])),
        'a_b: type "Belt" is not known, permitted: Disk',
    ),
    "a value that is missing": (
        json.dumps(
            changed(components=[{"name": "a", "elements": [{"name": "b", "type": "ShaftDiscrete"}]}], structure=[])
        ),
        "stiffness",
    ),
    "a value that is not permitted": (
        json.dumps(
            changed(
                components=[{"name": "a", "elements": [disk("r", 1.0), shaft("b", -5.0), disk("l", 1.0)]}], structure=[]
            )
        ),
        "a_b: stiffness = -5.0 N m/rad",
    ),
    "a connection to nowhere": (
        json.dumps(changed(structure=[["motor.coupling", "bux.input"]])),
        '"bux" is not there; did you mean "box"',
    ),
    "two drivelines": (
        json.dumps(changed(structure=[["motor.coupling", "box.input"]])),
        "2 components to which nothing leads",
    ),
    "a circle": (
        json.dumps(
            changed(
                structure=[["motor.coupling", "box.input"], ["box.output", "load.drum"], ["load.drum", "motor.rotor"]]
            )
        ),
        "0 components",
    ),
    "a parent that is none": (
        json.dumps(changed(components=[{"name": "a", "elements": [gear("b", 1.0, 20, parent="c")]}], structure=[])),
        'parent "c" is no gear of this component',
    ),
    "no inertia": (
        json.dumps(changed(components=[{"name": "a", "elements": [shaft("b", 5.0)]}], structure=[])),
        "needs at least one Inertia",
    ),
}


@pytest.mark.parametrize("what", WRONG)
def test_a_file_of_opentorsion_with_a_fault_is_refused_by_name(tmp_path, what):
    text, message = WRONG[what]
    (tmp_path / "car.json").write_text(text)
    with pytest.raises(pt.FileError, match=r"car\.json: ") as caught:
        pt.load(tmp_path / "car.json")
    assert message in str(caught.value)
