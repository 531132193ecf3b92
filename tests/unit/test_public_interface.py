"""What `import pgfmd` shows: every name is there and typed, and nothing is loaded before it is used."""

import ast
import importlib
import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pgfmd

PACKAGE = Path(pgfmd.__file__).parent
PAGE = PACKAGE.parent / "docs" / "reference" / "python.md"
DIRECTIVE = re.compile(r"^\.\. auto(function|class|module|exception):: ([\w.]+)$", re.MULTILINE)


def names_for_type_checkers():
    """Names that the package imports for type checkers alone."""
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    blocks = [node for node in tree.body if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"]
    imports = [node for block in blocks for node in block.body]
    return {alias.asname or alias.name for node in imports for alias in node.names}


def test_every_name_is_lazy_listed_and_known_to_type_checkers():
    assert set(pgfmd.__all__) == {*pgfmd._HOMES, "__version__"} == {*names_for_type_checkers(), "__version__"}
    assert (PACKAGE / "py.typed").exists()
    for name in pgfmd.__all__:
        assert getattr(pgfmd, name).__doc__, name


def test_importing_it_loads_none_of_its_parts():
    program = "import sys, pgfmd; dir(pgfmd); print([name for name in sys.modules if name.startswith(('pgfmd.', 'numpy', 'mpi4py'))])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == "[]"


def documented():
    """(name, object) of what the reference page of Python documents, and of what the package shows."""
    found = {name: getattr(pgfmd, name) for name in pgfmd._HOMES}
    for kind, path in DIRECTIVE.findall(PAGE.read_text(encoding="utf-8")):
        if kind == "module":
            module = importlib.import_module(path)
            inside = {name: each for name, each in vars(module).items() if getattr(each, "__module__", "") == path}
            found |= {f"{path}.{name}": each for name, each in inside.items() if not name.startswith("_")}
        else:
            home, _, name = path.rpartition(".")
            found[path] = getattr(importlib.import_module(home), name)
    return found


def callables(name, thing):
    """(name, function) of a function, or of what a class shows."""
    if not inspect.isclass(thing):
        yield name, thing
        return
    for own, member in vars(thing).items():
        member = getattr(member, "func", member.fget if isinstance(member, property) else member)
        member = getattr(member, "__func__", member)
        # A protocol has an __init__ that is not its own.
        shown = inspect.isfunction(member) and member.__module__ == thing.__module__
        if shown and (own == "__init__" or not own.startswith("_")):
            yield f"{name}.{own}", member


def untyped(function):
    """Parameters of a function without a type, and "return" where that has none."""
    signature = inspect.signature(inspect.unwrap(function))
    empty = [
        each.name for each in signature.parameters.values()
        if each.annotation is each.empty and each.name not in ("self", "cls")
    ]  # fmt: skip
    without = signature.return_annotation is signature.empty and function.__name__ != "__init__"
    return empty + ["return"] * without


def test_everything_public_has_types():
    missing = [
        f"{name}({each})"
        for found, thing in documented().items()
        if callable(thing)
        for name, function in callables(found, thing)
        for each in untyped(function)
    ]
    assert missing == []


@pytest.mark.parametrize("name", [name for name in pgfmd._HOMES if name.startswith("plot_")])
def test_every_picture_is_documented_and_says_what_it_returns(name):
    drawn = inspect.signature(getattr(pgfmd, name)).return_annotation
    assert drawn == ("list[Path]" if name == "plot_results" else "Figure")
    assert f"pgfmd.{name}" in PAGE.read_text(encoding="utf-8")
