"""Reference cases of laws by name: parameters, expected values, tolerance."""

import json
from pathlib import Path
from types import SimpleNamespace

_FILE = Path(__file__).parent / "reference" / "laws_cases.json"
_CASES = {case["name"]: case for case in json.loads(_FILE.read_text())["cases"]}


def case(name):
    """Parameters p, expected values e and tolerance of a case."""
    record = _CASES[name]
    values = {key: entry["value"] for key, entry in record["expected"].items()}
    return SimpleNamespace(
        p=SimpleNamespace(**record["parameters"]),
        e=SimpleNamespace(**values),
        tolerance=record["tolerance"],
        values=values,
    )
