"""Block transport over UDP: a datagram is a packet (codesys-v3-protocol 1.1).

Requests to all nodes go to the host that the user named: a device, or the broadcast address of a network. A device that
has replied to a name request is known by its router address; packets for it go to the source of that reply, and packets
with its address are taken from there only.
"""

from __future__ import annotations

import math
import select
import socket
import time
from collections.abc import Mapping
from types import MappingProxyType

from plctool.core import lib
from plctool.errors import LinkError
from plctool.link import network, router

_BUFFER = 1 << 20  # bytes the system keeps for us
_READ = 2048

Place = tuple[str, int]


class UdpTransport:
    """Packets to and from the devices at one host, or on one network."""

    def __init__(self, place: str) -> None:
        host, port = network.split_place(place)
        ip = network.find_host(host)
        first = int(lib.UDP_PORT)
        self.name = place
        self.max_packet = int(lib.BLK_MAX_SIZE)
        self.long_packet = 0
        self.packet_overhead = 0
        self.byte_rate = math.inf
        self.is_slow = False
        self.is_bus = False
        self.point_to_point = False
        self.heard_at = -math.inf
        self.peer_words = 0
        self._places: dict[bytes, str] = {}
        self.places: Mapping[bytes, str] = MappingProxyType(self._places)
        self._all: list[Place] = [(ip, p) for p in ([port] if port else range(first, first + int(lib.UDP_PORTS)))]
        self._homes: dict[bytes, Place] = {}  # source of the first reply of each device, by router address
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, _BUFFER)
        self._socket.setblocking(False)
        self.local_address = self._find_own_address()

    def now(self) -> float:
        return time.monotonic()

    def fileno(self) -> int | None:
        return self._socket.fileno()

    def send(self, *packets: bytes) -> None:
        for packet in packets:
            header = router.decode(packet)
            receiver = header.receiver if header else router.BROADCAST
            for place in self._all if receiver == router.BROADCAST else [self._home(receiver)]:
                self._send(packet, place)

    def receive(self, timeout: float) -> bytes | None:
        end = time.monotonic() + timeout
        while True:
            try:
                data, place = self._socket.recvfrom(_READ)
            except BlockingIOError:
                if not select.select([self._socket], [], [], max(0.0, end - time.monotonic()))[0]:
                    return None
                continue
            except OSError as error:
                raise self._failed(error) from error
            if self._is_expected(data, place):
                return data

    def close(self) -> None:
        self._socket.close()

    def _find_own_address(self) -> bytes:
        """Binds the socket; returns the address that packets to the host are sent from."""
        self._socket.bind(("", 0))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as way:
            way.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
            try:
                way.connect(self._all[0])
            except OSError as error:
                self.close()
                raise LinkError(f"Cannot reach {self.name}: {network.advice(error)}", "open") from error
            ip = network.own_address(way)[2:]
        return network.own_address(self._socket)[:2] + ip

    def _home(self, receiver: bytes) -> Place:
        """Where a device is. Raises LinkError if the user named a network instead of a device."""
        home = self._homes.get(receiver)
        if home is None:
            raise LinkError(f"No device answers on {self.name}.", "no-answer")
        if home[0] != self._all[0][0]:
            raise LinkError(
                f"{self.name} is not the address of a device, but the device at {_text(home)} replied; use that "
                f"address, or run 'plctool scan --udp {self.name}'.",
                "several",
            )
        return home

    def _is_expected(self, data: bytes, place: Place) -> bool:
        packet = router.decode(data)
        if packet is None:
            return False
        if packet.service == lib.ROUTER_SVC_NAME_RESPONSE:
            self._homes.setdefault(packet.sender, place)
            self._places.setdefault(packet.sender, _text(place))
        return self._homes.get(packet.sender) == place

    def _send(self, packet: bytes, place: Place) -> None:
        while True:
            try:
                self._socket.sendto(packet, place)
                return
            except BlockingIOError:
                select.select([], [self._socket], [])
            except OSError as error:
                raise self._failed(error) from error

    def _failed(self, error: OSError) -> LinkError:
        return LinkError(f"Cannot reach {self.name}: {network.advice(error)}", "link-lost")


def _text(place: Place) -> str:
    return f"{place[0]}:{place[1]}"
