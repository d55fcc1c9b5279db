"""Warnings of what is correct ST and hardly ever meant: each says what to write, and what is meant gets none."""

from __future__ import annotations

from pathlib import Path

import pytest
from front_support import check, main
from test_st_programs import PROGRAMS, checked

from plctool.compiler import check_with_tests, load_sources
from plctool.compiler.front import Source, check_sources

ROOT = Path(__file__).parents[2]
PITFALLS = ("always", "configuration", "endless", "integer-division", "shared")


def warned(text: str, code: str) -> list[str]:
    """`line:column: message` of the warnings of that name; the text has no errors."""
    result = check(text)
    assert result.program is not None, result.diagnostics
    return [f"{d.line}:{d.column}: {d.message}" for d in result.diagnostics if d.code == code]


def said(variables: str, body: str, code: str, before: str = "") -> list[str]:
    """The messages about PROGRAM Main."""
    return [m.split(": ", 1)[1] for m in warned(main(variables, body, before), code)]


# ---- integer-division ----------------------------------------------------------------------------------------------

NUMBERS = "i, j : INT; d : DINT; u : UINT; r : REAL; l : LREAL; w : WORD; t : TIME; x : BOOL;"
NUMBERS += " END_VAR VAR CONSTANT seven : INT := 7;"
INT_TO_REAL = (
    "this division of INT drops its fraction and only then becomes REAL; convert an operand: INT_TO_REAL(...) / ..."
)


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("r := i / j;", INT_TO_REAL),
        ("r := i / 2;", INT_TO_REAL),
        ("r := 1 + i / 2;", INT_TO_REAL),
        ("r := -(i / 2);", INT_TO_REAL),
        ("r := 2.5 * (i / j);", INT_TO_REAL),
        ("x := i / j > 2.5;", INT_TO_REAL),
        ("r := INT_TO_REAL(i / j);", INT_TO_REAL),
        ("r := TO_REAL(i / j);", INT_TO_REAL),
        ("l := d / 3;", INT_TO_REAL.replace("INT", "DINT").replace("REAL", "LREAL")),
        ("r := SQRT(INT_TO_REAL(i / j));", INT_TO_REAL),
        ("r := 1 / 3;", "this division of integers drops its fraction and gives 0; write 1.0 / 3"),
        ("r := i + 10 / 4;", "this division of integers drops its fraction and gives 2; write 10.0 / 4"),
        (
            "r := seven / 2;",
            "this division of integers drops its fraction and gives 3; convert an operand: INT_TO_REAL(...) / ...",
        ),
    ],
)
def test_an_integer_division_that_goes_into_a_real(body: str, expected: str) -> None:
    assert said(NUMBERS, body, "integer-division") == [expected]


@pytest.mark.parametrize(
    "body",
    [
        "r := INT_TO_REAL(i) / j;",
        "r := i / 2.0;",
        "r := i / INT_TO_REAL(j);",
        "r := 8 / 2;",
        "r := 7.0 / 2;",
        "r := INT_TO_REAL(7 / 2);",
        "r := i * j;",
        "r := i MOD 10;",
        "i := i / j;",
        "d := i / j; r := DINT_TO_REAL(d);",
        "r := i / 10 * 10;",  # rounding to tens
        "r := UDINT_TO_REAL(TIME_TO_UDINT(t) / 1000);",  # whole seconds
        "r := WORD_TO_REAL(w / 256);",  # the upper byte
    ],
)
def test_a_division_that_is_meant(body: str) -> None:
    assert not said(NUMBERS, body, "integer-division")


# ---- NOT of a number ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("condition", ["NOT i = 5", "x AND NOT i = 5"])
def test_not_of_a_number_that_is_compared(condition: str) -> None:
    expected = ["NOT comes before = and inverts the bits of i; write NOT (i = ...)"]
    assert said(NUMBERS, f"x := {condition};", "not") == expected


@pytest.mark.parametrize("condition", ["NOT (i = 5)", "(NOT i) = 5", "NOT x = (i = 5)", "5 = NOT i", "NOT w = 5"])
def test_not_that_is_meant(condition: str) -> None:
    assert not said(NUMBERS, f"x := {condition};", "not")


# ---- always --------------------------------------------------------------------------------------------------------

TYPES = "TYPE Small : INT (3..9); END_TYPE\nTYPE Color : (Red, Green); END_TYPE\n"
VALUES = "s : SINT; us : USINT; i : INT; u : UINT; b : BYTE; ul : ULINT; k : Small; e : Color; x : BOOL; r : REAL;"
NEVER_NEGATIVE = "a UINT is never negative; use a signed type such as DINT, or leave the comparison out"


@pytest.mark.parametrize(
    ("condition", "expected"),
    [
        ("u < 0", f"this is always FALSE: {NEVER_NEGATIVE}"),
        ("u >= 0", f"this is always TRUE: {NEVER_NEGATIVE}"),
        ("0 > u", f"this is always FALSE: {NEVER_NEGATIVE}"),
        ("0 <= u", f"this is always TRUE: {NEVER_NEGATIVE}"),
        ("u - 1 >= 0", f"this is always TRUE: {NEVER_NEGATIVE}"),
        ("u <> -1", f"this is always TRUE: {NEVER_NEGATIVE}"),
        ("b < 0", "this is always FALSE: a BYTE is never negative; use a signed type such as INT, "
                  "or leave the comparison out"),
        ("ul < 0", "this is always FALSE: a ULINT is never negative; use a signed type such as LINT, "
                   "or leave the comparison out"),
        ("us > 255", "this is always FALSE: a USINT is at most 255; use a larger type or another number"),
        ("us = 300", "this is always FALSE: a USINT is at most 255; use a larger type or another number"),
        ("s <= 127", "this is always TRUE: a SINT is at most 127; use a larger type or another number"),
        ("s > 127", "this is always FALSE: a SINT is at most 127; use a larger type or another number"),
        ("i < -32768", "this is always FALSE: an INT is at least -32768; use another type or another number"),
        ("i = 40000", "this is always FALSE: an INT is at most 32767; use a larger type or another number"),
        ("k > 9", "this is always FALSE: a Small is at most 9; use a larger type or another number"),
        ("k >= 3", "this is always TRUE: a Small is at least 3; use another type or another number"),
        ("GE(u, 0)", f"this is always TRUE: {NEVER_NEGATIVE}"),
    ],
)  # fmt: skip
def test_a_comparison_that_the_type_decides(condition: str, expected: str) -> None:
    assert said(VALUES, f"x := {condition};", "always", TYPES) == [expected]


@pytest.mark.parametrize(
    "condition",
    [
        "u > 0",
        "u <= 0",
        "u = 0",
        "us < 255",
        "us = 255",
        "s >= -127",
        "i <= 32766",
        "k > 3",
        "k <> 5",
        "u >= LIMIT_OF_PLANT",  # a constant may be changed
        "r >= 0",
        "e >= 0",
        "u >= us",
        "USINT_TO_INT(us) - 1 >= 0",
        "INT_TO_UINT(i) > 32767",
        "b = 16#FF",
        "(b AND 16#80) = 16#80",
    ],
)
def test_a_comparison_that_decides(condition: str) -> None:
    before = TYPES + "VAR_GLOBAL CONSTANT LIMIT_OF_PLANT : UINT := 0; END_VAR\n"
    assert not said(VALUES, f"x := {condition};", "always", before)


def test_a_generic_function_is_for_signed_numbers_as_well() -> None:
    generic = "FUNCTION Below : BOOL\nVAR_INPUT x : ANY_INT; END_VAR\nBelow := x < 0;\nEND_FUNCTION\n"
    assert not said(VALUES, "x := Below(u); x := Below(i);", "always", TYPES + generic)


# ---- endless -------------------------------------------------------------------------------------------------------

LOOPS = "i, j, n : INT; done, x : BOOL; a : ARRAY[0..9] OF INT; p : POINTER TO INT; t0 : TIME; tm : TON; s : STRING;"
HELPERS = """FUNCTION Twice : INT
VAR_INPUT x : INT; END_VAR
Twice := 2 * x;
END_FUNCTION
FUNCTION Change : INT
VAR_IN_OUT x : INT; END_VAR
x := x + 1;
Change := x;
END_FUNCTION
VAR_GLOBAL g : BOOL; start AT %IX0.0 : BOOL; END_VAR
"""
NOTHING = (
    "this loop never ends: nothing in it changes {}; change it in the body, or write IF to test once in each cycle"
)


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        (
            "WHILE TRUE DO i := i + 1; END_WHILE;",
            "this loop never ends: its condition is always TRUE; write what ends it, or EXIT in its body",
        ),
        (
            "REPEAT i := i + 1; UNTIL FALSE END_REPEAT;",
            "this loop never ends: its condition is always FALSE; write what ends it, or EXIT in its body",
        ),
        ("WHILE TRUE DO WHILE x DO x := FALSE; EXIT; END_WHILE; END_WHILE;", "its condition is always TRUE"),
        ("WHILE i < 10 DO j := j + 1; END_WHILE;", NOTHING.format("i")),
        ("WHILE i < n DO a[j] := i; END_WHILE;", NOTHING.format("i or n")),
        ("WHILE NOT done DO END_WHILE;", NOTHING.format("done")),
        ("REPEAT j := j + 1; UNTIL done END_REPEAT;", NOTHING.format("done")),
        ("WHILE a[i] <> 0 DO n := n + 1; END_WHILE;", NOTHING.format("a or i")),
        ("WHILE Twice(i) < 10 DO j := Twice(j); END_WHILE;", NOTHING.format("i")),
        (
            "WHILE TIME() - t0 < T#5ms DO i := i + 1; END_WHILE;",
            NOTHING.format("t0 or TIME(), which is the time of the cycle"),
        ),
        (
            "FOR i := 1 TO 10 DO i := 3; END_FOR;",
            "this loop never ends: its body sets i to 3 each time; leave that to the FOR",
        ),
        ("again: i := i + 1; JMP again;", "nothing leads around this JMP; put it into an IF"),
        ("again: j := j + 1; IF i < 10 THEN n := 1; JMP again; END_IF;", NOTHING.format("i")),
        ("again: IF TRUE THEN JMP again; END_IF;", "its condition is always TRUE"),
        ("WHILE i < 10 DO lab: j := j + 1; IF j < 5 THEN JMP lab; END_IF; END_WHILE;", NOTHING.format("i")),
    ],
)
def test_a_loop_that_cannot_end(body: str, expected: str) -> None:
    found = said(LOOPS, body, "endless", HELPERS)
    assert len(found) == 1
    assert expected in found[0]


@pytest.mark.parametrize(
    "body",
    [
        "WHILE TRUE DO i := i + 1; IF i > 5 THEN EXIT; END_IF; END_WHILE;",
        "WHILE TRUE DO i := i + 1; CASE i OF 5: EXIT; END_CASE; END_WHILE;",
        "WHILE TRUE DO IF x THEN RETURN; END_IF; END_WHILE;",
        "WHILE TRUE DO FOR j := 0 TO 3 DO IF x THEN RETURN; END_IF; END_FOR; END_WHILE;",
        "WHILE i < 10 DO i := i + 1; END_WHILE;",
        "WHILE i < 10 DO FOR i := i TO 3 DO j := 1; END_FOR; END_WHILE;",
        "WHILE i < 10 DO j := Change(i); END_WHILE;",
        "WHILE Change(i) < 10 DO j := 1; END_WHILE;",
        "p := ADR(i); WHILE i < 10 DO p^ := p^ + 1; END_WHILE;",
        "WHILE p^ < 10 DO j := 1; END_WHILE;",
        "WHILE a[i] <> 0 DO i := i + 1; END_WHILE;",
        "WHILE NOT done DO tm(IN := TRUE, Q => done); END_WHILE;",
        "WHILE g DO i := i + 1; END_WHILE;",  # another task may
        "WHILE start DO i := i + 1; END_WHILE;",
        "WHILE LEN(s) < 5 DO s := CONCAT(s, 'x'); END_WHILE;",
        "REPEAT i := i + 1; UNTIL i = 10 END_REPEAT;",
        "FOR i := 1 TO 10 DO i := 10; END_FOR;",
        "FOR i := 1 TO 10 DO IF x THEN i := 10; END_IF; END_FOR;",
        "WHILE FALSE DO i := 1; END_WHILE;",
        "REPEAT i := 1; UNTIL TRUE END_REPEAT;",
        "WHILE TRUE DO IF x THEN JMP out; END_IF; END_WHILE; out: i := 1;",
        "again: i := i + 1; IF i < 10 THEN JMP again; END_IF;",
        "again: i := i + 1; IF i > 10 THEN RETURN; END_IF; JMP again;",
        "again: i := i + 1; IF i > 10 THEN JMP out; END_IF; JMP again; out: ;",
        "WHILE i < 9 DO i := i + 1; again: IF x THEN CONTINUE; END_IF; JMP again; END_WHILE;",
        "again: tm(IN := TRUE); IF NOT tm.Q THEN JMP again; END_IF;",
        "FOR i := 1 TO 10 DO IF x THEN JMP lab; END_IF; i := 3; lab: j := 1; END_FOR;",
        "FOR i := 1 TO 10 DO IF x THEN CONTINUE; END_IF; i := 3; END_FOR;",
        "WHILE Twice(1) > 5 DO j := 1; END_WHILE;",
        "FOR i := 32760 TO 32767 DO j := j + 1; END_FOR;",  # ends at the limit of the type
    ],
)
def test_a_loop_that_may_end(body: str) -> None:
    assert not said(LOOPS, body, "endless", HELPERS)


def test_a_loop_of_a_block_may_wait_for_what_its_own_methods_change() -> None:
    block = (
        "FUNCTION_BLOCK F\nVAR n : INT; END_VAR\nMETHOD Step\nn := n + 1;\nEND_METHOD\n"
        "WHILE n < 5 DO\n{}\nEND_WHILE;\nEND_FUNCTION_BLOCK\n"
    )
    assert not said("f : F;", "f();", "endless", block.format("Step();"))
    assert said("f : F;", "f();", "endless", block.format("")) == [NOTHING.format("n")]


def test_a_loop_of_a_program_may_wait_for_what_its_actions_change() -> None:
    loop = "PROGRAM Main\nVAR n : INT; END_VAR\nWHILE n < 5 DO\n{}\nEND_WHILE;\n"
    text = loop + "ACTION Step:\nn := n + 1;\nEND_ACTION\nEND_PROGRAM\n"
    assert not warned(text.format("Step();"), "endless")
    assert len(warned(text.format(""), "endless")) == 1


# ---- pointer -------------------------------------------------------------------------------------------------------

POINTEES = (
    "TYPE Pair : STRUCT a : INT; b : REAL; END_STRUCT END_TYPE\n"
    "TYPE More EXTENDS Pair : STRUCT c : INT; END_STRUCT END_TYPE\n"
    "TYPE Color : (Red, Green); END_TYPE\n"
)
PLACES = (
    "i : INT; u : UINT; d : DINT; r : REAL; b : BYTE; w : WORD; x : BOOL; e : Color; s : STRING; ws : WSTRING;"
    "pr : Pair; mo : More; ai : ARRAY[0..3] OF INT; ar : ARRAY[0..3] OF REAL; ab : ARRAY[0..9] OF BYTE;"
    "q : POINTER TO REAL;"
)


@pytest.mark.parametrize(
    ("pointee", "variable", "found", "wanted"),
    [
        ("INT", "r", "REAL", "INT"),
        ("REAL", "i", "INT", "REAL"),
        ("DINT", "i", "INT", "DINT"),
        ("UINT", "i", "INT", "UINT"),
        ("REAL", "ai", "ARRAY[0..3] OF INT", "REAL"),
        ("ARRAY[0..1] OF REAL", "ai", "ARRAY[0..3] OF INT", "ARRAY[0..1] OF REAL"),
        ("REAL", "pr", "Pair", "REAL"),
        ("STRING", "ws", "WSTRING[80]", "STRING[80]"),
        ("INT", "s", "STRING[80]", "INT"),
        ("INT", "x", "BOOL", "INT"),
    ],
)
def test_the_address_of_another_type(pointee: str, variable: str, found: str, wanted: str) -> None:
    expected = (
        f"what POINTER TO {wanted} points to is read as {wanted}, but this is {found}; "
        f"declare POINTER TO {found}, or convert the value"
    )
    assert said(f"{PLACES}p : POINTER TO {pointee};", f"p := ADR({variable});", "pointer", POINTEES) == [expected]


@pytest.mark.parametrize(
    ("pointee", "variable"),
    [
        ("INT", "i"),
        ("INT", "ai"),
        ("INT", "ai[2]"),
        ("ARRAY[0..32000] OF INT", "ai"),
        ("INT", "e"),
        ("INT", "pr"),  # begins with one
        ("Pair", "mo"),
        ("More", "pr"),
        ("Pair", "i"),
        ("BYTE", "r"),
        ("DWORD", "r"),
        ("ARRAY[0..32000] OF BYTE", "pr"),
        ("REAL", "w"),
        ("Pair", "ab"),  # what came over a line
        ("STRING", "ab"),
        ("STRING[255]", "s"),
        ("BYTE", "s"),
        ("POINTER TO REAL", "q"),
    ],
)
def test_an_address_that_is_meant(pointee: str, variable: str) -> None:
    assert not said(f"{PLACES}p : POINTER TO {pointee};", f"p := ADR({variable});", "pointer", POINTEES)


# ---- configuration -------------------------------------------------------------------------------------------------

ONE = "PROGRAM {}\nVAR n : INT; END_VAR\nn := n + 1;\nEND_PROGRAM\n"
TWO = ONE.format("A") + ONE.format("B")


def configured(*lines: str) -> list[str]:
    text = TWO + "CONFIGURATION C\n" + "".join(f"{line}\n" for line in lines) + "END_CONFIGURATION\n"
    return [m.split(": ", 1)[1] for m in warned(text, "configuration")]


def test_a_task_without_time_and_event() -> None:
    assert configured("TASK t(PRIORITY := 1);", "PROGRAM a WITH t : A;") == [
        "the task t has no INTERVAL, SINGLE, LEVEL or EVENT, so it runs whenever there is time; "
        "write INTERVAL := T#10ms, or T#0s if that is meant"
    ]
    assert not configured("TASK t(INTERVAL := T#0s);", "PROGRAM a WITH t : A;")
    assert not configured("TASK t(INTERVAL := T#1s);", "PROGRAM a WITH t : A;")
    assert not configured("TASK t(EVENT := 'door');", "PROGRAM a WITH t : A;")
    assert not configured("VAR_GLOBAL g : BOOL; END_VAR", "TASK t(SINGLE := g);", "PROGRAM a WITH t : A;")


def test_a_program_without_a_task() -> None:
    assert configured("TASK t(INTERVAL := T#1s);", "PROGRAM a WITH t : A;", "PROGRAM b : B;") == [
        "the program b has no task, so it runs whenever there is time; write PROGRAM b WITH t : B;"
    ]
    assert not configured("PROGRAM a : A;", "PROGRAM b : B;")  # all of them run in the background


def test_a_task_without_a_program() -> None:
    assert configured("TASK t(INTERVAL := T#1s);") == ["the task t runs no program; write PROGRAM Name WITH t : Type;"]


def test_what_is_wrong_already_is_not_said_twice() -> None:
    text = TWO + "CONFIGURATION C\nTASK t(INTERVAL := T#1s);\nPROGRAM a WITH u : A;\nEND_CONFIGURATION\n"
    assert [d.code for d in check(text).diagnostics if d.code != "unused"] == ["unknown"]


# ---- shared --------------------------------------------------------------------------------------------------------

SHARED = """TYPE Pair : STRUCT a, b : INT; END_STRUCT END_TYPE
FUNCTION_BLOCK Count
VAR_OUTPUT n : INT; END_VAR
METHOD Last : INT
Last := n;
END_METHOD
METHOD Clear
n := 0;
END_METHOD
n := n + 1;
END_FUNCTION_BLOCK
FUNCTION Raise
VAR_IN_OUT x : INT; END_VAR
x := x + 1;
END_FUNCTION
FUNCTION See : INT
VAR_IN_OUT x : INT; END_VAR
See := x;
END_FUNCTION
FUNCTION Give
VAR_OUTPUT x : INT; END_VAR VAR_STAT n : INT; END_VAR
x := 1; n := n + 1;
END_FUNCTION
FUNCTION SetG
g := 5;
END_FUNCTION
VAR_GLOBAL
g : INT; p : Pair; a : ARRAY[0..3] OF INT; w : WORD; c : Count;
m0 AT %MX0.0 : BOOL; m1 AT %MX0.1 : BOOL; m8 AT %MX1.0 : BOOL; mw AT %MW0 : WORD;
q0 AT %QX0.0 : BOOL;
END_VAR
"""


def tasks(first: str, second: str) -> list[str]:
    """What is said of two programs in two tasks; i is a variable of each."""
    text = SHARED + "".join(
        f"PROGRAM {name}\nVAR i : INT; END_VAR\n{body}\nEND_PROGRAM\n" for name, body in (("A", first), ("B", second))
    )
    text += "CONFIGURATION C\nTASK fast(INTERVAL := T#1ms);\nTASK slow(INTERVAL := T#1s);\n"
    text += "PROGRAM pa WITH fast : A;\nPROGRAM pb WITH slow : B;\nEND_CONFIGURATION\n"
    return warned(text, "shared")


def test_two_tasks_write_one_global() -> None:
    assert tasks("g := 1;", "i := g;\ng := 2;") == [
        "39:1: g is written by the tasks fast (line 34) and slow, and each may undo what the other wrote; "
        "let one of them write it, or give each a variable of its own"
    ]


def test_two_tasks_write_one_byte_of_memory() -> None:
    assert tasks("m0 := TRUE;", "m1 := TRUE;") == [
        "38:1: slow writes m1 in the same byte as m0, which fast writes (line 34), and each may undo what the other "
        "wrote; put them into different bytes"
    ]


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("g := 1;", "FOR g := 1 TO 3 DO i := g; END_FOR;"),
        ("g := 1;", "Raise(g);"),
        ("g := 1;", "Give(x => g);"),
        ("g := 1;", "SetG();"),
        ("SetG();", "SetG();"),
        ("Give();", "Give();"),
        ("p.a := 1;", "p.a := 2;"),
        ("p.a := 1;", "p.a := 1; p.b := 2;"),
        ("a[1] := 1;", "a[i] := 2;"),
        ("w.3 := TRUE;", "w.4 := TRUE;"),
        ("c();", "c();"),
        ("c();", "c.Clear();"),
        ("c();", "i := c.Last(); c.Clear();"),
        ("m0 := TRUE;", "mw := 5;"),
        ("%MX0.5 := TRUE;", "%MX0.6 := TRUE;"),
        ("pb.i := 1;", "i := 2;"),
    ],
)
def test_what_counts_as_a_write(first: str, second: str) -> None:
    assert len(tasks(first, second)) == 1


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("g := 1;", "i := g;"),
        ("g := 1;", "i := See(g);"),
        ("p.a := 1;", "p.b := 2;"),
        ("a[1] := 1;", "a[2] := 2;"),
        ("m0 := TRUE;", "m8 := TRUE;"),
        ("q0 := TRUE;", "q0 := FALSE;"),  # each task has an image of the outputs; `shared-output` warns of this
        ("c();", "i := c.Last();"),
        ("c();", "i := c.n;"),
        ("i := 1;", "i := 2;"),
        ("g := 1; SetG();", "i := 2;"),
    ],
)
def test_what_is_no_write_of_both(first: str, second: str) -> None:
    assert not tasks(first, second)


def test_one_task_may_write_what_it_likes() -> None:
    assert not warned(SHARED + main("i : INT;", "g := 1; g := 2; m0 := TRUE; m1 := TRUE;"), "shared")


# ---- no false alarms -----------------------------------------------------------------------------------------------

IDIOMS = """FUNCTION RealBits : DWORD
VAR_INPUT x : REAL; END_VAR
VAR pt : POINTER TO DWORD; END_VAR
pt := ADR(x);
RealBits := pt^;
END_FUNCTION
FUNCTION Seconds : REAL
VAR_INPUT t : TIME; END_VAR
Seconds := DWORD_TO_REAL(TIME_TO_DWORD(t)) / 1000.0;
END_FUNCTION
FUNCTION Days : REAL
VAR_INPUT d : DATE; END_VAR
Days := DWORD_TO_REAL(DATE_TO_DWORD(d) / 86400);
END_FUNCTION
FUNCTION Gcd : INT
VAR_INPUT a, b : INT; END_VAR
VAR t : INT; x, y : INT; END_VAR
x := a;
y := b;
WHILE y <> 0 DO
t := x MOD y;
x := y;
y := t;
END_WHILE;
Gcd := x;
END_FUNCTION
FUNCTION Upper : INT
VAR_IN_OUT text : STRING; END_VAR
VAR pt : POINTER TO BYTE; pos : INT; END_VAR
pt := ADR(text);
WHILE pt^ <> 0 DO
IF pt^ > 96 AND pt^ < 123 THEN pt^ := pt^ - 32; END_IF;
pt := pt + 1;
pos := pos + 1;
END_WHILE;
Upper := pos;
END_FUNCTION
FUNCTION SumOf : REAL
VAR_INPUT pt : POINTER TO ARRAY[0..32000] OF REAL; size : UINT; END_VAR
VAR i, stop : UINT; END_VAR
stop := (size - SIZEOF(pt)) / SIZEOF(REAL#0.0);
FOR i := 0 TO stop DO SumOf := SumOf + pt^[i]; END_FOR;
SumOf := SumOf / UINT_TO_REAL(stop + 1);
END_FUNCTION
FUNCTION Floor2 : DINT
VAR_INPUT x : REAL; END_VAR
Floor2 := REAL_TO_DINT(x);
IF DINT_TO_REAL(Floor2) > x THEN Floor2 := Floor2 - 1; END_IF;
END_FUNCTION
"""
USE = (
    "r := Seconds(T#1s) + Days(D#2024-01-01) + SumOf(ADR(v), SIZEOF(v)); i := Gcd(i, 4) + Upper(s); d := RealBits(r);"
    "f := Floor2(r);"
)


def test_what_libraries_do_is_not_warned_of() -> None:
    text = main("r : REAL; i : INT; s : STRING; d : DWORD; f : DINT; v : ARRAY[1..5] OF REAL;", USE, IDIOMS)
    found = [d for d in check(text).diagnostics if d.code in (*PITFALLS, "pointer", "no-effect")]
    assert not found


@pytest.mark.parametrize("name", ["batch", "blink", "five-languages", "tanks", "traffic_light"])
def test_the_examples_have_no_pitfalls(name: str) -> None:
    found = check_with_tests(load_sources([ROOT / "examples" / name])).diagnostics
    assert not [d for d in found if d.code in (*PITFALLS, "pointer", "no-effect", "pragma")]


def test_the_programs_of_the_tests_have_no_pitfalls() -> None:
    found = []
    for path in [*PROGRAMS, *sorted((ROOT / "bench/programs").glob("*.st"))]:
        found += checked(path).diagnostics
    assert not [d for d in found if d.code in PITFALLS and d.severity == "warning"]


def test_the_standard_library_has_no_pitfalls() -> None:
    """As if it belonged to the program."""
    folder = ROOT / "host/plctool/stdlib"
    sources = [Source(path.name, path.read_text("latin-1")) for path in sorted(folder.glob("*.st"))]
    found = check_sources([*sources, Source("main.st", main("x : BOOL;", "x := TRUE;"))]).diagnostics
    assert not [d for d in found if d.code in (*PITFALLS, "pointer", "qualifier")]
