"""Expressions: types, implicit conversions, folding of constants."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from typing import Any

import pytest
from front_support import body_of, findings, folded, main, messages
from hypothesis import assume, given
from hypothesis import strategies as st

from plctool.compiler.typed import nodes as typed
from plctool.compiler.typed.nodes import Binary, BinaryOp, BitPlace, Const, Convert, Expr, IndexPlace, Load, MemberPlace

VARIABLES = """b, b2 : BOOL; by : BYTE; w : WORD; dw : DWORD; lw : LWORD; si : SINT; i : INT; di : DINT; li : LINT;
us : USINT; u : UINT; ud : UDINT; ul : ULINT; r : REAL; lr : LREAL; t : TIME; lt : LTIME; s : STRING[20];
s2 : STRING[30]; e : Color; m : Mode; sub : INT(1..10); a : ARRAY[1..3, 0..1] OF INT; p : Point; aa : ARRAY[0..1] OF A2;
ptr : POINTER TO INT; ref : REFERENCE TO INT; pp : REF_TO Point; tm : TON; idx : SINT;"""
BEFORE = (
    "TYPE Color : (Red, Green, Blue); Mode : (Off, On, Red); "
    "Point : STRUCT x, y : INT; z : ARRAY[0..2] OF REAL; END_STRUCT; A2 : ARRAY[0..1] OF DINT; END_TYPE\n"
)
LINE = 9  # of the first statement


def value(target: str, expression: str) -> Expr:
    """What is assigned by `target := expression`."""
    statement = body_of(VARIABLES, f"{target} := {expression};", BEFORE)[0]
    assert isinstance(statement, typed.Assign)
    return statement.value


def faults(statement: str, severity: str = "error") -> list[str]:
    """Messages without the line; what is unused does not matter."""
    found = messages(main(VARIABLES, statement, BEFORE), severity)
    return [m.partition(":")[2] for m in found if "never used" not in m]


def condition(expression: str) -> Expr:
    return value("b", expression)


# ---- implicit conversions ----


@pytest.mark.parametrize(
    ("target", "source"),
    [
        ("i", "si"),
        ("di", "i"),
        ("li", "di"),
        ("u", "us"),
        ("ud", "u"),
        ("ul", "ud"),
        ("i", "us"),
        ("di", "u"),
        ("li", "ud"),
        ("w", "by"),
        ("dw", "w"),
        ("lw", "dw"),
        ("by", "b"),
        ("r", "i"),
        ("r", "us"),
        ("lr", "di"),
        ("lr", "ud"),
        ("lr", "r"),
        ("u", "w"),
        ("w", "u"),
        ("i", "w"),
        ("w", "i"),
        ("di", "by"),
        ("i", "e"),
        ("di", "e"),
        ("i", "sub"),
        ("di", "sub"),
        ("lt", "t"),
        ("s", "s2"),
        ("dw", "ud"),
    ],
)
def test_widening_is_implicit_and_silent(target: str, source: str) -> None:
    assert faults(f"{target} := {source};") == []
    assert faults(f"{target} := {source};", "warning") == []


@pytest.mark.parametrize(
    ("target", "source", "code"),
    [
        ("i", "di", "narrowing"),
        ("si", "i", "narrowing"),
        ("u", "i", "narrowing"),
        ("i", "u", "narrowing"),
        ("ud", "i", "narrowing"),
        ("by", "w", "narrowing"),
        ("i", "dw", "narrowing"),
        ("w", "li", "narrowing"),
        ("r", "lr", "narrowing"),
        ("r", "di", "precision"),
        ("lr", "li", "precision"),
        ("e", "i", "enum"),
        ("r", "w", "bits"),
    ],
)
def test_what_may_lose_something_is_a_warning(target: str, source: str, code: str) -> None:
    text = main(VARIABLES, f"{target} := {source};", BEFORE)
    assert findings(text) == []
    column = len(target) + 5
    assert (LINE, column, code) in findings(text, "warning")


@pytest.mark.parametrize(
    ("target", "source", "words"),
    [
        ("i", "r", "REAL_TO_INT"),
        ("di", "lr", "LREAL_TO_DINT"),
        ("b", "i", "INT_TO_BOOL"),
        ("i", "b", "BOOL_TO_INT"),
        ("t", "di", "DINT_TO_TIME"),
        ("di", "t", "TIME_TO_DINT"),
        ("t", "lt", "LTIME_TO_TIME"),
        ("r", "t", "TIME_TO_REAL"),
        ("i", "s", "STRING"),
        ("s", "i", "INT"),
        ("a", "i", "ARRAY"),
        ("p", "a", "Point"),
        ("i", "tm", "TON"),
    ],
)
def test_what_does_not_fit_names_both_types_or_the_conversion(target: str, source: str, words: str) -> None:
    (message,) = faults(f"{target} := {source};")
    assert message.startswith(f"{len(target) + 5}: ")
    assert words in message


@pytest.mark.parametrize(
    ("target", "literal", "expected"),
    [
        ("r", "1", 1.0),
        ("by", "16#FF", 255),
        ("b", "1", 1),
        ("i", "-32768", -32768),
        ("ul", "18446744073709551615", 2**64 - 1),
        ("lr", "0.1", 0.1),
        ("si", "2 ** 6", 64),
        ("t", "T#1s * 2", 2000),
        ("lt", "T#1s", 10**9),
        ("e", "Color#Blue", 2),
        ("e", "Green", 1),
        ("e", "Red", 0),
        ("m", "Red", 2),
        ("i", "Color.Blue", 2),
        ("sub", "7", 7),
        ("dw", "DWORD#5", 5),
        ("r", "INT#3", 3.0),
        ("di", "SINT#-1", -1),
        ("w", "NOT 16#00FF", 0xFF00),
        ("by", "NOT BYTE#1", 254),
        ("ptr", "NULL", 0),
    ],
)
def test_constant_takes_the_type_that_is_needed(target: str, literal: str, expected: float) -> None:
    e = value(target, literal)
    assert isinstance(e, Const)
    assert e.value == expected
    assert faults(f"{target} := {literal};", "warning") == []


@pytest.mark.parametrize(
    ("statement", "place", "words"),
    [
        ("i := 40000;", 6, "40000 does not fit INT (-32768..32767)"),
        ("us := 300;", 7, "does not fit USINT"),
        ("by := -1;", 7, "does not fit BYTE"),
        ("i := 1.0;", 6, "REAL_TO_INT"),
        ("b := 2;", 6, "BOOL"),
        ("r := 1e39;", 6, "too large for REAL"),
        ("sub := 11;", 8, "outside"),
        ("e := 7;", 6, "7 is not a value of Color; it has Red (0)"),
        ("e := Color#Pink;", 6, "has no value Pink"),
        ("e := Color.Gren;", 12, "did you mean Green"),
        ("t := 5;", 6, "T#5ms"),
        ("i := Blue2;", 6, "did you mean Blue"),
        ("e := Bool#Red;", 6, "not"),
        ("i := Color;", 6, "a type"),
        ("i := TON;", 6, "function block type"),
        ("i := Main;", 6, "program"),
        ("i := MAX;", 6, "unknown name MAX"),
    ],
)
def test_wrong_constant_or_name_is_explained(statement: str, place: int, words: str) -> None:
    (message,) = faults(statement)
    assert message.startswith(f"{place}: "), message
    assert words in message


def test_assignment_to_a_subrange_is_checked_at_run_time() -> None:
    e = value("sub", "i")
    assert isinstance(e, Convert)
    assert e.check == (1, 10)


def test_time_becomes_ltime_by_a_factor() -> None:
    e = value("lt", "t")
    assert isinstance(e, Binary)
    assert e.right == Const(1_000_000, e.type, e.right.pos)


def test_bare_enumeration_value_of_several_types_is_ambiguous_without_context() -> None:
    assert any("several enumerations" in m for m in faults("i := Red;"))


# ---- operators ----


@pytest.mark.parametrize(
    ("left", "op", "right", "result"),
    [
        ("si", "+", "i", "INT"),
        ("i", "*", "di", "DINT"),
        ("i", "+", "u", "DINT"),
        ("us", "-", "si", "INT"),
        ("ud", "+", "i", "LINT"),
        ("r", "*", "i", "REAL"),
        ("r", "+", "lr", "LREAL"),
        ("di", "/", "lr", "LREAL"),
        ("by", "AND", "w", "WORD"),
        ("i", "AND", "w", "WORD"),
        ("by", "+", "i", "INT"),
        ("dw", "+", "1", "DWORD"),
        ("w", "OR", "16#FF", "WORD"),
        ("i", "+", "100000", "DINT"),
        ("i", "MOD", "3", "INT"),
        ("i", "*", "1.5", "REAL"),
        ("t", "+", "t", "TIME"),
        ("t", "*", "i", "TIME"),
        ("i", "*", "t", "TIME"),
        ("t", "/", "2", "TIME"),
        ("t", "*", "1.5", "TIME"),
        ("t", "-", "lt", "LTIME"),
        ("lt", "/", "li", "LTIME"),
        ("sub", "+", "1", "INT"),
        ("i", "XOR", "di", "DINT"),
        ("b", "XOR", "b2", "BOOL"),
    ],
)
def test_operands_meet_in_the_common_type(left: str, op: str, right: str, result: str) -> None:
    # the result is seen as the type an array index, a comparison or the like would get: by a message
    (message,) = faults(f"p := {left} {op} {right};")
    assert f"{result} does not fit Point" in message


def test_arithmetic_is_done_in_the_type_of_the_operands() -> None:
    e = value("di", "i * i + 1")
    assert isinstance(e, Convert)
    assert str(e.operand.type) == "INT"


def test_product_that_is_widened_too_late_is_a_warning() -> None:
    assert faults("di := i * i;", "warning") == [
        "9: this product is calculated in INT and only then becomes DINT; convert an operand"
    ]
    assert faults("di := i + i;", "warning") == [
        "9: this sum is calculated in INT and only then becomes DINT; convert an operand"
    ]


@pytest.mark.parametrize(
    "expression",
    [
        "i < di",
        "u = i",
        "r > 1",
        "t >= T#1s",
        "s = 'abc'",
        "s < s2",
        "e = Green",
        "e <> Color#Red",
        "b = b2",
        "b = 1",
        "w = u",
        "i > 100000",
        "ptr = NULL",
        "e = 1",
        "lt > t",
        "0 < i",
        "1 < 2",
        "1.5 > 1",
        "'a' < 'b'",
        "b > FALSE",
        "sub = i",
    ],
)
def test_comparison_is_a_bool(expression: str) -> None:
    assert str(condition(expression).type) == "BOOL"


@pytest.mark.parametrize(
    ("expression", "place", "words"),
    [
        ("b + b2", 8, "+ cannot combine BOOL and BOOL"),
        ("r AND r", 8, "AND cannot combine REAL and REAL"),
        ("t > 5", 8, "cannot compare TIME with INT"),
        ("s = 5", 8, "STRING[20] with INT"),
        ("a = a", 8, "cannot compare"),
        ("p = p", 8, "cannot compare"),
        ("tm = tm", 9, "cannot compare"),
        ("b AND i", 8, "BOOL and INT"),
        ("s + s", 8, "joined by CONCAT"),
        ("NOT r", 6, "NOT needs"),
        ("-s", 6, "needs a number"),
        ("r MOD r", 8, "MOD cannot combine"),
        ("t * t", 8, "TIME and TIME"),
        ("t + 5", 8, "TIME and INT"),
        ("b = i", 8, "BOOL with INT"),
    ],
)
def test_operands_that_do_not_go_together_are_an_error_at_the_operator(expression: str, place: int, words: str) -> None:
    (message,) = faults(f"b := {expression};")
    assert message.startswith(f"{place}: "), message
    assert words in message


@pytest.mark.parametrize("expression", ["i / 0", "i MOD 0", "1 / 0", "r / 0.0", "ud / (2 - 2)"])
def test_division_by_the_constant_zero_is_an_error(expression: str) -> None:
    assert any("division by zero" in m for m in faults(f"lr := {expression};"))


def test_an_error_does_not_cause_others() -> None:
    assert len(faults("b := NOT ((nothing + i) * 2 > r) AND b2;")) == 1


def test_logic_with_short_circuit_is_kept_apart() -> None:
    e = condition("b AND_THEN b2 OR_ELSE b")
    assert isinstance(e, Binary)
    assert e.op is BinaryOp.OR_ELSE


# ---- places ----


def place_of(expression: str, target: str = "i") -> typed.Place:
    e = value(target, expression)
    while isinstance(e, Convert):
        e = e.operand
    assert isinstance(e, Load)
    return e.place


def test_array_element_has_an_index_per_dimension() -> None:
    place = place_of("a[i, 1]")
    assert isinstance(place, IndexPlace)
    assert len(place.indices) == 2


def test_array_of_arrays_may_be_indexed_at_once_or_one_by_one() -> None:
    assert str(place_of("aa[0, 1]", "di").type) == str(place_of("aa[0][1]", "di").type) == "DINT"


def test_members_are_reached_by_offset() -> None:
    place = place_of("p.y")
    assert isinstance(place, MemberPlace)
    assert place.offset == 2


def test_pointer_is_followed_with_a_caret() -> None:
    assert isinstance(place_of("ptr^"), typed.DerefPlace)
    assert isinstance(place_of("pp^.x"), MemberPlace)


def test_reference_is_followed_by_itself() -> None:
    assert isinstance(place_of("ref"), typed.DerefPlace)


@pytest.mark.parametrize("expression", ["w.3", "w.%X3", "i.15", "a[1, 0].0", "p.x.2"])
def test_bit_of_a_number_is_a_place(expression: str) -> None:
    assert isinstance(place_of(expression, "b"), BitPlace)


def test_byte_of_a_word_is_a_place() -> None:
    place = place_of("dw.%B2", "by")
    assert isinstance(place, MemberPlace)
    assert place.offset == 2


def test_string_is_indexed_from_zero() -> None:
    place = place_of("s[3]", "by")
    assert isinstance(place, IndexPlace)
    assert str(place.type) == "BYTE"


def test_bit_at_an_address_is_a_bit_of_its_byte() -> None:
    place = place_of("%IX2.5", "b")
    assert isinstance(place, BitPlace)
    assert place.bit == 5
    assert isinstance(place.base, typed.VarPlace)
    assert (place.base.var.offset, str(place.base.type)) == (2, "BYTE")


@pytest.mark.parametrize(
    ("statement", "place", "words"),
    [
        ("i := a[4, 0];", 8, "4 is outside 1..3"),
        ("i := a[1];", 6, "needs 2 indices"),
        ("i := a[1, 0, 0];", 6, "too many"),
        ("i := i[1];", 6, "not an array"),
        ("i := a[r, 0];", 8, "an index is an integer"),
        ("i := p.zz;", 8, "no member zz"),
        ("i := i.x;", 8, "has no members"),
        ("i := pp.x;", 9, "^."),
        ("b := w.16;", 8, "0..15"),
        ("b := r.1;", 8, "has no bits"),
        ("i := i^;", 6, "not a pointer"),
        ("by := w.%B2;", 9, "no part"),
        ("b := tm.QQ;", 9, "no variable QQ"),
        ("b := tm.START2;", 9, "no variable"),
        ("i := %IX;", 6, "%IX is not an address"),
        ("b := %IX0.8;", 6, "not an address"),
    ],
)
def test_wrong_place_is_explained(statement: str, place: int, words: str) -> None:
    message = faults(statement)[0]
    assert message.startswith(f"{place}: "), message
    assert words in message


def test_bit_of_a_constant_is_folded() -> None:
    (assign,) = body_of("x : BOOL;", "x := C.4;", "VAR_GLOBAL CONSTANT C : WORD := 16#F0; END_VAR\n")
    assert isinstance(assign, typed.Assign)
    assert isinstance(assign.value, Const)
    assert assign.value.value == 1


# ---- folding ----

OPERATIONS: dict[str, Callable[[Any, Any], Any]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: abs(a) // abs(b) * (1 if a * b >= 0 else -1),
    "MOD": lambda a, b: int(math.fmod(a, b)),
}


@given(st.sampled_from(list(OPERATIONS)), st.integers(-(2**31), 2**31 - 1), st.integers(-(2**31), 2**31 - 1))
def test_integer_constants_are_folded_as_python_calculates(op: str, a: int, b: int) -> None:
    assume(b != 0 or op in "+-*")
    expected = OPERATIONS[op](a, b)
    assume(abs(expected) < 2**63)
    assert folded(f"({a}) {op} ({b})", "LINT").value == expected


@given(st.sampled_from(["+", "-", "*"]), st.integers(-(2**15), 2**15 - 1), st.integers(-(2**15), 2**15 - 1))
def test_typed_constants_wrap(op: str, a: int, b: int) -> None:
    expected = (OPERATIONS[op](a, b) + 2**15) % 2**16 - 2**15
    assert folded(f"INT#{a} {op} INT#{b}", "INT").value == expected


@given(st.sampled_from(["AND", "OR", "XOR"]), st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1))
def test_bit_operations_are_folded(op: str, a: int, b: int) -> None:
    expected = {"AND": a & b, "OR": a | b, "XOR": a ^ b}[op]
    assert folded(f"DWORD#{a} {op} DWORD#{b}", "DWORD").value == expected


@given(st.sampled_from(["+", "-", "*"]), st.floats(-1e6, 1e6, width=32), st.floats(-1e6, 1e6, width=32))
def test_real_constants_are_folded_in_single_precision(op: str, a: float, b: float) -> None:
    expected = struct.unpack("f", struct.pack("f", OPERATIONS[op](a, b)))[0]
    assert folded(f"REAL#{a!r} {op} REAL#{b!r}", "REAL").value == expected


@given(st.sampled_from(["=", "<>", "<", "<=", ">", ">="]), st.integers(-9, 9), st.integers(-9, 9))
def test_comparisons_are_folded(op: str, a: int, b: int) -> None:
    expected = {"=": a == b, "<>": a != b, "<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}[op]
    assert folded(f"{a} {op} {b}", "BOOL").value == expected


@pytest.mark.parametrize(
    ("expression", "declared", "expected"),
    [
        ("-7 / 2", "INT", -3),
        ("-7 MOD 2", "INT", -1),
        ("7 MOD -2", "INT", 1),
        ("2 ** 10", "INT", 1024),
        ("2.0 ** 0.5", "LREAL", 2**0.5),
        ("REAL_TO_DINT(2.5)", "DINT", 2),
        ("REAL_TO_DINT(3.5)", "DINT", 4),
        ("TRUNC(-2.7)", "DINT", -2),
        ("LREAL_TO_SINT(1e9)", "SINT", 127),
        ("INT_TO_BYTE(-1)", "BYTE", 255),
        ("DINT_TO_INT(70000)", "INT", 4464),
        ("INT_TO_BOOL(5)", "BOOL", 1),
        ("BOOL_TO_INT(TRUE)", "INT", 1),
        ("TIME_TO_DINT(T#1.5s)", "DINT", 1500),
        ("DINT_TO_TIME(20)", "TIME", 20),
        ("TIME_TO_LTIME(T#1ms)", "LTIME", 10**6),
        ("LTIME_TO_TIME(LTIME#1500us)", "TIME", 1),
        ("TO_INT(3.6)", "INT", 4),
        ("DWORD_TO_REAL(16#FFFFFFFF)", "REAL", 2.0**32),
        ("ABS(-5)", "INT", 5),
        ("SQRT(2.25)", "REAL", 1.5),
        ("MIN(4, 2, 3)", "INT", 2),
        ("MAX(1, 2.5)", "LREAL", 2.5),
        ("SEL(TRUE, 1, 2)", "INT", 2),
        ("MUX(1, 5, 6, 7)", "INT", 6),
        ("SHL(BYTE#1, 7)", "BYTE", 128),
        ("SHR(BYTE#128, 9)", "BYTE", 0),
        ("ROL(BYTE#16#81, 1)", "BYTE", 3),
        ("ROR(WORD#1, 1)", "WORD", 0x8000),
        ("SIZEOF(LREAL)", "INT", 8),
        ("NOT TRUE", "BOOL", 0),
        ("ADD(1, 2, 3)", "INT", 6),
        ("MUL(2, 3)", "INT", 6),
        ("SUB(5, 3)", "INT", 2),
        ("DIV(7, 2)", "INT", 3),
        ("MOD(7, 4)", "INT", 3),
        ("GT(3, 2, 1)", "BOOL", 1),
        ("LE(1, 1, 0)", "BOOL", 0),
        ("EQ(2, 2)", "BOOL", 1),
        ("NE(1, 2)", "BOOL", 1),
        ("AND(TRUE, FALSE)", "BOOL", 0),
        ("XOR(WORD#5, 1)", "WORD", 4),
        ("NOT(FALSE)", "BOOL", 1),
        ("MOVE(5)", "INT", 5),
    ],
)
def test_functions_of_constants_are_folded(expression: str, declared: str, expected: float) -> None:
    assert folded(expression, declared).value == expected
