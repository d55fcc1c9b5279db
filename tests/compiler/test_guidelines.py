"""PLCopen's coding guidelines, when they are asked for: each rule once against a program that breaks it, and once for
one that does not."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest

from plctool.compiler.base.source import Source
from plctool.compiler.front import check_sources
from plctool.compiler.syntax.guidelines import PROPOSED, RULES, Guidelines, read_form
from plctool.compiler.syntax.warnings import warning_options

DOCUMENTATION = Path(__file__).parents[2] / "docs/guidelines.md"
GLOBALS = "VAR_GLOBAL level : REAL; motor : BOOL; END_VAR\n"
FORMS = {"local": "camelCase", "function-block": "FB_CamelCase", "constant": "UPPER_CASE", "struct": "ST_*"}
SMALL = replace(PROPOSED, forms=FORMS, avoided=frozenset(["tmp"]), longest_name=12, branches=3, globals=1, parameters=2)


def program(body: str, variables: str = "", before: str = "") -> str:
    declared = f"VAR {variables} END_VAR\n" if variables else ""
    return f"{before}// what runs\nPROGRAM Main\n{declared}{body}\nEND_PROGRAM\n"


def found(text: str, asked: Guidelines | None = SMALL, *off: str) -> set[str]:
    """The rules that a program breaks."""
    options = warning_options(off, guidelines=asked)
    result = check_sources([Source("f.st", text)], warnings=options)
    assert not [d for d in result.diagnostics if d.severity == "error"]
    return {d.code for d in result.diagnostics} & RULES.keys()


def block(body: str, variables: str = "", head: str = "// a pump\n") -> str:
    """A program with a function block."""
    unit = f"{head}FUNCTION_BLOCK FB_Pump\n{variables}\n{body}\nEND_FUNCTION_BLOCK\n"
    return GLOBALS + unit + program("pump();", "pump : FB_Pump;")


BROKEN = {
    "n1": program("%QX0.0 := TRUE;"),
    "n2": program("Count := 1;", "Count : INT;"),
    "n3": program("tmp := 1;", "tmp : INT;"),
    "n4": program("", "", "// it\nFUNCTION_BLOCK Pump\nEND_FUNCTION_BLOCK\n"),
    "n5": program("level := 1;", "level : INT;", GLOBALS),
    "n6": program("aVeryLongName := 1;", "aVeryLongName : INT;"),
    "n9": program("fb_pump := 1;", "fb_pump : INT;", "// it\nFUNCTION_BLOCK FB_Pump\nEND_FUNCTION_BLOCK\n"),
    "n10": program("", "", "// it\nTYPE Point : STRUCT x : INT; END_STRUCT END_TYPE\n"),
    "c2": block("", head=""),
    "cp6": block("motor := TRUE;"),
    "cp8": program("b := x = 1.0;", "x : REAL; b : BOOL;"),
    "cp9": program("FOR i := 0 TO 3 DO IF i = 1 THEN ; ELSIF i = 2 THEN ; ELSE ; END_IF END_FOR", "i : INT;"),
    "cp14": program("IF b THEN RETURN; ELSE ; END_IF b := TRUE;", "b : BOOL;"),
    "cp18": program("level := 1.0; motor := TRUE;", "", GLOBALS),
    "cp19": program("JMP past; past: ;"),
    "cp20": program("t(IN := TRUE); t(PT := T#1s);", "t : TON;"),
    "cp23": block("", "VAR_INPUT a, b : INT; END_VAR VAR_OUTPUT c : INT; END_VAR"),
    "cp26": GLOBALS + program("motor := TRUE;") + "// also\nPROGRAM Other motor := FALSE; END_PROGRAM\n",
    "cp28": program("b := t <> T#1s;", "t : TIME; b : BOOL;"),
    "l10": program("WHILE b DO EXIT; END_WHILE", "b : BOOL;"),
    "l17": program("IF b THEN b := FALSE; END_IF", "b : BOOL;"),
    "l22": program("FOR i := 0 TO 9 DO i := i + 1; END_FOR", "i : INT;"),
    "e1": program("p := __NEW(INT); __DELETE(p);", "p : POINTER TO INT;"),
    "e2": program("p := p + 2;", "p : POINTER TO INT;"),
    "e3": program("b := p < ADR(b);", "p : POINTER TO BOOL; b : BOOL;"),
}
KEPT = {
    "n1": program("motor := TRUE;", "motor AT %QX0.0 : BOOL;"),
    "n2": program("count := 1;", "count : INT;"),
    "n3": program("tmpX := 1;", "tmpX : INT;"),
    "n4": block("") + "VAR_GLOBAL CONSTANT MAX_LEVEL : INT := 1; END_VAR",
    "n5": program("levels := 1;", "levels : INT;", GLOBALS),
    "n6": program("twelveLetter := 1;", "twelveLetter : INT;"),
    "n9": block(""),
    "n10": program("", "", "// it\nTYPE ST_Point : STRUCT x : INT; END_STRUCT END_TYPE\n"),
    "c2": block("", head="(* a pump *)\n{attribute 'x'}\n"),
    "cp6": block("m := MAXIMUM;", "VAR m : INT; END_VAR") + "VAR_GLOBAL CONSTANT MAXIMUM : INT := 1; END_VAR",
    "cp8": program("b := x >= 1.0; b := n = 1;", "x : REAL; n : INT; b : BOOL;"),
    "cp9": program("IF b THEN ; ELSIF NOT b THEN ; ELSE ; END_IF", "b : BOOL;"),
    "cp14": block("RETURN;"),
    "cp18": program("level := 1.0;", "", GLOBALS),
    "cp19": program("past: ;"),
    "cp20": program("t[0](IN := TRUE); t[1](); FOR i := 0 TO 1 DO t[i](); END_FOR", "t : ARRAY[0..1] OF TON; i : INT;"),
    "cp23": block("", "VAR_INPUT a, b : INT; END_VAR VAR c : INT; END_VAR"),
    "cp26": GLOBALS + program("motor := TRUE;") + "// also\nPROGRAM Other level := 1.0; END_PROGRAM\n",
    "cp28": program("b := t >= T#1s;", "t : TIME; b : BOOL;"),
    "l10": program("WHILE b DO b := FALSE; END_WHILE", "b : BOOL;"),
    "l17": program("IF b THEN b := FALSE; ELSE ; END_IF", "b : BOOL;"),
    "l22": program("FOR i := 0 TO 9 DO n := i; END_FOR i := 0;", "i, n : INT;"),
    "e1": program("p := ADR(n);", "p : POINTER TO INT; n : INT;"),
    "e2": program("p := ADR(n); n := p^ + 2;", "p : POINTER TO INT; n : INT;"),
    "e3": program("b := p = ADR(b);", "p : POINTER TO BOOL; b : BOOL;"),
}


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_finds_what_breaks_it(rule: str) -> None:
    assert rule in found(BROKEN[rule])


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_is_silent_about_what_keeps_it(rule: str) -> None:
    assert rule not in found(KEPT[rule])


@pytest.mark.parametrize("rule", RULES)
def test_nothing_is_said_unless_it_is_asked_for(rule: str) -> None:
    assert found(BROKEN[rule], None) == set()


@pytest.mark.parametrize("rule", RULES)
def test_a_rule_can_be_turned_off(rule: str) -> None:
    assert rule not in found(BROKEN[rule], SMALL, rule)
    assert found(BROKEN[rule], SMALL, "guidelines") == set()


def test_a_rule_can_be_turned_off_for_a_few_lines() -> None:
    assert "l17" not in found("{warning disable l17}\n" + BROKEN["l17"])


def test_enable_inputs_are_no_return_of_the_programmer() -> None:
    pins = "VAR_INPUT EN : BOOL; END_VAR VAR_OUTPUT ENO : BOOL; END_VAR"
    unit = f"// it\nFUNCTION_BLOCK FB_Pump\n{pins}\nEND_FUNCTION_BLOCK\n"
    assert found(unit + program("pump(EN := TRUE);", "pump : FB_Pump;")) == set()


def test_tests_are_not_held_to_the_rules() -> None:
    test = "TEST 'twice'\nVAR t : TON; END_VAR\nt(IN := TRUE); t(); ASSERT_EQ(1.0, 1.0);\nEND_TEST\n"
    assert found(test + program("")) == set()


@pytest.mark.parametrize(
    ("form", "fits", "fits_not"),
    [
        ("CamelCase", "MotorOn", "motorOn"),
        ("camelCase", "motorOn", "MotorOn"),
        ("UPPER_CASE", "MAX_LEVEL_2", "MAX_level"),
        ("lower_case", "max_level", "maxLevel"),
        ("FB_CamelCase", "FB_Pump", "Pump"),
        ("*_t", "point_t", "point"),
        ("g_*", "g_x", "x"),
    ],
)
def test_forms_of_names(form: str, fits: str, fits_not: str) -> None:
    pattern = read_form(form)
    assert pattern is not None and pattern.fullmatch(fits) and not pattern.fullmatch(fits_not)


@pytest.mark.parametrize("form", ["", "FB_", "**", "(a+)+", "CamelCase camelCase"])
def test_what_is_no_form(form: str) -> None:
    assert read_form(form) is None


def test_every_rule_is_in_the_documentation() -> None:
    rows = re.findall(r"^\| (\w+) \|.*\| [^|]*\bwarning\b", DOCUMENTATION.read_text(), re.MULTILINE)
    assert {row.lower() for row in rows} == RULES.keys()
