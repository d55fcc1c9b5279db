"""Controllers that announce themselves by multicast DNS, on loopback: finding them, their names, attacks on them."""

from __future__ import annotations

import os
import secrets
import signal
import socket
import struct
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from conftest import Tool

from plctool.link import mdns
from plctool.testing.plcrt import Plcrt

Eventually = Callable[[Callable[[], Any]], Any]
GROUP = ("224.0.0.251", 5353)


@pytest.fixture
def name() -> str:
    """A name that no other test on this machine has."""
    return f"press {secrets.token_hex(4)}"


@pytest.fixture
def announced(tmp_path: Path, name: str) -> Iterator[Plcrt]:
    with Plcrt(tmp_path / "plc.flash", "--tcp", "0", "--mdns", "--name", name) as running:
        yield running


def places_of(name: str) -> dict[str, str]:
    """Where the controllers are that announce themselves with a name that begins so."""
    return {device.name: device.place for device in mdns.find_devices() if device.name.startswith(name)}


def query(host: str, kind: int = 1, number: int = 7) -> bytes:
    """A question for the address of a host."""
    labels = b"".join(bytes([len(label)]) + label.encode() for label in host.split("."))
    return struct.pack(">6H", number, 0, 1, 0, 0, 0) + labels + b"\0" + struct.pack(">2H", kind, 1)


@pytest.fixture
def stranger() -> Iterator[socket.socket]:
    """A machine on loopback that sends what it likes."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        sender.bind(("127.0.0.1", 0))
        sender.settimeout(0.2)
        yield sender


def answers_to(stranger: socket.socket, question: bytes) -> bytes:
    """A reply to a question; b"" if none comes for a moment."""
    stranger.sendto(question, GROUP)
    try:
        return stranger.recv(9000)
    except TimeoutError:
        return b""


def test_scan_without_a_link_finds_the_controller(
    announced: Plcrt, name: str, tool: Tool, eventually: Eventually
) -> None:
    place = f"tcp:{announced.tcp}"

    def found() -> bool:
        done = tool("scan", "--json")
        return done.status == 0 and any(
            device["link"] == place and device["node_name"] == name for device in done.json["devices"]
        )

    eventually(found)


def test_a_name_that_ends_in_local_leads_to_the_controller(
    announced: Plcrt, name: str, tool: Tool, eventually: Eventually
) -> None:
    port = announced.tcp.rpartition(":")[2]
    link = f"{name.replace(' ', '-')}.local:{port}"
    eventually(lambda: tool("status", "--tcp", link).status == 0)


def test_a_name_that_no_machine_has_is_one_sentence(tool: Tool) -> None:
    done = tool("status", "--tcp", f"none-{secrets.token_hex(4)}.local")
    assert (done.status, done.err.count("\n")) == (3, 1)
    assert "is unknown" in done.err


def test_of_two_controllers_with_one_name_the_second_gets_a_number(
    announced: Plcrt, tmp_path: Path, name: str, eventually: Eventually
) -> None:
    with Plcrt(tmp_path / "second.flash", "--tcp", "0", "--mdns", "--name", name) as second:
        eventually(lambda: set(places_of(name).values()) == {announced.tcp, second.tcp})
        assert set(places_of(name)) == {name, f"{name} (2)"}


def test_a_controller_takes_leave_and_comes_back_after_a_death(
    announced: Plcrt, name: str, eventually: Eventually
) -> None:
    eventually(lambda: name in places_of(name))
    worker = announced.worker
    assert worker
    os.kill(worker, signal.SIGKILL)
    eventually(lambda: announced.worker not in (None, worker))
    eventually(lambda: name in places_of(name))
    announced.stop()
    assert places_of(name) == {}


@pytest.mark.parametrize("odd", ['a.b\\c"', "\x1b[31mred", "ü" * 40, "._plcrt._tcp.local"])
def test_odd_names_are_shown_and_found(tmp_path: Path, tool: Tool, odd: str, eventually: Eventually) -> None:
    with Plcrt(tmp_path / "plc.flash", "--tcp", "0", "--mdns", "--name", odd) as running:
        eventually(lambda: running.tcp in {device.place for device in mdns.find_devices()})
        done = tool("scan")
        assert done.status == 0 and running.tcp in done.out and "\x1b" not in done.out


def test_bad_names_of_strangers_do_not_disturb_a_scan(
    announced: Plcrt, name: str, stranger: socket.socket, tool: Tool, eventually: Eventually
) -> None:
    """Labels that are not UTF-8, with lies about sizes, sent again and again while a scan listens."""
    service = b"\6_plcrt\4_tcp\5local\0"
    head = struct.pack(">6H", 0, 0x8400, 0, 1, 0, 0) + service + struct.pack(">2HL", 12, 1, 4500)
    datagrams = [
        head + struct.pack(">H", len(label) + 1 + len(service) + lie) + bytes([len(label)]) + label + service
        for label in (b"\xff" * 63, b"\x1b[31mred", b"a.b\\", b"")
        for lie in (0, 200, -5)
    ]
    with ThreadPoolExecutor(1) as pool:
        done = pool.submit(tool, "scan", "--json")
        while not done.done():
            for datagram in datagrams:
                stranger.sendto(datagram, GROUP)
            time.sleep(0.01)
    result = done.result()
    assert "Traceback" not in result.err and "\x1b" not in result.out + result.err
    assert any(device["node_name"] == name for device in result.json["devices"])


def test_a_flood_gets_few_replies_and_the_controller_serves_on(
    announced: Plcrt, name: str, stranger: socket.socket, tool: Tool, eventually: Eventually
) -> None:
    host = name.replace(" ", "-") + ".local"
    eventually(lambda: answers_to(stranger, query(host)))
    for number in range(3000):
        stranger.sendto(query(host, number=number), GROUP)
    tool.ok("status", "--tcp", announced.tcp)
    replies = 0
    stranger.settimeout(1)
    try:
        while stranger.recv(9000):
            replies += 1
    except TimeoutError:
        pass
    assert replies < 1000


def test_damaged_messages_change_nothing(
    announced: Plcrt, name: str, stranger: socket.socket, tool: Tool, eventually: Eventually
) -> None:
    host = name.replace(" ", "-") + ".local"
    whole = query(host)
    eventually(lambda: answers_to(stranger, whole))
    for size in range(len(whole)):
        stranger.sendto(whole[:size], GROUP)
    for place in range(len(whole)):
        stranger.sendto(whole[:place] + b"\xff" + whole[place + 1 :], GROUP)
    stranger.sendto(whole + b"\0" * 8000, GROUP)
    loop = struct.pack(">6H", 0, 0, 1, 0, 0, 0) + b"\xc0\x0c\x00\x01\x00\x01"
    stranger.sendto(loop, GROUP)
    eventually(lambda: answers_to(stranger, query(host, number=0x4321))[:2] == b"\x43\x21")
    tool.ok("status", "--tcp", announced.tcp)
