"""Families against loops: over this package as it was, over scipy, python-control and openTorsion."""

import hashlib
import resource
import statistics
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import control
import numpy as np
import scipy.linalg

import powertrain_ctrl as pt
from powertrain_ctrl.families import parts
from powertrain_ctrl.families.chains import chain_frequencies, chain_of
from powertrain_ctrl.families.structure import parts_of

from .baseline import Before, now
from .before import chain

CAR = pt.examples.conventional()
STIFFNESS_AND_INERTIA = ("stiffness", "J", "m")
# Bodies of the chains.
SIZES = (7, 8, 10, 15, 20, 30, 50, 100, 200, 300, 500, 1000)


def around(n, parameters=("J", "m", "stiffness", "damping", "ratio", "radius"), seed=0, car=CAR):
    """Values around those of a car; of the source's 22, ratios and radius among them."""
    random = np.random.default_rng(seed)
    names = [
        f"{element.name}.{name}"
        for element in car
        for name in parameters
        if isinstance(getattr(element, name, None), float) and f"{element.name}.{name}" != "clutch_secondary.J"
    ]
    return {
        name: getattr(car[name.split(".")[0]], name.split(".")[1]) * np.exp(0.1 * random.standard_normal(n))
        for name in names
    }


def cpu(function, repeats=3):
    """Result, and the median of the seconds of CPU."""
    result, seconds = function(), []
    for _ in range(repeats):
        start = time.process_time()
        result = function()
        seconds.append(time.process_time() - start)
    return result, statistics.median(seconds)


def row(name, bar, quick, slow, difference, tolerance):
    """Print a row from seconds for one variant; a difference above its tolerance gives no ratio."""
    if not difference <= tolerance:
        print(f"{name:66s} FAIL: results differ by {difference:.2g}, permitted {tolerance:.2g}")
        return False
    ratio = slow / quick
    met = "met" if ratio >= bar else "MISSED"
    print(
        f"{name:66s} {1e6 * quick:10.2f} us {1e6 * slow:11.1f} us  {ratio:6.3g} times, bar {bar:g}: {met} "
        f"(differ by {difference:.1g})"
    )
    return ratio >= bar


def relative(found, expected):
    """Largest difference over what is expected, of values that are not 0."""
    found, expected = np.asarray(found), np.asarray(expected)
    there = np.isfinite(expected) & (expected != 0.0)
    if not ((found == expected) | there | (np.isnan(found) & np.isnan(expected))).all():
        return np.inf
    return float(np.abs(found[there] / expected[there] - 1.0).max())


def modes(before):
    values = around(10_000)
    found, slow = before.run("modes", values=values, count=60)
    result, quick = cpu(lambda: pt.family(CAR, values).modes())
    difference = max(
        relative(result.omega[:60], found["omega"]), relative(result.damping_ratio[:60], found["damping_ratio"])
    )
    return row(
        "frequencies and damping ratios, 1e4 variants / replace + modes", 200, quick / 1e4, slow, difference, 1e-12
    )


def poles(before):
    values = around(10_000)
    found, slow = before.run("poles", values=values, count=60)
    result, quick = cpu(lambda: pt.family(CAR, values).poles())
    return row(
        "damped poles, 1e4 variants / replace + poles", 90, quick / 1e4, slow, relative(result[:60], found), 1e-10
    )


def frequencies():
    values = around(10_000, STIFFNESS_AND_INERTIA)
    result, quick = cpu(lambda: pt.family(CAR, values).natural_frequencies())
    models = [pt.assemble(pt.family(CAR, values).car(i)) for i in range(300)]
    M, K = np.array([model.M for model in models]), np.array([model.K for model in models])

    def loop():
        return [scipy.linalg.eigh(k, m, eigvals_only=True) for k, m in zip(K, M, strict=True)]

    squares, slow = cpu(loop)
    elastic = np.sqrt(np.array(squares)[:, 1:]) / (2.0 * np.pi)
    # the squares of a stiffness of 1e6 leave eight digits of the slowest mode
    difference = relative(result[:300, 1:], elastic)
    met = [
        row(
            "frequencies from values, 1e4 variants / scipy eigh, matrices ready",
            4,
            quick / 1e4,
            slow / 300,
            difference,
            1e-8,
        )
    ]
    ((_, _, stack),) = parts_of(pt.family(CAR, values)._variants)
    chain_of_car = chain_of(stack)
    (omega, _), quick = cpu(lambda: chain_frequencies(stack, chain_of_car))
    difference = relative(omega[:300, 1:] / (2.0 * np.pi), elastic)
    name = "frequencies of 1e4 variants / scipy eigh, matrices ready on both sides"
    met.append(row(name, 5, quick / 1e4, slow / 300, difference, 1e-8))
    return all(met)


def open_torsion():
    """Rows against openTorsion, where it is installed: a loop over variants, and single chains of all sizes.

    Of a chain both sides begin with values: openTorsion makes its matrices with the assembly, this package in `modes`.
    """
    try:
        import opentorsion as ot
    except ImportError:
        print("openTorsion is not installed: no rows against it")
        return True

    def theirs(J, k):
        shafts = [ot.Shaft(i, i + 1, k=float(value), I=0.0) for i, value in enumerate(k)]
        assembly = ot.Assembly(shafts, disk_elements=[ot.Disk(i, float(value)) for i, value in enumerate(J)])
        return np.sqrt(np.sort(np.abs(assembly.undamped_modal_analysis()[0])))

    values = around(10_000, STIFFNESS_AND_INERTIA)
    family = pt.family(CAR, values)
    result, quick = cpu(lambda: pt.family(CAR, values).natural_frequencies())
    chains = [_as_chain(family.car(i)) for i in range(40)]
    found, slow = cpu(lambda: [theirs(*each) for each in chains])
    difference = relative(2.0 * np.pi * np.asarray(result)[:40, 1:], np.array(found)[:, 1:])
    met = [
        row(
            "frequencies from values, 1e4 variants / loop of openTorsion", 150, quick / 1e4, slow / 40, difference, 1e-6
        )
    ]
    for n in SIZES:
        J, k, repeats = *_chain(n), max(1, min(60, 1000 // n))
        # each of values of its own, for what is known of a car is kept; the median, for one of them may collect garbage
        waiting = iter([np.append(J[:-1], J[-1] * (1.0 + 1e-9 * i)) for i in range(repeats, -1, -1)])
        mine, quick = cpu(lambda waiting=waiting, k=k: pt.modes(chain(next(waiting), k)).omega, repeats)
        found, slow = cpu(lambda J=J, k=k: theirs(J, k), min(repeats, 20))
        difference = relative(mine[1:], found[1:])
        met.append(row(f"chain of {n}, values to modes / openTorsion, undamped", 1, quick, slow, difference, 1e-6))
    return all(met)


def _as_chain(car):
    """Inertias and stiffnesses of the source's car as seen from the engine."""
    model = pt.assemble(car)
    z = model.rigid_motion[[model.nodes.index(name) for name in model.coordinates]]
    return np.diag(model.M) * z**2, model.stiffness * np.abs(model.F * z).max(axis=1) ** 2


def axle():
    """A car with two loops: an open differential, two shafts and two tyres."""
    return pt.Driveline(
        pt.Inertia("engine", J=0.25),
        pt.Gear("gearbox", "engine", "pinion", ratio=9.0),
        pt.SpringDamper("propshaft", "pinion", "case", stiffness=2e4, damping=3.0),
        pt.Inertia("case", J=0.1),
        pt.Differential("differential", "case", "left_side", "right_side"),
        pt.Inertia("left_side", J=0.01),
        pt.Inertia("right_side", J=0.01),
        pt.SpringDamper("left_shaft", "left_side", "left_wheel", stiffness=9e3, damping=20.0),
        pt.SpringDamper("right_shaft", "right_side", "right_wheel", stiffness=8e3, damping=25.0),
        pt.Inertia("left_wheel", J=1.2),
        pt.Inertia("right_wheel", J=1.3),
        pt.Tyre("left_tyre", "left_wheel", "vehicle", radius=0.3, stiffness=3e5, damping=2e3),
        pt.Tyre("right_tyre", "right_wheel", "vehicle", radius=0.31, stiffness=3.1e5, damping=2e3),
        pt.Mass("vehicle", m=1400.0),
    )


def frequency_responses(car=CAR, what="", bar=140):
    """Against python-control, whose digits these are; `tests/test_impedance.py` has others."""
    values, omega = around(1000, car=car), 2.0 * np.pi * np.geomspace(0.5, 500.0, 500)
    signals = "engine_torque", "vehicle_acceleration"

    def together():
        return pt.family(car, values).frequency_response(omega, *signals)["vehicle_acceleration"]

    found, quick = cpu(together)
    family = pt.family(car, values)

    def one(i):
        return control.frequency_response(pt.state_space(family.car(i), *signals), omega).frdata[0, 0]

    expected, slow = cpu(lambda: np.array([one(i) for i in range(8)]))
    # control's own error; a response is compared with its peak
    difference = np.abs(found[:8] - expected).max() / np.abs(found[:8]).max()
    name = f"frequency response{what}, 500 x 1e3 variants / state_space + control"
    return row(name, bar, quick / 1e3, slow / 8, difference, 1e-8)


def load_changes():
    values = around(1000)
    family = pt.family(CAR, values)
    time_points = np.linspace(0.0, 2.6, 1301)
    torque = pt.ramp(1.0, 0.2, 250.0)(time_points)

    def together():
        response = family.load_change(outputs="vehicle_acceleration")
        return response["vehicle_acceleration"], response.metrics()

    (found, metrics), quick = cpu(together)
    systems = [pt.state_space(family.car(i), "engine_torque", "vehicle_acceleration") for i in range(8)]
    finals = [250.0 * pt.SampledPlant(car=family.car(i)).final_acceleration for i in range(8)]

    def loop():
        responses = [control.forced_response(system, time_points, torque).outputs for system in systems]
        return responses, [
            pt.ride_metrics(time_points, a, final, 1.0) for a, final in zip(responses, finals, strict=True)
        ]

    (expected, expected_metrics), slow = cpu(loop)
    difference = max(
        np.abs(found[:8] - np.array(expected)).max() / np.abs(found).max(),
        *(
            relative(metrics[name][:8], [getattr(each, name) for each in expected_metrics])
            for name in metrics.dtype.names
        ),
    )
    return row(
        "load change and metrics, 1e3 variants / control.forced_response", 30, quick / 1e3, slow / 8, difference, 1e-9
    )


def closed_loops(before):
    plant = pt.SampledPlant(car=CAR)
    controller = pt.antijerk.designs(plant)["two degrees of freedom"]
    # the controller knows the ratios
    values = around(1000, ("J", "m", "stiffness", "damping"))
    found, slow = before.run("closed_loops", values=values, count=29, controller=plain(controller))
    accelerations, metrics = (list(column) for column in zip(*found, strict=True))
    met = []
    for n, bar in ((1000, 80), (29, 15)):
        few = {name: column[:n] for name, column in values.items()}

        def together(few=few):
            family = pt.family(CAR, few)
            demand = pt.ramp(0.5, 0.1, 250.0)
            response = family.closed_loop(plant, controller, demand, outputs="vehicle_acceleration")
            return response["vehicle_acceleration"], response.metrics()

        (mine, mine_metrics), quick = cpu(together)
        largest = np.abs(np.array(accelerations)).max()
        difference = np.abs(mine[:29] - np.array(accelerations)).max() / largest
        columns = np.array([mine_metrics[name][:29] for name in mine_metrics.dtype.names]).T
        difference = max(difference, float(np.nanmax(np.abs(columns - np.array(metrics)))))
        met.append(
            row(f"closed loop of 4 s and metrics, {n} plants / one by one", bar, quick / n, slow, difference, 1e-9)
        )
    expected, slow = before.run("one_loop", controller=plain(controller))
    mine, quick = now("one_loop", controller=plain(controller))
    difference = np.abs(mine - expected).max() / np.abs(expected).max()
    met.append(row("one closed loop of 4 s / as it was", 4, quick, slow, difference, 1e-9))
    return all(met)


def launches(before):
    values = around(1000)
    found, slow = before.run("launches", values=values, count=20)
    result, quick = cpu(lambda: pt.family(CAR, values).launch())
    mine = np.array([result["lock_time"][:20], result["heat"][:20]]).T
    return row("1e3 launches, lock time and heat / one by one", 25, quick / 1e3, slow, relative(mine, found), 1e-9)


def plain(controller):
    """Matrices, sample time and signals, which any version of python-control makes a system of."""
    matrices = [np.array(M) for M in (controller.A, controller.B, controller.C, controller.D)]
    return [*matrices, controller.dt, list(controller.input_labels), list(controller.output_labels)]


def single_cars(before):
    met, few = [], [plain(each) for each in list(pt.antijerk.designs(pt.SampledPlant(car=CAR)).values())[1:5]]
    for name, job, arguments, bar, tolerance in (
        ("modes of the source's car / as it was", "modes_of_car", {"count": 60}, 2.5, 1e-12),
        ("modes of a chain of 200 / as it was", "modes_of_chain", _random_chain(200, 5), 3, 1e-11),
        ("modes of a chain of 1000 / as it was", "modes_of_chain", _random_chain(1000, 2), 2, 1e-10),
        ("compare_models / as it was", "compare", {"count": 3}, 8, 1e-6),
        ("robustness / as it was", "robustness", {"controllers": few}, 4, 1e-7),
        ("report on the source's car / as it was", "report", {}, 2, 1e-12),
    ):
        expected, slow = before.run(job, **arguments)
        found, quick = now(job, **arguments)
        is_error = job in ("robustness", "compare")
        difference = np.abs(np.asarray(found) - expected).max() if is_error else relative(found, expected)
        met.append(row(name, bar, quick, slow, difference, tolerance))
    return all(met)


def _random_chain(n, count):
    J, k = _chain(n)
    return {"J": J, "k": k, "count": count}


def _chain(n):
    """Inertias and stiffnesses over two decades."""
    random = np.random.default_rng(0)
    return 10.0 ** random.uniform(-1, 1, n), 1e4 * 10.0 ** random.uniform(0, 2, n - 1)


# A gigabyte; and what a family may need besides its values and results: its working memory, and as much for results on
# their way.
GIGABYTE, WORKING = 2**30, 2 * parts.MEMORY


def _peak():
    """Largest memory so far [bytes]."""
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _slowest(n):
    """Relative error of the ten slowest modes of a uniform chain against the closed form, CPU [s], peak [bytes]."""
    car = pt.Driveline(
        *(pt.Inertia(f"J{i}", J=0.5) for i in range(n)),
        *(pt.SpringDamper(f"k{i}", f"J{i}", f"J{i + 1}", stiffness=1e5) for i in range(n - 1)),
    )
    start = time.process_time()
    result = pt.modes(car, count=10)
    seconds = time.process_time() - start
    expected = 2.0 * np.sqrt(2e5) * np.sin(np.arange(10) * np.pi / (2 * n))
    return relative(result.omega, expected), seconds, _peak()


def large():
    """Chains of 10 000 and 100 000 bodies against the closed form, each in a process of its own."""
    met = []
    for n, tolerance, most in ((10_000, 1e-12, 2.0), (100_000, 1e-10, np.inf)):
        with ProcessPoolExecutor(1, mp_context=get_context("forkserver")) as executor:
            error, seconds, peak = executor.submit(_slowest, n).result()
        met.append(error <= tolerance and seconds < most and (peak < GIGABYTE or most == np.inf))
        print(
            f"ten slowest modes of {n} bodies: {seconds:.2f} s of CPU, peak {peak / 2**20:.0f} MiB, differ by {error:.1g} "
            f"from the closed form: {'met' if met[-1] else 'MISSED'}"
        )
    return all(met)


def _many(count, memory):
    """Bits of the modes of so many variants, CPU [s], growth of the peak besides values and results [bytes]."""
    parts.MEMORY = memory
    values = around(count)
    pt.family(CAR, around(10_000)).modes()  # what is imported and held at all
    held, start = _peak(), time.process_time()
    result = pt.family(CAR, values).modes()
    seconds = time.process_time() - start
    grown = _peak() - held
    kept = sum(column.nbytes for column in result.family.values.values())
    kept += result.omega.nbytes + result.damping_ratio.nbytes
    digest = hashlib.sha256(result.omega.tobytes() + result.damping_ratio.tobytes()).hexdigest()
    return digest, seconds, grown - kept, kept


def million():
    """A million variants for real, each count in a process of its own; and once more in other parts."""
    each, met, digests = {}, True, {}
    for count, memory in ((10_000, parts.MEMORY), (100_000, parts.MEMORY), (10**6, parts.MEMORY), (10**6, 2**23)):
        with ProcessPoolExecutor(1, mp_context=get_context("forkserver")) as executor:
            digest, seconds, grown, kept = executor.submit(_many, count, memory).result()
        each.setdefault(count, seconds / count)
        same = digests.setdefault(count, digest) == digest
        met &= same and grown < WORKING
        print(
            f"modes of {count} variants in parts of {memory / 2**20:.0f} MiB: {1e6 * seconds / count:.2f} us each, values "
            f"and results {kept / 2**20:.0f} MiB, peak grew by {grown / 2**20:.0f} MiB besides"
            + ("" if memory == parts.MEMORY else ", the same bits" if same else ", OTHER BITS")
        )
    return met and each[10**6] < 1.5 * each[10_000]


def rows():
    """All rows; those against the older commit only where there is a history to take it from."""
    before = Before()
    met = [
        frequencies(),
        open_torsion(),
        frequency_responses(),
        frequency_responses(axle(), " with loops", 70),
        load_changes(),
        large(),
        million(),
    ]
    if before.is_there:
        met += [modes(before), poles(before), closed_loops(before), launches(before), single_cars(before)]
    else:
        print("no history of this package here: no rows against what it was")
    return all(met)
