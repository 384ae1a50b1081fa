"""Every public name says what it is, names its parameters as they are, and shows an example that runs as it is."""

import ast
import builtins
import doctest
import inspect
import re
from functools import cached_property
from itertools import pairwise
from types import FunctionType

import pytest

import powertrain_ctrl as pt

NAMESPACES = {
    "pt": (pt, pt.__all__),
    "antijerk": (pt.antijerk, pt.antijerk.__all__),
    "export": (pt.export, pt.export.__all__),
    "plots": (pt.plots, pt.plots.__all__),
    "orders": (pt.orders, pt.orders.__all__),
    "studies": (pt.studies, pt.studies.__all__),
    "examples": (pt.examples, pt.examples.__all__),
}
PUBLIC = {
    f"{space}.{name}": getattr(module, name)
    for space, (module, names) in NAMESPACES.items()
    for name in names
    if inspect.isclass(getattr(module, name)) or inspect.isfunction(getattr(module, name))
}
FUNCTIONS = {name for name, thing in PUBLIC.items() if inspect.isfunction(thing)}
ERRORS = {name for name, thing in PUBLIC.items() if inspect.isclass(thing) and issubclass(thing, Exception)}
MEMBERS = {
    f"{name}.{attribute}": inspect.getattr_static(PUBLIC[name], attribute)
    for name in PUBLIC.keys() - FUNCTIONS - ERRORS
    for attribute in dir(PUBLIC[name])
    if not attribute.startswith("_")
    and isinstance(
        inspect.getattr_static(PUBLIC[name], attribute),
        FunctionType | property | cached_property | staticmethod | classmethod,
    )
}
SECTIONS = ("Parameters", "Attributes", "Returns", "Raises", "Notes", "Examples")


def section(thing, title):
    """Lines of a numpydoc section, without its heading; None if there is none."""
    lines = (inspect.getdoc(thing) or "").splitlines()
    headings = [i for i, line in enumerate(lines[:-1]) if line in SECTIONS and re.fullmatch("-+", lines[i + 1])]
    for i, stop in pairwise([*headings, len(lines)]):
        if lines[i] == title:
            return lines[i + 2 : stop]
    return None


def heads(thing, *titles):
    return [line for title in titles for line in section(thing, title) or [] if line and not line.startswith(" ")]


def documented(thing, *titles):
    """Names that these sections explain, in order."""
    return [name.strip().lstrip("*") for head in heads(thing, *titles) for name in head.split(" : ")[0].split(",")]


def parameters(thing):
    return [name for name in inspect.signature(thing).parameters if name != "self" and not name.startswith("_")]


def examples(thing):
    return doctest.DocTestParser().get_examples("\n".join(section(thing, "Examples") or []))


@pytest.mark.parametrize("name", sorted({*PUBLIC, *MEMBERS}))
def test_the_first_line_says_what_it_is(name):
    first, *rest = (inspect.getdoc({**PUBLIC, **MEMBERS}[name]) or "").splitlines() or [""]
    assert re.fullmatch(r".{10,}[.:?]", first), f"{name}: {first!r}"
    assert not rest or not rest[0], f"{name}: the first line goes on"


@pytest.mark.parametrize("name", sorted(PUBLIC.keys() - ERRORS))
def test_parameters_are_explained_in_their_order_and_no_others(name):
    thing = PUBLIC[name]
    named, there = documented(thing, "Parameters", "Attributes"), parameters(thing)
    extra = [each for each in named if each not in there]
    assert [each for each in named if each in there] == there
    assert len(set(named)) == len(named)
    # a record may explain more than its constructor takes, but only what it has
    assert name not in FUNCTIONS or not extra
    assert all(hasattr(thing, each) for each in extra), f"{name} explains {extra}, which are not there"


@pytest.mark.parametrize("name", sorted(n for n, member in MEMBERS.items() if inspect.isfunction(member)))
def test_parameters_of_methods_are_theirs(name):
    named = documented(MEMBERS[name], "Parameters")
    assert not named or named == parameters(MEMBERS[name])


@pytest.mark.parametrize("name", sorted({*PUBLIC, *MEMBERS}))
def test_every_explained_parameter_has_a_type(name):
    untyped = [
        head
        for head in heads({**PUBLIC, **MEMBERS}[name], "Parameters", "Attributes")
        if " : " not in head and not head.startswith("**")
    ]
    assert not untyped


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_a_function_says_what_it_returns(name):
    assert section(PUBLIC[name], "Returns")


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_a_function_that_raises_names_the_errors(name):
    raised = set(re.findall(r"raise (\w+Error)", inspect.getsource(PUBLIC[name])))
    assert raised <= set(heads(PUBLIC[name], "Raises"))


@pytest.mark.parametrize(
    "name", sorted({*FUNCTIONS, *(n for n, member in MEMBERS.items() if inspect.isfunction(member))})
)
def test_help_begins_with_a_short_signature(name):
    assert len(str(inspect.signature({**PUBLIC, **MEMBERS}[name]))) < 300


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_there_is_an_example_with_a_result(name):
    assert any(example.want for example in examples(PUBLIC[name]))


@pytest.mark.parametrize("name", sorted(PUBLIC))
def test_the_example_can_be_copied_as_it_is(name):
    """It imports what it uses, and of this package only public names; that it runs is for the doctests."""
    tree = ast.parse("".join(example.source for example in examples(PUBLIC[name])))
    names = [node for node in ast.walk(tree) if isinstance(node, ast.Name)]
    imported = {
        alias.asname or alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names
    }
    caught = {node.name for node in ast.walk(tree) if isinstance(node, ast.ExceptHandler)}
    given = {node.arg for node in ast.walk(tree) if isinstance(node, ast.arg)}
    known = (
        imported | caught | given | {node.id for node in names if isinstance(node.ctx, ast.Store)} | set(dir(builtins))
    )
    assert {node.id for node in names} <= known
    used = {ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    for dotted in sorted(each for each in used if re.fullmatch(r"pt(\.\w+)+", each)):
        first, *more = dotted.split(".")[1:]
        assert first in pt.__all__
        space = getattr(pt, first)
        assert not (inspect.ismodule(space) and more) or more[0] in space.__all__
