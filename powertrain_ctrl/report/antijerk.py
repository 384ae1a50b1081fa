"""The report's section on anti-jerk control: every design on the nominal plant and on its variations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import control
import numpy as np

from .. import plots
from ..antijerk import designs
from ..base.errors import PowertrainError
from ..driveline.collection import Driveline, rebuilt
from ..elements import Backlash, SpringDamper
from ..hybrid.metrics import RideMetrics
from ..hybrid.response import Response
from ..hybrid.signals import ramp
from ..linear.assembly import as_driveline, kept
from ..reduction.condensed import two_mass
from ..sampled.loop import closed_loop
from ..sampled.manoeuvres import controlled_launch
from ..sampled.margins import loop_margins
from ..sampled.plant import SampledPlant
from ..studies import Proof, Robustness, robustness, softest_shafts, tip_in, tip_in_metrics, variations
from ..studies.requirements import (
    CORNERS,
    ENGINE_SPEED_DESIGNS,
    ENGINE_SPEED_REQUIREMENTS,
    GROUPS,
    ONE_AT_A_TIME,
    REQUIREMENTS,
    requirements_missed,
)
from ..studies.times import TORQUE
from .subject import Picture, Section, Subject, Table, new_figure

# The design that is shown, and others beside it in the pole map and the Nyquist diagram.
SHOWN, BESIDE = "two degrees of freedom", ("P", "LQG", "H-infinity")
# Larger drivelines take minutes for all plants.
STATES_LIMIT = 40
# Ramps of the plain slower pedal [s].
RAMPS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)
# The tip-in through play: half gaps [deg], torque before [N m], start, ramp and end [s], and from when on it should rest.
HALF_GAPS = (0.0, 0.5, 1.0, 2.0)
OVERRUN, PLAY_START, PLAY_RAMP, PLAY_END, PLAY_LATE = -30.0, 0.2, 0.1, 2.0, 1.4


def antijerk_section(subject: Subject) -> Section:
    """Tables of all designs, the proof of one of them plant by plant, and its figures; or why there is none.

    The source's car gets every design on every plant, other cars every design on the nominal plant and one on all.
    """
    title = "Anti-jerk control"
    try:
        car = as_driveline(subject.responding)
        plant = SampledPlant(car=car)
        if plant.continuous.nstates > STATES_LIMIT:
            return Section(title, [f"Not shown: {plant.continuous.nstates} states; shown up to {STATES_LIMIT}."])
        if not loop_margins(plant, None).stable:
            return Section(title, ["Not shown: without damping the driveline itself never settles; give it some."])
        study = _study_of_source(car) if subject.is_source else _study(car, is_full=False)
    except (PowertrainError, np.linalg.LinAlgError) as error:
        return Section(title, [f"Not shown: {error}."])
    tables = [_nominal_table(study)]
    if subject.is_source:
        tables += [_worst_table(study), _requirements_table()]
    proven = study.proofs[SHOWN]
    caption = f'"{SHOWN}" on every plant: same fixed controller, each against its own open loop'
    tables.append(Table(caption, proven.headers, proven.rows()))
    if play := _play_table(study):
        tables.append(play)
    return Section(title, _text(subject, study), tables=tables, pictures=_pictures(subject, study))


# --- study


@dataclass(frozen=True, eq=False)
class _Study:
    """Designs of a plant and their proofs, `SHOWN` first on all of `plants`."""

    plant: SampledPlant
    plants: Mapping[str, SampledPlant]
    designs: Mapping[str, control.StateSpace]
    proofs: Mapping[str, Robustness]
    shown: Mapping[str, Response]
    slower: Mapping[float, RideMetrics]


@kept(4)
def _study_of_source(car: Driveline) -> _Study:
    """Half a minute, so once for each set of damping."""
    return _study(car, is_full=True)


def _study(car: Driveline, is_full: bool) -> _Study:
    plant = SampledPlant(car=car)
    plants = variations(plant)
    found = designs(plant, two_mass(car))
    return _study_of(plant, plants, found, is_full)


def _study_of(
    plant: SampledPlant, plants: Mapping[str, SampledPlant], found: Mapping[str, control.StateSpace], is_full: bool
) -> _Study:
    nominal = {"nominal": plants["nominal"]}
    proofs = {
        name: robustness(plant, controller, plants if is_full or name == SHOWN else nominal)
        for name, controller in found.items()
    }
    shown = {name: tip_in(each, found[SHOWN]) for name, each in plants.items()}
    slower = {length: tip_in_metrics(plant, tip_in(plant, None, duration=length)) for length in RAMPS}
    return _Study(plant, plants, found, proofs, shown, slower)


# --- text


def _text(subject: Subject, study: _Study) -> list[str]:
    plant = study.plant
    low, high = plant.limits
    rise = " but about 0.7 m/s^1.75" if subject.is_source else ""
    text = [
        f"Controllers designed on the two-mass model and judged on the detailed one, {_clutches(plant)}: torque lag "
        f"{1e3 * plant.lag:g} ms, pure delay {1e3 * plant.delay:g} ms, sample time {1e3 * plant.dt:g} ms, torque "
        f"limited to {low:g} to {high:g} N m, engine and wheel speed measured. The delay is simulated as a delay and "
        "the driveline exactly between the samples. The tip-in is a ramp of the demand from 0 to 250 N m in 100 ms. "
        "The wheel disturbance is a half-sine of 100 ms with 800 N m peak at the wheels in steady driving.",
        "Oscillation is the highest peak of the vehicle acceleration minus the lowest trough after it, over the final "
        "value; overshoot is relative to the final value, which follows from torque and inertia; t90 is the "
        "time from the start of the ramp to 90 % of the final value. These and the peak jerk are those of the "
        "unfiltered acceleration, in the window from the start of the ramp to 3.5 s later. VDV is that of the "
        "acceleration band-passed from 1 to 10 Hz (Butterworth filter of order 2, run forward and backward) in the "
        f"same window; it contains the wanted rise, so that it is not 0 without any oscillation{rise}. The "
        "disturbance counts by the RMS of the acceleration from 50 ms after the pulse to the end at 4 s. Damping "
        "ratios are those of the poles which those of the driveline's first and second mode become in the sampled loop, "
        "or of poles of actuator and controller nearest to them, whichever is less; the disk margin is the "
        "balanced one at the plant input, 2 without feedback.",
    ]
    if not subject.is_source:
        text.append(
            "The gains and weights are those tuned for the car of the source in first gear, as they are; ratio, design "
            "model and notch are this car's. They are where to start from. "
            f'Only "{SHOWN}" is proven on every plant here, the others on the nominal one.'
        )
        return text
    short = {name: requirements_missed(result) for name, result in study.proofs.items()}
    met = [f'"{name}"' for name, missed in short.items() if not missed and study.proofs[name].stable]
    text.append(
        f'The gains of "P" to "{SHOWN}" were chosen by hand; a prototype of "{SHOWN}" had been measured on such plants '
        "when the requirements were set, so for it these tables are no blind test. The last five, one of each family, "
        "were tuned with equal "
        "effort: a random search of 400 candidates each on the same 8 plants, drawn at random inside the tolerances "
        f"and none of them among the {len(study.plants)} of the tables. Their score was by how much the requirements "
        "are missed on the nominal plant and on the worst of the 8; where only the engine speed is read it left out "
        "damping ratios and disturbance. What these few plants do not show may still be missed on the others. Every "
        f"requirement is met by {_listed(met)}."
    )
    text += _missed_by_lqg(study.proofs.get("LQG"))
    alone = {name: study.proofs[name] for name in ENGINE_SPEED_DESIGNS if name in study.proofs}
    met = [
        f'"{name}"'
        for name, result in alone.items()
        if result.stable and not requirements_missed(result, ENGINE_SPEED_REQUIREMENTS)
    ]
    if alone:
        text.append(f"The requirements for designs that read the engine speed only are met by {_listed(met)}.")
    unstable = [name for name, result in study.proofs.items() if not result.stable]
    for name in unstable:
        where = [f'"{plant}"' for plant, proof in study.proofs[name].proofs.items() if not proof.margins.stable]
        text.append(f'"{name}" is unstable on {_listed(where)}: the second mode, which no two-mass model has.')
    text.append(
        "Without feedback the damping ratios stay those of the driveline and a wheel disturbance is not damped at all; "
        "such designs cannot meet all requirements. Not covered: backlash, tyre slip, torque ripple of combustion, a "
        "sample time that varies."
    )
    return text


def _clutches(plant: SampledPlant) -> str:
    return "clutches as in the file" if as_driveline(plant.car).released else "clutches closed"


def _missed_by_lqg(result: Robustness | None) -> list[str]:
    asked = [each for each in REQUIREMENTS if each.quantity == "disturbance_reduction"]
    if result is None or not set(asked) & set(requirements_missed(result)):
        return []
    values = [
        f"{100 * result.worst(each.quantity, GROUPS[each.among])[1]:.0f} % less ({each.among}; required {each.text})"
        for each in asked
    ]
    return [f"The LQG design misses the requirement on the wheel disturbance: {' and '.join(values)}."]


def _listed(names: list[str]) -> str:
    if not names:
        return "none"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


# --- tables


def _nominal_table(study: _Study) -> Table:
    headers = (
        "design",
        "oscillation less [%]",
        "overshoot [%]",
        "peak jerk [m/s³]",
        "VDV [m/s^1.75]",
        "t90 ratio",
        "ζ first",
        "ζ second",
        "disk margin",
        "disturbance less [%]",
    )
    first = next(iter(study.proofs.values()))["nominal"]
    plain = first.open_metrics
    margins = loop_margins(study.plant, None)
    rows = [
        [
            "open loop",
            "0.0",
            _percent(plain.overshoot),
            f"{plain.peak_jerk:.1f}",
            f"{plain.vdv:.2f}",
            "1.00",
            _number(margins.zeta_first),
            _number(margins.zeta_second),
            f"{margins.disk_margin:.2f}",
            "0",
        ]
    ]
    rows += [[name, *_nominal_row(result["nominal"])] for name, result in study.proofs.items()]
    return Table("Designs on the nominal plant, against the open loop", headers, rows)


def _nominal_row(proof: Proof) -> list[str]:
    margins, metrics = proof.margins, proof.metrics
    if not margins.stable:
        return ["unstable", *["–"] * 4, _number(margins.zeta_first), _number(margins.zeta_second), "–", "–"]
    return [
        _percent(proof.oscillation_reduction),
        _percent(metrics.overshoot),
        f"{metrics.peak_jerk:.1f}",
        f"{metrics.vdv:.2f}",
        f"{proof.t90_ratio:.2f}",
        _number(margins.zeta_first),
        _number(margins.zeta_second),
        f"{margins.disk_margin:.2f}",
        f"{100 * proof.disturbance_reduction:.0f}",
    ]


def _worst_table(study: _Study) -> Table:
    headers = (
        "design",
        "stable on all",
        "oscillation less, one at a time [%]",
        "corners [%]",
        "t90 ratio",
        "ζ first",
        "ζ second",
        "disk margin",
        "disturbance less [%]",
        "requirements missed",
    )
    rows = []
    for name, result in study.proofs.items():
        missed = list(dict.fromkeys(each.name for each in requirements_missed(result)))
        if not result.stable:
            missed.insert(0, "stability")
        values = [
            _finite(100 * result.worst("oscillation_reduction", GROUPS[ONE_AT_A_TIME])[1], ".1f"),
            _finite(100 * result.worst("oscillation_reduction", GROUPS[CORNERS])[1], ".1f"),
            _finite(result.worst("t90_ratio")[1], ".2f"),
            _number(result.worst("zeta_first")[1]),
            _number(result.worst("zeta_second")[1]),
            f"{result.worst('disk_margin')[1]:.2f}",
            _finite(100 * result.worst("disturbance_reduction")[1], ".0f"),
        ]
        rows.append([name, "yes" if result.stable else "NO", *values, ", ".join(missed) or "none"])
    caption = (
        f"The same designs, worst of {len(study.plants)} plants: one change at a time, corners, and the hidden case "
        "(damping halved with a lag of 20 ms)"
    )
    return Table(caption, headers, rows)


def _play_table(study: _Study) -> Table | None:
    """Tip-ins out of overrun through play in series with the softest shaft, exact; None where that is not one shaft."""
    car = as_driveline(study.plant.car)
    names = softest_shafts(car)
    shaft = car[names[0]]
    if len(names) > 1 or not isinstance(shaft, SpringDamper) or not shaft.stiffness:
        return None
    demand, rows = ramp(PLAY_START, PLAY_RAMP, TORQUE, OVERRUN), []
    limits = (min(OVERRUN, study.plant.limits[0]), study.plant.limits[1])
    for half in HALF_GAPS:
        gap = max(2.0 * np.deg2rad(half), 1e-9)
        play = Backlash(shaft.name, shaft.a, shaft.b, gap=gap, stiffness=shaft.stiffness, damping=shaft.damping)
        changed = rebuilt(car, (play if e is shaft else e for e in car))
        plant = replace(study.plant, car=changed, torque_limits=limits)
        final = (TORQUE - OVERRUN) * plant.final_acceleration
        peaks = []
        for controller in (None, study.designs[SHOWN]):
            response = closed_loop(plant, controller, demand, duration=PLAY_END, initial_torque=OVERRUN)
            late = response["vehicle_acceleration"][response.time > PLAY_LATE]
            peaks.append(
                [
                    f"{response[f'{shaft.name}_torque'].max():.0f}",
                    f"{response['vehicle_acceleration'].max() / final:.3f}",
                    f"{np.ptp(late):.3f}",
                ]
            )
        rows.append([f"{half:g}", *(value for pair in zip(*peaks, strict=True) for value in pair)])
    what = ("largest torque [N m]", "peak over final acceleration", f"swing after {PLAY_LATE:g} s [m/s²]")
    headers = ["half gap [deg]", *(f"{name}, {which}" for name in what for which in ("open", f'"{SHOWN}"'))]
    caption = (
        f"Tip-in from {OVERRUN:g} to {TORQUE:g} N m in {PLAY_RAMP:g} s through play in series with {shaft.name}, in balance "
        "with the load before"
    )
    return Table(caption, headers, rows)


def _requirements_table() -> Table:
    rows = [[each.name, each.among, each.text] for each in REQUIREMENTS]
    rows += [[each.name, f"{each.among}, engine speed only", each.text] for each in ENGINE_SPEED_REQUIREMENTS]
    rows.append(["stability", "all", "yes"])
    return Table("What is required of the source's car", ["quantity", "plants", "required"], rows)


def _percent(share: float) -> str:
    return f"{100 * share:.1f}"


def _number(zeta: float) -> str:
    return _finite(zeta, ".3f")


def _finite(value: float, form: str) -> str:
    return format(value, form) if abs(value) < float("inf") else "–"


# --- pictures


def _pictures(subject: Subject, study: _Study) -> list[Picture]:
    plant, controller = study.plant, study.designs[SHOWN]
    pictures = []

    figure = new_figure(6.8, 7.6)
    axes = figure.subplots(4, sharex=True, height_ratios=(4, 4, 3, 3))
    plots.tip_in({"open loop": tip_in(plant), SHOWN: study.shown["nominal"]}, axes)
    axes[0].set_xlim(0.4, 2.4)
    pictures.append(Picture("antijerk_tip_in", f'Tip-in, open loop against "{SHOWN}"', figure))

    margins = {name: study.proofs[name]["nominal"].margins for name in (SHOWN, *BESIDE)}
    figure = new_figure(6.2, 5.6)
    plots.pole_map({"open loop": loop_margins(plant, None), **margins}, figure.subplots())
    pictures.append(Picture("antijerk_poles", "Poles of the sampled loops, upper half plane", figure))

    figure = new_figure(6.4, 5.2)
    beside = {name: margins[name] for name in (SHOWN, BESIDE[-1])}
    plots.nyquist(beside, figure.subplots())
    caption = "Loop gain at the plant input with the disk of the balanced disk margin, which each loop touches"
    pictures.append(Picture("antijerk_nyquist", caption, figure))

    proven = study.proofs[SHOWN]
    figure = new_figure(7.4, 6.8)
    plots.robust_spread(proven, figure.subplots(1, 4, sharey=True))
    caption = f'"{SHOWN}" on every plant; diamond: worst, line: nominal'
    pictures.append(Picture("antijerk_spread", caption, figure))

    figure = new_figure(6.8, 3.6)
    final = {name: 250.0 * each.final_acceleration for name, each in study.plants.items()}
    ax = figure.subplots()
    plots.robust_responses(study.shown, ax, final, proven.worst("oscillation_reduction")[0])
    ax.set_xlim(0.4, 2.4)
    pictures.append(Picture("antijerk_responses", f'Tip-in with "{SHOWN}" on every plant', figure))

    figure = new_figure(7.4, 4.4)
    points = {
        name: result["nominal"].metrics for name, result in study.proofs.items() if result["nominal"].margins.stable
    }
    plots.trade_off(points, study.slower, figure.subplots())
    caption = (
        "Overshoot against rise time of the designs and of a slower pedal, whose ramp lengths are written beside it"
    )
    pictures.append(Picture("antijerk_trade_off", caption, figure))

    if len(as_driveline(plant.car).clutches) == 1 and subject.is_source:
        figure = new_figure(6.8, 6.6)
        responses = {"open loop": controlled_launch(plant, None), SHOWN: controlled_launch(plant, controller)}
        axes = figure.subplots(3, sharex=True)
        axes[0].set_xlim(1.4, 3.5)
        plots.controlled_launch(responses, plant.ratio, axes, plant.engine, plant.wheels[0], plant.vehicle)
        caption = f'Race start at the largest torque, "{SHOWN}" from lock on; vertical lines: the clutch locks'
        pictures.append(Picture("antijerk_launch", caption, figure))
    return pictures
