"""A driveline as a notebook shows it: drawn."""

from __future__ import annotations

import io

from ..driveline.collection import Driveline

# Larger drivelines have no room for their labels; they are shown as text.
NODES_DRAWN = 30


def schematic_svg(car: Driveline) -> str | None:
    """The schematic of a driveline as SVG, or None of one too large; colours of text are those of the notebook."""
    if not 1 < len(car.nodes) <= NODES_DRAWN:
        return None
    import matplotlib
    from matplotlib.figure import Figure

    from ..plots.schematics import schematic, schematic_size

    file = io.StringIO()
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "schematic"}):
        figure = Figure(figsize=schematic_size(car), layout="constrained")
        figure.patch.set_alpha(1.0)
        schematic(car, figure.subplots())
        figure.savefig(file, format="svg", metadata={"Date": None, "Creator": None})
    text = file.getvalue()
    return text[text.index("<svg") :]
