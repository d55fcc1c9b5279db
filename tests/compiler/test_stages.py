"""The stages of the compiler, as an editor uses them: most of a program is the same as the last time."""

from __future__ import annotations

import pytest

from plctool.compiler import front
from plctool.compiler.base.source import Source
from plctool.compiler.front import Trees, check, check_file, check_sources, declare, diagnostics_of, parse, place
from plctool.compiler.semantics.stages import Declared
from plctool.compiler.syntax.library import standard_library

MAIN = Source("main.st", "PROGRAM Main\nVAR b : Block; x : INT; END_VAR\nb();\nx := TRUE;\nEND_PROGRAM")
BLOCK = Source("block.st", "FUNCTION_BLOCK Block\nVAR y : INT; END_VAR\ny := 'text';\nEND_FUNCTION_BLOCK")
BROKEN = Source("broken.st", "FUNCTION F : INT\nF := ;\nEND_FUNCTION")
CHART = Source(
    "chart.st",
    "PROGRAM Chart\nVAR go : BOOL; END_VAR\nINITIAL_STEP One: END_STEP\n"
    "TRANSITION FROM One TO Two := go; END_TRANSITION\nSTEP Two: END_STEP\n"
    "TRANSITION FROM Two TO One := NOT go; END_TRANSITION\nEND_PROGRAM",
)


def declared_of(*sources: Source) -> Declared:
    library = standard_library()
    declared = declare(parse(sources, library, (), diagnostics_of(library), Trees()))
    assert declared is not None
    return declared


def lines(declared: Declared) -> list[tuple[str, int]]:
    return [(d.file, d.line) for d in declared.diagnostics.sorted() if d.severity == "error"]


@pytest.fixture
def parsed(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The files that are parsed from now on."""
    seen: list[str] = []
    parse_all = front.parse_all

    def parse_one(source, *words, **more):  # type: ignore[no-untyped-def]
        seen.append(source.path)
        return parse_all(source, *words, **more)

    monkeypatch.setattr(front, "parse_all", parse_one)
    return seen


def test_nothing_is_checked_until_a_declared_program_is() -> None:
    declared = declared_of(MAIN, BLOCK)
    assert lines(declared) == []
    check(declared)
    assert lines(declared) == [("block.st", 3), ("main.st", 4)]


def test_one_file_is_checked_before_the_others() -> None:
    declared = declared_of(MAIN, BLOCK)
    check_file(declared, "block.st")
    assert lines(declared) == [("block.st", 3)]
    check(declared)
    assert lines(declared) == [("block.st", 3), ("main.st", 4)]


def test_a_program_that_no_task_runs_is_checked_with_its_file() -> None:
    other = Source("other.st", "PROGRAM Other\nVAR x : INT; END_VAR\nx := TRUE;\nEND_PROGRAM")
    declared = declared_of(Source("main.st", "PROGRAM Main\nEND_PROGRAM"), other)
    check_file(declared, "other.st")
    assert lines(declared) == [("other.st", 3)]


def test_offsets_are_known_when_a_program_is_placed() -> None:
    text = "PROGRAM Main\nVAR a : BYTE; b : LREAL; c : BYTE; END_VAR\nEND_PROGRAM"
    checked = check(declared_of(Source("main.st", text)))
    variables = checked.program.world.allocation.variables
    assert [v.offset for v in variables] == [-1, -1, -1]
    assert [v.offset for v in place(checked).program.globals] == [0, 8, 16]


def test_file_that_has_not_changed_is_not_parsed_again(parsed: list[str]) -> None:
    trees = Trees()
    first = check_sources([MAIN, BLOCK], trees=trees)
    changed = Source("main.st", MAIN.text.replace("TRUE", "1"))
    second = check_sources([changed, BLOCK], trees=trees)
    assert parsed == ["main.st", "block.st", "main.st"]
    assert [(d.file, d.line) for d in first.diagnostics] == [("block.st", 3), ("main.st", 4)]
    assert [(d.file, d.line) for d in second.diagnostics] == [("block.st", 3)]


def test_syntax_errors_of_a_file_that_has_not_changed_are_reported_again(parsed: list[str]) -> None:
    trees = Trees()
    found = [check_sources([MAIN, BROKEN], trees=trees).diagnostics for _ in range(2)]
    assert found[0] == found[1] != []
    assert parsed == ["main.st", "broken.st"]


def test_file_with_a_chart_is_parsed_again_since_its_tree_changes(parsed: list[str]) -> None:
    trees = Trees()
    found = [check_sources([CHART], trees=trees) for _ in range(2)]
    assert [f.diagnostics for f in found] == [[], []]
    assert parsed == ["chart.st", "chart.st"]


def test_tree_of_a_text_that_is_not_there_any_more_is_forgotten(parsed: list[str]) -> None:
    trees = Trees()
    for sources in ([MAIN], [BLOCK], [MAIN]):
        check_sources(sources, trees=trees)
    assert parsed == ["main.st", "block.st", "main.st"]


def test_condition_on_a_name_that_another_file_declares_is_looked_at_again() -> None:
    text = "PROGRAM Main\nVAR x : INT; END_VAR\n{IF defined(pou: F)}\nx := 'text';\n{END_IF}\nEND_PROGRAM"
    main, trees = Source("main.st", text), Trees()
    function = Source("f.st", "FUNCTION F : INT\nF := 1;\nEND_FUNCTION")
    assert check_sources([main], trees=trees).ok
    assert not check_sources([main, function], trees=trees).ok
    assert check_sources([main], trees=trees).ok
