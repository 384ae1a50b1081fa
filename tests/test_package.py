"""One version everywhere; what a wheel needs is in the package; it says that it is typed."""

import re
import tomllib
from importlib import resources
from pathlib import Path

import pytest

import powertrain_ctrl as pt

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("file", "pattern"),
    [("CITATION.cff", r"^version: (\S+)$"), ("README.md", r"^ *version += \{(\S+)\},$")],
)
def test_who_cites_the_package_cites_its_version(file, pattern):
    text = (ROOT / file).read_text(encoding="utf-8")
    assert re.findall(pattern, text, re.MULTILINE) == [pt.__version__]


def test_the_version_is_written_once_in_the_package():
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert (ROOT / PROJECT["tool"]["hatch"]["version"]["path"]).samefile(pt.__file__)


@pytest.mark.parametrize("file", ["py.typed", "examples/conventional.toml", "examples/source_tables.toml"])
def test_the_package_has_its_files(file):
    assert resources.files(pt).joinpath(file).is_file()


def test_it_says_that_it_is_typed():
    assert "Typing :: Typed" in PROJECT["project"]["classifiers"]
