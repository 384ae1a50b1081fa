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
from ..sampled.actuator import written
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
    requirements_missed,
)
from ..studies.times import RAMP, TORQUE, Times, times_of
from .driven_end import driven_end_section
from .required import UNDAMPED, listed, several, unstable_on, what_is_met, why_none
from .subject import Finding, Picture, Section, Subject, Table, new_figure, under
from .verdict import accelerations

# The design that is shown, and others beside it in the pole map and the Nyquist diagram.
SHOWN, BESIDE = "two degrees of freedom", ("P", "LQG", "H-infinity")
# Figures that compare designs.
ABOUT_EVERY = ("antijerk_trade_off", "antijerk_poles", "antijerk_nyquist")
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
        if plant.vehicle != "vehicle" and plant.vehicle not in plant.car.driveline.translating:
            return driven_end_section(title, plant, subject.plant is not None)
        if plant.continuous.nstates > STATES_LIMIT:
            return Section(title, [f"Not shown: {plant.continuous.nstates} states; shown up to {STATES_LIMIT}."])
        if not loop_margins(plant, None).stable:
            return Section(title, [UNDAMPED])
        study = _study_of_source(plant) if subject.is_source else _study(plant, is_full=False)
    except (PowertrainError, np.linalg.LinAlgError) as error:
        return Section(title, [f"Not shown: {error}."])
    every, one, tuned = "Every design", "The tuned design", study.tuned
    tables = under(
        "Requirements",
        [
            Table(
                "What is required of a controller tuned for this car, and what it reaches", tuned.headers, tuned.rows()
            )
        ],
    )
    if not tuned.proof.stable:
        return Section(title, [verdict(tuned)], tables=tables)
    if subject.is_source:
        tables = under("Requirements", [_requirements_table()])
        tables += under(every, [_nominal_table(study), _worst_table(study)])
    else:
        proven = study.proofs[SHOWN]
        caption = "The tuned design on every plant: same fixed controller, each against its own open loop"
        tables += under(every, [_nominal_table(study)]) + under(one, [Table(caption, proven.headers, proven.rows())])
    if play := _play_table(study):
        tables += under(one, [play])
    drawn = _pictures(subject, study)
    pictures = under(every, [p for p in drawn if p.name in ABOUT_EVERY]) + under(
        one, [p for p in drawn if p.name not in ABOUT_EVERY]
    )
    text, definitions = [verdict(tuned), *_text(subject, study)], _definitions(subject, study)
    return Section(title, text, definitions, tables, pictures, _findings(study), _highlight(study))


def _plant_of(subject: Subject) -> SampledPlant:
    """What drives the car as its file says, or as is usual for an engine."""
    if subject.plant is None:
        return SampledPlant(car=as_driveline(subject.responding))
    return replace(subject.plant, car=subject.plant.linear)


def _findings(study: _Study) -> list[Finding]:
    proven, best = study.proofs[SHOWN], study.proofs[SHOWN]["nominal"]
    stable = sum(proof.margins.stable for proof in proven.proofs.values())
    found = [Finding(f"{stable} of {len(proven.proofs)}", "plants on which the tuned controller is stable", 1)]
    if best.margins.stable:
        less = 100.0 * best.oscillation_reduction
        found.insert(0, Finding(f"{less:.0f} %", "less oscillation after a tip-in with the tuned controller", 1))
    return found


def _highlight(study: _Study) -> Picture:
    times = times_of(study.plant)
    caption = f"Tip-in, 0 to {times.torque:.4g} N m in {times.ramp:.3g} s, without and with the tuned controller"
    shown = {"open loop": _tip_in(study.plant, None, times), SHOWN: study.shown["nominal"]}
    # a loop calls it so whatever its node is called
    return accelerations(shown, "vehicle", "m/s²", caption)


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
    if not tuned.proof.stable:
        return why_none(tuned)
    reached = tuned.reached
    return (
        f"A controller tuned for this car takes away {100 * reached['oscillation_reduction']:.0f} % of the oscillation of a "
        f"tip-in, at worst {100 * reached['worst_oscillation_reduction']:.0f} % on {several(tuned)}, each of them stable. "
        f"The rise takes {reached['t90_ratio']:.2f} times as long; the disk margin is {reached['disk_margin']:.2f}, at "
        f"worst {reached['worst_disk_margin']:.2f}. {what_is_met(tuned)}"
    )


def _text(subject: Subject, study: _Study) -> list[str]:
    plant = study.plant
    low, high = plant.limits
    text = [
        f"Controllers designed on the two-mass model, judged on the detailed one, {_clutches(plant)}: lag "
        f"{written(plant.lag)}, delay {written(plant.delay)}, sample time {1e3 * plant.dt:g} ms, torque "
        f"{low:g} to {high:g} N m.",
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
    text.append(f"Every requirement is met by {listed(met)}.")
    text += _missed_by_lqg(study.proofs.get("LQG"))
    alone = {name: study.proofs[name] for name in ENGINE_SPEED_DESIGNS if name in study.proofs}
    met = [
        f'"{name}"'
        for name, result in alone.items()
        if result.stable and not requirements_missed(result, ENGINE_SPEED_REQUIREMENTS)
    ]
    if alone:
        text.append(f"The requirements for designs that read the engine speed only are met by {listed(met)}.")
    unstable = [name for name, result in study.proofs.items() if not result.stable]
    for name in unstable:
        where = unstable_on(study.proofs[name])
        text.append(f'"{name}" is unstable on {where}: the second mode, which no two-mass model has.')
    text.append("Not covered: tyre slip, torque ripple, a varying sample time.")
    return text


def _definitions(subject: Subject, study: _Study) -> list[str]:
    times, rise = (
        times_of(study.plant),
        ", of which the wanted rise has about 0.7 m/s^1.75" if subject.is_source else "",
    )
    text = [
        f"The tip-in is a ramp of the demand from 0 to {times.torque:.4g} N m in {1e3 * times.ramp:.4g} ms, "
        "the wheel disturbance a half-sine of "
        "100 ms and 800 N m at the wheels in steady driving. Oscillation is the highest peak of the vehicle acceleration "
        "minus the lowest trough after it, overshoot what exceeds the final value, both over that; t90 the time "
        "to 90 %. VDV is that of the acceleration from 1 to 10 Hz in the "
        f"{times.end - times.start:.3g} s after the start{rise}. "
        "The disturbance counts by the RMS acceleration from 50 ms after the pulse on. "
        "Zeta is that of the poles the first and second mode become, or of slower damped ones near them; the disk "
        "margin the balanced one at the plant input.",
    ]
    if subject.is_source:
        text.append(
            f'"{SHOWN}" was tuned on the nominal plant and eight others; plain ones were chosen by hand, that of the '
            "wheel speed on several cars, the others are the best of 400 random candidates on 8 plants."
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


# --- tables


def _nominal_table(study: _Study) -> Table:
    headers = (
        "design",
        "oscillation less [%]",
        "overshoot [%]",
        "peak jerk [m/s³]",
        "VDV [m/s^1.75]",
        "t90 ratio",
        "zeta first",
        "zeta second",
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
        "zeta first",
        "zeta second",
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
    caption = f"The same designs, worst of {len(study.plants)} plants: one change at a time, corners, a hidden case"
    return Table(caption, headers, rows)


def _play_table(study: _Study) -> Table | None:
    """Tip-ins out of overrun through play in series with the softest shaft, exact; None where it is not one, or no car."""
    car = as_driveline(study.plant.car)
    names = softest_shafts(car)
    shaft = car[names[0]]
    is_car = study.plant.vehicle in car.translating
    if not is_car or len(names) > 1 or not isinstance(shaft, SpringDamper) or not shaft.stiffness:
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
    headers = ["half gap [deg]", *(f"{name}, {which}" for name in what for which in ("open", "tuned"))]
    caption = (
        f"Tip-in from {overrun:.4g} to {times.torque:.4g} N m in {times.ramp:.3g} s through play in series with "
        f"{shaft.name}"
    )
    return Table(caption, headers, rows)


def _requirements_table() -> Table:
    headers = ("quantity", "nominal", ONE_AT_A_TIME, CORNERS, "all plants")
    asked: dict[str, dict[str, str]] = {}
    for each in REQUIREMENTS:
        asked.setdefault(each.name, {})[each.among] = each.text
    for each in ENGINE_SPEED_REQUIREMENTS:
        asked.setdefault(f"{each.name}, engine speed only", {})[each.among] = each.text
    columns = ("nominal", ONE_AT_A_TIME, CORNERS, "all")
    rows = [[name, *(limits.get(among, "") for among in columns)] for name, limits in asked.items()]
    return Table("What is required of the source's car, besides stability on all", headers, rows)


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
    pictures.append(Picture("antijerk_tip_in", "Tip-in, open loop against tuned", figure))

    figure = new_figure(6.4, 4.2)
    plots.pareto(study.tuned, figure.subplots())
    caption = "Candidates of the search that keep the disk margin: oscillation left against rise time"
    pictures.append(Picture("antijerk_pareto", caption, figure))

    beside = [name for name in BESIDE if name in study.proofs]
    margins = {name: study.proofs[name]["nominal"].margins for name in (SHOWN, *beside)}
    figure = new_figure(6.2, 5.6)
    plots.pole_map({"open loop": loop_margins(plant, None), **margins}, figure.subplots())
    pictures.append(Picture("antijerk_poles", "Poles of the sampled loops, upper half plane", figure))

    figure = new_figure(6.4, 5.2)
    plots.nyquist({name: margins[name] for name in (SHOWN, *beside[-1:])}, figure.subplots())
    caption = "Loop gain at the plant input, and the disk it touches"
    pictures.append(Picture("antijerk_nyquist", caption, figure))

    proven = study.proofs[SHOWN]
    figure = new_figure(7.4, 6.8)
    plots.robust_spread(proven, figure.subplots(1, 4, sharey=True), REQUIREMENTS if subject.is_source else ())
    caption = "Tuned, on every plant; diamond: worst, grey line: nominal, dashed: required"
    pictures.append(Picture("antijerk_spread", caption, figure))

    figure = new_figure(6.8, 3.6)
    final = {name: times.torque * each.final_acceleration for name, each in study.plants.items()}
    ax = figure.subplots()
    plots.robust_responses(study.shown, ax, final, proven.worst("oscillation_reduction")[0])
    ax.set_xlim(*window)
    pictures.append(Picture("antijerk_responses", "Tip-in, tuned, on every plant", figure))

    figure = new_figure(7.4, 4.4)
    points = {
        name: result["nominal"].metrics for name, result in study.proofs.items() if result["nominal"].margins.stable
    }
    plots.trade_off(points, study.slower, figure.subplots())
    caption = "Overshoot against rise time, also of a slower pedal, with the length of its ramp"
    pictures.append(Picture("antijerk_trade_off", caption, figure))

    if len(as_driveline(plant.car).clutches) == 1 and subject.is_source:
        figure = new_figure(6.8, 6.6)
        responses = {"open loop": controlled_launch(plant, None), SHOWN: controlled_launch(plant, controller)}
        axes = figure.subplots(3, sharex=True)
        axes[0].set_xlim(1.4, 3.5)
        plots.controlled_launch(responses, plant.ratio, axes, plant.engine, plant.wheels[0], plant.vehicle)
        caption = "Race start at the largest torque, tuned from lock on"
        pictures.append(Picture("antijerk_launch", caption, figure))
    return pictures
