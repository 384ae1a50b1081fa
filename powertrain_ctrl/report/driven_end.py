"""The section on anti-jerk control of what is no car: how well the actuator damps the end that it drives."""

from __future__ import annotations

from .. import plots
from ..antijerk import Tuned, tune
from ..base.tables import words
from ..hybrid.signals import ramp
from ..sampled.actuator import written
from ..sampled.loop import closed_loop
from ..sampled.margins import LoopMargins, loop_margins
from ..sampled.plant import SampledPlant
from ..studies import wheel_disturbance
from ..studies.times import times_of
from .required import UNDAMPED, several, what_is_met, why_none
from .subject import Finding, Picture, Section, Table, new_figure, under
from .verdict import accelerations

# What is required besides margins: the first mode half as much again damped as alone, and both what a change of torque
# and what a push at the driven end make swing halved, on every plant. No driver feels a tip-in here.
DAMPED, HALVED = 1.5, 0.5
REQUIRED = dict.fromkeys(
    ("oscillation_reduction", "worst_oscillation_reduction", "worst_disturbance_reduction"), HALVED
)
# A push at the driven end by this share of the torque that reaches it; large ones meet the limits.
PUSH = 0.1
UNIT = "rad/s²"
TUNED = "tuned"


def driven_end_section(title: str, plant: SampledPlant, is_stated: bool) -> Section:
    """Stability, margins and damping of a controller tuned for a plant, of which the user has ``stated`` what drives it."""
    if not is_stated:
        need = (
            "a table [plant] in its file says what drives it, how fast and how hard, and a controller is tuned for that"
        )
        return Section(title, [f"Not shown: the driveline is no car; {need}."])
    alone = loop_margins(plant, None)
    if not alone.stable:
        return Section(title, [UNDAMPED])
    tuned = tune(plant, requirements={**REQUIRED, "zeta_first": min(round(DAMPED * alone.zeta_first, 3), 1.0)})
    caption = "What is required of a controller tuned for this driveline, and what it reaches"
    tables = under("Requirements", [Table(caption, tuned.headers, tuned.rows())])
    if not tuned.proof.stable:
        return Section(title, [why_none(tuned)], tables=tables)
    caption = "The tuned controller on every plant: the same one, each against its own open loop"
    one = "The tuned controller"
    return Section(
        title,
        [verdict(plant, alone, tuned), _actuator(plant)],
        _definitions(plant),
        tables + under(one, [Table(caption, tuned.proof.headers, tuned.proof.rows())]),
        under(one, _pictures(plant, alone, tuned)),
        _findings(alone, tuned),
        _highlight(plant, tuned),
    )


def verdict(plant: SampledPlant, alone: LoopMargins, tuned: Tuned) -> str:
    """What comes first: stable everywhere, with which margin, and how the driven end is damped."""
    proof, reached = tuned.proof, tuned.reached
    return (
        f"A controller of the torque at the {words(plant.engine)}, tuned for this driveline, is stable on {several(tuned)}. "
        f"The disk margin is {reached['disk_margin']:.2f}, at worst {reached['worst_disk_margin']:.2f}. At the driven end, "
        f"the {words(plant.vehicle)}, the first mode is damped by ζ = {tuned.margins.zeta_first:.3f} instead of "
        f"{alone.zeta_first:.3f}, at worst by {proof.worst('zeta_first')[1]:.3f}; of a push there "
        f"{100 * proof['nominal'].disturbance_reduction:.0f} % less is left, at worst "
        f"{100 * reached['worst_disturbance_reduction']:.0f} %. {what_is_met(tuned)}"
    )


def _actuator(plant: SampledPlant) -> str:
    low, high = plant.limits
    return (
        f"The torque acts with a lag of {written(plant.lag)} and a delay of {written(plant.delay)}; it is sampled every "
        f"{1e3 * plant.dt:g} ms, from {low:g} to {high:g} N m."
    )


def _definitions(plant: SampledPlant) -> list[str]:
    times = times_of(plant)
    return [
        f"The change of torque is a ramp of the demand from 0 to {times.torque:.0f} N m in {1e3 * times.ramp:.4g} ms, the "
        f"push a half-sine of 100 ms at the {words(plant.vehicle)}. Oscillation is the highest peak of its acceleration "
        "minus the lowest trough after it, over the final value; t90 the time to 90 % of that. The push counts by the RMS "
        "acceleration from 50 ms after it on. Zeta is that of the poles the first and second mode become, or of slower "
        "damped ones near them; the disk margin the balanced one at the plant input.",
    ]


def _findings(alone: LoopMargins, tuned: Tuned) -> list[Finding]:
    proofs = tuned.proof.proofs.values()
    stable = sum(proof.margins.stable for proof in proofs)
    return [
        Finding(
            f"{alone.zeta_first:.3f} → {tuned.margins.zeta_first:.3f}", "damping ratio of the first mode, tuned", 1
        ),
        Finding(f"{stable} of {len(proofs)}", "plants on which the tuned controller is stable", 1),
    ]


def _highlight(plant: SampledPlant, tuned: Tuned) -> Picture:
    times = times_of(plant)
    shown = {
        name: closed_loop(plant, each, ramp(times.start, times.ramp, times.torque), times.end)
        for name, each in (("open loop", None), (TUNED, tuned.controller))
    }
    caption = (
        f"A change of torque, 0 to {times.torque:.0f} N m in {times.ramp:.3g} s, without and with the tuned controller"
    )
    return accelerations(shown, plant.vehicle, UNIT, caption, signal="vehicle_acceleration")


def _pictures(plant: SampledPlant, alone: LoopMargins, tuned: Tuned) -> list[Picture]:
    times, load = times_of(plant), words(plant.vehicle)
    torque = PUSH * abs(times.torque * plant.ratio)
    pushed = {
        name: wheel_disturbance(plant, each, torque, duration=times.end)
        for name, each in (("open loop", None), (TUNED, tuned.controller))
    }
    figure = new_figure(6.8, 7.6)
    plots.tip_in(pushed, figure.subplots(4, sharex=True, height_ratios=(4, 4, 3, 3)), plant.vehicle, UNIT)
    pictures = [Picture("antijerk_push", f"A push of {torque:.0f} N m at the {load}, open loop against tuned", figure)]

    figure = new_figure(6.2, 5.6)
    plots.pole_map({"open loop": alone, TUNED: tuned.margins}, figure.subplots())
    pictures.append(Picture("antijerk_poles", "Poles of the sampled loop, upper half plane", figure))

    figure = new_figure(6.4, 5.2)
    plots.nyquist({TUNED: tuned.margins}, figure.subplots())
    pictures.append(Picture("antijerk_nyquist", "Loop gain at the plant input, and the disk it touches", figure))

    figure = new_figure(7.4, 6.8)
    plots.robust_spread(tuned.proof, figure.subplots(1, 4, sharey=True))
    caption = "Tuned, on every plant; diamond: worst, grey line: nominal"
    pictures.append(Picture("antijerk_spread", caption, figure))
    return pictures
