"""Figures of results. Each function draws on the axes it is given, or on new ones, and returns them.

Colours are told apart by colour-blind readers and differ in lightness and line style, so that print in black and white
keeps them apart. Legends stand above the axes, where there is no data. Nothing here changes matplotlib's settings.
"""

from collections.abc import Mapping

import numpy as np

from .errors import PowertrainError
from .modal import Modes
from .units import to_hz, to_rpm

# Okabe and Ito's palette, darkest first.
COLOURS = ("#0072B2", "#E69F00", "#D55E00", "#009E73", "#CC79A7", "#56B4E9")
LINES = ("-", (0, (5, 2)), "-.", ":")
# Above this many nodes or modes there is no room for one label each.
LABELLED = 30


def mode_shape(modes: Modes, mode: int, ax=None, connect: bool = True):
    """Reflected rotation angle of each node with inertia in one mode, as in Figs. 2.8 and 2.12.

    Parameters
    ----------
    modes : Modes
    mode : int
        Number of the mode, as in the table of `modes`.
    ax : matplotlib Axes, optional
    connect : bool
        Join the points by a line; it says something where the nodes are a chain in the order given.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    PowertrainError
        There is no such mode, or its shape cannot be reflected.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> ax = pt.plots.mode_shape(pt.modes(pt.examples.conventional()), 1)
    >>> ax.get_title()
    'mode 1, f = 2.638 Hz'
    """
    if not 0 <= mode < len(modes):
        raise PowertrainError(f"mode = {mode}, permitted: 0 to {len(modes) - 1}")
    heavy = modes.kinetic_energy.any(axis=1)
    nodes = [node for node, is_heavy in zip(modes.nodes, heavy, strict=True) if is_heavy]
    angle = modes.reflected_shapes[heavy, mode]
    ax = _axes(ax, 1, mode_shape_size(len(nodes)))[0]
    place = np.arange(len(nodes))
    ax.axhline(0.0, color="0.4", linewidth=0.8, zorder=1)
    if len(nodes) <= LABELLED:
        ax.vlines(place, 0.0, angle, color=COLOURS[0], linewidth=1.0, alpha=0.5, zorder=2)
        ax.set_xticks(place, [node.replace("_", "\n") for node in nodes], rotation=0 if len(nodes) <= 9 else 90)
        ax.set_xlim(-0.5, len(nodes) - 0.5)
    else:
        ax.set_xlabel("node, in driveline order")
    ax.plot(
        place,
        angle,
        color=COLOURS[0],
        linestyle="-" if connect else "none",
        linewidth=1.6,
        marker="o" if len(nodes) <= LABELLED else None,
        markersize=5,
        zorder=3,
    )
    ax.set_ylim(-1.15, 1.15)
    ax.set_ylabel("rotation angle, reflected [-]")
    ax.set_title(f"mode {mode}, f = {modes.frequency_hz[mode]:.4g} Hz", fontsize="medium")
    ax.tick_params(axis="x", labelsize="small")
    _grid(ax, "y")
    return ax


def mode_shape_size(nodes: int) -> tuple[float, float]:
    """Width and height [in] at which the labels of so many nodes stand clear of each other.

    >>> mode_shape_size(8)
    (7.2, 3.2)
    """
    return (min(max(4.0, 0.9 * nodes), 8.0), 3.2 if nodes <= 9 else 3.8)


def mode_energies(modes: Modes, ax=None, count: int = 12):
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
    springs = modes.strain_energy[:, first:last].any(axis=1)
    if not springs.any():
        raise PowertrainError("no mode of this driveline twists a spring, so there is no strain energy to show")
    share = 100.0 * modes.strain_energy[springs, first:last]
    names = [name for name, is_spring in zip(modes.compliances, springs, strict=True) if is_spring]
    rows, columns = share.shape
    few = rows <= LABELLED
    ax = _axes(ax, 1, mode_energies_size(rows, columns))[0]
    edges = {"edgecolors": "white", "linewidth": 1.0} if few else {}
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


def mode_energies_size(springs: int, modes: int) -> tuple[float, float]:
    """Width and height [in] for so many springs and modes.

    >>> mode_energies_size(6, 6)
    (6.5, 3.2)
    """
    return (max(4.5, 2.9 + 0.6 * modes), round(1.4 + 0.3 * springs, 1) if springs <= LABELLED else 6.0)


def load_change(
    responses: Mapping,
    ratio: float | None = None,
    axes=None,
    driving: str = "engine",
    wheels: str = "wheels",
    vehicle: str = "vehicle",
    unit: str = "m/s²",
):
    """Driving torque, speeds and vehicle acceleration over time, as in Figs. 2.7 and 2.9.

    Parameters
    ----------
    responses : dict of str to Response
        By the label in the legend; the first one gives the torque.
    ratio : float, optional
        Driving speed / wheel speed [-], by which the wheel speed is multiplied; None leaves the wheels out.
    axes : sequence of 3 matplotlib Axes, optional
    driving, wheels, vehicle : str
        Names of the nodes.
    unit : str
        Unit of the acceleration, for a vehicle that is a rotating inertia.

    Returns
    -------
    ndarray of 3 matplotlib Axes

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> axes = pt.plots.load_change({"detailed": pt.load_change(pt.examples.conventional())}, ratio=18.0)
    >>> axes[2].get_xlabel(), axes[1].get_ylabel()
    ('time [s]', 'speed [rpm]')
    """
    several = len(responses) > 1
    axes = _axes(axes, 3, (6.5, 6.4), sharex=True, height_ratios=(3, 4, 4))
    torque, speed, acceleration = axes
    for i, (label, response) in enumerate(responses.items()):
        line, name = {"linestyle": LINES[i % len(LINES)], "linewidth": 1.4}, f", {label}" if several else ""
        if i == 0:
            torque.plot(response.time, response[f"{driving}_torque"], color="0.15", linewidth=1.5)
        speed.plot(
            response.time,
            to_rpm(response[f"{driving}_speed"]),
            color=COLOURS[0],
            label=f"{_words(driving)}{name}",
            **line,
        )
        if ratio is not None:
            speed.plot(
                response.time,
                to_rpm(ratio * response[f"{wheels}_speed"]),
                color=COLOURS[1],
                label=f"{_words(wheels)} × {ratio:.4g}{name}",
                **(line if several else line | {"linestyle": LINES[1]}),
            )
        acceleration.plot(
            response.time, response[f"{vehicle}_acceleration"], color=COLOURS[0 if i == 0 else 2], label=label, **line
        )
    torque.set_ylabel(f"{_words(driving)}\ntorque [N m]")
    speed.set_ylabel("speed [rpm]")
    acceleration.set_ylabel(f"{_words(vehicle)}\nacceleration [{unit}]")
    acceleration.set_xlabel("time [s]")
    _legend(speed, 2)
    if several:
        _legend(acceleration, len(responses))
    for ax in axes:
        ax.margins(x=0.0)
        _grid(ax, "both")
        ax.label_outer()
    torque.figure.align_ylabels(list(axes))
    return axes


def bode(responses: Mapping, axes=None, unit: str = ""):
    """Magnitude [dB] and phase [deg] over frequency [Hz].

    Parameters
    ----------
    responses : dict of str to control.FrequencyResponseData
        By the label in the legend; one input and one output each, over angular frequencies ``omega`` [rad/s].
    axes : sequence of 2 matplotlib Axes, optional
    unit : str
        Unit of the gain, named as that of 0 dB.

    Returns
    -------
    ndarray of 2 matplotlib Axes

    Examples
    --------
    >>> import control, numpy as np, powertrain_ctrl as pt
    >>> G = pt.state_space(pt.examples.conventional(), "engine_torque", "vehicle_acceleration")
    >>> axes = pt.plots.bode({"detailed": control.frequency_response(G, 2 * np.pi * np.geomspace(0.1, 1e3, 50))})
    >>> axes[0].get_ylabel(), axes[1].get_xlabel()
    ('magnitude [dB]', 'frequency [Hz]')
    """
    axes = _axes(axes, 2, (6.5, 5.0), sharex=True, height_ratios=(3, 2))
    for i, (label, response) in enumerate(responses.items()):
        gain = np.ravel(response.magnitude).astype(float)
        gain[gain == 0.0] = np.nan
        frequency, phase = to_hz(np.asarray(response.omega)), np.degrees(_unwrapped(np.ravel(response.phase)))
        line = {
            "color": COLOURS[(0, 2, 3, 1, 4, 5)[i % 6]],
            "linestyle": LINES[i % len(LINES)],
            "linewidth": 1.5,
            "label": label,
        }
        axes[0].semilogx(frequency, 20.0 * np.log10(gain), **line)
        axes[1].semilogx(frequency, phase, **line)
    axes[0].set_ylabel(f"magnitude [dB]\n0 dB = 1 {unit}" if unit else "magnitude [dB]")
    axes[1].set_ylabel("phase [deg]")
    axes[1].set_xlabel("frequency [Hz]")
    low, high = axes[1].get_ylim()
    step = 90.0 * max(1.0, np.ceil((high - low) / 540.0))
    axes[1].set_yticks(np.arange(step * np.ceil(low / step), high + 1e-9, step))
    if len(responses) > 1:
        _legend(axes[0], len(responses))
    for ax in axes:
        ax.margins(x=0.0)
        _grid(ax, "both")
        ax.label_outer()
    axes[0].figure.align_ylabels(list(axes))
    return axes


def _unwrapped(phase: np.ndarray) -> np.ndarray:
    """Phase without jumps of a full turn; half a turn, as at an undamped resonance, counts as a lag."""
    half = np.pi + 1e-6
    return phase[0] + np.concatenate([[0.0], np.cumsum((np.diff(phase) + half) % (2.0 * np.pi) - half)])


def _axes(axes, count: int, size: tuple[float, float], **subplots) -> np.ndarray:
    """The axes given, checked, or those of a new figure."""
    if axes is None:
        import matplotlib.pyplot as plt

        _, axes = plt.subplots(count, figsize=size, layout="constrained", **subplots)
    axes = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()
    if len(axes) != count:
        raise PowertrainError(f"axes: {len(axes)} given, this figure needs {count}")
    return axes


def _grid(ax, axis: str):
    ax.grid(True, axis=axis, color="0.88", linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def _legend(ax, columns: int):
    """Legend above the axes, at the left."""
    ax.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        frameon=False,
        fontsize="small",
        borderaxespad=0.2,
        handlelength=2.8,
    )


def _words(name: str) -> str:
    return name.replace("_", " ")
