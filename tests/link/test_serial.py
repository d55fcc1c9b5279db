"""The serial transport on pseudo terminals: bytes in and out, ports that are taken, lines that go away."""

from __future__ import annotations

import math
import os
import threading
import tty
from collections.abc import Iterator
from pathlib import Path

import pytest

from plctool.errors import LinkError
from plctool.link import simplecom
from plctool.link.serial import SerialTransport

PATIENCE = 60.0  # for what is bound to come [s]


class Terminal:
    """Both ends of a pseudo terminal; `path` is what the tool opens."""

    def __init__(self) -> None:
        self.far, self._near = os.openpty()
        tty.setraw(self._near)
        self.path = os.ttyname(self._near)

    def close(self) -> None:
        for end in (self.far, self._near):
            if end >= 0:
                os.close(end)
        self.far = self._near = -1


@pytest.fixture
def terminal() -> Iterator[Terminal]:
    terminal = Terminal()
    yield terminal
    terminal.close()


@pytest.fixture
def transport(terminal: Terminal) -> Iterator[SerialTransport]:
    transport = SerialTransport(terminal.path)
    yield transport
    transport.close()


def test_packets_go_out_as_frames(terminal: Terminal, transport: SerialTransport) -> None:
    transport.send(b"hello #1")
    assert os.read(terminal.far, 100) == simplecom.encode(b"hello #1")


def test_packets_are_taken_out_of_the_stream_one_by_one(terminal: Terminal, transport: SerialTransport) -> None:
    os.write(terminal.far, b"noise" + simplecom.encode(b"one") + simplecom.encode(b"two")[:4])
    assert transport.receive(PATIENCE) == b"one"
    assert transport.receive(0.0) is None
    os.write(terminal.far, simplecom.encode(b"two")[4:])
    assert transport.receive(PATIENCE) == b"two"


def test_waiting_ends_in_time(transport: SerialTransport) -> None:
    begin = transport.now()
    assert transport.receive(0.05) is None
    assert 0.05 <= transport.now() - begin < PATIENCE


def test_a_packet_ends_the_waiting(terminal: Terminal, transport: SerialTransport) -> None:
    timer = threading.Timer(0.02, os.write, (terminal.far, simplecom.encode(b"late")))
    timer.start()
    begin = transport.now()
    assert transport.receive(30.0) == b"late"
    assert transport.now() - begin < 10.0
    timer.join()


def test_a_port_in_use_is_a_link_error_that_says_so(terminal: Terminal, transport: SerialTransport) -> None:
    with pytest.raises(LinkError, match="another program uses it"):
        SerialTransport(terminal.path)


def test_a_line_that_goes_away_is_a_link_error(terminal: Terminal, transport: SerialTransport) -> None:
    terminal.close()
    with pytest.raises(LinkError, match="lost") as caught:
        transport.receive(1.0)
    assert caught.value.code == "link-lost"
    with pytest.raises(LinkError, match="lost"):
        transport.send(b"anybody?")


def test_closing_twice_is_harmless(transport: SerialTransport) -> None:
    transport.close()
    transport.close()


def test_the_rate_of_a_pseudo_terminal_is_unknown(transport: SerialTransport) -> None:
    assert transport.byte_rate == math.inf


@pytest.mark.parametrize("kind", ["file", "folder"])
def test_what_is_no_terminal_is_a_link_error(tmp_path: Path, kind: str) -> None:
    path = tmp_path
    if kind == "file":
        path = tmp_path / "file"
        path.write_text("no terminal")
    with pytest.raises(LinkError, match="Cannot open"):
        SerialTransport(str(path))


def test_a_url_of_pyserial_is_opened() -> None:
    transport = SerialTransport("loop://")
    transport.send(b"echo")
    assert transport.receive(PATIENCE) == b"echo"
    transport.close()
