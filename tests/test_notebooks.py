"""Notebooks run from top to bottom, use only public names and are committed without outputs."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import nbformat
import pytest

import powertrain_ctrl as pt

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
# Seconds for any one cell; the slowest takes two.
CELL_TIMEOUT = 60
OTHER_PACKAGES = {"control", "numpy", "matplotlib", "ipywidgets", "IPython"}

each_notebook = pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)


def cells(path, kind):
    return [cell for cell in nbformat.read(path, as_version=4).cells if cell.cell_type == kind]


def syntax(path):
    for cell in cells(path, "code"):
        yield from ast.walk(ast.parse(cell.source))


def dotted(node):
    """("pt", "plots", "bode") of an attribute access, or () where it does not start with a name."""
    names = []
    while isinstance(node, ast.Attribute):
        names.append(node.attr)
        node = node.value
    return (node.id, *reversed(names)) if isinstance(node, ast.Name) else ()


def test_every_notebook_is_there():
    assert [path.stem[:2] for path in NOTEBOOKS] == ["01", "02", "03", "04", "05", "06", "07", "08", "09"]


@pytest.fixture(scope="module")
def run():
    """All notebooks, each with a kernel of its own."""
    # In a process of its own: without the filters of these tests, and with figures drawn as Jupyter draws them.
    settings = {key: value for key, value in os.environ.items() if key != "MPLBACKEND"}
    settings["PYTHONPATH"] = os.pathsep.join([str(ROOT), settings.get("PYTHONPATH", "")])
    command = [sys.executable, "-m", "pytest", "--nbmake", f"--nbmake-timeout={CELL_TIMEOUT}", "-v"]
    options = ["-p", "no:cacheprovider", "-c", os.devnull, f"--rootdir={ROOT}", *map(str, NOTEBOOKS)]
    return subprocess.run([*command, *options], env=settings, cwd=ROOT / "notebooks", capture_output=True, text=True)


@pytest.mark.campaign
@each_notebook
def test_notebook_runs(path, run):
    assert f"{path.name}::{path.name} PASSED" in run.stdout, run.stdout + run.stderr


@each_notebook
def test_notebook_is_committed_without_outputs(path):
    for cell in cells(path, "code"):
        assert not cell.outputs
        assert cell.execution_count is None


@each_notebook
def test_notebook_uses_only_public_names(path):
    for node in syntax(path):
        if isinstance(node, ast.Import):
            for alias in node.names:
                root, *rest = alias.name.split(".")
                if root == "powertrain_ctrl":
                    assert (rest, alias.asname) == ([], "pt"), alias.name
                else:
                    assert root in OTHER_PACKAGES | sys.stdlib_module_names, alias.name
        elif isinstance(node, ast.ImportFrom):
            assert node.module.split(".")[0] in OTHER_PACKAGES | sys.stdlib_module_names, node.module
        elif isinstance(node, ast.Attribute):
            assert not node.attr.startswith("_"), f".{node.attr}"
            name = dotted(node)
            if name[:1] == ("pt",):
                assert name[1] in pt.__all__, ".".join(name)
                known = getattr(getattr(pt, name[1]), "__all__", None)
                assert len(name) < 3 or known is None or name[2] in known, ".".join(name)


@each_notebook
def test_notebook_begins_with_its_story_and_explains_every_figure(path):
    first = nbformat.read(path, as_version=4).cells[0]
    assert first.cell_type == "markdown"
    assert first.source.startswith("# ")
    assert len(cells(path, "markdown")) >= len(cells(path, "code")) // 2
