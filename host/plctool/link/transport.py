"""What a link gives to the layers above: whole packets, a clock, and a few figures of the line."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol

NO_PLACES: Mapping[bytes, str] = MappingProxyType({})

TOOL_ADDRESS = b"\x00\x02"  # router address of a tool on a line of its own
BITS_PER_BYTE = 10  # of a serial line, 8N1: start bit, eight data bits, stop bit
DEFAULT_BAUD = 115200  # of a serial line if the user names none


class BlockTransport(Protocol):
    """A block driver: sends and receives router packets, unreliably, and never delivers a damaged one on purpose."""

    name: str  # for messages: the port or address the user named
    local_address: bytes  # router address of this end
    max_packet: int  # longest packet it takes and gives, in bytes
    long_packet: int  # longest packet it takes for a device that says it takes more than others, bytes; 0: max_packet
    packet_overhead: int  # bytes the line carries for a packet besides the packet itself
    byte_rate: float  # bytes the line carries per second; math.inf if unknown or irrelevant
    is_slow: bool  # it pays to pack what is sent
    is_bus: bool  # what the device sends takes the time of what is sent to it
    point_to_point: bool  # every packet is from the one device to this end, whatever its addresses
    heard_at: float  # when the line last heard the device, other than by whole packets; -math.inf: it does not know
    peer_words: int  # length of the address of the one device on the line; 0: not known, or there may be several
    places: Mapping[bytes, str]  # of the devices that replied on a link to several, by router address

    def send(self, *packets: bytes) -> None:
        """Queues packets; raises LinkError when the line is gone."""

    def receive(self, timeout: float) -> bytes | None:
        """The next packet, None after `timeout` seconds without one; raises LinkError when the line is gone."""

    def fileno(self) -> int | None:
        """The file descriptor that poll watches for packets, or for the loss of the line; None if there is none."""

    def now(self) -> float:
        """Monotonic time in seconds; virtual for virtual lines."""

    def close(self) -> None:
        """Frees the line. Harmless when repeated."""
