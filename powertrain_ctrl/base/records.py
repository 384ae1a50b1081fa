"""Frozen records that stay as they are, in copies and in other processes too."""

from dataclasses import fields
from typing import Any

import numpy as np


def read_only(value: Any) -> Any:
    """The value, an array or a dict of them, with arrays that cannot be written to; whoever made an array still can."""
    if isinstance(value, np.ndarray):
        if not value.flags.writeable:
            return value
        view = value.view()
        view.flags.writeable = False
        return view
    return {key: read_only(item) for key, item in value.items()} if type(value) is dict else value


class Record:
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
