"""Router packets (codesys-v3-protocol 2.1): pure encoding and decoding.

Addresses are byte strings, two bytes for each component. The tool is an end node: it never forwards.
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.core import lib

_WORD = 2
_FIXED_SIZE: int = _WORD * lib.ROUTER_HEADER_WORDS
_PAYLOAD_ALIGN = 4
_SIGNAL_FLAG = 0x20
_RELATIVE_FLAG = 0x10

BROADCAST = b""


@dataclass(frozen=True)
class Packet:
    """A packet between two nodes. An empty receiver means everybody."""

    service: int
    receiver: bytes
    sender: bytes
    payload: bytes
    message_id: int = 0


def header_size(receiver: bytes, sender: bytes) -> int:
    """Bytes before the payload, filler included."""
    size = _FIXED_SIZE + len(receiver) + len(sender)
    return _aligned(size)


def _aligned(size: int) -> int:
    return -(-size // _PAYLOAD_ALIGN) * _PAYLOAD_ALIGN


def encode(packet: Packet) -> bytes:
    """The bytes of a packet, ready for a block driver."""
    head = bytes(
        [
            lib.ROUTER_MAGIC,
            lib.ROUTER_HOP_COUNT << 3 | lib.ROUTER_HEADER_WORDS,
            lib.ROUTER_PRIO_NORMAL << 6,
            packet.service,
            packet.message_id,
            len(packet.sender) // _WORD << 4 | len(packet.receiver) // _WORD,
        ]
    )
    head += packet.receiver + packet.sender
    return head.ljust(header_size(packet.receiver, packet.sender), b"\0") + packet.payload


def decode(data: bytes) -> Packet | None:
    """The packet in `data`; None when malformed or nothing for an end node (router signals, relative addresses)."""
    if len(data) < _FIXED_SIZE or data[0] != lib.ROUTER_MAGIC or data[2] & (_SIGNAL_FLAG | _RELATIVE_FLAG):
        return None
    header_words = data[1] & 0x07
    sender_words, receiver_words = data[5] >> 4, data[5] & 0x0F
    if header_words < lib.ROUTER_HEADER_WORDS:
        return None
    receiver_at = _WORD * header_words
    sender_at = receiver_at + _WORD * receiver_words
    end = sender_at + _WORD * sender_words
    payload_at = _aligned(end)
    if payload_at > len(data):
        return None
    return Packet(data[3], data[receiver_at:sender_at], data[sender_at:end], data[payload_at:], data[4])
