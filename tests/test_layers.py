"""Imports only point up the list of layers, by package and by file, and the light part stays light."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import powertrain_ctrl

PACKAGE = Path(powertrain_ctrl.__file__).parent
# The way of a car through the house, and the files of each room from the first to the last that is needed.
LAYERS = {
    "base": [
        ["errors", "tables", "signal_units"],
        ["records"],
        ["checks", "paths", "systems"],
        ["kinds"],
        ["doors"],
        ["units"],
    ],
    "elements": [
        ["laws"],
        ["element"],
        ["frictions"],
        ["bodies", "springs", "gears", "combinations", "differentials"],
        ["tyres", "clutches", "backlash", "stages", "road", "sources", "pendulums", "converters"],
    ],
    "driveline": [
        ["kinematics", "toml", "opentorsion", "consistency"],
        ["static", "standing"],
        ["operating"],
        ["collection"],
        ["ends", "files"],
    ],
    "examples": [["files"], ["published", "typical"]],
    "linear": [
        ["condensing", "leaves", "mass", "solved", "stepping", "admissible"],
        ["couplings"],
        ["assembly", "impedance", "sensitivity", "lowest"],
        ["energy", "links", "outputs", "quadratic", "separation"],
        ["modal", "steady", "oscillator"],
        ["reflection", "stability", "forced", "spectrum"],
        ["statespace", "describing", "schur"],
    ],
    "reduction": [["twomass"], ["halves", "balanced"], ["condensed"], ["comparison"]],
    "hybrid": [
        ["signals", "flow", "bandpass"],
        ["harmonics"],
        ["matrices"],
        ["loads", "groups", "segment"],
        ["plant", "lookout"],
        ["motion"],
        ["sticking", "model", "response", "trace", "collocation"],
        ["run", "continuous"],
        ["starts", "steps"],
        ["simulation", "discrete"],
        ["manoeuvres", "nonlinear", "plans"],
        ["shifting", "cranking"],
        ["metrics"],
    ],
    "sampled": [
        ["actuator", "sensors"],
        ["plant"],
        ["files", "controller", "arrivals", "fold", "loopmodes"],
        ["cores", "directed", "unit"],
        ["engaged"],
        ["loop", "rate_limit"],
        ["margins"],
        ["driving"],
        ["manoeuvres"],
    ],
    "families": [
        ["variants", "executors"],
        ["failures"],
        ["structure", "results", "parts"],
        ["chains", "evaluation"],
        ["frequencies"],
        ["eigenvalues", "responses"],
        ["unlimited", "reductions", "impedances", "launches"],
        ["loops"],
        ["collection"],
        ["making"],
        ["sampling"],
    ],
    "identification": [
        ["columns", "measured", "unknowns", "motion", "decay", "separable", "identified"],
        ["runs", "tracking", "channels"],
        ["prediction", "noise"],
        ["descent"],
        ["fitting"],
        ["advice"],
        ["output_error"],
    ],
    "export": [
        ["c_unit", "files", "adjustable", "compilers"],
        ["c_code", "plain", "kernel"],
        ["exchange", "c_tables", "description"],
        ["c_model"],
        ["fmi"],
    ],
    "studies": [["tolerances", "indices", "times"], ["trials"], ["courses", "proof"], ["requirements"]],
    "antijerk": [
        ["parts", "scales"],
        ["feedback", "feedforward", "optimal", "robust", "structure", "candidates"],
        ["families", "rises", "shaping"],
        ["search"],
        ["tuning"],
        ["catalogue"],
    ],
    "orders": [["crank", "firing", "waves", "runup"], ["pressure"], ["gas"], ["engine"], ["response"], ["critical"]],
    "plots": [
        ["style"],
        [
            "antijerk",
            "characteristics",
            "comparisons",
            "families",
            "excitation",
            "launches",
            "loops",
            "responses",
            "proof",
            "schematics",
            "shapes",
            "identified",
            "tuned",
        ],
    ],
    "notebook": [["explorer", "pictures"], ["sliders"]],
    "report": [
        ["subject"],
        ["frequencies", "folder", "origin", "progress", "required", "verdict"],
        ["linear", "driven_end"],
        ["comparing", "launching", "excitation", "antijerk", "play", "measured"],
        ["numbering", "drawings", "drawn"],
        ["markdown", "webpage"],
        ["page"],
    ],
    "cli": [],
    "__main__": [],
}
ROOMS = list(LAYERS)
FLOOR = {room: {file: i for i, floor in enumerate(floors) for file in floor} for room, floors in LAYERS.items()}
TESTS = Path(__file__).parent
DOCSTRINGS = [ast.get_docstring(ast.parse(path.read_text())) or "" for path in TESTS.glob("test_*.py")]
NAMED = {name for text in DOCSTRINGS for name in re.findall(r"[a-z_]+/[a-z_]+|__main__", text)}
FILES = sorted(p.relative_to(PACKAGE).with_suffix("").parts for p in PACKAGE.rglob("*.py"))


def imports(parts):
    """(room, file or None) of this package that a file imports, () for the package itself."""
    path = PACKAGE.joinpath(*parts).with_suffix(".py")
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names]
            absolute = not getattr(node, "level", 0) and any(n.split(".")[0] == "powertrain_ctrl" for n in names)
            assert not absolute, f"{path}: imports of this package are relative, so that its layer is seen"
        if isinstance(node, ast.ImportFrom) and node.level:
            here = list(parts[: len(parts) - node.level])
            target = here + (node.module.split(".") if node.module else [])
            for alias in node.names:
                whole = [*target, alias.name]
                is_module = (PACKAGE.joinpath(*whole).with_suffix(".py")).exists() or PACKAGE.joinpath(*whole).is_dir()
                found = tuple(whole if is_module else target)
                if found:
                    yield found
                else:
                    assert alias.name == "__version__", f"{path}: imports {alias.name} from the package itself"


@pytest.mark.parametrize("parts", FILES, ids="/".join)
def test_imports_only_point_up_the_layers(parts):
    if parts == ("__init__",):
        return
    room, file = (parts[0], parts[1]) if len(parts) == 2 else (parts[0], "__init__")
    assert room in LAYERS, f"{room} has no layer"
    assert file == "__init__" or file in FLOOR[room], f"{room}/{file} has no layer"
    for other, *rest in imports(parts):
        assert other in LAYERS, f"{other} has no layer"
        if other != room:
            assert ROOMS.index(other) < ROOMS.index(room), f"{room}/{file} imports {other}"
        elif file != "__init__" and rest:
            assert FLOOR[room][rest[0]] < FLOOR[room][file], f"{room}/{file} imports {room}/{rest[0]}"
        else:
            assert file == "__init__", f"{room}/{file} imports the room that it is in"


def test_every_file_of_a_layer_is_there():
    assert {(room, file) for room, floor in FLOOR.items() for file in floor} <= set(FILES)
    assert {(room, "__init__") for room, floor in FLOOR.items() if floor} <= set(FILES)


def test_what_is_found_for_cars_is_kept_in_one_way():
    named = {path.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py") if "lru_cache" in path.read_text()}
    by_modes_and_states = {"hybrid/plant.py", "hybrid/discrete.py"}
    by_spacing_of_samples = {"hybrid/bandpass.py"}
    by_unknowns, by_ratios = {"identification/prediction.py"}, {"driveline/kinematics.py"}
    assert named - by_modes_and_states - by_spacing_of_samples - by_unknowns - by_ratios == {"linear/assembly.py"}


@pytest.mark.parametrize("parts", [parts for parts in FILES if parts[-1] != "__init__"], ids="/".join)
def test_every_file_has_its_tests(parts):
    """In a test file of its name, or in one whose docstring says that it is of this file."""
    twin = TESTS / f"test_{parts[-1]}.py"
    assert twin.exists() or "/".join(parts) in NAMED


def run(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_modes_need_neither_control_nor_pyplot():
    code = (
        "import sys, powertrain_ctrl as pt\n"
        "pt.modes(pt.examples.conventional()); pt.launch(pt.examples.conventional())\n"
        "print([m for m in sys.modules if m.split('.')[0] in ('control', 'matplotlib', 'slycot') or m == 'scipy.optimize'])"
    )
    assert run(code).strip() == "[]"


def test_every_public_name_is_there_and_documented():
    for name in powertrain_ctrl.__all__:
        assert getattr(powertrain_ctrl, name).__doc__, name


def functions_of(module):
    return {name for name in module.__all__ if callable(getattr(module, name))}


def test_no_module_has_the_name_of_an_exported_function():
    modules = {part for parts in FILES for part in parts}
    assert not modules & functions_of(powertrain_ctrl)
    for room in ("antijerk", "export", "plots", "studies"):
        assert not set(FLOOR[room]) & functions_of(getattr(powertrain_ctrl, room)), room


def test_type_checkers_are_told_that_the_package_has_types():
    assert (PACKAGE / "py.typed").read_bytes() == b""
