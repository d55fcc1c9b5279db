"""The modules of the compiler stand on each other in one direction."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import plctool.compiler

ROOT = Path(plctool.compiler.__file__).parent
PACKAGE = plctool.compiler.__name__
NOT_BELOW = {
    "formats": {"semantics", "codegen"},
    "syntax": {"semantics", "codegen", "formats"},
    "semantics": {"codegen", "formats"},
    "semantics.rules": {"semantics.declarations", "semantics.program"},
    "semantics.declarations": {"semantics.program"},
    "codegen": {"syntax", "semantics", "formats"},
}


def _module(path: Path) -> str:
    """The name of a module below the package of the compiler; of a package that of its folder."""
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix("__init__").removesuffix(".")


MODULES = {_module(path): path for path in ROOT.rglob("*.py")}


def _imports(module: str) -> Iterator[str]:
    """The modules of the compiler that a module imports anywhere: in functions and for the type checker as well."""
    for node in ast.walk(ast.parse(MODULES[module].read_text())):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        for name in names:
            below = name.removeprefix(PACKAGE + ".")
            found = below if below in MODULES else below.rpartition(".")[0]
            if name.startswith(PACKAGE + ".") and found in MODULES:
                yield found


def _is_in(module: str, package: str) -> bool:
    return module == package or module.startswith(package + ".")


@pytest.mark.parametrize("package", ["formats", "syntax", "semantics", "codegen"])
def test_no_modules_of_a_package_import_each_other_in_a_circle(package: str) -> None:
    modules = [m for m in MODULES if _is_in(m, package)]
    assert len(modules) > 5
    imported = {m: {i for i in _imports(m) if _is_in(i, package)} for m in modules}
    TopologicalSorter(imported).prepare()  # raises CycleError, which names the circle


@pytest.mark.parametrize("package", NOT_BELOW)
def test_package_imports_none_that_does_not_lie_below_it(package: str) -> None:
    modules = [m for m in MODULES if _is_in(m, package)]
    assert modules
    wrong = {(m, i) for m in modules for i in _imports(m) if any(_is_in(i, above) for above in NOT_BELOW[package])}
    assert wrong == set()
