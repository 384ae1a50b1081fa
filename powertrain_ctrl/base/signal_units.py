"""Units of signals, by what their names end in."""

from __future__ import annotations

from collections.abc import Collection

# By suffix: where the node turns, and where it moves along the road.
BY_SUFFIX = {
    "_slip_speed": ("rad/s", "rad/s"),
    "_twist_rate": ("rad/s", "rad/s"),
    "_twist": ("rad", "rad"),
    "_free_speed": ("rad/s", "m/s"),
    "_rigid_speed": ("rad/s", "m/s"),
    "_free_angle": ("rad", "m"),
    "_rigid_angle": ("rad", "m"),
    "_speed": ("rad/s", "m/s"),
    "_acceleration": ("rad/s^2", "m/s^2"),
    "_angle": ("rad", "m"),
    "_torque": ("N m", "N m"),
    "_capacity": ("N m", "N m"),
    "_force": ("N", "N"),
    "_mode": ("1", "1"),
}
# Those of controllers.
BY_NAME = {"torque_demand": "N m", "torque_command": "N m", "torque_limited": "N m", "ratio": "1"}


def unit_of(signal: str, moving: Collection[str]) -> str:
    """Unit of a signal; nothing for a name that says none.

    >>> unit_of("engine_speed", ["vehicle"]), unit_of("vehicle_speed", ["vehicle"]), unit_of("x[0]", [])
    ('rad/s', 'm/s', '')
    """
    if signal in BY_NAME:
        return BY_NAME[signal]
    for suffix, (turning, along) in BY_SUFFIX.items():
        if signal.endswith(suffix):
            return along if signal.removesuffix(suffix) in moving else turning
    return ""


def moving_nodes(signals: Collection[str], moving: Collection[str]) -> set[str]:
    """Nodes that move along the road: those told, and those on which a force acts."""
    return {*moving, *(name.removesuffix("_force") for name in signals if name.endswith("_force"))}
