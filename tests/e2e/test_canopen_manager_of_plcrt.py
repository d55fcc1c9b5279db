"""plcrt as CANopen manager of a foreign node, python canopen's LocalNode, on a hub of pseudo terminals."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest

sys.path.append(str(Path(__file__).parents[1]))

from canopen_nodes import NODE, ForeignNode
from canopen_programs import BLOCKS, SOURCE, write_guarded_program, write_program

from plctool import connect
from plctool.device import Plc
from plctool.iec.types import BYTE, ArrayType
from plctool.link.canbus import open_bus
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually


@pytest.fixture
def hub() -> Iterator[CanHub]:
    with CanHub(3) as hub:
        yield hub


@pytest.fixture
def source() -> str:
    return SOURCE


@pytest.fixture
def plc(hub: CanHub, tmp_path: Path, tool: Any, source: str) -> Iterator[Plc]:
    image = tmp_path / "app.cdl"
    built = tool("build", str(write_program(tmp_path / "program", source=source)), "-o", str(image))
    assert built.status == 0, built.err
    options = ("--can", f"slcan:{hub.paths[0]}", "--node", "5")
    with Plcrt(tmp_path / "flash", *options), connect(f"can:slcan:{hub.paths[1]}?node=5") as plc:
        plc.flash(image)
        yield plc


def test_foreign_node_is_brought_into_operation_lost_and_regained(hub: CanHub, plc: Plc) -> None:
    for round_ in range(2):
        with ForeignNode(f"slcan:{hub.paths[2]}") as foreign:
            eventually(lambda: plc.read("Valves.ok"))
            assert foreign.node.nmt.state == "OPERATIONAL"
            assert foreign.node.sdo[0x2001].raw == 700
            assert foreign.node.sdo[0x2000].raw == "press twenty-five"
            assert foreign.node.sdo[0x1A00][1].raw == 0x64010110
            value = 0x41 + round_
            foreign.send_inputs(b"\x10\x27" + bytes([value]))
            eventually(lambda value=value: plc.read("Main.inputs") == value and plc.read("Main.pressure") == 10_000)
            eventually(lambda f=foreign, value=value: f.outputs[-1:] == [bytes([value])])
        eventually(lambda: not plc.read("Valves.ok"))
    texts = [entry.text for entry in plc.log()]
    assert "Valves is lost: its heartbeat is missing" in texts
    assert "Valves is back" in texts


class GuardedNode(ForeignNode):
    """A node that replies to guarding requests, which python canopen does not."""

    def __init__(self, link: str, eds: Path) -> None:
        super().__init__(link, eds)
        self._toggle = 0

    def __enter__(self) -> GuardedNode:
        super().__enter__()
        assert self._network.notifier is not None
        self._network.notifier.add_listener(self._take)
        return self

    def _take(self, frame: can.Message) -> None:
        if frame.is_remote_frame and frame.arbitration_id == 0x700 + NODE:
            states = {"OPERATIONAL": 5, "STOPPED": 4}
            state = states.get(self.node.nmt.state, 0x7F)
            self._network.send_message(0x700 + NODE, bytes([state | self._toggle]))
            self._toggle ^= 0x80


def test_foreign_node_is_guarded(hub: CanHub, tmp_path: Path, tool: Any) -> None:
    image, program = tmp_path / "app.cdl", write_guarded_program(tmp_path)
    built = tool("build", str(program), "-o", str(image))
    assert built.status == 0, built.err
    options = ("--can", f"slcan:{hub.paths[0]}", "--node", "5")
    with Plcrt(tmp_path / "flash", *options), connect(f"can:slcan:{hub.paths[1]}?node=5") as plc:
        plc.flash(image)
        for _ in range(2):
            with GuardedNode(f"slcan:{hub.paths[2]}", program.with_name("valves.eds")) as foreign:
                eventually(lambda: plc.read("Valves.ok"))
                assert (foreign.node.sdo[0x100C].raw, foreign.node.sdo[0x1017].raw) == (100, 0)
            eventually(lambda: not plc.read("Valves.ok"))
        assert "Valves is lost: it does not reply to guarding" in [entry.text for entry in plc.log()]


BY_SYNC = """
VAR_GLOBAL motions : UDINT; END_VAR
PROGRAM Main VAR inputs, coils : BYTE; door : BOOL; pressure : INT; END_VAR coils := inputs; END_PROGRAM
PROGRAM Motion motions := motions + 1; END_PROGRAM
CONFIGURATION Plant RESOURCE Cpu ON Plc
TASK Slow(INTERVAL := T#100ms, PRIORITY := 5);
TASK Fast(EVENT := 'Bus.sync', PRIORITY := 1);
PROGRAM m WITH Slow : Main;
PROGRAM x WITH Fast : Motion;
END_RESOURCE END_CONFIGURATION
"""


def test_task_runs_by_the_sync_that_a_timer_sends(hub: CanHub, tmp_path: Path, tool: Any) -> None:
    image = tmp_path / "app.cdl"
    program = write_program(tmp_path, line='sync = { every = "T#20ms", window = "T#5ms" }', source=BY_SYNC)
    built = tool("build", str(program), "-o", str(image))
    assert built.status == 0, built.err
    options = ("--can", f"slcan:{hub.paths[0]}", "--node", "5")
    with Plcrt(tmp_path / "flash", *options), connect(f"can:slcan:{hub.paths[1]}?node=5") as plc:
        plc.flash(image)
        with open_bus(f"slcan:{hub.paths[2]}", 500000, 0) as bus:
            times = []
            while len(times) < 50:
                frame = bus.recv(10)
                assert frame is not None
                times += [frame.timestamp] if frame.arbitration_id == 0x80 else []
        eventually(lambda: plc.read("motions") >= 50)
        assert times[-1] - times[0] > 49 * 0.02 - 0.1


def do(plc: Plc, block: str, **inputs: Any) -> tuple[bool, int]:
    """What a block says of a job that begins now."""
    has_error = block != "state"
    plc.write({f"Main.{block}.ENABLE": False})
    eventually(lambda: not plc.read(f"Main.{block}.CONFIRM"))
    eventually(lambda: not has_error or plc.read(f"Main.{block}.ERROR") == 0)
    plc.write({f"Main.{block}.{name}": value for name, value in inputs.items()} | {f"Main.{block}.ENABLE": True})
    eventually(lambda: plc.read(f"Main.{block}.CONFIRM") or (has_error and plc.read(f"Main.{block}.ERROR") != 0))
    return plc.read(f"Main.{block}.CONFIRM"), plc.read(f"Main.{block}.ERROR") if has_error else 0


@pytest.mark.parametrize("source", [BLOCKS])
def test_program_reads_writes_and_commands_a_foreign_node(hub: CanHub, plc: Plc) -> None:
    with ForeignNode(f"slcan:{hub.paths[2]}") as foreign:
        eventually(lambda: plc.read("Valves.ok"))
        assert do(plc, "r4", DEVICE=NODE, INDEX=0x2001) == (True, 0)
        assert (plc.read("Main.r4.DATA[1]"), plc.read("Main.r4.DATA[2]")) == (700 & 0xFF, 700 >> 8)
        assert do(plc, "r21", DEVICE=NODE, INDEX=0x2000) == (True, 0)
        assert plc.read("Main.r21.DATALENGTH") == len("press twenty-five")
        plc.write({"Main.text": "by the program"})
        assert do(plc, "write_text", INDEX=0x2000) == (True, 0)
        assert foreign.node.sdo[0x2000].raw == "by the program"
        assert do(plc, "r4", DEVICE=NODE, INDEX=0x5555) == (False, 1)
        assert plc.read("Main.r4.ERRORINFO") == 0x06020000
        assert do(plc, "nmt", DEVICE=NODE, STATE="STOP_REMOTE_NODE") == (True, 0)
        eventually(lambda: foreign.node.nmt.state == "STOPPED")
        eventually(lambda: do(plc, "state", DEVICE=NODE)[0] and plc.read("Main.state.STATE") == "STOPPED")
        foreign.node.emcy.send(0x8130, 0x11, b"\1\2\3\4\5")
        assert do(plc, "emcy") == (True, 0)
        assert (plc.read("Main.emcy.DEVICE"), plc.read("Main.emcy.ERRORINFO.EMCY_ERROR_CODE")) == (NODE, 0x8130)


def test_node_without_block_transfer_gets_long_values_in_segments(hub: CanHub, plc: Plc) -> None:
    text = b"longer than what a block begins with: " * 5
    kind = ArrayType(BYTE, ((1, len(text)),))
    with ForeignNode(f"slcan:{hub.paths[2]}") as foreign:
        eventually(lambda: plc.read("Valves.ok"))
        plc.io_write_parameter("Valves", 0x2000 << 8, kind, list(text))
        assert bytes(foreign.node.data_store[0x2000][0]) == text
        assert bytes(plc.io_read_parameter("Valves", 0x2000 << 8, kind)) == text


def test_tool_reads_and_writes_objects_of_a_node_through_the_controller(hub: CanHub, plc: Plc, tool: Any) -> None:
    link = ("--can", f"slcan:{hub.paths[1]}", "--node", "5")
    plc.close()
    with ForeignNode(f"slcan:{hub.paths[2]}") as foreign:
        eventually(lambda: foreign.node.nmt.state == "OPERATIONAL")
        read = tool("io", "param", "get", "Valves", "2001:00", *link)
        assert (read.status, read.out.strip()) == (0, "Valves 2001:00 = 700"), read.err
        text = tool("io", "param", "get", "Valves", "2000:00", "--type", "STRING[40]", *link)
        assert "press twenty-five" in text.out, text.err
        written = tool("io", "param", "set", "Valves", "2001:00=650", "--type", "UINT", *link)
        assert (written.status, foreign.node.sdo[0x2001].raw) == (0, 650), written.err
        for arguments, message in (
            (("set", "Valves", "2001:00=650"), "give its type, for example --type UINT"),
            (("get", "Valves", "5555:00"), "the device refuses; the log has its reason"),
            (("get", "Valves", "2001:00", "--type", "BYTE"), "it has another length"),
        ):
            refused = tool("io", "param", *arguments, *link)
            assert refused.status != 0
            assert message in refused.err
