"""Hydrodynamic torque converters, and what they are for small motion."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass, field
from itertools import pairwise

from ..base.checks import FINITE, NOT_NEGATIVE, checked_number, checked_points
from ..base.doors import called
from ..base.errors import ParameterError, PowertrainError
from .element import CouplingRow, Element, OperatingPoint, TwoEnded
from .laws import Law, Mode, Region, coupled_torques, region_at
from .springs import SpringDamper

# A converter that gives more than this part of what it takes is a slip of the pen, not of rounding.
ALL = 1.0 + 1e-9
# Speeds that differ by less than this part are the same.
SAME = 1e-9


@called
@dataclass(frozen=True)
class TorqueConverter(TwoEnded):
    """Hydrodynamic torque converter from the pump ``a`` to the turbine ``b``, by its tables over the speed ratio.

    ``T_pump = capacity(nu) omega_pump^2``, ``T_turbine = torque_ratio(nu) T_pump`` with ``nu = omega_turbine / omega_pump``:
    the steady characteristic, straight lines between the points of either table (Kotwicki, Dynamic models for torque
    converter equipped vehicles, SAE Technical Paper 820393 (1982); the inertia of pump and turbine is that of their nodes).
    The capacity is ``1 / K^2`` with the K-factor ``K = omega_pump / sqrt(T_pump)``. The reaction of the stator goes to the
    housing.

    In overrun, ``nu > 1``, pump and turbine change their parts, the stator free: ``T_pump = T_turbine = -capacity(1 / nu)
    omega_turbine^2``, an assumption, since tables of overrun are seldom known. While the turbine turns backwards the values
    at stall hold. For a pump that turns backwards there are no tables: such a run is refused.

    A `Clutch` between the same nodes is its lock-up clutch; while it is locked the converter carries nothing. Its torques
    are not piecewise linear: `simulate` follows them within a small tolerance and states how far that goes in
    ``Response.error_estimate``. For small motion about two speeds, `Driveline.at`, it is a `SpeedCoupling`.

    Parameters
    ----------
    name, a, b : str
        Own name; node of the pump; node of the turbine.
    speed_ratios : sequence of float
        nu [-], increasing from 0 (stall) to 1.
    capacities : sequence of float
        ``T_pump / omega_pump^2`` [N m s^2/rad^2], >= 0 and 0 at the end, where nothing slips.
    torque_ratios : sequence of float
        ``T_turbine / T_pump`` [-], >= 0; times nu, the efficiency, at most 1.

    Raises
    ------
    ParameterError
        Tables of different length, speed ratios that do not increase from 0 to 1, a capacity that is negative or not 0 at
        the end, a negative torque ratio, more power out than in.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends. Of a run: a pump that turns backwards.

    Examples
    --------
    Stalled at 200 rad/s:

    >>> import powertrain_ctrl as pt
    >>> converter = pt.TorqueConverter(
    ...     "converter",
    ...     "engine",
    ...     "turbine",
    ...     speed_ratios=(0.0, 0.6, 0.85, 1.0),
    ...     capacities=(3e-3, 3e-3, 2e-3, 0.0),
    ...     torque_ratios=(2.0, 1.4, 1.0, 1.0),
    ... )
    >>> [round(torque, 9) for torque in converter.torques(200.0, 0.0)]
    [120.0, 240.0]
    >>> [round(torque, 9) for torque in converter.torques(85.0, 100.0)]
    [-20.0, -20.0]

    A car that drives off with 120 N m; after 3 s its lock-up clutch closes:

    >>> car = pt.Driveline(
    ...     pt.Inertia("engine", J=0.2),
    ...     converter,
    ...     pt.Clutch("lockup", "engine", "turbine", max_torque=400.0),
    ...     pt.Inertia("turbine", J=0.05),
    ...     pt.Gear("gears", "turbine", "axle", ratio=8.0),
    ...     pt.SpringDamper("drive_shafts", "axle", "wheels", stiffness=12e3, damping=150.0),
    ...     pt.Inertia("wheels", J=3.0),
    ...     pt.Tyre("tyres", "wheels", "vehicle", radius=0.3),
    ...     pt.Mass("vehicle", m=1500.0),
    ... )
    >>> inputs = {"engine_torque": 120.0, "lockup_capacity": pt.ramp(3.0, 0.3, 400.0)}
    >>> response = pt.simulate(car, [0.0, 1.0, 3.0, 4.0], inputs, initial_speed={"engine": 80.0})
    >>> response["engine_speed"].round(1), response["turbine_speed"].round(1)
    (array([ 80. , 199.6, 243.1, 261.6]), array([  0. ,  77.7, 208.7, 261.6]))
    >>> [(event.element, event.kind, round(event.time, 2)) for event in response.events]
    [('lockup', 'slip', 3.0), ('lockup', 'lock', 3.14)]
    >>> response.error_estimate["engine_speed"] < 1e-3
    True

    In a file of `load`:

    .. code-block:: toml

        [converter]
        type = "TorqueConverter"
        a = "engine"
        b = "turbine"
        speed_ratios = [0.0, 0.6, 0.85, 1.0]
        capacities = [3e-3, 3e-3, 2e-3, 0.0]
        torque_ratios = [2.0, 1.4, 1.0, 1.0]
    """

    _: KW_ONLY
    speed_ratios: tuple[float, ...] = field(metadata={"array": "-"})
    capacities: tuple[float, ...] = field(metadata={"array": "N m s^2/rad^2"})
    torque_ratios: tuple[float, ...] = field(metadata={"array": "-"})

    def __post_init__(self) -> None:
        super().__post_init__()
        for values, unit in (("speed_ratios", ""), ("capacities", "N m s^2/rad^2"), ("torque_ratios", "")):
            points = checked_points(self.name, values, getattr(self, values), unit, NOT_NEGATIVE)
            object.__setattr__(self, values, points)
        counts = [len(values) for values in (self.speed_ratios, self.capacities, self.torque_ratios)]
        if len(set(counts)) > 1 or counts[0] < 2:
            shown = ", ".join(map(str, counts)) + " values"
            what = "speed_ratios, capacities and torque_ratios"
            raise ParameterError(self.name, what, shown, "", "as many of each, at least two")
        for before, ratio in pairwise(self.speed_ratios):
            if not ratio > before:
                raise ParameterError(self.name, "speed_ratios", ratio, "", f"> {before:g}, the one before")
        for end, wanted, where in ((0, 0.0, "the first one, where the turbine is stalled"), (-1, 1.0, "the last one")):
            if self.speed_ratios[end] != wanted:
                raise ParameterError(self.name, "speed_ratios", self.speed_ratios[end], "", f"{wanted:g}, {where}")
        if self.capacities[-1]:
            permitted = "0 at speed ratio 1, where nothing slips; measured tables end before: add a last point 1, 0"
            raise ParameterError(self.name, "capacities", self.capacities[-1], "N m s^2/rad^2", permitted)
        self._check_power()

    def _check_power(self) -> None:
        points = list(zip(self.speed_ratios, self.torque_ratios, strict=True))
        for (nu, ratio), (nu_next, ratio_next) in pairwise(points):
            slope = (ratio_next - ratio) / (nu_next - nu)
            # along a line that falls the efficiency may be largest in between
            turn = 0.5 * (nu - ratio / slope) if slope else nu
            for at in (nu_next, min(max(turn, nu), nu_next)):
                efficiency = at * (ratio + slope * (at - nu))
                if efficiency > ALL:
                    raise ParameterError(
                        self.name,
                        "torque_ratios",
                        ratio + slope * (at - nu),
                        "",
                        f"at most {1.0 / at:g} at speed ratio {at:g}, an efficiency of 1",
                    )

    def torques(self, pump_speed: float, turbine_speed: float) -> tuple[float, float]:
        """Torques [N m] of the pump, against its motion, and of the turbine, with it, at speeds [rad/s].

        Raises
        ------
        ParameterError
            A pump that turns backwards.
        """
        pump = checked_number(self.name, "pump speed", pump_speed, "rad/s", NOT_NEGATIVE)
        turbine = checked_number(self.name, "turbine speed", turbine_speed, "rad/s", FINITE)
        on_pump, on_turbine = coupled_torques(self.laws, (pump, -turbine))
        return on_pump, on_turbine

    @property
    def regions(self) -> tuple[Region, ...]:
        """Its tables as quadratic forms of the speed of the pump and the negative one of the turbine."""
        points = list(zip(self.speed_ratios, self.capacities, self.torque_ratios, strict=True))
        stall, ratio = self.capacities[0], self.torque_ratios[0]
        regions = [Region(((1.0, 0.0), (0.0, 1.0)), (_form(stall, 0.0, 0.0), _form(ratio * stall, 0.0, 0.0)))]
        overrun = []
        for (nu, capacity, ratio), (nu_next, capacity_next, ratio_next) in pairwise(points):
            on_turbine, by_ratio = (
                (b - a) / (nu_next - nu) for a, b in ((capacity, capacity_next), (ratio, ratio_next))
            )
            on_pump, ratio_at_0 = capacity - on_turbine * nu, ratio - by_ratio * nu
            turbine = (ratio_at_0 * on_pump, ratio_at_0 * on_turbine + by_ratio * on_pump, by_ratio * on_turbine)
            between = ((-nu, -1.0), (nu_next, 1.0))
            regions.append(Region(between, (_form(on_pump, on_turbine, 0.0), _form(*turbine))))
            back = _form(0.0, -on_turbine, -on_pump)
            overrun.append(Region(((1.0, nu), (-1.0, -nu_next)), (back, back)))
        return (*regions, *reversed(overrun))

    @property
    def laws(self) -> tuple[Law, ...]:
        regions, turbine = self.regions, f"{self.name}_turbine"
        mode, cover = {0: Mode("filled", heats=True)}, "a pump that turns forwards"
        return (
            Law(self.name, {self.a: 1.0}, mode, regions=regions, cover=cover),
            Law(turbine, {self.b: -1.0}, mode, element=self.name, regions=regions, cover=cover),
        )

    def linearised(self, point: OperatingPoint) -> tuple[Element, ...]:
        if not {self.a, self.b} <= point.speed.keys():
            raise PowertrainError(
                f"{self.name}: its torques depend on the speeds of pump and turbine; give both, e.g. "
                f'car.at(speed={{"{self.a}": 200.0, "{self.b}": 150.0}}), or lock its lock-up clutch'
            )
        pump, turbine = point.speed[self.a], point.speed[self.b]
        checked_number(self.name, "pump speed", pump, "rad/s", NOT_NEGATIVE)
        if abs(pump - turbine) <= SAME * pump:  # where nothing slips it is a damper
            nu, capacity = self.speed_ratios[-2], self.capacities[-2]
            slope = capacity / (1.0 - nu) * pump
            return (SpringDamper(self.name, self.a, self.b, stiffness=0.0, damping=slope),) if slope else ()
        on_pump, on_turbine = (
            tuple(2.0 * (row[0] * pump - row[1] * turbine) for row in form)
            for form in region_at(self.regions, (pump, -turbine)).forms
        )
        # the slip of the turbine is its negative speed, and so acts its torque
        rows = ((on_pump[0], -on_pump[1]), (-on_turbine[0], on_turbine[1]))
        return (SpeedCoupling(self.name, self.a, self.b, damping=rows),) if any(map(any, rows)) else ()


def _form(pump: float, mixed: float, turbine: float) -> tuple[tuple[float, float], tuple[float, float]]:
    """``pump omega_p^2 + mixed omega_p omega_t + turbine omega_t^2`` on the speed of the pump and the negative turbine's."""
    return ((pump, -0.5 * mixed), (-0.5 * mixed, turbine))


@called
@dataclass(frozen=True)
class SpeedCoupling(TwoEnded):
    """Torques on two nodes that depend on both their speeds: ``T = -damping omega``; a converter for small motion.

    The matrix need not be symmetric, and then no dampers make it: what one node loses the other need not get.

    Parameters
    ----------
    name, a, b : str
        Own name and the two nodes.
    damping : sequence of two sequences of float
        2 x 2 matrix [N m s/rad]: rows the torques on a and b, columns the speeds of a and b.

    Raises
    ------
    ParameterError
        Anything but two rows of two finite numbers.
    PowertrainError
        A name or node that is not an identifier, or the same node at both ends.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.SpeedCoupling("converter", "engine", "turbine", damping=((1.2, -0.3), (-2.0, 0.9))).couplings[0].nodes
    ('engine', 'turbine')
    """

    _: KW_ONLY
    damping: tuple[tuple[float, ...], ...] = field(metadata={"array": "N m s/rad"})

    def __post_init__(self) -> None:
        super().__post_init__()
        what, rows = "two rows of two numbers", self.damping
        if isinstance(rows, str) or not isinstance(rows, Sequence):
            raise ParameterError(self.name, "damping", rows, "N m s/rad", what)
        matrix = tuple(checked_points(self.name, "damping", row, "N m s/rad") for row in rows)
        if [len(row) for row in matrix] != [2, 2]:
            raise ParameterError(self.name, "damping", matrix, "N m s/rad", what)
        object.__setattr__(self, "damping", matrix)

    @property
    def couplings(self) -> tuple[CouplingRow, ...]:
        return (CouplingRow(self.name, self.nodes, self.damping),)
