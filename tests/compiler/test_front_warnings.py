"""Warnings: what each is about, how they are turned off by name, and how they become errors."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
from front_support import check, main

import plctool.compiler
from plctool.compiler import check_with_tests
from plctool.compiler.front import Source, check_sources
from plctool.compiler.semantics.lints import LINTS
from plctool.compiler.syntax.guidelines import GROUP as GUIDELINES
from plctool.compiler.syntax.warnings import GROUP_OF, GROUPS, MEANINGS, WARNINGS, meant_by, warning_options
from plctool.errors import UsageError
from plctool.iec.dialect import find_dialect

ROOT = Path(__file__).parents[2]
COLOR = "TYPE Color : (Red, Green, Blue); END_TYPE\n"
LINE = 6
VARIABLES = "i, j : INT; u : UINT; b : BOOL; e : Color; r : REAL; d : DINT; p : POINTER TO INT; q : POINTER TO DINT;"


def warned(text: str, code: str) -> list[str]:
    """`line:column: message` of the warnings of that name."""
    found = check_sources([Source("f.st", text)]).diagnostics
    return [f"{d.line}:{d.column}: {d.message}" for d in found if (d.severity, d.code) == ("warning", code)]


def in_main(body: str, code: str) -> list[str]:
    found = warned(main(VARIABLES, body, COLOR), code)
    return [m.removeprefix(f"{LINE}:") for m in found]


# ---- unreachable -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "columns"),
    [
        ("RETURN; i := 1; i := 2;", [9]),
        ("RETURN; RETURN; i := 2;", [9]),
        ("WHILE b DO EXIT; i := 1; END_WHILE;", [18]),
        ("WHILE b DO CONTINUE; i := 1; END_WHILE;", [22]),
        ("IF b THEN RETURN; ELSE RETURN; END_IF; i := 1;", [40]),
        ("IF b THEN RETURN; ELSE i := 2; END_IF; i := 1;", []),
        ("IF b THEN RETURN; END_IF; i := 1;", []),
        ("CASE i OF 1: RETURN; 2..9: RETURN; ELSE RETURN; END_CASE; i := 1;", [59]),
        ("CASE i OF 1: RETURN; 2..9: RETURN; END_CASE; i := 1;", []),
        ("IF FALSE THEN i := 1; END_IF;", [15]),
        ("IF 1 > 2 THEN i := 1; ELSE i := 2; END_IF;", [15]),
        ("IF TRUE THEN i := 1; ELSIF b THEN i := 2; ELSE i := 3; END_IF;", [35, 48]),
        ("IF NOT TRUE THEN i := 1; END_IF;", [18]),
        ("WHILE FALSE DO i := 1; END_WHILE;", [16]),
        ("WHILE TRUE DO i := 1; END_WHILE; j := 1;", [34]),
        ("WHILE TRUE DO IF b THEN EXIT; END_IF; END_WHILE; j := 1;", []),
        ("WHILE TRUE DO WHILE b DO EXIT; END_WHILE; END_WHILE; j := 1;", [54]),
        ("REPEAT i := 1; UNTIL FALSE END_REPEAT; j := 1;", [40]),
        ("REPEAT i := 1; EXIT; UNTIL FALSE END_REPEAT; j := 1;", []),
        ("FOR i := 1 TO 3 DO RETURN; END_FOR; j := 1;", []),
        ("JMP lab; i := 1; lab: j := 1;", [10]),
        ("RETURN; lab: i := 1; JMP lab;", []),
        ("RETURN; i := 1; lab: i := 1; RETURN; i := 2; JMP lab;", [9, 38]),
        ("IF b THEN JMP lab; ELSE RETURN; END_IF; i := 1; lab: j := 1;", [41]),
        ("RETURN; lab: i := 1;", [9]),
        ("WHILE TRUE DO IF b THEN JMP lab; END_IF; END_WHILE; i := 1; lab: j := 1;", [53]),
    ],
)
def test_statement_that_is_never_reached_is_a_warning(body: str, columns: list[int]) -> None:
    assert [int(m.partition(":")[0]) for m in in_main(body, "unreachable")] == columns


def test_constant_condition_is_named_as_the_reason() -> None:
    assert in_main("IF FALSE THEN i := 1; END_IF;", "unreachable") == [
        "15: this statement is never reached: the condition is always FALSE"
    ]
    assert in_main("IF TRUE THEN ; ELSE i := 1; END_IF;", "unreachable") == [
        "21: this statement is never reached: a previous condition is always TRUE"
    ]


def test_condition_with_a_named_constant_is_a_switch_and_no_warning() -> None:
    before = "VAR_GLOBAL CONSTANT DEBUG : BOOL := FALSE; END_VAR\n"
    assert warned(main("i : INT;", "IF DEBUG THEN i := 1; END_IF; IF NOT DEBUG THEN ; ELSE i := 1; END_IF;", before),
                  "unreachable") == []  # fmt: skip


# ---- case ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("body", "missing"),
    [
        ("CASE e OF Red: ; END_CASE;", "Green and Blue"),
        ("CASE e OF Red, Blue: ; END_CASE;", "Green"),
        ("CASE e OF 7: ; END_CASE;", "Red, Green and Blue"),
    ],
)
def test_case_that_misses_values_of_an_enumeration_names_them(body: str, missing: str) -> None:
    assert in_main(body, "case") == [f"1: this CASE misses {missing} of Color; add what is missing, or an ELSE"]


@pytest.mark.parametrize(
    "body",
    [
        "CASE e OF Red: ; Green, Blue: ; END_CASE;",
        "CASE e OF Red..Blue: ; END_CASE;",
        "CASE e OF Red: ; ELSE i := 1; END_CASE;",
        "CASE e OF Red: ; ELSE END_CASE;",
        "CASE i OF 1: ; END_CASE;",
        "CASE e OF Red: ; Gren: ; Blue: ; END_CASE;",  # Green is not missed, it is misspelt
    ],
)
def test_case_with_all_values_or_an_else_is_no_warning(body: str) -> None:
    assert in_main(body, "case") == []


# ---- overlap ---------------------------------------------------------------------------------------------------------


def overlaps(*declarations: str) -> list[str]:
    return warned(main("\n".join(f"{d};" for d in declarations)), "overlap")


@pytest.mark.parametrize(
    "declarations",
    [
        ("a AT %QW0 : WORD", "b AT %QW0 : WORD"),
        ("a AT %QW0 : WORD", "b AT %QB1 : BYTE"),
        ("a AT %QD1 : DWORD", "b AT %QW3 : WORD"),
        ("a AT %IX0.3 : BOOL", "b AT %IX0.3 : BOOL"),
        ("a AT %QB0 : ARRAY[0..7] OF BYTE", "b AT %QW3 : INT"),
        ("a AT %MB0 : ARRAY[0..3] OF BYTE", "b AT %MW1 : ARRAY[0..3] OF WORD"),
        ("a AT %MW0 : WORD", "b AT %MW0 : INT"),
    ],
)
def test_variables_that_share_an_address_are_a_warning_at_the_later_one(declarations: tuple[str, str]) -> None:
    message = "4:1: Main.b shares its memory with Main.a in line 3"
    assert overlaps(*declarations) == [message]
    assert overlaps(*reversed(declarations)) == [message.replace("Main.b", "x").replace("Main.a", "Main.b").replace(
        "x", "Main.a")]  # fmt: skip


@pytest.mark.parametrize(
    "declarations",
    [
        ("a AT %QW0 : WORD", "b AT %QW1 : WORD"),
        ("a AT %QW0 : WORD", "b AT %IW0 : WORD"),
        ("a AT %QW0 : WORD", "b AT %QX1.7 : BOOL"),
        ("a AT %IX0.3 : BOOL", "b AT %IX0.4 : BOOL"),
        ("a AT %MD0 : REAL", "b AT %MW1 : WORD"),
        ("a AT %QB0 : ARRAY[0..1] OF BYTE", "b AT %QB2 : BYTE"),
    ],
)
def test_variables_side_by_side_and_parts_that_are_meant_are_no_warning(declarations: tuple[str, ...]) -> None:
    assert overlaps(*declarations) == []


def test_overlap_names_the_file_of_the_other_variable() -> None:
    first = Source("io.st", "VAR_GLOBAL lamp AT %QB0 : BYTE; END_VAR")
    second = Source("main.st", main("all AT %QW0 : WORD;"))
    found = check_sources([first, second]).diagnostics
    assert [(d.file, d.message) for d in found if d.code == "overlap"] == [
        ("main.st", "Main.all shares its memory with io.lamp in io.st")
    ]


def test_instances_of_one_program_and_bare_addresses_do_not_overlap() -> None:
    text = (
        "PROGRAM P VAR w AT %QW0 : WORD; END_VAR w := WORD#16#FFFF; %QW0 := 5; END_PROGRAM\n"
        "CONFIGURATION C RESOURCE R ON X TASK t(INTERVAL := T#1ms, PRIORITY := 1);\n"
        "PROGRAM a WITH t : P; PROGRAM b WITH t : P; END_RESOURCE END_CONFIGURATION"
    )
    assert check(text).diagnostics == []


@pytest.mark.parametrize(
    ("loop", "said"),
    [
        ("FOR i := 10 TO 1 DO", ["1: this loop never runs: to count down from 10 to 1, write BY -1"]),
        ("FOR i := 1 TO 10 BY -2 DO", ["1: this loop never runs: to count up from 1 to 10, write BY 2"]),
        ("FOR i := 10 TO 1 BY -1 DO", []),
        ("FOR i := 1 TO 1 DO", []),
    ],
)
def test_a_for_that_never_runs(loop: str, said: list[str]) -> None:
    assert in_main(f"{loop} j := j + i; END_FOR;", "unreachable") == said


# ---- result ----------------------------------------------------------------------------------------------------------


def test_function_that_never_assigns_its_result_is_a_warning() -> None:
    text = "FUNCTION F : INT VAR_INPUT a : INT; END_VAR\nEND_FUNCTION\n" + main("i : INT;", "i := F(1);")
    assert warned(text, "result") == ["1:10: F never assigns its result; write F := ..."]


def test_a_function_in_c_has_its_result_in_tests_too() -> None:
    function = "{attribute 'external' := 'board_adc'}\nFUNCTION F : REAL\nEND_FUNCTION\n"
    text = main("r : REAL;", "r := F();", function) + "TEST 'a'\nASSERT_TRUE(TRUE);\nEND_TEST\n"
    found = check_with_tests([Source("f.st", text)]).diagnostics
    assert not [d for d in found if d.code == "result"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("'line\\n'", "\\n is 2 characters; write $N"),
        ('"line\\r\\n"', "\\r\\n is 4 characters; write $R$N"),
        ("'C:\\new'", None),
        ("'line$N'", None),
    ],
)
def test_string_that_ends_as_in_c_is_a_warning(text: str, said: str | None) -> None:
    kind = "WSTRING" if text[0] == '"' else "STRING"
    found = [d.message for d in check(main(f"s : {kind};", f"s := {text};")).diagnostics if d.code == "escape"]
    assert found == ([said] if said else [])


@pytest.mark.parametrize("body", ["F := 1;", "IF a > 1 THEN F := a; END_IF;", "G(F);"])
def test_function_that_assigns_its_result_somewhere_is_no_warning(body: str) -> None:
    other = "FUNCTION G VAR_IN_OUT x : INT; END_VAR x := 1; END_FUNCTION\n"
    text = other + f"FUNCTION F : INT VAR_INPUT a : INT; END_VAR {body} END_FUNCTION\n" + main("i : INT;", "i := F(1);")
    assert warned(text, "result") == []


def test_method_that_never_assigns_its_result_is_a_warning_but_not_fb_init() -> None:
    text = (
        "FUNCTION_BLOCK B\nVAR n : INT; END_VAR\nn := 1;\nMETHOD M : INT\nEND_METHOD\nMETHOD FB_Init : BOOL\n"
        "VAR_INPUT bInitRetains, bInCopyCode : BOOL; END_VAR\nEND_METHOD\nEND_FUNCTION_BLOCK\n"
    )
    assert warned(text + main("b : B;", "b();"), "result") == ["4:8: M never assigns its result; write M := ..."]


# ---- conversions of constants ----------------------------------------------------------------------------------------


def test_constants_that_every_system_converts_alike_are_no_warning() -> None:
    variables = "b : BYTE; w : WORD; i : INT; s : SINT; r : REAL; t : STRING := 'x'; l : LREAL := 300.5;"
    alike = [
        "b := REAL_TO_BYTE(255.0);",
        "w := REAL_TO_WORD(3.5);",
        "i := REAL_TO_INT(-2.4);",
        "i := REAL_TO_INT(2.5);",
        "i := STRING_TO_INT(' -12 ');",
        "s := STRING_TO_SINT('-128');",
        "w := STRING_TO_WORD('16#ffff');",
        "r := STRING_TO_REAL('-1.5E3');",
        "r := STRING_TO_REAL('3');",
        "i := STRING_TO_INT(t);",
        "b := LREAL_TO_BYTE(l);",
        "b := TO_BYTE('2#101');",
    ]
    assert warned(main(variables, "\n".join(alike)), "conversion") == []


def test_a_dialect_that_keeps_the_low_bits_warns_of_none_that_are_cut() -> None:
    text = main("b : BYTE; i : INT;", "b := REAL_TO_BYTE(300.5); i := REAL_TO_INT(1.0E9);")
    counts = {}
    for name in (None, "codesys"):
        found = check_sources([Source("f.st", text)], dialect=find_dialect(name)).diagnostics
        counts[name] = [d.code for d in found].count("conversion")
    assert counts == {None: 2, "codesys": 1}


# ---- names -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("of_test", "unused"), [("plant : Plant;", 0), ("number : INT;", 1)])
def test_program_that_only_a_test_runs_is_no_warning(of_test: str, unused: int) -> None:
    """It is there for the tests: the plant of a controller."""
    text = f"""PROGRAM Main VAR n : INT; END_VAR n := n + 1; END_PROGRAM
    PROGRAM Plant VAR n : INT; END_VAR n := n + 1; END_PROGRAM
    CONFIGURATION C RESOURCE R ON D TASK T(INTERVAL := T#10ms); PROGRAM M WITH T : Main; END_RESOURCE END_CONFIGURATION
    TEST 'both' VAR {of_test} END_VAR ASSERT_TRUE(TRUE); END_TEST"""
    assert len(warned(text, "unused")) == unused


BLOCK_FOR_C = """FUNCTION_BLOCK Valve
VAR n : INT; END_VAR
{attribute 'from_c'}
METHOD Open : BOOL
n := n + 1;
Open := TRUE;
END_METHOD
END_FUNCTION_BLOCK
FUNCTION_BLOCK Small EXTENDS Valve
END_FUNCTION_BLOCK
FUNCTION_BLOCK Group
VAR inner : Valve; END_VAR
END_FUNCTION_BLOCK
TYPE Pair : STRUCT left, right : Valve; END_STRUCT END_TYPE
"""


@pytest.mark.parametrize(
    ("declaration", "unused"),
    [
        ("v : Valve;", 0),
        ("v : Small;", 0),
        ("v : ARRAY[1..2] OF Valve;", 0),
        ("v : Pair;", 0),
        ("v : Group;", 0),
        ("{attribute 'from_c'} v : INT;", 0),
        ("v : POINTER TO Valve;", 1),
        ("v : INT;", 1),
        ("v : TON;", 1),
    ],
)
def test_what_only_c_uses_is_no_warning(declaration: str, unused: int) -> None:
    assert len(warned(main(declaration, ";", BLOCK_FOR_C), "unused")) == unused


def test_instance_that_c_cannot_reach_is_a_warning() -> None:
    """It is on the stack of a method."""
    text = "FUNCTION_BLOCK User METHOD Go VAR v : Valve; END_VAR END_METHOD END_FUNCTION_BLOCK\n"
    assert len(warned(main("u : User;", "u.Go();", BLOCK_FOR_C + text), "unused")) == 1


def test_every_warning_of_the_compiler_has_a_name() -> None:
    """Whatever is reported as a warning can be turned off."""
    used: set[object] = set()
    for path in Path(plctool.compiler.__file__).parent.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            name = getattr(node.func, "attr", "") if isinstance(node, ast.Call) else ""
            if isinstance(node, ast.Call) and name in ("warning", "_warn"):
                used |= {node.args[1].value} if isinstance(node.args[1], ast.Constant) else set()
    assert used - set(MEANINGS) == set()
    assert set(WARNINGS) - used == set()


def test_every_warning_is_in_the_documentation() -> None:
    text = (ROOT / "docs/language.md").read_text()
    rows = re.findall(r"^\| `([\w-]+)` \| (.*) \|$", text, re.MULTILINE)
    assert [(name, words.replace("`", "")) for name, words in rows] == list(WARNINGS.items())


def test_every_group_is_in_the_documentation() -> None:
    text = (ROOT / "docs/language.md").read_text()
    items = re.findall(r"^- `([\w-]+)`, [^:`]*: ((?:`[\w-]+`,?\s+)*`[\w-]+`)\.$", text, re.MULTILINE)
    listed = {group: re.findall(r"`([\w-]+)`", names) for group, names in items}
    assert listed == {group: [name for name in WARNINGS if GROUP_OF[name] == group] for group in GROUPS}


def test_every_lint_is_of_a_group() -> None:
    assert {lint.group for lint in LINTS} <= {*GROUPS, GUIDELINES}


def test_a_group_stands_for_its_warnings() -> None:
    numbers = [name for name in WARNINGS if GROUP_OF[name] == "numbers"]
    assert meant_by("numbers") == numbers
    assert warning_options(["numbers", "unused"]).disabled == {*numbers, "unused"}


def test_a_group_is_turned_off_by_option_and_by_pragma() -> None:
    assert codes(SUSPICIOUS, "dead-code") == ["narrowing"]
    assert codes(SUSPICIOUS, "Dead-Code, numbers") == []
    assert codes("{warning disable dead-code}\n" + SUSPICIOUS) == ["narrowing"]


# ---- one warning for one cause ----


@pytest.mark.parametrize(
    "loop", ["WHILE u >= 0 DO i := i + 1; END_WHILE;", "REPEAT i := i + 1; UNTIL u < 0 END_REPEAT;"]
)
def test_loop_whose_comparison_is_always_true_is_one_warning(loop: str) -> None:
    text = main("u : UINT; i : INT;", loop)
    assert codes(text) == ["always"]
    assert codes(text, "always") == ["endless"]  # which then is the only one that says it


def test_another_loop_that_never_ends_is_still_a_warning() -> None:
    text = main("u : UINT; i : INT;", "IF u >= 0 THEN WHILE i > 0 DO u := u + 1; END_WHILE; END_IF;")
    assert sorted(codes(text)) == ["always", "endless"]


def test_timer_that_is_only_given_a_time_is_one_warning() -> None:
    text = main("time : TIME := T#1s; t : TON := (PT := time);", "")
    assert codes(text) == ["uncalled"]
    assert codes(text, "uncalled") == ["unused"]


SUSPICIOUS = main("unused : INT; i : SINT; j : INT;", "i := j;\nRETURN;\ni := 1;")


def codes(text: str, *names: str) -> list[str]:
    return [d.code for d in check_sources([Source("f.st", text)], warnings=warning_options(names)).diagnostics]


def test_warnings_are_turned_off_by_name() -> None:
    assert codes(SUSPICIOUS) == ["unused", "narrowing", "unreachable"]
    assert codes(SUSPICIOUS, "unused") == ["narrowing", "unreachable"]
    assert codes(SUSPICIOUS, "unused,Narrowing") == ["unreachable"]
    assert codes(SUSPICIOUS, "unused", "narrowing, unreachable") == []


def test_unknown_name_of_a_warning_lists_the_names() -> None:
    names = r"access, address, always, assignment, bits, .*unused, widening, wrap, written-input\.$"
    with pytest.raises(UsageError, match=rf"no warning 'unusde'; the names are {names}"):
        warning_options(["narrowing,unusde"])


def test_warnings_may_be_errors_except_those_that_are_off() -> None:
    options = warning_options(["unused"], as_errors=True)
    result = check_sources([Source("f.st", SUSPICIOUS)], warnings=options)
    assert [(d.severity, d.code) for d in result.diagnostics] == [("error", "narrowing"), ("error", "unreachable")]
    assert result.program is None
    assert result.diagnostics[1].message == "this statement is never reached (an error because of --werror)"


def test_pragma_turns_a_warning_off_for_some_lines() -> None:
    text = main(
        "a : INT;\n{warning disable unused}\nb : INT;\n{ WARNING RESTORE Unused }\nc : INT;\n"
        "{warning disable C0371}\nd : INT;"
    )
    assert warned(text, "unused") == ["3:1: a is never used", "7:1: c is never used", "9:1: d is never used"]


def test_pragma_reaches_to_the_end_of_its_file_only() -> None:
    first = Source("a.st", "{warning disable result}\nFUNCTION F : INT END_FUNCTION\nFUNCTION G : INT END_FUNCTION")
    second = Source("b.st", "FUNCTION H : INT END_FUNCTION\n" + main("i : INT;", "i := F() + G() + H();"))
    assert [d.message[:1] for d in check_sources([first, second]).diagnostics if d.code == "result"] == ["H"]


def test_pragma_in_a_comment_or_string_does_nothing() -> None:
    text = main(
        "a : INT; s : STRING := '{warning disable unused}'; (* {warning disable unused} *)\nb : INT;", "s := '';"
    )
    assert len(warned(text, "unused")) == 2


@pytest.mark.parametrize(
    ("comparison", "said"),
    [
        ("w > i", "WORD and INT are compared as INT: large ones of WORD count as negative; convert one of them"),
        ("i = w", "INT and WORD are compared as INT: large ones of WORD count as negative; convert one of them"),
        ("dw < i", "DWORD and INT are compared as DWORD: negative ones count as large; convert one of them"),
        ("ul > l", "ULINT and LINT are compared as LINT: large ones of ULINT count as negative; convert one of them"),
        ("w > d", None),
        ("u > i", None),
        ("w > 5", None),
        ("dw > INT#5", None),
        ("w > u", None),
    ],
)
def test_signs_that_a_comparison_loses(comparison: str, said: str | None) -> None:
    variables = "w : WORD; i : INT; d : DINT; dw : DWORD; ul : ULINT; l : LINT; u : UINT; x : BOOL;"
    found = warned(main(variables, f"x := {comparison};"), "sign")
    assert [message.split(": ", 1)[1] for message in found] == [said] * (said is not None)
