"""The README's index names all of the source and its expressions run; its figures are those that the script draws."""

import ast
import importlib.util
import re
from pathlib import Path

import pytest

import powertrain_ctrl as pt

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
INDEX = README.split("## Where the source's equations, tables and figures are")[1].split("\n## ")[0]
ROWS = [
    line.split("|")[1:4] for line in INDEX.splitlines() if line.startswith("| ") and not line.startswith("| source")
]


def numbers(text, what):
    """Numbers x of "what 2.x" in a text, ranges "2.a to 2.b" and lists included."""
    found = set()
    for group in re.findall(what, text):
        for first, last in re.findall(r"2\.(\d+)\)?(?: to \(?2\.(\d+))?", group):
            found |= set(range(int(first), int(last or first) + 1))
    return found


@pytest.mark.parametrize(
    ("pattern", "expected"),
    [
        (r"\(2\.\d+\)(?:(?: to |, )\(2\.\d+\))*", range(1, 23)),
        (r"Tables? 2\.\d(?:, 2\.\d)*", range(1, 4)),
        (r"Figs?\. 2\.\d+(?:, 2\.\d+)*", range(5, 14)),
    ],
    ids=["equations", "tables", "figures"],
)
def test_the_index_names_everything_of_the_source(pattern, expected):
    assert numbers(" ".join(row[0] for row in ROWS), pattern) == set(expected)


def expressions():
    for row in ROWS:
        for text in re.findall(r"`([^`]+)`", row[1]):
            if text.startswith(("pt.", "car.")) and "..." not in text:
                yield text


@pytest.mark.parametrize("text", list(expressions()))
def test_expressions_of_the_index_run(text):
    car = pt.examples.conventional()
    names = {"pt": pt, "car": car, "launching": car.release("clutch").part("vehicle")}
    ast.parse(text, mode="eval")
    assert eval(text, names) is not None


@pytest.mark.parametrize("row", ROWS, ids=[row[0].strip()[:40] for row in ROWS])
def test_every_row_of_the_index_names_notebooks_that_are_there(row):
    there = {path.stem[:2] for path in (ROOT / "notebooks").glob("*.ipynb")}
    assert set(row[2].replace(" ", "").split(",")) <= there


def test_figures_are_those_that_the_script_draws():
    spec = importlib.util.spec_from_file_location("make_figures", ROOT / "docs" / "make_figures.py")
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    drawn = {draw.__name__ for draw in script.FIGURES}
    assert {path.stem for path in (ROOT / "docs").glob("*.svg")} == drawn
    assert set(re.findall(r"\(docs/(\w+)\.svg\)", README)) == drawn


def test_links_within_the_repository_lead_somewhere():
    titles = [line.lstrip("# ").lower() for line in README.splitlines() if line.startswith("#")]
    headings = {re.sub(r"[^\w -]", "", title).replace(" ", "-") for title in titles}
    for link in re.findall(r"\]\(([^)]+)\)", README):
        if link.startswith("#"):
            assert link[1:] in headings, link
        elif not link.startswith("http"):
            assert (ROOT / link).exists(), link
