"""Two-mass control models as records: one state of the clutch, or both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..base.checks import (
    SMALLEST,
    Capacity,
    Damping,
    MomentOfInertia,
    Radius,
    Ratio,
    Share,
    Stiffness,
)
from ..base.doors import checked
from ..base.errors import ParameterError, PowertrainError, suggestion
from ..base.records import Record
from ..base.tables import Listed, Rows, number
from ..base.units import to_hz
from ..driveline.collection import Driveline
from ..elements import Clutch, Compliance, Constraint, Gear, Inertia, Tyre


@checked
@dataclass(frozen=True, kw_only=True)
class TwoMass(Listed, Record):
    """Two inertias, a ratio and a spring with damper: the control model (2.13) or (2.21).

    Wherever a driveline is taken, so is this.

    Parameters
    ----------
    J1, J2 : float
        Driving side [kg m^2], at its own speed; driven side with the vehicle [kg m^2], at wheel speed.
    stiffness, damping : float
        c [N m/rad], d [N m s/rad], on the wheel side.
    ratio : float
        R = driving speed / wheel speed [-].
    radius : float or None
        Vehicle speed / wheel speed [m]; None where there is no vehicle.
    rim_share : float
        Share of the twist that lies behind the wheel sensor, in the tyre; 0 as the source has it.
    driving, wheels, vehicle, shaft : str
        Names of nodes and spring, those of the detailed model.

    Raises
    ------
    ParameterError
        A value outside what is permitted.

    Examples
    --------
    The parameters of Table 2.2:

    >>> import powertrain_ctrl as pt
    >>> pt.TwoMass(J1=0.481, J2=249.0, stiffness=3.44e4, damping=350.0, ratio=18.0, radius=0.35)
    TwoMass: f = 3.015 Hz, zeta = 0.0964
      J1 = 0.481 kg m^2 (engine), J2 = 249 kg m^2 (wheels), ratio = 18, radius = 0.35 m
      stiffness = 34400 N m/rad, damping = 350 N m s/rad (drive_shafts)
    """

    J1: MomentOfInertia
    J2: MomentOfInertia
    stiffness: Stiffness
    damping: Damping
    ratio: Ratio
    radius: Radius | None = None
    rim_share: Share = 0.0
    driving: str = "engine"
    wheels: str = "wheels"
    vehicle: str = "vehicle"
    shaft: str = "drive_shafts"

    @cached_property
    def driveline(self) -> Driveline:
        """Driveline of this model: nodes `driving`, `wheels`, `vehicle` and, with a tyre share, `tread`."""
        driven = self._free("tread") if self.rim_share else self.wheels
        axle = self._free(f"{self.driving}_reflected")
        elements = [
            Inertia(self.driving, J=self.J1),
            Inertia(driven, J=self.J2),
            Gear(self._free("ratio"), self.driving, axle, ratio=self.ratio),
            Compliance(self.shaft, {axle: 1.0, driven: -1.0}, stiffness=self.stiffness, damping=self.damping),
        ]
        if self.radius is not None:
            elements.append(Tyre(self._free("rolling"), driven, self.vehicle, radius=self.radius))
        if self.rim_share == 1.0:
            elements.append(Gear(self._free("rim"), self.wheels, axle, ratio=1.0))
        elif self.rim_share:
            rim = {self.wheels: 1.0, axle: -self.rim_share, driven: self.rim_share - 1.0}
            elements.append(Constraint(self._free("rim"), rim))
        return Driveline(*elements)

    def _free(self, name: str) -> str:
        """The name, with a line below it for each that the detailed model already has given away."""
        while name in (self.driving, self.wheels, self.vehicle, self.shaft):
            name += "_"
        return name

    @checked
    def replace(self, **values: Any) -> TwoMass:
        """Two-mass model with other values, ``model.replace(damping=400.0)``."""
        for name in values:
            if name not in self.__dataclass_fields__:
                raise PowertrainError(f'TwoMass has no parameter "{name}"{suggestion(name, self.__dataclass_fields__)}')
        return replace(self, **values)

    @property
    def compliance_of_inertia(self) -> float:
        """``1 / (J1 R^2) + 1 / J2`` [1/(kg m^2)], at wheel speed."""
        return 1.0 / (self.J1 * self.ratio**2) + 1.0 / self.J2

    @property
    def omega(self) -> float:
        """Undamped natural frequency [rad/s]."""
        return float(np.sqrt(self.stiffness * self.compliance_of_inertia))

    @property
    def frequency_hz(self) -> float:
        """Undamped natural frequency [Hz]."""
        return to_hz(self.omega)

    @property
    def damping_ratio(self) -> float:
        """Damping ratio [-], above 1 where nothing oscillates."""
        return self.damping * self.compliance_of_inertia / (2.0 * self.omega)

    @checked
    def response(self, omega: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Frequency response from driving torque: acceleration of the driven side, speed of the driving side.

        Parameters
        ----------
        omega : (N,) array_like
            [rad/s], > 0.

        Returns
        -------
        acceleration, speed : (N,) ndarray of complex
            [m/s^2 per N m] (rad/s^2 where there is no vehicle), [rad/s per N m].
        """
        if not (np.asarray(omega) >= SMALLEST).all():
            raise ParameterError("two-mass model", "omega", omega, "rad/s", f">= {SMALLEST:g}")
        s = 1j * np.asarray(omega)
        coupling = self.stiffness + self.damping * s
        driving, driven = self.J1 * self.ratio**2, self.J2
        # both masses and the spring at wheel speed
        determinant = s * (driving * driven * s**2 + coupling * (driving + driven))
        acceleration = s * coupling * self.ratio / determinant * (self.radius or 1.0)
        return acceleration, (driven * s**2 + coupling) * self.ratio**2 / determinant

    def listed(self) -> Rows:
        """Frequency, damping ratio and parameters."""
        return [
            ["frequency", number(self.frequency_hz), "Hz"],
            ["zeta", number(self.damping_ratio), "-"],
            [f"J1 ({self.driving})", number(self.J1), "kg m^2"],
            [f"J2 ({self.wheels})", number(self.J2), "kg m^2"],
            [f"stiffness ({self.shaft})", number(self.stiffness), "N m/rad"],
            [f"damping ({self.shaft})", number(self.damping), "N m s/rad"],
            ["ratio", number(self.ratio), "-"],
            *([["radius", number(self.radius), "m"]] if self.radius is not None else []),
        ]

    def __repr__(self) -> str:
        radius = "" if self.radius is None else f", radius = {self.radius:.4g} m"
        rim = f", {100 * self.rim_share:.1f} % of the twist in the tyre" if self.rim_share else ""
        return (
            f"TwoMass: f = {self.frequency_hz:.3f} Hz, zeta = {self.damping_ratio:.4f}\n"
            f"  J1 = {self.J1:.4g} kg m^2 ({self.driving}), J2 = {self.J2:.6g} kg m^2 ({self.wheels}), "
            f"ratio = {self.ratio:.6g}{radius}\n"
            f"  stiffness = {self.stiffness:.6g} N m/rad, damping = {self.damping:.6g} N m s/rad ({self.shaft}){rim}"
        )


@checked
@dataclass(frozen=True, kw_only=True)
class SwitchedTwoMass(Record):
    """The control models of both clutch states as one: (2.21) while the clutch slips, (2.13) once it is stuck.

    While it slips, the engine side of inertia ``closed.J1 - slipping.J1`` turns on its own. At lock and
    at re-slip the state is carried over: twist of the spring and all speeds. The clutch holds while the torque that the
    slipping model takes for that is within its capacity: with another damping the two would else contradict each other.

    Parameters
    ----------
    closed, slipping : TwoMass
        With the same ratio, radius and names on the wheel side.
    max_torque : float
        Capacity of the clutch where no input gives it [N m].
    clutch : str
        Name of the clutch.

    Raises
    ------
    PowertrainError
        Models that differ in ratio, radius or names on the wheel side, of which only one has a tyre share, or that are
        driven at the same node; ``closed.J1`` not above ``slipping.J1``.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> closed = pt.two_mass(pt.examples.conventional(), method="source")
    >>> slipping = pt.two_mass(pt.examples.conventional(damping="open").release("clutch"), method="source")
    >>> pt.launch(pt.SwitchedTwoMass(closed=closed, slipping=slipping)).events[-1].kind
    'lock'
    """

    closed: TwoMass
    slipping: TwoMass
    max_torque: Capacity = 0.0
    clutch: str = "clutch"

    def __post_init__(self) -> None:
        for name in ("ratio", "radius", "wheels", "vehicle", "shaft"):
            mine, other = getattr(self.closed, name), getattr(self.slipping, name)
            same = mine == other if isinstance(mine, str) or mine is None else np.isclose(mine, other, rtol=1e-9)
            if not same:
                raise PowertrainError(f"{name} is {mine} when closed and {other} when slipping, permitted: the same")
        if bool(self.closed.rim_share) != bool(self.slipping.rim_share):
            raise PowertrainError("only one of the two models has a tyre share, permitted: both by the same method")
        if self.closed.driving == self.slipping.driving:
            raise PowertrainError(
                f'both models are driven at "{self.closed.driving}", permitted: engine and input shaft'
            )
        self._engine_inertia()

    def _engine_inertia(self) -> float:
        J = self.closed.J1 - self.slipping.J1
        if not J > 0.0:
            raise PowertrainError(f"closed.J1 - slipping.J1 = {J:g} kg m^2, permitted: > 0, the inertia of the engine")
        return J

    @cached_property
    def driveline(self) -> Driveline:
        """Driveline while the clutch slips; the linear models take its clutch as open."""
        # locked it would have the damping of the slipping model, which is that of neither
        return self._with_clutch(self.slipping).release(self.clutch)

    @cached_property
    def stuck_driveline(self) -> Driveline:
        """Driveline while the clutch is stuck."""
        input_shaft = replace(self.closed, J1=self.slipping.J1, driving=self.slipping.driving)
        return self._with_clutch(input_shaft)

    def _with_clutch(self, behind: TwoMass) -> Driveline:
        engine = Inertia(self.closed.driving, J=self._engine_inertia())
        clutch = Clutch(self.clutch, self.closed.driving, behind.driving, max_torque=self.max_torque)
        return Driveline(engine, *behind.driveline, clutch)
