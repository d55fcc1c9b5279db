"""Patterns leave out the internal variables of standard blocks, such as START of a TON, unless they are named."""

from __future__ import annotations

import pytest

from plctool.compiler import compile_sources
from plctool.debug.symbols import SymbolTable

SOURCE = """PROGRAM Main
VAR delay : TON; mine : Mine; list : ARRAY[0..1] OF CTU; END_VAR
delay(IN := TRUE, PT := T#1s); mine(); list[0](CU := delay.Q, PV := 3);
END_PROGRAM
FUNCTION_BLOCK Mine
VAR_INPUT x : INT; END_VAR
VAR START : INT; edge : R_TRIG; END_VAR
START := x; edge(CLK := TRUE);
END_FUNCTION_BLOCK
"""


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> SymbolTable:
    source = tmp_path_factory.mktemp("program") / "main.st"
    source.write_text(SOURCE)
    return SymbolTable.from_json(compile_sources([source]).symbols.to_json())


def test_a_pattern_leaves_them_out(table: SymbolTable) -> None:
    found = list(table.select(["Main.*"]))
    assert "Main.delay.Q" in found
    assert "Main.mine.edge.CLK" in found
    assert not {"Main.delay.START", "Main.delay.RUNNING", "Main.mine.edge.M"} & set(found)


def test_blocks_of_the_program_show_theirs(table: SymbolTable) -> None:
    assert "Main.mine.START" in table.select(["Main.*"])


@pytest.mark.parametrize("name", ["Main.delay.START", "Main.*.START", "main.d*.start", "Main.list[0].M"])
def test_they_are_there_by_name(table: SymbolTable, name: str) -> None:
    assert table.select([name])


def test_elements_of_arrays_leave_them_out(table: SymbolTable) -> None:
    assert list(table.select(["Main.list[0].*"])) == [f"Main.list[0].{n}" for n in ("CU", "R", "PV", "Q", "CV")]
