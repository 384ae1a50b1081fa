"""Imports only point up the list of layers, and the light part stays light."""

import ast
import subprocess
import sys
from pathlib import Path

import powertrain_ctrl

PACKAGE = Path(powertrain_ctrl.__file__).parent
LAYERS = [
    ["errors", "tables", "records", "systems"],
    ["checks"],
    ["kinds"],
    ["doors"],
    ["units", "rows", "kinematics"],
    ["elements"],
    ["driveline"],
    ["files"],
    ["examples"],
    ["assembly"],
    ["outputs", "propagation", "signals", "quadratic", "separation"],
    ["modal"],
    ["twomass", "reflection", "stability"],
    ["statespace", "cut", "condensation", "motion"],
    ["sticking", "plants", "response", "reduction"],
    ["hybrid"],
    ["simulation"],
    ["nonlinear", "manoeuvres", "comparison"],
    ["sampled"],
    ["stepping", "loopmodes"],
    ["metrics", "loops", "driveaway", "antijerk"],
    ["studies"],
    ["plots"],
    ["sections"],
    ["report"],
    ["cli"],
    ["__main__"],
]
RANK = {name: i for i, layer in enumerate(LAYERS) for name in layer}


def imports(path, depth):
    """Modules of this package that a file imports, first name only."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else [alias.name for alias in node.names]
            absolute = not getattr(node, "level", 0) and any(n.split(".")[0] == "powertrain_ctrl" for n in names)
            assert not absolute, f"{path}: imports of this package are relative, so that its layer is seen"
        if isinstance(node, ast.ImportFrom) and node.level == depth:
            if node.module:
                yield node.module.split(".")[0]
            else:
                yield from (alias.name for alias in node.names)


def test_imports_only_point_up_the_layers():
    files = [(p, p.stem, 1) for p in PACKAGE.glob("*.py") if p.stem != "__init__"]
    files += [(p, p.parent.name, 2) for p in PACKAGE.glob("*/*.py")]
    for path, module, depth in files:
        assert module in RANK, f"{module} has no layer"
        for other in imports(path, depth):
            if other == "__version__":
                continue
            if (module, other) == ("driveline", "files"):
                continue  # Driveline.save, the one call that points down, inside the method
            assert RANK[other] <= RANK[module], f"{module} imports {other}"


def run(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout


def test_modes_need_neither_control_nor_pyplot():
    code = (
        "import sys, powertrain_ctrl as pt\n"
        "pt.modes(pt.examples.conventional()); pt.launch(pt.examples.conventional())\n"
        "print([m for m in sys.modules if m.split('.')[0] in ('control', 'matplotlib', 'slycot')])"
    )
    assert run(code).strip() == "[]"


def test_every_public_name_is_there_and_documented():
    for name in powertrain_ctrl.__all__:
        assert getattr(powertrain_ctrl, name).__doc__, name


def test_no_module_has_the_name_of_an_exported_function():
    modules = {p.stem for p in PACKAGE.glob("*.py")}
    functions = {n for n in powertrain_ctrl.__all__ if callable(getattr(powertrain_ctrl, n))}
    assert not modules & functions


def test_no_two_modules_need_each_other():
    needs = {p.stem: set(imports(p, 1)) & RANK.keys() for p in PACKAGE.glob("*.py") if p.stem != "__init__"}
    needs["driveline"].discard("files")  # inside Driveline.save
    while leaves := [module for module, others in needs.items() if not others & needs.keys()]:
        for module in leaves:
            del needs[module]
    assert not needs, f"these import each other: {needs}"


def test_type_checkers_are_told_that_the_package_has_types():
    assert (PACKAGE / "py.typed").read_bytes() == b""
