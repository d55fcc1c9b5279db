"""An exception for an index or a value says which it was and what the bounds are, as far as variables still show it."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given
from hypothesis import strategies as st
from shares import examples

from plctool import Simulator
from plctool.compiler import compile_sources
from plctool.controller import ProgramStopped

UNITS = """TYPE Small : INT (1..5); Row : STRUCT cells : ARRAY[1..3] OF INT; at : INT; END_STRUCT END_TYPE
FUNCTION_BLOCK Buffer
VAR_INPUT n : INT; END_VAR
VAR list : ARRAY[1..10] OF INT; count : INT; END_VAR
count := count + n;
list[count] := 7;
END_FUNCTION_BLOCK
FUNCTION_BLOCK Derived EXTENDS Buffer
SUPER^(n := n);
END_FUNCTION_BLOCK
FUNCTION OfCall : INT
VAR_INPUT x : INT; END_VAR
VAR t : ARRAY[0..9] OF INT; END_VAR
OfCall := t[x];
END_FUNCTION
"""
CASES = {
    "an index": (
        "list : ARRAY[0..3] OF INT; i : INT := 4",
        "list[i] := 1;",
        "the index of Main.list is 4, outside 0..3",
    ),
    "the second index": (
        "list : ARRAY[0..3, 1..2] OF INT; i : INT := 3",
        "list[i, i] := 1;",
        "the index of Main.list is 3, outside 1..2",
    ),
    "an unsigned one": (
        "list : ARRAY[0..3] OF INT; i : UDINT := 4294967295",
        "list[i] := 1;",
        "the index of Main.list is 4294967295, outside 0..3",
    ),
    "one of two in a line": (
        "a, b : ARRAY[0..3] OF INT; i : INT := -1; k : INT",
        "a[k] := b[i];",
        "the index of Main.b is -1, outside 0..3",
    ),
    "an array in a structure": (
        "rows : ARRAY[1..2] OF Row := [(at := 1), (at := 5)]",
        "rows[2].cells[rows[2].at] := 1;",
        "the index of Main.rows[2].cells is 5, outside 1..3",
    ),
    "a character": ("s : STRING[10]; i : INT := 11", "s[i] := 65;", "the index of Main.s is 11, outside 0..10"),
    "a subrange": ("small : Small; x : INT := 6", "small := x;", "the value is 6, outside 1..5"),
    "a loop": (
        "list : ARRAY[1..4] OF INT; i : INT; last : INT := 9",
        "FOR i := 1 TO last DO list[i] := i; END_FOR",
        "the index of Main.list is 5, outside 1..4",
    ),
    "a block": ("a, b : Buffer", "a(n := 1); b(n := 11);", "the index of Main.b.list is 11, outside 1..10"),
    "a block in an array": (
        "all : ARRAY[1..2] OF Buffer",
        "all[1](n := 1); all[2](n := 12);",
        "the index of Main.all[2].list is 12, outside 1..10",
    ),
    "one of several blocks": ("a, b : Buffer", "a(n := 0);", "the index of list is outside 1..10"),
    "a derived block": ("d : Derived", "d(n := 13);", "the index of list is outside 1..10"),
    "what a call had": ("r : INT; x : INT := 10", "r := OfCall(x);", "the index of t is outside 0..9"),
    "a product of variables": (
        "list : ARRAY[0..3] OF INT; i : INT := 2",
        "list[i * i] := 1;",
        "the index of Main.list is outside 0..3",
    ),
    "two that may be it": (
        "a, b : ARRAY[0..3] OF INT; i : INT := 2",
        "a[i * i] := b[i / 2];",
        "",
    ),
}


def stopped(folder: Path, variables: str, body: str) -> str | None:
    """What the exception says besides its location; None when there was none."""
    path = folder / "main.st"
    path.write_text(f"{UNITS}PROGRAM Main VAR {variables}; END_VAR\n{body}\nEND_PROGRAM\n")
    with Simulator.from_sources(path) as plc:
        try:
            plc.run_cycles(1)
        except ProgramStopped as stop:
            assert stop.exception.name == "ARRAYBOUNDS"
            return stop.exception.detail
    return None


@pytest.mark.parametrize("case", CASES)
def test_the_exception_says_what_was_outside(case: str, tmp_path: Path) -> None:
    variables, body, wanted = CASES[case]
    assert stopped(tmp_path, variables, body) == wanted


INTEGERS = {"SINT": (-128, 127), "USINT": (0, 255), "INT": (-32768, 32767), "UINT": (0, 65535), "DINT": (-40000, 40000)}
VARIABLES = st.sampled_from([*INTEGERS]).flatmap(lambda t: st.tuples(st.just(t), st.integers(*INTEGERS[t])))


@examples(40)
@given(
    st.lists(st.tuples(VARIABLES, st.integers(-3, 3)), min_size=1, max_size=3),
    st.integers(-20, 20),
    st.integers(-5, 5),
    st.integers(0, 60000),
)
def test_a_sum_is_the_value_that_was_compared(
    terms: list[tuple[tuple[str, int], int]], constant: int, low: int, count: int
) -> None:
    total = sum(value * factor for (_, value), factor in terms) + constant
    text = " + ".join(f"{t}_TO_DINT(v{i}) * ({factor})" for i, ((t, _), factor) in enumerate(terms))
    variables = "; ".join(f"v{i} : {t} := {value}" for i, ((t, value), _) in enumerate(terms))
    with TemporaryDirectory() as folder:
        body = f"list[{text} + ({constant})] := 1;".replace("DINT_TO_DINT", "")
        said = stopped(Path(folder), f"list : ARRAY[{low}..{low + count}] OF BYTE; {variables}", body)
    outside = f"the index of Main.list is {total}, outside {low}..{low + count}"
    assert said == (None if low <= total <= low + count else outside)


@pytest.mark.parametrize("case", ["an index", "a character", "a subrange", "a block"])
def test_symbols_of_every_target_say_the_same(case: str, tmp_path: Path) -> None:
    variables, body, _ = CASES[case]
    path = tmp_path / "main.st"
    path.write_text(f"{UNITS}PROGRAM Main VAR {variables}; END_VAR\n{body}\nEND_PROGRAM\n")
    here, *others = (
        compile_sources([path], target=t).symbols.bounds for t in ("x86_64-linux", "cortex-m3", "rv32imac")
    )
    assert here and all(bounds == here for bounds in others)
