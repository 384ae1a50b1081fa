"""A driveline as an FMU (functional mock-up unit) for co-simulation: FMI 2.0 and 3.0, in plain C."""

from __future__ import annotations

import io
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..base.checks import POSITIVE, Period, checked_number
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.paths import write_whole
from ..driveline.collection import HasDriveline
from . import c_tables
from .c_model import require_c_name
from .compilers import libraries
from .description import build_description, model_description
from .kernel import Kernel, kernel

# Time stamp of everything in the file, so that the same car gives the same bytes.
STAMP = (2000, 1, 1, 0, 0, 0)


@checked
def fmu(
    car: HasDriveline,
    path: str | Path,
    dt: Period = 0.001,
    version: str = "3.0",
    hold: str = "zero",
    name: str = "driveline",
    initial_speed: Mapping[str, Any] | None = None,
    parameters: Sequence[str] = (),
    systems: Sequence[str] | None = None,
) -> None:
    """Write a driveline with its laws as an FMU for co-simulation, with its C sources.

    Its variables are the inputs and outputs of `nonlinear_system`, and so are its numbers: exact steps, events within a
    step located. A capacity starts as the clutch's ``max_torque``, every other input as 0. ``<law>_event_time`` [s] is when
    a law last changed its mode. Steps may have any length; the state can be saved, restored and serialized. The file
    appears whole or not at all.

    Parameters
    ----------
    car : Driveline or TwoMass
        Whether its clutches are locked or released does not matter: the capacity decides.
    path : str or Path
        Ends in .fmu.
    dt : float
        Step inside [s]; a longer communication step is cut into such.
    version : {"3.0", "2.0"}
        Of FMI.
    hold : {"zero", "linear"}
        Inputs are constant over a communication step; or go straight from where the last step ended to what is set for
        this one. In FMI 2.0 an importer can set the derivatives of inputs instead, with either.
    name : str
        Of the model and of its library; an identifier.
    initial_speed : mapping, optional
        Node to speed at the start, as in `simulate`; at rest unless told.
    parameters : sequence of str
        ``"element.value"``, such as ``"vehicle.m"`` or ``"drive_shafts.stiffness"``, that the importer may change before the
        start: those that act linearly on inertias, stiffnesses and dampers. Capacities are inputs.
    systems : sequence of str, optional
        For which to build libraries: "linux", "windows", "macos" and, of FMI 3.0, "macos_arm" and "linux_arm". None
        builds for all of them where ziglang is installed (the extra ``fmu``), else for this one if a compiler is found;
        () writes the sources only.

    Returns
    -------
    None

    Raises
    ------
    FileError
        A path that cannot be written.
    UnknownNameError
        A node or parameter that is not there.
    PowertrainError
        A car that cannot be exported, and why (as of `c_plant`); another version or hold, a name that is no identifier, a
        system without a compiler.

    Examples
    --------
    >>> import pathlib, tempfile, zipfile, powertrain_ctrl as pt
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "car.fmu"
    >>> pt.export.fmu(pt.examples.conventional(), file, systems=())
    >>> zipfile.ZipFile(file).namelist()
    ['modelDescription.xml', 'sources/driveline.c', 'sources/buildDescription.xml']
    """
    dt = checked_number("fmu", "dt", dt, "s", POSITIVE)
    if version not in ("2.0", "3.0"):
        raise PowertrainError(f'version = {version!r}, permitted: "2.0", "3.0"')
    if hold not in ("zero", "linear"):
        raise PowertrainError(f'hold = {hold!r}, permitted: "zero", "linear"')
    if Path(path).suffix != ".fmu":
        raise PowertrainError(f'path = "{path}", permitted: one that ends in .fmu')
    require_c_name(name)
    data = kernel(car, dt, initial_speed, parameters)
    source, token = fmu_source(data, name, version, hold)
    files: dict[str, str | bytes] = {
        "modelDescription.xml": model_description(data, name, token, version),
        f"sources/{name}.c": source,
    }
    if version == "3.0":
        files["sources/buildDescription.xml"] = build_description(name)
    files |= libraries(source, name, version, systems)
    write_whole(path, _zipped(files))


def fmu_source(data: Kernel, name: str, version: str, hold: str) -> tuple[str, str]:
    """C source of the FMU, and the token that it knows its description by."""
    core = c_tables.source(data, name)
    token = f"{{{uuid.uuid5(uuid.NAMESPACE_URL, core + version + hold)}}}"
    starts = ", ".join(repr(data.capacities.get(each, 0.0)) for each in data.inputs) or "0"
    constants = [
        f'#define TOKEN "{token}"',
        f"#define LINEAR {int(hold == 'linear')}",
        f"static const double INPUTS[] = {{{starts}}};",
    ]
    wrapper = [c_tables.text(each).replace("@NAME@", name) for each in ("fmu", f"fmi{version[0]}")]
    return "\n".join([core, *constants, "", *wrapper]), token


def _zipped(files: Mapping[str, str | bytes]) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        for name, what in files.items():
            item = zipfile.ZipInfo(name, STAMP)
            item.compress_type, item.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
            archive.writestr(item, what)
    return content.getvalue()
