"""Characteristics of elements: torque over twist or slip."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..elements import Element, Law, TorqueConverter
from .style import COLOURS, grid, new_axes, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Twists beyond the outermost knots are shown by this part of the span between them.
BEYOND = 0.05
# Torque converters are shown at this speed of the pump [rad/s], in overrun up to this speed ratio.
PUMP, OVERRUN = 100.0, 1.2
# Gears with losses are shown up to this torque [N m] on either side.
CARRIED = 100.0


@checked
def characteristic(element: Element, ax: Axes | None = None) -> Axes:
    """Torque of an element over its twist, or over its slip where it has no twist.

    Springs are drawn at rest, friction beside them as the band between turning forward and backward; clutches are drawn
    with their ``max_torque``, torque converters over the speed ratio, at 100 rad/s of the pump, gears with losses over the
    torque that goes through them, turning forward and backward.

    Parameters
    ----------
    element : Element
        One with a law: a `Backlash`, a `MultiStageSpring`, a `Clutch`, a `RoadLoad`, a `SlipTyre` with its speed, ...
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        A linear element, or one whose law has no modes yet.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> ax = pt.plots.characteristic(pt.Backlash("mesh", "a", "b", gap=0.02, stiffness=5e3))
    >>> ax.get_xlabel()
    'twist [rad]'
    """
    laws = [law for law in element.laws if law.modes]
    if not laws:
        raise PowertrainError(f"{element.name} is linear or its speed is not given, permitted: an element with a law")
    ax = new_axes(ax, 1, (5.0, 3.4))[0]
    along_road = element.nodes == element.translating
    if isinstance(element, TorqueConverter):
        _over_ratio(ax, element)
        ax.set_xlabel("speed ratio, turbine over pump [-]")
    elif laws[0].load is not None:
        _over_load(ax, laws[0])
        ax.set_xlabel("torque through it [N m]")
    elif laws[0].has_twist and any(mode.origin is not None for mode in laws[0].modes.values()):
        _over_twist(ax, laws, getattr(element, "twists", ()))
        ax.set_xlabel("twist [rad]")
    else:
        _over_slip(ax, laws)
        ax.set_xlabel("speed [m/s]" if along_road else "slip [rad/s]")
    ax.axhline(0.0, color=shade(0.4), linewidth=0.8, zorder=1)
    ax.axvline(0.0, color=shade(0.4), linewidth=0.8, zorder=1)
    ax.set_ylabel("force [N]" if along_road else "torque [N m]")
    ax.set_title(element.name, fontsize="medium")
    grid(ax, "both")
    return ax


def _over_twist(ax: Axes, laws: list[Law], points: Sequence[float]) -> None:
    spring = laws[0]
    knots = {0.0, *points}
    for mode in spring.modes.values():
        knots |= {abs(g.level / g.twist) * s for g in mode.guards if g.twist for s in (1.0, -1.0)}
        knots |= {mode.origin} if mode.origin is not None else set()
    low, high = min(knots), max(knots)
    span = (high - low) or 1.0
    twist = np.unique([*knots, *np.linspace(low - BEYOND * span, high + BEYOND * span, 401)])
    torque = np.array([_at_rest(spring, float(q)) for q in twist])
    friction = sum(max(abs(mode.torque) for mode in law.modes.values()) for law in laws[1:])
    if friction:
        ax.fill_between(twist, torque - friction, torque + friction, color=COLOURS[5], alpha=0.4, linewidth=0.0)
        ax.plot(twist, torque + friction, color=COLOURS[0], linewidth=0.9, linestyle=":")
        ax.plot(twist, torque - friction, color=COLOURS[0], linewidth=0.9, linestyle=":")
    ax.plot(twist, torque, color=COLOURS[0], linewidth=1.6)


def _over_ratio(ax: Axes, converter: TorqueConverter) -> None:
    ratios = np.unique([*converter.speed_ratios, *np.linspace(0.0, OVERRUN, 241)])
    torques = np.array([converter.torques(PUMP, PUMP * float(ratio)) for ratio in ratios]).T
    for torque, colour, label in zip(torques, COLOURS, ("pump", "turbine"), strict=False):
        ax.plot(ratios, torque, color=colour, linewidth=1.6, label=f"{label}, at {PUMP:g} rad/s of the pump")
    ax.legend(frameon=False, fontsize="small")


def _over_load(ax: Axes, law: Law) -> None:
    for side, colour, word in zip((1.0, -1.0), COLOURS, ("forward", "backward"), strict=False):
        shares = [
            mode.share
            for load in (-1.0, 1.0)
            for mode in law.modes.values()
            if not mode.held and all(g.slip * side + g.load * load > 0.0 for g in mode.guards)
        ]
        loads = np.array([-CARRIED, 0.0, CARRIED])
        ax.plot(loads, [-CARRIED * shares[0], 0.0, CARRIED * shares[1]], color=colour, linewidth=1.6, label=word)
    ax.legend(frameon=False, fontsize="small")


def _at_rest(law: Law, twist: float) -> float:
    number, stretch = law.starting(twist)
    return law.modes[number].stiffness * stretch + law.modes[number].torque


def _over_slip(ax: Axes, laws: list[Law]) -> None:
    """Straight lines between the slips at which modes end; what holds is a vertical line at zero slip."""
    for law in laws:
        capacity = law.max_torque or 0.0
        knots = sorted({abs(g.level) for mode in law.modes.values() for g in mode.guards if g.slip})
        reach = 1.3 * knots[-1] if knots and knots[-1] > 0.0 else 1.0
        for mode in law.modes.values():
            if mode.held or (not mode.guards and len(law.modes) > 1):
                continue
            slips = np.array([-reach, *(-k for k in knots), *knots, reach])
            inside = [s for s in slips if all(g.slip * s + g.level >= -1e-12 * reach for g in mode.guards if g.slip)]
            ends = np.array([min(inside), max(inside)])
            damping = mode.damping + capacity * mode.slope
            if mode.leak and mode.stiffness:
                damping += mode.stiffness / mode.leak
                limits = [g.level / abs(g.stretch) * mode.leak for g in mode.guards if g.stretch]
                ends = np.clip(ends, -min(limits, default=reach), min(limits, default=reach))
            torque = mode.torque + capacity * mode.capacity + damping * ends
            ax.plot(ends, torque, color=COLOURS[0], linewidth=1.6)
        if law.held is not None:
            guards = [g for g in law.modes[law.held].guards if g.torque]
            # without a guard on its side any torque is held
            high, low = (
                max((g.level + capacity * g.capacity for g in guards if g.torque * side < 0.0), default=1.0)
                for side in (1.0, -1.0)
            )
            ax.plot([0.0, 0.0], [-low, high], color=COLOURS[0], linewidth=1.6)
