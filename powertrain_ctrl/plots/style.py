"""What the figures share: colours, line styles, axes, legends, and responses by signal name.

Colours are told apart by colour-blind readers and differ in lightness and line style, so that print in black and white
keeps them apart. Legends stand above the axes, where there is no data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from ..base.checks import checked_mapping
from ..base.doors import checked
from ..base.errors import PowertrainError, SignalError, UnknownNameError
from ..base.records import Record
from ..base.tables import words as words
from ..base.units import to_rpm
from ..hybrid.response import Response

if TYPE_CHECKING:
    import control
    from matplotlib.axes import Axes

    Panels: TypeAlias = Sequence[Axes] | np.ndarray | None
    Run: TypeAlias = "Response | Signals | control.TimeResponseData"

# Okabe and Ito's palette, darkest first.
COLOURS = ("#0072B2", "#E69F00", "#D55E00", "#009E73", "#CC79A7", "#56B4E9")
LINES = ("-", (0, (5, 2)), "-.", ":")
# Loops beside each other: the open one first, then the designs.
DESIGN_COLOURS = (COLOURS[2], COLOURS[0], COLOURS[3], COLOURS[1], COLOURS[4], COLOURS[5])
DESIGN_LINES = (LINES[1], LINES[0], *LINES[2:])
# Drawn hollow, so that points on top of each other are all seen.
HOLLOW = ("o", "s", "^", "D", "v", "P")
MARKERS = ("x", *HOLLOW[:5])
# What a figure reads of the nodes and the clutch that its arguments name.
QUANTITIES = {
    "driving": "speed",
    "input_shaft": "speed",
    "wheels": "speed",
    "vehicle": "acceleration",
    "clutch": "capacity",
}
# Above this many nodes or modes there is no room for one label each.
LABELLED = 30


def new_axes(
    axes: Axes | Sequence[Axes] | np.ndarray | None,
    count: int,
    size: tuple[float, float],
    beside: bool = False,
    **subplots: Any,
) -> np.ndarray:
    """The axes given, checked, or those of a new figure, above or beside each other."""
    if axes is None:
        import matplotlib.pyplot as plt

        shape = (1, count) if beside else (count, 1)
        _, axes = plt.subplots(*shape, figsize=size, layout="constrained", **subplots)
    axes = np.atleast_1d(np.asarray(axes, dtype=object)).ravel()
    if len(axes) != count:
        raise PowertrainError(f"axes: {len(axes)} given, this figure needs {count}")
    return axes


def shade(level: float) -> tuple[float, ...]:
    """A grey between the colour of text (0) and its opposite (1), so that it is seen in dark styles too."""
    from matplotlib import rcParams
    from matplotlib.colors import to_rgb

    return tuple(level * (1.0 - ink) + (1.0 - level) * ink for ink in to_rgb(rcParams["text.color"]))


def grid(ax: Axes, axis: Literal["both", "x", "y"]) -> None:
    ax.grid(True, axis=axis, color=shade(0.88), linewidth=0.6)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)


def legend(ax: Axes, columns: int) -> None:
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


def design_line(i: int) -> dict[str, Any]:
    """Line of the open loop (0) and of each design."""
    colour, line = DESIGN_COLOURS[i % len(DESIGN_COLOURS)], DESIGN_LINES[i % len(DESIGN_LINES)]
    return {"color": colour, "linestyle": line, "linewidth": 1.5}


def finish(axes: Sequence[Axes] | np.ndarray) -> None:
    """Grids and aligned labels of axes above each other, with the time or frequency under the last one."""
    for ax in axes:
        ax.margins(x=0.0)
        grid(ax, "both")
        ax.label_outer()
    axes[0].figure.align_ylabels(list(axes))


def labelled(what: str, given: Any, single: str = "") -> dict[str, Any]:
    """What a figure shows, by label; a single thing has the label ``single``.

    Where there is no such label, anything but a mapping is a `PowertrainError`, and an empty one everywhere.
    """
    if single and not isinstance(given, Mapping):
        return {single: given}
    shown = checked_mapping(what, given, 'from label to what is shown, such as {"my car": ...}')
    if not shown:
        raise PowertrainError(f"{what} is empty, permitted: at least one label")
    return shown


def difference(ax: Axes, response: Response | Signals, driving: str, ratio: float, wheels: str, **line: Any) -> None:
    """Speed of a node less that of the wheels behind the ratio [rpm]: how fast all between them twists."""
    ax.plot(response.time, to_rpm(response[f"{driving}_speed"] - ratio * response[f"{wheels}_speed"]), **line)
    ax.set_ylabel(f"{words(driving)} −\n{words(wheels)} × {ratio:.4g} [rpm]")


def require_signals(response: Response | Signals, **named: str | None) -> None:
    """Raise a `SignalError` that names the argument where a response has not the signal of a node or clutch named."""
    for argument, name in named.items():
        signal = f"{name}_{QUANTITIES[argument]}"
        if name is not None and signal not in response:
            raise SignalError(
                f'"{signal}" is not in this response; name the node or clutch of this car with {argument}="..."'
            )


@checked
@dataclass(frozen=True, eq=False)
class Signals(Record):
    """Signals over time by name, inputs and outputs alike.

    Attributes
    ----------
    time : (N,) ndarray
        [s].
    values : dict of str to (N,) ndarray
        Signal name to its values.

    Raises
    ------
    UnknownNameError
        From ``signals[name]``: a signal that is not there.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> measured = pt.plots.Signals(time=np.array([0.0, 0.5]), values={"engine_speed": np.array([100.0, 120.0])})
    >>> "engine_speed" in measured, measured["engine_speed"]
    (True, array([100., 120.]))
    """

    time: np.ndarray
    values: dict[str, np.ndarray]

    def keys(self) -> tuple[str, ...]:
        """Names of all signals."""
        return tuple(self.values)

    _ipython_key_completions_ = keys

    @checked
    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self.values:
            raise UnknownNameError("signal", name, tuple(self.values), "in this response")
        return self.values[name]

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.values


@checked
def signals(response: Run) -> Response | Signals:
    """A response by signal name: ``control.TimeResponseData`` is converted, anything else comes back as it is.

    Parameters
    ----------
    response : Response or control.TimeResponseData

    Returns
    -------
    Response or Signals

    Raises
    ------
    SignalError
        A response to each of several inputs by itself, as of ``control.step_response``.

    Examples
    --------
    >>> import numpy as np, control, powertrain_ctrl as pt
    >>> G = pt.state_space(pt.examples.conventional(), "engine_torque", "engine_speed")
    >>> response = pt.plots.signals(control.step_response(G, np.linspace(0.0, 1.0, 11)))
    >>> response["engine_torque"][-1], response["engine_speed"].shape
    (np.float64(1.0), (11,))
    """
    if isinstance(response, Response | Signals):
        return response
    time = np.asarray(response.time)
    values: dict[str, np.ndarray] = {}
    for labels, data in ((response.output_labels, response.y), (response.input_labels, response.u)):
        if labels is not None and data is not None:
            rows = np.asarray(data).reshape(-1, time.size)
            if len(rows) != len(labels):
                raise SignalError(
                    "the response holds several runs, one for each input, permitted: one; select it with input=0"
                )
            values |= dict(zip(labels, rows, strict=True))
    return Signals(time, values)
