"""Drivelines to start from: the source's car and a front-wheel-drive car with published eigenvalues."""

from __future__ import annotations

from pathlib import Path

from ..base.checks import Ratio
from ..base.doors import checked
from ..base.errors import PowertrainError
from ..driveline.collection import Driveline
from ..driveline.files import load

__all__ = ["conventional", "front_wheel_drive", "path"]

CARS = ("conventional", "front_wheel_drive")
_FOLDER = Path(__file__).parent

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
def path(name: str) -> Path:
    """Path of an example's file, to copy and change.

    Parameters
    ----------
    name : {"conventional", "front_wheel_drive"}

    Returns
    -------
    Path

    Raises
    ------
    PowertrainError
        No example of that name.

    Examples
    --------
    >>> import powertrain_ctrl as pt
    >>> pt.examples.path("conventional").name
    'conventional.toml'
    """
    if name not in CARS:
        raise PowertrainError(f'there is no example "{name}", permitted: {", ".join(CARS)}')
    return _FOLDER / f"{name}.toml"
