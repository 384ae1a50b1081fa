"""Sliders for the values of any car, and modes, gain and response that follow."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from ..base.doors import checked
from ..base.errors import PowertrainError
from ..base.tables import number
from ..driveline.collection import Driveline, HasDriveline, require_parameter
from ..linear.assembly import as_driveline
from .explorer import Explorer, sliding

if TYPE_CHECKING:
    import ipywidgets

# So many sliders unless they are named; each goes from the value over this number to the value times it.
COUNT, SPAN = 6, 3.0


@checked
def explore(car: HasDriveline, values: Sequence[str] = ()) -> ipywidgets.Widget:
    """Sliders for values of a car, with its first mode, gain and load change, which follow in well under 100 ms.

    Parameters
    ----------
    car : Driveline or TwoMass
        With an engine and a vehicle; clutches stay as they are.
    values : sequence of str
        What to change, such as ``"drive_shafts.stiffness"``; those on which the first mode depends most if not given.

    Returns
    -------
    ipywidgets.Widget
        To be shown as the last line of a cell.

    Raises
    ------
    PowertrainError
        Without ipywidgets, which the extra ``notebook`` brings; a driveline without vehicle, or without an elastic mode; a
        value that is not a number other than 0.
    UnknownNameError
        An element or a parameter that is not there.

    Examples
    --------
    ``pt.explore(car)`` as the last line of a cell shows the sliders. What they are for is checked first:

    >>> import powertrain_ctrl as pt
    >>> pt.explore(pt.examples.conventional(), ["vehicle.mass"])
    Traceback (most recent call last):
    ...
    powertrain_ctrl.base.errors.PowertrainError: vehicle has no parameter "mass"; did you mean "m"?
    """
    given = as_driveline(car)
    chosen = {name: _value(given, name) for name in values or sliding(given, COUNT)}
    explorer = Explorer(given)
    try:
        import ipywidgets
    except ImportError as error:
        raise PowertrainError('explore needs ipywidgets: pip install "powertrain-ctrl[notebook]"') from error
    sliders = {name: _slider(ipywidgets, name, value) for name, value in chosen.items()}
    picture = ipywidgets.HTML()

    def redraw(_: Any = None) -> None:
        picture.value = drawn(explorer, given, {name: slider.value for name, slider in sliders.items()})

    redraw()
    for slider in sliders.values():
        slider.observe(redraw, "value")
    return ipywidgets.VBox([ipywidgets.Box([*sliders.values()], layout={"flex_flow": "row wrap"}), picture])


def drawn(explorer: Explorer, car: Driveline, values: dict[str, float]) -> str:
    """The car with these values as a picture in HTML, with its numbers in words; or why there is none."""
    try:
        curves = explorer.curves(car.replace(values) if values else car)
    except PowertrainError as error:
        return f"<p>{escape(str(error))}</p>"
    data = base64.b64encode(explorer.png(curves)).decode()
    label = ", ".join([curves.text, *(f"{name} {number(value)}" for name, value in values.items())])
    return f'<img alt="{escape(label)}" style="width: 100%; max-width: 70rem" src="data:image/png;base64,{data}">'


def _value(car: Driveline, name: str) -> float:
    element, dot, parameter = name.partition(".")
    if not dot:
        raise PowertrainError(
            f'"{name}" is not a value, permitted: "element.parameter", such as "drive_shafts.stiffness"'
        )
    require_parameter(car[element], parameter)
    value = getattr(car[element], parameter)
    if not isinstance(value, int | float) or isinstance(value, bool) or not value:
        raise PowertrainError(f"{name} is {value!r}, permitted: a number that is not 0")
    return float(value)


def _slider(ipywidgets: Any, name: str, value: float) -> Any:
    """From a third of the value to three times it."""
    low, high = sorted((value / SPAN, value * SPAN))
    return ipywidgets.FloatSlider(
        value=value,
        min=low,
        max=high,
        step=(high - low) / 400.0,
        description=name,
        readout_format=".4g",
        style={"description_width": "initial"},
        layout={"width": "24rem"},
    )
