"""The README is short and tells of all its sections; the index of the source names all of it, and its expressions run."""

import ast
import importlib.util
import re
from pathlib import Path

import pytest

import powertrain_ctrl as pt

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = {path: path.read_text(encoding="utf-8") for path in (ROOT / "docs").rglob("*.md")}
SOURCE = PAGES[ROOT / "docs" / "source.md"]
INDEX = SOURCE.split("## Where the source's equations, tables and figures are")[1].split("\n## ")[0]
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
    shown = {ROOT / "docs" / f"{name}.svg" for name in drawn}
    assert set((ROOT / "docs").glob("*.svg")) == shown
    assert {path.resolve() for page, link in links() if (path := page.parent / link).suffix == ".svg"} == shown


def links():
    """Page and target of every link in the README and the pages of the site."""
    for page, text in {ROOT / "README.md": README, **PAGES}.items():
        for link in re.findall(r"\]\(([^)\s]+)\)", text):
            yield page, link


@pytest.mark.parametrize(("page", "link"), list(links()), ids=lambda value: getattr(value, "stem", value))
def test_links_within_the_repository_lead_somewhere(page, link):
    file, _, heading = link.partition("#")
    if not file.startswith("http"):
        target = page.parent / file if file else page
        assert target.exists()
        assert not heading or heading in headings(target.read_text(encoding="utf-8"))


def headings(text):
    """Headings as links name them."""
    return [re.sub(r"[^\w -]", "", title).strip().lower().replace(" ", "-") for title in titles(text)]


def titles(text):
    return re.findall(r"^#+ (.+)$", re.sub(r"^```.*?^```", "", text, flags=re.MULTILINE | re.DOTALL), re.MULTILINE)


def test_the_readme_is_read_in_one_sitting_and_says_what_is_in_it():
    assert len(README.split()) < 1500
    contents, sections = README.split("\n## ")[0], re.findall(r"^## .+$", README, re.MULTILINE)
    assert re.findall(r"\]\(#([\w-]+)\)", contents) == [
        name for name in headings("\n".join(sections)) if name != "licence"
    ]
