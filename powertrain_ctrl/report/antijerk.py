"""The report's section on anti-jerk control: every design on the nominal plant and on its variations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import control
import numpy as np

from .. import plots
from ..antijerk import designs
from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
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
from ..studies.trials import TORQUE
from .subject import Finding, Picture, Section, Subject, Table, new_figure, under
from .verdict import accelerations

# The design that is shown, and others beside it in the pole map and the Nyquist diagram.
SHOWN, BESIDE = "proven", ("P", "LQG", "H-infinity")
# Figures that compare designs.
ABOUT_EVERY = ("antijerk_trade_off", "antijerk_poles", "antijerk_nyquist")
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
    every, one = "Every design", f'"{SHOWN}"'
    if subject.is_source:
        tables = under("Requirements", [_requirements_table()])
        tables += under(every, [_nominal_table(study), _worst_table(study)])
    else:
        proven = study.proofs[SHOWN]
        caption = f"{one} on every plant: same fixed controller, each against its own open loop"
        tables = under(every, [_nominal_table(study)]) + under(one, [Table(caption, proven.headers, proven.rows())])
    if play := _play_table(study):
        tables += under(one, [play])
    drawn = _pictures(subject, study)
    pictures = under(every, [p for p in drawn if p.name in ABOUT_EVERY]) + under(
        one, [p for p in drawn if p.name not in ABOUT_EVERY]
    )
    text, definitions = _text(subject, study), _definitions(subject, study)
    return Section(title, text, definitions, tables, pictures, _findings(study), _highlight(study))


def _findings(study: _Study) -> list[Finding]:
    proven, best = study.proofs[SHOWN], study.proofs[SHOWN]["nominal"]
    stable = sum(proof.margins.stable for proof in proven.proofs.values())
    found = [Finding(f"{stable} of {len(proven.proofs)}", f'plants on which the controller "{SHOWN}" is stable', 1)]
    if best.margins.stable:
        less = 100.0 * best.oscillation_reduction
        found.insert(0, Finding(f"{less:.0f} %", f'less oscillation after a tip-in with the controller "{SHOWN}"', 1))
    return found


def _highlight(study: _Study) -> Picture:
    caption = f'Tip-in, 0 to {TORQUE:g} N m in 0.1 s, without and with the anti-jerk controller "{SHOWN}"'
    shown = {"open loop": tip_in(study.plant), SHOWN: study.shown["nominal"]}
    return accelerations(shown, study.plant.vehicle, "m/s²", caption)


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
    low, high = plant.torque_limits
    text = [
        f"Controllers designed on the two-mass model, judged on the detailed one, {_clutches(plant)}: torque lag "
        f"{1e3 * plant.lag:g} ms, pure delay {1e3 * plant.delay:g} ms, sample time {1e3 * plant.dt:g} ms, torque "
        f"{low:g} to {high:g} N m, engine and wheel speed measured; exact between the samples.",
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
    text.append(f"Every requirement is met by {_listed(met)}.")
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
    text.append("Not covered: tyre slip, torque ripple of combustion, a sample time that varies.")
    return text


def _definitions(subject: Subject, study: _Study) -> list[str]:
    rise = " but about 0.7 m/s^1.75" if subject.is_source else ""
    text = [
        f"The tip-in is a ramp of the demand from 0 to {TORQUE:g} N m in 100 ms, the wheel disturbance a half-sine of "
        "100 ms and 800 N m at the wheels in steady driving. Oscillation is the highest peak of the vehicle acceleration "
        "minus the lowest trough after it, overshoot what is above the final value, both over that value; t90 is the time "
        "to 90 % of it. VDV is that of the acceleration from 1 to 10 Hz in the 3.5 s after the start; with the wanted rise "
        f"in it, it is never 0{rise}. The disturbance counts by the RMS of the acceleration from 50 ms after the pulse on. "
        "Zeta is that of the poles that the first and second mode become, or of slower damped ones near them; the disk "
        "margin is the balanced one at the plant input.",
    ]
    if subject.is_source:
        text.append(
            f'"P" to "{SHOWN}" were tuned by hand, with plants such as these in view. The last five are the best of 400 '
            "random candidates each on 8 plants inside the tolerances, none of them among these "
            f"{len(study.plants)}; those that read the engine speed alone were not scored by damping and disturbance."
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
    limits = (min(OVERRUN, study.plant.torque_limits[0]), study.plant.torque_limits[1])
    for half in HALF_GAPS:
        gap = max(2.0 * np.deg2rad(half), 1e-9)
        play = Backlash(shaft.name, shaft.a, shaft.b, gap=gap, stiffness=shaft.stiffness, damping=shaft.damping)
        changed = Driveline(*(play if e is shaft else e for e in car))
        changed = changed.release(*car.released) if car.released else changed
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
    plots.robust_spread(proven, figure.subplots(1, 4, sharey=True), REQUIREMENTS if subject.is_source else ())
    caption = f'"{SHOWN}" on every plant; diamond: worst, grey line: nominal, dashed: required'
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
