"""Torque of a reciprocating engine over its crank angle, and its orders."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from functools import cached_property
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import POSITIVE, AtLeastOne, MomentOfInertia, Share
from ..base.doors import checked
from ..base.errors import ParameterError
from ..base.records import Record, read_only
from ..elements import Inertia
from ..hybrid.harmonics import Harmonic
from ..hybrid.signals import PiecewiseLinear
from .crank import SliderCrank
from .firing import SAME, checked_order, checked_orders, checked_speeds, firing_angles, together
from .gas import Gas
from .pressure import Pressure, Wiebe, checked_table
from .runup import RunUp

Length = Annotated[float, "m", POSITIVE]
Mass = Annotated[float, "kg", POSITIVE]
Angle = Annotated[float, "rad", POSITIVE]
Cylinders = Annotated[int, "", 1, 12]


class Harmonics(NamedTuple):
    """Orders (n,), their complex amplitudes of one cylinder (n, speeds) and the mean torque of all (speeds,) [N m]."""

    orders: np.ndarray
    amplitude: np.ndarray
    mean: np.ndarray


@checked
@dataclass(frozen=True, eq=False)
class Engine(Record):
    """Reciprocating engine as a source of torque orders: gas and inertia of its slider-cranks at their firing angles.

    The torque of one cylinder is ``mean + sum Re(T_n exp(j n phi))`` with the crank angle phi from its own firing top dead
    centre; a cylinder that fires at the angle phi_c lags by ``exp(-j n phi_c)``. The inertia torque is that of the exact
    slider-crank at constant speed. Without ``pressure`` and ``orders`` it is all there is.

    Attributes
    ----------
    cylinders : int
        1 to 12.
    firing_order : sequence of int, optional
        Numbers of the cylinders as they fire, at even distances; one cylinder needs none.
    bore, stroke, rod : float, optional
        [m]; the rod is longer than half the stroke. With ``orders`` no geometry is needed.
    reciprocating_mass : float, optional
        Of one piston with its part of the rod [kg], > 0.
    pressure : Wiebe or (angles, pressures), optional
        Made by `orders.wiebe`, or a table of the absolute pressure in one cylinder [Pa] over the crank angle [rad] from
        firing top dead centre, linear in between, over a whole cycle; an angle given twice is a jump.
    orders : mapping, optional
        Order to complex amplitude [N m] of one cylinder, peak values, instead of a pressure.
    firing_angles : sequence of float, optional
        Crank angles [rad] at which cylinders 1, 2, ... fire, instead of a firing order.
    bank_angle : float, optional
        Of a V engine whose cylinders fire in pairs on common crank pins [rad], > 0: the second of each pair fires by it
        later, the pairs at even distances. Where that is not so, give ``firing_angles``.
    strokes : int
        4, a cycle of two revolutions, or 2.
    crankcase_pressure : float
        Below the pistons [Pa].

    Raises
    ------
    ParameterError
        A firing order that is no permutation, a pressure table that does not span the cycle, orders that are not multiples
        of half an order (of a whole one for two strokes), values that are not permitted or missing.

    Examples
    --------
    Four cylinders in line: what does not cancel are even orders, of the inertia mostly the second.

    >>> import powertrain_ctrl as pt
    >>> engine = pt.Engine(
    ...     cylinders=4, firing_order=(1, 3, 4, 2), bore=0.0825, stroke=0.0928, rod=0.144, reciprocating_mass=0.55
    ... )
    >>> orders, torque = engine.torque_orders(pt.rpm(3000.0), highest_order=6)
    >>> {float(n): round(float(abs(t))) for n, t in zip(orders, torque[:, 0]) if abs(t) > 0.5}
    {2.0: 234, 4.0: 13, 6.0: 1}
    """

    _: KW_ONLY
    cylinders: Cylinders
    firing_order: Sequence[AtLeastOne] | None = None
    bore: Length | None = None
    stroke: Length | None = None
    rod: Length | None = None
    reciprocating_mass: Mass | None = None
    pressure: Any = None
    orders: Any = None
    firing_angles: Sequence[float] | None = None
    bank_angle: Angle | None = None
    strokes: int = 4
    crankcase_pressure: Pressure = 1.0e5

    def __post_init__(self) -> None:
        if self.strokes not in (2, 4):
            raise ParameterError("Engine", "strokes", self.strokes, "", "2 or 4")
        for name in ("firing_order", "firing_angles"):
            if getattr(self, name) is not None:
                self._keep(**{name: tuple(getattr(self, name))})
        _ = self.firing
        if self.pressure is not None and self.orders is not None:
            raise ParameterError("Engine", "pressure and orders", "both given", "", "one of them")
        if self.orders is not None:
            self._keep(orders=checked_orders(self.orders, self.order_step))
        has_crank = self.pressure is not None or self.reciprocating_mass is not None or self.orders is None
        needed = {"bore": self.pressure is not None, "stroke": has_crank, "rod": has_crank}
        needed["reciprocating_mass"] = self.pressure is None and self.orders is None
        for name, is_needed in needed.items():
            if is_needed and getattr(self, name) is None:
                remedy = "given, or orders={order: complex torque} instead of the geometry"
                raise ParameterError("Engine", name, None, "", remedy)
        if self.crank is not None and self.crank.rod <= 0.5 * self.crank.stroke:
            permitted = f"> {0.5 * self.crank.stroke:g} m, half the stroke"
            raise ParameterError("Engine", "rod", self.rod, "m", permitted)
        if isinstance(self.pressure, Wiebe):
            if self.strokes == 2:
                raise ParameterError(
                    "Engine", "pressure", "wiebe(...)", "", "for strokes=4; of two strokes give a table"
                )
        elif self.pressure is not None:
            self._keep(pressure=tuple(tuple(each.tolist()) for each in checked_table(self.pressure, self.cycle)))
        super().__post_init__()

    def _keep(self, **values: Any) -> None:
        for name, value in values.items():
            object.__setattr__(self, name, value)

    @property
    def cycle(self) -> float:
        """Crank angle of a working cycle [rad]."""
        return self.strokes * np.pi

    @property
    def order_step(self) -> float:
        """Orders are multiples of this: 0.5, or 1 for two strokes."""
        return 2.0 / self.strokes

    @cached_property
    def firing(self) -> np.ndarray:
        """(cylinders,) ndarray: crank angle [rad] at which each fires."""
        angles = firing_angles(self.cylinders, self.firing_order, self.firing_angles, self.bank_angle, self.cycle)
        return read_only(angles)

    @cached_property
    def crank(self) -> SliderCrank | None:
        """Geometry of one cylinder, if it is given."""
        return None if self.stroke is None or self.rod is None else SliderCrank(self.stroke, self.rod)

    @cached_property
    def _gas(self) -> Gas | None:
        if self.pressure is None or self.crank is None or self.bore is None:
            return None
        area = 0.25 * np.pi * self.bore**2
        return Gas(self.crank, area, self.cylinders, self.cycle, self.pressure, self.crankcase_pressure)

    @checked
    def mean_torque(self, load: Any = None) -> float:
        """Mean torque of the gas in all cylinders [N m], the closed integral of ``p dV`` over the cycle.

        Parameters
        ----------
        load : float or str, optional
            As of `order_response`.

        Returns
        -------
        float
        """
        return float(self.harmonics(np.ones(1), self.order_step, load).mean[0])

    @checked
    def torque_orders(
        self, speed: float | ArrayLike, highest_order: float = 12.0, load: Any = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Orders of the torque of all cylinders on one crank: with their phases, cylinder by cylinder.

        Parameters
        ----------
        speed : float or (speeds,) array_like
            Of the crank [rad/s], > 0.
        highest_order : float
            > 0.
        load : float, str or (speeds,) array_like, optional
            As of `order_response`.

        Returns
        -------
        orders, torque : (n,) ndarray, (n, speeds) ndarray of complex
            Multiples of half an order; amplitudes [N m], peak values.
        """
        found = self.harmonics(
            checked_speeds("torque_orders", speed), checked_order("torque_orders", highest_order, self.order_step), load
        )
        return found.orders, together(self.phases(found.orders))[:, None] * found.amplitude

    @checked
    def torque(self, angle: ArrayLike, speed: float, load: Any = None) -> np.ndarray:
        """Torque of all cylinders [N m] over the crank angle, at constant speed.

        Parameters
        ----------
        angle : (n,) array_like
            Crank angle [rad]; cylinders fire at `firing`.
        speed : float
            [rad/s], > 0.
        load : float or str, optional
            As of `order_response`.

        Returns
        -------
        (n,) ndarray
        """
        omega = float(checked_speeds("torque", speed)[0])
        total = np.zeros(np.shape(angle))
        for firing in self.firing:
            phi = np.asarray(angle, dtype=float) - firing
            if self.reciprocating_mass is not None and self.crank is not None:
                total += self.reciprocating_mass * omega**2 * self.crank.inertia_torque(phi)
            for order, amplitude in (self.orders or {}).items():
                total += (amplitude * np.exp(1j * order * phi)).real
            if self._gas is not None:
                total += self._gas.torque(phi, load)
        return total

    @checked
    def signal(
        self,
        speed: float | PiecewiseLinear,
        load: Any = None,
        highest_order: float = 12.0,
        cylinders: Sequence[AtLeastOne] | None = None,
        angle: float = 0.0,
        error: Share = 1e-4,
    ) -> Harmonic | RunUp:
        """Torque over time, an input for `simulate`: mean and orders at a constant speed, or at one that changes.

        At a constant speed it is exact. An engine that is given to `simulate` itself has the speed with which its node
        starts.

        Parameters
        ----------
        speed : float or PiecewiseLinear
            Of the crank [rad/s], > 0; one that changes by `ramp`, `samples` and sums of them.
        load : float or str, optional
            As of `order_response`.
        highest_order : float
            0.5 to 200.
        cylinders : sequence of int, optional
            Those that act on this node, by their numbers; None means all.
        angle : float
            Crank angle at t = 0 [rad].
        error : float
            Of a speed that changes: by how much of the sum of its orders the torque may be missed.

        Returns
        -------
        Harmonic or RunUp
            A function of time.

        Raises
        ------
        ParameterError
            A speed that is not > 0, a highest order, load, cylinder or error that is not permitted.

        Examples
        --------
        >>> import numpy as np, powertrain_ctrl as pt
        >>> engine = pt.Engine(cylinders=1, orders={2.0: 50.0})
        >>> car = pt.Driveline(pt.Inertia("engine", J=0.2))
        >>> response = pt.simulate(
        ...     car, np.linspace(0.0, 1.0, 11), {"engine_torque": engine.signal(100.0)}, initial_speed={"engine": 100.0}
        ... )
        >>> bool(abs(response["engine_speed"] - 100.0 - 50.0 / (0.2 * 200.0) * np.sin(200.0 * response.time)).max() < 1e-9)
        True
        """
        highest = checked_order("signal", highest_order, self.order_step)
        chosen = range(1, self.cylinders + 1) if cylinders is None else cylinders
        for cylinder in chosen:
            if cylinder > self.cylinders:
                raise ParameterError("signal", "cylinder", cylinder, "", f"1 to {self.cylinders}")
        own = [cylinder - 1 for cylinder in chosen]

        def orders(speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            found = self.harmonics(speeds, highest, load)
            share = together(self.phases(found.orders)[:, own])
            is_there = share != 0.0
            mean = found.mean * len(own) / self.cylinders
            return found.orders[is_there], share[is_there, None] * found.amplitude[is_there], mean

        if isinstance(speed, PiecewiseLinear):
            if not error:
                raise ParameterError("signal", "error", error, "", "> 0")
            return RunUp(orders, speed, angle, error)
        omega = checked_speeds("signal", speed)
        numbers, amplitudes, mean = orders(omega)
        turned = amplitudes[:, 0] * np.exp(1j * numbers * angle)
        tones = zip((numbers * omega[0]).tolist(), turned.tolist(), strict=True)
        return Harmonic(tuple(tones), PiecewiseLinear((0.0,), (float(mean[0]),)))

    def harmonics(self, speed: np.ndarray, highest_order: float, load: Any = None) -> Harmonics:
        """Orders of one cylinder up to the highest; those of the gas are computed once for all speeds."""
        if self.orders is not None and self.reciprocating_mass is None:
            orders = np.array([order for order in self.orders if order <= highest_order * (1.0 + SAME)])
        else:
            orders = self.order_step * np.arange(1, 1 + int(highest_order / self.order_step * (1.0 + SAME)))
        amplitude = np.zeros((len(orders), len(speed)), dtype=complex)
        mean = np.zeros(len(speed))
        if self.reciprocating_mass is not None and self.crank is not None:
            amplitude += self.reciprocating_mass * np.multiply.outer(self.crank.inertia_orders(orders), speed**2)
        if self._gas is not None:
            gas = self._gas.orders(orders).T @ self._gas.heat(load, len(speed))
            mean, amplitude = mean + self.cylinders * gas[0].real, amplitude + gas[1:]
        elif load is not None:
            raise ParameterError(
                "Engine", "load", load, "", "None: without a pressure of orders.wiebe there is but one load"
            )
        for order, torque in (self.orders or {}).items():
            amplitude[np.abs(orders - order) <= SAME * order] += torque
        return Harmonics(orders, amplitude, mean)

    def phases(self, orders: np.ndarray) -> np.ndarray:
        """(n, cylinders) ndarray: ``exp(-j order firing angle)``."""
        return np.exp(-1j * np.multiply.outer(orders, self.firing))

    @checked
    def inertia(self, name: str, *, J: MomentOfInertia, cylinders: Cylinders | None = None) -> Inertia:
        """Crank train as an element: what rotates, and the mean inertia of the masses that reciprocate.

        Parameters
        ----------
        name : str
            Of the node.
        J : float
            Moment of inertia of what rotates there [kg m^2], > 0: crank with its part of the rods, flywheel.
        cylinders : int, optional
            How many of them act on this node; None means all.

        Returns
        -------
        Inertia

        Raises
        ------
        ParameterError
            More cylinders than there are.

        Examples
        --------
        A long rod leaves half of the masses on the crank radius, ``J + m r^2 / 2``:

        >>> import powertrain_ctrl as pt
        >>> engine = pt.Engine(cylinders=1, stroke=0.1, rod=100.0, reciprocating_mass=0.8)
        >>> round(engine.inertia("crank", J=0.01).J, 6)
        0.011
        """
        count = self.cylinders if cylinders is None else cylinders
        if count > self.cylinders:
            raise ParameterError("Engine", "cylinders", count, "", f"1 to {self.cylinders}")
        mass = 0.0
        if self.reciprocating_mass is not None and self.crank is not None:
            mass = self.reciprocating_mass * self.crank.mean_square
        return Inertia(name, J=J + count * mass)
