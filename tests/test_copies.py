"""Every public object and error can be pickled, copied and sent to another process, fresh or used.

Of base/records, base/systems.
"""

import copy
import dataclasses
import inspect
import pickle
import tempfile
from concurrent.futures import ProcessPoolExecutor
from functools import cached_property
from multiprocessing import get_context
from pathlib import Path

import control
import numpy as np
import pytest

import powertrain_ctrl as pt
from powertrain_ctrl import antijerk, studies
from powertrain_ctrl.base.records import Record
from powertrain_ctrl.base.systems import linear_system
from powertrain_ctrl.elements import Element

CAR = pt.examples.conventional(damping="open")
PLANT = pt.SampledPlant(car=CAR)
CONTROLLER = antijerk.one_dof(PLANT, antijerk.speed_difference(PLANT, gain=6.0))
MODEL = pt.two_mass(CAR, method="source")
SLIPPING = pt.two_mass(CAR.release("clutch"), method="source")
ENGINE = pt.Engine(cylinders=4, firing_order=(1, 3, 4, 2), orders={2.0: 100.0, 4.0: 30j})
READ = {"torque_demand": 100.0, "engine_speed": 2.0, "wheels_speed": 0.1, "torque_limited": 0.0, "ratio": 10.8}
# what is equal where its values are
VALUES = (Element, pt.Driveline, pt.Event, pt.Sensors, pt.TwoMass, pt.SwitchedTwoMass, pt.SampledPlant)


def kept(thing):
    """Names of what it computes once and keeps."""
    static = {name: inspect.getattr_static(type(thing), name) for name in dir(type(thing))}
    return [name for name, member in static.items() if isinstance(member, cached_property)]


def used(thing):
    """The same object after everything that it keeps has been computed."""
    for name in kept(thing):
        getattr(thing, name)
    if isinstance(thing, pt.SampledPlant):
        studies.prove(thing, CONTROLLER)
    return thing


def schedule():
    other = antijerk.one_dof(PLANT, antijerk.speed_difference(PLANT, gain=2.0))
    return antijerk.scheduled({18.0: CONTROLLER, 10.8: other}, dt=0.01)


def on_its_way(controller):
    unit = pt.ControllerStepper(controller, 0.01)
    for ratio in (18.0, 18.0, 10.8):
        unit.step(**{**READ, "ratio": ratio})
    return unit


def loop():
    """Driveline and controller, connected by python-control."""
    unit = control.ss(0.9, 0.1, -5.0, 0.0, 0.01, inputs="wheels_speed", outputs="engine_torque", name="unit")
    system = pt.nonlinear_system(CAR, dt=0.01, hold="zero")
    return control.interconnect(
        [system, unit], inputs=["clutch_capacity"], outputs=["engine_speed"], check_unused=False
    )


def linear_loop():
    first = control.ss(-1.0, 1.0, 1.0, 0.0, inputs="u", outputs="y", name="first")
    second = control.ss(-2.0, 1.0, -3.0, 0.0, inputs="y", outputs="w", name="second")
    total = linear_system([], [], [], [[1.0, 1.0]], inputs=["r", "w"], outputs=["u"], name="total")
    return control.interconnect([total, first, second], inputs="r", outputs="y")


def measured():
    t = np.arange(0.0, 2.0, 0.01)
    run = pt.simulate(MODEL, t, {"engine_torque": np.interp(t, [0.5, 0.6], [0.0, 50.0])})
    folder = Path(tempfile.mkdtemp())
    rows = [f"{a!r},{b!r},{c!r}" for a, b, c in np.transpose([t, run["engine_torque"], run["engine_speed"]]).tolist()]
    (folder / "run.csv").write_text("\n".join(["t,T,n", *rows]))
    return pt.read_run(folder / "run.csv", time="t", engine_torque="T", engine_speed="n")


def identified():
    return pt.identify(MODEL.replace(J1=0.5), measured(), ["J1"])


def with_note(error):
    error.add_note("third gear")
    return error


OBJECTS = {
    "ArgumentError": lambda: pt.ArgumentError("Inertia: not given: J=..."),
    "Backlash": lambda: pt.Backlash("play", "a", "b", gap=0.05, stiffness=5e3, damping=10.0),
    "Clutch": lambda: pt.Clutch("clutch", "a", "b", max_torque=400.0),
    "Compliance": lambda: pt.Compliance("spring", {"a": 1, "b": -2}, stiffness=5.0),
    "Constraint": lambda: pt.Constraint("mesh", {"a": 1, "b": -3, "support": 2}),
    "ControlUnit": lambda: pt.ControlUnit(controllers={18.0: CONTROLLER}, dt=0.01, torque_limits=(0.0, 350.0)),
    "ControllerStepper": lambda: pt.ControllerStepper(CONTROLLER, 0.01),
    "Tuned": lambda: antijerk.tune(PLANT),
    "ControllerStepper on its way": lambda: on_its_way(antijerk.designs(PLANT)["two degrees of freedom"]),
    "ControllerStepper of a schedule on its way": lambda: on_its_way(schedule()),
    "TorqueSplit": lambda: pt.TorqueSplit("split", {"a": 0.6, "b": 0.4}, "both"),
    "Differential": lambda: pt.Differential("differential", "carrier", "left", "right"),
    "DescribedFrequency": lambda: pt.describing_frequency(
        pt.Driveline(
            pt.Inertia("a", J=1.0), pt.Inertia("b", J=1.0), pt.Backlash("play", "a", "b", gap=0.05, stiffness=5e3)
        ),
        1,
        [0.1],
    ),
    "DogClutch": lambda: pt.DogClutch("dog", "a", "b"),
    "Drag": lambda: pt.Drag("bearing", "a", damping=0.1),
    "Driveline": lambda: pt.examples.conventional(damping="open").release("clutch"),
    "Event": lambda: pt.launch(CAR).events[-1],
    "Family": lambda: pt.family(CAR, {"vehicle.m": [1500.0, 2500.0]}),
    "FamilyForcedResponse": lambda: pt.family(CAR, {"vehicle.m": [1500.0]}).frequency_response([1.0], "engine_torque"),
    "FamilyModes": lambda: pt.family(CAR, {"vehicle.m": [1500.0, 2500.0]}).modes(),
    "FamilyResponse": lambda: pt.family(CAR, {"vehicle.m": [1500.0]}).load_change(outputs="vehicle_speed"),
    "CriticalSpeeds": lambda: pt.critical_speeds(CAR, ENGINE, (500.0, 4000.0)),
    "Engine": lambda: ENGINE,
    "Engine with a table": lambda: pt.Engine(
        cylinders=1, bore=0.08, stroke=0.09, rod=0.14, pressure=([0.0, 4.0 * np.pi], [1e5, 1e5])
    ),
    "FileError": lambda: pt.FileError("car.toml: cannot be read"),
    "ForcedResponse": lambda: pt.forced_response(CAR, [1.0, 10.0], {"engine_torque": 1j}),
    "Gear": lambda: pt.Gear("gear", "a", "b", ratio=3.0),
    "Identified": identified,
    "Inertia": lambda: pt.Inertia("engine", J=0.3),
    "LoopMargins": lambda: pt.loop_margins(PLANT, CONTROLLER),
    "Mass": lambda: pt.Mass("vehicle", m=1500.0),
    "MeasuredRun": measured,
    "ModelComparison": lambda: pt.compare_models(CAR, {"modal": pt.two_mass(CAR)}, ramps=0.1),
    "ModelError": lambda: pt.compare_models(CAR, {"modal": pt.two_mass(CAR)}, ramps=0.1)["modal"],
    "Modes": lambda: pt.modes(CAR),
    "ParameterError": lambda: with_note(pt.ParameterError("gear", "ratio", 0.0, "", "not 0")),
    "PiecewiseLinear": lambda: pt.ramp(1.0, 0.2, 250.0) + pt.step(2.0, 10.0),
    "MultiStageSpring": lambda: pt.MultiStageSpring("s", "a", "b", twists=(0.0, 0.1, 0.2), torques=(0.0, 1.0, 9.0)),
    "OrderResponse": lambda: pt.order_response(CAR, ENGINE, [100.0, 200.0], highest_order=3),
    "OneWayClutch": lambda: pt.OneWayClutch("freewheel", "a", "b"),
    "Pendulum": lambda: pt.Pendulum("absorber", "flywheel", J=0.01, order=2.0),
    "Planetary": lambda: pt.Planetary("gears", "sun", "ring", "carrier", ratio=2.0),
    "PowertrainError": lambda: pt.PowertrainError("wrong"),
    "Proof": lambda: studies.prove(PLANT, CONTROLLER),
    "RateMargin": lambda: pt.loop_margins(dataclasses.replace(PLANT, torque_rate=1e3), CONTROLLER).rate,
    "Response": lambda: pt.launch(CAR),
    "Response of a loop": lambda: pt.tip_in(PLANT, CONTROLLER),
    "Response of a controlled launch": lambda: pt.controlled_launch(PLANT, None, end=2.0),
    "RideMetrics": lambda: studies.tip_in_metrics(PLANT, pt.tip_in(PLANT)),
    "RingDown": lambda: pt.ring_down(np.exp(-0.1 * np.arange(40.0)) * np.sin(np.arange(40.0)), 0.01),
    "Robustness": lambda: pt.robustness(PLANT, CONTROLLER, {"nominal": PLANT}),
    "RoadLoad": lambda: pt.RoadLoad("road", "vehicle", constant=150.0, grade=0.02),
    "SampledPlant": lambda: pt.SampledPlant(car=CAR),
    "SampledPlant of a TwoMass": lambda: pt.SampledPlant(car=MODEL),
    "Sensors": lambda: pt.Sensors(engine_noise=0.1, seed=3),
    "SobolIndices": lambda: studies.sobol(
        CAR, {"vehicle.m": 0.1, "wheels.J": 0.1}, lambda cars: cars.natural_frequencies()[:, 1], n=4
    ),
    "Shaft": lambda: pt.Shaft("shaft", "a", "b", stiffness=5e3, inertia=0.1),
    "Signals": lambda: pt.plots.Signals(time=np.array([0.0, 0.5]), values={"engine_speed": np.array([1.0, 2.0])}),
    "SignalError": lambda: pt.SignalError("not finite"),
    "SlipTyre": lambda: pt.SlipTyre("tyre", "wheels", "vehicle", radius=0.3, slip_stiffness=1e5, speed=9.0),
    "SpeedSource": lambda: pt.SpeedSource("motor", "engine"),
    "SpeedCoupling": lambda: pt.SpeedCoupling("coupling", "a", "b", damping=((1.0, -0.5), (-2.0, 0.9))),
    "SpringDamper": lambda: pt.SpringDamper("halfshafts", "a", "b", stiffness=12e3, damping=30.0),
    "State": lambda: pt.launch(CAR).final,
    "SwitchedTwoMass": lambda: pt.SwitchedTwoMass(closed=MODEL, slipping=SLIPPING),
    "TopologyError": lambda: pt.TopologyError("torn apart"),
    "TorsionalModel": lambda: pt.assemble(CAR),
    "Tracked": lambda: pt.order_tracking(np.sin(np.arange(4000.0) ** 2 / 2e4), 0.01, 1.0 + np.arange(4000.0)),
    "TwoMass": lambda: pt.two_mass(CAR),
    "TorqueConverter": lambda: pt.TorqueConverter(
        "converter", "a", "b", speed_ratios=(0.0, 1.0), capacities=(3e-3, 0.0), torque_ratios=(2.0, 1.0)
    ),
    "Tyre": lambda: pt.Tyre("tyre", "wheels", "vehicle", radius=0.3),
    "UnknownNameError": lambda: pt.UnknownNameError("element", "gear_box", ["gearbox"], "in this driveline"),
    # of python-control, as this package gives them
    "Validation": lambda: pt.validate(CAR.lock(), measured()),
    "controller": lambda: CONTROLLER,
    "schedule": schedule,
    "nonlinear_system": lambda: pt.nonlinear_system(CAR),
    "nonlinear_system, discrete": lambda: pt.nonlinear_system(CAR, dt=0.01),
    "nonlinear_system, discrete, switched": lambda: pt.nonlinear_system(
        pt.SwitchedTwoMass(closed=MODEL, slipping=SLIPPING), dt=0.01, hold="zero"
    ),
    "nonlinear_system in a loop": loop,
    "state spaces in a loop": linear_loop,
    "state_space": lambda: pt.state_space(CAR),
    "state_space without states": lambda: linear_system([], [], [], [[1.0, 2.0]], 0.01, inputs=["a", "b"]),
    "reduced": lambda: pt.reduced(CAR, 4, "balanced", "engine_torque", "vehicle_acceleration"),
    "discrete": lambda: PLANT.discrete(),
    "to_control": lambda: pt.load_change(CAR).to_control(["engine_speed"]),
    "frequency response": lambda: pt.frequency_response(CAR, [1.0, 10.0], "engine_torque", "engine_speed"),
}
WAYS = {
    **{
        f"pickle {protocol}": lambda thing, protocol=protocol: pickle.loads(pickle.dumps(thing, protocol))
        for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)
    },
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


def assert_same(copied, original):
    """Equal to the last bit, and what is read-only stays so."""
    assert type(copied) is type(original)
    if isinstance(original, np.ndarray):
        assert (copied.dtype, copied.shape, copied.tobytes()) == (original.dtype, original.shape, original.tobytes())
        assert copied.flags.writeable == original.flags.writeable
    elif isinstance(original, dict):
        assert list(copied) == list(original)
        assert_same(list(copied.values()), list(original.values()))
    elif isinstance(original, tuple | list):
        assert len(copied) == len(original)
        for one, other in zip(copied, original, strict=True):
            assert_same(one, other)
    elif isinstance(original, float):
        assert copied.hex() == original.hex()
    elif isinstance(original, Exception):
        assert (str(copied), copied.args, vars(copied)) == (str(original), original.args, vars(original))
    elif isinstance(original, pt.ControllerStepper):
        assert (copied.time, copied.x.tolist()) == (original.time, original.x.tolist())
        assert copy.copy(copied).step(**READ) == copy.copy(original).step(**READ)
    elif isinstance(original, control.NonlinearIOSystem):
        assert_same_system(copied, original)
    elif isinstance(original, control.TimeResponseData | control.FrequencyResponseData):
        names = ("time", "y", "u") if isinstance(original, control.TimeResponseData) else ("omega", "frdata")
        assert all(np.array_equal(getattr(copied, name), getattr(original, name)) for name in names)
        assert copied.output_labels == original.output_labels
    elif dataclasses.is_dataclass(original):
        for name in [*(item.name for item in dataclasses.fields(original)), *kept(original)]:
            assert_same(getattr(copied, name), getattr(original, name))
    else:
        assert copied == original
    if isinstance(original, VALUES):
        assert (copied, hash(copied)) == (original, hash(original))


def assert_same_system(copied, original):
    names = ("dt", "params", "input_labels", "output_labels", "state_labels", "shape")
    assert [getattr(copied, name) for name in names] == [getattr(original, name) for name in names]
    if isinstance(original, control.StateSpace):
        assert_same([copied.A, copied.B, copied.C, copied.D], [original.A, original.B, original.C, original.D])
    rng = np.random.default_rng(1)
    x, u = np.zeros(original.nstates), 100.0 * rng.random(original.ninputs)
    x[0 : original.nstates // 2] = 0.01 * rng.random(original.nstates // 2)
    for function in ("dynamics", "output"):
        assert_same(getattr(copied, function)(0.0, x, u), getattr(original, function)(0.0, x, u))
    for function in ("updfcn", "outfcn"):  # these simulations call
        assert_same(*(np.array(getattr(each, function)(0.0, x, u, each.params)) for each in (copied, original)))


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", OBJECTS)
def test_a_copy_is_the_same_fresh_or_used(name, way):
    original = OBJECTS[name]()
    fresh = WAYS[way](original)
    assert_same(fresh, used(original))
    assert_same(WAYS[way](original), original)


def test_the_table_has_every_public_class():
    spaces = (pt, pt.antijerk, pt.export, pt.plots, pt.studies, pt.examples)
    public = {name for space in spaces for name in space.__all__ if inspect.isclass(getattr(space, name))}
    assert public <= OBJECTS.keys()


def test_a_worker_takes_and_gives_every_object_and_an_error_arrives_as_itself():
    plant = used(pt.SampledPlant(car=CAR))
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        wrong = pool.submit(pt.Inertia, "engine", J=-1.0)
        unknown = pool.submit(plant.car.__getitem__, "gear_box")
        there_and_back = {name: pool.submit(copy.copy, make()) for name, make in OBJECTS.items()}
        later = pool.submit(pt.tip_in, plant, CONTROLLER)
        with pytest.raises(pt.ParameterError, match=r"engine: J = -1.0 kg m\^2, permitted: > 0 and finite"):
            wrong.result()
        with pytest.raises(pt.UnknownNameError, match='"gear_box" is not in this driveline; did you mean "gearbox"'):
            unknown.result()
        for name, job in there_and_back.items():
            assert_same(job.result(), OBJECTS[name]())
        assert_same(later.result(), pt.tip_in(plant, CONTROLLER))


def test_what_is_kept_is_not_copied():
    for name in ("Driveline", "SampledPlant", "TwoMass", "SwitchedTwoMass", "Modes", "TorsionalModel"):
        thing = OBJECTS[name]()
        before = pickle.dumps(thing)
        hash(used(thing))
        assert pickle.dumps(thing) == before, name


def test_a_stepper_goes_on_from_its_copy_and_leaves_the_original():
    original = on_its_way(schedule())
    copies = [way(original) for way in WAYS.values()]
    wanted = [original.step(**READ) for _ in range(5)]
    assert len(set(wanted)) == 5
    for unit in copies:
        assert [unit.step(**READ) for _ in range(5)] == wanted


@pytest.mark.parametrize("make", [lambda: pt.state_space(CAR), linear_loop])
def test_a_copied_state_space_reads_its_own_matrices(make):
    """python-control's own deep copy reads those of the original."""
    original = make()
    copied = copy.deepcopy(original)
    copied.C = 2.0 * original.C
    x, u = np.ones(original.nstates), np.zeros(original.ninputs)
    once, twice = (control.StateSpace.output(each, 0.0, x, u) for each in (original, copied))
    np.testing.assert_array_equal(copied.outfcn(0.0, x, u, {}), 2.0 * original.C @ x)
    np.testing.assert_array_equal(twice, 2.0 * once)


def test_records_do_not_close_arrays_that_others_hold():
    time, speed = np.array([0.0, 0.5]), np.array([1.0, 2.0])
    signals = pt.plots.Signals(time=time, values={"engine_speed": speed})
    assert time.flags.writeable
    assert speed.flags.writeable
    for array in (signals.time, signals["engine_speed"]):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 3.0


def test_no_array_of_a_record_can_be_written_to():
    records = [thing for thing in (make() for make in OBJECTS.values()) if isinstance(thing, Record)]
    values = [getattr(each, item.name) for each in records for item in dataclasses.fields(each)]
    values += [getattr(each, name) for each in records for name in kept(each)]
    for value in values:  # grows
        values += value.values() if isinstance(value, dict) else ()
    arrays = [value for value in values if isinstance(value, np.ndarray)]
    assert len(arrays) > 40
    assert not any(array.flags.writeable for array in arrays)


@pytest.mark.parametrize("way", WAYS)
def test_a_system_that_was_given_other_names_and_parameters_keeps_them(way):
    system = pt.nonlinear_system(CAR)
    system.name, system.params["stick_time"] = "car", 1e-3
    system.set_inputs([f"u_{label}" for label in system.input_labels])
    copied = WAYS[way](system)
    assert (copied.name, copied.input_labels[0]) == ("car", "u_engine_torque")
    assert_same(copied, system)
