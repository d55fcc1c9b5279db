"""plcrt as CANopen manager of a node of durand, a stack that has no code in common with python canopen."""

from __future__ import annotations

import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import can
import durand

sys.path.append(str(Path(__file__).parents[1]))

from canopen_programs import write_program
from durand import object_dictionary, scheduler

from plctool import connect
from plctool.iec.types import BYTE, UINT, ArrayType
from plctool.link.canbus import open_bus
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import PATIENCE, eventually

NODE = 9
EVENT_TIMER = re.compile(r"\[1800sub5\][^\[]*")  # durand has none
RO, RW = "ro", "rw"


def dictionary() -> Any:
    """The objects of valves.eds that durand does not have by itself."""
    kinds = durand.DatatypeEnum
    objects = object_dictionary.ObjectDictionary()
    objects[0x2000] = durand.Variable(kinds.VISIBLE_STRING, RW, b"")
    objects[0x2001] = durand.Variable(kinds.UNSIGNED16, RW, 0)
    small, word = kinds.UNSIGNED8, kinds.INTEGER16
    for index, kind, access in ((0x6000, small, RO), (0x6200, small, RW), (0x6401, word, RO)):
        record = durand.Record()
        record[1] = durand.Variable(kind, access, 0)
        objects[index] = record
    return objects


@contextmanager
def node(link: str) -> Iterator[Any]:
    """A node on the bus of a link."""
    timer = scheduler.SyncScheduler()
    scheduler.set_scheduler(timer)
    bus = open_bus(link, 500000, 0)
    network = durand.CANBusNetwork(bus)
    made = durand.MinimalNode(network, NODE, dictionary())
    for index, sub, value in ((0x1000, 0, 0x30191), (0x1018, 1, 0x319), (0x1018, 2, 0x1008), (0x1018, 3, 0x10002)):
        made.object_dictionary.write(index, sub, value)
    thread = threading.Thread(target=timer.run, daemon=True)
    thread.start()
    try:
        yield made
    finally:
        made.object_dictionary.write(0x1017, 0, 0, downloaded=True)
        timer.stop()
        thread.join(PATIENCE)
        network.stop()
        bus.shutdown()


@contextmanager
def heard(link: str) -> Iterator[list[can.Message]]:
    """All frames on a bus."""
    frames: list[can.Message] = []
    bus = open_bus(link, 500000, 0)
    notifier = can.Notifier(bus, [frames.append])
    try:
        yield frames
    finally:
        notifier.stop()
        bus.shutdown()


def test_node_of_another_stack_is_brought_into_operation(tmp_path: Path, tool: Any) -> None:
    image, source = tmp_path / "app.cdl", write_program(tmp_path / "program")
    eds = source.with_name("valves.eds")
    eds.write_text(EVENT_TIMER.sub("", eds.read_text()))
    built = tool("build", str(source), "-o", str(image))
    assert built.status == 0, built.err
    with CanHub(5) as hub:
        options = ("--can", f"slcan:{hub.paths[0]}", "--node", "5")
        with Plcrt(tmp_path / "flash", *options), connect(f"can:slcan:{hub.paths[1]}?node=5") as plc:
            plc.flash(image)
            with node(f"slcan:{hub.paths[2]}") as foreign, heard(f"slcan:{hub.paths[4]}") as frames:
                read, write = foreign.object_dictionary.read, foreign.object_dictionary.write
                eventually(lambda: plc.read("Valves.ok"))
                assert (read(0x2001, 0), bytes(read(0x2000, 0))) == (700, b"press twenty-five")
                assert read(0x1A00, 1) == 0x64010110
                write(0x6401, 1, -1234)
                write(0x6000, 1, 0x5A)
                foreign.tpdo[0].transmit()
                eventually(lambda: (plc.read("Main.inputs"), plc.read("Main.pressure")) == (0x5A, -1234))
                eventually(lambda: read(0x6200, 1) == 0x5A)
                assert plc.io_read_parameter("Valves", 0x2001 << 8, UINT) == 700
                text = "as long as two blocks of the manager and more: " * 10
                recipe = ArrayType(BYTE, ((1, len(text)),))
                plc.io_write_parameter("Valves", 0x2000 << 8, recipe, list(text.encode()))
                assert bytes(read(0x2000, 0)).decode() == text
                assert bytes(plc.io_read_parameter("Valves", 0x2000 << 8, recipe)).decode() == text
                eventually(
                    lambda: {0xC6, 0xA4} <= {f.data[0] for f in list(frames) if f.arbitration_id == 0x600 + NODE}
                )
                text = "a text of some blocks " * 6
                assert tool_of(tool, hub, "write", "2000", text, "--type", "STRING").status == 0
                assert bytes(read(0x2000, 0)).decode() == text
                assert text in tool_of(tool, hub, "read", "2000", "--type", "STRING").out


def is_request(frame: can.Message) -> bool:
    return frame.arbitration_id == 0x600 + NODE


def tool_of(tool: Any, hub: CanHub, what: str, *words: str) -> Any:
    """plctool's own client on the same bus."""
    return tool("canopen", "sdo", what, str(NODE), *words, "--can", f"slcan:{hub.paths[3]}")
