"""What identification gives: the car, its parameters with their errors, and how well it does what was measured."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..base.doors import called, checked
from ..base.errors import UnknownNameError
from ..base.records import Record
from ..base.tables import html_table, text_table


@called
@dataclass(frozen=True, eq=False, repr=False)
class Validation(Record):
    """A measured run and what a car would have been measured to do in it.

    Offsets of the outputs, the state at the start and, if asked for, a constant road load are those that fit best; the
    car's parameters are as they are.

    Attributes
    ----------
    title : str
        Of the run.
    time : (N,) ndarray
        [s].
    measured, model : dict of str to (N,) ndarray
        By output; nan in ``measured`` where there is no sample.
    inputs : dict of str to ndarray
        Times [s] and values (2, M) of each input.
    road_load : float
        Constant force or torque besides the inputs, 0 if not asked for [N or N m].

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car, t = pt.examples.conventional(), np.arange(0.0, 3.0, 0.01)
    >>> run = pt.simulate(car, t, {"engine_torque": np.interp(t, [0.5, 0.6], [0.0, 100.0])})
    >>> too_heavy = pt.validate(car.replace("vehicle", m=2400.0), run, signals="engine_speed")
    >>> {name: round(percent) for name, percent in too_heavy.fit.items()}
    {'engine_speed': 89}
    """

    title: str
    time: np.ndarray
    measured: dict[str, np.ndarray]
    model: dict[str, np.ndarray]
    inputs: dict[str, np.ndarray] = field(default_factory=dict)
    road_load: float = 0.0

    @checked
    def residual(self, signal: str) -> np.ndarray:
        """(N,) ndarray: measured less model.

        Parameters
        ----------
        signal : str

        Returns
        -------
        (N,) ndarray
        """
        if signal not in self.measured:
            raise UnknownNameError("signal", signal, self.measured, "an output of this run")
        return self.measured[signal] - self.model[signal]

    @property
    def fit(self) -> dict[str, float]:
        """Output to ``100 (1 - |measured - model| / |measured - mean|)`` [%]: 100 is exact, 0 no better than the mean."""
        found = {}
        for name, measured in self.measured.items():
            known = np.isfinite(measured)
            about = measured[known] - measured[known].mean()
            found[name] = 100.0 * float(1.0 - np.linalg.norm(self.residual(name)[known]) / np.linalg.norm(about))
        return found

    @checked
    def spectrum(self, signal: str) -> tuple[np.ndarray, np.ndarray]:
        """What is left over frequency: where the model lacks a mode, or an order shows.

        Parameters
        ----------
        signal : str

        Returns
        -------
        frequency_hz, density : (M,) ndarray
            [Hz], unit of the signal squared per Hz; by Welch's method on lines between the samples.
        """
        import scipy.signal  # takes longer to import than all else here

        left = self.residual(signal)
        known = np.isfinite(left)
        step = float(np.median(np.diff(self.time)))
        grid = np.arange(self.time[known][0], self.time[known][-1] + 0.5 * step, step)
        even = np.interp(grid, self.time[known], left[known])
        return scipy.signal.welch(even, 1.0 / step, nperseg=min(len(even), max(64, len(even) // 4)))

    def __repr__(self) -> str:
        return f"Validation on {self.title}: " + ", ".join(f"{n} {p:.1f} %" for n, p in self.fit.items())


@called
@dataclass(frozen=True, eq=False, repr=False)
class Identified(Record):
    """A car whose parameters were found from measured runs.

    Attributes
    ----------
    car : Driveline or TwoMass
        With the values found; it goes wherever a car goes. Values that were not told apart are such that it does what was
        measured.
    start : Driveline or TwoMass
        As it was given.
    values : dict
        Parameter to its value, SI; nan where it is not determined.
    standard_errors : dict
        Parameter or delayed signal to its standard error in the same unit.
    delays : dict
        Signal to its delay [s]: positive if a torque acts later than it is recorded, or a speed is recorded later than it
        happened.
    correlation : (k, k) ndarray
        Of the errors, in the order of ``standard_errors``.
    not_determined : tuple of str
        What the runs do not tell apart or not at all, in words, with what would help.
    noise : dict
        Input or output to the standard deviation of its noise, per sample.
    runs, before : tuple of Validation
        Each run with the car found, and with the car as it was given.
    units : dict
        Of the parameters.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car, t = pt.examples.conventional(), np.arange(0.0, 3.0, 0.01)
    >>> run = pt.simulate(car, t, {"engine_torque": np.interp(t, [0.5, 0.6], [0.0, 100.0])})
    >>> guess = car.replace("vehicle", m=2400.0)
    >>> found = pt.identify(guess, run, ["vehicle.m"], signals="engine_speed")
    >>> round(found.values["vehicle.m"], 6), pt.modes(found.car).frequency_hz[1].round(2)
    (2000.0, np.float64(2.64))
    """

    car: Any
    start: Any
    values: dict[str, float]
    standard_errors: dict[str, float]
    delays: dict[str, float]
    correlation: np.ndarray
    not_determined: tuple[str, ...]
    noise: dict[str, float]
    runs: tuple[Validation, ...]
    before: tuple[Validation, ...]
    units: dict[str, str]

    def __repr__(self) -> str:
        return "\n".join([text_table(*self.table()), *self._notes()])

    def _repr_html_(self) -> str:
        return html_table(*self.table()) + "".join(f"<p>{note}</p>" for note in self._notes())

    def table(self) -> tuple[list[str], list[list[str]]]:
        """Headers and rows: parameters and delays with unit, standard error and its part of the value.

        Returns
        -------
        headers : list of str
        rows : list of list of str
        """
        rows = []
        for name, value in {
            **self.values,
            **{f"delay of {signal}": delay for signal, delay in self.delays.items()},
        }.items():
            signal = name.removeprefix("delay of ")
            error = self.standard_errors[signal]
            known = np.isfinite(value)
            part = f"{100 * error / abs(value):.2f} %" if known and name in self.values else ""
            unit = self.units.get(name, "s")
            rows.append(
                [name, f"{value:.6g}" if known else "–", unit, f"{error:.2g}" if np.isfinite(error) else "–", part]
            )
        return ["parameter", "value", "unit", "standard error", "of it"], rows

    def _notes(self) -> list[str]:
        notes = [f"not determined: {sentence}" for sentence in self.not_determined]
        for run, before in zip(self.runs, self.before, strict=True):
            fits = ", ".join(
                f"{name} {percent:.1f} % (before {before.fit[name]:.1f} %)" for name, percent in run.fit.items()
            )
            notes.append(f"fit on {run.title}: {fits}")
        return notes
