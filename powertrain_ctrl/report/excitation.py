"""Section on engine orders: the speeds at which they meet the modes."""

from __future__ import annotations

import numpy as np

from .. import plots
from ..base.tables import Rows
from ..orders.critical import critical_speeds
from ..orders.engine import Engine
from ..plots.style import words
from .subject import RESPONSE_LIMIT, Picture, Section, Subject, Table, new_figure

# Orders of which engines with two to twelve cylinders have most, and the speeds at which they run [1/min].
MAIN_ORDERS = (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0)
SPEEDS = (600.0, 6000.0)
# Modes that are damped more do not resonate: the peak of a single inertia on its spring is gone.
FLAT = 0.5**0.5


def orders_section(subject: Subject) -> Section | None:
    title, car, node = "Engine orders", subject.responding, subject.driving
    heavy = [name for e in car for row in e.inertias for name in row.nodes]
    if node in car.translating or node not in heavy or len(subject.as_given) > RESPONSE_LIMIT:
        return None
    low, high = SPEEDS
    engine = Engine(cylinders=1, orders=dict.fromkeys(MAIN_ORDERS, 1.0))
    critical = critical_speeds(car, engine, SPEEDS, nodes=node)
    if not len(critical):
        return Section(title, [f"From {low:g} to {high:g} rpm no main order of the {words(node)} meets a mode."])
    text = [
        f"Speeds from {low:g} to {high:g} rpm at which a main order of the {words(node)} has the frequency of a "
        "mode, and how much of its motion is there. An engine in line with n cylinders has most of order n / 2 "
        "and its multiples. Modes with zeta above 0.71, which do not resonate, are left out."
    ]
    rows: Rows = [row for row, zeta in zip(critical.rows(), critical.damping_ratio, strict=True) if zeta <= FLAT]
    figure = new_figure(6.8, 4.6)
    plots.campbell(critical, figure.subplots())
    met = ", ".join(f"{order:g}" for order in np.unique(critical.order))
    caption = f"Campbell diagram: natural frequencies and main orders, {met}"
    headers = ("mode", "order", "f [Hz]", "rpm", "zeta [-]", "share at the engine", "most strain energy in")
    table = Table("Critical speeds", headers, rows)
    return Section(title, text, tables=[table], pictures=[Picture("campbell", caption, figure)])
