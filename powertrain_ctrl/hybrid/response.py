"""What a simulation gives: signals over time, clutch events, heat, and the state to go on from."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ..base.doors import called, checked
from ..base.errors import UnknownNameError
from ..base.records import Record
from ..base.tables import Listed, Printed, Rows, number
from ..linear.outputs import select

if TYPE_CHECKING:
    import control


@called
@dataclass(frozen=True)
class Event(Listed):
    """A law that changes its mode: a clutch that starts to slip, locks or is released, a gap that opens or closes.

    Attributes
    ----------
    time : float
        [s].
    element : str
        Name of the element.
    kind : {"lock", "slip", "release", "contact", "open"}
        What it does.
    mode : int or str
        Mode from then on. Of a clutch: +1 sliding with side a faster, -1 with side b faster, 0 stuck, 2 free; of other
        elements its name.
    heat : float
        Heat of this element so far [J], of all that it does, as ``slip_energy`` of the response counts it.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> lock = pt.launch(pt.examples.conventional(damping="open")).events[-1]
    >>> lock.kind, lock.mode, round(lock.time, 2), round(lock.heat / 1e3, 1)
    ('lock', 0, 2.65, 100.2)
    """

    time: float
    element: str
    kind: str
    mode: int | str
    heat: float
    UNITS: ClassVar[Mapping[str, str]] = {"time": "s", "heat": "J"}


@checked
@dataclass(frozen=True, eq=False)
class State(Listed, Record):
    """State of a driveline at one instant, to go on from.

    Attributes
    ----------
    time : float
        [s].
    twist : mapping
        Spring, or law with a twist, to twist [rad].
    speed : mapping
        Node to speed [rad/s or m/s], of those that move with the bodies alone; nodes on springs and dampers follow.
    mode : mapping
        Clutch or other law to mode, as in `Event`. In a state made by hand all of them, or none: they are then found.

    Examples
    --------
    Two runs of half a second, the second from where the first ends, are one of a second:

    >>> import powertrain_ctrl as pt
    >>> car, torque = pt.examples.conventional(), {"engine_torque": 100.0}
    >>> state = pt.simulate(car, [0.0, 0.5], torque).final
    >>> round(state.speed["engine"], 3), state.mode
    (43.242, {'clutch': 0})
    >>> later = pt.simulate(car, [0.5, 1.0], torque, initial_state=state).final
    >>> round(later.speed["engine"], 3), round(pt.simulate(car, [0.0, 1.0], torque).final.speed["engine"], 3)
    (78.895, 78.895)
    """

    time: float
    twist: Mapping[str, float]
    speed: Mapping[str, float]
    mode: Mapping[str, int | str]
    _exact: np.ndarray = field(repr=False, default_factory=lambda: np.zeros(0))

    def listed(self) -> Rows:
        """Speed of each node, twist of each spring and mode of each law."""
        speeds = [[f"{node} speed", number(value, 6), "rad/s or m/s"] for node, value in self.speed.items()]
        twists = [[f"{name} twist", number(value, 6), "rad"] for name, value in self.twist.items()]
        modes = [[f"{name} mode", str(mode), ""] for name, mode in self.mode.items()]
        return [["time", number(self.time, 6), "s"], *speeds, *twists, *modes]


@called
@dataclass(frozen=True, eq=False, repr=False)
class Response(Printed, Record):
    """Time response with every signal of the driveline.

    ``response["engine_speed"]`` is a signal as an array on ``time``; inputs are signals too.

    Attributes
    ----------
    time : (N,) ndarray
        [s].
    inputs, outputs : tuple of str
        Names of the signals.
    events : tuple of Event
        In order of time.
    slip_energy : dict
        Heat of each element with friction [J].
    final : State
        State at the end, to go on from; that of a sampled controller's response only has the time and the clutch modes.
    title : str
        Of the figure that python-control draws.
    modes : dict
        Law to the names of its modes by the number that ``<law>_mode`` shows.
    error_estimate : dict
        Empty where the response is exact. Where a capacity changes on which friction over slip depends, the largest
        difference of each output, and of the times of the ``"events"`` [s], to a run with half as many steps of it; where
        a torque converter is followed, to a run that is a hundred times less close.

    Raises
    ------
    UnknownNameError
        From ``response[name]``: a signal that is not there.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> response = pt.launch(pt.examples.conventional(damping="open"))
    >>> round(float(response["vehicle_acceleration"].max()), 2), "clutch_slip_speed" in response
    (10.31, True)
    >>> {clutch: round(heat / 1e3, 1) for clutch, heat in response.slip_energy.items()}
    {'clutch': 100.2}
    """

    time: np.ndarray
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    events: tuple[Event, ...]
    slip_energy: dict[str, float]
    final: State
    _values: np.ndarray
    title: str = "response"
    modes: Mapping[str, Mapping[int, str]] = field(default_factory=dict)
    error_estimate: Mapping[str, float] = field(default_factory=dict)

    def keys(self) -> tuple[str, ...]:
        """Names of all signals, inputs first."""
        return (*self.inputs, *self.outputs)

    _ipython_key_completions_ = keys

    def to_dict(self) -> dict[str, Any]:
        """Time, signals and events as plain lists and numbers, as `json` takes them.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> record = pt.launch(pt.examples.conventional(damping="open")).to_dict()
        >>> record["events"][1]["kind"], len(record["signals"]["engine_speed"])
        ('lock', 3501)
        """
        return {
            "time": self.time.tolist(),
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "signals": {name: self[name].tolist() for name in self.keys()},
            "events": [dataclasses.asdict(event) for event in self.events],
            "slip_energy": dict(self.slip_energy),
            "modes": {law: dict(names) for law, names in self.modes.items()},
            "error_estimate": dict(self.error_estimate),
        }

    @checked
    def __getitem__(self, name: str) -> np.ndarray:
        names = (*self.inputs, *self.outputs)
        if name not in names:
            owner = "in this response" + (", whose times are response.time" if name == "time" else "")
            raise UnknownNameError("signal", name, names, owner)
        return self._values[names.index(name)]

    @called
    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and (name in self.inputs or name in self.outputs)

    @checked
    def to_control(self, outputs: Iterable[str] | str | None = None) -> control.TimeResponseData:
        """As ``control.TimeResponseData``, which plots itself.

        Parameters
        ----------
        outputs : str or list of str, optional
            Those to take, a few for a plot; None means all.

        Returns
        -------
        control.TimeResponseData

        Raises
        ------
        UnknownNameError
            An output that is not there.

        Examples
        --------
        >>> import powertrain_ctrl as pt
        >>> data = pt.load_change(pt.examples.conventional()).to_control(["engine_speed", "vehicle_acceleration"])
        >>> data.outputs["vehicle_acceleration"].shape
        (1301,)
        """
        import control

        n = len(self.inputs)
        chosen = select(outputs, self.outputs, "output")
        return control.TimeResponseData(
            self.time,
            self._values[n:][chosen],
            inputs=self._values[:n],
            output_labels=[self.outputs[i] for i in chosen],
            input_labels=list(self.inputs),
            title=self.title,
            issiso=False,
        )

    headers = ("t [s]", "element", "event", "heat so far [kJ]")

    @property
    def heading(self) -> str:
        """How long it is and how much there is of it."""
        span = f"{self.time[0]:g} to {self.time[-1]:g} s, {len(self.time)} samples"
        return f"Response: {span}, {len(self.outputs)} outputs, {len(self.events)} events"

    def rows(self) -> list[list[str]]:
        """Rows of the printed table, one for each event."""
        return [[f"{e.time:.6f}", e.element, e.kind, f"{e.heat / 1e3:.3f}"] for e in self.events]
