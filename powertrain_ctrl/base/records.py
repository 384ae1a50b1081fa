"""Frozen records that stay as they are, in copies and in other processes too."""

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from .errors import no_attribute


def read_only(value: Any) -> Any:
    """The value, an array or a dict of them, with arrays that cannot be written to; whoever made an array still can."""
    if isinstance(value, np.ndarray):
        if not value.flags.writeable:
            return value
        view = value.view()
        view.flags.writeable = False
        return view
    return {key: read_only(item) for key, item in value.items()} if type(value) is dict else value


class Hinted:
    """Base of what says where to look for an attribute that it does not have."""

    if not TYPE_CHECKING:  # to a type checker what is not there is not there

        def __getattr__(self, name: str) -> Any:
            if hasattr(type(self), name):  # a property, and something else was not there
                return object.__getattribute__(self, name)
            named = None if name.startswith("_") else getattr(type(self), "keys", None)
            raise no_attribute(self, name, () if named is None or not vars(self) else named(self))


class Record(Hinted):
    """Base of frozen dataclasses that hold arrays or keep what they have computed.

    Their arrays are read-only. A copy is made of the fields alone: numpy makes arrays of copies writeable, so they are
    closed again, and what cached properties keep is computed again where it is asked for.
    """

    def __post_init__(self) -> None:
        state = vars(self)
        for name, value in state.items():
            if isinstance(value, np.ndarray | dict):
                state[name] = read_only(value)

    def __getstate__(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in fields(self)}  # type: ignore[arg-type]

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(read_only(state))
