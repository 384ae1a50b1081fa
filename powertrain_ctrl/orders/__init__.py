"""What an engine does to a driveline: its orders, the response to them, and the speeds at which they meet a mode.

Limits: the inertia of the crank train is its mean (no parametric excitation), pendulums swing little, motion is steady.
"""

from ..base.errors import absent
from .pressure import wiebe

__all__ = ["wiebe"]

__getattr__ = absent(__name__, __all__)
