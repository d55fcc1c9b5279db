"""Router packets (codesys-v3-protocol 2.1): pure encoding and decoding.

Addresses are byte strings, two bytes for each component. The tool is an end node: it never forwards.
"""

from __future__ import annotations

from dataclasses import dataclass

from plctool.core import lib
from plctool.link.wire import Layout

_WORD = 2
_HEADER = Layout("ROUTER_HEADER")
_HEADER_WORDS = _HEADER.size // _WORD
_HEADER_WORDS_MASK = (1 << lib.ROUTER_HOP_SHIFT) - 1
_PAYLOAD_ALIGN = 4

BROADCAST = b""


@dataclass(frozen=True)
class Packet:
    """A packet between two nodes. An empty receiver means all nodes."""

    service: int
    receiver: bytes
    sender: bytes
    payload: bytes
    message_id: int = 0


def header_size(receiver: bytes, sender: bytes) -> int:
    """Bytes before the payload, filler included."""
    size = _HEADER.size + len(receiver) + len(sender)
    return _aligned(size)


def _aligned(size: int) -> int:
    return -(-size // _PAYLOAD_ALIGN) * _PAYLOAD_ALIGN


def encode(packet: Packet) -> bytes:
    """The bytes of a packet, ready for a block driver."""
    head = _HEADER.pack(
        magic=lib.ROUTER_MAGIC,
        hops=lib.ROUTER_HOP_COUNT << lib.ROUTER_HOP_SHIFT | _HEADER_WORDS,
        flags=lib.ROUTER_PRIO_NORMAL << lib.ROUTER_PRIO_SHIFT,
        service=packet.service,
        message=packet.message_id,
        lengths=len(packet.sender) // _WORD << 4 | len(packet.receiver) // _WORD,
    )
    head += packet.receiver + packet.sender
    return head.ljust(header_size(packet.receiver, packet.sender), b"\0") + packet.payload


def decode(data: bytes) -> Packet | None:
    """The packet in `data`; None if malformed or not for an end node (router signals, relative addresses)."""
    if len(data) < _HEADER.size:
        return None
    head = _HEADER.unpack(data)
    header_words = head.hops & _HEADER_WORDS_MASK
    sender_words, receiver_words = head.lengths >> 4, head.lengths & 0x0F
    signal = head.flags & (lib.ROUTER_FLAG_SIGNAL | lib.ROUTER_FLAG_RELATIVE)
    if head.magic != lib.ROUTER_MAGIC or signal or header_words < _HEADER_WORDS:
        return None
    receiver_at = _WORD * header_words
    sender_at = receiver_at + _WORD * receiver_words
    end = sender_at + _WORD * sender_words
    payload_at = _aligned(end)
    if payload_at > len(data):
        return None
    return Packet(head.service, data[receiver_at:sender_at], data[sender_at:end], data[payload_at:], head.message)
