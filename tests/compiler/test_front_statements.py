"""Statements and what is said about wrong ones."""

from __future__ import annotations

import pytest
from front_support import body_of, main, messages

from plctool.compiler.typed import nodes as typed
from plctool.compiler.typed.nodes import Assign, Case, Const, For, If, Repeat, While

BEFORE = "TYPE Color : (Red, Green, Blue); END_TYPE\nVAR_GLOBAL CONSTANT LIMIT : INT := 5; END_VAR\n"
VARIABLES = "i, j : INT; b : BOOL; e : Color; u : USINT; d : DINT; r : REAL; a : ARRAY[0..3] OF INT; s, s2 : STRING;"
LINE = 7


def statement(text: str) -> typed.Statement:
    return body_of(VARIABLES, text, BEFORE)[0]


def faults(text: str, severity: str = "error") -> list[str]:
    found = messages(main(VARIABLES, text, BEFORE), severity)
    return [m.removeprefix(f"{LINE}:") for m in found if "never used" not in m]


def test_if_has_a_branch_per_condition() -> None:
    s = statement("IF b THEN i := 1; ELSIF i > 2 THEN i := 2; ELSIF i > 3 THEN ; ELSE i := 4; END_IF;")
    assert isinstance(s, If)
    assert [len(body) for _, body in s.branches] == [1, 1, 0]
    assert len(s.otherwise) == 1


def test_case_labels_are_ranges_of_numbers() -> None:
    s = statement("CASE i OF 1, 3..4: j := 1; -2: j := 2; LIMIT: j := 3; LIMIT + 1..10: j := 4; ELSE j := 5; END_CASE;")
    assert isinstance(s, Case)
    assert [labels for labels, _ in s.branches] == [[(1, 1), (3, 4)], [(-2, -2)], [(5, 5)], [(6, 10)]]


@pytest.mark.parametrize("label", ["Green", "Color#Green", "Color.Green", "1"])
def test_case_labels_of_an_enumeration_may_be_written_in_every_way(label: str) -> None:
    s = statement(f"CASE e OF {label}: j := 1; END_CASE;")
    assert isinstance(s, Case)
    assert s.branches[0][0] == [(1, 1)]


def test_case_branch_goes_on_to_the_next_label() -> None:
    s = statement("CASE i OF 1: i := 1; j := 2; b := TRUE; 2: END_CASE;")
    assert isinstance(s, Case)
    assert [len(body) for _, body in s.branches] == [3, 0]


def test_for_counts_by_one_by_default() -> None:
    s = statement("FOR u := 1 TO 10 DO i := u; END_FOR;")
    assert isinstance(s, For)
    assert isinstance(s.step, Const)
    assert (s.step.value, str(s.step.type)) == (1, "USINT")


def test_for_takes_start_stop_and_step_in_the_type_of_its_variable() -> None:
    s = statement("FOR d := i TO u BY -2 DO ; END_FOR;")
    assert isinstance(s, For)
    assert str(s.start.type) == str(s.stop.type) == str(s.step.type) == "DINT"


def test_loop_variable_may_be_an_array_element() -> None:
    assert isinstance(statement("FOR a[i] := 0 TO 3 DO ; END_FOR;"), For)


def test_while_and_repeat_hold_their_bodies() -> None:
    s = statement("WHILE i < 3 DO i := i + 1; IF b THEN EXIT; END_IF; CONTINUE; END_WHILE;")
    assert isinstance(s, While)
    assert len(s.body) == 3
    r = statement("REPEAT i := i + 1; UNTIL i > 3 END_REPEAT;")
    assert isinstance(r, Repeat)


def test_strings_of_different_lengths_may_be_assigned() -> None:
    assert isinstance(statement("s := s2;"), Assign)


def test_return_ends_a_unit() -> None:
    assert isinstance(statement("RETURN;"), typed.Return)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("IF i THEN ; END_IF;", "4: INT does not fit BOOL; write INT_TO_BOOL(...), or compare it: <> 0"),
        ("WHILE r DO ; END_WHILE;", "7: REAL does not fit BOOL; write REAL_TO_BOOL(...), or compare it: <> 0"),
        ("CASE r OF 1: ; END_CASE;", "6: CASE needs an integer or an enumeration, not REAL"),
        ("CASE i OF 1..5: ; 3: ; END_CASE;", "19: 3 is a label in line 7 already"),
        ("CASE i OF 3: ; 1..5: ; END_CASE;", "16: 3 is a label in line 7 already"),
        ("CASE e OF Red: ; Color#Red: ; END_CASE;", "18: Red is a label in line 7 already"),
        ("CASE i OF 5..1: ; END_CASE;", "11: the range 5..1 is empty"),
        ("CASE i OF j: ; END_CASE;", "11: a constant is needed here; declare j in VAR CONSTANT"),
        ("CASE u OF 300: ; END_CASE;", "11: 300 does not fit USINT (0..255)"),
        ("FOR r := 1 TO 3 DO ; END_FOR;", "5: a FOR loop counts with an integer, not with REAL"),
        ("FOR i := 1 TO 3 BY 0 DO ; END_FOR;", "20: a FOR loop with a step of zero never ends"),
        ("FOR u := 1 TO 300 DO ; END_FOR;", "15: 300 does not fit USINT (0..255)"),
        ("FOR LIMIT := 1 TO 3 DO ; END_FOR;", "5: LIMIT is a constant and cannot be the variable of a FOR loop"),
        ("FOR 5 := 1 TO 3 DO ; END_FOR;", "5: expected a name, found 5"),
        ("EXIT;", "1: EXIT stands outside of a loop"),
        ("CONTINUE;", "1: CONTINUE stands outside of a loop"),
        ("LIMIT := 6;", "1: LIMIT is a constant and cannot be assigned to"),
        ("i + 1 := 6;", "3: expected := or ;, found +"),
        ("ABS(i) := 6;", "1: the left side of := needs a variable"),
        ("MAX(i, j).1 := b;", "1: the left side of := needs a variable"),
        ("i S= b;", "1: S= needs a BOOL variable, not INT"),
        ("b S= i;", "6: INT does not fit BOOL; write INT_TO_BOOL(...), or compare it: <> 0"),
        ("b S= i R= b;", "6: R= needs a BOOL variable, not INT"),
        ("i X= b;", "3: X has no place here; an assignment is written :=, S= or R="),
        ("i REF= j;", "1: the left side of REF= is a REFERENCE TO, not INT"),
        ("nothing := 1;", "1: unknown name nothing"),
        ("ii := 1;", "1: unknown name ii"),
        ("i := LIMTI;", "6: unknown name LIMTI; did you mean LIMIT?"),
    ],
)
def test_wrong_statement_is_explained(text: str, message: str) -> None:
    assert faults(text) == [message]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("RETURN; i := 1;", "9: this statement is never reached"),
        ("WHILE b DO EXIT; i := 1; j := 2; END_WHILE;", "18: this statement is never reached"),
        ("ABS(i);", "1: the result of this call is not used"),
        (
            "s := '1234567890123456789012345678901234567890123456789012345678901234567890123456789012345';",
            "6: this string has 85 characters, STRING[80] holds 80",
        ),
    ],
)
def test_suspicious_statement_is_a_warning(text: str, message: str) -> None:
    assert faults(text, "warning") == [message]


def test_every_statement_knows_its_line() -> None:
    body = body_of("i : INT;", "i := 1;\n\nIF i = 1 THEN\n  i := 2;\nEND_IF;")
    assert [s.pos.line for s in body] == [5, 7]
    guard = body[1]
    assert isinstance(guard, If)
    assert (guard.branches[0][1][0].pos.line, guard.branches[0][1][0].pos.column) == (8, 3)
