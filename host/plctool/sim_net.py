"""The network of the simulator: UDP and TCP between simulators, and datagrams between a test and a program."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from ipaddress import AddressValueError, IPv4Address
from typing import Protocol

from plctool.core import Core, lib
from plctool.errors import UsageError

_BROADCAST = 0xFFFF_FFFF
_HOSTS = 0xFF  # of a network of 24 bits
_QUEUE = 256  # packets that a simulator has not taken yet


@dataclass(frozen=True)
class Datagram:
    """A UDP datagram. Addresses are written as 192.168.1.5."""

    data: bytes
    from_ip: str = ""
    from_port: int = 0
    to_ip: str = ""
    to_port: int = 0


def address_of(text: str) -> int:
    """The number of an IPv4 address. Raises UsageError if it is not one."""
    try:
        return int(IPv4Address(text))
    except AddressValueError:
        raise UsageError(f"{text!r} is not an IPv4 address: write for example 192.168.1.5.", "address") from None


def send_datagram(core: Core, datagram: Datagram) -> None:
    """Gives the device a datagram; it is lost if no socket takes it. Raises UsageError for one that cannot be."""
    ports = (datagram.from_port, datagram.to_port)
    if len(datagram.data) > lib.SIM_NET_DATA or not all(0 < port < 1 << 16 for port in ports):
        raise UsageError(f"A datagram has two ports from 1 to 65535 and at most {lib.SIM_NET_DATA} bytes.", "datagram")
    c = core.ffi.new("SIM_NET_PACKET *")
    c.kind, c.size = lib.SIM_NET_DATAGRAM, len(datagram.data)
    c.from_ip, c.from_port = address_of(datagram.from_ip), datagram.from_port
    c.to_ip, c.to_port = address_of(datagram.to_ip or "127.0.0.1"), datagram.to_port
    core.ffi.buffer(c.data)[: c.size] = datagram.data
    core.lib.SimNetPut(c)


def take_datagrams(core: Core) -> list[Datagram]:
    """The datagrams that the device has sent to others since the last call; connections are dropped."""
    return [datagram for packet in _take(core) if (datagram := packet.as_datagram()) is not None]


@dataclass
class _Packet:
    kind: int
    from_ip: int
    from_port: int
    to_ip: int
    to_port: int
    data: bytes

    def as_datagram(self) -> Datagram | None:
        if self.kind != lib.SIM_NET_DATAGRAM:
            return None
        return Datagram(
            self.data, str(IPv4Address(self.from_ip)), self.from_port, str(IPv4Address(self.to_ip)), self.to_port
        )

    @property
    def is_for_all(self) -> bool:
        return self.kind == lib.SIM_NET_DATAGRAM and (self.to_ip == _BROADCAST or self.to_ip & _HOSTS == _HOSTS)


def _take(core: Core) -> list[_Packet]:
    found = []
    c = core.ffi.new("SIM_NET_PACKET *")
    while core.lib.SimNetGet(c) == lib.ERR_OK:
        data = bytes(core.ffi.buffer(c.data)[0 : c.size])
        found.append(_Packet(c.kind, c.from_ip, c.from_port, c.to_ip, c.to_port, data))
    return found


class Networked(Protocol):
    """A simulator."""

    def join_network(self, ip: int) -> Core:
        """Has this address from now on; returns its runtime."""

    def run_for(self, ms: float) -> None:
        """Lets virtual time pass [ms]."""


@dataclass
class _Member:
    simulator: Networked
    core: Core
    ip: int
    waiting: deque[_Packet] = field(default_factory=deque)

    def hand_over(self) -> None:
        """Gives the simulator what waits for it, until it has no room."""
        c = self.core.ffi.new("SIM_NET_PACKET *")
        while self.waiting:
            p = self.waiting[0]
            c.kind, c.from_ip, c.from_port, c.to_ip, c.to_port = p.kind, p.from_ip, p.from_port, p.to_ip, p.to_port
            c.size = len(p.data)
            self.core.ffi.buffer(c.data)[: c.size] = p.data
            if self.core.lib.SimNetPut(c) == lib.ERR_NOBUFFER:
                return
            self.waiting.popleft()


class Network:
    """An IPv4 network of simulators, whose networks have 24 bits. Packets are handed over each millisecond of virtual
    time, in which all simulators take part when it is let pass here."""

    def __init__(self) -> None:
        self._members: dict[int, _Member] = {}

    def connect(self, simulator: Networked, ip: str) -> None:
        """Gives a simulator an address. Raises UsageError for one that is in use or not an address."""
        number = address_of(ip)
        if number in self._members:
            raise UsageError(f"The address {ip} is in use on this network: give each simulator its own.", "address")
        core = simulator.join_network(number)
        self._members[number] = _Member(simulator, core, number)

    def run_for(self, ms: int) -> None:
        """Lets virtual time pass for all simulators [ms]. Raises what Simulator.run_for does."""
        for _ in range(ms):
            for member in self._members.values():
                member.simulator.run_for(1)
            self._exchange()

    def _exchange(self) -> None:
        for sender in self._members.values():
            for packet in _take(sender.core):
                self._route(packet, sender)
        for member in self._members.values():
            member.hand_over()

    def _route(self, packet: _Packet, sender: _Member) -> None:
        if packet.is_for_all:
            to, everyone = packet.to_ip, self._members.values()
            receivers = [m for m in everyone if to == _BROADCAST or (m.ip ^ to) <= _HOSTS]
        else:
            found = self._members.get(packet.to_ip)
            receivers = [] if found is None else [found]
        if not receivers and packet.kind == lib.SIM_NET_CONNECT:
            refused = _Packet(lib.SIM_NET_REFUSE, packet.to_ip, packet.to_port, packet.from_ip, packet.from_port, b"")
            sender.waiting.append(refused)
        for receiver in receivers:
            if packet.kind != lib.SIM_NET_DATAGRAM or len(receiver.waiting) < _QUEUE:
                receiver.waiting.append(packet)
