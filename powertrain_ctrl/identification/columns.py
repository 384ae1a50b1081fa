"""Columns of a measurement file by their names: text with any delimiter, MAT, Parquet."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import FileError, suggestion
from ..base.paths import mat_variables, read_bytes, written

# An hour of fifty signals at 100 Hz takes a quarter of this [bytes].
LARGEST_RUN = 2**29
# The header is looked for in so many lines; loggers write some of their own before it.
HEADER_WITHIN = 200
# None is any white space.
DELIMITERS: tuple[str | None, ...] = (";", "\t", ",", "|", None)


def read_columns(path: str | Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Columns as arrays of float, nan where there is no value.

    Raises
    ------
    FileError
        Not there, of another format, columns that are missing or there twice, cells that are no numbers.
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".mat":
        return _picked(path, _mat_variables(path), names)
    if suffix in (".parquet", ".pq"):
        return _picked(path, _parquet_columns(path), names)
    return _text_columns(path, names)


def _text_columns(path: str | Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    content = read_bytes(path, LARGEST_RUN)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:  # what German loggers write
        text = content.decode("cp1252", errors="replace")
    lines = text.splitlines()
    header, delimiter, labels = _header(path, lines, names)
    index = [labels.index(name) for name in names]
    rows: list[list[float]] = []
    for number, cells in _rows(lines[header + 1 :], delimiter):
        line = header + 1 + number
        if len(cells) <= max(index):
            remedy = "; a decimal comma needs another delimiter" if delimiter == "," else ""
            raise FileError(f"{written(path)}: line {line} has {len(cells)} values, the header {len(labels)}{remedy}")
        picked = [cells[i] for i in index]
        if not rows and not any(_is_number(cell, delimiter) for cell in picked):
            continue  # units below the names
        rows.append([_number(path, line, *pair, delimiter) for pair in zip(names, picked, strict=True)])
    return dict(zip(names, np.array(rows, dtype=float).reshape(-1, len(names)).T.copy(), strict=True))


def _header(path: str | Path, lines: list[str], names: Sequence[str]) -> tuple[int, str | None, list[str]]:
    """Number of the line with all these names, its delimiter and what it names."""
    best: tuple[int, list[str]] = (0, [])
    for i, line in enumerate(lines[:HEADER_WITHIN]):
        for delimiter in DELIMITERS:
            labels = _cells(line, delimiter)
            found = sum(name in labels for name in names)
            if found == len(set(names)):
                for name in names:
                    if labels.count(name) > 1:
                        raise FileError(
                            f'{written(path)}: column "{name}" is there {labels.count(name)} times, permitted: once'
                        )
                return i, delimiter, labels
            # where none of the names is found, the line with most labels is taken for the header
            if (found, len(labels)) > (best[0], len(best[1])):
                best = found, labels
    missing = next(name for name in names if name not in best[1])
    raise _missing(path, missing, [label for label in best[1] if label])


def _missing(path: str | Path, name: str, known: Sequence[str]) -> FileError:
    return FileError(f'{written(path)}: column "{name}" is not there{suggestion(name, known)}')


def _rows(lines: Sequence[str], delimiter: str | None) -> Iterator[tuple[int, list[str]]]:
    for number, line in enumerate(lines, start=1):
        if line.strip():
            yield number, _cells(line, delimiter)


def _cells(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None or '"' not in line:
        return [cell.strip() for cell in line.split(delimiter)]
    return [cell.strip() for cell in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True), [])]


def _as_float(cell: str, delimiter: str | None) -> float:
    if delimiter != "," and "," in cell and "." not in cell:
        cell = cell.replace(",", ".")
    if "_" in cell:  # 1_000 is a number to Python alone
        raise ValueError
    return float(cell)


def _is_number(cell: str, delimiter: str | None) -> bool:
    try:
        _as_float(cell, delimiter)
    except ValueError:
        return False
    return True


def _number(path: str | Path, line: int, name: str, cell: str, delimiter: str | None) -> float:
    if not cell:
        return np.nan
    try:
        value = _as_float(cell, delimiter)
    except ValueError:
        raise FileError(
            f'{written(path)}: line {line}, column "{name}": {cell!r}, permitted: a number or nothing'
        ) from None
    return value


def _mat_variables(path: str | Path) -> dict[str, Any]:
    found = mat_variables(path, LARGEST_RUN, squeezed=True)
    columns: dict[str, Any] = {}
    for name, value in found.items():
        if name.startswith("__"):
            continue
        columns[name] = value
        for inner in (
            getattr(value.dtype, "names", None) or () if isinstance(value, np.ndarray) and not value.shape else ()
        ):
            columns[f"{name}.{inner}"] = value[inner].item()
    return columns


def _parquet_columns(path: str | Path) -> dict[str, Any]:
    content = io.BytesIO(read_bytes(path, LARGEST_RUN))
    try:
        import pandas
    except ImportError as error:
        raise FileError(f"{written(path)}: Parquet needs pandas with pyarrow, which are not installed") from error
    try:
        table = pandas.read_parquet(content)
    except Exception as error:
        raise FileError(f"{written(path)}: not a Parquet file: {error}") from error
    return {str(name): table[name].to_numpy() for name in table.columns}


def _picked(path: str | Path, columns: dict[str, Any], names: Sequence[str]) -> dict[str, np.ndarray]:
    picked = {}
    for name in names:
        if name not in columns:
            raise _missing(path, name, list(columns))
        values = np.asarray(columns[name])
        if values.dtype.kind not in "fiu" or values.ndim != 1:
            raise FileError(
                f'{written(path)}: "{name}" is {values.dtype} of shape {values.shape}, permitted: numbers (N,)'
            )
        picked[name] = values.astype(float)
    lengths = {name: len(values) for name, values in picked.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} {length}" for name, length in lengths.items())
        raise FileError(f"{written(path)}: lengths differ: {listed}; permitted: as many values of each")
    return picked
