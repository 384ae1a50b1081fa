"""Draw the README's figures: ``python docs/make_figures.py`` writes one SVG for each function here to ``docs``."""

from collections.abc import Callable
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.figure import Figure

import powertrain_ctrl as pt

CAR = pt.examples.conventional()
LAUNCHING = pt.examples.conventional(damping="open")
PLANT = pt.SampledPlant(car=CAR)
METHODS = ("source", "series", "modal", "fit")


def new_figure(width: float, height: float) -> Figure:
    return Figure(figsize=(width, height), layout="constrained", facecolor="white")


def schematic() -> Figure:
    """The source's car as it is built."""
    figure = new_figure(*pt.plots.schematic_size(CAR))
    pt.plots.schematic(CAR, figure.subplots())
    return figure


def chain() -> Figure:
    """The same seen from the engine (Fig. 2.6)."""
    seen = pt.reflected(CAR, "engine")
    figure = new_figure(*pt.plots.schematic_size(seen))
    pt.plots.schematic(seen, figure.subplots())
    return figure


def mode_shape() -> Figure:
    """Dominant mode with closed clutch (Fig. 2.8)."""
    figure = new_figure(5.6, 3.4)
    ax = figure.subplots()
    pt.plots.mode_shape(pt.modes(CAR), 1, ax)
    ax.tick_params(axis="x", rotation=60)
    return figure


def bode() -> Figure:
    """Torque to vehicle acceleration, detailed and two masses."""
    omega = 2.0 * np.pi * np.geomspace(0.3, 1000.0, 400)
    models = {"detailed model": CAR, "control model": pt.two_mass(CAR, "source")}
    responses = {
        label: pt.frequency_response(model, omega, "engine_torque", "vehicle_acceleration")
        for label, model in models.items()
    }
    figure = new_figure(5.6, 4.2)
    pt.plots.bode(responses, figure.subplots(2, sharex=True, height_ratios=(3, 2)), unit="(m/s²)/(N m)")
    return figure


def load_change() -> Figure:
    """Load change, detailed model and two-mass control model (Fig. 2.9)."""
    times = np.linspace(0.0, 2.6, 521)
    models = {"detailed model": CAR, "control model": pt.two_mass(CAR, "source")}
    responses = {label: pt.load_change(model, timepts=times) for label, model in models.items()}
    figure = new_figure(5.6, 5.0)
    axes = figure.subplots(3, sharex=True, height_ratios=(3, 4, 4))
    pt.plots.load_change(responses, ratio=18.0, axes=axes)
    axes[0].set(xlim=(0.6, 2.6), xticks=np.arange(0.6, 2.61, 0.4), ylim=(-5.0, 300.0), yticks=[0, 100, 200, 300])
    axes[1].set(ylim=(1900.0, 6000.0), yticks=[2000, 4000, 6000])
    axes[2].set(ylim=(-0.2, 6.0), yticks=[0, 2, 4, 6])
    return figure


def launch() -> Figure:
    """Launch, detailed model and control model that switches at the lock (Fig. 2.13)."""
    slipping = pt.two_mass(LAUNCHING.release("clutch"), "source")
    control_model = pt.SwitchedTwoMass(closed=pt.two_mass(CAR, "source"), slipping=slipping)
    times = np.linspace(0.0, 3.2, 641)
    responses = {
        "detailed model": pt.launch(LAUNCHING, timepts=times),
        "control model": pt.launch(control_model, timepts=times),
    }
    figure = new_figure(5.6, 6.2)
    axes = figure.subplots(4, sharex=True, height_ratios=(3, 4, 4, 4))
    pt.plots.launch_compared(responses, axes)
    axes[0].set(xlim=(1.2, 3.2), xticks=np.arange(1.2, 3.21, 0.4), ylim=(-5.0, 400.0), yticks=[0, 200, 400])
    axes[1].set_ylim(-150.0, 6300.0)
    axes[2].set_ylim(-8.0, 345.0)
    axes[3].set_ylim(-0.4, 10.8)
    return figure


def model_errors() -> Figure:
    """Gain and error of the control models."""
    table = pt.compare_models(CAR, {method: pt.two_mass(CAR, method) for method in METHODS})
    figure = new_figure(5.6, 4.6)
    pt.plots.model_errors(table, figure.subplots(2, sharex=True, height_ratios=(3, 2)))
    return figure


def tip_in() -> Figure:
    """Tip-in with and without anti-jerk control, on the detailed model."""
    controller = pt.antijerk.designs(PLANT)["two degrees of freedom"]
    responses = {"open loop": pt.tip_in(PLANT), "anti-jerk": pt.tip_in(PLANT, controller)}
    figure = new_figure(6.0, 6.6)
    axes = figure.subplots(4, sharex=True, height_ratios=(4, 4, 3, 3))
    pt.plots.tip_in(responses, axes)
    axes[0].set_xlim(0.4, 2.4)
    return figure


def robustness() -> Figure:
    """The same controller on 29 plants."""
    controller = pt.antijerk.designs(PLANT)["two degrees of freedom"]
    plants = pt.studies.variations(PLANT)
    responses = {name: pt.tip_in(plant, controller, steps_per_sample=2) for name, plant in plants.items()}
    final = {name: 250.0 * plant.final_acceleration for name, plant in plants.items()}
    worst, _ = pt.robustness(PLANT, controller).worst("oscillation_reduction")
    figure = new_figure(5.6, 3.4)
    ax = figure.subplots()
    pt.plots.robust_responses(responses, ax, final, worst)
    ax.set_xlim(0.4, 1.6)
    return figure


FIGURES: tuple[Callable[[], Figure], ...] = (
    schematic,
    chain,
    mode_shape,
    bode,
    load_change,
    launch,
    model_errors,
    tip_in,
    robustness,
)

if __name__ == "__main__":
    for draw in FIGURES:
        with matplotlib.rc_context({"svg.hashsalt": draw.__name__}):
            file = Path(__file__).parent / f"{draw.__name__}.svg"
            draw().savefig(file, metadata={"Date": None, "Creator": None})
