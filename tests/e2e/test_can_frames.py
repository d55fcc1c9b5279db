"""CAN_SEND and CAN_RECEIVE of a program on plcrt, whose CAN bus is a hub of pseudo terminals."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import can
import pytest

sys.path.append(str(Path(__file__).parents[1]))

from can_programs import PROGRAM

from plctool import connect
from plctool.device import Plc
from plctool.link.canbus import open_bus
from plctool.testing.can_hub import CanHub
from plctool.testing.plcrt import Plcrt
from plctool.testing.waiting import eventually

PATIENCE = 60.0  # for what is bound to happen [s]


@pytest.fixture
def bus(tmp_path: Path) -> Iterator[tuple[can.BusABC, CanHub]]:
    with CanHub(3) as hub:
        other = open_bus(f"slcan:{hub.paths[0]}", 500000, 0)
        try:
            yield other, hub
        finally:
            other.shutdown()


@pytest.fixture
def plc(bus: tuple[can.BusABC, CanHub], tmp_path: Path, tool) -> Iterator[Plc]:
    image = tool.build("frames", PROGRAM)
    options = ("--can", f"slcan:{bus[1].paths[1]}", "--node", "5")
    with Plcrt(tmp_path / "flash", *options), connect(f"can:slcan:{bus[1].paths[2]}?node=5") as plc:
        plc.flash(image)
        yield plc


def standard_frame(bus: can.BusABC) -> can.Message:
    """The next frame of 11 bits: those of the tool pass by."""
    while (frame := bus.recv(PATIENCE)) is not None:
        if not frame.is_extended_id:
            return frame
    raise AssertionError("no frame came")


def test_program_and_another_node_exchange_frames_beside_a_tool(bus: tuple[can.BusABC, CanHub], plc: Plc) -> None:
    other, _ = bus
    plc.write({"Main.length": 3, "Main.go": True})
    frame = standard_frame(other)
    assert (frame.arbitration_id, bytes(frame.data)) == (0x123, b"\x10\x20\x30")
    eventually(lambda: plc.read("Main.done") == 1)
    for number in range(0x200, 0x210):
        other.send(can.Message(arbitration_id=number, data=[number & 0xFF], is_extended_id=False))
    other.send(can.Message(arbitration_id=0x300, is_extended_id=False))
    other.send(can.Message(arbitration_id=0x18FEF142, is_extended_id=True))
    eventually(lambda: (plc.read("Main.count"), plc.read("Main.count29")) == (16, 1))
    assert (plc.read("Main.last"), plc.read("Main.last29")) == (0x20F, 0x18FEF142)


def test_receivers_are_given_back_and_taken_again(bus: tuple[can.BusABC, CanHub], plc: Plc) -> None:
    other, _ = bus
    for _ in range(3):
        plc.stop()
        plc.start()
    eventually(lambda: plc.read("Main.receiver.number") > 0 and not plc.read("Main.receiver.Error"))

    def hears() -> bool:
        other.send(can.Message(arbitration_id=0x201, is_extended_id=False))
        return bool(plc.read("Main.count") > 0)

    eventually(hears)
