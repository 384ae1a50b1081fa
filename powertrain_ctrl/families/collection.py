"""`Family`: variants of one driveline, and what is computed of all of them."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import Capacity, Duration, Seconds, Speed, Torque
from ..base.doors import called, checked
from ..base.errors import PowertrainError
from ..base.records import Record
from ..base.tables import Printed
from ..base.units import rpm
from ..driveline.collection import Driveline
from ..hybrid.signals import TimeFunction, Times, checked_times, ramp
from ..linear.forced import checked_frequencies
from ..linear.oscillator import oscillator_of
from ..linear.outputs import select
from .eigenvalues import poles_of
from .evaluation import evaluated
from .executors import Progress
from .failures import Failure, warn_of
from .frequencies import FamilyModes, modes_of, omega_of
from .impedances import FamilyForcedResponse, harmonics_of, numbers_held
from .launches import Launch, launches_of
from .parts import in_parts, require_room
from .reductions import two_masses_of
from .responses import FamilyResponse, LoadChange, load_changes_of, signals_of
from .results import FamilyArray, fields_of
from .variants import Variants

if TYPE_CHECKING:
    from ..sampled.plant import SampledPlant
    from ..sampled.unit import Controller


@called
@dataclass(frozen=True, eq=False, repr=False)
class Family(Printed, Record):
    """Variants of one driveline; `family` and `sample` make one.

    What is linear is computed of all variants at once, in parts that need no more than 32 MiB; anything else by `evaluate`.
    Every number of a variant is the same whatever else is in the family. A variant that fails has nan, or None, and stands
    in ``errors`` of the result, and a RuntimeWarning names the first with its values. So do those that a worker that died
    had in hand, and after KeyboardInterrupt those that were not reached. If all fail it is a PowertrainError.

    Attributes
    ----------
    nominal : Driveline
        That the variants are made of.
    values : dict
        ``element.parameter`` to the (n,) ndarray of its values.
    shape : tuple of int
        Lengths of the axes of a grid; (n,) otherwise. Variants are in order of the last axis, then of those before.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> loads = pt.family(
    ...     pt.examples.conventional(), {"gearbox.ratio": [6.0, 3.6, 2.2], "vehicle.m": [1600.0, 2000.0]}, grid=True
    ... )
    >>> loads
    Family: 3 x 2 = 6 variants
    parameter      unit  nominal  least  median  largest
    gearbox.ratio              6    2.2     3.6        6
    vehicle.m      kg       2000   1600    1800     2000
    >>> loads.car(2)["gearbox"].ratio, loads.modes().frequency_hz[:, 1].reshape(loads.shape).round(2)
    (3.6, array([[2.76, 2.64],
           [3.83, 3.75],
           [5.56, 5.51]]))
    """

    nominal: Driveline
    values: dict[str, np.ndarray]
    shape: tuple[int, ...]
    _variants: Variants

    def __len__(self) -> int:
        return len(self._variants)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each parameter; empty where it has none."""
        return {name: self._item(name).get("unit", "") for name in self.values}

    def _item(self, name: str) -> Mapping[str, Any]:
        key, _, parameter = name.partition(".")
        found = [item.metadata for item in dataclasses.fields(self.nominal[key]) if item.name == parameter]
        return found[0] if found else {}

    @checked
    def car(self, variant: int) -> Driveline:
        """Driveline of a variant.

        Parameters
        ----------
        variant : int
            0 to n - 1.

        Returns
        -------
        Driveline

        Raises
        ------
        PowertrainError
            There is no such variant.
        """
        if not 0 <= variant < len(self):
            raise PowertrainError(f"variant = {variant}, permitted: 0 to {len(self) - 1}")
        return self._variants.car_of(variant)

    def __getitem__(self, variant: object) -> NoReturn:
        raise TypeError(f"a family has no items: its variants are family.car({variant!r}), its values family.values")

    def __iter__(self) -> Iterator[Driveline]:
        return (self._variants.car_of(i) for i in range(len(self)))

    @checked
    def modes(self, executor: Executor | None = None, progress: Progress | None = None) -> FamilyModes:
        """Natural frequencies, damping ratios and, when asked for, shapes of all variants, as of `modes`.

        Parameters
        ----------
        executor : concurrent.futures.Executor, optional
            Where the parts are computed; here if not given. Threads are enough: numpy lets go of them.
        progress : callable, optional
            ``progress(done, all)`` after each part.

        Returns
        -------
        FamilyModes

        Raises
        ------
        PowertrainError
            The car has no modes; the first variant is named, with its values.
        """
        found, errors = self._computed(modes_of, executor=executor, progress=progress)
        return FamilyModes(self, found["omega"], found["damping_ratio"], errors)

    @checked
    def natural_frequencies(self, executor: Executor | None = None, progress: Progress | None = None) -> FamilyArray:
        """Undamped natural frequencies [Hz] alone, in half the time of `modes`.

        Parameters
        ----------
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyArray
            (n, modes).
        """
        found, errors = self._computed(omega_of, executor=executor, progress=progress)
        return FamilyArray(found["omega"] / (2.0 * np.pi), self, "frequency_hz", "Hz", ("mode",), errors)

    @checked
    def poles(self, executor: Executor | None = None, progress: Progress | None = None) -> FamilyArray:
        """Poles of all variants, ordered as by `poles`.

        Parameters
        ----------
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyArray
            (n, poles) of complex [rad/s]; variants with fewer poles have nan behind theirs.
        """
        found, errors = self._computed(poles_of, executor=executor, progress=progress)
        return FamilyArray(found["poles"], self, "poles", "rad/s", ("pole",), errors)

    @checked
    def forced_response(
        self,
        omega: ArrayLike,
        inputs: Mapping[str, Any],
        outputs: Iterable[str] | str | None = None,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> FamilyForcedResponse:
        """Steady responses of all variants to harmonic torques, as of `forced_response`; loss factors included.

        Parameters
        ----------
        omega : (N,) array_like
            Angular frequencies [rad/s], > 0.
        inputs : mapping
            ``<inertia>_torque`` [N m] or ``<mass>_force`` [N] to its complex amplitude, a peak value.
        outputs : str or list of str, optional
            As of `forced_response`; all if not given.
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyForcedResponse

        Raises
        ------
        UnknownNameError
            A signal that is not there.
        ParameterError
            A frequency that is not > 0 and finite.
        PowertrainError
            More numbers than can be held: choose outputs.
        """
        frequencies = checked_frequencies("forced_response", omega)
        oscillator = oscillator_of(self.car(0))
        signals = tuple(oscillator.chosen(outputs))
        select(list(inputs), oscillator.model.inputs, "input")
        amplitudes = {name: complex(value) for name, value in inputs.items()}
        require_room(len(self) * 2 * len(signals) * len(frequencies))
        floats = numbers_held(len(self.nominal.nodes), len(signals), len(frequencies))
        found, errors = self._computed(
            harmonics_of, frequencies, amplitudes, signals, floats=floats, executor=executor, progress=progress
        )
        return FamilyForcedResponse(self, frequencies, signals, found["values"], errors)

    @checked
    def frequency_response(
        self,
        omega: ArrayLike,
        input: str,
        outputs: Iterable[str] | str | None = None,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> FamilyForcedResponse:
        """Frequency responses of all variants from one input: `forced_response` to an amplitude of 1.

        Parameters
        ----------
        omega, input, outputs : (N,) array_like; str; str or list of str, optional
            As in `forced_response`.
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyForcedResponse
        """
        return self.forced_response(omega, {input: 1.0}, outputs, executor, progress)

    @checked
    def load_change(
        self,
        torque: Torque = 250.0,
        duration: Duration = 0.2,
        start: Seconds = 1.0,
        engine_speed: Speed = rpm(2000.0),
        timepts: Times | None = None,
        outputs: Iterable[str] | str | None = None,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> FamilyResponse:
        """Responses of all variants to a torque ramp at the engine, as of `load_change`; exact.

        Parameters
        ----------
        torque, duration, start, engine_speed, timepts : float, float, float, float, (N,) array_like
            As in `load_change`.
        outputs : str or list of str, optional
            Signals to keep; all but those of locked clutches if not given.
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyResponse

        Raises
        ------
        UnknownNameError
            A signal that is not there.
        PowertrainError
            More numbers than can be held: choose outputs. A car without a load change; the first variant is named.
        """
        times = checked_times(np.linspace(0.0, 2.6, 1301) if timepts is None else timepts)
        known = signals_of(self.car(0))
        signals = tuple(known[i] for i in select(outputs, known, "output"))
        require_room(len(self) * len(signals) * len(times))
        options = {"torque": torque, "duration": duration, "start": start, "engine_speed": engine_speed}
        change = LoadChange(ramp(start, duration, torque), start, engine_speed, times, options)
        floats = (2 * len(self.nominal.nodes) + 2 + len(signals)) * len(times)
        found, errors = self._computed(
            load_changes_of, change, signals, floats=floats, executor=executor, progress=progress
        )
        return FamilyResponse(self, times, signals, found["final"], start, found["values"], errors)

    @checked
    def launch(
        self,
        torque: Torque = 350.0,
        capacity: Capacity = 370.0,
        duration: Duration = 0.22,
        start: Seconds = 1.5,
        engine_speed: Speed = rpm(5000.0),
        until: Duration = 3.5,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> FamilyArray:
        """Race starts of all variants with one clutch, as of `launch`: when it has locked, and its heat; exact.

        Parameters
        ----------
        torque, capacity, duration, start, engine_speed : float
            As in `launch`.
        until : float
            End [s].
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyArray
            (n,), with the fields ``lock_time`` [s], nan where the clutch slips at the end, and ``heat`` [J].

        Raises
        ------
        TopologyError
            No clutch or more than one.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> loads = pt.family(pt.examples.conventional(damping="open"), {"vehicle.m": [1600.0, 2000.0]})
        >>> loads.launch()["lock_time"].round(3)
        array([2.482, 2.651])
        """
        task = Launch(torque, capacity, duration, start, engine_speed, until)
        floats = 80 * len(self.nominal.nodes) ** 2
        found, errors = self._computed(launches_of, task, floats=floats, executor=executor, progress=progress)
        return fields_of(self, found, "launch", errors)

    @checked
    def two_mass(self, executor: Executor | None = None, progress: Progress | None = None) -> FamilyArray:
        """Two-mass control models of all variants by the method "modal", as of `two_mass`.

        Parameters
        ----------
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyArray
            (n,), with the fields ``J1``, ``J2``, ``stiffness``, ``damping``, ``ratio`` and ``rim_share`` of `TwoMass`.
        """
        found, errors = self._computed(two_masses_of, executor=executor, progress=progress)
        return fields_of(self, found, "two_mass", errors)

    @checked
    def closed_loop(
        self,
        plant: SampledPlant,
        controller: Controller,
        demand: TimeFunction,
        duration: Seconds = 4.0,
        initial_torque: Torque = 0.0,
        outputs: Iterable[str] | str | None = None,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> FamilyResponse:
        """Exact responses of one controller on all variants, as of `closed_loop`.

        Parameters
        ----------
        plant : SampledPlant
            Lag, delay, sample time and limits; its car gives way to that of each variant.
        controller, demand, duration, initial_torque : as in `closed_loop`
            With a unit or a controller that is not linear the variants are stepped one by one.
        outputs : str or list of str, optional
            Signals of `closed_loop` to keep; all if not given.
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyResponse

        Raises
        ------
        UnknownNameError
            A signal that is not there.
        SignalError
            A loop that is unstable.
        PowertrainError
            A controller that does not fit; a car without wheels or vehicle; more numbers than can be held.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> car = pt.examples.conventional()
        >>> plant = pt.SampledPlant(car=car)
        >>> controller = pt.antijerk.one_dof(plant, pt.antijerk.speed_difference(plant, gain=6.0))
        >>> loads = pt.family(car, {"vehicle.m": [1600.0, 2400.0]})
        >>> loads.closed_loop(plant, controller, pt.ramp(0.5, 0.1, 250.0)).metrics()["overshoot"].round(3)
        array([0.193, 0.183])
        """
        from .loops import SIGNALS, loops_with, trial_of

        signals = tuple(SIGNALS[i] for i in select(outputs, SIGNALS, "output"))
        trial = trial_of(plant, controller, demand, duration, None, initial_torque)
        points = trial.count * trial.steps + 1
        require_room(len(self) * len(signals) * points)
        time = (plant.dt / trial.steps) * np.arange(points)
        wanted = trial.wanted
        begun = max(int((wanted != wanted[0]).argmax()) - 1, 0)
        floats = (len(signals) + 2) * points + 60 * len(wanted)
        found, errors = self._computed(
            loops_with, plant, trial, signals, floats=floats, executor=executor, progress=progress
        )
        final = found["final"] * (wanted[-1] - wanted[0])
        return FamilyResponse(self, time, signals, final, begun * plant.dt, found["values"], errors)

    @checked
    def loop_margins(
        self,
        plant: SampledPlant,
        controller: Controller,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> FamilyArray:
        """Stability, damping and margins of one controller on all variants, as of `loop_margins`.

        Parameters
        ----------
        plant, controller : SampledPlant; ControlUnit, control.StateSpace or None
            As in `closed_loop` and in `loop_margins`.
        executor, progress : concurrent.futures.Executor, callable, optional
            As in `modes`.

        Returns
        -------
        FamilyArray
            (n,), with the fields ``stable``, ``zeta_first``, ``zeta_second``, ``disk_margin``, ``gain_margin_db`` and
            ``phase_margin_deg`` of `LoopMargins`.

        Raises
        ------
        PowertrainError
            A controller that does not fit or is not linear; a car without wheels or vehicle.
        """
        from .loops import margins_with

        found, errors = self._computed(margins_with, plant, controller, executor=executor, progress=progress)
        return fields_of(self, found, "loop_margins", errors)

    @checked
    def evaluate(
        self,
        function: Callable[[Driveline], Any],
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> FamilyArray:
        """What a function gives for the driveline of each variant, in their order, wherever they are computed.

        Parameters
        ----------
        function : callable
            Of a `Driveline`: a number, an array, a mapping from name to numbers, or anything else. For workers in other
            processes it is one that can be pickled: defined in a module, not a lambda.
        executor : concurrent.futures.Executor, optional
            Anything with its ``submit``: threads, processes (forkserver), joblib's, ``dask.distributed``'s
            ``Client.get_executor()``. Here, one after another, if not given.
        progress : callable, optional
            ``progress(done, all)``.

        Returns
        -------
        FamilyArray
            (n, ...); of mappings a structured array, with a field for each name.

        Raises
        ------
        PowertrainError
            No variant could be computed.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> loads = pt.family(pt.examples.conventional(damping="open"), {"vehicle.m": [1600.0, 2000.0]})
        >>> result = loads.evaluate(lambda car: {"lock": pt.launch(car).events[-1].time})
        >>> result["lock"].round(3), result.worst("lock").variant
        (array([2.482, 2.651]), 1)
        """
        values, failures = evaluated(self._variants, function, executor, progress)
        warn_of(failures, len(self), stacklevel=3)
        return FamilyArray(values, self, errors=failures)

    def to_dict(self) -> dict[str, list]:
        """Values of the variants as lists by name, for JSON or pandas."""
        return {name: column.tolist() for name, column in self.values.items()}

    def _computed(
        self,
        function: Callable[..., dict[str, np.ndarray]],
        *more: Any,
        floats: int = 0,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> tuple[dict[str, np.ndarray], dict[int, Failure]]:
        """``function(variants, *more)`` of all variants in parts, each array with theirs in order; and what failed."""
        found, failures = in_parts(self._variants, function, more, floats, executor, progress)
        warn_of(failures, len(self), stacklevel=4)
        return found, failures

    headers = ("parameter", "unit", "nominal", "least", "median", "largest")

    def rows(self) -> Iterable[list[str]]:
        """Rows of the printed table."""
        for name, column in self.values.items():
            key, _, parameter = name.partition(".")
            nominal = getattr(self.nominal[key], parameter, key not in self.nominal.released)
            written = f"{nominal:.6g}" if isinstance(nominal, float) else str(nominal)
            if column.dtype == object:
                kinds = list(dict.fromkeys(map(str, column)))
                listed = ", ".join(kinds[:3]) + (", ..." if len(kinds) > 3 else "")
                yield [name, self.units[name], written, listed, "", ""]
            else:
                three = (column.min(), np.median(column), column.max())
                yield [name, self.units[name], written, *(f"{value:.6g}" for value in three)]

    @property
    def heading(self) -> str:
        """What stands above the printed table."""
        grid = " x ".join(map(str, self.shape))
        return f"Family: {f'{grid} = ' if len(self.shape) > 1 else ''}{len(self)} variants"
