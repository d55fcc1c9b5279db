"""Warnings on the command line, and what a bug of the compiler looks like."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from plctool.compiler.codegen.lower_frame import STATEMENTS, VALUES
from plctool.compiler.semantics.checker import EXPRESSION_RULES, STATEMENT_RULES
from plctool.compiler.syntax import ast
from plctool.compiler.syntax.diagnostics import MAX_OF_KIND
from plctool.compiler.typed.nodes import Assign, Binary

PROGRAM = """PROGRAM Main
VAR
    n : INT;
    spare : INT;
END_VAR
n := 1;
RETURN;
n := 2;
END_PROGRAM
TEST 'nothing'
END_TEST
"""


@pytest.fixture(autouse=True)
def source(scratch: Path) -> None:
    (scratch / "main.st").write_text(PROGRAM)


def test_check_and_build_show_warnings_unless_they_are_turned_off(tool: Any) -> None:
    assert [d["code"] for d in tool("check", "main.st", "--json").json["diagnostics"]] == ["unused", "unreachable"]
    off = ["--no-warn", "unused", "--no-warn=unreachable"]
    assert tool("check", "main.st", "--json", *off).json["diagnostics"] == []
    assert [d["code"] for d in tool("build", "main.st", "--json").json["warnings"]] == ["unused", "unreachable"]
    assert tool("build", "main.st", *off).err == ""


@pytest.mark.parametrize("command", ["check", "build", "test"])
def test_a_warning_ends_with_the_name_that_turns_it_off_and_an_error_does_not(
    tool: Any, scratch: Path, command: str
) -> None:
    done = tool(command, "main.st")
    lines = (done.out + done.err).splitlines()
    assert "main.st:4:5: warning: spare is never used [unused]" in lines
    assert "main.st:8:1: warning: this statement is never reached [unreachable]" in lines
    (scratch / "main.st").write_text("PROGRAM Main\nVAR n : INT; END_VAR\nn := TRUE;\nEND_PROGRAM\n")
    done = tool(command, "main.st")
    assert not [line for line in (done.out + done.err).splitlines() if line.endswith("]")]


@pytest.mark.parametrize("command", ["check", "build"])
def test_the_first_of_many_warnings_of_a_kind_are_shown_and_the_rest_is_counted(
    tool: Any, scratch: Path, command: str
) -> None:
    unused = "".join(f"v{n} : INT;\n" for n in range(MAX_OF_KIND + 30))
    (scratch / "main.st").write_text(f"PROGRAM Main VAR x : INT;\n{unused}END_VAR\nx := 1; RETURN; x := 2; END_PROGRAM")
    done = tool(command, "main.st")
    said = done.out + done.err
    assert said.count("is never used") == MAX_OF_KIND
    assert f"{MAX_OF_KIND} of {MAX_OF_KIND + 30} warnings 'unused' are shown; --json shows all." in said
    assert "this statement is never reached" in said
    warnings = tool(command, "main.st", "--json").json["warnings" if command == "build" else "diagnostics"]
    assert len(warnings) == MAX_OF_KIND + 31


@pytest.mark.parametrize("command", ["check", "build", "test"])
def test_werror_fails_on_a_warning(tool: Any, scratch: Path, command: str) -> None:
    done = tool(command, "main.st", "--werror")
    assert done.status == 2
    said = "main.st:8:1: error: this statement is never reached (an error because of --werror) [unreachable]"
    assert said in done.out + done.err
    assert not (scratch / "app.cdl").exists()
    assert tool(command, "main.st", "--werror", "--no-warn", "unused,unreachable").status == 0


@pytest.mark.parametrize("command", ["check", "build", "test"])
def test_unknown_warning_exits_2_and_lists_the_names(tool: Any, command: str) -> None:
    done = tool(command, "main.st", "--no-warn", "unusde")
    assert done.status == 2
    assert done.err.startswith(
        "plctool: There is no warning 'unusde'; the names are access, address, always, assignment, bits, bounds, case, "
    )
    assert done.err.count("\n") == 1


@pytest.mark.parametrize("command", ["check", "build", "test"])
def test_bug_in_the_front_end_names_the_place_in_the_program(
    tool: Any, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.setitem(STATEMENT_RULES, ast.Return, lambda c, node: 1 / 0)
    done = tool(command, "main.st")
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith("plctool: Internal error at main.st:7 (ZeroDivisionError: division by zero); please")
    assert done.err.count("\n") == 1


def test_bug_in_the_lowering_names_the_place_in_the_program(tool: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(self: object, node: object) -> None:
        raise AssertionError

    monkeypatch.setitem(STATEMENTS, Assign, broken)
    done = tool("build", "main.st")
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith("plctool: Internal error at main.st:6 (AssertionError); please report")


def fails(*args: object, **named: object) -> object:
    raise AssertionError


@pytest.mark.parametrize(
    ("command", "broken", "line"),
    [
        ("check", "plctool.compiler.semantics.declarations.type_declarations.TypeDeclarations.type_of", 3),
        ("check", "plctool.compiler.semantics.program.statements_of", 1),
        ("build", "plctool.compiler.codegen.lower.write_body", 1),
    ],
)
def test_bug_outside_of_statements_names_the_place_too(
    tool: Any, monkeypatch: pytest.MonkeyPatch, command: str, broken: str, line: int
) -> None:
    monkeypatch.setattr(broken, fails)
    done = tool(command, "main.st")
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith(f"plctool: Internal error at main.st:{line} (AssertionError); please report")


@pytest.mark.parametrize("command", ["check", "build"])
def test_bug_in_an_expression_names_its_own_line(tool: Any, monkeypatch: pytest.MonkeyPatch, command: str) -> None:
    rules = EXPRESSION_RULES if command == "check" else VALUES
    kind = ast.Binary if command == "check" else Binary
    monkeypatch.setitem(rules, kind, fails)  # type: ignore[arg-type]
    Path("main.st").write_text("PROGRAM Main\nVAR\n  a : INT;\nEND_VAR\na := 1\n  + a\n;\nEND_PROGRAM\n")
    done = tool(command, "main.st")
    assert done.err.startswith("plctool: Internal error at main.st:6 (AssertionError); please report")


def test_bug_shows_its_traceback_on_demand(tool: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLCTOOL_DEBUG", "1")
    monkeypatch.setitem(STATEMENT_RULES, ast.Return, lambda c, node: 1 / 0)
    done = tool("check", "main.st")
    assert "Traceback" in done.err
    assert done.err.splitlines()[-1].startswith("plctool: Internal error at main.st:7")
