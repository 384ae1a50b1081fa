"""A driveline behind a real actuator and a sampled controller, propagated exactly.

The command of the controller is limited, held for a sample, delayed (a pure delay, of any length), and turned into
torque by a first-order lag. Between the instants at which the delayed command changes the plant is linear with a
constant input, so it is stepped by matrix exponentials; nothing is approximated.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import control
import numpy as np
import scipy.linalg

from ..base.checks import NOT_NEGATIVE, POSITIVE, Period, Speed
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError, TopologyError, UnknownNameError
from ..base.records import Record
from ..base.systems import linear_system
from ..base.tables import Listed
from ..driveline.collection import HasDriveline
from ..driveline.ends import Ends, driven, ends
from ..linear.assembly import as_driveline, assemble
from ..linear.modal import modes
from ..linear.statespace import state_space
from ..reduction.twomass import SwitchedTwoMass
from .actuator import both, limits_at, limits_of, limits_written, rate_of, rates_written, split_among, time_of, written

# Samples of delay that a discrete system holds as states.
MOST_HELD = 5000
# What a controller can ask for by the names of its inputs, and what it gives.
MEASURED = ("engine_speed", "wheels_speed")
CONTROLLER_INPUTS = ("torque_demand", *MEASURED, "torque_limited", "ratio")
COMMAND = "torque_command"
# Instants nearer to each other than this share of a sample are one.
SAME_INSTANT = 1e-9
# Kinetic energies that differ by less than this share are the same.
SAME = 1e-9


@checked
@dataclass(frozen=True, kw_only=True, repr=False)
class SampledPlant(Listed, Record):
    """Driveline with torque actuator, speed sensors and sample time, as an anti-jerk controller sees it.

    Speeds are deviations from those before the manoeuvre; so is the torque, which before it is in balance.

    A torque that rises and falls differently, as of an engine, is simulated exactly: it never crosses the command that
    acts. What is linear, `continuous`, `discrete`, margins and designs, has the longer of both lags and of both delays.

    Parameters
    ----------
    car : Driveline or TwoMass
        Connected. Its wheel speed is that of "wheels", otherwise the mean of the driven wheels; without wheels and
        vehicle, as of a turbine or a ship, it is the node that swings most against the actuator in the first mode.
        Clutches are as they are in the car.
    lag : float, (float, float) or mapping
        Time constant of the torque [s], >= 0 and below 1 s. Two of them are that of a rise, while the delayed command lies
        above the torque, and that of a fall, while it lies below. A mapping from speed of the actuator [rad/s] to one or
        two, or rows of speed and these, is read at ``speed``.
    delay : float, (float, float) or mapping
        Pure delay of the command [s], >= 0 and below 1 s; any length, also not a multiple of ``dt``. Two of them are that of
        a command above the one before it, and that of one below; a newer command that is there before an older one, or
        with it, supersedes it. A mapping as for the lag.
    dt : float
        Sample time [s], > 0 and below 1 s.
    torque_limits : (float, float) or mapping
        Smallest and largest command [N m]; or these by speed of the actuator [rad/s], in straight lines in between: of an
        electric machine constant torque, then constant power.
    torque_rate : float or (float, float)
        Fastest change of the command [N m/s], > 0; two of them are that of a rise and that of a fall.
    actuator : str or mapping, optional
        Node that the commanded torque drives: an electric machine, an engine; the node "engine", otherwise the first node,
        that turns the vehicle if not given. Of several nodes a mapping to their shares of the command, 1 in sum, all with
        the lag and delay given: the car then has a `TorqueSplit`, and the actuator's speed is the mean by these shares.
    speed : float
        Speed of the actuator [rad/s] before a manoeuvre. Tables of lag and delay are read there, once: both stay so whatever
        the speed does. Limits by speed go with the speed of a manoeuvre; designs and margins take them here too.

    Raises
    ------
    PowertrainError
        A `SwitchedTwoMass`, which a sampled plant cannot be.
    ParameterError
        A time or rate out of range, limits that are not in order, an actuator that moves along the road.
    UnknownNameError
        An actuator that is no node.
    TopologyError
        A driveline in several parts, or with more than one vehicle or a vehicle without wheels.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> plant.discrete().nstates  # 6 twists, 7 speeds, torque, one sample of delay
    15
    """

    car: HasDriveline
    lag: Any = 0.03
    delay: Any = 0.01
    dt: Period = 0.01
    torque_limits: Any = (0.0, 350.0)
    torque_rate: Any = np.inf
    actuator: Any = None
    speed: Speed = 0.0

    UNITS: ClassVar[Mapping[str, str]] = {
        "lag": "s",
        "delay": "s",
        "dt": "s",
        "torque_limits": "N m",
        "torque_rate": "N m/s",
        "speed": "rad/s",
    }

    def __post_init__(self) -> None:
        for name, permitted in (("lag", NOT_NEGATIVE), ("delay", NOT_NEGATIVE), ("dt", POSITIVE)):
            object.__setattr__(self, name, time_of(name, getattr(self, name), permitted, self.speed))
        if isinstance(self.car, SwitchedTwoMass):
            raise PowertrainError(
                "a sampled plant does not switch; take the model of one clutch state, e.g. its closed one"
            )
        object.__setattr__(self, "torque_limits", limits_of(self.torque_limits))
        object.__setattr__(self, "torque_rate", rate_of(self.torque_rate))
        if isinstance(self.actuator, Mapping):
            shared, node = split_among(self.car.driveline, self.actuator)
            object.__setattr__(self, "car", shared)
            object.__setattr__(self, "actuator", node)
        driveline = self.car.driveline
        if self.actuator is not None:
            if not isinstance(self.actuator, str):
                raise ParameterError("sampled plant", "actuator", self.actuator, "", "a node, or {node: share}")
            if self.actuator not in driveline.nodes:
                raise UnknownNameError("actuator", self.actuator, driveline.nodes, "a node of the driveline")
            if self.actuator in driveline.translating:
                raise ParameterError("sampled plant", "actuator", self.actuator, "", "a node that turns")
        car = self.car if self.actuator is None or len(driveline.parts()) < 2 else driveline.part(self.actuator)
        object.__setattr__(self, "car", car)
        _ = self.ratio, self.vehicle

    def __repr__(self) -> str:
        times = ", ".join(f"{name} {written(getattr(self, name))}" for name in ("lag", "delay", "dt"))
        nodes = ", ".join(dict.fromkeys((self.engine, *self.wheels, self.vehicle)))
        torque = limits_written(*self.limits) + (f" at {self.speed:g} rad/s" if self.is_limited_by_speed else "")
        if np.isfinite(self.rates).any():
            torque += f", {rates_written(*self.rates)}"
        released = self.car.driveline.released
        open_clutches = f"; {', '.join(sorted(released))} released" if released else ""
        times += " (linear: the longer of both)" * self.has_direction
        return f"SampledPlant: {times}, {torque}; {nodes}, ratio {self.ratio:.6g}{open_clutches}"

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest command [N m] before a manoeuvre."""
        return self.limits_at(self.speed)

    @property
    def is_limited_by_speed(self) -> bool:
        """Whether the limits are a table."""
        return len(self.torque_limits) != 2 or isinstance(self.torque_limits[0], tuple)

    def limits_at(self, speed: float) -> tuple[float, float]:
        """Smallest and largest command [N m] at a speed of the actuator [rad/s]."""
        return limits_at(self.torque_limits, speed)

    @property
    def rates(self) -> tuple[float, float]:
        """Fastest rise and fall of the command [N m/s]."""
        return both(self.torque_rate)

    @property
    def lags(self) -> tuple[float, float]:
        """Lag of a rise and of a fall [s]."""
        return both(self.lag)

    @property
    def delays(self) -> tuple[float, float]:
        """Delay of a rise and of a fall [s]."""
        return both(self.delay)

    @property
    def has_direction(self) -> bool:
        """Whether the torque rises with another lag or delay than it falls."""
        return isinstance(self.lag, tuple) or isinstance(self.delay, tuple)

    @cached_property
    def linear(self) -> HasDriveline:
        """The car, or where it has play, stages or other laws, it for small motion while the engine drives."""
        return driven(self.car, self.actuator)

    @property
    def is_linear(self) -> bool:
        """Whether nothing but clutches, which stay as they are, is nonlinear in the car."""
        return self.linear is self.car

    @cached_property
    def _ends(self) -> Ends:
        return ends(self.car, self.actuator)

    @property
    def engine(self) -> str:
        """Node that the commanded torque drives: the actuator."""
        return self._ends.driving

    @cached_property
    def wheels(self) -> tuple[str, ...]:
        """Nodes whose mean speed is the measured one: "wheels", the wheels of all tyres that are driven, or the load."""
        if found := self._ends.wheels:
            return found
        if self._ends.vehicles:
            raise TopologyError('anti-jerk control measures the wheel speed: name a node "wheels" or add a Tyre')
        return (self._load,)

    @cached_property
    def vehicle(self) -> str:
        """Node of the vehicle, where there is none that of the load; more than one is a `TopologyError`."""
        vehicles = self._ends.vehicles
        if len(vehicles) > 1:
            raise TopologyError(f"anti-jerk control needs one vehicle, there are {len(vehicles)}")
        if not vehicles and self.wheels[0] == self.engine:
            raise TopologyError("anti-jerk control needs one vehicle, there are 0, nor is there another inertia")
        return vehicles[0] if vehicles else self.wheels[0]

    @cached_property
    def _load(self) -> str:
        """Of the nodes that swing against the actuator in the first elastic mode the one with most kinetic energy."""
        found, model = modes(self.linear), assemble(self.linear)
        energy = np.zeros(len(model.nodes))
        if len(found) > found.n_rigid:
            shape = found.shapes[:, found.n_rigid]
            side = np.sign(shape * model.rigid_motion)
            energy = np.where(side * side[model.nodes.index(self.engine)] < 0.0, np.diag(model.J) * shape**2, 0.0)
        if not energy.any():
            raise TopologyError(
                f'"{self.engine}" drives nothing: name a node "wheels" or add a Tyre, or another inertia'
            )
        # of equal ones the first
        return model.nodes[int(np.argmax(energy >= energy.max() * (1.0 - SAME)))]

    @property
    def push(self) -> str:
        """Input of the driveline that pushes the vehicle, or the load."""
        kind = "force" if self.vehicle in self.car.driveline.translating else "torque"
        return f"{self.vehicle}_{kind}"

    @cached_property
    def ratio(self) -> float:
        """Engine speed over wheel speed when everything turns as one body."""
        motion = self._rigid_motion  # first of all it has to be one driveline
        return motion[self.engine] / self._at_wheels

    @property
    def vehicle_radius(self) -> float:
        """Vehicle speed over wheel speed when everything turns as one body [m]."""
        return self._rigid_motion[self.vehicle] / self._at_wheels

    @property
    def _at_wheels(self) -> float:
        return sum(self._rigid_motion[wheel] for wheel in self.wheels) / len(self.wheels)

    @cached_property
    def inertia(self) -> float:
        """Inertia of everything at engine speed [kg m^2]."""
        model = assemble(self.linear)
        motion = model.rigid_motion / self._rigid_motion[self.engine]
        return float(motion @ model.J @ motion)

    @property
    def final_acceleration(self) -> float:
        """Vehicle acceleration per engine torque at steady state, drag left out [m/s^2 per N m]."""
        return self._rigid_motion[self.vehicle] / self._rigid_motion[self.engine] / self.inertia

    @cached_property
    def _rigid_motion(self) -> dict[str, float]:
        model = assemble(self.linear)
        if len(as_driveline(self.car).parts()) > 1:
            raise TopologyError("the driveline is in several parts; lock its clutches or take one with car.part(node)")
        return dict(zip(model.nodes, model.rigid_motion.tolist(), strict=True))

    @cached_property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs of `continuous` and `discrete`."""
        return ("engine_speed", "wheels_speed", "speed_difference", "vehicle_acceleration", "engine_torque")

    @cached_property
    def continuous(self) -> control.StateSpace:
        """Driveline and lag without the delay: inputs ``torque_command`` [N m] and ``vehicle_force`` [N].

        Of two lags the longer one.
        """
        lag = max(self.lags)
        wheels = [f"{wheel}_speed" for wheel in self.wheels]
        signals = [f"{self.engine}_speed", *wheels, f"{self.vehicle}_acceleration"]
        G = state_space(self.linear, [f"{self.engine}_torque", self.push], signals)
        A, B = G.A, G.B
        C, D = (np.vstack([M[0], M[1:-1].mean(axis=0), M[-1]]) for M in (G.C, G.D))
        if D[:2].any():
            raise PowertrainError(
                f"{self.engine} has no inertia, so its torque sets speeds at once; give it an Inertia"
            )
        difference = C[0] - self.ratio * C[1]
        if lag:
            n = len(A)
            A = np.block([[A, B[:, :1]], [np.zeros((1, n)), np.array([[-1.0 / lag]])]])
            B = np.block([[np.zeros((n, 1)), B[:, 1:]], [np.array([[1.0 / lag, 0.0]])]])
            rows = np.vstack([C[:2], difference, C[2:]])
            C = np.block([[rows, np.vstack([np.zeros((3, 1)), D[2:, :1]])], [np.zeros((1, n)), np.ones((1, 1))]])
            D = np.vstack([np.zeros((3, 2)), [[0.0, D[2, 1]]], np.zeros((1, 2))])
        else:
            C = np.vstack([C[:2], difference, C[2:], np.zeros((1, len(A)))])
            D = np.vstack([np.zeros((3, 2)), D[2:], [[1.0, 0.0]]])
        states = [*G.state_labels, "engine_torque"] if lag else list(G.state_labels)
        return linear_system(A, B, C, D, inputs=[COMMAND, "vehicle_force"], outputs=list(self.outputs), states=states)

    @property
    def delay_in_samples(self) -> tuple[int, float]:
        """Whole samples of delay and the rest [s]; of two delays of the longer one."""
        return max(self.delays_in_samples)

    @property
    def delays_in_samples(self) -> tuple[tuple[int, float], tuple[int, float]]:
        """Whole samples of delay and the rest [s], of a rise and of a fall."""
        (whole, rest), (other, late) = (self._in_samples(delay) for delay in self.delays)
        # two instants of a sample, or one
        return (whole, rest), (other, rest if abs(late - rest) <= SAME_INSTANT * self.dt else late)

    def _in_samples(self, delay: float) -> tuple[int, float]:
        whole = int(np.floor(delay / self.dt + SAME_INSTANT))
        rest = delay - whole * self.dt
        return whole, rest if rest > SAME_INSTANT * self.dt else 0.0

    @checked
    def discrete(self) -> control.StateSpace:
        """Exact discrete system from ``torque_command`` to the outputs, the delay as shift states; for design.

        Of two lags and of two delays it has the longer one.

        Returns
        -------
        control.StateSpace
            Input ``torque_command``, outputs ``engine_speed``, ``wheels_speed`` [rad/s], ``speed_difference`` (engine
            minus ratio times wheels), ``vehicle_acceleration`` [m/s^2], ``engine_torque`` [N m], each at the samples.
        """
        P = self.continuous
        A, B = self.with_delay(P.A, P.B[:, :1])
        held = len(A) - P.nstates
        C = np.hstack([P.C, np.zeros((P.noutputs, held))])
        D = np.zeros((P.noutputs, 1))
        if held:
            # what acts at the sample itself is the oldest command under way
            C[:, -1] += P.D[:, 0]
        else:
            D = P.D[:, :1].copy()
        states = [*P.state_labels, *(f"command_{i + 1}_before" for i in range(held))]
        return linear_system(A, B, C, D, dt=self.dt, inputs=[COMMAND], outputs=list(self.outputs), states=states)

    @checked
    def with_delay(self, A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Exact discrete A, B of ``x' = A x + B command(t - delay)``; commands under way are states, youngest first."""
        whole, rest = self.delay_in_samples
        Phi, late, early = self.step_matrices(A, B, self.dt, rest)
        n, held = len(A), whole + (1 if rest else 0)
        if held > MOST_HELD:
            raise PowertrainError(
                f"the delay is {max(self.delays) / self.dt:g} samples, permitted: at most {MOST_HELD}"
            )
        Ad, Bd = np.zeros((n + held, n + held)), np.zeros((n + held, 1))
        Ad[:n, :n] = Phi
        if whole:
            Ad[:n, n + whole - 1] = late[:, 0]
        else:
            Bd[:n] = late
        if rest:
            Ad[:n, n + whole] = early[:, 0]
        Ad[n + 1 :, n:-1] = np.eye(max(held - 1, 0))
        if held:
            Bd[n] = 1.0
        return Ad, Bd

    @staticmethod
    @checked
    def step_matrices(
        A: np.ndarray, B: np.ndarray, duration: float, rest: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """``Phi`` over ``duration`` and what commands add: the new one, acting after ``rest``, and the one before."""
        Phi, late = hold_matrices(A, B, duration - rest)
        if not rest:
            return Phi, late, np.zeros_like(B)
        first, early = hold_matrices(A, B, rest)
        return Phi @ first, late, Phi @ early


def hold_matrices(A: np.ndarray, B: np.ndarray, duration: float) -> tuple[np.ndarray, np.ndarray]:
    """``exp(A t)`` and its integral times B (van Loan)."""
    n, m = B.shape
    with np.errstate(over="ignore", invalid="ignore"):
        whole = scipy.linalg.expm(np.block([[A, B], [np.zeros((m, n + m))]]) * duration)
    if not np.isfinite(whole).all():
        raise PowertrainError(f"the motion leaves all numbers within {duration:g} s; are the values and times right?")
    return whole[:n, :n], whole[:n, n:]


def is_sampled_every(dt: float, system: control.InputOutputSystem) -> bool:
    """Whether a python-control system is discrete with this sample time [s], but for rounding."""
    return system.isdtime(strict=True) and system.dt is not True and abs(system.dt - dt) <= SAME_INSTANT * dt
