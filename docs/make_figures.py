"""Draw the README's figure: ``python docs/make_figures.py`` writes ``docs/load_change.svg``."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

from matplotlib.figure import Figure

import powertrain_ctrl as pt


def load_change() -> Figure:
    """Load change of the source's car, detailed model and two-mass control model (Fig. 2.9)."""
    car = pt.examples.conventional()
    responses = {"detailed model": pt.load_change(car), "control model": pt.load_change(pt.two_mass(car, "source"))}
    figure = Figure(figsize=(7.2, 5.4), layout="constrained", facecolor="white")
    axes = figure.subplots(3, sharex=True, height_ratios=(3, 4, 4))
    pt.plots.load_change(responses, ratio=18.0, axes=axes)
    axes[0].set_xlim(0.6, 2.6)
    axes[0].set_xticks([0.6, 1.0, 1.4, 1.8, 2.2, 2.6])
    axes[0].set_ylim(-5.0, 300.0)
    axes[0].set_yticks([0, 100, 200, 300])
    return figure


if __name__ == "__main__":
    with matplotlib.rc_context({"svg.hashsalt": "load_change"}):
        load_change().savefig(Path(__file__).parent / "load_change.svg", metadata={"Date": None, "Creator": None})
