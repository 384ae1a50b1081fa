"""Systems, models and responses to and from MATLAB and whatever reads JSON."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from ..base.doors import checked
from ..base.errors import FileError, PowertrainError
from ..base.paths import written
from .files import read_json, read_mat, write_json, write_mat
from .plain import from_plain, to_plain


@checked
def mat(systems: Mapping[str, Any], path: str | Path, moving: Iterable[str] = ("vehicle",)) -> None:
    """Write systems to a MAT file, one structure each, with names and units as MATLAB's ``ss`` has them.

    ``docs/to_simulink.md`` has the lines of MATLAB that read it. The file appears whole or not at all.

    Parameters
    ----------
    systems : dict
        Name to ``control.StateSpace`` (a controller, `state_space`), `SampledPlant` (its discrete model), `TwoMass`,
        `SwitchedTwoMass`, `Response` or ``control.TimeResponseData``.
    path : str or Path
    moving : iterable of str
        Nodes that move along the road: their speeds are in m/s. Those on which a force acts are known to.

    Returns
    -------
    None

    Raises
    ------
    FileError
        A path that cannot be written, or a name that MATLAB does not take.
    PowertrainError
        Nothing to write, or something else than these; a plant whose torque rises and falls differently.

    Examples
    --------
    >>> import pathlib, tempfile, powertrain_ctrl as pt
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "car.mat"
    >>> car = pt.examples.conventional()
    >>> pt.export.mat({"G": pt.state_space(car, "engine_torque", "engine_speed"), "model": pt.two_mass(car)}, file)
    >>> back = pt.export.load(file)
    >>> back["model"] == pt.two_mass(car), back["G"].output_labels
    (True, ['engine_speed'])
    """
    write_mat(path, _plain(systems, moving))


@checked
def json(systems: Mapping[str, Any], path: str | Path, moving: Iterable[str] = ("vehicle",)) -> None:
    """Write systems to a JSON file, one object each, with names and units.

    Every number has the digits that tell it from all others, so that it reads back the same to the last bit. Arrays are
    ``{"shape": [...], "values": [...]}``, row by row; nan is null. The file appears whole or not at all.

    Parameters
    ----------
    systems : dict
    path : str or Path
    moving : iterable of str
        As of `mat`.

    Returns
    -------
    None

    Raises
    ------
    FileError
        A path that cannot be written.
    PowertrainError
        Nothing to write, or something else than these.

    Examples
    --------
    >>> import pathlib, tempfile, powertrain_ctrl as pt
    >>> file, run = pathlib.Path(tempfile.mkdtemp()) / "run.json", pt.launch(pt.examples.conventional(damping="open"))
    >>> pt.export.json({"launch": run}, file)
    >>> pt.export.load(file)["launch"].events == run.events
    True
    """
    write_json(path, _plain(systems, moving))


@checked
def load(path: str | Path) -> dict[str, Any]:
    """Systems by name from a file of `mat` or `json`, each equal to the one that was written.

    A MAT file may also be MATLAB's own: structures with A, B, C, D and, if they have them, Ts, StateName, InputName and
    OutputName are systems.

    Parameters
    ----------
    path : str or Path
        Ends in .mat or .json.

    Returns
    -------
    dict

    Raises
    ------
    FileError
        Not there, of another format, or with something in it that is no such system.

    Examples
    --------
    >>> import pathlib, tempfile, powertrain_ctrl as pt
    >>> file, plant = pathlib.Path(tempfile.mkdtemp()) / "loop.mat", pt.SampledPlant(car=pt.examples.conventional())
    >>> pt.export.mat({"plant": plant, "controller": pt.antijerk.designs(plant)["two degrees of freedom"]}, file)
    >>> pt.export.load(file)["plant"].dt
    0.01
    """
    suffix = Path(path).suffix.lower()
    if suffix not in (".mat", ".json"):
        raise FileError(f"{written(path)}: permitted: a file that ends in .mat or .json")
    systems = {}
    for name, plain in (read_mat if suffix == ".mat" else read_json)(path).items():
        try:
            systems[name] = from_plain(plain)
        except (LookupError, TypeError, ValueError, AttributeError) as error:
            raise FileError(
                f'{written(path)}: "{name}" is none of the systems that pt.export writes: {error}'
            ) from error
    return systems


def _plain(systems: Mapping[str, Any], moving: Iterable[str]) -> dict[str, dict[str, Any]]:
    if not systems:
        raise PowertrainError('systems is empty, permitted: at least one, {"name": system}')
    for name in systems:
        if not isinstance(name, str) or not name:
            raise PowertrainError(f"systems has the name {name!r}, permitted: a string")
    return {name: to_plain(name, system, tuple(moving)) for name, system in systems.items()}
