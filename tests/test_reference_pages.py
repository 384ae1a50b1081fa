"""Every public name has its entry in the reference of the site, once."""

import re
from collections import Counter
from pathlib import Path

import pytest

import powertrain_ctrl as pt

ROOT = Path(__file__).parents[1] / "docs" / "reference"
MODULES = [name for name in pt.__all__ if type(getattr(pt, name)).__name__ == "module"]
PUBLIC = [f"pt.{name}" for name in pt.__all__]
PUBLIC += [f"pt.{module}.{name}" for module in MODULES for name in getattr(pt, module).__all__]


def entries():
    """Full names of what the pages document."""
    for page in sorted(ROOT.glob("*.rst")):
        module = ""
        for kind, name in re.findall(
            r"^\.\. (currentmodule|auto\w+):: (\S+)", page.read_text(encoding="utf-8"), re.MULTILINE
        ):
            if kind == "currentmodule":
                module = name
            else:
                yield name if kind == "automodule" else f"{module}.{name}"


def found(name):
    value = pt
    for part in name.split(".")[1:]:
        value = getattr(value, part)
    return value


ENTRIES = list(entries())


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_name_is_in_the_reference(name):
    value = found(name)
    # what is public in two places has one entry
    assert any(found(entry) is value for entry in ENTRIES), f"an entry for {name} in docs/reference/*.rst is missing"


def test_every_entry_is_public_and_there_once():
    values = [id(found(name)) for name in PUBLIC]
    assert [entry for entry in ENTRIES if id(found(entry)) not in values] == []
    assert [entry for entry, count in Counter(ENTRIES).items() if count > 1] == []


def test_every_page_is_in_the_contents():
    contents = (ROOT / "index.md").read_text(encoding="utf-8")
    assert {page.stem for page in ROOT.glob("*.rst")} == set(re.findall(r"^(\w+)$", contents, re.MULTILINE))
