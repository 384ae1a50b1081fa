"""The report's section on anti-jerk control: every design on the nominal plant and on its variations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import control
import numpy as np

from .. import plots
from ..antijerk import Tuned, designs, tune
from ..base.errors import PowertrainError
from ..driveline.collection import rebuilt
from ..elements import Backlash, SpringDamper
from ..hybrid.metrics import RideMetrics
from ..hybrid.response import Response
from ..hybrid.signals import ramp
from ..linear.assembly import as_driveline, kept
from ..sampled.loop import closed_loop
from ..sampled.manoeuvres import controlled_launch
from ..sampled.margins import loop_margins
from ..sampled.plant import SampledPlant
from ..studies import Proof, Robustness, robustness, softest_shafts, tip_in_metrics, variations
from ..studies.requirements import (
    CORNERS,
    DEFAULTS,
    ENGINE_SPEED_DESIGNS,
    ENGINE_SPEED_REQUIREMENTS,
    GROUPS,
    ONE_AT_A_TIME,
    REQUIREMENTS,
    asked,
    requirements_missed,
)
from ..studies.times import RAMP, TORQUE, Times, times_of
from .subject import Picture, Section, Subject, Table, new_figure

# The design that is shown, and others beside it in the pole map and the Nyquist diagram.
SHOWN, BESIDE = "two degrees of freedom", ("P", "LQG", "H-infinity")
# Larger drivelines take minutes for all plants.
STATES_LIMIT = 40
# Ramps of the plain slower pedal [s], of the source's car.
RAMPS = (0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4)
# The tip-in through play: half gaps [deg]; of the source's car torque before [N m], start and end [s], and from when on it
# should rest.
HALF_GAPS = (0.0, 0.5, 1.0, 2.0)
OVERRUN, PLAY_START, PLAY_END, PLAY_LATE = -30.0, 0.2, 2.0, 1.4


def antijerk_section(subject: Subject) -> Section:
    """What a controller tuned for this car reaches, first of all; then other designs, its proof plant by plant, and figures.

    The source's car gets every design on every plant, other cars every design on the nominal plant and one on all.
    """
    title = "Anti-jerk control"
    try:
        plant = _plant_of(subject)
        if plant.continuous.nstates > STATES_LIMIT:
            return Section(title, [f"Not shown: {plant.continuous.nstates} states; shown up to {STATES_LIMIT}."])
        if not loop_margins(plant, None).stable:
            return Section(title, ["Not shown: without damping the driveline itself never settles; give it some."])
        study = _study_of_source(plant) if subject.is_source else _study(plant, is_full=False)
    except (PowertrainError, np.linalg.LinAlgError) as error:
        return Section(title, [f"Not shown: {error}."])
    tuned = study.tuned
    tables = [
        Table("What is required of a controller tuned for this car, and what it reaches", tuned.headers, tuned.rows())
    ]
    if not tuned.proof.stable:
        return Section(title, [verdict(tuned)], tables=tables)
    tables.append(_nominal_table(study))
    if subject.is_source:
        tables += [_worst_table(study), _requirements_table()]
    proven = study.proofs[SHOWN]
    caption = f'"{SHOWN}" on every plant: same fixed controller, each against its own open loop'
    tables.append(Table(caption, proven.headers, proven.rows()))
    if play := _play_table(study):
        tables.append(play)
    return Section(title, [verdict(tuned), *_text(subject, study)], tables=tables, pictures=_pictures(subject, study))


def _plant_of(subject: Subject) -> SampledPlant:
    """What drives the car as its file says, or as is usual for an engine."""
    if subject.plant is None:
        return SampledPlant(car=as_driveline(subject.responding))
    return replace(subject.plant, car=subject.plant.linear)


# --- study


@dataclass(frozen=True, eq=False)
class _Study:
    """What is tuned for a plant, other designs, and their proofs, that of `SHOWN` on all of `plants`."""

    tuned: Tuned
    plant: SampledPlant
    plants: Mapping[str, SampledPlant]
    designs: Mapping[str, control.StateSpace]
    proofs: Mapping[str, Robustness]
    shown: Mapping[str, Response]
    slower: Mapping[float, RideMetrics]


@kept(4)
def _study_of_source(plant: SampledPlant) -> _Study:
    """Half a minute, so once for each set of damping."""
    return _study(plant, is_full=True)


def _study(plant: SampledPlant, is_full: bool) -> _Study:
    tuned = tune(plant)
    return _study_of(plant, variations(plant), {**designs(plant), SHOWN: tuned.controller}, is_full, tuned)


def _study_of(
    plant: SampledPlant,
    plants: Mapping[str, SampledPlant],
    found: Mapping[str, control.StateSpace],
    is_full: bool,
    tuned: Tuned,
) -> _Study:
    times, nominal = times_of(plant), {"nominal": plants["nominal"]}
    proofs = {
        name: robustness(plant, controller, plants if is_full or name == SHOWN else nominal)
        for name, controller in found.items()
    }
    shown = {name: _tip_in(each, found[SHOWN], times) for name, each in plants.items()}
    ramps = [times.ramp / RAMP * length for length in RAMPS]
    slower = {length: tip_in_metrics(plant, _tip_in(plant, None, times._replace(ramp=length))) for length in ramps}
    return _Study(tuned, plant, plants, found, proofs, shown, slower)


def _tip_in(plant: SampledPlant, controller: control.StateSpace | None, times: Times) -> Response:
    """A tip-in as those of the proof."""
    return closed_loop(plant, controller, ramp(times.start, times.ramp, times.torque), times.end)


# --- text


def verdict(tuned: Tuned) -> str:
    """What comes first: whether the car has a controller that does what is required, and what is in the way."""
    plant, reached = tuned.proof, tuned.reached
    several = f"all {len(plant.proofs)} plants that the car can turn out to be"
    if not tuned.proof.stable:
        unstable = [f'"{name}"' for name, proof in plant.proofs.items() if not proof.margins.stable]
        return (
            f'No controller of the structure "{tuned.structure}" was found that is stable on {several}; the best one is '
            f"unstable on {_listed(unstable)}. A quicker actuator or a shorter delay helps."
        )
    text = (
        f"A controller tuned for this car takes away {100 * reached['oscillation_reduction']:.0f} % of the oscillation of a "
        f"tip-in, at worst {100 * reached['worst_oscillation_reduction']:.0f} % on {several}, and is stable on every one of "
        f"them. The rise takes {reached['t90_ratio']:.2f} times as long as without it; the disk margin is "
        f"{reached['disk_margin']:.2f}, at worst {reached['worst_disk_margin']:.2f}. "
    )
    if not tuned.unmet:
        return text + f"It meets every requirement; the {asked(tuned.binding, 0.0).name} is nearest to its limit."
    missed = []
    for name in tuned.unmet:
        requirement = asked(name, tuned.requirements[name])
        among = "" if requirement.among == "nominal" else " at worst"
        best = f", of all candidates that keep the disk margin {tuned.best[name]:.3g}" if name in tuned.best else ""
        missed.append(f"{requirement.name}{among} (required {requirement.text}, reached {tuned.unmet[name]:.3g}{best})")
    return text + f"It misses {_listed(missed)}; the best candidates show what lag, delay and sampling leave."


def _text(subject: Subject, study: _Study) -> list[str]:
    plant, times = study.plant, times_of(study.plant)
    low, high = plant.limits
    rise = " but about 0.7 m/s^1.75" if subject.is_source else ""
    text = [
        f"Controllers designed on the two-mass model and judged on the detailed one, {_clutches(plant)}: torque lag "
        f"{1e3 * plant.lag:g} ms, pure delay {1e3 * plant.delay:g} ms, sample time {1e3 * plant.dt:g} ms, torque "
        f"limited to {low:g} to {high:g} N m, engine and wheel speed measured. The delay is simulated as a delay and "
        f"the driveline exactly between the samples. The tip-in is a ramp of the demand from 0 to {times.torque:.4g} N m in "
        f"{1e3 * times.ramp:.4g} ms. The wheel disturbance is a half-sine of 100 ms with 800 N m peak at the wheels in "
        "steady driving.",
        "Oscillation is the highest peak of the vehicle acceleration minus the lowest trough after it, over the final "
        "value; overshoot is relative to the final value, which follows from torque and inertia; t90 is the "
        "time from the start of the ramp to 90 % of the final value. These and the peak jerk are those of the "
        f"unfiltered acceleration, in the window from the start of the ramp to {times.end - times.start:.3g} s later. VDV "
        "is that of the acceleration band-passed from 1 to 10 Hz (Butterworth filter of order 2, run forward and backward) "
        f"in the same window; it contains the wanted rise, so that it is not 0 without any oscillation{rise}. The "
        "disturbance counts by the RMS of the acceleration from 50 ms after the pulse to the end at 4 s. Damping "
        "ratios are those of the poles which those of the driveline's first and second mode become in the sampled loop, "
        "or of poles of actuator and controller nearest to them, whichever is less; the disk margin is the "
        "balanced one at the plant input, 2 without feedback.",
    ]
    if not subject.is_source:
        text.append(
            f'"{SHOWN}" is what the search has found for this car; the gains and weights of the others are in units of its '
            f"own numbers, J1 ω1 of its two-mass model, lag, delay and sample time, turned down until the disk margin is "
            f'{DEFAULTS["disk_margin"]:g}. Only "{SHOWN}" is proven on every plant here, the others on the nominal one.'
        )
        text += [
            f'"{name}" is left out: {reason}.' for name, reason in designs(plant).left_out.items() if name != SHOWN
        ]
        return text
    short = {name: requirements_missed(result) for name, result in study.proofs.items()}
    met = [f'"{name}"' for name, missed in short.items() if not missed and study.proofs[name].stable]
    text.append(
        f'"{SHOWN}" is what the search has found, on the nominal plant and eight of the {len(study.plants)}; what it was '
        "asked for is required of any car, the table of what is required of the source's car is stricter. The gains of the "
        "plain ones were chosen by hand. One of each other family was tuned with equal effort: a random search of 400 "
        "candidates each on 8 plants, drawn at random inside the tolerances and none of them among those of the tables. "
        f"Every requirement is met by {_listed(met)}."
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
        _finite(proof.t90_ratio, ".2f"),
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
    times = times_of(study.plant)
    longer, overrun = times.ramp / RAMP, OVERRUN * times.torque / TORQUE
    end, late = PLAY_START + longer * (PLAY_END - PLAY_START), PLAY_START + longer * (PLAY_LATE - PLAY_START)
    demand, rows = ramp(PLAY_START, times.ramp, times.torque, overrun), []
    limits = (min(overrun, study.plant.limits[0]), study.plant.limits[1])
    for half in HALF_GAPS:
        gap = max(2.0 * np.deg2rad(half), 1e-9)
        play = Backlash(shaft.name, shaft.a, shaft.b, gap=gap, stiffness=shaft.stiffness, damping=shaft.damping)
        changed = rebuilt(car, (play if e is shaft else e for e in car))
        plant = replace(study.plant, car=changed, torque_limits=limits)
        final = (times.torque - overrun) * plant.final_acceleration
        peaks = []
        for controller in (None, study.designs[SHOWN]):
            response = closed_loop(plant, controller, demand, duration=end, initial_torque=overrun)
            swing = np.ptp(response["vehicle_acceleration"][response.time > late])
            peaks.append(
                [
                    f"{response[f'{shaft.name}_torque'].max():.0f}",
                    f"{response['vehicle_acceleration'].max() / final:.3f}",
                    f"{swing:.3f}",
                ]
            )
        rows.append([f"{half:g}", *(value for pair in zip(*peaks, strict=True) for value in pair)])
    what = ("largest torque [N m]", "peak over final acceleration", f"swing after {late:.3g} s [m/s²]")
    headers = ["half gap [deg]", *(f"{name}, {which}" for name in what for which in ("open", f'"{SHOWN}"'))]
    caption = (
        f"Tip-in from {overrun:.4g} to {times.torque:.4g} N m in {times.ramp:.3g} s through play in series with "
        f"{shaft.name}, in balance with the load before"
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
    plant, controller, times = study.plant, study.designs[SHOWN], times_of(study.plant)
    pictures, window = [], (times.start - times.ramp, times.start + 19.0 * times.ramp)

    figure = new_figure(6.8, 7.6)
    axes = figure.subplots(4, sharex=True, height_ratios=(4, 4, 3, 3))
    plots.tip_in({"open loop": _tip_in(plant, None, times), SHOWN: study.shown["nominal"]}, axes)
    axes[0].set_xlim(*window)
    pictures.append(Picture("antijerk_tip_in", f'Tip-in, open loop against "{SHOWN}"', figure))

    figure = new_figure(6.4, 4.2)
    plots.pareto(study.tuned, figure.subplots())
    caption = (
        "Candidates of the search that keep the disk margin: what is left of the oscillation against the rise time"
    )
    pictures.append(Picture("antijerk_pareto", caption, figure))

    beside = [name for name in BESIDE if name in study.proofs]
    margins = {name: study.proofs[name]["nominal"].margins for name in (SHOWN, *beside)}
    figure = new_figure(6.2, 5.6)
    plots.pole_map({"open loop": loop_margins(plant, None), **margins}, figure.subplots())
    pictures.append(Picture("antijerk_poles", "Poles of the sampled loops, upper half plane", figure))

    figure = new_figure(6.4, 5.2)
    plots.nyquist({name: margins[name] for name in (SHOWN, *beside[-1:])}, figure.subplots())
    caption = "Loop gain at the plant input with the disk of the balanced disk margin, which each loop touches"
    pictures.append(Picture("antijerk_nyquist", caption, figure))

    proven = study.proofs[SHOWN]
    figure = new_figure(7.4, 6.8)
    plots.robust_spread(proven, figure.subplots(1, 4, sharey=True))
    caption = f'"{SHOWN}" on every plant; diamond: worst, line: nominal'
    pictures.append(Picture("antijerk_spread", caption, figure))

    figure = new_figure(6.8, 3.6)
    final = {name: times.torque * each.final_acceleration for name, each in study.plants.items()}
    ax = figure.subplots()
    plots.robust_responses(study.shown, ax, final, proven.worst("oscillation_reduction")[0])
    ax.set_xlim(*window)
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
