"""Speeds at which an order of an engine meets a mode of the driveline."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.doors import called, checked
from ..base.errors import ParameterError
from ..base.records import Record
from ..base.tables import Printed
from ..base.units import rpm as to_speed
from ..base.units import to_hz, to_rpm
from ..driveline.collection import Driveline, HasDriveline
from ..linear.assembly import as_driveline
from ..linear.modal import Modes, modes
from .engine import Engine
from .firing import checked_order
from .response import driven_nodes

# Speeds between which modes of a driveline with pendulums are followed.
GRID = 161
# Cylinders that act on a mode by less than this part do not drive it: they cancel, or sit where it does not move.
IDLE = 1e-9
# A crossing is found to this part of the speed.
FOUND = 1e-12


@called
@dataclass(frozen=True, eq=False, repr=False)
class CriticalSpeeds(Printed, Record):
    """Critical speeds, by mode and order: undamped frequencies, all modes.

    Attributes
    ----------
    mode : (n,) ndarray of int
        Number of the mode, as in `modes`.
    order : (n,) ndarray
        Oscillations per revolution of the engine.
    frequency_hz : (n,) ndarray
        Undamped natural frequency [Hz].
    rpm : (n,) ndarray
        Speed of the engine [1/min].
    damping_ratio : (n,) ndarray
        Of the mode [-]; above 1 nothing resonates.
    phase_sum : (n,) ndarray
        How much the cylinders add up in this mode: 1 is as if all of them acted at its largest motion at once.
    compliance : tuple of str
        Where most of the strain energy is.
    grid_rpm, grid_hz : (speeds,), (modes, speeds) ndarray
        Frequencies of the elastic modes over the speed, constant but for pendulums.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> engine = pt.Engine(cylinders=4, firing_order=(1, 3, 4, 2), orders={2.0: 200.0, 4.0: 90.0})
    >>> pt.critical_speeds(pt.examples.conventional(gear_ratio=3.6), engine, (500.0, 4000.0))
    mode  order  f [Hz]      rpm  zeta [-]  phase sum  most strain energy in
    2         2   21.24   637.06    0.0897       0.57  damper_spring
    3         2   31.63   949.04    1.1958       0.14  tyres
    4         4  188.20  2823.05    0.0187     0.0048  clutch_shaft
    """

    mode: np.ndarray
    order: np.ndarray
    frequency_hz: np.ndarray
    rpm: np.ndarray
    damping_ratio: np.ndarray
    phase_sum: np.ndarray
    compliance: tuple[str, ...]
    grid_rpm: np.ndarray
    grid_hz: np.ndarray

    headers = ("mode", "order", "f [Hz]", "rpm", "zeta [-]", "phase sum", "most strain energy in")

    def __len__(self) -> int:
        return len(self.rpm)

    def rows(self) -> Iterator[Sequence[str]]:
        """Rows of the printed table."""
        columns = (
            self.mode,
            self.order,
            self.frequency_hz,
            self.rpm,
            self.damping_ratio,
            self.phase_sum,
            self.compliance,
        )
        for mode, order, f, rpm, zeta, phases, compliance in zip(*columns, strict=True):
            yield [f"{mode}", f"{order:g}", f"{f:.2f}", f"{rpm:.2f}", f"{zeta:.4f}", f"{phases:.2g}", compliance]

    @property
    def note(self) -> str:
        """What there is instead of an empty table."""
        return "" if len(self) else "no order meets a mode in this range"

    def to_dict(self) -> dict:
        """Plain lists by column, for JSON or pandas."""
        columns = ("mode", "order", "frequency_hz", "rpm", "damping_ratio", "phase_sum")
        return {name: getattr(self, name).tolist() for name in columns} | {"compliance": list(self.compliance)}


@checked
def critical_speeds(
    car: HasDriveline,
    engine: Engine,
    rpm: tuple[float, float],
    nodes: Iterable[str] | str = "engine",
    highest_order: float = 12.0,
) -> CriticalSpeeds:
    """Speeds at which an order of the engine has the frequency of a mode, ``rpm = 60 f / order``.

    Parameters
    ----------
    car : Driveline or TwoMass
        As of `order_response`; where a `Pendulum` makes frequencies depend on the speed, crossings are searched.
    engine : Engine
    rpm : (float, float)
        Lowest and highest speed [1/min], 0 < lowest < highest.
    nodes : str or sequence of str
        The node that all cylinders drive, or one for each cylinder, by their numbers.
    highest_order : float
        0.5 to 200.

    Returns
    -------
    CriticalSpeeds
        Sorted by mode and order; orders whose cylinders cancel in a mode are left out.

    Raises
    ------
    ParameterError
        A range that is not positive and ascending, a highest order that is not permitted.
    UnknownNameError
        A node that is not there.
    TopologyError
        A driveline that cannot be assembled.
    PowertrainError
        Elements that are not linear; a node on which no torque can act.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pair = pt.Driveline(
    ...     pt.Inertia("engine", J=0.2),
    ...     pt.Inertia("load", J=0.2),
    ...     pt.SpringDamper("shaft", "engine", "load", stiffness=4000.0),
    ... )
    >>> engine = pt.Engine(cylinders=1, orders={1.0: 50.0, 2.0: 100.0})
    >>> critical = pt.critical_speeds(pair, engine, (500.0, 3000.0))
    >>> critical.order, critical.rpm.round(3)
    (array([1., 2.]), array([1909.859,  954.93 ]))
    """
    low, high = rpm
    if not 0.0 < low < high:
        raise ParameterError("critical_speeds", "rpm", rpm, "1/min", "0 < lowest < highest")
    driveline = as_driveline(car)
    driven = driven_nodes("critical_speeds", engine, driveline, nodes)
    orders = engine.harmonics(np.ones(1), checked_order("critical_speeds", highest_order, engine.order_step)).orders
    at_speed = _AtSpeed(driveline, next(iter(driven)))
    grid = np.linspace(low, high, GRID if at_speed.depends else 2)
    omega = np.array([at_speed(speed).omega for speed in grid.tolist()]).T
    rows = []
    for mode in range(at_speed(low).n_rigid, len(omega)):
        for order in orders.tolist():
            for speed in at_speed.meetings(mode, order, grid, to_rpm(omega[mode])):
                result, phases = at_speed(speed), engine.phases(np.array([order]))[0]
                shape = dict(zip(result.nodes, result.shapes[:, mode].tolist(), strict=True))
                total = abs(sum(shape[node] * phases[own].sum() for node, own in driven.items())) / engine.cylinders
                if total > IDLE:
                    f, zeta = float(result.frequency_hz[mode]), float(result.damping_ratio[mode])
                    rows.append((mode, order, f, 60.0 * f / order, zeta, total, result.dominant_compliance(mode)))
    columns = [list(column) for column in zip(*rows, strict=True)] if rows else [[]] * 7
    numbers = [np.array(column, dtype=float) for column in columns[1:6]]
    return CriticalSpeeds(
        mode=np.array(columns[0], dtype=int),
        order=numbers[0],
        frequency_hz=numbers[1],
        rpm=numbers[2],
        damping_ratio=numbers[3],
        phase_sum=numbers[4],
        compliance=tuple(columns[6]),
        grid_rpm=grid,
        grid_hz=to_hz(omega[at_speed(low).n_rigid :]),
    )


class _AtSpeed:
    """Modes of a driveline at speeds [1/min] of a node."""

    def __init__(self, car: Driveline, node: str):
        self.car, self.node = car, node
        self.depends = any(not law.is_clutch for e in car for law in e.laws)
        self._constant = None if self.depends else modes(car)

    def __call__(self, rpm: float) -> Modes:
        return self._constant or modes(self.car.at(speed={self.node: to_speed(rpm)}))

    def meetings(self, mode: int, order: float, grid: np.ndarray, oscillations: np.ndarray) -> list[float]:
        """Speeds at which an order meets a mode, whose oscillations [1/min] are given on a grid of speeds."""
        if self._constant:
            rpm = float(oscillations[0]) / order
            return [rpm] if grid[0] <= rpm <= grid[-1] else []
        behind = oscillations < order * grid
        return [
            self._crossing(mode, order, float(grid[i]), float(grid[i + 1]), bool(behind[i]))
            for i in np.flatnonzero(behind[1:] != behind[:-1]).tolist()
        ]

    def _crossing(self, mode: int, order: float, low: float, high: float, behind: bool) -> float:
        while high - low > FOUND * high:
            middle = 0.5 * (low + high)
            if (to_rpm(self(middle).omega[mode]) < order * middle) == behind:
                low = middle
            else:
                high = middle
        return 0.5 * (low + high)
