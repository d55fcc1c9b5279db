"""Statements: branches, loops, arrays, bits, pointers and run-time checks."""

from __future__ import annotations

import functools

import pytest
from back_support import POS, ProgramBuilder, Running, binary, const, load, place, pos
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler.codegen.lower_unit import ALL_CHECKS, Check
from plctool.compiler.typed.nodes import (
    AddressOf,
    Assign,
    BinaryOp,
    BitPlace,
    Call,
    CallStatement,
    Case,
    Continue,
    Convert,
    DerefPlace,
    Direction,
    Exit,
    Expr,
    For,
    If,
    IndexPlace,
    MemberPlace,
    Parameter,
    Pou,
    PouKind,
    Repeat,
    Return,
    Statement,
    Storage,
    Variable,
    While,
)
from plctool.compiler.typed.ranges import type_range
from plctool.iec.common_types import SIGNED
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    DWORD,
    INT,
    LINT,
    SINT,
    UDINT,
    UINT,
    USINT,
    ArrayType,
    Elementary,
    Field,
    PointerType,
    StringType,
    StructType,
)

ARRAYBOUNDS, DIVIDEBYZERO, ACCESS_VIOLATION = 0x101, 0x102, 0x51


def assign(var: Variable, value: Expr) -> Assign:
    return Assign(place(var), value, POS)


def increment(var: Variable, by: int = 1) -> Assign:
    return assign(var, binary(BinaryOp.ADD, load(var), const(by, var.type)))


def element(array: Variable, *indices: Expr, line: int = 1) -> IndexPlace:
    assert isinstance(array.type, ArrayType)
    return IndexPlace(place(array), list(indices), array.type.element, pos(line))


# ---- IF and CASE ----


def test_if_takes_the_first_branch_that_holds() -> None:
    p = ProgramBuilder()
    n, r = p.variable("n", INT), p.variable("r", INT)
    run = p.run(
        If(
            [
                (binary(BinaryOp.LT, load(n), const(10)), [assign(r, const(1))]),
                (binary(BinaryOp.LT, load(n), const(20)), [assign(r, const(2))]),
            ],
            [assign(r, const(3))],
            POS,
        )
    )
    for value, expected in ((5, 1), (15, 2), (25, 3)):
        run["n"] = value
        run.cycle()
        assert run["r"] == expected


@pytest.mark.parametrize("t", [INT, SINT, UINT, USINT, LINT], ids=str)
def test_case_with_values_ranges_and_else(t: Elementary) -> None:
    low, high = type_range(t) or (0, 0)
    branches = [((low, low), 1), ((1, 3), 2), ((10, 120), 3), ((high, high), 4)]
    p = ProgramBuilder()
    n, r = p.variable("n", t), p.variable("r", INT)
    body: list[tuple[list[tuple[int, int]], list[Statement]]] = [([b], [assign(r, const(i))]) for b, i in branches]
    run = p.run(Case(load(n), body, [assign(r, const(9))], POS))
    for value in {low, low + 4, 1, 2, 3, 4, 9, 10, 64, 120, 121, high - 1, high}:
        run["n"] = value
        run.cycle()
        assert run["r"] == next((i for (a, b), i in branches if a <= value <= b), 9), value


# ---- loops ----


def for_model(start: int, stop: int, step: int, low: int, high: int) -> tuple[list[int], int]:
    """The values in the body and the value after it."""
    seen, k = [], start
    if not (k <= stop if step > 0 else k >= stop):
        return [], start
    while True:
        seen.append(k)
        following = k + step
        k = min(max(following, low), high)
        if k != following or not (k <= stop if step > 0 else k >= stop):
            return seen, k


@functools.cache
def for_loop(t: Elementary, step: int | None, step_type: Elementary, modified: bool, level: int) -> Running:
    """n counts, total is a hash of the values; `step` None: from a variable. `modified`: the body assigns k := k."""
    p = ProgramBuilder()
    k, start, stop = (p.variable(name, t) for name in ("k", "start", "stop"))
    by = p.variable("by", step_type)
    n, total = p.variable("n", DINT), p.variable("total", LINT)
    body: list[Statement] = [
        increment(n),
        assign(
            total, binary(BinaryOp.ADD, binary(BinaryOp.MUL, load(total), const(3, LINT)), Convert(load(k), LINT, POS))
        ),
    ]
    if modified:
        body.append(assign(k, load(k)))
    step_value: Expr = load(by) if step is None else const(step, step_type)
    return p.run(
        assign(n, const(0, DINT)),
        assign(total, const(0, LINT)),
        For(place(k), load(start), load(stop), step_value, body, POS),
        level=level,
    )


@pytest.mark.parametrize("modified", [False, True])
@pytest.mark.parametrize("t", [SINT, USINT, INT], ids=str)
def test_for_runs_as_specified_at_all_limits(t: Elementary, modified: bool) -> None:
    low, high = type_range(t) or (0, 0)
    edge = st.one_of(st.sampled_from([low, low + 1, high - 1, high]), st.integers(-4, 4), st.integers(low, high))
    number = edge.map(lambda v: min(max(v, low), high))
    steps = st.sampled_from([1, 2, 3, 7, 100, -1, -2, -7, -100, -128])

    @examples(250)
    @given(number, number, steps, st.booleans(), st.booleans(), st.sampled_from([0, 2]))
    def check(start: int, stop: int, step: int, signed: bool, constant: bool, level: int) -> None:
        step_type = SIGNED[t.bits] if signed or step < 0 else t
        run = for_loop(t, step if constant else None, step_type, modified, level)
        run["start"], run["stop"], run["by"] = start, stop, step
        assert run.cycle() == 0
        seen, after = for_model(start, stop, step, low, high)
        total = 0
        for value in seen:
            total = (total * 3 + value + 2**63) % 2**64 - 2**63
        assert (run["n"], run["total"], run["k"]) == (len(seen), total, after)

    check()


def test_for_with_step_zero_raises() -> None:
    run = for_loop(INT, None, INT, False, 2)
    run["start"], run["stop"], run["by"] = 1, 3, 0
    assert run.cycle() == DIVIDEBYZERO


def test_the_body_may_change_the_for_variable() -> None:
    p = ProgramBuilder()
    k, n = p.variable("k", INT), p.variable("n", INT)
    run = p.run(For(place(k), const(1), const(10), const(1), [increment(n), increment(k, 2)], POS))
    run.cycle()
    assert run["n"] == 4  # 1, 4, 7, 10


def test_a_called_function_sees_the_for_variable() -> None:
    p = ProgramBuilder()
    k, total = p.variable("k", INT), p.variable("total", INT)
    add = Pou("Add", PouKind.FUNCTION, POS, body=[assign(total, binary(BinaryOp.ADD, load(total), load(k)))])
    run = p.run(For(place(k), const(1), const(4), const(1), [CallStatement(Call(add, [], INT, POS), POS)], POS))
    run.cycle()
    assert run["total"] == 10


def test_a_pointer_may_change_the_for_variable() -> None:
    p = ProgramBuilder()
    k, n, q = p.variable("k", INT), p.variable("n", INT), p.variable("q", PointerType(INT))
    set_k = Assign(DerefPlace(load(q), INT, POS), const(100), POS)
    run = p.run(
        assign(q, AddressOf(place(k), PointerType(INT), POS)),
        For(place(k), const(1), const(10), const(1), [increment(n), set_k], POS),
    )
    run.cycle()
    assert (run["n"], run["k"]) == (1, 101)


def test_exit_and_continue_belong_to_the_innermost_loop() -> None:
    p = ProgramBuilder()
    i, j, n = p.variable("i", INT), p.variable("j", INT), p.variable("n", INT)
    inner: list[Statement] = [
        If([(binary(BinaryOp.EQ, load(j), const(2)), [Continue(POS)])], [], POS),
        If([(binary(BinaryOp.EQ, load(j), const(4)), [Exit(POS)])], [], POS),
        increment(n),
    ]
    run = p.run(
        For(place(i), const(1), const(3), const(1), [For(place(j), const(1), const(9), const(1), inner, POS)], POS)
    )
    run.cycle()
    assert (run["n"], run["j"], run["i"]) == (6, 4, 4)


def test_while_and_repeat_with_continue() -> None:
    p = ProgramBuilder()
    w, r, n = p.variable("w", INT), p.variable("r", INT), p.variable("n", INT)
    run = p.run(
        While(binary(BinaryOp.LT, load(w), const(5)), [increment(w), Continue(POS), increment(n, 100)], POS),
        Repeat([increment(r), Continue(POS), increment(n, 100)], binary(BinaryOp.GE, load(r), const(3)), POS),
    )
    run.cycle()
    assert (run["w"], run["r"], run["n"]) == (5, 3, 0)


def test_code_after_return_is_not_run() -> None:
    p = ProgramBuilder()
    n = p.variable("n", INT)
    run = p.run(increment(n), If([(const(1, BOOL), [Return(POS), increment(n, 10)])], [], POS), increment(n, 100))
    run.cycle()
    assert run["n"] == 1


# ---- arrays and structs ----


@pytest.mark.parametrize("t", [INT, USINT, DINT, LINT, UDINT], ids=str)
@pytest.mark.parametrize("bounds", [(0, 9), (-3, 4), (5, 12)], ids=str)
def test_any_index_out_of_bounds_raises_with_its_line(bounds: tuple[int, int], t: Elementary) -> None:
    p = ProgramBuilder()
    a, i, before = p.variable("a", ArrayType(INT, (bounds,))), p.variable("i", t), p.variable("n", INT)
    run = p.run(increment(before), Assign(element(a, load(i), line=7), const(1), pos(6)))
    low, high = type_range(t) or (0, 0)
    for value in {low, high, *range(bounds[0] - 2, bounds[1] + 3), 1 << 32 if high > 1 << 32 else high}:
        if not low <= value <= high:
            continue
        run.initialise()
        run["i"] = value
        inside = bounds[0] <= value <= bounds[1]
        assert run.cycle() == (0 if inside else ARRAYBOUNDS), value
        if inside:
            assert run[f"a[{value}]"] == 1
        else:
            line = run.built.symbols.address_to_line(run.raised_at)
            assert line is not None and (line.pou, line.file, line.line) == ("Main", "main.st", 7)
            assert run["n"] > 0  # what came before has reached memory


def test_indices_run_row_major() -> None:
    p = ProgramBuilder()
    t = ArrayType(INT, ((1, 3), (-1, 2), (0, 1)))
    a, i, j, k = p.variable("a", t), p.variable("i", INT), p.variable("j", INT), p.variable("k", INT)
    run = p.run(Assign(element(a, load(i), load(j), load(k)), const(7), POS))
    for index in ((1, -1, 0), (3, 2, 1), (2, 0, 1)):
        run["i"], run["j"], run["k"] = index
        assert run.cycle() == 0
        assert run[f"a[{index[0]},{index[1]},{index[2]}]"] == 7
    run["j"] = 3
    assert run.cycle() == ARRAYBOUNDS


def test_a_constant_index_costs_no_check() -> None:
    p = ProgramBuilder()
    a = p.variable("a", ArrayType(INT, ((1, 3),)))
    run = p.run(Assign(element(a, const(3)), const(5), POS))
    run.cycle()
    assert run["a"] == [0, 0, 5]
    assert run.image.externals == []


def test_a_for_variable_within_the_bounds_costs_no_check() -> None:
    p = ProgramBuilder()
    a, i = p.variable("a", ArrayType(INT, ((1, 100),))), p.variable("i", INT)
    run = p.run(For(place(i), const(1), const(100), const(1), [Assign(element(a, load(i)), load(i), POS)], POS))
    run.cycle()
    assert run["a"] == list(range(1, 101))
    assert run.image.externals == []


def test_checks_can_be_left_out_one_by_one() -> None:
    p = ProgramBuilder()
    a, i = p.variable("a", ArrayType(INT, ((0, 3),))), p.variable("i", INT)
    statement = Assign(element(a, load(i)), const(1), POS)
    assert p.run(statement, checks=ALL_CHECKS - {Check.BOUNDS}).image.externals == []
    assert len(p.run(statement, checks=frozenset({Check.BOUNDS})).image.externals) == 1


def test_struct_assignment_copies_and_members_have_their_offsets() -> None:
    s = StructType("S", [Field("b", BYTE), Field("d", DINT), Field("w", INT)])
    s.lay_out()
    p = ProgramBuilder()
    x, y, a = p.variable("x", s), p.variable("y", s), p.variable("a", ArrayType(s, ((0, 2),)))
    run = p.run(
        Assign(MemberPlace(place(x), 4, DINT, POS), const(11, DINT), POS),
        assign(y, load(x)),
        Assign(element(a, const(1)), load(y), POS),
        Assign(MemberPlace(place(x), 4, DINT, POS), const(22, DINT), POS),
    )
    run.cycle()
    assert (run["x"]["d"], run["y"]["d"], run["a[1].d"]) == (22, 11, 11)


# ---- bits, pointers, subranges ----


def test_bits_are_set_and_read_in_place() -> None:
    p = ProgramBuilder()
    w, b, n = p.variable("w", DWORD), p.variable("b", BOOL), p.variable("n", BOOL)
    run = p.run(
        Assign(BitPlace(place(w), 31, BOOL, POS), const(1, BOOL), POS),
        Assign(BitPlace(place(w), 0, BOOL, POS), load(b), POS),
        Assign(BitPlace(place(w), 3, BOOL, POS), const(0, BOOL), POS),
        assign(n, load(BitPlace(place(w), 31, BOOL, POS))),
    )
    run["w"], run["b"] = 0x0000_00FE, True
    run.cycle()
    assert (run["w"], run["n"]) == (0x8000_00F7, True)
    run["b"] = False
    run.cycle()
    assert run["w"] == 0x8000_00F6


def test_a_bit_as_in_out_argument_is_written_back() -> None:
    p = ProgramBuilder()
    w = p.variable("w", DWORD)
    flag = Variable("flag", BOOL, Storage.REFERENCE, POS)
    toggle = Pou(
        "Toggle", PouKind.FUNCTION, POS, [Parameter(flag, Direction.IN_OUT, True)], body=[assign(flag, const(1, BOOL))]
    )
    run = p.run(CallStatement(Call(toggle, [BitPlace(place(w), 5, BOOL, POS)], INT, POS), POS))
    run.cycle()
    assert run["w"] == 32


def test_null_pointer_raises_unless_unchecked() -> None:
    p = ProgramBuilder()
    q, n = p.variable("q", PointerType(INT)), p.variable("n", INT)
    run = p.run(increment(n), Assign(DerefPlace(load(q), INT, POS), const(1), POS))
    assert run.cycle() == ACCESS_VIOLATION


def test_pointers_reach_their_variable() -> None:
    p = ProgramBuilder()
    q, n = p.variable("q", PointerType(INT)), p.variable("n", INT)
    target = DerefPlace(load(q), INT, POS)
    run = p.run(
        assign(q, AddressOf(place(n), PointerType(INT), POS)),
        Assign(target, binary(BinaryOp.ADD, load(target), const(2)), POS),
        increment(n),
    )
    run.cycle()
    assert run["n"] == 3


def test_pointers_may_lie_over_other_types() -> None:
    """Telegrams are decoded that way: what is written through the pointer is seen in the bytes."""
    s = StructType("Head", [Field("id", INT), Field("n", INT)])
    s.lay_out()
    p = ProgramBuilder()
    a, q, r = p.variable("a", ArrayType(BYTE, ((0, 3),))), p.variable("q", PointerType(s)), p.variable("r", BYTE)
    run = p.run(
        assign(q, AddressOf(place(a), PointerType(s), POS)),
        Assign(element(a, const(2)), const(1, BYTE), POS),
        Assign(MemberPlace(DerefPlace(load(q), s, POS), 2, INT, POS), const(0x0203), POS),
        assign(r, load(element(a, const(2)))),
    )
    run.cycle()
    assert run["r"] == 3


@pytest.mark.parametrize("source", [INT, DINT, USINT, LINT], ids=str)
def test_subrange_violations_raise(source: Elementary) -> None:
    p = ProgramBuilder()
    n, r = p.variable("n", source), p.variable("r", INT)
    run = p.run(assign(r, Convert(load(n), INT, POS, check=(-10, 100))))
    low, high = type_range(source) or (0, 0)
    for value in {low, high, -11, -10, 0, 100, 101}:
        if low <= value <= high:
            run["n"] = value
            assert run.cycle() == (0 if -10 <= value <= 100 else ARRAYBOUNDS), value


def test_string_index_reaches_the_place_of_the_nul() -> None:
    p = ProgramBuilder()
    s, i, b = p.variable("s", StringType(5)), p.variable("i", INT), p.variable("b", BYTE)
    run = p.run(assign(b, load(IndexPlace(place(s), [load(i)], BYTE, POS))))
    run["s"] = "abcde"
    for index, expected in ((0, (0, 97)), (4, (0, 101)), (5, (0, 0)), (6, (ARRAYBOUNDS, 0)), (-1, (ARRAYBOUNDS, 0))):
        run["i"] = index
        assert run.cycle() == expected[0]
        if not expected[0]:
            assert run["b"] == expected[1]


def test_each_check_keeps_its_own_line() -> None:
    p = ProgramBuilder()
    a, i, j = p.variable("a", ArrayType(INT, ((0, 3),))), p.variable("i", INT), p.variable("j", INT)
    run = p.run(
        Assign(element(a, load(i), line=10), const(1), pos(10)),
        Assign(element(a, load(j), line=20), const(1), pos(20)),
    )
    for name, line in (("i", 10), ("j", 20)):
        run["i"] = run["j"] = 0
        run[name] = 9
        assert run.cycle() == ARRAYBOUNDS
        found = run.built.symbols.address_to_line(run.raised_at)
        assert found is not None and found.line == line
