"""A real plcrt on TCP, UDP and a pseudo terminal at once, and tools on each of them."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest

import plctool
from plctool.core import lib
from plctool.device import Plc
from plctool.errors import LinkError, PlcError, UsageError
from plctool.link import services
from plctool.link.connection import Connection
from plctool.link.names import Node
from plctool.link.session import Session
from plctool.link.transports import open_transport, parse_link
from plctool.testing.plcrt import Plcrt

KINDS = ["serial", "tcp", "udp", "can"]
PATIENCE = 30.0  # for what is bound to happen [s]
CLIENTS = 4  # tools that may be logged in at a time on Linux: COMM_MAX_CLIENTS


@pytest.fixture(autouse=True)
def no_gateway(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLCTOOL_GATEWAY", "off")


def _own_loopback() -> str:
    """A loopback address of this test alone, because the UDP ports are fixed by the protocol."""
    return f"127.{random.randint(1, 250)}.{random.randint(1, 250)}.{random.randint(1, 250)}"


@pytest.fixture
def plcrt(tmp_path: Path) -> Iterator[Plcrt]:
    with Plcrt(tmp_path / "plc.flash", "--tcp", "0", "--udp", _own_loopback(), "--can", "slcan:pty") as running:
        yield running


def test_it_listens_on_the_loopback_address_unless_told_otherwise(plcrt: Plcrt, tmp_path: Path) -> None:
    assert _listens_on(plcrt.tcp) == {"127.0.0.1"}
    with Plcrt(tmp_path / "open.flash", "--tcp", "0.0.0.0:0") as told:
        assert _listens_on(told.tcp) == {"0.0.0.0"}


@pytest.mark.parametrize("kind", ["tcp", "udp"])
def test_without_a_place_it_is_the_loopback_address(kind: str, tmp_path: Path) -> None:
    """At the ports of the protocol. When another program has them, plcrt says where it tried."""
    running = Plcrt(tmp_path / "plc.flash", f"--{kind}")
    try:
        running.start()
    except UsageError as error:
        assert f"cannot serve --{kind} 127.0.0.1: Address already in use" in str(error)
        return
    try:
        assert getattr(running, kind).startswith("127.0.0.1:")
    finally:
        running.stop()


def _listens_on(place: str) -> set[str]:
    """The addresses whose port, that of `place`, the kernel has in the state LISTEN."""
    port = int(place.rpartition(":")[2])
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    places = [row[1].split(":") for row in rows if row[3] == "0A"]
    return {socket.inet_ntoa(bytes.fromhex(host)[::-1]) for host, number in places if int(number, 16) == port}


def link_of(plcrt: Plcrt, kind: str) -> str:
    place = {"serial": plcrt.port, "tcp": plcrt.tcp, "udp": plcrt.udp, "can": f"slcan:{plcrt.can}"}[kind]
    return f"{kind}:{place}"


def option_of(plcrt: Plcrt, kind: str) -> list[str]:
    scheme, _, place = link_of(plcrt, kind).partition(":")
    node = ["--node", "1"] if kind == "can" else []
    return [f"--{'port' if scheme == 'serial' else scheme}", place, *node]


def scanned(link: str) -> list[Node]:
    """The devices that answer in time."""
    try:
        return plctool.scan(link, 0.5)
    except LinkError:
        return []


def open_session(link: str) -> Session:
    return Session(Connection(open_transport(parse_link(link))))


@pytest.mark.parametrize("kind", KINDS)
class TestEveryLink:
    """The same on each kind of link."""

    def test_the_device_is_found_and_names_itself(
        self, plcrt: Plcrt, kind: str, eventually: Callable[..., Any]
    ) -> None:
        (node,) = eventually(lambda: scanned(link_of(plcrt, kind)))
        assert node.device_name == "plcrt"
        assert node.place == {"udp": plcrt.udp, "can": "node 1"}.get(kind, "")

    @pytest.mark.parametrize("size", [1, 440, 441, 442, 1000, 16000])
    def test_echoes_of_all_sizes_come_back(self, plcrt: Plcrt, kind: str, size: int) -> None:
        session = open_session(link_of(plcrt, kind))
        data = random.Random(size).randbytes(size)
        assert services.echo(session, data) == data
        session.connection.close()

    def test_a_program_is_flashed_read_and_written(self, plcrt: Plcrt, kind: str, tool: Any, counter: Path) -> None:
        where = option_of(plcrt, kind)
        assert tool.ok("flash", *where, str(counter))["skipped"] is False
        assert tool.ok("status", *where)["state"] == "run"
        tool.ok("write", "Main.step=0", "Main.count=4711", *where)
        assert tool.ok("read", "Main.count", *where)["values"] == {"Main.count": 4711}
        assert tool.ok("flash", *where, str(counter))["skipped"] is True
        assert tool.ok("stop", *where)["state"] == "stop"
        assert any("stopped" in entry["text"] for entry in tool.ok("log", *where)["entries"])

    def test_it_is_watched(self, plcrt: Plcrt, kind: str, counter: Path) -> None:
        with plctool.connect(link_of(plcrt, kind)) as plc:
            plc.flash(counter)
            first = plc.read("Main.count")
            while plc.read("Main.count") == first:
                pass  # it counts

    def test_a_tool_that_ended_abruptly_is_no_obstacle(self, plcrt: Plcrt, kind: str) -> None:
        script = (
            f"import plctool, os; p = plctool.connect({link_of(plcrt, kind)!r}); p.identity(); os.kill(os.getpid(), 9)"
        )
        assert subprocess.run([sys.executable, "-c", script], check=False).returncode == -signal.SIGKILL
        with plctool.connect(link_of(plcrt, kind)) as plc:
            assert plc.identity().device_name == "plcrt"


def test_a_start_does_not_give_the_ids_of_the_one_before(tmp_path: Path) -> None:
    """The first session of each start: its number is from the entropy of the system."""
    sessions = []
    for _ in range(3):
        with Plcrt(tmp_path / "plc.flash", "--tcp", "0") as running:
            session = open_session(f"tcp:{running.tcp}")
            sessions.append(session.ensure())
            session.connection.close()
    assert len(set(sessions)) == 3


def test_all_lines_serve_at_once(plcrt: Plcrt, counter: Path) -> None:
    with ExitStack() as stack:
        plcs: list[Plc] = [stack.enter_context(plctool.connect(link_of(plcrt, kind))) for kind in KINDS]
        plcs[0].flash(counter)
        for number in range(10):
            for writer in plcs:
                writer.write({"Main.name": f"n{number}"})
                for reader in plcs:
                    assert reader.read("Main.name") == f"n{number}"


@pytest.mark.parametrize("kind", ["tcp", "udp"])
def test_clients_that_were_killed_leave_their_places_to_the_next_one(
    plcrt: Plcrt, kind: str, eventually: Callable[..., Any]
) -> None:
    """All the clients there may be. On TCP the device has read their end before it accepts the next one; on UDP the
    network says so when it sends them something, before they were idle for long."""
    link = link_of(plcrt, kind)
    script = (
        f"import plctool, select, sys\np = plctool.connect({link!r})\np.identity()\nprint(flush=True)\n"
        "while not select.select([sys.stdin], [], [], 0.5)[0]:\n    p.identity()\n"
    )
    command = [sys.executable, "-c", script]

    def leave_at_once() -> bool:
        tools = [
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
            for _ in range(CLIENTS)
        ]
        for each in tools:
            assert each.stdout
            assert each.stdout.readline() == b"\n"
        with pytest.raises(LinkError, match="busy"), plctool.connect(link) as plc:
            plc.identity()
        begin = time.monotonic()
        for each in tools:
            each.kill()
        for each in tools:
            each.communicate()
        eventually(lambda: gets_in(link))
        return time.monotonic() - begin < int(lib.CHANNEL_IDLE_MS) / 1000 - 1  # they were heard just before

    eventually(leave_at_once)


def gets_in(link: str) -> bool:
    try:
        with plctool.connect(link) as plc:
            return plc.identity().device_name == "plcrt"
    except LinkError:
        return False


def test_who_watches_while_another_one_flashes_sees_the_new_program(plcrt: Plcrt, tool: Any, counter: Path) -> None:
    other = tool.build("other", "PROGRAM Main VAR count : DINT := 1000000; END_VAR count := count + 1; END_PROGRAM")
    old, new = threading.Event(), threading.Event()
    errors: list[PlcError] = []

    def watch() -> None:
        with plctool.connect(f"tcp:{plcrt.tcp}") as plc:
            try:
                for _, reading in plc.watch(["Main.count"], interval=0.0):
                    old.set()
                    if reading.values["Main.count"] >= 1000000:
                        new.set()
                        return
            except PlcError as error:
                errors.append(error)

    with plctool.connect(f"udp:{plcrt.udp}") as plc:
        plc.flash(counter)
        watcher = threading.Thread(target=watch, daemon=True)
        watcher.start()
        assert old.wait(PATIENCE)
        plc.flash(other)
        watcher.join(PATIENCE)
    assert errors == []
    assert new.is_set()


def test_two_flashers_do_not_mix(plcrt: Plcrt, tool: Any, counter: Path) -> None:
    """One of them wins, or both one after the other; what runs is one of the images, whole."""
    other = tool.build("other", "PROGRAM Main VAR other : DINT; END_VAR other := other + 1; END_PROGRAM")
    results: list[PlcError | None] = []

    def flash(link: str, image: Path) -> None:
        with plctool.connect(link) as plc:
            try:
                plc.flash(image)
                results.append(None)
            except PlcError as error:
                results.append(error)

    places = [(f"tcp:{plcrt.tcp}", counter), (f"udp:{plcrt.udp}", other)]
    threads = [threading.Thread(target=flash, args=place) for place in places]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert None in results
    with plctool.connect(f"tcp:{plcrt.tcp}") as plc:
        status = plc.status()
    assert status.state == "run"


def test_a_scan_by_broadcast_finds_all_devices(
    plcrt: Plcrt, tmp_path: Path, tool: Any, eventually: Callable[..., Any]
) -> None:
    def places() -> set[str]:
        done = tool("scan", "--udp", "127.255.255.255", "--json")
        return {device["place"] for device in done.json["devices"]} if done.status == 0 else set()

    with Plcrt(tmp_path / "second.flash", "--udp", f"{_own_loopback()}:1743") as second:
        assert second.udp.endswith(":1743")
        eventually(lambda: {plcrt.udp, second.udp} <= places())
        done = tool("status", "--udp", "127.255.255.255")
        assert done.status == 3
        assert "is not the address of a device" in done.err


def test_a_long_scan_by_broadcast_shows_the_program_of_each_device(
    plcrt: Plcrt, tmp_path: Path, tool: Any, eventually: Callable[..., Any], counter: Path
) -> None:
    def states() -> set[tuple[str, str]]:
        done = tool("scan", "--long", "--udp", "127.255.255.255", "--json")
        return {(device["place"], device["state"]) for device in done.json["devices"]} if done.status == 0 else set()

    with Plcrt(tmp_path / "second.flash", "--udp", f"{_own_loopback()}:1743") as second:
        with plctool.connect(f"udp:{plcrt.udp}") as plc:
            plc.flash(counter)
        eventually(lambda: {(plcrt.udp, "run"), (second.udp, "none")} <= states())


def test_a_connection_through_a_forwarded_port_works(plcrt: Plcrt, counter: Path) -> None:
    """As with NAT: the device sees another peer address than the tool has."""
    host, port = plcrt.tcp.split(":")
    with socket.create_server(("127.0.0.1", 0)) as server:
        forward = threading.Thread(target=_forward, args=(server, (host, int(port))))
        forward.start()
        with plctool.connect(f"tcp:127.0.0.1:{server.getsockname()[1]}") as plc:
            plc.flash(counter)
            assert plc.status().state == "run"
        forward.join()


def _forward(server: socket.socket, device: tuple[str, int]) -> None:
    """Carries one connection to the device until one of the ends is closed."""
    near, _ = server.accept()
    with near, socket.create_connection(device) as far:
        back = threading.Thread(target=_copy, args=(far, near))
        back.start()
        _copy(near, far)
        back.join()


def _copy(source: socket.socket, sink: socket.socket) -> None:
    """Until one of them is closed; its other end may still send then."""
    with suppress(OSError):
        while data := source.recv(4096):
            sink.sendall(data)
    with suppress(OSError):
        sink.shutdown(socket.SHUT_WR)


def test_datagrams_through_a_forwarded_port_work(plcrt: Plcrt) -> None:
    """The device is reached at another address and port than it has."""
    host, port = plcrt.udp.split(":")
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as near,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as far,
    ):
        near.bind(("127.0.0.1", 0))
        far.connect((host, int(port)))
        ended = threading.Event()
        forward = threading.Thread(target=_forward_datagrams, args=(near, far, ended))
        forward.start()
        try:
            session = open_session(f"udp:127.0.0.1:{near.getsockname()[1]}")
            assert services.echo(session, bytes(5000)) == bytes(5000)
            session.connection.close()
        finally:
            ended.set()
            forward.join()


def _forward_datagrams(near: socket.socket, far: socket.socket, ended: threading.Event) -> None:
    import select

    tool = None
    while not ended.is_set():
        for ready in select.select([near, far], [], [], 0.05)[0]:
            if ready is near:
                data, tool = near.recvfrom(2048)
                far.send(data)
            elif tool:
                near.sendto(far.recv(2048), tool)


def test_a_controller_that_died_is_found_at_the_same_places(plcrt: Plcrt, eventually: Callable[..., Any]) -> None:
    """The port was free, not chosen: it stays, and a tool that was connected goes on by itself."""
    with plctool.connect(f"tcp:{plcrt.tcp}") as tcp, plctool.connect(f"udp:{plcrt.udp}") as udp:
        before = tcp.identity(), udp.identity()
        worker = eventually(lambda: plcrt.worker)
        os.kill(worker, signal.SIGKILL)
        eventually(lambda: plcrt.worker not in (None, worker))
        assert (tcp.identity(), udp.identity()) == before


def test_what_cannot_be_reached_is_told(tool: Any, plcrt: Plcrt) -> None:
    with socket.create_server(("127.0.0.1", 0)) as mute:
        free = mute.getsockname()[1]
    for where, status, said in (
        (["--tcp", f"127.0.0.1:{free}"], 3, "refuses connections"),
        (["--tcp", "no-such-host.invalid"], 3, "unknown"),
        (["--udp", "no-such-host.invalid"], 3, "unknown"),
        (["--udp", _own_loopback()], 3, "No device answers"),
        (["--tcp", "127.0.0.1:0"], 2, "is not a valid HOST"),
        (["--udp", "127.0.0.1:99999"], 2, "is not a valid HOST"),
        (["--tcp", plcrt.tcp, "--udp", plcrt.udp], 2, "Name one link only"),
    ):
        done = tool("status", *where)
        assert (done.status, done.err.count("\n")) == (status, 1), done.err
        assert said in done.err


def test_what_answers_and_is_no_controller_is_told() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        thread = threading.Thread(target=_answer_http, args=(server,))
        thread.start()
        link = f"tcp:127.0.0.1:{server.getsockname()[1]}"
        with plctool.connect(link) as plc, pytest.raises(LinkError, match="is not the protocol"):
            plc.identity()
        thread.join()


def _answer_http(server: socket.socket) -> None:
    connected, _ = server.accept()
    with connected:
        connected.recv(100)
        connected.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        with suppress(OSError):
            while connected.recv(100):
                pass  # the tool closes first, which may have asked again


def test_a_place_in_use_is_refused_by_plcrt(plcrt: Plcrt, tmp_path: Path) -> None:
    for option, place in (("--tcp", plcrt.tcp), ("--udp", plcrt.udp)):
        with pytest.raises(PlcError, match=f"cannot serve {option} .* in use"):
            Plcrt(tmp_path / "other.flash", option, place).start()
