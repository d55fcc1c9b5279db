"""A dialect gives a program the rules of another system; without one nothing changes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from plcopen_support import data, errors, pou, project, st, variables

from plctool import Simulator
from plctool.compiler import CompileError, compile_sources
from plctool.compiler.base.source import Source
from plctool.compiler.front import check_sources
from plctool.errors import UsageError
from plctool.iec.dialect import DIALECTS, OWN, find_dialect
from plctool.st_tests import run_tests

NAMES = [None, *DIALECTS]
VENDORS = ["codesys", "twincat"]
DOCUMENT = Path(__file__).parents[2] / "docs/existing-code.md"

LOOP = """
FUNCTION Last : INT
VAR_IN_OUT asked : INT; END_VAR
asked := asked + 1;
Last := 5;
END_FUNCTION

PROGRAM Main
VAR i, n, turns, asked, calls, asked2, by, limited, down, k : INT;
    step : INT := 1; a : ARRAY[1..9] OF INT; u : USINT; END_VAR
turns := 0; calls := 0; asked := 0; by := 0; step := 1; limited := 0; down := 0; n := 3;
FOR i := 1 TO n DO
    turns := turns + 1;
    IF i = 2 THEN n := 6; END_IF;
    a[i] := i;
END_FOR;
FOR i := 1 TO Last(asked) DO
    calls := calls + 1;
END_FOR;
FOR k := 0 TO 8 BY step DO
    step := 4;
    by := by + 1;
END_FOR;
FOR u := 250 TO 255 DO limited := limited + 1; END_FOR;
FOR i := 5 TO 1 BY -2 DO
    IF i = 3 THEN CONTINUE; END_IF;
    down := down + 1;
END_FOR;
END_PROGRAM
"""


@pytest.mark.parametrize("level", [0, 2])
@pytest.mark.parametrize("dialect", NAMES)
def test_for_looks_at_its_end_and_step_once_or_in_each_turn(tmp_path: Path, dialect: str | None, level: int) -> None:
    (tmp_path / "loop.st").write_text(LOOP)
    with Simulator.from_sources(tmp_path, level=level, dialect=dialect) as plc:
        plc.run_cycles(1)
        found = [plc.read(f"Main.{name}") for name in ("turns", "asked", "calls", "by", "limited", "down")]
    assert found == ([6, 6, 5, 3, 6, 2] if dialect in VENDORS else [3, 1, 5, 9, 6, 2])


@pytest.mark.parametrize("dialect", NAMES)
def test_a_step_that_becomes_zero_is_an_exception_where_it_is_looked_at(tmp_path: Path, dialect: str | None) -> None:
    (tmp_path / "zero.st").write_text(
        "PROGRAM Main\nVAR i, s : INT; caught : BOOL; why : __SYSTEM.ExceptionCode; END_VAR\ns := 1;\n__TRY\n"
        "FOR i := 0 TO 3 BY s DO s := 0; END_FOR;\n"
        "__CATCH(why)\ncaught := TRUE;\n__ENDTRY\nEND_PROGRAM\n"
    )
    with Simulator.from_sources(tmp_path, dialect=dialect) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.caught") is (dialect in VENDORS)


OWN_VARIABLE = """
FUNCTION Limit3 : INT
VAR_INPUT k : INT; END_VAR
Limit3 := SEL(k < 3, 0, 100);
END_FUNCTION

PROGRAM Main
VAR i, j, down, turns, shrinking, downward, own : INT; u : USINT; wrapped : INT; end : USINT := 254;
    by : SINT := -100; s : SINT; END_VAR
turns := 0; shrinking := 0; downward := 0; own := 0; wrapped := 0;
FOR i := 0 TO Limit3(i) DO turns := turns + 1; END_FOR
FOR j := 0 TO 10 - j DO shrinking := shrinking + 1; END_FOR
FOR down := 10 TO down / 2 - 3 BY -4 DO downward := downward + 1; END_FOR
FOR u := 250 TO end DO end := 255; wrapped := wrapped + 1; END_FOR
FOR s := 100 TO -128 BY by DO own := own + 1; END_FOR
END_PROGRAM
"""


@pytest.mark.parametrize("level", [0, 1, 2, 3, "s"])
@pytest.mark.parametrize("dialect", NAMES)
def test_the_end_of_a_loop_sees_its_variable_after_each_step(tmp_path: Path, dialect: str | None, level: Any) -> None:
    (tmp_path / "loop.st").write_text(OWN_VARIABLE)
    with Simulator.from_sources(tmp_path, level=level, dialect=dialect) as plc:
        plc.run_cycles(2)
        names = ("turns", "i", "shrinking", "j", "downward", "wrapped", "u", "own", "s")
        found = [plc.read(f"Main.{name}") for name in names]
    vendor = [3, 3, 6, 6, 5, 6, 255, 3, -128]
    assert (found == vendor) is (dialect in VENDORS)


@pytest.mark.parametrize("dialect", NAMES)
def test_an_end_that_reads_its_own_variable_is_a_warning(tmp_path: Path, dialect: str | None) -> None:
    (tmp_path / "loop.st").write_text(OWN_VARIABLE)
    found = [w.line for w in compile_sources([tmp_path], dialect=dialect).warnings if w.code == "for-bound"]
    changed_in_its_body = [] if dialect in VENDORS else [14]
    assert found == [11, 12, 13, *changed_in_its_body]


def test_only_a_loop_that_computes_its_end_once_warns_of_a_change(tmp_path: Path) -> None:
    (tmp_path / "loop.st").write_text(LOOP)
    for dialect in NAMES:
        found = {w.code for w in compile_sources([tmp_path], dialect=dialect).warnings}
        assert ("for-bound" in found) is (dialect not in VENDORS)


REALS = {  # expression -> value by our own rules and by those of the vendors
    "REAL_TO_BYTE({})": {2.5: (2, 3), 0.5: (0, 1), 300.0: (255, 44), -1.0: (0, 255), 0.25: (0, 0), -2.5: (0, 253)},
    "LREAL_TO_WORD({})": {-1.0: (0, 65535), 70000.5: (65535, 4465), 0.49999999999999994: (0, 0)},
    "TO_DWORD({})": {4294967297.0: (0xFFFFFFFF, 1), 1.5: (2, 2)},
    "LREAL_TO_LWORD({})": {1e20: (2**64 - 1, 2**63), -1e20: (0, 2**63), 4503599627370497.5: (2**52 + 2, 2**52 + 2)},
    "LREAL_TO_INT({})": {2.5: (2, 2), 1e9: (32767, 32767)},
    "TRUNC({})": {2.5: (2, 2)},
}
TYPES = ["BYTE", "WORD", "DWORD", "LWORD", "INT", "DINT"]


@pytest.mark.parametrize("dialect", NAMES)
def test_reals_become_bit_strings_by_the_rules_of_the_system(tmp_path: Path, dialect: str | None) -> None:
    """Computed by the controller and by the compiler."""
    declared, body, wanted = [], [], {}
    for (expression, cases), t in zip(REALS.items(), TYPES, strict=True):
        real = "REAL" if expression.startswith("REAL") else "LREAL"
        for value, (own, theirs) in cases.items():
            number = len(declared)
            declared.append(f"x{number} : {real} := {value!r}; a{number}, b{number} : {t};")
            body.append(f"a{number} := {expression.format(f'x{number}')};")
            body.append(f"b{number} := {expression.format(f'{real}#{value!r}')};")
            wanted |= dict.fromkeys((f"a{number}", f"b{number}"), theirs if dialect in VENDORS else own)
    lines = ["PROGRAM Main", "VAR", *declared, "END_VAR", *body, "END_PROGRAM", ""]
    (tmp_path / "reals.st").write_text("\n".join(lines))
    with Simulator.from_sources(tmp_path, dialect=dialect) as plc:
        plc.run_cycles(1)
        assert {name: plc.read(f"Main.{name}") for name in wanted} == wanted


ENUMS = {
    "m := n;": "INT becomes Mode",
    "m := 1;": "the number 1 stands for",
    "m := other;": "a value of Kind becomes one of Mode",
    "b := m = n;": "Mode is compared with INT",
    "b := n < m;": "Mode is compared with INT",
    "b := m = other;": "Mode and Kind are compared",
    "CASE m OF Kind.c: b := TRUE; ELSE b := FALSE; END_CASE;": "this is a value of Kind",
}


@pytest.mark.parametrize("statement", ENUMS)
@pytest.mark.parametrize("dialect", NAMES)
def test_enumerations_and_numbers_mix_with_a_warning_or_not_at_all(
    tmp_path: Path, dialect: str | None, statement: str
) -> None:
    (tmp_path / "mixed.st").write_text(
        "TYPE Mode : (off, on); Kind : (c, d); END_TYPE\nPROGRAM Main\n"
        "VAR m : Mode; other : Kind; n : INT; b : BOOL; END_VAR\n{warning disable unused}\n"
        f"{statement}\nEND_PROGRAM\n"
    )
    try:
        found = compile_sources([tmp_path], dialect=dialect).warnings
    except CompileError as error:
        found = error.diagnostics
    (mixed,) = (d for d in found if d.code == "enum")
    assert ENUMS[statement] in mixed.message
    assert mixed.severity == ("error" if dialect == "iec" else "warning")


def test_an_error_of_the_dialect_cannot_be_turned_off_and_names_it(tmp_path: Path) -> None:
    (tmp_path / "mixed.st").write_text(
        "TYPE Mode : (off, on); END_TYPE\n{warning disable enum}\nPROGRAM Main\n"
        "VAR m : Mode; n : INT; END_VAR\nm := n;\nEND_PROGRAM\n"
    )
    assert compile_sources([tmp_path]).warnings == []
    with pytest.raises(CompileError, match="an error in the dialect iec"):
        compile_sources([tmp_path], dialect="iec")


def test_the_standard_library_keeps_its_own_rules(tmp_path: Path) -> None:
    """It compiles by all of them, and gives the same."""
    (tmp_path / "use.st").write_text(
        "PROGRAM Main\nVAR x : LREAL; s : STRING; t : TON; n : INT; END_VAR\nt(IN := TRUE, PT := T#1s);\n"
        "x := SIN(1.5) + EXPT(2.0, 0.5);\ns := LREAL_TO_STRING(x);\n"
        "n := FIND(s, '.') + STRING_TO_INT('12abc');\nEND_PROGRAM\n"
    )
    images = {compile_sources([tmp_path], dialect=dialect).image for dialect in NAMES}
    assert len(images) == 1


def test_unit_tests_have_the_rules_of_the_dialect(tmp_path: Path) -> None:
    (tmp_path / "t.st").write_text(
        "TEST 'halves'\nVAR x : REAL := 2.5; END_VAR\nASSERT_EQ(REAL_TO_BYTE(x), BYTE#3);\nEND_TEST\n"
    )
    assert [run_tests([tmp_path], dialect=dialect).document()["passed"] for dialect in NAMES] == [0, 0, 1, 1, 0]


def test_unknown_dialects_are_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "m.st").write_text("PROGRAM Main\nEND_PROGRAM\n")
    for wrong, hint in (
        ("codesis", "did you mean codesys"),
        ("x", "iec, codesys, twincat, openplc"),
        ("", "iec, codesys"),
    ):
        with pytest.raises(UsageError, match=hint):
            compile_sources([tmp_path], dialect=wrong)


def table_of_rules() -> list[list[str]]:
    """A subject in each row, and what it is without a dialect and in each of them."""
    systems = [OWN, *DIALECTS.values()]
    return [
        ["", *(dialect.name or "default" for dialect in systems)],
        ["numbers and enumerations mixed", *("error" if "enum" in d.errors else "warning" for d in systems)],
        ["a letter of another size in an address", *("error" if "address" in d.errors else "warning" for d in systems)],
        ["a VAR of a block is written from outside", *("warning" if d.writes_locals else "error" for d in systems)],
        ["FOR computes its end and step", *("each turn" if d.limits_each_turn else "once" for d in systems)],
        ["`REAL_TO_BYTE(2.5)`, halves", *("3, away from zero" if d.reals_wrap else "2, to even" for d in systems)],
        ["`REAL_TO_BYTE(300.0)`", *("44, the low bits" if d.reals_wrap else "255, the limit" for d in systems)],
    ]


def test_documentation_has_the_table_of_the_compiler() -> None:
    lines = DOCUMENT.read_text().partition("### Dialects")[2].splitlines()
    found = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines if line.startswith("|")]
    rows = [row for row in found if not re.fullmatch("-*", row[0]) or not row[0]]
    expected = table_of_rules()
    assert rows[: len(expected)] == expected


STATION = """FUNCTION_BLOCK Station
VAR start : BOOL; END_VAR
VAR_OUTPUT runs : BOOL; END_VAR
runs := start;
END_FUNCTION_BLOCK
PROGRAM Main
VAR s : Station; END_VAR
s.start := TRUE;
s();
END_PROGRAM
"""
CONFIGURATION = """CONFIGURATION Config0
  RESOURCE Res0 ON PLC
    TASK task0(INTERVAL := T#20ms,PRIORITY := 0);
    PROGRAM instance0 WITH task0 : Main;
  END_RESOURCE
END_CONFIGURATION
"""


@pytest.mark.parametrize("dialect", NAMES)
def test_a_variable_of_a_block_is_written_from_outside_in_the_dialect_of_openplc_only(dialect: str | None) -> None:
    found = check_sources([Source("main.st", STATION)], dialect=find_dialect(dialect)).diagnostics
    assert [(d.line, d.severity) for d in found if d.line == 8] == (
        [(8, "warning")] if dialect == "openplc" else [(8, "error")]
    )


def test_what_openplc_editor_writes_has_its_rule_without_a_dialect(tmp_path: Path) -> None:
    (tmp_path / "program.st").write_text(STATION + CONFIGURATION)
    with Simulator.from_sources(tmp_path) as plc:
        plc.run_cycles(2)
        assert plc.read("instance0.s.runs") is True


def test_xml_of_openplc_editor_has_its_rule_and_that_of_codesys_has_not(tmp_path: Path) -> None:
    block = pou("Station", st("runs := start;"), variables("outputVars", "runs:BOOL"), "functionBlock")
    block = block.replace("</outputVars>", "</outputVars>" + variables("localVars", "start:BOOL"))
    main = pou("Main", st("s.start := TRUE; s();"), variables("localVars", "s:Station"))
    assert errors(tmp_path, project(block + main)) == []
    ((_, message),) = errors(tmp_path, project(block + main, added=data("x", "")))
    assert "local variable of Station" in message


def test_an_output_of_a_block_is_never_written_from_outside() -> None:
    text = STATION.replace("s.start := TRUE", "s.runs := TRUE")
    found = check_sources([Source("main.st", text)], dialect=find_dialect("openplc")).diagnostics
    assert [d.message for d in found if d.severity == "error"] == [
        "runs is an output of Station and cannot be assigned to"
    ]
