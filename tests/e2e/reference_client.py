"""A client of the protocol that shares no code with plctool: written from what is public about it, in the ways in which
published clients differ (`Dialect`). It uses nothing but the standard library."""

from __future__ import annotations

import os
import select
import socket
import struct
import termios
import time
import tty
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

PATIENCE = 60.0  # s
TCP_MAGIC = bytes.fromhex("000117E8")


@dataclass(frozen=True)
class Dialect:
    """`header`: length field of layer 7. `acks`: each block is acknowledged, otherwise none. `padded`: elements begin
    at multiples of 4. `receiver`, `sender`: addresses of layer 3. `words`: of an open request, None for one of
    version 1.0."""

    header: int = 16
    acks: bool = True
    padded: bool = True
    receiver: bytes = b""
    sender: bytes = bytes(6) + bytes.fromhex("830F")
    words: int | None = 8


THOROUGH = Dialect()
SHORT = Dialect(header=12, acks=False, padded=False, receiver=bytes(6), sender=b"\x12\x34", words=None)


class Link:
    """Carries router packets."""

    def send(self, packet: bytes) -> None:
        raise NotImplementedError

    def receive(self) -> bytes:
        """The next packet. Raises TimeoutError."""
        raise NotImplementedError

    def close(self) -> None:
        raise NotImplementedError


class Tcp(Link):
    def __init__(self, place: str) -> None:
        host, _, port = place.rpartition(":")
        self._socket = socket.create_connection((host, int(port)), PATIENCE)

    def send(self, packet: bytes) -> None:
        self._socket.sendall(TCP_MAGIC + struct.pack("<I", len(packet) + 8) + packet)

    def receive(self) -> bytes:
        head = self._exactly(8)
        assert head[:4] == TCP_MAGIC
        (size,) = struct.unpack("<I", head[4:])
        assert 16 <= size <= 520
        return self._exactly(size - 8)

    def _exactly(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            part = self._socket.recv(size - len(data))
            if not part:
                raise ConnectionError("closed")
            data += part
        return data

    def close(self) -> None:
        self._socket.close()


class Udp(Link):
    def __init__(self, place: str) -> None:
        host, _, port = place.rpartition(":")
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(PATIENCE)
        self._socket.connect((host, int(port)))

    def send(self, packet: bytes) -> None:
        self._socket.send(packet)

    def receive(self) -> bytes:
        return self._socket.recv(600)

    def close(self) -> None:
        self._socket.close()


class Serial(Link):
    """`#<` packet CRC `#>`, in which `#` is `#_`."""

    def __init__(self, place: str) -> None:
        self._file = os.open(place, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self._file, termios.TCSANOW)
        self._bytes = b""

    def send(self, packet: bytes) -> None:
        data = packet + struct.pack("<H", crc16(packet))
        os.write(self._file, b"#<" + data.replace(b"#", b"#_") + b"#>")

    def receive(self) -> bytes:
        deadline = time.monotonic() + PATIENCE
        while b"#>" not in self._bytes:
            if not select.select([self._file], [], [], max(0, deadline - time.monotonic()))[0]:
                raise TimeoutError
            self._bytes += os.read(self._file, 4096)
        frame, _, self._bytes = self._bytes.partition(b"#>")
        data = frame.rpartition(b"#<")[2].replace(b"#_", b"#")
        assert struct.unpack("<H", data[-2:])[0] == crc16(data[:-2])
        return data[:-2]

    def close(self) -> None:
        os.close(self._file)


def crc16(data: bytes) -> int:
    """Polynomial 0x1021, start 0xFFFF, sixteen zero bits appended."""
    crc = 0xFFFF
    for byte in data + b"\0\0":
        for bit in range(7, -1, -1):
            top = crc >> 15
            crc = ((crc << 1) | (byte >> bit & 1)) & 0xFFFF
            crc ^= 0x1021 if top else 0
    return crc


def packet(dialect: Dialect, service: int, payload: bytes, broadcast: bool = False) -> bytes:
    receiver = b"" if broadcast else dialect.receiver
    sizes = len(dialect.sender) // 2 << 4 | len(receiver) // 2
    head = bytes([0xC5, 0x6B, 0x40, service, 0, sizes]) + receiver + dialect.sender
    return head + bytes(-len(head) % 4) + payload


def payload_of(data: bytes) -> tuple[int, bytes]:
    """Service and payload."""
    assert data[0] == 0xC5
    size = 2 * (data[1] & 7) + 2 * (data[5] & 15) + 2 * (data[5] >> 4)
    return data[3], data[size + -size % 4 :]


def varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out, value = out + bytes([value & 127 | 128]), value >> 7
    return out + bytes([value])


def element(dialect: Dialect, tag: int, content: bytes) -> bytes:
    """At a multiple of 4, and as long as one, if that is the dialect's way."""
    if not dialect.padded:
        return varint(tag) + varint(len(content)) + content
    content += bytes(-len(content) % 4)
    head, size = varint(tag), varint(len(content))
    fill = -(len(head) + len(size)) % 4
    if fill:
        size = size[:-1] + bytes([size[-1] | 128]) + b"\x80" * (fill - 1) + b"\0"
    return head + size + content


def elements(data: bytes) -> Iterator[tuple[int, bytes]]:
    at = 0

    def number() -> int:
        nonlocal at
        value = shift = 0
        while True:
            byte = data[at]
            at += 1
            value |= (byte & 127) << shift
            shift += 7
            if byte < 128:
                return value

    while at < len(data):
        tag, size = number(), number()
        assert size > 0, "an element without content"
        assert at + size <= len(data)
        yield tag, data[at : at + size]
        at += size


def find(data: bytes, *path: int) -> bytes:
    """The content of an element in containers."""
    for tag in path:
        data = dict(reversed(list(elements(data))))[tag]
    return data


def u32(data: bytes) -> int:
    return int(struct.unpack("<I", data[:4])[0])


def u16(data: bytes) -> int:
    return int(struct.unpack("<H", data[:2])[0])


def meta(kind: int, body: bytes) -> bytes:
    head, zero = struct.pack("<BBH", kind, 0, 0x0101), bytes(4)
    return head + struct.pack("<I", zlib.crc32(head + zero + body)) + body


class Client:
    def __init__(self, link: Link, dialect: Dialect) -> None:
        self.link, self.dialect = link, dialect
        self.session = 0
        self.buffer = 0
        self.fragments = 0  # blocks of the last reply
        self._channel = self._sent = self._received = 0

    # ---- layers 3 and 4 ----

    def _send(self, service: int, payload: bytes, broadcast: bool = False) -> None:
        self.link.send(packet(self.dialect, service, payload, broadcast))

    def _take(self, service: int, kinds: tuple[int, ...] = ()) -> bytes:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            got, payload = payload_of(self.link.receive())
            if got == service and (not kinds or payload[0] in kinds):
                return payload
        raise TimeoutError

    def scan(self, version: int = 0x0400) -> bytes:
        """The reply of the name service."""
        self._send(3, struct.pack("<HHI", 0xC202, version, 0x20046969), broadcast=True)
        return self._take(4)

    def open(self, wanted: int = 0x001F4000) -> bytes:
        body = struct.pack("<II", 0x8321D481, wanted)
        if self.dialect.words is not None:
            body += struct.pack("<BBH", self.dialect.words, 0, 0)
        self._send(0x40, meta(0xC3, body))
        reply = self._take(0x40, (0x83,))
        crc = zlib.crc32(reply[:4] + bytes(4) + reply[8:])
        assert u32(reply[4:]) == crc and u32(reply[8:]) == 0x8321D481
        assert u16(reply[12:]) == 0, "no channel"
        self._channel, self.buffer = u16(reply[14:]), u32(reply[16:])
        self._sent = self._received = 0
        return reply

    def close(self) -> None:
        self._send(0x40, meta(0xC4, struct.pack("<HH", self._channel, 0)))
        self.link.close()

    def _send_message(self, message: bytes) -> None:
        rest = struct.pack("<II", len(message), zlib.crc32(message)) + message
        flags = 0x81
        while rest:
            self._sent += 1
            head = struct.pack("<BBHII", 1, flags, self._channel, self._sent, self._received)
            self._send(0x40, head + rest[:460])
            rest, flags = rest[460:], 0x80

    def _take_message(self) -> bytes:
        data, size, crc = b"", -1, 0
        self.fragments = 0
        while len(data) != size:
            block = self._take(0x40, (1, 0x84))
            assert block[0] == 1, f"closed: 0x{u16(block[10:]):X}"
            number = u32(block[4:])
            if number != self._received + 1:
                continue
            self._received, self.fragments = number, self.fragments + 1
            body = block[12:]
            if block[1] & 1:
                size, crc, body, data = u32(body), u32(body[4:]), body[8:], b""
            data += body
            if self.dialect.acks:
                self._send(0x40, struct.pack("<BBHI", 2, 0x80, self._channel, number))
        assert zlib.crc32(data) == crc
        return data

    # ---- layer 7 ----

    def tag(self, tag: int, content: bytes) -> bytes:
        return element(self.dialect, tag, content)

    def call(self, group: int, service: int, content: bytes = b"", session: int | None = None) -> bytes:
        """The content of the reply."""
        number = self.session if session is None else session
        head = struct.pack("<HHHHII", 0xCD55, self.dialect.header, group, service, number, len(content))
        self._send_message(head + bytes(self.dialect.header - 12) + content)
        reply = self._take_message()
        protocol, length, got_group, got_service, _, size = struct.unpack("<HHHHII", reply[:16])
        assert (protocol, got_group, got_service) == (0xCD55, group | 0x80, service)
        assert length == self.dialect.header and 4 + length + size == len(reply)
        return reply[4 + length :]

    def login(self) -> None:
        """Anonymous."""
        content = self.tag(0x22, b"\x01\0") + self.tag(0x81, self.tag(0x10, b"\0\0"))
        reply = self.call(1, 2, content, session=0x11)
        assert u16(find(reply, 0x82, 0x20)) == 0
        self.session = u32(find(reply, 0x82, 0x21))

    def login_app(self) -> tuple[int, bytes]:
        """Session and data GUID of the application."""
        reply = find(self.call(2, 1, self.tag(1, b"Application")), 0x81, 0x10)
        assert u16(reply) == 0
        return u32(reply[2:]), reply[22:38]

    def read(self, app: tuple[int, bytes], places: list[tuple[int, int, int]]) -> list[bytes]:
        """Values at (area, offset, size)."""
        listed = b""
        for number, (area, offset, size) in enumerate(places):
            code = struct.pack("<BHBB", 2, offset, 6, area)
            listed += self.tag(
                0x82,
                self.tag(1, struct.pack("<I", number)) + self.tag(2, struct.pack("<I", size))
                + self.tag(3, struct.pack("<I", 8)) + self.tag(4, struct.pack("<I", len(code))) + self.tag(5, code),
            )  # fmt: skip
        head = self.tag(1, struct.pack("<I", app[0]) + app[1])
        data = find(self.call(0x1B, 1, head + self.tag(0x81, listed)), 0x40)
        values = []
        for number, _ in enumerate(places):
            assert u16(data) == number
            size = u32(data[2:])
            values.append(data[6 : 6 + size])
            data = data[6 + size :]
        return values

    def write(self, app: tuple[int, bytes], area: int, offset: int, value: bytes) -> None:
        """By the program that copies."""
        address = struct.pack("<BHBB", 2, offset, 6, area)
        code = bytes.fromhex("150C00") + address + bytes.fromhex("170C09041B0600010000170409041708090404")
        entry = struct.pack("<HI", 0, len(value)) + value + struct.pack("<H", len(code)) + code
        head = self.tag(1, struct.pack("<I", app[0]) + app[1])
        assert self.call(0x1B, 2, head + self.tag(3, entry)) == b""

    def get_file(self, name: str) -> bytes:
        """As published clients do: offset 0 each time, until nothing comes."""
        started = self.call(8, 5, self.tag(1, name.encode() + b"\0") + self.tag(2, bytes(8)))
        assert u16(find(started, 0x84, 8)) == 0
        handle = u32(find(started, 0x84, 3))
        crc, size = struct.unpack("<II", find(started, 0x84, 2)[:8])
        data = b""
        while True:
            reply = self.call(8, 7, self.tag(5, struct.pack("<II", handle, 0)))
            count = u32(find(reply, 6))
            if count == 0:
                break
            data += find(reply, 5)[:count]
        assert (len(data), zlib.crc32(data)) == (size, crc)
        self.call(8, 8, self.tag(7, struct.pack("<II", handle, 0) + name.encode() + b"\0") + self.tag(2, bytes(12)))
        return data

    def list_files(self) -> list[str]:
        listed = find(self.call(8, 0xC, self.tag(0xB, b"/\0")), 0x8D)
        return [find(entry, 0xE).rstrip(b"\0").decode() for tag, entry in elements(listed) if tag == 0x90]

    def shell(self, command: str) -> str:
        text, block = b"", 0
        while True:
            words = self.tag(0x11, struct.pack("<I", self.session)) + self.tag(0x13, struct.pack("<I", block))
            reply = self.call(0x11, 1, words + self.tag(0x10, command.encode() + b"\0"))
            ((tag, part),) = elements(reply)
            text += find(part, 0x20).rstrip(b"\0")
            if tag == 0x82:
                return text.decode()
            block += 1


def serial_path(place: str) -> str:
    return str(Path(place).resolve())
