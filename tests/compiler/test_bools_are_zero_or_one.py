"""What statements leave in a BOOL is the byte 0 or 1, however the expression is made, because others read the byte."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool import Simulator
from plctool.compiler.base.source import Source
from plctool.compiler.codegen import lower_expr
from plctool.compiler.codegen.lower import lower
from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.front import check_sources
from plctool.compiler.image.build import build_program
from plctool.image.targets import find_target

INPUTS = "abcd"


@dataclass(frozen=True)
class Term:
    """An expression, and what it is for values of INPUTS."""

    text: str
    value: Callable[[dict[str, bool]], bool]


def leaf(name: str) -> Term:
    return Term(name, lambda values: values[name])


def below(name: str) -> Term:
    return Term(f"(n < BOOL_TO_INT({name}))", lambda values: values[name])


def below_any(term: Term) -> Term:
    return Term(f"(n < BOOL_TO_INT({term.text}))", term.value)


def negated(term: Term) -> Term:
    return Term(f"NOT {term.text}", lambda values: not term.value(values))


def both(parts: tuple[str, Term, Term]) -> Term:
    word, left, right = parts
    rules: dict[str, Callable[[bool, bool], bool]] = {
        "AND": lambda x, y: x and y,
        "OR": lambda x, y: x or y,
        "XOR": lambda x, y: x != y,
        "AND_THEN": lambda x, y: x and y,
        "OR_ELSE": lambda x, y: x or y,
        "=": lambda x, y: x == y,
    }
    return Term(f"({left.text} {word} {right.text})", lambda v: rules[word](left.value(v), right.value(v)))


LEAVES = st.sampled_from(INPUTS).map(leaf) | st.sampled_from(INPUTS).map(below)
WORDS = st.sampled_from(["AND", "AND", "OR", "XOR", "AND_THEN", "OR_ELSE", "="])
TERMS = st.recursive(
    LEAVES,
    lambda terms: terms.map(negated) | terms.map(below_any) | st.tuples(WORDS, terms, terms).map(both),
    max_leaves=8,
)


@examples(25)
@given(st.lists(TERMS, min_size=12, max_size=12))
@pytest.mark.parametrize("level", [0, 2])
def test_every_result_is_the_byte_zero_or_one(level: int, terms: list[Term]) -> None:
    declared = f"{', '.join(INPUTS)} : BOOL; n : INT; r : ARRAY[1..{len(terms)}] OF BOOL; p : POINTER TO BYTE;"
    body = "".join(
        f"r[{i}] := {term.text}; p := ADR(r[{i}]); raw[{i}] := p^; IF {term.text} THEN raw[{i}].7 := TRUE; END_IF\n"
        for i, term in enumerate(terms, 1)
    )
    text = f"PROGRAM Main VAR {declared} raw : ARRAY[1..{len(terms)}] OF BYTE; END_VAR\n{body}END_PROGRAM"
    found = check_sources([Source("main.st", text)])
    assert found.program, found.diagnostics
    built = build_program(found.program, Options(find_target("x86_64-linux"), level))
    with Simulator(built.image, built.symbols) as plc:
        for bits in product((False, True), repeat=len(INPUTS)):
            values = dict(zip(INPUTS, bits, strict=True))
            plc.write({f"Main.{name}": value for name, value in values.items()})
            plc.run_cycles(1)
            assert plc.read("Main.raw") == [0x81 * term.value(values) for term in terms]


@pytest.mark.parametrize("level", [0, 2, 3])
def test_a_wrong_byte_in_a_bool_is_true_and_does_not_lead_out_of_an_array(level: int) -> None:
    text = """PROGRAM Main
    VAR flag AT %MB0 : BOOL; byte_ AT %MB0 : BYTE := 5; two : ARRAY[0..1] OF INT := [10, 11];
        beside : ARRAY[0..9] OF INT; taken, answer : INT; small : INT(0..1); END_VAR
    taken := two[BOOL_TO_INT(flag)];
    two[BOOL_TO_INT(flag)] := 1234;
    small := BOOL_TO_INT(flag);
    IF flag THEN answer := 1; END_IF
    END_PROGRAM"""
    found = check_sources([Source("main.st", text)])
    assert found.program, found.diagnostics
    built = build_program(found.program, Options(find_target("x86_64-linux"), level))
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        assert [plc.read(f"Main.{name}") for name in ("taken", "two", "small", "answer", "flag")] == [
            11, [10, 1234], 1, 1, True,
        ]  # fmt: skip
        assert not any(plc.read("Main.beside"))


@pytest.mark.parametrize(
    ("level", "statement"),
    [(2, "b := {};".format), (2, "IF n = 1 AND {} THEN b := a; END_IF".format),
     (3, "IF n = 1 AND {} THEN b := a; END_IF".format), (3, "IF {} THEN b := a; END_IF".format)],
)  # fmt: skip
def test_a_chain_of_twice_as_many_terms_is_twice_the_work(
    monkeypatch: pytest.MonkeyPatch, level: int, statement: Callable[[str], str]
) -> None:
    asked: list[int] = []
    negates, is_stored = lower_expr._negates, lower_expr._is_stored
    monkeypatch.setattr(lower_expr, "_negates", lambda *args: asked.append(1) or negates(*args))
    monkeypatch.setattr(lower_expr, "_is_stored", lambda *args: asked.append(1) or is_stored(*args))
    work = []
    for count in (50, 100):
        asked.clear()
        text = f"PROGRAM Main VAR a, b : BOOL; n : INT; END_VAR {statement(' AND '.join(['a'] * count))} END_PROGRAM"
        found = check_sources([Source("main.st", text)])
        assert found.program, found.diagnostics
        lower(found.program, Options(find_target("x86_64-linux"), level))
        work.append(len(asked))
    assert work[0] > 50
    assert work[1] < 2.2 * work[0]
