"""Frequency responses and forced responses against arithmetic of many digits, closed forms and published cases.

Of linear/leaves and linear/oscillator too.
"""

import json
import os
import random
from pathlib import Path

import mpmath as mp
import numpy as np
import pytest
from exact import Exact, driveline, massless

import powertrain_ctrl as pt

# More of them for a campaign: POWERTRAIN_CASES=200
CASES = int(os.environ.get("POWERTRAIN_CASES", 30))
REFERENCE = json.loads((Path(__file__).parent / "reference" / "breadth_cases.json").read_text())["cases"]
CASE = {case["name"]: case for case in REFERENCE}


@pytest.fixture(autouse=True)
def _digits():
    with mp.workdps(40):
        yield


def errors(car, load, frequencies):
    """Of every output at every frequency: error, its exact size, the largest of its kind."""
    outputs = list(pt.forced_response(car, [1.0], {load: 1.0}).outputs)
    response, exact = pt.frequency_response(car, frequencies, load, outputs), Exact(car)
    for f, omega in enumerate(frequencies):
        wanted, largest = exact.response(mp.mpc(0, omega), load.rpartition("_")[0]), {}
        for name, value in wanted.items():
            kind = name.rpartition("_")[2]
            largest[kind] = max(largest.get(kind, 0.0), abs(value))
        for i, name in enumerate(outputs):
            if name in wanted:
                error = abs(mp.mpc(complex(response.frdata[i, 0, f])) - wanted[name])
                yield name, error, abs(wanted[name]), largest[name.rpartition("_")[2]]


def two_discs(**spring):
    shaft = pt.SpringDamper("shaft", "a", "b", **spring)
    return pt.Driveline(pt.Inertia("a", J=0.3), pt.Inertia("b", J=1.7), shaft)


@pytest.mark.parametrize("load", ["engine_torque", "vehicle_force"])
def test_every_signal_of_the_source_s_car_has_fifteen_digits_from_a_hundredth_to_a_hundred_thousand(load):
    frequencies = [0.01, 1.0, 16.6, 132.0, 1185.6, 4440.0, 6690.0, 31416.0, 1.2e5]
    for name, error, size, _ in errors(pt.examples.conventional(), load, frequencies):
        assert error <= 1e-14 * size, name


@pytest.mark.parametrize("kind", [driveline, massless])
def test_any_driveline_is_right_to_fourteen_digits_of_the_largest_amplitude(kind):
    for seed in range(CASES if kind is driveline else CASES // 2):
        car = kind(seed)
        try:
            inputs = pt.assemble(car).inputs
        except pt.TopologyError:
            continue  # gears in a loop that hold each other
        frequencies = 10.0 ** np.random.default_rng(seed).uniform(-2.5, 4.0, 20 if CASES > 100 else 3)
        for name, error, size, largest in errors(car, random.Random(seed).choice(inputs), frequencies):
            # some of those in several loops are solved as matrices, far below their resonances
            bound = 1e-13 if kind is driveline else 1e-10
            assert error <= 1e-12 * size + bound * largest + mp.mpf(10) ** -30, (seed, name)


class Tree:
    """A random tree of inertias and geared springs, half of them undamped, solved with many digits as one matrix."""

    def __init__(self, seed, count=7):
        rng = random.Random(seed)
        self.J = [10.0 ** rng.uniform(-3, 3) for _ in range(count)]
        self.springs = [
            (rng.randrange(b), b, rng.choice([1.0, -2.5, rng.uniform(0.3, 12.0)]), 10.0 ** rng.uniform(2, 7), d)
            for b in range(1, count)
            for d in [rng.choice([0.0, 10.0 ** rng.uniform(-2, 2)])]
        ]
        self.car = pt.Driveline(
            *(pt.Inertia(f"J{i}", J=J) for i, J in enumerate(self.J)),
            *(
                pt.Compliance(f"s{b}", {f"J{a}": 1.0, f"J{b}": -ratio}, stiffness=k, damping=d)
                for a, b, ratio, k, d in self.springs
            ),
        )
        self.load = rng.randrange(count)
        self.outputs = [*(f"J{i}_angle" for i in range(count)), *(f"s{b}_twist" for _, b, *_ in self.springs)]

    def response(self, omega):
        """Amplitudes (outputs, N) as the package computes them."""
        return pt.frequency_response(self.car, omega, f"J{self.load}_torque", self.outputs).frdata[:, 0]

    def exact(self, omega):
        """Of each output its amplitude, and by how much of it it changes for a change of all values by one part in one.

        The latter is the sum of ``|d ln x / d ln p|`` over inertias, stiffnesses, dampings, ratios and the frequency; with
        ``A x = b`` and ``A^T y = c`` a change dA changes ``c^T x`` by ``-y^T dA x``.
        """
        s, omega = mp.mpc(0, omega), mp.mpf(omega)
        A = mp.diag([-(omega**2) * mp.mpf(J) for J in self.J])
        impedances = [mp.mpf(k) + s * mp.mpf(d) for *_, k, d in self.springs]
        for (a, b, ratio, *_), z in zip(self.springs, impedances, strict=True):
            for i, f in ((a, 1), (b, -mp.mpf(ratio))):
                for j, g in ((a, 1), (b, -mp.mpf(ratio))):
                    A[i, j] += f * g * z
        X = A**-1
        taken = [X[:, i] for i in range(len(self.J))] + [X[:, a] - mp.mpf(r) * X[:, b] for a, b, r, *_ in self.springs]
        x = X[:, self.load]
        for place, y in enumerate(taken):
            by_omega, changes = mp.mpf(0), []
            for i, J in enumerate(self.J):
                changes.append(y[i] * x[i] * omega**2 * mp.mpf(J))
                by_omega += 2 * changes[-1]
            for (a, b, ratio, k, d), z in zip(self.springs, impedances, strict=True):
                r = mp.mpf(ratio)
                twist, pull = x[a] - r * x[b], y[a] - r * y[b]
                changes += [-pull * twist * k, -pull * twist * s * mp.mpf(d)]
                by_omega += changes[-1]
                by_ratio = z * r * (y[b] * twist + pull * x[b])
                if place == len(self.J) + b - 1:  # the twist is of the ratio besides
                    by_ratio -= r * x[b]
                changes.append(by_ratio)
            yield y[self.load], (sum(map(abs, changes)) + abs(by_omega)) / abs(y[self.load])


def test_every_amplitude_of_a_tree_is_right_to_a_few_roundings_of_the_values_that_it_hangs_on():
    """To 1e-12 of itself, that is, but about an antiresonance, which moves with the last digits of every value."""
    met = set()
    for seed in range(max(2, CASES // 12)):
        tree, grid = Tree(seed), np.geomspace(0.01, 1e4, 4000)
        size = np.abs(tree.response(grid))
        j, k = np.nonzero((size[:, 1:-1] < size[:, :-2]) & (size[:, 1:-1] < size[:, 2:]))
        frequencies = [*10.0 ** np.random.default_rng(seed).uniform(-2.5, 4.0, 4)]
        for place, low, high in list(zip(j, grid[k], grid[k + 2], strict=True))[:: max(1, len(j) // 6)]:
            near = np.linspace(low, high, 4001)
            frequencies.append(near[np.abs(tree.response(near)[place]).argmin()])
        found = tree.response(frequencies)
        for f, omega in enumerate(map(float, frequencies)):
            for name, value, (expected, hanging) in zip(tree.outputs, found[:, f], tree.exact(omega), strict=True):
                error = abs(mp.mpc(complex(value)) - expected) / abs(expected)
                assert error <= 4.0 * np.finfo(float).eps * hanging, (seed, name, omega)
                met.add(error > 1e-12)
    assert met == {True, False}


def test_loss_factors_and_parallel_springs_are_right_too():
    car = pt.Driveline(
        *(pt.Inertia(name, J=J) for name, J in {"a": 0.2, "b": 0.05, "c": 1.0}.items()),
        pt.SpringDamper("one", "a", "b", stiffness=900.0, loss_factor=0.05),
        pt.SpringDamper("two", "a", "b", stiffness=300.0, damping=0.4, loss_factor=0.2),
        pt.Gear("gear", "b", "shaft", ratio=-2.5),
        pt.SpringDamper("three", "shaft", "c", stiffness=5e3),
        pt.SpringDamper("four", "a", "c", stiffness=40.0, loss_factor=0.01),
        pt.Drag("mount", "c", damping=0.0, stiffness=10.0),
    )
    for name, error, size, largest in errors(car, "b_torque", [0.3, 60.0, 77.0, 150.0, 2e3]):
        assert error <= 1e-13 * size + 1e-14 * largest, name


def test_two_discs_agree_with_the_reference_rows():
    case = CASE["two_mass_forced"]
    car = two_discs(stiffness=case["stiffness"], damping=case["damping"])
    omega = [row["omega"] for row in case["rows"]]
    response = pt.forced_response(car, omega, {"a_torque": case["torque_on_first"]})
    for node, column in {"a": "angle1", "b": "angle2"}.items():
        expected = [complex(*row[column]) for row in case["rows"]]
        np.testing.assert_allclose(response[f"{node}_angle"], expected, rtol=case["tolerance"])
    expected = [row["shaft_torque_abs"] for row in case["rows"]]
    np.testing.assert_allclose(response.amplitude("shaft_torque"), expected, rtol=case["tolerance"])


def test_at_resonance_a_loss_factor_limits_the_twist_in_closed_form():
    case = CASE["two_mass_loss_factor"]
    car = two_discs(stiffness=case["stiffness"], loss_factor=case["loss_factor"])
    omega = np.sqrt(900.0 * (1 / 0.3 + 1 / 1.7))
    twist = pt.forced_response(car, [omega], {"a_torque": 50.0}).amplitude("shaft_twist")[0]
    # of 50 N m the inertia behind the shaft takes 1.7 / 2.0, and the loss alone holds it: / (eta k)
    assert twist == pytest.approx(50.0 * 1.7 / 2.0 / (0.02 * 900.0), rel=1e-12)
    assert twist == pytest.approx(case["twist_abs"], rel=1e-12)


def test_a_tuned_undamped_absorber_stills_its_node_and_swings_by_the_torque_over_its_stiffness():
    absorber = pt.SpringDamper("spring", "a", "b", stiffness=400.0)
    car = pt.Driveline(pt.Inertia("a", J=0.3), pt.Inertia("b", J=1.0), absorber)
    response = pt.forced_response(car, [20.0], {"a_torque": 8.0})  # 400 - 1.0 * 20^2 is 0 to the last bit
    assert response.amplitude("a_angle")[0] < 1e-15
    assert response["b_angle"][0] == pytest.approx(-8.0 / 400.0, rel=1e-14)


def test_undamped_branches_that_close_a_loop_are_right_at_their_own_resonances():
    ends = [("a", "b"), ("b", "c"), ("c", "d"), ("d", "a"), ("b", "d")]
    car = pt.Driveline(
        *(pt.Inertia(name, J=1.0) for name in "abcd"),
        *(pt.SpringDamper(f"s{i}", *pair, stiffness=100.0 * (1 + i)) for i, pair in enumerate(ends)),
    )
    # the stiffness of all springs at a node is the inertia times the square of this
    frequencies = [np.sqrt(total) * scale for total in (500.0, 800.0, 1200.0) for scale in (1.0, 1 + 1e-12, 1 - 1e-6)]
    for name, error, _, largest in errors(car, "a_torque", frequencies):
        assert error <= 1e-11 * largest, name


def test_torques_add_up_with_their_phases_and_each_frequency_has_its_own():
    car, omega = pt.examples.conventional(), np.array([5.0, 130.0, 900.0])
    torques = {"engine_torque": np.array([1.0, 2j, -3.0]), "wheels_torque": 4.0 - 1j}
    together = pt.forced_response(car, omega, torques)
    apart = pt.frequency_response(car, omega, list(torques), list(together.outputs)).frdata
    for i, name in enumerate(together.outputs):
        expected = apart[i, 0] * torques["engine_torque"] + apart[i, 1] * torques["wheels_torque"]
        np.testing.assert_allclose(together[name], expected, rtol=1e-11)


def test_behind_an_open_clutch_nothing_moves_and_its_slip_is_the_speed_before_it():
    response = pt.forced_response(pt.examples.conventional().release("clutch"), [30.0], {"engine_torque": 1.0})
    assert response["vehicle_speed"][0] == response["clutch_torque"][0] == response["tyres_torque"][0] == 0.0
    assert response["clutch_slip_speed"][0] == response["clutch_primary_speed"][0] != 0.0


def test_a_locked_clutch_carries_what_its_two_sides_need():
    car = pt.Driveline(pt.Inertia("a", J=1.0), pt.Inertia("b", J=3.0), pt.Clutch("clutch", "a", "b", max_torque=9.0))
    response = pt.forced_response(car, [10.0], {"a_torque": 2.0})
    assert response["clutch_torque"][0] == pytest.approx(1.5, rel=1e-15)
    assert response["clutch_slip_speed"][0] == 0.0


def test_the_frequency_response_is_what_python_control_says_where_that_is_right():
    import control

    car, omega = pt.examples.conventional(), np.geomspace(0.1, 300.0, 30)
    outputs = ["engine_speed", "drive_shafts_torque", "vehicle_acceleration", "clutch_torque"]
    ours = pt.frequency_response(car, omega, ["engine_torque", "vehicle_force"], outputs)
    G = control.frequency_response(pt.state_space(car, ["engine_torque", "vehicle_force"], outputs), omega)
    np.testing.assert_allclose(ours.frdata, G.frdata, rtol=1e-7)
    assert (ours.input_labels, ours.output_labels) == (["engine_torque", "vehicle_force"], outputs)
    assert pt.frequency_response(car, [1.0]).output_labels == pt.state_space(car).output_labels


def test_a_two_mass_model_is_taken_like_any_driveline():
    model = pt.two_mass(pt.examples.conventional())
    response = pt.frequency_response(model, [1e-3], "engine_torque", "vehicle_acceleration")
    assert response.frdata[0, 0, 0] == pytest.approx(
        pt.static_gain(model, "engine_torque", "vehicle_acceleration")[0, 0]
    )


def test_a_result_is_read_only_and_becomes_a_dict_of_lists():
    response = pt.forced_response(two_discs(stiffness=900.0), [10.0, 20.0], {"a_torque": 1.0}, ["shaft_torque"])
    with pytest.raises(ValueError, match="read-only"):
        response["shaft_torque"][0] = 0.0
    written = json.loads(json.dumps(response.to_dict()))
    assert written["omega"] == [10.0, 20.0]
    polar = written["outputs"]["shaft_torque"]
    np.testing.assert_allclose(polar["amplitude"] * np.exp(1j * np.array(polar["phase"])), response["shaft_torque"])
    assert "shaft_torque" in response
    assert "a_speed" not in response
    assert repr(response) == "ForcedResponse: 10 to 20 rad/s, 2 frequencies, 1 outputs"


@pytest.mark.parametrize(
    ("omega", "words"),
    [
        ([0.0, 1.0], r"omega = 0.0 rad/s, permitted: > 0, at most 1e\+15, pt.static_gain gives the response at 0"),
        ([1.0, -2.0], "omega = -2.0 rad/s, permitted: > 0"),
        ([float("nan")], "omega = nan rad/s"),
        ([[1.0, 2.0]], "one-dimensional"),
        ([], "at least one"),
        ("fast", "omega is 'fast', permitted: real numbers"),
    ],
)
def test_a_frequency_that_is_not_positive_is_named(omega, words):
    for respond in (
        lambda car, omega: pt.frequency_response(car, omega, "a_torque", "b_speed"),
        lambda car, omega: pt.forced_response(car, omega, {"a_torque": 1.0}),
    ):
        with pytest.raises(pt.PowertrainError, match=words):
            respond(two_discs(stiffness=900.0), omega)


@pytest.mark.parametrize(
    ("torque", "words"),
    [
        (float("nan"), 'input "a_torque" is nan'),
        ([1.0, 2.0], r'input "a_torque" has shape \(2,\), permitted: \(1,\)'),
        ("much", "input \"a_torque\" is 'much', permitted: complex amplitudes"),
        (None, 'input "a_torque" is None'),
        (1e16, "at most 1e\\+15"),
    ],
)
def test_an_amplitude_that_is_no_number_is_named(torque, words):
    with pytest.raises(pt.SignalError, match=words):
        pt.forced_response(two_discs(stiffness=900.0), [1.0], {"a_torque": torque})


def test_signals_that_are_not_there_are_named():
    car = two_discs(stiffness=900.0)
    with pytest.raises(
        pt.UnknownNameError, match='"a_torqe" is not an input of this driveline; did you mean "a_torque"'
    ):
        pt.forced_response(car, [1.0], {"a_torqe": 1.0})
    with pytest.raises(
        pt.UnknownNameError, match='"a_sped" is not an output of this driveline; did you mean "a_speed"'
    ):
        pt.frequency_response(car, [1.0], "a_torque", "a_sped")
    with pytest.raises(pt.UnknownNameError, match='"b" is not in this response'):
        pt.forced_response(car, [1.0], {"a_torque": 1.0})["b"]
    with pytest.raises(pt.PowertrainError, match="at least one signal"):
        pt.forced_response(car, [1.0], {})


def test_what_computes_over_time_refuses_a_loss_factor_and_says_what_to_take_instead():
    car = two_discs(stiffness=900.0, loss_factor=0.03)
    functions = [pt.state_space, pt.poles, pt.static_gain, pt.assemble, pt.two_mass, pt.load_change]
    functions += [lambda car: pt.simulate(car, [0.0, 1.0])]
    for function in functions:
        with pytest.raises(
            pt.PowertrainError, match=r'shaft: loss_factor = 0.03.*car.replace\("shaft", loss_factor=0, damp'
        ):
            function(car)
    # the same at one frequency
    omega = 50.0
    viscous = car.replace("shaft", loss_factor=0.0, damping=0.03 * 900.0 / omega)
    one, other = (pt.forced_response(each, [omega], {"a_torque": 1.0}, "b_speed")["b_speed"] for each in (car, viscous))
    np.testing.assert_allclose(one, other, rtol=1e-14)


def test_half_a_loss_factor_is_the_damping_ratio_of_a_mode_in_proportion_to_its_strain_energy():
    car = pt.Driveline(
        *(pt.Inertia(name, J=J) for name, J in {"a": 0.2, "b": 0.05, "c": 1.0}.items()),
        pt.SpringDamper("one", "a", "b", stiffness=900.0, loss_factor=0.05, damping=0.1),
        pt.SpringDamper("two", "b", "c", stiffness=400.0, loss_factor=0.2),
    )
    modes, plain = pt.modes(car), pt.modes(car.replace("one", loss_factor=0.0).replace("two", loss_factor=0.0))
    expected = plain.damping_ratio[1:] + 0.5 * np.array([0.05, 0.2]) @ modes.strain_energy[:, 1:]
    np.testing.assert_allclose(modes.damping_ratio[1:], expected, rtol=1e-14)
