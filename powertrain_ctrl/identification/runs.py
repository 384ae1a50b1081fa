"""Measured runs from files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..base.doors import checked
from ..base.errors import PowertrainError, SignalError, UnknownNameError
from ..base.paths import written
from ..base.units import in_si
from .columns import read_columns
from .measured import MeasuredRun, measured_run


@checked
def read_run(
    path: str | Path, time: str, units: Mapping[str, str | float] | None = None, **signals: str
) -> MeasuredRun:
    """Measured signals from a file, by the names that the car's signals have.

    Text with a header and any delimiter (semicolon, tab, comma, bar, white space) and either decimal sign, lines before the
    header and a line of units below it are passed over; ``.mat`` up to version 7, fields of a structure as "run.torque";
    ``.parquet`` if pandas is installed. Time stamps stay as they are, cells without a value are nan.

    Parameters
    ----------
    path : str or Path
    time : str
        Column of the time.
    units : mapping, optional
        Signal, or "time", to the unit in the file: "rpm", "km/h", "deg", "ms", "kNm", ... or the number of SI units that
        one of it is, such as 1 / (3.6 * 0.31) for a wheel speed in km/h at a radius of 0.31 m. Without it a signal is taken
        as it is.
    **signals : str
        Signal name, as ``engine_torque``, to its column.

    Returns
    -------
    MeasuredRun

    Raises
    ------
    FileError
        A file that cannot be read, a column that is not there, a cell that is no number.
    SignalError
        Time that does not increase, values that are not finite, a signal of fewer than two samples.
    PowertrainError
        No signal at all, or a unit that is not known.
    UnknownNameError
        A unit of a signal that is not asked for.

    Examples
    --------
    >>> import pathlib, tempfile, powertrain_ctrl as pt
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("t;T_ice;n_ice\\ns;Nm;1/min\\n0,00;30,5;1500\\n0,01;31,0;1501,25\\n0,02;30,25;1503\\n")
    >>> units = {"engine_speed": "rpm"}
    >>> run = pt.read_run(file, time="t", engine_torque="T_ice", engine_speed="n_ice", units=units)
    >>> run["engine_torque"], run["engine_speed"].round(2), run.inputs
    (array([30.5 , 31.  , 30.25]), array([157.08, 157.21, 157.39]), ('engine_torque',))
    """
    if not signals:
        raise PowertrainError('no signal is asked for, permitted: signal="column", such as engine_torque="T_ice"')
    units = dict(units or {})
    for name in units:
        if name not in ("time", *signals):
            raise UnknownNameError("signal", name, ["time", *signals], "one that is asked for")
    columns = read_columns(path, [time, *signals.values()])
    stamps = in_si(columns[time], units.get("time", 1.0), "time")
    values = {name: in_si(columns[column], units.get(name, 1.0), name) for name, column in signals.items()}
    try:
        return measured_run(stamps, values, Path(path).name)
    except SignalError as error:
        raise SignalError(f"{written(path)}: {error}") from error
