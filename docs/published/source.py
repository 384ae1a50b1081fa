"""The source's own tables and figures."""

import tomllib
from importlib import resources

import powertrain_ctrl as pt

from . import Case, Row, printed

TABLES = tomllib.loads(resources.files(pt.examples).joinpath("source_tables.toml").read_text(encoding="utf-8"))
# The source prints 31.6 for 31.65: truncated, all else is rounded.
TRUNCATED = "31.6"


def car(state: str, damping: str | None = None) -> pt.Driveline:
    whole = pt.examples.conventional(damping=damping)
    return whole if state == "closed" else whole.release("clutch").part("vehicle")


def frequencies(state: str) -> Case:
    table = TABLES[state]
    rows = [
        # a rigid motion is exactly that
        printed(f"f{i}", text, f, "Hz", {TRUNCATED: 1.0, "0": 0.0}.get(text, 0.5))
        for i, (text, f) in enumerate(zip(table["printed"], pt.modes(car(state)).frequency_hz, strict=True))
    ]
    return Case(f"Natural frequencies {table['equation']}, {table['title']}", "", tuple(rows))


def shape(state: str) -> Case:
    """The figure has no numbers; these are the eigenvectors of the source's own matrices."""
    table, modes = TABLES[state]["shape"], pt.modes(car(state))
    ours = [modes.reflected_shapes[modes.nodes.index(node), 1] for node in table["nodes"]]
    rows = [
        Row(node, theirs, float(value), "", table["tolerance"])
        for node, theirs, value in zip(table["nodes"], table["computed"], ours, strict=True)
    ]
    text = "The figure prints no numbers; beside ours is the eigenvector of the source's matrices, by another program."
    return Case(f"Dominant mode of Fig. {table['figure']}, reflected angles", text, tuple(rows))


def control_model(number: str, state: str) -> Case:
    table = TABLES[f"table_{number}"]
    model = pt.two_mass(car(state, state), method="source")
    units = {"J1": "kg m²", "J2": "kg m²", "stiffness": "N m/rad", "damping": "N m s/rad", "ratio": ""}
    rows = [printed(name, table[name], getattr(model, name), unit) for name, unit in units.items()]
    text = "The source gives no damping for its detailed model; ours is chosen so that the printed damping comes out."
    return Case(f"Table {number}, {table['title']}", text, tuple(rows))


def launch() -> Case:
    events = pt.launch(pt.examples.conventional(damping="open")).events
    text = "The source does not print the ramps; ours are chosen so that the slip ends at the printed time."
    return Case("Launch of Fig. 2.11", text, (printed("slip ends", "2.65", events[-1].time, "s"),))


def cases() -> list[Case]:
    return [
        frequencies("closed"),
        frequencies("open"),
        shape("closed"),
        shape("open"),
        control_model("2.2", "closed"),
        control_model("2.3", "open"),
        launch(),
    ]
