"""Families against loops: over this package as it was, over scipy, python-control and openTorsion."""

import resource
import statistics
import time

import control
import numpy as np
import scipy.linalg

import powertrain_ctrl as pt

from .baseline import Before, now
from .before import chain

CAR = pt.examples.conventional()
STIFFNESS_AND_INERTIA = ("stiffness", "J", "m")


def around(n, parameters=("J", "m", "stiffness", "damping", "ratio", "radius"), seed=0):
    """Values around those of the source's car, 22 of them, ratios and radius among them."""
    random = np.random.default_rng(seed)
    names = [
        f"{element.name}.{name}"
        for element in CAR
        for name in parameters
        if isinstance(getattr(element, name, None), float) and f"{element.name}.{name}" != "clutch_secondary.J"
    ]
    return {
        name: getattr(CAR[name.split(".")[0]], name.split(".")[1]) * np.exp(0.1 * random.standard_normal(n))
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
    return all(met)


def open_torsion():
    """Rows against openTorsion, where it is installed: a loop over variants, and single chains of all sizes."""
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
    for n, repeats in ((7, 30), (50, 10), (200, 3), (1000, 1)):
        random = np.random.default_rng(0)
        J, k = 10.0 ** random.uniform(-1, 1, n), 1e4 * 10.0 ** random.uniform(0, 2, n - 1)
        cars = [chain(np.append(J[:-1], J[-1] * (1.0 + 1e-9 * i)), k) for i in range(repeats)]
        pt.modes(chain(J, k))
        start = time.process_time()
        mine = [pt.modes(car).omega for car in cars]
        quick = (time.process_time() - start) / repeats
        found, slow = cpu(lambda J=J, k=k: theirs(J, k), 1)
        difference = relative(mine[0][1:], found[1:])
        met.append(row(f"modes of a chain of {n} / openTorsion, undamped", 1, quick, slow, difference, 1e-6))
    return all(met)


def _as_chain(car):
    """Inertias and stiffnesses of the source's car as seen from the engine."""
    model = pt.assemble(car)
    z = model.rigid_motion[[model.nodes.index(name) for name in model.coordinates]]
    return np.diag(model.M) * z**2, model.stiffness * np.abs(model.F * z).max(axis=1) ** 2


def frequency_responses():
    """Against python-control, whose digits these are; `tests/test_impedance.py` has others."""
    values, omega = around(1000), 2.0 * np.pi * np.geomspace(0.5, 500.0, 500)
    signals = "engine_torque", "vehicle_acceleration"

    def together():
        return pt.family(CAR, values).frequency_response(omega, *signals)["vehicle_acceleration"]

    found, quick = cpu(together)
    family = pt.family(CAR, values)

    def one(i):
        return control.frequency_response(pt.state_space(family.car(i), *signals), omega).frdata[0, 0]

    expected, slow = cpu(lambda: np.array([one(i) for i in range(8)]))
    # control's own error; a response is compared with its peak
    difference = np.abs(found[:8] - expected).max() / np.abs(found[:8]).max()
    name = "frequency response, 500 x 1e3 variants / state_space + control"
    return row(name, 140, quick / 1e3, slow / 8, difference, 1e-8)


def load_changes():
    values = around(1000)
    family = pt.family(CAR, values)
    time_points = np.linspace(0.0, 2.6, 1301)
    torque = pt.ramp(1.0, 0.2, 250.0)(time_points)

    def together():
        response = family.load_change(outputs="vehicle_acceleration")
        return response["vehicle_acceleration"], response.metrics()

    (found, _), quick = cpu(together)
    systems = [pt.state_space(family.car(i), "engine_torque", "vehicle_acceleration") for i in range(8)]
    finals = [250.0 * pt.SampledPlant(car=family.car(i)).final_acceleration for i in range(8)]

    def loop():
        responses = [control.forced_response(system, time_points, torque).outputs for system in systems]
        for a, final in zip(responses, finals, strict=True):
            pt.ride_metrics(time_points, a, final, 1.0)
        return responses

    expected, slow = cpu(loop)
    difference = np.abs(found[:8] - np.array(expected)).max() / np.abs(found).max()
    return row(
        "load change and metrics, 1e3 variants / control.forced_response", 30, quick / 1e3, slow / 8, difference, 1e-9
    )


def closed_loops(before):
    plant = pt.SampledPlant(car=CAR)
    controller = pt.antijerk.designs(plant)["two degrees of freedom"]
    # the controller knows the ratios
    values = around(1000, ("J", "m", "stiffness", "damping"))
    found, slow = before.run("closed_loops", values=values, count=29)
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
    expected, slow = before.run("one_loop")
    mine, quick = now("one_loop")
    difference = np.abs(mine - expected).max() / np.abs(expected).max()
    met.append(row("one closed loop of 4 s / as it was", 4, quick, slow, difference, 1e-9))
    return all(met)


def single_cars(before):
    met = []
    for name, job, arguments, bar, tolerance in (
        ("modes of the source's car / as it was", "modes_of_car", {"count": 60}, 2.5, 1e-12),
        ("modes of a chain of 200 / as it was", "modes_of_chain", _random_chain(200, 5), 3, 1e-11),
        ("modes of a chain of 1000 / as it was", "modes_of_chain", _random_chain(1000, 2), 2, 1e-10),
        ("compare_models / as it was", "compare", {"count": 3}, 8, 1e-6),
        ("robustness / as it was", "robustness", {"count": 3}, 4, 1e-7),
    ):
        expected, slow = before.run(job, **arguments)
        found, quick = now(job, **arguments)
        is_error = job in ("robustness", "compare")
        difference = np.abs(np.asarray(found) - expected).max() if is_error else relative(found, expected)
        met.append(row(name, bar, quick, slow, difference, tolerance))
    return all(met)


def _random_chain(n, count):
    random = np.random.default_rng(0)
    return {"J": 10.0 ** random.uniform(-1, 1, n), "k": 1e4 * 10.0 ** random.uniform(0, 2, n - 1), "count": count}


def large():
    """A chain of 10 000 against the closed form, and a million variants for real."""
    n = 10_000
    car = pt.Driveline(
        *(pt.Inertia(f"J{i}", J=0.5) for i in range(n)),
        *(pt.SpringDamper(f"k{i}", f"J{i}", f"J{i + 1}", stiffness=1e5) for i in range(n - 1)),
    )
    start = time.process_time()
    result = pt.modes(car, count=10)
    seconds = time.process_time() - start
    expected = 2.0 * np.sqrt(2e5) * np.sin(np.arange(10) * np.pi / (2 * n))
    print(
        f"ten slowest modes of 10 000 bodies: {seconds:.2f} s, "
        f"differ by {relative(result.omega, expected):.1g} from the closed form"
    )
    each = {}
    for count in (10_000, 100_000, 1_000_000):
        values = around(count)
        held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        start = time.process_time()
        pt.family(CAR, values).modes()
        each[count] = (time.process_time() - start) / count
        grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held) / 1024
        kept = 2 * 7 * 8 * count / 2**20
        print(
            f"modes of {count} variants: {1e6 * each[count]:.2f} us each, peak grew by {grown:.0f} MiB, "
            f"of which results {kept:.0f}"
        )
    is_linear = each[1_000_000] < 1.5 * each[10_000]
    return seconds < 2.0 and is_linear


def rows():
    """All rows; those against the older commit only where there is a history to take it from."""
    before = Before()
    met = [frequencies(), open_torsion(), frequency_responses(), load_changes(), large()]
    if before.is_there:
        met += [modes(before), poles(before), closed_loops(before), single_cars(before)]
    else:
        print("no history of this package here: no rows against what it was")
    return all(met)
