"""The serial line of the simulator as a transport: bytes take their time on it, which is virtual."""

from __future__ import annotations

import math
from collections import deque

from plctool.core import ffi, lib
from plctool.link import simplecom
from plctool.link.transport import BITS_PER_BYTE, DEFAULT_BAUD, NO_PLACES, TOOL_ADDRESS
from plctool.testing.line import Damage

TICK_NS = 500_000
_CHUNK = 4096


class SimSerial:
    """The simulator's serial line at `baud`, with bytes that get damaged on the way. The simulator has to be on; time
    passes only while waiting. `sent` and `received` are the bytes that were given to it."""

    name = "simulated serial line"
    local_address = TOOL_ADDRESS
    max_packet = simplecom.MAX_PACKET
    long_packet = simplecom.LONG_PACKET
    packet_overhead = simplecom.FRAME_OVERHEAD
    point_to_point = False
    heard_at = -math.inf
    peer_words = 1
    places = NO_PLACES
    is_slow = True
    is_bus = False

    def __init__(
        self, to_device: Damage | None = None, to_client: Damage | None = None, baud: int = DEFAULT_BAUD
    ) -> None:
        self.byte_rate = baud / BITS_PER_BYTE
        self.sent = self.received = 0
        self._out, self._in = bytearray(), bytearray()
        self._credit = 0.0
        self._to_device, self._to_client = to_device or Damage(), to_client or Damage()
        self._decoder = simplecom.Decoder()
        self._packets: deque[bytes] = deque()

    def fileno(self) -> int | None:
        return None  # the simulator runs in this thread

    def now(self) -> float:
        return float(lib.SimNow()) / 1e9

    def send(self, *packets: bytes) -> None:
        data = b"".join(map(simplecom.encode, packets))
        self.sent += len(data)
        self._out += data

    def receive(self, timeout: float) -> bytes | None:
        end = self.now() + timeout
        while not self._packets:
            if self.now() >= end:
                return None
            self._tick()
        return self._packets.popleft()

    def _tick(self) -> None:
        """What the line carries in a tick, both ways."""
        assert lib.SimAdvance(TICK_NS) == lib.ERR_OK
        self._credit += self.byte_rate * TICK_NS / 1e9
        count = int(self._credit)
        self._credit -= count
        data = self._to_device.apply(bytes(self._out[:count]))
        del self._out[:count]
        assert lib.SimComPut(data, len(data)) == len(data)
        buffer = ffi.new("RTS_UI8[]", _CHUNK)
        answer = bytes(ffi.buffer(buffer, lib.SimComGet(buffer, _CHUNK)))
        self.received += len(answer)
        self._in += answer
        self._packets += self._decoder.feed(self._to_client.apply(bytes(self._in[:count])))
        del self._in[:count]

    def close(self) -> None:
        pass
