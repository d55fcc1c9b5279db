"""Functions, function blocks, C functions and strings."""

from __future__ import annotations

import pytest
from back_support import POS, ProgramBuilder, binary, build, const, load, place
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler.typed.nodes import (
    ArrayInit,
    Assign,
    BinaryOp,
    Call,
    CallStatement,
    Convert,
    Direction,
    Expr,
    External,
    FbCall,
    If,
    IndexPlace,
    Intrinsic,
    IntrinsicCall,
    MemberPlace,
    Parameter,
    Place,
    Pou,
    PouKind,
    Return,
    ScalarInit,
    Statement,
    Storage,
    StructInit,
    ValuePlace,
    Variable,
)
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    INT,
    LREAL,
    REAL,
    SINT,
    TIME,
    ArrayType,
    Field,
    StringType,
    StructType,
    Type,
)
from plctool.image.c_functions import interface_signature

STRING = StringType(80)


def local(name: str, t: Type, initial: ScalarInit | None = None) -> Variable:
    return Variable(name, t, Storage.LOCAL, POS, initial=initial)


def reference(name: str, t: Type) -> Variable:
    return Variable(name, t, Storage.REFERENCE, POS)


def assign(target: Variable | Place, value: Expr) -> Assign:
    return Assign(place(target) if isinstance(target, Variable) else target, value, POS)


def function(
    name: str,
    result: Variable | None,
    parameters: list[Parameter],
    *body: Statement,
    locals_: list[Variable] | None = None,
) -> Pou:
    variables = ([result] if result else []) + (locals_ or [])
    return Pou(name, PouKind.FUNCTION, POS, parameters, variables, result, body=list(body))


def inputs(*variables: Variable) -> list[Parameter]:
    return [Parameter(v, Direction.INPUT, v.storage is Storage.REFERENCE) for v in variables]


def add(left: Expr, right: Expr) -> Expr:
    return binary(BinaryOp.ADD, left, right)


# ---- functions ----


def test_scalars_go_by_value_and_come_back() -> None:
    a, b, r = local("a", INT), local("b", INT), local("F", INT)
    f = function("F", r, inputs(a, b), assign(a, add(load(a), load(b))), assign(r, load(a)))
    p = ProgramBuilder()
    x, y = p.variable("x", INT), p.variable("y", INT)
    run = p.run(assign(y, Call(f, [load(x), const(5)], INT, POS)))
    run["x"] = 10
    run.cycle()
    assert (run["x"], run["y"]) == (10, 15)


def test_locals_start_again_at_every_call() -> None:
    r, n = local("F", INT), local("n", INT, ScalarInit(7))
    f = function("F", r, [], assign(n, add(load(n), const(1))), assign(r, load(n)), locals_=[n])
    p = ProgramBuilder()
    y = p.variable("y", INT)
    run = p.run(assign(y, Call(f, [], INT, POS)), assign(y, add(load(y), Call(f, [], INT, POS))))
    run.cycle()
    assert run["y"] == 16


def test_return_gives_what_was_assigned_before() -> None:
    r = local("F", INT)
    f = function("F", r, [], assign(r, const(3)), Return(POS), assign(r, const(4)))
    p = ProgramBuilder()
    y = p.variable("y", INT)
    run = p.run(assign(y, Call(f, [], INT, POS)))
    run.cycle()
    assert run["y"] == 3


def test_in_out_and_output_reach_the_caller() -> None:
    io, out = reference("io", INT), reference("out", INT)
    parameters = [Parameter(io, Direction.IN_OUT, True), Parameter(out, Direction.OUTPUT, True)]
    f = function("F", None, parameters, assign(out, load(io)), assign(io, add(load(io), const(1))))
    p = ProgramBuilder()
    x, y = p.variable("x", INT), p.variable("y", INT)
    run = p.run(
        CallStatement(Call(f, [place(x), place(y)], INT, POS), POS),
        CallStatement(Call(f, [place(x), None], INT, POS), POS),
    )
    run["x"] = 5
    run.cycle()
    assert (run["x"], run["y"]) == (7, 5)


def test_array_input_written_in_the_function_is_a_copy() -> None:
    t = ArrayType(INT, ((0, 3),))
    a, r = local("a", t), local("F", INT)
    first = IndexPlace(place(a), [const(0)], INT, POS)
    f = function(
        "F", r, inputs(a), assign(first, const(9)), assign(r, load(IndexPlace(place(a), [const(3)], INT, POS)))
    )
    p = ProgramBuilder()
    x, y = p.variable("x", t), p.variable("y", INT)
    run = p.run(assign(y, Call(f, [load(x)], INT, POS)))
    run["x"] = [1, 2, 3, 4]
    run.cycle()
    assert (run["x"], run["y"]) == ([1, 2, 3, 4], 4)


def test_struct_results_come_through_memory_and_may_be_passed_on() -> None:
    s = StructType("S", [Field("a", INT), Field("b", DINT)])
    s.lay_out()
    r = Variable("Make", s, Storage.LOCAL, POS)
    n = local("n", DINT)
    make = function("Make", r, inputs(n), assign(MemberPlace(place(r), 4, DINT, POS), load(n)))
    v, total = reference("v", s), local("Get", DINT)
    get = function("Get", total, inputs(v), assign(total, load(MemberPlace(place(v), 4, DINT, POS))))
    p = ProgramBuilder()
    x, y = p.variable("x", s), p.variable("y", DINT)
    run = p.run(
        assign(x, Call(make, [const(7, DINT)], s, POS)),
        assign(y, Call(get, [Call(make, [const(8, DINT)], s, POS)], DINT, POS)),
    )
    run["x"] = {"a": 5, "b": 6}
    run.cycle()
    assert (run["x"], run["y"]) == ({"a": 0, "b": 7}, 8)


def test_a_result_is_complete_before_the_target_changes() -> None:
    """x := Swap(x) reads x while it builds its result."""
    s = StructType("S", [Field("a", INT), Field("b", INT)])
    s.lay_out()
    r, v = Variable("Swap", s, Storage.LOCAL, POS), reference("v", s)
    swap = function(
        "Swap", r, inputs(v),
        assign(MemberPlace(place(r), 0, INT, POS), load(MemberPlace(place(v), 2, INT, POS))),
        assign(MemberPlace(place(r), 2, INT, POS), load(MemberPlace(place(v), 0, INT, POS))),
    )  # fmt: skip
    p = ProgramBuilder()
    x = p.variable("x", s)
    run = p.run(assign(x, Call(swap, [load(x)], s, POS)))
    run["x"] = {"a": 1, "b": 2}
    run.cycle()
    assert run["x"] == {"a": 2, "b": 1}


def test_values_may_be_passed_by_reference() -> None:
    v, r = reference("v", INT), local("F", INT)
    f = function("F", r, inputs(v), assign(r, load(v)))
    p = ProgramBuilder()
    y = p.variable("y", INT)
    run = p.run(assign(y, Call(f, [ValuePlace(add(const(3), load(y)), INT, POS)], INT, POS)))
    run.cycle()
    run.cycle()
    assert run["y"] == 6


def test_what_is_not_called_is_not_in_the_image() -> None:
    unused = function("Unused", local("Unused", INT), [])
    p = ProgramBuilder()
    n = p.variable("n", INT)
    p.pous.append(unused)
    built = build(p.program(assign(n, const(1))))
    assert [u.name for u in built.symbols.pous] == ["Main"]


# ---- C functions ----


def external(name: str, text: str, result: Type, *parameters: Type) -> Pou:
    found = External(name, interface_signature(text), 0x00010000)
    variables = inputs(*(local(f"p{i}", t) for i, t in enumerate(parameters)))
    return Pou(name, PouKind.FUNCTION, POS, variables, result=local(name, result), external=found)


def test_c_functions_are_called_with_the_conventions_of_c() -> None:
    twice = external("twice", "twice(LREAL):LREAL", LREAL, LREAL)
    negate = external("negate", "negate(SINT,BOOL):SINT", SINT, SINT, BOOL)
    p = ProgramBuilder()
    x, n, b = p.variable("x", LREAL), p.variable("n", SINT), p.variable("b", BOOL)
    run = p.run(
        assign(x, Call(twice, [load(x)], LREAL, POS)),
        assign(n, Call(negate, [load(n), load(b)], SINT, POS)),
        assign(x, Call(twice, [load(x)], LREAL, POS)),
    )
    run["x"], run["n"], run["b"] = 1.5, -128, True
    run.cycle()
    assert (run["x"], run["n"]) == (6.0, -128)
    run["n"], run["b"] = 5, False
    run.cycle()
    assert run["n"] == 5
    assert [(e.name, e.offset) for e in run.image.externals] == [("twice", 0), ("negate", 8)]
    assert run.image.externals[0].signature == interface_signature("twice(LREAL):LREAL")


def test_what_a_c_function_calls_true_is_one() -> None:
    high_bits = external("high_bits", "high_bits(SINT):BOOL", BOOL, SINT)
    p = ProgramBuilder()
    b, n = p.variable("b", BOOL), p.variable("n", SINT)
    run = p.run(
        assign(b, Call(high_bits, [load(n)], BOOL, POS)),
        assign(n, Convert(load(b), SINT, POS)),
    )
    for number, expected in ((0x20, 1), (-1, 1), (0x0F, 0), (0, 0)):
        run["n"] = number
        run.cycle()
        assert run["n"] == expected


# ---- function blocks ----


def counter(checks: bool = True) -> tuple[Pou, StructType]:
    """A block that counts by STEP, up to a limit it is given by reference."""
    t = StructType("Counter", [Field("step", INT), Field("n", DINT), Field("limit", DINT), Field("at", INT)])
    t.fields[2] = Field("limit", LREAL)  # eight bytes hold the pointer
    t.lay_out()
    step, n, at = (
        Variable(f, t.member(f).type, Storage.SELF, POS, offset=t.member(f).offset) for f in ("step", "n", "at")
    )  # type: ignore[union-attr]
    limit = Variable("limit", DINT, Storage.REFERENCE, POS, offset=t.fields[2].offset)
    block = Pou(
        "Counter", PouKind.FUNCTION_BLOCK, POS, [*inputs(step), Parameter(limit, Direction.IN_OUT, True)], instance=t
    )
    block.body = [
        If([(binary(BinaryOp.LT, load(n), load(limit)), [assign(n, add(load(n), const(1, DINT)))])], [], POS),
        assign(limit, add(load(limit), const(0, DINT))),
        assign(at, add(load(at), load(step))),
    ]
    block.checks = checks
    return block, t


def test_instances_keep_their_own_values_and_in_outs_are_references() -> None:
    block, t = counter()
    step, n = block.parameters[0].variable, Variable("n", DINT, Storage.SELF, POS, offset=4)
    p = ProgramBuilder()
    one, two = p.variable("one", t), p.variable("two", t)
    a, b, out = p.variable("a", DINT), p.variable("b", DINT), p.variable("out", DINT)
    limit = block.parameters[1].variable
    run = p.run(
        FbCall(block, place(one), [(step, const(2))], [(limit, place(a))], [(n, place(out))], POS),
        FbCall(block, place(two), [], [(limit, place(b))], [], POS),
    )
    run["a"], run["b"] = 100, 2
    for _ in range(5):
        run.cycle()
    assert (run["one.n"], run["two.n"], run["out"]) == (5, 2, 5)
    assert (run["one.at"], run["two.at"]) == (10, 0)


def test_an_array_of_instances_is_called_by_index() -> None:
    block, t = counter()
    limit = block.parameters[1].variable
    p = ProgramBuilder()
    array, i, top = p.variable("array", ArrayType(t, ((1, 3),))), p.variable("i", INT), p.variable("top", DINT)
    run = p.run(FbCall(block, IndexPlace(place(array), [load(i)], t, POS), [], [(limit, place(top))], [], POS))
    run["top"], run["i"] = 10, 3
    run.cycle()
    assert [e["n"] for e in run["array"]] == [0, 0, 1]


def test_time_is_that_of_the_cycle() -> None:
    p = ProgramBuilder()
    t = p.variable("t", TIME)
    run = p.run(assign(t, IntrinsicCall(Intrinsic.TIME, [], TIME, POS)))
    run.context.time_ms = 1234
    run.cycle()
    assert run["t"] == "T#1s234ms"


def test_two_tasks_have_entries_of_their_own() -> None:
    p = ProgramBuilder()
    n = p.variable("n", INT)
    program = p.program(assign(n, add(load(n), const(1))))
    second = Pou("Second", PouKind.PROGRAM, POS, body=[assign(n, add(load(n), const(10)))])
    program.tasks[0].programs.append(second)
    program.tasks.append(type(program.tasks[0])("other", program.tasks[0].kind, 1, 500, [second]))
    from back_support import Running

    run = Running(build(program))
    run.cycle(0)
    run.cycle(1)
    assert run["n"] == 21
    assert [(t.name, t.interval_us) for t in run.image.tasks] == [("task", 1000), ("other", 500)]


# ---- strings ----

text = st.text(st.characters(min_codepoint=1, max_codepoint=255), max_size=100)


@pytest.mark.parametrize("target", [5, 20, 80, 200])
@pytest.mark.parametrize("source", [5, 20, 80, 200])
def test_string_assignment_cuts_and_leaves_the_neighbours_alone(source: int, target: int) -> None:
    p = ProgramBuilder()
    a, before = p.variable("a", StringType(source)), p.variable("before", BYTE)
    b, after = p.variable("b", StringType(target)), p.variable("after", BYTE)
    run = p.run(assign(b, load(a)))
    run["before"] = run["after"] = 0xA5

    @examples(40)
    @given(text)
    def check(value: str) -> None:
        run["a"] = value[:source]
        run.cycle()
        assert run["b"] == value[: min(source, target)]
        assert run["before"] == run["after"] == 0xA5
        assert (before.offset, after.offset) != (0, 0)

    check()


@pytest.mark.parametrize("capacities", [(80, 80), (5, 80), (20, 33), (200, 16)], ids=str)
def test_strings_compare_byte_by_byte(capacities: tuple[int, int]) -> None:
    p = ProgramBuilder()
    a, b = p.variable("a", StringType(capacities[0])), p.variable("b", StringType(capacities[1]))
    ops = [BinaryOp.EQ, BinaryOp.NE, BinaryOp.LT, BinaryOp.LE, BinaryOp.GT, BinaryOp.GE]
    results = [p.variable(op.name, BOOL) for op in ops]
    run = p.run(*(assign(r, binary(op, load(a), load(b))) for op, r in zip(ops, results, strict=True)))

    @examples(80)
    @given(text, st.one_of(text, st.none()), st.integers(0, 80))
    def check(left: str, right: str | None, cut: int) -> None:
        x = left[: capacities[0]]
        y = (left[:cut] if right is None else right)[: capacities[1]]
        run["a"], run["b"] = x, y
        run.cycle()
        assert [run[op.name] for op in ops] == [x == y, x != y, x < y, x <= y, x > y, x >= y]

    check()


@pytest.mark.parametrize("literal", ["", "1", "abc", "abcdefgh", "abcdefghijklmno", "abcdefghijklmnopqrstuvwxyz"])
def test_comparison_with_a_literal(literal: str) -> None:
    p = ProgramBuilder()
    s, small = p.variable("s", STRING), p.variable("small", StringType(2))
    eq, ne, never = p.variable("eq", BOOL), p.variable("ne", BOOL), p.variable("never", BOOL)
    run = p.run(
        assign(eq, binary(BinaryOp.EQ, load(s), const(literal, StringType(len(literal))))),
        assign(ne, binary(BinaryOp.NE, const(literal, StringType(len(literal))), load(s))),
        assign(never, binary(BinaryOp.EQ, load(small), const(literal, StringType(len(literal))))),
    )
    for value in ("", "1", "2", "abc", "abd", "abcd", "ab", "abcdefgh", "abcdefghi", literal, literal[:-1] + "~"):
        run["s"], run["small"] = value, value[:2]
        run.cycle()
        assert (run["eq"], run["ne"]) == (value == literal, value != literal)
        assert run["never"] == (value[:2] == literal)


def test_a_string_without_nul_does_no_harm() -> None:
    p = ProgramBuilder()
    a, b, big = p.variable("a", StringType(4)), p.variable("b", StringType(80)), p.variable("big", StringType(200))
    c = p.variable("c", BOOL)
    run = p.run(assign(b, load(a)), assign(big, load(b)), assign(c, binary(BinaryOp.EQ, load(a), load(b))))
    run["a"] = "wxyz"
    import ctypes

    ctypes.memset(run.context.area[0] + 4, ord("!"), 1)  # the NUL of a
    run.cycle()
    assert (run["b"], run["big"], run["c"]) == ("wxyz", "wxyz", True)


def exclaim() -> Pou:
    """Exclaim(s) is s with its first character replaced, built in the result."""
    s, r = reference("s", STRING), Variable("Exclaim", STRING, Storage.LOCAL, POS)
    return function(
        "Exclaim",
        r,
        inputs(s),
        assign(r, load(s)),
        assign(IndexPlace(place(r), [const(0)], BYTE, POS), const(33, BYTE)),
    )


def test_string_results_are_cut_and_may_be_arguments() -> None:
    f = exclaim()
    p = ProgramBuilder()
    a, b, c = p.variable("a", STRING), p.variable("b", StringType(3)), p.variable("c", STRING)
    run = p.run(
        assign(b, Call(f, [load(a)], STRING, POS)),
        assign(c, Call(f, [Call(f, [const("xyz", StringType(3))], STRING, POS)], STRING, POS)),
        assign(a, Call(f, [load(a)], STRING, POS)),
    )
    run["a"] = "hello"
    run.cycle()
    assert (run["a"], run["b"], run["c"]) == ("!ello", "!el", "!yz")


def test_string_size_is_that_of_the_actual_argument() -> None:
    s, r = reference("s", STRING), local("Size", INT)
    size = function("Size", r, inputs(s), assign(r, IntrinsicCall(Intrinsic.STRING_SIZE, [load(s)], INT, POS)))
    p = ProgramBuilder()
    a, n = p.variable("a", StringType(200)), p.variable("n", INT)
    run = p.run(assign(n, add(Call(size, [load(a)], INT, POS), Call(size, [const("abc", StringType(3))], INT, POS))))
    run.cycle()
    assert run["n"] == 203


def test_select_of_strings() -> None:
    p = ProgramBuilder()
    g, r = p.variable("g", BOOL), p.variable("r", STRING)
    args: list[Expr] = [load(g), const("no", StringType(2)), const("yes", StringType(3))]
    run = p.run(assign(r, IntrinsicCall(Intrinsic.SELECT, args, STRING, POS)))
    for value, expected in ((False, "no"), (True, "yes")):
        run["g"] = value
        run.cycle()
        assert run["r"] == expected


# ---- initial values ----


def test_initial_values_of_all_kinds() -> None:
    s = StructType("S", [Field("a", INT), Field("b", REAL), Field("c", StringType(7)), Field("d", INT)])
    s.lay_out()
    p = ProgramBuilder()
    p.defaults["S"] = StructInit({"a": ScalarInit(3), "c": ScalarInit("abc")})
    p.variable("n", DINT, ScalarInit(-5))
    p.variable("x", REAL, ScalarInit(0.1))
    p.variable("text", STRING, ScalarInit("hello"))
    p.variable("cut", StringType(2), ScalarInit("hello"))
    p.variable("same", ArrayType(INT, ((0, 99),)), ArrayInit([(90, ScalarInit(7))]))
    p.variable("mixed", ArrayType(DINT, ((0, 9),)), ArrayInit([(2, None), *((1, ScalarInit(i)) for i in range(1, 7))]))
    p.variable("few", ArrayType(REAL, ((0, 9),)), ArrayInit([(5, None), (1, ScalarInit(1.5))]))
    p.variable("plain", s)
    p.variable("given", s, StructInit({"b": ScalarInit(2.5)}))
    p.variable("many", ArrayType(s, ((0, 9),)), ArrayInit([(1, StructInit({"d": ScalarInit(9)}))]))
    p.variable(
        "grid", ArrayType(ArrayType(INT, ((0, 2),)), ((0, 1),)), ArrayInit([(2, ArrayInit([(3, ScalarInit(4))]))])
    )
    run = p.run()
    default = {"a": 3, "b": 0.0, "c": "abc", "d": 0}
    assert (run["n"], run["x"], run["text"], run["cut"]) == (-5, 0.1, "hello", "he")
    assert run["same"] == [7] * 90 + [0] * 10
    assert run["mixed"] == [0, 0, 1, 2, 3, 4, 5, 6, 0, 0]
    assert run["few"] == [0] * 5 + [1.5] + [0] * 4
    assert run["plain"] == default
    assert run["given"] == {**default, "b": 2.5}
    assert run["many"] == [{**default, "d": 9}] + [default] * 9
    assert run["grid"] == [[4, 4, 4], [4, 4, 4]]
