"""Section on what is not linear: characteristics, a tip-in with and without it, events, and whether it rests."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .. import plots
from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
from ..elements import Element
from ..hybrid.response import Response
from ..hybrid.signals import PiecewiseLinear, ramp, step
from ..hybrid.simulation import simulate
from ..linear.assembly import assemble
from ..plots.style import COLOURS, grid, words
from .subject import Picture, Section, Subject, Table, new_figure

# Torque before and after the tip-in [N m], its start and length [s]; the engine's speed before it [rad/s].
BEFORE, AFTER, START, LENGTH = -30.0, 250.0, 0.2, 0.1
SPEED = 200.0
TIMES = np.linspace(0.0, 2.0, 2001)
# A torque of this height [N m] between these times [s] sets the driveline without load in motion.
PULSE, PULSE_FROM, PULSE_TO = 15.0, 0.2, 0.3
# What swings by less than this share of its highest swing has come to rest.
RESTS = 0.05
SHOWN, EVENTS_SHOWN = 4, 12


def play_section(subject: Subject) -> Section | None:
    car = subject.nonlinear
    if car is None:
        return None
    title = "Play and stages"
    elements = [e for e in car if any(not law.is_clutch for law in e.laws)]
    text = [
        f"Not linear: {', '.join(e.name for e in elements)}. All other sections are about small motion while the engine "
        f"drives, {subject.about}.",
    ]
    # a pendulum has none: it is linear at each speed
    drawn = [e for e in elements if any(law.modes for law in e.laws)]
    figures = [_characteristics(drawn)] if drawn else []
    if why := subject.why_no_response():
        return Section(title, [*text, f"A tip-in is not shown: {why}."], pictures=figures)
    torque = f"{subject.driving}_torque"
    demand = ramp(START, LENGTH, AFTER, BEFORE)
    try:
        real = _run(subject, car, {torque: demand}, {torque: BEFORE})
        linear = _run(subject, subject.car, {torque: demand}, {torque: BEFORE})
        still = _run(subject, car, {torque: step(PULSE_FROM, PULSE) + step(PULSE_TO, -PULSE)}, {})
    except PowertrainError as error:
        return Section(title, [*text, f"A tip-in is not shown: {error}."], pictures=figures)
    text.append(
        f"Tip-in: the {words(subject.driving)} turns with {SPEED:g} rad/s under {BEFORE:g} N m, all springs and play as in "
        f"steady motion; from {START:g} s its torque rises to {AFTER:g} N m in {LENGTH:g} s. Motion and events are exact."
    )
    text.append(_rest(subject, still))
    shown = [e for e in elements if f"{e.name}_torque" in linear.outputs]
    tables = [_peaks(shown, real, linear), _events(real)]
    figures.append(_tip_in(subject, shown, real, linear))
    return Section(title, text, tables=tables, pictures=figures)


def _run(
    subject: Subject, car: Driveline, inputs: Mapping[str, PiecewiseLinear], load: Mapping[str, float]
) -> Response:
    model = assemble(subject.responding)
    motion = dict(zip(model.nodes, model.rigid_motion.tolist(), strict=True))
    speed = {node: SPEED * motion[node] / motion[subject.driving] for node in car.nodes if node in motion}
    try:
        return simulate(car, TIMES, inputs, speed, initial_load=load)
    except PowertrainError:  # what creeps under a load has no steady motion at these speeds
        return simulate(car, TIMES, inputs, speed)


def _characteristics(elements: list[Element]) -> Picture:
    drawn = elements[:SHOWN]
    figure = new_figure(6.8, 2.9 * -(-len(drawn) // 2))
    axes = np.atleast_1d(figure.subplots(-(-len(drawn) // 2), min(2, len(drawn)))).ravel()
    for element, ax in zip(drawn, axes, strict=False):
        plots.characteristic(element, ax)
    for ax in axes[len(drawn) :]:
        ax.set_visible(False)
    return Picture("characteristics", "Characteristics", figure)


def _tip_in(subject: Subject, shown: list[Element], real: Response, linear: Response) -> Picture:
    signals = [f"{element.name}_torque" for element in shown[:2]] + [f"{subject.vehicle}_acceleration"]
    figure = new_figure(6.8, 1.2 + 2.0 * len(signals))
    axes = np.atleast_1d(figure.subplots(len(signals), sharex=True))
    for ax, name in zip(axes, signals, strict=True):
        ax.plot(linear.time, linear[name], color=COLOURS[1], linewidth=1.2, linestyle="--", label="linear")
        ax.plot(real.time, real[name], color=COLOURS[0], linewidth=1.4, label="as it is")
        unit = "N m" if name.endswith("_torque") else subject.unit
        ax.set_ylabel(f"{words(name)} [{unit}]")
        grid(ax, "both")
    axes[0].legend(frameon=False, fontsize="small")
    axes[-1].set_xlabel("time [s]")
    return Picture("play_tip_in", "Tip-in with play and stages, and about the operating point", figure)


def _peaks(shown: list[Element], real: Response, linear: Response) -> Table:
    rows = []
    for element in shown:
        name = f"{element.name}_torque"
        peak, other = (float(np.abs(response[name]).max()) for response in (real, linear))
        heat = real.slip_energy.get(element.name)
        rows.append([element.name, f"{peak:.1f}", f"{other:.1f}", "–" if heat is None else f"{heat:.2f}"])
    headers = ("element", "largest torque [N m]", "linear [N m]", "heat [J]")
    return Table("Tip-in, largest torques and heat", headers, rows)


def _events(real: Response) -> Table:
    rows = [[f"{e.time:.6f}", e.element, e.kind, str(e.mode)] for e in real.events[:EVENTS_SHOWN]]
    if len(real.events) > EVENTS_SHOWN:
        rows.append(["…", "", f"{len(real.events) - EVENTS_SHOWN} more", ""])
    return Table(f"Tip-in, {len(real.events)} events", ("t [s]", "element", "event", "mode"), rows)


def _rest(subject: Subject, still: Response) -> str:
    signal: Any = still[f"{subject.vehicle}_acceleration"]
    whole, last = np.ptp(signal[still.time > PULSE_TO]), np.ptp(signal[still.time > still.time[-1] - 0.5])
    what = "no limit cycle" if last <= RESTS * whole else "it still swings"
    return (
        f"Without load a torque of {PULSE:g} N m for {PULSE_TO - PULSE_FROM:g} s leaves a vehicle acceleration of "
        f"{last:.3g} {subject.unit} peak to peak in the last half second of {still.time[-1]:g} s, of {whole:.3g} at most: "
        f"{what}."
    )
