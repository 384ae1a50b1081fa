"""Torque of the gas at different loads."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..base.errors import ParameterError
from ..base.records import Record, read_only
from .crank import SliderCrank
from .pressure import Wiebe

# Orders up to this one are kept.
USUAL = 12.0
# The word for a load without any heat.
FUEL_CUT = "fuel cut"


@dataclass(frozen=True, eq=False)
class Gas(Record):
    """Pressure in the cylinders of an engine: one table, or two of a `Wiebe`, without heat and per heat."""

    crank: SliderCrank
    area: float
    cylinders: int
    cycle: float
    pressure: Any
    crankcase_pressure: float

    @cached_property
    def angle(self) -> np.ndarray:
        """(n,) ndarray: crank angles [rad] from firing top dead centre."""
        return read_only(self._table[0])

    @cached_property
    def above(self) -> np.ndarray:
        """(tables, n) ndarray: pressures over that of the crankcase [Pa]."""
        pressures = self._table[1].copy()
        pressures[0] -= self.crankcase_pressure
        return read_only(pressures)

    @property
    def _table(self) -> tuple[np.ndarray, np.ndarray]:
        if isinstance(self.pressure, Wiebe):
            return self.pressure.table(self.crank)
        return np.array(self.pressure[0]), np.array(self.pressure[1:])

    def orders(self, orders: np.ndarray) -> np.ndarray:
        """(tables, 1 + n) ndarray: mean and complex orders, from the first one on, of the torque of one cylinder [N m]."""
        if orders.size and orders[-1] > USUAL:
            return self._work(orders)
        return self._usual[:, : 1 + len(orders)]

    def _work(self, orders: np.ndarray) -> np.ndarray:
        return self.area * self.crank.work_orders(self.angle, self.above, np.concatenate([[0.0], orders]))

    @cached_property
    def _usual(self) -> np.ndarray:
        step = 2.0 * np.pi / self.cycle
        return read_only(self._work(step * np.arange(1, 1 + round(USUAL / step))))

    def torque(self, phi: np.ndarray, load: Any) -> np.ndarray:
        """Torque of one cylinder [N m] at crank angles from its firing top dead centre."""
        pressure = self.heat(load, 1)[:, 0] @ self.above
        within = self.angle[0] + np.mod(phi - self.angle[0], self.cycle)
        return self.area * self.crank.lever(phi) * np.interp(within, self.angle, pressure)

    def heat(self, load: Any, speeds: int) -> np.ndarray:
        """(tables, speeds) ndarray: parts of the tables that add up to the pressure.

        Raises
        ------
        ParameterError
            A load that is none, or below that without fuel; one of a table, which has its own.
        """
        if not isinstance(self.pressure, Wiebe):
            if load is not None:
                permitted = "None: a pressure table is that of one load; give an Engine of another table"
                raise ParameterError("Engine", "load", load, "", permitted)
            return np.ones((1, speeds))
        motored, fired = self.cylinders * self._usual[:, 0].real
        if isinstance(load, str) and load == FUEL_CUT:
            return np.array([np.ones(speeds), np.zeros(speeds)])
        wanted = np.asarray(self.pressure.mean_torque if load is None else load)
        if wanted.dtype.kind not in "iuf" or wanted.shape not in ((), (speeds,)) or not np.isfinite(wanted).all():
            permitted = f'mean torque [N m], one or one for each of {speeds} speeds, or "{FUEL_CUT}"'
            raise ParameterError("Engine", "load", load, "", permitted)
        if (wanted < motored).any():
            permitted = f'>= {motored:.4g} N m, that without fuel (load="{FUEL_CUT}")'
            raise ParameterError("Engine", "load", float(wanted.min()), "N m", permitted)
        return np.array([np.ones(speeds), np.broadcast_to((wanted - motored) / fired, (speeds,))])
