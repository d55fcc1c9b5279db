"""Name service (codesys-v3-protocol 2.6): who is on the network."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from plctool.core import lib
from plctool.link.wire import Layout

_REQUEST = Layout("NS_REQUEST")
_REPLY_0400 = Layout("NS_REPLY_0400")
_REPLY_0103 = Layout("NS_REPLY_0103")


@dataclass(frozen=True)
class Node:
    """A device that answered. `address` is its router address; `target_id` is vendor << 16 | device."""

    address: bytes
    node_name: str
    device_name: str
    vendor_name: str
    target_type: int
    target_id: int
    version: str
    serial_number: str = ""
    place: str = ""  # host and port of the device, on a link to several
    left_out: bool = False  # a component of its firmware failed to start, and no program runs

    @property
    def address_text(self) -> str:
        """The address as people write it: `0274:1000:010C`."""
        return ":".join(self.address[i : i + 2].hex().upper() for i in range(0, len(self.address), 2))


def encode_request(request_id: int, size: int = 0) -> bytes:
    """A request to all nodes to name themselves, with zeros up to `size`."""
    request = _REQUEST.pack(type=lib.NS_RESOLVE_ADDRESS, version=lib.NS_VERSION_0400, request_id=request_id)
    return request.ljust(size, b"\0")


def decode_reply(payload: bytes, request_id: int, address: bytes) -> Node | None:
    """The node that answered request `request_id`; None when the payload is something else or malformed."""
    if len(payload) < _REPLY_0103.size:
        return None
    head = _REQUEST.unpack(payload)
    if head.type != lib.NS_IDENTIFICATION or head.request_id != request_id:
        return None
    if head.version >= lib.NS_VERSION_0400:
        return _decode_0400(payload, address)
    return _decode_older(payload, address) if head.version in (lib.NS_VERSION_0102, lib.NS_VERSION_0103) else None


def _decode_0400(payload: bytes, address: bytes) -> Node | None:
    if len(payload) < _REPLY_0400.size:
        return None
    head = _REPLY_0400.unpack(payload)
    strings = _strings(payload, _REPLY_0400.size, head)
    if strings is None:
        return None
    names, end = strings
    serial = payload[end : end + head.serial_length].decode("ascii", "replace")
    version = version_text(head.target_version)
    return Node(address, *names, head.target_type, head.target_id, version, serial, left_out=head.left_out == 1)


def _decode_older(payload: bytes, address: bytes) -> Node | None:
    head = _REPLY_0103.unpack(payload)
    strings = _strings(payload, _REPLY_0103.size, head)
    if strings is None:
        return None
    return Node(address, *strings[0], head.target_type, head.target_id, version_text(head.target_version))


def _strings(payload: bytes, at: int, head: Any) -> tuple[tuple[str, str, str], int] | None:
    """The three UTF-16 names after the parent's address at `at`, and the position after them; None when they do not
    fit."""
    names = []
    at += 2 * head.parent_words
    for length in (head.node_length, head.device_length, head.vendor_length):
        end = at + 2 * length
        if end + 2 > len(payload):
            return None
        names.append(payload[at:end].decode("utf-16-le", "replace"))
        at = end + 2
    return (names[0], names[1], names[2]), at


def version_text(version: int) -> str:
    """0x03050E14 -> 3.5.14.20."""
    return ".".join(str(version >> shift & 0xFF) for shift in (24, 16, 8, 0))
