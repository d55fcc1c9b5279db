"""What a program on plcrt does with sockets; the rest of the promise is in tests/socket_programs.py."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

sys.path.append(str(Path(__file__).parents[1]))

from socket_programs import FLOOD, INVALID_ADDR, PROGRAM, STEPS, ProgramSockets, check_flood, check_steps

from plctool import connect
from plctool.cli.main import main
from plctool.controller import Controller
from plctool.device import Plc
from plctool.testing.plcrt import Plcrt, find_plcrt
from plctool.testing.waiting import eventually


@pytest.fixture
def port() -> int:
    """One that is free for TCP and UDP."""
    with socket.socket() as tcp, socket.socket(type=socket.SOCK_DGRAM) as udp:
        tcp.bind(("127.0.0.1", 0))
        udp.bind(tcp.getsockname())
        return int(tcp.getsockname()[1])


@pytest.fixture
def options() -> tuple[str, ...]:
    return ()


@pytest.fixture(scope="module")
def image(tmp_path_factory) -> Path:
    source = tmp_path_factory.mktemp("program") / "sockets.st"
    source.write_text(PROGRAM)
    assert main(["build", str(source), "-o", str(source.with_suffix(".cdl"))]) == 0
    return source.with_suffix(".cdl")


@pytest.fixture
def plc(plcrt: Plcrt, image: Path, options: tuple[str, ...]) -> Iterator[Plc]:
    plcrt.stop()
    plcrt.options = ("--tcp", "0", *options)
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        yield plc


class TestPlcrt(ProgramSockets):
    def wait(self, plc: Controller, condition: Callable[[], Any]) -> None:
        eventually(condition)

    def stopped(self, plc: Controller, port: int) -> None:
        def is_free() -> bool:
            with socket.socket(type=socket.SOCK_DGRAM) as udp:
                try:
                    udp.bind(("0.0.0.0", port))
                except OSError:
                    return False
            with socket.socket() as tcp:
                return tcp.connect_ex(("127.0.0.1", port)) != 0

        eventually(is_free)


def test_other_software_talks_to_the_program(plc: Plc, port: int) -> None:
    plc.write({"Main.port": port, "Main.listen": True, "Main.serve": True})
    eventually(lambda: plc.read("Main.peer.xActive") and plc.read("Main.server.xActive"))
    with socket.socket(type=socket.SOCK_DGRAM) as udp, socket.create_connection(("127.0.0.1", port), 20) as tcp:
        udp.settimeout(20)
        udp.sendto(b"hello", ("127.0.0.1", port))
        assert udp.recvfrom(100) == (b"hello", ("127.0.0.1", port))
        tcp.sendall(b"stream")
        assert tcp.recv(100) == b"stream"


@pytest.mark.parametrize("options", [("--net", "127.1.0.0/16,10.1.2.0/24:1-9")])
def test_program_reaches_only_what_net_allows(plc: Plc, port: int) -> None:
    plc.write({"Main.port": port, "Main.connect": True})
    eventually(lambda: plc.read("Main.client.life.calls.code") == INVALID_ADDR)
    eventually(lambda: any(f"127.0.0.1 port {port}: allow it with --net" in entry.text for entry in plc.log()))
    plc.write({"Main.serve": True, "Main.listen": True})
    eventually(lambda: plc.read("Main.server.xActive") and plc.read("Main.peer.xActive"))
    with socket.create_connection(("127.0.0.1", port), 20) as tcp:
        tcp.settimeout(20)
        assert tcp.recv(1) == b""
    with socket.socket(type=socket.SOCK_DGRAM) as udp:
        udp.sendto(b"hello", ("127.0.0.1", port))
    assert plc.read("Main.datagrams") == 0


def test_a_list_of_addresses_that_is_none_is_refused(tmp_path: Path) -> None:
    for text in ("", "1.2.3", "1.2.3.4/33", "1.2.3.4:", "1.2.3.4:9-8", "1.2.3.4,", "1.2.3.4:70000", "a", "1.2.3.4;"):
        done = subprocess.run(
            [find_plcrt(), "--flash", str(tmp_path / "f"), "--serial", "pty", "--net", text],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 2 and "is not a list of addresses: write for example" in done.stderr, text


def test_functions_of_syslibsockets_reach_each_other(plcrt: Plcrt, port: int, tmp_path: Path) -> None:
    source = tmp_path / "steps.st"
    source.write_text(STEPS)
    assert main(["build", str(source), "-o", str(source.with_suffix(".cdl"))]) == 0
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(source.with_suffix(".cdl"))
        check_steps(plc, port, eventually)


def test_program_that_opens_and_never_closes_is_refused_past_the_limit(plcrt: Plcrt, tool) -> None:
    image = tool.build("flood", FLOOD)
    plcrt.stop()
    plcrt.options = ("--tcp", "0")
    plcrt.start()
    with connect(f"tcp:{plcrt.tcp}") as plc:
        plc.flash(image)
        before = open_files(plcrt)
        check_flood(plc, eventually, lambda: eventually(lambda: open_files(plcrt) == before))


def open_files(plcrt: Plcrt) -> int:
    return len(os.listdir(f"/proc/{plcrt.worker}/fd"))
