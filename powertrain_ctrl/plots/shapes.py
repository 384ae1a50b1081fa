"""Mode shapes and strain energies."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..linear.modal import Modes
from .style import COLOURS, LABELLED, grid, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@checked
def mode_shape(modes: Modes, mode: int, ax: Axes | None = None) -> Axes:
    """Reflected rotation angle of each node with inertia in one mode, as in Figs. 2.8 and 2.12.

    Lines join the nodes that a spring, a damper or a rigid connection joins.

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
    angle = modes.reflected_shapes[heavy, mode]
    ax = new_axes(ax, 1, mode_shape_size(len(nodes)))[0]
    place = np.arange(len(nodes))
    ax.axhline(0.0, color="0.4", linewidth=0.8, zorder=1)
    if len(nodes) <= LABELLED:
        ax.vlines(place, 0.0, angle, color=COLOURS[0], linewidth=1.0, alpha=0.5, zorder=2)
        ax.set_xticks(place, [node.replace("_", "\n") for node in nodes], rotation=0 if len(nodes) <= 9 else 90)
        ax.set_xlim(-0.5, len(nodes) - 0.5)
    else:
        ax.set_xlabel("node, in driveline order")
    for a, b in modes.links:
        pair = [nodes.index(a), nodes.index(b)]
        ax.plot(pair, angle[pair], color=COLOURS[0], linewidth=1.6, zorder=3)
    ax.plot(
        place,
        angle,
        color=COLOURS[0],
        linestyle="none",
        marker="o" if len(nodes) <= LABELLED else None,
        markersize=5,
        zorder=3,
    )
    ax.set_ylim(-1.15, 1.15)
    ax.set_ylabel("rotation angle, reflected [-]")
    ax.set_title(f"mode {mode}, f = {modes.frequency_hz[mode]:.4g} Hz", fontsize="medium")
    ax.tick_params(axis="x", labelsize="small")
    grid(ax, "y")
    return ax


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
    edges: dict[str, Any] = {"edgecolors": "white", "linewidth": 1.0} if few else {}
    corners = np.arange(columns + 1) - 0.5, np.arange(rows + 1) - 0.5
    mesh = ax.pcolormesh(*corners, share, cmap="Blues", vmin=0.0, vmax=100.0 if few else share.max(), **edges)
    ax.invert_yaxis()
    if few:
        ax.set_yticks(range(rows), names)
        for i, j in np.argwhere(share >= 0.5):
            colour = "white" if share[i, j] > 55.0 else "black"
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
