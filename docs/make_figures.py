"""Draw the README's figures: ``python docs/make_figures.py`` writes ``load_change.svg`` and ``launch.svg`` to ``docs``."""

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


def launch() -> Figure:
    """Launch of the source's car, detailed model and control model that switches at the lock (Fig. 2.13)."""
    car = pt.examples.conventional(damping="open")
    slipping = pt.two_mass(car.release("clutch"), "source")
    control_model = pt.SwitchedTwoMass(closed=pt.two_mass(pt.examples.conventional(), "source"), slipping=slipping)
    figure = Figure(figsize=(7.2, 6.6), layout="constrained", facecolor="white")
    axes = figure.subplots(4, sharex=True, height_ratios=(3, 4, 4, 4))
    responses = {"detailed model": pt.launch(car), "control model": pt.launch(control_model)}
    pt.plots.launch_compared(responses, axes)
    axes[0].set_xlim(1.2, 3.2)
    axes[0].set_xticks([1.2, 1.6, 2.0, 2.4, 2.8, 3.2])
    axes[0].set_ylim(-5.0, 400.0)
    axes[0].set_yticks([0, 200, 400])
    axes[1].set_ylim(-150.0, 6300.0)
    axes[2].set_ylim(-8.0, 345.0)
    axes[3].set_ylim(-0.4, 10.8)
    return figure


if __name__ == "__main__":
    for draw in (load_change, launch):
        with matplotlib.rc_context({"svg.hashsalt": draw.__name__}):
            file = Path(__file__).parent / f"{draw.__name__}.svg"
            draw().savefig(file, metadata={"Date": None, "Creator": None})
