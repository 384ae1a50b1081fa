"""A figure drawn once, as pixels and as vectors alike."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.backend_bases import FigureCanvasBase, RendererBase
from matplotlib.backends.backend_agg import RendererAgg
from matplotlib.backends.backend_svg import RendererSVG
from matplotlib.transforms import Affine2D, Transform, TransformedBbox, TransformedPath

if TYPE_CHECKING:
    from matplotlib.backend_bases import GraphicsContextBase
    from matplotlib.figure import Figure
    from matplotlib.path import Path
    from matplotlib.text import Text

# Of the vectors, whose unit is the point.
POINTS = 72.0


class TwofoldCanvas(FigureCanvasBase):
    """Canvas of a figure whose layout and drawing know one renderer, at the figure's resolution."""

    def __init__(self, figure: Figure):
        super().__init__(figure)
        self.renderer = TwofoldRenderer(figure)

    def get_renderer(self) -> TwofoldRenderer:
        return self.renderer


class TwofoldRenderer(RendererBase):
    """Hands what is drawn in pixels to a renderer of pixels and, scaled to points, to one of vectors.

    Texts have the size they have in pixels. Line widths and dashes are in points for both.
    """

    def __init__(self, figure: Figure):
        super().__init__()
        self.dpi, self.file = figure.dpi, io.StringIO()
        self.width, self.height = figure.canvas.get_width_height(physical=True)
        self.pixels = RendererAgg(self.width, self.height, self.dpi)
        width, height = POINTS * figure.get_size_inches()
        self.vectors = RendererSVG(width, height, self.file, metadata={"Date": None, "Creator": None})
        self.scale = Affine2D().scale(POINTS / self.dpi)

    def get_canvas_width_height(self) -> tuple[int, int]:
        return self.width, self.height

    def points_to_pixels(self, points: Any) -> Any:
        return self.pixels.points_to_pixels(points)

    def get_text_width_height_descent(self, s: str, prop: Any, ismath: Any) -> tuple[float, float, float]:
        return self.pixels.get_text_width_height_descent(s, prop, ismath)

    def open_group(self, s: str, gid: str | None = None) -> None:
        self.vectors.open_group(s, gid)

    def close_group(self, s: str) -> None:
        self.vectors.close_group(s)

    def draw_path(self, gc: GraphicsContextBase, path: Path, transform: Transform, rgbFace: Any = None) -> None:
        self.pixels.draw_path(gc, path, transform, rgbFace)
        self.vectors.draw_path(self._clipped(gc), path, transform + self.scale, rgbFace)

    def draw_markers(
        self,
        gc: GraphicsContextBase,
        marker_path: Path,
        marker_trans: Transform,
        path: Path,
        trans: Transform,
        rgbFace: Any = None,
    ) -> None:
        self.pixels.draw_markers(gc, marker_path, marker_trans, path, trans, rgbFace)
        scaled = marker_trans + self.scale, path, trans + self.scale
        self.vectors.draw_markers(self._clipped(gc), marker_path, *scaled, rgbFace)

    def draw_path_collection(
        self,
        gc: GraphicsContextBase,
        master_transform: Transform,
        paths: Any,
        all_transforms: Any,
        offsets: Any,
        offset_trans: Transform,
        *style: Any,
        **hatches: Any,
    ) -> None:
        shapes = paths, all_transforms, offsets
        self.pixels.draw_path_collection(gc, master_transform, *shapes, offset_trans, *style, **hatches)
        scaled = master_transform + self.scale, *shapes, offset_trans + self.scale
        self.vectors.draw_path_collection(self._clipped(gc), *scaled, *style, **hatches)

    def draw_quad_mesh(
        self,
        gc: GraphicsContextBase,
        master_transform: Transform,
        meshWidth: Any,
        meshHeight: Any,
        coordinates: Any,
        offsets: Any,
        offsetTrans: Transform,
        facecolors: Any,
        antialiased: Any,
        edgecolors: Any,
    ) -> None:
        mesh, style = (meshWidth, meshHeight, coordinates, offsets), (facecolors, antialiased, edgecolors)
        self.pixels.draw_quad_mesh(gc, master_transform, *mesh, offsetTrans, *style)
        scaled = master_transform + self.scale, *mesh, offsetTrans + self.scale
        self.vectors.draw_quad_mesh(self._clipped(gc), *scaled, *style)

    def draw_text(
        self,
        gc: GraphicsContextBase,
        x: float,
        y: float,
        s: str,
        prop: Any,
        angle: float,
        ismath: Any = False,
        mtext: Text | None = None,
    ) -> None:
        self.pixels.draw_text(gc, x, y, s, prop, angle, ismath, mtext)
        right, up = self.scale.transform((x, self.height - y))
        anchor = None if mtext is None else _Anchor(mtext, self.scale)
        place = right, self.vectors.height - up
        self.vectors.draw_text(self._clipped(gc), *place, s, prop, angle, ismath, anchor)

    def image(self) -> np.ndarray:
        """(height, width, 4) ndarray of bytes."""
        return np.asarray(self.pixels.buffer_rgba())

    def svg(self) -> bytes:
        """The file, to which nothing can be drawn any more."""
        self.vectors.finalize()
        return self.file.getvalue().encode()

    def _clipped(self, gc: GraphicsContextBase) -> GraphicsContextBase:
        """What is drawn in points is clipped in points."""
        scaled = self.vectors.new_gc()
        scaled.copy_properties(gc)
        box: Any = gc.get_clip_rectangle()
        if box is not None:
            scaled.set_clip_rectangle(TransformedBbox(box, self.scale))  # type: ignore[arg-type]
        path: Any
        transform: Any
        path, transform = gc.get_clip_path()
        if path is not None:
            scaled.set_clip_path(TransformedPath(path, transform + self.scale))
        return scaled


class _Anchor:
    """A text whose place is in points."""

    def __init__(self, text: Text, scale: Transform):
        self.text, self.scale = text, scale

    def get_transform(self) -> Transform:
        return self.text.get_transform() + self.scale

    def __getattr__(self, name: str) -> Any:
        return getattr(self.text, name)
