"""To other tools and back: systems, models and responses as MAT and JSON files; controllers as C (`antijerk.c_source`)."""

from .exchange import json, load, mat

__all__ = ["json", "load", "mat"]
