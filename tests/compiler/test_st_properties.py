"""Random programs, compared with a reference of the language's meaning in Python."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st
from property_support import (
    BITS,
    INTEGERS,
    PROGRAM,
    UNSIGNED,
    WIDTH,
    Declarations,
    Term,
    batch,
    check,
    comparison,
    integer_leaf,
    limits,
    rounded,
    wrap,
)

DEPTH = 4

# ---- integers ------------------------------------------------------------------------------------------------------


def quotient(a: int, b: int) -> int:
    return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


def rotate_left(value: int, count: int, bits: int) -> int:
    count %= bits
    return (value << count | value >> (bits - count)) & ((1 << bits) - 1)


def arithmetic(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    op = draw(st.sampled_from(["+", "-", "*", "/", "MOD"]))
    a, b = integer(draw, known, name, depth), integer(draw, known, name, depth)
    x, y = int(a.value), int(b.value)
    if op in ("/", "MOD") and y == 0:
        op = "+"
    value = {"+": x + y, "-": x - y, "*": x * y, "/": quotient(x, y or 1), "MOD": x - y * quotient(x, y or 1)}[op]
    return Term(f"({a.text} {op} {b.text})", name, wrap(value, name))


def minimum_maximum(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    function = draw(st.sampled_from(["MIN", "MAX"]))
    terms = [integer(draw, known, name, depth) for _ in range(draw(st.integers(2, 3)))]
    values = [int(t.value) for t in terms]
    value = min(values) if function == "MIN" else max(values)
    return Term(f"{function}({', '.join(t.text for t in terms)})", name, value)


def negated(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    a = integer(draw, known, name, depth)
    if name in UNSIGNED:
        return a
    if draw(st.booleans()):
        return Term(f"(-{a.text})", name, wrap(-int(a.value), name))
    return Term(f"ABS({a.text})", name, wrap(abs(int(a.value)), name))


def selected(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    choice = boolean(draw, known, depth)
    a, b = integer(draw, known, name, depth), integer(draw, known, name, depth)
    return Term(f"SEL({choice.text}, {a.text}, {b.text})", name, b.value if choice.value else a.value)


def converted(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    source = draw(st.sampled_from([t for t in WIDTH if t != name]))
    a = integer(draw, known, source, depth) if source not in BITS else bit_string(draw, known, source, depth)
    return Term(f"{source}_TO_{name}({a.text})", name, wrap(int(a.value), name))


def shifted(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    """SHR keeps the sign; all else works on the bits."""
    op, count, bits = draw(st.sampled_from(["SHL", "SHR", "ROL", "ROR"])), draw(st.integers(0, 70)), WIDTH[name]
    a = integer(draw, known, name, depth)
    x = int(a.value)
    pattern = x & ((1 << bits) - 1)
    n = known.variable("INT", str(count), count).text if draw(st.booleans()) else str(count)
    value = {
        "SHL": x << count,
        "SHR": x >> count if count < bits else 0,
        "ROL": rotate_left(pattern, count, bits),
        "ROR": rotate_left(pattern, -count, bits),
    }[op]
    return Term(f"{op}({a.text}, {n})", name, wrap(value, name))


def integer(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    if depth == 0:
        return integer_leaf(draw, known, name)
    kinds = (arithmetic, arithmetic, arithmetic, minimum_maximum, negated, selected, shifted, converted)
    return draw(st.sampled_from(kinds))(draw, known, name, depth - 1)


def bit_string(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    if depth == 0:
        return integer_leaf(draw, known, name)
    bits = WIDTH[name]
    mask = (1 << bits) - 1
    op = draw(st.sampled_from(["AND", "OR", "XOR", "NOT", "SHL", "SHR", "ROL", "ROR"]))
    a = bit_string(draw, known, name, depth - 1)
    x = int(a.value)
    if op == "NOT":
        return Term(f"(NOT {a.text})", name, x ^ mask)
    if op in ("AND", "OR", "XOR"):
        b = bit_string(draw, known, name, depth - 1)
        y = int(b.value)
        return Term(f"({a.text} {op} {b.text})", name, {"AND": x & y, "OR": x | y, "XOR": x ^ y}[op])
    count = draw(st.integers(0, 70))
    n = known.variable("INT", str(count), count).text if draw(st.booleans()) else str(count)
    value = {
        "SHL": (x << count) & mask,
        "SHR": x >> count,
        "ROL": rotate_left(x, count, bits),
        "ROR": rotate_left(x, -count, bits),
    }[op]
    return Term(f"{op}({a.text}, {n})", name, value)


def boolean(draw: st.DrawFn, known: Declarations, depth: int) -> Term:
    if depth == 0:
        value = draw(st.booleans())
        return known.variable("BOOL", str(value).upper(), value)
    kind = draw(st.sampled_from(["compare", "compare", "logic", "NOT"]))
    if kind == "compare":
        name = draw(st.sampled_from(INTEGERS))
        op = draw(st.sampled_from(["=", "<>", "<", "<=", ">", ">="]))
        a, b = integer(draw, known, name, depth - 1), integer(draw, known, name, depth - 1)
        return Term(f"({a.text} {op} {b.text})", "BOOL", comparison(op, a.value, b.value))
    a = boolean(draw, known, depth - 1)
    if kind == "NOT":
        return Term(f"(NOT {a.text})", "BOOL", not a.value)
    op = draw(st.sampled_from(["AND", "OR", "XOR", "AND_THEN", "OR_ELSE"]))
    b = boolean(draw, known, depth - 1)
    value = {"AND": a.value and b.value, "OR": a.value or b.value, "XOR": a.value != b.value}[op.split("_")[0]]
    return Term(f"({a.text} {op} {b.text})", "BOOL", value)


def any_integer(draw: st.DrawFn, known: Declarations) -> Term:
    return integer(draw, known, draw(st.sampled_from(INTEGERS)), draw(st.integers(1, DEPTH)))


def any_bit_string(draw: st.DrawFn, known: Declarations) -> Term:
    return bit_string(draw, known, draw(st.sampled_from(list(BITS))), draw(st.integers(1, DEPTH)))


def any_boolean(draw: st.DrawFn, known: Declarations) -> Term:
    return boolean(draw, known, draw(st.integers(1, DEPTH)))


@PROGRAM
@given(batch(any_integer))
def test_integer_expressions_have_the_value_of_the_reference(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_bit_string))
def test_bit_string_expressions_have_the_value_of_the_reference(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_boolean))
def test_bool_expressions_have_the_value_of_the_reference(program: tuple[list[Term], str]) -> None:
    check(*program)


# ---- reals ---------------------------------------------------------------------------------------------------------


def divided(a: float, b: float) -> float:
    if b != 0:
        return a / b
    if a == 0 or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1, b)


def real_leaf(draw: st.DrawFn, known: Declarations, name: str) -> Term:
    value = draw(st.floats(allow_nan=False, allow_infinity=False, width=32 if name == "REAL" else 64))
    if draw(st.booleans()):
        value = float(draw(st.integers(-1000, 1000))) / 8
    literal = f"{name}#{value!r}" if "e" not in repr(value) else f"{name}#{value:.17E}"
    return known.variable(name, literal, value)


def real(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    if depth == 0:
        return real_leaf(draw, known, name)
    op = draw(st.sampled_from(["+", "-", "*", "/", "NEG", "ABS", "SQRT", "CONVERT"]))
    if op == "CONVERT":
        source = draw(st.sampled_from(["SINT", "INT", "DINT", "LINT", "USINT", "UDINT", "ULINT"]))
        a = integer(draw, known, source, depth - 1)
        return Term(f"{source}_TO_{name}({a.text})", name, to_real(int(a.value), name))
    a = real(draw, known, name, depth - 1)
    x = float(a.value)
    if op == "NEG":
        return Term(f"(-{a.text})", name, -x)
    if op == "ABS":
        return Term(f"ABS({a.text})", name, abs(x))
    if op == "SQRT":
        return Term(f"SQRT(ABS({a.text}))", name, rounded(math.sqrt(abs(x)), name))
    b = real(draw, known, name, depth - 1)
    y = float(b.value)
    if op == "/" and y == 0 and "v" not in b.text:  # a division by the constant 0 is a compile error
        op = "*"
    value = {"+": lambda: x + y, "-": lambda: x - y, "*": lambda: x * y, "/": lambda: divided(x, y)}[op]()
    return Term(f"({a.text} {op} {b.text})", name, rounded(value, name))


def to_real(value: int, name: str) -> float:
    """The nearest number of the type, ties to even; in one rounding, also for 64 bits to single."""
    if name == "LREAL" or abs(value) < 1 << 53:
        return rounded(float(value), name)
    shift = abs(value).bit_length() - 26
    sticky = (abs(value) >> shift) | (1 if abs(value) & ((1 << shift) - 1) else 0)
    return math.copysign(rounded(float(sticky), name) * 2.0**shift, value)


def to_integer(value: float, name: str) -> int:
    if math.isnan(value):
        return 0
    low, high = limits(name)
    if math.isinf(value):
        return high if value > 0 else low
    return max(low, min(high, round(value)))


def any_real(draw: st.DrawFn, known: Declarations) -> Term:
    return real(draw, known, draw(st.sampled_from(["REAL", "LREAL"])), draw(st.integers(1, DEPTH)))


def any_real_to_integer(draw: st.DrawFn, known: Declarations) -> Term:
    name, target = draw(st.sampled_from(["REAL", "LREAL"])), draw(st.sampled_from(INTEGERS))
    a = real(draw, known, name, draw(st.integers(0, 2)))
    return Term(f"{name}_TO_{target}({a.text})", target, to_integer(float(a.value), target))


def any_real_comparison(draw: st.DrawFn, known: Declarations) -> Term:
    name = draw(st.sampled_from(["REAL", "LREAL"]))
    op = draw(st.sampled_from(["=", "<>", "<", "<=", ">", ">="]))
    a, b = real(draw, known, name, 2), real(draw, known, name, 2)
    return Term(f"({a.text} {op} {b.text})", "BOOL", comparison(op, a.value, b.value))


@PROGRAM
@given(batch(any_real))
def test_real_expressions_are_rounded_at_every_step(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_real_to_integer))
def test_real_to_integer_rounds_to_even_and_saturates(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_real_comparison))
def test_real_comparisons_know_infinity_and_nan(program: tuple[list[Term], str]) -> None:
    check(*program)
