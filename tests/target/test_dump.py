"""A core dump of a board: variables, pointers and calls without it."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).resolve().parents[1]))

import wild_store

from plctool.device import Plc
from plctool.dump_file import parse, save, take_dump
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually

PROGRAM = """
TYPE Node : STRUCT value : DINT; next : POINTER TO Node; END_STRUCT END_TYPE
FUNCTION Divide : DINT VAR_INPUT top, bottom : DINT; END_VAR Divide := top / bottom; END_FUNCTION
PROGRAM Main
VAR n : DINT := 3; first, second : Node; head : POINTER TO Node; END_VAR
first.next := ADR(second); second.value := 22; head := ADR(first);
n := n - 1;
second.value := second.value + Divide(top := 100, bottom := n) * 0;
END_PROGRAM
CONFIGURATION C RESOURCE R ON PLC TASK T(INTERVAL := T#10ms, PRIORITY := 1); PROGRAM Main WITH T : Main;
END_RESOURCE END_CONFIGURATION
"""


def test_a_dump_has_the_registers_of_a_fault(make_board, build):
    with make_board("full") as board, Plc(Connection(board.line())) as plc:
        plc.flash(build(wild_store.PROGRAM).path)
        eventually(lambda: plc.raw_status().exception)
        dump = parse(save(take_dump(plc)))
        found = dump.registers.named()
        assert wild_store.VALUE in found.values()
        assert found["fault_address" if "fault_address" in found else "mtval"] == wild_store.ADDRESS
        plc.reset("warm")
        assert plc.registers() is None
    place = dump.explained()
    assert (place.name, place.line) == ("ACCESS_VIOLATION", wild_store.LINE)


@pytest.mark.parametrize(("config", "follows_pointers"), [("full", True), ("standard", False)])
def test_a_dump_has_variables_and_calls(make_board, build, config, follows_pointers):
    with make_board(config) as board, Plc(Connection(board.line())) as plc:
        plc.flash(build(PROGRAM).path)
        eventually(lambda: plc.raw_status().exception)
        exception = plc.status().exception
        dump = parse(save(take_dump(plc)))
    assert dump.explained() == exception
    assert dump.sample(["Main.n", "Main.second.value"]).values == {"Main.n": 0, "Main.second.value": 22}
    if follows_pointers:
        assert dump.sample(["Main.head^.next^.value"]).values == {"Main.head^.next^.value": 22}
