"""The network as the tool sees it: places, frames in any pieces, strangers, lost connections."""

from __future__ import annotations

import random
import socket
from collections.abc import Iterator
from contextlib import suppress

import pytest

from plctool.core import lib
from plctool.errors import LinkError, UsageError
from plctool.link import names, router
from plctool.link.channel import ChannelLost
from plctool.link.network import find_host, split_place
from plctool.link.tcp import TcpTransport
from plctool.link.udp import UdpTransport
from plctool.link.wire import Layout

LOCALHOST = "127.0.0.1"
PATIENCE = 30.0  # for what is bound to come [s]
MAGIC = bytes.fromhex("000117E8")
DEVICE = b"\x00\xaf"


@pytest.mark.parametrize(
    ("text", "place"),
    [("192.168.1.5", ("192.168.1.5", None)), ("plc.local:11741", ("plc.local", 11741)), ("a:65535", ("a", 65535))],
)
def test_a_place_is_a_host_and_perhaps_a_port(text: str, place: tuple[str, int | None]) -> None:
    assert split_place(text) == place


@pytest.mark.parametrize("text", ["", ":", ":1", "host:", "host:0", "host:65536", "host:x", "host:-1", "::1", "h:1:2"])
def test_what_is_no_place_is_wrong_use(text: str) -> None:
    with pytest.raises(UsageError, match="is not a valid HOST"):
        split_place(text)


@pytest.mark.parametrize("host", ["no-such-host.invalid", "a..b", "x" * 300])
def test_an_unknown_host_is_told(host: str) -> None:
    with pytest.raises(LinkError, match="unknown"):
        find_host(host)


# ---- TCP ----


def frame(packet: bytes) -> bytes:
    return MAGIC + (8 + len(packet)).to_bytes(4, "little") + packet


class Device:
    """The other end of a connection."""

    def __init__(self) -> None:
        self.server = socket.create_server((LOCALHOST, 0))
        self.server.settimeout(PATIENCE)
        self.tool = TcpTransport(f"{LOCALHOST}:{self.server.getsockname()[1]}")
        self.accept()

    def accept(self) -> None:
        self.end, self.peer = self.server.accept()
        self.end.settimeout(PATIENCE)

    def read(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            data += self.end.recv(size - len(data))
        return data


@pytest.fixture
def device() -> Iterator[Device]:
    made = Device()
    yield made
    made.tool.close()
    made.end.close()
    made.server.close()


def test_packets_go_in_frames_and_the_address_is_port_and_ip(device: Device) -> None:
    device.tool.send(b"first!", b"second")
    assert device.read(28) == frame(b"first!") + frame(b"second")
    assert device.tool.local_address == device.peer[1].to_bytes(2, "big") + socket.inet_aton(device.peer[0])


@pytest.mark.parametrize("piece", [1, 3, 8, 9, 1000])
def test_frames_come_in_any_pieces(device: Device, piece: int) -> None:
    packets = [b"x", b"a packet", bytes(512), b"y" * 100]
    data = b"".join(map(frame, packets))
    for at in range(0, len(data), piece):
        device.end.sendall(data[at : at + piece])
    assert [device.tool.receive(PATIENCE) for _ in packets] == packets
    assert device.tool.receive(0.0) is None


@pytest.mark.parametrize(
    "wrong", [b"HTTP/1.1 400", MAGIC + bytes(4), MAGIC + b"\x08\0\0\0", MAGIC + b"\x09\x02\0\0", MAGIC + b"\xff" * 4]
)
def test_what_is_no_frame_is_told(device: Device, wrong: bytes) -> None:
    device.end.sendall(frame(b"right") + wrong)
    with pytest.raises(LinkError, match="is not the protocol"):
        while True:
            device.tool.receive(PATIENCE)


def test_a_connection_that_ended_is_made_anew(device: Device) -> None:
    device.end.sendall(frame(b"x" * 20)[:-1])
    device.end.close()
    with pytest.raises(ChannelLost, match="closed the connection") as caught:
        device.tool.receive(PATIENCE)
    assert caught.value.code == "link-lost"
    device.tool.send(b"again")
    device.accept()
    assert device.read(13) == frame(b"again")
    device.end.sendall(frame(b"welcome"))
    assert device.tool.receive(PATIENCE) == b"welcome"


def test_a_closed_port_is_reported(device: Device) -> None:
    device.server.close()
    device.end.close()
    with suppress(ChannelLost):
        device.tool.receive(PATIENCE)
    with pytest.raises(LinkError, match="refuses connections"):
        device.tool.send(b"anybody?")


# ---- UDP ----


class Node:
    """A device, or a stranger, with a socket."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((LOCALHOST, 0))
        self.socket.settimeout(PATIENCE)
        self.port = self.socket.getsockname()[1]

    def say(self, to: UdpTransport, service: int, payload: bytes = b"") -> None:
        """As the device with the address DEVICE."""
        packet = router.encode(router.Packet(service, to.local_address, DEVICE, payload))
        self.socket.sendto(packet, (LOCALHOST, int.from_bytes(to.local_address[:2], "big")))


@pytest.fixture
def node() -> Iterator[Node]:
    made = Node()
    yield made
    made.socket.close()


@pytest.fixture
def tool(node: Node) -> Iterator[UdpTransport]:
    made = UdpTransport(f"{LOCALHOST}:{node.port}")
    yield made
    made.close()


def packet_for(receiver: bytes) -> bytes:
    return router.encode(router.Packet(lib.ROUTER_SVC_CHANNEL, receiver, b"\x00\x02", b"for you"))


def test_who_has_answered_is_where_packets_go_and_come_from(node: Node, tool: UdpTransport) -> None:
    stranger = Node()
    node.say(tool, lib.ROUTER_SVC_NAME_RESPONSE)
    assert tool.receive(PATIENCE)
    assert tool.places == {DEVICE: f"{LOCALHOST}:{node.port}"}
    stranger.say(tool, lib.ROUTER_SVC_NAME_RESPONSE)  # it says it is the device
    stranger.say(tool, lib.ROUTER_SVC_CHANNEL, b"forged")
    node.say(tool, lib.ROUTER_SVC_CHANNEL, b"right!")
    answer = tool.receive(PATIENCE)
    assert answer
    assert answer.endswith(b"right!")
    tool.send(packet_for(DEVICE))
    assert node.socket.recv(600) == packet_for(DEVICE)
    stranger.socket.setblocking(False)
    with pytest.raises(BlockingIOError):
        stranger.socket.recv(600)
    stranger.socket.close()


def test_nothing_is_taken_from_who_has_not_answered(node: Node, tool: UdpTransport) -> None:
    node.say(tool, lib.ROUTER_SVC_CHANNEL, b"too early")
    node.socket.sendto(b"no packet", (LOCALHOST, int.from_bytes(tool.local_address[:2], "big")))
    node.say(tool, lib.ROUTER_SVC_NAME_RESPONSE, b"first")
    answer = tool.receive(PATIENCE)
    assert answer
    assert answer.endswith(b"first")


def test_a_packet_for_an_unknown_device_is_not_sent(tool: UdpTransport) -> None:
    with pytest.raises(LinkError, match="No device answers"):
        tool.send(packet_for(b"\x12\x34"))


def test_a_request_to_all_goes_to_the_place(node: Node, tool: UdpTransport) -> None:
    request = router.encode(
        router.Packet(lib.ROUTER_SVC_NAME_REQUEST, router.BROADCAST, b"\x00\x02", names.encode_request(1))
    )
    tool.send(request)
    assert node.socket.recv(600) == request


def test_without_a_port_all_ports_of_the_protocol_are_asked() -> None:
    place = f"127.{random.randint(1, 250)}.{random.randint(1, 250)}.{random.randint(1, 250)}"
    nodes = []
    for index in range(lib.UDP_PORTS):
        node = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        node.bind((place, lib.UDP_PORT + index))
        node.settimeout(PATIENCE)
        nodes.append(node)
    tool = UdpTransport(place)
    tool.send(packet_for(router.BROADCAST))
    for node in nodes:
        assert node.recv(600) == packet_for(router.BROADCAST)
        node.close()
    tool.close()


def test_the_layout_of_a_frame_is_that_of_the_firmware() -> None:
    header = Layout("TCP_HEADER")
    assert header.size == 8
    assert header.pack(magic=lib.TCP_MAGIC & 0xFFFFFFFF, size=28) == frame(bytes(20))[:8]
