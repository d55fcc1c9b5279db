"""Name service (codesys-v3-protocol 2.6): who is on the network."""

from __future__ import annotations

import struct
from dataclasses import dataclass

from plctool.core import lib

_REQUEST = struct.Struct("<HHI")
_REPLY_0400 = struct.Struct("<HHIHBBHHHHIIIIBBBBII")
_REPLY_0103 = struct.Struct("<HHIHBBHHHHIII")


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

    @property
    def address_text(self) -> str:
        """The address as people write it: `0274:1000:010C`."""
        return ":".join(self.address[i : i + 2].hex().upper() for i in range(0, len(self.address), 2))


def encode_request(request_id: int) -> bytes:
    """A request to all nodes to name themselves."""
    return _REQUEST.pack(lib.NS_RESOLVE_ADDRESS, lib.NS_VERSION_0400, request_id)


def decode_reply(payload: bytes, request_id: int, address: bytes) -> Node | None:
    """The node that answered request `request_id`; None when the payload is something else or malformed."""
    if len(payload) < _REPLY_0103.size:
        return None
    kind, version, echoed = _REQUEST.unpack_from(payload)
    if kind != lib.NS_IDENTIFICATION or echoed != request_id:
        return None
    if version >= lib.NS_VERSION_0400:
        return _decode_0400(payload, address)
    return _decode_older(payload, address) if version in (lib.NS_VERSION_0102, lib.NS_VERSION_0103) else None


def _decode_0400(payload: bytes, address: bytes) -> Node | None:
    if len(payload) < _REPLY_0400.size:
        return None
    fields = _REPLY_0400.unpack_from(payload)
    parents, *lengths = fields[6:10]
    serial_length = fields[14]
    strings = _strings(payload, _REPLY_0400.size + 2 * parents, lengths)
    if strings is None:
        return None
    names, end = strings
    serial = payload[end : end + serial_length].decode("ascii", "replace")
    return Node(address, *names, fields[10], fields[11], version_text(fields[12]), serial)


def _decode_older(payload: bytes, address: bytes) -> Node | None:
    fields = _REPLY_0103.unpack_from(payload)
    parents, *lengths = fields[6:10]
    strings = _strings(payload, _REPLY_0103.size + 2 * parents, lengths)
    return Node(address, *strings[0], fields[10], fields[11], version_text(fields[12])) if strings else None


def _strings(payload: bytes, at: int, lengths: list[int]) -> tuple[tuple[str, str, str], int] | None:
    """The three UTF-16 names at `at` and the position after them, None when they do not fit."""
    names = []
    for length in lengths:
        end = at + 2 * length
        if end + 2 > len(payload):
            return None
        names.append(payload[at:end].decode("utf-16-le", "replace"))
        at = end + 2
    return (names[0], names[1], names[2]), at


def version_text(version: int) -> str:
    """0x03050E14 -> 3.5.14.20."""
    return ".".join(str(version >> shift & 0xFF) for shift in (24, 16, 8, 0))
