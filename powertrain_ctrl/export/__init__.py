"""To other tools and back: systems, models and responses as MAT and JSON files; drivelines as C and FMU; controllers as C
(`antijerk.c_source`)."""

from ..base.errors import absent
from .c_model import c_plant
from .exchange import json, load, mat
from .fmi import fmu

__all__ = ["c_plant", "fmu", "json", "load", "mat"]

__getattr__ = absent(__name__, __all__)
