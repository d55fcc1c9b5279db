"""What people write who come from other languages and systems, or write in a hurry: each message says what to write.

The list was written before the messages were looked at. A mistake must not hide what else is wrong in other statements
more than it has to, so every case says all messages it gives.
"""

from __future__ import annotations

import pytest
from front_support import messages

BLOCK = (
    "FUNCTION_BLOCK Valve\nVAR_INPUT x : INT; ref : REFERENCE TO INT; END_VAR\nVAR_OUTPUT q : BOOL; END_VAR\n"
    "q := x > 0;\nEND_FUNCTION_BLOCK\nFUNCTION Nothing\nVAR_INPUT x : INT; END_VAR\nEND_FUNCTION\n"
)
VARIABLES = (
    "a, b : INT; x, y : BOOL; r : REAL; s : STRING; t : TIME; tm : TON; arr : ARRAY[1..9] OF INT; v : Valve; "
    "p : POINTER TO INT;"
)
TASKS = "tasks and what they run stand in CONFIGURATION C RESOURCE R ON PLC ... END_RESOURCE END_CONFIGURATION"
BODY = 14  # the line where a case stands
DECLARE = "variables are declared in VAR ... END_VAR before the statements: c : INT;"
CHOICE = "a choice is written CASE a OF 1: ...; ELSE ...; END_CASE"


def in_body(body: str) -> list[str]:
    """Line within the body and message of each error."""
    found = messages(f"{BLOCK}PROGRAM Main\nVAR\n{VARIABLES}\n\nEND_VAR\n{body}\nEND_PROGRAM\n")
    return [f"{int(m.split(':')[0]) - BODY + 1}: {m.split(': ', 1)[1]}" for m in found]


def in_declaration(line: str) -> list[str]:
    """Messages about a declaration."""
    found = messages(f"{BLOCK}PROGRAM Main\nVAR\n{VARIABLES}\n{line}\nEND_VAR\na := 1;\nEND_PROGRAM\n")
    return [m.split(": ", 1)[1] for m in found]


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("v(ref REF= a);", ["1: an input that is a reference is given with :=, as others are: ref := a"]),
        ("IF x THEN\na := 1;\nELSE IF y THEN\na := 2;\nEND_IF;", [
            "3: ELSE IF begins a second IF, with an END_IF of its own; write ELSIF"
        ]),
        ("a := 1;\nINT c;\na := 2;", [f"2: {DECLARE}"]),
        ("a := 1;\nc : INT;\na := 2;", [f"2: {DECLARE}"]),
        ("a := 1;\nc : INT := 5;\na := 2;", [f"2: {DECLARE}"]),
        ("a := NULL;", ["1: NULL is for pointers, references and interfaces; it does not fit INT"]),
        ("x := 1 < a < 5;", [
            "1: < cannot compare BOOL with INT; to compare a value twice, write a < b AND b < c"
        ]),
        ("IF a THEN\nb := 1;\nEND_IF;", ["1: INT does not fit BOOL; write INT_TO_BOOL(...), or compare it: <> 0"]),
        ("CASE x OF\nTRUE: a := 1;\nEND_CASE;", [
            "1: CASE needs an integer or an enumeration, not BOOL; write IF"
        ]),
        ("a: = 1;", ["1: an assignment is written a := ..., without a blank"]),
        ("a : 1;", ["1: an assignment is written a := ..."]),
        ("arr[1]:\na := 1;", ["1: a label is one name, such as again:, and not in front of the statements of a CASE"]),
        ("a := 1;\nc : STRING[5];", [f"2: {DECLARE.replace('INT', 'STRING')}"]),
        ("JMP;", ["1: unknown name JMP"]),
        ("WITH t DO\na := 3;\nEND_WITH;", ["1: there is no WITH; write the name in front of each member: t.x := ..."]),
        ("WITH s DO BEGIN a := 3; END;", ["1: there is no WITH; write the name in front of each member: s.x := ..."]),
        ("WHILE x := TRUE DO\nx := FALSE;\nEND_WHILE;", []),
        ("IF a := 1 THEN\nb := 1;\nEND_IF;", ["1: a comparison is written =; := assigns"]),
        ("WHILE a := 1 DO\nb := 1;\nEND_WHILE;", ["1: a comparison is written =; := assigns"]),
        ("tm(IN := TRUE, PT := 5s);", ["1: a duration is written T#5s, not 5s"]),
        ("t := 1.5s;", ["1: a duration is written T#1.5s, not 1.5s"]),
        ("t := 500ms;", ["1: a duration is written T#500ms, not 500ms"]),
        ("t := T5s;", ["1: unknown name T5s; a duration is written T#5s"]),
        ("s := 'a' + 'b';", ["1: strings are joined by CONCAT(a, b), not by +"]),
        ("s := s + 'b' + s;", ["1: strings are joined by CONCAT(a, b), not by +"]),
        ("s := s + a;", ["1: strings are joined by CONCAT(a, b), not by +"]),
        ("a := arr(1);", ["1: arr is an array; an element is written arr[1]"]),
        ("x := %IX;\na := unknown1;", [
            "1: %IX is not an address such as %IX0.3 or %QW2", "2: unknown name unknown1"
        ]),
        ("a := Nothing(1);", ["1: Nothing gives no result; call it as a statement, or declare FUNCTION Nothing : INT"]),
        ("s := 'it''s';", ["1: a quote within a string is written $'"]),
        ("s := CONCAT(s, 'say \\'hello\\'');", [
            "1: a quote within a string is written $'",
            "1: \\ has no place in a program; a quote within a string is written $'",
        ]),
        ("p := new TON();", ["1: an instance is taken from its pool by __NEW(TON)"]),
        ("p := __NEW TON;\ndelete p;", [
            "1: an instance is taken from its pool by __NEW(TON)", "2: what __NEW gave is given back by __DELETE(p)"
        ]),
        ("FOR (a = 0; a < 10; a++) b := 1;", ["1: a loop is written FOR i := 0 TO 9 DO ... END_FOR"]),
        ("FOR a IN arr DO b := 1; END_FOR;", ["1: a loop is written FOR i := 0 TO 9 DO ... END_FOR"]),
        ("CASE a OF\n1: b := 1; BREAK;\nEND_CASE;", [
            "2: unknown name BREAK; EXIT leaves a loop, and a branch of a CASE ends by itself"
        ]),
        ("SWITCH a\nCASE 1: b := 1;", [f"1: {CHOICE}"]),
        ("a := INT(r);", ["1: INT is a type; a conversion is written TO_INT(r)"]),
        ("a := (INT)r;", ["1: a conversion is written TO_INT(r), not (INT)"]),
        ("a := b ^ 2;", ["1: a power is written a ** 2; ^ follows a pointer"]),
        ("r := 1,5;", ["1: a real number is written with a point: 1.5"]),
        ("r := .5;", ["1: a number begins with a digit: 0.5"]),
        ("a := *p;", ["1: what p points to is written p^"]),
        ("p := &a;", ["1: the address of a is written ADR(a)"]),
        ("IF p = nullptr THEN a := 1; END_IF;", ["1: unknown name nullptr; write NULL"]),
        ("IF (x) {\na := 1;\n}", ["1: there are no { } around statements; write IF x THEN ... END_IF"]),
        ("IF x THEN\na := 1;\nEND IF;\na := 2;", ["3: END IF is written END_IF"]),
        ("v(x = 1);", ["1: the input x is given with :=, not with ="]),
        ("x := v.q();", ["1: q is a variable of Valve, not a method; leave out ()"]),
        ("s[0] := 'a';", ["1: a character of a STRING is a number here: write 16#61 for 'a'"]),
        ("a := s.length;", ["1: STRING[80] has no members; its length is LEN(...)"]),
        ("IF strcmp(s, 'a') = 0 THEN a := 1; END_IF;", ["1: unknown function strcmp; strings are compared with ="]),
        ("a := strlen(s);", ["1: unknown function strlen; write LEN"]),
        ("a := 1; # first", ["1: # has no place in a program; a comment is written // or (* *)"]),
        ("a := #b;", ["1: # has no place in a program; a name is written without it; a comment is // or (* *)"]),
        ("a := 1; -- first\nb := 2;", ["1: a comment is written // or (* *)"]),
        ("GOTO lab;", ["1: a jump is written JMP lab; and its label lab:"]),
    ],
)  # fmt: skip
def test_a_mistake_in_a_body(body: str, said: list[str]) -> None:
    assert in_body(body) == said


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("INT c;", "a variable is declared with its name first: c : INT;"),
        ("c : ARRAY[10] OF INT;", "an array has its first and its last index in brackets: ARRAY[0..9] OF ..."),
        ("c : ARRAY[0..2] OF INT := {1,2,3};", "the values of an array are written in brackets: [1, 2, 3]"),
        ("c : REFERENCE_TO INT;", "REFERENCE_TO is written REFERENCE TO"),
        ("c : POINTER_TO INT;", "POINTER_TO is written POINTER TO"),
        ("c : BOOL AT %QX1.4;", "AT comes after the name: c AT %QX1.4 : BOOL;"),
        ("c : FLOAT;", "unknown type FLOAT; write REAL"),
        ("c : DOUBLE := 1.0;", "unknown type DOUBLE; write LREAL"),
        ("c : uint8_t;", "unknown type uint8_t; write USINT"),
        ("c : BOOLEAN;", "unknown type BOOLEAN; write BOOL"),
        ("c : unsigned int;", "there is no unsigned; write UINT, UDINT ... for a type without negative numbers"),
        ("CONST c : INT := 1;", "constants are declared in VAR CONSTANT ... END_VAR"),
    ],
)
def test_a_mistake_in_a_declaration(line: str, said: str) -> None:
    assert in_declaration(line) == [said]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "FUNCTION_BLOCK G\nPUBLIC METHOD m : INT\nm := 1;\nEND_METHOD\nEND_FUNCTION_BLOCK\n",
            ["2:1: PUBLIC comes after METHOD: METHOD PUBLIC m"],
        ),
        (
            "ABSTRACT FUNCTION_BLOCK G\nEND_FUNCTION_BLOCK\n",
            ["1:1: ABSTRACT comes after FUNCTION_BLOCK: FUNCTION_BLOCK ABSTRACT G"],
        ),
        (
            "PROGRAM Main\nVAR a : INT; END_VAR\nBEGIN\na := 1;\nEND_PROGRAM\n",
            ["3:1: there is no BEGIN; the statements follow END_VAR"],
        ),
        (
            "TYPE Color : ENUM (Red, Green); END_TYPE\n",
            ["1:14: unknown type ENUM; an enumeration is written Name : (First, Second);"],
        ),
        (
            "FUNCTION F : INT\nVAR_INOUT a : INT; END_VAR\nF := a;\nEND_FUNCTION\n",
            ["2:1: VAR_INOUT is written VAR_IN_OUT"],
        ),
        (
            "PROGRAM Main\nVAR_RETAIN a : INT; END_VAR\na := 1;\nEND_PROGRAM\n",
            ["2:1: VAR_RETAIN is written VAR RETAIN"],
        ),
        (
            "PROGRAM PLC_PRG\nVAR rLevel : REAL; END_VAR\nrLevel := 1.0;\nEND_PROGRAM\n"
            "VAR_GLOBAL wLevel : WORD; END_VAR\nFUNCTION_BLOCK Use\nVAR a : REAL; END_VAR\na := rLevel;\n"
            "END_FUNCTION_BLOCK\n",
            ["8:6: unknown name rLevel; write PLC_PRG.rLevel"],
        ),
    ],
)
def test_a_mistake_in_a_unit(text: str, said: list[str]) -> None:
    assert messages(text) == said


# Forty more, written before their messages were looked at.
SELECT = "a choice between two values is written SEL(condition, value_if_false, value_if_true)"
TESTED_AT_END = "a loop that tests at its end is written REPEAT ... UNTIL condition END_REPEAT"
CONSTANT = "constants are declared in VAR CONSTANT ... END_VAR"


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("a =: 1;", ["1: an assignment is written :=, not ="]),
        ("x := a ≤ b;", ["1: less or equal is written <=, not ≤"]),
        ("x := a≥b;", ["1: greater or equal is written >=, not ≥"]),
        ("x := a ≠ b;", ["1: unequal is written <>, not ≠"]),
        ("a := b × 2;", ["1: a product is written *, not ×"]),
        ("a := b·2;", ["1: a product is written *, not ·"]),
        ("a := b ÷ 2;", ["1: a division is written /, not ÷"]),
        ("a := b – 1;", ["1: minus is the - of the keyboard; this is a longer dash"]),
        ("s := “a b”;", ["1: a string is written with straight quotes: 'a b'"]),
        ("s := ‘a’;", ["1: a string is written with straight quotes: 'a'"]),
        ("s := „a“;", ["1: a string is written with straight quotes: 'a'"]),
        ("s := “a;", ["1: “ has no place in a program"]),
        ("a := b😀;", ["1: 😀 has no place in a program"]),
        ("a <- 1;", ["1: an assignment is written :=, not <-"]),
        ("a := x ? 1 : 2;", [f"1: ? has no place in a program; {SELECT}"]),
        ("REM a remark", ["1: a comment is written // or (* *)"]),
        ("# a remark", ["1: # has no place in a program; a comment is written // or (* *)"]),
        ("x := a > 1 AND < 5;", ["1: AND joins two comparisons: ... AND a < 5"]),
        ("a := b // 2;", ["1: // begins a comment; a division is written /"]),
        ("x := ~y;", ["1: not is written NOT, not ~"]),
        ("a := b << 2;", ["1: a shift is written SHL(b, 2)"]),
        ("a := b >> 1;", ["1: a shift is written SHR(b, 1)"]),
        ("a := LEN s;", ["1: a function is called with parentheses: LEN(s)"]),
        ("a := ABS b;", ["1: a function is called with parentheses: ABS(b)"]),
        ("CALL tm(IN := x);", ["1: there is no CALL; write tm(...)"]),
        ("tm.Q();", ["1: Q is a variable of TON, not a method; leave out ()"]),
        ("v(x := 1, q := y);", ["1: q is given with =>"]),
        ("TON(IN := x, PT := T#5s);", [
            "1: TON is a function block type; declare an instance of it and call that"
        ]),
        ("FOR a := 1 TO 9 STEP 2 DO b := a; END_FOR;", ["1: the step of a loop is written BY 2"]),
        ("FOR a := 9 DOWNTO 1 DO b := a; END_FOR;", ["1: a loop that counts down is written TO 1 BY -1"]),
        ("FOR a := 0, a < 9 DO b := a; END_FOR;", ["1: a loop is written FOR i := 0 TO 9 DO ... END_FOR"]),
        ("FOR a := 0 TO 9; b := a; END_FOR;", ["1: expected DO before the body of the loop"]),
        ("CASE a OF\n1: b := 1;\nELSE: b := 2;\nEND_CASE;", ["3: ELSE has no colon"]),
        ("CASE a OF\n1: b := 1;\nDEFAULT: b := 2;\nEND_CASE;", [
            "3: unknown name DEFAULT; the branch for all other values is ELSE"
        ]),
        ("CASE a OF\n>5: b := 1;\nEND_CASE;", [
            "2: a branch has values or a range: 6..100: ...; for comparisons write IF ... ELSIF"
        ]),
        ("CASE a OF\n1 TO 5: b := 1;\nEND_CASE;", ["2: a range of values is written 1..5"]),
        ("THEN a := 1;", ["1: THEN without an IF"]),
        ("let c := 5;", [f"1: {DECLARE}"]),
        ("int c = 5;", ["1: variables are declared in VAR ... END_VAR before the statements: c : int;"]),
        ("a := self.b;", ["1: unknown name self; write THIS^"]),
    ],
)  # fmt: skip
def test_more_mistakes_in_a_body_say_what_to_write(body: str, said: list[str]) -> None:
    assert in_body(body) == said


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("a := b IF x ELSE 3;\na := 1;", f"1: {SELECT}"),
        ("tm(IN := TRUE; PT := T#1s);", "1: inputs are separated by commas"),
        ("DO a := 1; WHILE x;", f"1: {TESTED_AT_END}"),
        ("REPEAT a := 1; WHILE x END_REPEAT;", f"1: {TESTED_AT_END}"),
    ],
)
def test_mistakes_that_leave_a_sentence_open_are_said_first(body: str, said: str) -> None:
    assert in_body(body)[0] == said


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("c := 5;", "a variable is declared with its type: c : INT := 5;"),
        ("c[10] : INT;", "an array is declared c : ARRAY[0..9] OF INT;"),
        ("c : ARRAY[0-9] OF INT;", "the bounds of an array are written 0..9"),
        ("c : ARRAY(0..9) OF INT;", "the bounds of an array stand in brackets: ARRAY[0..9]"),
        ("c : ARRAY OF INT;", "an array has its first and its last index in brackets: ARRAY[0..9] OF ..."),
        ("c : INT, d : INT;", "a declaration ends with ;, not with a comma"),
        ("c-d : INT;", "a name has no blank and no -: c_d"),
        ("c d : INT;", "a name has no blank and no -: c_d"),
        ("1c : INT;", "1c is not a number; a name begins with a letter"),
        ("c : *INT;", "a pointer is declared POINTER TO INT"),
        ("c : INT*;", "a pointer is declared POINTER TO INT"),
        ("c : CONST INT := 5;", CONSTANT),
        ("CONSTANT c : INT := 5;", CONSTANT),
        ("c : TON(PT := 5s);", "a duration is written T#5s, not 5s"),
    ],
)
def test_more_mistakes_in_a_declaration_say_what_to_write(line: str, said: str) -> None:
    assert in_declaration(line) == [said]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "TASK Cyc(INTERVAL := T#10ms);\nPROGRAM P1 WITH Cyc : Main;\n",
            ["tasks and what they run stand in CONFIGURATION C RESOURCE R ON PLC ... END_RESOURCE END_CONFIGURATION"]
            * 2,
        ),
        ("TEST counts\n", ["the name of a test is a text: TEST 'counts'"]),
        (
            "PROGRAM P VAR n : INT; END_VAR\nTRY\nn := 1;\nCATCH e\nn := 2;\nEND_TRY\nEND_PROGRAM\n",
            ["exceptions are caught by __TRY ... __CATCH(e) ... __ENDTRY"] * 3,
        ),
        (
            "TYPE T : STRUCT x : INT; END_STRUCT END_TYPE\nPROGRAM P VAR p : T := {x := 1}; END_VAR END_PROGRAM",
            ["the members of a structure are written in parentheses: (x := 1)"],
        ),
        (
            "CONFIGURATION C RESOURCE R ON D TASK E(EVENT := door); END_RESOURCE END_CONFIGURATION",
            ["EVENT is the name of an external event, in quotes: 'door'"],
        ),
        (
            "PROGRAM P\n{IF defined(fast)}\n{ELSEIF defined(slow)}\n{ENDIF}\nEND_PROGRAM",
            ["{ELSEIF} is written {ELSIF}", "{ENDIF} is written {END_IF}"],
        ),
        (
            "FUNCTION_BLOCK M\nPROPERTY Speed : INT\nget { return _speed; }\nSET{ _speed = value; }\nEND_PROPERTY\n"
            "END_FUNCTION_BLOCK",
            [f"what a property does is written {word} ... END_{word}, without braces" for word in ("GET", "SET")],
        ),
        (
            "PROGRAM P VAR n : INT; END_VAR\nINITIAL_STEP a:\n  n := 1;\nEND_STEP\nSTEP b: n := 1;\nEND_STEP\n"
            "TRANSITION FROM a TO b := TRUE; END_TRANSITION\nEND_PROGRAM",
            ["a step names actions: write this into ACTION A: ... END_ACTION, and A; into the step"] * 2,
        ),
        (
            "PROGRAM P VAR s : STRING; END_VAR\ns := 'can't';\nEND_PROGRAM",
            ["a quote within a string is written $'", "this string is not closed before the end of the line"],
        ),
        (
            "PROGRAM P VAR n : INT; END_VAR\nconut := n;\nEND_PROGRAM",
            ["unknown name conut"],
        ),
        (
            "VAR_GLOBAL speed : INT; END_VAR PROGRAM P VAR n : INT; END_VAR\nn := GVL.speed;\nEND_PROGRAM",
            ["unknown name GVL; a list of VAR_GLOBAL has the name of its file: f"],
        ),
        (
            "FUNCTION_BLOCK B VAR_INPUT n : UDINT := SIZEOF(buf); END_VAR\nVAR buf : INT; END_VAR\nbuf := 1;\n"
            "END_FUNCTION_BLOCK",
            ["buf is declared below; move that line up"],
        ),
        (
            "FUNCTION Scale : INT\nScal := 1;\nEND_FUNCTION",
            ["unknown name Scal; did you mean Scale?"],
        ),
    ],
)
def test_mistakes_outside_of_bodies_say_what_to_write(text: str, said: list[str]) -> None:
    assert [message.split(": ", 1)[1] for message in messages(text)][: len(said)] == said


def test_mistakes_with_types_say_what_to_write() -> None:
    types = "INTERFACE I_M END_INTERFACE\nFUNCTION_BLOCK M IMPLEMENTS I_M END_FUNCTION_BLOCK\n"
    body = "PROGRAM P VAR m : M; i : I_M; n : INT; t : TIME; s : STRING; END_VAR\n"
    body += "i := ADR(m);\nt := n;\nIF s[0] = 'a' THEN n := 1; END_IF\nEND_PROGRAM"
    assert [message.split(": ", 1)[1] for message in messages(types + body)] == [
        "POINTER TO M does not fit I_M; assign the instance itself, without ADR",
        "INT does not fit TIME; multiply a duration, such as T#1s, by it, or write INT_TO_TIME(...)",
        "= cannot compare BYTE with STRING[1]; a character of a string is a number here: write 16#61 for 'a'",
    ]


@pytest.mark.parametrize("task", ["INTERVAL = T#10ms", "INTERVAL := T#10ms, PRIORITY 1", "INTERVAL := 10 ms"])
def test_mistakes_of_a_task_in_its_place_are_not_about_its_place(task: str) -> None:
    text = f"PROGRAM P END_PROGRAM CONFIGURATION C RESOURCE R ON D\nTASK T({task});\nPROGRAM P1 WITH T : P;\n"
    assert TASKS not in " ".join(messages(f"{text}END_RESOURCE END_CONFIGURATION"))


@pytest.mark.parametrize("statement", ["try := 1 2;", "catch := n x;", "try 5;", "catch.x y;"])
def test_variables_with_the_names_of_keywords_elsewhere_are_no_exceptions(statement: str) -> None:
    found = messages(f"PROGRAM P VAR n, x, try, catch : INT; END_VAR\n{statement}\nEND_PROGRAM")
    assert found and "__TRY" not in " ".join(found)


@pytest.mark.parametrize("comment", ["// switch to manual", "(* switch to manual *)", "/* switch\nto manual */"])
def test_messages_are_not_about_words_in_comments(comment: str) -> None:
    (said,) = in_body(f"a := 1 {comment}\nb := 2;")
    assert "expected ;" in said
    assert in_body(f"switch (a) {comment}\nb := 2;")[0] == f"1: {CHOICE}"


@pytest.mark.parametrize(
    "code",
    [
        "{extern int f(int); f(1);}",
        "{{ f(1); }}",
        "{\nSetFbVar(Q, 1);\n}",
        "{ static int k; k++; }",
        "{\n#define A\nb(A);\n}",
    ],
)
def test_code_in_c_is_not_taken_for_statements_in_braces(code: str) -> None:
    assert in_body(f"IF x THEN\n{code}\nEND_IF;") == [
        "2: code in C cannot be compiled; put it into an EXTERNAL function"
    ]
    assert in_body("IF (x)\n{ a := 1; }")[0] == "2: there are no { } around statements; write IF x THEN ... END_IF"
