"""A picture of a car that is drawn fast enough to feel like dragging.

A fresh figure of matplotlib takes a tenth of a second, so axes, ticks and labels are drawn once and kept as a picture, the
background; a redraw puts it back and draws only the lines over it.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..base.errors import PowertrainError
from ..base.tables import number, words
from ..driveline.collection import Driveline
from ..driveline.ends import driven, ends
from ..hybrid.manoeuvres import load_change
from ..linear.forced import frequency_response
from ..linear.modal import Modes, modes
from ..plots.shapes import branches
from ..plots.style import COLOURS, grid, shade

# Frequencies [Hz] over the lowest and highest elastic one, and the torque step that is shown [N m], [s].
BEYOND, POINTS = 4.0, 300
TORQUE, START, LENGTH = 100.0, 0.1, 0.1
END, SAMPLES = 2.0, 601
# How much further an axis goes than what is drawn on it, so that it rarely has to change.
ROOM = 0.35
SIZE, DPI = (11.0, 3.4), 80


@dataclass(frozen=True)
class Curves:
    """What is shown of a car: mode shape, gain [dB], acceleration over time, and the first mode in words."""

    shape: np.ndarray
    gain: np.ndarray
    acceleration: np.ndarray
    text: str

    @property
    def lines(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.shape, self.gain, self.acceleration


class Explorer:
    """Mode shape, gain and response of a car and of what it is changed into; ``png`` and ``text`` are those of a variant."""

    def __init__(self, car: Driveline):
        between = ends(car)
        self.driving, self.vehicle = between.engine, between.vehicle
        if self.vehicle is None or self.driving in car.translating:
            raise PowertrainError(
                "explore shows torque to vehicle acceleration: give the driveline a Mass and an engine"
            )
        first = self._linear_modes(car)
        self.mode = first.n_rigid
        if self.mode == len(first):
            raise PowertrainError("explore shows the first elastic mode: give the driveline a spring")
        low, high = first.frequency_hz[self.mode], first.frequency_hz[-1]
        highest = min(high, 100.0 * low) * BEYOND
        self.omega = 2.0 * np.pi * np.geomspace(low / BEYOND, highest, POINTS)
        self.time = np.linspace(0.0, END, SAMPLES)
        heavy = np.asarray(first.kinetic_energy.any(axis=1))
        self.nodes = [node for node, is_heavy in zip(first.nodes, heavy.tolist(), strict=True) if is_heavy]
        place, _ = branches(self.nodes, first.links)
        self.place = np.array([place[node] for node in self.nodes], dtype=float)
        self.links = [(self.nodes.index(a), self.nodes.index(b)) for a, b in first.links]
        self.unit = "m/s²" if self.vehicle in car.translating else "rad/s²"
        self.given = self.curves(car)
        self._draw_background([np.array([-1.0, 1.0]), self.given.gain, self.given.acceleration])

    def _linear_modes(self, car: Driveline) -> Modes:
        return modes(driven(car))

    def curves(self, car: Driveline) -> Curves:
        """What there is to draw of a variant of the car."""
        found = self._linear_modes(car)
        heavy = [found.nodes.index(node) for node in self.nodes]
        shape = found.reflected_shapes[heavy, self.mode]
        response = frequency_response(driven(car), self.omega, f"{self.driving}_torque", f"{self.vehicle}_acceleration")
        gain = 20.0 * np.log10(np.abs(np.ravel(response.complex)) + 1e-30)
        motion = load_change(car, torque=TORQUE, duration=LENGTH, start=START, timepts=self.time)
        zeta = found.damping_ratio[self.mode]
        text = f"first mode {number(found.frequency_hz[self.mode])} Hz" + (
            f", ζ = {number(zeta, 3)}" if np.isfinite(zeta) else ""
        )
        return Curves(shape, gain, motion[f"{self.vehicle}_acceleration"], text)

    def _draw_background(self, ranges: list[np.ndarray]) -> None:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=SIZE, dpi=DPI, layout="constrained")
        self.canvas: Any = FigureCanvasAgg(figure)
        self.axes = shape, gain, motion = figure.subplots(1, 3)
        pale: dict[str, Any] = {"color": shade(0.75), "linewidth": 3.0}
        self.ranges = ranges
        for ax, x, y, values in zip(self.axes, self._abscissae, self.given.lines, ranges, strict=True):
            for line_x, line_y in self._parts(ax is shape, x, y):
                ax.plot(line_x, line_y, **pale)
            low, high = float(values.min()), float(values.max())
            room = ROOM * max(high - low, 1e-9)
            ax.set_ylim((-1.15, 1.15) if ax is shape else (low - room, high + room))
            grid(ax, "both")
        shape.axhline(0.0, color=shade(0.4), linewidth=0.8)
        shape.set_xticks(self.place, [words(node) for node in self.nodes], rotation=90, fontsize="x-small")
        shape.set_ylabel("rotation angle, reflected [-]")
        gain.set_xscale("log")
        gain.set_xlim(*(self.omega[[0, -1]] / (2.0 * np.pi)))
        gain.set_xlabel("frequency [Hz]")
        gain.set_ylabel(f"{words(self.driving)} torque to\nacceleration [dB]")
        motion.set_xlim(0.0, END)
        motion.set_xlabel("time [s]")
        motion.set_ylabel(f"{words(self.vehicle or '')} acceleration [{self.unit}]")
        title = f"{TORQUE:g} N m in {LENGTH:g} s; grey: as given"
        motion.set_title(title, fontsize="medium")
        self.drawn = [
            [
                ax.plot(*part, color=COLOURS[0], linewidth=1.6, animated=True)[0]
                for part in self._parts(ax is shape, x, y)
            ]
            for ax, x, y in zip(self.axes, self._abscissae, self.given.lines, strict=True)
        ]
        self.words = shape.set_title(" ", fontsize="medium", animated=True)
        self.canvas.draw()
        self.background = self.canvas.copy_from_bbox(figure.bbox)

    @property
    def _abscissae(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        return self.place, self.omega / (2.0 * np.pi), self.time

    def _parts(self, is_shape: bool, x: np.ndarray, y: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Lines of a curve: a mode shape has one for each joint."""
        if not is_shape:
            return [(x, y)]
        return [(x[list(pair)], y[list(pair)]) for pair in self.links]

    def png(self, curves: Curves) -> bytes:
        """The picture of a variant over the car as it was given."""
        import matplotlib.image

        if any(not _holds(ax.get_ylim(), y) for ax, y in zip(self.axes[1:], curves.lines[1:], strict=True)):
            wider = [np.concatenate(pair) for pair in zip(self.ranges, curves.lines, strict=True)]
            self._draw_background(wider)
        self.canvas.restore_region(self.background)
        for ax, x, y, lines in zip(self.axes, self._abscissae, curves.lines, self.drawn, strict=True):
            for line, part in zip(lines, self._parts(ax is self.axes[0], x, y), strict=True):
                line.set_data(*part)
                ax.draw_artist(line)
        self.words.set_text(curves.text)
        self.axes[0].draw_artist(self.words)
        file = io.BytesIO()
        picture = np.asarray(self.canvas.buffer_rgba())
        matplotlib.image.imsave(file, picture, format="png", pil_kwargs={"compress_level": 1})
        return file.getvalue()


def sliding(car: Driveline, count: int) -> list[str]:
    """The values on which the first elastic mode depends most, as "element.parameter"; none of a mode that has none."""
    found = modes(driven(car))
    try:
        by_value: Mapping[str, float] = found.sensitivity(found.n_rigid)
    except PowertrainError:
        by_value = {}
    known = [name for name in by_value if name.split(".")[0] in car]
    return sorted(known, key=lambda name: -round(abs(by_value[name]), 9))[:count]


def _holds(limits: tuple[float, float], values: np.ndarray) -> bool:
    return bool(limits[0] <= values.min() and values.max() <= limits[1])
