"""``modelDescription.xml`` of a car for FMI 2.0 and 3.0, and how its sources are built."""

from __future__ import annotations

from typing import NamedTuple
from xml.sax.saxutils import quoteattr

from ..base.signal_units import moving_nodes, unit_of
from .kernel import Kernel

# Exponents of the base units.
BASE_UNITS = {
    "rad/s": {"rad": 1, "s": -1},
    "rad/s^2": {"rad": 1, "s": -2},
    "m/s": {"m": 1, "s": -1},
    "m/s^2": {"m": 1, "s": -2},
    "N m": {"kg": 1, "m": 2, "s": -2},
    "N": {"kg": 1, "m": 1, "s": -2},
    "rad": {"rad": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "kg m^2": {"kg": 1, "m": 2},
    "N m/rad": {"kg": 1, "m": 2, "s": -2, "rad": -1},
    "N m s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
    "N/m": {"kg": 1, "s": -2},
    "N s/m": {"kg": 1, "s": -1},
    "1": {},
}


class Variable(NamedTuple):
    """A variable of the FMU, in the order of its references."""

    name: str
    unit: str
    causality: str
    variability: str
    start: float | None = None


def variables(data: Kernel) -> list[Variable]:
    """Inputs, outputs, times of the last event of each law, parameters, time."""
    along = moving_nodes([*data.inputs, *data.outputs], data.translating)
    found = [
        Variable(name, unit_of(name, along), "input", "continuous", data.capacities.get(name, 0.0))
        for name in data.inputs
    ]
    for name in data.outputs:
        variability = "discrete" if name.endswith("_mode") else "continuous"
        found.append(Variable(name, unit_of(name, along), "output", variability))
    found += [Variable(f"{name}_event_time", "s", "local", "discrete") for name in data.law_names]
    found += [Variable(each.name, each.unit, "parameter", "fixed", each.value) for each in data.parameters]
    return [*found, Variable("time", "s", "independent", "continuous")]


def model_description(data: Kernel, name: str, token: str, version: str) -> str:
    """The text of ``modelDescription.xml``."""
    found = variables(data)
    return (_version_2 if version == "2.0" else _version_3)(data, name, token, found)


def _version_2(data: Kernel, name: str, token: str, found: list[Variable]) -> str:
    listed = []
    for reference, each in enumerate(found):
        attributes = _attributes({"unit": _known(each.unit), "start": each.start})
        listed.append(
            f'    <ScalarVariable name={quoteattr(each.name)} valueReference="{reference}" causality="{each.causality}" '
            f'variability="{each.variability}"><Real{attributes}/></ScalarVariable>'
        )
    unknowns = "".join(f'<Unknown index="{i}"/>' for i, each in enumerate(found, 1) if each.causality == "output")
    return _lines(
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName="{name}" guid="{token}" generationTool="powertrain_ctrl" '
        'variableNamingConvention="flat" numberOfEventIndicators="0">',
        f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" '
        'canInterpolateInputs="true" canGetAndSetFMUstate="true" canSerializeFMUstate="true" '
        'canNotUseMemoryManagementFunctions="true">',
        f'    <SourceFiles><File name="{name}.c"/></SourceFiles>',
        "  </CoSimulation>",
        *_units(found),
        f'  <DefaultExperiment startTime="0" stopTime="1" stepSize="{data.dt!r}"/>',
        "  <ModelVariables>",
        *listed,
        "  </ModelVariables>",
        f"  <ModelStructure><Outputs>{unknowns}</Outputs><InitialUnknowns>{unknowns}</InitialUnknowns></ModelStructure>",
        "</fmiModelDescription>",
    )


def _version_3(data: Kernel, name: str, token: str, found: list[Variable]) -> str:
    listed = []
    for reference, each in enumerate(found):
        initial = "calculated" if each.causality in ("output", "local") else None
        attributes = _attributes({"initial": initial, "unit": _known(each.unit), "start": each.start})
        listed.append(
            f'    <Float64 name={quoteattr(each.name)} valueReference="{reference}" causality="{each.causality}" '
            f'variability="{each.variability}"{attributes}/>'
        )
    outputs = [reference for reference, each in enumerate(found) if each.causality == "output"]
    structure = [f'    <Output valueReference="{reference}"/>' for reference in outputs]
    structure += [f'    <InitialUnknown valueReference="{reference}"/>' for reference in outputs]
    return _lines(
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="3.0" modelName="{name}" instantiationToken="{token}" '
        'generationTool="powertrain_ctrl" variableNamingConvention="flat">',
        f'  <CoSimulation modelIdentifier="{name}" canHandleVariableCommunicationStepSize="true" '
        f'fixedInternalStepSize="{data.dt!r}" canGetAndSetFMUState="true" canSerializeFMUState="true"/>',
        *_units(found),
        f'  <DefaultExperiment startTime="0" stopTime="1" stepSize="{data.dt!r}"/>',
        "  <ModelVariables>",
        *listed,
        "  </ModelVariables>",
        "  <ModelStructure>",
        *structure,
        "  </ModelStructure>",
        "</fmiModelDescription>",
    )


def build_description(name: str) -> str:
    """The text of ``sources/buildDescription.xml`` of FMI 3.0."""
    return _lines(
        '<?xml version="1.0" encoding="UTF-8"?>',
        '<fmiBuildDescription fmiVersion="3.0">',
        f'  <BuildConfiguration modelIdentifier="{name}">',
        f'    <SourceFileSet language="C99"><SourceFile name="{name}.c"/></SourceFileSet>',
        "  </BuildConfiguration>",
        "</fmiBuildDescription>",
    )


def _known(unit: str) -> str | None:
    return unit if unit in BASE_UNITS else None


def _attributes(values: dict[str, str | float | None]) -> str:
    given = {key: value for key, value in values.items() if value is not None}
    return "".join(
        f" {key}={quoteattr(value if isinstance(value, str) else repr(float(value)))}" for key, value in given.items()
    )


def _units(found: list[Variable]) -> list[str]:
    units = []
    for unit, exponents in BASE_UNITS.items():
        if any(each.unit == unit for each in found):
            base = "".join(f' {name}="{power}"' for name, power in exponents.items())
            units.append(f'    <Unit name="{unit}"><BaseUnit{base}/></Unit>')
    return ["  <UnitDefinitions>", *units, "  </UnitDefinitions>"]


def _lines(*lines: str) -> str:
    return "\n".join([*lines, ""])
