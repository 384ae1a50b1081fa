"""Sections of a report. Each is one function of the `Subject` that returns a `Section`, or None where it does not apply.

What does not apply to a driveline for a reason says so in its section instead of failing.
"""

from .antijerk import antijerk_section
from .comparing import comparison_section
from .launching import launch_section
from .linear import (
    as_in_file_section,
    bode_section,
    closed_clutch_section,
    control_model_section,
    elements_section,
    load_change_section,
    open_clutch_section,
)
from .subject import Picture, Section, Subject, Table

SECTIONS = (
    elements_section,
    closed_clutch_section,
    as_in_file_section,
    open_clutch_section,
    control_model_section,
    load_change_section,
    bode_section,
    comparison_section,
    launch_section,
    antijerk_section,
)

__all__ = ["SECTIONS", "Picture", "Section", "Subject", "Table"]
