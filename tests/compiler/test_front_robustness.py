"""Whatever the source, the result is a program or diagnostics; and it comes soon."""

from __future__ import annotations

import random
import re
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from front_support import check, main, messages, verify
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler import compile_sources
from plctool.compiler.front import Source, check_sources
from plctool.compiler.syntax.diagnostics import MAX_MESSAGE, render
from plctool.compiler.syntax.lexer import KEYWORDS
from plctool.iec.types import ELEMENTARY
from plctool.sim import Simulator

PROGRAMS = [p.read_text("latin-1") for p in sorted((Path(__file__).parents[1] / "st").rglob("*.st"))]
VARIABLES = "x : INT; b : BOOL; a : ARRAY[0..3] OF INT;"
DEEP = 20_000

TOKENS = re.compile(r"\s+|'[^']*'|\w+#\w+|\w+|:=|=>|<=|>=|<>|\.\.|[^\w\s]")
OPERATORS = [
    "+",
    "-",
    "*",
    "/",
    "**",
    " MOD ",
    " AND ",
    " OR ",
    "=",
    "<>",
    "<",
    ">=",
    ":=",
    "=>",
    "(",
    ")",
    "[",
    ";",
    "^",
]
VALUES = [
    "0",
    "-1",
    "40000",
    "16#FFFF",
    "1.5",
    "1E300",
    "T#1s",
    "TRUE",
    "'abc'",
    "NULL",
    "BYTE#255",
    "x[1]",
    "ADR(x)",
    "x^",
]
NAMES = [
    *KEYWORDS,
    *ELEMENTARY,
    "TON",
    "LEFT",
    "SEL",
    "MUX",
    "MAX",
    "SQRT",
    "EXPT",
    "LIMIT",
    "INT_TO_REAL",
    "ANY_NUM",
    "Main",
]


def mutated(r: random.Random) -> str:
    """A program with some tokens exchanged, left out, doubled or cut off."""
    tokens = TOKENS.findall(r.choice(PROGRAMS))
    for _ in range(r.randint(1, 4)):
        at = r.randrange(len(tokens))
        kind = r.randrange(7)
        if kind == 0:
            tokens[at] = r.choice(tokens)
        elif kind == 1:
            tokens[at] = r.choice(OPERATORS)
        elif kind == 2:
            tokens[at] = r.choice(VALUES)
        elif kind == 3:
            tokens[at] = r.choice(NAMES)
        elif kind == 4:
            tokens[at] = ""
        elif kind == 5:
            tokens[at:at] = tokens[at : at + r.randint(1, 20)]
        elif r.random() < 0.2:
            del tokens[at + 1 :]
    return "".join(tokens)


def all_of(text: str) -> None:
    """Checks a text, renders what is found, and holds a program against the contract."""
    source = Source("f.st", text)
    result = check_sources([source])
    for diagnostic in result.diagnostics:
        assert len(diagnostic.message) <= MAX_MESSAGE
        assert render(diagnostic, [source])
    assert (result.program is None) == any(d.severity == "error" for d in result.diagnostics)
    if result.program is not None:
        verify(result.program)


@pytest.mark.parametrize("seed", range(4))
def test_mutated_programs_are_diagnosed(seed: int) -> None:
    r = random.Random(seed)
    for _ in range(40):
        text = mutated(r)
        try:
            all_of(text)
        except Exception as error:
            raise AssertionError(f"seed {seed}:\n{text}") from error


@examples(200)
@given(st.text())
def test_any_text_is_diagnosed(text: str) -> None:
    all_of(text)


@examples(100)
@given(st.lists(st.sampled_from([*KEYWORDS, *OPERATORS, *VALUES, "x", ";", ":", ","]), max_size=40))
def test_any_tokens_are_diagnosed(tokens: list[str]) -> None:
    all_of(" ".join(tokens))


def deep_programs() -> Iterator[tuple[str, str]]:
    yield "parentheses", main(VARIABLES, "x := " + "(" * DEEP + "1" + ")" * DEEP + ";")
    yield "not", main(VARIABLES, "b := " + "NOT " * DEEP + "b;")
    yield "sum", main(VARIABLES, "x := x" + "+x" * DEEP + ";")
    yield "index", main(VARIABLES, "x := " + "a[" * DEEP + "1" + "]" * DEEP + ";")
    yield "member", main(VARIABLES, "x := x" + ".x" * DEEP + ";")
    yield "call", main(VARIABLES, "x := " + "ABS(" * DEEP + "1" + ")" * DEEP + ";")
    yield "if", main(VARIABLES, "IF b THEN " * DEEP + "x := 1; " + "END_IF; " * DEEP)
    yield "array type", main("y : " + "ARRAY[0..1] OF " * DEEP + "INT;")
    yield "pointer type", main("y : " + "POINTER TO " * DEEP + "INT;")
    yield "initial value", main("y : ARRAY[0..1] OF INT := " + "[" * DEEP + "1" + "]" * DEEP + ";")
    yield "comment", "(*" * DEEP
    yield "types", "TYPE " + "".join(f"t{i} : ARRAY[0..1] OF t{i + 1}; " for i in range(999)) + "t999 : INT; END_TYPE"


@pytest.mark.parametrize("text", [pytest.param(text, id=name) for name, text in deep_programs()])
def test_deep_nesting_is_diagnosed(text: str) -> None:
    all_of(text)


MANY = 3000  # terms of a generated expression


def chained(operator: str, operand: str) -> str:
    return f" {operator} ".join([operand] * MANY)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (f"d := {chained('+', 'a')};", MANY),
        (f"d := TO_DINT({' + '.join(['s', 'r'] * (MANY // 2))});", MANY),  # with a conversion of each term
        (f"d := {chained('+', 'list[a]')};", MANY),
        (f"IF {chained('AND_THEN', 'b')} THEN d := 1; END_IF", 1),
        (f"CASE {chained('+', '1')} OF {MANY}: d := 2; END_CASE", 2),
    ],
    ids=["sum", "conversions", "elements", "short-circuit", "constant"],
)
def test_an_expression_of_thousands_of_terms_is_computed(text: str, expected: int, tmp_path: Path) -> None:
    variables = "a, d : DINT := 1; s : SINT := 1; r : REAL := 1.0; b : BOOL := TRUE;"
    variables += "list : ARRAY[0..1] OF DINT := [2(1)];"
    (tmp_path / "main.st").write_text(main(variables, text))
    built = compile_sources([tmp_path / "main.st"], level=0)
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        assert plc.read("Main.d") == expected


def test_an_initial_value_of_thousands_of_terms_is_computed() -> None:
    variables = f"a : DINT := 1; e : DINT := {chained('+', 'a')};"
    block = f"FUNCTION_BLOCK F\nVAR {variables} END_VAR\na := e;\nEND_FUNCTION_BLOCK\n"
    assert messages(main("f, g : F;", "f(); g();", block)) == []


@pytest.mark.parametrize(
    "text", ["x := 2 ** 100000000;", f"x := {'9' * 100_000};", f"x := {'a' * 100_000};", "x := 1e400;"]
)
def test_huge_numbers_and_names_are_refused(text: str) -> None:
    assert len(messages(main(VARIABLES, text))) == 1


def test_constant_division_of_the_least_by_minus_one_wraps() -> None:
    assert messages(main(VARIABLES, "x := INT#-32768 / INT#-1;")) == []


def test_nul_and_control_characters_are_named() -> None:
    assert "character 0" in messages("\x00")[0]


def test_areas_have_a_limit() -> None:
    five = " ".join(f"v{i} : ARRAY[0..500000000] OF BYTE;" for i in range(5))
    assert any("too large" in m for m in messages(main(five)))


def test_ten_thousand_lines_take_no_more_than_a_few_seconds() -> None:
    """About 0.5 s on a quiet machine; the bound only catches what grows with the square of the length."""
    block = "IF x > 3 AND b THEN\n  x := x + a[x MOD 4] * 2;\nELSE\n  b := NOT b;\nEND_IF;\n"
    started = time.process_time()
    assert check(main(VARIABLES, block * 2000)).ok
    assert time.process_time() - started < 5


def test_the_recursion_limit_of_the_process_stays_as_it_was() -> None:
    limit = sys.getrecursionlimit()
    nested = "(" * 300 + "1" + ")" * 300
    check_sources([Source("f.st", f"PROGRAM Main VAR i : INT; END_VAR i := {nested}; END_PROGRAM")])
    assert sys.getrecursionlimit() == limit
