"""A driveline behind a real actuator and a sampled controller, propagated exactly.

The command of the controller is limited, held for a sample, delayed (a pure delay, of any length), and turned into
torque by a first-order lag. Between the instants at which the delayed command changes the plant is linear with a
constant input, so it is stepped by matrix exponentials; nothing is approximated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import ClassVar

import control
import numpy as np
import scipy.linalg

from ..base.checks import NOT_NEGATIVE, POSITIVE, Duration, Period, TorqueLimit, checked_number
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError, TopologyError
from ..base.records import Record
from ..base.systems import linear_system
from ..base.tables import Listed
from ..driveline.collection import HasDriveline
from ..driveline.ends import Ends, driven, ends
from ..linear.assembly import as_driveline, assemble
from ..linear.statespace import state_space
from ..reduction.twomass import SwitchedTwoMass

# Samples of delay that a discrete system holds as states.
MOST_HELD = 5000
# What a controller can ask for by the names of its inputs, and what it gives.
MEASURED = ("engine_speed", "wheels_speed")
CONTROLLER_INPUTS = ("torque_demand", *MEASURED, "torque_limited", "ratio")
COMMAND = "torque_command"
# Lag, delay and sample time are shorter than this [s]: a slower actuator or controller cannot act on a shuffle of some
# hertz, and 1 or more is a time in milliseconds.
LONGEST = 1.0
# Instants nearer to each other than this share of a sample are one.
SAME_INSTANT = 1e-9


@checked
@dataclass(frozen=True, kw_only=True, repr=False)
class SampledPlant(Listed, Record):
    """Driveline with torque actuator, speed sensors and sample time, as an anti-jerk controller sees it.

    Speeds are deviations from those before the manoeuvre; so is the torque, which before it is in balance.

    Parameters
    ----------
    car : Driveline or TwoMass
        Connected, with one vehicle and a tyre or a node "wheels". Its engine is the node of that name, otherwise the
        first node; its wheel speed is that of "wheels", otherwise the mean of the driven wheels.
    lag : float
        Time constant of the torque [s], >= 0 and below 1 s.
    delay : float
        Pure delay of the command [s], >= 0 and below 1 s; any length, also not a multiple of ``dt``.
    dt : float
        Sample time [s], > 0 and below 1 s.
    torque_limits : (float, float)
        Smallest and largest command [N m].

    Raises
    ------
    PowertrainError
        A `SwitchedTwoMass`, which a sampled plant cannot be.
    ParameterError
        A time out of range, or limits that are not in order.
    TopologyError
        A driveline without wheels, in several parts, or without a vehicle or with more than one.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> plant = pt.SampledPlant(car=pt.examples.conventional())
    >>> plant.discrete().nstates  # 6 twists, 7 speeds, torque, one sample of delay
    15
    """

    car: HasDriveline
    lag: Duration = 0.03
    delay: Duration = 0.01
    dt: Period = 0.01
    torque_limits: tuple[TorqueLimit, TorqueLimit] = (0.0, 350.0)

    UNITS: ClassVar[Mapping[str, str]] = {
        "lag": "s",
        "delay": "s",
        "dt": "s",
        "torque_limits": "N m",
    }

    def __post_init__(self) -> None:
        for name, permitted in (("lag", NOT_NEGATIVE), ("delay", NOT_NEGATIVE), ("dt", POSITIVE)):
            time = checked_number("sampled plant", name, getattr(self, name), "s", permitted)
            if time >= LONGEST:
                permitted = (
                    f"{permitted.removesuffix(' and finite')} and below {LONGEST:g}; {time:g} ms is {1e-3 * time:g} s"
                )
                raise ParameterError("sampled plant", name, time, "s", permitted)
            object.__setattr__(self, name, time)
        if isinstance(self.car, SwitchedTwoMass):
            raise PowertrainError(
                "a sampled plant does not switch; take the model of one clutch state, e.g. its closed one"
            )
        limits = self.torque_limits
        if not (
            isinstance(limits, Sequence)
            and len(limits) == 2
            and all(isinstance(limit, Real) for limit in limits)
            and limits[0] < limits[1]
        ):
            raise ParameterError("sampled plant", "torque_limits", self.torque_limits, "N m", "(smallest, largest)")
        object.__setattr__(self, "torque_limits", tuple(limits))
        _ = self.ratio, self.vehicle

    def __repr__(self) -> str:
        low, high = self.torque_limits
        times = ", ".join(f"{name} {1e3 * getattr(self, name):g} ms" for name in ("lag", "delay", "dt"))
        nodes = ", ".join((self.engine, *self.wheels, self.vehicle))
        return f"SampledPlant: {times}, torque {low:g} to {high:g} N m; {nodes}, ratio {self.ratio:.6g}"

    @cached_property
    def linear(self) -> HasDriveline:
        """The car, or where it has play, stages or other laws, it for small motion while the engine drives."""
        return driven(self.car)

    @property
    def is_linear(self) -> bool:
        """Whether nothing but clutches, which stay as they are, is nonlinear in the car."""
        return self.linear is self.car

    @cached_property
    def _ends(self) -> Ends:
        found = ends(self.car)
        if not found.wheels:
            raise TopologyError('anti-jerk control measures the wheel speed: name a node "wheels" or add a Tyre')
        return found

    @property
    def engine(self) -> str:
        """Node that the commanded torque drives."""
        return self._ends.engine

    @property
    def wheels(self) -> tuple[str, ...]:
        """Nodes whose mean speed is the measured one: "wheels", else the wheels of all tyres that are driven."""
        return self._ends.wheels

    @property
    def vehicle(self) -> str:
        """Node of the vehicle; none or more than one is a `TopologyError`."""
        if len(self._ends.vehicles) != 1:
            raise TopologyError(f"anti-jerk control needs one vehicle, there are {len(self._ends.vehicles)}")
        return self._ends.vehicles[0]

    @cached_property
    def ratio(self) -> float:
        """Engine speed over wheel speed when everything turns as one body."""
        motion = self._rigid_motion  # first of all it has to be one driveline
        return self._ends.ratio(motion)

    @property
    def vehicle_radius(self) -> float:
        """Vehicle speed over wheel speed when everything turns as one body [m]."""
        return self._rigid_motion[self.vehicle] / self._ends.at_wheels(self._rigid_motion)

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
        """Driveline and lag without the delay: inputs ``torque_command`` [N m] and ``vehicle_force`` [N]."""
        wheels = [f"{wheel}_speed" for wheel in self.wheels]
        signals = [f"{self.engine}_speed", *wheels, f"{self.vehicle}_acceleration"]
        G = state_space(self.linear, [f"{self.engine}_torque", f"{self.vehicle}_force"], signals)
        A, B = G.A, G.B
        C, D = (np.vstack([M[0], M[1:-1].mean(axis=0), M[-1]]) for M in (G.C, G.D))
        if D[:2].any():
            raise PowertrainError(
                f"{self.engine} has no inertia, so its torque sets speeds at once; give it an Inertia"
            )
        difference = C[0] - self.ratio * C[1]
        if self.lag:
            n = len(A)
            A = np.block([[A, B[:, :1]], [np.zeros((1, n)), np.array([[-1.0 / self.lag]])]])
            B = np.block([[np.zeros((n, 1)), B[:, 1:]], [np.array([[1.0 / self.lag, 0.0]])]])
            rows = np.vstack([C[:2], difference, C[2:]])
            C = np.block([[rows, np.vstack([np.zeros((3, 1)), D[2:, :1]])], [np.zeros((1, n)), np.ones((1, 1))]])
            D = np.vstack([np.zeros((3, 2)), [[0.0, D[2, 1]]], np.zeros((1, 2))])
        else:
            C = np.vstack([C[:2], difference, C[2:], np.zeros((1, len(A)))])
            D = np.vstack([np.zeros((3, 2)), D[2:], [[1.0, 0.0]]])
        states = [*G.state_labels, "engine_torque"] if self.lag else list(G.state_labels)
        return linear_system(A, B, C, D, inputs=[COMMAND, "vehicle_force"], outputs=list(self.outputs), states=states)

    @property
    def delay_in_samples(self) -> tuple[int, float]:
        """Whole samples of delay and the rest [s]."""
        whole = int(np.floor(self.delay / self.dt + SAME_INSTANT))
        rest = self.delay - whole * self.dt
        return whole, rest if rest > SAME_INSTANT * self.dt else 0.0

    @checked
    def discrete(self) -> control.StateSpace:
        """Exact discrete system from ``torque_command`` to the outputs, the delay as shift states; for design.

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
            raise PowertrainError(f"the delay is {self.delay / self.dt:g} samples, permitted: at most {MOST_HELD}")
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
