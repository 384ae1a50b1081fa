"""Steady response of a driveline to the torque orders of an engine."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..base.doors import called, checked
from ..base.errors import ParameterError, PowertrainError, UnknownNameError
from ..base.records import Record
from ..base.tables import Listed, Rows, number
from ..base.units import to_rpm
from ..driveline.collection import Driveline, HasDriveline
from ..driveline.operating import in_place, operating_point
from ..elements import ComplianceRow, OperatingPoint
from ..linear.assembly import as_driveline
from ..linear.impedance import Impedance
from ..linear.oscillator import Oscillator, oscillator_of
from .engine import Engine
from .firing import checked_order, checked_speeds, together
from .waves import extremes

# So many combinations of order and speed at once stay in the cache of a processor.
AT_ONCE = 4096


@called
@dataclass(frozen=True, eq=False, repr=False)
class OrderResponse(Listed, Record):
    """Steady response to the orders of an engine over its speed.

    ``response["damper_spring_torque"]`` are the complex amplitudes (orders, speeds), peak values of ``Re(amplitude
    exp(j n phi))`` with the crank angle phi.

    Attributes
    ----------
    orders : (n,) ndarray
        Oscillations per revolution of the engine.
    speed : (speeds,) ndarray
        Of the engine [rad/s].
    torque : (n, speeds) ndarray of complex
        Orders of the torque of all cylinders together [N m].
    mean_torque : (speeds,) ndarray
        Of the gas [N m].
    outputs : tuple of str
        Names of the signals.

    Raises
    ------
    UnknownNameError
        From ``response[name]``: a signal that is not there.

    Examples
    --------
    A flywheel alone: 100 N m of the second order turn 0.2 kg m^2 unevenly by ``2 T / (2 J Omega^2)``, crest to crest.

    >>> import powertrain_ctrl as pt
    >>> car = pt.Driveline(pt.Inertia("engine", J=0.2))
    >>> engine = pt.Engine(cylinders=1, orders={2.0: 100.0})
    >>> response = pt.order_response(car, engine, speed=[100.0, 200.0])
    >>> response.irregularity("engine").round(6)
    array([0.05  , 0.0125])
    """

    orders: np.ndarray
    speed: np.ndarray
    torque: np.ndarray
    mean_torque: np.ndarray
    outputs: tuple[str, ...]
    _values: dict[str, np.ndarray]
    _ratios: dict[str, float]

    def keys(self) -> tuple[str, ...]:
        """Names of all signals."""
        return self.outputs

    _ipython_key_completions_ = keys

    @checked
    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._values:
            raise UnknownNameError("signal", name, self.outputs, "in this response")
        return self._values[name]

    @called
    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self._values

    @checked
    def amplitude(self, output: str) -> np.ndarray:
        """(n, speeds) ndarray: peak value of each order of a signal."""
        return np.abs(self[output])

    @checked
    def peak(self, output: str) -> np.ndarray:
        """(speeds,) ndarray: largest magnitude of a signal over the cycle, orders with their phases, without the mean."""
        highest, lowest = extremes(self[output], self.orders)
        return np.maximum(highest, -lowest)

    @checked
    def irregularity(self, node: str) -> np.ndarray:
        """(speeds,) ndarray: largest less smallest speed of a node over its mean speed [-].

        Raises
        ------
        UnknownNameError
            A node whose speed is not among the outputs.
        PowertrainError
            A node that does not turn with the engine.
        """
        highest, lowest = extremes(self[f"{node}_speed"], self.orders)
        ratio = self._ratios.get(node, 0.0)
        if not ratio:
            raise PowertrainError(f'node "{node}" does not turn with the engine, permitted: one with a mean speed')
        return (highest - lowest) / (abs(ratio) * self.speed)

    def to_dict(self) -> dict:
        """Plain lists, for JSON or pandas; of each output ``amplitude``, ``phase`` [rad] (orders, speeds) and ``peak``."""
        outputs = {
            name: {
                "amplitude": np.abs(value).tolist(),
                "phase": np.angle(value).tolist(),
                "peak": self.peak(name).tolist(),
            }
            for name, value in self._values.items()
        }
        return {
            "orders": self.orders.tolist(),
            "speed": self.speed.tolist(),
            "mean_torque": self.mean_torque.tolist(),
            "outputs": outputs,
        }

    def listed(self) -> Rows:
        """Signals with the largest value that all orders together have at any speed."""
        return [[name, number(float(self.peak(name).max())), "peak"] for name in self.outputs]

    def __repr__(self) -> str:
        rpm = to_rpm(self.speed)
        orders = f"{len(self.orders)} orders, {self.orders[0]:g} to {self.orders[-1]:g}"
        speeds = f"{len(rpm)} speeds, {rpm.min():.0f} to {rpm.max():.0f} rpm"
        return f"OrderResponse: {orders}; {speeds}; {len(self.outputs)} outputs"


@checked
def order_response(
    car: HasDriveline,
    engine: Engine,
    speed: float | ArrayLike,
    nodes: Iterable[str] | str = "engine",
    highest_order: float = 12.0,
    load: Any = None,
    outputs: Iterable[str] | str | None = None,
) -> OrderResponse:
    """Steady response of a driveline to the torque orders of an engine, at each of many speeds.

    Parameters
    ----------
    car : Driveline or TwoMass
        Linear, but for what depends on the speed alone, such as a `Pendulum`: that is taken at each speed of the engine.
        Clutches are as they are, locked or released.
    engine : Engine
    speed : float or (speeds,) array_like
        Of the engine [rad/s], > 0.
    nodes : str or sequence of str
        The node that all cylinders drive, or one for each cylinder, by their numbers.
    highest_order : float
        0.5 to 200.
    load : float, str or (speeds,) array_like, optional
        Mean torque of the gas [N m] instead of that of `orders.wiebe`, one or one for each speed; "fuel cut" is what an
        engine does that is driven by the car.
    outputs : str or list of str, optional
        As of `forced_response`; None means all.

    Returns
    -------
    OrderResponse

    Raises
    ------
    ParameterError
        A speed that is not > 0, a highest order or a load that is not permitted, not as many nodes as cylinders.
    UnknownNameError
        A node or signal that is not there.
    TopologyError
        A driveline that cannot be assembled.
    PowertrainError
        Elements that are not linear; a node on which no torque can act.

    Notes
    -----
    The inertia of the crank train is taken as its mean (no parametric excitation), pendulums swing little.

    Examples
    --------
    What the clutch disc of the source's car leaves of the irregularity, third gear, 1000 rpm and 150 N m:

    >>> import powertrain_ctrl as pt
    >>> engine = pt.Engine(
    ...     cylinders=4, firing_order=(1, 3, 4, 2), bore=0.0825, stroke=0.0928, rod=0.144, reciprocating_mass=0.55,
    ...     pressure=pt.orders.wiebe(mean_torque=150.0, compression_ratio=10.5),
    ... )
    >>> car = pt.examples.conventional(gear_ratio=3.6)
    >>> response = pt.order_response(car, engine, speed=pt.rpm(1000.0))
    >>> round(float(response.irregularity("engine")[0]), 3), round(float(response.irregularity("transmission")[0]), 3)
    (0.1, 0.033)
    """
    speeds = checked_speeds("order_response", speed)
    driveline, driven = as_driveline(car), driven_nodes("order_response", engine, as_driveline(car), nodes)
    harmonics = engine.harmonics(speeds, checked_order("order_response", highest_order, engine.order_step), load)
    orders = harmonics.orders
    if not orders.size:
        raise ParameterError(
            "order_response", "highest_order", highest_order, "", "at least the lowest order of the engine"
        )
    oscillator, impedances, ratios = _at_speeds(driveline, next(iter(driven)), speeds)
    phases = engine.phases(orders)
    torques = {
        oscillator.model.inputs.index(f"{node}_torque"): together(phases[:, own]) for node, own in driven.items()
    }
    chosen = oscillator.chosen(outputs)
    values = np.empty((len(chosen), len(orders), len(speeds)), dtype=complex)
    at_once = max(1, AT_ONCE // len(orders))
    for start in range(0, len(speeds), at_once):
        part = slice(start, start + at_once)
        here = harmonics.amplitude[:, part]
        given = {number: phase[:, None] * here for number, phase in torques.items()}
        z = [Impedance(*(v[part] if np.ndim(v) else v for v in each)) for each in impedances]
        oscillator.response(np.multiply.outer(orders, speeds[part]), given, chosen, values[:, :, part], z)
    return OrderResponse(
        orders=orders,
        speed=speeds,
        torque=together(phases)[:, None] * harmonics.amplitude,
        mean_torque=harmonics.mean,
        outputs=tuple(chosen),
        _values=dict(zip(chosen, values, strict=True)),
        _ratios=ratios,
    )


def driven_nodes(owner: str, engine: Engine, car: Driveline, nodes: Iterable[str] | str) -> dict[str, list[int]]:
    """The cylinders, from 0 on, that drive each node."""
    names = [nodes] if isinstance(nodes, str) else list(nodes)
    if len(names) not in (1, engine.cylinders):
        permitted = f"one node, or one for each of {engine.cylinders} cylinders"
        raise ParameterError(owner, "nodes", names, "", permitted)
    heavy = [node for e in car for row in e.inertias for node in row.nodes if node not in car.translating]
    for name in names:
        if name not in car.nodes:
            raise UnknownNameError("node", name, car.nodes, "in this driveline")
        if name not in heavy:
            raise PowertrainError(
                f'nodes: no torque acts on "{name}", permitted: a turning node with inertia of its own'
            )
    if len(names) == 1:
        return {names[0]: list(range(engine.cylinders))}
    found: dict[str, list[int]] = {}
    for cylinder, name in enumerate(names):
        found.setdefault(name, []).append(cylinder)
    return found


def _at_speeds(car: Driveline, node: str, speeds: np.ndarray) -> tuple[Oscillator, list[Impedance], dict[str, float]]:
    """The driveline at speeds of a node; impedances of its rows, arrays where they depend on the speed; all ratios."""
    point = turning(car, node)
    depending = [e for e in car if any(not law.is_clutch for law in e.laws)]
    if not depending:
        oscillator = oscillator_of(car)
        return oscillator, oscillator.impedances, dict(point.speed)
    oscillator = oscillator_of(car.at(speed={node: float(speeds[0])}))
    rows: dict[str, list[ComplianceRow]] = {}
    for speed in speeds.tolist():
        here = OperatingPoint(point.modes, {name: ratio * speed for name, ratio in point.speed.items()})
        for row in (row for e in depending for part in in_place(e, here) for row in part.compliances):
            rows.setdefault(row.name, []).append(row)
    impedances = list(oscillator.impedances)
    for name, each in rows.items():
        stiffness = np.array([row.stiffness for row in each])
        damping = np.array([row.damping for row in each])
        impedances[oscillator.model.compliances.index(name)] = Impedance(stiffness, damping)
    return oscillator, impedances, dict(point.speed)


def turning(car: Driveline, node: str) -> OperatingPoint:
    """Speeds of all nodes per speed of one, as one body; none where it is held at rest in a linear driveline."""
    try:
        return operating_point(car.elements, car.nodes, car.released, None, None, {node: 1.0})
    except PowertrainError:
        if any(not law.is_clutch for e in car for law in e.laws):
            raise
        return OperatingPoint({}, {})
