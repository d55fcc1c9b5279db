"""Serial framing: router packets as `#<` escaped(packet, CRC-16) `#>` (codesys-v3-protocol 1.3).

Inside a frame every `#` is sent as `#_`, so `#<` and `#>` appear nowhere else and a receiver is in step again
after any damage. The CRC is sent low byte first.
"""

from __future__ import annotations

import binascii

from plctool.core import lib

CRC_INITIAL = 0x1D0F  # the direct form of 0xFFFF with sixteen zero bits appended
CRC_SIZE = 2

_ESCAPE = bytes([lib.SIMPLECOM_ESCAPE])
_START = bytes([lib.SIMPLECOM_START_1, lib.SIMPLECOM_START_2])
_END = bytes([lib.SIMPLECOM_ESCAPE, lib.SIMPLECOM_END_2])
_STUFFED = bytes([lib.SIMPLECOM_ESCAPE, lib.SIMPLECOM_STUFF])

FRAME_OVERHEAD = len(_START) + CRC_SIZE + len(_END)  # bytes a frame adds, besides escapes
MAX_PACKET = int(lib.BLK_MAX_SIZE)
LONG_PACKET = 4096  # the longest that is sent to a device that says it takes it: longer ones gain nothing


def crc16(data: bytes) -> int:
    """CRC-16, polynomial 0x1021, no reflection; 0xE5CC for b"123456789"."""
    return binascii.crc_hqx(data, CRC_INITIAL)


def encode(packet: bytes) -> bytes:
    """The frame that carries `packet`."""
    body = packet + crc16(packet).to_bytes(CRC_SIZE, "little")
    return _START + body.replace(_ESCAPE, _STUFFED) + _END


class Decoder:
    """Finds frames with packets of up to `longest` bytes in a byte stream that comes in pieces and may be damaged.
    `dropped` counts damaged frames."""

    def __init__(self, longest: int = MAX_PACKET) -> None:
        self._longest = longest
        self._buffer = bytearray()
        self.dropped = 0

    def feed(self, data: bytes) -> list[bytes]:
        """Takes received bytes and returns the packets completed by them."""
        self._buffer += data
        packets = []
        while (body := self._next_body()) is not None:
            packet = _unpack(body, self._longest)
            if packet is None:
                self.dropped += 1
            else:
                packets.append(packet)
        return packets

    def _next_body(self) -> bytes | None:
        """Cuts the next complete frame out of the buffer and returns what is between its markers."""
        end = self._buffer.find(_END)
        if end < 0:
            self._discard_hopeless()
            return None
        start = self._buffer.rfind(_START, 0, end)
        body = bytes(self._buffer[start + len(_START) : end]) if start >= 0 else b""
        del self._buffer[: end + len(_END)]
        return body

    def _discard_hopeless(self) -> None:
        """Keeps only what may still become a frame: from the last start on, and never more than one frame's length."""
        start = self._buffer.rfind(_START)
        if start > 0:
            del self._buffer[:start]
            self.dropped += 1
        elif start < 0 and len(self._buffer) > 1:
            del self._buffer[:-1]
        if len(self._buffer) > 2 * (self._longest + CRC_SIZE) + len(_START) + len(_END):
            self._buffer.clear()
            self.dropped += 1


def _unpack(body: bytes, longest: int) -> bytes | None:
    """The packet in a frame's body, None when it is damaged."""
    if body.count(_ESCAPE) != body.count(_STUFFED):
        return None
    data = body.replace(_STUFFED, _ESCAPE)
    packet, crc = data[:-CRC_SIZE], data[-CRC_SIZE:]
    if not packet or len(packet) > longest or crc16(packet) != int.from_bytes(crc, "little"):
        return None
    return packet
