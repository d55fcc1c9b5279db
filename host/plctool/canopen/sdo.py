"""An SDO client: values of the object dictionary of a node, by expedited, segmented and block transfers (CiA 301).

A request is never repeated: a device may have executed it although its reply is lost.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Callable

from plctool.canopen.bus import FRAME_BYTES, SDO_REPLY, SDO_REQUEST, CanopenBus
from plctool.canopen.words import (
    ABORT_BLOCK_SIZE,
    ABORT_COMMAND,
    ABORT_CRC,
    ABORT_LENGTH,
    ABORT_MEMORY,
    ABORT_SEQUENCE,
    ABORT_TIMEOUT,
    ABORT_TOGGLE,
    abort_text,
)
from plctool.errors import DeviceError, LinkError, counted

DEFAULT_TIMEOUT = 1.0  # for a reply [s]
MAX_VALUE = 16 << 20  # bytes that a device may send
BLOCK_FROM = 64  # bytes from which block transfer is tried
_SEGMENT = 7  # bytes
_MAX_BLOCK = 127  # segments
_MAX_STUCK = 5  # blocks in a row that bring no segment further
_ABORT = 0x80


class SdoAbort(DeviceError):
    """The device has refused an access; `result` is its abort code."""

    def __init__(self, node: int, place: str, code: int) -> None:
        super().__init__(f"Node {node} refuses {place}: {abort_text(code)}.", "sdo-abort", code)


class SdoClient:
    """A client of the default SDO server of a node, on a bus for this client alone."""

    def __init__(self, bus: CanopenBus, node: int, timeout: float = DEFAULT_TIMEOUT) -> None:
        self._bus, self.node, self._timeout = bus, node, timeout
        self._place = ""
        self._multiplexer = b""
        self._in_parts = False  # replies do not name their object

    def read(self, index: int, sub: int, *, block: bool = False, expected: int = 0) -> bytes:
        """The value of an object. `expected`: its size, for devices that do not say how many of four bytes count.
        Raises SdoAbort, DeviceError for replies that are not valid, LinkError if none comes."""
        self._begin(index, sub)
        if block:
            try:
                return self._read_block()
            except SdoAbort as error:
                if error.result != ABORT_COMMAND:
                    raise
                self._begin(index, sub)
        return self._read_from(
            self._ask(bytes([0x40]) + self._multiplexer, lambda d: d[0] >> 5 == 2 and self._is_for_us(d)), expected
        )

    def _read_from(self, reply: bytes, expected: int = 0) -> bytes:
        """The value that begins with the reply to a read."""
        command = reply[0]
        if command & 2:  # expedited
            size = 4 - (command >> 2 & 3) if command & 1 else min(expected, 4) or 4
            return reply[4 : 4 + size]
        return self._read_segments(int.from_bytes(reply[4:], "little") if command & 1 else None)

    def write(self, index: int, sub: int, data: bytes, *, block: bool = True) -> None:
        """Sets an object; long values go by block transfer if the device has it, and `block`. Raises as `read`."""
        self._begin(index, sub)
        if block and len(data) >= BLOCK_FROM:
            try:
                return self._write_block(data)
            except SdoAbort as error:
                if error.result != ABORT_COMMAND:
                    raise
                self._begin(index, sub)
        accepted: Callable[[bytes], bool] = lambda d: d[0] >> 5 == 3 and self._is_for_us(d)  # noqa: E731
        if 0 < len(data) <= 4:
            self._ask(bytes([0x23 | 4 - len(data) << 2]) + self._multiplexer + data, accepted)
            return None
        self._ask(b"\x21" + self._multiplexer + len(data).to_bytes(4, "little"), accepted)
        return self._write_segments(data)

    # ---- frames ----

    def _begin(self, index: int, sub: int) -> None:
        self._place = f"{index:04X}:{sub:02X}"
        self._multiplexer = index.to_bytes(2, "little") + bytes([sub])
        self._in_parts = False
        self._bus.drain()

    def _is_for_us(self, data: bytes) -> bool:
        return data[1:4] == self._multiplexer

    def _send(self, data: bytes) -> None:
        self._bus.send(SDO_REQUEST + self.node, data.ljust(FRAME_BYTES, b"\0"))

    def _ask(self, request: bytes, accept: Callable[[bytes], bool]) -> bytes:
        self._send(request)
        return self._reply(accept)

    def _reply(self, accept: Callable[[bytes], bool]) -> bytes:
        """The next frame of the server that `accept` takes; others are late or for another client."""
        end = self._bus.now() + self._timeout
        others = False
        while (left := end - self._bus.now()) > 0:
            frame = self._bus.receive(left)
            if frame is None:
                break
            others |= frame.identifier == SDO_REQUEST + self.node
            if others and self._in_parts:
                raise DeviceError(
                    f"Another client began to use the SDO server of node {self.node} during the transfer of "
                    f"{self._place}; try again later.",
                    "sdo-busy",
                )
            if frame.identifier != SDO_REPLY + self.node or len(frame.data) != FRAME_BYTES:
                continue
            if frame.data[0] == _ABORT and self._is_for_us(frame.data):
                raise SdoAbort(self.node, self._place, int.from_bytes(frame.data[4:], "little"))
            if frame.data[0] != _ABORT and accept(frame.data):
                return frame.data
        self._abort(ABORT_TIMEOUT)
        hint = (
            "Another client uses its SDO server; try again later"
            if others
            else "Check that it is on and not stopped ('plctool canopen scan')"
        )
        raise LinkError(
            f"Node {self.node} does not reply to {self._place} within {self._timeout:g} s. {hint}.", "timeout"
        )

    def _abort(self, code: int) -> None:
        self._send(bytes([_ABORT]) + self._multiplexer + code.to_bytes(4, "little"))

    def _give_up(self, code: int, what: str) -> DeviceError:
        """Ends the transfer; the error of a server that does not keep to the protocol."""
        self._abort(code)
        return DeviceError(
            f"The transfer of {self._place} of node {self.node} was given up: {what}.", "sdo-protocol", code
        )

    # ---- segments ----

    def _read_segments(self, size: int | None) -> bytes:
        data = bytearray()
        toggle, is_last, self._in_parts = 0, False, True
        self._check_size(size or 0)
        while not is_last:
            reply = self._ask(bytes([0x60 | toggle << 4]), lambda d: d[0] >> 5 == 0)
            self._check_toggle(reply, toggle)
            data += reply[1 : FRAME_BYTES - (reply[0] >> 1 & 7)]
            is_last = bool(reply[0] & 1)
            toggle ^= 1
            self._check_size(len(data))
            if size is not None and len(data) > size:
                break
        self._check_complete(len(data), size)
        return bytes(data)

    def _write_segments(self, data: bytes) -> None:
        toggle, self._in_parts = 0, True
        for at in range(0, max(len(data), 1), _SEGMENT):
            part = data[at : at + _SEGMENT]
            is_last = at + _SEGMENT >= len(data)
            command = toggle << 4 | _SEGMENT - len(part) << 1 | is_last
            self._check_toggle(self._ask(bytes([command]) + part, lambda d: d[0] >> 5 == 1), toggle)
            toggle ^= 1

    def _check_toggle(self, reply: bytes, toggle: int) -> None:
        if reply[0] >> 4 & 1 != toggle:
            raise self._give_up(ABORT_TOGGLE, "a segment came twice or is missing")

    def _check_size(self, size: int) -> None:
        if size > MAX_VALUE:
            raise self._give_up(ABORT_MEMORY, f"the value has more than {MAX_VALUE >> 20} MiB")

    def _check_complete(self, got: int, size: int | None) -> None:
        if size is not None and got != size:
            raise self._give_up(ABORT_LENGTH, f"{size} bytes were announced, {got} came")

    # ---- blocks ----

    def _write_block(self, data: bytes) -> None:
        request = b"\xc6" + self._multiplexer + len(data).to_bytes(4, "little")
        reply = self._ask(request, lambda d: d[0] & 0xFB == 0xA0 and self._is_for_us(d))
        self._in_parts = True
        with_crc, block = bool(reply[0] & 4), self._block_size(reply[4])
        segments = [data[at : at + _SEGMENT] for at in range(0, len(data), _SEGMENT)]
        done = stuck = 0
        while done < len(segments):
            now = segments[done : done + block]
            for number, part in enumerate(now, 1):
                self._send(bytes([number | (0x80 if done + number == len(segments) else 0)]) + part)
            reply = self._reply(lambda d: d[0] == 0xA2)
            if reply[1] > len(now):
                raise self._give_up(ABORT_SEQUENCE, f"segment {reply[1]} was acknowledged, {len(now)} were sent")
            stuck = 0 if reply[1] else stuck + 1
            if stuck > _MAX_STUCK:
                raise self._give_up(ABORT_SEQUENCE, f"it took no segment of {counted(stuck, 'block')}")
            done += reply[1]
            block = self._block_size(reply[2])
        unused = _SEGMENT - len(segments[-1])
        crc = crc_hqx(data, 0) if with_crc else 0
        self._ask(bytes([0xC1 | unused << 2]) + crc.to_bytes(2, "little"), lambda d: d[0] == 0xA1)

    def _block_size(self, size: int) -> int:
        if not 1 <= size <= _MAX_BLOCK:
            raise self._give_up(ABORT_BLOCK_SIZE, f"it wants blocks of {size} segments")
        return size

    def _read_block(self) -> bytes:
        request = b"\xa4" + self._multiplexer + bytes([_MAX_BLOCK, 0])
        reply = self._ask(request, lambda d: (d[0] & 0xF9 == 0xC0 or d[0] >> 5 == 2) and self._is_for_us(d))
        if reply[0] >> 5 == 2:  # a server may reply as to a normal read
            return self._read_from(reply)
        size = int.from_bytes(reply[4:], "little") if reply[0] & 2 else None
        self._in_parts = True
        self._check_size(size or 0)
        data = self._blocks()
        end = self._reply(lambda d: d[0] & 0xE3 == 0xC1)
        del data[len(data) - (end[0] >> 2 & 7) :]
        if reply[0] & 4 and crc_hqx(bytes(data), 0) != int.from_bytes(end[1:3], "little"):
            raise self._give_up(ABORT_CRC, "the CRC of the value is wrong")
        self._check_complete(len(data), size)
        self._send(b"\xa1")
        return bytes(data)

    def _blocks(self) -> bytearray:
        """All segments, the last one with what is unused in it."""
        data = bytearray()
        self._send(b"\xa3")
        stuck, is_last = 0, False
        while not is_last:
            in_order, is_last = self._one_block(data)
            self._check_size(len(data))
            stuck = 0 if in_order else stuck + 1
            if stuck > _MAX_STUCK:
                raise self._give_up(ABORT_SEQUENCE, "segments are missing in each block")
            self._send(bytes([0xA2, in_order, _MAX_BLOCK]))
        return data

    def _one_block(self, data: bytearray) -> tuple[int, bool]:
        """Adds the segments of a block that come in order: how many, and if the last one of the value is among them."""
        in_order = 0
        while True:
            reply = self._reply(lambda d: d[0] & 0x7F != 0)
            number, is_last = reply[0] & 0x7F, bool(reply[0] & 0x80)
            if number == in_order + 1:
                data += reply[1:]
                in_order += 1
                if is_last:
                    return in_order, True
            if is_last or number == _MAX_BLOCK:
                return in_order, False
