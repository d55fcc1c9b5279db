"""Calls: functions, function blocks, generic and overloaded library functions, EN and ENO."""

from __future__ import annotations

import zlib

import pytest
from front_support import body_of, main, messages, program

from plctool.compiler.typed import nodes as typed
from plctool.compiler.typed.nodes import Assign, Call, Const, Convert, FbCall, If, Load, Pou, ValuePlace
from plctool.iec.types import StringType

LIBRARY = """
{attribute 'no_checks'}
FUNCTION CLAMP : ANY_NUM
VAR_INPUT LOW, X, HIGH : ANY_NUM; END_VAR
CLAMP := MIN(MAX(X, LOW), HIGH);
END_FUNCTION

FUNCTION SAME : BOOL
VAR_INPUT A, B : ANY; END_VAR
SAME := A = B;
END_FUNCTION

FUNCTION POWER : ANY_REAL
VAR_INPUT BASE : ANY_REAL; N : ANY_INT; END_VAR
VAR I : ANY_INT; END_VAR
POWER := 1;
FOR I := 1 TO N DO POWER := POWER * BASE; END_FOR;
END_FUNCTION

{attribute 'external' := 'sinf'}
FUNCTION WAVE__REAL : REAL
VAR_INPUT X : REAL; END_VAR
END_FUNCTION

{attribute 'external' := 'sin'}
{attribute 'version' := '2.3'}
FUNCTION WAVE__LREAL : LREAL
VAR_INPUT X : LREAL; END_VAR
END_FUNCTION

{attribute 'no_init'}
FUNCTION LENGTH : INT
VAR_INPUT
    {attribute 'by_reference'}
    S : STRING;
END_VAR
WHILE LENGTH < UDINT_TO_INT(STRING_SIZE(S)) AND_THEN S[LENGTH] <> 0 DO LENGTH := LENGTH + 1; END_WHILE;
END_FUNCTION

{attribute 'extensible'}
FUNCTION JOIN : STRING
VAR_INPUT A, B : STRING; END_VAR
JOIN := A;
END_FUNCTION

FUNCTION_BLOCK COUNTER
VAR_INPUT UP : BOOL; LIMIT : INT := 10; END_VAR
VAR_IN_OUT TOTAL : DINT; END_VAR
VAR_OUTPUT Q : BOOL; N : INT; END_VAR
VAR LAST : BOOL; END_VAR
IF UP AND NOT LAST THEN N := N + 1; TOTAL := TOTAL + 1; END_IF;
LAST := UP;
Q := N >= LIMIT;
END_FUNCTION_BLOCK

FUNCTION UNUSED : INT
UNUSED := THIS_IS_NOT_EVEN_CHECKED;
END_FUNCTION
"""
FUNCTIONS = """FUNCTION Add3 : INT
VAR_INPUT a, b : INT; c : INT := 7; END_VAR
Add3 := a + b + c;
END_FUNCTION
FUNCTION Split : BOOL
VAR_INPUT x : DINT; END_VAR
VAR_OUTPUT low, high : INT; END_VAR
VAR_IN_OUT count : INT; END_VAR
low := DINT_TO_INT(x MOD 1000); high := DINT_TO_INT(x / 1000); count := count + 1;
END_FUNCTION
FUNCTION Proc
VAR_IN_OUT s : STRING; END_VAR
s := 'x';
END_FUNCTION
"""
VARIABLES = """i, j, k : INT; d : DINT; b, b2 : BOOL; r : REAL; lr : LREAL; s : STRING[10]; us : USINT; c : COUNTER;
cs : ARRAY[0..1] OF COUNTER; by : BYTE; t : TIME;"""
LINE = 20  # of the first statement


def statements(text: str) -> list[typed.Statement]:
    return body_of(VARIABLES, text, FUNCTIONS, library=LIBRARY)


def call(text: str) -> Call:
    """The call in `i := F(...)` or `F(...)`, without conversions around it."""
    (s,) = statements(text)
    e = s.call if isinstance(s, typed.CallStatement) else s.value  # type: ignore[union-attr]
    while isinstance(e, Convert):
        e = e.operand
    assert isinstance(e, Call)
    return e


def fb_call(text: str) -> FbCall:
    (s,) = statements(text)
    assert isinstance(s, FbCall)
    return s


def faults(text: str) -> list[str]:
    found = messages(main(VARIABLES, text, FUNCTIONS), library=LIBRARY)
    return [m.removeprefix(f"{LINE}:") for m in found]


def constants(c: Call) -> list[object]:
    return [a.value if isinstance(a, Const) else None for a in c.args]


# ---- functions ----


def test_positional_arguments_come_in_order() -> None:
    assert constants(call("i := Add3(1, 2, 3);")) == [1, 2, 3]


def test_named_arguments_are_put_in_order() -> None:
    assert constants(call("i := Add3(c := 3, a := 1, B := 2);")) == [1, 2, 3]


def test_missing_argument_takes_its_default() -> None:
    assert constants(call("i := Add3(1, 2);")) == [1, 2, 7]
    assert constants(call("i := Add3(a := 1);")) == [1, 0, 7]


def test_arguments_are_converted() -> None:
    assert isinstance(call("i := Add3(us, 2, 3);").args[0], Convert)


def test_outputs_and_in_outs_are_places() -> None:
    c = call("b := Split(x := 5, low => i, count := k);")
    low, high, count = c.args[1:]
    assert isinstance(low, typed.VarPlace)
    assert high is None
    assert isinstance(count, typed.VarPlace)


def test_function_without_result_is_a_statement() -> None:
    (argument,) = call("Proc(s);").args
    assert isinstance(argument, typed.VarPlace)
    assert argument.type == StringType(10)


def test_result_that_is_not_used_is_fine_for_a_call_with_effects() -> None:
    assert isinstance(statements("Split(x := 5, low => i, count := k);")[0], typed.CallStatement)


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("i := Add3(1, 2, 3, 4);", "20: Add3 takes 3 arguments, not 4"),
        ("i := Add3(1);", "6: the argument b of Add3 is missing"),
        ("i := Add3(b := 1, c := 2, d := 3);", "27: Add3 has no parameter d; it has a, b, c"),
        ("i := Add3(b := 2, 1);", "19: b is given twice"),
        ("i := Add3(x := 1);", "11: Add3 has no parameter x; it has a, b, c"),
        ("i := Add3(a := 1, a := 2);", "19: a is given twice"),
        ("i := Add3(a => j);", "11: a is given with :="),
        ("b := Split(x := 1, low := i, count := k);", "20: low is given with =>"),
        ("b := Split(x := 1);", "6: the argument count of Split is missing"),
        ("b := Split(x := 1, count := 5);", "29: the VAR_IN_OUT count needs a variable"),
        (
            "b := Split(x := 1, count := d);",
            "29: the VAR_IN_OUT count is INT and needs a variable of this type, not DINT",
        ),
        (
            "b := Split(x := 1, count := by.1);",
            "29: a single bit has no address, so it cannot be given to the VAR_IN_OUT count",
        ),
        ("i := Add3(1.5, 1);", "11: 1.5 does not fit INT; write REAL_TO_INT(1.5)"),
        ("i := Add3(r, 1);", "11: REAL does not fit INT; write REAL_TO_INT(...)"),
        ("i := Add4(1);", "6: unknown function Add4; did you mean Add3?"),
        ("i := i(1);", "6: i is not a function"),
        ("i := Main(1);", "6: a call of the program Main is a statement and has no value"),
        ("i := COUNTER(1);", "6: COUNTER is a function block type; declare an instance of it and call that"),
        ("i := Proc(s);", "6: Proc gives no result; call it as a statement, or declare FUNCTION Proc : INT"),
        ("i := SHL(1);", "6: SHL takes 2 arguments, not 1"),
        ("i := ABS(b);", "6: ABS needs a number, not BOOL"),
        ("r := SIN(r);", "6: unknown function SIN"),
        ("t := INT_TO_FOO(i);", "6: unknown function INT_TO_FOO"),
        ("i := ADD(1);", "6: ADD takes at least 2 arguments, not 1"),
    ],
)
def test_wrong_call_is_explained(statement: str, message: str) -> None:
    assert faults(statement) == [message]


def test_variable_may_have_the_name_of_a_function() -> None:
    (assign,) = body_of("max : INT;", "max := MAX(max, 3);")
    assert isinstance(assign, Assign)


def test_own_function_hides_the_built_in_one() -> None:
    body = body_of(
        "v : INT;", "v := MAX(1, 2);", "FUNCTION MAX : INT VAR_INPUT a, b : INT; END_VAR MAX := a; END_FUNCTION\n"
    )
    assert isinstance(body[0], Assign)
    assert isinstance(body[0].value, Call)


@pytest.mark.parametrize(
    "text",
    [
        "FUNCTION F : INT\nF := F();\nEND_FUNCTION\nFUNCTION G : INT\nEND_FUNCTION\n",
        "FUNCTION F : INT\nF := G();\nEND_FUNCTION\nFUNCTION G : INT\nG := F();\nEND_FUNCTION\n",
    ],
)
def test_recursion_is_an_error(text: str) -> None:
    (message,) = messages(text)
    assert "calls itself" in message


def test_recursion_through_a_function_block_is_an_error() -> None:
    text = (
        "FUNCTION_BLOCK A VAR_IN_OUT b : B; END_VAR b(a := NULL_A); END_FUNCTION_BLOCK\n"
        "FUNCTION_BLOCK B VAR_IN_OUT a : A; END_VAR a(b := b2); END_FUNCTION_BLOCK\n"
    )
    assert messages(text)


# ---- generic and overloaded functions ----


@pytest.mark.parametrize(
    ("statement", "instance"),
    [
        ("i := CLAMP(0, i, 10);", "CLAMP(INT)"),
        ("d := CLAMP(i, d, 10);", "CLAMP(DINT)"),
        ("r := CLAMP(0.5, r, 10);", "CLAMP(REAL)"),
        ("i := CLAMP(LOW := us, X := i, HIGH := 9);", "CLAMP(INT)"),
        ("r := CLAMP(0, 1, 2);", "CLAMP(REAL)"),
        ("b := SAME(s, 'abc');", "SAME(STRING[255])"),
        ("r := POWER(r, us);", "POWER(REAL,USINT)"),
        ("lr := POWER(lr, 3);", "POWER(LREAL,INT)"),
    ],
)
def test_generic_function_is_made_for_the_types_of_its_arguments(statement: str, instance: str) -> None:
    assert call(statement).function.name == instance


def test_generic_function_is_made_once_per_type() -> None:
    p = program(
        main(VARIABLES, "i := CLAMP(0, i, 1); j := CLAMP(1, j, 2); d := CLAMP(0, d, 1);", FUNCTIONS), library=LIBRARY
    )
    assert sorted(pou.name for pou in p.pous if "CLAMP" in pou.name) == ["CLAMP(DINT)", "CLAMP(INT)"]


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("b := CLAMP(b, b, b);", "CLAMP takes ANY_NUM, not BOOL"),
        ("i := CLAMP(1, s, 2);", "CLAMP"),
        ("b := SAME(b, s);", "SAME cannot combine BOOL and STRING[10]"),
        ("i := CLAMP(1, 2);", "the argument HIGH of CLAMP is missing"),
    ],
)
def test_generic_function_refuses_other_types(statement: str, words: str) -> None:
    (message,) = faults(statement)
    assert words in message


@pytest.mark.parametrize(
    ("statement", "name"),
    [
        ("r := WAVE(r);", "WAVE__REAL"),
        ("lr := WAVE(lr);", "WAVE__LREAL"),
        ("lr := WAVE(d);", "WAVE__LREAL"),
        ("r := WAVE(i);", "WAVE__REAL"),
        ("r := WAVE(1.5);", "WAVE__REAL"),
        ("lr := WAVE(X := 1.5);", "WAVE__LREAL"),
    ],
)
def test_overload_is_chosen_by_the_argument(statement: str, name: str) -> None:
    assert call(statement).function.name == name


def test_power_operator_calls_the_library() -> None:
    c = body_of("r : REAL; x : REAL;", "r := x ** 2;")[0].value  # type: ignore[union-attr]
    assert c.function.name == "EXPT__REAL"  # type: ignore[union-attr]


def test_external_function_has_the_signature_of_its_interface() -> None:
    external = call("lr := WAVE(lr);").function.external
    assert external == typed.External("sin", zlib.crc32(b"sin(LREAL):LREAL"), 0x00020003)
    assert call("r := WAVE(r);").function.external == typed.External("sinf", zlib.crc32(b"sinf(REAL):REAL"), 0x00010000)


def test_string_passed_by_reference_may_have_any_length() -> None:
    place = call("i := LENGTH(s);").args[0]
    assert isinstance(place, typed.VarPlace)
    assert place.type == StringType(10)
    assert isinstance(call("i := LENGTH('abc');").args[0], ValuePlace)


def test_extensible_function_is_folded_over_more_arguments() -> None:
    outer = call("s := JOIN(s, 'a', 'b');")
    assert isinstance(outer.args[0], Call)
    assert outer.type == StringType(255)


def test_attributes_reach_the_lowering() -> None:
    p = program(main(VARIABLES, "i := CLAMP(0, i, LENGTH(s));", FUNCTIONS), library=LIBRARY)
    units = {pou.name: pou for pou in p.pous}
    assert not units["CLAMP(INT)"].checks
    assert units["LENGTH"].checks
    assert units["LENGTH"].no_init


def test_library_is_checked_only_where_it_is_used() -> None:
    assert "unknown name" in messages(main("i : INT;", "i := UNUSED();"), library=LIBRARY)[0]
    assert messages(main("i : INT;", "i := 1;"), library=LIBRARY) == []


def test_conversion_to_text_calls_the_library() -> None:
    c = body_of("s : STRING; i : INT;", "s := INT_TO_STRING(i);")[0].value  # type: ignore[union-attr]
    assert c.function.name == "DINT_TO_STRING"  # type: ignore[union-attr]


# ---- function blocks ----


def test_function_block_takes_inputs_and_gives_outputs() -> None:
    c = fb_call("c(UP := b, TOTAL := d, Q => b2, N => i);")
    assert [v.name for v, _ in c.inputs] == ["UP"]
    assert [v.name for v, _ in c.in_outs] == ["TOTAL"]
    assert [v.name for v, _ in c.outputs] == ["Q", "N"]


def test_function_block_takes_positional_arguments() -> None:
    c = fb_call("c(b, 5, d);")
    assert [v.name for v, _ in c.inputs] == ["UP", "LIMIT"]


def test_output_of_another_type_is_converted_after_the_call() -> None:
    block, assign = statements("c(TOTAL := d, N => d);")
    assert isinstance(block, FbCall)
    assert block.outputs == []
    assert isinstance(assign, Assign)
    assert isinstance(assign.value, Convert)


def test_output_may_be_negated_or_go_to_a_bit() -> None:
    for text in ("c(TOTAL := d, NOT Q => b);", "c(TOTAL := d, Q => by.3);"):
        assert isinstance(statements(text)[1], Assign)


def test_instances_in_arrays_are_called_by_index() -> None:
    assert isinstance(fb_call("cs[i](TOTAL := d);").instance, typed.IndexPlace)


@pytest.mark.parametrize(
    ("statement", "message"),
    [
        ("c(UP := b);", "1: the VAR_IN_OUT TOTAL of COUNTER is missing"),
        ("c(UPP := b, TOTAL := d);", "3: COUNTER has no parameter UPP; did you mean UP?"),
        ("c(UP := i, TOTAL := d);", "9: INT does not fit BOOL; write INT_TO_BOOL(...), or compare it: <> 0"),
        ("c(TOTAL := d, Q := b);", "15: Q is given with =>"),
        ("c(TOTAL := d, N => b);", "15: INT does not fit BOOL; write INT_TO_BOOL(...), or compare it: <> 0"),
        ("c(TOTAL := d, N => 5);", "20: the output N needs a variable"),
        (
            "b := c(TOTAL := d);",
            "6: a call of the function block COUNTER is a statement and has no value; call it first, then read c.Q",
        ),
        ("c.Q := b;", "1: Q is an output of COUNTER and cannot be assigned to"),
        ("c.LAST := b;", "1: LAST is a local variable of COUNTER and cannot be assigned to"),
        ("c;", "1: c is an instance; a call of it is written c();"),
        ("i();", "1: i is not a function"),
    ],
)
def test_wrong_use_of_a_function_block_is_explained(statement: str, message: str) -> None:
    assert faults(statement) == [message]


def test_inputs_of_an_instance_may_be_assigned_and_inputs_outputs_and_constants_read() -> None:
    assert faults("c.UP := b; b2 := c.Q; b := c.UP; i := c.LIMIT;") == []


def test_variable_of_an_instance_is_not_written_from_outside() -> None:
    assert "local variable" in faults("c.LAST := b;")[0]


def test_function_block_in_a_function_lives_for_one_call() -> None:
    text = "FUNCTION F : INT VAR t : TON; END_VAR t(); F := 1; END_FUNCTION"
    (message,) = [m for m in messages(text, "warning") if "initialised" in m]
    assert "FUNCTION_BLOCK" in message
    assert messages(text) == []


def test_string_in_out_of_a_function_block_must_be_long_enough() -> None:
    text = "FUNCTION_BLOCK F VAR_IN_OUT s : STRING[20]; END_VAR s := 'x'; END_FUNCTION_BLOCK\n"
    assert messages(main("f : F; s : STRING[30];", "f(s := s);", text)) == []
    assert "too short" in messages(main("f : F; s : STRING[10];", "f(s := s);", text))[0]


def test_type_of_a_library_block_may_be_hidden_by_an_own_one() -> None:
    text = "FUNCTION_BLOCK COUNTER VAR_INPUT x : INT; END_VAR END_FUNCTION_BLOCK\n"
    body = body_of("c : COUNTER;", "c(x := 1);", text, library=LIBRARY)
    assert isinstance(body[0], FbCall)


# ---- EN and ENO ----


@pytest.mark.parametrize(
    "text", ["i := Add3(EN := b, a := 1, b := 2, ENO => b2);", "c(EN := b, TOTAL := d, ENO => b2);"]
)
def test_call_with_en_is_done_only_when_it_is_true(text: str) -> None:
    (guard,) = statements(text)
    assert isinstance(guard, If)
    condition, done = guard.branches[0]
    assert isinstance(condition, Load)
    assert [type(s) for s in done] in ([Assign, Assign], [FbCall, Assign])
    assert len(guard.otherwise) == 1


def test_en_inside_an_expression_is_an_error() -> None:
    assert "EN and ENO" in faults("i := 1 + Add3(EN := b, a := 1, b := 2);")[0]


def test_pous_hold_what_was_checked() -> None:
    p = program(main(VARIABLES, "i := Add3(1, 2);", FUNCTIONS), library=LIBRARY)
    assert all(isinstance(pou, Pou) for pou in p.pous)
    assert {"Add3", "Split", "Proc", "Main"} <= {pou.name for pou in p.pous}
