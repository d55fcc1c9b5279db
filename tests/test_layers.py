"""The modules of plctool stand on each other in one direction: no circle, and none imports what is declared above it.

Every import counts: at the head of a module, in a function, and for the type checker.
"""

from __future__ import annotations

from collections.abc import Iterable
from graphlib import CycleError, TopologicalSorter
from itertools import combinations

import pytest
from import_graph import INTERNALS, MODULES, arrows, drawn, floors, imports, named_in

# From the ground up; the packages and modules of one line do not know each other. "" is what `import plctool` gives.
FLOORS = (
    ("errors", "printable", "records", "version"),
    ("core",),
    ("archives", "files", "iec", "project", "settings"),
    ("image",),
    ("io",),
    ("debug",),
    ("link",),
    ("canopen", "controller_results", "gateway"),
    ("controller", "compiler", "sim_io"),
    ("doc", "fmt", "v3"),
    ("sim_can", "sim_functions", "sim_net", "sim_traces", "sim_variables", "sim_worker"),
    ("device", "sim"),
    ("", "controller_documents", "dump_file", "sim_plant"),
    ("port_check", "st_tests", "templates", "testing", "trace_file", "trace_plot", "ui"),
    ("dap", "lsp"),
    ("cli", "pytest_plugin"),
    ("__main__",),
)
# What floors alone do not say: (package, what it does not know although that is below it).
APART = (
    ("compiler", ("link", "gateway")),
    ("device", ("compiler",)),
    ("sim", ("gateway",)),
    ("controller", ("gateway",)),
    ("testing", ("compiler", "device", "sim")),
)
# The rooms of the compiler, from the ground up; what `import plctool.compiler` gives stands on all of them.
COMPILER_FLOORS = (
    ("compiler.typed",),
    ("compiler.base",),
    ("compiler.codegen", "compiler.syntax"),
    ("compiler.formats", "compiler.plcopen_export"),
    ("compiler.sources",),
    ("compiler.image", "compiler.semantics"),
    ("compiler.export_itf", "compiler.front"),
    ("compiler.kept",),
)
NOT_BELOW = {
    "compiler.semantics": ("compiler.formats", "compiler.plcopen_export", "compiler.codegen"),
    "compiler.semantics.rules": ("compiler.semantics.declarations", "compiler.semantics.program"),
    "compiler.semantics.declarations": ("compiler.semantics.program",),
    "compiler.front": ("compiler.codegen", "compiler.formats", "compiler.plcopen_export"),
}
# The parts of the command line, from the ground up: what commands share, their table, what reads it, commands, `main`.
CLI = ("cli.commands", "cli.command_line", "cli.manual", "cli.main")


def _is_in(module: str, package: str) -> bool:
    return module == package or (package != "" and module.startswith(package + "."))


def _edges(package: str, others: Iterable[str]) -> set[tuple[str, str]]:
    """The imports of a package that lead into one of `others`."""
    modules = [m for m in MODULES if _is_in(m, package)]
    assert modules, f"there is no {package}"
    return {(m, i) for m in modules for i in imports(m) if any(_is_in(i, other) for other in others)}


def _circle(modules: Iterable[str]) -> list[str]:
    """Modules that import each other in a circle; none if there is no circle."""
    wanted = set(modules)
    try:
        TopologicalSorter({m: imports(m) & wanted for m in wanted}).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def _floor_pairs(floors: tuple[tuple[str, ...], ...]) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    return list(combinations(floors, 2))


def _homes(module: str, floors: tuple[tuple[str, ...], ...]) -> list[str]:
    return [p for floor in floors for p in floor if _is_in(module, p)]


def test_every_module_is_on_one_floor() -> None:
    assert {m: h for m in MODULES if len(h := _homes(m, FLOORS)) != 1} == {}


def test_every_module_of_the_compiler_is_in_one_room() -> None:
    modules = [m for m in MODULES if _is_in(m, "compiler") and m != "compiler"]
    assert {m: h for m in modules if len(h := _homes(m, COMPILER_FLOORS)) != 1} == {}


def test_no_room_of_the_compiler_imports_the_whole() -> None:
    assert [m for m in MODULES if _is_in(m, "compiler") and "compiler" in imports(m)] == []


def test_imports_are_found_wherever_they_are() -> None:
    source = "from plctool.a import b\ndef f():\n    import plctool.c.d\nif TYPE_CHECKING:\n    from plctool import e"
    assert len(list(named_in(source))) == 3
    assert "compiler" in imports("cli.commands.programs")  # in a function only
    assert "debug.symbols" in imports("device")


def test_no_modules_import_each_other_in_a_circle() -> None:
    assert _circle(MODULES) == []


@pytest.mark.parametrize(("lower", "upper"), [*_floor_pairs(FLOORS), *_floor_pairs(COMPILER_FLOORS)])
def test_no_floor_knows_one_above_it(lower: tuple[str, ...], upper: tuple[str, ...]) -> None:
    wrong = [_edges(package, upper) for package in lower]
    assert set().union(*wrong) == set()


@pytest.mark.parametrize("floor", [*FLOORS, *COMPILER_FLOORS], ids=str)
def test_packages_of_a_floor_do_not_know_each_other(floor: tuple[str, ...]) -> None:
    wrong = [_edges(package, set(floor) - {package}) for package in floor]
    assert set().union(*wrong) == set()


def _floor_in_cli(module: str) -> int:
    if module in CLI:
        return {"cli.commands": 1, "cli.main": 4}.get(module, 2)
    return 3 if _is_in(module, "cli.commands") else 0


@pytest.mark.parametrize("module", sorted(m for m in MODULES if _is_in(m, "cli")))
def test_parts_of_the_command_line_do_not_know_what_is_above_them(module: str) -> None:
    known = [i for i in imports(module) if _is_in(i, "cli")]
    assert [i for i in known if _floor_in_cli(i) > _floor_in_cli(module)] == []


@pytest.mark.parametrize(("package", "others"), [*APART, *NOT_BELOW.items()])
def test_package_does_not_know_what_is_kept_apart(package: str, others: tuple[str, ...]) -> None:
    assert _edges(package, others) == set()


# ---- the picture ----


def test_pictures_in_the_documentation_are_those_of_the_imports() -> None:
    text = INTERNALS.read_text()
    assert "```imports compiler\n" in text
    assert drawn(text) == text, "run tests/import_graph.py"


def test_rooms_of_the_compiler_are_few() -> None:
    rooms = arrows("compiler")
    assert len(rooms) <= 12
    assert max(floors(rooms).values()) <= 8
