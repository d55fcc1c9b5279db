"""Block transport over TCP: each packet after a header of eight bytes (codesys-v3-protocol 1.2)."""

from __future__ import annotations

import math
import select
import socket
import time
from collections import deque

from plctool.core import lib
from plctool.errors import LinkError
from plctool.link import network
from plctool.link.channel import ChannelLost
from plctool.link.transport import NO_PLACES
from plctool.link.wire import Layout

_HEADER = Layout("TCP_HEADER")
_MAGIC = lib.TCP_MAGIC & 0xFFFFFFFF
_CONNECT_PATIENCE = 5.0  # [s]
_SEND_PATIENCE = 10.0  # for room in the device [s]
_READ = 65536


class TcpTransport:
    """Packets over one connection. If it was lost, the next packet to be sent opens a new one."""

    def __init__(self, place: str) -> None:
        host, port = network.split_place(place)
        self.name = place
        self.max_packet = int(lib.BLK_MAX_SIZE)
        self.long_packet = 0
        self.packet_overhead = _HEADER.size
        self.byte_rate = math.inf
        self.is_slow = False
        self.is_bus = False
        self.point_to_point = True  # with NAT the device knows this end by another address
        self.heard_at = -math.inf
        self.peer_words = 0
        self.places = NO_PLACES
        self._place = network.find_host(host), port or int(lib.TCP_PORT)
        self._socket: socket.socket | None = None
        self._buffer = bytearray()
        self._packets: deque[bytes] = deque()
        self.local_address = network.own_address(self._connect())

    def now(self) -> float:
        return time.monotonic()

    def fileno(self) -> int | None:
        return self._socket.fileno() if self._socket else None

    def send(self, *packets: bytes) -> None:
        frames = b"".join(_HEADER.pack(magic=_MAGIC, size=_HEADER.size + len(packet)) + packet for packet in packets)
        connected = self._socket or self._connect()
        try:
            connected.sendall(frames)
        except OSError as error:
            raise self._lost(error) from error

    def receive(self, timeout: float) -> bytes | None:
        end = time.monotonic() + timeout
        while not self._packets:
            if self._socket is None:
                raise self._lost()
            if not select.select([self._socket], [], [], max(0.0, end - time.monotonic()))[0]:
                return None
            self._read(self._socket)
        return self._packets.popleft()

    def close(self) -> None:
        connected, self._socket = self._socket, None
        if connected:
            connected.close()

    def _connect(self) -> socket.socket:
        try:
            connected = socket.create_connection(self._place, _CONNECT_PATIENCE)
        except OSError as error:
            raise LinkError(f"Cannot connect to {self.name}: {network.advice(error)}", "open") from error
        connected.settimeout(_SEND_PATIENCE)
        connected.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._buffer.clear()
        self._packets.clear()
        self._socket = connected
        return connected

    def _read(self, connected: socket.socket) -> None:
        try:
            data = connected.recv(_READ)
        except OSError as error:
            raise self._lost(error) from error
        if not data:
            raise self._lost()
        self._buffer += data
        at = 0
        while (size := self._frame_size(at)) and len(self._buffer) - at >= size:
            self._packets.append(bytes(self._buffer[at + _HEADER.size : at + size]))
            at += size
        del self._buffer[:at]

    def _frame_size(self, at: int) -> int:
        """Size of the frame at `at` with its header; 0 if the header is not complete."""
        if len(self._buffer) - at < _HEADER.size:
            return 0
        header = _HEADER.unpack(memoryview(self._buffer)[at : at + _HEADER.size])
        if header.magic != _MAGIC or not _HEADER.size < header.size <= _HEADER.size + self.max_packet:
            self.close()
            raise LinkError(
                f"The reply from {self.name} is not the protocol of a controller; check the port.", "protocol"
            )
        return int(header.size)

    def _lost(self, error: OSError | None = None) -> ChannelLost:
        """Closes the connection and returns the error to raise."""
        self.close()
        reason = f" ({error.strerror or error})" if error else ""
        return ChannelLost(f"The device at {self.name} closed the connection{reason}; try again.", "link-lost")
