"""Expressions with the value they must have: many share one program, because a compilation costs far more than a
comparison.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

from hypothesis import settings
from hypothesis import strategies as st
from shares import WHOLE

from plctool.compiler import compile_sources
from plctool.sim import Simulator

Value = bool | int | float | str

PROGRAM = settings(max_examples=12 if WHOLE else 4, report_multiple_bugs=False)
EXPRESSIONS = 30  # per program
OPTIMISED = 4  # one program in so many, because optimising takes ten times as long as all else

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


def level_of(text: str) -> Literal[0, 2]:
    """How much a program is optimised; the same program always as much, so that what fails fails again."""
    return 0 if zlib.crc32(text.encode("latin-1")) % OPTIMISED else 2


def evaluate(terms: Sequence[Term], declarations: str = "", statements: str = "") -> list[Value]:
    """What the compiled program makes of the expressions, after the statements."""
    results = "\n".join(f"r{i} : {t.type};" for i, t in enumerate(terms))
    body = "\n".join(f"r{i} := {t.text};" for i, t in enumerate(terms))
    text = f"PROGRAM Main\nVAR\n{declarations}{results}\nEND_VAR\n{statements}\n{body}\nEND_PROGRAM\n"
    with TemporaryDirectory() as folder:
        path = Path(folder) / "main.st"
        path.write_text(text, "latin-1")
        result = compile_sources([path], level=level_of(text))
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


def same(actual: Value, term: Term) -> bool:
    """A REAL is read with the fewest digits that mean it."""
    if isinstance(term.value, float):
        a = rounded(float(actual), term.type)
        b = term.value
        return (math.isnan(a) and math.isnan(b)) or (a == b and math.copysign(1, a) == math.copysign(1, b))
    return isinstance(actual, bool) == isinstance(term.value, bool) and actual == term.value


def wrap(value: int, name: str) -> int:
    bits = WIDTH[name]
    value &= (1 << bits) - 1
    return value - (1 << bits) if name in SIGNED and value >> (bits - 1) else value


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


def comparison(op: str, a: Value, b: Value) -> bool:
    return {"=": a == b, "<>": a != b, "<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b}[op]  # type: ignore[operator]


@st.composite
def batch(draw: st.DrawFn, make: Callable[[st.DrawFn, Declarations], Term]) -> tuple[list[Term], str]:
    known = Declarations([])
    terms = [make(draw, known) for _ in range(EXPRESSIONS)]
    return terms, known.text()


def rounded(value: float, name: str) -> float:
    """To the precision of the type. One rounding of a result in double is exact for single + - * / and square root."""
    if name == "LREAL" or not math.isfinite(value):
        return value
    try:
        return float(struct.unpack("f", struct.pack("f", value))[0])
    except OverflowError:
        return math.copysign(math.inf, value)
