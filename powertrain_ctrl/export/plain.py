"""Systems, two-mass models and responses as plain values, and back: numbers, arrays, strings, lists of strings, mappings.

The names are those that MATLAB's ``ss`` has. A MAT file gives a number back as an array of one, a row as a matrix, and
what is empty as an empty array; what it was is known here.
"""

from __future__ import annotations

import dataclasses
import json
import typing
from collections.abc import Callable, Collection, Mapping
from typing import Any

import control
import numpy as np

from ..base.errors import PowertrainError
from ..base.signal_units import moving_nodes, unit_of
from ..base.systems import linear_system
from ..hybrid.response import Event, Response, State
from ..identification.measured import MeasuredRun
from ..reduction.twomass import SwitchedTwoMass, TwoMass
from ..sampled.plant import SampledPlant

PERMITTED = "a control.StateSpace, SampledPlant, TwoMass, SwitchedTwoMass, Response or control.TimeResponseData"
# What MATLAB writes for a discrete system without a sample time.
UNSPECIFIED = -1.0


def to_plain(name: str, thing: Any, moving: Collection[str]) -> dict[str, Any]:
    """What is written of it.

    Raises
    ------
    PowertrainError
        Something that has no matrices, or is no such thing.
    """
    if isinstance(thing, SampledPlant):
        if thing.has_direction:
            raise PowertrainError(
                f'"{name}" has a lag or a delay that depends on direction, which no linear system has, permitted: its '
                "discrete(), which has the longer of both"
            )
        thing = thing.discrete()
    for kind, (write, _) in KINDS.items():
        if isinstance(thing, CLASSES[kind]):
            return {"Kind": kind, **write(thing, moving)}
    if isinstance(thing, control.NonlinearIOSystem | control.TransferFunction):
        how = "control.ss(...) makes one of it" if isinstance(thing, control.TransferFunction) else "it is not linear"
        raise PowertrainError(f'"{name}" is a {type(thing).__name__} without matrices ({how}), permitted: {PERMITTED}')
    raise PowertrainError(f'"{name}" is a {type(thing).__name__}, permitted: {PERMITTED}')


def from_plain(plain: Mapping[str, Any]) -> Any:
    """What was written; raises whatever comes of something else."""
    kind = plain.get("Kind", "state space")
    if kind not in KINDS:
        raise ValueError(f'kind "{kind}"')
    return KINDS[kind][1](plain)


def _system_to_plain(system: control.StateSpace, moving: Collection[str]) -> dict[str, Any]:
    labels = {"State": system.state_labels, "Input": system.input_labels, "Output": system.output_labels}
    along = moving_nodes([*system.input_labels, *system.output_labels], moving)
    return {
        "Name": system.name,
        **{letter: np.asarray(getattr(system, letter), dtype=float) for letter in "ABCD"},
        "Ts": np.nan if system.dt is None else UNSPECIFIED if system.dt is True else float(system.dt),
        **{f"{what}Name": list(names) for what, names in labels.items()},
        **{f"{what}Unit": [unit_of(each, along) for each in names] for what, names in labels.items()},
    }


def _system_from_plain(plain: Mapping[str, Any]) -> control.StateSpace:
    D = np.atleast_2d(np.asarray(plain["D"], dtype=float))
    n = round(np.sqrt(np.size(plain["A"])))
    shapes = {"A": (n, n), "B": (n, D.shape[1]), "C": (D.shape[0], n)}
    A, B, C = (np.asarray(plain[letter], dtype=float).reshape(shape) for letter, shape in shapes.items())
    Ts = _number(plain.get("Ts", 0.0))
    dt: Any = None if np.isnan(Ts) else True if Ts == UNSPECIFIED else 0 if Ts == 0.0 else Ts
    given = {word: _strings(plain.get(key, [])) for word, key in LABELS.items()}
    # MATLAB gives empty names to signals that have none
    labels: dict[str, Any] = {word: names for word, names in given.items() if names and all(names)}
    if isinstance(plain.get("Name"), str) and plain["Name"]:
        labels["name"] = plain["Name"]
    return linear_system(A, B, C, D, dt, **labels)


LABELS = {"states": "StateName", "inputs": "InputName", "outputs": "OutputName"}


def _model_to_plain(model: TwoMass, moving: Collection[str]) -> dict[str, Any]:
    values = {item.name: getattr(model, item.name) for item in dataclasses.fields(model)}
    values["radius"] = np.nan if model.radius is None else model.radius
    hints = typing.get_type_hints(TwoMass, include_extras=True)
    units = {}
    for name in values:
        quantity = next(
            (each for each in (hints[name], *typing.get_args(hints[name])) if hasattr(each, "__metadata__")), None
        )
        if quantity is not None:
            units[name] = quantity.__metadata__[0] or "1"
    return {**values, "Unit": units}


def _model_from_plain(plain: Mapping[str, Any]) -> TwoMass:
    names = [item.name for item in dataclasses.fields(TwoMass)]
    values: dict[str, Any] = {
        name: plain[name] if isinstance(plain[name], str) else _number(plain[name]) for name in names
    }
    if np.isnan(values["radius"]):
        values["radius"] = None
    return TwoMass(**values)


def _switched_to_plain(model: SwitchedTwoMass, moving: Collection[str]) -> dict[str, Any]:
    both = {name: _model_to_plain(getattr(model, name), moving) for name in ("closed", "slipping")}
    return {**both, "max_torque": model.max_torque, "clutch": model.clutch, "Unit": {"max_torque": "N m"}}


def _switched_from_plain(plain: Mapping[str, Any]) -> SwitchedTwoMass:
    both = {name: _model_from_plain(plain[name]) for name in ("closed", "slipping")}
    return SwitchedTwoMass(**both, max_torque=_number(plain["max_torque"]), clutch=str(plain["clutch"]))


def _response_to_plain(response: Response, moving: Collection[str]) -> dict[str, Any]:
    along = moving_nodes([*response.inputs, *response.outputs], moving)
    final = response.final
    return {
        "Title": response.title,
        "Measured": float(type(response) is not Response),
        "Time": response.time,
        "TimeUnit": "s",
        "InputName": list(response.inputs),
        "OutputName": list(response.outputs),
        "InputUnit": [unit_of(name, along) for name in response.inputs],
        "OutputUnit": [unit_of(name, along) for name in response.outputs],
        # a column a signal, inputs first
        "Data": response._values.T,
        "EventTime": np.array([event.time for event in response.events]),
        "EventElement": [event.element for event in response.events],
        "EventKind": [event.kind for event in response.events],
        "EventMode": [json.dumps(event.mode) for event in response.events],
        "EventHeat": np.array([event.heat for event in response.events]),
        "SlipEnergy": dict(response.slip_energy),
        "Modes": [json.dumps([law, number, name]) for law, of in response.modes.items() for number, name in of.items()],
        "Final": {
            "time": float(final.time),
            "twist": dict(final.twist),
            "speed": dict(final.speed),
            "mode": {law: json.dumps(mode) for law, mode in final.mode.items()},
            "exact": final._exact,
        },
    }


def _response_from_plain(plain: Mapping[str, Any]) -> Response:
    final = plain["Final"]
    modes: dict[str, dict[int, str]] = {}
    for each in _strings(plain["Modes"]):
        law, number, name = json.loads(each)
        modes.setdefault(law, {})[number] = name
    numbers = [_row(plain[key]).tolist() for key in ("EventTime", "EventHeat")]
    words = [_strings(plain[key]) for key in ("EventElement", "EventKind", "EventMode")]
    events = [
        Event(time, element, kind, json.loads(mode), heat)
        for time, heat, element, kind, mode in zip(*numbers, *words, strict=True)
    ]
    time = _row(plain["Time"])
    names = tuple(_strings(plain["InputName"])), tuple(_strings(plain["OutputName"]))
    cls = MeasuredRun if _number(plain["Measured"]) else Response
    return cls(
        time=time,
        inputs=names[0],
        outputs=names[1],
        events=tuple(events),
        slip_energy=_floats(plain["SlipEnergy"]),
        final=State(
            time=_number(final["time"]),
            twist=_floats(final["twist"]),
            speed=_floats(final["speed"]),
            mode={law: json.loads(mode) for law, mode in _mapping(final["mode"]).items()},
            _exact=_row(final["exact"]),
        ),
        _values=np.ascontiguousarray(np.asarray(plain["Data"], dtype=float).reshape(len(time), -1).T),
        title=str(plain["Title"]),
        modes=modes,
    )


def _number(value: Any) -> float:
    return float(np.asarray(value, dtype=float).reshape(()))


def _row(value: Any) -> np.ndarray:
    return np.asarray(value, dtype=float).ravel()


def _strings(value: Any) -> list[str]:
    if isinstance(value, str):
        return [value]
    return [] if isinstance(value, np.ndarray) and not value.size else [str(each) for each in value]


def _mapping(value: Any) -> Mapping[str, Any]:
    return {} if isinstance(value, np.ndarray) and not value.size else value


def _floats(values: Any) -> dict[str, float]:
    return {name: _number(value) for name, value in _mapping(values).items()}


def _data_to_plain(data: control.TimeResponseData, moving: Collection[str]) -> dict[str, Any]:
    inputs, outputs = (list(labels or []) for labels in (data.input_labels, data.output_labels))
    along = moving_nodes([*inputs, *outputs], moving)
    arrays = {"Output": data.y, "Input": data.u, "State": data.x}
    return {
        "Title": data.title or "",
        "Time": np.asarray(data.time, dtype=float),
        "TimeUnit": "s",
        "InputName": inputs,
        "OutputName": outputs,
        "StateName": list(data.state_labels or []),
        "InputUnit": [unit_of(name, along) for name in inputs],
        "OutputUnit": [unit_of(name, along) for name in outputs],
        **{
            f"{what}Data": np.zeros(0) if array is None else np.asarray(array, dtype=float)
            for what, array in arrays.items()
        },
        "OneInputOneOutput": float(bool(data.issiso)),
    }


def _data_from_plain(plain: Mapping[str, Any]) -> control.TimeResponseData:
    arrays = {what: np.asarray(plain[f"{what}Data"], dtype=float) for what in ("Output", "Input", "State")}
    names = {what: _strings(plain[f"{what}Name"]) or None for what in ("Output", "Input", "State")}
    return control.TimeResponseData(
        _row(plain["Time"]),
        arrays["Output"],
        arrays["State"] if arrays["State"].size else None,
        arrays["Input"] if arrays["Input"].size else None,
        issiso=bool(_number(plain["OneInputOneOutput"])),
        output_labels=names["Output"],
        input_labels=names["Input"],
        state_labels=names["State"],
        title=str(plain["Title"]) or None,
    )


Plain = dict[str, Any]
# What is written as what; the first that fits.
KINDS: dict[str, tuple[Callable[[Any, Collection[str]], Plain], Callable[[Mapping[str, Any]], Any]]] = {
    "state space": (_system_to_plain, _system_from_plain),
    "two-mass model": (_model_to_plain, _model_from_plain),
    "switched two-mass model": (_switched_to_plain, _switched_from_plain),
    "response": (_response_to_plain, _response_from_plain),
    "time response data": (_data_to_plain, _data_from_plain),
}
CLASSES: dict[str, type] = {
    "state space": control.StateSpace,
    "two-mass model": TwoMass,
    "switched two-mass model": SwitchedTwoMass,
    "response": Response,
    "time response data": control.TimeResponseData,
}
