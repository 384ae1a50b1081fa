"""A driveline with clutches as ``control.NonlinearIOSystem``, continuous or as an exact discrete map."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import control
import numpy as np

from ..base.checks import POSITIVE, Period, checked_number
from ..base.doors import called, checked
from ..base.errors import PowertrainError, SignalError
from ..base.systems import PicklableSystem
from ..driveline.collection import HasDriveline
from .continuous import STICK_TIME, functions, is_direct, state_names
from .discrete import DiscreteDriveline
from .model import Plants, plants_of
from .signals import PiecewiseLinear, Signal, Times, at_samples, checked_times
from .starts import initial_speeds

# What python-control's "algebraic loop detected" asks for.
DIRECT = (
    "clutch torques and modes and the accelerations of the driveline depend on the inputs of the same instant; feed them "
    "back through a lag or a delay"
)
LINEAR_HOLD = (
    'with hold="linear" the outputs of a sample depend on its own inputs; take nonlinear_system(..., hold="zero"), with '
    "which speeds and twists do not"
)


@checked
def nonlinear_system(car: HasDriveline, dt: Period | None = None, hold: str = "linear") -> control.NonlinearIOSystem:
    """Driveline with slipping and sticking clutches for ``interconnect``, ``linearize`` and ``input_output_response``.

    Parameters
    ----------
    car : Driveline, TwoMass or SwitchedTwoMass
        Whether its clutches are locked or released does not matter: the capacity decides.
    dt : float, optional
        Sample time [s] of the discrete system, which is exact at the samples, events inside a step included. None gives
        the continuous system, which takes laws without memory: friction, also over slip, stages, road loads, clipped
        play, slip tyres without relaxation.
    hold : {"linear", "zero"}
        Discrete system only: inputs between samples are straight lines, as `simulate` reads samples, so that a
        sample's outputs depend on its own inputs; or constant, as a digital controller holds them. In a closed loop
        take "zero", with which speeds and twists do not depend on the inputs of their own sample.

    Returns
    -------
    control.NonlinearIOSystem
        Inputs ``<inertia>_torque`` [N m], ``<mass>_force`` [N], ``<clutch>_capacity`` [N m], in this order; outputs all
        those of `simulate`, with ``<clutch>_mode`` +1 and -1 sliding, 0 stuck, 2 free. States are the twists [rad]
        and the coordinate speeds, and for a discrete system the clutch modes and, with "linear", the inputs before.

    Raises
    ------
    PowertrainError
        Without ``dt`` a `SwitchedTwoMass`, or a law that needs memory, by name: Nordin's play, one-way clutches, elastic
        friction, relaxing tyres, dog clutches, gears with losses; a torque converter; a sample time that is not > 0 and
        finite, a hold that is not known. Later, from the discrete system: an input that is not finite, a negative capacity
        in its update. From a loop around it: an output that depends on itself.

    Notes
    -----
    In the continuous system the torque of a clutch minimises ``tau W tau / 2 - tau (a + slip / stick_time)`` within its
    capacity: ``a`` is the slip acceleration without clutch torques, ``W`` what the torques add to it. For one clutch
    that is the stick torque saturated at the capacity. It is exactly Coulomb friction outside, has no creep inside,
    and is right when several clutches stick together. ``params={"stick_time": ...}`` changes the 1e-4 s. Other friction
    does the same within its own limit; play and stages are evaluated at their twist, a state besides, and slip.
    A static ratio above 1 needs memory, which only `simulate` and the discrete system have.

    Integrate it with `solver_settings`: an implicit method (Radau), since driveline modes above 1 kHz make explicit
    ones crawl at their stability limit; a relative tolerance of 1e-6, since the default 1e-3 is wrong by several
    rad/s; and a largest step, since an adaptive method at rest steps over a ramp that begins later.

    In a loop python-control evaluates all controllers first with inputs 0, before it knows a speed; one that divides by
    a speed must not give infinity then.

    Examples
    --------
    >>> import numpy as np, control, powertrain_ctrl as pt
    >>> car = pt.examples.conventional(damping="open")
    >>> system = pt.nonlinear_system(car, dt=0.001)
    >>> times = np.arange(0, 2001) * 0.001
    >>> ramps = {"engine_torque": pt.ramp(1.5, 0.22, 350.0), "clutch_capacity": pt.ramp(1.5, 0.22, 370.0)}
    >>> inputs = pt.input_values(system, car, times, ramps)
    >>> start = pt.initial_state(system, car, {"engine": pt.rpm(5000)})
    >>> response = control.input_output_response(system, times, inputs, start)
    >>> round(float(response.outputs[system.find_output("engine_speed"), -1]), 2)
    505.85
    """
    plants = plants_of(car)
    if dt is None:
        if plants.stuck is not plants.slipping:
            raise PowertrainError("a control model that switches needs memory of its clutch; give dt, e.g. dt=0.001")
        for law in plants.laws:
            if law.regions:
                raise PowertrainError(f"{law.owner} is followed in steps of its own; give dt, e.g. dt=0.001")
            if not is_direct(law):
                raise PowertrainError(f"{law.owner} needs memory of its mode; give dt, e.g. dt=0.001")
        for law in plants.sources:
            raise PowertrainError(
                f"{law.owner} needs memory of its input, by whose rate it moves its node; give dt, e.g. dt=0.001"
            )
        return PicklableSystem(_system, car, None, hold)
    dt = checked_number("nonlinear system", "dt", dt, "s", POSITIVE)
    if hold not in ("linear", "zero"):
        raise PowertrainError(f'hold = {hold!r}, permitted: "linear", "zero"')
    return PicklableSystem(_system, car, dt, hold)


def _system(car: HasDriveline, dt: float | None, hold: str) -> control.NonlinearIOSystem:
    plants, linear = plants_of(car), hold == "linear"
    signals = {"inputs": list(plants.inputs), "outputs": list(plants.outputs), "name": "driveline"}
    if dt is None:
        system = control.nlsys(
            *functions(plants), states=list(state_names(plants)), params={"stick_time": STICK_TIME}, **signals
        )
    else:
        exact = DiscreteDriveline(plants, dt, linear)
        states = [*plants.states, *(f"{name}_mode" for name in plants.names)]
        if linear:
            states += [*(f"{name}_before" for name in plants.inputs), "running"]
        system = control.nlsys(exact.update, exact.output, states=states, dt=dt, **signals)
    system.loop_remedy = LINEAR_HOLD if dt is not None and linear else DIRECT
    return system


@checked
def initial_state(
    system: control.NonlinearIOSystem, car: HasDriveline, initial_speed: Mapping[str, Any] | None = None
) -> np.ndarray:
    """State vector of `nonlinear_system` for given speeds, with no spring loaded.

    Parameters
    ----------
    system : control.NonlinearIOSystem
        From ``nonlinear_system(car, ...)``.
    car : Driveline, TwoMass or SwitchedTwoMass
    initial_speed : mapping, optional
        Node to speed, as in `simulate`.

    Returns
    -------
    (states,) ndarray
        Twists and speeds; for a discrete system also no twist of any play, the clutches as free, and the inputs before as
        not yet known.

    Raises
    ------
    UnknownNameError
        A node that is not there.
    ParameterError
        A speed that is not a finite number.
    PowertrainError
        Speeds that gears forbid, or the system of another driveline.

    Examples
    --------
    Up to the clutch everything turns with the engine, behind it all is at rest:

    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> system = pt.nonlinear_system(car, dt=0.001)
    >>> start = pt.initial_state(system, car, {"engine": 100.0})
    >>> names = ("engine_speed", "clutch_primary_speed", "clutch_secondary_speed")
    >>> [round(float(start[system.find_state(name)]), 6) for name in names]
    [100.0, 100.0, 0.0]
    """
    plants = plants_of(car)
    _check_belongs(system, plants)
    speed = initial_speeds(plants.model, initial_speed)
    start = np.concatenate([np.zeros(plants.slipping.r), speed])
    if system.isdtime(strict=True):
        start = np.concatenate([start, np.zeros(len(plants.states) - len(start)), plants.unknown])
    return np.concatenate([start, np.zeros(system.nstates - len(start))])


@checked
def input_values(
    system: control.NonlinearIOSystem, car: HasDriveline, timepts: Times, inputs: Mapping[str, Signal] | None = None
) -> np.ndarray:
    """Input array of `nonlinear_system` for ``control.input_output_response``, from signals by name.

    Parameters
    ----------
    system : control.NonlinearIOSystem
        From ``nonlinear_system(car, ...)``.
    car : Driveline, TwoMass or SwitchedTwoMass
    timepts : (N,) array_like
        [s], increasing.
    inputs : mapping, optional
        As in `simulate`: a torque that is not given is 0, a capacity the clutch's ``max_torque``.

    Returns
    -------
    (inputs, N) ndarray
        In the order of ``system.input_labels``; at a jump the value behind it.

    Raises
    ------
    UnknownNameError
        A signal that is not there.
    SignalError
        Values that are not finite or of the wrong number.

    Examples
    --------
    >>> import numpy as np, powertrain_ctrl as pt
    >>> car = pt.examples.conventional()
    >>> system = pt.nonlinear_system(car, dt=0.5)
    >>> values = pt.input_values(system, car, np.arange(4) * 0.5, {"engine_torque": pt.ramp(0.5, 0.5, 250.0)})
    >>> values[system.find_input("engine_torque")].tolist(), values[system.find_input("clutch_capacity")].tolist()
    ([0.0, 0.0, 250.0, 250.0], [370.0, 370.0, 370.0, 370.0])
    """
    plants = plants_of(car)
    _check_belongs(system, plants)
    timepts, given = checked_times(timepts), plants.signals(inputs)
    return np.array([at_samples(given.get(name, 0.0), timepts, name) for name in plants.inputs])


def _check_belongs(system: control.NonlinearIOSystem, plants: Plants) -> None:
    known = plants.states if system.isdtime(strict=True) else state_names(plants)
    if plants.inputs != tuple(system.input_labels) or known != tuple(system.state_labels[: len(known)]):
        raise PowertrainError("the system is not that of this driveline")


@called
def solver_settings(*signals: Any) -> dict:
    """Keyword arguments with which ``control.input_output_response`` integrates the continuous system rightly.

    Parameters
    ----------
    *signals : PiecewiseLinear
        The ramps that drive it; the largest step is half the shortest of them. Shorter ones than 1 ns are jumps.

    Returns
    -------
    dict
        ``solve_ivp_method`` and ``solve_ivp_kwargs``: tolerances and the largest step, at most 50 ms.

    Raises
    ------
    SignalError
        A signal that is no ramp, step or sum of them.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.solver_settings(pt.ramp(1.5, 0.02, 370.0))["solve_ivp_kwargs"]["max_step"]
    0.01
    """
    for signal in signals:
        if not isinstance(signal, PiecewiseLinear):
            raise SignalError(f"solver_settings got {signal!r}, permitted: a ramp, a step or a sum of them")
    # the sum of a ramp to 0.2 + 0.1 s and one from 0.3 s has two corners a rounding apart
    widths = [width for signal in signals for width in np.diff(signal.times) if width > 1e-9]
    largest = round(float(min([0.05, *(0.5 * width for width in widths)])), 12)
    return {"solve_ivp_method": "Radau", "solve_ivp_kwargs": {"rtol": 1e-6, "atol": 1e-8, "max_step": largest}}
