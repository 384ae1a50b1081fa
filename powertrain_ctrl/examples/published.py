"""Drivelines whose parameters and frequencies are published."""

from __future__ import annotations

from ..base.checks import Ratio
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
from ..driveline.files import load
from .files import path

# Shaft dampings d [N m s/rad] and tyre damping [N s/m]. The source gives none. Both sets are chosen so that the peak of
# the first mode is that of the source's control models: "closed" of Table 2.2, "open" of Table 2.3. No single set of
# viscous dampers gives both.
DAMPING = {
    None: {},
    "closed": {
        "damper_spring": 1.46,
        "clutch_shaft": 0.5,
        "input_shaft": 10.0,
        "output_shaft": 10.0,
        "drive_shafts": 417.6,
        "tyres": 11897.0,
    },
    "open": {
        "damper_spring": 1.46,
        "clutch_shaft": 0.5,
        "input_shaft": 10.0,
        "output_shaft": 10.0,
        "drive_shafts": 60.2,
        "tyres": 1715.0,
    },
}


@checked
def conventional(gear_ratio: Ratio = 6.0, damping: str | None = "closed") -> Driveline:
    """Conventional powertrain of the source, Table 2.1, in its physical, unreflected parameters.

    The table's "left and right" rows are taken as totals of both sides: J6 = 4 kg m^2, c5 = 3.44e4 N m/rad. Only
    then do the printed frequencies (2.12), (2.20) and J2 = 249 kg m^2 of Table 2.2 come out; doubled
    as (2.4) reads literally, the first frequency is 3.35 Hz instead of the printed 2.6 Hz.

    Parameters
    ----------
    gear_ratio : float
        Ratio of the gearbox [-], not 0; 6 is first gear.
    damping : {"closed", "open", None}
        Which of the two damping sets; None is undamped. The source gives no damping for this model.

    Returns
    -------
    Driveline

    Raises
    ------
    PowertrainError
        A damping set that is not known, or a ratio that is not permitted.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> car = pt.examples.conventional(gear_ratio=3.6)
    >>> car["gearbox"].ratio, car["wheels"].J
    (3.6, 4.0)
    """
    if damping not in DAMPING:
        raise PowertrainError(f'damping set {damping!r} is not known, permitted: "closed", "open" or None')
    car = load(path("conventional")).replace("gearbox", ratio=gear_ratio)
    for name in DAMPING["closed"]:
        car = car.replace(name, damping=DAMPING[damping].get(name, 0.0))
    return car


@checked
def front_wheel_drive() -> Driveline:
    """Front-wheel-drive car with published eigenvalues, in second gear; its tyre is a damper alone.

    The tyre's force grows with its slip, so at a given speed it is a damper between wheels and vehicle; here at 4.96 m/s.
    Without it the vehicle is not connected, so `modes`, which are undamped, show two rigid motions; the shuffle is
    among the `poles`. ``car.replace("tyres", stiffness=None, damping=0.0)`` lets the tyre roll rigidly.

    Parameters and published eigenvalues: B. Mason, course notes TTC066, Loughborough University, section 7.

    Returns
    -------
    Driveline

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> round(float(pt.poles(pt.examples.front_wheel_drive()).imag.max()), 1)
    366.4
    """
    return load(path("front_wheel_drive"))


@checked
def wind_turbine() -> Driveline:
    """Drive train of the reference wind turbine of 5 MW: generator, gearbox, shaft, rotor. All published.

    The shaft free at both ends swings at 2.22 Hz with a damping ratio of 5 %. Wind drives the rotor, control acts at the
    generator, which is the first node.

    Parameters, frequency and damping ratio: J. Jonkman, S. Butterfield, W. Musial, G. Scott, "Definition of a 5-MW Reference
    Wind Turbine for Offshore System Development", NREL/TP-500-38060, 2009, section 5.

    Returns
    -------
    Driveline

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> modes = pt.modes(pt.examples.wind_turbine())
    >>> modes.frequency_hz.round(2), modes.damping_ratio.round(2)
    (array([0.  , 2.22]), array([ nan, 0.05]))
    """
    return load(path("wind_turbine"))


@checked
def marine() -> Driveline:
    """Marine train of two steam turbines that drive one propeller through a double reduction. All published.

    Its first three frequencies are 177.7, 220.2 and 1282.6 cycles a minute; the book damps turbines and propeller alone.

    Parameters and frequencies: E. J. Gunter, W. J. Chen, "Introduction to Dynamics of Rotor-Bearing Systems" (2001),
    example 8.1.

    Returns
    -------
    Driveline

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> (60.0 * pt.modes(pt.examples.marine()).frequency_hz[1:4]).round(1)
    array([ 177.7,  220.2, 1282.6])
    """
    return load(path("marine"))
