"""CAN as the tool sees it: identifiers, the scan, addresses of tools, packets in frames, strangers, a lost bus."""

from __future__ import annotations

import math
import random
import secrets
from collections.abc import Iterator

import can
import pytest

from plctool.core import lib
from plctool.errors import LinkError, UsageError
from plctool.link import names, router
from plctool.link.canbus import CanTransport, PythonCanBus, SharedBus, open_bus, split_place
from plctool.link.channel import ChannelLost

BASE = 0x1F400000
ALL = 255
PATIENCE = 60.0  # for what is bound to come [s]


class Wire:
    """A bus of python-can in this process, and what is on it."""

    def __init__(self) -> None:
        self.name = secrets.token_hex(4)
        self.end = self.bus()

    def bus(self) -> can.BusABC:
        return can.Bus(interface="virtual", channel=self.name)

    def tool(self, node: int | None = None, first: int = 200, fd: bool = False) -> CanTransport:
        return CanTransport("virtual", PythonCanBus(self.bus()), node, fd=fd, random_source=Fixed(first))

    def say(self, source: int, target: int, data: bytes) -> None:
        identifier = BASE | target << 8 | source
        self.end.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=True, is_fd=len(data) > 8))

    def heard(self) -> tuple[int, int, bytes]:
        """Source, target and data of the next frame on the bus."""
        message = self.end.recv(PATIENCE)
        assert message
        assert message.is_extended_id
        assert message.arbitration_id >> 16 == BASE >> 16
        return message.arbitration_id & 255, message.arbitration_id >> 8 & 255, bytes(message.data)


class Fixed(random.Random):
    """Chooses `first`, then `first` + 1 and so on."""

    def __init__(self, first: int) -> None:
        super().__init__(1)
        self.next = first

    def randint(self, a: int, b: int) -> int:
        assert a <= self.next <= b
        self.next += 1
        return self.next - 1


@pytest.fixture
def wire() -> Iterator[Wire]:
    made = Wire()
    yield made
    made.end.shutdown()


def packet(sender: int, receiver: int, payload: bytes) -> bytes:
    return router.encode(
        router.Packet(lib.ROUTER_SVC_CHANNEL, receiver.to_bytes(2, "big"), sender.to_bytes(2, "big"), payload)
    )


def test_a_tool_says_its_address_and_has_it(wire: Wire) -> None:
    tool = wire.tool()
    source, target, data = wire.heard()
    assert (source, target, data[0], len(data)) == (200, ALL, lib.CAN_FRAME_CLAIM, 8)
    assert tool.local_address == b"\x00\xc8"
    tool.close()


def test_an_address_that_is_taken_or_claimed_is_left(wire: Wire) -> None:
    wire.end.recv(0)
    holder = wire.tool(first=200)
    other = wire.bus()

    class Contested(PythonCanBus):
        """A bus where the others answer at once."""

        def send(self, message: can.Message) -> None:
            super().send(message)
            identifier = message.arbitration_id
            # The first is claimed by another one at the same time, the second is taken.
            kind = {BASE | ALL << 8 | 201: b"\x41", BASE | ALL << 8 | 202: b"\x42"}.get(identifier)
            if kind:
                data = kind + b"\0\0\0\1\2\3\4"
                other.send(can.Message(arbitration_id=identifier, data=data, is_extended_id=True))

    late = CanTransport("virtual", Contested(wire.bus()), random_source=Fixed(201))
    assert late.local_address == b"\x00\xcb"
    late.close()
    holder.close()
    other.shutdown()


def test_the_holder_of_an_address_defends_it(wire: Wire) -> None:
    holder = wire.tool()
    wire.heard()
    wire.say(200, ALL, b"\x41\0\0\0\1\2\3\4")
    assert holder.receive(0.05) is None
    source, target, data = wire.heard()
    assert (source, target, data[0]) == (200, ALL, lib.CAN_FRAME_TAKEN)
    holder.close()


def test_anything_else_from_the_own_address_ends_the_connection(wire: Wire) -> None:
    holder = wire.tool()
    wire.say(200, 7, b"\x03abc")
    with pytest.raises(ChannelLost, match="same address"):
        holder.receive(PATIENCE)
    assert holder.local_address == b"\x00\xc9"
    holder.close()


def test_a_scan_is_one_frame(wire: Wire) -> None:
    for node, target in ((None, ALL), (5, 5)):
        tool = wire.tool(node)
        wire.heard()
        request = names.encode_request(0x01020304)
        tool.send(router.encode(router.Packet(lib.ROUTER_SVC_NAME_REQUEST, router.BROADCAST, b"\0\0", request)))
        source, to, data = wire.heard()
        assert (source, to) == (200, target)
        assert data[0] == lib.CAN_FRAME_SCAN
        assert (data[1] == 0) == (node is not None)
        assert data[2:] == b"\x00\x04" + b"\x04\x03\x02\x01"
        tool.close()


def test_packets_go_in_frames_with_flow_control(wire: Wire) -> None:
    tool = wire.tool(5)
    wire.heard()
    sent = packet(200, 5, b"0123456789")  # 22 bytes
    tool.send(sent)
    assert wire.heard() == (200, 5, b"\x10\x16" + sent[:6])
    wire.say(5, 200, b"\x30\x01\x00")
    assert tool.receive(0.05) is None
    assert wire.heard() == (200, 5, b"\x21" + sent[6:13])
    wire.say(5, 200, b"\x30\x00\x00")
    assert tool.receive(0.05) is None
    assert wire.heard() == (200, 5, b"\x22" + sent[13:20])
    assert wire.heard() == (200, 5, b"\x23" + sent[20:])
    tool.close()


def test_a_packet_is_taken_from_its_sender_only(wire: Wire) -> None:
    tool = wire.tool()
    wire.heard()
    for source, sender, taken in ((5, 6, False), (6, 6, True), (201, 201, False)):
        data = packet(sender, 200, b"hello")
        wire.say(source, 200, bytes([0x10, len(data)]) + data[:6])
        wire.say(source, 200, b"\x21" + data[6:13])
        wire.say(source, 200, b"\x22" + data[13:])
        assert tool.receive(PATIENCE if taken else 0.05) == (data if taken else None)
    assert tool.places[b"\x00\x06"] == "node 6"
    tool.close()


def test_with_fd_a_packet_may_be_one_frame(wire: Wire) -> None:
    tool = wire.tool(5, fd=True)
    wire.heard()
    sent = packet(200, 5, bytes(30))  # 42 bytes
    tool.send(sent)
    source, target, data = wire.heard()
    assert (source, target, len(data)) == (200, 5, 48)
    assert data[:2] == b"\x00\x2a"
    assert data[2:44] == sent
    tool.close()


def test_frames_of_others_change_nothing(wire: Wire) -> None:
    tool = wire.tool()
    strangers = [
        can.Message(arbitration_id=0x605, data=bytes(8), is_extended_id=False),
        can.Message(arbitration_id=0x18DAC805, data=b"\x03abc", is_extended_id=True),
        can.Message(arbitration_id=BASE | 200 << 8 | 5, is_remote_frame=True, is_extended_id=True),
        can.Message(arbitration_id=BASE | 200 << 8 | 5, data=b"", is_extended_id=True),
        can.Message(arbitration_id=BASE | 201 << 8 | 5, data=b"\x03abc", is_extended_id=True),
        can.Message(arbitration_id=BASE | 200 << 8 | 5, data=b"\x2f1234567", is_extended_id=True),
        can.Message(arbitration_id=BASE | 200 << 8 | 5, data=b"\xf0", is_extended_id=True),
        can.Message(arbitration_id=BASE | 200 << 8 | 5, data=b"\x10", is_extended_id=True),
    ]
    for message in strangers:
        wire.end.send(message)
    assert tool.receive(0.1) is None
    tool.close()


def test_a_bus_that_is_lost_is_told(wire: Wire) -> None:
    bus = wire.bus()
    tool = CanTransport("virtual", PythonCanBus(bus))
    bus.shutdown()
    for action in (lambda: tool.send(packet(200, 5, b"x")), lambda: tool.receive(0.1)):
        with pytest.raises(LinkError, match="was lost") as caught:
            action()
        assert caught.value.code == "link-lost"


def test_several_transports_share_a_bus(wire: Wire) -> None:
    shared = SharedBus(wire.bus())
    tools = [CanTransport("virtual", shared.part(), random_source=Fixed(first)) for first in (150, 160)]
    for tool in tools:
        address = tool.local_address[1]
        data = packet(9, address, b"for you")
        wire.say(9, address, bytes([0x10, len(data)]) + data[:6])
        wire.say(9, address, b"\x21" + data[6:13])
        wire.say(9, address, b"\x22" + data[13:])
        assert tool.receive(PATIENCE) == data
        tool.close()
    shared.close()


@pytest.mark.parametrize("place", ["", "can0", "socketcan:", "teapot:can0", ":can0"])
def test_what_is_no_interface_is_wrong_use(place: str) -> None:
    with pytest.raises(UsageError, match="is not a CAN interface"):
        split_place(place)


class FullBus:
    """A bus where frames of others come without a pause."""

    def __init__(self) -> None:
        self.frames = 0

    def send(self, message: can.Message) -> None:
        pass

    def receive(self, timeout: float) -> can.Message:
        self.frames += 1
        return can.Message(arbitration_id=0x123, is_extended_id=False, data=b"1")

    def now(self) -> float:
        return self.frames * 1e-4  # s: 10 000 frames per second

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        pass


def test_a_bus_full_of_foreign_frames_does_not_hold_the_tool() -> None:
    bus = FullBus()
    tool = CanTransport("full", bus)
    begun = bus.now()
    assert tool.receive(0.1) is None
    assert bus.now() - begun < 1.0


class LonelyBus(FullBus):
    """A bus where time passes as one waits, and a frame now and then when there is one in `frames_in`."""

    def __init__(self) -> None:
        super().__init__()
        self.time = 0.0
        self.frames_in: list[can.Message] = []

    def receive(self, timeout: float) -> can.Message | None:  # type: ignore[override]
        if self.frames_in:
            return self.frames_in.pop()
        self.time += timeout
        return None

    def now(self) -> float:
        return self.time


def packet_to(tool: CanTransport, node: int) -> bytes:
    return router.encode(router.Packet(int(lib.ROUTER_SVC_CHANNEL), bytes([0, node]), tool.local_address, bytes(100)))


def test_a_device_that_sends_no_flow_control_is_waited_for_once_and_not_before_each_packet() -> None:
    bus = LonelyBus()
    tool = CanTransport("lonely", bus, 5)
    begun = bus.now()
    for _ in range(8):
        tool.send(packet_to(tool, 5))
    assert 0.9 < bus.now() - begun < 1.3


def test_flow_control_shows_that_the_device_is_there() -> None:
    bus = LonelyBus()
    tool = CanTransport("lonely", bus, 5)
    assert tool.heard_at == -math.inf
    tool.send(packet_to(tool, 5))
    identifier = lib.CAN_ID_BASE | tool.local_address[-1] << lib.CAN_TARGET_SHIFT | 5
    bus.frames_in = [can.Message(arbitration_id=identifier, is_extended_id=True, data=b"\x31\0\0")]
    assert tool.receive(0.1) is None
    assert tool.heard_at > 0


def test_an_interface_that_needs_more_than_a_channel_is_an_error() -> None:
    with pytest.raises(LinkError, match="Cannot open CAN socketcand:host"):
        open_bus("socketcand:host", 500_000, 0)
