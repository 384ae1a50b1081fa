"""Cars of each layout with typical values: where to start from, and for the truck the published ratios of its gearbox."""

from __future__ import annotations

from typing import Annotated

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
from ..driveline.files import load
from .files import path

# Ratios of the gears, the first one first [-].
P2_GEARS = (3.92, 2.43, 1.59, 1.12, 0.85, 0.67)
REAR_GEARS = (4.06, 2.40, 1.58, 1.19, 1.00, 0.87)
ALL_GEARS = (4.71, 3.14, 2.11, 1.67, 1.29, 1.00, 0.84, 0.67)
# AT2612D: Volvo Truck Corporation, Service Bulletin group 431, "I-Shift, Generation D", 12.2010.
TRUCK_GEARS = (14.94, 11.73, 9.04, 7.09, 5.54, 4.35, 3.44, 2.70, 2.08, 1.63, 1.27, 1.00)

OfSix = Annotated[int, "", 1, 6]
OfEight = Annotated[int, "", 1, 8]
OfTwelve = Annotated[int, "", 1, 12]


@checked
def electric() -> Driveline:
    """Electric car of the middle class with one gear, driven at one axle. Typical, not published.

    Returns
    -------
    Driveline

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.two_mass(pt.examples.electric())
    TwoMass: f = 7.980 Hz, zeta = 0.0691
      J1 = 0.048 kg m^2 (motor), J2 = 231.099 kg m^2 (wheels), ratio = 9.5, radius = 0.33 m
      stiffness = 10689.3 N m/rad, damping = 29.4735 N m s/rad (drive_shafts), 24.3 % of the twist in the tyre
    """
    return load(path("electric"))


@checked
def p2_hybrid(gear: OfSix = 1, preselected: OfSix | None = None) -> Driveline:
    """P2 hybrid: engine, separation clutch, e-machine and a gearbox with two clutches. Typical, not published.

    The clutch of the gear is locked, that of the pre-selected one is released, for with both nothing could turn; engine and
    e-machine drive together. ``car.release("separation_clutch")`` is the electric drive.

    Parameters
    ----------
    gear : int
        That drives, 1 to 6: the odd ones behind "odd_clutch", the even ones behind "even_clutch".
    preselected : int, optional
        Gear engaged in the other half of the gearbox, even if ``gear`` is odd and odd if it is even; the next higher one
        if not given, below the highest gear the next lower one.

    Returns
    -------
    Driveline

    Raises
    ------
    PowertrainError
        A gear that there is not, or one that is pre-selected in the same half of the gearbox.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.p2_hybrid(gear=2)
    >>> car["even_gear"].ratio, car["odd_gear"].ratio, sorted(car.released)
    (2.43, 1.59, ['odd_clutch'])
    """
    other = (gear + 1 if gear < len(P2_GEARS) else gear - 1) if preselected is None else preselected
    if (gear - other) % 2 == 0:
        raise PowertrainError(
            f"preselected = {other}, permitted with gear = {gear}: {'even' if gear % 2 else 'odd'} gears, in the other half"
        )
    odd, even = (gear, other) if gear % 2 else (other, gear)
    car = load(path("p2_hybrid")).replace({"odd_gear.ratio": P2_GEARS[odd - 1], "even_gear.ratio": P2_GEARS[even - 1]})
    return car.lock().release("even_clutch" if gear % 2 else "odd_clutch")


@checked
def rear_wheel_drive(gear: OfSix = 1) -> Driveline:
    """Rear-wheel-drive car with propshaft, open differential and unequal half-shafts. Typical, not published.

    Parameters
    ----------
    gear : int
        1 to 6.

    Returns
    -------
    Driveline

    Raises
    ------
    ParameterError
        A gear that there is not.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.modes(pt.examples.rear_wheel_drive(gear=3)).frequency_hz[:3].round(2)
    array([ 0.  ,  5.72, 20.95])
    """
    return load(path("rear_wheel_drive")).replace("gearbox", ratio=REAR_GEARS[gear - 1])


@checked
def all_wheel_drive(gear: OfEight = 1) -> Driveline:
    """All-wheel-drive car with an open centre differential, the rear axle behind a propshaft. Typical, not published.

    Parameters
    ----------
    gear : int
        1 to 8.

    Returns
    -------
    Driveline

    Raises
    ------
    ParameterError
        A gear that there is not.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.modes(pt.examples.all_wheel_drive()).frequency_hz[:2].round(2)
    array([0.  , 2.72])
    """
    return load(path("all_wheel_drive")).replace("gearbox", ratio=ALL_GEARS[gear - 1])


@checked
def truck(gear: OfTwelve = 1) -> Driveline:
    """Truck of 18 t with twelve gears. Published are the ratios of its gearbox; all else is typical.

    Ratios: gearbox AT2612D, Volvo Truck Corporation, Service Bulletin group 431, "I-Shift, Generation D", 12.2010.

    Parameters
    ----------
    gear : int
        1 to 12.

    Returns
    -------
    Driveline

    Raises
    ------
    ParameterError
        A gear that there is not.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> [float(pt.modes(pt.examples.truck(gear)).frequency_hz[1].round(2)) for gear in (1, 6, 12)]
    [0.85, 1.98, 6.83]
    """
    return load(path("truck")).replace("gearbox", ratio=TRUCK_GEARS[gear - 1])
