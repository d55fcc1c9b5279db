"""CAN_SEND and CAN_RECEIVE in the simulator."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from can_programs import PROGRAM

from plctool.compiler import compile_sources
from plctool.compiler.image.build import BuildResult
from plctool.errors import DeviceError, UsageError
from plctool.sim import Simulator
from plctool.sim_can import CanFrame

NO_NETWORK, RESERVED, INVALID = 0x201, 0x202, 0x203


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> BuildResult:
    path = tmp_path_factory.mktemp("program") / "app.st"
    path.write_text(PROGRAM)
    return compile_sources([path])


@pytest.fixture
def plc(built: BuildResult) -> Iterator[Simulator]:
    with Simulator(built.image, built.symbols) as simulator:
        simulator.run_cycles(2)
        yield simulator


def send(plc: Simulator, **inputs: int | bool) -> int:
    """The ErrorID of a frame that the program sends; 0 when it is sent."""
    plc.write({f"Main.{name}": value for name, value in inputs.items()} | {"Main.go": True})
    plc.run_cycles(1)
    for _ in range(10):
        if not plc.read("Main.sender.Busy"):
            break
        plc.run_cycles(1)
    error = int(plc.read("Main.sender.ErrorID"))
    plc.write({"Main.go": False})
    plc.run_cycles(2)
    return error


@pytest.mark.parametrize(
    ("inputs", "frame"),
    [
        ({"id": 0x123, "length": 3}, CanFrame(0x123, b"\x10\x20\x30")),
        ({"id": 0x7FF, "length": 8}, CanFrame(0x7FF, bytes(range(0x10, 0x90, 0x10)))),
        ({"id": 0x18FEF1A0, "length": 0, "extended": True}, CanFrame(0x18FEF1A0, b"", extended=True)),
        ({"id": 0x700, "length": 1, "remote": True}, CanFrame(0x700, b"\0", remote=True)),
    ],
)
def test_program_sends_a_frame(plc: Simulator, inputs: dict[str, int | bool], frame: CanFrame) -> None:
    assert send(plc, **inputs) == 0
    assert plc.can_receive() == [frame]


@pytest.mark.parametrize(
    ("inputs", "error"),
    [
        ({"network": 1}, NO_NETWORK),
        ({"id": 0x800}, INVALID),
        ({"length": 9}, INVALID),
        ({"id": 0x2000_0000, "extended": True}, INVALID),
        ({"id": 0x1F40_01C8, "extended": True}, RESERVED),
    ],
)
def test_frame_that_must_not_be_sent_is_refused(plc: Simulator, inputs: dict[str, int | bool], error: int) -> None:
    assert send(plc, **inputs) == error
    assert plc.can_receive() == []


def test_receiver_gets_frames_in_order_and_only_its_own(plc: Simulator) -> None:
    for number in (0x200, 0x300, 0x2FF):
        plc.can_send(number, bytes([number & 0xFF, 7]))
    plc.can_send(0x234, b"\1" * 5, extended=True)
    plc.run_for(30)
    assert (plc.read("Main.count"), plc.read("Main.last")) == (2, 0x2FF)
    assert (plc.read("Main.lastLength"), list(plc.read("Main.data"))) == (2, [0xFF, 7, 0, 0, 0, 0, 0, 0])
    plc.can_send(0x18FEF117, b"", extended=True)
    plc.run_for(30)
    assert (plc.read("Main.count29"), plc.read("Main.last29")) == (1, 0x18FEF117)


def test_frames_without_room_are_counted(plc: Simulator) -> None:
    plc.stop()
    plc.start()
    plc.run_cycles(2)
    plc.write({"Main.receiver.Enable": False})
    plc.run_cycles(1)
    plc.write({"Main.receiver.Enable": True})
    plc.run_cycles(2)
    before = plc.read("Main.count")
    for _ in range(60):
        plc.can_send(0x201)
    plc.run_for(30)
    assert plc.read("Main.count") - before + plc.read("Main.receiver.Lost") == 60


def test_receivers_of_a_stopped_program_are_given_back(built: BuildResult) -> None:
    with Simulator(built.image, built.symbols) as plc:
        for _ in range(40):  # more than there are receivers
            plc.run_cycles(2)
            assert not plc.read("Main.receiver.Error") or plc.read("Main.receiver.ErrorID") == 0x206
            plc.stop()
            plc.start()
        plc.run_cycles(3)
        plc.can_send(0x200)
        plc.run_for(30)
        assert plc.read("Main.count") == 1


def test_each_frame_of_a_program_is_on_the_bus_once(plc: Simulator) -> None:
    plc.can_receive()
    plc.write({"Main.length": 8})
    for _ in range(50):
        plc.write({"Main.go": True})
        plc.run_cycles(3)
    frames = plc.can_receive()
    assert len(frames) == plc.read("Main.done") == 50
    assert [f.time_ns for f in frames] == sorted(f.time_ns for f in frames)


def test_test_cannot_send_what_is_no_frame(plc: Simulator) -> None:
    with pytest.raises(UsageError, match="identifier 0x800 is not 0 to 0x7ff; give extended=True"):
        plc.can_send(0x800)
    with pytest.raises(UsageError, match="at most 8 bytes, not 9"):
        plc.can_send(1, bytes(9))
    with pytest.raises(DeviceError, match="let time pass"):
        for _ in range(100):
            plc.can_send(1)
