"""A bus on virtual time with an SDO server, whose frames can be lost, doubled or late."""

from __future__ import annotations

import heapq
from binascii import crc_hqx
from collections.abc import Callable, Iterator
from pathlib import Path

import can
import canopen

from plctool.canopen.bus import CanopenBus
from plctool.canopen.sdo import SdoClient

VALVES = Path(__file__).parents[2] / "examples/canopen/valves.eds"
NODE = 5
FRAME_TIME = 0.0003
Fate = Callable[[int, bytes], list[float]]
"""Of the n-th frame on the bus (from 0): how late each of its copies is [s]."""
Server = Callable[[bytes], Iterator[bytes]]


def arrives(number: int, data: bytes) -> list[float]:
    return [0.0]


class Bed:
    """Implements `canbus.Bus`."""

    def __init__(self, server: Server, fate: Fate = arrives) -> None:
        self._server, self._fate = server, fate
        self.sent: list[bytes] = []
        self.frames = 0
        self._now = 0.0
        self._order = 0
        self._events: list[tuple[float, int, bool, bytes]] = []  # when, order, to the server, data

    def client(self, timeout: float = 1.0) -> SdoClient:
        return SdoClient(CanopenBus(self, "test"), NODE, timeout)

    def send(self, message: can.Message) -> None:
        assert message.arbitration_id == 0x600 + NODE
        assert len(message.data) == 8
        self.sent.append(bytes(message.data))
        self._put(bytes(message.data), to_server=True)

    def _put(self, data: bytes, *, to_server: bool) -> None:
        for late in self._fate(self.frames, data):
            self._order += 1
            heapq.heappush(self._events, (self._now + FRAME_TIME + late, self._order, to_server, data))
        self.frames += 1

    def receive(self, timeout: float) -> can.Message | None:
        end = self._now + timeout
        while self._events and self._events[0][0] <= end:
            when, _, to_server, data = heapq.heappop(self._events)
            self._now = max(self._now, when)
            if not to_server:
                return can.Message(arbitration_id=0x580 + NODE, is_extended_id=False, data=data)
            for reply in self._server(data):
                self._put(reply, to_server=False)
        self._now = max(self._now, end)
        return None

    def now(self) -> float:
        return self._now

    def fileno(self) -> int | None:
        return None

    def close(self) -> None:
        pass


class _Network(canopen.Network):
    """Keeps what is sent."""

    def __init__(self) -> None:
        super().__init__()
        self.out: list[bytes] = []

    def send_message(self, can_id: int, data: bytes, remote: bool = False) -> None:
        if can_id == 0x580 + NODE:
            self.out.append(bytes(data))


class Foreign:
    """PyPI canopen's server; a DOMAIN is 2100h."""

    def __init__(self) -> None:
        self._network = _Network()
        dictionary = canopen.import_od(str(VALVES), NODE)
        domain = canopen.objectdictionary.ODVariable("Data", 0x2100)
        domain.data_type, domain.access_type = 0xF, "rw"
        dictionary.add_object(domain)
        self.node = canopen.LocalNode(NODE, dictionary)
        self.node.associate_network(self._network)

    def __call__(self, data: bytes) -> Iterator[bytes]:
        self._network.out.clear()
        self.node.sdo.on_request(0x600 + NODE, bytearray(data), 0.0)
        yield from list(self._network.out)


class BlockServer:
    """A server with block transfer of one value, as CiA 301 draws it."""

    def __init__(self, value: bytes = b"", block: int = 8, *, crc: bool = True) -> None:
        self.value, self._block, self._crc = value, block, crc
        self._state = ""
        self._size = self._at = self._in_order = 0
        self._parts: list[bytes] = []
        self._place = b""

    def __call__(self, data: bytes) -> Iterator[bytes]:
        if data[0] == 0x80 and self._state != "segments":
            self._state = ""
        elif self._state == "segments":
            yield from self._segment(data)
        elif data[0] & 0xF9 == 0xC0:  # write: begin
            self._place, self._size = data[1:4], int.from_bytes(data[4:], "little")
            self._parts, self._in_order, self._state = [], 0, "segments"
            yield self._reply(0xA0 | 4 * self._crc, self._place + bytes([self._block]))
        elif data[0] & 0xE3 == 0xC1 and self._state == "end":
            yield self._written(data)
        elif data[0] & 0xE3 == 0xA0:  # read: begin
            self._place, self._state, self._at = data[1:4], "begun", 0
            self._asked = data[4]
            yield self._reply(0xC2 | 4 * self._crc, self._place + len(self.value).to_bytes(4, "little"))
        elif data[0] == 0xA3 and self._state == "begun":
            self._state = "reading"
            yield from self._block_of_value()
        elif data[0] == 0xA2 and self._state == "reading":
            self._at += data[1]
            self._asked = data[2]
            yield from self._block_of_value()

    def _reply(self, command: int, data: bytes) -> bytes:
        return (bytes([command]) + data).ljust(8, b"\0")

    def _abort(self, code: int) -> bytes:
        self._state = ""
        return self._reply(0x80, self._place + code.to_bytes(4, "little"))

    def _segment(self, data: bytes) -> Iterator[bytes]:
        number, is_last = data[0] & 0x7F, bool(data[0] & 0x80)
        if number == 0:
            self._state = ""
            return
        if number == self._in_order + 1:
            self._parts.append(data[1:])
            self._in_order += 1
            self._state = "end" if is_last else "segments"
        if is_last or number == self._block:
            acknowledged, self._in_order = self._in_order, 0
            yield self._reply(0xA2, bytes([acknowledged, self._block]))

    def _written(self, data: bytes) -> bytes:
        joined = b"".join(self._parts)
        value = joined[: len(joined) - (data[0] >> 2 & 7)]
        if self._crc and crc_hqx(value, 0) != int.from_bytes(data[1:3], "little"):
            return self._abort(0x05040004)
        if len(value) != self._size:
            return self._abort(0x06070010)
        self.value, self._state = value, ""
        return self._reply(0xA1, b"")

    def _block_of_value(self) -> Iterator[bytes]:
        parts = [self.value[i : i + 7] for i in range(0, len(self.value), 7)] or [b""]
        if self._at >= len(parts):
            self._state = ""
            crc = crc_hqx(self.value, 0) if self._crc else 0
            yield self._reply(0xC1 | 7 - len(parts[-1]) << 2, crc.to_bytes(2, "little"))
            return
        for number, part in enumerate(parts[self._at : self._at + self._asked], 1):
            yield self._reply(number | (0x80 if self._at + number == len(parts) else 0), part)
