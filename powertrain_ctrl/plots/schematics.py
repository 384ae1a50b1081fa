"""Schematic of a driveline: bodies, springs, dampers, gears, clutches and tyres as they are connected."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.doors import checked
from ..base.tables import number, words
from ..driveline.collection import Driveline, HasDriveline
from ..elements import (
    Backlash,
    Compliance,
    Constraint,
    Differential,
    Element,
    Gear,
    Inertia,
    Mass,
    MultiStageSpring,
    OneWayClutch,
    Pendulum,
    Shaft,
    SpeedCoupling,
    SpringDamper,
    TorqueConverter,
    Tyre,
)
from ..linear.assembly import as_driveline
from .style import COLOURS, new_axes, shade

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Inches for a column and for a row of nodes.
COLUMN, ROW = 1.0, 1.7
# By so much of a row a second element between the same nodes is drawn below the first.
BESIDE = 0.45
LINE: dict[str, Any] = {"linewidth": 1.0, "solid_joinstyle": "round", "solid_capstyle": "round"}
SMALL: dict[str, Any] = {"fontsize": 6.5, "ha": "center", "linespacing": 1.05}


class _Place(NamedTuple):
    x: float
    y: float


@checked
def schematic_size(car: HasDriveline) -> tuple[float, float]:
    """Width and height [in] at which the labels of `schematic` have room.

    Parameters
    ----------
    car : Driveline or TwoMass

    Returns
    -------
    (float, float)

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.plots.schematic_size(pt.two_mass(pt.examples.conventional(), "source"))
    (4.0, 1.7)
    """
    places = _places(as_driveline(car)).values()
    return COLUMN * (1.0 + max(p.x for p in places)), ROW * (1.0 + max(p.y for p in places) - min(p.y for p in places))


@checked
def schematic(car: HasDriveline, ax: Axes | None = None) -> Axes:
    """Bodies and what connects them, with inertias, stiffnesses and ratios, as in Figs. 2.6, 2.8, 2.10 and 2.12.

    Parameters
    ----------
    car : Driveline or TwoMass
        Physical, or from `reflected` with its ratios incorporated. An open clutch is drawn open.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> ax = pt.plots.schematic(pt.reflected(pt.examples.conventional()))
    >>> "differential" in [text.get_text() for text in ax.texts]
    True
    """
    car = as_driveline(car)
    ax = new_axes(ax, 1, schematic_size(car))[0]
    places = _places(car)
    degree = _degree(car)
    for node in car.nodes:
        if node not in _taps(car):
            _draw_node(ax, car, node, places[node], is_end=degree[node] == 1)
    held, between = set(), Counter[frozenset[str]]()
    for element in car:
        ends = sorted(element.nodes, key=lambda node: places[node])
        if isinstance(element, Inertia | Mass):
            continue
        if len(ends) == 1:
            held.add(ends[0])
            _ground(ax, element, places[ends[0]])
        elif len(ends) == 2:
            a, b = (places[node] for node in ends)
            row = a.y if degree[ends[0]] <= degree[ends[1]] else b.y
            row -= BESIDE * between[frozenset(ends)]
            between[frozenset(ends)] += 1
            _link(ax, element, a, b, row, element.name in car.released, is_turned=ends[0] != element.nodes[0])
        elif tapped := [node for node in ends if node in _taps(car)]:
            _tap(ax, tapped[0], places[tapped[0]])
        else:
            _joint(ax, element, [places[node] for node in ends])
    heights = [p.y for p in places.values()]
    ax.set_xlim(-0.5, 0.5 + max(p.x for p in places.values()))
    beside = BESIDE * (max(between.values(), default=1) - 1)
    ax.set_ylim(min(heights) - max(0.5 + 0.15 * bool(held), 0.4 + beside), max(heights) + 0.5)
    ax.set_axis_off()
    return ax


def _degree(car: Driveline) -> Counter[str]:
    """How many elements each node belongs to."""
    return Counter(node for element in car for node in element.nodes)


def _taps(car: Driveline) -> dict[str, tuple[str, ...]]:
    """Nodes that a constraint only reads off others, such as the wheel of a two-mass model, and these others."""
    degree = _degree(car)
    found: dict[str, tuple[str, ...]] = {}
    for element in car:
        if isinstance(element, Constraint) and len(element.nodes) > 2:
            read = [node for node in element.nodes if node not in car and degree[node] == 1]
            found |= {node: tuple(n for n in element.nodes if n != node) for node in read[:1]}
    return found


def _places(car: Driveline) -> dict[str, _Place]:
    """Column by distance from the first node of each part, row by branch."""
    taps = _taps(car)
    links = [element.nodes for element in car if len(element.nodes) > 1 and not taps.keys() & set(element.nodes)]
    children: dict[str, list[str]] = {node: [] for node in car.nodes}
    column: dict[str, int] = {}
    roots = []
    for root in car.nodes:
        if root in column or root in taps:
            continue
        roots.append(root)
        column[root] = 0
        border = [root]
        while border:
            node = border.pop(0)
            for other in (n for nodes in links if node in nodes for n in nodes):
                if other not in column:
                    column[other] = column[node] + 1
                    children[node].append(other)
                    border.append(other)
    places: dict[str, _Place] = {}
    free_row = 0.0

    def lay(node: str) -> float:
        nonlocal free_row
        rows = [lay(child) for child in children[node]]
        if not rows:
            rows = [free_row]
            free_row -= 1.0
        places[node] = _Place(float(column[node]), 0.5 * (rows[0] + rows[-1]))
        return places[node].y

    for root in roots:
        lay(root)
    for node in sorted(places, key=lambda node: places[node].x):
        before = [places[n].y for nodes in links if node in nodes for n in nodes if column[n] == column[node] - 1]
        if len(set(before)) > 1 and not children[node]:  # where branches meet again
            places[node] = _Place(places[node].x, sum(before) / len(before))
    for node, others in taps.items():
        x, y = np.mean([places[other] for other in others], axis=0)
        places[node] = _Place(float(x), float(y))
    return places


def _draw_node(ax: Axes, car: Driveline, node: str, at: _Place, is_end: bool) -> None:
    from matplotlib.patches import Rectangle

    body, name = car[node] if node in car else None, words(node).replace(" ", "\n")
    if not isinstance(body, Inertia | Mass):
        ax.plot(at.x, at.y, marker="o", markersize=2.5, color=shade(0.15))
        if is_end:
            ax.text(at.x, at.y + 0.08, name, va="bottom", **SMALL)
        return
    width, height = (0.26, 0.30) if isinstance(body, Mass) else (0.16, 0.44)
    face = "#F7C873" if isinstance(body, Mass) else "#9CD0EE"
    corner = (at.x - 0.5 * width, at.y - 0.5 * height)
    ax.add_patch(Rectangle(corner, width, height, facecolor=face, edgecolor=shade(0.15), linewidth=1.0, zorder=3))
    value = f"{number(body.m)} kg" if isinstance(body, Mass) else f"{number(body.J)} kg m²"
    behind = {"facecolor": ax.get_facecolor(), "edgecolor": "none", "pad": 0.8}
    ax.text(at.x, at.y + 0.25, name, va="bottom", bbox=behind, **SMALL)
    ax.text(at.x, at.y - 0.32, value, va="top", bbox=behind, **SMALL)


def _link(ax: Axes, element: Element, a: _Place, b: _Place, row: float, is_open: bool, is_turned: bool) -> None:
    """Element between two nodes in a row, its name above and its value below; a slanted line leads to another row."""
    bend = 0.25
    start, stop = a.x + bend * (a.y != row), b.x - bend * (b.y != row)
    middle, half = 0.5 * (start + stop), 0.20
    symbol, value = _symbol(element, is_open)
    curves = [[(start, row), (middle - half, row)], [(middle + half, row), (stop, row)]]
    curves += [[(a.x, a.y), (start, row)]] if a.y != row else []
    curves += [[(stop, row), (b.x, b.y)]] if b.y != row else []
    along = -1.0 if is_turned and symbol in (_one_way, _play) else 1.0
    curves += [[(middle + along * x, row + y) for x, y in points] for points in symbol(half)]
    for points in curves:
        ax.plot(*np.transpose(points), color=shade(0.15), **LINE)
    name = words(element.name).replace(" ", "\n")
    if isinstance(element, Tyre):
        name += f"\nr = {element.radius:.4g} m"
    if isinstance(element, Backlash):
        name += f"\n{element.gap:.3g} rad"
    ax.text(middle, row + 0.14, name, va="bottom", color=shade(0.35), **SMALL)
    ax.text(middle, row - 0.15, value, va="top", color=shade(0.35), **SMALL)


def _symbol(element: Element, is_open: bool) -> tuple[Callable[[float], list], str]:
    if isinstance(element, Gear):
        return _gear, f"i = {element.ratio:.4g}"
    for law in element.laws:
        if law.is_clutch:
            return (_open_clutch if is_open else _clutch), f"{law.max_torque:.4g} N m" * (law.signal == "capacity")
    if isinstance(element, OneWayClutch):
        return _one_way, ""
    if isinstance(element, TorqueConverter | SpeedCoupling):
        return _converter, ""
    if isinstance(element, Backlash):
        return _play, f"{number(element.stiffness)}\nN m/rad"
    if isinstance(element, MultiStageSpring):
        return _spring, f"{len(element.twists) - 1} stages"
    if isinstance(element, SpringDamper | Shaft | Compliance | Tyre):
        if element.stiffness is None:
            return _rigid, "rolls rigidly"
        k, d = ("N/m", "N s/m") if isinstance(element, Tyre) else ("N m/rad", "N m s/rad")
        if not element.stiffness:
            return _damper, f"{number(element.damping)}\n{d}"
        return (_spring_and_damper if element.damping else _spring), f"{number(element.stiffness)}\n{k}"
    return _rigid, ""


def _zigzag(half: float, at: float) -> list:
    teeth = np.linspace(-0.7 * half, 0.7 * half, 8)
    side = [0.0, *(0.055 * (-1.0) ** i for i in range(6)), 0.0]
    return [(-half, at), *((x, at + y) for x, y in zip(teeth, side, strict=True)), (half, at)]


def _dashpot(half: float, at: float) -> list:
    cup = [(0.05, at + 0.05), (-0.07, at + 0.05), (-0.07, at - 0.05), (0.05, at - 0.05)]
    return [[(-half, at), (-0.07, at)], cup, [(0.01, at + 0.035), (0.01, at - 0.035)], [(0.01, at), (half, at)]]


def _spring(half: float) -> list:
    return [_zigzag(half, 0.0)]


def _damper(half: float) -> list:
    return _dashpot(half, 0.0)


def _spring_and_damper(half: float) -> list:
    ends = [[(side * half, -0.07), (side * half, 0.06)] for side in (-1.0, 1.0)]
    return [_zigzag(half, 0.06), *_dashpot(half, -0.07), *ends]


def _rigid(half: float) -> list:
    return [[(-half, 0.0), (half, 0.0)]]


def _one_way(half: float) -> list:
    """Points the way in which it drives."""
    arrow = [(-0.06, 0.09), (-0.06, -0.09), (0.06, 0.0), (-0.06, 0.09)]
    return [[(-half, 0.0), (-0.06, 0.0)], arrow, [(0.06, 0.09), (0.06, -0.09)], [(0.06, 0.0), (half, 0.0)]]


def _converter(half: float) -> list:
    """Two shells that face each other."""
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 13)
    shells = [[(side * (0.02 + 0.1 * np.cos(a)), 0.12 * np.sin(a)) for a in angle] for side in (-1.0, 1.0)]
    rims = [[(side * 0.02, -0.12), (side * 0.02, 0.12)] for side in (-1.0, 1.0)]
    return [*shells, *rims, *([(side * 0.12, 0.0), (side * half, 0.0)] for side in (-1.0, 1.0))]


def _play(half: float) -> list:
    """A spring that ends in a fork, and what moves freely between its prongs."""
    spring = [(0.5 * (x - half) + 0.01, y) for x, y in _zigzag(half, 0.0)]
    fork = [[(0.02, 0.0), (0.02, side * 0.09), (0.14, side * 0.09), (0.14, side * 0.035)] for side in (-1.0, 1.0)]
    return [[(-half, 0.0), spring[0]], spring, *fork, [(0.08, 0.045), (0.08, -0.045)], [(0.08, 0.0), (half, 0.0)]]


def _gear(half: float) -> list:
    def wheel(x: float, radius: float) -> list[tuple[float, float]]:
        return [(x - 0.03, -radius), (x + 0.03, -radius), (x + 0.03, radius), (x - 0.03, radius), (x - 0.03, -radius)]

    return [[(-half, 0.0), (-0.06, 0.0)], wheel(-0.03, 0.05), wheel(0.03, 0.11), [(0.06, 0.0), (half, 0.0)]]


def _plates(half: float, gap: float) -> list:
    plates = [[(side * gap, -0.10), (side * gap, 0.10)] for side in (-1.0, 1.0)]
    return [*plates, *([(side * gap, 0.0), (side * half, 0.0)] for side in (-1.0, 1.0))]


def _clutch(half: float) -> list:
    return _plates(half, 0.012)


def _open_clutch(half: float) -> list:
    return _plates(half, 0.06)


def _ground(ax: Axes, element: Element, at: _Place) -> None:
    """Element between a node and ground, hung below it; a pendulum hangs free."""
    low = at.y - 0.5
    ax.plot([at.x, at.x], [at.y, low], color=shade(0.15), zorder=0.5, **LINE)
    if isinstance(element, Pendulum):
        ax.plot(at.x, low, marker="o", markersize=7, markerfacecolor="#9CD0EE", markeredgecolor=shade(0.15))
    else:
        ax.plot([at.x - 0.07, at.x + 0.07], [low, low], color=shade(0.15), **(LINE | {"linewidth": 1.8}))
    ax.text(at.x, low - 0.03, words(element.name), va="top", color=shade(0.35), **SMALL)


def _tap(ax: Axes, node: str, at: _Place) -> None:
    """Node in the middle of an element whose motion is read off both its ends."""
    ax.plot([at.x, at.x], [at.y + 0.14, at.y - 0.14], color=COLOURS[2], linewidth=1.0, linestyle=":", zorder=4)
    ax.text(at.x, at.y + 0.36, words(node), va="bottom", color=COLOURS[2], **SMALL)


def _joint(ax: Axes, element: Element, ends: list[_Place]) -> None:
    """Element that joins three or more nodes: a circle with a line to each."""
    centre = np.mean(ends, axis=0)
    for end in ends:
        ax.plot([centre[0], end.x], [centre[1], end.y], color=shade(0.5), zorder=0.5, **LINE)
    ax.plot(*centre, marker="o", markersize=7, markerfacecolor=ax.get_facecolor(), markeredgecolor=shade(0.15))
    if isinstance(element, Differential):  # a cage with its bevel gears
        ax.plot(*centre, marker="x", markersize=4.5, markeredgecolor=shade(0.15))
    name, style = words(element.name).replace(" ", "\n"), SMALL | {"ha": "right", "color": shade(0.35)}
    ax.text(centre[0] - 0.05, centre[1] + 0.07, name, va="bottom", **style)
