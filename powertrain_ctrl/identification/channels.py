"""What of a run is used: inputs that drive the car, outputs that it has, on time from 0."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import PowertrainError, SignalError, UnknownNameError
from ..hybrid.response import Response
from .measured import MeasuredRun

# Of a simulated response, which has every signal of a car, speeds stand for what is measured.
SPEED, SLIP = "_speed", "_slip_speed"
# A signal that changes by less than this part of its size is constant.
CONSTANT = 1e-9
# Gaps of an input up to this many of its usual steps are bridged by the line between its samples.
BRIDGED = 5.0
LONGEST_DELAY = 0.5


class Channels(NamedTuple):
    """A run: time from 0 [s], inputs as samples of their own, outputs (outputs, N) on ``time``, nan where there is none."""

    title: str
    origin: float
    time: np.ndarray
    inputs: dict[str, tuple[np.ndarray, np.ndarray]]
    outputs: tuple[str, ...]
    measured: np.ndarray

    @property
    def step(self) -> float:
        """The usual step of time [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def there(self) -> np.ndarray:
        """(outputs, N) ndarray of bool."""
        return np.isfinite(self.measured)

    @property
    def size(self) -> np.ndarray:
        """(outputs,) ndarray: largest difference of each output."""
        return np.nanmax(self.measured, axis=1) - np.nanmin(self.measured, axis=1)


def channels(run: Any, inputs: Sequence[str], outputs: Sequence[str], wanted: Iterable[str] | None = None) -> Channels:
    """The signals of a run that are inputs and outputs of a car.

    Parameters
    ----------
    run : Response, Signals or control.TimeResponseData
    inputs, outputs : sequence of str
        Of the car.
    wanted : iterable of str, optional
        Outputs to use; None means all that the car has, of a simulated response its speeds.

    Raises
    ------
    SignalError
        No input or output of this car, signals that do not change, an input with a gap.
    UnknownNameError
        A wanted signal that the run or the car has not.
    """
    title, time, signals = _signals(run)
    if wanted is None:
        simulated = isinstance(run, Response) and not isinstance(run, MeasuredRun)
        chosen = [
            name for name in signals if name in outputs and not (simulated and _says_nothing(name, signals[name]))
        ]
    else:
        chosen = list(wanted)
        for name in chosen:
            if name not in signals:
                raise UnknownNameError("signal", name, signals, "in this run")
            if name not in outputs:
                raise UnknownNameError("signal", name, outputs, "an output of this car")
    driving = {name: _samples(name, time, signals[name]) for name in inputs if name in signals}
    changing = {name: pair for name, pair in driving.items() if not _is_constant(pair[1])}
    if not chosen or not driving:
        what, names = ("output", outputs) if driving else ("input", inputs)
        listed = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
        raise SignalError(f"{title}: the run has no {what} of this car, permitted: at least one of {listed}")
    if not changing:
        raise SignalError(f"{title}: {', '.join(driving)} does not change, permitted: an input that moves the car")
    for name in chosen:
        known = signals[name][np.isfinite(signals[name])]
        if _is_constant(known):
            raise SignalError(f"{title}: {name} does not change, permitted: a measured output that moves")
    measured = np.array([signals[name] for name in chosen], dtype=float)
    # an input that is always 0 drives nothing
    kept = {name: pair for name, pair in driving.items() if name in changing or pair[1].any()}
    return Channels(title, float(time[0]), time - time[0], kept, tuple(chosen), measured)


def _signals(run: Any) -> tuple[str, np.ndarray, dict[str, np.ndarray]]:
    if isinstance(run, Response):
        title = run.title if isinstance(run, MeasuredRun) else "run"
        return title, run.time, {name: run[name] for name in (*run.inputs, *run.outputs)}
    if hasattr(run, "output_labels"):
        time = np.asarray(run.time, dtype=float)
        signals: dict[str, np.ndarray] = {}
        for labels, data in ((run.input_labels, run.u), (run.output_labels, run.y)):
            if labels is not None and data is not None:
                rows = np.asarray(data, dtype=float).reshape(-1, len(time))
                if len(rows) != len(labels):
                    raise SignalError(
                        "the response holds several runs, one for each input, permitted: one; select it with input=0"
                    )
                signals |= dict(zip(labels, rows, strict=True))
        return "run", time, signals
    return "run", np.asarray(run.time, dtype=float), dict(run.values)


def _samples(name: str, time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    there = np.isfinite(values)
    if np.count_nonzero(there) < 2:
        raise SignalError(f"{name} has {np.count_nonzero(there)} samples, permitted: at least two")
    times = time[there]
    steps = np.diff(times)
    widest = int(steps.argmax())
    if steps[widest] > BRIDGED * np.median(steps):
        raise SignalError(
            f"{name} has a gap from {times[widest]:g} to {times[widest + 1]:g} s, permitted in an input: up "
            f"to {BRIDGED:g} steps of {np.median(steps):g} s; take the parts before and behind it as two runs, "
            "run.part(start, stop)"
        )
    return times - time[0], values[there]


def _says_nothing(name: str, values: np.ndarray) -> bool:
    return not name.endswith(SPEED) or name.endswith(SLIP) or _is_constant(values)


def _is_constant(values: np.ndarray) -> bool:
    return bool(np.ptp(values) <= CONSTANT * np.abs(values).max(initial=0.0))


def require_length(runs: Sequence[Channels], unknowns: int) -> None:
    """Raise a `PowertrainError` for runs that are too short for so many unknowns."""
    count = sum(int(np.count_nonzero(run.there)) for run in runs)
    if count < 3 * unknowns:
        raise PowertrainError(
            f"{count} samples for {unknowns} unknowns (parameters, delays, offsets, states at the start), permitted: "
            f"at least {3 * unknowns}; take a longer run, or more runs together"
        )
