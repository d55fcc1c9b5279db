"""Random programs, compared with a reference of the language's meaning in Python.

Many expressions share one program, because a compilation costs far more than a comparison.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from plctool.compiler import compile_sources
from plctool.compiler.types import ELEMENTARY
from plctool.sim import Simulator
from plctool.values import format_time

Value = bool | int | float | str

SLOW = [HealthCheck.too_slow, HealthCheck.data_too_large]
PROGRAM = settings(max_examples=12, deadline=None, suppress_health_check=SLOW, report_multiple_bugs=False)
EXPRESSIONS = 30  # per program
DEPTH = 4

SIGNED = {"SINT": 8, "INT": 16, "DINT": 32, "LINT": 64}
UNSIGNED = {"USINT": 8, "UINT": 16, "UDINT": 32, "ULINT": 64}
BITS = {"BYTE": 8, "WORD": 16, "DWORD": 32, "LWORD": 64}
WIDTH = SIGNED | UNSIGNED | BITS
INTEGERS = [*SIGNED, *UNSIGNED]


@dataclass(frozen=True)
class Term:
    """An expression, and the value it must have."""

    text: str
    type: str
    value: Value


def evaluate(terms: Sequence[Term], declarations: str = "", statements: str = "") -> list[Value]:
    """What the compiled program makes of the expressions, after the statements."""
    results = "\n".join(f"r{i} : {t.type};" for i, t in enumerate(terms))
    body = "\n".join(f"r{i} := {t.text};" for i, t in enumerate(terms))
    text = f"PROGRAM Main\nVAR\n{declarations}{results}\nEND_VAR\n{statements}\n{body}\nEND_PROGRAM\n"
    with TemporaryDirectory() as folder:
        path = Path(folder) / "main.st"
        path.write_text(text, "latin-1")
        result = compile_sources([path])
    with Simulator(result.image, result.symbols) as plc:
        plc.run_cycles(1)
        assert plc.status().exception is None
        return [plc.read(f"Main.r{i}") for i in range(len(terms))]


def check(terms: Sequence[Term], declarations: str = "", statements: str = "") -> None:
    wrong = [
        f"{t.text} ({t.type}) gave {value!r}, not {t.value!r}"
        for t, value in zip(terms, evaluate(terms, declarations, statements), strict=True)
        if not same(value, t)
    ]
    assert not wrong, "\n".join(wrong)


NOT_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}


def same(actual: Value, term: Term) -> bool:
    """A REAL is read with the fewest digits that mean it, and what is not finite by name."""
    if isinstance(term.value, float):
        a = rounded(NOT_FINITE.get(actual) or float(actual), term.type)
        b = term.value
        return (math.isnan(a) and math.isnan(b)) or (a == b and math.copysign(1, a) == math.copysign(1, b))
    return type(actual) is type(term.value) and actual == term.value


# ---- integers ------------------------------------------------------------------------------------------------------


def wrap(value: int, name: str) -> int:
    bits = WIDTH[name]
    value &= (1 << bits) - 1
    return value - (1 << bits) if name in SIGNED and value >> (bits - 1) else value


def quotient(a: int, b: int) -> int:
    return abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)


def rotate_left(value: int, count: int, bits: int) -> int:
    count %= bits
    return (value << count | value >> (bits - count)) & ((1 << bits) - 1)


def limits(name: str) -> tuple[int, int]:
    bits = WIDTH[name]
    return (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if name in SIGNED else (0, (1 << bits) - 1)


def numbers(name: str) -> st.SearchStrategy[int]:
    """Any value of the type, the interesting ones more often."""
    low, high = limits(name)
    special = [v for v in (low, low + 1, -1, 0, 1, 2, 7, 10, high - 1, high) if low <= v <= high]
    return st.sampled_from(special) | st.integers(low, high)


@dataclass
class Declarations:
    """Variables with the initial values they were given; a variable cannot be folded away as a literal can."""

    lines: list[str]

    def variable(self, name: str, literal: str, value: Value) -> Term:
        variable = f"v{len(self.lines)}"
        self.lines.append(f"{variable} : {name} := {literal};")
        return Term(variable, name, value)

    def text(self) -> str:
        return "".join(f"{line}\n" for line in self.lines)


def integer_leaf(draw: st.DrawFn, known: Declarations, name: str) -> Term:
    value = draw(numbers(name))
    literal = f"{name}#{value}"
    return known.variable(name, literal, value) if draw(st.booleans()) else Term(literal, name, value)


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


def integer(draw: st.DrawFn, known: Declarations, name: str, depth: int) -> Term:
    if depth == 0:
        return integer_leaf(draw, known, name)
    kinds = (arithmetic, arithmetic, arithmetic, minimum_maximum, negated, selected, converted)
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


def comparison(op: str, a: Value, b: Value) -> bool:
    return {"=": a == b, "<>": a != b, "<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}[op]  # type: ignore[operator]


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


@st.composite
def batch(draw: st.DrawFn, make: Callable[[st.DrawFn, Declarations], Term]) -> tuple[list[Term], str]:
    known = Declarations([])
    terms = [make(draw, known) for _ in range(EXPRESSIONS)]
    return terms, known.text()


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


def rounded(value: float, name: str) -> float:
    """To the precision of the type. One rounding of a result in double is exact for single + - * / and square root."""
    if name == "LREAL" or not math.isfinite(value):
        return value
    try:
        return float(struct.unpack("f", struct.pack("f", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)


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


# ---- strings -------------------------------------------------------------------------------------------------------

CHARACTERS = st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="$'")


def string_variable(draw: st.DrawFn, known: Declarations, longest: int) -> Term:
    value = draw(st.text(st.sampled_from("ab") | CHARACTERS, max_size=longest))
    return known.variable(f"STRING[{max(len(value), 1)}]", f"'{value}'", value)


def string_function(function: str, s: str, t: str, length: int, place: int) -> Value:
    """The reference: positions from 1, clamped."""
    count, start = max(length, 0), max(place, 1) - 1
    match function:
        case "LEFT":
            return s[:count]
        case "RIGHT":
            return s[max(len(s) - count, 0) :]
        case "MID":
            return s[start : start + count]
        case "DELETE":
            return s[:start] + s[start + count :]
        case "INSERT":
            return s[: max(place, 0)] + t + s[max(place, 0) :]
        case "REPLACE":
            return s[:start] + t + s[start + count :]
        case "CONCAT":
            return s + t
        case "FIND":
            return s.find(t) + 1 if t else 0
        case _:
            return len(s)


ARGUMENTS = {
    "LEFT": "{s}, {l}",
    "RIGHT": "{s}, {l}",
    "MID": "{s}, {l}, {p}",
    "DELETE": "{s}, {l}, {p}",
    "INSERT": "{s}, {t}, {p}",
    "REPLACE": "{s}, {t}, {l}, {p}",
    "CONCAT": "{s}, {t}",
    "FIND": "{s}, {t}",
    "LEN": "{s}",
}


def any_string_call(draw: st.DrawFn, known: Declarations) -> Term:
    function = draw(st.sampled_from(list(ARGUMENTS)))
    s = string_variable(draw, known, 12)
    t = string_variable(draw, known, 4 if function != "FIND" else 2)
    length, place = draw(st.integers(-2, 15)), draw(st.integers(-2, 15))
    value = string_function(function, str(s.value), str(t.value), length, place)
    capacity = draw(st.integers(1, 20))
    arguments = ARGUMENTS[function].format(s=s.text, t=t.text, l=length, p=place)
    if isinstance(value, str):
        return Term(f"{function}({arguments})", f"STRING[{capacity}]", value[:capacity])
    return Term(f"{function}({arguments})", "INT", value)


def any_string_comparison(draw: st.DrawFn, known: Declarations) -> Term:
    a, b = (string_variable(draw, known, 3) for _ in range(2))
    op = draw(st.sampled_from(["=", "<>", "<", "<=", ">", ">="]))
    return Term(f"({a.text} {op} {b.text})", "BOOL", comparison(op, a.value, b.value))


@st.composite
def string_scripts(draw: st.DrawFn) -> tuple[str, str, list[Term]]:
    """Declarations, statements, and what the variables must hold after them; targets are often arguments as well."""
    capacities = draw(st.lists(st.sampled_from([1, 3, 8, 15, 16, 17, 40]), min_size=2, max_size=4))
    values = [draw(st.text(CHARACTERS, max_size=c)) for c in capacities]
    declared = "".join(
        f"s{i} : STRING[{c}] := '{v}';\n" for i, (c, v) in enumerate(zip(capacities, values, strict=True))
    )
    statements = []
    for _ in range(EXPRESSIONS):
        target, first, second = (draw(st.integers(0, len(values) - 1)) for _ in range(3))
        function = draw(st.sampled_from([f for f in ARGUMENTS if f not in ("LEN", "FIND")]))
        length, place = draw(st.integers(-1, 20)), draw(st.integers(-1, 20))
        arguments = ARGUMENTS[function].format(s=f"s{first}", t=f"s{second}", l=length, p=place)
        statements.append(f"s{target} := {function}({arguments});")
        result = string_function(function, values[first], values[second], length, place)
        values[target] = str(result)[: capacities[target]]
    expected = [Term(f"s{i}", f"STRING[{c}]", v) for i, (c, v) in enumerate(zip(capacities, values, strict=True))]
    return declared, "\n".join(statements), expected


@PROGRAM
@given(string_scripts())
def test_strings_may_be_assigned_what_is_made_of_them(script: tuple[str, str, list[Term]]) -> None:
    declared, statements, expected = script
    check(expected, declared, statements)


@PROGRAM
@given(batch(any_string_call))
def test_string_functions_agree_with_slices(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_string_comparison))
def test_strings_compare_as_in_python(program: tuple[list[Term], str]) -> None:
    check(*program)


# ---- text ----------------------------------------------------------------------------------------------------------


def any_integer_text(draw: st.DrawFn, known: Declarations) -> Term:
    name = draw(st.sampled_from(list(WIDTH)))
    a = integer_leaf(draw, known, name)
    if draw(st.booleans()):
        return Term(f"{name}_TO_STRING({a.text})", "STRING", str(a.value))
    return Term(f"STRING_TO_{name}('{a.value}')", name, a.value)


def any_duration_text(draw: st.DrawFn, known: Declarations) -> Term:
    """Durations are read as the text the language uses."""
    name, whole = draw(st.sampled_from([("TIME", "DINT"), ("LTIME", "LINT")]))
    value = draw(numbers(whole) | st.integers(-1000, 1000).map(lambda n: n * 1000))
    text = format_time(value, ELEMENTARY[name])
    if draw(st.booleans()):
        return Term(f"STRING_TO_{name}('{text}')", name, text)
    a = known.variable(whole, f"{whole}#{value}", value)
    return Term(f"{name}_TO_STRING({whole}_TO_{name}({a.text}))", "STRING", text)


def shortest_digits(value: float, name: str) -> str:
    """The fewest significant digits that read back as the same value, without zeros at the end."""
    for precision in range(17):
        text = f"{abs(value):.{precision}e}"
        if rounded(float(text), name) == abs(value):
            return text.split("e")[0].replace(".", "").rstrip("0") or "0"
    raise AssertionError(value)


def digits_of(text: str) -> str:
    return text.lstrip("-").split("E")[0].replace(".", "").strip("0") or "0"


@st.composite
def real_texts(draw: st.DrawFn) -> tuple[str, list[float]]:
    name = draw(st.sampled_from(["REAL", "LREAL"]))
    floats = st.floats(allow_nan=False, allow_infinity=False, width=32 if name == "REAL" else 64)
    powers = st.integers(-149, 127) if name == "REAL" else st.integers(-1074, 1023)
    decimals = st.integers(-99999, 99999).map(lambda n: rounded(n / 1000, name))
    value = floats | decimals | powers.map(partial(math.ldexp, 1.0))
    return name, draw(st.lists(value, min_size=EXPRESSIONS, max_size=EXPRESSIONS))


@PROGRAM
@given(batch(any_integer_text))
def test_integers_and_their_texts_convert_both_ways(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(batch(any_duration_text))
def test_durations_and_their_texts_convert_both_ways(program: tuple[list[Term], str]) -> None:
    check(*program)


@PROGRAM
@given(real_texts())
def test_real_texts_are_as_short_as_possible_and_read_back(case: tuple[str, list[float]]) -> None:
    name, values = case
    known = Declarations([])
    variables = [known.variable(name, f"{name}#{v:.17E}", v) for v in values]
    to_text = [Term(f"{name}_TO_STRING({v.text})", "STRING", "") for v in variables]
    and_back = [Term(f"STRING_TO_{name}({t.text})", name, v) for t, v in zip(to_text, values, strict=True)]
    results = evaluate([*to_text, *and_back], known.text())
    texts, read_back = results[: len(values)], results[len(values) :]
    for text, result, term in zip(texts, read_back, and_back, strict=True):
        assert isinstance(text, str) and isinstance(term.value, float)
        assert same(float(text), term), text
        assert same(result, term), text
        assert len(digits_of(text)) <= len(shortest_digits(term.value, name)), text


DECIMAL = st.from_regex(r"-?[0-9]{1,10}(\.[0-9]{1,9})?(E[+-]?[0-9]{1,3})?", fullmatch=True)


@PROGRAM
@given(st.lists(DECIMAL, min_size=EXPRESSIONS, max_size=EXPRESSIONS))
def test_decimal_texts_read_as_the_nearest_real(texts: list[str]) -> None:
    check([Term(f"STRING_TO_LREAL('{t}')", "LREAL", float(t)) for t in texts])
