"""Block transport within Modbus: function 43, MEI type 128, beside what others ask the devices of the line for.

A Modbus device speaks only when it is asked. So bytes go to the device in requests and come from it in replies
(`MODBUS_TUNNEL_REQUEST`, `MODBUS_TUNNEL_REPLY`); they are the frames of a serial line. A request whose reply does not
come is sent again as it was, and the device knows it by its sequence number: collisions with another master cost time
only.
"""

from __future__ import annotations

import math
import random
import socket
import time
from collections import deque
from contextlib import suppress
from typing import Protocol

from plctool.core import lib
from plctool.errors import LinkError
from plctool.link import network, simplecom
from plctool.link.channel import ChannelLost
from plctool.link.serial import is_real_line, lost_port, open_port
from plctool.link.transport import NO_PLACES, TOOL_ADDRESS
from plctool.link.wire import Layout

_REQUEST = Layout("MODBUS_TUNNEL_REQUEST")
_REPLY = Layout("MODBUS_TUNNEL_REPLY")
_TAKES = lib.MODBUS_MAX_PDU - _REQUEST.size  # most bytes in a request
_LAST_SEQUENCE = 255
_EXCEPTION = lib.MODBUS_ENCAPSULATED | lib.MODBUS_EXCEPTION
_EXCEPTION_SIZE = 2
_CRC_SIZE = 2
_FRAME_MAX = 1 + lib.MODBUS_MAX_PDU + _CRC_SIZE

_BITS_PER_BYTE = 11  # with parity, or a second stop bit
_LONGEST_SILENCE = 0.00175  # between frames, from 19200 baud on [s]
_ESCAPE_SHARE = 256  # one byte in so many is escaped, on average
_TURNAROUND = 0.006  # of a request and its reply, besides their bytes [s]
_REPLY_PATIENCE = 0.3  # besides the time of the bytes [s]
_GATEWAY_PATIENCE = 2.0  # most gateways wait for a second
_CONNECT_PATIENCE = 5.0
_BABBLE_PATIENCE = 2.0  # for a pause on a line that is never quiet [s]
_OTHERS_PAUSE = 0.03  # after bytes of others: theirs may have been a request [s]
_OTHERS_PATIENCE = 0.15  # for such a pause [s]
_OTHERS_STAY = 10.0  # so long after bytes of others they get a share of the time [s]
_MOST_PAUSE = 0.1  # which is half of it, but no longer than this [s]
_EXPECTS = 0.3  # so long after something has moved more is asked for at once, [s]
_IDLE_PAUSE = 0.1  # and then at this interval [s]
_TRIES = 3  # in a row, before who sends has a look at the time
_MOST_QUEUED = 16384  # bytes for a device that takes none
_BUSY = (
    lib.MODBUS_DEVICE_FAILURE, lib.MODBUS_ACKNOWLEDGE, lib.MODBUS_DEVICE_BUSY, lib.MODBUS_NO_PATH, lib.MODBUS_NO_TARGET,
)  # fmt: skip


def _crc_table() -> list[int]:
    table = []
    for crc in range(256):
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
        table.append(crc)
    return table


_CRC_TABLE = _crc_table()


def modbus_crc(data: bytes) -> bytes:
    """CRC-16 of Modbus as it follows a frame; b"\\x37\\x4b" for b"123456789"."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC_TABLE[(crc ^ byte) & 0xFF]
    return crc.to_bytes(_CRC_SIZE, "little")


def is_reply(request: bytes, pdu: bytes) -> bool:
    """Whether a PDU is the reply to this request, or an exception."""
    if len(pdu) == _EXCEPTION_SIZE and pdu[0] == _EXCEPTION:
        return True
    return pdu[: _REQUEST.size] == request[: _REQUEST.size] and len(pdu) == _reply_size(pdu)


def _reply_size(pdu: bytes) -> int:
    """What a reply's own head says; 0 if the head is not complete."""
    return _REPLY.size + int(_REPLY.unpack(pdu).size) if len(pdu) >= _REPLY.size else 0


def find_reply(data: bytes, unit: int, request: bytes) -> bytes | None:
    """The PDU that replies to `request` in what was heard on a line, which has frames of others and may have an echo of
    the request: silence between them cannot be measured here, so a frame is what its CRC says."""
    for at in range(len(data)):
        pdu = data[at + 1 :]
        if data[at] != unit:
            continue
        size = _EXCEPTION_SIZE if pdu[:1] == bytes([_EXCEPTION]) else _reply_size(pdu)
        if (
            size
            and is_reply(request, pdu[:size])
            and pdu[size : size + _CRC_SIZE] == modbus_crc(data[at : at + 1 + size])
        ):
            return pdu[:size]
    return None


class ModbusBus(Protocol):
    """A Modbus line, and one device there."""

    name: str  # for messages
    byte_rate: float  # of the data of requests; math.inf if unknown

    def ask(self, request: bytes) -> bytes | None:
        """Sends a PDU and returns the PDU of the reply, None when none came in time. Raises LinkError."""

    def fileno(self) -> int | None: ...
    def close(self) -> None: ...


def _byte_rate(baud: int) -> float:
    """Of data in full requests, with the replies between them [bytes/s]."""
    bytes_on_line = 1 + lib.MODBUS_MAX_PDU + _CRC_SIZE + 1 + _REPLY.size + _CRC_SIZE
    seconds = bytes_on_line * _BITS_PER_BYTE / baud + _TURNAROUND
    return float(_TAKES / seconds / (1 + 1 / _ESCAPE_SHARE))


class RtuBus:
    """A serial line, on which others may be masters too. It says nothing while others do, and leaves them time."""

    def __init__(self, url: str, unit: int, baud: int, parity: str) -> None:
        self.name = f"{url}, unit {unit}"
        real = is_real_line(url)
        self.byte_rate = _byte_rate(baud) if real else math.inf
        self._url, self._unit = url, unit
        self._byte_time = _BITS_PER_BYTE / baud
        self._silence = min(3.5 * self._byte_time, _LONGEST_SILENCE) if baud > 19200 else 3.5 * self._byte_time
        self._heard_at = self._others_at = -math.inf  # when bytes came, and those of others
        self._ended_at = -math.inf  # the last request,
        self._pause = 0.0  # and what others have after it
        self._port = open_port(url, baud, parity[0].upper() if real else "N")  # others have none

    def ask(self, request: bytes) -> bytes | None:
        frame = bytes([self._unit]) + request
        frame += modbus_crc(frame)
        try:
            self._wait_for_turn()
            began = time.monotonic()
            self._port.write(frame)
            reply = self._listen(request, (len(frame) + _FRAME_MAX) * self._byte_time + _REPLY_PATIENCE)
        except OSError as error:
            raise lost_port(self._url, error) from error
        self._ended_at = time.monotonic()
        self._pause = min(self._ended_at - began, _MOST_PAUSE)
        if reply is None:  # two masters that wait for the same time would meet again
            self._pause = random.uniform(0, _OTHERS_PAUSE)
        return reply

    def _listen(self, request: bytes, patience: float) -> bytes | None:
        end = time.monotonic() + patience
        data = b""
        while time.monotonic() < end:
            data += self._read()
            if (reply := find_reply(data, self._unit, request)) is not None:
                return reply
        if data:
            self._others_at = self._heard_at
        return None

    def _read(self) -> bytes:
        """What has come; waits for a moment if that is nothing."""
        data = bytes(self._port.read(self._port.in_waiting or 1))
        if data:
            self._heard_at = time.monotonic()
        return data

    def _wait_for_turn(self) -> None:
        began = now = time.monotonic()
        while now < began + _BABBLE_PATIENCE:
            if self._port.in_waiting:
                self._read()
                self._others_at = self._heard_at
            elif (left := self._free_at(now, now - began) - now) > 0:
                time.sleep(min(left, self._silence))
            else:
                return
            now = time.monotonic()

    def _free_at(self, now: float, waited: float) -> float:
        """When something may be sent if nothing is heard until then. A master that makes no pause gets none."""
        free_at = self._heard_at + self._silence
        if waited < _OTHERS_PATIENCE:
            free_at = max(free_at, self._others_at + _OTHERS_PAUSE)
        if now - self._others_at < _OTHERS_STAY:
            free_at = max(free_at, self._ended_at + self._pause)
        return free_at

    def fileno(self) -> int | None:
        with suppress(AttributeError, OSError):
            return int(self._port.fileno())
        return None

    def close(self) -> None:
        self._port.close()


_MBAP_SIZE = 7  # transaction, protocol, length, unit


class GatewayBus:
    """The same through a Modbus TCP gateway, which takes care of the line. If the connection was lost, the next request
    opens a new one."""

    def __init__(self, place: str, unit: int, baud: int) -> None:
        self.name = f"{place}, unit {unit}"
        self.byte_rate = _byte_rate(baud)
        host, port = network.split_place(place)
        self._unit = unit
        self._patience = _GATEWAY_PATIENCE + 2 * _FRAME_MAX * _BITS_PER_BYTE / baud
        self._place = network.find_host(host), port or int(lib.MODBUS_PORT)
        self._transaction = 0
        self._buffer = bytearray()
        self._socket: socket.socket | None = None
        self._connect()

    def ask(self, request: bytes) -> bytes | None:
        connected = self._socket or self._connect()
        self._transaction = (self._transaction + 1) % 0x10000
        numbers = (self._transaction, 0, 1 + len(request))
        head = b"".join(number.to_bytes(2, "big") for number in numbers) + bytes([self._unit])
        end = time.monotonic() + self._patience
        try:
            connected.sendall(head + request)
            while (left := end - time.monotonic()) > 0:
                connected.settimeout(left)
                for pdu in self._receive(connected):
                    if is_reply(request, pdu):
                        return pdu
        except TimeoutError:
            return None
        except OSError as error:
            raise self._lost(error) from error
        return None

    def _receive(self, connected: socket.socket) -> list[bytes]:
        """The PDUs of this device that are complete now."""
        data = connected.recv(4096)
        if not data:
            raise self._lost()
        self._buffer += data
        pdus = []
        while len(self._buffer) >= _MBAP_SIZE:
            length = int.from_bytes(self._buffer[4:6], "big")
            if self._buffer[2:4] != b"\0\0" or not 1 < length <= 1 + lib.MODBUS_MAX_PDU:
                self.close()
                raise LinkError(f"The reply from {self.name} is not Modbus TCP; check the port.", "protocol")
            end = _MBAP_SIZE - 1 + length
            if len(self._buffer) < end:
                break
            if self._buffer[_MBAP_SIZE - 1] == self._unit:
                pdus.append(bytes(self._buffer[_MBAP_SIZE:end]))
            del self._buffer[:end]
        return pdus

    def _connect(self) -> socket.socket:
        try:
            connected = socket.create_connection(self._place, _CONNECT_PATIENCE)
        except OSError as error:
            raise LinkError(f"Cannot connect to {self.name}: {network.advice(error)}", "open") from error
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffer.clear()
        self._socket = connected
        return connected

    def fileno(self) -> int | None:
        return self._socket.fileno() if self._socket else None

    def close(self) -> None:
        connected, self._socket = self._socket, None
        if connected:
            connected.close()

    def _lost(self, error: OSError | None = None) -> ChannelLost:
        self.close()
        reason = f" ({error.strerror or error})" if error else ""
        return ChannelLost(f"The gateway at {self.name} closed the connection{reason}; try again.", "link-lost")


class ModbusTransport:
    """Packets in the frames of a serial line, the bytes of which are in requests to one device and in its replies."""

    def __init__(self, bus: ModbusBus) -> None:
        self.name = bus.name
        self.local_address = TOOL_ADDRESS
        self.max_packet = simplecom.MAX_PACKET
        self.long_packet = simplecom.LONG_PACKET
        self.packet_overhead = simplecom.FRAME_OVERHEAD
        self.byte_rate = bus.byte_rate
        self.is_slow = bus.byte_rate < math.inf
        self.is_bus = False  # each request has its reply
        self.point_to_point = False
        self.heard_at = -math.inf
        self.peer_words = 1
        self.places = NO_PLACES
        self._bus = bus
        self._decoder = simplecom.Decoder()
        self._packets: deque[bytes] = deque()
        self._out = bytearray()  # not in a request yet
        self._sequence: int | None = None  # of the last reply; None: the device has to begin again
        self._request = b""  # without reply yet
        self._moved_at = -math.inf  # when bytes went or came

    def now(self) -> float:
        return time.monotonic()

    def fileno(self) -> int | None:
        return self._bus.fileno()

    def send(self, *packets: bytes) -> None:
        if len(self._out) > _MOST_QUEUED:
            self._out.clear()
        self._out += b"".join(map(simplecom.encode, packets))
        tries = 0
        while (self._out or self._request) and tries < _TRIES:
            tries = 0 if self._ask() else tries + 1

    def receive(self, timeout: float) -> bytes | None:
        end = self.now() + timeout
        while not self._packets:
            left = end - self.now()
            if left <= 0:
                return None
            self._wait_idle(left)
            self._ask()
        return self._packets.popleft()

    def close(self) -> None:
        self._bus.close()

    def _wait_idle(self, most: float) -> None:
        """A device that has nothing to say is not asked all the time."""
        if not self._out and self.now() - self._moved_at > _EXPECTS:
            time.sleep(min(most, _IDLE_PAUSE))

    def _ask(self) -> bool:
        """One request; False if it has got no reply and is to be repeated."""
        if not self._request:
            self._request = self._next_request()
        reply = self._bus.ask(self._request)
        if reply is None:
            return False
        if len(reply) == _EXCEPTION_SIZE:
            return self._refused(reply[1])
        self._take(reply)
        return True

    def _next_request(self) -> bytes:
        if self._sequence is None:
            sequence, data = lib.MODBUS_TUNNEL_BEGIN, b""
        else:
            sequence = self._sequence % _LAST_SEQUENCE + 1
            data = bytes(self._out[:_TAKES])
            del self._out[: len(data)]
        head = _REQUEST.pack(function=lib.MODBUS_ENCAPSULATED, mei=lib.MODBUS_TUNNEL_MEI, sequence=sequence)
        return head + data

    def _take(self, reply: bytes) -> None:
        head, data = _REPLY.unpack(reply), reply[_REPLY.size :]
        left = self._request[_REQUEST.size + head.taken :]
        if data or head.taken:
            self._moved_at = self.heard_at = self.now()
        self._sequence, self._request = head.sequence, b""
        self._out[:0] = left
        self._packets.extend(self._decoder.feed(data))

    def _refused(self, code: int) -> bool:
        """After an exception: whether to ask at once. Raises LinkError for one that stays."""
        if code in _BUSY:
            time.sleep(_IDLE_PAUSE)
            return False
        began = self._sequence is not None
        self._sequence, self._request = None, b""
        self._out.clear()
        self._decoder = simplecom.Decoder()
        if began and code == lib.MODBUS_ILLEGAL_VALUE:
            raise ChannelLost(
                f"The device on {self.name} has forgotten this connection: it was started again, or another tool has "
                f"begun; try again.",
                "link-lost",
            )
        raise LinkError(
            f"The device on {self.name} answers, but takes no tools within Modbus (exception {code}); start plcrt with "
            f"--tunnel and this line, or use another link.",
            "no-tunnel",
        )
