"""Operators, conversions and intrinsics give the same as exact arithmetic, for all types and all values."""

from __future__ import annotations

import functools
import math
import struct

import pytest
from back_support import ProgramBuilder, Running, binary, const, load, place
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler.codegen.lower_unit import ALL_CHECKS, Check
from plctool.compiler.typed.nodes import (
    Assign,
    BinaryOp,
    Convert,
    Expr,
    Intrinsic,
    IntrinsicCall,
    Pos,
    Rounding,
    Unary,
    UnaryOp,
)
from plctool.compiler.typed.ranges import type_range
from plctool.iec.types import (
    BOOL,
    BYTE,
    DINT,
    DWORD,
    INT,
    LINT,
    LREAL,
    LWORD,
    REAL,
    SINT,
    TIME,
    UDINT,
    UINT,
    ULINT,
    USINT,
    WORD,
    Elementary,
    Type,
)  # fmt: skip

P = Pos("main.st", 1, 1)
INTEGERS = [SINT, INT, DINT, LINT, USINT, UINT, UDINT, ULINT]
BITS = [BYTE, WORD, DWORD, LWORD]
DIVIDEBYZERO = 0x102
NO_DIV = ALL_CHECKS - {Check.DIV}
few = examples(30)


def wrap(value: int, t: Elementary) -> int:
    value &= (1 << t.bits) - 1
    return value - (1 << t.bits) if t.signed and value >> (t.bits - 1) else value


def limits(t: Type) -> tuple[int, int]:
    found = type_range(t)
    assert found is not None
    return found


def values(t: Elementary) -> st.SearchStrategy[int]:
    low, high = limits(t)
    return st.one_of(
        st.sampled_from([low, low + 1, high, high - 1, 0, 1]), st.integers(low, high), st.integers(-3, 3)
    ).map(lambda v: min(max(v, low), high))


reals = st.one_of(
    st.floats(width=32),
    st.integers(-1000, 1000).map(lambda n: n / 2),
    st.sampled_from([2.0**31, -(2.0**31), 2.0**63, 2.0**23 + 1, 2.0**22 + 0.5, -0.5, 0.5, 1.5, 2.5, 1e30, -1e30]),
)


@functools.cache
def running(expression: str, types: tuple[Type, ...], result: Type, level: int, checked: bool) -> Running:
    """A program r := f(a, b)."""
    p = ProgramBuilder()
    r = p.variable("r", result)
    operands: list[Expr] = [load(p.variable(name, t)) for name, t in zip("abc", types, strict=False)]
    body = Assign(place(r), EXPRESSIONS[expression](operands, result), P)
    return p.run(body, level=level, checks=ALL_CHECKS if checked else NO_DIV)


def intrinsic(which: Intrinsic):  # type: ignore[no-untyped-def]
    return lambda operands, result: IntrinsicCall(which, operands, result, P)


EXPRESSIONS = {
    **{op.name: functools.partial(lambda op, o, r: binary(op, *o), op) for op in BinaryOp},
    **{op.name: intrinsic(op) for op in Intrinsic},
    "NEG": lambda o, r: Unary(UnaryOp.NEG, o[0], r, P),
    "NOT": lambda o, r: Unary(UnaryOp.NOT, o[0], r, P),
    "CONVERT": lambda o, r: Convert(o[0], r, P),
    "TRUNCATE": lambda o, r: Convert(o[0], r, P, rounding=Rounding.ZERO),
}


def evaluate(
    expression: str, types: tuple[Type, ...], result: Type, *args: object, level: int = 2, checked: bool = True
) -> object:
    run = running(expression, types, result, level, checked)
    for name, value in zip("abc", args, strict=False):
        run[name] = value
    code = run.cycle()
    return ("raised", code) if code else run["r"]


def divide(a: int, b: int) -> int:
    return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


MODEL = {
    "ADD": lambda a, b: a + b,
    "SUB": lambda a, b: a - b,
    "MUL": lambda a, b: a * b,
    "DIV": divide,
    "MOD": lambda a, b: a - b * divide(a, b),
    "AND": lambda a, b: a & b,
    "OR": lambda a, b: a | b,
    "XOR": lambda a, b: a ^ b,
}


@pytest.mark.parametrize("t", INTEGERS, ids=str)
@pytest.mark.parametrize("op", ["ADD", "SUB", "MUL", "DIV", "MOD"])
def test_integer_operators_wrap_as_exact_arithmetic_does(op: str, t: Elementary) -> None:
    @few
    @given(values(t), values(t))
    def check(a: int, b: int) -> None:
        got = evaluate(op, (t, t), t, a, b)
        if op in ("DIV", "MOD") and b == 0:
            assert got == ("raised", DIVIDEBYZERO)
        else:
            assert got == wrap(MODEL[op](a, b), t)

    check()


@pytest.mark.parametrize("t", INTEGERS, ids=str)
@pytest.mark.parametrize("op", ["DIV", "MOD"])
def test_division_by_zero_without_checks_gives_a_number(op: str, t: Elementary) -> None:
    low, high = limits(t)
    for a in (low, -1 if t.signed else 1, 0, high):
        assert isinstance(evaluate(op, (t, t), t, a, 0, checked=False), int)
    if t.signed:
        assert evaluate(op, (t, t), t, low, -1, checked=False) == (low if op == "DIV" else 0)
    assert evaluate(op, (t, t), t, high, 3, checked=False) == wrap(MODEL[op](high, 3), t)


@pytest.mark.parametrize("level", [0, 2])
def test_minimum_divided_by_minus_one_wraps(level: int) -> None:
    for t in (SINT, INT, DINT, LINT):
        low, _ = limits(t)
        assert evaluate("DIV", (t, t), t, low, -1, level=level) == low
        assert evaluate("MOD", (t, t), t, low, -1, level=level) == 0


@pytest.mark.parametrize("divisor", [-1, 1, 2, 7, -8])
@pytest.mark.parametrize("t", [SINT, INT, DINT, LINT], ids=str)
def test_constant_divisors(t: Elementary, divisor: int) -> None:
    p = ProgramBuilder()
    q, m, a = p.variable("q", t), p.variable("m", t), p.variable("a", t)
    run = p.run(
        Assign(place(q), binary(BinaryOp.DIV, load(a), const(divisor, t)), P),
        Assign(place(m), binary(BinaryOp.MOD, load(a), const(divisor, t)), P),
    )
    for value in (*limits(t), 0, 1, -1, 100, -100):
        run["a"] = value
        assert run.cycle() == 0
        assert (run["q"], run["m"]) == (wrap(divide(value, divisor), t), wrap(MODEL["MOD"](value, divisor), t))


@pytest.mark.parametrize("op", ["AND", "OR", "XOR"])
@pytest.mark.parametrize("t", [*BITS, BOOL], ids=str)
def test_bit_operators(op: str, t: Elementary) -> None:
    @few
    @given(values(t), values(t))
    def check(a: int, b: int) -> None:
        assert evaluate(op, (t, t), t, a, b) == MODEL[op](a, b)

    check()


@pytest.mark.parametrize("t", [*BITS, BOOL], ids=str)
def test_not_stays_in_the_width(t: Elementary) -> None:
    _, high = limits(t)
    for a in (0, 1, high):
        assert evaluate("NOT", (t,), t, a) == high ^ a


@pytest.mark.parametrize("t", [*INTEGERS, *BITS, BOOL, TIME, REAL, LREAL], ids=str)
def test_comparisons(t: Elementary) -> None:
    table = {
        "EQ": lambda a, b: a == b, "NE": lambda a, b: a != b, "LT": lambda a, b: a < b,
        "LE": lambda a, b: a <= b, "GT": lambda a, b: a > b, "GE": lambda a, b: a >= b,
    }  # fmt: skip
    strategy = reals if t in (REAL, LREAL) else values(t)

    @examples(25)
    @given(strategy, strategy)
    def check(a: float, b: float) -> None:
        for op, model in table.items():
            assert evaluate(op, (t, t), BOOL, a, b) == model(a, b), op

    check()


@pytest.mark.parametrize("target", [*INTEGERS, *BITS, TIME], ids=str)
@pytest.mark.parametrize("source", [SINT, DINT, LINT, USINT, UDINT, ULINT, WORD], ids=str)
def test_integer_conversions_extend_by_the_source_and_cut(source: Elementary, target: Elementary) -> None:
    for a in {*limits(source), 0, 1, min(100, limits(source)[1])}:
        got = evaluate("CONVERT", (source,), target, a)
        expected: object = wrap(a, target)
        if target is TIME:
            run = running("CONVERT", (source,), target, 2, True)
            got = int.from_bytes(run.memory(0, 0, 4), "little", signed=True)
        assert got == expected


def test_bool_conversions() -> None:
    assert evaluate("CONVERT", (BOOL,), LINT, True) == 1
    assert evaluate("CONVERT", (BOOL,), REAL, True) == 1.0
    assert evaluate("CONVERT", (WORD,), BOOL, 256) is True
    assert evaluate("CONVERT", (REAL,), BOOL, 0.25) is True
    assert evaluate("CONVERT", (REAL,), BOOL, 0.0) is False


@pytest.mark.parametrize("how", ["CONVERT", "TRUNCATE"])
@pytest.mark.parametrize("target", INTEGERS, ids=str)
@pytest.mark.parametrize("source", [REAL, LREAL], ids=str)
def test_reals_to_integers_round_and_saturate(source: Elementary, target: Elementary, how: str) -> None:
    low, high = limits(target)

    @examples(40)
    @given(reals)
    def check(a: float) -> None:
        got = evaluate(how, (source,), target, a)
        if math.isnan(a):
            assert got == 0
        elif math.isinf(a):
            assert got == (high if a > 0 else low)
        else:
            exact = math.trunc(a) if how == "TRUNCATE" else round(a)
            assert got == min(max(exact, low), high)

    check()


@pytest.mark.parametrize("target", [REAL, LREAL], ids=str)
@pytest.mark.parametrize("source", INTEGERS, ids=str)
def test_integers_to_reals_give_the_nearest(source: Elementary, target: Elementary) -> None:
    for a in {*limits(source), 0, 16777217 if source.bits > 32 else 1}:
        run = running("CONVERT", (source,), target, 2, True)
        run["a"] = a
        assert run.cycle() == 0
        raw = run.memory(0, 0, target.size)
        if target is LREAL:
            assert struct.unpack("<d", raw)[0] == float(a)
        else:
            nearest = struct.unpack("<f", raw)[0]
            ulp = abs(math.nextafter(abs(nearest), math.inf) - abs(nearest)) * 2**29
            assert abs(nearest - a) <= ulp / 2


@pytest.mark.parametrize("t", BITS, ids=str)
@pytest.mark.parametrize("op", ["SHL", "SHR", "ROL", "ROR"])
def test_shifts_and_rotations_for_any_count(op: str, t: Elementary) -> None:
    mask = (1 << t.bits) - 1

    def model(v: int, n: int) -> int:
        if op == "SHL":
            return v << n & mask if 0 <= n < t.bits else 0
        if op == "SHR":
            return v >> n if 0 <= n < t.bits else 0
        n = n % t.bits if op == "ROL" else -n % t.bits
        return (v << n | v >> (t.bits - n)) & mask

    @few
    @given(values(t), st.one_of(st.integers(-70, 70), st.sampled_from([-32768, 32767])))
    def check(v: int, n: int) -> None:
        assert evaluate(op, (t, INT), t, v, n) == model(v, n)

    check()


def test_negation_and_absolute_value_of_the_minimum_wrap() -> None:
    for t in (SINT, INT, DINT, LINT):
        low, high = limits(t)
        assert evaluate("NEG", (t,), t, low) == low
        assert evaluate("ABS", (t,), t, low) == low
        assert evaluate("ABS", (t,), t, -high) == high


def test_minimum_and_maximum_respect_the_sign() -> None:
    assert evaluate("MIN", (INT, INT), INT, -1, 1) == -1
    assert evaluate("MAX", (UINT, UINT), UINT, 65535, 1) == 65535
    assert evaluate("MIN", (REAL, REAL), REAL, 1.5, -2.5) == -2.5


def test_mux_takes_the_last_for_a_selector_out_of_range() -> None:
    p = ProgramBuilder()
    r, k = p.variable("r", INT), p.variable("k", INT)
    args: list[Expr] = [load(k), const(10), const(20), const(30)]
    run = p.run(Assign(place(r), IntrinsicCall(Intrinsic.MUX, args, INT, P), P))
    for k_value, expected in ((0, 10), (1, 20), (2, 30), (3, 30), (-1, 30)):
        run["k"] = k_value
        run.cycle()
        assert run["r"] == expected


def test_select_takes_in0_for_false() -> None:
    assert evaluate("SELECT", (BOOL, INT, INT), INT, False, 1, 2) == 1
    assert evaluate("SELECT", (BOOL, INT, INT), INT, True, 1, 2) == 2


def test_bitcast_keeps_the_bits() -> None:
    assert evaluate("BITCAST", (REAL,), DWORD, 1.0) == 0x3F800000
    assert evaluate("BITCAST", (LWORD,), LREAL, 0x3FF8000000000000) == 1.5


def test_real_arithmetic_stays_single() -> None:
    @few
    @given(
        st.floats(width=32, allow_nan=False, allow_infinity=False),
        st.floats(width=32, allow_nan=False, allow_infinity=False),
    )
    def check(a: float, b: float) -> None:
        run = running("MUL", (REAL, REAL), REAL, 2, True)
        run["a"], run["b"] = a, b
        run.cycle()
        try:
            exact = struct.pack("<f", a * b)
        except OverflowError:
            exact = struct.pack("<f", math.copysign(math.inf, a * b))
        assert run.memory(0, 0, 4) == exact

    check()


def test_real_division_by_zero_is_infinite() -> None:
    assert evaluate("DIV", (REAL, REAL), REAL, 1.0, 0.0) == math.inf
    assert evaluate("DIV", (REAL, REAL), REAL, -1.0, 0.0) == -math.inf
