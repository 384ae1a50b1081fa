"""Measured runs: signals on their own time stamps, with what is wrong with them told and nothing filled."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..base.checks import LARGEST, Period, Seconds
from ..base.doors import called, checked
from ..base.errors import SignalError
from ..base.tables import html_table, text_table
from ..hybrid.response import Response, State

# A step of time this much longer than the usual one is a gap; stamps of a bus jitter by less.
GAP = 1.75
# A sample stands out that is off both of what its neighbours lead to by so many standard deviations of that difference ...
STANDS_OUT = 6.0
# ... and by this part of the signal's range, which leaves corners and the grid of a resolution alone.
OF_RANGE = 0.02
# A normal distribution's standard deviation from its median magnitude.
FROM_MEDIAN = 1.4826
DRIVES = ("_torque", "_force", "_capacity")


class Gap(NamedTuple):
    """Stretch of a signal without samples, from the last one before it to the first one behind it [s]."""

    signal: str
    start: float
    stop: float
    missing: int


class Outlier(NamedTuple):
    """A single sample far from both of its neighbours: its time [s], its value and what these lead to."""

    signal: str
    time: float
    value: float
    expected: float


@called
@dataclass(frozen=True, eq=False, repr=False)
class MeasuredRun(Response):
    """Measured signals on their own time stamps, as `read_run` gives them; nan where there is no sample.

    It is a `Response`: it can be drawn, compared and converted as a simulated one.

    Attributes
    ----------
    time : (N,) ndarray
        [s], increasing, as uneven as it was measured.
    inputs, outputs : tuple of str
        Names of the signals: torques, forces and capacities, and all others. What of them drives a car, the car decides.
    events : tuple
        None.
    slip_energy : dict
        Empty.
    final : State
        The last speeds.
    title : str
        Where it is from and what has been done to it.
    modes, error_estimate : dict
        Empty.
    gaps : tuple
        Of `signal`, `start`, `stop` [s] and `missing` samples each: where samples are missing.
    outliers : tuple
        Of `signal`, `time` [s], `value` and `expected` each: single samples that stand out by six standard deviations.

    Examples
    --------
    >>> import pathlib, tempfile, powertrain_ctrl as pt
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
    >>> _ = file.write_text("t;speed\\n0,0;1500\\n0,01;1510\\n0,02;1520\\n0,05;1550\\n")
    >>> run = pt.read_run(file, time="t", engine_speed="speed", units={"engine_speed": "rpm"})
    >>> run.gaps
    (Gap(signal='engine_speed', start=0.02, stop=0.05, missing=2),)
    >>> run.resampled(0.02)
    Traceback (most recent call last):
    ...
    powertrain_ctrl.base.errors.SignalError: engine_speed has a gap from 0.02 to 0.05 s, permitted: up to 0 s; give \
longest_gap to draw a line across it
    """

    @cached_property
    def gaps(self) -> tuple[Gap, ...]:
        """Where samples are missing: in a signal of its own, or in all."""
        return tuple(gap for name in self._names for gap in self._gaps_of(name))

    @cached_property
    def outliers(self) -> tuple[Outlier, ...]:
        """Single samples that stand out; more than one in a row do not."""
        return tuple(outlier for name in self._names for outlier in _outliers(name, *self._samples(name)))

    @checked
    def part(self, start: Seconds, stop: Seconds) -> MeasuredRun:
        """The samples from one time to another.

        Parameters
        ----------
        start, stop : float
            [s].

        Returns
        -------
        MeasuredRun

        Raises
        ------
        SignalError
            Fewer than two samples in between.
        """
        inside = (self.time >= start) & (self.time <= stop)
        if np.count_nonzero(inside) < 2:
            raise SignalError(
                f"from {start:g} to {stop:g} s there are {np.count_nonzero(inside)} samples, permitted: at least two "
                f"within {self.time[0]:g} to {self.time[-1]:g} s"
            )
        values = {name: self[name][inside] for name in self._names}
        return measured_run(self.time[inside], values, f"{self.title}, {start:g} to {stop:g} s")

    @checked
    def without_outliers(self) -> MeasuredRun:
        """The run with nan in the place of every outlier.

        Returns
        -------
        MeasuredRun
        """
        values = {name: self[name].copy() for name in self._names}
        for outlier in self.outliers:
            values[outlier.signal][self.time == outlier.time] = np.nan
        return measured_run(self.time, values, f"{self.title}, {len(self.outliers)} outliers taken out")

    @checked
    def resampled(self, dt: Period, longest_gap: Seconds = 0.0) -> MeasuredRun:
        """The run on even time stamps, on straight lines between the samples; no filter is applied.

        What is faster than half of the new rate comes back as something slower, if there is any; the title says what
        was done.

        Parameters
        ----------
        dt : float
            [s].
        longest_gap : float
            Gaps up to this length [s] are bridged by a line too.

        Returns
        -------
        MeasuredRun
            From the first time at which all signals have a sample to the last.

        Raises
        ------
        SignalError
            A longer gap, or less than two samples.
        """
        for gap in self.gaps:
            if gap.stop - gap.start > longest_gap:
                raise SignalError(
                    f"{gap.signal} has a gap from {gap.start:g} to {gap.stop:g} s, permitted: up to {longest_gap:g} s; "
                    "give longest_gap to draw a line across it"
                )
        samples = {name: self._samples(name) for name in self._names}
        start = max(times[0] for times, _ in samples.values())
        stop = min(times[-1] for times, _ in samples.values())
        count = int(np.floor((stop - start) / dt * (1.0 + 1e-12))) + 1
        if count < 2:
            raise SignalError(
                f"dt = {dt:g} s leaves {count} samples from {start:g} to {stop:g} s, permitted: at least two"
            )
        time = start + dt * np.arange(count)
        values = {name: np.interp(time, *pair) for name, pair in samples.items()}
        return measured_run(time, values, f"{self.title}, on straight lines every {dt:g} s")

    @property
    def _names(self) -> tuple[str, ...]:
        return (*self.inputs, *self.outputs)

    def _samples(self, name: str) -> tuple[np.ndarray, np.ndarray]:
        there = np.isfinite(self[name])
        return self.time[there], self[name][there]

    def _gaps_of(self, name: str) -> Iterator[Gap]:
        times, _ = self._samples(name)
        steps = np.diff(times)
        usual = np.median(steps)
        for i in np.flatnonzero(steps > GAP * usual):
            yield Gap(name, float(times[i]), float(times[i + 1]), round(steps[i] / usual) - 1)

    def __repr__(self) -> str:
        heading, notes = self._summary()
        return "\n".join([heading, text_table(*self._signal_table()), *notes])

    def _repr_html_(self) -> str:
        heading, notes = self._summary()
        return f"<p>{heading}</p>{html_table(*self._signal_table())}" + "".join(f"<p>{note}</p>" for note in notes)

    def _summary(self) -> tuple[str, list[str]]:
        steps = np.diff(self.time)
        heading = (
            f"{self.title}: {self.time[0]:g} to {self.time[-1]:g} s, {len(self.time)} samples, every "
            f"{np.median(steps):.4g} s (shortest {steps.min():.4g}, longest {steps.max():.4g})"
        )
        notes = [f"gap in {g.signal}: {g.start:g} to {g.stop:g} s, {g.missing} samples" for g in self.gaps[:6]]
        notes += [
            f"outlier in {o.signal} at {o.time:g} s: {o.value:.5g}, expected {o.expected:.5g}"
            for o in self.outliers[:6]
        ]
        more = len(self.gaps) + len(self.outliers) - len(notes)
        return heading, [*notes, *([f"and {more} more gaps or outliers"] if more else [])]

    def _signal_table(self) -> tuple[list[str], list[list[str]]]:
        rows = []
        for name in self._names:
            _, values = self._samples(name)
            rows.append([name, f"{values.min():.5g}", f"{values.max():.5g}", str(len(self.time) - len(values))])
        return ["signal [SI]", "least", "largest", "without sample"], rows


def measured_run(time: np.ndarray, values: Mapping[str, np.ndarray], title: str) -> MeasuredRun:
    """A run of signals on common time stamps; nan is no sample.

    Raises
    ------
    SignalError
        Time that does not increase, a value that is infinite, a signal of fewer than two samples.
    """
    if len(time) < 2:
        raise SignalError(f"{len(time)} samples, permitted: at least two")
    if not np.isfinite(time).all():
        raise SignalError(
            f"time is {time[~np.isfinite(time)][0]:g} in sample {int((~np.isfinite(time)).argmax()) + 1}, permitted: finite"
        )
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        i = int(back[0])
        raise SignalError(
            f"time goes from {time[i]:.9g} s to {time[i + 1]:.9g} s in sample {i + 2}, permitted: increasing"
        )
    for name, samples in values.items():
        far = np.flatnonzero(np.abs(samples) > LARGEST)
        if far.size:
            raise SignalError(f'signal "{name}" is {samples[far[0]]:g} at t = {time[far[0]]:g} s, permitted: finite')
        if np.count_nonzero(np.isfinite(samples)) < 2:
            raise SignalError(
                f'signal "{name}" has {np.count_nonzero(np.isfinite(samples))} samples, permitted: at least two'
            )
    inputs = tuple(name for name in values if name.endswith(DRIVES))
    outputs = tuple(name for name in values if name not in inputs)
    last = {name.removesuffix("_speed"): samples for name, samples in values.items() if name.endswith("_speed")}
    return MeasuredRun(
        time=np.array(time, dtype=float),
        inputs=inputs,
        outputs=outputs,
        events=(),
        slip_energy={},
        final=State(
            time=float(time[-1]),
            twist={},
            speed={node: float(samples[np.isfinite(samples)][-1]) for node, samples in last.items()},
            mode={},
        ),
        title=title,
        _values=np.array([values[name] for name in (*inputs, *outputs)], dtype=float),
    )


def _outliers(name: str, times: np.ndarray, values: np.ndarray) -> Iterator[Outlier]:
    """A sample off the median of five, which follows steps, and off the cubic through four, which follows bends."""
    if len(values) < 7:
        return
    around = np.lib.stride_tricks.sliding_window_view(values, 5)
    middle = np.median(around, axis=1)
    cubic = (4.0 * (around[:, 1] + around[:, 3]) - (around[:, 0] + around[:, 4])) / 6.0
    off = np.array([around[:, 2] - middle, around[:, 2] - cubic])
    limit = np.maximum(STANDS_OUT * FROM_MEDIAN * np.median(np.abs(off), axis=1), OF_RANGE * np.ptp(values))
    bend = np.abs(off[1])
    for i in np.flatnonzero((np.abs(off) > limit[:, None]).all(axis=0)):
        # its neighbours are off what it leads to as well, but by less
        if bend[i] < bend[max(i - 2, 0) : i + 3].max():
            continue
        yield Outlier(name, float(times[i + 2]), float(values[i + 2]), float(middle[i]))
