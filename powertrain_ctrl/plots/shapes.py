"""Mode shapes and strain energies."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..linear.modal import Modes
from .style import COLOURS, LABELLED, LINES, grid, legend, new_axes, shade, words

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@checked
def mode_shape(modes: Modes, mode: int, ax: Axes | None = None) -> Axes:
    """Reflected rotation angle of each node with inertia in one mode, as in Figs. 2.8 and 2.12.

    Lines join the nodes that a spring, a damper or a rigid connection joins. A node stands as many steps from the first one
    as there are joints between them, so branches lie over each other, each with its own line.

    Parameters
    ----------
    modes : Modes
    mode : int
        Number of the mode, as in the table of `modes`.
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        There is no such mode.
    TopologyError
        Nodes without a single ratio between them, so that the shape cannot be reflected.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> ax = pt.plots.mode_shape(pt.modes(pt.examples.conventional()), 1)
    >>> ax.get_title()
    'mode 1, f = 2.638 Hz'
    """
    if not 0 <= mode < len(modes):
        raise PowertrainError(f"mode = {mode}, permitted: 0 to {len(modes) - 1}")
    heavy = np.asarray(modes.kinetic_energy.any(axis=1))
    nodes = [node for node, is_heavy in zip(modes.nodes, heavy.tolist(), strict=True) if is_heavy]
    angle = dict(zip(nodes, modes.reflected_shapes[heavy, mode].tolist(), strict=True))
    ax = new_axes(ax, 1, mode_shape_size(len(nodes)))[0]
    place, branch = branches(nodes, modes.links)
    ax.axhline(0.0, color=shade(0.4), linewidth=0.8, zorder=1)
    few = len(nodes) <= LABELLED
    if few:
        _name_places(ax, place)
    else:
        ax.set_xlabel("steps from the first node")
    for a, b in modes.links:
        ends = (a, b) if place[a] <= place[b] else (b, a)
        ax.plot([place[n] for n in ends], [angle[n] for n in ends], zorder=3, **_line(branch[ends[1]]))
    for number in sorted(set(branch.values())):
        own = [node for node in nodes if branch[node] == number]
        x, y = [place[node] for node in own], [angle[node] for node in own]
        colour = _line(number)["color"]
        if few:
            ax.vlines(x, 0.0, y, color=colour, linewidth=1.0, alpha=0.5, zorder=2)
        # rings about what is drawn at the same place, so that both are seen
        marker, face = "o" if few else None, "none" if number else colour
        size = 5.0 + 4.0 * number
        ax.plot(x, y, linestyle="none", color=colour, marker=marker, markersize=size, markerfacecolor=face, zorder=3)
        if number:
            ax.plot([], [], label=f"to {words(max(own, key=lambda node: place[node]))}", **_line(number))
    if ax.get_legend_handles_labels()[0]:
        legend(ax, 3)
    ax.set_ylim(-1.15, 1.15)
    ax.set_ylabel("rotation angle, reflected [-]")
    ax.set_title(f"mode {mode}, f = {modes.frequency_hz[mode]:.4g} Hz", fontsize="medium")
    ax.tick_params(axis="x", labelsize="small")
    grid(ax, "y")
    return ax


def branches(nodes: Sequence[str], links: Iterable[tuple[str, str]]) -> tuple[dict[str, int], dict[str, int]]:
    """Steps of each node from the first one of its part, and its branch: 0 is the longest way, 1, 2, ... leave it."""
    beside: dict[str, list[str]] = {node: [] for node in nodes}
    for a, b in links:
        beside[a].append(b)
        beside[b].append(a)
    place: dict[str, int] = {}
    branch: dict[str, int] = {}
    free = 0
    for root in nodes:
        if root in place:
            continue
        parent: dict[str, str] = {}
        order = [root]
        place[root] = free
        for node in order:
            for other in beside[node]:
                if other not in place:
                    place[other], parent[other] = place[node] + 1, node
                    order.append(other)
        free, count = max(place[node] for node in order) + 1, 0
        for end in sorted(order, key=lambda node: -place[node]):  # the longest way first
            way = []
            while end not in branch:
                way.append(end)
                if end not in parent:
                    break
                end = parent[end]
            branch |= dict.fromkeys(way, count)
            count += bool(way)
    return place, branch


def _line(branch: int) -> dict[str, Any]:
    return {"color": COLOURS[branch % len(COLOURS)], "linestyle": LINES[branch % len(LINES)], "linewidth": 1.6}


def _name_places(ax: Axes, place: Mapping[str, int]) -> None:
    """Names below the axis, those at one place below each other."""
    names: dict[int, list[str]] = {}
    for node, at in place.items():
        names.setdefault(at, []).append(node)
    labels = ["\n&\n".join(node.replace("_", "\n") for node in names[at]) for at in sorted(names)]
    ax.set_xticks(sorted(names), labels, rotation=0 if len(names) <= 9 else 90)
    ax.set_xlim(-0.5, max(names) + 0.5)


@checked
def mode_shape_size(nodes: int) -> tuple[float, float]:
    """Width and height of the figure of `mode_shape` at which the labels of its nodes stand clear of each other.

    Parameters
    ----------
    nodes : int
        Number of nodes with inertia.

    Returns
    -------
    width, height : float
        [in].

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.plots.mode_shape_size(8)
    (7.2, 3.2)
    """
    return (min(max(4.0, 0.9 * nodes), 8.0), 3.2 if nodes <= 9 else 3.8)


@checked
def mode_energies(modes: Modes, ax: Axes | None = None, count: int = 12) -> Axes:
    """Share of each spring in the strain energy of the elastic modes, one column per mode.

    Parameters
    ----------
    modes : Modes
    ax : matplotlib Axes, optional
    count : int
        At most so many modes, the lowest.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        No mode is elastic.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> ax = pt.plots.mode_energies(pt.modes(pt.examples.conventional()))
    >>> [label.get_text() for label in ax.get_yticklabels()][:2]
    ['damper_spring', 'clutch_shaft']
    """
    first, last = modes.n_rigid, min(len(modes), modes.n_rigid + count)
    springs = np.asarray(modes.strain_energy[:, first:last].any(axis=1))
    if not springs.any():
        raise PowertrainError("no mode of this driveline twists a spring, so there is no strain energy to show")
    share = 100.0 * modes.strain_energy[springs, first:last]
    names = [name for name, is_spring in zip(modes.compliances, springs.tolist(), strict=True) if is_spring]
    rows, columns = share.shape
    few = rows <= LABELLED
    ax = new_axes(ax, 1, mode_energies_size(rows, columns))[0]
    edges: dict[str, Any] = {"edgecolors": ax.get_facecolor(), "linewidth": 1.0} if few else {}
    corners = np.arange(columns + 1) - 0.5, np.arange(rows + 1) - 0.5
    mesh = ax.pcolormesh(*corners, share, cmap=_blues(), vmin=0.0, vmax=100.0 if few else share.max(), **edges)
    ax.invert_yaxis()
    if few:
        ax.set_yticks(range(rows), names)
        for i, j in np.argwhere(share >= 0.5):
            colour = "white" if share[i, j] > 55.0 else shade(0.0)
            ax.text(j, i, f"{share[i, j]:.0f}", ha="center", va="center", color=colour, fontsize="small")
        ax.set_title("share of strain energy [%]", fontsize="medium")
    else:
        ax.set_ylabel("spring, in driveline order")
        ax.figure.colorbar(mesh, ax=ax, pad=0.02).set_label("share of strain energy [%]")
    ax.set_xticks(range(columns), [f"{mode}\n{modes.frequency_hz[mode]:.4g}" for mode in range(first, last)])
    ax.tick_params(length=0, labelsize="small")
    ax.set_xlabel("mode, frequency [Hz]")
    ax.spines[:].set_visible(False)
    return ax


def _blues() -> Any:
    """From nothing to blue, so that the figure's own ground shows where there is nothing."""
    from matplotlib.colors import LinearSegmentedColormap, to_rgba

    return LinearSegmentedColormap.from_list("blues", [to_rgba(COLOURS[0], 0.04), to_rgba(COLOURS[0], 1.0)])


@checked
def mode_energies_size(springs: int, modes: int) -> tuple[float, float]:
    """Width and height of the figure of `mode_energies` in which its numbers have room.

    Parameters
    ----------
    springs, modes : int
        Number of rows and columns.

    Returns
    -------
    width, height : float
        [in].

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.plots.mode_energies_size(6, 6)
    (6.5, 3.2)
    """
    return (max(4.5, 2.9 + 0.6 * modes), round(1.4 + 0.3 * springs, 1) if springs <= LABELLED else 6.0)
