"""The value that the warning 'conversion' names is the one that the program has; where there is none, strings are
read as a whole."""

from __future__ import annotations

import re

from front_support import check
from hypothesis import example, given
from hypothesis import strategies as st
from shares import examples

from plctool.compiler.codegen.lower_unit import Options
from plctool.compiler.image.build import build_program
from plctool.image.targets import find_target, host_target
from plctool.sim import Simulator

TYPES = ("SINT", "USINT", "INT", "UINT", "DINT", "UDINT", "LINT", "ULINT", "BYTE", "WORD", "DWORD", "LWORD")
NUMBERS = st.integers(-(2**65), 2**65).map(str)
PIECES = st.lists(
    st.sampled_from(
        ["+", "-", "0", "7", "12", "128", "300", "16#", "016#", "2#", "8#", "F", "9", "e3", ".", "5", " ", "x", "_"]
    ),
    max_size=5,
).map("".join)
REALS = st.one_of(
    st.integers(-(10**6), 10**6).map(lambda n: f"{n / 4:.2f}"), st.integers(-(10**20), 10**20).map(lambda n: f"{n}.0")
)
TEXT_CALLS = st.tuples(st.one_of(NUMBERS, PIECES).map(lambda text: f"'{text}'"), st.just("STRING"))
REAL_CALLS = st.tuples(REALS.map(lambda text: f"LREAL#{text}"), st.just("LREAL"))


@examples(40)
@example([(("'016#'", "STRING"), "SINT"), (("'016#7F'", "STRING"), "INT"), (("'-002#101'", "STRING"), "INT")])
@given(st.lists(st.tuples(st.one_of(TEXT_CALLS, REAL_CALLS), st.sampled_from(TYPES)), min_size=10, max_size=30))
def test_named_values_are_right(calls: list[tuple[tuple[str, str], str]]) -> None:
    lines = [f"v{i} := {source}_TO_{target}({argument});" for i, ((argument, source), target) in enumerate(calls)]
    declared = " ".join(f"v{i} : {target};" for i, (_, target) in enumerate(calls))
    result = check(f"PROGRAM Main VAR {declared} END_VAR\n" + "\n".join(lines) + "\nEND_PROGRAM\n")
    assert result.program is not None, result.diagnostics
    told = {d.line - 2: d.message for d in result.diagnostics if d.code == "conversion"}
    built = build_program(result.program, Options(find_target(host_target()), 1))
    with Simulator(built.image, built.symbols) as plc:
        plc.run_cycles(1)
        for i, line in enumerate(lines):
            value = plc.read(f"Main.v{i}")
            named = re.search(r"(?:this is|becomes) (-?\d+)", told.get(i, ""))
            if named:
                assert int(named[1]) == value, (line, told[i], value)
            elif calls[i][0][1] == "STRING" and i not in told:
                assert _whole(calls[i][0][0].strip("'")) == value, (line, value)


def _whole(text: str) -> int | None:
    """The number that a text is, as IEC literals are written."""
    found = re.fullmatch(r"[ \t]*([+-]?)(?:(0*(?:2|8|16))#)?([0-9A-Fa-f]+)[ \t]*", text)
    return int(found[1] + found[3], int(found[2] or 10)) if found else None
