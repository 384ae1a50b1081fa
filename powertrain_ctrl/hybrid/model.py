"""What is propagated: the plants of a car, their outputs, and speeds to start from."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from functools import cached_property

import numpy as np

from ..base.checks import checked_mapping
from ..base.errors import PowertrainError, UnknownNameError
from ..driveline.collection import HasDriveline
from ..elements.laws import STUCK
from ..linear.assembly import as_driveline, assemble_with_laws, kept
from ..linear.outputs import hurrying, output_rows
from .harmonics import Tone
from .plant import Modes, Plant
from .signals import Signal

# A capacity below this share of the clutch's max_torque is what rounding has left of none.
NO_CAPACITY = 1e-12


class Plants:
    """What is propagated: a driveline, or one while its clutch slips and another one while it is stuck.

    Its outputs are those that need no derivative of an input; while inputs that are ``still`` do not act, there may be more.
    """

    def __init__(
        self,
        car: HasDriveline,
        as_set: bool = False,
        still: frozenset[str] = frozenset(),
        tones: tuple[Tone, ...] = (),
    ):
        self._made_of = (car, as_set, still)
        stuck = getattr(car, "stuck_driveline", None)
        slipping = as_driveline(car)
        self.slipping = Plant(assemble_with_laws(slipping if as_set else slipping.release()), tones=tones)
        self.stuck = self.slipping if stuck is None else Plant(assemble_with_laws(stuck.release()), tones=tones)
        if stuck is not None:
            self.stuck.judged_by(self.slipping)
        self.model = self.slipping.model
        self.laws = self.slipping.laws
        self.names = tuple(law.name for law in self.laws)
        for law in self.laws:
            if not law.modes:
                own = f', or car.replace("{law.owner}", speed=10.0)' if hasattr(slipping[law.owner], "speed") else ""
                raise PowertrainError(f"{law.owner}: needs a speed; take the driveline at one, car.at(speed=...){own}")
        self.clutches = tuple(law.name for law in self.slipping.clutches)
        self.sources = [self.model.laws[i] for i in self.slipping.moved]
        driven = (*self.slipping.clutches, *self.sources)
        self.inputs = (*self.model.inputs, *(law.input for law in driven))
        self.hurrying = hurrying(self.model)
        self.acting = [j for j, name in enumerate(self.model.inputs) if name not in still]
        self.rows = output_rows(self.model, inputs=self.acting)
        twisted = [self.names[i] for i in self.slipping.elastic]
        self.outputs = (
            *self.rows.names,
            *(f"{name}_twist" for name in twisted),
            *(f"{name}_mode" for name in self.names),
        )
        # names of the physical states of the systems
        self.states = (
            *(f"{self.model.compliances[i]}_twist" for i in self.model.elastic_rows),
            *(f"{name}_speed" for name in self.model.coordinates),
            *(f"{name}_{kind}" for kind in ("twist", "stretch") for name in twisted),
        )
        # outputs that are combinations of the states alone
        direct = np.hstack([self.rows.acceleration, self.rows.friction, self.rows.load]).any(axis=1)
        self.is_state = np.array([*np.logical_not(direct), *[True] * len(twisted), *[False] * len(self.laws)])
        # of clutches to which none is given
        self.capacity = {law.input: 0.0 if as_set else float(law.max_torque or 0.0) for law in self.slipping.clutches}

    def __call__(self, modes: Modes) -> Plant:
        return self.slipping if self.stuck is self.slipping or STUCK not in modes else self.stuck

    def with_tones(self, tones: tuple[Tone, ...]) -> Plants:
        """The same with inputs that sound."""
        return _kept_plants(*self._made_of, tones)

    @property
    def unknown(self) -> Modes:
        """Modes to begin with where they are to be found from the state."""
        return tuple(next(iter(law.modes)) if law.idle is None else law.idle for law in self.laws)

    def signals(self, inputs: Mapping[str, Signal] | None) -> dict[str, Signal]:
        """The signals given, each of them an input, and the capacity of every clutch to which none is given."""
        given = checked_mapping("inputs", inputs, "from input to number, samples or function of time")
        for name in given:
            if name not in self.inputs:
                raise UnknownNameError("signal", name, self.inputs, "an input of this driveline")
        return self.capacity | given

    @property
    def mode_names(self) -> dict[str, dict[int, str]]:
        """Number and name of the modes of each law."""
        return {law.name: {number: mode.name for number, mode in law.modes.items()} for law in self.laws}

    @cached_property
    def _output_maps(self) -> dict[Plant, np.ndarray]:
        return {plant: _whole(plant, output_map(plant, self.acting)) for plant in {self.slipping, self.stuck}}

    def output_values(
        self, plant: Plant, x: np.ndarray, torque: np.ndarray, inputs: np.ndarray, modes: np.ndarray
    ) -> np.ndarray:
        """(outputs, samples) ndarray from states, torques of the laws, inputs and modes at the samples."""
        y = np.empty((len(self.outputs), x.shape[1]))
        self.put_outputs(plant, np.concatenate([x, torque, inputs[: plant.B.shape[1]]]), modes, y)
        return y

    def put_outputs(self, plant: Plant, samples: np.ndarray, modes: np.ndarray, y: np.ndarray) -> None:
        """Outputs put into y, from samples of states, torques of the laws and inputs below each other."""
        last = len(self.outputs) - len(modes)
        np.matmul(self._output_maps[plant], samples, out=y[:last])
        y[last:] = modes


def plants_of(car: HasDriveline, as_set: bool = False, acting: Container[str] | None = None) -> Plants:
    """The plants of a car; those of the last few cars are kept, so that the next run of the same one starts at once.

    Of torques at nodes without inertia only those in ``acting`` act; None means all.
    """
    as_driveline(car)
    plants = _kept_plants(car, as_set)
    still = frozenset(name for name in plants.hurrying if acting is not None and name not in acting)
    return _kept_plants(car, as_set, still) if still else plants


_kept_plants = kept(16)(Plants)


def _whole(plant: Plant, linear: np.ndarray) -> np.ndarray:
    """The map of the outputs on the whole state, with the twists of the laws behind them."""
    m = plant.size - plant.N
    whole = np.insert(linear, [plant.N] * m, 0.0, axis=1)
    return np.vstack([whole, np.eye(m, whole.shape[1], plant.N)])


def output_map(plant: Plant, acting: Sequence[int] | None = None) -> np.ndarray:
    """Matrix of the outputs, while these inputs act, on state, torques of the laws that are not locked, and inputs."""
    model = plant.model
    rows = output_rows(model, inputs=acting)
    n_x, n_tau, n_u = plant.N, plant.G.shape[1], plant.B.shape[1]
    # unit states, torques and inputs side by side
    x = np.eye(n_x, n_x + n_tau + n_u)
    torque = np.eye(n_tau, n_x + n_tau + n_u, n_x)
    u = np.eye(n_u, n_x + n_tau + n_u, n_x + n_tau)
    rate = plant.A @ x + plant.B @ u - plant.W @ torque
    twist, speed, acceleration = plant.twist(x), plant.speed(x), plant.speed(rate)
    u, accelerations = np.split(u, [len(model.inputs)])
    u = u + plant.harmonic(x)
    friction = model.locked_torque(twist, speed, acceleration, u)
    friction[plant.active] = torque
    if plant.moved.size:
        inertia, on_x, on_u, on_torque = plant.source
        added = np.diag([model.laws[i].imposes or 0.0 for i in plant.moved])
        taken = on_x @ x[: on_x.shape[1]] + on_u @ u + on_torque @ torque
        friction[plant.moved] = (inertia - added) @ accelerations + taken
    y = rows.twist @ twist + rows.speed @ speed + rows.acceleration @ acceleration + rows.friction @ friction
    return y + rows.load @ u
