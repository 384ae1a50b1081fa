"""Plain values as MAT and JSON files and back, to the last bit."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import scipy.io

from ..base.errors import FileError
from ..base.paths import mat_variables, read_text, write_whole, written

LARGEST_MAT = 2**31
LONGEST_NAME = 63
# Words that MATLAB keeps for itself.
RESERVED = set(
    "break case catch classdef continue else elseif end for function global if otherwise parfor persistent return spmd "
    "switch try while".split()
)
FORMAT = "powertrain_ctrl systems"


def write_mat(path: str | Path, systems: Mapping[str, Mapping[str, Any]]) -> None:
    """One structure a system, MAT version 5.

    Raises
    ------
    FileError
        A path that cannot be written, or a name that MATLAB does not take.
    """
    for name in systems:
        if not (
            name.isascii()
            and name.isidentifier()
            and name[0] != "_"
            and len(name) <= LONGEST_NAME
            and name not in RESERVED
        ):
            raise FileError(
                f'{written(path)}: "{name}" is no name for MATLAB, permitted: at most {LONGEST_NAME} letters, '
                "digits and _, a letter first"
            )
    file = io.BytesIO()
    try:
        scipy.io.savemat(
            file,
            {name: _struct(path, plain) for name, plain in systems.items()},
            long_field_names=True,
            oned_as="column",
        )
    except ValueError as error:
        raise FileError(f"{written(path)}: cannot be written: {error}") from error
    write_whole(path, file.getvalue())


def _struct(path: str | Path, plain: Mapping[str, Any]) -> dict[str, Any]:
    made: dict[str, Any] = {}
    for name, value in plain.items():
        if len(name) > LONGEST_NAME or not name.isascii():
            raise FileError(
                f'{written(path)}: "{name}" is no name for MATLAB, permitted: at most {LONGEST_NAME} ASCII letters'
            )
        if isinstance(value, list):
            cells = np.empty((len(value), 1), dtype=object)
            cells[:, 0] = value
            made[name] = cells
        elif isinstance(value, Mapping):
            # a structure without fields is no structure to MATLAB
            made[name] = _struct(path, value) if value else np.zeros((0, 0))
        else:
            made[name] = value
    return made


def read_mat(path: str | Path) -> dict[str, Any]:
    """Plain values by variable.

    Raises
    ------
    FileError
        No MAT file of version 5 to 7.
    """
    found = mat_variables(path, LARGEST_MAT)
    try:
        return {name: _value(value) for name, value in found.items() if not name.startswith("__")}
    except (LookupError, TypeError, ValueError) as error:
        raise FileError(
            f"{written(path)}: permitted: what pt.export.mat or MATLAB writes of systems: {error}"
        ) from error


def _value(value: np.ndarray) -> Any:
    """A structure as a dict, cells as a list of strings, letters as a string, all else as an array."""
    if value.dtype.names:
        return {inner: _value(value[0, 0][inner]) for inner in value.dtype.names}
    if value.dtype.kind == "O":
        return ["".join(cell.ravel().tolist()) for cell in value.ravel()]
    if value.dtype.kind in "US":
        return "".join(value.ravel().tolist())
    return np.asarray(value, dtype=float)


def write_json(path: str | Path, systems: Mapping[str, Mapping[str, Any]]) -> None:
    """One object a system; numbers in as many digits as tell them from all others, nan as null.

    Raises
    ------
    FileError
        A path that cannot be written.
    """
    content = {"format": FORMAT, "systems": {name: _jsonable(plain) for name, plain in systems.items()}}
    write_whole(path, json.dumps(content, allow_nan=False, ensure_ascii=False, indent=1) + "\n")


def _jsonable(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _jsonable(inner) for name, inner in value.items()}
    if isinstance(value, np.ndarray):
        # the shape says how an empty one is empty
        return {"shape": list(value.shape), "values": [_jsonable(each) for each in value.ravel().tolist()]}
    if isinstance(value, float) and not np.isfinite(value):
        return None if np.isnan(value) else "inf" if value > 0.0 else "-inf"
    return value


def read_json(path: str | Path) -> dict[str, Any]:
    """Plain values by name.

    Raises
    ------
    FileError
        Not JSON, or not of this package.
    """
    try:
        content = json.loads(read_text(path, "JSON"))
    except (ValueError, RecursionError) as error:
        if isinstance(error, FileError):
            raise
        raise FileError(f"{written(path)}: not JSON: {error}") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT or not isinstance(content.get("systems"), dict):
        raise FileError(f'{written(path)}: permitted: what pt.export.json has written ("format": "{FORMAT}")')
    return {name: _from_jsonable(plain) for name, plain in content["systems"].items()}


def _from_jsonable(value: Any) -> Any:
    if isinstance(value, dict):
        if value.keys() == {"shape", "values"}:
            return np.array([_number(each) for each in value["values"]], dtype=float).reshape(value["shape"])
        return {name: _from_jsonable(inner) for name, inner in value.items()}
    return np.nan if value is None else value


def _number(value: Any) -> float:
    return np.nan if value is None else float(value)
