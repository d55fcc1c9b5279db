"""Slips of those who know C, Python, Siemens, ladder diagrams or a spreadsheet: each message says what to write.

All were written down before their messages were looked at.
"""

from __future__ import annotations

import pytest
from front_support import check, main, messages

VARIABLES = (
    "a, b : INT; on : BOOL; r : REAL; s : STRING; t : TON; tm : TIME; arr : ARRAY[1..9] OF INT; "
    "m : ARRAY[1..3, 1..3] OF INT;"
)
TASK = "PROGRAM Main\nEND_PROGRAM\nCONFIGURATION C\nTASK T1(INTERVAL := T#10ms);\n"
BLOCK = "FUNCTION_BLOCK B\nEND_FUNCTION_BLOCK\n"
STRUCTURE = "a structure is declared TYPE P : STRUCT ... END_STRUCT; END_TYPE"
BODY = 5  # the line where a case stands


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("++a;", ["1: there is no ++; write a := a + 1"]),
        ("a--;", ["1: there is no --; write a := a - 1"]),
        ("a -= b;", ["1: there is no -=; write a := a - b"]),
        ("a *= 2;", ["1: there is no *=; write a := a * 2"]),
        ("b := p->x;", ["1: -> is written ^. here: p^.x"]),
        ('"a" := 1;', ["1: a name is written without quotes: a"]),
        ("#define MAX 10", ["1: # has no place in a program; constants are declared in VAR CONSTANT ... END_VAR"]),
        (
            "#include <math.h>",
            ["1: # has no place in a program; all sources of a program are compiled together; leave it out"],
        ),
        ("IF a = 1 THEN\nb := 1;\nELIF a = 2 THEN\nb := 2;\nEND_IF;", ["3: ELIF is written ELSIF"]),
        ("def foo(x):", ["1: a function is declared FUNCTION foo : INT ... END_FUNCTION, outside of the PROGRAM"]),
        ("import math", ["1: all sources and libraries of a program are compiled together; nothing is imported"]),
        ("IF a > 3:\nb := 1;\nEND_IF;", ["1: the condition of IF ends with THEN, not with a colon"]),
        ("while on:\na := 1;\nEND_WHILE;", ["1: the condition of WHILE ends with DO, not with a colon"]),
        ("t(IN := on, PT := S5T#2s);", ["1: a duration is written T#2s, not S5T#2s"]),
        ("REGION Pump\na := 1;", ["1: there is no REGION; write a comment"]),
        ("DB10.DBW2 := 3;", ["1: unknown name DB10; there are no data blocks: declare a variable in VAR_GLOBAL"]),
        ("a := MW10;", ["1: unknown name MW10; an address begins with %: %MW10"]),
        ("on := E0.1;", ["1: unknown name E0; an address begins with %: %I0"]),
        ("SET on;", ["1: write on := TRUE;"]),
        ("RESET on;", ["1: write on := FALSE;"]),
        (
            "b := IF(a > 3, 1, 2);",
            ["1: a choice between two values is written SEL(condition, value_if_false, value_if_true)"],
        ),
        ("b := MAX(a; b);", ["1: arguments are separated by commas"]),
        ("r := 50%;", ["1: % has no place in a program; 50 % is written 0.5"]),
        ("s := s & 'x';", ["1: strings are joined by CONCAT(a, b), not by &"]),
        ("b := SUM(arr[1..3]);", ["1: an index is one number; for several elements write a loop"]),
        ("VAR_STATIC\nz : INT;\nEND_VAR\na := 1;", ["1: VAR_STATIC is written VAR_STAT"]),
        ("FOR a := 1 TO 3 DO\nb := 1;\nEND_FRO;\na := 1;", ["3: END_FRO is written END_FOR"]),
        (
            "REPEAT a := a + 1; UNTIL a > 3 DO END_REPEAT;",
            ["1: the condition of UNTIL ends with END_REPEAT, without DO"],
        ),
        (
            "TASK Fast(INTERVAL := T#10ms);",
            ["1: a task is declared in CONFIGURATION ... END_CONFIGURATION, outside of the PROGRAM"],
        ),
        ("tm := T#5sec;", ["1: 5sec is not a duration such as 1h30m or 2.5s; its units are d, h, m, s, ms, us and ns"]),
        ("tm := T#5 s;", ["1: a duration has no blank: T#5s"]),
        ("tm := T#1,5s;", ["1: a duration is written with a point: T#1.5s"]),
        ("tm := MAX(T#1,5s);", ["1: a duration is written with a point: T#1.5s"]),
        ("tm := T#01:30:00;", ["1: a duration is written with its units: T#1h30m5s"]),
        ("a := 1\ns := 'x';", ["1: expected ; after the statement"]),
        ("FOR a := 1 TO 10\ns := 'x';\nEND_FOR;", ["1: expected DO before the body of the loop"]),
        ("IF a = 1\ns := 'x';\nEND_IF;", ["1: expected THEN after the condition"]),
        ("t(IN := on PT := T#1s);", ["1: inputs are separated by commas"]),
        ("REPEAT\na := a + 1;\nUNTIL on;\nb := 1;", ["4: END_REPEAT missing for the REPEAT in line 5"]),
        ("tm := '5s';", ["1: STRING[2] does not fit TIME; a duration is written without quotes: T#5s"]),
        ("on := tm > 5;", ["1: > cannot compare TIME with INT; a duration is written T#5ms"]),
        ("on := t.ET >= 500;", ["1: >= cannot compare TIME with INT; a duration is written T#500ms"]),
        ("arr := 0;", ["1: an integer does not fit ARRAY[1..9] OF INT; assign to its elements in a loop"]),
        ("m[1][2] := 3;", ["1: ARRAY[1..3,1..3] OF INT needs 2 indices, not 1; write [i, j]"]),
        ("s := '5$';", ["1: this string is not closed before the end of the line; a $ in a string is written $$"]),
        (
            "on := t(IN := on, PT := T#5s);",
            ["1: a call of the function block TON is a statement and has no value; call it first, then read t.Q"],
        ),
        ("on := TON.Q;", ["1: TON is a function block type, not a value; declare an instance of it"]),
        ("t(IN = on, PT := T#5s);", ["1: the input IN is given with :=, not with ="]),
        ("t(INPUT := on);", ["1: TON has no parameter INPUT; it has IN, PT, Q, ET"]),
        ("t;", ["1: t is an instance; a call of it is written t();"]),
        (
            "IF on THEN\na := 1;\nESLE\na := 2;\nEND_IF;",
            ["3: expected ; after the statement; did you mean ELSE for ESLE?"],
        ),
        (
            "REPEAT\na := a + 1;\nUNTILL on\nEND_REPEAT;",
            [
                "4: END_REPEAT has no place here; did you mean UNTIL for UNTILL?",
                "5: expected UNTIL, found END_PROGRAM; did you mean UNTIL for UNTILL?",
            ],
        ),
        ("FRO a := 1 TO 3 DO\nb := a;", ["1: expected ; after the statement; did you mean FOR for FRO?"]),
        ("on := on ADN on;", ["1: expected ; after the statement; did you mean AND for ADN?"]),
        ("IF on THEN\na := 1;\nFI;", ["3: FI is written END_IF"]),
        ("WHILE on DO\na := 1;\nWEND;", ["3: WEND is written END_WHILE"]),
        (
            "FOR a := 1 TO 3 DO\nb := 1;\nNEXT a;",
            ["3: NEXT a is written END_FOR", "4: END_FOR missing for the FOR in line 5"],
        ),
        ("IF on THEN\na := 1;\nEND;", ["3: END is written END_IF"]),
        ("LOOP\na := 1;", ["1: a task runs its program again and again; a loop within one cycle is FOR or WHILE"]),
        ("r := POWER(r, 2.0);", ["1: unknown function POWER; write a ** b"]),
        ("s := str(a);", ["1: unknown function str; write TO_STRING"]),
        ("r := SQR(r);", ["1: unknown function SQR; a square is written a * a; SQRT is the root"]),
        ("RESET(on);", ["1: unknown function RESET; a BOOL is reset by name := FALSE;"]),
        ("SET(on);", ["1: unknown function SET; a BOOL is set by name := TRUE;"]),
        ("t.start();", ["1: TON has no method start; write t(IN := ..., PT := ...)"]),
        ("t.Start(T#5s);", ["1: TON has no method Start; write t(IN := ..., PT := ...)"]),
        ("s := 'n=' & a;", ["1: strings are joined by CONCAT(a, b), not by &"]),
        ("IF t THEN a := 1; END_IF;", ["1: TON does not fit BOOL; write t.Q"]),
        (
            "CASE s OF 'a': a := 1; END_CASE;",
            ["1: CASE needs an integer or an enumeration, not STRING[80]; write IF"],
        ),
        ("CASE a OF\n1: b := 1;\nWHEN 2: b := 2;\nEND_CASE;", ["3: a branch of a CASE begins with its value: 2: ..."]),
        ("a := Color::Red;", ["1: a value of an enumeration is written Color.Red, as is a member"]),
        ("s := 5;", ["1: an integer does not fit STRING[80]; write '5'"]),
        ("a := arr[1, 2];", ["1: there is 1 index too many"]),
        ("a := arr.length;", ["1: ARRAY[1..9] OF INT has no members; its last index is UPPER_BOUND(..., 1)"]),
        (
            "a := len(arr);",
            ["1: ARRAY[1..9] OF INT does not fit STRING[255]; the last index of an array is UPPER_BOUND(..., 1)"],
        ),
    ],
)
def test_a_slip_in_a_body(body: str, said: list[str]) -> None:
    found = messages(f"PROGRAM Main\nVAR\n{VARIABLES}\nEND_VAR\n{body}\nEND_PROGRAM\n")
    assert [f"{int(m.split(':')[0]) - BODY + 1}: {m.split(': ', 1)[1]}" for m in found] == said


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("c : ARRAY[1 TO 9] OF INT;", "the bounds of an array are written 1..9"),
        ("c : ARRAY[1.9] OF INT;", "the bounds of an array are written 1..9"),
        ("c : ARRAY[1:9] OF INT;", "the bounds of an array are written 1..9"),
        (
            "c : ARRAY[1..3] OF INT := (1, 2, 3);",
            "(name := value) does not initialise ARRAY[1..3] OF INT; the values of an array are written in brackets",
        ),
        ("c : ARRAY[1..a] OF INT;", "a constant is needed here; declare a in VAR CONSTANT"),
        ("DIM c AS FLOAT;", "a variable is declared with its name first: c : REAL;"),
        ("c AS INT;", "a variable is declared with its name first: c : INT;"),
        ("RETAIN c : INT;", "variables of this kind are declared in VAR RETAIN ... END_VAR"),
        ("c AT IX0.0 : BOOL;", "an address begins with %: %IX0.0"),
        ("c AT %IX0.8 : BOOL;", "%IX0.8 is not an address such as %IX0.3 or %QW2; a byte has the bits 0 to 7"),
        ("c AT %IW0 : BOOL;", "a BOOL is at a bit such as %IX0.3, %IW0 has 16"),
        ("c AT %I0.0 : INT;", "%I0.0 is a bit, INT is not; write %IW and a number"),
        ("c AT %E0.0 : BOOL;", "% has no place in a program; inputs (E) are at %I"),
        ("c AT %AW0 : INT;", "% has no place in a program; outputs (A) are at %Q"),
        (
            "c @ %IX0.0 : BOOL;",
            "@ has no place in a program; a variable at an address is written name AT %IX0.0 : BOOL;",
        ),
        ("INT c[10];", "an array is declared c : ARRAY[0..9] OF INT;"),
        ("c : ARRAY[1..3][1..3] OF INT;", "an array of two dimensions is declared ARRAY[1..3, 1..3]"),
        ("c : INT RETAIN;", "variables of this kind are declared in VAR RETAIN ... END_VAR"),
        ("c : REF INT;", "a pointer is declared POINTER TO INT, a reference REFERENCE TO INT"),
        ("c : PTR TO INT;", "a pointer is declared POINTER TO INT, a reference REFERENCE TO INT"),
        ("c : INT := d; END_VAR VAR d : INT;", "d is declared below; move that line up"),
        ("c : STRING 20;", "the length of a STRING is written STRING[20]"),
    ],
)
def test_a_slip_in_a_declaration(line: str, said: str) -> None:
    found = messages(f"PROGRAM Main\nVAR\n{VARIABLES}\n{line}\nEND_VAR\na := 1;\nEND_PROGRAM\n")
    assert [m.split(": ", 1)[1] for m in found] == [said]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("FUNCTION_BLOCK F\nVARINPUT a : INT; END_VAR\nEND_FUNCTION_BLOCK\n", ["2:1: VARINPUT is written VAR_INPUT"]),
        ("FUNTION F : INT\nF := 1;\nEND_FUNCTION\n", ["1:1: FUNTION is written FUNCTION"]),
        ("FUNCTION BLOCK F\nEND_FUNCTION_BLOCK\n", ["1:10: FUNCTION BLOCK is written FUNCTION_BLOCK"]),
        ("FUNCTION F INT\nF := 1;\nEND_FUNCTION\n", ["1:1: the type of the result follows a colon: FUNCTION F : INT"]),
        ("TYPE STRUCT P\nx : INT;\nEND_STRUCT\nEND_TYPE\n", [f"1:6: {STRUCTURE}"]),
        ("TYPE P :\nx : INT;\nEND_TYPE\n", [f"2:3: {STRUCTURE}"]),
        ("ENUM E (A, B);\n", ["1:1: an enumeration is declared TYPE E : (A, B); END_TYPE"]),
        ("TYPE E : (A; B); END_TYPE\n", ["1:12: the values of an enumeration are separated by commas"]),
        (
            "TYPE P : STRUCT x, y : REAL; END_STRUCT END_TYPE\nVAR_GLOBAL p : P := (1.0, 2.0); END_VAR\n",
            ["2:22: the members of P are given by name: (x := ..., y := ...)"],
        ),
        (
            f"{BLOCK}FUNCTION_BLOCK C : B\nVAR x : INT; END_VAR\nEND_FUNCTION_BLOCK\n",
            ["3:18: what is derived from another one is written EXTENDS, not with a colon"],
        ),
        (
            f"{BLOCK}FUNCTION_BLOCK C EXTEND B\nVAR x : INT; END_VAR\nEND_FUNCTION_BLOCK\n",
            ["3:18: EXTEND is written EXTENDS"],
        ),
        (
            f"{BLOCK}FUNCTION_BLOCK C(B)\nEND_FUNCTION_BLOCK\n",
            ["3:17: a block that is derived is written FUNCTION_BLOCK C EXTENDS B"],
        ),
        (
            "FUNCTION_BLOCK B\nMETHOD INT M()\nEND_METHOD\nEND_FUNCTION_BLOCK\n",
            ["2:8: the type of the result follows the name: METHOD M : INT"],
        ),
        (
            f"{BLOCK}METHOD PUBLIC B.Start : BOOL\nStart := TRUE;\nEND_METHOD\n",
            [
                "3:15: a METHOD stands in its FUNCTION_BLOCK, or right after it without its name: METHOD PUBLIC Start",
            ],
        ),
        (
            f"{BLOCK}METHOD B.Stop\nEND_METHOD\n",
            ["3:8: a METHOD stands in its FUNCTION_BLOCK, or right after it without its name: METHOD Stop"],
        ),
        (
            f"{BLOCK}ACTION B.Act :\nEND_ACTION\n",
            ["3:8: an ACTION stands in its FUNCTION_BLOCK, or right after it without its name: ACTION Act"],
        ),
        (
            f"{BLOCK}PROPERTY B.Speed : INT\nEND_PROPERTY\n",
            ["3:10: a PROPERTY stands in its FUNCTION_BLOCK, or right after it without its name: PROPERTY Speed"],
        ),
        (
            "FUNCTION_BLOCK B\nVIRTUAL METHOD M\nEND_METHOD\nEND_FUNCTION_BLOCK\n",
            ["2:1: every method can be overridden; leave VIRTUAL out"],
        ),
        (
            "PROGRAM Main\nFUNCTION F : INT\nF := 1;\nEND_FUNCTION\nEND_PROGRAM\n",
            ["2:1: FUNCTION stands outside of the PROGRAM"],
        ),
        (
            "FUNCTION F : INT\nF := 1;\nEND_FUNCTION\nPROGRAM Main\nVAR x : INT; END_VAR\nx := F;\nEND_PROGRAM\n",
            ["6:6: F is a function, not a value; a call of it is written F()"],
        ),
        (
            "PROGRAM Main\nVAR_EXTERNAL g : INT; END_VAR\ng := g + 1;\nEND_PROGRAM\n",
            ["2:14: there is no VAR_GLOBAL g"],
        ),
        ("STRUCT P\nx : INT;\nEND_STRUCT\n", ["1:1: a structure is declared TYPE P : STRUCT ... END_STRUCT; END_TYPE"]),
        ("PROGRAM Main\nENDPROGRAM\n", ["2:1: ENDPROGRAM is written END_PROGRAM"]),
        (
            "PROGRAM Main\nVAR_GLOBAL a : INT; END_VAR\na := 1;\nEND_PROGRAM\n",
            ["2:1: VAR_GLOBAL stands outside of the PROGRAM"],
        ),
        (
            "VAR a : INT; END_VAR\nPROGRAM Main\nEND_PROGRAM\n",
            ["1:1: VAR stands in a PROGRAM, FUNCTION or FUNCTION_BLOCK; for all of them write VAR_GLOBAL"],
        ),
        ("VARGLOBAL a : INT; END_VAR\nPROGRAM Main\nEND_PROGRAM\n", ["1:1: VARGLOBAL is written VAR_GLOBAL"]),
        (
            "PROGRAM Main\nVAR_CONSTANT a : INT := 1; END_VAR\nEND_PROGRAM\n",
            ["2:1: VAR_CONSTANT is written VAR CONSTANT"],
        ),
        (
            "PROGRAM Main\nCONSTANT VAR a : INT := 1; END_VAR\nEND_PROGRAM\n",
            ["2:1: CONSTANT comes after VAR: VAR CONSTANT", "2:9: expected ; after the statement"],
        ),
        (
            TASK + "PROGRAM One WITH T2 : Main;\nEND_CONFIGURATION\n",
            ["5:18: there is no task T2; there is T1"],
        ),
        (
            TASK + "PROGRAM Main WITH T1;\nEND_CONFIGURATION\n",
            ["5:21: an instance of a program is declared PROGRAM Main1 WITH T1 : Main;"],
        ),
        (
            TASK + "PROGRAM One : Main WITH T1;\nEND_CONFIGURATION\n",
            ["5:20: an instance of a program is declared PROGRAM One WITH T1 : Main;"],
        ),
        ("TYPE E : {A, B}; END_TYPE\n", ["1:10: an enumeration is written (A, B)"]),
        ("typedef INT Speed;\n", ["1:1: a type is declared TYPE Speed : INT; END_TYPE"]),
        ("class Motor:\n", ["1:1: a class is written FUNCTION_BLOCK Motor ... END_FUNCTION_BLOCK"]),
        ("PROCEDURE Foo\nEND_PROCEDURE\n", ["1:1: a procedure is written FUNCTION Foo ... END_FUNCTION"]),
        (
            "FUNCTION F(x : INT) : INT\nF := x;\nEND_FUNCTION\n",
            ["1:11: inputs are declared after the first line: VAR_INPUT x : ... END_VAR"],
        ),
        ("void main() {\n}\n", ["1:1: a program is written PROGRAM Main ... END_PROGRAM"]),
    ],
)
def test_a_slip_in_a_unit(text: str, said: list[str]) -> None:
    assert messages(text) == said


def test_a_name_that_is_declared_is_no_misspelt_keyword() -> None:
    text = "PROGRAM Main\nVAR form, end : INT; END_VAR\nIF form = 1 THEN\nend := form\nend := 1;\nEND_PROGRAM\n"
    assert messages(text) == [
        "4:12: expected ; after the statement",
        "6:1: END_IF missing for the IF in line 3",
    ]


def test_a_label_that_is_a_difference_is_one_value() -> None:
    text = "PROGRAM Main\nVAR a : INT; END_VAR\nCASE a OF\n6-9: a := 1;\n9-6: a := 2;\nEND_CASE;\nEND_PROGRAM\n"
    assert messages(text, "warning") == ["4:2: this is the one value -3; a range is written 6..9"]


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (
            "r := ADR(x);",
            ["a pointer has 64 bits, INT 16; a reference is given REF= x, an address is kept in an LWORD"],
        ),
        ("p := x;", ["a pointer has 64 bits, INT 16; the address is written ADR(x)"]),
        ("x := p;", ["a pointer has 64 bits, INT 16; what it points to is written p^"]),
        ("w := p;", ["a pointer has 64 bits, DWORD 32; use LWORD"]),
    ],
)
def test_a_pointer_and_what_it_points_to(body: str, said: list[str]) -> None:
    variables = "x : INT; w : DWORD; p : POINTER TO INT; r : REFERENCE TO INT;"
    found = check(main(variables, body)).diagnostics
    assert [d.message for d in found if d.code == "narrowing"] == said


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("r REF= ADR(x);", "REF= takes the variable itself, without ADR"),
        ("r^ := 5;", "INT is not a pointer; a reference is used without ^"),
        (
            "IF r <> NULL THEN x := 1; END_IF;",
            "<> cannot compare INT with REF_TO ?; whether a reference refers to something is __ISVALIDREF(reference)",
        ),
    ],
)
def test_a_slip_about_a_reference(body: str, said: str) -> None:
    assert [m.split(": ", 1)[1] for m in messages(main("x : INT; r : REFERENCE TO INT;", body))] == [said]


@pytest.mark.parametrize("statement", ["t(IN = a);", "TON(IN := a);", "a := t(IN := a);"])
def test_what_stands_in_a_faulty_statement_is_used(statement: str) -> None:
    assert not messages(main("a : BOOL; t : TON;", statement), "warning")


def test_labels_joined_by_or_are_one_value() -> None:
    text = "PROGRAM Main\nVAR a : INT; END_VAR\nCASE a OF\n1 OR 2: a := 1;\nEND_CASE;\nEND_PROGRAM\n"
    assert messages(text, "warning") == ["4:3: this is the one value 3; several values are separated by commas"]
