"""A board as the CANopen manager of a foreign node, python canopen's, on its second UART, which carries SLCAN."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from environment import TARGET
from programs import Built

from plctool.compiler import compile_sources
from plctool.debug.symbols import symbol_path
from plctool.device import Plc
from plctool.iec.types import UINT
from plctool.link.connection import Connection
from plctool.testing.waiting import eventually

sys.path.append(str(Path(__file__).parents[1]))

from canopen_nodes import ForeignNode
from canopen_programs import write_program

SOURCE = """
VAR_GLOBAL motions : UDINT; END_VAR
PROGRAM Main
VAR inputs, coils : BYTE; door : BOOL; pressure : INT; read : CIA405_SDO_READ4; begin : BOOL; END_VAR
coils := inputs;
read(DEVICE := 9, INDEX := 16#2001, ENABLE := begin);
END_PROGRAM
PROGRAM Motion motions := motions + 1; END_PROGRAM
CONFIGURATION Plant RESOURCE Cpu ON Plc
TASK Cyclic(INTERVAL := T#10ms, PRIORITY := 5);
TASK Fast(EVENT := 'Bus.sync', PRIORITY := 1);
PROGRAM m WITH Cyclic : Main;
PROGRAM x WITH Fast : Motion;
END_RESOURCE END_CONFIGURATION
"""


def built(folder: Path) -> Built:
    source = write_program(folder, line='sync = { every = "T#50ms" }', source=SOURCE)
    program = compile_sources([source], target=TARGET, limits=False)
    path = source.with_suffix(".cdl")
    path.write_bytes(program.image)
    program.symbols.save(symbol_path(path))
    return Built(program.image, path, program.symbols)


def test_foreign_node_is_brought_into_operation_lost_and_regained(
    make_board: Callable[..., Any], tmp_path: Path
) -> None:
    board = make_board("canopen-manager")
    board.power_on("host")
    program = built(tmp_path / "program")
    with Plc(Connection(board.line()), program.path.with_suffix(".sym")) as plc:
        plc.flash(program.image)
        for round_ in range(2):
            with ForeignNode(board.can) as foreign:
                eventually(lambda: plc.read("Valves.ok"))
                assert foreign.node.nmt.state == "OPERATIONAL"
                assert foreign.node.sdo[0x2001].raw == 700
                assert foreign.node.sdo[0x2000].raw == "press twenty-five"
                assert foreign.node.sdo[0x1A00][1].raw == 0x64010110
                value = 0x41 + round_
                foreign.send_inputs(b"\x10\x27" + bytes([value]))
                eventually(lambda value=value: plc.read("Main.inputs") == value)
                assert plc.read("Main.pressure") == 10_000
                eventually(lambda f=foreign, value=value: f.outputs[-1:] == [bytes([value])])
                plc.write({"m.begin": True})
                eventually(lambda: plc.read("m.read.CONFIRM"))
                assert plc.read("m.read.DATA[1]") == 700 & 0xFF
                assert plc.io_read_parameter("Valves", 0x2001 << 8, UINT) == 700
            eventually(lambda: not plc.read("Valves.ok"))
        motions = plc.read("motions")
        eventually(lambda: plc.read("motions") > motions)
        texts = [entry.text for entry in plc.log()]
        assert any(text.startswith("Valves is lost") for text in texts), texts
