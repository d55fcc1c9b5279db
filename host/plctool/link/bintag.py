"""BinTag: the nested id-length-content format of all services (codesys-v3-protocol 4.2).

An element is an id, a length and a content; ids with bit 7 set are containers of further elements. `encode` lays the
content of every element at a multiple of 4 by padding the length field; `decode` relies on no alignment and checks
every length against what is there.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from plctool.errors import LinkError

_CONTAINER_BIT = 0x80
_MAX_NESTING = 10
_MAX_VARINT_BYTES = 8
_ALIGN = 4


@dataclass(frozen=True)
class Tag:
    """One element to be written. `shift` 2 puts its content at 4k+2 (a u16, or a structure that starts with one)."""

    id: int
    content: bytes | tuple[Tag, ...]
    shift: int = 0


def data(tag_id: int, content: bytes) -> Tag:
    """An element of plain bytes, padded so that the next element is aligned again."""
    return Tag(tag_id, content + bytes(-len(content) % _ALIGN))


def raw(tag_id: int, content: bytes) -> Tag:
    """An element of exactly these bytes."""
    return Tag(tag_id, content)


def u16(tag_id: int, value: int) -> Tag:
    return Tag(tag_id, struct.pack("<H", value), shift=2)


def u32(tag_id: int, *values: int) -> Tag:
    return Tag(tag_id, struct.pack(f"<{len(values)}I", *values))


def text(tag_id: int, value: str) -> Tag:
    """A NUL-terminated UTF-8 string, padded with zeros."""
    return data(tag_id, value.encode() + b"\0")


def container(tag_id: int, *children: Tag) -> Tag:
    return Tag(tag_id, children)


def encode(tags: Iterable[Tag], aligned: bool = True) -> bytes:
    """The bytes of a list of elements, to be placed at a multiple of 4; as short as possible when not `aligned`."""
    out = bytearray()
    for tag in tags:
        content = tag.content if isinstance(tag.content, bytes) else encode(tag.content, aligned)
        head = _varint(tag.id)
        length = _varint(len(content))
        fill = (tag.shift - len(out) - len(head) - len(length)) % _ALIGN if aligned else 0
        out += head + _widen(length, fill) + content
    return bytes(out)


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)


def _widen(varint: bytes, fill: int) -> bytes:
    """The same number in `fill` more bytes."""
    if fill == 0:
        return varint
    return varint[:-1] + bytes([varint[-1] | 0x80]) + b"\x80" * (fill - 1) + b"\0"


def malformed(what: str) -> LinkError:
    """The error for a malformed reply."""
    return LinkError(f"The device sent a malformed reply ({what}); update plctool or the device.", "protocol")


class Tags:
    """The elements of a received message or container. Accessors check presence and size; excess bytes are padding."""

    def __init__(self, elements: list[tuple[int, bytes | Tags]]) -> None:
        self._elements = elements

    def __iter__(self) -> Iterator[tuple[int, bytes | Tags]]:
        return iter(self._elements)

    def find(self, tag_id: int) -> bytes | None:
        """Content of the first data element with this id, None when there is none."""
        return next((c for i, c in self._elements if i == tag_id and isinstance(c, bytes)), None)

    def bytes(self, tag_id: int, size: int = 0) -> bytes:
        """Content of a required element of at least `size` bytes."""
        content = self.find(tag_id)
        if content is None or len(content) < size:
            raise malformed(f"tag 0x{tag_id:X} is missing or too short")
        return content

    def u16(self, tag_id: int) -> int:
        return int.from_bytes(self.bytes(tag_id, 2)[:2], "little")

    def u32(self, tag_id: int) -> int:
        return int.from_bytes(self.bytes(tag_id, 4)[:4], "little")

    def text(self, tag_id: int, default: str = "") -> str:
        """A NUL-terminated string; undecodable bytes are replaced, a missing element gives `default`."""
        content = self.find(tag_id)
        return default if content is None else content.split(b"\0", 1)[0].decode(errors="replace")

    def containers(self, tag_id: int) -> list[Tags]:
        return [c for i, c in self._elements if i == tag_id and isinstance(c, Tags)]

    def container(self, tag_id: int) -> Tags:
        """The first container with this id; it is required."""
        found = self.containers(tag_id)
        if not found:
            raise malformed(f"container 0x{tag_id:X} is missing")
        return found[0]


def decode(message: bytes, nesting: int = _MAX_NESTING) -> Tags:
    """All elements of `message`; raises LinkError when a length does not fit or the nesting is too deep."""
    if nesting == 0:
        raise malformed("nested too deep")
    elements: list[tuple[int, bytes | Tags]] = []
    at = 0
    while at < len(message):
        tag_id, at = _read_varint(message, at)
        length, at = _read_varint(message, at)
        if length > len(message) - at:
            raise malformed(f"tag 0x{tag_id:X} is longer than the message")
        content = message[at : at + length]
        elements.append((tag_id, decode(content, nesting - 1) if tag_id & _CONTAINER_BIT else content))
        at += length
    return Tags(elements)


def _read_varint(message: bytes, at: int) -> tuple[int, int]:
    """The number at `at` and the position after it."""
    value = 0
    for i in range(_MAX_VARINT_BYTES):
        if at + i >= len(message):
            break
        byte = message[at + i]
        value |= (byte & 0x7F) << (7 * i)
        if byte < 0x80:
            return value, at + i + 1
    raise malformed("a tag header is cut or too long")
